//! The provider `layered` through its trait: Koschmieder, energy, and what the adapted spectrum costs.

use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::sync::Arc;

use sunglint_atmosphere::{Atmosphere, BUILTIN, Column, Needs, Path, SkyState, Sun};
use sunglint_plugin::{Args, Value};
use sunglint_radiometry::{Bin, SpectralGrid, WorldDir};

fn layered(given: &[(&str, &str)], grid: &SpectralGrid) -> Arc<dyn Atmosphere> {
    let model = BUILTIN.iter().find(|model| model.info.name == "layered").unwrap();
    let given = given.iter().map(|(name, word)| (name.to_string(), Value::Word(word.to_string())));
    (model.bind)(&Args::new(&model.info, given), grid).unwrap()
}

/// Bins of 5 nm, two to a band of 10 nm.
fn grid(from_nm: u32, to_nm: u32, provider: &Arc<dyn Atmosphere>) -> SpectralGrid {
    let edge = |i: u32| 1e-3 * f64::from(from_nm + 5 * i);
    let bins = (0..(to_nm - from_nm) / 5).map(|i| Bin { lower: edge(i), upper: edge(i + 1), band: None });
    SpectralGrid::with_g(bins.collect(), Vec::new(), |bin| provider.g_weights(bin))
}

fn column(grid: &SpectralGrid) -> Column {
    Column { profile: "midlatitude_summer".to_string(), ground_albedo: vec![0.2; grid.len()], ..Column::default() }
}

const ALL: Needs =
    Needs { direct_beam: true, diffuse_irradiance: true, directional_sky: true, path: true, path_heights: None };

fn solve(words: &[(&str, &str)], grid: &SpectralGrid, column: &Column, suns_deg: &[f64]) -> Vec<Box<dyn SkyState>> {
    let suns: Vec<Sun> = suns_deg.iter().map(|zenith| Sun::at(zenith.to_radians(), 0.0)).collect();
    layered(words, grid).solve(column, &suns, grid, &ALL).unwrap()
}

/// Means over bands of 10 nm.
fn bands(grid: &SpectralGrid, spectrum: &[f64]) -> Vec<f64> {
    let mut sums = vec![(0.0, 0.0); grid.bins().len().div_ceil(2)];
    for (entry, value) in grid.entries().iter().zip(spectrum) {
        let sum = &mut sums[entry.bin as usize / 2];
        *sum = (sum.0 + entry.weight * value, sum.1 + entry.weight);
    }
    sums.into_iter().map(|(sum, weight)| sum / weight).collect()
}

/// At a path length of the meteorological range 2 % of the contrast is left at 0.55 µm: τ₂ = e^(−3.912 x/V) on the level at
/// the ground, but for what gases take and for the layers' means (the lowest is 50 m thick).
#[test]
fn contrast_on_the_level_falls_to_two_percent_at_the_visibility() {
    let grid = SpectralGrid::from_edges(&[0.5499, 0.5501]);
    for visibility in [2e3, 5e3, 10e3, 23e3, 50e3] {
        let column = Column { visibility: Some(visibility), no2: Some(0.0), ozone: Some(0.0), ..column(&grid) };
        let sky = solve(&[("geometry", "plane")], &grid, &column, &[40.0]).remove(0);
        for share in [0.1, 0.5, 1.0] {
            let towards_sensor = WorldDir::from_zenith_azimuth(PI / 2.0, 1.0);
            let path = Path { target_height: 1.0, sensor_height: 1.0, length: share * visibility, towards_sensor };
            let (mut tau, mut radiance) = (vec![0.0; grid.len()], vec![0.0; grid.len()]);
            sky.path(&path, &mut tau, &mut radiance);
            let found = -tau[0].ln() / share;
            eprintln!("visibility {visibility} m, {share}: -ln tau2 V/x = {found:.4}");
            assert!((found / 3.912 - 1.0).abs() < 0.02, "{visibility} {share}: {found}");
        }
    }
}

#[derive(Default)]
struct Worst(BTreeMap<String, (f64, f64, usize, String)>);

impl Worst {
    fn add(&mut self, class: &str, error: f64, place: impl FnOnce() -> String) {
        let entry = self.0.entry(class.to_string()).or_default();
        (entry.1, entry.2) = (entry.1 + error * error, entry.2 + 1);
        if error.abs() > entry.0.abs() {
            (entry.0, entry.3) = (error, place());
        }
    }

    fn print(&self, title: &str) {
        eprintln!("{title}: class, worst, root mean square, cases, where the worst is");
        for (class, (worst, squares, n, place)) in &self.0 {
            eprintln!(
                "  {class}: {:+.3} %, {:.3} %, {n}, {place}",
                100.0 * worst,
                100.0 * (squares / *n as f64).sqrt()
            );
        }
    }
}

const PATHS: [(&str, f64, f64); 3] = [("30 m", 30.0, 60.0), ("3 km", 3e3, 40.0), ("700 km", 700e3, 20.0)];

fn adapted_against_full(from_nm: u32, to_nm: u32, suns_deg: &[f64]) -> Worst {
    let grid = grid(from_nm, to_nm, &layered(&[], &SpectralGrid::from_edges(&[])));
    let column = column(&grid);
    let start = std::time::Instant::now();
    let full = solve(&[("spectrum", "full")], &grid, &column, suns_deg);
    let middle = start.elapsed();
    let adapted = solve(&[], &grid, &column, suns_deg);
    eprintln!("{} entries: full {middle:.2?}, adapted {:.2?}", grid.len(), start.elapsed() - middle);
    let mut worst = Worst::default();
    for ((full, adapted), sun) in full.iter().zip(&adapted).zip(suns_deg) {
        let (a, b) = (adapted.diffuse_irradiance(), full.diffuse_irradiance());
        // Nothing is left where a gas is black: what little is, rounding spoils.
        a.iter().zip(b.iter()).for_each(|(a, b)| assert!((a - b).abs() <= 1e-9 * b + 1e-20, "{a} {b}"));
        let mut compare = |class: &str, a: &[f64], b: &[f64], place: &str| {
            for (i, (a, b)) in bands(&grid, a).into_iter().zip(bands(&grid, b)).enumerate() {
                let wavelength = f64::from(from_nm) + 10.0 * i as f64 + 5.0;
                assert!(a.is_finite() && b > 0.0, "{wavelength} nm, sun {sun}, {place}: {a} {b}");
                worst.add(class, a / b - 1.0, || format!("{wavelength} nm, sun {sun}, {place}"));
            }
        };
        let mut l = [vec![0.0; grid.len()], vec![0.0; grid.len()]];
        for zenith in [0.0f64, 30.0, 55.0, 75.0, 85.0, 89.0] {
            for azimuth in [0.0f64, 60.0, 120.0, 180.0] {
                let direction = WorldDir::from_zenith_azimuth(zenith.to_radians(), azimuth.to_radians());
                adapted.sky_radiance(direction, &mut l[0]);
                full.sky_radiance(direction, &mut l[1]);
                compare(&format!("sun {sun}, sky"), &l[0], &l[1], &format!("zenith {zenith}, azimuth {azimuth}"));
            }
        }
        for (name, height, zenith) in PATHS {
            for azimuth in [0.0f64, 90.0, 180.0] {
                let towards_sensor = WorldDir::from_zenith_azimuth(f64::to_radians(zenith), azimuth.to_radians());
                let r: f64 = 6_371_230.0;
                let mu = zenith.to_radians().cos();
                let length = (r * r * mu * mu + 2.0 * r * height + height * height).sqrt() - r * mu;
                let path = Path { target_height: 0.0, sensor_height: height, length, towards_sensor };
                let mut tau = vec![0.0; grid.len()];
                adapted.path(&path, &mut tau, &mut l[0]);
                full.path(&path, &mut tau, &mut l[1]);
                compare(&format!("sun {sun}, path {name}"), &l[0], &l[1], &format!("azimuth {azimuth}"));
            }
        }
    }
    worst
}

/// Radiances carried over from the ladder against those solved at every entry, bands of 10 nm about the oxygen B band and
/// the water band at 0.72 µm.
#[test]
fn the_adapted_spectrum_is_that_of_every_entry() {
    let worst = adapted_against_full(660, 760, &[60.0]);
    worst.print("adapted spectrum against full");
    for (class, (error, _, _, place)) in &worst.0 {
        assert!(error.abs() < 0.01, "{class}: {error:+.4} at {place}");
    }
}

/// The same over all of 0.4–1.0 µm: the figures of docs/VALIDATION.md.
#[test]
#[ignore = "long; prints"]
fn the_adapted_spectrum_everywhere() {
    adapted_against_full(400, 1000, &[20.0, 60.0, 80.0]).print("adapted spectrum against full");
}

/// ∫ L_d cos θ dω = E_d: the sky between its nodes, 16 streams, against fluxes of their own. The peak about the sun is
/// resolved by rings about it.
#[test]
fn the_sky_holds_the_diffuse_irradiance() {
    let grid = SpectralGrid::from_edges(&[0.4199, 0.4201, 0.5499, 0.5501, 0.8699, 0.8701]);
    let column = column(&grid);
    let suns = [20.0, 60.0, 80.0, 85.0];
    for (sky, sun) in solve(&[], &grid, &column, &suns).iter().zip(suns) {
        let sun = f64::to_radians(sun);
        let axis = WorldDir::from_zenith_azimuth(sun, 0.0);
        let mut sum = vec![0.0; grid.len()];
        let mut l = vec![0.0; grid.len()];
        // About the sun: distance π t³, any azimuth.
        let (rings, turns) = (300, 180);
        for i in 0..rings {
            let t = (f64::from(i) + 0.5) / f64::from(rings);
            let (away, width) = (PI * t.powi(3), 3.0 * PI * t * t / f64::from(rings));
            for j in 0..turns {
                let turn = 2.0 * PI * (f64::from(j) + 0.5) / f64::from(turns);
                // Towards the zenith from the sun, and across.
                let (sin, cos) = away.sin_cos();
                let x = cos * sun.sin() - sin * turn.cos() * sun.cos();
                let z = cos * sun.cos() + sin * turn.cos() * sun.sin();
                if z <= 0.0 {
                    continue;
                }
                let y = sin * turn.sin();
                // North is the sun's azimuth.
                let direction = WorldDir::from_zenith_azimuth(z.acos(), y.atan2(x));
                debug_assert!((direction.angle_to(axis) - away).abs() < 1e-6);
                sky.sky_radiance(direction, &mut l);
                let weight = sin * width * 2.0 * PI / f64::from(turns) * z;
                sum.iter_mut().zip(&l).for_each(|(sum, l)| *sum += weight * l);
            }
        }
        for (entry, (sum, due)) in grid.entries().iter().zip(sum.iter().zip(sky.diffuse_irradiance().iter())) {
            let error = sum / due - 1.0;
            eprintln!("sun {:.0}, {:.3} µm: {:+.3} %", sun.to_degrees(), entry.wavelength.um(), 100.0 * error);
            assert!(error.abs() < 0.01, "{error}");
        }
    }
}
