//! OpenEXR files, ours and others'.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Seek, SeekFrom};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use ::exr::block::{self, UncompressedBlock, reader::ChunksReader};
use ::exr::error::Error;
use ::exr::meta::attribute::{AttributeValue, SampleType};
use ::exr::meta::header::Header;
use ::exr::prelude::f16;

use super::{Image, ImageBand, ReadError, Samples, wavelength_in_name, weigh};

pub const MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];

/// No compression of the format shrinks samples by more than this; a file that claims it holds no image.
const MOST_COMPRESSION: u64 = 4096;

pub fn read(path: &Path, mut file: File, bytes: u64) -> Result<Image, ReadError> {
    file.seek(SeekFrom::Start(0)).map_err(|error| ReadError::io(path, error))?;
    // The library answers broken files with errors; should one make it panic, that is an error too.
    catch_unwind(AssertUnwindSafe(|| read_blocks(path, file, bytes)))
        .unwrap_or_else(|_| Err(ReadError::format(path, None, "the OpenEXR file is broken")))
}

fn refuse(path: &Path) -> impl Fn(Error) -> ReadError + '_ {
    move |error| match error {
        Error::Io(error) => ReadError::io(path, error),
        // So the library tells of an early end of the file.
        Error::Invalid(message) if message == "reference to missing bytes" => {
            ReadError::format(path, None, "the OpenEXR file ends early")
        }
        error => ReadError::format(path, None, format!("OpenEXR: {error}")),
    }
}

fn read_blocks(path: &Path, file: File, bytes: u64) -> Result<Image, ReadError> {
    let refuse = refuse(path);
    let reader = block::read(BufReader::new(file), false).map_err(&refuse)?;
    let headers: Vec<Header> = reader.headers().to_vec();
    let size = headers.first().map_or((0, 0), |header| (header.layer_size.0, header.layer_size.1));
    check(path, &headers, size, bytes)?;
    let n = size.0 * size.1;
    // By part and channel; a block that the file lacks leaves NaN.
    let mut images: Vec<Vec<Samples>> = (headers.iter())
        .map(|header| header.channels.list.iter().map(|channel| blank(channel.sample_type, n)).collect())
        .collect();
    let chunks = reader.all_chunks(false).map_err(&refuse)?;
    let inserted = chunks.decompress_sequential(false, |meta, block| {
        insert(&meta.headers[block.index.layer], &block, &mut images[block.index.layer], size)
    });
    inserted.map_err(&refuse)?;
    Ok(image(&headers, images, size))
}

fn check(path: &Path, headers: &[Header], size: (usize, usize), bytes: u64) -> Result<(), ReadError> {
    let fail = |message: String| Err(ReadError::format(path, None, message));
    let mut channels = 0;
    for header in headers {
        let own = (header.layer_size.0, header.layer_size.1);
        if header.deep {
            return fail("deep samples are not read; flatten the image".into());
        }
        if own != size {
            return fail(format!("its parts differ in size: {} x {} and {} x {}", size.0, size.1, own.0, own.1));
        }
        if let Some(channel) = header.channels.list.iter().find(|channel| channel.sampling.0 * channel.sampling.1 != 1)
        {
            return fail(format!("channel `{}` is subsampled, which is not read", channel.name));
        }
        channels += header.channels.list.len() as u64;
    }
    let weight = weigh(path, size.0 as u64, size.1 as u64, channels, 8)?;
    if weight / 4 > MOST_COMPRESSION.saturating_mul(bytes) {
        return fail(format!("{bytes} bytes cannot hold {} x {} pixels in {channels} channels", size.0, size.1));
    }
    Ok(())
}

fn blank(sample_type: SampleType, n: usize) -> Samples {
    match sample_type {
        SampleType::F16 | SampleType::F32 => Samples::F32(vec![f32::NAN; n]),
        SampleType::U32 => Samples::F64(vec![f64::NAN; n]),
    }
}

fn insert(
    header: &Header,
    block: &UncompressedBlock,
    images: &mut [Samples],
    size: (usize, usize),
) -> Result<(), Error> {
    if (block.index.level.0, block.index.level.1) != (0, 0) {
        return Ok(());
    }
    let area = block.index.pixel_size.0 * block.index.pixel_size.1;
    if block.data.len() != area * header.channels.bytes_per_pixel {
        return Err(Error::Invalid("block size".into()));
    }
    for line in block.lines(&header.channels) {
        let at = line.location;
        let (x, y) = (at.position.0, at.position.1);
        if x + at.sample_count > size.0 || y >= size.1 {
            return Err(Error::Invalid("block position".into()));
        }
        let to = y * size.0 + x..y * size.0 + x + at.sample_count;
        let four = || line.value.chunks_exact(4).map(|b| [b[0], b[1], b[2], b[3]]);
        match (&mut images[at.channel], header.channels.list[at.channel].sample_type) {
            (Samples::F32(image), SampleType::F32) => {
                image[to].iter_mut().zip(four()).for_each(|(to, bytes)| *to = f32::from_ne_bytes(bytes));
            }
            (Samples::F32(image), _) => {
                let halves = line.value.chunks_exact(2).map(|b| f16::from_ne_bytes([b[0], b[1]]).to_f32());
                image[to].iter_mut().zip(halves).for_each(|(to, value)| *to = value);
            }
            (Samples::F64(image), _) => {
                image[to].iter_mut().zip(four()).for_each(|(to, bytes)| *to = f64::from(u32::from_ne_bytes(bytes)));
            }
        }
    }
    Ok(())
}

/// Names, order and units: those that our attributes state, else those of the file.
fn image(headers: &[Header], images: Vec<Vec<Samples>>, size: (usize, usize)) -> Image {
    let mut attributes = BTreeMap::new();
    for header in headers {
        for (name, value) in &header.own_attributes.other {
            if let AttributeValue::Text(text) = value {
                attributes.insert(name.to_string(), text.to_string());
            }
        }
    }
    let mut bands: Vec<ImageBand> = Vec::new();
    for (header, images) in headers.iter().zip(images) {
        let part = header.own_attributes.layer_name.as_ref().filter(|_| headers.len() > 1);
        for (channel, samples) in header.channels.list.iter().zip(images) {
            let name = part.map_or_else(|| channel.name.to_string(), |part| format!("{part}.{}", channel.name));
            let wavelength_um = wavelength_in_name(&name);
            bands.push(ImageBand { name, wavelength_um, fwhm_um: None, unit: None, samples });
        }
    }
    let mut image = Image { width: size.0 as u32, height: size.1 as u32, bands, attributes, notes: Vec::new() };
    let list = |name: &str| -> Vec<String> {
        let text = image.own_attribute(name).unwrap_or_default();
        text.split(", ").map(|item| item.trim().to_string()).collect()
    };
    let names = list("channels");
    if names.len() == image.bands.len() && names.iter().all(|name| image.band(name).is_some()) {
        let (units, centres, widths) = (list("units"), list("wavelengths_nm"), list("fwhm_nm"));
        let um = |list: &[String], i: usize| -> Option<f64> {
            let nm: f64 = list.get(i)?.parse().ok()?;
            nm.is_finite().then_some(nm * 1e-3)
        };
        image.bands.sort_by_key(|band| names.iter().position(|name| *name == band.name));
        for (i, band) in image.bands.iter_mut().enumerate() {
            band.unit = units.get(i).filter(|unit| !unit.is_empty()).cloned();
            band.wavelength_um = um(&centres, i);
            band.fwhm_um = um(&widths, i);
        }
    }
    image
}
