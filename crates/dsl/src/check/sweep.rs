//! What an experiment stands for: a run for each combination of its sweeps, each with its own constants.

use std::collections::{BTreeMap, BTreeSet};

use sunglint_radiometry::{Dimension, UNITS};

use super::block::{Body, Line, join};
use super::names::Kind;
use super::{Checker, Entity, experiment, time};
use crate::ast::{Block, Item, Statement, Value, Word};
use crate::scene::Shape;
use crate::{Diagnostic, Scene, Span};

/// Runs of a scene above which it is warned.
const MANY_RUNS: usize = 1000;
/// Runs of a scene that are not expanded: each is checked and bound by itself.
const MOST_RUNS: usize = 10_000;
/// Bytes of geometry that a scene may take under all its constants together.
const MOST_BYTES: usize = 4 << 30;
/// Longest name of a value and of a run, in bytes: folders carry them.
const LONGEST_VALUE: usize = 48;
const LONGEST_RUN: usize = 200;

/// One run of an experiment: its block with a value for every sweep.
pub(super) struct Run<'a> {
    /// Index of the experiment.
    pub entity: usize,
    /// Position among all runs of the scene.
    pub order: usize,
    /// `haze/reflectance=phong,visibility=5km`
    pub name: String,
    /// Swept values by name.
    pub sweep: Vec<(String, String)>,
    pub body: Body<'a>,
    /// Constants with another value.
    pub constants: Vec<Redefinition<'a>>,
}

/// A constant that an experiment gives another value.
#[derive(Clone, Copy)]
pub(super) struct Redefinition<'a> {
    pub name: &'a str,
    pub value: &'a Item,
    /// The `define` line.
    pub span: Span,
}

/// A sweep in an experiment's block.
struct Sweep {
    name: String,
    place: Place,
    /// Each item with its name.
    items: Vec<(Item, String)>,
}

/// Where a sweep stands.
struct Place {
    line: usize,
    /// Statements of nested blocks.
    path: Vec<usize>,
    /// The item that is the word `sweep`; its list follows.
    item: usize,
}

/// What is wrong or gone in the lines of an experiment's block.
#[derive(Default)]
struct Findings {
    sweeps: Vec<Sweep>,
    /// Lines with a sweep that cannot be read.
    faulty: BTreeSet<usize>,
    /// Statements of inherited `weather` blocks that a later one says again: line and statement.
    replaced: BTreeSet<(usize, usize)>,
}

impl<'a> Checker<'a> {
    /// The runs of all experiments, in the order of the text; the last sweep of a block varies fastest.
    pub(super) fn runs(&mut self, found: &[Entity<'a>], bodies: &[Body<'a>]) -> Vec<Run<'a>> {
        let mut runs: Vec<Run<'a>> = Vec::new();
        for (i, (entity, body)) in found.iter().zip(bodies).enumerate() {
            let mut findings = self.findings(body);
            let n = (findings.sweeps.iter()).fold(1usize, |n, sweep| n.saturating_mul(sweep.items.len()));
            let total = runs.len().saturating_add(n);
            if n > 1 && total > MOST_RUNS {
                let message = format!("the sweeps make {total} runs; a scene has at most {MOST_RUNS}");
                let fault = Diagnostic::error("X02", entity.line.span(), message).label("fewer values, or two scenes?");
                self.report(fault);
                findings.faulty.extend(findings.sweeps.drain(..).map(|sweep| sweep.place.line));
            } else if n > 1 && total > MANY_RUNS && runs.len() <= MANY_RUNS {
                let message = format!("the sweeps make {total} runs");
                let fault = Diagnostic::warning("X02", entity.line.span(), message).label("as many as are meant?");
                self.report(fault);
            }
            let n = (findings.sweeps.iter()).fold(1, |n, sweep| n * sweep.items.len());
            for combination in 0..n {
                let mut left = combination;
                let mut chosen: Vec<&(Item, String)> = Vec::with_capacity(findings.sweeps.len());
                for sweep in findings.sweeps.iter().rev() {
                    chosen.push(&sweep.items[left % sweep.items.len()]);
                    left /= sweep.items.len();
                }
                chosen.reverse();
                let sweep: Vec<(String, String)> = (findings.sweeps.iter().zip(&chosen))
                    .map(|(sweep, (_, value))| (sweep.name.clone(), value.clone()))
                    .collect();
                let items: Vec<&Item> = chosen.iter().map(|(item, _)| item).collect();
                let body = self.with_values(body, &findings, &items);
                let constants = self.redefinitions(&body);
                let name = name_of_run(entity.shown(), &sweep, combination);
                runs.push(Run { entity: i, order: runs.len(), name, sweep, body, constants });
            }
        }
        runs
    }

    /// The sweeps of a block.
    fn findings(&mut self, body: &Body<'a>) -> Findings {
        let mut found = Findings { replaced: replaced_weather(body), ..Findings::default() };
        for (i, line) in body.lines.iter().enumerate() {
            let mut good = self.scan(line, line.items, i, &[], &mut found.sweeps);
            for (s, statement) in line.block.iter().flat_map(|block| &block.statements).enumerate() {
                if !found.replaced.contains(&(i, s)) {
                    good &= self.scan_statement(statement, i, &mut vec![s], &mut found.sweeps);
                }
            }
            if !good {
                found.sweeps.retain(|sweep| sweep.place.line != i);
                found.faulty.insert(i);
            }
        }
        let mut taken: BTreeMap<String, usize> = BTreeMap::new();
        for sweep in &mut found.sweeps {
            let n = taken.entry(sweep.name.clone()).or_default();
            *n += 1;
            if *n > 1 {
                sweep.name = format!("{}_{n}", sweep.name);
            }
        }
        found
    }

    fn scan_statement(
        &mut self,
        statement: &'a Statement,
        line: usize,
        path: &mut Vec<usize>,
        out: &mut Vec<Sweep>,
    ) -> bool {
        let mut good = self.scan(&Line::of(statement), &statement.items, line, path, out);
        for (s, inner) in statement.block.iter().flat_map(|block| &block.statements).enumerate() {
            path.push(s);
            good &= self.scan_statement(inner, line, path, out);
            path.pop();
        }
        good
    }

    /// The sweeps among the items of a statement; false where one cannot be read.
    fn scan(&mut self, said: &Line<'a>, items: &'a [Item], line: usize, path: &[usize], out: &mut Vec<Sweep>) -> bool {
        let mut good = true;
        for (i, item) in items.iter().enumerate() {
            if !matches!(&item.value, Value::Word(word) if word == "sweep") {
                continue;
            }
            // A sweep is called what it varies: a constant by its name, a clause by its word.
            let name = match (said.key, i.checked_sub(1).map(|before| &items[before].value)) {
                ("define", _) => match items.first().map(|item| &item.value) {
                    Some(Value::Word(name)) => name.as_str(),
                    _ => said.key,
                },
                (_, Some(Value::Word(word))) => word.as_str(),
                _ => said.key,
            };
            match self.values(item.span, items.get(i + 1)) {
                Some(values) => {
                    let place = Place { line, path: path.to_vec(), item: i };
                    out.push(Sweep { name: name.to_string(), place, items: values });
                }
                None => good = false,
            }
        }
        good
    }

    /// The items of a sweep's list, each with its unit and its name.
    fn values(&mut self, sweep: Span, list: Option<&'a Item>) -> Option<Vec<(Item, String)>> {
        let given = list.map(|item| self.resolve(item, &[]));
        let is_list = |value: &Value| matches!(value, Value::List { .. } | Value::Runs { .. });
        let Some((list, given)) = list.zip(given).filter(|(_, given)| is_list(given.value)) else {
            if !self.spoilt(sweep) {
                let fault = Diagnostic::error("X02", sweep, "`sweep` takes a list of values");
                self.report(fault.label("`sweep [5, 10, 23] km`?"));
            }
            return None;
        };
        let packed: Vec<Vec<Item>>;
        let (rows, unit) = match given.value {
            Value::List { rows, unit } => (rows, unit),
            Value::Runs { runs, unit } => {
                let text = &self.sources.get(runs.file()).text;
                packed = (0..runs.len()).map(|i| vec![runs.item(i, text)]).collect();
                (&packed, unit)
            }
            _ => return None,
        };
        let mut values: Vec<Item> = Vec::with_capacity(rows.len());
        for row in rows {
            match row.as_slice() {
                [] => {}
                [only] => values.push(with_unit(only, unit.as_ref())),
                [_, second, ..] => {
                    let fault = Diagnostic::error("X02", second.span, "a sweep has one value for each run");
                    self.report(fault.label("a comma before this?"));
                    return None;
                }
            }
        }
        if values.is_empty() {
            let span = join(sweep, list.span);
            self.report(Diagnostic::error("X02", span, "this sweep is empty").label("one value at least"));
            return None;
        }
        let mut kinds: BTreeMap<&'static str, Span> = BTreeMap::new();
        let mut seen: BTreeMap<String, Span> = BTreeMap::new();
        let mut names: BTreeMap<String, usize> = BTreeMap::new();
        let mut out = Vec::with_capacity(values.len());
        for item in values {
            let shown = self.spelt(&item);
            let (kind, meaning) = self.kind_and_meaning(&item, &shown);
            if let Some(kind) = kind {
                kinds.entry(kind).or_insert(item.span);
                if let Some((other, first)) = kinds.iter().find(|(other, _)| **other != kind) {
                    let message = format!("a sweep has values of one kind; this is {kind}");
                    let fault = Diagnostic::error("X02", item.span, message).label("of another kind");
                    let fault = fault.note(*first, format!("this is {other}"));
                    self.report(fault);
                    return None;
                }
            }
            if let Some(first) = seen.insert(meaning, item.span) {
                let fault = Diagnostic::error("X02", item.span, format!("this sweep has `{shown}` twice"));
                self.report(fault.label("the same run again").note(first, "first here"));
                return None;
            }
            let mut name = name_of_value(&item.value, &shown);
            let n = names.entry(name.clone()).or_default();
            *n += 1;
            if *n > 1 {
                name = format!("{name}_{n}");
            }
            out.push((item, name));
        }
        Some(out)
    }

    /// What an item is, words left open, and a text that equal values share.
    fn kind_and_meaning(&mut self, item: &Item, shown: &str) -> (Option<&'static str>, String) {
        let mut value = &item.value;
        while let Value::Word(word) = value
            && let Some((item, _)) = self.constants.get(word.as_str())
        {
            value = &item.value;
        }
        let kind = match value {
            Value::Word(_) => None,
            Value::Number { .. } => Some("a number"),
            Value::Range { .. } => Some("a range"),
            Value::Grid(..) => Some("a number of columns and rows"),
            Value::Points { .. } => Some("a vector"),
            Value::List { .. } | Value::Runs { .. } => Some("a list"),
            Value::Text(_) => Some("a string"),
            Value::Moment { .. } => Some("a time"),
        };
        let Value::Number { number, unit, .. } = value else { return (kind, shown.to_string()) };
        let unit = unit.as_ref().map(|word| (UNITS.iter().find(|unit| unit.name == word.text), word.text.as_str()));
        let meaning = match unit {
            None => format!("{number:e}"),
            Some((Some(unit), _)) => {
                let of = if unit.dimension == Dimension::Wavelength { Dimension::Length } else { unit.dimension };
                // Units of one dimension differ by rounding only where the values are the same.
                format!("{:.12e} {of:?}", number * unit.factor + unit.offset)
            }
            Some((None, name)) => format!("{number:e} {name}"),
        };
        (kind, meaning)
    }

    /// A value as written, with the unit that its list gives it.
    pub(super) fn spelt(&self, item: &Item) -> String {
        let text = self.sources.text(item.span).split_whitespace().collect::<Vec<_>>().join(" ");
        let unit = match &item.value {
            Value::Number { unit, .. } | Value::Range { unit, .. } | Value::Points { unit, .. } => unit.as_ref(),
            _ => None,
        };
        match unit.filter(|unit| unit.span.file != item.span.file || unit.span.start >= item.span.end) {
            Some(unit) => format!("{text} {}", unit.text),
            None => text,
        }
    }

    /// A block with one value for each sweep, and without what was replaced or cannot be read.
    fn with_values(&mut self, body: &Body<'a>, found: &Findings, items: &[&Item]) -> Body<'a> {
        let mut out = Body { lines: Vec::with_capacity(body.lines.len()), ..body.clone() };
        for (i, line) in body.lines.iter().enumerate() {
            if found.faulty.contains(&i) {
                let key = experiment::EXPERIMENT.iter().map(|rule| rule.key).find(|key| *key == line.key);
                out.faulty.extend(key);
                continue;
            }
            let mut own: Vec<(&Place, &Item)> = (found.sweeps.iter().zip(items))
                .filter(|(sweep, _)| sweep.place.line == i)
                .map(|(sweep, item)| (&sweep.place, *item))
                .collect();
            let gone: Vec<usize> =
                found.replaced.iter().filter(|(line, _)| *line == i).map(|(_, statement)| *statement).collect();
            if own.is_empty() && gone.is_empty() {
                out.lines.push(*line);
                continue;
            }
            let key = Word { text: line.key.to_string(), span: line.key_span };
            let (items, block) = (line.items.to_vec(), line.block.cloned());
            let mut statement = Statement { key, items, block, span: line.span(), again: None };
            // From the right, so that the places to the left stay.
            own.sort_by_key(|(place, _)| std::cmp::Reverse(place.item));
            for (place, item) in own {
                if let Some(items) = items_at(&mut statement, &place.path) {
                    items.splice(place.item..place.item + 2, [item.clone()]);
                }
            }
            if let Some(Block { statements, .. }) = &mut statement.block {
                let mut index = 0;
                statements.retain(|_| {
                    index += 1;
                    !gone.contains(&(index - 1))
                });
            }
            let kept = self.kept.keep(statement);
            out.lines.push(Line { items: &kept.items, block: kept.block.as_ref(), ..*line });
        }
        out
    }

    /// The constants that a block gives another value.
    fn redefinitions(&mut self, body: &Body<'a>) -> Vec<Redefinition<'a>> {
        let mut out: Vec<Redefinition<'a>> = Vec::new();
        for line in body.all("define") {
            let [Item { value: Value::Word(name), span }, value, ..] = line.items else {
                self.absent(&line, "the name of a constant and a value");
                continue;
            };
            if !line.items[2..].is_empty() {
                self.surplus(&line, line.items, 2);
            } else if let Some(first) = out.iter().find(|known| known.name == name) {
                let message = format!("the constant `{name}` is given two values");
                let fault = Diagnostic::error("S05", line.span(), message).label("given again");
                let first = first.span;
                self.report(fault.note(first, "first here"));
            } else if self.look_up(Kind::Constant, name, *span).is_some() && self.constants.contains_key(name.as_str())
            {
                out.push(Redefinition { name, value, span: line.span() });
            }
        }
        out
    }

    /// Runs by the constants that they see: those of the text first (maybe none), then one group for each other set.
    pub(super) fn by_constants<'r>(&self, runs: &'r [Run<'a>]) -> Vec<Vec<&'r Run<'a>>> {
        let mut groups: Vec<Vec<&Run<'a>>> = vec![Vec::new()];
        let mut known: BTreeMap<Vec<(&str, String)>, usize> = BTreeMap::from([(Vec::new(), 0)]);
        for run in runs {
            // Paths count from the file that they stand in.
            let meaning = |item: &Item| match self.spelt(item) {
                text if text.contains('"') => format!("{:?} {text}", item.span.file),
                text => text,
            };
            let mut set: Vec<(&str, String)> = (run.constants.iter())
                .map(|constant| (constant.name, meaning(constant.value)))
                .filter(|(name, value)| self.constants.get(name).is_none_or(|(own, _)| meaning(own) != *value))
                .collect();
            set.sort();
            let group = *known.entry(set).or_insert_with(|| {
                groups.push(Vec::new());
                groups.len() - 1
            });
            groups[group].push(run);
        }
        groups
    }

    /// Whether a scene's geometry fits into memory `n` times; it is reported where not.
    pub(super) fn fits_times(&mut self, scene: &Scene, n: usize, place: Option<Span>) -> bool {
        let own = |shapes: &[Shape]| {
            let bytes = shapes.iter().map(|shape| match shape {
                Shape::Facets { polygons, .. } => polygons.iter().map(|(corners, _)| 48 + 24 * corners.len()).sum(),
                Shape::Place { poses, .. } => size_of_val(poses.as_slice()),
                _ => size_of::<Shape>(),
            });
            bytes.sum::<usize>()
        };
        let bytes = own(&scene.world) + scene.objects.iter().map(|object| own(&object.shapes)).sum::<usize>();
        let total = bytes.saturating_mul(n);
        let fits = n < 2 || total <= MOST_BYTES;
        if !fits {
            let message = format!("{n} sets of constants make {n} scenes, {:.1} GB of geometry", total as f64 / 1e9);
            let fault = match place {
                Some(place) => Diagnostic::error("G05", place, message),
                None => Diagnostic::whole("G05", message),
            };
            self.report(fault.label("fewer values, or a mesh from a file?"));
        }
        fits
    }
}

/// Statements of `weather` blocks that a later `weather` of the same experiment says again or excludes.
fn replaced_weather(body: &Body) -> BTreeSet<(usize, usize)> {
    let rule = |key: &str| time::WEATHER.iter().find(|rule| rule.key == key && !rule.many);
    let mut out = BTreeSet::new();
    let mut earlier: Vec<(usize, usize, &str)> = Vec::new();
    for (i, line) in body.lines.iter().enumerate().filter(|(_, line)| line.key == "weather") {
        let statements = || line.block.iter().flat_map(|block| &block.statements).enumerate();
        for (_, statement) in statements() {
            let key = statement.key.text.as_str();
            let Some(new) = rule(key) else { continue };
            let again = |old: &str| {
                old == key || new.excludes.contains(&old) || rule(old).is_some_and(|old| old.excludes.contains(&key))
            };
            out.extend(earlier.iter().filter(|(.., old)| again(old)).map(|(line, statement, _)| (*line, *statement)));
        }
        earlier.extend(statements().map(|(s, statement)| (i, s, statement.key.text.as_str())));
    }
    out
}

fn items_at<'s>(statement: &'s mut Statement, path: &[usize]) -> Option<&'s mut Vec<Item>> {
    match path {
        [] => Some(&mut statement.items),
        [first, rest @ ..] => items_at(statement.block.as_mut()?.statements.get_mut(*first)?, rest),
    }
}

fn with_unit(item: &Item, shared: Option<&Word>) -> Item {
    let mut item = item.clone();
    if let Value::Number { unit, .. } | Value::Range { unit, .. } | Value::Points { unit, .. } = &mut item.value
        && unit.is_none()
    {
        *unit = shared.cloned();
    }
    item
}

/// A value as folders and the command line write it: `5km`, `0_0_100m`, `white_paint.csv`.
fn name_of_value(value: &Value, shown: &str) -> String {
    let mut out = String::new();
    let number = matches!(value, Value::Number { .. });
    for c in shown.chars() {
        match c {
            'a'..='z' | 'A'..='Z' | '0'..='9' | '.' | '-' | '+' | '%' | '_' => out.push(c),
            '/' if number => out.push_str("per"),
            _ if number && c.is_whitespace() => {}
            _ if out.ends_with('_') || out.is_empty() => {}
            _ => out.push('_'),
        }
    }
    if let Some((before, unit)) = shown.rsplit_once(") ")
        && !before.is_empty()
        && out.ends_with(&format!("_{unit}"))
    {
        out.truncate(out.len() - unit.len() - 1);
        out.push_str(unit);
    }
    out.truncate(LONGEST_VALUE);
    let out = out.trim_end_matches('_');
    if out.is_empty() { "value".to_string() } else { out.to_string() }
}

fn name_of_run(experiment: &str, sweep: &[(String, String)], index: usize) -> String {
    if sweep.is_empty() {
        return experiment.to_string();
    }
    let mut values: String = sweep.iter().map(|(name, value)| format!("{name}={value}")).collect::<Vec<_>>().join(",");
    if values.len() > LONGEST_RUN {
        let end = (0..=LONGEST_RUN).rev().find(|end| values.is_char_boundary(*end)).unwrap_or(0);
        values.truncate(end);
        values.push_str(&format!("+{}", index + 1));
    }
    format!("{experiment}/{values}")
}
