//! Disks, cylinders, cones and spheres as facets.
//!
//! A circle of radius r becomes the regular polygon of N sides that has its **area**, πr²: a disk reflects what it should,
//! and a cylinder or cone has its caps and its volume exactly. The polygon's corners lie outside the circle and the middles
//! of its sides inside, by at most (π/N)²/3 r together (0.4 % at N = 32); its circumference, and so a cylinder's side, is
//! larger by π²/(6 N²) (0.16 %). A sphere of N meridians and ⌈N/2⌉ bands of latitude has the **surface** 4πr², so that the
//! area it shows, averaged over all directions, is πr² (Cauchy); every point lies within (π/N)² r of its radius (1 %).
//! Circles start half a side from their lowest or southernmost point, so that `sides 4` is square with its frame.

use crate::facet::area_vector;
use crate::shapes::level_axes;
use crate::{Facet, MaterialId};
use glam::{DVec2, DVec3};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// A disk of `radius` \[m\] about the origin as one facet, its front towards `facing` (any length; zero counts as up).
pub fn disk_facet(material: MaterialId, radius: f64, sides: u32, facing: DVec3) -> Facet {
    let (right, up) = level_axes(facing.normalize_or(DVec3::Z));
    facet(material, circle(radius, sides).map(|p| right * p.x + up * p.y).collect())
}

/// A cylinder of `radius` and `height` \[m\] that stands on the centre of its base at the origin: base, top, then sides.
pub fn cylinder_facets(material: MaterialId, radius: f64, height: f64, sides: u32) -> Vec<Facet> {
    let base: Vec<DVec3> = circle(radius, sides).map(|p| p.extend(0.0)).collect();
    let top: Vec<DVec3> = base.iter().map(|p| p.with_z(height)).collect();
    let mut facets = vec![facet(material, base.iter().rev().copied().collect()), facet(material, top.clone())];
    facets.extend(pairs(base.len()).map(|(i, k)| facet(material, vec![base[i], base[k], top[k], top[i]])));
    facets
}

/// A cone of `radius` and `height` \[m\] that stands on the centre of its base at the origin: base, then sides.
pub fn cone_facets(material: MaterialId, radius: f64, height: f64, sides: u32) -> Vec<Facet> {
    let base: Vec<DVec3> = circle(radius, sides).map(|p| p.extend(0.0)).collect();
    let apex = DVec3::new(0.0, 0.0, height);
    let mut facets = vec![facet(material, base.iter().rev().copied().collect())];
    facets.extend(pairs(base.len()).map(|(i, k)| facet(material, vec![base[i], base[k], apex])));
    facets
}

/// A sphere of `radius` \[m\] about the origin, of as many meridians as `sides` and half as many bands of latitude.
pub fn sphere_facets(material: MaterialId, radius: f64, sides: u32) -> Vec<Facet> {
    let unit = latitudes(material, 1.0, sides);
    let surface: f64 = unit.iter().map(|facet| facet.area).sum();
    latitudes(material, radius * (4.0 * PI / surface).sqrt(), sides)
}

/// The sphere whose corners lie at `radius`.
fn latitudes(material: MaterialId, radius: f64, sides: u32) -> Vec<Facet> {
    let bands = sides.div_ceil(2).max(2);
    let ring = |m: u32| -> Vec<DVec3> {
        let (sin, cos) = (PI * f64::from(m) / f64::from(bands)).sin_cos();
        angles(sides).map(|(s, c)| radius * DVec3::new(sin * c, sin * s, cos)).collect()
    };
    let (top, bottom) = (DVec3::Z * radius, DVec3::NEG_Z * radius);
    let mut facets = Vec::with_capacity(sides as usize * bands as usize);
    let mut above = ring(1);
    facets.extend(pairs(above.len()).map(|(i, k)| facet(material, vec![above[i], above[k], top])));
    for m in 2..bands {
        let below = ring(m);
        facets.extend(pairs(below.len()).map(|(i, k)| facet(material, vec![below[i], below[k], above[k], above[i]])));
        above = below;
    }
    facets.extend(pairs(above.len()).map(|(i, k)| facet(material, vec![above[k], above[i], bottom])));
    facets
}

fn pairs(n: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..n).map(move |i| (i, (i + 1) % n))
}

/// Sine and cosine of the corners' angles, counter-clockwise from half a step before straight down.
fn angles(sides: u32) -> impl Iterator<Item = (f64, f64)> {
    (0..sides).map(move |k| ((f64::from(k) - 0.5) * TAU / f64::from(sides) - FRAC_PI_2).sin_cos())
}

/// Corners of the regular polygon that has the area of the circle.
fn circle(radius: f64, sides: u32) -> impl Iterator<Item = DVec2> {
    let step = TAU / f64::from(sides);
    let reach = radius * (step / step.sin()).sqrt();
    angles(sides).map(move |(s, c)| reach * DVec2::new(c, s))
}

fn facet(material: MaterialId, corners: Vec<DVec3>) -> Facet {
    let twice = area_vector(&corners);
    let length = twice.length();
    Facet { normal: twice / length, area: 0.5 * length, corners, material }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Instance, Mesh, Ray, World};
    use glam::DAffine3;
    use std::collections::HashMap;
    use sunglint_radiometry::WorldDir;

    const GREY: MaterialId = MaterialId(0);

    fn solids(sides: u32) -> [(&'static str, Vec<Facet>, f64); 3] {
        let (r, h) = (1.5, 4.0);
        [
            ("cylinder", cylinder_facets(GREY, r, h, sides), PI * r * r * h),
            ("cone", cone_facets(GREY, r, h, sides), PI * r * r * h / 3.0),
            ("sphere", sphere_facets(GREY, r, sides), 4.0 / 3.0 * PI * r * r * r),
        ]
    }

    /// By the divergence theorem: cylinder and cone to rounding, the sphere to its stated deviation (π/N)².
    #[test]
    fn a_cylinder_and_a_cone_have_their_volume_and_a_sphere_its_surface() {
        for sides in [3, 4, 5, 32, 257] {
            for (name, facets, expected) in solids(sides) {
                let volume: f64 = facets.iter().map(|f| f.centre().dot(f.normal) * f.area / 3.0).sum();
                let bound = if name == "sphere" { 2.0 * (PI / f64::from(sides)).powi(2) } else { 1e-13 };
                assert!((volume / expected - 1.0).abs() < bound, "{name} of {sides} sides: {volume} for {expected}");
            }
            let surface: f64 = sphere_facets(GREY, 1.5, sides).iter().map(|f| f.area).sum();
            assert!((surface / (4.0 * PI * 1.5 * 1.5) - 1.0).abs() < 1e-13);
            let disk = disk_facet(GREY, 1.5, sides, DVec3::new(1.0, -2.0, 0.5));
            assert!((disk.area / (PI * 1.5 * 1.5) - 1.0).abs() < 1e-13);
            assert!((disk.normal - DVec3::new(1.0, -2.0, 0.5).normalize()).length() < 1e-14);
        }
    }

    /// The side of a cylinder is too large by π²/(6N²), and no point of a circle or sphere is farther off than stated.
    #[test]
    fn the_deviations_are_those_that_the_manual_states() {
        for sides in [8, 32, 100] {
            let step = PI / f64::from(sides);
            let side: f64 = cylinder_facets(GREY, 1.0, 1.0, sides)[2..].iter().map(|f| f.area).sum();
            assert!(((side / TAU - 1.0) / (step * step / 6.0) - 1.0).abs() < 0.1, "{side}");
            let corner = circle(1.0, sides).next().unwrap().length();
            let middle = corner * step.cos();
            assert!((corner - 1.0).max(1.0 - middle) < step * step / 3.0 + step.powi(4), "{corner} {middle}");
            for facet in sphere_facets(GREY, 1.0, sides) {
                let farthest = facet.corners.iter().map(|c| c.length()).fold(0.0, f64::max);
                let nearest = facet.normal.dot(facet.corners[0]);
                assert!(farthest < 1.0 + step * step && nearest > 1.0 - step * step, "{farthest} {nearest}");
            }
        }
    }

    /// Every edge is run through once each way, which closes a surface; the volumes above say that fronts look out.
    #[test]
    fn every_edge_of_a_solid_has_its_partner() {
        for sides in [3, 4, 7, 32] {
            for (name, facets, _) in solids(sides) {
                let mut edges: HashMap<[[u64; 3]; 2], i32> = HashMap::new();
                let key = |v: DVec3| v.to_array().map(|x| (x + 0.0).to_bits());
                for facet in &facets {
                    for (i, k) in pairs(facet.corners.len()) {
                        let (a, b) = (key(facet.corners[i]), key(facet.corners[k]));
                        *edges.entry([a.min(b), a.max(b)]).or_default() += if a < b { 1 } else { -1 };
                    }
                }
                assert!(edges.values().all(|sum| *sum == 0), "{name} of {sides} sides");
            }
        }
    }

    /// From the middle no ray leaves, aimed at corners, edges and facets in turn, in a turned and far pose too.
    #[test]
    fn no_ray_leaks_out_of_a_solid() {
        let pose = crate::Pose { at: DVec3::new(4e5, 5e6, 150.0), heading: 0.3, pitch: 0.2, roll: -0.7, scale: 0.6 };
        for matrix in [DAffine3::IDENTITY, pose.matrix()] {
            for (name, facets, _) in solids(32) {
                let targets: Vec<DVec3> = facets
                    .iter()
                    .flat_map(|f| [f.corners[0], 0.5 * (f.corners[0] + f.corners[1]), f.centre()])
                    .map(|v| matrix.transform_point3(v))
                    .collect();
                let inner = if name == "sphere" { DVec3::ZERO } else { DVec3::new(0.05, -0.02, 1.1) };
                let from = matrix.transform_point3(inner);
                let facets = facets.into_iter().map(|f| f.transformed(&matrix)).collect();
                let only = Instance { mesh: 0, pose: DAffine3::IDENTITY, name: name.into(), id: 1 };
                let world = World::new(vec![Mesh::from_facets(facets)], vec![only], None).unwrap();
                for target in targets {
                    let hit = world.closest(&Ray::new(from, WorldDir::new(target - from)));
                    assert!(hit.is_some_and(|hit| !hit.front), "{name}: a ray to {target} leaks or meets a front");
                }
            }
        }
    }
}
