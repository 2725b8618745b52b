//! The program as a user runs it.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;

fn sunglint(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_sunglint")).args(args).output().expect("the program starts")
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn json(args: &[&str]) -> Value {
    let output = sunglint(args);
    assert!(output.status.success(), "{args:?}: {}", stderr(&output));
    serde_json::from_slice(&output.stdout).expect("the output is JSON")
}

fn text(path: &Path) -> &str {
    path.to_str().expect("temporary paths are UTF-8")
}

const MINIMAL: &str = "examples/minimal/minimal.glint";

fn render(out: &Path) -> Output {
    sunglint(&["render", MINIMAL, "-o", text(out), "--pixels", "64x48", "--samples", "16"])
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).expect("a readable folder") {
        let path = entry.expect("a readable entry").path();
        if path.is_dir() { found.extend(files(&path)) } else { found.push(path) }
    }
    found.sort();
    found
}

#[test]
fn a_render_writes_its_products_and_a_second_one_does_no_work() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let first = render(folder.path());
    assert!(first.status.success(), "{}", stderr(&first));
    let run = folder.path().join("default/roof");
    let frame = run.join("1992-06-18T160000Z");
    for file in ["radiance.exr", "radiance.img", "radiance.hdr", "error.exr", "lit.exr", "red.png"] {
        assert!(frame.join(file).is_file(), "{file}");
    }
    assert!(run.join("truth.exr").is_file() && run.join("manifest.json").is_file());
    let stamp = |path: &Path| std::fs::metadata(path).and_then(|meta| meta.modified()).expect("a time");
    let before: Vec<_> = files(folder.path()).iter().map(|path| stamp(path)).collect();
    let second = render(folder.path());
    assert!(second.status.success() && stderr(&second).contains("nothing to do"), "{}", stderr(&second));
    let after: Vec<_> = files(folder.path()).iter().map(|path| stamp(path)).collect();
    assert_eq!(before, after);
}

/// Tiles that were finished before a kill are not rendered again, and the result is the same to the bit.
#[test]
fn a_killed_render_goes_on_from_its_finished_tiles() {
    let (whole, torn) = (tempfile::tempdir().expect("a folder"), tempfile::tempdir().expect("a folder"));
    let args = |out: &Path| {
        let out = text(out).to_string();
        [
            "render",
            "examples/truth/truth.glint",
            "--experiment",
            "ideal",
            "--pixels",
            "320x240",
            "--samples",
            "16",
            "-o",
        ]
        .map(String::from)
        .into_iter()
        .chain([out])
        .collect::<Vec<_>>()
    };
    let mut child = Command::new(env!("CARGO_BIN_EXE_sunglint"))
        .args(args(torn.path()))
        .stderr(std::process::Stdio::null())
        .spawn()
        .expect("the program starts");
    let tiles = torn.path().join(".sunglint");
    let finished = || {
        if tiles.is_dir() {
            files(&tiles).iter().filter(|p| p.extension().is_some_and(|e| e == "bin")).count()
        } else {
            0
        }
    };
    while finished() < 3 && child.try_wait().expect("a child").is_none() {
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    child.kill().expect("the child is ours");
    child.wait().expect("the child ends");
    let resumed = Command::new(env!("CARGO_BIN_EXE_sunglint")).args(args(torn.path())).output().expect("it starts");
    assert!(resumed.status.success(), "{}", stderr(&resumed));
    let manifest: Value = serde_json::from_str(
        &std::fs::read_to_string(torn.path().join("ideal/roof/manifest.json")).expect("a manifest"),
    )
    .expect("JSON");
    assert!(manifest["tiles_resumed"].as_u64() >= Some(1), "{manifest:#}");
    assert!(!tiles.exists(), "tiles are removed once the products are written");
    let direct = Command::new(env!("CARGO_BIN_EXE_sunglint")).args(args(whole.path())).output().expect("it starts");
    assert!(direct.status.success());
    let image = "ideal/roof/1992-06-18T170100Z/radiance.img";
    let read = |folder: &Path| std::fs::read(folder.join(image)).expect("an image");
    assert!(read(torn.path()) == read(whole.path()), "a resumed render differs");
}

#[test]
fn the_same_bits_on_one_thread_and_on_three() {
    let (one, three) = (tempfile::tempdir().expect("a folder"), tempfile::tempdir().expect("a folder"));
    for (folder, threads) in [(&one, "1"), (&three, "3")] {
        let out = text(folder.path());
        let output =
            sunglint(&["--threads", threads, "render", MINIMAL, "-o", out, "--pixels", "64x48", "--samples", "32"]);
        assert!(output.status.success(), "{}", stderr(&output));
    }
    for name in ["radiance.img", "radiance.exr", "error.exr", "red.png"] {
        let read =
            |folder: &Path| std::fs::read(folder.join("default/roof/1992-06-18T160000Z").join(name)).expect(name);
        assert!(read(one.path()) == read(three.path()), "{name}");
    }
}

#[test]
fn bad_input_exits_with_2_and_leaves_nothing_behind() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("out");
    let output = sunglint(&["render", "tests/bad/u02_missing_unit.glint", "-o", text(&out)]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("error[") && !out.exists(), "{}", stderr(&output));
    assert_eq!(sunglint(&["check", "no/such/scene.glint"]).status.code(), Some(2));
    assert_eq!(sunglint(&["models", "no_such_model"]).status.code(), Some(2));
    assert_eq!(sunglint(&["explain", MINIMAL, "--pixel", "9999,0"]).status.code(), Some(2));
}

#[test]
fn a_folder_that_cannot_be_written_exits_with_3() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("file");
    std::fs::write(&file, "in the way").expect("a file");
    let output = sunglint(&["render", MINIMAL, "-o", text(&file), "--pixels", "8x8", "--samples", "16"]);
    assert_eq!(output.status.code(), Some(3), "{}", stderr(&output));
}

#[test]
fn check_reports_as_json() {
    let clean = json(&["check", MINIMAL, "--json"]);
    assert_eq!(clean, Value::Array(Vec::new()));
    let output = sunglint(&["check", "tests/bad/u02_missing_unit.glint", "--json"]);
    assert_eq!(output.status.code(), Some(2));
    let found: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let first = &found[0];
    assert_eq!((first["code"].as_str(), first["severity"].as_str()), (Some("U02"), Some("error")));
    assert!(first["line"].is_u64() && first["column"].is_u64() && first["file"].is_string());
}

#[test]
fn the_sun_is_printed_with_units_in_the_keys() {
    let at =
        ["sun", "--latitude", "43.08", "--longitude", "-77.67", "--elevation", "168", "--at", "1992-06-18T16:00:00Z"];
    let sun = json(&[&at[..], &["--pressure", "995", "--temperature", "24", "--json"]].concat());
    assert_eq!(sun["time_utc"], "1992-06-18T16:00:00Z");
    for key in ["zenith_deg", "apparent_zenith_deg", "azimuth_deg", "earth_sun_distance_au"] {
        assert!(sun[key].is_f64(), "{key}");
    }
    let refraction = sun["zenith_deg"].as_f64().zip(sun["apparent_zenith_deg"].as_f64()).map(|(a, b)| a - b);
    // 995 hPa, 24 °C, 65.4° of altitude: about 0.0073° by the SPA's formula.
    assert!(refraction.is_some_and(|r| (r - 0.0073).abs() < 5e-4), "{refraction:?}");
}

#[test]
fn explain_names_every_term_of_a_pixel() {
    let pixel = json(&["explain", MINIMAL, "--pixel", "160,120", "--json"]);
    let band = &pixel["bands"][0];
    assert_eq!(band["name"], "red");
    for term in [
        "solar_irradiance",
        "sun_transmittance",
        "path_transmittance",
        "mean_sky_radiance",
        "path_radiance",
        "sky_view_factor",
        "sun_visible",
        "diffuse",
        "specular",
    ] {
        assert!(band["terms"][term].is_f64(), "{term}");
    }
    for key in ["material", "object", "facet", "x_m", "y_m", "z_m", "range_m", "view_zenith_deg"] {
        assert!(!pixel["hit"][key].is_null(), "{key}");
    }
    let parts = ["diffuse_sun", "diffuse_sky", "diffuse_background", "path_radiance"];
    let sum: f64 = parts.iter().filter_map(|part| band["terms"][part].as_f64()).sum();
    let radiance = band["radiance"].as_f64().expect("a number");
    assert!((sum / radiance - 1.0).abs() < 1e-9, "parts {sum}, whole {radiance}");
}

#[test]
fn plan_says_what_runs_and_what_is_skipped() {
    let plan = json(&["plan", "examples/truth/truth.glint", "--json"]);
    let run = &plan["runs"][1];
    assert_eq!((run["experiment"].as_str(), run["times"].as_array().map(Vec::len)), (Some("split"), Some(31)));
    let skips: Vec<&str> =
        run["skips"].as_array().into_iter().flatten().filter_map(|skip| skip["what"].as_str()).collect();
    assert!(skips.iter().any(|what| what.contains("wavelengths")), "{skips:?}");
}

#[test]
fn a_new_scene_renders() {
    let folder = tempfile::tempdir().expect("a folder");
    let name = folder.path().join("meadow");
    assert!(sunglint(&["new", text(&name)]).status.success());
    let scene = name.join("meadow.glint");
    let output = sunglint(&["-q", "render", text(&scene), "-o", text(folder.path()), "--pixels", "16x12"]);
    assert!(output.status.success() && stderr(&output).is_empty(), "{}", stderr(&output));
    assert_eq!(sunglint(&["new", text(&name)]).status.code(), Some(2), "an existing scene is kept");
}

#[test]
fn completions_and_help_are_there() {
    for shell in ["bash", "zsh", "fish"] {
        assert!(!sunglint(&["completions", shell]).stdout.is_empty());
    }
    for command in ["new", "check", "plan", "render", "explain", "sun", "models", "completions"] {
        let help = sunglint(&[command, "--help"]);
        assert!(String::from_utf8_lossy(&help.stdout).contains("Example"), "{command}");
    }
}

/// A scene whose only finding is a warning passes, unless that warning, or any, is denied: then nothing is written.
#[test]
fn denied_warnings_end_a_command_with_2() {
    let night = "tests/bad/t03_forgotten_zone.glint";
    let code = |args: &[&str]| sunglint(args).status.code();
    assert_eq!(code(&["check", night]), Some(0));
    assert_eq!(code(&["check", night, "--deny", "G01"]), Some(0));
    assert_eq!(code(&["check", night, "--deny", "G01", "--deny", "t03"]), Some(2));
    assert_eq!(code(&["check", MINIMAL, night, "--deny", "warnings"]), Some(2));
    assert_eq!(code(&["check", MINIMAL, MINIMAL, "--deny", "warnings"]), Some(0));
    assert_eq!(code(&["plan", night, "--deny", "warnings"]), Some(2));
    assert_eq!(code(&["check", night, "--deny", "T99"]), Some(2));
    let folder = tempfile::tempdir().expect("a temporary folder");
    let out = folder.path().join("out");
    let refused = sunglint(&["render", night, "-o", text(&out), "--deny", "T03"]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(stderr(&refused).contains("error[T03]") && !out.exists(), "{}", stderr(&refused));
}
