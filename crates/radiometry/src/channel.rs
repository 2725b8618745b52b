//! Channels: the matrix from grid entries to named outputs. The tracer folds every sample into channels before it
//! accumulates mean and variance; it knows no band, and the sensor knows no ray.

use std::ops::Range;

use crate::{Curve, SpectralGrid, Wavelength};

/// A named output: a band, or one wavelength of a series.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// Name as the scene gives it.
    pub name: String,
    /// Response-weighted mean wavelength.
    pub centre: Wavelength,
    /// Full width at half maximum of the response \[µm\].
    pub fwhm: f64,
}

/// Response-weighted means over the grid: channel c of a spectrum S is Σᵢ w_cᵢ Sᵢ with Σᵢ w_cᵢ = 1.
#[derive(Clone, Debug, PartialEq)]
pub struct Channels {
    channels: Vec<Channel>,
    /// Per channel: index of the first grid entry with weight, and the weights from there on.
    rows: Vec<(usize, Vec<f64>)>,
    /// Per channel: the runs of entries of one wavelength that it weighs, those of one wavelength differing by g alone.
    runs: Vec<Vec<Range<usize>>>,
}

impl Channels {
    /// Builds the matrix from band responses (any scale). A bin that is owned by a band serves the channel of that
    /// name alone.
    ///
    /// # Panics
    /// Where a response has no overlap with the grid; the sensor has checked that before.
    pub fn new(grid: &SpectralGrid, bands: &[(Channel, Curve)]) -> Self {
        match Self::weighted(grid, bands, &vec![1.0; grid.len()]) {
            Ok((channels, _)) => channels,
            Err(band) => panic!("band `{}` has no response on the grid", bands[band].0.name),
        }
    }

    /// As [`new`](Self::new), each response times a factor at every grid entry; with the integrals over wavelength of these
    /// products \[factor · µm\], by which a channel's mean becomes the integral ∫ S R factor dλ.
    ///
    /// # Errors
    /// The index of a band whose product is 0 at every entry.
    pub fn weighted(
        grid: &SpectralGrid,
        bands: &[(Channel, Curve)],
        factor: &[f64],
    ) -> Result<(Self, Vec<f64>), usize> {
        let mut rows = Vec::with_capacity(bands.len());
        let mut runs = Vec::with_capacity(bands.len());
        let mut integrals = Vec::with_capacity(bands.len());
        for (band, (channel, response)) in bands.iter().enumerate() {
            let mut weights = response.on(grid);
            for ((weight, entry), factor) in weights.iter_mut().zip(grid.entries()).zip(factor) {
                let owned = grid.band_of(entry).is_none_or(|band| band == channel.name);
                *weight *= if owned { factor * entry.weight * grid.bin_of(entry).width() } else { 0.0 };
            }
            let total: f64 = weights.iter().sum();
            if total.is_nan() || total <= 0.0 {
                return Err(band);
            }
            let first = weights.iter().position(|w| *w != 0.0).unwrap_or(0);
            let last = weights.iter().rposition(|w| *w != 0.0).unwrap_or(0);
            rows.push((first, weights[first..=last].iter().map(|w| w / total).collect()));
            integrals.push(total);
            let mut next = first;
            let of_wavelength = grid.entries()[first..=last].chunk_by(|a, b| a.wavelength == b.wavelength);
            runs.push(
                of_wavelength
                    .map(|run| {
                        next += run.len();
                        next - run.len()..next
                    })
                    .collect(),
            );
        }
        Ok((Self { channels: bands.iter().map(|(channel, _)| channel.clone()).collect(), rows, runs }, integrals))
    }

    /// These channels and then others.
    #[must_use]
    pub fn joined(mut self, others: Self) -> Self {
        self.channels.extend(others.channels);
        self.rows.extend(others.rows);
        self.runs.extend(others.runs);
        self
    }

    /// The channels, in order of output.
    pub fn channels(&self) -> &[Channel] {
        &self.channels
    }
    /// Number of channels.
    pub fn len(&self) -> usize {
        self.channels.len()
    }
    /// Whether there is no channel.
    pub fn is_empty(&self) -> bool {
        self.channels.is_empty()
    }
    /// First grid entry and weights of channel `c`.
    pub fn row(&self, c: usize) -> (usize, &[f64]) {
        (self.rows[c].0, &self.rows[c].1)
    }

    /// The runs of grid entries of one wavelength that channel `c` weighs.
    pub fn runs(&self, c: usize) -> &[Range<usize>] {
        &self.runs[c]
    }

    /// Response-weighted means of a spectrum: fills `out`, one value per channel.
    pub fn fold(&self, spectrum: &[f64], out: &mut [f64]) {
        for (out, (first, weights)) in out.iter_mut().zip(&self.rows) {
            let spectrum = &spectrum[*first..][..weights.len()];
            *out = side_by_side(weights.len(), |i| weights[i] * spectrum[i]);
        }
    }

    /// Light times a transmittance, formed per entry and summed over the entries of each wavelength with their weights, channel
    /// after channel: what [`fold_summed`](Self::fold_summed) multiplies by factors that do not depend on g.
    pub fn summed(&self, light: &[f64], transmittance: Option<&[f64]>) -> Vec<f64> {
        let mut sums = Vec::with_capacity(self.runs.iter().map(Vec::len).sum());
        (0..self.len()).for_each(|c| self.summed_of(c, light, transmittance, &mut sums));
        sums
    }

    /// The same of one channel, appended to `sums`.
    pub fn summed_of(&self, c: usize, light: &[f64], transmittance: Option<&[f64]>, sums: &mut Vec<f64>) {
        let (first, weights) = &self.rows[c];
        sums.extend(self.runs[c].iter().map(|run| {
            let terms = weights[run.start - first..].iter().zip(&light[run.clone()]);
            match transmittance {
                Some(tau) => terms.zip(&tau[run.clone()]).map(|((w, l), t)| w * l * t).sum::<f64>(),
                None => terms.map(|(w, l)| w * l).sum(),
            }
        }));
    }

    /// [`summed`](Self::summed) light of 1: the share of each wavelength in its channel's mean.
    pub fn shares(&self) -> Vec<f64> {
        let of_channel = |((first, weights), runs): (&(usize, Vec<f64>), &Vec<Range<usize>>)| -> Vec<f64> {
            runs.iter().map(|run| weights[run.start - first..run.end - first].iter().sum()).collect()
        };
        self.rows.iter().zip(&self.runs).flat_map(of_channel).collect()
    }

    /// A spectrum that does not depend on g at the wavelengths of each channel, channel after channel.
    pub fn at_wavelengths(&self, spectrum: &[f64]) -> Vec<f64> {
        self.runs.iter().flatten().map(|run| spectrum[run.start]).collect()
    }

    /// Response-weighted means of [`summed`](Self::summed) light times a factor [at the
    /// wavelengths](Self::at_wavelengths).
    pub fn fold_summed(&self, light: &[f64], factor: &[f64], out: &mut [f64]) {
        let mut start = 0;
        for (out, runs) in out.iter_mut().zip(&self.runs) {
            let (light, factor) = (&light[start..][..runs.len()], &factor[start..][..runs.len()]);
            *out = side_by_side(runs.len(), |i| light[i] * factor[i]);
            start += runs.len();
        }
    }

    /// Response-weighted means of the product of two spectra, formed per entry and averaged last.
    pub fn fold_product(&self, a: &[f64], b: &[f64], out: &mut [f64]) {
        for (out, (first, weights)) in out.iter_mut().zip(&self.rows) {
            let (a, b) = (&a[*first..][..weights.len()], &b[*first..][..weights.len()]);
            *out = side_by_side(weights.len(), |i| weights[i] * a[i] * b[i]);
        }
    }
}

/// Σ terms, in eight sums that do not wait for one another.
fn side_by_side(n: usize, term: impl Fn(usize) -> f64) -> f64 {
    let mut sums = [0.0; 8];
    for i in (0..n - n % 8).step_by(8) {
        sums.iter_mut().enumerate().for_each(|(k, sum)| *sum += term(i + k));
    }
    let rest: f64 = (n - n % 8..n).map(&term).sum();
    sums.iter().sum::<f64>() + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    fn channel(name: &str) -> Channel {
        Channel { name: name.into(), centre: Wavelength::from_um(0.5), fwhm: 0.1 }
    }

    /// A factor that rises across a band shifts its mean and gives its integral: ∫ λ dλ and ∫ λ² dλ over 0.42..0.52.
    #[test]
    fn a_weighted_channel_is_the_integral_over_its_own_weight() {
        let grid = SpectralGrid::from_edges(&[0.42, 0.47, 0.52]);
        let wavelengths: Vec<f64> = grid.entries().iter().map(|entry| entry.wavelength.um()).collect();
        let band = [(channel("blue"), Curve::boxcar(0.42, 0.52))];
        let (channels, integrals) = Channels::weighted(&grid, &band, &wavelengths).unwrap();
        let moment = |p: i32| (0.52f64.powi(p) - 0.42f64.powi(p)) / f64::from(p);
        let mut mean = [0.0; 1];
        channels.fold(&wavelengths, &mut mean);
        assert!((integrals[0] / moment(2) - 1.0).abs() < 1e-12);
        assert!((mean[0] * integrals[0] / moment(3) - 1.0).abs() < 1e-12);
        assert_eq!(Channels::weighted(&grid, &band, &[0.0; 4]).unwrap_err(), 0);
        assert_eq!(channels.clone().joined(channels).len(), 2);
    }

    /// Three g of a wavelength: light and transmittance differ between them, the factor does not.
    #[test]
    fn light_summed_over_g_gives_the_means_of_the_products() {
        let bins = vec![
            crate::Bin { lower: 0.42, upper: 0.47, band: None },
            crate::Bin { lower: 0.47, upper: 0.52, band: None },
            crate::Bin { lower: 0.52, upper: 0.6, band: None },
        ];
        let grid =
            SpectralGrid::with_g(bins, Vec::new(), |bin| if bin.lower < 0.5 { vec![0.5, 0.3, 0.2] } else { vec![1.0] });
        let bands = [(channel("blue"), Curve::boxcar(0.42, 0.5)), (channel("green"), Curve::boxcar(0.48, 0.58))];
        let channels = Channels::new(&grid, &bands);
        let light: Vec<f64> = (0..grid.len()).map(|i| 1.0 + (i as f64).sin()).collect();
        let tau: Vec<f64> = (0..grid.len()).map(|i| 0.5 + 0.4 * (2.0 * i as f64).cos()).collect();
        let factor: Vec<f64> = grid.entries().iter().map(|entry| entry.wavelength.um().powi(3)).collect();
        let product: Vec<f64> = light.iter().zip(&tau).map(|(l, t)| l * t).collect();
        let (mut due, mut found) = ([0.0; 2], [0.0; 2]);
        channels.fold_product(&product, &factor, &mut due);
        let summed = channels.summed(&light, Some(&tau));
        assert!(summed.len() < grid.len());
        channels.fold_summed(&summed, &channels.at_wavelengths(&factor), &mut found);
        assert!(due.iter().zip(found).all(|(a, b)| (a / b - 1.0).abs() < 1e-14), "{due:?} {found:?}");
    }

    /// Two overlapping bands, E and ρ straight lines: the band mean of the product is its exact integral.
    #[test]
    fn two_band_means_of_a_product_are_exact() {
        let grid = SpectralGrid::from_edges(&[0.42, 0.5, 0.52, 0.58]);
        let bands = [(channel("blue"), Curve::boxcar(0.42, 0.52)), (channel("green"), Curve::boxcar(0.5, 0.58))];
        let channels = Channels::new(&grid, &bands);
        let e = Curve::linear(&[(0.4, 1000.0), (0.6, 2000.0)]).unwrap();
        let r = Curve::linear(&[(0.4, 0.1), (0.6, 0.5)]).unwrap();
        let mut means = [0.0; 2];
        channels.fold_product(&e.on(&grid), &r.on(&grid), &mut means);
        let mut summed = [0.0; 2];
        channels.fold_summed(&channels.summed(&e.on(&grid), None), &channels.at_wavelengths(&r.on(&grid)), &mut summed);
        assert!(means.iter().zip(summed).all(|(a, b)| (a / b - 1.0).abs() < 1e-14));
        // E = 1000 (1 + 5 x), ρ = 0.1 (1 + 20 x), x = λ − 0.4: ∫ 100 (1 + 25 x + 100 x²) dx
        let primitive = |x: f64| 100.0 * (x + 12.5 * x * x + 100.0 / 3.0 * x.powi(3));
        let exact = |a: f64, b: f64| (primitive(b - 0.4) - primitive(a - 0.4)) / (b - a);
        assert!((means[0] / exact(0.42, 0.52) - 1.0).abs() < 1e-12);
        assert!((means[1] / exact(0.5, 0.58) - 1.0).abs() < 1e-12);
    }
}
