//! Fresnel reflectance.

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
}
