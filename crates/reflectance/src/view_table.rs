//! Tables against view angle, for all wavelengths, per band or per wavelength.

use std::f64::consts::FRAC_PI_2;

use sunglint_plugin::{BindError, Column, Table, TableKey};
use sunglint_radiometry::{Curve, Dimension, SpectralGrid};

use crate::AngularSpectra;
use crate::spectral::covered;

/// The column of view angles.
pub(crate) const VIEW_ZENITH: Column =
    Column { name: "view_zenith", dimension: Dimension::Angle, range: (0.0, FRAC_PI_2) };

/// The rows of one band or wavelength: ascending view angle \[rad\], and the other columns.
#[derive(Clone, Debug)]
pub(crate) struct Profile {
    /// The band or wavelength, for messages: "", " of band `red`", " at 550 nm".
    pub of: String,
    key: Key,
    /// View angle and values, one row each.
    pub rows: Vec<(f64, Vec<f64>)>,
}

#[derive(Clone, Debug, PartialEq)]
enum Key {
    All,
    Band(String),
    Wavelength(f64),
}

impl Profile {
    /// Value of a column at a view angle: straight lines between rows, end rows hold.
    fn at(&self, column: usize, theta: f64) -> f64 {
        let above = self.rows.partition_point(|row| row.0 <= theta);
        if above == 0 || above == self.rows.len() {
            return self.rows[above.saturating_sub(1)].1[column];
        }
        let (a, b) = (&self.rows[above - 1], &self.rows[above]);
        let t = (theta - a.0) / (b.0 - a.0);
        (1.0 - t) * a.1[column] + t * b.1[column]
    }
}

/// The profiles of a table whose first column is the view angle.
///
/// # Errors
/// `M05` for an empty table, angles that do not ascend or leave 0..90°, and numbers that are not finite.
pub(crate) fn profiles(param: &'static str, table: &Table, n_columns: usize) -> Result<Vec<Profile>, BindError> {
    let fault = |message: String| Err(BindError::new("M05", param, message));
    let mut profiles: Vec<Profile> = Vec::new();
    for (i, row) in table.rows.iter().enumerate() {
        let line = i + 1;
        if row.len() != n_columns || row.iter().any(|value| !value.is_finite()) {
            return fault(format!("row {line} of `{param}` does not hold {n_columns} finite numbers"));
        }
        let (key, of) = match &table.key {
            TableKey::None => (Some(Key::All), String::new()),
            TableKey::Band(bands) => {
                let of = bands.get(i).map(|band| format!(" of band `{band}`"));
                (bands.get(i).cloned().map(Key::Band), of.unwrap_or_default())
            }
            TableKey::Wavelength(um) => {
                let of = um.get(i).map(|um| format!(" at {} nm", (um * 1e6).round() / 1e3));
                (um.get(i).filter(|um| um.is_finite()).map(|um| Key::Wavelength(*um)), of.unwrap_or_default())
            }
        };
        let Some(key) = key else {
            return fault(format!("row {line} of `{param}` has no band or wavelength"));
        };
        let theta = row[0];
        if !(-1e-9..=FRAC_PI_2 + 1e-9).contains(&theta) {
            return fault(format!("view angles lie between 0 and 90 deg; row {line} has {} deg", degrees(theta)));
        }
        let theta = theta.clamp(0.0, FRAC_PI_2);
        let profile = match profiles.iter().position(|profile| profile.key == key) {
            Some(found) => &mut profiles[found],
            None => {
                profiles.push(Profile { of, key, rows: Vec::new() });
                profiles.last_mut().expect("one was just pushed")
            }
        };
        if let Some((before, _)) = profile.rows.last()
            && theta <= *before
        {
            let (before, of) = (degrees(*before), &profile.of);
            return fault(format!("view angles{of} must ascend; {} deg follows {before} deg", degrees(theta)));
        }
        profile.rows.push((theta, row[1..].to_vec()));
    }
    if profiles.is_empty() {
        return fault(format!("`{param}` has no rows"));
    }
    Ok(profiles)
}

/// A column on the grid, at the view angles of all profiles together.
///
/// # Errors
/// `M04` where a band of the grid has no profile or the wavelengths do not cover the grid.
pub(crate) fn on_grid(
    param: &'static str,
    profiles: &[Profile],
    column: usize,
    grid: &SpectralGrid,
) -> Result<AngularSpectra, BindError> {
    let mut angles: Vec<f64> = profiles.iter().flat_map(|profile| profile.rows.iter().map(|row| row.0)).collect();
    angles.sort_by(f64::total_cmp);
    angles.dedup();
    let spectra: Result<Vec<Vec<f64>>, BindError> =
        angles.iter().map(|theta| spectrum(param, profiles, column, *theta, grid)).collect();
    Ok(AngularSpectra::new(angles, spectra?))
}

fn spectrum(
    param: &'static str,
    profiles: &[Profile],
    column: usize,
    theta: f64,
    grid: &SpectralGrid,
) -> Result<Vec<f64>, BindError> {
    match profiles[0].key {
        Key::All => Ok(vec![profiles[0].at(column, theta); grid.len()]),
        Key::Band(_) => (grid.entries().iter())
            .map(|entry| {
                let band = grid.band_of(entry).unwrap_or("(every band)");
                let found = profiles.iter().find(|profile| profile.key == Key::Band(band.to_string()));
                found.map(|profile| profile.at(column, theta)).ok_or_else(|| {
                    let message = format!("`{param}` has no rows for band `{band}`");
                    BindError::new("M04", param, message).help("give rows for every band the material is seen in")
                })
            })
            .collect(),
        Key::Wavelength(_) => {
            let wavelength = |profile: &Profile| match profile.key {
                Key::Wavelength(um) => um,
                Key::All | Key::Band(_) => f64::NAN,
            };
            let mut rows: Vec<(f64, f64)> =
                profiles.iter().map(|profile| (wavelength(profile), profile.at(column, theta))).collect();
            rows.sort_by(|a, b| a.0.total_cmp(&b.0));
            let curve = Curve::linear(&rows)
                .map_err(|_| BindError::new("M05", param, format!("the wavelengths of `{param}` do not ascend")))?;
            covered(param, &curve, grid)?;
            Ok(curve.on(grid))
        }
    }
}

/// An angle in degrees, for messages.
pub(crate) fn degrees(theta: f64) -> f64 {
    (theta.to_degrees() * 1e6).round() / 1e6
}
