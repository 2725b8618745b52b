//! How the detector of a sensor reads a run's frames.

use std::sync::Arc;

use sunglint_dsl::scene::Projection;
use sunglint_sensor::{Ccd, Draw};

/// A detector behind the bands of a run.
#[derive(Clone, Debug)]
pub struct Readout {
    /// The detector.
    pub ccd: Arc<Ccd>,
    /// By band, electrons per W m⁻² sr⁻¹ µm⁻¹ of the radiance that is averaged with the weight of its photons: that which
    /// the filter lets through and the detector turns into electrons.
    pub electrons: Vec<f64>,
    projection: Projection,
    /// Seed of the experiment and the sensor's own.
    seeds: [u64; 2],
}

impl Readout {
    /// A detector behind bands; `seeds` are those of experiment and sensor.
    pub fn new(ccd: Arc<Ccd>, electrons: Vec<f64>, projection: Projection, seeds: [u64; 2]) -> Self {
        Self { ccd, electrons, projection, seeds }
    }

    /// The digital number of a pixel in a band, from the radiance that its photons weigh; `frame` tells times apart.
    pub fn count(&self, frame: u64, (x, y): (u32, u32), band: usize, radiance: f64) -> u32 {
        const PIXEL: u64 = 1;
        const ELEMENT: u64 = 2;
        let [seed, view] = self.seeds;
        let (x, y) = (u64::from(x), u64::from(y));
        let element = match self.projection {
            Projection::Perspective | Projection::Orthographic => (x << 32) | y,
            Projection::Pushbroom => x,
            Projection::Whiskbroom => 0,
        };
        let pixel = Draw::new(&[PIXEL, seed, view, (x << 32) | y, band as u64, frame]);
        let element = Draw::new(&[ELEMENT, seed, view, element, band as u64]);
        self.ccd.read_out(radiance * self.electrons[band], pixel, element)
    }

    /// Radiance from a band's digital numbers: slope \[W m⁻² sr⁻¹ µm⁻¹ per DN\] and intercept.
    pub fn calibration(&self, band: usize) -> (f64, f64) {
        let slope = self.ccd.gain() / self.electrons[band];
        (slope, -slope * self.ccd.dark_level())
    }

    /// Tells the times of a run apart, by the name of the frame: so a frame that is rendered alone has the same noise.
    pub fn frame_key(label: &str) -> u64 {
        let hash = blake3::hash(label.as_bytes());
        u64::from_le_bytes(std::array::from_fn(|i| hash.as_bytes()[i]))
    }
}
