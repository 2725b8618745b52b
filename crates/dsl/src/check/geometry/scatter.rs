//! `scatter`.

use super::terrain::sound;
use super::{AT, HEADING, MOST_PLACED, PITCH, ROLL, SCALED, Scope};
use crate::Diagnostic;
use crate::check::Checker;
use crate::check::block::{Body, Line, Owner, Rule, rule};
use crate::check::names::Kind;
use crate::check::value::{Quantity, SCALE, SIZE, TURN};
use crate::scene::{Leaves, Pose, Region, Scatter, Shape};

pub(in crate::check) const SCATTER: &[Rule] = &[
    rule("count", "count COUNT").required(),
    rule("within", "within sphere|cylinder|box|rectangle").required().word().leading(1).clauses(REGION),
    AT,
    HEADING,
    PITCH,
    ROLL,
    SCALED,
    rule("spacing", "spacing LENGTH"),
    rule("orientation", "orientation spherical|uniform|planophile|erectophile|plagiophile|extremophile").word(),
    rule("seed", "seed COUNT"),
];
const REGION: &[Rule] =
    &[rule("radius", "radius LENGTH"), rule("height", "height LENGTH"), rule("size", "size (x y z) m")];

/// Regions, and what each says.
const REGIONS: [(&str, &[(&str, &str)]); 4] = [
    ("sphere", &[("radius", "radius LENGTH")]),
    ("cylinder", &[("radius", "radius LENGTH"), ("height", "height LENGTH")]),
    ("box", &[("size", "size (x y z) m")]),
    ("rectangle", &[("size", "size (x y) m")]),
];
const LEAVES: [(&str, Leaves); 6] = [
    ("spherical", Leaves::Spherical),
    ("uniform", Leaves::Uniform),
    ("planophile", Leaves::Planophile),
    ("erectophile", Leaves::Erectophile),
    ("plagiophile", Leaves::Plagiophile),
    ("extremophile", Leaves::Extremophile),
];

impl<'a> Checker<'a> {
    pub(super) fn scatter(&mut self, line: &Line<'a>, scope: Scope) -> Option<Shape> {
        let (items, clauses) = self.clauses(line);
        let object = self.first_reference(line, items, Kind::Object);
        self.surplus(line, items, 1);
        let count = clauses.get("count").and_then(|line| self.members_at_most(&line));
        let region = clauses.get("within").and_then(|line| self.region(&line));
        let heading = self.spread(&clauses, "heading", &TURN, 0.0);
        let scale = self.spread(&clauses, "scale", &SCALE, 1.0);
        let pose = self.frame(&clauses, scope);
        let spacing = clauses.get("spacing").map(|line| self.quantity(&line, &SIZE));
        let leaves = clauses.get("orientation").map(|line| {
            let word = self.word_of(&line, &LEAVES.map(|(word, _)| word))?;
            LEAVES.iter().find(|(known, _)| *known == word).map(|(_, leaves)| *leaves)
        });
        let seed = match clauses.get("seed") {
            Some(line) => self.count(&line, 0, u64::MAX),
            None => Some(1),
        };
        let (heading, pose) = (heading?, pose?);
        let turns = heading.0 < heading.1;
        if let (Some(orientation), true, Some(line)) = (clauses.get("orientation"), turns, clauses.get("heading")) {
            let message = "an `orientation` turns every member about the vertical; a range of headings does too";
            let fault = Diagnostic::error("S05", line.span(), message).label("say only one of them");
            self.report(fault.note(orientation.span(), "`orientation` is said here"));
            return None;
        }
        let pose = Pose { heading: if turns { 0.0 } else { heading.0 }, ..pose };
        let heading = if turns { heading } else { (0.0, 0.0) };
        let (object, count, region) = (object?, count?, region?);
        let (scale, spacing, leaves) = (scale?, sound(spacing)?, sound(leaves)?);
        let (seed, span) = (seed?, line.span());
        Some(Shape::Scatter(Scatter { object, count, region, pose, scale, heading, spacing, leaves, seed, span }))
    }

    fn members_at_most(&mut self, line: &Line<'a>) -> Option<u64> {
        let count = self.count(line, 1, u64::MAX)?;
        if count > MOST_PLACED {
            let bytes = count.saturating_mul(500) as f64 / 1e9;
            let fault = Diagnostic::error("G05", line.span(), format!("{count} members need about {bytes:.0} GB"));
            self.report(fault.label(format!("at most {MOST_PLACED} members")));
            return None;
        }
        Some(count)
    }

    fn region(&mut self, line: &Line<'a>) -> Option<Region> {
        let (names, clauses) = self.clauses(line);
        let Some(item) = names.first() else {
            self.absent(line, "a region: sphere, cylinder, box or rectangle");
            return None;
        };
        let kind = self.choose(line, item, &REGIONS.map(|(kind, _)| kind))?;
        self.surplus(line, names, 1);
        let (_, due) = REGIONS.iter().find(|(known, _)| *known == kind)?;
        let owner = Owner::new(format!("a {kind}"), line);
        let mut complete = true;
        for (key, form) in *due {
            if !clauses.said(key) {
                self.missing("S05", &format!("a {kind} needs `{key}`"), form, &owner);
            }
            complete &= clauses.get(key).is_some();
        }
        for said in clauses.lines.iter().filter(|said| due.iter().all(|(key, _)| *key != said.key)) {
            let forms: Vec<&str> = due.iter().map(|(_, form)| *form).collect();
            let fault = Diagnostic::error("S05", said.span(), format!("a {kind} has no `{}`", said.key));
            self.report(fault.label(format!("`{kind} {}`?", forms.join(" "))));
            complete = false;
        }
        if !complete {
            return None;
        }
        let radius = self.optional(clauses.get("radius"), &SIZE);
        let height = self.optional(clauses.get("height"), &SIZE);
        let size = clauses.get("size");
        Some(match kind {
            "sphere" => Region::Sphere { radius: radius? },
            "cylinder" => Region::Cylinder { radius: radius?, height: height? },
            "box" => Region::Box { size: self.vector3(&size?, &SIZE)? },
            _ => Region::Rectangle { size: self.vector2(&size?, &SIZE)? },
        })
    }

    /// One value, or a range from which every member draws its own.
    fn spread(&mut self, clauses: &Body<'a>, key: &str, q: &Quantity, unsaid: f64) -> Option<(f64, f64)> {
        let Some(line) = clauses.get(key) else { return Some((unsaid, unsaid)) };
        match line.items.first() {
            Some(item) if self.is_range(&line) => {
                let given = self.resolve(item, &[]);
                let range = self.range_of(&line, &given, q);
                self.surplus(&line, line.items, 1);
                range
            }
            _ => self.quantity(&line, q).map(|value| (value, value)),
        }
    }

    /// Position, pitch and roll of the whole.
    fn frame(&mut self, clauses: &Body<'a>, scope: Scope) -> Option<Pose> {
        let lines = clauses.lines.iter().filter(|line| matches!(line.key, "at" | "pitch" | "roll")).copied().collect();
        self.pose(&Body { lines, faulty: clauses.faulty.clone(), obscure: clauses.obscure }, scope)
    }
}
