//! OpenEXR: 32-bit floats or whole numbers, one channel a band, without loss.

use std::fs::File;
use std::io::{self, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::Path;

use ::exr::block::{self, UncompressedBlock, writer::ChunksWriter};
use ::exr::error::Error;
use ::exr::meta::BlockDescription;
use ::exr::meta::attribute::{AttributeValue, ChannelDescription, Compression, LineOrder, SampleType, Text};
use ::exr::meta::header::Header;

use super::{Encoding, Raster, ascii, invalid, named_attributes, whole};

/// Writes a scan-line OpenEXR file: 32-bit floats or whole numbers, ZIP compression, lossless.
///
/// A channel bears the name of its band. OpenEXR lists channels by name, so text attributes hold the raster's own order:
/// `sunglint:channels`, and in that order `sunglint:units`, `sunglint:wavelengths_nm`, `sunglint:fwhm_nm`, parted by
/// `, ` (the last two where any channel has them, `nan` for one without). `attributes` are added; a name without a colon
/// is put into the namespace `sunglint:`. Equal input gives equal bytes.
///
/// # Errors
/// An image that the format cannot hold (size, names), and those of [`super::write_whole`].
pub fn write_exr(path: &Path, raster: &Raster, attributes: &[(&str, String)]) -> io::Result<()> {
    raster.check()?;
    let attributes = all_attributes(raster, attributes)?;
    let mut by_name: Vec<usize> = (0..raster.channels.len()).collect();
    by_name.sort_by(|a, b| raster.channels[*a].name.as_bytes().cmp(raster.channels[*b].name.as_bytes()));
    let header = header(raster, &by_name, attributes)?;
    let channels = header.channels.clone();
    let long_names = raster.channels.iter().any(|channel| channel.name.len() > 31);
    whole::write_whole(path, |out| {
        block::write(&mut *out, [header].into_iter().collect(), true, |meta, chunks| {
            let width = raster.width as usize;
            let blocks =
                block::enumerate_ordered_header_block_indices(&meta.headers).map(|(index_in_header, index)| {
                    let block = UncompressedBlock::from_lines(&channels, index, |line| {
                        let position = line.location.position;
                        let first = position.y() * width + position.x();
                        let samples = &raster.channels[by_name[line.location.channel]].data[first..];
                        for (bytes, sample) in line.value.chunks_exact_mut(4).zip(samples) {
                            bytes.copy_from_slice(&match raster.encoding {
                                Encoding::Float => sample.to_ne_bytes(),
                                Encoding::Whole { .. } => (*sample as u32).to_ne_bytes(),
                            });
                        }
                    });
                    (index_in_header, block)
                });
            chunks.on_progress(|_| ()).compress_all_blocks_parallel(&meta, blocks)
        })
        .map_err(|error| match error {
            Error::Io(error) => error,
            error => invalid(error.to_string()),
        })?;
        order_header(out, long_names)
    })
}

fn all_attributes(raster: &Raster, attributes: &[(&str, String)]) -> io::Result<Vec<(String, String)>> {
    let join = |texts: Vec<String>| texts.join(", ");
    let mut all: Vec<(&str, String)> = attributes.to_vec();
    all.push(("channels", join(raster.channels.iter().map(|channel| channel.name.clone()).collect())));
    all.push(("units", join(raster.channels.iter().map(|channel| ascii(channel.unit).replace(',', " ")).collect())));
    let numbers = |of: Vec<Option<f64>>| {
        let given = of.iter().any(Option::is_some);
        given.then(|| join(of.into_iter().map(|value| value.unwrap_or(f64::NAN).to_string().to_lowercase()).collect()))
    };
    if let Some(centres) = numbers(raster.channels.iter().map(|channel| channel.centre_nm).collect()) {
        all.push(("wavelengths_nm", centres));
    }
    if let Some(widths) = numbers(raster.channels.iter().map(|channel| channel.fwhm_nm).collect()) {
        all.push(("fwhm_nm", widths));
    }
    named_attributes(&all)
}

fn header(raster: &Raster, by_name: &[usize], attributes: Vec<(String, String)>) -> io::Result<Header> {
    let text = |string: &str| Text::new_or_none(string).ok_or_else(|| invalid(format!("`{string}` is not Latin")));
    let channels = by_name
        .iter()
        .map(|idx| {
            let name = text(&raster.channels[*idx].name)?;
            // Compressors that lose may quantise as the eye sees unless told that samples are linear; ours loses nothing.
            let of = if raster.encoding == Encoding::Float { SampleType::F32 } else { SampleType::U32 };
            Ok(ChannelDescription::new(name, of, true))
        })
        .collect::<io::Result<_>>()?;
    let size = (raster.width as usize, raster.height as usize);
    let mut header = Header::new(text("radiance")?, size, channels).with_encoding(
        Compression::ZIP16,
        BlockDescription::ScanLines,
        LineOrder::Increasing,
    );
    header.own_attributes.layer_name = None; // a single part needs none
    for (name, value) in attributes {
        header.own_attributes.other.insert(text(&name)?, AttributeValue::Text(text(&value)?));
    }
    Ok(header)
}

/// Sorts the header's attributes by name, in place: the crate writes ours in the order of a hash map, which differs from
/// run to run. Sets the flag for long names, which the crate derives from attributes but not from channels.
fn order_header(out: &mut BufWriter<File>, long_names: bool) -> io::Result<()> {
    const LONG_NAMES: u8 = 0x04; // bit 10 of the version field, in its second byte
    out.flush()?;
    let end = out.seek(SeekFrom::End(0))?;
    let mut file = out.get_ref();
    file.seek(SeekFrom::Start(0))?;
    let mut start = [0; 8]; // magic number and version field
    file.read_exact(&mut start)?;
    if long_names {
        start[5] |= LONG_NAMES;
    }
    let mut attributes: Vec<Vec<u8>> = Vec::new();
    let mut read = io::BufReader::new(file);
    loop {
        let mut attribute = Vec::new();
        read_name(&mut read, &mut attribute)?;
        if attribute == [0] {
            break;
        }
        read_name(&mut read, &mut attribute)?; // its type
        let mut size = [0; 4];
        read.read_exact(&mut size)?;
        attribute.extend(size);
        let size = u64::from(u32::from_le_bytes(size));
        if read.by_ref().take(size).read_to_end(&mut attribute)? as u64 != size {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        attributes.push(attribute);
    }
    attributes.sort();
    file.seek(SeekFrom::Start(0))?;
    file.write_all(&start)?;
    file.write_all(&attributes.concat())?;
    file.seek(SeekFrom::Start(end))?;
    Ok(())
}

/// Appends bytes up to and including a null.
fn read_name(read: &mut impl io::BufRead, into: &mut Vec<u8>) -> io::Result<()> {
    read.read_until(0, into)?;
    if into.last() == Some(&0) { Ok(()) } else { Err(io::ErrorKind::UnexpectedEof.into()) }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use ::exr::prelude::{FlatSamples, ReadChannels, ReadLayers, read};

    use super::*;
    use crate::products::RasterChannel;

    type Channels = BTreeMap<String, Vec<f32>>;

    fn read_exr(path: &Path) -> ((usize, usize), Channels, BTreeMap<String, String>) {
        let image =
            read().no_deep_data().largest_resolution_level().all_channels().first_valid_layer().all_attributes();
        let image = image.from_file(path).unwrap();
        let layer = image.layer_data;
        let samples = |data| match data {
            FlatSamples::F32(samples) => samples,
            other => panic!("{other:?}"),
        };
        let channels = layer.channel_data.list;
        let channels = channels.into_iter().map(|c| (c.name.to_string(), samples(c.sample_data))).collect();
        let text = |(name, value): (Text, AttributeValue)| match value {
            AttributeValue::Text(value) => (name.to_string(), value.to_string()),
            other => panic!("{other:?}"),
        };
        ((layer.size.0, layer.size.1), channels, layer.attributes.other.into_iter().map(text).collect())
    }

    /// More than one block of 16 lines, samples of every kind of float, and names whose order in the file is another.
    #[test]
    fn every_bit_of_an_image_comes_back_under_its_name() {
        let (width, height) = (37, 41);
        let data: Vec<Vec<f32>> = (0..3)
            .map(|c| (0..width * height).map(|i| (f64::from(i) * 0.37 + f64::from(c)).sin().exp() as f32).collect())
            .collect();
        let mut odd = data[2].clone();
        odd[..6].copy_from_slice(&[f32::NAN, f32::INFINITY, -0.0, f32::MIN_POSITIVE, 1e-45, f32::MAX]);
        let long = "reflectance_factor_of_a_band_with_a_name_beyond_31_letters";
        let channel = |name: &str, centre_nm, data| RasterChannel {
            name: name.to_string(),
            unit: "W m⁻² sr⁻¹ µm⁻¹",
            centre_nm,
            fwhm_nm: None,
            data,
        };
        let channels = vec![
            channel("red", Some(675.0), &data[0][..]),
            channel("blue", Some(472.5), &data[1]),
            channel(long, None, &odd),
        ];
        let raster = Raster { width: width as u32, height: height as u32, channels, ..Raster::default() };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("radiance.exr");
        write_exr(&path, &raster, &[("time", "1992-06-18T16:00:00Z".into())]).unwrap();
        let (size, channels, attributes) = read_exr(&path);
        assert_eq!(size, (width as usize, height as usize));
        let bits = |samples: &[f32]| samples.iter().map(|sample| sample.to_bits()).collect::<Vec<_>>();
        for (name, data) in [("red", &data[0]), ("blue", &data[1]), (long, &odd)] {
            assert_eq!(bits(&channels[name]), bits(data), "{name}");
        }
        assert_eq!(attributes["sunglint:channels"], format!("red, blue, {long}"));
        assert_eq!(attributes["sunglint:units"], ["W m-2 sr-1 um-1"; 3].join(", "));
        assert_eq!(attributes["sunglint:wavelengths_nm"], "675, 472.5, nan");
        assert!(!attributes.contains_key("sunglint:fwhm_nm"));
        assert_eq!(attributes["sunglint:time"], "1992-06-18T16:00:00Z");
    }

    #[test]
    fn whole_numbers_are_stored_as_such() {
        let data = [0.0, 65_535.0, 16_777_215.0];
        let channel = RasterChannel { name: "red".into(), unit: "DN", centre_nm: None, fwhm_nm: None, data: &data };
        let raster = Raster { width: 3, height: 1, channels: vec![channel], encoding: Encoding::Whole { bits: 24 } };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("counts.exr");
        write_exr(&path, &raster, &[]).unwrap();
        let image =
            read().no_deep_data().largest_resolution_level().all_channels().first_valid_layer().all_attributes();
        let image = image.from_file(&path).unwrap();
        let FlatSamples::U32(samples) = &image.layer_data.channel_data.list[0].sample_data else { panic!("not whole") };
        assert_eq!(samples, &[0, 65_535, 16_777_215]);
    }

    /// The header is a hash map in the crate; a resumed run and a merged one must not differ by its whims.
    #[test]
    fn equal_input_gives_equal_bytes() {
        let data = vec![1.5; 64 * 64];
        let channel =
            RasterChannel { name: "nir".into(), unit: "1", centre_nm: Some(870.0), fwhm_nm: None, data: &data };
        let raster = Raster { width: 64, height: 64, channels: vec![channel], ..Raster::default() };
        let attributes: Vec<(&str, String)> =
            ["a", "b", "c", "d", "e", "f"].iter().map(|name| (*name, name.repeat(3))).collect();
        let folder = tempfile::tempdir().unwrap();
        let bytes: Vec<Vec<u8>> = (0..8)
            .map(|i| {
                let path = folder.path().join(format!("{i}.exr"));
                write_exr(&path, &raster, &attributes).unwrap();
                std::fs::read(path).unwrap()
            })
            .collect();
        assert!(bytes.windows(2).all(|pair| pair[0] == pair[1]));
    }

    #[test]
    fn a_refused_image_leaves_no_file() {
        let data = [1.0; 4];
        let channel =
            |name: &str| RasterChannel { name: name.into(), unit: "1", centre_nm: None, fwhm_nm: None, data: &data };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.exr");
        let raster = Raster { width: 3, height: 1, channels: vec![channel("a")], ..Raster::default() };
        assert!(write_exr(&path, &raster, &[]).is_err());
        let raster = Raster { width: 4, height: 1, channels: vec![channel("a"), channel("a")], ..Raster::default() };
        assert!(write_exr(&path, &raster, &[]).is_err());
        let raster = Raster { width: 4, height: 1, channels: vec![channel("a")], ..Raster::default() };
        assert!(write_exr(&path, &raster, &[("units", "mine".into())]).is_err());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
