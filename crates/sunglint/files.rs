//! Files that a scene names: read once, sized, hashed for the manifest.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use sunglint_dsl::{LoadError, Loaded, Loader, nearest};

/// Largest file that a scene may name \[bytes\].
const LARGEST: u64 = 2 << 30;

/// Most names that the listing of a folder holds.
const MOST_LISTED: usize = 100_000;

/// Reads files from disk, and shipped data behind `sunglint:`.
#[derive(Default)]
pub struct Files {
    read: BTreeMap<PathBuf, Loaded>,
    hashes: BTreeMap<String, String>,
}

impl Files {
    /// Paths as shown in messages, with the BLAKE3 hash of each file that was read.
    pub fn hashes(&self) -> &BTreeMap<String, String> {
        &self.hashes
    }
}

impl Loader for Files {
    fn read(&mut self, path: &str, from: &str) -> Result<Loaded, LoadError> {
        if let Some(name) = path.strip_prefix("sunglint:") {
            return self.shipped(path, name);
        }
        let full = Path::new(from).parent().unwrap_or(Path::new("")).join(path);
        if let Some(loaded) = self.read.get(&full) {
            return Ok(loaded.clone());
        }
        let shown = full.to_string_lossy().into_owned();
        let fail = |message: String, nearest| Err(LoadError { message, nearest });
        let meta = match fs::metadata(&full) {
            Ok(meta) => meta,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                return fail(format!("there is no file `{shown}`"), nearest_in_folder(&full));
            }
            Err(error) => return fail(format!("`{shown}` is not readable: {error}"), None),
        };
        if meta.is_dir() {
            return fail(format!("`{shown}` is a folder, not a file"), None);
        }
        if !meta.is_file() {
            return fail(format!("`{shown}` is not a plain file"), None);
        }
        if meta.len() > LARGEST {
            return fail(format!("`{shown}` holds {} bytes; at most {LARGEST} are read", meta.len()), None);
        }
        let bytes: Arc<[u8]> = match fs::read(&full) {
            Ok(bytes) => bytes.into(),
            Err(error) => return fail(format!("`{shown}` is not readable: {error}"), None),
        };
        self.hashes.insert(shown.clone(), blake3::hash(&bytes).to_hex().to_string());
        let loaded = Loaded { path: shown, bytes };
        self.read.insert(full, loaded.clone());
        Ok(loaded)
    }

    fn list(&mut self, path: &str, from: &str) -> Result<Vec<String>, LoadError> {
        if path == "sunglint:materials" {
            return Ok(sunglint_reflectance::shipped_materials().map(|(name, _)| format!("{name}.glint")).collect());
        }
        let full = Path::new(from).parent().unwrap_or(Path::new("")).join(path);
        let shown = full.to_string_lossy();
        let here = if full.as_os_str().is_empty() { Path::new(".") } else { &full };
        match fs::read_dir(here) {
            Ok(entries) => Ok(entries
                .filter_map(|entry| Some(entry.ok()?.file_name().to_string_lossy().into_owned()))
                .take(MOST_LISTED)
                .collect()),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                Err(LoadError { message: format!("there is no folder `{shown}`"), nearest: nearest_in_folder(&full) })
            }
            Err(error) => {
                Err(LoadError { message: format!("`{shown}` is no readable folder: {error}"), nearest: None })
            }
        }
    }

    fn done(&mut self, path: &str, from: &str) {
        self.read.remove(&Path::new(from).parent().unwrap_or(Path::new("")).join(path));
    }
}

impl Files {
    fn shipped(&mut self, path: &str, name: &str) -> Result<Loaded, LoadError> {
        let Some(text) = sunglint_reflectance::shipped(name) else {
            let materials: Vec<String> =
                sunglint_reflectance::shipped_materials().map(|(name, _)| format!("materials/{name}.glint")).collect();
            let spectra = sunglint_reflectance::shipped_names().map(str::to_string);
            let known: Vec<String> = spectra.chain(materials).collect();
            let nearest = nearest(name, known.iter().map(String::as_str));
            return Err(LoadError {
                message: format!("no shipped data is called `{name}`"),
                nearest: nearest.map(|name| format!("sunglint:{name}")),
            });
        };
        self.hashes.insert(path.to_string(), blake3::hash(text.as_bytes()).to_hex().to_string());
        Ok(Loaded { path: path.to_string(), bytes: text.as_bytes().into() })
    }
}

/// Files with one whose text is given.
pub(crate) struct Given {
    path: String,
    text: Vec<u8>,
    files: Files,
}

impl Given {
    pub(crate) fn new(path: &str, text: String) -> Self {
        Self { path: path.to_string(), text: text.into_bytes(), files: Files::default() }
    }

    pub(crate) fn into_files(self) -> Files {
        self.files
    }
}

impl Loader for Given {
    fn read(&mut self, path: &str, from: &str) -> Result<Loaded, LoadError> {
        if from.is_empty() && path == self.path {
            return Ok(Loaded { path: self.path.clone(), bytes: self.text.as_slice().into() });
        }
        self.files.read(path, from)
    }

    fn list(&mut self, path: &str, from: &str) -> Result<Vec<String>, LoadError> {
        self.files.list(path, from)
    }

    fn done(&mut self, path: &str, from: &str) {
        self.files.done(path, from);
    }
}

fn nearest_in_folder(path: &Path) -> Option<String> {
    let name = path.file_name()?.to_string_lossy().into_owned();
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut names: Vec<String> = (fs::read_dir(folder).ok()?)
        .filter_map(|entry| Some(entry.ok()?.file_name().to_string_lossy().into_owned()))
        .collect();
    names.sort();
    nearest(&name, names.iter().map(String::as_str)).map(str::to_string)
}
