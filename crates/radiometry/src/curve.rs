//! Tabulated functions of wavelength.

use crate::SpectralGrid;

/// What a curve does outside its table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Extrapolation {
    /// The curve ends: using it there is an error that the caller reports ([`Curve::covers`]).
    #[default]
    None,
    /// The end values hold.
    Hold,
    /// The end segments go on.
    Linear,
}

/// Why a table is no curve.
#[derive(Clone, Debug, PartialEq)]
pub enum CurveError {
    /// No rows.
    Empty,
    /// Row `row` (from 0) does not lie above the one before it.
    NotAscending {
        /// Index of the offending row.
        row: usize,
    },
    /// Row `row` holds a number that is not finite.
    NotFinite {
        /// Index of the offending row.
        row: usize,
    },
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Shape {
    /// Straight lines between nodes.
    Linear,
    /// Box means: value `i` holds between edges `i` and `i + 1`.
    Steps,
}

/// A function of wavelength \[µm\] given by a table: straight lines between nodes, or box means between edges.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    x: Vec<f64>,
    y: Vec<f64>,
    shape: Shape,
    extrapolation: Extrapolation,
}

impl Curve {
    /// Straight lines between `(wavelength [µm], value)` rows.
    pub fn linear(rows: &[(f64, f64)]) -> Result<Self, CurveError> {
        let (x, y): (Vec<f64>, Vec<f64>) = rows.iter().copied().unzip();
        check(&x, &y)?;
        Ok(Self { x, y, shape: Shape::Linear, extrapolation: Extrapolation::None })
    }

    /// Box means: `values[i]` is the mean between `edges[i]` and `edges[i + 1]` \[µm\].
    ///
    /// # Panics
    /// Where there is not exactly one edge more than values.
    pub fn steps(edges: Vec<f64>, values: Vec<f64>) -> Result<Self, CurveError> {
        assert_eq!(edges.len(), values.len() + 1, "box means need one edge more than values");
        check(&edges, &values)?;
        Ok(Self { x: edges, y: values, shape: Shape::Steps, extrapolation: Extrapolation::None })
    }

    /// One value for all wavelengths.
    pub fn constant(value: f64) -> Self {
        Self { x: vec![0.5], y: vec![value], shape: Shape::Linear, extrapolation: Extrapolation::Hold }
    }

    /// 1 between two wavelengths \[µm\], 0 elsewhere.
    pub fn boxcar(lower: f64, upper: f64) -> Self {
        Self { x: vec![lower, upper], y: vec![1.0], shape: Shape::Steps, extrapolation: Extrapolation::None }
    }

    /// The same curve with another behaviour outside its table.
    #[must_use]
    pub fn extrapolate(mut self, extrapolation: Extrapolation) -> Self {
        self.extrapolation = extrapolation;
        self
    }

    /// The same curve with every value multiplied.
    #[must_use]
    pub fn scaled(mut self, factor: f64) -> Self {
        self.y.iter_mut().for_each(|y| *y *= factor);
        self
    }

    /// First and last wavelength of the table \[µm\].
    pub fn domain(&self) -> (f64, f64) {
        (self.x[0], self.x[self.x.len() - 1])
    }

    /// Smallest and largest tabulated value.
    pub fn range(&self) -> (f64, f64) {
        let fold = |f: fn(f64, f64) -> f64, start| self.y.iter().copied().fold(start, f);
        (fold(f64::min, f64::INFINITY), fold(f64::max, f64::NEG_INFINITY))
    }

    /// Whether the curve speaks for all of `lower..upper` \[µm\], from its table or by declared extrapolation.
    pub fn covers(&self, lower: f64, upper: f64) -> bool {
        let (first, last) = self.domain();
        self.extrapolation != Extrapolation::None || (first <= lower + 1e-9 && upper <= last + 1e-9)
    }

    /// Wavelengths where the curve has a corner or a step \[µm\].
    pub fn nodes(&self) -> &[f64] {
        &self.x
    }

    /// Whether the curve is a single value.
    pub fn is_constant(&self) -> bool {
        self.y.iter().all(|y| *y == self.y[0]) && self.extrapolation != Extrapolation::None
    }

    /// Value at one wavelength \[µm\]; 0 outside the table unless extrapolated.
    pub fn at(&self, wavelength: f64) -> f64 {
        let (first, last) = self.domain();
        if wavelength < first || wavelength > last {
            return self.outside(wavelength);
        }
        let i = self.x.partition_point(|x| *x <= wavelength).clamp(1, self.x.len().max(2) - 1);
        match self.shape {
            Shape::Steps => self.y[i - 1],
            Shape::Linear if self.x.len() == 1 => self.y[0],
            Shape::Linear => {
                let t = (wavelength - self.x[i - 1]) / (self.x[i] - self.x[i - 1]);
                self.y[i - 1] + t * (self.y[i] - self.y[i - 1])
            }
        }
    }

    fn outside(&self, wavelength: f64) -> f64 {
        let (first, _) = self.domain();
        let low = wavelength < first;
        let end = if low { self.y[0] } else { self.y[self.y.len() - 1] };
        match self.extrapolation {
            Extrapolation::None => 0.0,
            Extrapolation::Linear if self.shape == Shape::Linear && self.x.len() > 1 => {
                let i = if low { 1 } else { self.x.len() - 1 };
                let slope = (self.y[i] - self.y[i - 1]) / (self.x[i] - self.x[i - 1]);
                self.y[i] + slope * (wavelength - self.x[i])
            }
            _ => end,
        }
    }

    /// Integral and first moment about `centre` over `lower..upper`, exact for the tabulated shape.
    pub fn moments(&self, lower: f64, upper: f64, centre: f64) -> (f64, f64) {
        let (first, last) = self.domain();
        let mut cuts = vec![lower];
        let inside = self.x.partition_point(|x| *x <= lower)..self.x.partition_point(|x| *x < upper);
        cuts.extend(self.x.get(inside).unwrap_or_default());
        cuts.push(upper);
        let (mut integral, mut moment) = (0.0, 0.0);
        for pair in cuts.windows(2) {
            let (a, b) = (pair[0], pair[1]);
            let (h, m) = (b - a, 0.5 * (a + b));
            if h <= 0.0 {
                continue;
            }
            // Within a piece the curve is a straight line: its value at the middle and its slope say everything.
            let middle = self.at(m);
            let slope = match self.shape {
                Shape::Steps => 0.0,
                Shape::Linear if m < first || m > last => match self.extrapolation {
                    Extrapolation::Linear => (self.at(b) - self.at(a)) / h,
                    _ => 0.0,
                },
                Shape::Linear => (self.at(m + 0.25 * h) - self.at(m - 0.25 * h)) / (0.5 * h),
            };
            integral += middle * h;
            moment += middle * h * (m - centre) + slope * h * h * h / 12.0;
        }
        (integral, moment)
    }

    /// Integral over `lower..upper` \[value · µm\].
    pub fn integral(&self, lower: f64, upper: f64) -> f64 {
        self.moments(lower, upper, lower).0
    }

    /// The curve on a grid: per bin the straight line with the curve's mean and first moment, at the grid's nodes.
    /// A curve that is nowhere negative stays so: where the line would dip below 0 its slope is reduced and the mean
    /// kept.
    pub fn on(&self, grid: &SpectralGrid) -> Vec<f64> {
        let lines: Vec<(f64, f64)> = (grid.bins().iter())
            .map(|bin| {
                let (h, centre) = (bin.width(), bin.centre());
                let (integral, moment) = self.moments(bin.lower, bin.upper, centre);
                let (mean, slope) = (integral / h, 12.0 * moment / (h * h * h));
                let reach = 0.5 * h / 3f64.sqrt();
                let steepest = mean.max(0.0) / reach;
                let dips = mean >= 0.0 && slope.abs() > steepest && self.range().0 >= 0.0;
                (mean, if dips { slope.clamp(-steepest, steepest) } else { slope })
            })
            .collect();
        (grid.entries().iter())
            .map(|entry| {
                let (mean, slope) = lines[entry.bin as usize];
                mean + slope * (entry.wavelength.um() - grid.bin_of(entry).centre())
            })
            .collect()
    }
}

fn check(x: &[f64], y: &[f64]) -> Result<(), CurveError> {
    if y.is_empty() {
        return Err(CurveError::Empty);
    }
    if let Some(row) = (0..x.len()).find(|&i| !x[i].is_finite() || y.get(i).is_some_and(|y| !y.is_finite())) {
        return Err(CurveError::NotFinite { row });
    }
    match (1..x.len()).find(|&i| x[i] <= x[i - 1]) {
        Some(row) => Err(CurveError::NotAscending { row }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A box-mean solar spectrum times a straight-line reflectance: the bin line keeps mean and first moment, so the
    /// band integral is that of the fine product.
    #[test]
    fn the_line_of_a_bin_keeps_products_with_straight_lines() {
        let edges: Vec<f64> = (0..=20).map(|i| 0.5 + 0.001 * f64::from(i)).collect();
        let values: Vec<f64> = (0..20).map(|i| 1500.0 + 40.0 * f64::from((i * 7) % 5)).collect();
        let sun = Curve::steps(edges.clone(), values.clone()).unwrap();
        let slope = Curve::linear(&[(0.5, 0.1), (0.52, 0.5)]).unwrap();
        let grid = SpectralGrid::from_edges(&[0.5, 0.505, 0.51, 0.515, 0.52]);
        let (e, r) = (sun.on(&grid), slope.on(&grid));
        let coarse: f64 = (grid.entries().iter().enumerate())
            .map(|(i, entry)| entry.weight * grid.bin_of(entry).width() * e[i] * r[i])
            .sum();
        let fine: f64 = (0..20).map(|i| values[i] * 0.001 * slope.at(0.5 * (edges[i] + edges[i + 1]))).sum();
        assert!((coarse / fine - 1.0).abs() < 1e-12, "{coarse} {fine}");
    }

    #[test]
    fn integrals_follow_the_table_and_its_ends() {
        let curve = Curve::linear(&[(0.4, 1.0), (0.5, 3.0)]).unwrap();
        assert!((curve.integral(0.4, 0.5) - 0.2).abs() < 1e-15);
        assert!((curve.integral(0.3, 0.6) - 0.2).abs() < 1e-15);
        let hold = curve.clone().extrapolate(Extrapolation::Hold);
        assert!((hold.integral(0.3, 0.6) - (0.1 + 0.2 + 0.3)).abs() < 1e-14);
        let linear = curve.extrapolate(Extrapolation::Linear);
        assert!((linear.integral(0.3, 0.6) - 0.6).abs() < 1e-14);
    }

    #[test]
    fn a_table_that_runs_backwards_names_its_row() {
        assert_eq!(Curve::linear(&[(0.4, 1.0), (0.4, 1.0)]), Err(CurveError::NotAscending { row: 1 }));
        assert_eq!(Curve::linear(&[(0.4, f64::NAN)]), Err(CurveError::NotFinite { row: 0 }));
        assert_eq!(Curve::linear(&[]), Err(CurveError::Empty));
    }

    #[test]
    fn a_spike_never_turns_a_bin_negative() {
        let spike = Curve::linear(&[(0.5, 0.0), (0.5001, 1.0), (0.5002, 0.0), (0.6, 0.0)]).unwrap();
        let grid = SpectralGrid::from_edges(&[0.5, 0.505]);
        assert!(spike.on(&grid).iter().all(|v| *v >= 0.0));
    }
}
