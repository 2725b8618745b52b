//! Where a sensor stands and which way its image is turned.

use std::f64::consts::FRAC_PI_2;

use glam::DVec3;

use crate::camera::within;
use crate::{CameraError, GroundMap};

/// Where a sensor stands and where it looks; lengths in m, angles in rad, world frame.
///
/// The image's top is up, as far as the line of sight allows; looking straight down it is the heading, so that heading 0
/// has north at the top. `roll` turns the sensor about its line of sight, its right side down.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FramePose {
    /// At a position, looking at a point.
    LookAt {
        /// Where the sensor stands.
        position: DVec3,
        /// The point in the middle of the image.
        look_at: DVec3,
        /// Right side down.
        roll: f64,
    },
    /// At a position, by angles.
    Attitude {
        /// Where the sensor stands.
        position: DVec3,
        /// Azimuth of the line of sight, clockwise from north.
        heading: f64,
        /// Angle of the line of sight below the horizontal, −π/2..π/2.
        depression: f64,
        /// Right side down.
        roll: f64,
    },
    /// Such that a target is seen under given angles.
    Target {
        /// The point in the middle of the image.
        look_at: DVec3,
        /// How far away the sensor is.
        standoff: Standoff,
        /// Zenith angle of the direction from the target to the sensor.
        view_zenith: f64,
        /// Azimuth of the direction from the target to the sensor, clockwise from north.
        view_azimuth: f64,
    },
}

/// How far a sensor is from its target \[m\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Standoff {
    /// Height z of the sensor in the world frame. An altitude above sea level less the site's elevation.
    Height(f64),
    /// Distance along the line of sight.
    Distance(f64),
}

/// A sensor's place and the directions of its image, unit vectors in the world frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Axes {
    pub position: DVec3,
    pub forward: DVec3,
    pub right: DVec3,
    pub down: DVec3,
}

impl FramePose {
    pub(crate) fn axes(&self) -> Result<Axes, CameraError> {
        let finite = |what, v: DVec3| if v.is_finite() { Ok(()) } else { Err(CameraError::NotFinite(what)) };
        match *self {
            Self::LookAt { position, look_at, roll } => {
                finite("position", position)?;
                finite("look_at", look_at)?;
                within("roll", roll, FINITE, false, "among finite angles")?;
                let line = look_at - position;
                let (length, level) = (line.length(), line.truncate().length());
                if length == 0.0 {
                    return Err(CameraError::LookAtItself);
                }
                // A line that is vertical to rounding has no heading: north is at the top.
                let heading = if level > 1e-9 * length { (line.x / level, line.y / level) } else { (0.0, 1.0) };
                let level = if level > 1e-9 * length { level } else { 0.0 };
                Ok(Axes::new(position, heading, (-line.z / length, level / length), roll))
            }
            Self::Attitude { position, heading, depression, roll } => {
                finite("position", position)?;
                within("heading", heading, FINITE, false, "among finite angles")?;
                within("roll", roll, FINITE, false, "among finite angles")?;
                let range = "between -90 and 90 deg (pi/2 rad)";
                within("depression", depression, (-FRAC_PI_2 - 1e-12, FRAC_PI_2 + 1e-12), false, range)?;
                Ok(Axes::new(position, heading.sin_cos(), depression.sin_cos(), roll))
            }
            Self::Target { look_at, standoff, view_zenith, view_azimuth } => {
                finite("look_at", look_at)?;
                within("view azimuth", view_azimuth, FINITE, false, "among finite angles")?;
                within("view zenith", view_zenith, (0.0, FRAC_PI_2), false, "between 0 and 90 deg (pi/2 rad)")?;
                let (sin_z, cos_z) = view_zenith.sin_cos();
                let (sin_a, cos_a) = view_azimuth.sin_cos();
                let distance = match standoff {
                    Standoff::Distance(distance) => distance,
                    Standoff::Height(z) if z > look_at.z => (z - look_at.z) / cos_z,
                    Standoff::Height(z) => return Err(CameraError::BelowTarget { sensor: z, target: look_at.z }),
                };
                // A view zenith of 90° never reaches a height above the target.
                within("distance to the target", distance, (0.0, 1e12), true, "above 0 m and below 1e12 m")?;
                let position = look_at + distance * DVec3::new(sin_z * sin_a, sin_z * cos_a, cos_z);
                // Looking back along the view azimuth; straight down, north is at the top.
                let heading = if sin_z > 1e-9 { (-sin_a, -cos_a) } else { (0.0, 1.0) };
                Ok(Axes::new(position, heading, (cos_z, sin_z), 0.0))
            }
        }
    }
}

const FINITE: (f64, f64) = (f64::MIN, f64::MAX);

impl Axes {
    /// From (sin, cos) of heading and depression.
    fn new(position: DVec3, heading: (f64, f64), depression: (f64, f64), roll: f64) -> Self {
        let ((sh, ch), (sd, cd), (sr, cr)) = (heading, depression, roll.sin_cos());
        let forward = DVec3::new(cd * sh, cd * ch, -sd);
        let level_right = DVec3::new(ch, -sh, 0.0);
        let level_down = -DVec3::new(sd * sh, sd * ch, cd);
        Self { position, forward, right: cr * level_right + sr * level_down, down: cr * level_down - sr * level_right }
    }

    /// Whether the line of sight is straight down.
    pub(crate) fn looks_down(&self) -> bool {
        self.forward.truncate().length() < 1e-9 && self.forward.z < 0.0
    }

    /// The map of a sensor that looks straight down, its pixels `ground_sample` \[m\] wide.
    pub(crate) fn map(&self, ground_sample: f64, pixels: (u32, u32)) -> GroundMap {
        let (across, down) = (ground_sample * self.right.truncate(), ground_sample * self.down.truncate());
        let (n_x, n_y) = (f64::from(pixels.0), f64::from(pixels.1));
        GroundMap { corner: self.position.truncate() - 0.5 * (n_x * across + n_y * down), across, down }
    }
}
