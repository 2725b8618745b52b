//! Source texts and places in them.

use std::sync::OnceLock;

/// Index of a file in [`Sources`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct FileId(pub u32);

/// A place in a source text: byte offsets, end exclusive.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Span {
    /// The file.
    pub file: FileId,
    /// First byte.
    pub start: u32,
    /// One past the last byte.
    pub end: u32,
}

impl Span {
    /// From the start of one span to the end of another in the same file.
    #[must_use]
    pub fn to(self, other: Span) -> Span {
        Span { file: self.file, start: self.start.min(other.start), end: self.end.max(other.end) }
    }
}

/// A source text.
#[derive(Clone, Debug, PartialEq)]
pub struct Source {
    /// Path as shown in messages.
    pub path: String,
    /// The text.
    pub text: String,
}

/// The files of a scene: the main file first, then what it includes. Tables and spectra that a diagnostic points into
/// are added too.
#[derive(Clone, Debug, Default)]
pub struct Sources {
    files: Vec<Source>,
    /// Where the lines of each file begin, once that was asked.
    lines: Vec<OnceLock<Vec<u32>>>,
}

impl PartialEq for Sources {
    fn eq(&self, other: &Self) -> bool {
        self.files == other.files
    }
}

impl Sources {
    /// Adds a file.
    pub fn add(&mut self, path: impl Into<String>, text: impl Into<String>) -> FileId {
        self.files.push(Source { path: path.into(), text: text.into() });
        self.lines.push(OnceLock::new());
        FileId(self.files.len() as u32 - 1)
    }
    /// A file.
    pub fn get(&self, id: FileId) -> &Source {
        &self.files[id.0 as usize]
    }
    /// All files.
    pub fn iter(&self) -> impl Iterator<Item = &Source> {
        self.files.iter()
    }
    /// The text of a span.
    pub fn text(&self, span: Span) -> &str {
        &self.get(span.file).text[span.start as usize..span.end as usize]
    }
    /// Line of a span's start, from 1.
    pub fn line(&self, span: Span) -> usize {
        self.line_starts(span.file).partition_point(|start| *start <= span.start)
    }
    /// Line and column of a span's start, both from 1; the column counts characters.
    pub fn line_column(&self, span: Span) -> (usize, usize) {
        let line = self.line(span);
        let start = self.line_starts(span.file)[line - 1];
        (line, self.get(span.file).text[start as usize..span.start as usize].chars().count() + 1)
    }

    fn line_starts(&self, id: FileId) -> &[u32] {
        self.lines[id.0 as usize].get_or_init(|| {
            let ends = self.get(id).text.match_indices('\n');
            std::iter::once(0).chain(ends.map(|(i, _)| i as u32 + 1)).collect()
        })
    }
}
