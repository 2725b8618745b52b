//! From a surface to scans and from scans to a table, as a user runs the two commands.

mod program;

use std::f64::consts::PI;
use std::path::Path;

use program::{json, number, refusal, stderr, stdout, sunglint, text};
use serde_json::Value;

fn rows(value: &Value) -> &Vec<Value> {
    value.as_array().unwrap_or_else(|| panic!("{value} is no array"))
}

const MEASURED: [f64; 5] = [8.0, 30.0, 45.0, 60.0, 75.0];

/// A scene of materials that answer in closed form, and what is put before its sensor.
fn bench(folder: &Path, more: &str) -> String {
    let path = folder.join("bench.glint");
    let scene = format!(
        "glint 1
site {{ latitude 43 deg, longitude -77 deg }}
collect {{ at 1992-06-18 12:00 -04:00 }}
atmosphere none
material grey {{ ideal {{ diffuse 0.18 }} }}
material tinted {{ ideal {{ diffuse [400 nm 0.1, 1000 nm 0.7] }} }}
material banded {{ split {{ table \"banded.csv\", solid_angle 1.9 msr }} }}
material mirror {{ ideal {{ specular 0.85 }} }}
{more}
facet grey (-20 -20 0) (20 -20 0) (20 20 0) (-20 20 0) m
panel banded size (1 1) m at (2 0 1) m
sensor roof {{
  position (0 -25 15) m, look_at (0 -10 0) m, field_of_view 10 deg, pixels 8 x 6
  band red 600..700 nm, band nir 800..900 nm
}}
"
    );
    let table = "band,view_zenith_deg,diffuse,specular\nred,0,0.2,40\nred,80,0.25,90\nnir,0,0.4,20\nnir,80,0.4,70\n";
    std::fs::write(folder.join("banded.csv"), table).expect("a table");
    std::fs::write(&path, scene).expect("a scene");
    text(&path).to_string()
}

/// A surface through the virtual goniometer and the split, and the table that is written back in a scene: at the measured
/// angles R_d and f in the mirror direction are what the scans say, whatever rule, curve and column were chosen.
#[test]
fn scans_become_a_table_that_returns_them() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = bench(folder.path(), "");
    let scans = folder.path().join("banded.scans.csv");
    let told = sunglint(&["goniometer", "banded", "--scene", &scene, "--noise", "0.5 %", "-o", text(&scans)]);
    assert!(told.status.success() && stderr(&told).contains("90 values: 2 bands"), "{}", stderr(&told));
    let geometry = folder.path().join("mirror.csv");
    let angles: String = MEASURED.iter().map(|t| format!("{t},{t},180\n")).collect();
    std::fs::write(&geometry, format!("incident_zenith_deg,view_zenith_deg,relative_azimuth_deg\n{angles}"))
        .expect("rows");
    let table = folder.path().join("made.csv");
    for options in [
        ["--grazing", "fresnel", "--interpolation", "linear", "--specular", "brf"],
        ["--grazing", "hold", "--interpolation", "pchip", "--specular", "brf"],
        ["--grazing", "fresnel", "--interpolation", "pchip", "--specular", "reflectance"],
    ] {
        let fit = json(&[&["fit", text(&scans), "-o", text(&table), "--json"], &options[..]].concat());
        let line = fit["scene"].as_str().expect("a line of the scene");
        let scene = bench(folder.path(), &format!("material made {{ {line} }}\n"));
        let args =
            ["reflectance", &scene, "made", "--geometry", text(&geometry), "--wavelength", "0.65,0.85", "--json"];
        let found = json(&args);
        for (b, band) in rows(&fit["bands"]).iter().enumerate() {
            assert_eq!(band["band"], ["red", "nir"][b]);
            assert_eq!(band["noise"], "stated");
            let degrees: Vec<f64> = rows(&band["rows"]).iter().map(|row| number(&row["view_zenith_deg"])).collect();
            assert_eq!(degrees, (0..=90).map(f64::from).collect::<Vec<_>>());
            for (k, t) in MEASURED.into_iter().enumerate() {
                let (d, s) = (&band["diffuse"][k], &band["specular"][k]);
                assert_eq!((number(&d["view_zenith_deg"]), number(&s["view_zenith_deg"])), (t, t));
                let row = &found["rows"][2 * k + b];
                assert!((number(&row["diffuse"]) / number(&d["diffuse"]) - 1.0).abs() < 1e-12, "{row}");
                assert!((PI * number(&row["brdf_per_sr"]) / number(&s["brf"]) - 1.0).abs() < 1e-12, "{row} {s}");
                let rho_s = number(&s["specular_brf"]) * 1.9e-3 * t.to_radians().cos() / PI;
                assert!((number(&row["specular"]) / rho_s - 1.0).abs() < 1e-12, "{row}");
                // What the scene stated, within six standard errors of the noise and the lines between its rows.
                let truth = if b == 0 { 0.2 + 0.05 * t / 80.0 } else { 0.4 };
                let error = number(&d["standard_error"]);
                assert!((number(&d["diffuse"]) - truth).abs() < 6.0 * error && error < 0.001, "{d}");
            }
        }
    }
}

/// ρ over a Lambertian sample, π ρ/(Ω cos θ) in a mirror: with `--json`, on the output, and in bands of the scene.
#[test]
fn closed_forms_are_read_by_the_instrument() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = bench(folder.path(), "");
    let grey = json(&["goniometer", "grey", "--scene", &scene, "--wavelength", "0.55,0.5", "--json"]);
    assert_eq!(rows(&grey["readings"]).len(), 90);
    assert!(rows(&grey["readings"]).iter().all(|row| number(&row["brf"]) == 0.18 && number(&row["brf_stddev"]) == 0.0));
    let mirror = [
        "goniometer",
        "mirror",
        "--scene",
        &scene,
        "--solid-angle",
        "0.01 sr",
        "--illumination",
        "40",
        "--view",
        "-40,20,90",
        "--json",
    ];
    for row in rows(&json(&mirror)["readings"]) {
        let expected =
            if number(&row["view_zenith_deg"]) < 0.0 { PI * 0.85 / (0.01 * 40f64.to_radians().cos()) } else { 0.0 };
        assert!((number(&row["brf"]) - expected).abs() < 1e-9 && row["band"].is_string(), "{row}");
    }
    // A line against wavelength has its value in the middle of a band as its mean over it.
    let tinted = json(&["goniometer", "tinted", "--scene", &scene, "--view", "-8,8,0", "--json"]);
    let first = &tinted["readings"][0];
    assert!(first["band"] == "red" && (number(&first["brf"]) - 0.35).abs() < 1e-12, "{first}");
    let printed = stdout(&["goniometer", "panel_spectralon_50", "--retro", "--seed", "7"]);
    assert!(
        printed.starts_with("# panel_spectralon_50, model ideal: virtual goniometer, aperture 0.0019 sr"),
        "{printed}"
    );
    assert_eq!(printed.lines().count(), 2 + 50);
    assert!(
        printed.contains(
            "\nwavelength_nm,illumination_zenith_deg,view_zenith_deg,brf,brf_stddev,solid_angle_sr\n550,8,-75,"
        )
    );
}

/// The same seed, the same file; Lambert has R_s = 0; a plot and a table appear; what is known of the scans is printed.
#[test]
fn a_fit_prints_what_the_scans_lack_and_what_it_found() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = bench(folder.path(), "");
    let at = |name: &str| folder.path().join(name);
    let (scans, again, table, plot) = (at("a.csv"), at("b.csv"), at("t.csv"), at("p.svg"));
    for path in [&scans, &again] {
        let noise = ["--noise", "2 %", "--noise-floor", "0.001", "--repeats", "3"];
        stdout(
            &[&["goniometer", "grey", "--scene", &scene, "--wavelength", "0.6", "-o", text(path)], &noise[..]].concat(),
        );
    }
    assert_eq!(std::fs::read(&scans).expect("scans"), std::fs::read(&again).expect("scans"));
    let printed = stdout(&["-q", "fit", text(&scans), "-o", text(&table), "--plot", text(&plot)]);
    assert!(printed.contains("45 values: 1 band, 5 illuminations, 10 views\naperture 0.0019 sr\n"), "{printed}");
    assert!(printed.contains("600 nm: errors by the noise that the scans state"), "{printed}");
    assert!(std::fs::read_to_string(&plot).expect("a plot").contains("In-plane reflectance"));
    // One wavelength stands for all.
    let written = std::fs::read_to_string(&table).expect("a table");
    assert!(written.contains("# measured at 600 nm, here for all wavelengths\n"), "{written}");
    assert!(written.contains("\nview_zenith_deg,diffuse,specular,"), "{written}");

    let hand = at("hand.csv");
    std::fs::write(
        &hand,
        "band,illumination_zenith_deg,view_zenith_deg,brf\nred,30,-30,0.9\nred,30,10,0.2\nred,30,30,0.21\nred,30,90,0.4\n\
         red,60,-60,0.1\nred,60,10,0.22\nred,60,30,0.2\nred,60,60,0.24\nred,70,10,0.2\n",
    )
    .expect("scans");
    let printed = stdout(&["fit", text(&hand), "--solid-angle", "2 msr"]);
    for expected in [
        "gap (no value there):\n  illumination 30 deg, view -60 deg of band `red`\n",
        "no specular value (v = -i is missing: no R_s at that angle):\n  illumination 70 deg, view -70 deg of band `red`\n",
        "impossible (nothing is seen along the surface: ignored):\n  illumination 30 deg, view 90 deg of band `red`: 0.4\n",
        "against the light (v = +i, where instruments shade the sample: used):\n  illumination 30 deg, view 30 deg",
        "red: no noise is stated: errors by the pooled scatter of ",
        "clamped: at 60 deg the mirror's value is 1.400e-1 below R_d",
        "energy: R_d + rho_s at most ",
    ] {
        assert!(printed.contains(expected), "{expected}\n{printed}");
    }
}

#[test]
fn bad_input_is_told_and_nothing_is_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = bench(folder.path(), "");
    let write = |name: &str, rows: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, format!("illumination_zenith_deg,view_zenith_deg,brf\n{rows}")).expect("scans");
        text(&path).to_string()
    };
    let out = folder.path().join("out.csv");
    let plot = folder.path().join("out.svg");
    let sound = write("sound.csv", "30,-30,0.9\n30,10,0.2\n");
    let wrong = write("wrong.csv", "30,-30,0.9\n30,100,0.2\n95,10,x\n-5,10,0.2\n");
    let matt = write("matt.csv", "30,20,0.9\n30,10,0.2\n");
    let white = write("white.csv", "30,-30,9000\n30,10,0.2\n30,30,0.9\n");
    let fits: [(&[&str], &[&str]); 8] = [
        (
            &[&sound],
            &["sound.csv: the solid angle of the instrument's aperture is not stated", ", or say --solid-angle"],
        ),
        (&[&sound, "--solid-angle", "2"], &["--solid-angle 2: write the unit, one of sr, msr, usr"]),
        (&[&sound, "--solid-angle", "2 deg"], &["`deg` is no unit of a solid angle"]),
        (&[&sound, "--solid-angle", "9 sr"], &["an aperture of 9 sr is none"]),
        (
            &[&wrong, "--solid-angle", "2 msr"],
            &[
                "error: ",
                "wrong.csv: line 3: a view angle of 100 deg is behind the sample; view angles lie within",
                "wrong.csv: line 4: brf: `x` is no number",
                "wrong.csv: line 5: an illumination angle of -5 deg is negative",
            ],
        ),
        (&[&matt, "--solid-angle", "2 msr"], &["matt.csv: the scans have no value in the mirror direction, v = -i"]),
        (
            &[&white, "--solid-angle", "2 msr"],
            &[
                "white.csv: the sample returns more than it gets at 30 deg: ",
                "error: nothing is written; is the solid angle",
            ],
        ),
        (&["missing.csv"], &["missing.csv: "]),
    ];
    for (args, expected) in fits {
        let told = refusal(&[&["fit"], args, &["-o", text(&out), "--plot", text(&plot)]].concat());
        assert!(expected.iter().all(|expected| told.contains(expected)), "{args:?}: {told}");
    }
    let scans: [(&[&str], &str); 9] = [
        (&["gray"], "did you mean `grey`?"),
        (&["grey", "--wavelength", "550"], "write micrometres"),
        (&["grey", "--illumination", "95"], "illumination angles lie from 0 to below 90 deg"),
        (&["grey", "--view", "120"], "view angles lie within -90..90 deg"),
        (&["grey", "--solid-angle", "4 sr"], "an aperture of 4 sr is none"),
        (&["grey", "--noise", "x"], "--noise x: this is no number"),
        (&["grey", "--noise=-1 %"], "noise is a standard deviation"),
        (&["grey", "--repeats", "0"], "0 repeats"),
        (&["tinted", "--wavelength", "0.3"], "M04"),
    ];
    for (args, expected) in scans {
        let told =
            refusal(&[&["goniometer", "--scene", &scene], args, &["-o", text(&out), "--plot", text(&plot)]].concat());
        assert!(told.contains(expected), "{args:?}: {told}");
    }
    assert!(!out.exists() && !plot.exists());
    for command in ["goniometer", "fit"] {
        assert!(stdout(&[command, "--help"]).contains("Example"));
    }
}

/// A model's own scans fitted by it: parameters come back with errors that cover them, and the block that is printed binds
/// to the same reflectance.
#[test]
fn a_model_is_fitted_to_its_own_scans() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = bench(
        folder.path(),
        "material glossy { ward { diffuse [red 0.2, nir 0.4], specular 0.15, roughness 0.2 } }\nfacet glossy (0 0 1) (1 0 1) (1 1 1) m",
    );
    let scans = folder.path().join("glossy.csv");
    let wanted = ["goniometer", "glossy", "--scene", &scene, "--noise", "1 %", "-o", text(&scans)];
    stdout(&wanted);
    let plot = folder.path().join("glossy.svg");
    let table = folder.path().join("misfits.csv");
    let fit = json(&["fit", text(&scans), "--model", "ward", "--json", "--plot", text(&plot), "-o", text(&table)]);
    for (band, diffuse) in rows(&fit["bands"]).iter().zip([0.2, 0.4]) {
        for (parameter, truth) in rows(&band["parameters"]).iter().zip([diffuse, 0.15, 0.2]) {
            let (value, error) = (number(&parameter["value"]), number(&parameter["standard_error"]));
            assert!((value - truth).abs() < 4.0 * error + 2e-3 * truth, "{parameter}: {truth}");
        }
        let chi_square = number(&band["chi_square"]) / number(&band["degrees_of_freedom"]);
        assert!((0.2..2.0).contains(&chi_square), "{chi_square}");
    }
    let misfits = std::fs::read_to_string(&table).expect("a table");
    assert!(misfits.starts_with("band,illumination_zenith_deg,view_zenith_deg,brf,model_brf,misfit_brf\nred,8,"));
    assert!(std::fs::read_to_string(&plot).expect("a plot").contains("Scans and fitted ward"));
    let block = fit["in_a_scene"].as_str().expect("a block");
    let again = bench(folder.path(), &format!("material glossy {{ {block} }}\nfacet glossy (0 0 1) (1 0 1) (1 1 1) m"));
    let directions = folder.path().join("directions.csv");
    std::fs::write(&directions, "incident_zenith_deg,view_zenith_deg,relative_azimuth_deg\n40,20,120\n")
        .expect("angles");
    let value =
        json(&["reflectance", &again, "glossy", "--geometry", text(&directions), "--wavelength", "0.65", "--json"]);
    assert!(number(&value["rows"][0]["brdf_per_sr"]) > 0.2 / PI * 0.9);

    // Ranked, the model that made the scans is first.
    let ranked = json(&["fit", text(&scans), "--compare=ideal,phong,ward,oren_nayar", "--json"]);
    assert_eq!((&ranked["models"][0]["model"], &ranked["models"][0]["unbeaten"]), (&"ward".into(), &true.into()));
    assert!(stdout(&["fit", text(&scans), "--compare=ideal,ward"]).contains("ns/pair"));

    let refused = |more: &[&str]| refusal(&[&["fit", text(&scans)], more].concat());
    assert!(refused(&["--model", "wardd"]).contains("did you mean `ward`"));
    assert!(refused(&["--model", "ward", "--free", "shine"]).contains("it has diffuse, specular, roughness"));
    assert!(refused(&["--model", "ggx", "--fix", "n=400"]).contains("between 1.02 and 10"));
    assert!(refused(&["--model", "he_torrance"]).contains("wavelength_nm"));
    assert!(refused(&["--compare=ideal,split"]).contains("split"));
}

/// What the split of a model loses: nothing of a Lambertian surface, and of a lobe its shape.
#[test]
fn a_split_is_held_against_the_whole() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = bench(
        folder.path(),
        "material matt { oren_nayar { diffuse 0.4, roughness 0 rad } }\n\
         material metal { ggx { n 1, k 6, roughness 0.3 }, split { category highly_specular, total 0.9 } }\n\
         facet matt (0 0 1) (1 0 1) (1 1 1) m\nfacet metal (0 0 2) (1 0 2) (1 1 2) m",
    );
    let matt = json(&["reflectance", &scene, "matt", "--compare", "split,full", "--json"]);
    let row = &matt["rows"][0];
    assert!(number(&row["rms_brf"]) < 1e-4 && (number(&row["mean_brf"]) - 0.4).abs() < 1e-6, "{row}");
    let plot = folder.path().join("loss.png");
    let kind = format!("brdf={}", text(&plot));
    let own = json(&["reflectance", &scene, "metal", "--compare", "split,full", "--plot", &kind, "--json"]);
    assert_eq!((own["first"].as_str(), own["second"].as_str()), (Some("split"), Some("ggx")));
    assert!(number(&own["rows"][0]["rms_brf"]) > 0.1 && plot.exists());
    assert!(refusal(&["reflectance", &scene, "grey", "--compare", "split,full"]).contains("no model beyond ideal"));
    assert!(refusal(&["reflectance", &scene, "metal", "--compare", "split"]).contains("two names"));
    assert!(refusal(&["reflectance", &scene, "metal", "--compare", "split,shine"]).contains("shine"));
}
