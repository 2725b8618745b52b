//! Spectra on a grid.

use sunglint_plugin::{Args, BindError, Param, SpectralValue};
use sunglint_radiometry::{Curve, Entry, SpectralGrid};

/// Rounding that a sum of decimal fractions may carry past 1.
pub(crate) const ROUNDING: f64 = 1e-9;

/// A quantity on the grid's entries.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct OnGrid {
    values: Vec<f64>,
    even: bool,
}

impl OnGrid {
    /// One value for each entry.
    pub fn new(values: Vec<f64>) -> Self {
        let even = values.windows(2).all(|pair| pair[0] == pair[1]);
        Self { values, even }
    }
    /// The value at an entry.
    pub fn at(&self, entry: usize) -> f64 {
        self.values[entry]
    }
    /// All of them.
    pub fn all(&self) -> &[f64] {
        &self.values
    }
    /// The value of all entries, where they have one.
    pub fn constant(&self) -> Option<f64> {
        self.even.then(|| self.values.first().copied()).flatten()
    }
    /// Smallest and largest value.
    pub fn range(&self) -> (f64, f64) {
        self.values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(*v), high.max(*v)))
    }
    /// Up to three values that stand for all: the smallest, the median and the largest.
    pub fn representatives(&self) -> Vec<f64> {
        if self.even {
            return self.values.first().copied().into_iter().collect();
        }
        let mut sorted = self.values.clone();
        sorted.sort_by(f64::total_cmp);
        let mut chosen = vec![sorted[0], sorted[sorted.len() / 2], sorted[sorted.len() - 1]];
        chosen.dedup();
        chosen
    }
}

/// The spectrum of a parameter that a model cannot do without.
pub(crate) fn required<'a>(model: &str, args: &'a Args, name: &'static str) -> Result<&'a SpectralValue, BindError> {
    args.spectral(name).ok_or_else(|| BindError::new("S05", name, format!("`{model}` needs `{name}`")))
}

/// A spectrum on the grid's entries, each within the parameter's range.
///
/// # Errors
/// `U05` for values out of range, `M04` where the spectrum does not cover the grid or lacks a band.
pub(crate) fn spectrum_within(param: &Param, value: &SpectralValue, grid: &SpectralGrid) -> Result<OnGrid, BindError> {
    let (name, (low, high)) = (param.name, param.range);
    if let SpectralValue::Curve(curve) = value {
        covered(name, curve, grid)?;
    }
    let on_grid = value.on(grid).map_err(|missing| BindError { param: Some(name), ..missing.into() })?;
    let slack = ROUNDING * high.abs().max(low.abs()).min(1e9);
    let used = grid.entries().iter().zip(&on_grid).map(|(entry, on_grid)| stated(value, entry, *on_grid));
    if let Some(worst) = used.into_iter().find(|value| !(low - slack..=high + slack).contains(value)) {
        return Err(BindError::new("U05", name, format!("`{name}` lies between {low} and {high}, not at {worst}")));
    }
    Ok(OnGrid::new(on_grid.into_iter().map(|value| value.clamp(low, high)).collect()))
}

/// The fraction that a parameter gives, or 0 at every entry where it is absent.
pub(crate) fn fraction_or_zero(args: &Args, name: &'static str, grid: &SpectralGrid) -> Result<Vec<f64>, BindError> {
    match args.spectral(name) {
        Some(value) => reflectance_on(name, value, grid),
        None => Ok(vec![0.0; grid.len()]),
    }
}

/// k_d beside a lobe scaled by k_s: the model's own `diffuse`, else the material's `reflectance` less k_s.
///
/// # Errors
/// `S05` where there is neither; `M05` where k_d + k_s exceeds 1 or k_s the material's reflectance.
pub(crate) fn diffuse_beside(
    model: &str,
    args: &Args,
    specular: &SpectralValue,
    k_s: &[f64],
    grid: &SpectralGrid,
) -> Result<Vec<f64>, BindError> {
    match (args.spectral("diffuse"), args.spectral("reflectance")) {
        (Some(diffuse), _) => {
            let k_d = reflectance_on("diffuse", diffuse, grid)?;
            // Overshoot of a bin's straight line, where the tables themselves keep to 1, goes.
            let sum = |d: f64, s: f64| d + s;
            at_most_one(diffuse, &k_d, specular, k_s, grid, sum, "k_d + k_s returns more than it gets")?;
            Ok(k_d.iter().zip(k_s).map(|(d, s)| d.min(1.0 - s)).collect())
        }
        (None, Some(total)) => {
            let total_on_grid = reflectance_on("reflectance", total, grid)?;
            let short = |total: f64, s: f64| 1.0 + s - total;
            let message = "k_s exceeds the material's reflectance";
            at_most_one(total, &total_on_grid, specular, k_s, grid, short, message)?;
            Ok(total_on_grid.iter().zip(k_s).map(|(total, s)| (total - s).max(0.0)).collect())
        }
        (None, None) => {
            let message = format!("`{model}` has no diffuse part: neither its own nor the material's");
            Err(BindError::of_block("S05", message).help("write `diffuse 0.18`, or give the material a `reflectance`"))
        }
    }
}

/// That `sum` of two stated spectra is at most 1 at every entry.
fn at_most_one(
    a: &SpectralValue,
    a_on_grid: &[f64],
    b: &SpectralValue,
    b_on_grid: &[f64],
    grid: &SpectralGrid,
    sum: impl Fn(f64, f64) -> f64,
    fault: &str,
) -> Result<(), BindError> {
    for ((entry, a_on_grid), b_on_grid) in grid.entries().iter().zip(a_on_grid).zip(b_on_grid) {
        let excess = sum(stated(a, entry, *a_on_grid), stated(b, entry, *b_on_grid)) - 1.0;
        if excess > ROUNDING {
            let nm = entry.wavelength.nm();
            return Err(BindError::of_block("M05", format!("{fault} at {nm:.1} nm, by {excess:.4}")));
        }
    }
    Ok(())
}

/// A reflectance on the grid's entries, each in 0..1.
///
/// # Errors
/// `M05` for values outside 0..1, `M04` where the spectrum does not cover the grid or lacks a band.
pub(crate) fn reflectance_on(
    param: &'static str,
    value: &SpectralValue,
    grid: &SpectralGrid,
) -> Result<Vec<f64>, BindError> {
    let given = match value {
        SpectralValue::Constant(value) => (*value, *value),
        SpectralValue::Curve(curve) => {
            covered(param, curve, grid)?;
            curve.range()
        }
        SpectralValue::PerBand(values) => values
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), (_, value)| (low.min(*value), high.max(*value))),
    };
    let mut on_grid = value.on(grid).map_err(|missing| BindError { param: Some(param), ..missing.into() })?;
    let used = grid.entries().iter().zip(&on_grid).map(|(entry, on_grid)| stated(value, entry, *on_grid));
    let worst = used.chain([given.0, given.1]).find(|value| !(-ROUNDING..=1.0 + ROUNDING).contains(value));
    if let Some(worst) = worst {
        let message = format!("reflectance lies between 0 and 1; `{param}` reaches {worst}");
        return Err(BindError::new("M05", param, message).help("write percent as `18 %` or `0.18`"));
    }
    // The straight line of a bin may pass the curve's own extremes by a little.
    on_grid.iter_mut().for_each(|value| *value = value.clamp(0.0, 1.0));
    Ok(on_grid)
}

/// The value of a spectrum at an entry as its table has it, before the bin's straight line stands for it.
pub(crate) fn stated(value: &SpectralValue, entry: &Entry, on_grid: f64) -> f64 {
    match value {
        SpectralValue::Curve(curve) => curve.at(entry.wavelength.um()),
        SpectralValue::Constant(_) | SpectralValue::PerBand(_) => on_grid,
    }
}

/// That a curve speaks for every bin of the grid.
pub(crate) fn covered(param: &'static str, curve: &Curve, grid: &SpectralGrid) -> Result<(), BindError> {
    let Some(bin) = grid.bins().iter().find(|bin| !curve.covers(bin.lower, bin.upper)) else { return Ok(()) };
    let ((first, last), nm) = (curve.domain(), 1e3);
    let message = format!(
        "`{param}` covers {:.1}..{:.1} nm and is used in {:.1}..{:.1} nm",
        first * nm,
        last * nm,
        bin.lower * nm,
        bin.upper * nm
    );
    Err(BindError::new("M04", param, message).help("give the missing wavelengths, or `extrapolate hold`"))
}
