//! The five categories for unmeasured materials [Stark1993, sec. 4.1.4].

use std::sync::OnceLock;

use crate::{AngularSpectra, Split};

/// The published curves, `data/categories.csv`: the proposal gives none, so the numbers are this project's own.
const CURVES: &str = include_str!("../data/categories.csv");

/// How much of the light a surface reflects as a mirror does.
#[derive(Clone, Debug, PartialEq)]
pub struct Category {
    /// Name in a scene.
    pub name: &'static str,
    /// View angles \[rad\], 0..90°.
    pub theta: Vec<f64>,
    /// Share of the specular lobe in the reflectance, s = ρ_s/(R_d + ρ_s), at each angle.
    pub share: Vec<f64>,
    /// s at 60°, which is also its cosine-weighted mean over the hemisphere.
    pub share_60: f64,
}

impl Category {
    /// Names, from mirror to matt.
    pub const NAMES: &'static [&'static str] =
        &["highly_specular", "mostly_specular", "combination", "mostly_diffuse", "highly_diffuse"];

    /// The category of a name.
    pub fn find(name: &str) -> Option<&'static Self> {
        Self::all().iter().find(|category| category.name == name)
    }

    /// All five, in the order of [`NAMES`](Self::NAMES).
    pub fn all() -> &'static [Self] {
        static ALL: OnceLock<Vec<Category>> = OnceLock::new();
        ALL.get_or_init(|| {
            let rows: Vec<Vec<f64>> = CURVES
                .lines()
                .skip(1)
                .map(|line| line.split(',').map(|cell| cell.parse().expect("a shipped table")).collect())
                .collect();
            let theta: Vec<f64> = rows.iter().map(|row| row[0].to_radians()).collect();
            let at_60 = rows.iter().position(|row| row[0] == 60.0).expect("a shipped table");
            (Self::NAMES.iter().enumerate())
                .map(|(i, name)| {
                    let share: Vec<f64> = rows.iter().map(|row| row[i + 1]).collect();
                    Self { name, theta: theta.clone(), share_60: share[at_60], share }
                })
                .collect()
        })
    }

    /// The components for a total reflectance per grid entry, with R_d(θ) + ρ_s(θ) = total at every view angle:
    ///
    /// ```text
    /// ρ_s(θ) = T [s₆₀ + κ (s(θ) − s₆₀)]      R_d = T − ρ_s      κ = min(1, (1/T − 1)/(max s − s̄))
    /// ```
    ///
    /// s̄ is the cosine-weighted mean of s. Light along θ_i leaves with T [1 + κ (s(θ_i) − s̄)] in all; κ < 1 flattens
    /// the curve where that would exceed 1 (T > 1/(1 + max s − s̄)).
    pub fn split(&self, total: &[f64], solid_angle: f64) -> Split {
        let curve = AngularSpectra::new(self.theta.clone(), self.share.iter().map(|s| vec![*s]).collect());
        let mean = curve.hemispherical()[0];
        let highest = self.share.iter().copied().fold(0.0, f64::max) - mean;
        let flat: Vec<f64> = total.iter().map(|t| ((1.0 - t) / (t * highest)).clamp(0.0, 1.0)).collect();
        let specular: Vec<Vec<f64>> = (self.share.iter())
            .map(|s| {
                let with_kappa = total.iter().zip(&flat);
                with_kappa.map(|(t, kappa)| t * (self.share_60 + kappa * (s - self.share_60)).clamp(0.0, 1.0)).collect()
            })
            .collect();
        let diffuse = (specular.iter())
            .map(|rho_s| total.iter().zip(rho_s).map(|(t, rho_s)| (t - rho_s).max(0.0)).collect())
            .collect();
        let specular = AngularSpectra::new(self.theta.clone(), specular);
        Split {
            diffuse: AngularSpectra::new(self.theta.clone(), diffuse),
            printed: specular.clone(),
            solid_angle: vec![solid_angle; specular.angles().len()],
            specular,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The documented shares 0.9, 0.7, 0.5, 0.3, 0.1 hold at 60° and as the mean over the hemisphere; the share rises
    /// with view angle to 1 at grazing.
    #[test]
    fn the_documented_share_holds_at_sixty_degrees_and_in_the_mean() {
        for (category, share) in Category::all().iter().zip([0.9, 0.7, 0.5, 0.3, 0.1]) {
            assert_eq!(category.share_60, share);
            let curve = AngularSpectra::new(category.theta.clone(), category.share.iter().map(|s| vec![*s]).collect());
            // Six printed digits.
            assert!((curve.hemispherical()[0] - share).abs() < 1e-6, "{}", category.name);
            assert!(category.share.windows(2).all(|s| s[0] <= s[1]), "{}", category.name);
            assert_eq!(category.share.last(), Some(&1.0));
        }
    }

    /// Whatever the total, R_d + ρ_s is the total at every view angle, between the nodes too, and so is its mean over
    /// the hemisphere; light along any direction leaves with no more than came.
    #[test]
    fn a_category_returns_the_materials_total_reflectance() {
        let total = [0.0, 0.05, 0.5, 0.9, 0.99, 1.0];
        for category in Category::all() {
            let split = category.split(&total, 0.0);
            let diffuse = split.diffuse.hemispherical();
            let specular = split.specular.hemispherical();
            for (entry, t) in total.iter().enumerate() {
                for degree in 0..=180 {
                    let theta = (0.5 * f64::from(degree)).to_radians();
                    let (r_d, rho_s) = (split.diffuse.at(theta, entry), split.specular.at(theta, entry));
                    assert!((r_d + rho_s - t).abs() < 1e-12 && r_d >= 0.0 && rho_s >= 0.0);
                    assert!(diffuse[entry] + rho_s <= 1.0 + 1e-12, "{} {t} {degree}", category.name);
                }
                assert!((diffuse[entry] + specular[entry] - t).abs() < 1e-12);
                let share = split.specular.at(60f64.to_radians(), entry);
                assert!((share - category.share_60 * t).abs() < 1e-12);
            }
        }
    }
}
