//! The pushbroom scanner: a row of detectors behind a lens, carried along.
//!
//! ```text
//! o(x, y) = o₀ + (y − ½) (v/f) h             parallel along the flight
//! d(x, y) ∥ l + p (x − n/2) a                perspective across; p = pixel pitch over focal length
//! ```
//!
//! A line is taken while the sensor moves by v/f, so the pixels of neighbouring lines touch on the ground; how far a pixel's
//! own field reaches along the flight is neglected beside that way.

use glam::{DVec2, DVec3};
use sunglint_radiometry::WorldDir;

use crate::flight::Track;
use crate::{Camera, CameraError, CameraRay, Flight, GroundMap, Optics, ScanPose};

/// A pushbroom scanner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pushbroom {
    track: Track,
    /// Pixel pitch over focal length.
    step: f64,
}

impl Pushbroom {
    /// From pose, motion, optics and pixels (across, lines).
    ///
    /// # Errors
    /// Numbers out of their ranges; a line of sight along the flight.
    pub fn new(pose: ScanPose, flight: Flight, optics: Optics, pixels: (u32, u32)) -> Result<Self, CameraError> {
        let track = Track::new(pose, flight, pixels)?;
        Ok(Self { track, step: optics.step(pixels.0)? })
    }

    /// The same swath and way in other pixels.
    #[must_use]
    pub fn resampled(self, pixels: (u32, u32)) -> Self {
        let coarser = f64::from(self.track.pixels.0) / f64::from(pixels.0.max(1));
        Self { track: self.track.resampled(pixels), step: self.step * coarser }
    }

    fn offset(&self, x: f64) -> f64 {
        self.step * (x - 0.5 * f64::from(self.track.pixels.0))
    }
}

impl Camera for Pushbroom {
    fn pixels(&self) -> (u32, u32) {
        self.track.pixels
    }

    fn position(&self) -> DVec3 {
        self.track.position
    }

    fn ray(&self, x: f64, y: f64) -> CameraRay {
        let direction = WorldDir::new(self.track.forward + self.offset(x) * self.track.across);
        CameraRay { origin: self.track.at(y), direction }
    }

    fn ground(&self, height: f64) -> Option<GroundMap> {
        let track = &self.track;
        let above = track.position.z - height;
        (track.looks_down() && above > 0.0).then(|| {
            let [across, heading]: [DVec2; 2] = [track.across, track.heading].map(DVec3::truncate);
            GroundMap {
                corner: track.at(0.0).truncate() + above * self.offset(0.0) * across,
                across: above * self.step * across,
                down: track.advance * heading,
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flight::tests::{flight, nadir, on_ground};

    /// 1000 m up at 50 m/s and 100 lines a second: lines 0.5 m apart; 200 pixels over 2 atan(0.1) are 1 m each.
    #[test]
    fn pixels_lie_speed_over_line_rate_apart_along_and_pitch_over_focal_length_across() {
        let lens = Optics::FocalLength { focal_length: 0.01, pitch: 1e-5 };
        let scanner = Pushbroom::new(nadir(1000.0), flight(0.0), lens, (200, 400)).unwrap();
        for (x, y) in [(0.5, 0.5), (199.5, 0.5), (0.0, 400.0), (17.25, 233.5)] {
            // Flying north, x runs to the west and the lines to the north.
            let expected = DVec2::new(10.0 - (x - 100.0), 20.0 + 0.5 * (y - 0.5));
            assert!((on_ground(&scanner, x, y) - expected).length() < 1e-9, "{x} {y}");
        }
        assert_eq!(scanner.position(), DVec3::new(10.0, 20.0, 1000.0));
        assert_eq!(scanner.ray(3.0, 0.5).origin, scanner.position());
    }

    /// Flying south, the first pixel of the first line is the north-west one.
    #[test]
    fn flying_south_gives_a_map_with_north_at_the_top() {
        let heading = std::f64::consts::PI;
        let scanner = Pushbroom::new(nadir(1000.0), flight(heading), Optics::FieldOfView(0.2), (100, 100)).unwrap();
        let (first, right, below) =
            (on_ground(&scanner, 0.5, 0.5), on_ground(&scanner, 1.5, 0.5), on_ground(&scanner, 0.5, 1.5));
        assert!(right.x > first.x && (right.y - first.y).abs() < 1e-9);
        assert!(below.y < first.y && (below.x - first.x).abs() < 1e-9);
    }

    /// A map is what the rays say, at every heading; tilted or rolled there is none.
    #[test]
    fn the_ground_map_is_where_the_rays_fall() {
        for heading in [0.0, 0.7, 3.0, -2.0] {
            let scanner = Pushbroom::new(nadir(700.0), flight(heading), Optics::Ifov(1e-3), (64, 32)).unwrap();
            let map = scanner.ground(12.0).unwrap();
            for (x, y) in [(0.0, 0.0), (64.0, 0.0), (3.5, 31.5)] {
                let ray = scanner.ray(x, y);
                let at = ray.origin + ray.direction.vec() * ((12.0 - 700.0) / ray.direction.vec().z);
                assert!((map.at(x, y) - at.truncate()).length() < 1e-9);
            }
            assert!(scanner.ground(700.0).is_none());
        }
        let tilted = ScanPose::Attitude { position: DVec3::Z, depression: 1.2, roll: 0.0 };
        let rolled = ScanPose::Attitude { position: DVec3::Z, depression: 0.5 * std::f64::consts::PI, roll: 0.1 };
        for pose in [tilted, rolled] {
            assert!(Pushbroom::new(pose, flight(0.0), Optics::Ifov(1e-3), (9, 9)).unwrap().ground(0.0).is_none());
        }
    }

    #[test]
    fn other_pixels_keep_the_swath_and_the_way_flown() {
        let scanner = Pushbroom::new(nadir(900.0), flight(0.4), Optics::FieldOfView(0.5), (120, 90)).unwrap();
        let coarse = scanner.resampled((40, 30));
        let fine = scanner.resampled((240, 270));
        for (u, v) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.3, 0.8)] {
            let at = |s: &Pushbroom| on_ground(s, u * f64::from(s.pixels().0), v * f64::from(s.pixels().1));
            assert!((at(&coarse) - at(&scanner)).length() < 1e-9 && (at(&fine) - at(&scanner)).length() < 1e-9);
        }
    }
}
