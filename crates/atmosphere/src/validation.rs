//! The solved column against independent codes, where the comparison needs what lies behind the trait.

use std::f64::consts::{FRAC_PI_2, PI};
use std::fmt::Write as _;
use std::sync::Arc;

use sunglint_radiometry::{SpectralGrid, WorldDir};

use crate::column_sky::{self, ColumnAir, Settings};
use crate::ladder::Ladder;
use crate::medium::{Layer, Medium, Strata};
use crate::phase::Phase;
use crate::radiance::{Gathered, Look, Optics, Probe};
use crate::ray::Shells;
use crate::solver::Cut;
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
            eprintln!(
                "  {class}: {:+.3} %, {:.3} %, {n}, {place}",
                100.0 * worst,
                100.0 * (squares / *n as f64).sqrt()
            );
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
        for sun_deg in ["30.0", "60.0", "75.0", "85.0", "88.0"] {
            let sun = number(sun_deg).to_radians();
            let direct = Probe::new(shells.clone(), &medium, streams, sun, ROUND.accuracy);
            for row in rows.iter().filter(|row| row[0] == name && row[1] == sun_deg) {
                let (view, dphi, due) = (number(&row[3]).to_radians(), number(&row[4]).to_radians(), number(&row[5]));
                let up = row[2] == "up";
                let (look, azimuth) = if up { (Look::Down, PI - dphi) } else { (Look::Up, dphi) };
                let once = direct.gather(look, view, azimuth).0.once;
                let level = if up { -view.cos() * sun.cos() } else { view.cos() * sun.cos() };
                let cos = level + view.sin() * sun.sin() * dphi.cos();
                let found: f64 = once.iter().zip(&medium.phases).map(|(k, phase)| k[0] * phase.value(cos)).sum();
                let place = || format!("{row:?}: {found:.6e}");
                worst.add(format!("view {:>4} {:>4}", row[3], row[2]), found / due - 1.0, place);
                worst.add(
                    format!("sun {:>4} {:>4}, view to 85", sun_deg, row[2]),
                    match number(&row[3]) <= 85.0 {
                        true => found / due - 1.0,
                        false => 0.0,
                    },
                    place,
                );
            }
        }
    }
    worst.print("single scattering in shells against SASKTRAN2");
    for (class, (error, _, _, place)) in &worst.0 {
        let most = if class.contains("view 8") && !class.contains("85") && !class.contains("80") { 0.03 } else { 0.01 };
        assert!(error.abs() < most, "{class}: {error:+.4} at {place}");
    }
}

const PLANE: Settings = Settings { streams: 16, spherical: false, accuracy: 1e-3 };
const ROUND: Settings = Settings { spherical: true, ..PLANE };
const ALL: Needs =
    Needs { direct_beam: true, diffuse_irradiance: true, directional_sky: true, path: true, path_heights: None };

fn column(profile: &str, visibility_km: f64, cloud: bool) -> Column {
    let cloud = cloud.then_some(Cloud { optical_depth: 10.0, base: 1000.0, top: 2000.0 });
    Column {
        profile: profile.to_string(),
        clouds: cloud.into_iter().collect(),
        visibility: Some(1e3 * visibility_km),
        ..Column::default()
    }
}

/// The medium in 5 nm around a wavelength \[µm\], at the middle one of the absorption terms.
fn medium(site: &Site, wavelength: f64) -> Medium {
    let bin = sunglint_radiometry::Bin { lower: wavelength - 2.5e-3, upper: wavelength + 2.5e-3, band: None };
    let grid = SpectralGrid::with_g(vec![bin], Vec::new(), crate::gas::g_weights);
    let mut media = site.media(&grid).unwrap();
    let absorption = |medium: &Medium| medium.layers.iter().map(|layer| layer.absorption).sum::<f64>();
    media.sort_by(|a, b| absorption(a).total_cmp(&absorption(b)));
    media.swap_remove(media.len() / 2)
}

/// Columns over a ground of an albedo under suns of E_s = 1, radiances solved in each.
fn solved(strata: &Strata, media: &[Medium], albedo: f64, suns: &[f64], settings: &Settings) -> Vec<Box<dyn SkyState>> {
    let reference = media[media.len() / 2].clone();
    let air = ColumnAir {
        strata: strata.clone(),
        media: media.to_vec(),
        ladder: Box::new(move |media| Ladder::of_every(media, reference.clone())),
        solar: vec![1.0; media.len()],
        albedos: vec![vec![albedo; media.len()]],
        notes: Vec::new(),
    };
    let suns: Vec<Sun> = suns.iter().map(|zenith| Sun::at(*zenith, 0.0)).collect();
    column_sky::solve(air, &suns, &ALL, settings).remove(0)
}

/// What the sky is between the directions at which it is known, against light gathered along the very direction; its shape
/// is that at 0.55 µm.
#[test]
fn the_sky_between_its_nodes_is_what_is_gathered_there() {
    for (class, (error, _, _, place)) in &between_nodes(&[20.0, 60.0, 80.0]).0 {
        let most = match class {
            class if class.contains("1-2 from") || class.contains("2-5 from") => 0.15,
            class if class.contains("5-10 from") => 0.1,
            class if class.contains("10-20 from") => 0.05,
            _ => 0.02,
        };
        assert!(error.abs() < most, "{class}: {error:+.4} at {place}");
    }
}

/// The same where what is scattered once falls by orders of magnitude towards the horizon.
#[test]
fn the_sky_between_its_nodes_is_what_is_gathered_there_at_dusk() {
    for (class, (error, _, _, place)) in &between_nodes(&[85.0, 88.0, 90.0]).0 {
        assert!(error.abs() < 0.15, "{class}: {error:+.4} at {place}");
    }
}

fn between_nodes(suns_deg: &[f64]) -> Worst {
    let mut worst = Worst::default();
    let mut state = 1u64;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    let wavelengths = [0.42, 0.55, 0.87];
    for (profile, visibility) in [("midlatitude_summer", 23.0), ("us_standard", 5.0)] {
        let site = Site::new(&column(profile, visibility, false)).unwrap();
        let strata = site.strata();
        let shells = Shells::new(&strata, true);
        let media = wavelengths.map(|wavelength| medium(&site, wavelength));
        for sun_deg in suns_deg {
            let sun = sun_deg.to_radians();
            let sky = solved(&strata, &media, 0.2, &[sun], &ROUND).remove(0);
            let direct =
                media.each_ref().map(|medium| Probe::new(shells.clone(), medium, ROUND.streams, sun, ROUND.accuracy));
            for i in 0..300 {
                // By thirds: over the sky, near the sun, near the horizon.
                let (zenith, azimuth) = match i % 3 {
                    0 => (random().acos(), PI * random()),
                    1 => {
                        let (away, turn) = ((1.0 + 24.0 * random()).to_radians(), 2.0 * PI * random());
                        (sun + away * turn.cos(), away * turn.sin() / sun.sin())
                    }
                    _ => ((75.0 + 15.0 * random()).to_radians(), PI * random()),
                };
                if !(0.0..FRAC_PI_2).contains(&zenith) {
                    continue;
                }
                let direction = WorldDir::from_zenith_azimuth(zenith, azimuth);
                let away = direction.angle_to(WorldDir::from_zenith_azimuth(sun, 0.0)).to_degrees();
                if away < 1.0 {
                    continue;
                }
                let mut found = [0.0; 3];
                sky.sky_radiance(direction, &mut found);
                for (i, (direct, wavelength)) in direct.iter().zip(wavelengths).enumerate() {
                    let beam = sun.cos() * sky.sun_transmittance()[i];
                    let shining = 0.2 * (beam + sky.diffuse_irradiance()[i]) / PI;
                    let (gathered, ground, _) = direct.gather(Look::Up, zenith, azimuth);
                    let due = gathered.radiance(&direct.bundle, away.to_radians().cos(), azimuth)[0] + shining * ground;
                    let (degrees, turn) = (zenith.to_degrees(), azimuth.to_degrees());
                    let class = match (away, degrees) {
                        (a, _) if a < 2.0 => "1-2 from the sun",
                        (a, _) if a < 5.0 => "2-5 from the sun",
                        (a, _) if a < 10.0 => "5-10 from the sun",
                        (a, _) if a < 20.0 => "10-20 from the sun",
                        (_, z) if z < 70.0 => "zenith to 70",
                        (_, z) if z < 85.0 => "zenith 70-85",
                        (_, z) if z < 89.0 => "zenith 85-89",
                        _ => "zenith 89-90",
                    };
                    worst.add(format!("sun {sun_deg} range {visibility}, {class}"), found[i] / due - 1.0, || {
                        format!("{wavelength} µm, zenith {degrees:.2}, azimuth {turn:.2}, {away:.2} away, L {due:.2e}")
                    });
                }
            }
        }
    }
    worst.print("sky between nodes");
    worst
}

/// Scattering angles \[deg\] at which phase functions are handed over, those of LOWTRAN's tables among them.
fn angles() -> Vec<f64> {
    let steps = |from: f64, to: f64, step: f64| {
        (0..((to - from) / step).round() as usize).map(move |i| from + step * i as f64).collect::<Vec<_>>()
    };
    let mut angles = vec![0.0, 0.25, 0.5, 0.75, 1.0, 1.5];
    angles.extend(steps(2.0, 12.0, 1.0));
    angles.extend(steps(12.0, 40.0, 2.0));
    angles.extend(steps(40.0, 120.0, 5.0));
    angles.extend(steps(120.0, 180.0, 2.5));
    angles.push(180.0);
    angles
}

/// Columns of this crate: name, profile, visibility \[km\], cloud, wavelength \[µm\].
fn cases() -> Vec<(String, Site, f64)> {
    let mut cases = Vec::new();
    let clear = [0.42, 0.55, 0.69, 0.7625, 0.87, 0.94];
    for (profile, visibility, cloud, wavelengths) in [
        ("midlatitude_summer", 23.0, false, &clear[..]),
        ("us_standard", 5.0, false, &clear[..]),
        ("midlatitude_summer", 23.0, true, &[0.55, 0.87, 0.94][..]),
    ] {
        let site = Site::new(&column(profile, visibility, cloud)).unwrap();
        for wavelength in wavelengths {
            let id = format!("{profile}_{visibility}km{}_{wavelength}", if cloud { "_cloud" } else { "" });
            cases.push((id, site.clone(), *wavelength));
        }
    }
    cases
}

/// Writes what `benches/peers/columns` solves with CDISORT:
///
/// ```sh
/// cargo test -p sunglint-atmosphere --lib columns_are_handed_over -- --ignored
/// ```
#[test]
#[ignore = "writes test data"]
fn columns_are_handed_over() {
    let list = |values: &mut dyn Iterator<Item = f64>, digits: usize| {
        values.map(|value| format!("{value:.digits$e}")).collect::<Vec<_>>().join(";")
    };
    let mut layers = String::from(
        "# Columns of this crate, layers from the top down: optical depths of absorption, and of scattering by phase\n\
         # function. Written by the test columns_are_handed_over in src/validation.rs.\n\
         id,top_m,bottom_m,absorption,scattering\n",
    );
    let mut phases = format!(
        "# The phase functions of columns_layers.csv: P at these scattering angles [deg], ln P straight between them.\n\
         # {}\nid,phase\n",
        angles().iter().map(f64::to_string).collect::<Vec<_>>().join(";")
    );
    for (id, site, wavelength) in cases() {
        let medium = medium(&site, wavelength);
        for (layer, heights) in medium.layers.iter().zip(site.strata().heights.windows(2)) {
            let scattering = list(&mut layer.scattering.iter().copied(), 6);
            writeln!(layers, "{id},{},{},{:.6e},{scattering}", heights[0], heights[1], layer.absorption).unwrap();
        }
        for phase in &medium.phases {
            let values = list(&mut angles().iter().map(|angle| phase.value(angle.to_radians().cos())), 5);
            writeln!(phases, "{id},{values}").unwrap();
        }
    }
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data");
    std::fs::write(folder.join("columns_layers.csv"), layers).unwrap();
    std::fs::write(folder.join("columns_phases.csv"), phases).unwrap();
}

/// Columns of this crate against CDISORT with the same optical depths and phase functions, as they are solved by default
/// but for the flat Earth: E_d within 0.1 % and the sky 20° or more from the sun within 0.5 %, where it is more than 1e-6 of
/// the sun.
#[test]
fn columns_on_a_flat_earth_are_those_of_disort() {
    for (class, (error, _, _, place)) in &against_disort(PLANE.streams).0 {
        let most = match class {
            class if class.contains("flux") => 1e-3,
            class if class.contains("sky") && !class.contains("black") => 5e-3,
            _ => continue,
        };
        assert!(error.abs() < most, "{class}: {error:+.5} at {place}");
    }
}

/// The same seen from space, over grounds of 0 and 0.3.
#[test]
fn columns_on_a_flat_earth_are_those_of_disort_from_space() {
    for (class, (error, _, _, place)) in
        against_disort(PLANE.streams).0.iter().filter(|(class, _)| class.contains("clear up"))
    {
        assert!(error.abs() < 5e-3, "{class}: {error:+.5} at {place}");
    }
}

/// Droplets scatter as g = 0.85 does, for which 32 streams are due; with 16, one angle of all errs by 0.84 %.
#[test]
fn clouds_on_a_flat_earth_are_those_of_disort_from_space() {
    for (class, (error, _, _, place)) in against_disort(32).0.iter().filter(|(class, _)| class.contains("cloud up")) {
        assert!(error.abs() < 5e-3, "{class}: {error:+.5} at {place}");
    }
}

fn against_disort(streams: usize) -> Worst {
    let layers = records(include_str!("../tests/data/columns_layers.csv"));
    let phases = records(include_str!("../tests/data/columns_phases.csv"));
    let rows = records(include_str!("../tests/data/columns_disort.csv"));
    let angles: Vec<f64> = angles().iter().map(|angle| angle.to_radians()).collect();
    let list = |cell: &str| cell.split(';').map(number).collect::<Vec<f64>>();
    let mut worst = Worst::default();
    let settings = Settings { streams, ..PLANE };
    let mut names: Vec<&String> = layers.iter().map(|row| &row[0]).collect();
    names.dedup();
    for name in names {
        let own: Vec<&Vec<String>> = layers.iter().filter(|row| row[0] == **name).collect();
        let mut heights: Vec<f64> = own.iter().map(|row| number(&row[1])).collect();
        heights.push(0.0);
        let top = heights[0];
        let strata = Strata { refractivity: vec![0.0; heights.len()], heights, radius: 6.371e6 };
        let medium = Medium {
            layers: (own.iter()).map(|row| Layer { absorption: number(&row[3]), scattering: list(&row[4]) }).collect(),
            phases: (phases.iter().filter(|row| row[0] == **name))
                .map(|row| Arc::new(Phase::table(&angles, &list(&row[1]))))
                .collect(),
        };
        for (sun_deg, albedo) in [("30.0", "0.0"), ("60.0", "0.3"), ("75.0", "0.3")] {
            let sun = number(sun_deg).to_radians();
            let sky = solved(&strata, std::slice::from_ref(&medium), number(albedo), &[sun], &settings).remove(0);
            let (beam, diffuse) = (sun.cos() * sky.sun_transmittance()[0], sky.diffuse_irradiance()[0]);
            for row in rows.iter().filter(|row| row[0] == **name && row[1] == sun_deg) {
                let due = number(&row[6]);
                let cloudy = match (name.contains("cloud"), due > 1e-6) {
                    (_, false) => "black",
                    (true, _) => "cloud",
                    (false, _) => "clear",
                };
                if row[3] == "flux" {
                    worst.add(format!("{cloudy} flux, sun {sun_deg}"), diffuse / due - 1.0, || format!("{row:?}"));
                    // Not what is left of it under a cloud, but what there is of it.
                    worst.add(
                        format!("{cloudy} flux of all light, sun {sun_deg}"),
                        (diffuse - due) / (due + beam),
                        || format!("{row:?}"),
                    );
                    continue;
                }
                let (view, dphi) = (number(&row[4]).to_radians(), number(&row[5]).to_radians());
                let up = row[3] == "up";
                let level = if up { -view.cos() * sun.cos() } else { view.cos() * sun.cos() };
                if level + view.sin() * sun.sin() * dphi.cos() > 20f64.to_radians().cos() {
                    continue;
                }
                let mut found = [0.0];
                if up {
                    let towards_sensor = WorldDir::from_zenith_azimuth(view, PI - dphi);
                    let length = 1.001 * top / view.cos();
                    let mut through = [0.0];
                    let path = Path { target_height: 0.0, sensor_height: top, length, towards_sensor };
                    sky.path(&path, &mut through, &mut found);
                    found[0] += through[0] * number(albedo) * (beam + diffuse) / PI;
                } else {
                    sky.sky_radiance(WorldDir::from_zenith_azimuth(view, dphi), &mut found);
                }
                let place = || format!("{row:?}: {:.6e}", found[0]);
                worst.add(format!("{cloudy} {}, view {:>4}", row[3], row[4]), found[0] / due - 1.0, place);
                worst.add(format!("{cloudy} {}, sun {sun_deg}", row[3]), found[0] / due - 1.0, place);
            }
        }
    }
    worst.print("columns against CDISORT");
    worst
}

/// Optical depth at 0.55 µm along the ray to the sun against a quadrature through the continuous profile, with and
/// without refraction, and where the ray comes from. What differs is the cut into 33 layers, the formulas of Rayleigh's
/// cross-section and of the refractivity of moist air, and O₂–O₂.
#[test]
fn depths_to_the_sun_are_those_of_the_continuous_profile() {
    let mut worst = Worst::default();
    for row in records(include_str!("../tests/data/slant_depths.csv")) {
        let name = row[0].trim_end_matches("_1976");
        let site = Site::new(&Column { no2: Some(0.0), ..column(name, number(&row[1]), false) }).unwrap();
        let grid = SpectralGrid::from_edges(&[0.55 - 1e-6, 0.55 + 1e-6]);
        let medium = &site.media(&grid).unwrap()[0];
        let apparent = number(&row[2]).to_radians();
        let depth = |strata: &Strata| {
            let lengths = Shells::new(strata, true).towards_apparent(0.0, apparent).unwrap();
            let per_metre =
                medium.layers.iter().zip(strata.heights.windows(2)).map(|(l, h)| l.extinction() / (h[0] - h[1]));
            lengths.iter().zip(per_metre).map(|(s, beta)| s * beta).sum::<f64>()
        };
        let bent = site.strata();
        let straight = Strata { refractivity: vec![0.0; bent.heights.len()], ..bent.clone() };
        let place = || row.join(" ");
        worst.add(format!("apparent {:>4}, depth", row[2]), depth(&bent) / number(&row[4]) - 1.0, place);
        worst.add(format!("apparent {:>4}, depth, straight", row[2]), depth(&straight) / number(&row[5]) - 1.0, place);
        worst.add(format!("apparent {:>4}, transmittance", row[2]), (number(&row[4]) - depth(&bent)).exp_m1(), place);
        // What of it is refraction: the ray seen at 90° is less deep than the straight one.
        let (found, due) = (depth(&straight) / depth(&bent), number(&row[5]) / number(&row[4]));
        worst.add(format!("apparent {:>4}, straight over bent", row[2]), found / due - 1.0, place);
    }
    worst.print("depths to the sun against a quadrature");
    for (class, (error, _, _, place)) in worst.0.iter().filter(|(class, ..)| class.contains("depth")) {
        assert!(error.abs() < 0.02, "{class}: {error:+.4} at {place}");
    }
}

/// Between the azimuths at which light is gathered, against light gathered at the very azimuth: under suns to 75°, and along
/// rays to 77°, whose multiple scattering is that of one place, to 85°.
#[test]
fn light_between_the_gathered_azimuths_is_what_is_gathered_there() {
    for visibility in [23.0, 5.0] {
        let site = Site::new(&column("midlatitude_summer", visibility, false)).unwrap();
        let medium = medium(&site, 0.41);
        let shells = Shells::new(&site.strata(), true);
        for sun_deg in [20.0, 40.0, 60.0, 70.0, 75.0, 80.0, 85.0f64] {
            let sun = sun_deg.to_radians();
            let direct = Probe::new(shells.clone(), &medium, 8, sun, 1e-3);
            for zenith_deg in [7.0, 28.0, 49.0, 70.0, 77.0, 80.0, 85.0, 90.0f64] {
                let zenith = zenith_deg.to_radians();
                let set = column_sky::GATHERED[column_sky::Nodes::gathered(true, zenith, sun)];
                let known: Vec<_> = set.iter().map(|azimuth| direct.gather(Look::Up, zenith, *azimuth).0).collect();
                for azimuth in [0.0, 25.0, 48.0, 77.0, 93.0, 110.0, 145.0, 180.0].map(f64::to_radians) {
                    let cos = zenith.cos() * sun.cos() + zenith.sin() * sun.sin() * azimuth.cos();
                    let light = |gathered: &Gathered| {
                        let [smooth, peaked] = gathered.parts(&direct.bundle, cos.min(0.9995), azimuth);
                        smooth[0] + peaked[0]
                    };
                    let shares = column_sky::azimuth_shares(set, azimuth);
                    let found: f64 = known.iter().zip(shares).map(|(known, share)| share * light(known)).sum();
                    let error = found / light(&direct.gather(Look::Up, zenith, azimuth).0) - 1.0;
                    let most = if sun_deg <= 75.0 || zenith_deg >= 80.0 { 4e-4 } else { 2.5e-3 };
                    assert!(error.abs() < most, "{visibility} km, sun {sun_deg}, zenith {zenith_deg}: {error:+.1e}");
                }
            }
        }
    }
}

/// Suns between those of the row that fields are solved for, against their own fields: straight up and down, where a ray has
/// the sun of the site all along, and the irradiance at the ground.
#[test]
fn fields_between_the_suns_of_the_row_are_those_of_the_sun_itself() {
    for (visibility, wavelength) in [(23.0, 0.41), (23.0, 0.87), (5.0, 0.41), (5.0, 0.87)] {
        let site = Site::new(&column("midlatitude_summer", visibility, false)).unwrap();
        let medium = medium(&site, wavelength);
        let shells = Shells::new(&site.strata(), true);
        for sun_deg in [2.5, 7.5, 15.0, 25.0, 33.0, 45.0, 52.0, 62.0, 66.3, 73.7, 81.3, 86.3f64] {
            let probe = |exact| Probe::with_fields(shells.clone(), &medium, 8, sun_deg.to_radians(), 1e-3, exact);
            let (row, own) = (probe(false), probe(true));
            let within = |found: f64, due: f64, most: f64| {
                let error = found / due - 1.0;
                assert!(error.abs() < most, "{visibility} km, {wavelength} µm, sun {sun_deg}: {error:+.1e}");
            };
            for look in [Look::Up, Look::Down] {
                let light = |probe: &Probe| probe.gather(look, 0.0, 0.0).0.radiance(&probe.bundle, 0.3, 0.0)[0];
                within(light(&row), light(&own), if sun_deg < 80.0 { 3e-4 } else { 1e-2 });
            }
            within(row.fluxes().1, own.fluxes().1, if sun_deg < 80.0 { 2e-4 } else { 1e-2 });
        }
    }
}

/// Thin parts, whose J is a straight line between their edges, against the same parts with their middles: along rays to the
/// horizon, on a flat and on a round Earth, and the irradiance at the ground.
#[test]
fn the_middles_of_thin_parts_change_little() {
    let mut worst = Worst::default();
    for (visibility, wavelength) in [(23.0, 0.41), (23.0, 0.87), (5.0, 0.55)] {
        let site = Site::new(&column("midlatitude_summer", visibility, false)).unwrap();
        let medium = medium(&site, wavelength);
        for (round, streams) in [(false, 8), (false, 16), (true, 8), (true, 16)] {
            let shells = Shells::new(&site.strata(), round);
            for sun_deg in [10.0, 50.0, 75.0, 86.0f64] {
                let thin = Optics::new(&medium, &shells, streams, false);
                let cuts = thin.cuts();
                assert!(cuts.iter().filter(|cut| !cut.middles).count() > 4, "{cuts:?}");
                let all: Vec<_> = cuts.iter().map(|cut| Cut { middles: true, ..*cut }).collect();
                let all = Optics::with_cuts(&medium, &shells, streams, &all);
                let probe = |optics| Probe::of(shells.clone(), optics, sun_deg.to_radians(), 1e-4, true);
                let (thin, all) = (probe(thin), probe(all));
                for look in [Look::Up, Look::Down] {
                    for zenith in [0.0, 60.0, 80.0, 88.0, 89.9f64] {
                        let light = |probe: &Probe, azimuth: f64| {
                            let cos = azimuth.cos(); // as good as any
                            probe.gather(look, zenith.to_radians(), azimuth).0.radiance(&probe.bundle, cos, azimuth)[0]
                        };
                        for azimuth in [0.5, 1.6, 3.0] {
                            let error = light(&thin, azimuth) / light(&all, azimuth) - 1.0;
                            let place = || format!("{visibility} km, {wavelength} µm, round {round}, sun {sun_deg}");
                            worst.add(format!("{streams} streams, round {round}, {look:?} at {zenith}"), error, place);
                        }
                    }
                }
                let error = thin.fluxes().1 / all.fluxes().1 - 1.0;
                worst.add("irradiance".into(), error, || format!("{streams} streams, round {round}, sun {sun_deg}"));
            }
        }
    }
    worst.print("thin parts without their middles");
    for (class, (error, _, _, place)) in &worst.0 {
        let most = match (class.starts_with("8 "), class.contains("89.9")) {
            (false, false) => 1.5e-4,
            (false, true) => 4.5e-4,
            (true, false) => 6e-4,
            (true, true) => 1.1e-3,
        };
        assert!(error.abs() < most, "{class}: {error:+.1e} at {place}");
    }
}
