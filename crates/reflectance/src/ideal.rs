#![doc = include_str!("ideal.md")]

use std::sync::Arc;

use sunglint_plugin::{Args, BindError, Column, Default, Model, ModelInfo, Param};
use sunglint_radiometry::{Dimension, SpectralGrid};

use crate::spectral::{ROUNDING, reflectance_on};
use crate::two_component::TwoComponent;
use crate::view_table::{VIEW_ZENITH, degrees, on_grid, profiles};
use crate::{AngularSpectra, Bsdf, Split};

const COLUMNS: &[Column] =
    &[VIEW_ZENITH, Column { name: "reflectance", dimension: Dimension::Fraction, range: (0.0, 1.0) }];

const WAYS: [&str; 4] = ["diffuse", "specular", "diffuse_table", "specular_table"];

/// Ideal diffuse or ideal specular.
pub const MODEL: Model<dyn Bsdf> = Model {
    info: ModelInfo {
        name: "ideal",
        summary: "either perfectly diffuse or a perfect mirror, constant or against view angle",
        manual: include_str!("ideal.md"),
        params: &[
            Param::spectrum("diffuse", Dimension::Fraction, Default::Absent, "diffuse reflectance R_d")
                .within(0.0, 1.0)
                .excludes(&["specular", "diffuse_table", "specular_table"]),
            Param::spectrum("specular", Dimension::Fraction, Default::Absent, "reflectance of a mirror")
                .within(0.0, 1.0)
                .excludes(&["diffuse", "diffuse_table", "specular_table"]),
            Param::table("diffuse_table", COLUMNS, Default::Absent, "diffuse reflectance against view angle")
                .excludes(&["diffuse", "specular", "specular_table"]),
            Param::table("specular_table", COLUMNS, Default::Absent, "reflectance of a mirror against view angle")
                .excludes(&["diffuse", "specular", "diffuse_table"]),
        ],
    },
    bind,
};

fn bind(args: &Args, grid: &SpectralGrid) -> Result<Arc<dyn Bsdf>, BindError> {
    let given: Vec<&str> = WAYS.into_iter().filter(|way| args.get(way).is_some()).collect();
    if given.len() > 1 {
        return Err(BindError::of_block("S05", format!("`{}` and `{}` exclude each other", given[0], given[1])));
    }
    let constant = |name: &'static str| -> Result<Option<AngularSpectra>, BindError> {
        let Some(value) = args.spectral(name) else { return Ok(None) };
        Ok(Some(AngularSpectra::constant(reflectance_on(name, value, grid)?)))
    };
    let table = |name: &'static str| -> Result<Option<AngularSpectra>, BindError> {
        let Some(table) = args.table(name) else { return Ok(None) };
        let profiles = profiles(name, table, COLUMNS.len())?;
        for profile in &profiles {
            let outside = |row: &&(f64, Vec<f64>)| !(-ROUNDING..=1.0 + ROUNDING).contains(&row.1[0]);
            if let Some((theta, values)) = profile.rows.iter().find(outside) {
                let (of, angle, value) = (&profile.of, degrees(*theta), values[0]);
                let message = format!("reflectance lies between 0 and 1; at {angle} deg{of} it is {value}");
                return Err(BindError::new("M05", name, message));
            }
        }
        let on_grid = on_grid(name, &profiles, 0, grid)?;
        let clamped = |node| on_grid.spectrum(node).iter().map(|value| value.clamp(0.0, 1.0)).collect();
        let spectra = (0..on_grid.angles().len()).map(clamped).collect();
        Ok(Some(AngularSpectra::new(on_grid.angles().to_vec(), spectra)))
    };
    let mirror = match constant("specular")? {
        Some(rho) => Some(rho),
        None => table("specular_table")?,
    };
    if let Some(rho) = mirror {
        let diffuse = AngularSpectra::constant(vec![0.0; grid.len()]);
        let solid_angle = vec![0.0; rho.angles().len()];
        let split = Split { diffuse, printed: rho.clone(), specular: rho, solid_angle };
        return Ok(Arc::new(TwoComponent::new(split)));
    }
    let diffuse = match (constant("diffuse")?, table("diffuse_table")?) {
        (Some(constant), _) => constant,
        (None, Some(table)) => table,
        (None, None) => constant("reflectance")?.ok_or_else(|| {
            BindError::of_block("S05", "`ideal` has no reflectance: neither its own nor the material's")
                .help("write `ideal { diffuse 0.18 }`, or give the material a `reflectance`")
        })?,
    };
    Ok(Arc::new(TwoComponent::new(Split::diffuse(diffuse, grid.len()))))
}
