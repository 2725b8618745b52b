//! How far an image is from its reference, with the noise of both told apart.
//!
//! ```text
//! e_i   = (B_i − A_i)/D_i,  D_i = max(A_i, 1 % of the band's mean)       the error of pixel i, with noise
//! RMSE² = ⟨e²⟩ − ⟨σ_A²/D²⟩                                               of B against the exact integral
//! S²    = RMSE² − ⟨σ_B²/D²⟩                                              its systematic part: more samples leave it
//! var S² = Σ [4 s_i² v_i + 2 v_i² + 2 a_i²/ν_A + 2 b_i²/ν_B]/n²,  s_i² = max(e_i² − v_i, 0),  v = a + b
//! ```
//!
//! with a = σ_A²/D², b = σ_B²/D². A and B are independent, since their seeds differ; ν are the degrees of freedom of the
//! standard errors, one less than the replicates behind them.

use sunglint_radiometry::REPLICATES;

use crate::comparison::percentile_99;

/// What a relative error relates to, at least: this share of the band's mean.
pub const FLOOR: f64 = 0.01;
/// The reference's standard error is to be below this share of an error that it judges.
const JUDGED_BELOW: f64 = 1.0 / 3.0;
/// Standard errors by which a systematic part stands out of the noise.
const STANDS_OUT: f64 = 2.0;

/// A pixel of an image and of its reference \[W m⁻² sr⁻¹ µm⁻¹\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pixel {
    pub x: u32,
    pub y: u32,
    pub value: f64,
    pub error: f64,
    pub reference: f64,
    pub reference_error: f64,
}

/// Sums over pixels; those of several bands, frames or materials add up.
#[derive(Clone, Debug, Default)]
pub(super) struct Sums {
    n: u64,
    error: f64,
    squares: f64,
    own: f64,
    reference: f64,
    variance_of_squares: f64,
    sizes: Vec<f32>,
    worst: Option<WorstError>,
}

impl Sums {
    /// Adds a pixel; `floor` is what its error relates to at least, `batches` how many images of 16 replicates are
    /// averaged in the reference. A pixel without a number, or of a dark band, is left out.
    pub fn add(&mut self, pixel: &Pixel, floor: f64, batches: u32) {
        let scale = pixel.reference.max(floor);
        let error = (pixel.value - pixel.reference) / scale;
        if !(scale > 0.0 && error.is_finite()) {
            return;
        }
        let (a, b) = ((pixel.reference_error / scale).powi(2), (pixel.error / scale).powi(2));
        let freedom = (REPLICATES - 1) as f64;
        let variance = a + b;
        let systematic = (error * error - variance).max(0.0);
        self.n += 1;
        self.error += error;
        self.squares += error * error;
        self.own += b;
        self.reference += a;
        self.variance_of_squares += 4.0 * systematic * variance
            + 2.0 * variance * variance
            + 2.0 * a * a / (freedom * f64::from(batches.max(1)))
            + 2.0 * b * b / freedom;
        self.sizes.push(error.abs() as f32);
        if self.worst.is_none_or(|worst| error.abs() > worst.error.abs()) {
            let Pixel { x, y, value, reference, .. } = *pixel;
            self.worst = Some(WorstError { x, y, value, reference, error });
        }
    }

    /// Adds the pixels of others.
    pub fn merge(&mut self, other: &Sums) {
        self.n += other.n;
        self.error += other.error;
        self.squares += other.squares;
        self.own += other.own;
        self.reference += other.reference;
        self.variance_of_squares += other.variance_of_squares;
        self.sizes.extend(&other.sizes);
        if let Some(worst) = other.worst
            && self.worst.is_none_or(|own| worst.error.abs() > own.error.abs())
        {
            self.worst = Some(worst);
        }
    }

    /// What they come to.
    pub fn errors(mut self) -> Errors {
        let n = (self.n as f64).max(1.0);
        let (squares, own, reference) = (self.squares / n, self.own / n, self.reference / n);
        Errors {
            n: self.n,
            rmse: (squares - reference).max(0.0).sqrt(),
            systematic_square: squares - reference - own,
            systematic_square_error: self.variance_of_squares.sqrt() / n,
            noise: own.sqrt(),
            reference_error: reference.sqrt(),
            bias: self.error / n,
            bias_error: (n * (own + reference)).sqrt() / n,
            p99: percentile_99(&mut self.sizes),
            worst: self.worst,
        }
    }
}

/// The pixel that errs most.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WorstError {
    /// Column of the whole view.
    pub x: u32,
    /// Row of the whole view.
    pub y: u32,
    /// Its radiance \[W m⁻² sr⁻¹ µm⁻¹\].
    pub value: f64,
    /// The reference's.
    pub reference: f64,
    /// Its relative error.
    pub error: f64,
}

/// Relative errors over some pixels, against the larger of the reference and 1 % of the band's mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Errors {
    /// Pixels, counted once a frame and band.
    pub n: u64,
    /// √ mean square of the error, noise of the image included and that of the reference taken off.
    pub rmse: f64,
    /// Square of its systematic part; noise may leave it below 0.
    pub systematic_square: f64,
    /// Standard error of that square.
    pub systematic_square_error: f64,
    /// √ mean variance of the image: the part that more samples lower.
    pub noise: f64,
    /// √ mean variance of the reference.
    pub reference_error: f64,
    /// Mean signed error.
    pub bias: f64,
    /// Its standard error.
    pub bias_error: f64,
    /// What 99 % of the errors do not exceed in size, noise included.
    pub p99: f64,
    /// The pixel that errs most, noise included.
    pub worst: Option<WorstError>,
}

impl Errors {
    /// Whether there is a pixel to judge and the reference is good enough: its standard error is below a third of the RMSE,
    /// or it has none.
    pub fn is_judged(&self) -> bool {
        self.n > 0 && (self.reference_error == 0.0 || self.reference_error < JUDGED_BELOW * self.rmse)
    }

    /// The systematic part of the RMSE, where it stands out of the noise by twice its standard error.
    pub fn systematic(&self) -> Option<f64> {
        let stands_out = self.systematic_square >= STANDS_OUT * self.systematic_square_error;
        stands_out.then(|| self.systematic_square.max(0.0).sqrt())
    }

    /// What the systematic part does not exceed, by twice the standard error of its square.
    pub fn systematic_below(&self) -> f64 {
        (self.systematic_square.max(0.0) + STANDS_OUT * self.systematic_square_error).sqrt()
    }

    /// Samples a pixel that the reference should have at least to judge this error, when it has `samples`. The error is
    /// at least the image's noise.
    pub fn samples_due(&self, samples: u32) -> u64 {
        let error = self.rmse.max(self.noise);
        let most = 1e12; // an error of 0 is never judged by a noisy reference
        let wanted = f64::from(samples) * (self.reference_error / (JUDGED_BELOW * error)).powi(2) * 1.1;
        let whole = if wanted.is_finite() { wanted.min(most) } else { most };
        (whole as u64 + 1).next_multiple_of(REPLICATES as u64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Normal deviates without a pattern (Box and Muller).
    fn normal(n: usize, seed: u64) -> Vec<f64> {
        let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((state >> 11) as f64 + 0.5) * 2f64.powi(-53)
        };
        (0..n).map(|_| (-2.0 * uniform().ln()).sqrt() * (std::f64::consts::TAU * uniform()).cos()).collect()
    }

    fn of(values: &[f64], references: &[f64], (own, reference): (f64, f64), floor: f64) -> Errors {
        let mut sums = Sums::default();
        for (i, (value, wanted)) in values.iter().zip(references).enumerate() {
            let pixel =
                Pixel { x: i as u32, y: 7, value: *value, error: own, reference: *wanted, reference_error: reference };
            sums.add(&pixel, floor, 1);
        }
        sums.errors()
    }

    /// Errors of +10 %, −20 % and, against the floor 0.5 instead of 0.1, +40 %: RMSE² = (0.01 + 0.04 + 0.16)/3, bias 0.1.
    #[test]
    fn errors_relate_to_the_reference_or_the_floor() {
        let errors = of(&[11.0, 8.0, 0.3], &[10.0, 10.0, 0.1], (0.0, 0.0), 0.5);
        assert!((errors.rmse - (0.21f64 / 3.0).sqrt()).abs() < 1e-12, "{errors:?}");
        assert!((errors.bias - 0.1).abs() < 1e-12 && errors.bias_error == 0.0);
        let worst = errors.worst.expect("there are pixels");
        assert_eq!((worst.x, worst.y, worst.value, worst.reference), (2, 7, 0.3, 0.1));
        assert_eq!(errors.systematic(), Some(errors.rmse));
        assert!(errors.is_judged(), "a reference without noise judges anything");
    }

    /// 1 % of 1000 pixels may exceed the percentile: of 0, 0.001, … 0.999 that is 0.989.
    #[test]
    fn one_percent_exceed_the_percentile() {
        let values: Vec<f64> = (0..1000).map(|i| 1.0 + f64::from(i) * 1e-3).collect();
        assert!((of(&values, &[1.0; 1000], (0.0, 0.0), 0.0).p99 - 0.989).abs() < 1e-6);
    }

    /// A bias of 3 % under noise of σ_B = 4 % and σ_A = 1 %: RMSE = 5 % and its systematic part 3 %, each within four
    /// standard errors; of the bias that is √(0.0017/n).
    #[test]
    fn noise_is_told_from_what_stays() {
        let n = 20_000;
        let (b, a) = (normal(n, 1), normal(n, 2));
        let values: Vec<f64> = b.iter().map(|z| 10.0 * (1.03 + 0.04 * z)).collect();
        let references: Vec<f64> = a.iter().map(|z| 10.0 * (1.0 + 0.01 * z)).collect();
        let errors = of(&values, &references, (0.4, 0.1), 0.1);
        let off = (errors.systematic_square - 0.03f64.powi(2)) / errors.systematic_square_error;
        assert!(off.abs() < 4.0, "{off} {errors:?}");
        // Conditional on the truth: 4 s² v + 2 v² + 2 (a² + b²)/15 a pixel, with s² overestimated by the noise in e².
        let (v, ideal) = (0.0017, 4.0 * 0.0009 * 0.0017 + 2.0 * 0.0017f64.powi(2));
        let least = ((ideal + 2.0 * (1e-8 + 2.56e-6) / 15.0) / n as f64).sqrt();
        let ratio = errors.systematic_square_error / least;
        assert!((1.0..1.6).contains(&ratio), "{ratio}");
        assert!((errors.rmse - 0.05).abs() < 4.0 * 0.05 / (2.0 * n as f64).sqrt() * 1.5, "{}", errors.rmse);
        assert!((errors.bias - 0.03).abs() < 4.0 * (v / n as f64).sqrt(), "{}", errors.bias);
        assert!((errors.bias_error - (v / n as f64).sqrt()).abs() < 1e-3 * errors.bias_error);
        assert!(errors.is_judged(), "1 % is below a third of 5 %");
    }

    /// Noise alone: no systematic part stands out in more than 1 of 20 images, and the bound holds.
    #[test]
    fn noise_alone_is_nothing_systematic() {
        let n = 3000;
        let found = (0..20).filter(|seed| {
            let values: Vec<f64> = normal(n, 100 + seed).iter().map(|z| 10.0 + 0.4 * z).collect();
            let errors = of(&values, &vec![10.0; n], (0.4, 0.0), 0.1);
            assert!(errors.systematic_below() < 0.04 && (errors.noise - 0.04).abs() < 1e-12);
            errors.systematic().is_some()
        });
        assert!(found.count() <= 2);
    }

    /// An error of 1 % is not judged by a reference of ±0.5 %; (0.5/0.333)² = 2.25 times the samples would.
    #[test]
    fn a_poor_reference_judges_nothing_and_says_what_is_due() {
        let errors = Errors { rmse: 0.01, noise: 0.004, reference_error: 0.005, ..of(&[1.0], &[1.0], (0.0, 0.0), 0.0) };
        assert!(!errors.is_judged());
        assert_eq!(errors.samples_due(1000), 2480); // 2.25 × 1.1 × 1000, in sixteens
        assert!(Errors { reference_error: 0.003, ..errors }.is_judged());
        // Where the error does not show, it is at least the image's noise.
        assert_eq!(Errors { rmse: 0.0, ..errors }.samples_due(160), 2480);
    }

    #[test]
    fn merged_sums_are_those_of_all_pixels() {
        let (values, references) = ([11.0, 8.0, 0.3, 5.0], [10.0, 10.0, 0.1, 5.5]);
        let whole = of(&values, &references, (0.1, 0.2), 0.5);
        let mut merged = Sums::default();
        for i in 0..4 {
            let mut sums = Sums::default();
            let pixel = Pixel {
                x: i as u32,
                y: 7,
                value: values[i],
                error: 0.1,
                reference: references[i],
                reference_error: 0.2,
            };
            sums.add(&pixel, 0.5, 1);
            merged.merge(&sums);
        }
        let merged = merged.errors();
        assert!((merged.rmse - whole.rmse).abs() < 1e-12 && merged.worst == whole.worst && merged.p99 == whole.p99);
    }

    #[test]
    fn a_dark_band_and_a_pixel_without_a_number_are_left_out() {
        let errors = of(&[0.0, f64::NAN], &[0.0, 1.0], (0.0, 0.0), 0.0);
        assert_eq!((errors.n, errors.rmse, errors.worst), (0, 0.0, None));
        assert!(!errors.is_judged());
    }
}
