#![doc = include_str!("blinn_phong.md")]

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::sync::Arc;

use sunglint_plugin::{Args, BindError, Model, ModelInfo};
use sunglint_radiometry::{LocalDir, SpectralGrid};

use crate::Bsdf;
use crate::composite::{Composite, Energy, Lambert};
use crate::microfacet::{Half, normal, reflected};
use crate::phong::{DIFFUSE, EXPONENT, SPECULAR};
use crate::quadrature::tanh_sinh;
use crate::scaled_lobe::{ScaledLobe, Shape};
use crate::spectral::{diffuse_beside, reflectance_on, required, spectrum_within};

/// Blinn's lobe of the half vector, normalised.
pub const MODEL: Model<dyn Bsdf> = Model {
    info: ModelInfo {
        name: "blinn_phong",
        summary: "Lambert plus a cosine-power lobe of the half vector, normalised",
        manual: include_str!("blinn_phong.md"),
        params: &[DIFFUSE, SPECULAR, EXPONENT],
    },
    bind,
};

fn bind(args: &Args, grid: &SpectralGrid) -> Result<Arc<dyn Bsdf>, BindError> {
    let specular = required("blinn_phong", args, "specular")?;
    let k_s = reflectance_on("specular", specular, grid)?;
    let exponent = spectrum_within(&EXPONENT, required("blinn_phong", args, "exponent")?, grid)?;
    let k_d = diffuse_beside("blinn_phong", args, specular, &k_s, grid)?;
    let lobe = ScaledLobe::new(AboutNormal, exponent, k_s);
    Ok(Arc::new(Composite::new(Lambert::new(k_d), lobe, grid.len(), true, Energy::Conserved)))
}

/// (m+2)(m+4)/(8π (2^(−m/2) + m)), exact at normal incidence \[sr⁻¹\].
fn peak(m: f64) -> f64 {
    (m + 2.0) * (m + 4.0) / (8.0 * PI * ((-0.5 * m).exp2() + m))
}

/// (n·h)^m
fn power(m: f64, half: &Half) -> f64 {
    (-0.5 * m * half.tan_squared.ln_1p()).exp()
}

/// Directional-hemispherical reflectance of the lobe of k_s = 1 at `theta` \[rad\]: one integral is done by hand, the other
/// by tanh-sinh.
fn albedo(m: f64, theta: f64) -> f64 {
    // Beyond this angle cos^m is below e⁻⁴⁵.
    let reach = (-45.0 / m).exp().acos();
    let power = |t: f64| if m == 0.0 { 1.0 } else { t.cos().max(0.0).powf(m) };
    let (sin_t, cos_t) = theta.sin_cos();
    // In polar coordinates t, φ of h: o_z = 2 (i·h) cos t − cos θ, dω_o = 4 (i·h) dω_h, i·h = a + b cos φ.
    let inner = |t: f64| {
        let (a, b) = (cos_t * t.cos(), sin_t * t.sin());
        let phi =
            if (theta + 2.0 * t).cos() >= 0.0 { PI } else { ((0.5 * cos_t / t.cos() - a) / b).clamp(-1.0, 1.0).acos() };
        let (s, c) = phi.sin_cos();
        let square = 2.0 * a * a * phi + 4.0 * a * b * s + b * b * (phi + s * c);
        let line = 2.0 * a * phi + 2.0 * b * s;
        4.0 * power(t) * t.sin() * (2.0 * t.cos() * square - cos_t * line)
    };
    // Up to `whole` every azimuth of h sends light up, from `none` on no azimuth does.
    let (whole, none) = (0.5 * (FRAC_PI_2 - theta), 0.5 * (FRAC_PI_2 + theta));
    let (whole, none) = (whole.clamp(0.0, reach), none.min(reach));
    peak(m) * (tanh_sinh(0.0, whole, inner) + tanh_sinh(whole, none, inner))
}

/// The normalised power of n·h [Blinn1977].
struct AboutNormal;

impl Shape for AboutNormal {
    type Geometry = Half;

    fn geometry(incident: LocalDir, outgoing: LocalDir) -> Half {
        Half::of(incident, outgoing)
    }

    fn at(&self, m: f64, half: &Half) -> f64 {
        peak(m) * power(m, half)
    }

    /// cos² θ_h = (1 − u)^(2/(m+2)), its density (m+2)/(2π) cos^(m+1) θ_h.
    fn draw(&self, m: f64, outgoing: LocalDir, u: [f64; 2]) -> Option<LocalDir> {
        let tan_squared = (-2.0 / (m + 2.0) * (-u[0]).ln_1p()).exp_m1();
        reflected(normal(tan_squared, u[1]), outgoing)
    }

    /// (m+2)/(2π) (n·h)^(m+1)/(4 o·h)
    fn drawn_with(&self, m: f64, half: &Half) -> f64 {
        (m + 2.0) / TAU * power(m + 1.0, half) / (4.0 * half.cos_b)
    }

    /// cos^m θ_h ≈ exp(−m θ_h²/2)
    fn slope(&self, m: f64) -> f64 {
        (2.0 / (m + 1.0)).sqrt()
    }

    fn albedo(&self, m: f64, theta: f64) -> Option<f64> {
        Some(albedo(m, theta))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Published check values for m = 20 at 0, 30, 60 and 80°, three digits: 1200 × 720 midpoint sums.
    #[test]
    fn the_albedo_is_that_of_independent_sums() {
        for (degree, rho) in [0.0_f64, 30.0, 60.0, 80.0].into_iter().zip([1.000, 0.776, 0.328, 0.111]) {
            let found = albedo(20.0, degree.to_radians());
            assert!((found - rho).abs() < 6e-4, "{degree}: {found}");
        }
    }

    /// At normal incidence the lobe is normalised for every exponent: ρ = 1. The popular (m+2)/(8π) returns 0.833 at m = 20.
    #[test]
    fn the_lobe_is_normalised_at_normal_incidence() {
        for m in [0.0, 0.3, 1.0, 5.0, 20.0, 1e3, 1e6] {
            assert!((albedo(m, 0.0) - 1.0).abs() < 1e-9, "{m}: {}", albedo(m, 0.0));
        }
        assert!((22.0 / (8.0 * PI) / peak(20.0) - 0.833).abs() < 1e-3);
    }

    /// A narrow lobe loses the square of the cosine; the neglected curvature is of the order 1/(m cos² θ).
    #[test]
    fn a_narrow_lobe_loses_the_squared_cosine() {
        for degree in [30.0_f64, 60.0, 80.0] {
            let cos = degree.to_radians().cos();
            assert!((albedo(1e6, degree.to_radians()) / (cos * cos) - 1.0).abs() < 2e-4, "{degree}");
        }
    }
}
