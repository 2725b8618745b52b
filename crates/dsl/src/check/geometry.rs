//! What stands in a scene.

mod placement;
mod scatter;
mod solid;
mod terrain;

pub(super) use terrain::TERRAIN_RULE;

use std::collections::BTreeSet;
use std::ops::Deref;
use std::sync::Arc;

use glam::{DVec2, DVec3};
use sunglint_radiometry::{Dimension, Unit, unit, units_of};

use super::Checker;
use super::block::{Body, Braces, Line, Owner, Rule, rule};
use super::names::Kind;
use super::polygon::{self, Fault};
use super::spectrum::Opened;
use super::value::{COORDINATE, Given, Quantity, SCALE, SIZE, TURN};
use crate::ast::{Item, Value, Word};
use crate::scene::{Facing, Ground, Object, Polygons, Pose, Scatter, SceneFile, Shape};
use crate::{Diagnostic, Runs, Span};
use scatter::SCATTER;
use solid::{DISK, SPHERE, UPRIGHT};

const AT: Rule = rule("at", "at POINT");
const HEADING: Rule = rule("heading", "heading ANGLE");
const PITCH: Rule = rule("pitch", "pitch ANGLE");
const ROLL: Rule = rule("roll", "roll ANGLE");
const SCALED: Rule = rule("scale", "scale NUMBER");

const PANEL: &[Rule] = &[
    rule("size", "size (w h) m").required(),
    rule("facing", "facing up|down|north|east|south|west|POINT|SENSOR").word().excludes(&["slope", "aspect"]),
    rule("slope", "slope ANGLE aspect ANGLE").excludes(&["facing"]),
    rule("aspect", "slope ANGLE aspect ANGLE").excludes(&["facing"]),
    AT,
    HEADING,
    PITCH,
    ROLL,
    SCALED,
];
const BOX: &[Rule] = &[rule("size", "size (x y z) m").required(), AT, HEADING, PITCH, ROLL, SCALED];
const MESH: &[Rule] = &[
    rule("unit", "unit m").required().word(),
    rule("up", "up y|z").word(),
    rule("map", "map STRING to MATERIAL").many().clauses(&[rule("to", "to MATERIAL").required().word()]),
    AT,
    HEADING,
    PITCH,
    ROLL,
    SCALED,
];
const PLACE: &[Rule] = &[
    rule("as", "as NAME").word(),
    rule("grid", "grid M x N spacing (dx dy) m").excludes(&["as"]),
    rule("spacing", "spacing (dx dy) m"),
    rule("from", "from FILE").excludes(&["grid"]),
    AT,
    HEADING,
    PITCH,
    ROLL,
    SCALED,
];
const GROUND: &[Rule] = &[rule("height", "height LENGTH")];

/// Statements of geometry, in an object's block as in the scene.
pub(super) const GEOMETRY: &[Rule] = &[
    rule("facet", "facet MATERIAL POINT POINT POINT…").many().leading(1),
    rule("facets", "facets MATERIAL [POINT…, …]").many().leading(1),
    rule("panel", "panel MATERIAL size (w h) m at POINT").many().leading(1).clauses(PANEL).braces(Braces::Clauses),
    rule("box", "box MATERIAL size (x y z) m at POINT").many().leading(1).clauses(BOX).braces(Braces::Clauses),
    rule("mesh", "mesh STRING unit m { map STRING to MATERIAL }")
        .many()
        .leading(1)
        .clauses(MESH)
        .braces(Braces::Clauses),
    rule("place", "place OBJECT at POINT").many().leading(1).clauses(PLACE).braces(Braces::Clauses),
    rule("disk", "disk MATERIAL radius LENGTH at POINT").many().leading(1).clauses(DISK).braces(Braces::Clauses),
    rule("cylinder", "cylinder MATERIAL radius LENGTH height LENGTH at POINT")
        .many()
        .leading(1)
        .clauses(UPRIGHT)
        .braces(Braces::Clauses),
    rule("cone", "cone MATERIAL radius LENGTH height LENGTH at POINT")
        .many()
        .leading(1)
        .clauses(UPRIGHT)
        .braces(Braces::Clauses),
    rule("sphere", "sphere MATERIAL radius LENGTH at POINT").many().leading(1).clauses(SPHERE).braces(Braces::Clauses),
    rule("scatter", "scatter OBJECT count COUNT within REGION at POINT")
        .many()
        .leading(1)
        .clauses(SCATTER)
        .braces(Braces::Clauses),
];
/// Geometry that stands outside objects.
pub(super) const GROUND_RULE: Rule =
    rule("ground", "ground MATERIAL").leading(1).clauses(GROUND).braces(Braces::Clauses);

/// The most placements of one statement: 10⁷ poses are 0.6 GB.
const MOST_PLACED: u64 = 10_000_000;
/// The most members that nested placements may expand to.
const MOST_EXPANDED: u64 = 10_000_000;
/// Bytes that each takes with its name and its part of the tree, near enough.
const BYTES_PLACED: u64 = 350;
/// How deep objects may place each other.
const DEEPEST: usize = 64;
/// How far a corner may lie off the plane of its facet, as a share of the facet's extent: corners written to a
/// millimetre on facets of a metre.
const PLANAR: f64 = 1e-3;

/// A point that a pose names.
#[derive(Clone, Copy)]
struct Spot {
    at: DVec3,
    /// Whether only x and y are said.
    on_surface: bool,
}

impl Spot {
    const ORIGIN: Self = Self { at: DVec3::ZERO, on_surface: false };
}

/// Where geometry stands.
#[derive(Clone, Copy)]
pub(super) enum Scope {
    World,
    Object,
}

impl<'a> Checker<'a> {
    pub(super) fn ground(&mut self, top: &Body<'a>) -> Option<Ground> {
        let line = top.get("ground")?;
        let (items, clauses) = self.clauses(&line);
        let height = self.optional(clauses.get("height"), &COORDINATE).unwrap_or(0.0);
        let material = self.first_reference(&line, items, Kind::Material)?;
        self.surplus(&line, items, 1);
        Some(Ground { material, height, span: line.span() })
    }

    fn first_reference(&mut self, line: &Line<'a>, items: &'a [Item], kind: Kind) -> Option<usize> {
        match items.first() {
            Some(item) => self.reference(line, item, kind),
            None => {
                self.absent(line, &format!("the name of {}", kind.a_noun()));
                None
            }
        }
    }

    /// An object's geometry.
    pub(super) fn object(&mut self, line: &Line<'a>, name: &str) -> Object {
        let owner = Owner::new("an object", line);
        let statements = line.block.iter().flat_map(|block| &block.statements).map(Line::of);
        let body = self.hold(statements, GEOMETRY, GEOMETRY, &owner);
        Object { name: name.to_string(), shapes: self.shapes(&body, Scope::Object), span: line.span() }
    }

    /// The geometry of a block. Files of meshes are not read yet.
    pub(super) fn shapes(&mut self, body: &Body<'a>, scope: Scope) -> Vec<Shape> {
        let mut out = Vec::new();
        for line in &body.lines {
            let shape = match line.key {
                "facet" => self.facet(line),
                "facets" => self.facets(line),
                "panel" => self.panel(line, scope),
                "box" => self.solid_box(line, scope),
                "mesh" => self.mesh(line, scope),
                "disk" => self.disk(line, scope),
                "cylinder" | "cone" | "sphere" => self.solid(line, scope),
                "place" => self.place(line, scope),
                "scatter" => self.scatter(line, scope),
                _ => None,
            };
            out.extend(shape);
        }
        out
    }

    fn facet(&mut self, line: &Line<'a>) -> Option<Shape> {
        let material = self.first_reference(line, line.items, Kind::Material);
        let points = line.items.get(1..).unwrap_or_default();
        if points.is_empty() && !line.items.is_empty() {
            self.absent(line, "a run of corners");
            return None;
        }
        let corners = self.corners(line, points, None);
        let first = corners.and_then(|corners| self.polygon(&corners, line.span()));
        let mut polygons = Polygons::new(line.key_span.file);
        if let Some(first) = &first {
            polygons.push(first, line.span());
        }
        if let Some(runs) = line.again {
            let given = self.resolve(&points[0], &[]);
            self.packed(line, &given, runs, None, &mut polygons);
        }
        (!polygons.is_empty()).then_some(Shape::Facets { material: material?, polygons })
    }

    fn facets(&mut self, line: &Line<'a>) -> Option<Shape> {
        let material = self.first_reference(line, line.items, Kind::Material);
        let Some(item) = line.items.get(1) else {
            if !line.items.is_empty() {
                self.absent(line, "a list of runs of corners");
            }
            return None;
        };
        let given = self.resolve(item, &[]);
        let mut polygons = Polygons::new(given.home.file);
        match given.value {
            Value::Runs { runs, unit } => self.packed(line, &given, runs, unit.as_ref(), &mut polygons),
            Value::List { rows, unit } => {
                for row in rows.iter().filter(|row| !row.is_empty()) {
                    let span = super::block::join(row[0].span, row[row.len() - 1].span);
                    if let Some(corners) = self.corners(line, row, unit.as_ref())
                        && let Some(polygon) = self.polygon(&corners, span)
                    {
                        polygons.push(&polygon, span);
                    }
                }
            }
            _ => {
                self.wrong(line, &given, "a list of runs of corners");
                return None;
            }
        }
        self.surplus(line, line.items, 2);
        Some(Shape::Facets { material: material?, polygons })
    }

    /// The polygons of packed runs. What is not sound is read again as if it stood alone, for its message.
    fn packed(
        &mut self,
        line: &Line<'a>,
        given: &Given<'a>,
        runs: &Runs,
        shared: Option<&Word>,
        polygons: &mut Polygons,
    ) {
        let named = Line { key: "corner", ..*line };
        let mut known: Option<(Option<&str>, Option<&Unit>)> = None;
        let mut corners: Vec<DVec3> = Vec::new();
        polygons.reserve(runs.len(), runs.vector_count());
        for i in 0..runs.len() {
            let run = runs.row(i);
            let name = run.unit.or(shared.map(|word| word.text.as_str()));
            let unit = match known {
                Some((known, unit)) if known == name => unit,
                _ => name.and_then(|name| unit(name, COORDINATE.of)),
            };
            known = Some((name, unit));
            corners.clear();
            if let Some(unit) = unit.filter(|_| runs.size() == 3) {
                corners.extend(run.numbers.chunks_exact(3).map_while(|v| {
                    let value = |number| COORDINATE.in_range(unit, number);
                    Some(DVec3::new(value(v[0])?, value(v[1])?, value(v[2])?))
                }));
            }
            if corners.len() * 3 == run.numbers.len()
                && let Ok(polygon) = polygon::examine(&corners, PLANAR)
            {
                polygons.push(&polygon, run.span);
                continue;
            }
            // The scene is refused, and no more is listed.
            if self.n_errors >= super::MOST_ERRORS {
                return;
            }
            let item = runs.item(i, &self.sources.get(runs.file()).text);
            let Value::Points { points, unit: own } = &item.value else { continue };
            let given = Given { span: item.span, home: item.span, constant: None, ..*given };
            let mut corners = Vec::new();
            let read =
                self.vectors_of(&named, &given, points, own.as_ref().or(shared), 3..=3, &COORDINATE, &mut |v, span| {
                    corners.push((DVec3::from(v), span))
                });
            if read.is_some()
                && let Some(polygon) = self.polygon(&corners, run.span)
            {
                polygons.push(&polygon, run.span);
            }
        }
    }

    fn corners(&mut self, line: &Line<'a>, items: &'a [Item], shared: Option<&Word>) -> Option<Vec<(DVec3, Span)>> {
        let named = Line { key: "corner", ..*line };
        let mut corners = Vec::new();
        for item in items {
            if let Value::Word(word) = &item.value
                && !self.constants.contains_key(word.as_str())
            {
                self.surplus(line, std::slice::from_ref(item), 0);
                return None;
            }
            self.run(&named, item, shared, 3..=3, &COORDINATE, &mut |v, span| corners.push((DVec3::from(v), span)))?;
        }
        Some(corners)
    }

    /// A polygon that can be seen: three distinct corners and more, in a plane, not crossing itself.
    fn polygon(&mut self, corners: &[(DVec3, Span)], span: Span) -> Option<impl Deref<Target = [DVec3]> + use<>> {
        let points: Vec<DVec3> = corners.iter().map(|(point, _)| *point).collect();
        let fault = match polygon::examine(&points, PLANAR) {
            Ok(polygon) => return Some(polygon),
            Err(fault) => fault,
        };
        let metres =
            |value: f64| format!("{} m", super::value::written(format!("{value:.2e}").parse().unwrap_or(value)));
        self.report(match fault {
            Fault::TooFew(n) => {
                let message = format!("a facet has three distinct corners or more; this one has {n}");
                Diagnostic::error("G01", span, message).label("another corner?")
            }
            Fault::TooMany(n) => {
                let message = format!("a facet of {n} corners; a facet has at most {}", polygon::MOST_CORNERS);
                Diagnostic::error("G05", span, message).label("several facets, or a mesh?")
            }
            Fault::NoArea => Diagnostic::warning("G01", span, "this facet has no area and is left out")
                .label("its corners lie on one line"),
            Fault::Crossing(a, b) => {
                let (next_a, next_b) = ((a + 1) % corners.len(), (b + 1) % corners.len());
                let message = format!(
                    "this facet crosses itself: its edges {}–{} and {}–{} meet",
                    a + 1,
                    next_a + 1,
                    b + 1,
                    next_b + 1
                );
                Diagnostic::error("G01", corners[next_a].1, message).label("corners in another order?")
            }
            Fault::NotPlanar { corner, distance, extent } => {
                let message = format!(
                    "this facet is not planar: its corner {} lies {} off the plane of the others",
                    corner + 1,
                    metres(distance)
                );
                Diagnostic::error("G02", corners[corner].1, message)
                    .label(format!("at most {}", metres(PLANAR * extent)))
                    .help("split the facet into triangles, or correct the corner")
            }
        });
        None
    }

    fn pose(&mut self, clauses: &Body<'a>, scope: Scope) -> Option<Pose> {
        let at = match clauses.get("at") {
            Some(line) => self.position(&line, scope),
            None => Some(Spot::ORIGIN),
        };
        let turned = self.attitude(clauses);
        let Spot { at, on_surface } = at?;
        Some(Pose { at, on_surface, ..turned? })
    }

    /// A pose's angles and scale, at the origin.
    fn attitude(&mut self, clauses: &Body<'a>) -> Option<Pose> {
        let mut good = true;
        let mut read = |checker: &mut Self, key: &str, q: &Quantity, unsaid: f64| match clauses.get(key) {
            Some(line) => checker.quantity(&line, q).unwrap_or_else(|| {
                good = false;
                unsaid
            }),
            None => unsaid,
        };
        let heading = read(self, "heading", &TURN, 0.0);
        let pitch = read(self, "pitch", &TURN, 0.0);
        let roll = read(self, "roll", &TURN, 0.0);
        let scale = read(self, "scale", &SCALE, 1.0);
        good.then_some(Pose { heading, pitch, roll, scale, ..Pose::default() })
    }

    /// One point, on the terrain or ground where it has two numbers.
    fn position(&mut self, line: &Line<'a>, scope: Scope) -> Option<Spot> {
        let Some(item) = line.items.first() else {
            self.absent(line, "a vector of lengths");
            return None;
        };
        let points = self.positions(line, item, None, scope)?;
        if points.len() > 1 {
            let message = format!("a position is one vector; this is a run of {}", points.len());
            self.report(Diagnostic::error("U04", item.span, message).label("several places stand in a list, `[…]`"));
            return None;
        }
        self.surplus(line, line.items, 1);
        points.first().copied()
    }

    fn positions(&mut self, line: &Line<'a>, item: &'a Item, shared: Option<&Word>, scope: Scope) -> Option<Vec<Spot>> {
        let given = self.resolve(item, &[]);
        let flat: Vec<bool> = match given.value {
            Value::Points { points, .. } => points.iter().map(|point| point.numbers().len() == 2).collect(),
            _ => Vec::new(),
        };
        self.ground_is_known(&given, flat.contains(&true), scope)?;
        let mut out: Vec<Spot> = Vec::with_capacity(flat.len());
        self.run(line, item, shared, 2..=3, &COORDINATE, &mut |v, _| {
            let on_surface = flat.get(out.len()).copied().unwrap_or(false);
            out.push(Spot { at: DVec3::from(v), on_surface });
        })?;
        Some(out)
    }

    /// Reports a position without height where there is no ground to stand on.
    fn ground_is_known(&mut self, given: &Given<'a>, level: bool, scope: Scope) -> Option<()> {
        if level && matches!(scope, Scope::Object) {
            let message = "`at (x y)` stands on the ground, which an object does not know";
            let fault = self.misfit(&Given { constant: None, ..*given }, "G04", message).label("(x y z)?");
            self.report(fault.help("give the height as a third number"));
            return None;
        }
        Some(())
    }

    /// `positions` for a packed list of them.
    fn packed_positions(
        &mut self,
        line: &Line<'a>,
        given: &Given<'a>,
        runs: &Runs,
        shared: Option<&Word>,
        scope: Scope,
    ) -> Option<Vec<Spot>> {
        let level = runs.size() == 2;
        let mut out = Vec::with_capacity(runs.vector_count());
        for i in 0..runs.len() {
            let item = runs.item(i, &self.sources.get(runs.file()).text);
            let Value::Points { points, unit } = &item.value else { continue };
            let given = Given { span: item.span, home: item.span, constant: None, ..*given };
            self.ground_is_known(&given, level, scope)?;
            let named = unit.as_ref().or(shared);
            self.vectors_of(line, &given, points, named, 2..=3, &COORDINATE, &mut |v, _| {
                out.push(Spot { at: DVec3::from(v), on_surface: level });
            })?;
        }
        Some(out)
    }

    fn panel(&mut self, line: &Line<'a>, scope: Scope) -> Option<Shape> {
        let (items, clauses) = self.clauses(line);
        let material = self.first_reference(line, items, Kind::Material);
        self.surplus(line, items, 1);
        let size = clauses.get("size").and_then(|line| self.vector2(&line, &SIZE));
        let facing = self.facing(line, &clauses);
        let pose = self.pose(&clauses, scope);
        if let (Some(Facing::Point(point)), Some(pose)) = (facing, pose)
            && point == pose.at
            && !pose.on_surface
        {
            let span = clauses.get("facing").map_or(line.span(), |line| line.span());
            self.report(
                Diagnostic::error("G01", span, format!("this {} faces its own centre", line.key))
                    .label("another point?"),
            );
            return None;
        }
        Some(Shape::Panel { material: material?, size: size?, facing: facing?, pose: pose?, span: line.span() })
    }

    fn facing(&mut self, line: &Line<'a>, clauses: &Body<'a>) -> Option<Facing> {
        const DIRECTIONS: [(&str, DVec3); 6] = [
            ("up", DVec3::Z),
            ("down", DVec3::NEG_Z),
            ("north", DVec3::Y),
            ("east", DVec3::X),
            ("south", DVec3::NEG_Y),
            ("west", DVec3::NEG_X),
        ];
        let slope = clauses.get("slope");
        let aspect = clauses.get("aspect");
        if slope.is_some() != aspect.is_some() && !(clauses.said("slope") && clauses.said("aspect")) {
            let (there, lacks) = if slope.is_some() { ("slope", "aspect") } else { ("aspect", "slope") };
            let owner = Owner::new(format!("`{}`", line.key), line);
            self.missing("S05", &format!("`{there}` needs `{lacks}` beside it"), "slope ANGLE aspect ANGLE", &owner);
            return None;
        }
        if let (Some(slope), Some(aspect)) = (slope, aspect) {
            let tilt = Quantity::new(Dimension::Angle).within(0.0, std::f64::consts::PI);
            let (slope, aspect) = (self.quantity(&slope, &tilt), self.quantity(&aspect, &TURN));
            return Some(Facing::Slope { slope: slope?, aspect: aspect? });
        }
        let Some(line) = clauses.get("facing") else {
            return (!clauses.faulty.contains("facing")).then_some(Facing::Direction(DVec3::Z));
        };
        let Some(item) = line.items.first() else {
            self.absent(&line, "a direction, a point or a sensor");
            return None;
        };
        let mut own: Vec<&str> = DIRECTIONS.iter().map(|(word, _)| *word).collect();
        let sensors: Vec<&str> = self.names.of(Kind::Sensor).collect();
        own.extend(&sensors);
        let given = self.resolve(item, &own);
        let facing = match given.value {
            Value::Word(word) => match DIRECTIONS.iter().find(|(name, _)| name == word) {
                Some((_, direction)) => Facing::Direction(*direction),
                None => match self.names.find(Kind::Sensor, word) {
                    Some((sensor, _)) => Facing::Sensor(sensor),
                    None => {
                        if !self.excused(word) {
                            let near = self.near(word, own.iter().copied()).map(|near| format!("`{near}`?"));
                            let message = format!("`{word}` is no direction, and no sensor has that name");
                            let fault = self.misfit(&given, "N02", message).label(near.unwrap_or_default());
                            self.report(fault.help(format!("known: {}", own.join(", "))));
                        }
                        return None;
                    }
                },
            },
            Value::Points { .. } => return self.vector3(&line, &COORDINATE).map(Facing::Point),
            _ => {
                self.wrong(&line, &given, "a direction, a point or a sensor");
                return None;
            }
        };
        self.surplus(&line, line.items, 1);
        Some(facing)
    }

    fn solid_box(&mut self, line: &Line<'a>, scope: Scope) -> Option<Shape> {
        let (items, clauses) = self.clauses(line);
        let material = self.first_reference(line, items, Kind::Material);
        self.surplus(line, items, 1);
        let size = clauses.get("size").and_then(|line| self.vector3(&line, &SIZE));
        let pose = self.pose(&clauses, scope);
        Some(Shape::Box { material: material?, size: size?, pose: pose?, span: line.span() })
    }

    fn mesh(&mut self, line: &Line<'a>, scope: Scope) -> Option<Shape> {
        let (items, clauses) = self.clauses(line);
        let file = match items.first() {
            Some(item) => {
                let given = self.resolve(item, &[]);
                match given.value {
                    Value::Text(path) => Some(SceneFile { path: path.clone(), bytes: Arc::new([]), span: item.span }),
                    _ => {
                        self.wrong(line, &given, "a file, named in quotes");
                        None
                    }
                }
            }
            None => {
                self.absent(line, "a file, named in quotes");
                None
            }
        };
        self.surplus(line, items, 1);
        let metres = clauses.get("unit").and_then(|line| self.length_unit(&line));
        let y_up = clauses.get("up").map_or(Some("z"), |line| self.word_of(&line, &["y", "z"])).map(|up| up == "y");
        let pose = self.pose(&clauses, scope);
        let mut maps = Vec::new();
        let mut good = true;
        for map in clauses.all("map") {
            let (names, to) = self.clauses(&map);
            let name = self.text(&Line { items: names, ..map });
            let material = to.get("to").and_then(|to| {
                let material = self.first_reference(&to, to.items, Kind::Material);
                self.surplus(&to, to.items, 1);
                material
            });
            match (name, material) {
                (Some((name, _)), Some(material)) => maps.push((name.to_string(), material, map.span())),
                _ => good = false,
            }
        }
        if maps.is_empty() && good && !clauses.said("map") {
            let owner = Owner::new("a mesh", line);
            self.missing("G03", "no `map` says of what this mesh is made", "map \"*\" to MATERIAL", &owner);
            return None;
        }
        if let (Some(file), Some(item)) = (&file, items.first()) {
            self.meshes.insert(file.span, item);
        }
        let shape = Shape::Mesh { file: file?, unit: metres?, y_up: y_up?, pose: pose?, maps };
        good.then_some(shape)
    }

    fn length_unit(&mut self, line: &Line<'a>) -> Option<f64> {
        let Some(item) = line.items.first() else {
            self.absent(line, "a unit of length");
            return None;
        };
        if let Value::Word(word) = &item.value {
            if let Some(unit) = unit(word, Dimension::Length) {
                self.surplus(line, line.items, 1);
                return Some(unit.factor);
            }
            let names: Vec<&str> = units_of(Dimension::Length).map(|unit| unit.name).collect();
            let known = sunglint_radiometry::UNITS.iter().any(|unit| unit.name == word);
            let (code, what) = if known { ("U03", "no unit of length") } else { ("U01", "no unit") };
            let near = self.near(word, names.iter().copied()).unwrap_or("m");
            let fault = Diagnostic::error(code, item.span, format!("a mesh has a unit of length; `{word}` is {what}"));
            self.report(fault.label(format!("{near}? ({})", names.join(" "))));
        } else {
            let given = self.resolve(item, &[]);
            self.wrong(line, &given, "a unit of length");
        }
        None
    }

    fn place(&mut self, line: &Line<'a>, scope: Scope) -> Option<Shape> {
        let (items, clauses) = self.clauses(line);
        let object = self.first_reference(line, items, Kind::Object);
        self.surplus(line, items, 1);
        let name = match clauses.get("as") {
            Some(line) => match line.items {
                [Item { value: Value::Word(name), span }, ..] => {
                    let index = self.placements;
                    self.placements += 1;
                    self.declare(Kind::Placement, name, *span, index);
                    self.surplus(&line, line.items, 1);
                    Some(name.clone())
                }
                _ => {
                    self.absent(&line, "a name");
                    None
                }
            },
            None => None,
        };
        let poses = self.members_of_place(line, &clauses, scope);
        if clauses.faulty.contains("from") {
            return None;
        }
        Some(Shape::Place { object: object?, name, poses: poses?, span: line.span() })
    }

    fn members_of_place(&mut self, line: &Line<'a>, clauses: &Body<'a>, scope: Scope) -> Option<Vec<Pose>> {
        let turned = self.attitude(clauses);
        let places = match clauses.get("at") {
            None => Some(vec![Spot::ORIGIN]),
            Some(at) => match at.items.first().map(|item| self.resolve(item, &[])) {
                Some(given @ Given { value: Value::List { .. } | Value::Runs { .. }, span, .. }) => {
                    let named = Line { key: "at", ..at };
                    let mut out = Vec::new();
                    match given.value {
                        Value::Runs { runs, unit } => {
                            out = self.packed_positions(&named, &given, runs, unit.as_ref(), scope)?;
                        }
                        Value::List { rows, unit } => {
                            for item in rows.iter().flatten() {
                                out.extend(self.positions(&named, item, unit.as_ref(), scope)?);
                            }
                        }
                        _ => {}
                    }
                    self.surplus(&at, at.items, 1);
                    if out.is_empty() {
                        self.report(
                            Diagnostic::error("X01", span, "this list of places is empty").label("one point at least"),
                        );
                        return None;
                    }
                    Some(out)
                }
                _ => self.position(&at, scope).map(|point| vec![point]),
            },
        };
        if clauses.said("from") {
            return self.members_from_file(line, clauses, places?, turned?, scope);
        }
        let Some(grid) = clauses.get("grid") else {
            if let Some(spacing) = clauses.get("spacing")
                && !clauses.said("grid")
            {
                let message = "`spacing` belongs to a grid";
                self.report(Diagnostic::error("S05", spacing.span(), message).label("`grid M x N spacing (dx dy) m`?"));
                return None;
            }
            let turned = turned?;
            return Some(
                places?.into_iter().map(|Spot { at, on_surface }| Pose { at, on_surface, ..turned }).collect(),
            );
        };
        let Some(spacing) = clauses.get("spacing") else {
            if !clauses.said("spacing") {
                let owner = Owner::new("`grid`", line);
                self.missing("S05", "a grid needs `spacing`", "spacing (dx dy) m", &owner);
            }
            return None;
        };
        let (m, n) = self.grid(&grid, MOST_PLACED)?;
        let spacing = self.vector2(&spacing, &SIZE)?;
        if m.saturating_mul(n) > MOST_PLACED {
            let bytes = m.saturating_mul(n).saturating_mul(size_of::<Pose>() as u64) as f64 / 1e9;
            let message = format!("{m} x {n} members need {bytes:.0} GB");
            self.report(Diagnostic::error("G05", grid.span(), message).label(format!("at most {MOST_PLACED} members")));
            return None;
        }
        let (places, turned) = (places?, turned?);
        let [corner] = places.as_slice() else {
            let message = "a grid stands at one point, its south-west member";
            self.report(Diagnostic::error("S05", grid.span(), message).label("not beside a list of points"));
            return None;
        };
        let mut poses = Vec::with_capacity((m * n) as usize);
        for j in 0..n {
            for i in 0..m {
                let offset = spacing * DVec2::new(i as f64, j as f64);
                poses.push(Pose { at: corner.at + offset.extend(0.0), on_surface: corner.on_surface, ..turned });
            }
        }
        Some(poses)
    }

    /// `M x N`, both from 1 to a most.
    pub(super) fn grid(&mut self, line: &Line<'a>, most: u64) -> Option<(u64, u64)> {
        let Some(item) = line.items.first() else {
            self.absent(line, "columns x rows");
            return None;
        };
        let given = self.resolve(item, &[]);
        let Value::Grid(m, n) = *given.value else {
            self.wrong(line, &given, "columns x rows");
            return None;
        };
        if !(1..=most).contains(&m) || !(1..=most).contains(&n) {
            let message = format!("`{}` takes 1 to {most} columns and rows; `{m} x {n}` is not", line.key);
            let fault = self.misfit(&given, "U05", message).label(format!("1..{most} x 1..{most}"));
            self.report(fault);
            return None;
        }
        self.surplus(line, line.items, 1);
        Some((m, n))
    }

    /// Reports objects that place each other in a circle, too deep, or too many.
    pub(super) fn objects_are_finite(&mut self, objects: &[Object], world: &[Shape]) {
        let places = |shapes: &[Shape]| -> Vec<(usize, Span, u64)> {
            (shapes.iter())
                .filter_map(|shape| match shape {
                    Shape::Place { object, span, poses, .. } => Some((*object, *span, poses.len() as u64)),
                    Shape::Scatter(scatter) => Some((scatter.object, scatter.span, scatter.count)),
                    _ => None,
                })
                .collect()
        };
        let edges: Vec<Vec<(usize, Span, u64)>> = objects.iter().map(|object| places(&object.shapes)).collect();
        // Members that an object expands to; `None` while its own are being counted.
        let mut members: Vec<Option<u64>> = vec![None; objects.len()];
        let mut open = vec![false; objects.len()];
        let mut depth = vec![0usize; objects.len()];
        for root in 0..objects.len() {
            let mut stack = vec![(root, 0)];
            while let Some((object, next)) = stack.pop() {
                if members[object].is_some() {
                    continue;
                }
                open[object] = true;
                match edges[object].get(next) {
                    Some((child, span, _)) if open[*child] => {
                        let mut path: Vec<usize> = stack.iter().map(|(object, _)| *object).collect();
                        path.push(object);
                        let start = path.iter().position(|o| o == child).unwrap_or(0);
                        let names: Vec<&str> =
                            path[start..].iter().chain([child]).map(|o| objects[*o].name.as_str()).collect();
                        let message = format!("objects place each other without end: {}", super::circle(&names));
                        self.report(Diagnostic::error("N04", *span, message).label("this closes the circle"));
                        return;
                    }
                    Some((child, ..)) => {
                        stack.push((object, next + 1));
                        stack.push((*child, 0));
                    }
                    None => {
                        open[object] = false;
                        let sum = edges[object].iter().fold(1u64, |sum, (child, _, n)| {
                            sum.saturating_add(n.saturating_mul(members[*child].unwrap_or(1)))
                        });
                        members[object] = Some(sum);
                        let deepest = edges[object].iter().max_by_key(|(child, ..)| depth[*child]);
                        let Some((child, span, _)) = deepest else { continue };
                        depth[object] = depth[*child] + 1;
                        if depth[object] == DEEPEST {
                            let message = format!("objects place each other more than {DEEPEST} deep");
                            self.report(
                                Diagnostic::error("G05", *span, message).label("place it in the scene itself?"),
                            );
                            return;
                        }
                    }
                }
            }
        }
        let mut total = 0u64;
        for (object, span, n) in places(world) {
            let here = n.saturating_mul(members[object].unwrap_or(1));
            total = total.saturating_add(here);
            if total > MOST_EXPANDED {
                let gigabytes = total.saturating_mul(BYTES_PLACED) as f64 / 1e9;
                let message = if total == here {
                    format!("this places {total} objects, objects within objects counted each: {gigabytes:.0} GB")
                } else {
                    format!("with this the scene places {total} objects: {gigabytes:.0} GB")
                };
                self.report(
                    Diagnostic::error("G05", span, message).label(format!("at most {MOST_EXPANDED} in a scene")),
                );
                return;
            }
        }
    }

    /// Which objects are placed, at any depth.
    pub(super) fn placed(objects: &[Object], world: &[Shape]) -> BTreeSet<usize> {
        let mut placed = BTreeSet::new();
        let mut waiting: Vec<&[Shape]> = vec![world];
        while let Some(shapes) = waiting.pop() {
            for shape in shapes {
                if let Shape::Place { object, .. } | Shape::Scatter(Scatter { object, .. }) = shape
                    && placed.insert(*object)
                {
                    waiting.push(&objects[*object].shapes);
                }
            }
        }
        placed
    }

    /// Reads the files of the meshes in some shapes.
    pub(super) fn read_meshes(&mut self, shapes: &mut [Shape]) {
        for shape in shapes {
            let Shape::Mesh { file, .. } = shape else { continue };
            let Some(item) = self.meshes.get(&file.span).copied() else { continue };
            let given = self.resolve(item, &[]);
            let Value::Text(path) = given.value else { continue };
            if let Some(Opened::File(loaded)) = self.open(&given, path) {
                (file.path, file.bytes) = (loaded.path, loaded.bytes);
            }
        }
    }
}

/// The materials that shapes refer to.
pub(super) fn materials_of(shapes: &[Shape]) -> Vec<usize> {
    let mut out = Vec::new();
    for shape in shapes {
        match shape {
            Shape::Facets { material, .. }
            | Shape::Panel { material, .. }
            | Shape::Box { material, .. }
            | Shape::Disk { material, .. }
            | Shape::Solid { material, .. } => out.push(*material),
            Shape::Mesh { maps, .. } => out.extend(maps.iter().map(|(_, material, _)| *material)),
            Shape::Place { .. } | Shape::Scatter(_) => {}
        }
    }
    out
}
