//! Columns as the solver and the line of sight take them, alone and side by side.

use std::f64::consts::PI;
use std::sync::{Arc, LazyLock};

use crate::medium::Medium;
use crate::phase::Phase;
use crate::ray::Shells;
use crate::solver::{Cut, Scaled};

/// A column at one entry, as the solver and the line of sight take it.
#[derive(Clone, Debug)]
pub(crate) struct Optics {
    /// Extinction of each layer \[m⁻¹\].
    pub extinction: Vec<f64>,
    /// Delta-scaled extinction \[m⁻¹\].
    pub scaled: Vec<f64>,
    /// Scattering of each layer by phase function \[m⁻¹\], layer by layer.
    scattering: Vec<f64>,
    pub phases: Vec<Arc<Phase>>,
    /// Which of them delta-M takes a peak from.
    pub(super) peaked: Vec<bool>,
    pub layers: Vec<Scaled>,
    /// Scattering by peaked scatterers \[m⁻¹\], and what it does twice.
    pub(super) tail: Vec<f64>,
    pub(super) twice: Option<Tail>,
    /// Moments kept by the solver.
    pub(super) streams: usize,
}

/// Largest scaled optical depth of a part, within which J is taken as a parabola.
fn thickest(streams: usize) -> f64 {
    (12.8 / (streams * streams) as f64).clamp(0.006, 0.1)
}
/// Parts of less than this share of it have J as a straight line between their edges.
const THIN: f64 = 0.2;
/// Where a layer scatters less than this share of its extinction, its parts are thicker in proportion: J counts for less.
const PALE: f64 = 0.2;
/// Parts a layer is cut in at most.
const MOST_PARTS: usize = 800;

impl Optics {
    /// With `whole` layers where only fluxes at the ground are wanted.
    pub fn new(medium: &Medium, shells: &Shells, streams: usize, whole: bool) -> Self {
        Self::cut(medium, shells, streams, whole, None)
    }

    /// With layers cut as given.
    pub fn with_cuts(medium: &Medium, shells: &Shells, streams: usize, cuts: &[Cut]) -> Self {
        Self::cut(medium, shells, streams, false, Some(cuts))
    }

    /// Cuts that serve columns of no more scattering than this one.
    pub fn cuts(&self) -> Vec<Cut> {
        self.layers.iter().map(|layer| layer.cut).collect()
    }

    fn cut(medium: &Medium, shells: &Shells, streams: usize, whole: bool, given: Option<&[Cut]>) -> Self {
        let moments: Vec<_> = medium.phases.iter().map(|phase| phase.moments(streams)).collect();
        let n = medium.layers.len();
        let mut optics = Self {
            extinction: Vec::with_capacity(n),
            scaled: Vec::with_capacity(n),
            scattering: Vec::with_capacity(n * moments.len()),
            phases: medium.phases.clone(),
            peaked: Vec::new(),
            layers: Vec::with_capacity(n),
            tail: Vec::with_capacity(n),
            twice: None,
            streams,
        };
        let peaked: Vec<bool> = moments.iter().map(|chi| chi[streams].abs() > PEAKED).collect();
        let mut tails = vec![0.0; moments.len()];
        for (i, layer) in medium.layers.iter().enumerate() {
            let per_metre = 1.0 / (shells.heights[i] - shells.heights[i + 1]);
            let scattering: f64 = layer.scattering.iter().sum();
            let mean = |l: usize| layer.scattering.iter().zip(&moments).map(|(s, chi)| s * chi[l]).sum::<f64>();
            // What of the scattering stays in the forward peak.
            let peak = mean(streams).clamp(0.0, 0.999_999 * scattering);
            let depth = layer.absorption + scattering - peak;
            let coupling = match depth > 0.0 {
                true => (0..streams).map(|l| (2.0 * l as f64 + 1.0) * (mean(l) - peak) / depth).collect(),
                false => vec![0.0; streams],
            };
            let worth = depth.min((scattering - peak) / PALE);
            let parts = ((worth / thickest(streams)).ceil() as usize).clamp(1, if whole { 1 } else { MOST_PARTS });
            let middles = !whole && worth > THIN * thickest(streams) * parts as f64;
            let cut = given.map_or(Cut { parts, middles }, |given| given[i]);
            optics.extinction.push(layer.extinction() * per_metre);
            optics.scaled.push(depth * per_metre);
            optics.scattering.extend(layer.scattering.iter().map(|s| s * per_metre));
            optics.layers.push(Scaled { depth: depth / cut.parts as f64, cut, coupling });
            let of_peaked = |c: usize| if peaked[c] { layer.scattering[c] } else { 0.0 };
            optics.tail.push((0..moments.len()).map(of_peaked).sum::<f64>() * per_metre);
            tails.iter_mut().enumerate().for_each(|(c, sum)| *sum += of_peaked(c));
        }
        optics.peaked = peaked;
        optics.twice = if whole { None } else { Tail::new(&medium.phases, &tails, streams) };
        optics
    }

    /// Scattering of a layer \[m⁻¹\].
    pub fn scattered(&self, layer: usize) -> f64 {
        self.scattering(layer).iter().sum()
    }

    /// Scattering of a layer by phase function \[m⁻¹\].
    fn scattering(&self, layer: usize) -> &[f64] {
        let n = self.phases.len();
        &self.scattering[layer * n..(layer + 1) * n]
    }
}

/// Columns gathered side by side.
pub(crate) const LANES: usize = 4;
/// What each of them has.
pub(crate) type Lanes = [f64; LANES];

/// Up to so many columns cut alike, side by side; what lanes beyond them have is 0.
#[derive(Clone, Debug)]
pub(crate) struct Bundle {
    pub columns: Vec<Optics>,
    /// Of each layer \[m⁻¹\]: delta-scaled extinction, and scattering by peaked scatterers.
    pub(super) scaled: Vec<Lanes>,
    pub(super) tail: Vec<Lanes>,
    /// Scattering of each layer by phase function \[m⁻¹\], layer by layer.
    pub(super) scattering: Vec<Lanes>,
    pub(super) phases: usize,
    /// 1 where delta-M takes a peak from a phase function, 0 elsewhere.
    pub(super) peaked: Vec<Lanes>,
    /// Whether any has a tail.
    pub(super) twice: bool,
}

impl Bundle {
    pub fn new(columns: Vec<Optics>) -> Self {
        let phases = columns.iter().map(|column| column.phases.len()).max().unwrap_or(0);
        let layers = columns.first().map_or(0, |column| column.layers.len());
        let mut bundle = Self {
            scaled: vec![[0.0; LANES]; layers],
            tail: vec![[0.0; LANES]; layers],
            scattering: vec![[0.0; LANES]; layers * phases],
            phases,
            peaked: vec![[0.0; LANES]; phases],
            twice: columns.iter().any(|column| column.twice.is_some()),
            columns: Vec::new(),
        };
        for (lane, column) in columns.iter().enumerate() {
            for layer in 0..layers {
                bundle.scaled[layer][lane] = column.scaled[layer];
                bundle.tail[layer][lane] = column.tail[layer];
                let to = bundle.scattering[layer * phases..].iter_mut();
                to.zip(column.scattering(layer)).for_each(|(to, beta)| to[lane] = *beta);
            }
            for (to, _) in bundle.peaked.iter_mut().zip(&column.peaked).filter(|(_, peaked)| **peaked) {
                to[lane] = 1.0;
            }
        }
        bundle.columns = columns;
        bundle
    }

    /// Bundles of columns one after another, each of one place: that of its lattice.
    pub fn of(columns: Vec<Optics>, places: &[usize]) -> Vec<(usize, Self)> {
        let mut columns = columns.into_iter();
        let alike = places.chunk_by(|a, b| a == b).flat_map(|alike| alike.chunks(LANES));
        alike.map(|some| (some[0], Self::new(columns.by_ref().take(some.len()).collect()))).collect()
    }

    /// What each column has of something.
    pub fn each(&self, mut of: impl FnMut(&Optics) -> f64) -> Lanes {
        let mut lanes = [0.0; LANES];
        lanes.iter_mut().zip(&self.columns).for_each(|(lane, column)| *lane = of(column));
        lanes
    }
}

/// Scatterers whose moment χ_N is less have no tail worth a second order.
const PEAKED: f64 = 1e-5;

/// K of the peaked scatterers of a column, mixed as the column has them.
#[derive(Clone, Debug)]
pub(super) struct Tail {
    /// At scattering angles π (i/n)², i = 0 … n.
    values: Vec<f64>,
}

impl Tail {
    const STEPS: usize = 240;
    const MOMENTS: usize = 500;

    fn new(phases: &[Arc<Phase>], amounts: &[f64], streams: usize) -> Option<Self> {
        let total: f64 = amounts.iter().sum();
        if total <= 0.0 {
            return None;
        }
        let mut chi = vec![0.0; Self::MOMENTS + 1];
        for (phase, amount) in phases.iter().zip(amounts).filter(|(_, amount)| **amount > 0.0) {
            let share = amount / total;
            chi.iter_mut().zip(phase.moments(Self::MOMENTS).iter()).for_each(|(sum, chi)| *sum += share * chi);
        }
        let f = chi[streams];
        let terms: Vec<f64> = (chi.iter().enumerate())
            .map(|(l, chi)| (2.0 * l as f64 + 1.0) * if l < streams { -f * f } else { (chi - f).powi(2) - f * f })
            .collect();
        // P_l at the angles, row by row of l; the terms fall to nothing with χ.
        static POLYNOMIALS: LazyLock<Vec<Vec<f64>>> = LazyLock::new(|| {
            let cosines: Vec<f64> =
                (0..=Tail::STEPS).map(|i| (PI * (i as f64 / Tail::STEPS as f64).powi(2)).cos()).collect();
            let mut rows = vec![vec![1.0; cosines.len()], cosines.clone()];
            for l in 1..Tail::MOMENTS {
                let k = l as f64;
                let next = (cosines.iter().zip(&rows[l]).zip(&rows[l - 1]))
                    .map(|((cos, now), before)| ((2.0 * k + 1.0) * cos * now - k * before) / (k + 1.0));
                let next = next.collect();
                rows.push(next);
            }
            rows
        });
        let last = terms.iter().rposition(|term| term.abs() > 1e-12).unwrap_or(0);
        let mut values = vec![0.0; Self::STEPS + 1];
        for (term, row) in terms[..=last].iter().zip(POLYNOMIALS.iter()) {
            values.iter_mut().zip(row).for_each(|(sum, p)| *sum += term * p);
        }
        Some(Self { values })
    }

    /// Where a scattering angle stands among the values.
    pub(super) fn place(cos: f64) -> f64 {
        (cos.clamp(-1.0, 1.0).acos() / PI).sqrt() * Self::STEPS as f64
    }

    pub(super) fn at(&self, place: f64) -> f64 {
        let i = (place as usize).min(Self::STEPS - 1);
        self.values[i] + (self.values[i + 1] - self.values[i]) * (place - i as f64)
    }
}

/// A direction of light: cos Θ of the scattering angle and cos Δφ of the azimuth between it and that of the beam.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Turn {
    pub cos_scattering: f64,
    pub(super) cos_azimuth: f64,
    /// In a [`Tail`].
    pub(super) place: f64,
}

impl Turn {
    pub fn new(cos_scattering: f64, azimuth: f64) -> Self {
        Self { cos_scattering, cos_azimuth: azimuth.cos(), place: Tail::place(cos_scattering) }
    }
}
