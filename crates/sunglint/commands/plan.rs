//! `plan SCENE`: what runs, what is skipped, why.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use serde_json::{Value, json};
use sunglint::tracer::Accuracy;
use sunglint::{Forecast, Plan, Run, Sharing, map_json, moments_json, settings_json, skips_json};

use super::{Deny, Only, Outcome, plan_of, print, print_json};

/// What a render will compute, what it skips, and why
#[derive(Args)]
#[command(
    name = "plan",
    after_help = "\
Example:
  sunglint plan examples/truth/truth.glint
  sunglint plan examples/truth/truth.glint --measure

For each experiment and sensor the plan tells what its times and bands share, what each further one adds, and what the \
run has in common with others. With --measure a few blocks of pixels are rendered and thrown away, at up to three of the \
times: how many rays all pixels will take, and how much processor time tracing takes and lighting each time, but for the \
air that is solved along lines of sight. The manifest of a render tells what they took."
)]
pub struct PlanScene {
    /// The scene
    scene: PathBuf,
    #[command(flatten)]
    part: Only,
    /// Render a few blocks of pixels and tell what all will take
    #[arg(long)]
    measure: bool,
    /// As JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    deny: Deny,
}

impl PlanScene {
    pub fn run(&self, quiet: bool) -> Outcome {
        let plan = plan_of(&self.scene, &self.part.options()?, &self.deny, quiet)?;
        let forecasts: Vec<Option<Forecast>> =
            plan.runs().iter().map(|run| self.measure.then(|| run.forecast())).collect();
        if self.json {
            print_json(&to_json(&plan, &forecasts))
        } else {
            print(text(&plan, &forecasts))
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
        Accuracy::Error { relative, most, every_pixel, .. } => {
            let of = if every_pixel { "of each pixel" } else { "over the image, in the root mean square" };
            format!("standard error {} % {of}, 16 to {most} samples", relative * 100.0)
        }
    }
}

fn count(n: usize, what: &str) -> String {
    format!("{n} {what}{}", if n == 1 { "" } else { "s" })
}

/// `1234 rays`, `1.2 million rays`.
fn rays(n: f64) -> String {
    if n < 1e5 { format!("{n:.0}") } else { format!("{:.3} million", n / 1e6) }
}

fn bytes(n: u64) -> String {
    if n < 100_000 { format!("{n} bytes") } else { format!("{:.1} MB", n as f64 / 1e6) }
}

/// What times, bands and runs share, and what each further one adds, a line each.
fn shared(run: &Run, sharing: &Sharing) -> Vec<String> {
    let (least, most) = (*sharing.camera_rays.start() as f64, *sharing.camera_rays.end());
    let camera = match most {
        most if most as f64 == least => format!("{} camera rays", rays(least)),
        u64::MAX => format!("at least {} camera rays", rays(least)),
        most => format!("{} to {} camera rays", rays(least), rays(most as f64)),
    };
    let chosen = match run.accuracy {
        Accuracy::Error { .. } => ", as many as the worst time and band need",
        Accuracy::Samples(_) => "",
    };
    let per_time = bytes(sharing.bytes_per_time);
    let times = match run.moments.len() {
        1 => "a further time would light the same paths".to_string(),
        n => format!("all {n} times light the same paths, since neither sensor nor objects move between them"),
    };
    let mut lines = vec![
        format!("paths: {camera} for all times and bands{chosen}"),
        format!(
            "times: {times}; each adds its light, at most a sun ray a surface met, and {per_time} of finished tiles"
        ),
    ];
    let each: Vec<String> = sharing.bands.iter().map(|band| format!("{} {}", band.name, band.nodes)).collect();
    let few = if each.len() > 16 { format!("{} …", each[..16].join(", ")) } else { each.join(", ") };
    let entries: usize = sharing.bands.iter().map(|band| band.grid_entries).sum();
    lines.push(format!(
        "bands: a path carries {}: {few}; each adds these, its part of {entries} grid entries, and no ray",
        count(sharing.bands.iter().map(|band| band.nodes).sum(), "value"),
    ));
    let with = |what: &str, runs: &[String]| (!runs.is_empty()).then(|| format!("{what} with {}", named(runs)));
    let common: Vec<String> = [
        with("geometry", &sharing.geometry_with),
        with("surfaces", &sharing.surfaces_with),
        with("air", &sharing.air_with),
        with("the points that are sampled", &sharing.samples_with),
    ]
    .into_iter()
    .flatten()
    .collect();
    if !common.is_empty() {
        let own = match sharing.paths_with.as_slice() {
            [] => "paths and their light are each run's own".to_string(),
            with => format!("paths too with {}, which adds its light alone", named(with)),
        };
        lines.push(format!("shared: {}; {own}", common.join(", ")));
    }
    for why in ["another geometry", "another view", "another seed"] {
        let apart: Vec<String> =
            sharing.samples_apart.iter().filter(|(_, because)| *because == why).map(|(name, _)| name.clone()).collect();
        if !apart.is_empty() {
            lines.push(format!("samples other points than {}: {why}", named(&apart)));
        }
    }
    lines
}

/// Up to two names, or how many there are.
fn named(runs: &[String]) -> String {
    if runs.len() > 2 { format!("{} other runs", runs.len()) } else { runs.join(" and ") }
}

fn measured(forecast: &Forecast) -> String {
    let Forecast { trace_cpu_s, light_cpu_s_per_time, .. } = forecast;
    let caustic = match forecast.caustic_per_time {
        0.0 => String::new(),
        n => format!(" and {} by way of mirrors", rays(n)),
    };
    format!(
        "  measured on {} pixels, for {} samples a pixel: all times share {} hemisphere and {} mirror rays, and {trace_cpu_s:.3} s \
         of processor time\n  measured, a time adds: {} sun rays ({} more are proved unnecessary){caustic}, {light_cpu_s_per_time:.3} s, \
         {:.0} % of what all share\n",
        forecast.pixels,
        forecast.samples,
        rays(forecast.hemisphere),
        rays(forecast.mirror),
        rays(forecast.sun_per_time),
        rays(forecast.sun_skipped_per_time),
        100.0 * light_cpu_s_per_time / trace_cpu_s.max(1e-9),
    )
}

fn text(plan: &Plan, forecasts: &[Option<Forecast>]) -> String {
    let mut out = String::new();
    if let Some(title) = &plan.title {
        out += &format!("{title}\n");
    }
    out += &format!("{} facets, {:.1} MB of geometry\n", plan.facets, plan.geometry_bytes as f64 / 1e6);
    for (run, forecast) in plan.runs().iter().zip(forecasts) {
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
        if let (n @ 2.., Some(most)) = (run.parts().count(), run.parts().map(|times| times.len()).max()) {
            out += &format!(
                "  in {n} parts of up to {}: the light of all is more than is kept at a time; paths are traced anew for each\n",
                count(most, "time"),
            );
        }
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
        shared(run, &plan.sharing(run)).iter().for_each(|line| out += &format!("  {line}\n"));
        out += &forecast.as_ref().map_or(String::new(), measured);
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

fn sharing_json(sharing: &Sharing) -> Value {
    let apart: Vec<Value> = sharing.samples_apart.iter().map(|(run, why)| json!({"run": run, "why": why})).collect();
    let most = *sharing.camera_rays.end();
    json!({
        "camera_rays_least": sharing.camera_rays.start(),
        "camera_rays_most": (most < u64::MAX).then_some(most),
        "tile_bytes_per_time": sharing.bytes_per_time,
        "geometry_with": sharing.geometry_with,
        "surfaces_with": sharing.surfaces_with,
        "air_with": sharing.air_with,
        "samples_with": sharing.samples_with,
        "paths_with": sharing.paths_with,
        "samples_apart": apart,
    })
}

fn forecast_json(forecast: &Forecast) -> Value {
    json!({
        "pixels": forecast.pixels,
        "samples_per_pixel": forecast.samples,
        "rays": {"camera": forecast.camera, "hemisphere": forecast.hemisphere, "mirror": forecast.mirror},
        "rays_per_time": {
            "sun": forecast.sun_per_time,
            "sun_skipped": forecast.sun_skipped_per_time,
            "caustic": forecast.caustic_per_time,
        },
        "trace_cpu_s": forecast.trace_cpu_s,
        "light_cpu_s_per_time": forecast.light_cpu_s_per_time,
    })
}

fn to_json(plan: &Plan, forecasts: &[Option<Forecast>]) -> Value {
    let runs: Vec<Value> = (plan.runs().iter().zip(forecasts))
        .map(|(run, forecast)| {
            let sharing = plan.sharing(run);
            let bands: Vec<Value> = (run.channels.channels().iter().zip(&sharing.bands))
                .map(|(c, share)| {
                    json!({
                        "name": c.name,
                        "centre_nm": c.centre.nm(),
                        "fwhm_nm": c.fwhm * 1e3,
                        "nodes": share.nodes,
                        "grid_entries": share.grid_entries,
                    })
                })
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
                "parts": run.parts().count(),
                "models": run.models,
                "map": map_json(run),
                "shares": sharing_json(&sharing),
                "measured": forecast.as_ref().map(forecast_json),
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
