//! Closed forms posed as scenes, through the whole path: text, check, plan, rays, light, channels.
//!
//! Where nothing is sampled the tolerance is 1e-6 relative: everything is computed in `f64`, frames keep `f32`
//! (6e-8), and the quadrature over a tilted facet's sky converges to 1e-7. Where rays are sampled it is 4 standard
//! errors, as the frames themselves state them. `cargo test --release --test analytic -- --nocapture` prints the
//! deviations.

#[path = "analytic/cached.rs"]
mod cached;
#[path = "analytic/full.rs"]
mod full;
#[path = "analytic/pose.rs"]
mod pose;
#[path = "analytic/relief.rs"]
mod relief;
#[path = "analytic/scanners.rs"]
mod scanners;

use std::f64::consts::PI;
use std::fmt::Write;

use glam::DVec3;
use pose::{
    Lines, Slack, assert_exact, assert_sampled, beyond_chord, map, mean_of_product, pixel, pixels, run, scene, sky,
    term, text, whole,
};
use sunglint::atmosphere::Path as Sightline;
use sunglint::radiometry::{STUDENT_T_95, WorldDir};
use sunglint::{Frames, Options, Plan, Run, explain};

/// Angular radius of the sun's disk at 1 au \[rad\]: 0.2666°, as docs/CONVENTIONS.md has it.
fn sun_radius() -> f64 {
    0.2666f64.to_radians()
}

/// Ω_sun, over which E_n spreads: ∫ cos dω over the disk \[sr\].
fn omega_sun() -> f64 {
    PI * sun_radius().sin().powi(2)
}

// ---- panels in the open

/// Sun at θ on Lambert panels, no air: L = ρ E₀ cos θ/π exactly, for any θ and ρ, in both readings of both algorithms,
/// and without one ray to the sun or over a hemisphere.
#[test]
fn a_bare_lambert_panel_returns_rho_e0_cos_theta_over_pi() {
    let (e_0, zeniths, rhos) = (1850.0, [0.0, 20.0, 45.0, 60.0, 75.0, 89.0, 89.99], [0.02, 0.18, 0.5, 0.8, 1.0]);
    let mut said = format!("atmosphere none {{ solar_irradiance {e_0} W/m2/um }}\n");
    for zenith in zeniths {
        writeln!(said, "collect {{ sun zenith {zenith} deg azimuth 200 deg }}").expect("text grows");
    }
    for (i, rho) in rhos.iter().enumerate() {
        writeln!(said, "material m{i} {{ ideal {{ diffuse {rho} }} }}").expect("text grows");
        writeln!(said, "facet m{i} ({i} 0 0) ({} 0 0) ({} 1 0) ({i} 1 0) m", i + 1, i + 1).expect("text grows");
    }
    said += &map("above", [2.5, 0.5, 10.0], 5.0, [5, 1]);
    for algorithm in ["ideal", "split"] {
        for reading in ["published", "corrected"] {
            writeln!(
                said,
                "experiment {algorithm}_{reading} {{ algorithm {algorithm} {{ reading {reading} }}, samples 64 }}"
            )
            .expect("text grows");
        }
    }
    let plan = text(&said);
    assert_eq!(plan.runs().len(), 4);
    for run in plan.runs() {
        let frames = run.render();
        assert_exact(
            &format!("bare panel, {}", run.experiment),
            (0..zeniths.len()).flat_map(|t| (0..rhos.len()).map(move |i| (t, i))).map(|(t, i)| {
                let frame =
                    frames.frames.iter().position(|f| f.label == run.moments[t].label).expect("a frame a moment");
                let cos = run.moments[t].sun.expect("a sun").true_zenith.cos();
                (pixel(&frames, frame, 0, i).0, rhos[i] * e_0 * cos / PI)
            }),
        );
        assert_eq!((frames.rays.sun, frames.rays.hemisphere, frames.rays.mirror), (0, 0, 0), "{}", run.experiment);
    }
    let zeniths_found: Vec<f64> =
        plan.runs()[0].moments.iter().map(|m| m.sun.unwrap().true_zenith.to_degrees()).collect();
    assert!(zeniths_found.iter().zip(zeniths).all(|(found, said)| (found - said).abs() < 1e-9), "{zeniths_found:?}");
}

/// A panel tilted by β about the west–east line, its middle 5 m above z = 0, seen along its normal.
fn tilted(beta: f64, more: &str) -> Plan {
    let n = DVec3::new(0.0, -beta.to_radians().sin(), beta.to_radians().cos());
    let (eye, far) = (DVec3::Z * 5.0 + 3.0 * n, DVec3::Z * 5.0 + 1000.0 * n);
    text(&format!(
        "collect {{ sun none }}
        material grey {{ ideal {{ diffuse 0.5 }} }}
        material black {{ ideal {{ diffuse 0 }} }}
        material soil {{ ideal {{ diffuse 0.3 }} }}
        panel grey size (1 1) m at (0 0 5) m slope {beta} deg aspect 180 deg
        sensor normal {{
          projection orthographic
          position ({} {} {}) m, look_at (0 0 5) m
          swath 0.8 m, pixels 4 x 4, band b 500..600 nm
        }}
        {}",
        eye.x,
        eye.y,
        eye.z,
        more.replace("FAR", &format!("panel black size (0.001 0.001) m at ({} {} {}) m", far.x, far.y, far.z)),
    ))
}

/// Panels tilted by β under the overcast law L = L₀ (1 + 2 cos θ)/3 and under a uniform sky, nothing below the
/// horizon: L = ρ E/π with E = (L₀/3) {π (1+cos β)/2 + (4/3) [sin β + (π − β) cos β]} and π L₀ (1+cos β)/2. `sky
/// isotropic` takes the mean sky, 7/9 L₀, behind F = (1+cos β)/2. Where something rises above the panel's plane (here
/// a square millimetre a kilometre away, which hides 1e-12 sr) the same comes from rays over the hemisphere.
#[test]
fn a_tilted_panel_sees_the_closed_forms_of_an_overcast_and_of_a_uniform_sky() {
    let (l_0, rho) = (90.0, 0.5);
    let mut by_claim: Vec<(&str, Vec<(f64, f64)>)> =
        ["overcast, directional", "overcast, isotropic", "uniform, directional", "uniform, isotropic"]
            .map(|c| (c, vec![]))
            .into();
    let mut view_factors = Vec::new();
    let mut sampled: Vec<Vec<(f64, f64, f64)>> = vec![vec![]; 4];
    for beta in [0.0, 1e-3, 15.0, 45.0, 89.99, 90.0, 120.0, 175.0, 180.0f64] {
        let mut experiments = String::new();
        for sky in ["overcast", "isotropic"] {
            for seen in ["directional", "isotropic"] {
                writeln!(
                    experiments,
                    "experiment {sky}_{seen} {{
                      algorithm split {{ reading corrected, sky {seen} }}
                      atmosphere none {{ solar_irradiance 0 W/m2/um, sky_radiance {l_0} W/m2/sr/um, sky {sky} }}
                      samples 1024
                    }}",
                )
                .expect("text grows");
            }
        }
        let b = beta.to_radians();
        let f = 0.5 * (1.0 + b.cos());
        let overcast = (PI * f + 4.0 / 3.0 * (b.sin() + (PI - b) * b.cos())) / (3.0 * PI);
        let expected = [overcast, 7.0 / 9.0 * f, f, f].map(|share| rho * l_0 * share);
        let open = tilted(beta, &experiments);
        let obstructed = tilted(beta, &format!("FAR\n{experiments}"));
        for (k, run) in open.runs().iter().enumerate() {
            let frames = run.render();
            assert_eq!(frames.rays.sun, 0);
            // At 180° the sky is a rim without area: 1e-17 against L₀.
            let found = pixels(&frames, 0).into_iter().map(|(l, _)| if l < 1e-14 { 0.0 } else { l });
            let expected = if beta == 180.0 { 0.0 } else { expected[k] };
            by_claim[k].1.extend(found.map(|l| (l, expected)));
            let explained = explain(run, (1, 1), 0, &open.materials);
            view_factors.push((1.0 + term(&explained, 0, "sky_view_factor"), 1.0 + f));
        }
        if !(1.0..=179.0).contains(&beta) {
            continue;
        }
        for (k, run) in obstructed.runs().iter().enumerate() {
            let frames = run.render();
            assert!(frames.rays.hemisphere >= 16 * 1024);
            let seen = pixels(&frames, 0).into_iter();
            sampled[k].extend(seen.map(|(l, s)| (l, s, expected[k])));
        }
    }
    for ((claim, pairs), triples) in by_claim.into_iter().zip(sampled) {
        // The quadrature's own error is 1e-7 of L₀, whatever is left of the sky: compare against that scale.
        assert_exact(&format!("tilted panel, {claim}"), pairs.into_iter().map(|(l, e)| (l + rho * l_0, e + rho * l_0)));
        let slack = Slack { bound: 0.0, grain: rho * l_0 / 1024.0 };
        assert_sampled(&format!("tilted panel, {claim}"), slack, triples);
    }
    assert_exact("tilted panel, sky view factor", view_factors);
}

/// Level soil of albedo ρ_g under a uniform sky fills the panel's lower part with ρ_g L₀ F′, where F′ is the panel's
/// own F as published, and 1 once `background_sky own` takes the soil's (here by slope, so that no ray is thrown).
#[test]
fn a_tilted_panel_over_soil_sees_the_soil_below_the_horizon() {
    let (l_0, rho, soil) = (90.0, 0.5, 0.3);
    let sky = sky(l_0);
    let mut pairs = [vec![], vec![], vec![]];
    for beta in [0.0, 30.0, 60.0, 90.0, 150.0f64] {
        let plan = tilted(
            beta,
            &format!(
                "ground soil
                {sky}
                experiment target {{ algorithm split {{ sky_view slope, background_sky target }}, samples 16 }}
                experiment own {{ algorithm split {{ sky_view slope, background_sky own }}, samples 16 }}
                experiment alone {{ algorithm split {{ depth 1 }}, samples 16 }}"
            ),
        );
        let f = 0.5 * (1.0 + beta.to_radians().cos());
        for (k, (name, below)) in [("target", soil * f), ("own", soil), ("alone", 0.0)].into_iter().enumerate() {
            let expected = rho * l_0 * (f + (1.0 - f) * below);
            pairs[k].extend(pixels(&run(&plan, name).render(), 0).into_iter().map(|(l, _)| (l, expected)));
        }
    }
    for (claim, pairs) in ["F of the target", "F of its own", "no background"].iter().zip(pairs) {
        assert_exact(&format!("tilted panel over soil, {claim}"), pairs);
    }
}

// ---- view factors

/// A trench 1 m wide, `h` deep and 200 m long, open to the west–east sky by its width alone, with views of its floor
/// and of its eastern wall over their whole depth.
fn trench(h: f64, wall: &str, experiments: &str) -> Plan {
    text(&format!(
        "collect {{ sun none }}
        material floor {{ ideal {{ diffuse 0.5 }} }}
        material wall {{ ideal {{ diffuse 0.5 }}{wall} }}
        facet floor (-0.5 -100 0) (0.5 -100 0) (0.5 100 0) (-0.5 100 0) m
        box wall size (1 200 {h}) m at (1 0 0) m
        box wall size (1 200 {h}) m at (-1 0 0) m
        {}
        sensor east {{
          projection orthographic
          position (-0.4 0 {}) m, heading 90 deg, depression 0 deg
          swath {h} m, pixels 8 x 8, band b 500..600 nm
        }}
        {experiments}",
        map("below", [0.0, 0.0, h + 1.0], 1.0, [8, 8]),
        0.5 * h,
    ))
}

/// The sky seen from a long trench, by crossed strings: over the floor √(1+H²) − H, over a wall (1 + H −
/// √(1+H²))/(2H), H the depth in widths, and over every column of the floor or row of the wall in between. The strips
/// that the 200 m leave open at their ends hold 2 H²/(π 100³) of a hemisphere, less than 1.4e-5 of what is expected.
#[test]
fn a_trench_shows_its_floor_and_walls_the_crossed_strings_share_of_the_sky() {
    let (l_0, rho) = (100.0, 0.5);
    for h in [0.5, 1.0, 2.0f64] {
        let plan = trench(
            h,
            "",
            &format!(
                "atmosphere none {{ solar_irradiance 0 W/m2/um, sky_radiance {l_0} W/m2/sr/um }}
                experiment rays {{ algorithm split {{ depth 1 }}, samples 1024 }}
                experiment slope {{ algorithm split {{ depth 1, sky_view slope }}, samples 16 }}"
            ),
        );
        // Integrals over a floor from one wall, and over a wall from its top down.
        let floor = |x: f64| 0.5 * (x * x + h * h).sqrt();
        let wall = |d: f64| 0.5 * (d + 1.0 - (d * d + 1.0).sqrt());
        let floor_mean = |a: f64, b: f64| (floor(b) - floor(a) + floor(1.0 - a) - floor(1.0 - b)) / (b - a);
        let wall_mean = |a: f64, b: f64| (wall(b) - wall(a)) / (b - a);
        assert!((floor_mean(0.0, 1.0) - ((1.0 + h * h).sqrt() - h)).abs() < 1e-14);
        assert!((wall_mean(0.0, h) - (1.0 + h - (1.0 + h * h).sqrt()) / (2.0 * h)).abs() < 1e-14);
        for (sensor, all) in [("below", floor_mean(0.0, 1.0)), ("east", wall_mean(0.0, h))] {
            let expected = |i: usize| {
                let (column, row) = ((i % 8) as f64 / 8.0, (i / 8) as f64 / 8.0);
                if sensor == "below" {
                    floor_mean(column, column + 0.125)
                } else {
                    wall_mean(row * h, (row + 0.125) * h)
                }
            };
            let run = plan.run("rays", sensor).expect("a run");
            let frames = run.render();
            let seen = pixels(&frames, 0);
            let bound = rho * l_0 * 2.0 * h * h / (PI * 1e6);
            let name = format!("trench of depth {h}, {sensor}");
            let slack = Slack { bound, grain: rho * l_0 / 1024.0 };
            assert_sampled(&name, slack, seen.iter().enumerate().map(|(i, (l, s))| (*l, *s, rho * l_0 * expected(i))));
            let (mean, error) = whole(&seen);
            assert_sampled(&format!("{name}, whole"), Slack { grain: 0.0, ..slack }, [(mean, error, rho * l_0 * all)]);
            // F in the truth maps is the same rays' share.
            let f = frames.truth[8].iter().map(|f| f64::from(*f)).sum::<f64>() / 64.0;
            assert!((f - mean / (rho * l_0)).abs() < 1e-6, "{name}: truth map {f}");
            // `sky_view slope` looks past the walls: F = 1 on the floor, 1/2 on a wall.
            let blind = if sensor == "below" { 1.0 } else { 0.5 };
            let frames = plan.run("slope", sensor).expect("a run").render();
            assert_exact(
                &format!("{name}, by slope"),
                pixels(&frames, 0).into_iter().map(|(l, _)| (l, rho * l_0 * blind)),
            );
        }
    }
}

/// Glowing walls under a black sky light the floor with ρ (1 − F) L_e, whether one background point stands for all
/// hits or each for itself, with one ray a sample or four.
#[test]
fn the_walls_of_a_trench_light_its_floor_with_what_the_sky_does_not_hold() {
    let (l_e, rho, h) = (40.0, 0.5, 1.0f64);
    let experiment =
        |name: &str, more: &str| format!("experiment {name} {{ algorithm split {{ {more} }}, samples 1024 }}\n");
    let experiments = ["point", "average"]
        .map(|word| {
            experiment(word, &format!("background {word}"))
                + &experiment(&format!("{word}_4"), &format!("background {word}, rays 4"))
        })
        .concat();
    let sky = "atmosphere none { solar_irradiance 0 W/m2/um }\n";
    let plan = trench(h, &format!(", emission {l_e} W/m2/sr/um"), &(sky.to_string() + &experiments));
    let f = (1.0 + h * h).sqrt() - h;
    for name in ["point", "average", "point_4", "average_4"] {
        let run = plan.run(name, "below").expect("a run");
        let seen = pixels(&run.render(), 0);
        let (mean, error) = whole(&seen);
        let expected = rho * l_e * (1.0 - f);
        let slack = Slack { bound: 1e-6 * expected, grain: 0.0 };
        assert_sampled(&format!("glowing walls, {name}"), slack, [(mean, error, expected)]);
    }
}

/// Hottel's view factors between unit squares: facing each other at distance 1 (0.199825), and perpendicular with an
/// edge in common (0.200044). One glows, the other, seen from between them, returns ρ F L_e on the mean.
#[test]
fn unit_squares_exchange_the_catalogued_view_factors() {
    let (l_e, rho) = (100.0, 0.8);
    // X = Y = 1 in the catalogue's formula for parallel rectangles; H = W = 1 for perpendicular ones.
    let root = 2f64.sqrt();
    let facing = 2.0 / PI * ((4.0f64 / 3.0).sqrt().ln() + 2.0 * root * (1.0 / root).atan() - 2.0 * 1f64.atan());
    let beside = (2.0 * 1f64.atan() - root * (1.0 / root).atan() + 0.25 * (4.0 / 3.0 * 0.75f64.powi(2)).ln()) / PI;
    assert!((facing - 0.199825).abs() < 5e-7 && (beside - 0.200044).abs() < 5e-7, "{facing} {beside}");
    let claims = [
        ("facing each other", "panel glow size (1 1) m at (0.5 0.5 1) m facing down", facing),
        ("with a common edge", "facet glow (0 0 0) (0 1 0) (0 1 1) (0 0 1) m", beside),
    ];
    for (claim, other, factor) in claims {
        let plan = text(&format!(
            "collect {{ sun none }}
            atmosphere none {{ solar_irradiance 0 W/m2/um }}
            material grey {{ ideal {{ diffuse {rho} }} }}
            material glow {{ emission {l_e} W/m2/sr/um, ideal {{ diffuse 0 }} }}
            panel grey size (1 1) m at (0.5 0.5 0) m
            {other}
            {}
            experiment squares {{ samples 4096 }}",
            map("between", [0.5, 0.5, 0.5], 1.0, [8, 8]),
        ));
        let seen = pixels(&plan.runs()[0].render(), 0);
        let (mean, error) = whole(&seen);
        assert_sampled(&format!("unit squares {claim}"), Slack::default(), [(mean, error, rho * l_e * factor)]);
    }
}

// ---- the sun's disk

/// A straight edge h above level ground hides from a point at x the part of the sun's disk beyond a chord, (arccos u
/// − u √(1−u²))/π with u = x cos θ/(h sin r) across the edge: pixel by pixel through the penumbra, with the sun
/// overhead and with the sun at 30° along the edge. The chord's turn over a slanted ray and the change of cos θ over
/// the disk come to 2e-5 of the full irradiance. A point sun draws a step.
#[test]
fn the_penumbra_of_a_straight_edge_is_a_segment_of_the_disk() {
    let (e_0, rho, h, n) = (1500.0, 0.4, 100.0, 48);
    let plan = text(&format!(
        "collect overhead {{ sun zenith 0 deg azimuth 0 deg }}
        collect slanted {{ sun zenith 30 deg azimuth 0 deg }}
        atmosphere none {{ solar_irradiance {e_0} W/m2/um }}
        material grey {{ ideal {{ diffuse {rho} }} }}
        ground grey
        facet grey (-400 -400 {h}) (0 -400 {h}) (0 400 {h}) (-400 400 {h}) m
        {}
        experiment disk {{ algorithm split {{ sun disk, depth 1 }}, samples 1024 }}
        experiment point {{ algorithm split {{ sun point, depth 1 }}, samples 16 }}",
        map("below", [0.0, 0.0, 50.0], 1.44, [n, 2]),
    ));
    let width = 1.44 / f64::from(n);
    for (name, zenith) in [("overhead", 0f64), ("slanted", 30.0)] {
        let cos = zenith.to_radians().cos();
        let full = rho * e_0 * cos / PI;
        let frame = |run: &Run| {
            let wanted = |m: &sunglint::Moment| (m.sun.unwrap().true_zenith.to_degrees() - zenith).abs() < 1e-9;
            run.moments.iter().position(wanted).expect("a frame for each sun")
        };
        let offset = |x: f64| x * cos / (h * sun_radius().sin());
        let left = |i: usize| (i as f64 - f64::from(n) / 2.0) * width;
        let (disk, point) = (run(&plan, "disk"), run(&plan, "point"));
        let seen = pixels(&disk.render(), frame(disk));
        let lit = |i: usize| beyond_chord(offset(-left(i) - width), offset(-left(i)));
        assert_sampled(
            &format!("penumbra, sun {name}"),
            Slack { bound: 2e-5 * full, grain: full / 1024.0 },
            seen.iter().enumerate().map(|(i, (l, s))| (*l, *s, full * lit(i % n as usize))),
        );
        let stepped = pixels(&point.render(), frame(point));
        assert_exact(
            &format!("shadow of a point sun, {name}"),
            stepped.iter().enumerate().map(|(i, (l, _))| (*l, if left(i % n as usize) >= 0.0 { full } else { 0.0 })),
        );
    }
}

/// A level mirror under a black sky with the sun at 40° in the north, seen from the south along the mirror direction.
fn sun_mirror(material: &str, field_of_view: f64, experiments: &str) -> Plan {
    text(&format!(
        "collect {{ sun zenith 40 deg azimuth 0 deg }}
        atmosphere none {{ solar_irradiance 1500 W/m2/um }}
        material mirror {{ {material} }}
        panel mirror size (100 100) m
        sensor eye {{
          look_at (0 0 0) m, altitude 100 m, view_zenith 40 deg, view_azimuth 180 deg
          field_of_view {field_of_view} deg, pixels 48 x 48, band b 500..600 nm
        }}
        {experiments}"
    ))
}

/// What a pixel of a mirror's image looks into: angles between the reflected ray and the sun, the least and largest
/// over its corners, and its solid angle.
fn reflected(run: &Run, i: usize) -> (f64, f64, f64) {
    let sun = run.light(0).sun.expect("a sun");
    let (x, y) = ((i % 48) as f64, (i / 48) as f64);
    let corners =
        [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|(a, b)| run.camera.ray(x + a, y + b).direction.vec());
    let apart = corners.map(|d| WorldDir::from_unit(DVec3::new(d.x, d.y, -d.z)).angle_to(sun));
    let (low, high) = apart.iter().fold((f64::INFINITY, 0.0), |(l, h), a| (f64::min(l, *a), f64::max(h, *a)));
    let [a, b, c, d] = corners;
    (low, high, 0.5 * ((c - a).cross(d - b)).length())
}

/// Holds an image of the sun to a level inside an angle about the mirrored sun, to 0 outside another, and its
/// integral over solid angle to a total.
fn assert_glint(claim: &str, run: &Run, inside: (f64, f64), outside: f64, total: f64, bound: f64) {
    let seen = pixels(&run.render(), 0);
    let mut pairs = Vec::new();
    let (mut sum, mut squares, mut n_inside) = (0.0, 0.0, 0);
    for (i, (l, s)) in seen.iter().enumerate() {
        let (low, high, solid_angle) = reflected(run, i);
        let diagonal = 1.5 * (2.0 * solid_angle).sqrt();
        sum += l * solid_angle;
        squares += (s * solid_angle).powi(2);
        if high < inside.0 {
            pairs.push((*l, inside.1));
            n_inside += 1;
        } else if low > outside + diagonal {
            pairs.push((*l, 0.0));
        }
    }
    assert!(n_inside > 20 && pairs.len() - n_inside > 20, "{claim}: {n_inside} of {}", pairs.len());
    assert_exact(claim, pairs);
    assert_sampled(
        &format!("{claim}, integral"),
        Slack { bound: bound * total, grain: 0.0 },
        [(sum, squares.sqrt(), total)],
    );
}

/// In the pixels of a mirror that see the sun's disk L = ρ E_n/Ω_sun, elsewhere what the black sky sends; the image
/// integrates to ρ E_n over the disk's solid angle, which is 1/cos²(r/2) of Ω_sun. As printed, eq. 4.1 shows R_s E
/// cos θ_s/π in the disk, and eq. 3.11, without a test of the mirror direction, ρ E cos θ_s/π everywhere.
#[test]
fn the_sun_in_a_mirror_has_the_radiance_of_the_sun() {
    let plan = sun_mirror(
        "ideal { specular 0.85 }",
        1.2,
        "experiment ideal { algorithm ideal { reading corrected }, samples 256 }
        experiment split { algorithm split { reading corrected }, samples 256 }
        experiment conserving { algorithm split { reading corrected, glint conserving }, samples 256 }
        experiment printed { algorithm split { reading published }, samples 256 }
        experiment lambert { algorithm ideal { reading published }, samples 16 }",
    );
    let r = sun_radius();
    let (e_n, disk) = (0.85 * 1500.0, omega_sun() / (0.5 * r).cos().powi(2));
    for name in ["ideal", "split", "conserving"] {
        let level = e_n / omega_sun();
        assert_glint(&format!("sun in a mirror, {name}"), run(&plan, name), (r, level), r, level * disk, 0.0);
    }
    let lambert = e_n * 40f64.to_radians().cos() / PI;
    assert_glint("sun in a mirror, eq. 4.1", run(&plan, "printed"), (r, lambert), r, lambert * disk, 0.0);
    let frames = run(&plan, "lambert").render();
    assert_exact("sun in a mirror, eq. 3.11", pixels(&frames, 0).into_iter().map(|(l, _)| (l, lambert)));
}

/// A specular lobe of 1 msr, 15 times the sun's disk. As published it returns ρ E_n/Ω_s wherever the sun's centre
/// lies in it; conserving, the lobe's overlap with the disk. Both integrate to ρ E_n; the disk's solid angle is
/// 1/cos²(r/2) of Ω_sun, and the flat lens at the lobe's rim errs by (a + r)²/8 = 6e-5 at most.
#[test]
fn a_wide_glint_conserves_the_sun_it_reflects() {
    let plan = sun_mirror(
        "split { table [0 deg 0 0.3, 90 deg 0 0.3], specular reflectance, grazing hold, solid_angle 1 msr }",
        4.0,
        "experiment flag { algorithm split { reading corrected }, samples 1024 }
        experiment conserving { algorithm split { reading corrected, glint conserving }, samples 1024 }",
    );
    let (r, a) = (sun_radius(), (1.0 - 1e-3 / (2.0 * PI)).acos());
    let (e_n, wide) = (0.3 * 1500.0, (0.5 * r).cos().powi(-2));
    assert_glint("wide glint, a flag", run(&plan, "flag"), (a, e_n / 1e-3), a, e_n, 0.0);
    assert_glint(
        "wide glint, conserving",
        run(&plan, "conserving"),
        (a - r, e_n * wide / 1e-3),
        a + r,
        e_n * wide,
        6e-5,
    );
}

/// The lobe of a `split` material that names no solid angle is a mirror on every day of the year: in July, with the
/// disk smaller than at 1 au, the sun in it still has the sun's own radiance, as in a mirror of `ideal`.
#[test]
fn a_lobe_no_wider_than_the_disk_is_a_mirror_at_aphelion_too() {
    let plan = text(
        "site { latitude 43.0846 deg, longitude -77.6743 deg }
        collect { at 1992-07-03 13:14 -04:00 }
        atmosphere none { solar_irradiance 1500 W/m2/um }
        material mirror {
          ideal { specular 0.3 }
          split { table [0 deg 0 0.3, 90 deg 0 0.3], specular reflectance, grazing hold }
        }
        panel mirror size (100 100) m
        sensor eye {
          look_at (0 0 0) m, altitude 100 m, view_zenith 20.17 deg, view_azimuth 0.26 deg
          field_of_view 1 deg, pixels 16 x 16, band b 500..600 nm
        }
        experiment ideal { algorithm split { reading corrected }, reflectance ideal, samples 16 }
        experiment split { algorithm split { reading corrected }, reflectance split, samples 16 }",
    );
    let (ideal, split) = (run(&plan, "ideal").render(), run(&plan, "split").render());
    let level = pixels(&ideal, 0).into_iter().map(|(l, _)| l).fold(0.0, f64::max);
    let radius = run(&plan, "ideal").light(0).sun_radius;
    let distance = run(&plan, "ideal").moments[0].sun.unwrap().distance;
    assert!(distance > 1.016 && radius < sun_radius());
    assert_exact("sun in a mirror in July", [(level, 0.3 * 1500.0 / (PI * sun_radius().sin().powi(2)))]);
    assert_exact("default lobe in July", pixels(&split, 0).into_iter().zip(pixels(&ideal, 0)).map(|(s, i)| (s.0, i.0)));
}

// ---- furnaces

/// Everything white under a uniform sky of 100 returns 100 in every pixel, at any geometry.
#[test]
fn a_white_furnace_returns_its_sky_in_every_pixel() {
    let options = Options { pixels: Some((80, 60)), ..Options::default() };
    let plan = scene("examples/furnace/furnace.glint", &options);
    for run in plan.runs() {
        assert_exact(
            &format!("white furnace, {}", run.experiment),
            pixels(&run.render(), 0).into_iter().map(|(l, _)| (l, 100.0)),
        );
    }
}

/// A room 4 m wide with a hole of 1 m² in its roof, seen from inside.
fn room(white: &str, hole: bool, more: &str) -> Plan {
    let roof = if hole {
        "facet white (-2 -2 4) (-2 2 4) (-0.5 2 4) (-0.5 -2 4) m
        facet white (0.5 -2 4) (0.5 2 4) (2 2 4) (2 -2 4) m
        facet white (-0.5 -2 4) (-0.5 -0.5 4) (0.5 -0.5 4) (0.5 -2 4) m
        facet white (-0.5 0.5 4) (-0.5 2 4) (0.5 2 4) (0.5 0.5 4) m"
    } else {
        "facet white (-2 -2 4) (-2 2 4) (2 2 4) (2 -2 4) m"
    };
    text(&format!(
        "collect {{ sun none }}
        material white {{ {white} }}
        facet white (-2 -2 0) (2 -2 0) (2 2 0) (-2 2 0) m
        facet white (-2 -2 0) (-2 2 0) (-2 2 4) (-2 -2 4) m
        facet white (2 -2 0) (2 -2 4) (2 2 4) (2 2 0) m
        facet white (-2 -2 0) (-2 -2 4) (2 -2 4) (2 -2 0) m
        facet white (-2 2 0) (2 2 0) (2 2 4) (-2 2 4) m
        {roof}
        sensor inside {{
          position (-1.5 -1.6 1) m, look_at (1 1 2.5) m, field_of_view 100 deg, pixels 16 x 16, band b 500..600 nm
        }}
        {more}"
    ))
}

/// In a white room light enters by a small hole alone and is reflected some 90 times; walls that are diffuse, and
/// walls that are partly mirrors, under a sky that is taken as its mean or direction by direction.
#[test]
fn a_white_room_with_a_hole_is_a_furnace_too() {
    let whites = [
        ("diffuse", "ideal { diffuse 1 }"),
        ("with lobes", "split { table [0 deg 0.6 0.4, 90 deg 0.6 0.4], specular reflectance, grazing hold }"),
    ];
    for (name, white) in whites {
        let plan = room(
            white,
            true,
            "atmosphere none { solar_irradiance 0 W/m2/um, sky_radiance 100 W/m2/sr/um }
            experiment mean { algorithm split {
              reading corrected, depth unlimited, background_sky own, background_lobes all
            }, samples 16 }
            experiment directional { algorithm split {
              reading corrected, depth unlimited, background_sky own, background_lobes all, sky directional
            }, samples 16 }",
        );
        for run in plan.runs() {
            let frames = run.render();
            let per_path = (frames.rays.hemisphere + frames.rays.mirror) as f64 / f64::from(16 * 16 * 16);
            println!("bound   white room, {name}: {per_path:.0} reflections a path");
            assert!(per_path > 60.0, "{per_path} reflections a path");
            assert_exact(
                &format!("white room, {name}, {}", run.experiment),
                pixels(&frames, 0).into_iter().map(|(l, _)| (l, 100.0)),
            );
        }
    }
}

/// In a closed room whose walls all glow with L_e and reflect ρ, L = L_e (1 + ρ + ρ² + …) everywhere, whatever its
/// shape: the partial sum for any depth, and L_e/(1 − ρ) without a limit, where Russian roulette ends the paths.
#[test]
fn a_closed_glowing_room_sums_the_geometric_series() {
    let (l_e, rho) = (10.0, 0.7f64);
    let depths = [1, 2, 3, 8, 20];
    let mut more = "atmosphere none { solar_irradiance 0 W/m2/um }
        experiment unlimited { algorithm split { depth unlimited }, samples 1024 }
        experiment ideal { algorithm ideal { depth unlimited }, samples 1024 }\n"
        .to_string();
    for depth in depths {
        writeln!(more, "experiment depth_{depth} {{ algorithm split {{ depth {depth} }}, samples 16 }}")
            .expect("text grows");
    }
    let plan = room(&format!("emission {l_e} W/m2/sr/um, ideal {{ diffuse {rho} }}"), false, &more);
    for depth in depths {
        let expected = l_e * (1.0 - rho.powi(depth)) / (1.0 - rho);
        let seen = pixels(&run(&plan, &format!("depth_{depth}")).render(), 0);
        assert_exact(&format!("glowing room, depth {depth}"), seen.into_iter().map(|(l, _)| (l, expected)));
    }
    for name in ["unlimited", "ideal"] {
        let seen = pixels(&run(&plan, name).render(), 0);
        let triples = seen.into_iter().map(|(l, s)| (l, s, l_e / (1.0 - rho)));
        assert_sampled(&format!("glowing room, {name}"), Slack::default(), triples);
    }
}

/// Between two plates 1 m apart and 10⁵ m wide, of which the second glows with M₂, the first has B₁ = ρ₁ M₂/(1 −
/// ρ₁ρ₂). 4e-10 of each reflection leaves by the rim. A path of limited depth holds the terms of the series that it
/// reaches.
#[test]
fn two_wide_plates_exchange_the_series_of_their_reflections() {
    let (l_e, rho_1, rho_2) = (30.0, 0.8, 0.7f64);
    let depths = [1, 2, 3, 4, 6, 7];
    let mut experiments = "experiment unlimited { algorithm split { depth unlimited }, samples 1024 }\n".to_string();
    for depth in depths {
        writeln!(experiments, "experiment depth_{depth} {{ algorithm split {{ depth {depth} }}, samples 16 }}")
            .expect("text grows");
    }
    let plan = text(&format!(
        "collect {{ sun none }}
        atmosphere none {{ solar_irradiance 0 W/m2/um }}
        material first {{ ideal {{ diffuse {rho_1} }} }}
        material second {{ emission {l_e} W/m2/sr/um, ideal {{ diffuse {rho_2} }} }}
        panel first size (100000 100000) m
        panel second size (100000 100000) m at (0 0 1) m facing down
        {}
        {experiments}",
        map("between", [0.0, 0.0, 0.5], 1.0, [8, 8]),
    ));
    for depth in depths {
        // Every second surface is the glowing one.
        let terms = depth / 2;
        let expected = rho_1 * l_e * (0..terms).map(|k| (rho_1 * rho_2).powi(k)).sum::<f64>();
        let seen = pixels(&run(&plan, &format!("depth_{depth}")).render(), 0);
        assert_exact(&format!("two plates, depth {depth}"), seen.into_iter().map(|(l, _)| (l, expected)));
    }
    let seen = pixels(&run(&plan, "unlimited").render(), 0);
    let expected = rho_1 * l_e / (1.0 - rho_1 * rho_2);
    let slack = Slack { bound: 1e-8 * expected, grain: 0.0 };
    assert_sampled("two plates, depth unlimited", slack, seen.into_iter().map(|(l, s)| (l, s, expected)));
}

// ---- wavelengths

/// Two overlapping bands and a narrow one whose edges are corners: the band mean of E_s τ₁ ρ τ₂, four chains of
/// straight lines with corners at different wavelengths, is its exact integral. Where a reflectance is given per band
/// each band has its own, in the overlap too. `spectral band` multiplies means instead.
#[test]
fn band_radiance_is_the_exact_integral_of_the_product_of_straight_lines() {
    let chain = |rows: &[(f64, f64)]| Lines(rows.to_vec());
    let e_s = chain(&[(400.0, 1400.0), (463.0, 2050.0), (507.0, 1720.0), (600.0, 1810.0)]);
    let tau_1 = chain(&[(400.0, 0.50), (481.0, 0.71), (530.0, 0.64), (600.0, 0.83)]);
    let tau_2 = chain(&[(400.0, 0.60), (497.0, 0.88), (600.0, 0.81)]);
    let l_u = chain(&[(400.0, 40.0), (550.0, 9.0), (600.0, 6.0)]);
    let rho = chain(&[(400.0, 0.10), (455.0, 0.40), (512.0, 0.15), (600.0, 0.60)]);
    let bands = [((423.0, 517.0), 0.10), ((503.0, 581.0), 0.30), ((455.0, 463.0), 0.50)];
    let cos = 35f64.to_radians().cos() / PI;
    let plan = scene("tests/scenes/two_bands.glint", &Options::default());
    let mean = |one: &Lines, band| mean_of_product(&[one], band);
    let (mut exact, mut apart) = (Vec::new(), 0.0f64);
    for name in ["lines", "means", "steps"] {
        let frames = run(&plan, name).render();
        let pairs = bands.iter().enumerate().map(|(c, (band, step))| {
            let reflected = match name {
                "lines" => mean_of_product(&[&e_s, &tau_1, &rho, &tau_2], *band),
                "steps" => step * mean_of_product(&[&e_s, &tau_1, &tau_2], *band),
                _ => mean(&e_s, *band) * mean(&tau_1, *band) * mean(&rho, *band) * mean(&tau_2, *band),
            };
            (pixel(&frames, 0, c, 3).0, cos * reflected + mean(&l_u, *band))
        });
        let pairs: Vec<(f64, f64)> = pairs.collect();
        assert_exact(&format!("bands, {name}"), pairs.iter().copied());
        let reflected = pairs.iter().zip(bands).map(|((_, l), (band, _))| l - mean(&l_u, band)).collect::<Vec<f64>>();
        apart =
            apart.max(exact.iter().zip(&reflected).map(|(a, b): (&f64, &f64)| (b / a - 1.0).abs()).fold(0.0, f64::max));
        if name == "lines" {
            exact = reflected;
        }
    }
}

// ---- the equations of 1993, term by term

/// All terms of a pixel of `two_facets.glint` before τ₂, in the order of [`NAMES`].
type Terms = [f64; 6];

const NAMES: [&str; 6] =
    ["diffuse_sun", "diffuse_sky", "diffuse_background", "specular_sun", "specular_sky", "specular_background"];

/// What a sensor of `two_facets.glint` sees: view angle on the panel, zenith angle of the mirror direction \[deg\].
const VIEWS: [(&str, f64, f64); 3] = [("sky", 10.0, 50.0), ("sun", 20.0, 40.0), ("soil", 40.0, 100.0)];

/// A straight line over view angle from 0 to 90°.
fn line(at_0: f64, at_90: f64, degrees: f64) -> f64 {
    at_0 + (at_90 - at_0) * degrees / 90.0
}

/// R_b(θ_bt) of the soil.
fn soil(degrees: f64) -> f64 {
    line(0.40, 0.10, degrees)
}

/// Holds every term, the total and the quantities of `explain`, and the frame, to their values by hand.
fn assert_terms(claim: &str, plan: &Plan, experiment: &str, sensor: &str, expected: Terms) {
    let run = plan.run(experiment, sensor).expect("a run");
    let explained = explain(run, (2, 1), 0, &plan.materials);
    let clear = run.atmosphere_name == "none";
    let (tau_2, l_u) = if clear { (1.0, 0.0) } else { (0.8, 7.0) };
    let total: f64 = expected.iter().sum();
    let mut pairs: Vec<(f64, f64)> =
        NAMES.iter().zip(expected).map(|(name, value)| (term(&explained, 0, name), tau_2 * value)).collect();
    pairs.extend([
        (explained.bands[0].radiance, tau_2 * total + l_u),
        (term(&explained, 0, "surface_radiance"), total),
        (term(&explained, 0, "path_transmittance"), tau_2),
        (term(&explained, 0, "path_radiance"), l_u),
    ]);
    let frames = run.render();
    pairs.extend(pixels(&frames, 0).into_iter().map(|(l, _)| (l, tau_2 * total + l_u)));
    assert_exact(&format!("{claim}, {sensor}"), pairs);
}

/// Every term of eqs. 3.10, 3.11 and 4.1 as printed, and of their consistent reading, for a panel over soil with the
/// sky, the sun's centre and the soil in the mirror direction. R_s is a BRF, the height of a peak over Ω_s, or a
/// reflectance.
#[test]
fn every_term_of_the_published_equations_is_what_the_hand_computes() {
    let plan = scene("tests/scenes/two_facets.glint", &Options { times: vec![], ..Options::default() });
    let (e, l_sky, f) = (900.0, 110.0, 0.75);
    let (cos_t, cos_b) = (20f64.to_radians().cos(), 40f64.to_radians().cos());
    let omega_s = 0.020;
    let background = |f: f64, degrees: f64| (e * cos_b / PI + f * l_sky) * soil(degrees);
    for (sensor, view, mirror) in VIEWS {
        let (sun, below) = (sensor == "sun", sensor == "soil");
        let sky = if below { 0.0 } else { line(80.0, 140.0, mirror) };
        let bounce = |with_sky: f64| if below { background(with_sky, 80.0) } else { 0.0 };
        let diffuse = |r: f64, below: f64| [r * e * cos_t / PI, r * f * l_sky, r * (1.0 - f) * below];
        let join = |d: [f64; 3], s: [f64; 3]| [d[0], d[1], d[2], s[0], s[1], s[2]];

        // eq. 3.10: R(0°) as printed, R(θ_v) corrected; the background at 30°.
        for (name, r) in [("matt_published", 0.60), ("matt_corrected", line(0.60, 0.15, view))] {
            assert_terms(
                &format!("eq. 3.10, {name}"),
                &plan,
                name,
                sensor,
                join(diffuse(r, background(f, 30.0)), [0.0; 3]),
            );
        }
        // eq. 3.11: no mirror test for the sun and no sky on the background as printed.
        let r = line(0.30, 0.75, view);
        let printed = [r * e * cos_t / PI, r * sky, r * bounce(0.0)];
        assert_terms("eq. 3.11", &plan, "shiny_published", sensor, join([0.0; 3], printed));
        let corrected = [if sun { r * e / omega_sun() } else { 0.0 }, r * sky, r * bounce(f)];
        assert_terms("eq. 3.11 corrected", &plan, "shiny_corrected", sensor, join([0.0; 3], corrected));

        // eq. 4.1. Rows of the peak's table lie at the view angles; the diffuse part averages R_b(θ_bt) over what it
        // sees, so its background is held where R_b is fixed, and the rest here.
        let (r_d, peak) = match sensor {
            "sky" => (0.48, 28.0),
            "sun" => (0.46, 26.0),
            _ => (0.42, 22.0),
        };
        let rho_s = peak * omega_s * view.to_radians().cos() / PI;
        let seen_sun = if sun { 1.0 } else { 0.0 };
        let lobe = |sun: f64, r: f64| [seen_sun * sun, r * sky, r * bounce(f)];
        for (name, r_d, specular) in [
            ("peak_published", r_d, lobe(peak * e * cos_t / PI, peak)),
            ("peak_corrected", r_d, lobe(rho_s * e / omega_s, rho_s)),
            (
                "share_published",
                line(0.50, 0.14, view),
                lobe(line(0.10, 0.28, view) * e * cos_t / PI, line(0.10, 0.28, view)),
            ),
            (
                "share_corrected",
                line(0.50, 0.14, view),
                lobe(line(0.10, 0.28, view) * e / omega_s, line(0.10, 0.28, view)),
            ),
        ] {
            let run = plan.run(name, sensor).expect("a run");
            let explained = explain(run, (1, 2), 0, &plan.materials);
            let hand = join(diffuse(r_d, 0.0), specular);
            let pairs = NAMES.iter().zip(hand).filter(|(name, _)| **name != "diffuse_background");
            assert_exact(
                &format!("eq. 4.1, {name}, {sensor}"),
                pairs.map(|(name, value)| (term(&explained, 0, name), 0.8 * value)),
            );
        }
        // At θ_v = θ_s the two readings of the sun in a BRF peak are one number: R_s E cos/π = ρ_s E/Ω_s.
        assert!((peak * e * view.to_radians().cos() / PI / (rho_s * e / omega_s) - 1.0).abs() < 1e-14);

        // One approximation at a time, all on the corrected reading.
        let plain = lobe(rho_s * e / omega_s, rho_s);
        assert_terms("background_angle fixed", &plan, "fixed", sensor, join(diffuse(r_d, background(f, 30.0)), plain));
        let alone = [plain[0], plain[1], 0.0];
        assert_terms("depth 1", &plan, "depth_1", sensor, join(diffuse(r_d, 0.0), alone));
        let share = |name: &str, hand: Terms| {
            let explained = explain(plan.run(name, sensor).expect("a run"), (0, 0), 0, &plan.materials);
            let kept = NAMES.iter().zip(hand).filter(|(name, _)| **name != "diffuse_background");
            assert_exact(
                &format!("{name}, {sensor}"),
                kept.map(|(name, value)| (term(&explained, 0, name), 0.8 * value)),
            );
        };
        let wide = plain[0] / (0.5 * sun_radius()).cos().powi(2);
        share("conserving", join(diffuse(r_d, 0.0), [wide, plain[1], plain[2]]));
        // Lifted alone, on the equations as printed, the glint takes ρ_s of the lobe; sky and soil keep the printed
        // R_s.
        share("printed_conserving", join(diffuse(r_d, 0.0), [wide, peak * sky, peak * bounce(f)]));
        let mirrored = [corrected[0], printed[1], printed[2]];
        assert_terms("eq. 3.11, glint conserving", &plan, "shiny_conserving", sensor, join([0.0; 3], mirrored));
        share("own", join(diffuse(r_d, 0.0), [plain[0], plain[1], rho_s * bounce(1.0)]));
        // Level soil sees no third surface.
        share("depth_3", join(diffuse(r_d, 0.0), plain));

        // The sky behind F by direction: the overcast law on the tilted panel and in the mirror; for the soil the
        // panel's own part of the sky (F of the target), or all of it, 7π/9 L₀.
        let (l_0, b) = (90.0, 60f64.to_radians());
        let tilted = l_0 * (PI * f + 4.0 / 3.0 * (b.sin() + (PI - b) * b.cos())) / (3.0 * PI);
        let overcast = if below { 0.0 } else { l_0 * (1.0 + 2.0 * mirror.to_radians().cos()) / 3.0 };
        for (name, skylight) in [("directional", tilted), ("directional_own", 7.0 / 9.0 * l_0)] {
            let lit = |degrees: f64| (e * cos_b / PI + skylight) * soil(degrees);
            let diffuse = [r_d * e * cos_t / PI, r_d * tilted, r_d * (1.0 - f) * lit(30.0)];
            let specular = [plain[0], rho_s * overcast, if below { rho_s * lit(80.0) } else { 0.0 }];
            assert_terms(name, &plan, name, sensor, join(diffuse, specular));
        }
    }
}

/// The quantities that `explain` lists beside the terms are those of the scene: E_s, τ₁, L_dsky, F, I, R_d and ρ_s at
/// the view angle, and what stands in the mirror direction.
#[test]
fn explain_lists_the_quantities_of_the_equations() {
    let plan = scene("tests/scenes/two_facets.glint", &Options::default());
    for (sensor, view, mirror) in VIEWS {
        let run = plan.run("share_corrected", sensor).expect("a run");
        for (time, incidence) in [20.0, 100.0].into_iter().enumerate() {
            let explained = explain(run, (3, 3), time, &plan.materials);
            let open = sensor != "soil";
            let quantities = [
                ("solar_irradiance", 1500.0),
                ("sun_transmittance", 0.6),
                ("mean_sky_radiance", 110.0),
                ("path_transmittance", 0.8),
                ("path_radiance", 7.0),
                ("sky_view_factor", 0.75),
                ("sun_visible", if time == 0 { 1.0 } else { 0.0 }),
                ("diffuse", line(0.50, 0.14, view)),
                ("specular", line(0.10, 0.28, view)),
                ("bounce_transmittance", if open { 1.0 } else { 0.0 }),
                ("sky_radiance", if open { line(80.0, 140.0, mirror) } else { 0.0 }),
                ("sun_incidence_deg", incidence),
            ];
            assert_exact(
                &format!("explain, {sensor}"),
                quantities.map(|(name, value)| (term(&explained, 0, name), value)),
            );
            let hit = explained.hit.expect("the panel is hit");
            assert_eq!((hit.material.as_str(), hit.object.as_str()), ("target", "scene"));
        }
    }
}

/// With the sun behind the panel I_t cos θ_s = 0; the mirror still shows soil in full sun, 28 m before the panel.
#[test]
fn a_panel_turned_from_the_sun_still_mirrors_soil_in_the_sun() {
    let plan = scene("tests/scenes/two_facets.glint", &Options::default());
    let (e, r) = (900.0, line(0.30, 0.75, 40.0));
    let sunlit = e * 40f64.to_radians().cos() / PI * soil(80.0);
    for (name, skylight) in [("shiny_published", 0.0), ("shiny_corrected", 0.75 * 110.0 * soil(80.0))] {
        let frames = plan.run(name, "soil").expect("a run").render();
        assert_exact(
            &format!("sun behind the panel, {name}"),
            pixels(&frames, 1).into_iter().map(|(l, _)| (l, 0.8 * r * (sunlit + skylight) + 7.0)),
        );
    }
}

/// Seen at its actual angle the soil reflects the mean of R_b(θ_bt) over what the panel sees below the horizon,
/// weighted by the cosine on the panel. θ from the nadir has the density sin θ [sin β sin θ sin φ₀ − φ₀ cos β cos θ],
/// cos φ₀ = cot β cot θ; for an upright panel the mean angle is π/4 + 1/π.
#[test]
fn the_background_at_its_actual_angle_is_the_mean_over_the_lune_below_the_horizon() {
    let mean_angle = |beta: f64| {
        // Midpoint rule in a variable that makes the lune's edge smooth.
        let (start, n) = (0.5 * PI - beta, 200_000);
        let (mut sum, mut weighted) = (0.0, 0.0);
        for i in 0..n {
            let t = (f64::from(i) + 0.5) / f64::from(n);
            let theta: f64 = start + beta * t * t;
            let phi = (1.0 / (beta.tan() * theta.tan())).clamp(-1.0, 1.0).acos();
            let density = theta.sin() * (beta.sin() * theta.sin() * phi.sin() - phi * beta.cos() * theta.cos()) * t;
            sum += density;
            weighted += density * theta;
        }
        weighted / sum
    };
    assert!((mean_angle(0.5 * PI) - (0.25 * PI + 1.0 / PI)).abs() < 1e-9);
    let plan = scene("tests/scenes/two_facets.glint", &Options::default());
    let mean_soil = soil(mean_angle(60f64.to_radians()).to_degrees());
    let (e, f, r_d) = (900.0, 0.75, 0.48);
    let rho_s = 28.0 * 0.020 * 10f64.to_radians().cos() / PI;
    let others = r_d * (e * 20f64.to_radians().cos() / PI + f * 110.0) + rho_s * line(80.0, 140.0, 50.0);
    let background = r_d * (1.0 - f) * (e * 40f64.to_radians().cos() / PI + f * 110.0) * mean_soil;
    // `ideal` on a matt panel, and `split` with a peak beside its diffuse part.
    let r = line(0.60, 0.15, 10.0);
    let matt = r * (e * 20f64.to_radians().cos() / PI + f * 110.0) + r / r_d * background;
    for (name, leaving) in [("actual", others + background), ("matt_actual", matt)] {
        let expected = 0.8 * leaving + 7.0;
        let seen = pixels(&plan.run(name, "sky").expect("a run").render(), 0);
        let triples = seen.into_iter().map(|(l, s)| (l, s, expected));
        assert_sampled(&format!("background at its actual angle, {name}"), Slack::default(), triples);
    }
}

// ---- mirrors, and rays that are not cast

/// A level mirror shows a wall in two greys, both seen in the panel: ρ ρ_w (E cos θ_b/π + ½ L_sky) at noon and ρ ρ_w
/// ½ L_sky at midnight, the wall's own half of the sky taken by slope, or found by rays.
#[test]
fn a_mirror_shows_both_greys_of_a_wall() {
    let plan = scene("tests/scenes/two_tone_wall.glint", &Options::default());
    let (rho, e, l_sky) = (0.8, 1500.0, 60.0);
    let beam = e * 50f64.to_radians().sin() / PI;
    for name in ["exact", "ideal", "rays"] {
        let run = run(&plan, name);
        let frames = run.render();
        // Pixels wholly on the mirror: facet 2 of the scene; what they show is light in the west and dark in the east.
        let whole: Vec<(usize, f64)> = (0..64 * 48)
            .filter_map(|i| {
                let (x, y) = ((i % 64) as f64, (i / 64) as f64);
                let corners =
                    [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|(a, b)| run.camera.ray(x + a, y + b));
                let points = corners.map(|ray| {
                    let at = sunglint::geometry::Ray::new(ray.origin, ray.direction);
                    at.at(-ray.origin.z / ray.direction.cos_zenith())
                });
                let on = |p: &DVec3| p.x.abs() < 1.999 && p.y > 1.001 && p.y < 8.999;
                let west = points.iter().all(|p| p.x < -1e-6);
                let east = points.iter().all(|p| p.x > 1e-6);
                (points.iter().all(on) && (west || east)).then_some((i, if west { 0.6 } else { 0.2 }))
            })
            .collect();
        let greys = [0.6, 0.2].map(|grey| whole.iter().filter(|(_, g)| *g == grey).count());
        assert!(greys.iter().all(|n| *n > 100), "{greys:?}");
        for (time, sunlit) in [beam, 0.0].into_iter().enumerate() {
            let expected = |grey: f64| rho * grey * (sunlit + 0.5 * l_sky);
            let claim = format!("two greys in a mirror, {name}, {}", if time == 0 { "noon" } else { "midnight" });
            if name == "rays" {
                let triples = whole.iter().map(|(i, grey)| (pixel(&frames, time, 0, *i), expected(*grey)));
                let slack = Slack { bound: 0.0, grain: rho * 0.6 * l_sky / 1024.0 };
                assert_sampled(&claim, slack, triples.map(|((l, s), e)| (l, s, e)));
            } else {
                assert_exact(&claim, whole.iter().map(|(i, grey)| (pixel(&frames, time, 0, *i).0, expected(*grey))));
            }
        }
    }
}

/// A mirror at 45° shows another at 45° that shows the sky behind: ρ² L(60°) of the overcast law, if the background
/// reflects with all its lobes; else a mirror in a mirror is black.
#[test]
fn a_mirror_in_a_mirror_shows_the_sky_once_more() {
    // Sight: straight down onto a mirror that turns it north, level; the second, 5 m on, turns it up by 30° from the
    // zenith.
    let plan = text(&format!(
        "collect {{ sun none }}
        atmosphere none {{ solar_irradiance 0 W/m2/um, sky_radiance 90 W/m2/sr/um, sky overcast }}
        material first {{ ideal {{ specular 0.7 }} }}
        material second {{ ideal {{ specular 0.6 }} }}
        panel first size (2 2) m at (0 0 5) m slope 45 deg aspect 0 deg
        panel second size (2 2) m at (0 5 5) m slope 60 deg aspect 180 deg
        {}
        experiment all {{ algorithm split {{ reading corrected, background_lobes all, depth 3 }}, samples 16 }}
        experiment two {{ algorithm split {{ reading corrected, background_lobes all, depth 2 }}, samples 16 }}
        experiment diffuse {{ algorithm split {{ reading corrected, depth 3 }}, samples 16 }}",
        map("above", [0.0, 0.0, 20.0], 0.5, [4, 4]),
    ));
    // The level ray meets a normal at 30° of elevation and leaves at 60° of elevation, zenith angle 30°.
    let sky = 90.0 * (1.0 + 2.0 * 30f64.to_radians().cos()) / 3.0;
    for (name, expected) in [("all", 0.7 * 0.6 * sky), ("two", 0.0), ("diffuse", 0.0)] {
        let frames = run(&plan, name).render();
        assert_exact(
            &format!("mirror in a mirror, {name}"),
            pixels(&frames, 0).into_iter().map(|(l, _)| (l, expected)),
        );
    }
}

/// Rays that cannot matter are not cast: no mirror ray from a surface without R_s, no ray to a sun that is down, none
/// over the hemisphere of a facet above whose plane nothing rises, and none to a sun that is proved to be seen.
#[test]
fn rays_that_cannot_matter_are_not_cast() {
    let facets = "material grey { ideal { diffuse 0.3 } }
        material mirror { ideal { specular 0.8 } }
        facet grey (-2 -1 0) (0 -1 0) (0 1 0) (-2 1 0) m\n";
    let both = format!("{facets} facet mirror (0 -1 0) (2 -1 0) (2 1 0) (0 1 0) m\n");
    let grey = format!("{facets} facet grey (0 -1 0) (2 -1 0) (2 1 0) (0 1 0) m\n");
    let box_ = "box grey size (0.5 0.5 0.5) m at (0 0.5 0) m\n";
    let (day, night) = ("collect { sun zenith 30 deg azimuth 90 deg }\n", "collect { sun none }\n");
    let rays = |world: &str, collect: &str| {
        let sky = "atmosphere none { sky_radiance 50 W/m2/sr/um }\n";
        let view = map("above", [0.0, 0.0, 10.0], 2.0, [2, 1]);
        let plan = text(&format!("{collect}{sky}{world}{view}experiment open {{ samples 64 }}"));
        plan.runs()[0].render().rays
    };
    // Two pixels of 64 samples, one on each facet, and the middle of each pixel for the truth maps.
    let open = rays(&grey, day);
    assert_eq!((open.camera, open.mirror, open.hemisphere, open.sun), (130, 0, 0, 0), "{open:?}");
    assert_eq!((open.sun_proved_clear, open.hemisphere_open), (128, 128), "{open:?}");
    let mirrored = rays(&both, day);
    assert_eq!((mirrored.mirror, mirrored.hemisphere), (64, 0), "only the mirror's samples: {mirrored:?}");
    let dark = rays(&both, night);
    assert_eq!((dark.sun, dark.sun_proved_clear, dark.sun_turned_away), (0, 0, 128), "{dark:?}");
    // A box between them: now the hemisphere and the sun have to be asked, save on the box's own top.
    let built = rays(&format!("{grey}{box_}"), day);
    assert!(built.hemisphere > 100 && built.sun > 100 && built.mirror == 0, "{built:?}");
    assert_eq!(rays(&format!("{grey}{box_}"), night).sun, 0);
}

// ---- the air between

/// Level paths of 1, 5 and 10 km: L = L₀ τ₂ + L_u per wavelength with the provider's own τ₂ and L_u, averaged last,
/// and the product `surface_radiance` is L₀. At the meteorological range a panel keeps 2 % of its contrast (within
/// the percent that gases take at 550 nm), and the air light of all three paths belongs to one horizon, L_u = L_h (1
/// − τ₂).
#[test]
fn a_level_path_through_a_scene_follows_koschmieder() {
    let plan = scene("tests/scenes/level_path.glint", &Options::default());
    let mut horizons = Vec::new();
    for (sensor, length) in [("near", 1000.0), ("middle", 5000.0), ("far", 10_000.0)] {
        let run = plan.run("koschmieder", sensor).expect("a run");
        let (light, n) = (&run.light(0), run.grid.len());
        let (mut tau_2, mut l_u) = (vec![0.0; n], vec![0.0; n]);
        let towards_sensor = WorldDir::new(DVec3::NEG_Y);
        let path = Sightline { target_height: 10.0, sensor_height: 10.0, length, towards_sensor };
        light.sky.path(&path, &mut tau_2, &mut l_u);
        let cos = light.sun.expect("a sun").dot(towards_sensor);
        let leaving: Vec<f64> =
            (light.beam.iter().zip(&light.mean_sky)).map(|(e, l)| 0.9 * (e * cos / PI + 0.5 * l)).collect();
        let fold = |spectrum: Vec<f64>| {
            let mut means = vec![0.0; run.channels.len()];
            run.channels.fold(&spectrum, &mut means);
            means
        };
        let at_sensor = fold((0..n).map(|i| leaving[i] * tau_2[i] + l_u[i]).collect());
        let (surface, air) = (fold(leaving), fold(l_u));
        let frames = run.render();
        let mut pairs = Vec::new();
        for c in 0..run.channels.len() {
            pairs.extend([(pixel(&frames, 0, c, 0).0, at_sensor[c]), (pixel(&frames, 0, c, 1).0, air[c])]);
            let surfaces = &frames.frames[0].surface[c];
            pairs.extend([(f64::from(surfaces[0]), surface[c]), (f64::from(surfaces[1]), 0.0)]);
        }
        // Between knots of the range, 2 % apart, a straight line in channel means errs by (0.02 Δβ s)²/8, Δβ what the
        // extinction varies within the channel: nothing in 2 nm, most where water absorbs.
        for (c, of_channel) in pairs.chunks(4).enumerate() {
            let bound = if c == 0 { 1e-6 } else { 2e-4 };
            for (found, expected) in of_channel {
                let off = if found == expected { 0.0 } else { (found / expected - 1.0).abs() };
                assert!(off <= bound, "level path of {length} m, channel {c}: {found} {expected} ({off:.1e} off)");
            }
        }
        let contrast = (pixel(&frames, 0, 0, 0).0 - pixel(&frames, 0, 0, 1).0) / surface[0];
        horizons.push(air[0] / (1.0 - contrast));
        let koschmieder = (-3.912 * length / 10_000.0).exp();
        println!("bound   contrast over {length} m: {contrast:.5}, Koschmieder {koschmieder:.5}");
        assert!((contrast / koschmieder - 1.0).abs() < 0.01, "{contrast} {koschmieder}");
    }
    let spread = horizons.iter().map(|h| (h / horizons[0] - 1.0).abs()).fold(0.0, f64::max);
    println!("bound   horizon radiance over three paths: {horizons:.4?}, spread {spread:.1e}");
    assert!(spread < 0.01, "{horizons:?}");
}

// ---- samples

/// Bits of everything that a run yields.
fn bits(frames: &Frames) -> Vec<u32> {
    let images = frames.frames.iter().flat_map(|f| f.radiance.iter().chain(&f.error).chain(&f.surface).chain([&f.lit]));
    images.chain(&frames.truth).chain([&frames.samples]).flatten().map(|v| v.to_bits()).collect()
}

/// The walled yard of `tests/scenes`, in an image of so many pixels.
fn courtyard([nx, ny]: [u32; 2], experiments: &str) -> Plan {
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/scenes/courtyard.glint");
    let view = format!(
        "sensor eye {{
          position (0 -5.5 12) m, look_at (0 0 0.5) m, field_of_view 30 deg, pixels {nx} x {ny}
          band red 600..750 nm
          band nir 740..1000 nm
        }}"
    );
    text(&format!("include \"{scene}\"\n{view}\n{experiments}"))
}

/// An error asked for over the image is kept: the root mean square of the stated errors, against the larger of the pixel and a
/// hundredth of the mean, and that of the true ones, at the worst of three times and two bands; and the mean stays unbiased. Asked
/// of every pixel the same takes several times the samples.
#[test]
fn an_error_over_the_image_is_kept_with_fewer_samples() {
    let plan = courtyard(
        [48, 36],
        "experiment reference { algorithm split { reading corrected, sun disk }, samples 4096, seed 5 }
        experiment over like reference { error 4 % over image, seed 6 }
        experiment each like reference { error 4 %, seed 6 }",
    );
    let [reference, over, each] = ["reference", "over", "each"].map(|name| run(&plan, name).render());
    let (mut stated, mut found) = (Vec::new(), Vec::new());
    for (frame, true_frame) in over.frames.iter().zip(&reference.frames) {
        for (c, image) in frame.radiance.iter().enumerate() {
            let n = image.len() as f64;
            let floor = 0.01 * image.iter().map(|l| f64::from(*l)).sum::<f64>() / n;
            let relative = |i: usize, value: f64| (value / f64::from(true_frame.radiance[c][i]).max(floor)).powi(2) / n;
            let off = |i: usize| f64::from(image[i]) - f64::from(true_frame.radiance[c][i]);
            stated.push((0..image.len()).map(|i| relative(i, f64::from(frame.error[c][i]))).sum::<f64>().sqrt());
            found.push((0..image.len()).map(|i| relative(i, off(i))).sum::<f64>().sqrt());
            let mean = (0..image.len()).map(off).sum::<f64>() / n;
            let squares = |errors: &[f32]| errors.iter().map(|s| f64::from(*s).powi(2)).sum::<f64>();
            let s = (squares(&frame.error[c]) + squares(&true_frame.error[c])).sqrt() / n;
            assert!(mean.abs() <= 4.0 * s, "mean off by {mean}, {s} stated");
        }
    }
    let worst = |of: &[f64]| of.iter().copied().fold(0.0, f64::max);
    let mean = |frames: &Frames| frames.samples.iter().sum::<f32>() / frames.samples.len() as f32;
    println!("asked 4 %: stated {stated:.4?}, found {found:.4?}; {} samples for {}", mean(&over), mean(&each));
    assert!((0.025..=0.045).contains(&worst(&stated)), "{stated:?}");
    assert!((0.025..=0.045).contains(&worst(&found)), "{found:?}");
    assert!(mean(&each) > 2.0 * mean(&over));
}

/// Samples that only tell what they see, beside others that are traced for them: bright slats high above dark soil, in every pixel an
/// edge and two lengths of air. Radiance, that of the surface, the sun-lit fraction and F keep the means of counted samples, all traced.
#[test]
fn samples_that_tell_a_facet_alone_keep_every_mean() {
    let slats = |i: i32| {
        let x = 80 * i + 7;
        format!("facet white ({x} -400 1500) ({} -400 1500) ({} 400 1500) ({x} 400 1500) m\n", x + 40, x + 40)
    };
    let slats: String = (-5..5).map(slats).collect();
    let plan = text(&format!(
        "site {{ latitude 43 deg, longitude -77 deg }}
        collect {{ at [1992-06-18 13:00 -04:00] }}
        weather {{ visibility 5 km }}
        atmosphere spectrl2
        material soil {{ ideal {{ diffuse 0.1 }} }}
        material white {{ ideal {{ diffuse 0.7 }} }}
        ground soil
        {slats}{}
        experiment counted {{
          algorithm full {{ depth 1 }}, samples 8192, seed 5, products [radiance, surface_radiance, truth]
        }}
        experiment asked like counted {{ error 0.15 % over image, seed 6 }}
        experiment cached like asked {{ algorithm full {{ depth 2, indirect cached }} }}
        experiment counted_cached like cached {{ samples 4096, seed 7 }}",
        map("above", [0.0, 0.0, 3000.0], 640.0, [16, 4]),
    ));
    for [by_all, by_some] in [["counted", "asked"], ["counted_cached", "cached"]] {
        let [all, some] = [by_all, by_some].map(|name| run(&plan, name).render());
        let n = all.samples.len() as f64;
        let rays = some.rays;
        let traced = rays.sun + rays.sun_turned_away + rays.sun_proved_clear + rays.sun_proved_shaded;
        let seen = rays.camera + rays.camera_proved;
        assert!(by_some == "cached" || traced * 10 < seen * 7, "{rays:?}");
        let mean = |image: &[f32]| image.iter().map(|v| f64::from(*v)).sum::<f64>() / n;
        let error =
            |frames: &Frames| frames.frames[0].error[0].iter().map(|s| f64::from(*s).powi(2)).sum::<f64>().sqrt() / n;
        let of = |frames: &Frames| {
            let frame = &frames.frames[0];
            [&frame.radiance[0], &frame.surface[0], &frame.lit, &frames.truth[8]].map(|image| mean(image))
        };
        let relative = error(&all).hypot(error(&some)) / of(&all)[0];
        println!(
            "{by_some}: {:.4?} by all, {:.4?} by {:.2} of them, {relative:.1e}",
            of(&all),
            of(&some),
            traced as f64 / seen as f64
        );
        assert!(relative < 1e-3 && of(&all)[0] - of(&all)[1] != 0.0);
        // Edges are the noise of all but F, of which each of 64 pixels asks 48 rays at least, √(0.98 · 0.02) = 0.14 apart.
        let bounds = [6.0 * relative; 3].into_iter().chain([4.0 * 0.14 / (64.0 * 48.0_f64).sqrt()]);
        for ((all, some), bound) in of(&all).into_iter().zip(of(&some)).zip(bounds) {
            assert!((some / all - 1.0).abs() < bound, "{by_some}: {some} {all}, {bound:.1e}");
        }
    }
}

/// A scene with shadows, corners, lobes and mirrors at three times yields the same bits on 1, 2 and 5 threads, and
/// every tile is what it is in whichever order tiles are rendered, under a fixed count of samples and under an asked
/// error.
#[test]
fn frames_do_not_depend_on_threads_or_on_the_order_of_tiles() {
    let plan = courtyard(
        [70, 50],
        "experiment counted {
          algorithm split { sun disk, depth 4, background_lobes all, sky directional }
          samples 16
        }
        experiment asked { algorithm split, error 8 % }
        experiment shared_out { algorithm split, error 8 % over image }
        experiment between_points { algorithm full { indirect cached }, samples 16 }
        experiment between_more { algorithm full { indirect cached }, error 5 % over image }",
    );
    for run in plan.runs() {
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            pool.install(|| run.render())
        };
        let (one, two, five) = (on(1), on(2), on(5));
        assert!(!run.experiment.contains("more") && run.experiment != "asked" || one.samples.iter().any(|n| *n > 16.0));
        assert!(bits(&one) == bits(&two) && bits(&one) == bits(&five), "{}", run.experiment);
        assert_eq!((one.rays, one.rays), (two.rays, five.rays));
        let (all, lit) = (run.tiles(), run.lit());
        assert!(all.len() == 6);
        for tile in all.iter().rev() {
            let result = lit.render_tile(*tile);
            let (w, n) = (tile.width as usize, (tile.width * tile.height) as usize);
            for (t, frame) in one.frames.iter().enumerate() {
                for (c, image) in frame.radiance.iter().enumerate() {
                    let layer = &result.radiance[(t * frame.radiance.len() + c) * n..][..n];
                    let same = (0..n).all(|i| {
                        let at = (tile.y as usize + i / w) * 70 + tile.x as usize + i % w;
                        layer[i].to_bits() == image[at].to_bits()
                    });
                    assert!(same, "{}: tile {tile:?} at time {t}", run.experiment);
                }
            }
        }
    }
}

/// The error map is honest: over pixels with non-zero variance and 20 seeds, |L − L_ref| ≤ t √(s² + s_ref²) holds in
/// 93–97 % at the two-sided 95 % point of Student's t, for a fixed count of samples and for one chosen by a discarded
/// pilot.
#[test]
fn the_stated_error_covers_the_true_one_in_95_of_100_pixels() {
    let mut said = "experiment reference {
          algorithm split { reading corrected, sun disk }
          samples 8192, seed 77
        }\n"
    .to_string();
    for seed in 1..=20 {
        for (name, accuracy) in [("counted", "samples 128"), ("asked", "error 2 %")] {
            writeln!(said, "experiment {name}_{seed} like reference {{ {accuracy}, seed {seed} }}")
                .expect("text grows");
        }
    }
    let plan = courtyard([16, 12], &said);
    let reference = run(&plan, "reference").render();
    for name in ["counted", "asked"] {
        let (mut inside, mut all) = (0u32, 0u32);
        let (mut sum, mut squares) = (0.0, 0.0);
        for seed in 1..=20 {
            let frames = run(&plan, &format!("{name}_{seed}")).render();
            for (frame, true_frame) in frames.frames.iter().zip(&reference.frames) {
                for c in 0..frame.radiance.len() {
                    for i in 0..frame.radiance[c].len() {
                        let s = f64::from(frame.error[c][i]);
                        if s == 0.0 {
                            continue;
                        }
                        let s = s.hypot(f64::from(true_frame.error[c][i]));
                        let off = f64::from(frame.radiance[c][i]) - f64::from(true_frame.radiance[c][i]);
                        all += 1;
                        inside += u32::from(off.abs() <= STUDENT_T_95 * s);
                        sum += off / s;
                        squares += (off / s).powi(2);
                    }
                }
            }
        }
        let share = f64::from(inside) / f64::from(all);
        let (mean, spread) = (sum / f64::from(all), (squares / f64::from(all)).sqrt());
        println!("covered {name}: {:.2} % of {all}; mean {mean:.3} s, root mean square {spread:.3} s", 100.0 * share);
        assert!((0.93..=0.97).contains(&share), "{name}: {share}");
    }
}
