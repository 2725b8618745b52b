//! The hemisphere as a disk: fisheye pictures of the sky, reflectance against direction.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, SQRT_2};

use super::colour;
use super::image::{bar_width, colour_bar};
use super::legend::{self, TICK};
use super::picture::{Anchor, Mark, Picture, Pixels, Point, Rect, Stroke};
use super::{Axis, ColourMap, typeface};

const RADIUS: f64 = 200.0;
/// Values along a radius.
const STEPS: usize = 2 * RADIUS as usize;

/// How the zenith angle becomes a distance from the middle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Projection {
    /// In proportion to it.
    #[default]
    Equidistant,
    /// Equal solid angles have equal areas, r ∝ sin(θ/2) [Lambert1772].
    EqualArea,
}

/// Which way azimuths turn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Orientation {
    /// Clockwise, as on a map: east on the right when north is up.
    #[default]
    FromAbove,
    /// Counter-clockwise, as one sees who lies on the back: east on the left when north is up.
    FromBelow,
}

/// A marked direction.
#[derive(Clone, Debug, PartialEq)]
pub struct DomeMark {
    /// Zenith angle \[rad\].
    pub zenith: f64,
    /// Azimuth \[rad\].
    pub azimuth: f64,
    /// What is there.
    pub label: String,
}

/// A quantity over the hemisphere with a colour bar; azimuth 0 is up.
pub struct Dome<'f> {
    /// Title; long ones are broken into lines.
    pub title: String,
    /// What is shown.
    pub value: Axis,
    /// Its colours.
    pub map: ColourMap,
    /// How zenith angles are laid out.
    pub projection: Projection,
    /// Which way azimuths turn.
    pub orientation: Orientation,
    /// Azimuths are named N, E, S, W instead of in degrees.
    pub compass: bool,
    /// Marked directions.
    pub marks: Vec<DomeMark>,
    /// A line below the disk.
    pub note: String,
    /// The quantity by zenith angle and azimuth \[rad\].
    pub field: &'f (dyn Fn(f64, f64) -> f64 + Sync),
}

impl Dome<'_> {
    /// Evaluates the field on the pixels of the disk and lays the picture out.
    pub fn picture(&self) -> Picture {
        let (pixels, fitted) = self.pixels();
        let side = 42.0;
        let bar = bar_width(&self.value, &fitted);
        let width = 2.0 * (RADIUS + side) + bar;
        let lines = typeface::lines(&self.note, TICK, width);
        let note = lines.iter().map(|line| typeface::width(line, TICK)).fold(0.0, f64::max);
        let room = legend::title_width(&self.title, width).max(width).max(note);
        let top = legend::title(None, &self.title, 0.0, room) + side;
        let left = 0.5 * (room - width) + 8.0;
        let (cx, cy) = (left + side + RADIUS, top + RADIUS);
        let bottom = cy + RADIUS + side + (TICK + 5.0) * lines.len() as f64 + 6.0;
        let mut picture = Picture::new(&self.title, room + 16.0, bottom);
        legend::title(Some(&mut picture), &self.title, 8.0, room);
        let place = Rect { left: cx - RADIUS, right: cx + RADIUS, top: cy - RADIUS, bottom: cy + RADIUS };
        picture.draw(Mark::Image { place, pixels });

        let at = |zenith: f64, azimuth: f64| -> Point {
            let r = RADIUS * self.distance(zenith);
            let east = match self.orientation {
                Orientation::FromAbove => 1.0,
                Orientation::FromBelow => -1.0,
            };
            (cx + east * r * azimuth.sin(), cy - r * azimuth.cos())
        };
        let circle = |zenith: f64| (0..=120).map(|i| at(zenith, f64::from(i) * 3f64.to_radians())).collect::<Vec<_>>();
        let thin = || Stroke { colour: colour::WHITE, width: 0.7, dashes: &[3.0, 3.0] };
        for zenith in [30.0f64, 60.0] {
            picture.line(circle(zenith.to_radians()), thin());
        }
        picture.line(circle(FRAC_PI_2), Stroke::new(colour::BLACK, 1.2));
        for i in 0..8 {
            let azimuth = f64::from(i) * FRAC_PI_4;
            let (x, y) = at(FRAC_PI_2, azimuth);
            let (dx, dy) = ((x - cx) / RADIUS, (y - cy) / RADIUS);
            picture.line(vec![(x, y), (x + 5.0 * dx, y + 5.0 * dy)], Stroke::new(colour::BLACK, 1.0));
            let text = match self.compass {
                true => ["N", "NE", "E", "SE", "S", "SW", "W", "NW"][i as usize].to_string(),
                false => format!("{}°", 45 * i),
            };
            picture.text(
                (x + (10.0 + 0.5 * typeface::width(&text, TICK)) * dx, y + 15.0 * dy + 0.36 * TICK),
                &text,
                TICK,
                Anchor::Middle,
            );
        }
        for zenith in [30.0f64, 60.0] {
            let (x, y) = at(zenith.to_radians(), 22.5f64.to_radians());
            outlined(&mut picture, (x, y + 0.36 * TICK), &format!("{zenith}°"));
        }
        for mark in &self.marks {
            let (x, y) = at(mark.zenith, mark.azimuth);
            let ring = |r: f64| -> Vec<Point> {
                (0..=24)
                    .map(|i| (f64::from(i) * 15f64.to_radians()).sin_cos())
                    .map(|(s, c)| (x + r * c, y + r * s))
                    .collect()
            };
            picture.line(ring(6.0), Stroke::new(colour::WHITE, 3.6));
            picture.line(ring(6.0), Stroke::new(colour::BLACK, 1.5));
            picture.draw(Mark::Disk { centre: (x, y), radius: 1.5, colour: colour::BLACK, opacity: 1.0 });
            let below = if y > cy { -12.0 } else { 12.0 + 0.8 * TICK };
            outlined(&mut picture, (x, y + below), &mark.label);
        }
        colour_bar(&mut picture, Rect { right: place.right + side, ..place }, &self.value, &fitted, self.map);
        for (i, line) in lines.iter().enumerate() {
            let y = cy + RADIUS + side + (TICK + 5.0) * (i as f64 + 0.6);
            picture.text((0.5 * (room + 16.0), y), line, TICK, Anchor::Middle);
        }
        picture
    }

    /// Distance from the middle, 1 at the horizon.
    fn distance(&self, zenith: f64) -> f64 {
        match self.projection {
            Projection::Equidistant => zenith / FRAC_PI_2,
            Projection::EqualArea => SQRT_2 * (0.5 * zenith).sin(),
        }
    }

    fn pixels(&self) -> (Pixels, super::axis::Fitted) {
        use rayon::prelude::*;
        let n = 2 * STEPS;
        let values: Vec<f64> = (0..n * n)
            .into_par_iter()
            .map(|i| {
                let unit = |k: usize| (k as f64 + 0.5) / STEPS as f64 - 1.0;
                let (x, y) = (unit(i % n), -unit(i / n));
                let r = x.hypot(y);
                if r > 1.0 + 2.0 / STEPS as f64 {
                    return f64::NAN;
                }
                let zenith = match self.projection {
                    Projection::Equidistant => r * FRAC_PI_2,
                    Projection::EqualArea => 2.0 * (r / SQRT_2).min(1.0).asin(),
                };
                let east = match self.orientation {
                    Orientation::FromAbove => x,
                    Orientation::FromBelow => -x,
                };
                (self.field)(zenith.min(FRAC_PI_2 - 1e-6), east.atan2(y).rem_euclid(std::f64::consts::TAU))
            })
            .collect();
        let fitted = self.value.fit(values.iter().copied(), 6);
        let rgba = (values.iter().enumerate())
            .map(|(i, value)| {
                let unit = |k: usize| k as f64 + 0.5 - STEPS as f64;
                let inside = (STEPS as f64 - unit(i % n).hypot(unit(i / n)) + 0.5).clamp(0.0, 1.0);
                let [r, g, b] = self.map.colour(fitted.share(*value));
                [r, g, b, (255.0 * inside).round() as u8]
            })
            .collect();
        (Pixels { width: n, height: n, rgba, sharp: false }, fitted)
    }
}

/// Text with a white rim, legible on any colour.
fn outlined(picture: &mut Picture, at: Point, text: &str) {
    let mut write = |dx: f64, dy: f64, colour| {
        let at = (at.0 + dx, at.1 + dy);
        picture.draw(Mark::Text { at, text: text.into(), size: TICK, anchor: Anchor::Middle, turned: false, colour });
    };
    for (dx, dy) in
        [(-1.0, 0.0), (1.0, 0.0), (0.0, -1.0), (0.0, 1.0), (-0.7, -0.7), (0.7, -0.7), (-0.7, 0.7), (0.7, 0.7)]
    {
        write(dx, dy, colour::WHITE);
    }
    write(0.0, 0.0, colour::BLACK);
}
