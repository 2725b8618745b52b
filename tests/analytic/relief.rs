//! Terrain, round shapes, files of placements and scatters.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};
use sunglint::radiometry::WorldDir;

use crate::pose::{assert_exact, map, pixels, run, text, whole};

/// A file beside no scene, named in full.
fn file(folder: &tempfile::TempDir, name: &str, content: &str) -> String {
    let path = folder.path().join(name);
    std::fs::write(&path, content).expect("the file is written");
    path.to_str().expect("a path of text").replace('\\', "/")
}

/// A grid of 11 × 9 posts, 5 m apart from (−25 −20), on the plane z = 7 + a x + b y.
fn slope(folder: &tempfile::TempDir, a: f64, b: f64) -> String {
    let row = |j: i32| {
        let z = |i: i32| format!("{}", 7.0 + a * f64::from(5 * i - 25) + b * f64::from(20 - 5 * j));
        (0..11).map(z).collect::<Vec<_>>().join(",")
    };
    let text: String = (0..9).map(|j| row(j) + "\n").collect();
    file(folder, &format!("slope_{a}_{b}.csv"), &text)
}

const TERRAIN: &str = "origin (-25 -20) m, spacing 5 m, material grey";

/// Sun at s on a tilted Lambert plane of posts, no air: L = ρ E₀ n·s/π in every pixel, at any tilt that the sun sees.
#[test]
fn a_tilted_terrain_returns_rho_e0_cos_theta_over_pi() {
    let (e_0, rho, folder) = (1850.0, 0.3, tempfile::tempdir().expect("a folder"));
    let sun = WorldDir::from_zenith_azimuth(40f64.to_radians(), 200f64.to_radians()).vec();
    let mut pairs = Vec::new();
    for (a, b) in [(0.0, 0.0), (0.2, 0.1), (-0.4, 0.0), (0.3, -0.6), (0.0, 0.9)] {
        let plan = text(&format!(
            "collect {{ sun zenith 40 deg azimuth 200 deg }}
            atmosphere none {{ solar_irradiance {e_0} W/m2/um }}
            material grey {{ ideal {{ diffuse {rho} }} }}
            terrain \"{}\" {{ {TERRAIN} }}
            experiment a {{ algorithm ideal, samples 64 }}
            {}",
            slope(&folder, a, b),
            map("above", [2.0, 1.0, 90.0], 20.0, [4, 3]),
        ));
        let normal = DVec3::new(-a, -b, 1.0).normalize();
        let expected = rho * e_0 * normal.dot(sun).max(0.0) / PI;
        pairs.extend(pixels(&run(&plan, "a").render(), 0).into_iter().map(|(found, _)| (found, expected)));
    }
    assert_exact("tilted terrain", pairs);
}

/// The radiance of a Lambert sphere over the plane across the line of sight, at phase α:
/// ∫ L dA = (2/3) ρ E₀ r² [sin α + (π − α) cos α]/π [Russell1916], to the (π/N)² by which its facets deviate.
#[test]
fn a_sphere_has_the_phase_function_of_lambert() {
    let (e_0, rho, r, side) = (1850.0, 0.7, 1.25, 3.0);
    for sides in [16, 32, 128] {
        for alpha in [0.0, 30.0, 60.0, 85.0f64] {
            let plan = text(&format!(
                "collect {{ sun zenith {alpha} deg azimuth 77 deg }}
                atmosphere none {{ solar_irradiance {e_0} W/m2/um }}
                material white {{ ideal {{ diffuse {rho} }} }}
                sphere white radius {r} m sides {sides} at (4 -3 6) m heading 20 deg pitch 10 deg roll 35 deg
                experiment a {{ algorithm split {{ background_sky own }}, samples 64 }}
                {}",
                map("above", [4.0, -3.0, 20.0], side, [48, 48]),
            ));
            let (mean, error) = whole(&pixels(&run(&plan, "a").render(), 0));
            let a = alpha.to_radians();
            let expected = 2.0 / 3.0 * rho * e_0 * r * r * (a.sin() + (PI - a) * a.cos()) / PI;
            let bound = (PI / f64::from(sides)).powi(2);
            let off = (mean * side * side - expected) / expected;
            println!("sphere of {sides} sides at phase {alpha}°: off by {off:.1e}, stated {bound:.1e}");
            assert!(off.abs() < bound + 4.0 * error * side * side / expected, "{sides} sides at {alpha}°: {off}");
        }
    }
}

/// Disks and the tops of cylinders show πr² whatever their sides, here as the share of glowing pixels.
#[test]
fn disks_and_cylinders_show_the_area_of_their_circle() {
    let (r, side) = (1.0, 2.5);
    for sides in [3, 5, 32] {
        for shape in
            ["disk glow radius 1 m SIDES at (0 0 1) m", "cylinder glow radius 1 m height 2 m SIDES at (0 0 0) m"]
        {
            let plan = text(&format!(
                "collect {{ sun none }}
                atmosphere none {{ solar_irradiance 0 W/m2/um }}
                material glow {{ ideal {{ diffuse 0 }}, emission 10 W/m2/sr/um }}
                {}
                experiment a {{ algorithm ideal, samples 64 }}
                {}",
                shape.replace("SIDES", &format!("sides {sides}")),
                map("above", [0.0, 0.2, 20.0], side + 1.0, [64, 64]),
            ));
            let (mean, error) = whole(&pixels(&run(&plan, "a").render(), 0));
            let (found, sigma) = (mean / 10.0 * (side + 1.0f64).powi(2), error / 10.0 * (side + 1.0f64).powi(2));
            assert!((found - PI * r * r).abs() < 4.0 * sigma + 1e-6, "{shape} {sides}: {found} ± {sigma}");
        }
    }
}

/// Black leaves at random over a glowing floor, seen from above: the light that comes through is the probability of a gap,
/// (1 − G a/A)^N for N leaves of area a over A, close to the exp(−G LAI) of a random canopy [Ross1981], with
/// G = ∫ g(θ) cos θ dθ for each class: 1/2, 2/π, 8/3π, 4/3π, 32/15π, 28/15π. A leaf covers 8e-3 m² of the 49 m² seen,
/// so 6e3 leaves count: 4 standard errors are at most 2 √(1/6e3) = 0.026.
#[test]
fn a_scattered_canopy_has_the_gap_fraction_of_its_leaf_angles() {
    let classes = [
        ("spherical", 0.5),
        ("uniform", 2.0 / PI),
        ("planophile", 8.0 / (3.0 * PI)),
        ("erectophile", 4.0 / (3.0 * PI)),
        ("plagiophile", 32.0 / (15.0 * PI)),
        ("extremophile", 28.0 / (15.0 * PI)),
    ];
    let (n, r) = (20_000, 0.05);
    for (name, g) in classes {
        let plan = text(&format!(
            "collect {{ sun none }}
            atmosphere none {{ solar_irradiance 0 W/m2/um }}
            material glow {{ ideal {{ diffuse 0 }}, emission 10 W/m2/sr/um }}
            material black {{ ideal {{ diffuse 0 }} }}
            ground glow
            object leaf {{ disk black radius {r} m sides 8 }}
            object canopy {{ scatter leaf count {n} within box size (10 10 3) m orientation {name} }}
            place canopy at (0 0 4) m
            experiment a {{ algorithm ideal, samples 16 }}
            {}",
            map("above", [0.0, 0.0, 30.0], 7.0, [64, 64]),
        ));
        let (mean, error) = whole(&pixels(&run(&plan, "a").render(), 0));
        let expected = (1.0 - g * PI * r * r / 100.0).powi(n);
        println!("{name}: gaps {:.4} ± {:.4}, expected {expected:.4}", mean / 10.0, error / 10.0);
        assert!((mean / 10.0 - expected).abs() < 0.026, "{name}: {} for {expected}", mean / 10.0);
        assert_eq!(run(&plan, "a").scenery.world.instances().len(), 1, "the leaves are one mesh");
    }
}

/// Trees scattered over a hillside, a surveyed list without heights, and single things: each foot on the plane, and the
/// members of a rectangle turned by 30° inside it. Where the terrain ends the ground goes on.
#[test]
fn everything_stands_on_the_terrain() {
    let folder = tempfile::tempdir().expect("a folder");
    let survey = file(&folder, "survey.csv", "x_m,y_m,heading_deg,scale\n-3,4,90,2\n6,-2,0,1\n40,0,0,1\n");
    let plan = text(&format!(
        "collect {{ sun none }}
        atmosphere none {{ solar_irradiance 0 W/m2/um }}
        material grey {{ ideal {{ diffuse 0.5 }} }}
        object tree {{ cone grey radius 1 m height 3 m sides 8 }}
        terrain \"{}\" {{ {TERRAIN} }}
        ground grey height -50 m
        scatter tree count 300 within rectangle size (20 10) m at (2 1) m heading 30 deg scale 0.5..2 spacing 0.3 m
        place tree from \"{survey}\" at (1 1 0.25) m heading 10 deg scale 3
        place tree as lone at (3 3) m
        experiment a {{ algorithm ideal, samples 16 }}
        {}",
        slope(&folder, 0.2, -0.1),
        map("above", [0.0, 0.0, 60.0], 20.0, [2, 2]),
    ));
    let world = &run(&plan, "a").scenery.world;
    let height = |at: DVec3| 7.0 + 0.2 * at.x - 0.1 * at.y;
    let trees: Vec<_> = world.instances().iter().filter(|i| i.name.starts_with("tree") || i.name == "lone").collect();
    assert_eq!(trees.len(), 304);
    for tree in &trees[..300] {
        let at = tree.pose.translation;
        assert!((at.z - height(at)).abs() < 1e-9, "{at}");
        let (s, c) = 30f64.to_radians().sin_cos();
        let d = at.truncate() - DVec2::new(2.0, 1.0);
        let own = DVec2::new(c * d.x - s * d.y, s * d.x + c * d.y);
        assert!(own.x.abs() <= 10.0 && own.y.abs() <= 5.0, "{own}");
        let scale = tree.pose.matrix3.z_axis.z;
        assert!((0.5..=2.0).contains(&scale));
        let ahead = tree.pose.matrix3 * DVec3::Y / scale;
        assert!((ahead - DVec3::new(s, c, 0.0)).length() < 1e-12);
    }
    let [first, second, beyond] = [0, 1, 2].map(|i| trees[300 + i].pose);
    assert!((first.translation - DVec3::new(-2.0, 5.0, height(DVec3::new(-2.0, 5.0, 0.0)) + 0.25)).length() < 1e-9);
    let ahead = 100f64.to_radians();
    assert!((first.matrix3 * DVec3::Y - 6.0 * DVec3::new(ahead.sin(), ahead.cos(), 0.0)).length() < 1e-12);
    assert!((second.matrix3.determinant() - 27.0).abs() < 1e-9);
    assert_eq!(beyond.translation, DVec3::new(41.0, 1.0, -49.75));
    assert!((trees[303].pose.translation.z - height(DVec3::new(3.0, 3.0, 0.0))).abs() < 1e-9);
    let names: Vec<&str> = run(&plan, "a").objects.iter().map(|ids| ids.name.as_str()).collect();
    assert!(names.contains(&"tree.300") && names.last() == Some(&"terrain"), "{:?}", names.last());
}
