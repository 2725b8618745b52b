//! Fresnel reflectance of smooth interfaces, unpolarised.

use sunglint_plugin::{Args, BindError, Default, Param};
use sunglint_radiometry::{Dimension, SpectralGrid};

use crate::quadrature::cosine_mean;
use crate::spectral::{OnGrid, required, spectrum_within};

/// Unpolarised reflectance of a smooth dielectric of relative refractive index `n`, at cosine `cos_theta` to its
/// normal: F = ½ (g−c)²/(g+c)² {1 + [c(g+c)−1]²/[c(g−c)+1]²}, g² = n² − 1 + c² [Cook1982, app.].
/// 1 beyond the critical angle.
pub fn fresnel_dielectric(n: f64, cos_theta: f64) -> f64 {
    let c = cos_theta.clamp(0.0, 1.0);
    let g_squared = n * n - 1.0 + c * c;
    if g_squared < 0.0 {
        return 1.0;
    }
    let g = g_squared.sqrt();
    if g + c == 0.0 {
        return 0.0;
    }
    let (perpendicular, parallel) = ((g - c) / (g + c), (c * (g + c) - 1.0) / (c * (g - c) + 1.0));
    0.5 * perpendicular * perpendicular * (1.0 + parallel * parallel)
}

/// Unpolarised reflectance of a smooth interface to a medium of relative refractive index n + ik, at cosine `cos_theta` to
/// its normal; k ≥ 0, and with k = 0 that of a dielectric [Born1999, sec. 14.2]:
///
/// ```text
/// 2a² = √((n² − k² − s²)² + 4n²k²) + n² − k² − s²      a² + b² = √((n² − k² − s²)² + 4n²k²)      s = sin θ, c = cos θ
/// F_s = (a² + b² − 2ac + c²)/(a² + b² + 2ac + c²)      F_p = F_s [c²(a² + b²) − 2acs² + s⁴]/[c²(a² + b²) + 2acs² + s⁴]
/// F   = ½ (F_s + F_p)
/// ```
pub fn fresnel_conductor(n: f64, k: f64, cos_theta: f64) -> f64 {
    if k == 0.0 {
        return fresnel_dielectric(n, cos_theta);
    }
    let c = cos_theta.clamp(0.0, 1.0);
    let s2 = 1.0 - c * c;
    let real = n * n - k * k - s2;
    let modulus = real.hypot(2.0 * n * k);
    // Where the real part is negative their sum would cancel: 2a² = 4n²k²/(|…| − real) there.
    let twice = if real >= 0.0 { modulus + real } else { 4.0 * n * n * k * k / (modulus - real) };
    let a = (0.5 * twice).sqrt();
    let f_s = (modulus - 2.0 * a * c + c * c) / (modulus + 2.0 * a * c + c * c);
    let (even, odd) = (c * c * modulus + s2 * s2, 2.0 * a * c * s2);
    let f_p = if even + odd > 0.0 { f_s * (even - odd) / (even + odd) } else { f_s };
    0.5 * (f_s + f_p)
}

/// Refractive index of a material against the air, per grid entry.
#[derive(Clone, Debug)]
pub(crate) struct Interface {
    n: OnGrid,
    k: OnGrid,
}

impl Interface {
    /// The parameter `n`.
    pub const N: Param = Param::spectrum("n", Dimension::Fraction, Default::Required, "n, refractive index, real part")
        .within(0.01, 100.0);
    /// The parameter `k`.
    pub const K: Param =
        Param::spectrum("k", Dimension::Fraction, Default::Number(0.0), "k, its imaginary part; 0 for a dielectric")
            .within(0.0, 100.0);

    /// From the arguments `n` and `k`.
    pub fn bind(model: &str, args: &Args, grid: &SpectralGrid) -> Result<Self, BindError> {
        let n = spectrum_within(&Self::N, required(model, args, "n")?, grid)?;
        let k = spectrum_within(&Self::K, required(model, args, "k")?, grid)?;
        Ok(Self { n, k })
    }

    #[cfg(test)]
    pub fn of(n: Vec<f64>, k: Vec<f64>) -> Self {
        Self { n: OnGrid::new(n), k: OnGrid::new(k) }
    }

    /// F at an entry, for light at cosine `c` to the facet's normal.
    pub fn at(&self, entry: usize, c: f64) -> f64 {
        fresnel_conductor(self.n.at(entry), self.k.at(entry), c)
    }

    /// Calls `add` with each entry and its F; F is computed once where n and k do not depend on wavelength.
    pub fn each(&self, n_entries: usize, c: f64, mut add: impl FnMut(usize, f64)) {
        match self.constant() {
            Some((n, k)) => {
                let f = fresnel_conductor(n, k, c);
                (0..n_entries).for_each(|entry| add(entry, f));
            }
            None => (0..n_entries).for_each(|entry| add(entry, self.at(entry, c))),
        }
    }

    /// n and k where neither depends on wavelength.
    pub fn constant(&self) -> Option<(f64, f64)> {
        self.n.constant().zip(self.k.constant())
    }

    /// F_avg = 2 ∫ F cos θ d cos θ at an entry.
    pub fn mean(&self, entry: usize) -> f64 {
        cosine_mean(|theta| self.at(entry, theta.cos()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Glass n = 1.5: ((n−1)/(n+1))² at normal incidence, half the s-part at Brewster's angle, 1 at grazing.
    #[test]
    fn glass_reflects_four_percent_at_normal_incidence_and_all_at_grazing() {
        let n = 1.5_f64;
        assert!((fresnel_dielectric(n, 1.0) - 0.04).abs() < 1e-15);
        assert!((fresnel_dielectric(n, 0.0) - 1.0).abs() < 1e-15);
        let s = (n * n - 1.0) / (n * n + 1.0);
        assert!((fresnel_dielectric(n, n.atan().cos()) - 0.5 * s * s).abs() < 1e-14);
        assert_eq!(fresnel_dielectric(1.0 / n, 0.5), 1.0);
        assert_eq!(fresnel_dielectric(1.0, 0.0), 0.0);
    }

    /// The complex form with almost no absorption is the real one; at the normal it is [(n−1)² + k²]/[(n+1)² + k²].
    #[test]
    fn a_conductor_without_absorption_is_a_dielectric() {
        for n in [0.7, 1.33, 1.5, 4.0] {
            for degree in [0.0_f64, 20.0, 40.0, 56.3, 70.0, 89.0] {
                let c = degree.to_radians().cos();
                let (real, complex) = (fresnel_dielectric(n, c), fresnel_conductor(n, 1e-9, c));
                assert!((real - complex).abs() < 1e-8, "{n} {degree}: {real} {complex}");
            }
        }
        for (n, k) in [(0.18, 3.4), (1.2, 7.1), (2.9, 3.0), (0.05, 9.0)] {
            let normal = ((n - 1.0) * (n - 1.0) + k * k) / ((n + 1.0) * (n + 1.0) + k * k);
            assert!((fresnel_conductor(n, k, 1.0) - normal).abs() < 1e-13, "{n} {k}");
            assert!((fresnel_conductor(n, k, 0.0) - 1.0).abs() < 1e-13, "{n} {k}");
        }
    }

    /// Against complex arithmetic: r_s = (c − q)/(c + q), r_p = (ε c − q)/(ε c + q), q = √(ε − s²), ε = (n + ik)².
    #[test]
    fn the_real_form_is_that_of_complex_amplitudes() {
        type C = (f64, f64);
        let mul = |a: C, b: C| (a.0 * b.0 - a.1 * b.1, a.0 * b.1 + a.1 * b.0);
        let sqrt = |a: C| {
            let r = a.0.hypot(a.1);
            (((r + a.0) / 2.0).max(0.0).sqrt(), ((r - a.0) / 2.0).max(0.0).sqrt())
        };
        let ratio = |a: C, b: C| (a.0 * a.0 + a.1 * a.1) / (b.0 * b.0 + b.1 * b.1);
        for (n, k) in [(0.18, 3.4), (1.2, 7.1), (2.9, 3.0), (1.33, 0.02)] {
            for degree in [0.0_f64, 25.0, 50.0, 75.0, 89.0] {
                let (s, c) = degree.to_radians().sin_cos();
                let e = mul((n, k), (n, k));
                let q = sqrt((e.0 - s * s, e.1));
                let ec = (e.0 * c, e.1 * c);
                let f_s = ratio((c - q.0, -q.1), (c + q.0, q.1));
                let f_p = ratio((ec.0 - q.0, ec.1 - q.1), (ec.0 + q.0, ec.1 + q.1));
                let f = fresnel_conductor(n, k, c);
                assert!((f - 0.5 * (f_s + f_p)).abs() < 1e-12, "{n} {k} {degree}");
            }
        }
    }
}
