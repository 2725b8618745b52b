//! The scene language: text to a checked scene, with diagnostics as data. Knows no model by name: it is handed a
//! catalogue of declared parameters, and reads files only through the loader that it is handed.

pub mod ast;
mod check;
mod diagnostic;
mod format;
mod loader;
mod nearest;
mod parse;
mod record;
mod runs;
pub mod scene;
mod sounding;
mod source;
pub mod table;

pub use check::{DEFAULT_ATMOSPHERE, check, keywords};
pub use diagnostic::{CODES, Diagnostic, Severity};
pub use format::format;
pub use loader::{LoadError, Loaded, Loader};
pub use nearest::{list, nearest};
pub use parse::{MAX_DEPTH, VERSION, parse};
pub use runs::{Run, Runs};
pub use scene::Scene;
pub use source::{FileId, Source, Sources, Span};
