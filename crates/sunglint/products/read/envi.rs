//! ENVI images, ours and others'.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use super::{Image, ImageBand, ReadError, Samples, weigh};

/// Largest header that is read \[bytes\].
const LARGEST_HEADER: u64 = 16 << 20;

/// Most bands of an image.
const MOST_BANDS: u64 = 65_536;

/// The header and the data file that belong to a path of either, by their names.
pub fn files(path: &Path, start: &[u8]) -> Option<(PathBuf, PathBuf)> {
    let beside = |ending: &str| {
        let mut name = path.as_os_str().to_os_string();
        name.push(ending);
        PathBuf::from(name)
    };
    if start == b"ENVI" {
        let stem = path.with_extension("");
        let endings = ["", "img", "dat", "bsq", "bil", "bip", "raw", "bin"];
        // `x.img.hdr` belongs to `x.img`, `x.hdr` to `x.img` or another of its kin.
        let found =
            endings.iter().map(|ending| if ending.is_empty() { stem.clone() } else { stem.with_extension(ending) });
        let data = found.into_iter().find(|data| data.is_file() && data != path);
        return Some((path.to_path_buf(), data.unwrap_or_else(|| stem.with_extension("img"))));
    }
    [path.with_extension("hdr"), beside(".hdr")]
        .into_iter()
        .find(|header| header.is_file() && header != path)
        .map(|header| (header, path.to_path_buf()))
}

/// A sample's type.
#[derive(Clone, Copy)]
struct Kind {
    bytes: usize,
    /// Whether `f32` holds every value.
    narrow: bool,
    /// From little-endian bytes.
    value: fn(&[u8]) -> f64,
}

fn kind(code: u64) -> Option<Kind> {
    let kind = |bytes, narrow, value| Some(Kind { bytes, narrow, value });
    match code {
        1 => kind(1, true, |b| f64::from(b[0])),
        2 => kind(2, true, |b| f64::from(i16::from_le_bytes([b[0], b[1]]))),
        3 => kind(4, false, |b| f64::from(i32::from_le_bytes([b[0], b[1], b[2], b[3]]))),
        4 => kind(4, true, |b| f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]]))),
        5 => kind(8, false, |b| f64::from_le_bytes([b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7]])),
        12 => kind(2, true, |b| f64::from(u16::from_le_bytes([b[0], b[1]]))),
        13 => kind(4, false, |b| f64::from(u32::from_le_bytes([b[0], b[1], b[2], b[3]]))),
        _ => None,
    }
}

/// The fields of a header: value and line by key in lower case.
struct Fields<'p> {
    path: &'p Path,
    fields: BTreeMap<String, (String, usize)>,
    lines: usize,
}

pub fn read(header: &Path, data: &Path) -> Result<Image, ReadError> {
    let fields = Fields::read(header)?;
    let (width, height, n_bands) = (fields.count("samples")?, fields.count("lines")?, fields.count("bands")?);
    if n_bands > MOST_BANDS {
        return Err(fields.at("bands", "at most 65536 bands are read"));
    }
    let kind = fields.kind()?;
    let offset = fields.optional("header offset")?.unwrap_or(0);
    let mut notes = Vec::new();
    let swap = match fields.optional("byte order")? {
        Some(0) => false,
        Some(1) => true,
        Some(_) => return Err(fields.at("byte order", "write 0 (little-endian) or 1 (big-endian)")),
        None => {
            if kind.bytes > 1 {
                notes.push("the header states no byte order; little-endian is taken".to_string());
            }
            false
        }
    };
    let interleave = fields.interleave(n_bands)?;
    if fields.optional("file compression")?.unwrap_or(0) != 0 {
        return Err(fields.at("file compression", "compressed ENVI files are not read"));
    }
    let gains = fields.numbers("data gain values", n_bands)?;
    let offsets = fields.numbers("data offset values", n_bands)?;
    let ignored: Option<f64> = match fields.text("data ignore value") {
        Some(text) => Some(text.parse().map_err(|_| fields.at("data ignore value", "no number"))?),
        None => None,
    };
    let scaled = gains.is_some() || offsets.is_some();
    weigh(header, width, height, n_bands, if kind.narrow && !scaled { 4 } else { 8 })?;
    let mut bands = fields.bands(n_bands, &mut notes)?;
    if let Some(factor) = fields.text("reflectance scale factor") {
        notes.push(format!("`reflectance scale factor = {factor}` is not applied"));
    }

    let file = File::open(data).map_err(|error| ReadError::io(data, error))?;
    let held = file.metadata().map_err(|error| ReadError::io(data, error))?.len();
    // Within bounds: `weigh` has passed the product.
    let needed = offset.saturating_add(width * height * n_bands * kind.bytes as u64);
    if held < needed {
        let said = header.display();
        return Err(ReadError::format(data, None, format!("{held} bytes; {said} describes {needed}")));
    }
    let mut source = BufReader::with_capacity(1 << 18, file);
    source.seek(SeekFrom::Start(offset)).map_err(|error| ReadError::io(data, error))?;
    let (width, height, n_bands) = (width as usize, height as usize, n_bands as usize);
    for band in &mut bands {
        let n = width * height;
        band.samples = match kind.narrow && !scaled {
            true => Samples::F32(Vec::with_capacity(n)),
            false => Samples::F64(Vec::with_capacity(n)),
        };
    }
    // One row of one band at a time, or of all bands where they alternate by pixel.
    let (outer, inner, step) = match interleave {
        Interleave::Bsq => (n_bands, height, 1),
        Interleave::Bil => (height, n_bands, 1),
        Interleave::Bip => (height, 1, n_bands),
    };
    let mut row = vec![0; width * step * kind.bytes];
    for i in 0..outer {
        for j in 0..inner {
            source.read_exact(&mut row).map_err(|error| ReadError::io(data, error))?;
            if swap {
                row.chunks_exact_mut(kind.bytes).for_each(<[u8]>::reverse);
            }
            for (k, bytes) in row.chunks_exact(kind.bytes).enumerate() {
                let b = match interleave {
                    Interleave::Bsq => i,
                    Interleave::Bil => j,
                    Interleave::Bip => k % n_bands,
                };
                let mut value = (kind.value)(bytes);
                if ignored.is_some_and(|ignored| value == ignored || value as f32 == ignored as f32 && kind.narrow) {
                    value = f64::NAN;
                }
                match &mut bands[b].samples {
                    Samples::F32(samples) => samples.push(value as f32),
                    Samples::F64(samples) => {
                        let of = |list: &Option<Vec<f64>>, default: f64| list.as_ref().map_or(default, |list| list[b]);
                        samples.push(value * of(&gains, 1.0) + of(&offsets, 0.0));
                    }
                }
            }
        }
    }
    let attributes = fields.fields.into_iter().map(|(key, (value, _))| (key, value)).collect();
    Ok(Image { width: width as u32, height: height as u32, bands, attributes, notes })
}

#[derive(Clone, Copy)]
enum Interleave {
    Bsq,
    Bil,
    Bip,
}

impl<'p> Fields<'p> {
    fn read(path: &'p Path) -> Result<Self, ReadError> {
        let file = File::open(path).map_err(|error| ReadError::io(path, error))?;
        let mut bytes = Vec::new();
        file.take(LARGEST_HEADER + 1).read_to_end(&mut bytes).map_err(|error| ReadError::io(path, error))?;
        if bytes.len() as u64 > LARGEST_HEADER {
            return Err(ReadError::format(path, None, format!("a header of more than {LARGEST_HEADER} bytes")));
        }
        let text = String::from_utf8_lossy(&bytes);
        let mut lines = text.lines().enumerate();
        match lines.next() {
            Some((_, first)) if first.trim_start_matches('\u{feff}').trim() == "ENVI" => {}
            _ => return Err(ReadError::format(path, Some(1), "an ENVI header begins with the line `ENVI`")),
        }
        let mut fields: BTreeMap<String, (String, usize)> = BTreeMap::new();
        let mut last = 1;
        while let Some((i, line)) = lines.next() {
            last = i + 1;
            if line.trim().is_empty() || line.trim_start().starts_with(';') {
                continue;
            }
            let Some((key, value)) = line.split_once('=') else {
                return Err(ReadError::format(path, Some(i + 1), "a line of a header is `key = value`"));
            };
            let key = key.split_whitespace().collect::<Vec<_>>().join(" ").to_lowercase();
            let mut value = value.trim().to_string();
            if value.starts_with('{') {
                while !value.ends_with('}') {
                    let Some((j, more)) = lines.next() else {
                        return Err(ReadError::format(
                            path,
                            Some(i + 1),
                            format!("the brace of `{key}` is not closed"),
                        ));
                    };
                    last = j + 1;
                    value.push(' ');
                    value.push_str(more.trim());
                    value.truncate(value.trim_end().len());
                }
                value = value[1..value.len() - 1].trim().to_string();
            }
            if let Some((_, first)) = fields.get(&key) {
                return Err(ReadError::format(path, Some(i + 1), format!("`{key}` stands already in line {first}")));
            }
            fields.insert(key, (value, i + 1));
        }
        Ok(Self { path, fields, lines: last })
    }

    fn text(&self, key: &str) -> Option<&str> {
        self.fields.get(key).map(|(value, _)| value.as_str())
    }

    /// A fault of a field's value.
    fn at(&self, key: &str, message: &str) -> ReadError {
        match self.fields.get(key) {
            Some((value, line)) => {
                let shown: String = value.chars().take(60).collect();
                ReadError::format(self.path, Some(*line), format!("`{key} = {shown}`: {message}"))
            }
            None => {
                let message = format!("the header ends without `{key}`");
                ReadError::format(self.path, Some(self.lines), message)
            }
        }
    }

    fn optional(&self, key: &str) -> Result<Option<u64>, ReadError> {
        let Some(text) = self.text(key) else { return Ok(None) };
        text.parse().map(Some).map_err(|_| self.at(key, "no whole number"))
    }

    fn count(&self, key: &str) -> Result<u64, ReadError> {
        let count = self.optional(key)?.ok_or_else(|| self.at(key, ""))?;
        if count == 0 { Err(self.at(key, "at least one is needed")) } else { Ok(count) }
    }

    fn kind(&self) -> Result<Kind, ReadError> {
        let code = self.count("data type")?;
        kind(code).ok_or_else(|| self.at("data type", "1, 2, 3, 4, 5, 12 and 13 are read"))
    }

    fn interleave(&self, bands: u64) -> Result<Interleave, ReadError> {
        match self.text("interleave").map(str::to_lowercase).as_deref() {
            Some("bsq") => Ok(Interleave::Bsq),
            Some("bil") => Ok(Interleave::Bil),
            Some("bip") => Ok(Interleave::Bip),
            None if bands == 1 => Ok(Interleave::Bsq),
            _ => Err(self.at("interleave", "write bsq, bil or bip")),
        }
    }

    /// A list of one item a band.
    fn list(&self, key: &str, bands: u64) -> Result<Option<Vec<String>>, ReadError> {
        let Some(text) = self.text(key) else { return Ok(None) };
        let items: Vec<String> = text.split(',').map(|item| item.trim().to_string()).collect();
        match items.len() as u64 == bands {
            true => Ok(Some(items)),
            false => Err(self.at(key, &format!("{} entries for {bands} bands", items.len()))),
        }
    }

    fn numbers(&self, key: &str, bands: u64) -> Result<Option<Vec<f64>>, ReadError> {
        let Some(items) = self.list(key, bands)? else { return Ok(None) };
        let numbers: Option<Vec<f64>> =
            items.iter().map(|item| item.parse().ok().filter(|number: &f64| number.is_finite())).collect();
        numbers.map(Some).ok_or_else(|| self.at(key, "an entry is no number"))
    }

    /// Names, wavelengths and units of the bands, without samples.
    fn bands(&self, n: u64, notes: &mut Vec<String>) -> Result<Vec<ImageBand>, ReadError> {
        let names = self.list("band names", n)?;
        let centres = self.numbers("wavelength", n)?;
        let widths = self.numbers("fwhm", n)?;
        let scale = match self.text("wavelength units").map(str::to_lowercase).as_deref() {
            Some("nanometers" | "nanometer" | "nanometres" | "nm") => Some(1e-3),
            Some("micrometers" | "micrometer" | "micrometres" | "microns" | "um" | "µm") => Some(1.0),
            Some("millimeters" | "mm") => Some(1e3),
            Some("meters" | "m") => Some(1e6),
            other => {
                if centres.is_some() {
                    let said = other.map_or("without a unit".to_string(), |unit| format!("in `{unit}`"));
                    notes.push(format!("the header gives wavelengths {said}; they are left aside"));
                }
                None
            }
        };
        // One unit serves all bands, unless there is one for each.
        let units: Vec<Option<String>> = match (self.text("data units"), self.list("data units", n)) {
            (Some(_), Ok(Some(units))) => units.into_iter().map(Some).collect(),
            (unit, _) => vec![unit.map(str::to_string); n as usize],
        };
        let um = |list: &Option<Vec<f64>>, b: usize| Some(list.as_ref()?[b] * scale?);
        Ok((0..n as usize)
            .map(|b| ImageBand {
                name: names.as_ref().map_or_else(|| format!("Band {}", b + 1), |names| names[b].clone()),
                wavelength_um: um(&centres, b),
                fwhm_um: um(&widths, b),
                unit: units[b].clone(),
                samples: Samples::F32(Vec::new()),
            })
            .collect())
    }
}
