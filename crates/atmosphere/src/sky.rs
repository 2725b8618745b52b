//! What a solved atmosphere answers.

use sunglint_radiometry::{Irradiance, Radiance, Spectrum, Transmittance, WorldDir};

/// What a plan wants of a provider.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Needs {
    /// E_s and τ₁.
    pub direct_beam: bool,
    /// The diffuse sky irradiance on the level.
    pub diffuse_irradiance: bool,
    /// L_d(θ, φ).
    pub directional_sky: bool,
    /// τ₂ and L_u.
    pub path: bool,
}

/// A line of sight from a target to a sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Path {
    /// Height of the target above the site's elevation \[m\].
    pub target_height: f64,
    /// Height of the sensor above the site's elevation \[m\].
    pub sensor_height: f64,
    /// Length \[m\].
    pub length: f64,
    /// From the target towards the sensor.
    pub towards_sensor: WorldDir,
}

/// The sky at one time on one grid. All spectra have one value per grid entry; heights are counted from the site's
/// elevation. Immutable, and asked from many threads.
pub trait SkyState: Send + Sync {
    /// E_s: top of the atmosphere, normal incidence, at the date's Earth–Sun distance.
    fn solar_irradiance(&self) -> &Spectrum<Irradiance>;

    /// τ₁ along the sun–target path to the ground; 0 where the sun is below the horizon.
    fn sun_transmittance(&self) -> &Spectrum<Transmittance>;

    /// Diffuse irradiance of the whole sky on the level, without the sun's disk. E_d / π is the mean sky radiance L_dsky.
    fn diffuse_irradiance(&self) -> &Spectrum<Irradiance>;

    /// The spectra B_k of L_d(ω, λ) = Σ_k s_k(ω) B_k(λ). Any field on fixed nodes of direction has this form, so geometry
    /// can be shared by all wavelengths.
    fn sky_terms(&self) -> &[Spectrum<Radiance>];

    /// Replaces `weights` by the pairs (k, s_k(ω)) that are not 0; none below the horizon.
    fn sky_weights(&self, direction: WorldDir, weights: &mut Vec<(u32, f64)>);

    /// τ₂ and L_u along a path, one value per grid entry.
    fn path(&self, path: &Path, transmittance: &mut [f64], radiance: &mut [f64]);

    /// L_d(ω) at every grid entry.
    fn sky_radiance(&self, direction: WorldDir, radiance: &mut [f64]) {
        let mut weights = Vec::new();
        self.sky_weights(direction, &mut weights);
        radiance.fill(0.0);
        for (k, s) in weights {
            radiance.iter_mut().zip(self.sky_terms()[k as usize].iter()).for_each(|(l, b)| *l += s * b);
        }
    }
}
