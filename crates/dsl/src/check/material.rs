//! Materials.

use std::collections::BTreeMap;

use sunglint_plugin::{Args, Component, ModelInfo, Role, Value as Arg};
use sunglint_radiometry::Dimension;

use super::block::{Body, Braces, Line, Owner, Rule, rule};
use super::names::Kind;
use super::spectrum::SPECTRUM;
use super::value::{Quantity, SHARE};
use super::{Checker, Entity};
use crate::ast::{Item, Statement, Value};
use crate::nearest::list;
use crate::scene::{Material, ModelUse};
use crate::{Diagnostic, Span};

pub(super) const MATERIAL: &[Rule] = &[
    rule("title", "title STRING"),
    rule("source", "source STRING"),
    rule("licence", "licence STRING"),
    rule("reflectance", "reflectance SPECTRUM").clauses(SPECTRUM),
    rule("emission", "emission SPECTRUM").clauses(SPECTRUM),
];

/// Clauses of `material NAME`.
pub(super) const MATERIAL_HEAD: &[Rule] = &[rule("code", "code COUNT"), rule("like", "like MATERIAL").word()];

/// The name by which experiments pick a model: its label, or its own.
pub(super) fn identity<'l>(line: &Line<'l>) -> &'l str {
    match line.items {
        [Item { value: Value::Word(label), .. }, ..] => label,
        _ => line.key,
    }
}

/// What an experiment can pick from a material, in order.
pub(super) struct Identities {
    pub names: Vec<String>,
    /// Whether these are all: nothing in the material that may be a model was refused.
    pub whole: bool,
}

impl<'a> Checker<'a> {
    /// The statements of a material's block: its own, and a statement for each model.
    pub(super) fn material_rules(&self) -> Vec<Rule> {
        let model = |name| rule(name, "MODEL LABEL { … }").many().leading(1).braces(Braces::Optional);
        let known = self.catalog.of(Role::Reflectance).map(|info| model(info.name));
        MATERIAL.iter().copied().chain(known).collect()
    }

    /// Codes in truth maps: given, or from 1000 up.
    pub(super) fn codes(&mut self, materials: &[Entity<'a>]) -> Vec<u16> {
        let mut taken: BTreeMap<u16, (Span, &str)> = BTreeMap::new();
        let mut codes: Vec<Option<u16>> = Vec::with_capacity(materials.len());
        for material in materials {
            let line = material.head.get("code");
            let code = line.and_then(|line| self.count(&line, 1, 65_535)).map(|code| code as u16);
            if let (Some(code), Some(line)) = (code, line) {
                if let Some((first, other)) = taken.get(&code) {
                    let message = format!("`{}` and `{other}` have one code, {code}", material.shown());
                    let fault = Diagnostic::error("M01", line.span(), message).label("another code, or none");
                    let first = *first;
                    self.report(fault.note(first, "first given here"));
                } else {
                    taken.insert(code, (line.span(), material.shown()));
                }
            }
            codes.push(code);
        }
        let mut next = 1000u32;
        let mut full = false;
        let out = (codes.iter())
            .map(|code| {
                code.unwrap_or_else(|| {
                    while u16::try_from(next).is_ok_and(|next| taken.contains_key(&next)) {
                        next += 1;
                    }
                    full |= next > 65_535;
                    next += 1;
                    u16::try_from(next - 1).unwrap_or(u16::MAX)
                })
            })
            .collect();
        if full && let Some(last) = materials.last() {
            let message = "there are more materials than codes from 1000 to 65535";
            self.report(
                Diagnostic::error("M01", last.line.span(), message).label("fewer materials, or codes below 1000"),
            );
        }
        out
    }

    /// The statement of the database that `material NAME` alone stands for; reported where there is none.
    pub(super) fn taken(&mut self, name: &str, span: Span) -> Option<&'a Statement> {
        if self.in_database(name) {
            return self.take_from_database(name, span);
        }
        if !self.excused(name) {
            let own = self.names.of(Kind::Material).filter(|other| *other != name);
            let known: Vec<String> = own.chain(self.database_names()).map(str::to_string).collect();
            let near = self.near(name, known.iter().map(String::as_str));
            let label = near.map_or("`{ ideal { diffuse 0.1 } }`?".to_string(), |near| format!("`{near}`?"));
            let message = format!("no database has a material `{name}`, and the scene says nothing of it");
            let fault = Diagnostic::error("N02", span, message).label(label);
            let have = list(self.database_names());
            self.report(if have.is_empty() { fault } else { fault.help(format!("databases have {have}")) });
        }
        None
    }

    /// Puts in place of labels what they stand for.
    fn mix(&mut self, models: &mut [ModelUse]) {
        let labels: Vec<String> =
            models.iter().map(|model| model.label.clone().unwrap_or_else(|| model.name.clone())).collect();
        let weights = |model: &ModelUse| {
            model.args.iter().find_map(|(param, value)| match value {
                Arg::Weights(weights) => Some((param.to_string(), weights.clone())),
                _ => None,
            })
        };
        // A mixture whose parts are all resolved is one itself; what is left over goes round in a circle.
        while let Some((i, param, parts)) = models.iter().enumerate().find_map(|(i, model)| {
            let (param, parts) = weights(model)?;
            let places: Option<Vec<(usize, f64)>> = (parts.iter())
                .map(|(label, weight)| Some((labels.iter().position(|known| known == label)?, *weight)))
                .collect();
            let places = places?;
            places.iter().all(|(place, _)| weights(&models[*place]).is_none()).then_some((i, param, places))
        }) {
            let component = |(place, weight): &(usize, f64)| Component {
                weight: *weight,
                model: models[*place].name.clone(),
                args: models[*place].args.clone(),
            };
            let components = parts.iter().map(component).collect();
            models[i].args.set(&param, Arg::Mixture(components));
        }
        for model in models.iter() {
            if let (Some((param, _)), Some(span)) = (weights(model), model.span) {
                let place = model.param_spans.get(&param).copied().unwrap_or(span);
                let fault = Diagnostic::error("M03", place, "this mixture is part of itself");
                self.report(fault.label("weights of other models?"));
            }
        }
    }

    /// A material; its files are opened only where it is used.
    pub(super) fn material(
        &mut self,
        entity: &Entity<'a>,
        body: &Body<'a>,
        code: u16,
        used: bool,
    ) -> (Material, Identities) {
        self.opening = used;
        let owner = Owner::new("a material", &entity.line);
        let title = body.get("title").and_then(|line| self.text(&line)).map(|(text, _)| text.to_string());
        let mut said = |key| Some(self.text(&body.get(key)?)?.0.to_string());
        let (source, licence) = (said("source"), said("licence"));
        let mut spans = BTreeMap::new();
        let radiance = Quantity::new(Dimension::Radiance).within(0.0, 1e12);
        let mut spectrum = |checker: &mut Self, key: &'static str, q: &Quantity| {
            let line = body.get(key)?;
            spans.insert(key, line.span());
            checker.spectrum(&line, q)
        };
        let reflectance = spectrum(self, "reflectance", &SHARE.code("M05"));
        let emission = spectrum(self, "emission", &radiance);

        let mut identities: Vec<String> = Vec::new();
        let mut places: BTreeMap<&str, Span> = BTreeMap::new();
        let mut lines = Vec::new();
        for line in body.lines.iter().filter(|line| self.catalog.find(Role::Reflectance, line.key).is_some()) {
            let name = identity(line);
            if !line.items.is_empty() && name == line.key && !matches!(line.items[0].value, Value::Word(_)) {
                self.surplus(line, line.items, 0);
                continue;
            }
            self.surplus(line, line.items, 1);
            if let Some(first) = places.get(name).copied() {
                let message = format!("`{name}` stands twice in this material");
                let fault =
                    Diagnostic::error("M03", line.span(), message).label("give it a label: `MODEL LABEL { … }`");
                self.report(fault.note(first, "first here"));
                continue;
            }
            identities.push(name.to_string());
            places.insert(name, line.span());
            lines.push(*line);
        }
        let mut models: Vec<ModelUse> = Vec::new();
        for (line, name) in lines.iter().zip(&identities) {
            let Some(info) = self.catalog.find(Role::Reflectance, line.key) else { continue };
            let label = (!line.items.is_empty()).then(|| name.clone());
            let info = *info;
            let mut model =
                self.model_use(Role::Reflectance, &info, line.key_span, label, line.block, Some(&identities));
            if let Some(total) = &reflectance
                && !model.param_spans.contains_key("reflectance")
            {
                model.args.set("reflectance", Arg::Spectrum(total.clone()));
                if let Some(stated) = body.get("reflectance") {
                    model.param_spans.insert("reflectance".to_string(), stated.value_span());
                    // Another material's model beside a reflectance of its own.
                    if line.inherited && !stated.inherited {
                        model.args.set("scaled", Arg::Switch(true));
                    }
                }
            }
            models.push(model);
        }
        self.mix(&mut models);
        // A model that asks for nothing but the total reflectance is every material's that has one.
        if let Some(total) = &reflectance
            && !identities.is_empty()
        {
            let unsaid = |info: &&ModelInfo| !identities.iter().any(|known| known == info.name);
            let asks_nothing = |info: &&ModelInfo| info.params.is_empty();
            let implied: Vec<ModelInfo> =
                self.catalog.of(Role::Reflectance).filter(asks_nothing).filter(unsaid).copied().collect();
            for info in &implied {
                let mut args = Args::new(info, []);
                args.set("reflectance", Arg::Spectrum(total.clone()));
                let (name, param_spans) = (info.name.to_string(), BTreeMap::new());
                models.push(ModelUse { name: name.clone(), label: None, args, span: None, param_spans });
                identities.push(name);
            }
        }
        let is_model = |key: &str| !MATERIAL.iter().any(|rule| rule.key == key);
        let whole = !body.obscure && !body.faulty.iter().any(|key| is_model(key)) && !self.spoilt(owner.extent);
        if used && identities.is_empty() && whole {
            let have = list(self.catalog.of(Role::Reflectance).map(|info| info.name));
            let message = format!("the material `{}` is used but has no model", entity.shown());
            let cure = if reflectance.is_some() { "ideal" } else { "ideal { diffuse 0.1 }" };
            let fault = Diagnostic::error("S05", entity.name_span, message).label(format!("`{cure}`?"));
            self.report(fault.help(format!("models: {have}")));
        }
        if !used {
            models.clear();
        }
        self.opening = true;
        let name = entity.shown().to_string();
        let span = entity.line.span();
        (
            Material { name, code, title, source, licence, reflectance, emission, models, used, span, spans },
            Identities { names: identities, whole },
        )
    }
}
