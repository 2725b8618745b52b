//! Closed forms posed as scenes, through the whole path: text, check, plan, rays, light, channels.
//!
//! Where nothing is sampled the tolerance is 1e-6 relative: everything is computed in `f64`, frames keep `f32` (6e-8), and the
//! quadrature over a tilted facet's sky converges to 1e-7. Where rays are sampled it is 4 standard errors, as the frames
//! themselves state them. `cargo test --release --test analytic -- --nocapture` prints the deviations.

#[path = "analytic/pose.rs"]
mod pose;

use std::f64::consts::PI;
use std::fmt::Write;

use glam::DVec3;
use pose::{
    EXACT, assert_exact, assert_sampled, beyond_chord, map, pixel, pixels, run, scene, student_limit, term, text,
};
use sunglint::atmosphere::Path as Sightline;
use sunglint::radiometry::{STUDENT_T_95, WorldDir};
use sunglint::tracer::tiles;
use sunglint::{Frames, Options, Plan, Run, explain};

/// Angular radius of the sun's disk at 1 au \[rad\].
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

/// Panels tilted by β under the overcast law L = L₀ (1 + 2 cos θ)/3 and under a uniform sky, nothing below the horizon:
/// L = ρ E/π with E = (L₀/3) {π (1+cos β)/2 + (4/3) [sin β + (π − β) cos β]} and π L₀ (1+cos β)/2. `sky isotropic` takes
/// the mean sky, 7/9 L₀, behind F = (1+cos β)/2. Where something rises above the panel's plane (here a square millimetre
/// a kilometre away, which hides 1e-12 sr) the same comes from rays over the hemisphere.
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
            sampled[k].extend(seen.map(|(l, s)| (l, s, expected[k])).filter(|(_, s, _)| *s > 0.0));
        }
    }
    for ((claim, pairs), triples) in by_claim.into_iter().zip(sampled) {
        // The quadrature's own error is 1e-7 of L₀, whatever is left of the sky: compare against that scale.
        assert_exact(&format!("tilted panel, {claim}"), pairs.into_iter().map(|(l, e)| (l + rho * l_0, e + rho * l_0)));
        assert_sampled(&format!("tilted panel, {claim}"), 0.0, triples);
    }
    assert_exact("tilted panel, sky view factor", view_factors);
}

/// Level soil of albedo ρ_g under a uniform sky fills the panel's lower part with ρ_g L₀ F′, where F′ is the panel's own F
/// as published, and 1 once `background_sky own` takes the soil's (here by slope, so that no ray is thrown).
#[test]
fn a_tilted_panel_over_soil_sees_the_soil_below_the_horizon() {
    let (l_0, rho, soil) = (90.0, 0.5, 0.3);
    let sky = format!("atmosphere none {{ solar_irradiance 0 W/m2/um, sky_radiance {l_0} W/m2/sr/um }}");
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

/// A trench 1 m wide, `h` deep and 200 m long, open to the west–east sky by its width alone, with views of its floor and of
/// its eastern wall over their whole depth.
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

/// The sky seen from a long trench, by crossed strings: over the floor √(1+H²) − H, over a wall (1 + H − √(1+H²))/(2H), H
/// the depth in widths, and over every column of the floor or row of the wall in between. The strip that the 200 m leave open
/// at each end holds 2 H²/(π 100³) of a hemisphere, less than 6e-6 of what is expected.
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
        for (sensor, whole) in [("below", floor_mean(0.0, 1.0)), ("east", wall_mean(0.0, h))] {
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
            assert_sampled(&name, bound, seen.iter().enumerate().map(|(i, (l, s))| (*l, *s, rho * l_0 * expected(i))));
            let mean = |pick: fn(&(f64, f64)) -> f64| seen.iter().map(pick).sum::<f64>() / 64.0;
            let error = mean(|p| p.1 * p.1).sqrt() / 8.0;
            assert_sampled(&format!("{name}, whole"), bound, [(mean(|p| p.0), error, rho * l_0 * whole)]);
            // F in the truth maps is the same rays' share.
            let f = frames.truth[8].iter().map(|f| f64::from(*f)).sum::<f64>() / 64.0;
            assert!((f - mean(|p| p.0) / (rho * l_0)).abs() < 1e-6, "{name}: truth map {f}");
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

/// Glowing walls under a black sky light the floor with ρ (1 − F) L_e, whether one background point stands for all hits or
/// each for itself, with one ray a sample or four.
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
        let mean = seen.iter().map(|p| p.0).sum::<f64>() / 64.0;
        let error = (seen.iter().map(|p| p.1 * p.1).sum::<f64>()).sqrt() / 64.0;
        let expected = rho * l_e * (1.0 - f);
        assert_sampled(&format!("glowing walls, {name}"), 1e-6 * expected, [(mean, error, expected)]);
    }
}

/// Hottel's view factors between unit squares: facing each other at distance 1 (0.199825), and perpendicular with an edge in
/// common (0.200044). One glows, the other, seen from between them, returns ρ F L_e on the mean.
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
        let mean = seen.iter().map(|p| p.0).sum::<f64>() / 64.0;
        let error = (seen.iter().map(|p| p.1 * p.1).sum::<f64>()).sqrt() / 64.0;
        assert_sampled(&format!("unit squares {claim}"), 0.0, [(mean, error, rho * l_e * factor)]);
    }
}

// ---- the sun's disk

/// A straight edge h above level ground hides from a point at x the part of the sun's disk beyond a chord, (arccos u − u √(1−u²))/π
/// with u = x cos θ/(h sin r) across the edge: pixel by pixel through the penumbra, with the sun overhead and with the sun at
/// 30° along the edge. The chord's turn over a slanted ray and the change of cos θ over the disk come to 2e-5 of the full
/// irradiance. A point sun draws a step.
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
            2e-5 * full,
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

/// What a pixel of a mirror's image looks into: angles between the reflected ray and the sun, the least and largest over its
/// corners, and its solid angle.
fn reflected(run: &Run, i: usize) -> (f64, f64, f64) {
    let sun = run.light[0].sun.expect("a sun");
    let (x, y) = ((i % 48) as f64, (i / 48) as f64);
    let corners =
        [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|(a, b)| run.camera.ray(x + a, y + b).direction.vec());
    let apart = corners.map(|d| WorldDir::from_unit(DVec3::new(d.x, d.y, -d.z)).angle_to(sun));
    let (low, high) = apart.iter().fold((f64::INFINITY, 0.0), |(l, h), a| (f64::min(l, *a), f64::max(h, *a)));
    let [a, b, c, d] = corners;
    (low, high, 0.5 * ((c - a).cross(d - b)).length())
}

/// Holds an image of the sun to a level inside an angle about the mirrored sun, to 0 outside another, and its integral over
/// solid angle to a total.
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
    assert_sampled(&format!("{claim}, integral"), bound * total, [(sum, squares.sqrt(), total)]);
}

/// In the pixels of a mirror that see the sun's disk L = ρ E_n/Ω_sun, elsewhere what the black sky sends; the image
/// integrates to ρ E_n over the disk's solid angle, which is 1/cos²(r/2) of Ω_sun. As printed, eq. 4.1 shows R_s E cos θ_s/π in the
/// disk, and eq. 3.11, without a test of the mirror direction, ρ E cos θ_s/π everywhere.
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

/// A specular lobe of 1 msr, 15 times the sun's disk. As published it returns ρ E_n/Ω_s wherever the sun's centre lies in it;
/// conserving, the lobe's overlap with the disk. Both integrate to ρ E_n; the disk's solid angle is 1/cos²(r/2) of Ω_sun, and the
/// flat lens at the lobe's rim errs by (a + r)²/8 = 6e-5 at most.
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

/// The lobe of a `split` material that names no solid angle is a mirror on every day of the year: in June, with the disk smaller
/// than at 1 au, the sun in it still has the sun's own radiance, as in a mirror of `ideal`.
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
    let radius = run(&plan, "ideal").light[0].sun_radius;
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

/// In a white room light enters by a small hole alone and is reflected some 90 times; walls that are diffuse, and walls that are
/// partly mirrors, under a sky that is taken as its mean or direction by direction.
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
            let per_path = frames.rays.hemisphere as f64 / f64::from(16 * 16 * 16);
            assert!(per_path > 20.0, "{per_path} reflections a path");
            assert_exact(
                &format!("white room, {name}, {}", run.experiment),
                pixels(&frames, 0).into_iter().map(|(l, _)| (l, 100.0)),
            );
        }
    }
}

/// In a closed room whose walls all glow with L_e and reflect ρ, L = L_e (1 + ρ + ρ² + …) everywhere, whatever its shape: the
/// partial sum for any depth, and L_e/(1 − ρ) without a limit, where Russian roulette ends the paths.
#[test]
fn a_closed_glowing_room_sums_the_geometric_series() {
    let (l_e, rho) = (10.0, 0.7f64);
    let depths = [1, 2, 3, 8, 20];
    let mut more = "atmosphere none { solar_irradiance 0 W/m2/um }
        experiment unlimited { algorithm split { depth unlimited }, samples 1024 }\n"
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
    let seen = pixels(&run(&plan, "unlimited").render(), 0);
    assert_sampled("glowing room, depth unlimited", 0.0, seen.into_iter().map(|(l, s)| (l, s, l_e / (1.0 - rho))));
}

/// Between two plates 1 m apart and 10⁵ m wide, of which the second glows with M₂, the first has B₁ = ρ₁ M₂/(1 − ρ₁ρ₂). 4e-10 of
/// each reflection leaves by the rim. A path of limited depth holds the terms of the series that it reaches.
#[test]
fn two_wide_plates_exchange_the_series_of_their_reflections() {
    let (l_e, rho_1, rho_2) = (30.0, 0.8, 0.7);
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
    assert_sampled("two plates, depth unlimited", 1e-8 * expected, seen.into_iter().map(|(l, s)| (l, s, expected)));
}
