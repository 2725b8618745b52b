//! GeoTIFF (OGC 19-008r4): one band with its place.

use super::{MOST_FAULTS, Raster, RasterError, RasterFault, RasterKind, RasterPlace, fits};
use glam::DVec2;
use std::io::Cursor;
use tiff::ColorType;
use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::tags::Tag;

pub(super) fn read(bytes: &[u8], kind: RasterKind) -> Result<Raster, RasterError> {
    let broken = |error: tiff::TiffError| RasterFault::new(format!("not a sound TIFF: {error}"));
    let mut limits = Limits::default();
    limits.decoding_buffer_size = 1 << 29;
    let mut decoder = Decoder::new(Cursor::new(bytes)).map_err(broken)?.with_limits(limits);
    let (width, height) = decoder.dimensions().map_err(broken)?;
    fits(u64::from(width), u64::from(height))?;
    match decoder.colortype().map_err(broken)? {
        ColorType::Gray(_) => {}
        other => {
            let fault = RasterFault::new(format!("a grid is one band of numbers; this TIFF holds {other:?}"));
            return Err(fault.help("write the band alone, for example with `gdal_translate -b 1`").into());
        }
    }
    let mut doubles = |tag| {
        let found = decoder.find_tag(tag).ok().flatten();
        found.and_then(|value| value.into_f64_vec().ok())
    };
    let (scale, tie) = (doubles(Tag::ModelPixelScaleTag), doubles(Tag::ModelTiepointTag));
    let transformation = doubles(Tag::ModelTransformationTag);
    let keys = decoder.find_tag(Tag::GeoKeyDirectoryTag).ok().flatten();
    let keys = keys.and_then(|value| value.into_u16_vec().ok()).unwrap_or_default();
    let hole = decoder.find_tag(Tag::GdalNodata).ok().flatten();
    let hole = hole.and_then(|value| value.into_string().ok());
    let hole: Option<f64> = hole.and_then(|text| text.trim_matches(['\0', ' ', '\n']).parse().ok());
    let place = place(scale.as_deref(), tie.as_deref(), transformation.as_deref(), &keys, height)?;
    let metres = match (key(&keys, VERTICAL_UNITS), kind) {
        (Some(code), RasterKind::Heights) => length_unit(code)
            .ok_or_else(|| RasterFault::new(format!("heights in the unit of EPSG code {code} are not understood")))?,
        _ => 1.0,
    };

    let image = decoder.read_image().map_err(broken)?;
    let single = hole.map(|hole| hole as f32);
    let mut values: Vec<f64> = match image {
        DecodingResult::F32(values) => {
            values.iter().map(|v| if Some(*v) == single { f64::NAN } else { f64::from(*v) }).collect()
        }
        DecodingResult::F64(values) => values,
        DecodingResult::F16(values) => values.iter().map(|v| v.to_f64()).collect(),
        DecodingResult::U8(values) => values.iter().map(|v| f64::from(*v)).collect(),
        DecodingResult::I8(values) => values.iter().map(|v| f64::from(*v)).collect(),
        DecodingResult::U16(values) => values.iter().map(|v| f64::from(*v)).collect(),
        DecodingResult::I16(values) => values.iter().map(|v| f64::from(*v)).collect(),
        DecodingResult::U32(values) => values.iter().map(|v| f64::from(*v)).collect(),
        DecodingResult::I32(values) => values.iter().map(|v| f64::from(*v)).collect(),
        DecodingResult::U64(values) => values.iter().map(|v| *v as f64).collect(),
        DecodingResult::I64(values) => values.iter().map(|v| *v as f64).collect(),
    };
    let (columns, rows) = (width as usize, height as usize);
    if values.len() != columns * rows {
        let message = format!("the TIFF holds {} values for {columns} x {rows} posts", values.len());
        return Err(RasterFault::new(message).into());
    }
    let mut faults = Vec::new();
    for (i, value) in values.iter_mut().enumerate() {
        if Some(*value) == hole {
            *value = f64::NAN;
        }
        if value.is_nan() {
            continue;
        }
        *value *= metres;
        if let Some(message) = kind.refuse(*value) {
            let message = format!("row {}, column {}: {message}", i / columns + 1, i % columns + 1);
            faults.push(RasterFault::new(message).help("GDAL_NODATA names the value of no data"));
            if faults.len() == MOST_FAULTS {
                break;
            }
        }
    }
    if !faults.is_empty() {
        return Err(RasterError::Malformed(faults));
    }
    Ok(Raster { columns, rows, values, place })
}

const MODEL_TYPE: u16 = 1024;
const RASTER_TYPE: u16 = 1025;
const PROJECTED_UNITS: u16 = 3076;
const VERTICAL_UNITS: u16 = 4099;
const GEOGRAPHIC: u16 = 2;
const GEOCENTRIC: u16 = 3;
const PIXEL_IS_POINT: u16 = 2;

/// A GeoKey whose value stands in the directory itself.
fn key(keys: &[u16], wanted: u16) -> Option<u16> {
    keys.get(4..)?.chunks_exact(4).find(|entry| entry[0] == wanted && entry[1] == 0).map(|entry| entry[3])
}

/// Metres of an EPSG unit of length: metre, international and US survey foot.
fn length_unit(code: u16) -> Option<f64> {
    match code {
        9001 => Some(1.0),
        9002 => Some(0.3048),
        9003 => Some(1200.0 / 3937.0),
        _ => None,
    }
}

/// Where the posts stand; `None` where the file says nothing, or says degrees.
fn place(
    scale: Option<&[f64]>,
    tie: Option<&[f64]>,
    transformation: Option<&[f64]>,
    keys: &[u16],
    height: u32,
) -> Result<Option<RasterPlace>, RasterFault> {
    if matches!(key(keys, MODEL_TYPE), Some(GEOGRAPHIC | GEOCENTRIC)) {
        return Ok(None);
    }
    let metres = match key(keys, PROJECTED_UNITS) {
        Some(code) => length_unit(code).ok_or_else(|| {
            RasterFault::new(format!("coordinates in the unit of EPSG code {code} are not understood"))
        })?,
        None => 1.0,
    };
    // The model's place of the raster's (0, 0), and its steps; y falls with the rows.
    let (zero, step) = match (scale, tie, transformation) {
        (Some([sx, sy, ..]), Some([i, j, _, x, y, ..]), _) => {
            (DVec2::new(x - i * sx, y + j * sy), DVec2::new(*sx, *sy))
        }
        (_, _, Some([a, b, _, d, e, f, _, h, ..])) => {
            if *b != 0.0 || *e != 0.0 {
                return Err(RasterFault::new("the grid is turned against north")
                    .help("warp it to rows that run from west to east"));
            }
            (DVec2::new(*d, *h), DVec2::new(*a, -f))
        }
        _ => return Ok(None),
    };
    if !(step.x > 0.0 && step.y > 0.0 && step.is_finite() && zero.is_finite() && zero.abs().max_element() <= 1e9) {
        let message = format!("steps of {} and {} from ({} {}) make no grid", step.x, step.y, zero.x, zero.y);
        return Err(RasterFault::new(message));
    }
    // Areas are counted from their corner, points from the middle.
    let middle = if key(keys, RASTER_TYPE) == Some(PIXEL_IS_POINT) { 0.0 } else { 0.5 };
    let south_west = DVec2::new(zero.x + middle * step.x, zero.y - (f64::from(height - 1) + middle) * step.y) * metres;
    Ok(Some(RasterPlace { south_west, spacing: step * metres }))
}
