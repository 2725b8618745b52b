#![doc = include_str!("he_torrance.md")]

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use libm::erfc;
use sunglint_plugin::{Args, BindError, Default, Model, ModelInfo, Param};
use sunglint_radiometry::{Dimension, LocalDir, SpectralGrid};

use crate::Bsdf;
use crate::composite::{Composite, Energy, Gloss, Lambert, Part};
use crate::fresnel::Interface;
use crate::microfacet::{Half, beckmann, normal, reflected};
use crate::sampling::pick;
use crate::spectral::{OnGrid, fraction_or_zero, required, spectrum_within};

const HEIGHT: Param =
    Param::spectrum("height", Dimension::Wavelength, Default::Required, "σ₀, rms height of the surface")
        .within(0.0, 1e4);
const CORRELATION: Param = Param::spectrum(
    "correlation",
    Dimension::Wavelength,
    Default::Required,
    "τ, length over which heights are correlated",
)
.within(1e-2, 1e6);

/// The model of He, Torrance, Sillion and Greenberg.
pub const MODEL: Model<dyn Bsdf> = Model {
    info: ModelInfo {
        name: "he_torrance",
        summary: "wave optics of a rough surface: coherent mirror, directional-diffuse lobe, uniform diffuse part",
        manual: include_str!("he_torrance.md"),
        params: &[
            Interface::N,
            Interface::K,
            HEIGHT,
            CORRELATION,
            Param::spectrum("diffuse", Dimension::Fraction, Default::Number(0.0), "a, the uniform diffuse part")
                .within(0.0, 1.0),
        ],
    },
    bind,
};

fn bind(args: &Args, grid: &SpectralGrid) -> Result<Arc<dyn Bsdf>, BindError> {
    let name = "he_torrance";
    let interface = Interface::bind(name, args, grid)?;
    let of = |param: &Param| spectrum_within(param, required(name, args, param.name)?, grid);
    let (height, correlation) = (of(&HEIGHT)?, of(&CORRELATION)?);
    let steepest = height.all().iter().zip(correlation.all()).map(|(s, t)| 2.0 * s / t).fold(0.0, f64::max);
    if steepest > 2.0 {
        let message = format!("slopes 2σ₀/τ reach {steepest:.2}; facets steeper than 2 are beyond the model");
        return Err(BindError::new("U05", "height", message).help("a smaller `height`, or a longer `correlation`"));
    }
    let diffuse = fraction_or_zero(args, "diffuse", grid)?;
    let wavelength = grid.entries().iter().map(|entry| entry.wavelength.um()).collect();
    let lobe = Waves::new(interface, height, correlation, wavelength);
    Ok(Arc::new(Composite::new(Lambert::new(diffuse), lobe, grid.len(), true, Energy::Looked)))
}

/// g above which the lobe takes its geometric limit.
const GEOMETRIC: f64 = 30.0;
/// g up to which the coherent spike is kept.
const COHERENT: f64 = 20.0;

/// Coherent spike and directional-diffuse lobe.
struct Waves {
    interface: Interface,
    height: OnGrid,
    correlation: OnGrid,
    wavelength: Vec<f64>,
    /// Slope of the lobe per entry, and those that draws are made with.
    slope: OnGrid,
    drawn: Vec<f64>,
    mirror: bool,
}

impl Waves {
    fn new(interface: Interface, height: OnGrid, correlation: OnGrid, wavelength: Vec<f64>) -> Self {
        // The lobe's width: that of its geometric limit, and of diffraction at the length of correlation.
        let slopes: Vec<f64> = (wavelength.iter().enumerate())
            .map(|(entry, lambda)| {
                let tau = correlation.at(entry);
                (2.0 * height.at(entry) / tau).hypot(lambda / (TAU * tau)).clamp(1e-4, 2.0)
            })
            .collect();
        let slope = OnGrid::new(slopes);
        let drawn = slope.representatives();
        let mut lobe = Self { interface, height, correlation, wavelength, slope, drawn, mirror: true };
        let mut rho = vec![0.0; lobe.wavelength.len()];
        (0..90).for_each(|degree| lobe.add_mirror(f64::from(degree).to_radians(), &mut rho));
        lobe.mirror = rho.iter().any(|rho| *rho > 1e-9);
        lobe
    }

    /// [`shaded`] of an entry.
    fn shaded(&self, entry: usize, incident: Angle, outgoing: Angle) -> (f64, f64) {
        shaded(self.height.at(entry), self.correlation.at(entry), incident, outgoing)
    }

    /// Whether the surface is the same at every wavelength.
    fn is_even(&self) -> bool {
        self.height.constant().is_some() && self.correlation.constant().is_some()
    }

    /// G S D/(π cos θ_i cos θ_o), the directional-diffuse lobe of a surface that reflects all.
    fn lobe(&self, entry: usize, half: &Half, shaded: (f64, f64), incident: LocalDir, outgoing: LocalDir) -> f64 {
        let (sigma, shadowing) = shaded;
        let (lambda, tau) = (self.wavelength[entry], self.correlation.at(entry));
        let cosines = incident.cos() + outgoing.cos();
        let g = (TAU * sigma / lambda * cosines).powi(2);
        let each = incident.cos() * outgoing.cos();
        if g > GEOMETRIC {
            let m = 2.0 * sigma / tau;
            let q = half.tan_squared / (m * m);
            let correction = (1.0 + (2.0 - 4.0 * q + q * q) / (2.0 * g)).max(0.0);
            return shadowing * beckmann(m, half) * correction / (4.0 * each);
        }
        // v_xy²τ²/4 = (πτ/λ)² |H_xy|², H_xy² = H_z² tan² θ_h.
        let w = (PI * tau / lambda * cosines).powi(2) * half.tan_squared;
        let d = (PI * tau / lambda).powi(2) / 4.0 * series(g, w);
        // G = (|H|²/H_z)² with H = ω_i + ω_o: |H| = 2 cos b.
        let geometry = (4.0 * half.cos_b * half.cos_b / cosines).powi(2);
        geometry * shadowing * d / (PI * each)
    }
}

/// σ, the roughness that is left once what lies in shadow does not count, and S, Smith's shadowing
/// [He1991, eqs. 80, 23–25], for two angles to the normal.
fn shaded(sigma_0: f64, tau: f64, incident: Angle, outgoing: Angle) -> (f64, f64) {
    if sigma_0 == 0.0 {
        return (0.0, 1.0);
    }
    // x = τ cot θ/(2σ₀)
    let x = |angle: Angle| tau / (2.0 * sigma_0 * angle.tan.max(1e-300));
    let hidden = |angle: Angle| angle.tan * erfc(x(angle));
    let sum = (hidden(incident) + hidden(outgoing)) / (8.0 * PI).sqrt();
    let y = lambert_root(sum);
    let shadowing = |angle: Angle| {
        let x = x(angle);
        let lambda = 0.5 * ((-x * x).exp() / (PI.sqrt() * x) - erfc(x)).max(0.0);
        (1.0 - 0.5 * erfc(x)) / (1.0 + lambda)
    };
    (sigma_0 / y.hypot(1.0), shadowing(incident) * shadowing(outgoing))
}

#[derive(Clone, Copy)]
struct Angle {
    tan: f64,
}

impl Angle {
    fn of(direction: LocalDir) -> Self {
        Self { tan: direction.vec().truncate().length() / direction.cos() }
    }
}

/// y with y exp(y²/2) = `sum`, by Newton's steps from above.
fn lambert_root(sum: f64) -> f64 {
    if sum < 1e-12 {
        return sum;
    }
    let mut y = sum.min((2.0 * (1.0 + sum).ln()).sqrt() + 0.5);
    for _ in 0..50 {
        let e = (0.5 * y * y).exp();
        let step = (y * e - sum) / (e * (1.0 + y * y));
        y -= step;
        if step.abs() < 1e-14 * y {
            break;
        }
    }
    y
}

/// Σ_{m ≥ 1} g^m e^(−g)/(m! m) exp(−w/m), 0 for g = 0.
fn series(g: f64, w: f64) -> f64 {
    let mut poisson = (-g).exp();
    let mut sum = 0.0;
    for m in 1..400 {
        let m = f64::from(m);
        poisson *= g / m;
        sum += poisson / m * (-w / m).exp();
        if m > g && poisson < 1e-16 * sum.max(1e-300) {
            break;
        }
    }
    sum
}

impl Part for Waves {
    fn is_present(&self) -> bool {
        self.height.range().1 > 0.0
    }

    fn add(&self, incident: LocalDir, outgoing: LocalDir, f: &mut [f64]) {
        let half = Half::of(incident, outgoing);
        let (i, o) = (Angle::of(incident), Angle::of(outgoing));
        let even = self.is_even().then(|| self.shaded(0, i, o));
        self.interface.each(f.len(), half.cos_b, |entry, fresnel| {
            let shaded = even.unwrap_or_else(|| self.shaded(entry, i, o));
            f[entry] += fresnel * self.lobe(entry, &half, shaded, incident, outgoing);
        });
    }
}

impl Gloss for Waves {
    fn draw(&self, outgoing: LocalDir, u: [f64; 2]) -> Option<LocalDir> {
        let (chosen, u1) = pick(self.drawn.len(), u[1]);
        let m = self.drawn[chosen];
        reflected(normal(-m * m * (-u[0]).ln_1p(), u1), outgoing)
    }

    fn drawn_with(&self, incident: LocalDir, outgoing: LocalDir) -> f64 {
        let half = Half::of(incident, outgoing);
        let of = |m: &f64| beckmann(*m, &half) * half.cos / (4.0 * half.cos_b);
        self.drawn.iter().map(of).sum::<f64>() / self.drawn.len() as f64
    }

    fn slope(&self, entry: usize) -> f64 {
        self.slope.at(entry)
    }

    /// Diffraction reaches beyond any Gaussian lobe of facets.
    fn covers(&self) -> bool {
        false
    }

    /// F e^(−g) S, where g leaves anything of it.
    fn add_mirror(&self, theta: f64, rho: &mut [f64]) {
        if !self.mirror || theta.cos() <= 0.0 {
            return;
        }
        let angle = Angle { tan: theta.tan() };
        self.interface.each(rho.len(), theta.cos(), |entry, fresnel| {
            let (sigma, shadowing) = self.shaded(entry, angle, angle);
            let g = (TAU * sigma / self.wavelength[entry] * 2.0 * theta.cos()).powi(2);
            if g <= COHERENT {
                rho[entry] += fresnel * shadowing * (-g).exp();
            }
        });
    }

    fn has_mirror(&self) -> bool {
        self.mirror
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn waves(height: f64, correlation: f64) -> Waves {
        let interface = Interface::of(vec![1e-3], vec![50.0]);
        Waves::new(interface, OnGrid::new(vec![height]), OnGrid::new(vec![correlation]), vec![0.55])
    }

    /// y e^(y²/2) from tiny to large sums.
    #[test]
    fn the_effective_roughness_solves_its_equation() {
        for sum in [1e-9, 1e-3, 0.1, 1.0, 10.0, 1e3] {
            let y = lambert_root(sum);
            assert!((y * (0.5 * y * y).exp() / sum - 1.0).abs() < 1e-10, "{sum}: {y}");
        }
    }

    /// At g = 30, where the series gives way to the geometric limit, the two agree to the next order, 1/g².
    #[test]
    fn the_series_meets_its_geometric_limit() {
        let g: f64 = 30.0;
        for q in [0.0_f64, 0.5, 1.0, 2.0] {
            // D e^… with w = q g: Σ → e^(−q)/g [1 + (2 − 4q + q²)/(2g)].
            let limit = (-q).exp() / g * (1.0 + (2.0 - 4.0 * q + q * q) / (2.0 * g));
            assert!((series(g, q * g) / limit - 1.0).abs() < 5e-3, "{q}: {} {limit}", series(g, q * g));
        }
        assert_eq!(series(0.0, 1.0), 0.0);
    }

    /// A surface that is smooth against the wavelength is a mirror: F e^(−g) there, and next to nothing beside it.
    #[test]
    fn a_smooth_surface_is_a_mirror() {
        let smooth = waves(0.005, 2.0);
        let mut rho = [0.0];
        smooth.add_mirror(0.3, &mut rho);
        let g = (TAU * 0.005 / 0.55 * 2.0 * 0.3f64.cos()).powi(2);
        let f = crate::fresnel_conductor(1e-3, 50.0, 0.3f64.cos());
        assert!((rho[0] - f * (-g).exp()).abs() < 1e-3, "{} {}", rho[0], (-g).exp());
    }

    /// Energy: what the spike loses to roughness the lobe returns, to what shadowing takes; λ/σ from 100 to 1.
    #[test]
    fn spike_and_lobe_return_the_light_together() {
        for (height, correlation) in [(0.005, 3.0), (0.02, 3.0), (0.05, 3.0), (0.1, 3.0), (0.3, 3.0), (0.5, 5.0)] {
            let lobe = waves(height, correlation);
            let model = Composite::new(Lambert::new(vec![0.0]), lobe, 1, true, Energy::Looked);
            let mut rho = [0.0];
            model.albedo(LocalDir::from_polar(0.2, 0.0), &mut rho);
            assert!((0.93..1.01).contains(&rho[0]), "{height} {correlation}: {}", rho[0]);
        }
    }
}
