//! Images with a colour bar.

use super::axis::Fitted;
use super::cartesian::frame;
use super::colour;
use super::legend::{self, CAPTION, TICK};
use super::picture::{Anchor, Mark, Picture, Pixels, Rect, Stroke};
use super::{Axis, ColourMap, typeface};

/// Pixels of an image on paper, at most; larger ones are averaged in blocks.
const MOST_PIXELS: usize = 1200;

/// Values on a grid of pixels, with a colour bar. What is not finite is drawn grey.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Title; long ones are broken into lines.
    pub title: String,
    /// Pixels across.
    pub width: usize,
    /// Values, rows from the top.
    pub values: Vec<f64>,
    /// What the values are; a range about 0 suits [`ColourMap::Difference`].
    pub value: Axis,
    /// Their colours.
    pub map: ColourMap,
}

impl Image {
    /// Lays the image out.
    pub fn picture(&self) -> Picture {
        let columns = self.width.max(1);
        let rows = (self.values.len() / columns).max(1);
        let pixels_per_unit = (560.0 / columns as f64).min(440.0 / rows as f64);
        let (width, height) = ((columns as f64 * pixels_per_unit).max(40.0), (rows as f64 * pixels_per_unit).max(40.0));
        let x = Axis::new("column", "px").within(0.0, columns as f64);
        // Rows count downwards: the axis shows what remains below the top.
        let y = Axis::new("row", "px").within(0.0, rows as f64);
        let (fx, mut fy) = (x.fit(std::iter::empty(), 6), y.fit(std::iter::empty(), 5));
        fy.ticks.iter_mut().for_each(|(value, _)| *value = rows as f64 - *value);
        let fitted = self.value.fit(self.values.iter().copied(), 6);

        let numbers = fy.ticks.iter().map(|(_, text)| typeface::width(text, TICK)).fold(0.0, f64::max);
        let left = 12.0 + CAPTION + 10.0 + numbers + 8.0;
        let bar = bar_width(&self.value, &fitted);
        let room = left + width + bar;
        let title_room = legend::title_width(&self.title, room).max(room);
        let top = legend::title(None, &self.title, 0.0, title_room) + 8.0 + TICK;
        let place = Rect { left, top, right: left + width, bottom: top + height };
        let mut picture =
            Picture::new(&self.title, title_room + 12.0, place.bottom + 8.0 + TICK + 8.0 + CAPTION + 14.0);
        legend::title(Some(&mut picture), &self.title, 0.0, title_room);
        picture.draw(Mark::Image { place, pixels: self.pixels(columns, rows, &fitted) });
        let grid_from = picture.marks.len();
        frame(&mut picture, place, (&x, &fx), (&y, &fy));
        let grid = Stroke::new(colour::GRID, 0.8);
        let mut i = 0;
        picture.marks.retain(|(mark, _)| {
            i += 1;
            i <= grid_from || !matches!(mark, Mark::Line { stroke, .. } if *stroke == grid)
        });
        colour_bar(&mut picture, place, &self.value, &fitted, self.map);
        picture
    }

    fn pixels(&self, columns: usize, rows: usize, fitted: &Fitted) -> Pixels {
        let block = columns.max(rows).div_ceil(MOST_PIXELS).max(1);
        let (width, height) = (columns.div_ceil(block), rows.div_ceil(block));
        let mean = |i: usize, j: usize| {
            let (mut sum, mut n) = (0.0, 0.0);
            for row in j * block..((j + 1) * block).min(rows) {
                for column in i * block..((i + 1) * block).min(columns) {
                    let value = self.values.get(row * columns + column).copied().unwrap_or(f64::NAN);
                    if value.is_finite() {
                        (sum, n) = (sum + value, n + 1.0);
                    }
                }
            }
            sum / n
        };
        let rgba = (0..height)
            .flat_map(|j| (0..width).map(move |i| (i, j)))
            .map(|(i, j)| {
                let [r, g, b] = self.map.colour(fitted.share(mean(i, j)));
                [r, g, b, 255]
            })
            .collect();
        Pixels { width, height, rgba, sharp: true }
    }
}

const BAR: f64 = 16.0;

/// Width that a colour bar with its numbers and caption takes right of a plot.
pub(super) fn bar_width(axis: &Axis, fitted: &Fitted) -> f64 {
    let numbers = fitted.ticks.iter().map(|(_, text)| typeface::width(text, TICK)).fold(0.0, f64::max);
    let factor = fitted.factor().map_or(0.0, |text| typeface::width(&text, TICK) - BAR);
    let caption = if axis.caption().is_empty() { 0.0 } else { CAPTION + 10.0 };
    18.0 + BAR + (8.0 + numbers + caption).max(factor) + 12.0
}

/// Draws a colour bar right of a plot.
pub(super) fn colour_bar(picture: &mut Picture, beside: Rect, axis: &Axis, fitted: &Fitted, map: ColourMap) {
    let place = Rect { left: beside.right + 18.0, right: beside.right + 18.0 + BAR, ..beside };
    let n = 256;
    // Steps of the logarithm are even along a logarithmic bar: the share is what colours stand for.
    let rgba = (0..n)
        .map(|i| {
            let [r, g, b] = map.colour(1.0 - (i as f64 + 0.5) / n as f64);
            [r, g, b, 255]
        })
        .collect();
    picture.draw(Mark::Image { place, pixels: Pixels { width: 1, height: n, rgba, sharp: false } });
    let Rect { left, top, right, bottom } = place;
    let edge = || Stroke::new(colour::BLACK, 1.0);
    picture.line(vec![(left, top), (right, top), (right, bottom), (left, bottom), (left, top)], edge());
    let mut widest: f64 = 0.0;
    for (value, text) in &fitted.ticks {
        let y = bottom - fitted.share(*value) * place.height();
        let long = if text.is_empty() { 3.0 } else { 5.0 };
        picture.line(vec![(right, y), (right + long, y)], edge());
        if !text.is_empty() {
            picture.text((right + 8.0, y + 0.36 * TICK), text, TICK, Anchor::Start);
            widest = widest.max(typeface::width(text, TICK));
        }
    }
    if let Some(factor) = fitted.factor() {
        picture.text((left, top - 6.0), &factor, TICK, Anchor::Start);
    }
    let caption = axis.caption();
    if !caption.is_empty() {
        picture.turned_text((right + 8.0 + widest + 8.0 + CAPTION, 0.5 * (top + bottom)), &caption, CAPTION);
    }
}
