//! `check SCENE`: diagnostics.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use sunglint::{Options, Plan, Severity};

use super::{Outcome, print_json, report};

/// Check a scene: every fault that can be found, each with its place and a cure
#[derive(Args)]
#[command(after_help = "Example:\n  sunglint check examples/truth/truth.glint")]
pub struct Check {
    /// The scene
    scene: PathBuf,
    /// Diagnostics as JSON on the output stream
    #[arg(long)]
    json: bool,
}

impl Check {
    pub fn run(&self, quiet: bool) -> Outcome {
        let checked = sunglint::check(&self.scene);
        let clean = checked.scene.is_some() && checked.diagnostics.iter().all(|d| d.severity != Severity::Error);
        // A scene that reads well is bound too: meshes, times, spectra against bands.
        let (diagnostics, sources) = if clean {
            match Plan::new(checked, &Options::default()) {
                Ok(plan) => (plan.warnings, plan.sources),
                Err(refused) => (refused.diagnostics, refused.sources),
            }
        } else {
            (checked.diagnostics, checked.sources)
        };
        let errors = diagnostics.iter().filter(|d| d.severity == Severity::Error).count();
        if self.json {
            print_json(&sunglint::diagnostics_to_json(&diagnostics, &sources));
        } else {
            report(&diagnostics, &sources);
            let warnings = diagnostics.len() - errors;
            let plural = |n: usize| if n == 1 { "" } else { "s" };
            if !quiet || errors > 0 {
                super::note(&format!(
                    "{}: {errors} error{}, {warnings} warning{}",
                    self.scene.display(),
                    plural(errors),
                    plural(warnings)
                ));
            }
        }
        Ok(if errors > 0 { ExitCode::from(2) } else { ExitCode::SUCCESS })
    }
}
