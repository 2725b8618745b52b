//! Lines and scatter over two axes.

use super::axis::Fitted;
use super::colour;
use super::legend::{self, CAPTION, Legend, TICK};
use super::picture::{Anchor, Mark, Picture, Point, Rect, Stroke};
use super::{Axis, Series, Style, colours, raster, typeface};

/// More marks than this become one raster, in SVG too.
const MOST_MARKS: usize = 4000;

/// Lines and scatter over two axes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Plot {
    /// Title; long ones are broken into lines.
    pub title: String,
    /// Across.
    pub x: Axis,
    /// Up.
    pub y: Axis,
    /// What is drawn, the last on top.
    pub series: Vec<Series>,
    /// One range and one scale for both axes, as a scatter plot about its unity line wants.
    pub square: bool,
}

impl Plot {
    /// With the line y = x under the data.
    #[must_use]
    pub fn with_unity_line(mut self) -> Self {
        let values = || self.series.iter().flat_map(|s| &s.points).flat_map(|(x, y)| [*x, *y]);
        let low = values().filter(|v| v.is_finite()).fold(f64::INFINITY, f64::min);
        let high = values().filter(|v| v.is_finite()).fold(f64::NEG_INFINITY, f64::max);
        if low <= high {
            // Beyond the data, as far as the rounded axes go.
            let reach = high - low;
            let points = vec![(low - reach, low - reach), (high + reach, high + reach)];
            self.series.insert(0, Series::new("unity", points, Style::Reference));
        }
        self
    }

    /// Lays the plot out.
    pub fn picture(&self) -> Picture {
        let (width, height) = if self.square { (400.0, 400.0) } else { (540.0, 340.0) };
        // Reference lines show what is asked of the data, they do not widen the axes.
        let data = || {
            let only_references = self.series.iter().all(|s| s.style == Style::Reference);
            (self.series.iter()).filter(move |s| only_references || s.style != Style::Reference).flat_map(|s| &s.points)
        };
        let drawn = || data().filter(|(x, y)| x.is_finite() && y.is_finite());
        let (x, y) = if self.square {
            let both = || drawn().flat_map(|(x, y)| [*x, *y]);
            (self.x.fit(both(), 5), self.y.fit(both(), 5))
        } else {
            (self.x.fit(drawn().map(|p| p.0), 9), self.y.fit(drawn().map(|p| p.1), 5))
        };
        let numbers = y.ticks.iter().map(|(_, text)| typeface::width(text, TICK)).fold(0.0, f64::max);
        let left = 12.0 + CAPTION + 10.0 + numbers + 8.0;
        let title_room = legend::title_width(&self.title, width + left);
        let factor_room = if y.factor().is_some() { TICK + 4.0 } else { 0.0 };
        let top = legend::title(None, &self.title, 0.0, title_room.max(width)) + 4.0 + factor_room;
        let place = Rect { left, top, right: left + width, bottom: top + height };
        let legend = Legend::new(&self.series, height);
        let last = x.ticks.last().map_or(0.0, |(_, text)| 0.5 * typeface::width(text, TICK));
        let beyond = 0.5 * (title_room - width);
        let factor = x.factor().map_or(0.0, |text| typeface::width(&text, TICK) + 8.0);
        let right = (legend.width().max(last).max(beyond).max(factor)) + 14.0;
        let bottom = place.bottom + 8.0 + TICK + 8.0 + CAPTION + 14.0;
        let caption = |axis: &Axis| typeface::width(&axis.caption(), CAPTION);
        let overhang = (0.5 * (caption(&self.x) - width)).max(0.0);
        let shift = (beyond - left + 14.0).max(overhang - left + 14.0).max(0.0);
        let place = Rect { left: place.left + shift, right: place.right + shift, ..place };
        let mut picture = Picture::new(&self.title, place.right + right.max(overhang + 14.0), bottom);
        let title_left = place.left + 0.5 * (width - title_room.max(width));
        legend::title(Some(&mut picture), &self.title, title_left, title_room.max(width));
        frame(&mut picture, place, (&self.x, &x), (&self.y, &y));
        self.draw_series(&mut picture, place, &x, &y);
        legend.draw(&mut picture, (place.right, place.top));
        picture
    }

    fn draw_series(&self, picture: &mut Picture, place: Rect, x: &Fitted, y: &Fitted) {
        let numbers = colours(&self.series);
        let at = |(u, v): &Point| -> Option<Point> {
            let p = (place.left + x.share(*u) * place.width(), place.bottom - y.share(*v) * place.height());
            (p.0.is_finite() && p.1.is_finite()).then_some(p)
        };
        for (series, number) in self.series.iter().zip(numbers) {
            if let Some(stroke) = legend::stroke(series.style, number) {
                let places: Vec<Option<Point>> = series.points.iter().map(at).collect();
                for run in places.split(Option::is_none) {
                    let run: Vec<Point> = run.iter().copied().flatten().collect();
                    for points in clipped(&run, grown(place, 4.0)) {
                        picture.draw_within(grown(place, 0.5), Mark::Line { points, stroke: stroke.clone() });
                    }
                }
            }
            let seen = grown(place, 0.01);
            let inside = |p: &Point| (seen.left..=seen.right).contains(&p.0) && (seen.top..=seen.bottom).contains(&p.1);
            let places: Vec<Point> = series.points.iter().filter_map(at).filter(inside).collect();
            // Dense clouds are drawn finer and fainter, so that their inside is seen.
            let (size, opacity) = match places.len() {
                0..200 => (1.0, 0.9),
                200..2000 => (0.75, 0.6),
                2000..20_000 => (0.45, 0.45),
                _ => (0.3, 0.3),
            };
            let marks: Vec<Mark> =
                places.iter().filter_map(|p| legend::symbol(series.style, number, *p, size, opacity)).collect();
            if marks.len() > MOST_MARKS {
                let place = grown(place, 5.0);
                let pixels = raster::layer(place, &marks, 2.0);
                picture.draw(Mark::Image { place, pixels });
            } else {
                marks.into_iter().for_each(|mark| picture.draw(mark));
            }
        }
    }
}

fn grown(place: Rect, by: f64) -> Rect {
    Rect { left: place.left - by, top: place.top - by, right: place.right + by, bottom: place.bottom + by }
}

/// Grid, ticks, numbers, captions and frame of two axes.
pub(super) fn frame(picture: &mut Picture, place: Rect, (x, fx): (&Axis, &Fitted), (y, fy): (&Axis, &Fitted)) {
    let across = |v: f64| place.left + fx.share(v) * place.width();
    let up = |v: f64| place.bottom - fy.share(v) * place.height();
    let grid = || Stroke::new(colour::GRID, 0.8);
    let edge = || Stroke::new(colour::BLACK, 1.0);
    for (value, text) in &fx.ticks {
        let at = across(*value);
        let long = if text.is_empty() { 3.0 } else { 5.0 };
        if !text.is_empty() {
            picture.line(vec![(at, place.top), (at, place.bottom)], grid());
        }
        picture.line(vec![(at, place.bottom), (at, place.bottom + long)], edge());
        picture.text((at, place.bottom + 8.0 + 0.85 * TICK), text, TICK, Anchor::Middle);
    }
    for (value, text) in &fy.ticks {
        let at = up(*value);
        let long = if text.is_empty() { 3.0 } else { 5.0 };
        if !text.is_empty() {
            picture.line(vec![(place.left, at), (place.right, at)], grid());
        }
        picture.line(vec![(place.left - long, at), (place.left, at)], edge());
        picture.text((place.left - 8.0, at + 0.36 * TICK), text, TICK, Anchor::End);
    }
    picture.marks.retain(|(mark, _)| !matches!(mark, Mark::Text { text, .. } if text.is_empty()));
    let Rect { left, top, right, bottom } = place;
    picture.line(vec![(left, top), (right, top), (right, bottom), (left, bottom), (left, top)], edge());
    let middle = 0.5 * (left + right);
    picture.text((middle, bottom + 8.0 + TICK + 8.0 + 0.8 * CAPTION), &x.caption(), CAPTION, Anchor::Middle);
    let numbers = fy.ticks.iter().map(|(_, text)| typeface::width(text, TICK)).fold(0.0, f64::max);
    picture.turned_text((left - 8.0 - numbers - 10.0, 0.5 * (top + bottom)), &y.caption(), CAPTION);
    if let Some(factor) = fx.factor() {
        picture.text((right + 6.0, bottom + 0.4 * TICK), &factor, TICK, Anchor::Start);
    }
    if let Some(factor) = fy.factor() {
        picture.text((left, top - 6.0), &factor, TICK, Anchor::Start);
    }
}

/// The parts of a line within a rectangle [Liang1984].
fn clipped(points: &[Point], within: Rect) -> Vec<Vec<Point>> {
    let mut parts: Vec<Vec<Point>> = Vec::new();
    let mut open = false;
    for pair in points.windows(2) {
        let ((ax, ay), (bx, by)) = (pair[0], pair[1]);
        let (dx, dy) = (bx - ax, by - ay);
        let (mut from, mut to) = (0.0f64, 1.0f64);
        let sides =
            [(-dx, ax - within.left), (dx, within.right - ax), (-dy, ay - within.top), (dy, within.bottom - ay)];
        for (rate, room) in sides {
            if rate == 0.0 {
                if room < 0.0 {
                    to = -1.0;
                }
            } else if rate < 0.0 {
                from = from.max(room / rate);
            } else {
                to = to.min(room / rate);
            }
        }
        if from > to {
            open = false;
            continue;
        }
        let at = |t: f64| (ax + t * dx, ay + t * dy);
        match parts.last_mut() {
            Some(part) if open && from == 0.0 => part.push(at(to)),
            _ => parts.push(vec![at(from), at(to)]),
        }
        open = to == 1.0;
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_cut_at_the_frame() {
        let within = Rect { left: 0.0, top: 0.0, right: 10.0, bottom: 10.0 };
        let parts = clipped(&[(-10.0, 5.0), (5.0, 5.0), (5.0, 8.0), (5.0, 30.0), (8.0, 30.0), (8.0, 9.0)], within);
        assert_eq!(parts, [vec![(0.0, 5.0), (5.0, 5.0), (5.0, 8.0), (5.0, 10.0)], vec![(8.0, 10.0), (8.0, 9.0)]]);
    }

    /// Whatever the texts' lengths, each stands within the picture.
    #[test]
    fn no_text_is_clipped() {
        let long =
            "a very long caption of an axis that goes on and on and on and on and on and on and on and on and on";
        for (title, label, values) in [
            ("short", "x", vec![(0.0, 1.0), (1.0, 2.0)]),
            (long, long, vec![(1e9, -1e-9), (3e9, 2e-9)]),
            ("", "", vec![]),
            (
                "Averyveryveryveryveryveryveryveryveryveryveryveryveryveryveryveryveryveryveryverylongword",
                "x",
                vec![(f64::NAN, 1.0)],
            ),
        ] {
            for square in [false, true] {
                let series = vec![Series::new(label, values.clone(), Style::Marked); 90];
                let plot = Plot {
                    title: title.into(),
                    x: Axis::new(label, "W m⁻² sr⁻¹ µm⁻¹"),
                    y: Axis::new(if square { label } else { "y" }, "1"),
                    series,
                    square,
                };
                let picture = plot.picture();
                for (mark, _) in &picture.marks {
                    if let Mark::Text { at, text, size, anchor, turned: false, .. } = mark {
                        let width = typeface::width(text, *size);
                        let start = at.0
                            - match anchor {
                                Anchor::Start => 0.0,
                                Anchor::Middle => 0.5,
                                Anchor::End => 1.0,
                            } * width;
                        assert!(
                            start >= 0.0 && start + width <= picture.width && at.1 <= picture.height,
                            "{text} {start} {width} {}",
                            picture.width
                        );
                    }
                }
            }
        }
    }
}
