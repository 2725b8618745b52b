//! How a model describes itself: declared parameters, checked arguments, a registry. What a model declares here is the
//! single source for the checker, its hints, `sunglint models NAME` and the manual.

mod args;
mod model;
mod param;

pub use args::{Args, BandMissing, Component, FileArg, SpectralValue, Table, TableKey, Value};
pub use model::{BindError, Catalog, Model, ModelInfo, Role};
pub use param::{Column, Default, Kind, Param};
