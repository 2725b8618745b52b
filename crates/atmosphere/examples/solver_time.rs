//! Time of the solver behind `layers` and `layered` for the problem of `benches/peers/plane_parallel/time_disort.py`: 33 layers
//! at 122 wavelengths, the sky in 209 directions and all fluxes, one thread, median of five.
//!
//! ```sh
//! RAYON_NUM_THREADS=1 cargo run --release -p sunglint-atmosphere --example solver_time
//! ```

use std::fmt::Write as _;
use std::time::Instant;

use sunglint_atmosphere::{BUILTIN, Column, Needs, Sun};
use sunglint_plugin::{Args, FileArg, Value};
use sunglint_radiometry::SpectralGrid;

fn main() {
    let edges: Vec<f64> = (0..=61).map(|i| 0.4 + 0.6 * f64::from(i) / 61.0).collect();
    let grid = SpectralGrid::from_edges(&edges);
    let heights: Vec<f64> = (0..=33).rev().map(|i| 100_000.0 * (f64::from(i) / 33.0).powi(2)).collect();
    let mut text =
        String::from("top_m,bottom_m,component,wavelength_um,optical_depth,single_scattering_albedo,phase,asymmetry\n");
    for pair in heights.windows(2) {
        let share = |scale: f64| (-pair[1] / scale).exp() - (-pair[0] / scale).exp();
        for um in (0..=60).map(|i| 0.4 + 0.01 * f64::from(i)) {
            let air = 0.098 * (0.55 / um).powi(4) * share(8000.0);
            let haze = if pair[1] < 12e3 { 0.25 * (0.55 / um).powf(1.3) * share(2000.0) } else { 0.0 };
            writeln!(text, "{},{},air,{um},{air:e},1,rayleigh,", pair[0], pair[1]).expect("a string grows");
            writeln!(text, "{},{},haze,{um},{haze:e},0.93,hg,0.65", pair[0], pair[1]).expect("a string grows");
        }
    }
    let model = BUILTIN.iter().find(|model| model.info.name == "layers").expect("a built-in");
    let needs = Needs { direct_beam: true, diffuse_irradiance: true, directional_sky: true, ..Needs::default() };
    for (geometry, streams, suns) in [
        ("plane", 8, 1),
        ("plane", 16, 1),
        ("plane", 16, 30),
        ("spherical", 8, 1),
        ("spherical", 16, 1),
        ("spherical", 16, 30),
    ] {
        let file = FileArg { name: "column.csv".into(), bytes: text.as_bytes().into() };
        let given = [
            ("file".to_string(), Value::File(file)),
            ("geometry".to_string(), Value::Word(geometry.into())),
            ("streams".to_string(), Value::Count(streams)),
        ];
        let provider = (model.bind)(&Args::new(&model.info, given), &grid).expect("the column is well formed");
        let column = Column {
            profile: "us_standard".into(),
            sounding: None,
            clouds: Vec::new(),
            elevation: 0.0,
            pressure: None,
            temperature: None,
            humidity: None,
            water: None,
            ozone: None,
            no2: None,
            visibility: None,
            aod: None,
            aerosol: None,
            ground_albedo: vec![0.1; grid.len()],
        };
        let suns: Vec<Sun> = (0..suns).map(|i| Sun::at((80.0 - 2.0 * f64::from(i)).to_radians(), 1.0)).collect();
        let mut seconds: Vec<f64> = (0..5)
            .map(|_| {
                let start = Instant::now();
                let skies = provider.solve(&column, &suns, &grid, &needs).expect("the column is solved");
                assert_eq!(skies.len(), suns.len());
                start.elapsed().as_secs_f64()
            })
            .collect();
        seconds.sort_by(f64::total_cmp);
        println!("{geometry}, {streams} streams, {} suns: {:.3} s", suns.len(), seconds[2]);
    }
}
