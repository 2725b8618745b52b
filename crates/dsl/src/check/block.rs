//! Blocks held against tables of statements: unknown, doubled, missing, excluding and run-together statements.

use std::collections::{BTreeMap, BTreeSet};

use super::Checker;
use crate::ast::{Block, Item, Statement, Value};
use crate::nearest::list;
use crate::parse::spelling::{CONNECTIVES, is_unit};
use crate::{Diagnostic, Runs, Severity, Span};

/// Whether braces may follow a statement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Braces {
    /// They may not.
    None,
    /// They may, and are read by the statement's own reader.
    Optional,
    /// They must.
    Required,
    /// They may hold the statement's clauses, one a line.
    Clauses,
}

/// One statement of a block, or one clause of a statement.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rule {
    pub key: &'static str,
    /// How it is written.
    pub form: &'static str,
    pub required: bool,
    pub many: bool,
    /// Items after the key that are never taken for keys: names.
    pub leading: usize,
    /// Whether the first item may be any word, even one that is a clause's key.
    pub word: bool,
    pub clauses: &'static [Rule],
    pub braces: Braces,
    pub excludes: &'static [&'static str],
    /// Defined by the language, not meant by this version: an error where ignoring it would change a picture.
    pub later: Option<Severity>,
}

/// A statement, once at most, without clauses and braces.
pub(super) const fn rule(key: &'static str, form: &'static str) -> Rule {
    Rule {
        key,
        form,
        required: false,
        many: false,
        leading: 0,
        word: false,
        clauses: &[],
        braces: Braces::None,
        excludes: &[],
        later: None,
    }
}

impl Rule {
    pub(super) const fn required(self) -> Self {
        Self { required: true, ..self }
    }
    pub(super) const fn many(self) -> Self {
        Self { many: true, ..self }
    }
    pub(super) const fn leading(self, leading: usize) -> Self {
        Self { leading, ..self }
    }
    pub(super) const fn word(self) -> Self {
        Self { word: true, ..self }
    }
    pub(super) const fn clauses(self, clauses: &'static [Rule]) -> Self {
        Self { clauses, ..self }
    }
    pub(super) const fn braces(self, braces: Braces) -> Self {
        Self { braces, ..self }
    }
    pub(super) const fn excludes(self, excludes: &'static [&'static str]) -> Self {
        Self { excludes, ..self }
    }
    pub(super) const fn later(self, severity: Severity) -> Self {
        Self { later: Some(severity), ..self }
    }
}

/// A statement or clause as said: a view into the tree.
#[derive(Clone, Copy, Debug)]
pub(super) struct Line<'a> {
    pub key: &'a str,
    pub key_span: Span,
    pub items: &'a [Item],
    pub block: Option<&'a Block>,
    /// The statement said again, each time with another run.
    pub again: Option<&'a Runs>,
    pub clauses: &'static [Rule],
    pub leading: usize,
    /// The table that it stands in, where that is fixed.
    pub siblings: &'static [Rule],
    /// Whether it comes by `like`.
    pub inherited: bool,
    /// Whether it is a parameter of a model, named in messages as written.
    pub param: bool,
    /// Whether its braces hold its clauses.
    pub spread: bool,
    /// The statement that it is a clause of, or itself.
    pub of: &'a str,
}

impl<'a> Line<'a> {
    pub(super) fn of(statement: &'a Statement) -> Self {
        Self {
            key: &statement.key.text,
            key_span: statement.key.span,
            items: &statement.items,
            block: statement.block.as_ref(),
            again: statement.again.as_deref(),
            clauses: &[],
            leading: 0,
            siblings: &[],
            inherited: false,
            param: false,
            spread: false,
            of: &statement.key.text,
        }
    }
    fn piece(key: &'a str, key_span: Span, items: &'a [Item]) -> Self {
        Self {
            key,
            key_span,
            items,
            block: None,
            again: None,
            clauses: &[],
            leading: 0,
            siblings: &[],
            inherited: false,
            param: false,
            spread: false,
            of: key,
        }
    }
    /// From the key to the last item.
    pub(super) fn span(&self) -> Span {
        self.items.last().map_or(self.key_span, |item| join(self.key_span, item.span))
    }
    /// The items, or the key where there are none.
    pub(super) fn value_span(&self) -> Span {
        match self.items {
            [] => self.key_span,
            [first, .., last] => join(first.span, last.span),
            [only] => only.span,
        }
    }
    /// Where a second statement begins on this line, whose comma was forgotten.
    fn second_statement(&self, rule: &Rule, rules: &[Rule]) -> Option<usize> {
        let is_clause = |item: &Item| match &item.value {
            Value::Word(word) => rule.clauses.iter().find(|clause| clause.key == word),
            _ => None,
        };
        (rule.leading.max(1)..self.items.len()).find(|&i| {
            let Value::Word(word) = &self.items[i].value else { return false };
            let after_clause = is_clause(&self.items[i - 1]).is_some();
            let connected = matches!(&self.items[i - 1].value, Value::Word(word) if is_connective(word));
            !after_clause && !connected && is_clause(&self.items[i]).is_none() && rules.iter().any(|r| r.key == word)
        })
    }
}

/// One span over two places of a file; the first of them where they lie in two.
pub(super) fn join(a: Span, b: Span) -> Span {
    if a.file == b.file { a.to(b) } else { a }
}

/// Whether a word holds a statement together; no name may be one.
pub(super) fn is_connective(word: &str) -> bool {
    CONNECTIVES.contains(&word)
}

/// What a block belongs to, for messages.
#[derive(Clone, Debug)]
pub(super) struct Owner {
    /// In words: "a sensor", "`ideal`".
    pub of: String,
    /// What its lines are: "statement", "parameter", "word".
    pub noun: &'static str,
    /// Code of two lines that exclude each other.
    pub exclusion: &'static str,
    /// Where it is named.
    pub span: Span,
    /// All of it.
    pub extent: Span,
}

impl Owner {
    pub(super) fn new(of: impl Into<String>, line: &Line) -> Self {
        let extent = line.block.map_or(line.span(), |block| join(line.span(), block.span));
        Self { of: of.into(), noun: "statement", exclusion: "S05", span: line.span(), extent }
    }
}

/// The known lines of a block.
#[derive(Clone, Debug, Default)]
pub(super) struct Body<'a> {
    pub lines: Vec<Line<'a>>,
    /// Keys that were said in a way that has been reported.
    pub faulty: BTreeSet<&'static str>,
    /// Whether something was said that nothing is near to: what seems missing may be that.
    pub obscure: bool,
}

impl<'a> Body<'a> {
    /// The line of a key that may stand once.
    pub(super) fn get(&self, key: &str) -> Option<Line<'a>> {
        self.lines.iter().find(|line| line.key == key).copied()
    }
    /// The lines of a key.
    pub(super) fn all(&self, key: &'static str) -> impl Iterator<Item = Line<'a>> {
        self.lines.iter().filter(move |line| line.key == key).copied()
    }
    /// Whether a key was said, rightly or not.
    pub(super) fn said(&self, key: &str) -> bool {
        self.obscure || self.faulty.contains(key) || self.get(key).is_some()
    }
}

impl<'a> Checker<'a> {
    /// Lines held against a table. What is wrong is reported and left out.
    pub(super) fn hold(
        &mut self,
        lines: impl IntoIterator<Item = Line<'a>>,
        rules: &[Rule],
        siblings: &'static [Rule],
        owner: &Owner,
    ) -> Body<'a> {
        let mut body = Body::default();
        let mut first: BTreeMap<&'static str, (Span, &Rule)> = BTreeMap::new();
        let mut told = BTreeSet::new();
        for line in lines {
            let mut rest = Some(line);
            while let Some(mut line) = rest.take() {
                let Some(rule) = rules.iter().find(|rule| rule.key == line.key) else {
                    self.unknown(&line, rules, owner, &mut body);
                    continue;
                };
                (line.clauses, line.leading, line.siblings) = (rule.clauses, rule.leading, siblings);
                (line.spread, line.param) = (rule.braces == Braces::Clauses, owner.noun == "parameter");
                if let Some(i) = line.second_statement(rule, rules)
                    && let Value::Word(key) = &line.items[i].value
                {
                    let span = line.items[i].span;
                    let message = format!("`{}` and `{key}` stand on one line without a comma", line.key);
                    self.report(
                        Diagnostic::error("S03", span, message).label(format!("a comma or a new line before `{key}`?")),
                    );
                    rest = Some(Line { block: line.block.take(), ..Line::piece(key, span, &line.items[i + 1..]) });
                    line.items = &line.items[..i];
                }
                if let Some(next) = self.swallowed(&line, rules) {
                    body.faulty.extend([rule.key, next]);
                    continue;
                }
                if self.refused(&line, rule, &first, &mut told, owner) {
                    body.faulty.insert(rule.key);
                    continue;
                }
                first.entry(rule.key).or_insert((line.span(), rule));
                body.lines.push(line);
            }
        }
        body
    }

    /// A statement of one word that stands where a unit would: `reflectance 0.2 ideal`.
    fn swallowed(&mut self, line: &Line<'a>, rules: &[Rule]) -> Option<&'static str> {
        let unit = match &line.items.last()?.value {
            Value::Number { unit, .. } | Value::Range { unit, .. } => unit.as_ref()?,
            Value::Points { unit, .. } | Value::List { unit, .. } | Value::Runs { unit, .. } => unit.as_ref()?,
            _ => return None,
        };
        let next = rules.iter().find(|rule| rule.key == unit.text && !is_unit(rule.key))?.key;
        let message = format!("`{}` and `{next}` stand on one line without a comma", line.key);
        self.report(
            Diagnostic::error("S03", unit.span, message).label(format!("a comma or a new line before `{next}`?")),
        );
        Some(next)
    }

    /// Reports what is wrong with a line as a whole; true where it is to be left out.
    fn refused(
        &mut self,
        line: &Line<'a>,
        rule: &Rule,
        first: &BTreeMap<&'static str, (Span, &Rule)>,
        told: &mut BTreeSet<&'static str>,
        owner: &Owner,
    ) -> bool {
        let key = rule.key;
        if !rule.many
            && let Some((earlier, _)) = first.get(key)
        {
            let message = format!("`{key}` is said twice in {}", owner.of);
            let fault = Diagnostic::error("S05", line.span(), message).label("said again");
            self.report(fault.note(*earlier, "first said here"));
            return true;
        }
        let against = first.iter().find(|(other, (_, earlier))| {
            rule.excludes.contains(other) || (earlier.excludes.contains(&key) && **other != key)
        });
        if let Some((other, (place, _))) = against {
            if !told.insert(*other) {
                return true;
            }
            let message = format!("`{key}` and `{other}` exclude each other");
            let fault = Diagnostic::error(owner.exclusion, line.span(), message).label("say only one of them");
            self.report(fault.note(*place, format!("`{other}` is said here")));
            return true;
        }
        let sweep = line.items.iter().find(|item| matches!(&item.value, Value::Word(word) if word == "sweep"));
        if let Some(item) = sweep.filter(|_| !self.in_experiment) {
            let fault = Diagnostic::error("X02", item.span, "a sweep stands only in an experiment");
            self.report(fault.label("a constant here, and `define NAME sweep LIST` in an experiment?"));
            return true;
        }
        if let Some(severity) = rule.later {
            self.report(later(severity, line.key_span, key));
            return severity == Severity::Error;
        }
        match (rule.braces, line.block) {
            (Braces::None, Some(block)) => {
                let message = format!("`{key}` takes no block in braces");
                self.report(Diagnostic::error("S02", block.span, message).label(format!("`{}`?", rule.form)));
                true
            }
            (Braces::Required, None) => {
                let message = format!("`{key}` needs a block in braces");
                self.report(Diagnostic::error("S05", line.span(), message).label(format!("`{}`?", rule.form)));
                true
            }
            _ => false,
        }
    }

    fn unknown(&mut self, line: &Line<'a>, rules: &[Rule], owner: &Owner, body: &mut Body<'a>) {
        let (key, noun) = (line.key, owner.noun);
        let near = self.near(key, rules.iter().map(|rule| rule.key));
        let article = if noun.starts_with(['a', 'e', 'i', 'o', 'u']) { "an" } else { "a" };
        let mut fault = if near.is_none()
            && let Some(home) = super::home_of(key)
        {
            let message = format!("`{key}` is not {article} {noun} of {}", owner.of);
            Diagnostic::error("N01", line.key_span, message).label(format!("belongs in {home}"))
        } else {
            Diagnostic::error("N01", line.key_span, format!("`{key}` is no {noun} of {}", owner.of))
        };
        match near {
            Some(near) => {
                fault = fault.label(format!("`{near}`?"));
                body.faulty.extend(rules.iter().map(|rule| rule.key).filter(|key| *key == near));
            }
            None => body.obscure = true,
        }
        let known = list(rules.iter().filter(|rule| rule.later.is_none()).map(|rule| rule.key));
        let help = if known.is_empty() { format!("{} takes no {noun}", owner.of) } else { format!("known: {known}") };
        self.report(fault.help(help));
    }

    /// Reports required lines that are missing.
    pub(super) fn require(&mut self, body: &Body<'a>, rules: &[Rule], owner: &Owner) {
        for rule in rules.iter().filter(|rule| rule.required && !body.said(rule.key)) {
            self.missing("S05", &format!("{} needs `{}`", owner.of, rule.key), rule.form, owner);
        }
    }

    /// Reports that something is missing, unless what the parser refused may be it.
    pub(super) fn missing(&mut self, code: &'static str, message: &str, form: &str, owner: &Owner) {
        if !self.spoilt(owner.extent) {
            self.report(Diagnostic::error(code, owner.span, message).label(format!("`{form}`?")));
        }
    }

    /// Whether the parser refused something within a place.
    pub(super) fn spoilt(&self, place: Span) -> bool {
        self.refused_text.iter().any(|s| s.file == place.file && s.start <= place.end && place.start <= s.end)
    }

    /// A statement taken apart: the items before its first clause, and its clauses from the line and from its braces.
    pub(super) fn clauses(&mut self, line: &Line<'a>) -> (&'a [Item], Body<'a>) {
        let find = |item: &Item| match &item.value {
            Value::Word(word) => line.clauses.iter().find(|clause| clause.key == word),
            _ => None,
        };
        let items = line.items;
        let start = |from: usize| (from..items.len()).find(|&i| find(&items[i]).is_some()).unwrap_or(items.len());
        let first = start(line.leading.min(items.len()));
        let mut lines = Vec::new();
        let mut at = first;
        while at < items.len() {
            let (Some(rule), Value::Word(key)) = (find(&items[at]), &items[at].value) else { break };
            let end = start(at + 1 + usize::from(rule.word)).max(at + 1);
            lines.push(Line { of: line.key, ..Line::piece(key, items[at].span, &items[at + 1..end]) });
            at = end;
        }
        let within = line.block.filter(|_| line.spread);
        lines.extend(within.iter().flat_map(|block| &block.statements).map(Line::of));
        let mut owner = Owner::new(format!("`{}`", line.key), line);
        owner.noun = "word";
        let body = self.hold(lines, line.clauses, line.clauses, &owner);
        self.require(&body, line.clauses, &owner);
        (&items[..first], body)
    }

    /// Reports items beyond the first `n` of `items` that nothing is known to do with.
    pub(super) fn surplus(&mut self, line: &Line<'a>, items: &'a [Item], n: usize) {
        let Some(extra) = items.get(n) else { return };
        let key = line.key;
        let before = if n == 0 { line.key_span } else { items[n - 1].span };
        let shown = self.shown(extra.span);
        let fault = match &extra.value {
            Value::Word(word) if is_unit(word) => {
                Diagnostic::error("U01", extra.span, format!("`{word}` is a unit where none is due"))
                    .label("a value has one unit, right behind it")
            }
            Value::Word(word) => {
                let words = line.clauses.iter().chain(line.siblings).map(|rule| rule.key);
                let near = self.near(word, words).map(|near| format!("`{near}`?")).unwrap_or_default();
                let known = list(line.clauses.iter().chain(line.siblings).map(|rule| rule.key));
                let fault =
                    Diagnostic::error("N01", extra.span, format!("`{word}` is no word of `{}`", line.of)).label(near);
                if known.is_empty() { fault } else { fault.help(format!("known: {known}")) }
            }
            _ if self.sources.line(before) < self.sources.line(extra.span) => {
                Diagnostic::error("S03", extra.span, format!("this line goes on with `{key}` above"))
                    .label("which key was meant to stand before it?")
            }
            _ => Diagnostic::error("S03", extra.span, format!("`{key}` has no use for `{shown}`"))
                .label("one value too many, or its key forgotten"),
        };
        self.report(fault);
    }
}

/// The answer to what the language defines but this version does not mean.
pub(super) fn later(severity: Severity, span: Span, what: &str) -> Diagnostic {
    let message = format!("`{what}` is defined by the language but comes with a later version");
    let fault = Diagnostic::error("L01", span, message);
    match severity {
        Severity::Error => fault.label("not in this version"),
        Severity::Warning => Diagnostic { severity, ..fault }.label("ignored; no picture changes by it"),
    }
}

/// What `like` takes over: the parent's lines, each replaced by the child's that says it again or excludes it.
pub(super) fn inherit<'a>(parent: &Body<'a>, child: &Body<'a>, rules: &[Rule], same: Same) -> Body<'a> {
    let find = |key: &str| rules.iter().find(|rule| rule.key == key);
    let excludes = |a: &str, b: &str| find(a).is_some_and(|rule| rule.excludes.contains(&b));
    let mut taken = vec![false; child.lines.len()];
    let mut lines = Vec::new();
    for old in &parent.lines {
        let many = find(old.key).is_some_and(|rule| rule.many);
        let again = (0..child.lines.len()).find(|&i| {
            let new = &child.lines[i];
            if many || new.key != old.key { same(old, new) } else { new.key != "weather" }
        });
        if let Some(i) = again {
            if !std::mem::replace(&mut taken[i], true) {
                lines.push(child.lines[i]);
            }
        } else if !child.lines.iter().any(|new| excludes(new.key, old.key) || excludes(old.key, new.key)) {
            lines.push(Line { inherited: true, ..*old });
        }
    }
    lines.extend(child.lines.iter().zip(taken).filter(|(_, taken)| !taken).map(|(line, _)| *line));
    let faulty = parent.faulty.union(&child.faulty).copied().collect();
    Body { lines, faulty, obscure: parent.obscure || child.obscure }
}

/// Whether a line of the child says again a repeatable line of the parent.
pub(super) type Same = fn(&Line, &Line) -> bool;
