//! `explain SCENE --pixel X,Y`: every term of one pixel.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use sunglint::inspection::time_of;
use sunglint::{Options, Run, explain};

use super::{Failure, Outcome, plan_of, print, print_json};

/// Every term of one pixel
#[derive(Args)]
#[command(
    after_help = "Example:\n  sunglint explain examples/truth/truth.glint --pixel 320,240 --at 1992-06-18T16:00:00Z"
)]
pub struct Explain {
    /// The scene
    scene: PathBuf,
    /// The pixel, counted from 0 at the top left
    #[arg(long, value_name = "X,Y", value_parser = parse_pixel)]
    pixel: (u32, u32),
    /// The experiment [default: the first]
    #[arg(long)]
    experiment: Option<String>,
    /// The sensor [default: the first]
    #[arg(long)]
    sensor: Option<String>,
    /// The time, an instant or a frame's name [default: the one with the highest sun]
    #[arg(long, value_name = "T")]
    at: Option<String>,
    /// As JSON
    #[arg(long)]
    json: bool,
}

fn parse_pixel(text: &str) -> Result<(u32, u32), String> {
    let parts = text.split_once(',').and_then(|(x, y)| Some((x.trim().parse().ok()?, y.trim().parse().ok()?)));
    parts.ok_or_else(|| "write X,Y, for example 320,240".to_string())
}

impl Explain {
    pub fn run(&self, quiet: bool) -> Outcome {
        let experiments: Vec<String> = self.experiment.iter().cloned().collect();
        let plan = plan_of(
            &self.scene,
            &Options { experiments, ..Options::default() },
            &super::Deny::default(),
            quiet || self.json,
        )?;
        let run = (plan.runs().iter())
            .find(|run| self.sensor.as_ref().is_none_or(|sensor| run.sensor == *sensor))
            .ok_or_else(|| {
                let known: Vec<String> = plan.runs().iter().map(Run::full_name).collect();
                Failure::BadInput(format!("no such experiment and sensor; there are: {}", known.join(", ")))
            })?;
        let (w, h) = run.pixels;
        if self.pixel.0 >= w || self.pixel.1 >= h {
            return Err(Failure::BadInput(format!("the image has pixels 0,0 to {},{}", w - 1, h - 1)));
        }
        let time = time_of(run, self.at.as_deref()).map_err(Failure::BadInput)?;
        let explanation = explain(run, self.pixel, time, &plan.materials);
        if self.json {
            print_json(&explanation.to_json())
        } else {
            print(&explanation)
        }
        Ok(ExitCode::SUCCESS)
    }
}
