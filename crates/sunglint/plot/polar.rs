//! Values against angle on a half circle, as a principal plane is shown.

use super::colour;
use super::legend::{self, CAPTION, Legend, TICK};
use super::picture::{Anchor, Mark, Picture, Point, Rect, Stroke};
use super::{Axis, Series, colours, typeface};

const RADIUS: f64 = 260.0;

/// Values against angle from the zenith: −90° left, 0° up, 90° right; the value is the distance from the middle.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Polar {
    /// Title; long ones are broken into lines.
    pub title: String,
    /// The value; its range begins at 0.
    pub radius: Axis,
    /// What each side is, left and right.
    pub sides: (String, String),
    /// Points (angle \[deg\], value).
    pub series: Vec<Series>,
    /// Angles \[deg\] that are marked from outside, with what stands there.
    pub arrows: Vec<(f64, String)>,
}

impl Polar {
    /// Lays the plot out.
    pub fn picture(&self) -> Picture {
        let points = || self.series.iter().flat_map(|s| &s.points).filter(|(a, r)| a.is_finite() && r.is_finite());
        let most = points().map(|p| p.1).fold(0.0, f64::max);
        let top_value = if most > 0.0 { 1.02 * most } else { 1.0 };
        let axis = match self.radius.range {
            Some(_) => self.radius.clone(),
            None => self.radius.clone().within(0.0, top_value),
        };
        let fitted = axis.fit(std::iter::empty(), 4);
        let side = 46.0;
        let width = 2.0 * (RADIUS + side);
        let title_room = legend::title_width(&self.title, width).max(width);
        let title_height = legend::title(None, &self.title, 0.0, title_room);
        let legend = Legend::new(&self.series, RADIUS);
        let beyond = 0.5 * (title_room - width);
        let caption = axis.caption();
        let half = 0.5 * typeface::width(&caption, CAPTION) - RADIUS - side;
        let left = 12.0 + beyond.max(half).max(0.0);
        let rim = title_height + 44.0;
        let (cx, cy) = (left + side + RADIUS, rim + RADIUS);
        let bottom = cy + 10.0 + 2.0 * (TICK + 8.0) + CAPTION + 12.0;
        let mut picture =
            Picture::new(&self.title, left + width + legend.width().max(beyond).max(half).max(0.0) + 14.0, bottom);
        legend::title(Some(&mut picture), &self.title, cx - 0.5 * title_room, title_room);

        let at = |angle: f64, share: f64| -> Point {
            let (s, c) = angle.to_radians().sin_cos();
            (cx + RADIUS * share * s, cy - RADIUS * share * c)
        };
        let arc = |share: f64| (0..=90).map(|i| at(f64::from(i) * 2.0 - 90.0, share)).collect::<Vec<_>>();
        let grid = || Stroke::new(colour::GRID, 0.8);
        for (value, text) in &fitted.ticks {
            let share = fitted.share(*value);
            if share > 0.0 {
                picture.line(arc(share), grid());
            }
            for sign in if share > 0.0 { &[-1.0, 1.0][..] } else { &[1.0][..] } {
                let x = cx + sign * RADIUS * share;
                picture.line(vec![(x, cy), (x, cy + 5.0)], Stroke::new(colour::BLACK, 1.0));
                picture.text((x, cy + 8.0 + 0.85 * TICK), text, TICK, Anchor::Middle);
            }
        }
        for i in -3..=3 {
            let angle = f64::from(i) * 30.0;
            picture.line(vec![at(angle, 0.0), at(angle, 1.0)], grid());
            let (x, y) = at(angle, 1.0 + 18.0 / RADIUS);
            picture.text((x, y + 0.36 * TICK), &format!("{}°", (i * 30_i32).abs()), TICK, Anchor::Middle);
        }
        picture.line(arc(1.0), Stroke::new(colour::BLACK, 1.0));
        picture.line(vec![(cx - RADIUS, cy), (cx + RADIUS, cy)], Stroke::new(colour::BLACK, 1.0));
        let below = cy + 8.0 + TICK + 8.0 + 0.85 * TICK;
        picture.text((cx - RADIUS, below), &self.sides.0, TICK, Anchor::Start);
        picture.text((cx + RADIUS, below), &self.sides.1, TICK, Anchor::End);
        let factor = fitted.factor().map_or(String::new(), |factor| format!("  {factor}"));
        picture.text((cx, below + CAPTION + 8.0), &format!("{caption}{factor}"), CAPTION, Anchor::Middle);

        let half_disk =
            Rect { left: cx - RADIUS - 1.0, right: cx + RADIUS + 1.0, top: cy - RADIUS - 1.0, bottom: cy + 1.0 };
        for (series, number) in self.series.iter().zip(colours(&self.series)) {
            // Values beyond a given range stay at its rim.
            let place = |(angle, r): &Point| {
                (angle.is_finite() && r.is_finite()).then(|| at(*angle, fitted.share(*r).clamp(0.0, 1.0)))
            };
            let places: Vec<Option<Point>> = series.points.iter().map(place).collect();
            if let Some(stroke) = legend::stroke(series.style, number) {
                for run in places.split(Option::is_none) {
                    let points = run.iter().copied().flatten().collect();
                    picture.draw_within(half_disk, Mark::Line { points, stroke: stroke.clone() });
                }
            }
            for place in places.into_iter().flatten() {
                legend::symbol(series.style, number, place, 0.9).into_iter().for_each(|mark| picture.draw(mark));
            }
        }
        for (angle, label) in &self.arrows {
            let (from, to) = (at(*angle, 1.0 - 3.0 / RADIUS), at(*angle, 1.0 - 34.0 / RADIUS));
            picture.line(vec![from, to], Stroke::new(colour::BLACK, 1.4));
            let side = |turn: f64| {
                let (s, c) = (angle + turn).to_radians().sin_cos();
                (to.0 + 9.0 * s, to.1 - 9.0 * c)
            };
            picture.draw(Mark::Area { points: vec![to, side(-22.0), side(22.0)], colour: colour::BLACK, opacity: 1.0 });
            let (x, y) = at(*angle, 1.0 + 36.0 / RADIUS);
            picture.text((x, y + 0.36 * TICK), label, TICK, Anchor::Middle);
        }
        legend.draw(&mut picture, (left + width - 14.0, rim));
        picture
    }
}
