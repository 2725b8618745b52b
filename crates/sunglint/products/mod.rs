//! Image files: OpenEXR and ENVI for measurement, written and read, PNG for the eye.
//!
//! Every writer checks its input first and then writes through [`write_whole`], so a file appears whole or not at all.

mod envi;
mod exr;
mod map;
mod png;
mod read;
mod whole;

use std::collections::HashSet;
use std::io;

pub use self::envi::write_envi;
pub use self::exr::write_exr;
pub use self::map::MapProjection;
pub use self::png::{Stretch, StretchCollector, composite_bands, write_png_gray, write_png_rgb};
pub use self::read::{Image, ImageBand, ReadError, Samples, read_image};
pub use self::whole::write_whole;

/// How samples are stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Encoding {
    /// 32-bit floats.
    #[default]
    Float,
    /// Whole numbers from 0 up, of so many bits, at most 24: floats hold them without loss until they are written.
    Whole {
        /// Bits that they need.
        bits: u32,
    },
}

/// An image of several channels.
#[derive(Clone, Debug, Default)]
pub struct Raster<'a> {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Channels, in the order of the sensor's bands.
    pub channels: Vec<RasterChannel<'a>>,
    /// How they are stored.
    pub encoding: Encoding,
}

/// One channel of an image.
#[derive(Clone, Debug)]
pub struct RasterChannel<'a> {
    /// Name, unique in its image: letters, digits, `_`, `.`, `-` and spaces.
    pub name: String,
    /// Unit of the samples; files carry it in ASCII (`W m⁻² sr⁻¹ µm⁻¹` becomes `W m-2 sr-1 um-1`).
    pub unit: &'a str,
    /// Centre of the band \[nm\].
    pub centre_nm: Option<f64>,
    /// Full width at half maximum of the band \[nm\].
    pub fwhm_nm: Option<f64>,
    /// Samples, row by row from the top left.
    pub data: &'a [f32],
}

impl Raster<'_> {
    /// What the files cannot hold: an empty image, a channel of another size, names that are missing, doubled, beyond
    /// 255 letters or such as would need quoting.
    fn check(&self) -> io::Result<()> {
        if self.width == 0 || self.height == 0 || self.channels.is_empty() {
            let n = self.channels.len();
            return Err(invalid(format!("an image of {} x {} pixels and {n} channels", self.width, self.height)));
        }
        let mut names = HashSet::new();
        for channel in &self.channels {
            let name = channel.name.as_str();
            let plain = |c: char| c.is_ascii_alphanumeric() || "_.- ".contains(c);
            if name.trim().is_empty() || name.trim() != name || name.len() > 255 || !name.chars().all(plain) {
                return Err(invalid(format!("`{name}` cannot name a channel")));
            }
            if !names.insert(name) {
                return Err(invalid(format!("two channels are named `{name}`")));
            }
            check_samples(name, self.width, self.height, channel.data)?;
        }
        Ok(())
    }
}

fn check_samples(name: &str, width: u32, height: u32, data: &[f32]) -> io::Result<()> {
    let pixels = u64::from(width) * u64::from(height);
    if data.len() as u64 != pixels {
        let n = data.len();
        return Err(invalid(format!("channel `{name}` holds {n} samples; {width} x {height} pixels need {pixels}")));
    }
    Ok(())
}

/// Attributes as they go into a file: names in the namespace `sunglint:` unless they state one, printable ASCII, sorted.
fn named_attributes(attributes: &[(&str, String)]) -> io::Result<Vec<(String, String)>> {
    let mut named = Vec::with_capacity(attributes.len());
    for (name, value) in attributes {
        let plain = |c: char| c.is_ascii_alphanumeric() || "_.-: ".contains(c);
        if name.trim().is_empty() || name.len() > 200 || !name.chars().all(plain) {
            return Err(invalid(format!("`{name}` cannot name an attribute")));
        }
        let name = if name.contains(':') { (*name).to_string() } else { format!("sunglint:{name}") };
        named.push((name, ascii(value)));
    }
    named.sort();
    if let Some(pair) = named.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        return Err(invalid(format!("two attributes are named `{}`", pair[0].0)));
    }
    Ok(named)
}

/// Printable ASCII: the characters of units are spelled, control characters become spaces, others `?`.
fn ascii(text: &str) -> String {
    text.chars()
        .map(|c| match c {
            ' '..='~' => c,
            '⁰' => '0',
            '¹' => '1',
            '²' => '2',
            '³' => '3',
            '⁻' | '−' | '–' => '-',
            'µ' | 'μ' => 'u',
            '·' => ' ',
            c if c.is_control() => ' ',
            _ => '?',
        })
        .collect()
}

fn invalid(message: String) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidInput, message)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_raster_with_a_short_channel_or_a_doubled_name_is_refused() {
        let channel = |name: &str, data: &'static [f32]| RasterChannel {
            name: name.to_string(),
            unit: "1",
            centre_nm: None,
            fwhm_nm: None,
            data,
        };
        let check = |width, channels| {
            Raster { width, height: 1, channels, ..Raster::default() }.check().map_err(|error| error.to_string())
        };
        assert_eq!(check(2, vec![channel("red", &[1.0, 2.0])]), Ok(()));
        assert_eq!(
            check(2, vec![channel("red", &[1.0])]),
            Err("channel `red` holds 1 samples; 2 x 1 pixels need 2".to_string())
        );
        assert_eq!(
            check(1, vec![channel("red", &[1.0]), channel("red", &[1.0])]),
            Err("two channels are named `red`".to_string())
        );
        for name in ["", " red", "a,b", "{", "röd", "a\nb"] {
            assert!(check(1, vec![channel(name, &[1.0])]).is_err(), "{name:?}");
        }
        assert!(check(0, vec![channel("red", &[])]).is_err());
        assert!(check(1, Vec::new()).is_err());
    }

    #[test]
    fn attributes_are_namespaced_sorted_and_plain() {
        let given = [("time", "1992-06-18T16:00:00Z".to_string()), ("a:unit", "W m⁻² µm⁻¹\n".to_string())];
        let named = named_attributes(&given).unwrap();
        assert_eq!(named[0], ("a:unit".to_string(), "W m-2 um-1 ".to_string()));
        assert_eq!(named[1].0, "sunglint:time");
        assert!(named_attributes(&[("t", String::new()), ("sunglint:t", String::new())]).is_err());
        assert!(named_attributes(&[("a=b", String::new())]).is_err());
    }
}
