//! The facet: a planar polygon with a front, the node of a DIRSIG scene.

use glam::{DAffine3, DVec2, DVec3};
use sunglint_radiometry::WorldDir;

/// Index of a material in the plan's list.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct MaterialId(pub u32);

/// Corners may lie off the facet's plane by this part of its largest extent (1 mm in 10 m: corners typed to the
/// millimetre), or by the rounding of their coordinates if that is more.
pub const PLANARITY: f64 = 1e-4;

/// A planar polygon. Corners run counter-clockwise seen from the front.
#[derive(Clone, Debug, PartialEq)]
pub struct Facet {
    /// Corners \[m\], without repetition of neighbours.
    pub corners: Vec<DVec3>,
    /// Unit normal of the front.
    pub normal: DVec3,
    /// Area \[m²\].
    pub area: f64,
    /// Material of the facet.
    pub material: MaterialId,
}

/// Why corners make no facet. Corners and edges count from 0; edge i runs from corner i to the next, both as given.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FacetError {
    /// Fewer than three distinct corners.
    #[error("a facet has three distinct corners at least, found {distinct}")]
    TooFewCorners {
        /// Distinct corners found.
        distinct: usize,
    },
    /// A coordinate is infinite or not a number.
    #[error("corner {corner} is not finite")]
    NotFinite {
        /// The corner.
        corner: usize,
    },
    /// The corners lie on a line, to rounding.
    #[error("the corners lie on a line, the facet has no area")]
    ZeroArea,
    /// A corner is too far from the plane.
    #[error("corner {corner} lies {off_m:.3e} m off the plane of the facet, {tolerance_m:.3e} m are tolerated")]
    NotPlanar {
        /// The corner farthest off.
        corner: usize,
        /// Its distance from the plane \[m\].
        off_m: f64,
        /// What is tolerated \[m\].
        tolerance_m: f64,
    },
    /// Two edges cross.
    #[error("edges {edge_a} and {edge_b} of the facet cross")]
    SelfCrossing {
        /// One edge.
        edge_a: usize,
        /// The other.
        edge_b: usize,
    },
}

impl Facet {
    /// The facet of `corners`. Equal neighbours count once; corners in the middle of an edge are kept.
    ///
    /// # Errors
    /// See [`FacetError`]; planarity is held to [`PLANARITY`].
    pub fn new(corners: Vec<DVec3>, material: MaterialId) -> Result<Self, FacetError> {
        let mut ring = Ring::default();
        let (normal, area) = ring.examine(&corners)?;
        Ok(Self {
            corners: if ring.corners.len() < corners.len() { ring.corners } else { corners },
            normal,
            area,
            material,
        })
    }

    /// Slope to the earth: the normal's zenith angle \[rad\].
    pub fn tilt(&self) -> f64 {
        WorldDir::from_unit(self.normal).zenith()
    }
    /// Azimuth that the facet faces, clockwise from north, in 0..2π \[rad\]; 0 where it faces straight up or down.
    pub fn aspect(&self) -> f64 {
        WorldDir::from_unit(self.normal).azimuth()
    }
    /// Angle between the normal and the sun \[rad\]; above π/2 the front is turned away from it.
    pub fn sun_incidence(&self, sun: WorldDir) -> f64 {
        WorldDir::from_unit(self.normal).angle_to(sun)
    }
    /// The facet moved, turned and scaled uniformly.
    #[must_use]
    pub fn transformed(&self, pose: &DAffine3) -> Self {
        let corners: Vec<DVec3> = self.corners.iter().map(|corner| pose.transform_point3(*corner)).collect();
        let twice = area_vector(&corners);
        let length = twice.length();
        let normal = if length > 0.0 { twice / length } else { self.normal };
        Self { corners, normal, area: 0.5 * length, material: self.material }
    }
    /// Mean of the corners \[m\].
    pub fn centre(&self) -> DVec3 {
        let first = self.corners.first().copied().unwrap_or_default();
        first + self.corners.iter().map(|c| c - first).sum::<DVec3>() / self.corners.len().max(1) as f64
    }
}

/// Corners under examination; the buffers are kept between facets.
#[derive(Default)]
pub(crate) struct Ring {
    /// The corners, equal neighbours merged round the ring.
    pub corners: Vec<DVec3>,
    /// Where each stood as given.
    given: Vec<usize>,
}

/// Normal and area of a triangle that is one beyond doubt; what is not goes to [`Ring::examine`].
#[inline]
pub(crate) fn sound_triangle(corners: &[DVec3; 3]) -> Option<(DVec3, f64)> {
    let [a, b, c] = *corners;
    let (lo, hi) = (a.min(b).min(c), a.max(b).max(c));
    let extent = (hi - lo).max_element();
    let rounding = 4.0 * f64::EPSILON * lo.abs().max(hi.abs()).max_element();
    let twice = area_vector(corners);
    let length = twice.length();
    let sound = length.is_finite() && length > extent * (rounding + 1e-12 * extent);
    (sound && a.is_finite() && b.is_finite() && c.is_finite()).then(|| (twice / length, 0.5 * length))
}

impl Ring {
    /// Unit normal and area \[m²\] of the facet with these corners, which are left in `self.corners`.
    pub fn examine(&mut self, corners: &[DVec3]) -> Result<(DVec3, f64), FacetError> {
        if let Some(corner) = corners.iter().position(|c| !c.is_finite()) {
            return Err(FacetError::NotFinite { corner });
        }
        self.corners.clear();
        self.given.clear();
        for (i, &corner) in corners.iter().enumerate() {
            if self.corners.last() != Some(&corner) {
                self.corners.push(corner);
                self.given.push(i);
            }
        }
        while self.corners.len() > 1 && self.corners.first() == self.corners.last() {
            self.corners.pop();
        }
        let (corners, given) = (&self.corners[..], &self.given[..]);
        if corners.len() < 3 {
            return Err(FacetError::TooFewCorners { distinct: corners.len() });
        }
        let (lo, hi) = corners.iter().fold((corners[0], corners[0]), |(lo, hi), &c| (lo.min(c), hi.max(c)));
        let extent = (hi - lo).max_element();
        let rounding = 4.0 * f64::EPSILON * lo.abs().max(hi.abs()).max_element();
        let twice = area_vector(corners);
        let length = twice.length();
        // Rounded coordinates move a sliver's long edge by `rounding`, so its area by extent × rounding.
        if !length.is_finite() || length <= extent * (rounding + 1e-12 * extent) {
            let distinct = distinct_count(corners);
            // The two halves of an even bow tie cancel.
            let tie = crossing(&flatten(corners, widest_turn(corners)));
            return Err(match tie {
                _ if distinct < 3 => FacetError::TooFewCorners { distinct },
                Some((a, b)) => FacetError::SelfCrossing { edge_a: given[a], edge_b: given[b] },
                None => FacetError::ZeroArea,
            });
        }
        let normal = twice / length;
        if corners.len() > 3 {
            let centre = corners.iter().map(|c| c - corners[0]).sum::<DVec3>() / corners.len() as f64;
            let off = |c: &DVec3| normal.dot(c - corners[0] - centre).abs();
            let tolerance_m = (PLANARITY * extent).max(rounding);
            let (worst, off_m) =
                corners.iter().map(off).enumerate().fold((0, 0.0), |w, (i, d)| if d > w.1 { (i, d) } else { w });
            if off_m > tolerance_m {
                return Err(FacetError::NotPlanar { corner: given[worst], off_m, tolerance_m });
            }
            if let Some((a, b)) = crossing(&flatten(corners, normal)) {
                return Err(FacetError::SelfCrossing { edge_a: given[a], edge_b: given[b] });
            }
        }
        Ok((normal, 0.5 * length))
    }
}

/// Twice the area times the normal (Newell), about the first corner so that far coordinates cost no digits.
pub(crate) fn area_vector(corners: &[DVec3]) -> DVec3 {
    let Some(&first) = corners.first() else { return DVec3::ZERO };
    corners[1..].windows(2).map(|w| cross(w[0] - first, w[1] - first)).sum()
}

/// The cross product to the last digits, by Kahan's difference of products: in a sliver the products nearly cancel, and
/// what is left would tilt the normal along the sliver too.
fn cross(a: DVec3, b: DVec3) -> DVec3 {
    let minor = |p: f64, q: f64, r: f64, s: f64| {
        let rs = r * s;
        p.mul_add(q, -rs) + (-r).mul_add(s, rs)
    };
    DVec3::new(minor(a.y, b.z, a.z, b.y), minor(a.z, b.x, a.x, b.z), minor(a.x, b.y, a.y, b.x))
}

/// The largest cross product of the longest arm from the first corner with another.
fn widest_turn(corners: &[DVec3]) -> DVec3 {
    let longest = |it: &mut dyn Iterator<Item = DVec3>| {
        it.fold(DVec3::ZERO, |w, v| if v.length_squared() > w.length_squared() { v } else { w })
    };
    let arm = longest(&mut corners.iter().map(|c| c - corners[0]));
    longest(&mut corners.iter().map(|c| arm.cross(c - corners[0])))
}

/// The polygon along the axis nearest to its normal, orientation kept. No coordinate is rounded.
pub(crate) fn flatten(corners: &[DVec3], normal: DVec3) -> Vec<DVec2> {
    let n = normal.abs();
    let flat: fn(&DVec3) -> DVec2 = if n.z >= n.x && n.z >= n.y {
        if normal.z >= 0.0 { |c| DVec2::new(c.x, c.y) } else { |c| DVec2::new(c.y, c.x) }
    } else if n.y >= n.x {
        if normal.y >= 0.0 { |c| DVec2::new(c.z, c.x) } else { |c| DVec2::new(c.x, c.z) }
    } else if normal.x >= 0.0 {
        |c| DVec2::new(c.y, c.z)
    } else {
        |c| DVec2::new(c.z, c.y)
    };
    corners.iter().map(flat).collect()
}

fn distinct_count(corners: &[DVec3]) -> usize {
    let mut keys: Vec<[u64; 3]> = corners.iter().map(|c| c.to_array().map(|x| (x + 0.0).to_bits())).collect();
    keys.sort_unstable();
    keys.dedup();
    keys.len()
}

/// Two edges that cross properly, by a sweep along the axis on which edges overlap less. Edges that touch, or that lie
/// on each other as the bridge to a hole does, do not cross.
fn crossing(ring: &[DVec2]) -> Option<(usize, usize)> {
    let n = ring.len();
    if n < 4 {
        return None;
    }
    let edge = |i: usize| (ring[i], ring[(i + 1) % n]);
    let length_along = |axis: usize| (0..n).map(|i| (edge(i).0[axis] - edge(i).1[axis]).abs()).sum::<f64>();
    let (lo, hi) = ring.iter().fold((ring[0], ring[0]), |(lo, hi), &c| (lo.min(c), hi.max(c)));
    let axis = usize::from(length_along(0) * (hi.y - lo.y) > length_along(1) * (hi.x - lo.x));
    let span = |i: usize| {
        let (a, b) = edge(i);
        (a[axis].min(b[axis]), a[axis].max(b[axis]))
    };
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|&i, &j| span(i).0.total_cmp(&span(j).0));
    let noise = 8.0 * f64::EPSILON * (hi - lo).max_element() * lo.abs().max(hi.abs()).max_element();
    let side = |a: DVec2, b: DVec2, c: DVec2| {
        let s = (b - a).perp_dot(c - a);
        if s.abs() <= noise { 0.0 } else { s }
    };
    let mut active: Vec<usize> = Vec::new();
    for &i in &order {
        let start = span(i).0;
        active.retain(|&j| span(j).1 >= start);
        let (a, b) = edge(i);
        for &j in &active {
            let (c, d) = edge(j);
            let cross = |axis: usize| {
                a[axis].max(b[axis]) >= c[axis].min(d[axis]) && c[axis].max(d[axis]) >= a[axis].min(b[axis])
            };
            if cross(1 - axis) && side(a, b, c) * side(a, b, d) < 0.0 && side(c, d, a) * side(c, d, b) < 0.0 {
                return Some((i.min(j), i.max(j)));
            }
        }
        active.push(i);
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

    const GREY: MaterialId = MaterialId(3);

    fn facet(corners: &[[f64; 3]]) -> Result<Facet, FacetError> {
        Facet::new(corners.iter().map(|&c| DVec3::from_array(c)).collect(), GREY)
    }

    /// A roof half that rises 1 m over 1 m towards north faces south at 45° and meets a southern sun at 45° squarely.
    #[test]
    fn tilt_aspect_and_sun_incidence_are_those_of_a_south_roof() {
        let roof = facet(&[[0., 0., 0.], [4., 0., 0.], [4., 1., 1.], [0., 1., 1.]]).unwrap();
        assert!((roof.tilt() - FRAC_PI_4).abs() < 1e-15);
        assert!((roof.aspect() - PI).abs() < 1e-15);
        assert!((roof.area - 4.0 * 2f64.sqrt()).abs() < 1e-14);
        assert!(roof.sun_incidence(WorldDir::from_zenith_azimuth(FRAC_PI_4, PI)) < 1e-15);
        assert!((roof.sun_incidence(WorldDir::UP) - FRAC_PI_4).abs() < 1e-15);
        let wall = facet(&[[0., 0., 0.], [0., 0., 2.], [0., -3., 2.], [0., -3., 0.]]).unwrap();
        assert!((wall.tilt() - FRAC_PI_2).abs() < 1e-15 && wall.normal == DVec3::X);
    }

    /// A square metre keeps its normal to 1e-8 at coordinates whose rounding is 1e-9 m.
    #[test]
    fn a_small_facet_far_from_the_origin_keeps_its_normal() {
        let far = DVec3::new(430_000.3, 5_100_000.7, 150.1);
        let square = [[0., 0., 0.], [1., 0., 0.], [1., 0.8, 0.6], [0., 0.8, 0.6]];
        let f = Facet::new(square.iter().map(|&c| far + DVec3::from_array(c)).collect(), GREY).unwrap();
        assert!((f.normal - DVec3::new(0.0, -0.6, 0.8)).length() < 1e-8);
    }

    #[test]
    fn corners_that_make_no_facet_are_refused_with_the_reason() {
        assert_eq!(facet(&[[0.; 3], [1., 0., 0.]]), Err(FacetError::TooFewCorners { distinct: 2 }));
        let twice = [[0.; 3], [1., 0., 0.], [1., 0., 0.], [0.; 3]];
        assert_eq!(facet(&twice), Err(FacetError::TooFewCorners { distinct: 2 }));
        assert_eq!(facet(&[[0.; 3], [1., 0., 0.], [f64::NAN, 0., 0.]]), Err(FacetError::NotFinite { corner: 2 }));
        assert_eq!(facet(&[[0.; 3], [1., 1., 1.], [3., 3., 3.]]), Err(FacetError::ZeroArea));
        let bent = [[0., 0., 0.], [1., 0., 0.], [1., 1., 0.1], [0., 1., 0.]];
        assert!(matches!(facet(&bent), Err(FacetError::NotPlanar { off_m, .. }) if (off_m - 0.025).abs() < 1e-3));
        for height in [2., 3.] {
            let bow_tie = [[0., 0., 0.], [4., 3., 0.], [4., 0., 0.], [0., height, 0.]];
            assert_eq!(facet(&bow_tie), Err(FacetError::SelfCrossing { edge_a: 0, edge_b: 2 }));
        }
    }

    /// Coordinates typed to the millimetre on a 10 m roof, a keyhole polygon, and a sliver of aspect 10⁶ are facets.
    #[test]
    fn what_a_scene_may_hold_is_accepted() {
        assert!(facet(&[[0., 0., 0.], [10., 0., 0.], [10., 7., 3.001], [0., 7., 3.]]).is_ok());
        let keyhole = [
            [0., 0., 0.],
            [4., 0., 0.],
            [4., 4., 0.],
            [0., 4., 0.],
            [0., 0., 0.],
            [1., 1., 0.],
            [1., 3., 0.],
            [3., 3., 0.],
            [3., 1., 0.],
            [1., 1., 0.],
        ];
        assert!((facet(&keyhole).unwrap().area - 12.0).abs() < 1e-12);
        assert!(facet(&[[5e6, 5e6, 0.], [5e6 + 1e3, 5e6, 0.], [5e6, 5e6 + 1e-3, 0.]]).is_ok());
    }

    /// A star of 20,001 corners is checked without pairing all edges, and one crossing in it is found.
    #[test]
    fn one_crossing_among_many_edges_is_found() {
        let n = 20_001;
        let mut star: Vec<DVec3> = (0..n)
            .map(|i| {
                let (s, c) = (2.0 * PI * f64::from(i) / f64::from(n)).sin_cos();
                DVec3::new(c, s, 0.0) * if i % 2 == 0 { 10.0 } else { 9.99 }
            })
            .collect();
        assert!(Facet::new(star.clone(), GREY).is_ok());
        star.swap(7_000, 7_002);
        assert!(matches!(Facet::new(star, GREY), Err(FacetError::SelfCrossing { .. })));
    }
}
