//! Air from files: a station's record, a radiosonde, a measured sky, from the scene's text to the frame.

use std::fs;

use sunglint::{Options, Plan};

fn plan_of(weather: &str, collect: &str) -> Plan {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("scene.glint");
    let record = "time,pressure_hpa,temperature_degc,humidity_percent,visibility_km,ozone_du\n\
                  1992-06-18T10:00-04:00,990,20,60,20,300\n\
                  1992-06-18T12:00-04:00,994,26,50,30,320\n\
                  1992-06-18T14:00-04:00,992,28,40,10,320\n";
    fs::write(folder.path().join("station.csv"), record).expect("a writable folder");
    fs::copy("crates/atmosphere/tests/data/buf_20060414_00z.csv", folder.path().join("buf.csv"))
        .expect("tests run at the root");
    let scene = format!(
        "glint 1\nsite {{ latitude 43.084 deg, longitude -77.674 deg, elevation 215 m }}\ncollect {{ {collect} }}\n\
         weather {{ {weather} }}\nmaterial grey {{ ideal {{ diffuse 0.5 }} }}\n\
         facet grey (-20 -20 0) (20 -20 0) (20 20 0) (-20 20 0) m\n\
         sensor above {{ projection orthographic, position (0 0 1000) m, swath 2 m, pixels 2 x 2, band nir 740..1000 nm }}\n\
         experiment e {{ samples 16 }}\n"
    );
    fs::write(&path, scene).expect("a writable folder");
    let checked = sunglint::open(&path).unwrap_or_else(|_| panic!("{weather}"));
    Plan::new(checked, &Options::default()).unwrap_or_else(|_| panic!("{weather}"))
}

/// Mean radiance of the first frame's first band.
fn mean(weather: &str, collect: &str) -> f64 {
    let frames = plan_of(weather, collect).runs()[0].render();
    let band = &frames.frames[0].radiance[0];
    band.iter().map(|l| f64::from(*l)).sum::<f64>() / band.len() as f64
}

const ELEVEN: &str = "at 1992-06-18 11:00 -04:00";

/// Half way between two rows lies the mean of each field; what the block says itself stands before the record.
#[test]
fn a_record_says_at_a_time_what_the_block_would_say_of_it() {
    let said = "pressure 992 hPa, temperature 23 degC, humidity 55 %, visibility 25 km, ozone 310 DU";
    let same = |a: &str, b: &str| (mean(a, ELEVEN) / mean(b, ELEVEN) - 1.0).abs() < 1e-6; // frames are f32
    assert!(same("observations \"station.csv\"", said));
    let other = said.replace("visibility 25 km", "aod 0.3").replace("humidity 55 %", "water 1 g/cm2");
    assert!(same("observations \"station.csv\", aod 0.3, water 1 g/cm2", &other));
    assert!(!same(said, &other));
}

#[test]
fn every_time_has_its_own_air_and_those_of_one_air_are_solved_together() {
    let times = "at [1992-06-18 11:00, 1992-06-18 12:00, 1992-06-18 13:00], zone -04:00";
    assert_eq!(plan_of("observations \"station.csv\"", times).runs()[0].columns_solved, 3);
    assert_eq!(plan_of("visibility 23 km", times).runs()[0].columns_solved, 1);
}

/// The ascent's own pressure, temperature and water at its lowest level, 989 hPa, 19.35 degC, 1.231 g/cm2 (MetPy's specific humidity; ours is
/// within 0.5 %), said by hand: the frame differs by what the heights of air and water differ along 1 km of path, and by 0.5 % of water:
/// below 0.5 % in a band with water's strongest line.
#[test]
fn a_radiosonde_brings_its_pressure_temperature_and_water() {
    let mean = |weather: &str| mean(weather, ELEVEN);
    let sonde = mean("profile midlatitude_summer, radiosonde \"buf.csv\"");
    let hand = mean("profile midlatitude_summer, pressure 989 hPa, temperature 19.35 degC, water 1.231 g/cm2");
    let profile = mean("profile midlatitude_summer");
    assert!((sonde / hand - 1.0).abs() < 0.005, "{sonde} {hand}");
    assert!(sonde / profile > 1.01, "drier than midlatitude summer: {sonde} {profile}");
}

/// A white level panel under the measured sky without beam shows E_d/π; the plan tells E_d with its uncertainty in each band.
#[test]
fn a_level_panel_shows_the_irradiance_of_the_measured_sky() {
    let checked = sunglint::open("tests/scenes/measured_sky.glint").unwrap_or_else(|_| panic!("a good scene"));
    let plan = Plan::new(checked, &Options::default()).unwrap_or_else(|_| panic!("a good scene"));
    let run = &plan.runs()[0];
    let frames = run.render();
    for (i, band) in ["blue", "green", "red", "nir"].iter().enumerate() {
        let line = run.estimators.iter().find(|line| line.starts_with(&format!("E_d in {band} is "))).unwrap();
        let said: f64 = line.split(' ').nth(4).unwrap().parse().unwrap();
        let shown = f64::from(frames.frames[0].radiance[i][0]) * std::f64::consts::PI;
        assert!((shown / said - 1.0).abs() < 1e-4, "{band}: {shown} against {line}");
    }
}

fn of_text(text: &str) -> Result<Plan, sunglint::Refused> {
    plan_with(text, &Options::default())
}

fn plan_with(text: &str, options: &Options) -> Result<Plan, sunglint::Refused> {
    let head = "glint 1\ncollect noon { sun zenith 30 deg azimuth 180 deg }\ncollect late { sun zenith 60 deg azimuth 250 deg }\n\
                material grey { ideal { diffuse 0.5 } }\nground grey\n\
                sensor above { position (0 0 10) m, field_of_view 5 deg, pixels 2 x 2, band red 600..700 nm }\n";
    let checked = sunglint::check_text("scene.glint", format!("{head}{text}"));
    Plan::new(checked, options)
}

/// What one experiment's air makes something of, the others skip and say so; what none does, is refused.
#[test]
fn no_field_of_the_weather_is_silently_ignored() {
    let text = "weather { visibility 10 km, ozone 300 DU }\n\
                experiment air { atmosphere spectrl2, samples 16 }\nexperiment vacuum { atmosphere none, samples 16 }\n";
    let plan = of_text(text).unwrap_or_else(|refused| panic!("{refused}"));
    assert!(plan.warnings.is_empty(), "{:?}", plan.warnings);
    let skipped =
        |run: usize| plan.runs()[run].skips.iter().filter(|skip| skip.what.ends_with("of the weather")).count();
    assert_eq!((skipped(0), skipped(1)), (0, 2));

    let refused = of_text(&text.replace("spectrl2", "none { sky_radiance 5 W/m2/sr/um }")).err().expect("refused");
    let fields: Vec<&str> =
        refused.diagnostics.iter().filter(|d| d.code == "A01").map(|d| d.message.as_str()).collect();
    assert_eq!(
        fields,
        ["the atmosphere `none` does not use `visibility`", "the atmosphere `none` does not use `ozone`"]
    );

    // What an experiment puts in place of a field is no longer said: `visibility` has no part in this.
    let replaced =
        "weather { visibility 10 km }\nexperiment air { atmosphere spectrl2, weather { aod 0.1 }, samples 16 }\n";
    assert!(of_text(replaced).is_ok());

    // A part of a scene may leave out the very experiment that uses a field.
    let part = Options { experiments: vec!["vacuum".into()], ..Options::default() };
    assert!(plan_with(text, &part).is_ok());
}

/// Two experiments at two times of one air: one column, solved once for the suns of both.
#[test]
fn experiments_share_the_columns_that_they_have_in_common() {
    let text = "experiment one { samples 16, collect [noon, late] }\nexperiment two { samples 16, seed 2 }\n\
                experiment hazy { samples 16, collect late, weather { aod 0.3 } }\n";
    let plan = of_text(text).unwrap_or_else(|refused| panic!("{refused}"));
    let columns: Vec<usize> = plan.runs().iter().map(|run| run.columns_solved).collect();
    assert_eq!(columns, [1, 0, 1]);
    assert!(plan.skips.iter().any(|skip| skip.what == "2 solves of the air"), "{:?}", plan.skips);
    let same = |a: usize, b: usize, time: usize| {
        std::sync::Arc::ptr_eq(&plan.runs()[a].light(time), &plan.runs()[b].light(time))
    };
    assert!(
        same(0, 1, 0) && same(0, 1, 1) && !std::sync::Arc::ptr_eq(&plan.runs()[0].light(1), &plan.runs()[2].light(0))
    );
}

/// What the air of one experiment does in one band.
struct Seen {
    /// τ₁ of the band.
    sun: f64,
    /// E_d.
    diffuse: f64,
    /// τ₂ and L_u of the sight from 1 km.
    path: (f64, f64),
}

/// Bands: NO2 and molecules; haze; ozone; oxygen; water; haze again.
const BANDS: [&str; 6] = ["nm440", "nm550", "nm600", "nm762", "nm940", "nm1020"];

/// The weather of each experiment against the first, through a scene: by experiment and band.
fn airs(base: &str, others: &[&str]) -> Vec<Vec<Seen>> {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("scene.glint");
    let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).expect("a writable folder");
    write("low.csv", "time_utc,pressure_hpa\n1992-06-18T15:30,900\n1992-06-18T16:30,900\n");
    write("flat.csv", "scattering_angle_deg,phase\n0,1\n180,1\n");
    fs::copy("crates/atmosphere/tests/data/buf_19890628_00z.csv", folder.path().join("moist.csv"))
        .expect("tests run at the root");
    let experiments =
        |(i, weather): (usize, &&str)| format!("experiment e{i} {{ samples 16, weather {{ {weather} }} }}\n");
    let scene = format!(
        "glint 1\nsite {{ latitude 43.084 deg, longitude -77.674 deg, elevation 218 m }}\n\
         collect {{ at 1992-06-18 12:00 -04:00 }}\nweather {{ {base} }}\natmosphere layered\n\
         material grey {{ ideal {{ diffuse 0.3 }} }}\nground grey\n\
         sensor above {{ position (0 0 1000) m, look_at (0 0 0) m, field_of_view 1 deg, pixels 1 x 1\n\
         band nm440 435..445 nm\nband nm550 545..555 nm\nband nm600 595..605 nm\nband nm762 760..765 nm\n\
         band nm940 935..945 nm\nband nm1020 1015..1025 nm }}\nexperiment base {{ samples 16 }}\n{}",
        others.iter().enumerate().map(experiments).collect::<String>()
    );
    fs::write(&path, scene).expect("a writable folder");
    let checked = sunglint::open(&path).unwrap_or_else(|refused| panic!("{refused}"));
    let plan = Plan::new(checked, &Options::default()).unwrap_or_else(|refused| panic!("{refused}"));
    assert!(plan.warnings.is_empty(), "{:?}", plan.warnings);
    (plan.runs().iter())
        .map(|run| {
            let air = sunglint::inspection::air(&[run], &run.moments[0].label, &[]).expect("a time of the run");
            let seen = BANDS.iter().map(|name| {
                let band = air.bands.iter().find(|band| band.name == *name).expect("a band of the scene");
                Seen { sun: band.sun_transmittance, diffuse: band.diffuse_irradiance, path: band.path[0] }
            });
            seen.collect()
        })
        .collect()
}

fn in_band<'a>(seen: &'a [Seen], name: &str) -> &'a Seen {
    let at = BANDS.iter().position(|band| *band == name).expect("a band");
    &seen[at]
}

/// Extinction optical depth, by the beam, that an experiment has over the base. The sun stands at 24.63°, where refraction
/// and the Earth's curvature change its air mass by less than 1e-3.
fn deeper(base: &[Seen], other: &[Seen], name: &str) -> f64 {
    (in_band(base, name).sun / in_band(other, name).sun).ln() * 24.63f64.to_radians().cos()
}

/// One field at a time, each in the direction of its physics and, where the beam has a closed form, by its amount.
#[test]
fn every_field_of_the_weather_shows_in_the_bands_that_it_is_about() {
    let found = airs(
        "aod 0.2, water 1.5 g/cm2, ozone 300 DU, no2 0.1 DU",
        &[
            "aod 0.4",
            "visibility 5 km",
            "pressure 900 hPa",
            "observations \"low.csv\"",
            "water 4 g/cm2",
            "ozone 500 DU",
            "no2 1.1 DU",
            "aerosol urban",
            "cloud { optical_depth 2, base 2 km, top 3 km }",
        ],
    );
    let [base, aod, visibility, pressure, record, water, ozone, no2, urban, cloud] = found.as_slice() else {
        panic!("ten experiments")
    };
    let base = base.as_slice();

    // 0.2 more at 0.55 µm; haze scatters into the sky and into the path.
    assert!((deeper(base, aod, "nm550") - 0.2).abs() < 1e-3, "{}", deeper(base, aod, "nm550"));
    for (hazy, name) in [(aod, "an optical depth of 0.4"), (visibility, "5 km")] {
        for band in ["nm440", "nm550", "nm1020"] {
            let (a, b) = (in_band(base, band), in_band(hazy, band));
            assert!(
                b.sun < a.sun && b.diffuse > a.diffuse && b.path.0 < a.path.0 && b.path.1 > a.path.1,
                "{name}, {band}"
            );
        }
    }
    // Koschmieder at the ground: 5 km are 3.912/5 km over the first kilometre, which LOWTRAN's haze thins by a fifth or less.
    let lost = -in_band(visibility, "nm550").path.0.ln();
    assert!((0.8 * 0.782..1.02 * 0.782).contains(&lost), "{lost}");

    // 11 % less air: molecules at 0.44 µm have 0.24 at 1013 hPa [Bodhaine1999, table 3], and 0.2326 at the base's 987 hPa.
    let less = -deeper(base, pressure, "nm440");
    assert!((less - 0.2426 * (987.3 - 900.0) / 1013.25).abs() < 1e-3, "{less}");
    assert!(in_band(pressure, "nm440").diffuse < in_band(base, "nm440").diffuse);
    assert!(in_band(pressure, "nm762").sun > 1.005 * in_band(base, "nm762").sun, "less oxygen");
    assert!(
        (in_band(record, "nm440").sun / in_band(pressure, "nm440").sun - 1.0).abs() < 1e-9,
        "the record says it too"
    );

    // More water at 0.94 µm, and there alone among the beams.
    assert!(deeper(base, water, "nm940") > 0.1, "{}", deeper(base, water, "nm940"));
    assert!(in_band(water, "nm940").path.0 < in_band(base, "nm940").path.0);
    assert!(deeper(base, water, "nm550").abs() < 0.01);

    // 200 DU in the Chappuis band: LOWTRAN 7's coefficient rises over this band about 0.1226 atm-cm⁻¹ at 0.6 µm [Kneizys1988].
    // 1 DU of NO2 at 0.44 µm: 5.1e-19 cm² [Sander2006] are 0.0137.
    let more = deeper(base, ozone, "nm600");
    assert!((more - 0.2 * 0.1226).abs() < 0.02 * 0.0245, "{more}");
    let more = deeper(base, no2, "nm440");
    assert!((more - 0.0137).abs() < 0.1 * 0.0137, "{more}");

    // Soot: the same optical depth at 0.55 µm, less light from the sky.
    assert!(deeper(base, urban, "nm550").abs() < 0.01);
    assert!(in_band(urban, "nm550").diffuse < 0.9 * in_band(base, "nm550").diffuse);

    // A cloud of optical depth 2: e^(−2/cos θ) of the beam, and most of it from the sky.
    assert!((deeper(base, cloud, "nm550") - 2.0).abs() < 0.01, "{}", deeper(base, cloud, "nm550"));
    assert!(in_band(cloud, "nm550").diffuse > 2.0 * in_band(base, "nm550").diffuse);
}

/// What the air itself is: a moist ascent and a tropical profile against the standard one; warm air holds more water at one humidity.
#[test]
fn profiles_ascents_temperature_and_humidity_change_water_and_ozone() {
    let found = airs(
        "aod 0.1",
        &[
            "profile tropical",
            "radiosonde \"moist.csv\"",
            "temperature 10 degC, humidity 50 %",
            "temperature 30 degC, humidity 50 %",
            "temperature 30 degC, humidity 90 %",
        ],
    );
    let sun = |i: usize, name: &str| in_band(&found[i], name).sun;
    // 4.1 g/cm2 against 1.4, and 277 DU of ozone against 345 [Anderson1986]; the ascent has 4.6 g/cm2 (MetPy).
    assert!(sun(1, "nm940") < 0.8 * sun(0, "nm940"), "tropical water");
    // The ozone alone is 0.068 atm-cm × 0.085 atm-cm⁻¹ at 0.55 µm, where water hardly absorbs and `aod` holds the aerosol.
    assert!(sun(1, "nm550") > 1.003 * sun(0, "nm550"), "less ozone in the tropics");
    assert!(sun(2, "nm940") < sun(1, "nm940"), "a moister ascent");
    // e_s is 12.3 hPa at 10 degC and 42.4 hPa at 30 degC.
    assert!(sun(4, "nm940") < 0.8 * sun(3, "nm940"), "warm air holds more water");
    assert!(sun(5, "nm940") < sun(4, "nm940"), "and 90 % is more than 50 %");
}

/// Ångström's α, ω, g and P one at a time: spectrum of the beam, and what the sky keeps of it.
#[test]
fn the_numbers_of_an_aerosol_act_as_theory_has_them() {
    let of = |numbers: &str| format!("aerosol angstrom {{ {numbers} }}");
    let others = ["exponent 2", "single_scattering_albedo 0.7", "asymmetry 0.3", "phase \"flat.csv\""];
    let others = others.map(of);
    let found = airs("aod 0.3, aerosol angstrom { exponent 1 }", &others.each_ref().map(String::as_str));
    let [base, steep, dark, broad, flat] = found.as_slice() else { panic!("five experiments") };
    // α from 1 to 2: τ = 0.3 (λ/0.55)^−α.
    let due = 0.3 * ((0.44f64 / 0.55).powi(-2) - (0.44f64 / 0.55).powi(-1));
    assert!((deeper(base, steep, "nm440") - due).abs() < 2e-3, "{}", deeper(base, steep, "nm440"));
    assert!(deeper(base, steep, "nm1020") < -0.05);
    // At 0.55 µm α has no part: beams agree, the sky has what is neither absorbed nor turned back.
    for other in [dark, broad, flat] {
        assert!(deeper(base, other, "nm550").abs() < 1e-3);
        assert!(in_band(other, "nm550").diffuse < 0.95 * in_band(base, "nm550").diffuse);
    }
    // What turns back reaches the sensor.
    let up = |seen: &Vec<Seen>| in_band(seen, "nm550").path.1;
    assert!(
        up(dark) < up(base) && up(broad) > up(base) && up(flat) > up(broad),
        "{} {} {} {}",
        up(base),
        up(dark),
        up(broad),
        up(flat)
    );
}
