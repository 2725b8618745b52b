//! `check SCENE…`: diagnostics.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;
use serde_json::{Value, json};
use sunglint::{Diagnostic, Options, Plan, Severity, Sources};

use super::{Deny, Outcome, print_json, report};

/// Check scenes: every fault that can be found, each with its place and a cure
#[derive(Args)]
#[command(after_help = "\
Examples:
  sunglint check examples/truth/truth.glint
  sunglint check --deny warnings --json examples/minimal/minimal.glint examples/truth/truth.glint

docs/DIAGNOSTICS.md explains the codes; docs/diagnostics.schema.json is the schema of the JSON.
Exit codes: 0 no error, 2 errors, or warnings that were denied")]
pub struct Check {
    /// The scenes
    #[arg(required = true)]
    scenes: Vec<PathBuf>,
    /// Diagnostics of all scenes as one JSON array on the output stream
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    deny: Deny,
}

impl Check {
    pub fn run(&self, quiet: bool) -> Outcome {
        let mut all = Vec::new();
        let mut refused = false;
        for scene in &self.scenes {
            let (mut diagnostics, sources) = findings(scene);
            self.deny.raise(&mut diagnostics);
            let errors = diagnostics.iter().filter(|d| d.severity == Severity::Error).count();
            refused |= errors > 0;
            if self.json {
                all.extend(listed(scene, &diagnostics, &sources));
                continue;
            }
            report(&diagnostics, &sources);
            let warnings = diagnostics.len() - errors;
            let plural = |n: usize| if n == 1 { "" } else { "s" };
            if !quiet || errors > 0 {
                super::note(&format!(
                    "{}: {errors} error{}, {warnings} warning{}",
                    scene.display(),
                    plural(errors),
                    plural(warnings)
                ));
            }
        }
        if self.json {
            print_json(&Value::Array(all));
        }
        Ok(if refused { ExitCode::from(2) } else { ExitCode::SUCCESS })
    }
}

/// What the check finds; a scene that reads well is bound too: meshes, times, spectra against bands.
fn findings(scene: &Path) -> (Vec<Diagnostic>, Sources) {
    match sunglint::open(scene)
        .and_then(|checked| Plan::new(checked, &Options { light_at_once: Some(0), ..Options::default() }))
    {
        Ok(plan) => (plan.warnings, plan.sources),
        Err(refused) => (refused.diagnostics, refused.sources),
    }
}

/// The diagnostics with the scene that they belong to.
fn listed(scene: &Path, diagnostics: &[Diagnostic], sources: &Sources) -> Vec<Value> {
    let Value::Array(mut list) = sunglint::diagnostics_to_json(diagnostics, sources) else { return Vec::new() };
    for diagnostic in &mut list {
        diagnostic["scene"] = json!(scene.to_string_lossy());
    }
    list
}
