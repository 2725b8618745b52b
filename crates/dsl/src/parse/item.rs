//! From the grammar's tokens to words and values: units, ranges, dates, and what is wrong with a token.
//!
//! # Which word is a unit
//! After a bare number, range, run of points or list of such, the next token is its unit if it
//! 1. cannot be a word (`W/m2/sr/um`, `e-`, `%`, `/km`), or
//! 2. is a unit of the language, or a usual spelling of one (`degrees`, `KM`), which no name may be, or
//! 3. is no connective, and nothing else fits: it ends the statement or the row, or a connective that begins a clause
//!    (`at`, `to`, `for`, …) follows.
//!
//! So `30 degrees` and `30 foo` have units for the checker to reject, while in `zenith 30 azimuth 120 deg`,
//! `code 1 like grey` and `scale 2 orientation spherical` the number is bare.

use pest::Parser;
use pest::iterators::Pair;

use super::fault::Faults;
use super::line::Line;
use super::mark::{number, number_end};
use super::spelling::{self, CONNECTIVES, PREPOSITIONS};
use crate::ast::{Item, Value, Word};
use crate::{Diagnostic, Span};

#[derive(pest_derive::Parser)]
#[grammar = "scene.pest"]
struct Grammar;

/// A token with its place.
pub(super) struct Token {
    pub lexeme: Lexeme,
    pub span: Span,
    /// Whether a line of the source begins with it.
    pub breaks: bool,
}

/// What a token is.
pub(super) enum Lexeme {
    /// A word.
    Word(String),
    /// What can only be a unit.
    Unit(String),
    /// A value, without its unit.
    Value(Value),
    /// A string with an escape that there is not.
    Escape(String),
    /// What begins like a number and is none.
    Malformed(String),
    /// `->`
    Arrow,
    /// `..` beside no number.
    Dots,
    /// A sign without meaning.
    Stray(String),
}

/// Reads a statement's line: its key and its items.
pub(super) fn statement(line: &mut Line, source: &str, faults: &mut Faults) -> Option<(Word, Vec<Item>)> {
    let mut tokens = Vec::new();
    read(Rule::statement, line, source, faults, &mut tokens);
    keyed(&mut tokens, source, faults)
}

/// A statement of its tokens, which are taken: the first is its key.
pub(super) fn keyed(tokens: &mut Vec<Token>, source: &str, faults: &mut Faults) -> Option<(Word, Vec<Item>)> {
    if tokens.is_empty() {
        return None;
    }
    let Token { lexeme, span, .. } = tokens.remove(0);
    let key = match lexeme {
        Lexeme::Word(text) => Word { text, span },
        Lexeme::Unit(text) => {
            let word = as_word(&text);
            faults.push(not_a_word(&text, &word, span));
            Word { text: word, span }
        }
        _ => return None,
    };
    if key.text.matches('.').count() > 1 {
        let fault = Diagnostic::error("S02", span, format!("`{}` has more than one `.`", key.text));
        faults.push(fault.label("`prefix.name`"));
    }
    Some((key, items(tokens, source, faults)))
}

/// Reads a row of a list.
pub(super) fn row(line: &mut Line, source: &str, faults: &mut Faults, tokens: &mut Vec<Token>) {
    read(Rule::row, line, source, faults, tokens);
}

fn read(rule: Rule, line: &mut Line, source: &str, faults: &mut Faults, tokens: &mut Vec<Token>) {
    let mut bulk = std::mem::take(&mut line.bulk).into_iter();
    let Ok(mut parsed) = Grammar::parse(rule, &line.text) else { return };
    let mut breaks = line.breaks.iter().copied().peekable();
    for pair in parsed.next().into_iter().flat_map(Pair::into_inner) {
        let (start, end) = (pair.as_span().start(), pair.as_span().end());
        let mut begins = false;
        while breaks.next_if(|at| *at <= start).is_some() {
            begins = true;
        }
        let (from, to) = line.original(start, end, source);
        let mut span = faults.span(from, to);
        let text = pair.as_str();
        let lexeme = match pair.as_rule() {
            Rule::bulk => {
                let Some((value, place)) = bulk.next() else { continue };
                span = place;
                Lexeme::Value(value)
            }
            Rule::text => match unescape(text) {
                Ok(text) => Lexeme::Value(Value::Text(text)),
                Err(text) => Lexeme::Escape(text),
            },
            Rule::key => {
                let inner = pair.clone().into_inner().next().map(|inner| inner.as_rule());
                if inner == Some(Rule::word) { Lexeme::Word(text.to_string()) } else { Lexeme::Unit(text.to_string()) }
            }
            Rule::word => Lexeme::Word(text.to_string()),
            Rule::compound => Lexeme::Unit(text.to_string()),
            Rule::moment => Lexeme::Value(moment(pair, span, faults)),
            Rule::quantity => match quantity(pair.clone()) {
                Some(value) => Lexeme::Value(value),
                None => Lexeme::Malformed(text.to_string()),
            },
            Rule::malformed => Lexeme::Malformed(text.to_string()),
            Rule::arrow => Lexeme::Arrow,
            Rule::dots => Lexeme::Dots,
            Rule::stray => Lexeme::Stray(text.to_string()),
            _ => continue,
        };
        tokens.push(Token { lexeme, span, breaks: begins });
    }
}

/// The content of a string. `Err`, read literally, where a backslash stands before anything but `"` and `\`.
fn unescape(quoted: &str) -> Result<String, String> {
    let inner = quoted.get(1..quoted.len().saturating_sub(1)).unwrap_or_default();
    let mut text = String::with_capacity(inner.len());
    let mut faulty = false;
    let mut characters = inner.chars();
    while let Some(character) = characters.next() {
        if character != '\\' {
            text.push(character);
            continue;
        }
        match characters.next() {
            Some(next @ ('"' | '\\')) => text.push(next),
            next => {
                faulty = true;
                text.push('\\');
                text.extend(next);
            }
        }
    }
    if faulty { Err(text) } else { Ok(text) }
}

fn moment(pair: Pair<Rule>, span: Span, faults: &mut Faults) -> Value {
    let (mut date, mut clock, mut offset) = (None, None, None);
    for part in pair.into_inner() {
        let text = part.as_str();
        match part.as_rule() {
            Rule::date => date = Some((field(text, 0, 4) as i32, field(text, 5, 7) as u8, field(text, 8, 10) as u8)),
            Rule::clock => {
                let seconds = text.get(6..).and_then(|seconds| seconds.parse().ok()).unwrap_or(0.0);
                clock = Some((field(text, 0, 2) as u8, field(text, 3, 5) as u8, seconds));
            }
            _ if text.len() == 6 => {
                let (hours, minutes) = (field(text, 1, 3) as i32, field(text, 4, 6) as i32);
                if minutes > 59 {
                    let fault =
                        Diagnostic::error("T01", span, format!("an offset has at most 59 minutes, not {minutes}"));
                    faults.push(fault.label("hours and minutes, such as `-04:00`"));
                }
                offset = Some(if text.starts_with('-') { -1 } else { 1 } * (60 * hours + minutes));
            }
            _ => offset = Some(0),
        }
    }
    Value::Moment { date, clock, offset }
}

/// The digits `from..to` of a date or clock as a number.
fn field(text: &str, from: usize, to: usize) -> u32 {
    text.get(from..to).and_then(|digits| digits.parse().ok()).unwrap_or(0)
}

/// A number, range or grid. `None` where a number is not finite, or a grid not of whole numbers.
fn quantity(pair: Pair<Rule>) -> Option<Value> {
    let mut parts = pair.into_inner();
    let digits = parts.next()?.as_str();
    let low = digits.parse().ok().filter(|number: &f64| number.is_finite())?;
    let Some(join) = parts.next() else {
        return Some(Value::Number { number: low, digits: digits.to_string(), unit: None });
    };
    let second = parts.next()?.as_str();
    if join.as_rule() == Rule::by {
        return Some(Value::Grid(whole(digits)?, whole(second)?));
    }
    let high = second.parse().ok().filter(|number: &f64| number.is_finite())?;
    Some(Value::Range { low, high, unit: None })
}

fn whole(digits: &str) -> Option<u64> {
    digits.bytes().all(|byte| byte.is_ascii_digit()).then(|| digits.parse().ok()).flatten()
}

/// Makes items of tokens, and takes them.
pub(super) fn items(tokens: &mut Vec<Token>, source: &str, faults: &mut Faults) -> Vec<Item> {
    let mut items: Vec<Item> = Vec::with_capacity(tokens.len());
    // One sign without meaning is reported in a statement.
    let mut told = false;
    // `..` between two numbers that each have a unit.
    let mut joined = false;
    let mut i = 0;
    while i < tokens.len() {
        let span = tokens[i].span;
        let lexeme = std::mem::replace(&mut tokens[i].lexeme, Lexeme::Arrow);
        let is_value = matches!(lexeme, Lexeme::Value(_) | Lexeme::Malformed(_) | Lexeme::Escape(_));
        if tokens[i].breaks && is_value && items.last().is_some_and(|item| !matches!(item.value, Value::Word(_))) {
            let held = items.last().map_or(span, |item| item.span);
            faults.push(forgotten_key(span, source).note(held, "the value of the statement"));
            break;
        }
        i += 1;
        let (value, mut span) = match lexeme {
            Lexeme::Word(text) => {
                if text.matches('.').count() > 1 && !std::mem::replace(&mut told, true) {
                    let fault = Diagnostic::error("S02", span, format!("`{text}` has more than one `.`"));
                    faults.push(fault.label(format!("`prefix.name`, or a file: `\"{text}\"`")));
                }
                (Value::Word(text), span)
            }
            Lexeme::Unit(text) => {
                let word = as_word(&text);
                if !std::mem::replace(&mut told, true) {
                    faults.push(not_a_word(&text, &word, span));
                }
                if word.is_empty() {
                    continue;
                }
                (Value::Word(word), span)
            }
            Lexeme::Value(value) => (value, span),
            Lexeme::Escape(text) => {
                if !std::mem::replace(&mut told, true) {
                    let fault = Diagnostic::error("S02", span, "in a string, `\\` stands only before `\"` and `\\`");
                    faults.push(fault.label("`\\\\`, or `/` in a path"));
                }
                (Value::Text(text), span)
            }
            Lexeme::Malformed(text) => {
                let (fault, value) = malformed(&text, span);
                faults.push(fault);
                (value, span)
            }
            Lexeme::Arrow => {
                if !std::mem::replace(&mut told, true) {
                    faults.push(Diagnostic::error("S02", span, "an arrow is no sign of the language").label("`to`?"));
                }
                (Value::Word("to".to_string()), span)
            }
            Lexeme::Dots => {
                let low = items
                    .last()
                    .and_then(|item| if let Value::Number { digits, .. } = &item.value { Some(digits) } else { None });
                let high = tokens.get(i).and_then(|next| match &next.lexeme {
                    Lexeme::Value(Value::Number { digits, .. }) => Some(digits),
                    _ => None,
                });
                let fault = Diagnostic::error("U04", span, "a range is two numbers, then one unit");
                faults.push(match (low, high) {
                    (Some(low), Some(high)) => fault.label(format!("`{low}..{high}`, then the unit")),
                    _ => fault.label("such as `420..520 nm`"),
                });
                joined = low.is_some() && high.is_some();
                continue;
            }
            Lexeme::Stray(text) => {
                let (fault, value) = stray(&text, span);
                if !std::mem::replace(&mut told, true) {
                    faults.push(fault);
                }
                let Some(value) = value else { continue };
                (value, span)
            }
        };
        let mut value = value;
        if let Some(place) = unit_place(&mut value) {
            let n = unit_tokens(&tokens[i..]);
            if n > 0 {
                let text = (tokens[i..i + n].iter())
                    .map(|token| match &token.lexeme {
                        Lexeme::Word(text) | Lexeme::Unit(text) => text.as_str(),
                        _ => "",
                    })
                    .collect::<Vec<_>>()
                    .join(" ");
                let unit_span = tokens[i].span.to(tokens[i + n - 1].span);
                *place = Some(Word { text, span: unit_span });
                span = span.to(unit_span);
                i += n;
            }
        }
        if std::mem::take(&mut joined) {
            value = join(&mut items, value, &mut span);
        }
        items.push(Item { value, span });
    }
    tokens.clear();
    items
}

/// The range of the number before `..` and the one behind it.
fn join(items: &mut Vec<Item>, value: Value, span: &mut Span) -> Value {
    match (items.pop(), value) {
        (
            Some(Item { value: Value::Number { number: low, unit, .. }, span: first }),
            Value::Number { number: high, unit: second, .. },
        ) => {
            *span = first.to(*span);
            Value::Range { low, high, unit: second.or(unit) }
        }
        (before, value) => {
            items.extend(before);
            value
        }
    }
}

/// Where the unit of a value goes, if it takes one and has none.
fn unit_place(value: &mut Value) -> Option<&mut Option<Word>> {
    match value {
        Value::Number { unit, .. } | Value::Range { unit, .. } | Value::Points { unit, .. } => {
            Some(unit).filter(|unit| unit.is_none())
        }
        Value::List { rows, unit } => {
            let bare = |item: &Item| {
                matches!(
                    item.value,
                    Value::Number { unit: None, .. }
                        | Value::Range { unit: None, .. }
                        | Value::Points { unit: None, .. }
                )
            };
            rows.iter().flatten().any(bare).then_some(unit)
        }
        Value::Runs { runs, unit } => runs.has_bare().then_some(unit),
        _ => None,
    }
}

/// How many of the tokens behind a bare value are its unit.
fn unit_tokens(tokens: &[Token]) -> usize {
    let more = |from: usize| tokens[from..].iter().take_while(|token| matches!(token.lexeme, Lexeme::Unit(_))).count();
    match tokens.first().map(|token| &token.lexeme) {
        Some(Lexeme::Unit(_)) => more(0),
        Some(Lexeme::Word(word)) => {
            let nothing_else_fits = match tokens.get(1).map(|token| &token.lexeme) {
                None | Some(Lexeme::Unit(_)) => true,
                Some(Lexeme::Word(next)) => PREPOSITIONS.contains(&next.as_str()),
                Some(_) => false,
            };
            let is_unit = !CONNECTIVES.contains(&word.as_str())
                && (spelling::is_unit(word) || spelling::meant_unit(word).is_some() || nothing_else_fits);
            if is_unit { 1 + more(1) } else { 0 }
        }
        _ => 0,
    }
}

fn forgotten_key(span: Span, source: &str) -> Diagnostic {
    let text = &source[span.start as usize..span.end as usize];
    let what = if text.len() <= 40 && !text.contains('\n') { format!("`{text}`") } else { "this value".to_string() };
    Diagnostic::error("S03", span, format!("{what} continues the line above, which has its value already"))
        .label("which key is it for?")
        .help("a line that begins with a value continues the statement above; a statement begins with its key")
}

/// A word nearest to what is none.
fn as_word(text: &str) -> String {
    let word: String = text.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    word.trim_matches('_').to_string()
}

fn not_a_word(text: &str, word: &str, span: Span) -> Diagnostic {
    if spelling::is_unit(text) {
        let fault = Diagnostic::error("S02", span, format!("the unit `{text}` stands behind no bare number"));
        return fault.label("leave it out, or write its number");
    }
    let fault = Diagnostic::error("S02", span, format!("`{text}` is neither a word nor a unit"));
    let fault = if word.is_empty() { fault.label("leave it out?") } else { fault.label(format!("`{word}`?")) };
    fault.help("a word is a letter, then letters, digits and `_`; a file stands in quotes")
}

/// What a sign without meaning is probably for, and what is read for it.
fn stray(text: &str, span: Span) -> (Diagnostic, Option<Value>) {
    let sign = text.chars().next().map(spelling::shown).unwrap_or_default();
    let fault = |message: String| Diagnostic::error("S02", span, message);
    match text {
        "=" | ":" => (
            fault(format!("a statement is `key value`, without `{sign}`"))
                .label("leave it out")
                .help("`key value`, such as `visibility 23 km`"),
            None,
        ),
        "*" => (fault("`*` stands in quotes".to_string()).label("`\"*\"`?"), Some(Value::Text("*".to_string()))),
        "'" | "`" => (fault("strings stand in double quotes, and names in none".to_string()).label("`\"`?"), None),
        "$" | "@" | "&" => {
            (fault(format!("`{sign}` is no sign of the language")).label("a name stands without a sign"), None)
        }
        "\\" => (
            fault("a line needs no `\\` to go on".to_string())
                .label("leave it out")
                .help("a line that begins with a value continues the one above"),
            None,
        ),
        "+" | "-" | "/" | "^" => {
            (fault(format!("`{sign}` beside no number: a scene holds no arithmetic")).label("write the number"), None)
        }
        "." => (fault("a statement ends with its line, without a period".to_string()).label("leave it out"), None),
        _ => (fault(format!("`{sign}` is no sign of the language")).label("leave it out?"), None),
    }
}

/// What is wrong with a token that begins like a number, and what is read for it.
pub(super) fn malformed(text: &str, span: Span) -> (Diagnostic, Value) {
    let fault = |code: &'static str, message: String| Diagnostic::error(code, span, message);
    let plain = |number: f64, digits: &str| Value::Number { number, digits: digits.to_string(), unit: None };
    if text.contains(':') {
        let fault = fault("T01", format!("`{text}` is no clock"));
        return match meant_clock(text) {
            Some((hour, minute)) => (
                fault.label(format!("`{hour:02}:{minute:02}`?")),
                Value::Moment { date: None, clock: Some((hour, minute, 0.0)), offset: None },
            ),
            None => (
                fault.label("such as `09:30`, or `1992-06-18 12:00 -04:00`"),
                Value::Moment { date: None, clock: Some((12, 0, 0.0)), offset: None },
            ),
        };
    }
    if let Some(date) = meant_date(text) {
        let (year, month, day) = date;
        let fault = fault("T01", format!("`{text}` is no date")).label(format!("`{year:04}-{month:02}-{day:02}`?"));
        return (
            fault.help("a date is year-month-day: `1992-06-18`"),
            Value::Moment { date: Some(date), clock: None, offset: None },
        );
    }
    if let Some((low, high)) = text.split_once("..") {
        let (left, right) = (tidy(low), tidy_with_unit(high));
        let fault = fault("U04", format!("`{text}` is no range"));
        return match (left, right) {
            (Some(low), Some((high, unit))) => {
                let unit_text = unit.map_or("", |unit| unit);
                let range = Value::Range {
                    low: number(&low).unwrap_or(1.0),
                    high: number(&high).unwrap_or(1.0),
                    unit: unit.map(|unit| Word { text: unit.to_string(), span }),
                };
                (fault.label(format!("`{}`?", format!("{low}..{high} {unit_text}").trim_end())), range)
            }
            (Some(low), None) => {
                (fault.label("a range has two numbers: `420..520 nm`"), plain(number(&low).unwrap_or(1.0), &low))
            }
            _ => (fault.label("a range has two numbers: `420..520 nm`"), plain(1.0, "1")),
        };
    }
    if let Some((across, down)) = text.split_once(['x', 'X', '*']) {
        let (across, down) = (across.trim_end(), down.trim_start());
        if let (Some(m), Some(n)) =
            (whole(across).filter(|_| !across.is_empty()), whole(down).filter(|_| !down.is_empty()))
        {
            let fault = fault("U04", format!("`{text}` is no number")).label(format!("`{across} x {down}`?"));
            return (fault, Value::Grid(m, n));
        }
        if text.contains(" x ") {
            let fault = fault("U04", format!("`{text}`: both counts are whole numbers"));
            return (fault.label("such as `640 x 480`"), Value::Grid(1, 1));
        }
    }
    if let Some(end) = number_end(text.as_bytes(), 0) {
        let (digits, rest) = text.split_at(end);
        if rest.is_empty() {
            let fault = fault("U04", format!("`{text}` is beyond what a number can hold"));
            return (fault.label("at most about 1.8e308"), plain(1.0, "1"));
        }
        if let Some(high) = rest.strip_prefix('-').and_then(tidy_with_unit) {
            let (high, unit) = high;
            let label = format!("`{digits}..{high} {}", unit.unwrap_or("")).trim_end().to_string() + "`?";
            let fault = fault("U04", format!("`{text}` is no number")).label(label);
            let range = Value::Range {
                low: number(digits).unwrap_or(1.0),
                high: number(&high).unwrap_or(1.0),
                unit: unit.map(|unit| Word { text: unit.to_string(), span }),
            };
            return (fault.help("a range is two numbers with `..` between them"), range);
        }
    }
    let Some((digits, unit)) = tidy_with_unit(text) else {
        let digits = number_end(text.as_bytes(), 0).map_or("1", |end| &text[..end]);
        let fault = fault("U04", format!("`{text}` is no number")).label(format!("`{digits}`?"));
        return (
            fault.help("a number is digits, with a digit on both sides of a point: `12`, `-0.5`, `1e-3`"),
            plain(number(digits).unwrap_or(1.0), digits),
        );
    };
    let value = Value::Number {
        number: number(&digits).filter(|number| number.is_finite()).unwrap_or(1.0),
        digits: digits.clone(),
        unit: unit.map(|unit| Word { text: unit.to_string(), span }),
    };
    let fault = fault("U04", format!("`{text}` is no number"));
    let fault = match unit {
        Some(unit) => fault.label(format!("`{digits} {unit}`?")).help("a space parts a number from its unit"),
        None => fault.label(format!("`{digits}`?")).help("a number has a digit on both sides of its point"),
    };
    (fault, value)
}

fn meant_clock(text: &str) -> Option<(u8, u8)> {
    let mut parts = text.split(':');
    let (hour, minute) = (parts.next()?.parse().ok()?, parts.next()?.parse().ok()?);
    (hour <= 23 && minute <= 59).then_some((hour, minute))
}

fn meant_date(text: &str) -> Option<(i32, u8, u8)> {
    let parts: Vec<&str> = text.split(['-', '/', '.']).collect();
    let [a, b, c] = parts[..] else { return None };
    if !parts.iter().all(|part| !part.is_empty() && part.bytes().all(|byte| byte.is_ascii_digit())) {
        return None;
    }
    let [first, second]: [u8; 2] = [if a.len() == 4 { c } else { a }.parse().ok()?, b.parse().ok()?];
    let (year, month, day) = match (a.len(), c.len()) {
        (4, 1 | 2) => (a, second, first),
        (1 | 2, 4) if first <= 12 && (second > 12 || text.contains('/')) => (c, first, second),
        (1 | 2, 4) => (c, second, first),
        _ => return None,
    };
    Some((year.parse().ok()?, month, day))
}

/// A number as it should be written: digits on both sides of the point, no separators.
fn tidy(text: &str) -> Option<String> {
    let (sign, digits) = match text.strip_prefix(['+', '-']) {
        Some(rest) => (&text[..1], rest),
        None => ("", text),
    };
    let digits = digits.replace('_', "");
    let (mantissa, exponent) = match digits.find(['e', 'E']) {
        Some(i) => digits.split_at(i),
        None => (digits.as_str(), ""),
    };
    let mantissa = match mantissa.split_once('.') {
        Some(("", "")) => return None,
        Some(("", fraction)) => format!("0.{fraction}"),
        Some((whole, "")) => whole.to_string(),
        _ => mantissa.to_string(),
    };
    Some(format!("{sign}{mantissa}{exponent}")).filter(|text| number(text).is_some())
}

/// The same with a unit glued to it.
fn tidy_with_unit(text: &str) -> Option<(String, Option<&str>)> {
    if let Some(digits) = tidy(text) {
        return Some((digits, None));
    }
    // the longest number that leaves a unit
    let cut = text.char_indices().find(|(i, c)| *i > 0 && (c.is_ascii_alphabetic() || matches!(c, '%' | '/')))?.0;
    let unit = &text[cut..];
    let digits = tidy(&text[..cut])?;
    (spelling::is_unit(unit) || spelling::meant_unit(unit).is_some()).then_some((digits, Some(unit)))
}
