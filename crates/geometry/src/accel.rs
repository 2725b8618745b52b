//! The acceleration structure: a tree of boxes, eight to a node, over packets of eight triangles.
//!
//! `f32` decides nothing but misses. Boxes and triangles are kept in `f32` about the block's centre, with margins for
//! every rounding on the way there; what survives them is tested in `f64` on the facets' own corners by the watertight
//! test of Woop, Benthin and Wald 2013 (JCGT 2(1)). Margins, with u = 2⁻²⁴ and m the block's largest coordinate:
//!
//! ```text
//! box       corner 1 um, origin 1 um, direction (over an extent ≤ 2m) 2 um, corner/d and origin/d 1 um each
//!           → grown by 6 um; t by 4 roundings
//! triangle  corner − origin 4 um, shear ≤ 12 um → δ = 16 um; edge function 4 δ s + rounding ≤ δ s + 2δ² → 6 δ (s + δ)
//! depth     (corner − origin)/d, |d| ≥ 1/√3: 7 um, and 3 roundings of at most 2 √3 m, 11 um → 2 δ
//! ```
//!
//! with s the triangle's largest sheared coordinate. The tree is built top down by binned surface area (Wald 2007), with
//! halving below depth 40: n boxes, coincident or nested in any way, cost n log n and a depth of at most 40 + log₂ n.
//! The tree over placements is paired by obvhs (PLOC); for triangles its pairing gave 0.8 to 0.95 of the rate in this
//! traversal, and it is quadratic in coincident and nested boxes, up to a stack overflow, so large or degenerate sets of
//! boxes are split top down as well. obvhs's own 8-wide tree misses what is nearer than 10⁻⁴.

use fearless_simd::{f32x8, prelude::*};
use glam::{DVec3, Vec3A};
use obvhs::aabb::Aabb;
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};

/// Children of a node and triangles of a packet.
pub(crate) const WIDTH: usize = 8;
/// A number for each of them.
pub(crate) type Eight = [f32; WIDTH];
/// Low x, y, z and high x, y, z of a node's children.
pub(crate) type Boxes = [Eight; 6];
const LEAF: u32 = 1 << 31;
const FIRST_BITS: u32 = 27;
/// Entries that leaves can number.
pub(crate) const MOST_ENTRIES: usize = 1 << FIRST_BITS;

/// Box margin in units of m, and the triangle filter's δ.
pub(crate) const BOX_MARGIN: f32 = 3.0 * f32::EPSILON;
const DELTA: f32 = 8.0 * f32::EPSILON;
/// Covers the roundings of a distance in `f32`.
pub(crate) const T_UP: f32 = 1.0 + 4.0 * f32::EPSILON;

#[derive(Clone, Copy)]
pub(crate) struct Bounds {
    pub lo: Vec3A,
    pub hi: Vec3A,
}

impl Bounds {
    const EMPTY: Self = Self { lo: Vec3A::INFINITY, hi: Vec3A::NEG_INFINITY };

    fn join(self, other: Self) -> Self {
        Self { lo: self.lo.min(other.lo), hi: self.hi.max(other.hi) }
    }
    fn half_area(self) -> f32 {
        let d = (self.hi - self.lo).max(Vec3A::ZERO);
        d.x * d.y + d.y * d.z + d.z * d.x
    }
}

/// The lesser of two, the second where one is not a number: one instruction, where `f64::min` takes three.
#[inline(always)]
pub(crate) fn lesser(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

/// The same of the greater.
#[inline(always)]
pub(crate) fn greater(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// Where coordinates are `f32`: about `centre`, up to `half` from it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Block {
    pub centre: DVec3,
    /// Largest coordinate about the centre, and about the origin.
    pub half: f32,
    pub reach: f64,
    pub lo: DVec3,
    pub hi: DVec3,
}

impl Block {
    pub fn new(lo: DVec3, hi: DVec3) -> Self {
        let centre = 0.5 * lo + 0.5 * hi;
        let half = (hi - centre).max(centre - lo).max_element() as f32 * T_UP;
        Self { centre, half, reach: lo.abs().max(hi.abs()).max_element(), lo, hi }
    }
    /// `f32` box of an `f64` one, with margin.
    pub fn bounds(&self, lo: DVec3, hi: DVec3) -> Bounds {
        let margin = Vec3A::splat(BOX_MARGIN * self.half + f32::MIN_POSITIVE);
        Bounds { lo: (lo - self.centre).as_vec3a() - margin, hi: (hi - self.centre).as_vec3a() + margin }
    }
    /// Where the line o + t d enters and leaves, each a little early and late, given one over d; `None` if it passes outside
    /// 0 … `t_max`.
    #[inline(always)]
    pub fn clip(&self, o: DVec3, inv: DVec3, t_max: f64) -> Option<(f64, f64)> {
        let (mut near, mut far) = (0.0_f64, t_max);
        let (lo, hi, o, inv) = (self.lo.to_array(), self.hi.to_array(), o.to_array(), inv.to_array());
        for a in 0..3 {
            let inv = inv[a];
            if inv.abs() < 1e300 {
                let (t0, t1) = ((lo[a] - o[a]) * inv, (hi[a] - o[a]) * inv);
                let (enter, leave) = (lesser(t0, t1), greater(t0, t1));
                near = greater(enter - 4.0 * f64::EPSILON * enter.abs(), near);
                far = lesser(leave + 4.0 * f64::EPSILON * leave.abs(), far);
            } else if !(lo[a]..=hi[a]).contains(&o[a]) {
                return None;
            }
        }
        (near <= far).then_some((near, far))
    }
}

/// The tree. Leaves hold runs of entries: packets, or instances.
#[derive(Clone, Debug)]
pub(crate) struct Tree {
    nodes: Vec<Node>,
    root: u32,
}

#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
struct Node {
    bounds: Boxes,
    child: [u32; WIDTH],
}

/// A ray for boxes, about the block's centre.
pub(crate) struct BoxRay {
    inv: [f32; 3],
    /// −o/d.
    shift: [f32; 3],
    near: [usize; 3],
    far: [usize; 3],
}

impl BoxRay {
    /// `inv` is one over a direction of about unit length, `o` inside the block or at its border.
    #[inline(always)]
    pub fn new(o: DVec3, inv: DVec3) -> Self {
        // A component that would divide to infinity moves the ray by less than the margin.
        let inv = inv.clamp(DVec3::splat(-1e18), DVec3::splat(1e18)).as_vec3();
        let (shift, inv) = ((-o.as_vec3() * inv).to_array(), inv.to_array());
        let side = |a: usize| if inv[a] < 0.0 { a + 3 } else { a };
        let near = [side(0), side(1), side(2)];
        let far = [(near[0] + 3) % 6, (near[1] + 3) % 6, (near[2] + 3) % 6];
        Self { inv, shift, near, far }
    }

    /// Distances to sides of the boxes along an axis.
    #[inline(always)]
    fn at<S: Simd>(&self, simd: S, node: &Node, sides: [usize; 3], axis: usize) -> f32x8<S> {
        f32x8::load_array_ref(simd, &node.bounds[sides[axis]]).mul_add(self.inv[axis], self.shift[axis])
    }

    /// Distances to the boxes, and a bit for each that is met before `t_max`.
    #[inline(always)]
    fn meet<S: Simd>(&self, simd: S, node: &Node, t_max: f32) -> (Eight, u32) {
        let Self { near, far, .. } = *self;
        let near = [self.at(simd, node, near, 0), self.at(simd, node, near, 1), self.at(simd, node, near, 2)];
        let far = [self.at(simd, node, far, 0), self.at(simd, node, far, 1), self.at(simd, node, far, 2)];
        let enter = near[0].max(near[1]).max(near[2].max(0.0));
        let leave = far[0].min(far[1]).min(far[2].min(t_max)) * T_UP;
        (enter.to_array(), enter.simd_le(leave).to_bitmask() as u32)
    }
}

/// Nodes still to visit, nearest on top: distance in the upper half, child code in the lower. Spills to the heap in trees
/// deeper than any that scenes give.
struct Pending {
    top: [u64; 32],
    count: usize,
    spill: Vec<u64>,
}

impl Pending {
    #[inline(always)]
    fn push(&mut self, key: u64) {
        if self.count < self.top.len() {
            self.top[self.count] = key;
            self.count += 1;
        } else {
            self.spill.push(key);
        }
    }
    #[inline(always)]
    fn pop(&mut self) -> Option<u64> {
        if !self.spill.is_empty() {
            return self.spill.pop();
        }
        self.count = self.count.checked_sub(1)?;
        Some(self.top[self.count & 31])
    }
}

impl Tree {
    /// The tree over `boxes`, with up to `largest_leaf` in a leaf; `leaf` turns their indices into (first entry, count < 16).
    pub fn build(boxes: &[Bounds], largest_leaf: usize, leaf: &mut dyn FnMut(&[u32]) -> (usize, usize)) -> Self {
        let mut order: Vec<u32> = (0..boxes.len() as u32).collect();
        let mut tree = Self { nodes: Vec::new(), root: LEAF };
        if !boxes.is_empty() {
            let binary = split(boxes, &mut order, 0, 0, largest_leaf);
            tree.root = tree.widen(&binary, &order, leaf);
        }
        tree
    }

    /// The tree over the boxes of placements, one in a leaf, paired by obvhs where that is safe.
    pub fn over_placements(boxes: &[Bounds], leaf: &mut dyn FnMut(&[u32]) -> (usize, usize)) -> Self {
        let Some((binary, order)) = pair(boxes) else { return Self::build(boxes, 1, leaf) };
        let mut tree = Self { nodes: Vec::new(), root: LEAF };
        tree.root = tree.widen(&binary, &order, leaf);
        tree
    }

    fn widen(&mut self, part: &Part, order: &[u32], leaf: &mut dyn FnMut(&[u32]) -> (usize, usize)) -> u32 {
        match part {
            Part::Leaf { first, count, .. } => {
                let (first, count) = leaf(&order[*first..first + count]);
                LEAF | ((count as u32) << FIRST_BITS) | first as u32
            }
            Part::Inner { halves, .. } => {
                let mut children: Vec<&Part> = halves.iter().collect();
                while children.len() < WIDTH {
                    let widest = (0..children.len())
                        .filter(|&i| matches!(children[i], Part::Inner { .. }))
                        .max_by(|&i, &j| children[i].bounds().half_area().total_cmp(&children[j].bounds().half_area()));
                    let Some(i) = widest else { break };
                    if let Part::Inner { halves, .. } = children[i] {
                        children.splice(i..=i, halves.iter());
                    }
                }
                let at = self.nodes.len();
                let (lo, hi) = ([f32::INFINITY; WIDTH], [f32::NEG_INFINITY; WIDTH]);
                let bounds = [lo, lo, lo, hi, hi, hi];
                self.nodes.push(Node { bounds, child: [LEAF; WIDTH] });
                for (i, child) in children.iter().enumerate() {
                    let code = self.widen(child, order, leaf);
                    let (b, node) = (child.bounds(), &mut self.nodes[at]);
                    for a in 0..3 {
                        node.bounds[a][i] = b.lo[a];
                        node.bounds[a + 3][i] = b.hi[a];
                    }
                    node.child[i] = code;
                }
                at as u32
            }
        }
    }

    /// Visits the leaves that the ray meets before `t_max`, nearest first where `ORDERED`. `visit` may lower `t_max`, and
    /// stops the walk by returning true, which is passed on.
    #[inline(always)]
    pub fn walk<S: Simd, const ORDERED: bool>(
        &self,
        simd: S,
        ray: &BoxRay,
        mut t_max: f32,
        mut visit: impl FnMut(usize, usize, &mut f32) -> bool,
    ) -> bool {
        let mut pending = Pending { top: [0; 32], count: 0, spill: Vec::new() };
        let mut code = self.root;
        loop {
            if code & LEAF == 0 {
                let node = &self.nodes[code as usize];
                let (enter, mut met) = ray.meet(simd, node, t_max);
                if met != 0 {
                    let first = met.trailing_zeros() as usize & (WIDTH - 1);
                    met &= met - 1;
                    if met == 0 {
                        code = node.child[first];
                        continue;
                    }
                    let key = |i: usize| (u64::from(enter[i].to_bits()) << 32) | u64::from(node.child[i]);
                    if ORDERED {
                        // insertion by distance, farthest pushed first
                        let mut nearest = key(first);
                        let mut sorted = [0_u64; WIDTH];
                        let mut n = 0;
                        while met != 0 {
                            let mut next = key(met.trailing_zeros() as usize & (WIDTH - 1));
                            met &= met - 1;
                            if next < nearest {
                                std::mem::swap(&mut next, &mut nearest);
                            }
                            let mut at = n;
                            while at > 0 && sorted[at - 1] < next {
                                sorted[at & (WIDTH - 1)] = sorted[at - 1];
                                at -= 1;
                            }
                            sorted[at & (WIDTH - 1)] = next;
                            n += 1;
                        }
                        sorted[..n].iter().for_each(|&k| pending.push(k));
                        code = nearest as u32;
                    } else {
                        code = node.child[first];
                        while met != 0 {
                            pending.push(key(met.trailing_zeros() as usize & (WIDTH - 1)));
                            met &= met - 1;
                        }
                    }
                    continue;
                }
            } else {
                let first = (code & ((1 << FIRST_BITS) - 1)) as usize;
                let count = ((code & !LEAF) >> FIRST_BITS) as usize;
                if visit(first, count, &mut t_max) {
                    return true;
                }
            }
            loop {
                let Some(key) = pending.pop() else { return false };
                if f32::from_bits((key >> 32) as u32) <= t_max {
                    code = key as u32;
                    break;
                }
            }
        }
    }

    /// Visits the leaves below boxes that pass `keep`, which answers with a bit for each; `keep` stops the walk by `None` and
    /// `visit` by true, and either is passed on as true.
    pub fn descend(
        &self,
        mut keep: impl FnMut(&Boxes) -> Option<u32>,
        mut visit: impl FnMut(usize, usize) -> bool,
    ) -> bool {
        let mut pending = Pending { top: [0; 32], count: 0, spill: Vec::new() };
        pending.push(u64::from(self.root));
        while let Some(code) = pending.pop() {
            let code = code as u32;
            if code & LEAF == 0 {
                let node = &self.nodes[code as usize];
                let Some(kept) = keep(&node.bounds) else { return true };
                (0..WIDTH).filter(|i| kept >> i & 1 == 1).for_each(|i| pending.push(u64::from(node.child[i])));
            } else {
                let first = (code & ((1 << FIRST_BITS) - 1)) as usize;
                if visit(first, ((code & !LEAF) >> FIRST_BITS) as usize) {
                    return true;
                }
            }
        }
        false
    }

    pub fn memory_bytes(&self) -> usize {
        size_of_val(&self.nodes[..])
    }
}

/// The binary tree before widening.
enum Part {
    Leaf { bounds: Bounds, first: usize, count: usize },
    Inner { bounds: Bounds, halves: Box<[Part; 2]> },
}

impl Part {
    fn bounds(&self) -> Bounds {
        match self {
            Self::Leaf { bounds, .. } | Self::Inner { bounds, .. } => *bounds,
        }
    }
}

/// Most boxes that obvhs pairs: its time is quadratic when they nest in one another.
const PAIR_MOST: usize = 4096;
/// Deepest pairing that is taken over.
const PAIR_DEEPEST: usize = 64;

/// Neighbours paired bottom up by obvhs (PLOC, Benthin et al. 2022); `None` for more boxes than its time is bounded for, and
/// where they coincide or nest so that the tree is deep.
fn pair(boxes: &[Bounds]) -> Option<(Part, Vec<u32>)> {
    if boxes.len() < 2 || boxes.len() > PAIR_MOST {
        return None;
    }
    let aabbs: Vec<Aabb> = boxes.iter().map(|b| Aabb::new(b.lo, b.hi)).collect();
    let indices = (0..boxes.len() as u32).collect();
    let bvh = PlocBuilder::new().build(PlocSearchDistance::Medium, &aabbs, indices, SortPrecision::U64, 0);
    // Children stand in pairs behind an inner node; parts are made from the deepest up.
    let mut order_of_visit = vec![(0usize, 0usize)];
    let mut at = 0;
    while let Some(&(node, depth)) = order_of_visit.get(at) {
        at += 1;
        if depth > PAIR_DEEPEST {
            return None;
        }
        let node = bvh.nodes.get(node)?;
        if node.prim_count == 0 {
            let first = node.first_index as usize;
            order_of_visit.extend([(first, depth + 1), (first + 1, depth + 1)]);
        }
    }
    let mut parts: Vec<Option<Part>> = bvh.nodes.iter().map(|_| None).collect();
    for &(i, _) in order_of_visit.iter().rev() {
        let node = &bvh.nodes[i];
        let bounds = Bounds { lo: node.aabb.min, hi: node.aabb.max };
        let first = node.first_index as usize;
        parts[i] = Some(if node.prim_count == 0 {
            Part::Inner { bounds, halves: Box::new([parts[first].take()?, parts[first + 1].take()?]) }
        } else {
            Part::Leaf { bounds, first, count: node.prim_count as usize }
        });
    }
    Some((parts.first_mut()?.take()?, bvh.primitive_indices))
}

const BINS: usize = 16;
const DEEPEST_BY_AREA: usize = 40;
/// Cost of a box test of one child against that of a packet.
const NODE_COST: f32 = 0.3;

fn split(boxes: &[Bounds], order: &mut [u32], first: usize, depth: usize, largest_leaf: usize) -> Part {
    let n = order.len();
    let (mut bounds, mut centres) = (Bounds::EMPTY, Bounds::EMPTY);
    for &i in &*order {
        let b = boxes[i as usize];
        bounds = bounds.join(b);
        let c = b.lo + b.hi;
        centres = centres.join(Bounds { lo: c, hi: c });
    }
    let packets = |n: usize| n.div_ceil(WIDTH) as f32;
    if n <= largest_leaf.min(WIDTH) {
        return Part::Leaf { bounds, first, count: n };
    }
    let extent = centres.hi - centres.lo;
    let scale = Vec3A::select(extent.cmpgt(Vec3A::ZERO), 0.999 * BINS as f32 / extent, Vec3A::ZERO);
    let scale = Vec3A::select(scale.is_finite_mask(), scale, Vec3A::ZERO);
    let bin_of =
        |b: &Bounds| ((b.lo + b.hi - centres.lo) * scale).as_uvec3().to_array().map(|k| (k as usize).min(BINS - 1));
    let mut cut = None;
    if depth < DEEPEST_BY_AREA && scale != Vec3A::ZERO {
        let mut bins = [[(Bounds::EMPTY, 0_usize); BINS]; 3];
        for &i in &*order {
            let b = boxes[i as usize];
            for (axis, k) in bin_of(&b).into_iter().enumerate() {
                let bin = &mut bins[axis][k];
                *bin = (bin.0.join(b), bin.1 + 1);
            }
        }
        let mut best = f32::INFINITY;
        for (axis, bins) in bins.iter().enumerate() {
            if scale[axis] == 0.0 {
                continue;
            }
            let mut right_cost = [0.0; BINS];
            let mut right = (Bounds::EMPTY, 0);
            for k in (1..BINS).rev() {
                right = (right.0.join(bins[k].0), right.1 + bins[k].1);
                right_cost[k] = right.0.half_area() * packets(right.1);
            }
            let mut left = (Bounds::EMPTY, 0);
            for k in 1..BINS {
                left = (left.0.join(bins[k - 1].0), left.1 + bins[k - 1].1);
                let cost = left.0.half_area() * packets(left.1) + right_cost[k];
                if left.1 > 0 && left.1 < n && cost < best {
                    best = cost;
                    cut = Some((axis, k));
                }
            }
        }
        let area = bounds.half_area();
        if n <= largest_leaf && packets(n) * area <= best + 2.0 * NODE_COST * area {
            return Part::Leaf { bounds, first, count: n };
        }
    } else if n <= largest_leaf {
        return Part::Leaf { bounds, first, count: n };
    }
    let middle = cut.map_or(n / 2, |(axis, k)| {
        let mut middle = 0;
        for i in 0..n {
            if bin_of(&boxes[order[i] as usize])[axis] < k {
                order.swap(i, middle);
                middle += 1;
            }
        }
        middle
    });
    let (left, right) = order.split_at_mut(middle);
    let go = |part: &mut [u32], first| split(boxes, part, first, depth + 1, largest_leaf);
    let halves = if n > 4096 {
        let (a, b) = rayon::join(
            || split(boxes, left, first, depth + 1, largest_leaf),
            || split(boxes, right, first + middle, depth + 1, largest_leaf),
        );
        [a, b]
    } else {
        [go(left, first), go(right, first + middle)]
    };
    Part::Inner { bounds, halves: Box::new(halves) }
}

/// Triangles about the block's centre; lanes without one hold NaN and never survive.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub(crate) struct Packet {
    /// `corners[c][axis]` of each.
    pub corners: [[Eight; 3]; 3],
    pub triangle: [u32; WIDTH],
}

/// The triangles of a mesh for tracing.
#[derive(Clone, Debug)]
pub(crate) struct TriangleTree {
    pub block: Block,
    pub tree: Tree,
    pub packets: Vec<Packet>,
}

impl TriangleTree {
    /// Over triangles whose coordinates are finite; `None` if there are none.
    pub fn build(count: usize, triangle: &(dyn Fn(usize) -> [DVec3; 3] + Sync)) -> Option<Self> {
        let mut corners = (0..count).flat_map(triangle);
        let first = corners.next()?;
        let (lo, hi) = corners.fold((first, first), |(lo, hi), v| (lo.min(v), hi.max(v)));
        let block = Block::new(lo, hi);
        let boxes: Vec<Bounds> = (0..count)
            .map(|i| {
                let [a, b, c] = triangle(i);
                block.bounds(a.min(b).min(c), a.max(b).max(c))
            })
            .collect();
        let mut packets: Vec<Packet> = Vec::with_capacity(count / 6);
        let tree = Tree::build(&boxes, 16, &mut |leaf| {
            let first = packets.len();
            for eight in leaf.chunks(WIDTH) {
                let mut packet = Packet { corners: [[[f32::NAN; WIDTH]; 3]; 3], triangle: [u32::MAX; WIDTH] };
                for (lane, &t) in eight.iter().enumerate() {
                    packet.triangle[lane] = t;
                    for (c, corner) in triangle(t as usize).into_iter().enumerate() {
                        let corner = (corner - block.centre).as_vec3();
                        (0..3).for_each(|axis| packet.corners[c][axis][lane] = corner[axis]);
                    }
                }
                packets.push(packet);
            }
            (first, packets.len() - first)
        });
        packets.shrink_to_fit();
        Some(Self { block, tree, packets })
    }

    pub fn memory_bytes(&self) -> usize {
        self.tree.memory_bytes() + size_of_val(&self.packets[..])
    }
}

/// A ray for triangles, sheared along its largest component.
pub(crate) struct TriangleRay {
    axes: [usize; 3],
    /// Origin in the mesh's frame, and the same along the axes.
    p: DVec3,
    d: DVec3,
    o: [f64; 3],
    shear: [f64; 2],
    inv: f64,
    /// About the block's centre.
    o32: [f32; 3],
    shear32: [f32; 2],
    inv32: f32,
    delta: f32,
}

impl TriangleRay {
    /// `p` in the mesh's frame, inside the block or at its border; `d` of about unit length.
    #[inline(always)]
    pub fn new(block: &Block, p: DVec3, d: DVec3, inv: DVec3) -> Self {
        let size = d.abs();
        let z = if size.z >= size.x && size.z >= size.y { 2 } else { usize::from(size.y >= size.x) };
        let axes = [(z + 1) % 3, (z + 2) % 3, z];
        let [x, y, _] = axes;
        // An array is indexed without a branch.
        let along = d.to_array();
        let inv = inv.to_array()[z];
        let shear = [along[x] * inv, along[y] * inv];
        let about = (p - block.centre).as_vec3().to_array();
        let at = p.to_array();
        Self {
            axes,
            p,
            d,
            o: [at[x], at[y], at[z]],
            shear,
            inv,
            o32: [about[x], about[y], about[z]],
            shear32: [shear[0] as f32, shear[1] as f32],
            inv32: inv as f32,
            delta: DELTA * block.half,
        }
    }

    /// Corner `c` of each triangle, beside the ray and along it.
    #[inline(always)]
    fn sheared<S: Simd>(&self, simd: S, packet: &Packet, c: usize) -> (f32x8<S>, f32x8<S>, f32x8<S>) {
        let ([x, y, z], corner) = (self.axes, &packet.corners[c]);
        let cz = f32x8::load_array_ref(simd, &corner[z]) - self.o32[2];
        let cx = cz.mul_add(-self.shear32[0], f32x8::load_array_ref(simd, &corner[x]) - self.o32[0]);
        let cy = cz.mul_add(-self.shear32[1], f32x8::load_array_ref(simd, &corner[y]) - self.o32[1]);
        (cx, cy, cz * self.inv32)
    }

    /// A bit for each triangle of the packet that `f32` cannot prove missed before `t_max`.
    #[inline(always)]
    pub fn filter<S: Simd>(&self, simd: S, packet: &Packet, t_max: f32) -> u32 {
        let (ax, ay, az) = self.sheared(simd, packet, 0);
        let (bx, by, bz) = self.sheared(simd, packet, 1);
        let (cx, cy, cz) = self.sheared(simd, packet, 2);
        let (u, v, w) = (cx.mul_sub(by, cy * bx), ax.mul_sub(cy, ay * cx), bx.mul_sub(ay, by * ax));
        // What takes longest stands first; lanes without a triangle pass no comparison.
        let size = ax.abs().max(ay.abs()).max(bx.abs().max(by.abs())).max(cx.abs().max(cy.abs()));
        let delta = f32x8::splat(simd, self.delta * 6.0);
        let margin = size.mul_add(delta, delta * self.delta);
        let (least, most) = (u.min(v).min(w), u.max(v).max(w));
        let (near, far) = (az.min(bz).min(cz), az.max(bz).max(cz));
        let in_reach = far.simd_ge(self.delta * -2.0) & near.simd_le(t_max + self.delta * 2.0);
        ((least.simd_ge(-margin) | most.simd_le(margin)) & in_reach).to_bitmask() as u32
    }

    /// Distance to the plane of a triangle with unit `normal`, of either sign, and the cosine between them.
    ///
    /// Its error across the plane is some roundings of |corner − origin|, where that of the weights times the depths grows with
    /// the triangle's aspect too. Seen edge-on the depths bound it.
    #[inline(always)]
    pub fn distance(&self, [a, b, c]: [&DVec3; 3], normal: DVec3) -> (f64, f64) {
        let depth = |v: &DVec3| (v.as_ref()[self.axes[2]] - self.o[2]) * self.inv;
        let (az, bz, cz) = (depth(a), depth(b), depth(c));
        let (near, far) = (lesser(az, lesser(bz, cz)), greater(az, greater(bz, cz)));
        let cos = normal.dot(self.d);
        // What is not a number gives way to the depths.
        (lesser(greater(normal.dot(*a - self.p) / cos, near), far), cos)
    }

    /// Barycentric weights, times some factor, of the point where the line of the ray meets a triangle. Edges and corners belong
    /// to all their triangles, by edge functions that are exact negatives of each other across an edge.
    #[inline(always)]
    pub fn weights(&self, [a, b, c]: [&DVec3; 3]) -> Option<[f64; 3]> {
        let sheared = |v: &DVec3| {
            let ([x, y, z], v): (_, &[f64; 3]) = (self.axes, v.as_ref());
            let vz = v[z] - self.o[2];
            (v[x] - self.o[0] - self.shear[0] * vz, v[y] - self.o[1] - self.shear[1] * vz)
        };
        let ((ax, ay), (bx, by), (cx, cy)) = (sheared(a), sheared(b), sheared(c));
        let (u, v, w) = (cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax);
        let beside = (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0);
        (!beside && u + v + w != 0.0).then_some([u, v, w])
    }
}
