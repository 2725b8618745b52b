//! Runs of many times, solved and rendered in parts.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use serde_json::Value;
use sunglint::inspection::air;
use sunglint::{Options, Plan, Progress, RenderError, Rendered, Run, Tally, check_text, explain, render};

/// Seven times, a night and a sun by its angles among them: experiments under the same air by two algorithms, on the same paths
/// by a sweep of visibilities, at some of the times, and under air that takes time to solve.
const SCENE: &str = "glint 1\nsite { latitude 43 deg, longitude -77 deg, elevation 100 m }\n\
    collect daytime { on 1992-06-18 from 12:00 to 20:00 every 2 h, zone +00:00 }\ncollect night { at 1992-06-18 05:00 Z }\n\
    collect lamp { sun zenith 40 deg azimuth 180 deg }\natmosphere spectrl2\n\
    material grey { ideal { diffuse 0.5 }, phong { diffuse 0.4, specular 0.1, exponent 40 } }\n\
    ground grey\nbox grey size (1 1 1) m\n\
    sensor nadir { position (0 -6 9) m, look_at (0 0 0) m, field_of_view 20 deg, pixels 40 x 30\n\
    band green 500..600 nm, band red 600..700 nm }\n\
    experiment base { samples 32, products [radiance, truth, preview, surface_radiance, reflectance_factor] }\n\
    experiment exact { algorithm full { depth 3 }, samples 16 }\n\
    experiment haze { weather { visibility sweep [5, 23] km }, samples 32 }\n\
    experiment some { collect daytime, samples 16, reflectance phong }\n\
    experiment solved { atmosphere layered, collect daytime, samples 16 }\n";

fn plan(text: &str, light_at_once: Option<usize>) -> Plan {
    let checked = check_text("scene.glint", text).sound().unwrap_or_else(|refused| panic!("{refused}"));
    let options = Options { light_at_once, ..Options::default() };
    Plan::new(checked, &options).unwrap_or_else(|refused| panic!("{refused}"))
}

/// Stops when so many groups of runs have begun.
struct Stop {
    after: usize,
    begun: AtomicUsize,
}

impl Stop {
    fn after(after: usize) -> Self {
        Self { after, begun: AtomicUsize::new(0) }
    }
}

impl Progress for Stop {
    fn begin(&self, _: &[&Run], _: usize) {
        self.begun.fetch_add(1, Ordering::Relaxed);
    }
    fn tile(&self, _: bool, _: &Tally) {}
    fn end(&self, _: &Run, _: &Rendered) {}
    fn stopped(&self) -> bool {
        self.begun.load(Ordering::Relaxed) > self.after
    }
}

fn files(folder: &Path, found: &mut BTreeMap<PathBuf, Vec<u8>>, root: &Path) {
    for entry in std::fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            files(&path, found, root);
        } else {
            let name = path.strip_prefix(root).expect("beneath it").to_path_buf();
            found.insert(name, std::fs::read(&path).expect("a file"));
        }
    }
}

/// Images as bytes, and manifests without what parts and the clock change.
fn written(out: &Path) -> (BTreeMap<PathBuf, Vec<u8>>, Vec<Value>) {
    let mut images = BTreeMap::new();
    files(out, &mut images, out);
    let mut manifests = Vec::new();
    images.retain(|path, bytes| {
        let is_image = path.file_name().is_none_or(|name| name != "manifest.json");
        if !is_image {
            let mut manifest: Value = serde_json::from_slice(bytes).expect("JSON");
            let told = manifest.as_object_mut().expect("an object");
            // Who traces paths first, and how often, depends on what stands together.
            let by_parts = ["parts", "paths_traced_with", "rays", "tiles_rendered", "tiles_resumed"];
            for key in by_parts.into_iter().chain(["rays_per_s", "render_s", "seconds", "write_s"]) {
                assert!(told.remove(key).is_some(), "{key}");
            }
            // Tiles are added up as they are finished.
            for error in told["relative_standard_error"].as_object_mut().expect("errors").values_mut() {
                *error = format!("{:.9e}", error.as_f64().expect("a number")).into();
            }
            for time in told["times"].as_array_mut().expect("times") {
                assert!(time.as_object_mut().and_then(|time| time.remove("light_cpu_s")).is_some());
            }
            manifests.push(manifest);
        }
        is_image
    });
    (images, manifests)
}

/// Under `samples` no bit of an image depends on what is solved together, and manifests tell the same; nor where a render was stopped
/// between parts.
#[test]
fn images_in_parts_are_those_of_the_whole() {
    let folder = tempfile::tempdir().expect("a folder");
    let whole = plan(SCENE, None);
    assert_eq!(whole.parts().len(), 1);
    assert!(render(&whole, &folder.path().join("whole"), &Stop::after(usize::MAX)).is_ok());
    let expected = written(&folder.path().join("whole"));
    assert!(expected.0.len() > 100 && expected.1.len() == whole.runs().len());
    for (name, limit) in [("one", 0), ("some", 3_000_000)] {
        let plan = plan(SCENE, Some(limit));
        let n_times: usize = plan.runs().iter().map(|run| run.moments.len()).sum();
        let n = plan.parts().len();
        assert!(if limit == 0 { n == n_times } else { (3..n_times).contains(&n) }, "{n} parts");
        assert_eq!(plan.sharing(&plan.runs()[0]).air_with, whole.sharing(&whole.runs()[0]).air_with);
        let out = folder.path().join(name);
        let stopped = render(&plan, &out, &Stop::after(n / 2));
        assert!(matches!(stopped, Err(RenderError::Stopped)));
        let rendered = render(&plan, &out, &Stop::after(usize::MAX)).unwrap_or_else(|error| panic!("{error}"));
        let resumed: usize = rendered.iter().map(|rendered| rendered.tiles_resumed).sum();
        let fresh: usize = rendered.iter().map(|rendered| rendered.tiles_rendered).sum();
        assert!(resumed > 0 && fresh > 0, "{name}: {resumed} tiles from before, {fresh} of now");
        assert!(!out.join(".sunglint").exists());
        let (images, manifests) = written(&out);
        assert_eq!(images.keys().collect::<Vec<_>>(), expected.0.keys().collect::<Vec<_>>());
        for (path, bytes) in &images {
            assert!(*bytes == expected.0[path], "{name}: {}", path.display());
        }
        for (manifest, expected) in manifests.iter().zip(&expected.1) {
            assert_eq!(manifest, expected, "{name}");
        }
    }
}

/// Arrays, forecasts, explanations and the air of one time come of runs whose light is not kept too.
#[test]
fn runs_whose_light_is_not_kept_answer_all_the_same() {
    let (whole, dark) = (plan(SCENE, None), plan(SCENE, Some(3_000_000)));
    for (kept, dark) in whole.runs().iter().zip(dark.runs()) {
        let (a, b) = (kept.render(), dark.render());
        assert!(a.frames == b.frames || a.digest() == b.digest() && kept.products.reflectance_factor);
        assert_eq!((a.samples, a.truth[0].clone()), (b.samples, b.truth[0].clone()));
        assert_eq!(kept.air_notes, dark.air_notes);
        assert_eq!(kept.columns_solved, dark.columns_solved);
        let t = kept.moments.len() - 1;
        assert_eq!(kept.light(t).beam, dark.light(t).beam);
        let explained = |run| explain(run, (20, 15), t, &whole.materials).to_json();
        assert_eq!(explained(kept), explained(dark));
        // Paths are traced anew for each part.
        let parts = dark.parts().count() as f64;
        assert_eq!(dark.forecast().camera, parts * kept.forecast().camera);
    }
}

/// Under `error` each part takes the samples that its own worst time asks for, `explain` those of its part, and the map of samples is
/// the mean over the times. Under `time` one number is chosen for all.
#[test]
fn parts_choose_samples_for_an_error_and_share_those_of_a_time() {
    let text = SCENE.replace("experiment base { samples 32", "experiment base { collect daytime, error 3 %");
    let text = text.replace(
        "experiment exact { algorithm full { depth 3 }, samples 16 }",
        "experiment exact { collect daytime, time 1 s }",
    );
    let (whole, parts) = (plan(&text, None), plan(&text, Some(0)));
    let (a, b) = (whole.runs()[0].render(), parts.runs()[0].render());
    let mean = |samples: &[f32]| samples.iter().sum::<f32>() / samples.len() as f32;
    assert!(
        mean(&b.samples) > 16.0 && mean(&b.samples) <= mean(&a.samples),
        "{} {}",
        mean(&a.samples),
        mean(&b.samples)
    );
    let folder = tempfile::tempdir().expect("a folder");
    let rendered = render(&parts, folder.path(), &Stop::after(usize::MAX)).unwrap_or_else(|error| panic!("{error}"));
    let timed = rendered[1].timed_samples.expect("a number of samples");
    assert_eq!(rendered[1].tally.samples_per_pixel(), f64::from(timed));
    assert!((rendered[0].tally.samples_per_pixel() / f64::from(mean(&b.samples)) - 1.0).abs() < 1e-4);
}

/// The air of several sensors is read along the lines of sight of all of them, also of those that stand far above the one whose band is
/// asked: L_u over 9 km is alike in two bands of which one is a nanometre wider, whether light is kept or not.
#[test]
fn the_air_of_one_sensor_reaches_as_high_as_the_others() {
    let text = "glint 1\ncollect { sun zenith 40 deg azimuth 180 deg }\natmosphere layered\n\
        material grey { ideal { diffuse 0.5 } }\nground grey\n\
        sensor low { position (0 0 9) m, look_at (0 1 0) m, field_of_view 20 deg, pixels 8 x 8, band red 600..620 nm }\n\
        sensor high { position (0 0 9000) m, look_at (0 1 0) m, field_of_view 1 deg, pixels 8 x 8, band red 600..621 nm }\n";
    for light_at_once in [None, Some(0)] {
        let checked = check_text("scene.glint", text).sound().unwrap_or_else(|refused| panic!("{refused}"));
        let options = Options { whole_sky: true, light_at_once, ..Options::default() };
        let plan = Plan::new(checked, &options).unwrap_or_else(|refused| panic!("{refused}"));
        let runs: Vec<&Run> = plan.runs().iter().collect();
        let air = air(&runs, &runs[0].moments[0].label, &[]).expect("the air of a time");
        let upwelled: Vec<f64> = air.bands.iter().map(|band| band.path[1].1).collect();
        assert!((upwelled[0] / upwelled[1] - 1.0).abs() < 0.01, "{light_at_once:?}: {upwelled:?}");
    }
}
