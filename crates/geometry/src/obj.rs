//! Wavefront OBJ to facets, numbers through `tobj` in `f64`.
//!
//! `tobj` lets much pass in silence (infinite vertices, faces of two corners, lines as faces, broken colours) and names no
//! line. A pass over the text comes first: it reports faults by line and column, and hands on vertices, faces by vertex
//! index, and materials; texture and normals are left behind.

use crate::mesh::Triangulation;
use crate::{Facet, FacetError, MaterialId, facet::area_vector};
use glam::DVec3;
use std::collections::HashMap;
use std::fmt::Write as _;

/// Faults listed before the rest is only counted.
const MOST_FAULTS: usize = 20;

/// Which axis of the file points up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Up {
    /// z, with y ahead: as in an object's frame.
    Z,
    /// y, with −z ahead: x stays, y becomes z, z becomes −y.
    Y,
}

/// The facets of an OBJ file.
#[derive(Clone, Debug, PartialEq)]
pub struct ObjMesh {
    /// Facets in the order of the file; coordinates in m.
    pub facets: Vec<Facet>,
    /// `usemtl` names that faces use, in order; `""` for faces before the first.
    pub materials_found: Vec<String>,
    /// Faces without area, and triangles of bent faces without area, that were left out.
    pub dropped_zero_area: usize,
    /// Faces that are not planar and became triangles.
    pub split_not_planar: usize,
}

/// Why an OBJ file gives no facets.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ObjError {
    /// Faults of the text, in order.
    #[error("{}", listed(.0))]
    Malformed(Vec<ObjFault>),
    /// Materials of the file that are not mapped, all of them.
    #[error("materials that are not mapped: {}", .0.iter().map(|n| format!("`{n}`")).collect::<Vec<_>>().join(", "))]
    Unmapped(Vec<String>),
}

/// One fault. Lines and columns count from 1; columns are characters.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ObjFault {
    /// Line.
    pub line: usize,
    /// Column.
    pub column: usize,
    /// What is wrong, and what would be right.
    pub message: String,
}

fn listed(faults: &[ObjFault]) -> String {
    faults.iter().map(|f| format!("line {}, column {}: {}", f.line, f.column, f.message)).collect::<Vec<_>>().join("\n")
}

/// Reads a file. Lengths are multiplied by `unit_m`; `material` maps `usemtl` names (`""`: none was set). Planar faces of
/// any number of corners become one facet, bent ones triangles.
///
/// # Errors
/// See [`ObjError`].
pub fn read_obj(
    bytes: &[u8],
    unit_m: f64,
    up: Up,
    material: &mut dyn FnMut(&str) -> Option<MaterialId>,
) -> Result<ObjMesh, ObjError> {
    let checked = check(bytes, unit_m)?;
    let ids: Vec<Option<MaterialId>> = checked.materials.iter().map(|name| material(name)).collect();
    let unmapped: Vec<String> =
        checked.materials.iter().zip(&ids).filter(|(_, id)| id.is_none()).map(|(name, _)| name.clone()).collect();
    if !unmapped.is_empty() {
        return Err(ObjError::Unmapped(unmapped));
    }

    let options =
        tobj::LoadOptions { single_index: true, ignore_points: true, ignore_lines: true, ..Default::default() };
    let library = |_: &std::path::Path| {
        let names = 0..checked.materials.len();
        let materials = names.clone().map(|i| tobj::Material { name: format!("m{i}"), ..Default::default() }).collect();
        Ok((materials, names.map(|i| (format!("m{i}"), i)).collect()))
    };
    let (models, _) = tobj::load_obj_buf(&mut checked.text.as_bytes(), &options, library)
        .map_err(|e| ObjError::Malformed(vec![ObjFault { line: 1, column: 1, message: e.to_string() }]))?;

    let mut out =
        ObjMesh { facets: Vec::new(), materials_found: checked.materials, dropped_zero_area: 0, split_not_planar: 0 };
    let (mut faults, mut lines) = (Faults::default(), checked.face_lines.into_iter());
    for mesh in models.iter().map(|m| &m.mesh) {
        let Some(material) = mesh.material_id.and_then(|i| ids[i]) else { continue };
        let corner = |&i: &u32| {
            let [x, y, z] = [0, 1, 2].map(|a| mesh.positions[3 * i as usize + a] * unit_m);
            if up == Up::Z { DVec3::new(x, y, z) } else { DVec3::new(x, -z, y) }
        };
        let mut rest = &mesh.indices[..];
        let count = if mesh.face_arities.is_empty() { rest.len() / 3 } else { mesh.face_arities.len() };
        for face in 0..count {
            let (ring, after) = rest.split_at(mesh.face_arities.get(face).map_or(3, |&n| n as usize));
            rest = after;
            let line = lines.next().unwrap_or(1);
            out.add(ring.iter().map(corner).collect(), material, |message| faults.add(line, 1, message));
        }
    }
    faults.none()?;
    Ok(out)
}

impl ObjMesh {
    fn add(&mut self, corners: Vec<DVec3>, material: MaterialId, mut fault: impl FnMut(String)) {
        match Facet::new(corners.clone(), material) {
            Ok(facet) => self.facets.push(facet),
            Err(FacetError::TooFewCorners { .. } | FacetError::ZeroArea) => self.dropped_zero_area += 1,
            Err(FacetError::NotPlanar { .. }) => {
                self.split_not_planar += 1;
                let normal = area_vector(&corners).normalize_or_zero();
                for triangle in Triangulation::default().cut(&corners, normal) {
                    match Facet::new(triangle.map(|i| corners[i]).to_vec(), material) {
                        Ok(facet) => self.facets.push(facet),
                        Err(_) => self.dropped_zero_area += 1,
                    }
                }
            }
            Err(FacetError::SelfCrossing { edge_a, edge_b }) => fault(format!(
                "the edges after corners {} and {} of this face cross; split the face where they do",
                edge_a + 1,
                edge_b + 1
            )),
            Err(error) => fault(error.to_string()),
        }
    }
}

/// What `tobj` gets, and what it forgets.
struct Checked {
    text: String,
    materials: Vec<String>,
    face_lines: Vec<usize>,
}

#[derive(Default)]
struct Faults {
    list: Vec<ObjFault>,
    more: usize,
}

impl Faults {
    fn add(&mut self, line: usize, column: usize, message: String) {
        if self.list.len() < MOST_FAULTS {
            self.list.push(ObjFault { line, column, message });
        } else {
            self.more += 1;
        }
    }
    fn none(mut self) -> Result<(), ObjError> {
        if let (Some(last), more @ 1..) = (self.list.last_mut(), self.more) {
            let _ = write!(last.message, " (and {more} faults more)");
        }
        if self.list.is_empty() { Ok(()) } else { Err(ObjError::Malformed(self.list)) }
    }
}

fn check(bytes: &[u8], unit_m: f64) -> Result<Checked, ObjError> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let mut faults = Faults::default();
    let mut out = Checked { text: "mtllib m\n".to_owned(), materials: Vec::new(), face_lines: Vec::new() };
    let (mut names, mut current, mut written) = (HashMap::<String, usize>::new(), String::new(), None);
    let vertex_count = bytes.split(|&b| b == b'\n').filter(|l| is_vertex(l)).count();
    // Faces may come before their vertices, and tobj wants them after, so they are gathered behind.
    let (mut faces, mut vertices_so_far, mut last_line) = (String::new(), 0, 1);
    for (i, raw) in bytes.split(|&b| b == b'\n').enumerate() {
        let (line, raw) = (i + 1, raw.strip_suffix(b"\r").unwrap_or(raw));
        last_line = line;
        if let Some(at) = raw.iter().position(|&b| b == b'\r') {
            faults.add(line, at + 1, "a carriage return without a line feed; end lines with LF or CR LF".into());
            continue;
        }
        if let Some(at) = raw.iter().position(|&b| b == 0) {
            faults.add(line, at + 1, "a NUL byte; this is not an OBJ text".into());
            continue;
        }
        let text = String::from_utf8_lossy(raw);
        let mut words = words(&text);
        let Some((column, keyword)) = words.next() else { continue };
        if keyword.starts_with('#') {
            continue;
        }
        if text.trim_end().ends_with('\\') {
            faults.add(
                line,
                text.trim_end().chars().count(),
                "a line continued by `\\`; write the statement on one line".into(),
            );
            continue;
        }
        match keyword {
            "v" => {
                vertices_so_far += 1;
                vertex(line, column, &text, unit_m, &mut out.text, &mut faults);
            }
            "f" => {
                let material = *names.entry(current.clone()).or_insert_with(|| {
                    out.materials.push(current.clone());
                    out.materials.len() - 1
                });
                if written != Some(material) {
                    written = Some(material);
                    let _ = writeln!(faces, "usemtl m{material}");
                }
                out.face_lines.push(line);
                faces.push('f');
                let mut corners = 0;
                for (column, word) in words {
                    corners += 1;
                    match vertex_index(word, vertices_so_far, vertex_count) {
                        Ok(index) => {
                            let _ = write!(faces, " {index}");
                        }
                        Err(message) => faults.add(line, column, message),
                    }
                }
                faces.push('\n');
                if corners < 3 {
                    faults.add(line, column, format!("a face has three corners at least, found {corners}"));
                }
            }
            "usemtl" => current = text.trim_start()["usemtl".len()..].trim().to_owned(),
            "vt" | "vn" | "vp" | "p" | "l" | "o" | "g" | "s" | "mg" | "mtllib" | "usemap" | "maplib" | "bevel"
            | "c_interp" | "d_interp" | "lod" | "shadow_obj" | "trace_obj" => {}
            "curv" | "curv2" | "surf" => {
                faults.add(line, column, format!("`{keyword}` is a free-form shape; export it as faces"));
            }
            "cstype" | "deg" | "bmat" | "step" | "parm" | "trim" | "hole" | "scrv" | "sp" | "end" | "con" => {}
            other => faults.add(
                line,
                column,
                format!("`{}` is no OBJ statement", other.chars().take(40).collect::<String>()),
            ),
        }
    }
    if faults.list.is_empty() && out.face_lines.is_empty() {
        faults.add(last_line, 1, "the file has no faces".into());
    }
    faults.none()?;
    out.text.push_str(&faces);
    Ok(out)
}

fn is_vertex(line: &[u8]) -> bool {
    let line = line.trim_ascii_start();
    line.first() == Some(&b'v') && line.get(1).is_some_and(|&b| b == b' ' || b == b'\t')
}

/// Words of a line with their columns.
fn words(line: &str) -> impl Iterator<Item = (usize, &str)> {
    line.split_whitespace().map(move |word| {
        let at = word.as_ptr() as usize - line.as_ptr() as usize;
        (line[..at].chars().count() + 1, word)
    })
}

fn vertex(line: usize, column: usize, text: &str, unit_m: f64, out: &mut String, faults: &mut Faults) {
    let mut numbers = [0.0; 6];
    let mut count = 0;
    for (column, word) in words(text).skip(1) {
        match word.parse::<f64>() {
            Ok(x) if x.is_finite() && (x * unit_m).is_finite() => {
                if let Some(slot) = numbers.get_mut(count) {
                    *slot = x;
                }
            }
            Ok(_) => return faults.add(line, column, format!("`{word}` is not a finite number")),
            Err(_) => return faults.add(line, column, format!("`{word}` is not a number")),
        }
        count += 1;
    }
    let [x, y, z, w, ..] = numbers;
    match count {
        4 if w != 1.0 => {
            faults.add(line, column, format!("a vertex of weight {w}; faces take vertices of weight 1 only"));
        }
        // a colour, which facets do not take
        3 | 4 | 6 => {
            let _ = writeln!(out, "v {x:e} {y:e} {z:e}");
        }
        _ => faults.add(line, column, format!("a vertex has 3 numbers, or 6 with a colour, found {count}")),
    }
}

/// The vertex of a face's corner, from 1, out of `v`, `v/vt`, `v//vn` or `v/vt/vn`; negative ones count back.
fn vertex_index(word: &str, so_far: usize, count: usize) -> Result<usize, String> {
    let mut parts = word.split('/');
    let index = parts.next().unwrap_or_default();
    let rest: Vec<&str> = parts.collect();
    if rest.len() > 2 || rest.iter().any(|p| !p.is_empty() && p.parse::<i64>().is_err()) {
        return Err(format!("`{word}` is no corner; write `v`, `v/vt`, `v//vn` or `v/vt/vn`"));
    }
    match index.parse::<i64>() {
        Err(_) => Err(format!("`{word}` does not start with a vertex number")),
        Ok(0) => Err("vertices count from 1, found 0".into()),
        Ok(i @ 1..) if i as u64 <= count as u64 => Ok(i as usize),
        Ok(i @ ..0) if i.unsigned_abs() <= so_far as u64 => Ok(so_far + 1 - i.unsigned_abs() as usize),
        Ok(i @ 1..) => Err(format!("vertex {i} of a file with {count}")),
        Ok(i) => Err(format!("vertex {i} where {so_far} came before")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<ObjMesh, ObjError> {
        read_obj(text.as_bytes(), 1.0, Up::Z, &mut |_| Some(MaterialId(0)))
    }
    fn fault(text: &str) -> (usize, usize, String) {
        match read(text) {
            Err(ObjError::Malformed(faults)) => (faults[0].line, faults[0].column, faults[0].message.clone()),
            other => panic!("{text:?}: {other:?}"),
        }
    }
    const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

    #[test]
    fn materials_units_and_axes_are_applied() {
        let text = "# a wall\r\nmtllib any.mtl\r\nv 0 0 0\r\nv 200 0 0\r\nv 200 300 0\r\nv 0 300 0\r\nvt 0 0\r\nvn 0 0 1\r\n\
                    g wall\r\nf 1/1/1 2/1/1 3/1/1 4//1\r\nusemtl Old  Brick\r\nf -4 -3 -2\r\nl 1 2 3\r\n";
        let mut asked = Vec::new();
        let mesh = read_obj(text.as_bytes(), 0.01, Up::Y, &mut |name| {
            asked.push(name.to_owned());
            Some(MaterialId(asked.len() as u32))
        })
        .unwrap();
        assert_eq!(asked, ["", "Old  Brick"]);
        assert_eq!(mesh.materials_found, asked);
        assert_eq!(mesh.facets.len(), 2);
        assert_eq!(mesh.facets[0].corners[2], DVec3::new(2.0, 0.0, 3.0));
        assert!((mesh.facets[0].normal - DVec3::NEG_Y).length() < 1e-15);
        assert_eq!((mesh.facets[0].material, mesh.facets[1].material), (MaterialId(1), MaterialId(2)));
        assert!((mesh.facets[1].area - 3.0).abs() < 1e-12);
    }

    /// Metres of UTM keep their millimetres, which single precision would round to half a metre.
    #[test]
    fn far_coordinates_keep_their_digits() {
        let mesh = read("v 430000.001 5100000.123 0\nv 430001 5100000 0\nv 430000 5100001 0.5\nf 1 2 3\n").unwrap();
        assert_eq!(mesh.facets[0].corners[0], DVec3::new(430_000.001, 5_100_000.123, 0.0));
    }

    #[test]
    fn every_trap_is_a_fault_with_its_line_and_column() {
        let on_square = |line: &str| fault(&format!("{SQUARE}{line}\nf 1 2 3\n"));
        assert_eq!(fault("v 0 nan 0\nf 1 1 1\n"), (1, 5, "`nan` is not a finite number".into()));
        assert_eq!(fault("v 0 0 0\nv 1 -inf 0\n").0, 2);
        assert_eq!(fault("v 0 0 1e999\n").1, 7);
        assert_eq!(fault("v 0 0 x\n"), (1, 7, "`x` is not a number".into()));
        assert!(on_square("v 1 2").2.contains("found 2"));
        assert!(on_square("v 1 2 3 0.5").2.contains("weight 0.5"));
        assert!(on_square("v 1 2 3 4 5").2.contains("found 5"));
        assert!(on_square("v 1 2 3 4 5 6 7").2.contains("found 7"));
        assert_eq!(on_square("f 1 2"), (5, 1, "a face has three corners at least, found 2".into()));
        assert_eq!(on_square("f").0, 5);
        assert_eq!(on_square("f 1 2 0"), (5, 7, "vertices count from 1, found 0".into()));
        assert_eq!(on_square("f 1 2 5"), (5, 7, "vertex 5 of a file with 4".into()));
        assert_eq!(on_square("f 1 2 -5"), (5, 7, "vertex -5 where 4 came before".into()));
        assert_eq!(on_square("f 1 2 99999999999999999999").0, 5);
        assert_eq!(on_square("f 1 2 3/1/1/1").1, 7);
        assert_eq!(on_square("f 1 2 /1").1, 7);
        assert!(on_square("f 1 2 \\\n 3").2.contains("continued"));
        assert!(fault("v 0 0 0\rv 1 0 0\r").2.contains("carriage return"));
        assert_eq!(fault("v 0 0 0\nv 1 0\0 0\n").0, 2);
        assert!(fault("").2.contains("no faces"));
        assert!(fault(SQUARE).2.contains("no faces"));
        assert!(on_square("ply").2.contains("no OBJ statement"));
        assert!(on_square("surf 0 1 0 1 1 2 3 4").2.contains("free-form"));
        assert_eq!(on_square("f 1 3 2 4").0, 5);
    }

    #[test]
    fn several_faults_come_together_and_unmapped_materials_too() {
        let Err(ObjError::Malformed(faults)) = read("v 0 0 x\nv 1 1\nf 1 2\n") else { panic!() };
        assert_eq!(faults.iter().map(|f| f.line).collect::<Vec<_>>(), [1, 2, 3]);
        let Err(ObjError::Malformed(faults)) = read(&"f 0 0 0\n".repeat(100)) else { panic!() };
        assert_eq!(faults.len(), MOST_FAULTS);
        assert!(faults[MOST_FAULTS - 1].message.contains("280 faults more"));
        let text = format!("{SQUARE}usemtl a\nf 1 2 3\nusemtl b\nf 1 2 3\nusemtl c\nf 1 3 4\nusemtl never\n");
        let unmapped = read_obj(text.as_bytes(), 1.0, Up::Z, &mut |n| (n == "b").then_some(MaterialId(0)));
        assert_eq!(unmapped, Err(ObjError::Unmapped(vec!["a".into(), "c".into()])));
    }

    /// A concave planar face stays one facet; a bent quadrilateral becomes two triangles; a face on a line is left out.
    #[test]
    fn faces_of_many_corners_keep_their_shape() {
        let ell = "v 0 0 0\nv 2 0 0\nv 2 1 0\nv 1 1 0\nv 1 2 0\nv 0 2 0\nf 5 6 1 2 3 4\n";
        assert!((read(ell).unwrap().facets[0].area - 3.0).abs() < 1e-12);
        let bent = read("v 0 0 0\nv 1 0 0\nv 1 1 0.5\nv 0 1 0\nf 1 2 3 4\nf 1 2 2\n").unwrap();
        assert_eq!((bent.facets.len(), bent.split_not_planar, bent.dropped_zero_area), (2, 1, 1));
        assert!(bent.facets.iter().all(|f| f.normal.z > 0.0));
    }

    /// Mutated bytes give facets or faults, never a panic.
    #[test]
    fn broken_bytes_never_panic() {
        let text = format!("{SQUARE}vt 0 0\nusemtl \u{e9}\nf 1/1 2/1 3/1 4/1\nf -1 -2 -3\ng x\nl 1 2\n# end\n");
        let mut seed = 1_u64;
        let mut random = |n: usize| {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 33) as usize % n
        };
        for _ in 0..5_000 {
            let mut bytes = text.clone().into_bytes();
            for _ in 0..1 + random(4) {
                let at = random(bytes.len());
                match random(3) {
                    0 => bytes[at] = random(256) as u8,
                    1 => drop(bytes.remove(at)),
                    _ => bytes.insert(at, b"0123456789-./ \n\\ef"[random(18)]),
                }
            }
            let _ = read_obj(&bytes, 1.0, Up::Y, &mut |_| Some(MaterialId(0)));
        }
    }
}
