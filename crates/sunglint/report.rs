//! Diagnostics for people and for programs: the only place that knows about terminals.

use annotate_snippets::{AnnotationKind, Group, Level, Renderer, Snippet};
use serde_json::{Value, json};
use sunglint_dsl::{Diagnostic, FileId, Severity, Sources, Span};

/// Lines of the source that one annotation shows at most; of a longer place the first line is shown.
const MOST_LINES: usize = 6;

/// Lines between two places that are shown in one picture.
const MOST_APART: usize = 400;

/// Characters of a line that are shown on either side of a place.
const CONTEXT: usize = 60;

/// Characters of a place that are shown; a longer one is cut.
const MOST_SPAN: usize = 100;

/// The findings as text, ordered by file and place; those of the scene as a whole stand last.
pub fn render(diagnostics: &[Diagnostic], sources: &Sources, color: bool) -> String {
    let renderer = if color { Renderer::styled() } else { Renderer::plain() };
    let index = Index::new(sources);
    let report = |diagnostic: &Diagnostic| {
        let pictures = pictures(diagnostic, &index);
        let mut text = renderer.render(&[group(diagnostic, &pictures, &index)]).trim_end().to_string() + "\n";
        // The renderer counts columns in the text that it is given, of which the start may be cut off.
        for picture in &pictures {
            if let Some((shown, column)) = picture.cut {
                let place = format!("{}:{}:", index.path(picture.file), picture.first_line);
                text = text.replacen(&format!("{place}{shown}"), &format!("{place}{column}"), 1);
            }
        }
        text
    };
    ordered(diagnostics).into_iter().map(report).collect::<Vec<_>>().join("\n")
}

/// The findings as data, in the same order. Lines and columns count from 1, columns in characters; `end_column` is one
/// past the last character. A finding of the scene as a whole has no place.
pub fn to_json(diagnostics: &[Diagnostic], sources: &Sources) -> Value {
    let index = Index::new(sources);
    ordered(diagnostics)
        .into_iter()
        .map(|diagnostic| {
            let mut value = diagnostic.span.map_or_else(no_place, |span| index.place(span));
            value["code"] = json!(diagnostic.code);
            value["severity"] = json!(name(diagnostic.severity));
            value["message"] = json!(diagnostic.message);
            value["label"] = json!(Some(&diagnostic.label).filter(|label| !label.is_empty()));
            value["help"] = json!(diagnostic.help);
            let note = |(span, text): &(Span, String)| {
                let mut note = index.place(*span);
                note["message"] = json!(text);
                note
            };
            value["notes"] = diagnostic.notes.iter().map(note).collect();
            value
        })
        .collect()
}

fn name(severity: Severity) -> &'static str {
    match severity {
        Severity::Error => "error",
        Severity::Warning => "warning",
    }
}

fn ordered(diagnostics: &[Diagnostic]) -> Vec<&Diagnostic> {
    let mut ordered: Vec<&Diagnostic> = diagnostics.iter().collect();
    ordered.sort_by(|a, b| match (a.span, b.span) {
        (Some(a), Some(b)) => a.cmp(&b),
        (a, b) => a.is_none().cmp(&b.is_none()),
    });
    ordered.dedup_by(|a, b| a == b);
    ordered
}

fn group<'a>(diagnostic: &'a Diagnostic, pictures: &'a [Picture], index: &'a Index) -> Group<'a> {
    let level = match diagnostic.severity {
        Severity::Error => Level::ERROR,
        Severity::Warning => Level::WARNING,
    };
    let mut group = Group::with_title(level.primary_title(&diagnostic.message).id(diagnostic.code));
    for picture in pictures {
        let mut snippet = Snippet::source(&picture.text).path(index.path(picture.file)).line_start(picture.first_line);
        for (from, to, kind, label) in &picture.marks {
            let mark = kind.span(*from..*to);
            snippet = snippet.annotation(if label.is_empty() { mark } else { mark.label(*label) });
        }
        group = group.element(snippet);
    }
    match &diagnostic.help {
        Some(help) => group.element(Level::HELP.message(help)),
        None => group,
    }
}

/// Lines of one file with marks in them.
struct Picture<'a> {
    file: FileId,
    first_line: usize,
    text: String,
    marks: Vec<(usize, usize, AnnotationKind, &'a str)>,
    /// Column of the mark in `text` and in the file, where the start of the line is cut off.
    cut: Option<(usize, usize)>,
}

/// The places of a finding: the file of the finding first, all marks of a file in one picture, unless its lines are too
/// long to be shown whole or too far apart: then each has its own.
fn pictures<'a>(diagnostic: &'a Diagnostic, index: &Index) -> Vec<Picture<'a>> {
    let mut places: Vec<(Span, AnnotationKind, &str)> = Vec::new();
    places.extend(diagnostic.span.map(|span| (span, AnnotationKind::Primary, diagnostic.label.as_str())));
    places.extend(diagnostic.notes.iter().map(|(span, text)| (*span, AnnotationKind::Context, text.as_str())));
    let own = places.first().map(|(span, ..)| span.file);
    places.sort_by_key(|(span, ..)| (Some(span.file) != own, span.file));
    places.chunk_by(|(a, ..), (b, ..)| a.file == b.file).flat_map(|places| of_one_file(places, index)).collect()
}

fn of_one_file<'a>(places: &[(Span, AnnotationKind, &'a str)], index: &Index) -> Vec<Picture<'a>> {
    let long = places.iter().any(|(span, ..)| index.is_long(*span));
    let top = places.iter().map(|(span, ..)| index.lines(*span).0).min().unwrap_or(0);
    let bottom = places.iter().map(|(span, ..)| index.lines(*span).1).max().unwrap_or(0);
    if long || bottom - top > MOST_APART {
        return places.iter().map(|(span, kind, label)| index.cut(*span, *kind, label)).collect();
    }
    let Some((span, ..)) = places.first() else { return Vec::new() };
    let (from, to) = (index.line_start(span.file, top), index.line_end(span.file, bottom));
    let marks = (places.iter())
        .map(|(span, kind, label)| {
            let (start, end) = index.first_lines(*span);
            (start - from, end - from, *kind, *label)
        })
        .collect();
    let text = index.text(span.file)[from..to].replace('\r', " ");
    vec![Picture { file: span.file, first_line: top + 1, text, marks, cut: None }]
}

/// Starts of the lines of each file.
struct Index<'a> {
    sources: &'a Sources,
    starts: Vec<Vec<usize>>,
}

impl<'a> Index<'a> {
    fn new(sources: &'a Sources) -> Self {
        let starts = |text: &str| std::iter::once(0).chain(text.match_indices('\n').map(|(i, _)| i + 1)).collect();
        Self { sources, starts: sources.iter().map(|source| starts(&source.text)).collect() }
    }

    fn path(&self, file: FileId) -> &'a str {
        &self.sources.get(file).path
    }

    fn text(&self, file: FileId) -> &'a str {
        &self.sources.get(file).text
    }

    /// The span within its text, on character boundaries whatever was handed in.
    fn bounds(&self, span: Span) -> (usize, usize) {
        let text = self.text(span.file);
        let mut start = (span.start as usize).min(text.len());
        let mut end = (span.end as usize).clamp(start, text.len());
        while !text.is_char_boundary(start) {
            start -= 1;
        }
        while !text.is_char_boundary(end) {
            end += 1;
        }
        (start, end)
    }

    fn line_of(&self, file: FileId, at: usize) -> usize {
        self.starts[file.0 as usize].partition_point(|start| *start <= at) - 1
    }

    fn line_start(&self, file: FileId, line: usize) -> usize {
        self.starts[file.0 as usize][line]
    }

    /// End of a line without its line break.
    fn line_end(&self, file: FileId, line: usize) -> usize {
        self.starts[file.0 as usize].get(line + 1).map_or(self.text(file).len(), |next| next - 1)
    }

    /// First and last line of a place, of a long one only the first.
    fn lines(&self, span: Span) -> (usize, usize) {
        let (start, end) = self.first_lines(span);
        (self.line_of(span.file, start), self.line_of(span.file, end.max(start + 1) - 1))
    }

    /// Bounds of a place, without a line break at its end; one of many lines ends with its first.
    fn first_lines(&self, span: Span) -> (usize, usize) {
        let (start, mut end) = self.bounds(span);
        let text = self.text(span.file);
        end = start + text[start..end].trim_end_matches(['\n', '\r']).len();
        let first = self.line_of(span.file, start);
        if self.line_of(span.file, end.max(start + 1) - 1) >= first + MOST_LINES {
            end = self.line_end(span.file, first).max(start);
        }
        (start, end)
    }

    fn is_long(&self, span: Span) -> bool {
        let (first, last) = self.lines(span);
        (first..=last)
            .any(|line| self.line_end(span.file, line) - self.line_start(span.file, line) > MOST_SPAN + 2 * CONTEXT)
    }

    /// Line and column from 1; the column counts characters.
    fn position(&self, file: FileId, at: usize) -> (usize, usize) {
        let line = self.line_of(file, at);
        (line + 1, self.text(file)[self.line_start(file, line)..at].chars().count() + 1)
    }

    /// A place in a long line, with what stands about it.
    fn cut<'b>(&self, span: Span, kind: AnnotationKind, label: &'b str) -> Picture<'b> {
        let (start, _) = self.bounds(span);
        let (_, end) = self.first_lines(span);
        let (line, column) = self.position(span.file, start);
        let text = self.text(span.file);
        let (first, last) = (self.line_start(span.file, line - 1), self.line_end(span.file, line - 1));
        let end = end.min(last).max(start);
        let skip = |text: &str, n: usize| text.char_indices().nth(n).map_or(text.len(), |(i, _)| i);
        let before = &text[first..start];
        let from = start - before.char_indices().rev().nth(CONTEXT - 1).map_or(before.len(), |(i, _)| before.len() - i);
        let shown = start + skip(&text[start..end], MOST_SPAN);
        let to = shown + skip(&text[shown..last.max(shown)], CONTEXT);
        let head = if from > first { "… " } else { "" };
        let tail = if to < last { " …" } else { "" };
        let line_text = format!("{head}{}{tail}", &text[from..to]).replace('\r', " ");
        let mark = start - from + head.len();
        Picture {
            file: span.file,
            first_line: line,
            marks: vec![(mark, mark + shown - start, kind, label)],
            cut: Some((line_text[..mark].chars().count() + 1, column)),
            text: line_text,
        }
    }

    fn place(&self, span: Span) -> Value {
        let (start, end) = self.bounds(span);
        let ((line, column), (end_line, end_column)) = (self.position(span.file, start), self.position(span.file, end));
        json!({
            "file": self.path(span.file),
            "line": line, "column": column, "end_line": end_line, "end_column": end_column,
        })
    }
}

fn no_place() -> Value {
    json!({ "file": null, "line": null, "column": null, "end_line": null, "end_column": null })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn span(file: FileId, text: &str, what: &str) -> Span {
        let start = text.find(what).unwrap();
        Span { file, start: start as u32, end: (start + what.len()) as u32 }
    }

    #[test]
    fn a_finding_shows_its_line_with_caret_and_cure() {
        let text = "glint 1\nsensor roof {\n  field_of_view 30\n}\n";
        let mut sources = Sources::default();
        let file = sources.add("roof.glint", text);
        let found = Diagnostic::error("U02", span(file, text, "30"), "a field of view is an angle; `30` has no unit")
            .label("30 deg? (rad mrad urad arcmin arcsec)")
            .help("write the unit");
        assert_eq!(
            render(&[found], &sources, false),
            "error[U02]: a field of view is an angle; `30` has no unit\n \
             --> roof.glint:3:17\n  |\n\
             3 |   field_of_view 30\n  |                 ^^ 30 deg? (rad mrad urad arcmin arcsec)\n  |\n  \
             = help: write the unit\n"
        );
    }

    #[test]
    fn further_places_stand_in_the_same_picture_or_under_their_own_file() {
        let (one, two) = ("a 1\nb 2\na 3\n", "x\na 4\n");
        let mut sources = Sources::default();
        let (first, second) = (sources.add("one.glint", one), sources.add("two.glint", two));
        let found = Diagnostic::error("S05", Span { file: first, start: 8, end: 11 }, "`a` is said three times")
            .label("here")
            .note(span(first, one, "a 1"), "first here")
            .note(span(second, two, "a 4"), "and here");
        let text = render(&[found], &sources, false);
        assert!(text.starts_with("error[S05]: `a` is said three times\n --> one.glint:3:1\n"), "{text}");
        assert!(text.contains("1 | a 1\n  | --- first here\n"), "{text}");
        assert!(text.contains("::: two.glint:2:1\n") && text.contains("2 | a 4\n"), "{text}");
    }

    /// At the end of a file, in an empty one, beyond its end, behind tabs, across lines, in a line of 10⁶ characters.
    #[test]
    fn every_place_can_be_shown() {
        let long = format!("a {}b\n", "µ ".repeat(1_000_000));
        let many = "x\n".repeat(5000);
        let texts = ["", "a", "a\n", "\t\tb\tc\r\nd", "a\nb\nc\nd\ne\nf\ng\nh\ni\n", &long, &many];
        let mut sources = Sources::default();
        let files: Vec<FileId> = texts.iter().map(|text| sources.add("t.glint", *text)).collect();
        for (file, text) in files.iter().zip(texts) {
            let len = text.len() as u32;
            for (start, end) in
                [(0, 0), (0, len), (len, len), (len / 2, len / 2 + 1), (len, len + 5), (len / 2, len), (1, 3), (3, 1)]
            {
                let place = Span { file: *file, start, end };
                let found = Diagnostic::warning("S06", place, "a message")
                    .label("label")
                    .note(Span { file: *file, start: 0, end: 1 }, "note");
                for color in [false, true] {
                    let text = render(std::slice::from_ref(&found), &sources, color);
                    assert!(text.contains("a message") && text.len() < 8000, "{start} {end} {text}");
                }
                to_json(&[found], &sources);
            }
        }
        let column = render(&[Diagnostic::error("S02", span(files[5], &long, "b"), "m")], &sources, false);
        assert!(column.contains("t.glint:1:2000003\n"), "{column}");
    }

    #[test]
    fn findings_come_in_the_order_of_their_places_and_once() {
        let mut sources = Sources::default();
        let file = sources.add("a.glint", "one two three");
        let at = |start| Diagnostic::error("S02", Span { file, start, end: start + 3 }, format!("at {start}"));
        let text = render(&[Diagnostic::whole("X01", "no sensor"), at(8), at(0), at(4), at(0)], &sources, false);
        let titles: Vec<&str> = text.lines().filter(|line| line.starts_with("error")).collect();
        assert_eq!(titles, ["error[S02]: at 0", "error[S02]: at 4", "error[S02]: at 8", "error[X01]: no sensor"]);
    }

    #[test]
    fn json_counts_lines_and_characters_from_one() {
        let text = "# µ\nµ 3\n";
        let mut sources = Sources::default();
        let file = sources.add("a.glint", text);
        let place = Span { file, start: 7, end: 8 };
        let found =
            Diagnostic::error("U02", place, "no unit").label("m?").note(Span { file, start: 0, end: 1 }, "here");
        assert_eq!(
            to_json(&[found, Diagnostic::whole("F01", "gone")], &sources),
            json!([
                { "code": "U02", "severity": "error", "message": "no unit", "file": "a.glint", "line": 2, "column": 2,
                  "end_line": 2, "end_column": 3, "label": "m?", "help": null,
                  "notes": [{ "file": "a.glint", "line": 1, "column": 1, "end_line": 1, "end_column": 2,
                              "message": "here" }] },
                { "code": "F01", "severity": "error", "message": "gone", "file": null, "line": null, "column": null,
                  "end_line": null, "end_column": null, "label": null, "help": null, "notes": [] },
            ])
        );
    }
}
