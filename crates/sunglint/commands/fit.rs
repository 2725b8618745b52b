//! `fit SCANS.csv`: a goniometer's scans split into R_d and R_s, or fitted by a model.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args, ValueEnum};
use serde_json::{Value, json};
use sunglint::inspection::fit_chart;
use sunglint::radiometry::Dimension;
use sunglint::reflectance::{
    BandSplit, Excess, FitOptions, Grazing, Interpolation, Noise, Place, Report, ScanBand, ScanFaults, Scans,
    SpecularColumn, SplitFit, SplitOptions, fit_split,
};
use sunglint::write_whole;

use super::{
    Failure, Outcome, fit_model, note, parse_plot, parse_quantity, print, print_json, read_text, write_pictures,
};

/// Goniometer scans into the components R_d and R_s that the model `split` takes, or into a model's parameters
#[derive(Args)]
#[command(after_help = "\
SCANS.csv has the columns illumination_zenith_deg, view_zenith_deg (negative on the mirror's side: light at i is mirrored to
v = -i) and brf; where there are several, band or wavelength_nm; where they are known, brf_stddev (standard error of brf)
and solid_angle_msr (of the aperture).

R_d is the mean over all illuminations and both signs of the view angle without the mirror pair, R_s what the mirror's value
has above it, a reflectance factor over the aperture. The table has a row a degree from 0 to 90: R_d holds beyond the last
measured angle, the lobe follows --grazing. The scene says the same solid angle and rule; the line for it is printed.

Exit code 2 where the components return more than they get: no table is written.

Examples:
  sunglint fit shed.csv -o shed.split.csv --plot shed.svg
  sunglint fit panel.csv --solid-angle \"1.9 msr\" --interpolation pchip --grazing hold
  sunglint fit shed.csv --specular reflectance -o shed.split.csv --json
  sunglint fit panel.csv --model ward --plot ward.svg -o residuals.csv
  sunglint fit panel.csv --model ggx --fix n=1.49
  sunglint fit panel.csv --compare=phong,ward,ggx,oren_nayar

With --model the parameters of phong, ward, ggx, cook_torrance, maxwell_beard and others come with standard errors, their
correlations and the misfit at every reading (-o); the block for the scene is printed. --compare ranks models and marks
those that no other beats in error, number of parameters and cost at once.")]
pub struct Fit {
    /// The scans
    #[arg(value_name = "SCANS.csv")]
    scans: PathBuf,
    /// Solid angle of the instrument's aperture, where the scans do not state it
    #[arg(long, value_name = "SOLID ANGLE")]
    solid_angle: Option<String>,
    /// The lobe beyond the last measured angle
    #[arg(long, value_enum, default_value_t = Rule::Fresnel)]
    grazing: Rule,
    /// The components between measured angles
    #[arg(long, value_enum, default_value_t = Between::Linear)]
    interpolation: Between,
    /// What the table's column `specular` holds
    #[arg(long, value_enum, default_value_t = Column::Brf)]
    specular: Column,
    /// The table to write
    #[arg(long, short, value_name = "TABLE.csv")]
    output: Option<PathBuf>,
    /// Draw scans and components, as .svg or .png
    #[arg(long, value_name = "FILE", value_parser = parse_plot)]
    plot: Option<PathBuf>,
    /// Fit a model's parameters instead, by least squares
    #[arg(long, value_name = "MODEL", conflicts_with_all = ["grazing", "interpolation", "specular"])]
    model: Option<String>,
    /// Fit several models and rank them by error, parameters and cost; without names all that can be fitted
    #[arg(long, value_name = "MODELS", num_args = 0..=1, require_equals = true, default_missing_value = "",
          conflicts_with_all = ["model", "grazing", "interpolation", "specular", "output", "plot"])]
    compare: Option<String>,
    /// Hold a parameter of the model at a value, in radians, micrometres or 1
    #[arg(long, value_name = "NAME=VALUE", requires = "model", value_parser = parse_fixed)]
    fix: Vec<(String, f64)>,
    /// Let a parameter vary that is held otherwise
    #[arg(long, value_name = "NAME", requires = "model")]
    free: Vec<String>,
    /// As JSON
    #[arg(long)]
    json: bool,
}

fn parse_fixed(text: &str) -> Result<(String, f64), String> {
    let wrong = || "write NAME=VALUE, for example k=0".to_string();
    let (name, value) = text.split_once('=').ok_or_else(wrong)?;
    let value: f64 = value.trim().parse().map_err(|_| wrong())?;
    if value.is_finite() { Ok((name.trim().to_string(), value)) } else { Err(wrong()) }
}

#[derive(Clone, Copy, ValueEnum)]
enum Rule {
    /// Grows as the Fresnel reflectance of index 1.5
    Fresnel,
    /// Holds its reflectance
    Hold,
}

#[derive(Clone, Copy, ValueEnum)]
enum Between {
    /// Straight lines
    Linear,
    /// Monotone cubics
    Pchip,
}

#[derive(Clone, Copy, ValueEnum)]
enum Column {
    /// R_s, a reflectance factor over the aperture
    Brf,
    /// rho_s, the lobe's reflectance
    Reflectance,
}

impl Fit {
    pub fn run(&self, quiet: bool) -> Outcome {
        let scans = self.read()?;
        if let Some(model) = &self.model {
            let options = FitOptions { fixed: self.fix.clone(), free: self.free.clone() };
            let to =
                fit_model::Output { table: self.output.as_deref(), plot: self.plot.as_deref(), json: self.json, quiet };
            return fit_model::one(&self.scans, &scans, model, &options, &to);
        }
        if let Some(models) = &self.compare {
            return fit_model::several(&self.scans, &scans, models, self.json);
        }
        let options = SplitOptions {
            grazing: match self.grazing {
                Rule::Fresnel => Grazing::Fresnel,
                Rule::Hold => Grazing::Hold,
            },
            interpolation: match self.interpolation {
                Between::Linear => Interpolation::Linear,
                Between::Pchip => Interpolation::Pchip,
            },
        };
        let column = match self.specular {
            Column::Brf => SpecularColumn::Brf,
            Column::Reflectance => SpecularColumn::Reflectance,
        };
        let report = scans.report();
        let fit = fit_split(&scans, options).map_err(|faults| self.told(&faults))?;
        let file = self.output.as_deref().and_then(Path::file_name).map_or("TABLE.csv".into(), |n| n.to_string_lossy());
        let line = fit.in_a_scene(&file, column);
        if self.json {
            print_json(&to_json(&report, &fit, &line));
        } else {
            print(to_text(&self.scans, &report, &fit));
        }
        if !fit.is_sound() {
            return Err(Failure::BadInput(excess(&self.scans, &fit)));
        }
        if let Some(path) = &self.output {
            let text = fit.to_csv(column);
            write_whole(path, |out| out.write_all(text.as_bytes())).map_err(|e| Failure::Unfinished(e.to_string()))?;
            if !quiet {
                note(&format!("wrote {}; in a scene: {line}", path.display()));
            }
        }
        let picture = self.plot.as_deref().map(|path| (path, fit_chart(&scans, &fit)));
        write_pictures(&picture.into_iter().collect::<Vec<_>>(), quiet)?;
        Ok(ExitCode::SUCCESS)
    }

    /// The scans with their aperture.
    fn read(&self) -> Result<Scans, Failure> {
        let scans = Scans::read_csv(&read_text(&self.scans)?).map_err(|faults| self.told(&faults))?;
        let Some(text) = &self.solid_angle else { return Ok(scans) };
        let bad = |message: String| Failure::BadInput(format!("--solid-angle {text}: {message}"));
        let said = parse_quantity(text, Dimension::SolidAngle).map_err(bad)?;
        if let Some(stated) = scans.solid_angle().filter(|stated| (stated - said).abs() > 1e-6 * said.abs()) {
            return Err(bad(format!("the scans state {stated} sr; leave one out")));
        }
        scans.with_solid_angle(said).map_err(|fault| bad(fault.to_string()))
    }

    fn told(&self, faults: &ScanFaults) -> Failure {
        let path = self.scans.display();
        let lines: Vec<String> = faults.to_string().lines().map(|line| format!("{path}: {line}")).collect();
        let cure = match self.solid_angle.is_none() && faults.faults.iter().any(|fault| fault.code == "S05") {
            true => ", or say --solid-angle",
            false => "",
        };
        Failure::BadInput(format!("{}{cure}", lines.join("\nerror: ")))
    }
}

/// In degrees, free of what the turn to radians and back left.
pub fn degrees(angle: f64) -> f64 {
    (angle.to_degrees() * 1e9).round() / 1e9 + 0.0
}

/// The key of a band: `band` or `wavelength_um`.
pub fn band_json(band: &ScanBand) -> Value {
    match band {
        ScanBand::All => json!({}),
        ScanBand::Named(name) => json!({ "band": name }),
        ScanBand::Wavelength(wavelength) => json!({ "wavelength_um": wavelength.um() }),
    }
}

/// That bands return more than they get, each at its worst angle, with the cure.
fn excess(scans: &Path, fit: &SplitFit) -> String {
    let worst = |band: &BandSplit| {
        let by_amount = |a: &&Excess, b: &&Excess| a.amount().total_cmp(&b.amount());
        let worst = band.excesses.iter().max_by(by_amount)?;
        let (of, angle) = (band.band.of(), (degrees(worst.theta) * 1e3).round() / 1e3);
        Some(format!("{}: the sample returns more than it gets{of} at {angle} deg: {worst}", scans.display()))
    };
    let lines: Vec<String> = fit.bands.iter().filter_map(worst).collect();
    format!(
        "{}\nerror: nothing is written; is the solid angle that of the aperture, and the white reference below 1?",
        lines.join("\nerror: ")
    )
}

fn to_text(scans: &Path, report: &Report, fit: &SplitFit) -> String {
    let mut text = format!("{}\n{report}aperture {} sr\n", scans.display(), fit.solid_angle);
    for band in &fit.bands {
        let noise = match band.noise {
            Noise::Stated => "errors by the noise that the scans state".to_string(),
            Noise::Pooled(scatter) => format!("no noise is stated: errors by the pooled scatter of {scatter:.3e}"),
            Noise::Unknown => "no noise is stated, and no two values tell it".to_string(),
        };
        text += &format!("\n{}: {noise}\n", band.band);
        text += &format!(
            "  {:>8} {:>4} {:>10} {:>10} {:>10} {:>11} {:>10} {:>10}\n",
            "view_deg", "n", "R_d", "error", "spread", "R_s", "error", "rho_s"
        );
        let number = |value: Option<f64>| value.map_or("-".to_string(), |value| format!("{value:.3e}"));
        for row in &band.rows {
            let same = |theta: f64| (theta - row.theta).abs() < sunglint::reflectance::SAME_ANGLE;
            let d = band.diffuse.iter().find(|node| same(node.theta));
            let s = band.specular.iter().find(|node| same(node.theta));
            if d.is_none() && s.is_none() {
                continue;
            }
            text += &format!(
                "  {:>8.3} {:>4} {:>10} {:>10} {:>10} {:>11} {:>10} {:>10}\n",
                degrees(row.theta),
                d.map_or(0, |node| node.count),
                d.map_or("-".into(), |node| format!("{:.6}", node.value)),
                number(d.and_then(|node| node.standard_error)),
                number(d.and_then(|node| node.spread)),
                s.map_or("-".into(), |node| format!("{:.6}", node.value)),
                number(s.and_then(|node| node.standard_error)),
                s.map_or("-".into(), |_| format!("{:.6}", row.specular)),
            );
        }
        for node in &band.specular {
            let angle = degrees(node.theta);
            if let Some(below) = node.clamped {
                let noise = node.standard_error.filter(|error| *error > 0.0).map(|error| -below / error);
                let of = noise.map_or(String::new(), |n| format!(" ({n:.1} standard errors)"));
                let by = -below;
                text += &format!("  clamped: at {angle} deg the mirror's value is {by:.3e} below R_d{of}; R_s = 0\n");
            }
            if !node.has_diffuse {
                text +=
                    &format!("  at {angle} deg nothing but the mirror's value was measured: R_d from its neighbours\n");
            }
        }
        let (furnace, one_way) = energy(band);
        text += &format!(
            "  energy: R_d + rho_s at most {:.4} (at {} deg), mean of R_d + largest rho_s {one_way:.4}\n",
            furnace.1, furnace.0
        );
    }
    text
}

/// Largest R_d + ρ_s with its view angle \[deg\], and the mean of R_d over the hemisphere + the largest ρ_s.
fn energy(band: &BandSplit) -> ((f64, f64), f64) {
    let sums = band.rows.iter().map(|row| (degrees(row.theta), row.diffuse + row.specular));
    let furnace = sums.max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((0.0, 0.0));
    let lobe = band.rows.iter().map(|row| row.specular).fold(0.0, f64::max);
    (furnace, band.split(0.0).diffuse.hemispherical()[0] + lobe)
}

fn to_json(report: &Report, fit: &SplitFit, line: &str) -> Value {
    let place = |place: &Place| {
        let mut value = band_json(&place.band);
        value["illumination_zenith_deg"] = json!(degrees(place.illumination));
        value["view_zenith_deg"] = json!(degrees(place.view));
        value["brf"] = json!(place.brf);
        value
    };
    let places = |list: &[Place]| list.iter().map(place).collect::<Value>();
    json!({
        "solid_angle_sr": fit.solid_angle,
        "grazing": if fit.options.grazing == Grazing::Hold { "hold" } else { "fresnel" },
        "interpolation": if fit.options.interpolation == Interpolation::Pchip { "pchip" } else { "linear" },
        "scene": line,
        "report": {
            "values": report.count,
            "gap_count": report.gaps.count,
            "gaps": places(&report.gaps.first),
            "no_specular": places(&report.no_specular),
            "impossible": places(&report.impossible),
            "against_the_light": places(&report.retro),
            "negative": places(&report.negative),
        },
        "bands": fit.bands.iter().map(of_band).collect::<Value>(),
    })
}

fn of_band(band: &BandSplit) -> Value {
    let mut value = band_json(&band.band);
    value["noise"] = json!(match band.noise {
        Noise::Stated => "stated",
        Noise::Pooled(_) => "pooled",
        Noise::Unknown => "unknown",
    });
    let (furnace, one_way) = energy(band);
    value["largest_sum"] = json!({ "view_zenith_deg": furnace.0, "diffuse_plus_specular": furnace.1 });
    value["mean_diffuse_plus_largest_specular"] = json!(one_way);
    value["excesses"] = (band.excesses.iter())
        .map(|excess| json!({ "view_zenith_deg": degrees(excess.theta), "excess": excess.amount(), "in_the_mean": excess.in_the_mean }))
        .collect();
    value["diffuse"] = (band.diffuse.iter())
        .map(|node| {
            json!({
                "view_zenith_deg": degrees(node.theta),
                "diffuse": node.value,
                "values": node.count,
                "standard_error": node.standard_error,
                "spread": node.spread,
                "spread_error": node.spread_error(),
            })
        })
        .collect();
    value["specular"] = (band.specular.iter())
        .map(|node| {
            json!({
                "view_zenith_deg": degrees(node.theta),
                "brf": node.brf,
                "specular_brf": node.value,
                "clamped_from": node.clamped,
                "standard_error": node.standard_error,
                "diffuse_is_measured": node.has_diffuse,
            })
        })
        .collect();
    value["rows"] = (band.rows.iter())
        .map(|row| {
            json!({
                "view_zenith_deg": degrees(row.theta),
                "diffuse": row.diffuse,
                "specular": row.specular,
                "specular_brf": row.peak,
                "diffuse_standard_error": row.diffuse_error,
                "specular_standard_error": row.specular_error,
                "row": row.support.name(),
            })
        })
        .collect();
    value
}
