//! What samples that agree may all have missed: the error that replicates without a spread do not state.
//!
//! Where none of n rays was stopped, the share q of those that should be has Jeffreys' beta distribution, ½ and n + ½, and
//!
//! ```text
//! E[q²] = ¾ / ((n + 1)(n + 2))
//! ```
//!
//! is its mean square about the share that was found, 0.

use std::f64::consts::PI;
use std::ops::Range;

use smallvec::SmallVec;
use sunglint_radiometry::REPLICATES;

use crate::gathered::PixelLight;
use crate::lamp::Lamp;
use crate::light::Block;
use crate::paths::{Record, Source};
use crate::sun::{Standing, SunLight};

/// By half of the replicates and channel the sum of a², a what one sample would change if its ray were stopped, over the facets
/// where a ray to the sun might be and none of that half was; and the same of rays that looked at the sky.
pub(crate) type Unseen = [SmallVec<[[f64; 2]; 4]>; 2];

/// Variance of a mean of n samples for what they may all have missed, from the sum of a².
pub(crate) fn missed(unseen: f64, n: f64) -> f64 {
    0.75 * unseen / ((n + 1.0) * (n + 2.0))
}

/// Which half of the replicates one belongs to.
pub(crate) fn half_of(replicate: u8) -> usize {
    usize::from(replicate) * 2 / REPLICATES
}

/// The replicates of a half.
pub(crate) const fn replicates_of(half: usize) -> Range<usize> {
    half * REPLICATES / 2..(half + 1) * REPLICATES / 2
}

/// What the rays of each half found: one of those that were free, and whether any was stopped.
pub(crate) struct Found<T> {
    free: [Option<T>; 2],
    stopped: [bool; 2],
}

impl<T> Default for Found<T> {
    fn default() -> Self {
        Self { free: [None, None], stopped: [false; 2] }
    }
}

impl<T> Found<T> {
    pub fn note(&mut self, half: usize, is_free: bool, own: T) {
        if is_free {
            self.free[half] = Some(own);
        } else {
            self.stopped[half] = true;
        }
    }

    /// Of each half without a stopped ray.
    pub fn agreeing(self) -> [Option<T>; 2] {
        let [first, second] = self.free;
        [first.filter(|_| !self.stopped[0]), second.filter(|_| !self.stopped[1])]
    }
}

/// What one pixel may have missed of the sun on the Lambertian parts of its first surfaces, and of the sky over them.
pub(crate) fn unseen<'l>(
    block: &Block<'_>,
    (light, sun): (&PixelLight, &SunLight),
    lamp_of: impl Fn(usize) -> &'l Lamp,
    mean_sky: &[f64],
) -> Unseen {
    let paths = block.paths;
    let mut out: Unseen = [(); 2].map(|()| SmallVec::from_elem([0.0; 2], block.channels.len()));
    let sample = |record: &Record| &paths.samples[record.sample as usize];
    let mut add = |(half, of): (usize, usize), record: &Record, weights: &[f64], scale: f64| {
        let products = block.nodes.products(paths.spectrum(record.spectrum), weights);
        for (sum, product) in out[half].iter_mut().zip(products) {
            let value = scale * record.weight * product;
            sum[of] += value * value;
        }
    };
    for run in light.runs.iter().filter(|run| sun.groups[run.group as usize] == Standing::Mixed) {
        let group = &block.groups[run.group as usize];
        if !paths.vertices[group.first as usize].first {
            continue;
        }
        let mut found = Found::default();
        let mut whole = false;
        for record in light.grouped[run.records.clone()].iter().map(|i| &paths.records[*i as usize]) {
            let Source::Sun { vertex } = record.source else { continue };
            let i = vertex as usize;
            whole |= sun.whole[i];
            found.note(half_of(sample(record).replicate), sun.visible[i] > 0.0, (record, sun.cos[i].max(0.0)));
        }
        if whole {
            continue;
        }
        for (half, free) in found.agreeing().into_iter().enumerate() {
            let Some((record, cos)) = free else { continue };
            add((half, 0), record, &lamp_of(sample(record).cluster.into()).beam, cos);
        }
    }
    for (half, free) in light.all_sky.iter().enumerate() {
        let Some((i, share)) = *free else { continue };
        // A record of the sun has a factor 1/π.
        add((half, 1), &paths.records[i as usize], mean_sky, PI * share);
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
