//! Blocks of models, held against what each declares.

use std::collections::BTreeMap;

use sunglint_plugin::{Args, Default, Kind, ModelInfo, Param, Role, Value as Arg};

use super::Checker;
use super::block::{Braces, Line, Owner, Rule, later, rule};
use super::spectrum::SPECTRUM;
use super::value::Quantity;
use crate::ast::{Block, Value};
use crate::nearest::list;
use crate::scene::ModelUse;
use crate::{Diagnostic, Severity, Span};

/// Models that the language defines and a later version brings.
pub(super) const LATER: &[(Role, &str)] = &[(Role::Algorithm, "radiosity")];

/// Approximations that algorithms may declare, each by one name.
const APPROXIMATIONS: &[&str] = &[
    "reading",
    "sky",
    "sky_view",
    "background",
    "background_sky",
    "background_angle",
    "glint",
    "sun",
    "depth",
    "spectral",
    "adjacency",
    "caustics",
];

/// The most that a count without a range of its own may be.
const LARGEST: f64 = 9e15;

impl<'a> Checker<'a> {
    /// Whether a model of a role is due in a later version.
    pub(super) fn comes_later(&self, role: Role, name: &str) -> bool {
        self.catalog.find(role, name).is_none() && LATER.contains(&(role, name_of(role, name)))
    }

    /// The model that a name stands for; unknown ones are reported.
    pub(super) fn model(&mut self, role: Role, name: &str, span: Span) -> Option<ModelInfo> {
        if let Some(info) = self.catalog.find(role, name) {
            return Some(*info);
        }
        if self.comes_later(role, name) {
            let have = list(self.catalog.of(role).map(|info| info.name));
            self.report(later(Severity::Error, span, name).help(format!("this version has {have}")));
            return None;
        }
        let known: Vec<&str> = self.catalog.of(role).map(|info| info.name).collect();
        let coming = LATER.iter().filter(|(of, _)| *of == role).map(|(_, name)| *name);
        let near = self.near(name, known.iter().copied().chain(coming));
        let mut fault = Diagnostic::error("N01", span, format!("`{name}` is no {}", role.noun()));
        if let Some(near) = near {
            fault = fault.label(format!("`{near}`?"));
        } else if let Some(other) = self.catalog.role_of(name) {
            let article = if other.noun().starts_with('a') { "an" } else { "a" };
            fault = fault.label(format!("it is {article} {}", other.noun()));
        }
        self.report(fault.help(format!("known: {}", list(known))));
        None
    }

    /// A model named by the first item of a line, with its block.
    pub(super) fn named_model(&mut self, line: &Line<'a>, role: Role) -> Option<ModelUse> {
        let Some(item) = line.items.first() else {
            self.absent(line, &format!("the name of an {}", role.noun()));
            return None;
        };
        let words: Vec<&str> = self.catalog.of(role).map(|info| info.name).collect();
        let given = self.resolve(item, &words);
        let Value::Word(name) = given.value else {
            self.wrong(line, &given, &format!("the name of an {}", role.noun()));
            return None;
        };
        let info = self.model(role, name, given.span)?;
        self.surplus(line, line.items, 1);
        Some(self.model_use(role, &info, given.span, None, line.block, None))
    }

    /// A model that the language takes where a scene names none.
    pub(super) fn default_model(&self, role: Role, name: &str) -> ModelUse {
        let args = self.catalog.find(role, name).map(|info| Args::new(info, [])).unwrap_or_default();
        ModelUse { name: name.to_string(), label: None, args, span: None, param_spans: BTreeMap::new() }
    }

    /// A block held against what its model declares. Faults are reported; the arguments are what could be read.
    pub(super) fn model_use(
        &mut self,
        role: Role,
        info: &ModelInfo,
        span: Span,
        label: Option<String>,
        block: Option<&'a Block>,
        labels: Option<&[String]>,
    ) -> ModelUse {
        let extent = block.map_or(span, |block| super::block::join(span, block.span));
        let owner = Owner { of: format!("`{}`", info.name), noun: "parameter", exclusion: "S05", span, extent };
        let rules: Vec<Rule> = info.params.iter().map(rule_of).collect();
        let mut lines = Vec::new();
        let mut lacking = false;
        for line in block.iter().flat_map(|block| &block.statements).map(Line::of) {
            if role == Role::Algorithm && info.param(line.key).is_none() && self.is_approximation(line.key) {
                self.undeclared(&line, info);
                lacking = true;
            } else {
                lines.push(line);
            }
        }
        let body = self.hold(lines, &rules, &[], &owner);
        if !lacking {
            self.require(&body, &rules, &owner);
        }
        let mut given = BTreeMap::new();
        let mut param_spans = BTreeMap::new();
        for line in &body.lines {
            let Some(param) = info.param(line.key) else { continue };
            if let Some(value) = self.argument(line, param, labels) {
                given.insert(param.name.to_string(), value);
                param_spans.insert(param.name.to_string(), line.value_span());
            }
        }
        let args = Args::new(info, given);
        ModelUse { name: info.name.to_string(), label, args, span: Some(span), param_spans }
    }

    fn is_approximation(&self, key: &str) -> bool {
        APPROXIMATIONS.contains(&key) || self.catalog.of(Role::Algorithm).any(|info| info.param(key).is_some())
    }

    fn undeclared(&mut self, line: &Line<'a>, info: &ModelInfo) {
        let message = format!("`{}` does not have the approximation `{}`", info.name, line.key);
        let fault = Diagnostic::error("X03", line.key_span, message);
        let have = list(self.catalog.of(Role::Algorithm).filter(|i| i.param(line.key).is_some()).map(|i| i.name));
        let fault = if have.is_empty() {
            fault.label("no algorithm of this version has it")
        } else {
            fault.label(format!("an approximation of {have}"))
        };
        let own = list(info.params.iter().map(|param| param.name));
        let help =
            if own.is_empty() { format!("`{}` has none", info.name) } else { format!("`{}` has {own}", info.name) };
        self.report(fault.help(help));
    }

    fn argument(&mut self, line: &Line<'a>, param: &Param, labels: Option<&[String]>) -> Option<Arg> {
        let (low, high) = param.range;
        Some(match param.kind {
            Kind::Quantity(of) => Arg::Number(self.quantity(line, &Quantity::new(of).within(low, high))?),
            Kind::Spectrum(of) => Arg::Spectrum(self.spectrum(line, &Quantity::new(of).within(low, high))?),
            Kind::Table(columns) => Arg::Table(self.table(line, columns)?),
            Kind::Word(words) => Arg::Word(self.word_of(line, words)?.to_string()),
            Kind::Switch => Arg::Switch(self.word_of(line, &["on", "off"])? == "on"),
            Kind::Count(words) => self.count_or_word(line, words, (low, high))?,
            Kind::File => Arg::File(self.file_arg(line)?),
            Kind::Weights => Arg::Weights(self.weights(line, labels)?),
        })
    }

    fn count_or_word(&mut self, line: &Line<'a>, words: &[&'static str], (low, high): (f64, f64)) -> Option<Arg> {
        if let Some(item) = line.items.first()
            && !words.is_empty()
            && matches!(self.resolve(item, words).value, Value::Word(_))
        {
            return self.word_of(line, words).map(|word| Arg::Word(word.to_string()));
        }
        let high = if high < LARGEST { high.max(0.0) as u64 } else { u64::MAX };
        self.count(line, low.max(0.0) as u64, high).map(Arg::Count)
    }

    fn weights(&mut self, line: &Line<'a>, labels: Option<&[String]>) -> Option<Vec<(String, f64)>> {
        let Some(item) = line.items.first() else {
            self.absent(line, "a list of labels and weights");
            return None;
        };
        let given = self.resolve(item, &[]);
        let Value::List { rows, unit } = given.value else {
            self.wrong(line, &given, "a list of labels and weights");
            return None;
        };
        let mut out: Vec<(String, f64)> = Vec::new();
        for row in rows.iter().filter(|row| !row.is_empty()) {
            let (Value::Word(label), [_, number]) = (&row[0].value, row.as_slice()) else {
                let message = "a row of weights holds a label and a number";
                self.report(Diagnostic::error("U04", row[0].span, message).label("LABEL number"));
                return None;
            };
            let known = labels.unwrap_or_default();
            if !known.contains(label) {
                let near = self.near(label, known.iter().map(String::as_str));
                let fault = Diagnostic::error("M03", row[0].span, format!("the material has no model `{label}`"));
                let fault = fault.label(near.map(|near| format!("`{near}`?")).unwrap_or_default());
                self.report(fault.help(format!("it has {}", list(known.iter().map(String::as_str)))));
                return None;
            }
            if out.iter().any(|(other, _)| other == label) {
                self.report(Diagnostic::error("M03", row[0].span, format!("`{label}` has two weights")));
                return None;
            }
            let number = self.resolve(number, &[]);
            out.push((label.clone(), self.measure(line, &number, unit.as_ref(), &super::value::SHARE)?));
        }
        self.surplus(line, line.items, 1);
        let sum: f64 = out.iter().map(|(_, weight)| weight).sum();
        if sum > 1.0 + 1e-9 {
            let message = format!("the weights sum to {}", super::value::written(sum));
            let fault = self.misfit(&given, "M03", message).label("at most 1");
            self.report(fault);
            return None;
        }
        Some(out)
    }
}

fn name_of(role: Role, name: &str) -> &'static str {
    LATER.iter().find(|(of, known)| *of == role && *known == name).map_or("", |(_, known)| known)
}

fn rule_of(param: &Param) -> Rule {
    let rule = rule(param.name, param.help).excludes(param.excludes).braces(Braces::None);
    let rule = if param.default == Default::Required { rule.required() } else { rule };
    if matches!(param.kind, Kind::Spectrum(_)) { rule.clauses(SPECTRUM) } else { rule }
}
