//! Where the pixels of a sensor look.

use glam::{DVec2, DVec3};
use sunglint_radiometry::WorldDir;

/// The line of sight of one point of the image plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraRay {
    /// Where the ray starts, world frame \[m\].
    pub origin: DVec3,
    /// Where it looks.
    pub direction: WorldDir,
}

/// A sensor's geometry. Image coordinates are in pixels: x across from the left edge, y down from the top edge, so the
/// middle of the first pixel is (0.5, 0.5).
pub trait Camera: Send + Sync {
    /// Pixels across and down.
    fn pixels(&self) -> (u32, u32);
    /// Position of the sensor, world frame \[m\]; of a scanner, at the middle of its first line. Panels that face the
    /// sensor face this point; lines of sight start at their own.
    fn position(&self) -> DVec3;
    /// The line of sight at image coordinates.
    fn ray(&self, x: f64, y: f64) -> CameraRay;
    /// Where image coordinates fall on the level plane at a height \[m\], if the sensor looks straight down and the image
    /// is a map of that plane: affine, with square corners and not mirrored.
    fn ground(&self, height: f64) -> Option<GroundMap> {
        let _ = height;
        None
    }
}

/// An image that is a map: (x, y) of the world \[m\] = `corner` + x `across` + y `down`, in image coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GroundMap {
    /// Of the image's upper left corner.
    pub corner: DVec2,
    /// From pixel to pixel.
    pub across: DVec2,
    /// From line to line.
    pub down: DVec2,
}

impl GroundMap {
    /// Where image coordinates lie, x and y of the world \[m\].
    pub fn at(&self, x: f64, y: f64) -> DVec2 {
        self.corner + x * self.across + y * self.down
    }
}

/// Why numbers make no camera.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CameraError {
    /// A side of the image has no pixel.
    #[error("an image needs at least one pixel each way, not {0} x {1}")]
    NoPixels(u32, u32),
    /// The sensor stands at the point it looks at.
    #[error("the sensor stands at its own look_at, so it has no direction to look in")]
    LookAtItself,
    /// A scanner looks where it flies.
    #[error("the scanner looks along its flight, so its lines have no direction across")]
    AlongTheFlight,
    /// A coordinate is not finite.
    #[error("the {0} is not finite")]
    NotFinite(&'static str),
    /// A quantity is out of its range.
    #[error("the {what} lies {range}, not at {value}")]
    OutOfRange {
        /// The quantity.
        what: &'static str,
        /// Its range in words.
        range: &'static str,
        /// What was given, in canonical units.
        value: f64,
    },
    /// A target is to be seen from above, but the sensor's height is not above it.
    #[error("the sensor, at {sensor} m, is not above its target, at {target} m")]
    BelowTarget {
        /// Height of the sensor \[m\].
        sensor: f64,
        /// Height of the target \[m\].
        target: f64,
    },
}

/// That `value` is finite and within `low..=high`; with `open`, strictly within.
pub(crate) fn within(
    what: &'static str,
    value: f64,
    (low, high): (f64, f64),
    open: bool,
    range: &'static str,
) -> Result<(), CameraError> {
    let holds = if open { low < value && value < high } else { low <= value && value <= high };
    if holds { Ok(()) } else { Err(CameraError::OutOfRange { what, range, value }) }
}

/// That an image has pixels.
pub(crate) fn with_pixels(pixels: (u32, u32)) -> Result<(), CameraError> {
    if pixels.0 == 0 || pixels.1 == 0 { Err(CameraError::NoPixels(pixels.0, pixels.1)) } else { Ok(()) }
}
