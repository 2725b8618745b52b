//! Reflectance spectra on a grid.

use sunglint_plugin::{BindError, SpectralValue};
use sunglint_radiometry::{Curve, Entry, SpectralGrid};

/// Rounding that a sum of decimal fractions may carry past 1.
pub(crate) const ROUNDING: f64 = 1e-9;

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
