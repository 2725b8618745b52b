//! Plots as SVG and PNG: lines and scatter, polar, hemispherical maps, images with a colour bar.
//!
//! A plot is data, a [`Picture`] is where each line and letter stands, and a file is either of the two formats of one
//! picture. Pictures are as wide as their tick labels and legends want, so no text is clipped; legends stand beside the
//! data, never on it. The same plot gives the same bytes. Colours are told apart by colour-blind readers
//! [Okabe2008], maps use viridis [Smith2015]. Points that are not finite leave a gap.
//!
//! Text may hold a subscript as `R_{d}`.
//!
//! ```
//! use sunglint::plot::{Axis, Plot, Series, Style};
//! let measured = Series::new("panels", vec![(0.1, 0.11), (0.4, 0.39)], Style::Points);
//! let plot = Plot {
//!     title: "Reflectance".into(),
//!     x: Axis::new("simulated", "1"),
//!     y: Axis::new("measured", "1"),
//!     series: vec![measured],
//!     square: true,
//!     ..Plot::default()
//! }
//! .with_unity_line();
//! let svg = plot.picture().svg();
//! # assert!(svg.contains(">measured<"));
//! ```

mod axis;
mod cartesian;
mod colour;
mod dome;
mod image;
mod legend;
mod picture;
mod polar;
mod raster;
mod svg;
mod typeface;

pub use axis::{Axis, Scale};
pub use cartesian::Plot;
pub use colour::ColourMap;
pub use dome::{Dome, DomeMark, Orientation, Projection};
pub use image::Image;
pub use picture::{Format, Picture};
pub use polar::Polar;

/// How a series is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Style {
    /// A line through the points.
    #[default]
    Line,
    /// A dashed line.
    Dashed,
    /// Marks only.
    Points,
    /// A line with marks.
    Marked,
    /// A thin grey line, for what data are held against.
    Reference,
}

/// A named set of points.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Series {
    /// Name in the legend; an empty one is not listed.
    pub name: String,
    /// The points, in the units of the axes.
    pub points: Vec<(f64, f64)>,
    /// How it is drawn.
    pub style: Style,
    /// Number of the colour and mark; by its place among the series where unsaid.
    pub colour: Option<usize>,
}

impl Series {
    /// A series in the colour of its place.
    pub fn new(name: impl Into<String>, points: Vec<(f64, f64)>, style: Style) -> Self {
        Self { name: name.into(), points, style, colour: None }
    }

    /// In the colour of number `colour`, so that series that belong together look alike.
    #[must_use]
    pub fn coloured(mut self, colour: usize) -> Self {
        self.colour = Some(colour);
        self
    }
}

/// The number of each series' colour: reference lines take none.
fn colours(series: &[Series]) -> Vec<usize> {
    let mut next = 0;
    let number = |series: &Series| match (series.colour, series.style) {
        (Some(colour), _) => colour,
        (None, Style::Reference) => 0,
        (None, _) => {
            next += 1;
            next - 1
        }
    };
    series.iter().map(number).collect()
}
