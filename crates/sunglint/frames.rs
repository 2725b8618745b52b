//! Frames as arrays, and the text digest that snapshots keep.

use std::fmt;
use std::ops::Range;

use rayon::prelude::*;
use sunglint_geometry::Ray;
use sunglint_radiometry::Channel;
use sunglint_tracer::{Accuracy, Lights, RayCounts, Tile, TileResult, View, tiles};

use crate::lit::{BandLight, Lit};
use crate::plan::Run;

/// Columns and rows of the coarse map of a digest.
const COARSE: (usize, usize) = (8, 6);

/// One frame: all channels of one time, row-major from the top left.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Name of the frame: `1992-06-18T160000Z`.
    pub label: String,
    /// Radiance by channel and pixel \[W m⁻² sr⁻¹ µm⁻¹\].
    pub radiance: Vec<Vec<f32>>,
    /// Its standard error.
    pub error: Vec<Vec<f32>>,
    /// Radiance that leaves the surface, before τ₂ and L_u; empty where not asked for.
    pub surface: Vec<Vec<f32>>,
    /// π times that radiance over the irradiance of the open level ground, ratio of band means; NaN where the middle of a
    /// pixel sees nothing, and everywhere without light. Empty where not asked for.
    pub reflectance_factor: Vec<Vec<f32>>,
    /// Digital numbers; empty where not asked for.
    pub counts: Vec<Vec<f32>>,
    /// Sun-lit fraction by pixel.
    pub lit: Vec<f32>,
}

/// All frames of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Frames {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Channels, in order.
    pub channels: Vec<Channel>,
    /// Frames in order of time.
    pub frames: Vec<Frame>,
    /// Truth maps: material code, object, facet, x, y, z, range, view zenith \[deg\], F.
    pub truth: Vec<Vec<f32>>,
    /// Samples of each pixel, the mean over all times.
    pub samples: Vec<f32>,
    /// Rays cast and skipped.
    pub rays: RayCounts,
}

impl Run {
    /// Renders all frames to arrays, on all threads of the current pool. The same run gives the same bits on any
    /// number of threads.
    pub fn render(&self) -> Frames {
        let tiles = self.tiles();
        let mut frames = Frames::new(self);
        // Chosen once for all parts.
        let mut timed: Option<Accuracy> = None;
        for lit in self.lit_parts() {
            let within = |seconds: f64| Accuracy::Samples(lit.samples_of_run(seconds));
            timed = timed.or_else(|| self.budget.map(within));
            let accuracy = timed.unwrap_or(self.accuracy);
            let results: Vec<TileResult> = tiles.par_iter().map(|tile| lit.render_tile_as(*tile, accuracy)).collect();
            frames.insert(&lit, tiles.iter().zip(&results));
        }
        frames
    }

    /// The tiles that cover the window.
    pub fn tiles(&self) -> Vec<Tile> {
        tiles(self.camera.pixels(), self.window)
    }

    /// Whether less than the whole view is rendered.
    pub fn is_crop(&self) -> bool {
        self.pixels != self.camera.pixels()
    }

    /// The line of sight at image coordinates.
    pub(crate) fn sight(&self) -> impl Fn(f64, f64) -> Ray + Sync + '_ {
        |x, y| {
            let ray = self.camera.ray(x, y);
            Ray::new(ray.origin, ray.direction)
        }
    }

    /// The run as the tracer sees it, under the light of some times.
    pub(crate) fn view<'a>(&'a self, sight: &'a (dyn Fn(f64, f64) -> Ray + Sync), times: &'a [Lights]) -> View<'a> {
        View {
            scenery: &self.scenery,
            algorithm: self.algorithm.as_ref(),
            sight,
            pixels: self.camera.pixels(),
            channels: &self.traced,
            nodes: &self.nodes,
            times,
            accuracy: self.accuracy,
            worth: None,
            seed: self.seed,
            id: self.view_id,
            surface_radiance: self.products.surface_radiance || self.products.reflectance_factor,
        }
    }
}

impl Frame {
    /// The frame of the run's time `t`, all zero.
    pub(crate) fn blank(run: &Run, t: usize) -> Self {
        let n = run.pixels.0 as usize * run.pixels.1 as usize;
        let images = |wanted: bool| vec![vec![0.0; n]; if wanted { run.channels.len() } else { 0 }];
        Self {
            label: run.moments[t].label.clone(),
            radiance: images(true),
            error: images(true),
            surface: images(run.products.surface_radiance),
            reflectance_factor: images(run.products.reflectance_factor),
            counts: images(run.readout.is_some()),
            lit: vec![0.0; n],
        }
    }
}

impl Frames {
    /// Empty frames of a run.
    pub(crate) fn new(run: &Run) -> Self {
        let n = run.pixels.0 as usize * run.pixels.1 as usize;
        let channels = run.channels.channels().to_vec();
        let frames = (0..run.moments.len()).map(|t| Frame::blank(run, t)).collect();
        Self {
            width: run.pixels.0,
            height: run.pixels.1,
            channels,
            frames,
            truth: vec![vec![0.0; n]; TileResult::TRUTH_MAPS],
            samples: vec![0.0; n],
            rays: RayCounts::default(),
        }
    }

    /// Puts the finished tiles of some times in their places.
    pub(crate) fn insert<'t>(&mut self, lit: &Lit<'_>, tiles: impl Iterator<Item = (&'t Tile, &'t TileResult)>) {
        let (run, bands) = (lit.run, lit.bands());
        for (tile, result) in tiles {
            for (i, t) in lit.times.clone().enumerate() {
                insert_frame(run, &mut self.frames[t], i, &bands[i], *tile, result);
            }
            insert_maps(run, (&mut self.truth, &mut self.samples), &lit.times, *tile, result);
            self.rays += result.rays;
        }
    }

    /// A stable text for snapshots: per frame and channel the statistics to four significant digits, and a coarse map
    /// of means to three.
    pub fn digest(&self) -> String {
        Digest(self).to_string()
    }
}

/// Copies the `i`th time of a tile into a frame, whose light this was.
pub(crate) fn insert_frame(run: &Run, frame: &mut Frame, i: usize, light: &BandLight, tile: Tile, result: &TileResult) {
    let (window, n_channels, n_traced) = (run.window, run.channels.len(), run.traced.len());
    let n = (tile.width * tile.height) as usize;
    let layer = |stack: &[f32], layer: usize| stack[layer * n..(layer + 1) * n].to_vec();
    let key = crate::Readout::frame_key(&frame.label);
    for c in 0..n_channels {
        let at = i * n_traced + c;
        copy_tile(tile, &result.radiance, at, &mut frame.radiance[c], window);
        copy_tile(tile, &result.error, at, &mut frame.error[c], window);
        if let Some(surface) = frame.surface.get_mut(c) {
            copy_tile(tile, &result.surface, at, surface, window);
        }
        if let Some(factor) = frame.reflectance_factor.get_mut(c) {
            let level = light.level[c];
            let mut values = layer(&result.surface, at);
            for (value, code) in values.iter_mut().zip(&result.truth) {
                let lit = *code != 0.0 && level > 0.0;
                let ratio = std::f64::consts::PI * f64::from(*value) / level;
                *value = if lit { ratio as f32 } else { f32::NAN };
            }
            copy_tile(tile, &values, 0, factor, window);
        }
        if let (Some(counts), Some(readout)) = (frame.counts.get_mut(c), &run.readout) {
            let mut values = layer(&result.radiance, at + n_channels);
            for (p, value) in values.iter_mut().enumerate() {
                let pixel = (tile.x + p as u32 % tile.width, tile.y + p as u32 / tile.width);
                *value = readout.count(key, pixel, c, f64::from(*value)) as f32;
            }
            copy_tile(tile, &values, 0, counts, window);
        }
    }
    copy_tile(tile, &result.lit, i, &mut frame.lit, window);
}

/// Copies what does not change with time into truth maps and samples: the truth of the first of the run's times, and the mean
/// number of samples of all up to these.
pub(crate) fn insert_maps(
    run: &Run,
    (truth, samples): (&mut [Vec<f32>], &mut [f32]),
    times: &Range<usize>,
    tile: Tile,
    result: &TileResult,
) {
    if times.start == 0 {
        for (map, image) in truth.iter_mut().enumerate() {
            copy_tile(tile, &result.truth, map, image, run.window);
        }
    }
    let (before, own, all) = (times.start as f64, times.len() as f64, times.end as f64);
    for (from, to) in rows(tile, run.window) {
        for (mean, n) in samples[to].iter_mut().zip(&result.samples[from]) {
            *mean = ((before * f64::from(*mean) + own * f64::from(*n)) / all) as f32;
        }
    }
}

/// Copies layer `layer` of a tile's stack into an image of the window; what lies outside is left out.
fn copy_tile(tile: Tile, stack: &[f32], layer: usize, image: &mut [f32], window: Tile) {
    let stack = &stack[layer * (tile.width * tile.height) as usize..];
    rows(tile, window).for_each(|(from, to)| image[to].copy_from_slice(&stack[from]));
}

/// Where the rows of a tile that lie within the window stand in the tile, and where in an image of the window.
fn rows(tile: Tile, window: Tile) -> impl Iterator<Item = (Range<usize>, Range<usize>)> {
    let (left, top) = (tile.x.max(window.x), tile.y.max(window.y));
    let right = (tile.x + tile.width).min(window.x + window.width);
    let bottom = (tile.y + tile.height).min(window.y + window.height);
    let n = right.saturating_sub(left) as usize;
    (top..bottom).map(move |y| {
        let from = (y - tile.y) as usize * tile.width as usize + (left - tile.x) as usize;
        let to = (y - window.y) as usize * window.width as usize + (left - window.x) as usize;
        (from..from + n, to..to + n)
    })
}

struct Digest<'a>(&'a Frames);

/// `value` to `digits` significant digits; what is smaller than rounding noise is 0.
fn significant(value: f64, digits: usize) -> String {
    if value.abs() < 1e-12 { "0".to_string() } else { format!("{value:.*e}", digits - 1) }
}

impl fmt::Display for Digest<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let frames = self.0;
        writeln!(f, "{} x {} pixels, radiance in W m-2 sr-1 um-1", frames.width, frames.height)?;
        for frame in &frames.frames {
            for (channel, image) in frames.channels.iter().zip(&frame.radiance) {
                let n = image.len() as f64;
                let mean = image.iter().map(|v| f64::from(*v)).sum::<f64>() / n;
                let spread = (image.iter().map(|v| (f64::from(*v) - mean).powi(2)).sum::<f64>() / n).sqrt();
                let low = image.iter().copied().fold(f32::INFINITY, f32::min);
                let high = image.iter().copied().fold(f32::NEG_INFINITY, f32::max);
                writeln!(
                    f,
                    "{} {}: mean {} deviation {} least {} most {}",
                    frame.label,
                    channel.name,
                    significant(mean, 4),
                    significant(spread, 4),
                    significant(f64::from(low), 4),
                    significant(f64::from(high), 4),
                )?;
                for row in coarse(image, frames.width as usize, frames.height as usize) {
                    let cells: Vec<String> = row.iter().map(|value| format!("{:>8}", significant(*value, 3))).collect();
                    writeln!(f, "  {}", cells.join(" "))?;
                }
            }
        }
        Ok(())
    }
}

/// Means over a coarse raster of cells; an image smaller than the raster keeps its pixels.
fn coarse(image: &[f32], width: usize, height: usize) -> Vec<Vec<f64>> {
    let (columns, rows) = (COARSE.0.min(width), COARSE.1.min(height));
    (0..rows)
        .map(|row| {
            let ys = row * height / rows..(row + 1) * height / rows;
            (0..columns)
                .map(|column| {
                    let xs = column * width / columns..(column + 1) * width / columns;
                    let n = (xs.len() * ys.len()) as f64;
                    let cell = ys.clone().flat_map(|y| image[y * width + xs.start..y * width + xs.end].iter());
                    cell.map(|v| f64::from(*v)).sum::<f64>() / n
                })
                .collect()
        })
        .collect()
}
