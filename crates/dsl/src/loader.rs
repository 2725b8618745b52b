//! Files, as the language sees them.

use std::sync::Arc;

/// A file that was read.
#[derive(Clone, Debug, PartialEq)]
pub struct Loaded {
    /// Path as shown in messages, and from which further relative paths count.
    pub path: String,
    /// Content.
    pub bytes: Arc<[u8]>,
}

/// Why a file was not read.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{message}")]
pub struct LoadError {
    /// What is wrong, naming the path.
    pub message: String,
    /// The nearest name in the folder, if one is near.
    pub nearest: Option<String>,
}

/// Reads files for the checker; the only way by which `dsl` sees any.
pub trait Loader {
    /// Reads the file that `path` names in the file `from` (relative paths are relative to the file they stand in;
    /// `sunglint:…` is shipped data). The main scene has `from = ""`.
    fn read(&mut self, path: &str, from: &str) -> Result<Loaded, LoadError>;

    /// Names of the files in the folder that `path` names in the file `from`, in any order; none where the loader knows no
    /// folders.
    fn list(&mut self, _path: &str, _from: &str) -> Result<Vec<String>, LoadError> {
        Ok(Vec::new())
    }

    /// Says that the scene file at this path, as it was asked for, has been read to its end and is not asked for again: what
    /// was kept of it may go.
    fn done(&mut self, _path: &str, _from: &str) {}
}
