//! ENVI: raw samples, and a text header beside them.

use std::fmt::Write as _;
use std::io::{self, Write as _};
use std::path::Path;

use super::whole::Unfinished;
use super::{Encoding, Raster, ascii, invalid, named_attributes};

/// Writes `img_path`, little-endian samples band after band, and its header, the same path ending in `.hdr`. Samples are
/// 32-bit floats (data type 4), whole numbers of at most 16 bits (12) or more (13).
///
/// The header lists the bands with their units, centres and full widths at half maximum \[nm\] (the last two where every
/// channel has them), and declares NaN as the value to ignore where the image holds any. `fields` are such as the format
/// itself knows, written as they are but for braces that do not pair; `attributes` become fields of their own, `sunglint:time` as `sunglint time`; braces in a value become parentheses. Both files are written before
/// either takes its place.
///
/// # Errors
/// An image that the format cannot hold (size, names), a path that ends in `.hdr`, and those of [`super::write_whole`].
pub fn write_envi(
    img_path: &Path,
    raster: &Raster,
    description: &str,
    fields: &[(&str, String)],
    attributes: &[(&str, String)],
) -> io::Result<()> {
    raster.check()?;
    let hdr_path = img_path.with_extension("hdr");
    if hdr_path == img_path {
        return Err(invalid(format!("{}: the header's own name", img_path.display())));
    }
    let text = header(raster, description, fields, attributes)?;
    let mut img = Unfinished::create(img_path)?;
    img.write(|out| {
        let mut bytes = Vec::with_capacity(4 * raster.width as usize);
        for row in raster.channels.iter().flat_map(|channel| channel.data.chunks(raster.width as usize)) {
            bytes.clear();
            match raster.encoding {
                Encoding::Float => bytes.extend(row.iter().flat_map(|sample| sample.to_le_bytes())),
                Encoding::Whole { bits: ..=16 } => bytes.extend(row.iter().flat_map(|s| (*s as u16).to_le_bytes())),
                Encoding::Whole { .. } => bytes.extend(row.iter().flat_map(|s| (*s as u32).to_le_bytes())),
            }
            out.write_all(&bytes)?;
        }
        Ok(())
    })?;
    let mut hdr = Unfinished::create(&hdr_path)?;
    hdr.write(|out| out.write_all(text.as_bytes()))?;
    img.publish()?;
    hdr.publish()
}

fn header(
    raster: &Raster,
    description: &str,
    own: &[(&str, String)],
    attributes: &[(&str, String)],
) -> io::Result<String> {
    let list = |items: Vec<String>| format!("{{{}}}", items.join(", "));
    let inner = |text: &str| ascii(text).replace('{', "(").replace('}', ")");
    let channels = &raster.channels;
    let data_type = match raster.encoding {
        Encoding::Float => "4",
        Encoding::Whole { bits: ..=16 } => "12",
        Encoding::Whole { .. } => "13",
    };
    let mut fields: Vec<(String, String)> = [
        ("description", format!("{{{}}}", inner(description))),
        ("samples", raster.width.to_string()),
        ("lines", raster.height.to_string()),
        ("bands", channels.len().to_string()),
        ("header offset", "0".into()),
        ("file type", "ENVI Standard".into()),
        ("data type", data_type.into()),
        ("interleave", "bsq".into()),
        ("byte order", "0".into()),
        ("band names", list(channels.iter().map(|channel| channel.name.clone()).collect())),
    ]
    .map(|(key, value)| (key.to_string(), value))
    .into();
    let mut field = |key: &str, value: String| fields.push((key.to_string(), value));
    let units: Vec<String> = channels.iter().map(|channel| inner(channel.unit).replace(',', " ")).collect();
    match units.first() {
        Some(unit) if units.iter().all(|other| other == unit) => field("data units", unit.clone()),
        _ => field("data units", list(units)),
    }
    let numbers = |of: Vec<Option<f64>>| {
        let all: Option<Vec<f64>> = of.into_iter().collect();
        all.map(|all| list(all.iter().map(f64::to_string).collect()))
    };
    if let Some(centres) = numbers(channels.iter().map(|channel| channel.centre_nm).collect()) {
        field("wavelength units", "Nanometers".into());
        field("wavelength", centres);
        if let Some(widths) = numbers(channels.iter().map(|channel| channel.fwhm_nm).collect()) {
            field("fwhm", widths);
        }
    }
    if channels.iter().any(|channel| channel.data.iter().any(|sample| sample.is_nan())) {
        field("data ignore value", "nan".into());
    }
    for (name, value) in own {
        let list = value.strip_prefix('{').and_then(|value| value.strip_suffix('}'));
        field(name, list.map_or_else(|| inner(value), |list| format!("{{{}}}", inner(list))));
    }
    for (name, value) in named_attributes(attributes)? {
        field(&name.replace(':', " ").to_lowercase(), inner(&value));
    }
    let mut text = "ENVI\n".to_string();
    for (i, (key, value)) in fields.iter().enumerate() {
        if fields[..i].iter().any(|(other, _)| other == key) {
            return Err(invalid(format!("two header fields are named `{key}`")));
        }
        let _ = writeln!(text, "{key} = {value}"); // a string takes every write
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::products::RasterChannel;

    fn read_envi(img_path: &Path) -> (usize, usize, Vec<String>, Vec<Vec<f32>>) {
        let header = std::fs::read_to_string(img_path.with_extension("hdr")).unwrap();
        let field = |key: &str| {
            let line = header.lines().find_map(|line| line.strip_prefix(key)?.strip_prefix(" = "));
            line.unwrap_or_else(|| panic!("no {key}")).to_string()
        };
        let (width, height) = (field("samples").parse().unwrap(), field("lines").parse().unwrap());
        assert_eq!(
            [field("data type"), field("interleave"), field("byte order"), field("header offset")],
            ["4", "bsq", "0", "0"]
        );
        let names: Vec<String> = field("band names").trim_matches(['{', '}']).split(", ").map(str::to_string).collect();
        let bytes = std::fs::read(img_path).unwrap();
        assert_eq!(bytes.len(), 4 * width * height * names.len());
        let samples: Vec<f32> =
            bytes.chunks_exact(4).map(|bytes| f32::from_le_bytes(bytes.try_into().unwrap())).collect();
        (width, height, names, samples.chunks(width * height).map(<[f32]>::to_vec).collect())
    }

    fn channel<'a>(name: &str, unit: &'a str, nm: Option<(f64, f64)>, data: &'a [f32]) -> RasterChannel<'a> {
        RasterChannel { name: name.into(), unit, centre_nm: nm.map(|nm| nm.0), fwhm_nm: nm.map(|nm| nm.1), data }
    }

    #[test]
    fn every_sample_comes_back_from_its_band() {
        let (width, height) = (5, 3);
        let data: Vec<Vec<f32>> =
            (0..2).map(|c| (0..width * height).map(|i| (i * 10 + c) as f32 * 0.1).collect()).collect();
        let channels = vec![channel("red", "1", None, &data[0]), channel("blue", "1", None, &data[1])];
        let raster = Raster { width: width as u32, height: height as u32, channels, ..Raster::default() };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("noon/radiance.img");
        write_envi(&path, &raster, "two bands", &[], &[]).unwrap();
        assert_eq!(read_envi(&path), (width as usize, height as usize, vec!["red".into(), "blue".into()], data));
        assert_eq!(std::fs::read_dir(path.parent().unwrap()).unwrap().count(), 2);
    }

    #[test]
    fn the_header_states_wavelengths_units_and_what_was_given() {
        let unit = "W m⁻² sr⁻¹ µm⁻¹";
        let data = [0.0, 1.0];
        let channels =
            vec![channel("blue", unit, Some((470.0, 100.0)), &data), channel("nir", unit, Some((870.0, 260.0)), &data)];
        let raster = Raster { width: 2, height: 1, channels, ..Raster::default() };
        let given = [("time", "1992-06-18T16:00:00Z".to_string()), ("models", "split {a, b}".to_string())];
        let own = [("sun elevation", "61.5".to_string()), ("map info", "{UTM, 1, 1}".to_string())];
        assert_eq!(
            header(&raster, "noon,\nroof {1}", &own, &given).unwrap(),
            "ENVI\n\
             description = {noon, roof (1)}\n\
             samples = 2\nlines = 1\nbands = 2\nheader offset = 0\nfile type = ENVI Standard\n\
             data type = 4\ninterleave = bsq\nbyte order = 0\n\
             band names = {blue, nir}\n\
             data units = W m-2 sr-1 um-1\n\
             wavelength units = Nanometers\nwavelength = {470, 870}\nfwhm = {100, 260}\n\
             sun elevation = 61.5\nmap info = {UTM, 1, 1}\n\
             sunglint models = split (a, b)\nsunglint time = 1992-06-18T16:00:00Z\n"
        );
    }

    /// Whole numbers: 16 bits where they do, else 32.
    #[test]
    fn counts_are_stored_in_as_few_bytes_as_they_need() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("counts.img");
        for (bits, data, data_type, bytes) in [
            (12, [0.0, 4095.0], "12", vec![0, 0, 0xff, 0x0f]),
            (24, [1.0, 16_777_215.0], "13", vec![1, 0, 0, 0, 0xff, 0xff, 0xff, 0]),
        ] {
            let channels = vec![channel("red", "DN", None, &data)];
            let raster = Raster { width: 2, height: 1, channels, encoding: Encoding::Whole { bits } };
            write_envi(&path, &raster, "", &[], &[]).unwrap();
            assert_eq!(std::fs::read(&path).unwrap(), bytes);
            let header = std::fs::read_to_string(path.with_extension("hdr")).unwrap();
            assert!(header.contains(&format!("data type = {data_type}\n")), "{header}");
        }
    }

    /// 0 is a radiance like any other; only samples that are no number are to be ignored.
    #[test]
    fn an_ignored_value_is_declared_only_where_samples_are_missing() {
        let data = [[0.0, 1.0], [0.0, f32::NAN]];
        let text = |data| {
            let channels = vec![channel("x", "m", None, data), channel("code", "1", Some((5.0, 1.0)), &[1.0, 2.0])];
            header(&Raster { width: 2, height: 1, channels, ..Raster::default() }, "", &[], &[]).unwrap()
        };
        assert!(!text(&data[0]).contains("ignore"));
        assert!(text(&data[1]).contains("\ndata ignore value = nan\n"));
        assert!(text(&data[0]).contains("\ndata units = {m, 1}\n"));
        assert!(!text(&data[0]).contains("wavelength")); // one channel has none
    }

    #[test]
    fn a_refused_image_leaves_no_file() {
        let folder = tempfile::tempdir().unwrap();
        let raster = |width| Raster {
            width,
            height: 1,
            channels: vec![channel("a", "1", None, &[1.0, 2.0])],
            ..Raster::default()
        };
        assert!(write_envi(&folder.path().join("a.img"), &raster(3), "", &[], &[]).is_err());
        assert!(write_envi(&folder.path().join("a.hdr"), &raster(2), "", &[], &[]).is_err());
        let twice = [("a:b", String::new()), ("A:b", String::new())];
        assert!(write_envi(&folder.path().join("a.img"), &raster(2), "", &[], &twice).is_err());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
