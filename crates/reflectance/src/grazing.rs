//! Components against view angle from the first row to the horizon, and the energy rules that they obey. What the model
//! `split` makes of a table and what `fit_split` makes of scans go through here.

use std::f64::consts::{FRAC_PI_2, PI};
use std::fmt;

use crate::spectral::ROUNDING;
use crate::{AngularSpectra, fresnel_dielectric};

/// Refractive index of the Fresnel-shaped growth beyond the last measured angle.
pub(crate) const GRAZING_INDEX: f64 = 1.5;

/// Beyond this angle \[rad\] R_s of a lobe of given reflectance is held: at 90° it has no finite value.
const LAST_BRF: f64 = 89.0 * PI / 180.0;

/// The reflectance of the specular lobe beyond the last measured angle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Grazing {
    /// Grows as F(θ)/F(last), F the Fresnel reflectance of a dielectric of index 1.5, as far as the energy rules let it.
    #[default]
    Fresnel,
    /// Holds its last value.
    Hold,
}

/// What the specular component of a table is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Peak {
    /// A bidirectional reflectance factor over a solid angle \[sr\].
    Brf(f64),
    /// The reflectance of the lobe.
    Reflectance,
}

impl Peak {
    /// ρ_s = R_s Ω_s cos θ/π, or R_s itself.
    pub fn reflectance(self, r_s: f64, theta: f64) -> f64 {
        match self {
            Self::Brf(solid_angle) => r_s * solid_angle * theta.cos().max(0.0) / PI,
            Self::Reflectance => r_s,
        }
    }

    /// R_s = ρ_s π/(Ω_s cos θ), beyond 89° with the cosine of 89°; or ρ_s itself.
    pub fn stated(self, rho_s: f64, theta: f64) -> f64 {
        match self {
            Self::Brf(solid_angle) => rho_s * PI / (solid_angle * theta.min(LAST_BRF).cos()),
            Self::Reflectance => rho_s,
        }
    }

    /// Whether a value at this angle tells a reflectance: any BRF is that of ρ_s = 0 at 90°.
    pub fn tells(self, theta: f64) -> bool {
        self == Self::Reflectance || theta.cos() > 1e-9
    }
}

/// The components at a view angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Row {
    /// View angle \[rad\].
    pub theta: f64,
    /// R_d.
    pub diffuse: f64,
    /// ρ_s.
    pub specular: f64,
    /// R_s as stated.
    pub printed: f64,
}

/// A view angle at which a pair of components returns more than it gets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Excess {
    /// View angle \[rad\].
    pub theta: f64,
    /// R_d there, or its mean over the hemisphere 2 ∫ R_d cos θ sin θ dθ.
    pub diffuse: f64,
    /// ρ_s there.
    pub specular: f64,
    /// Whether `diffuse` is the mean: then light along that angle leaves with too much, else a furnace shows it.
    pub in_the_mean: bool,
}

impl Excess {
    /// By how much the sum exceeds 1.
    pub fn amount(&self) -> f64 {
        self.diffuse + self.specular - 1.0
    }
}

impl fmt::Display for Excess {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { diffuse, specular, .. } = self;
        match self.in_the_mean {
            false => write!(f, "R_d + rho_s = {diffuse:.4} + {specular:.4}")?,
            true => write!(f, "the mean of R_d over the hemisphere, {diffuse:.4}, + rho_s, {specular:.4}")?,
        }
        write!(f, " exceeds 1 by {:.4}", self.amount())
    }
}

/// Holds the first row down to 0°.
pub(crate) fn down_to_normal(rows: &mut Vec<Row>) {
    if let Some(first) = rows.first().copied().filter(|row| row.theta > 0.0) {
        rows.insert(0, Row { theta: 0.0, ..first });
    }
}

/// 2 ∫ R_d cos θ sin θ dθ of the straight lines between rows; the end rows hold outside.
pub(crate) fn mean_diffuse(rows: &[Row]) -> f64 {
    let theta = rows.iter().map(|row| row.theta).collect();
    AngularSpectra::new(theta, rows.iter().map(|row| vec![row.diffuse]).collect()).hemispherical()[0]
}

/// Where rows break R_d(θ) + ρ_s(θ) ≤ 1 or 2 ∫ R_d cos θ sin θ dθ + ρ_s(θ) ≤ 1, in the order of their angles.
pub(crate) fn excesses(rows: &[Row]) -> Vec<Excess> {
    let mean = mean_diffuse(rows);
    (rows.iter())
        .flat_map(|row| {
            let of = |diffuse, in_the_mean| Excess { theta: row.theta, diffuse, specular: row.specular, in_the_mean };
            [of(row.diffuse, false), of(mean, true)]
        })
        .filter(|excess| excess.amount() > ROUNDING)
        .collect()
}

/// Carries ρ_s from row `known − 1`, the last that has it, to the rows behind and on to 90° in steps of 1°, where R_d
/// holds its last value. ρ_s never exceeds what the energy rules leave.
pub(crate) fn to_horizon(rows: &mut Vec<Row>, known: usize, grazing: Grazing, peak: Peak) {
    let Some(from) = known.checked_sub(1).and_then(|last| rows.get(last)).copied() else { return };
    let mean = mean_diffuse(rows);
    let last = rows[rows.len() - 1];
    if last.theta < FRAC_PI_2 {
        let first = (last.theta.to_degrees() + 1e-6).floor() as u32 + 1;
        let angles = (first..90).map(|degree| f64::from(degree).to_radians()).chain([FRAC_PI_2]);
        rows.extend(angles.map(|theta| Row { theta, ..last }));
    }
    let fresnel = |theta: f64| fresnel_dielectric(GRAZING_INDEX, theta.cos());
    for row in &mut rows[known..] {
        let wanted = match grazing {
            Grazing::Fresnel => from.specular * fresnel(row.theta) / fresnel(from.theta),
            Grazing::Hold => from.specular,
        };
        row.specular = wanted.min((1.0 - row.diffuse.max(mean)).max(0.0));
        row.printed = peak.stated(row.specular, row.theta);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(degree: f64, diffuse: f64, specular: f64) -> Row {
        Row { theta: degree.to_radians(), diffuse, specular, printed: 0.0 }
    }

    /// A lobe that was carried from 75° to 89° and one that is carried from 75° on by the same rule are the same at 90°,
    /// where the energy rules cut it too.
    #[test]
    fn the_rule_carries_on_from_any_of_its_own_rows() {
        for (grazing, diffuse, specular) in
            [(Grazing::Fresnel, 0.1, 0.02), (Grazing::Fresnel, 0.5, 0.3), (Grazing::Hold, 0.5, 0.3)]
        {
            let mut rows = vec![row(0.0, diffuse, specular), row(75.0, diffuse, specular)];
            to_horizon(&mut rows, 2, grazing, Peak::Brf(2e-3));
            assert_eq!((rows.len(), rows[16].theta), (17, FRAC_PI_2));
            let mut again = rows[..16].to_vec();
            to_horizon(&mut again, 16, grazing, Peak::Brf(2e-3));
            for (a, b) in rows.iter().zip(&again) {
                assert!((a.specular - b.specular).abs() < 1e-15 && a.diffuse == b.diffuse, "{a:?} {b:?}");
            }
            assert!(excesses(&rows).is_empty());
        }
    }

    /// R_s beyond the last row is the peak of the lobe that has ρ_s, not a held number.
    #[test]
    fn the_stated_peak_follows_the_reflectance() {
        let mut rows = vec![row(60.0, 0.1, 0.02)];
        let peak = Peak::Brf(2e-3);
        down_to_normal(&mut rows);
        to_horizon(&mut rows, 2, Grazing::Hold, peak);
        for row in &rows[2..rows.len() - 1] {
            assert!((peak.reflectance(row.printed, row.theta) / 0.02 - 1.0).abs() < 1e-12);
        }
        assert!(!peak.tells(FRAC_PI_2) && peak.tells(1.57) && Peak::Reflectance.tells(FRAC_PI_2));
    }
}
