//! `test PATH…`: scenes against their snapshots.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use serde_json::{Value, json};
use sunglint::{BandComparison, SnapshotError, TestOutcome, TestedRun, TestedScene, find_scenes, test_scene};

use super::compare::excess;
use super::{Failure, Outcome, note, print, print_json, report};

/// Bands and materials of a run that the text tells of; `--json` tells of all.
const SHOWN: usize = 4;

/// Render scenes small and hold them against the snapshots beside them
#[derive(Args)]
#[command(after_help = "\
Examples:
  sunglint test studies                 every scene beneath the folder with a `snapshot` statement
  sunglint test studies --accept        what is rendered now becomes the snapshot
  sunglint test noon.glint --filter phong/roof

A folder is searched for scenes that have a `snapshot` statement of their own; other files, such as libraries that scenes \
include, are skipped. A scene that is named is tested with or without the statement. A scene is rendered at the pixels and \
for the experiments of its statement (64 x 48, all), with each experiment's own accuracy and seed, so that the same program \
gives the same bits.

Snapshots of NAME.glint stand in NAME.snap: EXPERIMENT/SENSOR.exr holds every frame and band, EXPERIMENT/SENSOR.json the \
means in words. A run passes where for every frame and band the RMSE, over the picture and over each material, is at most \
the statement's tolerance (0.1 %) of the mean. For a run that moved, EXPERIMENT/SENSOR.moved.png shows before, after and \
difference. --accept writes a scene's new snapshots, all or none, and removes those that no run has any more.

Exit codes: 0 all passed or accepted, 1 something moved or is new, 2 a scene does not run")]
pub struct Test {
    /// Folders or scenes
    #[arg(required = true)]
    paths: Vec<PathBuf>,
    /// Keep what is rendered now as the snapshots
    #[arg(long)]
    accept: bool,
    /// Only runs whose `SCENE EXPERIMENT/SENSOR` contains this
    #[arg(long, value_name = "NAME", default_value = "", hide_default_value = true)]
    filter: String,
    /// As JSON
    #[arg(long)]
    json: bool,
}

#[derive(Default)]
struct Counts {
    passed: usize,
    accepted: usize,
    moved: usize,
    new: usize,
    bad: usize,
}

impl Test {
    pub fn run(&self, quiet: bool) -> Outcome {
        let (mut scenes, mut orphans, mut skipped) = (Vec::new(), Vec::new(), 0);
        for path in &self.paths {
            if path.is_dir() {
                let found = find_scenes(path).map_err(|error| Failure::BadInput(error.to_string()))?;
                scenes.extend(found.scenes);
                orphans.extend(found.orphans);
                skipped += found.skipped.len();
            } else if path.is_file() {
                scenes.push(path.clone());
            } else {
                return Err(Failure::BadInput(format!("there is no `{}`", path.display())));
            }
        }
        if scenes.is_empty() {
            let help = "write `snapshot {}` into a scene, or name the scene";
            return Err(Failure::BadInput(format!("none of {skipped} scenes has a `snapshot` statement; {help}")));
        }
        let mut counts = Counts::default();
        let mut rows = Vec::new();
        for scene in &scenes {
            match test_scene(scene, &self.filter, self.accept) {
                Ok(tested) => {
                    counts.add(&tested);
                    orphans.extend(tested.orphans.iter().cloned());
                    if !self.json {
                        print(text(&tested, quiet));
                    }
                    rows.extend(tested.runs.iter().map(|run| to_json(&tested, run)));
                }
                Err(SnapshotError::Refused(refused)) => {
                    counts.bad += 1;
                    report(&refused.diagnostics, &refused.sources);
                    rows.push(json!({"scene": scene.display().to_string(), "status": "bad"}));
                    if !self.json {
                        print(format_args!("{}: does not run\n", scene.display()));
                    }
                }
                Err(error) => return Err(Failure::Unfinished(error.to_string())),
            }
        }
        let gone = if self.accept { "removed, or a folder without its scene" } else { "belongs to no run" };
        if self.json {
            print_json(&json!({
                "runs": rows,
                "orphans": orphans.iter().map(|path| path.display().to_string()).collect::<Vec<_>>(),
                "passed": counts.passed,
                "accepted": counts.accepted,
                "moved": counts.moved,
                "new": counts.new,
                "bad_scenes": counts.bad,
                "scenes_skipped": skipped,
            }));
        } else {
            orphans.iter().for_each(|orphan| print(format_args!("orphan {} ({gone})\n", orphan.display())));
            print(counts.text());
        }
        if !quiet && counts.moved + counts.new > 0 {
            note("`--accept` keeps what is rendered now");
        }
        Ok(match (counts.bad, counts.moved + counts.new) {
            (0, 0) => ExitCode::SUCCESS,
            (0, _) => ExitCode::from(1),
            _ => ExitCode::from(2),
        })
    }
}

impl Counts {
    fn add(&mut self, tested: &TestedScene) {
        for run in &tested.runs {
            *match (&run.outcome, run.accepted) {
                (_, true) => &mut self.accepted,
                (TestOutcome::Passed, _) => &mut self.passed,
                (TestOutcome::Moved { .. }, _) => &mut self.moved,
                (TestOutcome::New, _) => &mut self.new,
            } += 1;
        }
    }

    fn text(&self) -> String {
        let parts = [
            (self.passed, "passed"),
            (self.accepted, "accepted"),
            (self.moved, "moved"),
            (self.new, "new"),
            (self.bad, "bad"),
        ];
        let said: Vec<String> = parts
            .iter()
            .filter(|(n, name)| *n > 0 || *name == "passed")
            .map(|(n, name)| format!("{n} {name}"))
            .collect();
        format!("{}\n", said.join(", "))
    }
}

fn status(run: &TestedRun) -> &'static str {
    match (&run.outcome, run.accepted) {
        (_, true) => "accepted",
        (TestOutcome::Passed, _) => "passed",
        (TestOutcome::Moved { .. }, _) => "moved",
        (TestOutcome::New, _) => "new",
    }
}

fn text(tested: &TestedScene, quiet: bool) -> String {
    let mut out = String::new();
    for run in &tested.runs {
        if quiet && status(run) == "passed" {
            continue;
        }
        out += &format!("{} {}/{}: {}\n", tested.scene.display(), run.experiment, run.sensor, status(run));
        let TestOutcome::Moved { bands, notes } = &run.outcome else { continue };
        notes.iter().take(SHOWN).for_each(|note| out += &format!("  {note}\n"));
        if notes.len() > SHOWN {
            out += &format!("  and {} more like these\n", notes.len() - SHOWN);
        }
        for band in bands.iter().take(SHOWN) {
            out += &format!("  {}: {}\n", band.name_a, excess(&band.statistics));
            let moved = moved_materials(band, tested.tolerance);
            for of in moved.iter().take(SHOWN) {
                out += &format!("    {}: {}\n", of.name, excess(&of.statistics));
            }
            if moved.len() > SHOWN {
                out += &format!("    and {} more materials\n", moved.len() - SHOWN);
            }
        }
        if bands.len() > SHOWN {
            out += &format!("  and {} more frames and bands\n", bands.len() - SHOWN);
        }
        if let Some(picture) = &run.picture {
            out += &format!("  before, after and difference: {}\n", picture.display());
        }
    }
    out
}

/// Materials beyond the tolerance, the largest relative RMSE first.
fn moved_materials(band: &BandComparison, tolerance: f64) -> Vec<&sunglint::OfMaterial> {
    let mut moved: Vec<&sunglint::OfMaterial> =
        band.materials.iter().filter(|of| of.statistics.exceeds(tolerance)).collect();
    let far = |of: &sunglint::OfMaterial| of.statistics.relative_rmse().unwrap_or(f64::INFINITY);
    moved.sort_by(|a, b| far(b).total_cmp(&far(a)));
    moved
}

fn to_json(tested: &TestedScene, run: &TestedRun) -> Value {
    let mut row = json!({
        "scene": tested.scene.display().to_string(),
        "experiment": run.experiment,
        "sensor": run.sensor,
        "status": status(run),
        "tolerance": tested.tolerance,
        "picture": run.picture.as_ref().map(|path| path.display().to_string()),
    });
    if let TestOutcome::Moved { bands, notes } = &run.outcome {
        row["notes"] = json!(notes);
        row["bands"] = bands.iter().map(BandComparison::to_json).collect();
    }
    row
}
