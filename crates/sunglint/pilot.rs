//! How many samples fit into a time: a short pilot, measured and thrown away.

use std::ops::Range;
use std::time::Instant;

use rayon::prelude::*;
use sunglint_radiometry::REPLICATES;
use sunglint_tracer::Accuracy;

use crate::lit::Lit;
use crate::plan::{LEAST_SAMPLES, Run};

/// Most samples a pixel under `time`: as many as `--samples` can say again.
const MOST_TIMED: u32 = 65_536;
/// Tiles that the pilot renders, spread over the image, at least.
const PILOT_TILES: usize = 8;
/// Share of the time that a second, longer pilot may take.
const PILOT_SHARE: f64 = 0.05;
/// Times that are lit for it, where those of the first part tell too little.
const PILOT_TIMES: usize = 16;

impl Lit<'_> {
    /// The number of samples a pixel with which all times of the run take about `seconds`, told from these.
    pub(crate) fn samples_of_run(&self, seconds: f64) -> u32 {
        let within = |lit: &Lit<'_>| lit.samples_within(lit.share() * seconds);
        let times = pilot_times(self.run, &self.times);
        if times == self.times { within(self) } else { within(&self.run.lit_at(times)) }
    }

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

/// Times to measure: those of the first part or, where the sun is up at fewer of them than of all, some in a row that have their
/// share of it. Nights cost nothing but paths, and would promise more samples than days can keep.
fn pilot_times(run: &Run, first: &Range<usize>) -> Range<usize> {
    let n = run.moments.len();
    let up = |times: &Range<usize>| {
        run.moments[times.clone()].iter().filter(|moment| moment.sun.is_some_and(|sun| sun.is_up())).count()
    };
    let of_all = up(&(0..n));
    let is_fair = |times: &Range<usize>| up(times) * n >= of_all * times.len();
    let some = n.min(PILOT_TIMES);
    let others = (0..=n - some).map(|start| start..start + some);
    std::iter::once(first.clone()).chain(others).find(is_fair).unwrap_or(first.clone())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Options, Plan, check_text};

    /// Thirty times of a night and thirty of the day that follows: a part of the night is not measured, but a sunrise is.
    #[test]
    fn a_pilot_sees_its_share_of_the_sun() {
        let checked = check_text(
            "scene.glint",
            "glint 1\nsite { latitude 43 deg, longitude -77 deg, elevation 100 m }\n\
             collect night { on 1992-06-18 from 04:00 to 06:25 every 5 min, zone +00:00 }\n\
             collect daytime { on 1992-06-18 from 14:00 to 16:25 every 5 min, zone +00:00 }\natmosphere spectrl2\n\
             material grey { ideal { diffuse 0.5 } }\nground grey\n\
             sensor nadir { position (0 0 9) m, look_at (0 0 0) m, field_of_view 20 deg, pixels 8 x 8, band b 500..600 nm }\n\
             experiment base { time 1 s }\n",
        );
        let options = Options { light_at_once: Some(0), ..Options::default() };
        let plan = Plan::new(checked.sound().unwrap_or_else(|fault| panic!("{fault}")), &options)
            .unwrap_or_else(|fault| panic!("{fault}"));
        let run = &plan.runs()[0];
        assert_eq!(run.moments.len(), 60);
        assert_eq!(pilot_times(run, &(0..60)), 0..60);
        assert_eq!(pilot_times(run, &(0..45)), 22..38);
        assert_eq!(pilot_times(run, &(0..10)), 22..38);
        assert_eq!(pilot_times(run, &(40..50)), 40..50);
    }
}
