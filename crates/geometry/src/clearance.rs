//! Proofs that rays are free, so that they need not be cast. Every answer true is proven, false may mean not proven.

use crate::accel::{BOX_MARGIN, Block, Boxes, Eight, Packet, T_UP, TriangleTree, WIDTH};
use crate::world::{Placed, World};
use crate::{FacetId, Mesh};
use glam::{DVec3, Vec4};
use std::sync::atomic::{AtomicU64, Ordering};
use sunglint_radiometry::WorldDir;

/// Nodes and triangles that a proof may look at before it gives up: once a facet, and once a shaft.
const OPEN_BUDGET: u32 = 2048;
const SHAFT_BUDGET: u32 = 512;

/// Answers of [`World::is_open`] by facet, in a table that forgets: (facet + 1) << 2 | front | open << 1, or 0.
#[derive(Debug)]
pub(crate) struct OpenCache(Vec<AtomicU64>);

impl OpenCache {
    pub fn new(facets: usize) -> Self {
        let slots = (2 * facets + 2).next_power_of_two().min(1 << 22);
        Self((0..slots).map(|_| AtomicU64::new(0)).collect())
    }
    pub fn memory_bytes(&self) -> usize {
        size_of_val(&self.0[..])
    }
    fn get_or(&self, facet: FacetId, front: bool, prove: impl FnOnce() -> bool) -> bool {
        let key = (u64::from(facet.0) + 1) << 2 | u64::from(front);
        let slot = &self.0[((u64::from(facet.0) << 1 | u64::from(front)) as usize) & (self.0.len() - 1)];
        let known = slot.load(Ordering::Relaxed);
        if known & !2 == key {
            return known & 2 != 0;
        }
        let open = prove();
        slot.store(key | u64::from(open) << 1, Ordering::Relaxed);
        open
    }
}

impl World {
    /// Whether nothing of the scene except the ground rises above the plane of the facet on its front (or back): its sky
    /// view is then (1 + cos β)/2. The answer is kept for the next call. False where the proof would take long.
    pub fn is_open(&self, facet: FacetId, front: bool) -> bool {
        self.open.get_or(facet, front, || self.prove_open(facet, front))
    }

    fn prove_open(&self, id: FacetId, front: bool) -> bool {
        let Some((own_instance, own_facet)) = self.locate(id) else {
            let Some(ground) = self.ground() else { return false };
            return self.bounds().is_none_or(
                |(lo, hi)| {
                    if front { hi.z <= ground.height } else { lo.z >= ground.height }
                },
            );
        };
        let facet = self.facet(id);
        let centre = facet.centre();
        let normal = if front { facet.normal } else { -facet.normal };
        if self.ground().is_some_and(|g| facet.corners.iter().any(|c| c.z < g.height) && normal.z > 0.0) {
            return false;
        }
        let mut budget = OPEN_BUDGET;
        !self.any_instance(
            |block| {
                let plane = Plane::new(normal, normal.dot(centre), block);
                move |bounds: &Boxes| plane.rising(bounds)
            },
            &mut budget,
            |instance, budget| {
                let placed = &self.placed[instance];
                let Some(TriangleTree { block, tree, packets }) = &self.trees[placed.mesh] else { return false };
                let mesh = self.mesh_of(placed);
                // n·(M v + s) ≤ n·c in the object's frame: (Mᵀ n)·v ≤ n·(c − s)
                let n = placed.to_world.matrix3.transpose() * normal;
                let limit = normal.dot(centre - placed.to_world.translation);
                let tolerance = rounding(placed, block, centre);
                let plane = Plane::new(n, limit, block);
                let spent = std::cell::Cell::new(*budget);
                let rises = tree.descend(
                    |bounds| spend(&spent).then(|| plane.rising(bounds)),
                    |first, count| {
                        packets[first..first + count].iter().flat_map(|p| p.triangle).any(|t| {
                            if t == u32::MAX || !spend(&spent) {
                                return t != u32::MAX;
                            }
                            (instance, mesh.facet_of(t) as usize) != (own_instance, own_facet)
                                && mesh.triangle(t as usize).iter().any(|v| n.dot(*v) > limit + tolerance)
                        })
                    },
                );
                *budget = spent.get();
                rises
            },
        )
    }

    /// Whether no facet and no ground blocks any ray that starts in the box `lo`–`hi` on the plane through `anchor` with
    /// unit `normal` and runs towards `direction`, or within `spread` rad of it. What lies on or behind that plane, to
    /// rounding, blocks nothing. False where the proof would take long, and for a spread above 0.8.
    pub fn shaft_is_clear(
        &self,
        lo: DVec3,
        hi: DVec3,
        anchor: DVec3,
        normal: DVec3,
        direction: WorldDir,
        spread: f64,
    ) -> bool {
        self.shaft_is_clear_beside(None, lo, hi, anchor, normal, direction, spread)
    }

    /// The same where all facets count but `own`, on that plane or behind it too; the box may reach as far below the ground as
    /// `own` says, by rounding.
    #[allow(clippy::too_many_arguments)]
    pub(crate) fn shaft_is_clear_beside(
        &self,
        own: Option<(FacetId, f64)>,
        lo: DVec3,
        hi: DVec3,
        anchor: DVec3,
        normal: DVec3,
        direction: WorldDir,
        spread: f64,
    ) -> bool {
        let boxed = lo.cmple(hi).all() && lo.is_finite() && hi.is_finite();
        if !boxed || !(0.0..0.8).contains(&spread) {
            return false;
        }
        let d = direction.vec();
        if let Some(ground) = self.ground() {
            let rises = d.z.clamp(-1.0, 1.0).asin();
            let above = lo.z >= ground.height - own.map_or(0.0, |(_, below)| below) && rises >= spread;
            if !(above && rises > 0.0 || hi.z <= ground.height && rises < -spread) {
                return false;
            }
        }
        let mut shaft = Shaft::new(lo, hi, anchor, normal, d, spread);
        if own.is_some() {
            shaft.plane = None;
        }
        let own = own.and_then(|(own, _)| self.locate(own));
        let mut budget = SHAFT_BUDGET;
        !self.any_instance(
            |block| {
                let boxes = shaft.boxes(None, block);
                move |bounds: &Boxes| boxes.as_ref().map_or(0, |b| b.met(bounds))
            },
            &mut budget,
            |instance, budget| {
                let placed = &self.placed[instance];
                let Some(TriangleTree { block, tree, packets }) = &self.trees[placed.mesh] else { return false };
                let Some(boxes) = shaft.boxes(Some(placed), block) else { return false };
                let mesh = self.mesh_of(placed);
                let tolerance = rounding(placed, block, anchor);
                let spent = std::cell::Cell::new(*budget);
                let blocked = tree.descend(
                    |bounds| spend(&spent).then(|| boxes.met(bounds)),
                    |first, count| {
                        packets[first..first + count].iter().any(|packet| {
                            let near = boxes.near(packet);
                            (0..WIDTH).filter(|lane| near >> lane & 1 == 1).any(|lane| {
                                let triangle = packet.triangle[lane];
                                if own == Some((instance, mesh.facet_of(triangle) as usize)) {
                                    return false;
                                }
                                let corners = corners(mesh, placed, triangle);
                                !spend(&spent) || shaft.meets(&corners, tolerance)
                            })
                        })
                    },
                );
                *budget = spent.get();
                blocked
            },
        )
    }

    /// Whether `test` says so for any instance whose boxes `keep` lets through; true too when the budget is spent.
    pub(crate) fn any_instance<K: Fn(&Boxes) -> u32>(
        &self,
        keep: impl FnOnce(&Block) -> K,
        budget: &mut u32,
        mut test: impl FnMut(usize, &mut u32) -> bool,
    ) -> bool {
        let Some(top) = &self.top else { return false };
        if let [only] = top.order[..] {
            return test(only as usize, budget);
        }
        let keep = keep(&top.block);
        let spent = std::cell::Cell::new(*budget);
        top.tree.descend(
            |bounds| spend(&spent).then(|| keep(bounds)),
            |first, count| {
                top.order[first..first + count].iter().any(|&i| {
                    let mut left = spent.get();
                    let answer = test(i as usize, &mut left);
                    spent.set(left);
                    answer
                })
            },
        )
    }
}

/// Takes one from the budget; false if it is spent.
fn spend(budget: &std::cell::Cell<u32>) -> bool {
    let left = budget.get();
    budget.set(left.saturating_sub(1));
    left > 0
}

/// Rounding of distances from a plane through `point` to an instance's corners \[m\]; less than [`crate::Hit::error`] there.
pub(crate) fn rounding(placed: &Placed, block: &Block, point: DVec3) -> f64 {
    4.0 * f64::EPSILON * (placed.magnitude(block.reach) + point.abs().max_element())
}

fn corners(mesh: &Mesh, placed: &Placed, triangle: u32) -> [DVec3; 3] {
    let corners = mesh.triangle(triangle as usize);
    if placed.in_place { corners } else { corners.map(|c| placed.to_world.transform_point3(c)) }
}

/// The first four of eight numbers, or the other.
fn half(eight: &Eight, half: usize) -> Vec4 {
    Vec4::from_slice(&eight[4 * half..])
}

/// A bit for each of eight, from those of their halves.
fn both_halves(bits: impl Fn(usize) -> u32) -> u32 {
    bits(0) | bits(1) << 4
}

/// Boxes against the half-space n·v > limit, in a block's `f32` coordinates. The boxes' margin covers the rounding.
struct Plane {
    n: [Vec4; 3],
    limit: Vec4,
    /// What the boxes have in addition, along the normal.
    margin: Vec4,
}

impl Plane {
    fn new(n: DVec3, limit: f64, block: &Block) -> Self {
        let about = limit - n.dot(block.centre);
        let below = about
            - 4.0 * f64::from(f32::EPSILON) * about.abs()
            - f64::EPSILON * (limit.abs() + n.dot(block.centre).abs()) * 4.0;
        let margin = BOX_MARGIN * block.half * n.abs().element_sum() as f32;
        Self {
            n: n.as_vec3().to_array().map(Vec4::splat),
            limit: Vec4::splat(below as f32),
            margin: Vec4::splat(margin),
        }
    }
    fn rising(&self, b: &Boxes) -> u32 {
        both_halves(|h| {
            let highest = |a: usize| (self.n[a] * half(&b[a], h)).max(self.n[a] * half(&b[a + 3], h));
            (highest(0) + highest(1) + highest(2)).cmpgt(self.limit).bitmask()
        })
    }
    fn rising_corners(&self, packet: &Packet) -> u32 {
        both_halves(|h| {
            let height = |corner: &[Eight; 3]| {
                self.n[0] * half(&corner[0], h) + self.n[1] * half(&corner[1], h) + self.n[2] * half(&corner[2], h)
            };
            let [a, b, c] = &packet.corners;
            height(a).max(height(b)).max(height(c)).cmpgt(self.limit - self.margin).bitmask()
        })
    }
}

/// All rays from where a box meets a plane towards `d`, and up to an angle from it.
struct Shaft {
    centre: DVec3,
    half: DVec3,
    /// Corners of the section of box and plane about the centre, some twice where the plane meets corners of the box, and
    /// how many.
    section: [DVec3; 12],
    count: usize,
    /// Lowest of the section along the direction; its extent along the axes that are normal to it and to an edge.
    lowest: f64,
    sides: [(DVec3, f64, f64); 3],
    d: DVec3,
    tan: f64,
    sin: f64,
    /// Anchor and normal, unless rays may dip below the plane.
    plane: Option<(DVec3, DVec3)>,
}

impl Shaft {
    fn new(lo: DVec3, hi: DVec3, anchor: DVec3, normal: DVec3, d: DVec3, spread: f64) -> Self {
        let centre = 0.5 * lo + 0.5 * hi;
        let half = 0.5 * (hi - lo) + 2.0 * f64::EPSILON * lo.abs().max(hi.abs());
        // A plane cuts up to six of a box's twelve edges. Its offset is kept within the box's reach, whatever is given.
        let reach = half.dot(normal.abs());
        let offset = normal.dot(anchor - centre).clamp(-reach, reach);
        let (mut section, mut count) = ([DVec3::ZERO; 12], 0);
        for axis in 0..3 {
            let (x, y) = ((axis + 1) % 3, (axis + 2) % 3);
            for (sx, sy) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
                let mut corner = DVec3::ZERO;
                (corner[x], corner[y]) = (sx * half[x], sy * half[y]);
                let at = (offset - normal.dot(corner)) / normal[axis];
                if at.abs() <= half[axis] * (1.0 + 1e-9) {
                    corner[axis] = at;
                    section[count] = corner;
                    count += 1;
                }
            }
        }
        if count == 0 {
            // rounding can miss a plane that only touches the box
            count = 8;
            for (i, corner) in section[..8].iter_mut().enumerate() {
                *corner = half * DVec3::from_array([0, 1, 2].map(|a| if i >> a & 1 == 1 { 1.0 } else { -1.0 }));
            }
        }
        let mut shaft = Self {
            centre,
            half,
            section,
            count,
            lowest: 0.0,
            sides: [(DVec3::ZERO, 0.0, 0.0); 3],
            d,
            tan: spread.tan(),
            sin: spread.sin(),
            plane: (normal.dot(d) >= spread.sin()).then_some((anchor, normal)),
        };
        shaft.lowest = shaft.extent(d).0;
        shaft.sides = [DVec3::X, DVec3::Y, DVec3::Z].map(|e| {
            let axis = d.cross(normal.cross(e));
            let (lo, hi) = shaft.extent(axis);
            (axis, lo, hi)
        });
        shaft
    }

    /// Lowest and highest of the section along an axis.
    fn extent(&self, axis: DVec3) -> (f64, f64) {
        self.section[..self.count]
            .iter()
            .map(|p| p.dot(axis))
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)))
    }

    /// Whether a triangle may be met: not, if a plane separates it from the shaft [Gottschalk 1996]. The planes tried hold
    /// the direction and an edge of either, or are the triangle's own.
    fn meets(&self, corners: &[DVec3; 3], tolerance: f64) -> bool {
        if let Some((anchor, normal)) = self.plane
            && corners.iter().all(|&v| normal.dot(v - anchor) <= tolerance)
        {
            return false;
        }
        // the start points lie on the plane to the rounding of hits, too
        let tolerance = 8.0 * tolerance;
        let about = corners.map(|v| v - self.centre);
        // A ray that has come as far as a along the axis is up to a tan σ off it: like a ball about the start.
        let farthest = about.iter().map(|v| v.dot(self.d)).fold(f64::NEG_INFINITY, f64::max) - self.lowest;
        if farthest < -tolerance {
            return false;
        }
        let ball = farthest.max(0.0) * self.tan + tolerance;
        let apart = |(axis, lo, hi): (DVec3, f64, f64)| {
            let margin = ball * axis.length();
            let at = about.map(|v| v.dot(axis));
            at.iter().all(|&x| x > hi + margin) || at.iter().all(|&x| x < lo - margin)
        };
        if self.sides.into_iter().any(apart) {
            return false;
        }
        let edges = [about[1] - about[0], about[2] - about[1], about[0] - about[2]];
        let normal = edges[0].cross(edges[1]);
        let (length, towards) = (normal.length(), normal.dot(self.d));
        // Rays that move away from the triangle's plane do not come back.
        let away = towards.abs() >= self.sin * length && towards != 0.0;
        if away
            && self.extent(normal * towards.signum()).0 - about[0].dot(normal) * towards.signum() > tolerance * length
        {
            return false;
        }
        !edges.into_iter().any(|edge| {
            let axis = self.d.cross(edge);
            let (lo, hi) = self.extent(axis);
            apart((axis, lo, hi))
        })
    }

    /// The shaft for boxes of the top tree, or of an instance's tree; `None` if it misses the whole block.
    fn boxes(&self, placed: Option<&Placed>, block: &Block) -> Option<ShaftBoxes> {
        // The start box and the ball in the block's frame, as half-sizes along its axes, and the gradient there of the
        // world's distance along the axis.
        let (o, d, half, ball, along) = match placed {
            Some(p) if !p.in_place => {
                let m = p.from_world.matrix3;
                let rows = [m.row(0), m.row(1), m.row(2)];
                let half = DVec3::from_array(rows.map(|r| r.abs().dot(self.half)));
                let ball = DVec3::from_array(rows.map(DVec3::length));
                let along = p.to_world.matrix3.transpose() * self.d;
                (p.from_world.transform_point3(self.centre), p.from_world.transform_vector3(self.d), half, ball, along)
            }
            _ => (self.centre, self.d, self.half, DVec3::ONE, self.d),
        };
        let far =
            ((block.lo - o) * along).max((block.hi - o) * along).element_sum() * (1.0 + 1e-9) + half.dot(along.abs());
        let far = far.max(0.0);
        let grown =
            half + ball * (far * self.tan) + DVec3::splat(1e-12 * (o.abs().max_element() + f64::from(block.half)));
        let around = Block { lo: block.lo - grown, hi: block.hi + grown, ..*block };
        let (enter, _) = around.clip(o, 1.0 / d, f64::INFINITY)?;
        let at = o + d * enter - block.centre;
        // u = 2⁻²⁴ and m with the growth: corners 1 um, start 1 um, direction 4 um, half-size 1 um, ball 8 um
        let slack = 12.0 * f64::from(f32::EPSILON) * (f64::from(block.half) + grown.max_element());
        let splat = |v: DVec3| v.as_vec3().to_array().map(Vec4::splat);
        let inv = d.normalize().as_vec3().to_array().map(|d| if d.abs() < 1e-18 { 1e18_f32 } else { 1.0 / d });
        let plane = self.plane.map(|(anchor, normal)| match placed {
            Some(p) => {
                let limit = normal.dot(anchor - p.to_world.translation);
                Plane::new(p.to_world.matrix3.transpose() * normal, limit, block)
            }
            None => Plane::new(normal, normal.dot(anchor), block),
        });
        Some(ShaftBoxes {
            o: splat(at),
            inv: inv.map(Vec4::splat),
            half: splat(half + DVec3::splat(slack)),
            along: splat(along),
            passed: Vec4::splat((enter - along.dot(at) + half.dot(along.abs())) as f32),
            ball: splat(ball * self.tan),
            plane,
        })
    }
}

/// A shaft among boxes: a ray against boxes grown by its start box and by the widest it gets up to them.
struct ShaftBoxes {
    o: [Vec4; 3],
    inv: [Vec4; 3],
    half: [Vec4; 3],
    /// Gradient of the distance along the axis, and that distance at the block's centre from the rearmost start.
    along: [Vec4; 3],
    passed: Vec4,
    /// Half-size of the ball by that distance.
    ball: [Vec4; 3],
    plane: Option<Plane>,
}

impl ShaftBoxes {
    fn met(&self, b: &Boxes) -> u32 {
        let met = both_halves(|h| self.met_by([0, 1, 2].map(|a| half(&b[a], h)), [3, 4, 5].map(|a| half(&b[a], h))));
        self.plane.as_ref().map_or(met, |p| met & p.rising(b))
    }

    /// A bit for each triangle of a packet whose box is met and that rises above the plane.
    fn near(&self, packet: &Packet) -> u32 {
        let [a, b, c] = &packet.corners;
        let met = both_halves(|h| {
            let [a, b, c] = [a, b, c].map(|corner| [0, 1, 2].map(|x| half(&corner[x], h)));
            self.met_by([0, 1, 2].map(|x| a[x].min(b[x]).min(c[x])), [0, 1, 2].map(|x| a[x].max(b[x]).max(c[x])))
        });
        self.plane.as_ref().map_or(met, |p| met & p.rising_corners(packet))
    }

    fn met_by(&self, lo: [Vec4; 3], hi: [Vec4; 3]) -> u32 {
        let reach = |a: usize| (self.along[a] * lo[a]).max(self.along[a] * hi[a]);
        let farthest = (self.passed + reach(0) + reach(1) + reach(2)).max(Vec4::ZERO);
        let (mut near, mut far) = (Vec4::ZERO, Vec4::INFINITY);
        for a in 0..3 {
            let half = self.half[a] + self.ball[a] * farthest;
            let t0 = (lo[a] - half - self.o[a]) * self.inv[a];
            let t1 = (hi[a] + half - self.o[a]) * self.inv[a];
            near = near.max(t0.min(t1));
            far = far.min(t0.max(t1));
        }
        near.cmple(far * T_UP).bitmask()
    }
}
