//! Clouds of water drops of effective radius 10 µm \[Slingo1989\].
//!
//! ```text
//! extinction ∝ a + b/r_e      1 − ω = c + d r_e      g = e + f r_e       P Henyey–Greenstein's
//! ```
//!
//! Two bands, 0.25–0.69 and 0.69–1.19 µm; between the bands' middles straight lines, beyond them held.

use std::sync::{Arc, LazyLock};

use crate::aerosol::{AerosolOptics, REFERENCE};
use crate::embedded;
use crate::phase::Phase;

/// r_e \[µm\].
pub(crate) const EFFECTIVE_RADIUS: f64 = 10.0;

/// Middle of the band \[µm\], extinction of any scale, 1 − ω, g.
static BANDS: LazyLock<Vec<[f64; 4]>> = LazyLock::new(|| {
    (embedded::rows(include_str!("../data/cloud_slingo1989.csv")).iter())
        .map(|r| {
            [
                0.5 * (r[0] + r[1]),
                r[2] + r[3] / EFFECTIVE_RADIUS,
                r[4] + r[5] * EFFECTIVE_RADIUS,
                r[6] + r[7] * EFFECTIVE_RADIUS,
            ]
        })
        .collect()
});

fn at(wavelength: f64) -> [f64; 3] {
    let (a, b) = (&BANDS[0], &BANDS[1]);
    let t = ((wavelength - a[0]) / (b[0] - a[0])).clamp(0.0, 1.0);
    std::array::from_fn(|i| a[i + 1] + t * (b[i + 1] - a[i + 1]))
}

/// Properties at a wavelength \[µm\]; extinction over that at 0.55 µm.
pub(crate) fn optics(wavelength: f64) -> AerosolOptics {
    let ([here, co_albedo, g], [reference, ..]) = (at(wavelength), at(REFERENCE));
    AerosolOptics {
        extinction: here / reference,
        albedo: 1.0 - co_albedo,
        phase: Arc::new(Phase::henyey_greenstein(g)),
    }
}
