//! Sky and background over the Lambertian part of what the sensor sees, gathered at points of its facets and interpolated
//! [Ward1988].
//!
//! ```text
//! L(x) ≈ Σ_i w_i(x) L(x_i)      w_i bilinear over a square cell of side h, x_i its corners
//! ```
//!
//! What surrounds a point changes over a distance of about R, the harmonic mean of the distances to what its hemisphere meets,
//!
//! ```text
//! 1/R = (1/π) ∫ cos θ / d(ω) dω      |L(x) − L(x_i)| ≤ (4/π) L |x − x_i|/R   [Ward1988, eq. 4, on a plane]
//! ```
//!
//! so that a cell serves where h ≤ κ R at each corner, and nothing stands between its corners; else smaller ones are tried, and at
//! last every sample looks for itself. Cells are squares of the facet's plane whose sides are powers of two, and points are gathered
//! by numbers of their own: a point is the same from whatever pixel it was asked for.

use glam::DVec3;
use rustc_hash::FxHashMap;
use smallvec::SmallVec;
use sunglint_geometry::{FacetId, Hit, Ray, World};
use sunglint_radiometry::{REPLICATES, WorldDir};

use crate::hemisphere::{Squares, floor};
use crate::paths::{Paths, RayCounts};
use crate::pixel::{Parts, PixelRadiance, Term};
use crate::render::{Lightable, PixelPaths, Proofs, View};
use crate::sightline::Lattice;
use crate::sun::LastSun;
use crate::{Accuracy, Sight};

/// κ: the most that a cell's side is of R.
const WIDEST: f64 = 0.5;
/// The most that F differs between the corners of a cell, of the largest.
const STEEPEST: f64 = 0.2;
/// Sides of cells that are tried, in squares of a facet: powers of two.
const SIZES: [f64; 3] = [2.0, 1.0, 0.5];
/// Samples of a replicate at each point, for each of a pixel's.
const SAMPLES: u32 = 4;
/// The same under an error of a hundredth, and the most under a smaller one.
const AT_ONE_PERCENT: f64 = 8.0;
const MOST_SAMPLES: f64 = 512.0;
/// Height above the plane at which nothing may stand between corners, in sides of the cell.
const CLEAR_AT: f64 = 1e-3;
/// Where the corners of cells of all sizes begin, along the sides of a facet \[m\]: at no round number, where walls stand.
const ORIGIN: [f64; 2] = [0.754_877_666_246_692_8, 0.569_840_290_998_053_2];
/// Bytes of lit points that are kept.
const MOST_BYTES: usize = 1 << 26;

/// A facet and its side, the power of two that a cell's side is, and a corner's place in such sides.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
struct Key {
    of: (FacetId, bool),
    exponent: i32,
    place: [i64; 2],
}

impl Key {
    /// That of the same point among the widest cells that have it for a corner.
    fn widest(mut self) -> Self {
        while self.place.iter().all(|i| i % 2 == 0) && self.place != [0, 0] {
            self.place = self.place.map(|i| i / 2);
            self.exponent += 1;
        }
        self
    }

    /// Tells the numbers of its samples from those of all pixels.
    fn stream(&self) -> u64 {
        let Self { of: (facet, front), exponent, place: [u, v] } = *self;
        let parts = [u64::from(facet.0), u64::from(front), exponent as u64, u as u64, v as u64];
        let folded =
            parts.iter().fold(0_u64, |hash, part| (hash.rotate_left(5) ^ part).wrapping_mul(0x9e37_79b9_7f4a_7c15));
        folded | 1 << 63
    }
}

/// The points at the corners of a cell.
type Corners = [u32; 4];

/// A sample's place in a cell.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Taken {
    sample: u32,
    corners: Corners,
    /// In sides of the cell from its first corner.
    at: [f64; 2],
}

/// Bilinear weights of the corners of a cell.
fn weights([u, v]: [f64; 2]) -> [f64; 4] {
    [(1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v]
}

/// A cell that serves.
#[derive(Clone, Copy)]
struct Cell {
    side: f64,
    /// Its place along the sides of its facet, in sides of its own.
    place: [f64; 2],
    corners: Corners,
}

impl Cell {
    fn at(&self, along: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|i| along[i] / self.side - self.place[i])
    }

    fn holds(&self, along: [f64; 2]) -> bool {
        self.at(along).iter().all(|at| (0.0..1.0).contains(at))
    }
}

/// The cell that was taken last, of a facet and side whose squares had this side.
struct Last {
    of: (FacetId, bool),
    squares: f64,
    cell: Cell,
}

/// What gathering at a point tells before any light.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Gathered {
    /// F.
    pub sky_view: f64,
    /// 1/R \[m⁻¹\].
    pub nearness: f64,
}

/// Where a point is gathered: as if a line of sight met the facet there.
pub(crate) struct Place<'a> {
    pub hit: Hit,
    pub sight: Sight<'a>,
    /// Seed, view and stream of its numbers.
    pub numbers: [u64; 3],
    /// Samples of each replicate.
    pub each: u32,
}

/// A point's radiance at one time, by channel and replicate, L_u left out.
struct PointLight {
    radiance: Vec<[f64; REPLICATES]>,
    surface: Vec<[f64; REPLICATES]>,
    terms: Vec<(Term, Vec<f64>)>,
}

/// What a pixel takes of points: by point and replicate, over the samples of each replicate.
pub(crate) type PointShares = SmallVec<[(u32, [f64; REPLICATES]); 4]>;

/// The points of a tile.
#[derive(Default)]
pub(crate) struct IrradianceCache {
    numbers: [u64; 2],
    each: u32,
    n_nodes: usize,
    points: FxHashMap<Key, u32>,
    gathered: Vec<Gathered>,
    cells: FxHashMap<Key, Option<Corners>>,
    last: Option<Last>,
    /// Points that were traced and wait for light.
    paths: Option<Box<Paths>>,
    waiting: Vec<PixelPaths>,
    /// By view, time and point.
    lit: Vec<Vec<Vec<PointLight>>>,
}

impl IrradianceCache {
    /// Makes ready for a block of a view.
    pub fn begin(&mut self, view: &View<'_>) {
        (self.numbers, self.n_nodes) = ([view.seed, view.id], view.nodes.len());
        self.each = match view.accuracy {
            Accuracy::Samples(n) => SAMPLES * n.div_ceil(REPLICATES as u32).max(1),
            Accuracy::Error { relative, .. } => {
                (AT_ONE_PERCENT * (0.01 / relative).powi(2)).clamp(AT_ONE_PERCENT, MOST_SAMPLES).ceil() as u32
            }
        };
        let images: usize = self.lit.iter().map(Vec::len).sum::<usize>() * view.channels.len();
        if images * self.gathered.len() * size_of::<[f64; REPLICATES]>() > MOST_BYTES {
            let Self { numbers, each, n_nodes, .. } = *self;
            *self = Self { numbers, each, n_nodes, paths: self.paths.take(), ..Self::default() };
        }
    }

    /// What a sample takes of the points about its hit, and F there; `None` where no cell serves. New points are gathered by `gather`.
    pub fn take(
        &mut self,
        world: &World,
        hit: &Hit,
        (sample, squares, sight): (u32, Squares, &Sight<'_>),
        mut gather: impl FnMut(&Place<'_>, &mut Paths) -> Gathered,
    ) -> Option<(Taken, f64)> {
        let of = (hit.facet, hit.front);
        let along = [0, 1].map(|i| squares.axes[i].dot(hit.point) - ORIGIN[i]);
        let (cell, at) = match self.last.as_ref().filter(|last| (last.of, last.squares) == (of, squares.side)) {
            Some(Last { cell, .. }) if cell.holds(along) => (*cell, cell.at(along)),
            _ => {
                let cell = SIZES.into_iter().find_map(|size| {
                    let squares = Squares { side: squares.side * size, ..squares };
                    let place = along.map(|along| floor(along / squares.side));
                    // Beyond, places among cells are no longer told apart.
                    if place.iter().any(|at| at.abs() > 1e15) {
                        return None;
                    }
                    let exponent = (squares.side.to_bits() >> 52) as i32;
                    let key = Key { of, exponent, place: place.map(|at| at as i64) };
                    let corners = match self.cells.get(&key) {
                        Some(known) => *known,
                        None => {
                            let corners = self.corners(world, hit, (squares, key), sight, &mut gather);
                            self.cells.insert(key, corners);
                            corners
                        }
                    };
                    corners.map(|corners| Cell { side: squares.side, place, corners })
                })?;
                self.last = Some(Last { of, squares: squares.side, cell });
                (cell, cell.at(along))
            }
        };
        let seen = cell.corners.map(|point| self.gathered[point as usize].sky_view);
        let sky_view = weights(at).iter().zip(seen).map(|(weight, seen)| weight * seen).sum();
        Some((Taken { sample, corners: cell.corners, at }, sky_view))
    }

    /// The corners of a cell, gathered where they are new; `None` where it does not serve.
    fn corners(
        &mut self,
        world: &World,
        hit: &Hit,
        (squares, key): (Squares, Key),
        sight: &Sight<'_>,
        gather: &mut impl FnMut(&Place<'_>, &mut Paths) -> Gathered,
    ) -> Option<Corners> {
        let corner = |i: usize| {
            let place = [key.place[0] + (i & 1) as i64, key.place[1] + (i >> 1) as i64];
            let along = [0, 1].map(|axis| place[axis] as f64 + ORIGIN[axis] / squares.side);
            (squares.point(along), Key { place, ..key }.widest())
        };
        let corners: [(DVec3, Key); 4] = std::array::from_fn(corner);
        if !is_clear(world, hit, corners.map(|(point, _)| point), squares.side) {
            return None;
        }
        let mut points = [0; 4];
        for (own, (point, key)) in points.iter_mut().zip(corners) {
            *own = match self.points.get(&key) {
                Some(known) => *known,
                None => {
                    let gathered = self.gather(hit, point, key, sight, gather)?;
                    self.gathered.push(gathered);
                    self.points.insert(key, self.gathered.len() as u32 - 1);
                    self.gathered.len() as u32 - 1
                }
            };
            if squares.side * self.gathered[*own as usize].nearness > WIDEST {
                return None;
            }
        }
        let seen = points.map(|point| self.gathered[point as usize].sky_view);
        let (least, most) = seen.iter().fold((f64::INFINITY, 0.0), |(l, m): (f64, f64), f| (l.min(*f), m.max(*f)));
        (most - least <= STEEPEST * most).then_some(points)
    }

    /// Gathers at a point; `None` where no line of sight leads there.
    fn gather(
        &mut self,
        hit: &Hit,
        point: DVec3,
        key: Key,
        sight: &Sight<'_>,
        gather: &mut impl FnMut(&Place<'_>, &mut Paths) -> Gathered,
    ) -> Option<Gathered> {
        let sight = sight.to(point)?;
        // Beyond what rounding moves it by, and the same for every cell that it is a corner of.
        let error = 1024.0 * f64::EPSILON * (1.0 + point.abs().max_element());
        let hit = Hit { t: sight.ray.origin.distance(point), point, error, ..*hit };
        let [seed, view] = self.numbers;
        let place = Place { hit, sight, numbers: [seed, view, key.stream()], each: self.each };
        let paths = self.paths.get_or_insert_with(|| Box::new(Paths::new(self.n_nodes)));
        let (index, counts) = (self.gathered.len(), [self.each; REPLICATES]);
        let (point, gathered) = PixelPaths::traced(paths, index, counts, &place.sight, |paths| gather(&place, paths));
        self.waiting.push(point);
        Some(gathered)
    }

    /// Lights the points that wait at every time of every view; `each` is told view, time, rays and what the clock said before.
    pub fn light(
        &mut self,
        views: &[View<'_>],
        lattice: &Lattice<'_>,
        parts: Parts,
        clock: &dyn Fn() -> f64,
        mut each: impl FnMut(usize, usize, RayCounts, f64),
    ) {
        let Some(mut paths) = self.paths.take() else { return };
        if !self.waiting.is_empty() {
            // A point is the same whichever others wait with it.
            let lightable = Lightable::new(views, &self.waiting, lattice, &paths, parts, Proofs::Apart);
            self.lit.resize_with(views.len(), Vec::new);
            let mut last = LastSun::default();
            for t in 0..views.iter().map(|view| view.times.len()).max().unwrap_or(0) {
                for (v, view) in views.iter().enumerate() {
                    let Some(time) = view.times.get(t) else { continue };
                    let begun = clock();
                    let lit = &mut self.lit[v];
                    lit.resize_with(view.times.len(), Vec::new);
                    let rays = lightable.light(view, time, &mut last, None, |_, own| lit[t].push(PointLight::new(own)));
                    each(v, t, rays, begun);
                }
            }
            self.waiting.clear();
            paths.clear();
        }
        self.paths = Some(paths);
    }

    /// Adds what a pixel takes at one time of one view, with so many samples of each replicate; where `noise` is asked for what of it
    /// is noise is told too.
    pub fn add(
        &self,
        (v, t): (usize, usize),
        shares: &PointShares,
        counts: &[u32; REPLICATES],
        noise: bool,
        to: &mut PixelRadiance,
    ) {
        let of_time = &self.lit[v][t];
        let n = to.radiance.len();
        to.cache_noise = vec![[0.0; REPLICATES]; if noise { n } else { 0 }];
        let each = counts.map(|count| 1.0 / f64::from(count.max(1)));
        for (point, weights) in shares {
            let light = &of_time[*point as usize];
            let shares: [f64; REPLICATES] = std::array::from_fn(|r| weights[r] * each[r]);
            for (sums, own) in [(&mut to.radiance, &light.radiance), (&mut to.surface, &light.surface)] {
                for (sums, own) in sums.iter_mut().zip(own) {
                    (0..REPLICATES).for_each(|r| sums[r] += shares[r] * own[r]);
                }
            }
            for (sums, own) in to.cache_noise.iter_mut().zip(&light.radiance) {
                let mean = own.iter().sum::<f64>() / REPLICATES as f64;
                (0..REPLICATES).for_each(|r| sums[r] += shares[r] * (own[r] - mean));
            }
            let share = shares.iter().sum::<f64>() / REPLICATES as f64;
            for (term, own) in &light.terms {
                let known = to.terms.iter().position(|(known, _)| known == term).unwrap_or_else(|| {
                    to.terms.push((*term, vec![0.0; n]));
                    to.terms.len() - 1
                });
                to.terms[known].1.iter_mut().zip(own).for_each(|(sum, own)| *sum += share * own);
            }
        }
        to.terms.sort_by_key(|(term, _)| *term);
    }
}

impl PointLight {
    fn new(own: PixelRadiance) -> Self {
        let PixelRadiance { mut radiance, surface, terms, upwelled, .. } = own;
        for (sums, upwelled) in radiance.iter_mut().zip(&upwelled) {
            sums.iter_mut().for_each(|sum| *sum -= upwelled);
        }
        Self { radiance, surface, terms }
    }
}

/// What the samples of a pixel take of points, by point.
pub(crate) fn shares_of(paths: &Paths, taken: &[Taken]) -> PointShares {
    // Of a cell, by replicate: Σ 1, Σ u, Σ v and Σ u v.
    let mut cells: SmallVec<[(Corners, [[f64; REPLICATES]; 4]); 2]> = SmallVec::new();
    for Taken { sample, corners, at: [u, v] } in taken {
        let at = cells.iter().rposition(|(known, _)| known == corners).unwrap_or_else(|| {
            cells.push((*corners, [[0.0; REPLICATES]; 4]));
            cells.len() - 1
        });
        let sample = &paths.samples[*sample as usize];
        for (sums, value) in cells[at].1.iter_mut().zip([1.0, *u, *v, u * v]) {
            sums[usize::from(sample.replicate)] += sample.weight * value;
        }
    }
    let mut shares = PointShares::new();
    for (corners, [n, u, v, uv]) in cells {
        for (i, point) in corners.iter().enumerate() {
            let at = shares.iter().position(|(known, _)| known == point).unwrap_or_else(|| {
                shares.push((*point, [0.0; REPLICATES]));
                shares.len() - 1
            });
            for (r, sum) in shares[at].1.iter_mut().enumerate() {
                *sum += match i {
                    0 => n[r] - u[r] - v[r] + uv[r],
                    1 => u[r] - uv[r],
                    2 => v[r] - uv[r],
                    _ => uv[r],
                };
            }
        }
    }
    shares
}

/// Whether nothing stands on a cell as far as lines between its corners and its middles tell: no corner lies within something.
fn is_clear(world: &World, hit: &Hit, [a, b, c, d]: [DVec3; 4], side: f64) -> bool {
    let middle = |a: DVec3, b: DVec3| 0.5 * (a + b);
    let (ab, cd, ac, bd) = (middle(a, b), middle(c, d), middle(a, c), middle(b, d));
    let lines = [(a, b), (c, d), (a, c), (b, d), (a, d), (b, c), (ab, cd), (ac, bd)];
    let lift = CLEAR_AT * side * hit.normal;
    lines.iter().all(|(from, to)| {
        let along = *to - *from;
        let ray = Ray { t_max: along.length(), left: hit.left, ..Ray::new(*from + lift, WorldDir::new(along)) };
        !world.occluded(&ray)
    })
}
