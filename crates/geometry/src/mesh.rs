//! A faceted shape in its own frame.

use crate::facet::{Ring, area_vector, flatten, sound_triangle};
use crate::{Facet, FacetError, MaterialId};
use earcut::Earcut;
use glam::{DAffine3, DVec2, DVec3};
use std::collections::HashMap;

/// A faceted shape in its own frame, shared by its instances. Corners keep their `f64` coordinates; equal corners are
/// stored once, so that facets which share an edge share it to the last bit and no ray passes between them.
///
/// A mesh of triangles takes 12 + 24 bytes a facet and 24 a vertex; what other shapes need more is stored where one occurs.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    pub(crate) vertices: Vec<DVec3>,
    /// Vertices of what is traced, the smallest index first.
    pub(crate) triangles: Vec<[u32; 3]>,
    /// Unit normals of the facets.
    normals: Vec<DVec3>,
    /// Materials of the facets; the last holds for all that follow.
    materials: Vec<MaterialId>,
    /// Facets whose corners are off one plane by more than rounding; their triangles go by their own normals. What lies
    /// beyond the end is not bent.
    bent: Vec<bool>,
    /// `None` while facet i is triangle i.
    polygons: Option<Polygons>,
}

#[derive(Clone, Debug)]
struct Polygons {
    /// Facet `i` has the corners `corners[first_corner[i]..first_corner[i + 1]]`.
    first_corner: Vec<u32>,
    corners: Vec<u32>,
    facet_of: Vec<u32>,
}

impl Mesh {
    /// Triangulates the facets, concave ones too. Facets keep their indices; what has no area is not traced, and of
    /// triangles with the same three corners and the same front only the first is.
    pub fn from_facets(facets: Vec<Facet>) -> Self {
        let mut builder = MeshBuilder::with_capacity(facets.len());
        for facet in &facets {
            builder.add(facet);
        }
        builder.finish()
    }

    /// The mesh of triangles over shared corners, taken as they are: `triangles` holds indices into `positions` \[m\],
    /// counter-clockwise seen from the front, and `material` gives the material of each. Equal corners must be one
    /// position, else rays may pass between neighbours; positions that no triangle uses are left out. Triangles keep their
    /// indices as facets; one that names a corner twice is not traced.
    ///
    /// # Panics
    /// Where an index is not below the number of positions.
    pub fn from_triangles(
        mut positions: Vec<DVec3>,
        mut triangles: Vec<[u32; 3]>,
        material: impl Fn(usize) -> MaterialId,
    ) -> Self {
        let mut index = vec![u32::MAX; positions.len()];
        for &v in triangles.iter().flatten() {
            index[v as usize] = 0;
        }
        let mut used = 0;
        for i in 0..positions.len() {
            if index[i] == 0 {
                index[i] = used;
                positions[used as usize] = positions[i];
                used += 1;
            }
        }
        positions.truncate(used as usize);
        triangles.iter_mut().flatten().for_each(|v| *v = index[*v as usize]);
        drop(index);
        let mut mesh = Self { vertices: positions, ..Self::default() };
        let normal = |t: &[u32; 3]| area_vector(&t.map(|v| mesh.vertices[v as usize])).normalize_or_zero();
        mesh.normals = triangles.iter().map(normal).collect();
        for i in 0..triangles.len() {
            mesh.set_material(i, material(i));
        }
        if triangles.iter().any(|&[a, b, c]| a == b || b == c || c == a) {
            let (facet_of, traced) = (triangles.iter().enumerate())
                .filter(|&(_, &[a, b, c])| a != b && b != c && c != a)
                .map(|(i, &t)| (i as u32, rotated(t)))
                .unzip();
            let first_corner = (0..=triangles.len() as u32).map(|i| 3 * i).collect();
            let corners = triangles.into_iter().flatten().collect();
            mesh.polygons = Some(Polygons { first_corner, corners, facet_of });
            mesh.triangles = traced;
        } else {
            triangles.iter_mut().for_each(|t| *t = rotated(*t));
            mesh.triangles = triangles;
        }
        mesh
    }

    /// Number of facets.
    pub fn facet_count(&self) -> usize {
        self.normals.len()
    }
    /// Number of triangles that are traced.
    pub fn triangle_count(&self) -> usize {
        self.triangles.len()
    }
    /// The facets in the order given; a facet may begin at another of its corners.
    pub fn facets(&self) -> impl ExactSizeIterator<Item = Facet> + '_ {
        (0..self.facet_count()).map(|i| self.facet(i))
    }
    /// Facet `i`, which must be below [`Mesh::facet_count`].
    pub fn facet(&self, i: usize) -> Facet {
        let corners: Vec<DVec3> = self.ring(i).iter().map(|&v| self.vertices[v as usize]).collect();
        let area = 0.5 * area_vector(&corners).length();
        Facet { corners, normal: self.normals[i], area, material: self.material(i) }
    }
    /// Lowest and highest coordinates \[m\]; `None` without facets.
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        let first = *self.vertices.first()?;
        Some(self.vertices.iter().fold((first, first), |(lo, hi), &v| (lo.min(v), hi.max(v))))
    }

    /// Unit normal of a triangle: its facet's, or its own if the facet is bent.
    #[inline]
    pub(crate) fn normal(&self, triangle: u32, corners: [&DVec3; 3]) -> DVec3 {
        let facet = self.facet_of(triangle) as usize;
        if self.is_bent(facet) {
            area_vector(&corners.map(|c| *c)).normalize_or(self.normals[facet])
        } else {
            self.normals[facet]
        }
    }
    /// Whether a facet's corners are off one plane by more than rounding.
    pub(crate) fn is_bent(&self, facet: usize) -> bool {
        self.bent.get(facet) == Some(&true)
    }
    /// The facet of a triangle.
    #[inline]
    pub(crate) fn facet_of(&self, triangle: u32) -> u32 {
        self.polygons.as_ref().map_or(triangle, |p| p.facet_of[triangle as usize])
    }
    /// Material of a facet.
    pub fn material(&self, facet: usize) -> MaterialId {
        self.materials.get(facet).or(self.materials.last()).copied().unwrap_or(MaterialId(0))
    }
    pub(crate) fn ring(&self, facet: usize) -> &[u32] {
        match &self.polygons {
            None => &self.triangles[facet],
            Some(p) => &p.corners[p.first_corner[facet] as usize..p.first_corner[facet + 1] as usize],
        }
    }
    pub(crate) fn triangle(&self, i: usize) -> [DVec3; 3] {
        self.corners(i).map(|corner| *corner)
    }
    /// The corners of triangle `i` where they lie.
    #[inline(always)]
    pub(crate) fn corners(&self, i: usize) -> [&DVec3; 3] {
        self.triangles[i].map(|v| &self.vertices[v as usize])
    }
    pub(crate) fn memory_bytes(&self) -> usize {
        let words = |p: &Polygons| p.first_corner.len() + p.corners.len() + p.facet_of.len();
        size_of_val(&self.vertices[..])
            + size_of_val(&self.normals[..])
            + size_of_val(&self.triangles[..])
            + self.bent.len()
            + 4 * (self.materials.len() + self.polygons.as_ref().map_or(0, words))
    }

    /// Materials are set in the order of the facets.
    fn set_material(&mut self, facet: usize, material: MaterialId) {
        match self.materials.last() {
            Some(&last) if last == material => {}
            Some(&last) => {
                self.materials.resize(facet, last);
                self.materials.push(material);
            }
            None => self.materials.push(material),
        }
    }
}

/// The same triangle, its smallest index first.
fn rotated([a, b, c]: [u32; 3]) -> [u32; 3] {
    if a < b && a < c {
        [a, b, c]
    } else if b < c {
        [b, c, a]
    } else {
        [c, a, b]
    }
}

/// A mesh in the making: facets of any kind in any order, without an allocation each.
#[derive(Default)]
pub struct MeshBuilder {
    mesh: Mesh,
    vertex_table: Table,
    triangle_table: Table,
    cutter: Triangulation,
    ring: Ring,
    indices: Vec<u32>,
    cut: Vec<[u32; 3]>,
}

impl MeshBuilder {
    /// An empty mesh.
    pub fn new() -> Self {
        Self::default()
    }
    /// An empty mesh with room for so many triangles.
    pub fn with_capacity(facets: usize) -> Self {
        let mut builder = Self::default();
        builder.mesh.normals.reserve_exact(facets);
        builder.mesh.triangles.reserve_exact(facets);
        builder
    }
    /// An empty mesh with room for so many triangles over so many corners, tables and all.
    pub(crate) fn with_room(triangles: usize, corners: usize) -> Self {
        let mut builder = Self::with_capacity(triangles);
        builder.mesh.vertices.reserve_exact(corners);
        builder.triangle_table.reserve(triangles);
        builder.vertex_table.reserve(corners);
        builder
    }
    /// Facets so far.
    pub fn facet_count(&self) -> usize {
        self.mesh.facet_count()
    }
    /// Whether nothing was added yet.
    pub fn is_empty(&self) -> bool {
        self.facet_count() == 0
    }

    /// Adds the planar polygon of `corners` \[m\], held to what [`Facet::new`] asks.
    ///
    /// # Errors
    /// See [`FacetError`]; nothing is added then.
    pub fn push(&mut self, corners: &[DVec3], material: MaterialId) -> Result<(), FacetError> {
        let mut ring = std::mem::take(&mut self.ring);
        let examined = ring.examine(corners);
        if let Ok((normal, _)) = examined {
            self.put(&ring.corners, normal, material);
        }
        self.ring = ring;
        examined.map(|_| ())
    }

    /// Adds a facet as it is.
    pub fn add(&mut self, facet: &Facet) {
        self.put(&facet.corners, facet.normal, facet.material);
    }

    /// Adds all facets of a mesh, moved, turned and scaled uniformly by `pose`.
    pub fn append(&mut self, mesh: Mesh, pose: &DAffine3) {
        let in_place = *pose == DAffine3::IDENTITY;
        if in_place && self.is_empty() {
            self.mesh = mesh;
            return;
        }
        let mut corners = Vec::new();
        for i in 0..mesh.facet_count() {
            corners.clear();
            corners.extend(mesh.ring(i).iter().map(|&v| pose.transform_point3(mesh.vertices[v as usize])));
            let normal = if in_place { mesh.normals[i] } else { area_vector(&corners).normalize_or(mesh.normals[i]) };
            self.put(&corners, normal, mesh.material(i));
        }
    }

    /// The mesh of all that was added.
    pub fn finish(self) -> Mesh {
        let mut mesh = self.mesh;
        mesh.vertices.shrink_to_fit();
        mesh.normals.shrink_to_fit();
        mesh.triangles.shrink_to_fit();
        mesh.materials.shrink_to_fit();
        if let Some(polygons) = &mut mesh.polygons {
            polygons.first_corner.shrink_to_fit();
            polygons.corners.shrink_to_fit();
            polygons.facet_of.shrink_to_fit();
        }
        mesh
    }

    /// Adds a triangle of `positions`, as [`MeshBuilder::push`]; `known` holds the mesh's vertex of each position once it is
    /// used, `u32::MAX` before.
    pub(crate) fn push_shared(
        &mut self,
        triangle: [usize; 3],
        positions: &[DVec3],
        known: &mut [u32],
        material: MaterialId,
    ) -> Result<(), FacetError> {
        let corners = triangle.map(|i| positions[i]);
        let (normal, _) = match sound_triangle(&corners) {
            Some(sound) => sound,
            None => self.ring.examine(&corners)?,
        };
        self.catch_up();
        self.indices.clear();
        for (i, corner) in triangle.into_iter().zip(corners) {
            if known[i] == u32::MAX {
                known[i] = self.vertex(corner);
            }
            self.indices.push(known[i]);
        }
        self.put_indexed(&corners, normal, material);
        Ok(())
    }

    fn put(&mut self, corners: &[DVec3], normal: DVec3, material: MaterialId) {
        self.catch_up();
        self.indices.clear();
        for &corner in corners {
            let vertex = self.vertex(corner);
            self.indices.push(vertex);
        }
        self.put_indexed(corners, normal, material);
    }

    /// A facet whose vertices are in `self.indices`.
    fn put_indexed(&mut self, corners: &[DVec3], normal: DVec3, material: MaterialId) {
        let facet = self.mesh.facet_count();
        self.cut.clear();
        let indices = &self.indices;
        self.cut.extend(self.cutter.cut(corners, normal).map(|t| t.map(|i| indices[i])));
        let traced = self.mesh.triangles.len();
        for &triangle in &self.cut {
            let [a, b, c] = triangle;
            if a != b && b != c && c != a {
                let triangle = rotated(triangle);
                let (new, triangles) = (self.mesh.triangles.len() as u32, &self.mesh.triangles);
                let of = |i: u32| hash(triangles[i as usize].map(u64::from));
                let key = hash(triangle.map(u64::from));
                if self.triangle_table.find(key, new, |i| triangles[i as usize] == triangle, of).is_none() {
                    self.mesh.triangles.push(triangle);
                }
            }
        }
        let mesh = &mut self.mesh;
        let more = mesh.triangles.len() - traced;
        if mesh.polygons.is_none() && (corners.len() != 3 || more != 1) {
            mesh.polygons = Some(Polygons {
                first_corner: (0..=facet as u32).map(|i| 3 * i).collect(),
                corners: mesh.triangles[..traced].as_flattened().to_vec(),
                facet_of: (0..facet as u32).collect(),
            });
        }
        if let Some(polygons) = &mut mesh.polygons {
            polygons.corners.extend_from_slice(&self.indices);
            polygons.first_corner.push(polygons.corners.len() as u32);
            polygons.facet_of.resize(polygons.facet_of.len() + more, facet as u32);
        }
        mesh.normals.push(normal);
        mesh.set_material(facet, material);
        if corners.len() > 3 {
            let reach = corners.iter().map(|c| c.abs().max_element()).fold(0.0, f64::max);
            let off = |c: &DVec3| normal.dot(c - corners[0]).abs();
            if corners.iter().any(|c| off(c) > 4.0 * f64::EPSILON * reach) {
                mesh.bent.resize(facet, false);
                mesh.bent.push(true);
            }
        }
    }

    fn vertex(&mut self, corner: DVec3) -> u32 {
        let vertices = &mut self.mesh.vertices;
        let new = vertices.len() as u32;
        let (same, of) = (|i: u32| vertices[i as usize] == corner, |i: u32| hash(bits(vertices[i as usize])));
        let found = self.vertex_table.find(hash(bits(corner)), new, same, of);
        found.unwrap_or_else(|| {
            vertices.push(corner);
            new
        })
    }

    /// Enters into the tables what came with a mesh that was taken over.
    fn catch_up(&mut self) {
        let (vertices, triangles) = (&self.mesh.vertices, &self.mesh.triangles);
        for i in self.vertex_table.entered..vertices.len() as u32 {
            let of = |j: u32| hash(bits(vertices[j as usize]));
            self.vertex_table.find(of(i), i, |j| vertices[j as usize] == vertices[i as usize], of);
        }
        for i in self.triangle_table.entered..triangles.len() as u32 {
            let of = |j: u32| hash(triangles[j as usize].map(u64::from));
            self.triangle_table.find(of(i), i, |j| triangles[j as usize] == triangles[i as usize], of);
        }
    }
}

/// Key of a corner; + 0.0 makes the two zeros one.
fn bits(corner: DVec3) -> [u64; 3] {
    corner.to_array().map(|x| (x + 0.0).to_bits())
}

/// Folded products, good in all bits for keys that come from coordinates and indices.
fn hash(key: [u64; 3]) -> u64 {
    key.into_iter().fold(0x243f_6a88_85a3_08d3, |h, x| {
        let product = u128::from(h ^ x) * 0x9e37_79b9_7f4a_7c15_u128;
        (product as u64 ^ (product >> 64) as u64).rotate_left(29).wrapping_add(x)
    })
}

/// Indices by the hash of what they stand for, four to eight bytes each.
#[derive(Default)]
struct Table {
    slots: Vec<u32>,
    used: usize,
    /// One more than the largest index handed in.
    entered: u32,
}

const FREE: u32 = u32::MAX;

impl Table {
    fn reserve(&mut self, entries: usize) {
        let slots = (entries + entries / 3 + 2).next_power_of_two().max(16);
        if self.used == 0 && slots > self.slots.len() {
            self.slots = vec![FREE; slots];
        }
    }

    /// The index that has the same key; else `new` is entered, and `None`. `of` gives the hash of an index.
    fn find(&mut self, hash: u64, new: u32, same: impl Fn(u32) -> bool, of: impl Fn(u32) -> u64) -> Option<u32> {
        self.entered = self.entered.max(new + 1);
        if 4 * (self.used + 1) > 3 * self.slots.len() {
            let old = std::mem::take(&mut self.slots);
            self.slots = vec![FREE; (2 * old.len()).max(16)];
            for i in old.into_iter().filter(|&i| i != FREE) {
                let at = self.free_from(of(i));
                self.slots[at] = i;
            }
        }
        let mask = self.slots.len() - 1;
        let mut at = hash as usize & mask;
        while self.slots[at] != FREE {
            if same(self.slots[at]) {
                return Some(self.slots[at]);
            }
            at = (at + 1) & mask;
        }
        self.slots[at] = new;
        self.used += 1;
        None
    }

    fn free_from(&self, hash: u64) -> usize {
        let mask = self.slots.len() - 1;
        let mut at = hash as usize & mask;
        while self.slots[at] != FREE {
            at = (at + 1) & mask;
        }
        at
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

    /// Quads of a grid as shared triangles, as facets, and as facets appended in two parts: the same corners, facets,
    /// materials and traced triangles, whichever way they came.
    #[test]
    fn packed_triangles_are_the_same_mesh_as_facets() {
        let n = 12_u32;
        let at = |i: u32, j: u32| j * (n + 1) + i;
        let positions: Vec<DVec3> = (0..=n)
            .flat_map(|j| (0..=n).map(move |i| DVec3::new(f64::from(i), f64::from(j), f64::from((i * 7 + j * 3) % 5))))
            .chain([DVec3::splat(f64::NAN)])
            .collect();
        let triangles: Vec<[u32; 3]> = (0..n * n)
            .map(|k| (k % n, k / n))
            .flat_map(|(i, j)| [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]])
            .collect();
        let material = |i: usize| MaterialId((i > 40 && i < 200) as u32 * 3 + (i > 100) as u32);
        let facets: Vec<Facet> = (triangles.iter().enumerate())
            .map(|(i, t)| Facet::new(t.map(|v| positions[v as usize]).to_vec(), material(i)).unwrap())
            .collect();
        let packed = Mesh::from_triangles(positions.clone(), triangles, material);
        let mut builder = MeshBuilder::new();
        builder.append(Mesh::from_facets(facets[..100].to_vec()), &DAffine3::IDENTITY);
        for facet in &facets[100..] {
            builder.push(&facet.corners, facet.material).unwrap();
        }
        builder.add(&facets[7]);
        let grown = builder.finish();
        assert_eq!((grown.triangle_count(), grown.facet_count()), (facets.len(), facets.len() + 1));
        assert_eq!(packed.bounds(), grown.bounds());
        for mesh in [&packed, &Mesh::from_facets(facets.clone()), &grown] {
            assert_eq!(mesh.vertices.len(), positions.len() - 1);
            assert_eq!(mesh.triangle_count(), facets.len());
            for (i, (got, want)) in mesh.facets().zip(&facets).enumerate() {
                let turn = got.corners.iter().position(|c| *c == want.corners[0]).unwrap();
                let corners: Vec<DVec3> = (0..3).map(|k| got.corners[(turn + k) % 3]).collect();
                assert_eq!((corners, got.normal, got.material), (want.corners.clone(), want.normal, material(i)));
            }
        }
        let twice = Mesh::from_triangles(positions[..3].to_vec(), vec![[0, 0, 1], [0, 1, 2]], |_| MaterialId(1));
        assert_eq!((twice.facet_count(), twice.triangle_count(), twice.facet_of(0)), (2, 1, 1));
    }
}
