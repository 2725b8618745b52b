//! What a run will cost, from a few blocks of its pixels, rendered and thrown away.

use rayon::prelude::*;
use sunglint_tracer::{Accuracy, Lights, RayCounts, Spent, Tile, View, render_tile_timed, tiles};

use crate::clock::thread_seconds;
use crate::plan::{LEAST_SAMPLES, Run};

/// Blocks that are rendered, spread over the image, and times that they are lit at.
const BLOCKS: usize = 8;
const TIMES: usize = 3;
/// Most samples a pixel.
const MOST_SAMPLES: u32 = 64;

/// What all pixels of a run will take, its air solved before.
#[derive(Clone, Debug, PartialEq)]
pub struct Forecast {
    /// Pixels that were rendered.
    pub pixels: usize,
    /// Samples a pixel that the numbers are for: the run's own, or 16 where the noise or the clock will choose them.
    pub samples: u32,
    /// Rays of the paths, whatever the times.
    pub camera: f64,
    /// Over hemispheres.
    pub hemisphere: f64,
    /// Along mirror directions.
    pub mirror: f64,
    /// Processor time of tracing them, shared by all times \[s\].
    pub trace_cpu_s: f64,
    /// To the sun, for each time at which anything shines.
    pub sun_per_time: f64,
    /// To the sun by way of mirrors, for each such time.
    pub caustic_per_time: f64,
    /// To the sun, proved unnecessary.
    pub sun_skipped_per_time: f64,
    /// Processor time of lighting the paths, for each such time \[s\].
    pub light_cpu_s_per_time: f64,
}

impl Run {
    /// Renders a few blocks of pixels at up to three of the times, and says what all pixels will take.
    pub fn forecast(&self) -> Forecast {
        let samples = match (self.accuracy, self.budget) {
            (Accuracy::Samples(n), None) => n.next_multiple_of(LEAST_SAMPLES),
            _ => LEAST_SAMPLES,
        };
        let taken = samples.min(MOST_SAMPLES);
        let shining = self.shining();
        let n_times = shining.len().min(TIMES);
        let of_time = |i: usize| {
            let t = shining[(2 * i + 1) * shining.len() / (2 * n_times)];
            Lights::new(self.light(t), &self.traced, &self.nodes, n_times)
        };
        let times: Vec<Lights> = (0..n_times).map(of_time).collect();
        let blocks = self.some_blocks();
        let render = |accuracy: Accuracy| -> (RayCounts, Spent) {
            let one = |block: &Tile| {
                let sight = self.sight();
                let view = View { accuracy, ..self.view(&sight, &times) };
                let (result, spent) = render_tile_timed(&view, *block, &thread_seconds);
                (result.rays, spent)
            };
            let of_blocks: Vec<(RayCounts, Spent)> = blocks.par_iter().map(one).collect();
            let (mut rays, mut spent) = (RayCounts::default(), Spent::default());
            for (of_block, own) in &of_blocks {
                rays += *of_block;
                spent += own;
            }
            (rays, spent)
        };
        // What is solved along lines of sight serves many blocks of a whole image: here it is solved before the clock runs.
        render(Accuracy::Samples(LEAST_SAMPLES));
        let (rays, spent) = render(Accuracy::Samples(taken));
        let pixels: usize = blocks.iter().map(|block| (block.width * block.height) as usize).sum();
        let all = f64::from(self.pixels.0) * f64::from(self.pixels.1);
        let scale = all / pixels.max(1) as f64 * f64::from(samples) / f64::from(taken);
        // Paths are traced anew for each part of the times.
        let parts = self.parts().count() as f64;
        let whole = |count: u64| count as f64 * scale * parts;
        let of_times = |count: u64| count as f64 * scale / n_times.max(1) as f64;
        Forecast {
            pixels,
            samples,
            camera: all * f64::from(samples + 1) * parts,
            hemisphere: whole(rays.hemisphere),
            mirror: whole(rays.mirror),
            trace_cpu_s: spent.shared * scale * parts,
            sun_per_time: of_times(rays.sun),
            caustic_per_time: of_times(rays.caustic),
            sun_skipped_per_time: of_times(rays.sun_turned_away + rays.sun_proved_clear + rays.sun_proved_shaded),
            light_cpu_s_per_time: spent.light.iter().sum::<f64>() * scale / n_times.max(1) as f64,
        }
    }

    /// Times at which anything shines, or the first; where the air is not solved yet, those with the sun up.
    fn shining(&self) -> Vec<usize> {
        let shines = |t: &usize| match self.kept() {
            Some(light) => !light.of(*t).is_dark(),
            None => self.moments[*t].sun.is_some_and(|sun| sun.is_up()),
        };
        let shining: Vec<usize> = (0..self.moments.len()).filter(shines).collect();
        if shining.is_empty() { (0..self.moments.len()).take(1).collect() } else { shining }
    }

    /// Blocks of pixels, spread evenly over the window.
    fn some_blocks(&self) -> Vec<Tile> {
        /// Steps of the golden section leave no gap.
        const GOLDEN: f64 = 0.618_033_988_749_895;
        let mut blocks: Vec<Tile> = Vec::new();
        for i in 0..BLOCKS {
            let at = |u: f64, start: u32, n: u32| start + ((u * f64::from(n)) as u32).min(n.saturating_sub(1));
            let x = at((GOLDEN * (i as f64 + 0.5)).fract(), self.window.x, self.window.width);
            let y = at((i as f64 + 0.5) / BLOCKS as f64, self.window.y, self.window.height);
            let block = tiles(self.camera.pixels(), Tile { x, y, width: 1, height: 1 });
            blocks.extend(block.into_iter().filter(|block| !blocks.contains(block)).collect::<Vec<_>>());
        }
        blocks
    }
}
