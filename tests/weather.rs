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
        std::sync::Arc::ptr_eq(&plan.runs()[a].light[time], &plan.runs()[b].light[time])
    };
    assert!(
        same(0, 1, 0) && same(0, 1, 1) && !std::sync::Arc::ptr_eq(&plan.runs()[0].light[1], &plan.runs()[2].light[0])
    );
}
