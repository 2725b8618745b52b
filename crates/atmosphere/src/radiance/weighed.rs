//! What the points of a ray count for, whatever the sun.

use super::optics::Optics;
use super::sight::{Piece, Sight};
use super::suns::place;
use crate::solver::Field;
use crate::wide::wide_too;

/// A ray through a column at one entry: what the points count for, whatever the sun.
#[derive(Clone, Debug, Default)]
pub(crate) struct Weighed {
    /// Scaled optical depth to each point.
    pub(super) passed: Vec<f64>,
    /// The first row of a field that it draws on, and how far along the ray each is: the angle at the Earth's centre \[rad\].
    pub(super) first: usize,
    pub(super) centres: Vec<f64>,
    /// What c_l^m counts for, by m, level and l, at the levels where fields have it; of so many orders.
    kernel: Vec<Vec<f64>>,
    pub(super) orders: usize,
    /// Where light is told apart by the place it comes from: the place before each level, and the share of the next.
    pub(super) places: Vec<(usize, f64)>,
    /// Between the points: half of what peaked scatterers scatter \[m⁻¹\], and q_ray.
    pub(super) tail: (Vec<f64>, Vec<f64>),
}

impl Weighed {
    /// For fields that begin at these levels, order by order; with light told apart by place where wanted.
    pub fn new(optics: &Optics, sight: &Sight, starts: &[usize], by_place: bool) -> Self {
        let mut weighed = Self::default();
        weighed.weigh(optics, sight, starts, by_place);
        weighed
    }

    /// The same in the place of an earlier ray.
    pub fn weigh(&mut self, optics: &Optics, sight: &Sight, starts: &[usize], by_place: bool) {
        let n = sight.points.len();
        let streams = optics.streams; // no more than the ray has
        let Self { passed, tail, .. } = self;
        passed.clear();
        passed.resize(n, 0.0);
        // What c_l^m Λ_l^m counts for, by point and l.
        let mut coefficients = vec![0.0; n * streams];
        tail.0.clear();
        tail.1.clear();
        let mut tail_passed = 0.0;
        for piece in &sight.pieces {
            let Piece { layer, first, .. } = *piece;
            let mut depths = [0.0; 2];
            for (depth, step) in depths.iter_mut().zip(first..piece.last()) {
                let length = sight.lengths[step];
                *depth = length * optics.scaled[layer];
                passed[step + 1] = passed[step] + *depth;
                let own = optics.tail[layer] * length;
                tail.0.push(0.5 * optics.tail[layer]);
                tail.1.push(tail_passed + 0.5 * own);
                tail_passed += own;
            }
            let (so_far, depth) = (passed[first], depths[0] + depths[1]);
            if depth <= 0.0 || so_far > 700.0 {
                continue;
            }
            let transmitted = (-so_far).exp() * depth;
            let mut draw = |point: usize, weight: f64| {
                let row = &mut coefficients[point * streams..][..streams];
                row.iter_mut().zip(&optics.layers[layer].coupling).for_each(|(k, c)| *k += weight * transmitted * c);
            };
            let [near, middle, far] = parabola(depth, if piece.steps == 2 { depths[0] / depth } else { 0.5 });
            if piece.parabola {
                draw(first, near);
                draw(first + 1, middle);
                draw(piece.last(), far);
            } else {
                // Halfway between the ends in height J is their mean.
                draw(first, near + 0.5 * middle);
                draw(piece.last(), far + 0.5 * middle);
            }
        }
        let levels = || sight.points.iter().flat_map(|point| point.rows.iter()).map(|(level, _)| level);
        let (lowest, last) = levels().fold((usize::MAX, 0), |(a, b), level| (a.min(level), b.max(level)));
        let count = if n == 0 { 0 } else { last - lowest + 1 };
        self.first = lowest;
        self.centres.clear();
        self.centres.resize(count, 0.0);
        // The ray meets most levels once.
        let mut met = vec![false; count];
        let mut meetings = Vec::with_capacity(n);
        for (i, point) in sight.points.iter().enumerate() {
            for (level, share) in point.rows.iter() {
                let level = level - lowest;
                self.centres[level] = point.centre;
                meetings.push(Meeting { point: i, level, share, first: !std::mem::replace(&mut met[level], true) });
            }
        }
        let orders = sight.legendre.first().map_or(0, |rows| orders_in(rows.len(), sight.streams)).min(starts.len());
        self.orders = orders;
        self.kernel.resize_with(orders.max(self.kernel.len()), Vec::new);
        self.places.clear();
        if by_place {
            self.places.extend(self.centres.iter().map(|centre| place(*centre)));
        }
        let mut from = 0;
        for (m, kernel) in self.kernel[..orders].iter_mut().enumerate() {
            let width = streams - m;
            let start = starts[m].saturating_sub(lowest).min(count);
            kernel.resize(count * width, 0.0);
            for level in (start..count).filter(|level| !met[*level]) {
                kernel[level * width..][..width].fill(0.0);
            }
            weigh_order(kernel, &meetings, &coefficients, &Window { streams, m, from, start }, sight);
            from += sight.streams - m;
        }
    }

    /// How many of its first levels a field lacks at an order; the kernel and the moments at those that both have.
    #[inline(always)]
    pub(super) fn beside<'a>(&'a self, field: &'a Field, m: usize) -> (usize, [&'a [f64]; 2]) {
        let (kernel, levels) = (&self.kernel[m], self.centres.len());
        let (first, rows) = field.order(m);
        let width = kernel.len() / levels.max(1);
        let lacks = first.saturating_sub(self.first).min(levels);
        let from = (self.first + lacks).saturating_sub(first);
        (lacks, [&kernel[lacks * width..], &rows[from * width..][..(levels - lacks) * width]])
    }

    /// Orders that both have.
    pub(super) fn orders_of(&self, field: &Field) -> usize {
        field.orders().min(self.orders)
    }

    /// Scaled transmittance of the whole ray.
    pub fn transmittance(&self) -> f64 {
        self.passed.last().map_or(1.0, |depth| (-depth).exp())
    }
}

/// A point of a ray at a level of the lattice.
struct Meeting {
    point: usize,
    level: usize,
    share: f64,
    /// Whether no point before it meets the level.
    first: bool,
}

/// An order m of so many streams, whose Legendre functions begin here; fields have it from a level on.
struct Window {
    streams: usize,
    m: usize,
    from: usize,
    start: usize,
}

wide_too! {
    /// The kernel of one order, from what the points count for, by `streams` each.
    fn weigh_order(kernel: &mut [f64], meetings: &[Meeting], coefficients: &[f64], order: &Window, sight: &Sight) {
        let Window { streams, m, from, start } = *order;
        let width = streams - m;
        for meeting in meetings.iter().filter(|meeting| meeting.level >= start) {
            let row = &mut kernel[meeting.level * width..][..width];
            let coefficients = &coefficients[meeting.point * streams + m..][..width];
            let legendre = &sight.legendre(meeting.point)[from..][..width];
            if meeting.first {
                for l in 0..width {
                    row[l] = meeting.share * coefficients[l] * legendre[l];
                }
            } else {
                for l in 0..width {
                    row[l] += meeting.share * coefficients[l] * legendre[l];
                }
            }
        }
    }
}

/// Orders of which a row of Legendre functions holds all degrees.
fn orders_in(length: usize, streams: usize) -> usize {
    (0..=streams).find(|m| (0..*m).map(|k| streams - k).sum::<usize>() >= length).unwrap_or(0)
}

/// Weights of J at u = 0, `split` and 1 in ∫₀¹ J(u) e^(−T u) du, J a parabola.
fn parabola(depth: f64, split: f64) -> [f64; 3] {
    let [m0, m1, m2] = falling_moments(depth);
    [
        (m2 - (1.0 + split) * m1 + split * m0) / split,
        (m1 - m2) / (split * (1.0 - split)),
        (m2 - split * m1) / (1.0 - split),
    ]
}

/// ∫₀¹ uⁿ e^(−T u) du, n = 0, 1, 2.
fn falling_moments(depth: f64) -> [f64; 3] {
    if depth < 0.7 {
        // Σ (−T)^k / (k! (n + k + 1))
        let mut sums = [0.0; 3];
        let mut term = 1.0;
        for k in 0..14 {
            let k = f64::from(k);
            sums.iter_mut().enumerate().for_each(|(n, sum)| *sum += term / (n as f64 + k + 1.0));
            term *= -depth / (k + 1.0);
        }
        return sums;
    }
    let e = (-depth).exp();
    let m0 = (1.0 - e) / depth;
    let m1 = (m0 - e) / depth;
    [m0, m1, (2.0 * m1 - e) / depth]
}
