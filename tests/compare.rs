//! Images read back and held against each other.

mod program;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use program::{stderr, sunglint, text};
use serde_json::Value;
use sunglint::{
    Beside, CompareError, Image, ImageBand, Materials, Options, PairedBy, Plan, Samples, compare_images, read_image,
};

fn band(name: &str, wavelength_um: Option<f64>, samples: Vec<f64>) -> ImageBand {
    ImageBand { name: name.into(), wavelength_um, fwhm_um: None, unit: None, samples: Samples::F64(samples) }
}

fn image(width: u32, bands: Vec<ImageBand>) -> Image {
    let height = bands[0].samples.len() as u32 / width;
    Image { width, height, bands, attributes: BTreeMap::new(), notes: Vec::new() }
}

fn grey(width: u32, samples: Vec<f64>) -> Image {
    image(width, vec![band("red", None, samples)])
}

/// Numbers without a pattern, of [0, 1).
fn noise(n: usize, seed: u64) -> Vec<f64> {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    (0..n)
        .map(|_| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 * 2f64.powi(-53)
        })
        .collect()
}

fn only(a: &Image, b: &Image, beside: Beside<'_>) -> sunglint::BandComparison {
    compare_images(a, b, beside, &[]).expect("they compare").bands.remove(0)
}

/// B = 1.25 A − 3 exactly: the regression returns both numbers with R² = 1; bias and RMSE follow from the moments of A:
/// bias = 0.25 Ā − 3, RMSE² = bias² + 0.0625 var A.
#[test]
fn a_line_gives_its_slope_and_offset() {
    let a: Vec<f64> = noise(1200, 1).iter().map(|u| 20.0 + 60.0 * u).collect();
    let b: Vec<f64> = a.iter().map(|a| 1.25 * a - 3.0).collect();
    let mean = a.iter().sum::<f64>() / 1200.0;
    let variance = a.iter().map(|a| (a - mean).powi(2)).sum::<f64>() / 1200.0;
    let (a, b) = (grey(40, a), grey(40, b));
    let of = only(&a, &b, Beside::default()).statistics;
    let bias = 0.25 * mean - 3.0;
    for (found, expected) in [
        (of.slope, 1.25),
        (of.offset, -3.0),
        (of.r_squared, 1.0),
        (Some(of.bias), bias),
        (Some(of.rmse), (bias * bias + 0.0625 * variance).sqrt()),
        (of.relative_bias(), bias / mean),
    ] {
        let found = found.expect("A varies");
        assert!((found - expected).abs() < 1e-9 * expected.abs().max(1.0), "{found} {expected}");
    }
    assert_eq!((of.n, of.excluded), (1200, 0));
}

/// 1000 differences of 0, 0.001, … 0.999: 99 % of them are at most 0.989, the largest is the last pixel's.
#[test]
fn the_percentile_and_the_worst_pixel_are_those_of_the_ranks() {
    let a = vec![1.0; 1000];
    let b: Vec<f64> = (0..1000).map(|i| 1.0 - f64::from(i) * 1e-3).collect();
    let of = only(&grey(50, a), &grey(50, b), Beside::default()).statistics;
    assert!((of.p99 - 0.989).abs() < 1e-7, "{}", of.p99); // kept as f32
    let worst = of.worst.expect("there are pixels");
    assert_eq!((worst.x, worst.y, worst.a), (49, 19, 1.0));
    assert!(of.slope.is_none() && of.r_squared.is_none(), "A does not vary");
}

/// Two materials of 6 and 4 pixels; one is brighter by 1 in B, the other has a pixel that is no number in A and one in both.
#[test]
fn materials_are_told_apart_and_missing_numbers_counted() {
    let codes = [2.0, 2.0, 2.0, 2.0, 2.0, 2.0, 7.0, 7.0, 7.0, 7.0];
    let mut truth = image(5, vec![band("material_code", None, codes.to_vec()), band("x", None, vec![0.0; 10])]);
    truth.attributes.insert("sunglint:materials".into(), "2 blacktop; 7 grey".into());
    let materials = Materials::of(&truth).expect("a truth map");
    let (mut a, mut b) = (vec![10.0; 10], vec![11.0; 6]);
    b.extend([10.0; 4]);
    a[8] = f64::NAN;
    a[9] = f64::NAN;
    b[9] = f64::INFINITY;
    let band = only(&grey(5, a), &grey(5, b), Beside { materials: Some(&materials), ..Beside::default() });
    let names: Vec<&str> = band.materials.iter().map(|of| of.name.as_str()).collect();
    assert_eq!(names, ["blacktop", "grey"]);
    let (blacktop, grey) = (&band.materials[0].statistics, &band.materials[1].statistics);
    assert_eq!((blacktop.n, blacktop.bias, blacktop.rmse), (6, 1.0, 1.0));
    assert_eq!((grey.n, grey.excluded, grey.excluded_in_one, grey.rmse), (2, 2, 1, 0.0));
    assert_eq!((band.statistics.n, band.statistics.bias), (8, 0.75));
    assert!(blacktop.exceeds(0.09) && !blacktop.exceeds(0.11));
    assert!(grey.exceeds(0.5), "a number on one side only is a difference");
}

/// Normal noise of σ_A = 0.3 and σ_B = 0.4 (sums of 12 uniforms): |B − A| ≤ 2 √(σ_A² + σ_B²) in 95.4 % of pixels and χ² is 1,
/// each within 4 standard errors at 20 000 pixels (0.6 %, and √(2/n) = 1 % for χ²).
#[test]
fn noise_alone_stays_within_two_standard_errors_in_95_percent() {
    let n = 20_000;
    let normal = |sigma: f64, seed: u64| -> Vec<f64> {
        noise(12 * n, seed).chunks(12).map(|u| 50.0 + sigma * (u.iter().sum::<f64>() - 6.0)).collect()
    };
    let (a, b) = (grey(200, normal(0.3, 3)), grey(200, normal(0.4, 4)));
    let (of_a, of_b) = (grey(200, vec![0.3; n]), grey(200, vec![0.4; n]));
    let beside = Beside { error_a: Some(&of_a), error_b: Some(&of_b), materials: None };
    let of = only(&a, &b, beside).statistics;
    let (within, chi_square) = (of.within_two_sigma.expect("known"), of.chi_square.expect("known"));
    assert!((within - 0.954).abs() < 0.006, "{within}");
    assert!((chi_square - 1.0).abs() < 0.04, "{chi_square}");
}

#[test]
fn bands_pair_by_name_then_by_wavelength_then_by_order() {
    let bands =
        |list: &[(&str, Option<f64>)]| image(1, list.iter().map(|(name, um)| band(name, *um, vec![1.0])).collect());
    let pair = |a: &Image, b: &Image| compare_images(a, b, Beside::default(), &[]).map(|found| found.pairing);
    let ours = bands(&[("red", Some(0.66)), ("nir", Some(0.86))]);
    let named = pair(&ours, &bands(&[("swir", None), ("NIR", None)])).expect("a name is shared");
    assert_eq!((named.by, named.pairs), (PairedBy::Name, vec![(1, 1)]));
    assert_eq!(named.single, (vec!["red".to_string()], vec!["swir".to_string()]));
    let near = pair(&ours, &bands(&[("B8", Some(0.865)), ("B4", Some(0.665)), ("B2", Some(0.49))])).expect("near");
    assert_eq!((near.by, near.pairs), (PairedBy::Wavelength, vec![(0, 1), (1, 0)]));
    let order = pair(&ours, &bands(&[("R", None), ("G", None)])).expect("as many");
    assert_eq!((order.by, order.pairs), (PairedBy::Order, vec![(0, 0), (1, 1)]));
    assert!(pair(&ours, &bands(&[("R", None)])).is_err());
    assert!(pair(&ours, &bands(&[("B1", Some(0.44))])).is_err(), "220 nm is not near");
    let wrong = compare_images(&ours, &ours, Beside::default(), &["rde".to_string()]);
    assert!(wrong.is_err_and(|error| error.to_string().contains("`red`?")));
    let large = grey(2, vec![1.0; 4]);
    assert!(matches!(pair(&large, &grey(1, vec![1.0])), Err(CompareError::Size { .. })));
}

// ---- files

/// Writes an ENVI image as another program would, from values that every type holds.
struct Envi {
    kind: u8,
    interleave: &'static str,
    big: bool,
    offset: usize,
}

const VALUES: [u8; 24] =
    [0, 1, 2, 3, 4, 5, 60, 70, 80, 90, 100, 101, 102, 103, 104, 105, 106, 107, 108, 109, 110, 120, 126, 127];

impl Envi {
    /// 4 x 3 pixels, 2 bands: band b holds `VALUES[12 b ..]`, row by row.
    fn write(&self, path: &Path, more: &str) {
        let sample = |value: u8| -> Vec<u8> {
            let value = f64::from(value);
            let little = match self.kind {
                1 => vec![value as u8],
                2 => (value as i16).to_le_bytes().to_vec(),
                3 => (value as i32).to_le_bytes().to_vec(),
                4 => (value as f32).to_le_bytes().to_vec(),
                5 => value.to_le_bytes().to_vec(),
                12 => (value as u16).to_le_bytes().to_vec(),
                _ => (value as u32).to_le_bytes().to_vec(),
            };
            if self.big { little.into_iter().rev().collect() } else { little }
        };
        let at = |b: usize, y: usize, x: usize| sample(VALUES[12 * b + 4 * y + x]);
        let mut bytes = vec![0xaa; self.offset];
        let each = |n: usize| 0..n;
        match self.interleave {
            "bsq" => each(2).for_each(|b| each(3).for_each(|y| each(4).for_each(|x| bytes.extend(at(b, y, x))))),
            "bil" => each(3).for_each(|y| each(2).for_each(|b| each(4).for_each(|x| bytes.extend(at(b, y, x))))),
            _ => each(3).for_each(|y| each(4).for_each(|x| each(2).for_each(|b| bytes.extend(at(b, y, x))))),
        }
        std::fs::write(path, bytes).expect("a file");
        let header = format!(
            "ENVI\n; made by another program\nsamples   = 4\nLines = 3\nbands = 2\nheader offset = {}\n\
             file type = ENVI Standard\ndata type = {}\nInterleave = {}\nbyte order = {}\n{more}",
            self.offset,
            self.kind,
            self.interleave.to_uppercase(),
            u8::from(self.big)
        );
        std::fs::write(path.with_extension("hdr"), header).expect("a header");
    }
}

#[test]
fn envi_of_every_type_interleave_and_byte_order_reads_alike() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("cube.dat");
    for kind in [1, 2, 3, 4, 5, 12, 13] {
        for interleave in ["bsq", "bil", "bip"] {
            for (big, offset) in [(false, 0), (true, 0), (false, 7), (true, 512)] {
                Envi { kind, interleave, big, offset }.write(&path, "");
                for place in [path.clone(), path.with_extension("hdr")] {
                    let image = read_image(&place).unwrap_or_else(|error| panic!("{error}"));
                    assert_eq!((image.width, image.height, image.bands.len()), (4, 3, 2));
                    let values: Vec<f64> = image.bands.iter().flat_map(|band| band.samples.iter()).collect();
                    assert_eq!(values, VALUES.map(f64::from), "type {kind}, {interleave}, big {big}, offset {offset}");
                }
            }
        }
    }
}

#[test]
fn an_envi_header_names_bands_wavelengths_places_and_missing_values() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("cube.img");
    let more = "band names = {red edge,\n  nir}\nwavelength units = Micrometers\nwavelength = {0.705, 0.865}\nfwhm = {0.015,\n0.02}\n\
                data ignore value = 3\nmap info = {UTM, 1, 1, 290000, 4770000, 10, 10, 18, North, WGS-84}\n\
                data gain values = {2, 0.5}\ndata offset values = {1, 0}\n";
    Envi { kind: 2, interleave: "bip", big: true, offset: 0 }.write(&path, more);
    let image = read_image(&path).unwrap_or_else(|error| panic!("{error}"));
    let names: Vec<&str> = image.bands.iter().map(|band| band.name.as_str()).collect();
    assert_eq!(names, ["red edge", "nir"]);
    assert_eq!((image.bands[1].wavelength_um, image.bands[0].fwhm_um), (Some(0.865), Some(0.015)));
    assert!(image.attributes["map info"].starts_with("UTM, 1, 1, 290000"));
    assert!(image.bands[0].samples.get(3).is_nan(), "3 is declared no value");
    assert_eq!((image.bands[0].samples.get(2), image.bands[1].samples.get(0)), (5.0, 51.0)); // 2·2 + 1, 102/2
}

#[test]
fn a_faulty_envi_header_is_told_with_its_line() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("x.img");
    std::fs::write(&path, [0; 96]).expect("a file");
    let full = "ENVI\nsamples = 4\nlines = 3\nbands = 2\ndata type = 4\ninterleave = bsq\nbyte order = 0\n";
    for (from, to, told) in [
        ("", "", None),
        ("samples = 4\n", "", Some("x.hdr:6: the header ends without `samples`")),
        ("lines = 3", "lines = three", Some("x.hdr:3: `lines = three`: no whole number")),
        ("bands = 2", "bands = 0", Some("x.hdr:4: `bands = 0`: at least one is needed")),
        ("data type = 4", "data type = 6", Some("x.hdr:5: `data type = 6`: 1, 2, 3, 4, 5, 12 and 13 are read")),
        ("= bsq", "= bsp", Some("x.hdr:6: `interleave = bsp`: write bsq, bil or bip")),
        ("byte order = 0", "byte order = 2", Some("x.hdr:7: `byte order = 2`")),
        ("byte order = 0", "band names = {a, b", Some("x.hdr:7: the brace of `band names` is not closed")),
        ("byte order = 0", "band names = {a, b, c}", Some("x.hdr:7: `band names = a, b, c`: 3 entries for 2 bands")),
        ("byte order = 0", "bands = 3", Some("x.hdr:7: `bands` stands already in line 4")),
        ("byte order = 0", "what is this", Some("x.hdr:7: a line of a header is `key = value`")),
        ("ENVI", "ENV1", Some("x.hdr:1: an ENVI header begins with the line `ENVI`")),
        ("samples = 4", "samples = 5", Some("x.img: 96 bytes;")),
        ("samples = 4", "samples = 4294967295", Some("take more than the 4 GiB")),
        ("bands = 2", "bands = 999999999", Some("at most 65536 bands")),
        ("byte order = 0", "header offset = 18446744073709551615", Some("x.img: 96 bytes;")),
    ] {
        std::fs::write(path.with_extension("hdr"), full.replace(from, to)).expect("a header");
        let found = read_image(&path).map_err(|error| error.to_string());
        match (found, told) {
            (Ok(_), None) => {}
            (Err(message), Some(told)) => assert!(message.contains(told), "{message}"),
            (found, told) => panic!("{found:?} {told:?}"),
        }
    }
    let missing = read_image(&folder.path().join("y.img")).map_err(|error| error.to_string());
    assert!(missing.is_err_and(|message| message.contains("there is no file") && message.contains("`x.img`?")));
}

/// Our own products, read back: names, order, wavelengths, units, bits; the ENVI and the OpenEXR file say the same.
#[test]
fn products_come_back_as_they_were_rendered() {
    let folder = tempfile::tempdir().expect("a folder");
    let options = Options { pixels: Some((40, 36)), samples: Some(16), ..Options::default() };
    let mut options_day = options;
    ["experiment=split", "time=1992-06-18T170100Z"].iter().for_each(|only| options_day.narrow(only).expect("valid"));
    let checked = sunglint::open("examples/truth/truth.glint").unwrap_or_else(|refused| panic!("{refused}"));
    let plan = Plan::new(checked, &options_day).unwrap_or_else(|refused| panic!("{refused}"));
    let frames = plan.runs()[0].render();
    sunglint::render(&plan, folder.path(), &Silent).expect("it renders");
    let frame = folder.path().join("split/roof/1992-06-18T170100Z");
    let exr = read_image(&frame.join("radiance.exr")).unwrap_or_else(|error| panic!("{error}"));
    let envi = read_image(&frame.join("radiance.img")).unwrap_or_else(|error| panic!("{error}"));
    for image in [&exr, &envi] {
        let names: Vec<&str> = image.bands.iter().map(|band| band.name.as_str()).collect();
        assert_eq!(names, ["blue", "green", "red", "nir"]);
        for (band, (channel, radiance)) in
            image.bands.iter().zip(frames.channels.iter().zip(&frames.frames[0].radiance))
        {
            assert_eq!(band.samples, Samples::F32(radiance.clone()));
            assert!((band.wavelength_um.expect("stated") - channel.centre.um()).abs() < 1e-9);
            assert_eq!(band.unit.as_deref(), Some("W m-2 sr-1 um-1"));
        }
    }
    let comparison = compare_images(&exr, &envi, Beside::default(), &[]).expect("they compare");
    assert!(comparison.bands.iter().all(|band| !band.exceeds(0.0) && band.statistics.r_squared == Some(1.0)));
    let truth = read_image(&folder.path().join("split/roof/truth.exr")).unwrap_or_else(|error| panic!("{error}"));
    let materials = Materials::of(&truth).expect("a truth map");
    assert_eq!(
        (materials.name(1), materials.name(2), materials.name(16)),
        ("lawn".into(), "blacktop".into(), "grey_95".into())
    );
}

struct Silent;

impl sunglint::Progress for Silent {
    fn begin(&self, _: &[&sunglint::Run], _: usize) {}
    fn tile(&self, _: bool, _: &sunglint::Tally) {}
    fn end(&self, _: &sunglint::Run, _: &sunglint::Rendered) {}
}

/// Tiles, three types of samples, names of two conventions, and a window that does not begin at 0.
fn foreign_exr(path: &Path, blocks: exr::image::Blocks, compression: exr::prelude::Compression) -> [Vec<f64>; 3] {
    use exr::prelude::*;
    let (width, height) = (37_usize, 29_usize);
    let values: Vec<f64> = (0..width * height).map(|i| i as f64).collect();
    let halves: Vec<f16> = values.iter().map(|v| f16::from_f64(v / 2.0)).collect();
    let floats: Vec<f32> = values.iter().map(|v| (v * 0.1) as f32).collect();
    let counts: Vec<u32> = values.iter().map(|v| *v as u32 * 4_000_000).collect();
    let expected = [
        halves.iter().map(|v| v.to_f64()).collect(),
        floats.iter().map(|v| f64::from(*v)).collect(),
        counts.iter().map(|v| f64::from(*v)).collect(),
    ];
    let channels = AnyChannels::sort(SmallVec::from_vec(vec![
        AnyChannel::new("R", FlatSamples::F16(halves)),
        AnyChannel::new("S0.555,5nm", FlatSamples::F32(floats)),
        AnyChannel::new("id", FlatSamples::U32(counts)),
    ]));
    let encoding = Encoding { compression, blocks, line_order: LineOrder::Increasing };
    let mut layer = Layer::new((width, height), LayerAttributes::named("beauty"), encoding, channels);
    layer.attributes.layer_position = Vec2(5, -3);
    Image::from_layer(layer).write().to_file(path).expect("it writes");
    expected
}

#[test]
fn foreign_openexr_reads_by_tiles_and_lines_and_in_every_type() {
    use exr::image::Blocks;
    use exr::prelude::{Compression, Vec2};
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("foreign.exr");
    for (blocks, compression) in [
        (Blocks::ScanLines, Compression::Uncompressed),
        (Blocks::ScanLines, Compression::PIZ),
        (Blocks::Tiles(Vec2(16, 8)), Compression::ZIP1),
        (Blocks::Tiles(Vec2(64, 64)), Compression::RLE),
    ] {
        let [halves, floats, counts] = foreign_exr(&path, blocks, compression);
        let image = read_image(&path).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!((image.width, image.height), (37, 29));
        let values = |name: &str| image.band(name).expect(name).samples.iter().collect::<Vec<f64>>();
        assert_eq!((values("R"), values("S0.555,5nm"), values("id")), (halves, floats, counts));
        assert_eq!(image.band("S0.555,5nm").and_then(|band| band.wavelength_um), Some(0.5555));
    }
}

/// Cut short anywhere, or with bytes overturned: an error or an image, never a panic, and no more memory than the file earns.
#[test]
fn broken_files_are_refused() {
    use exr::image::Blocks;
    use exr::prelude::{Compression, Vec2};
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("broken.exr");
    for (blocks, compression) in [
        (Blocks::ScanLines, Compression::ZIP16),
        (Blocks::ScanLines, Compression::PIZ),
        (Blocks::Tiles(Vec2(16, 8)), Compression::RLE),
    ] {
        foreign_exr(&path, blocks, compression);
        let whole = std::fs::read(&path).expect("a file");
        for length in (0..whole.len()).step_by(1 + whole.len() / 150) {
            std::fs::write(&path, &whole[..length]).expect("a file");
            assert!(read_image(&path).is_err(), "{length} of {} bytes", whole.len());
        }
        for (i, u) in noise(600, 5).chunks(3).enumerate() {
            let mut bytes = whole.clone();
            // Half of the faults fall into the header.
            let reach = if i % 2 == 0 { 400.min(whole.len()) } else { whole.len() };
            bytes[(u[0] * reach as f64) as usize] = (u[1] * 256.0) as u8;
            bytes[(u[2] * reach as f64) as usize] ^= 0x80;
            std::fs::write(&path, &bytes).expect("a file");
            let _ = read_image(&path);
        }
    }
    std::fs::write(&path, b"").expect("a file");
    assert!(read_image(&path).is_err() && read_image(folder.path()).is_err());
}

// ---- the command

/// A scene whose panel has another reflectance, rendered into folders of one layout.
fn two_renders(folder: &Path) -> [PathBuf; 2] {
    ["0.18", "0.27"].map(|reflectance| {
        let scene = std::fs::read_to_string("examples/minimal/minimal.glint").expect("the example");
        let path = folder.join(format!("{reflectance}.glint"));
        std::fs::write(&path, scene.replace("diffuse 0.18", &format!("diffuse {reflectance}"))).expect("a scene");
        let out = folder.join(format!("out_{reflectance}"));
        let output = sunglint(&["render", text(&path), "-o", text(&out), "--pixels", "64x48"]);
        assert!(output.status.success(), "{}", stderr(&output));
        out
    })
}

#[test]
fn whole_outputs_compare_by_path_with_their_truth_and_errors() {
    let folder = tempfile::tempdir().expect("a folder");
    let [a, b] = two_renders(folder.path());
    let (csv, scatter, difference) =
        (folder.path().join("table.csv"), folder.path().join("s.svg"), folder.path().join("d.png"));
    let output = sunglint(&[
        "compare",
        text(&a),
        text(&b),
        "--json",
        "--tolerance",
        "1%",
        "--csv",
        text(&csv),
        "--scatter",
        text(&scatter),
        "--difference",
        text(&difference),
    ]);
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    let found: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!((found["within_tolerance"].as_bool(), found["images"].as_array().map(Vec::len)), (Some(false), Some(1)));
    let image = &found["images"][0];
    assert_eq!(image["image"], "default/roof/1992-06-18T160000Z/radiance");
    assert_eq!(image["paired_by"], "name");
    let materials = image["bands"][0]["materials"].as_array().expect("materials");
    let of = |name: &str| &materials.iter().find(|of| of["name"] == name).expect(name)["statistics"];
    // At the surface the panel is 1.5 times as bright; the path adds the same to both, and its edges mix.
    let grey = of("grey")["relative_bias"].as_f64().expect("a number");
    assert!((0.3..0.5).contains(&grey), "{grey}");
    assert!(of("blacktop")["relative_rmse"].as_f64().is_some_and(|rmse| rmse < 0.2));
    assert!(of("grey")["within_two_sigma"].as_f64().is_some_and(|within| within < 0.3), "the errors were found");
    let rows = std::fs::read_to_string(&csv).expect("a table");
    assert_eq!(rows.lines().count(), 1 + 1 + materials.len());
    assert!(
        rows.lines()
            .nth(1)
            .is_some_and(|line| line.starts_with("default/roof/1992-06-18T160000Z/radiance,red,red,W m-2"))
    );
    assert!(std::fs::read_to_string(&scatter).expect("a plot").contains("R²"));
    assert!(std::fs::read(&difference).expect("a picture").starts_with(b"\x89PNG"));
    let same = sunglint(&["compare", text(&a), text(&a), "--tolerance", "0%"]);
    assert_eq!(same.status.code(), Some(0), "{}", stderr(&same));
    let told = sunglint(&["compare", text(&a), text(&b)]);
    assert_eq!(told.status.code(), Some(0), "no tolerance was given");
    let told = String::from_utf8_lossy(&told.stdout).into_owned();
    for word in ["bands paired by name", "grey", "blacktop", "slope", "RMSE", "materials from"] {
        assert!(told.contains(word), "{word}: {told}");
    }
}

#[test]
fn what_does_not_compare_exits_with_2_and_says_why() {
    let folder = tempfile::tempdir().expect("a folder");
    let (small, large) = (folder.path().join("small.img"), folder.path().join("large.img"));
    Envi { kind: 4, interleave: "bsq", big: false, offset: 0 }.write(&small, "");
    Envi { kind: 4, interleave: "bsq", big: false, offset: 0 }.write(&large, "");
    let header = std::fs::read_to_string(large.with_extension("hdr")).expect("a header");
    std::fs::write(large.with_extension("hdr"), header.replace("samples   = 4", "samples = 3")).expect("a header");
    let (small, large, nowhere) = (text(&small), text(&large), text(folder.path()));
    for (args, told) in [
        (vec!["compare", small, large], "B has 3 x 3 pixels, A 4 x 3"),
        (vec!["compare", small, nowhere], "is a folder"),
        (vec!["compare", small, "no/such.exr"], "there is no file"),
        (vec!["compare", small, small, "--tolerance", "0.5"], "0.5%"),
        (vec!["compare", small, small, "--scatter", "x.jpg"], ".svg or .png"),
        (vec!["compare", small, small, "--band", "Band 3"], "A has no band"),
        (vec!["compare", small, small, "--truth", small], "material_code"),
    ] {
        let output = sunglint(&args);
        assert_eq!(output.status.code(), Some(2), "{args:?}");
        assert!(stderr(&output).contains(told), "{told}: {}", stderr(&output));
    }
    assert_eq!(sunglint(&["compare", small, small, "--tolerance", "0%"]).status.code(), Some(0));
}
