#![doc = include_str!("rpv.md")]

use std::f64::consts::PI;
use std::sync::Arc;

use sunglint_plugin::{Args, BindError, Default, Model, ModelInfo, Param};
use sunglint_radiometry::{Dimension, LocalDir, SpectralGrid};

use crate::Bsdf;
use crate::composite::{Composite, Energy, Nothing, Part, add_terms};
use crate::spectral::{OnGrid, required, spectrum_within};

const RHO0: Param =
    Param::spectrum("rho0", Dimension::Fraction, Default::Number(0.183), "ρ₀, amplitude").within(0.0, 2.0);
const K: Param =
    Param::spectrum("k", Dimension::Fraction, Default::Number(0.78), "bowl (below 1) or bell (above)").within(0.0, 2.0);
const THETA: Param =
    Param::spectrum("theta", Dimension::Fraction, Default::Number(-0.1), "Θ, asymmetry; negative scatters backwards")
        .within(-0.99, 0.99);
const RHOC: Param =
    Param::spectrum("rhoc", Dimension::Fraction, Default::Absent, "ρ_c, of the hot spot; else ρ₀").within(0.0, 2.0);

/// The model of Rahman, Pinty and Verstraete.
pub const MODEL: Model<dyn Bsdf> = Model {
    info: ModelInfo {
        name: "rpv",
        summary: "bowl shape and hot spot of natural surfaces, four numbers",
        manual: include_str!("rpv.md"),
        params: &[RHO0, K, THETA, RHOC],
    },
    bind,
};

fn bind(args: &Args, grid: &SpectralGrid) -> Result<Arc<dyn Bsdf>, BindError> {
    let of = |param: &Param| spectrum_within(param, required("rpv", args, param.name)?, grid);
    let (rho0, k, theta) = (of(&RHO0)?, of(&K)?, of(&THETA)?);
    let rhoc = match args.spectral("rhoc") {
        Some(value) => spectrum_within(&RHOC, value, grid)?,
        None => rho0.clone(),
    };
    let body = Rpv::new(&rho0, k, theta, &rhoc);
    Ok(Arc::new(Composite::new(body, Nothing, grid.len(), true, Energy::Looked)))
}

struct Rpv {
    k: OnGrid,
    theta: OnGrid,
    /// ρ₀ and ρ₀ (1 − ρ_c).
    amplitudes: [Vec<f64>; 2],
    separable: bool,
}

impl Rpv {
    fn new(rho0: &OnGrid, k: OnGrid, theta: OnGrid, rhoc: &OnGrid) -> Self {
        let hot = rho0.all().iter().zip(rhoc.all()).map(|(rho0, rhoc)| rho0 * (1.0 - rhoc)).collect();
        let separable = k.constant().is_some() && theta.constant().is_some();
        Self { k, theta, amplitudes: [rho0.all().to_vec(), hot], separable }
    }
}

/// What all wavelengths share.
struct Geometry {
    /// μ_i μ_o (μ_i + μ_o)
    bowl: f64,
    /// cos g
    phase: f64,
    /// 1/(1 + G)
    hot_spot: f64,
}

impl Geometry {
    fn of(incident: LocalDir, outgoing: LocalDir) -> Self {
        let (i, o) = (incident.vec(), outgoing.vec());
        // G is the distance of the two directions' tangents in the plane.
        let distance = (i.truncate() / i.z - o.truncate() / o.z).length();
        Self { bowl: i.z * o.z * (i.z + o.z), phase: i.dot(o).clamp(-1.0, 1.0), hot_spot: 1.0 / (1.0 + distance) }
    }

    /// \[μ_i μ_o (μ_i + μ_o)\]^(k−1) (1 − Θ²)/(1 + 2Θ cos g + Θ²)^(3/2)/π
    fn shape(&self, k: f64, theta: f64) -> f64 {
        let lobe = 1.0 + 2.0 * theta * self.phase + theta * theta;
        self.bowl.powf(k - 1.0) * (1.0 - theta * theta) / (lobe * lobe.sqrt()) / PI
    }
}

impl Part for Rpv {
    fn is_present(&self) -> bool {
        self.amplitudes[0].iter().any(|rho0| *rho0 > 0.0)
    }

    fn add(&self, incident: LocalDir, outgoing: LocalDir, f: &mut [f64]) {
        if self.separable {
            return add_terms(self, incident, outgoing, f);
        }
        let geometry = Geometry::of(incident, outgoing);
        for (entry, f) in f.iter_mut().enumerate() {
            let amplitude = self.amplitudes[0][entry] + self.amplitudes[1][entry] * geometry.hot_spot;
            *f += amplitude * geometry.shape(self.k.at(entry), self.theta.at(entry));
        }
    }

    fn terms(&self) -> Option<&[Vec<f64>]> {
        self.separable.then_some(&self.amplitudes)
    }

    fn shapes(&self, incident: LocalDir, outgoing: LocalDir, shapes: &mut [f64]) {
        let geometry = Geometry::of(incident, outgoing);
        shapes[0] = geometry.shape(self.k.at(0), self.theta.at(0));
        shapes[1] = shapes[0] * geometry.hot_spot;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn model(rho0: f64, k: f64, theta: f64, rhoc: f64) -> Composite<Rpv, Nothing> {
        let [rho0, k, theta, rhoc] = [rho0, k, theta, rhoc].map(|value| OnGrid::new(vec![value]));
        Composite::new(Rpv::new(&rho0, k, theta, &rhoc), Nothing, 1, true, Energy::Looked)
    }

    /// Published check values for ρ₀ = 0.1, k = 0.8, Θ = −0.1 at 0, 30, 60 and 80°, three digits.
    #[test]
    fn the_albedo_is_that_of_independent_sums() {
        for (degree, rho) in [0.0_f64, 30.0, 60.0, 80.0].into_iter().zip([0.175, 0.175, 0.180, 0.195]) {
            let mut found = [0.0];
            let incident = LocalDir::from_polar(degree.to_radians(), 0.0);
            model(0.1, 0.8, -0.1, 0.1).albedo(incident, &mut found);
            assert!((found[0] - rho).abs() < 6e-4, "{degree}: {}", found[0]);
        }
    }

    /// k = 1, Θ = 0 and ρ_c = 1 leave Lambert's law; the hot spot is where view and light coincide.
    #[test]
    fn its_limits_are_lambert_and_a_hot_spot() {
        let (i, o) = (LocalDir::from_polar(0.8, 0.3), LocalDir::from_polar(1.2, 2.0));
        let at = |model: &dyn Bsdf, o| {
            let mut f = [0.0];
            model.eval(i, o, &mut f);
            f[0]
        };
        assert!((at(&model(0.3, 1.0, 0.0, 1.0), o) * PI - 0.3).abs() < 1e-15);
        let hot = model(0.3, 1.0, 0.0, 0.2);
        assert!((at(&hot, i) * PI - 0.3 * 1.8).abs() < 1e-12);
        assert!(at(&hot, LocalDir::from_polar(0.8, 0.35)) < at(&hot, i));
    }
}
