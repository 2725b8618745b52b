//! The view-angle-dependent components R_d(θ_v), R_s(θ_v) of the split method [Stark1993, sec. 4.1.2].

use std::f64::consts::PI;

use sunglint_radiometry::{LocalDir, Reflectance, Spectrum};

use crate::{SOLAR_DISK, TopHat};

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
        let cone = TopHat::new(self.solid_angle_at(theta));
        if self.solid_angle_at(theta) > MIRROR_LIMIT && cone.contains(incident, outgoing) {
            let height = cone.height(theta);
            for (node, weight) in self.specular.weights(theta) {
                let rho_s = self.specular.spectrum(node);
                f.iter_mut().zip(rho_s).for_each(|(f, rho_s)| *f += height * weight * rho_s);
            }
        }
    }

    /// Ω_s at a view angle \[rad\], a straight line between nodes \[sr\].
    pub fn solid_angle_at(&self, theta: f64) -> f64 {
        self.specular.weights(theta).iter().map(|(node, weight)| weight * self.solid_angle[*node]).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

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
