//! `reflectance SCENE MATERIAL`: what a surface returns from one direction into another.

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;
use serde_json::{Value, json};
use sunglint::inspection::{
    Compared, InspectionError, Specimen, albedo_chart, brdf_chart, brdf_map, compared, compared_chart, component_chart,
    spectrum_chart, unknown_name,
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

--compare holds two descriptions of the material against each other over all geometries: models by label or name, `full`
(its model beyond `ideal` and `split`), or `split` (where it has no such model, the components of the other side's).

Examples:
  sunglint reflectance examples/truth/truth.glint grey_18 --geometry angles.csv --wavelength 0.55,0.85 --json
  sunglint reflectance examples/truth/truth.glint shed_white --model phong --plot brdf=shed.svg --plot map=shed.png
  sunglint reflectance --material asphalt_road_old --plot components=asphalt.svg
  sunglint reflectance --material aluminium_rough --compare split,full --plot brdf=loss.svg")]
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
    /// What the first loses against the second, for example split,full; the plot brdf then shows both
    #[arg(long, value_name = "A,B", value_delimiter = ',', num_args = 1, conflicts_with_all = ["geometry", "csv"])]
    compare: Vec<String>,
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
        if !self.compare.is_empty() {
            return self.held_against(&specimen, &incident, quiet);
        }
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

    fn held_against(&self, specimen: &Specimen, incident: &[f64], quiet: bool) -> Outcome {
        let [first, second] = &self.compare[..] else {
            return Err(Failure::BadInput("--compare takes two names, for example split,full".into()));
        };
        let compared = compared(specimen, [first, second], &self.wavelength)?;
        let mut pictures: Vec<(&Path, Picture)> = Vec::new();
        for (kind, path) in &self.plot {
            let picture = match *kind {
                "brdf" => compared_chart(specimen.name(), &compared, incident),
                _ => self.picture(kind, specimen, incident)?,
            };
            pictures.push((path, picture));
        }
        write_pictures(&pictures, quiet)?;
        if self.json {
            print_json(&compared_json(specimen.name(), &compared));
        } else {
            print(compared_text(specimen.name(), &compared));
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

/// View angles \[deg\] of a comparison's rows.
const VIEWS: [f64; 9] = [0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0];

fn compared_text(material: &str, compared: &Compared) -> String {
    let [first, second] = &compared.sides;
    let mut text = format!("{material}: {} against {}\n", first.name, second.name);
    for (i, (wavelength, loss)) in compared.wavelengths.iter().zip(&compared.losses).enumerate() {
        let worst = loss.worst;
        text += &format!(
            "\n  at {wavelength} um, over all geometries (BRF, weighted by both projected solid angles)\n\
             \x20   mean of the second {:.5}, bias {:+.5}, rms difference {:.5}\n\
             \x20   furthest apart at incident {:.1}, view {:.1}, azimuth {:.0} deg: {:.5} against {:.5}\n",
            loss.mean,
            loss.bias,
            loss.rms,
            degrees(worst.incident),
            degrees(worst.view),
            degrees(worst.azimuth),
            worst.first,
            worst.second
        );
        text += "\n    view_deg   mirror direction, BRF      in a furnace            mirror lobe\n";
        text += "                 first     second       first    second       first    second\n";
        for degrees in VIEWS {
            let view = degrees.to_radians();
            let pair = |of: &dyn Fn(&sunglint::inspection::Side) -> Vec<f64>| [of(first)[i], of(second)[i]];
            let [a, b] = pair(&|side| side.brf(view, view, PI));
            let [c, d] = pair(&|side| side.furnace(view));
            let [e, f] = pair(&|side| side.mirror(view));
            text += &format!("    {degrees:>8}  {a:>9.4}  {b:>9.4}   {c:>9.5} {d:>9.5}   {e:>9.5} {f:>9.5}\n");
        }
    }
    text
}

fn compared_json(material: &str, compared: &Compared) -> Value {
    let [first, second] = &compared.sides;
    let rows: Vec<Value> = (compared.wavelengths.iter().zip(&compared.losses).enumerate())
        .map(|(i, (wavelength, loss))| {
            let worst = loss.worst;
            let views: Vec<Value> = (VIEWS.iter())
                .map(|degrees| {
                    let view = degrees.to_radians();
                    json!({
                        "view_zenith_deg": degrees,
                        "mirror_direction_brf": [first.brf(view, view, PI)[i], second.brf(view, view, PI)[i]],
                        "furnace_reflectance": [first.furnace(view)[i], second.furnace(view)[i]],
                        "mirror_reflectance": [first.mirror(view)[i], second.mirror(view)[i]],
                    })
                })
                .collect();
            json!({
                "wavelength_um": wavelength,
                "mean_brf": loss.mean,
                "bias_brf": loss.bias,
                "rms_brf": loss.rms,
                "worst": {
                    "incident_zenith_deg": degrees(worst.incident),
                    "view_zenith_deg": degrees(worst.view),
                    "relative_azimuth_deg": degrees(worst.azimuth),
                    "brf": [worst.first, worst.second],
                },
                "views": views,
            })
        })
        .collect();
    json!({"material": material, "first": first.name, "second": second.name, "rows": rows})
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
