//! What rendering costs, in seconds of processor time.

use rayon::prelude::*;
use sunglint_tracer::{Accuracy, Tile, TileResult, View, render_tile};

use super::{BenchError, BenchProgress};
use crate::clock::thread_seconds;
use crate::{Frames, Run};

/// Frames with what they cost.
pub(super) struct Costed {
    pub frames: Frames,
    /// Seconds that threads computed, summed; the light of the frames was solved before.
    pub cpu_s: f64,
}

/// Renders at most so often.
const REPEATS: usize = 3;
/// Seconds of processor time beyond which nothing is rendered again.
const SHORT: f64 = 1.0;

/// Renders all frames of a run with its own seed. What is short is rendered again and costs the least of three: the same
/// work takes longer where other programs use the caches.
pub(super) fn measure(run: &Run, samples: u32, what: &str, progress: &dyn BenchProgress) -> Result<Costed, BenchError> {
    let mut found = render(run, samples, run.seed, what, progress)?;
    let mut spent = found.cpu_s;
    for _ in 1..REPEATS {
        if spent > SHORT {
            break;
        }
        let again = render(run, samples, run.seed, what, progress)?.cpu_s;
        spent += again;
        found.cpu_s = found.cpu_s.min(again);
    }
    Ok(found)
}

/// Renders all frames of a run with a number of samples a pixel and a seed.
pub(super) fn render(
    run: &Run,
    samples: u32,
    seed: u64,
    what: &str,
    progress: &dyn BenchProgress,
) -> Result<Costed, BenchError> {
    let tiles = run.tiles();
    progress.begin(what, tiles.len() * run.parts().count());
    let mut frames = Frames::new(run);
    let mut cpu_s = 0.0;
    for lit in run.lit_parts() {
        let one = |tile: &Tile| -> Result<(TileResult, f64), BenchError> {
            if progress.stopped() {
                return Err(BenchError::Stopped);
            }
            // A tile is rendered by one thread from end to end.
            let begun = thread_seconds();
            let result =
                lit.with_view(|view| render_tile(&View { accuracy: Accuracy::Samples(samples), seed, ..*view }, *tile));
            let spent = thread_seconds() - begun;
            progress.tile();
            Ok((result, spent))
        };
        let results: Vec<(TileResult, f64)> = tiles.par_iter().map(one).collect::<Result<_, _>>()?;
        frames.insert(&lit, tiles.iter().zip(results.iter().map(|(result, _)| result)));
        cpu_s += results.iter().map(|(_, spent)| spent).sum::<f64>();
    }
    progress.end();
    Ok(Costed { frames, cpu_s })
}
