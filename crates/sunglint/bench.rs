//! What each treatment costs and how wrong it is: experiments and numbers of samples against converged references.
//!
//! The reference of an experiment has its models, air and times, rendered by path tracing of the exact integral, so that the
//! algorithm alone is judged; or one experiment's reference judges all, and differences of reflectance models count too.

mod changes;
mod cost;
mod errors;
mod figures;
mod reference;
mod report;

use std::collections::{BTreeMap, HashMap};
use std::io;
use std::path::PathBuf;
use std::sync::Arc;

use sunglint_dsl::scene::{Experiment, ModelUse, Products, Scene};
use sunglint_dsl::{list, nearest};

pub use self::changes::Change;
pub use self::errors::{Errors, FLOOR, WorstError};
pub use self::reference::{Reference, ReferenceGoal};

use self::cost::Costed;
use self::errors::{Pixel, Sums};
use self::reference::{Wanted, feed_experiment, ground_of, key_of};
use crate::selection::{is_experiment, wanted};
use crate::{Checked, Options, Plan, Run};

/// What is measured.
#[derive(Clone, Debug, PartialEq)]
pub struct BenchOptions {
    /// Samples a pixel, ascending, multiples of 16; not empty.
    pub samples: Vec<u32>,
    /// Samples a pixel at which approximations are changed one by one, one of `samples`; `None` leaves that out.
    pub single: Option<u32>,
    /// How good references are made.
    pub goal: ReferenceGoal,
    /// The run whose reference judges all; each its own where unsaid.
    pub against: Option<String>,
    /// Folder in which references are kept.
    pub references: PathBuf,
}

/// Why a bench ends without an answer.
#[derive(Debug, thiserror::Error)]
pub enum BenchError {
    /// Something was asked for that the scene does not have.
    #[error("{0}")]
    Input(String),
    /// A reference could not be kept.
    #[error("keeping the reference `{path}`: {source}")]
    Write {
        /// Its file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The user stopped it; finished references are kept.
    #[error("stopped; references are kept as far as they went")]
    Stopped,
}

/// How far a bench is.
pub trait BenchProgress: Sync {
    /// An image begins, with its number of tiles.
    fn begin(&self, what: &str, tiles: usize);
    /// One more tile is finished.
    fn tile(&self);
    /// The image is finished.
    fn end(&self);
    /// Whether the user wants to stop.
    fn stopped(&self) -> bool {
        false
    }
}

/// What is rendered beside a scene's own experiments: references, and algorithms with one approximation changed. They are
/// experiments of the scene like any other, so that one plan shares geometry, surfaces and air among all.
pub struct BenchRuns {
    own: Vec<String>,
    /// Whose reference judges each experiment.
    judges: HashMap<String, String>,
    /// Hashes of what references depend on, by the names of these runs.
    keys: HashMap<String, blake3::Hasher>,
    /// The changes of each experiment, with the names of the runs that make them.
    changes: HashMap<String, Vec<(Change, String)>>,
}

impl BenchRuns {
    /// Adds to a scene what its bench renders, for the experiments that the options select.
    ///
    /// # Errors
    /// A reference experiment that the scene does not have, or has several runs of.
    pub fn add(checked: &mut Checked, options: &mut Options, how: &BenchOptions) -> Result<Self, BenchError> {
        let mut beside =
            Self { own: Vec::new(), judges: HashMap::new(), keys: HashMap::new(), changes: HashMap::new() };
        let ground = ground_of(&checked.sources, &checked.files);
        let Some(scene) = &mut checked.scene else { return Ok(beside) };
        let names: Vec<String> = scene.runs().iter().map(|(_, run)| run.name.clone()).collect();
        let is_own = |name: &String| wanted(&options.experiments, |wanted| is_experiment(wanted, name));
        beside.own = names.iter().filter(|name| is_own(name)).cloned().collect();
        let against = how.against.as_ref().map(|name| one_run(name, &names)).transpose()?;
        let mut added = beside.add_to(scene, &ground, against.as_deref(), how.single.is_some());
        for variant in &mut scene.variants {
            added.extend(beside.add_to(variant, &ground, against.as_deref(), how.single.is_some()));
        }
        if !options.experiments.is_empty() {
            options.experiments.extend(added);
        }
        Ok(beside)
    }

    /// Adds to one world; returns the names of what was added.
    fn add_to(
        &mut self,
        scene: &mut Scene,
        ground: &blake3::Hasher,
        against: Option<&str>,
        single: bool,
    ) -> Vec<String> {
        let mut added: Vec<Experiment> = Vec::new();
        for own in &mut scene.experiments {
            // Radiance is what is judged: counts and other products would only cost.
            own.products = Products { radiance: true, truth: true, ..Products::NOTHING };
        }
        for own in &scene.experiments {
            let like = |name: String, algorithm: ModelUse| Experiment { name, algorithm, ..own.clone() };
            let is_own = self.own.contains(&own.name);
            if against.map_or(is_own, |against| against == own.name) {
                let reference = like(reference_of(&own.name), changes::exact());
                let mut hasher = ground.clone();
                feed_experiment(&mut hasher, scene, &reference);
                self.keys.insert(reference.name.clone(), hasher);
                added.push(reference);
            }
            if is_own {
                self.judges.insert(own.name.clone(), against.unwrap_or(&own.name).to_string());
            }
            for (change, algorithm) in changes::changes(&own.algorithm).into_iter().filter(|_| is_own && single) {
                let run = like(format!("{} ({}={})", own.name, change.parameter, change.to), algorithm);
                self.changes.entry(own.name.clone()).or_default().push((change, run.name.clone()));
                added.push(run);
            }
        }
        let names = added.iter().map(|run| run.name.clone()).collect();
        scene.experiments.extend(added);
        names
    }
}

/// The name of the run that renders an experiment's reference: no name of a scene holds a space.
fn reference_of(experiment: &str) -> String {
    format!("{experiment} (reference)")
}

/// The one run that a name stands for.
fn one_run(name: &str, names: &[String]) -> Result<String, BenchError> {
    let known = || list(names.iter().map(String::as_str));
    let found: Vec<&String> = names.iter().filter(|run| is_experiment(name, run)).collect();
    match found.as_slice() {
        [one] => Ok((*one).clone()),
        [] => {
            let near = nearest(name, names.iter().map(String::as_str));
            let near = near.map_or(String::new(), |near| format!("; `{near}`?"));
            Err(BenchError::Input(format!("there is no experiment `{name}`{near} (there are {})", known())))
        }
        several => Err(BenchError::Input(format!(
            "`{name}` has {} runs, and one is to judge: write its name, for example `{}`",
            several.len(),
            several[0]
        ))),
    }
}

/// Errors of a part of a run's pixels; unsaid is all.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// Label of the frame.
    pub frame: Option<String>,
    /// Name of the band.
    pub band: Option<String>,
    /// Code and name of the material at the middle of the pixel; code 0 is nothing.
    pub material: Option<(u16, String)>,
    /// Its errors.
    pub errors: Errors,
}

/// An experiment with a number of samples, seen by one sensor, all its frames together.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    /// Name of the experiment's run.
    pub experiment: String,
    /// Name of the sensor.
    pub sensor: String,
    /// Samples a pixel.
    pub samples: u32,
    /// The approximation that is changed, where one is.
    pub change: Option<Change>,
    /// The change moves no pixel.
    pub same_image: bool,
    /// Seconds of processor time to render all frames, their light solved before; of short renders the least of three.
    pub cpu_s: f64,
    /// Rays cast.
    pub rays: u64,
    /// The reference that judges, among those of the bench.
    pub reference: usize,
    /// Errors: first of all pixels, then of each part.
    pub parts: Vec<Part>,
    /// Nothing that costs less errs less, among what the sensor sees without changes.
    pub on_front: bool,
}

impl Setting {
    /// Errors of all pixels.
    pub fn errors(&self) -> &Errors {
        &self.parts[0].errors
    }

    /// The parts that a table tells of: all pixels, and without a change each band and each material.
    pub fn told(&self) -> impl Iterator<Item = &Part> {
        self.parts.iter().filter(|part| {
            let whole = part.band.is_none() && part.material.is_none();
            let one = part.band.is_none() || part.material.is_none();
            part.frame.is_none() && (whole || one && self.change.is_none())
        })
    }

    /// The part of a frame, a band and a material's code; unsaid is all.
    pub fn part(&self, frame: Option<&str>, band: Option<&str>, material: Option<u16>) -> Option<&Part> {
        self.parts.iter().find(|part| {
            part.frame.as_deref() == frame
                && part.band.as_deref() == band
                && part.material.as_ref().map(|of| of.0) == material
        })
    }
}

/// What a bench found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Bench {
    /// Settings, by experiment and sensor in the order of the plan: ascending samples, then changes.
    pub settings: Vec<Setting>,
    /// References.
    pub references: Vec<Arc<Reference>>,
}

impl Bench {
    /// The algorithm of the references, as a scene would say it.
    pub fn exact() -> String {
        changes::exact_in_words()
    }

    /// Sensors, in the order of the settings.
    pub fn sensors(&self) -> Vec<&str> {
        let mut found: Vec<&str> = Vec::new();
        for setting in &self.settings {
            if !found.contains(&setting.sensor.as_str()) {
                found.push(&setting.sensor);
            }
        }
        found
    }

    /// Samples a pixel with which each reference would judge all that it does not, where there is such.
    pub fn due(&self) -> Vec<(&Reference, u64)> {
        let due = |(i, reference): (usize, &'_ Arc<Reference>)| {
            let of = self.settings.iter().filter(|setting| setting.reference == i);
            let unjudged = of.flat_map(Setting::told).filter(|part| part.errors.n > 0 && !part.errors.is_judged());
            unjudged.map(|part| part.errors.samples_due(reference.samples)).max()
        };
        (self.references.iter().enumerate())
            .filter_map(|(i, reference)| Some((reference.as_ref(), due((i, reference))?)))
            .collect()
    }

    fn mark_fronts(&mut self) {
        let sensors: Vec<String> = self.sensors().iter().map(ToString::to_string).collect();
        for sensor in sensors {
            let mut of: Vec<&mut Setting> = (self.settings.iter_mut())
                .filter(|setting| setting.sensor == sensor && setting.change.is_none())
                .filter(|setting| setting.errors().is_judged())
                .collect();
            let points: Vec<(f64, f64)> = of.iter().map(|setting| (setting.cpu_s, setting.errors().rmse)).collect();
            for (i, on) in front(&points).into_iter().enumerate() {
                of[i].on_front = on;
            }
        }
    }
}

/// Whether no other point costs no more and errs no more, less in one of them (Pareto).
fn front(points: &[(f64, f64)]) -> Vec<bool> {
    let beats = |a: &(f64, f64), b: &(f64, f64)| a.0 <= b.0 && a.1 <= b.1 && a != b;
    points.iter().map(|point| !points.iter().any(|other| beats(other, point))).collect()
}

/// Renders the references that are wanting, the experiments with each number of samples, and each with one approximation
/// changed.
///
/// # Errors
/// A reference without a run's sensor, frames or bands; a reference that cannot be kept; the user.
pub fn bench(
    plan: &Plan,
    beside: &BenchRuns,
    how: &BenchOptions,
    progress: &dyn BenchProgress,
) -> Result<Bench, BenchError> {
    let judged: Vec<(&Run, &str, &Run)> = (plan.runs().iter())
        .filter(|run| beside.own.contains(&run.experiment))
        .map(|run| {
            let judge = beside.judges.get(&run.experiment).map_or("", String::as_str);
            Ok((run, judge, reference_run(plan, judge, run)?))
        })
        .collect::<Result<_, BenchError>>()?;
    let mut found = Bench::default();
    for (run, judge, reference_run) in judged {
        let reference = found.reference(judge, reference_run, beside, how, progress)?;
        let mut base: Option<Costed> = None;
        for samples in &how.samples {
            let name = format!("{}, {samples} samples", run.full_name());
            let costed = cost::measure(run, *samples, &name, progress)?;
            found.settings.push(found.setting(run, *samples, &costed, reference)?);
            if how.single == Some(*samples) {
                base = Some(costed);
            }
        }
        let (Some(base), Some(samples)) = (base, how.single) else { continue };
        for (change, name) in beside.changes.get(&run.experiment).into_iter().flatten() {
            let Some(changed) = plan.run(name, &run.sensor) else { continue };
            let costed = cost::measure(changed, samples, &format!("{name}/{}", run.sensor), progress)?;
            let same_image = (base.frames.frames.iter().zip(&costed.frames.frames))
                .all(|(own, changed)| own.radiance == changed.radiance);
            let setting = found.setting(run, samples, &costed, reference)?;
            found.settings.push(Setting { change: Some(change.clone()), same_image, ..setting });
        }
    }
    found.mark_fronts();
    Ok(found)
}

/// The run that renders the reference of an experiment, with the view, frames and bands of a run that it judges.
fn reference_run<'p>(plan: &'p Plan, judge: &str, run: &Run) -> Result<&'p Run, BenchError> {
    let lacks = |what: String| {
        let (own, sensor) = (&run.experiment, &run.sensor);
        BenchError::Input(format!("`{judge}` cannot judge `{own}` with sensor `{sensor}`: {what}"))
    };
    let reference =
        plan.run(&reference_of(judge), &run.sensor).ok_or_else(|| lacks("it is not seen by that sensor".into()))?;
    let missing = run.moments.iter().find(|moment| !reference.moments.iter().any(|other| other.label == moment.label));
    if reference.pixels != run.pixels {
        return Err(lacks(format!(
            "it has {} x {} pixels, not {} x {}",
            reference.pixels.0, reference.pixels.1, run.pixels.0, run.pixels.1
        )));
    }
    match missing {
        Some(moment) => Err(lacks(format!("it has no frame {}", moment.label))),
        None => Ok(reference),
    }
}

impl Bench {
    /// The index of the reference of an experiment that a run renders; runs with the same models, air and times share one.
    fn reference(
        &mut self,
        experiment: &str,
        run: &Run,
        beside: &BenchRuns,
        how: &BenchOptions,
        progress: &dyn BenchProgress,
    ) -> Result<usize, BenchError> {
        let ground = beside.keys.get(&run.experiment).cloned().unwrap_or_default();
        let key = key_of(ground, run);
        if let Some(known) = self.references.iter().position(|reference| reference.key == key) {
            return Ok(known);
        }
        let wanted = Wanted { run, experiment, folder: &how.references, key };
        self.references.push(Arc::new(wanted.get(how.goal, progress)?));
        Ok(self.references.len() - 1)
    }

    /// A run's frames, held against a reference.
    fn setting(&self, run: &Run, samples: u32, costed: &Costed, reference: usize) -> Result<Setting, BenchError> {
        let frames = &costed.frames;
        let against = &self.references[reference];
        let codes: Vec<u16> = frames.truth[0].iter().map(|code| *code as u16).collect();
        let mut cells: BTreeMap<(usize, usize, u16), Sums> = BTreeMap::new();
        for (t, frame) in frames.frames.iter().enumerate() {
            for (c, band) in frames.channels.iter().enumerate() {
                let layer = against.layer(&frame.label, &band.name).ok_or_else(|| {
                    let (label, of) = (&frame.label, &against.experiment);
                    BenchError::Input(format!("the reference of `{of}` has no band `{}` at {label}", band.name))
                })?;
                for (i, code) in codes.iter().enumerate() {
                    let (across, down) = (i as u32 % frames.width, i as u32 / frames.width);
                    let pixel = Pixel {
                        x: run.window.x + across,
                        y: run.window.y + down,
                        value: f64::from(frame.radiance[c][i]),
                        error: f64::from(frame.error[c][i]),
                        reference: f64::from(layer.mean[i]),
                        reference_error: f64::from(layer.error[i]),
                    };
                    cells.entry((t, c, *code)).or_default().add(&pixel, layer.floor, against.batches);
                }
            }
        }
        Ok(Setting {
            experiment: run.experiment.clone(),
            sensor: run.sensor.clone(),
            samples,
            change: None,
            same_image: false,
            cpu_s: costed.cpu_s,
            rays: frames.rays.cast(),
            reference,
            parts: parts(run, frames, &cells),
            on_front: false,
        })
    }
}

/// Errors of every frame or all, every band or all, every material or all.
fn parts(run: &Run, frames: &crate::Frames, cells: &BTreeMap<(usize, usize, u16), Sums>) -> Vec<Part> {
    fn all_and<T>(each: impl Iterator<Item = T>) -> Vec<Option<T>> {
        std::iter::once(None).chain(each.map(Some)).collect()
    }
    let mut codes: Vec<u16> = cells.keys().map(|(_, _, code)| *code).collect();
    codes.sort_unstable();
    codes.dedup();
    let name = |code: u16| {
        let known = run.materials.iter().find(|(known, _)| *known == code);
        known.map_or("nothing".to_string(), |(_, name)| name.clone())
    };
    let mut parts = Vec::new();
    for t in all_and(0..frames.frames.len()) {
        for c in all_and(0..frames.channels.len()) {
            for code in all_and(codes.iter().copied()) {
                let mut sums = Sums::default();
                for (key, cell) in cells {
                    if t.is_none_or(|t| t == key.0) && c.is_none_or(|c| c == key.1) && code.is_none_or(|of| of == key.2)
                    {
                        sums.merge(cell);
                    }
                }
                parts.push(Part {
                    frame: t.map(|t| frames.frames[t].label.clone()),
                    band: c.map(|c| frames.channels[c].name.clone()),
                    material: code.map(|code| (code, name(code))),
                    errors: sums.errors(),
                });
            }
        }
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_front_holds_what_nothing_beats() {
        let points = [(1.0, 5.0), (2.0, 3.0), (2.0, 4.0), (3.0, 3.5), (4.0, 1.0), (4.0, 1.0), (0.5, 9.0)];
        assert_eq!(front(&points), [true, true, false, false, true, true, true]);
        assert!(front(&[]).is_empty());
    }

    #[test]
    fn one_run_is_named_by_all_that_tells_it_apart() {
        let names = ["noon".to_string(), "haze/visibility=5km".into(), "haze/visibility=10km".into()];
        assert_eq!(one_run("noon", &names).expect("there"), "noon");
        assert_eq!(one_run("haze/visibility=5km", &names).expect("there"), "haze/visibility=5km");
        assert!(one_run("haze", &names).is_err_and(|error| error.to_string().contains("2 runs")));
        assert!(one_run("non", &names).is_err_and(|error| error.to_string().contains("`noon`?")));
    }
}
