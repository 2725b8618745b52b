//! Where the sky over a patch of a facet may be hidden, so that rays are cast only there.
//!
//! Cosine-weighted directions over a facet are uniform in Nusselt's disk. Those above the world's horizon fill what lies
//! between the facet's own rim and the half-ellipse y = cos β √(1 − x²), and every chord of that, along the line of steepest
//! fall, can be stretched to that of a whole disk (x, v), which keeps areas in proportion:
//!
//! ```text
//! v = (2 y + (1 − cos β) √(1 − x²)) / (1 + cos β)
//! ```
//!
//! Seen in space this turns each direction about the strike of the facet, sin ψ → ((1 − cos β) + 2 sin ψ)/(1 + cos β) with ψ
//! from the normal downhill: the wedge between the two horizons becomes a half-space. There everything that rises
//! hides no more than what lies below its greatest elevation, sector by sector.

use std::cell::Cell;
use std::f64::consts::TAU;
use std::sync::LazyLock;

use glam::{DAffine3, DMat3, DVec2, DVec3};
use smallvec::SmallVec;

use crate::accel::{Boxes, TriangleTree, WIDTH};
use crate::clearance::rounding;
use crate::world::World;

/// Sectors of azimuth.
const SECTORS: usize = 64;
/// Boxes and triangles that are looked at one by one; what is left over counts as the boxes about it.
const BUDGET: u32 = 1024;
/// Boxes narrower than this are taken as they are \[rad\].
const NARROW: f64 = 0.06;

/// Cosine of the tilt beyond which a facet counts as level.
const LEVEL: f64 = 1.0 - 1e-15;
/// Times that a triangle is cut in four, seen from tilted facets.
const SPLITS: u32 = 3;

/// A square on a facet.
#[derive(Clone, Copy, Debug)]
pub struct Patch {
    /// Its middle \[m\].
    pub middle: DVec3,
    /// Half its side \[m\].
    pub half: f64,
    /// Unit vectors along its sides: the strike, and downhill.
    pub sides: [DVec3; 2],
    /// Unit normal, on the side whose sky is asked for.
    pub normal: DVec3,
}

/// The part of the sky that something may hide from some point of a patch; whatever lies beyond is free.
#[derive(Clone, Debug, PartialEq)]
pub struct Horizon {
    /// Square of the radius of the disk up to which it is free, by sector.
    free: [f64; SECTORS],
    /// Area beyond that, as a share of the disk, of this sector and those before it.
    up_to: [f64; SECTORS],
}

impl Horizon {
    fn new(free: [f64; SECTORS]) -> Self {
        let mut sum = 0.0;
        let up_to = free.map(|free| {
            sum += (1.0 - free) / SECTORS as f64;
            sum
        });
        Self { free, up_to }
    }

    /// Share of the disk that may be hidden.
    pub fn share(&self) -> f64 {
        self.up_to[SECTORS - 1]
    }

    /// A point of the disk that may be hidden, from a point of the unit square; areas stay in proportion.
    pub fn hidden(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        let wanted = (u * self.share()).min(self.share().next_down());
        let k = self.up_to.partition_point(|sum| *sum <= wanted).min(SECTORS - 1);
        let before = if k == 0 { 0.0 } else { self.up_to[k - 1] };
        let within = ((wanted - before) / (self.up_to[k] - before)).clamp(0.0, 1.0);
        point(k, within, self.free[k] + v * (1.0 - self.free[k]))
    }

    /// The same of the free part.
    pub fn free(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        let sum = |k: usize| k as f64 / SECTORS as f64 - if k == 0 { 0.0 } else { self.up_to[k - 1] };
        let wanted = u * sum(SECTORS);
        let (mut low, mut high) = (0, SECTORS);
        while high - low > 1 {
            let middle = (low + high) / 2;
            if sum(middle) <= wanted {
                low = middle;
            } else {
                high = middle;
            }
        }
        let width = sum(low + 1) - sum(low);
        let within = if width > 0.0 { ((wanted - sum(low)) / width).clamp(0.0, 1.0) } else { 0.5 };
        point(low, within, v * self.free[low])
    }
}

/// A point of the disk in a sector, at a share of its width, from its squared radius.
fn point(sector: usize, within: f64, square: f64) -> [f64; 2] {
    // Sine and cosine of a tenth of a radian, to 1e-16.
    let angle = within * (TAU / SECTORS as f64);
    let q = angle * angle;
    let sin = angle * (1.0 - q / 6.0 * (1.0 - q / 20.0 * (1.0 - q / 42.0 * (1.0 - q / 72.0 * (1.0 - q / 110.0)))));
    let cos = 1.0 - q / 2.0 * (1.0 - q / 12.0 * (1.0 - q / 30.0 * (1.0 - q / 56.0 * (1.0 - q / 90.0))));
    (square.min(1.0).sqrt() * compass(2 * sector).rotate(DVec2::new(cos, sin))).to_array()
}

impl World {
    /// What may hide the sky above the world's horizon from a patch. What lies on or behind the patch's plane, to rounding,
    /// hides nothing.
    pub fn horizon(&self, patch: &Patch) -> Horizon {
        let [strike, down] = patch.sides;
        let below = |ground: &crate::Ground| patch.middle.z - patch.half * down.z.abs() < ground.height - 1e-9;
        if self.ground().is_some_and(below) {
            return Horizon::new([0.0; SECTORS]);
        }
        let turn = DMat3::from_cols(strike, down, patch.normal).transpose();
        let to_patch = DAffine3::from_mat3_translation(turn, -(turn * patch.middle));
        let rising = Rising {
            half: patch.half,
            cos_tilt: patch.normal.z.clamp(-1.0, 1.0),
            free: std::array::from_fn(|_| Cell::new(1.0)),
            left: Cell::new(BUDGET),
        };
        let mut all = u32::MAX;
        self.any_instance(
            |block| {
                let at = Turned::new(&(to_patch * DAffine3::from_translation(block.centre)), 0.0);
                let rising = &rising;
                move |boxes: &Boxes| at.wanted(boxes, rising)
            },
            &mut all,
            |instance, _| {
                self.look_over(instance, &to_patch, patch.middle, &rising);
                false
            },
        );
        Horizon::new(rising.free.map(Cell::into_inner))
    }

    fn look_over(&self, instance: usize, to_patch: &DAffine3, middle: DVec3, rising: &Rising) {
        let placed = &self.placed[instance];
        let Some(TriangleTree { block, tree, packets }) = &self.trees[placed.mesh] else { return };
        let mesh = self.mesh_of(placed);
        let to_patch = if placed.in_place { *to_patch } else { *to_patch * placed.to_world };
        let rounding = rounding(placed, block, middle);
        let at = Turned::new(&(to_patch * DAffine3::from_translation(block.centre)), rounding);
        tree.descend(
            |boxes| Some(at.wanted(boxes, rising)),
            |first, count| {
                for t in packets[first..first + count].iter().flat_map(|p| p.triangle).filter(|t| *t != u32::MAX) {
                    rising.rise(mesh.triangle(t as usize).map(|v| to_patch.transform_point3(v)), rounding, SPLITS);
                }
                false
            },
        );
    }
}

/// Boxes of a tree, turned into the patch's frame.
struct Turned {
    matrix: DMat3,
    size: DMat3,
    shift: DVec3,
    rounding: f64,
}

impl Turned {
    fn new(to_patch: &DAffine3, rounding: f64) -> Self {
        let matrix = to_patch.matrix3;
        let size = DMat3::from_cols(matrix.x_axis.abs(), matrix.y_axis.abs(), matrix.z_axis.abs());
        Self { matrix, size, shift: to_patch.translation, rounding }
    }

    /// A bit for each box that must be looked into.
    fn wanted(&self, boxes: &Boxes, rising: &Rising) -> u32 {
        let is_wanted = |i: &usize| {
            let at = |side: usize| f64::from(boxes[side][*i]);
            let (lo, hi) = (DVec3::new(at(0), at(1), at(2)), DVec3::new(at(3), at(4), at(5)));
            if lo.x > hi.x {
                return false;
            }
            let (middle, half) = (self.matrix * (0.5 * (lo + hi)) + self.shift, self.size * (0.5 * (hi - lo)));
            !matches!(rising.met(middle - half, middle + half, self.rounding, false), Met::Done)
        };
        (0..WIDTH).filter(is_wanted).fold(0, |wanted, i| wanted | 1 << i)
    }
}

/// Directions of azimuth by half sectors.
static COMPASS: LazyLock<[DVec2; 2 * SECTORS]> =
    LazyLock::new(|| std::array::from_fn(|i| DVec2::from_angle(i as f64 * TAU / (2 * SECTORS) as f64)));

fn compass(half_sectors: usize) -> DVec2 {
    COMPASS[half_sectors % (2 * SECTORS)]
}

/// The horizon as it rises.
struct Rising {
    half: f64,
    cos_tilt: f64,
    free: [Cell<f64>; SECTORS],
    left: Cell<u32>,
}

/// A box seen from the square: less the square, so that it is seen from the origin.
struct Seen {
    lo: DVec3,
    hi: DVec3,
    /// Its nearest point on the level.
    near: DVec2,
    /// Sectors that it reaches into.
    first: usize,
    count: usize,
}

impl Seen {
    /// `None` where it stands over the origin.
    fn new(lo: DVec3, hi: DVec3) -> Option<Self> {
        let near = DVec2::new(0f64.clamp(lo.x, hi.x), 0f64.clamp(lo.y, hi.y));
        if near == DVec2::ZERO {
            return None;
        }
        // The corners at its least and its greatest azimuth: it lies to one side of the origin.
        let (from, to) = if lo.x > 0.0 {
            ((if lo.y < 0.0 { lo.x } else { hi.x }, lo.y), (if hi.y > 0.0 { lo.x } else { hi.x }, hi.y))
        } else if hi.x < 0.0 {
            ((if hi.y > 0.0 { hi.x } else { lo.x }, hi.y), (if lo.y < 0.0 { hi.x } else { lo.x }, lo.y))
        } else if lo.y > 0.0 {
            ((hi.x, lo.y), (lo.x, lo.y))
        } else {
            ((lo.x, hi.y), (hi.x, hi.y))
        };
        let sector = |(x, y): (f64, f64)| y.atan2(x) * (SECTORS as f64 / TAU);
        let (from, to) = (sector(from), sector(to));
        let to = if to < from { to + SECTORS as f64 } else { to };
        let first = (from - 1e-6).floor();
        let count = ((to + 1e-6).floor() - first) as usize + 1;
        let first = (first as i64).rem_euclid(SECTORS as i64) as usize;
        Some(Self { lo, hi, near, first, count: count.min(SECTORS) })
    }

    /// Greatest height over least distance in each sector that it reaches into.
    fn slopes(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        let meeting = |k: usize| along(self.lo, self.hi, compass(2 * k));
        let mut left = meeting(self.first);
        (self.first..self.first + self.count).map(move |k| {
            let right = meeting(k + 1);
            // The nearest point itself, or a corner alone, may lie in it.
            let (from, to) = (compass(2 * k), compass(2 * k + 2));
            let holds = from.perp_dot(self.near) >= -1e-9 * self.near.length()
                && to.perp_dot(self.near) <= 1e-9 * self.near.length()
                && from.dot(self.near) > 0.0;
            let mut least = left.min(right);
            left = right;
            if holds || least == f64::INFINITY {
                least = self.near.length();
            }
            (k, self.hi.z / least)
        })
    }
}

impl Rising {
    fn raise(&self, sector: usize, slope: f64) {
        let free = 1.0 / (1.0 + slope * slope) * (1.0 - 1e-12);
        self.free[sector].set(self.free[sector].get().min(free));
    }

    /// Raises the horizon by a box of the patch's frame, unless it is large and may be looked into instead.
    fn met(&self, lo: DVec3, hi: DVec3, rounding: f64, last: bool) -> Met {
        if hi.z <= rounding {
            return Met::Done;
        }
        let width = (hi - lo).length_squared();
        let reach = DVec3::new(self.half, self.half, 0.0);
        let (lo, hi) = ((lo - reach).with_z(lo.z.max(0.0)), hi + reach);
        let Some((lo, hi)) = self.stretched(lo, hi) else { return Met::Done };
        let last = last || self.left.get() == 0;
        self.left.set(self.left.get().saturating_sub(1));
        let Some(seen) = Seen::new(lo, hi) else {
            if !last {
                return Met::Above;
            }
            self.free.iter().for_each(|free| free.set(0.0));
            return Met::Done;
        };
        if last || width <= (NARROW * NARROW * seen.near.length_squared()).max(self.half * self.half) {
            seen.slopes().for_each(|(k, slope)| self.raise(k % SECTORS, slope));
            return Met::Done;
        }
        let is_higher = seen.slopes().any(|(k, slope)| self.is_below(k % SECTORS, slope));
        if is_higher { Met::Large(seen) } else { Met::Done }
    }

    fn is_below(&self, sector: usize, slope: f64) -> bool {
        self.free[sector].get() * (1.0 + slope * slope) > 1.0
    }

    /// Raises the horizon by a triangle.
    fn rise(&self, corners: [DVec3; 3], rounding: f64, splits: u32) {
        let [a, b, c] = corners;
        match self.met(a.min(b).min(c), a.max(b).max(c), rounding, splits == 0) {
            Met::Done => {}
            Met::Large(seen) if self.cos_tilt > LEVEL => {
                for (k, slope) in seen.slopes() {
                    if self.is_below(k % SECTORS, slope) {
                        self.rise_in_sector(&corners, k);
                    }
                }
            }
            Met::Above if self.cos_tilt > LEVEL => (0..SECTORS).for_each(|k| self.rise_in_sector(&corners, k)),
            _ => {
                let [ab, bc, ca] = [0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)];
                for part in [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]] {
                    self.rise(part, rounding, splits - 1);
                }
            }
        }
    }

    /// The same in one sector over a level facet. In a sector about a direction m, as all points of the square see it,
    /// tan e ≤ z/(m·t − h) with h the square's reach along m: the greatest is at a corner of what lies in the sector.
    fn rise_in_sector(&self, corners: &[DVec3; 3], sector: usize) {
        let reach = |axis: DVec2| self.half * axis.abs().element_sum();
        let (from, middle, to) = (compass(2 * sector), compass(2 * sector + 1), compass(2 * sector + 2));
        let mut part: SmallVec<[DVec3; 8]> = SmallVec::from_slice(corners);
        for axis in [from.perp(), -to.perp(), middle] {
            cut(&mut part, axis.extend(0.0), -reach(axis));
        }
        cut(&mut part, DVec3::Z, 0.0);
        for t in part.iter().filter(|t| t.z > 0.0) {
            let distance = middle.dot(t.truncate()) - reach(middle);
            self.raise(sector % SECTORS, if distance > 0.0 { t.z / distance } else { f64::INFINITY });
        }
    }

    /// The box about a box after its directions are turned so that all above the horizon fill the half-space; `None` where
    /// none is.
    fn stretched(&self, lo: DVec3, hi: DVec3) -> Option<(DVec3, DVec3)> {
        let c = self.cos_tilt;
        if c > LEVEL {
            return Some((lo, hi));
        }
        // In the plane at right angles to the strike: distances and sin ψ.
        let near = DVec2::new(0f64.clamp(lo.y, hi.y), lo.z).length();
        let far = DVec2::new(lo.y.abs().max(hi.y.abs()), hi.z).length();
        let sine = |y: f64, z: f64| if y == 0.0 && z == 0.0 { 0.0 } else { y / y.hypot(z) };
        let from = if lo.y < 0.0 { sine(lo.y, lo.z) } else { sine(lo.y, hi.z) };
        let to = if hi.y > 0.0 { sine(hi.y, lo.z) } else { sine(hi.y, hi.z) };
        if from >= c {
            return None;
        }
        let turned = |sine: f64| ((1.0 - c + 2.0 * sine) / (1.0 + c)).clamp(-1.0, 1.0);
        let (from, to) = (turned(from) - 1e-12, turned(to) + 1e-12);
        let cos = |sine: f64| (1.0 - sine * sine).max(0.0).sqrt();
        let most = if from <= 0.0 && to >= 0.0 { 1.0 } else { cos(from).max(cos(to)) + 1e-12 };
        let low = if from < 0.0 { from * far } else { from * near };
        let high = if to > 0.0 { to * far } else { to * near };
        Some((DVec3::new(lo.x, low, 0.0), DVec3::new(hi.x, high, most * far)))
    }
}

/// What came of a box.
enum Met {
    /// It hides no more than is known now.
    Done,
    /// It is seen so, and too large to be taken for what it holds.
    Large(Seen),
    /// The same, and it stands over the square.
    Above,
}

/// Keeps of a convex polygon what lies at axis·p ≥ least.
fn cut(polygon: &mut SmallVec<[DVec3; 8]>, axis: DVec3, least: f64) {
    if polygon.iter().all(|p| axis.dot(*p) >= least) {
        return;
    }
    let whole = std::mem::take(polygon);
    for (i, &b) in whole.iter().enumerate() {
        let a = whole[(i + whole.len() - 1) % whole.len()];
        let (from, to) = (axis.dot(a) - least, axis.dot(b) - least);
        if (from < 0.0) != (to < 0.0) {
            polygon.push(a + (b - a) * (from / (from - to)));
        }
        if to >= 0.0 {
            polygon.push(b);
        }
    }
}

/// How far from the origin a ray in a direction meets a rectangle; infinity where it does not.
fn along(lo: DVec3, hi: DVec3, direction: DVec2) -> f64 {
    let (mut near, mut far) = (0f64, f64::INFINITY);
    for (d, lo, hi) in [(direction.x, lo.x, hi.x), (direction.y, lo.y, hi.y)] {
        // What runs along a side meets it by the rounding of either end.
        let d = if d.abs() < 1e-12 { 1e-12_f64.copysign(d) } else { d };
        let (a, b) = (lo / d, hi / d);
        near = near.max(a.min(b));
        far = far.min(a.max(b));
    }
    if near <= far * (1.0 + 1e-9) { near } else { f64::INFINITY }
}
