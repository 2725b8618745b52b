//! `render SCENE -o DIR`: frames.

use std::io::IsTerminal;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use clap::Args;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use sunglint::{Options, Progress, RenderError, Rendered, Run, Tally};

use super::{Deny, Failure, Only, Outcome, note, plan_of};

/// Render a scene's frames
#[derive(Args)]
#[command(after_help = "\
Example:
  sunglint render examples/truth/truth.glint -o out/truth

Writes DIR/EXPERIMENT/SENSOR/TIME/: radiance.exr, radiance.img/.hdr (ENVI), error.exr, previews; truth.exr once a \
sensor; manifest.json. A second render of an unchanged scene does no work; a killed one goes on at its last tile.

Part of it:
  --only experiment=haze --only time=1992-06-18T16:00:00Z --only band=red --only crop=100,80,64x48
experiment: a name with all runs of its sweep, one run (haze/visibility=5km,…) or some of its settings. time: a frame's \
name, an instant, or the beginning of a name (1992-06-18). crop: pixels of the whole view, as it is after scale. Under \
`samples` no selection changes a pixel's value; under `error` fewer times or bands may need fewer samples.
A run's folder holds one render: a selection is not written over a render that holds more.")]
pub struct Render {
    /// The scene
    scene: PathBuf,
    /// Folder to write to
    #[arg(long, short, default_value = "out")]
    out: PathBuf,
    #[command(flatten)]
    part: Only,
    /// Samples a pixel in place of the experiments' accuracy
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=65_536))]
    samples: Option<u32>,
    #[command(flatten)]
    deny: Deny,
}

impl Render {
    pub fn run(&self, quiet: bool) -> Outcome {
        let options = Options { samples: self.samples, ..self.part.options()? };
        let plan = plan_of(&self.scene, &options, &self.deny, quiet)?;
        let bar = Bar::new(quiet);
        match sunglint::render(&plan, &self.out, &bar) {
            Ok(_) => Ok(ExitCode::SUCCESS),
            Err(error @ RenderError::Mixed { .. }) => Err(Failure::BadInput(error.to_string())),
            Err(error) => Err(Failure::Unfinished(error.to_string())),
        }
    }
}

/// A bar on a terminal, a line a run elsewhere, nothing when quiet.
struct Bar {
    bar: ProgressBar,
    quiet: bool,
}

impl Bar {
    fn new(quiet: bool) -> Self {
        let shown = !quiet && std::io::stderr().is_terminal();
        let target = if shown { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        let bar = ProgressBar::with_draw_target(Some(0), target);
        let style = ProgressStyle::with_template("{prefix} {bar:30} {percent:>3} % of {len} tiles, {eta} left {msg}");
        if let Ok(style) = style {
            bar.set_style(style);
        }
        Self { bar, quiet }
    }
}

impl Progress for Bar {
    fn begin(&self, runs: &[&Run], tiles: usize) {
        self.bar.reset();
        self.bar.set_length(tiles as u64);
        self.bar.set_position(0);
        let further = match runs.len() {
            0 | 1 => String::new(),
            n => format!(" and {} more on its paths", n - 1),
        };
        let part = match runs.first().map_or(1, |run| run.parts().count()) {
            0 | 1 => String::new(),
            n => format!(", one of {n} parts"),
        };
        let name = runs.first().map_or_else(String::new, |run| run.full_name());
        self.bar.set_prefix(format!("{name}{further}{part}"));
        self.bar.set_message("");
        self.bar.enable_steady_tick(Duration::from_millis(200));
    }

    fn tile(&self, _cached: bool, so_far: &Tally) {
        let rate = so_far.rays as f64 / self.bar.elapsed().as_secs_f64().max(1e-9);
        self.bar.set_message(format!("{:.2} Mray/s, ± {:.2} %", rate / 1e6, 100.0 * so_far.relative_error()));
        self.bar.inc(1);
    }

    fn end(&self, run: &Run, rendered: &Rendered) {
        self.bar.disable_steady_tick();
        self.bar.finish_and_clear();
        if self.quiet {
            return;
        }
        let (name, folder) = (run.full_name(), rendered.folder.display());
        if rendered.frames == 0 {
            note(&format!("{name}: unchanged, nothing to do ({folder})"));
            return;
        }
        let rays = &rendered.rays;
        let cast = rays.cast();
        let samples = match rendered.timed_samples {
            Some(n) => format!(", {n} samples a pixel"),
            None => String::new(),
        };
        let resumed = match rendered.tiles_resumed {
            0 => String::new(),
            n => format!(", {n} tiles from before"),
        };
        let time = match &rendered.traced_with {
            None => format!("in {:.1} s and", rendered.seconds.0),
            Some(other) => format!("on the paths of {other},"),
        };
        note(&format!(
            "{name}: {} frame{} {time} {:.1} s of writing, {:.1} million rays{samples}, ± {:.2} %{resumed} ({folder})",
            rendered.frames,
            if rendered.frames == 1 { "" } else { "s" },
            rendered.seconds.1,
            cast as f64 / 1e6,
            100.0 * rendered.tally.relative_error(),
        ));
    }
}
