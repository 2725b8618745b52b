#![doc = include_str!("ross_li.md")]

use std::f64::consts::{FRAC_PI_4, PI};
use std::sync::Arc;

use sunglint_plugin::{Args, BindError, Default, Model, ModelInfo, Param};
use sunglint_radiometry::{Dimension, LocalDir, SpectralGrid, relative_azimuth};

use crate::Bsdf;
use crate::composite::{Composite, Energy, Nothing, Part};
use crate::spectral::{OnGrid, required, spectrum_within};

/// Zenith angle beyond which the kernels keep their value \[rad\]: 80°.
const LIMIT: f64 = 80.0 * PI / 180.0;

const ISO: Param =
    Param::spectrum("iso", Dimension::Fraction, Default::Required, "f_iso, the isotropic weight").within(0.0, 2.0);
const VOL: Param =
    Param::spectrum("vol", Dimension::Fraction, Default::Number(0.0), "f_vol, of the volume-scattering kernel")
        .within(0.0, 2.0);
const GEO: Param = Param::spectrum("geo", Dimension::Fraction, Default::Number(0.0), "f_geo, of the geometric kernel")
    .within(0.0, 2.0);
const SHAPE: Param =
    Param::spectrum("shape", Dimension::Fraction, Default::Number(1.0), "b/r, height over width of a crown")
        .within(0.01, 100.0);
const HEIGHT: Param = Param::spectrum(
    "height",
    Dimension::Fraction,
    Default::Number(2.0),
    "h/b, height of a crown's centre over its own",
)
.within(0.0, 100.0);

/// RossThick–LiSparse-Reciprocal.
pub const MODEL: Model<dyn Bsdf> = Model {
    info: ModelInfo {
        name: "ross_li",
        summary: "RossThick-LiSparse-Reciprocal kernels, the form of MODIS land products",
        manual: include_str!("ross_li.md"),
        params: &[ISO, VOL, GEO, SHAPE, HEIGHT],
    },
    bind,
};

fn bind(args: &Args, grid: &SpectralGrid) -> Result<Arc<dyn Bsdf>, BindError> {
    let of = |param: &Param| spectrum_within(param, required("ross_li", args, param.name)?, grid);
    let kernels = Kernels { iso: of(&ISO)?, vol: of(&VOL)?, geo: of(&GEO)?, b_r: of(&SHAPE)?, h_b: of(&HEIGHT)? };
    Ok(Arc::new(Composite::new(kernels, Nothing, grid.len(), true, Energy::Looked)))
}

struct Kernels {
    iso: OnGrid,
    vol: OnGrid,
    geo: OnGrid,
    b_r: OnGrid,
    h_b: OnGrid,
}

/// K_vol = [(π/2 − ξ) cos ξ + sin ξ]/(cos θ_i + cos θ_o) − π/4, ξ the phase angle [Lucht2000, eq. 38].
fn ross_thick(theta_i: f64, theta_o: f64, phi: f64) -> f64 {
    let ((s_i, c_i), (s_o, c_o)) = (theta_i.sin_cos(), theta_o.sin_cos());
    let cos_xi = (c_i * c_o + s_i * s_o * phi.cos()).clamp(-1.0, 1.0);
    let xi = cos_xi.acos();
    ((0.5 * PI - xi) * cos_xi + xi.sin()) / (c_i + c_o) - FRAC_PI_4
}

/// K_geo = O − sec θ_i' − sec θ_o' + ½ (1 + cos ξ') sec θ_i' sec θ_o' [Lucht2000, eqs. 39–44], with tan θ' = (b/r) tan θ and
///
/// ```text
/// O     = (t − sin t cos t)(sec θ_i' + sec θ_o')/π
/// cos t = (h/b) √(D² + (tan θ_i' tan θ_o' sin φ)²)/(sec θ_i' + sec θ_o'), at most 1
/// D²    = tan² θ_i' + tan² θ_o' − 2 tan θ_i' tan θ_o' cos φ
/// ```
fn li_sparse_reciprocal(theta_i: f64, theta_o: f64, phi: f64, b_r: f64, h_b: f64) -> f64 {
    let (t_i, t_o) = (b_r * theta_i.tan(), b_r * theta_o.tan());
    let (sec_i, sec_o) = (t_i.hypot(1.0), t_o.hypot(1.0));
    let (sin_p, cos_p) = phi.sin_cos();
    let sum = sec_i + sec_o;
    let d2 = (t_i * t_i + t_o * t_o - 2.0 * t_i * t_o * cos_p).max(0.0);
    let cos_t = (h_b * (d2 + (t_i * t_o * sin_p).powi(2)).sqrt() / sum).min(1.0);
    let t = cos_t.acos();
    let overlap = (t - t.sin() * cos_t) * sum / PI;
    // cos ξ' sec θ_i' sec θ_o' = 1 + tan θ_i' tan θ_o' cos φ
    overlap - sum + 0.5 * (sec_i * sec_o + 1.0 + t_i * t_o * cos_p)
}

impl Part for Kernels {
    fn is_present(&self) -> bool {
        [&self.iso, &self.vol, &self.geo].iter().any(|f| f.range().1 > 0.0)
    }

    /// max(0, f_iso + f_vol K_vol + f_geo K_geo)/π: not separable where the sum is negative, hence not said to be.
    fn add(&self, incident: LocalDir, outgoing: LocalDir, f: &mut [f64]) {
        let (theta_i, theta_o) = (incident.theta().min(LIMIT), outgoing.theta().min(LIMIT));
        let phi = relative_azimuth(incident, outgoing);
        let vol = ross_thick(theta_i, theta_o, phi);
        let li = |b_r: f64, h_b: f64| li_sparse_reciprocal(theta_i, theta_o, phi, b_r, h_b);
        let even = self.b_r.constant().zip(self.h_b.constant()).map(|(b_r, h_b)| li(b_r, h_b));
        for (entry, f) in f.iter_mut().enumerate() {
            let geo = even.unwrap_or_else(|| li(self.b_r.at(entry), self.h_b.at(entry)));
            *f += (self.iso.at(entry) + self.vol.at(entry) * vol + self.geo.at(entry) * geo).max(0.0) / PI;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Both kernels are 0 for light and view from the zenith, by their making.
    #[test]
    fn kernels_vanish_at_the_zenith() {
        assert!(ross_thick(0.0, 0.0, 0.0).abs() < 1e-15);
        assert!(li_sparse_reciprocal(0.0, 0.0, 0.0, 1.0, 2.0).abs() < 1e-15);
    }

    /// At the hot spot of 45° crowns hide their own shadows: D = 0, t = π/2, O = sec, K_geo = −sec θ + sec² θ, with
    /// sec = √2; K_vol = (π/2)/(2 cos 45°) − π/4.
    #[test]
    fn the_hot_spot_has_its_closed_form() {
        let sec = 2f64.sqrt();
        assert!((li_sparse_reciprocal(FRAC_PI_4, FRAC_PI_4, 0.0, 1.0, 2.0) - (2.0 - sec)).abs() < 1e-7);
        assert!((ross_thick(FRAC_PI_4, FRAC_PI_4, 0.0) - (0.5 * PI / sec - FRAC_PI_4)).abs() < 1e-7);
    }
}
