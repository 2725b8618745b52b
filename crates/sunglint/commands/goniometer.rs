//! `goniometer MATERIAL`: in-plane scans of a material by a virtual instrument.

use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use serde_json::{Value, json};
use sunglint::inspection::{Specimen, profile_chart, scan};
use sunglint::plot::Picture;
use sunglint::radiometry::Dimension;
use sunglint::reflectance::{Goniometer as Instrument, ReadingNoise, Scans};
use sunglint::write_whole;

use super::fit::{band_json, degrees};
use super::{Failure, Outcome, note, parse_plot, parse_quantity, print, print_json, write_pictures};

/// In-plane scans of a material by a virtual goniometer, as the proposal of 1993 plans them
#[derive(Args)]
#[command(after_help = "\
A reading is the reflectance factor over a round aperture: pi times the mean of the BRDF, weighted by the cosine. A mirror
reads pi rho/(Omega cos theta) in its direction. View angles have a sign: negative is the mirror's side, so that light at i
is mirrored to v = -i; v = +i is against the light, where most instruments shade the sample (--retro: this one does not).
Views at 90 deg are left out: nothing is seen along the surface.

Examples:
  sunglint goniometer panel_pvc_grey --wavelength 0.48,0.55,0.65 --noise \"1 %\" --repeats 4 -o pvc.csv
  sunglint goniometer shed_white --scene examples/truth/truth.glint --noise \"1 %\" -o shed.csv
  sunglint goniometer window --scene site.glint --model ggx --illumination 20,40,60 --view 60,40,20,0,-20,-40,-60 \\
    --solid-angle \"5 msr\" --source-radius \"0.25 deg\" -o window.csv
  sunglint fit pvc.csv -o pvc.split.csv")]
pub struct Goniometer {
    /// A material of the database, or of --scene
    material: String,
    /// The scene that has it
    #[arg(long, value_name = "SCENE")]
    scene: Option<PathBuf>,
    /// A folder of materials, searched before the shipped database
    #[arg(long, value_name = "DIR", conflicts_with = "scene")]
    database: Option<PathBuf>,
    /// The experiment whose choice of model holds [default: the first]
    #[arg(long, requires = "scene")]
    experiment: Option<String>,
    /// The model instead, by its label or name
    #[arg(long, value_name = "LABEL")]
    model: Option<String>,
    /// Wavelengths [um] [default: the bands of the scene; without one 0.55]
    #[arg(long, value_name = "UM", value_delimiter = ',')]
    wavelength: Vec<f64>,
    /// Zenith angles of the light [deg] [default: 8,30,45,60,75]
    #[arg(long, value_name = "DEG", value_delimiter = ',', allow_hyphen_values = true)]
    illumination: Vec<f64>,
    /// Zenith angles of the view, negative on the mirror's side [deg] [default: 8,30,45,60,75,90,-75,-60,-45,-30,-8]
    #[arg(long, value_name = "DEG", value_delimiter = ',', allow_hyphen_values = true)]
    view: Vec<f64>,
    /// Solid angle of the aperture
    #[arg(long, value_name = "SOLID ANGLE", default_value = "1.9 msr")]
    solid_angle: String,
    /// Angular radius of the source
    #[arg(long, value_name = "ANGLE", default_value = "0 deg")]
    source_radius: String,
    /// Standard deviation of a reading, as a share of it
    #[arg(long, value_name = "PERCENT", default_value = "0 %")]
    noise: String,
    /// Standard deviation of a reading besides, as a reflectance factor
    #[arg(long, value_name = "BRF", default_value = "0")]
    noise_floor: String,
    /// Readings that each value is the mean of
    #[arg(long, value_name = "N", default_value_t = 1)]
    repeats: u32,
    /// Seed of the noise
    #[arg(long, value_name = "N", default_value_t = 1993)]
    seed: u64,
    /// Also read against the light, v = +i
    #[arg(long)]
    retro: bool,
    /// The file to write [default: to the output]
    #[arg(long, short, value_name = "SCANS.csv")]
    output: Option<PathBuf>,
    /// Draw the profiles, as .svg or .png
    #[arg(long, value_name = "FILE", value_parser = parse_plot)]
    plot: Option<PathBuf>,
    /// As JSON
    #[arg(long)]
    json: bool,
}

impl Goniometer {
    pub fn run(&self, quiet: bool) -> Outcome {
        let instrument = self.instrument()?;
        let model = self.model.as_deref();
        let specimen = match &self.scene {
            Some(scene) => Specimen::of_scene(scene, &self.material, self.experiment.as_deref(), model)?,
            None => Specimen::of_database(self.database.as_deref(), &self.material, model)?,
        };
        let mut wavelengths = self.wavelength.clone();
        if wavelengths.is_empty() && self.scene.is_none() {
            wavelengths.push(0.55);
        }
        wavelengths.sort_by(f64::total_cmp);
        wavelengths.dedup();
        let scans = scan(&specimen, &instrument, Some(&wavelengths[..]).filter(|all| !all.is_empty()))?;
        let picture = self.plot.as_deref().map(|path| {
            let panels = (0..scans.bands().len().min(12)).map(|band| profile_chart(&scans, band)).collect();
            (path, Picture::grid(panels, 2))
        });
        let head = format!(
            "# {}, model {}: virtual goniometer, aperture {} sr, source radius {} deg, noise {} and {}, mean of {}, seed {}\n",
            specimen.name(),
            specimen.model(),
            instrument.solid_angle,
            degrees(instrument.source_radius),
            instrument.noise.relative,
            instrument.noise.absolute,
            instrument.repeats,
            instrument.seed
        );
        let text = head + &scans.to_csv();
        if let Some(path) = &self.output {
            write_whole(path, |out| out.write_all(text.as_bytes())).map_err(|e| Failure::Unfinished(e.to_string()))?;
            if !quiet {
                note(&format!("wrote {}", path.display()));
            }
        }
        write_pictures(&picture.into_iter().collect::<Vec<_>>(), quiet)?;
        if self.json {
            print_json(&json!({
                "material": specimen.name(),
                "model": specimen.model(),
                "solid_angle_sr": instrument.solid_angle,
                "readings": readings_json(&scans),
            }));
        } else if self.output.is_none() {
            print(text);
        } else if !quiet {
            let [bands, illuminations, views] = scans.report().size;
            let count = scans.readings().len();
            note(&format!("{count} values: {bands} bands, {illuminations} illuminations, {views} views"));
        }
        Ok(ExitCode::SUCCESS)
    }

    fn instrument(&self) -> Result<Instrument, Failure> {
        let quantity = |flag: &str, text: &str, of| {
            parse_quantity(text, of).map_err(|message| Failure::BadInput(format!("{flag} {text}: {message}")))
        };
        let default = Instrument::default();
        let angles = |given: &[f64], default: Vec<f64>| match given {
            [] => default,
            given => given.iter().map(|degrees| degrees.to_radians()).collect(),
        };
        Ok(Instrument {
            illuminations: angles(&self.illumination, default.illuminations),
            views: angles(&self.view, default.views),
            solid_angle: quantity("--solid-angle", &self.solid_angle, Dimension::SolidAngle)?,
            source_radius: quantity("--source-radius", &self.source_radius, Dimension::Angle)?,
            noise: ReadingNoise {
                relative: quantity("--noise", &self.noise, Dimension::Fraction)?,
                absolute: quantity("--noise-floor", &self.noise_floor, Dimension::Fraction)?,
            },
            repeats: self.repeats,
            seed: self.seed,
            retro: self.retro,
        })
    }
}

fn readings_json(scans: &Scans) -> Value {
    (scans.readings().iter())
        .map(|reading| {
            let mut row = band_json(&scans.bands()[reading.band]);
            row["illumination_zenith_deg"] = json!(degrees(scans.illuminations()[reading.illumination]));
            row["view_zenith_deg"] = json!(degrees(scans.views()[reading.view]));
            row["brf"] = json!(reading.brf);
            row["brf_stddev"] = json!(reading.stddev);
            row
        })
        .collect()
}
