#![doc = include_str!("maxwell_beard.md")]

use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::Arc;

use sunglint_plugin::{Args, BindError, Column, Default, Model, ModelInfo, Param};
use sunglint_radiometry::{Dimension, LocalDir, SpectralGrid};

use crate::composite::{Composite, Energy, Gloss, Part};
use crate::fresnel::Interface;
use crate::microfacet::{Half, normal, reflected, trowbridge_reitz};
use crate::sampling::pick;
use crate::spectral::{OnGrid, required, spectrum_within};
use crate::view_table::{on_grid, profiles};
use crate::{AngularSpectra, Bsdf};

const SCAN: &[Column] = &[
    Column { name: "zenith", dimension: Dimension::Angle, range: (0.0, FRAC_PI_2) },
    Column { name: "like", dimension: Dimension::Fraction, range: (0.0, f64::INFINITY) },
    Column { name: "cross", dimension: Dimension::Fraction, range: (0.0, f64::INFINITY) },
];

const BIAS: Param =
    Param::spectrum("bias", Dimension::Fraction, Default::Absent, "B of the facets' law").within(0.0, 1e6);
const SIGMA: Param =
    Param::spectrum("sigma", Dimension::Fraction, Default::Absent, "σ of the facets' law").within(1e-4, 10.0);
const RHO_D: Param =
    Param::spectrum("rho_d", Dimension::Fraction, Default::Absent, "ρ_D, Lambertian volume BRDF [sr⁻¹]")
        .within(0.0, 1.0);
const RHO_V: Param =
    Param::spectrum("rho_v", Dimension::Fraction, Default::Number(0.0), "ρ_V, directional volume BRDF [sr⁻¹]")
        .within(0.0, 1.0);
const TAU: Param =
    Param::spectrum("tau", Dimension::Angle, Default::Number(0.25), "τ, shadowing's fall with the bistatic angle")
        .within(1e-3, 100.0);
const OMEGA: Param =
    Param::spectrum("omega", Dimension::Angle, Default::Number(0.70), "Ω, shadowing's fall with the facet's angle")
        .within(1e-3, 100.0);

/// The model of Maxwell and Beard (ERIM), as NEFDS carries it on.
pub const MODEL: Model<dyn Bsdf> = Model {
    info: ModelInfo {
        name: "maxwell_beard",
        summary: "paints as ERIM measured them: facets from a zero-bistatic scan or NEF parameters, and two volumes",
        manual: include_str!("maxwell_beard.md"),
        params: &[
            Interface::N,
            Interface::K,
            Param::table("scan", SCAN, Default::Absent, "zero-bistatic BRDF, like and cross polarised [sr⁻¹]")
                .excludes(&["bias", "sigma"]),
            BIAS.excludes(&["scan"]),
            SIGMA.excludes(&["scan"]),
            RHO_D,
            RHO_V,
            TAU,
            OMEGA,
            Param::switch("azimuth", false, "shadowing's second factor, with the facet's azimuth"),
        ],
    },
    bind,
};

fn bind(args: &Args, grid: &SpectralGrid) -> Result<Arc<dyn Bsdf>, BindError> {
    let name = "maxwell_beard";
    let n = grid.len();
    let interface = Interface::bind(name, args, grid)?;
    let optional = |param: &Param| args.spectral(param.name).map(|v| spectrum_within(param, v, grid)).transpose();
    let (facets, cross) = match (args.table("scan"), optional(&BIAS)?, optional(&SIGMA)?) {
        (Some(_), None, None) => {
            let (first_surface, cross) = scanned(args, grid)?;
            (Law::Scan(first_surface), Some(cross))
        }
        (Some(_), ..) => return Err(BindError::of_block("S05", "`scan` and `bias`, `sigma` exclude each other")),
        (None, Some(bias), Some(sigma)) => (Law::Cauchy { bias, sigma }, None),
        (None, ..) => {
            return Err(BindError::of_block("S05", "`maxwell_beard` needs a `scan`, or `bias` and `sigma`")
                .help("NEF parameters: `bias 0.06, sigma 0.1, rho_d 0.02, tau 15 deg, omega 40 deg`"));
        }
    };
    let rho_d = match (optional(&RHO_D)?, cross) {
        (Some(rho_d), _) => rho_d,
        // Twice the cross-polarised value at nadir: a depolarised volume returns as much in the polarisation not seen.
        (None, Some(cross)) => OnGrid::new(cross.spectrum(0).iter().map(|cross| 2.0 * cross).collect()),
        (None, None) => OnGrid::new(vec![0.0; n]),
    };
    let rho_v = spectrum_within(&RHO_V, required(name, args, "rho_v")?, grid)?;
    for entry in 0..n {
        let sum = PI * rho_d.at(entry) + 4.0 * PI * rho_v.at(entry);
        if sum > 1.0 + 1e-9 {
            let message = format!("the volume returns more than it gets: π ρ_D + 4π ρ_V is {sum:.4}");
            return Err(BindError::of_block("M05", message).help("ρ_D and ρ_V are BRDFs in sr⁻¹, not reflectances"));
        }
    }
    let tau = spectrum_within(&TAU, required(name, args, "tau")?, grid)?;
    let omega = spectrum_within(&OMEGA, required(name, args, "omega")?, grid)?;
    let azimuth = args.switch("azimuth") == Some(true);
    let surface = FirstSurface::new(interface, facets, tau, omega, azimuth, n);
    let volume = Volume { terms: [rho_d.all().to_vec(), rho_v.all().to_vec()] };
    Ok(Arc::new(Composite::new(volume, surface, n, !azimuth, Energy::Looked)))
}

/// First-surface and cross-polarised values of a scan on the grid, at the scan's angles.
fn scanned(args: &Args, grid: &SpectralGrid) -> Result<(AngularSpectra, AngularSpectra), BindError> {
    let table = args.table("scan").ok_or_else(|| BindError::of_block("S05", "`maxwell_beard` needs a `scan`"))?;
    let mut profiles = profiles("scan", table, SCAN.len())?;
    for profile in &mut profiles {
        let of = profile.of.clone();
        for (theta, values) in &mut profile.rows {
            let degrees = crate::view_table::degrees(*theta);
            let (like, cross) = (values[0], values[1]);
            if like < 0.0 || cross < 0.0 {
                let message = format!("a BRDF is not negative; at {degrees} deg{of} it is {}", like.min(cross));
                return Err(BindError::new("M05", "scan", message));
            }
            if cross > like {
                let message = format!("more is depolarised than returned at {degrees} deg{of}: {cross} of {like}");
                return Err(BindError::new("M05", "scan", message).help("are `like` and `cross` exchanged?"));
            }
            values[0] = like - cross;
        }
        // Down to 0° the first row holds; towards 90° facets die out.
        if let Some((first, values)) = profile.rows.first().cloned()
            && first > 0.0
        {
            profile.rows.insert(0, (0.0, values));
        }
        if profile.rows.last().is_some_and(|row| row.0 < FRAC_PI_2) {
            profile.rows.push((FRAC_PI_2, vec![0.0, 0.0]));
        }
    }
    Ok((on_grid("scan", &profiles, 0, grid)?, on_grid("scan", &profiles, 1, grid)?))
}

/// f_vol = ρ_D + 2 ρ_V/(cos θ_i + cos θ_o).
struct Volume {
    terms: [Vec<f64>; 2],
}

impl Part for Volume {
    fn is_present(&self) -> bool {
        self.terms.iter().flatten().any(|rho| *rho > 0.0)
    }
    fn add(&self, incident: LocalDir, outgoing: LocalDir, f: &mut [f64]) {
        crate::composite::add_terms(self, incident, outgoing, f);
    }
    fn terms(&self) -> Option<&[Vec<f64>]> {
        Some(&self.terms)
    }
    fn shapes(&self, incident: LocalDir, outgoing: LocalDir, shapes: &mut [f64]) {
        shapes[0] = 1.0;
        shapes[1] = 2.0 / (incident.cos() + outgoing.cos());
    }
}

/// How many facets lie how.
enum Law {
    /// f_zb(θ) of a scan \[sr⁻¹\].
    Scan(AngularSpectra),
    /// p = B/[cos θ_h (σ² + tan² θ_h)]
    Cauchy { bias: OnGrid, sigma: OnGrid },
}

struct FirstSurface {
    interface: Interface,
    law: Law,
    /// F(0) per entry.
    f_0: Vec<f64>,
    tau: OnGrid,
    omega: OnGrid,
    azimuth: bool,
    /// Slope of the lobe per entry, and those that draws are made with.
    slope: OnGrid,
    drawn: Vec<f64>,
}

impl FirstSurface {
    fn new(interface: Interface, law: Law, tau: OnGrid, omega: OnGrid, azimuth: bool, n: usize) -> Self {
        let f_0 = (0..n).map(|entry| interface.at(entry, 1.0).max(f64::MIN_POSITIVE)).collect();
        let slopes = match &law {
            Law::Cauchy { sigma, .. } => sigma.all().to_vec(),
            Law::Scan(scan) => {
                let weighted = |theta: f64, entry: usize| scan.at(theta, entry) * theta.cos().powi(2);
                let steps = || (1..450).map(|i| (0.2 * f64::from(i)).to_radians());
                // The tangent at which f_zb cos² falls to half of its largest value.
                let half = |entry: usize| {
                    let most = steps().map(|t| weighted(t, entry)).fold(weighted(0.0, entry), f64::max);
                    let falls = |t: &f64| weighted(*t, entry) < 0.5 * most && most > 0.0;
                    steps().find(falls).map_or(1.0, f64::tan)
                };
                (0..n).map(half).collect()
            }
        };
        let slope = OnGrid::new(slopes.into_iter().map(|slope| slope.clamp(1e-3, 2.0)).collect());
        let drawn = slope.representatives();
        Self { interface, law, f_0, tau, omega, azimuth, slope, drawn }
    }

    /// SO [Maxwell1973; Shell2005, eq. 4.23]: {[1 + (θ_h/Ω) e^(−2b/τ)]/(1 + θ_h/Ω)}, and with `azimuth` times
    /// 1/[1 + (φ_n/Ω)(θ_i/Ω)], φ_n the facet's azimuth from the plane of incidence, 0..π/2.
    fn obscuration(&self, entry: usize, geometry: &Geometry) -> f64 {
        let (tau, omega) = (self.tau.at(entry), self.omega.at(entry));
        let ratio = geometry.theta_h / omega;
        let first = (1.0 + ratio * (-2.0 * geometry.b / tau).exp()) / (1.0 + ratio);
        first / (1.0 + geometry.phi_n / omega * (geometry.theta_i / omega))
    }
}

struct Geometry {
    half: Half,
    theta_h: f64,
    b: f64,
    theta_i: f64,
    phi_n: f64,
}

impl FirstSurface {
    fn geometry(&self, incident: LocalDir, outgoing: LocalDir) -> Geometry {
        let half = Half::of(incident, outgoing);
        let apart = 0.5 * (incident.vec() - outgoing.vec()).length();
        let phi_n = match self.azimuth {
            true => {
                let (h, i) = ((incident.vec() + outgoing.vec()).truncate(), incident.vec().truncate());
                h.perp_dot(i).abs().atan2(h.dot(i).abs())
            }
            false => 0.0,
        };
        Geometry {
            theta_h: half.tan_squared.sqrt().atan(),
            // sin b = |ω_i − ω_o|/2
            b: apart.min(1.0).asin(),
            theta_i: incident.theta(),
            phi_n,
            half,
        }
    }
}

impl Part for FirstSurface {
    fn is_present(&self) -> bool {
        match &self.law {
            Law::Scan(scan) => !scan.is_zero(),
            Law::Cauchy { bias, .. } => bias.range().1 > 0.0,
        }
    }

    /// [F(b)/F(0)] f_zb(θ_h) cos² θ_h SO/(cos θ_i cos θ_o), or F(b) p(θ_h) SO/(4 cos θ_i cos θ_o).
    fn add(&self, incident: LocalDir, outgoing: LocalDir, f: &mut [f64]) {
        let geometry = self.geometry(incident, outgoing);
        let cosines = incident.cos() * outgoing.cos();
        let nodes = match &self.law {
            Law::Scan(scan) => scan.weights(geometry.theta_h),
            Law::Cauchy { .. } => [(0, 0.0); 2],
        };
        let (cos, tan_squared) = (geometry.half.cos, geometry.half.tan_squared);
        self.interface.each(f.len(), geometry.half.cos_b, |entry, fresnel| {
            let facets = match &self.law {
                Law::Scan(scan) => {
                    let f_zb: f64 = nodes.iter().map(|(node, weight)| weight * scan.spectrum(*node)[entry]).sum();
                    f_zb * cos * cos / self.f_0[entry]
                }
                Law::Cauchy { bias, sigma } => 0.25 * bias.at(entry) / (cos * (sigma.at(entry).powi(2) + tan_squared)),
            };
            f[entry] += fresnel * facets * self.obscuration(entry, &geometry) / cosines;
        });
    }
}

impl Gloss for FirstSurface {
    /// Half vectors of a long-tailed distribution as wide as the facets'.
    fn draw(&self, outgoing: LocalDir, u: [f64; 2]) -> Option<LocalDir> {
        let (chosen, u1) = pick(self.drawn.len(), u[1]);
        let slope = self.drawn[chosen];
        reflected(normal(slope * slope * u[0] / (1.0 - u[0]), u1), outgoing)
    }

    fn drawn_with(&self, incident: LocalDir, outgoing: LocalDir) -> f64 {
        let half = Half::of(incident, outgoing);
        let of = |slope: &f64| trowbridge_reitz(*slope, &half) * half.cos / (4.0 * half.cos_b);
        self.drawn.iter().map(of).sum::<f64>() / self.drawn.len() as f64
    }

    fn slope(&self, entry: usize) -> f64 {
        self.slope.at(entry)
    }

    fn corners(&self) -> &[f64] {
        match &self.law {
            Law::Scan(scan) => scan.angles(),
            Law::Cauchy { .. } => &[],
        }
    }

    fn covers(&self) -> bool {
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn surface(law: Law) -> FirstSurface {
        let interface = Interface::of(vec![1.5], vec![0.0]);
        FirstSurface::new(interface, law, OnGrid::new(vec![0.3]), OnGrid::new(vec![0.7]), false, 1)
    }

    /// Light and view together give back the scan: SO = 1 and F = F(0) there.
    #[test]
    fn the_zero_bistatic_scan_comes_back() {
        let angles = [0.0, 0.3, 0.8, FRAC_PI_2];
        let values = [0.5, 0.2, 0.03, 0.0];
        let scan = AngularSpectra::new(angles.to_vec(), values.iter().map(|v| vec![*v]).collect());
        let surface = surface(Law::Scan(scan));
        for (theta, value) in [(0.0, 0.5), (0.3, 0.2), (0.8, 0.03), (0.15, 0.35)] {
            let direction = LocalDir::from_polar(theta, 1.0);
            let mut f = [0.0];
            surface.add(direction, direction, &mut f);
            assert!((f[0] - value).abs() < 1e-12, "{theta}: {}", f[0]);
        }
    }

    /// NEF: at zero bistatic F(0) p(θ)/(4 cos² θ).
    #[test]
    fn nef_parameters_give_their_law() {
        let (bias, sigma) = (OnGrid::new(vec![0.6]), OnGrid::new(vec![0.15]));
        let surface = surface(Law::Cauchy { bias, sigma });
        let theta = 0.4_f64;
        let direction = LocalDir::from_polar(theta, 0.0);
        let mut f = [0.0];
        surface.add(direction, direction, &mut f);
        let p = 0.6 / (theta.cos() * (0.15 * 0.15 + theta.tan().powi(2)));
        assert!((f[0] - 0.04 * p / (4.0 * theta.cos().powi(2))).abs() < 1e-13);
    }
}
