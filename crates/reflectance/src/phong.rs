#![doc = include_str!("phong.md")]

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::sync::Arc;

use sunglint_plugin::{Args, BindError, Default, Model, ModelInfo, Param};
use sunglint_radiometry::{Dimension, LocalDir, SpectralGrid};

use crate::Bsdf;
use crate::composite::{Composite, Energy, Lambert};
use crate::quadrature::tanh_sinh;
use crate::sampling::cosine_lobe;
use crate::scaled_lobe::{ScaledLobe, Shape};
use crate::spectral::{diffuse_beside, reflectance_on, required, spectrum_within};

/// The parameters of a cosine-power lobe: k_d, k_s and m.
pub(crate) const DIFFUSE: Param =
    Param::spectrum("diffuse", Dimension::Fraction, Default::Absent, "k_d; else the material's less k_s")
        .within(0.0, 1.0);
pub(crate) const SPECULAR: Param =
    Param::spectrum("specular", Dimension::Fraction, Default::Required, "k_s, the lobe at normal incidence")
        .within(0.0, 1.0);
pub(crate) const EXPONENT: Param =
    Param::spectrum("exponent", Dimension::Fraction, Default::Required, "m, the steepness of the lobe")
        .within(0.0, 1e6);

/// The Phong model, normalised.
pub const MODEL: Model<dyn Bsdf> = Model {
    info: ModelInfo {
        name: "phong",
        summary: "Lambert plus a cosine-power lobe about the mirror direction, normalised",
        manual: include_str!("phong.md"),
        params: &[DIFFUSE, SPECULAR, EXPONENT],
    },
    bind,
};

fn bind(args: &Args, grid: &SpectralGrid) -> Result<Arc<dyn Bsdf>, BindError> {
    let specular = required("phong", args, "specular")?;
    let k_s = reflectance_on("specular", specular, grid)?;
    let exponent = spectrum_within(&EXPONENT, required("phong", args, "exponent")?, grid)?;
    let k_d = diffuse_beside("phong", args, specular, &k_s, grid)?;
    let lobe = ScaledLobe::new(AboutMirror, exponent, k_s);
    Ok(Arc::new(Composite::new(Lambert::new(k_d), lobe, grid.len(), true, Energy::Conserved)))
}

/// cos^m of the angle between the incident direction and the mirror direction of the outgoing one, from small differences
/// rather than from a cosine near 1.
fn power(m: f64, versine: f64) -> f64 {
    if versine >= 1.0 { 0.0 } else { (m * (-versine).ln_1p()).exp() }
}

/// Directional-hemispherical reflectance of the lobe of k_s = 1 at `theta` \[rad\]: one integral is done by hand, the other
/// by tanh-sinh.
fn albedo(m: f64, theta: f64) -> f64 {
    // Beyond this angle cos^m is below e⁻⁴⁵.
    let reach = (-45.0 / m).exp().acos();
    let power = |t: f64| if m == 0.0 { 1.0 } else { t.cos().max(0.0).powf(m) };
    let (sin_t, cos_t) = theta.sin_cos();
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
    let peak = (m + 2.0) / TAU;
    peak * (tanh_sinh(0.0, whole, inner) + tanh_sinh(whole, reach, inner))
}

/// (m+2)/(2π) (r·o)^m [Lewis1994, CGF 13(2)].
struct AboutMirror;

impl Shape for AboutMirror {
    /// 1 − cos of the angle to the mirror direction.
    type Geometry = f64;

    fn geometry(incident: LocalDir, outgoing: LocalDir) -> f64 {
        0.5 * (incident.vec() - outgoing.mirrored().vec()).length_squared()
    }

    fn at(&self, m: f64, versine: &f64) -> f64 {
        (m + 2.0) / TAU * power(m, *versine)
    }

    fn draw(&self, m: f64, outgoing: LocalDir, u: [f64; 2]) -> Option<LocalDir> {
        Some(cosine_lobe(outgoing.mirrored(), m, u))
    }

    /// (m+1)/(2π) (r·o)^m
    fn drawn_with(&self, m: f64, versine: &f64) -> f64 {
        (m + 1.0) / TAU * power(m, *versine)
    }

    /// cos^m α ≈ exp(−m α²/2), and α is twice the half vector's angle.
    fn slope(&self, m: f64) -> f64 {
        (0.5 / (m + 1.0)).sqrt()
    }

    fn albedo(&self, m: f64, theta: f64) -> Option<f64> {
        Some(albedo(m, theta))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectral::OnGrid;

    /// Published check values for m = 20 at 0, 30, 60 and 80°, three digits: 1200 × 720 midpoint sums.
    #[test]
    fn the_albedo_is_that_of_independent_sums() {
        for (degree, rho) in [0.0_f64, 30.0, 60.0, 80.0].into_iter().zip([1.000, 0.866, 0.501, 0.200]) {
            let found = albedo(20.0, degree.to_radians());
            assert!((found - rho).abs() < 6e-4, "{degree}: {found}");
        }
    }

    /// At normal incidence the lobe is normalised for every exponent: ρ = 1.
    #[test]
    fn the_lobe_is_normalised_at_normal_incidence() {
        for m in [0.0, 0.3, 1.0, 5.0, 20.0, 1e3, 1e6] {
            assert!((albedo(m, 0.0) - 1.0).abs() < 1e-9, "{m}: {}", albedo(m, 0.0));
        }
    }

    /// A narrow lobe loses the cosine: f has no 1/cos θ.
    #[test]
    fn a_narrow_lobe_loses_the_cosine() {
        for degree in [30.0_f64, 60.0, 80.0] {
            let theta = degree.to_radians();
            assert!((albedo(1e6, theta) / theta.cos() - 1.0).abs() < 1e-5, "{degree}");
        }
    }

    /// The trait's contract for a BRDF peak: ρ_s = R_s Ω_s cos θ/π with R_s as printed.
    #[test]
    fn the_split_of_a_lobe_is_consistent() {
        let lobe = ScaledLobe::new(AboutMirror, OnGrid::new(vec![50.0]), vec![0.3]);
        let phong = Composite::new(Lambert::new(vec![0.5]), lobe, 1, true, Energy::Conserved);
        let split = phong.split();
        for degree in [0.0_f64, 20.0, 44.0, 70.0] {
            let theta = degree.to_radians();
            let (rho_s, r_s) = (split.specular.at(theta, 0), split.printed.at(theta, 0));
            let expected = r_s * split.solid_angle_at(theta) * theta.cos() / PI;
            assert!((rho_s / expected - 1.0).abs() < 1e-9, "{degree}: {rho_s} {expected}");
        }
    }
}
