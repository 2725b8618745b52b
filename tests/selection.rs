//! Part of a scene, rendered alone.

mod program;

use std::path::Path;

use program::{stderr, sunglint};
use sunglint::{Frames, Options, Plan};

const TRUTH: &str = "examples/truth/truth.glint";

fn plan(scene: &str, only: &[&str], pixels: (u32, u32), samples: Option<u32>) -> Plan {
    let mut options = Options { pixels: Some(pixels), samples, ..Options::default() };
    only.iter().for_each(|text| options.narrow(text).unwrap_or_else(|message| panic!("{message}")));
    let checked = sunglint::open(scene).unwrap_or_else(|refused| panic!("{refused}"));
    Plan::new(checked, &options).unwrap_or_else(|refused| panic!("{refused}"))
}

fn bits(image: &[f32]) -> Vec<u32> {
    image.iter().map(|value| value.to_bits()).collect()
}

fn cut(image: &[f32], width: usize, (x, y, w, h): (usize, usize, usize, usize)) -> Vec<f32> {
    (y..y + h).flat_map(|row| image[row * width + x..row * width + x + w].iter().copied()).collect()
}

fn images(frames: &Frames) -> Vec<&Vec<f32>> {
    let of_frames = frames.frames.iter().flat_map(|f| f.radiance.iter().chain(&f.error).chain([&f.lit]));
    of_frames.chain(&frames.truth).chain([&frames.samples]).collect()
}

/// A sample depends on (seed, view, pixel, replicate, index), and what pixels share they share within blocks that a crop
/// keeps whole: radiance, error, truth and sample counts of a crop are those of the whole view, also where a pilot chooses
/// the counts. Crops that touch no, one and several borders of tiles and of the view.
#[test]
fn a_crop_is_the_whole_view_to_the_bit() {
    for (only, samples) in [("experiment=split", Some(16)), ("experiment=phong", Some(32))] {
        let only = [only, "time=1992-06-18T170100Z"];
        let whole = plan(TRUTH, &only, (70, 52), samples).runs()[0].render();
        for crop in [(33, 17, 5, 4), (0, 0, 70, 52), (7, 9, 40, 30), (61, 43, 9, 9), (69, 51, 1, 1)] {
            let (x, y, w, h) = crop;
            let text = format!("crop={x},{y},{w}x{h}");
            let plan = plan(TRUTH, &[&only[..], &[&text]].concat(), (70, 52), samples);
            let part = plan.runs()[0].render();
            assert_eq!((part.width as usize, part.height as usize), (w, h));
            for (whole, part) in images(&whole).into_iter().zip(images(&part)) {
                assert_eq!(bits(&cut(whole, 70, crop)), bits(part), "{text}");
            }
        }
    }
}

/// Under `error` a pilot of a block chooses the samples of its pixels: a crop keeps blocks whole.
#[test]
fn a_crop_keeps_the_samples_that_a_pilot_chose() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = folder.path().join("error.glint");
    let text = std::fs::read_to_string("examples/minimal/minimal.glint").expect("the example");
    std::fs::write(&scene, text.replace("samples 16", "error 2 %")).expect("a scene");
    let scene = scene.to_str().expect("UTF-8");
    let whole = plan(scene, &[], (50, 41), None).runs()[0].render();
    assert!(whole.samples.iter().any(|n| *n > 16.0), "the pilot asks for more somewhere");
    let part = plan(scene, &["crop=11,13,30x20"], (50, 41), None).runs()[0].render();
    for (whole, part) in images(&whole).into_iter().zip(images(&part)) {
        assert_eq!(bits(&cut(whole, 50, (11, 13, 30, 20))), bits(part));
    }
}

/// Points between which sky and background are interpolated are the same whichever pixel asks first, under a count and under an
/// error.
#[test]
fn a_crop_takes_the_points_of_the_whole_view() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = folder.path().join("cached.glint");
    let truth = std::fs::canonicalize(TRUTH).expect("the example");
    for accuracy in ["samples 16", "error 6 %"] {
        let text = format!(
            "glint 1\ninclude {truth:?}\nexperiment cached {{ algorithm full {{ indirect cached }}, {accuracy} }}\n"
        );
        std::fs::write(&scene, text).expect("a scene");
        let scene = scene.to_str().expect("UTF-8");
        let only = ["experiment=cached", "time=1992-06-18T170100Z", "band=red"];
        let plan = |only: &[&str]| plan(scene, only, (70, 52), None);
        let whole = plan(&only).runs()[0].render();
        let part = plan(&[&only[..], &["crop=33,17,21x14"]].concat()).runs()[0].render();
        for (whole, part) in images(&whole).into_iter().zip(images(&part)) {
            assert!(bits(&cut(whole, 70, (33, 17, 21, 14))) == bits(part), "{accuracy}");
        }
    }
}

/// Bands overlap (blue and green, red and nir): a band that is rendered alone keeps its bins, and a time its samples.
#[test]
fn a_band_or_a_time_alone_is_what_it_is_among_the_others() {
    let whole = plan(TRUTH, &["experiment=phong", "time=1992-06-18T17"], (24, 18), Some(16)).runs()[0].render();
    assert!(whole.frames.len() == 2 && whole.channels.len() == 4);
    for (b, band) in ["blue", "green", "red", "nir"].iter().enumerate() {
        let only = ["experiment=phong", "time=1992-06-18T17:31:00Z", &format!("band={band}")];
        let alone = plan(TRUTH, &only, (24, 18), Some(16)).runs()[0].render();
        assert_eq!((alone.frames.len(), alone.channels.len()), (1, 1));
        assert_eq!(bits(&alone.frames[0].radiance[0]), bits(&whole.frames[1].radiance[b]), "{band}");
    }
}

/// Lobes are drawn by what they return in all bands, so that `full` too gives a band alone what it is among the others, to
/// the bit, and a time.
#[test]
fn a_band_of_the_exact_integral_is_the_same_alone() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = folder.path().join("full.glint");
    let truth = std::fs::canonicalize(TRUTH).expect("the example");
    let text = format!(
        "glint 1\ninclude \"{}\"\nexperiment exact {{ algorithm full, reflectance phong else split else ideal }}\n\
         experiment means like exact {{ algorithm full {{ spectral band }} }}\n",
        truth.display()
    );
    std::fs::write(&scene, text).expect("a scene");
    let scene = scene.to_str().expect("UTF-8");
    for experiment in ["exact", "means"] {
        let experiment = format!("experiment={experiment}");
        let whole = plan(scene, &[&experiment, "time=1992-06-18T17"], (24, 18), Some(16)).runs()[0].render();
        for (b, band) in [(0, "blue"), (3, "nir")] {
            let only = [&experiment, "time=1992-06-18T17:31:00Z", &format!("band={band}")];
            let alone = plan(scene, &only, (24, 18), Some(16)).runs()[0].render();
            let same = bits(&alone.frames[0].radiance[0]) == bits(&whole.frames[1].radiance[b]);
            assert!(same, "{experiment}, {band}");
        }
    }
}

#[test]
fn what_a_selection_does_not_find_is_told_with_the_nearest() {
    for (only, told) in [
        ("experiment=splitt", "`split`?"),
        ("sensor=rof", "`roof`?"),
        ("band=rde", "`red`?"),
        ("time=1992-06-18T170200Z", "1992-06-18T170100Z`?"),
        ("crop=600,0,64x48", "beyond sensor `roof`"),
        ("bnad=red", "`band`?"),
        ("scale=2x", "scale=0.25"),
    ] {
        let output = sunglint(&["plan", TRUTH, "--only", only]);
        assert_eq!(output.status.code(), Some(2), "{only}");
        assert!(stderr(&output).contains(told), "{only}: {}", stderr(&output));
    }
    let both = sunglint(&["plan", TRUTH, "--only", "scale=0.5", "--pixels", "8x8"]);
    assert_eq!(both.status.code(), Some(2));
    let output = sunglint(&["plan", TRUTH, "--only", "scale=0.25", "--only", "crop=10,10,20x5", "--json"]);
    let plan: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(plan["runs"][0]["pixels"], serde_json::json!([20, 5]));
}

/// A folder holds one render: neither a crop nor fewer bands or times are written over more; what holds no more is replaced.
#[test]
fn a_selection_is_not_mixed_into_a_fuller_render() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().to_str().expect("UTF-8");
    let render = |more: &[&str]| {
        let all = ["render", TRUTH, "-o", out, "--pixels", "16x12", "--samples", "16", "--only", "experiment=ideal"];
        sunglint(&[&all[..], more].concat())
    };
    let times = ["--only", "time=1992-06-18T170100Z", "--only", "time=1992-06-18T173100Z"];
    assert!(render(&times).status.success());
    let radiance = folder.path().join("ideal/roof/1992-06-18T170100Z/radiance.img");
    let before = std::fs::read(&radiance).expect("an image");
    for (more, held) in [
        (&["--only", "time=1992-06-18T170100Z"][..], "time 1992-06-18T173100Z"),
        (&[&times[..], &["--only", "band=red"]].concat(), "3 more bands"),
        (&[&times[..], &["--only", "crop=2,2,4x4"]].concat(), "whole view"),
    ] {
        let refused = render(more);
        assert_eq!(refused.status.code(), Some(2), "{more:?}");
        assert!(stderr(&refused).contains(held), "{}", stderr(&refused));
        assert!(std::fs::read(&radiance).expect("an image") == before);
    }
    assert!(render(&times).status.success() && std::fs::read(&radiance).expect("an image") == before);
    assert!(Path::new(out).join("ideal/roof/manifest.json").is_file());
}

/// Experiments that differ in nothing but light are lit on paths that one of them traced: each is what it is alone, to the bit,
/// also where the other's frames are there already, and the plan and the manifests say so.
#[test]
fn experiments_on_the_same_paths_are_what_they_are_alone() {
    const SCENE: &str = "glint 1\nsite { latitude 43 deg, longitude -77 deg, elevation 100 m }\n\
        collect { at 1992-06-18 16:00 Z }\ncollect { at 1992-06-18 18:00 Z }\natmosphere spectrl2\n\
        material grey { ideal { diffuse 0.5 } }\nmaterial glass { ideal { specular 0.8 } }\n\
        material gloss { phong { diffuse 0.2, specular 0.2, exponent 40 } }\n\
        ground grey\nbox gloss size (1 1 1) m\nfacet glass (-2 0.8 0) (2 0.8 0) (2 0.8 1) (-2 0.8 1) m\n\
        sensor nadir { position (0 -6 9) m, look_at (0 0 0) m, field_of_view 20 deg, pixels 40 x 30\n\
        band green 500..600 nm, band red 600..700 nm }\n\
        experiment base { algorithm full { depth 3 }, samples 32 }\n\
        experiment haze { algorithm full { depth 3, limb_darkening on }, weather { visibility 5 km }, samples 32\n\
        products [radiance, truth, surface_radiance] }\n\
        experiment clear { algorithm full { depth 3, adjacency off }, weather { visibility 60 km }, samples 32 }\n\
        experiment deep { algorithm full, samples 32 }\n\
        experiment fine { algorithm full { depth 3 }, samples 48 }\n\
        experiment even { algorithm full { depth 3 }, error 5 % }\n";
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name).to_str().expect("UTF-8").to_string();
    std::fs::write(at("s.glint"), SCENE).expect("a scene");
    let render = |out: &str, only: &[&str]| {
        let only: Vec<String> = only.iter().flat_map(|name| ["--only".into(), format!("experiment={name}")]).collect();
        let (scene, out) = (at("s.glint"), at(out));
        let args = ["render", &scene, "-o", &out];
        let output = sunglint(&args.into_iter().chain(only.iter().map(String::as_str)).collect::<Vec<_>>());
        assert!(output.status.success(), "{}", stderr(&output));
    };
    render("together", &[]);
    let names = ["base", "haze", "clear", "deep", "fine", "even"];
    names.iter().for_each(|name| render("alone", &[name]));
    // After one of them the others are traced by themselves.
    render("later", &["base"]);
    render("later", &[]);
    let manifest = |out: &str, name: &str| -> serde_json::Value {
        let text = std::fs::read_to_string(format!("{}/{name}/nadir/manifest.json", at(out))).expect("a manifest");
        serde_json::from_str(&text).expect("JSON")
    };
    for name in names {
        for time in ["1992-06-18T160000Z", "1992-06-18T180000Z"] {
            for file in ["radiance.img", "error.exr", "lit.exr", "../truth.exr"] {
                let read =
                    |out: &str| std::fs::read(format!("{}/{name}/nadir/{time}/{file}", at(out))).expect("a file");
                assert!(read("together") == read("alone"), "{name} {time} {file}");
                assert!(read("later") == read("alone"), "{name} {time} {file}, later");
            }
        }
    }
    let traced_with =
        |out: &str| names.map(|name| manifest(out, name)["paths_traced_with"].as_str().map(str::to_string));
    let other = |name: &str| Some(format!("{name}/nadir"));
    assert_eq!(traced_with("together"), [None, other("base"), other("base"), None, None, None]);
    assert_eq!(traced_with("later"), [None, None, other("haze"), None, None, None]);
    assert_eq!(traced_with("alone"), [const { None }; 6]);
    let rays = |name: &str, kind: &str| manifest("together", name)["rays"][kind].as_u64().expect("a number");
    assert!(rays("base", "hemisphere") > 0 && rays("base", "sun") > 0);
    assert_eq!((rays("haze", "hemisphere"), rays("haze", "camera"), rays("haze", "sun")), (0, 0, 0));
}
