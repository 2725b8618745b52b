//! Lines of sight from targets to the sensor: where τ₂ and L_u are solved, and how pixels share them.
//!
//! A provider solves a path for all wavelengths at once, which costs as much as lighting many pixels. So paths are solved at
//! the knots of a lattice over the image and the range, and a pixel's samples take theirs from the knots around: linearly over
//! the image, and along the range as through even air between two knots a and b,
//!
//! ```text
//! τ₂(s) = τ_a + t' (τ_b − τ_a),   L_u(s) = L_a + t' (L_b − L_a),   t' = (1 − r^t)/(1 − r),   r = ⟨τ_b⟩/⟨τ_a⟩
//! ```
//!
//! with the mean over each channel, so that what is left over is of second order in what the extinction varies within a
//! channel and between the knots. Knots belong to the whole image, so that a pixel is the same in whatever part of it is
//! rendered.

use std::ops::Range;

use glam::DVec3;
use smallvec::SmallVec;
use sunglint_atmosphere::Path;
use sunglint_geometry::Ray;
use sunglint_radiometry::WorldDir;

use crate::paths::Paths;

/// Samples of a pixel share a line of sight where their ranges agree within this factor: the error is of second order
/// in the extinction over the difference.
pub(crate) const CLUSTER_RATIO: f64 = 1.1;
/// Ranges of knots: steps of so many metres, then of this factor.
const RANGE_STEP: f64 = 10.0;
const RANGE_RATIO: f64 = 1.02;
/// Rungs of the first kind: from here on a factor is more than a step.
const EVEN_RUNGS: u32 = 50;
/// Directions of neighbouring knots differ by no more than about this \[rad\].
const KNOT_ANGLE: f64 = 0.02;
/// Steps between knots \[pixels\], the widest first.
const KNOT_STEPS: [u32; 3] = [32, 16, 8];

/// Range of a rung \[m\].
fn rung(i: u32) -> f64 {
    match i.checked_sub(EVEN_RUNGS) {
        None => RANGE_STEP * f64::from(i),
        Some(above) => RANGE_STEP * f64::from(EVEN_RUNGS) * RANGE_RATIO.powi(above as i32),
    }
}

/// The rung below a range.
fn rung_below(range: f64) -> u32 {
    let even = RANGE_STEP * f64::from(EVEN_RUNGS);
    let guess = match range < even {
        true => (range / RANGE_STEP) as u32,
        false => EVEN_RUNGS + ((range / even).ln() / RANGE_RATIO.ln()) as u32,
    };
    // Rounding may have passed a rung by, or stopped short of it.
    if rung(guess) > range {
        guess.saturating_sub(1)
    } else if rung(guess + 1) <= range {
        guess + 1
    } else {
        guess
    }
}

/// A place of the lattice.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Knot {
    x: u32,
    y: u32,
    rung: u32,
}

/// What is taken of two knots of one direction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Share {
    /// The nearer and the farther.
    pub low: Knot,
    pub high: Knot,
    /// Of both together; they sum to 1.
    pub weight: f64,
    /// t: where the target lies between them.
    pub between: f64,
}

impl Share {
    /// t' of a channel with mean transmittances `low` and `high`.
    pub fn of_high(&self, low: f64, high: f64) -> f64 {
        let (t, lost) = (self.between, 1.0 - high / low);
        if !(low > 0.0 && high > 0.0) {
            return t;
        }
        if lost.abs() < 0.01 {
            // The binomial series of the same, which is far cheaper: what follows is below rounding.
            let (mut term, mut sum) = (t, t);
            for (k, share) in [(1.0, 1.0 / 2.0), (2.0, 1.0 / 3.0), (3.0, 1.0 / 4.0), (4.0, 1.0 / 5.0), (5.0, 1.0 / 6.0)]
            {
                term *= lost * (k - t) * share;
                sum += term;
            }
            return sum;
        }
        (1.0 - (high / low).powf(t)) / lost
    }
}

/// What is taken of the knots around.
pub(crate) type Shares = SmallVec<[Share; 4]>;

/// How wide a pixel is across its line of sight.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PixelWidth {
    /// Between lines of sight a pixel apart \[rad\].
    angle: f64,
    /// Between where they begin \[m\].
    apart: f64,
}

impl PixelWidth {
    /// At a range \[m\].
    pub fn at(self, range: f64) -> f64 {
        self.apart + self.angle * range
    }
}

/// The lattice of a view.
pub(crate) struct Lattice<'a> {
    sight: &'a (dyn Fn(f64, f64) -> Ray + Sync),
    pixels: (u32, u32),
    step: u32,
    pixel_width: PixelWidth,
    /// Height below which nothing is met \[m\].
    floor: f64,
}

impl<'a> Lattice<'a> {
    pub fn new(sight: &'a (dyn Fn(f64, f64) -> Ray + Sync), pixels: (u32, u32), floor: f64) -> Self {
        let (w, h) = (f64::from(pixels.0), f64::from(pixels.1));
        // The widest pixel, in the middle and at the corners of the image.
        let (mut angle, mut apart) = (0.0, 0.0);
        for (u, v) in [(0.5, 0.5), (0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
            let at = |dx: f64, dy: f64| sight(u * w + dx, v * h + dy);
            let own = at(0.0, 0.0);
            for next in [at(1.0, 0.0), at(0.0, 1.0)] {
                angle = f64::max(angle, own.direction.angle_to(next.direction));
                apart = f64::max(apart, (next.origin - own.origin).cross(own.direction.vec()).length());
            }
        }
        let fits = |step: &&u32| f64::from(**step) * angle <= KNOT_ANGLE;
        let step = *KNOT_STEPS.iter().find(fits).unwrap_or(&KNOT_STEPS[KNOT_STEPS.len() - 1]);
        Self { sight, pixels, step, pixel_width: PixelWidth { angle, apart }, floor }
    }

    /// How wide a pixel is at most.
    pub const fn pixel_width(&self) -> PixelWidth {
        self.pixel_width
    }

    fn place(&self, knot: Knot) -> [f64; 2] {
        let at = |k: u32, n: u32| f64::from((k * self.step).min(n));
        [at(knot.x, self.pixels.0), at(knot.y, self.pixels.1)]
    }

    /// The knot's ray, and its range: that of its rung, unless the ray would be below all that can be met.
    fn ray(&self, knot: Knot) -> (Ray, f64) {
        let [x, y] = self.place(knot);
        let ray = (self.sight)(x, y);
        let down = -ray.direction.vec().z;
        let to_floor = if down > 0.0 { (ray.origin.z - self.floor) / down } else { f64::INFINITY };
        let range = rung(knot.rung);
        (ray, if to_floor > 0.0 { range.min(to_floor) } else { range })
    }

    /// The path from a knot's target to the sensor; `None` where it has no length.
    pub fn path(&self, knot: Knot) -> Option<Path> {
        let (ray, range) = self.ray(knot);
        (range > 0.0).then(|| path_to(ray.origin, ray.at(range), range, -ray.direction))
    }

    /// What a target at a range along the ray through a place of the image takes of the knots around.
    pub fn shares(&self, [x, y]: [f64; 2], range: f64) -> Shares {
        let below = rung_below(range);
        let axis = |at: f64, n: u32| {
            let last = n.saturating_sub(1) / self.step;
            let k = ((at / f64::from(self.step)) as u32).min(last);
            let (from, to) = (f64::from(k * self.step), f64::from(((k + 1) * self.step).min(n)));
            (k, ((at - from) / (to - from)).clamp(0.0, 1.0))
        };
        let ((i, u), (j, v)) = (axis(x, self.pixels.0), axis(y, self.pixels.1));
        let mut shares = Shares::new();
        for (dx, dy, weight) in
            [(0, 0, (1.0 - u) * (1.0 - v)), (1, 0, u * (1.0 - v)), (0, 1, (1.0 - u) * v), (1, 1, u * v)]
        {
            if weight == 0.0 {
                continue;
            }
            let [low, high] = [below, below + 1].map(|rung| Knot { x: i + dx, y: j + dy, rung });
            let (a, b) = (self.ray(low).1, self.ray(high).1);
            // Steeper rays end sooner: beyond the floor the last stretch is held on.
            let t = if b - a > 1e-9 * b { (range - a) / (b - a) } else { 0.0 };
            let between = if t.is_finite() && t.abs() < 4.0 { t } else { 1.0 };
            shares.push(Share { low, high, weight, between });
        }
        shares
    }
}

fn path_to(sensor: DVec3, target: DVec3, length: f64, away: WorldDir) -> Path {
    let towards = (sensor - target).try_normalize().map_or(away, WorldDir::from_unit);
    Path { target_height: target.z, sensor_height: sensor.z, length, towards_sensor: towards }
}

/// A line of sight among those of its view.
#[derive(Clone, Copy)]
pub struct Sight<'a> {
    /// From the sensor.
    pub ray: Ray,
    /// Image coordinates (x across, y down, in pixels).
    pub(crate) place: [f64; 2],
    lines: &'a (dyn Fn(f64, f64) -> Ray + Sync),
}

impl<'a> Sight<'a> {
    /// The one through a place of the image.
    pub fn new(lines: &'a (dyn Fn(f64, f64) -> Ray + Sync), place: [f64; 2]) -> Self {
        Self { ray: lines(place[0], place[1]), place, lines }
    }

    /// The one to a point nearby, at the nearest 64th of a pixel; `None` where none is found, as behind the sensor.
    pub(crate) fn to(&self, point: DVec3) -> Option<Self> {
        /// Newton's steps: each squares what lines that are almost even leave.
        const STEPS: usize = 4;
        const GRID: f64 = 64.0;
        let mut place = self.place;
        let mut wide = 0.0;
        for _ in 0..STEPS {
            let (along, away) = across(&(self.lines)(place[0], place[1]), point);
            if along.is_nan() || along <= 0.0 {
                return None;
            }
            // What a pixel to the side adds to where the line passes the point.
            let side = |dx: f64, dy: f64| {
                let at = |s: f64| (self.lines)(place[0] + s * dx, place[1] + s * dy).at(along);
                at(0.5) - at(-0.5)
            };
            let (u, v) = (side(1.0, 0.0), side(0.0, 1.0));
            let (uu, uv, vv) = (u.dot(u), u.dot(v), v.dot(v));
            let det = uu * vv - uv * uv;
            if det.is_nan() || det <= 1e-12 * uu * vv {
                return None;
            }
            let (a, b) = (u.dot(away), v.dot(away));
            place = [place[0] + (vv * a - uv * b) / det, place[1] + (uu * b - uv * a) / det];
            wide = uu.max(vv).sqrt();
        }
        let found = Self::new(self.lines, place.map(|at| (GRID * at).round() / GRID));
        let (along, away) = across(&found.ray, point);
        (along > 0.0 && away.length() <= wide).then_some(found)
    }
}

/// How far along a ray a point lies, and what leads from the ray to it.
fn across(ray: &Ray, point: DVec3) -> (f64, DVec3) {
    let to = point - ray.origin;
    let along = to.dot(ray.direction.vec());
    (along, to - along * ray.direction.vec())
}

/// Groups a pixel's samples by range and marks each with its group; returns the line of sight of each group, from its
/// mean hit to the origin of the pixel's middle ray, and `None` for the samples that leave the scene.
pub(crate) fn cluster(paths: &mut Paths, samples: Range<usize>, middle: &Ray) -> Vec<Option<Path>> {
    const MOST: usize = u8::MAX as usize - 1;
    let mut order: Vec<usize> = samples.clone().filter(|i| paths.samples[*i].vertex.is_some()).collect();
    let ranges = order.iter().map(|i| paths.samples[*i].range);
    let (near, far) = ranges.fold((f64::INFINITY, 0.0), |(near, far), r| (f64::min(near, r), f64::max(far, r)));
    if far > near * CLUSTER_RATIO {
        order.sort_by(|a, b| paths.samples[*a].range.total_cmp(&paths.samples[*b].range));
    } else if let Some(nearest) = order.iter().position(|i| paths.samples[*i].range == near) {
        // One group holds them all, whatever their order, if the nearest stands first.
        order.swap(0, nearest);
    }
    let mut sights: Vec<Option<Path>> = Vec::new();
    let mut rest = order.as_slice();
    while let Some(first) = rest.first() {
        let reach = if sights.len() == MOST { f64::INFINITY } else { paths.samples[*first].range * CLUSTER_RATIO };
        let (group, later) = rest.split_at(rest.partition_point(|i| paths.samples[*i].range <= reach).max(1));
        rest = later;
        let (mut point, mut range) = (DVec3::ZERO, 0.0);
        for i in group {
            let sample = &mut paths.samples[*i];
            sample.cluster = sights.len() as u8;
            range += sample.range;
            point += paths.vertices[sample.vertex.expect("only hits are ordered") as usize].hit.point;
        }
        let n = group.len() as f64;
        sights.push(Some(path_to(middle.origin, point / n, range / n, -middle.direction)));
    }
    if order.len() < samples.len() {
        for sample in paths.samples[samples].iter_mut().filter(|sample| sample.vertex.is_none()) {
            sample.cluster = sights.len() as u8;
        }
        sights.push(None);
    }
    sights
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rungs_ascend_and_every_range_lies_between_two() {
        for i in 0..300 {
            assert!(rung(i + 1) > rung(i));
            assert_eq!(rung_below(rung(i)), i);
        }
        for range in [0.0, 1e-9, 9.999, 10.0, 499.9, 500.0, 500.1, 1e4, 7.05e5] {
            let i = rung_below(range);
            assert!(rung(i) <= range && range < rung(i + 1), "{range}: {i}");
        }
    }

    /// Through even air t' gives τ back exactly, however far the knots.
    #[test]
    fn even_air_comes_back_between_knots() {
        let knot = Knot { x: 0, y: 0, rung: 0 };
        for depth in [1e-9, 1e-5, 1e-3, 0.5, 3.0] {
            for t in [0.0, 0.3, 1.0, 1.2] {
                let share = Share { low: knot, high: knot, weight: 1.0, between: t };
                let (low, high) = (0.7, 0.7 * f64::exp(-depth));
                let found = low + share.of_high(low, high) * (high - low);
                assert!((found / (0.7 * f64::exp(-depth * t)) - 1.0).abs() < 1e-12, "{depth} {t}");
            }
        }
    }

    /// Shares sum to 1 and give back what is linear in place and range, on a level floor too.
    #[test]
    fn what_is_linear_comes_back_between_knots() {
        let sight = |x: f64, y: f64| {
            let direction = DVec3::new((x - 32.0) * 1e-4, (y - 24.0) * 1e-4, -1.0);
            Ray::new(DVec3::new(0.0, 0.0, 3000.0), WorldDir::new(direction))
        };
        let lattice = Lattice::new(&sight, (64, 48), 0.0);
        for (x, y, range) in [(3.5, 7.5, 2999.0), (40.5, 30.5, 3000.0), (63.5, 47.5, 120.0)] {
            let shares = lattice.shares([x, y], range);
            let of = |value: &dyn Fn(Knot) -> f64, share: &Share| {
                share.weight * (value(share.low) + share.between * (value(share.high) - value(share.low)))
            };
            let sum = |value: &dyn Fn(Knot) -> f64| shares.iter().map(|share| of(value, share)).sum::<f64>();
            assert!((sum(&|_| 1.0) - 1.0).abs() < 1e-12);
            assert!((sum(&|knot| lattice.ray(knot).1) / range - 1.0).abs() < 1e-9);
            assert!((sum(&|knot| lattice.place(knot)[0]) - x).abs() < 1e-6);
        }
    }
}
