//! Wavelengths and the spectral grid.

use std::fmt;

/// A wavelength, stored in µm.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub struct Wavelength(f64);

impl Wavelength {
    /// From micrometres.
    pub const fn from_um(um: f64) -> Self {
        Self(um)
    }
    /// From nanometres.
    pub fn from_nm(nm: f64) -> Self {
        Self(nm * 1e-3)
    }
    /// In micrometres.
    pub const fn um(self) -> f64 {
        self.0
    }
    /// In nanometres.
    pub fn nm(self) -> f64 {
        self.0 * 1e3
    }
}

impl fmt::Display for Wavelength {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.6} um", self.0)
    }
}

/// An interval of wavelength \[µm\] on which spectral quantities are taken as straight lines.
#[derive(Clone, Debug, PartialEq)]
pub struct Bin {
    /// Lower edge \[µm\].
    pub lower: f64,
    /// Upper edge \[µm\].
    pub upper: f64,
    /// The band that owns this bin, an index into [`SpectralGrid::bands`]; `None` where bins serve every band.
    /// Bins are owned where a scene gives quantities per band, since two bands may overlap and differ.
    pub band: Option<u16>,
}

impl Bin {
    /// Width \[µm\].
    pub fn width(&self) -> f64 {
        self.upper - self.lower
    }
    /// Middle \[µm\].
    pub fn centre(&self) -> f64 {
        0.5 * (self.lower + self.upper)
    }
}

/// One entry of the grid: Beer's law holds per entry, so products such as E_s·τ₁·τ₂·R are formed per entry and
/// averaged once, last.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    /// Where smooth quantities are evaluated: a Gauss–Legendre node of the bin.
    pub wavelength: Wavelength,
    /// Index of the bin.
    pub bin: u32,
    /// Index of the absorption quadrature point g within the bin (0 for a provider without a k-distribution).
    pub g: u16,
    /// Share of the bin's integral: spectral quadrature weight × g weight. The shares of a bin sum to 1.
    pub weight: f64,
}

/// The wavelengths at which a view is computed: bins whose edges include the band edges, two Gauss–Legendre nodes a
/// bin, and the absorption quadrature points g of each.
///
/// Structured spectra enter a bin as the straight line that keeps their mean and first moment
/// ([`Curve::on`](crate::Curve::on)), evaluated at the two nodes. A product of up to three such lines is then
/// integrated exactly, which is the 5 nm bin's advantage over twice as many box bins.
#[derive(Clone, Debug, PartialEq)]
pub struct SpectralGrid {
    bins: Vec<Bin>,
    entries: Vec<Entry>,
    bands: Vec<String>,
}

impl SpectralGrid {
    /// A grid over `bins`, with one g-point. `bands` names what [`Bin::band`] points at.
    pub fn new(bins: Vec<Bin>, bands: Vec<String>) -> Self {
        Self::with_g(bins, bands, |_| vec![1.0])
    }

    /// As [`new`](Self::new), with the g weights (summing to 1) that a provider asks for in each bin.
    pub fn with_g(bins: Vec<Bin>, bands: Vec<String>, g_weights: impl Fn(&Bin) -> Vec<f64>) -> Self {
        let mut entries = Vec::with_capacity(2 * bins.len());
        for (i, bin) in bins.iter().enumerate() {
            assert!(bin.upper > bin.lower, "a bin of the spectral grid is empty");
            let reach = 0.5 * bin.width() / 3f64.sqrt();
            for node in [bin.centre() - reach, bin.centre() + reach] {
                for (g, weight) in g_weights(bin).into_iter().enumerate() {
                    entries.push(Entry {
                        wavelength: Wavelength::from_um(node),
                        bin: i as u32,
                        g: g as u16,
                        weight: 0.5 * weight,
                    });
                }
            }
        }
        Self { bins, entries, bands }
    }

    /// Contiguous bins between ascending `edges` \[µm\], shared by all bands.
    pub fn from_edges(edges: &[f64]) -> Self {
        let bin = |w: &[f64]| Bin { lower: w[0], upper: w[1], band: None };
        Self::new(edges.windows(2).map(bin).collect(), Vec::new())
    }

    /// Some entries of this grid, in the order given, with the bins and bands of all: what a spectrum is at an entry it is
    /// there too.
    #[must_use]
    pub fn picked(&self, entries: &[usize]) -> Self {
        Self {
            bins: self.bins.clone(),
            entries: entries.iter().map(|i| self.entries[*i]).collect(),
            bands: self.bands.clone(),
        }
    }

    /// Number of entries: the length of every spectrum on this grid.
    pub fn len(&self) -> usize {
        self.entries.len()
    }
    /// Whether the grid has no entry.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }
    /// The bins, in order.
    pub fn bins(&self) -> &[Bin] {
        &self.bins
    }
    /// The entries, in order of bin, node and g.
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }
    /// Names of the bands that own bins.
    pub fn bands(&self) -> &[String] {
        &self.bands
    }
    /// The bin of an entry.
    pub fn bin_of(&self, entry: &Entry) -> &Bin {
        &self.bins[entry.bin as usize]
    }
    /// Name of the band that owns an entry's bin.
    pub fn band_of(&self, entry: &Entry) -> Option<&str> {
        self.bin_of(entry).band.map(|band| self.bands[band as usize].as_str())
    }
    /// Wavelengths of the entries \[µm\].
    pub fn wavelengths_um(&self) -> Vec<f64> {
        self.entries.iter().map(|entry| entry.wavelength.um()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two Gauss nodes integrate a cubic: a product of three straight lines (E, τ, R) has no quadrature error.
    #[test]
    fn a_product_of_three_straight_lines_is_integrated_exactly() {
        let grid = SpectralGrid::from_edges(&[0.5, 0.6, 0.7]);
        let cubic = |l: f64| (1.0 + l) * (3.0 - 2.0 * l) * (0.2 + 5.0 * l);
        let sum: f64 =
            (grid.entries().iter()).map(|e| e.weight * grid.bin_of(e).width() * cubic(e.wavelength.um())).sum();
        // ∫ (1+l)(3−2l)(0.2+5l) dl = 0.6 l + 15.2/2 l² + 4.6/3 l³ − 10/4 l⁴
        let primitive = |l: f64| 0.6 * l + 7.6 * l * l + 4.6 / 3.0 * l.powi(3) - 2.5 * l.powi(4);
        assert!((sum - (primitive(0.7) - primitive(0.5))).abs() < 1e-13);
    }

    #[test]
    fn the_shares_of_a_bin_sum_to_one_with_any_g() {
        let bins = vec![Bin { lower: 0.7, upper: 0.71, band: None }];
        let grid = SpectralGrid::with_g(bins, Vec::new(), |_| vec![0.2, 0.3, 0.5]);
        assert_eq!(grid.len(), 6);
        assert!((grid.entries().iter().map(|e| e.weight).sum::<f64>() - 1.0).abs() < 1e-15);
    }
}
