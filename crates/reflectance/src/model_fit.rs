//! Models fitted to a goniometer's scans by non-linear least squares, band by band.
//!
//! ```text
//! χ² = Σ [(BRF_model − BRF)/σ]²      BRF_model = π ∫_Ω f cos θ_o dω / ∫_Ω cos θ_o dω over the aperture
//! ```
//!
//! σ is the standard error that the scans state and a thousandth of the band's largest value in quadrature, for no
//! instrument knows its zero better; where they state none, errors are taken to be in proportion to the value (of at least
//! a hundredth of the largest), and their size follows from the fit, σ² = χ²/(n − p). χ² is made least by Levenberg's and
//! Marquardt's method with bounds [More1978; Markwardt2009, MPFIT], from several starts, each first with σ of at least a
//! twentieth of the largest value, which brings the lobe into place; parameters that span decades vary by their logarithm.

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::sync::Arc;
use std::time::Instant;

use rmpfit::{MPError, MPFitter, MPPar, MPResult, MPSuccess};
use sunglint_plugin::{Args, SpectralValue, Value};
use sunglint_radiometry::{Frame, LocalDir, SpectralGrid};

use crate::{BUILTIN, Bsdf, Reading, ScanBand, Scans};

/// A parameter of a model that can be fitted.
#[derive(Clone, Copy)]
struct Free {
    name: &'static str,
    /// Where the search begins; `NAN` is the median of the readings.
    starts: &'static [f64],
    low: f64,
    high: f64,
    /// Varied by its logarithm.
    log: bool,
    /// Free unless it is fixed by name; else fixed at its first start unless it is freed.
    free: bool,
    /// Smallest value and starts where k is freed.
    of_metal: Option<(f64, &'static [f64])>,
}

impl Free {
    const fn new(name: &'static str, starts: &'static [f64], low: f64, high: f64) -> Self {
        Self { name, starts, low, high, log: false, free: true, of_metal: None }
    }
    /// As it is searched for in a metal, or in what does not absorb.
    fn over(mut self, metal: bool) -> Self {
        if let (true, Some((low, starts))) = (metal, self.of_metal) {
            (self.low, self.starts) = (low, starts);
        }
        self
    }
    const fn log(mut self) -> Self {
        self.log = true;
        self
    }
    const fn fixed(mut self) -> Self {
        self.free = false;
        self
    }
    const fn of_metal(mut self, low: f64, starts: &'static [f64]) -> Self {
        self.of_metal = Some((low, starts));
        self
    }
}

const MEDIAN: &[f64] = &[f64::NAN];
const DIFFUSE: Free = Free::new("diffuse", MEDIAN, 0.0, 1.0);
const SPECULAR: Free = Free::new("specular", &[0.1], 0.0, 1.0);
const N: Free = Free::new("n", &[1.5, 2.5], 1.02, 10.0).of_metal(0.05, &[1.0]);
const N_HELD: Free = Free::new("n", &[1.5], 1.02, 10.0).of_metal(0.05, &[1.0]).fixed();
const K: Free = Free::new("k", &[0.0], 0.0, 12.0).of_metal(0.0, &[1.0, 6.0]).fixed();
const ROUGHNESS: Free = Free::new("roughness", &[0.1, 0.4], 0.005, 1.5).log();

/// What is fitted of which model.
const FITS: &[(&str, &[Free])] = &[
    ("ideal", &[DIFFUSE]),
    ("phong", &[DIFFUSE, SPECULAR, Free::new("exponent", &[10.0, 200.0], 0.1, 1e6).log()]),
    ("blinn_phong", &[DIFFUSE, SPECULAR, Free::new("exponent", &[40.0, 800.0], 0.1, 1e6).log()]),
    ("torrance_sparrow", &[DIFFUSE, Free::new("specular", &[1.0], 0.0, 1.0), ROUGHNESS, N_HELD, K]),
    ("cook_torrance", &[DIFFUSE, Free::new("specular", &[0.5], 0.0, 1.0), ROUGHNESS, N_HELD, K]),
    (
        "he_torrance",
        &[
            DIFFUSE,
            Free::new("height", &[0.1, 1.0], 1e-3, 50.0).log(),
            Free::new("correlation", &[3.0], 0.1, 500.0).log(),
            N,
            K,
        ],
    ),
    (
        "maxwell_beard",
        &[
            Free::new("bias", &[0.1], 0.0, 100.0),
            Free::new("sigma", &[0.05, 0.3], 0.005, 3.0).log(),
            Free::new("rho_d", MEDIAN, 0.0, 0.2),
            Free::new("rho_v", &[0.005], 0.0, 0.029),
            Free::new("tau", &[0.3], 0.01, 5.0).log().fixed(),
            Free::new("omega", &[0.7], 0.05, 10.0).log().fixed(),
            N_HELD,
            K,
        ],
    ),
    ("ward", &[DIFFUSE, SPECULAR, ROUGHNESS]),
    ("ggx", &[DIFFUSE, ROUGHNESS, N, K]),
    ("rough_conductor", &[DIFFUSE, ROUGHNESS, N, K]),
    ("oren_nayar", &[DIFFUSE, Free::new("roughness", &[0.3], 0.0, 1.4)]),
    (
        "rpv",
        &[
            Free::new("rho0", MEDIAN, 0.0, 2.0),
            Free::new("k", &[0.9], 0.0, 2.0),
            Free::new("theta", &[0.0], -0.98, 0.98),
            Free::new("rhoc", &[0.5], 0.0, 2.0).fixed(),
        ],
    ),
    (
        "ross_li",
        &[Free::new("iso", MEDIAN, 0.0, 2.0), Free::new("vol", &[0.05], 0.0, 2.0), Free::new("geo", &[0.02], 0.0, 2.0)],
    ),
    (
        "hapke",
        &[
            Free::new("w", &[0.3, 0.8], 0.0, 1.0),
            Free::new("b", &[0.3], 0.0, 0.98),
            Free::new("c", &[0.5], 0.0, 1.0),
            Free::new("b0", &[0.0], 0.0, 3.0).fixed(),
            Free::new("h", &[0.06], 1e-3, 10.0).log().fixed(),
            Free::new("roughness", &[0.0], 0.0, 0.78).fixed(),
        ],
    ),
];

/// Names of the models that can be fitted.
pub fn fitted_models() -> impl Iterator<Item = &'static str> {
    FITS.iter().map(|(name, _)| *name)
}

/// Whether a model can be fitted as one of a metal: with k free.
pub fn fits_metals(model: &str) -> bool {
    let of_metal = |params: &[Free]| params.iter().any(|param| param.name == "k");
    FITS.iter().any(|(name, params)| *name == model && of_metal(params))
}

/// Which parameters vary.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FitOptions {
    /// Parameters held at a value, in canonical units.
    pub fixed: Vec<(String, f64)>,
    /// Parameters that vary although they are held by default.
    pub free: Vec<String>,
}

/// Why a model was not fitted.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ModelFitError {
    /// Not one of [`fitted_models`].
    #[error("`{0}` cannot be fitted to scans")]
    Unknown(String),
    /// A parameter that the model does not have, or cannot be fitted.
    #[error("`{model}` has no parameter `{name}` that could be fitted; it has {known}")]
    Parameter {
        /// The model.
        model: &'static str,
        /// What was asked for.
        name: String,
        /// What there is.
        known: String,
    },
    /// A fixed value that the model refuses.
    #[error("`{name}` of `{model}` lies between {low} and {high}, not at {value}")]
    Range {
        /// The model.
        model: &'static str,
        /// The parameter.
        name: String,
        /// Smallest value.
        low: f64,
        /// Largest value.
        high: f64,
        /// What was asked for.
        value: f64,
    },
    /// Fewer readings than parameters, or just as many.
    #[error("{readings} readings{of} do not determine {parameters} parameters of `{model}`")]
    Undetermined {
        /// The model.
        model: &'static str,
        /// Of which band.
        of: String,
        /// Readings.
        readings: usize,
        /// Free parameters.
        parameters: usize,
    },
    /// The model depends on wavelength, and the scans do not say it.
    #[error("`{0}` depends on wavelength: the scans need a column wavelength_nm")]
    Wavelength(&'static str),
    /// The search failed from every start.
    #[error("no start of `{model}` leads to a fit{of}")]
    NoFit {
        /// The model.
        model: &'static str,
        /// Of which band.
        of: String,
    },
}

/// A parameter as fitted.
#[derive(Clone, Debug, PartialEq)]
pub struct FittedParameter {
    /// Its name in the model's block.
    pub name: &'static str,
    /// Its value, canonical unit.
    pub value: f64,
    /// Its standard error; `None` where it was held, or came to lie on a bound.
    pub error: Option<f64>,
    /// Held at its value.
    pub fixed: bool,
    /// On one of its bounds.
    pub at_bound: bool,
}

/// A model fitted to one band.
#[derive(Clone)]
pub struct BandModelFit {
    /// The band.
    pub band: ScanBand,
    /// All parameters, those held too.
    pub parameters: Vec<FittedParameter>,
    /// Covariance of the parameters, in their order; 0 for those held or on a bound.
    pub covariance: Vec<Vec<f64>>,
    /// Σ [(BRF_model − BRF)/σ]²; with σ unknown, relative to the assumed one.
    pub chi_square: f64,
    /// Readings less free parameters.
    pub degrees_of_freedom: usize,
    /// Whether the scans state the errors of their values.
    pub errors_stated: bool,
    /// Root mean square of BRF_model − BRF.
    pub rms: f64,
    /// The same over the mean BRF.
    pub relative_rms: f64,
    /// Readings, each with the model's value.
    pub readings: Vec<(Reading, f64)>,
    /// The fitted model, bound to the band's wavelength.
    pub bsdf: Arc<dyn Bsdf>,
}

impl BandModelFit {
    /// √(χ²/n): what the fit made least, in units of σ.
    pub fn weighted_rms(&self) -> f64 {
        (self.chi_square / self.readings.len().max(1) as f64).sqrt()
    }

    /// BRF of the fitted model in the plane, for light at `illumination` seen at a signed `view` angle \[rad\].
    pub fn brf_at(&self, illumination: f64, view: f64) -> f64 {
        let mut f = [0.0; 1];
        let outgoing = LocalDir::from_polar(view.abs(), if view < 0.0 { PI } else { 0.0 });
        self.bsdf.eval(LocalDir::from_polar(illumination, 0.0), outgoing, &mut f);
        PI * f[0]
    }

    /// The reading that the model misses by most, and its value there.
    pub fn worst(&self) -> Option<(Reading, f64)> {
        let off = |(reading, model): &(Reading, f64)| (reading.brf - model).abs();
        self.readings.iter().copied().max_by(|a, b| off(a).total_cmp(&off(b)))
    }
}

/// A model fitted to all bands of scans.
#[derive(Clone)]
pub struct ModelFit {
    /// The model.
    pub model: &'static str,
    /// One for each band.
    pub bands: Vec<BandModelFit>,
    /// Free parameters of a band.
    pub n_free: usize,
}

impl ModelFit {
    /// Root mean square over all bands of what the fit made least, in units of σ.
    pub fn weighted_rms(&self) -> f64 {
        let (sum, n) =
            (self.bands.iter()).fold((0.0, 0), |(sum, n), band| (sum + band.chi_square, n + band.readings.len()));
        (sum / n.max(1) as f64).sqrt()
    }

    /// Root mean square difference in BRF over all bands.
    pub fn rms(&self) -> f64 {
        let of = |band: &BandModelFit| band.rms * band.rms * band.readings.len() as f64;
        let n: usize = self.bands.iter().map(|band| band.readings.len()).sum();
        (self.bands.iter().map(of).sum::<f64>() / n.max(1) as f64).sqrt()
    }

    /// Time to evaluate f for one pair of directions and one wavelength \[ns\], as this machine has it now.
    pub fn evaluation_ns(&self) -> f64 {
        let Some(band) = self.bands.first() else { return f64::NAN };
        let directions: Vec<LocalDir> =
            (0..64).map(|k| LocalDir::from_polar(1.3 * f64::from(k) / 64.0, 2.4 * f64::from(k))).collect();
        let mut f = [0.0; 1];
        let mut best = f64::INFINITY;
        for _ in 0..5 {
            let start = Instant::now();
            for incident in &directions {
                for outgoing in &directions {
                    band.bsdf.eval(*incident, *outgoing, &mut f);
                    std::hint::black_box(&f);
                }
            }
            best = best.min(start.elapsed().as_secs_f64());
        }
        best * 1e9 / (64.0 * 64.0)
    }

    /// The block of a scene that says it, with a value for each band where they differ.
    pub fn in_a_scene(&self) -> String {
        let info = BUILTIN.iter().find(|model| model.info.name == self.model).map(|model| &model.info);
        let Some(first) = self.bands.first() else { return self.model.to_string() };
        let params: Vec<String> = (first.parameters.iter().enumerate())
            .map(|(i, parameter)| {
                let unit = match info.and_then(|info| info.param(parameter.name)).map(|param| param.kind) {
                    Some(sunglint_plugin::Kind::Spectrum(sunglint_radiometry::Dimension::Angle)) => " rad",
                    Some(sunglint_plugin::Kind::Spectrum(sunglint_radiometry::Dimension::Wavelength)) => " um",
                    _ => "",
                };
                let value = |band: &BandModelFit| digits(band.parameters[i].value);
                let same = self.bands.iter().all(|band| value(band) == value(first));
                if same || self.bands.len() == 1 {
                    return format!("{} {}{unit}", parameter.name, value(first));
                }
                let each: Vec<String> = (self.bands.iter())
                    .map(|band| match &band.band {
                        ScanBand::Wavelength(wavelength) => {
                            format!("{} nm {}{unit}", (wavelength.nm() * 1e6).round() / 1e6, value(band))
                        }
                        of => format!("{of} {}{unit}", value(band)),
                    })
                    .collect();
                format!("{} [{}]", parameter.name, each.join(", "))
            })
            .collect();
        format!("{} {{ {} }}", self.model, params.join(", "))
    }
}

/// A number with six digits.
fn digits(value: f64) -> String {
    if value == 0.0 {
        return "0".into();
    }
    let decimals = (5 - value.abs().log10().floor() as i32).clamp(0, 12) as usize;
    let text = format!("{value:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_string() } else { text }
}

/// Fits a model to every band of scans.
///
/// # Errors
/// See [`ModelFitError`].
pub fn fit_model(scans: &Scans, model: &str, options: &FitOptions) -> Result<ModelFit, ModelFitError> {
    let (name, params) =
        FITS.iter().find(|(name, _)| *name == model).ok_or_else(|| ModelFitError::Unknown(model.to_string()))?;
    let metal =
        options.free.iter().any(|name| name == "k") || options.fixed.iter().any(|(name, k)| name == "k" && *k > 0.0);
    let params: &[Free] = &params.iter().map(|param| param.over(metal)).collect::<Vec<_>>();
    let known = || params.iter().map(|param| param.name).collect::<Vec<_>>().join(", ");
    for asked in options.fixed.iter().map(|(name, _)| name).chain(&options.free) {
        if !params.iter().any(|param| param.name == asked) {
            return Err(ModelFitError::Parameter { model: name, name: asked.clone(), known: known() });
        }
    }
    let fixed_at = |param: &Free| -> Option<f64> {
        let said = options.fixed.iter().find(|(name, _)| name == param.name).map(|(_, value)| *value);
        said.or((!param.free && !options.free.iter().any(|name| name == param.name)).then(|| param.starts[0]))
    };
    for param in params {
        let (low, high) = (param.low, param.high);
        if let Some(value) = fixed_at(param).filter(|value| !(low..=high).contains(value)) {
            return Err(ModelFitError::Range { model: name, name: param.name.to_string(), low, high, value });
        }
    }
    let n_free = params.iter().filter(|param| fixed_at(param).is_none()).count();
    let bands = (scans.bands().iter().enumerate())
        .map(|(band, of)| fit_band(name, params, &fixed_at, n_free, scans, band, of))
        .collect::<Result<Vec<_>, _>>()?;
    Ok(ModelFit { model: name, bands, n_free })
}

fn fit_band(
    model: &'static str,
    params: &[Free],
    fixed_at: &dyn Fn(&Free) -> Option<f64>,
    n_free: usize,
    scans: &Scans,
    band: usize,
    of: &ScanBand,
) -> Result<BandModelFit, ModelFitError> {
    let readings = scans.of_band(band);
    if readings.len() <= n_free {
        let (of, readings) = (of.of(), readings.len());
        return Err(ModelFitError::Undetermined { model, of, readings, parameters: n_free });
    }
    let um = match of {
        ScanBand::Wavelength(wavelength) => wavelength.um(),
        _ if model == "he_torrance" => return Err(ModelFitError::Wavelength(model)),
        _ => 0.55,
    };
    let errors_stated = readings.iter().all(|reading| reading.stddev.is_some_and(|sigma| sigma > 0.0));
    let largest = readings.iter().map(|reading| reading.brf).fold(0.0, f64::max);
    let sigma = |reading: &Reading| match reading.stddev {
        Some(sigma) if errors_stated => sigma.hypot(1e-3 * largest),
        _ => reading.brf.max(0.01 * largest).max(1e-9),
    };
    let mut values: Vec<f64> = readings.iter().map(|reading| reading.brf).collect();
    values.sort_by(f64::total_cmp);
    let median = values[values.len() / 2];
    let mut problem = Problem {
        model,
        params,
        grid: SpectralGrid::from_edges(&[um - 1e-6, um + 1e-6]),
        points: (readings.iter()).map(|reading| Point::of(scans, reading, sigma(reading))).collect(),
        limits: (params.iter())
            .map(|param| {
                let at = |value: f64| if param.log { value.ln() } else { value };
                MPPar {
                    fixed: fixed_at(param).is_some(),
                    limited_low: true,
                    limited_up: true,
                    limit_low: at(param.low),
                    limit_up: at(param.high),
                    rel_step: 1e-6,
                    step: 1e-6,
                    ..MPPar::new()
                }
            })
            .collect(),
        config: rmpfit::MPConfig { max_iter: 100, ..rmpfit::MPConfig::new() },
        floor: 0.0,
    };
    let mut best: Option<(Vec<f64>, rmpfit::MPStatus)> = None;
    for start in starts(params, fixed_at, median) {
        let mut found: Vec<f64> =
            params.iter().zip(start).map(|(param, value)| if param.log { value.ln() } else { value }).collect();
        if n_free == 0 {
            break;
        }
        problem.floor = 0.05 * largest;
        let placed = problem.mpfit(&mut found).is_ok();
        problem.floor = 0.0;
        if !placed {
            continue;
        }
        if let Ok(status) = problem.mpfit(&mut found) {
            let sound = status.best_norm.is_finite() && status.success != MPSuccess::NotDone;
            if sound && best.as_ref().is_none_or(|(_, other)| status.best_norm < other.best_norm) {
                best = Some((found, status));
            }
        }
    }
    let Some((found, status)) = best else { return Err(ModelFitError::NoFit { model, of: of.of() }) };
    let n = params.len();
    let value = |i: usize| if params[i].log { found[i].exp() } else { found[i] };
    let degrees_of_freedom = readings.len() - n_free;
    let scale = if errors_stated { 1.0 } else { status.best_norm / degrees_of_freedom as f64 };
    // From the logarithm's errors to the value's.
    let slope = |i: usize| if params[i].log { value(i) } else { 1.0 };
    let covariance: Vec<Vec<f64>> =
        (0..n).map(|i| (0..n).map(|j| status.covar[i * n + j] * scale * slope(i) * slope(j)).collect()).collect();
    let parameters = (params.iter().enumerate())
        .map(|(i, param)| {
            let fixed = fixed_at(param).is_some();
            let limits = &problem.limits[i];
            let near = 1e-6 * (limits.limit_up - limits.limit_low);
            let at_bound = !fixed && (found[i] - limits.limit_low < near || limits.limit_up - found[i] < near);
            let error = (!fixed && !at_bound && covariance[i][i] > 0.0).then(|| covariance[i][i].sqrt());
            FittedParameter { name: param.name, value: value(i), error, fixed, at_bound }
        })
        .collect();
    let bsdf = problem.bind(&found).ok_or(ModelFitError::NoFit { model, of: of.of() })?;
    let readings: Vec<(Reading, f64)> =
        readings.iter().zip(&problem.points).map(|(reading, point)| (*reading, point.brf(&*bsdf))).collect();
    let mean = readings.iter().map(|(reading, _)| reading.brf).sum::<f64>() / readings.len() as f64;
    let square: f64 = readings.iter().map(|(reading, model)| (reading.brf - model).powi(2)).sum();
    let rms = (square / readings.len() as f64).sqrt();
    Ok(BandModelFit {
        band: of.clone(),
        parameters,
        covariance,
        chi_square: status.best_norm,
        degrees_of_freedom,
        errors_stated,
        rms,
        relative_rms: rms / mean.max(f64::MIN_POSITIVE),
        readings,
        bsdf,
    })
}

/// Every combination of the parameters' starts.
fn starts(params: &[Free], fixed_at: &dyn Fn(&Free) -> Option<f64>, median: f64) -> Vec<Vec<f64>> {
    let mut all: Vec<Vec<f64>> = vec![Vec::new()];
    for param in params {
        let at = |value: f64| {
            // A BRDF in sr⁻¹ where the parameter is one.
            let own = if param.name == "rho_d" { median / PI } else { median };
            let value = if value.is_nan() { own } else { value };
            let inset = 1e-3 * (param.high - param.low);
            if param.log {
                value.clamp(param.low, param.high)
            } else {
                value.clamp(param.low + inset, param.high - inset)
            }
        };
        let values: Vec<f64> = match fixed_at(param) {
            Some(value) => vec![value],
            None => param.starts.iter().map(|value| at(*value)).collect(),
        };
        all = all
            .into_iter()
            .flat_map(|start| values.iter().map(move |value| [start.clone(), vec![*value]].concat()))
            .collect();
    }
    all
}

/// A reading: light, view directions over the aperture with their weights, value and error.
struct Point {
    incident: LocalDir,
    views: Vec<(LocalDir, f64)>,
    brf: f64,
    sigma: f64,
}

/// Radii of the aperture's rule in shares of its projected area: two Gauss points.
const RADII: [f64; 2] = [0.211_324_865_405_187_1, 0.788_675_134_594_812_9];
const SPOKES: u32 = 6;

impl Point {
    fn of(scans: &Scans, reading: &Reading, sigma: f64) -> Self {
        let (theta, view) = (scans.illuminations()[reading.illumination], scans.views()[reading.view]);
        let incident = LocalDir::from_polar(theta, 0.0);
        let axis = LocalDir::from_polar(view.abs(), if view < 0.0 { PI } else { 0.0 });
        let solid_angle = scans.solid_angle().unwrap_or(0.0);
        let frame = Frame::about(axis.vec());
        let mut views = Vec::new();
        for share in RADII {
            // π sin² a = Ω
            let alpha = (share * solid_angle / PI).min(1.0).sqrt().asin();
            for spoke in 0..SPOKES {
                let beta = TAU * f64::from(spoke) / f64::from(SPOKES);
                let direction = LocalDir::from_unit(frame.to_world(LocalDir::from_polar(alpha, beta)).vec());
                if direction.cos() > 0.0 {
                    views.push((direction, direction.cos()));
                }
            }
        }
        let sum: f64 = views.iter().map(|view| view.1).sum();
        views.iter_mut().for_each(|view| view.1 /= sum);
        if solid_angle == 0.0 || axis.theta() >= FRAC_PI_2 {
            views = vec![(axis, 1.0)];
        }
        Self { incident, views, brf: reading.brf, sigma }
    }

    /// What a model reads here.
    fn brf(&self, bsdf: &dyn Bsdf) -> f64 {
        let mut f = [0.0; 1];
        let of = |(direction, weight): &(LocalDir, f64)| {
            bsdf.eval(self.incident, *direction, &mut f);
            weight * f[0]
        };
        PI * self.views.iter().map(of).sum::<f64>()
    }
}

struct Problem<'a> {
    model: &'static str,
    params: &'a [Free],
    grid: SpectralGrid,
    points: Vec<Point>,
    limits: Vec<MPPar>,
    config: rmpfit::MPConfig,
    /// Least error of a reading.
    floor: f64,
}

impl Problem<'_> {
    /// The model of a point of the search.
    fn bind(&self, found: &[f64]) -> Option<Arc<dyn Bsdf>> {
        let model = BUILTIN.iter().find(|model| model.info.name == self.model)?;
        let value = |i: usize| {
            let (param, at) = (&self.params[i], found[i]);
            let value = if param.log { at.exp() } else { at };
            value.clamp(param.low, param.high)
        };
        let of = |name: &str| self.params.iter().position(|param| param.name == name).map(value);
        let given = (self.params.iter().enumerate()).map(|(i, param)| {
            let value = match param.name {
                // Bounds that hang together.
                "specular" if matches!(self.model, "phong" | "blinn_phong" | "ward") => {
                    value(i).min(1.0 - of("diffuse").unwrap_or(0.0))
                }
                "height" => value(i).min(0.99 * of("correlation").unwrap_or(f64::INFINITY)),
                _ => value(i),
            };
            (param.name.to_string(), Value::Spectrum(SpectralValue::Constant(value)))
        });
        (model.bind)(&Args::new(&model.info, given), &self.grid).ok()
    }
}

impl MPFitter for Problem<'_> {
    fn eval(&mut self, found: &[f64], deviates: &mut [f64]) -> MPResult<()> {
        let bsdf = self.bind(found).ok_or(MPError::Eval)?;
        for (deviate, point) in deviates.iter_mut().zip(&self.points) {
            *deviate = (point.brf - point.brf(&*bsdf)) / point.sigma.max(self.floor);
        }
        Ok(())
    }

    fn number_of_points(&self) -> usize {
        self.points.len()
    }

    fn config(&self) -> &rmpfit::MPConfig {
        &self.config
    }

    fn parameters(&self) -> &[MPPar] {
        &self.limits
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Goniometer, GoniometerBand, ReadingNoise};

    fn surface(model: &str, given: &[(&str, f64)]) -> Arc<dyn Bsdf> {
        let model = BUILTIN.iter().find(|known| known.info.name == model).unwrap();
        let constant =
            |(name, value): &(&str, f64)| (name.to_string(), Value::Spectrum(SpectralValue::Constant(*value)));
        let grid = SpectralGrid::from_edges(&[0.55 - 1e-6, 0.55 + 1e-6]);
        (model.bind)(&Args::new(&model.info, given.iter().map(constant)), &grid).unwrap()
    }

    fn scanned(model: &str, given: &[(&str, f64)], noise: f64) -> Scans {
        let band = GoniometerBand {
            band: ScanBand::Wavelength(sunglint_radiometry::Wavelength::from_um(0.55)),
            weights: vec![(0, 0.5), (1, 0.5)],
        };
        let noise = ReadingNoise { relative: noise, absolute: 0.0 };
        let goniometer = Goniometer { noise, solid_angle: 1e-3, ..Goniometer::default() };
        goniometer.scan(&*surface(model, given), 2, &[band]).unwrap()
    }

    /// What a goniometer without noise reads of a model is that model's to find again.
    #[test]
    fn a_models_own_scans_give_it_back() {
        let cases: [(&str, &[(&str, f64)]); 11] = [
            ("ideal", &[("diffuse", 0.3)]),
            ("phong", &[("diffuse", 0.25), ("specular", 0.1), ("exponent", 45.0)]),
            ("blinn_phong", &[("diffuse", 0.25), ("specular", 0.1), ("exponent", 160.0)]),
            ("ward", &[("diffuse", 0.12), ("specular", 0.2), ("roughness", 0.17)]),
            ("ggx", &[("diffuse", 0.3), ("roughness", 0.25), ("n", 1.6)]),
            ("rough_conductor", &[("diffuse", 0.1), ("roughness", 0.35), ("n", 1.9)]),
            ("cook_torrance", &[("diffuse", 0.4), ("specular", 0.6), ("roughness", 0.3), ("n", 1.5)]),
            ("oren_nayar", &[("diffuse", 0.4), ("roughness", 0.5)]),
            ("rpv", &[("rho0", 0.15), ("k", 0.75), ("theta", -0.15), ("rhoc", 0.5)]),
            ("ross_li", &[("iso", 0.2), ("vol", 0.08), ("geo", 0.03)]),
            ("hapke", &[("w", 0.6), ("b", 0.25), ("c", 0.65)]),
        ];
        for (model, given) in cases {
            let fit = fit_model(&scanned(model, given, 0.0), model, &FitOptions::default()).unwrap();
            for (name, truth) in given {
                let found = fit.bands[0].parameters.iter().find(|parameter| parameter.name == *name).unwrap();
                // The rule over the aperture against the instrument's own integral.
                assert!((found.value / truth - 1.0).abs() < 2e-3, "{model} {name}: {} {truth}", found.value);
            }
            assert!(fit.bands[0].relative_rms < 1e-3, "{model}: {}", fit.bands[0].relative_rms);
        }
    }

    /// Stated errors are honest: over many noisy scans the truth lies within two of them in some 95 %.
    #[test]
    fn errors_of_fitted_parameters_cover_the_truth() {
        let truth = [("diffuse", 0.25), ("specular", 0.1), ("exponent", 45.0)];
        let clean = scanned("phong", &truth, 0.0);
        let (mut within, mut all) = (0, 0);
        for seed in 0..60 {
            let noise = ReadingNoise { relative: 0.02, absolute: 0.0 };
            let noisy = Goniometer { noise, seed, solid_angle: 1e-3, ..Goniometer::default() }.noisy(&clean).unwrap();
            let fit = fit_model(&noisy, "phong", &FitOptions::default()).unwrap();
            for (name, truth) in truth {
                let found = fit.bands[0].parameters.iter().find(|parameter| parameter.name == name).unwrap();
                all += 1;
                within += i32::from((found.value - truth).abs() < 2.0 * found.error.unwrap());
            }
        }
        // 95.4 % of 180 are 172; binomial standard deviation 2.8.
        assert!(within >= 162, "{within} of {all}");
    }

    #[test]
    fn what_cannot_be_fitted_is_told() {
        let scans = scanned("ideal", &[("diffuse", 0.3)], 0.0);
        let told = |model: &str, options: &FitOptions| fit_model(&scans, model, options).err().unwrap().to_string();
        assert!(told("split", &FitOptions::default()).contains("cannot be fitted"));
        let free = FitOptions { free: vec!["shine".into()], ..FitOptions::default() };
        assert!(told("phong", &free).contains("it has diffuse, specular, exponent"));
        let fixed = FitOptions { fixed: vec![("n".into(), 50.0)], ..FitOptions::default() };
        assert!(told("ggx", &fixed).contains("between 1.02 and 10"));
    }
}
