//! The view-angle-dependent components R_d(θ_v), R_s(θ_v) of the split method [Stark1993, sec. 4.1.2].

use std::f64::consts::PI;

use sunglint_radiometry::{LocalDir, Reflectance, Spectrum};

use crate::{SOLAR_DISK, TopHat};

use crate::grazing::Peak;

/// Spectra on nodes of view angle, straight lines between: R(θ, λ) = Σ_j w_j(θ) R_j(λ). Two nodes at most have weight,
/// so geometry is shared by all wavelengths and times.
#[derive(Clone, Debug, PartialEq)]
pub struct AngularSpectra {
    theta: Vec<f64>,
    spectra: Vec<Spectrum<Reflectance>>,
}

impl AngularSpectra {
    /// The same spectrum at every view angle.
    pub fn constant(spectrum: Vec<f64>) -> Self {
        Self { theta: vec![0.0], spectra: vec![Spectrum::new(spectrum)] }
    }

    /// Spectra at ascending view angles \[rad\]; the end spectra hold outside.
    ///
    /// # Panics
    /// Where the angles do not ascend or do not match the spectra in number; the model has checked its table before.
    pub fn new(theta: Vec<f64>, spectra: Vec<Vec<f64>>) -> Self {
        assert!(!theta.is_empty() && theta.len() == spectra.len() && theta.windows(2).all(|w| w[0] < w[1]));
        Self { theta, spectra: spectra.into_iter().map(Spectrum::new).collect() }
    }

    /// Nodes of view angle \[rad\].
    pub fn angles(&self) -> &[f64] {
        &self.theta
    }
    /// The spectrum of a node.
    pub fn spectrum(&self, node: usize) -> &[f64] {
        &self.spectra[node]
    }
    /// Whether every value is 0.
    pub fn is_zero(&self) -> bool {
        self.spectra.iter().all(|spectrum| spectrum.iter().all(|value| *value == 0.0))
    }

    /// The sum with another on the same nodes.
    ///
    /// # Panics
    /// Where the nodes differ.
    pub(crate) fn plus(&self, other: &Self) -> Self {
        assert!(self.theta == other.theta);
        let sum = |(a, b): (&Spectrum<Reflectance>, &Spectrum<Reflectance>)| {
            Spectrum::new(a.iter().zip(b.iter()).map(|(a, b)| a + b).collect())
        };
        Self { theta: self.theta.clone(), spectra: self.spectra.iter().zip(&other.spectra).map(sum).collect() }
    }

    /// Every value by its angle \[rad\] and grid entry.
    fn mapped(&self, value: impl Fn(f64, usize, f64) -> f64) -> Self {
        let spectra = self.theta.iter().zip(&self.spectra).map(|(theta, spectrum)| {
            spectrum.iter().enumerate().map(|(entry, before)| value(*theta, entry, *before)).collect()
        });
        Self::new(self.theta.clone(), spectra.collect())
    }

    /// The two nodes beside a view angle \[rad\] and their weights; the second weight is 0 at a node and outside.
    pub fn weights(&self, theta: f64) -> [(usize, f64); 2] {
        let above = self.theta.partition_point(|node| *node <= theta);
        if above == 0 {
            return [(0, 1.0), (0, 0.0)];
        }
        if above == self.theta.len() {
            return [(above - 1, 1.0), (above - 1, 0.0)];
        }
        let t = (theta - self.theta[above - 1]) / (self.theta[above] - self.theta[above - 1]);
        [(above - 1, 1.0 - t), (above, t)]
    }

    /// Weights of the nodes in the cosine-weighted mean over the hemisphere, 2 ∫ R(θ) cos θ sin θ dθ = Σ_j W_j R_j:
    /// exact for the straight lines between nodes.
    pub fn hemispherical_weights(&self) -> Vec<f64> {
        let theta = &self.theta;
        let mut weights = vec![0.0; theta.len()];
        let (first, last) = (theta[0], theta[theta.len() - 1]);
        weights[0] += 0.5 * (1.0 - (2.0 * first).cos());
        weights[theta.len() - 1] += 0.5 * (1.0 + (2.0 * last).cos());
        for (j, pair) in theta.windows(2).enumerate() {
            let (a, b) = (pair[0], pair[1]);
            let both = 0.5 * ((2.0 * a).cos() - (2.0 * b).cos());
            let rising = -0.5 * (2.0 * b).cos() + 0.25 * ((2.0 * b).sin() - (2.0 * a).sin()) / (b - a);
            weights[j] += both - rising;
            weights[j + 1] += rising;
        }
        weights
    }

    /// The cosine-weighted mean over the hemisphere, per grid entry.
    pub fn hemispherical(&self) -> Vec<f64> {
        let mut mean = vec![0.0; self.spectra[0].len()];
        for (weight, spectrum) in self.hemispherical_weights().iter().zip(&self.spectra) {
            mean.iter_mut().zip(spectrum.iter()).for_each(|(mean, value)| *mean += weight * value);
        }
        mean
    }

    /// Fills `values` with the spectrum at a view angle \[rad\].
    pub fn fill(&self, theta: f64, values: &mut [f64]) {
        let [(j, w), (k, v)] = self.weights(theta);
        let pairs = self.spectra[j].iter().zip(self.spectra[k].iter());
        values.iter_mut().zip(pairs).for_each(|(value, (a, b))| *value = w * a + v * b);
    }

    /// Value at a view angle \[rad\] and grid entry.
    pub fn at(&self, theta: f64, entry: usize) -> f64 {
        self.weights(theta).iter().map(|(node, weight)| weight * self.spectra[*node][entry]).sum()
    }
}

/// Solid angles up to here are the sun's disk, with its two printed digits, and make a true mirror \[sr\].
pub(crate) const MIRROR_LIMIT: f64 = 1.001 * SOLAR_DISK;

/// What a model hands to the published algorithms.
#[derive(Clone, Debug, PartialEq)]
pub struct Split {
    /// R_d(θ_v), the diffuse component \[1\].
    pub diffuse: AngularSpectra,
    /// ρ_s(θ_v), reflectance of the specular lobe \[1\]: ρ_s = R_s Ω_s cos θ_v / π where R_s is a BRF.
    pub specular: AngularSpectra,
    /// R_s(θ_v) as the scene or its table states it: a BRF (the height of a measured peak) or a reflectance. The
    /// published reading multiplies this number as printed.
    pub printed: AngularSpectra,
    /// Solid angle Ω_s of the lobe about the mirror direction \[sr\] at the nodes of `specular`; 0 is a true mirror.
    pub solid_angle: Vec<f64>,
}

impl Split {
    /// A model that reflects diffusely only.
    pub fn diffuse(diffuse: AngularSpectra, n_entries: usize) -> Self {
        let none = AngularSpectra::constant(vec![0.0; n_entries]);
        Self { diffuse, specular: none.clone(), printed: none, solid_angle: vec![0.0] }
    }

    /// Fills `f` with the BRDF \[sr⁻¹\] that the components stand for, R_d/π and a top hat of solid angle Ω_s about the
    /// mirror direction; a lobe no wider than the sun's disk is a mirror and has none.
    pub fn brdf(&self, incident: LocalDir, outgoing: LocalDir, f: &mut [f64]) {
        if incident.cos() <= 0.0 || outgoing.cos() <= 0.0 {
            return f.fill(0.0);
        }
        // What does not depend on angle needs none.
        let even = self.diffuse.angles().len() == 1 && self.specular.angles().len() == 1 && self.solid_angle[0] == 0.0;
        let theta = if even { 0.0 } else { outgoing.theta() };
        self.diffuse.fill(theta, f);
        f.iter_mut().for_each(|f| *f /= PI);
        self.add_lobe(incident, outgoing, theta, f);
    }

    /// Adds the specular component's f seen at angle `theta` \[rad\]; both directions are above the surface.
    pub(crate) fn add_lobe(&self, incident: LocalDir, outgoing: LocalDir, theta: f64, f: &mut [f64]) {
        let cone = TopHat::new(self.solid_angle_at(theta));
        if self.lobe_solid_angle(theta) > 0.0 && cone.contains(incident, outgoing) {
            let height = cone.height(theta);
            for (node, weight) in self.specular.weights(theta) {
                let rho_s = self.specular.spectrum(node);
                f.iter_mut().zip(rho_s).for_each(|(f, rho_s)| *f += height * weight * rho_s);
            }
        }
    }

    /// The same shape with another total reflectance, one of 0..1 for each grid entry:
    ///
    /// ```text
    /// 2 ∫ (R_d + ρ_s) cos θ sin θ dθ = T
    /// R_d' = D + κ (c R_d − D)     ρ_s' = S + κ (c ρ_s − S)     c = T/2∫(R_d + ρ_s) cos θ sin θ dθ
    /// κ = min(1, (1 − T)/(max c (R_d + ρ_s) − T), (1 − T)/(max c ρ_s − S))
    /// ```
    ///
    /// D and S are the cosine-weighted means of c R_d and c ρ_s, D + S = T. κ < 1 flattens both towards their means
    /// where R_d + ρ_s (a furnace) or D + ρ_s (light along one direction) would exceed 1, and keeps the total: near
    /// T = 1 nothing is left to vary with angle. Between, a lobe that would have to exceed 1 at grazing starts from a
    /// higher value at normal incidence, as a better reflector's does. R_s as stated changes in proportion to ρ_s. An
    /// entry that is black has no shape and becomes Lambertian.
    ///
    /// `None` where the totals are not one of 0..1 for each entry.
    pub fn scaled_to(&self, total: &[f64]) -> Option<Self> {
        let n = self.diffuse.spectrum(0).len();
        if total.len() != n || !total.iter().all(|t| (0.0..=1.0).contains(t)) {
            return None;
        }
        let (d, s) = (self.diffuse.hemispherical(), self.specular.hemispherical());
        let mut angles = [self.diffuse.angles(), self.specular.angles()].concat();
        angles.sort_by(f64::total_cmp);
        let scales: Vec<Scale> = (0..n)
            .map(|entry| {
                let (t, before) = (total[entry], d[entry] + s[entry]);
                if before <= 0.0 {
                    return Scale { factor: 0.0, diffuse: t, specular: 0.0, kappa: 0.0 };
                }
                let factor = t / before;
                let (mut sum, mut lobe) = (0.0f64, 0.0f64);
                for theta in &angles {
                    let rho_s = factor * self.specular.at(*theta, entry);
                    sum = sum.max(factor * self.diffuse.at(*theta, entry) + rho_s);
                    lobe = lobe.max(rho_s);
                }
                let (diffuse, specular) = (factor * d[entry], factor * s[entry]);
                let allowed = |excess: f64| if excess > 1.0 - t { (1.0 - t) / excess } else { 1.0 };
                let kappa = allowed(sum - t).min(allowed(lobe - specular));
                Scale { factor, diffuse, specular, kappa }
            })
            .collect();
        let diffuse = self.diffuse.mapped(|_, entry, value| scales[entry].of(value, scales[entry].diffuse));
        let specular = self.specular.mapped(|_, entry, value| scales[entry].of(value, scales[entry].specular));
        let printed = if self.printed == self.specular {
            specular.clone()
        } else {
            self.printed.mapped(|theta, entry, value| {
                let (before, after) = (self.specular.at(theta, entry), specular.at(theta, entry));
                let solid_angle = self.solid_angle_at(theta);
                match () {
                    () if before > 0.0 => value * after / before,
                    () if solid_angle > 0.0 => Peak::Brf(solid_angle).stated(after, theta),
                    () => after,
                }
            })
        };
        Some(Self { diffuse, specular, printed, solid_angle: self.solid_angle.clone() })
    }

    /// Ω_s at a view angle \[rad\], 0 where the lobe is a true mirror: no wider than the sun's disk, however wide that is on the
    /// day.
    pub fn lobe_solid_angle(&self, theta: f64) -> f64 {
        let solid_angle = self.solid_angle_at(theta);
        if solid_angle > MIRROR_LIMIT { solid_angle } else { 0.0 }
    }

    /// Ω_s at a view angle \[rad\], a straight line between nodes \[sr\].
    pub fn solid_angle_at(&self, theta: f64) -> f64 {
        self.specular.weights(theta).iter().map(|(node, weight)| weight * self.solid_angle[*node]).sum()
    }
}

/// How the components of one grid entry are scaled.
struct Scale {
    factor: f64,
    /// Means over the hemisphere after scaling.
    diffuse: f64,
    specular: f64,
    kappa: f64,
}

impl Scale {
    fn of(&self, value: f64, mean: f64) -> f64 {
        (mean + self.kappa * (self.factor * value - mean)).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    /// Any shape takes any total, exactly, and keeps both energy rules; where it fits under them it keeps its shape.
    #[test]
    fn a_split_scales_to_any_total_within_the_energy_rules() {
        let total = [0.0, 0.03, 0.3, 0.7, 0.999, 1.0];
        let repeat = |values: [f64; 4]| values.map(|value| vec![value; total.len()]).to_vec();
        let theta = vec![0.0, 0.5, 1.2, FRAC_PI_2];
        for (diffuse, specular) in [
            ([0.3, 0.31, 0.2, 0.1], [0.01, 0.02, 0.1, 0.7]),
            ([0.0; 4], [0.1, 0.1, 0.5, 1.0]),
            ([0.2, 0.3, 0.9, 1.0], [0.0; 4]),
            ([0.0; 4], [0.0; 4]),
        ] {
            let specular = AngularSpectra::new(theta.clone(), repeat(specular));
            let solid_angle = vec![1e-3; 4];
            let printed = specular.mapped(|theta, _, value| Peak::Brf(1e-3).stated(value, theta));
            let diffuse = AngularSpectra::new(theta.clone(), repeat(diffuse));
            let split = Split { diffuse, specular, printed, solid_angle };
            let scaled = split.scaled_to(&total).expect("totals of 0..1");
            let (d, s) = (scaled.diffuse.hemispherical(), scaled.specular.hemispherical());
            for (entry, t) in total.iter().enumerate() {
                assert!((d[entry] + s[entry] - t).abs() < 1e-14, "{t}");
                for i in 0..=100 {
                    let theta = FRAC_PI_2 * f64::from(i) / 100.0;
                    let (r_d, rho_s) = (scaled.diffuse.at(theta, entry), scaled.specular.at(theta, entry));
                    assert!(
                        r_d >= 0.0 && rho_s >= 0.0 && r_d + rho_s <= 1.0 + 1e-14 && d[entry] + rho_s <= 1.0 + 1e-14
                    );
                }
                for (node, theta) in theta.iter().enumerate() {
                    let stated = Peak::Brf(1e-3).reflectance(scaled.printed.spectrum(node)[entry], *theta);
                    assert!(*theta > 1.5 || (stated - scaled.specular.spectrum(node)[entry]).abs() < 1e-14);
                }
            }
            let shape =
                |split: &Split, theta: f64, entry| (split.diffuse.at(theta, entry), split.specular.at(theta, entry));
            let ((a, b), (c, d)) = (shape(&split, 0.3, 1), shape(&scaled, 0.3, 1));
            assert!((a * d - b * c).abs() < 1e-14);
        }
        assert!(Split::diffuse(AngularSpectra::constant(vec![0.1]), 1).scaled_to(&[1.1]).is_none());
        assert!(Split::diffuse(AngularSpectra::constant(vec![0.1]), 1).scaled_to(&[0.1, 0.2]).is_none());
    }

    /// R(θ) = θ from 0 to 90°: 2 ∫ θ cos θ sin θ dθ = π/4, by parts.
    #[test]
    fn the_hemispherical_mean_of_a_straight_line_is_exact() {
        let line = AngularSpectra::new(vec![0.0, 0.3, FRAC_PI_2], vec![vec![0.0], vec![0.3], vec![FRAC_PI_2]]);
        assert!((line.hemispherical()[0] - FRAC_PI_2 / 2.0).abs() < 1e-14);
        assert!((AngularSpectra::constant(vec![0.25]).hemispherical()[0] - 0.25).abs() < 1e-15);
        let inner = AngularSpectra::new(vec![0.4, 0.9], vec![vec![0.7], vec![0.7]]);
        assert!((inner.hemispherical()[0] - 0.7).abs() < 1e-14);
    }
}
