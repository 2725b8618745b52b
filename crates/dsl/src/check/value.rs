//! Single values: quantities with their units, counts, words, texts, vectors.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};
use sunglint_radiometry::{Dimension, UNITS, Unit, unit, units_of};

use super::Checker;
use super::block::Line;
use super::names::Kind;
use crate::ast::{Item, Point, Value, Word};
use crate::nearest::list;
use crate::parse::spelling::meant_unit;
use crate::{Diagnostic, Span};

/// What a number measures and where it must lie, in canonical units.
#[derive(Clone, Copy, Debug)]
pub(super) struct Quantity {
    pub of: Dimension,
    pub low: f64,
    pub high: f64,
    pub low_open: bool,
    pub high_open: bool,
    /// Only `%` will do.
    pub percent: bool,
    /// The unit that a cure proposes.
    pub usual: &'static str,
    /// Code of a number out of range.
    pub code: &'static str,
}

impl Quantity {
    pub(super) const fn new(of: Dimension) -> Self {
        Self {
            of,
            low: f64::NEG_INFINITY,
            high: f64::INFINITY,
            low_open: false,
            high_open: false,
            percent: false,
            usual: "",
            code: "U05",
        }
    }
    pub(super) const fn within(self, low: f64, high: f64) -> Self {
        Self { low, high, ..self }
    }
    /// Strictly above zero.
    pub(super) const fn positive(self, high: f64) -> Self {
        Self { low: 0.0, low_open: true, high, ..self }
    }
    pub(super) const fn below(self, high: f64) -> Self {
        Self { high, high_open: true, ..self }
    }
    pub(super) const fn usual(self, usual: &'static str) -> Self {
        Self { usual, ..self }
    }
    pub(super) const fn code(self, code: &'static str) -> Self {
        Self { code, ..self }
    }
    /// A number of a unit in the canonical one, where it lies in the range.
    pub(super) fn in_range(&self, unit: &Unit, number: f64) -> Option<f64> {
        Some(number * unit.factor + unit.offset).filter(|value| self.holds(*value))
    }
    fn holds(&self, value: f64) -> bool {
        let above = if self.low_open { value > self.low } else { value >= self.low };
        above && if self.high_open { value < self.high } else { value <= self.high } && value.is_finite()
    }
}

/// Coordinates: ±10⁹ m keeps every sum of squares finite and exact to a micrometre.
pub(super) const COORDINATE: Quantity = Quantity::new(Dimension::Length).within(-1e9, 1e9);
/// Sizes, radii, spacings.
pub(super) const SIZE: Quantity = Quantity::new(Dimension::Length).positive(1e9).code("G04");
/// Scales.
pub(super) const SCALE: Quantity = Quantity::new(Dimension::Fraction).positive(1e9).code("G04");
/// Headings, azimuths, pitch and roll.
pub(super) const TURN: Quantity = Quantity::new(Dimension::Angle).within(-2.0 * PI, 2.0 * PI);
/// Wavelengths, well beyond what any atmosphere here covers.
pub(super) const WAVELENGTH: Quantity = Quantity::new(Dimension::Wavelength).within(0.1, 20.0).usual("nm");
/// Steps and widths in wavelength.
pub(super) const BANDWIDTH: Quantity = Quantity::new(Dimension::Wavelength).positive(10.0).usual("nm");
/// Shares of a whole.
pub(super) const SHARE: Quantity = Quantity::new(Dimension::Fraction).within(0.0, 1.0);

/// A value, a constant resolved.
#[derive(Clone, Copy, Debug)]
pub(super) struct Given<'a> {
    pub value: &'a Value,
    /// Where it is used.
    pub span: Span,
    /// Where it stands: in the constant's definition, if it is one.
    pub home: Span,
    pub constant: Option<&'a str>,
}

/// `a field of view`, `visibility`, `` `diffuse` ``: what a line is about.
pub(super) fn subject(line: &Line) -> String {
    if line.param {
        return format!("`{}`", line.key);
    }
    let words = match line.key {
        "at" => "position",
        "ifov" => "IFOV",
        "every" => "step",
        "fwhm" => "FWHM",
        "aod" => "AOD",
        "no2" => "NO2",
        "samples" => "number of samples",
        "sides" => "number of sides",
        "map" => "class",
        "pixels" => "number of pixels",
        "look_at" => "look-at point",
        "band" => "band edge",
        "bands" => "band",
        "only" => "selection",
        "extrapolate" => "extrapolation",
        key => key,
    };
    let words = words.replace('_', " ");
    let mass =
        ["visibility", "pressure", "temperature", "humidity", "water", "ozone", "emission", "reflectance", "NO2"];
    if mass.contains(&words.as_str()) {
        words
    } else if words.starts_with(['a', 'e', 'i', 'o', 'u', 'A', 'I', 'F']) {
        format!("an {words}")
    } else {
        format!("a {words}")
    }
}

fn without_article(noun: &str) -> &str {
    noun.trim_start_matches("an ").trim_start_matches("a ")
}

/// A number as one would write it.
pub(super) fn written(value: f64) -> String {
    let rounded: f64 = format!("{value:.9e}").parse().unwrap_or(value);
    if rounded == 0.0 {
        "0".to_string()
    } else if (1e-4..1e7).contains(&rounded.abs()) {
        rounded.to_string()
    } else {
        format!("{rounded:e}")
    }
}

fn others(of: Dimension, but: &str) -> String {
    let mut units: Vec<&Unit> = units_of(of).filter(|unit| unit.name != but).collect();
    if of == Dimension::Length {
        units.sort_by(|a, b| (a.name == "ft").cmp(&(b.name == "ft")).then(a.factor.total_cmp(&b.factor)));
    }
    let names: Vec<&str> = units.iter().map(|unit| unit.name).collect();
    if names.is_empty() { String::new() } else { format!(" ({})", names.join(" ")) }
}

fn usual(q: &Quantity) -> &'static str {
    if q.usual.is_empty() { units_of(q.of).next().map_or("", |unit| unit.name) } else { q.usual }
}

impl<'a> Checker<'a> {
    /// The text of a place, cut to what a message can hold.
    pub(super) fn shown(&self, span: Span) -> String {
        let text = self.sources.text(span);
        let line = text.lines().next().unwrap_or_default();
        if line.chars().count() > 40 || line.len() < text.len() {
            format!("{} …", line.chars().take(40).collect::<String>().trim_end())
        } else {
            line.to_string()
        }
    }

    /// A value with the constant it names put in its place; a parameter's own words win.
    pub(super) fn resolve(&mut self, item: &'a Item, own: &[&str]) -> Given<'a> {
        let mut given = Given { value: &item.value, span: item.span, home: item.span, constant: None };
        if let Value::Word(word) = &item.value
            && own.contains(&word.as_str())
        {
            if let Some((_, at)) = self.constants.get(word.as_str()) {
                let at = *at;
                let message = format!("the constant `{word}` is hidden by a word of that name");
                let fault =
                    Diagnostic::warning("N05", item.span, message).label("the word is taken; rename the constant");
                self.report(fault.note(at, "defined here"));
            }
            return given;
        }
        while let Value::Word(word) = given.value
            && !own.contains(&word.as_str())
            && let Some((item, _)) = self.constants.get(word.as_str())
        {
            given = Given {
                value: &item.value,
                span: given.span,
                home: item.span,
                constant: Some(given.constant.unwrap_or(word)),
            };
        }
        given
    }

    /// A fault of a value; of a constant's type, N05 with the definition.
    pub(super) fn misfit(&self, given: &Given<'a>, code: &'static str, message: impl Into<String>) -> Diagnostic {
        let Some(name) = given.constant else { return Diagnostic::error(code, given.span, message) };
        let code = if matches!(code, "U05" | "G04" | "M05" | "F01" | "F02") { code } else { "N05" };
        let text = self.shown(given.home);
        Diagnostic::error(code, given.span, message).note(given.home, format!("`{name}` is defined as `{text}`"))
    }

    /// Reports a value that is missing behind a key.
    pub(super) fn absent(&mut self, line: &Line<'a>, noun: &str) {
        if !self.spoilt(line.span()) {
            let message = format!("`{}` has no value", line.key);
            self.report(Diagnostic::error("S05", line.key_span, message).label(format!("{noun} is due here")));
        }
    }

    /// Reports a value of the wrong kind.
    pub(super) fn wrong(&mut self, line: &Line<'a>, given: &Given<'a>, noun: &str) {
        let what = subject(line);
        if let (Value::Word(word), None) = (given.value, given.constant) {
            if self.poisoned.contains(word.as_str()) {
                return;
            }
            let near = self.near(word, self.constants.keys().copied());
            let fault =
                Diagnostic::error("N02", given.span, format!("{what} is {noun}; no constant is called `{word}`"));
            let near = near.map_or_else(|| format!("{noun}?"), |near| format!("`{near}`?"));
            self.report(fault.label(near));
            return;
        }
        let kind = match given.value {
            Value::Word(_) => "a word",
            Value::Number { .. } => "a number",
            Value::Range { .. } => "a range",
            Value::Grid(..) => "a number of columns and rows",
            Value::Points { points, .. } if points.len() == 1 => "a vector",
            Value::Points { .. } => "a run of vectors",
            Value::List { .. } => "a list",
            Value::Runs { .. } => "a list of vectors",
            Value::Text(_) => "a string",
            Value::Moment { .. } => "a time",
        };
        let fault = self.misfit(given, "U04", format!("{what} is {noun}; this is {kind}"));
        self.report(fault.label(format!("{noun}?")));
    }

    /// A number with its unit, in the canonical unit, within its range.
    pub(super) fn measure(
        &mut self,
        line: &Line<'a>,
        given: &Given<'a>,
        shared: Option<&Word>,
        q: &Quantity,
    ) -> Option<f64> {
        let Value::Number { number, digits, unit } = given.value else {
            self.wrong(line, given, if q.percent { "a percentage" } else { q.of.noun() });
            return None;
        };
        self.convert(line, given, (*number, digits), unit.as_ref().or(shared), q)
    }

    /// `measure` for one number of a vector, range or row.
    pub(super) fn convert(
        &mut self,
        line: &Line<'a>,
        given: &Given<'a>,
        (number, digits): (f64, &str),
        named: Option<&Word>,
        q: &Quantity,
    ) -> Option<f64> {
        let what = subject(line);
        let noun = if q.percent { "a percentage" } else { q.of.noun() };
        let own = usual(q);
        let spaced = |unit: &str| if unit.is_empty() { digits.to_string() } else { format!("{digits} {unit}") };
        let found = match named {
            None if q.of == Dimension::Fraction && !q.percent => None,
            None => {
                let fault = self.misfit(given, "U02", format!("{what} is {noun}; `{digits}` has no unit"));
                self.report(fault.label(format!("{}?{}", spaced(own), others(q.of, own))));
                return None;
            }
            Some(word) => match unit(&word.text, q.of) {
                Some(unit) => Some(unit),
                None => {
                    self.wrong_unit(given, &what, digits, word, q);
                    return None;
                }
            },
        };
        let canonical = |unit: &Unit, value: f64| value * unit.factor + unit.offset;
        let value = found.map_or(number, |unit| canonical(unit, number));
        if q.holds(value) {
            return Some(value);
        }
        let percent = q.of == Dimension::Fraction && found.is_none() && q.holds(number / 100.0) && number >= 2.0;
        let meant = units_of(q.of)
            .filter(|unit| found.is_some_and(|found| found.name != unit.name) && q.holds(canonical(unit, number)))
            .filter(|_| q.of != Dimension::Angle)
            .min_by_key(|unit| (unit.name != own, unit.name == "ft"));
        let range = range_text(q, found, value);
        let label = match (percent, meant) {
            (true, _) => format!("{digits} %?"),
            (_, Some(unit)) => format!("{}?", spaced(unit.name)),
            _ => range.clone(),
        };
        let shown = found.map_or_else(|| digits.to_string(), |unit| spaced(unit.name));
        let fault = self.misfit(given, q.code, format!("{what} is {range}; `{shown}` is not"));
        self.report(fault.label(label));
        None
    }

    fn wrong_unit(&mut self, given: &Given<'a>, what: &str, digits: &str, word: &Word, q: &Quantity) {
        let own = usual(q);
        let noun = if q.percent { "a percentage" } else { q.of.noun() };
        let known = UNITS.iter().find(|unit| unit.name == word.text);
        let cure = |unit: &str| if unit.is_empty() { format!("{digits}?") } else { format!("{digits} {unit}?") };
        let fault = match known {
            None if word.text.contains(' ') => {
                let first = word.text.split(' ').find(|name| unit(name, q.of).is_some()).unwrap_or(own);
                self.misfit(given, "U01", format!("{what} has one unit; `{}` are two", word.text)).label(cure(first))
            }
            Some(_) if q.of == Dimension::Fraction && !q.percent => self
                .misfit(given, "U01", format!("{what} is {noun}; it takes no unit such as `{}`", word.text))
                .label(format!("{digits}?")),
            Some(unit) => {
                let other = if unit.dimension == Dimension::Fraction {
                    format!("`{}` is a percentage", word.text)
                } else {
                    format!("`{}` is a unit of {}", word.text, without_article(unit.dimension.noun()))
                };
                self.misfit(given, "U03", format!("{what} is {noun}; {other}")).label(format!(
                    "{}{}",
                    cure(own),
                    others(q.of, own)
                ))
            }
            None => {
                let near = self
                    .near(&word.text, units_of(q.of).map(|unit| unit.name))
                    .or_else(|| meant_unit(&word.text).filter(|name| unit(name, q.of).is_some()));
                let label = format!("{}{}", cure(near.unwrap_or(own)), others(q.of, near.unwrap_or(own)));
                self.misfit(given, "U01", format!("{what} is {noun}; `{}` is no unit", word.text)).label(label)
            }
        };
        self.report(fault);
    }

    /// The one quantity that a line holds.
    pub(super) fn quantity(&mut self, line: &Line<'a>, q: &Quantity) -> Option<f64> {
        self.quantity_at(line, line.items, q)
    }

    /// The one quantity that these items of a line hold.
    pub(super) fn quantity_at(&mut self, line: &Line<'a>, items: &'a [Item], q: &Quantity) -> Option<f64> {
        let Some(item) = items.first() else {
            self.absent(line, if q.percent { "a percentage" } else { q.of.noun() });
            return None;
        };
        let given = self.resolve(item, &[]);
        // A word behind a bare number is a unit that is none.
        if let (Value::Number { number, digits, unit: None }, Some(Item { value: Value::Word(text), span })) =
            (given.value, items.get(1))
            && given.constant.is_none()
        {
            let word = Word { text: text.clone(), span: *span };
            let whole = Given { span: super::block::join(given.span, *span), ..given };
            let value = self.convert(line, &whole, (*number, digits), Some(&word), q)?;
            self.surplus(line, items, 2);
            return Some(value);
        }
        let value = self.measure(line, &given, None, q)?;
        self.surplus(line, items, 1);
        Some(value)
    }

    /// A quantity of a line that may be unsaid.
    pub(super) fn optional(&mut self, line: Option<Line<'a>>, q: &Quantity) -> Option<f64> {
        line.and_then(|line| self.quantity(&line, q))
    }

    /// A whole number.
    pub(super) fn whole(&mut self, line: &Line<'a>, given: &Given<'a>, low: u64, high: u64) -> Option<u64> {
        let Value::Number { number, digits, unit } = given.value else {
            self.wrong(line, given, "a whole number");
            return None;
        };
        if let Some(unit) = unit {
            let message = format!("{} is a whole number; it takes no unit such as `{}`", subject(line), unit.text);
            let fault = self.misfit(given, "U01", message).label(format!("{digits}?"));
            self.report(fault);
            return None;
        }
        let exact = digits.trim_start_matches('+').parse::<u64>().ok();
        let value = exact.or_else(|| (number.fract() == 0.0 && (0.0..9e15).contains(number)).then_some(*number as u64));
        match value.filter(|value| (low..=high).contains(value)) {
            Some(value) => Some(value),
            None => {
                let range = if high == u64::MAX { format!("from {low} up") } else { format!("{low}..{high}") };
                let message = format!("{} is a whole number, {range}; `{digits}` is not", subject(line));
                let fault = self.misfit(given, "U05", message).label(range);
                self.report(fault);
                None
            }
        }
    }

    /// The one whole number that a line holds.
    pub(super) fn count(&mut self, line: &Line<'a>, low: u64, high: u64) -> Option<u64> {
        let Some(item) = line.items.first() else {
            self.absent(line, "a whole number");
            return None;
        };
        let given = self.resolve(item, &[]);
        let value = self.whole(line, &given, low, high)?;
        self.surplus(line, line.items, 1);
        Some(value)
    }

    /// A string.
    pub(super) fn text(&mut self, line: &Line<'a>) -> Option<(&'a str, Given<'a>)> {
        let Some(item) = line.items.first() else {
            self.absent(line, "a string");
            return None;
        };
        let given = self.resolve(item, &[]);
        let Value::Text(text) = given.value else {
            self.wrong(line, &given, "a string");
            return None;
        };
        self.surplus(line, line.items, 1);
        Some((text, given))
    }

    /// One word of a list.
    pub(super) fn word_of(&mut self, line: &Line<'a>, words: &[&'static str]) -> Option<&'static str> {
        let Some(item) = line.items.first() else {
            self.absent(line, &format!("one of {}", words.join(", ")));
            return None;
        };
        let word = self.choose(line, item, words)?;
        self.surplus(line, line.items, 1);
        Some(word)
    }

    /// An item as one word of a list.
    pub(super) fn choose(&mut self, line: &Line<'a>, item: &'a Item, words: &[&'static str]) -> Option<&'static str> {
        let given = self.resolve(item, words);
        let Value::Word(word) = given.value else {
            self.wrong(line, &given, &format!("one of {}", words.join(", ")));
            return None;
        };
        let found = words.iter().find(|known| *known == word).copied();
        if found.is_none() && !self.poisoned.contains(word.as_str()) {
            let near = self.near(word, words.iter().copied()).map(|near| format!("`{near}`?")).unwrap_or_default();
            let fault = self.misfit(&given, "N01", format!("`{word}` is no word of `{}`", line.key)).label(near);
            self.report(fault.help(format!("known: {}", list(words.iter().copied()))));
        }
        found
    }

    /// The vectors of items, each of `n` numbers, in metres.
    fn vectors(&mut self, line: &Line<'a>, items: &'a [Item], n: usize, q: &Quantity) -> Option<Vec<([f64; 3], Span)>> {
        let mut out = Vec::new();
        for item in items {
            self.run(line, item, None, n..=n, q, &mut |numbers, span| out.push((numbers, span)))?;
        }
        Some(out)
    }

    /// Every vector of one run; each number in its canonical unit.
    pub(super) fn run(
        &mut self,
        line: &Line<'a>,
        item: &'a Item,
        shared: Option<&Word>,
        sizes: std::ops::RangeInclusive<usize>,
        q: &Quantity,
        out: &mut dyn FnMut([f64; 3], Span),
    ) -> Option<()> {
        let given = self.resolve(item, &[]);
        let Value::Points { points, unit: own } = given.value else {
            let noun = if *sizes.end() == 2 { "a vector of two lengths" } else { "a vector of lengths" };
            self.wrong(line, &given, noun);
            return None;
        };
        self.vectors_of(line, &given, points, own.as_ref().or(shared), sizes, q, out)
    }

    /// `run` for the points of one.
    #[expect(clippy::too_many_arguments, reason = "the parts of a run, and what is asked of it")]
    pub(super) fn vectors_of(
        &mut self,
        line: &Line<'a>,
        given: &Given<'a>,
        points: &[Point],
        named: Option<&Word>,
        sizes: std::ops::RangeInclusive<usize>,
        q: &Quantity,
        out: &mut dyn FnMut([f64; 3], Span),
    ) -> Option<()> {
        let unit_of_run = named.and_then(|word| unit(&word.text, q.of));
        if q.of != Dimension::Fraction && unit_of_run.is_none() {
            let digits = self.shown(points.last().map_or(given.home, |point| point.span));
            return self.convert(line, given, (0.0, &digits), named, q).map(|_| ());
        }
        for point in points {
            let (numbers, span) = (point.numbers(), point.span);
            if !sizes.contains(&numbers.len()) {
                let (low, high) = (sizes.start(), sizes.end());
                let due = if low == high { low.to_string() } else { format!("{low} or {high}") };
                let message = format!("{} takes {due} numbers; this vector has {}", subject(line), numbers.len());
                let label = match (numbers.len(), *low) {
                    (2, 3) => "(x y z)?",
                    (3, 2) => "(x y)?",
                    _ => "",
                };
                self.report(Diagnostic::error("U04", span, message).label(label));
                return None;
            }
            let mut vector = [0.0; 3];
            for (slot, number) in vector.iter_mut().zip(numbers) {
                let quick = unit_of_run.and_then(|unit| q.in_range(unit, *number));
                *slot = match quick {
                    Some(value) => value,
                    None => {
                        let whole = Given { span: if given.constant.is_some() { given.span } else { span }, ..*given };
                        self.convert(line, &whole, (*number, &written(*number)), named, q)?
                    }
                };
            }
            out(vector, span);
        }
        Some(())
    }

    fn one_vector(&mut self, line: &Line<'a>, n: usize, q: &Quantity) -> Option<[f64; 3]> {
        if line.items.is_empty() {
            self.absent(line, if n == 2 { "a vector of two lengths" } else { "a vector of lengths" });
            return None;
        }
        let vectors = self.vectors(line, &line.items[..1], n, q)?;
        if let Some((_, span)) = vectors.get(1) {
            let message = format!("{} is one vector; this is a run of {}", subject(line), vectors.len());
            self.report(Diagnostic::error("U04", *span, message).label("one vector too many"));
            return None;
        }
        let vector = vectors.first()?.0;
        self.surplus(line, line.items, 1);
        Some(vector)
    }

    /// The one vector of three lengths that a line holds.
    pub(super) fn vector3(&mut self, line: &Line<'a>, q: &Quantity) -> Option<DVec3> {
        self.one_vector(line, 3, q).map(DVec3::from)
    }
    /// The one vector of two lengths that a line holds.
    pub(super) fn vector2(&mut self, line: &Line<'a>, q: &Quantity) -> Option<DVec2> {
        self.one_vector(line, 2, q).map(|[x, y, _]| DVec2::new(x, y))
    }

    /// A range with its unit, `low` below `high`.
    pub(super) fn range_of(&mut self, line: &Line<'a>, given: &Given<'a>, q: &Quantity) -> Option<(f64, f64)> {
        let Value::Range { low, high, unit } = given.value else {
            self.wrong(line, given, "a range");
            return None;
        };
        let (text_low, text_high) = (written(*low), written(*high));
        if unit.as_ref().and_then(|word| sunglint_radiometry::unit(&word.text, q.of)).is_none() {
            self.convert(line, given, (*low, &format!("{text_low}..{text_high}")), unit.as_ref(), q)?;
        }
        let lower = self.convert(line, given, (*low, &text_low), unit.as_ref(), q)?;
        let upper = self.convert(line, given, (*high, &text_high), unit.as_ref(), q)?;
        if lower < upper {
            return Some((lower, upper));
        }
        let unit = unit.as_ref().map_or(String::new(), |unit| format!(" {}", unit.text));
        let message = format!("the range `{}` is empty", self.shown(given.home));
        let cure = if lower > upper { format!("{text_high}..{text_low}{unit}?") } else { String::new() };
        let fault = self.misfit(given, "U05", message).label(cure);
        self.report(fault);
        None
    }

    /// The items of a list or the one item that stands for it.
    pub(super) fn members(&mut self, line: &Line<'a>, item: &'a Item) -> Option<Vec<&'a Item>> {
        let one = matches!(&item.value, Value::Word(word) if self.known_anywhere(word));
        let given = if one {
            Given { value: &item.value, span: item.span, home: item.span, constant: None }
        } else {
            self.resolve(item, &[])
        };
        let Value::List { rows, .. } = given.value else {
            return match (&given.constant, given.value) {
                (Some(name), Value::Word(_)) => Some(vec![self.constants.get(name)?.0]),
                _ => Some(vec![item]),
            };
        };
        let mut out = Vec::with_capacity(rows.len());
        for row in rows {
            match row.as_slice() {
                [] => {}
                [only] => out.push(only),
                [_, second, ..] => {
                    let message = format!("the items of `{}` are parted by commas or line breaks", line.key);
                    self.report(Diagnostic::error("S03", second.span, message).label("a comma before this?"));
                    return None;
                }
            }
        }
        Some(out)
    }

    fn known_anywhere(&self, word: &str) -> bool {
        Kind::NAMED.iter().any(|kind| self.names.find(*kind, word).is_some())
    }
}

/// The range of a quantity; a limit that is only there to keep sums finite is told to what exceeds it.
fn range_text(q: &Quantity, found: Option<&Unit>, value: f64) -> String {
    let unit = found.filter(|unit| unit.name != "%").or_else(|| unit(usual(q), q.of).filter(|u| u.name != "%"));
    let name = unit.map_or(String::new(), |unit| format!(" {}", unit.name));
    let show = |value: f64| written(unit.map_or(value, |unit| (value - unit.offset) / unit.factor));
    let (low, high) =
        if q.percent { (written(q.low * 100.0), written(q.high * 100.0)) } else { (show(q.low), show(q.high)) };
    let name = if q.percent { " %".to_string() } else { name };
    match (q.low.is_finite(), q.high.is_finite() && (q.high < 1e8 || value > q.high)) {
        (true, true) if q.low_open && q.high_open => format!("between {low} and {high}{name}, both excluded"),
        (true, true) if q.low_open => format!("above {low} and at most {high}{name}"),
        (true, true) if q.high_open => format!("from {low} to below {high}{name}"),
        (true, true) => format!("within {low}..{high}{name}"),
        (true, false) if q.low_open => format!("above {low}{name}"),
        (true, false) => format!("at least {low}{name}"),
        (false, true) if q.high_open => format!("below {high}{name}"),
        (false, true) => format!("at most {high}{name}"),
        (false, false) => "a finite number".to_string(),
    }
}
