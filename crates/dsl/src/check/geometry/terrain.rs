//! `terrain`.

use crate::Diagnostic;
use crate::check::Checker;
use crate::check::block::{Body, Braces, Line, Owner, Rule, rule};
use crate::check::names::Kind;
use crate::check::value::{COORDINATE, SIZE};
use crate::scene::Terrain;

const TERRAIN: &[Rule] = &[
    rule("origin", "origin (x y) m"),
    rule("spacing", "spacing LENGTH"),
    rule("material", "material MATERIAL").required().word(),
    rule("classes", "classes FILE"),
    rule("map", "map CLASS to MATERIAL").many().clauses(&[rule("to", "to MATERIAL").required().word()]),
];

/// A surface over a grid of heights; outside objects, and one.
pub(in crate::check) const TERRAIN_RULE: Rule =
    rule("terrain", "terrain FILE { origin (x y) m, spacing LENGTH, material MATERIAL }")
        .leading(1)
        .clauses(TERRAIN)
        .braces(Braces::Clauses);

/// What may be unsaid, but not said wrongly.
pub(super) fn sound<T>(said: Option<Option<T>>) -> Option<Option<T>> {
    said.map_or(Some(None), |value| value.map(Some))
}

impl<'a> Checker<'a> {
    pub(in crate::check) fn terrain(&mut self, top: &Body<'a>) -> Option<Terrain> {
        let line = top.get("terrain")?;
        let (items, clauses) = self.clauses(&line);
        let heights = match items.first() {
            Some(item) => self.scene_file(&line, item),
            None => {
                self.absent(&line, "a file, named in quotes");
                None
            }
        };
        self.surplus(&line, items, 1);
        let origin = clauses.get("origin").map(|line| self.vector2(&line, &COORDINATE));
        let spacing = clauses.get("spacing").map(|line| self.quantity(&line, &SIZE));
        let material = clauses.get("material").and_then(|line| {
            let material = self.first_reference(&line, line.items, Kind::Material);
            self.surplus(&line, line.items, 1);
            material
        });
        let classes = clauses.get("classes").map(|line| {
            let Some(item) = line.items.first() else {
                self.absent(&line, "a file, named in quotes");
                return None;
            };
            self.surplus(&line, line.items, 1);
            self.scene_file(&line, item)
        });
        let (maps, good) = self.class_maps(&clauses);
        let owner = Owner::new("a terrain", &line);
        match (classes.is_some(), clauses.get("map")) {
            (true, None) if !clauses.said("map") => {
                self.missing("G03", "no `map` says of what these classes are made", "map CLASS to MATERIAL", &owner);
            }
            (false, Some(map)) if !clauses.said("classes") => {
                let message = "`map` needs `classes`, the file that says where each class lies";
                self.report(Diagnostic::error("S05", map.span(), message).label("`classes FILE`?"));
            }
            _ => {}
        }
        let terrain = Terrain {
            heights: heights?,
            origin: sound(origin)?,
            spacing: sound(spacing)?,
            material: material?,
            classes: sound(classes)?,
            maps,
            span: line.span(),
        };
        good.then_some(terrain)
    }

    /// Classes to materials, and whether all are sound.
    fn class_maps(&mut self, clauses: &Body<'a>) -> (Vec<(u32, usize, crate::Span)>, bool) {
        let mut maps: Vec<(u32, usize, crate::Span)> = Vec::new();
        let mut good = !clauses.faulty.contains("map");
        for map in clauses.all("map") {
            let (codes, to) = self.clauses(&map);
            let class = self.count(&Line { items: codes, ..map }, 0, u64::from(u32::MAX));
            let material = to.get("to").and_then(|to| {
                let material = self.first_reference(&to, to.items, Kind::Material);
                self.surplus(&to, to.items, 1);
                material
            });
            let (Some(class), Some(material)) = (class, material) else {
                good = false;
                continue;
            };
            match maps.iter().find(|(known, ..)| u64::from(*known) == class) {
                Some((.., first)) => {
                    let fault = Diagnostic::error("S05", map.span(), format!("class {class} is mapped twice"));
                    let fault = fault.label("mapped again").note(*first, "first mapped here");
                    self.report(fault);
                    good = false;
                }
                None => maps.push((class as u32, material, map.span())),
            }
        }
        (maps, good)
    }
}
