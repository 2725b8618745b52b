#![doc = include_str!("total_diffuse.md")]

use std::sync::Arc;

use sunglint_plugin::{Args, BindError, Model, ModelInfo};
use sunglint_radiometry::SpectralGrid;

use crate::Bsdf;
use crate::composite::{Composite, Energy, Lambert, Nothing};
use crate::spectral::reflectance_on;

/// All surfaces diffuse.
pub const MODEL: Model<dyn Bsdf> = Model {
    info: ModelInfo {
        name: "total_diffuse",
        summary: "Lambert's law with the material's total reflectance, whatever the material",
        manual: include_str!("total_diffuse.md"),
        params: &[],
    },
    bind,
};

fn bind(args: &Args, grid: &SpectralGrid) -> Result<Arc<dyn Bsdf>, BindError> {
    let Some(total) = args.spectral("reflectance") else {
        return Err(BindError::of_block("S05", "`total_diffuse` needs the material's total reflectance")
            .help("give the material a `reflectance`"));
    };
    let rho = reflectance_on("reflectance", total, grid)?;
    Ok(Arc::new(Composite::new(Lambert::new(rho), Nothing, grid.len(), true, Energy::Conserved)))
}
