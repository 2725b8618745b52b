//! Pixels of which one sample tells all: those that see one plane facet alone, on which what light finds varies no more than between
//! points of the cache, while the whole disk of the sun or nothing of it shines on all that they see, and no mirror may throw it there.
//!
//! The first is proved of a pixel whatever the time, the second of each time by itself; where either fails, samples are taken.

use std::rc::Rc;

use sunglint_geometry::{Hit, SoleFacet};
use sunglint_radiometry::REPLICATES;

use crate::corners::Corners;
use crate::paths::{Paths, RayCounts};
use crate::pixel::{Parts, PixelRadiance};
use crate::render::{Lightable, PixelPaths, Proofs, SkyView, Tile, View};
use crate::sightline::{Lattice, Sight};
use crate::sun::LastSun;

/// A pixel of which some time has to be sampled.
pub(crate) struct Rest {
    /// Its place within the tile.
    pub place: (u32, u32),
    /// The facet that it is proved to see alone.
    pub sole: Option<Rc<SoleFacet>>,
    /// The times that need no samples, of all views one after another; empty where all do.
    done: Vec<bool>,
}

/// What is known of a block without sampling.
pub(crate) struct Even {
    pub rest: Vec<Rest>,
    /// Where each view's times begin.
    views: Vec<usize>,
    /// F of the pixels that are told at all times, by place.
    pub told: Vec<((u32, u32), f64)>,
}

impl Even {
    /// Whether a pixel of the rest is told at one time of a view.
    pub fn is_done(&self, pixel: usize, (v, t): (usize, usize)) -> bool {
        self.rest[pixel].done.get(self.views.get(v).map_or(0, |first| first + t)).is_some_and(|done| *done)
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
        let mut even = Self { rest: Vec::new(), views: Vec::new(), told: Vec::new() };
        let rest = |soles: Vec<Option<Rc<SoleFacet>>>| {
            let rest = |(place, sole): (&(u32, u32), _)| Rest { place: *place, sole, done: Vec::new() };
            block.iter().zip(soles).map(rest).collect()
        };
        if !view.algorithm.knows_even() {
            even.rest = rest(match &paths.sole {
                Some(sole) => vec![Some(sole.clone()); block.len()],
                None if !paths.sees_few => vec![None; block.len()],
                None => prove(view, (tile, block), paths).into_iter().map(|own| own.map(|(sole, _)| sole)).collect(),
            });
            return even;
        }
        let proved = prove(view, (tile, block), paths);
        let traced = trace(view, (tile, block), &proved, paths);
        let soles = proved.into_iter().map(|own| own.map(|(sole, _)| sole)).collect();
        even.rest = rest(soles);
        if traced.is_empty() {
            return even;
        }
        let mut n_times = 0;
        for view in views {
            even.views.push(n_times);
            n_times += view.times.len();
        }
        even.rest.iter_mut().for_each(|pixel| pixel.done = vec![false; n_times]);
        if let Some(cache) = &mut paths.cache {
            cache.light(views, lattice, parts, clock, |v, t, rays, begun| spent((v, t), rays, begun));
        }
        let lightable = Lightable::new(views, &traced, lattice, paths, parts, Proofs::Alone);
        let mut last = LastSun::default();
        // Side by side, times of several views may have one sun.
        for t in 0..views.iter().map(|view| view.times.len()).max().unwrap_or(0) {
            for (v, view) in views.iter().enumerate() {
                let Some(time) = view.times.get(t) else { continue };
                let (begun, at, rest) = (clock(), even.views[v] + t, &mut even.rest);
                let rays = lightable.light(view, time, &mut last, Some((v, t)), |pixel, radiance| {
                    rest[pixel.index].done[at] = true;
                    each(pixel, (v, t), radiance);
                });
                spent((v, t), rays, begun);
            }
        }
        let is_told = |own: &Rest| !own.done.is_empty() && own.done.iter().all(|done| *done);
        let all = traced.iter().filter(|pixel| is_told(&even.rest[pixel.index]));
        even.told = all.map(|pixel| (block[pixel.index], SkyView::of(paths, pixel).mean())).collect();
        paths.clear();
        even.rest.retain(|own| !is_told(own));
        even
    }
}

/// The facet that a pixel is proved to see alone, and what the lines of sight through its corners meet.
type Proved = Option<(Rc<SoleFacet>, [Hit; 4])>;

fn prove(view: &View<'_>, (tile, block): (Tile, &[(u32, u32)]), paths: &Paths) -> Vec<Proved> {
    let corners = Corners::of_block(view, (tile, block), paths);
    let world = &view.scenery.world;
    let proved = |pixel: &(u32, u32)| {
        let met = corners.met(*pixel)?;
        Some((corners.sole(world, *pixel, &met, paths.sole.as_ref())?, met))
    };
    block.iter().map(proved).collect()
}

/// A sample through the middle of each pixel that may be told by it, with what the lines through the pixel's corners meet.
fn trace(
    view: &View<'_>,
    (tile, block): (Tile, &[(u32, u32)]),
    proved: &[Proved],
    paths: &mut Paths,
) -> Vec<PixelPaths> {
    let mut traced = Vec::new();
    for (index, ((i, j), proved)) in block.iter().zip(proved).enumerate() {
        let Some((sole, met)) = proved else { continue };
        let (column, row) = (tile.x + i, tile.y + j);
        let sight = Sight::new(view.sight, [f64::from(column) + 0.5, f64::from(row) + 0.5]);
        let Some(hit) = sole.meet(&sight.ray) else { continue };
        paths.rays.camera_proved += 1;
        let mut stream = view.numbers((column, row), 0);
        let (pixel, is_even) = PixelPaths::traced(paths, index, [1; REPLICATES], &sight, |paths| {
            let is_even = view.algorithm.trace_even(view.scenery, &sight, &hit, &mut stream, paths);
            if is_even {
                for hit in met {
                    paths.vertex(*hit, true, stream.later());
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
