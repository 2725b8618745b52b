//! How a scanner flies and where it looks: level and straight, line after line.
//!
//! ```text
//! s(y) = (y − ½) v/f                where the sensor stands along its heading h, at line coordinate y
//! l    = cos d h + sin d (cos r n − sin r e)     the line of sight in the middle of a line: depression d, roll r,
//!                                                n down, e to the right of the flight
//! ```
//!
//! Lines run down the image in the order of time, so the flight runs down the image; x therefore runs from the right of the
//! flight to its left, as in any picture that is not mirrored. Flying south, north is at the top and west at the left.

use std::f64::consts::PI;

use glam::DVec3;

use crate::camera::{with_pixels, within};
use crate::{CameraError, FramePose, Standoff};

/// A scanner's motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flight {
    /// Azimuth of the flight, clockwise from north \[rad\].
    pub heading: f64,
    /// Over the ground, level \[m/s\].
    pub speed: f64,
    /// Lines per second \[Hz\].
    pub line_rate: f64,
}

/// Where a scanner stands at the middle of its first line, and where the middle of that line looks; lengths in m, angles
/// in rad, world frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ScanPose {
    /// By angles.
    Attitude {
        /// Where the sensor stands.
        position: DVec3,
        /// Below the horizontal: π/2 is straight down, less looks ahead, more looks back; 0..π, both excluded.
        depression: f64,
        /// About the flight, right side down: the line of sight swings to the left.
        roll: f64,
    },
    /// At a point.
    LookAt {
        /// Where the sensor stands.
        position: DVec3,
        /// What the middle of the first line sees.
        look_at: DVec3,
    },
    /// Such that a target is seen under given angles.
    Target {
        /// What the middle of the first line sees.
        look_at: DVec3,
        /// How far away the sensor is.
        standoff: Standoff,
        /// Zenith angle of the direction from the target to the sensor.
        view_zenith: f64,
        /// Azimuth of that direction, clockwise from north.
        view_azimuth: f64,
    },
}

/// A scanner's lines: where each is taken from, and the directions of the image; unit vectors in the world frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Track {
    /// Of the sensor at the middle of the first line.
    pub position: DVec3,
    pub heading: DVec3,
    /// Line of sight in the middle of a line.
    pub forward: DVec3,
    /// Along a line, to the left of the flight.
    pub across: DVec3,
    /// Across both, on the side of the flight.
    pub along: DVec3,
    pub pixels: (u32, u32),
    /// Along the heading at the top edge of the image \[m\].
    pub start: f64,
    /// Way between lines \[m\].
    pub advance: f64,
}

impl Track {
    pub fn new(pose: ScanPose, flight: Flight, pixels: (u32, u32)) -> Result<Self, CameraError> {
        const ANY: (f64, f64) = (f64::MIN, f64::MAX);
        const MOST: f64 = 1e9;
        with_pixels(pixels)?;
        let Flight { heading, speed, line_rate } = flight;
        within("heading", heading, ANY, false, "among finite angles")?;
        within("speed", speed, (0.0, MOST), true, "above 0 m/s and below 1e9 m/s")?;
        within("line rate", line_rate, (0.0, MOST), true, "above 0 Hz and below 1e9 Hz")?;
        let advance = speed / line_rate;
        within("way between lines", advance, (0.0, MOST), true, "above 0 m and below 1e9 m")?;
        let (sin, cos) = heading.sin_cos();
        let heading = DVec3::new(sin, cos, 0.0);
        let looking = |position: DVec3, look_at: DVec3| {
            if !(position.is_finite() && look_at.is_finite()) {
                return Err(CameraError::NotFinite("position or look_at"));
            }
            (look_at - position).try_normalize().ok_or(CameraError::LookAtItself)
        };
        let (position, forward) = match pose {
            ScanPose::Attitude { position, depression, roll } => {
                if !position.is_finite() {
                    return Err(CameraError::NotFinite("position"));
                }
                within("roll", roll, ANY, false, "among finite angles")?;
                within("depression", depression, (0.0, PI), true, "above 0 and below 180 deg (pi rad)")?;
                let right = DVec3::new(cos, -sin, 0.0);
                let ((sin_d, cos_d), (sin_r, cos_r)) = (depression.sin_cos(), roll.sin_cos());
                (position, cos_d * heading + sin_d * (cos_r * DVec3::NEG_Z - sin_r * right))
            }
            ScanPose::LookAt { position, look_at } => (position, looking(position, look_at)?),
            ScanPose::Target { look_at, standoff, view_zenith, view_azimuth } => {
                let pose = FramePose::Target { look_at, standoff, view_zenith, view_azimuth };
                let axes = pose.axes()?;
                (axes.position, axes.forward)
            }
        };
        let sideways = heading.cross(forward);
        if sideways.length() < 1e-9 {
            return Err(CameraError::AlongTheFlight);
        }
        let across = sideways.normalize();
        let along = forward.cross(across);
        Ok(Self { position, heading, forward, across, along, pixels, start: -0.5 * advance, advance })
    }

    /// The same way and swath in other pixels.
    #[must_use]
    pub fn resampled(self, pixels: (u32, u32)) -> Self {
        let coarser = f64::from(self.pixels.1) / f64::from(pixels.1.max(1));
        Self { pixels, advance: self.advance * coarser, ..self }
    }

    /// Where the sensor stands at a line coordinate.
    pub fn at(&self, y: f64) -> DVec3 {
        self.position + (self.start + self.advance * y) * self.heading
    }

    /// Whether the middle of a line is straight below.
    pub fn looks_down(&self) -> bool {
        self.forward.truncate().length() < 1e-9 && self.forward.z < 0.0
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::Camera;
    use glam::DVec2;
    use std::f64::consts::FRAC_PI_2;

    /// 50 m/s and 100 lines a second.
    pub(crate) fn flight(heading: f64) -> Flight {
        Flight { heading, speed: 50.0, line_rate: 100.0 }
    }

    /// Straight down from a height above (10, 20).
    pub(crate) fn nadir(height: f64) -> ScanPose {
        ScanPose::Attitude { position: DVec3::new(10.0, 20.0, height), depression: FRAC_PI_2, roll: 0.0 }
    }

    /// Where a line of sight meets z = 0.
    pub(crate) fn on_ground(camera: &dyn Camera, x: f64, y: f64) -> DVec2 {
        let ray = camera.ray(x, y);
        (ray.origin - ray.direction.vec() * (ray.origin.z / ray.direction.vec().z)).truncate()
    }

    /// Depression below 90° looks ahead, beyond it back; the right side down looks to the left.
    #[test]
    fn tilt_looks_along_the_flight_and_roll_to_its_side() {
        let towards = |heading, depression: f64, roll: f64| {
            let (depression, roll) = (depression.to_radians(), roll.to_radians());
            Track::new(ScanPose::Attitude { position: DVec3::Z, depression, roll }, flight(heading), (3, 3)).unwrap()
        };
        let close = |a: DVec3, b: DVec3| (a - b).length() < 1e-15;
        let half = 0.5f64.sqrt();
        assert!(close(towards(0.0, 45.0, 0.0).forward, DVec3::new(0.0, half, -half)));
        assert!(close(towards(0.0, 135.0, 0.0).forward, DVec3::new(0.0, -half, -half)));
        assert!(close(towards(0.0, 90.0, 45.0).forward, DVec3::new(-half, 0.0, -half)));
        assert!(close(towards(FRAC_PI_2, 90.0, 0.0).across, DVec3::Y));
        assert!(close(towards(0.0, 60.0, 0.0).across, DVec3::NEG_X));
        assert!(towards(1.0, 90.0, 0.0).looks_down() && !towards(1.0, 89.0, 0.0).looks_down());
    }

    /// The middle of the first line meets the point, whatever the heading; the line runs square to the flight.
    #[test]
    fn looking_at_a_point_is_the_attitude_that_meets_it() {
        let (position, look_at) = (DVec3::new(5.0, -3.0, 800.0), DVec3::new(105.0, 40.0, 2.0));
        for heading in [0.0, 1.0, 4.0] {
            let track = Track::new(ScanPose::LookAt { position, look_at }, flight(heading), (3, 3)).unwrap();
            assert!((track.at(0.5) - position).length() < 1e-12);
            assert!(track.forward.angle_between(look_at - position) < 1e-7);
            assert!(track.across.dot(track.heading).abs() < 1e-15 && track.along.dot(track.heading) > 0.0);
        }
        let standoff = Standoff::Height(802.0);
        let pose = ScanPose::Target { look_at, standoff, view_zenith: 0.3, view_azimuth: 2.0 };
        let track = Track::new(pose, flight(0.7), (3, 3)).unwrap();
        let reached = track.position + track.forward * (800.0 / 0.3f64.cos());
        assert!((reached - look_at).length() < 1e-9);
    }

    #[test]
    fn a_scanner_that_looks_where_it_flies_or_stands_still_is_refused() {
        let fault = |pose, flight| Track::new(pose, flight, (3, 3)).unwrap_err().to_string();
        let ahead = ScanPose::LookAt { position: DVec3::ZERO, look_at: DVec3::Y };
        assert!(fault(ahead, flight(0.0)).contains("along its flight"));
        assert!(fault(nadir(1.0), Flight { speed: 0.0, ..flight(0.0) }).contains("speed"));
        assert!(fault(nadir(1.0), Flight { line_rate: f64::NAN, ..flight(0.0) }).contains("line rate"));
        assert!(fault(nadir(1.0), Flight { speed: 9e8, line_rate: 1e-9, heading: 0.0 }).contains("between lines"));
        let level = ScanPose::Attitude { position: DVec3::Z, depression: 0.0, roll: 0.0 };
        assert!(fault(level, flight(0.0)).contains("depression"));
        assert!(Track::new(nadir(1.0), flight(0.0), (3, 0)).is_err());
    }
}
