//! The top-hat lobe of the split model: constant BRDF within a cone about the mirror direction.
//!
//! ```text
//! f_s = ρ_s(θ_o) / Q(θ_o)   inside the cone, 0 outside      Q = max(Ω_s cos θ_o, P(θ_o))
//! ```
//!
//! P is the projected solid angle of that part of the cone which is above the surface. Away from the horizon
//! Q = Ω_s cos θ_o and f_s is the stated peak R_s/π, with ρ_s = R_s Ω_s cos θ_o/π. Where the horizon cuts the cone, Q = P
//! keeps the lobe from returning more than ρ_s; so neither way of the light ever has more than the largest ρ_s in
//! the cone.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use sunglint_radiometry::{Frame, LocalDir};

use crate::AngularSpectra;
use crate::quadrature::tanh_sinh_points;

/// Solid angle of the sun's disk at 1 au, π sin² 0.2666° \[sr\]; a lobe this narrow is a true mirror.
pub const SOLAR_DISK: f64 = 6.80e-5;

/// A cone about the mirror direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TopHat {
    solid_angle: f64,
    /// 1 − cos a, a the cone's half-angle.
    versine: f64,
}

impl TopHat {
    /// A cone of this solid angle \[sr\], above 0 and at most 2π.
    pub fn new(solid_angle: f64) -> Self {
        let solid_angle = solid_angle.clamp(f64::MIN_POSITIVE, TAU);
        Self { solid_angle, versine: solid_angle / TAU }
    }

    /// Half-angle \[rad\].
    pub fn half_angle(&self) -> f64 {
        2.0 * (0.5 * self.versine).sqrt().asin()
    }

    /// Whether light along `incident` is in the cone about the mirror direction of `outgoing`.
    pub fn contains(&self, incident: LocalDir, outgoing: LocalDir) -> bool {
        (incident.vec() - outgoing.mirrored().vec()).length_squared() <= 2.0 * self.versine
    }

    /// P(θ): ∫ cos θ_i dω_i over the part of the cone above the surface, its axis at angle `theta` \[rad\] to the
    /// normal (the clipped form factor of a sphere, Snyder 1996).
    pub fn projected(&self, theta: f64) -> f64 {
        let (sin_a, cos_a) = ((self.versine * (2.0 - self.versine)).sqrt(), 1.0 - self.versine);
        let (sin_t, cos_t) = theta.sin_cos();
        if theta + self.half_angle() <= FRAC_PI_2 {
            return PI * sin_a * sin_a * cos_t;
        }
        let sin_gamma = (cos_a / sin_t).min(1.0);
        let gamma = sin_gamma.asin();
        let cos_gamma = (1.0 - sin_gamma * sin_gamma).sqrt();
        let g = -2.0 * sin_t * cos_a * cos_gamma + FRAC_PI_2 - gamma + sin_gamma * cos_gamma;
        let root = (sin_a * sin_a - cos_gamma * cos_gamma).max(0.0).sqrt();
        let h = cos_t * (cos_gamma * root + sin_a * sin_a * (cos_gamma / sin_a).min(1.0).asin());
        (PI * cos_t * sin_a * sin_a + g - h).max(0.0)
    }

    /// f_s/ρ_s inside the cone \[sr⁻¹\], seen at angle `theta` \[rad\] to the normal.
    pub fn height(&self, theta: f64) -> f64 {
        1.0 / (self.solid_angle * theta.cos()).max(self.projected(theta))
    }

    /// Density of [`sample`](Self::sample) inside the cone \[sr⁻¹\].
    pub fn density(&self) -> f64 {
        1.0 / self.solid_angle
    }

    /// A direction drawn evenly over the cone; it may lie below the surface.
    pub fn sample(&self, outgoing: LocalDir, u: [f64; 2]) -> LocalDir {
        let versine = u[0] * self.versine;
        let sine = (versine * (2.0 - versine)).sqrt();
        let (sin_b, cos_b) = (TAU * u[1]).sin_cos();
        let local = glam::DVec3::new(sine * cos_b, sine * sin_b, 1.0 - versine);
        let axis = Frame::about(outgoing.mirrored().vec());
        LocalDir::from_unit(axis.to_world(LocalDir::from_unit(local)).vec())
    }

    /// Adds to `rho` the directional-hemispherical reflectance of a lobe of reflectance ρ_s(θ_o), for light at angle
    /// `theta` \[rad\] to the normal: ∫ ρ_s(θ_o) cos θ_o/Q(θ_o) dω_o over the cone, in rings of equal θ_o.
    pub fn add_albedo(&self, rho_s: &AngularSpectra, theta: f64, rho: &mut [f64]) {
        let a = self.half_angle();
        let mut ring = |theta_o: f64, weight: f64| {
            let share = weight * theta_o.cos() * self.height(theta_o);
            for (node, w) in rho_s.weights(theta_o) {
                rho.iter_mut().zip(rho_s.spectrum(node)).for_each(|(rho, value)| *rho += share * w * value);
            }
        };
        // The rings about the normal that lie wholly in the cone, then those that it cuts.
        let lower = (theta - a).abs();
        let whole = if theta < a { lower } else { 0.0 };
        tanh_sinh_points(0.0, whole.min(FRAC_PI_2), |t, dt| ring(t, TAU * t.sin() * dt));
        tanh_sinh_points(lower.min(FRAC_PI_2), (theta + a).min(FRAC_PI_2), |t, dt| {
            // A ring is in the cone to the azimuths ±φ: sin² φ/2 = (versine a − versine(θ − t)) / (2 sin θ sin t).
            let near = 2.0 * (0.5 * (theta - t)).sin().powi(2);
            let sines = (2.0 * theta.sin() * t.sin()).max(f64::MIN_POSITIVE);
            let phi = 2.0 * ((self.versine - near) / sines).clamp(0.0, 1.0).sqrt().asin();
            ring(t, 2.0 * phi * t.sin() * dt);
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// P against a sum over the cone in polar coordinates about its own axis.
    #[test]
    fn the_clipped_projected_solid_angle_agrees_with_its_integral() {
        for solid_angle in [0.0019, 0.1, 1.0, 4.0, TAU] {
            let cone = TopHat::new(solid_angle);
            for theta in [0.0, 0.3, 0.9, 1.3, 1.5, FRAC_PI_2] {
                let (n_a, n_b) = (400, 1600);
                let mut sum = 0.0;
                for j in 0..n_a {
                    // Equal steps of 1 − cos α: every cell has the same solid angle.
                    let versine = (f64::from(j) + 0.5) / f64::from(n_a) * solid_angle / TAU;
                    let sine = (versine * (2.0 - versine)).sqrt();
                    for k in 0..n_b {
                        let b = TAU * (f64::from(k) + 0.5) / f64::from(n_b);
                        sum += (theta.cos() * (1.0 - versine) + theta.sin() * sine * b.cos()).max(0.0);
                    }
                }
                let sum = sum * solid_angle / f64::from(n_a * n_b);
                // Midpoint sums with a corner at the horizon: error of the order of (1/400)² of the cone.
                assert!((cone.projected(theta) - sum).abs() < 2e-5 * solid_angle, "{solid_angle} {theta}");
            }
        }
        // A hemisphere about an axis tilted by θ sees π (1 + cos θ)/2.
        assert!((TopHat::new(TAU).projected(1.0) - PI * (1.0 + 1f64.cos()) / 2.0).abs() < 1e-12);
    }

    /// Clear of the horizon the lobe is R_s/π = ρ_s/(Ω_s cos θ) high, and light along θ_i leaves with the mean of ρ_s over the
    /// cone: with constant ρ_s, with ρ_s.
    #[test]
    fn a_lobe_clear_of_the_horizon_returns_its_reflectance() {
        let cone = TopHat::new(0.02);
        let rho_s = AngularSpectra::constant(vec![0.6]);
        for theta in [0.0, 0.05, 0.5, 1.2] {
            assert!((cone.height(theta) * 0.02 * theta.cos() - 1.0).abs() < 1e-12);
            let mut albedo = [0.0];
            cone.add_albedo(&rho_s, theta, &mut albedo);
            assert!((albedo[0] - 0.6).abs() < 1e-6, "{theta}: {}", albedo[0]);
        }
        let mut grazing = [0.0];
        cone.add_albedo(&rho_s, 1.57, &mut grazing);
        assert!(grazing[0] < 0.6);
    }
}
