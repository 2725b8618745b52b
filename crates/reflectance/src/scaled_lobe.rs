//! A lobe of one shape, k_s times a function of the directions and of one parameter: what `phong`, `blinn_phong` and `ward`
//! share.

use sunglint_radiometry::LocalDir;

use crate::composite::{Gloss, Part, add_terms};
use crate::sampling::pick;
use crate::spectral::OnGrid;

/// A lobe of k_s = 1 against one parameter, an exponent or a roughness.
pub(crate) trait Shape: Send + Sync {
    /// What all parameters share of a pair of directions.
    type Geometry;

    /// Of two directions above the surface.
    fn geometry(incident: LocalDir, outgoing: LocalDir) -> Self::Geometry;
    /// f \[sr⁻¹\].
    fn at(&self, parameter: f64, geometry: &Self::Geometry) -> f64;
    /// An incident direction; it may lie below the surface, and `None` is a draw without one.
    fn draw(&self, parameter: f64, outgoing: LocalDir, u: [f64; 2]) -> Option<LocalDir>;
    /// Density of [`draw`](Self::draw) \[sr⁻¹\].
    fn drawn_with(&self, parameter: f64, geometry: &Self::Geometry) -> f64;
    /// The slope of the half vector within which most of it lies.
    fn slope(&self, parameter: f64) -> f64;
    /// Directional-hemispherical reflectance at `theta` \[rad\], where there is a closed form.
    fn albedo(&self, parameter: f64, theta: f64) -> Option<f64> {
        let _ = (parameter, theta);
        None
    }
}

/// k_s times a shape, per grid entry.
pub(crate) struct ScaledLobe<S> {
    shape: S,
    parameter: OnGrid,
    /// Parameters that draws are made with.
    drawn: Vec<f64>,
    k_s: Vec<f64>,
    terms: Option<[Vec<f64>; 1]>,
}

impl<S: Shape> ScaledLobe<S> {
    /// Separable where the parameter is the same at every entry.
    pub fn new(shape: S, parameter: OnGrid, k_s: Vec<f64>) -> Self {
        let terms = parameter.constant().map(|_| [k_s.clone()]);
        Self { shape, drawn: parameter.representatives(), parameter, k_s, terms }
    }
}

impl<S: Shape> Part for ScaledLobe<S> {
    fn is_present(&self) -> bool {
        self.k_s.iter().any(|k_s| *k_s > 0.0)
    }

    fn add(&self, incident: LocalDir, outgoing: LocalDir, f: &mut [f64]) {
        if self.terms.is_some() {
            return add_terms(self, incident, outgoing, f);
        }
        let geometry = S::geometry(incident, outgoing);
        for (entry, f) in f.iter_mut().enumerate() {
            *f += self.k_s[entry] * self.shape.at(self.parameter.at(entry), &geometry);
        }
    }

    fn terms(&self) -> Option<&[Vec<f64>]> {
        self.terms.as_ref().map(|terms| &terms[..])
    }

    fn shapes(&self, incident: LocalDir, outgoing: LocalDir, shapes: &mut [f64]) {
        shapes[0] = self.shape.at(self.parameter.at(0), &S::geometry(incident, outgoing));
    }

    fn add_albedo(&self, theta: f64, rho: &mut [f64]) -> bool {
        // Found once where the parameter does not depend on wavelength.
        let even = self.parameter.constant().map(|parameter| self.shape.albedo(parameter, theta));
        for (entry, rho) in rho.iter_mut().enumerate() {
            let own = || self.shape.albedo(self.parameter.at(entry), theta);
            let Some(albedo) = even.unwrap_or_else(own) else { return false };
            *rho += self.k_s[entry] * albedo;
        }
        true
    }
}

impl<S: Shape> Gloss for ScaledLobe<S> {
    fn draw(&self, outgoing: LocalDir, u: [f64; 2]) -> Option<LocalDir> {
        let (chosen, u1) = pick(self.drawn.len(), u[1]);
        self.shape.draw(self.drawn[chosen], outgoing, [u[0], u1])
    }

    fn drawn_with(&self, incident: LocalDir, outgoing: LocalDir) -> f64 {
        let geometry = S::geometry(incident, outgoing);
        let of = |parameter: &f64| self.shape.drawn_with(*parameter, &geometry);
        self.drawn.iter().map(of).sum::<f64>() / self.drawn.len() as f64
    }

    fn slope(&self, entry: usize) -> f64 {
        self.shape.slope(self.parameter.at(entry))
    }
}
