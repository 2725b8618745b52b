//! The columns at which radiances are solved, and how the entries of a grid draw on them.
//!
//! A column of the ladder has the scatterers of one wavelength of a fixed row, and water and oxygen of fixed absorption optical
//! depths, spread over height as theirs are. An entry draws on the two neighbouring wavelengths and, in each, on the two
//! neighbouring rungs of either gas. So no answer depends on what else a grid holds.

use std::collections::HashMap;

use sunglint_radiometry::SpectralGrid;

use crate::medium::Medium;
use crate::strata::Site;

/// Columns to solve, and for every entry of a grid its columns and their shares.
pub(crate) struct Ladder {
    pub columns: Vec<Rung>,
    pub shares: Vec<Vec<(usize, f64)>>,
    /// The column that gives the sky its general shape.
    pub reference: Medium,
    /// Columns that none scatters more than: all are cut in the parts that these want.
    pub densest: Vec<Medium>,
}

/// A column of the ladder.
pub(crate) struct Rung {
    pub medium: Medium,
    /// Whether it only tells, beside another, what a gas changes: few streams do.
    pub beside: bool,
}

/// Absorption in the column that says how layers are cut, so that they are thin for it too.
const DENSEST: [f64; 2] = [0.3, 0.0];

/// Distance of the wavelengths in ln λ.
const SPACING: f64 = 0.05;
/// What a gas changes is known at every so many of them.
const SPARSE: i64 = 6;
/// Rungs lie at absorption optical depths a with ln(1 + a/`SOFT`) a multiple of this.
const RUNG: f64 = 0.9;
const SOFT: f64 = 0.05;
/// Less absorption than this is none: it changes the share of a direction by 1e-4.
const NONE: f64 = 0.003;
/// Beyond this depth nothing reaches the ground.
const MOST: f64 = 25.0;
/// The tables of gases end a little beyond these \[µm\].
const SHORTEST: f64 = 0.387;
const LONGEST: f64 = 1.038;
/// Wavelength of the reference \[µm\].
const REFERENCE: f64 = 0.55;

impl Ladder {
    pub fn new(site: &Site, grid: &SpectralGrid) -> Self {
        let mut known: HashMap<(i64, usize, usize, bool), usize> = HashMap::new();
        let mut keys = Vec::new();
        let shares = (grid.entries().iter().zip(site.absorbed(grid)))
            .map(|(entry, absorbed)| {
                let mut shares = Vec::new();
                let mut add = |key: (i64, usize, usize, bool), share: f64| {
                    if share.abs() > 1e-12 {
                        let place = *known.entry(key).or_insert_with(|| {
                            keys.push(key);
                            keys.len() - 1
                        });
                        shares.push((place, share));
                    }
                };
                let [water, oxygen] = absorbed.map(rungs);
                let x = entry.wavelength.um().ln() / SPACING;
                about(x).into_iter().for_each(|(k, share)| add((k, 0, 0, false), share));
                for (k, of_wavelength) in about(x / SPARSE as f64) {
                    let k = k * SPARSE;
                    let of_gases: f64 = water.iter().chain(&oxygen).map(|(_, share)| share).sum();
                    water.iter().for_each(|(i, share)| add((k, *i, 0, true), of_wavelength * share));
                    oxygen.iter().for_each(|(j, share)| add((k, 0, *j, true), of_wavelength * share));
                    add((k, 0, 0, true), -of_wavelength * of_gases);
                }
                shares
            })
            .collect();
        let columns = (keys.iter())
            .map(|(k, i, j, beside)| {
                let absorbed = [*i, *j].map(|rung| SOFT * (RUNG * rung as f64).exp_m1());
                Rung { medium: site.absorbing(wavelength(*k), absorbed), beside: *beside }
            })
            .collect();
        let densest = vec![site.absorbing(SHORTEST, DENSEST)];
        Self { columns, shares, reference: site.absorbing(REFERENCE, [0.0; 2]), densest }
    }

    /// One column for entries that are all alike.
    pub fn of_all(media: &[Medium]) -> Self {
        let one = || media[0].clone();
        let columns = vec![Rung { medium: one(), beside: false }];
        Self { columns, shares: vec![vec![(0, 1.0)]; media.len()], reference: one(), densest: vec![one()] }
    }

    /// Every entry its own.
    pub fn of_every(media: &[Medium], reference: Medium) -> Self {
        let shares = (0..media.len()).map(|i| vec![(i, 1.0)]).collect();
        let columns = media.iter().map(|medium| Rung { medium: medium.clone(), beside: false }).collect();
        Self { columns, shares, reference, densest: media.to_vec() }
    }
}

/// A wavelength of the row \[µm\].
fn wavelength(k: i64) -> f64 {
    (k as f64 * SPACING).exp().clamp(SHORTEST, LONGEST)
}

/// Rungs but the lowest about an absorption optical depth, and their shares: a parabola before the second, a cubic beyond.
fn rungs(absorbed: f64) -> Vec<(usize, f64)> {
    if absorbed < NONE {
        return Vec::new();
    }
    let x = (absorbed.min(MOST) / SOFT).ln_1p() / RUNG;
    let about = if x < 1.0 { 0..3 } else { x as usize - 1..x as usize + 3 };
    let share = |k: usize| -> f64 {
        let others = about.clone().filter(|j| *j != k);
        others.map(|j| (x - j as f64) / (k as f64 - j as f64)).product()
    };
    about.clone().filter(|k| *k > 0).map(|k| (k, share(k))).collect()
}

/// The whole numbers about x and their shares.
fn about(x: f64) -> [(i64, f64); 2] {
    let below = x.floor();
    [(below as i64, 1.0 - (x - below)), (below as i64 + 1, x - below)]
}
