//! A diffuse component and a specular lobe, both against view angle: the surface behind `ideal` and `split`.
//!
//! ```text
//! f(ω_i, ω_o) = R_d(θ_o)/π + ρ_s(θ_o)/Q(θ_o) [ω_i in the cone about the mirror direction]     [sr⁻¹]
//! ```

use std::f64::consts::{FRAC_PI_2, PI};

use sunglint_radiometry::LocalDir;

use crate::sampling::cosine_hemisphere;
use crate::split::MIRROR_LIMIT;
use crate::{Bsdf, Claims, Lobes, Sample, Split, TopHat};

pub(crate) struct TwoComponent {
    split: Split,
    lobes: Lobes,
    reciprocal: bool,
    cone: Option<TopHat>,
    /// Whether no component depends on view angle.
    is_even: bool,
    /// 2 ∫ R_d cos θ sin θ dθ per grid entry.
    diffuse_albedo: Vec<f64>,
    /// Probability with which the specular lobe is drawn, at the view angles of `split.specular`.
    specular_choice: Vec<f64>,
}

impl TwoComponent {
    /// From components with one solid angle \[sr\] for all view angles.
    pub fn new(split: Split) -> Self {
        let solid_angle = split.solid_angle[0];
        let (diffuse, specular) = (!split.diffuse.is_zero(), !split.specular.is_zero());
        let wide = solid_angle > MIRROR_LIMIT;
        let lobes = Lobes { diffuse, mirror: specular && !wide, glossy: specular && wide, transmission: false };
        let mean = |values: &[f64]| values.iter().sum::<f64>();
        let mut r_d = vec![0.0; split.diffuse.spectrum(0).len()];
        let specular_choice = (split.specular.angles().iter().enumerate())
            .map(|(node, theta)| match (diffuse, specular) {
                (true, true) => {
                    split.diffuse.fill(*theta, &mut r_d);
                    let (d, s) = (mean(&r_d), mean(split.specular.spectrum(node)));
                    if d + s > 0.0 { (s / (d + s)).clamp(0.1, 0.9) } else { 0.5 }
                }
                (_, specular) => f64::from(u8::from(specular)),
            })
            .collect();
        let constant = |node: usize| split.diffuse.spectrum(node) == split.diffuse.spectrum(0);
        let reciprocal = (0..split.diffuse.angles().len()).all(constant) && !lobes.glossy;
        Self {
            lobes,
            reciprocal,
            cone: lobes.glossy.then(|| TopHat::new(solid_angle)),
            diffuse_albedo: split.diffuse.hemispherical(),
            specular_choice,
            is_even: split.diffuse.angles().len() == 1 && split.specular.angles().len() == 1,
            split,
        }
    }

    /// Angle of a direction, where any component depends on it.
    fn theta(&self, direction: LocalDir) -> f64 {
        if self.is_even { 0.0 } else { direction.theta() }
    }

    fn specular_choice(&self, theta: f64) -> f64 {
        if self.is_even {
            return self.specular_choice[0];
        }
        self.split.specular.weights(theta).iter().map(|(node, weight)| weight * self.specular_choice[*node]).sum()
    }
}

impl Bsdf for TwoComponent {
    fn lobes(&self) -> Lobes {
        self.lobes
    }

    fn claims(&self) -> Claims {
        Claims { reciprocal: self.reciprocal, conserves_energy: true }
    }

    fn split(&self) -> &Split {
        &self.split
    }

    fn eval(&self, incident: LocalDir, outgoing: LocalDir, f: &mut [f64]) {
        self.split.brdf(incident, outgoing, f);
    }

    fn mirror(&self, outgoing: LocalDir, rho: &mut [f64]) {
        if self.lobes.mirror && outgoing.cos() > 0.0 {
            self.split.specular.fill(self.theta(outgoing), rho);
        } else {
            rho.fill(0.0);
        }
    }

    fn sample(&self, outgoing: LocalDir, u: [f64; 3]) -> Option<Sample> {
        if outgoing.cos() <= 0.0 || self.lobes == Lobes::default() {
            return None;
        }
        let choice = self.specular_choice(self.theta(outgoing));
        let incident = match (u[2] < choice, self.cone) {
            (true, None) => return Some(Sample { incident: outgoing.mirrored(), mirror: true, pdf: choice }),
            (true, Some(cone)) => cone.sample(outgoing, [u[0], u[1]]),
            (false, _) => cosine_hemisphere([u[0], u[1]]),
        };
        (incident.cos() > 0.0).then(|| Sample { incident, mirror: false, pdf: self.pdf(incident, outgoing) })
    }

    fn mirror_probability(&self, outgoing: LocalDir) -> f64 {
        if self.lobes.mirror && outgoing.cos() > 0.0 { self.specular_choice(self.theta(outgoing)) } else { 0.0 }
    }

    fn lambertian(&self, outgoing: LocalDir, rho: &mut [f64]) -> f64 {
        if outgoing.cos() <= 0.0 || !self.lobes.diffuse {
            rho.fill(0.0);
            return 0.0;
        }
        self.split.diffuse.fill(self.theta(outgoing), rho);
        1.0 - self.specular_choice(self.theta(outgoing))
    }

    fn rest(&self, incident: LocalDir, outgoing: LocalDir, f: &mut [f64]) -> f64 {
        f.fill(0.0);
        if incident.cos() <= 0.0 || outgoing.cos() <= 0.0 {
            return 0.0;
        }
        let Some(cone) = self.cone.filter(|cone| cone.contains(incident, outgoing)) else { return 0.0 };
        let theta = self.theta(outgoing);
        self.split.add_lobe(incident, outgoing, theta, f);
        self.specular_choice(theta) * cone.density()
    }

    fn is_lambertian_at(&self, incident: LocalDir, outgoing: LocalDir) -> bool {
        self.cone.is_none_or(|cone| !cone.contains(incident, outgoing))
    }

    fn pdf(&self, incident: LocalDir, outgoing: LocalDir) -> f64 {
        if incident.cos() <= 0.0 || outgoing.cos() <= 0.0 || self.lobes == Lobes::default() {
            return 0.0;
        }
        let choice = self.specular_choice(self.theta(outgoing));
        let cone = self.cone.filter(|cone| cone.contains(incident, outgoing));
        (1.0 - choice) * incident.cos() / PI + cone.map_or(0.0, |cone| choice * cone.density())
    }

    fn albedo(&self, incident: LocalDir, rho: &mut [f64]) {
        if incident.cos() <= 0.0 {
            return rho.fill(0.0);
        }
        let theta = incident.theta().min(FRAC_PI_2);
        if self.lobes.mirror {
            self.split.specular.fill(theta, rho);
        } else {
            rho.fill(0.0);
        }
        rho.iter_mut().zip(&self.diffuse_albedo).for_each(|(rho, diffuse)| *rho += diffuse);
        if let Some(cone) = self.cone {
            cone.add_albedo(&self.split.specular, theta, rho);
        }
    }
}
