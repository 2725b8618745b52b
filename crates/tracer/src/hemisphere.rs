//! Directions over a facet.

use glam::DVec3;
use sunglint_geometry::Hit;
use sunglint_radiometry::{Frame, LocalDir, WorldDir};

use crate::Stream;
use crate::sampler::{concentric_disk, cosine_hemisphere};

/// Sky fraction of an unobstructed facet of this normal: (1 + cos β)/2.
pub(crate) fn open_sky_view(normal: DVec3) -> f64 {
    0.5 * (1.0 + normal.z.clamp(-1.0, 1.0))
}

/// A cosine-weighted direction of the facet's hemisphere.
pub(crate) fn hemisphere_direction(hit: &Hit, stream: &mut Stream) -> WorldDir {
    Frame::about(hit.normal).to_world(LocalDir::from_unit(cosine_hemisphere(stream.next2())))
}

/// A cosine-weighted direction of the facet's hemisphere, given that it points below the horizon; `None` where the facet
/// is level.
///
/// Cosine-weighted directions are uniform in Nusselt's disk about the normal. The horizon is there the half-ellipse
/// y = cos β √(1 − x²), x along the strike and y downhill, so squeezing the disk's chords into what lies beyond it keeps
/// the points uniform.
pub(crate) fn below_horizon(hit: &Hit, stream: &mut Stream) -> Option<WorldDir> {
    let cos_tilt = hit.normal.z.clamp(-1.0, 1.0);
    let u = stream.next2();
    (cos_tilt < 1.0)
        .then(|| squeezed(hit.normal, u, |rim, chord| 0.5 * ((1.0 + cos_tilt) * rim + (1.0 - cos_tilt) * chord)))
}

/// The same given that it points above the horizon; `None` where the facet faces straight down.
pub(crate) fn above_horizon(hit: &Hit, stream: &mut Stream) -> Option<WorldDir> {
    let cos_tilt = hit.normal.z.clamp(-1.0, 1.0);
    let u = stream.next2();
    (cos_tilt > -1.0)
        .then(|| squeezed(hit.normal, u, |rim, chord| 0.5 * ((cos_tilt - 1.0) * rim + (1.0 + cos_tilt) * chord)))
}

/// The direction at (x, y) of Nusselt's disk, y = `place`(rim, chord) of a uniform point (x, chord), |chord| ≤ rim.
fn squeezed(normal: DVec3, u: [f64; 2], place: impl Fn(f64, f64) -> f64) -> WorldDir {
    let [x, chord] = concentric_disk(u);
    let rim = (1.0 - x * x).max(0.0).sqrt();
    let y = place(rim, chord);
    let z = (rim * rim - y * y).max(0.0).sqrt();
    let down = (normal.z * normal - DVec3::Z).try_normalize().unwrap_or(DVec3::X);
    let strike = down.cross(normal);
    WorldDir::new(x * strike + y * down + z * normal)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, PI};
    use sunglint_geometry::{FacetId, MaterialId};

    /// Directions below the horizon of a facet tilted by β carry the mean cosine to the normal of that lune, and those above
    /// that of the rest: ∫ cos² dω / ∫ cos dω, here by brute-force rejection from the whole hemisphere, within 4 standard
    /// errors.
    #[test]
    fn the_parts_above_and_below_the_horizon_are_cosine_weighted() {
        for beta in [0.3, FRAC_PI_2, 2.5, PI] {
            let normal = DVec3::new(beta.sin() * 0.6, -beta.sin() * 0.8, beta.cos());
            let hit = Hit {
                t: 1.0,
                point: DVec3::ZERO,
                error: 0.0,
                normal,
                front: true,
                material: MaterialId(0),
                instance: 0,
                facet: FacetId(0),
            };
            let n = 20_000;
            let moments = |draws: &[DVec3]| {
                let n = draws.len() as f64;
                let mean = draws.iter().map(|d| d.dot(normal)).sum::<f64>() / n;
                (mean, (draws.iter().map(|d| (d.dot(normal) - mean).powi(2)).sum::<f64>() / n / n).sqrt())
            };
            let all: Vec<DVec3> =
                (0..4 * n).map(|i| hemisphere_direction(&hit, &mut Stream::new(2, 0, 0, 0, i)).vec()).collect();
            let share = all.iter().filter(|d| d.z < 0.0).count() as f64 / f64::from(4 * n);
            assert!((share - 0.5 * (1.0 - beta.cos())).abs() < 0.01, "share of the lune at β = {beta}");
            for below in [true, false] {
                let part = |i| match below {
                    true => below_horizon(&hit, &mut Stream::new(1, 0, 0, 0, i)),
                    false => above_horizon(&hit, &mut Stream::new(1, 0, 0, 0, i)),
                };
                let direct: Vec<DVec3> = (0..n).filter_map(part).map(WorldDir::vec).collect();
                let sign = if below { -1.0 } else { 1.0 };
                assert!(direct.iter().all(|d| sign * d.z >= -1e-9 && d.dot(normal) >= -1e-12));
                let rejected: Vec<DVec3> = all.iter().copied().filter(|d| (d.z < 0.0) == below).collect();
                if rejected.is_empty() {
                    continue;
                }
                let (a, b) = (moments(&direct), moments(&rejected));
                assert!((a.0 - b.0).abs() < 4.0 * a.1.hypot(b.1), "β = {beta}, below {below}: {a:?} {b:?}");
            }
        }
    }
}
