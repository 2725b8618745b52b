//! A model and the catalogue of models.

use std::sync::Arc;

use sunglint_radiometry::SpectralGrid;

use crate::{Args, BandMissing, Param};

/// What a model is for; each role is one namespace.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Role {
    /// A surface scattering model.
    Reflectance,
    /// An atmosphere.
    Atmosphere,
    /// A radiance algorithm.
    Algorithm,
    /// An aerosol model.
    Aerosol,
    /// A detector.
    Detector,
}

impl Role {
    /// The role in words.
    pub const fn noun(self) -> &'static str {
        match self {
            Self::Reflectance => "reflectance model",
            Self::Atmosphere => "atmosphere",
            Self::Algorithm => "algorithm",
            Self::Aerosol => "aerosol model",
            Self::Detector => "detector",
        }
    }
}

/// What a model says of itself.
#[derive(Clone, Copy, Debug)]
pub struct ModelInfo {
    /// Name in a scene.
    pub name: &'static str,
    /// One line.
    pub summary: &'static str,
    /// The manual page: equations, validity, estimators, accuracy, an example.
    pub manual: &'static str,
    /// Declared parameters.
    pub params: &'static [Param],
}

impl ModelInfo {
    /// The declared parameter of that name.
    pub fn param(&self, name: &str) -> Option<&'static Param> {
        self.params.iter().find(|param| param.name == name)
    }
}

/// Why arguments make no model, in words for the one who wrote the scene.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{message}")]
pub struct BindError {
    /// Diagnostic code of `docs/LANGUAGE.md`: `S05` (required or excluded), `U05` (range), `M04` (coverage),
    /// `M05` (table or energy), `F01` (malformed file), `F02` (column).
    pub code: &'static str,
    /// The parameter at fault, if one is.
    pub param: Option<&'static str>,
    /// What is wrong.
    pub message: String,
    /// What would be right.
    pub help: Option<String>,
}

impl BindError {
    /// A fault of one parameter.
    pub fn new(code: &'static str, param: &'static str, message: impl Into<String>) -> Self {
        Self { code, param: Some(param), message: message.into(), help: None }
    }
    /// A fault of the model's block as a whole.
    pub fn of_block(code: &'static str, message: impl Into<String>) -> Self {
        Self { code, param: None, message: message.into(), help: None }
    }
    /// With a cure.
    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }
}

impl From<BandMissing> for BindError {
    fn from(missing: BandMissing) -> Self {
        Self::of_block("M04", missing.to_string()).help("give a value for every band the material is seen in")
    }
}

/// A model that makes a `T` from arguments, bound to one spectral grid.
pub struct Model<T: ?Sized + 'static> {
    /// What it says of itself.
    pub info: ModelInfo,
    /// Makes it. A material's total reflectance reaches `bind` as the argument `reflectance`; beside it the switch `scaled`
    /// is on where the model is another material's, taken over by `like`, and the reflectance the material's own.
    pub bind: fn(&Args, &SpectralGrid) -> Result<Arc<T>, BindError>,
}

/// The models that a scene is held against.
#[derive(Clone, Debug, Default)]
pub struct Catalog {
    models: Vec<(Role, ModelInfo)>,
}

impl Catalog {
    /// Adds a model.
    pub fn add(&mut self, role: Role, info: ModelInfo) {
        self.models.push((role, info));
    }
    /// The model of a name in a role.
    pub fn find(&self, role: Role, name: &str) -> Option<&ModelInfo> {
        self.of(role).find(|info| info.name == name)
    }
    /// The models of a role, in order of registration.
    pub fn of(&self, role: Role) -> impl Iterator<Item = &ModelInfo> {
        self.models.iter().filter(move |(r, _)| *r == role).map(|(_, info)| info)
    }
    /// The role under which a name is known, for messages.
    pub fn role_of(&self, name: &str) -> Option<Role> {
        self.models.iter().find(|(_, info)| info.name == name).map(|(role, _)| *role)
    }
}
