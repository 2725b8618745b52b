//! Run time against error: references that are kept, errors that are judged, approximations that are changed one by one.

mod program;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use program::stderr;
use serde_json::Value;
use tempfile::TempDir;

/// A grey panel on an endless floor, in two bands, small enough to be rendered in a moment.
const SCENE: &str = "glint 1
site { latitude 43.084 deg, longitude -77.674 deg, elevation 168 m }
collect { at 1992-06-18 12:00 -04:00 }
atmosphere spectrl2
material blacktop code 3 { ideal { diffuse 0.08 }, phong { diffuse 0.05, specular 0.02, exponent 20 } }
material grey code 5 { ideal { diffuse 0.5 } }
ground blacktop
panel grey size (3 2.4) m at (0 2 1.3) m facing south
sensor roof {
  position (0 -25 15) m
  look_at (0 2 0) m
  field_of_view 12 deg
  pixels 16 x 12
  band green 520..600 nm
  band red 600..700 nm
}
experiment published { algorithm split }
experiment lifted { algorithm split { sky directional, background average, depth unlimited }, seed 7 }
experiment glossy like published { reflectance phong else ideal }
";

struct Study {
    folder: TempDir,
}

impl Study {
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        std::fs::write(folder.path().join("panel.glint"), SCENE).expect("a writable folder");
        Self { folder }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn bench(&self, more: &[&str]) -> Output {
        Command::new(env!("CARGO_BIN_EXE_sunglint"))
            .args(["bench", "panel.glint"])
            .args(more)
            .current_dir(self.folder.path())
            .output()
            .expect("the program starts")
    }

    fn json(&self, more: &[&str]) -> Value {
        let output = self.bench(&[more, &["--json"]].concat());
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
        serde_json::from_slice(&output.stdout).expect("JSON")
    }

    /// The image files of kept references.
    fn kept(&self) -> Vec<PathBuf> {
        let entries = std::fs::read_dir(self.path("panel.reference")).into_iter().flatten();
        entries.filter_map(|entry| Some(entry.ok()?.path())).collect()
    }
}

const QUICK: [&str; 5] = ["--samples", "16", "--reference-samples", "512", "--no-single"];

/// Two experiments with the same models share a reference, whatever their algorithms and seeds; another model has its own. A
/// second bench renders none of them, a better one adds to what is there.
#[test]
fn references_are_shared_kept_and_improved() {
    let study = Study::new();
    let first = study.json(&QUICK);
    let references = first["references"].as_array().expect("rows");
    assert_eq!(references.len(), 2, "{references:#?}");
    assert!(references.iter().all(|row| row["samples"] == 512 && row["samples_rendered"] == 512));
    assert_eq!(study.kept().len(), 2);
    let of = |name: &str| first["settings"].as_array().unwrap().iter().find(|row| row["experiment"] == name).unwrap();
    assert_eq!(of("published")["reference"], of("lifted")["reference"]);
    assert_ne!(of("published")["reference"], of("glossy")["reference"]);

    let again = study.json(&QUICK);
    assert!(again["references"].as_array().unwrap().iter().all(|row| row["samples_rendered"] == 0));
    // The same reference and the same seed: the same errors to the bit.
    assert_eq!(first["settings"][0]["errors"], again["settings"][0]["errors"]);

    let better = study.json(&["--samples", "16", "--reference-samples", "1024", "--no-single"]);
    for (row, before) in better["references"].as_array().unwrap().iter().zip(references) {
        assert_eq!((row["samples"].clone(), row["samples_rendered"].clone()), (1024.into(), 512.into()));
        assert!(row["relative_error"].as_f64() < before["relative_error"].as_f64());
    }
    assert_eq!(study.kept().len(), 2, "the better one stands in the place of the other");
}

/// What an experiment says of accuracy, seed or algorithm is no part of a reference; what stands in the scene is.
#[test]
fn a_reference_goes_with_what_it_depends_on() {
    let study = Study::new();
    let only = [&QUICK[..], &["--only", "experiment=published"]].concat();
    let rendered = |study: &Study| study.json(&only)["references"][0]["samples_rendered"].clone();
    assert_eq!(rendered(&study), 512);
    let text = SCENE.replace("{ algorithm split }", "{ algorithm ideal, samples 64, seed 3 }");
    std::fs::write(study.path("panel.glint"), text).unwrap();
    assert_eq!(rendered(&study), 0);
    std::fs::write(study.path("panel.glint"), SCENE.replace("diffuse 0.5 }", "diffuse 0.51 }")).unwrap();
    assert_eq!(rendered(&study), 512);
    // Other pixels, another reference.
    let row = study.json(&[&only[..], &["--only", "crop=2,2,8x8"]].concat());
    assert_eq!(row["references"][0]["samples_rendered"], 512);
    // A file that is torn is none.
    for path in study.kept() {
        std::fs::write(path, b"torn").unwrap();
    }
    assert_eq!(rendered(&study), 512);
}

/// The files and the keys that other programs rely on.
#[test]
fn table_and_plots_are_written_whole() {
    let study = Study::new();
    let more = ["--samples", "16,32", "--reference-samples", "512", "--only", "experiment=published", "-o", "out"];
    let output = study.bench(&more);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    for wanted in
        ["sensor roof", "RMSE %", "by material", "one approximation changed, at 32 samples", "depth 2 -> unlimited"]
    {
        assert!(text.contains(wanted), "{wanted}: {text}");
    }
    let file = |name: &str| std::fs::read(study.path("out").join(name)).expect(name);
    assert!(file("bench.svg").starts_with(b"<svg") || file("bench.svg").starts_with(b"<?xml"));
    assert!(file("bench.png").starts_with(b"\x89PNG"));
    let value: Value = serde_json::from_slice(&file("bench.json")).expect("JSON");
    let setting = &value["settings"][0];
    assert_eq!((setting["experiment"].as_str(), setting["samples"].as_u64()), (Some("published"), Some(16)));
    assert!(setting["cpu_s"].as_f64().unwrap() > 0.0 && setting["rays"].as_u64().unwrap() > 16 * 192);
    assert!(setting["on_front"].is_boolean());
    for key in [
        "pixels",
        "judged",
        "relative_rmse",
        "relative_systematic_rmse",
        "relative_systematic_rmse_below",
        "relative_noise",
        "relative_reference_error",
        "relative_bias",
        "relative_bias_error",
        "relative_percentile_99",
        "worst",
    ] {
        assert!(setting["errors"].get(key).is_some(), "{key}");
    }
    // All frames and the one frame; both bands, each and all; both materials, each and all; without the whole itself.
    assert_eq!(setting["parts"].as_array().unwrap().len(), 2 * 3 * 3 - 1);
    let panel = setting["parts"].as_array().unwrap().iter().find(|part| part["material"] == "grey").unwrap();
    assert_eq!(panel["material_code"], 5);
    let changes = value["changes"].as_array().unwrap();
    let sky = changes.iter().find(|row| row["parameter"] == "sky").expect("the sky is lifted");
    assert_eq!(
        (sky["from"].as_str(), sky["to"].as_str(), sky["samples"].as_u64()),
        (Some("isotropic"), Some("directional"), Some(32))
    );
    let rows = String::from_utf8(file("bench.csv")).unwrap();
    let lines: Vec<&str> = rows.lines().collect();
    assert_eq!(lines.len(), 1 + (2 + changes.len()) * 18);
    assert!(lines.iter().all(|line| line.split(',').count() == lines[0].split(',').count()), "{rows}");
}

/// Under the published sky the panel, which faces the sun, is several per cent too dark; with the sky's directions it is not.
#[test]
fn what_an_approximation_costs_shows() {
    let study = Study::new();
    let value = study.json(&["--samples", "64", "--reference-samples", "4096", "--only", "experiment=published"]);
    let of = |row: &Value| {
        let parts = row["parts"].as_array().unwrap();
        let panel =
            parts.iter().find(|part| part["material"] == "grey" && part["frame"].is_null() && part["band"].is_null());
        panel.unwrap()["errors"].clone()
    };
    let published = of(&value["settings"][0]);
    let lifted = of(value["changes"].as_array().unwrap().iter().find(|row| row["parameter"] == "sky").unwrap());
    let bias = |errors: &Value| errors["relative_bias"].as_f64().unwrap();
    let doubt = |errors: &Value| errors["relative_bias_error"].as_f64().unwrap();
    assert!(bias(&published).abs() > 6.0 * doubt(&published), "{published:#}");
    assert!(bias(&lifted).abs() < 0.5 * bias(&published).abs(), "{published:#} {lifted:#}");
}

/// An image of the reference's own algorithm errs by its noise alone; with seeds of their own the two are independent.
#[test]
fn the_exact_algorithm_has_no_systematic_error() {
    let study = Study::new();
    let exact = "experiment exact { algorithm full }\n";
    std::fs::write(study.path("panel.glint"), format!("{SCENE}{exact}")).unwrap();
    let value =
        study.json(&["--samples", "16", "--reference-samples", "4096", "--no-single", "--only", "experiment=exact"]);
    let errors = &value["settings"][0]["errors"];
    assert_eq!(errors["relative_systematic_rmse"], Value::Null, "{errors:#}");
    let (rmse, noise) = (errors["relative_rmse"].as_f64().unwrap(), errors["relative_noise"].as_f64().unwrap());
    assert!((rmse / noise - 1.0).abs() < 0.3, "{errors:#}");
    assert!(errors["relative_bias"].as_f64().unwrap().abs() < 4.0 * errors["relative_bias_error"].as_f64().unwrap());
}

/// One experiment's reference judges another: the glossy floor against the diffuse one.
#[test]
fn one_reference_may_judge_all() {
    let study = Study::new();
    let value = study.json(&[&QUICK[..], &["--reference", "published"]].concat());
    assert_eq!(value["references"].as_array().unwrap().len(), 1);
    let rmse = |name: &str| {
        let rows = value["settings"].as_array().unwrap();
        rows.iter().find(|row| row["experiment"] == name).unwrap()["errors"]["relative_rmse"].as_f64().unwrap()
    };
    assert!(rmse("glossy") > 2.0 * rmse("published"));
}

/// A reference that is no better than the image judges nothing: the table says so, a note what is due, and the code is 0.
#[test]
fn a_poor_reference_judges_nothing() {
    let study = Study::new();
    let output =
        study.bench(&["--samples", "256", "--reference-samples", "16", "--no-single", "--only", "experiment=lifted"]);
    assert_eq!(output.status.code(), Some(0));
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(text.contains("not judged: reference ±"), "{text}");
    assert!(stderr(&output).contains("more samples a pixel: --reference-samples "), "{}", stderr(&output));
    let quiet = study.bench(&[
        "-q",
        "--samples",
        "256",
        "--reference-samples",
        "16",
        "--no-single",
        "--only",
        "experiment=lifted",
    ]);
    assert!(quiet.stderr.is_empty());
}

#[test]
fn what_is_asked_wrongly_is_refused() {
    let study = Study::new();
    for (more, wanted) in [
        (&["--reference", "publisched"][..], "there is no experiment `publisched`; `published`?"),
        (&["--reference-error", "0%"], "no image of samples has an error of 0"),
        (&["--reference-error", "0.1"], "write a number of per cent"),
        (&["--samples", "0"], "0 is not in 1..=65536"),
        (&["--samples", "16,x"], "invalid value 'x'"),
        (&["--no-single", "--single", "16"], "cannot be used with"),
        (&["--only", "experiment=publisched"], "no experiment of the scene is called `publisched`"),
        (&["--only", "sensors=roof"], "`sensor`?"),
        (&["--only", "band=blue"], "is called `blue`"),
    ] {
        let output = study.bench(more);
        assert_eq!(output.status.code(), Some(2), "{more:?} {}", stderr(&output));
        assert!(stderr(&output).contains(wanted), "{more:?} {}", stderr(&output));
    }
    assert!(study.kept().is_empty(), "nothing is rendered for what is refused");
    std::fs::write(study.path("file"), "no folder").unwrap();
    let output = study.bench(&[&QUICK[..], &["--references", "file/below"]].concat());
    assert_eq!(output.status.code(), Some(3), "{}", stderr(&output));
    assert!(stderr(&output).contains("keeping the reference"), "{}", stderr(&output));
    assert!(!Path::new("file/below").exists());
}

/// The sensor of one experiment only cannot be judged by another's reference.
#[test]
fn a_reference_must_see_what_it_judges() {
    let study = Study::new();
    let other = SCENE.replace(
        "experiment published",
        "sensor mast like roof { position (0 -20 12) m }\nexperiment published { sensor roof }\nexperiment aloft { sensor mast }\nexperiment other",
    );
    std::fs::write(study.path("panel.glint"), other).unwrap();
    let output = study.bench(&[&QUICK[..], &["--reference", "published", "--only", "experiment=aloft"]].concat());
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
    assert!(stderr(&output).contains("`published` cannot judge `aloft` with sensor `mast`"), "{}", stderr(&output));
}
