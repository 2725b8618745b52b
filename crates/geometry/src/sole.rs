//! The only facet that the rays of a bundle meet, so that they need not be cast.

use glam::DVec3;
use sunglint_radiometry::WorldDir;

use crate::{FacetId, Hit, Ray, World};

/// A facet of which a region is the first thing that rays from a cone of directions meet.
#[derive(Clone, Debug)]
pub struct SoleFacet {
    /// What all rays have in common of a hit.
    hit: Hit,
    /// The region.
    lo: DVec3,
    hi: DVec3,
    /// Towards where the rays come from, and the cosine of the largest angle to it.
    towards: DVec3,
    cos_spread: f64,
    /// Unit normals of the facet's edges, inwards, and how far along them the facet begins.
    edges: Vec<(DVec3, f64)>,
}

/// Shares by which region and cone are taken wider than the rays that span them.
const WIDER: f64 = 1e-6;

impl SoleFacet {
    /// From rays that span the bundle, as those to the corners of a rectangle of the image do; `None` where they do not meet one
    /// side of one convex facet, or where it is not proved that nothing stands before it.
    pub fn of(world: &World, rays: &[Ray]) -> Option<Self> {
        let hits: Vec<Hit> = rays.iter().map(|ray| world.closest(ray)).collect::<Option<_>>()?;
        Self::of_hits(world, rays, &hits)
    }

    /// The same where it is known what each of the rays meets.
    pub fn of_hits(world: &World, rays: &[Ray], hits: &[Hit]) -> Option<Self> {
        let first = *hits.first()?;
        let is_same = |hit: &Hit| hit.facet == first.facet && hit.front == first.front && hit.normal == first.normal;
        if !hits.iter().all(is_same) || rays.iter().any(|ray| ray.t_max != f64::INFINITY) {
            return None;
        }
        let edges = match first.facet {
            FacetId::GROUND => Vec::new(),
            id => {
                let corners = world.facet(id).corners;
                let off = |c: &DVec3| first.normal.dot(*c - first.point).abs();
                if corners.iter().any(|c| off(c) > 8.0 * first.error) {
                    return None;
                }
                edges(&corners, first.normal)?
            }
        };
        let (lo, hi) =
            hits.iter().fold((first.point, first.point), |(lo, hi), hit| (lo.min(hit.point), hi.max(hit.point)));
        let error = 2.0 * hits.iter().map(|hit| hit.error).fold(0.0, f64::max);
        let margin = WIDER * (hi - lo).max_element() + error;
        let (lo, hi) = (lo - DVec3::splat(margin), hi + DVec3::splat(margin));
        let towards = -rays.iter().map(|ray| ray.direction.vec()).sum::<DVec3>().try_normalize()?;
        let spread = rays.iter().map(|ray| towards.angle_between(-ray.direction.vec())).fold(0.0, f64::max);
        let spread = spread * (1.0 + WIDER) + 1e-9;
        let direction = WorldDir::from_unit(towards);
        let own = Some((first.facet, 2.0 * margin));
        world.shaft_is_clear_beside(own, lo, hi, first.point, first.normal, direction, spread).then(|| Self {
            hit: Hit { error, ..first },
            lo,
            hi,
            towards,
            cos_spread: spread.cos(),
            edges,
        })
    }

    /// The hit of a ray; `None` where it is not surely of the bundle.
    pub fn meet(&self, ray: &Ray) -> Option<Hit> {
        let (o, d) = (ray.origin, ray.direction.vec());
        let Hit { normal, point: anchor, error, .. } = self.hit;
        if d.dot(self.towards) > -self.cos_spread {
            return None;
        }
        let t = normal.dot(anchor - o) / normal.dot(d);
        let point = o + t * d;
        let point = point - normal * normal.dot(point - anchor);
        let inside = t > 0.0
            && t < ray.t_max
            && point.cmpge(self.lo).all()
            && point.cmple(self.hi).all()
            && self.edges.iter().all(|(axis, least)| axis.dot(point) > least + 4.0 * error);
        inside.then_some(Hit { t, point, ..self.hit })
    }
}

/// Inward unit normals of the edges of a convex polygon in its plane, with the least along each; `None` where it is not convex.
pub(crate) fn edges(corners: &[DVec3], normal: DVec3) -> Option<Vec<(DVec3, f64)>> {
    let n = corners.len();
    let turned = |i: usize| normal.cross(corners[(i + 1) % n] - corners[i]).try_normalize();
    let axes: Vec<DVec3> = (0..n).map(turned).collect::<Option<_>>()?;
    let reach = corners.iter().map(|c| c.abs().max_element()).fold(0.0, f64::max);
    // Seen from the back the corners run the other way round.
    for sign in [1.0, -1.0] {
        let edges: Vec<(DVec3, f64)> =
            axes.iter().zip(corners).map(|(axis, corner)| (sign * *axis, sign * axis.dot(*corner))).collect();
        let tolerance = 8.0 * f64::EPSILON * reach;
        if edges.iter().all(|(axis, least)| corners.iter().all(|c| axis.dot(*c) >= least - tolerance)) {
            return Some(edges);
        }
    }
    None
}
