//! `atmosphere [SCENE]`: what the air does at one time, over a scene or as flags describe it.

use std::f64::consts::{FRAC_PI_2, TAU};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args, ValueEnum};
use sunglint::inspection::{air, air_chart, air_plan, sky_picture, time_of, unknown_name};
use sunglint::plot::{Picture, Projection};
use sunglint::plugin;
use sunglint::radiometry::Dimension;
use sunglint::{Run, write_whole};

use super::column::Column;
use super::{Failure, Outcome, note, parse_plot, print, print_json, read_rows, report, write_pictures};

const DIRECTIONS: &[plugin::Column] = &[
    plugin::Column { name: "zenith", dimension: Dimension::Angle, range: (0.0, FRAC_PI_2) },
    plugin::Column { name: "azimuth", dimension: Dimension::Angle, range: (-TAU, TAU) },
];

/// What the air does at one time: sunlight, skylight, transmittance and path radiance
#[derive(Args)]
#[command(after_help = "\
A band's transmittance is that of sunlight, <E_s tau>/<E_s>; its other values are response-weighted means.

Examples:
  sunglint atmosphere examples/truth/truth.glint --at 1992-06-18T16:00:00Z
  sunglint atmosphere examples/minimal/minimal.glint --plot light.svg --fisheye sky.png
  sunglint atmosphere examples/minimal/minimal.glint --directions sky.csv --json
  sunglint atmosphere --sun-zenith 30 --visibility \"23 km\" --water \"2 g/cm2\" --albedo 0.2 --plot light.svg
  sunglint atmosphere --latitude 43.08 --longitude -77.67 --elevation \"168 m\" --at 1992-06-18T16:00:00Z \\
    --aod 0.2 --sensor-altitude \"3 km\" --view-zenith 40 --wavelengths \"400..1000 nm every 5 nm\" --csv air.csv
  sunglint atmosphere --sun-zenith 60 --bands sentinel2a --fisheye sky.png --band B2")]
pub struct Atmosphere {
    /// The scene; without one, flags say the air, the sun and the line of sight
    scene: Option<PathBuf>,
    /// The time: an instant, collected by the scene or not, or a frame's name [default: the one with the highest sun]
    #[arg(long, value_name = "T")]
    at: Option<String>,
    /// The experiment [default: the first]
    #[arg(long)]
    experiment: Option<String>,
    /// The sensor whose wavelengths and bands are shown [default: the first, and every sensor's bands]
    #[arg(long)]
    sensor: Option<String>,
    /// Directions of the sky: a CSV file with columns zenith_deg, azimuth_deg
    #[arg(long, value_name = "FILE.csv")]
    directions: Option<PathBuf>,
    /// As JSON
    #[arg(long)]
    json: bool,
    /// Write the spectra as CSV
    #[arg(long, value_name = "FILE.csv")]
    csv: Option<PathBuf>,
    /// Plot the spectra, as .svg or .png
    #[arg(long, value_name = "FILE", value_parser = parse_plot)]
    plot: Option<PathBuf>,
    /// Picture of the sky as seen from below (north up, east left), as .png or .svg
    #[arg(long, value_name = "FILE", value_parser = parse_plot)]
    fisheye: Option<PathBuf>,
    /// Band of the fisheye picture [default: the first]
    #[arg(long)]
    band: Option<String>,
    /// Projection of the fisheye picture
    #[arg(long, value_enum, default_value_t = Layout::Equidistant)]
    projection: Layout,
    #[command(flatten)]
    column: Column,
}

#[derive(Clone, Copy, ValueEnum)]
enum Layout {
    /// Zenith angle in proportion to the distance from the middle
    Equidistant,
    /// Equal solid angles have equal areas
    EqualArea,
}

impl Atmosphere {
    pub fn run(&self, quiet: bool) -> Outcome {
        let bad = Failure::BadInput;
        let directions: Vec<(f64, f64)> = match &self.directions {
            Some(path) => read_rows(path, DIRECTIONS)?.into_iter().map(|row| (row[0], row[1])).collect(),
            None => Vec::new(),
        };
        if directions.len() > 10_000 {
            return Err(bad("at most 10000 directions are looked at in one go".into()));
        }
        let plan = match &self.scene {
            Some(scene) => air_plan(scene, self.experiment.as_deref(), self.at.as_deref())?,
            None if self.experiment.is_some() || self.sensor.is_some() => {
                return Err(bad("--experiment and --sensor choose from a scene; none is given".into()));
            }
            None => self.column.plan(self.at.as_deref())?,
        };
        if !quiet && !self.json {
            report(&plan.warnings, &plan.sources);
        }
        let runs: Vec<&Run> = match &self.sensor {
            None => plan.runs().iter().collect(),
            Some(wanted) => {
                let found: Vec<&Run> = plan.runs().iter().filter(|run| run.sensor == *wanted).collect();
                if found.is_empty() {
                    let names: Vec<&str> = plan.runs().iter().map(|run| run.sensor.as_str()).collect();
                    return Err(bad(unknown_name("sensor", wanted, &names)));
                }
                found
            }
        };
        let first = runs[0]; // a plan has a run
        let at = self.at.as_deref().filter(|_| self.scene.is_some());
        let time = time_of(first, at).map_err(bad)?;
        let frame = first.moments[time].label.clone();
        let Some(air) = air(&runs, &frame, &directions) else {
            return Err(bad(format!("no sensor takes the frame {frame}")));
        };
        let mut pictures: Vec<(&Path, Picture)> = Vec::new();
        if let Some(path) = &self.plot {
            pictures.push((path, air_chart(&air)));
        }
        if let Some(path) = &self.fisheye {
            pictures.push((path, self.sky(&runs, &frame)?));
        }
        if let Some(path) = &self.csv {
            let text = air.to_csv();
            write_whole(path, |out| out.write_all(text.as_bytes())).map_err(|e| Failure::Unfinished(e.to_string()))?;
            if !quiet {
                note(&format!("wrote {}", path.display()));
            }
        }
        write_pictures(&pictures, quiet)?;
        if self.json {
            print_json(&air.to_json())
        } else {
            print(&air)
        }
        Ok(ExitCode::SUCCESS)
    }

    fn sky(&self, runs: &[&Run], frame: &str) -> Result<Picture, Failure> {
        let projection = match self.projection {
            Layout::Equidistant => Projection::Equidistant,
            Layout::EqualArea => Projection::EqualArea,
        };
        let mut names = Vec::new();
        for run in runs {
            let Some(time) = run.moments.iter().position(|moment| moment.label == frame) else { continue };
            for (c, channel) in run.channels.channels().iter().enumerate() {
                if self.band.as_ref().is_none_or(|wanted| channel.name == *wanted) {
                    return Ok(sky_picture(run, time, c, projection));
                }
                names.push(channel.name.as_str());
            }
        }
        Err(Failure::BadInput(unknown_name("band", self.band.as_deref().unwrap_or_default(), &names)))
    }
}
