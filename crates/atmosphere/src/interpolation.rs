//! Straight lines between the nodes of one fixed wavelength table, brought onto a grid as [`Curve::on`] does it: per bin
//! the line with the mean and first moment of the broken line. As weights, since one table serves many spectra.
//!
//! [`Curve::on`]: sunglint_radiometry::Curve::on

use std::ops::Range;

use sunglint_radiometry::SpectralGrid;

/// For every grid entry its nodes and their weights, which sum to 1.
#[derive(Clone, Debug)]
pub(crate) struct OntoGrid {
    nodes: Range<usize>,
    entries: Vec<Range<usize>>,
    weights: Vec<(usize, f64)>,
}

impl OntoGrid {
    /// From the ascending wavelengths \[µm\] of a table that covers the grid.
    pub fn new(wavelengths: &[f64], grid: &SpectralGrid) -> Self {
        let mut used = wavelengths.len()..0;
        let lines: Vec<Vec<(usize, f64, f64)>> = (grid.bins().iter())
            .map(|bin| {
                let line = lines(wavelengths, bin.lower, bin.upper);
                used.start = used.start.min(line.first().map_or(used.start, |first| first.0));
                used.end = used.end.max(line.last().map_or(used.end, |last| last.0 + 1));
                line
            })
            .collect();
        let used = used.start.min(used.end)..used.end;
        let (mut entries, mut weights) = (Vec::with_capacity(grid.len()), Vec::new());
        for entry in grid.entries() {
            let (from, offset) = (weights.len(), entry.wavelength.um() - grid.bin_of(entry).centre());
            let line = &lines[entry.bin as usize];
            weights.extend(line.iter().map(|(node, mean, slope)| (node - used.start, mean + slope * offset)));
            entries.push(from..weights.len());
        }
        Self { nodes: used, entries, weights }
    }

    /// The nodes that the grid draws on.
    pub fn nodes(&self) -> Range<usize> {
        self.nodes.clone()
    }

    /// Nodes and weights of a grid entry; a node by its place in [`nodes`](Self::nodes). Where bins are wider than the
    /// table's steps a line may dip below 0 at a node of the quadrature.
    pub fn entry(&self, entry: usize) -> &[(usize, f64)] {
        &self.weights[self.entries[entry].clone()]
    }

    /// A value per entry from the values at [`nodes`](Self::nodes), never negative.
    pub fn apply(&self, values: &[f64]) -> Vec<f64> {
        (0..self.entries.len())
            .map(|i| self.entry(i).iter().map(|(node, w)| w * values[*node]).sum::<f64>().max(0.0))
            .collect()
    }
}

/// Of every node's hat function in a bin: its mean, and the slope of the line with its first moment.
fn lines(x: &[f64], lower: f64, upper: f64) -> Vec<(usize, f64, f64)> {
    let (width, centre) = (upper - lower, 0.5 * (lower + upper));
    let first = x.partition_point(|x| *x <= lower).clamp(1, x.len() - 1) - 1;
    let mut sums: Vec<(usize, f64, f64)> = Vec::new();
    for i in first..x.len() - 1 {
        let (a, b) = (lower.max(x[i]), upper.min(x[i + 1]));
        let (h, middle) = (b - a, 0.5 * (a + b));
        if h <= 0.0 {
            break;
        }
        let slope = 1.0 / (x[i + 1] - x[i]);
        let rising = (middle - x[i]) * slope;
        for (node, value, slope) in [(i, 1.0 - rising, -slope), (i + 1, rising, slope)] {
            if sums.last().is_none_or(|last| last.0 < node) {
                sums.push((node, 0.0, 0.0));
            }
            let at = sums.len() - 1 - usize::from(sums[sums.len() - 1].0 > node);
            sums[at].1 += value * h;
            sums[at].2 += value * h * (middle - centre) + slope * h * h * h / 12.0;
        }
    }
    let scale = 1.0 / width;
    sums.iter().map(|(node, integral, moment)| (*node, integral * scale, 12.0 * moment * scale.powi(3))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use sunglint_radiometry::Curve;

    #[test]
    fn weights_do_what_a_curve_does() {
        let rows = [(0.4, 3.0), (0.43, 5.0), (0.44, 4.0), (0.5, 4.5), (0.57, 6.0)];
        let (x, y): (Vec<f64>, Vec<f64>) = rows.iter().copied().unzip();
        let grid = SpectralGrid::from_edges(&[0.405, 0.43, 0.437, 0.439, 0.5, 0.505, 0.57]);
        let onto = OntoGrid::new(&x, &grid);
        let weighted = onto.apply(&y[onto.nodes()]);
        for (a, b) in weighted.iter().zip(Curve::linear(&rows).unwrap().on(&grid)) {
            assert!((a / b - 1.0).abs() < 1e-12, "{a} {b}");
        }
        let within = OntoGrid::new(&x, &SpectralGrid::from_edges(&[0.45, 0.46]));
        assert_eq!(within.nodes(), 2..4);
    }
}
