//! Nanoseconds a pair of directions and model, for 1, 4 and 121 wavelengths, and of the geometry of separable forms alone:
//! `cargo bench -p sunglint-reflectance`. A thousand pairs an iteration, so that microseconds shown are nanoseconds a pair.
#![allow(missing_docs)]

use std::hint::black_box;
use std::sync::Arc;
use std::time::Duration;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use sunglint_plugin::{Args, Component, SpectralValue, Table, TableKey, Value};
use sunglint_radiometry::{Curve, LocalDir, SpectralGrid};
use sunglint_reflectance::{BUILTIN, Bsdf};

type Given = Vec<(String, Value)>;

fn constant(name: &str, value: f64) -> (String, Value) {
    (name.to_string(), Value::Spectrum(SpectralValue::Constant(value)))
}

fn ramp(name: &str, low: f64, high: f64) -> (String, Value) {
    let curve = Curve::linear(&[(0.4, low), (1.01, high)]).expect("ascending");
    (name.to_string(), Value::Spectrum(SpectralValue::Curve(curve)))
}

fn args(name: &str, given: Given) -> Args {
    let model = BUILTIN.iter().find(|model| model.info.name == name).expect("a registered model");
    Args::new(&model.info, given)
}

fn in_plane() -> (String, Value) {
    let angles = [8.0_f64, 30.0, 45.0, 60.0, 75.0];
    let rows = angles.iter().flat_map(|i| {
        let views = angles.iter().flat_map(|v| [*v, -*v]);
        let row = |v: f64| vec![i.to_radians(), v.to_radians(), 0.2 + (-((v + i) / 20.0).powi(2)).exp()];
        views.map(row).collect::<Vec<_>>()
    });
    ("in_plane".to_string(), Value::Table(Table { key: TableKey::None, rows: rows.collect() }))
}

/// A typical use of each model; n and k of a metal depend on wavelength, a coat's do not.
fn cases() -> Vec<(&'static str, &'static str, Given)> {
    let metal = |more: Given| [vec![ramp("n", 0.6, 1.5), ramp("k", 5.0, 9.0)], more].concat();
    let coat = |more: Given| [vec![constant("n", 1.5)], more].concat();
    let category = Value::Word("mostly_diffuse".into());
    let part =
        |name: &str, weight: f64, given: Given| Component { weight, model: name.into(), args: args(name, given) };
    let parts = vec![
        part("ideal", 0.5, vec![ramp("diffuse", 0.1, 0.5)]),
        part("phong", 0.5, vec![constant("diffuse", 0.1), constant("specular", 0.3), constant("exponent", 50.0)]),
    ];
    vec![
        ("ideal", "", vec![ramp("diffuse", 0.1, 0.5)]),
        ("split", "", vec![("category".into(), category), ramp("total", 0.1, 0.5)]),
        ("total_diffuse", "", vec![ramp("reflectance", 0.1, 0.5)]),
        ("phong", "", vec![ramp("diffuse", 0.1, 0.5), constant("specular", 0.1), constant("exponent", 50.0)]),
        ("blinn_phong", "", vec![ramp("diffuse", 0.1, 0.5), constant("specular", 0.1), constant("exponent", 200.0)]),
        ("torrance_sparrow", "", coat(vec![ramp("diffuse", 0.1, 0.5), constant("roughness", 0.2)])),
        (
            "cook_torrance",
            "",
            coat(vec![ramp("diffuse", 0.1, 0.5), constant("specular", 0.5), constant("roughness", 0.2)]),
        ),
        ("cook_torrance", " of metal", metal(vec![constant("specular", 1.0), constant("roughness", 0.2)])),
        ("he_torrance", " geometric", metal(vec![constant("height", 2.0), constant("correlation", 10.0)])),
        ("he_torrance", " waves", metal(vec![constant("height", 0.15), constant("correlation", 2.0)])),
        (
            "maxwell_beard",
            "",
            coat(vec![
                constant("bias", 0.5),
                constant("sigma", 0.15),
                ramp("rho_d", 0.02, 0.1),
                constant("rho_v", 0.01),
            ]),
        ),
        ("ward", "", vec![ramp("diffuse", 0.1, 0.5), constant("specular", 0.1), constant("roughness", 0.2)]),
        ("ggx", " of metal", metal(vec![constant("roughness", 0.2)])),
        ("ggx", " over a base", coat(vec![constant("roughness", 0.2), ramp("diffuse", 0.1, 0.5)])),
        ("rough_conductor", " of metal", metal(vec![constant("roughness", 0.2)])),
        ("oren_nayar", "", vec![ramp("diffuse", 0.1, 0.5), constant("roughness", 0.4)]),
        ("rpv", "", vec![ramp("rho0", 0.05, 0.3)]),
        ("rpv", " k of λ", vec![ramp("rho0", 0.05, 0.3), ramp("k", 0.7, 0.9)]),
        ("ross_li", "", vec![ramp("iso", 0.05, 0.3), ramp("vol", 0.01, 0.1), constant("geo", 0.02)]),
        ("hapke", "", vec![ramp("w", 0.3, 0.9), constant("b0", 1.0)]),
        ("hapke", " rough", vec![ramp("w", 0.3, 0.9), constant("b0", 1.0), constant("roughness", 0.3)]),
        ("measured", " in plane", vec![in_plane()]),
        ("leaf", "", vec![ramp("diffuse", 0.05, 0.45), ramp("transmittance", 0.05, 0.45)]),
        ("mix", " of two", vec![("weights".into(), Value::Mixture(parts))]),
    ]
}

/// Directions above the surface by the golden ratio, so that each run sees the same.
fn directions() -> Vec<LocalDir> {
    (0..1000)
        .map(|k| {
            let (k, golden) = (f64::from(k), 0.618_033_988_749_895);
            LocalDir::from_polar(1.4 * (k / 1000.0).sqrt(), std::f64::consts::TAU * golden * k)
        })
        .collect()
}

fn evaluation(c: &mut Criterion) {
    let edges: Vec<f64> = (0..=61).map(|k| 0.4 + 0.01 * f64::from(k)).collect();
    let grid = SpectralGrid::from_edges(&edges);
    let directions = directions();
    let pairs: Vec<(LocalDir, LocalDir)> =
        directions.iter().zip(directions.iter().cycle().skip(377)).map(|(a, b)| (*a, *b)).collect();
    for (name, of, given) in cases() {
        let model = BUILTIN.iter().find(|model| model.info.name == name).expect("a registered model");
        let bound: Arc<dyn Bsdf> = (model.bind)(&args(name, given), &grid).expect("sound arguments");
        let mut group = c.benchmark_group(format!("{name}{of}"));
        group.throughput(Throughput::Elements(pairs.len() as u64));
        group.sample_size(10).warm_up_time(Duration::from_millis(100)).measurement_time(Duration::from_millis(300));
        for n in [1, 4, 121] {
            let mut f = vec![0.0; n];
            group.bench_function(n.to_string(), |b| {
                b.iter(|| {
                    for (incident, outgoing) in &pairs {
                        bound.eval(*incident, *outgoing, &mut f);
                        black_box(&f);
                    }
                });
            });
        }
        if let Some(separable) = bound.separable() {
            let mut shapes = vec![0.0; separable.coefficients().len()];
            group.bench_function("geometry", |b| {
                b.iter(|| {
                    for (incident, outgoing) in &pairs {
                        separable.shapes(*incident, *outgoing, &mut shapes);
                        black_box(&shapes);
                    }
                });
            });
        }
        group.finish();
    }
}

criterion_group!(benches, evaluation);
criterion_main!(benches);
