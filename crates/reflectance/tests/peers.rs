//! The models against independent packages: Mitsuba 3 and Eradiate's kernel, 200 random geometries each.
//! `benches/peers/reflectance` made the files.

mod given;

use std::collections::BTreeMap;

use given::{Given, bind, constant, word};
use sunglint_radiometry::LocalDir;

type Row = BTreeMap<String, String>;

fn rows(text: &str) -> Vec<Row> {
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let names: Vec<&str> = lines.next().expect("a header").split(',').collect();
    lines
        .map(|line| names.iter().map(|name| name.to_string()).zip(line.split(',').map(str::to_string)).collect())
        .collect()
}

/// The largest relative difference from the file's BRDF.
fn worst(text: &str, model: impl Fn(&Row) -> (&'static str, Given)) -> (f64, usize) {
    let mut worst = 0.0_f64;
    let rows = rows(text);
    for row in &rows {
        let number = |name: &str| row[name].parse::<f64>().expect("a number");
        let angle = |name: &str| number(name).to_radians();
        let (name, given) = model(row);
        let bound = bind(name, given).expect("arguments in range");
        let mut f = [0.0; 4];
        let incident = LocalDir::from_polar(angle("incident_zenith_deg"), 0.0);
        let outgoing = LocalDir::from_polar(angle("view_zenith_deg"), angle("relative_azimuth_deg"));
        bound.eval(incident, outgoing, &mut f);
        let expected = number("brdf_per_sr");
        assert!(expected > 1e-6);
        worst = worst.max((f[0] / expected - 1.0).abs());
    }
    println!("largest relative difference of {} values: {worst:.2e}", rows.len());
    (worst, rows.len())
}

fn same(row: &Row, names: &[(&'static str, &'static str)]) -> Given {
    names.iter().map(|(theirs, ours)| constant(ours, row[*theirs].parse().expect("a number"))).collect()
}

/// `roughconductor` of Mitsuba 3 computes in single precision: it stays within 4.1e-6 of its own equations.
#[test]
fn rough_conductors_are_those_of_mitsuba() {
    let (worst, n) = worst(include_str!("peers/mitsuba_rough_conductor.csv"), |row| {
        let given = same(row, &[("n", "n"), ("k", "k"), ("alpha", "roughness")]);
        match row["distribution"].as_str() {
            "ggx" => ("ggx", [given, vec![word("shadowing", "separable")]].concat()),
            _ => ("rough_conductor", [given, vec![word("shadowing", "walter")]].concat()),
        }
    });
    assert_eq!(n, 400);
    assert!(worst < 1e-5, "{worst:e}");
}

#[test]
fn rpv_is_that_of_eradiate() {
    let names = [("rho_0", "rho0"), ("k", "k"), ("g", "theta"), ("rho_c", "rhoc")];
    let (worst, n) = worst(include_str!("peers/eradiate_rpv.csv"), |row| ("rpv", same(row, &names)));
    assert_eq!(n, 200);
    assert!(worst < 1e-12, "{worst:e}");
}

#[test]
fn ross_li_is_that_of_eradiate() {
    let names = [("f_iso", "iso"), ("f_vol", "vol"), ("f_geo", "geo")];
    let (worst, n) = worst(include_str!("peers/eradiate_rtls.csv"), |row| ("ross_li", same(row, &names)));
    assert_eq!(n, 200);
    assert!(worst < 1e-12, "{worst:e}");
}

/// Half of the rows have a rough relief.
#[test]
fn hapke_is_that_of_eradiate() {
    let names = [("w", "w"), ("b", "b"), ("c", "c"), ("B_0", "b0"), ("h", "h")];
    let (worst, n) = worst(include_str!("peers/eradiate_hapke.csv"), |row| {
        let slope = row["theta"].parse::<f64>().expect("a number").to_radians();
        ("hapke", [same(row, &names), vec![constant("roughness", slope)]].concat())
    });
    assert_eq!(n, 200);
    assert!(worst < 1e-12, "{worst:e}");
}
