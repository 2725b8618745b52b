//! One declared parameter of a model.

use sunglint_radiometry::Dimension;

/// A column of a table parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Column {
    /// Name, as it heads the column of a CSV file without its unit suffix (`view_zenith` in `view_zenith_deg`).
    pub name: &'static str,
    /// What it measures.
    pub dimension: Dimension,
    /// Smallest and largest value, in canonical units.
    pub range: (f64, f64),
}

/// The type of a parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// A number of this dimension.
    Quantity(Dimension),
    /// A quantity at all wavelengths: one number, a file, `[WAVELENGTH value, …]` or `[BAND value, …]`.
    Spectrum(Dimension),
    /// Rows of numbers: inline, or a CSV file that may hold a column `band` or `wavelength_nm` beside these.
    Table(&'static [Column]),
    /// One word of a list.
    Word(&'static [&'static str]),
    /// `on` or `off`.
    Switch,
    /// A whole number, or one of these words.
    Count(&'static [&'static str]),
    /// A file, read whole and handed to the model.
    File,
    /// `[LABEL number, …]`
    Weights,
}

impl Kind {
    /// The type in words: "an angle", "a spectrum of fractions".
    pub fn noun(&self) -> String {
        match self {
            Self::Quantity(dimension) => dimension.noun().to_string(),
            Self::Spectrum(Dimension::Fraction) => "a spectrum".to_string(),
            Self::Spectrum(dimension) => format!("a spectrum, each value {}", dimension.noun()),
            Self::Table(columns) => {
                let names: Vec<&str> = columns.iter().map(|column| column.name).collect();
                format!("a table of {}", names.join(", "))
            }
            Self::Word(words) => format!("one of {}", words.join(", ")),
            Self::Switch => "on or off".to_string(),
            Self::Count([]) => "a whole number".to_string(),
            Self::Count(words) => format!("a whole number or {}", words.join(", ")),
            Self::File => "a file".to_string(),
            Self::Weights => "a list of labels and weights".to_string(),
        }
    }
}

/// What holds where the scene says nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Default {
    /// The scene must say it.
    Required,
    /// Nothing: the model does without.
    Absent,
    /// A number in canonical units; for a spectrum, at all wavelengths.
    Number(f64),
    /// A word.
    Word(&'static str),
    /// A switch.
    Switch(bool),
    /// A count.
    Count(u64),
}

/// A declared parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Param {
    /// Name in a scene.
    pub name: &'static str,
    /// Type.
    pub kind: Kind,
    /// Smallest and largest number, in canonical units (of a spectrum: of every value).
    pub range: (f64, f64),
    /// What holds unsaid.
    pub default: Default,
    /// One line of help.
    pub help: &'static str,
    /// Parameters that may not be given beside this one.
    pub excludes: &'static [&'static str],
}

impl Param {
    const fn new(name: &'static str, kind: Kind, default: Default, help: &'static str) -> Self {
        Self { name, kind, range: (f64::NEG_INFINITY, f64::INFINITY), default, help, excludes: &[] }
    }
    /// A number of a dimension, in canonical units.
    pub const fn quantity(name: &'static str, of: Dimension, default: Default, help: &'static str) -> Self {
        Self::new(name, Kind::Quantity(of), default, help)
    }
    /// A spectrum.
    pub const fn spectrum(name: &'static str, of: Dimension, default: Default, help: &'static str) -> Self {
        Self::new(name, Kind::Spectrum(of), default, help)
    }
    /// A table, given or not.
    pub const fn table(name: &'static str, columns: &'static [Column], default: Default, help: &'static str) -> Self {
        Self::new(name, Kind::Table(columns), default, help)
    }
    /// One word of a list; the default is a word of it, or absent.
    pub const fn word(name: &'static str, of: &'static [&'static str], default: Default, help: &'static str) -> Self {
        Self::new(name, Kind::Word(of), default, help)
    }
    /// `on` or `off`.
    pub const fn switch(name: &'static str, default: bool, help: &'static str) -> Self {
        Self::new(name, Kind::Switch, Default::Switch(default), help)
    }
    /// A whole number, or one of `words`.
    pub const fn count(
        name: &'static str,
        words: &'static [&'static str],
        default: Default,
        help: &'static str,
    ) -> Self {
        Self::new(name, Kind::Count(words), default, help)
    }
    /// A file.
    pub const fn file(name: &'static str, default: Default, help: &'static str) -> Self {
        Self::new(name, Kind::File, default, help)
    }
    /// Weights of other models of the same material, by label; they reach `bind` as the components that they stand for.
    pub const fn weights(name: &'static str, default: Default, help: &'static str) -> Self {
        Self::new(name, Kind::Weights, default, help)
    }
    /// With a range, in canonical units.
    #[must_use]
    pub const fn within(mut self, low: f64, high: f64) -> Self {
        self.range = (low, high);
        self
    }
    /// With parameters that may not be given beside it.
    #[must_use]
    pub const fn excludes(mut self, others: &'static [&'static str]) -> Self {
        self.excludes = others;
        self
    }
}
