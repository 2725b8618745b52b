//! Integrals over an interval and over the hemisphere.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::DVec3;
use sunglint_radiometry::{LocalDir, gauss_legendre};

/// Calls `visit` with the points and weights of the tanh-sinh rule over `a..b`, 103 of them; not at all for an empty
/// interval.
pub(crate) fn tanh_sinh_points(a: f64, b: f64, mut visit: impl FnMut(f64, f64)) {
    const STEP: f64 = 1.0 / 16.0;
    if b <= a {
        return;
    }
    let (middle, half) = (0.5 * (a + b), 0.5 * (b - a));
    for k in -51..=51 {
        let t = STEP * f64::from(k);
        let s = FRAC_PI_2 * t.sinh();
        let c = s.cosh();
        visit(middle + half * s.tanh(), half * STEP * FRAC_PI_2 * t.cosh() / (c * c));
    }
}

/// ∫ f over `a..b` by the same rule: 1e-10 and better for functions that are smooth inside and have at most roots at
/// the ends.
pub(crate) fn tanh_sinh(a: f64, b: f64, f: impl Fn(f64) -> f64) -> f64 {
    let mut sum = 0.0;
    tanh_sinh_points(a, b, |x, weight| sum += weight * f(x));
    sum
}

/// A rule for integrals over the directions above a surface, for light at one angle to the normal.
pub(crate) struct Hemisphere {
    nodes: Vec<(f64, f64)>,
    /// Of the azimuths of half vectors, over which lobes change little.
    round: Vec<(f64, f64)>,
}

impl Hemisphere {
    /// Enough for tables: 1e-4 of the lobes and kernels of this crate, some 500 directions.
    pub fn coarse() -> Self {
        Self::of(16, 12)
    }

    /// Enough for what is left of 1: 1e-4 of Gaussian lobes along the horizon too, some 700 directions.
    pub fn medium() -> Self {
        Self::of(30, 12)
    }

    /// Enough to be compared with: 1e-6 of what is smooth, some 4000 directions.
    pub fn fine() -> Self {
        Self::of(40, 24)
    }

    fn of(n: usize, round: usize) -> Self {
        Self { nodes: gauss_legendre(n), round: gauss_legendre(round) }
    }

    /// Points of `a..b` that gather towards both ends as sin² does, with their weights: roots at the ends are smooth there.
    fn gathered(&self, a: f64, b: f64, mut visit: impl FnMut(f64, f64)) {
        if b <= a {
            return;
        }
        for (x, w) in &self.nodes {
            let v = FRAC_PI_2 * (0.5 + 0.5 * x);
            let (s, c) = v.sin_cos();
            visit(a + (b - a) * s * s, (b - a) * 2.0 * s * c * 0.5 * FRAC_PI_2 * w);
        }
    }

    /// Calls `visit` with directions ω and weights cos θ dω of ∫ g(ω) cos θ dω, for g even in the azimuth, smooth but for
    /// cusps at the angle `theta` \[rad\] of the light (azimuth 0) and at a right azimuth.
    pub fn even(&self, theta: f64, mut visit: impl FnMut(LocalDir, f64)) {
        for (from, to) in [(0.0, theta), (theta, FRAC_PI_2)] {
            self.gathered(from, to, |t, dt| {
                let (sin_t, cos_t) = t.sin_cos();
                for quarter in [0.0, FRAC_PI_2] {
                    self.gathered(quarter, quarter + FRAC_PI_2, |phi, dphi| {
                        let (sin_p, cos_p) = phi.sin_cos();
                        let direction = LocalDir::from_unit(DVec3::new(sin_t * cos_p, sin_t * sin_p, cos_t));
                        visit(direction, 2.0 * cos_t * sin_t * dt * dphi);
                    });
                }
            });
        }
    }

    /// The same over half vectors h between the light and ω, for g that falls off with tan θ_h/`slope` and has corners at the
    /// ascending angles θ_h of `corners` \[rad\]:
    ///
    /// ```text
    /// dω = 4 (i·h) dω_h      tan θ_h = slope tan ψ      i·h = a + b cos φ      ω_z = 2 (i·h) cos θ_h − cos θ
    /// ```
    ///
    /// Up to θ_h = (90° − θ)/2 every azimuth φ of h sends light up, beyond (90° + θ)/2 none does.
    pub fn lobe(&self, theta: f64, slope: f64, corners: &[f64], mut visit: impl FnMut(LocalDir, f64)) {
        let (sin_i, cos_i) = theta.sin_cos();
        let incident = DVec3::new(sin_i, 0.0, cos_i);
        let mut ring = |psi: f64, dpsi: f64| {
            let (sin_psi, cos_psi) = psi.sin_cos();
            let t = (slope * sin_psi).atan2(cos_psi);
            let dt = slope / (cos_psi * cos_psi + slope * slope * sin_psi * sin_psi) * dpsi;
            let (sin_t, cos_t) = t.sin_cos();
            let (a, b) = (cos_i * cos_t, sin_i * sin_t);
            let most = if (theta + 2.0 * t) <= FRAC_PI_2 {
                PI
            } else {
                ((0.5 * cos_i / cos_t - a) / b).clamp(-1.0, 1.0).acos()
            };
            for (x, w) in &self.round {
                let phi = most * (0.5 + 0.5 * x);
                let (sin_p, cos_p) = phi.sin_cos();
                let cosine = a + b * cos_p;
                let h = DVec3::new(sin_t * cos_p, sin_t * sin_p, cos_t);
                let outgoing = 2.0 * cosine * h - incident;
                if cosine > 0.0 && outgoing.z > 0.0 {
                    let solid = 4.0 * cosine * sin_t * dt * most * w;
                    visit(LocalDir::from_unit(outgoing), outgoing.z * solid);
                }
            }
        };
        let (whole, none) = (0.5 * (FRAC_PI_2 - theta), 0.5 * (FRAC_PI_2 + theta));
        let psi = |t: f64| t.sin().atan2(slope * t.cos());
        let (whole, none) = (psi(whole.max(0.0)), psi(none.min(FRAC_PI_2)));
        let mut from = 0.0;
        for to in corners.iter().map(|t| psi(*t)).filter(|psi| *psi < whole).chain([whole]) {
            let half = 0.5 * (to - from);
            self.nodes.iter().for_each(|(x, w)| ring(from + half * (1.0 + x), half * w));
            from = to;
        }
        for to in corners.iter().map(|t| psi(*t)).filter(|psi| *psi > whole && *psi < none).chain([none]) {
            self.gathered(from, to, &mut ring);
            from = to;
        }
    }
}

/// 2 ∫ R(θ) cos θ sin θ dθ from 0 to 90° by 32 points in cos² θ.
pub(crate) fn cosine_mean(r: impl Fn(f64) -> f64) -> f64 {
    gauss_legendre(32).into_iter().map(|(x, w)| 0.5 * w * r((0.5 + 0.5 * x).sqrt().acos())).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ∫₀¹ √x (1−x)^1.5 dx = B(3/2, 5/2) = π/16, roots at both ends.
    #[test]
    fn roots_at_the_ends_cost_no_digits() {
        let integral = tanh_sinh(0.0, 1.0, |x| x.sqrt() * (1.0 - x).max(0.0).powf(1.5));
        assert!((integral - PI / 16.0).abs() < 1e-9, "{integral}");
        assert_eq!(tanh_sinh(1.0, 1.0, |_| f64::NAN), 0.0);
    }

    /// ∫ cos θ dω = π by either map, whatever the angle of the light and the slope; ∫ (1 + x) cos θ dω is the same, since x is
    /// odd over the hemisphere.
    #[test]
    fn both_maps_cover_the_hemisphere_once() {
        for theta in [0.0, 0.3, 0.9, 1.4, 1.57] {
            for rule in [Hemisphere::coarse(), Hemisphere::fine()] {
                let (mut flat, mut tilted) = (0.0, 0.0);
                rule.even(theta, |d, w| {
                    flat += w;
                    tilted += w * (1.0 + d.vec().x);
                });
                assert!((flat - PI).abs() < 1e-9 && (tilted - PI).abs() < 1e-6, "{theta}: {flat} {tilted}");
            }
            for slope in [0.3, 1.0] {
                let mut sum = 0.0;
                Hemisphere::fine().lobe(theta, slope, &[0.2], |d, w| sum += w * (1.0 + d.vec().x));
                assert!((sum - PI).abs() < 2e-4, "{theta} {slope}: {sum}");
            }
        }
    }
}
