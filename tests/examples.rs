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
