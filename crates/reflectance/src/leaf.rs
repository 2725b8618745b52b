#![doc = include_str!("leaf.md")]

use std::f64::consts::PI;
use std::sync::Arc;

use glam::DVec3;
use sunglint_plugin::{Args, BindError, Default, Model, ModelInfo, Param};
use sunglint_radiometry::{Dimension, LocalDir, SpectralGrid};

use crate::sampling::cosine_hemisphere;
use crate::spectral::{reflectance_on, required};
use crate::{AngularSpectra, Bsdf, Lobes, Sample, Separable, Split};

/// A bi-Lambertian leaf.
pub const MODEL: Model<dyn Bsdf> = Model {
    info: ModelInfo {
        name: "leaf",
        summary: "Lambert's law on both sides of a thin sheet: reflected, and transmitted",
        manual: include_str!("leaf.md"),
        params: &[
            Param::spectrum("diffuse", Dimension::Fraction, Default::Absent, "ρ, reflectance; else the material's")
                .within(0.0, 1.0),
            Param::spectrum("transmittance", Dimension::Fraction, Default::Required, "τ, transmittance")
                .within(0.0, 1.0),
        ],
    },
    bind,
};

fn bind(args: &Args, grid: &SpectralGrid) -> Result<Arc<dyn Bsdf>, BindError> {
    let rho = match (args.spectral("diffuse"), args.spectral("reflectance")) {
        (Some(diffuse), _) => reflectance_on("diffuse", diffuse, grid)?,
        (None, Some(total)) => reflectance_on("reflectance", total, grid)?,
        (None, None) => {
            return Err(BindError::of_block("S05", "`leaf` has no reflectance: neither its own nor the material's")
                .help("write `diffuse 0.4`, or give the material a `reflectance`"));
        }
    };
    let tau = reflectance_on("transmittance", required("leaf", args, "transmittance")?, grid)?;
    let sums = grid.entries().iter().zip(rho.iter().zip(&tau)).map(|(entry, (rho, tau))| (entry, rho + tau - 1.0));
    // A bin's straight line may pass the tables' own sum by a little.
    if let Some((entry, excess)) = sums.into_iter().find(|(_, excess)| *excess > 1e-3) {
        let nm = entry.wavelength.nm();
        return Err(BindError::of_block(
            "M05",
            format!("ρ + τ returns more than it gets at {nm:.1} nm, by {excess:.4}"),
        ));
    }
    let tau: Vec<f64> = rho.iter().zip(&tau).map(|(rho, tau)| tau.min(1.0 - rho)).collect();
    Ok(Arc::new(Leaf::new(rho, tau)))
}

struct Leaf {
    /// ρ and τ.
    terms: [Vec<f64>; 2],
    split: Split,
    lobes: Lobes,
    /// Probability with which the light's side is drawn that the view is not on.
    through: f64,
}

impl Leaf {
    fn new(rho: Vec<f64>, tau: Vec<f64>) -> Self {
        let split = Split::diffuse(AngularSpectra::constant(rho.clone()), rho.len());
        let (r, t) = (rho.iter().sum::<f64>(), tau.iter().sum::<f64>());
        let lobes = Lobes { diffuse: r > 0.0, transmission: t > 0.0, ..Lobes::default() };
        let through = match (lobes.diffuse, lobes.transmission) {
            (true, true) => (t / (r + t)).clamp(0.1, 0.9),
            (_, transmission) => f64::from(u8::from(transmission)),
        };
        Self { terms: [rho, tau], split, lobes, through }
    }
}

impl Separable for Leaf {
    fn coefficients(&self) -> &[Vec<f64>] {
        &self.terms
    }

    fn shapes(&self, incident: LocalDir, outgoing: LocalDir, shapes: &mut [f64]) {
        let seen = outgoing.cos() > 0.0;
        shapes[0] = if seen && incident.cos() > 0.0 { 1.0 / PI } else { 0.0 };
        shapes[1] = if seen && incident.cos() < 0.0 { 1.0 / PI } else { 0.0 };
    }
}

impl Bsdf for Leaf {
    fn lobes(&self) -> Lobes {
        self.lobes
    }

    fn split(&self) -> &Split {
        &self.split
    }

    fn eval(&self, incident: LocalDir, outgoing: LocalDir, f: &mut [f64]) {
        if incident.cos() == 0.0 || outgoing.cos() <= 0.0 {
            return f.fill(0.0);
        }
        let side = &self.terms[usize::from(incident.cos() < 0.0)];
        f.iter_mut().zip(side).for_each(|(f, rho)| *f = rho / PI);
    }

    fn separable(&self) -> Option<&dyn Separable> {
        Some(self)
    }

    fn sample(&self, outgoing: LocalDir, u: [f64; 3]) -> Option<Sample> {
        if outgoing.cos() <= 0.0 || self.lobes == Lobes::default() {
            return None;
        }
        let above = cosine_hemisphere([u[0], u[1]]);
        let below = || LocalDir::from_unit(above.vec() * DVec3::new(1.0, 1.0, -1.0));
        let incident = if u[2] < self.through { below() } else { above };
        (incident.cos() != 0.0).then(|| Sample { incident, mirror: false, pdf: self.pdf(incident, outgoing) })
    }

    fn lambertian(&self, outgoing: LocalDir, rho: &mut [f64]) -> f64 {
        if outgoing.cos() <= 0.0 || !self.lobes.diffuse {
            rho.fill(0.0);
            return 0.0;
        }
        rho.copy_from_slice(&self.terms[0]);
        1.0 - self.through
    }

    fn rest(&self, incident: LocalDir, outgoing: LocalDir, f: &mut [f64]) -> f64 {
        if incident.cos() >= 0.0 {
            f.fill(0.0);
            return 0.0;
        }
        self.eval(incident, outgoing, f);
        self.pdf(incident, outgoing)
    }

    fn pdf(&self, incident: LocalDir, outgoing: LocalDir) -> f64 {
        if outgoing.cos() <= 0.0 || self.lobes == Lobes::default() {
            return 0.0;
        }
        let side = if incident.cos() < 0.0 { self.through } else { 1.0 - self.through };
        side * incident.cos().abs() / PI
    }

    fn albedo(&self, incident: LocalDir, rho: &mut [f64]) {
        if incident.cos() <= 0.0 {
            return rho.fill(0.0);
        }
        rho.copy_from_slice(&self.terms[0]);
    }

    fn transmittance(&self, incident: LocalDir, tau: &mut [f64]) {
        if incident.cos() == 0.0 {
            return tau.fill(0.0);
        }
        tau.copy_from_slice(&self.terms[1]);
    }
}
