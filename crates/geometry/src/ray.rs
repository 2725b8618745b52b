//! Rays and hits.

use crate::MaterialId;
use glam::DVec3;
use sunglint_radiometry::WorldDir;

/// Object id of the endless ground in [`Hit::instance`].
pub const GROUND_OBJECT: u32 = u32::MAX;

/// A plane facet as the world traces it, which a ray that leaves it cannot meet again; [`Left::NONE`] where there is none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Left {
    /// What is placed, and the facet of its mesh.
    pub(crate) placed: u32,
    pub(crate) facet: u32,
}

impl Left {
    /// No facet.
    pub const NONE: Self = Self { placed: u32::MAX, facet: u32::MAX };
}

/// A ray. Hits count in 0 < t < `t_max`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Start \[m\].
    pub origin: DVec3,
    /// Unit direction.
    pub direction: WorldDir,
    /// End \[m\].
    pub t_max: f64,
    /// The facet that it leaves, and does not meet.
    pub left: Left,
}

impl Ray {
    /// An endless ray.
    pub const fn new(origin: DVec3, direction: WorldDir) -> Self {
        Self { origin, direction, t_max: f64::INFINITY, left: Left::NONE }
    }
    /// The point at distance `t` \[m\].
    pub fn at(&self, t: f64) -> DVec3 {
        self.origin + self.direction.vec() * t
    }
}

/// A facet of the world: its instance's first facet plus its index in the mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct FacetId(pub u32);

impl FacetId {
    /// The endless ground.
    pub const GROUND: Self = Self(u32::MAX);
}

/// Where a ray meets a facet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance along the ray \[m\].
    pub t: f64,
    /// The point, from the facet's corners and not from `t`, so that its error does not grow with the distance.
    pub point: DVec3,
    /// Bound on the distance of `point` from the true facet, for rays that meet it there or start from it \[m\].
    pub error: f64,
    /// Unit normal of the facet, turned towards the ray's origin.
    pub normal: DVec3,
    /// Whether the front was met.
    pub front: bool,
    /// Material of the facet.
    pub material: MaterialId,
    /// Object id, [`GROUND_OBJECT`] for the ground.
    pub instance: u32,
    /// The facet.
    pub facet: FacetId,
    /// What a ray leaves that starts here.
    pub left: Left,
}

impl Hit {
    /// The endless ray from here towards `direction`, started beyond the error bound on that side of the facet.
    pub fn leave(&self, direction: WorldDir) -> Ray {
        let side = if direction.vec().dot(self.normal) >= 0.0 { self.normal } else { -self.normal };
        let moved = self.point + side * self.error;
        // Round away from the facet, as the sum may have been rounded towards it [PBRT 4e, section 6.8.6].
        let away = |p: f64, n: f64| {
            if n > 0.0 {
                p.next_up()
            } else if n < 0.0 {
                p.next_down()
            } else {
                p
            }
        };
        let origin = DVec3::new(away(moved.x, side.x), away(moved.y, side.y), away(moved.z, side.z));
        Ray { left: self.left, ..Ray::new(origin, direction) }
    }
}
