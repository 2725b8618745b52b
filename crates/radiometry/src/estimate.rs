//! Monte Carlo mean and its standard error, from independently scrambled replicates.

/// Independent replicates behind every standard error.
pub const REPLICATES: usize = 16;

/// Two-sided 95 % quantile of Student's t with `REPLICATES − 1` = 15 degrees of freedom (1.96 would cover 93 % only).
pub const STUDENT_T_95: f64 = 2.131_449_545_559_323;

/// A mean and its standard error.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimate {
    /// Mean of the replicates.
    pub mean: f64,
    /// Standard error of that mean, s/√R.
    pub standard_error: f64,
}

/// Mean and standard error of independent, identically distributed replicate means, summed in their given order.
pub fn estimate(replicates: &[f64]) -> Estimate {
    let n = replicates.len() as f64;
    // Shifted by the first value, so that equal replicates have exactly zero variance.
    let shift = replicates.first().copied().unwrap_or(0.0);
    let (mut sum, mut squares) = (0.0, 0.0);
    for value in replicates {
        let d = value - shift;
        sum += d;
        squares += d * d;
    }
    let variance = if replicates.len() > 1 { (squares - sum * sum / n).max(0.0) / (n - 1.0) } else { 0.0 };
    Estimate { mean: shift + sum / n.max(1.0), standard_error: (variance / n.max(1.0)).sqrt() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_replicates_have_no_error() {
        let e = estimate(&[0.1; REPLICATES]);
        assert_eq!((e.mean, e.standard_error), (0.1, 0.0));
    }

    #[test]
    fn the_standard_error_is_that_of_the_mean() {
        // Variance of {1, 2, 3, 4} is 5/3; the mean of four has 5/12.
        let e = estimate(&[1.0, 2.0, 3.0, 4.0]);
        assert!((e.mean - 2.5).abs() < 1e-15 && (e.standard_error - (5f64 / 12.0).sqrt()).abs() < 1e-15);
    }
}
