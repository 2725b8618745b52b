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
    /// Lowest and highest height above the site's elevation \[m\] of targets and sensors, between which all paths run but
    /// for what the corners of a block of pixels overshoot; `None` where any height may be asked for.
    pub path_heights: Option<(f64, f64)>,
}

impl Needs {
    /// What either wants.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        let heights = match (self.path, other.path) {
            (true, true) => {
                self.path_heights.zip(other.path_heights).map(|((a, b), (c, d))| (f64::min(a, c), f64::max(b, d)))
            }
            (true, false) => self.path_heights,
            (false, _) => other.path_heights,
        };
        Self {
            direct_beam: self.direct_beam || other.direct_beam,
            diffuse_irradiance: self.diffuse_irradiance || other.diffuse_irradiance,
            directional_sky: self.directional_sky || other.directional_sky,
            path: self.path || other.path,
            path_heights: heights,
        }
    }
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

    /// Lines for the plan and the manifest: what was assumed, estimated or left out in solving this column.
    fn notes(&self) -> Vec<String> {
        Vec::new()
    }

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

#[cfg(test)]
mod tests {
    use super::*;

    /// Heights matter where a path is wanted; where one side knows no bounds, there are none.
    #[test]
    fn what_two_want_together_holds_what_each_wants() {
        let beam = Needs { direct_beam: true, ..Needs::default() };
        let low = Needs { path: true, path_heights: Some((0.0, 20.0)), ..Needs::default() };
        let high = Needs { path: true, path_heights: Some((-5.0, 10.0)), diffuse_irradiance: true, ..low };
        assert_eq!(low.union(high), Needs { path_heights: Some((-5.0, 20.0)), ..high });
        assert_eq!(beam.union(low), Needs { direct_beam: true, ..low });
        assert_eq!(low.union(beam), beam.union(low));
        assert_eq!(low.union(Needs { path_heights: None, ..low }).path_heights, None);
    }
}
