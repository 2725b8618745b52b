//! Quantities shared by all of Sunglint. Canonical units stand in `docs/CONVENTIONS.md`: wavelength in µm, spectral
//! radiance in W m⁻² sr⁻¹ µm⁻¹, angles in rad, lengths in m. World frame: x east, y north, z up.

mod channel;
mod curve;
mod direction;
mod estimate;
mod quadrature;
mod spectrum;
mod units;
mod wavelength;

pub use channel::{Channel, Channels};
pub use curve::{Curve, CurveError, Extrapolation};
pub use direction::{Frame, LocalDir, WorldDir, relative_azimuth};
pub use estimate::{Estimate, REPLICATES, STUDENT_T_95, estimate};
pub use quadrature::gauss_legendre;
pub use spectrum::{Irradiance, Radiance, Reflectance, Spectrum, Transmittance};
pub use units::{Dimension, UNITS, Unit, unit, units_of};
pub use wavelength::{Bin, Entry, SpectralGrid, Wavelength};

/// Angular radius of the sun's disk at 1 au \[rad\]: 0.2666°, so that its solid angle is
/// 6.80e-5 sr.
pub const SOLAR_ANGULAR_RADIUS: f64 = 0.2666 * std::f64::consts::PI / 180.0;
