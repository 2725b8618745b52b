//! The orthographic view: parallel lines of sight from a plane across the line of sight.

use glam::DVec3;
use sunglint_radiometry::WorldDir;

use crate::camera::{with_pixels, within};
use crate::pose::Axes;
use crate::{Camera, CameraError, CameraRay, FramePose, GroundMap};

/// How much an orthographic view covers, measured across the line of sight (on level ground if it looks straight down).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Extent {
    /// Width of the image \[m\].
    Swath(f64),
    /// Width of a pixel \[m\].
    GroundSample(f64),
}

/// A camera with parallel lines of sight, as maps have and distant sensors nearly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orthographic {
    axes: Axes,
    pixels: (u32, u32),
    ground_sample: f64,
}

impl Orthographic {
    /// From pose, extent and pixels (across, down). The middle of the image looks along the pose's line of sight.
    pub fn new(pose: FramePose, extent: Extent, pixels: (u32, u32)) -> Result<Self, CameraError> {
        with_pixels(pixels)?;
        let axes = pose.axes()?;
        let (what, length) = match extent {
            Extent::Swath(length) => ("swath", length),
            Extent::GroundSample(length) => ("ground sample", length),
        };
        within(what, length, (0.0, f64::INFINITY), true, "above 0 m")?;
        let ground_sample = match extent {
            Extent::Swath(swath) => swath / f64::from(pixels.0),
            Extent::GroundSample(length) => length,
        };
        Ok(Self { axes, pixels, ground_sample })
    }

    /// Width of a pixel \[m\].
    pub fn ground_sample(&self) -> f64 {
        self.ground_sample
    }

    /// Width and height of the image \[m\].
    pub fn footprint(&self) -> (f64, f64) {
        (f64::from(self.pixels.0) * self.ground_sample, f64::from(self.pixels.1) * self.ground_sample)
    }
}

impl Camera for Orthographic {
    fn pixels(&self) -> (u32, u32) {
        self.pixels
    }

    fn position(&self) -> DVec3 {
        self.axes.position
    }

    fn ray(&self, x: f64, y: f64) -> CameraRay {
        let Axes { position, forward, right, down } = self.axes;
        let across = self.ground_sample * (x - 0.5 * f64::from(self.pixels.0));
        let along = self.ground_sample * (y - 0.5 * f64::from(self.pixels.1));
        CameraRay { origin: position + across * right + along * down, direction: WorldDir::from_unit(forward) }
    }

    fn ground(&self, _height: f64) -> Option<GroundMap> {
        self.axes.looks_down().then(|| self.axes.map(self.ground_sample, self.pixels))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Standoff;
    use std::f64::consts::FRAC_PI_2;

    /// 200 × 100 pixels over a swath of 50 m: 0.25 m a pixel, north at the top.
    #[test]
    fn an_overhead_view_covers_its_swath_with_north_at_the_top() {
        let position = DVec3::new(100.0, 200.0, 1000.0);
        let pose = FramePose::Attitude { position, heading: 0.0, depression: FRAC_PI_2, roll: 0.0 };
        let view = Orthographic::new(pose, Extent::Swath(50.0), (200, 100)).unwrap();
        assert_eq!((view.ground_sample(), view.footprint(), view.position()), (0.25, (50.0, 25.0), position));
        let corner = view.ray(0.0, 0.0);
        assert!((corner.origin - DVec3::new(75.0, 212.5, 1000.0)).length() < 1e-12);
        assert!((corner.direction.vec() - DVec3::NEG_Z).length() < 1e-15);
        let first = view.ray(0.5, 0.5).origin;
        assert!((first - DVec3::new(75.125, 212.375, 1000.0)).length() < 1e-12);
        let map = view.ground(0.0).unwrap();
        assert!((map.at(0.0, 0.0) - corner.origin.truncate()).length() < 1e-12);
        assert!((map.at(0.5, 0.5) - first.truncate()).length() < 1e-12);
        let same = Orthographic::new(pose, Extent::GroundSample(0.25), (200, 100)).unwrap();
        assert_eq!(same, view);
    }

    /// Seen from the south at 60° zenith, a pixel of 1 m covers 2 m of level ground in y.
    #[test]
    fn a_slanted_view_stretches_over_the_ground_by_the_secant() {
        let pose = FramePose::Target {
            look_at: DVec3::new(3.0, 4.0, 0.0),
            standoff: Standoff::Distance(500.0),
            view_zenith: 60f64.to_radians(),
            view_azimuth: std::f64::consts::PI,
        };
        let view = Orthographic::new(pose, Extent::GroundSample(1.0), (10, 10)).unwrap();
        let ground = |x, y| {
            let ray = view.ray(x, y);
            ray.origin - ray.direction.vec() * (ray.origin.z / ray.direction.cos_zenith())
        };
        assert!((ground(5.0, 5.0) - DVec3::new(3.0, 4.0, 0.0)).length() < 1e-10);
        assert!((ground(5.0, 4.0) - DVec3::new(3.0, 6.0, 0.0)).length() < 1e-10);
        assert!((ground(6.0, 5.0) - DVec3::new(4.0, 4.0, 0.0)).length() < 1e-10);
        assert_eq!(view.ray(0.0, 0.0).direction, view.ray(9.0, 3.0).direction);
    }

    #[test]
    fn an_extent_that_is_no_length_is_refused() {
        let pose = FramePose::LookAt { position: DVec3::Z, look_at: DVec3::ZERO, roll: 0.0 };
        for extent in [Extent::Swath(0.0), Extent::Swath(f64::INFINITY), Extent::GroundSample(f64::NAN)] {
            assert!(Orthographic::new(pose, extent, (4, 4)).is_err());
        }
        assert!(Orthographic::new(pose, Extent::Swath(1.0), (4, 0)).is_err());
    }
}
