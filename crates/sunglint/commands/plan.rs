//! `plan SCENE`: what runs, what is skipped, why.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use serde_json::{Value, json};
use sunglint::tracer::Accuracy;
use sunglint::{Options, Plan, Run, moments_json, skips_json};

use super::{Deny, Outcome, plan_of, print, print_json};

/// What a render will compute, what it skips, and why
#[derive(Args)]
#[command(name = "plan", after_help = "Example:\n  sunglint plan examples/truth/truth.glint")]
pub struct PlanScene {
    /// The scene
    scene: PathBuf,
    /// As JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    deny: Deny,
}

impl PlanScene {
    pub fn run(&self, quiet: bool) -> Outcome {
        let plan = plan_of(&self.scene, &Options::default(), &self.deny, quiet)?;
        if self.json {
            print_json(&to_json(&plan))
        } else {
            print(text(&plan))
        }
        Ok(ExitCode::SUCCESS)
    }
}

fn accuracy(run: &Run) -> String {
    match run.accuracy {
        Accuracy::Samples(n) => format!("{} samples a pixel", n.next_multiple_of(16)),
        Accuracy::Error { relative, most, .. } => {
            format!("standard error {} % of each pixel, 16 to {most} samples", relative * 100.0)
        }
    }
}

fn text(plan: &Plan) -> String {
    let mut out = String::new();
    if let Some(title) = &plan.title {
        out += &format!("{title}\n");
    }
    out += &format!("{} facets, {:.1} MB of geometry\n", plan.facets, plan.geometry_bytes as f64 / 1e6);
    for run in plan.runs() {
        let bands: Vec<String> = (run.channels.channels().iter())
            .map(|c| format!("{} ({:.0} nm, fwhm {:.0} nm)", c.name, c.centre.nm(), c.fwhm * 1e3))
            .collect();
        out += &format!("\nexperiment {}, sensor {}\n", run.experiment, run.sensor);
        out += &format!(
            "  {} x {} pixels, {} time{}, {} band{}: {}\n",
            run.pixels.0,
            run.pixels.1,
            run.moments.len(),
            if run.moments.len() == 1 { "" } else { "s" },
            bands.len(),
            if bands.len() == 1 { "" } else { "s" },
            bands.join(", ")
        );
        if let (Some(first), Some(last)) = (run.moments.first(), run.moments.last()) {
            out += &format!("  from {} to {}\n", first.label, last.label);
        }
        out += &format!("  algorithm {}, atmosphere {}, {}\n", run.algorithm_name, run.atmosphere_name, accuracy(run));
        out += &format!(
            "  {} grid entries; {} column{} of air solved for {} sun{}\n",
            run.grid.len(),
            run.columns_solved,
            if run.columns_solved == 1 { "" } else { "s" },
            run.moments.len(),
            if run.moments.len() == 1 { "" } else { "s" },
        );
        let models: Vec<String> = run.models.iter().map(|(material, model)| format!("{material}: {model}")).collect();
        out += &format!("  models: {}\n", models.join(", "));
        run.estimators.iter().for_each(|line| out += &format!("  estimator: {line}\n"));
        run.skips.iter().for_each(|skip| out += &format!("  skipped: {} ({})\n", skip.what, skip.why));
    }
    if !plan.skips.is_empty() {
        out += "\nthe scene as a whole\n";
        plan.skips.iter().for_each(|skip| out += &format!("  skipped: {} ({})\n", skip.what, skip.why));
    }
    out
}

fn to_json(plan: &Plan) -> Value {
    let runs: Vec<Value> = (plan.runs().iter())
        .map(|run| {
            let bands: Vec<Value> = (run.channels.channels().iter())
                .map(|c| json!({"name": c.name, "centre_nm": c.centre.nm(), "fwhm_nm": c.fwhm * 1e3}))
                .collect();
            json!({
                "experiment": run.experiment,
                "sensor": run.sensor,
                "pixels": [run.pixels.0, run.pixels.1],
                "times": moments_json(run),
                "bands": bands,
                "algorithm": run.algorithm_name,
                "atmosphere": run.atmosphere_name,
                "accuracy": accuracy(run),
                "grid_entries": run.grid.len(),
                "columns_solved": run.columns_solved,
                "models": run.models,
                "estimators": run.estimators,
                "skips": skips_json(&run.skips),
            })
        })
        .collect();
    json!({
        "title": plan.title,
        "facets": plan.facets,
        "geometry_bytes": plan.geometry_bytes,
        "runs": runs,
        "skips": skips_json(&plan.skips),
    })
}
