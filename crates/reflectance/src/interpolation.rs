//! Curves through nodes.

/// How a curve runs between its nodes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interpolation {
    /// Straight lines.
    #[default]
    Linear,
    /// Monotone cubics: no value between two nodes lies outside theirs [Fritsch1980].
    Pchip,
}

/// A curve through nodes; outside them the end values hold. At a node it has the node's own value to the last bit.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Curve {
    x: Vec<f64>,
    y: Vec<f64>,
    /// dy/dx at the nodes; empty where straight lines join them.
    slope: Vec<f64>,
}

impl Curve {
    /// Through nodes (x, y) of ascending x, one at least.
    pub fn through(nodes: &[(f64, f64)], interpolation: Interpolation) -> Self {
        let (x, y): (Vec<f64>, Vec<f64>) = nodes.iter().copied().unzip();
        let slope = if interpolation == Interpolation::Pchip { slopes(&x, &y) } else { Vec::new() };
        Self { x, y, slope }
    }

    /// Value at x.
    pub fn at(&self, x: f64) -> f64 {
        let above = self.x.partition_point(|node| *node <= x);
        if above == 0 || above == self.x.len() {
            return self.y[above.saturating_sub(1)];
        }
        let (i, h) = (above - 1, self.x[above] - self.x[above - 1]);
        let t = (x - self.x[i]) / h;
        let (a, b) = (self.y[i], self.y[above]);
        if self.slope.is_empty() {
            return (1.0 - t) * a + t * b;
        }
        // The cubic of Hermite, as its departure from the first node.
        let (da, db) = (h * self.slope[i], h * self.slope[above]);
        a + t * (da + t * (3.0 * (b - a) - 2.0 * da - db + t * (da + db - 2.0 * (b - a))))
    }
}

/// Slopes that keep the cubics monotone: weighted harmonic means of the two secants, 0 where they differ in sign
/// [Fritsch1984]; at the ends the slope of the parabola through three nodes, cut to keep the first secant's sign
/// and three times its size.
fn slopes(x: &[f64], y: &[f64]) -> Vec<f64> {
    let n = x.len();
    let h: Vec<f64> = x.windows(2).map(|x| x[1] - x[0]).collect();
    let secant: Vec<f64> = y.windows(2).zip(&h).map(|(y, h)| (y[1] - y[0]) / h).collect();
    if n < 3 {
        return vec![secant.first().copied().unwrap_or(0.0); n];
    }
    let end = |h0: f64, h1: f64, s0: f64, s1: f64| {
        let slope = ((2.0 * h0 + h1) * s0 - h0 * s1) / (h0 + h1);
        match () {
            () if slope * s0 <= 0.0 => 0.0,
            () if s0 * s1 <= 0.0 && slope.abs() > 3.0 * s0.abs() => 3.0 * s0,
            () => slope,
        }
    };
    let mut slope = vec![end(h[0], h[1], secant[0], secant[1])];
    for i in 1..n - 1 {
        let (s0, s1) = (secant[i - 1], secant[i]);
        let (w0, w1) = (2.0 * h[i] + h[i - 1], h[i] + 2.0 * h[i - 1]);
        slope.push(if s0 * s1 <= 0.0 { 0.0 } else { (w0 + w1) / (w0 / s0 + w1 / s1) });
    }
    slope.push(end(h[n - 2], h[n - 3], secant[n - 2], secant[n - 3]));
    slope
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Nodes keep their values, end values hold, and a step neither overshoots nor turns back.
    #[test]
    fn a_curve_passes_its_nodes_and_stays_between_them() {
        let nodes = [(0.1, 0.2), (0.5, 0.2), (0.8, 0.9), (1.0, 0.95), (1.3, 5.0)];
        for interpolation in [Interpolation::Linear, Interpolation::Pchip] {
            let curve = Curve::through(&nodes, interpolation);
            assert!(nodes.iter().all(|(x, y)| curve.at(*x) == *y));
            assert_eq!((curve.at(0.0), curve.at(2.0)), (0.2, 5.0));
            let values: Vec<f64> = (0..=300).map(|i| curve.at(0.005 * f64::from(i))).collect();
            assert!(values.windows(2).all(|v| v[0] <= v[1] + 1e-15));
        }
        let single = Curve::through(&nodes[..1], Interpolation::Pchip);
        assert_eq!(single.at(0.7), 0.2);
    }

    /// Cubics that keep the slopes of a parabola's nodes follow it to third order: halving the step divides the worst
    /// error by about 8 (the harmonic mean differs from the slope by the square of the step).
    #[test]
    fn monotone_cubics_converge() {
        let worst = |n: i32| {
            let nodes: Vec<(f64, f64)> =
                (0..=n).map(|i| 1.0 + f64::from(i) / f64::from(n)).map(|x| (x, x * x)).collect();
            let curve = Curve::through(&nodes, Interpolation::Pchip);
            (0..=1000).map(|i| 1.0 + 1e-3 * f64::from(i)).map(|x| (curve.at(x) - x * x).abs()).fold(0.0, f64::max)
        };
        let ratio = worst(8) / worst(16);
        assert!((6.0..10.0).contains(&ratio) && worst(16) < 1e-4, "{ratio} {}", worst(16));
    }
}
