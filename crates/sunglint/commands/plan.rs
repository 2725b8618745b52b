//! `plan SCENE`: what runs, what is skipped, why.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use serde_json::{Value, json};
use sunglint::tracer::Accuracy;
use sunglint::{Plan, Run, map_json, moments_json, settings_json, skips_json};

use super::{Deny, Only, Outcome, plan_of, print, print_json};

/// What a render will compute, what it skips, and why
#[derive(Args)]
#[command(name = "plan", after_help = "Example:\n  sunglint plan examples/truth/truth.glint")]
pub struct PlanScene {
    /// The scene
    scene: PathBuf,
    #[command(flatten)]
    part: Only,
    /// As JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    deny: Deny,
}

impl PlanScene {
    pub fn run(&self, quiet: bool) -> Outcome {
        let plan = plan_of(&self.scene, &self.part.options()?, &self.deny, quiet)?;
        if self.json {
            print_json(&to_json(&plan))
        } else {
            print(text(&plan))
        }
        Ok(ExitCode::SUCCESS)
    }
}

fn accuracy(run: &Run) -> String {
    if let Some(seconds) = run.budget {
        return format!("as many samples a pixel as fit into {seconds} s, at least 16, chosen by a pilot");
    }
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
        let view = run.camera.pixels();
        out += &format!("\nexperiment {}, sensor {}\n", run.experiment, run.sensor);
        if !run.constants.is_empty() {
            let constants: Vec<String> = run.constants.iter().map(|(name, value)| format!("{name} {value}")).collect();
            out += &format!("  constants: {}\n", constants.join(", "));
        }
        out += &format!(
            "  {} x {} pixels{}, {} time{}, {} band{}: {}\n",
            run.pixels.0,
            run.pixels.1,
            match run.is_crop() {
                true => format!(" from {},{} of {} x {}", run.window.x, run.window.y, view.0, view.1),
                false => String::new(),
            },
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
        if let Some(map) = &run.map {
            let ((width, height), turned) = (map.pixel_size(), map.rotation_deg());
            let turned = if turned == 0.0 { String::new() } else { format!(", its top at {turned:.3} deg") };
            out += &format!("  map: pixels of {width:.6} x {height:.6} m{turned}\n");
        }
        if let Some(readout) = &run.readout {
            let full: Vec<String> = (run.channels.channels().iter().enumerate())
                .map(|(band, channel)| {
                    let (slope, intercept) = readout.calibration(band);
                    format!("{} {:.4}", channel.name, slope * f64::from(readout.ccd.largest()) + intercept)
                })
                .collect();
            let (bits, gain) = (readout.ccd.bits, readout.ccd.gain());
            out += &format!("  counts: {bits} bits of {gain:.3} e-, full at (W m-2 sr-1 um-1) {}\n", full.join(", "));
        }
        let models: Vec<String> = run.models.iter().map(|(material, model)| format!("{material}: {model}")).collect();
        out += &format!("  models: {}\n", models.join(", "));
        run.estimators.iter().for_each(|line| out += &format!("  estimator: {line}\n"));
        run.air_notes.iter().for_each(|line| out += &format!("  air: {line}\n"));
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
                "sweep": settings_json(&run.sweep),
                "constants": settings_json(&run.constants),
                "sensor": run.sensor,
                "pixels": [run.pixels.0, run.pixels.1],
                "times": moments_json(run),
                "bands": bands,
                "algorithm": run.algorithm_name,
                "atmosphere": run.atmosphere_name,
                "accuracy": accuracy(run),
                "time_s": run.budget,
                "grid_entries": run.grid.len(),
                "columns_solved": run.columns_solved,
                "models": run.models,
                "map": map_json(run),
                "estimators": run.estimators,
                "air_notes": run.air_notes,
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
