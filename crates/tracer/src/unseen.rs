//! What samples that agree may all have missed: the error that replicates without a spread do not state.
//!
//! Where none of n rays was stopped, the share q of those that should be has Jeffreys' beta distribution, ½ and n + ½, and
//!
//! ```text
//! E[q²] = ¾ / ((n + 1)(n + 2))
//! ```
//!
//! is its mean square about the share that was found, 0.

use glam::DVec3;
use sunglint_radiometry::REPLICATES;

use crate::gathered::PixelLight;
use crate::lamp::Lamp;
use crate::light::Block;
use crate::nodes::dot;
use crate::paths::{Record, Source};
use crate::sun::{Standing, Sun, SunLight};

/// By half of the replicates and channel the sum of a², a what one sample would change if its ray were stopped, over the facets
/// and the sky where a ray might be and none of that half was.
pub(crate) type Unseen = [Vec<f64>; 2];

/// Variance of a mean of n samples for what they may all have missed, from the sum of a².
pub(crate) fn missed(unseen: f64, n: f64) -> f64 {
    0.75 * unseen / ((n + 1.0) * (n + 2.0))
}

/// What the rays of each half found: one record of those that were free, and whether any was stopped.
#[derive(Default)]
struct Found<'a> {
    free: [Option<(&'a Record, f64)>; 2],
    stopped: [bool; 2],
}

impl<'a> Found<'a> {
    /// A record, and what else it is multiplied by.
    fn note(&mut self, half: usize, is_free: bool, record: &'a Record, scale: f64) {
        if is_free {
            self.free[half] = Some((record, scale));
        } else {
            self.stopped[half] = true;
        }
    }

    /// The halves without a stopped ray.
    fn agreeing(self) -> impl Iterator<Item = (usize, &'a Record, f64)> {
        let Self { free, stopped } = self;
        (0..2).filter(move |half| !stopped[*half]).filter_map(move |half| free[half].map(|(r, scale)| (half, r, scale)))
    }
}

/// What one pixel may have missed of the sun on the Lambertian parts of its first surfaces, and of the sky over them.
pub(crate) fn unseen<'l>(
    block: &Block<'_>,
    (light, sun, disk): (&PixelLight, &SunLight, Option<&Sun>),
    lamp_of: impl Fn(usize) -> &'l Lamp,
    mean_sky: &[f64],
) -> Unseen {
    let paths = block.paths;
    let mut out = [(); 2].map(|()| vec![0.0; block.channels.len()]);
    let sample = |record: &Record| &paths.samples[record.sample as usize];
    let half = |record: &Record| usize::from(sample(record).replicate) * 2 / REPLICATES;
    let mut add = |half: usize, record: &Record, weights: &[f64], scale: f64| {
        let (spectrum, mut start) = (paths.spectrum(record.spectrum), 0);
        for (c, sum) in out[half].iter_mut().enumerate() {
            let spectrum = &spectrum[block.nodes.of_channel(c)];
            let value = scale * record.weight * dot(spectrum, &weights[start..]);
            start += spectrum.len();
            *sum += value * value;
        }
    };
    for run in light.runs.iter().filter(|run| sun.groups[run.group as usize] == Standing::Mixed) {
        let group = &block.groups[run.group as usize];
        if !paths.vertices[group.first as usize].first {
            continue;
        }
        let (mut lo, mut hi) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let mut found = Found::default();
        for record in light.grouped[run.records.clone()].iter().map(|i| &paths.records[*i as usize]) {
            let Source::Sun { vertex } = record.source else { continue };
            let i = vertex as usize;
            let point = paths.vertices[i].hit.point;
            (lo, hi) = (lo.min(point), hi.max(point));
            found.note(half(record), sun.visible[i] > 0.0, record, sun.cos[i].max(0.0));
        }
        let is_proved = || disk.is_some_and(|disk| disk.is_whole(&block.scenery.world, group, lo, hi));
        if found.stopped == [false; 2] && is_proved() {
            continue;
        }
        for (half, record, cos) in found.agreeing() {
            add(half, record, &lamp_of(sample(record).cluster.into()).beam, cos);
        }
    }
    let mut found = Found::default();
    for record in light.changing.iter().map(|i| &paths.records[*i as usize]) {
        match record.source {
            Source::Sky { seen: Some((vertex, escaped)), .. } if sample(record).vertex == Some(vertex) => {
                found.note(half(record), escaped, record, 1.0);
            }
            _ => {}
        }
    }
    for (half, record, scale) in found.agreeing() {
        add(half, record, mean_sky, scale);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ∫ q² dB(½, n + ½) by the midpoint rule in √q, where the density has no pole.
    #[test]
    fn the_mean_square_is_that_of_jeffreys_distribution() {
        for n in [0.0, 16.0, 256.0] {
            let m = 200_000;
            let density = |x: f64| (1.0 - x * x).powf(n - 0.5);
            let at = |i: i32| (f64::from(i) + 0.5) / f64::from(m);
            // The pole at q = 1, for n = 0, is taken off by x = sin φ.
            let of = |power: i32| -> f64 {
                (0..m)
                    .map(|i| (at(i) * std::f64::consts::FRAC_PI_2).sin_cos())
                    .map(|(sin, cos)| sin.powi(power) * density(sin) * cos)
                    .sum()
            };
            assert!((of(4) / of(0) / missed(1.0, n) - 1.0).abs() < 1e-6, "{n}");
        }
    }
}
