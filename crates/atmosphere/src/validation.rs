//! The solved column against independent codes, where the comparison needs what lies behind the trait.

use std::f64::consts::{FRAC_PI_2, PI};
use std::fmt::Write as _;
use std::sync::Arc;

use sunglint_radiometry::{SpectralGrid, WorldDir};

use crate::column_sky::{self, ColumnAir, Settings};
use crate::medium::{Layer, Medium, Strata};
use crate::phase::Phase;
use crate::radiance::{Lattice, Look, Optics, Sight, SunRays, gather_ground, solve_entry};
use crate::ray::Shells;
use crate::strata::Site;
use crate::{Cloud, Column, Needs, Path, SkyState, Sun};

/// Data rows of a CSV with comments and a header.
fn records(text: &str) -> Vec<Vec<String>> {
    let mut reader = csv::ReaderBuilder::new().comment(Some(b'#')).from_reader(text.as_bytes());
    reader.records().map(|row| row.unwrap().iter().map(str::to_string).collect()).collect()
}

fn number(cell: &str) -> f64 {
    cell.parse().unwrap()
}

/// The worst of what was compared in a class, and where.
#[derive(Default)]
struct Worst(std::collections::BTreeMap<String, (f64, f64, usize, String)>);

impl Worst {
    fn add(&mut self, class: String, error: f64, place: impl FnOnce() -> String) {
        let entry = self.0.entry(class).or_default();
        (entry.1, entry.2) = (entry.1 + error * error, entry.2 + 1);
        if error.abs() > entry.0.abs() {
            (entry.0, entry.3) = (error, place());
        }
    }

    fn print(&self, title: &str) {
        eprintln!("{title}: class, worst, root mean square, cases, where the worst is");
        for (class, (worst, squares, n, place)) in &self.0 {
            eprintln!("  {class}: {:+.3} %, {:.3} %, {n}, {place}", 100.0 * worst, 100.0 * (squares / *n as f64).sqrt());
        }
    }
}

/// Radiance of light scattered once against SASKTRAN2 in the same shells, from the ground and from space. The haze's
/// moments beyond the 64th are nothing, so that delta-M changes no depth; air needs no more than the 16 streams that are
/// the default.
#[test]
fn light_scattered_once_in_shells_is_that_of_sasktran2() {
    let columns = records(include_str!("../tests/data/spherical_columns.csv"));
    let rows = records(include_str!("../tests/data/spherical_single_scattering.csv"));
    let mut worst = Worst::default();
    for (name, streams) in [("rayleigh_0.1", 16), ("rayleigh_0.36", 16), ("hazy", 64)] {
        let shells: Vec<&Vec<String>> = columns.iter().filter(|row| row[0] == name).rev().collect();
        let mut heights: Vec<f64> = shells.iter().map(|row| number(&row[2])).collect();
        heights.push(0.0);
        let strata = Strata { refractivity: vec![0.0; heights.len()], heights, radius: 6_371_000.0 };
        let layers = shells.iter().map(|row| (number(&row[3]), number(&row[4])));
        let layers = layers.map(|(air, haze)| match name {
            "hazy" => Layer { absorption: 0.05 * haze, scattering: vec![air, 0.95 * haze] },
            _ => Layer { absorption: 0.0, scattering: vec![air] },
        });
        let mut phases = vec![Arc::new(Phase::rayleigh(0.0))];
        if name == "hazy" {
            phases.push(Arc::new(Phase::henyey_greenstein(0.7)));
        }
        let medium = Medium { layers: layers.collect(), phases };
        let shells = Shells::new(&strata, true);
        let optics = Optics::new(&medium, &shells, streams);
        let lattice = Lattice::new(&shells, &optics);
        for sun_deg in ["30.0", "60.0", "75.0", "85.0", "88.0"] {
            let sun = number(sun_deg).to_radians();
            let rays = Arc::new(SunRays::new(&shells, &lattice, sun, true));
            let (lit, _) = solve_entry(&optics, &[rays], true, 1e-3);
            for row in rows.iter().filter(|row| row[0] == name && row[1] == sun_deg) {
                let (view, dphi, due) = (number(&row[3]).to_radians(), number(&row[4]).to_radians(), number(&row[5]));
                let up = row[2] == "up";
                let (look, azimuth) = if up { (Look::Down, PI - dphi) } else { (Look::Up, dphi) };
                let sight = Sight::new(&shells, &lattice, (0.0, view), (shells.top(), f64::INFINITY), streams, 0);
                let once = lit[0].gather(&optics, &sight, look, sun, azimuth).once;
                let level = if up { -view.cos() * sun.cos() } else { view.cos() * sun.cos() };
                let cos = level + view.sin() * sun.sin() * dphi.cos();
                let found: f64 = once.iter().zip(&medium.phases).map(|(k, phase)| k * phase.value(cos)).sum();
                let place = || format!("{row:?}: {found:.6e}");
                worst.add(format!("view {:>4} {:>4}", row[3], row[2]), found / due - 1.0, place);
                worst.add(format!("sun {:>4} {:>4}, view to 85", sun_deg, row[2]), match number(&row[3]) <= 85.0 {
                    true => found / due - 1.0,
                    false => 0.0,
                }, place);
            }
        }
    }
    worst.print("single scattering in shells against SASKTRAN2");
    for (class, (error, _, _, place)) in &worst.0 {
        let most = if class.contains("view 8") && !class.contains("85") && !class.contains("80") { 0.03 } else { 0.01 };
        assert!(error.abs() < most, "{class}: {error:+.4} at {place}");
    }
}
