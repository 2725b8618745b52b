//! Pixels of which one sample tells all: those that see one plane facet alone, on which what light finds varies no more than between
//! points of the cache, while the whole disk of the sun or nothing of it shines on all that they see, and no mirror may throw it there.
//!
//! The first is proved of a pixel whatever the time, the second of each time by itself; where either fails, samples are taken.

use sunglint_geometry::{Hit, SoleFacet};
use sunglint_radiometry::REPLICATES;

use crate::paths::{Paths, RayCounts};
use crate::pixel::{Parts, PixelRadiance};
use crate::render::{Lightable, PixelPaths, Proofs, SkyView, Tile, View};
use crate::sightline::{CLUSTER_RATIO, Lattice, Sight};
use crate::sun::LastSun;

/// What is known of a block without sampling.
pub(crate) struct Even {
    /// Pixels of which some time has to be sampled, by place within the tile.
    pub rest: Vec<(u32, u32)>,
    /// Of those, the times that need not: by pixel, of all views one after another.
    done: Vec<Vec<bool>>,
    /// Where each view's times begin.
    views: Vec<usize>,
    /// F of the pixels that are told at all times, by place.
    pub told: Vec<((u32, u32), f64)>,
}

impl Even {
    /// Whether a pixel of the rest is told at one time of a view.
    pub fn is_done(&self, pixel: usize, (v, t): (usize, usize)) -> bool {
        self.done.get(pixel).is_some_and(|own| own[self.views[v] + t])
    }

    /// Traces and lights what can be told of a block of a tile, and hands each pixel to `each`, with view and time; `spent` is told
    /// view, time, rays and what the clock said before.
    pub fn of_block(
        (views, lattice): (&[View<'_>], &Lattice<'_>),
        (tile, block): (Tile, &[(u32, u32)]),
        paths: &mut Paths,
        parts: Parts,
        clock: &dyn Fn() -> f64,
        mut each: impl FnMut(&PixelPaths, (usize, usize), PixelRadiance),
        mut spent: impl FnMut((usize, usize), RayCounts, f64),
    ) -> Self {
        let view = &views[0];
        let mut even = Self { rest: block.to_vec(), done: Vec::new(), views: Vec::new(), told: Vec::new() };
        if !view.algorithm.knows_even() {
            return even;
        }
        let traced = trace(view, (tile, block), paths);
        if traced.is_empty() {
            return even;
        }
        let mut n_times = 0;
        for view in views {
            even.views.push(n_times);
            n_times += view.times.len();
        }
        let mut done = vec![vec![false; n_times]; block.len()];
        if let Some(cache) = &mut paths.cache {
            cache.light(views, lattice, parts, clock, |v, t, rays, begun| spent((v, t), rays, begun));
        }
        let lightable = Lightable::new(views, &traced, lattice, paths, parts, Proofs::Alone);
        let mut last = LastSun::default();
        // Side by side, times of several views may have one sun.
        for t in 0..views.iter().map(|view| view.times.len()).max().unwrap_or(0) {
            for (v, view) in views.iter().enumerate() {
                let Some(time) = view.times.get(t) else { continue };
                let (begun, at) = (clock(), even.views[v] + t);
                let rays = lightable.light(view, time, &mut last, Some((v, t)), |pixel, radiance| {
                    done[pixel.index][at] = true;
                    each(pixel, (v, t), radiance);
                });
                spent((v, t), rays, begun);
            }
        }
        let is_told = |own: &[bool]| own.iter().all(|done| *done);
        let all = traced.iter().filter(|pixel| is_told(&done[pixel.index]));
        even.told = all.map(|pixel| (block[pixel.index], SkyView::of(paths, pixel).mean())).collect();
        paths.clear();
        (even.rest, even.done) = block.iter().zip(done).filter(|(_, own)| !is_told(own)).unzip();
        even
    }
}

/// A sample through the middle of each pixel that may be told by it, with what the lines through the pixel's corners meet.
fn trace(view: &View<'_>, (tile, block): (Tile, &[(u32, u32)]), paths: &mut Paths) -> Vec<PixelPaths> {
    let world = &view.scenery.world;
    let Some((x, y)) = block.first().map(|(x, y)| (tile.x + x, tile.y + y)) else { return Vec::new() };
    let (width, height) = block.iter().fold((0, 0), |(w, h), (i, j)| (w.max(tile.x + i - x), h.max(tile.y + j - y)));
    let across = width as usize + 2;
    let rays: Vec<_> = (0..height + 2)
        .flat_map(|j| (0..width + 2).map(move |i| (f64::from(x + i), f64::from(y + j))))
        .map(|(x, y)| (view.sight)(x, y))
        .collect();
    let hits: Vec<_> = rays.iter().map(|ray| paths.seen(world, ray)).collect();
    let mut traced = Vec::new();
    for (index, (i, j)) in block.iter().enumerate() {
        let (column, row) = (tile.x + i, tile.y + j);
        let first = (row - y) as usize * across + (column - x) as usize;
        let corners = [first, first + 1, first + across + 1, first + across];
        let Some(met) = same_facet(corners.map(|corner| hits[corner])) else { continue };
        let sight = Sight::new(view.sight, [f64::from(column) + 0.5, f64::from(row) + 0.5]);
        let by_block = |paths: &mut Paths| {
            let sole = paths.sole.as_ref()?;
            corners.iter().all(|corner| sole.meet(&rays[*corner]).is_some()).then(|| sole.meet(&sight.ray)).flatten()
        };
        let hit = by_block(paths)
            .or_else(|| SoleFacet::of_hits(world, &corners.map(|corner| rays[corner]), &met)?.meet(&sight.ray));
        let Some(hit) = hit else { continue };
        paths.rays.camera_proved += 1;
        let mut stream = view.numbers((column, row), 0);
        let (pixel, is_even) = PixelPaths::traced(paths, index, [1; REPLICATES], &sight, |paths| {
            let is_even = view.algorithm.trace_even(view.scenery, &sight, &hit, &mut stream, paths);
            if is_even {
                for hit in met {
                    paths.vertex(hit, true, stream.later());
                }
            }
            is_even
        });
        if is_even {
            traced.push(pixel);
        }
    }
    traced
}

/// The hits, where all lie on one side of one plane facet at about one range.
fn same_facet(hits: [Option<Hit>; 4]) -> Option<[Hit; 4]> {
    let first = hits[0]?;
    let own = hits
        .map(|hit| hit.filter(|hit| (hit.facet, hit.front, hit.normal) == (first.facet, first.front, first.normal)));
    let [Some(a), Some(b), Some(c), Some(d)] = own else { return None };
    let ranges = own.iter().flatten().map(|hit| hit.t);
    let (near, far) = ranges.fold((f64::INFINITY, 0.0), |(near, far): (f64, f64), t| (near.min(t), far.max(t)));
    (far <= near * CLUSTER_RATIO).then_some([a, b, c, d])
}
