//! Directions drawn from simple densities.

use std::f64::consts::TAU;

use glam::DVec3;
use sunglint_radiometry::{Frame, LocalDir};

/// A direction with density cos θ/π.
pub(crate) fn cosine_hemisphere(u: [f64; 2]) -> LocalDir {
    let (radius, (sin_p, cos_p)) = (u[0].sqrt(), (TAU * u[1]).sin_cos());
    LocalDir::from_unit(DVec3::new(radius * cos_p, radius * sin_p, (1.0 - u[0]).max(0.0).sqrt()))
}

/// A direction with density (m+1)/(2π) cos^m α about `axis`; below the surface too.
pub(crate) fn cosine_lobe(axis: LocalDir, exponent: f64, u: [f64; 2]) -> LocalDir {
    // cos α = v^(1/(m+1)) with v in (0, 1]; sin² α = 1 − cos² α without cancellation.
    let log_cos = (-u[0]).ln_1p() / (exponent + 1.0);
    let (cos_a, sin_a) = (log_cos.exp(), (-(2.0 * log_cos).exp_m1()).max(0.0).sqrt());
    let (sin_b, cos_b) = (TAU * u[1]).sin_cos();
    let local = LocalDir::from_unit(DVec3::new(sin_a * cos_b, sin_a * sin_b, cos_a));
    LocalDir::from_unit(Frame::about(axis.vec()).to_world(local).vec())
}

/// One of `n` equally likely alternatives, and what is left of the number that chose it.
pub(crate) fn pick(n: usize, u: f64) -> (usize, f64) {
    let scaled = u * n as f64;
    let chosen = (scaled as usize).min(n.saturating_sub(1));
    (chosen, (scaled - chosen as f64).clamp(0.0, 1.0 - f64::EPSILON))
}
