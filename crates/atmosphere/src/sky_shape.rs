//! How the light of a sky is spread over its directions, each shape normalised to the irradiance it gives on the level.

use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::{LazyLock, OnceLock};

use sunglint_radiometry::{WorldDir, gauss_legendre};

use crate::embedded;

/// A published distribution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Distribution {
    /// The same radiance from everywhere.
    Isotropic,
    /// L = L₀ (1 + 2 cos θ)/3 \[Moon1942\].
    Overcast,
    /// A type of the CIE Standard General Sky \[CIE2003\].
    Cie(Cie),
}

/// Gradation φ(Z) = 1 + a e^(b/cos Z) and indicatrix f(χ) = 1 + c (e^(dχ) − e^(dπ/2)) + e cos² χ \[Darula2002\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Cie {
    a: f64,
    b: f64,
    c: f64,
    d: f64,
    e: f64,
}

impl Distribution {
    /// Type 12: CIE standard clear sky, low illuminance turbidity.
    pub fn clear() -> Self {
        Self::Cie(CIE_TYPES[0])
    }
    /// Type 13: CIE standard clear sky, polluted atmosphere.
    pub fn turbid() -> Self {
        Self::Cie(CIE_TYPES[1])
    }
}

static CIE_TYPES: LazyLock<[Cie; 2]> = LazyLock::new(|| {
    let rows = embedded::rows(include_str!("../data/sky_cie_general.csv"));
    [0, 1].map(|i| Cie { a: rows[i][1], b: rows[i][2], c: rows[i][3], d: rows[i][4], e: rows[i][5] })
});

impl Cie {
    fn gradation(&self, cos_zenith: f64) -> f64 {
        1.0 + self.a * (self.b / cos_zenith.max(1e-9)).exp()
    }

    fn indicatrix(&self, chi: f64) -> f64 {
        let cos = chi.cos();
        1.0 + self.c * ((self.d * chi).exp() - (self.d * FRAC_PI_2).exp()) + self.e * cos * cos
    }

    /// ∫ f φ cos Z dω over the upper hemisphere with the sun at a zenith angle 0..π/2. In polar coordinates about the
    /// sun, where the indicatrix has its cusp; the horizon cuts the circle of radius χ at cos α = −cot χ cot Z_s.
    fn irradiance(&self, sun_zenith: f64) -> f64 {
        static NODES: LazyLock<Vec<(f64, f64)>> = LazyLock::new(|| gauss_legendre(64));
        let (sin_s, cos_s) = sun_zenith.sin_cos();
        let circle = |chi: f64| {
            let (sin_chi, cos_chi) = chi.sin_cos();
            let (along, across) = (cos_s * cos_chi, sin_s * sin_chi);
            let open = if along >= across {
                PI
            } else if along <= -across {
                return 0.0;
            } else {
                (-along / across).clamp(-1.0, 1.0).acos()
            };
            let half: f64 = (NODES.iter())
                .map(|(x, w)| {
                    let cos_zenith = (along + across * (0.5 * open * (1.0 + x)).cos()).max(0.0);
                    w * self.gradation(cos_zenith) * cos_zenith
                })
                .sum();
            half * open * self.indicatrix(chi) * sin_chi // twice the half circle
        };
        let whole = FRAC_PI_2 - sun_zenith; // circles up to here lie above the horizon
        let mut sum = 0.0;
        for (from, to) in [(0.0, whole), (whole, PI - whole)] {
            // χ runs as a cosine between the ends, which tames the square roots of the cut circles.
            for (x, w) in NODES.iter() {
                let u = FRAC_PI_2 * (1.0 + x);
                let chi = 0.5 * (from + to) - 0.5 * (to - from) * u.cos();
                sum += w * FRAC_PI_2 * 0.5 * (to - from) * u.sin() * circle(chi);
            }
        }
        sum
    }
}

/// A distribution about one sun.
#[derive(Debug)]
pub(crate) struct SkyShape {
    distribution: Distribution,
    sun: WorldDir,
    /// π / ∫ shape cos θ dω, found when first asked for.
    scale: OnceLock<f64>,
}

impl SkyShape {
    /// About a sun; one below the horizon counts as on it.
    pub fn new(distribution: Distribution, sun: WorldDir) -> Self {
        let sun = WorldDir::from_zenith_azimuth(sun.zenith().min(FRAC_PI_2), sun.azimuth());
        Self { distribution, sun, scale: OnceLock::new() }
    }

    /// Radiance over mean radiance, L(ω) π / E_d; `None` below the horizon.
    pub fn relative(&self, direction: WorldDir) -> Option<f64> {
        let cos_zenith = direction.cos_zenith();
        if cos_zenith < 0.0 {
            return None;
        }
        Some(match self.distribution {
            Distribution::Isotropic => 1.0,
            Distribution::Overcast => 3.0 / 7.0 * (1.0 + 2.0 * cos_zenith), // ∫ (1 + 2 cos θ)/3 cos θ dω = 7π/9
            Distribution::Cie(cie) => {
                let scale = *self.scale.get_or_init(|| PI / cie.irradiance(self.sun.zenith()));
                scale * cie.gradation(cos_zenith) * cie.indicatrix(direction.angle_to(self.sun))
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Midpoints over zenith and azimuth, 1000 × 500, know nothing of the quadrature about the sun; halving their steps
    /// moves them by less than 1e-6.
    #[test]
    fn every_shape_gives_back_the_irradiance_that_it_is_scaled_to() {
        let distributions =
            [Distribution::Isotropic, Distribution::Overcast, Distribution::clear(), Distribution::turbid()];
        for distribution in distributions {
            for sun_zenith in [0.0_f64, 0.3, 42.0, 60.0, 85.0, 89.99, 90.0, 120.0] {
                let sun = WorldDir::from_zenith_azimuth(sun_zenith.to_radians(), 1.1);
                let shape = SkyShape::new(distribution, sun);
                let (n_zenith, n_azimuth) = (1000, 500);
                let (dz, da) = (FRAC_PI_2 / f64::from(n_zenith), PI / f64::from(n_azimuth));
                let mut sum = 0.0;
                for i in 0..n_zenith {
                    let zenith = (f64::from(i) + 0.5) * dz;
                    let ring: f64 = (0..n_azimuth)
                        .map(|j| WorldDir::from_zenith_azimuth(zenith, 1.1 + (f64::from(j) + 0.5) * da))
                        .map(|direction| shape.relative(direction).unwrap())
                        .sum();
                    sum += 2.0 * ring * da * zenith.sin() * zenith.cos() * dz;
                }
                assert!((sum / PI - 1.0).abs() < 1e-6, "{distribution:?}, sun at {sun_zenith}: {}", sum / PI);
            }
        }
    }

    #[test]
    fn a_clear_sky_is_brightest_at_the_sun_and_brighter_at_the_horizon_than_opposite_the_sun() {
        let sun = WorldDir::from_zenith_azimuth(0.8, 2.0);
        let shape = SkyShape::new(Distribution::clear(), sun);
        let at = |zenith: f64, azimuth: f64| shape.relative(WorldDir::from_zenith_azimuth(zenith, azimuth)).unwrap();
        assert!(at(0.8, 2.0) > 5.0 * at(0.0, 0.0));
        assert!(at(1.5, 2.0 + PI) > at(0.7, 2.0 + PI));
        assert!(shape.relative(WorldDir::from_zenith_azimuth(1.6, 0.0)).is_none());
    }

    /// Gradation and indicatrix of type 12 at the zenith with the sun there: 1 − e^−0.32, and 1 + 10 (1 − e^−1.5π) + 0.45.
    #[test]
    fn the_cie_functions_take_their_printed_values() {
        let Distribution::Cie(cie) = Distribution::clear() else { panic!("type 12 is a CIE sky") };
        assert!((cie.gradation(1.0) - (1.0 - (-0.32f64).exp())).abs() < 1e-15);
        assert!((cie.indicatrix(0.0) - (11.45 - 10.0 * (-1.5 * PI).exp())).abs() < 1e-12);
        assert!((cie.indicatrix(FRAC_PI_2) - 1.0).abs() < 1e-12);
        assert!((cie.gradation(0.0) - 1.0).abs() < 1e-15);
    }
}
