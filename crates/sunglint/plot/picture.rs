//! Where each line and letter stands.

use std::io::{self, Write};
use std::path::Path;

use super::colour::Colour;
use super::{raster, svg};
use crate::products::write_whole;

/// A place: x right, y down.
pub(super) type Point = (f64, f64);

/// A rectangle: left, top, right, bottom.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rect {
    pub left: f64,
    pub top: f64,
    pub right: f64,
    pub bottom: f64,
}

impl Rect {
    pub fn width(&self) -> f64 {
        self.right - self.left
    }
    pub fn height(&self) -> f64 {
        self.bottom - self.top
    }
    fn moved(self, (x, y): Point) -> Self {
        Self { left: self.left + x, top: self.top + y, right: self.right + x, bottom: self.bottom + y }
    }
}

/// Which point of a text is placed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

/// A line's look.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Stroke {
    pub colour: Colour,
    pub width: f64,
    /// Lengths of dashes and gaps; empty: unbroken.
    pub dashes: &'static [f64],
}

impl Stroke {
    pub fn new(colour: Colour, width: f64) -> Self {
        Self { colour, width, dashes: &[] }
    }
}

/// A raster within a picture: rows from the top, red, green, blue, opacity.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Pixels {
    pub width: usize,
    pub height: usize,
    pub rgba: Vec<[u8; 4]>,
    /// Shown as squares; otherwise readers may smooth it.
    pub sharp: bool,
}

/// A thing drawn.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Mark {
    Line {
        points: Vec<Point>,
        stroke: Stroke,
    },
    Area {
        points: Vec<Point>,
        colour: Colour,
        opacity: f64,
    },
    Disk {
        centre: Point,
        radius: f64,
        colour: Colour,
        opacity: f64,
    },
    /// On the baseline `at`; `turned` reads from bottom to top.
    Text {
        at: Point,
        text: String,
        size: f64,
        anchor: Anchor,
        turned: bool,
        colour: Colour,
    },
    Image {
        place: Rect,
        pixels: Pixels,
    },
}

impl Mark {
    fn moved(mut self, (x, y): Point) -> Self {
        match &mut self {
            Self::Line { points, .. } | Self::Area { points, .. } => {
                points.iter_mut().for_each(|point| *point = (point.0 + x, point.1 + y));
            }
            Self::Disk { centre: at, .. } | Self::Text { at, .. } => *at = (at.0 + x, at.1 + y),
            Self::Image { place, .. } => *place = place.moved((x, y)),
        }
        self
    }
}

/// Format of a plot's file, by its ending.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Scalable; text stays text.
    Svg,
    /// Two pixels to the unit of the SVG, 192 to the inch.
    Png,
}

impl Format {
    /// By the ending `.svg` or `.png`.
    ///
    /// # Errors
    /// Says which endings there are, for any other.
    pub fn of(path: &Path) -> Result<Self, String> {
        match path.extension().and_then(|e| e.to_str()).map(str::to_lowercase).as_deref() {
            Some("svg") => Ok(Self::Svg),
            Some("png") => Ok(Self::Png),
            _ => Err(format!("a plot is written as .svg or .png, not as `{}`", path.display())),
        }
    }
}

/// A drawn plot.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    pub(super) title: String,
    pub(super) width: f64,
    pub(super) height: f64,
    /// Marks, each with the rectangle outside which it is not seen.
    pub(super) marks: Vec<(Mark, Option<Rect>)>,
}

impl Picture {
    pub(super) fn new(title: &str, width: f64, height: f64) -> Self {
        Self { title: title.to_string(), width: width.ceil(), height: height.ceil(), marks: Vec::new() }
    }

    /// Pictures in rows of `columns`, each cell as large as the largest of them.
    pub fn grid(pictures: Vec<Picture>, columns: usize) -> Picture {
        let columns = columns.clamp(1, pictures.len().max(1));
        let largest = |of: fn(&Picture) -> f64| pictures.iter().map(of).fold(0.0, f64::max);
        let (width, height) = (largest(|picture| picture.width), largest(|picture| picture.height));
        let titles: Vec<&str> = pictures.iter().map(|picture| picture.title.as_str()).collect();
        let rows = pictures.len().div_ceil(columns);
        let mut grid = Picture::new(&titles.join("; "), width * columns as f64, height * rows as f64);
        for (i, picture) in pictures.into_iter().enumerate() {
            let by = ((i % columns) as f64 * width, (i / columns) as f64 * height);
            let moved = |(mark, clip): (Mark, Option<Rect>)| (mark.moved(by), clip.map(|rect| rect.moved(by)));
            grid.marks.extend(picture.marks.into_iter().map(moved));
        }
        grid
    }

    pub(super) fn draw(&mut self, mark: Mark) {
        self.marks.push((mark, None));
    }
    pub(super) fn draw_within(&mut self, within: Rect, mark: Mark) {
        self.marks.push((mark, Some(within)));
    }
    pub(super) fn line(&mut self, points: Vec<Point>, stroke: Stroke) {
        self.draw(Mark::Line { points, stroke });
    }
    pub(super) fn text(&mut self, at: Point, text: &str, size: f64, anchor: Anchor) {
        self.draw(Mark::Text { at, text: text.into(), size, anchor, turned: false, colour: super::colour::BLACK });
    }
    pub(super) fn turned_text(&mut self, at: Point, text: &str, size: f64) {
        let anchor = Anchor::Middle;
        self.draw(Mark::Text { at, text: text.into(), size, anchor, turned: true, colour: super::colour::BLACK });
    }

    /// Width and height in units of the SVG (96 to the inch).
    pub fn size(&self) -> (u32, u32) {
        (self.width as u32, self.height as u32)
    }

    /// As SVG text.
    pub fn svg(&self) -> String {
        svg::write(self)
    }

    /// As PNG bytes.
    ///
    /// # Errors
    /// Those of the encoder.
    pub fn png(&self) -> io::Result<Vec<u8>> {
        raster::draw(self, 2.0).png(Some(7559))
    }

    /// Writes the file in the format of its ending; it appears whole or not at all.
    ///
    /// # Errors
    /// Another ending than `.svg` or `.png`, and those of the file system.
    pub fn write(&self, path: &Path) -> io::Result<()> {
        let format = Format::of(path).map_err(|message| io::Error::new(io::ErrorKind::InvalidInput, message))?;
        let bytes = match format {
            Format::Svg => self.svg().into_bytes(),
            Format::Png => self.png()?,
        };
        write_whole(path, |out| out.write_all(&bytes))
    }
}
