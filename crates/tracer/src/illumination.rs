//! The light of one time, prepared for a grid.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::DVec3;
use sunglint_atmosphere::{SkyState, Sun};
use sunglint_radiometry::{SOLAR_ANGULAR_RADIUS, WorldDir, gauss_legendre};

/// The light of one time: a solved sky and the sun.
pub struct Illumination {
    /// The solved sky.
    pub sky: Box<dyn SkyState>,
    /// Towards the refracted sun; `None` where it is below the horizon or absent.
    pub sun: Option<WorldDir>,
    /// Angular radius of the sun's disk \[rad\].
    pub sun_radius: f64,
    /// E_n = E_s τ₁ at normal incidence, per grid entry \[W m⁻² µm⁻¹\].
    pub beam: Vec<f64>,
    /// L_dsky = E_d / π per grid entry \[W m⁻² sr⁻¹ µm⁻¹\].
    pub mean_sky: Vec<f64>,
}

impl Illumination {
    /// Prepares a solved sky. `sun` is `None` where there is no sun at all.
    pub fn new(sky: Box<dyn SkyState>, sun: Option<&Sun>) -> Self {
        let up = sun.filter(|sun| sun.apparent.cos_zenith() > 0.0);
        let beam = match up {
            Some(_) => {
                let (e_s, tau_1) = (sky.solar_irradiance(), sky.sun_transmittance());
                e_s.iter().zip(tau_1.iter()).map(|(e, t)| e * t).collect()
            }
            None => vec![0.0; sky.solar_irradiance().len()],
        };
        let mean_sky = sky.diffuse_irradiance().iter().map(|e_d| e_d / PI).collect();
        let distance = sun.map_or(1.0, |sun| sun.distance);
        Self {
            sun: up.map(|sun| sun.apparent).filter(|_| beam.iter().any(|e| *e > 0.0)),
            sun_radius: (SOLAR_ANGULAR_RADIUS / distance).min(FRAC_PI_2),
            sky,
            beam,
            mean_sky,
        }
    }

    /// Solid angle of the sun's disk \[sr\].
    pub fn sun_solid_angle(&self) -> f64 {
        PI * self.sun_radius.sin().powi(2)
    }

    /// Whether nothing shines: every product is black.
    pub fn is_dark(&self) -> bool {
        self.sun.is_none() && self.mean_sky.iter().all(|l| *l == 0.0)
    }

    /// What each of the sky's terms weighs in ∫ L_d cos θ dω / π over the part of the sky that a facet of this normal sees when
    /// only the horizon obstructs it.
    ///
    /// Gauss–Legendre over zenith and azimuth; the azimuth limits follow the facet's plane, and the zenith is split and
    /// stretched where they begin to close, so that smooth skies converge to rounding.
    pub(crate) fn open_sky(&self, normal: DVec3) -> Vec<f64> {
        const N: usize = 48;
        let mut sums = vec![0.0; self.sky.sky_terms().len()];
        let tilt = normal.truncate().length().atan2(normal.z);
        let aspect = normal.x.atan2(normal.y);
        let nodes = gauss_legendre(N);
        let mut weights = Vec::new();
        // Zenith at which the plane of the facet meets the sky: below it all azimuths are seen.
        let meets = (FRAC_PI_2 - tilt).abs().min(FRAC_PI_2);
        for panel in 0..2 {
            for (x, w) in &nodes {
                let u = 0.5 * (x + 1.0);
                let (zenith, d_zenith) = if panel == 0 {
                    (meets * u, 0.5 * w * meets)
                } else {
                    let span = FRAC_PI_2 - meets;
                    (meets + span * u * u, 0.5 * w * span * 2.0 * u)
                };
                if d_zenith == 0.0 {
                    continue;
                }
                let (s, c) = zenith.sin_cos();
                // n·ω = cos β cos θ + sin β sin θ cos Δφ > 0
                let (across, along) = (tilt.sin() * s, tilt.cos() * c);
                let reach = if along.abs() < across {
                    (-along / across).acos()
                } else if along > 0.0 {
                    PI
                } else {
                    0.0
                };
                for (y, v) in &nodes {
                    let azimuth = aspect + reach * y;
                    let direction = WorldDir::from_zenith_azimuth(zenith, azimuth);
                    let cos = normal.dot(direction.vec()).max(0.0);
                    self.sky.sky_weights(direction, &mut weights);
                    let measure = d_zenith * reach * v * s * cos / PI;
                    weights.iter().for_each(|(k, shape)| sums[*k as usize] += measure * shape);
                }
            }
        }
        sums
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sunglint_atmosphere::Path;
    use sunglint_radiometry::{Irradiance, Radiance, Spectrum, Transmittance};

    /// One grid entry under L(θ) = L0 (1 + 2 cos θ) / 3, or under a uniform sky.
    struct Dome {
        one: Spectrum<Irradiance>,
        clear: Spectrum<Transmittance>,
        term: Vec<Spectrum<Radiance>>,
        overcast: bool,
    }

    impl SkyState for Dome {
        fn solar_irradiance(&self) -> &Spectrum<Irradiance> {
            &self.one
        }
        fn sun_transmittance(&self) -> &Spectrum<Transmittance> {
            &self.clear
        }
        fn diffuse_irradiance(&self) -> &Spectrum<Irradiance> {
            &self.one
        }
        fn sky_terms(&self) -> &[Spectrum<Radiance>] {
            &self.term
        }
        fn sky_weights(&self, direction: WorldDir, weights: &mut Vec<(u32, f64)>) {
            weights.clear();
            let mu = direction.cos_zenith();
            if mu > 0.0 {
                weights.push((0, if self.overcast { (1.0 + 2.0 * mu) / 3.0 } else { 1.0 }));
            }
        }
        fn path(&self, _: &Path, transmittance: &mut [f64], radiance: &mut [f64]) {
            transmittance.fill(1.0);
            radiance.fill(0.0);
        }
    }

    fn under(overcast: bool) -> Illumination {
        let dome = Dome {
            one: Spectrum::new(vec![1.0]),
            clear: Spectrum::new(vec![1.0]),
            term: vec![Spectrum::new(vec![1.0])],
            overcast,
        };
        Illumination::new(Box::new(dome), None)
    }

    /// FORMULAS: tilted panel under the overcast law, E = (L0/3) {π (1+cos β)/2 + (4/3) [sin β + (π − β) cos β]}; under
    /// a uniform sky π L (1 + cos β)/2. Both at every tilt from face up to face down.
    #[test]
    fn a_tilted_panel_sees_the_closed_form_of_two_skies() {
        for degrees in [0.0, 1e-3, 10.0, 45.0, 89.999, 90.0, 120.0, 175.0, 180.0f64] {
            let beta = degrees.to_radians();
            let normal = DVec3::new(beta.sin() * 0.6, beta.sin() * 0.8, beta.cos());
            let e = [true, false].map(|overcast| PI * under(overcast).open_sky(normal)[0]);
            let tilted = beta.sin() + (PI - beta) * beta.cos();
            let overcast = (PI * (1.0 + beta.cos()) / 2.0 + 4.0 / 3.0 * tilted) / 3.0;
            let uniform = PI * (1.0 + beta.cos()) / 2.0;
            assert!((e[0] - overcast).abs() < 1e-7, "β = {degrees}: {} {overcast}", e[0]);
            assert!((e[1] - uniform).abs() < 1e-7, "β = {degrees}: {} {uniform}", e[1]);
        }
    }
}
