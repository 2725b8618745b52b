//! Converged images of the exact integral, kept on disk under a hash of everything that they depend on.
//!
//! A reference is the mean of batches, each an image with a seed of its own; a better one takes more batches, and what was
//! rendered before counts. The file is an OpenEXR image with the channels `TIME.BAND` and `TIME.BAND.error`.

use std::path::{Path, PathBuf};

use sunglint_dsl::Sources;
use sunglint_dsl::scene::{Experiment, Scene, Weather};
use sunglint_radiometry::REPLICATES;

use super::cost::{self, Costed};
use super::{BenchError, BenchProgress, FLOOR};
use crate::files::{Files, Given};
use crate::products::{Image, Raster, RasterChannel, read_image, write_exr};
use crate::{Frames, Run};

const UNIT: &str = "W m-2 sr-1 um-1";
/// Samples a pixel of the first batch under an error goal.
const FIRST_BATCH: u32 = 256;
/// A batch has at most this many times the samples before it.
const GROWTH: f64 = 3.0;

/// How good a reference is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ReferenceGoal {
    /// Relative standard error, √ mean square over pixels, frames and bands, with at most so many samples a pixel.
    Error {
        /// The error, 0..1.
        relative: f64,
        /// Most samples a pixel.
        most: u32,
    },
    /// So many samples a pixel.
    Samples(u32),
}

/// A converged image of the exact integral.
#[derive(Clone, Debug, PartialEq)]
pub struct Reference {
    /// The experiment whose models, air and times it has.
    pub experiment: String,
    /// Name of the sensor.
    pub sensor: String,
    /// Hash of everything that it depends on.
    pub key: String,
    /// Where it is kept.
    pub file: PathBuf,
    /// Samples a pixel, of all batches.
    pub samples: u32,
    /// Samples a pixel that were rendered now.
    pub samples_rendered: u32,
    /// Its relative standard error, √ mean square over pixels, frames and bands.
    pub error: f64,
    pub(super) batches: u32,
    /// Labels of the frames.
    pub(super) frames: Vec<String>,
    /// Names of the bands.
    pub(super) bands: Vec<String>,
    /// Mean and standard error of each frame's bands.
    pub(super) images: Vec<Vec<Layer>>,
}

/// Mean radiance and its standard error by pixel.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Layer {
    pub mean: Vec<f32>,
    pub error: Vec<f32>,
    /// What relative errors relate to at least: a share of the band's mean.
    pub floor: f64,
}

impl Layer {
    fn new(mean: Vec<f32>, error: Vec<f32>) -> Self {
        let sum: f64 = mean.iter().map(|value| f64::from(*value)).sum();
        let floor = FLOOR * sum / (mean.len() as f64).max(1.0);
        Self { mean, error, floor }
    }

    /// The mean of `n` samples of this and `m` of another.
    fn joined(&self, n: f64, other: &Layer, m: f64) -> Self {
        let both = |a: &[f32], b: &[f32], join: &dyn Fn(f64, f64) -> f64| {
            a.iter().zip(b).map(|(a, b)| join(f64::from(*a), f64::from(*b)) as f32).collect()
        };
        let mean = both(&self.mean, &other.mean, &|a, b| (n * a + m * b) / (n + m));
        let error = both(&self.error, &other.error, &|a, b| (n * a).hypot(m * b) / (n + m));
        Self::new(mean, error)
    }
}

/// Whose reference a run needs, and where it may be kept.
pub(super) struct Wanted<'a> {
    pub run: &'a Run,
    /// The experiment that it stands for.
    pub experiment: &'a str,
    pub folder: &'a Path,
    pub key: String,
}

impl Wanted<'_> {
    /// The reference, from disk where it is good enough, else made or made better.
    pub fn get(&self, goal: ReferenceGoal, progress: &dyn BenchProgress) -> Result<Reference, BenchError> {
        let mut found = self.kept().unwrap_or_else(|| self.none());
        while let Some(samples) = batch(&found, goal) {
            let what = format!("reference of {}/{}", self.experiment, self.run.sensor);
            let seed = seed_of(found.batches);
            let Costed { frames, .. } = cost::render(self.run, samples, seed, &what, progress)?;
            found.add(frames, samples);
            self.keep(&found).map_err(|source| BenchError::Write { path: found.file.clone(), source })?;
        }
        Ok(found)
    }

    fn none(&self) -> Reference {
        let run = self.run;
        Reference {
            experiment: self.experiment.to_string(),
            sensor: run.sensor.clone(),
            file: self.folder.join(format!("{}.exr", &self.key[..32])),
            key: self.key.clone(),
            samples: 0,
            samples_rendered: 0,
            error: f64::INFINITY,
            batches: 0,
            frames: run.moments.iter().map(|moment| moment.label.clone()).collect(),
            bands: run.channels.channels().iter().map(|band| band.name.clone()).collect(),
            images: Vec::new(),
        }
    }

    /// What is kept, where it is whole and fits.
    fn kept(&self) -> Option<Reference> {
        let mut found = self.none();
        let image = read_image(&found.file).ok()?;
        let said = |name: &str| image.own_attribute(name);
        if (image.width, image.height) != self.run.pixels || said("key") != Some(self.key.as_str()) {
            return None;
        }
        found.samples = said("samples")?.parse().ok()?;
        found.batches = said("batches")?.parse().ok()?;
        for frame in &found.frames {
            let layers: Option<Vec<Layer>> = found.bands.iter().map(|band| layer_of(&image, frame, band)).collect();
            found.images.push(layers?);
        }
        (found.samples > 0 && found.batches > 0).then(|| found.assessed())
    }

    fn keep(&self, reference: &Reference) -> std::io::Result<()> {
        let mut channels = Vec::new();
        for (frame, layers) in reference.frames.iter().zip(&reference.images) {
            for (band, layer) in self.run.channels.channels().iter().zip(layers) {
                let names = [format!("{frame}.{}", band.name), format!("{frame}.{}.error", band.name)];
                for (name, data) in names.into_iter().zip([&layer.mean, &layer.error]) {
                    let (centre, fwhm) = (band.centre.nm(), band.fwhm * 1e3);
                    channels.push(RasterChannel {
                        name,
                        unit: UNIT,
                        centre_nm: Some(centre),
                        fwhm_nm: Some(fwhm),
                        data,
                    });
                }
            }
        }
        let (width, height) = self.run.pixels;
        let raster = Raster { width, height, channels, ..Raster::default() };
        let attributes = [
            ("experiment", reference.experiment.clone()),
            ("sensor", reference.sensor.clone()),
            ("algorithm", self.run.algorithm_name.clone()),
            ("key", reference.key.clone()),
            ("samples", reference.samples.to_string()),
            ("batches", reference.batches.to_string()),
        ];
        write_exr(&reference.file, &raster, &attributes)
    }
}

fn layer_of(image: &Image, frame: &str, band: &str) -> Option<Layer> {
    let samples = |name: &str| -> Option<Vec<f32>> {
        let band = image.band(name)?;
        Some(band.samples.iter().map(|value| value as f32).collect())
    };
    Some(Layer::new(samples(&format!("{frame}.{band}"))?, samples(&format!("{frame}.{band}.error"))?))
}

/// Seeds of batches differ from each other and from those of experiments, so that reference and image are independent.
fn seed_of(batch: u32) -> u64 {
    let hash = blake3::hash(format!("reference, batch {batch}").as_bytes());
    u64::from_le_bytes(std::array::from_fn(|i| hash.as_bytes()[i]))
}

/// Samples a pixel of the next batch; `None` where the goal is reached.
fn batch(found: &Reference, goal: ReferenceGoal) -> Option<u32> {
    let whole = |n: u32| n.next_multiple_of(REPLICATES as u32);
    let (wanted, most) = match goal {
        ReferenceGoal::Samples(n) => (f64::from(n), n),
        ReferenceGoal::Error { .. } if found.samples == 0 => (f64::from(FIRST_BATCH), FIRST_BATCH),
        ReferenceGoal::Error { relative, .. } if found.error <= relative => return None,
        ReferenceGoal::Error { relative, most } => {
            // Stratified samples converge faster than this; a batch that is large for it overshoots.
            let wanted = 1.1 * f64::from(found.samples) * (found.error / relative).powi(2);
            (wanted.min(f64::from(found.samples) * (1.0 + GROWTH)), most)
        }
    };
    let most = match goal {
        ReferenceGoal::Error { most: cap, .. } => most.min(cap),
        ReferenceGoal::Samples(_) => most,
    };
    let wanted = whole(wanted.min(f64::from(most)).ceil() as u32);
    wanted.checked_sub(found.samples).filter(|more| *more > 0)
}

impl Reference {
    fn add(&mut self, frames: Frames, samples: u32) {
        let (n, m) = (f64::from(self.samples), f64::from(samples));
        let layers = |(means, errors): (Vec<Vec<f32>>, Vec<Vec<f32>>)| -> Vec<Layer> {
            means.into_iter().zip(errors).map(|(mean, error)| Layer::new(mean, error)).collect()
        };
        let new: Vec<Vec<Layer>> =
            frames.frames.into_iter().map(|frame| layers((frame.radiance, frame.error))).collect();
        self.images = match self.samples {
            0 => new,
            _ => (self.images.iter().zip(&new))
                .map(|(old, new)| old.iter().zip(new).map(|(old, new)| old.joined(n, new, m)).collect())
                .collect(),
        };
        self.samples += samples;
        self.samples_rendered += samples;
        self.batches += 1;
        *self = std::mem::take(self).assessed();
    }

    /// With its relative standard error.
    fn assessed(mut self) -> Self {
        let (mut sum, mut n) = (0.0, 0.0);
        for layer in self.images.iter().flatten() {
            for (mean, error) in layer.mean.iter().zip(&layer.error) {
                let scale = f64::from(*mean).max(layer.floor);
                if scale > 0.0 && error.is_finite() {
                    sum += (f64::from(*error) / scale).powi(2);
                    n += 1.0;
                }
            }
        }
        self.error = (sum / f64::max(n, 1.0)).sqrt();
        self
    }

    /// The layer of a frame and band, by their names.
    pub(super) fn layer(&self, frame: &str, band: &str) -> Option<&Layer> {
        let t = self.frames.iter().position(|name| name == frame)?;
        let c = self.bands.iter().position(|name| name == band)?;
        self.images.get(t)?.get(c)
    }
}

impl Default for Reference {
    fn default() -> Self {
        Self {
            experiment: String::new(),
            sensor: String::new(),
            key: String::new(),
            file: PathBuf::new(),
            samples: 0,
            samples_rendered: 0,
            error: f64::INFINITY,
            batches: 0,
            frames: Vec::new(),
            bands: Vec::new(),
            images: Vec::new(),
        }
    }
}

/// What all references of a scene depend on: the program, the text without its experiments, and every file that it names.
pub(super) fn ground_of(sources: &Sources, files: &Files) -> blake3::Hasher {
    let mut hasher = blake3::Hasher::new();
    feed(&mut hasher, env!("CARGO_PKG_VERSION"));
    // Builds of one version differ while it is made.
    let program = std::env::current_exe().and_then(std::fs::read);
    feed(&mut hasher, &program.map_or(String::new(), |bytes| blake3::hash(&bytes).to_hex().to_string()));
    let main = sources.iter().next();
    if let Some(main) = main {
        feed(&mut hasher, &without_experiments(&main.path, &main.text));
    }
    for (path, hash) in files.hashes() {
        if main.is_none_or(|main| main.path != *path) {
            feed(&mut hasher, hash);
        }
    }
    hasher
}

/// The text of a scene without what says how it is rendered.
fn without_experiments(path: &str, text: &str) -> String {
    let mut given = Given::new(path, text.to_string());
    let ast = sunglint_dsl::parse(path, &mut given, &mut Sources::default(), &mut Vec::new());
    let mut out = String::new();
    let mut at = 0;
    let said = ast.statements.iter().filter(|statement| statement.key.span.file.0 == 0);
    for statement in said.filter(|said| ["experiment", "snapshot", "scene"].contains(&said.key.text.as_str())) {
        let end = statement.block.as_ref().map_or(statement.span.end, |block| block.span.end);
        let (start, end) = (statement.key.span.start as usize, end as usize);
        out += text.get(at..start).unwrap_or_default();
        at = end;
    }
    out + text.get(at..).unwrap_or_default()
}

/// What the reference of an experiment depends on beside: its world, models, air, sensors and times; not its seed, accuracy
/// or name.
pub(super) fn feed_experiment(hasher: &mut blake3::Hasher, scene: &Scene, experiment: &Experiment) {
    feed(hasher, &format!("{:?}", experiment.constants));
    for (material, chosen) in scene.materials.iter().zip(&experiment.models) {
        if let Some(use_) = chosen.and_then(|chosen| material.models.get(chosen)) {
            feed(hasher, &format!("{} {} {:?}", material.name, use_.name, use_.args));
        }
    }
    for use_ in [&experiment.algorithm, &experiment.atmosphere] {
        feed(hasher, &format!("{} {:?}", use_.name, use_.args));
    }
    let weather = experiment.weather.clone().map(|weather| {
        let aerosol = weather.aerosol.as_ref().map(|use_| format!("{} {:?}", use_.name, use_.args));
        (aerosol, Weather { name: None, aerosol: None, spans: Default::default(), ..weather })
    });
    feed(hasher, &format!("{weather:?} {:?}", experiment.collects));
}

/// The key of a run's reference.
pub(super) fn key_of(mut hasher: blake3::Hasher, run: &Run) -> String {
    let labels: Vec<&str> = run.moments.iter().map(|moment| moment.label.as_str()).collect();
    let bands: Vec<&str> = run.channels.channels().iter().map(|band| band.name.as_str()).collect();
    feed(&mut hasher, &format!("{} {:?} {:?} {labels:?} {bands:?}", run.sensor, run.camera.pixels(), run.window));
    hasher.finalize().to_hex().to_string()
}

fn feed(hasher: &mut blake3::Hasher, part: &str) {
    hasher.update(&(part.len() as u64).to_le_bytes());
    hasher.update(part.as_bytes());
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(samples: u32, error: f64) -> Reference {
        Reference { samples, error, ..Reference::default() }
    }

    /// 2 of 3 samples with σ = 0.3 and 1 with 0.6: mean (2·1 + 4)/3, σ² = (4·0.09 + 0.36)/9.
    #[test]
    fn batches_join_to_the_mean_of_their_samples() {
        let joined = Layer::new(vec![1.0], vec![0.3]).joined(32.0, &Layer::new(vec![4.0], vec![0.6]), 16.0);
        assert!((joined.mean[0] - 2.0).abs() < 1e-6 && (joined.error[0] - 0.08f32.sqrt()).abs() < 1e-6, "{joined:?}");
        assert!((joined.floor - 0.02).abs() < 1e-6);
    }

    #[test]
    fn a_batch_is_as_large_as_the_goal_asks() {
        let goal = ReferenceGoal::Error { relative: 1e-3, most: 4096 };
        assert_eq!(batch(&of(0, f64::INFINITY), goal), Some(256));
        assert_eq!(batch(&of(256, 1e-3), goal), None);
        assert_eq!(batch(&of(256, 1.5e-3), goal), Some(384)); // 1.1 · 2.25 · 256 = 633.6, in sixteens
        assert_eq!(batch(&of(256, 1e-2), goal), Some(768), "no more than three times what there is");
        assert_eq!(batch(&of(4096, 1e-2), goal), None, "the cap");
        assert_eq!(batch(&of(0, f64::INFINITY), ReferenceGoal::Error { relative: 1e-3, most: 64 }), Some(64));
        assert_eq!(batch(&of(0, f64::INFINITY), ReferenceGoal::Samples(1000)), Some(1008));
        assert_eq!(batch(&of(64, 0.1), ReferenceGoal::Samples(100)), Some(48));
        assert_eq!(batch(&of(128, 0.1), ReferenceGoal::Samples(100)), None);
    }

    #[test]
    fn experiments_are_no_part_of_the_ground() {
        let text = "glint 1\nscene \"a\"\nmaterial grey { ideal { diffuse 0.1 } }\nexperiment noon { samples 16 }\nground grey\n";
        let cut = without_experiments("a.glint", text);
        assert!(!cut.contains("noon") && !cut.contains("scene"), "{cut}");
        assert!(cut.contains("diffuse 0.1") && cut.contains("ground grey"), "{cut}");
        assert_eq!(cut, without_experiments("a.glint", &text.replace("samples 16", "algorithm split { sun disk }")));
    }
}
