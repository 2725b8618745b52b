//! `materials`: the database, searched and drawn.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, Subcommand};
use serde_json::Value;
use sunglint::dsl::nearest;
use sunglint::inspection::{MaterialEntry, Specimen, database, material_chart, materials_of, unknown_name};

use super::{Failure, Outcome, parse_plot, print, print_json, write_pictures};

/// The materials: the shipped ones, a folder's, or a scene's
#[derive(Args)]
#[command(after_help = "\
Examples:
  sunglint materials
  sunglint materials search asphalt
  sunglint materials show painted_aluminium_light
  sunglint materials plot asphalt_road_old leaf_maple water_turbid_low -o spectra.svg
  sunglint materials list --scene examples/truth/truth.glint --json")]
pub struct Materials {
    #[command(subcommand)]
    task: Option<Task>,
    /// A folder of materials (NAME.glint, one material each), searched before the shipped database
    #[arg(long, value_name = "DIR", global = true)]
    database: Option<PathBuf>,
    /// The materials of a scene instead
    #[arg(long, value_name = "SCENE", global = true, conflicts_with = "database")]
    scene: Option<PathBuf>,
    /// As JSON
    #[arg(long, global = true)]
    json: bool,
}

#[derive(Subcommand)]
enum Task {
    /// Every material, a line each
    List,
    /// Those whose name, title or source holds every word
    Search {
        /// Words, letters of either case
        #[arg(required = true)]
        words: Vec<String>,
    },
    /// All that is known of some
    Show {
        /// Names
        #[arg(required = true)]
        names: Vec<String>,
    },
    /// Spectra of several on one chart
    Plot {
        /// Names [default: all, up to 21]
        names: Vec<String>,
        /// The file, .svg or .png
        #[arg(long, short, value_name = "FILE", default_value = "materials.svg", value_parser = parse_plot)]
        output: PathBuf,
    },
}

impl Materials {
    pub fn run(&self, quiet: bool) -> Outcome {
        let entries = match &self.scene {
            Some(scene) => materials_of(scene)?,
            None => database(self.database.as_deref())?,
        };
        match &self.task {
            None | Some(Task::List) => self.list(&entries.iter().collect::<Vec<_>>()),
            Some(Task::Search { words }) => {
                let found: Vec<&MaterialEntry> =
                    entries.iter().filter(|entry| words.iter().all(|word| entry.matches(word))).collect();
                if found.is_empty() {
                    return Err(Failure::BadInput(nothing(&entries, words)));
                }
                self.list(&found);
            }
            Some(Task::Show { names }) => {
                let chosen = named(&entries, names)?;
                if self.json {
                    print_json(&chosen.iter().map(|entry| entry.to_json()).collect());
                } else {
                    chosen.iter().for_each(|entry| print(shown(entry)));
                }
            }
            Some(Task::Plot { names, output }) => {
                let chosen = match names.is_empty() {
                    true => entries.iter().take(21).collect(),
                    false => named(&entries, names)?,
                };
                let specimens = (chosen.iter())
                    .map(|entry| match &self.scene {
                        Some(scene) => Specimen::of_scene(scene, &entry.name, None, None),
                        None => Specimen::of_database(self.database.as_deref(), &entry.name, None),
                    })
                    .collect::<Result<Vec<_>, _>>()?;
                write_pictures(&[(output, material_chart(&specimens)?)], quiet)?;
                if self.json {
                    print_json(&chosen.iter().map(|entry| entry.to_json()).collect());
                }
            }
        }
        Ok(ExitCode::SUCCESS)
    }

    fn list(&self, entries: &[&MaterialEntry]) {
        if self.json {
            return print_json(&Value::Array(entries.iter().map(|entry| entry.to_json()).collect()));
        }
        let wide = |text: &dyn Fn(&MaterialEntry) -> usize| entries.iter().map(|entry| text(entry)).max().unwrap_or(0);
        let names = wide(&|entry| entry.name.len()).max(4);
        let models = wide(&|entry| entry.models.join(", ").chars().count()).clamp(6, 40);
        let mut text = format!("{:names$}  {:>10}  {:models$}  title\n", "name", "nm", "models");
        for entry in entries {
            let what = match &entry.fault {
                Some(fault) => format!("does not hold: {fault}"),
                None => entry.title.clone().unwrap_or_default(),
            };
            let range = range(entry).replace(" nm", "");
            text += &format!("{:names$}  {range:>10}  {:models$}  {what}", entry.name, entry.models.join(", "));
            text.truncate(text.trim_end().len());
            text.push('\n');
        }
        print(text);
    }
}

fn range(entry: &MaterialEntry) -> String {
    entry.range.map_or("any".into(), |(low, high)| format!("{:.0}..{:.0} nm", low * 1e3, high * 1e3))
}

fn shown(entry: &MaterialEntry) -> String {
    let or_dash = |text: &Option<String>| text.clone().unwrap_or_else(|| "-".into());
    let mut text = format!(
        "{}\n  title        {}\n  wavelengths  {}\n  models       {}\n  source       {}\n  licence      {}\n  from         {}\n",
        entry.name,
        or_dash(&entry.title),
        range(entry),
        if entry.models.is_empty() { "-".into() } else { entry.models.join(", ") },
        or_dash(&entry.source),
        or_dash(&entry.licence),
        if entry.origin == entry.path { entry.path.clone() } else { format!("{}: {}", entry.origin, entry.path) },
    );
    if let Some(fault) = &entry.fault {
        text += &format!("  does not hold: {fault}\n");
    }
    text
}

fn named<'e>(entries: &'e [MaterialEntry], names: &[String]) -> Result<Vec<&'e MaterialEntry>, Failure> {
    let known: Vec<&str> = entries.iter().map(|entry| entry.name.as_str()).collect();
    let mut chosen = Vec::new();
    let mut faults = Vec::new();
    for name in names {
        match entries.iter().find(|entry| entry.name == *name) {
            Some(entry) => chosen.push(entry),
            None => faults.push(unknown_name("material", name, &known)),
        }
    }
    if faults.is_empty() { Ok(chosen) } else { Err(Failure::BadInput(faults.join("\nerror: "))) }
}

/// That nothing matches, with the names and words of titles that are nearest to each word.
fn nothing(entries: &[MaterialEntry], words: &[String]) -> String {
    let text =
        |entry: &MaterialEntry| format!("{} {}", entry.name.replace('_', " "), entry.title.as_deref().unwrap_or(""));
    let all: Vec<String> = entries.iter().map(text).collect();
    let known = || all.iter().flat_map(|text| text.split(|c: char| !c.is_alphanumeric())).filter(|word| word.len() > 2);
    let near: Vec<String> =
        words.iter().filter_map(|word| nearest(word, known())).map(|near| format!("`{near}`")).collect();
    let asked = words.join(" ");
    match near.is_empty() {
        true => format!("no material has `{asked}` in its name, title or source; `sunglint materials` lists all"),
        false => format!("no material has `{asked}` in its name, title or source; did you mean {}?", near.join(", ")),
    }
}
