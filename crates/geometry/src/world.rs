//! The world: instances of meshes and the endless ground, and the rays through them.

use crate::accel::{
    Block, Bounds, BoxRay, MOST_ENTRIES, T_UP, Tree, TriangleRay, TriangleTree, WIDTH, greater, lesser,
};
use crate::clearance::OpenCache;
use crate::facet::area_vector;
use crate::{Facet, FacetId, GROUND_OBJECT, Hit, Instance, Left, MaterialId, Mesh, MeshBuilder, Ray};
use fearless_simd::{Level, Simd, dispatch};
use glam::{DAffine3, DMat3, DVec3};
use rayon::prelude::*;
use smallvec::SmallVec;

/// Largest coordinate of the world, and 10³ times that in an object's frame \[m\].
pub const LARGEST_COORDINATE: f64 = 1e9;

/// Placed meshes that are looked at one by one.
const FEW: usize = 4;

/// Triangles of small instances that are joined to one mesh; of one mesh's instances a quarter of that.
const JOINED_MOST: usize = 1 << 16;
/// The largest extent of all that is joined in that of the smallest.
const JOINED_RATIO: f64 = 1e3;

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

/// A mesh where it stands, ready for rays: an instance, or several as one.
#[derive(Clone, Debug)]
pub(crate) struct Placed {
    pub mesh: usize,
    pub to_world: DAffine3,
    pub from_world: DAffine3,
    /// Whether object and world coordinates are the same.
    pub in_place: bool,
    /// The instances whose facets it has, in their order.
    instances: SmallVec<[u32; 2]>,
    /// Row sums of |M| and of |M||M⁻¹|, at most, and the largest |translation|: for error bounds.
    stretch: f64,
    pub condition: f64,
    shift: f64,
}

impl Placed {
    fn new(mesh: usize, pose: DAffine3) -> Self {
        let from_world = pose.inverse();
        let rows = |m: DMat3| (m.abs() * DVec3::ONE).max_element();
        Self {
            mesh,
            to_world: pose,
            from_world,
            in_place: pose == DAffine3::IDENTITY,
            instances: SmallVec::new(),
            stretch: rows(pose.matrix3),
            condition: rows(pose.matrix3) * rows(from_world.matrix3),
            shift: pose.translation.abs().max_element(),
        }
    }
    /// Largest magnitude in sums of the pose for object coordinates up to `reach`.
    pub fn magnitude(&self, reach: f64) -> f64 {
        self.stretch * reach + self.shift
    }
    /// The world's normal of an object's; the front stays the front in a mirrored instance.
    pub fn normal(&self, n: DVec3) -> DVec3 {
        if self.in_place { n } else { (self.from_world.matrix3.transpose() * n).normalize() }
    }
}

/// Where an instance's facets are.
#[derive(Clone, Copy, Debug)]
struct Place {
    /// Its first facet in the world, and in the mesh that it is placed with.
    first_facet: u32,
    first: u32,
    placed: u32,
}

/// The tree over what is placed.
#[derive(Clone, Debug)]
pub(crate) struct Top {
    pub block: Block,
    pub tree: Tree,
    pub order: Vec<u32>,
}

/// All that rays can meet.
#[derive(Debug)]
pub struct World {
    /// As given, and after them what small instances make together.
    meshes: Vec<Mesh>,
    given: usize,
    pub(crate) trees: Vec<Option<TriangleTree>>,
    instances: Vec<Instance>,
    /// By instance.
    places: Vec<Place>,
    pub(crate) placed: Vec<Placed>,
    pub(crate) top: Option<Top>,
    ground: Option<Ground>,
    facet_count: usize,
    triangle_count: usize,
    pub(crate) open: OpenCache,
    /// Vectors of the machine.
    level: Level,
}

impl World {
    /// Checks everything, joins small instances to one mesh, so that a ray is made ready for it once, then builds a tree of
    /// triangles a mesh, and one of what is placed.
    ///
    /// # Errors
    /// See [`WorldError`].
    pub fn new(mut meshes: Vec<Mesh>, instances: Vec<Instance>, ground: Option<Ground>) -> Result<Self, WorldError> {
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

        let (mut first_facet, mut triangle_count) = (0_u64, 0_usize);
        let mut standing = Vec::with_capacity(instances.len());
        for i in &instances {
            standing.push((stand(i)?, first_facet as u32));
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
        let given = meshes.len();
        let joined = joinable(&meshes, &instances, &uses, &boxes);
        let mut placed = Vec::with_capacity(instances.len());
        let mut places = Vec::with_capacity(instances.len());
        let mut placed_boxes = Vec::with_capacity(instances.len());
        // What is joined stands last.
        let last = instances.iter().filter(|i| !joined[i.mesh]).count() as u32;
        let (mut together, mut all, mut box_of_all) =
            (MeshBuilder::new(), Placed::new(given, DAffine3::IDENTITY), None);
        for (index, (mut own, first_facet)) in standing.into_iter().enumerate() {
            if joined[own.mesh] {
                places.push(Place { first_facet, first: together.facet_count() as u32, placed: last });
                all.instances.push(index as u32);
                together.append(meshes[own.mesh].clone(), &own.to_world);
                box_of_all = around(box_of_all, boxes[index]);
            } else {
                places.push(Place { first_facet, first: 0, placed: placed.len() as u32 });
                own.instances.push(index as u32);
                placed.push(own);
                placed_boxes.push(boxes[index]);
            }
        }
        if !all.instances.is_empty() {
            placed.push(all);
            placed_boxes.push(box_of_all);
            meshes.push(together.finish());
        }
        let is_traced = |mesh: usize| mesh == given || uses[mesh] > 0 && !joined[mesh];
        let trees = meshes
            .par_iter()
            .enumerate()
            .map(|(i, m)| TriangleTree::build(if is_traced(i) { m.triangle_count() } else { 0 }, &|t| m.triangle(t)))
            .collect();
        Ok(Self {
            top: Top::build(&placed_boxes),
            open: OpenCache::new(first_facet as usize),
            facet_count: first_facet as usize,
            meshes,
            given,
            trees,
            instances,
            places,
            placed,
            ground,
            triangle_count,
            level: Level::new(),
        })
    }

    /// The nearest hit. Of facets at the same place the one seen from its front counts, then the first; a facet that lies
    /// on the ground hides it.
    pub fn closest(&self, ray: &Ray) -> Option<Hit> {
        let mut best = Best { t: ray.t_max, end: ray.t_max, tolerance: 0.0, found: None };
        dispatch!(self.level, simd => self.trace::<_, true>(simd, ray, &mut best));
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
        self.occluded_by(ray, &mut Occluder::default())
    }

    /// The same, where `last` stopped much the same ray before, if anything did: that is looked at first, and what stops this one,
    /// or nothing, takes its place. The answer does not depend on it.
    pub fn occluded_by(&self, ray: &Ray, last: &mut Occluder) -> bool {
        if self.ground.as_ref().is_some_and(|g| meet_ground(g, ray).is_some()) {
            return true;
        }
        if last.0.is_some_and(|(placed, triangle)| self.stops(ray, placed, triangle)) {
            return true;
        }
        let mut best = Best { t: ray.t_max, end: ray.t_max, tolerance: 0.0, found: None };
        let met = dispatch!(self.level, simd => self.trace::<_, false>(simd, ray, &mut best));
        last.0 = best.found.map(|found| (found.placed, found.triangle));
        met
    }

    /// The facet that something that stopped a ray belongs to.
    pub(crate) fn occluding_facet(&self, occluder: &Occluder) -> Option<Facet> {
        let (index, triangle) = occluder.0?;
        let placed = self.placed.get(index as usize)?;
        let mesh = self.mesh_of(placed);
        ((triangle as usize) < mesh.triangle_count())
            .then(|| self.placed_facet(placed, mesh.facet_of(triangle) as usize))
    }

    /// Whether a triangle of what is placed stops a ray, by the numbers that decide for all triangles.
    fn stops(&self, ray: &Ray, index: u32, triangle: u32) -> bool {
        let Some((placed, tree)) =
            self.placed.get(index as usize).and_then(|p| Some((p, self.trees[p.mesh].as_ref()?)))
        else {
            return false;
        };
        let mesh = self.mesh_of(placed);
        if triangle as usize >= mesh.triangle_count()
            || ray.left == (Left { placed: index, facet: mesh.facet_of(triangle) })
        {
            return false;
        }
        let Some(local) = Local::new(placed, &tree.block, ray, ray.t_max) else { return false };
        let corners = mesh.corners(triangle as usize);
        let triangle_ray = TriangleRay::new(&tree.block, local.start, local.unit, local.inv);
        let t = local.enter + triangle_ray.distance(corners, mesh.normal(triangle, corners)).0 / local.length;
        t > 0.0 && t < ray.t_max && triangle_ray.weights(corners).is_some()
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
        &self.meshes[..self.given]
    }
    /// The mesh of what is placed.
    pub(crate) fn mesh_of(&self, placed: &Placed) -> &Mesh {
        &self.meshes[placed.mesh]
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
            + self.placed.iter().filter(|p| p.instances.spilled()).map(|p| size_of_val(&p.instances[..])).sum::<usize>()
            + size_of_val(&self.places[..])
            + self.instances.iter().map(|i| size_of_val(i) + i.name.capacity()).sum::<usize>()
            + self.open.memory_bytes()
    }

    /// A facet in the world. The ground has no corners, an infinite area, and is what an id beyond the last facet gets too
    /// if there is a ground.
    pub fn facet(&self, id: FacetId) -> Facet {
        let Some((placed, index)) = self.locate(id) else {
            let material = self.ground.map_or(MaterialId(0), |g| g.material);
            return Facet { corners: Vec::new(), normal: DVec3::Z, area: f64::INFINITY, material };
        };
        self.placed_facet(&self.placed[placed], index)
    }

    /// A facet of what is placed, in the world.
    fn placed_facet(&self, placed: &Placed, index: usize) -> Facet {
        let mut facet = self.mesh_of(placed).facet(index);
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

    /// Where it is placed, and the facet of that mesh; `None` for the ground.
    pub(crate) fn locate(&self, id: FacetId) -> Option<(usize, usize)> {
        let instance = self.places.partition_point(|p| p.first_facet <= id.0).checked_sub(1)?;
        let place = self.places[instance];
        let index = id.0 - place.first_facet;
        ((index as usize) < self.meshes[self.instances[instance].mesh].facet_count())
            .then_some((place.placed as usize, (place.first + index) as usize))
    }

    /// Lowers `best` to the nearest facet if `CLOSEST`, else answers whether there is any before its `t`.
    #[inline(always)]
    fn trace<S: Simd, const CLOSEST: bool>(&self, simd: S, ray: &Ray, best: &mut Best) -> bool {
        let (o, d) = (ray.origin, ray.direction.vec());
        let Some(top) = &self.top else { return false };
        if top.order.len() <= FEW {
            return top.order.iter().any(|&placed| self.trace_placed::<S, CLOSEST>(simd, placed, ray, best));
        }
        let inv = 1.0 / d;
        let Some((enter, leave)) = top.block.clip(o, inv, best.t) else { return false };
        let box_ray = BoxRay::new(o + d * enter - top.block.centre, inv);
        let until = |best: &Best| (lesser(best.t + best.tolerance, leave) - enter) as f32 * T_UP;
        top.tree.walk::<S, CLOSEST>(
            simd,
            &box_ray,
            until(best),
            #[inline(always)]
            |first, count, t_max| {
                for &placed in &top.order[first..first + count] {
                    if self.trace_placed::<S, CLOSEST>(simd, placed, ray, best) {
                        return true;
                    }
                }
                *t_max = until(best);
                false
            },
        )
    }

    #[inline(always)]
    fn trace_placed<S: Simd, const CLOSEST: bool>(&self, simd: S, index: u32, ray: &Ray, best: &mut Best) -> bool {
        let placed = &self.placed[index as usize];
        let Some(TriangleTree { block, tree, packets }) = &self.trees[placed.mesh] else { return false };
        let mesh = self.mesh_of(placed);
        let left_facet = if ray.left.placed == index { ray.left.facet } else { u32::MAX };
        let Some(Local { enter, leave, length, start, unit, inv }) =
            Local::new(placed, block, ray, best.t + best.tolerance)
        else {
            return false;
        };
        let reach = if placed.in_place { block.reach } else { block.reach / length };
        let box_ray = BoxRay::new(start - block.centre, inv);
        let ray = TriangleRay::new(block, start, unit, inv);
        let until = |best: &Best| ((lesser(best.t + best.tolerance, leave) - enter) * length) as f32 * T_UP;
        tree.walk::<S, CLOSEST>(
            simd,
            &box_ray,
            until(best),
            #[inline(always)]
            |first, count, t_max| {
                for packet in &packets[first..first + count] {
                    let mut left = ray.filter(simd, packet, *t_max);
                    while left != 0 {
                        let triangle = packet.triangle[left.trailing_zeros() as usize & (WIDTH - 1)];
                        left &= left - 1;
                        if mesh.facet_of(triangle) == left_facet {
                            continue;
                        }
                        let corners = mesh.corners(triangle as usize);
                        let normal = mesh.normal(triangle, corners);
                        let (s, cos) = ray.distance(corners, normal);
                        let t = enter + if placed.in_place { s } else { s / length };
                        if !(t > 0.0 && t < best.end) {
                            continue;
                        }
                        if !CLOSEST {
                            let Some(weights) = ray.weights(corners) else { continue };
                            best.found = Some(Found { placed: index, triangle, weights, front: cos <= 0.0 });
                            return true;
                        }
                        // Closer than this across the facet, the rounding of corners and of the ray's start would decide.
                        let tolerance = 16.0 * f64::EPSILON * (reach + t) / greater(cos.abs(), 1e-3);
                        if t > best.t + tolerance {
                            continue;
                        }
                        let Some(weights) = ray.weights(corners) else { continue };
                        let front = cos <= 0.0;
                        let found = Found { placed: index, triangle, weights, front };
                        let better = match &best.found {
                            Some(old) if t > best.t - tolerance => self.rank(&found) < self.rank(old),
                            _ => true,
                        };
                        if better {
                            (best.t, best.tolerance, best.found) = (t, tolerance, Some(found));
                            *t_max = until(best);
                        }
                    }
                }
                *t_max = until(best);
                false
            },
        )
    }

    /// Of hits at one place the least counts.
    fn rank(&self, found: &Found) -> (bool, u32, u32) {
        let placed = &self.placed[found.placed as usize];
        let instance = self.instance_of(placed, self.mesh_of(placed).facet_of(found.triangle));
        (!found.front, instance, found.triangle)
    }

    /// The instance that a facet of a placed mesh is of.
    fn instance_of(&self, placed: &Placed, facet: u32) -> u32 {
        match placed.instances[..] {
            [only] => only,
            ref all => all[all.partition_point(|i| self.places[*i as usize].first <= facet) - 1],
        }
    }

    fn hit(&self, ray: &Ray, t: f64, found: &Found) -> Hit {
        let placed = &self.placed[found.placed as usize];
        let mesh = self.mesh_of(placed);
        let [a, b, c] = mesh.triangle(found.triangle as usize);
        let sum = found.weights.iter().sum::<f64>();
        let [u, v, w] = found.weights.map(|weight| weight / sum);
        let point = u * a + v * b + w * c;
        let point = if placed.in_place { point } else { placed.to_world.transform_point3(point) };
        let index = mesh.facet_of(found.triangle);
        let instance = self.instance_of(placed, index) as usize;
        let Place { first_facet, first, .. } = self.places[instance];
        let normal = placed.normal(mesh.normal(found.triangle, [&a, &b, &c]));
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
            instance: self.instances[instance].id,
            facet: FacetId(first_facet + (index - first)),
            left: if mesh.is_bent(index as usize) { Left::NONE } else { Left { placed: found.placed, facet: index } },
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

/// What stopped a ray.
#[derive(Clone, Copy, Debug, Default)]
pub struct Occluder(Option<(u32, u32)>);

/// A ray where a mesh lies. t runs in the world's metres; in the mesh's block the ray starts at its entry and runs in the mesh's
/// lengths.
struct Local {
    /// t at which it enters the block, and leaves it.
    enter: f64,
    leave: f64,
    /// Of the mesh's lengths in a metre of the world.
    length: f64,
    start: DVec3,
    unit: DVec3,
    /// One over `unit`.
    inv: DVec3,
}

impl Local {
    /// `None` where the ray misses the block before `end`.
    #[inline(always)]
    fn new(placed: &Placed, block: &Block, ray: &Ray, end: f64) -> Option<Self> {
        let (o, d) = (ray.origin, ray.direction.vec());
        let (o, d, length) = if placed.in_place {
            (o, d, 1.0)
        } else {
            let d = placed.from_world.transform_vector3(d);
            (placed.from_world.transform_point3(o), d, d.length())
        };
        let inv = 1.0 / d;
        let (enter, leave) = block.clip(o, inv, end)?;
        let start = o + d * enter;
        let (unit, inv) = if placed.in_place { (d, inv) } else { (d / length, inv * length) };
        Some(Self { enter, leave, length, start, unit, inv })
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
    placed: u32,
    triangle: u32,
    /// Barycentric, times some factor.
    weights: [f64; 3],
    front: bool,
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
        left: Left::NONE,
    }
}

fn within(reach_m: f64, limit_m: f64, what: impl Fn() -> String) -> Result<(), WorldError> {
    if reach_m > limit_m { Err(WorldError::TooLarge { what: what(), reach_m, limit_m }) } else { Ok(()) }
}

/// An instance where it stands, once its pose is found sound.
fn stand(instance: &Instance) -> Result<Placed, WorldError> {
    let what = || instance.name.clone();
    if !instance.pose.is_finite() {
        return Err(WorldError::NotFinite { what: what() });
    }
    let placed = Placed::new(instance.mesh, instance.pose);
    let is_flat = instance.pose.matrix3.determinant() == 0.0 || !placed.from_world.is_finite();
    if is_flat || placed.condition > 1e6 { Err(WorldError::Flattened { what: what() }) } else { Ok(placed) }
}

/// Which meshes are joined with all their instances: those of which all of these are small, but not so small beside the rest
/// that the roundings of its block would count, and seen from the same side as they were made.
fn joinable(meshes: &[Mesh], instances: &[Instance], uses: &[usize], boxes: &[Option<(DVec3, DVec3)>]) -> Vec<bool> {
    let mut left = JOINED_MOST;
    let mut joined: Vec<bool> = (meshes.iter().zip(uses))
        .map(|(mesh, uses)| {
            let triangles = mesh.triangle_count().saturating_mul(*uses);
            let is_small = (1..=JOINED_MOST / 4).contains(&triangles) && triangles <= left;
            left -= if is_small { triangles } else { 0 };
            is_small
        })
        .collect();
    let extent = |(lo, hi): (DVec3, DVec3)| (hi - lo).max_element();
    let whole =
        boxes.iter().zip(instances).filter(|(_, i)| joined[i.mesh]).fold(None, |all, (own, _)| around(all, *own));
    let least = whole.map_or(0.0, extent) / JOINED_RATIO;
    for (instance, own) in instances.iter().zip(boxes) {
        let is_sound = instance.pose.matrix3.determinant() > 0.0 && own.is_some_and(|own| extent(own) >= least);
        joined[instance.mesh] &= is_sound;
    }
    // One alone is as well where it is.
    if instances.iter().filter(|i| joined[i.mesh]).count() < 2 {
        joined.fill(false);
    }
    joined
}

/// The box about both.
fn around(a: Option<(DVec3, DVec3)>, b: Option<(DVec3, DVec3)>) -> Option<(DVec3, DVec3)> {
    match (a, b) {
        (Some(a), Some(b)) => Some((a.0.min(b.0), a.1.max(b.1))),
        (one, other) => one.or(other),
    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use sunglint_radiometry::WorldDir;

    /// What vectors a machine has decides how fast rays are, and no bit of what they meet.
    #[test]
    fn all_vectors_meet_the_same() {
        let mut seed = 1_u64;
        let mut next = |lo: f64, hi: f64| {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            lo + (hi - lo) * ((seed >> 11) as f64) * 2f64.powi(-53)
        };
        let mut point = |half: f64| DVec3::new(next(-half, half), next(-half, half), next(-half, half));
        let facets = (0..3000).filter_map(|_| {
            let at = point(10.0);
            Facet::new(vec![at, at + point(1.0), at + point(1.0)], MaterialId(1)).ok()
        });
        let mesh = Mesh::from_facets(facets.collect());
        let instances = (0..40).map(|i| {
            let pose =
                DAffine3::from_translation(point(30.0)) * DAffine3::from_scale(DVec3::splat(0.2 + 0.02 * f64::from(i)));
            Instance { mesh: 0, pose, name: format!("object {i}"), id: i }
        });
        let mut world = World::new(vec![mesh], instances.collect(), None).expect("a world");
        let rays: Vec<Ray> = (0..2000).map(|_| Ray::new(point(20.0), WorldDir::new(point(1.0)))).collect();
        let met = |world: &World| rays.iter().map(|ray| (world.closest(ray), world.occluded(ray))).collect::<Vec<_>>();
        let found = met(&world);
        assert!(found.iter().filter(|(hit, _)| hit.is_some()).count() > 500);
        world.level = Level::baseline();
        assert_eq!(found, met(&world));
    }
}
