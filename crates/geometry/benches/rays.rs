//! Rays a second, one thread, over a terrain of 999,698 triangles: `cargo bench -p sunglint-geometry`.
#![allow(missing_docs)]

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::DVec3;
use std::hint::black_box;
use sunglint_geometry::Hit;
use sunglint_radiometry::WorldDir;

#[path = "rays/terrain.rs"]
mod terrain;

fn rays(c: &mut Criterion) {
    let world = terrain::world();
    assert_eq!(world.triangle_count(), 999_698);
    let cases = terrain::rays(&world, 512);
    let mut group = c.benchmark_group("terrain_999698_triangles");
    for (name, rays, any) in [
        ("camera_closest", &cases.camera, false),
        ("cosine_bounce_closest", &cases.bounce, false),
        ("cosine_bounce_any", &cases.bounce, true),
        ("sun_15_deg_any", &cases.sun, true),
    ] {
        group.throughput(Throughput::Elements(rays.len() as u64)).sample_size(10);
        group.bench_function(name, |b| {
            b.iter(|| {
                if any {
                    rays.iter().filter(|r| world.occluded(black_box(r))).count()
                } else {
                    rays.iter().filter(|r| world.closest(black_box(r)).is_some()).count()
                }
            });
        });
    }
    // Footprints of 0.6 m under a sun 40° high and its disk.
    let sun = WorldDir::from_zenith_azimuth(50f64.to_radians(), 2.1);
    let hits: Vec<Hit> =
        cases.camera.iter().filter_map(|r| world.closest(r)).filter(|h| h.normal.dot(sun.vec()) > 0.0).collect();
    let half = DVec3::new(0.3, 0.3, 0.1);
    group.throughput(Throughput::Elements(hits.len() as u64));
    group.bench_function("shaft_is_clear", |b| {
        let clear = |h: &&Hit| world.shaft_is_clear(h.point - half, h.point + half, h.point, h.normal, sun, 0.00465);
        b.iter(|| hits.iter().filter(|h| clear(black_box(h))).count());
    });
    group.finish();
}

criterion_group!(benches, rays);
criterion_main!(benches);
