//! Triangles a second from the text of an OBJ file to a mesh, one thread: `cargo bench -p sunglint-geometry --bench load_obj`.
#![allow(missing_docs)]

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use std::hint::black_box;
use sunglint_geometry::{MaterialId, Up, read_obj};

#[path = "load_obj/heights.rs"]
mod heights;

fn load_obj(c: &mut Criterion) {
    let mut group = c.benchmark_group("load_obj");
    for triangles in [100_000_usize, 1_000_000] {
        let text = heights::obj(triangles);
        group.throughput(Throughput::Elements(triangles as u64)).sample_size(10);
        group.bench_function(triangles.to_string(), |b| {
            b.iter(|| {
                let read = read_obj(black_box(text.as_bytes()), 1.0, Up::Z, &mut |_| Some(MaterialId(0)));
                assert_eq!(read.expect("a sound file").mesh.triangle_count(), triangles);
            });
        });
    }
    group.finish();
}

criterion_group!(benches, load_obj);
criterion_main!(benches);
