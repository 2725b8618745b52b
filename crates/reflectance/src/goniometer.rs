//! A virtual goniometer: any surface scanned as the proposal plans it [Stark1993, sec. 4.1.3], read as an instrument reads.
//!
//! A reading is the biconical reflectance factor [Nicodemus1977] for a round source of even radiance and a round
//! aperture,
//!
//! ```text
//! BRF = π ∫_s ∫_Ω f cos θ_o dω_o cos θ_i dω_i / (∫_s cos θ_i dω_i ∫_Ω cos θ_o dω_o)
//! ```
//!
//! with the mirror lobe as its Dirac part: a mirror of reflectance ρ reads π ρ/(Ω cos θ) where its image of the source is
//! in the aperture, and that share of it where the aperture cuts the image. The cone of the aperture has π sin² a = Ω.
//! A source of radius 0 is a point.
//!
//! Noise is Gaussian with variance (relative · BRF)² + absolute², independent from reading to reading; of several repeats
//! the mean is given, and its standard error. A reading's noise depends on the seed, its band and angles, and its repeat
//! alone.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use sunglint_radiometry::LocalDir;

use crate::aperture::{Aperture, mean_over_source};
use crate::scans::{Measurement, SAME_ANGLE, ScanBand, ScanFault, ScanFaults, Scans};
use crate::{Bsdf, SOLAR_DISK};

/// Illumination angles of the proposal \[deg\].
const ILLUMINATIONS: [f64; 5] = [8.0, 30.0, 45.0, 60.0, 75.0];
/// View angles of the proposal \[deg\], from its own order; 90 is among them and cannot be measured.
const VIEWS: [f64; 11] = [8.0, 30.0, 45.0, 60.0, 75.0, 90.0, -75.0, -60.0, -45.0, -30.0, -8.0];

/// Readings that one call takes at most.
const MOST_READINGS: usize = 1_000_000;
const MOST_REPEATS: u32 = 1_000_000;

/// An instrument and what it is told to do.
#[derive(Clone, Debug, PartialEq)]
pub struct Goniometer {
    /// Zenith angles of the light \[rad\].
    pub illuminations: Vec<f64>,
    /// Zenith angles of the view \[rad\], negative in the forward half-plane; those at 90° are left out.
    pub views: Vec<f64>,
    /// Solid angle of the aperture \[sr\], above 0 and at most π.
    pub solid_angle: f64,
    /// Angular radius of the source \[rad\].
    pub source_radius: f64,
    /// Noise of a reading.
    pub noise: ReadingNoise,
    /// Readings that each value is the mean of, one at least.
    pub repeats: u32,
    /// Seed of the noise.
    pub seed: u64,
    /// Whether the instrument sees the sample against the light (v = +i), where most block it.
    pub retro: bool,
}

/// Noise of a reading.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ReadingNoise {
    /// Standard deviation as a share of the reading.
    pub relative: f64,
    /// Standard deviation besides, as a BRF.
    pub absolute: f64,
}

impl ReadingNoise {
    /// Standard deviation of a reading of this BRF.
    pub fn stddev(&self, brf: f64) -> f64 {
        (self.relative * brf).hypot(self.absolute)
    }
}

impl Default for Goniometer {
    /// The proposal's angles, noise-free, a point source, and an aperture of 1.9 msr (half-angle 1.4°), of which the proposal
    /// says nothing.
    fn default() -> Self {
        Self {
            illuminations: ILLUMINATIONS.map(f64::to_radians).to_vec(),
            views: VIEWS.map(f64::to_radians).to_vec(),
            solid_angle: 1.9e-3,
            source_radius: 0.0,
            noise: ReadingNoise::default(),
            repeats: 1,
            seed: 1993,
            retro: false,
        }
    }
}

/// A band of the instrument as a mean over the grid entries that a surface is bound to.
#[derive(Clone, Debug, PartialEq)]
pub struct GoniometerBand {
    /// What the scans call it.
    pub band: ScanBand,
    /// Grid entries and weights, which sum to 1.
    pub weights: Vec<(usize, f64)>,
}

impl Goniometer {
    /// Scans a surface of `n` grid entries. Each value has the standard error of the noise that the instrument is known to
    /// have.
    ///
    /// # Errors
    /// `U05` what no instrument does: angles beyond the surface, an aperture or source that is none, negative noise, too
    /// many readings. All are told.
    pub fn scan(&self, bsdf: &dyn Bsdf, n: usize, bands: &[GoniometerBand]) -> Result<Scans, ScanFaults> {
        self.held(n, bands)?;
        let mut measurements = Vec::new();
        for illumination in &self.illuminations {
            for view in self.views.iter().filter(|view| self.sees(*illumination, **view)) {
                let entries = self.brf(bsdf, n, *illumination, *view);
                measurements.extend(bands.iter().map(|band| Measurement {
                    band: band.band.clone(),
                    illumination: *illumination,
                    view: *view,
                    brf: mean(&band.weights, &entries),
                    stddev: None,
                    line: None,
                }));
            }
        }
        self.noisy(&Scans::new(measurements, Some(self.solid_angle))?)
    }

    /// Scans without noise as this instrument would read them, with its noise and the standard error of each value.
    ///
    /// # Errors
    /// Those of [`Scans::new`], where noise takes a value far below 0.
    pub fn noisy(&self, scans: &Scans) -> Result<Scans, ScanFaults> {
        let repeats = self.repeats.clamp(1, MOST_REPEATS);
        let noisy = scans.readings().iter().zip(scans.measurements()).map(|(reading, clean)| {
            let sigma = self.noise.stddev(clean.brf);
            let place = [reading.band, reading.illumination, reading.view].map(|index| index as u64);
            let draw = |k: u32| normal([self.seed, place[0], place[1], place[2], u64::from(k)]);
            let departure = match sigma > 0.0 {
                true => sigma * (0..repeats).map(draw).sum::<f64>() / f64::from(repeats),
                false => 0.0,
            };
            let stddev = Some(sigma / f64::from(repeats).sqrt());
            Measurement { brf: clean.brf + departure, stddev, ..clean }
        });
        Scans::new(noisy, Some(self.solid_angle))
    }

    /// A reading without noise, per grid entry.
    fn brf(&self, bsdf: &dyn Bsdf, n: usize, illumination: f64, view: f64) -> Vec<f64> {
        let incident = LocalDir::from_polar(illumination, 0.0);
        let outgoing = LocalDir::from_polar(view.abs(), if view < 0.0 { PI } else { 0.0 });
        let aperture = Aperture::about(outgoing, self.solid_angle);
        let mut brf = vec![0.0; n];
        aperture.add_brf(bsdf, incident, &mut brf);
        if self.source_radius > 0.0 {
            // As a departure from the source's middle, so that an even surface reads one value.
            let mut beside = vec![0.0; n];
            let departure = mean_over_source(incident, self.source_radius, n, |incident, weight, sum| {
                beside.fill(0.0);
                aperture.add_brf(bsdf, incident, &mut beside);
                let values = beside.iter().zip(&brf);
                sum.iter_mut().zip(values).for_each(|(sum, (beside, brf))| *sum += weight * (beside - brf));
            });
            brf.iter_mut().zip(departure).for_each(|(brf, departure)| *brf += departure);
        }
        brf
    }

    /// Whether the instrument takes this place: nothing is seen along the surface, and against the light it may shade itself.
    fn sees(&self, illumination: f64, view: f64) -> bool {
        view.abs() < FRAC_PI_2 - SAME_ANGLE && (self.retro || (view - illumination).abs() >= SAME_ANGLE)
    }

    fn held(&self, n: usize, bands: &[GoniometerBand]) -> Result<(), ScanFaults> {
        let mut faults = ScanFaults::default();
        let mut fault = |holds: bool, message: String| {
            if !holds {
                faults.push(ScanFault::new("U05", None, message));
            }
        };
        let angle = |range: std::ops::Range<f64>, angles: &[f64]| angles.iter().all(|angle| range.contains(angle));
        let below = FRAC_PI_2 - SAME_ANGLE;
        fault(angle(0.0..below, &self.illuminations), "illumination angles lie from 0 to below 90 deg".into());
        let beyond = FRAC_PI_2 + SAME_ANGLE;
        fault(angle(-beyond..beyond, &self.views), "view angles lie within -90..90 deg".into());
        fault(
            !self.illuminations.is_empty() && !self.views.is_empty(),
            "a scan needs angles of light and of view".into(),
        );
        let aperture = self.solid_angle >= SOLAR_DISK * (1.0 - 1e-3) && self.solid_angle <= PI;
        fault(aperture, format!("an aperture of {} sr is none; 68 usr to pi sr are taken", self.solid_angle));
        let source = (0.0..=0.5).contains(&self.source_radius);
        fault(source, format!("a source of radius {} rad is none; 0 to 0.5 rad are taken", self.source_radius));
        let ReadingNoise { relative, absolute } = self.noise;
        let noise = [relative, absolute].iter().all(|stddev| stddev.is_finite() && *stddev >= 0.0);
        fault(noise, "noise is a standard deviation, 0 or more".into());
        fault(
            (1..=MOST_REPEATS).contains(&self.repeats),
            format!("{} repeats; 1 to {MOST_REPEATS} are taken", self.repeats),
        );
        let count = self.illuminations.len().saturating_mul(self.views.len()).saturating_mul(bands.len());
        let count = count.saturating_mul(self.repeats as usize);
        fault(count <= MOST_READINGS, format!("{count} readings; at most {MOST_READINGS} are taken in one go"));
        let known = bands.iter().all(|band| band.weights.iter().all(|(entry, _)| *entry < n));
        fault(known && !bands.is_empty(), "a scan needs bands of the surface's own wavelengths".into());
        faults.into_result(|| ())
    }
}

/// Σ w x, about the first value, so that equal values have their own as mean.
fn mean(weights: &[(usize, f64)], values: &[f64]) -> f64 {
    let first = weights.first().map_or(0.0, |(entry, _)| values[*entry]);
    first + weights.iter().map(|(entry, weight)| weight * (values[*entry] - first)).sum::<f64>()
}

/// A standard normal number of a key [Box1958], from hashes of it by SplitMix64's finaliser [Steele2014].
fn normal(key: [u64; 5]) -> f64 {
    const STEP: u64 = 0x9e37_79b9_7f4a_7c15;
    let hash = key.iter().fold(STEP, |hash, part| mix(hash.wrapping_add(STEP) ^ mix(part.wrapping_add(STEP))));
    let uniform = |k: u64| ((mix(hash ^ mix(k.wrapping_mul(STEP))) >> 11) as f64 + 0.5) * 2f64.powi(-53);
    (-2.0 * uniform(1).ln()).sqrt() * (TAU * uniform(2)).cos()
}

fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests;
