//! Names: one space for each kind of thing.

use std::collections::{BTreeMap, BTreeSet};

use super::Checker;
use super::block::{Line, is_connective};
use crate::ast::{Item, Value};
use crate::parse::spelling::is_unit;
use crate::{Diagnostic, Span};

/// What a name is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Kind {
    Constant,
    Material,
    Object,
    Placement,
    Sensor,
    Collect,
    Weather,
    Experiment,
}

impl Kind {
    /// The kinds that statements refer to by name.
    pub(super) const NAMED: &[Self] =
        &[Self::Material, Self::Object, Self::Sensor, Self::Collect, Self::Weather, Self::Experiment];

    pub(super) fn noun(self) -> &'static str {
        match self {
            Self::Constant => "constant",
            Self::Material => "material",
            Self::Object => "object",
            Self::Placement => "placement",
            Self::Sensor => "sensor",
            Self::Collect => "collection set",
            Self::Weather => "weather",
            Self::Experiment => "experiment",
        }
    }
    pub(super) fn a_noun(self) -> String {
        let article = if matches!(self, Self::Object | Self::Experiment) { "an" } else { "a" };
        format!("{article} {}", self.noun())
    }
}

/// All names of a scene.
#[derive(Clone, Debug, Default)]
pub(super) struct Names<'a> {
    known: BTreeMap<Kind, BTreeMap<&'a str, (usize, Span)>>,
}

impl<'a> Names<'a> {
    pub(super) fn find(&self, kind: Kind, name: &str) -> Option<(usize, Span)> {
        self.known.get(&kind)?.get(name).copied()
    }
    /// Forgets the names of a kind.
    pub(super) fn forget(&mut self, kind: Kind) {
        self.known.remove(&kind);
    }
    /// The name that was declared with an index.
    pub(super) fn name_of(&self, kind: Kind, index: usize) -> Option<&'a str> {
        self.known.get(&kind)?.iter().find(|(_, (known, _))| *known == index).map(|(name, _)| *name)
    }
    pub(super) fn of(&self, kind: Kind) -> impl Iterator<Item = &'a str> {
        self.known.get(&kind).into_iter().flat_map(|names| names.keys().copied())
    }
}

impl<'a> Checker<'a> {
    /// Takes a name into its space.
    pub(super) fn declare(&mut self, kind: Kind, name: &'a str, span: Span, index: usize) {
        if is_unit(name) || is_connective(name) {
            let what = if is_unit(name) { "a unit" } else { "a word of the language" };
            let message = format!("`{name}` is {what} and no name for {}", kind.a_noun());
            self.report(Diagnostic::error("N03", span, message).label(format!("`{name}_1`?")));
        }
        if let Some((_, first)) = self.names.find(kind, name) {
            let message = format!("the {} `{name}` is declared twice", kind.noun());
            self.report(Diagnostic::error("N03", span, message).label("declared again").note(first, "first here"));
            return;
        }
        self.names.known.entry(kind).or_default().insert(name, (index, span));
    }

    /// What a name stands for; unknown ones are reported.
    pub(super) fn look_up(&mut self, kind: Kind, name: &str, span: Span) -> Option<usize> {
        if let Some((index, _)) = self.names.find(kind, name) {
            return Some(index);
        }
        if !self.excused(name) {
            let fault = Diagnostic::error("N02", span, format!("there is no {} `{name}`", kind.noun()));
            if kind == Kind::Material && self.in_database(name) {
                self.report(fault.label(format!("`material {name}` alone takes it from the database")));
                return None;
            }
            let elsewhere = Kind::NAMED.iter().find_map(|other| Some((*other, self.names.find(*other, name)?.1)));
            let shelved: Vec<String> = match elsewhere {
                None if kind == Kind::Material => self.database_names().map(str::to_string).collect(),
                _ => Vec::new(),
            };
            let near = self.near(name, self.names.of(kind).chain(shelved.iter().map(String::as_str)));
            let fault = match (near, elsewhere) {
                (Some(near), _) => fault.label(format!("`{near}`?")),
                (None, Some((other, place))) => {
                    let what = other.a_noun();
                    fault.label(format!("`{name}` is {what}")).note(place, format!("{what} of that name"))
                }
                (None, None) => {
                    let known = crate::nearest::list(self.names.of(kind));
                    let help = if known.is_empty() {
                        format!("the scene has no {} with a name", kind.noun())
                    } else {
                        format!("known: {known}")
                    };
                    fault.help(help)
                }
            };
            self.report(fault);
        }
        None
    }

    /// Whether a name is unknown only because what declares it could not be read.
    pub(super) fn excused(&self, name: &str) -> bool {
        let mentions = |text: &str| text.split(|c: char| !c.is_alphanumeric() && c != '_').any(|word| word == name);
        self.n_errors >= super::MOST_ERRORS
            || self.poisoned.contains(name)
            || self.refused_text.iter().any(|span| {
                let text = &self.sources.get(span.file).text;
                let (start, end) = (span.start as usize, span.end as usize);
                let from = text.get(..start).and_then(|before| before.rfind('\n')).map_or(0, |i| i + 1);
                let to = text.get(end..).and_then(|after| after.find('\n')).map_or(text.len(), |i| end + i);
                text.get(from..to).is_some_and(mentions)
            })
    }

    /// An item as a name of a kind; constants may stand for it.
    pub(super) fn reference(&mut self, line: &Line<'a>, item: &'a Item, kind: Kind) -> Option<usize> {
        let known = matches!(&item.value, Value::Word(word) if self.names.find(kind, word).is_some());
        let given = if known {
            super::value::Given { value: &item.value, span: item.span, home: item.span, constant: None }
        } else {
            self.resolve(item, &[])
        };
        let Value::Word(word) = given.value else {
            self.wrong(line, &given, &format!("the name of {}", kind.a_noun()));
            return None;
        };
        self.look_up(kind, word, given.span)
    }

    /// A name or a list of names of a kind, each once, in order.
    pub(super) fn references(&mut self, line: &Line<'a>, items: &'a [Item], kind: Kind) -> Option<Vec<usize>> {
        let Some(item) = items.first() else {
            self.absent(line, &format!("the name of {}", kind.a_noun()));
            return None;
        };
        let members = self.members(line, item)?;
        if members.is_empty() {
            let message = format!("`{}` selects nothing", line.key);
            self.report(Diagnostic::error("X01", item.span, message).label("leave it out to select all"));
            return None;
        }
        let mut out = Vec::new();
        let mut taken = BTreeSet::new();
        let mut good = true;
        for member in members {
            match self.reference(line, member, kind) {
                Some(index) if taken.insert(index) => out.push(index),
                Some(_) => {}
                None => good = false,
            }
        }
        self.surplus(line, items, 1);
        good.then_some(out)
    }
}
