//! Surface scattering models behind one trait, one model a file, and the conformance suite that every model passes.
//!
//! Directions are local (z along the normal) and point away from the surface, both of them. The BSDF `f` \[sr⁻¹\] is
//! without the cosine: dL = f L_i cos θ_i dω_i.

mod aperture;
mod blinn_phong;
mod category;
mod composite;
pub mod conformance;
mod cook_torrance;
mod facet_lobe;
mod fresnel;
mod ggx;
mod goniometer;
mod grazing;
mod hapke;
mod he_torrance;
mod ideal;
mod interpolation;
mod leaf;
mod maxwell_beard;
mod measured;
mod microfacet;
mod mix;
mod model_fit;
mod oren_nayar;
mod phong;
mod quadrature;
mod ross_li;
mod rough_conductor;
mod rpv;
mod sampling;
mod scaled_lobe;
mod scans;
mod shipped;
mod spectral;
mod split;
mod split_fit;
mod split_model;
mod top_hat;
mod torrance_sparrow;
mod total_diffuse;
mod two_component;
mod view_table;
mod ward;

pub use category::Category;
pub use fresnel::{fresnel_conductor, fresnel_dielectric};
pub use goniometer::{Goniometer, GoniometerBand, ReadingNoise};
pub use grazing::{Excess, Grazing};
pub use interpolation::Interpolation;
pub use model_fit::{
    BandModelFit, FitOptions, FittedParameter, ModelFit, ModelFitError, fit_model, fits_metals, fitted_models,
};
pub use scans::{Gaps, Measurement, Place, Reading, Report, SAME_ANGLE, ScanBand, ScanFault, ScanFaults, Scans};
pub use shipped::{shipped, shipped_materials, shipped_names};
pub use split::{AngularSpectra, Split};
pub use split_fit::{
    BandSplit, DiffuseNode, Noise, SpecularColumn, SpecularNode, SplitFit, SplitOptions, SplitRow, Support, fit_split,
};
pub use top_hat::{SOLAR_DISK, TopHat};

use sunglint_plugin::Model;
use sunglint_radiometry::LocalDir;

/// The models of this build. Adding one: write the file, add the line, run the tests.
pub const BUILTIN: &[Model<dyn Bsdf>] = &[
    ideal::MODEL,
    split_model::MODEL,
    total_diffuse::MODEL,
    phong::MODEL,
    blinn_phong::MODEL,
    torrance_sparrow::MODEL,
    cook_torrance::MODEL,
    he_torrance::MODEL,
    maxwell_beard::MODEL,
    ward::MODEL,
    ggx::MODEL,
    rough_conductor::MODEL,
    oren_nayar::MODEL,
    rpv::MODEL,
    ross_li::MODEL,
    hapke::MODEL,
    measured::MODEL,
    leaf::MODEL,
    mix::MODEL,
];

/// Which lobes a model has, so that no ray is cast for a lobe that is absent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Lobes {
    /// Reflects into the whole hemisphere smoothly.
    pub diffuse: bool,
    /// A Dirac lobe about the mirror direction.
    pub mirror: bool,
    /// A lobe of finite width.
    pub glossy: bool,
    /// Light passes through.
    pub transmission: bool,
}

/// What a model claims of itself; the conformance suite holds it to its word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Claims {
    /// f(ω_i, ω_o) = f(ω_o, ω_i).
    pub reciprocal: bool,
    /// Directional-hemispherical reflectance ≤ 1 at every angle.
    pub conserves_energy: bool,
}

/// A sampled incident direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Towards where the light comes from.
    pub incident: LocalDir,
    /// Drawn from the Dirac lobe: its weight is [`Bsdf::mirror`] over the probability `pdf`, and it has no density.
    pub mirror: bool,
    /// Density \[sr⁻¹\] of the smooth lobes at `incident`, or the probability with which the mirror lobe was chosen.
    pub pdf: f64,
}

/// The separable form f(ω_i, ω_o, λ) = Σ_j c_j(λ) s_j(ω_i, ω_o) of a model's smooth lobes: geometry is then shared by all
/// wavelengths and times.
pub trait Separable {
    /// c_j(λ): one spectrum a term, one value a grid entry.
    fn coefficients(&self) -> &[Vec<f64>];

    /// Fills `shapes` with s_j(ω_i, ω_o), one value a term; c_j s_j is in sr⁻¹. 0 below the surface.
    fn shapes(&self, incident: LocalDir, outgoing: LocalDir, shapes: &mut [f64]);
}

/// A surface scattering model, bound to one spectral grid: it answers for all grid entries at once into slices that
/// the caller owns, and allocates nothing per hit.
pub trait Bsdf: Send + Sync {
    /// The lobes that exist.
    fn lobes(&self) -> Lobes;

    /// What the model claims of itself.
    fn claims(&self) -> Claims {
        Claims { reciprocal: true, conserves_energy: true }
    }

    /// The components R_d(θ_v), ρ_s(θ_v), Ω_s of the published algorithms, on nodes of view angle.
    fn split(&self) -> &Split;

    /// Fills `f` with the BSDF \[sr⁻¹\] of the smooth lobes at each grid entry. No cosine factor. The viewer's side is up: f
    /// is 0 where `outgoing` is below the surface, and where `incident` is, unless light passes through.
    fn eval(&self, incident: LocalDir, outgoing: LocalDir, f: &mut [f64]);

    /// The separable form of what [`eval`](Self::eval) gives, where the model has one.
    fn separable(&self) -> Option<&dyn Separable> {
        None
    }

    /// Fills `rho` with the reflectance of the Dirac lobe seen along `outgoing` at each grid entry.
    fn mirror(&self, outgoing: LocalDir, rho: &mut [f64]) {
        let _ = outgoing;
        rho.fill(0.0);
    }

    /// Draws an incident direction with two numbers of \[0, 1) and a third that chooses the lobe; `None` where the
    /// draw falls below the surface.
    fn sample(&self, outgoing: LocalDir, u: [f64; 3]) -> Option<Sample>;

    /// Probability with which `sample` gives the mirror direction as such.
    fn mirror_probability(&self, outgoing: LocalDir) -> f64 {
        let _ = outgoing;
        0.0
    }

    /// The part of f that does not depend on where light comes from: fills `rho` with its reflectance seen along `outgoing`, so
    /// that f = ρ/π + the rest for light from above. `sample` draws from it, cosine-weighted, where its third number is no
    /// less than 1 − p; p is returned, 0 where a model has no such part.
    fn lambertian(&self, outgoing: LocalDir, rho: &mut [f64]) -> f64 {
        let _ = outgoing;
        rho.fill(0.0);
        0.0
    }

    /// What [`eval`](Self::eval) fills `f` with, less the Lambertian part, and the density of [`pdf`](Self::pdf) less that of its
    /// draws. A model that has such a part says this too.
    fn rest(&self, incident: LocalDir, outgoing: LocalDir, f: &mut [f64]) -> f64 {
        self.eval(incident, outgoing, f);
        self.pdf(incident, outgoing)
    }

    /// Whether nothing but the Lambertian part scatters light along `incident`; `false` where that takes an `eval` to tell.
    fn is_lambertian_at(&self, incident: LocalDir, outgoing: LocalDir) -> bool {
        let _ = (incident, outgoing);
        false
    }

    /// Density of `sample` \[sr⁻¹\] over the smooth lobes.
    fn pdf(&self, incident: LocalDir, outgoing: LocalDir) -> f64;

    /// Fills `rho` with the directional-hemispherical reflectance for light along `incident` (equal to the
    /// hemispherical-directional one where the model is reciprocal), all lobes.
    fn albedo(&self, incident: LocalDir, rho: &mut [f64]);

    /// Fills `tau` with the directional-hemispherical transmittance for light along `incident`, from either side.
    fn transmittance(&self, incident: LocalDir, tau: &mut [f64]) {
        let _ = incident;
        tau.fill(0.0);
    }
}
