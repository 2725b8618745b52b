//! Absorption by gases, in a form that goes with scattering: per bin a few terms g of weight w_g, each of which obeys
//! Beer's law.
//!
//! ```text
//! H₂O, O₂   T(W) = ⟨exp(−(C W)^a)⟩ = Σ_g w_g exp(−k_g W)   LOWTRAN 7 [Pierluissi1986, Kneizys1988]
//!           W = ∫ u (p/1013.25)^n (273.15/T)^m dz                  u: H₂O in g cm⁻², O₂ in atm-cm
//! H₂O       τ = ρ₀ ∫ ρ_w [ρ_w (C_s296 + ΔC_s (296−T)/36) + ρ_f C_f] dz   continuum; ρ in Loschmidt's number
//! O₃        τ = C U                                                Chappuis band, U in atm-cm
//! NO₂       τ = ∫ n σ(T) dz                                        [Sander2006]
//! O₂–O₂     τ = ∫ n_O₂² σ dz                                       Gaussians [Greenblatt1990]
//! ```
//!
//! ⟨ ⟩ is the mean over the samples of 5 cm⁻¹ in one half of a bin: the lower node of the grid stands for the lower
//! half. exp(−x^a) with 0 < a < 1 is the Laplace transform of a positive density (a stable law \[Pollard1946\]), so
//! weights and k that are not negative exist; their number is the least that keeps T within [`TOLERANCE`] from no
//! absorber at all to [`AIR_MASS`] tropical columns. The weights belong to the bin, since both its nodes share them;
//! the k are each node's own. Where two gases absorb in lines, T = T_H₂O T_O₂ (lines at random): the terms are pairs,
//! g = i n_O₂ + j. A half bin on the border of two bands of water takes n and m of the one that absorbs more.

use std::collections::HashMap;
use std::sync::{Arc, LazyLock, Mutex};

use sunglint_radiometry::{Bin, Curve};

use crate::embedded;
use crate::kdistribution::{Target, Terms, terms};
use crate::profile::LOSCHMIDT;

/// By how much Σ w_g exp(−k_g W) may miss the band model.
pub(crate) const TOLERANCE: f64 = 0.002;
/// The longest path that the terms are made for, in vertical tropical columns.
pub(crate) const AIR_MASS: f64 = 40.0;
/// W of a tropical column: at most 4.2 g cm⁻² of water, and 0.2095 × 8e5 atm-cm of oxygen at half the surface's
/// pressure.
const WATER_COLUMN: f64 = 4.2;
const OXYGEN_COLUMN: f64 = 8.7e4;

/// What the tables speak for \[µm\]: NO₂'s begins at 0.38 µm, the last band of water ends at 9620 cm⁻¹.
pub(crate) const COVERED: (f64, f64) = (0.38, 1e4 / 9_620.0);

/// Constants of one band: T = exp(−(C W)^a), and how W weighs pressure and temperature.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BandLaw {
    pub a: f64,
    /// Exponent of p/1013.25 hPa.
    pub n: f64,
    /// Exponent of 273.15 K/T.
    pub m: f64,
}

/// Bands of water.
pub(crate) const WATER_BANDS: usize = 5;

/// The bands of water, and the one of oxygen.
pub(crate) static BANDS: LazyLock<([BandLaw; WATER_BANDS], BandLaw)> = LazyLock::new(|| {
    let text = include_str!("../data/gas_lowtran7_band_params.csv");
    let mut laws = (text.lines().filter(|line| line.starts_with("h2o,") || line.starts_with("o2,"))).map(|line| {
        let cell = |i: usize| line.split(',').nth(i).and_then(|cell| cell.trim().parse().ok()).expect("numbers");
        BandLaw { a: cell(4), n: cell(8), m: cell(9) }
    });
    let water = std::array::from_fn(|_| laws.next().expect("five bands of water"));
    (water, laws.next().expect("a band of oxygen"))
});

/// The first band of water in the table.
const FIRST_BAND: usize = 26;

/// One sample of the table; they lie 5 cm⁻¹ apart.
struct Sample {
    /// C and the band.
    water: Option<(f64, usize)>,
    oxygen: Option<f64>,
    /// C_s296, ΔC_s and C_f \[1e-20 cm²\], and C of ozone \[atm-cm⁻¹\].
    smooth: [f64; 4],
}

const FIRST_SAMPLE: f64 = 9500.0;
const STEP: f64 = 5.0;

static SAMPLES: LazyLock<Vec<Sample>> = LazyLock::new(|| {
    let text = include_str!("../data/gas_lowtran7_band_model.csv");
    let mut samples: Vec<Sample> = (text.lines().filter(|line| line.starts_with(|c: char| c.is_ascii_digit())))
        .map(|line| {
            let cells: Vec<Option<f64>> = line.split(',').map(|cell| cell.trim().parse().ok()).collect();
            let number = |i: usize| cells[i].expect("the table holds numbers here");
            Sample {
                water: (cells[2].zip(cells[3]))
                    .and_then(|(log, band)| Some((10f64.powf(log), (band as usize).checked_sub(FIRST_BAND)?))),
                oxygen: cells[4].map(|log| 10f64.powf(log)),
                smooth: [number(6), number(7), number(8), number(9)],
            }
        })
        .collect();
    // The table ends with nothing absorbing at 26 000 cm⁻¹, between the Chappuis and the Huggins bands of ozone.
    let end = (1e4 / COVERED.0 - FIRST_SAMPLE) / STEP;
    samples.resize_with(end.ceil() as usize + 1, || Sample { water: None, oxygen: None, smooth: [0.0; 4] });
    samples
});

/// Shares of the samples in an interval of wavelength \[µm\]; each stands for the 5 cm⁻¹ about it.
fn samples(lower: f64, upper: f64) -> impl Iterator<Item = (f64, &'static Sample)> {
    let (from, to) = ((1e4 / upper - FIRST_SAMPLE) / STEP, (1e4 / lower - FIRST_SAMPLE) / STEP);
    let last = SAMPLES.len() - 1;
    let (first, end) = (from.round().max(0.0) as usize, (to.round().max(0.0) as usize).min(last));
    (first.min(last)..=end).map(move |i| {
        let (a, b) = (from.max(i as f64 - 0.5), to.min(i as f64 + 0.5));
        (((b - a) / (to - from)).max(0.0), &SAMPLES[i])
    })
}

/// σ of NO₂ at 220 K and at 294 K \[cm²\]; nothing beyond its table.
static NITROGEN_DIOXIDE: LazyLock<[Curve; 2]> = LazyLock::new(|| {
    let rows = embedded::rows(include_str!("../data/no2_jpl.csv"));
    [1, 2].map(|column| {
        let points: Vec<(f64, f64)> = rows.iter().map(|row| (1e-3 * row[0], 1e-20 * row[column])).collect();
        Curve::linear(&points).expect("the table ascends")
    })
});

/// Temperatures of that table \[K\].
pub(crate) const NITROGEN_DIOXIDE_AT: [f64; 2] = [220.0, 294.0];

/// Binary cross-section of O₂–O₂ \[cm⁵\], mean over an interval \[µm\].
fn oxygen_pairs(lower: f64, upper: f64) -> f64 {
    static BANDS: LazyLock<Vec<Vec<f64>>> = LazyLock::new(|| embedded::rows(include_str!("../data/o2_o2_bands.csv")));
    // Simpson's rule: a half bin is narrow against the bands.
    let nm = [1e3 * lower, 500.0 * (lower + upper), 1e3 * upper];
    let gauss = |band: &[f64], nm: f64| band[1] * (-4.0 * 2f64.ln() * ((nm - band[0]) / band[2]).powi(2)).exp();
    let mean = |band: &Vec<f64>| (gauss(band, nm[0]) + 4.0 * gauss(band, nm[1]) + gauss(band, nm[2])) / 6.0;
    1e-46 * BANDS.iter().map(mean).sum::<f64>()
}

/// What a layer holds of the absorbers, each in the measure that its absorption is proportional to.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Amounts {
    /// W of water for every band \[g cm⁻²\].
    pub water: [f64; WATER_BANDS],
    /// W of oxygen \[atm-cm\].
    pub oxygen: f64,
    /// ρ₀ ∫ ρ_w² dz \[1e20 cm⁻²\].
    pub water_self: f64,
    /// ρ₀ ∫ ρ_w² (368−T)/36 dz \[1e20 cm⁻²\]; two units above (296−T)/36, so that it is not negative.
    pub water_self_cold: f64,
    /// ρ₀ ∫ ρ_w ρ_f dz \[1e20 cm⁻²\].
    pub water_foreign: f64,
    /// \[atm-cm\]
    pub ozone: f64,
    /// \[cm⁻²\]
    pub nitrogen_dioxide: f64,
    /// ∫ n (T−220)/74 dz, T within the table's 220 and 294 K \[cm⁻²\].
    pub nitrogen_dioxide_warm: f64,
    /// ∫ n_O₂² dz \[cm⁻⁵\].
    pub oxygen_pairs: f64,
}

impl Amounts {
    /// The absorbers that obey Beer's law.
    fn smooth(&self) -> [f64; 7] {
        [
            self.water_self,
            self.water_self_cold,
            self.water_foreign,
            self.ozone,
            self.nitrogen_dioxide,
            self.nitrogen_dioxide_warm,
            self.oxygen_pairs,
        ]
    }
}

/// ρ₀ of the continuum \[1e20 cm⁻² m⁻¹\]: its coefficients refer to 296 K, densities to 273.15 K.
pub(crate) const CONTINUUM_DENSITY: f64 = 1e-20 * LOSCHMIDT * 100.0 * 296.0 / 273.15;

/// Absorption in one bin.
#[derive(Debug)]
pub(crate) struct BinAbsorption {
    /// Weights w_g.
    pub weights: Vec<f64>,
    nodes: [Node; 2],
}

/// Absorption in one half of a bin.
#[derive(Debug)]
struct Node {
    /// Band of the strongest absorption.
    water_band: usize,
    water: Vec<f64>,
    oxygen: Vec<f64>,
    /// Coefficients of [`Amounts::smooth`].
    smooth: [f64; 7],
}

/// Weights w_g of a bin; they sum to 1.
pub(crate) fn g_weights(bin: &Bin) -> Vec<f64> {
    BinAbsorption::of(bin).weights.clone()
}

impl BinAbsorption {
    /// That of a bin, made once.
    pub fn of(bin: &Bin) -> Arc<Self> {
        type Known = Mutex<HashMap<(u64, u64), Arc<BinAbsorption>>>;
        static KNOWN: LazyLock<Known> = LazyLock::new(Known::default);
        let key = (bin.lower.to_bits(), bin.upper.to_bits());
        if let Some(known) = KNOWN.lock().expect("no holder of this lock panics").get(&key) {
            return Arc::clone(known);
        }
        let made = Arc::new(Self::new(bin));
        Arc::clone(KNOWN.lock().expect("no holder of this lock panics").entry(key).or_insert(made))
    }

    fn new(bin: &Bin) -> Self {
        let halves = [(bin.lower, bin.centre()), (bin.centre(), bin.upper)];
        let water = terms(&halves.map(|(a, b)| water_target(a, b)), AIR_MASS * WATER_COLUMN, TOLERANCE);
        let oxygen = terms(&halves.map(|(a, b)| oxygen_target(a, b)), AIR_MASS * OXYGEN_COLUMN, TOLERANCE);
        let Terms { weights: of_water, k: [water_lower, water_upper] } = water;
        let Terms { weights: of_oxygen, k: [oxygen_lower, oxygen_upper] } = oxygen;
        let node = |(lower, upper): (f64, f64), water, oxygen| Node {
            water_band: strongest_band(lower, upper),
            water,
            oxygen,
            smooth: smooth(lower, upper),
        };
        Self {
            weights: of_water.iter().flat_map(|w| of_oxygen.iter().map(move |o| w * o)).collect(),
            nodes: [node(halves[0], water_lower, oxygen_lower), node(halves[1], water_upper, oxygen_upper)],
        }
    }

    /// Optical depths of a layer in water, lines and continuum, and in lines of oxygen.
    pub fn water_and_oxygen(&self, node: usize, g: usize, layer: &Amounts) -> [f64; 2] {
        let node = &self.nodes[node];
        let (i, j) = (g / node.oxygen.len(), g % node.oxygen.len());
        let continuum: f64 = node.smooth.iter().zip(layer.smooth()).take(CONTINUUM).map(|(c, amount)| c * amount).sum();
        [node.water[i] * layer.water[node.water_band] + continuum.max(0.0), node.oxygen[j] * layer.oxygen]
    }

    /// Optical depth of a layer in the absorbers that obey Beer's law, for node 0 or 1 of the bin.
    pub fn smooth(&self, node: usize, layer: &Amounts) -> f64 {
        self.nodes[node].smooth.iter().zip(layer.smooth()).map(|(c, amount)| c * amount).sum::<f64>().max(0.0)
    }

    /// Optical depth of a layer in lines, for node 0 or 1 of the bin and term g.
    pub fn lines(&self, node: usize, g: usize, layer: &Amounts) -> f64 {
        let node = &self.nodes[node];
        let (i, j) = (g / node.oxygen.len(), g % node.oxygen.len());
        node.water[i] * layer.water[node.water_band] + node.oxygen[j] * layer.oxygen
    }
}

/// The first of [`Amounts::smooth`] are the continuum's.
const CONTINUUM: usize = 3;
/// Interval about a wavelength in which its grey absorption is taken \[µm\].
const ABOUT: f64 = 0.001_25;

/// Optical depth of a layer in ozone, NO₂ and O₂–O₂ at a wavelength \[µm\].
pub(crate) fn grey(wavelength: f64, layer: &Amounts) -> f64 {
    let coefficients = smooth(wavelength - ABOUT, wavelength + ABOUT);
    coefficients.iter().zip(layer.smooth()).skip(CONTINUUM).map(|(c, amount)| c * amount).sum::<f64>().max(0.0)
}

/// The band of water that absorbs most about a wavelength \[µm\].
pub(crate) fn water_band(wavelength: f64) -> usize {
    strongest_band(wavelength - ABOUT, wavelength + ABOUT)
}

/// The band model of water in an interval \[µm\].
fn water_target(lower: f64, upper: f64) -> Target {
    let bands = &BANDS.0;
    Target::new(samples(lower, upper).map(|(share, sample)| match sample.water {
        Some((c, band)) => (share, c, bands[band].a),
        None => (share, 0.0, 1.0),
    }))
}

fn oxygen_target(lower: f64, upper: f64) -> Target {
    let a = BANDS.1.a;
    Target::new(samples(lower, upper).map(|(share, sample)| (share, sample.oxygen.unwrap_or(0.0), a)))
}

/// The band whose exponents n and m hold for an interval: the one that absorbs most there.
fn strongest_band(lower: f64, upper: f64) -> usize {
    let mut sums = [0.0; WATER_BANDS];
    samples(lower, upper).for_each(|(share, sample)| {
        if let Some((c, band)) = sample.water {
            sums[band] += share * c;
        }
    });
    (0..WATER_BANDS).max_by(|a, b| sums[*a].total_cmp(&sums[*b])).unwrap_or(0)
}

fn smooth(lower: f64, upper: f64) -> [f64; 7] {
    let mut means = [0.0; 4];
    for (share, sample) in samples(lower, upper) {
        means.iter_mut().zip(sample.smooth).for_each(|(mean, value)| *mean += share * value);
    }
    let [at_296, colder, foreign, ozone] = means;
    let [cold, warm] = [0, 1].map(|i| NITROGEN_DIOXIDE[i].integral(lower, upper) / (upper - lower));
    [at_296 - 2.0 * colder, colder, foreign, ozone, cold, warm - cold, oxygen_pairs(lower, upper)]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bins() -> impl Iterator<Item = Bin> {
        (0..120).map(|i| Bin { lower: 0.4 + 0.005 * f64::from(i), upper: 0.405 + 0.005 * f64::from(i), band: None })
    }

    /// Both nodes of every bin, from no absorber to 40 tropical columns, at other W than the fit was made at.
    #[test]
    fn the_terms_keep_to_the_band_model_at_all_air_masses() {
        let all: Vec<_> = bins().map(|bin| BinAbsorption::of(&bin)).collect();
        for (bin, made) in bins().zip(&all) {
            assert!((made.weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            let halves = [(bin.lower, bin.centre()), (bin.centre(), bin.upper)];
            let mut here = 0.0f64;
            for (node, (a, b)) in halves.into_iter().enumerate() {
                for (target, column, water) in
                    [(water_target(a, b), WATER_COLUMN, true), (oxygen_target(a, b), OXYGEN_COLUMN, false)]
                {
                    let node = &made.nodes[node];
                    let (n_water, n_oxygen) = (node.water.len(), node.oxygen.len());
                    for i in 0..=300 {
                        let w = AIR_MASS * column * 10f64.powf(-12.0 + 0.04 * f64::from(i));
                        let sum: f64 = (0..n_water * n_oxygen)
                            .map(|g| {
                                let k = if water { node.water[g / n_oxygen] } else { node.oxygen[g % n_oxygen] };
                                made.weights[g] * (-k * w).exp()
                            })
                            .sum();
                        here = here.max((sum - target.transmittance(w)).abs());
                    }
                }
            }
            assert!(here <= TOLERANCE, "{bin:?}: {here}");
        }
        assert!(all.iter().map(|made| made.weights.len()).sum::<usize>() <= 400);
    }

    /// O₂ and water leave 0.4 to 0.55 µm alone; the A band and the band at 0.94 µm take at least five terms.
    #[test]
    fn windows_take_one_term_and_bands_several() {
        for bin in bins() {
            let n = g_weights(&bin).len();
            if bin.upper < 0.5501 {
                assert_eq!(n, 1, "{bin:?}");
            }
            if (0.929..0.96).contains(&bin.lower) || (bin.lower - 0.76).abs() < 1e-9 {
                assert!((5..=6).contains(&n), "{bin:?}: {n}");
            }
        }
    }
}
