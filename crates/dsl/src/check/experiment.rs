//! Experiments: what is run on a scene.

use std::collections::{BTreeMap, BTreeSet};

use sunglint_plugin::Role;
use sunglint_radiometry::Dimension;

use super::block::{Body, Braces, Line, Owner, Rule, rule};
use super::material::Identities;
use super::names::Kind;
use super::sweep::{Redefinition, Run};
use super::value::Quantity;
use super::{Checker, Entity};
use crate::ast::{Item, Value};
use crate::nearest::list;
use crate::scene::{Accuracy, Experiment, Material, ModelUse, Products, Sensor, Snapshot, Weather};
use crate::{Diagnostic, Scene, Span};

/// The statements of an experiment's block.
pub(super) const EXPERIMENT: &[Rule] = &[
    rule("algorithm", "algorithm split").leading(1).braces(Braces::Optional),
    rule("atmosphere", "atmosphere MODEL").leading(1).braces(Braces::Optional),
    rule("weather", "weather { … }").braces(Braces::Required),
    rule("define", "define NAME VALUE").many().leading(2),
    rule("reflectance", "reflectance split else ideal for NAMES")
        .many()
        .leading(1)
        .clauses(&[rule("else", "else MODEL").many().word(), rule("for", "for MATERIALS").word()]),
    rule("sensor", "sensor NAMES"),
    rule("collect", "collect NAMES"),
    rule("error", "error 1 %")
        .excludes(&["samples", "time"])
        .clauses(&[rule("floor", "floor RADIANCE"), rule("over", "over image")]),
    rule("samples", "samples COUNT").excludes(&["error", "time"]),
    rule("time", "time 60 s").excludes(&["error", "samples"]),
    rule("seed", "seed COUNT"),
    rule("products", "products NAMES"),
];

/// The statements of `snapshot`.
pub(super) const SNAPSHOT: &[Rule] =
    &[rule("pixels", "pixels 64 x 48"), rule("tolerance", "tolerance 0.1 %"), rule("experiment", "experiment NAMES")];
/// The most pixels along a side of a snapshot: it is rendered at every test.
const MOST_SNAPSHOT: u64 = 4096;

const PRODUCTS: &[&str] = &["radiance", "truth", "preview", "surface_radiance", "counts", "reflectance_factor"];
/// What an experiment asks where it says nothing.
const ACCURACY: Accuracy = Accuracy::Error { relative: 0.01, floor: None, every_pixel: true };
const SEED: u64 = 1;
const WRITTEN: Products = Products { radiance: true, truth: true, preview: true, ..Products::NOTHING };
const MOST_SAMPLES: u64 = 1 << 24;
/// Longest time of rendering a run \[s\]: 30 days.
const LONGEST: f64 = 30.0 * 86_400.0;

/// Whether a repeatable line of a child says again one of its parent: a `reflectance` for the same materials, or both for
/// all; a `define` of the same constant.
pub(super) fn same_selection(old: &Line, new: &Line) -> bool {
    if old.key == "define" && new.key == "define" {
        return old.items.first().map(words) == new.items.first().map(words);
    }
    let materials = |line: &Line| -> Vec<String> {
        let named = line.items.iter().skip_while(|item| !matches!(&item.value, Value::Word(word) if word == "for"));
        named.skip(1).map(|item| format!("{:?}", words(item))).collect()
    };
    old.key == "reflectance" && new.key == "reflectance" && materials(old) == materials(new)
}

fn words(item: &Item) -> Vec<&str> {
    match &item.value {
        Value::Word(word) => vec![word.as_str()],
        Value::List { rows, .. } => rows.iter().flatten().flat_map(words).collect(),
        _ => Vec::new(),
    }
}

/// What experiments choose from.
pub(super) struct Choice<'s> {
    pub materials: &'s [Material],
    pub identities: &'s [Identities],
    pub sensors: &'s [Sensor],
    pub n_collects: usize,
    pub atmosphere: &'s ModelUse,
    /// Whether all of these could be read.
    pub whole: bool,
}

impl<'s> Choice<'s> {
    pub(super) fn of(scene: &'s Scene, identities: &'s [Identities], whole: bool) -> Self {
        let Scene { materials, sensors, collects, atmosphere, .. } = scene;
        Self { materials, identities, sensors, n_collects: collects.len(), atmosphere, whole }
    }
}

/// A line `reflectance split else ideal`, read.
struct Chain {
    models: Vec<String>,
    span: Span,
}

impl<'a> Checker<'a> {
    /// The experiment of a scene that has none.
    pub(super) fn default_experiment(&mut self, choice: &Choice) -> Experiment {
        Experiment {
            name: "default".to_string(),
            base: "default".to_string(),
            sweep: Vec::new(),
            constants: Vec::new(),
            order: 0,
            algorithm: self.default_model(Role::Algorithm, "split"),
            atmosphere: choice.atmosphere.clone(),
            weather: None,
            models: self.selection(&Body::default(), choice),
            sensors: (0..choice.sensors.len()).collect(),
            collects: (0..choice.n_collects).collect(),
            accuracy: ACCURACY,
            seed: SEED,
            products: WRITTEN,
            span: None,
        }
    }

    pub(super) fn experiment(&mut self, entity: &Entity<'a>, run: &Run<'a>, choice: &Choice) -> Experiment {
        let body = &run.body;
        let algorithm = body.get("algorithm").and_then(|line| self.named_model(&line, Role::Algorithm));
        let atmosphere = body.get("atmosphere").and_then(|line| self.named_model(&line, Role::Atmosphere));
        let mut weather: Option<Weather> = None;
        for line in body.all("weather") {
            self.surplus(&line, line.items, 0);
            let said = self.weather(&line, None);
            weather = Some(weather.map_or_else(|| said.clone(), |before| before.overridden(&said)));
        }
        let chosen = |checker: &mut Self, key: &'static str, kind: Kind, n: usize| match body.get(key) {
            Some(line) => checker.references(&line, line.items, kind),
            None => Some((0..n).collect()),
        };
        let sensors = chosen(self, "sensor", Kind::Sensor, choice.sensors.len());
        let collects = chosen(self, "collect", Kind::Collect, choice.n_collects);
        if let (Some(sensors), Some(collects)) = (&sensors, &collects)
            && choice.whole
        {
            let chosen: BTreeSet<usize> = collects.iter().copied().collect();
            let seen = |sensor: &usize| choice.sensors[*sensor].collects.iter().any(|c| chosen.contains(c));
            if !sensors.is_empty() && !collects.is_empty() && !sensors.iter().any(seen) {
                let message = format!("the experiment `{}` leaves nothing to do", entity.shown());
                let span = body.get("collect").or(body.get("sensor")).map_or(entity.line.span(), |line| line.span());
                let fault =
                    Diagnostic::error("X01", span, message).label("no sensor takes part in these collection sets");
                self.report(fault);
            }
        }
        let accuracy = self.accuracy(body).unwrap_or(ACCURACY);
        let seed = body.get("seed").and_then(|line| self.count(&line, 0, u64::MAX)).unwrap_or(SEED);
        let products = body.get("products").and_then(|line| self.products(&line));
        let models = self.selection(body, choice);
        let shown =
            |checker: &Self, constant: &Redefinition<'a>| (constant.name.to_string(), checker.spelt(constant.value));
        Experiment {
            name: run.name.clone(),
            base: entity.shown().to_string(),
            sweep: run.sweep.clone(),
            constants: run.constants.iter().map(|constant| shown(self, constant)).collect(),
            order: run.order,
            algorithm: algorithm.unwrap_or_else(|| self.default_model(Role::Algorithm, "split")),
            atmosphere: atmosphere.unwrap_or_else(|| choice.atmosphere.clone()),
            weather,
            models,
            sensors: sensors.unwrap_or_default(),
            collects: collects.unwrap_or_default(),
            accuracy,
            seed,
            products: products.unwrap_or(WRITTEN),
            span: Some(entity.line.span()),
        }
    }

    /// What `test` renders.
    pub(super) fn snapshot(&mut self, top: &Body<'a>) -> Snapshot {
        let mut snapshot = Snapshot::default();
        let Some(line) = top.get("snapshot") else { return snapshot };
        self.surplus(&line, line.items, 0);
        let owner = Owner::new("`snapshot`", &line);
        let statements = line.block.iter().flat_map(|block| &block.statements).map(Line::of);
        let body = self.hold(statements, SNAPSHOT, SNAPSHOT, &owner);
        snapshot.span = Some(line.span());
        if let Some((m, n)) = body.get("pixels").and_then(|line| self.grid(&line, MOST_SNAPSHOT)) {
            snapshot.pixels = (m as u32, n as u32);
        }
        let share = Quantity { percent: true, ..Quantity::new(Dimension::Fraction).within(0.0, 1.0).usual("%") };
        if let Some(tolerance) = self.optional(body.get("tolerance"), &share) {
            snapshot.tolerance = tolerance;
        }
        if let Some(line) = body.get("experiment") {
            let chosen = self.references(&line, line.items, Kind::Experiment).unwrap_or_default();
            let name = |index| self.names.name_of(Kind::Experiment, index);
            snapshot.experiments = chosen.into_iter().filter_map(name).map(str::to_string).collect();
        }
        snapshot
    }

    fn accuracy(&mut self, body: &Body<'a>) -> Option<Accuracy> {
        if let Some(line) = body.get("samples") {
            return self.count(&line, 1, MOST_SAMPLES).map(|samples| Accuracy::Samples(samples as u32));
        }
        if let Some(line) = body.get("time") {
            let budget = Quantity::new(Dimension::Time).positive(LONGEST).usual("s");
            return self.quantity(&line, &budget).map(|seconds| Accuracy::Time { seconds });
        }
        let line = body.get("error")?;
        let (items, clauses) = self.clauses(&line);
        let share = Quantity { percent: true, ..Quantity::new(Dimension::Fraction).positive(1.0).usual("%") };
        let radiance = Quantity::new(Dimension::Radiance).positive(1e12);
        let floor = clauses.get("floor").map(|line| self.quantity(&line, &radiance));
        let over = clauses.get("over").map(|line| self.word_of(&line, &["image"]));
        let relative = self.quantity_at(&line, items, &share)?;
        let floor = floor.map_or(Some(None), |floor| floor.map(Some))?;
        let every_pixel = over.map_or(Some(true), |image| image.map(|_| false))?;
        Some(Accuracy::Error { relative, floor, every_pixel })
    }

    fn products(&mut self, line: &Line<'a>) -> Option<Products> {
        let Some(item) = line.items.first() else {
            self.absent(line, "names of products");
            return None;
        };
        let mut products = Products::NOTHING;
        let mut good = true;
        let mut any = false;
        for member in self.members(line, item)? {
            let given = self.resolve(member, PRODUCTS);
            let Value::Word(word) = given.value else {
                self.wrong(line, &given, "the name of a product");
                return None;
            };
            match word.as_str() {
                "radiance" => products.radiance = true,
                "truth" => products.truth = true,
                "preview" => products.preview = true,
                "surface_radiance" => products.surface_radiance = true,
                "counts" => products.counts = true,
                "reflectance_factor" => products.reflectance_factor = true,
                _ => {
                    let near = self.near(word, PRODUCTS.iter().copied()).map(|near| format!("`{near}`?"));
                    let fault = self.misfit(&given, "X01", format!("there is no product `{word}`"));
                    let fault = fault.label(near.unwrap_or_default());
                    self.report(fault.help(format!("known: {}", PRODUCTS.join(", "))));
                    good = false;
                }
            }
            any = true;
        }
        self.surplus(line, line.items, 1);
        if !any {
            let fault = Diagnostic::error("X01", line.span(), "this leaves nothing to write").label("radiance?");
            self.report(fault.help(format!("known: {}", PRODUCTS.join(", "))));
            return None;
        }
        good.then_some(products)
    }

    /// For each used material the model it takes: a line with `for` goes before one without; with neither, its first.
    fn selection(&mut self, body: &Body<'a>, choice: &Choice) -> Vec<Option<usize>> {
        let mut general: Option<Chain> = None;
        let mut special: BTreeMap<usize, (usize, bool)> = BTreeMap::new();
        let mut chains: Vec<Chain> = Vec::new();
        let mut sound = !body.faulty.contains("reflectance");
        // Own lines before inherited ones: they win.
        let own = body.all("reflectance").filter(|line| !line.inherited);
        let lines: Vec<Line<'a>> = own.chain(body.all("reflectance").filter(|line| line.inherited)).collect();
        for line in lines {
            let Some((chain, materials)) = self.chain(&line, choice) else {
                sound = false;
                continue;
            };
            let Some(materials) = materials else {
                match &general {
                    None => general = Some(chain),
                    Some(_) if line.inherited => {}
                    Some(first) => {
                        let message = "two lines select models for all materials";
                        let fault = Diagnostic::error("S05", line.span(), message).label("`for MATERIALS`?");
                        let first = first.span;
                        self.report(fault.note(first, "the first"));
                    }
                }
                continue;
            };
            chains.push(chain);
            let index = chains.len() - 1;
            for material in materials {
                match special.get(&material) {
                    None => {
                        special.insert(material, (index, line.inherited));
                    }
                    Some((_, _)) if line.inherited => {}
                    Some((first, _)) => {
                        let name = choice.materials.get(material).map_or("", |material| &material.name);
                        let message = format!("two lines select a model for `{name}`");
                        let fault = Diagnostic::error("S05", line.span(), message).label("name it in one line only");
                        let first = chains[*first].span;
                        self.report(fault.note(first, "the first"));
                    }
                }
            }
        }
        // By line, the materials that have none of its models.
        let mut lacking: BTreeMap<Option<usize>, Vec<usize>> = BTreeMap::new();
        let models = (choice.materials.iter().enumerate())
            .map(|(i, material)| {
                let Identities { names: have, whole } = &choice.identities[i];
                if !material.used || have.is_empty() {
                    return None;
                }
                let own = special.get(&i).map(|(chain, _)| *chain);
                let Some(chain) = own.map(|own| &chains[own]).or(general.as_ref()) else { return Some(0) };
                let found = chain.models.iter().find_map(|model| have.iter().position(|name| name == model));
                if found.is_none() && sound && *whole {
                    lacking.entry(own).or_default().push(i);
                }
                found
            })
            .collect();
        for (line, materials) in lacking {
            let Some(chain) = line.map(|line| &chains[line]).or(general.as_ref()) else { continue };
            let describe = |i: usize| {
                let have: Vec<String> = choice.identities[i].names.iter().map(|name| format!("`{name}`")).collect();
                format!("`{}` has {}", choice.materials[i].name, have.join(", "))
            };
            let wanted: Vec<String> = chain.models.iter().map(|name| format!("`{name}`")).collect();
            let message =
                format!("the material `{}` has no model {}", choice.materials[materials[0]].name, wanted.join(" or "));
            let mut fault = Diagnostic::error("M02", chain.span, message).label("no such model");
            for i in materials.iter().take(8) {
                fault = fault.note(choice.materials[*i].span, describe(*i));
            }
            let other = choice.identities[materials[0]].names.first().map_or("ideal", String::as_str);
            self.report(fault.help(format!("add `else {other}`, or give the material such a model")));
        }
        models
    }

    /// The models of one line, and its materials where it names them.
    fn chain(&mut self, line: &Line<'a>, choice: &Choice) -> Option<(Chain, Option<Vec<usize>>)> {
        let (items, clauses) = self.clauses(line);
        let materials = match clauses.get("for") {
            Some(clause) => self.references(&clause, clause.items, Kind::Material).map(Some),
            None => Some(None),
        };
        let elses: Vec<Line<'a>> = clauses.all("else").collect();
        let mut models = Vec::new();
        let mut good = !clauses.obscure;
        if items.is_empty() {
            self.absent(line, "the name of a model");
            good = false;
        }
        self.surplus(line, items, 1);
        let named = items.first().map(|item| (*line, item));
        for clause in &elses {
            if clause.items.is_empty() {
                self.absent(clause, "the name of a model");
                good = false;
            }
            self.surplus(clause, clause.items, 1);
        }
        let named = named.into_iter().chain(elses.iter().filter_map(|clause| Some((*clause, clause.items.first()?))));
        for (clause, item) in named {
            match self.model_name(&clause, item, choice) {
                Some(name) => models.push(name),
                None => good = false,
            }
        }
        good.then_some((Chain { models, span: line.span() }, materials?))
    }

    fn model_name(&mut self, line: &Line<'a>, item: &'a Item, choice: &Choice) -> Option<String> {
        let mut known: Vec<&str> = self.catalog.of(Role::Reflectance).map(|info| info.name).collect();
        known.extend(choice.identities.iter().flat_map(|models| &models.names).map(String::as_str));
        known.sort_unstable();
        known.dedup();
        let given = self.resolve(item, &known);
        let Value::Word(name) = given.value else {
            self.wrong(line, &given, "the name of a model");
            return None;
        };
        if known.contains(&name.as_str()) {
            return Some(name.clone());
        }
        if !self.excused(name) {
            let near = self.near(name, known.iter().copied()).map(|near| format!("`{near}`?")).unwrap_or_default();
            let message = format!("`{name}` is no reflectance model, and no material has a model of that label");
            let fault = self.misfit(&given, "N02", message).label(near);
            self.report(fault.help(format!("known: {}", list(known))));
        }
        None
    }
}
