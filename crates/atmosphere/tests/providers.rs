//! The providers `none` and `table`, and what all of them declare.

use std::f64::consts::PI;
use std::sync::Arc;

use sunglint_atmosphere::{Atmosphere, AtmosphereError, BUILTIN, Column, Needs, Path, SkyState, Sun};
use sunglint_plugin::{Args, BindError, FileArg, SpectralValue, Value};
use sunglint_radiometry::{Curve, SpectralGrid, WorldDir};

fn bind(name: &str, given: Vec<(&str, Value)>) -> Result<Arc<dyn Atmosphere>, BindError> {
    let model = BUILTIN.iter().find(|model| model.info.name == name).unwrap();
    let args = Args::new(&model.info, given.into_iter().map(|(name, value)| (name.to_string(), value)));
    (model.bind)(&args, &grid())
}

fn table(text: &str) -> Result<Arc<dyn Atmosphere>, BindError> {
    let file = FileArg { name: "sky.csv".to_string(), bytes: text.as_bytes().into() };
    bind("table", vec![("file", Value::File(file))])
}

fn fault(text: &str) -> BindError {
    match table(text) {
        Ok(_) => panic!("this table should be refused:\n{text}"),
        Err(error) => error,
    }
}

fn grid() -> SpectralGrid {
    SpectralGrid::from_edges(&[0.5, 0.55, 0.6])
}

fn column() -> Column {
    Column { ground_albedo: vec![0.0; grid().len()], ..Column::default() }
}

fn solve(provider: &Arc<dyn Atmosphere>, sun: Sun) -> Result<Box<dyn SkyState>, AtmosphereError> {
    let needs =
        Needs { direct_beam: true, diffuse_irradiance: true, directional_sky: true, path: true, path_heights: None };
    Ok(provider.solve(&column(), &[sun], &grid(), &needs)?.remove(0))
}

fn up() -> Sun {
    Sun::at(0.7, 1.0)
}

fn radiance(sky: &dyn SkyState, zenith_deg: f64, azimuth_deg: f64) -> f64 {
    let mut radiance = vec![0.0; grid().len()];
    sky.sky_radiance(WorldDir::from_zenith_azimuth(zenith_deg.to_radians(), azimuth_deg.to_radians()), &mut radiance);
    radiance[0]
}

fn path(sky: &dyn SkyState, view_zenith_deg: f64, height: f64) -> (f64, f64) {
    let (mut tau, mut radiance) = (vec![0.0; grid().len()], vec![0.0; grid().len()]);
    let towards_sensor = WorldDir::from_zenith_azimuth(view_zenith_deg.to_radians(), 0.0);
    let path = Path { target_height: 0.0, sensor_height: height, length: height, towards_sensor };
    sky.path(&path, &mut tau, &mut radiance);
    (tau[0], radiance[0])
}

/// ∫ L cos θ dω by midpoints; 1e-6 for shapes without a cusp.
fn irradiance(sky: &dyn SkyState) -> f64 {
    let n = 600;
    let mut sum = 0.0;
    for i in 0..n {
        let zenith = (f64::from(i) + 0.5) * 90.0 / f64::from(n);
        for j in 0..n {
            let azimuth = (f64::from(j) + 0.5) * 360.0 / f64::from(n);
            let (sin, cos) = zenith.to_radians().sin_cos();
            sum += radiance(sky, zenith, azimuth) * sin * cos;
        }
    }
    sum * PI * PI / f64::from(n * n)
}

#[test]
fn every_model_has_a_manual_with_an_example_and_a_unique_name() {
    for (i, model) in BUILTIN.iter().enumerate() {
        assert!(model.info.manual.contains("In a scene\n  atmosphere "), "{}", model.info.name);
        assert!(model.info.params.iter().all(|param| model.info.manual.contains(param.name) || param.help.len() > 8));
        assert!(BUILTIN[..i].iter().all(|other| other.info.name != model.info.name));
    }
}

/// ASTM E490-00a, an independent spectrum, holds 1054 W m⁻² between 0.3 and 1.2 µm; the two agree within the 1 % that such
/// tables keep to each other.
#[test]
fn the_bare_sun_is_the_solar_reference_spectrum_at_the_date_s_distance() {
    let grid = SpectralGrid::from_edges(&(30..=120).map(|i| 0.01 * f64::from(i)).collect::<Vec<_>>());
    let column = Column { ground_albedo: vec![0.0; grid.len()], ..column() };
    let suns = [up(), Sun { distance: 1.0167, ..up() }];
    let skies = bind("none", vec![]).unwrap().solve(&column, &suns, &grid, &Needs::default()).unwrap();
    let total: f64 = (grid.entries().iter().zip(skies[0].solar_irradiance().iter()))
        .map(|(entry, e)| entry.weight * grid.bin_of(entry).width() * e)
        .sum();
    assert!((total / 1054.0 - 1.0).abs() < 0.01, "{total} W/m2");
    let (near, far) = (skies[0].solar_irradiance()[9], skies[1].solar_irradiance()[9]);
    assert!((far / near * 1.0167 * 1.0167 - 1.0).abs() < 1e-14);
}

#[test]
fn without_air_nothing_is_lost_and_the_sky_is_black() {
    let none = bind("none", vec![]).unwrap();
    let sky = solve(&none, up()).unwrap();
    assert!(sky.sun_transmittance().iter().all(|t| *t == 1.0));
    assert!(sky.diffuse_irradiance().iter().all(|e| *e == 0.0));
    assert_eq!(path(&*sky, 30.0, 7e5), (1.0, 0.0));
    assert_eq!(radiance(&*sky, 10.0, 0.0), 0.0);
    let set = solve(&none, Sun::at(1.6, 0.0)).unwrap();
    assert!(set.sun_transmittance().iter().all(|t| *t == 0.0));
    assert!(none.uses().is_empty());
}

/// A furnace sky: L from everywhere above, E_d = π L. Overcast: L₀ (1 + 2 cos θ)/3, E_d = 7π/9 L₀.
#[test]
fn a_given_sky_has_the_irradiance_of_its_law() {
    let value = |v: f64| Value::Spectrum(SpectralValue::Constant(v));
    let furnace = bind("none", vec![("sky_radiance", value(80.0)), ("solar_irradiance", value(0.0))]).unwrap();
    let sky = solve(&furnace, up()).unwrap();
    assert!((sky.diffuse_irradiance()[0] - 80.0 * PI).abs() < 1e-12 && sky.solar_irradiance()[0] == 0.0);
    assert!((radiance(&*sky, 89.0, 5.0) - 80.0).abs() < 1e-12 && radiance(&*sky, 91.0, 5.0) == 0.0);
    assert!((irradiance(&*sky) / (80.0 * PI) - 1.0).abs() < 1e-5);
    let overcast =
        bind("none", vec![("sky_radiance", value(80.0)), ("sky", Value::Word("overcast".to_string()))]).unwrap();
    let sky = solve(&overcast, up()).unwrap();
    assert!((sky.diffuse_irradiance()[0] - 80.0 * PI * 7.0 / 9.0).abs() < 1e-12);
    assert!((irradiance(&*sky) / sky.diffuse_irradiance()[0] - 1.0).abs() < 1e-5);
    assert!((radiance(&*sky, 60.0, 5.0) - 80.0 * 2.0 / 3.0).abs() < 1e-12);
}

#[test]
fn a_solar_spectrum_that_ends_too_early_names_the_gap() {
    let short = Curve::linear(&[(0.4, 1700.0), (0.58, 1800.0)]).unwrap();
    let none = bind("none", vec![("solar_irradiance", Value::Spectrum(SpectralValue::Curve(short)))]).unwrap();
    let error = solve(&none, up()).err().unwrap();
    assert_eq!(error.code, "M04");
    assert!(error.message.contains("0.580000 to 0.600000 um"), "{}", error.message);
    let banded = Value::Spectrum(SpectralValue::PerBand(vec![("red".to_string(), 1.0)]));
    assert_eq!(solve(&bind("none", vec![("sky_radiance", banded)]).unwrap(), up()).err().unwrap().code, "M04");
}

const PLAIN: &str = "# a comment
wavelength_nm,solar_irradiance_w_m2_um,sun_transmittance,path_transmittance,path_radiance_w_m2_sr_um,diffuse_irradiance_w_m2_um
500,1900,0.6,0.8,20,400
600,1700,0.8,0.9,10,200
";

/// One row a wavelength: every quantity is the straight line through its values.
#[test]
fn a_plain_table_is_straight_lines() {
    let sky = solve(&table(PLAIN).unwrap(), Sun { distance: 1.01, ..up() }).unwrap();
    let l = grid().wavelengths_um();
    for (i, l) in l.iter().enumerate() {
        let t = (l - 0.5) / 0.1;
        assert!((sky.solar_irradiance()[i] - (1900.0 - 200.0 * t)).abs() < 1e-9);
        assert!((sky.sun_transmittance()[i] - (0.6 + 0.2 * t)).abs() < 1e-12);
        assert!((sky.diffuse_irradiance()[i] - (400.0 - 200.0 * t)).abs() < 1e-9);
        assert!((sky.sky_terms()[0][i] - sky.diffuse_irradiance()[i] / PI).abs() < 1e-12);
    }
    let t = (l[0] - 0.5) / 0.1;
    let (tau, radiance) = path(&*sky, 20.0, 500.0);
    assert!((tau - 0.8 - 0.1 * t).abs() < 1e-12 && (radiance - 20.0 + 10.0 * t).abs() < 1e-12);
    let provider = table(PLAIN).unwrap();
    assert!(!provider.has_directional_sky());
    assert_eq!(provider.nodes(), vec![0.5, 0.6]);
    let set = solve(&provider, Sun::at(1.6, 0.0)).unwrap();
    assert!(set.sun_transmittance().iter().all(|t| *t == 0.0) && set.diffuse_irradiance()[0] > 0.0);
}

/// A sky in directions, in its own rows: zenith once, then 45° and 90° by four azimuths.
fn directional(relative: bool) -> String {
    let azimuth = if relative { "sky_relative_azimuth_deg" } else { "sky_azimuth_deg" };
    let mut text = format!(
        "wavelength_nm,solar_irradiance_w_m2_um,sun_transmittance,sky_radiance_w_m2_sr_um,sky_zenith_deg,{azimuth}\n"
    );
    for wavelength in [400, 700] {
        text += &format!("{wavelength},1800,0.7,,,\n{wavelength},,,50,0,\n");
        for zenith in [45, 90] {
            for azimuth in [0, 90, 180, 270] {
                text += &format!("{wavelength},,,{},{zenith},{azimuth}\n", zenith + azimuth);
            }
        }
    }
    text
}

#[test]
fn a_sky_in_directions_is_bilinear_and_its_irradiance_is_its_integral() {
    let provider = table(&directional(false)).unwrap();
    assert!(provider.has_directional_sky());
    let sky = solve(&provider, up()).unwrap();
    for (zenith, azimuth, expected) in [
        (45.0, 90.0, 135.0),
        (67.5, 90.0, 157.5),
        (45.0, 45.0, 90.0),
        (45.0, 315.0, 0.5 * (315.0 + 45.0)), // over north, between 270° and 0°
        (22.5, 180.0, 0.5 * (50.0 + 225.0)),
        (0.0, 33.0, 50.0),
    ] {
        assert!((radiance(&*sky, zenith, azimuth) - expected).abs() < 1e-9, "{zenith} {azimuth}");
    }
    assert_eq!(radiance(&*sky, 90.1, 0.0), 0.0);
    let mut weights = Vec::new();
    sky.sky_weights(WorldDir::from_zenith_azimuth(0.5, 4.0), &mut weights);
    assert!(weights.len() <= 4 && (weights.iter().map(|w| w.1).sum::<f64>() - 1.0).abs() < 1e-12);
    // 600 × 600 midpoints of straight lines: 2e-6.
    assert!((sky.diffuse_irradiance()[0] / irradiance(&*sky) - 1.0).abs() < 5e-6);
}

#[test]
fn relative_azimuths_turn_with_the_sun_and_one_side_stands_for_both() {
    let sky = solve(&table(&directional(true)).unwrap(), Sun::at(0.7, PI / 2.0)).unwrap();
    assert!((radiance(&*sky, 45.0, 180.0) - 135.0).abs() < 1e-9);
    let half = "wavelength_nm,solar_irradiance_w_m2_um,sun_transmittance,sky_radiance_w_m2_sr_um,sky_zenith_deg,sky_relative_azimuth_deg
400,1,1,10,30,0
700,1,1,10,30,0
400,1,1,30,30,180
700,1,1,30,30,180
";
    let sky = solve(&table(half).unwrap(), Sun::at(0.7, PI / 2.0)).unwrap();
    for (azimuth, expected) in [(90.0, 10.0), (180.0, 20.0), (0.0, 20.0), (270.0, 30.0)] {
        assert!((radiance(&*sky, 70.0, azimuth) - expected).abs() < 1e-9, "{azimuth}");
    }
    assert!((sky.diffuse_irradiance()[0] - 20.0 * PI).abs() < 1e-9);
}

/// Half way between two suns all is half way; beyond them there is an error; below the horizon, nothing.
#[test]
fn several_suns_are_interpolated_between() {
    let text = "wavelength_um,sun_zenith_deg,solar_irradiance_w_m2_nm,sun_transmittance,diffuse_irradiance_w_m2_um
0.4,20,1.8,0.8,300
0.7,20,1.4,0.8,300
0.4,60,1.8,0.6,100
0.7,60,1.4,0.6,100
";
    let provider = table(text).unwrap();
    let sky = solve(&provider, Sun::at(40f64.to_radians(), 0.0)).unwrap();
    assert!((sky.sun_transmittance()[0] - 0.7).abs() < 1e-12 && (sky.diffuse_irradiance()[1] - 200.0).abs() < 1e-9);
    assert!(sky.solar_irradiance()[0] > 1600.0);
    let error = solve(&provider, Sun::at(70f64.to_radians(), 0.0)).err().unwrap();
    assert_eq!(error.code, "A03");
    assert!(error.message.contains("20.0000 to 60.0000"), "{}", error.message);
    let night = solve(&provider, Sun::at(100f64.to_radians(), 0.0)).unwrap();
    assert_eq!((night.sun_transmittance()[0], night.diffuse_irradiance()[0]), (0.0, 0.0));
}

#[test]
fn path_terms_follow_view_zenith_and_height() {
    let text = "wavelength_um,solar_irradiance_w_m2_um,sun_transmittance,path_transmittance,path_radiance_w_m2_sr_um,view_zenith_deg,sensor_height_km
0.4,1800,0.8,0.9,10,0,1
0.7,1400,0.8,0.9,10,0,1
0.4,1800,0.8,0.7,20,60,1
0.7,1400,0.8,0.7,20,60,1
0.4,1800,0.8,0.8,30,0,3
0.7,1400,0.8,0.8,30,0,3
0.4,1800,0.8,0.5,40,60,3
0.7,1400,0.8,0.5,40,60,3
";
    let sky = solve(&table(text).unwrap(), up()).unwrap();
    let near = |(a, b): (f64, f64), (c, d): (f64, f64)| (a - c).abs() < 1e-12 && (b - d).abs() < 1e-9;
    assert!(near(path(&*sky, 0.0, 1000.0), (0.9, 10.0)));
    assert!(near(path(&*sky, 30.0, 2000.0), (0.725, 25.0)));
    assert!(near(path(&*sky, 80.0, 9000.0), (0.5, 40.0)));
}

#[test]
fn a_table_that_does_not_reach_the_band_names_the_gap() {
    let text = "wavelength_nm,solar_irradiance_w_m2_um,sun_transmittance\n400,1800,0.8\n560,1800,0.8\n";
    let error = solve(&table(text).unwrap(), up()).err().unwrap();
    assert_eq!(error.code, "M04");
    assert!(error.message.contains("solar_irradiance of sky.csv") && error.message.contains("0.560000 to 0.600000 um"));
}

/// Every fault has its code, and the words say where it is.
#[test]
fn a_faulty_table_is_refused_where_it_is_faulty() {
    let head = "wavelength_nm,solar_irradiance_w_m2_um,sun_transmittance";
    let sky = format!("{head},sky_radiance_w_m2_sr_um,sky_zenith_deg,sky_azimuth_deg");
    for (text, code, words) in [
        (String::new(), "F02", "no column wavelength_nm"),
        ("wavelength_nm,sun_transmittance\n400,1\n".to_string(), "F02", "no column solar_irradiance_w_m2_um"),
        (format!("{head},sky_radiance\n"), "F02", "no column `sky_radiance`"),
        (format!("{head},wavelength_um\n"), "F02", "two columns for wavelength"),
        (format!("{sky},sky_relative_azimuth_deg\n"), "F02", "both"),
        (format!("{head},sky_azimuth_deg\n"), "F02", "sky_zenith_deg"),
        (format!("# note\n{head}\n400,1800,0.8\n500,18oo,0.8\n"), "F01", "line 4, solar_irradiance_w_m2_um: `18oo`"),
        (format!("{head}\n400,1800\n"), "F01", "line 2: 2 cells under a header of 3"),
        (format!("{head}\n,1800,1\n"), "F01", "line 2: a row needs a wavelength"),
        (format!("{head}\n400,1800,1.2\n"), "U05", "line 2: sun_transmittance is 1.2"),
        (format!("{head}\n400,-3,1\n"), "U05", "line 2: solar_irradiance_w_m2_um is -3"),
        (
            format!("{head}\n500,1800,1\n400,1700,1\n"),
            "M05",
            "line 3: wavelength 400 of solar_irradiance_w_m2_um does not",
        ),
        (
            format!("{head}\n500,1800,1\n500,1700,1\n"),
            "M05",
            "line 3: wavelength 500 of solar_irradiance_w_m2_um is said",
        ),
        (format!("{head}\n"), "F01", "no value of solar_irradiance"),
        (
            format!("{sky}\n400,1,1,5,10,0\n400,1,1,5,10,90\n400,1,1,5,40,0\n"),
            "M05",
            "sky_radiance has no rows at sky_zenith 40.000000 deg, sky_azimuth 90.000000 deg",
        ),
        (
            format!("{sky}\n400,1,1,5,10,0\n400,1,1,5,,0\n"),
            "F01",
            "line 3: this row of sky_radiance lacks a sky_zenith",
        ),
        (
            format!("{sky},diffuse_irradiance_w_m2_um\n400,1,1,100,10,0,300\n500,1,1,100,10,0,314\n"),
            "M05",
            "at 400.000000 nm the diffuse irradiance is 300.000000 W/m2/um",
        ),
    ] {
        let error = fault(&text);
        let said = format!("{} {}", error.message, error.help.clone().unwrap_or_default());
        assert_eq!(error.code, code, "{said}");
        assert!(error.message.contains(words), "{words} / {said}");
    }
    let twice = format!("{head}\n400,1800,1\n700,1700,1\n400,1800,0.9\n");
    assert!(fault(&twice).message.contains("of sun_transmittance is said twice"));
    let bytes: Arc<[u8]> = [0xff, 0xfe, b'\n', 0x80].as_slice().into();
    let binary = Value::File(FileArg { name: "sky.csv".to_string(), bytes });
    assert_eq!(bind("table", vec![("file", binary)]).err().unwrap().code, "F01");
    assert_eq!(bind("table", vec![]).err().unwrap().code, "S05");
}

/// Twenty thousand rows that each name another sun and another direction would make 8·10¹² combinations: the first one that is
/// left out is said, before room is made for any.
#[test]
fn a_table_of_scattered_directions_is_refused_at_once() {
    let mut text = "wavelength_nm,solar_irradiance_w_m2_um,sun_transmittance,sky_radiance_w_m2_sr_um,sun_zenith_deg,sky_zenith_deg,sky_azimuth_deg\n".to_string();
    for i in 0..20_000 {
        let at = 0.003 * f64::from(i + 1);
        text += &format!("500,1,1,1,{at},{at},{at}\n");
    }
    let error = fault(&text);
    assert!(error.code == "M05" && error.message.contains("sky_radiance has no rows at"), "{error}");
}
