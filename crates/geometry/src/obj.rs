//! Wavefront OBJ to a mesh.
//!
//! Read are `v` (x y z; a weight, which only curves use, or a colour may follow), `f` (with `v`, `v/vt`, `v//vn` or `v/vt/vn`,
//! counted from 1, or back from -1) and `usemtl`, over lines that end in LF, CR LF or CR and may be continued by `\`.
//! Texture and normals, groups, objects, smoothing and display settings say nothing that a facet needs. What is left out and
//! would have been something to see, or is no statement of the format, is counted in [`ObjMesh::skipped`].
//!
//! The text is walked twice, for vertices and for faces, since a face may come before its vertices; faults keep their offset
//! and get line and column at the end, so that a sound file pays for neither.

use crate::facet::area_vector;
use crate::mesh::Triangulation;
use crate::{FacetError, MaterialId, Mesh, MeshBuilder};
use glam::DVec3;
use std::collections::HashMap;

/// Faults listed before the rest is only counted; also the keywords listed as skipped.
const MOST_FAULTS: usize = 20;
/// Corners of one face: a check of all its edges against each other stays short.
const MOST_CORNERS: usize = 10_000;

/// Which axis of the file points up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Up {
    /// z, with y ahead: as in an object's frame.
    Z,
    /// y, with −z ahead: x stays, y becomes z, z becomes −y.
    Y,
}

/// The mesh of an OBJ file.
#[derive(Clone, Debug)]
pub struct ObjMesh {
    /// Facets in the order of the file; coordinates in m.
    pub mesh: Mesh,
    /// `usemtl` names that faces use, in order; `""` for faces before the first.
    pub materials_found: Vec<String>,
    /// Faces without area, and triangles of bent faces without area, that were left out.
    pub dropped_zero_area: usize,
    /// Faces that are not planar and became triangles.
    pub split_not_planar: usize,
    /// Points, lines, free-form curves and surfaces, and what is no OBJ statement; at most 20 keywords.
    pub skipped: Vec<ObjSkipped>,
}

/// Statements of one keyword that were left out.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ObjSkipped {
    /// The keyword, at most 40 characters of it.
    pub keyword: String,
    /// What it is.
    pub kind: ObjKind,
    /// How many.
    pub count: usize,
    /// Line of the first, from 1.
    pub line: usize,
}

/// What a statement that gives no facet would have been.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ObjKind {
    /// `p` or `l`: nothing with an area.
    PointOrLine,
    /// `curv`, `curv2` or `surf`.
    FreeForm,
    /// No statement of the format.
    Unknown,
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
    let mut faults = Faults::default();
    if bytes.starts_with(b"\xff\xfe") || bytes.starts_with(b"\xfe\xff") {
        faults.add(0, "the file is UTF-16; save it as plain text or UTF-8".into());
        return Err(faults.listed(bytes));
    }
    let (positions, face_count) = vertices(bytes, unit_m, up, &mut faults);
    let mut faces = Faces {
        known: vec![u32::MAX; positions.len()],
        sound: faults.is_empty(),
        built: MeshBuilder::with_room(face_count, positions.len()),
        positions,
        corners: Vec::new(),
        dropped_zero_area: 0,
        split_not_planar: 0,
    };
    let mut vertices_so_far = 0;
    let (mut names, mut unmapped) = (Vec::<String>::new(), Vec::new());
    let (mut by_name, mut name) = (HashMap::<String, MaterialId>::new(), String::new());
    let mut current = None;
    let mut skipped = Skipped::default();
    for mut statement in Statements::of(bytes) {
        match statement.keyword {
            b"v" => vertices_so_far += 1,
            b"f" => {
                let id = *current.get_or_insert_with(|| {
                    *by_name.entry(name.clone()).or_insert_with(|| {
                        names.push(name.clone());
                        material(&name).unwrap_or_else(|| {
                            unmapped.push(name.clone());
                            MaterialId(0)
                        })
                    })
                });
                faces.read(&mut statement, vertices_so_far, id, &mut faults);
            }
            b"usemtl" => {
                name = statement.rest();
                current = None;
            }
            b"p" | b"l" => skipped.add(&statement, ObjKind::PointOrLine),
            b"curv" | b"curv2" | b"surf" => skipped.add(&statement, ObjKind::FreeForm),
            b"vt" | b"vn" | b"vp" | b"o" | b"g" | b"s" | b"mg" | b"mtllib" | b"usemap" | b"maplib" | b"bevel"
            | b"c_interp" | b"d_interp" | b"lod" | b"shadow_obj" | b"trace_obj" | b"cstype" | b"deg" | b"bmat"
            | b"step" | b"parm" | b"trim" | b"hole" | b"scrv" | b"sp" | b"end" | b"con" | b"ctech" | b"stech" => {}
            _ => skipped.add(&statement, ObjKind::Unknown),
        }
    }
    if faults.is_empty() && face_count == 0 {
        let what = skipped.list.first().map_or(String::new(), |(s, _)| format!("; it begins with `{}`", s.keyword));
        faults.add(bytes.len(), format!("the file has no faces{what}"));
    }
    if !faults.is_empty() {
        return Err(faults.listed(bytes));
    }
    if !unmapped.is_empty() {
        return Err(ObjError::Unmapped(unmapped));
    }
    Ok(ObjMesh {
        mesh: faces.built.finish(),
        materials_found: names,
        dropped_zero_area: faces.dropped_zero_area,
        split_not_planar: faces.split_not_planar,
        skipped: skipped.located(bytes),
    })
}

/// The vertices \[m\], zero in place of malformed ones, and the number of faces.
fn vertices(bytes: &[u8], unit_m: f64, up: Up, faults: &mut Faults) -> (Vec<DVec3>, usize) {
    let (mut out, mut face_count) = (Vec::new(), 0);
    for mut statement in Statements::of(bytes) {
        if statement.keyword != b"v" {
            face_count += usize::from(statement.keyword == b"f");
            continue;
        }
        let (at, mut numbers, mut count) = (statement.at, [0.0; 3], 0);
        while let Some((at, word)) = statement.word() {
            match std::str::from_utf8(word).ok().and_then(|word| word.parse::<f64>().ok()) {
                Some(x) if (x * unit_m).is_finite() && x.is_finite() => {
                    if let Some(slot) = numbers.get_mut(count) {
                        *slot = x * unit_m;
                    }
                }
                Some(_) => faults.add(at, format!("`{}` is not a finite number", shown(word))),
                None => faults.add(at, format!("`{}` is not a number", shown(word))),
            }
            count += 1;
        }
        if !(3..=7).contains(&count) {
            faults.add(at, format!("a vertex has 3 numbers, and at most a weight and a colour more, found {count}"));
        }
        let [x, y, z] = numbers;
        out.push(if up == Up::Z { DVec3::new(x, y, z) } else { DVec3::new(x, -z, y) });
    }
    out.shrink_to_fit();
    (out, face_count)
}

/// The faces so far.
struct Faces {
    positions: Vec<DVec3>,
    /// Vertex of the mesh for each of the file, `u32::MAX` before it is used.
    known: Vec<u32>,
    /// Whether all vertices were read.
    sound: bool,
    built: MeshBuilder,
    /// Vertices of the face at hand.
    corners: Vec<usize>,
    dropped_zero_area: usize,
    split_not_planar: usize,
}

impl Faces {
    fn read(&mut self, face: &mut Statement, vertices_so_far: usize, material: MaterialId, faults: &mut Faults) {
        self.corners.clear();
        let (mut given, mut sound) = (0, self.sound);
        while let Some(index) = face.plain_corner(self.positions.len()) {
            given += 1;
            if given <= MOST_CORNERS {
                self.corners.push(index);
            }
        }
        while let Some((at, word)) = face.word() {
            given += 1;
            match vertex_index(word, vertices_so_far, self.positions.len()) {
                Ok(index) if given <= MOST_CORNERS => self.corners.push(index),
                Ok(_) => {}
                Err(message) => {
                    faults.add(at, message);
                    sound = false;
                }
            }
        }
        if given < 3 {
            faults.add(face.at, format!("a face has three corners at least, found {given}"));
        } else if given > MOST_CORNERS {
            faults.add(face.at, format!("a face has at most {MOST_CORNERS} corners, found {given}; split it"));
        } else if sound && let Err(error) = self.add(material) {
            faults.add(
                face.at,
                match error {
                    FacetError::SelfCrossing { edge_a, edge_b } => format!(
                        "the edges after corners {} and {} of this face cross; split the face where they do",
                        edge_a + 1,
                        edge_b + 1
                    ),
                    error => error.to_string(),
                },
            );
        }
    }

    fn add(&mut self, material: MaterialId) -> Result<(), FacetError> {
        let tried = if let [a, b, c] = self.corners[..] {
            self.built.push_shared([a, b, c], &self.positions, &mut self.known, material)
        } else {
            let corners: Vec<DVec3> = self.corners.iter().map(|&i| self.positions[i]).collect();
            let tried = self.built.push(&corners, material);
            if matches!(tried, Err(FacetError::NotPlanar { .. })) {
                self.split_not_planar += 1;
                let normal = area_vector(&corners).normalize_or_zero();
                for triangle in Triangulation::default().cut(&corners, normal) {
                    let triangle = triangle.map(|i| self.corners[i]);
                    let one = self.built.push_shared(triangle, &self.positions, &mut self.known, material);
                    self.dropped_zero_area += usize::from(one.is_err());
                }
                return Ok(());
            }
            tried
        };
        match tried {
            Err(FacetError::TooFewCorners { .. } | FacetError::ZeroArea) => {
                self.dropped_zero_area += 1;
                Ok(())
            }
            tried => tried,
        }
    }
}

/// The vertex of a face's corner, from 0, out of `v`, `v/vt`, `v//vn` or `v/vt/vn`; negative ones count back.
fn vertex_index(word: &[u8], so_far: usize, count: usize) -> Result<usize, String> {
    let mut parts = word.splitn(4, |&b| b == b'/');
    let index = parts.next().unwrap_or_default();
    let rest = [parts.next(), parts.next()].into_iter().flatten();
    if parts.next().is_some() || rest.into_iter().any(|p| !p.is_empty() && whole(p).is_none()) {
        return Err(format!("`{}` is no corner; write `v`, `v/vt`, `v//vn` or `v/vt/vn`", shown(word)));
    }
    match whole(index) {
        None => Err(format!("`{}` does not start with a vertex number", shown(word))),
        Some(0) => Err("vertices count from 1, found 0".into()),
        Some(i @ 1..) if i as u64 <= count as u64 => Ok(i as usize - 1),
        Some(i @ ..0) if i.unsigned_abs() <= so_far as u64 => Ok(so_far - i.unsigned_abs() as usize),
        Some(i @ 1..) => Err(format!("vertex {i} of a file with {count}")),
        Some(i) => Err(format!("vertex {i} where {so_far} came before")),
    }
}

/// A whole number; what is beyond 64 bits is none.
fn whole(word: &[u8]) -> Option<i64> {
    let (negative, digits) = match word {
        [b'-', digits @ ..] => (true, digits),
        [b'+', digits @ ..] => (false, digits),
        digits => (false, digits),
    };
    if digits.is_empty() {
        return None;
    }
    let mut value = 0_i64;
    for &digit in digits {
        if !digit.is_ascii_digit() {
            return None;
        }
        value = value.checked_mul(10)?.checked_add(i64::from(digit - b'0'))?;
    }
    Some(if negative { -value } else { value })
}

/// Text of the file for a message.
fn shown(word: &[u8]) -> String {
    let text = String::from_utf8_lossy(&word[..word.len().min(160)]);
    let shown: String =
        text.chars().take(40).map(|c| if c.is_control() { char::REPLACEMENT_CHARACTER } else { c }).collect();
    if shown.len() < text.len() || text.len() < word.len() { shown + "…" } else { shown }
}

const fn is_blank(b: u8) -> bool {
    matches!(b, b' ' | b'\t' | 0x0b | 0x0c)
}
const fn is_end(b: u8) -> bool {
    matches!(b, b'\n' | b'\r')
}

/// The statements of a text, comments and empty lines left out.
struct Statements<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Statements<'a> {
    fn of(bytes: &'a [u8]) -> Self {
        Self { bytes, at: if bytes.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 } }
    }
    fn line_end(&self, from: usize) -> usize {
        memchr::memchr2(b'\n', b'\r', &self.bytes[from..]).map_or(self.bytes.len(), |n| from + n)
    }
}

/// One statement, over all lines that `\` joins.
struct Statement<'a> {
    bytes: &'a [u8],
    keyword: &'a [u8],
    /// Offset of the keyword.
    at: usize,
    /// Where the next word is looked for, and where the statement ends.
    next: usize,
    end: usize,
}

impl<'a> Iterator for Statements<'a> {
    type Item = Statement<'a>;

    fn next(&mut self) -> Option<Statement<'a>> {
        loop {
            while self.bytes.get(self.at).is_some_and(|&b| is_blank(b) || is_end(b)) {
                self.at += 1;
            }
            if self.at >= self.bytes.len() {
                return None;
            }
            let at = self.at;
            let mut end = self.line_end(at);
            self.at = end;
            if self.bytes[at] == b'#' {
                continue;
            }
            while let Some(next) = continued(self.bytes, at, end) {
                end = self.line_end(next);
                self.at = end;
            }
            let mut statement = Statement { bytes: self.bytes, keyword: b"", at, next: at, end };
            if let Some((at, keyword)) = statement.word() {
                (statement.at, statement.keyword) = (at, keyword);
                return Some(statement);
            }
        }
    }
}

/// Where the next line begins, if a backslash joins it to the one that ends at `end`.
fn continued(bytes: &[u8], start: usize, end: usize) -> Option<usize> {
    if end > start && bytes[end - 1] > b' ' && bytes[end - 1] != b'\\' {
        return None;
    }
    let last = bytes[start..end].iter().rposition(|&b| !is_blank(b))? + start;
    if bytes[last] != b'\\' || end == bytes.len() {
        return None;
    }
    Some(end + if bytes[end..].starts_with(b"\r\n") { 2 } else { 1 })
}

impl<'a> Statement<'a> {
    /// The next word and its offset. A comment ends the statement.
    #[inline]
    fn word(&mut self) -> Option<(usize, &'a [u8])> {
        let bytes = &self.bytes[..self.end];
        let mut at = self.next;
        while let Some(&b) = bytes.get(at) {
            let joins = b == b'\\' && bytes[at + 1..].iter().find(|&&b| !is_blank(b)).is_none_or(|&b| is_end(b));
            if !is_blank(b) && !is_end(b) && !joins {
                break;
            }
            at += 1;
        }
        let start = at;
        while let Some(&b) = bytes.get(at) {
            if b <= b' ' && (is_blank(b) || is_end(b)) {
                break;
            }
            at += 1;
        }
        // a backslash at the line's end joins though it touches the word
        if at > start + 1
            && bytes[at - 1] == b'\\'
            && bytes[at..].iter().find(|&&b| !is_blank(b)).is_none_or(|&b| is_end(b))
        {
            at -= 1;
        }
        self.next = at;
        match bytes.get(start) {
            None | Some(b'#') => {
                self.next = self.end;
                None
            }
            Some(_) => Some((start, &bytes[start..at])),
        }
    }

    /// The vertex, from 0, of the next corner, if that is digits, perhaps with digits behind `/`, and a vertex of `count`;
    /// whatever else it is stays for [`Statement::word`].
    #[inline]
    fn plain_corner(&mut self, count: usize) -> Option<usize> {
        let bytes = &self.bytes[..self.end];
        let mut at = self.next;
        while bytes.get(at) == Some(&b' ') {
            at += 1;
        }
        let (start, mut index) = (at, 0_usize);
        while let Some(digit) = bytes.get(at).map(|b| b.wrapping_sub(b'0')).filter(|digit| *digit < 10) {
            index = index.wrapping_mul(10).wrapping_add(usize::from(digit));
            at += 1;
        }
        if !(1..=9).contains(&(at - start)) || index == 0 || index > count {
            return None;
        }
        let (rest, mut slashes) = (at, 0);
        while let Some(&b) = bytes.get(at) {
            match b {
                b'/' => slashes += 1,
                b'0'..=b'9' => {}
                b' ' => break,
                _ => return None,
            }
            at += 1;
        }
        if slashes > 2 || at - rest > 20 {
            return None;
        }
        self.next = at;
        Some(index - 1)
    }

    /// All that follows the keyword, on one line, blanks inside kept.
    fn rest(&self) -> String {
        let text = String::from_utf8_lossy(&self.bytes[self.next..self.end]);
        let joined: Vec<&str> = text
            .split(['\n', '\r'])
            .map(|line| line.trim().trim_end_matches('\\').trim_end())
            .filter(|l| !l.is_empty())
            .collect();
        joined.join(" ")
    }
}

/// Faults by offset.
#[derive(Default)]
struct Faults {
    list: Vec<(usize, String)>,
    count: usize,
}

impl Faults {
    fn is_empty(&self) -> bool {
        self.count == 0
    }
    /// Faults come in the order of the file within each walk; the first of both are kept.
    fn add(&mut self, at: usize, message: String) {
        self.count += 1;
        if self.list.len() == MOST_FAULTS {
            let (last, _) = self.list[MOST_FAULTS - 1];
            if at >= last {
                return;
            }
            self.list.pop();
        }
        let place = self.list.partition_point(|f| f.0 <= at);
        self.list.insert(place, (at, message));
    }
    fn listed(self, bytes: &[u8]) -> ObjError {
        let places = locate(bytes, &self.list.iter().map(|f| f.0).collect::<Vec<_>>());
        let mut faults: Vec<ObjFault> = (self.list.into_iter().zip(places))
            .map(|((_, message), (line, column))| ObjFault { line, column, message })
            .collect();
        let more = self.count - faults.len();
        if let (Some(last), true) = (faults.last_mut(), more > 0) {
            last.message += &format!(" (and {more} faults more)");
        }
        ObjError::Malformed(faults)
    }
}

/// Line and column of ascending offsets.
fn locate(bytes: &[u8], offsets: &[usize]) -> Vec<(usize, usize)> {
    let (mut line, mut start, mut at) = (1, 0, 0);
    offsets
        .iter()
        .map(|&offset| {
            while let Some(n) = memchr::memchr2(b'\n', b'\r', &bytes[at..offset]) {
                at += n + 1 + usize::from(bytes[at + n..].starts_with(b"\r\n"));
                (line, start) = (line + 1, at);
                if at > offset {
                    (at, start) = (offset, offset);
                }
            }
            at = offset;
            let bom = if start == 0 && bytes.starts_with(b"\xef\xbb\xbf") { 3.min(offset) } else { 0 };
            (line, String::from_utf8_lossy(&bytes[start + bom..offset]).chars().count() + 1)
        })
        .collect()
}

/// What was left out, with the offset of the first of each keyword.
#[derive(Default)]
struct Skipped {
    list: Vec<(ObjSkipped, usize)>,
}

impl Skipped {
    fn add(&mut self, statement: &Statement, kind: ObjKind) {
        let keyword = shown(statement.keyword);
        if let Some((s, _)) = self.list.iter_mut().find(|(s, _)| s.keyword == keyword) {
            s.count += 1;
        } else if self.list.len() < MOST_FAULTS {
            self.list.push((ObjSkipped { keyword, kind, count: 1, line: 0 }, statement.at));
        }
    }
    fn located(self, bytes: &[u8]) -> Vec<ObjSkipped> {
        let places = locate(bytes, &self.list.iter().map(|s| s.1).collect::<Vec<_>>());
        self.list.into_iter().zip(places).map(|((s, _), (line, _))| ObjSkipped { line, ..s }).collect()
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
    const VERTEX: &str = "a vertex has 3 numbers, and at most a weight and a colour more, found 0";
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
        assert_eq!(mesh.mesh.facet_count(), 2);
        assert_eq!(mesh.mesh.facet(0).corners[2], DVec3::new(2.0, 0.0, 3.0));
        assert!((mesh.mesh.facet(0).normal - DVec3::NEG_Y).length() < 1e-15);
        assert_eq!((mesh.mesh.facet(0).material, mesh.mesh.facet(1).material), (MaterialId(1), MaterialId(2)));
        assert!((mesh.mesh.facet(1).area - 3.0).abs() < 1e-12);
    }

    /// Metres of UTM keep their millimetres, which single precision would round to half a metre.
    #[test]
    fn far_coordinates_keep_their_digits() {
        let mesh = read("v 430000.001 5100000.123 0\nv 430001 5100000 0\nv 430000 5100001 0.5\nf 1 2 3\n").unwrap();
        assert_eq!(mesh.mesh.facet(0).corners[0], DVec3::new(430_000.001, 5_100_000.123, 0.0));
    }

    #[test]
    fn every_trap_is_a_fault_with_its_line_and_column() {
        let on_square = |line: &str| fault(&format!("{SQUARE}{line}\nf 1 2 3\n"));
        assert_eq!(fault("v 0 nan 0\nf 1 1 1\n"), (1, 5, "`nan` is not a finite number".into()));
        assert_eq!(fault("v 0 0 0\nv 1 -inf 0\n").0, 2);
        assert_eq!(fault("v 0 0 1e999\n").1, 7);
        assert_eq!(fault("v 0 0 x\n"), (1, 7, "`x` is not a number".into()));
        assert!(on_square("v 1 2").2.contains("found 2"));
        assert!(on_square("v 1 2 3 4 5 6 7 8").2.contains("found 8"));
        assert_eq!(on_square("v 1 2 3 red").1, 9);
        assert_eq!(on_square("f 1 2"), (5, 1, "a face has three corners at least, found 2".into()));
        assert_eq!(on_square("f").0, 5);
        assert_eq!(on_square("f 1 2 0"), (5, 7, "vertices count from 1, found 0".into()));
        assert_eq!(on_square("f 1 2 5"), (5, 7, "vertex 5 of a file with 4".into()));
        assert_eq!(on_square("f 1 2 -5"), (5, 7, "vertex -5 where 4 came before".into()));
        assert_eq!(on_square("f 1 2 99999999999999999999").0, 5);
        assert_eq!(on_square("f 1 2 3/1/1/1").1, 7);
        assert_eq!(on_square("f 1 2 /1").1, 7);
        assert_eq!(on_square("f 1 2 \\\n  9"), (6, 3, "vertex 9 of a file with 4".into()));
        assert_eq!(fault("v 0 0 0\rv 1 0\r\nv 1 0 0\rf 1 2 3 4"), (2, 1, VERTEX.replace("found 0", "found 2")));
        assert_eq!(fault("\u{feff}v 0 0\n"), (1, 1, VERTEX.replace("found 0", "found 2")));
        assert!(fault("\u{feff}# \u{e9}\n\u{e9} v\nf 1 2 3\n").2.contains("of a file with 0"));
        assert_eq!(fault("v 0 0 0\nv 1 0\0 0\n").0, 2);
        assert!(fault("").2.contains("no faces"));
        assert!(fault(SQUARE).2.contains("no faces"));
        assert!(fault("ply\nformat ascii 1.0\n").2.contains("begins with `ply`"));
        let utf_16: Vec<u8> = "\u{feff}v 0 0 0\n".encode_utf16().flat_map(u16::to_le_bytes).collect();
        assert!(read_obj(&utf_16, 1.0, Up::Z, &mut |_| None).unwrap_err().to_string().contains("UTF-16"));
        assert_eq!(on_square("f 1 3 2 4").0, 5);
    }

    /// The same square by every way of ending and joining lines, of counting corners and of adding to a vertex; comments
    /// behind statements, faces before vertices, and blanks at either end.
    #[test]
    fn one_square_may_be_written_in_many_ways() {
        let same = [
            format!("{SQUARE}f 1 2 3 4\n"),
            format!("{SQUARE}f 1 2 3 4\n").replace('\n', "\r\n"),
            format!("{SQUARE}f 1 2 3 4").replace('\n', "\r"),
            format!("\u{feff}# up\\\n \t{SQUARE}  f -4/1 -3//2 -2/1/1 -1/ # the roof"),
            format!("f 1 \\\n 2 3\\\r\n4\n{SQUARE}"),
            format!("f 1 2 \\ \t\n 3 4\n{SQUARE}"),
            "v 0 0 0 1\nv 1 0 0 0.5\nv 1 1 0 1 0 0\nv 0 +1. .0e5 1 0.2 0.2 0.2\nf 1 2 3 4".into(),
        ];
        for text in same {
            let read = read(&text).unwrap();
            let corners = read.mesh.facet(0).corners;
            assert_eq!((read.mesh.facet_count(), corners.len(), read.skipped.len()), (1, 4, 0), "{text:?}");
            assert!(corners.iter().all(|c| c.x * (1.0 - c.x) == 0.0 && c.y * (1.0 - c.y) == 0.0), "{text:?}");
        }
    }

    #[test]
    fn what_is_left_out_is_counted_and_placed() {
        let text = format!("{SQUARE}l 1 2 3\nl 1 2\nwobble 3\nsurf 0 1 0 1 1 2 3 4\nend\ng a b\ns off\nf 1 2 3\np 1");
        let skipped = read(&text).unwrap().skipped;
        let told: Vec<_> = skipped.iter().map(|s| (s.keyword.as_str(), s.kind, s.count, s.line)).collect();
        let (line, free) = (ObjKind::PointOrLine, ObjKind::FreeForm);
        assert_eq!(
            told,
            [("l", line, 2, 5), ("wobble", ObjKind::Unknown, 1, 7), ("surf", free, 1, 8), ("p", line, 1, 13)]
        );
        let many: String = (0..100).map(|i| format!("k{i} 1\n")).collect();
        assert_eq!(read(&format!("{many}{SQUARE}f 1 2 3")).unwrap().skipped.len(), MOST_FAULTS);
    }

    /// Faults of vertices and of faces come in the order of the file, the first 20 of all.
    #[test]
    fn faults_of_both_walks_are_merged_by_line() {
        let text = format!("{SQUARE}{}", "f 1 2 99\nv 0 0 x\n".repeat(15));
        let Err(ObjError::Malformed(faults)) = read(&text) else { panic!() };
        assert_eq!(faults.iter().map(|f| f.line).collect::<Vec<_>>(), (5..25).collect::<Vec<_>>());
        assert!(faults[19].message.contains("10 faults more"));
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
        assert_eq!(unmapped.unwrap_err(), ObjError::Unmapped(vec!["a".into(), "c".into()]));
    }

    /// A concave planar face stays one facet; a bent quadrilateral becomes two triangles; a face on a line is left out.
    #[test]
    fn faces_of_many_corners_keep_their_shape() {
        let ell = "v 0 0 0\nv 2 0 0\nv 2 1 0\nv 1 1 0\nv 1 2 0\nv 0 2 0\nf 5 6 1 2 3 4\n";
        assert!((read(ell).unwrap().mesh.facet(0).area - 3.0).abs() < 1e-12);
        let bent = read("v 0 0 0\nv 1 0 0\nv 1 1 0.5\nv 0 1 0\nf 1 2 3 4\nf 1 2 2\n").unwrap();
        assert_eq!((bent.mesh.facet_count(), bent.split_not_planar, bent.dropped_zero_area), (2, 1, 1));
        assert!(bent.mesh.facets().all(|f| f.normal.z > 0.0));
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
