//! The same rays on the same terrain through Embree 3 and through sunglint-geometry, interleaved in one process on one
//! thread, and the rays that leak through closed surfaces in both. Run as the README says.

mod embree;
#[path = "../../../../crates/geometry/examples/leaks/scenes.rs"]
mod leak_scenes;
#[allow(dead_code)]
#[path = "../../../../crates/geometry/benches/rays/terrain.rs"]
mod terrain;

use embree::{Mode, Scene};
use std::time::Instant;
use sunglint_geometry::Ray;

const REPEATS: usize = 5;

fn main() {
    let leak_rays = std::env::args().nth(1).and_then(|a| a.parse().ok()).unwrap_or(10_000_000_usize);
    speed();
    if leak_rays > 0 {
        leaks(leak_rays);
    }
}

fn speed() {
    let (posts, cells) = terrain::grid();
    let start = Instant::now();
    let world = terrain::world();
    println!(
        "build: sunglint {:.2} s ({:.0} B a triangle), {} triangles",
        start.elapsed().as_secs_f64(),
        world.memory_bytes() as f64 / world.triangle_count() as f64,
        world.triangle_count()
    );
    let scenes = [Mode::Default, Mode::Robust].map(|mode| {
        let start = Instant::now();
        let scene = Scene::new(&posts, &cells, mode);
        println!("build: Embree {mode:?} {:.2} s", start.elapsed().as_secs_f64());
        scene
    });
    let rays = terrain::rays(&world, 800);
    println!(
        "\n{:<24}{:>12}{:>12}{:>12}{:>12}{:>12}",
        "Mray/s, medians of 5", "sunglint", "default", "ROBUST", "/default", "/ROBUST"
    );
    for (name, rays, any) in [
        ("camera closest", &rays.camera, false),
        ("cosine bounce closest", &rays.bounce, false),
        ("cosine bounce any", &rays.bounce, true),
        ("sun 15 deg any", &rays.sun, true),
    ] {
        let mut rates = [const { Vec::new() }; 3];
        let mut hits = [0; 3];
        for _ in 0..REPEATS {
            for (engine, rates) in rates.iter_mut().enumerate() {
                let start = Instant::now();
                hits[engine] = rays
                    .iter()
                    .filter(|r| match (engine, any) {
                        (0, false) => world.closest(r).is_some(),
                        (0, true) => world.occluded(r),
                        (e, false) => scenes[e - 1].closest(r),
                        (e, true) => scenes[e - 1].occluded(r),
                    })
                    .count();
                rates.push(rays.len() as f64 / start.elapsed().as_secs_f64() * 1e-6);
            }
        }
        let [own, default, robust] = rates.map(|mut r| {
            r.sort_by(f64::total_cmp);
            r[REPEATS / 2]
        });
        println!(
            "{name:<24}{own:>12.2}{default:>12.2}{robust:>12.2}{:>12.2}{:>12.2}   hits {hits:?}",
            own / default,
            own / robust
        );
    }
}

fn leaks(count: usize) {
    println!("\n{:<44}{:>12}{:>12}{:>12}", format!("leaks of {count} rays"), "sunglint", "default", "ROBUST");
    for scene in leak_scenes::all() {
        let world = scene.world();
        let peers = [Mode::Default, Mode::Robust].map(|mode| Scene::new(&scene.corners, &scene.triangles, mode));
        let mut leaked = [0_usize; 3];
        scene.rays(count, |ray: &Ray| {
            leaked[0] += usize::from(world.closest(ray).is_none());
            leaked[1] += usize::from(!peers[0].closest(ray));
            leaked[2] += usize::from(!peers[1].closest(ray));
        });
        println!("{:<44}{:>12}{:>12}{:>12}", scene.name, leaked[0], leaked[1], leaked[2]);
    }
}
