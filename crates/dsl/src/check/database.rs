//! Databases of materials: folders whose files `NAME.glint` hold one `material NAME { … }` each.

use std::collections::BTreeSet;

use super::Checker;
use super::block::Body;
use crate::ast::{Item, Statement, Value};
use crate::{Diagnostic, Severity, Span};

/// The folder that comes with the program, searched last.
const SHIPPED: &str = "sunglint:materials";

/// A folder of materials.
pub(super) struct Folder {
    path: String,
    /// The file that names it.
    from: String,
    /// Names of its materials.
    names: BTreeSet<String>,
}

impl<'a> Checker<'a> {
    /// Lists the databases of a scene, in the order in which they are searched.
    pub(super) fn databases(&mut self, top: &Body<'a>) {
        for line in top.all("database") {
            let Some((path, given)) = self.text(&line) else { continue };
            let from = self.sources.get(given.home.file).path.clone();
            match self.loader.list(path, &from) {
                Ok(files) => self.add_folder(path.trim_end_matches('/'), &from, &files),
                Err(error) => {
                    let fault = self.misfit(&given, "F01", error.message);
                    let near = error.nearest.map(|near| format!("\"{near}\"?")).unwrap_or_default();
                    self.report(fault.label(near));
                }
            }
        }
        let shipped = self.loader.list(SHIPPED, "").unwrap_or_default();
        self.add_folder(SHIPPED, "", &shipped);
    }

    fn add_folder(&mut self, path: &str, from: &str, files: &[String]) {
        let names = files.iter().filter_map(|file| file.strip_suffix(".glint")).map(str::to_string).collect();
        self.folders.push(Folder { path: path.to_string(), from: from.to_string(), names });
    }

    /// Whether some database has a material.
    pub(super) fn in_database(&self, name: &str) -> bool {
        self.folders.iter().any(|folder| folder.names.contains(name))
    }

    /// Names of the materials of all databases.
    pub(super) fn database_names(&self) -> impl Iterator<Item = &str> {
        self.folders.iter().flat_map(|folder| &folder.names).map(String::as_str)
    }

    /// The statement `material NAME { … }` of the first database that has it, wanted at a place. Its faults are reported.
    pub(super) fn take_from_database(&mut self, name: &str, wanted: Span) -> Option<&'a Statement> {
        if let Some(known) = self.shelved.get(name) {
            return *known;
        }
        let folder = self.folders.iter().find(|folder| folder.names.contains(name))?;
        let (path, from) = (format!("{}/{name}.glint", folder.path), folder.from.clone());
        let found = self.read_material(name, &path, &from, wanted);
        self.shelved.insert(name.to_string(), found);
        found
    }

    fn read_material(&mut self, name: &str, path: &str, from: &str, wanted: Span) -> Option<&'a Statement> {
        let mut faults = Vec::new();
        let statements = crate::parse::parse_file(path, from, wanted, self.loader, self.sources, &mut faults);
        let broken = faults.iter().any(|fault| fault.severity == Severity::Error);
        for fault in faults {
            let code = if fault.severity == Severity::Error { "F01" } else { fault.code };
            let elsewhere = fault.span.is_some_and(|span| span.file != wanted.file);
            let fault = Diagnostic { code, ..fault };
            self.report(if elsewhere { fault.note(wanted, "this takes it from the database") } else { fault });
        }
        if broken {
            return None;
        }
        let is_it = |statement: &Statement| {
            let named = matches!(statement.items.first(), Some(Item { value: Value::Word(word), .. }) if word == name);
            statement.key.text == "material" && named
        };
        let mut found = None;
        for statement in statements {
            if found.is_none() && is_it(&statement) {
                found = Some(self.kept.keep(statement));
                continue;
            }
            let message = format!("a file of a database holds one material; `{path}` is to hold `{name}`");
            let fault = Diagnostic::error("F01", statement.span, message).label(format!("`material {name} {{ … }}`?"));
            self.report(fault.note(wanted, "this takes it from the database"));
            return None;
        }
        if found.is_none() {
            let message = format!("`{path}` of the database holds no material");
            self.report(
                Diagnostic::error("F01", wanted, message).label(format!("`material {name} {{ … }}` belongs in it")),
            );
        }
        found
    }
}
