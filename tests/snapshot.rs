//! `sunglint test`: scenes held against the snapshots beside them.

mod program;

use std::path::{Path, PathBuf};
use std::process::Output;

use program::{sunglint, text};
use serde_json::Value;

fn stdout(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// Runs `test` on a folder and gives its exit code and JSON.
fn test(folder: &Path, more: &[&str]) -> (Option<i32>, Value) {
    let output = sunglint(&[&["test", text(folder), "--json"], more].concat());
    let found = serde_json::from_slice(&output.stdout);
    (output.status.code(), found.unwrap_or_else(|_| panic!("{}", String::from_utf8_lossy(&output.stderr))))
}

fn statuses(found: &Value) -> Vec<String> {
    let runs = found["runs"].as_array().into_iter().flatten();
    runs.map(|run| format!("{} {}", run["experiment"].as_str().unwrap_or("-"), run["status"].as_str().unwrap_or("-")))
        .collect()
}

fn files(folder: &Path) -> Vec<String> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(at) = folders.pop() {
        for entry in std::fs::read_dir(&at).expect("a readable folder").map(|entry| entry.expect("an entry").path()) {
            if entry.is_dir() {
                folders.push(entry);
            } else {
                found.push(text(entry.strip_prefix(folder).expect("within")).to_string());
            }
        }
    }
    found.sort();
    found
}

/// From straight above, 16 x 12 pixels of 1 m: the left half is one material, the right half another; no air, the sun at 30
/// deg. Lambertian and level, they return E₀ ρ cos θ / π and nothing of each other.
fn scene(reflectance: &str, more: &str) -> String {
    format!(
        "glint 1\n\
         collect {{ sun zenith 30 deg azimuth 180 deg }}\n\
         atmosphere none {{ solar_irradiance 1500 W/m2/um }}\n\
         include \"materials.glint\"\n\
         material bright {{ ideal {{ diffuse {reflectance} }} }}\n\
         facet dark (-8 -6 0) (0 -6 0) (0 6 0) (-8 6 0) m\n\
         facet bright (0 -6 0) (8 -6 0) (8 6 0) (0 6 0) m\n\
         sensor above {{ projection orthographic, position (0 0 50) m, swath 16 m, pixels 320 x 240, band red 600..700 nm }}\n\
         {more}\n"
    )
}

const SNAPSHOT: &str = "snapshot { pixels 16 x 12 }\nexperiment one { algorithm ideal, samples 16 }";

fn study(folder: &Path) -> PathBuf {
    std::fs::write(folder.join("materials.glint"), "glint 1\nmaterial dark { ideal { diffuse 0.1 } }\n")
        .expect("a file");
    let path = folder.join("study.glint");
    std::fs::write(&path, scene("0.4", SNAPSHOT)).expect("a scene");
    path
}

#[test]
fn a_change_of_reflectance_moves_its_material_and_nothing_else() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let path = study(folder);
    let (code, found) = test(folder, &[]);
    assert_eq!((code, statuses(&found)), (Some(1), vec!["one new".to_string()]));
    assert_eq!(found["scenes_skipped"], 1, "the library of materials is no scene to test");
    assert!(!folder.join("study.snap").exists(), "only --accept writes snapshots");

    let (code, found) = test(folder, &["--accept"]);
    assert_eq!((code, statuses(&found)), (Some(0), vec!["one accepted".to_string()]));
    assert_eq!(files(&folder.join("study.snap")), ["one/above.exr", "one/above.json"]);
    let summary = folder.join("study.snap/one/above.json");
    let first: Value = serde_json::from_str(&std::fs::read_to_string(&summary).expect("a summary")).expect("JSON");
    // E₀ ρ cos 30° / π
    let radiance = |rho: f64| 1500.0 * rho * 30f64.to_radians().cos() / std::f64::consts::PI;
    let mean = first["rows"][0]["materials"]["bright"].as_f64().expect("a mean");
    assert!((mean / radiance(0.4) - 1.0).abs() < 1e-4, "{mean}");
    assert_eq!(test(folder, &[]).0, Some(0));

    std::fs::write(&path, scene("0.5", SNAPSHOT)).expect("a scene");
    let (code, found) = test(folder, &[]);
    assert_eq!((code, statuses(&found)), (Some(1), vec!["one moved".to_string()]));
    let band = &found["runs"][0]["bands"][0];
    assert_eq!(band["band_a"], "sun_30_180.red");
    let of = |i: usize| &band["materials"][i];
    let (dark, bright) = (&of(0)["statistics"], &of(1)["statistics"]);
    assert_eq!((of(0)["name"].as_str(), of(1)["name"].as_str()), (Some("dark"), Some("bright")));
    assert_eq!((dark["rmse"].as_f64(), dark["n"].as_u64()), (Some(0.0), Some(96)));
    let near = |value: &Value, expected: f64| {
        let value = value.as_f64().expect("a number");
        assert!((value - expected).abs() < 1e-5 * radiance(0.5), "{value} {expected}");
    };
    near(&bright["bias"], radiance(0.5) - radiance(0.4));
    near(&bright["worst"]["a"], radiance(0.4));
    near(&bright["worst"]["b"], radiance(0.5));
    assert!((bright["relative_bias"].as_f64().expect("a number") - 0.25).abs() < 1e-5);
    let told = stdout(&sunglint(&["test", text(folder)]));
    for word in ["moved", "bright: bias", "(25.00 %)", "above.moved.png", "1 moved"] {
        assert!(told.contains(word), "{word}: {told}");
    }
    assert!(!told.contains("dark:"), "{told}");
    assert_eq!(files(&folder.join("study.snap")), ["one/above.exr", "one/above.json", "one/above.moved.png"]);

    assert_eq!(test(folder, &["--accept"]).0, Some(0));
    assert_eq!(files(&folder.join("study.snap")), ["one/above.exr", "one/above.json"], "the stale picture went");
    assert_eq!(test(folder, &[]).0, Some(0));
    // Back, without accepting: the former picture is of no use once the run passes again.
    std::fs::write(&path, scene("0.4", SNAPSHOT)).expect("a scene");
    assert_eq!(test(folder, &[]).0, Some(1));
    std::fs::write(&path, scene("0.5", SNAPSHOT)).expect("a scene");
    assert_eq!(test(folder, &[]).0, Some(0));
    assert_eq!(files(&folder.join("study.snap")), ["one/above.exr", "one/above.json"]);
}

/// Equal renders give equal files, so that version control sees a change only where there is one.
#[test]
fn accepting_the_same_again_gives_the_same_bytes() {
    let folder = tempfile::tempdir().expect("a folder");
    study(folder.path());
    let bytes = || {
        ["exr", "json"].map(|ending| {
            std::fs::read(folder.path().join("study.snap/one/above").with_extension(ending)).expect(ending)
        })
    };
    assert_eq!(test(folder.path(), &["--accept"]).0, Some(0));
    let first = bytes();
    std::fs::remove_dir_all(folder.path().join("study.snap")).expect("it goes");
    assert_eq!(test(folder.path(), &["--accept", "--threads", "1"]).0, Some(0));
    assert!(bytes() == first);
}

#[test]
fn runs_that_come_and_go_are_new_and_orphans() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let path = study(folder);
    assert_eq!(test(folder, &["--accept"]).0, Some(0));
    let two = SNAPSHOT.replace("experiment one", "experiment two");
    std::fs::write(&path, scene("0.4", &two)).expect("a scene");
    let (code, found) = test(folder, &[]);
    assert_eq!((code, statuses(&found)), (Some(1), vec!["two new".to_string()]));
    let orphans = found["orphans"].as_array().expect("orphans");
    assert!(
        orphans.len() == 2 && orphans[0].as_str().is_some_and(|path| path.ends_with("one/above.exr")),
        "{orphans:?}"
    );
    assert_eq!(test(folder, &["--filter", "no such run"]).0, Some(0));
    assert_eq!(test(folder, &["--accept"]).0, Some(0));
    assert_eq!(files(&folder.join("study.snap")), ["two/above.exr", "two/above.json"]);

    // A filter accepts its runs and leaves the others as they were.
    let both = format!("{SNAPSHOT}\nexperiment two like one {{ samples 32 }}");
    std::fs::write(&path, scene("0.5", &both)).expect("a scene");
    let (code, found) = test(folder, &["--accept", "--filter", "one/"]);
    assert_eq!((code, statuses(&found)), (Some(0), vec!["one accepted".to_string()]));
    let (code, found) = test(folder, &[]);
    assert_eq!((code, statuses(&found)), (Some(1), vec!["one passed".to_string(), "two moved".to_string()]));

    std::fs::remove_file(&path).expect("it goes");
    std::fs::write(folder.join("other.glint"), scene("0.4", SNAPSHOT)).expect("a scene");
    let (_, found) = test(folder, &[]);
    assert!(found["orphans"][0].as_str().is_some_and(|path| path.ends_with("study.snap")), "{found}");
}

/// A snapshot that says another size, is broken, or lacks a band: told, not compared.
#[test]
fn what_no_longer_fits_is_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let path = study(folder);
    assert_eq!(test(folder, &["--accept"]).0, Some(0));
    let note = |found: &Value| found["runs"][0]["notes"].to_string();
    std::fs::write(&path, scene("0.4", &SNAPSHOT.replace("16 x 12", "8 x 6"))).expect("a scene");
    let (code, found) = test(folder, &[]);
    assert!(code == Some(1) && note(&found).contains("16 x 12 pixels, the scene asks for 8 x 6"), "{found}");
    std::fs::write(&path, scene("0.4", SNAPSHOT).replace("band red", "band rouge")).expect("a scene");
    let (code, found) = test(folder, &[]);
    assert!(
        code == Some(1) && note(&found).contains("red is gone") && note(&found).contains("rouge is new"),
        "{found}"
    );
    std::fs::write(&path, scene("0.4", SNAPSHOT)).expect("a scene");
    std::fs::write(folder.join("study.snap/one/above.exr"), "no image").expect("a file");
    let (code, found) = test(folder, &[]);
    assert!(code == Some(1) && note(&found).contains("not readable"), "{found}");
    std::fs::write(&path, "glint 1\nsnapshot { pixels 16 }\n").expect("a scene");
    let (code, found) = test(folder, &[]);
    assert_eq!((code, found["bad_scenes"].as_u64()), (Some(2), Some(1)));
    let empty = tempfile::tempdir().expect("a folder");
    assert_eq!(sunglint(&["test", text(empty.path())]).status.code(), Some(2));
    // A scene that is named needs no `snapshot` statement.
    let plain = folder.join("plain.glint");
    std::fs::write(&plain, scene("0.4", "experiment one { algorithm ideal, samples 16 }")).expect("a scene");
    assert_eq!(sunglint(&["test", text(&plain)]).status.code(), Some(1));
}

#[test]
fn the_examples_look_as_their_snapshots_say() {
    let (code, found) = test(Path::new("examples"), &[]);
    assert_eq!(code, Some(0), "{found:#}");
}
