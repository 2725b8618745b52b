//! Rendering to files: tile by tile, resumable, each file whole or not at all.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use rayon::prelude::*;
use serde_json::{Value, json};
use sunglint_tracer::{Accuracy, RayCounts, Spent, Tile, TileResult};

use crate::cache::TileStore;
use crate::frames::{Frame, insert_frame, insert_maps};
use crate::lit::{BandLight, Lit};
use crate::plan::{Plan, Run, Skip, dark_skip, traced_together};
use crate::products::{
    Encoding, MapProjection, Raster, RasterChannel, Stretch, StretchCollector, composite_bands, write_envi, write_exr,
    write_png_gray, write_png_rgb, write_whole,
};
use crate::scenery::ObjectIds;
use crate::times;

/// Bytes of frames that are assembled at a time.
const FRAMES_AT_ONCE: usize = 1 << 30;
const RADIANCE_UNIT: &str = "W m-2 sr-1 um-1";

/// What could not be finished.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// A file or folder that could not be written.
    #[error("writing `{path}`: {source}")]
    Write {
        /// The file or folder.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A selection would leave a folder that holds two renders in one.
    #[error("`{folder}` holds a render {held}; write this selection to another folder (-o)")]
    Mixed {
        /// Folder of the run.
        folder: PathBuf,
        /// What it holds that the selection would leave standing or overwrite with less.
        held: String,
    },
    /// The user stopped the run; what is finished is kept.
    #[error("stopped; finished tiles are kept and the next render goes on from them")]
    Stopped,
}

/// How far a render is, for progress bars.
pub trait Progress: Sync {
    /// Runs of the same paths begin, with their number of tiles; once for each part of their times.
    fn begin(&self, runs: &[&Run], tiles: usize);
    /// One more tile of them all is finished (`cached` where it had been before).
    fn tile(&self, cached: bool, so_far: &Tally);
    /// A run ends.
    fn end(&self, run: &Run, rendered: &Rendered);
    /// Whether the user wants to stop.
    fn stopped(&self) -> bool {
        false
    }
}

/// What the finished tiles of a run, or of runs of the same paths, come to.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tally {
    /// Rays that were cast now, not those of tiles from before.
    pub rays: u64,
    /// Samples of all pixels at all times, and their number.
    samples: f64,
    pixels: f64,
    /// Sum of squares of relative standard errors, by band, and their number.
    squares: Vec<f64>,
    counted: f64,
}

impl Tally {
    /// A pixel below this share of its tile's mean is held against that.
    const FLOOR: f32 = 0.01;

    fn add(&mut self, lit: &Lit<'_>, result: &TileResult, cached: bool) {
        let (run, n_times) = (lit.run, lit.times.len());
        self.rays += if cached { 0 } else { result.rays.cast() };
        self.samples += n_times as f64 * result.samples.iter().map(|n| f64::from(*n)).sum::<f64>();
        self.pixels += n_times as f64 * result.samples.len() as f64;
        let (n, bands, traced) = (result.samples.len(), run.channels.len(), run.traced.len());
        self.squares.resize(bands, 0.0);
        for t in 0..n_times {
            for (c, squares) in self.squares.iter_mut().enumerate() {
                let layer = (t * traced + c) * n..(t * traced + c + 1) * n;
                let (radiance, error) = (&result.radiance[layer.clone()], &result.error[layer]);
                let floor = Self::FLOOR * radiance.iter().sum::<f32>() / n as f32;
                let relative = radiance.iter().zip(error).map(|(l, s)| s / l.max(floor)).filter(|e| e.is_finite());
                *squares += relative.map(|e| f64::from(e).powi(2)).sum::<f64>();
            }
            self.counted += n as f64;
        }
    }

    /// Root mean square of the pixels' relative standard errors over all times, by band.
    pub fn relative_errors(&self) -> Vec<f64> {
        self.squares.iter().map(|squares| (squares / self.counted.max(1.0)).sqrt()).collect()
    }

    /// The same over all bands.
    pub fn relative_error(&self) -> f64 {
        (self.squares.iter().sum::<f64>() / (self.counted * self.squares.len() as f64).max(1.0)).sqrt()
    }

    fn join(&mut self, other: &Self) {
        self.rays += other.rays;
        self.samples += other.samples;
        self.pixels += other.pixels;
        self.squares.resize(self.squares.len().max(other.squares.len()), 0.0);
        self.squares.iter_mut().zip(&other.squares).for_each(|(sum, squares)| *sum += squares);
        self.counted += other.counted;
    }

    /// Mean number of samples a pixel.
    pub fn samples_per_pixel(&self) -> f64 {
        self.samples / self.pixels.max(1.0)
    }
}

/// What a run did.
#[derive(Clone, Debug, PartialEq)]
pub struct Rendered {
    /// Folder of the run.
    pub folder: PathBuf,
    /// Frames written; 0 where nothing had changed.
    pub frames: usize,
    /// Tiles rendered now, those of each part of the times.
    pub tiles_rendered: usize,
    /// Tiles that had been finished before.
    pub tiles_resumed: usize,
    /// Rays of all tiles.
    pub rays: RayCounts,
    /// What its tiles come to; empty where nothing had changed.
    pub tally: Tally,
    /// Seconds of rendering and of writing.
    pub seconds: (f64, f64),
    /// Processor time of the tiles rendered now: what all times share, and each time's light.
    pub spent: Spent,
    /// Samples a pixel that fitted into the run's `time`; `None` without one, or where nothing had changed.
    pub timed_samples: Option<u32>,
    /// The run whose paths were lit, at its first times, and whose rays and seconds theirs are; `None` where they are its own.
    pub traced_with: Option<String>,
}

/// Renders every run of a plan beneath `out`. A run's folder holds one render: a selection is not written over one that
/// holds more.
///
/// # Errors
/// Writing, a selection that does not fit what a folder holds, or the user.
pub fn render(plan: &Plan, out: &Path, progress: &dyn Progress) -> Result<Vec<Rendered>, RenderError> {
    plan.runs().iter().try_for_each(|run| refuse_mixing(run, &folder_of(run, out)))?;
    let mut works: Vec<Work<'_>> = plan.runs().iter().map(|run| Work::new(run, out)).collect();
    for work in works.iter_mut().filter(|work| is_up_to_date(work.run, &work.rendered.folder)) {
        work.finish_unchanged(progress);
    }
    let mut air_seconds = plan.air_seconds;
    for mut part in plan.parts() {
        part.retain(|(run, _)| !works[*run].is_finished);
        let solving = Instant::now();
        let lits = plan.lit(&part);
        air_seconds += solving.elapsed().as_secs_f64();
        for group in traced_together(&lits) {
            let of_group: Vec<&Lit<'_>> = group.iter().map(|i| &lits[*i]).collect();
            let taken = render_group(&of_group, out, progress)?;
            group.iter().zip(taken).for_each(|(i, taken)| works[part[*i].0].add(&lits[*i], taken));
            for i in group {
                let work = &mut works[part[i].0];
                if lits[i].times.end == work.run.moments.len() {
                    work.write(plan, air_seconds, out)?;
                    progress.end(work.run, &work.rendered);
                }
            }
        }
    }
    Ok(works.into_iter().map(|work| work.rendered).collect())
}

fn at(path: &Path) -> impl FnOnce(io::Error) -> RenderError + '_ {
    move |source| RenderError::Write { path: path.to_path_buf(), source }
}

fn folder_of(run: &Run, out: &Path) -> PathBuf {
    out.join(&run.experiment).join(&run.sensor)
}

/// A run on its way to files.
struct Work<'a> {
    run: &'a Run,
    store: TileStore,
    /// The times of each part whose tiles are finished, and the light of these times.
    parts: Vec<Range<usize>>,
    light: Vec<BandLight>,
    rendered: Rendered,
    is_finished: bool,
}

/// What the tiles of a run at some times took.
#[derive(Default)]
struct Taken {
    rays: RayCounts,
    spent: Spent,
    tiles_rendered: usize,
    tiles_resumed: usize,
    tally: Tally,
    seconds: f64,
    timed_samples: Option<u32>,
    traced_with: Option<String>,
}

impl<'a> Work<'a> {
    fn new(run: &'a Run, out: &Path) -> Self {
        let rendered = Rendered {
            folder: folder_of(run, out),
            frames: 0,
            tiles_rendered: 0,
            tiles_resumed: 0,
            rays: RayCounts::default(),
            tally: Tally::default(),
            seconds: (0.0, 0.0),
            spent: Spent::default(),
            timed_samples: None,
            traced_with: None,
        };
        let store = TileStore::new(out, &run.key);
        Self { run, store, parts: Vec::new(), light: Vec::new(), rendered, is_finished: false }
    }

    /// Its frames are there already.
    fn finish_unchanged(&mut self, progress: &dyn Progress) {
        let n_tiles = self.run.tiles().len();
        progress.begin(&[self.run], n_tiles);
        (0..n_tiles).for_each(|_| progress.tile(true, &Tally::default()));
        self.rendered.tiles_resumed = n_tiles;
        self.is_finished = true;
        progress.end(self.run, &self.rendered);
    }

    /// The tiles of its next times are finished.
    fn add(&mut self, lit: &Lit<'_>, taken: Taken) {
        let Taken { rays, spent, tiles_rendered, tiles_resumed, tally, seconds, timed_samples, traced_with } = taken;
        let rendered = &mut self.rendered;
        if self.parts.is_empty() {
            (rendered.timed_samples, rendered.traced_with) = (timed_samples, traced_with);
        }
        rendered.rays += rays;
        rendered.spent.shared += spent.shared;
        rendered.spent.light.extend(spent.light);
        rendered.tiles_rendered += tiles_rendered;
        rendered.tiles_resumed += tiles_resumed;
        rendered.tally.join(&tally);
        rendered.seconds.0 += seconds;
        self.parts.push(lit.times.clone());
        self.light.extend(lit.bands());
    }

    /// Writes products and manifest from the tiles of all its times.
    fn write(&mut self, plan: &Plan, air_seconds: f64, out: &Path) -> Result<(), RenderError> {
        let writing = Instant::now();
        self.write_products(out)?;
        self.rendered.frames = self.run.moments.len();
        self.rendered.seconds.1 = writing.elapsed().as_secs_f64();
        let manifest = self.rendered.folder.join("manifest.json");
        let text = format!("{:#}\n", self.manifest(plan, air_seconds));
        write_whole(&manifest, |file| io::Write::write_all(file, text.as_bytes())).map_err(at(&manifest))?;
        self.store.remove().map_err(at(out))?;
        self.is_finished = true;
        Ok(())
    }
}

/// Renders runs of the same paths at some of their times, tile by tile, into their stores.
fn render_group(group: &[&Lit<'_>], out: &Path, progress: &dyn Progress) -> Result<Vec<Taken>, RenderError> {
    let first = group[0];
    let tiles = first.run.tiles();
    let runs: Vec<&Run> = group.iter().map(|lit| lit.run).collect();
    progress.begin(&runs, tiles.len());
    let started = Instant::now();
    let stores: Vec<TileStore> = runs.iter().map(|run| TileStore::new(out, &run.key)).collect();
    // The number is chosen once: later times, and a run that goes on after a kill, take the one of its finished tiles. No two runs
    // share it.
    let timed_samples = match first.run.budget {
        Some(seconds) => {
            let samples = stores[0].samples().unwrap_or_else(|| first.samples_of_run(seconds));
            stores[0].save_samples(samples).map_err(at(out))?;
            Some(samples)
        }
        None => None,
    };
    let accuracy = timed_samples.map_or(first.run.accuracy, Accuracy::Samples);
    // Of all runs, and of each.
    let tallies = Mutex::new((Tally::default(), vec![Tally::default(); group.len()]));
    let failed = AtomicBool::new(false);
    // Of each run: rays, processor time, and whether the tile had been finished before.
    let render_tile = |i: usize, tile: Tile| -> Result<Vec<(RayCounts, Spent, bool)>, RenderError> {
        if failed.load(Ordering::Relaxed) || progress.stopped() {
            return Err(RenderError::Stopped);
        }
        let load = |(lit, store): (&&Lit<'_>, &TileStore)| {
            store.load(lit.times.start, i).filter(|result| fits(result, tile, lit.run, lit.times.len()))
        };
        let known: Vec<Option<TileResult>> = group.iter().zip(&stores).map(load).collect();
        let missing: Vec<&Lit<'_>> =
            group.iter().zip(&known).filter(|(_, known)| known.is_none()).map(|(lit, _)| *lit).collect();
        let fresh = missing.split_first().map(|(first, others)| first.render_tile_with(others, tile, accuracy));
        let mut fresh = fresh.into_iter().flatten();
        let mut of_runs: Vec<(TileResult, Spent, bool)> = Vec::new();
        for ((lit, store), known) in group.iter().zip(&stores).zip(known) {
            if let Some(result) = known {
                of_runs.push((result, Spent::default(), true));
            } else if let Some((result, spent)) = fresh.next() {
                store.save(lit.times.start, i, &result).map_err(|source| {
                    failed.store(true, Ordering::Relaxed);
                    RenderError::Write { path: out.to_path_buf(), source }
                })?;
                of_runs.push((result, spent, false));
            }
        }
        let mut tallies = tallies.lock().expect("no holder of this lock panics");
        let (of_all, of_each) = &mut *tallies;
        for ((lit, tally), (result, _, cached)) in group.iter().zip(of_each).zip(&of_runs) {
            tally.add(lit, result, *cached);
            of_all.add(lit, result, *cached);
        }
        progress.tile(missing.is_empty(), of_all);
        Ok(of_runs.into_iter().map(|(result, spent, cached)| (result.rays, spent, cached)).collect())
    };
    let of_tiles: Vec<Vec<(RayCounts, Spent, bool)>> =
        tiles.par_iter().enumerate().map(|(i, tile)| render_tile(i, *tile)).collect::<Result<_, _>>()?;
    let seconds = started.elapsed().as_secs_f64();
    let tallies = tallies.into_inner().expect("no holder of this lock panics").1;
    let of_run = |((i, lit), tally): ((usize, &&Lit<'_>), Tally)| {
        let spent = Spent { shared: 0.0, light: vec![0.0; lit.times.len()] };
        let traced_with = (i > 0).then(|| first.run.full_name());
        let mut taken = Taken { spent, tally, seconds, timed_samples, traced_with, ..Taken::default() };
        for of_tile in &of_tiles {
            let (rays, spent, cached) = &of_tile[i];
            taken.rays += *rays;
            taken.spent += spent;
            taken.tiles_resumed += usize::from(*cached);
            taken.tiles_rendered += usize::from(!cached);
        }
        taken
    };
    Ok(group.iter().enumerate().zip(tallies).map(of_run).collect())
}

/// Whether a selection may be written into a folder: the render that stands there, by its manifest, must hold no frame or
/// band that the selection leaves out, and not the whole view where the selection is a crop.
fn refuse_mixing(run: &Run, folder: &Path) -> Result<(), RenderError> {
    let Ok(text) = fs::read_to_string(folder.join("manifest.json")) else { return Ok(()) };
    let Ok(held) = serde_json::from_str::<Value>(&text) else { return Ok(()) };
    let refuse = |held: String| Err(RenderError::Mixed { folder: folder.to_path_buf(), held });
    let names = |list: &str, key: &str| -> Vec<String> {
        let rows = held[list].as_array().into_iter().flatten();
        rows.filter_map(|row| row[key].as_str().map(str::to_string)).collect()
    };
    if held["key"] == run.key.as_str() {
        return Ok(());
    }
    let more = |kind: &str, held: Vec<String>, kept: Vec<&str>| {
        let more: Vec<String> = held.into_iter().filter(|name| !kept.contains(&name.as_str())).collect();
        match more.as_slice() {
            [] => Ok(()),
            [one] => refuse(format!("with {kind} {one} too")),
            [one, ..] => refuse(format!("with {} more {kind}s ({one} …)", more.len())),
        }
    };
    if run.left_out.times > 0 {
        more("time", names("times", "frame"), run.moments.iter().map(|moment| moment.label.as_str()).collect())?;
    }
    if run.left_out.bands > 0 {
        more("band", names("channels", "name"), run.channels.channels().iter().map(|c| c.name.as_str()).collect())?;
    }
    if run.is_crop() && held["crop"].is_null() && held["key"].is_string() {
        return refuse("of the whole view".to_string());
    }
    Ok(())
}

/// Whether a tile from disk has the shape that a run gives it at so many times.
fn fits(result: &TileResult, tile: Tile, run: &Run, n_times: usize) -> bool {
    let n = (tile.width * tile.height) as usize;
    let stack = n * n_times * run.traced.len();
    let surface = run.products.surface_radiance || run.products.reflectance_factor;
    result.radiance.len() == stack
        && result.error.len() == stack
        && result.surface.len() == if surface { stack } else { 0 }
        && result.truth.len() == n * TileResult::TRUTH_MAPS
}

/// Whether the folder holds this very run, complete.
fn is_up_to_date(run: &Run, folder: &Path) -> bool {
    let Ok(text) = fs::read_to_string(folder.join("manifest.json")) else { return false };
    let Ok(value) = serde_json::from_str::<Value>(&text) else { return false };
    value["key"] == run.key.as_str() && expected_files(run).iter().all(|file| folder.join(file).is_file())
}

fn expected_files(run: &Run) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for moment in &run.moments {
        let frame = Path::new(&moment.label);
        if run.products.radiance {
            files.extend(["radiance.exr", "radiance.img", "radiance.hdr", "error.exr"].map(|name| frame.join(name)));
        }
        if run.products.surface_radiance {
            files.push(frame.join("surface_radiance.exr"));
        }
        for (asked, name) in [(run.products.counts, "counts"), (run.products.reflectance_factor, "reflectance_factor")]
        {
            files.extend(
                ["exr", "img", "hdr"].into_iter().filter(|_| asked).map(|end| frame.join(format!("{name}.{end}"))),
            );
        }
        if run.products.truth {
            files.push(frame.join("lit.exr"));
        }
        if run.products.preview {
            files.extend(previews(run).into_iter().map(|preview| frame.join(preview.file)));
        }
    }
    if run.products.truth {
        files.push("truth.exr".into());
    }
    files
}

struct Preview {
    file: String,
    bands: Vec<usize>,
}

/// A grey preview of every band of a sensor with few bands, and the composites.
fn previews(run: &Run) -> Vec<Preview> {
    const MOST_BANDS: usize = 16;
    let channels = run.channels.channels();
    let mut previews = Vec::new();
    if channels.len() <= MOST_BANDS {
        let grey = |(i, channel): (usize, &sunglint_radiometry::Channel)| Preview {
            file: format!("{}.png", channel.name),
            bands: vec![i],
        };
        previews.extend(channels.iter().enumerate().map(grey));
    }
    let centres: Vec<Option<f64>> = channels.iter().map(|channel| Some(channel.centre.nm())).collect();
    previews.extend(
        composite_bands(&centres)
            .into_iter()
            .map(|composite| Preview { file: format!("{}.png", composite.name), bands: composite.channels.to_vec() }),
    );
    previews
}

impl Work<'_> {
    /// Assembles frames from tiles; `seen` is shown each tile with the times that it is of.
    fn frames(
        &self,
        chunk: &Range<usize>,
        tiles: &[Tile],
        out: &Path,
        mut seen: impl FnMut(&Range<usize>, Tile, &TileResult),
    ) -> Result<Vec<Frame>, RenderError> {
        let mut frames: Vec<Frame> = chunk.clone().map(|t| Frame::blank(self.run, t)).collect();
        for part in self.parts.iter().filter(|part| part.start < chunk.end && chunk.start < part.end) {
            for (i, tile) in tiles.iter().enumerate() {
                // Another render into the folder may have put tiles of other parts there.
                let known = self.store.load(part.start, i).filter(|result| fits(result, *tile, self.run, part.len()));
                let result = known.ok_or_else(|| RenderError::Write {
                    path: out.to_path_buf(),
                    source: io::Error::other("a finished tile has gone from the folder while it was rendered"),
                })?;
                for t in part.start.max(chunk.start)..part.end.min(chunk.end) {
                    let frame = &mut frames[t - chunk.start];
                    insert_frame(self.run, frame, t - part.start, &self.light[t], *tile, &result);
                }
                seen(part, *tile, &result);
            }
        }
        Ok(frames)
    }

    fn write_products(&self, out: &Path) -> Result<(), RenderError> {
        let (run, folder, tiles) = (self.run, &self.rendered.folder, self.run.tiles());
        let n = run.pixels.0 as usize * run.pixels.1 as usize;
        let n_channels = run.channels.len();
        // Frames are assembled a few at a time, so that memory is bounded whatever the number of times.
        let products = &run.products;
        let more = [products.surface_radiance, products.reflectance_factor, products.counts];
        let per_frame = n * 4 * (1 + n_channels * (2 + more.iter().filter(|asked| **asked).count()));
        let n_times = run.moments.len();
        let at_once = (FRAMES_AT_ONCE / per_frame.max(1)).clamp(1, n_times.max(1));
        let mut stretches: Vec<StretchCollector> = (0..n_channels).map(|_| StretchCollector::default()).collect();
        let mut truth = vec![vec![0.0; n]; TileResult::TRUTH_MAPS];
        let mut samples = vec![0.0; n];
        let chunks: Vec<Range<usize>> =
            (0..n_times).step_by(at_once).map(|start| start..(start + at_once).min(n_times)).collect();
        for chunk in &chunks {
            let frames = self.frames(chunk, &tiles, out, |times, tile, result| {
                if chunk.contains(&times.start) {
                    insert_maps(run, (&mut truth, &mut samples), times, tile, result);
                }
            })?;
            (frames.par_iter().zip(chunk.clone()))
                .try_for_each(|(frame, t)| write_frame(run, folder, frame, t, &self.light[t]))?;
            for frame in &frames {
                stretches.iter_mut().zip(&frame.radiance).for_each(|(stretch, image)| stretch.add(image));
            }
            if chunks.len() == 1 && run.products.preview {
                let stretches = series_stretches(&stretches);
                frames.par_iter().try_for_each(|frame| write_previews(run, folder, frame, &stretches))?;
            }
        }
        if chunks.len() > 1 && run.products.preview {
            let stretches = series_stretches(&stretches);
            for chunk in &chunks {
                let frames = self.frames(chunk, &tiles, out, |_, _, _| {})?;
                frames.par_iter().try_for_each(|frame| write_previews(run, folder, frame, &stretches))?;
            }
        }
        if run.products.truth {
            write_truth(run, folder, &truth, &samples)?;
        }
        Ok(())
    }
}

fn series_stretches(collectors: &[StretchCollector]) -> Vec<Stretch> {
    collectors.iter().map(StretchCollector::stretch).collect()
}

fn raster<'a>(run: &Run, images: &'a [Vec<f32>], unit: &'a str) -> Raster<'a> {
    let to_picometre = |nm: f64| (nm * 1e3).round() / 1e3;
    let channels = (run.channels.channels().iter().zip(images))
        .map(|(channel, data)| RasterChannel {
            name: channel.name.clone(),
            unit,
            centre_nm: Some(to_picometre(channel.centre.nm())),
            fwhm_nm: Some(to_picometre(channel.fwhm * 1e3)),
            data,
        })
        .collect();
    Raster { width: run.pixels.0, height: run.pixels.1, channels, encoding: Encoding::Float }
}

fn attributes(run: &Run, t: Option<usize>) -> Vec<(&'static str, String)> {
    let mut attributes = vec![
        ("sunglint:version", env!("CARGO_PKG_VERSION").to_string()),
        ("sunglint:experiment", run.experiment.clone()),
        ("sunglint:sensor", run.sensor.clone()),
        ("sunglint:algorithm", run.algorithm_name.clone()),
        ("sunglint:atmosphere", run.atmosphere_name.clone()),
        ("sunglint:key", run.key.clone()),
    ];
    if run.is_crop() {
        let (view, window) = (run.camera.pixels(), run.window);
        let crop = format!("{},{},{}x{}", window.x, window.y, window.width, window.height);
        attributes.push(("sunglint:crop", format!("{crop} of {}x{}", view.0, view.1)));
    }
    if !run.constants.is_empty() {
        let constants: Vec<String> = run.constants.iter().map(|(name, value)| format!("{name} {value}")).collect();
        attributes.push(("sunglint:constants", constants.join("; ")));
    }
    if let Some(moment) = t.map(|t| &run.moments[t]) {
        attributes.push(("sunglint:time", moment.utc.map_or_else(|| moment.label.clone(), times::iso)));
        if let Some(sun) = &moment.sun {
            attributes.push(("sunglint:sun_zenith_deg", format!("{:.5}", sun.apparent.zenith().to_degrees())));
            attributes.push(("sunglint:sun_azimuth_deg", format!("{:.5}", sun.apparent.azimuth().to_degrees())));
        }
    }
    attributes
}

/// Those of an EXR file, which has no fields of its own for a map.
fn with_map(run: &Run, mut attributes: Vec<(&'static str, String)>) -> Vec<(&'static str, String)> {
    attributes.extend(run.map.iter().flat_map(MapProjection::attributes));
    attributes
}

/// Fields that ENVI headers have names for: when, where the sun was (from true north), the map, and the bands that make a
/// picture.
fn envi_fields(run: &Run, t: usize) -> Vec<(&'static str, String)> {
    let moment = &run.moments[t];
    let mut fields = vec![("sensor type", run.sensor.clone())];
    fields.extend(moment.utc.map(|utc| ("acquisition time", times::iso(utc))));
    if let Some(sun) = &moment.sun {
        let azimuth = (sun.apparent.azimuth() + run.convergence).to_degrees().rem_euclid(360.0);
        fields.push(("sun elevation", format!("{:.5}", 90.0 - sun.apparent.zenith().to_degrees())));
        fields.push(("sun azimuth", format!("{azimuth:.5}")));
    }
    let centres: Vec<Option<f64>> = run.channels.channels().iter().map(|channel| Some(channel.centre.nm())).collect();
    if let Some(composite) = composite_bands(&centres).first() {
        let bands: Vec<String> = composite.channels.iter().map(|band| (band + 1).to_string()).collect();
        fields.push(("default bands", format!("{{{}}}", bands.join(", "))));
    }
    fields.extend(run.map.iter().flat_map(MapProjection::envi_fields));
    fields
}

fn numbers(values: impl Iterator<Item = f64>) -> String {
    format!("{{{}}}", values.map(|value| format!("{value:.9e}")).collect::<Vec<_>>().join(", "))
}

fn write_frame(run: &Run, folder: &Path, frame: &Frame, t: usize, light: &BandLight) -> Result<(), RenderError> {
    let folder = folder.join(&frame.label);
    let attributes = attributes(run, Some(t));
    let mapped = with_map(run, attributes.clone());
    let exr = |name: &str, raster: &Raster<'_>| {
        let path = folder.join(name);
        write_exr(&path, raster, &mapped).map_err(at(&path))
    };
    let fields = envi_fields(run, t);
    let envi = |name: &str, what: &str, raster: &Raster<'_>, more: Vec<(&'static str, String)>| {
        let path = folder.join(name);
        let description = format!("Sunglint {what}, {} {} {}", run.experiment, run.sensor, frame.label);
        let fields: Vec<_> = fields.iter().cloned().chain(more).collect();
        write_envi(&path, raster, &description, &fields, &attributes).map_err(at(&path))
    };
    if run.products.radiance {
        let radiance = raster(run, &frame.radiance, RADIANCE_UNIT);
        exr("radiance.exr", &radiance)?;
        exr("error.exr", &raster(run, &frame.error, RADIANCE_UNIT))?;
        let solar = vec![("solar irradiance", numbers(light.solar.iter().copied()))]; // as ENVI has it, in W m⁻² µm⁻¹
        envi("radiance.img", "at-sensor spectral radiance", &radiance, solar)?;
    }
    if run.products.surface_radiance {
        exr("surface_radiance.exr", &raster(run, &frame.surface, RADIANCE_UNIT))?;
    }
    if run.products.reflectance_factor {
        let factor = raster(run, &frame.reflectance_factor, "1");
        exr("reflectance_factor.exr", &factor)?;
        envi("reflectance_factor.img", "reflectance factor against the open level ground", &factor, Vec::new())?;
    }
    if let Some(readout) = &run.readout {
        let encoding = Encoding::Whole { bits: readout.ccd.bits };
        let counts = Raster { encoding, ..raster(run, &frame.counts, "DN") };
        let calibration: Vec<(f64, f64)> = (0..run.channels.len()).map(|band| readout.calibration(band)).collect();
        let gains = vec![
            ("data gain values", numbers(calibration.iter().map(|pair| pair.0))),
            ("data offset values", numbers(calibration.iter().map(|pair| pair.1))),
        ];
        exr("counts.exr", &counts)?;
        envi("counts.img", "digital numbers; gain and offset give W m-2 sr-1 um-1", &counts, gains)?;
    }
    if run.products.truth {
        exr("lit.exr", &map_raster(run, &[("sun_lit_fraction", "1", &frame.lit)]))?;
    }
    Ok(())
}

fn map_raster<'a>(run: &Run, maps: &[(&str, &'a str, &'a Vec<f32>)]) -> Raster<'a> {
    let channels = (maps.iter())
        .map(|(name, unit, data)| RasterChannel {
            name: (*name).to_string(),
            unit,
            centre_nm: None,
            fwhm_nm: None,
            data,
        })
        .collect();
    Raster { width: run.pixels.0, height: run.pixels.1, channels, encoding: Encoding::Float }
}

/// Names and units of the truth maps, in order.
const TRUTH: [(&str, &str); TileResult::TRUTH_MAPS] = [
    ("material_code", "1"),
    ("object", "1"),
    ("facet", "1"),
    ("x", "m"),
    ("y", "m"),
    ("z", "m"),
    ("range", "m"),
    ("view_zenith", "deg"),
    ("sky_view_factor", "1"),
];

fn write_truth(run: &Run, folder: &Path, truth: &[Vec<f32>], samples: &Vec<f32>) -> Result<(), RenderError> {
    let mut maps: Vec<(&str, &str, &Vec<f32>)> =
        TRUTH.iter().zip(truth).map(|((name, unit), image)| (*name, *unit, image)).collect();
    maps.push(("samples", "1", samples));
    let mut attributes = with_map(run, attributes(run, None));
    let objects: Vec<String> = run.objects.iter().map(described).collect();
    attributes.push(("sunglint:objects", objects.join("; ")));
    let materials: Vec<String> = run.materials.iter().map(|(code, name)| format!("{code} {name}")).collect();
    attributes.push(("sunglint:materials", materials.join("; ")));
    let path = folder.join("truth.exr");
    write_exr(&path, &map_raster(run, &maps), &attributes).map_err(at(&path))
}

/// `7 truck`, or `8..1000007 oak.1..` for the members of a statement that has very many.
fn described(ids: &ObjectIds) -> String {
    match ids.count {
        1 => format!("{} {}", ids.first, ids.name),
        n => format!("{}..{} {}.1..", ids.first, ids.first + n.saturating_sub(1), ids.name),
    }
}

/// One object; with `count`, that many members whose ids and numbers count on.
fn object_json(ids: &ObjectIds) -> Value {
    match ids.count {
        1 => json!({"id": ids.first, "name": ids.name}),
        n => json!({"id": ids.first, "name": format!("{}.1", ids.name), "count": n}),
    }
}

fn write_previews(run: &Run, folder: &Path, frame: &Frame, stretches: &[Stretch]) -> Result<(), RenderError> {
    let (width, height) = run.pixels;
    for preview in previews(run) {
        let path = folder.join(&frame.label).join(&preview.file);
        let image = |i: usize| frame.radiance[i].as_slice();
        let written = match preview.bands[..] {
            [i] => write_png_gray(&path, width, height, image(i), stretches[i]),
            [r, g, b] => {
                let stretches = [stretches[r], stretches[g], stretches[b]];
                write_png_rgb(&path, width, height, [image(r), image(g), image(b)], stretches)
            }
            _ => Ok(()),
        };
        written.map_err(at(&path))?;
    }
    Ok(())
}

/// Swept values or constants as a JSON object.
pub fn settings_json(settings: &[(String, String)]) -> Value {
    settings.iter().map(|(name, value)| (name.clone(), Value::from(value.as_str()))).collect()
}

/// Skips as JSON.
pub fn skips_json(skips: &[Skip]) -> Value {
    skips.iter().map(|skip| json!({"what": skip.what, "why": skip.why})).collect()
}

/// Ray counts as JSON.
pub fn rays_json(rays: &RayCounts) -> Value {
    json!({
        "camera": rays.camera,
        "camera_skipped_proved": rays.camera_proved,
        "hemisphere": rays.hemisphere,
        "mirror": rays.mirror,
        "sun": rays.sun,
        "sun_skipped_turned_away": rays.sun_turned_away,
        "sun_skipped_proved_clear": rays.sun_proved_clear,
        "sun_skipped_proved_shaded": rays.sun_proved_shaded,
        "caustic": rays.caustic,
        "hemisphere_skipped_open": rays.hemisphere_open,
    })
}

/// A run's times as JSON: the instant and the sun's place.
pub fn moments_json(run: &Run) -> Value {
    (run.moments.iter())
        .map(|moment| {
            let mut row = json!({"frame": moment.label, "time_utc": moment.utc.map(times::iso)});
            if let Some(sun) = &moment.sun {
                row["sun_zenith_deg"] = json!(sun.true_zenith.to_degrees());
                row["sun_apparent_zenith_deg"] = json!(sun.apparent.zenith().to_degrees());
                row["sun_azimuth_deg"] = json!(sun.apparent.azimuth().to_degrees());
                row["earth_sun_distance_au"] = json!(sun.distance);
            }
            row
        })
        .collect()
}

/// The detector of a run as JSON, null without counts: what turns its numbers into radiance.
fn detector_json(run: &Run) -> Value {
    let Some(readout) = &run.readout else { return Value::Null };
    let bands: Vec<Value> = (run.channels.channels().iter().enumerate())
        .map(|(band, channel)| {
            let (slope, intercept) = readout.calibration(band);
            json!({
                "name": channel.name,
                "electrons_per_w_m2_sr_um": readout.electrons[band],
                "radiance_w_m2_sr_um_per_dn": slope,
                "radiance_at_0_dn_w_m2_sr_um": intercept,
            })
        })
        .collect();
    json!({"bits": readout.ccd.bits, "gain_electrons_per_dn": readout.ccd.gain(), "bands": bands})
}

/// The map of a run as JSON, null where its sensor does not look straight down.
pub fn map_json(run: &Run) -> Value {
    let Some(map) = &run.map else { return Value::Null };
    let (width, height) = map.pixel_size();
    json!({
        "coordinate_system": map.wkt,
        "geotransform_m": map.geotransform,
        "pixel_m": [width, height],
        "rotation_deg": map.rotation_deg(),
    })
}

impl Work<'_> {
    fn manifest(&self, plan: &Plan, air_seconds: f64) -> Value {
        let Self { run, rendered, .. } = self;
        let files: BTreeMap<&String, &String> = plan.files.iter().collect();
        let channels: Vec<Value> = (run.channels.channels().iter().zip(run.band_shares()))
        .map(|(c, share)| {
            let (nodes, entries) = (share.nodes, share.grid_entries);
            json!({"name": c.name, "centre_nm": c.centre.nm(), "fwhm_nm": c.fwhm * 1e3, "nodes": nodes, "grid_entries": entries})
        })
        .collect();
        let mut times = moments_json(run);
        for (row, light) in times.as_array_mut().into_iter().flatten().zip(&rendered.spent.light) {
            row["light_cpu_s"] = json!(light);
        }
        let errors: BTreeMap<&String, f64> =
            run.channels.channels().iter().map(|c| &c.name).zip(rendered.tally.relative_errors()).collect();
        let light_s: f64 = rendered.spent.light.iter().sum();
        let seconds = json!({
            "atmosphere_of_all_runs_s": air_seconds,
            "trace_cpu_s": rendered.spent.shared,
            "light_cpu_s": light_s,
            "light_cpu_s_per_time": light_s / run.moments.len().max(1) as f64,
            "write_s": rendered.seconds.1,
        });
        // Known before where the light of all times is kept.
        let dark = run.kept().map_or_else(|| self.light.iter().filter(|light| light.is_dark).count(), |_| 0);
        let skips: Vec<Skip> =
            plan.skips.iter().chain(&run.skips).cloned().chain(dark_skip(dark, run.moments.len())).collect();
        let mut manifest = json!({
            "sunglint_version": env!("CARGO_PKG_VERSION"),
            "key": run.key,
            "title": plan.title,
            "experiment": run.experiment,
            "sweep": settings_json(&run.sweep),
            "constants": settings_json(&run.constants),
            "sensor": run.sensor,
            "pixels": [run.pixels.0, run.pixels.1],
            "crop": run.is_crop().then_some([run.window.x, run.window.y, run.window.width, run.window.height]),
            "bands_left_out": run.left_out.bands,
            "times_left_out": run.left_out.times,
            "algorithm": run.algorithm_name,
            "atmosphere": run.atmosphere_name,
            "models": run.models,
            "accuracy": format!("{:?}", rendered.timed_samples.map_or(run.accuracy, Accuracy::Samples)),
            "time_s": run.budget,
            "samples": rendered.timed_samples,
            "samples_per_pixel": rendered.tally.samples_per_pixel(),
            "relative_standard_error": errors,
            "seed": run.seed,
            "unit": RADIANCE_UNIT,
            "channels": channels,
            "detector": detector_json(run),
            "map": map_json(run),
            "grid_entries": run.grid.len(),
            "times": times,
            "objects": run.objects.iter().map(object_json).collect::<Vec<_>>(),
            "materials": run.materials.iter().map(|(code, name)| json!({"code": code, "name": name})).collect::<Vec<_>>(),
            "inputs_blake3": files,
            "facets": run.scenery.world.facet_count(),
            "geometry_bytes": run.scenery.world.memory_bytes(),
            "threads": rayon::current_num_threads(),
            "render_s": rendered.seconds.0,
            "write_s": rendered.seconds.1,
            "tiles_rendered": rendered.tiles_rendered,
            "tiles_resumed": rendered.tiles_resumed,
            "rays": rays_json(&rendered.rays),
            "rays_per_s": rendered.tally.rays as f64 / rendered.seconds.0.max(1e-9),
            "skips": skips_json(&skips),
            "estimators": run.estimators,
            "air_notes": run.air_notes,
        });
        manifest["seconds"] = seconds;
        manifest["columns_solved"] = json!(run.columns_solved);
        manifest["paths_traced_with"] = json!(rendered.traced_with);
        manifest["parts"] = json!(self.parts.len());
        manifest
    }
}
