//! Closed surfaces, and rays that cannot miss them in exact arithmetic.

use glam::{DAffine3, DVec3};
use std::collections::HashMap;
use std::f64::consts::TAU;
use sunglint_geometry::{Facet, Instance, MaterialId, Mesh, Ray, World};
use sunglint_radiometry::WorldDir;

/// A surface with shared corners.
pub struct LeakScene {
    pub name: String,
    pub corners: Vec<DVec3>,
    pub triangles: Vec<[u32; 3]>,
    centre: DVec3,
    flat: bool,
}

/// A sphere of radius 100 m and 81,920 triangles seen from inside and outside, and a level grid of 500,000 triangles seen
/// at 0.05° to 1° along its edges; about the origin and at UTM-like coordinates.
pub fn all() -> Vec<LeakScene> {
    let at = [DVec3::ZERO, DVec3::new(430_000.0, 5_100_000.0, 150.0)];
    at.into_iter().map(|at| LeakScene::sphere(6, at)).chain(at.into_iter().map(LeakScene::grid)).collect()
}

impl LeakScene {
    /// An icosahedron divided `levels` times.
    pub fn sphere(levels: u32, centre: DVec3) -> Self {
        let g = 0.5 * (1.0 + 5f64.sqrt());
        let mut corners: Vec<DVec3> = (0..3)
            .flat_map(|axis| {
                [(1.0, g), (-1.0, g), (1.0, -g), (-1.0, -g)].map(|(a, b)| {
                    let mut v = [0.0; 3];
                    (v[(axis + 1) % 3], v[(axis + 2) % 3]) = (a, b);
                    DVec3::from_array(v)
                })
            })
            .collect();
        let near = |a: DVec3, b: DVec3| (a.distance_squared(b) - 4.0).abs() < 1e-9;
        let mut triangles: Vec<[u32; 3]> = Vec::new();
        for i in 0..12 {
            for j in i + 1..12 {
                for k in j + 1..12 {
                    let [a, b, c] = [corners[i], corners[j], corners[k]];
                    if near(a, b) && near(b, c) && near(c, a) {
                        let out = (b - a).cross(c - a).dot(a) > 0.0;
                        triangles.push(if out { [i, j, k] } else { [i, k, j] }.map(|v| v as u32));
                    }
                }
            }
        }
        for _ in 0..levels {
            let mut middle: HashMap<(u32, u32), u32> = HashMap::new();
            let mut halve = |a: u32, b: u32| {
                *middle.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    corners.push(
                        0.5 * (corners[a as usize] + corners[b as usize]).normalize() * corners[0].length() * 2.0,
                    );
                    corners.len() as u32 - 1
                })
            };
            triangles = triangles
                .iter()
                .flat_map(|&[a, b, c]| {
                    let (ab, bc, ca) = (halve(a, b), halve(b, c), halve(c, a));
                    [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
                })
                .collect();
        }
        for c in &mut corners {
            *c = centre + 100.0 * c.normalize();
        }
        let name = format!("sphere of {} triangles at x = {}", triangles.len(), centre.x);
        Self { name, corners, triangles, centre, flat: false }
    }

    /// 500 × 500 cells of 1 m, level.
    pub fn grid(centre: DVec3) -> Self {
        let n = 501_u32;
        let corners =
            (0..n * n).map(|i| centre + DVec3::new(f64::from(i % n) - 250.0, f64::from(i / n) - 250.0, 0.0)).collect();
        let triangles: Vec<[u32; 3]> = (0..(n - 1) * (n - 1))
            .flat_map(|i| {
                let at = i / (n - 1) * n + i % (n - 1);
                [[at, at + 1, at + n + 1], [at, at + n + 1, at + n]]
            })
            .collect();
        let name = format!("level grid of {} triangles at x = {}", triangles.len(), centre.x);
        Self { name, corners, triangles, centre, flat: true }
    }

    pub fn world(&self) -> World {
        let corner = |v: u32| self.corners[v as usize];
        let facets = self.triangles.iter().map(|t| Facet::new(t.map(corner).to_vec(), MaterialId(0)).expect("a facet"));
        let only = Instance { mesh: 0, pose: DAffine3::IDENTITY, name: self.name.clone(), id: 1 };
        World::new(vec![Mesh::from_facets(facets.collect())], vec![only], None).expect("a world")
    }

    /// `count` rays at corners, edges and interiors in turn.
    pub fn rays(&self, count: usize, mut cast: impl FnMut(&Ray)) {
        let mut seed = 1_u64;
        let mut random = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((seed >> 11) as f64) * 2f64.powi(-53)
        };
        for i in 0..count {
            let ray = if self.flat {
                // along a row of posts, or 45° across the cells, towards a post or the middle of an edge
                let row = (random() * 400.0).floor() - 200.0 + [0.0, 0.5, random()][i % 3];
                let at = self.centre + DVec3::new((random() * 400.0).floor() - 200.0, row, 0.0);
                let dip = (0.05 + 0.95 * random()).to_radians().tan();
                let along = [DVec3::X, DVec3::Y, DVec3::NEG_X, DVec3::new(1.0, 1.0, 0.0)][i % 4];
                let length = 20.0 * random();
                let origin = at - along * length + DVec3::Z * (dip * length * along.length());
                Ray::new(origin, WorldDir::new(along / along.length() - DVec3::Z * dip))
            } else {
                let t = self.triangles[(random() * self.triangles.len() as f64) as usize];
                let [a, b, c] = t.map(|v| self.corners[v as usize]);
                let (u, v) = (random(), random());
                let target = match i % 3 {
                    0 => a,
                    1 => a + (b - a) * u,
                    _ => a + (b - a) * (u * (1.0 - v)) + (c - a) * (u * v),
                };
                let (z, phi) = (2.0 * random() - 1.0, TAU * random());
                let r = (1.0 - z * z).sqrt();
                let from = self.centre + DVec3::new(r * phi.cos(), r * phi.sin(), z) * [80.0 * random(), 150.0][i & 1];
                // From outside the far side is a target too; a tangent at the limb may pass, so aim within the middle.
                let target = if i & 1 == 1 { self.centre + (target - self.centre) * 0.9 } else { target };
                Ray::new(from, WorldDir::new(target - from))
            };
            cast(&ray);
        }
    }
}
