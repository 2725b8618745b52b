//! Tiles: all pixels of a tile, at all times of its view.

use std::ops::Range;

use sunglint_atmosphere::Path;
use sunglint_geometry::Ray;
use sunglint_radiometry::{Channels, Estimate, REPLICATES, estimate};

use crate::light::{Block, BlockLight, PixelLight, PixelRadiance, Term};
use crate::paths::{Paths, RayCounts};
use crate::sightline::{self, Lattice, Shares};
use crate::{Algorithm, Lights, Nodes, Scenery, Stream};

/// Pixels along a side of a tile: the unit of resuming and of sharing work.
const TILE: u32 = 32;
/// Pixels along a side of a block: the unit in which paths are kept and sun rays proved unnecessary.
const BLOCK: u32 = 8;
/// Bytes of the paths of one block after which they are lit and dropped.
const PATHS_LIMIT: usize = 1 << 25;

/// How accurate a render is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Accuracy {
    /// Samples a pixel, rounded up to a multiple of the replicates.
    Samples(u32),
    /// Relative standard error against the larger of the pixel and a floor. A pilot of 16 samples chooses the number
    /// and is discarded.
    Error {
        /// Relative standard error.
        relative: f64,
        /// Floor \[W m⁻² sr⁻¹ µm⁻¹\]; a hundredth of the block's mean where `None`.
        floor: Option<f64>,
        /// Most samples a pixel.
        most: u32,
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
    /// The scene's seed.
    pub seed: u64,
    /// Tells views of one seed apart; the same for every experiment, so that experiments see the same samples.
    pub id: u64,
    /// Whether the radiance that leaves the surface is wanted.
    pub surface_radiance: bool,
}

impl View<'_> {
    /// Where its lines of sight are solved.
    fn lattice(&self) -> Lattice<'_> {
        let world = &self.scenery.world;
        let facets = world.bounds().map(|(low, _)| low.z);
        let floor = facets.into_iter().chain(world.ground().map(|ground| ground.height)).fold(f64::INFINITY, f64::min);
        Lattice::new(self.sight, self.pixels, if floor.is_finite() { floor } else { f64::NEG_INFINITY })
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

/// The tiles of an image of `pixels` that cover a window of it, row by row: those of the whole image, cut down to whole
/// blocks, so that every pixel is what it is in the whole image.
pub fn tiles(pixels: (u32, u32), window: Tile) -> Vec<Tile> {
    // Cuts of one axis: from the block that holds the first pixel to the end of the one that holds the last.
    let cuts = |first: u32, count: u32, n: u32| -> Vec<(u32, u32)> {
        let end = (first + count).next_multiple_of(BLOCK).min(n);
        let mut cuts = Vec::new();
        let mut start = first - first % BLOCK;
        while start < end {
            let stop = (start - start % TILE + TILE).min(end);
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
struct PixelPaths {
    /// Where it belongs in the output.
    index: usize,
    records: Range<usize>,
    samples: Range<usize>,
    /// Image coordinates of its middle.
    middle: [f64; 2],
    /// Lines of sight of its clusters of samples; `None` leaves the scene.
    sights: Vec<Option<Path>>,
}

/// Renders a tile at all times of its view.
pub fn render_tile(view: &View<'_>, tile: Tile) -> TileResult {
    let n_pixels = (tile.width * tile.height) as usize;
    let (n_times, n_channels) = (view.times.len(), view.channels.len());
    let mut result = TileResult {
        radiance: vec![0.0; n_times * n_channels * n_pixels],
        error: vec![0.0; n_times * n_channels * n_pixels],
        surface: vec![0.0; if view.surface_radiance { n_times * n_channels * n_pixels } else { 0 }],
        lit: vec![0.0; n_times * n_pixels],
        truth: vec![0.0; TileResult::TRUTH_MAPS * n_pixels],
        samples: vec![0.0; n_pixels],
        rays: RayCounts::default(),
    };
    let mut paths = Paths::new(view.nodes.len());
    for by in (0..tile.height).step_by(BLOCK as usize) {
        for bx in (0..tile.width).step_by(BLOCK as usize) {
            let rows = by..(by + BLOCK).min(tile.height);
            let block: Vec<(u32, u32)> =
                rows.flat_map(|y| (bx..(bx + BLOCK).min(tile.width)).map(move |x| (x, y))).collect();
            let counts = samples_of_block(view, tile, &block, &mut result.rays);
            let mut pending = Vec::new();
            for (&(x, y), count) in block.iter().zip(counts) {
                let index = (y * tile.width + x) as usize;
                let pixel = (tile.x + x, tile.y + y);
                result.samples[index] = count as f32;
                pending.push(trace_pixel(view, pixel, index, count, 0, &mut paths));
                truth_of_pixel(view, pixel, index, n_pixels, &pending[pending.len() - 1], &paths, &mut result);
                if paths.size() > PATHS_LIMIT {
                    light_block(view, &mut pending, &mut paths, n_pixels, &mut result);
                }
            }
            light_block(view, &mut pending, &mut paths, n_pixels, &mut result);
        }
    }
    result.rays += paths.rays;
    result
}

/// Traces all samples of a pixel; `stage` tells pilot and main samples apart.
fn trace_pixel(
    view: &View<'_>,
    pixel: (u32, u32),
    index: usize,
    count: u32,
    stage: u64,
    paths: &mut Paths,
) -> PixelPaths {
    let (records, samples) = (paths.records.len(), paths.samples.len());
    let key = u64::from(pixel.1) * u64::from(view.pixels.0) + u64::from(pixel.0) + (stage << 48);
    for replicate in 0..REPLICATES as u32 {
        for i in 0..count / REPLICATES as u32 {
            let mut stream = Stream::new(view.seed, view.id, key, replicate, i);
            let [u, v] = stream.next2();
            let sight = (view.sight)(f64::from(pixel.0) + u, f64::from(pixel.1) + v);
            view.algorithm.trace(view.scenery, &sight, replicate as u8, &mut stream, paths);
        }
    }
    let (records, samples) = (records..paths.records.len(), samples..paths.samples.len());
    let middle = [f64::from(pixel.0) + 0.5, f64::from(pixel.1) + 0.5];
    let sights = sightline::cluster(paths, samples.clone(), &(view.sight)(middle[0], middle[1]));
    PixelPaths { index, records, samples, middle, sights }
}

fn round_to_replicates(samples: u32) -> u32 {
    samples.max(1).next_multiple_of(REPLICATES as u32)
}

/// How many samples each pixel of a block takes.
fn samples_of_block(view: &View<'_>, tile: Tile, block: &[(u32, u32)], rays: &mut RayCounts) -> Vec<u32> {
    let (relative, floor, most) = match view.accuracy {
        Accuracy::Samples(n) => return vec![round_to_replicates(n); block.len()],
        Accuracy::Error { relative, floor, most } => (relative, floor, most),
    };
    const PILOT: u32 = REPLICATES as u32;
    let mut paths = Paths::new(view.nodes.len());
    let mut pilots = Vec::new();
    let mut materials = Vec::new();
    for (i, (x, y)) in block.iter().enumerate() {
        pilots.push(trace_pixel(view, (tile.x + x, tile.y + y), i, PILOT, 1, &mut paths));
        let first = paths.samples[pilots[i].samples.start].vertex;
        materials.push(first.map(|vertex| paths.vertices[vertex as usize].hit.material));
    }
    // Standard error and mean of every pixel, time and channel.
    let mut estimates: Vec<Vec<Estimate>> = vec![Vec::new(); block.len()];
    let lattice = view.lattice();
    let lightable = Lightable::new(view, &pilots, &lattice, &paths, false);
    for time in view.times {
        *rays += lightable.light(time, |pixel, lit, _| {
            estimates[pixel.index].extend(lit.radiance.iter().map(|replicates| estimate(replicates)));
        });
    }
    *rays += paths.rays;
    let slots = estimates.first().map_or(0, Vec::len);
    let mut counts = vec![PILOT; block.len()];
    for slot in 0..slots {
        let mean = estimates.iter().map(|e| e[slot].mean).sum::<f64>() / block.len() as f64;
        let floor = floor.unwrap_or(0.01 * mean);
        for i in 0..block.len() {
            // Sixteen samples know their own variance badly: it is floored by that of pixels of the same material.
            let alike = (0..block.len()).filter(|j| materials[*j] == materials[i]);
            let (sum, n) = alike.fold((0.0, 0.0), |(s, n), j| (s + estimates[j][slot].standard_error.powi(2), n + 1.0));
            let variance = estimates[i][slot].standard_error.powi(2).max(sum / f64::max(n, 1.0));
            let wanted = relative * estimates[i][slot].mean.max(floor);
            if variance > 0.0 && wanted > 0.0 {
                let needed = f64::from(PILOT) * variance / (wanted * wanted);
                counts[i] = counts[i].max(round_to_replicates(needed.min(f64::from(most)).ceil() as u32));
            }
        }
    }
    counts
}

/// Traced pixels with all that their times share.
struct Lightable<'a> {
    block: Block<'a>,
    pixels: Vec<(&'a PixelPaths, PixelLight, Vec<Option<Shares>>)>,
    surface: bool,
    by_term: bool,
}

impl<'a> Lightable<'a> {
    fn new(
        view: &View<'a>,
        pixels: &'a [PixelPaths],
        lattice: &'a Lattice<'a>,
        paths: &'a Paths,
        by_term: bool,
    ) -> Self {
        let lighting = view.algorithm.lighting();
        let block = Block::new(view.scenery, paths, (view.channels, view.nodes), lighting, lattice);
        let shares = |pixel: &PixelPaths| {
            let of_path = |path: &Path| lattice.shares(pixel.middle, path.length);
            pixel.sights.iter().map(|sight| sight.as_ref().map(of_path)).collect()
        };
        let pixels = (pixels.iter())
            .map(|pixel| (pixel, PixelLight::new(&block, pixel.records.clone(), by_term), shares(pixel)))
            .collect();
        Self { block, pixels, surface: view.surface_radiance, by_term }
    }

    /// Lights the pixels at one time and hands each to `each`, with its sun-lit fraction.
    fn light(&self, time: &Lights, mut each: impl FnMut(&PixelPaths, PixelRadiance, f64)) -> RayCounts {
        let mut light = BlockLight::new(&self.block, time);
        for (pixel, records, sights) in &self.pixels {
            let samples = pixel.samples.clone();
            let lit = light.lit_fraction(samples.clone());
            each(pixel, light.pixel(records, samples, sights, self.surface, self.by_term), lit);
        }
        light.rays()
    }
}

/// Lights the pending pixels at every time, writes them out and drops their paths.
fn light_block(
    view: &View<'_>,
    pending: &mut Vec<PixelPaths>,
    paths: &mut Paths,
    n_pixels: usize,
    result: &mut TileResult,
) {
    let n_channels = view.channels.len();
    let lattice = view.lattice();
    let lightable = Lightable::new(view, pending, &lattice, paths, false);
    for (t, time) in view.times.iter().enumerate() {
        let rays = lightable.light(time, |pixel, radiance, lit| {
            for c in 0..n_channels {
                let at = (t * n_channels + c) * n_pixels + pixel.index;
                let e = estimate(&radiance.radiance[c]);
                result.radiance[at] = e.mean as f32;
                result.error[at] = e.standard_error as f32;
                if let Some(replicates) = radiance.surface.get(c) {
                    result.surface[at] = estimate(replicates).mean as f32;
                }
            }
            result.lit[t * n_pixels + pixel.index] = lit as f32;
        });
        result.rays += rays;
    }
    pending.clear();
    paths.clear();
}

/// Truth maps of one pixel: codes and geometry at its middle, F as the mean over its samples.
fn truth_of_pixel(
    view: &View<'_>,
    pixel: (u32, u32),
    index: usize,
    n_pixels: usize,
    traced: &PixelPaths,
    paths: &Paths,
    result: &mut TileResult,
) {
    let sight = (view.sight)(f64::from(pixel.0) + 0.5, f64::from(pixel.1) + 0.5);
    result.rays.camera += 1;
    let samples = &paths.samples[traced.samples.clone()];
    let f = samples.iter().map(|sample| sample.sky_view).sum::<f64>() / samples.len() as f64;
    let maps: [f64; TileResult::TRUTH_MAPS] = match view.scenery.world.closest(&sight) {
        Some(hit) => [
            f64::from(view.scenery.surface(hit.material).code),
            f64::from(hit.instance),
            f64::from(hit.facet.0),
            hit.point.x,
            hit.point.y,
            hit.point.z,
            hit.t,
            (-sight.direction).zenith().to_degrees(),
            f,
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

/// Renders one pixel at one time (an index into the view's times) and keeps its terms apart. The samples are those of
/// the image.
pub fn render_pixel_terms(view: &View<'_>, pixel: (u32, u32), time: usize) -> PixelTerms {
    let corner = |c: u32| c - c % BLOCK;
    let (x, y) = (corner(pixel.0), corner(pixel.1));
    let size = |n: u32, start: u32| BLOCK.min(n - start);
    let tile = Tile { x, y, width: size(view.pixels.0, x), height: size(view.pixels.1, y) };
    let block: Vec<(u32, u32)> = (0..tile.height).flat_map(|y| (0..tile.width).map(move |x| (x, y))).collect();
    let counts = samples_of_block(view, tile, &block, &mut RayCounts::default());
    let at = ((pixel.1 - y) * tile.width + pixel.0 - x) as usize;
    let mut paths = Paths::new(view.nodes.len());
    let traced = [trace_pixel(view, pixel, 0, counts[at], 0, &mut paths)];
    let samples = &paths.samples[traced[0].samples.clone()];
    let n = samples.len() as f64;
    let share = |q: usize| samples.iter().filter(|sample| usize::from(sample.cluster) == q).count() as f64 / n;
    let mut out = PixelTerms {
        radiance: Vec::new(),
        surface: Vec::new(),
        terms: Vec::new(),
        upwelled: Vec::new(),
        sky_view: samples.iter().map(|sample| sample.sky_view).sum::<f64>() / n,
        lit: 0.0,
        sights: (traced[0].sights.iter().enumerate())
            .map(|(q, sight)| (*sight, share(q)))
            .collect(),
        samples: counts[at],
    };
    let view = View { surface_radiance: true, ..*view };
    let lattice = view.lattice();
    Lightable::new(&view, &traced, &lattice, &paths, true).light(&view.times[time], |_, lit, fraction| {
        out.radiance = lit.radiance.iter().map(|replicates| estimate(replicates)).collect();
        out.surface = lit.surface.iter().map(|replicates| estimate(replicates)).collect();
        out.terms = lit.terms;
        out.upwelled = lit.upwelled;
        out.lit = fraction;
    });
    out
}
