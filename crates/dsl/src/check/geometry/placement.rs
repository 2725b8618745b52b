//! `place … from FILE`.

use glam::DVec3;
use std::f64::consts::TAU;
use sunglint_plugin::Column;
use sunglint_radiometry::Dimension;

use super::{MOST_PLACED, Scope, Spot};
use crate::Diagnostic;
use crate::ast::Value;
use crate::check::Checker;
use crate::check::block::{Body, Line};
use crate::scene::Pose;
use crate::table::{Wanted, read_columns};

const fn wanted(name: &'static str, dimension: Dimension, required: bool, most: f64) -> Wanted {
    Wanted { column: Column { name, dimension, range: (-most, most) }, required, code: "U05" }
}

/// x and y, and what may be missing.
const COLUMNS: [Wanted; 7] = [
    wanted("x", Dimension::Length, true, 1e9),
    wanted("y", Dimension::Length, true, 1e9),
    wanted("z", Dimension::Length, false, 1e9),
    wanted("heading", Dimension::Angle, false, TAU),
    wanted("pitch", Dimension::Angle, false, TAU),
    wanted("roll", Dimension::Angle, false, TAU),
    Wanted {
        column: Column { name: "scale", dimension: Dimension::Fraction, range: (f64::MIN_POSITIVE, 1e9) },
        required: false,
        code: "G04",
    },
];

impl<'a> Checker<'a> {
    /// A member a row. The statement's `at`, heading, pitch and roll are added to the row's, its scale multiplies.
    pub(super) fn members_from_file(
        &mut self,
        line: &Line<'a>,
        clauses: &Body<'a>,
        places: Vec<Spot>,
        turned: Pose,
        scope: Scope,
    ) -> Option<Vec<Pose>> {
        let (path, given) = self.text(&clauses.get("from")?)?;
        let [shift] = places.as_slice() else {
            let message = "`from` takes one point for `at`, by which all rows are shifted";
            self.report(Diagnostic::error("S05", line.span(), message).label("not a list of points"));
            return None;
        };
        if let Some(spacing) = clauses.get("spacing") {
            let message = "`spacing` belongs to a grid";
            self.report(Diagnostic::error("S05", spacing.span(), message).label("`grid M x N spacing (dx dy) m`?"));
            return None;
        }
        let Some((shown, text)) = self.file_text(&given, path)? else { return Some(Vec::new()) };
        let columns = match read_columns(&text, &COLUMNS) {
            Ok(columns) => columns,
            Err(faults) => {
                for fault in faults {
                    self.table_fault(&given, &shown, &text, fault);
                }
                return None;
            }
        };
        let n = columns[0].as_ref().map_or(0, Vec::len);
        if n as u64 > MOST_PLACED {
            let bytes = (n * size_of::<Pose>()) as f64 / 1e9;
            let fault = self.misfit(&given, "G05", format!("{shown}: {n} members need {bytes:.0} GB"));
            self.report(fault.label(format!("at most {MOST_PLACED} members")));
            return None;
        }
        let on_surface = columns[2].is_none();
        if on_surface && matches!(scope, Scope::Object) {
            let message =
                format!("{shown}: without a column `z_m` members stand on the ground, which an object does not know");
            let fault = self.misfit(&given, "G04", message);
            self.report(fault.label("a column `z_m`?"));
            return None;
        }
        let cell = |column: usize, row: usize| columns[column].as_ref().map(|values| values[row]);
        let poses = (0..n).map(|row| {
            let or = |column, unsaid| cell(column, row).unwrap_or(unsaid);
            Pose {
                at: DVec3::new(or(0, 0.0), or(1, 0.0), or(2, 0.0)) + shift.at,
                on_surface,
                heading: or(3, 0.0) + turned.heading,
                pitch: or(4, 0.0) + turned.pitch,
                roll: or(5, 0.0) + turned.roll,
                scale: or(6, 1.0) * turned.scale,
            }
        });
        Some(poses.collect())
    }

    /// Whether a value is a range.
    pub(super) fn is_range(&self, line: &Line<'a>) -> bool {
        let mut value = line.items.first().map(|item| &item.value);
        while let Some(Value::Word(word)) = value
            && let Some((item, _)) = self.constants.get(word.as_str())
        {
            value = Some(&item.value);
        }
        matches!(value, Some(Value::Range { .. }))
    }
}
