//! The radiance algorithms, registered like models; sampling; tiles; and the light of many times on paths that are
//! traced once.
//!
//! A view (one sensor, all its times) is rendered tile by tile. Within a tile, blocks of pixels are traced by an
//! [`Algorithm`] into [`Paths`]: vertices, escapes to the sky, and products of reflectances at the [`Nodes`] of the channels,
//! none of which depends on a time. Each time then lights the same paths, and channels are folded before mean and variance
//! are formed.

mod algorithm;
mod allocation;
mod band_means;
mod corners;
mod even;
mod full;
mod gathered;
mod hemisphere;
mod illumination;
mod irradiance_cache;
mod lamp;
mod light;
mod limb;
mod mirrors;
mod nodes;
mod paths;
mod pixel;
mod published;
mod render;
mod sampler;
mod scenery;
mod sightline;
mod sun;
mod unseen;
mod vectors;

pub use algorithm::{Algorithm, BUILTIN, Draw, EXACT, Lighting};
pub use allocation::Worth;
pub use band_means::BandMeans;
pub use full::FULL;
pub use illumination::Illumination;
pub use lamp::Lights;
pub use nodes::Nodes;
pub use paths::{Paths, RayCounts};
pub use pixel::Term;
pub use published::{Approximations, IDEAL, SPLIT};
pub use render::{
    Accuracy, PixelTerms, Spent, Tile, TileResult, View, render_pixel_terms, render_tile, render_tile_timed,
    render_tile_together, tile_side, tiles,
};
pub use sampler::Stream;
pub use scenery::{Scenery, Surface, spectra_of, split_at};
pub use sightline::Sight;
