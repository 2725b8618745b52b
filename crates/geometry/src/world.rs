//! The world: instances of meshes and the endless ground, and the rays through them.

use crate::accel::{Block, Bounds, BoxRay, MOST_ENTRIES, T_UP, Tree, TriangleRay, TriangleTree};
use crate::clearance::OpenCache;
use crate::facet::area_vector;
use crate::{Facet, FacetId, GROUND_OBJECT, Hit, Instance, MaterialId, Mesh, Ray};
use glam::{DAffine3, DMat3, DVec3};
use rayon::prelude::*;

/// Largest coordinate of the world, and 10³ times that in an object's frame \[m\].
pub const LARGEST_COORDINATE: f64 = 1e9;

/// Instances that are looked at one by one.
const FEW: usize = 4;

/// An endless level plane whose front looks up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ground {
    /// Height \[m\].
    pub height: f64,
    /// Material of the ground.
    pub material: MaterialId,
}

/// Why no world could be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum WorldError {
    /// A corner, a pose or the ground's height is infinite or not a number.
    #[error("{what} has a coordinate that is not finite")]
    NotFinite {
        /// The object, or the ground.
        what: String,
    },
    /// Farther from the origin than [`LARGEST_COORDINATE`].
    #[error("{what} reaches {reach_m:.3e} m from the origin, the limit is {limit_m:.0e} m")]
    TooLarge {
        /// The object, or the ground.
        what: String,
        /// Its largest coordinate \[m\].
        reach_m: f64,
        /// What is allowed there \[m\].
        limit_m: f64,
    },
    /// A pose that flattens the object.
    #[error("{what} is placed with a scale of zero in some direction")]
    Flattened {
        /// The object.
        what: String,
    },
    /// An instance of a mesh that is not there.
    #[error("{what} uses mesh {mesh}, of {meshes}")]
    NoSuchMesh {
        /// The object.
        what: String,
        /// The index asked for.
        mesh: usize,
        /// How many there are.
        meshes: usize,
    },
    /// More than indices can count.
    #[error("{count} {what}, the limit is {limit}")]
    TooMany {
        /// What there is too much of.
        what: &'static str,
        /// How many.
        count: u64,
        /// How many are allowed.
        limit: u64,
    },
}

/// An instance ready for rays.
#[derive(Clone, Debug)]
pub(crate) struct Placed {
    pub mesh: usize,
    pub to_world: DAffine3,
    pub from_world: DAffine3,
    /// Whether object and world coordinates are the same.
    pub in_place: bool,
    pub first_facet: u32,
    /// Row sums of |M| and of |M||M⁻¹|, at most, and the largest |translation|: for error bounds.
    stretch: f64,
    pub condition: f64,
    shift: f64,
}

impl Placed {
    /// Largest magnitude in sums of the pose for object coordinates up to `reach`.
    pub fn magnitude(&self, reach: f64) -> f64 {
        self.stretch * reach + self.shift
    }
    /// The world's normal of an object's; the front stays the front in a mirrored instance.
    pub fn normal(&self, n: DVec3) -> DVec3 {
        if self.in_place { n } else { (self.from_world.matrix3.transpose() * n).normalize() }
    }
}

/// The tree over instances.
#[derive(Clone, Debug)]
pub(crate) struct Top {
    pub block: Block,
    pub tree: Tree,
    pub order: Vec<u32>,
}

/// All that rays can meet.
#[derive(Debug)]
pub struct World {
    meshes: Vec<Mesh>,
    pub(crate) trees: Vec<Option<TriangleTree>>,
    instances: Vec<Instance>,
    pub(crate) placed: Vec<Placed>,
    pub(crate) top: Option<Top>,
    ground: Option<Ground>,
    facet_count: usize,
    triangle_count: usize,
    pub(crate) open: OpenCache,
}

impl World {
    /// Checks everything, then builds a tree of triangles a mesh, and one of instances.
    ///
    /// # Errors
    /// See [`WorldError`].
    pub fn new(meshes: Vec<Mesh>, instances: Vec<Instance>, ground: Option<Ground>) -> Result<Self, WorldError> {
        if let Some(ground) = ground {
            let what = || "the ground".to_owned();
            if !ground.height.is_finite() {
                return Err(WorldError::NotFinite { what: what() });
            }
            within(ground.height.abs(), LARGEST_COORDINATE, what)?;
        }
        let count = |what, count: u64, limit: u64| {
            if count > limit { Err(WorldError::TooMany { what, count, limit }) } else { Ok(()) }
        };
        count("instances", instances.len() as u64, MOST_ENTRIES as u64)?;
        let mut uses = vec![0_usize; meshes.len()];
        for i in &instances {
            let missing = || WorldError::NoSuchMesh { what: i.name.clone(), mesh: i.mesh, meshes: meshes.len() };
            *uses.get_mut(i.mesh).ok_or_else(missing)? += 1;
        }
        for (index, mesh) in meshes.iter().enumerate() {
            let of = || instances.iter().find(|i| i.mesh == index).map_or(format!("mesh {index}"), |i| i.name.clone());
            count("triangles in a mesh", mesh.triangle_count() as u64, MOST_ENTRIES as u64)?;
            if mesh.vertices.iter().any(|v| !v.is_finite()) {
                return Err(WorldError::NotFinite { what: of() });
            }
            if let Some((lo, hi)) = mesh.bounds() {
                within(lo.abs().max(hi.abs()).max_element(), 1e3 * LARGEST_COORDINATE, of)?;
            }
        }

        let (mut placed, mut first_facet, mut triangle_count) = (Vec::with_capacity(instances.len()), 0_u64, 0_usize);
        for i in &instances {
            placed.push(place(i, first_facet as u32)?);
            first_facet += meshes[i.mesh].facet_count() as u64;
            count("facets", first_facet, u64::from(u32::MAX) - 1)?;
            triangle_count += meshes[i.mesh].triangle_count();
        }
        let boxes: Vec<Option<(DVec3, DVec3)>> =
            instances.par_iter().map(|i| world_box(&meshes[i.mesh], &i.pose, uses[i.mesh])).collect();
        for (i, b) in instances.iter().zip(&boxes) {
            if let Some((lo, hi)) = b {
                within(lo.abs().max(hi.abs()).max_element(), LARGEST_COORDINATE, || i.name.clone())?;
            }
        }
        let trees = meshes
            .par_iter()
            .zip(&uses)
            .map(|(m, &uses)| TriangleTree::build(if uses > 0 { m.triangle_count() } else { 0 }, &|t| m.triangle(t)))
            .collect();
        Ok(Self {
            top: Top::build(&boxes),
            open: OpenCache::new(first_facet as usize),
            facet_count: first_facet as usize,
            meshes,
            trees,
            instances,
            placed,
            ground,
            triangle_count,
        })
    }

    /// The nearest hit. Of facets at the same place the one seen from its front counts, then the first; a facet that lies
    /// on the ground hides it.
    pub fn closest(&self, ray: &Ray) -> Option<Hit> {
        let mut best = Best { t: ray.t_max, end: ray.t_max, tolerance: 0.0, found: None };
        self.trace::<true>(ray, &mut best);
        let facet = best.found.as_ref().map(|found| self.hit(ray, best.t, found));
        let Some((ground, t)) = self.ground.as_ref().and_then(|g| Some((g, meet_ground(g, ray)?))) else {
            return facet;
        };
        match facet {
            Some(hit) if hit.t <= t || (hit.point.z - ground.height).abs() <= 2.0 * hit.error => Some(hit),
            _ => Some(ground_hit(ground, ray, t)),
        }
    }

    /// Whether anything is met.
    pub fn occluded(&self, ray: &Ray) -> bool {
        self.ground.as_ref().is_some_and(|g| meet_ground(g, ray).is_some())
            || self.trace::<false>(ray, &mut Best { t: ray.t_max, end: ray.t_max, tolerance: 0.0, found: None })
    }

    /// Lowest and highest coordinates of the facets \[m\], the ground left out; `None` without facets.
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        self.top.as_ref().map(|t| (t.block.lo, t.block.hi))
    }
    /// Facets, counted once an instance; the ground is not counted.
    pub const fn facet_count(&self) -> usize {
        self.facet_count
    }
    /// Traced triangles, counted once an instance.
    pub const fn triangle_count(&self) -> usize {
        self.triangle_count
    }
    /// The instances as given.
    pub fn instances(&self) -> &[Instance] {
        &self.instances
    }
    /// The meshes as given.
    pub fn meshes(&self) -> &[Mesh] {
        &self.meshes
    }
    /// The ground.
    pub const fn ground(&self) -> Option<&Ground> {
        self.ground.as_ref()
    }
    /// Memory in use, near enough.
    pub fn memory_bytes(&self) -> usize {
        self.meshes.iter().map(Mesh::memory_bytes).sum::<usize>()
            + self.trees.iter().flatten().map(TriangleTree::memory_bytes).sum::<usize>()
            + self.top.as_ref().map_or(0, |t| t.tree.memory_bytes() + size_of_val(&t.order[..]))
            + size_of_val(&self.placed[..])
            + self.instances.iter().map(|i| size_of_val(i) + i.name.capacity()).sum::<usize>()
            + self.open.memory_bytes()
    }

    /// A facet in the world. The ground has no corners, an infinite area, and is what an id beyond the last facet gets too
    /// if there is a ground.
    pub fn facet(&self, id: FacetId) -> Facet {
        let Some((instance, index)) = self.locate(id) else {
            let material = self.ground.map_or(MaterialId(0), |g| g.material);
            return Facet { corners: Vec::new(), normal: DVec3::Z, area: f64::INFINITY, material };
        };
        let placed = &self.placed[instance];
        let mut facet = self.meshes[placed.mesh].facet(index);
        if !placed.in_place {
            for c in &mut facet.corners {
                *c = placed.to_world.transform_point3(*c);
            }
            facet.normal = placed.normal(facet.normal);
            if placed.to_world.matrix3.determinant() < 0.0 {
                facet.corners.reverse();
            }
            facet.area = 0.5 * area_vector(&facet.corners).length();
        }
        facet
    }

    /// Instance and facet of its mesh; `None` for the ground.
    pub(crate) fn locate(&self, id: FacetId) -> Option<(usize, usize)> {
        let instance = self.placed.partition_point(|p| p.first_facet <= id.0).checked_sub(1)?;
        let index = (id.0 - self.placed[instance].first_facet) as usize;
        (index < self.meshes[self.placed[instance].mesh].facet_count()).then_some((instance, index))
    }

    /// Lowers `best` to the nearest facet if `CLOSEST`, else answers whether there is any before its `t`.
    #[inline(always)]
    fn trace<const CLOSEST: bool>(&self, ray: &Ray, best: &mut Best) -> bool {
        let (o, d) = (ray.origin, ray.direction.vec());
        let Some(top) = &self.top else { return false };
        if top.order.len() <= FEW {
            return top.order.iter().any(|&instance| self.trace_instance::<CLOSEST>(instance, o, d, best));
        }
        let Some((enter, leave)) = top.block.clip(o, d, best.t) else { return false };
        let box_ray = BoxRay::new(o + d * enter - top.block.centre, d);
        let until = |best: &Best| ((best.t + best.tolerance).min(leave) - enter) as f32 * T_UP;
        top.tree.walk::<CLOSEST>(&box_ray, until(best), |first, count, t_max| {
            for &instance in &top.order[first..first + count] {
                if self.trace_instance::<CLOSEST>(instance, o, d, best) {
                    return true;
                }
            }
            *t_max = until(best);
            false
        })
    }

    #[inline]
    fn trace_instance<const CLOSEST: bool>(&self, instance: u32, o: DVec3, d: DVec3, best: &mut Best) -> bool {
        let placed = &self.placed[instance as usize];
        let Some(TriangleTree { block, tree, packets }) = &self.trees[placed.mesh] else { return false };
        let mesh = &self.meshes[placed.mesh];
        let (o, d, length) = if placed.in_place {
            (o, d, 1.0)
        } else {
            let d = placed.from_world.transform_vector3(d);
            (placed.from_world.transform_point3(o), d, d.length())
        };
        // t runs in the world's metres; in the block the ray starts at its entry and runs in the object's lengths
        let Some((enter, leave)) = block.clip(o, d, best.t + best.tolerance) else { return false };
        let (start, unit) = (o + d * enter, d / length);
        let box_ray = BoxRay::new(start - block.centre, unit);
        let ray = TriangleRay::new(block, start, unit);
        let until = |best: &Best| (((best.t + best.tolerance).min(leave) - enter) * length) as f32 * T_UP;
        tree.walk::<CLOSEST>(&box_ray, until(best), |first, count, t_max| {
            for packet in &packets[first..first + count] {
                let mut left = ray.filter(packet);
                while left != 0 {
                    let triangle = packet.triangle[left.trailing_zeros() as usize & 3];
                    left &= left - 1;
                    let corners = mesh.triangle(triangle as usize);
                    let normal = mesh.normal(triangle, &corners);
                    let Some((s, weights)) = ray.meet(corners, normal) else { continue };
                    let t = enter + s / length;
                    if !(t > 0.0 && t < best.end) {
                        continue;
                    }
                    if !CLOSEST {
                        return true;
                    }
                    // Closer than this across the facet, the rounding of corners and of the ray's start would decide.
                    let cos = normal.dot(unit);
                    let reach = block.lo.abs().max(block.hi.abs()).max_element();
                    let tolerance = 16.0 * f64::EPSILON * (reach / length + t) / cos.abs().max(1e-3);
                    if t > best.t + tolerance {
                        continue;
                    }
                    let front = cos <= 0.0;
                    let found = Found { instance, triangle, weights, front };
                    let better = match &best.found {
                        Some(old) if t > best.t - tolerance => found.rank() < old.rank(),
                        _ => true,
                    };
                    if better {
                        (best.t, best.tolerance, best.found) = (t, tolerance, Some(found));
                    }
                }
            }
            *t_max = until(best);
            false
        })
    }

    fn hit(&self, ray: &Ray, t: f64, found: &Found) -> Hit {
        let placed = &self.placed[found.instance as usize];
        let mesh = &self.meshes[placed.mesh];
        let corners @ [a, b, c] = mesh.triangle(found.triangle as usize);
        let [u, v, w] = found.weights;
        let point = u * a + v * b + w * c;
        let point = if placed.in_place { point } else { placed.to_world.transform_point3(point) };
        let index = mesh.facet_of(found.triangle);
        let normal = placed.normal(mesh.normal(found.triangle, &corners));
        // With u the unit roundoff: weights and their sum 7 u |v| [PBRT 4e, eq. 6.27]; the pose there 4 u and, for rays that
        // start here, back 4 u, each on all its terms; corner − origin and shear 5 u. In all less than 16 u of the largest
        // term, and that times |M||M⁻¹| where there is a pose.
        let reach = a.abs().max(b.abs()).max(c.abs()).max_element();
        let terms = placed.magnitude(reach) + point.abs().max_element();
        Hit {
            t,
            point,
            error: 8.0 * f64::EPSILON * placed.condition * terms,
            normal: if found.front { normal } else { -normal },
            front: found.front,
            material: mesh.material(index as usize),
            instance: self.instances[found.instance as usize].id,
            facet: FacetId(placed.first_facet + index),
        }
        .turned(ray)
    }
}

impl Hit {
    /// A normal at right angles to the ray, up to rounding, still must not look away from it.
    fn turned(mut self, ray: &Ray) -> Self {
        if self.normal.dot(ray.direction.vec()) > 0.0 {
            self.normal = -self.normal;
            self.front = !self.front;
        }
        self
    }
}

/// The nearest facet so far.
struct Best {
    t: f64,
    /// The ray's own end.
    end: f64,
    /// How far apart hits count as one.
    tolerance: f64,
    found: Option<Found>,
}

struct Found {
    instance: u32,
    triangle: u32,
    weights: [f64; 3],
    front: bool,
}

impl Found {
    const fn rank(&self) -> (bool, u32, u32) {
        (!self.front, self.instance, self.triangle)
    }
}

fn meet_ground(ground: &Ground, ray: &Ray) -> Option<f64> {
    let t = (ground.height - ray.origin.z) / ray.direction.vec().z;
    (t > 0.0 && t < ray.t_max).then_some(t)
}

fn ground_hit(ground: &Ground, ray: &Ray, t: f64) -> Hit {
    let point = ray.at(t).with_z(ground.height);
    let front = ray.direction.vec().z <= 0.0;
    Hit {
        t,
        point,
        error: 4.0 * f64::EPSILON * point.abs().max_element(),
        normal: if front { DVec3::Z } else { DVec3::NEG_Z },
        front,
        material: ground.material,
        instance: GROUND_OBJECT,
        facet: FacetId::GROUND,
    }
}

fn within(reach_m: f64, limit_m: f64, what: impl Fn() -> String) -> Result<(), WorldError> {
    if reach_m > limit_m { Err(WorldError::TooLarge { what: what(), reach_m, limit_m }) } else { Ok(()) }
}

fn place(instance: &Instance, first_facet: u32) -> Result<Placed, WorldError> {
    let what = || instance.name.clone();
    let to_world = instance.pose;
    if !to_world.is_finite() {
        return Err(WorldError::NotFinite { what: what() });
    }
    let from_world = to_world.inverse();
    let rows = |m: DMat3| (m.abs() * DVec3::ONE).max_element();
    let condition = rows(to_world.matrix3) * rows(from_world.matrix3);
    if to_world.matrix3.determinant() == 0.0 || !from_world.is_finite() || condition > 1e6 {
        return Err(WorldError::Flattened { what: what() });
    }
    Ok(Placed {
        mesh: instance.mesh,
        to_world,
        from_world,
        in_place: to_world == DAffine3::IDENTITY,
        first_facet,
        stretch: rows(to_world.matrix3),
        condition,
        shift: to_world.translation.abs().max_element(),
    })
}

/// Box of an instance: of its corners, or where that would cost more than the rest of the build, of its own box.
fn world_box(mesh: &Mesh, pose: &DAffine3, uses: usize) -> Option<(DVec3, DVec3)> {
    if mesh.triangles.is_empty() {
        return None;
    }
    let (lo, hi) = mesh.bounds()?;
    if *pose == DAffine3::IDENTITY {
        return Some((lo, hi));
    }
    let join = |b: Option<(DVec3, DVec3)>, v: DVec3| Some(b.map_or((v, v), |(l, h)| (l.min(v), h.max(v))));
    if mesh.vertices.len().saturating_mul(uses) < 1 << 24 {
        return mesh.vertices.iter().map(|&v| pose.transform_point3(v)).fold(None, join);
    }
    let corner = |i: usize| DVec3::new([lo.x, hi.x][i & 1], [lo.y, hi.y][i >> 1 & 1], [lo.z, hi.z][i >> 2]);
    (0..8).map(|i| pose.transform_point3(corner(i))).fold(None, join)
}

impl Top {
    fn build(boxes: &[Option<(DVec3, DVec3)>]) -> Option<Self> {
        let used: Vec<(u32, (DVec3, DVec3))> =
            boxes.iter().enumerate().filter_map(|(i, b)| Some((i as u32, (*b)?))).collect();
        let (lo, hi) = used.iter().map(|u| u.1).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))?;
        let block = Block::new(lo, hi);
        let bounds: Vec<Bounds> = used.iter().map(|&(_, (lo, hi))| block.bounds(lo, hi)).collect();
        let mut order = Vec::with_capacity(used.len());
        let tree = Tree::over_placements(&bounds, &mut |leaf| {
            order.extend(leaf.iter().map(|&i| used[i as usize].0));
            (order.len() - leaf.len(), leaf.len())
        });
        Some(Self { block, tree, order })
    }
}
