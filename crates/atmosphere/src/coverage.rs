//! Whether tables speak for all of a grid.

use sunglint_radiometry::SpectralGrid;

use crate::AtmosphereError;

/// An `M04` naming the first part of `grid` that lies outside `first..last` \[µm\], what `table` speaks for.
pub(crate) fn check(table: &str, (first, last): (f64, f64), grid: &SpectralGrid) -> Result<(), AtmosphereError> {
    const SLACK: f64 = 1e-9;
    let gap = grid.bins().iter().find_map(|bin| {
        if bin.lower < first - SLACK {
            Some((bin.lower, bin.upper.min(first)))
        } else if bin.upper > last + SLACK {
            Some((bin.lower.max(last), bin.upper))
        } else {
            None
        }
    });
    match gap {
        None => Ok(()),
        Some((from, to)) => Err(AtmosphereError {
            code: "M04",
            message: format!(
                "{table} speaks for {:.6} to {:.6} um; {from:.6} to {to:.6} um is asked of it",
                first, last
            ),
        }),
    }
}

/// Whether ground albedos have a value for every entry.
pub(crate) fn albedos(albedos: &[Vec<f64>], grid: &SpectralGrid) -> Result<(), AtmosphereError> {
    let due = grid.len();
    let Some(found) = albedos.iter().map(Vec::len).find(|found| *found != due) else { return Ok(()) };
    let message = format!("the ground albedo has {found} values where the spectral grid has {due}");
    Err(AtmosphereError { code: "M04", message })
}
