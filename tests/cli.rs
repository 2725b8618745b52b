//! The program as a user runs it.

mod program;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use program::{json, stderr, sunglint, text};
use serde_json::Value;

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
            "--only",
            "experiment=ideal",
            "--only",
            "time=1992-06-18T17",
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

/// What `fmt` may do to files: lay out, say so, or refuse and leave them; `-` goes through the streams.
#[test]
fn fmt_lays_files_out_or_leaves_them() {
    let folder = tempfile::tempdir().expect("a folder");
    let (loose, good, bad) =
        (folder.path().join("loose.glint"), folder.path().join("good.glint"), folder.path().join("bad.glint"));
    let write = |path: &Path, content: &str| std::fs::write(path, content).expect("a written file");
    let read = |path: &Path| std::fs::read_to_string(path).expect("a readable file");
    write(&loose, "a   1,b 2 # why\r\n");
    write(&good, "glint 1\na 1\n");
    write(&bad, "a {");
    let laid_out = "glint 1\na 1\nb 2       # why\n";

    let check = sunglint(&["fmt", "--check", text(&good), text(&loose)]);
    assert_eq!(check.status.code(), Some(1));
    assert_eq!(String::from_utf8_lossy(&check.stdout), format!("{}\n", loose.display()));
    let shown = sunglint(&["fmt", "--stdout", text(&loose)]);
    assert_eq!((shown.status.code(), String::from_utf8_lossy(&shown.stdout).as_ref()), (Some(0), laid_out));
    assert_eq!(read(&loose), "a   1,b 2 # why\r\n");

    let all = sunglint(&["fmt", text(&loose), text(&bad), text(&good)]);
    assert_eq!(all.status.code(), Some(2));
    assert!(stderr(&all).contains("S01"), "{}", stderr(&all));
    assert_eq!((read(&loose).as_str(), read(&bad).as_str(), read(&good).as_str()), (laid_out, "a {", "glint 1\na 1\n"));
    assert_eq!(sunglint(&["fmt", "--check", text(&good), text(&loose)]).status.code(), Some(0));
    assert_eq!(sunglint(&["fmt", text(&folder.path().join("none.glint"))]).status.code(), Some(2));
    assert_eq!(files(folder.path()).len(), 3);

    let mut child = Command::new(env!("CARGO_BIN_EXE_sunglint"))
        .args(["fmt", "-"])
        .stdin(std::process::Stdio::piped())
        .stdout(std::process::Stdio::piped())
        .spawn()
        .expect("the program starts");
    std::io::Write::write_all(&mut child.stdin.take().expect("a stream"), b"a   1").expect("a reader");
    let piped = child.wait_with_output().expect("an end");
    assert_eq!((piped.status.code(), piped.stdout.as_slice()), (Some(0), b"glint 1\na 1\n".as_slice()));
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
    // What a time, a band and an experiment add.
    let shares = &run["shares"];
    assert_eq!(shares["camera_rays_least"], 640 * 480 * 65);
    assert_eq!(shares["tile_bytes_per_time"], 640 * 480 * 4 * (4 * 2 + 1));
    assert!(run["bands"].as_array().unwrap().iter().all(|band| band["nodes"].as_u64() > Some(0)), "{run:#}");
    assert!(shares["geometry_with"].as_array().unwrap().iter().any(|with| with == "ideal/roof"), "{shares:#}");
    assert!(run["measured"].is_null());
}

/// Measured on a few pixels, the plan tells what a render's manifest tells afterwards: here to a factor, since the pixels differ.
#[test]
fn a_plan_measures_what_the_manifest_tells() {
    const SCENE: &str = "examples/truth/truth.glint";
    let only = ["--only", "experiment=split", "--only", "scale=0.1", "--only", "time=1992-06-18T17"];
    let plan = json(&[&["plan", SCENE, "--measure", "--json"], &only[..]].concat());
    let (run, folder) = (&plan["runs"][0], tempfile::tempdir().expect("a folder"));
    let output = sunglint(&[&["render", SCENE, "-o", text(folder.path())], &only[..]].concat());
    assert!(output.status.success(), "{}", stderr(&output));
    let text = std::fs::read_to_string(folder.path().join("split/roof/manifest.json")).expect("a manifest");
    let told: Value = serde_json::from_str(&text).expect("JSON");
    let n_times = told["times"].as_array().expect("rows").len();
    assert!(n_times > 1 && told["times"].as_array().unwrap().iter().all(|row| row["light_cpu_s"].as_f64() > Some(0.0)));
    let number = |value: &Value| value.as_f64().unwrap_or_else(|| panic!("{told:#}"));
    let seen = number(&told["rays"]["camera"]) + number(&told["rays"]["camera_skipped_proved"]);
    assert_eq!(seen, number(&run["measured"]["rays"]["camera"]));
    let ratio = |before: &Value, after: f64| number(before) / after;
    let measured = &run["measured"];
    for (before, after) in [
        (&measured["rays"]["hemisphere"], number(&told["rays"]["hemisphere"])),
        (&measured["trace_cpu_s"], number(&told["seconds"]["trace_cpu_s"])),
        (&measured["light_cpu_s_per_time"], number(&told["seconds"]["light_cpu_s_per_time"])),
    ] {
        assert!((0.2..5.0).contains(&ratio(before, after)), "{before} {after}");
    }
    for key in ["atmosphere_of_all_runs_s", "write_s"] {
        assert!(number(&told["seconds"][key]) > 0.0);
    }
    let nodes = |rows: &Value| rows.as_array().unwrap().iter().map(|row| row["nodes"].clone()).collect::<Vec<_>>();
    assert_eq!(nodes(&run["bands"]), nodes(&told["channels"]));
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
    for command in ["new", "check", "plan", "render", "explain", "sun", "models", "test", "compare", "completions"] {
        let help = sunglint(&[command, "--help"]);
        assert!(String::from_utf8_lossy(&help.stdout).contains("Example"), "{command}");
    }
}

/// A panel that fills the view of a small sensor, under a sun at 30°, without air: whatever varies is the scene's doing.
const STUDY: &str = r#"glint 1
collect { sun zenith 30 deg azimuth 180 deg }
atmosphere none
define tone 0.2
define aloft (0 0 10) m
material grey { ideal { diffuse tone }, phong { diffuse tone, specular 0, exponent 5 } }
ground grey
sensor nadir {
  position aloft
  heading 0 deg
  field_of_view 10 deg
  pixels 40 x 8
  band red 600..700 nm
}
"#;

fn study(folder: &Path, experiments: &str) -> PathBuf {
    let scene = folder.join("study.glint");
    std::fs::write(&scene, format!("{STUDY}{experiments}")).expect("a scene");
    scene
}

fn radiance(folder: &Path, run: &str) -> Vec<f32> {
    let bytes = std::fs::read(folder.join(run).join("nadir/sun_30_180/radiance.img")).expect("an image");
    bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
}

fn manifest(folder: &Path, run: &str) -> Value {
    let text = std::fs::read_to_string(folder.join(run).join("nadir/manifest.json")).expect("a manifest");
    serde_json::from_str(&text).expect("JSON")
}

fn runs_below(out: &Path, experiment: &str) -> Vec<String> {
    let entries = std::fs::read_dir(out.join(experiment)).expect("a folder");
    let mut names: Vec<String> =
        entries.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

/// Two sweeps multiply to folders; an experiment's name renders all of them, a value some, a full name one.
#[test]
fn a_study_renders_a_folder_for_each_run() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = study(
        folder.path(),
        "experiment haze { samples 16, reflectance sweep [ideal, phong], define tone sweep [0.1, 0.2] }\n\
         experiment plain { samples 16 }\n",
    );
    let render = |out: &str, experiment: &[&str]| {
        let out = folder.path().join(out);
        let output = sunglint(&[&["render", text(&scene), "-o", text(&out)], experiment].concat());
        assert!(output.status.success(), "{}", stderr(&output));
        out
    };
    let all = render("all", &["--only", "experiment=haze"]);
    let names = [
        "reflectance=ideal,tone=0.1",
        "reflectance=ideal,tone=0.2",
        "reflectance=phong,tone=0.1",
        "reflectance=phong,tone=0.2",
    ];
    assert_eq!(runs_below(&all, "haze"), names);
    assert!(!all.join("plain").exists());
    let some = render("some", &["--only", "experiment=haze/tone=0.1"]);
    assert_eq!(runs_below(&some, "haze"), [names[0], names[2]]);
    let one = render("one", &["--only", "experiment=haze/reflectance=phong,tone=0.2", "--only", "experiment=plain"]);
    assert_eq!((runs_below(&one, "haze"), one.join("plain").is_dir()), (vec![names[3].to_string()], true));
    let told = manifest(&one, "haze/reflectance=phong,tone=0.2");
    assert_eq!(
        (told["sweep"]["reflectance"].as_str(), told["constants"]["tone"].as_str()),
        (Some("phong"), Some("0.2"))
    );
    let unknown = sunglint(&["render", text(&scene), "--only", "experiment=hase"]);
    assert!(unknown.status.code() == Some(2) && stderr(&unknown).contains("`haze`?"), "{}", stderr(&unknown));
    // A second render of the same study does no work.
    let again = sunglint(&["render", text(&scene), "-o", text(&all), "--only", "experiment=haze"]);
    assert_eq!(stderr(&again).matches("nothing to do").count(), 4, "{}", stderr(&again));
}

/// L = ρ E₀ cos θ / π without air, and ρ alone differs: radiances are in the ratio of the constants, to the rounding of
/// the stored f32.
#[test]
fn a_swept_constant_scales_the_radiance() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = study(folder.path(), "experiment tones { samples 16, define tone sweep [0.1, 0.2, 0.4] }\n");
    let output = sunglint(&["render", text(&scene), "-o", text(folder.path())]);
    assert!(output.status.success(), "{}", stderr(&output));
    let [dark, grey, light] = ["0.1", "0.2", "0.4"].map(|tone| radiance(folder.path(), &format!("tones/tone={tone}")));
    assert!(dark.iter().all(|value| *value > 0.0) && dark.len() == 320);
    for ((dark, grey), light) in dark.iter().zip(&grey).zip(&light) {
        assert!((grey / dark - 2.0).abs() < 1e-6 && (light / dark - 4.0).abs() < 1e-6, "{dark} {grey} {light}");
    }
}

/// A sensor has its own place in each world: the range to the ground is the swept height.
#[test]
fn a_swept_flying_height_moves_the_camera() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = study(folder.path(), "experiment fly { samples 16, define aloft sweep [(0 0 10), (0 0 250)] m }\n");
    for (run, height) in [("fly/aloft=0_0_10m", 10.0), ("fly/aloft=0_0_250m", 250.0)] {
        let pixel = json(&["explain", text(&scene), "--pixel", "20,4", "--experiment", run, "--json"]);
        let range = pixel["hit"]["range_m"].as_f64().expect("a range");
        // The pixel's middle is within 0.2° of the nadir.
        assert!((range / height - 1.0).abs() < 1e-4, "{run}: {range}");
    }
    let plan = json(&["plan", text(&scene), "--json"]);
    let runs = plan["runs"].as_array().expect("runs");
    assert_eq!(runs.len(), 2);
    assert_eq!(runs[1]["sweep"]["aloft"], "0_0_250m");
    assert_eq!(runs[1]["constants"]["aloft"], "(0 0 250) m");
}

/// The clock chooses the number of samples and nothing else: `samples` with that number gives the same bits.
#[test]
fn a_timed_render_is_replayed_by_its_samples() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = study(folder.path(), "experiment timed { algorithm split { sky_view rays }, time 200 ms }\n");
    let (timed, again) = (folder.path().join("timed"), folder.path().join("again"));
    let output = sunglint(&["render", text(&scene), "-o", text(&timed)]);
    assert!(output.status.success() && stderr(&output).contains("samples a pixel"), "{}", stderr(&output));
    let told = manifest(&timed, "timed");
    let samples = told["samples"].as_u64().expect("the samples are told");
    assert!(samples >= 16 && samples.is_multiple_of(16) && told["time_s"] == 0.2, "{told:#}");
    let output = sunglint(&["render", text(&scene), "-o", text(&again), "--samples", &samples.to_string()]);
    assert!(output.status.success(), "{}", stderr(&output));
    assert_eq!(radiance(&timed, "timed"), radiance(&again, "timed"));
    let once_more = sunglint(&["render", text(&scene), "-o", text(&timed)]);
    assert!(stderr(&once_more).contains("nothing to do"), "{}", stderr(&once_more));
}

/// `material NAME` alone is the database's: a shipped one, or that of a folder before it.
#[test]
fn materials_of_databases_render() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::create_dir(folder.path().join("mine")).expect("a folder");
    let own = "glint 1\nmaterial snow_melting { reflectance \"snow.csv\", ideal }\n";
    std::fs::write(folder.path().join("mine/snow_melting.glint"), own).expect("a material");
    std::fs::write(folder.path().join("mine/snow.csv"), "wavelength_nm,snow\n400,0.5\n1000,0.5\n").expect("a table");
    let radiance = |name: &str, database: &str| {
        let scene = folder.path().join(format!("{name}.glint"));
        let material = format!("{database}material {name}\nground {name}");
        std::fs::write(&scene, STUDY.replace("ground grey", &material)).expect("a scene");
        let pixel = json(&["explain", text(&scene), "--pixel", "20,4", "--json"]);
        (pixel["hit"]["material"].as_str() == Some(name)).then(|| pixel["bands"][0]["radiance"].as_f64()).flatten()
    };
    let (snow, grey) = (radiance("snow_melting", ""), radiance("panel_pvc_grey", ""));
    assert!(snow > grey && grey.is_some(), "{snow:?} {grey:?}");
    let own = radiance("snow_melting", "database \"mine\"\n");
    assert!(own < snow && own.is_some(), "{own:?} {snow:?}");
}

/// Every shipped material binds: its spectrum is there, its categories and lobes hold.
#[test]
fn every_shipped_material_is_a_material() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = folder.path().join("all.glint");
    let mut all = STUDY.to_string();
    for (i, (name, _)) in sunglint::reflectance::shipped_materials().enumerate() {
        all += &format!("material {name}\npanel {name} size (1 1) m at ({i} 0 0.1) m\n");
    }
    std::fs::write(
        &scene,
        all + "experiment split { reflectance split else ideal }\n\
               experiment rough { reflectance rough_conductor else ideal }\n\
               experiment crude { reflectance total_diffuse else ideal }\n",
    )
    .expect("a scene");
    let plan = json(&["plan", text(&scene), "--json"]);
    assert_eq!(plan["runs"][0]["models"]["asphalt_road_old"], "split");
    assert_eq!(plan["runs"][0]["models"]["panel_spectralon_90"], "ideal");
    assert_eq!(plan["runs"][1]["models"]["water_calm"], "rough_conductor");
    assert_eq!(plan["runs"][2]["models"]["asphalt_road_old"], "total_diffuse");
    // And the two of the scene itself, of which one is not in use.
    let n = sunglint::reflectance::shipped_materials().count() + 1;
    assert_eq!(plan["runs"][1]["models"].as_object().map(|models| models.len()), Some(n));
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
