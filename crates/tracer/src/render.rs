//! Tiles: all pixels of a tile, at all times of its view.

use std::ops::Range;
use std::rc::Rc;

use smallvec::SmallVec;
use sunglint_atmosphere::Path;
use sunglint_geometry::{FacetId, Hit, Ray, SoleFacet};
use sunglint_radiometry::{Channels, Estimate, REPLICATES, estimate};

use crate::allocation::{First, Worth};
use crate::even::{Even, Rest};
use crate::gathered::PixelLight;
use crate::irradiance_cache::{PointShares, shares_of};
use crate::light::{Block, BlockLight};
use crate::paths::{Paths, RayCounts};
use crate::pixel::{Parts, PixelRadiance, Term};
use crate::sightline::{self, Lattice, Shares, Sight};
use crate::sun::LastSun;
use crate::unseen::half_of;
use crate::{Algorithm, Draw, Lights, Nodes, Scenery, Stream};

/// Pixels along a side of a tile, the unit of resuming and of sharing work: where that leaves enough of them for many threads the
/// larger, whose pixels share more.
const TILES: [u32; 2] = [64, 32];
const ENOUGH_TILES: u32 = 64;
/// Pixels along a side of a block: the unit in which paths are kept and sun rays proved unnecessary.
pub(crate) const BLOCK: u32 = 8;
/// Rays along a side of a block that tell what it sees.
const PROBES: usize = 4;
/// Facets among what these meet up to which it is worth proving what pixels of the block see.
const FEW: usize = 4;
/// Bytes of the paths of one block after which they are lit and dropped.
const PATHS_LIMIT: usize = 1 << 25;

/// How accurate a render is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Accuracy {
    /// Samples a pixel, rounded up to a multiple of the replicates.
    Samples(u32),
    /// Relative standard error against the larger of the pixel and a floor. The first 16 samples choose the number: those of
    /// one half of the replicates choose for the other half, so that no sample decides on the weight of its own replicate and
    /// the mean stays unbiased.
    Error {
        /// Relative standard error.
        relative: f64,
        /// Floor \[W m⁻² sr⁻¹ µm⁻¹\]; a hundredth of the block's mean where `None`.
        floor: Option<f64>,
        /// Most samples a pixel.
        most: u32,
        /// Whether it is wanted of every pixel; else of the root mean square over the image, for which samples go where each
        /// lowers that most.
        every_pixel: bool,
    },
}

/// A sensor with all its times, as one experiment sees it.
#[derive(Clone, Copy)]
pub struct View<'a> {
    /// Geometry and surfaces.
    pub scenery: &'a Scenery,
    /// The algorithm.
    pub algorithm: &'a dyn Algorithm,
    /// The line of sight at image coordinates (x across, y down, in pixels).
    pub sight: &'a (dyn Fn(f64, f64) -> Ray + Sync),
    /// Pixels across and down.
    pub pixels: (u32, u32),
    /// Output channels.
    pub channels: &'a Channels,
    /// The wavelengths that stand for each channel.
    pub nodes: &'a Nodes,
    /// The times.
    pub times: &'a [Lights],
    /// How accurate.
    pub accuracy: Accuracy,
    /// What a sample is worth, where an error over the image is asked for.
    pub worth: Option<&'a Worth>,
    /// The scene's seed.
    pub seed: u64,
    /// Tells views of one seed apart; the same for every experiment, so that experiments see the same samples.
    pub id: u64,
    /// Whether the radiance that leaves the surface is wanted.
    pub surface_radiance: bool,
}

impl View<'_> {
    /// Whether its paths are another's, sample by sample, where both look along the same lines of sight: the two differ in
    /// nothing but light. Not where the noise chooses the number of samples, which is each view's own.
    pub fn traces_as(&self, other: &View<'_>) -> bool {
        matches!(self.accuracy, Accuracy::Samples(_))
            && self.accuracy == other.accuracy
            && (self.seed, self.id, self.pixels) == (other.seed, other.id, other.pixels)
            && self.scenery.is(other.scenery)
            && self.channels == other.channels
            && self.nodes == other.nodes
            && self.algorithm.traced_by() == other.algorithm.traced_by()
    }

    /// The numbers of a pixel's first sample in a replicate.
    pub(crate) fn numbers(&self, pixel: (u32, u32), replicate: u32) -> Stream {
        let key = u64::from(pixel.1) * u64::from(self.pixels.0) + u64::from(pixel.0);
        Stream::new(self.seed, self.id, key, replicate, 0)
    }

    /// Where its lines of sight are solved.
    pub(crate) fn lattice(&self) -> Lattice<'_> {
        let world = &self.scenery.world;
        let facets = world.bounds().map(|(low, _)| low.z);
        let floor = facets.into_iter().chain(world.ground().map(|ground| ground.height)).fold(f64::INFINITY, f64::min);
        Lattice::new(self.sight, self.pixels, if floor.is_finite() { floor } else { f64::NEG_INFINITY })
    }

    /// Makes ready to trace pixels of a block of the image: rays spread over it tell what it sees.
    pub(crate) fn begin(&self, block: Tile, lattice: &Lattice<'_>, paths: &mut Paths) {
        let world = &self.scenery.world;
        let at = |u: f64, v: f64| {
            (self.sight)(
                f64::from(block.x) + u * f64::from(block.width),
                f64::from(block.y) + v * f64::from(block.height),
            )
        };
        let probes: [Option<Hit>; PROBES * PROBES] = std::array::from_fn(|i| {
            let middle = |i: usize| (i as f64 + 0.5) / PROBES as f64;
            world.closest(&at(middle(i % PROBES), middle(i / PROBES)))
        });
        paths.cache.get_or_insert_default().begin(self);
        paths.horizons.begin(world, lattice.pixel_width(), &probes);
        let mut facets: SmallVec<[Option<FacetId>; PROBES * PROBES]> = SmallVec::new();
        for facet in probes.iter().map(|hit| hit.map(|hit| hit.facet)) {
            if !facets.contains(&facet) {
                facets.push(facet);
            }
        }
        paths.sees_few = facets.len() <= FEW;
        let is_one = facets.len() == 1 && facets[0].is_some();
        let corners = || [at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0), at(0.0, 1.0)];
        paths.sole = is_one.then(corners).and_then(|corners| SoleFacet::of(world, &corners)).map(Rc::new);
    }
}

/// A rectangle of pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tile {
    /// Left column.
    pub x: u32,
    /// Top row.
    pub y: u32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

/// Pixels along a side of a tile of an image of `pixels`.
pub fn tile_side((width, height): (u32, u32)) -> u32 {
    let enough = |side: &&u32| u64::from(width) * u64::from(height) >= u64::from(ENOUGH_TILES * **side * **side);
    *TILES.iter().find(enough).unwrap_or(&TILES[1])
}

/// The tiles of an image of `pixels` that cover a window of it, row by row: those of the whole image, cut down to whole
/// blocks, so that every pixel is what it is in the whole image.
pub fn tiles(pixels: (u32, u32), window: Tile) -> Vec<Tile> {
    let side = tile_side(pixels);
    // Cuts of one axis: from the block that holds the first pixel to the end of the one that holds the last.
    let cuts = |first: u32, count: u32, n: u32| -> Vec<(u32, u32)> {
        let end = (first + count).next_multiple_of(BLOCK).min(n);
        let mut cuts = Vec::new();
        let mut start = first - first % BLOCK;
        while start < end {
            let stop = (start - start % side + side).min(end);
            cuts.push((start, stop - start));
            start = stop;
        }
        cuts
    };
    let across = cuts(window.x, window.width, pixels.0);
    let down = cuts(window.y, window.height, pixels.1);
    let row = |&(y, height): &(u32, u32)| {
        across.iter().map(move |&(x, width)| Tile { x, y, width, height }).collect::<Vec<_>>()
    };
    down.iter().flat_map(row).collect()
}

/// What a tile yields. Images are row-major within the tile; `times` and channels are outer indices.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TileResult {
    /// Radiance by time, channel, pixel \[W m⁻² sr⁻¹ µm⁻¹\].
    pub radiance: Vec<f32>,
    /// Its standard error.
    pub error: Vec<f32>,
    /// Radiance that leaves the surface, by time, channel, pixel; empty where not asked for.
    pub surface: Vec<f32>,
    /// Sun-lit fraction by time, pixel.
    pub lit: Vec<f32>,
    /// Truth maps by map, pixel: material code, object, facet, x, y, z, range, view zenith, F. Where the middle of a
    /// pixel sees nothing, codes are 0 and the rest NaN.
    pub truth: Vec<f32>,
    /// Samples of each pixel.
    pub samples: Vec<f32>,
    /// Rays cast and skipped.
    pub rays: RayCounts,
}

impl TileResult {
    /// Number of truth maps.
    pub const TRUTH_MAPS: usize = 9;
}

/// A traced pixel within [`Paths`].
pub(crate) struct PixelPaths {
    /// Where it belongs in the output.
    pub index: usize,
    records: Range<usize>,
    pub samples: Range<usize>,
    vertices: Range<usize>,
    /// What they take of the cache.
    taken: Range<usize>,
    /// How many each replicate has.
    counts: [u32; REPLICATES],
    /// Image coordinates of its middle.
    middle: [f64; 2],
    /// Lines of sight of its clusters of samples; `None` leaves the scene.
    sights: Vec<Option<Path>>,
}

impl PixelPaths {
    /// What `trace` adds to the paths, of so many samples a replicate seen along a line through their middle, and what it tells.
    pub fn traced<T>(
        paths: &mut Paths,
        index: usize,
        counts: [u32; REPLICATES],
        middle: &Sight<'_>,
        trace: impl FnOnce(&mut Paths) -> T,
    ) -> (Self, T) {
        let ends = |paths: &Paths| [paths.records.len(), paths.samples.len(), paths.vertices.len(), paths.taken.len()];
        let starts = ends(paths);
        let told = trace(paths);
        let ends = ends(paths);
        let [records, samples, vertices, taken] = std::array::from_fn(|i| starts[i]..ends[i]);
        let sights = sightline::cluster(paths, samples.clone(), &middle.ray);
        (Self { index, records, samples, vertices, taken, counts, middle: middle.place, sights }, told)
    }
}

/// What a tile took, by the clock that it was rendered by.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Spent {
    /// What all times share \[s\]: paths, hits, truth maps, and the sorting of what each time lights.
    pub shared: f64,
    /// Lighting the paths, by time \[s\].
    pub light: Vec<f64>,
}

impl std::ops::AddAssign<&Self> for Spent {
    fn add_assign(&mut self, other: &Self) {
        self.shared += other.shared;
        self.light.resize(self.light.len().max(other.light.len()), 0.0);
        self.light.iter_mut().zip(&other.light).for_each(|(sum, light)| *sum += light);
    }
}

/// Tells what each time takes of a tile's seconds.
pub(crate) struct Watch<'a> {
    pub clock: &'a dyn Fn() -> f64,
    light: Vec<f64>,
}

impl Watch<'_> {
    /// One whose clock stands still.
    pub fn still(n_times: usize) -> Self {
        Self { clock: &|| 0.0, light: vec![0.0; n_times] }
    }

    /// Puts what has passed since the clock said `begun` down to a time.
    pub fn add(&mut self, t: usize, begun: f64) {
        self.light[t] += (self.clock)() - begun;
    }
}

/// Renders a tile at all times of its view.
pub fn render_tile(view: &View<'_>, tile: Tile) -> TileResult {
    render_tile_timed(view, tile, &|| 0.0).0
}

/// The same, with the seconds of a clock that it took. What it renders does not depend on the clock.
pub fn render_tile_timed(view: &View<'_>, tile: Tile, clock: &dyn Fn() -> f64) -> (TileResult, Spent) {
    render_tile_together(std::slice::from_ref(view), tile, clock).pop().expect("a result for each view")
}

/// Renders a tile of views that look along the same lines of sight and [trace the same paths](View::traces_as), each at all
/// its times: what each yields is what it yields alone. Rays of the paths and the seconds that all share are the first view's.
pub fn render_tile_together(views: &[View<'_>], tile: Tile, clock: &dyn Fn() -> f64) -> Vec<(TileResult, Spent)> {
    let Some(view) = views.first() else { return Vec::new() };
    let begun = clock();
    let n_pixels = (tile.width * tile.height) as usize;
    let of_view = |view: &View<'_>| {
        let (n_times, n_channels) = (view.times.len(), view.channels.len());
        let result = TileResult {
            radiance: vec![0.0; n_times * n_channels * n_pixels],
            error: vec![0.0; n_times * n_channels * n_pixels],
            surface: vec![0.0; if view.surface_radiance { n_times * n_channels * n_pixels } else { 0 }],
            lit: vec![0.0; n_times * n_pixels],
            truth: vec![0.0; TileResult::TRUTH_MAPS * n_pixels],
            samples: vec![0.0; n_pixels],
            rays: RayCounts::default(),
        };
        (result, Watch { clock, ..Watch::still(n_times) })
    };
    let mut out: Vec<(TileResult, Watch<'_>)> = views.iter().map(of_view).collect();
    let mut paths = Paths::new(view.nodes.len());
    let lattice = view.lattice();
    let mut target = Target { views, lattice: &lattice, n_pixels, out: &mut out };
    for by in (0..tile.height).step_by(BLOCK as usize) {
        for bx in (0..tile.width).step_by(BLOCK as usize) {
            let rows = by..(by + BLOCK).min(tile.height);
            let block: Vec<(u32, u32)> =
                rows.flat_map(|y| (bx..(bx + BLOCK).min(tile.width)).map(move |x| (x, y))).collect();
            let (x, y) = (tile.x + bx, tile.y + by);
            let (width, height) = (BLOCK.min(tile.width - bx), BLOCK.min(tile.height - by));
            view.begin(Tile { x, y, width, height }, &lattice, &mut paths);
            let even = target.tell((tile, &block), &mut paths);
            match view.accuracy {
                Accuracy::Samples(n) => {
                    let each = round_to_replicates(n) / REPLICATES as u32;
                    target.render(tile, &even, &mut paths, |_| [Draws::all(each); 2], None);
                }
                Accuracy::Error { .. } => {
                    debug_assert_eq!(views.len(), 1, "each view chooses its own number of samples");
                    let watch = &mut target.out[0].1;
                    if !even.rest.is_empty() {
                        let first = First::of_block(view, &lattice, tile, &even.rest, &mut paths, watch);
                        let draws = first.draws(view);
                        target.render(tile, &even, &mut paths, |i| draws[i], Some(&first));
                    }
                }
            }
        }
    }
    if let Some(((first, _), others)) = out.split_first_mut() {
        first.rays += paths.rays;
        for (other, _) in others {
            other.truth.clone_from(&first.truth);
            other.samples.clone_from(&first.samples);
        }
    }
    let light: f64 = out.iter().flat_map(|(_, watch)| &watch.light).sum();
    let mut shared = (clock() - begun - light).max(0.0);
    out.into_iter()
        .map(|(result, watch)| (result, Spent { shared: std::mem::take(&mut shared), light: watch.light }))
        .collect()
}

/// Where the pixels of a tile go.
struct Target<'a, 'w> {
    /// Views of the same paths.
    views: &'a [View<'a>],
    lattice: &'a Lattice<'a>,
    n_pixels: usize,
    /// By view.
    out: &'a mut [(TileResult, Watch<'w>)],
}

impl Target<'_, '_> {
    /// Writes what is known of a block without sampling.
    fn tell(&mut self, (tile, block): (Tile, &[(u32, u32)]), paths: &mut Paths) -> Even {
        let (views, lattice, clock) = (self.views, self.lattice, self.out[0].1.clock);
        let index = |(x, y): (u32, u32)| (y * tile.width + x) as usize;
        let mut spent = Vec::new();
        let even = Even::of_block(
            (views, lattice),
            (tile, block),
            paths,
            Parts::Whole,
            clock,
            |pixel, (v, t), radiance| self.write(v, t, index(block[pixel.index]), &radiance),
            |at, rays, begun| spent.push((at, rays, clock() - begun)),
        );
        for ((v, t), rays, seconds) in spent {
            self.out[v].0.rays += rays;
            self.out[v].1.light[t] += seconds;
        }
        for &((x, y), sky_view) in &even.told {
            self.out[0].0.samples[index((x, y))] = 1.0;
            let pixel = (tile.x + x, tile.y + y);
            truth_of_pixel(&self.views[0], pixel, index((x, y)), self.n_pixels, sky_view, paths, &mut self.out[0].0);
        }
        even
    }

    /// Traces samples of each pixel of the rest of a block, lights them at every time of every view, joins them with the first samples
    /// where there are some, and writes the pixels. `draws` tells all samples of a pixel, the first included.
    fn render(
        &mut self,
        tile: Tile,
        even: &Even,
        paths: &mut Paths,
        draws: impl Fn(usize) -> [Draws; 2],
        first: Option<&First>,
    ) {
        let mut pending = Vec::new();
        let (view, before) = (&self.views[0], u32::from(first.is_some()));
        for (i, Rest { place: (x, y), sole, .. }) in even.rest.iter().enumerate() {
            let index = (y * tile.width + x) as usize;
            let pixel = (tile.x + x, tile.y + y);
            let draws = draws(i);
            self.out[0].0.samples[index] = n_samples(&draws) as f32;
            let mut sky_view = first.map_or_else(Default::default, |first| first.sky_views[i]);
            if draws.iter().any(|half| half.samples > before) {
                let traced = trace_pixel(view, (pixel, sole.as_ref()), i, (draws, before), paths);
                sky_view = sky_view.and(SkyView::of(paths, &traced));
                pending.push(traced);
            } else if let Some(first) = first {
                for (t, of_time) in first.times.iter().enumerate().filter(|(t, _)| !even.is_done(i, (0, *t))) {
                    self.write(0, t, index, &of_time[i]);
                }
            }
            truth_of_pixel(view, pixel, index, self.n_pixels, sky_view.mean(), paths, &mut self.out[0].0);
            if paths.size() > PATHS_LIMIT {
                self.light(tile, even, &mut pending, paths, first);
            }
        }
        self.light(tile, even, &mut pending, paths, first);
    }

    /// Lights the pending pixels at every time, writes them out and drops their paths.
    fn light(
        &mut self,
        tile: Tile,
        even: &Even,
        pending: &mut Vec<PixelPaths>,
        paths: &mut Paths,
        first: Option<&First>,
    ) {
        if let Some(cache) = &mut paths.cache {
            let (clock, out) = (self.out[0].1.clock, &mut *self.out);
            cache.light(self.views, self.lattice, Parts::Whole, clock, |v, t, rays, begun| {
                out[v].1.add(t, begun);
                out[v].0.rays += rays;
            });
        }
        let lightable = Lightable::new(self.views, pending, self.lattice, paths, Parts::Whole, Proofs::Together);
        let mut last = LastSun::default();
        // Side by side, times of several views may have one sun.
        for t in 0..self.views.iter().map(|view| view.times.len()).max().unwrap_or(0) {
            for (v, view) in self.views.iter().enumerate() {
                let Some(time) = view.times.get(t) else { continue };
                let begun = (self.out[v].1.clock)();
                let rays = lightable.light(view, time, &mut last, Some((v, t)), |pixel, mut radiance| {
                    if even.is_done(pixel.index, (v, t)) {
                        return;
                    }
                    let (x, y) = even.rest[pixel.index].place;
                    if let Some(first) = first {
                        radiance.join(&first.times[t][pixel.index], &pixel.counts);
                    }
                    self.write(v, t, (y * tile.width + x) as usize, &radiance);
                });
                let (result, watch) = &mut self.out[v];
                watch.add(t, begun);
                result.rays += rays;
            }
        }
        pending.clear();
        paths.clear();
    }

    fn write(&mut self, v: usize, t: usize, index: usize, radiance: &PixelRadiance) {
        let n_channels = self.views[v].channels.len();
        let result = &mut self.out[v].0;
        for c in 0..n_channels {
            let at = (t * n_channels + c) * self.n_pixels + index;
            let e = radiance.estimate(c);
            result.radiance[at] = e.mean as f32;
            result.error[at] = e.standard_error as f32;
            if let Some(replicates) = radiance.surface.get(c) {
                result.surface[at] = estimate(replicates).mean as f32;
            }
        }
        result.lit[t * self.n_pixels + index] = radiance.lit_fraction() as f32;
    }
}

/// Samples of each replicate of a half: all tell what their lines of sight meet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Draws {
    pub samples: u32,
    /// About how many of these are traced on from there, for all.
    pub traced: u32,
    /// About how many of those look at sky and background by rays, for all that are traced.
    pub looks: u32,
}

impl Draws {
    /// So many samples that are all traced and all look.
    pub const fn all(samples: u32) -> Self {
        Self { samples, traced: samples, looks: samples }
    }

    /// No more samples than this.
    pub fn at_most(self, most: u32) -> Self {
        let Self { samples, traced, looks } = self;
        Self { samples: samples.min(most), traced: traced.min(most), looks: looks.min(most) }
    }

    /// The larger of each.
    pub fn max(self, other: Self) -> Self {
        let Self { samples, traced, looks } = self;
        let samples = samples.max(other.samples);
        Self { samples, traced: traced.max(other.traced), looks: looks.max(other.looks) }
    }
}

/// Samples of both halves of the replicates.
fn n_samples(draws: &[Draws; 2]) -> u32 {
    (REPLICATES / 2) as u32 * draws.iter().map(|half| half.samples).sum::<u32>()
}

/// Traces samples of a pixel, of each replicate those from one on.
pub(crate) fn trace_pixel(
    view: &View<'_>,
    (pixel, sole): ((u32, u32), Option<&Rc<SoleFacet>>),
    index: usize,
    (draws, from): ([Draws; 2], u32),
    paths: &mut Paths,
) -> PixelPaths {
    let of = |replicate: usize| draws[half_of(replicate as u8)];
    let counts = std::array::from_fn(|replicate| of(replicate).samples.saturating_sub(from));
    let middle = Sight::new(view.sight, [f64::from(pixel.0) + 0.5, f64::from(pixel.1) + 0.5]);
    let trace = |paths: &mut Paths| {
        for replicate in 0..REPLICATES as u8 {
            let first = view.numbers(pixel, replicate.into());
            let half = draws[half_of(replicate)];
            let seen = |i: u32, paths: &mut Paths| {
                let mut stream = first.at(i);
                let [u, v] = stream.next2();
                let sight = Sight::new(view.sight, [f64::from(pixel.0) + u, f64::from(pixel.1) + v]);
                let hit = paths.seen(&view.scenery.world, &sight.ray);
                Sighting { sight, stream, hit }
            };
            let trace = |own: Sighting<'_>, [weight, looks]: [f64; 2], paths: &mut Paths| {
                let Sighting { sight, mut stream, hit } = own;
                let id = paths.samples.len();
                paths.weight = weight;
                view.algorithm.trace(view.scenery, &sight, &Draw { replicate, hit, looks }, &mut stream, paths);
                paths.weight = 1.0;
                (paths.samples[id].weight, paths.samples[id].looks) = (weight, looks);
            };
            // The first sample is traced and looks in any case.
            let begin = if half.looks < half.samples { from.max(1) } else { half.samples };
            for i in from..begin.min(half.samples) {
                let own = seen(i, paths);
                trace(own, [1.0; 2], paths);
            }
            if begin < half.samples {
                let later: Vec<_> = (begin..half.samples).map(|i| seen(i, paths)).collect();
                // Numbers of its own.
                let mut stream = view.numbers(pixel, REPLICATES as u32 + u32::from(replicate));
                let facets: Vec<Side> = later.iter().map(Sighting::facet).collect();
                let weights_of = weights(&facets, half.traced.saturating_sub(1), &mut stream);
                let traced: Vec<_> = later.into_iter().zip(weights_of).filter(|(_, weight)| *weight > 0.0).collect();
                let facets: Vec<Side> = traced.iter().map(|(own, _)| own.facet()).collect();
                let looks = weights(&facets, half.looks.saturating_sub(1), &mut stream);
                for ((own, weight), looks) in traced.into_iter().zip(looks) {
                    trace(own, [weight, looks], paths);
                }
            }
        }
    };
    let of_block = sole.map(|own| paths.sole.replace(own.clone()));
    let (traced, ()) = PixelPaths::traced(paths, index, counts, &middle, trace);
    if let Some(of_block) = of_block {
        paths.sole = of_block;
    }
    traced
}

fn round_to_replicates(samples: u32) -> u32 {
    samples.max(1).next_multiple_of(REPLICATES as u32)
}

/// What a line of sight meets, before the path is traced on.
struct Sighting<'a> {
    sight: Sight<'a>,
    stream: Stream,
    hit: Option<Hit>,
}

/// A side of a facet, or the sky.
type Side = Option<(FacetId, bool)>;

impl Sighting<'_> {
    fn facet(&self) -> Side {
        self.hit.map(|hit| (hit.facet, hit.front))
    }
}

/// For how many each of a replicate's samples stands where about so many of them stand for all: the same share of those on each
/// facet and at least one, any with the same chance, so that the mean is that of all \[Neyman1938\]; 0 for the rest.
fn weights(facets: &[Side], wanted: u32, stream: &mut Stream) -> Vec<f64> {
    let share = f64::from(wanted) / facets.len() as f64;
    let mut counts: SmallVec<[(Side, usize); 4]> = SmallVec::new();
    for facet in facets {
        match counts.iter_mut().find(|(of, _)| of == facet) {
            Some((_, n)) => *n += 1,
            None => counts.push((*facet, 1)),
        }
    }
    let mut weights = vec![0.0; facets.len()];
    for (of, n) in counts {
        let own = weights.iter_mut().zip(facets).filter(|(_, facet)| **facet == of).map(|(weight, _)| weight);
        let chosen = ((share * n as f64).round() as usize).clamp(1, n);
        // Evenly spread along a circle, from anywhere.
        let begin = stream.next1() * n as f64;
        for (i, weight) in own.enumerate() {
            let place = (i as f64 + begin) * chosen as f64 / n as f64;
            let is_chosen = place.floor() != ((i as f64 + 1.0 + begin) * chosen as f64 / n as f64).floor();
            *weight = if is_chosen { n as f64 / chosen as f64 } else { 0.0 };
        }
    }
    weights
}
/// F over the samples of a pixel that looked for it: its sum, and for how many they stand.
#[derive(Clone, Copy, Default)]
pub(crate) struct SkyView(f64, f64);

impl SkyView {
    pub fn of(paths: &Paths, pixel: &PixelPaths) -> Self {
        let told = paths.samples[pixel.samples.clone()].iter().filter(|sample| !sample.sky_view.is_nan());
        told.fold(Self::default(), |Self(sum, n), sample| {
            let weight = sample.weight * sample.looks;
            Self(sum + weight * sample.sky_view, n + weight)
        })
    }

    fn and(self, other: Self) -> Self {
        Self(self.0 + other.0, self.1 + other.1)
    }

    pub fn mean(self) -> f64 {
        self.0 / self.1
    }
}

/// What is proved of the sun at the points of pixels that are lit together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Proofs {
    /// Of all pixels' points on a facet.
    Together,
    /// Of each pixel's by themselves.
    Apart,
    /// The same, and a pixel of which nothing is proved is not lit; its one sample speaks for all replicates.
    Alone,
}

/// Traced pixels with all that their times and views share.
pub(crate) struct Lightable<'a> {
    block: Block<'a>,
    pixels: Vec<(&'a PixelPaths, PixelLight, Vec<Option<Shares>>)>,
    /// What they take of the cache.
    cached: Vec<PointShares>,
    parts: Parts,
}

impl<'a> Lightable<'a> {
    /// For all times of views of the same paths, with parts of the radiance kept apart.
    pub fn new(
        views: &[View<'a>],
        pixels: &'a [PixelPaths],
        lattice: &'a Lattice<'a>,
        paths: &'a Paths,
        parts: Parts,
        proofs: Proofs,
    ) -> Self {
        let view = &views[0];
        let n_times = views.iter().map(|view| view.times.len()).sum();
        let vertices = pixels.iter().map(|pixel| pixel.vertices.clone()).collect();
        let block = Block::new(view.scenery, paths, vertices, (view.channels, view.nodes), lattice, n_times, proofs);
        let shares = |pixel: &PixelPaths| {
            let of_path = |path: &Path| lattice.shares(pixel.middle, path.length);
            pixel.sights.iter().map(|sight| sight.as_ref().map(of_path)).collect()
        };
        let pixels: Vec<_> = (pixels.iter())
            .map(|pixel| (pixel, PixelLight::new(&block, pixel.records.clone(), parts), shares(pixel)))
            .collect();
        let mut cached = match paths.taken.is_empty() {
            true => Vec::new(),
            false => pixels.iter().map(|(pixel, ..)| shares_of(paths, &paths.taken[pixel.taken.clone()])).collect(),
        };
        if proofs == Proofs::Alone {
            let shares = cached.iter_mut().flatten().map(|(_, shares): &mut (u32, [f64; REPLICATES])| shares);
            shares.for_each(|shares| *shares = [shares[0]; REPLICATES]);
        }
        Self { block, pixels, cached, parts }
    }

    /// Lights the pixels at one time of a view and hands each to `each`; `at` is the place of view and time in the cache.
    pub fn light(
        &self,
        view: &View<'_>,
        time: &Lights,
        last: &mut LastSun,
        at: Option<(usize, usize)>,
        mut each: impl FnMut(&PixelPaths, PixelRadiance),
    ) -> RayCounts {
        let mut light = BlockLight::new(&self.block, view.algorithm.lighting(), time, last);
        let cache = self.block.paths.cache.as_ref().zip(at);
        // Only who chooses numbers of samples asks.
        let noise = matches!(view.accuracy, Accuracy::Error { .. });
        let alone = self.block.proofs == Proofs::Alone;
        for (i, (pixel, records, sights)) in self.pixels.iter().enumerate() {
            if alone && !light.is_proved(pixel.vertices.start) {
                continue;
            }
            let samples = pixel.samples.clone();
            let counts = &pixel.counts;
            let mut radiance = light.pixel(records, samples, counts, sights, view.surface_radiance, self.parts);
            if alone {
                radiance.spread();
            }
            if let (Some((cache, at)), Some(shares)) = (&cache, self.cached.get(i).filter(|own| !own.is_empty())) {
                cache.add(*at, shares, counts, noise, &mut radiance);
            }
            each(pixel, radiance);
        }
        light.rays()
    }
}

/// Truth maps of one pixel: codes and geometry at its middle, F as the mean over its samples.
fn truth_of_pixel(
    view: &View<'_>,
    pixel: (u32, u32),
    index: usize,
    n_pixels: usize,
    sky_view: f64,
    paths: &mut Paths,
    result: &mut TileResult,
) {
    let sight = (view.sight)(f64::from(pixel.0) + 0.5, f64::from(pixel.1) + 0.5);
    let maps: [f64; TileResult::TRUTH_MAPS] = match paths.seen(&view.scenery.world, &sight) {
        Some(hit) => [
            f64::from(view.scenery.surface(hit.material).code),
            f64::from(hit.instance),
            f64::from(hit.facet.0),
            hit.point.x,
            hit.point.y,
            hit.point.z,
            hit.t,
            (-sight.direction).zenith().to_degrees(),
            sky_view,
        ],
        None => [0.0, 0.0, 0.0, f64::NAN, f64::NAN, f64::NAN, f64::NAN, f64::NAN, f64::NAN],
    };
    for (map, value) in maps.iter().enumerate() {
        result.truth[map * n_pixels + index] = *value as f32;
    }
}

/// Every term of one pixel at one time, for `explain`.
#[derive(Clone, Debug)]
pub struct PixelTerms {
    /// Radiance per channel.
    pub radiance: Vec<Estimate>,
    /// Radiance that leaves the surface, before τ₂ and L_u, per channel.
    pub surface: Vec<Estimate>,
    /// Parts of the radiance at the sensor, per channel.
    pub terms: Vec<(Term, Vec<f64>)>,
    /// L_u per channel.
    pub upwelled: Vec<f64>,
    /// Mean F of the target.
    pub sky_view: f64,
    /// Sun-lit fraction.
    pub lit: f64,
    /// Lines of sight to the sensor, with the share of samples that took each.
    pub sights: Vec<(Option<Path>, f64)>,
    /// Samples taken.
    pub samples: u32,
}

/// A block of an image of `pixels`, by its column and row among the blocks.
pub(crate) fn block_at(pixels: (u32, u32), (column, row): (u32, u32)) -> Tile {
    let (x, y) = (column * BLOCK, row * BLOCK);
    Tile { x, y, width: BLOCK.min(pixels.0 - x), height: BLOCK.min(pixels.1 - y) }
}

/// Places of the pixels of a tile within it, row by row.
pub(crate) fn pixels_of(tile: Tile) -> Vec<(u32, u32)> {
    (0..tile.height).flat_map(|y| (0..tile.width).map(move |x| (x, y))).collect()
}

/// Renders one pixel at one time (an index into the view's times) and keeps its terms apart. The samples are those of
/// the image.
pub fn render_pixel_terms(view: &View<'_>, pixel: (u32, u32), time: usize) -> PixelTerms {
    let tile = block_at(view.pixels, (pixel.0 / BLOCK, pixel.1 / BLOCK));
    let block = pixels_of(tile);
    let at = ((pixel.1 - tile.y) * tile.width + pixel.0 - tile.x) as usize;
    let mut paths = Paths::new(view.nodes.len());
    let lattice = view.lattice();
    view.begin(tile, &lattice, &mut paths);
    let terms = |pixel: &PixelPaths,
                 lit: PixelRadiance,
                 (samples, sky_view): (u32, f64),
                 share: &dyn Fn(usize) -> f64| PixelTerms {
        radiance: (0..lit.radiance.len()).map(|c| lit.estimate(c)).collect(),
        surface: lit.surface.iter().map(|replicates| estimate(replicates)).collect(),
        lit: lit.lit_fraction(),
        samples,
        terms: lit.terms,
        upwelled: lit.upwelled,
        sky_view,
        sights: pixel.sights.iter().enumerate().map(|(q, sight)| (*sight, share(q))).collect(),
    };
    let alone = View { surface_radiance: true, times: std::slice::from_ref(&view.times[time]), ..*view };
    let (one, still) = (std::slice::from_ref(&alone), || 0.0);
    let mut out = None;
    let each = |pixel: &PixelPaths, _: (usize, usize), lit: PixelRadiance| {
        if pixel.index == at {
            out = Some(terms(pixel, lit, (1, f64::NAN), &|_| 1.0));
        }
    };
    let even = Even::of_block((one, &lattice), (tile, &block), &mut paths, Parts::Terms, &still, each, |_, _, _| {});
    if let Some(mut out) = out {
        let told = even.told.iter().find(|(place, _)| *place == block[at]);
        out.sky_view = told.map_or(f64::NAN, |(_, sky_view)| *sky_view);
        return out;
    }
    let is_own = |own: &Rest| own.place == block[at];
    let sole = even.rest.iter().find(|own| is_own(own)).and_then(|own| own.sole.as_ref());
    // What others took of the cache was not told by term.
    paths.cache = None;
    view.begin(tile, &lattice, &mut paths);
    let draws = match view.accuracy {
        Accuracy::Samples(n) => [Draws::all(round_to_replicates(n) / REPLICATES as u32); 2],
        Accuracy::Error { .. } => {
            let mut watch = Watch::still(view.times.len());
            let still = || 0.0;
            let whole = std::slice::from_ref(view);
            let even = Even::of_block(
                (whole, &lattice),
                (tile, &block),
                &mut paths,
                Parts::Whole,
                &still,
                |_, _, _| {},
                |_, _, _| {},
            );
            let rest = even.rest.iter().position(is_own).expect("a pixel that is not told is left");
            First::of_block(view, &lattice, tile, &even.rest, &mut paths, &mut watch).draws(view)[rest]
        }
    };
    paths.cache = None;
    view.begin(tile, &lattice, &mut paths);
    let traced = [trace_pixel(&alone, (pixel, sole), 0, (draws, 0), &mut paths)];
    if let Some(cache) = &mut paths.cache {
        cache.light(one, &lattice, Parts::Terms, &still, |_, _, _, _| {});
    }
    let samples = &paths.samples[traced[0].samples.clone()];
    let weight = |q: Option<usize>| -> f64 {
        let own = samples.iter().filter(|sample| q.is_none_or(|q| usize::from(sample.cluster) == q));
        own.map(|sample| sample.weight).sum()
    };
    let share = |q: usize| weight(Some(q)) / weight(None);
    let sky_view = SkyView::of(&paths, &traced[0]).mean();
    let lightable = Lightable::new(one, &traced, &lattice, &paths, Parts::Terms, Proofs::Together);
    let mut out = None;
    lightable.light(&alone, &alone.times[0], &mut LastSun::default(), Some((0, 0)), |pixel, lit| {
        out = Some(terms(pixel, lit, (n_samples(&draws), sky_view), &share));
    });
    out.expect("a pixel that was traced is lit")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// On each facet those that are chosen stand for as many samples as there are, and each sample, over many choices, for 1.
    #[test]
    fn chosen_samples_stand_for_all_of_their_facet() {
        let facet = |id: u32| Some((FacetId(id), true));
        let facets = [1, 2, 1, 0, 1, 1, 2, 1, 1, 1, 1].map(|id| if id > 0 { facet(id) } else { None });
        let choices = 8000;
        for wanted in [0, 3, 6, 10, 11] {
            let mut sums = [0.0; 11];
            for choice in 0..choices {
                let weights = weights(&facets, wanted, &mut Stream::new(1, 2, choice, 0, 0));
                for facet in [facet(1), facet(2), None] {
                    let own = || (0..11).filter(|i| facets[*i] == facet).map(|i| weights[i]);
                    assert!((own().sum::<f64>() - own().count() as f64).abs() < 1e-12, "{wanted} {facet:?}");
                }
                assert!(wanted < 11 || weights.iter().all(|weight| *weight == 1.0));
                sums.iter_mut().zip(&weights).for_each(|(sum, weight)| *sum += weight);
            }
            for (i, sum) in sums.iter().enumerate() {
                // A weight of at most 8 with the chance of one over it scatters by no more than √7.
                let (mean, error) = (sum / f64::from(choices as u32), (7.0 / f64::from(choices as u32)).sqrt());
                assert!((mean - 1.0).abs() < 4.5 * error, "{wanted} {i}: {mean}");
            }
        }
    }
}
