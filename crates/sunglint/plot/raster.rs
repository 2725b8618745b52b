//! A picture as pixels, with exact coverage of every edge.

use std::f64::consts::TAU;
use std::io;

use ab_glyph::{OutlineCurve, Point as Place};
use ab_glyph_rasterizer::Rasterizer;

use super::colour::Colour;
use super::picture::{Anchor, Mark, Picture, Pixels, Point, Rect, Stroke};
use super::typeface;

/// Draws a picture with `scale` pixels to its unit on white.
pub(super) fn draw(picture: &Picture, scale: f64) -> Pixels {
    let (width, height) = picture.size();
    let (width, height) = ((f64::from(width) * scale) as usize, (f64::from(height) * scale) as usize);
    let mut sheet = Sheet { width, height, rgba: vec![[255; 4]; width * height], scale };
    picture.marks.iter().for_each(|(mark, within)| sheet.mark(mark, *within));
    Pixels { width, height, rgba: sheet.rgba, sharp: false }
}

/// Draws marks on nothing: opacity stays where they are.
pub(super) fn layer(place: Rect, marks: &[Mark], scale: f64) -> Pixels {
    let (width, height) = ((place.width() * scale).ceil() as usize, (place.height() * scale).ceil() as usize);
    let mut sheet = Sheet { width, height, rgba: vec![[0; 4]; width * height], scale };
    for mark in marks {
        let mut mark = mark.clone();
        shift(&mut mark, (-place.left, -place.top));
        sheet.mark(&mark, None);
    }
    Pixels { width, height, rgba: sheet.rgba, sharp: false }
}

fn shift(mark: &mut Mark, by: Point) {
    let moved = |p: &mut Point| *p = (p.0 + by.0, p.1 + by.1);
    match mark {
        Mark::Line { points, .. } | Mark::Area { points, .. } => points.iter_mut().for_each(moved),
        Mark::Disk { centre, .. } => moved(centre),
        Mark::Text { at, .. } => moved(at),
        Mark::Image { place, .. } => {
            *place = Rect {
                left: place.left + by.0,
                right: place.right + by.0,
                top: place.top + by.1,
                bottom: place.bottom + by.1,
            };
        }
    }
}

impl Pixels {
    /// As PNG; `density` in pixels per metre.
    pub(super) fn png(&self, density: Option<u32>) -> io::Result<Vec<u8>> {
        encode(self, density)
    }
}

pub(super) fn encode(pixels: &Pixels, density: Option<u32>) -> io::Result<Vec<u8>> {
    let size = |n: usize| u32::try_from(n).map_err(io::Error::other);
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, size(pixels.width)?, size(pixels.height)?);
    let opaque = pixels.rgba.iter().all(|p| p[3] == 255);
    encoder.set_color(if opaque { png::ColorType::Rgb } else { png::ColorType::Rgba });
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    encoder.set_pixel_dims(density.map(|n| png::PixelDimensions { xppu: n, yppu: n, unit: png::Unit::Meter }));
    let mut writer = encoder.write_header().map_err(io::Error::other)?;
    let data: Vec<u8> = match opaque {
        true => pixels.rgba.iter().flat_map(|p| [p[0], p[1], p[2]]).collect(),
        false => pixels.rgba.as_flattened().to_vec(),
    };
    writer.write_image_data(&data).map_err(io::Error::other)?;
    writer.finish().map_err(io::Error::other)?;
    Ok(bytes)
}

struct Sheet {
    width: usize,
    height: usize,
    rgba: Vec<[u8; 4]>,
    scale: f64,
}

/// Closed outlines in pixels; where they overlap in one sense they count once.
#[derive(Default)]
struct Shape {
    curves: Vec<OutlineCurve>,
    low: (f64, f64),
    high: (f64, f64),
}

impl Shape {
    fn add(&mut self, curve: OutlineCurve) {
        if self.curves.is_empty() {
            (self.low, self.high) = ((f64::MAX, f64::MAX), (f64::MIN, f64::MIN));
        }
        let mut meet = |p: Place| {
            let (x, y) = (f64::from(p.x), f64::from(p.y));
            self.low = (self.low.0.min(x), self.low.1.min(y));
            self.high = (self.high.0.max(x), self.high.1.max(y));
        };
        match &curve {
            OutlineCurve::Line(a, b) => [*a, *b].into_iter().for_each(&mut meet),
            OutlineCurve::Quad(a, b, c) => [*a, *b, *c].into_iter().for_each(&mut meet),
            OutlineCurve::Cubic(a, b, c, d) => [*a, *b, *c, *d].into_iter().for_each(&mut meet),
        }
        self.curves.push(curve);
    }

    fn polygon(&mut self, corners: &[Point]) {
        let place = |p: Point| Place { x: p.0 as f32, y: p.1 as f32 };
        // One sense for all, so that overlaps do not cancel.
        let twice: f64 = ring(corners).map(|(a, b)| a.0 * b.1 - b.0 * a.1).sum();
        for (a, b) in ring(corners) {
            let (a, b) = if twice > 0.0 { (a, b) } else { (b, a) };
            self.add(OutlineCurve::Line(place(a), place(b)));
        }
    }
}

fn ring(corners: &[Point]) -> impl Iterator<Item = (Point, Point)> + '_ {
    corners.iter().enumerate().map(|(i, a)| (*a, corners[(i + 1) % corners.len()]))
}

/// Whether a line bends by more than 15° at `b`.
fn turns(a: Point, b: Point, c: Point) -> bool {
    let (u, v) = ((b.0 - a.0, b.1 - a.1), (c.0 - b.0, c.1 - b.1));
    (u.0 * v.1 - u.1 * v.0).atan2(u.0 * v.0 + u.1 * v.1).abs() > 0.26
}

fn circle(centre: Point, radius: f64) -> Vec<Point> {
    let n = (8.0 + 4.0 * radius.sqrt()) as usize;
    (0..n)
        .map(|i| {
            let (s, c) = (TAU * i as f64 / n as f64).sin_cos();
            (centre.0 + radius * c, centre.1 + radius * s)
        })
        .collect()
}

impl Sheet {
    fn mark(&mut self, mark: &Mark, within: Option<Rect>) {
        let k = self.scale;
        let scaled = |p: &Point| (p.0 * k, p.1 * k);
        match mark {
            Mark::Line { points, stroke } => {
                let points: Vec<Point> = points.iter().map(scaled).collect();
                self.stroke(&points, stroke, within);
            }
            Mark::Area { points, colour, opacity } => {
                let mut shape = Shape::default();
                shape.polygon(&points.iter().map(scaled).collect::<Vec<_>>());
                self.fill(&shape, *colour, *opacity, within);
            }
            Mark::Disk { centre, radius, colour, opacity } => {
                let mut shape = Shape::default();
                shape.polygon(&circle(scaled(centre), radius * k));
                self.fill(&shape, *colour, *opacity, within);
            }
            Mark::Text { at, text, size, anchor, turned, colour } => {
                let back = typeface::width(text, *size)
                    * match anchor {
                        Anchor::Start => 0.0,
                        Anchor::Middle => 0.5,
                        Anchor::End => 1.0,
                    };
                let place = |p: Place| {
                    let (x, y) = (f64::from(p.x) - back, f64::from(p.y));
                    let (x, y) = if *turned { (y, -x) } else { (x, y) };
                    Place { x: (k * (at.0 + x)) as f32, y: (k * (at.1 + y)) as f32 }
                };
                let mut shape = Shape::default();
                typeface::outline(text, *size, |curve| {
                    shape.add(match curve {
                        OutlineCurve::Line(a, b) => OutlineCurve::Line(place(a), place(b)),
                        OutlineCurve::Quad(a, b, c) => OutlineCurve::Quad(place(a), place(b), place(c)),
                        OutlineCurve::Cubic(a, b, c, d) => OutlineCurve::Cubic(place(a), place(b), place(c), place(d)),
                    });
                });
                self.fill(&shape, *colour, 1.0, within);
            }
            Mark::Image { place, pixels } => self.image(place, pixels, within),
        }
    }

    fn stroke(&mut self, points: &[Point], stroke: &Stroke, within: Option<Rect>) {
        let half = 0.5 * stroke.width * self.scale;
        let dashes: Vec<f64> = stroke.dashes.iter().map(|d| d * self.scale).collect();
        let mut shape = Shape::default();
        for piece in dashed(points, &dashes) {
            for (i, pair) in piece.windows(2).enumerate() {
                let (a, b) = (pair[0], pair[1]);
                let length = (b.0 - a.0).hypot(b.1 - a.1);
                if length > 0.0 {
                    let (nx, ny) = (half * (a.1 - b.1) / length, half * (b.0 - a.0) / length);
                    shape.polygon(&[
                        (a.0 + nx, a.1 + ny),
                        (a.0 - nx, a.1 - ny),
                        (b.0 - nx, b.1 - ny),
                        (b.0 + nx, b.1 + ny),
                    ]);
                }
                if i > 0 && half > 0.6 && turns(piece[i - 1], a, b) {
                    shape.polygon(&circle(a, half));
                }
            }
        }
        self.fill(&shape, stroke.colour, 1.0, within);
    }

    /// Pixels within a rectangle and the sheet: left, top, right, bottom.
    fn bounds(&self, low: Point, high: Point, within: Option<Rect>) -> [usize; 4] {
        let k = self.scale;
        let clip = within.unwrap_or(Rect { left: 0.0, top: 0.0, right: f64::MAX, bottom: f64::MAX });
        let pixel = |x: f64, most: usize| x.clamp(0.0, most as f64) as usize;
        [
            pixel(low.0.floor().max((clip.left * k).round()), self.width),
            pixel(low.1.floor().max((clip.top * k).round()), self.height),
            pixel(high.0.ceil().min((clip.right * k).round()), self.width),
            pixel(high.1.ceil().min((clip.bottom * k).round()), self.height),
        ]
    }

    fn fill(&mut self, shape: &Shape, colour: Colour, opacity: f64, within: Option<Rect>) {
        if shape.curves.is_empty() {
            return;
        }
        let [left, top, right, bottom] = self.bounds(shape.low, shape.high, within);
        if left >= right || top >= bottom {
            return;
        }
        // Two columns more than are seen: what lies beyond the box on the right still closes the outline there.
        let mut edges = Edges {
            rasterizer: Rasterizer::new(right - left + 2, bottom - top),
            origin: (left as f32, top as f32),
            most: (right - left) as f32 + 1.0,
        };
        for curve in &shape.curves {
            match *curve {
                OutlineCurve::Line(a, b) => edges.line(a, b),
                OutlineCurve::Quad(a, b, c) => edges.curve(a, c, |t| mix(mix(a, b, t), mix(b, c, t), t)),
                OutlineCurve::Cubic(a, b, c, d) => edges.curve(a, d, |t| {
                    let (ab, bc, cd) = (mix(a, b, t), mix(b, c, t), mix(c, d, t));
                    mix(mix(ab, bc, t), mix(bc, cd, t), t)
                }),
            }
        }
        let seen = (right - left) as u32;
        let rasterizer = edges.rasterizer;
        let width = self.width;
        rasterizer.for_each_pixel_2d(|x, y, coverage| {
            let alpha = f64::from(coverage.min(1.0)) * opacity;
            if alpha > 0.0 && x < seen {
                blend(&mut self.rgba[(top + y as usize) * width + left + x as usize], colour, alpha);
            }
        });
    }

    fn image(&mut self, place: &Rect, pixels: &Pixels, within: Option<Rect>) {
        let k = self.scale;
        if pixels.width == 0 || pixels.height == 0 {
            return;
        }
        let (low, high) = ((place.left * k, place.top * k), (place.right * k, place.bottom * k));
        let [left, top, right, bottom] = self.bounds(low, high, within);
        let (step_x, step_y) = (pixels.width as f64 / (high.0 - low.0), pixels.height as f64 / (high.1 - low.1));
        for y in top..bottom {
            for x in left..right {
                let (u, v) = ((x as f64 + 0.5 - low.0) * step_x, (y as f64 + 0.5 - low.1) * step_y);
                if u < 0.0 || v < 0.0 || u >= pixels.width as f64 || v >= pixels.height as f64 {
                    continue;
                }
                let [r, g, b, a] = pixels.rgba[v as usize * pixels.width + u as usize];
                blend(&mut self.rgba[y * self.width + x], [r, g, b], f64::from(a) / 255.0);
            }
        }
    }
}

/// Edges of an outline within a box; what lies left or right of it is moved to its side, where it still counts.
struct Edges {
    rasterizer: Rasterizer,
    origin: (f32, f32),
    most: f32,
}

impl Edges {
    fn curve(&mut self, from: Place, to: Place, at: impl Fn(f32) -> Place) {
        const STEPS: u8 = 6;
        let mut last = from;
        for i in 1..=STEPS {
            let next = if i == STEPS { to } else { at(f32::from(i) / f32::from(STEPS)) };
            self.line(last, next);
            last = next;
        }
    }

    fn line(&mut self, a: Place, b: Place) {
        let inside = |p: Place| ((p.x - self.origin.0), (p.y - self.origin.1));
        let ((ax, ay), (bx, by)) = (inside(a), inside(b));
        // Parameters where the line crosses the sides, ascending.
        let cross = |side: f32| if ax == bx { 0.0 } else { ((side - ax) / (bx - ax)).clamp(0.0, 1.0) };
        let (mut s, mut t) = (cross(0.0), cross(self.most));
        if s > t {
            (s, t) = (t, s);
        }
        let at = |u: f32| (ax + u * (bx - ax), ay + u * (by - ay));
        for (from, to) in [((ax, ay), at(s)), (at(s), at(t)), (at(t), (bx, by))] {
            let place = |(x, y): (f32, f32)| ab_glyph_rasterizer::point(x.clamp(0.0, self.most), y);
            if from.1 != to.1 {
                self.rasterizer.draw_line(place(from), place(to));
            }
        }
    }
}

fn mix(a: Place, b: Place, t: f32) -> Place {
    Place { x: a.x + t * (b.x - a.x), y: a.y + t * (b.y - a.y) }
}

/// Source over destination [Porter1984], in sRGB codes as browsers do.
fn blend(pixel: &mut [u8; 4], colour: Colour, alpha: f64) {
    let below = f64::from(pixel[3]) / 255.0 * (1.0 - alpha);
    let total = alpha + below;
    for (code, new) in pixel.iter_mut().zip(colour) {
        *code = ((f64::from(new) * alpha + f64::from(*code) * below) / total).round() as u8;
    }
    pixel[3] = (255.0 * total).round() as u8;
}

/// The pieces of a line that its dashes leave; the pattern goes on round corners.
fn dashed(points: &[Point], dashes: &[f64]) -> Vec<Vec<Point>> {
    let total: f64 = dashes.iter().sum();
    if dashes.is_empty() || total <= 0.0 {
        return vec![points.to_vec()];
    }
    let mut pieces: Vec<Vec<Point>> = Vec::new();
    let (mut dash, mut left) = (0, dashes[0]);
    let mut piece: Vec<Point> = points.first().copied().into_iter().collect();
    for pair in points.windows(2) {
        let (mut a, b) = (pair[0], pair[1]);
        let mut length = (b.0 - a.0).hypot(b.1 - a.1);
        while length > left {
            let t = left / length;
            a = (a.0 + t * (b.0 - a.0), a.1 + t * (b.1 - a.1));
            length -= left;
            if dash % 2 == 0 {
                piece.push(a);
                pieces.push(std::mem::take(&mut piece));
            } else {
                piece = vec![a];
            }
            dash = (dash + 1) % dashes.len();
            left = dashes[dash];
        }
        left -= length;
        if dash % 2 == 0 {
            piece.push(b);
        }
    }
    pieces.push(piece);
    pieces
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plot::colour::{BLACK, WHITE};

    /// A square of 10.5 × 4 units, one pixel to the unit: the last column is half covered.
    #[test]
    fn an_edge_within_a_pixel_covers_its_share() {
        let mut picture = Picture::new("", 20.0, 10.0);
        let points = vec![(2.0, 2.0), (12.5, 2.0), (12.5, 6.0), (2.0, 6.0)];
        picture.draw(Mark::Area { points, colour: BLACK, opacity: 1.0 });
        let pixels = draw(&picture, 1.0);
        let code = |x: usize, y: usize| pixels.rgba[y * 20 + x][0];
        assert_eq!([code(1, 3), code(2, 3), code(11, 5), code(12, 3), code(13, 3)], [255, 0, 0, 128, 255]);
    }

    /// Lines that cross, and wide ones that turn, are as dark where they overlap as elsewhere.
    #[test]
    fn overlaps_of_a_line_with_itself_do_not_cancel() {
        let mut picture = Picture::new("", 40.0, 40.0);
        let points = vec![(5.0, 5.0), (35.0, 35.0), (35.0, 5.0), (5.0, 35.0)];
        picture.line(points, Stroke::new(BLACK, 6.0));
        let pixels = draw(&picture, 1.0);
        for (x, y) in [(20, 20), (34, 34), (35, 20), (34, 6)] {
            assert_eq!(pixels.rgba[y * 40 + x][0], 0, "{x} {y}");
        }
        assert_eq!(pixels.rgba[20 * 40 + 5][..3], WHITE);
    }

    /// 4 drawn, 2 left out, along a corner: the drawn lengths are 4, 4, 2.
    #[test]
    fn dashes_go_round_corners() {
        let pieces = dashed(&[(0.0, 0.0), (7.0, 0.0), (7.0, 7.0)], &[4.0, 2.0]);
        let length =
            |piece: &Vec<Point>| piece.windows(2).map(|w| (w[1].0 - w[0].0).hypot(w[1].1 - w[0].1)).sum::<f64>();
        assert_eq!(pieces.iter().map(length).collect::<Vec<_>>(), [4.0, 4.0, 2.0]);
    }
}
