//! Legends beside the data, and the marks of series.

use super::colour::{self, Colour};
use super::picture::{Anchor, Mark, Picture, Point, Stroke};
use super::{Series, Style, colours, typeface};

/// Size of letters: title, captions, ticks and legends.
pub(super) const TITLE: f64 = 15.0;
pub(super) const CAPTION: f64 = 13.0;
pub(super) const TICK: f64 = 12.0;
const ROW: f64 = 19.0;
const SAMPLE: f64 = 26.0;
const COLUMNS: usize = 3;

/// Names of series with what stands for them, in columns no higher than a height.
pub(super) struct Legend<'s> {
    rows: Vec<(&'s Series, usize)>,
    in_column: usize,
    widths: Vec<f64>,
    left_out: usize,
}

impl<'s> Legend<'s> {
    pub fn new(series: &'s [Series], height: f64) -> Self {
        let mut rows: Vec<_> = series.iter().zip(colours(series)).filter(|(s, _)| !s.name.is_empty()).collect();
        let in_column = ((height / ROW) as usize).max(1);
        let left_out = rows.len().saturating_sub(in_column * COLUMNS);
        if left_out > 0 {
            rows.truncate(in_column * COLUMNS - 1);
        }
        let width = |rows: &[(&Series, usize)]| {
            rows.iter().map(|(s, _)| typeface::width(&s.name, TICK)).fold(60.0, f64::max) + SAMPLE + 16.0
        };
        let widths = rows.chunks(in_column).map(width).collect();
        let left_out = if left_out > 0 { left_out + 1 } else { 0 };
        Self { rows, in_column, widths, left_out }
    }

    pub fn width(&self) -> f64 {
        if self.rows.is_empty() { 0.0 } else { 14.0 + self.widths.iter().sum::<f64>() }
    }

    pub fn draw(&self, picture: &mut Picture, corner: Point) {
        let mut left = corner.0 + 14.0;
        for (rows, width) in self.rows.chunks(self.in_column).zip(&self.widths) {
            for (i, (series, number)) in rows.iter().enumerate() {
                let y = corner.1 + ROW * (i as f64 + 0.5);
                if let Some(stroke) = stroke(series.style, *number) {
                    picture.line(vec![(left, y), (left + SAMPLE, y)], stroke);
                }
                if let Some(mark) = symbol(series.style, *number, (left + 0.5 * SAMPLE, y), 1.0) {
                    picture.draw(mark);
                }
                picture.text((left + SAMPLE + 7.0, y + 0.35 * TICK), &series.name, TICK, Anchor::Start);
            }
            left += width;
        }
        if self.left_out > 0 {
            let rows = self.rows.len() % self.in_column;
            let x = left - self.widths.last().copied().unwrap_or(0.0);
            let y = corner.1 + ROW * (rows as f64 + 0.5);
            picture.text((x, y + 0.35 * TICK), &format!("and {} more", self.left_out), TICK, Anchor::Start);
        }
    }
}

fn colour_of(style: Style, number: usize) -> Colour {
    if style == Style::Reference { colour::GREY } else { colour::of_series(number) }
}

/// The line of a series, if it has one. Where colours recur, dashes tell lines apart.
pub(super) fn stroke(style: Style, number: usize) -> Option<Stroke> {
    const DASHES: [&[f64]; 4] = [&[], &[7.0, 3.0], &[2.0, 2.5], &[8.0, 2.5, 2.0, 2.5]];
    let round = colour::round_of(number);
    let dashes = match style {
        Style::Points => return None,
        Style::Reference => &[],
        Style::Dashed => DASHES[1 + round % 3],
        Style::Line | Style::Marked => DASHES[round % 4],
    };
    let width = if style == Style::Reference { 1.0 } else { 1.8 };
    Some(Stroke { colour: colour_of(style, number), width, dashes })
}

/// The mark of a series at a place, if it has one: a form for each colour.
pub(super) fn symbol(style: Style, number: usize, (x, y): Point, opacity: f64) -> Option<Mark> {
    if !matches!(style, Style::Points | Style::Marked) {
        return None;
    }
    let colour = colour_of(style, number);
    let corners = |list: &[Point]| list.iter().map(|(u, v)| (x + 3.6 * u, y + 3.6 * v)).collect();
    let form: &[Point] = match (number + colour::round_of(number)) % 6 {
        0 => return Some(Mark::Disk { centre: (x, y), radius: 3.4, colour, opacity }),
        1 => &[(-0.85, -0.85), (0.85, -0.85), (0.85, 0.85), (-0.85, 0.85)],
        2 => &[(0.0, -1.15), (1.05, 0.75), (-1.05, 0.75)],
        3 => &[(0.0, -1.25), (1.25, 0.0), (0.0, 1.25), (-1.25, 0.0)],
        4 => &[(0.0, 1.15), (1.05, -0.75), (-1.05, -0.75)],
        _ => &[
            (-0.35, -1.1),
            (0.35, -1.1),
            (0.35, -0.35),
            (1.1, -0.35),
            (1.1, 0.35),
            (0.35, 0.35),
            (0.35, 1.1),
            (-0.35, 1.1),
            (-0.35, 0.35),
            (-1.1, 0.35),
            (-1.1, -0.35),
            (-0.35, -0.35),
        ],
    };
    Some(Mark::Area { points: corners(form), colour, opacity })
}

/// Draws a title over a width and returns the height that it takes.
pub(super) fn title(picture: Option<&mut Picture>, text: &str, left: f64, width: f64) -> f64 {
    let lines = typeface::lines(text, TITLE, width);
    if let Some(picture) = picture {
        for (i, line) in lines.iter().enumerate() {
            let at = (left + 0.5 * width, 10.0 + (TITLE + 4.0) * (i as f64 + 0.75));
            picture.text(at, line, TITLE, Anchor::Middle);
        }
    }
    // A word may be wider than all lines should be: the caller makes room by `title_width`.
    if lines.is_empty() { 10.0 } else { 16.0 + (TITLE + 4.0) * lines.len() as f64 }
}

/// Width of the widest line of a title broken at `width`.
pub(super) fn title_width(text: &str, width: f64) -> f64 {
    typeface::lines(text, TITLE, width).iter().map(|line| typeface::width(line, TITLE)).fold(0.0, f64::max)
}
