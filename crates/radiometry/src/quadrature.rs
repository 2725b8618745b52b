//! Gauss–Legendre quadrature.

use std::f64::consts::PI;

/// Nodes and weights of so many points on −1..1, by Newton's iteration on P_n [Abramowitz1964, eq. 25.4.29].
pub fn gauss_legendre(n: usize) -> Vec<(f64, f64)> {
    (0..n)
        .map(|i| {
            let mut x = (PI * (i as f64 + 0.75) / (n as f64 + 0.5)).cos();
            let mut slope = 1.0;
            for _ in 0..100 {
                let (mut p, mut before) = (1.0, 0.0);
                for k in 0..n {
                    let k = k as f64;
                    (p, before) = (((2.0 * k + 1.0) * x * p - k * before) / (k + 1.0), p);
                }
                slope = n as f64 * (x * p - before) / (x * x - 1.0);
                let step = p / slope;
                x -= step;
                if step.abs() < 1e-15 {
                    break;
                }
            }
            (x, 2.0 / ((1.0 - x * x) * slope * slope))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    #[test]
    fn sixty_four_nodes_integrate_a_cosine() {
        let sum: f64 = super::gauss_legendre(64).iter().map(|(x, w)| w * (3.0 * x).cos()).sum();
        assert!((sum - 2.0 * 3f64.sin() / 3.0).abs() < 1e-14);
    }
}
