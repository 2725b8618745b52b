//! Sunglint makes radiometrically correct synthetic images of outdoor scenes as a remote sensor records them between
//! 0.4 and 1.0 µm.
//!
//! ```no_run
//! let checked = sunglint::open("examples/minimal/minimal.glint")?;
//! let plan = sunglint::Plan::new(checked, &sunglint::Options::default())?;
//! let frames = plan.runs()[0].render();
//! println!("{}", frames.digest());
//! # Ok::<(), sunglint::Refused>(())
//! ```

mod air;
mod bench;
mod cache;
mod catalog;
mod clock;
mod comparison;
mod explain;
mod files;
mod forecast;
mod frames;
mod grid;
pub mod inspection;
mod lit;
mod pilot;
mod plan;
pub mod plot;
mod products;
mod readout;
mod render;
mod report;
mod scenery;
mod selection;
mod snapshot;
mod times;

pub use bench::{
    Bench, BenchError, BenchOptions, BenchProgress, BenchRuns, Change, Errors, Part, Reference, ReferenceGoal, Setting,
    WorstError, bench,
};
pub use catalog::catalog;
pub use comparison::{
    BandComparison, Beside, CompareError, Comparison, Materials, OfMaterial, PairedBy, Pairing, Statistics, Worst,
    before_after_picture, compare_images, difference_picture, pair_bands, scatter_picture,
};
pub use explain::{ExplainedBand, ExplainedHit, Explanation, explain};
pub use files::Files;
pub use forecast::Forecast;
pub use frames::{Frame, Frames};
pub use lit::Lit;
pub use plan::{BandShare, LeftOut, Options, Plan, Run, Sharing, Skip};
pub use products::{Image, ImageBand, MapProjection, ReadError, Samples, read_image, write_whole};
pub use readout::Readout;
pub use render::{
    Progress, RenderError, Rendered, Tally, map_json, moments_json, rays_json, render, settings_json, skips_json,
};
pub use report::{render as render_diagnostics, to_json as diagnostics_to_json};
pub use scenery::ObjectIds;
pub use selection::Crop;
pub use snapshot::{FoundScenes, SnapshotError, TestOutcome, TestedRun, TestedScene, find_scenes, test_scene};
pub use sunglint_dsl::{Diagnostic, Severity, Sources};
pub use times::{Moment, iso, parse_utc, sun_at};

pub use sunglint_atmosphere as atmosphere;
pub use sunglint_dsl as dsl;
pub use sunglint_geometry as geometry;
pub use sunglint_plugin as plugin;
pub use sunglint_radiometry as radiometry;
pub use sunglint_reflectance as reflectance;
pub use sunglint_sensor as sensor;
pub use sunglint_tracer as tracer;

use std::io::Write;
use std::path::Path;

/// A scene that was read and checked, with everything a diagnostic may point into.
pub struct Checked {
    /// The scene; `None` where an error was found.
    pub scene: Option<dsl::Scene>,
    /// Its files.
    pub sources: Sources,
    /// What was found, errors and warnings.
    pub diagnostics: Vec<Diagnostic>,
    /// Files that were read, with their hashes.
    pub files: Files,
}

impl Checked {
    /// The same where no error was found.
    ///
    /// # Errors
    /// Where one was.
    pub fn sound(self) -> Result<Self, Refused> {
        if self.scene.is_none() || self.diagnostics.iter().any(|d| d.severity == Severity::Error) {
            return Err(Refused { sources: self.sources, diagnostics: self.diagnostics });
        }
        Ok(self)
    }
}

/// A scene that does not run, with the reasons as data.
#[derive(Debug)]
pub struct Refused {
    /// Its files.
    pub sources: Sources,
    /// What was found.
    pub diagnostics: Vec<Diagnostic>,
}

impl std::fmt::Display for Refused {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&render_diagnostics(&self.diagnostics, &self.sources, false))
    }
}

impl std::error::Error for Refused {}

/// Reads and checks a scene, and reports all that can be found in one go.
pub fn check(path: impl AsRef<Path>) -> Checked {
    let mut files = Files::default();
    check_by(&path.as_ref().to_string_lossy(), &mut files).with(files)
}

/// Checks a text as if it stood in a file of this path, which need not exist; the files that it names are read beside it.
pub fn check_text(path: &str, text: impl Into<String>) -> Checked {
    let mut given = files::Given::new(path, text.into());
    check_by(path, &mut given).with(given.into_files())
}

/// What a check finds, before the files that it read are handed over.
struct Findings(Option<dsl::Scene>, Sources, Vec<Diagnostic>);

impl Findings {
    fn with(self, files: Files) -> Checked {
        let Self(scene, sources, diagnostics) = self;
        Checked { scene, sources, diagnostics, files }
    }
}

fn check_by(path: &str, loader: &mut dyn dsl::Loader) -> Findings {
    let mut sources = Sources::default();
    let mut diagnostics = Vec::new();
    let ast = dsl::parse(path, loader, &mut sources, &mut diagnostics);
    let scene = dsl::check(&ast, &mut sources, &catalog(), loader, &mut diagnostics);
    Findings(scene, sources, diagnostics)
}

/// The text of a scene file, laid out as `docs/LANGUAGE.md` section 6 says. `path` is its name in messages.
///
/// # Errors
/// Where the text has a fault of shape, with the findings.
pub fn format(path: &str, bytes: &[u8]) -> Result<String, Refused> {
    let (mut sources, mut diagnostics) = (Sources::default(), Vec::new());
    dsl::format(path, bytes, &mut sources, &mut diagnostics).ok_or(Refused { sources, diagnostics })
}

/// Replaces a file by `bytes`, whole or not at all; a link stays a link, and permissions stay.
///
/// # Errors
/// Those of the file system, with the path in the message.
pub fn replace_file(path: impl AsRef<Path>, bytes: &[u8]) -> std::io::Result<()> {
    let path = std::fs::canonicalize(path)?;
    let permissions = std::fs::metadata(&path)?.permissions();
    products::write_whole(&path, |out| {
        out.write_all(bytes)?;
        out.get_ref().set_permissions(permissions)
    })
}

/// Reads and checks a scene that is to be run.
///
/// # Errors
/// Where the check found an error.
pub fn open(path: impl AsRef<Path>) -> Result<Checked, Refused> {
    check(path).sound()
}
