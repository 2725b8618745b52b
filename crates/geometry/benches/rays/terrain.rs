//! The terrain and the rays that the benches share.

use glam::DVec3;
use std::f64::consts::TAU;
use sunglint_geometry::{Facet, Instance, MaterialId, Mesh, Ray, World};
use sunglint_radiometry::{Frame, LocalDir, WorldDir};

/// Posts along one side, 1 m apart.
pub const POSTS: usize = 708;

/// Height \[m\]: a sum of sines, hills of 40 m and bumps of 0.3 m.
pub fn height(x: f64, y: f64) -> f64 {
    25.0 * (0.012 * x).sin() * (0.009 * y + 0.7).cos()
        + 8.0 * (0.051 * x + 0.3).sin() * (0.043 * y).sin()
        + 1.5 * (0.23 * x + 0.11 * y).sin()
        + 0.3 * (0.9 * x).sin() * (1.1 * y).cos()
}

/// Posts, and two triangles a cell.
pub fn grid() -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let posts = (0..POSTS * POSTS).map(|i| {
        let (x, y) = ((i % POSTS) as f64, (i / POSTS) as f64);
        DVec3::new(x, y, height(x, y)).as_vec3().as_dvec3()
    });
    let cells = (0..(POSTS - 1) * (POSTS - 1)).flat_map(|i| {
        let at = (i / (POSTS - 1) * POSTS + i % (POSTS - 1)) as u32;
        let n = POSTS as u32;
        [[at, at + 1, at + n + 1], [at, at + n + 1, at + n]]
    });
    (posts.collect(), cells.collect())
}

pub fn world() -> World {
    let (posts, cells) = grid();
    let facets =
        cells.iter().map(|t| Facet::new(t.map(|v| posts[v as usize]).to_vec(), MaterialId(0)).unwrap()).collect();
    let only = Instance { mesh: 0, pose: glam::DAffine3::IDENTITY, name: "terrain".into(), id: 1 };
    World::new(vec![Mesh::from_facets(facets)], vec![only], None).unwrap()
}

/// Rays of a camera 420 m up that looks down by 50°, and from its hits: one cosine-distributed ray, one to a sun 15° high.
pub struct Rays {
    pub camera: Vec<Ray>,
    pub bounce: Vec<Ray>,
    pub sun: Vec<Ray>,
}

pub fn rays(world: &World, side: usize) -> Rays {
    let eye = DVec3::new(354.0, -120.0, 420.0);
    let ahead = (DVec3::new(354.0, 354.0, 0.0) - eye).normalize();
    let (right, up) = (DVec3::X, DVec3::X.cross(ahead));
    let camera: Vec<Ray> = (0..side * side)
        .map(|i| {
            let at = |k: usize| (k as f64 + 0.5) / side as f64 - 0.5;
            Ray::new(eye, WorldDir::new(ahead + 0.9 * at(i % side) * right + 0.9 * at(i / side) * up))
        })
        .collect();
    let sun = WorldDir::from_zenith_azimuth(75f64.to_radians(), 2.1);
    let mut random = Random(7);
    let (mut bounce, mut to_sun) = (Vec::new(), Vec::new());
    for hit in camera.iter().filter_map(|r| world.closest(r)) {
        let (r, phi) = (random.next().sqrt(), TAU * random.next());
        let local = LocalDir::from_unit(DVec3::new(r * phi.cos(), r * phi.sin(), (1.0 - r * r).sqrt()));
        bounce.push(hit.leave(Frame::about(hit.normal).to_world(local)));
        to_sun.push(hit.leave(sun));
    }
    Rays { camera, bounce, sun: to_sun }
}

/// SplitMix64.
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 * 2f64.powi(-53)
    }
}
