//! `reflectance SCENE MATERIAL`: what a surface returns from one direction into another.

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;
use serde_json::{Value, json};
use sunglint::inspection::{
    InspectionError, Specimen, albedo_chart, brdf_chart, brdf_map, component_chart, spectrum_chart, unknown_name,
};
use sunglint::plot::Picture;
use sunglint::plugin::Column;
use sunglint::radiometry::Dimension;

use super::{Failure, Outcome, parse_plot, print, print_json, read_rows, write_pictures};

const GEOMETRY: &[Column] = &[
    Column { name: "incident_zenith", dimension: Dimension::Angle, range: (0.0, FRAC_PI_2) },
    Column { name: "view_zenith", dimension: Dimension::Angle, range: (0.0, FRAC_PI_2) },
    Column { name: "relative_azimuth", dimension: Dimension::Angle, range: (-TAU, TAU) },
];

const KINDS: [&str; 5] = ["components", "brdf", "map", "albedo", "spectra"];

/// What a surface returns from one direction into another: BRDF, components, albedo
#[derive(Args)]
#[command(after_help = "\
Angles point away from the surface; relative azimuth 0 puts light and view on the same side, 180 is the mirror's side.
brdf_per_sr is without the cosine. A mirror lobe has no finite BRDF: brdf_per_sr then tells the smooth lobes alone, and
`specular` has the mirror's reflectance. Without --geometry the principal plane is shown for light from 45 deg.

Plots: components  R_d, rho_s and R_s as stated, against view angle
       brdf        BRDF in the principal plane for the --incident angles
       map         BRDF over all view directions for the first --incident angle
       albedo      directional-hemispherical reflectance against incident angle
       spectra     against wavelength, at view angles of 0 and 60 deg

Examples:
  sunglint reflectance examples/truth/truth.glint grey_18 --geometry angles.csv --wavelength 0.55,0.85 --json
  sunglint reflectance examples/truth/truth.glint shed_white --model phong --plot brdf=shed.svg --plot map=shed.png
  sunglint reflectance --material asphalt_road_old --plot components=asphalt.svg")]
pub struct Reflectance {
    /// The scene, and a material of it
    #[arg(
        value_name = "SCENE MATERIAL",
        num_args = 2,
        required_unless_present = "material",
        conflicts_with = "material"
    )]
    of_scene: Vec<String>,
    /// A material of the database instead
    #[arg(long, value_name = "NAME")]
    material: Option<String>,
    /// A folder of materials, searched before the shipped database
    #[arg(long, value_name = "DIR", requires = "material")]
    database: Option<PathBuf>,
    /// The experiment whose choice of model holds [default: the first]
    #[arg(long, conflicts_with = "material")]
    experiment: Option<String>,
    /// The model instead, by its label or name
    #[arg(long, value_name = "LABEL")]
    model: Option<String>,
    /// Angles: a CSV file with columns incident_zenith_deg, view_zenith_deg, relative_azimuth_deg
    #[arg(long, value_name = "FILE.csv")]
    geometry: Option<PathBuf>,
    /// Wavelengths [um]
    #[arg(long, value_name = "UM", value_delimiter = ',', default_value = "0.55")]
    wavelength: Vec<f64>,
    /// As JSON
    #[arg(long)]
    json: bool,
    /// As CSV
    #[arg(long, conflicts_with = "json")]
    csv: bool,
    /// Draw a plot, as .svg or .png; KIND is components, brdf, map, albedo or spectra
    #[arg(long, value_name = "KIND=FILE", value_parser = parse_kind)]
    plot: Vec<(&'static str, PathBuf)>,
    /// Zenith angles of the light for the plots brdf and map [deg]
    #[arg(long, value_name = "DEG", value_delimiter = ',', default_value = "45")]
    incident: Vec<f64>,
}

fn parse_kind(text: &str) -> Result<(&'static str, PathBuf), String> {
    let Some((kind, file)) = text.split_once('=') else {
        return Err(format!("write KIND=FILE, KIND one of {}", KINDS.join(", ")));
    };
    let kind = KINDS.iter().find(|known| **known == kind).ok_or_else(|| unknown_name("kind of plot", kind, &KINDS))?;
    Ok((kind, parse_plot(file)?))
}

struct Row {
    /// Incident zenith, view zenith, relative azimuth \[rad\].
    angles: [f64; 3],
    wavelength: f64,
    brdf: f64,
    diffuse: f64,
    specular: f64,
}

impl Reflectance {
    pub fn run(&self, quiet: bool) -> Outcome {
        let bad = |message: &str| Err(Failure::BadInput(message.to_string()));
        let incident: Vec<f64> = self.incident.iter().map(|degrees| degrees.to_radians()).collect();
        if !incident.iter().all(|theta| (0.0..FRAC_PI_2).contains(theta)) || incident.len() > 21 {
            return bad("--incident takes up to 21 angles from 0 to below 90 deg");
        }
        let geometry: Vec<[f64; 3]> = match &self.geometry {
            Some(path) => read_rows(path, GEOMETRY)?.into_iter().map(|row| [row[0], row[1], row[2]]).collect(),
            None => principal_plane(),
        };
        if geometry.len().saturating_mul(self.wavelength.len()) > 2_000_000 {
            return bad("more than 2000000 rows are asked for");
        }
        let model = self.model.as_deref();
        let specimen = match (&self.material, &self.of_scene[..]) {
            (Some(name), _) => Specimen::of_database(self.database.as_deref(), name, model)?,
            (None, [scene, material]) => {
                Specimen::of_scene(Path::new(scene), material, self.experiment.as_deref(), model)?
            }
            _ => return bad("give a scene and a material of it, or --material NAME"),
        };
        let surface = specimen.bind(&self.wavelength)?;
        let mut pictures: Vec<(&Path, Picture)> = Vec::new();
        for (kind, path) in &self.plot {
            pictures.push((path, self.picture(kind, &specimen, &incident)?));
        }
        let mut rows = Vec::with_capacity(geometry.len() * self.wavelength.len());
        for angles in geometry {
            let [incident, view, azimuth] = angles;
            let brdf = surface.brdf(incident, view, azimuth);
            let (diffuse, specular) = (surface.diffuse(view), surface.specular(view));
            rows.extend((surface.wavelengths().iter().enumerate()).map(|(i, wavelength)| Row {
                angles,
                wavelength: *wavelength,
                brdf: brdf[i],
                diffuse: diffuse[i],
                specular: specular[i],
            }));
        }
        write_pictures(&pictures, quiet)?;
        if self.json {
            print_json(&json!({
                "material": specimen.name(),
                "model": specimen.model(),
                "has_mirror_lobe": surface.has_mirror(),
                "rows": rows.iter().map(Row::to_json).collect::<Vec<_>>(),
            }));
        } else if self.csv {
            let lines: Vec<String> = rows.iter().map(Row::to_csv).collect();
            print(format_args!(
                "incident_zenith_deg,view_zenith_deg,relative_azimuth_deg,wavelength_um,brdf_per_sr,diffuse,specular\n{}\n",
                lines.join("\n")
            ));
        } else if self.plot.is_empty() || self.geometry.is_some() {
            self.print_table(&specimen, &rows, surface.has_mirror());
        }
        Ok(ExitCode::SUCCESS)
    }

    fn picture(&self, kind: &str, specimen: &Specimen, incident: &[f64]) -> Result<Picture, InspectionError> {
        let first = self.wavelength[0]; // a surface was bound to it
        match kind {
            "components" => component_chart(specimen, &self.wavelength),
            "brdf" => brdf_chart(specimen, first, incident),
            "map" => brdf_map(specimen, first, incident.first().copied().unwrap_or(0.0)),
            "albedo" => albedo_chart(specimen, &self.wavelength),
            _ => spectrum_chart(specimen),
        }
    }

    fn print_table(&self, specimen: &Specimen, rows: &[Row], has_mirror: bool) {
        let title = specimen.title().map_or(String::new(), |title| format!(" ({title})"));
        let mut text = format!("{}{title}, model {}\n", specimen.name(), specimen.model());
        if has_mirror {
            text += "  it has a mirror lobe, of which brdf_per_sr tells nothing: see `specular`\n";
        }
        text += &format!(
            "  {:>12} {:>8} {:>12} {:>8} {:>13} {:>9} {:>9}\n",
            "incident_deg", "view_deg", "azimuth_deg", "um", "brdf_per_sr", "diffuse", "specular"
        );
        for row in rows {
            let [incident, view, azimuth] = row.angles.map(degrees);
            text += &format!(
                "  {incident:>12.3} {view:>8.3} {azimuth:>12.3} {:>8.4} {:>13.6e} {:>9.5} {:>9.5}\n",
                row.wavelength, row.brdf, row.diffuse, row.specular
            );
        }
        print(text);
    }
}

/// Light from 45° and views every 15° in its plane, from the light's side to the mirror's.
fn principal_plane() -> Vec<[f64; 3]> {
    let incident = 45f64.to_radians();
    (-5..=5)
        .map(|i| {
            let view = f64::from(15 * i).to_radians();
            [incident, view.abs(), if i < 0 { 0.0 } else { PI }]
        })
        .collect()
}

/// In degrees, free of what the turn to radians and back left.
fn degrees(angle: f64) -> f64 {
    (angle.to_degrees() * 1e9).round() / 1e9
}

impl Row {
    fn to_json(&self) -> Value {
        let [incident, view, azimuth] = self.angles.map(degrees);
        json!({
            "incident_zenith_deg": incident,
            "view_zenith_deg": view,
            "relative_azimuth_deg": azimuth,
            "wavelength_um": self.wavelength,
            "brdf_per_sr": self.brdf,
            "diffuse": self.diffuse,
            "specular": self.specular,
        })
    }

    fn to_csv(&self) -> String {
        let [incident, view, azimuth] = self.angles.map(degrees);
        let Self { wavelength, brdf, diffuse, specular, .. } = self;
        format!("{incident},{view},{azimuth},{wavelength},{brdf},{diffuse},{specular}")
    }
}
