//! The provider `layers`, through the trait: problems solved by another code and in closed form, and bad files.

use std::f64::consts::PI;
use std::sync::Arc;

use sunglint_atmosphere::{Atmosphere, BUILTIN, Column, Needs, Path, SkyState, Sun};
use sunglint_plugin::{Args, BindError, FileArg, SpectralValue, Value};
use sunglint_radiometry::{Curve, SpectralGrid, WorldDir};

const EVERYTHING: Needs =
    Needs { direct_beam: true, diffuse_irradiance: true, directional_sky: true, path: true, path_heights: None };

fn grid() -> SpectralGrid {
    SpectralGrid::from_edges(&[0.5, 0.501])
}

fn file(name: &str, text: &[u8]) -> Value {
    Value::File(FileArg { name: name.to_string(), bytes: text.into() })
}

fn bind(given: Vec<(&str, Value)>) -> Result<Arc<dyn Atmosphere>, BindError> {
    let model = BUILTIN.iter().find(|model| model.info.name == "layers").unwrap();
    let args = Args::new(&model.info, given.into_iter().map(|(name, value)| (name.to_string(), value)));
    (model.bind)(&args, &grid())
}

/// Layers under a sun of irradiance 1.
fn layers(text: &str, streams: u64, more: Vec<(&str, Value)>) -> Arc<dyn Atmosphere> {
    let mut given = vec![
        ("file", file("layers.csv", text.as_bytes())),
        ("streams", Value::Count(streams)),
        ("accuracy", Value::Number(1e-9)),
        ("solar_irradiance", Value::Spectrum(SpectralValue::Constant(1.0))),
    ];
    given.extend(more);
    bind(given).unwrap()
}

fn column(albedo: f64, grid: &SpectralGrid) -> Column {
    Column {
        profile: "us_standard".to_string(),
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
        ground_albedo: vec![albedo; grid.len()],
    }
}

fn solve(provider: &Arc<dyn Atmosphere>, albedo: f64, mu0: f64) -> Box<dyn SkyState> {
    let sun = Sun::at(mu0.acos(), 0.0);
    provider.solve(&column(albedo, &grid()), &[sun], &grid(), &EVERYTHING).unwrap().remove(0)
}

fn sky(state: &dyn SkyState, zenith: f64, azimuth: f64) -> f64 {
    let mut radiance = vec![0.0; grid().len()];
    state.sky_radiance(WorldDir::from_zenith_azimuth(zenith, azimuth), &mut radiance);
    radiance[0]
}

/// τ₂ and L_u from a target at one height to a sensor at another, `zenith` being that of the ray towards the sensor.
fn path(state: &dyn SkyState, (from, to): (f64, f64), zenith: f64, azimuth: f64) -> (f64, f64) {
    let (mut tau, mut radiance) = (vec![0.0; grid().len()], vec![0.0; grid().len()]);
    let towards_sensor = WorldDir::from_zenith_azimuth(zenith, azimuth);
    let length = (to - from) / zenith.cos();
    state.path(&Path { target_height: from, sensor_height: to, length, towards_sensor }, &mut tau, &mut radiance);
    (tau[0], radiance[0])
}

/// What a sensor above all air sees: the path, and the ground through it.
fn from_above(state: &dyn SkyState, top: f64, albedo: f64, mu0: f64, zenith: f64, azimuth: f64) -> f64 {
    let ground = albedo / PI * (mu0 * state.sun_transmittance()[0] + state.diffuse_irradiance()[0]);
    let (tau, radiance) = path(state, (0.0, top), zenith, azimuth);
    radiance + tau * ground
}

fn records(text: &str) -> Vec<Vec<String>> {
    let mut reader = csv::ReaderBuilder::new().comment(Some(b'#')).from_reader(text.as_bytes());
    reader.records().map(|record| record.unwrap().iter().map(str::to_string).collect()).collect()
}

fn number(text: &str) -> f64 {
    text.parse().unwrap()
}

/// A problem of `tests/data/plane_parallel_*.csv`.
struct Problem {
    id: String,
    file: String,
    layers: usize,
    g: f64,
    mu0: f64,
    albedo: f64,
}

fn problems() -> Vec<Problem> {
    let rows = records(include_str!("data/plane_parallel_problems.csv"));
    (records(include_str!("data/plane_parallel_suns.csv")).iter())
        .map(|sun| {
            let own: Vec<_> = rows.iter().filter(|row| row[0] == sun[0]).collect();
            let layers = 1 + own.iter().map(|row| row[1].parse::<usize>().unwrap()).max().unwrap();
            let mut file = "top_km,bottom_km,component,optical_depth,single_scattering_albedo,phase,asymmetry\n".to_string();
            for (i, row) in own.iter().enumerate() {
                let bottom = layers - 1 - row[1].parse::<usize>().unwrap();
                let g = if row[3] == "hg" { row[4].as_str() } else { "" };
                file += &format!("{},{bottom},{i},{},1,{},{g}\n", bottom + 1, row[5], row[3]);
                if number(&row[2]) > 0.0 && own[..i].iter().all(|other| other[1] != row[1]) {
                    file += &format!("{},{bottom},gas,{},0,,\n", bottom + 1, row[2]);
                }
            }
            let g = own.iter().filter(|row| row[3] == "hg").map(|row| number(&row[4])).fold(0.0, f64::max);
            Problem { id: sun[0].clone(), file, layers, g, mu0: number(&sun[1]), albedo: number(&sun[2]) }
        })
        .collect()
}

/// The largest relative error and where it is.
#[derive(Default)]
struct Worst(f64, String);

impl Worst {
    fn see(&mut self, found: f64, due: f64, place: impl FnOnce() -> String) {
        let error = (found / due - 1.0).abs();
        if error.is_nan() || error > self.0 {
            *self = Self(error, format!("{}: {found:.6e} for {due:.6e}", place()));
        }
    }
}

/// Errors against CDISORT.
#[test]
fn survey() {
    let radiances = records(include_str!("data/plane_parallel.csv"));
    let fluxes = records(include_str!("data/plane_parallel_fluxes.csv"));
    for streams in [16, 32, 64] {
        let mut by: std::collections::BTreeMap<(String, &str), Worst> = Default::default();
        for problem in problems() {
            let provider = layers(&problem.file, streams, vec![]);
            let (albedo, mu0) = (problem.albedo, problem.mu0);
            let state = solve(&provider, albedo, mu0);
            let class = format!("{:.2}", problem.g);
            let flux = fluxes.iter().find(|row| row[0] == problem.id && row[1] == "bottom").unwrap();
            let id = &problem.id;
            by.entry((class.clone(), "E_d")).or_default().see(state.diffuse_irradiance()[0], number(&flux[4]), || id.clone());
            by.entry((class.clone(), "E_b")).or_default().see(mu0 * state.sun_transmittance()[0], number(&flux[3]), || id.clone());
            for row in radiances.iter().filter(|row| row[0] == problem.id && row[1] != "middle") {
                let (zenith, turn) = (number(&row[4]).acos(), number(&row[5]).to_radians());
                let place = || format!("{id} {} mu {} dphi {} cos {}", row[3], row[4], row[5], row[6]);
                match (row[1].as_str(), row[3].as_str()) {
                    ("top", "up") => {
                        let found = from_above(&*state, 1000.0 * problem.layers as f64, albedo, mu0, zenith, PI + turn);
                        by.entry((class.clone(), "up")).or_default().see(found, number(&row[7]), place);
                    }
                    ("bottom", "down") => {
                        let found = sky(&*state, zenith, turn);
                        let near = if number(&row[6]) > 0.94 { "down <20" } else { "down" };
                        by.entry((class.clone(), near)).or_default().see(found, number(&row[7]), place);
                        let (_, found) = path(&*state, (1000.0 * problem.layers as f64, 0.0), PI - zenith, PI + turn);
                        let near = if number(&row[6]) > 0.94 { "down path <20" } else { "down path" };
                        by.entry((class.clone(), near)).or_default().see(found, number(&row[7]), place);
                    }
                    _ => {}
                }
            }
        }
        for ((g, what), Worst(error, place)) in by {
            println!("{streams} g {g} {what}: {error:.2e} {place}");
        }
    }
}
