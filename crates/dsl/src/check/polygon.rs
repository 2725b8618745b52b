//! Whether a polygon can be seen: its corners, its plane, its edges.

use glam::{DVec2, DVec3};
use smallvec::SmallVec;

/// The most corners of one polygon.
pub(super) const MOST_CORNERS: usize = 20_000;
/// Area below this share of the extent squared is rounding.
const NO_AREA: f64 = 1e-13;

/// Room for the corners of the usual polygon without an allocation.
type Few<T> = SmallVec<[T; 8]>;

/// What keeps a polygon from being seen. Corners and edges count from 0; edge `i` leaves corner `i`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Fault {
    TooFew(usize),
    TooMany(usize),
    NoArea,
    Crossing(usize, usize),
    NotPlanar { corner: usize, distance: f64, extent: f64 },
}

/// The corners, neighbours that coincide left out, of a polygon whose corners lie within `planar` times its extent of
/// one plane.
pub(super) fn examine(corners: &[DVec3], planar: f64) -> Result<Few<DVec3>, Fault> {
    let n = corners.len();
    if n > MOST_CORNERS {
        return Err(Fault::TooMany(n));
    }
    let kept: Few<usize> = (0..n).filter(|&i| corners[i] != corners[(i + n - 1) % n] || n == 1).collect();
    let mut distinct: Few<[u64; 3]> =
        kept.iter().map(|i| (corners[*i] + DVec3::ZERO).to_array().map(f64::to_bits)).collect();
    distinct.sort_unstable();
    distinct.dedup();
    if distinct.len() < 3 {
        return Err(Fault::TooFew(distinct.len().max(n.min(1))));
    }
    // Relative to the first corner, so that a far origin costs no digits.
    let origin = corners[kept[0]];
    let points: Few<DVec3> = kept.iter().map(|i| corners[*i] - origin).collect();
    let (low, high) = points.iter().fold((points[0], points[0]), |(low, high), p| (low.min(*p), high.max(*p)));
    let extent = (high - low).max_element();
    let furthest = |from: &dyn Fn(DVec3) -> f64| {
        points.iter().copied().max_by(|a, b| from(*a).total_cmp(&from(*b))).unwrap_or(DVec3::ZERO)
    };
    let arm = furthest(&|p| p.length_squared());
    let widest = arm.cross(furthest(&|p| arm.cross(p).length_squared()));
    if widest.length() <= NO_AREA * extent * extent {
        return Err(Fault::NoArea);
    }
    let area_vector = around(&points);
    let encloses = area_vector.length() > NO_AREA * extent * extent;
    let normal = if encloses { area_vector } else { widest }.normalize();
    if points.len() > 3 {
        if let Some((a, b)) = crossing(&points, normal, extent) {
            return Err(Fault::Crossing(kept[a], kept[b]));
        }
        if !encloses {
            return Err(Fault::NoArea);
        }
        let (worst, off) = furthest_off(&points, normal);
        if off > planar * extent {
            let (corner, distance) = outlier(&points).unwrap_or((worst, off));
            return Err(Fault::NotPlanar { corner: kept[corner], distance, extent });
        }
    }
    Ok(kept.iter().map(|i| corners[*i]).collect())
}

fn around(points: &[DVec3]) -> DVec3 {
    (0..points.len()).fold(DVec3::ZERO, |sum, i| sum + points[i].cross(points[(i + 1) % points.len()]))
}

/// The corner furthest from the plane of a normal through the corners' mean, and its distance.
fn furthest_off(points: &[DVec3], normal: DVec3) -> (usize, f64) {
    let centre = points.iter().sum::<DVec3>() / points.len() as f64;
    let off = |i: usize| (points[i] - centre).dot(normal).abs();
    let worst = (0..points.len()).max_by(|a, b| off(*a).total_cmp(&off(*b))).unwrap_or(0);
    (worst, off(worst))
}

/// The corner without which the others are closest to one plane, and its distance from that plane. Of a quadrilateral's
/// corners, whose others always have a plane, the one whose others lie in the most level or upright one.
fn outlier(points: &[DVec3]) -> Option<(usize, f64)> {
    const MOST: usize = 64;
    if points.len() > MOST {
        return None;
    }
    let scored = (0..points.len()).filter_map(|i| {
        let others: Vec<DVec3> =
            (0..points.len()).filter(|j| *j != i).map(|j| points[j] - points[(i + 1) % points.len()]).collect();
        let normal = around(&others).try_normalize()?;
        let (_, residual) = furthest_off(&others, normal);
        let (low, high) = others.iter().fold((others[0], others[0]), |(low, high), p| (low.min(*p), high.max(*p)));
        let distance = (points[i] - points[(i + 1) % points.len()]).dot(normal).abs();
        Some((i, distance, residual + 1e-6 * (high - low).min_element()))
    });
    scored.min_by(|a, b| a.2.total_cmp(&b.2)).map(|(i, distance, _)| (i, distance))
}

/// Two edges that cross, seen along the normal. Edges are swept in order of their left ends.
fn crossing(points: &[DVec3], normal: DVec3, extent: f64) -> Option<(usize, usize)> {
    let axis = normal.abs();
    let flat = |p: DVec3| match () {
        () if axis.z >= axis.x && axis.z >= axis.y => DVec2::new(p.x, p.y),
        () if axis.y >= axis.x => DVec2::new(p.x, p.z),
        () => DVec2::new(p.y, p.z),
    };
    let corners: Few<DVec2> = points.iter().map(|p| flat(*p)).collect();
    let n = corners.len();
    let edge = |i: usize| (corners[i], corners[(i + 1) % n]);
    let mut order: Few<usize> = (0..n).collect();
    let left = |i: usize| edge(i).0.x.min(edge(i).1.x);
    order.sort_by(|a, b| left(*a).total_cmp(&left(*b)));
    let tolerance = 1e-12 * extent * extent;
    let side = |a: DVec2, b: DVec2, p: DVec2| (b - a).perp_dot(p - a);
    let parted = |s: f64, t: f64| (s > tolerance && t < -tolerance) || (s < -tolerance && t > tolerance);
    for (k, &i) in order.iter().enumerate() {
        let (a, b) = edge(i);
        let right = a.x.max(b.x);
        for &j in order[k + 1..].iter().take_while(|j| left(**j) <= right) {
            if (i + 1) % n == j || (j + 1) % n == i {
                continue;
            }
            let (c, d) = edge(j);
            if parted(side(a, b, c), side(a, b, d)) && parted(side(c, d, a), side(c, d, b)) {
                return Some((i.min(j), i.max(j)));
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn polygon(corners: &[[f64; 3]]) -> Result<usize, Fault> {
        let corners: Vec<DVec3> = corners.iter().map(|c| DVec3::from(*c)).collect();
        examine(&corners, 1e-3).map(|kept| kept.len())
    }

    #[test]
    fn a_polygon_is_planar_encloses_area_and_does_not_cross_itself() {
        let square = [[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 1., 0.]];
        assert_eq!(polygon(&square), Ok(4));
        assert_eq!(polygon(&[square[0], square[1], square[2], square[3], square[0]]), Ok(4));
        assert_eq!(polygon(&[square[0], square[1], square[0], square[1]]), Err(Fault::TooFew(2)));
        assert_eq!(polygon(&[square[0], square[2], square[1], square[3]]), Err(Fault::Crossing(0, 2)));
        assert_eq!(polygon(&[[0., 0., 0.], [1., 1., 1.], [0.3, 0.3, 0.3]]), Err(Fault::NoArea));
        assert_eq!(polygon(&[]), Err(Fault::TooFew(0)));
        let raised = polygon(&[square[0], square[1], [1., 1., 0.08], square[3]]);
        assert_eq!(raised, Err(Fault::NotPlanar { corner: 2, distance: 0.08, extent: 1.0 }));
        let six = [[0., 0., 0.], [2., 0., 0.], [2., 1., 0.], [1., 1., 0.], [1., 2., 0.], [0., 2., 0.3]];
        assert_eq!(polygon(&six), Err(Fault::NotPlanar { corner: 5, distance: 0.3, extent: 2.0 }));
    }

    /// DESIGN section 8: slivers of aspect 10⁶ stay, also at coordinates of 5×10⁶ m.
    #[test]
    fn slivers_far_from_the_origin_are_kept() {
        let far = 5e6;
        assert_eq!(
            polygon(&[[far, far, 0.], [far + 1e3, far, 0.], [far + 1e3, far + 1e-3, 0.], [far, far + 1e-3, 0.]]),
            Ok(4)
        );
    }

    #[test]
    fn a_comb_of_many_teeth_is_found_free_of_crossings() {
        let mut corners = Vec::new();
        for i in 0..5000 {
            corners.push([f64::from(i), if i % 2 == 0 { 0.0 } else { 1.0 }, 0.0]);
        }
        corners.extend([[5000., -1., 0.], [0., -1., 0.]]);
        assert_eq!(polygon(&corners), Ok(5002));
    }
}
