//! Time that columns of air take: `cargo bench -p sunglint-atmosphere`, on one thread with `RAYON_NUM_THREADS=1`.
//!
//! `disort` is the problem of `benches/peers/plane_parallel/time_disort.py`, which runs beside it: 33 layers at 122
//! wavelengths, all fluxes and the sky in 248 directions. `day` is what `examples/truth` asks of the air: four bands, 31 suns.

use std::fmt::Write as _;
use std::hint::black_box;
use std::sync::Arc;
use std::time::Duration;

use criterion::{Criterion, criterion_group, criterion_main};
use sunglint_atmosphere::{Atmosphere, BUILTIN, Column, Needs, Sun};
use sunglint_plugin::{Args, FileArg, Value};
use sunglint_radiometry::{Bin, SpectralGrid};

const SKY: Needs =
    Needs { direct_beam: true, diffuse_irradiance: true, directional_sky: true, path: false, path_heights: None };

fn bound(name: &str, given: Vec<(&str, Value)>, grid: &SpectralGrid) -> Arc<dyn Atmosphere> {
    let model = BUILTIN.iter().find(|model| model.info.name == name).expect("a built-in");
    let given = given.into_iter().map(|(name, value)| (name.to_string(), value));
    (model.bind)(&Args::new(&model.info, given), grid).expect("the arguments are well formed")
}

fn suns(zeniths_deg: impl Iterator<Item = f64>) -> Vec<Sun> {
    zeniths_deg.map(|zenith| Sun::at(zenith.to_radians(), 1.0)).collect()
}

/// The column of `time_disort.py`: air, haze, and an absorber that swings over the spectrum.
fn layers() -> String {
    let kilometres: Vec<f64> =
        (0..26).map(f64::from).chain([30.0, 35.0, 40.0, 45.0, 50.0, 60.0, 70.0, 100.0]).rev().collect();
    let mut text =
        String::from("top_m,bottom_m,component,wavelength_um,optical_depth,single_scattering_albedo,phase,asymmetry\n");
    for pair in kilometres.windows(2) {
        let share =
            |scale: f64| ((-pair[1] / scale).exp() - (-pair[0] / scale).exp()) / (1.0 - (-kilometres[0] / scale).exp());
        for um in (0..=120).map(|i| 0.4 + 0.005 * f64::from(i)) {
            let air = 0.00864 * um.powf(-4.07) * share(8.0);
            let haze = if pair[1] < 10.0 { 0.2 * (um / 0.55).powf(-1.3) * share(2.0) } else { 0.0 };
            let gas = 0.5 * (20.0 * um).sin().powi(8) * share(3.0);
            let (top, bottom) = (1e3 * pair[0], 1e3 * pair[1]);
            writeln!(text, "{top},{bottom},air,{um},{air:e},1,rayleigh,").expect("a string grows");
            writeln!(text, "{top},{bottom},haze,{um},{haze:e},0.95,hg,0.65").expect("a string grows");
            writeln!(text, "{top},{bottom},gas,{um},{gas:e},0,rayleigh,").expect("a string grows");
        }
    }
    text
}

fn disort(criterion: &mut Criterion) {
    let edges: Vec<f64> = (0..=61).map(|i| 0.4 + 0.6 * f64::from(i) / 61.0).collect();
    let grid = SpectralGrid::from_edges(&edges);
    let column = Column { ground_albedo: vec![0.2; grid.len()], ..Column::default() };
    let text = layers();
    let mut group = criterion.benchmark_group("disort");
    group.sample_size(10).measurement_time(Duration::from_secs(8));
    for (geometry, streams, n) in [
        ("plane", 8, 1),
        ("plane", 16, 1),
        ("plane", 16, 30),
        ("spherical", 8, 1),
        ("spherical", 16, 1),
        ("spherical", 16, 30),
    ] {
        let file = FileArg { name: "column.csv".into(), bytes: text.as_bytes().into() };
        let given = vec![
            ("file", Value::File(file)),
            ("geometry", Value::Word(geometry.into())),
            ("streams", Value::Count(streams)),
        ];
        let air = bound("layers", given, &grid);
        // The first stands at cos θ = 0.6.
        let suns = suns((0..n).map(|i| 53.13 - 1.5 * f64::from(i) + if i > 20 { 55.0 } else { 0.0 }));
        group.bench_function(format!("{geometry}, {streams} streams, suns: {n}"), |bencher| {
            bencher.iter(|| black_box(air.solve(&column, &suns, &grid, &SKY).expect("the column is solved")));
        });
    }
    group.finish();
}

/// Bins of 5 nm over the bands of the truth scene.
fn day(criterion: &mut Criterion) {
    let air = bound("layered", Vec::new(), &SpectralGrid::from_edges(&[]));
    let bins = [(420, 520), (500, 580), (600, 750), (740, 1000)].into_iter().flat_map(|(from, to)| {
        let edge = |nm: i32| 1e-3 * f64::from(nm);
        (from..to).step_by(5).map(move |nm| Bin { lower: edge(nm), upper: edge(nm + 5), band: None })
    });
    let mut bins: Vec<Bin> = bins.collect();
    bins.sort_by(|a, b| a.lower.total_cmp(&b.lower));
    bins.dedup_by(|a, b| a.lower == b.lower);
    let grid = SpectralGrid::with_g(bins, Vec::new(), |bin| air.g_weights(bin));
    let column = Column { visibility: Some(23e3), ground_albedo: vec![0.2; grid.len()], ..Column::default() };
    let needs = Needs { path: true, path_heights: Some((-0.05, 16.0)), ..SKY };
    let mut group = criterion.benchmark_group("day");
    group.sample_size(10).measurement_time(Duration::from_secs(15));
    for n in [1, 31] {
        // From rise to set over a noon of 20°.
        let suns = suns((0..n).map(|i| 20.0 + 70.0 * (f64::from(i) / 15.0 - 1.0).abs()));
        group.bench_function(format!("{} entries, suns: {n}", grid.len()), |bencher| {
            bencher.iter(|| black_box(air.solve(&column, &suns, &grid, &needs).expect("the column is solved")));
        });
    }
    group.finish();
}

criterion_group!(benches, disort, day);
criterion_main!(benches);
