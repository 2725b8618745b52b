//! τ₂ and L_u by closed forms: single scattering of the sun's beam, and Koschmieder's law for diffuse light.
//!
//! ```text
//! X   = Σ_j τ_j q_j      optical depth of the path, q_j its share of the column of constituent j
//! S   = Σ_j τ_j M u_j    of the sun's slant path to a point, u_j the share of the column above the point
//! y₀  = S(sensor)        y₁ = S(target) + X        of the sun's light by way of either end
//! τ₂  = e^(−X)
//! L_u = E_s/(4π) [X_R P_R(Θ) + ω X_a P_a(Θ)] e^(−y₀) φ(y₁ − y₀)
//!     + (X_R + ω X_a) φ(X) (E_d f + A E_g)/(2π)            φ(x) = (1 − e^(−x))/x
//! ```
//!
//! From space (S = 0 at the sensor) the first term is w E P μ₀ [1 − e^(−τ(1/μ + 1/μ₀))]/(4π(μ + μ₀)); on a level path it is
//! Koschmieder's J (1 − e^(−X)). Both hold because the exponent runs straight in optical depth from one end to the
//! other. Gases enter the exponents by the curves of growth of SPECTRL2 with the amounts of the whole way, sun to
//! sensor. f is the mean share of the scattering column above the two ends.

use std::f64::consts::PI;

use crate::sky::Path;
use crate::vertical::{Vertical, escape};

/// The spread of each constituent over height.
#[derive(Clone, Debug)]
pub(crate) struct Air {
    /// Molecules that scatter, and the uniformly mixed gases.
    pub air: Vertical,
    /// Aerosol.
    pub haze: Vertical,
    /// Water vapour.
    pub water: Vertical,
    /// Ozone.
    pub ozone: Vertical,
}

/// Amounts of the constituents in units of their vertical columns above the site.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Amounts {
    air: f64,
    haze: f64,
    water: f64,
    ozone: f64,
}

impl Air {
    fn along(&self, path: &Path) -> Amounts {
        let length = if path.length > 0.0 { path.length.min(1e12) } else { 0.0 };
        let of = |v: &Vertical| v.mean(path.target_height, path.sensor_height) * length;
        Amounts { air: of(&self.air), haze: of(&self.haze), water: of(&self.water), ozone: of(&self.ozone) }
    }

    fn above(&self, height: f64) -> Amounts {
        let of = |v: &Vertical| v.above(height);
        Amounts { air: of(&self.air), haze: of(&self.haze), water: of(&self.water), ozone: of(&self.ozone) }
    }
}

impl Amounts {
    fn slant(self, air_mass: f64, ozone_mass: f64) -> Self {
        Self {
            air: self.air * air_mass,
            haze: self.haze * air_mass,
            water: self.water * air_mass,
            ozone: self.ozone * ozone_mass,
        }
    }

    fn plus(self, other: Self) -> Self {
        Self {
            air: self.air + other.air,
            haze: self.haze + other.haze,
            water: self.water + other.water,
            ozone: self.ozone + other.ozone,
        }
    }
}

/// Optical properties of the vertical columns at one wavelength.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Optics {
    /// Rayleigh optical depth.
    pub rayleigh: f64,
    /// Aerosol optical depth, all extinction.
    pub haze: f64,
    /// Aerosol optical depth, scattering.
    pub haze_scattering: f64,
    /// Absorption coefficient × column of water.
    pub water: f64,
    /// Absorption coefficient × column of ozone.
    pub ozone: f64,
    /// Absorption coefficient of the mixed gases × pressure / 1013 hPa.
    pub mixed: f64,
    /// Solar irradiance at the top, at 1 au \[W m⁻² µm⁻¹\].
    pub solar: f64,
}

impl Optics {
    fn extinction(&self, amounts: Amounts) -> f64 {
        self.rayleigh * amounts.air + self.haze * amounts.haze
    }

    fn gases(&self, amounts: Amounts) -> f64 {
        growth_water(self.water * amounts.water) + self.ozone * amounts.ozone + growth_mixed(self.mixed * amounts.air)
    }
}

/// Exponent of water vapour's transmittance \[Bird1984, eq. 2-8\], of a_w W M.
pub(crate) fn growth_water(amount: f64) -> f64 {
    if amount > 0.0 { 0.2385 * amount / (1.0 + 20.07 * amount).powf(0.45) } else { 0.0 }
}

/// Exponent of the mixed gases' transmittance \[Bird1984, eq. 2-11\], of a_u M′.
pub(crate) fn growth_mixed(amount: f64) -> f64 {
    if amount > 0.0 { 1.41 * amount / (1.0 + 118.3 * amount).powf(0.45) } else { 0.0 }
}

/// What the sun does to a path.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Beam {
    /// Relative air mass of the sun.
    pub air_mass: f64,
    /// That of ozone.
    pub ozone_mass: f64,
    /// Cosine of the scattering angle.
    pub cos_scattering: f64,
}

/// Answer for one path at one wavelength.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Sightline {
    /// τ₂.
    pub transmittance: f64,
    /// Radiance from the sun's beam.
    pub beam: f64,
    /// Radiance per A E_g of the ground.
    pub per_ground: f64,
    /// Radiance per E_d of the sky.
    pub per_sky: f64,
}

/// Solves a path at many wavelengths, without a beam where the sun is down. `asymmetry` is the aerosol's.
pub(crate) fn sightline<'a>(
    air: &Air,
    path: &Path,
    beam: Option<Beam>,
    asymmetry: f64,
    optics: impl Iterator<Item = &'a Optics> + 'a,
) -> impl Iterator<Item = Sightline> + 'a {
    let along = air.along(path);
    let (target, sensor) = (air.above(path.target_height), air.above(path.sensor_height));
    let lit = beam.map(|beam| {
        let slant = |amounts: Amounts| amounts.slant(beam.air_mass, beam.ozone_mass);
        let phases = (rayleigh_phase(beam.cos_scattering), henyey_greenstein(beam.cos_scattering, asymmetry));
        (slant(sensor), slant(target).plus(along), phases)
    });
    optics.map(move |optics| {
        let depth = optics.extinction(along) + optics.gases(along);
        let scattered = [optics.rayleigh * along.air, optics.haze_scattering * along.haze];
        let by_sun = lit.map_or(0.0, |(near, far, (p_rayleigh, p_haze))| {
            let y0 = optics.extinction(near) + optics.gases(near);
            let y1 = optics.extinction(far) + optics.gases(far);
            let source = optics.solar / (4.0 * PI) * (scattered[0] * p_rayleigh + scattered[1] * p_haze);
            source * (-y0.min(y1)).exp() * escape((y1 - y0).abs())
        });
        let column = optics.rayleigh + optics.haze_scattering;
        let share = |above: Amounts| {
            let scattering = optics.rayleigh * above.air + optics.haze_scattering * above.haze;
            if column > 0.0 { scattering / column } else { 0.0 }
        };
        let per_ground = (scattered[0] + scattered[1]) * escape(depth) / (2.0 * PI);
        let per_sky = per_ground * 0.5 * (share(target) + share(sensor));
        Sightline { transmittance: (-depth).exp(), beam: by_sun, per_ground, per_sky }
    })
}

/// Rayleigh's phase function with depolarisation ρ_n = 0.0279, the value at 0.55 µm of \[Bodhaine1999\]; mean 1 over
/// the sphere.
pub(crate) fn rayleigh_phase(cos: f64) -> f64 {
    const GAMMA: f64 = 0.0279 / (2.0 - 0.0279);
    3.0 / (4.0 * (1.0 + 2.0 * GAMMA)) * (1.0 + 3.0 * GAMMA + (1.0 - GAMMA) * cos * cos)
}

/// Henyey and Greenstein's phase function \[Henyey1941\]; mean 1 over the sphere.
pub(crate) fn henyey_greenstein(cos: f64, g: f64) -> f64 {
    (1.0 - g * g) / (1.0 + g * g - 2.0 * g * cos).max(1e-12).powf(1.5)
}

#[cfg(test)]
mod tests {
    use super::*;
    use sunglint_radiometry::WorldDir;

    const SCALE: f64 = 8000.0;

    fn exponential() -> Vertical {
        let levels: Vec<(f64, f64)> =
            (0..=60).map(|i| 5000.0 * f64::from(i)).map(|z| (z, (-z / SCALE).exp())).collect();
        Vertical::new(&levels).0
    }

    fn air() -> Air {
        Air { air: exponential(), haze: exponential(), water: exponential(), ozone: exponential() }
    }

    fn clean(rayleigh: f64) -> Optics {
        Optics { rayleigh, haze: 0.0, haze_scattering: 0.0, water: 0.0, ozone: 0.0, mixed: 0.0, solar: 1850.0 }
    }

    fn solve(path: &Path, beam: Option<Beam>, optics: &Optics) -> Sightline {
        sightline(&air(), path, beam, 0.65, [optics].into_iter()).next().unwrap()
    }

    fn path(from: f64, to: f64, cos: f64) -> Path {
        let direction = WorldDir::from_zenith_azimuth(cos.acos(), 0.0);
        Path { target_height: from, sensor_height: to, length: (to - from) / cos, towards_sensor: direction }
    }

    /// Looking down through the whole of a conservative Rayleigh layer: w E P μ₀ [1 − e^(−τ(1/μ+1/μ₀))]/(4π(μ+μ₀)). The
    /// air mass is 1/μ₀ here; 300 km of exponential air lack e^−37 of the column.
    #[test]
    fn a_rayleigh_layer_seen_from_space_reflects_the_single_scattering_closed_form() {
        for tau in [1e-6, 0.02, 0.1, 0.8, 10.0] {
            for (mu, mu0) in [(1.0, 0.5), (0.3, 0.9), (0.7, 0.7)] {
                let cos_scattering = 0.3;
                let beam = Beam { air_mass: 1.0 / mu0, ozone_mass: 1.0, cos_scattering };
                let seen = solve(&path(0.0, 3e5, mu), Some(beam), &clean(tau));
                let exact = 1850.0 * rayleigh_phase(cos_scattering) * mu0 / (4.0 * PI * (mu + mu0))
                    * -(-tau * (1.0 / mu + 1.0 / mu0)).exp_m1();
                assert!((seen.beam / exact - 1.0).abs() < 1e-9, "{tau} {mu} {mu0}: {} {exact}", seen.beam);
                assert!((seen.transmittance / (-tau / mu).exp() - 1.0).abs() < 1e-9);
            }
        }
    }

    /// The sky light that a sensor on the ground sees at a cloudless zenith angle, by the transmitted closed form
    /// w E P μ₀ (e^(−τ/μ₀) − e^(−τ/μ))/(4π(μ₀ − μ)), and its limit at μ = μ₀.
    #[test]
    fn a_rayleigh_layer_seen_from_below_transmits_the_single_scattering_closed_form() {
        let tau = 0.25;
        for (mu, mu0) in [(0.9_f64, 0.4_f64), (0.2, 0.8), (0.6, 0.6)] {
            let beam = Beam { air_mass: 1.0 / mu0, ozone_mass: 1.0, cos_scattering: 0.8 };
            let up = Path { target_height: 3e5, sensor_height: 0.0, length: 3e5 / mu, towards_sensor: -WorldDir::UP };
            let seen = solve(&up, Some(beam), &clean(tau)).beam;
            let shape = if mu == mu0 {
                tau / mu * (-tau / mu).exp()
            } else {
                mu0 * ((-tau / mu0).exp() - (-tau / mu).exp()) / (mu0 - mu)
            };
            let exact = 1850.0 * rayleigh_phase(0.8) / (4.0 * PI) * shape;
            assert!((seen / exact - 1.0).abs() < 1e-8, "{mu} {mu0}: {seen} {exact}");
        }
    }

    /// Level paths: L = L_h (1 − e^(−bx)) from a centimetre to a thousand kilometres, b the extinction at that height.
    #[test]
    fn a_level_path_follows_koschmieder() {
        let (tau, height) = (0.4, 1500.0);
        let b = tau / SCALE * (-height / SCALE).exp();
        let beam = Beam { air_mass: 2.0, ozone_mass: 1.0, cos_scattering: -0.2 };
        let sun = (-2.0 * tau * (-height / SCALE).exp()).exp();
        let horizon = 1850.0 * rayleigh_phase(-0.2) / (4.0 * PI) * sun;
        for length in [0.01, 1.0, 300.0, 2e4, 1e6] {
            let level = Path {
                target_height: height,
                sensor_height: height,
                length,
                towards_sensor: WorldDir::from_zenith_azimuth(PI / 2.0, 0.4),
            };
            let seen = solve(&level, Some(beam), &clean(tau));
            assert!((seen.beam / (horizon * -(-b * length).exp_m1()) - 1.0).abs() < 1e-9, "{length} m");
            assert!((seen.transmittance - (-b * length).exp()).abs() < 1e-12);
            // A millimetre of slope changes nothing that can be seen.
            let sloped = solve(&Path { sensor_height: height + 1e-3, ..level }, Some(beam), &clean(tau));
            assert!((sloped.beam / seen.beam - 1.0).abs() < 1e-6);
        }
    }

    /// Inside a uniform conservative furnace, E_d = A E_g = πL, the air returns L (1 − τ₂), so that every path shows L.
    #[test]
    fn a_furnace_is_not_dimmed_by_air_that_only_scatters() {
        let level = Path { target_height: 0.0, sensor_height: 0.0, length: 3e4, towards_sensor: WorldDir::UP };
        let seen = solve(&level, None, &clean(0.5));
        let returned = PI * (seen.per_ground + seen.per_sky);
        assert!((returned - (1.0 - seen.transmittance)).abs() < 1e-12);
    }

    #[test]
    fn the_phase_functions_have_mean_one() {
        let mean = |p: &dyn Fn(f64) -> f64| -> f64 {
            sunglint_radiometry::gauss_legendre(64).iter().map(|(x, w)| 0.5 * w * p(*x)).sum()
        };
        assert!((mean(&rayleigh_phase) - 1.0).abs() < 1e-13);
        for g in [-0.5, 0.0, 0.65, 0.8] {
            assert!((mean(&|cos| henyey_greenstein(cos, g)) - 1.0).abs() < 1e-9);
        }
    }
}
