//! Objects placed in the world.

use glam::{DAffine3, DMat3, DVec3};

/// Where an object stands: applied as scale, roll, pitch, heading, at. Angles in rad; object frame x right, y ahead, z up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// World position of the object's origin \[m\].
    pub at: DVec3,
    /// Where +y points, clockwise from north.
    pub heading: f64,
    /// Nose up: about +x, from +y towards +z.
    pub pitch: f64,
    /// Right wing down: about +y, from +x towards −z.
    pub roll: f64,
    /// Factor on all lengths.
    pub scale: f64,
}

impl Default for Pose {
    fn default() -> Self {
        Self { at: DVec3::ZERO, heading: 0.0, pitch: 0.0, roll: 0.0, scale: 1.0 }
    }
}

impl Pose {
    /// World from object. Multiples of 90° turn axes into axes exactly.
    pub fn matrix(&self) -> DAffine3 {
        let (s, c) = sin_cos(self.heading);
        let heading = DMat3::from_cols_array(&[c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0]);
        let (s, c) = sin_cos(self.pitch);
        let pitch = DMat3::from_cols_array(&[1.0, 0.0, 0.0, 0.0, c, s, 0.0, -s, c]);
        let (s, c) = sin_cos(self.roll);
        let roll = DMat3::from_cols_array(&[c, 0.0, -s, 0.0, 1.0, 0.0, s, 0.0, c]);
        DAffine3 { matrix3: heading * pitch * roll * self.scale, translation: self.at }
    }
    /// A point of the object in the world.
    pub fn apply(&self, point: DVec3) -> DVec3 {
        self.matrix().transform_point3(point)
    }
}

/// Sine and cosine, exact at multiples of a right angle: a wall turned by 90 deg stays a plane x = const.
fn sin_cos(angle: f64) -> (f64, f64) {
    let (s, c) = angle.sin_cos();
    let clean = |x: f64| {
        if x.abs() < 1e-15 {
            0.0
        } else if x.abs() > 1.0 - 1e-15 {
            x.signum()
        } else {
            x
        }
    };
    if clean(s) == 0.0 || clean(c) == 0.0 { (clean(s), clean(c)) } else { (s, c) }
}

/// One placement of a mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct Instance {
    /// Index of the mesh.
    pub mesh: usize,
    /// World from object; may stretch and mirror.
    pub pose: DAffine3,
    /// Name for messages and reports.
    pub name: String,
    /// Object id in truth maps.
    pub id: u32,
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    #[test]
    fn heading_turns_clockwise_pitch_lifts_the_nose_and_roll_drops_the_right_wing() {
        let turned =
            |pose: Pose, v: DVec3, w: DVec3| assert!((pose.apply(v) - w).length() < 1e-15, "{:?}", pose.apply(v));
        turned(Pose { heading: FRAC_PI_2, ..Pose::default() }, DVec3::Y, DVec3::X);
        turned(Pose { pitch: FRAC_PI_2, ..Pose::default() }, DVec3::Y, DVec3::Z);
        turned(Pose { roll: FRAC_PI_2, ..Pose::default() }, DVec3::X, DVec3::NEG_Z);
    }

    /// The nose of an aircraft on heading 90° pitched up 30° at scale 2: east and up, its wings level.
    #[test]
    fn pose_applies_scale_roll_pitch_heading_at_in_this_order() {
        let pose = Pose {
            at: DVec3::new(10.0, 20.0, 30.0),
            heading: FRAC_PI_2,
            pitch: 30f64.to_radians(),
            roll: 0.0,
            scale: 2.0,
        };
        let nose = pose.apply(DVec3::Y) - pose.at;
        assert!((nose - DVec3::new(3f64.sqrt(), 0.0, 1.0)).length() < 1e-14);
        let wing = pose.apply(DVec3::X) - pose.at;
        assert!((wing - DVec3::new(0.0, -2.0, 0.0)).length() < 1e-14);
    }
}
