//! The light of one time as the channels of a view see it: weights of their [`Nodes`].

use std::ops::Range;
use std::sync::{Arc, RwLock};

use fearless_simd::dispatch;
use glam::DVec3;
use nalgebra::{DMatrix, DVector};
use rustc_hash::FxHashMap;
use smallvec::SmallVec;
use sunglint_radiometry::{Channels, Radiance, Spectrum, WorldDir};

use crate::nodes::pivots;
use crate::sightline::{Knot, Lattice, Share};
use crate::vectors::{Four, add_rows, bilinear, extend_fours, fours, level, mix_fours, times};
use crate::{Illumination, Nodes};

/// What the sky's few spectra may miss of each term's weights, of its mean over the channel: radiances change by 1e-5 in the root
/// mean square over the truth scene, and by 3e-4 at most, at sunrise.
const SKY_TOLERANCE: f64 = 2e-4;
/// The same of the terms that these are made of.
const SPAN_TOLERANCE: f64 = 1e-6;
/// Bytes that the knots of lines of sight of all times of a view may take, near enough, and the fewest knots of one time: those
/// of some tiles.
const KNOTS_LIMIT: usize = 1 << 26;
const FEWEST_KNOTS: usize = 64;

/// Weights of the nodes of each channel under the lights of one time, through one path or none: what a spectrum at the
/// nodes is multiplied by.
#[derive(Clone, Debug, Default)]
pub(crate) struct Lamp {
    pub own: Vec<f64>,
    pub beam: Vec<f64>,
    pub mean_sky: Vec<f64>,
    /// The spectra that stand for the sky: for each channel and each of its nodes their weights, in fours.
    sky: Vec<Four>,
}

impl Lamp {
    fn new(lights: &Lights, (channels, nodes): (&Channels, &Nodes), tau_2: Option<&[f64]>) -> Self {
        let Illumination { sky, beam, mean_sky, .. } = &*lights.illumination;
        let product = |spectra: &[&[f64]]| weights(channels, nodes, spectra, tau_2);
        let mut of_sky = Vec::new();
        for (c, channel) in lights.channels.iter().enumerate() {
            let n = nodes.of_channel(c).len();
            let mut by_term = Vec::with_capacity(n * channel.spectra.len());
            for spectrum in &channel.spectra {
                weights_of(c, channels, nodes, spectrum, tau_2, &mut by_term);
            }
            for q in 0..n {
                extend_fours(&mut of_sky, by_term.iter().skip(q).step_by(n).copied());
            }
        }
        let beam = match nodes.are_means() {
            true => product(&[sky.solar_irradiance(), sky.sun_transmittance()]),
            false => product(&[beam]),
        };
        Self { own: product(&[]), beam, mean_sky: product(&[mean_sky]), sky: of_sky }
    }

    /// Takes another's values and shape.
    pub fn copy(&mut self, other: &Self) {
        let Self { own, beam, mean_sky, sky } = other;
        let pairs = [(&mut self.own, own), (&mut self.beam, beam), (&mut self.mean_sky, mean_sky)];
        pairs.into_iter().for_each(|(to, from)| to.clone_from(from));
        self.sky.clone_from(sky);
    }

    /// Takes another's shape, what is wanted all zero.
    pub fn clear(&mut self, other: &Self, wants: Wants) {
        let Self { own, beam, mean_sky, sky } = other;
        let sets = [
            (&mut self.own, own, wants.own),
            (&mut self.beam, beam, true),
            (&mut self.mean_sky, mean_sky, wants.mean_sky),
        ];
        for (to, from, _) in sets.into_iter().filter(|(_, _, wanted)| *wanted) {
            to.clear();
            to.resize(from.len(), 0.0);
        }
        if wants.sky {
            self.sky.clear();
            self.sky.resize(sky.len(), [0.0; 4]);
        }
    }
}

/// Appends the weights of one channel's nodes under one spectrum.
fn weights_of(
    c: usize,
    channels: &Channels,
    nodes: &Nodes,
    spectrum: &[f64],
    tau_2: Option<&[f64]>,
    out: &mut Vec<f64>,
) {
    if nodes.are_means() {
        return out.push(weights(channels, nodes, &[spectrum], tau_2)[c]);
    }
    let mut summed = Vec::new();
    channels.summed_of(c, spectrum, tau_2, &mut summed);
    let start = out.len();
    out.resize(start + nodes.of_channel(c).len(), 0.0);
    nodes.weigh_of(c, &summed, &mut out[start..]);
}

/// Weights of the nodes under a product of spectra: formed per grid entry, or of means where the nodes hold means.
fn weights(channels: &Channels, nodes: &Nodes, spectra: &[&[f64]], tau_2: Option<&[f64]>) -> Vec<f64> {
    if nodes.are_means() {
        let (mut out, mut mean) = (vec![1.0; channels.len()], vec![0.0; channels.len()]);
        for spectrum in spectra.iter().copied().chain(tau_2) {
            channels.fold(spectrum, &mut mean);
            out.iter_mut().zip(&mean).for_each(|(out, mean)| *out *= mean);
        }
        return out;
    }
    let summed = match (spectra, tau_2) {
        ([], None) => channels.shares(),
        ([], Some(tau_2)) => channels.summed(tau_2, None),
        ([spectrum, ..], tau_2) => channels.summed(spectrum, tau_2),
    };
    let mut out = vec![0.0; nodes.n_weights()];
    nodes.weigh(&summed, &mut out);
    out
}

/// A few spectra that stand for the sky's terms in one channel, and how much of each every term is.
#[derive(Clone, Debug)]
struct SkyOfChannel {
    /// On the grid.
    spectra: Vec<Vec<f64>>,
    /// Row by row of all terms.
    amounts: Vec<f64>,
}

impl SkyOfChannel {
    /// Of terms and their rows of weights: as few singular vectors as leave no more than the tolerance [Eckart1936], each term
    /// held to its own mean. Their spectra are sums of some terms that span all more closely than that, found by cross approximation
    /// with full pivoting [Bebendorf2000].
    fn new(rows: &[&[f64]], terms: &[Spectrum<Radiance>]) -> Self {
        let n = rows.first().map_or(0, |row| row.len());
        let owns: Vec<f64> = rows.iter().map(|row| row.iter().sum::<f64>().abs()).collect();
        let normed = |k: usize, i: usize| if owns[k] > 0.0 { rows[k][i] / owns[k] } else { 0.0 };
        let all: Vec<Vec<f64>> = (0..rows.len()).map(|k| (0..n).map(|i| normed(k, i)).collect()).collect();
        let (spanning, columns): (Vec<usize>, Vec<usize>) = pivots(&all, SPAN_TOLERANCE).into_iter().unzip();
        if spanning.is_empty() {
            return Self { spectra: Vec::new(), amounts: Vec::new() };
        }
        let product = |i: usize, j: usize| all.iter().map(|row| row[i] * row[j]).sum::<f64>();
        let mut products = DMatrix::zeros(n, n);
        for (i, j) in (0..n).flat_map(|i| (0..=i).map(move |j| (i, j))) {
            products[(i, j)] = product(i, j);
            products[(j, i)] = products[(i, j)];
        }
        let eigen = products.symmetric_eigen();
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
        // What is left of the rows, and how much of each vector they have.
        let mut left = all.clone();
        let mut shares: Vec<Vec<f64>> = Vec::new();
        for vector in order.iter().map(|i| eigen.eigenvectors.column(*i)) {
            if left.iter().flatten().all(|value| value.abs() <= SKY_TOLERANCE) {
                break;
            }
            shares.push(
                (left.iter_mut())
                    .map(|row| {
                        let share = row.iter().zip(&vector).map(|(value, v)| value * v).sum::<f64>();
                        row.iter_mut().zip(&vector).for_each(|(value, v)| *value -= share * v);
                        share
                    })
                    .collect(),
            );
        }
        // vector = Σ_m a_m row_(k_m) at the chosen columns.
        let m = spanning.len();
        let solve = DMatrix::from_fn(m, m, |i, j| all[spanning[j]][columns[i]]).lu();
        let spectrum = |vector: &usize| {
            let wanted = DVector::from_fn(m, |i, _| eigen.eigenvectors[(columns[i], *vector)]);
            let own = solve.solve(&wanted).unwrap_or_else(|| DVector::zeros(m));
            let mut sum = vec![0.0; terms.first().map_or(0, |term| term.len())];
            for (a, k) in own.iter().zip(&spanning) {
                sum.iter_mut().zip(terms[*k].iter()).for_each(|(sum, value)| *sum += a / owns[*k] * value);
            }
            sum
        };
        let spectra: Vec<Vec<f64>> = order.iter().take(shares.len()).map(spectrum).collect();
        let amounts = (0..rows.len())
            .flat_map(|k| shares.iter().map(move |share| (k, share)))
            .map(|(k, share)| owns[k] * share[k]);
        Self { amounts: amounts.collect(), spectra }
    }

    /// Fours that hold an amount of each spectrum.
    fn width(&self) -> usize {
        fours(self.spectra.len())
    }

    /// How much of each spectrum the term `k` is.
    fn row(&self, k: usize) -> &[f64] {
        let m = self.spectra.len();
        &self.amounts[k * m..(k + 1) * m]
    }
}

/// What of a lamp a pixel takes beside the beam.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Wants {
    pub own: bool,
    pub mean_sky: bool,
    pub sky: bool,
}

/// What a knot of the lines of sight gives.
#[derive(Clone, Debug)]
pub(crate) struct OfKnot {
    lamp: Lamp,
    /// Mean τ₂ and L_u per channel.
    transmittance: Vec<f64>,
    pub upwelled: Vec<f64>,
    /// Nothing is lost or added on the way.
    pub is_clear: bool,
}

/// The light of one time as the channels of a view see it.
pub struct Lights {
    /// The sky and the sun.
    pub illumination: Arc<Illumination>,
    channels: Vec<SkyOfChannel>,
    /// Sum of the fours of the channels' spectra.
    n_fours: usize,
    /// By term of the sky, how much of each channel's spectra it is, channel after channel, in fours.
    amounts: Vec<Four>,
    /// Without a path.
    bare: Lamp,
    /// Amounts of the sky over an open facet, by the bits of its normal.
    open: RwLock<FxHashMap<[u64; 3], Arc<[Four]>>>,
    knots: RwLock<FxHashMap<Knot, Arc<OfKnot>>>,
    /// How many are kept.
    most_knots: usize,
}

impl Lights {
    /// The light of a time for channels and their nodes; one of `n_times`.
    pub fn new(illumination: Arc<Illumination>, channels: &Channels, nodes: &Nodes, n_times: usize) -> Self {
        let terms = illumination.sky.sky_terms();
        let rows: Vec<Vec<f64>> = terms.iter().map(|term| weights(channels, nodes, &[term], None)).collect();
        let mut start = 0;
        let of_channel = |c: usize| {
            let own = start..start + nodes.of_channel(c).len();
            start = own.end;
            let rows: Vec<&[f64]> = rows.iter().map(|row| &row[own.clone()]).collect();
            SkyOfChannel::new(&rows, terms)
        };
        let of_channels: Vec<SkyOfChannel> = (0..channels.len()).map(of_channel).collect();
        let mut amounts = Vec::new();
        for k in 0..rows.len() {
            of_channels.iter().for_each(|channel| extend_fours(&mut amounts, channel.row(k).iter().copied()));
        }
        let mut lights = Self {
            amounts,
            illumination,
            n_fours: of_channels.iter().map(SkyOfChannel::width).sum(),
            channels: of_channels,
            bare: Lamp::default(),
            open: RwLock::default(),
            knots: RwLock::default(),
            most_knots: 0,
        };
        lights.bare = Lamp::new(&lights, (channels, nodes), None);
        let size = size_of::<f64>() * (3 * lights.bare.beam.len() + 4 * lights.bare.sky.len() + 2 * channels.len());
        lights.most_knots = (KNOTS_LIMIT / size.max(1) / n_times.max(1)).max(FEWEST_KNOTS);
        lights
    }

    /// Without a path.
    pub(crate) fn bare(&self) -> &Lamp {
        &self.bare
    }

    /// A sum of weighed terms of the sky as amounts.
    pub(crate) fn mix(&self, weights: &[(u32, f64)], amounts: &mut Vec<Four>) {
        amounts.resize(self.n_fours, [0.0; 4]);
        dispatch!(level(), simd => mix_fours(simd, weights, &self.amounts, amounts));
    }

    /// L_d(ω) as amounts; `weights` is for work. Whether it is more than black.
    pub(crate) fn sky(&self, direction: WorldDir, weights: &mut Vec<(u32, f64)>, amounts: &mut Vec<Four>) -> bool {
        self.illumination.sky.sky_weights(direction, weights);
        self.mix(weights, amounts);
        !weights.is_empty()
    }

    /// ∫ L_d cos θ dω / π over the part of the sky that a facet of this normal sees when only the horizon obstructs it, as
    /// amounts.
    pub(crate) fn open_sky(&self, normal: DVec3) -> Arc<[Four]> {
        let key = normal.to_array().map(f64::to_bits);
        if let Some(found) = self.open.read().expect("no holder of this lock panics").get(&key) {
            return found.clone();
        }
        let of_terms = self.illumination.open_sky(normal);
        let weights: Vec<(u32, f64)> = of_terms.into_iter().enumerate().map(|(k, w)| (k as u32, w)).collect();
        let mut amounts = Vec::new();
        self.mix(&weights, &mut amounts);
        let fresh: Arc<[Four]> = amounts.into();
        self.open.write().expect("no holder of this lock panics").insert(key, fresh.clone());
        fresh
    }

    /// Weights of the nodes under a sky of these amounts.
    pub(crate) fn of_sky(&self, lamp: &Lamp, nodes: &Nodes, amounts: &[Four], out: &mut Vec<f64>) {
        out.resize(lamp.beam.len(), 0.0);
        let mut out = out.as_mut_slice();
        for (own, matrix, amounts) in self.of_channels(lamp, nodes, amounts) {
            let (of_channel, later) = out.split_at_mut(own.len());
            times(matrix, amounts, of_channel);
            out = later;
        }
    }

    /// What a spectrum at the nodes makes of a sky of these amounts, in each channel.
    pub(crate) fn by_sky(&self, lamp: &Lamp, nodes: &Nodes, spectrum: &[f64], amounts: &[Four], out: &mut Vec<f64>) {
        out.resize(self.channels.len(), 0.0);
        dispatch!(level(), simd => {
            for ((own, matrix, amounts), out) in self.of_channels(lamp, nodes, amounts).zip(out) {
                *out = bilinear(simd, &spectrum[own], matrix, amounts);
            }
        });
    }

    /// Of each channel: its nodes, the sky's terms of a lamp there, and amounts of these.
    #[inline(always)]
    fn of_channels<'a>(
        &'a self,
        lamp: &'a Lamp,
        nodes: &'a Nodes,
        amounts: &'a [Four],
    ) -> impl Iterator<Item = (Range<usize>, &'a [Four], &'a [Four])> {
        let (mut of_lamp, mut amounts) = (lamp.sky.as_slice(), amounts);
        self.channels.iter().enumerate().map(
            #[inline(always)]
            move |(c, channel)| {
                let own = nodes.of_channel(c);
                let (of_channel, further) = amounts.split_at(channel.width());
                let (matrix, others) = of_lamp.split_at(own.len() * channel.width());
                (amounts, of_lamp) = (further, others);
                (own, matrix, of_channel)
            },
        )
    }

    /// Adds what the pairs of knots of some shares give together to what is wanted of a lamp, and to L_u, channel by channel.
    pub(crate) fn add(
        &self,
        shares: &[Share],
        ends: &[(Arc<OfKnot>, Arc<OfKnot>)],
        (nodes, wants): (&Nodes, Wants),
        lamp: &mut Lamp,
        l_u: &mut [f64],
    ) {
        let (mut start, mut of_sky) = (0, 0);
        for (c, channel) in self.channels.iter().enumerate() {
            let mut knots: SmallVec<[(f64, &OfKnot); 8]> = SmallVec::new();
            for (share, (low, high)) in shares.iter().zip(ends) {
                let t = share.of_high(low.transmittance[c], high.transmittance[c]);
                knots.extend([(share.weight * (1.0 - t), &**low), (share.weight * t, &**high)]);
            }
            let mix = |to: &mut [f64], of: fn(&OfKnot) -> &[f64], start: usize| {
                let n = to.len();
                let rows: SmallVec<[(f64, &[f64]); 8]> =
                    knots.iter().map(|(share, knot)| (*share, &of(knot)[start..start + n])).collect();
                add_rows(to, &rows);
            };
            let own = start..start + nodes.of_channel(c).len();
            mix(&mut lamp.beam[own.clone()], |knot| &knot.lamp.beam, start);
            if wants.own {
                mix(&mut lamp.own[own.clone()], |knot| &knot.lamp.own, start);
            }
            if wants.mean_sky {
                mix(&mut lamp.mean_sky[own.clone()], |knot| &knot.lamp.mean_sky, start);
            }
            let sky = of_sky..of_sky + own.len() * channel.width();
            if wants.sky {
                mix(lamp.sky[sky.clone()].as_flattened_mut(), |knot| knot.lamp.sky.as_flattened(), 4 * of_sky);
            }
            (start, of_sky) = (own.end, sky.end);
            l_u[c] += knots.iter().map(|(share, knot)| share * knot.upwelled[c]).sum::<f64>();
        }
    }

    /// What is solved at a knot of the lines of sight, solved when first met.
    pub(crate) fn at(&self, knot: Knot, lattice: &Lattice<'_>, channels: &Channels, nodes: &Nodes) -> Arc<OfKnot> {
        if let Some(found) = self.knots.read().expect("no holder of this lock panics").get(&knot) {
            return found.clone();
        }
        let fresh = Arc::new(match lattice.path(knot) {
            Some(path) => {
                let n = self.illumination.beam.len();
                let (mut tau_2, mut l_u) = (vec![0.0; n], vec![0.0; n]);
                self.illumination.sky.path(&path, &mut tau_2, &mut l_u);
                let mut upwelled = vec![0.0; channels.len()];
                channels.fold(&l_u, &mut upwelled);
                let mut transmittance = upwelled.clone();
                channels.fold(&tau_2, &mut transmittance);
                let is_clear = tau_2.iter().all(|t| *t == 1.0) && l_u.iter().all(|l| *l == 0.0);
                let lamp = match is_clear {
                    true => self.bare.clone(),
                    false => Lamp::new(self, (channels, nodes), Some(&tau_2)),
                };
                OfKnot { lamp, transmittance, upwelled, is_clear }
            }
            None => {
                let n = channels.len();
                OfKnot { lamp: self.bare.clone(), transmittance: vec![1.0; n], upwelled: vec![0.0; n], is_clear: true }
            }
        });
        let mut knots = self.knots.write().expect("no holder of this lock panics");
        if knots.len() >= self.most_knots {
            knots.clear();
        }
        knots.insert(knot, fresh.clone());
        fresh
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Terms that mix five smooth spectra, 40 entries told at 12 nodes: the spectra that stand for them are no more than five, give
    /// each term's weights back within the tolerance of its mean, and do so behind a path that takes light away by wavelength too.
    #[test]
    fn few_spectra_give_the_weights_of_every_term_back() {
        let (n, n_grid) = (12, 40);
        let smooth = |k: usize, x: f64| (1.3 * k as f64 * x).cos() * 0.4f64.powi(k as i32);
        let terms: Vec<Spectrum<Radiance>> = (0..200)
            .map(|term| {
                let share = |k: usize| if k == 0 { 1.0 } else { (f64::from(term) * 0.37 * (k + 1) as f64).sin() };
                let value = |i: usize| (0..5).map(|k| share(k) * smooth(k, i as f64 / n_grid as f64)).sum::<f64>();
                Spectrum::new((0..n_grid).map(value).collect())
            })
            .collect();
        let clear = |_: usize| 1.0;
        let hazy = |i: usize| 0.9 - 0.6 * i as f64 / n_grid as f64;
        // Each node stands for the entries about it.
        let weights_of = |spectrum: &[f64], path: &dyn Fn(usize) -> f64| -> Vec<f64> {
            let near = |q: usize, i: usize| (1.0 - (i as f64 * n as f64 / n_grid as f64 - q as f64).abs()).max(0.0);
            (0..n).map(|q| (0..n_grid).map(|i| near(q, i) * path(i) * spectrum[i]).sum()).collect()
        };
        let rows: Vec<Vec<f64>> = terms.iter().map(|term| weights_of(term, &clear)).collect();
        let sky = SkyOfChannel::new(&rows.iter().map(Vec::as_slice).collect::<Vec<_>>(), &terms);
        assert!((3..=5).contains(&sky.spectra.len()), "{}", sky.spectra.len());
        for (path, allowed) in [(&clear as &dyn Fn(usize) -> f64, SKY_TOLERANCE), (&hazy, 2.0 * SKY_TOLERANCE)] {
            let of_spectra: Vec<Vec<f64>> = sky.spectra.iter().map(|spectrum| weights_of(spectrum, path)).collect();
            for (k, term) in terms.iter().enumerate() {
                let due = weights_of(term, path);
                let mean = due.iter().sum::<f64>();
                for (q, due) in due.iter().enumerate() {
                    let found: f64 = sky.row(k).iter().zip(&of_spectra).map(|(amount, of)| amount * of[q]).sum();
                    assert!((found - due).abs() <= allowed * mean, "term {k}, node {q}: {found} for {due}");
                }
            }
        }
    }
}
