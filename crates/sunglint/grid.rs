//! The spectral grid and the channels of a run, from the bands of its sensor.

use sunglint_plugin::SpectralValue;
use sunglint_radiometry::{Bin, Channels, SpectralGrid};
use sunglint_sensor::Band;

/// Widest bin \[µm\]. Two Gauss nodes a bin: what 2.5 nm bins of one node give, and better.
const WIDEST_BIN: f64 = 0.005;
/// Corners of tables closer than this to an edge \[µm\] make no edge of their own.
const CLOSEST_EDGES: f64 = 0.0005;
/// Tables with more corners than this per widest bin keep their mean and slope in each bin instead of adding edges.
const DENSE_CORNERS: f64 = 3.0;

/// Bins that cover the bands and nothing else: band edges are bin edges, and so are the corners of tables that are
/// coarser than the bins. Where a quantity is given per band, every band owns its bins.
pub fn bins(bands: &[Band], corners: &[Vec<f64>], owned: bool) -> (Vec<Bin>, Vec<String>) {
    let corners: Vec<f64> = corners.iter().filter(|table| !is_dense(table)).flatten().copied().collect();
    if owned {
        let mut names: Vec<String> = Vec::new();
        let mut bins = Vec::new();
        for band in bands.iter() {
            let id = names.len() as u16;
            names.push(band.name.clone());
            let (lower, upper) = band.support();
            bins.extend(split(&[(lower, upper)], &[], &corners).into_iter().map(|(a, b)| Bin {
                lower: a,
                upper: b,
                band: Some(id),
            }));
        }
        return (bins, names);
    }
    // Band edges within a merged interval are edges too.
    let mut intervals: Vec<(f64, f64)> = bands.iter().map(Band::support).collect();
    let edges: Vec<f64> = intervals.iter().flat_map(|(a, b)| [*a, *b]).collect();
    intervals.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut merged: Vec<(f64, f64)> = Vec::new();
    for (lower, upper) in intervals {
        match merged.last_mut() {
            Some(last) if lower <= last.1 => last.1 = last.1.max(upper),
            _ => merged.push((lower, upper)),
        }
    }
    (
        split(&merged, &edges, &corners).into_iter().map(|(a, b)| Bin { lower: a, upper: b, band: None }).collect(),
        Vec::new(),
    )
}

/// The bins that `bands` respond in: those owned by one of them, or where none owns, those that meet their support.
pub fn bins_of(bins: Vec<Bin>, names: &[String], bands: &[Band]) -> Vec<Bin> {
    let serves = |bin: &Bin, band: &Band| match bin.band {
        Some(id) => names[usize::from(id)] == band.name,
        None => band.support().0 < bin.upper - 1e-9 && band.support().1 > bin.lower + 1e-9,
    };
    bins.into_iter().filter(|bin| bands.iter().any(|band| serves(bin, band))).collect()
}

fn is_dense(table: &[f64]) -> bool {
    match (table.first(), table.last()) {
        (Some(first), Some(last)) if table.len() > 2 => {
            table.len() as f64 / ((last - first) / WIDEST_BIN) > DENSE_CORNERS
        }
        _ => false,
    }
}

/// Cuts intervals at `fixed` edges, at `corners` that are not too close to them or to each other, and so that no bin is
/// wider than the widest, on multiples of it.
fn split(intervals: &[(f64, f64)], fixed: &[f64], corners: &[f64]) -> Vec<(f64, f64)> {
    let mut bins = Vec::new();
    for &(lower, upper) in intervals {
        let inside = |x: &f64| *x > lower + 1e-9 && *x < upper - 1e-9;
        let mut edges: Vec<f64> = fixed.iter().copied().filter(inside).chain([lower, upper]).collect();
        edges.sort_by(f64::total_cmp);
        edges.dedup_by(|b, a| *b - *a < 1e-9);
        let first = (lower / WIDEST_BIN).floor() as i64 + 1;
        let regular = (first..).map(|i| i as f64 * WIDEST_BIN).take_while(|x| *x < upper);
        let mut cuts: Vec<f64> = corners.iter().copied().chain(regular).filter(inside).collect();
        cuts.sort_by(f64::total_cmp);
        for pair in edges.windows(2) {
            let mut from = pair[0];
            for cut in &cuts {
                if *cut - from > CLOSEST_EDGES && pair[1] - *cut > CLOSEST_EDGES {
                    bins.push((from, *cut));
                    from = *cut;
                }
            }
            bins.push((from, pair[1]));
        }
    }
    bins
}

/// The channels of a sensor's bands on a grid.
pub fn channels(grid: &SpectralGrid, bands: &[Band]) -> Channels {
    let responses: Vec<_> = bands.iter().map(|band| (band.channel(), band.response.clone())).collect();
    Channels::new(grid, &responses)
}

/// Channels that weigh a band's radiance as a detector of that sensitivity \[electrons per W m⁻² sr⁻¹ µm⁻¹ and µm\] does
/// behind the band's filter, its response scaled to a peak of 1; and the electrons per W m⁻² sr⁻¹ µm⁻¹ of each.
///
/// # Errors
/// The index of a band in which the detector gives no electron.
pub fn electron_channels(
    grid: &SpectralGrid,
    bands: &[Band],
    sensitivity: &[f64],
) -> Result<(Channels, Vec<f64>), usize> {
    let filter = |band: &Band| band.response.clone().scaled(1.0 / band.response.range().1);
    let responses: Vec<_> = bands.iter().map(|band| (band.channel(), filter(band))).collect();
    Channels::weighted(grid, &responses, sensitivity)
}

/// Corners of a spectral value's table \[µm\].
pub fn corners(value: &SpectralValue) -> Vec<f64> {
    match value {
        SpectralValue::Curve(curve) => curve.nodes().to_vec(),
        SpectralValue::Constant(_) | SpectralValue::PerBand(_) => Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The bands of 1993 overlap twice: every edge of every band is an edge of a bin, and no bin is wider than 5 nm.
    #[test]
    fn band_edges_are_bin_edges() {
        let bands = [(0.42, 0.52), (0.5, 0.58), (0.6, 0.75), (0.74, 1.0)]
            .map(|(a, b)| Band::edges(format!("b{a}"), a, b).expect("edges ascend"));
        let (bins, _) = bins(&bands, &[vec![0.4333, 0.4334, 0.7]], false);
        for edge in [0.42, 0.5, 0.52, 0.58, 0.6, 0.74, 0.75, 1.0, 0.4333] {
            assert!(bins.iter().any(|b| (b.lower - edge).abs() < 1e-9 || (b.upper - edge).abs() < 1e-9), "{edge}");
        }
        assert!(bins.iter().all(|b| b.width() <= WIDEST_BIN + 1e-9 && b.width() > 0.0));
        let covered: f64 = bins.iter().map(Bin::width).sum();
        assert!((covered - (0.16 + 0.4)).abs() < 1e-9);
    }
}
