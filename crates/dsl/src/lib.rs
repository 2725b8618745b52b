//! The scene language: text to a checked scene, with diagnostics as data. Knows no model by name: it is handed a
//! catalogue of declared parameters, and reads files only through the loader that it is handed.

pub mod ast;
mod check;
mod diagnostic;
mod loader;
mod nearest;
mod parse;
pub mod scene;
mod source;
pub mod table;

pub use check::check;
pub use diagnostic::{CODES, Diagnostic, Severity};
pub use loader::{LoadError, Loaded, Loader};
pub use nearest::nearest;
pub use parse::{MAX_DEPTH, VERSION, parse};
pub use scene::Scene;
pub use source::{FileId, Source, Sources, Span};
