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
    pub columns: Vec<Medium>,
    pub shares: Vec<Vec<(usize, f64)>>,
    /// The column that gives the sky its general shape.
    pub reference: Medium,
    /// Columns that none scatters more than: all are cut in the parts that these want.
    pub densest: Vec<Medium>,
}

/// Absorption in the column that says how layers are cut, so that they are thin for it too.
const DENSEST: [f64; 2] = [0.3, 0.0];

/// Distance of the wavelengths \[µm\].
const SPACING: f64 = 0.02;
/// Rungs lie at absorption optical depths a with ln(1 + a/`SOFT`) a multiple of this.
const RUNG: f64 = 0.6;
const SOFT: f64 = 0.05;
/// Less absorption than this is none: it changes the share of a direction by 1e-4.
const NONE: f64 = 0.003;
/// Beyond this depth nothing reaches the ground.
const MOST: f64 = 200.0;
/// Wavelength of the reference \[µm\].
const REFERENCE: f64 = 0.55;

impl Ladder {
    pub fn new(site: &Site, grid: &SpectralGrid) -> Self {
        let mut known: HashMap<(i64, i64, i64), usize> = HashMap::new();
        let mut keys = Vec::new();
        let shares = (grid.entries().iter().zip(site.absorbed(grid)))
            .map(|(entry, absorbed)| {
                let mut shares = Vec::new();
                let [water, oxygen] = absorbed.map(rungs);
                for (k, of_wavelength) in about(entry.wavelength.um() / SPACING) {
                    for (i, of_water) in water {
                        for (j, of_oxygen) in oxygen {
                            let share = of_wavelength * of_water * of_oxygen;
                            if share > 1e-12 {
                                let place = *known.entry((k, i, j)).or_insert_with(|| {
                                    keys.push((k, i, j));
                                    keys.len() - 1
                                });
                                shares.push((place, share));
                            }
                        }
                    }
                }
                shares
            })
            .collect();
        let columns = (keys.iter())
            .map(|(k, i, j)| site.absorbing(wavelength(*k), [*i, *j].map(|rung| SOFT * (RUNG * rung as f64).exp_m1())))
            .collect();
        let densest = vec![site.absorbing(wavelength(0), DENSEST)];
        Self { columns, shares, reference: site.absorbing(REFERENCE, [0.0; 2]), densest }
    }

    /// One column for entries that are all alike.
    pub fn of_all(media: &[Medium]) -> Self {
        let one = || media[0].clone();
        Self { columns: vec![one()], shares: vec![vec![(0, 1.0)]; media.len()], reference: one(), densest: vec![one()] }
    }

    /// Every entry its own.
    pub fn of_every(media: &[Medium], reference: Medium) -> Self {
        let shares = (0..media.len()).map(|i| vec![(i, 1.0)]).collect();
        Self { columns: media.to_vec(), shares, reference, densest: media.to_vec() }
    }
}

/// A wavelength of the row \[µm\]; the tables of gases end a little beyond 0.385 and 1.039.
fn wavelength(k: i64) -> f64 {
    (k as f64 * SPACING).clamp(0.387, 1.038)
}

fn rungs(absorbed: f64) -> [(i64, f64); 2] {
    if absorbed < NONE {
        return [(0, 1.0), (1, 0.0)];
    }
    about((absorbed.min(MOST) / SOFT).ln_1p() / RUNG)
}

/// The whole numbers about x and their shares.
fn about(x: f64) -> [(i64, f64); 2] {
    let below = x.floor();
    [(below as i64, 1.0 - (x - below)), (below as i64 + 1, x - below)]
}
