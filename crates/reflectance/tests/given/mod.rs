//! Models bound from arguments, for the tests.
#![allow(dead_code)] // each test uses some of it

use std::sync::Arc;

use sunglint_plugin::{Args, BindError, Model, SpectralValue, Table, TableKey, Value};
use sunglint_radiometry::{Curve, SpectralGrid};
use sunglint_reflectance::{BUILTIN, Bsdf};

pub type Given = Vec<(String, Value)>;

pub fn model(name: &str) -> &'static Model<dyn Bsdf> {
    BUILTIN.iter().find(|model| model.info.name == name).expect("a registered model")
}

pub fn bind_on(name: &str, given: Given, grid: &SpectralGrid) -> Result<Arc<dyn Bsdf>, BindError> {
    let model = model(name);
    (model.bind)(&Args::new(&model.info, given), grid)
}

pub fn bind(name: &str, given: Given) -> Result<Arc<dyn Bsdf>, BindError> {
    bind_on(name, given, &grid())
}

pub fn grid() -> SpectralGrid {
    SpectralGrid::from_edges(&[0.5, 0.6, 0.7])
}

pub fn constant(name: &str, value: f64) -> (String, Value) {
    (name.to_string(), Value::Spectrum(SpectralValue::Constant(value)))
}

pub fn curve(name: &str, rows: &[(f64, f64)]) -> (String, Value) {
    (name.to_string(), Value::Spectrum(SpectralValue::Curve(Curve::linear(rows).unwrap())))
}

pub fn number(name: &str, value: f64) -> (String, Value) {
    (name.to_string(), Value::Number(value))
}

pub fn word(name: &str, value: &str) -> (String, Value) {
    (name.to_string(), Value::Word(value.to_string()))
}

/// Rows with the view angle in degrees.
pub fn table(name: &str, key: TableKey, rows: &[&[f64]]) -> (String, Value) {
    let rows = rows.iter().map(|row| {
        let mut row = row.to_vec();
        row[0] = row[0].to_radians();
        row
    });
    (name.to_string(), Value::Table(Table { key, rows: rows.collect() }))
}

/// Beyond 75° nothing is measured; the peak is a BRF.
pub const STARK: [&[f64]; 5] =
    [&[8.0, 0.112, 3.1], &[30.0, 0.110, 3.3], &[45.0, 0.108, 4.2], &[60.0, 0.104, 7.9], &[75.0, 0.101, 21.0]];
/// Reflectance of a pane.
pub const WINDOW: [&[f64]; 3] = [&[0.0, 0.02, 0.08], &[60.0, 0.02, 0.12], &[80.0, 0.02, 0.41]];
