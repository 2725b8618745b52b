//! How many samples fit into a time: a short pilot, measured and thrown away.

use std::time::Instant;

use rayon::prelude::*;
use sunglint_radiometry::REPLICATES;
use sunglint_tracer::Accuracy;

use crate::lit::Lit;
use crate::plan::LEAST_SAMPLES;

/// Most samples a pixel under `time`: as many as `--samples` can say again.
const MOST_TIMED: u32 = 65_536;
/// Tiles that the pilot renders, spread over the image, at least.
const PILOT_TILES: usize = 8;
/// Share of the time that a second, longer pilot may take.
const PILOT_SHARE: f64 = 0.05;

impl Lit<'_> {
    /// The number of samples a pixel with which these times take about `seconds` on the threads of the current pool, this
    /// measurement included; never fewer than 16. Only the number depends on the clock: the image is that of
    /// `samples` with it.
    pub fn samples_within(&self, seconds: f64) -> u32 {
        let started = Instant::now();
        let tiles = self.run.tiles();
        let threads = rayon::current_num_threads().clamp(1, tiles.len().max(1));
        let k = tiles.len().min(PILOT_TILES.max(threads)).max(1);
        // Seconds of all tiles with n samples, from k of its tiles.
        let measure = |n: u32| {
            let one = |i: usize| {
                let begun = Instant::now();
                self.render_tile_as(tiles[(2 * i + 1) * tiles.len() / (2 * k)], Accuracy::Samples(n));
                begun.elapsed().as_secs_f64()
            };
            let spent: f64 = (0..k).into_par_iter().map(one).collect::<Vec<f64>>().iter().sum();
            spent / k as f64 * tiles.len() as f64 / threads as f64
        };
        let short = measure(LEAST_SAMPLES);
        let spent = started.elapsed().as_secs_f64();
        // t(n) = fixed + n · each, with two measurements where there is time for them.
        let least = f64::from(LEAST_SAMPLES);
        let (fixed, each) = if 4.0 * spent < PILOT_SHARE * seconds {
            let long = measure(4 * LEAST_SAMPLES);
            let each = ((long - short) / (3.0 * least)).max(short / (8.0 * least));
            ((short - each * least).max(0.0), each)
        } else {
            (0.0, short / least)
        };
        let n = (seconds - started.elapsed().as_secs_f64() - fixed) / each.max(1e-12);
        let n = n.clamp(least, f64::from(MOST_TIMED)) as u32;
        n - n % REPLICATES as u32
    }
}
