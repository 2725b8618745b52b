//! `full { indirect cached }`: sky and background interpolated between points of a facet, against closed forms and against what
//! every sample finds for itself.

use std::f64::consts::PI;

use sunglint::radiometry::STUDENT_T_95;
use sunglint::{Plan, Samples, explain};

use crate::courtyard;
use crate::pose::{Slack, assert_sampled, map, pixels, run, term, text};

/// Where all is white and the sky even, every path returns the sky: so does every point, and what lies between points.
#[test]
fn a_white_furnace_is_one_between_points_too() {
    let said = "collect { sun none }
        atmosphere none { solar_irradiance 0 W/m2/um, sky_radiance 100 W/m2/sr/um }
        material white { ideal { diffuse 1 } }
        ground white
        box white size (2 2 2) m at (0 0 0) m
        box white size (1 1 1) m at (3 1 0) m heading 30 deg
        sensor eye { position (9 -9 7) m, look_at (1 0 0.5) m, field_of_view 40 deg, pixels 80 x 60, band b 500..600 nm }
        experiment cached { algorithm full { indirect cached }, samples 16 }";
    let plan = text(said);
    let frames = run(&plan, "cached").render();
    let slack = Slack { bound: 1e-4, grain: 1e-4 };
    assert_sampled("white furnace, cached", slack, pixels(&frames, 0).into_iter().map(|(l, s)| (l, s, 100.0)));
    // Points are few: less than a ray a sample, where each sample would look once over level facets and twice over others.
    assert!(frames.rays.hemisphere < 80 * 60 * 16, "{:?}", frames.rays);
}

/// The sky over the floor and the walls of a long trench, by crossed strings, column by column and row by row: within the standard
/// error and a hundredth, in the corners too. The walls stand at round numbers.
#[test]
fn a_trench_between_points_sees_the_crossed_strings_share_of_the_sky() {
    let (l_0, rho) = (100.0, 0.5);
    for h in [0.5, 1.0, 2.0f64] {
        // Black walls: the floor sees the sky alone; depth 2 lets points know what is near.
        let said = "experiment cached { algorithm full { indirect cached, depth 2 }, samples 256 }";
        let black = text(&format!(
            "collect {{ sun none }}
            atmosphere none {{ solar_irradiance 0 W/m2/um, sky_radiance {l_0} W/m2/sr/um }}
            material floor {{ ideal {{ diffuse {rho} }} }}
            material wall {{ ideal {{ diffuse 0 }} }}
            facet floor (-0.5 -100 0) (0.5 -100 0) (0.5 100 0) (-0.5 100 0) m
            box wall size (1 200 {h}) m at (1 0 0) m
            box wall size (1 200 {h}) m at (-1 0 0) m
            {}
            {said}",
            map("below", [0.0, 0.0, h + 1.0], 1.0, [64, 8]),
        ));
        let floor = |x: f64| 0.5 * (x * x + h * h).sqrt();
        let mean = |a: f64, b: f64| (floor(b) - floor(a) + floor(1.0 - a) - floor(1.0 - b)) / (b - a);
        let expected = |i: usize| {
            let column = (i % 64) as f64 / 64.0;
            rho * l_0 * mean(column, column + 1.0 / 64.0)
        };
        let frames = run(&black, "cached").render();
        // Where each sample looked for itself, one ray each.
        assert!(frames.rays.hemisphere < 64 * 8 * 256 / 2, "{:?}", frames.rays);
        let bound = rho * l_0 * 2.0 * h * h / (PI * 1e6) + 0.01 * rho * l_0 * ((1.0 + h * h).sqrt() - h);
        let slack = Slack { bound, grain: rho * l_0 / 256.0 };
        let seen = pixels(&frames, 0);
        assert_sampled(
            &format!("trench of depth {h}, between points"),
            slack,
            seen.iter().enumerate().map(|(i, (l, s))| (*l, *s, expected(i))),
        );
    }
}

/// In a walled yard with a box, under sun and sky at three times, what is interpolated is what every sample finds for itself to half a
/// hundredth of the mean in the root mean square; and no pixel is off by more than its error and a twentieth.
#[test]
fn a_yard_between_points_is_what_each_sample_finds() {
    let plan = courtyard(
        [48, 36],
        "experiment sampled { algorithm full, samples 1024, seed 3 }
        experiment cached { algorithm full { indirect cached }, samples 256, seed 4 }",
    );
    let [sampled, cached] = ["sampled", "cached"].map(|name| run(&plan, name).render());
    for (frame, due) in cached.frames.iter().zip(&sampled.frames) {
        for c in 0..frame.radiance.len() {
            let n = frame.radiance[c].len() as f64;
            let mean = due.radiance[c].iter().map(|l| f64::from(*l)).sum::<f64>() / n;
            let (mut squares, mut noise) = (0.0, 0.0);
            for i in 0..frame.radiance[c].len() {
                let s = f64::from(frame.error[c][i]).hypot(f64::from(due.error[c][i]));
                let off = f64::from(frame.radiance[c][i]) - f64::from(due.radiance[c][i]);
                assert!(off.abs() <= 5.0 * s + 0.05 * mean, "{} {c} {i}: {off} of {mean} ± {s}", frame.label);
                squares += off * off / n;
                noise += s * s / n;
            }
            let left = (squares - noise).max(0.0).sqrt() / mean;
            println!(
                "cached   {} {c}: {:.3} % of the mean beside noise of {:.3} %",
                frame.label,
                100.0 * left,
                100.0 * noise.sqrt() / mean
            );
            assert!(left < 0.005, "{left}");
        }
    }
}

/// The stated error holds the noise of the points: over 20 seeds at least 93 % of pixels lie within it and half a hundredth.
#[test]
fn the_error_covers_what_points_bring() {
    let mut said = "experiment reference { algorithm full, samples 4096, seed 77 }\n".to_string();
    for seed in 1..=20 {
        said +=
            &format!("experiment cached_{seed} {{ algorithm full {{ indirect cached }}, samples 32, seed {seed} }}\n");
    }
    let plan = courtyard([16, 12], &said);
    let reference = run(&plan, "reference").render();
    let (mut inside, mut all) = (0, 0);
    for seed in 1..=20 {
        let frames = run(&plan, &format!("cached_{seed}")).render();
        for (frame, due) in frames.frames.iter().zip(&reference.frames) {
            for (c, image) in frame.radiance.iter().enumerate() {
                for (i, l) in image.iter().enumerate().filter(|(i, _)| frame.error[c][*i] > 0.0) {
                    let s = f64::from(frame.error[c][i]).hypot(f64::from(due.error[c][i]));
                    let off = f64::from(*l) - f64::from(due.radiance[c][i]);
                    inside += u32::from(off.abs() <= STUDENT_T_95 * s + 0.005 * f64::from(due.radiance[c][i]));
                    all += 1;
                }
            }
        }
    }
    let share = f64::from(inside) / f64::from(all);
    println!("covered, cached: {:.2} % of {all}", 100.0 * share);
    assert!(share >= 0.93, "{share}");
}

/// `explain` tells a pixel's terms from the points that its image took: together they are the radiance of the frame.
#[test]
fn explain_takes_the_points_of_the_image() {
    let plan = courtyard([48, 36], "experiment cached { algorithm full { indirect cached }, samples 64 }");
    let (run, materials) = (run(&plan, "cached"), plan.materials.clone());
    let frames = run.render();
    let mut sky = 0.0;
    for (x, y) in [(5, 20), (24, 18), (40, 30)] {
        let told = explain(run, (x, y), 1, &materials);
        let shown = f64::from(frames.frames[1].radiance[0][(y * 48 + x) as usize]);
        let names = [
            "diffuse_sun",
            "diffuse_sky",
            "diffuse_background",
            "specular_sun",
            "specular_sky",
            "specular_background",
            "caustic",
        ];
        let sum: f64 = names.iter().chain(&["path_radiance"]).map(|name| term(&told, 0, name)).sum();
        sky += term(&told, 0, "diffuse_sky");
        // A pixel alone may be proved lit where its block is not, and terms are products of means over the replicates.
        assert!(
            (told.bands[0].radiance - shown).abs() < 1e-3 * shown,
            "({x} {y}): {} of {shown}",
            told.bands[0].radiance
        );
        assert!((sum - shown).abs() < 1e-3 * shown, "({x} {y}): {sum} of {shown}");
    }
    assert!(sky > 0.0);
}

/// A pixel that sees one facet alone, wholly in the sun, is told by one sample, at each time by itself: where the shadow of a box
/// passes in the morning or in the evening all times are what they are alone, and at noon that sample still speaks for the pixel.
#[test]
fn even_pixels_take_one_sample_at_each_time_by_itself() {
    let scene = |collects: &str| {
        text(&format!(
            "{collects}
            atmosphere none {{ solar_irradiance 1500 W/m2/um, sky_radiance 80 W/m2/sr/um }}
            material lot {{ ideal {{ diffuse 0.3 }} }}
            material box {{ ideal {{ diffuse 0.5 }} }}
            facet lot (-20 -20 0) (20 -20 0) (20 20 0) (-20 20 0) m
            box box size (2 2 3) m at (0 0 0) m
            {}
            experiment counted {{ algorithm full {{ indirect cached }}, samples 32 }}
            experiment asked {{ algorithm full {{ indirect cached }}, error 3 % over image }}",
            map("below", [0.0, 0.0, 30.0], 24.0, [72, 72]),
        ))
    };
    let times = [-60_i32, 5, 60].map(|zenith| {
        format!("collect {{ sun zenith {} deg azimuth {} deg }}\n", zenith.abs(), if zenith > 0 { 90 } else { 270 })
    });
    let all = scene(&times.concat());
    for name in ["counted", "asked"] {
        let together = run(&all, name).render();
        let mut told_anew = 0;
        for (time, frame) in times.iter().zip(&together.frames) {
            let alone = run(&scene(time), name).render();
            let own = &alone.frames[0];
            for i in 0..72 * 72 {
                // Under an error all times choose how many samples the rest take.
                let is_told = alone.samples[i] == 1.0;
                told_anew += u32::from(is_told && together.samples[i] > 1.0);
                if is_told || name == "counted" {
                    assert_eq!(
                        frame.radiance[0][i].to_bits(),
                        own.radiance[0][i].to_bits(),
                        "{name} {} {i}",
                        frame.label
                    );
                    assert_eq!(frame.error[0][i].to_bits(), own.error[0][i].to_bits(), "{name} {} {i}", frame.label);
                }
                assert!(!is_told || own.lit[i] == 1.0 || own.lit[i] == 0.0, "{} {i}: {}", frame.label, own.lit[i]);
            }
        }
        assert!(told_anew > 100, "{name}: {told_anew}");
        let told = together.samples.iter().filter(|n| **n == 1.0).count();
        assert!((2500..5000).contains(&told), "{name}: {told} of {}", 72 * 72);
    }
}

/// Two skies over one geometry: their paths and points are gathered once, and each image is what it is alone.
#[test]
fn points_that_runs_share_are_those_of_each_alone() {
    let said = |name: &str, visibility: u32| {
        format!(
            "experiment {name} {{ algorithm full {{ indirect cached }}, samples 16
               weather {{ visibility {visibility} km }} }}\n"
        )
    };
    let both = courtyard([40, 24], &(said("hazy", 5) + &said("clear", 40)));
    let alone = |name: &str, visibility: u32| courtyard([40, 24], &said(name, visibility));
    let radiance = |plan: &Plan, name: &str| run(plan, name).render().frames;
    let runs: Vec<&sunglint::Run> = both.runs().iter().collect();
    let out = tempfile::tempdir().expect("a folder");
    let rendered = sunglint::render(&both, out.path(), &Silent).expect("rendered");
    assert!(rendered[0].traced_with.is_none() && rendered[1].traced_with.is_some());
    for (run, visibility) in runs.iter().zip([5, 40]) {
        let alone = radiance(&alone(&run.experiment, visibility), &run.experiment);
        for frame in &alone {
            let file = out.path().join(&run.experiment).join(&run.sensor).join(&frame.label).join("radiance.exr");
            let image = sunglint::read_image(&file).expect("an image");
            for (band, due) in image.bands.iter().zip(&frame.radiance) {
                let Samples::F32(samples) = &band.samples else { panic!("{:?}", band.name) };
                assert!(samples.iter().zip(due).all(|(a, b)| a.to_bits() == b.to_bits()), "{}", run.experiment);
            }
        }
    }
}

struct Silent;

impl sunglint::Progress for Silent {
    fn begin(&self, _: &[&sunglint::Run], _: usize) {}
    fn tile(&self, _: bool, _: &sunglint::Tally) {}
    fn end(&self, _: &sunglint::Run, _: &sunglint::Rendered) {}
}
