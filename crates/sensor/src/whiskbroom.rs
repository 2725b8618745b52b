//! The whiskbroom scanner: one detector whose line of sight turns across the flight in equal steps.
//!
//! ```text
//! θ = δ (x − n/2)              scan angle; δ the instantaneous field of view
//! d ∥ cos φ (cos θ l + sin θ a) + sin φ b      φ = δ (y − i − ½) within line i, along the flight
//! o = o₀ + i (v/f) h
//! ```
//!
//! Looking straight down from H over level ground a pixel at θ measures H δ sec² θ across and H δ sec θ along: the panoramic
//! and bow-tie distortions. A line is taken at one instant, as by a scanner that compensates its motion or turns fast beside
//! it; so lines overlap or leave gaps where v/f differs from H δ.

use glam::DVec3;
use sunglint_radiometry::WorldDir;

use crate::camera::within;
use crate::flight::Track;
use crate::{Camera, CameraError, CameraRay, Flight, Optics, ScanPose};

/// A whiskbroom scanner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Whiskbroom {
    track: Track,
    /// Scan angle from pixel to pixel \[rad\].
    step: f64,
    /// Angle that a pixel covers along the flight \[rad\].
    reach: f64,
}

impl Whiskbroom {
    /// From pose, motion, optics and pixels (across, lines). A field of view is the angle scanned; a focal length and a
    /// pitch give δ = 2 atan(pitch / 2 focal length).
    ///
    /// # Errors
    /// Numbers out of their ranges; a scan of 180° and more; a line of sight along the flight.
    pub fn new(pose: ScanPose, flight: Flight, optics: Optics, pixels: (u32, u32)) -> Result<Self, CameraError> {
        let track = Track::new(pose, flight, pixels)?;
        optics.step(pixels.0)?; // the ranges of its numbers
        let step = match optics {
            Optics::FieldOfView(angle) => angle / f64::from(pixels.0),
            Optics::Ifov(angle) => angle,
            Optics::FocalLength { focal_length, pitch } => 2.0 * (0.5 * pitch / focal_length).atan(),
        };
        let scan = step * f64::from(pixels.0);
        within("scan angle", scan, (0.0, std::f64::consts::PI), true, "above 0 and below 180 deg (pi rad)")?;
        Ok(Self { track, step, reach: step })
    }

    /// The same swath and way in other pixels.
    #[must_use]
    pub fn resampled(self, pixels: (u32, u32)) -> Self {
        let coarser = |old: u32, new: u32| f64::from(old) / f64::from(new.max(1));
        let (x, y) = (coarser(self.track.pixels.0, pixels.0), coarser(self.track.pixels.1, pixels.1));
        Self { track: self.track.resampled(pixels), step: self.step * x, reach: self.reach * y }
    }

    /// Scan angle from pixel to pixel \[rad\].
    pub fn ifov(&self) -> f64 {
        self.step
    }
}

impl Camera for Whiskbroom {
    fn pixels(&self) -> (u32, u32) {
        self.track.pixels
    }

    fn position(&self) -> DVec3 {
        self.track.position
    }

    fn ray(&self, x: f64, y: f64) -> CameraRay {
        let Track { forward, across, along, pixels, .. } = self.track;
        let line = y.floor().clamp(0.0, f64::from(pixels.1) - 1.0);
        let (sin, cos) = (self.step * (x - 0.5 * f64::from(pixels.0))).sin_cos();
        let (sin_along, cos_along) = (self.reach * (y - line - 0.5)).sin_cos();
        let direction = WorldDir::new(cos_along * (cos * forward + sin * across) + sin_along * along);
        CameraRay { origin: self.track.at(line + 0.5), direction }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flight::tests::{flight, nadir, on_ground};
    use glam::DVec2;

    /// Equal angles: H tan θ across; pixels grow as sec² θ across and as sec θ along.
    #[test]
    fn ground_pixels_grow_as_the_panoramic_distortion_says() {
        let (h, ifov) = (3000.0, 2.5e-3);
        let scanner = Whiskbroom::new(nadir(h), flight(0.0), Optics::Ifov(ifov), (600, 20)).unwrap();
        for x in [0.5, 150.5, 300.0, 599.5] {
            let theta = ifov * (x - 300.0);
            for line in [0.0, 7.0, 19.0] {
                let middle = on_ground(&scanner, x, line + 0.5);
                let expected = DVec2::new(10.0 - h * theta.tan(), 20.0 + 0.5 * line);
                assert!((middle - expected).length() < 1e-8, "{middle} {expected}");
            }
            let width = (on_ground(&scanner, x + 0.5, 0.5) - on_ground(&scanner, x - 0.5, 0.5)).length();
            let exact = h * ((theta + 0.5 * ifov).tan() - (theta - 0.5 * ifov).tan());
            assert!((width - exact).abs() < 1e-8 && (width / (h * ifov / theta.cos().powi(2)) - 1.0).abs() < 1e-5);
            let length = (on_ground(&scanner, x, 0.0) - on_ground(&scanner, x, 1.0 - 1e-12)).length();
            assert!((length / (2.0 * h * (0.5 * ifov).tan() / theta.cos()) - 1.0).abs() < 1e-9, "{length}");
        }
        assert!(scanner.ground(0.0).is_none());
    }

    #[test]
    fn other_pixels_keep_the_scan_and_the_way_flown() {
        let scanner = Whiskbroom::new(nadir(900.0), flight(0.4), Optics::FieldOfView(1.5), (120, 90)).unwrap();
        let coarse = scanner.resampled((40, 30));
        for u in [0.0, 0.5, 1.0] {
            // Line 7 of the coarse view lies about the middle one of the fine lines 21, 22 and 23.
            let (a, b) = (on_ground(&coarse, 40.0 * u, 7.5), on_ground(&scanner, 120.0 * u, 22.5));
            assert!((a - b).length() < 1e-9, "{a} {b}");
        }
        assert!((coarse.ifov() - 3.0 * scanner.ifov()).abs() < 1e-15);
        let half = Optics::Ifov(0.1);
        assert!(Whiskbroom::new(nadir(900.0), flight(0.4), half, (32, 4)).is_err());
    }
}
