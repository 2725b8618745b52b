//! Wavelengths that stand for a channel.
//!
//! Reflectances and their products vary over a band far less than light does. A path therefore carries its spectrum at a few
//! wavelengths of each channel only, from which products of reflectances follow at all others, and light takes the
//! interpolation into its weights:
//!
//! ```text
//! f(λ) ≈ Σ_q f(λ_q) ℓ_q(λ)     ⟨S f⟩ = Σ_q W_q f(λ_q),   W_q = ⟨S ℓ_q⟩
//! ```
//!
//! Products are still formed per wavelength and averaged once, last. The wavelengths are those of the empirical
//! interpolation method [Barrault2004]: each is where the worst of the functions so far is farthest from what the others
//! give. The functions are the scene's spectra and the products of two; ℓ_q is their least-squares fit, and there are as many
//! wavelengths as hold the mean of each function over the channel to [`TOLERANCE`].

use std::ops::Range;

use nalgebra::DMatrix;
use sunglint_radiometry::{Channels, SpectralGrid};

/// What the mean of a spectrum over a channel may be off by, of itself; of a product of two, [`OF_PRODUCTS`] times as much.
const TOLERANCE: f64 = 5e-5;
const OF_PRODUCTS: f64 = 4.0;
/// What is left of a function, of its largest value, that is rounding.
const ROUNDING: f64 = 1e-11;
/// Functions that are looked at.
const MOST_FUNCTIONS: usize = 2048;

/// The nodes of a set of channels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Nodes {
    /// Grid entry of each node, and its wavelength \[µm\].
    entries: Vec<usize>,
    wavelengths: Vec<f64>,
    /// Per channel.
    channels: Vec<OfChannel>,
    /// Whether a node holds a band mean.
    means: bool,
}

#[derive(Clone, Debug, PartialEq)]
struct OfChannel {
    nodes: Range<usize>,
    /// ℓ_q at the channel's wavelengths, one row a node.
    shares: Vec<Vec<f64>>,
}

impl Nodes {
    /// The nodes for spectra and their products, each given at every entry of the channels' grid and the same for all entries
    /// of one wavelength.
    pub fn new<'a>(grid: &SpectralGrid, channels: &Channels, spectra: impl Iterator<Item = &'a [f64]>) -> Self {
        let spectra: Vec<&[f64]> = spectra.collect();
        let mut out = Self::default();
        let mut known: Vec<(Vec<usize>, usize)> = Vec::new();
        for c in 0..channels.len() {
            let runs = channels.runs(c);
            let (first, weights) = channels.row(c);
            let weighed: Vec<usize> =
                (0..runs.len()).filter(|i| runs[*i].clone().any(|entry| weights[entry - first] != 0.0)).collect();
            let support: Vec<usize> = weighed.iter().map(|i| runs[*i].start).collect();
            // Channels of one band weigh the same wavelengths.
            if let Some((_, same)) = known.iter().find(|(entries, _)| *entries == support) {
                let same = out.channels[*same].clone();
                out.channels.push(same);
                continue;
            }
            let of_channel = |spectrum: &&[f64]| support.iter().map(|entry| spectrum[*entry]).collect();
            let functions: Vec<Vec<f64>> = spectra.iter().map(of_channel).collect();
            let (nodes, rows) = interpolation(functions, support.len());
            let start = out.entries.len();
            out.entries.extend(nodes.iter().map(|i| support[*i]));
            let shares = (rows.into_iter())
                .map(|row| {
                    let mut at_all = vec![0.0; runs.len()];
                    weighed.iter().zip(row).for_each(|(i, share)| at_all[*i] = share);
                    at_all
                })
                .collect();
            known.push((support, c));
            out.channels.push(OfChannel { nodes: start..out.entries.len(), shares });
        }
        out.wavelengths = out.entries.iter().map(|entry| grid.entries()[*entry].wavelength.um()).collect();
        out
    }

    /// One node a channel, that holds the mean over it.
    pub fn means(channels: &Channels) -> Self {
        let of_channel = |c| OfChannel { nodes: c..c + 1, shares: vec![vec![1.0; channels.runs(c).len()]] };
        let entries = (0..channels.len()).map(|c| channels.row(c).0).collect();
        let wavelengths = channels.channels().iter().map(|channel| channel.centre.um()).collect();
        Self { entries, wavelengths, channels: (0..channels.len()).map(of_channel).collect(), means: true }
    }

    /// The same nodes for some of their channels, `kept` by index, as these stand on a grid of their own.
    ///
    /// # Panics
    /// Where a wavelength that a channel weighs there is none of its wavelengths here.
    #[must_use]
    pub fn of_some(
        &self,
        (grid, channels): (&SpectralGrid, &Channels),
        kept: &[usize],
        (own_grid, own_channels): (&SpectralGrid, &Channels),
    ) -> Self {
        let at = |grid: &SpectralGrid, run: &Range<usize>| grid.entries()[run.start].wavelength;
        let of_channel = |(own, c): (usize, &usize)| {
            let OfChannel { nodes, shares } = &self.channels[*c];
            let (first, weights) = own_channels.row(own);
            let places: Vec<Option<usize>> = (own_channels.runs(own).iter())
                .map(|run| {
                    let weighed = run.clone().any(|entry| weights[entry - first] != 0.0);
                    let place = channels.runs(*c).iter().position(|other| at(grid, other) == at(own_grid, run));
                    weighed.then(|| place.expect("a channel weighs the same wavelengths on any grid"))
                })
                .collect();
            let row = |row: &Vec<f64>| places.iter().map(|place| place.map_or(0.0, |i| row[i])).collect();
            OfChannel { nodes: nodes.clone(), shares: shares.iter().map(row).collect() }
        };
        Self { channels: kept.iter().enumerate().map(of_channel).collect(), ..self.clone() }
    }

    /// Number of nodes.
    pub fn len(&self) -> usize {
        self.entries.len()
    }
    /// Whether there is no node.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }
    /// Grid entry of each node.
    pub fn entries(&self) -> &[usize] {
        &self.entries
    }
    /// Wavelength of each node \[µm\].
    pub fn wavelengths_um(&self) -> &[f64] {
        &self.wavelengths
    }
    /// Whether nodes hold means over the channels, and light is to be averaged factor by factor.
    pub fn are_means(&self) -> bool {
        self.means
    }
    /// Nodes of a channel.
    pub fn of_channel(&self, c: usize) -> Range<usize> {
        self.channels[c].nodes.clone()
    }

    /// Σ_q spectrum_q weights_q of each channel, the weights of one channel's nodes after another's.
    pub(crate) fn products<'a>(&'a self, spectrum: &'a [f64], weights: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
        let mut start = 0;
        self.channels.iter().map(move |channel| {
            let own = &spectrum[channel.nodes.clone()];
            let product = dot(own, &weights[start..]);
            start += own.len();
            product
        })
    }

    /// A spectrum given at every grid entry, at the nodes.
    pub fn of(&self, channels: &Channels, spectrum: &[f64]) -> Vec<f64> {
        if !self.means {
            return self.entries.iter().map(|entry| spectrum[*entry]).collect();
        }
        let mut means = vec![0.0; channels.len()];
        channels.fold(spectrum, &mut means);
        means
    }

    /// W_q = Σᵢ Sᵢ ℓ_q(λᵢ) of light that was [summed](Channels::summed) at the channels' wavelengths, channel by channel:
    /// the weights of one channel's nodes after those of the channel before.
    pub fn weigh(&self, summed: &[f64], weights: &mut [f64]) {
        let (mut from, mut to) = (0, 0);
        for (c, OfChannel { shares, .. }) in self.channels.iter().enumerate() {
            let n = shares.first().map_or(0, Vec::len);
            self.weigh_of(c, &summed[from..from + n], &mut weights[to..]);
            from += n;
            to += shares.len();
        }
    }

    /// The same of one channel.
    pub fn weigh_of(&self, c: usize, summed: &[f64], weights: &mut [f64]) {
        weights.iter_mut().zip(&self.channels[c].shares).for_each(|(weight, row)| *weight = dot(summed, row));
    }

    /// Response-weighted mean over a channel of a spectrum at the nodes.
    pub fn mean(&self, channels: &Channels, c: usize, at_nodes: &[f64]) -> f64 {
        let (first, weights) = channels.row(c);
        let OfChannel { nodes, shares } = &self.channels[c];
        if self.means {
            return at_nodes[nodes.start];
        }
        let of_run = |(i, run): (usize, &Range<usize>)| {
            let weight: f64 = weights[run.start - first..run.end - first].iter().sum();
            weight * shares.iter().zip(&at_nodes[nodes.clone()]).map(|(row, f)| row[i] * f).sum::<f64>()
        };
        channels.runs(c).iter().enumerate().map(of_run).sum()
    }

    /// Weights that [`weigh`](Self::weigh) fills: one for each channel and each of its nodes.
    pub fn n_weights(&self) -> usize {
        self.channels.iter().map(|channel| channel.shares.len()).sum()
    }
}

/// Σ aᵢ bᵢ over the shorter, four sums side by side: in one order whatever the machine.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len().min(b.len());
    let (a, b) = (a[..n].as_chunks::<4>(), b[..n].as_chunks::<4>());
    let mut sums = [0.0; 4];
    for (a, b) in a.0.iter().zip(b.0) {
        for i in 0..4 {
            sums[i] += a[i] * b[i];
        }
    }
    let rest: f64 = a.1.iter().zip(b.1).map(|(a, b)| a * b).sum();
    (sums[0] + sums[2]) + (sums[1] + sums[3]) + rest
}

/// The nodes among `m` places that carry `functions` and their products, and the shares ℓ_q at all places.
fn interpolation(mut functions: Vec<Vec<f64>>, m: usize) -> (Vec<usize>, Vec<Vec<f64>>) {
    let normed = |mut f: Vec<f64>| {
        let most = f.iter().fold(0.0, |most: f64, v| most.max(v.abs()));
        f.iter_mut().for_each(|v| *v /= most);
        (most > 0.0).then_some(f)
    };
    functions.insert(0, vec![1.0; m]);
    let functions: Vec<Vec<f64>> = functions.into_iter().filter_map(normed).collect();
    // Those that span the others; products of these span all products.
    let singles: Vec<Vec<f64>> = pivots(&functions, ROUNDING).into_iter().map(|(f, _)| functions[f].clone()).collect();
    let pairs = (0..singles.len()).flat_map(|i| (i..singles.len()).map(move |j| (i, j)));
    let product = |(i, j): (usize, usize)| singles[i].iter().zip(&singles[j]).map(|(a, b)| a * b).collect();
    let mut all = functions.clone();
    all.truncate(MOST_FUNCTIONS / 2);
    let n_singles = all.len();
    all.extend(pairs.map(product).filter_map(normed).take(MOST_FUNCTIONS - n_singles));
    let order: Vec<usize> = pivots(&all, ROUNDING).into_iter().map(|(_, place)| place).collect();

    let means: Vec<f64> = all.iter().map(|f| f.iter().sum::<f64>() / m as f64).collect();
    let mut n = order.len().min(4);
    loop {
        let nodes = &order[..n];
        let shares = fitted(&all, nodes, m);
        let of_mean: Vec<f64> = shares.iter().map(|row| row.iter().sum::<f64>() / m as f64).collect();
        let holds = all.iter().zip(&means).enumerate().all(|(i, (f, mean))| {
            let found: f64 = nodes.iter().zip(&of_mean).map(|(place, w)| w * f[*place]).sum();
            let allowed = if i < n_singles { TOLERANCE } else { OF_PRODUCTS * TOLERANCE };
            (found - mean).abs() <= allowed * mean.abs()
        });
        if holds || n == order.len() {
            return (nodes.to_vec(), shares);
        }
        n = (n + 2).min(order.len());
    }
}

/// The rows that span the others to a tolerance and a column of each, worst first: full pivoting.
pub(crate) fn pivots(rows: &[Vec<f64>], tolerance: f64) -> Vec<(usize, usize)> {
    let mut left = rows.to_vec();
    let most = rows.len().min(rows.first().map_or(0, Vec::len));
    let mut pivots = Vec::new();
    while pivots.len() < most {
        let (mut worst, mut place) = (tolerance, None);
        for (f, values) in left.iter().enumerate() {
            for (i, value) in values.iter().enumerate() {
                if value.abs() > worst {
                    (worst, place) = (value.abs(), Some((f, i)));
                }
            }
        }
        let Some((f, i)) = place else { break };
        let row: Vec<f64> = left[f].iter().map(|v| v / left[f][i]).collect();
        for values in &mut left {
            let at_node = values[i];
            if at_node != 0.0 {
                values.iter_mut().zip(&row).for_each(|(v, r)| *v -= at_node * r);
                values[i] = 0.0;
            }
        }
        pivots.push((f, i));
    }
    pivots
}

/// ℓ_q at all places: the least-squares fit of all functions by their values at the nodes, with Σ_q ℓ_q = 1.
fn fitted(functions: &[Vec<f64>], nodes: &[usize], m: usize) -> Vec<Vec<f64>> {
    if nodes.len() == m {
        let one = |place: &usize| (0..m).map(|i| f64::from(u8::from(i == *place))).collect();
        return nodes.iter().map(one).collect();
    }
    let at_nodes = DMatrix::from_fn(functions.len(), nodes.len(), |f, q| functions[f][nodes[q]]);
    let at_all = DMatrix::from_fn(functions.len(), m, |f, i| functions[f][i]);
    let mut shares = at_nodes.svd(true, true).solve(&at_all, 1e-12).expect("both factors were asked for");
    for mut column in shares.column_iter_mut() {
        let sum = column.sum();
        column /= sum;
    }
    (0..nodes.len()).map(|q| shares.row(q).iter().copied().collect()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use sunglint_radiometry::{Channel, Curve, SpectralGrid, Wavelength};

    fn red() -> (SpectralGrid, Channels) {
        let edges: Vec<f64> = (0..=40).map(|i| 0.6 + 0.0025 * f64::from(i)).collect();
        let grid = SpectralGrid::from_edges(&edges);
        let channel = Channel { name: "red".into(), centre: Wavelength::from_um(0.65), fwhm: 0.1 };
        let channels = Channels::new(&grid, &[(channel, Curve::boxcar(0.6, 0.7))]);
        (grid, channels)
    }

    /// A line and a parabola: every product of two is a polynomial of degree 4 at most, so that five wavelengths carry them all,
    /// and the mean of a product under any light is that of all wavelengths.
    #[test]
    fn nodes_carry_the_products_of_reflectances_under_any_light() {
        let (grid, channels) = red();
        let x: Vec<f64> = grid.wavelengths_um().iter().map(|l| (l - 0.6) / 0.1).collect();
        let line: Vec<f64> = x.iter().map(|x| 0.2 + 0.6 * x).collect();
        let bow: Vec<f64> = x.iter().map(|x| 0.9 - 2.0 * (x - 0.5).powi(2)).collect();
        let nodes = Nodes::new(&grid, &channels, [line.as_slice(), &bow].into_iter());
        assert!(nodes.len() <= 5, "{}", nodes.len());
        let light: Vec<f64> = (0..grid.len()).map(|i| 1.0 + ((i * 7919 % 101) as f64 / 101.0)).collect();
        let mut weights = vec![0.0; nodes.n_weights()];
        nodes.weigh(&channels.summed(&light, None), &mut weights);
        for (m, n) in [(0, 0), (1, 0), (0, 1), (1, 1), (2, 0), (0, 2)] {
            let product: Vec<f64> = line.iter().zip(&bow).map(|(a, b)| a.powi(m) * b.powi(n)).collect();
            let mut due = [0.0];
            channels.fold_product(&light, &product, &mut due);
            let found: f64 = weights.iter().zip(nodes.of(&channels, &product)).map(|(w, f)| w * f).sum();
            assert!((found / due[0] - 1.0).abs() < 1e-9, "{m} {n}: {found} {}", due[0]);
        }
    }

    /// What varies at random needs every wavelength, and then nothing is lost.
    #[test]
    fn rough_spectra_take_all_wavelengths() {
        let (grid, channels) = red();
        let rough = |seed: usize| -> Vec<f64> {
            (0..grid.len()).map(|i| ((i * 7919 + seed * 104_729 + i * i * seed) % 997) as f64 / 997.0).collect()
        };
        let spectra: Vec<Vec<f64>> = (1..30).map(rough).collect();
        let nodes = Nodes::new(&grid, &channels, spectra.iter().map(Vec::as_slice));
        assert!(nodes.len() <= grid.len());
        let mut weights = vec![0.0; nodes.n_weights()];
        nodes.weigh(&channels.summed(&spectra[3], None), &mut weights);
        let mut due = [0.0];
        channels.fold_product(&spectra[3], &spectra[8], &mut due);
        let found: f64 = weights.iter().zip(nodes.of(&channels, &spectra[8])).map(|(w, f)| w * f).sum();
        assert!((found / due[0] - 1.0).abs() < 1e-9, "{found} {}", due[0]);
    }

    #[test]
    fn a_constant_needs_one_wavelength_and_a_mean_too() {
        let (grid, channels) = red();
        let half = vec![0.5; grid.len()];
        assert_eq!(Nodes::new(&grid, &channels, std::iter::once(half.as_slice())).len(), 1);
        let means = Nodes::means(&channels);
        let line: Vec<f64> = grid.wavelengths_um();
        assert!((means.of(&channels, &line)[0] - 0.65).abs() < 1e-12);
    }
}
