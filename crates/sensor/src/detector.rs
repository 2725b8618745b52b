//! Detectors: from spectral radiance at the sensor to digital numbers.

use std::f64::consts::PI;
use std::sync::Arc;

use sunglint_plugin::{Args, BindError, Default, Model, ModelInfo, Param, SpectralValue};
use sunglint_radiometry::{Dimension, SpectralGrid};

/// h c \[J m\], both exact in the SI of 2019.
const HC: f64 = 6.626_070_15e-34 * 299_792_458.0;

const MANUAL: &str = "\
A charge-coupled device (or any detector that is linear up to its full well) behind a lens, one for each band.

  S  = t A π/(1 + 4 N²) ∫ τ(λ) L(λ) R(λ) η(λ) λ/(h c) dλ     signal electrons of a pixel [Schott2007 ch. 5, for the G#]
  Q  = min(Poisson(S (1 + k) + D t), W)                      with dark current D and shot noise, up to the full well W
  DN = round((Q + r z)/K + b), from 0 to 2^bits − 1          gain K, bias b, read noise r

  L  spectral radiance at the sensor, the mean over the pixel     N  f-number             z, k/σ  standard normal numbers
  R  the band's response scaled to a peak of 1: its filter        t  exposure
  η  quantum efficiency, electrons a photon                       A  pitch², all of it sensitive
  τ  transmittance of the optics                                  σ  fixed pattern: one k for each detector element and band

The noise is that of the photon transfer curve [Janesick2007]: σ² = (r² + S + D t + (σ S)²)/K² in DN², and 1/12 for the
rounding. Photons count, not watts: λ weighs the radiance within the band, per wavelength, before anything is averaged.
Numbers are drawn anew for each (seed, sensor, pixel, band, time), fixed patterns once for each element: a pixel of a frame
camera, a column of a pushbroom scanner, the only one of a whiskbroom scanner. `noise off` leaves S + D t, the full well and
the rounding.

Where a band's response holds that of its detector already, as those of satellites do, `quantum_efficiency` is a number: the
efficiency at the peak. `counts` in `products` needs quantum_efficiency, f_number, exposure, pitch and full_well; unsaid, the
gain takes the full well to the largest number: (W)/(2^bits − 1 − b). A coarser picture of a sensor (`--pixels`) has
fewer pixels of the same detector: each collects over its own area what the coarser pixel shows.

Neglected: blooming, smear, crosstalk, non-linearity below the full well, fall-off of the optics towards the edge of the image.

In a scene
  ccd { quantum_efficiency \"ccd.csv\", f_number 4, exposure 8 ms, pitch 9.9 um, full_well 60000 e-, bits 12, read_noise 8 e- }
";

/// The detectors this build knows.
pub const BUILTIN: &[Model<Ccd>] = &[Model {
    info: ModelInfo {
        name: "ccd",
        summary: "electrons and digital numbers with shot, dark and read noise",
        manual: MANUAL,
        params: &[
            Param::spectrum("quantum_efficiency", Dimension::Fraction, Default::Absent, "electrons a photon, 0..1"),
            Param::quantity("f_number", Dimension::Fraction, Default::Absent, "focal length over aperture")
                .within(0.1, 1e4),
            Param::quantity("exposure", Dimension::Time, Default::Absent, "time in which a pixel collects")
                .within(1e-9, 1e5),
            Param::quantity("pitch", Dimension::Length, Default::Absent, "distance between pixels").within(1e-8, 1.0),
            Param::quantity("full_well", Dimension::Electrons, Default::Absent, "electrons that a pixel holds")
                .within(1.0, 1e12),
            Param::count("bits", &[], Default::Count(16), "of the digital numbers").within(1.0, 24.0),
            Param::quantity("gain", Dimension::Gain, Default::Absent, "electrons per digital number")
                .within(1e-6, 1e12),
            Param::quantity("bias", Dimension::Counts, Default::Number(0.0), "digital number of no electron")
                .within(0.0, 16_777_215.0),
            Param::spectrum("transmittance", Dimension::Fraction, Default::Number(1.0), "of the optics, 0..1"),
            Param::quantity("read_noise", Dimension::Electrons, Default::Number(0.0), "standard deviation")
                .within(0.0, 1e9),
            Param::quantity("dark_current", Dimension::DarkCurrent, Default::Number(0.0), "of a pixel")
                .within(0.0, 1e12),
            Param::quantity(
                "fixed_pattern",
                Dimension::Fraction,
                Default::Number(0.0),
                "relative standard deviation of the elements' response",
            )
            .within(0.0, 0.3),
            Param::switch("noise", true, "whether shot, dark, read and pattern noise are drawn"),
        ],
    },
    bind,
}];

/// A detector bound to a spectral grid.
#[derive(Clone, Debug, PartialEq)]
pub struct Ccd {
    /// Distance between pixels \[m\].
    pub pitch: Option<f64>,
    /// Time in which a pixel collects \[s\].
    pub exposure: Option<f64>,
    /// Bits of the digital numbers.
    pub bits: u32,
    /// Electrons per W m⁻² sr⁻¹ µm⁻¹ and µm at each grid entry, for a filter that lets all through; empty where a
    /// parameter for it is missing.
    pub sensitivity: Vec<f64>,
    /// Parameters that counts need and the scene does not say.
    pub missing: Vec<&'static str>,
    /// Electrons per digital number.
    gain: f64,
    bias: f64,
    full_well: f64,
    read_noise: f64,
    /// Electrons of the dark current in an exposure.
    dark: f64,
    fixed_pattern: f64,
    noise: bool,
}

fn bind(args: &Args, grid: &SpectralGrid) -> Result<Arc<Ccd>, BindError> {
    Ccd::check(args)?;
    let (pitch, exposure) = (args.number("pitch"), args.number("exposure"));
    let (f_number, full_well) = (args.number("f_number"), args.number("full_well"));
    let of_band = |missing| BindError { code: "V03", param: Some("quantum_efficiency"), ..BindError::from(missing) };
    let efficiency = args.spectrum("quantum_efficiency", grid).map_err(of_band)?;
    let transmittance = args.spectrum("transmittance", grid).map_err(of_band)?.unwrap_or_else(|| vec![1.0; grid.len()]);
    let bits = args.count("bits").unwrap_or(16) as u32;
    let bias = args.number("bias").unwrap_or(0.0);
    let largest = f64::from((1u32 << bits) - 1);
    if bias >= largest {
        let message = format!("a bias of {bias} DN leaves {bits} bits no number for light");
        return Err(BindError::new("V03", "bias", message).help(format!("the largest number is {largest} DN")));
    }
    let known = [
        ("quantum_efficiency", efficiency.is_some()),
        ("f_number", f_number.is_some()),
        ("exposure", exposure.is_some()),
        ("pitch", pitch.is_some()),
        ("full_well", full_well.is_some()),
    ];
    let missing = known.into_iter().filter(|(_, said)| !said).map(|(name, _)| name).collect();
    let full_well = full_well.unwrap_or(f64::INFINITY);
    let sensitivity = match (&efficiency, f_number, exposure, pitch) {
        (Some(efficiency), Some(n), Some(t), Some(pitch)) => {
            let etendue = pitch * pitch * PI / (1.0 + 4.0 * n * n);
            let per_watt = |wavelength_um: f64| wavelength_um * 1e-6 / HC;
            (grid.entries().iter().zip(efficiency).zip(&transmittance))
                .map(|((entry, eta), tau)| t * etendue * tau * eta * per_watt(entry.wavelength.um()))
                .collect()
        }
        _ => Vec::new(),
    };
    Ok(Arc::new(Ccd {
        pitch,
        exposure,
        bits,
        sensitivity,
        missing,
        gain: args.number("gain").unwrap_or(full_well / (largest - bias)),
        bias,
        full_well,
        read_noise: args.number("read_noise").unwrap_or(0.0),
        dark: args.number("dark_current").unwrap_or(0.0) * exposure.unwrap_or(0.0),
        fixed_pattern: args.number("fixed_pattern").unwrap_or(0.0),
        noise: args.switch("noise").unwrap_or(true),
    }))
}

impl Ccd {
    /// That efficiency and transmittance lie between 0 and 1 wherever they are given.
    ///
    /// # Errors
    /// `V03`, at the parameter.
    pub fn check(args: &Args) -> Result<(), BindError> {
        for (name, what) in [("quantum_efficiency", "a quantum efficiency"), ("transmittance", "a transmittance")] {
            let values: Vec<f64> = match args.spectral(name) {
                Some(SpectralValue::Constant(value)) => vec![*value],
                Some(SpectralValue::Curve(curve)) => vec![curve.range().0, curve.range().1],
                Some(SpectralValue::PerBand(values)) => values.iter().map(|(_, value)| *value).collect(),
                None => Vec::new(),
            };
            if let Some(value) = values.into_iter().find(|value| !(0.0..=1.0).contains(value)) {
                let message = format!("{what} lies between 0 and 1, not at {value}");
                return Err(BindError::new("V03", name, message).help("is it in percent? then write the unit `%`"));
            }
        }
        Ok(())
    }

    /// Electrons per digital number.
    pub fn gain(&self) -> f64 {
        self.gain
    }

    /// The largest digital number.
    pub fn largest(&self) -> u32 {
        (1 << self.bits) - 1
    }

    /// The digital number of no light, before it is rounded: bias and dark current.
    pub fn dark_level(&self) -> f64 {
        self.bias + self.dark / self.gain
    }

    /// The digital number of a pixel in which `signal` electrons are expected; `pixel` draws what changes from pixel to
    /// pixel and time to time, `element` what belongs to the detector element. A signal that is no number gives 0.
    pub fn read_out(&self, signal: f64, mut pixel: Draw, mut element: Draw) -> u32 {
        let mut electrons = signal.max(0.0) + self.dark;
        if self.noise {
            let pattern = 1.0 + self.fixed_pattern * element.normal();
            // Beyond the full well by ten standard deviations the number of electrons no longer matters.
            let expected = (signal.max(0.0) * pattern.max(0.0) + self.dark).min(2.0 * self.full_well + 1e3);
            electrons = pixel.poisson(expected).min(self.full_well) + self.read_noise * pixel.normal();
        }
        let number = (electrons.min(self.full_well) / self.gain + self.bias).round();
        number.clamp(0.0, f64::from(self.largest())) as u32
    }
}

/// Numbers that depend on a key alone, so that a pixel's noise is its own whatever is rendered beside it.
#[derive(Clone, Debug)]
pub struct Draw {
    key: u64,
    drawn: u64,
}

/// SplitMix64's finaliser [Steele2014].
fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

impl Draw {
    /// From the parts of a key, in order.
    pub fn new(parts: &[u64]) -> Self {
        const STEP: u64 = 0x9e37_79b9_7f4a_7c15;
        let key = parts.iter().fold(STEP, |key, part| mix(key.wrapping_add(STEP) ^ mix(part.wrapping_add(STEP))));
        Self { key, drawn: 0 }
    }

    /// The next number of (0, 1).
    pub fn uniform(&mut self) -> f64 {
        self.drawn += 1;
        let bits = mix(self.key ^ mix(self.drawn.wrapping_mul(0x9e37_79b9_7f4a_7c15)));
        ((bits >> 11) as f64 + 0.5) * 2f64.powi(-53)
    }

    /// The next standard normal number [Box1958].
    pub fn normal(&mut self) -> f64 {
        let (u, v) = (self.uniform(), self.uniform());
        (-2.0 * u.ln()).sqrt() * (2.0 * PI * v).cos()
    }

    /// The next Poisson number: by inversion for small means, else by transformed rejection [Hoermann1993, PTRS].
    pub fn poisson(&mut self, mean: f64) -> f64 {
        if mean.is_nan() || mean <= 0.0 {
            return 0.0;
        }
        if mean < 10.0 {
            let (mut k, mut p, mut rest) = (0.0, (-mean).exp(), self.uniform());
            while rest > p && k < 100.0 {
                rest -= p;
                k += 1.0;
                p *= mean / k;
            }
            return k;
        }
        let b = 0.931 + 2.53 * mean.sqrt();
        let a = -0.059 + 0.024_83 * b;
        let inverse_alpha = 1.1239 + 1.1328 / (b - 3.4);
        let v_r = 0.9277 - 3.6224 / (b - 2.0);
        // One draw in nine is rejected at most; the bound is for numbers that are none.
        for _ in 0..1000 {
            let (u, v) = (self.uniform() - 0.5, self.uniform());
            let us = 0.5 - u.abs();
            let k = ((2.0 * a / us + b) * u + mean + 0.43).floor();
            if us >= 0.07 && v <= v_r {
                return k;
            }
            if k < 0.0 || (us < 0.013 && v > us) {
                continue;
            }
            let accept = (v * inverse_alpha / (a / (us * us) + b)).ln();
            if accept <= k * mean.ln() - mean - ln_factorial(k) {
                return k;
            }
        }
        mean.round()
    }
}

/// ln k!: the product, or from 10 on Stirling's series to 1e-10 [Abramowitz1964, 6.1.41].
fn ln_factorial(k: f64) -> f64 {
    if k < 10.0 {
        return (1..=k as u32).map(|i| f64::from(i).ln()).sum();
    }
    let x = k * k;
    k * k.ln() - k + 0.5 * (2.0 * PI * k).ln() + (1.0 - (1.0 / 30.0 - 1.0 / (105.0 * x)) / x) / (12.0 * k)
}

#[cfg(test)]
mod tests {
    use super::*;
    use sunglint_plugin::Value;

    fn ccd(given: &[(&str, f64)], noise: bool) -> Ccd {
        let mut args = Args::new(&BUILTIN[0].info, given.iter().map(|(name, v)| ((*name).into(), Value::Number(*v))));
        args.set("noise", Value::Switch(noise));
        args.set("quantum_efficiency", Value::Spectrum(SpectralValue::Constant(0.6)));
        let grid = SpectralGrid::from_edges(&[0.5, 0.505, 0.51]);
        Ccd::clone(&bind(&args, &grid).unwrap())
    }

    const CAMERA: [(&str, f64); 4] = [("f_number", 4.0), ("exposure", 8e-3), ("pitch", 9.9e-6), ("full_well", 6e4)];

    /// S/(L Δλ) = t A π/(1 + 4N²) η λ/(h c): 8 ms, 98 µm², f/4, η 0.6, 0.5025 µm.
    #[test]
    fn electrons_are_photons_times_quantum_efficiency() {
        let detector = ccd(&CAMERA, false);
        let photon = HC / 0.5025e-6;
        let expected = 8e-3 * 9.9e-6 * 9.9e-6 * PI / 65.0 * 0.6 / photon;
        let mean = 0.5 * (detector.sensitivity[0] + detector.sensitivity[1]);
        assert!((mean / expected - 1.0).abs() < 1e-12 && detector.missing.is_empty());
        let without = ccd(&CAMERA[..2], false);
        assert_eq!((without.missing, without.sensitivity), (vec!["pitch", "full_well"], vec![]));
    }

    /// The default gain takes the full well to the largest number; what is beyond it is clipped.
    #[test]
    fn a_full_well_gives_the_largest_number_and_no_light_the_bias() {
        let read = |detector: &Ccd, signal| detector.read_out(signal, Draw::new(&[1]), Draw::new(&[2]));
        let detector = ccd(&[&CAMERA[..], &[("bias", 100.0)]].concat(), false);
        assert_eq!([0.0, 6e4, 1e9, f64::NAN].map(|signal| read(&detector, signal)), [100, 65535, 65535, 100]);
        assert_eq!(read(&detector, 3e4), (100.0 + 0.5 * 65435.0f64).round() as u32);
        let dark = ccd(&[&CAMERA[..], &[("gain", 10.0), ("dark_current", 1e5)]].concat(), false);
        assert_eq!((read(&dark, 0.0), read(&dark, 500.0), dark.dark_level()), (80, 130, 80.0));
        let noisy = ccd(&CAMERA, true);
        assert_eq!([f64::NAN, f64::INFINITY, 1e300].map(|signal| read(&noisy, signal)), [0, 65535, 65535]);
    }

    /// The photon transfer curve: variance (r² + S + D t + (σ S)²)/K² + 1/12 about a mean of (S + D t)/K + b, within four
    /// standard errors: √(2/n) of the variance (its kurtosis is near 3), √(var/n) of the mean.
    #[test]
    fn noise_follows_the_photon_transfer_curve() {
        let extra =
            [("gain", 2.0), ("bias", 50.0), ("read_noise", 12.0), ("dark_current", 5e3), ("fixed_pattern", 0.01)];
        let detector = ccd(&[&CAMERA[..], &extra].concat(), true);
        let n = 40_000u64;
        for signal in [0.0, 3.0, 100.0, 2500.0, 40_000.0] {
            let numbers: Vec<f64> =
                (0..n).map(|i| f64::from(detector.read_out(signal, Draw::new(&[7, i]), Draw::new(&[8, i])))).collect();
            let mean = numbers.iter().sum::<f64>() / n as f64;
            let variance = numbers.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1) as f64;
            let expected = (144.0 + signal + 40.0 + (0.01 * signal).powi(2)) / 4.0 + 1.0 / 12.0;
            assert!(
                (mean - (signal + 40.0) / 2.0 - 50.0).abs() < 4.0 * (expected / n as f64).sqrt(),
                "{signal}: {mean}"
            );
            assert!((variance / expected - 1.0).abs() < 4.0 * (2.0 / n as f64).sqrt(), "{signal}: {variance}");
        }
    }

    /// Mean, variance and third central moment of a Poisson variable are its mean; on both sides of the change of method.
    #[test]
    fn poisson_numbers_have_the_moments_of_their_mean() {
        for mean in [0.3, 4.0, 9.99, 10.01, 37.0, 1000.0] {
            let n = 200_000u64;
            let mut draw = Draw::new(&[3, f64::to_bits(mean)]);
            let numbers: Vec<f64> = (0..n).map(|_| draw.poisson(mean)).collect();
            let moment = |p: i32| numbers.iter().map(|x| (x - mean).powi(p)).sum::<f64>() / n as f64;
            // Variances of the moments of a Poisson variable m: m, 2m² + m, 15m³ + 25m² + m.
            let error = |variance: f64| 4.0 * (variance / n as f64).sqrt();
            assert!(moment(1).abs() < error(mean), "{mean}");
            assert!((moment(2) - mean).abs() < error(2.0 * mean * mean + mean), "{mean}");
            let third = 15.0 * mean.powi(3) + 25.0 * mean * mean + mean;
            assert!((moment(3) - mean).abs() < error(third), "{mean}");
        }
        assert_eq!((Draw::new(&[1]).poisson(0.0), Draw::new(&[1]).poisson(f64::NAN)), (0.0, 0.0));
        assert!((ln_factorial(10.0) - 3_628_800f64.ln()).abs() < 1e-10); // the next term is 6e-11
    }

    #[test]
    fn an_efficiency_that_is_none_is_refused() {
        let grid = SpectralGrid::from_edges(&[0.5, 0.505]);
        for value in [-0.1, 1.2] {
            let mut args = Args::new(&BUILTIN[0].info, []);
            args.set("quantum_efficiency", Value::Spectrum(SpectralValue::Constant(value)));
            let fault = bind(&args, &grid).unwrap_err();
            assert_eq!((fault.code, fault.param), ("V03", Some("quantum_efficiency")));
        }
        let mut args = Args::new(&BUILTIN[0].info, [("bits".to_string(), Value::Count(8))]);
        args.set("bias", Value::Number(255.0));
        assert_eq!(bind(&args, &grid).unwrap_err().param, Some("bias"));
    }
}
