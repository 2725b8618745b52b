//! The parts of a column, and rays through them.

use super::optics::Optics;
use crate::ray::{Shells, Stretch};
use crate::solver::{Cut, normalised};

/// The parts of each layer, and where the solver knows the field.
#[derive(Clone, Debug)]
pub(crate) struct Lattice {
    /// Heights of edges and middles \[m\], from the top down: what the parts see of the sun.
    pub levels: Vec<f64>,
    /// Layer of each part.
    layer_of: Vec<usize>,
    /// The row of the field at each edge; a part whose middle has one between its edges' skips one.
    rows: Vec<usize>,
    /// First part of each layer.
    first: Vec<usize>,
}

impl Lattice {
    pub fn new(shells: &Shells, optics: &Optics) -> Self {
        let mut lattice = Self { levels: vec![shells.top()], layer_of: Vec::new(), rows: vec![0], first: Vec::new() };
        for (i, layer) in optics.layers.iter().enumerate() {
            lattice.first.push(lattice.layer_of.len());
            let (top, bottom) = (shells.heights[i], shells.heights[i + 1]);
            let Cut { parts, middles } = layer.cut;
            for part in 0..parts {
                let at = |half: usize| top + (bottom - top) * half as f64 / (2 * parts) as f64;
                lattice.levels.extend([at(2 * part + 1), at(2 * part + 2)]);
                lattice.rows.push(lattice.rows[lattice.layer_of.len()] + 1 + usize::from(middles));
                lattice.layer_of.push(i);
            }
        }
        lattice
    }

    /// Whether another column is cut alike.
    pub fn serves(&self, optics: &Optics) -> bool {
        let ends = self.first.iter().skip(1).copied().chain([self.layer_of.len()]);
        self.first.len() == optics.layers.len()
            && (self.first.iter().zip(ends).zip(&optics.layers))
                .all(|((a, b), layer)| Cut { parts: b - a, middles: self.has_middle(*a) } == layer.cut)
    }

    /// Whether the field is known in the middle of a part.
    fn has_middle(&self, part: usize) -> bool {
        self.rows[part + 1] - self.rows[part] == 2
    }

    /// Where a part begins: its first level, and its first row of the field.
    pub fn starts_at(&self, part: usize) -> (usize, usize) {
        (2 * part, self.rows[part])
    }

    /// The first part that reaches below a height, from the top down.
    pub fn first_below(&self, height: f64) -> usize {
        let edges = self.levels.len() / 2;
        (0..edges - 1).rev().find(|part| self.levels[2 * part] >= height).unwrap_or(0)
    }

    /// Parts of a layer, lowest first.
    fn parts(&self, layer: usize) -> impl Iterator<Item = usize> {
        let end = self.first.get(layer + 1).copied().unwrap_or(self.layer_of.len());
        (self.first[layer]..end).rev()
    }
}

/// Up to three places in a row and their shares.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Among {
    places: [(usize, f64); 3],
    pub(super) used: usize,
}

impl Among {
    /// `at` beyond the first of a row, by a parabola through three or a straight line between two.
    fn new(first: usize, at: f64, parabola: bool) -> Self {
        let nearest = at.round();
        if (at - nearest).abs() < 1e-9 {
            return Self { places: [(first + nearest as usize, 1.0), (0, 0.0), (0, 0.0)], used: 1 };
        }
        if !parabola {
            return Self { places: [(first, 1.0 - at), (first + 1, at), (0, 0.0)], used: 2 };
        }
        let t = at - 1.0;
        let shares = [0.5 * t * (t - 1.0), 1.0 - t * t, 0.5 * t * (t + 1.0)];
        Self { places: std::array::from_fn(|k| (first + k, shares[k])), used: 3 }
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = (usize, f64)> {
        self.places[..self.used].iter().copied()
    }
}

/// A point of a ray.
#[derive(Clone, Debug)]
pub(super) struct Point {
    /// Among the levels of the lattice.
    pub(super) levels: Among,
    /// Among the rows of the field; none where the ends of the piece tell J.
    pub(super) rows: Among,
    /// Cosine of the ray's zenith angle.
    cosine: f64,
    /// Angle at the Earth's centre from the site \[rad\].
    pub(super) centre: f64,
}

/// Which end of a ray looks at the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Look {
    /// From the lower end: light comes down.
    Up,
    /// From the upper end: light goes up.
    Down,
}

/// A ray through a lattice, from whoever looks.
#[derive(Clone, Debug)]
pub(crate) struct Sight {
    /// What it crosses of the parts.
    pub(super) pieces: Vec<Piece>,
    /// Between the points \[m\].
    pub(super) lengths: Vec<f64>,
    pub(super) points: Vec<Point>,
    /// Λ_l^m of the light's direction at each point, orders one after another; one set where the ray is straight.
    pub(super) legendre: Vec<Vec<f64>>,
    pub(super) streams: usize,
}

/// What a ray crosses of one part.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
    pub(super) layer: usize,
    /// Its points: this one, and as many more as it has steps, one or two. Two meet in its middle.
    pub(super) first: usize,
    pub(super) steps: usize,
    /// Whether J is a parabola within, not a straight line.
    pub(super) parabola: bool,
}

impl Piece {
    pub(super) fn last(&self) -> usize {
        self.first + self.steps
    }
}

/// Cosines that differ by less count as one.
const STRAIGHT: f64 = 1e-4;

impl Sight {
    /// A ray that rises from a height at a zenith angle 0..π/2 to a height or a length \[m\], whichever comes first; with the
    /// Legendre functions of so many orders.
    pub fn new(
        shells: &Shells,
        lattice: &Lattice,
        look: Look,
        (from, zenith): (f64, f64),
        (end, longest): (f64, f64),
        streams: usize,
        orders: usize,
    ) -> Self {
        let (mut pieces, mut lengths, mut points) = (Vec::<Piece>::new(), Vec::new(), Vec::<Point>::new());
        let mut rest = longest;
        'ray: for stretch in shells.rising(from, zenith, end) {
            for part in lattice.parts(stretch.layer) {
                let (top, bottom) = (lattice.levels[2 * part], lattice.levels[2 * part + 2]);
                let parabola = lattice.has_middle(part);
                let lowest = part + 1 == lattice.layer_of.len(); // goes on below the ground
                let low = if lowest { stretch.low } else { stretch.low.max(bottom) };
                let mut high = stretch.high.min(top);
                if high <= low {
                    continue;
                }
                let whole = shells.length(&stretch, high) - shells.length(&stretch, low);
                if whole > rest {
                    // Where the length runs out, to first order in what is left.
                    high = low + (high - low) * rest / whole;
                }
                // On a flat Earth the middle tells nothing of the sun that the ends do not.
                let steps = if parabola || shells.is_round() { 2 } else { 1 };
                let at = |step: usize| low + (high - low) * (step as f64 / steps as f64);
                for step in usize::from(!points.is_empty())..=steps {
                    let mut point = Point::new(shells, &stretch, lattice, part, at(step));
                    if step == 1 && steps == 2 && !parabola {
                        point.rows = Among::default();
                    }
                    points.push(point);
                }
                pieces.push(Piece { layer: stretch.layer, first: 0, steps, parabola });
                let along = (0..=steps).map(|step| shells.length(&stretch, at(step))).collect::<Vec<f64>>();
                lengths.extend(along.windows(2).map(|ends| ends[1] - ends[0]));
                rest -= whole;
                if rest <= 0.0 {
                    break 'ray;
                }
            }
        }
        if look == Look::Down {
            pieces.reverse();
            lengths.reverse();
            points.reverse();
        }
        let mut first = 0;
        for piece in &mut pieces {
            (piece.first, first) = (first, first + piece.steps);
        }
        let table = |cosine: f64| {
            let mu = if look == Look::Up { -cosine } else { cosine };
            let mut rows = Vec::with_capacity(orders * streams);
            for m in 0..orders {
                let from = rows.len();
                rows.resize(from + streams - m, 0.0);
                normalised(m, mu, &mut rows[from..]);
            }
            rows
        };
        let cosines = || points.iter().map(|point| point.cosine);
        let (low, high) = cosines().fold((f64::INFINITY, 0.0), |(a, b), c| (f64::min(a, c), f64::max(b, c)));
        let legendre = match high - low < STRAIGHT {
            true => vec![table(0.5 * (low + high))],
            false => cosines().map(table).collect(),
        };
        Self { pieces, lengths, points, legendre, streams }
    }

    /// Whether the sun changes along the ray by more than the sun of one place can stand for.
    pub fn is_flat(&self) -> bool {
        self.points.first().is_some_and(|point| point.cosine < FLAT)
    }

    pub(super) fn legendre(&self, point: usize) -> &[f64] {
        if self.legendre.len() == 1 { &self.legendre[0] } else { &self.legendre[point] }
    }
}

impl Point {
    fn new(shells: &Shells, stretch: &Stretch, lattice: &Lattice, part: usize, height: f64) -> Self {
        let (top, bottom) = (lattice.levels[2 * part], lattice.levels[2 * part + 2]);
        let place = (2.0 * (top - height) / (top - bottom)).clamp(0.0, 2.0);
        let levels = Among::new(2 * part, place, true);
        let rows = match lattice.has_middle(part) {
            true => Among::new(lattice.rows[part], place, true),
            false => Among::new(lattice.rows[part], 0.5 * place, false),
        };
        Self { levels, rows, cosine: shells.cosine(stretch, height), centre: shells.centre(stretch, height) }
    }
}

/// A ray flatter than this sees the sun change along its way \[cosine\]; for others the sun of the mean place serves.
const FLAT: f64 = 0.2;
