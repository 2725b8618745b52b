//! Previews: 8-bit PNG pictures with one linear stretch for a whole series, so that its frames compare.

use std::io;
use std::path::Path;

use ::png::{BitDepth, ColorType, Encoder, EncodingError, SrgbRenderingIntent};

use super::{check_samples, invalid, whole};

/// A linear stretch: `low` is shown black, `high` white.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stretch {
    /// Shown black.
    pub low: f32,
    /// Shown white.
    pub high: f32,
}

impl Stretch {
    /// The sRGB code of a sample [IEC 61966-2-1]; what is no number is black.
    pub fn code(self, sample: f32) -> u8 {
        let linear = (f64::from(sample) - f64::from(self.low)) / (f64::from(self.high) - f64::from(self.low));
        if linear.is_nan() {
            return 0;
        }
        let linear = linear.clamp(0.0, 1.0);
        let encoded = if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 };
        (255.0 * encoded).round() as u8
    }
}

/// Collects the samples of one channel over a series of frames in bounded memory, and finds the stretch that serves all.
///
/// Samples are counted in bins as wide as 8 bits of mantissa tell apart, so a percentile is right to 0.8 % of itself
/// over the whole range of floats. The order of frames does not matter.
#[derive(Clone, Debug)]
pub struct StretchCollector {
    counts: Vec<u64>,
    total: u64,
    smallest: f32,
    largest: f32,
}

impl Default for StretchCollector {
    fn default() -> Self {
        Self { counts: vec![0; 1 << 16], total: 0, smallest: f32::INFINITY, largest: f32::NEG_INFINITY }
    }
}

impl StretchCollector {
    /// Adds the samples of a frame; those that are not finite are left out.
    pub fn add(&mut self, samples: &[f32]) {
        for sample in samples.iter().copied().filter(|sample| sample.is_finite()) {
            self.counts[usize::from(bin_of(sample))] += 1;
            self.total += 1;
            self.smallest = self.smallest.min(sample);
            self.largest = self.largest.max(sample);
        }
    }

    /// The value below which `fraction` (0 to 1) of the samples lie; `None` where there are none.
    pub fn percentile(&self, fraction: f64) -> Option<f32> {
        let rank = fraction.clamp(0.0, 1.0) * self.total as f64;
        let mut below = 0;
        for (bin, count) in (0..=u16::MAX).zip(&self.counts).filter(|(_, count)| **count > 0) {
            if (below + count) as f64 >= rank {
                let (low, high) = edges(bin);
                let value = low + (high - low) * (rank - below as f64) / *count as f64;
                return Some(value.clamp(f64::from(self.smallest), f64::from(self.largest)) as f32);
            }
            below += count;
        }
        None
    }

    /// From the 0.5th to the 99.5th percentile of everything added, yet `high` at most 40 times the median, so that
    /// neither glint nor a bright sky leaves the scene in the dark. A series without contrast is shown in a middle grey.
    pub fn stretch(&self) -> Stretch {
        let percentiles = (self.percentile(0.005), self.percentile(0.5), self.percentile(0.995));
        let (Some(low), Some(median), Some(mut high)) = percentiles else { return Stretch { low: 0.0, high: 1.0 } };
        if median > 0.0 {
            high = high.min(40.0 * median);
        }
        if high - low > 1e-3 * high.abs().max(low.abs()) {
            Stretch { low, high }
        } else if high > 0.0 {
            Stretch { low: 0.0, high: 2.0 * high }
        } else {
            Stretch { low: high - 1.0, high: high + 1.0 }
        }
    }
}

/// The upper 16 bits of a float, in an order that ascends with its value.
fn bin_of(sample: f32) -> u16 {
    let bits = sample.to_bits();
    let ascending = if bits >> 31 == 0 { bits | 0x8000_0000 } else { !bits };
    (ascending >> 16) as u16
}

/// The values between which a bin's samples lie.
fn edges(bin: u16) -> (f64, f64) {
    let value = |ascending: u32| {
        f64::from(f32::from_bits(if ascending >> 31 == 1 { ascending & 0x7fff_ffff } else { !ascending }))
    };
    let first = u32::from(bin) << 16;
    let (low, high) = (value(first), value(first | 0xffff));
    (low, if high.is_finite() { high } else { f64::from(f32::MAX) })
}

/// Three channels shown as red, green and blue.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Composite {
    /// `natural_colour` or `colour_infrared`.
    pub name: &'static str,
    /// Indices of the channels shown as red, green, blue.
    pub channels: [usize; 3],
}

/// The composites that a sensor's bands allow, by their centres \[nm\]: natural colour from the bands nearest to 650, 550
/// and 470 nm, and colour infrared (the band nearest to 850 nm from 720 nm up, then that red and green). A band stands
/// for a colour within 60 nm of it, and for one only.
pub fn composite_bands(centres_nm: &[Option<f64>]) -> Vec<Composite> {
    let nearest = |target: f64, range: std::ops::RangeInclusive<f64>| {
        let centres = centres_nm.iter().enumerate().filter_map(|(idx, centre)| Some((idx, (*centre)?)));
        centres
            .filter(|(_, centre)| range.contains(centre))
            .min_by(|a, b| (a.1 - target).abs().total_cmp(&(b.1 - target).abs()))
            .map(|(idx, _)| idx)
    };
    let colour = |target: f64| nearest(target, target - 60.0..=target + 60.0);
    let (red, green, blue) = (colour(650.0), colour(550.0), colour(470.0));
    let infrared = nearest(850.0, 720.0..=1100.0);
    [("natural_colour", [red, green, blue]), ("colour_infrared", [infrared, red, green])]
        .into_iter()
        .filter_map(|(name, [r, g, b])| {
            let channels = [r?, g?, b?];
            let distinct = channels[0] != channels[1] && channels[1] != channels[2] && channels[2] != channels[0];
            distinct.then_some(Composite { name, channels })
        })
        .collect()
}

/// Writes one channel as a grey picture, 8-bit sRGB.
///
/// # Errors
/// Samples that do not fill the picture, and those of [`super::write_whole`].
pub fn write_png_gray(path: &Path, width: u32, height: u32, samples: &[f32], stretch: Stretch) -> io::Result<()> {
    check_samples("grey", width, height, samples)?;
    let codes: Vec<u8> = samples.iter().map(|sample| stretch.code(*sample)).collect();
    write(path, width, height, ColorType::Grayscale, &codes)
}

/// Writes three channels as a colour picture, 8-bit sRGB, each with its own stretch.
///
/// # Errors
/// Samples that do not fill the picture, and those of [`super::write_whole`].
pub fn write_png_rgb(
    path: &Path,
    width: u32,
    height: u32,
    [red, green, blue]: [&[f32]; 3],
    stretch: [Stretch; 3],
) -> io::Result<()> {
    for (name, samples) in [("red", red), ("green", green), ("blue", blue)] {
        check_samples(name, width, height, samples)?;
    }
    let pixels = red.iter().zip(green).zip(blue);
    let codes: Vec<u8> = pixels
        .flat_map(|((red, green), blue)| [stretch[0].code(*red), stretch[1].code(*green), stretch[2].code(*blue)])
        .collect();
    write(path, width, height, ColorType::Rgb, &codes)
}

fn write(path: &Path, width: u32, height: u32, color: ColorType, codes: &[u8]) -> io::Result<()> {
    whole::write_whole(path, |out| {
        let mut encoder = Encoder::new(out, width, height);
        encoder.set_color(color);
        encoder.set_depth(BitDepth::Eight);
        encoder.set_source_srgb(SrgbRenderingIntent::Perceptual);
        let written = encoder.write_header().and_then(|mut writer| {
            writer.write_image_data(codes)?;
            writer.finish()
        });
        written.map_err(|error| match error {
            EncodingError::IoError(error) => error,
            error => invalid(error.to_string()),
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_png(path: &Path) -> (u32, u32, Vec<u8>) {
        let file = io::BufReader::new(std::fs::File::open(path).unwrap());
        let mut reader = ::png::Decoder::new(file).read_info().unwrap();
        assert!(reader.info().srgb.is_some());
        let mut codes = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut codes).unwrap();
        assert_eq!(info.bit_depth, BitDepth::Eight);
        (info.width, info.height, codes)
    }

    /// sRGB: linear 0.214 is code 127 or 128 (IEC 61966-2-1: 0.21404 is code 127.5), the toe is a straight line.
    #[test]
    fn a_preview_is_srgb_within_its_stretch() {
        let stretch = Stretch { low: 10.0, high: 20.0 };
        assert_eq!(
            [f32::NAN, -1e30, 10.0, 20.0, f32::INFINITY].map(|sample| stretch.code(sample)),
            [0, 0, 0, 255, 255]
        );
        assert_eq!(stretch.code(12.158_605), 128); // code 128 is linear 0.2158605
        assert_eq!(stretch.code(10.0 + 10.0 / 255.0 / 12.92), 1);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("red.png");
        write_png_gray(&path, 2, 1, &[10.0, 25.0], stretch).unwrap();
        assert_eq!(read_png(&path), (2, 1, vec![0, 255]));
        let other = Stretch { low: 0.0, high: 25.0 };
        write_png_rgb(&path, 2, 1, [&[10.0, 25.0], &[20.0, 5.0], &[0.0, 25.0]], [stretch, stretch, other]).unwrap();
        assert_eq!(read_png(&path), (2, 1, vec![0, 255, 0, 255, 0, 255]));
        assert!(write_png_gray(&path, 3, 1, &[1.0], stretch).is_err());
        assert!(write_png_gray(&folder.path().join("no.png"), 0, 0, &[], stretch).is_err());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    /// Uniform samples over ±100 and lognormal-like ones over nine decades: percentiles within a bin, 2⁻⁷ of the value.
    #[test]
    fn percentiles_are_right_to_a_bin_in_any_order_of_frames() {
        let n = 100_001;
        let uniform = |i: usize| -100.0 + 200.0 * i as f64 / (n - 1) as f64;
        let decades = |i: usize| 10_f64.powf(-5.0 + 9.0 * i as f64 / (n - 1) as f64);
        for exact in [&uniform as &dyn Fn(usize) -> f64, &decades] {
            let samples: Vec<f32> = (0..n).map(|i| exact(i) as f32).collect();
            let (mut ascending, mut shuffled) = (StretchCollector::default(), StretchCollector::default());
            samples.chunks(1000).for_each(|frame| ascending.add(frame));
            (0..7).for_each(|k| shuffled.add(&samples.iter().skip(k).step_by(7).rev().copied().collect::<Vec<_>>()));
            shuffled.add(&[f32::NAN, f32::INFINITY, f32::NEG_INFINITY]);
            for fraction in [0.0, 0.005, 0.1, 0.37, 0.5, 0.75, 0.995, 1.0] {
                let expected = exact((fraction * (n - 1) as f64).round() as usize);
                let found = f64::from(ascending.percentile(fraction).unwrap());
                let spacing = (exact(1) - exact(0)).abs();
                assert!((found - expected).abs() <= expected.abs() / 128.0 + spacing, "{fraction} {found} {expected}");
                assert_eq!(shuffled.percentile(fraction), ascending.percentile(fraction));
            }
        }
    }

    /// A landscape of radiance 10 to 50, a fifth of the picture: glint a thousand times brighter on 2 % of the pixels.
    #[test]
    fn glint_does_not_leave_the_scene_in_the_dark() {
        let mut collector = StretchCollector::default();
        let scene: Vec<f32> = (0..9800).map(|i| 10.0 + 40.0 * i as f32 / 9799.0).collect();
        collector.add(&scene);
        collector.add(&[50_000.0; 200]);
        let stretch = collector.stretch();
        assert!((stretch.low - 10.2).abs() < 0.1, "{stretch:?}"); // 0.5 % of 10 000 samples
        assert!((stretch.high / (40.0 * 30.4) - 1.0).abs() < 0.01, "{stretch:?}"); // 40 medians
        let mut without = StretchCollector::default();
        without.add(&scene);
        assert!((without.stretch().high - 49.8).abs() < 0.4, "{:?}", without.stretch());
    }

    /// A furnace returns one radiance; rounding is not contrast.
    #[test]
    fn a_series_without_contrast_is_middle_grey() {
        let stretch = |samples: &[f32]| {
            let mut collector = StretchCollector::default();
            collector.add(samples);
            collector.stretch()
        };
        assert_eq!(stretch(&[100.0; 50]), Stretch { low: 0.0, high: 200.0 });
        let near = stretch(&[100.0, 100.001, 99.999]);
        assert_eq!(near.low, 0.0);
        assert_eq!(near.code(100.0), 188); // linear 0.5
        assert_eq!(stretch(&[0.0; 4]).code(0.0), 188);
        assert_eq!(stretch(&[]), Stretch { low: 0.0, high: 1.0 });
        assert_eq!(stretch(&[f32::MAX, f32::MIN]).code(0.0), 188);
    }

    #[test]
    fn composites_take_the_bands_that_cover_their_colours() {
        let some = |centres: &[f64]| composite_bands(&centres.iter().copied().map(Some).collect::<Vec<_>>());
        let natural = |channels| Composite { name: "natural_colour", channels };
        let infrared = |channels| Composite { name: "colour_infrared", channels };
        assert_eq!(some(&[470.0, 540.0, 675.0, 870.0]), [natural([2, 1, 0]), infrared([3, 2, 1])]);
        assert_eq!(some(&[540.0, 675.0, 870.0]), [infrared([2, 1, 0])]);
        assert_eq!(some(&[470.0, 540.0, 675.0]), [natural([2, 1, 0])]);
        assert!(some(&[675.0]).is_empty());
        assert!(some(&[505.0, 650.0, 700.0]).is_empty()); // one band cannot be green and blue, 700 nm is no infrared
        assert!(composite_bands(&[None, Some(650.0), None]).is_empty());
        let sentinel_2: Vec<f64> = vec![443.0, 492.0, 560.0, 665.0, 704.0, 741.0, 783.0, 833.0, 865.0, 945.0];
        assert_eq!(some(&sentinel_2), [natural([3, 2, 1]), infrared([8, 3, 2])]);
    }
}
