//! Aerosol models behind one trait.

use std::sync::Arc;

use sunglint_plugin::Model;

use crate::phase::Phase;

/// An aerosol: its optical properties at any wavelength and humidity. How much of it the air holds, and where, the
/// weather says.
pub trait Aerosol: Send + Sync + std::fmt::Debug {
    /// Properties at a wavelength \[µm\] in air of a relative humidity 0..1, which shapes the particles.
    fn optics(&self, wavelength: f64, humidity: f64) -> AerosolOptics;
}

/// Optical properties of an aerosol at one wavelength.
#[derive(Clone, Debug)]
pub struct AerosolOptics {
    /// Extinction over that at 0.55 µm.
    pub extinction: f64,
    /// Single-scattering albedo ω.
    pub albedo: f64,
    /// Phase function.
    pub(crate) phase: Arc<Phase>,
}

/// The aerosols this build knows.
pub const AEROSOLS: &[Model<dyn Aerosol>] = &[];
