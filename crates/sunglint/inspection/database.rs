//! The materials that a scene may name: the shipped database, a folder of the user's, and those of a scene.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use serde_json::{Value, json};
use sunglint_dsl::{Severity, Sources, ast};

use super::InspectionError;
use super::specimen::{Specimen, alone, using, whole};
use crate::{Checked, Files, check};

/// Most materials of one folder.
const MOST_FILES: usize = 10_000;

/// A material, as lists show it.
#[derive(Clone, Debug, PartialEq)]
pub struct MaterialEntry {
    /// Name.
    pub name: String,
    /// What it is.
    pub title: Option<String>,
    /// Where its numbers are from.
    pub source: Option<String>,
    /// Their licence.
    pub licence: Option<String>,
    /// Its models, each with its label where it has one.
    pub models: Vec<String>,
    /// The wavelengths \[µm\] that its reflectance covers; `None` where it does not depend on wavelength.
    pub range: Option<(f64, f64)>,
    /// `shipped`, or the folder or scene.
    pub origin: String,
    /// The file that states it, as an `include` would name it.
    pub path: String,
    /// What is wrong with it, if anything is.
    pub fault: Option<String>,
}

impl MaterialEntry {
    /// As JSON.
    pub fn to_json(&self) -> Value {
        json!({
            "name": self.name,
            "title": self.title,
            "source": self.source,
            "licence": self.licence,
            "models": self.models,
            "shortest_wavelength_um": self.range.map(|range| range.0),
            "longest_wavelength_um": self.range.map(|range| range.1),
            "origin": self.origin,
            "file": self.path,
            "fault": self.fault,
        })
    }

    /// Whether a word stands in its name, title or source, letters of either case.
    pub fn matches(&self, word: &str) -> bool {
        let word = word.to_lowercase();
        let texts = [Some(&self.name), self.title.as_ref(), self.source.as_ref()];
        texts.into_iter().flatten().any(|text| text.to_lowercase().contains(&word))
    }
}

/// The database in the order of names; a user's material hides a shipped one of its name.
///
/// # Errors
/// A folder that cannot be read.
pub fn database(folder: Option<&Path>) -> Result<Vec<MaterialEntry>, InspectionError> {
    let mut entries: BTreeMap<String, MaterialEntry> = BTreeMap::new();
    for (name, _) in sunglint_reflectance::shipped_materials() {
        let path = format!("sunglint:materials/{name}.glint");
        entries.insert(name.to_string(), entry(name, &path, "shipped"));
    }
    if let Some(folder) = folder {
        let shown = folder.to_string_lossy();
        let unreadable = |error| InspectionError::Input(format!("the folder `{shown}` is not readable: {error}"));
        for file in fs::read_dir(folder).map_err(unreadable)?.take(MOST_FILES) {
            let path = file.map_err(unreadable)?.path();
            let is_material = path.extension().is_some_and(|ending| ending == "glint");
            if let (true, Some(name)) = (is_material, path.file_stem().and_then(|stem| stem.to_str())) {
                entries.insert(name.to_string(), entry(name, &path.to_string_lossy(), &shown));
            }
        }
    }
    Ok(entries.into_values().collect())
}

/// The materials of a scene, those too that nothing refers to, in their order there.
///
/// # Errors
/// Those of the scene.
pub fn materials_of(scene: &Path) -> Result<Vec<MaterialEntry>, InspectionError> {
    let path = scene.to_string_lossy();
    let (first, _) = whole(check(scene))?;
    let names: Vec<&str> = first.materials.iter().map(|material| material.name.as_str()).collect();
    let checked = using(scene, &names);
    let said = said(&path);
    let (scene, sources) = whole(checked)?;
    let entry = |name: &str| {
        let mut entry = blank(name, &path, &path);
        fill(&mut entry, &scene, &sources, said.get(name));
        entry
    };
    Ok(names.into_iter().map(entry).collect())
}

fn blank(name: &str, path: &str, origin: &str) -> MaterialEntry {
    MaterialEntry {
        name: name.to_string(),
        title: None,
        source: None,
        licence: None,
        models: Vec::new(),
        range: None,
        origin: origin.to_string(),
        path: path.to_string(),
        fault: None,
    }
}

fn entry(name: &str, path: &str, origin: &str) -> MaterialEntry {
    let mut entry = blank(name, path, origin);
    let said = said(path);
    let Checked { scene, sources, diagnostics, .. } = alone(path, name);
    let error = diagnostics.iter().find(|diagnostic| diagnostic.severity == Severity::Error);
    match (scene, error) {
        (Some(scene), None) => fill(&mut entry, &scene, &sources, said.get(name)),
        (_, error) => {
            let message = |d: &sunglint_dsl::Diagnostic| match d.span.map(|span| (span, sources.line_column(span))) {
                Some((span, (line, column))) => {
                    format!("{}:{line}:{column}: {}", sources.get(span.file).path, d.message)
                }
                None => d.message.clone(),
            };
            entry.fault = Some(error.map_or_else(|| "the file does not hold".to_string(), message));
            texts(&mut entry, said.get(name));
        }
    }
    entry
}

fn fill(entry: &mut MaterialEntry, scene: &sunglint_dsl::Scene, sources: &Sources, said: Option<&Said>) {
    texts(entry, said);
    let Some(material) = scene.materials.iter().find(|known| known.name == entry.name) else { return };
    entry.title = material.title.clone().or(entry.title.take());
    entry.models = (material.models.iter().filter(|use_| use_.span.is_some()))
        .map(|use_| use_.label.as_ref().map_or(use_.name.clone(), |label| format!("{} {label}", use_.name)))
        .collect();
    if let Ok(specimen) = Specimen::choose(scene, sources.clone(), &entry.name, None, None) {
        entry.range = specimen.whole_range();
    }
}

type Said = BTreeMap<&'static str, String>;

fn texts(entry: &mut MaterialEntry, said: Option<&Said>) {
    let text = |key: &str| said.and_then(|said| said.get(key)).cloned();
    (entry.title, entry.source, entry.licence) = (text("title"), text("source"), text("licence"));
}

/// Title, source and licence of the materials of a file, as written.
fn said(path: &str) -> BTreeMap<String, Said> {
    let mut found = BTreeMap::new();
    let tree = sunglint_dsl::parse(path, &mut Files::default(), &mut Sources::default(), &mut Vec::new());
    for statement in tree.statements.iter().filter(|statement| statement.key.text == "material") {
        let (Some(ast::Item { value: ast::Value::Word(name), .. }), Some(block)) =
            (statement.items.first(), &statement.block)
        else {
            continue;
        };
        let said: &mut Said = found.entry(name.clone()).or_default();
        for line in &block.statements {
            for key in ["title", "source", "licence"] {
                if let (true, Some(ast::Value::Text(text))) =
                    (line.key.text == key, line.items.first().map(|item| &item.value))
                {
                    said.insert(key, text.clone());
                }
            }
        }
    }
    found
}
