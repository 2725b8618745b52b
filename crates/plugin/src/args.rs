//! Checked arguments of a model, in canonical units. Models never see the text of a scene.

use std::collections::BTreeMap;
use std::sync::Arc;

use sunglint_radiometry::{Curve, SpectralGrid};

use crate::{Default, ModelInfo};

/// A quantity at all wavelengths.
#[derive(Clone, Debug, PartialEq)]
pub enum SpectralValue {
    /// One value for all wavelengths.
    Constant(f64),
    /// A table against wavelength.
    Curve(Curve),
    /// A value for every band of a name.
    PerBand(Vec<(String, f64)>),
}

/// A per-band value that lacks a band it is used in.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("no value for band `{band}`")]
pub struct BandMissing {
    /// The band.
    pub band: String,
}

impl SpectralValue {
    /// Values on the grid's entries. Per-band values need a grid whose bins are owned by bands.
    pub fn on(&self, grid: &SpectralGrid) -> Result<Vec<f64>, BandMissing> {
        match self {
            Self::Constant(value) => Ok(vec![*value; grid.len()]),
            Self::Curve(curve) => Ok(curve.on(grid)),
            Self::PerBand(values) => (grid.entries().iter())
                .map(|entry| {
                    let band = grid.band_of(entry).unwrap_or("(every band)");
                    let found = values.iter().find(|(name, _)| name == band);
                    found.map(|(_, value)| *value).ok_or_else(|| BandMissing { band: band.to_string() })
                })
                .collect(),
        }
    }

    /// Whether the value is 0 at every wavelength.
    pub fn is_zero(&self) -> bool {
        match self {
            Self::Constant(value) => *value == 0.0,
            Self::Curve(curve) => curve.range() == (0.0, 0.0),
            Self::PerBand(values) => values.iter().all(|(_, value)| *value == 0.0),
        }
    }
}

/// What the rows of a table are for.
#[derive(Clone, Debug, PartialEq)]
pub enum TableKey {
    /// All wavelengths.
    None,
    /// The named band, per row.
    Band(Vec<String>),
    /// A wavelength \[µm\], per row.
    Wavelength(Vec<f64>),
}

/// Rows of numbers, columns in the declared order, canonical units.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// What each row is for.
    pub key: TableKey,
    /// The rows, each with one value per declared column.
    pub rows: Vec<Vec<f64>>,
}

/// A file handed to a model.
#[derive(Clone, Debug, PartialEq)]
pub struct FileArg {
    /// Name as the scene gives it, for messages.
    pub name: String,
    /// Content.
    pub bytes: Arc<[u8]>,
}

/// A checked value.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// A number, canonical unit.
    Number(f64),
    /// A spectrum.
    Spectrum(SpectralValue),
    /// A table.
    Table(Table),
    /// A word of the declared list.
    Word(String),
    /// A switch.
    Switch(bool),
    /// A count.
    Count(u64),
    /// A file.
    File(FileArg),
    /// Labels and weights.
    Weights(Vec<(String, f64)>),
    /// What the labels of weights stand for.
    Mixture(Vec<Component>),
}

/// A model among several of one material, with its weight.
#[derive(Clone, Debug, PartialEq)]
pub struct Component {
    /// Share in the mixture.
    pub weight: f64,
    /// Name of the model.
    pub model: String,
    /// Its own arguments.
    pub args: Args,
}

/// Arguments of one use of a model: what the scene gave, defaults for the rest.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Args {
    values: BTreeMap<String, Value>,
}

impl Args {
    /// The defaults that `info` declares, then `given`.
    pub fn new(info: &ModelInfo, given: impl IntoIterator<Item = (String, Value)>) -> Self {
        let mut values = BTreeMap::new();
        for param in info.params {
            let value = match (param.default, &param.kind) {
                (Default::Number(value), crate::Kind::Spectrum(_)) => Value::Spectrum(SpectralValue::Constant(value)),
                (Default::Number(value), _) => Value::Number(value),
                (Default::Word(word), _) => Value::Word(word.to_string()),
                (Default::Switch(on), _) => Value::Switch(on),
                (Default::Count(count), _) => Value::Count(count),
                (Default::Required | Default::Absent, _) => continue,
            };
            values.insert(param.name.to_string(), value);
        }
        values.extend(given);
        Self { values }
    }

    /// Sets a value.
    pub fn set(&mut self, name: &str, value: Value) {
        self.values.insert(name.to_string(), value);
    }
    /// The value of a parameter, if it has one.
    pub fn get(&self, name: &str) -> Option<&Value> {
        self.values.get(name)
    }
    /// All values, by name.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &Value)> {
        self.values.iter().map(|(name, value)| (name.as_str(), value))
    }
    /// All values, in place of a mixture those of its components.
    pub fn flattened(&self) -> Vec<&Value> {
        let mut all = Vec::new();
        for value in self.values.values() {
            match value {
                Value::Mixture(components) => all.extend(components.iter().flat_map(|part| part.args.flattened())),
                value => all.push(value),
            }
        }
        all
    }
    /// A number.
    pub fn number(&self, name: &str) -> Option<f64> {
        match self.get(name)? {
            Value::Number(value) => Some(*value),
            _ => None,
        }
    }
    /// A spectrum, not yet on a grid.
    pub fn spectral(&self, name: &str) -> Option<&SpectralValue> {
        match self.get(name)? {
            Value::Spectrum(value) => Some(value),
            _ => None,
        }
    }
    /// A spectrum on a grid; `None` where it was not given.
    pub fn spectrum(&self, name: &str, grid: &SpectralGrid) -> Result<Option<Vec<f64>>, BandMissing> {
        self.spectral(name).map(|value| value.on(grid)).transpose()
    }
    /// A table.
    pub fn table(&self, name: &str) -> Option<&Table> {
        match self.get(name)? {
            Value::Table(table) => Some(table),
            _ => None,
        }
    }
    /// A word.
    pub fn word(&self, name: &str) -> Option<&str> {
        match self.get(name)? {
            Value::Word(word) => Some(word),
            _ => None,
        }
    }
    /// A switch.
    pub fn switch(&self, name: &str) -> Option<bool> {
        match self.get(name)? {
            Value::Switch(on) => Some(*on),
            _ => None,
        }
    }
    /// A count; `None` where it was not given, or given as a word.
    pub fn count(&self, name: &str) -> Option<u64> {
        match self.get(name)? {
            Value::Count(count) => Some(*count),
            _ => None,
        }
    }
    /// The components of a mixture.
    pub fn mixture(&self, name: &str) -> Option<&[Component]> {
        match self.get(name)? {
            Value::Mixture(components) => Some(components),
            _ => None,
        }
    }
    /// A file.
    pub fn file(&self, name: &str) -> Option<&FileArg> {
        match self.get(name)? {
            Value::File(file) => Some(file),
            _ => None,
        }
    }
}
