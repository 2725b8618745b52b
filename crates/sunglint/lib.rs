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
mod cache;
mod catalog;
mod explain;
mod files;
mod frames;
mod grid;
mod plan;
mod products;
mod render;
mod report;
mod scenery;
mod times;

pub use catalog::catalog;
pub use explain::{ExplainedBand, ExplainedHit, Explanation, explain};
pub use files::Files;
pub use frames::{Frame, Frames};
pub use plan::{Options, Plan, Run, Skip};
pub use render::{Progress, RenderError, Rendered, moments_json, rays_json, render, skips_json};
pub use report::{render as render_diagnostics, to_json as diagnostics_to_json};
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
    let mut sources = Sources::default();
    let mut diagnostics = Vec::new();
    let shown = path.as_ref().to_string_lossy();
    let ast = dsl::parse(&shown, &mut files, &mut sources, &mut diagnostics);
    let scene = dsl::check(&ast, &mut sources, &catalog(), &mut files, &mut diagnostics);
    Checked { scene, sources, diagnostics, files }
}

/// Reads and checks a scene that is to be run.
///
/// # Errors
/// Where the check found an error.
pub fn open(path: impl AsRef<Path>) -> Result<Checked, Refused> {
    let checked = check(path);
    let refused = checked.scene.is_none() || checked.diagnostics.iter().any(|d| d.severity == Severity::Error);
    if refused {
        return Err(Refused { sources: checked.sources, diagnostics: checked.diagnostics });
    }
    Ok(checked)
}
