//! Text to tree. Each step is linear in the text, and none knows a keyword:
//!
//! 1. Braces and brackets are matched, and reported where they do not ([`brace`]): nothing later can be deep or slow.
//! 2. A scanner splits the text into statements and their blocks, so that a bad line costs one message. It reads lists
//!    and runs of points itself: to the grammar, each is one token ([`scanner`]).
//! 3. The grammar, `scene.pest`, parses the line of each statement: words, numbers, units, ranges, dates, strings. It
//!    has rules for what goes wrong, so that it never fails ([`item`]).
//! 4. Includes are resolved and version lines read, below.

mod brace;
mod fault;
mod item;
mod line;
pub(crate) mod mark;
mod scanner;
pub(crate) mod spelling;

use std::collections::BTreeSet;

use crate::ast::{Ast, Statement, Value};
use crate::{Diagnostic, FileId, Loader, Severity, Sources, Span};
use fault::Faults;

/// Version of the language that this program reads.
pub const VERSION: u32 = 1;

/// Deepest nesting of blocks, and of includes.
pub const MAX_DEPTH: usize = 32;

/// Largest file \[bytes\].
const MAX_BYTES: usize = 512 << 20;

/// Most files in a scene.
const MAX_FILES: usize = 1000;

/// Reads a scene and what it includes. Whatever the text holds, the tree has all that could be made sense of, and
/// `diagnostics` says what could not. `glint` lines are taken out of the tree, and with them the `include` lines.
pub fn parse(path: &str, loader: &mut dyn Loader, sources: &mut Sources, diagnostics: &mut Vec<Diagnostic>) -> Ast {
    let mut reader = Reader { loader, sources, diagnostics, seen: BTreeSet::new(), open: Vec::new(), version: None };
    let mut ast = Ast::default();
    reader.file(path, "", None, &mut ast.statements);
    ast.version = reader.version;
    ast
}

/// Reads a further file, which `path` names in the file `from` at `place`: its statements, with what they include.
pub(crate) fn parse_file(
    path: &str,
    from: &str,
    place: Span,
    loader: &mut dyn Loader,
    sources: &mut Sources,
    diagnostics: &mut Vec<Diagnostic>,
) -> Vec<Statement> {
    let mut reader = Reader { loader, sources, diagnostics, seen: BTreeSet::new(), open: Vec::new(), version: None };
    let mut statements = Vec::new();
    reader.file(path, from, Some(place), &mut statements);
    statements
}

/// The statements of one file, its includes not followed. `None` where the text has a fault of shape.
pub(crate) fn one_file(
    path: &str,
    bytes: &[u8],
    sources: &mut Sources,
    diagnostics: &mut Vec<Diagnostic>,
) -> Option<(FileId, Vec<Statement>)> {
    let known = diagnostics.len();
    let id = text(path, bytes, None, MAX_BYTES, sources, diagnostics)?;
    let statements = scanner::statements(&sources.get(id).text, Faults::new(id, diagnostics));
    let sound = diagnostics[known..].iter().all(|fault| fault.severity != Severity::Error);
    sound.then_some((id, statements))
}

struct Reader<'a> {
    loader: &'a mut dyn Loader,
    sources: &'a mut Sources,
    diagnostics: &'a mut Vec<Diagnostic>,
    /// Files that were read.
    seen: BTreeSet<String>,
    /// Files that are being read, each with the `include` that named it.
    open: Vec<(String, Option<Span>)>,
    version: Option<(f64, Span)>,
}

impl Reader<'_> {
    /// Reads a file that `path` names in the file `from`, by the `include` at `place`; the main file has none.
    fn file(&mut self, path: &str, from: &str, place: Option<Span>, statements: &mut Vec<Statement>) {
        let loaded = match self.loader.read(path, from) {
            Ok(loaded) => loaded,
            Err(error) => {
                let fault = at("F01", place, error.message);
                let fault = match (error.nearest, place) {
                    (Some(nearest), Some(_)) => fault.label(format!("`\"{nearest}\"`?")),
                    (Some(nearest), None) => fault.help(format!("is it `{nearest}`?")),
                    (None, _) => fault.label("not read"),
                };
                self.diagnostics.push(fault);
                if place.is_none() {
                    self.sources.add(path, "");
                }
                return;
            }
        };
        let name = plain_path(&loaded.path);
        if let Some(first) = self.open.iter().position(|(open, _)| *open == name) {
            return self.report_cycle(first, &name, place);
        }
        if self.seen.contains(&name) {
            return;
        }
        if self.open.len() >= MAX_DEPTH {
            return self.diagnostics.push(at("S01", place, format!("includes are nested more than {MAX_DEPTH} deep")));
        }
        if self.seen.len() >= MAX_FILES {
            return self.diagnostics.push(at("F01", place, format!("a scene has at most {MAX_FILES} files")));
        }
        self.seen.insert(name.clone());
        let asked = path;
        let crate::Loaded { path, bytes } = loaded;
        let Some(id) = self.text(&path, &bytes, place, MAX_BYTES) else { return };
        drop(bytes);
        self.loader.done(asked, from);
        let found = scanner::statements(&self.sources.get(id).text, Faults::new(id, self.diagnostics));
        self.open.push((name, place));
        self.version(&found, id, place);
        for statement in found {
            match statement.key.text.as_str() {
                "glint" => {}
                "scene" | "snapshot" if place.is_some() => {}
                "include" => self.include(&statement, &path, statements),
                _ => statements.push(statement),
            }
        }
        self.open.pop();
    }

    /// Adds the text of a file to the sources, if it is text.
    fn text(&mut self, path: &str, bytes: &[u8], place: Option<Span>, most: usize) -> Option<FileId> {
        text(path, bytes, place, most, self.sources, self.diagnostics)
    }

    /// The version line of a file.
    fn version(&mut self, statements: &[Statement], file: FileId, place: Option<Span>) {
        let mut lines = statements.iter().enumerate().filter(|(_, statement)| statement.key.text == "glint");
        let Some((index, line)) = lines.next() else {
            let start = Span { file, start: 0, end: 0 };
            let span = statements.first().map_or(start, |statement| statement.key.span);
            let fault =
                Diagnostic::warning("S06", span, "the version of the language is not stated; the newest is meant");
            return self.diagnostics.push(fault.label(format!("`glint {VERSION}` belongs before this")));
        };
        let newest = f64::from(VERSION);
        let stated = match line.items.as_slice() {
            [item] if line.block.is_none() => match &item.value {
                Value::Number { number, unit: None, .. } => Some((*number, item.span)),
                _ => None,
            },
            _ => None,
        };
        let fault = match stated {
            None => {
                Some(Diagnostic::error("S06", line.span, "a version is one number").label(format!("`glint {VERSION}`")))
            }
            Some((number, span)) if number > newest => {
                let message =
                    format!("version {number} of the language is newer than this program, which reads {VERSION}");
                Some(
                    Diagnostic::error("S06", span, message)
                        .label("too new")
                        .help("a newer release of the program reads it"),
                )
            }
            Some((number, span)) if number < 1.0 || number.fract() != 0.0 => {
                let message = format!("there is no version {number} of the language");
                Some(Diagnostic::error("S06", span, message).label(format!("`{VERSION}`?")))
            }
            Some(_) if index > 0 => {
                let fault = Diagnostic::warning("S06", line.span, "the version stands first in a file");
                Some(fault.label("before all other statements"))
            }
            Some(_) => None,
        };
        self.diagnostics.extend(fault);
        for (_, second) in lines {
            let fault = Diagnostic::error("S05", second.span, "the version is stated twice").label("leave it out");
            self.diagnostics.push(fault.note(line.span, "first here"));
        }
        if place.is_none() {
            self.version = stated;
        }
    }

    /// `include STRING`
    fn include(&mut self, statement: &Statement, from: &str, statements: &mut Vec<Statement>) {
        match statement.items.as_slice() {
            [item] if statement.block.is_none() => {
                if let Value::Text(path) = &item.value {
                    return self.file(path, from, Some(item.span), statements);
                }
            }
            _ => {}
        }
        let fault = Diagnostic::error("S02", statement.span, "an include is one file, in quotes");
        self.diagnostics.push(match statement.items.first().map(|item| &item.value) {
            Some(Value::Word(word)) => fault.label(format!("`include \"{word}\"`?")),
            _ => fault.label("such as `include \"site.glint\"`"),
        });
    }

    fn report_cycle(&mut self, first: usize, name: &str, place: Option<Span>) {
        let names: Vec<&str> = self.open[first..].iter().map(|(open, _)| open.as_str()).chain([name]).collect();
        let path = names.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(" → ");
        let mut fault = at("N04", place, format!("a file includes itself: {path}")).label("this closes the circle");
        for (_, place) in &self.open[first + 1..] {
            if let Some(place) = place {
                fault = fault.note(*place, "by way of this");
            }
        }
        self.diagnostics.push(fault);
    }
}

/// Adds the text of a file to the sources, if it is text.
fn text(
    path: &str,
    bytes: &[u8],
    place: Option<Span>,
    most: usize,
    sources: &mut Sources,
    diagnostics: &mut Vec<Diagnostic>,
) -> Option<FileId> {
    if bytes.len() > most {
        if place.is_none() {
            sources.add(path, "");
        }
        let message = format!("`{path}` has {} MiB; a scene file has at most {}", bytes.len() >> 20, most >> 20);
        let fault = at("F01", place, message).help("large geometry belongs in an OBJ file, tables in CSV files");
        diagnostics.push(fault);
        return None;
    }
    let bytes = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    let error = match std::str::from_utf8(bytes) {
        Ok(text) if !text.contains('\0') => return Some(sources.add(path, text)),
        Ok(text) => text.find('\0').unwrap_or(0),
        Err(error) => error.valid_up_to(),
    };
    let line = bytes[error..].iter().take(200).position(|byte| *byte == b'\n').unwrap_or(200);
    let shown = String::from_utf8_lossy(&bytes[..(error + line).min(bytes.len())]).replace('\0', " ");
    let len = shown[error..].chars().next().map_or(0, char::len_utf8);
    let id = sources.add(path, shown);
    let span = Span { file: id, start: error as u32, end: (error + len) as u32 };
    let byte = bytes[error];
    let wide = bytes.starts_with(b"\xFF\xFE") || bytes.starts_with(b"\xFE\xFF") || byte == 0 && bytes.len() > 1;
    let fault = Diagnostic::error("F01", span, format!("`{path}` is not UTF-8 text")).help("save it as UTF-8");
    let fault = match byte {
        _ if wide => fault.label("this looks like UTF-16, or like no text"),
        0xA0.. => fault.label(format!("byte {byte:02X} is `{}` in Latin-1", char::from(byte))),
        _ => fault.label(format!("byte {byte:02X}")),
    };
    diagnostics.push(match place {
        Some(place) => fault.note(place, "included here"),
        None => fault,
    });
    None
}

/// A finding at an include, or of the scene as a whole.
fn at(code: &'static str, place: Option<Span>, message: String) -> Diagnostic {
    Diagnostic { span: place, severity: Severity::Error, ..Diagnostic::whole(code, message) }
}

/// A path without `.` and `..`, by which a file is known.
fn plain_path(path: &str) -> String {
    let mut parts: Vec<&str> = Vec::new();
    for (i, part) in path.split('/').enumerate() {
        match part {
            "." => {}
            "" if i > 0 => {}
            ".." if parts.last().is_some_and(|last| !matches!(*last, "" | "..")) => {
                parts.pop();
            }
            _ => parts.push(part),
        }
    }
    parts.join("/")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{LoadError, Loaded};

    /// Each file `n` includes the file `n + 1`, without end.
    struct Endless;

    impl Loader for Endless {
        fn read(&mut self, path: &str, _: &str) -> Result<Loaded, LoadError> {
            let next = path.parse::<u32>().unwrap_or(0) + 1;
            let text = format!("glint 1\ninclude \"{next}\"\na{next}");
            Ok(Loaded { path: path.to_string(), bytes: text.into_bytes().into() })
        }
    }

    #[test]
    fn includes_without_end_stop() {
        let (mut sources, mut diagnostics) = (Sources::default(), Vec::new());
        let ast = parse("0", &mut Endless, &mut sources, &mut diagnostics);
        assert_eq!((ast.statements.len(), sources.iter().count()), (MAX_DEPTH, MAX_DEPTH));
        assert_eq!(diagnostics.iter().map(|d| d.code).collect::<Vec<_>>(), ["S01"]);
    }

    #[test]
    fn a_file_that_is_too_large_is_not_read() {
        let (mut sources, mut diagnostics) = (Sources::default(), Vec::new());
        let mut reader = Reader {
            loader: &mut Endless,
            sources: &mut sources,
            diagnostics: &mut diagnostics,
            seen: BTreeSet::new(),
            open: Vec::new(),
            version: None,
        };
        assert!(reader.text("a.glint", b"glint 1", None, 6).is_none());
        assert!(reader.text("a.glint", b"glint 1", None, 7).is_some());
        assert_eq!((diagnostics.len(), diagnostics[0].code), (1, "F01"));
    }

    #[test]
    fn a_file_is_known_by_its_plain_path() {
        for (path, plain) in [("./a.glint", "a.glint"), ("x/../a", "a"), ("../x/./b", "../x/b"), ("/x//y/../z", "/x/z")]
        {
            assert_eq!(plain_path(path), plain);
        }
    }
}
