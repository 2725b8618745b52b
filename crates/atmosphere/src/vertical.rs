//! How a constituent is spread over height, and how much of it lies along a line of sight.

/// The vertical distribution of one constituent over heights above the site, exponential between its levels (straight
/// where a level holds none), and as a share of the column above the site: the whole column counts 1. Below its lowest
/// level it goes on as between the two lowest, for at most 5 km; above its highest there is nothing.
#[derive(Clone, Debug)]
pub(crate) struct Vertical {
    height: Vec<f64>,
    density: Vec<f64>,
    /// Share of the column above each level.
    above: Vec<f64>,
}

/// How far below the site a path may run \[m\].
const DEEPEST: f64 = -5000.0;

impl Vertical {
    /// From levels (height above the site \[m\], amount per metre), ascending, at least two; and the whole column above
    /// height 0, in the unit of amount.
    pub fn new(levels: &[(f64, f64)]) -> (Self, f64) {
        let (height, density): (Vec<f64>, Vec<f64>) = levels.iter().copied().unzip();
        let mut vertical = Self { above: vec![0.0; height.len()], height, density };
        for i in (1..vertical.height.len()).rev() {
            let below = vertical.within(i - 1, vertical.height[i - 1], vertical.height[i]);
            vertical.above[i - 1] = vertical.above[i] + below;
        }
        let column = vertical.above(0.0);
        let scale = if column > 0.0 { 1.0 / column } else { 0.0 };
        vertical.density.iter_mut().chain(&mut vertical.above).for_each(|value| *value *= scale);
        (vertical, column)
    }

    /// Share of the column above a height; 1 at the site.
    pub fn above(&self, height: f64) -> f64 {
        let height = height.max(DEEPEST);
        let i = self.segment(height);
        if height >= self.height[i + 1] { 0.0 } else { self.above[i + 1] + self.within(i, height, self.height[i + 1]) }
    }

    /// Mean share of the column per metre between two heights \[m⁻¹\]: that times a path's length is what the path holds,
    /// in columns. Stable as the two heights meet.
    pub fn mean(&self, a: f64, b: f64) -> f64 {
        let (low, high) = (a.min(b).max(DEEPEST), a.max(b).max(DEEPEST));
        if high - low < 1e-6 {
            return self.at(0.5 * (low + high));
        }
        let last = self.segment(high);
        let mut sum = 0.0;
        for i in self.segment(low)..=last {
            let from = if i == 0 { low } else { low.max(self.height[i]) };
            let to = high.min(self.height[i + 1]);
            if to > from {
                sum += self.within(i, from, to) / (high - low);
            }
        }
        sum
    }

    fn at(&self, height: f64) -> f64 {
        let i = self.segment(height);
        if height > self.height[i + 1] { 0.0 } else { self.interpolate(i, height) }
    }

    /// The segment a height lies in; the lowest and highest are taken to reach on.
    fn segment(&self, height: f64) -> usize {
        self.height.partition_point(|z| *z <= height).clamp(1, self.height.len() - 1) - 1
    }

    fn falloff(&self, i: usize) -> Option<f64> {
        let (lower, upper) = (self.density[i], self.density[i + 1]);
        (lower > 0.0 && upper > 0.0).then(|| (lower / upper).ln() / (self.height[i + 1] - self.height[i]))
    }

    fn interpolate(&self, i: usize, height: f64) -> f64 {
        let dz = height - self.height[i];
        match self.falloff(i) {
            Some(k) => self.density[i] * (-k * dz).exp(),
            None => {
                let slope = (self.density[i + 1] - self.density[i]) / (self.height[i + 1] - self.height[i]);
                (self.density[i] + slope * dz).max(0.0)
            }
        }
    }

    /// Amount between two heights of segment `i`.
    fn within(&self, i: usize, from: f64, to: f64) -> f64 {
        let dz = to - from;
        match self.falloff(i) {
            Some(k) => self.interpolate(i, from) * dz * escape(k * dz),
            None => 0.5 * (self.interpolate(i, from) + self.interpolate(i, to)) * dz,
        }
    }
}

/// (1 − e^(−x))/x, stable at 0 and for either sign.
pub(crate) fn escape(x: f64) -> f64 {
    if x.abs() < 1e-8 { 1.0 - 0.5 * x } else { -(-x).exp_m1() / x }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Scale height H: column ρ₀ H, share above z e^(−z/H), and the mean between two heights by the integral.
    #[test]
    fn an_exponential_atmosphere_is_kept_exactly() {
        let scale = 8000.0;
        let levels: Vec<(f64, f64)> =
            (-1..=60).map(|i| 5000.0 * f64::from(i)).map(|z| (z, 2.0 * (-z / scale).exp())).collect();
        let (vertical, column) = Vertical::new(&levels);
        assert!((column / (2.0 * scale) - 1.0).abs() < 1e-12);
        for (a, b) in [(0.0, 100.0), (3.0, 12_345.0), (-400.0, 0.01), (5000.0, 250_000.0)] {
            let exact = ((-a / scale).exp() - (-b / scale).exp()) / (b - a);
            assert!((vertical.mean(a, b) / exact - 1.0).abs() < 1e-9);
            assert!((vertical.mean(b, a) / vertical.mean(a, b) - 1.0).abs() < 1e-15);
        }
        assert!((vertical.mean(700.0, 700.0) * scale / (-700.0 / scale).exp() - 1.0).abs() < 1e-12);
        assert!((vertical.mean(700.0, 700.001) * scale / (-700.0 / scale).exp() - 1.0).abs() < 1e-6);
        assert!((vertical.above(2000.0) - (-2000.0 / scale).exp()).abs() < 1e-12);
        assert_eq!(vertical.above(1e6), 0.0);
    }
}
