//! Directions. World frame: x east, y north, z up; zenith from +z, azimuth clockwise from north. Local frame of a
//! surface: z along the normal. Directions at a surface point away from it, both of them.

use glam::DVec3;
use std::f64::consts::TAU;

/// A unit vector in the world frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WorldDir(DVec3);

impl WorldDir {
    /// Straight up.
    pub const UP: Self = Self(DVec3::Z);

    /// The direction of `v`, which must not be zero.
    pub fn new(v: DVec3) -> Self {
        Self(v.normalize())
    }
    /// From a vector that is already of unit length.
    pub const fn from_unit(v: DVec3) -> Self {
        Self(v)
    }
    /// From zenith angle and azimuth (clockwise from north) \[rad\].
    pub fn from_zenith_azimuth(zenith: f64, azimuth: f64) -> Self {
        let ((s, c), (sa, ca)) = (zenith.sin_cos(), azimuth.sin_cos());
        Self(DVec3::new(s * sa, s * ca, c))
    }
    /// As a unit vector.
    pub const fn vec(self) -> DVec3 {
        self.0
    }
    /// Zenith angle \[rad\], accurate near the zenith and the nadir too.
    pub fn zenith(self) -> f64 {
        self.0.x.hypot(self.0.y).atan2(self.0.z)
    }
    /// Azimuth, clockwise from north, in 0..2π \[rad\].
    pub fn azimuth(self) -> f64 {
        let azimuth = self.0.x.atan2(self.0.y);
        if azimuth < 0.0 { azimuth + TAU } else { azimuth }
    }
    /// Cosine of the zenith angle.
    pub fn cos_zenith(self) -> f64 {
        self.0.z
    }
    /// Cosine of the angle to another direction.
    pub fn dot(self, other: Self) -> f64 {
        self.0.dot(other.0)
    }
    /// Angle to another direction \[rad\], accurate when small.
    pub fn angle_to(self, other: Self) -> f64 {
        2.0 * (self.0 - other.0).length().atan2((self.0 + other.0).length())
    }
}

impl std::ops::Neg for WorldDir {
    type Output = Self;
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

/// A unit vector in the frame of a surface, z along the normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalDir(DVec3);

impl LocalDir {
    /// From a vector of unit length.
    pub const fn from_unit(v: DVec3) -> Self {
        Self(v)
    }
    /// From the angle to the normal and an azimuth about it \[rad\].
    pub fn from_polar(theta: f64, phi: f64) -> Self {
        let ((s, c), (sp, cp)) = (theta.sin_cos(), phi.sin_cos());
        Self(DVec3::new(s * cp, s * sp, c))
    }
    /// As a unit vector.
    pub const fn vec(self) -> DVec3 {
        self.0
    }
    /// Cosine of the angle to the normal; negative below the surface.
    pub fn cos(self) -> f64 {
        self.0.z
    }
    /// Angle to the normal \[rad\].
    pub fn theta(self) -> f64 {
        self.0.x.hypot(self.0.y).atan2(self.0.z)
    }
    /// Cosine of the angle to another direction.
    pub fn dot(self, other: Self) -> f64 {
        self.0.dot(other.0)
    }
    /// The mirror direction about the normal.
    #[must_use]
    pub fn mirrored(self) -> Self {
        Self(DVec3::new(-self.0.x, -self.0.y, self.0.z))
    }
}

/// Azimuth of `outgoing` minus azimuth of `incident` about the normal, in 0..π \[rad\]: 0 puts sun and sensor on the
/// same side (the hot spot), π is the forward side (glint).
pub fn relative_azimuth(incident: LocalDir, outgoing: LocalDir) -> f64 {
    let (i, o) = (incident.0.truncate(), outgoing.0.truncate());
    i.perp_dot(o).abs().atan2(i.dot(o))
}

/// A right-handed orthonormal frame about a normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    tangent: DVec3,
    bitangent: DVec3,
    normal: DVec3,
}

impl Frame {
    /// A frame whose z is `normal` (unit length); the tangents are those of Duff et al. 2017 (JCGT 6(1)), which have
    /// no singular direction.
    pub fn about(normal: DVec3) -> Self {
        let sign = 1f64.copysign(normal.z);
        let a = -1.0 / (sign + normal.z);
        let b = normal.x * normal.y * a;
        let tangent = DVec3::new(1.0 + sign * normal.x * normal.x * a, sign * b, -sign * normal.x);
        let bitangent = DVec3::new(b, sign + normal.y * normal.y * a, -normal.y);
        Self { tangent, bitangent, normal }
    }
    /// The normal.
    pub const fn normal(&self) -> DVec3 {
        self.normal
    }
    /// A world direction in this frame.
    pub fn to_local(&self, d: WorldDir) -> LocalDir {
        LocalDir(DVec3::new(d.0.dot(self.tangent), d.0.dot(self.bitangent), d.0.dot(self.normal)))
    }
    /// A local direction in the world.
    pub fn to_world(&self, d: LocalDir) -> WorldDir {
        WorldDir(d.0.x * self.tangent + d.0.y * self.bitangent + d.0.z * self.normal)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, PI};

    #[test]
    fn azimuth_zero_is_north() {
        let north = WorldDir::from_zenith_azimuth(FRAC_PI_2, 0.0);
        assert!(north.vec().abs_diff_eq(DVec3::Y, 1e-15));
    }

    #[test]
    fn azimuth_runs_clockwise_through_east() {
        let east = WorldDir::from_zenith_azimuth(FRAC_PI_2, FRAC_PI_2);
        assert!(east.vec().abs_diff_eq(DVec3::X, 1e-15));
        assert!((WorldDir::new(DVec3::NEG_X).azimuth() - 1.5 * PI).abs() < 1e-15);
    }

    #[test]
    fn hot_spot_is_at_relative_azimuth_zero() {
        let sun = LocalDir::from_polar(0.5, 1.0);
        assert!(relative_azimuth(sun, LocalDir::from_polar(0.2, 1.0)).abs() < 1e-12);
        assert!((relative_azimuth(sun, sun.mirrored()) - PI).abs() < 1e-12);
    }

    #[test]
    fn frames_are_orthonormal_for_every_normal() {
        for normal in [DVec3::Z, DVec3::NEG_Z, DVec3::X, DVec3::new(1.0, -2.0, -3.0).normalize()] {
            let frame = Frame::about(normal);
            assert!((frame.tangent.cross(frame.bitangent) - normal).length() < 1e-14);
            let d = WorldDir::new(DVec3::new(0.3, -0.2, 0.9));
            assert!((frame.to_world(frame.to_local(d)).vec() - d.vec()).length() < 1e-14);
        }
    }

    #[test]
    fn small_angles_keep_their_digits() {
        let a = WorldDir::from_zenith_azimuth(1e-9, 0.0);
        assert!((a.angle_to(WorldDir::UP) / 1e-9 - 1.0).abs() < 1e-6);
        assert!((a.zenith() / 1e-9 - 1.0).abs() < 1e-12);
    }
}
