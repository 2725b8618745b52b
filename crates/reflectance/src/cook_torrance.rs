#![doc = include_str!("cook_torrance.md")]

use std::sync::Arc;

use sunglint_plugin::{Args, BindError, Default, Model, ModelInfo, Param};
use sunglint_radiometry::{Dimension, SpectralGrid};

use crate::Bsdf;
use crate::composite::{Composite, Energy, Lambert};
use crate::facet_lobe::{FacetLobe, Law};
use crate::fresnel::Interface;
use crate::spectral::{reflectance_on, required, spectrum_within};

const ROUGHNESS: Param =
    Param::spectrum("roughness", Dimension::Fraction, Default::Required, "m, √2 × the facets' rms slope")
        .within(1e-4, 2.0);

/// The model of Cook and Torrance.
pub const MODEL: Model<dyn Bsdf> = Model {
    info: ModelInfo {
        name: "cook_torrance",
        summary: "d R_d + s R_s with V-grooved facets of Gaussian slopes and Fresnel reflectance from n and k",
        manual: include_str!("cook_torrance.md"),
        params: &[
            Param::spectrum("diffuse", Dimension::Fraction, Default::Absent, "R_d; else the material's reflectance")
                .within(0.0, 1.0),
            Param::spectrum("specular", Dimension::Fraction, Default::Required, "s, the specular share; d is 1 − s")
                .within(0.0, 1.0),
            Interface::N,
            Interface::K,
            ROUGHNESS,
            Param::word(
                "normalisation",
                &["exact", "printed"],
                Default::Word("exact"),
                "1/(4 cos cos) over a normalised D, or the 1/(π cos cos) of the paper: four times as much",
            ),
        ],
    },
    bind,
};

fn bind(args: &Args, grid: &SpectralGrid) -> Result<Arc<dyn Bsdf>, BindError> {
    let name = "cook_torrance";
    let interface = Interface::bind(name, args, grid)?;
    let roughness = spectrum_within(&ROUGHNESS, required(name, args, "roughness")?, grid)?;
    let s = reflectance_on("specular", required(name, args, "specular")?, grid)?;
    let r_d = match (args.spectral("diffuse"), args.spectral("reflectance")) {
        (Some(diffuse), _) => reflectance_on("diffuse", diffuse, grid)?,
        (None, Some(total)) => reflectance_on("reflectance", total, grid)?,
        (None, None) => vec![0.0; grid.len()],
    };
    let printed = args.word("normalisation") == Some("printed");
    let diffuse = r_d.iter().zip(&s).map(|(r_d, s)| (1.0 - s) * r_d).collect();
    let scale = s.iter().map(|s| if printed { 4.0 * s } else { *s }).collect();
    let lobe = FacetLobe::new(Law::Grooved, roughness, Some(interface), scale);
    let energy = if printed { Energy::Looked } else { Energy::Conserved };
    Ok(Arc::new(Composite::new(Lambert::new(diffuse), lobe, grid.len(), true, energy)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectral::OnGrid;
    use sunglint_radiometry::LocalDir;

    /// As printed, mirrors return four times the light: published check values 3.98, 3.92, 3.70, 3.78 for m = 0.3.
    #[test]
    fn the_printed_normalisation_returns_four_times_the_light() {
        let lobe = FacetLobe::new(Law::Grooved, OnGrid::new(vec![0.3]), None, vec![4.0]);
        let model = Composite::new(Lambert::new(vec![0.0]), lobe, 1, true, Energy::Looked);
        for (degree, expected) in [0.0_f64, 30.0, 60.0, 80.0].into_iter().zip([3.98, 3.92, 3.70, 3.78]) {
            let mut rho = [0.0];
            model.albedo(LocalDir::from_polar(degree.to_radians(), 0.0), &mut rho);
            assert!((rho[0] - expected).abs() < 6e-3, "{degree}: {}", rho[0]);
        }
        assert!(!model.claims().conserves_energy);
    }
}
