//! Terrain as an OBJ file: metres of UTM to the millimetre, faces as `v/vt/vn`, as exporters write them.

use std::fmt::Write as _;

/// `triangles` of a field of heights that is 1000 triangles wide.
pub fn obj(triangles: usize) -> String {
    let (columns, rows) = (500, triangles / 1000);
    let mut out = String::from("# a field of heights\no field\nusemtl soil\n");
    for (j, i) in (0..=rows).flat_map(|j| (0..=columns).map(move |i| (j, i))) {
        let (x, y) = (f64::from(i) * 0.731, j as f64 * 0.694);
        let z = 3.0 * (0.11 * x).sin() * (0.07 * y).cos() + 150.0;
        let _ = writeln!(out, "v {:.3} {:.3} {z:.4}", 430_000.0 + x, 5_100_000.0 + y);
    }
    for (j, i) in (0..rows).flat_map(|j| (0..columns as usize).map(move |i| (j, i))) {
        let a = j * (columns as usize + 1) + i + 1;
        let [b, c, d] = [a + 1, a + columns as usize + 2, a + columns as usize + 1];
        let _ = writeln!(out, "f {a}/{a}/1 {b}/{b}/1 {c}/{c}/1\nf {a}/{a}/1 {c}/{c}/1 {d}/{d}/1");
    }
    out
}
