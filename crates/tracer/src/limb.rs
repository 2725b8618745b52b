//! The sun's disk darkens towards its limb [Hestroffer1998].
//!
//! ```text
//! I(μ)/I(1) = μ^α,  α(λ) = a + b/λ     μ = √(1 − r²), r in disk radii
//! I(μ)/⟨I⟩ = (1 + α/2) μ^α             since ⟨μ^α⟩ = 2/(2 + α) over the disk
//! ```

use std::sync::OnceLock;

/// a, and b \[µm\].
fn coefficients() -> [f64; 2] {
    static READ: OnceLock<[f64; 2]> = OnceLock::new();
    *READ.get_or_init(|| {
        let rows = include_str!("../data/limb_darkening.csv").lines().filter(|line| !line.starts_with('#'));
        let numbers: Vec<f64> =
            rows.skip(1).flat_map(|row| row.split(',')).map(|n| n.trim().parse().expect("the shipped file")).collect();
        [numbers[0], numbers[1]]
    })
}

/// Radiance of the disk over its mean, at each wavelength \[µm\], at `r` disk radii from its middle.
pub(crate) fn profile(wavelengths: &[f64], r: f64) -> impl Iterator<Item = f64> + '_ {
    let [a, b] = coefficients();
    let mu = (1.0 - r * r).max(0.0).sqrt();
    wavelengths.iter().map(move |wavelength| {
        let alpha = (a + b / wavelength).max(0.0);
        (1.0 + 0.5 * alpha) * mu.powf(alpha)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The mean over the disk is 1 at every wavelength, and the limb is darker in blue than in red. At 550 nm the law lies
    /// within 0.02 of Allen's 0.3 + 0.93 μ − 0.23 μ² [Cox2000, sec. 14.7].
    #[test]
    fn the_disk_keeps_its_light_and_darkens_most_in_blue() {
        let wavelengths = [0.45, 0.55, 0.9];
        let n = 20_000;
        let mut means = [0.0; 3];
        for i in 0..n {
            let r = ((f64::from(i) + 0.5) / f64::from(n)).sqrt();
            means.iter_mut().zip(profile(&wavelengths, r)).for_each(|(mean, i)| *mean += i / f64::from(n));
        }
        assert!(means.iter().all(|mean| (mean - 1.0).abs() < 1e-3), "{means:?}");
        let limb: Vec<f64> = profile(&wavelengths, 0.99).collect();
        assert!(limb[0] < limb[1] && limb[1] < limb[2] && limb[2] < 1.0);
        let middle: Vec<f64> = profile(&wavelengths, 0.0).collect();
        for mu in [0.3, 0.5, 0.7, 0.9f64] {
            let at: Vec<f64> = profile(&wavelengths, (1.0 - mu * mu).sqrt()).collect();
            let allen = 0.3 + 0.93 * mu - 0.23 * mu * mu;
            assert!((at[1] / middle[1] - allen).abs() < 0.02, "{mu}: {} {allen}", at[1] / middle[1]);
        }
    }
}
