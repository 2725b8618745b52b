#![doc = include_str!("oren_nayar.md")]

use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::Arc;

use sunglint_plugin::{Args, BindError, Default, Model, ModelInfo, Param};
use sunglint_radiometry::{Dimension, LocalDir, SpectralGrid};

use crate::Bsdf;
use crate::composite::{Composite, Energy, Nothing, Part, add_terms};
use crate::spectral::{OnGrid, reflectance_on, required, spectrum_within};

const ROUGHNESS: Param = Param::spectrum(
    "roughness",
    Dimension::Angle,
    Default::Required,
    "σ, standard deviation of the facets' slope angles",
)
.within(0.0, FRAC_PI_2);

/// The model of Oren and Nayar.
pub const MODEL: Model<dyn Bsdf> = Model {
    info: ModelInfo {
        name: "oren_nayar",
        summary: "matt V-grooves: flatter than Lambert, brighter towards the sun",
        manual: include_str!("oren_nayar.md"),
        params: &[
            Param::spectrum("diffuse", Dimension::Fraction, Default::Absent, "ρ of the facets; else the material's")
                .within(0.0, 1.0),
            ROUGHNESS,
        ],
    },
    bind,
};

fn bind(args: &Args, grid: &SpectralGrid) -> Result<Arc<dyn Bsdf>, BindError> {
    let roughness = spectrum_within(&ROUGHNESS, required("oren_nayar", args, "roughness")?, grid)?;
    let rho = match (args.spectral("diffuse"), args.spectral("reflectance")) {
        (Some(diffuse), _) => reflectance_on("diffuse", diffuse, grid)?,
        (None, Some(total)) => reflectance_on("reflectance", total, grid)?,
        (None, None) => {
            return Err(BindError::of_block(
                "S05",
                "`oren_nayar` has no reflectance: neither its own nor the material's",
            )
            .help("write `diffuse 0.3`, or give the material a `reflectance`"));
        }
    };
    let body = Grooves::new(&rho, &roughness);
    Ok(Arc::new(Composite::new(body, Nothing, grid.len(), true, Energy::Looked)))
}

struct Grooves {
    /// ρ A and ρ B.
    terms: [Vec<f64>; 2],
}

impl Grooves {
    fn new(rho: &[f64], roughness: &OnGrid) -> Self {
        let a = |s2: f64| 1.0 - 0.5 * s2 / (s2 + 0.33);
        let b = |s2: f64| 0.45 * s2 / (s2 + 0.09);
        let scaled = |of: &dyn Fn(f64) -> f64| -> Vec<f64> {
            rho.iter().zip(roughness.all()).map(|(rho, s)| rho * of(s * s)).collect()
        };
        let terms = [scaled(&a), scaled(&b)];
        Self { terms }
    }
}

impl Part for Grooves {
    fn is_present(&self) -> bool {
        self.terms[0].iter().any(|rho| *rho > 0.0)
    }

    fn add(&self, incident: LocalDir, outgoing: LocalDir, f: &mut [f64]) {
        add_terms(self, incident, outgoing, f);
    }

    /// ρ A and ρ B, whether or not σ depends on wavelength.
    fn terms(&self) -> Option<&[Vec<f64>]> {
        Some(&self.terms)
    }

    /// 1/π and max(0, cos φ) sin α tan β/π.
    fn shapes(&self, incident: LocalDir, outgoing: LocalDir, shapes: &mut [f64]) {
        // cos φ sin θ_i sin θ_o is the product of the tangential parts; sin α tan β divides it by the larger cosine.
        let across = incident.vec().truncate().dot(outgoing.vec().truncate()).max(0.0);
        shapes[0] = 1.0 / PI;
        shapes[1] = across / (PI * incident.cos().max(outgoing.cos()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn model(sigma: f64) -> Composite<Grooves, Nothing> {
        let body = Grooves::new(&[1.0], &OnGrid::new(vec![sigma]));
        Composite::new(body, Nothing, 1, true, Energy::Looked)
    }

    fn albedo(model: &dyn Bsdf, degree: f64) -> f64 {
        let mut rho = [0.0];
        model.albedo(LocalDir::from_polar(degree.to_radians(), 0.0), &mut rho);
        rho[0]
    }

    /// Published check values for σ = 0.5, ρ = 1 at 0, 30, 60 and 80°, three digits; and that a smooth groove returns more
    /// than it gets.
    #[test]
    fn the_albedo_is_that_of_independent_sums() {
        for (degree, rho) in [0.0, 30.0, 60.0, 80.0].into_iter().zip([0.785, 0.825, 0.883, 0.929]) {
            let found = albedo(&model(0.5), degree);
            assert!((found - rho).abs() < 6e-4, "{degree}: {found}");
        }
        let steep = (0..90).map(|degree| albedo(&model(0.2), f64::from(degree))).fold(0.0, f64::max);
        assert!((steep - 1.015).abs() < 1e-3, "{steep}");
        assert!(!model(0.2).claims().conserves_energy && model(0.5).claims().conserves_energy);
    }

    /// σ = 0 is Lambert's law.
    #[test]
    fn without_slopes_it_is_lambert() {
        let mut f = [0.0];
        model(0.0).eval(LocalDir::from_polar(1.1, 0.4), LocalDir::from_polar(0.7, 2.0), &mut f);
        assert!((f[0] * PI - 1.0).abs() < 1e-15);
    }
}
