//! Planar mirrors, and the images of the sun in them.
//!
//! A point sees the sun in a mirror of unit normal n along H_n s = s − 2 (n·s) n, and in a mirror b that shows a mirror a along
//! H_b H_a s: one ray per distinct direction, and the ray itself finds the mirrors. Which mirrors can throw the sun into a
//! box of points is told by a tree of spheres about them with a cone of their normals.

use std::collections::HashMap;
use std::sync::{Arc, RwLock};

use glam::DVec3;
use rustc_hash::FxHashMap;
use sunglint_geometry::{FacetId, Hit, MaterialId, World};

/// Mirrors of a leaf.
const LEAF: usize = 4;

/// H_n v.
pub(crate) fn mirrored(v: DVec3, axis: DVec3) -> DVec3 {
    v - 2.0 * axis.dot(v) * axis
}

/// One or two mirrors in which the sun may be seen, by the index of their axis: the first that a ray meets, and the next.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) struct Image {
    pub first: u32,
    pub second: Option<u32>,
}

#[derive(Clone, Copy, Debug)]
struct Ball {
    centre: DVec3,
    radius: f64,
}

/// A mirror that shows a light from direction `light`: the sun, or its image in another mirror.
#[derive(Clone, Copy, Debug)]
struct Pane {
    ball: Ball,
    axis: u32,
}

/// Panes with the axis of another in which they see the sun.
type Pairs = Arc<[(Pane, u32)]>;

#[derive(Debug)]
struct Node {
    ball: Ball,
    /// Mean axis, and the largest angle to it \[rad\].
    axis: DVec3,
    cone: f64,
    /// Panes of a leaf, or the two children.
    first: u32,
    count: u32,
}

/// The planar facets of a world that have a mirror lobe.
#[derive(Debug, Default)]
pub(crate) struct Mirrors {
    panes: Vec<Pane>,
    /// Distinct normals, up to sign.
    axes: Vec<DVec3>,
    axis_of: FxHashMap<FacetId, u32>,
    nodes: Vec<Node>,
    /// By the sun's direction: panes that see the sun in another, with the other's axis.
    pairs: RwLock<HashMap<[u64; 3], Pairs>>,
}

impl Mirrors {
    pub fn new(world: &World, is_mirror: impl Fn(MaterialId) -> bool) -> Self {
        let mut out = Self::default();
        let mut known: FxHashMap<[i64; 3], u32> = FxHashMap::default();
        let mut add = |out: &mut Self, id: FacetId, normal: DVec3, ball: Ball| {
            let sign = if normal.z < 0.0 || normal.z == 0.0 && (normal.y < 0.0 || normal.y == 0.0 && normal.x < 0.0) {
                -1.0
            } else {
                1.0
            };
            let normal = normal * sign;
            let key = normal.to_array().map(|c| (c * 1e10).round() as i64);
            let axis = *known.entry(key).or_insert_with(|| {
                out.axes.push(normal);
                out.axes.len() as u32 - 1
            });
            out.axis_of.insert(id, axis);
            out.panes.push(Pane { ball, axis });
        };
        let of_mesh: Vec<Vec<u32>> = (world.meshes().iter())
            .map(|mesh| (0..mesh.facet_count() as u32).filter(|f| is_mirror(mesh.material(*f as usize))).collect())
            .collect();
        let mut first = 0;
        for instance in world.instances() {
            for index in &of_mesh[instance.mesh] {
                let id = FacetId(first + index);
                let facet = world.facet(id);
                let centre = facet.corners.iter().sum::<DVec3>() / facet.corners.len().max(1) as f64;
                let radius = facet.corners.iter().map(|c| c.distance(centre)).fold(0.0, f64::max);
                add(&mut out, id, facet.normal, Ball { centre, radius });
            }
            first += world.meshes()[instance.mesh].facet_count() as u32;
        }
        if let Some(ground) = world.ground().filter(|ground| is_mirror(ground.material)) {
            let centre = DVec3::new(0.0, 0.0, ground.height);
            add(&mut out, FacetId::GROUND, DVec3::Z, Ball { centre, radius: f64::INFINITY });
        }
        if !out.panes.is_empty() {
            let mut panes = std::mem::take(&mut out.panes);
            out.nodes.push(Node { ball: panes[0].ball, axis: DVec3::Z, cone: 0.0, first: 0, count: 0 });
            let n = panes.len();
            out.split(0, &mut panes, 0, n);
            out.panes = panes;
        }
        out
    }

    pub fn is_empty(&self) -> bool {
        self.panes.is_empty()
    }

    /// Panes and distinct axes.
    pub fn counts(&self) -> (usize, usize) {
        (self.panes.len(), self.axes.len())
    }

    /// The axis of a mirror that was met.
    pub fn axis_of(&self, hit: &Hit) -> Option<u32> {
        self.axis_of.get(&hit.facet).copied()
    }

    /// Unit normal of an axis, up to sign.
    pub fn axis(&self, index: u32) -> DVec3 {
        self.axes[index as usize]
    }

    fn split(&mut self, node: usize, panes: &mut [Pane], start: usize, end: usize) {
        let own = &mut panes[start..end];
        let (lo, hi) = own.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(lo, hi), pane| {
            (lo.min(pane.ball.centre), hi.max(pane.ball.centre))
        });
        let centre = 0.5 * (lo + hi);
        let radius = own.iter().map(|pane| centre.distance(pane.ball.centre) + pane.ball.radius).fold(0.0, f64::max);
        let axis = own.iter().map(|pane| self.axes[pane.axis as usize]).sum::<DVec3>();
        let axis = axis.try_normalize().unwrap_or(DVec3::Z);
        let cone = own.iter().map(|pane| axis.angle_between(self.axes[pane.axis as usize])).fold(0.0, f64::max);
        let (first, count) = if end - start <= LEAF {
            (start as u32, (end - start) as u32)
        } else {
            let extent = hi - lo;
            let along = if extent.x >= extent.y && extent.x >= extent.z {
                0
            } else if extent.y >= extent.z {
                1
            } else {
                2
            };
            let middle = (end - start) / 2;
            own.select_nth_unstable_by(middle, |a, b| a.ball.centre[along].total_cmp(&b.ball.centre[along]));
            let children = self.nodes.len();
            for _ in 0..2 {
                self.nodes.push(Node { ball: Ball { centre, radius }, axis, cone, first: 0, count: 0 });
            }
            self.split(children, panes, start, start + middle);
            self.split(children + 1, panes, start + middle, end);
            (children as u32, 0)
        };
        self.nodes[node] = Node { ball: Ball { centre, radius }, axis, cone, first, count };
    }

    /// Calls `found` for every pane that may throw light from `light` (within `spread` of it) into a ball.
    fn throwing(&self, ball: Ball, light: DVec3, spread: f64, found: &mut impl FnMut(&Pane)) {
        if self.nodes.is_empty() {
            return;
        }
        let mut stack = vec![0_u32];
        while let Some(index) = stack.pop() {
            let node = &self.nodes[index as usize];
            if !throws(node.ball, node.axis, spread + 2.0 * node.cone, light, ball) {
                continue;
            }
            if node.count == 0 {
                stack.extend([node.first, node.first + 1]);
                continue;
            }
            for pane in &self.panes[node.first as usize..(node.first + node.count) as usize] {
                if throws(pane.ball, self.axes[pane.axis as usize], spread, light, ball) {
                    found(pane);
                }
            }
        }
    }

    /// Panes that see the sun in another one.
    fn pairs(&self, sun: DVec3, spread: f64) -> Pairs {
        let key = sun.to_array().map(f64::to_bits);
        if let Some(known) = self.pairs.read().expect("no holder of this lock panics").get(&key) {
            return known.clone();
        }
        let mut pairs: Vec<(Pane, u32)> = Vec::new();
        for pane in &self.panes {
            let mut axes: Vec<u32> = Vec::new();
            self.throwing(pane.ball, sun, spread, &mut |other| {
                // A plane shows nothing of itself.
                let apart = self.axes[pane.axis as usize].dot(other.ball.centre - pane.ball.centre).abs();
                if (other.axis != pane.axis || apart > 1e-9 * (1.0 + pane.ball.radius)) && !axes.contains(&other.axis) {
                    axes.push(other.axis);
                }
            });
            axes.sort_unstable();
            pairs.extend(axes.into_iter().map(|axis| (*pane, axis)));
        }
        let pairs: Pairs = pairs.into();
        self.pairs.write().expect("no holder of this lock panics").insert(key, pairs.clone());
        pairs
    }

    /// The mirrors that may throw the sun into a box of points, from it or from its image in another.
    pub fn throwers(&self, lo: DVec3, hi: DVec3, sun: DVec3, spread: f64) -> Vec<Thrower> {
        let ball = Ball { centre: 0.5 * (lo + hi), radius: 0.5 * (hi - lo).length() };
        let mut throwers = Vec::new();
        let of = |pane: &Pane, light: DVec3, second: Option<u32>| {
            let towards = -mirrored(light, self.axis(pane.axis));
            Thrower { image: Image { first: pane.axis, second }, ball: pane.ball, towards, spread }
        };
        self.throwing(ball, sun, spread, &mut |pane| throwers.push(of(pane, sun, None)));
        if self.panes.len() > 1 {
            for (pane, second) in self.pairs(sun, spread).iter() {
                let light = mirrored(sun, self.axis(*second));
                if throws(pane.ball, self.axis(pane.axis), spread, light, ball) {
                    throwers.push(of(pane, light, Some(*second)));
                }
            }
        }
        throwers.sort_by_key(|thrower| thrower.image);
        throwers
    }
}

/// A mirror and where it throws the sun.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Thrower {
    pub image: Image,
    ball: Ball,
    towards: DVec3,
    spread: f64,
}

impl Thrower {
    /// Whether a point may see the image in it.
    pub fn reaches(&self, point: DVec3) -> bool {
        reaches(self.ball, self.towards, self.spread, Ball { centre: point, radius: 0.0 })
    }
}

/// Whether a mirror within `mirror`, its normal within half of `spread` of `axis`, may throw light from `light` into `ball`: the
/// thrown light runs along −H_n s.
fn throws(mirror: Ball, axis: DVec3, spread: f64, light: DVec3, ball: Ball) -> bool {
    reaches(mirror, -mirrored(light, axis), spread, ball)
}

/// Whether light from a ball towards a direction, within `spread` of it, may meet another ball: where the angle between is no
/// more than A = asin q + s, q the sum of the radii over the distance; more are let through, by cos s ≥ 1 − s²/2 and sin s ≤ s.
fn reaches(mirror: Ball, towards: DVec3, spread: f64, ball: Ball) -> bool {
    let apart = ball.centre - mirror.centre;
    let (distance, reach) = (apart.length(), mirror.radius + ball.radius);
    if distance <= reach || reach.is_infinite() {
        return true;
    }
    let (q, s) = (reach / distance, spread + 1e-9);
    let least = (1.0 - q * q).sqrt() * (1.0 - 0.5 * s * s) - q * s;
    apart.dot(towards) >= distance * (least - 1e-12)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The tree finds what a look at every pane finds, for panes in all directions.
    #[test]
    fn the_tree_finds_every_pane_that_throws() {
        let random = |i: usize, k: usize| ((i * 7919 + k * 104_729 + i * i * 31) % 10_007) as f64 / 10_007.0 - 0.5;
        let mut mirrors = Mirrors::default();
        let mut panes: Vec<Pane> = (0..500)
            .map(|i| {
                let centre = 40.0 * DVec3::new(random(i, 1), random(i, 2), random(i, 3));
                let axis = DVec3::new(random(i, 4), random(i, 5), random(i, 6).abs() + 0.01).normalize();
                mirrors.axes.push(axis);
                Pane { ball: Ball { centre, radius: 0.3 + 0.5 * random(i, 7).abs() }, axis: i as u32 }
            })
            .collect();
        mirrors.nodes.push(Node { ball: panes[0].ball, axis: DVec3::Z, cone: 0.0, first: 0, count: 0 });
        let n = panes.len();
        mirrors.split(0, &mut panes, 0, n);
        mirrors.panes = panes;
        let mut total = 0;
        for i in 0..200 {
            let sun = DVec3::new(random(i, 11), random(i, 12), 0.6).normalize();
            let centre = 40.0 * DVec3::new(random(i, 13), random(i, 14), random(i, 15));
            let ball = Ball { centre, radius: 1.0 };
            let mut found: Vec<u32> = Vec::new();
            mirrors.throwing(ball, sun, 0.005, &mut |pane| found.push(pane.axis));
            found.sort_unstable();
            let mut due: Vec<u32> = (mirrors.panes.iter())
                .filter(|pane| throws(pane.ball, mirrors.axes[pane.axis as usize], 0.005, sun, ball))
                .map(|pane| pane.axis)
                .collect();
            due.sort_unstable();
            assert_eq!(found, due);
            total += due.len();
        }
        assert!(total > 50, "{total}");
    }
}
