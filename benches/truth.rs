//! The path from scene text to radiance, on the examples: `cargo bench --bench truth`.
//!
//! Compare the rows of one run with each other; machines differ. `truth/…/31_times` over `truth/…/1_time` is what each
//! further time costs.

use criterion::{Criterion, criterion_group, criterion_main};
use sunglint::{Options, Plan, Run};

fn plan(scene: &str, options: &Options) -> Plan {
    let checked = sunglint::open(scene).unwrap_or_else(|refused| panic!("{refused}"));
    Plan::new(checked, options).unwrap_or_else(|refused| panic!("{refused}"))
}

/// A tile in the middle of the truth scene, 32 × 32 pixels of 640 × 480, 64 samples: panels and shed.
fn middle_tile(run: &Run) -> sunglint::tracer::TileResult {
    run.lit().render_tile(sunglint::tracer::Tile { x: 224, y: 160, width: 32, height: 32 })
}

fn truth(criterion: &mut Criterion) {
    let scene = "examples/truth/truth.glint";
    let one = Options { times: vec!["1992-06-18T160100Z".into()], ..Options::default() };
    let mut group = criterion.benchmark_group("truth/tile_32x32_64_samples");
    group.sample_size(10);
    for (name, options) in [("1_time", &one), ("31_times", &Options::default())] {
        let plan = plan(scene, options);
        for run in plan.runs() {
            group.bench_function(format!("{}/{name}", run.experiment), |bencher| bencher.iter(|| middle_tile(run)));
        }
    }
    group.finish();
}

fn front_end(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("front_end");
    group.sample_size(20);
    group.bench_function("check/truth", |bencher| bencher.iter(|| sunglint::check("examples/truth/truth.glint")));
    group.bench_function("plan/truth", |bencher| {
        bencher.iter(|| plan("examples/truth/truth.glint", &Options::default()))
    });
    group.bench_function("render/minimal", |bencher| {
        let plan = plan("examples/minimal/minimal.glint", &Options::default());
        bencher.iter(|| plan.runs()[0].render());
    });
    group.finish();
}

criterion_group!(benches, front_end, truth);
criterion_main!(benches);
