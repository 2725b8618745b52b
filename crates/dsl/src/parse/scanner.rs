//! Splits a text into statements and blocks, and reads lists and runs of points.

use super::brace::{Unmatched, unmatched};
use super::fault::Faults;
use super::item::{self, Lexeme, Token};
use super::line::Line;
use super::mark::{comment, foreign_comment, line_end, number, number_at, quoted, significant, value_at};
use super::{MAX_DEPTH, spelling};
use crate::ast::{Block, Item, Point, Statement, Value, Word};
use crate::{Diagnostic, Runs, Span};

/// The statements of a text.
pub(super) fn statements(text: &str, faults: Faults) -> Vec<Statement> {
    let mut faults = faults;
    let braces = unmatched(text, &mut faults);
    let mut scanner = Scanner {
        text,
        bytes: text.as_bytes(),
        pos: 0,
        braces,
        faults,
        line: Line::default(),
        tokens: Vec::new(),
        nested: 0,
        nested_told: false,
    };
    let statements = scanner.statements(0);
    scanner.faults.close();
    statements
}

struct Scanner<'a> {
    text: &'a str,
    bytes: &'a [u8],
    pos: usize,
    braces: Unmatched,
    faults: Faults<'a>,
    line: Line,
    tokens: Vec<Token>,
    /// Lists within the list that is being read.
    nested: usize,
    /// Whether that was reported.
    nested_told: bool,
}

/// What a blank stretch between statements held.
#[derive(Default)]
struct Blank {
    newline: bool,
    comma: Option<usize>,
}

impl Scanner<'_> {
    fn peek(&self) -> Option<u8> {
        self.bytes.get(self.pos).copied()
    }

    fn char(&self) -> char {
        self.text[self.pos..].chars().next().unwrap_or(' ')
    }

    /// The statements up to the end of a block, its `}` included, or of the text.
    fn statements(&mut self, depth: usize) -> Vec<Statement> {
        let mut statements = Vec::new();
        // Behind a value that stands without a key, those that follow on its line say nothing new.
        let mut quiet = false;
        loop {
            let blank = self.blank();
            quiet &= !blank.newline;
            if depth > 0 && self.braces.take_implied(self.pos) {
                return statements;
            }
            let Some(byte) = self.peek() else { return statements };
            match byte {
                b'}' => {
                    let closes = depth > 0 && !self.braces.is_stray(self.pos);
                    self.pos += 1;
                    if closes {
                        return statements;
                    }
                }
                b'{' => {
                    let span = self.faults.span(self.pos, self.pos + 1);
                    let fault = Diagnostic::error("S02", span, "this block belongs to no statement");
                    self.faults.push(fault.label("a word is missing before `{`"));
                    self.skip_block();
                }
                _ if self.at_word() => {
                    if !statements.last_mut().is_some_and(|last| self.again(last)) {
                        statements.extend(self.statement(depth));
                    }
                    quiet = false;
                }
                _ => {
                    if !quiet {
                        self.report_keyless(&blank);
                    }
                    self.faults.mute(true);
                    self.header();
                    if self.peek() == Some(b'{') {
                        self.skip_block();
                    }
                    self.faults.mute(false);
                    quiet = true;
                }
            }
        }
    }

    /// Skips what stands between statements.
    fn blank(&mut self) -> Blank {
        let mut blank = Blank::default();
        while let Some(byte) = self.peek() {
            match byte {
                b'\n' => blank.newline = true,
                b',' => blank.comma = Some(self.pos),
                b' ' | b'\t' | b'\r' => {}
                b';' => {
                    self.report_semicolon();
                    blank.comma = Some(self.pos);
                }
                _ if comment(self.bytes, self.pos) => {
                    self.skip_comment();
                    continue;
                }
                _ => break,
            }
            self.pos += 1;
        }
        blank
    }

    fn report_semicolon(&mut self) {
        let span = self.faults.span(self.pos, self.pos + 1);
        self.faults.push(
            Diagnostic::error("S02", span, "a statement ends with its line or at a comma, not at `;`").label("`,`?"),
        );
    }

    fn skip_comment(&mut self) {
        if foreign_comment(self.bytes, self.pos) {
            let span = self.faults.span(self.pos, self.pos + 2);
            let message = format!("`{}` begins no comment", &self.text[self.pos..self.pos + 2]);
            self.faults.push(Diagnostic::error("S02", span, message).label("`#`?"));
        }
        self.pos = line_end(self.bytes, self.pos);
    }

    /// Whether a statement begins here.
    fn at_word(&self) -> bool {
        match self.peek() {
            Some(byte) if byte < 0x80 => byte.is_ascii_alphabetic(),
            Some(_) => is_letter(self.char()),
            None => false,
        }
    }

    fn report_keyless(&mut self, blank: &Blank) {
        let start = self.pos;
        if !value_at(self.text, start) {
            let end = start + self.char().len_utf8();
            let sign = spelling::shown(self.char());
            let fault =
                Diagnostic::error("S02", self.faults.span(start, end), format!("no statement begins with `{sign}`"));
            return self.faults.push(fault.label("a statement is a word, then its values"));
        }
        let near = self.text[start..].char_indices().take(200).find(|(_, c)| *c == '\n' || *c == '\r');
        let rest = &self.text[start..near.map_or(self.text.len(), |(i, _)| start + i)];
        let len = match rest.as_bytes()[0] {
            b'(' => rest.bytes().take(200).position(|byte| byte == b')').map_or(1, |i| i + 1),
            _ => match quoted(self.bytes, start) {
                Some(string) => string.end - start,
                None => rest.find([' ', '\t', ',', '{', '}', '#', '[']).unwrap_or(rest.len()).max(1),
            },
        };
        let span = self.faults.span(start, start + len);
        let what = if len <= 40 { format!("`{}`", &rest[..len]) } else { "this value".to_string() };
        let fault =
            Diagnostic::error("S03", span, format!("{what} stands without its key")).label("which key is it for?");
        self.faults.push(match blank.comma.filter(|_| !blank.newline) {
            Some(comma) => fault.note(self.faults.span(comma, comma + 1), "this comma ends the statement before"),
            None => fault.help("a statement is `key value`; a line that begins with a value continues the one above"),
        });
    }

    /// One statement with its block.
    fn statement(&mut self, depth: usize) -> Option<Statement> {
        let start = self.pos;
        let mut tokens = std::mem::take(&mut self.tokens);
        let (has_block, read) = if self.quick_header(&mut tokens) {
            (self.peek() == Some(b'{'), item::keyed(&mut tokens, self.text, &mut self.faults))
        } else {
            let has_block = self.header();
            let mut line = std::mem::take(&mut self.line);
            let read = item::statement(&mut line, self.text, &mut self.faults);
            self.line = line;
            (has_block, read)
        };
        self.tokens = tokens;
        let block = if has_block { self.block(depth) } else { None };
        let (key, items) = match read {
            Some(read) => read,
            None => {
                let span = self.faults.span(start, start + self.text[start..].chars().next().map_or(0, char::len_utf8));
                self.faults
                    .push(Diagnostic::error("S02", span, "this is no statement").label("a word, then its values"));
                return None;
            }
        };
        let span = items.last().map_or(key.span, |item| key.span.to(item.span));
        Some(Statement { key, items, block, span, again: None })
    }

    /// Reads a statement that says the last one again with another run, to the end of its line: the same key, the same
    /// word, a plain run. `false`, nothing read, where it is anything else.
    fn again(&mut self, last: &mut Statement) -> bool {
        let [Item { value: Value::Word(word), .. }, Item { value: Value::Points { points, .. }, .. }] = &last.items[..]
        else {
            return false;
        };
        let start = self.pos;
        let blanks = |at: usize| at + self.bytes[at..].iter().take_while(|b| matches!(b, b' ' | b'\t')).count();
        let same = |at: usize, text: &str| self.bytes[at..].starts_with(text.as_bytes()).then(|| at + text.len());
        let behind_key = same(start, &last.key.text).filter(|at| blanks(*at) > *at);
        let Some(at) = behind_key.and_then(|at| same(blanks(at), word)).map(blanks) else { return false };
        if last.block.is_some() || self.bytes.get(at) != Some(&b'(') {
            return false;
        }
        let mut runs = match last.again.take() {
            Some(runs) => runs,
            None => {
                let size = points.first().map_or(0, |point| point.numbers().len());
                if size == 0 || points.iter().any(|point| point.numbers().len() != size) {
                    return false;
                }
                Box::new(Runs::new(self.faults.file(), size))
            }
        };
        self.pos = at;
        let read = self.quick_run(&mut runs, start, |text, at| match text.as_bytes().get(at) {
            None | Some(b',' | b'}') => true,
            Some(b'\n' | b'#') => {
                let next = significant(text.as_bytes(), at);
                text.as_bytes().get(next) != Some(&b'{') && !value_at(text, next)
            }
            _ => false,
        });
        if !read {
            self.pos = start;
        }
        last.again = Some(runs).filter(|runs| !runs.is_empty());
        read
    }

    /// Reads a run of plain vectors and its unit, if it has one, up to where `ends` says that it may end; the run counts
    /// from `start`. `false`, and `runs` as it was, where there is anything else.
    fn quick_run(&mut self, runs: &mut Runs, start: usize, ends: fn(&str, usize) -> bool) -> bool {
        let mut pos = self.pos;
        let mut end = pos;
        let mut unit = None;
        loop {
            match self.bytes.get(pos) {
                Some(b' ' | b'\t' | b'\r') => pos += 1,
                Some(b'(') if unit.is_none() => {
                    let Some((numbers, n, behind)) = plain_vector(self.text, pos).filter(|v| v.1 == runs.size()) else {
                        break;
                    };
                    runs.extend(&numbers[..n]);
                    (pos, end) = (behind, behind);
                }
                Some(byte) if unit.is_none() && (byte.is_ascii_alphabetic() || matches!(byte, b'/' | b'%')) => {
                    let len = self.bytes[pos..].iter().take_while(|byte| is_unit_part(**byte)).count();
                    let text = &self.text[pos..pos + len];
                    if len == 0 || !spelling::is_unit(text) {
                        break;
                    }
                    unit = Some(text);
                    pos += len;
                    end = pos;
                }
                _ => {
                    if !ends(self.text, pos) || !runs.close(unit, start, end) {
                        break;
                    }
                    self.pos = pos;
                    return true;
                }
            }
        }
        runs.drop_open();
        false
    }

    /// Reads the words, plain numbers, units, strings, runs and lists of a statement up to its block or its end without
    /// the grammar, to the same effect. `false`, nothing read, where there is anything else.
    fn quick_header(&mut self, tokens: &mut Vec<Token>) -> bool {
        tokens.clear();
        let (start, known) = (self.pos, self.faults.len());
        loop {
            let at = self.pos;
            let next = match self.peek() {
                None | Some(b',' | b'{' | b'}') => return true,
                Some(b' ' | b'\t' | b'\r') => {
                    self.pos += 1;
                    continue;
                }
                Some(b'\n' | b'#') => {
                    let next = significant(self.bytes, at);
                    if self.bytes.get(next) == Some(&b'{') {
                        self.pos = next;
                        return true;
                    }
                    if !value_at(self.text, next) {
                        return true;
                    }
                    None
                }
                Some(b'"') => quoted(self.bytes, at).filter(|string| string.closed).and_then(|string| {
                    let content = &self.text[string.from..string.to];
                    self.pos = string.end;
                    (!content.contains('\\')).then(|| Lexeme::Value(Value::Text(content.to_string())))
                }),
                Some(byte @ (b'(' | b'[')) if !tokens.is_empty() => {
                    let (value, span) = if byte == b'(' { self.points(false) } else { self.list() };
                    tokens.push(Token { lexeme: Lexeme::Value(value), span, breaks: false });
                    continue;
                }
                _ => self.quick_lexeme(),
            };
            let delimited =
                matches!(self.peek(), None | Some(b' ' | b'\t' | b'\r' | b'\n' | b',' | b'(' | b'{' | b'}' | b'#'));
            match next.filter(|_| delimited) {
                Some(lexeme) => tokens.push(Token { lexeme, span: self.faults.span(at, self.pos), breaks: false }),
                None => {
                    self.pos = start;
                    self.faults.truncate(known);
                    return false;
                }
            }
        }
    }

    /// A plain number, a word or a unit.
    fn quick_lexeme(&mut self) -> Option<Lexeme> {
        let at = self.pos;
        match self.peek()? {
            b'0'..=b'9' | b'+' | b'-' => {
                let (number, end) = number_at(self.text, at)?;
                self.pos = end;
                let digits = self.text[at..end].to_string();
                number.is_finite().then_some(Lexeme::Value(Value::Number { number, digits, unit: None }))
            }
            byte if byte.is_ascii_alphabetic() => {
                let part = |byte: &&u8| byte.is_ascii_alphanumeric() || **byte == b'_';
                let word = self.bytes[at..].iter().take_while(part).count();
                let len = match self.bytes.get(at + word) {
                    Some(b'/' | b'%' | b'^' | b'-') => {
                        self.bytes[at..].iter().take_while(|byte| is_unit_part(**byte)).count()
                    }
                    _ => word,
                };
                self.pos = at + len;
                let text = &self.text[at..self.pos];
                let lexeme = |text: String| if len > word { Lexeme::Unit(text) } else { Lexeme::Word(text) };
                // between numbers, `x` makes a grid
                (text != "x").then(|| lexeme(text.to_string()))
            }
            _ => None,
        }
    }

    /// The block that begins here. `None` where it is nested too deeply.
    fn block(&mut self, depth: usize) -> Option<Block> {
        let start = self.pos;
        if depth >= MAX_DEPTH {
            let span = self.faults.span(start, start + 1);
            let message = format!("blocks are nested more than {MAX_DEPTH} deep");
            self.faults.push(Diagnostic::error("S01", span, message).label("this block is left out"));
            self.skip_block();
            return None;
        }
        self.pos += 1;
        let statements = self.statements(depth + 1);
        let inner =
            statements.last().map_or(0, |last| last.block.as_ref().map_or(last.span.end, |block| block.span.end));
        let end = (start + self.text[start..self.pos].trim_ascii_end().len()).max(inner as usize);
        self.report_missing_comma();
        Some(Block { statements, span: self.faults.span(start, end) })
    }

    /// Behind a block its statement is over: what follows on the line is another.
    fn report_missing_comma(&mut self) {
        if self.pos == 0 || self.bytes[self.pos - 1] != b'}' {
            return;
        }
        while matches!(self.peek(), Some(b' ' | b'\t')) {
            self.pos += 1;
        }
        if self.at_word() {
            let rest = &self.text[self.pos..];
            let len = rest.find(|c: char| !is_letter(c) && !c.is_ascii_digit() && c != '_').unwrap_or(rest.len());
            let message = format!("`{}` stands behind a block, where its statement is over", &rest[..len]);
            let fault = Diagnostic::error("S03", self.faults.span(self.pos, self.pos + len), message);
            self.faults.push(fault.label("a comma or a line break before it?"));
        }
    }

    /// Skips a block and all that it holds.
    fn skip_block(&mut self) {
        let mut depth = 1usize;
        self.pos += 1;
        while let Some(byte) = self.peek() {
            while depth > 0 && self.braces.take_implied(self.pos) {
                depth -= 1;
            }
            if depth == 0 {
                return;
            }
            match byte {
                b'{' => depth += 1,
                b'}' if self.braces.is_stray(self.pos) => {}
                b'}' => {
                    depth -= 1;
                    if depth == 0 {
                        self.pos += 1;
                        return;
                    }
                }
                _ if comment(self.bytes, self.pos) => {
                    self.pos = line_end(self.bytes, self.pos);
                    continue;
                }
                _ => {}
            }
            self.pos = quoted(self.bytes, self.pos).map_or(self.pos + 1, |string| string.end.max(self.pos + 1));
        }
    }

    /// Reads a statement up to its block or its end into `self.line`; says whether a block follows.
    fn header(&mut self) -> bool {
        self.line.clear();
        self.scan(false);
        self.peek() == Some(b'{')
    }

    /// Reads into `self.line` up to the end of a statement's line, or of a row of a list.
    fn scan(&mut self, row: bool) {
        while let Some(byte) = self.peek() {
            let at = self.pos;
            match byte {
                b',' | b';' | b'{' | b'}' => return,
                b'\n' | b'#' if row => return,
                b'\n' | b'#' => {
                    let next = significant(self.bytes, at);
                    if self.bytes.get(next) != Some(&b'{') && !value_at(self.text, next) {
                        return;
                    }
                    self.line.push(at, " ");
                    self.line.breaks.push(self.line.text.len());
                    self.pos = next;
                }
                b' ' | b'\t' | b'\r' => {
                    self.line.push(at, " ");
                    self.pos += 1;
                }
                b'"' => self.string(),
                b'(' => {
                    let bulk = self.points(row);
                    self.line.push(at, "()");
                    self.line.bulk.push(bulk);
                }
                b'[' if row => {
                    if !std::mem::replace(&mut self.nested_told, true) {
                        let span = self.faults.span(at, at + 1);
                        self.faults.push(
                            Diagnostic::error("S02", span, "lists do not nest")
                                .label("leave this `[` and its `]` out?"),
                        );
                    }
                    self.nested += 1;
                    self.pos += 1;
                }
                b'[' => {
                    let bulk = self.list();
                    self.line.push(at, "[]");
                    self.line.bulk.push(bulk);
                }
                b']' if row && self.nested == 0 => return,
                b']' if row => {
                    self.nested -= 1;
                    self.pos += 1;
                }
                b')' | b']' => {
                    let message = format!("this `{}` closes nothing", byte as char);
                    self.faults
                        .push(Diagnostic::error("S01", self.faults.span(at, at + 1), message).label("leave it out?"));
                    self.line.push(at, " ");
                    self.pos += 1;
                }
                _ if foreign_comment(self.bytes, at) => self.skip_comment(),
                0x80.. => self.foreign_character(),
                _ => {
                    let plain = |byte: &u8| byte.is_ascii_alphanumeric() || matches!(byte, b'_' | b'.' | b'-');
                    let len = self.bytes[at..].iter().take_while(|byte| plain(byte)).count().max(1);
                    self.line.push(at, &self.text[at..at + len]);
                    self.pos += len;
                }
            }
        }
    }

    /// A string, in straight quotes and closed whatever it was.
    fn string(&mut self) {
        let at = self.pos;
        let Some(string) = quoted(self.bytes, at) else { return };
        let mut content = &self.text[string.from..string.to];
        if !string.closed {
            let message = "this string is not closed on its line";
            let fault = Diagnostic::error("S02", self.faults.span(at, string.end), message);
            self.faults.push(fault.label("`\"` at its end"));
            if content.bytes().rev().take_while(|byte| *byte == b'\\').count() % 2 == 1 {
                content = &content[..content.len() - 1];
            }
        }
        if string.closed && string.straight {
            self.line.push(at, &self.text[at..string.end]);
        } else {
            self.line.push(at, "\"");
            self.line.push(string.from, content);
            self.line.push(string.end.saturating_sub(1), "\"");
        }
        self.pos = string.end;
    }

    /// A stretch that is not ASCII: reported with its spelling, and read as that.
    fn foreign_character(&mut self) {
        let at = self.pos;
        if let Some(string) = quoted(self.bytes, at) {
            if !string.closed {
                return self.string();
            }
            let span = self.faults.span(at, at + self.char().len_utf8());
            let message = format!("`{}` is not ASCII: strings stand in straight quotes", self.char());
            self.faults.push(Diagnostic::error("S04", span, message).label("`\"`, and at its end"));
            return self.string();
        }
        let rest = &self.text[at..];
        let len = rest.find(|c: char| c.is_ascii() || spelling::ascii(c) == Some("\"")).unwrap_or(rest.len());
        let len = len.max(self.char().len_utf8());
        let (ascii, fault) = asciify(&rest[..len], at, &self.faults);
        self.faults.push(fault);
        let glued = self.line.text.as_bytes().last().is_some_and(u8::is_ascii_digit);
        if glued && ascii.starts_with("deg") {
            self.line.push(at, " ");
        }
        // Letters may stand for a sign that the scanner itself would have to see: then a blank keeps the rest readable.
        let ascii = if ascii.contains(['(', ')', '"', ',', ';']) { " ".to_string() } else { ascii };
        self.line.replace(at, len, &ascii);
        self.pos += len;
    }

    /// A run of vectors: one value.
    fn points(&mut self, row: bool) -> (Value, Span) {
        let start = self.pos;
        let mut points = Vec::new();
        let mut unit = None;
        let mut commas = false;
        loop {
            points.push(self.vector(&mut unit));
            let next = match row {
                true => self.pos + self.bytes[self.pos..].iter().take_while(|b| matches!(b, b' ' | b'\t')).count(),
                false => significant(self.bytes, self.pos),
            };
            match self.bytes.get(next) {
                Some(b'(') => self.pos = next,
                Some(b',') if !row && self.bytes.get(significant(self.bytes, next + 1)) == Some(&b'(') => {
                    if !std::mem::replace(&mut commas, true) {
                        let span = self.faults.span(next, next + 1);
                        let fault = Diagnostic::error("S02", span, "no comma stands between the points of a run");
                        self.faults.push(fault.label("leave it out"));
                    }
                    self.pos = significant(self.bytes, next + 1);
                }
                _ => break,
            }
        }
        let end = points.last().map_or(self.pos, |point: &Point| point.span.end as usize);
        (Value::Points { points, unit }, self.faults.span(start, end))
    }

    /// `(x y z)`: the usual case at full speed.
    fn vector(&mut self, unit: &mut Option<Word>) -> Point {
        let start = self.pos;
        match plain_vector(self.text, start) {
            Some((numbers, n, end)) => {
                self.pos = end;
                Point::new(&numbers[..n], self.faults.span(start, end))
            }
            None => self.faulty_vector(unit),
        }
    }

    /// A vector that is not as it should be, or holds a comment.
    fn faulty_vector(&mut self, unit: &mut Option<Word>) -> Point {
        let (start, known) = (self.pos, self.faults.len());
        let mut numbers = Vec::new();
        let mut told = false;
        self.pos += 1;
        let closed = loop {
            let at = self.pos;
            match self.peek() {
                Some(b' ' | b'\t' | b'\r') => self.pos += 1,
                Some(b'\n' | b'#') => {
                    let next = significant(self.bytes, at);
                    if self.bytes.get(next) != Some(&b')')
                        && (!value_at(self.text, next) || matches!(self.bytes[next], b'(' | b'[' | b'"'))
                    {
                        break false;
                    }
                    self.pos = next;
                }
                Some(b')') => {
                    self.pos += 1;
                    break true;
                }
                None | Some(b'(' | b'[' | b']' | b'{' | b'}' | b'"' | b';') => break false,
                Some(b',') => {
                    self.pos += 1;
                    if !std::mem::replace(&mut told, true) {
                        let fault =
                            Diagnostic::error("S02", self.faults.span(at, at + 1), "no comma stands in a vector");
                        self.faults.push(fault.label("leave it out"));
                    }
                }
                Some(_) => {
                    let rest = &self.text[at..];
                    let ends = |c: char| {
                        matches!(
                            c,
                            ' ' | '\t' | '\r' | '\n' | ',' | '(' | ')' | '[' | ']' | '{' | '}' | '"' | ';' | '#'
                        )
                    };
                    let raw = &rest[..rest.find(ends).unwrap_or(rest.len())];
                    self.pos += raw.len();
                    let text = if raw.is_ascii() {
                        raw.to_string()
                    } else {
                        let (ascii, fault) = asciify(raw, at, &self.faults);
                        self.faults.push(fault);
                        ascii
                    };
                    let span = self.faults.span(at, self.pos);
                    match number(&text).filter(|value| value.is_finite()) {
                        Some(value) => numbers.push(value),
                        None if text.starts_with(|c: char| c.is_ascii_digit() || matches!(c, '+' | '-' | '.')) => {
                            let (fault, value) = item::malformed(&text, span);
                            if !std::mem::replace(&mut told, true) {
                                self.faults.push(fault);
                            }
                            numbers.push(if let Value::Number { number, .. } = value { number } else { 1.0 });
                        }
                        None => {
                            let fault = if spelling::is_unit(&text) || spelling::meant_unit(&text).is_some() {
                                let meant = spelling::meant_unit(&text).unwrap_or_default().to_string();
                                let fault = Diagnostic::error("U04", span, "the unit of a vector stands behind it");
                                let fault = fault.label(format!("`(x y z) {meant}`"));
                                unit.get_or_insert(Word { text: meant, span });
                                fault
                            } else {
                                numbers.push(1.0);
                                let fault =
                                    Diagnostic::error("U04", span, format!("a vector holds numbers; `{raw}` is none"));
                                fault
                                    .label("a number")
                                    .help("a constant may stand for the whole vector: `define NAME (0 0 5) m`")
                            };
                            if !std::mem::replace(&mut told, true) {
                                self.faults.push(fault);
                            }
                        }
                    }
                }
            }
        };
        let end = start + self.text[start..self.pos].trim_ascii_end().len();
        let span = self.faults.span(start, end);
        if !closed {
            self.faults.truncate(known);
            let fault = Diagnostic::error("S01", self.faults.span(start, start + 1), "this vector is never closed");
            self.faults.push(fault.label("`(` without `)`"));
        } else if !told && !matches!(numbers.len(), 2 | 3) {
            let count = match numbers.len() {
                0 => "no number".to_string(),
                1 => "one number".to_string(),
                n => format!("{n} numbers"),
            };
            let fault =
                Diagnostic::error("U04", span, format!("a vector has two or three numbers; this one has {count}"));
            self.faults.push(fault.label("`(x y z)` or `(x y)`"));
        }
        if !matches!(numbers.len(), 2 | 3) {
            numbers.resize(3, 0.0);
        }
        Point::new(&numbers, span)
    }

    /// A list: one value. One that is never closed ends with its line.
    fn list(&mut self) -> (Value, Span) {
        let start = self.pos;
        let open = self.braces.is_open_list(start);
        if open {
            let fault = Diagnostic::error("S01", self.faults.span(start, start + 1), "this list is never closed");
            self.faults.push(fault.label("`[` without `]`"));
        }
        let outer = std::mem::take(&mut self.line);
        (self.nested, self.nested_told) = (0, false);
        let mut rows: Vec<Vec<Item>> = Vec::new();
        // What the list holds while all of its rows are runs of vectors of one size.
        let mut packed: Option<Runs> = None;
        let mut tokens = Vec::new();
        self.pos += 1;
        loop {
            match self.peek() {
                None | Some(b'{' | b'}') => break,
                Some(b'\n') if open => break,
                Some(b' ' | b'\t' | b'\r' | b'\n' | b',') => self.pos += 1,
                Some(b';') => {
                    self.report_semicolon();
                    self.pos += 1;
                }
                Some(b']') => {
                    self.pos += 1;
                    if self.nested == 0 {
                        break;
                    }
                    self.nested -= 1;
                }
                Some(_) if comment(self.bytes, self.pos) => self.skip_comment(),
                Some(byte) => {
                    let at = self.pos;
                    if byte == b'('
                        && let Some(runs) = &mut packed
                        && self.quick_run(runs, at, |text, at| {
                            matches!(text.as_bytes().get(at), Some(b',' | b'\n' | b']' | b'#'))
                        })
                    {
                        continue;
                    }
                    if !self.quick_row(&mut tokens) {
                        self.line.clear();
                        self.scan(true);
                        tokens.clear();
                        item::row(&mut self.line, self.text, &mut self.faults, &mut tokens);
                    }
                    let items: Vec<Item> = item::items(&mut tokens, self.text, &mut self.faults);
                    if items.is_empty() {
                        continue;
                    }
                    if rows.is_empty()
                        && let [Item { value: Value::Points { points, unit }, span }] = &items[..]
                    {
                        let size = points.first().map_or(3, |point| point.numbers().len());
                        let runs = packed.get_or_insert_with(|| Runs::new(self.faults.file(), size));
                        if runs.push(points, unit.as_ref().map(|unit| unit.text.as_str()), *span) {
                            continue;
                        }
                    }
                    if let Some(runs) = packed.take() {
                        rows.extend((0..runs.len()).map(|i| vec![runs.item(i, self.text)]));
                    }
                    rows.push(items);
                }
            }
        }
        self.line = outer;
        let end = start + self.text[start..self.pos].trim_ascii_end().len();
        let value = match packed {
            Some(runs) => Value::Runs { runs: Box::new(runs), unit: None },
            None => Value::List { rows, unit: None },
        };
        (value, self.faults.span(start, end))
    }

    /// Reads a row of plain numbers, words, units and vectors without the grammar, to the same effect. Returns `false`,
    /// nothing read, where there is anything else in the row.
    fn quick_row(&mut self, tokens: &mut Vec<Token>) -> bool {
        tokens.clear();
        let (start, known) = (self.pos, self.faults.len());
        loop {
            let at = self.pos;
            let lexeme = match self.peek() {
                Some(b' ' | b'\t' | b'\r') => {
                    self.pos += 1;
                    continue;
                }
                Some(b',' | b'\n' | b']' | b'#') => return true,
                Some(b'(') => {
                    let (value, span) = self.points(true);
                    tokens.push(Token { lexeme: Lexeme::Value(value), span, breaks: false });
                    continue;
                }
                _ => self.quick_lexeme(),
            };
            let delimited = matches!(self.peek(), Some(b' ' | b'\t' | b'\r' | b'\n' | b',' | b']' | b'(' | b'#'));
            match lexeme.filter(|_| delimited) {
                Some(lexeme) => tokens.push(Token { lexeme, span: self.faults.span(at, self.pos), breaks: false }),
                None => {
                    self.pos = start;
                    self.faults.truncate(known);
                    return false;
                }
            }
        }
    }
}

/// A vector of two or three plain numbers without a comment, how many they are, and its end.
fn plain_vector(text: &str, at: usize) -> Option<([f64; 3], usize, usize)> {
    let bytes = text.as_bytes();
    let (mut numbers, mut n, mut pos) = ([0.0; 3], 0, at + 1);
    loop {
        match bytes.get(pos)? {
            b' ' | b'\t' | b'\n' | b'\r' => pos += 1,
            b')' if n >= 2 => return Some((numbers, n, pos + 1)),
            b'0'..=b'9' | b'+' | b'-' if n < 3 => {
                let (value, end) = number_at(text, pos)?;
                if !value.is_finite() || !matches!(bytes.get(end), Some(b' ' | b'\t' | b'\n' | b'\r' | b')')) {
                    return None;
                }
                numbers[n] = value;
                n += 1;
                pos = end;
            }
            _ => return None,
        }
    }
}

fn is_unit_part(byte: u8) -> bool {
    byte.is_ascii_alphanumeric() || matches!(byte, b'_' | b'/' | b'%' | b'^' | b'*' | b'-')
}

fn is_letter(character: char) -> bool {
    character.is_ascii_alphabetic() || !character.is_ascii() && character.is_alphabetic()
}

/// The ASCII spelling of a stretch that is not ASCII throughout, and the finding.
fn asciify(raw: &str, at: usize, faults: &Faults) -> (String, Diagnostic) {
    let spell = |c: char| match spelling::ascii(c) {
        Some(ascii) => ascii.to_string(),
        None if c.is_ascii() => c.to_string(),
        None if c.is_alphanumeric() => "x".to_string(),
        None => " ".to_string(),
    };
    let ascii: String = raw.chars().map(spell).collect();
    let (mut start, mut end) = (at, at + raw.len());
    let foreign = raw.trim_matches(|c: char| c.is_ascii());
    if let Some(offset) = raw.find(|c: char| !c.is_ascii()) {
        (start, end) = (at + offset, at + offset + foreign.len());
    }
    let shown: String = foreign.chars().take(12).map(spelling::shown).collect::<Vec<_>>().concat();
    let fault = Diagnostic::error("S04", faults.span(start, end), format!("`{shown}` is not ASCII"));
    let spelled: Option<String> = foreign
        .chars()
        .map(|c| if c.is_ascii() { Some(c.to_string()) } else { spelling::ascii(c).map(str::to_string) })
        .collect();
    let fault = match spelled.as_deref().map(str::trim) {
        Some("") => fault.label("a plain space?"),
        Some(spelled) => fault.label(format!("`{spelled}`?")),
        None => fault.label("ASCII only, outside strings and comments"),
    };
    (ascii, fault)
}
