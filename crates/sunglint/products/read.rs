//! Reading images back: our own products and foreign OpenEXR and ENVI files.

mod envi;
mod exr;

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use sunglint_dsl::nearest;

/// Most bytes of samples of one image in memory.
const MOST_BYTES: u64 = 4 << 30;

/// An image of several bands, read into memory.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Bands: in the order of the file, or the one that `sunglint:channels` states.
    pub bands: Vec<ImageBand>,
    /// What the file says beside: text attributes of OpenEXR by their names, fields of an ENVI header by their keys in
    /// lower case (`map info` among them), with spaces or colons as they stand.
    pub attributes: BTreeMap<String, String>,
    /// What was taken for granted, for the user to know.
    pub notes: Vec<String>,
}

/// One band of an image.
#[derive(Clone, Debug, PartialEq)]
pub struct ImageBand {
    /// Its name.
    pub name: String,
    /// Centre \[µm\].
    pub wavelength_um: Option<f64>,
    /// Full width at half maximum \[µm\].
    pub fwhm_um: Option<f64>,
    /// Unit of the samples, as the file spells it.
    pub unit: Option<String>,
    /// Row by row from the top left; NaN where the file has no value.
    pub samples: Samples,
}

/// Samples in a type that holds them all exactly.
#[derive(Clone, Debug, PartialEq)]
pub enum Samples {
    /// Of 8- and 16-bit integers and of 16- and 32-bit floats.
    F32(Vec<f32>),
    /// Of 32-bit integers and 64-bit floats, and of scaled values.
    F64(Vec<f64>),
}

impl Samples {
    /// Number of samples.
    pub fn len(&self) -> usize {
        match self {
            Self::F32(samples) => samples.len(),
            Self::F64(samples) => samples.len(),
        }
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Sample `i`.
    pub fn get(&self, i: usize) -> f64 {
        match self {
            Self::F32(samples) => f64::from(samples[i]),
            Self::F64(samples) => samples[i],
        }
    }

    /// All samples, in order.
    pub fn iter(&self) -> impl Iterator<Item = f64> + '_ {
        (0..self.len()).map(|i| self.get(i))
    }
}

impl Image {
    /// A band by its name.
    pub fn band(&self, name: &str) -> Option<&ImageBand> {
        self.bands.iter().find(|band| band.name == name)
    }

    /// An attribute that Sunglint wrote, under either format's name for it.
    pub fn own_attribute(&self, name: &str) -> Option<&str> {
        let named = |separator: char| self.attributes.get(&format!("sunglint{separator}{name}"));
        named(':').or_else(|| named(' ')).map(String::as_str)
    }
}

/// Why a file is not read.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// There is no such file.
    #[error("there is no file `{path}`{}", nearest.as_ref().map_or(String::new(), |near| format!("; `{near}`?")))]
    Missing {
        /// The path.
        path: PathBuf,
        /// The nearest name in its folder.
        nearest: Option<String>,
    },
    /// It cannot be read.
    #[error("`{path}` is not readable: {source}")]
    Io {
        /// The path.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// It is not what it should be.
    #[error("{path}{}: {message}", line.map_or(String::new(), |line| format!(":{line}")))]
    Format {
        /// The path.
        path: PathBuf,
        /// Line, counted from 1, of a text file.
        line: Option<usize>,
        /// What is wrong, and what would be right.
        message: String,
    },
}

impl ReadError {
    fn format(path: &Path, line: Option<usize>, message: impl Into<String>) -> Self {
        Self::Format { path: path.to_path_buf(), line, message: message.into() }
    }

    fn io(path: &Path, source: io::Error) -> Self {
        if source.kind() != io::ErrorKind::NotFound {
            return Self::Io { path: path.to_path_buf(), source };
        }
        let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let mut names: Vec<String> = (fs::read_dir(folder).into_iter().flatten())
            .filter_map(|entry| Some(entry.ok()?.file_name().to_string_lossy().into_owned()))
            .collect();
        names.sort();
        let nearest = nearest(&name, names.iter().map(String::as_str)).map(str::to_string);
        Self::Missing { path: path.to_path_buf(), nearest }
    }
}

/// Reads an image: OpenEXR (scan lines or tiles, 16- and 32-bit floats and 32-bit integers, any channels, several parts of
/// one size), or ENVI by its data file or its header (8- to 32-bit integers, 32- and 64-bit floats, any interleave and
/// byte order). What the file declares as no value is NaN.
///
/// # Errors
/// A file that is missing, unreadable, truncated, of another format or of a kind that is not read, or larger than 4 GiB of
/// samples. Sizes are weighed before memory is taken.
pub fn read_image(path: &Path) -> Result<Image, ReadError> {
    let mut file = File::open(path).map_err(|error| ReadError::io(path, error))?;
    let meta = file.metadata().map_err(|error| ReadError::io(path, error))?;
    if !meta.is_file() {
        return Err(ReadError::format(path, None, "not a plain file"));
    }
    let mut magic = Vec::new();
    (&mut file).take(4).read_to_end(&mut magic).map_err(|error| ReadError::io(path, error))?;
    if magic == exr::MAGIC {
        return exr::read(path, file, meta.len());
    }
    match envi::files(path, &magic) {
        Some((header, data)) => envi::read(&header, &data),
        None => Err(ReadError::format(
            path,
            None,
            "neither an OpenEXR file nor an ENVI image with its header (.hdr) beside it",
        )),
    }
}

/// That an image of this shape fits: its bytes in memory, or a refusal.
fn weigh(path: &Path, width: u64, height: u64, bands: u64, bytes: u64) -> Result<u64, ReadError> {
    if width == 0 || height == 0 || bands == 0 {
        return Err(ReadError::format(path, None, format!("an image of {width} x {height} pixels and {bands} bands")));
    }
    let total = width.checked_mul(height).and_then(|n| n.checked_mul(bands)).and_then(|n| n.checked_mul(bytes));
    match total {
        Some(total) if total <= MOST_BYTES && width <= u64::from(u32::MAX) && height <= u64::from(u32::MAX) => {
            Ok(total)
        }
        _ => Err(ReadError::format(
            path,
            None,
            format!(
                "{width} x {height} pixels in {bands} bands take more than the {} GiB that are read",
                MOST_BYTES >> 30
            ),
        )),
    }
}

/// A wavelength \[µm\] in the name of a band: `nm555`, `555nm`, `0.555 um`, and `S0.555,5nm`, where a comma is the decimal
/// sign and the point ends a prefix [Fichet et al. 2021].
fn wavelength_in_name(name: &str) -> Option<f64> {
    let lower = name.to_ascii_lowercase();
    let plausible = |um: f64| (0.1..=100.0).contains(&um).then_some(um);
    if let Some(digits) = lower.strip_prefix("nm") {
        return digits.parse::<f64>().ok().and_then(|nm| plausible(nm * 1e-3));
    }
    let (before, scale) = match (lower.find("nm"), lower.find("um")) {
        (Some(at), _) => (&lower[..at], 1e-3),
        (None, Some(at)) => (&lower[..at], 1.0),
        (None, None) => return None,
    };
    let before = before.trim_end();
    let last = if before.contains(',') { before.rsplit('.').next()? } else { before };
    let digits = last.rsplit(|c: char| !(c.is_ascii_digit() || c == '.' || c == ',')).next()?.replace(',', ".");
    digits.parse::<f64>().ok().and_then(|value| plausible(value * scale))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_may_hold_a_wavelength() {
        for (name, um) in [
            ("nm405", Some(0.405)),
            ("555nm", Some(0.555)),
            ("S0.555,5nm", Some(0.5555)),
            ("radiance.0.86 um", None),
            ("0.86 um", Some(0.86)),
            ("red", None),
            ("nm", None),
            ("µ550nm", Some(0.55)),
            ("R", None),
        ] {
            let found = wavelength_in_name(name);
            assert!(
                found.zip(um).is_some_and(|(a, b): (f64, f64)| (a - b).abs() < 1e-12) || found == um,
                "{name}: {found:?}"
            );
        }
    }

    #[test]
    fn sizes_are_weighed_before_memory_is_taken() {
        let weigh = |w, h, b| weigh(Path::new("x"), w, h, b, 4);
        assert!(weigh(640, 480, 4).is_ok());
        for (w, h, b) in [(0, 1, 1), (1, 1, 0), (1 << 32, 1, 1), (1 << 20, 1 << 20, 1), (u64::MAX, u64::MAX, 2)] {
            assert!(weigh(w, h, b).is_err());
        }
    }
}
