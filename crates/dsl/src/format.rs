//! Layout of a scene's text (`docs/LANGUAGE.md` section 6): blanks, line breaks and the commas that stand for them.
//! Digits, names, order and comments are never touched, and no keyword is known.
//!
//! One pass over the text, which the parser has found free of faults. Only a list over several lines is read twice: first
//! for the widths of its columns.

use crate::parse::mark::{line_end, number_end, quoted, significant, value_at};
use crate::parse::{VERSION, one_file};
use crate::{Diagnostic, Sources};

/// Columns of a line: a block written on one line stays so up to here, a table is aligned up to here, and a comment
/// keeps its column up to here.
const WIDTH: usize = 100;

/// The text of a scene file, laid out. `None` where it has a fault of shape, which `diagnostics` then tells; the file is
/// added to `sources`. What the file includes is left alone.
pub fn format(path: &str, bytes: &[u8], sources: &mut Sources, diagnostics: &mut Vec<Diagnostic>) -> Option<String> {
    let (id, statements) = one_file(path, bytes, sources, diagnostics)?;
    let text = &sources.get(id).text;
    let mut layout = Layout {
        text,
        bytes: text.as_bytes(),
        pos: 0,
        out: String::with_capacity(text.len() + text.len() / 8 + 16),
        line: 0,
        commented: false,
    };
    if !statements.iter().any(|statement| statement.key.text == "glint") {
        layout.out = format!("glint {VERSION}\n");
        layout.line = layout.out.len();
    }
    drop(statements);
    layout.statements(0);
    if !layout.out.is_empty() && !layout.out.ends_with('\n') {
        layout.out.push('\n');
    }
    Some(layout.out)
}

struct Layout<'a> {
    text: &'a str,
    bytes: &'a [u8],
    pos: usize,
    out: String,
    /// Where the last line of `out` begins.
    line: usize,
    /// Whether that line ends in a comment.
    commented: bool,
}

/// A column of a table: what its cells take before and behind the point, or in all where they are not all numbers.
#[derive(Clone, Copy)]
struct Column {
    numbers: bool,
    before: usize,
    behind: usize,
    widest: usize,
}

impl Layout<'_> {
    fn peek(&self) -> Option<u8> {
        self.bytes.get(self.pos).copied()
    }

    /// Begins a line, behind an empty one if asked.
    fn begin_line(&mut self, depth: usize, blank: bool) {
        if self.line < self.out.len() {
            self.out.push('\n');
        }
        if blank && !self.out.is_empty() {
            self.out.push('\n');
        }
        self.line = self.out.len();
        self.commented = false;
        (0..depth).for_each(|_| self.out.push_str("  "));
    }

    /// Columns of the last line.
    fn width(&self) -> usize {
        self.out[self.line..].chars().count()
    }

    fn fits(&self) -> bool {
        self.out.len() - self.line <= WIDTH || self.width() <= WIDTH
    }

    /// Takes the comment at `pos`. Behind something on its line it stays there, in its column if there is room.
    fn comment(&mut self, depth: usize, behind: bool) {
        let end = line_end(self.bytes, self.pos);
        let comment = self.text[self.pos..end].trim_end();
        if behind && !self.commented && self.line < self.out.len() {
            let start = self.text[..self.pos].rfind('\n').map_or(0, |i| i + 1);
            let column = self.text[start..self.pos].chars().count();
            let least = self.width() + 1;
            let column = if column <= WIDTH { column.max(least) } else { least };
            (least - 1..column).for_each(|_| self.out.push(' '));
        } else {
            self.begin_line(depth, false);
        }
        self.out.push_str(comment);
        self.commented = true;
        self.pos = end;
    }

    /// The statements up to the `}` of their block or to the end of the text.
    fn statements(&mut self, depth: usize) {
        let (mut breaks, mut first) = (0, true);
        while let Some(byte) = self.peek() {
            match byte {
                b'}' => return,
                b'\n' => {
                    breaks += 1;
                    self.pos += 1;
                }
                b' ' | b'\t' | b'\r' | b',' => self.pos += 1,
                b'#' if breaks == 0 => self.comment(depth, true),
                _ => {
                    self.begin_line(depth, breaks > 1 && !first);
                    if byte == b'#' {
                        self.out_comment();
                    } else {
                        self.statement(depth);
                    }
                    (breaks, first) = (0, false);
                }
            }
        }
    }

    /// The comment at `pos` on a line of its own, which has begun.
    fn out_comment(&mut self) {
        let end = line_end(self.bytes, self.pos);
        self.out.push_str(self.text[self.pos..end].trim_end());
        self.commented = true;
        self.pos = end;
    }

    /// The comments before `next`, the first behind what stands on the line.
    fn comments(&mut self, next: usize, depth: usize) {
        let mut behind = true;
        while self.pos < next {
            match self.bytes[self.pos] {
                b'#' => self.comment(depth, behind),
                b'\n' => {
                    behind = false;
                    self.pos += 1;
                }
                _ => self.pos += 1,
            }
        }
    }

    fn statement(&mut self, depth: usize) {
        let mut fresh = true;
        while let Some(byte) = self.peek() {
            match byte {
                b',' | b'}' => return,
                b' ' | b'\t' | b'\r' => {
                    self.pos += 1;
                    continue;
                }
                b'\n' | b'#' => {
                    let next = significant(self.bytes, self.pos);
                    if self.bytes.get(next) == Some(&b'{') {
                        return self.block(depth, next);
                    }
                    if !value_at(self.text, next) {
                        return;
                    }
                    self.comments(next, depth + 1);
                    self.begin_line(depth + 1, false);
                    fresh = true;
                    continue;
                }
                b'{' => return self.block(depth, self.pos),
                b'(' => {
                    self.space(fresh);
                    self.vector(depth);
                }
                b'[' => {
                    self.space(fresh);
                    self.list(depth);
                }
                _ => self.plain(fresh),
            }
            fresh = false;
        }
    }

    fn space(&mut self, fresh: bool) {
        if !fresh {
            self.out.push(' ');
        }
    }

    /// End of the string, word, number or sign at `at`.
    fn plain_end(&self, at: usize) -> usize {
        if let Some(string) = quoted(self.bytes, at) {
            return string.end.max(at + 1);
        }
        let len = self.bytes[at..].iter().position(|byte| ENDS[usize::from(*byte)]).unwrap_or(self.bytes.len() - at);
        at + len.max(1)
    }

    /// A string, a word, a number or a sign. No blank stands about `..`.
    fn plain(&mut self, fresh: bool) {
        let end = self.plain_end(self.pos);
        let text = &self.text[self.pos..end];
        self.space(fresh || text.starts_with("..") || self.out.ends_with(".."));
        self.out.push_str(text);
        self.pos = end;
    }

    /// `(x y z)`, on one line unless it holds a comment.
    fn vector(&mut self, depth: usize) {
        self.out.push('(');
        self.pos += 1;
        let (mut fresh, mut behind) = (true, true);
        while let Some(byte) = self.peek() {
            if !matches!(byte, b' ' | b'\t' | b'\r' | b'\n' | b'#') && self.commented {
                self.begin_line(depth + 2, false);
                fresh = true;
            }
            match byte {
                b' ' | b'\t' | b'\r' => self.pos += 1,
                b'\n' => {
                    behind = false;
                    self.pos += 1;
                }
                b'#' => self.comment(depth + 2, behind),
                b')' => {
                    self.out.push(')');
                    self.pos += 1;
                    return;
                }
                _ => {
                    self.plain(fresh);
                    (fresh, behind) = (false, true);
                }
            }
        }
    }

    /// A list, its rows on the lines on which they stand.
    fn list(&mut self, depth: usize) {
        let (broken, table) = self.survey(depth + 1);
        self.out.push('[');
        self.pos += 1;
        let (mut breaks, mut first, mut cell) = (usize::from(broken), true, None);
        // Whether a row goes on: `cell` counts its cells.
        while let Some(byte) = self.peek() {
            match byte {
                b' ' | b'\t' | b'\r' => self.pos += 1,
                b',' => {
                    cell = None;
                    self.pos += 1;
                }
                b'\n' => {
                    cell = None;
                    breaks += 1;
                    self.pos += 1;
                }
                b'#' if first => self.comment(depth + 1, breaks <= 1),
                b'#' if breaks == 0 => self.comment(depth + 1, true),
                b'#' => {
                    self.begin_line(depth + 1, breaks > 1);
                    self.out_comment();
                    breaks = 0;
                }
                b']' => {
                    if broken && (!first || self.commented) {
                        self.begin_line(depth, false);
                    }
                    self.out.push(']');
                    self.pos += 1;
                    return;
                }
                _ => {
                    let fresh = match cell {
                        Some(_) => false,
                        None if broken && breaks > 0 => {
                            self.begin_line(depth + 1, breaks > 1 && !first);
                            true
                        }
                        None => {
                            if !first {
                                self.out.push(',');
                            }
                            first
                        }
                    };
                    let i = cell.map_or(0, |i: usize| i + 1);
                    match (
                        byte,
                        table.as_ref().and_then(|columns| columns.get(i).map(|c| (*c, i + 1 == columns.len()))),
                    ) {
                        (b'(', _) => {
                            self.space(fresh);
                            self.vector(depth);
                        }
                        (_, Some((column, last))) => {
                            self.space(fresh);
                            self.cell(column, last);
                        }
                        _ => self.plain(fresh),
                    }
                    (breaks, first, cell) = (0, false, Some(i));
                }
            }
        }
    }

    /// A cell of a table: numbers with their points below each other, all else from the left.
    fn cell(&mut self, column: Column, last: bool) {
        let end = self.plain_end(self.pos);
        let text = &self.text[self.pos..end];
        let (before, behind) = parts(text).filter(|_| column.numbers).unwrap_or((0, text.chars().count()));
        if column.numbers {
            (before..column.before).for_each(|_| self.out.push(' '));
        }
        self.out.push_str(text);
        let width = if column.numbers { column.behind } else { column.widest };
        if !last {
            (behind..width).for_each(|_| self.out.push(' '));
        }
        self.pos = end;
    }

    /// Whether the list at `pos` stands on several lines; and, if it is a table of one row a line that fits, its columns.
    fn survey(&self, depth: usize) -> (bool, Option<Vec<Column>>) {
        let mut at = self.pos + 1;
        let (mut broken, mut table, mut columns, mut rows) = (false, true, Vec::<Column>::new(), 0);
        // Cells of the row that is being read, and rows on its line.
        let (mut cells, mut on_line) = (0, 0);
        while let Some(&byte) = self.bytes.get(at) {
            match byte {
                b' ' | b'\t' | b'\r' => at += 1,
                b',' | b'\n' | b'#' | b']' => {
                    if cells > 0 {
                        rows += 1;
                        on_line += 1;
                        table &= on_line == 1 && cells == columns.len();
                        cells = 0;
                    }
                    match byte {
                        b']' => break,
                        b',' => at += 1,
                        b'\n' => {
                            (broken, on_line) = (true, 0);
                            at += 1;
                        }
                        _ => at = line_end(self.bytes, at),
                    }
                }
                b'(' => {
                    (table, cells) = (false, cells + 1);
                    while let Some(byte) = self.bytes.get(at).filter(|byte| **byte != b')') {
                        broken |= *byte == b'#';
                        at = if *byte == b'#' { line_end(self.bytes, at) } else { at + 1 };
                    }
                    at += 1;
                }
                _ => {
                    let end = self.plain_end(at);
                    if table {
                        let text = &self.text[at..end];
                        if rows == 0 {
                            columns.push(Column { numbers: true, before: 0, behind: 0, widest: 0 });
                        }
                        match columns.get_mut(cells) {
                            Some(column) if !text.contains("..") => column.hold(text),
                            _ => table = false,
                        }
                    }
                    cells += 1;
                    at = end;
                }
            }
        }
        let width: usize = columns.iter().map(|column| 1 + column.width()).sum();
        let table = table && broken && rows > 1 && columns.len() > 1 && 2 * depth + width <= WIDTH;
        (broken, table.then_some(columns))
    }

    /// The block whose `{` is at `open`, behind comments perhaps.
    fn block(&mut self, depth: usize, open: usize) {
        let bare = !self.bytes[self.pos..open].contains(&b'#');
        let (start, length) = (self.pos, self.out.len());
        self.pos = open;
        if bare {
            if self.inline_block() {
                return;
            }
            self.out.truncate(length);
            let empty = |byte: &&u8| byte.is_ascii_whitespace() || **byte == b',';
            let blanks = self.bytes[open + 1..].iter().take_while(empty).count();
            if self.bytes.get(open + 1 + blanks) == Some(&b'}') {
                self.out.push_str(" { }");
                self.pos = open + blanks + 2;
                return;
            }
        }
        self.out.push_str(" {");
        self.pos = start;
        self.comments(open, depth + 1);
        self.pos = open + 1;
        self.statements(depth + 1);
        self.begin_line(depth, false);
        self.out.push('}');
        self.pos = (self.pos + 1).min(self.bytes.len());
    }

    /// The block at `pos` on the line that has begun; `false`, and rubbish in `out`, where it does not stand on one line,
    /// does not fit, or holds a comment.
    fn inline_block(&mut self) -> bool {
        self.out.push_str(" {");
        self.pos += 1;
        let mut first = true;
        while let Some(byte) = self.peek() {
            match byte {
                b' ' | b'\t' | b'\r' | b',' => self.pos += 1,
                b'\n' | b'#' => return false,
                b'}' => {
                    self.out.push_str(" }");
                    self.pos += 1;
                    return self.fits();
                }
                _ => {
                    self.out.push_str(if first { " " } else { ", " });
                    first = false;
                    if !self.inline_statement() {
                        return false;
                    }
                }
            }
        }
        false
    }

    fn inline_statement(&mut self) -> bool {
        let mut fresh = true;
        while let Some(byte) = self.peek() {
            match byte {
                b' ' | b'\t' | b'\r' => {
                    self.pos += 1;
                    continue;
                }
                b',' | b'}' => return true,
                b'\n' | b'#' => return false,
                b'{' => return self.inline_block(),
                b'(' => {
                    self.space(fresh);
                    if !self.inline_bulk(b')', " ") {
                        return false;
                    }
                }
                b'[' => {
                    self.space(fresh);
                    if !self.inline_bulk(b']', ", ") {
                        return false;
                    }
                }
                _ => self.plain(fresh),
            }
            fresh = false;
            if !self.fits() {
                return false;
            }
        }
        false
    }

    /// A vector or a list on one line.
    fn inline_bulk(&mut self, close: u8, comma: &str) -> bool {
        self.out.push(char::from(if close == b')' { b'(' } else { b'[' }));
        self.pos += 1;
        let (mut first, mut row) = (true, true);
        while let Some(byte) = self.peek().filter(|_| self.fits()) {
            match byte {
                b' ' | b'\t' | b'\r' => {
                    self.pos += 1;
                    continue;
                }
                b',' => {
                    row = true;
                    self.pos += 1;
                    continue;
                }
                b'\n' | b'#' => return false,
                _ if byte == close => {
                    self.out.push(char::from(close));
                    self.pos += 1;
                    return true;
                }
                _ => {}
            }
            let apart = first || row;
            if apart && !first {
                self.out.push_str(comma);
            }
            if byte == b'(' {
                self.space(apart);
                if !self.inline_bulk(b')', " ") {
                    return false;
                }
            } else {
                self.plain(apart);
            }
            (first, row) = (false, false);
        }
        false
    }
}

impl Column {
    fn hold(&mut self, text: &str) {
        self.widest = self.widest.max(text.chars().count());
        match parts(text) {
            Some((before, behind)) => {
                self.before = self.before.max(before);
                self.behind = self.behind.max(behind);
            }
            None => self.numbers = false,
        }
    }
    fn width(&self) -> usize {
        if self.numbers { self.before + self.behind } else { self.widest }
    }
}

/// What of a number stands before its point, and the rest.
fn parts(text: &str) -> Option<(usize, usize)> {
    if number_end(text.as_bytes(), 0) != Some(text.len()) {
        return None;
    }
    let before = text.find(['.', 'e', 'E']).unwrap_or(text.len());
    Some((before, text.len() - before))
}

/// What ends a word or a number.
const ENDS: [bool; 256] = {
    let mut ends = [false; 256];
    let mut i = 0;
    while i < SIGNS.len() {
        ends[SIGNS[i] as usize] = true;
        i += 1;
    }
    ends
};
const SIGNS: &[u8] = b" \t\r\n,{}()[]\"#";
