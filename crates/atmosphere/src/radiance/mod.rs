//! From a solved column to radiance along any line of sight.
//!
//! ```text
//! L = ∫ [J₁ + J] e^(−τ′) dτ′                     along the ray, from where it is seen [Chandrasekhar1960, I eq. 64]
//! J₁ dτ′ = Σ_c β_c P_c(Θ) E T′_sun ds/4π          single scattering, exact phase functions [Nakajima1988, TMS]
//! J = Σ_m cos mΔφ Σ_l ω′(2l+1)χ′_l Λ_l^m(μ) c_l^m  light scattered before, from the moments of the solved field
//! J₂ dτ′ = β_t K(Θ) ½ (q_sun + q_ray) E T′_sun ds/4π   what delta-M loses of light scattered twice
//! K = Σ_{l≥N} (2l+1) [(χ_l − f)² − f²] P_l(cos Θ) − f² Σ_{l<N} (2l+1) P_l(cos Θ)
//! f = χ_N,  τ′ = (1 − ωf) τ,  χ′_l = (χ_l − f)/(1 − f)   delta-M, N streams [Wiscombe1977, eqs. 17, 20]
//! ```
//!
//! K is the second order of the tail χ_l − f, l ≥ N, less the light that it leaves in its direction. One of the two
//! scatterings turns the light little, so that q, the scattering optical depth of the peaked scatterers (β_t a metre), is
//! counted along the sun's ray and along the line of sight, half of each. Towards the sun this is the IMS of [Nakajima1988],
//! eq. 63; it holds at every angle, upwards too, and takes two thirds of the error of 16 streams.
//!
//! On a round Earth the ray's zenith angle, the sun's and so T′_sun change along the ray. The field is solved plane-parallel
//! under beams of spherical path lengths, for a fixed row of the sun's zenith angles, and interpolated to the sun of each
//! point [Dahlback1991 for the beam; Spurr2002 for the line of sight].

mod gathered;
mod optics;
#[cfg(test)]
mod probe;
mod projected;
mod sight;
mod suns;
mod weighed;

pub(crate) use gathered::{Basket, Crossed, Gathered, gather, gather_ground, mix_azimuths};
pub(crate) use optics::{Bundle, LANES, Lanes, Optics, Turn};
#[cfg(test)]
pub(crate) use probe::Probe;
pub(crate) use projected::{Projected, project};
pub(crate) use sight::{Lattice, Look, Sight};
pub(crate) use suns::{Fan, FieldSuns, SunDepths, SunRays};
pub(crate) use weighed::Weighed;

use crate::solver::{Arriving, STREAMS, Solution, arriving, solve};

/// Solves a column at one entry: the fields of some suns, and of a shining ground.
pub(crate) fn solve_entry(optics: &Optics, suns: &FieldSuns, accuracy: f64, solution: &mut Solution) {
    solve(optics.streams, &optics.layers, &suns.beams(optics), accuracy, solution);
}

/// The irradiances at the ground alone.
pub(crate) fn arriving_at(optics: &Optics, suns: &FieldSuns) -> Arriving {
    arriving(optics.streams, &optics.layers, &suns.beams(optics))
}

/// The streams that serve a number asked for: the next that the solver has.
pub(crate) fn streams(asked: u64) -> usize {
    STREAMS.into_iter().find(|known| *known as u64 >= asked).unwrap_or(STREAMS[STREAMS.len() - 1])
}
