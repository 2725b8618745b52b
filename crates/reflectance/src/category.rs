//! The five categories for unmeasured materials [Stark1993, sec. 4.1.4].
//!
//! Their curves are generated as those of a measured material are: a virtual sample of each category is scanned by the
//! virtual goniometer at the proposal's angles, and the scans are split. The sample is a Lambertian body under a smooth
//! surface of index 1.5,
//!
//! ```text
//! R_d = const     ρ_s(θ) = c F(θ)     c F(60°)/(R_d + c F(60°)) = s₆₀
//! ```
//!
//! with the share s₆₀ of the category. It is dark, so that no energy rule cuts the growth of its lobe towards grazing; the
//! curves are then scaled to a total of 1 before any rule. 60° is the angle at which F of index 1.5 is closest to its
//! cosine-weighted mean (0.0892 for 0.0918), so s₆₀ is the share of the lobe in all the light that leaves, too.

use std::f64::consts::PI;
use std::sync::OnceLock;

use crate::goniometer::{Goniometer, GoniometerBand};
use crate::grazing::GRAZING_INDEX;
use crate::interpolation::Interpolation;
use crate::scans::{ScanBand, ScanFaults};
use crate::split_fit::{SplitOptions, fit_split};
use crate::two_component::TwoComponent;
use crate::{AngularSpectra, Split, fresnel_dielectric};

/// What [`Category::generate`] gives for each, `data/categories.csv`.
const CURVES: &str = include_str!("../data/categories.csv");

/// Share of the lobe at 60°, in the order of [`Category::NAMES`]: the proposal gives none, so the numbers are this
/// project's own.
const SHARES: [f64; 5] = [0.9, 0.7, 0.5, 0.3, 0.1];

/// R_d + ρ_s of the virtual samples at 60°: ρ_s at 90° is 11.2 times that at 60°.
const DARK: f64 = 0.05;

/// How much of the light a surface reflects as a mirror does.
#[derive(Clone, Debug, PartialEq)]
pub struct Category {
    /// Name in a scene.
    pub name: &'static str,
    /// View angles \[rad\], 0..90°.
    pub theta: Vec<f64>,
    /// R_d at each angle for a total reflectance of 1, before any energy rule: a shape, not a surface.
    pub diffuse: Vec<f64>,
    /// ρ_s likewise.
    pub specular: Vec<f64>,
    /// Share of the lobe in the reflectance, ρ_s/(R_d + ρ_s), at 60°.
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
            let column = |column: usize| rows.iter().map(|row| row[column]).collect::<Vec<f64>>();
            let theta: Vec<f64> = rows.iter().map(|row| row[0].to_radians()).collect();
            (Self::NAMES.iter().zip(SHARES).enumerate())
                .map(|(i, (name, share_60))| {
                    let (diffuse, specular) = (column(1 + 2 * i), column(2 + 2 * i));
                    Self { name, theta: theta.clone(), diffuse, specular, share_60 }
                })
                .collect()
        })
    }

    /// The curves of a category anew: its virtual sample through the virtual goniometer and the split.
    ///
    /// # Errors
    /// None for the shares that are shipped: those of a scan and of a split.
    pub fn generate(name: &'static str, share_60: f64) -> Result<Self, ScanFaults> {
        let band = GoniometerBand { band: ScanBand::All, weights: vec![(0, 1.0)] };
        let scans = Goniometer::default().scan(&sample(share_60), 1, &[band])?;
        let options = SplitOptions { interpolation: Interpolation::Pchip, ..SplitOptions::default() };
        let fit = fit_split(&scans, options)?;
        let rows = &fit.bands[0].rows;
        let split = fit.bands[0].split(fit.solid_angle);
        let total = split.diffuse.hemispherical()[0] + split.specular.hemispherical()[0];
        Ok(Self {
            name,
            theta: rows.iter().map(|row| row.theta).collect(),
            diffuse: rows.iter().map(|row| row.diffuse / total).collect(),
            specular: rows.iter().map(|row| row.specular / total).collect(),
            share_60,
        })
    }

    /// The components for a total reflectance of 0..1 per grid entry (values outside count as the nearer end): the
    /// curves [scaled](Split::scaled_to), so that the cosine-weighted mean of R_d + ρ_s over the hemisphere is the total
    /// and nothing returns more than it gets.
    pub fn split(&self, total: &[f64], solid_angle: f64) -> Split {
        let total: Vec<f64> = total.iter().map(|t| t.clamp(0.0, 1.0)).collect();
        let spectra = |values: &[f64]| {
            AngularSpectra::new(self.theta.clone(), values.iter().map(|value| vec![*value; total.len()]).collect())
        };
        let specular = spectra(&self.specular);
        let shape = Split {
            diffuse: spectra(&self.diffuse),
            printed: specular.clone(),
            solid_angle: vec![solid_angle; self.theta.len()],
            specular,
        };
        match shape.scaled_to(&total) {
            Some(scaled) => scaled,
            // A total that is not a number: nothing is returned.
            None => Split { diffuse: spectra(&vec![0.0; self.theta.len()]), ..shape },
        }
    }
}

/// A Lambertian body under a mirror of index 1.5, its lobe at every degree and at the angles of the scan.
fn sample(share_60: f64) -> TwoComponent {
    let fresnel = |theta: f64| fresnel_dielectric(GRAZING_INDEX, theta.cos());
    let c = DARK * share_60 / fresnel(PI / 3.0);
    let theta: Vec<f64> = (0..=90).map(|degree| f64::from(degree).to_radians()).collect();
    let specular = AngularSpectra::new(theta.clone(), theta.iter().map(|theta| vec![c * fresnel(*theta)]).collect());
    TwoComponent::new(Split {
        diffuse: AngularSpectra::constant(vec![DARK * (1.0 - share_60)]),
        printed: specular.clone(),
        solid_angle: vec![0.0; theta.len()],
        specular,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn generated() -> Vec<Category> {
        let all = Category::NAMES.iter().zip(SHARES);
        all.map(|(name, share)| Category::generate(name, share).expect("a split")).collect()
    }

    /// `data/categories.csv` is what the procedure gives, to its nine printed digits. On a change of the procedure
    /// `SUNGLINT_WRITE=1` writes the file anew.
    #[test]
    fn the_shipped_curves_are_those_of_the_virtual_samples() {
        let generated = generated();
        if std::env::var_os("SUNGLINT_WRITE").is_some() {
            let names = Category::NAMES.iter().map(|name| format!("{name}_diffuse,{name}_specular"));
            let mut text = format!("view_zenith_deg,{}\n", names.collect::<Vec<_>>().join(","));
            for (k, theta) in generated[0].theta.iter().enumerate() {
                let values = generated.iter().map(|c| format!("{:.9},{:.9}", c.diffuse[k], c.specular[k]));
                text += &format!("{},{}\n", theta.to_degrees().round(), values.collect::<Vec<_>>().join(","));
            }
            std::fs::write(concat!(env!("CARGO_MANIFEST_DIR"), "/data/categories.csv"), text).expect("a writable file");
        }
        for (shipped, generated) in Category::all().iter().zip(&generated) {
            assert_eq!((shipped.name, shipped.theta.len()), (generated.name, 91));
            let both = |of: fn(&Category) -> &Vec<f64>| of(shipped).iter().zip(of(generated));
            assert!(both(|c| &c.theta).all(|(a, b)| (a - b).abs() < 1e-12));
            assert!(both(|c| &c.diffuse).chain(both(|c| &c.specular)).all(|(a, b)| (a - b).abs() < 6e-10));
        }
    }

    /// What the goniometer and the split make of a sample is the sample: its body exactly, its share at the measured
    /// angles exactly, and between them Fresnel's curve to what a monotone cubic through five angles leaves: 6.3 % at 69°
    /// (straight lines: 20 % at 66°).
    #[test]
    fn the_curves_are_the_sample_but_for_the_interpolation() {
        let fresnel = |degree: f64| fresnel_dielectric(GRAZING_INDEX, degree.to_radians().cos());
        let mut worst = 0.0f64;
        for category in generated() {
            let at = |degree: usize| category.specular[degree] / category.diffuse[degree];
            assert!(category.diffuse.windows(2).all(|r_d| (r_d[0] / r_d[1] - 1.0).abs() < 1e-12), "{}", category.name);
            for degree in [8, 30, 45, 60, 75, 80, 90] {
                let ratio = fresnel(degree as f64) / fresnel(60.0) * category.share_60 / (1.0 - category.share_60);
                assert!((at(degree) / ratio - 1.0).abs() < 1e-12, "{} {degree}", category.name);
            }
            for degree in 0..=90 {
                let ratio = fresnel(degree as f64) / fresnel(60.0) * category.share_60 / (1.0 - category.share_60);
                worst = worst.max((at(degree) / ratio - 1.0).abs());
            }
        }
        println!("worst departure from Fresnel's curve: {worst:.4}");
        assert!(worst < 0.065, "{worst}");
    }

    /// The documented shares 0.9, 0.7, 0.5, 0.3, 0.1 hold at 60°, and to 0.011 in the mean over the hemisphere; the lobe
    /// rises with view angle.
    #[test]
    fn the_documented_share_holds_at_sixty_degrees_and_nearly_in_the_mean() {
        for (category, share) in Category::all().iter().zip(SHARES) {
            let at_60 = category.specular[60] / (category.diffuse[60] + category.specular[60]);
            assert!((at_60 - share).abs() < 1e-8, "{} {at_60}", category.name);
            let one = category.split(&[0.04], 0.0);
            let mean = one.specular.hemispherical()[0] / 0.04;
            assert!((mean - share).abs() < 0.011, "{} {mean}", category.name);
            assert!(category.specular.windows(2).all(|rho_s| rho_s[0] <= rho_s[1]), "{}", category.name);
        }
    }

    /// Whatever the total, it is the mean of R_d + ρ_s over the hemisphere, neither energy rule is broken at any angle,
    /// between the nodes too, and the share at 60° stays the documented one to 0.011.
    #[test]
    fn a_category_returns_the_materials_total_reflectance() {
        let total = [0.0, 0.05, 0.5, 0.9, 0.99, 1.0];
        for category in Category::all() {
            let split = category.split(&total, 0.0);
            let (diffuse, specular) = (split.diffuse.hemispherical(), split.specular.hemispherical());
            for (entry, t) in total.iter().enumerate() {
                for degree in 0..=180 {
                    let theta = (0.5 * f64::from(degree)).to_radians();
                    let (r_d, rho_s) = (split.diffuse.at(theta, entry), split.specular.at(theta, entry));
                    assert!(r_d + rho_s <= 1.0 + 1e-12 && r_d >= 0.0 && rho_s >= 0.0, "{} {t}", category.name);
                    assert!(diffuse[entry] + rho_s <= 1.0 + 1e-12, "{} {t} {degree}", category.name);
                }
                assert!((diffuse[entry] + specular[entry] - t).abs() < 1e-12);
                let sixty = 60f64.to_radians();
                let (r_d, rho_s) = (split.diffuse.at(sixty, entry), split.specular.at(sixty, entry));
                assert!(
                    (rho_s - category.share_60 * (r_d + rho_s)).abs() < 0.011 * t.max(1e-9),
                    "{} {t}",
                    category.name
                );
            }
        }
        assert!(Category::all()[0].split(&[f64::NAN], 0.0).diffuse.is_zero());
    }
}
