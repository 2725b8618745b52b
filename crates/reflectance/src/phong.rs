#![doc = include_str!("phong.md")]

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::sync::Arc;

use sunglint_plugin::{Args, BindError, Default, Model, ModelInfo, Param, SpectralValue};
use sunglint_radiometry::{Dimension, LocalDir, SpectralGrid};

use crate::quadrature::tanh_sinh;
use crate::sampling::{cosine_hemisphere, cosine_lobe};
use crate::spectral::{ROUNDING, reflectance_on, stated};
use crate::{AngularSpectra, Bsdf, Lobes, Sample, Split};

/// Largest exponent.
const STEEPEST: f64 = 1e6;

/// The Phong model, both variants.
pub const MODEL: Model<dyn Bsdf> = Model {
    info: ModelInfo {
        name: "phong",
        summary: "Lambert plus a cosine-power lobe about the mirror direction or the half vector, normalised",
        manual: include_str!("phong.md"),
        params: &[
            Param::spectrum("diffuse", Dimension::Fraction, Default::Absent, "k_d; else the material's less k_s")
                .within(0.0, 1.0),
            Param::spectrum("specular", Dimension::Fraction, Default::Required, "k_s, the lobe at normal incidence")
                .within(0.0, 1.0),
            Param::quantity("exponent", Dimension::Fraction, Default::Required, "m, the steepness of the lobe")
                .within(0.0, STEEPEST),
            Param::word("variant", &["mirror", "half"], Default::Word("mirror"), "cosine to the mirror or half vector"),
        ],
    },
    bind,
};

fn bind(args: &Args, grid: &SpectralGrid) -> Result<Arc<dyn Bsdf>, BindError> {
    let missing = |name: &'static str| BindError::new("S05", name, format!("`phong` needs `{name}`"));
    let specular = args.spectral("specular").ok_or_else(|| missing("specular"))?;
    let exponent = args.number("exponent").ok_or_else(|| missing("exponent"))?;
    if !(0.0..=STEEPEST).contains(&exponent) {
        let message = format!("the exponent lies between 0 and {STEEPEST:e}, not {exponent}");
        return Err(BindError::new("U05", "exponent", message));
    }
    let half = args.word("variant") == Some("half");
    let lobe = if half { Lobe::half(exponent) } else { Lobe::mirror(exponent) };
    let k_s = reflectance_on("specular", specular, grid)?;
    let k_d = match (args.spectral("diffuse"), args.spectral("reflectance")) {
        (Some(diffuse), _) => {
            let k_d = reflectance_on("diffuse", diffuse, grid)?;
            // Overshoot of a bin's straight line, where the tables themselves keep to 1, goes.
            let sum = |d: f64, s: f64| d + s;
            at_most_one(diffuse, &k_d, specular, &k_s, grid, sum, "k_d + k_s returns more than it gets")?;
            k_d.iter().zip(&k_s).map(|(d, s)| d.min(1.0 - s)).collect()
        }
        (None, Some(total)) => {
            let total_on_grid = reflectance_on("reflectance", total, grid)?;
            let short = |total: f64, s: f64| 1.0 + s - total;
            let message = "k_s exceeds the material's reflectance";
            at_most_one(total, &total_on_grid, specular, &k_s, grid, short, message)?;
            total_on_grid.iter().zip(&k_s).map(|(total, s)| (total - s).max(0.0)).collect()
        }
        (None, None) => {
            return Err(BindError::of_block("S05", "`phong` has no diffuse part: neither its own nor the material's")
                .help("write `diffuse 0.18`, or give the material a `reflectance`"));
        }
    };
    Ok(Arc::new(Phong::new(k_d, k_s, lobe)))
}

/// That `sum` of two stated spectra is at most 1 at every entry.
fn at_most_one(
    a: &SpectralValue,
    a_on_grid: &[f64],
    b: &SpectralValue,
    b_on_grid: &[f64],
    grid: &SpectralGrid,
    sum: impl Fn(f64, f64) -> f64,
    fault: &str,
) -> Result<(), BindError> {
    for ((entry, a_on_grid), b_on_grid) in grid.entries().iter().zip(a_on_grid).zip(b_on_grid) {
        let excess = sum(stated(a, entry, *a_on_grid), stated(b, entry, *b_on_grid)) - 1.0;
        if excess > ROUNDING {
            let nm = entry.wavelength.nm();
            return Err(BindError::of_block("M05", format!("{fault} at {nm:.1} nm, by {excess:.4}")));
        }
    }
    Ok(())
}

/// A cosine-power lobe of unit k_s.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Lobe {
    exponent: f64,
    half: bool,
    /// Value at its peak \[sr⁻¹\].
    peak: f64,
}

impl Lobe {
    /// (m+2)/(2π) (r·o)^m [Lewis1994, CGF 13(2)].
    fn mirror(m: f64) -> Self {
        Self { exponent: m, half: false, peak: (m + 2.0) / TAU }
    }

    /// (m+2)(m+4)/(8π (2^(−m/2) + m)) (n·h)^m, exactly normalised at normal incidence.
    fn half(m: f64) -> Self {
        let peak = (m + 2.0) * (m + 4.0) / (8.0 * PI * ((-0.5 * m).exp2() + m));
        Self { exponent: m, half: true, peak }
    }

    /// Value for two directions above the surface \[sr⁻¹\].
    fn at(&self, incident: LocalDir, outgoing: LocalDir) -> f64 {
        self.peak * self.power(incident, outgoing, self.exponent)
    }

    /// The lobe's cosine to a power, from small differences rather than from a cosine near 1.
    fn power(&self, incident: LocalDir, outgoing: LocalDir, exponent: f64) -> f64 {
        if self.half {
            let h = incident.vec() + outgoing.vec();
            let tan_squared = h.truncate().length_squared() / (h.z * h.z);
            return (-0.5 * exponent * tan_squared.ln_1p()).exp();
        }
        let versine = 0.5 * (incident.vec() - outgoing.mirrored().vec()).length_squared();
        if versine >= 1.0 { 0.0 } else { (exponent * (-versine).ln_1p()).exp() }
    }

    /// A direction with density [`density`](Self::density); `None` where there is none for that half vector.
    fn sample(&self, outgoing: LocalDir, u: [f64; 2]) -> Option<LocalDir> {
        if !self.half {
            return Some(cosine_lobe(outgoing.mirrored(), self.exponent, u));
        }
        let h = cosine_lobe(LocalDir::from_unit(glam::DVec3::Z), self.exponent + 1.0, u);
        let cosine = h.dot(outgoing);
        (cosine > 0.0).then(|| LocalDir::from_unit((2.0 * cosine * h.vec() - outgoing.vec()).normalize()))
    }

    /// (m+1)/(2π) (r·o)^m, or (m+2)/(2π) (n·h)^(m+1) / (4 o·h) \[sr⁻¹\].
    fn density(&self, incident: LocalDir, outgoing: LocalDir) -> f64 {
        let m = self.exponent;
        if !self.half {
            return (m + 1.0) / TAU * self.power(incident, outgoing, m);
        }
        // o·h = |i + o|/2 for unit vectors.
        let o_dot_h = 0.5 * (incident.vec() + outgoing.vec()).length();
        (m + 2.0) / TAU * self.power(incident, outgoing, m + 1.0) / (4.0 * o_dot_h)
    }

    /// Directional-hemispherical reflectance at `theta` \[rad\]: one integral is done by hand, the other by tanh-sinh.
    fn albedo(&self, theta: f64) -> f64 {
        let m = self.exponent;
        // Beyond this angle cos^m is below e⁻⁴⁵.
        let reach = (-45.0 / m).exp().acos();
        let power = |t: f64| if m == 0.0 { 1.0 } else { t.cos().max(0.0).powf(m) };
        let (sin_t, cos_t) = theta.sin_cos();
        if self.half {
            // In polar coordinates t, φ of h: o_z = 2 (i·h) cos t − cos θ, dω_o = 4 (i·h) dω_h, i·h = a + b cos φ.
            let inner = |t: f64| {
                let (a, b) = (cos_t * t.cos(), sin_t * t.sin());
                let phi = if (theta + 2.0 * t).cos() >= 0.0 {
                    PI
                } else {
                    ((0.5 * cos_t / t.cos() - a) / b).clamp(-1.0, 1.0).acos()
                };
                let (s, c) = phi.sin_cos();
                let square = 2.0 * a * a * phi + 4.0 * a * b * s + b * b * (phi + s * c);
                let line = 2.0 * a * phi + 2.0 * b * s;
                4.0 * power(t) * t.sin() * (2.0 * t.cos() * square - cos_t * line)
            };
            // Up to `whole` every azimuth of h sends light up, from `none` on no azimuth does.
            let (whole, none) = (0.5 * (FRAC_PI_2 - theta), 0.5 * (FRAC_PI_2 + theta));
            let (whole, none) = (whole.clamp(0.0, reach), none.min(reach));
            return self.peak * (tanh_sinh(0.0, whole, inner) + tanh_sinh(whole, none, inner));
        }
        // In polar coordinates α, φ about r: o_z = a − b cos φ, its positive part integrated over φ.
        let inner = |alpha: f64| {
            let (a, b) = (cos_t * alpha.cos(), sin_t * alpha.sin());
            let above = if a >= b {
                TAU * a
            } else {
                let phi = (a / b).clamp(0.0, 1.0).acos();
                2.0 * (a * (PI - phi) + b * phi.sin())
            };
            power(alpha) * alpha.sin() * above
        };
        let whole = (FRAC_PI_2 - theta).clamp(0.0, reach);
        self.peak * (tanh_sinh(0.0, whole, inner) + tanh_sinh(whole, reach, inner))
    }
}

struct Phong {
    k_d: Vec<f64>,
    k_s: Vec<f64>,
    lobe: Lobe,
    split: Split,
    lobes: Lobes,
    /// Probability with which the lobe is drawn.
    specular_choice: f64,
}

impl Phong {
    fn new(k_d: Vec<f64>, k_s: Vec<f64>, lobe: Lobe) -> Self {
        let theta: Vec<f64> = (0..=90).map(|degree| f64::from(degree).to_radians()).collect();
        let albedo: Vec<f64> = theta.iter().map(|theta| lobe.albedo(*theta).min(1.0)).collect();
        let scaled = |factor: f64| k_s.iter().map(|k_s| factor * k_s).collect::<Vec<f64>>();
        let solid_angle = theta.iter().zip(&albedo).map(|(theta, rho_s)| {
            let full = lobe.peak * theta.cos();
            if *rho_s < TAU * full { rho_s / full } else { TAU }
        });
        let split = Split {
            diffuse: AngularSpectra::constant(k_d.clone()),
            solid_angle: solid_angle.collect(),
            specular: AngularSpectra::new(theta, albedo.iter().map(|albedo| scaled(*albedo)).collect()),
            printed: AngularSpectra::constant(scaled(PI * lobe.peak)),
        };
        let (d, s) = (k_d.iter().sum::<f64>(), k_s.iter().sum::<f64>());
        let lobes = Lobes { diffuse: d > 0.0, glossy: s > 0.0, ..Lobes::default() };
        let specular_choice = match (lobes.diffuse, lobes.glossy) {
            (true, true) => (s / (d + s)).clamp(0.1, 0.9),
            (_, glossy) => f64::from(u8::from(glossy)),
        };
        Self { k_d, k_s, lobe, split, lobes, specular_choice }
    }
}

impl Bsdf for Phong {
    fn lobes(&self) -> Lobes {
        self.lobes
    }

    fn split(&self) -> &Split {
        &self.split
    }

    fn eval(&self, incident: LocalDir, outgoing: LocalDir, f: &mut [f64]) {
        if incident.cos() <= 0.0 || outgoing.cos() <= 0.0 {
            return f.fill(0.0);
        }
        let lobe = self.lobe.at(incident, outgoing);
        for ((f, k_d), k_s) in f.iter_mut().zip(&self.k_d).zip(&self.k_s) {
            *f = k_d / PI + k_s * lobe;
        }
    }

    fn sample(&self, outgoing: LocalDir, u: [f64; 3]) -> Option<Sample> {
        if outgoing.cos() <= 0.0 || self.lobes == Lobes::default() {
            return None;
        }
        let incident = if u[2] < self.specular_choice {
            self.lobe.sample(outgoing, [u[0], u[1]])?
        } else {
            cosine_hemisphere([u[0], u[1]])
        };
        (incident.cos() > 0.0).then(|| Sample { incident, mirror: false, pdf: self.pdf(incident, outgoing) })
    }

    fn pdf(&self, incident: LocalDir, outgoing: LocalDir) -> f64 {
        if incident.cos() <= 0.0 || outgoing.cos() <= 0.0 || self.lobes == Lobes::default() {
            return 0.0;
        }
        let lobe = if self.lobes.glossy { self.lobe.density(incident, outgoing) } else { 0.0 };
        (1.0 - self.specular_choice) * incident.cos() / PI + self.specular_choice * lobe
    }

    fn albedo(&self, incident: LocalDir, rho: &mut [f64]) {
        if incident.cos() <= 0.0 {
            return rho.fill(0.0);
        }
        let lobe = if self.lobes.glossy { self.lobe.albedo(incident.theta()).min(1.0) } else { 0.0 };
        for ((rho, k_d), k_s) in rho.iter_mut().zip(&self.k_d).zip(&self.k_s) {
            *rho = k_d + k_s * lobe;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Published check values for m = 20 at 0, 30, 60 and 80°, three digits: 1200 × 720 midpoint sums.
    #[test]
    fn the_albedo_of_both_lobes_is_that_of_independent_sums() {
        let mirror = [1.000, 0.866, 0.501, 0.200];
        let half = [1.000, 0.776, 0.328, 0.111];
        for (lobe, expected) in [(Lobe::mirror(20.0), mirror), (Lobe::half(20.0), half)] {
            for (degree, rho) in [0.0_f64, 30.0, 60.0, 80.0].into_iter().zip(expected) {
                let albedo = lobe.albedo(degree.to_radians());
                assert!((albedo - rho).abs() < 6e-4, "{lobe:?} {degree}: {albedo}");
            }
        }
    }

    /// At normal incidence both lobes are normalised for every exponent: ρ = 1.
    #[test]
    fn both_lobes_are_normalised_at_normal_incidence() {
        for m in [0.0, 0.3, 1.0, 5.0, 20.0, 1e3, 1e6] {
            for lobe in [Lobe::mirror(m), Lobe::half(m)] {
                assert!((lobe.albedo(0.0) - 1.0).abs() < 1e-9, "{lobe:?}: {}", lobe.albedo(0.0));
            }
        }
    }

    /// A narrow mirror lobe loses the cosine (f has no 1/cos θ), a narrow half-vector lobe its square.
    #[test]
    fn narrow_lobes_lose_the_cosine_and_its_square() {
        for degree in [30.0_f64, 60.0, 80.0] {
            let (theta, cos) = (degree.to_radians(), degree.to_radians().cos());
            assert!((Lobe::mirror(1e6).albedo(theta) / cos - 1.0).abs() < 1e-5);
            // n·h^m spreads over (2/m) tan² θ in the neglected curvature: relative error of the order 1/(m cos² θ).
            assert!((Lobe::half(1e6).albedo(theta) / (cos * cos) - 1.0).abs() < 2e-4, "{degree}");
        }
    }

    /// The trait's contract for a BRDF peak: ρ_s = R_s Ω_s cos θ/π with R_s as printed.
    #[test]
    fn the_split_of_a_lobe_is_consistent() {
        let phong = Phong::new(vec![0.5], vec![0.3], Lobe::mirror(50.0));
        for degree in [0.0_f64, 20.0, 45.0, 70.0] {
            let theta = degree.to_radians();
            let (rho_s, r_s) = (phong.split.specular.at(theta, 0), phong.split.printed.at(theta, 0));
            let expected = r_s * phong.split.solid_angle_at(theta) * theta.cos() / PI;
            assert!((rho_s / expected - 1.0).abs() < 1e-9, "{degree}");
        }
    }
}
