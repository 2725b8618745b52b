#![doc = include_str!("hapke.md")]

use std::f64::consts::{FRAC_PI_4, PI};
use std::sync::Arc;

use sunglint_plugin::{Args, BindError, Default, Model, ModelInfo, Param};
use sunglint_radiometry::{Dimension, LocalDir, SpectralGrid, relative_azimuth};

use crate::Bsdf;
use crate::composite::{Composite, Energy, Nothing, Part};
use crate::spectral::{OnGrid, required, spectrum_within};

const W: Param = Param::spectrum("w", Dimension::Fraction, Default::Required, "w, single-scattering albedo of a grain")
    .within(0.0, 1.0);
const B: Param =
    Param::spectrum("b", Dimension::Fraction, Default::Number(0.3), "b, width of the grains' lobes").within(0.0, 0.99);
const C: Param =
    Param::spectrum("c", Dimension::Fraction, Default::Number(0.5), "c, share of the backward lobe").within(0.0, 1.0);
const B0: Param =
    Param::spectrum("b0", Dimension::Fraction, Default::Number(0.0), "B₀, height of the opposition surge")
        .within(0.0, 3.0);
const H: Param =
    Param::spectrum("h", Dimension::Fraction, Default::Number(0.06), "h, its angular width").within(1e-3, 10.0);
const ROUGHNESS: Param =
    Param::spectrum("roughness", Dimension::Angle, Default::Number(0.0), "mean slope angle of the macroscopic relief")
        .within(0.0, FRAC_PI_4);

/// Hapke's model of particulate surfaces.
pub const MODEL: Model<dyn Bsdf> = Model {
    info: ModelInfo {
        name: "hapke",
        summary: "particulate surfaces: soils, regolith, snow of large grains; opposition surge and relief",
        manual: include_str!("hapke.md"),
        params: &[W, B, C, B0, H, ROUGHNESS],
    },
    bind,
};

fn bind(args: &Args, grid: &SpectralGrid) -> Result<Arc<dyn Bsdf>, BindError> {
    let of = |param: &Param| spectrum_within(param, required("hapke", args, param.name)?, grid);
    let grains = Grains { w: of(&W)?, b: of(&B)?, c: of(&C)?, b0: of(&B0)?, h: of(&H)?, roughness: of(&ROUGHNESS)? };
    Ok(Arc::new(Composite::new(grains, Nothing, grid.len(), true, Energy::Looked)))
}

struct Grains {
    w: OnGrid,
    b: OnGrid,
    c: OnGrid,
    b0: OnGrid,
    h: OnGrid,
    roughness: OnGrid,
}

/// H(x) of isotropic scatterers [Hapke2002, eq. 13]: 1/{1 − w x [r₀ + ½ (1 − 2 r₀ x) ln((1 + x)/x)]},
/// r₀ = (1 − γ)/(1 + γ), γ = √(1 − w).
fn chandrasekhar_h(w: f64, x: f64) -> f64 {
    if x <= 0.0 {
        return 1.0;
    }
    let gamma = (1.0 - w).sqrt();
    let r0 = (1.0 - gamma) / (1.0 + gamma);
    1.0 / (1.0 - w * x * (r0 + 0.5 * (1.0 - 2.0 * r0 * x) * (1.0 / x).ln_1p()))
}

/// p(b) = (1 − b²)/(1 + 2b cos g + b²)^(3/2), forwards for b > 0 [Henyey1941].
fn lobe(b: f64, cos_g: f64) -> f64 {
    let s = 1.0 + 2.0 * b * cos_g + b * b;
    (1.0 - b * b) / (s * s.sqrt())
}

/// What the relief makes of a pair of directions: effective cosines and the shadows that it casts.
struct Relief {
    mu_0e: f64,
    mu_e: f64,
    shadowing: f64,
}

impl Relief {
    const FLAT: fn(f64, f64) -> Self = |mu_0, mu| Self { mu_0e: mu_0, mu_e: mu, shadowing: 1.0 };

    /// Macroscopic roughness of mean slope angle θ̄ [Hapke1984, eqs. 36–55]: χ = 1/√(1 + π tan² θ̄),
    /// E₁(y) = exp(−(2/π) cot θ̄ cot y), E₂(y) = exp(−(1/π) cot² θ̄ cot² y), f(ψ) = exp(−2 tan ψ/2).
    fn of(mean_slope: f64, incident: LocalDir, outgoing: LocalDir) -> Self {
        let (mu_0, mu) = (incident.cos(), outgoing.cos());
        if mean_slope == 0.0 {
            return Self::FLAT(mu_0, mu);
        }
        let (sin_i, sin_e) = (incident.vec().truncate().length(), outgoing.vec().truncate().length());
        let psi = relative_azimuth(incident, outgoing);
        let tan = mean_slope.tan();
        let chi = 1.0 / (1.0 + PI * tan * tan).sqrt();
        // cot y; at the normal both exponentials are 0.
        let e1 = |s: f64, c: f64| (-2.0 / PI * c / (s * tan)).exp();
        let e2 = |s: f64, c: f64| (-(c / (s * tan)).powi(2) / PI).exp();
        let of = |s: f64, c: f64| if s > 0.0 { (e1(s, c), e2(s, c)) } else { (0.0, 0.0) };
        let ((e1_i, e2_i), (e1_e, e2_e)) = (of(sin_i, mu_0), of(sin_e, mu));
        let straight = |s: f64, c: f64, e1: f64, e2: f64| chi * (c + s * tan * e2 / (2.0 - e1));
        let (mu_0e0, mu_e0) = (straight(sin_i, mu_0, e1_i, e2_i), straight(sin_e, mu, e1_e, e2_e));
        let (cos_psi, sin_half) = (psi.cos(), (0.5 * psi).sin().powi(2));
        // The steeper of the two directions is hidden by what hides the flatter one.
        let (mu_0e, mu_e, outer) = if mu_0 >= mu {
            let below = 2.0 - e1_e - psi / PI * e1_i;
            let mu_0e = chi * (mu_0 + sin_i * tan * (cos_psi * e2_e + sin_half * e2_i) / below);
            let mu_e = chi * (mu + sin_e * tan * (e2_e - sin_half * e2_i) / below);
            (mu_0e, mu_e, mu_0 / mu_0e0)
        } else {
            let below = 2.0 - e1_i - psi / PI * e1_e;
            let mu_0e = chi * (mu_0 + sin_i * tan * (e2_i - sin_half * e2_e) / below);
            let mu_e = chi * (mu + sin_e * tan * (cos_psi * e2_i + sin_half * e2_e) / below);
            (mu_0e, mu_e, mu / mu_e0)
        };
        let f = (-2.0 * (0.5 * psi).tan()).exp();
        let shadowing = mu_e / mu_e0 * (mu_0 / mu_0e0) * chi / (1.0 - f + f * chi * outer);
        Self { mu_0e: mu_0e.max(0.0), mu_e: mu_e.max(0.0), shadowing: shadowing.max(0.0) }
    }
}

impl Part for Grains {
    fn is_present(&self) -> bool {
        self.w.range().1 > 0.0
    }

    fn add(&self, incident: LocalDir, outgoing: LocalDir, f: &mut [f64]) {
        // tan g/2 = |ω_i − ω_o|/|ω_i + ω_o|, exact at the hot spot.
        let (apart, together) = (incident.vec() - outgoing.vec(), incident.vec() + outgoing.vec());
        let tan_half = apart.length() / together.length();
        let cos_g = incident.dot(outgoing).clamp(-1.0, 1.0);
        let even = self.roughness.constant().map(|slope| Relief::of(slope, incident, outgoing));
        for (entry, f) in f.iter_mut().enumerate() {
            let own;
            let relief = match &even {
                Some(relief) => relief,
                None => {
                    own = Relief::of(self.roughness.at(entry), incident, outgoing);
                    &own
                }
            };
            let (w, b, c) = (self.w.at(entry), self.b.at(entry), self.c.at(entry));
            let surge = self.b0.at(entry) / (1.0 + tan_half / self.h.at(entry));
            let phase = (1.0 - c) * lobe(b, cos_g) + c * lobe(-b, cos_g);
            let multiple = chandrasekhar_h(w, relief.mu_0e) * chandrasekhar_h(w, relief.mu_e) - 1.0;
            let r = w / (4.0 * PI) * relief.mu_0e / (relief.mu_0e + relief.mu_e);
            *f += r * ((1.0 + surge) * phase + multiple) * relief.shadowing / incident.cos();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Chandrasekhar's H at 1: 2.907811 for w = 1, 1.850099 for w = 0.9; the approximation is good to a few 1e-3.
    #[test]
    fn h_is_near_the_exact_functions() {
        assert!((chandrasekhar_h(1.0, 1.0) / 2.907_811 - 1.0).abs() < 0.01);
        assert!((chandrasekhar_h(0.9, 1.0) / 1.850_099 - 1.0).abs() < 0.01);
        assert_eq!(chandrasekhar_h(0.5, 0.0), 1.0);
    }

    /// A relief without slopes changes nothing, and a slight one little.
    #[test]
    fn a_flat_relief_is_none() {
        let (i, o) = (LocalDir::from_polar(0.7, 0.2), LocalDir::from_polar(1.0, 2.0));
        let flat = Relief::of(1e-4, i, o);
        assert!((flat.mu_0e - i.cos()).abs() < 1e-6 && (flat.mu_e - o.cos()).abs() < 1e-6);
        assert!((flat.shadowing - 1.0).abs() < 1e-6);
    }
}
