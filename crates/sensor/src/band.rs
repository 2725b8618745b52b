//! How a band weighs wavelengths.

use sunglint_radiometry::{Channel, Curve, CurveError, Wavelength};

/// A Gaussian response ends this many full widths at half maximum from its centre, where it has fallen to 1.5e-5.
const GAUSSIAN_REACH: f64 = 2.0;
/// Nodes a full width at half maximum of a Gaussian.
const GAUSSIAN_NODES: i32 = 100;

/// Why a response makes no band.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BandError {
    /// Edges, centre or width are no wavelengths in order.
    #[error("band `{name}`: {message}")]
    Edges {
        /// The band.
        name: String,
        /// What is wrong.
        message: String,
    },
    /// Fewer than two rows, or 0 at every one.
    #[error("band `{name}` has no response: it needs two wavelengths at least, and a value above 0")]
    Empty {
        /// The band.
        name: String,
    },
    /// A negative value.
    #[error("band `{name}`, row {row}: a response of {value} is negative")]
    Negative {
        /// The band.
        name: String,
        /// Row, from 1.
        row: usize,
        /// The value.
        value: f64,
    },
    /// A wavelength that does not lie above the one before it.
    #[error("band `{name}`, row {row}: wavelengths must ascend")]
    NotAscending {
        /// The band.
        name: String,
        /// Row, from 1.
        row: usize,
    },
    /// A number that is not finite.
    #[error("band `{name}`, row {row}: a number is not finite")]
    NotFinite {
        /// The band.
        name: String,
        /// Row, from 1.
        row: usize,
    },
}

/// A band: its relative response against wavelength, at any scale, 0 outside its support.
#[derive(Clone, Debug, PartialEq)]
pub struct Band {
    /// Name, as outputs are called.
    pub name: String,
    /// Relative response.
    pub response: Curve,
    fwhm: f64,
}

impl Band {
    /// 1 between two wavelengths \[µm\], 0 elsewhere.
    pub fn edges(name: impl Into<String>, lower: f64, upper: f64) -> Result<Self, BandError> {
        let name = name.into();
        if !(0.0 < lower && lower < upper && upper.is_finite()) {
            let message = format!("its edges must ascend; {lower} um and {upper} um do not");
            return Err(BandError::Edges { name, message });
        }
        Ok(Self { name, response: Curve::boxcar(lower, upper), fwhm: upper - lower })
    }

    /// A Gaussian of peak 1, centre and full width at half maximum in µm, in a hundred straight lines a width. It ends
    /// two full widths from its centre (4.7 standard deviations) and is scaled, by 2.5e-6, to the integral that it has
    /// without end, fwhm √(π/(4 ln 2)).
    pub fn gaussian(name: impl Into<String>, centre: f64, fwhm: f64) -> Result<Self, BandError> {
        let name = name.into();
        if !(fwhm > 0.0 && fwhm.is_finite() && centre.is_finite() && centre - GAUSSIAN_REACH * fwhm > 0.0) {
            let message = format!(
                "a Gaussian reaches {GAUSSIAN_REACH} full widths to either side; {centre} um with a width of {fwhm} um \
                 does not stay above 0"
            );
            return Err(BandError::Edges { name, message });
        }
        let last = GAUSSIAN_NODES * GAUSSIAN_REACH as i32;
        let rows: Vec<(f64, f64)> = (-last..=last)
            .map(|k| {
                let widths = f64::from(k) / f64::from(GAUSSIAN_NODES);
                (centre + widths * fwhm, (-4.0 * std::f64::consts::LN_2 * widths * widths).exp())
            })
            .collect();
        let response = curve(&name, &rows)?;
        let (lower, upper) = response.domain();
        let whole = fwhm * (std::f64::consts::PI / (4.0 * std::f64::consts::LN_2)).sqrt();
        let response = response.clone().scaled(whole / response.integral(lower, upper));
        Ok(Self { name, response, fwhm })
    }

    /// Straight lines between `(wavelength [µm], relative response)` rows.
    pub fn table(name: impl Into<String>, rows: &[(f64, f64)]) -> Result<Self, BandError> {
        let name = name.into();
        if rows.len() < 2 || rows.iter().all(|(_, response)| *response == 0.0) {
            return Err(BandError::Empty { name });
        }
        let response = curve(&name, rows)?;
        if let Some(row) = rows.iter().position(|(_, response)| *response < 0.0) {
            return Err(BandError::Negative { name, row: row + 1, value: rows[row].1 });
        }
        let fwhm = half_maximum_width(rows);
        // Rows of 0 outside the first and last response do not count.
        let first = rows.iter().position(|(_, response)| *response > 0.0).unwrap_or(0).saturating_sub(1);
        let last = rows.iter().rposition(|(_, response)| *response > 0.0).unwrap_or(0) + 1;
        let response = match curve(&name, &rows[first..=last.min(rows.len() - 1)]) {
            Ok(trimmed) => trimmed,
            Err(_) => response,
        };
        Ok(Self { name, response, fwhm })
    }

    /// First and last wavelength with a response \[µm\].
    pub fn support(&self) -> (f64, f64) {
        self.response.domain()
    }

    /// The channel of this band: response-weighted mean wavelength, and full width at half maximum (of a table, between
    /// its outermost crossings; of a band by edges, its width).
    pub fn channel(&self) -> Channel {
        let (lower, upper) = self.support();
        let (integral, moment) = self.response.moments(lower, upper, lower);
        let centre = Wavelength::from_um(lower + moment / integral);
        Channel { name: self.name.clone(), centre, fwhm: self.fwhm }
    }
}

fn curve(name: &str, rows: &[(f64, f64)]) -> Result<Curve, BandError> {
    let name = name.to_string();
    Curve::linear(rows).map_err(|error| match error {
        CurveError::Empty => BandError::Empty { name },
        CurveError::NotAscending { row } => BandError::NotAscending { name, row: row + 1 },
        CurveError::NotFinite { row } => BandError::NotFinite { name, row: row + 1 },
    })
}

/// Between the outermost crossings of half the peak; a table that begins or ends above it counts from its end.
fn half_maximum_width(rows: &[(f64, f64)]) -> f64 {
    let half = 0.5 * rows.iter().map(|row| row.1).fold(0.0, f64::max);
    let crossing =
        |below: (f64, f64), above: (f64, f64)| below.0 + (half - below.1) / (above.1 - below.1) * (above.0 - below.0);
    let first = rows.iter().position(|row| row.1 >= half).unwrap_or(0);
    let last = rows.iter().rposition(|row| row.1 >= half).unwrap_or(0);
    let lower = if first == 0 { rows[0].0 } else { crossing(rows[first - 1], rows[first]) };
    let upper = if last + 1 == rows.len() { rows[last].0 } else { crossing(rows[last + 1], rows[last]) };
    upper - lower
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Integral fwhm √(π/(4 ln 2)), centre and half-maximum points of a Gaussian, to 1e-6 of its width.
    #[test]
    fn a_gaussian_keeps_its_integral_centre_and_width() {
        for (centre, fwhm) in [(0.55, 0.01), (0.9, 0.2), (0.4, 1e-4)] {
            let band = Band::gaussian("g", centre, fwhm).unwrap();
            let (lower, upper) = band.support();
            let integral = band.response.integral(lower, upper);
            let exact = fwhm * (std::f64::consts::PI / (4.0 * std::f64::consts::LN_2)).sqrt();
            assert!((integral / exact - 1.0).abs() < 1e-9);
            assert!((band.channel().centre.um() - centre).abs() < 1e-6 * fwhm);
            assert_eq!(band.channel().fwhm, fwhm);
            let peak = band.response.at(centre);
            assert!((peak - 1.0).abs() < 5e-6);
            for side in [-0.5, 0.5] {
                assert!((band.response.at(centre + side * fwhm) / peak - 0.5).abs() < 1e-6);
            }
            assert!((upper - lower - 4.0 * fwhm).abs() < 1e-12);
        }
    }

    #[test]
    fn a_band_by_edges_has_its_middle_and_its_width() {
        let band = Band::edges("red", 0.6, 0.75).unwrap();
        let channel = band.channel();
        assert!((channel.centre.um() - 0.675).abs() < 1e-15 && (channel.fwhm - 0.15).abs() < 1e-15);
        assert_eq!(band.support(), (0.6, 0.75));
        assert!(Band::edges("red", 0.75, 0.6).is_err() && Band::edges("red", 0.6, f64::NAN).is_err());
        assert!(Band::gaussian("g", 0.5, 0.0).is_err() && Band::gaussian("g", 0.5, 0.3).is_err());
    }

    /// A triangle from 0.5 over 0.6 to 0.8 µm: mean (0.5 + 0.6 + 0.8)/3, half maximum from 0.55 to 0.7.
    #[test]
    fn a_triangle_has_the_mean_of_its_corners_and_half_its_base() {
        let rows = [(0.4, 0.0), (0.5, 0.0), (0.6, 3.0), (0.8, 0.0), (0.9, 0.0)];
        let band = Band::table("t", &rows).unwrap();
        assert!((band.channel().centre.um() - 1.9 / 3.0).abs() < 1e-12);
        assert!((band.channel().fwhm - 0.15).abs() < 1e-12);
        assert_eq!(band.support(), (0.5, 0.8));
    }

    #[test]
    fn a_table_that_is_no_response_names_its_row() {
        let fault = |rows: &[(f64, f64)]| Band::table("t", rows).unwrap_err();
        assert!(matches!(fault(&[]), BandError::Empty { .. }));
        assert!(matches!(fault(&[(0.5, 1.0)]), BandError::Empty { .. }));
        assert!(matches!(fault(&[(0.5, 0.0), (0.6, 0.0)]), BandError::Empty { .. }));
        assert!(matches!(fault(&[(0.5, 1.0), (0.6, -0.1)]), BandError::Negative { row: 2, .. }));
        assert!(matches!(fault(&[(0.5, 1.0), (0.5, 0.1)]), BandError::NotAscending { row: 2, .. }));
        assert!(matches!(fault(&[(0.5, f64::NAN), (0.6, 0.1)]), BandError::NotFinite { row: 1, .. }));
    }
}
