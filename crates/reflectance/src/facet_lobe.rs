//! A lobe of facets that are mirrors, f = s F(b) D(h) G(ω_i, ω_o)/(4 cos θ_i cos θ_o) [Torrance1967; Cook1982; Walter2007,
//! eq. 20]: what the facet models share.

use std::f64::consts::FRAC_PI_2;

use sunglint_radiometry::LocalDir;

use crate::AngularSpectra;
use crate::composite::{Gloss, Part, Way, add_terms, gloss_reflectance, on_all_threads};
use crate::fresnel::Interface;
use crate::microfacet::{Facets, Half, Shadowing, normal, reflected, v_groove};
use crate::quadrature::{Hemisphere, tanh_sinh};
use crate::sampling::pick;
use crate::spectral::OnGrid;

/// Narrower than this the facets are one mirror.
pub(crate) const SMOOTH: f64 = 1e-4;

/// How facets lie and what they shade.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Law {
    /// D = B exp(−θ_h²/m²), shading in V-grooves, drawn from D.
    GaussianAngle,
    /// Gaussian slopes, shading in V-grooves, drawn from D.
    Grooved,
    /// Smith's shading, drawn from the facets that are seen.
    Smith(Facets, Shadowing),
}

/// The lobe.
pub(crate) struct FacetLobe {
    law: Law,
    roughness: OnGrid,
    /// B of [`Law::GaussianAngle`] per entry.
    norm: Vec<f64>,
    /// `None` reflects all.
    interface: Option<Interface>,
    /// s per entry.
    scale: Vec<f64>,
    /// Roughnesses that draws are made with, and their B.
    drawn: Vec<(f64, f64)>,
    terms: Option<[Vec<f64>; 1]>,
    /// Whether the facets are one mirror at every wavelength.
    smooth: bool,
}

impl FacetLobe {
    /// A lobe of roughness m or α, scaled by `scale` per grid entry.
    pub fn new(law: Law, roughness: OnGrid, interface: Option<Interface>, scale: Vec<f64>) -> Self {
        let norm_of = |m: f64| if law == Law::GaussianAngle { gaussian_norm(m) } else { 1.0 };
        let norm = match roughness.constant() {
            Some(m) => vec![norm_of(m); scale.len()],
            None => roughness.all().iter().map(|m| norm_of(*m)).collect(),
        };
        let drawn = roughness.representatives().into_iter().map(|m| (m, norm_of(m))).collect();
        // One interface and one roughness for all wavelengths: f = s(λ) × geometry.
        let even = roughness.constant().is_some() && interface.as_ref().is_none_or(|i| i.constant().is_some());
        let terms = even.then(|| [scale.clone()]);
        let smooth = roughness.range().1 < SMOOTH;
        Self { law, roughness, norm, interface, scale, drawn, terms, smooth }
    }

    fn distribution(&self, m: f64, norm: f64, half: &Half) -> f64 {
        match self.law {
            Law::GaussianAngle => {
                let theta = half.tan_squared.sqrt().atan();
                norm * (-(theta * theta) / (m * m)).exp()
            }
            Law::Grooved => crate::microfacet::beckmann(m, half),
            Law::Smith(facets, _) => facets.density(m, half),
        }
    }

    /// D G/(4 cos θ_i cos θ_o) at a roughness.
    fn geometry(&self, m: f64, norm: f64, half: &Half, incident: LocalDir, outgoing: LocalDir) -> f64 {
        let m = m.max(SMOOTH);
        let g = match self.law {
            Law::Smith(facets, shadowing) => facets.shadowing(shadowing, m, incident, outgoing),
            Law::GaussianAngle | Law::Grooved => v_groove(half, incident, outgoing),
        };
        self.distribution(m, norm, half) * g / (4.0 * incident.cos() * outgoing.cos())
    }

    /// Directional-hemispherical reflectance, on nodes that gather geometrically towards the horizon: there it changes over
    /// angles in proportion to the roughness.
    pub fn reflectance(&self, n: usize) -> AngularSpectra {
        let rule = Hemisphere::medium();
        let steps = (0..=32).map(|i| 2.0 * f64::from(i));
        let elevations = (0..).map(|k| 25.0 * 0.9_f64.powi(k)).take_while(|elevation| *elevation > 0.002);
        let angles: Vec<f64> = steps.chain(elevations.map(|elevation| 90.0 - elevation)).map(f64::to_radians).collect();
        let spectra = on_all_threads(&angles, |theta| {
            let mut rho = gloss_reflectance(self, n, Way::Leaving, *theta, &rule);
            self.add_mirror(*theta, &mut rho);
            rho
        });
        AngularSpectra::new(angles, spectra)
    }
}

/// B with ∫ B exp(−θ²/m²) cos θ dω = 1.
fn gaussian_norm(m: f64) -> f64 {
    let reach = (6.5 * m).min(FRAC_PI_2);
    let sum = tanh_sinh(0.0, reach, |t| std::f64::consts::TAU * (-(t * t) / (m * m)).exp() * t.cos() * t.sin());
    1.0 / sum
}

impl Part for FacetLobe {
    fn is_present(&self) -> bool {
        !self.smooth && self.scale.iter().any(|s| *s > 0.0)
    }

    fn add(&self, incident: LocalDir, outgoing: LocalDir, f: &mut [f64]) {
        if self.smooth {
            return;
        }
        if self.terms.is_some() {
            return add_terms(self, incident, outgoing, f);
        }
        let half = Half::of(incident, outgoing);
        let even = self.roughness.constant().map(|m| self.geometry(m, self.norm[0], &half, incident, outgoing));
        let geometry = |entry: usize| {
            let own = || self.geometry(self.roughness.at(entry), self.norm[entry], &half, incident, outgoing);
            self.scale[entry] * even.unwrap_or_else(own)
        };
        match &self.interface {
            Some(interface) => {
                interface.each(f.len(), half.cos_b, |entry, fresnel| f[entry] += geometry(entry) * fresnel)
            }
            None => f.iter_mut().enumerate().for_each(|(entry, f)| *f += geometry(entry)),
        }
    }

    fn terms(&self) -> Option<&[Vec<f64>]> {
        self.terms.as_ref().map(|terms| &terms[..])
    }

    fn shapes(&self, incident: LocalDir, outgoing: LocalDir, shapes: &mut [f64]) {
        let half = Half::of(incident, outgoing);
        let fresnel = self.interface.as_ref().map_or(1.0, |interface| interface.at(0, half.cos_b));
        shapes[0] = fresnel * self.geometry(self.roughness.at(0), self.norm[0], &half, incident, outgoing);
    }
}

impl Gloss for FacetLobe {
    fn draw(&self, outgoing: LocalDir, u: [f64; 2]) -> Option<LocalDir> {
        let (chosen, u1) = pick(self.drawn.len(), u[1]);
        let m = self.drawn[chosen].0.max(SMOOTH);
        let h = match self.law {
            Law::Smith(facets, _) => facets.visible(m, outgoing, [u[0], u1]),
            // tan² θ_h with density D cos θ_h, by inversion.
            Law::Grooved => normal(-m * m * (-u[0]).ln_1p(), u1),
            // θ_h with density proportional to θ_h exp(−θ_h²/m²) up to 90°.
            Law::GaussianAngle => {
                let all = -(-(FRAC_PI_2 * FRAC_PI_2) / (m * m)).exp_m1();
                let theta = (m * (-(-u[0] * all).ln_1p()).sqrt()).min(FRAC_PI_2);
                normal(theta.tan().powi(2), u1)
            }
        };
        reflected(h, outgoing)
    }

    fn drawn_with(&self, incident: LocalDir, outgoing: LocalDir) -> f64 {
        let half = Half::of(incident, outgoing);
        let of = |(m, _): &(f64, f64)| {
            let m = m.max(SMOOTH);
            match self.law {
                Law::Smith(facets, _) => facets.visible_density(m, &half, outgoing),
                Law::Grooved => crate::microfacet::beckmann(m, &half) * half.cos / (4.0 * half.cos_b),
                Law::GaussianAngle => {
                    // Per solid angle: θ_h/sin θ_h times the density of θ_h over 2π θ_h.
                    let theta = half.tan_squared.sqrt().atan();
                    let all = -(-(FRAC_PI_2 * FRAC_PI_2) / (m * m)).exp_m1();
                    let sine = (half.tan_squared / (1.0 + half.tan_squared)).sqrt();
                    let ratio = if sine > 0.0 { theta / sine } else { 1.0 };
                    let density = (-(theta * theta) / (m * m)).exp() / (std::f64::consts::PI * m * m * all);
                    density * ratio / (4.0 * half.cos_b)
                }
            }
        };
        self.drawn.iter().map(of).sum::<f64>() / self.drawn.len() as f64
    }

    fn slope(&self, entry: usize) -> f64 {
        self.roughness.at(entry).max(SMOOTH)
    }

    fn add_mirror(&self, theta: f64, rho: &mut [f64]) {
        if !self.smooth {
            return;
        }
        match &self.interface {
            Some(interface) => {
                interface.each(rho.len(), theta.cos(), |entry, fresnel| rho[entry] += self.scale[entry] * fresnel);
            }
            None => rho.iter_mut().zip(&self.scale).for_each(|(rho, s)| *rho += s),
        }
    }

    fn has_mirror(&self) -> bool {
        self.smooth && self.scale.iter().any(|s| *s > 0.0)
    }
}

/// What a lobe leaves over, returned diffusely and reciprocally [Kelemen2001, eq. 3; Kulla2017]:
///
/// ```text
/// f = c (1 − E(θ_i)) (1 − E(θ_o)) / (π (1 − E_avg))      reflectance at θ_i: c (1 − E(θ_i))
/// ```
///
/// With E the lobe's own reflectance and c the albedo of what lies beneath, it is a base under a shining interface; with E
/// the reflectance of mirrors that lose nothing and c their Fresnel factors, it is light reflected more than once.
pub(crate) struct Leftover {
    /// c per entry.
    share: Vec<f64>,
    /// 1 − E on nodes of angle.
    left: AngularSpectra,
    /// 1 − E_avg per entry.
    mean: Vec<f64>,
}

impl Leftover {
    /// From c and E; where E_avg is 1 nothing is left. E is taken for 5e-4 more than its table has, so that straight lines
    /// between nodes, the last of which holds, never return more than came.
    pub fn new(share: Vec<f64>, taken: &AngularSpectra) -> Self {
        let angles = taken.angles().to_vec();
        let rest = |node| taken.spectrum(node).iter().map(|e| (1.0 - 1.0005 * e).max(0.0)).collect();
        let left = AngularSpectra::new(angles.clone(), (0..angles.len()).map(rest).collect());
        let mean = left.hemispherical().into_iter().map(|mean| mean.max(1e-12)).collect();
        Self { share, left, mean }
    }

    /// Its reflectance on the nodes of E.
    pub fn reflectance(&self) -> AngularSpectra {
        let of = |node| self.left.spectrum(node).iter().zip(&self.share).map(|(left, c)| c * left).collect();
        let angles = self.left.angles().to_vec();
        let spectra = (0..angles.len()).map(of).collect();
        AngularSpectra::new(angles, spectra)
    }
}

/// Several of them.
pub(crate) struct Leftovers(pub Vec<Leftover>);

impl Part for Leftovers {
    fn is_present(&self) -> bool {
        self.0.iter().any(|left| left.share.iter().any(|c| *c > 0.0))
    }

    fn add(&self, incident: LocalDir, outgoing: LocalDir, f: &mut [f64]) {
        for part in &self.0 {
            let [(a, v), (b, w)] = part.left.weights(incident.theta());
            let [(c, x), (d, y)] = part.left.weights(outgoing.theta());
            let [a, b, c, d] = [a, b, c, d].map(|node| part.left.spectrum(node));
            for (entry, f) in f.iter_mut().enumerate() {
                let (i, o) = (v * a[entry] + w * b[entry], x * c[entry] + y * d[entry]);
                *f += part.share[entry] * i * o / (std::f64::consts::PI * part.mean[entry]);
            }
        }
    }

    fn terms(&self) -> Option<&[Vec<f64>]> {
        self.0.is_empty().then_some(&[])
    }

    fn add_albedo(&self, theta: f64, rho: &mut [f64]) -> bool {
        for part in &self.0 {
            for (node, weight) in part.left.weights(theta) {
                let left = part.left.spectrum(node).iter().zip(&part.share);
                rho.iter_mut().zip(left).for_each(|(rho, (left, c))| *rho += weight * c * left);
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Bsdf;
    use crate::composite::{Composite, Energy, Nothing};

    fn lobe(law: Law, m: f64) -> Composite<Nothing, FacetLobe> {
        let gloss = FacetLobe::new(law, OnGrid::new(vec![m]), None, vec![1.0]);
        Composite::new(Nothing, gloss, 1, true, Energy::Conserved)
    }

    fn albedo(law: Law, m: f64, degree: f64) -> f64 {
        let mut rho = [0.0];
        lobe(law, m).albedo(LocalDir::from_polar(degree.to_radians(), 0.0), &mut rho);
        rho[0]
    }

    /// Published check values at 0, 30, 60 and 80°, F = 1: midpoint sums of 1200 × 720 cells, three digits.
    #[test]
    fn albedos_of_mirror_facets_are_those_of_independent_sums() {
        let ggx = Law::Smith(Facets::Ggx, Shadowing::Correlated);
        let cases = [
            (Law::Grooved, 0.3, [0.996, 0.981, 0.925, 0.945]),
            (ggx, 0.3, [0.877, 0.864, 0.822, 0.848]),
            (ggx, 0.7, [0.504, 0.518, 0.590, 0.751]),
        ];
        for (law, m, expected) in cases {
            for (degree, rho) in [0.0, 30.0, 60.0, 80.0].into_iter().zip(expected) {
                let found = albedo(law, m, degree);
                assert!((found - rho).abs() < 6e-4, "{law:?} {m} {degree}: {found} {rho}");
            }
        }
    }
}
