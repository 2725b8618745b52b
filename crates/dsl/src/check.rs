//! Tree to meaning: names resolved, units canonical, ranges verified. Everything that is wrong is reported in one run,
//! each fault once.

mod arena;
mod block;
mod database;
mod experiment;
mod geometry;
mod material;
mod model;
mod names;
mod polygon;
mod sensor;
mod spectrum;
mod sweep;
mod time;
mod value;

use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};

use sunglint_plugin::{Catalog, Role};

use self::arena::{Arena, Tail};
use self::block::{Body, Braces, Line, Owner, Rule, inherit, rule};
use self::database::Folder;
use self::experiment::{Choice, EXPERIMENT, SNAPSHOT};
use self::geometry::{GEOMETRY, GROUND_RULE, Scope, TERRAIN_RULE, materials_of};
use self::material::{Identities, MATERIAL_HEAD};
use self::names::{Kind, Names};
use self::sensor::SENSOR;
use self::sweep::Run;
pub(crate) use self::time::{days_from_epoch, days_in};
use crate::ast::{Ast, Item, Statement, Value};
use crate::nearest::nearest;
use crate::scene::{Collect, Experiment, Scene, Times, Weather};
use crate::{Diagnostic, FileId, LoadError, Loaded, Loader, Severity, Sources, Span};

/// Name of the atmosphere of a scene that names none.
pub const DEFAULT_ATMOSPHERE: &str = "layered";

/// Holds a tree against the language and the models of a catalogue. `None` where any error was found, by this or by the
/// parser: `diagnostics` is the list that [`crate::parse`] filled. Files are read through `loader`, those of materials
/// and objects only where something uses them; tables that a diagnostic points into are added to `sources`.
pub fn check(
    ast: &Ast,
    sources: &mut Sources,
    catalog: &Catalog,
    loader: &mut dyn Loader,
    diagnostics: &mut Vec<Diagnostic>,
) -> Option<Scene> {
    let spelt_out = spelt_out(ast, sources);
    let ast = spelt_out.as_ref().unwrap_or(ast);
    let refused_text: Vec<Span> =
        (diagnostics.iter()).filter(|fault| fault.severity == Severity::Error).filter_map(|fault| fault.span).collect();
    let arena = Arena::default();
    let mut checker = Checker {
        kept: arena.tail(),
        catalog,
        loader,
        diagnostics,
        muted: muted(ast, sources, &refused_text),
        sources,
        refused_text,
        seen: HashSet::new(),
        n_errors: 0,
        n_warnings: 0,
        names: Names::default(),
        constants: BTreeMap::new(),
        poisoned: BTreeSet::new(),
        in_experiment: false,
        opening: true,
        placements: 0,
        meshes: HashMap::new(),
        files: HashMap::new(),
        tables: HashMap::new(),
        folders: Vec::new(),
        shelved: BTreeMap::new(),
        parents: Vec::new(),
        n_materials: 0,
        variation: None,
    };
    let scene = checker.scene(ast);
    let sound = diagnostics.iter().all(|fault| fault.severity != Severity::Error);
    sound.then_some(scene)
}

/// The tree with packed statements spelt out, where any is not a facet of a known material in the scene or an object: of
/// those alone each can be read by itself.
fn spelt_out(ast: &Ast, sources: &Sources) -> Option<Ast> {
    let name = |statement: &'_ Statement| match statement.items.first() {
        Some(Item { value: Value::Word(name), .. }) => name.clone(),
        _ => String::new(),
    };
    let materials: HashSet<String> =
        ast.statements.iter().filter(|statement| statement.key.text == "material").map(name).collect();
    let facet = |within: Option<&str>, statement: &Statement| {
        statement.key.text == "facet" && matches!(within, None | Some("object")) && materials.contains(&name(statement))
    };
    let mut blocks = vec![(None, &ast.statements)];
    while let Some((within, statements)) = blocks.pop() {
        for statement in statements {
            if statement.again.is_some() && !facet(within, statement) {
                return Some(ast.spelt_out(sources, &facet));
            }
            let key = Some(statement.key.text.as_str());
            blocks.extend(statement.block.iter().map(|block| (key, &block.statements)));
        }
    }
    None
}

/// The places that the parser refused, each with the statement that holds it or ends right before it.
fn muted(ast: &Ast, sources: &Sources, refused: &[Span]) -> Vec<Span> {
    let mut out = refused.to_vec();
    if refused.is_empty() {
        return out;
    }
    let mut places: Vec<(FileId, u32)> = refused.iter().map(|span| (span.file, span.start)).collect();
    places.sort_unstable();
    let mut blocks = vec![&ast.statements];
    while let Some(statements) = blocks.pop() {
        for statement in statements {
            let span = statement.span;
            let text = &sources.get(span.file).text;
            let behind = text.get(span.end as usize..).unwrap_or_default();
            let blank = behind.len() - behind.trim_start_matches([' ', '\t', ',', ';']).len();
            let end = span.end + blank as u32;
            let next = places.partition_point(|place| *place < (span.file, span.start));
            if places.get(next).is_some_and(|place| *place <= (span.file, end)) {
                out.push(span);
            }
            blocks.extend(statement.block.iter().map(|block| &block.statements));
        }
    }
    out
}

/// What one run reports; more is noise.
const MOST_ERRORS: usize = 500;
const MOST_WARNINGS: usize = 100;
/// How many of them propose the nearest name: with many names, finding it costs.
const MOST_NEAREST: usize = 100;

struct Checker<'a> {
    /// Statements that the checker makes or reads itself.
    kept: Tail<'a>,
    sources: &'a mut Sources,
    catalog: &'a Catalog,
    loader: &'a mut dyn Loader,
    diagnostics: &'a mut Vec<Diagnostic>,
    /// Where the parser found errors: what seems missing may be there.
    refused_text: Vec<Span>,
    /// Those places, and the statements that hold them: no more is said of these.
    muted: Vec<Span>,
    seen: HashSet<(&'static str, Option<Span>, String)>,
    n_errors: usize,
    n_warnings: usize,
    names: Names<'a>,
    constants: BTreeMap<&'a str, (&'a Item, Span)>,
    /// Constants whose definition is at fault already.
    poisoned: BTreeSet<&'a str>,
    in_experiment: bool,
    /// Whether files are opened: not for what nothing uses.
    opening: bool,
    placements: usize,
    /// The items that name the files of meshes, by their place.
    meshes: HashMap<Span, &'a Item>,
    files: HashMap<(&'a str, String), Result<Loaded, LoadError>>,
    tables: HashMap<String, FileId>,
    /// Databases of materials, in the order in which they are searched.
    folders: Vec<Folder>,
    /// What was looked for in them.
    shelved: BTreeMap<String, Option<&'a Statement>>,
    /// Materials of databases that others are like, behind those of the scene.
    parents: Vec<(&'a str, Span)>,
    /// Materials of the scene.
    n_materials: usize,
    /// Where an experiment gives constants other values, while the scene is checked under them.
    variation: Option<Span>,
}

/// Statements of the scene itself; geometry stands beside them.
const SCENE: &[Rule] = &[
    rule("glint", "glint 1").many(),
    rule("scene", "scene STRING"),
    rule("include", "include STRING").many(),
    rule("plugin", "plugin STRING").many().later(Severity::Error),
    rule("database", "database STRING").many(),
    rule("define", "define NAME VALUE").many().leading(2),
    rule("site", "site { latitude ANGLE, longitude ANGLE }").braces(Braces::Required),
    rule("collect", "collect { at 1992-06-18 12:00 -04:00 }").many().leading(1).braces(Braces::Required),
    rule("weather", "weather { … }").many().leading(1).braces(Braces::Required),
    rule("atmosphere", "atmosphere MODEL").leading(1).braces(Braces::Optional),
    rule("material", "material NAME { … }").many().leading(1).clauses(MATERIAL_HEAD).braces(Braces::Optional),
    rule("object", "object NAME { … }").many().leading(1).braces(Braces::Required),
    TERRAIN_RULE,
    GROUND_RULE,
    rule("periodic", "periodic POINT2 POINT2").many().later(Severity::Error),
    rule("sensor", "sensor NAME { … }").many().leading(1).clauses(LIKE_SENSOR).braces(Braces::Optional),
    rule("experiment", "experiment NAME { … }").many().leading(1).clauses(LIKE_EXPERIMENT).braces(Braces::Optional),
    rule("snapshot", "snapshot { pixels 64 x 48 }").braces(Braces::Required),
];
const LIKE_SENSOR: &[Rule] = &[rule("like", "like SENSOR").word()];
const LIKE_EXPERIMENT: &[Rule] = &[rule("like", "like EXPERIMENT").word()];

/// Names that lead back to the first, cut where they are many.
fn circle(names: &[&str]) -> String {
    const SHOWN: usize = 12;
    match names {
        [first @ .., last] if names.len() > SHOWN => format!("{} > … > {last}", first[..SHOWN].join(" > ")),
        _ => names.join(" > "),
    }
}

/// Every word that the language itself gives a meaning at some place, for editors: keys of statements and clauses, and
/// connectives. Names of models and of their parameters come from the catalogue.
pub fn keywords() -> BTreeSet<&'static str> {
    let of_scene = [SCENE, GEOMETRY, time::SITE, time::COLLECT, time::WEATHER, time::CLOUD];
    let tables = of_scene.into_iter().chain([material::MATERIAL, SENSOR, EXPERIMENT, SNAPSHOT]);
    let mut waiting: Vec<&Rule> = tables.flatten().collect();
    let mut words: BTreeSet<_> = crate::parse::spelling::CONNECTIVES.iter().copied().collect();
    while let Some(rule) = waiting.pop() {
        words.insert(rule.key);
        waiting.extend(rule.clauses);
    }
    words
}

/// Where a key belongs that stands elsewhere.
fn home_of(key: &str) -> Option<&'static str> {
    let tables: [(&[Rule], &'static str); 8] = [
        (SCENE, "the scene, outside every block"),
        (GEOMETRY, "the scene or an object"),
        (time::SITE, "`site`"),
        (SENSOR, "`sensor`"),
        (time::WEATHER, "`weather`"),
        (time::COLLECT, "`collect`"),
        (EXPERIMENT, "`experiment`"),
        (SNAPSHOT, "`snapshot`"),
    ];
    tables.iter().find(|(rules, _)| rules.iter().any(|rule| rule.key == key)).map(|(_, home)| *home)
}

/// A named block that may be like another.
struct Entity<'a> {
    name: Option<&'a str>,
    /// Where the name stands, or the key without one.
    name_span: Span,
    line: Line<'a>,
    /// What stands between name and braces.
    head: Body<'a>,
    /// What stands in the braces.
    body: Body<'a>,
    like: Option<usize>,
    /// Whether it was to come from a database and did not.
    lost: bool,
}

impl<'a> Entity<'a> {
    fn shown(&self) -> &'a str {
        self.name.unwrap_or_default()
    }
}

impl<'a> Checker<'a> {
    /// Takes a diagnostic, each once, and none about what the parser has refused already.
    fn report(&mut self, fault: Diagnostic) {
        let overlap = |a: Span, b: Span| a.file == b.file && a.start < b.end && b.start < a.end;
        if fault.span.is_some_and(|span| self.muted.iter().any(|muted| overlap(span, *muted))) {
            return;
        }
        let (count, most) = match fault.severity {
            Severity::Error => (&mut self.n_errors, MOST_ERRORS),
            Severity::Warning => (&mut self.n_warnings, MOST_WARNINGS),
        };
        if *count < most && self.seen.insert((fault.code, fault.span, fault.message.clone())) {
            *count += 1;
            // What the text's own constants do not show is the doing of an experiment.
            let told = |place: Span| fault.notes.iter().any(|(note, _)| overlap(*note, place));
            let fault = match self.variation {
                Some(place) if !told(place) => fault.note(place, "with this value of the constant"),
                _ => fault,
            };
            self.diagnostics.push(fault);
        }
    }

    /// [`nearest`], for the first errors.
    fn near<'n>(&self, wanted: &str, known: impl IntoIterator<Item = &'n str>) -> Option<&'n str> {
        if self.n_errors < MOST_NEAREST { nearest(wanted, known) } else { None }
    }

    fn scene(&mut self, ast: &'a Ast) -> Scene {
        let main = |span: Span| span.file == FileId(0);
        let lines = (ast.statements.iter())
            .filter(|statement| {
                main(statement.key.span) || !matches!(statement.key.text.as_str(), "scene" | "snapshot")
            })
            .map(Line::of);
        let whole = Span { file: FileId(0), start: 0, end: self.sources.get(FileId(0)).text.len() as u32 };
        let owner =
            Owner { of: "a scene".to_string(), noun: "statement", exclusion: "S05", span: whole, extent: whole };
        let rules: Vec<Rule> = SCENE.iter().chain(GEOMETRY).copied().collect();
        let top = self.hold(lines, &rules, SCENE, &owner);

        self.define(&top);
        self.declare_all(&top);
        self.databases(&top);
        let before = self.n_errors;
        self.in_experiment = true;
        let found = self.entities(&top, "experiment", Kind::Experiment, EXPERIMENT, EXPERIMENT, "an experiment");
        self.in_experiment = false;
        let bodies = self.lineages(&found, Kind::Experiment, EXPERIMENT, experiment::same_selection);
        let runs = self.runs(&found, &bodies);
        let of_experiments = self.n_errors - before;

        let (mut scene, identities) = self.world(&top);
        let whole = self.n_errors == of_experiments;
        let groups = self.by_constants(&runs);
        scene.experiments = self.experiments(&found, &groups[0], &scene, &identities, whole);
        if found.is_empty() {
            let choice = Choice::of(&scene, &identities, whole);
            let default = self.default_experiment(&choice);
            scene.experiments.push(default);
        }
        let defined = |group: &[&Run<'a>]| Some(group.first()?.constants.first()?.span);
        let place = groups.get(1).and_then(|group| defined(group));
        if self.fits_times(&scene, groups.len(), place) {
            let own = self.constants.clone();
            for group in &groups[1..] {
                let before = self.n_errors;
                self.variation = defined(group);
                for constant in group.iter().take(1).flat_map(|run| &run.constants) {
                    self.constants.insert(constant.name, (constant.value, constant.span));
                }
                self.break_circles();
                let (mut variant, identities) = self.world(&top);
                let whole = whole && self.n_errors == before;
                variant.experiments = self.experiments(&found, group, &variant, &identities, whole);
                scene.variants.push(variant);
                self.variation = None;
                self.constants.clone_from(&own);
            }
        }
        scene
    }

    /// The experiments of some runs.
    fn experiments(
        &mut self,
        found: &[Entity<'a>],
        runs: &[&Run<'a>],
        scene: &Scene,
        identities: &[Identities],
        whole: bool,
    ) -> Vec<Experiment> {
        let choice = Choice::of(scene, identities, whole);
        runs.iter().map(|run| self.experiment(&found[run.entity], run, &choice)).collect()
    }

    /// What the text means under the constants that stand, but for its experiments; and what these can pick from each
    /// material.
    fn world(&mut self, top: &Body<'a>) -> (Scene, Vec<Identities>) {
        self.names.forget(Kind::Placement);
        (self.placements, self.opening) = (0, true);
        let title = top.get("scene").and_then(|line| self.text(&line)).map(|(title, _)| title.to_string());
        let (site, crs) = self.site(top);
        let weathers = self.weathers(top);
        let collects = self.collects(top, site.is_some() || top.said("site"));
        let n_collects = collects.len();

        let found = self.entities(top, "sensor", Kind::Sensor, SENSOR, SENSOR, "a sensor");
        let bodies = self.lineages(&found, Kind::Sensor, SENSOR, sensor::same_band);
        let sensors: Vec<_> = (found.iter().zip(&bodies))
            .map(|(entity, body)| {
                let owner = Owner::new("a sensor", &entity.line);
                self.require(body, SENSOR, &owner);
                self.sensor(entity, body, n_collects, site)
            })
            .collect();
        if sensors.is_empty() && !self.perhaps(top, "sensor") {
            let fault = Diagnostic::whole("S05", "the scene has no sensor").label("`sensor NAME { … }`?");
            self.report(fault.help("a scene needs `sensor NAME { position, look_at, field_of_view, pixels, band }`"));
        }

        let ground = self.ground(top);
        let terrain = self.terrain(top);
        let mut world = self.shapes(top, Scope::World);
        let mut objects: Vec<_> = (top.all("object"))
            .map(|line| {
                let name = self.name_of(&line, Kind::Object).map_or("", |(name, _)| name);
                self.surplus(&line, line.items, 1);
                self.object(&line, name)
            })
            .collect();
        self.objects_are_finite(&objects, &world);
        let placed = Self::placed(&objects, &world);
        self.read_meshes(&mut world);
        for (i, object) in objects.iter_mut().enumerate() {
            if placed.contains(&i) {
                self.read_meshes(&mut object.shapes);
            } else {
                object.shapes.clear();
            }
        }

        let rules = self.material_rules();
        let mut found = self.entities(top, "material", Kind::Material, &rules, &[], "a material");
        let bodies = self
            .lineages(&found, Kind::Material, &rules, |old, new| material::identity(old) == material::identity(new));
        // Those of a database that are here only to be like.
        found.truncate(self.n_materials);
        let mut used = vec![false; found.len()];
        let of_terrain =
            terrain.iter().flat_map(|t| t.maps.iter().map(|(_, material, _)| *material).chain([t.material]));
        let stands = ground.map(|ground| ground.material).into_iter().chain(of_terrain);
        let shapes = std::iter::once(&world).chain(objects.iter().map(|object| &object.shapes));
        for material in shapes.flat_map(|shapes| materials_of(shapes)).chain(stands) {
            used[material] = true;
        }
        let codes = self.codes(&found);
        let mut materials = Vec::with_capacity(found.len());
        let mut identities = Vec::with_capacity(found.len());
        for (i, entity) in found.iter().enumerate() {
            let used = used[i] && !entity.lost;
            let (material, models) = self.material(entity, &bodies[i], codes[i], used);
            materials.push(material);
            identities.push(models);
        }

        let atmosphere = match top.get("atmosphere") {
            Some(line) => self.named_model(&line, Role::Atmosphere),
            None => None,
        };
        let atmosphere = atmosphere.unwrap_or_else(|| self.default_model(Role::Atmosphere, DEFAULT_ATMOSPHERE));
        let snapshot = self.snapshot(top);
        let scene = Scene {
            title,
            site,
            crs,
            collects,
            weathers,
            atmosphere,
            materials,
            objects,
            world,
            terrain,
            ground,
            sensors,
            experiments: Vec::new(),
            snapshot,
            variants: Vec::new(),
        };
        (scene, identities)
    }

    /// Whether a statement that seems missing may be one that could not be read.
    fn perhaps(&self, top: &Body<'a>, key: &str) -> bool {
        top.said(key) || !self.refused_text.is_empty()
    }

    fn define(&mut self, top: &Body<'a>) {
        for line in top.all("define") {
            match line.items {
                [Item { value: Value::Word(name), span }, value, rest @ ..] => {
                    let index = self.constants.len();
                    self.declare(Kind::Constant, name, *span, index);
                    self.constants.entry(name).or_insert((value, line.span()));
                    if !rest.is_empty() {
                        self.surplus(&line, line.items, 2);
                        self.poisoned.insert(name);
                    }
                }
                [Item { value: Value::Word(name), .. }] => {
                    self.absent(&line, "a name and a value");
                    self.poisoned.insert(name);
                }
                _ => self.absent(&line, "a name and a value"),
            }
        }
        self.break_circles();
    }

    /// Reports constants that stand for each other in a circle, and forgets them.
    fn break_circles(&mut self) {
        let names: Vec<&'a str> = self.constants.keys().copied().collect();
        for name in names {
            let mut path = vec![name];
            while let Some((Item { value: Value::Word(next), .. }, span)) =
                path.last().and_then(|n| self.constants.get(n))
                && self.constants.contains_key(next.as_str())
            {
                if let Some(start) = path.iter().position(|known| known == next) {
                    path.push(next);
                    let message = format!("constants that stand for each other: {}", circle(&path[start..]));
                    let fault = Diagnostic::error("N04", *span, message).label("this closes the circle");
                    self.report(fault);
                    self.poisoned.extend(&path);
                    self.constants.retain(|name, _| !path.contains(name));
                    break;
                }
                path.push(next);
            }
        }
    }

    /// The name behind a key.
    fn name_of(&mut self, line: &Line<'a>, kind: Kind) -> Option<(&'a str, Span)> {
        match line.items.first() {
            Some(Item { value: Value::Word(name), span }) => Some((name, *span)),
            _ => {
                let fault = Diagnostic::error("S05", line.key_span, format!("{} needs a name", kind.a_noun()));
                self.report(fault.label(format!("`{} NAME`?", line.key)));
                None
            }
        }
    }

    fn declare_all(&mut self, top: &Body<'a>) {
        let kinds = [
            ("material", Kind::Material),
            ("object", Kind::Object),
            ("sensor", Kind::Sensor),
            ("experiment", Kind::Experiment),
        ];
        for (key, kind) in kinds {
            for (index, line) in top.all(key).enumerate() {
                if let Some((name, span)) = self.name_of(&line, kind) {
                    self.declare(kind, name, span, index);
                }
            }
        }
        for (index, line) in top.all("collect").enumerate() {
            if let [Item { value: Value::Word(name), span }, ..] = line.items {
                self.declare(Kind::Collect, name, *span, index);
            }
        }
        // The unnamed weather is the first.
        let named = top.all("weather").filter(|line| !line.items.is_empty());
        for (index, line) in named.enumerate() {
            if let [Item { value: Value::Word(name), span }, ..] = line.items {
                self.declare(Kind::Weather, name, *span, index + 1);
            }
        }
    }

    fn weathers(&mut self, top: &Body<'a>) -> Vec<Weather> {
        let mut out = vec![Weather::default()];
        let mut unnamed: Option<Span> = None;
        for line in top.all("weather") {
            if line.items.is_empty() {
                if let Some(first) = unnamed {
                    let message = "the scene's weather is said twice";
                    let fault = Diagnostic::error("S05", line.span(), message).label("`weather NAME { … }`?");
                    self.report(fault.note(first, "first said here"));
                }
                unnamed = Some(line.span());
                out[0] = self.weather(&line, None);
            } else {
                let name = self.name_of(&line, Kind::Weather).map(|(name, _)| name);
                self.surplus(&line, line.items, 1);
                let weather = self.weather(&line, name);
                out.push(weather);
            }
        }
        out
    }

    fn collects(&mut self, top: &Body<'a>, sited: bool) -> Vec<Collect> {
        let mut out = Vec::new();
        for line in top.all("collect") {
            let name = match line.items.first() {
                Some(_) => self.name_of(&line, Kind::Collect).map(|(name, _)| name),
                None => None,
            };
            self.surplus(&line, line.items, 1);
            let nothing = Collect { name: None, times: Times::NoSun, weather: None, span: line.span() };
            out.push(self.collect(&line, name).unwrap_or(nothing));
        }
        if out.is_empty() && !self.perhaps(top, "collect") {
            let fault = Diagnostic::whole("T01", "the scene has no time: nothing is collected");
            self.report(fault.label("`collect`?").help("collect { at 1992-06-18 12:00 -04:00 }"));
        }
        if !sited && !self.perhaps(top, "site") {
            self.times_have_a_site(&out);
        }
        out
    }

    /// The blocks of a kind, each held against its table.
    fn entities(
        &mut self,
        top: &Body<'a>,
        key: &'static str,
        kind: Kind,
        rules: &[Rule],
        siblings: &'static [Rule],
        of: &str,
    ) -> Vec<Entity<'a>> {
        let mut out = Vec::new();
        let material = kind == Kind::Material;
        if material {
            self.parents.clear();
            self.n_materials = top.all(key).count();
        }
        for line in top.all(key) {
            let (items, mut head) = self.clauses(&line);
            let name = match items.first() {
                Some(Item { value: Value::Word(name), span }) => Some((name.as_str(), *span)),
                _ => None,
            };
            self.surplus(&line, items, 1);
            let exclusion = match kind {
                Kind::Sensor => "V01",
                Kind::Experiment => "X03",
                _ => "S05",
            };
            let owner = Owner { exclusion, ..Owner::new(of, &line) };
            let mut like = head.get("like").and_then(|like| self.parent(&like, kind));
            let mut block = line.block;
            let mut lost = false;
            if let Some((name, span)) = name.filter(|_| material && block.is_none() && !head.said("like")) {
                let taken = self.taken(name, span).and_then(|statement| self.shelf_head(statement));
                lost = taken.is_none();
                if let Some((statement, above)) = taken {
                    block = statement.block.as_ref();
                    like = above.get("like").and_then(|like| self.parent(&like, kind));
                    head.lines.extend(above.lines);
                }
            }
            let statements = block.iter().flat_map(|block| &block.statements).map(Line::of);
            let mut body = self.hold(statements, rules, siblings, &owner);
            body.obscure |= lost;
            if kind == Kind::Sensor && line.block.is_none() && !head.said("like") {
                self.missing("S05", "a sensor needs a block in braces", "sensor NAME { … }", &owner);
            }
            let name_span = name.map_or(line.key_span, |(_, span)| span);
            out.push(Entity { name: name.map(|(name, _)| name), name_span, line, head, body, like, lost });
        }
        let mut next = 0;
        while let Some((name, wanted)) = self.parents.get(next).copied().filter(|_| material) {
            next += 1;
            let taken = self.take_from_database(name, wanted).and_then(|statement| self.shelf_head(statement));
            let (line, head) = match taken {
                Some((statement, head)) => (Line::of(statement), head),
                None => (Line { block: None, ..out[0].line }, Body { obscure: true, ..Body::default() }),
            };
            let like = head.get("like").and_then(|like| self.parent(&like, kind));
            let owner = Owner::new(of, &line);
            let statements = line.block.iter().flat_map(|block| &block.statements).map(Line::of);
            let mut body = self.hold(statements, rules, siblings, &owner);
            body.obscure |= line.block.is_none() && !head.said("like");
            out.push(Entity { name: Some(name), name_span: wanted, line, head, body, like, lost: false });
        }
        out
    }

    /// A statement of a database with what stands between its name and its braces.
    fn shelf_head(&mut self, statement: &'a Statement) -> Option<(&'a Statement, Body<'a>)> {
        let line = Line { clauses: MATERIAL_HEAD, leading: 1, ..Line::of(statement) };
        let (items, head) = self.clauses(&line);
        self.surplus(&line, items, 1);
        if let Some(code) = head.get("code") {
            let fault = Diagnostic::error("F01", code.span(), "a material of a database has no code of its own");
            self.report(fault.label("the scene gives it: `material NAME code COUNT`"));
        } else if statement.block.is_none() && !head.said("like") {
            let fault =
                Diagnostic::error("F01", statement.span, "this file of a database says nothing of its material");
            self.report(fault.label("`{ title, source, licence, reflectance, ideal }`?"));
        } else {
            return Some((statement, head));
        }
        None
    }

    fn parent(&mut self, like: &Line<'a>, kind: Kind) -> Option<usize> {
        let Some(item) = like.items.first() else {
            self.absent(like, &format!("the name of {}", kind.a_noun()));
            return None;
        };
        if let Value::Word(name) = &item.value
            && kind == Kind::Material
            && self.names.find(kind, name).is_none()
            && self.in_database(name)
        {
            self.surplus(like, like.items, 1);
            let known = self.parents.iter().position(|(known, _)| known == name);
            let position = known.unwrap_or_else(|| {
                self.parents.push((name, item.span));
                self.parents.len() - 1
            });
            return Some(self.n_materials + position);
        }
        let index = self.reference(like, item, kind);
        self.surplus(like, like.items, 1);
        index
    }

    /// Each block with what it takes over by `like`.
    fn lineages(&mut self, found: &[Entity<'a>], kind: Kind, rules: &[Rule], same: block::Same) -> Vec<Body<'a>> {
        let mut out: Vec<Option<Body<'a>>> = vec![None; found.len()];
        let mut open = vec![false; found.len()];
        for start in 0..found.len() {
            let mut chain = Vec::new();
            let mut next = Some(start);
            while let Some(i) = next.filter(|i| out[*i].is_none()) {
                if open[i] {
                    let from = chain.iter().position(|known| *known == i).unwrap_or(0);
                    let names: Vec<&str> = chain[from..].iter().chain([&i]).map(|i| found[*i].shown()).collect();
                    let message = format!("each {} is like the next: {}", kind.noun(), circle(&names));
                    let span = found[i].head.get("like").map_or(found[i].name_span, |like| like.span());
                    self.report(Diagnostic::error("N04", span, message).label("part of the circle"));
                    break;
                }
                open[i] = true;
                chain.push(i);
                next = found[i].like;
            }
            let root = next.and_then(|i| out[i].clone());
            // A parent that is not there, or is in a circle, is at fault already: nothing is missing here.
            let orphan = root.is_none() && chain.last().is_some_and(|last| found[*last].head.said("like"));
            let mut parent = root;
            for i in chain.into_iter().rev() {
                let mut body = match &parent {
                    Some(parent) => inherit(parent, &found[i].body, rules, same),
                    None => found[i].body.clone(),
                };
                body.obscure |= orphan;
                parent = Some(body.clone());
                out[i] = Some(body);
            }
        }
        out.into_iter().map(Option::unwrap_or_default).collect()
    }
}
