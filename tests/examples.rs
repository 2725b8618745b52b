//! The examples, each rendered small; digests guard against change, the physics is proved in `analytic.rs`.

use sunglint::{Options, Plan};

fn plan(scene: &str, options: &Options) -> Plan {
    let checked = sunglint::open(scene).unwrap_or_else(|refused| panic!("{refused}"));
    let plan = Plan::new(checked, options).unwrap_or_else(|refused| panic!("{refused}"));
    assert!(plan.warnings.is_empty(), "{scene} has warnings");
    plan
}

#[test]
fn minimal() {
    let options = Options { pixels: Some((32, 24)), samples: Some(16), ..Options::default() };
    let plan = plan("examples/minimal/minimal.glint", &options);
    insta::assert_snapshot!(plan.runs()[0].render().digest());
}

/// White under a uniform sky of 100: every pixel returns 100, whatever the geometry.
#[test]
fn furnace() {
    let options = Options { pixels: Some((64, 48)), ..Options::default() };
    let frames = plan("examples/furnace/furnace.glint", &options).runs()[0].render();
    for value in &frames.frames[0].radiance[0] {
        assert!((value - 100.0).abs() < 1e-4, "{value}");
    }
}

#[test]
fn truth() {
    let times = ["1992-06-18T103100Z", "1992-06-18T170100Z"].map(String::from).to_vec();
    let options = Options { pixels: Some((64, 48)), samples: Some(32), times, ..Options::default() };
    let plan = plan("examples/truth/truth.glint", &options);
    for run in plan.runs() {
        insta::assert_snapshot!(format!("truth_{}", run.experiment), run.render().digest());
    }
}

/// Both sensors and both experiments; a quarter of a million facets are placed, none is written twice.
#[test]
fn suburb() {
    let options = Options { pixels: Some((48, 32)), samples: Some(16), ..Options::default() };
    let plan = plan("examples/suburb/suburb.glint", &options);
    assert_eq!(plan.runs().len(), 4);
    for run in plan.runs() {
        insta::assert_snapshot!(format!("suburb_{}_{}", run.experiment, run.sensor), run.render().digest());
    }
}

/// Fifteen runs of two sweeps and three of a constant, in the order of the text; the further away, the more the air between
/// target and sensor adds.
#[test]
fn study() {
    let options = Options { pixels: Some((16, 12)), samples: Some(16), ..Options::default() };
    let plan = plan("examples/study/study.glint", &options);
    let names: Vec<&str> = plan.runs().iter().map(|run| run.experiment.as_str()).collect();
    assert_eq!(names.len(), 18);
    assert_eq!(
        (names[0], names[1]),
        ("haze/reflectance=ideal,visibility=5km", "haze/reflectance=ideal,visibility=10km")
    );
    assert_eq!(&names[15..], ["300m", "1000m", "3000m"].map(|height| format!("flight/flying_height={height}")));
    let blue = |run: usize| {
        let explained = sunglint::explain(&plan.runs()[run], (8, 10), 0, &plan.materials);
        let (_, value) = explained.bands[0].terms.iter().find(|(name, _)| *name == "path_radiance").expect("a term");
        *value
    };
    assert!(blue(15) < blue(16) && blue(16) < blue(17), "{} {} {}", blue(15), blue(16), blue(17));
}

/// The scene's point: the flat mirror before the shed shows the camera both greys of its front. Where a pixel's mirror
/// ray meets the front, the light half is brighter than the dark half by more than the panel's own haze.
#[test]
fn the_mirror_of_the_truth_scene_shows_both_greys() {
    let times = vec!["1992-06-18T170100Z".to_string()];
    let options = Options { times, experiments: vec!["split".into()], ..Options::default() };
    let plan = plan("examples/truth/truth.glint", &options);
    let red = |pixel| {
        let explained = sunglint::explain(&plan.runs()[0], pixel, 0, &plan.materials);
        assert_eq!(explained.hit.expect("the mirror is there").material, "mirror");
        let band = explained.bands.iter().find(|band| band.name == "red").expect("the scene has a red band");
        let (_, value) =
            band.terms.iter().find(|(name, _)| *name == "specular_background").expect("it shows the front");
        *value
    };
    let (light, dark) = (red((233, 200)), red((291, 200)));
    assert!(light > 2.0 * dark && dark > 0.0, "light half {light}, dark half {dark}");
}
