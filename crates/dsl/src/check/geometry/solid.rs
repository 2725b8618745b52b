//! `disk`, `cylinder`, `cone` and `sphere`.

use super::{AT, HEADING, PITCH, ROLL, SCALED, Scope};
use crate::Diagnostic;
use crate::check::Checker;
use crate::check::block::{Body, Line, Rule, rule};
use crate::check::names::Kind;
use crate::check::value::SIZE;
use crate::scene::{Facing, Shape, Solid};

const RADIUS: Rule = rule("radius", "radius LENGTH").required();
const HEIGHT: Rule = rule("height", "height LENGTH").required();
const SIDES: Rule = rule("sides", "sides COUNT");

pub(in crate::check) const DISK: &[Rule] = &[
    RADIUS,
    SIDES,
    rule("facing", "facing up|down|north|east|south|west|POINT|SENSOR").word().excludes(&["slope", "aspect"]),
    rule("slope", "slope ANGLE aspect ANGLE").excludes(&["facing"]),
    rule("aspect", "slope ANGLE aspect ANGLE").excludes(&["facing"]),
    AT,
    HEADING,
    PITCH,
    ROLL,
    SCALED,
];
pub(in crate::check) const UPRIGHT: &[Rule] = &[RADIUS, HEIGHT, SIDES, AT, HEADING, PITCH, ROLL, SCALED];
pub(in crate::check) const SPHERE: &[Rule] = &[RADIUS, SIDES, AT, HEADING, PITCH, ROLL, SCALED];

/// Sides of a circle: what is said of none, and the most. A sphere has half the square of them as facets.
const USUAL_SIDES: u32 = 32;
const MOST_SIDES: u64 = 2048;

impl<'a> Checker<'a> {
    pub(super) fn disk(&mut self, line: &Line<'a>, scope: Scope) -> Option<Shape> {
        let (items, clauses) = self.clauses(line);
        let material = self.first_reference(line, items, Kind::Material);
        self.surplus(line, items, 1);
        let radius = self.optional(clauses.get("radius"), &SIZE);
        let sides = self.sides(&clauses);
        let facing = self.facing(line, &clauses);
        let pose = self.pose(&clauses, scope);
        if let (Some(Facing::Point(point)), Some(pose)) = (facing, pose)
            && point == pose.at
            && !pose.on_surface
        {
            let span = clauses.get("facing").map_or(line.span(), |line| line.span());
            self.report(Diagnostic::error("G01", span, "this disk faces its own centre").label("another point?"));
            return None;
        }
        let (facing, pose) = (facing?, pose?);
        Some(Shape::Disk { material: material?, radius: radius?, sides: sides?, facing, pose, span: line.span() })
    }

    /// A cylinder, cone or sphere.
    pub(super) fn solid(&mut self, line: &Line<'a>, scope: Scope) -> Option<Shape> {
        let (items, clauses) = self.clauses(line);
        let material = self.first_reference(line, items, Kind::Material);
        self.surplus(line, items, 1);
        let radius = self.optional(clauses.get("radius"), &SIZE);
        let height = self.optional(clauses.get("height"), &SIZE);
        let sides = self.sides(&clauses);
        let pose = self.pose(&clauses, scope);
        let form = match line.key {
            "cylinder" => Solid::Cylinder { radius: radius?, height: height? },
            "cone" => Solid::Cone { radius: radius?, height: height? },
            _ => Solid::Sphere { radius: radius? },
        };
        Some(Shape::Solid { material: material?, form, sides: sides?, pose: pose?, span: line.span() })
    }

    fn sides(&mut self, clauses: &Body<'a>) -> Option<u32> {
        match clauses.get("sides") {
            Some(line) => self.count(&line, 3, MOST_SIDES).map(|sides| sides as u32),
            None => Some(USUAL_SIDES),
        }
    }
}
