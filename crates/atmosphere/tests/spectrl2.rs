//! SPECTRL2 against pvlib (`benches/peers/sun_and_spectrl2`), and the sweep over columns and suns.

use std::f64::consts::PI;
use std::sync::Arc;

use sunglint_atmosphere::{
    Atmosphere, BUILTIN, Column, Needs, Path, Spectrl2Aerosol, Spectrl2Inputs, Sun, relative_air_mass,
    spectrl2_at_table,
};
use sunglint_plugin::{Args, Value};
use sunglint_radiometry::{SpectralGrid, WorldDir};

/// Ten states of the air at 122 wavelengths: the same formulas and constants, so nine printed digits must agree. The
/// bound of the specification is 0.1 %.
#[test]
fn spectrl2_gives_the_direct_and_diffuse_spectra_of_pvlib() {
    let text = include_str!("data/spectrl2_pvlib.csv");
    let mut reader = csv::ReaderBuilder::new().comment(Some(b'#')).from_reader(text.as_bytes());
    let (mut worst, mut compared) = ([0.0_f64; 2], 0);
    for record in reader.records() {
        let row: Vec<f64> = record.unwrap().iter().map(|cell| cell.parse().unwrap()).collect();
        let zenith = row[1].to_radians();
        assert!((relative_air_mass(zenith) / row[2] - 1.0).abs() < 1e-9);
        let points = spectrl2_at_table(&Spectrl2Inputs {
            apparent_zenith: zenith,
            relative_air_mass: row[2],
            pressure: row[3],
            water: row[4],
            ozone: row[5],
            aod_500: row[6],
            irradiance_factor: row[8],
            ground_albedo: row[7],
            aerosol: Spectrl2Aerosol {
                single_scattering_albedo: row[9],
                turbidity_exponent: row[10],
                albedo_wavelength_factor: row[11],
                asymmetry: row[12],
            },
        });
        let point = points.iter().find(|point| (point.wavelength * 1e3 - row[13]).abs() < 1e-6).unwrap();
        for (i, (ours, theirs)) in
            [(point.direct_normal, row[14]), (point.diffuse_horizontal, row[15])].into_iter().enumerate()
        {
            // Below 1e-12 W m⁻² µm⁻¹ (the ozone edge at 300 nm, the water band at 2.7 µm) nothing is left to compare.
            if theirs > 1e-12 {
                worst[i] = worst[i].max((ours / theirs - 1.0).abs());
                compared += 1;
            }
            assert!((ours - theirs).abs() <= 1e-3 * theirs + 1e-12, "{row:?}: {point:?}");
        }
        assert!((point.direct_horizontal - point.direct_normal * zenith.cos()).abs() < 1e-9);
    }
    println!("largest relative differences over {compared} values: direct {:.1e}, diffuse {:.1e}", worst[0], worst[1]);
    assert!(worst.iter().all(|w| *w < 1e-7), "{worst:?}");
}

fn provider(sky: &str) -> Arc<dyn Atmosphere> {
    let model = BUILTIN.iter().find(|model| model.info.name == "spectrl2").unwrap();
    let args = Args::new(&model.info, [("sky".to_string(), Value::Word(sky.to_string()))]);
    (model.bind)(&args, &grid()).unwrap()
}

/// 0.4–1.0 µm with edges on the table's corners.
fn grid() -> SpectralGrid {
    let nodes = spectrl2_at_table(&inputs()).into_iter().map(|point| point.wavelength);
    SpectralGrid::from_edges(&nodes.filter(|l| (0.3999..1.0).contains(l)).collect::<Vec<_>>())
}

fn inputs() -> Spectrl2Inputs {
    Spectrl2Inputs {
        apparent_zenith: 0.0,
        relative_air_mass: 1.0,
        pressure: 1013.0,
        water: 1.0,
        ozone: 0.3,
        aod_500: 0.1,
        irradiance_factor: 1.0,
        ground_albedo: 0.0,
        aerosol: Spectrl2Aerosol::default(),
    }
}

fn column(grid: &SpectralGrid) -> Column {
    Column { ground_albedo: vec![0.2; grid.len()], ..Column::default() }
}

fn all() -> Needs {
    Needs { direct_beam: true, diffuse_irradiance: true, directional_sky: true, path: true, path_heights: None }
}

/// A fixed sequence of numbers in 0..1 (splitmix64).
struct Draws(u64);

impl Draws {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }
    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next()
    }
    fn maybe(&mut self, low: f64, high: f64) -> Option<f64> {
        (self.next() < 0.5).then(|| self.within(low, high))
    }
}

/// Any air and any sun: all finite, nothing negative, transmittances within 0..1. What reaches the ground is at most what
/// comes in, E_s cos Z, over any ground and down to 5° above the horizon (below that SPECTRL2's own diffuse formula,
/// fitted for high suns, may exceed it by a little: it is bounded by 1.1 there, at A ≤ 0.9).
#[test]
fn no_air_and_no_sun_makes_light_or_nonsense() {
    let grid = grid();
    let mut draw = Draws(7);
    let profiles =
        ["us_standard", "tropical", "midlatitude_summer", "midlatitude_winter", "subarctic_summer", "subarctic_winter"];
    let mut gain = 0.0_f64;
    for case in 0..300 {
        let albedo = draw.within(0.0, 0.9);
        let air = Column {
            profile: profiles[case % 6].to_string(),
            elevation: draw.within(-430.0, 8000.0),
            pressure: draw.maybe(300.0, 1080.0),
            temperature: draw.maybe(220.0, 325.0),
            humidity: draw.maybe(0.0, 1.0),
            water: draw.maybe(0.0, 7.0),
            ozone: draw.maybe(0.1, 0.6),
            visibility: draw.maybe(1.0, 13.0).map(|e| 50.0 * e.exp()), // 136 m to 22 000 km
            aod: draw.maybe(0.0, 3.0),
            ground_albedo: vec![albedo; grid.len()],
            ..Column::default()
        };
        let mut suns: Vec<Sun> = (0..4).map(|_| Sun::at(draw.within(0.0, 2.0), draw.within(0.0, 6.2))).collect();
        suns.extend([0.0, 1.55, PI / 2.0 - 1e-5, PI / 2.0, 1.5709, 3.1].map(|zenith| Sun::at(zenith, 1.0)));
        let sky = ["clear", "turbid", "overcast", "isotropic"][case % 4];
        let states = provider(sky).solve(&air, &suns, &grid, &all()).unwrap();
        for (state, sun) in states.iter().zip(&suns) {
            let (solar, tau, diffuse) =
                (state.solar_irradiance(), state.sun_transmittance(), state.diffuse_irradiance());
            let mu = sun.apparent.cos_zenith();
            for i in 0..grid.len() {
                assert!(solar[i] > 0.0 && (0.0..=1.0).contains(&tau[i]) && diffuse[i].is_finite() && diffuse[i] >= 0.0);
                if mu <= 0.0 {
                    assert_eq!((tau[i], diffuse[i]), (0.0, 0.0));
                    continue;
                }
                // The ground gives back the share A of what it gets; in and out, the balance of the ground is (1 − A) E_g.
                let net = (1.0 - albedo) * (tau[i] + diffuse[i] / (solar[i] * mu));
                gain = gain.max(net);
                assert!(net < if mu > 0.087 { 1.0 } else { 1.1 }, "case {case}, mu {mu}: {net}");
            }
            let (mut radiance, mut path_tau) = (vec![0.0; grid.len()], vec![0.0; grid.len()]);
            for _ in 0..4 {
                let direction = WorldDir::from_zenith_azimuth(draw.within(0.0, PI), draw.within(0.0, 6.2));
                state.sky_radiance(direction, &mut radiance);
                assert!(radiance.iter().all(|l| l.is_finite() && *l >= 0.0));
                assert!(direction.cos_zenith() >= 0.0 || radiance.iter().all(|l| *l == 0.0));
                let target = draw.within(-100.0, 100.0);
                let reach = 10f64.powf(draw.within(-2.0, 6.5));
                let path = Path {
                    target_height: target,
                    sensor_height: target + reach * direction.cos_zenith(),
                    length: reach,
                    towards_sensor: direction,
                };
                let level = Path { sensor_height: target, ..path };
                for path in [path, level, Path { length: 0.0, ..level }] {
                    state.path(&path, &mut path_tau, &mut radiance);
                    assert!(path_tau.iter().all(|t| (0.0..=1.0).contains(t)), "{path:?}");
                    assert!(radiance.iter().all(|l| l.is_finite() && *l >= 0.0), "{path:?}");
                    if mu <= 0.0 {
                        assert!(radiance.iter().all(|l| *l == 0.0));
                    }
                    if path.length == 0.0 {
                        assert!(path_tau.iter().all(|t| *t > 1.0 - 1e-12) && radiance.iter().all(|l| *l == 0.0));
                    }
                }
            }
        }
    }
    println!("largest share of E_s cos Z that the ground keeps: {gain:.3}");
}

/// The sky of every distribution sums to E_d on the level: product quadrature of midpoints, 800 × 800, its own error below
/// 1e-5 at the cusp of the sun.
#[test]
fn the_sky_in_directions_integrates_to_the_diffuse_irradiance() {
    let grid = grid();
    for sky in ["clear", "turbid", "overcast", "isotropic"] {
        let state = provider(sky).solve(&column(&grid), &[Sun::at(0.7, 2.0)], &grid, &all()).unwrap().remove(0);
        let n = 800;
        let (mut sum, mut weights) = (0.0, Vec::new());
        for i in 0..n {
            let zenith = (f64::from(i) + 0.5) * PI / 2.0 / f64::from(n);
            for j in 0..n {
                let azimuth = (f64::from(j) + 0.5) * 2.0 * PI / f64::from(n);
                state.sky_weights(WorldDir::from_zenith_azimuth(zenith, azimuth), &mut weights);
                let weight: f64 = weights.iter().map(|(_, s)| s).sum();
                sum += weight * zenith.sin() * zenith.cos() * PI * PI / f64::from(n * n);
            }
        }
        for i in [0, grid.len() / 2, grid.len() - 1] {
            let irradiance = sum * state.sky_terms()[0][i];
            assert!((irradiance / state.diffuse_irradiance()[i] - 1.0).abs() < 1e-5, "{sky}");
        }
    }
}

/// More haze, less direct and more diffuse light; a bright ground brightens the sky; a nearer sun brightens all.
#[test]
fn haze_ground_and_distance_act_the_way_they_should() {
    let grid = grid();
    let solve = |air: &Column, sun: Sun| provider("clear").solve(air, &[sun], &grid, &all()).unwrap().remove(0);
    let sun = Sun::at(0.8, 0.0);
    let clear = solve(&column(&grid), sun);
    let hazy = solve(&Column { visibility: Some(5000.0), ..column(&grid) }, sun);
    let snow = solve(&Column { ground_albedo: vec![0.9; grid.len()], ..column(&grid) }, sun);
    let near = solve(&column(&grid), Sun { distance: 0.983, ..sun });
    let down = Path { target_height: 0.0, sensor_height: 4e3, length: 4e3, towards_sensor: WorldDir::UP };
    let (mut t, mut l) =
        ([vec![0.0; grid.len()], vec![0.0; grid.len()]], [vec![0.0; grid.len()], vec![0.0; grid.len()]]);
    clear.path(&down, &mut t[0], &mut l[0]);
    hazy.path(&down, &mut t[1], &mut l[1]);
    let mut near_l = vec![0.0; grid.len()];
    let mut near_t = vec![0.0; grid.len()];
    near.path(&down, &mut near_t, &mut near_l);
    for i in 0..grid.len() {
        assert!(hazy.sun_transmittance()[i] < clear.sun_transmittance()[i]);
        assert!(hazy.diffuse_irradiance()[i] > clear.diffuse_irradiance()[i]);
        assert!(snow.diffuse_irradiance()[i] > clear.diffuse_irradiance()[i]);
        assert!(t[1][i] < t[0][i] && l[1][i] > l[0][i]);
        let factor = 0.983f64.powi(-2);
        assert!((near.solar_irradiance()[i] / clear.solar_irradiance()[i] / factor - 1.0).abs() < 1e-12);
        assert!((near.diffuse_irradiance()[i] / clear.diffuse_irradiance()[i] / factor - 1.0).abs() < 1e-12);
        assert!((near_l[i] / l[0][i] / factor - 1.0).abs() < 1e-9);
    }
}

/// Koschmieder: at the meteorological range V a black target keeps 2 % of its contrast at 0.55 µm, so a level path of that
/// length has τ₂ = 0.02 there; gases take the rest, 0.085 (atm-cm)⁻¹ of ozone, of which the ground has little.
#[test]
fn contrast_fades_to_two_percent_at_the_meteorological_range() {
    let grid = SpectralGrid::from_edges(&[0.549_999_9, 0.550_000_1]);
    for visibility in [1e3, 5e3, 23e3, 80e3] {
        for elevation in [0.0, 168.0, 2000.0] {
            let air = Column { visibility: Some(visibility), elevation, ..column(&grid) };
            let state = provider("clear").solve(&air, &[Sun::at(0.5, 0.0)], &grid, &all()).unwrap().remove(0);
            let level = Path {
                target_height: 0.0,
                sensor_height: 0.0,
                length: visibility,
                towards_sensor: WorldDir::from_zenith_azimuth(PI / 2.0, 0.0),
            };
            let (mut tau, mut radiance) = (vec![0.0; 2], vec![0.0; 2]);
            state.path(&level, &mut tau, &mut radiance);
            assert!((tau[0] / (-3.912f64).exp() - 1.0).abs() < 0.02, "{visibility} m at {elevation} m: {}", tau[0]);
        }
    }
}
