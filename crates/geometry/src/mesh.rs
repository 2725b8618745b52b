//! A faceted shape in its own frame.

use crate::facet::{area_vector, flatten};
use crate::{Facet, MaterialId};
use earcut::Earcut;
use glam::{DVec2, DVec3};
use std::collections::{HashMap, HashSet};
use std::hash::{BuildHasherDefault, Hash, Hasher};

/// A faceted shape in its own frame, shared by its instances. Corners keep their `f64` coordinates; equal corners are
/// stored once, so that facets which share an edge share it to the last bit and no ray passes between them.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    pub(crate) vertices: Vec<DVec3>,
    /// Facet `i` has the corners `corners[first_corner[i]..first_corner[i + 1]]`.
    first_corner: Vec<u32>,
    corners: Vec<u32>,
    normals: Vec<DVec3>,
    /// Facets whose corners are off one plane by more than rounding; their triangles go by their own normals.
    bent: Vec<bool>,
    materials: Vec<MaterialId>,
    /// Vertices of what is traced, the smallest index first.
    pub(crate) triangles: Vec<[u32; 3]>,
    pub(crate) facet_of: Vec<u32>,
}

impl Mesh {
    /// Triangulates the facets, concave ones too. Facets keep their indices; what has no area is not traced, and of
    /// triangles with the same three corners and the same front only the first is.
    pub fn from_facets(facets: Vec<Facet>) -> Self {
        let mut mesh = Self { first_corner: vec![0], ..Self::default() };
        let mut index: HashMap<[u64; 3], u32, Fast> = HashMap::default();
        let mut seen: HashSet<[u32; 3], Fast> = HashSet::default();
        let mut cutter = Triangulation::default();
        for (facet_idx, facet) in facets.into_iter().enumerate() {
            let start = mesh.corners.len();
            for &corner in &facet.corners {
                // +0.0 makes the two zeros one
                let key = corner.to_array().map(|x| (x + 0.0).to_bits());
                let vertex = *index.entry(key).or_insert_with(|| {
                    mesh.vertices.push(corner);
                    mesh.vertices.len() as u32 - 1
                });
                mesh.corners.push(vertex);
            }
            let ring = &mesh.corners[start..];
            for triangle in cutter.cut(&facet.corners, facet.normal) {
                let [a, b, c] = triangle.map(|i| ring[i]);
                let rotated = if a < b && a < c {
                    [a, b, c]
                } else if b < c {
                    [b, c, a]
                } else {
                    [c, a, b]
                };
                if a != b && b != c && c != a && seen.insert(rotated) {
                    mesh.triangles.push(rotated);
                    mesh.facet_of.push(facet_idx as u32);
                }
            }
            mesh.first_corner.push(mesh.corners.len() as u32);
            mesh.normals.push(facet.normal);
            mesh.bent.push(
                facet.corners.len() > 3 && {
                    let reach = facet.corners.iter().map(|c| c.abs().max_element()).fold(0.0, f64::max);
                    let off = |c: &DVec3| facet.normal.dot(c - facet.corners[0]).abs();
                    facet.corners.iter().any(|c| off(c) > 4.0 * f64::EPSILON * reach)
                },
            );
            mesh.materials.push(facet.material);
        }
        mesh
    }

    /// The mesh of triangles over shared corners, taken as they are: `triangles` holds indices into `positions` \[m\],
    /// counter-clockwise seen from the front, and `material` gives the material of each. Positions that no triangle uses
    /// are left out.
    ///
    /// # Panics
    /// Where an index is not below the number of positions.
    pub fn from_triangles(
        positions: Vec<DVec3>,
        mut triangles: Vec<[u32; 3]>,
        material: impl Fn(usize) -> MaterialId,
    ) -> Self {
        let mut index = vec![u32::MAX; positions.len()];
        triangles.iter().flatten().for_each(|&v| index[v as usize] = 0);
        let mut vertices = Vec::with_capacity(positions.len());
        for (i, position) in positions.into_iter().enumerate() {
            if index[i] == 0 {
                index[i] = vertices.len() as u32;
                vertices.push(position);
            }
        }
        triangles.iter_mut().flatten().for_each(|v| *v = index[*v as usize]);
        let normals =
            (triangles.iter()).map(|t| area_vector(&t.map(|v| vertices[v as usize])).normalize_or_zero()).collect();
        let n = triangles.len() as u32;
        Self {
            vertices,
            first_corner: (0..=n).map(|i| 3 * i).collect(),
            corners: triangles.iter().flatten().copied().collect(),
            normals,
            bent: vec![false; n as usize],
            materials: (0..n as usize).map(material).collect(),
            facet_of: (0..n).collect(),
            triangles,
        }
    }

    /// Number of facets.
    pub fn facet_count(&self) -> usize {
        self.materials.len()
    }
    /// Number of triangles that are traced.
    pub fn triangle_count(&self) -> usize {
        self.triangles.len()
    }
    /// The facets in the order given.
    pub fn facets(&self) -> impl ExactSizeIterator<Item = Facet> + '_ {
        (0..self.facet_count()).map(|i| self.facet(i))
    }
    /// Facet `i`, which must be below [`Mesh::facet_count`].
    pub fn facet(&self, i: usize) -> Facet {
        let corners: Vec<DVec3> = self.ring(i).iter().map(|&v| self.vertices[v as usize]).collect();
        let area = 0.5 * area_vector(&corners).length();
        Facet { corners, normal: self.normals[i], area, material: self.materials[i] }
    }
    /// Lowest and highest coordinates \[m\]; `None` without facets.
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        let first = *self.vertices.first()?;
        Some(self.vertices.iter().fold((first, first), |(lo, hi), &v| (lo.min(v), hi.max(v))))
    }

    /// Unit normal of a triangle: its facet's, or its own if the facet is bent.
    pub(crate) fn normal(&self, triangle: u32, corners: &[DVec3; 3]) -> DVec3 {
        let facet = self.facet_of[triangle as usize] as usize;
        if self.bent[facet] { area_vector(corners).normalize_or(self.normals[facet]) } else { self.normals[facet] }
    }
    pub(crate) fn material(&self, facet: usize) -> MaterialId {
        self.materials[facet]
    }
    pub(crate) fn ring(&self, facet: usize) -> &[u32] {
        &self.corners[self.first_corner[facet] as usize..self.first_corner[facet + 1] as usize]
    }
    pub(crate) fn triangle(&self, i: usize) -> [DVec3; 3] {
        self.triangles[i].map(|v| self.vertices[v as usize])
    }
    pub(crate) fn memory_bytes(&self) -> usize {
        size_of_val(&self.vertices[..])
            + size_of_val(&self.normals[..])
            + size_of_val(&self.triangles[..])
            + self.bent.len()
            + 4 * (self.first_corner.len() + self.corners.len() + self.materials.len() + self.facet_of.len())
    }
}

/// Polygons to triangles of corner indices, counter-clockwise; buffers are kept between polygons.
pub(crate) struct Triangulation {
    earcut: Earcut<f64>,
    out: Vec<[usize; 3]>,
    flat: Vec<usize>,
}

impl Default for Triangulation {
    fn default() -> Self {
        Self { earcut: Earcut::new(), out: Vec::new(), flat: Vec::new() }
    }
}

impl Triangulation {
    pub fn cut(&mut self, corners: &[DVec3], normal: DVec3) -> impl Iterator<Item = [usize; 3]> + '_ {
        self.out.clear();
        match corners.len() {
            0..3 => {}
            3 => self.out.push([0, 1, 2]),
            n => {
                let ring = flatten(corners, normal);
                let turn = |a: usize, b: usize, c: usize| (ring[b] - ring[a]).perp_dot(ring[c] - ring[a]);
                if n == 4 && (0..4).all(|i| turn(i, (i + 1) % 4, (i + 2) % 4) > 0.0) {
                    // the shorter diagonal gives the fatter triangles
                    let other = ring[1].distance_squared(ring[3]) < ring[0].distance_squared(ring[2]);
                    self.out.extend(if other { [[0, 1, 3], [1, 2, 3]] } else { [[0, 1, 2], [0, 2, 3]] });
                } else {
                    self.cut_any(&ring);
                }
            }
        }
        self.out.drain(..)
    }

    fn cut_any(&mut self, ring: &[DVec2]) {
        self.earcut.earcut(ring.iter().map(DVec2::to_array), &[], &mut self.flat);
        let turn = |t: [usize; 3]| (ring[t[1]] - ring[t[0]]).perp_dot(ring[t[2]] - ring[t[0]]);
        for t in self.flat.chunks_exact(3) {
            let t = [t[0], t[1], t[2]];
            self.out.push(if turn(t) < 0.0 { [t[0], t[2], t[1]] } else { t });
        }
        // earcut leaves out corners in the middle of an edge. A neighbour that has the corner too would then meet this
        // facet in a T, through which rays can leak, so they are put back by splitting the triangle at that edge.
        let mut used = vec![false; ring.len()];
        self.out.iter().flatten().for_each(|&i| used[i] = true);
        if used.iter().all(|&u| u) || self.out.is_empty() {
            return;
        }
        let mut at_edge: HashMap<(usize, usize), usize> = HashMap::new();
        for (t, tri) in self.out.iter().enumerate() {
            at_edge.extend((0..3).map(|i| ((tri[i], tri[(i + 1) % 3]), t)));
        }
        let n = ring.len();
        let (Some(mut a), Some(mut b)) = (used.iter().rposition(|&u| u), used.iter().position(|&u| u)) else { return };
        let mut next_used = vec![b; n];
        for i in (0..n).rev() {
            next_used[i] = b;
            if used[i] {
                b = i;
            }
        }
        for i in 0..n {
            if used[i] {
                a = i;
                continue;
            }
            let b = next_used[i];
            let Some(&t) = at_edge.get(&(a, b)) else { continue };
            let Some(&c) = self.out[t].iter().find(|&&v| v != a && v != b) else { continue };
            let u = self.out.len();
            self.out[t] = [a, i, c];
            self.out.push([i, b, c]);
            at_edge.extend([((a, i), t), ((i, c), t), ((c, a), t), ((i, b), u), ((b, c), u), ((c, i), u)]);
            a = i;
        }
    }
}

/// A quick hash for keys that come from coordinates and indices.
#[derive(Default)]
struct Mix(u64);
type Fast = BuildHasherDefault<Mix>;

impl Hasher for Mix {
    fn finish(&self) -> u64 {
        self.0 ^ (self.0 >> 29)
    }
    fn write(&mut self, bytes: &[u8]) {
        for chunk in bytes.chunks(8) {
            let mut word = [0; 8];
            word[..chunk.len()].copy_from_slice(chunk);
            u64::from_le_bytes(word).hash(self);
        }
    }
    fn write_u64(&mut self, x: u64) {
        self.0 = (self.0.rotate_left(23) ^ x).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        self.0 ^= self.0 >> 32;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn facet(corners: &[[f64; 3]]) -> Facet {
        Facet::new(corners.iter().map(|&c| DVec3::from_array(c)).collect(), MaterialId(0)).unwrap()
    }
    fn traced_area(mesh: &Mesh) -> f64 {
        (0..mesh.triangle_count()).map(|i| 0.5 * area_vector(&mesh.triangle(i)).length()).sum()
    }

    /// An L has 3 of its 4 bounding squares; a fan about its first corner would cover more. All triangles face up.
    #[test]
    fn a_concave_polygon_is_covered_once() {
        let ell = [[0., 2., 0.], [0., 0., 0.], [2., 0., 0.], [2., 1., 0.], [1., 1., 0.], [1., 2., 0.]];
        let mesh = Mesh::from_facets(vec![facet(&ell)]);
        assert_eq!(mesh.triangle_count(), 4);
        assert!((traced_area(&mesh) - 3.0).abs() < 1e-12);
        for i in 0..4 {
            assert!(area_vector(&mesh.triangle(i)).z > 0.0);
        }
        assert_eq!(mesh.facets().len(), 1);
        assert_eq!(mesh.facets().next().unwrap(), facet(&ell));
    }

    /// Corners in the middle of an edge stay corners of triangles, so that neighbours with the same corner fit.
    #[test]
    fn corners_in_the_middle_of_edges_are_kept() {
        let strip = [
            [0., 0., 0.],
            [1., 0., 0.],
            [2., 0., 0.],
            [3., 0., 0.],
            [3., 1., 0.],
            [3., 2., 0.],
            [1.5, 2., 0.],
            [0., 2., 0.],
        ];
        let mesh = Mesh::from_facets(vec![facet(&strip)]);
        let mut used: Vec<u32> = mesh.triangles.iter().flatten().copied().collect();
        used.sort_unstable();
        used.dedup();
        assert_eq!(used.len(), 8);
        assert_eq!(mesh.triangle_count(), 6);
        assert!((traced_area(&mesh) - 6.0).abs() < 1e-12);
    }

    /// 100,000 copies of a facet cost one in tracing; its reverse is another facet and stays.
    #[test]
    fn exact_duplicates_are_traced_once() {
        let up = facet(&[[0., 0., 0.], [1., 0., 0.], [0., 1., 0.]]);
        let down = facet(&[[0., 0., 0.], [0., 1., 0.], [1., 0., 0.]]);
        let mut facets = vec![up; 100_000];
        facets.push(down);
        let mesh = Mesh::from_facets(facets);
        assert_eq!((mesh.triangle_count(), mesh.facet_count(), mesh.vertices.len()), (2, 100_001, 3));
    }
}
