//! Proofs that rays are stopped, so that they need not be cast. Every answer true is proven, false may mean not proven.

use glam::DVec3;
use sunglint_radiometry::WorldDir;

use crate::Facet;
use crate::sole::edges;
use crate::world::{Occluder, World};

/// Shares of all lengths by which a facet is taken narrower than it is, and a cone wider.
const NARROWER: f64 = 1e-9;
/// Cosine below which a facet is seen along its edge.
const LEAST_COS: f64 = 1e-6;

impl World {
    /// Whether the facet that `occluder` is of stops every ray from a box into the cone of half-angle `spread` \[rad\] about
    /// `direction`: where it is plane and convex and the lines from the box's corners along those of a pyramid about the cone all
    /// pass through it, so do all between them, since lines through a point map what is straight to what is straight.
    pub fn is_hidden_by(
        &self,
        occluder: &Occluder,
        (lo, hi): (DVec3, DVec3),
        direction: WorldDir,
        spread: f64,
    ) -> bool {
        let Some(Facet { corners, normal, .. }) = self.occluding_facet(occluder) else { return false };
        if spread.is_nan() || spread >= 1.0 {
            return false;
        }
        let size = [lo, hi].iter().chain(&corners).map(|p| p.abs().max_element()).fold(1.0, f64::max);
        let margin = NARROWER * size;
        if corners.iter().any(|c| normal.dot(*c - corners[0]).abs() > margin) {
            return false;
        }
        let Some(edges) = edges(&corners, normal) else { return false };
        let axis = direction.vec();
        let (u, v) = axis.any_orthonormal_pair();
        let half = spread.tan() * (1.0 + NARROWER) + NARROWER;
        let lines = [(-half, -half), (half, -half), (half, half), (-half, half)].map(|(x, y)| axis + x * u + y * v);
        let across = lines.map(|line| normal.dot(line));
        if !(across.iter().all(|c| *c > LEAST_COS) || across.iter().all(|c| *c < -LEAST_COS)) {
            return false;
        }
        let bounds = [lo, hi];
        (0..8).all(|i| {
            let from = DVec3::new(bounds[i & 1].x, bounds[i >> 1 & 1].y, bounds[i >> 2].z);
            let above = normal.dot(corners[0] - from);
            lines.iter().zip(across).all(|(line, across)| {
                let t = above / across;
                let met = from + t * *line;
                t > margin && edges.iter().all(|(axis, least)| axis.dot(met) > least + margin)
            })
        })
    }
}
