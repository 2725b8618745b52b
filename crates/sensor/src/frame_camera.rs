//! The frame camera: a pinhole before a plane of square pixels.
//!
//! ```text
//! d(x, y) ∥ forward + p (x − n_x/2) right + p (y − n_y/2) down      p = pixel pitch over focal length
//! ```

use std::f64::consts::PI;

use glam::DVec3;
use sunglint_radiometry::WorldDir;

use crate::camera::{with_pixels, within};
use crate::pose::Axes;
use crate::{Camera, CameraError, CameraRay, FramePose, GroundMap};

/// How wide a frame camera or a scanner sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Optics {
    /// Angle between the left and the right edge of the image \[rad\], below π.
    FieldOfView(f64),
    /// Angle that a pixel in the middle of the image subtends \[rad\].
    Ifov(f64),
    /// Lens and detector.
    FocalLength {
        /// Focal length \[m\].
        focal_length: f64,
        /// Distance between pixels \[m\].
        pitch: f64,
    },
}

impl Optics {
    /// Pixel pitch over focal length, for an image of so many pixels across.
    pub(crate) fn step(self, across: u32) -> Result<f64, CameraError> {
        let below_180 = "above 0 and below 180 deg (pi rad)";
        Ok(match self {
            Self::FieldOfView(angle) => {
                within("field of view", angle, (0.0, PI), true, below_180)?;
                2.0 * (0.5 * angle).tan() / f64::from(across)
            }
            Self::Ifov(angle) => {
                within("instantaneous field of view", angle, (0.0, PI), true, below_180)?;
                2.0 * (0.5 * angle).tan()
            }
            Self::FocalLength { focal_length, pitch } => {
                within("focal length", focal_length, (0.0, f64::INFINITY), true, "above 0 m")?;
                within("pixel pitch", pitch, (0.0, f64::INFINITY), true, "above 0 m")?;
                pitch / focal_length
            }
        })
    }
}

/// A perspective camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameCamera {
    axes: Axes,
    pixels: (u32, u32),
    /// Pixel pitch over focal length.
    step: f64,
}

impl FrameCamera {
    /// From pose, optics and pixels (across, down).
    pub fn new(pose: FramePose, optics: Optics, pixels: (u32, u32)) -> Result<Self, CameraError> {
        with_pixels(pixels)?;
        let axes = pose.axes()?;
        let step = optics.step(pixels.0)?;
        Ok(Self { axes, pixels, step })
    }

    /// The same view in other pixels: as wide, its pixels still square.
    #[must_use]
    pub fn resampled(self, pixels: (u32, u32)) -> Self {
        let coarser = f64::from(self.pixels.0) / f64::from(pixels.0.max(1));
        Self { pixels, step: self.step * coarser, ..self }
    }

    /// Angles between opposite edges of the image, across and down \[rad\].
    pub fn field_of_view(&self) -> (f64, f64) {
        let angle = |n: u32| 2.0 * (0.5 * f64::from(n) * self.step).atan();
        (angle(self.pixels.0), angle(self.pixels.1))
    }

    /// Angle that a pixel in the middle of the image subtends \[rad\].
    pub fn ifov(&self) -> f64 {
        2.0 * (0.5 * self.step).atan()
    }
}

impl Camera for FrameCamera {
    fn pixels(&self) -> (u32, u32) {
        self.pixels
    }

    fn position(&self) -> DVec3 {
        self.axes.position
    }

    fn ray(&self, x: f64, y: f64) -> CameraRay {
        let Axes { position, forward, right, down } = self.axes;
        let across = self.step * (x - 0.5 * f64::from(self.pixels.0));
        let along = self.step * (y - 0.5 * f64::from(self.pixels.1));
        CameraRay { origin: position, direction: WorldDir::new(forward + across * right + along * down) }
    }

    fn ground(&self, height: f64) -> Option<GroundMap> {
        let above = self.axes.position.z - height;
        (self.axes.looks_down() && above > 0.0).then(|| self.axes.map(above * self.step, self.pixels))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    fn attitude(heading: f64, depression: f64, roll: f64) -> FramePose {
        let position = DVec3::new(5.0, -25.0, 15.0);
        let [heading, depression, roll] = [heading, depression, roll].map(f64::to_radians);
        FramePose::Attitude { position, heading, depression, roll }
    }

    fn camera(pose: FramePose) -> FrameCamera {
        FrameCamera::new(pose, Optics::FieldOfView(30f64.to_radians()), (320, 240)).unwrap()
    }

    /// Level and looking north with 90° across 4 × 2 pixels: the edges are at ±45°, the corner at (1, 1, ½).
    #[test]
    fn corner_and_middle_pixels_look_where_the_pinhole_says() {
        let camera = FrameCamera::new(attitude(0.0, 0.0, 0.0), Optics::FieldOfView(FRAC_PI_2), (4, 2)).unwrap();
        let towards = |x, y| camera.ray(x, y).direction.vec();
        assert!((towards(2.0, 1.0) - DVec3::Y).length() < 1e-15);
        assert!((towards(4.0, 0.0) - DVec3::new(1.0, 1.0, 0.5).normalize()).length() < 1e-15);
        assert!((towards(0.0, 2.0) - DVec3::new(-1.0, 1.0, -0.5).normalize()).length() < 1e-15);
        assert!((towards(0.5, 0.5) - DVec3::new(-0.75, 1.0, 0.25).normalize()).length() < 1e-15);
        assert_eq!(camera.ray(0.5, 0.5).origin, camera.position());
    }

    #[test]
    fn the_field_of_view_lies_between_the_left_and_right_edges() {
        for (pose, degrees) in [(attitude(200.0, 35.0, 20.0), 30.0_f64), (attitude(0.0, 90.0, 0.0), 120.0)] {
            let optics = Optics::FieldOfView(degrees.to_radians());
            let camera = FrameCamera::new(pose, optics, (321, 100)).unwrap();
            let between = camera.ray(0.0, 50.0).direction.angle_to(camera.ray(321.0, 50.0).direction);
            assert!((between - degrees.to_radians()).abs() < 1e-14);
            assert!((camera.field_of_view().0 - degrees.to_radians()).abs() < 1e-14);
        }
    }

    /// 9.9 µm pixels behind 50 mm: 198 µrad; the same camera by its ifov.
    #[test]
    fn focal_length_and_ifov_describe_the_same_camera() {
        let pose = attitude(10.0, 40.0, 0.0);
        let lens = Optics::FocalLength { focal_length: 0.05, pitch: 9.9e-6 };
        let by_lens = FrameCamera::new(pose, lens, (640, 480)).unwrap();
        assert!((by_lens.ifov() - 2.0 * (9.9e-6_f64 / 0.1).atan()).abs() < 1e-18);
        let middle = by_lens.ray(319.5, 240.0).direction.angle_to(by_lens.ray(320.5, 240.0).direction);
        assert!((middle / by_lens.ifov() - 1.0).abs() < 1e-9);
        let by_ifov = FrameCamera::new(pose, Optics::Ifov(by_lens.ifov()), (640, 480)).unwrap();
        assert!(by_ifov.ray(3.0, 7.0).direction.angle_to(by_lens.ray(3.0, 7.0).direction) < 1e-14);
    }

    #[test]
    fn heading_and_depression_equal_looking_at_a_point() {
        let (heading, depression) = (37f64.to_radians(), 28f64.to_radians());
        let position = DVec3::new(4.0e5, 4.7e6, 300.0);
        let line = DVec3::new(depression.cos() * heading.sin(), depression.cos() * heading.cos(), -depression.sin());
        for roll in [0.0, 0.4] {
            let a = camera(FramePose::Attitude { position, heading, depression, roll });
            let b = camera(FramePose::LookAt { position, look_at: position + 500.0 * line, roll });
            for (x, y) in [(0.0, 0.0), (160.0, 120.0), (320.0, 17.0)] {
                // Positions of 5e6 m hold 1e-9 m, seen from 500 m.
                assert!(a.ray(x, y).direction.angle_to(b.ray(x, y).direction) < 1e-11);
            }
        }
    }

    #[test]
    fn looking_straight_down_has_north_at_the_top_and_east_to_the_right() {
        let position = DVec3::new(0.1 + 0.2, 0.0, 100.0);
        let poses = [
            FramePose::Attitude { position, heading: 0.0, depression: FRAC_PI_2, roll: 0.0 },
            // 0.1 + 0.2 is not 0.3: a line that is vertical to rounding.
            FramePose::LookAt { position, look_at: DVec3::new(0.3, 0.0, 0.0), roll: 0.0 },
            FramePose::Target {
                look_at: DVec3::ZERO,
                standoff: crate::Standoff::Height(100.0),
                view_zenith: 0.0,
                view_azimuth: 2.0,
            },
        ];
        for pose in poses {
            let camera = camera(pose);
            let (top, right) = (camera.ray(160.0, 0.0).direction, camera.ray(320.0, 120.0).direction);
            assert!(top.vec().y > 0.1 && top.vec().x.abs() < 1e-12, "{pose:?}");
            assert!(right.vec().x > 0.1 && right.vec().y.abs() < 1e-12, "{pose:?}");
        }
    }

    #[test]
    fn a_horizontal_view_has_the_sky_at_the_top_and_roll_drops_its_right_side() {
        let level = camera(attitude(90.0, 0.0, 0.0));
        assert!(level.ray(160.0, 0.0).direction.cos_zenith() > 0.0);
        // Looking east, south is to the right.
        assert!(level.ray(320.0, 120.0).direction.vec().y < 0.0);
        let rolled = camera(attitude(90.0, 0.0, 20.0));
        assert!(rolled.ray(320.0, 120.0).direction.cos_zenith() < 0.0);
    }

    /// A satellite at view zenith 30°, azimuth 120°, 786 km above the target's level.
    #[test]
    fn a_target_is_seen_under_the_angles_asked_for() {
        let look_at = DVec3::new(10.0, 20.0, 5.0);
        let (view_zenith, view_azimuth) = (30f64.to_radians(), 120f64.to_radians());
        for standoff in [crate::Standoff::Height(786_005.0), crate::Standoff::Distance(786e3 / view_zenith.cos())] {
            let camera = camera(FramePose::Target { look_at, standoff, view_zenith, view_azimuth });
            let back = -camera.ray(160.0, 120.0).direction;
            assert!((back.zenith() - view_zenith).abs() < 1e-12 && (back.azimuth() - view_azimuth).abs() < 1e-12);
            assert!((camera.position().z - 786_005.0).abs() < 1e-8);
            assert!((camera.position() - look_at).normalize().distance(back.vec()) < 1e-12);
        }
    }

    #[test]
    fn numbers_that_make_no_camera_are_named() {
        let fault = |pose, optics, pixels| FrameCamera::new(pose, optics, pixels).unwrap_err().to_string();
        let (pose, optics) = (attitude(0.0, 30.0, 0.0), Optics::FieldOfView(0.5));
        assert!(fault(pose, optics, (0, 3)).contains("0 x 3"));
        assert!(fault(pose, Optics::FieldOfView(PI), (3, 3)).contains("field of view"));
        assert!(fault(pose, Optics::FieldOfView(f64::NAN), (3, 3)).contains("field of view"));
        assert!(fault(pose, Optics::Ifov(0.0), (3, 3)).contains("instantaneous"));
        assert!(fault(pose, Optics::FocalLength { focal_length: 0.0, pitch: 1e-6 }, (3, 3)).contains("focal length"));
        assert!(fault(pose, Optics::FocalLength { focal_length: 0.1, pitch: -1.0 }, (3, 3)).contains("pitch"));
        assert!(fault(attitude(0.0, 91.0, 0.0), optics, (3, 3)).contains("depression"));
        assert!(fault(attitude(f64::NAN, 1.0, 0.0), optics, (3, 3)).contains("heading"));
        let itself = FramePose::LookAt { position: DVec3::ONE, look_at: DVec3::ONE, roll: 0.0 };
        assert!(fault(itself, optics, (3, 3)).contains("own look_at"));
        let target = |view_zenith, standoff| FramePose::Target {
            look_at: DVec3::ZERO,
            standoff,
            view_zenith,
            view_azimuth: 0.0,
        };
        assert!(fault(target(0.1, crate::Standoff::Height(-1.0)), optics, (3, 3)).contains("not above its target"));
        assert!(fault(target(FRAC_PI_2, crate::Standoff::Height(1.0)), optics, (3, 3)).contains("distance"));
        assert!(fault(target(2.0, crate::Standoff::Distance(1.0)), optics, (3, 3)).contains("view zenith"));
    }
}
