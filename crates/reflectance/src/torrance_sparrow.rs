#![doc = include_str!("torrance_sparrow.md")]

use std::sync::Arc;

use sunglint_plugin::{Args, BindError, Default, Model, ModelInfo, Param};
use sunglint_radiometry::{Dimension, SpectralGrid};

use crate::Bsdf;
use crate::composite::{Composite, Energy, Lambert};
use crate::facet_lobe::{FacetLobe, Law};
use crate::fresnel::Interface;
use crate::spectral::{fraction_or_zero, reflectance_on, required, spectrum_within};

const ROUGHNESS: Param = Param::spectrum(
    "roughness",
    Dimension::Angle,
    Default::Required,
    "m, the facets' angle to the surface at which there are 1/e as many",
)
.within(1e-4, std::f64::consts::FRAC_PI_2);

/// The model of Torrance and Sparrow.
pub const MODEL: Model<dyn Bsdf> = Model {
    info: ModelInfo {
        name: "torrance_sparrow",
        summary: "Lambert plus V-grooved facets whose angles are Gaussian, with an off-specular peak",
        manual: include_str!("torrance_sparrow.md"),
        params: &[
            Param::spectrum("diffuse", Dimension::Fraction, Default::Number(0.0), "k_d, of the light under the facets")
                .within(0.0, 1.0),
            Param::spectrum("specular", Dimension::Fraction, Default::Number(1.0), "k_s, share of facets that reflect")
                .within(0.0, 1.0),
            Interface::N,
            Interface::K,
            ROUGHNESS,
        ],
    },
    bind,
};

fn bind(args: &Args, grid: &SpectralGrid) -> Result<Arc<dyn Bsdf>, BindError> {
    let name = "torrance_sparrow";
    let interface = Interface::bind(name, args, grid)?;
    let roughness = spectrum_within(&ROUGHNESS, required(name, args, "roughness")?, grid)?;
    let diffuse = fraction_or_zero(args, "diffuse", grid)?;
    let specular = reflectance_on("specular", required(name, args, "specular")?, grid)?;
    let lobe = FacetLobe::new(Law::GaussianAngle, roughness, Some(interface), specular);
    Ok(Arc::new(Composite::new(Lambert::new(diffuse), lobe, grid.len(), true, Energy::Looked)))
}
