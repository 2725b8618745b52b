//! Associated Legendre functions, normalised: Λ_l^m(μ) = √((l−m)!/(l+m)!) P_l^m(μ), without the phase (−1)^m, so that
//! `P(cos Θ) = Σ_m (2 − δ_m0) cos mΔφ Σ_l (2l+1) χ_l Λ_l^m(μ) Λ_l^m(μ′)` [Thomas1999, eq. 6.31; Dave1970].

/// Fills `out` with Λ_l^m(μ), l = m, m + 1, … (out\[0\] is l = m).
pub(crate) fn normalised(m: usize, mu: f64, out: &mut [f64]) {
    let sine = ((1.0 - mu) * (1.0 + mu)).max(0.0).sqrt();
    let mut first = 1.0;
    for i in 1..=m {
        let i = i as f64;
        first *= sine * ((2.0 * i - 1.0) / (2.0 * i)).sqrt();
    }
    let m = m as f64;
    let (mut before, mut value) = (0.0, first);
    for (i, out) in out.iter_mut().enumerate() {
        *out = value;
        let l = m + i as f64;
        let down = (l * l - m * m).max(0.0).sqrt();
        let up = ((l + 1.0) * (l + 1.0) - m * m).sqrt();
        (before, value) = (value, ((2.0 * l + 1.0) * mu * value - down * before) / up);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Λ_2^1 = √(1/6) · 3 μ √(1−μ²), Λ_3^0 = P_3, and the addition theorem for a full expansion.
    #[test]
    fn the_addition_theorem_holds() {
        let mut row = [0.0; 4];
        normalised(1, 0.3, &mut row);
        assert!((row[1] - 3.0 * 0.3 * (1.0f64 - 0.09).sqrt() / 6f64.sqrt()).abs() < 1e-15);
        normalised(0, 0.3, &mut row);
        assert!((row[3] - 0.5 * (5.0 * 0.027 - 0.9)).abs() < 1e-15);
        let (a, b, phi): (f64, f64, f64) = (0.4, -0.8, 1.1);
        let cos = a * b + ((1.0 - a * a) * (1.0 - b * b)).sqrt() * phi.cos();
        let mut sum = 0.0;
        for m in 0..6usize {
            let (mut x, mut y) = (vec![0.0; 6 - m], vec![0.0; 6 - m]);
            normalised(m, a, &mut x);
            normalised(m, b, &mut y);
            let twice = if m == 0 { 1.0 } else { 2.0 };
            sum += twice * (m as f64 * phi).cos() * x[5 - m] * y[5 - m];
        }
        let p5 = (63.0 * cos.powi(5) - 70.0 * cos.powi(3) + 15.0 * cos) / 8.0;
        assert!((sum - p5).abs() < 1e-13);
    }
}
