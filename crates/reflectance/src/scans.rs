//! In-plane scans of a goniometer: bidirectional reflectance factors against view angle, for some bands and angles of
//! illumination [Stark1993, sec. 4.1.3; Feng1990].
//!
//! A view angle has a sign: negative in the forward half-plane, so that the mirror direction of light at i is v = −i;
//! v = +i looks back into the source, where most instruments shade their own sample.

mod report;
mod table;

use std::cmp::Ordering;
use std::collections::HashMap;
use std::f64::consts::FRAC_PI_2;
use std::fmt;

use sunglint_radiometry::Wavelength;

use crate::view_table::degrees;

pub use report::{Gaps, Place, Report};

/// Angles closer than this are one \[rad\]: a thousandth of a degree.
pub const SAME_ANGLE: f64 = 1.745e-5;

/// A negative value within so many of its standard errors of 0 is noise.
const NOISE: f64 = 5.0;

const MOST_BANDS: usize = 10_000;
const MOST_ILLUMINATIONS: usize = 1000;
const MOST_VIEWS: usize = 10_000;
/// Scans, each one band and one angle of illumination.
const MOST_SCANS: usize = 200_000;
/// Faults that are told of one file.
const MOST_FAULTS: usize = 20;

/// What a scan was taken in.
#[derive(Clone, Debug, PartialEq)]
pub enum ScanBand {
    /// Nothing is said: it stands for all wavelengths.
    All,
    /// A band.
    Named(String),
    /// A wavelength.
    Wavelength(Wavelength),
}

impl ScanBand {
    /// For messages: nothing, " of band `red`", " at 550 nm".
    pub fn of(&self) -> String {
        match self {
            Self::All => String::new(),
            Self::Named(name) => format!(" of band `{name}`"),
            Self::Wavelength(wavelength) => format!(" at {} nm", rounded(wavelength.nm())),
        }
    }

    fn key(&self) -> (u8, u64, &str) {
        match self {
            Self::All => (0, 0, ""),
            Self::Named(name) => (1, 0, name),
            Self::Wavelength(wavelength) => (2, wavelength.um().to_bits(), ""),
        }
    }
}

impl fmt::Display for ScanBand {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::All => f.write_str("all wavelengths"),
            Self::Named(name) => f.write_str(name),
            Self::Wavelength(wavelength) => write!(f, "{} nm", rounded(wavelength.nm())),
        }
    }
}

/// Free of what the change of units left.
pub(crate) fn rounded(value: f64) -> f64 {
    (value * 1e9).round() / 1e9 + 0.0
}

/// A value as an instrument gives it.
#[derive(Clone, Debug, PartialEq)]
pub struct Measurement {
    /// What it was taken in.
    pub band: ScanBand,
    /// Zenith angle of the light \[rad\], 0 to below π/2.
    pub illumination: f64,
    /// Zenith angle of the view \[rad\], −π/2..π/2, negative in the forward half-plane.
    pub view: f64,
    /// Bidirectional reflectance factor.
    pub brf: f64,
    /// Standard error of `brf`, as given: of the mean, where that is one of several readings.
    pub stddev: Option<f64>,
    /// Line in its file, from 1.
    pub line: Option<u64>,
}

/// A value of [`Scans`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// Index into [`Scans::bands`].
    pub band: usize,
    /// Index into [`Scans::illuminations`].
    pub illumination: usize,
    /// Index into [`Scans::views`].
    pub view: usize,
    /// Bidirectional reflectance factor.
    pub brf: f64,
    /// Its standard error.
    pub stddev: Option<f64>,
}

/// In-plane scans: bands × angles of illumination × signed view angles, not all of which need be there.
#[derive(Clone, Debug, PartialEq)]
pub struct Scans {
    bands: Vec<ScanBand>,
    illuminations: Vec<f64>,
    views: Vec<f64>,
    readings: Vec<Reading>,
    impossible: Vec<Measurement>,
    solid_angle: Option<f64>,
}

/// Something wrong with scans: where, what, and what would be right.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub struct ScanFault {
    /// F01 malformed, F02 a column, U05 out of range, M05 doubled or no reflectance.
    pub code: &'static str,
    /// Line in the file, from 1.
    pub line: Option<u64>,
    /// What is wrong.
    pub message: String,
    /// What would be right.
    pub help: Option<String>,
}

impl ScanFault {
    pub(crate) fn new(code: &'static str, line: Option<u64>, message: impl Into<String>) -> Self {
        Self { code, line, message: message.into(), help: None }
    }
    pub(crate) fn help(self, help: impl Into<String>) -> Self {
        Self { help: Some(help.into()), ..self }
    }
}

impl fmt::Display for ScanFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(line) = self.line {
            write!(f, "line {line}: ")?;
        }
        f.write_str(&self.message)?;
        self.help.iter().try_for_each(|help| write!(f, "; {help}"))
    }
}

/// All that is wrong with scans, one at least; of very many the first and how many there are.
#[derive(Clone, Debug, Default, PartialEq, thiserror::Error)]
pub struct ScanFaults {
    /// The first of them.
    pub faults: Vec<ScanFault>,
    /// How many there are in all.
    pub count: usize,
}

impl ScanFaults {
    pub(crate) fn push(&mut self, fault: ScanFault) {
        self.count += 1;
        if self.faults.len() < MOST_FAULTS {
            self.faults.push(fault);
        }
    }
    pub(crate) fn into_result<T>(self, value: impl FnOnce() -> T) -> Result<T, Self> {
        if self.count == 0 { Ok(value()) } else { Err(self) }
    }
}

impl From<ScanFault> for ScanFaults {
    fn from(fault: ScanFault) -> Self {
        Self { faults: vec![fault], count: 1 }
    }
}

impl fmt::Display for ScanFaults {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, fault) in self.faults.iter().enumerate() {
            write!(f, "{}{fault}", if i > 0 { "\n" } else { "" })?;
        }
        match self.count - self.faults.len() {
            0 => Ok(()),
            more => write!(f, "\nand {more} more"),
        }
    }
}

impl Scans {
    /// From values in any order; `solid_angle` is that of the instrument's aperture \[sr\], where it is known. Values at
    /// 90°, which no instrument takes, are set aside for the [report](Self::report).
    ///
    /// # Errors
    /// `F01` no value, or one that is not finite; `U05` an angle or solid angle out of range; `M05` a negative factor or
    /// standard error, two values at one place, bands beside wavelengths. All that are found are told.
    pub fn new(
        measurements: impl IntoIterator<Item = Measurement>,
        solid_angle: Option<f64>,
    ) -> Result<Self, ScanFaults> {
        let mut faults = ScanFaults::default();
        let mut kept = Vec::new();
        let mut impossible = Vec::new();
        if let Some(solid_angle) = solid_angle
            && let Err(fault) = within_hemisphere(solid_angle, None)
        {
            faults.push(fault);
        }
        for measurement in measurements {
            match held(&measurement) {
                Err(fault) => faults.push(fault),
                Ok(()) if measurement.view.abs() > FRAC_PI_2 - SAME_ANGLE => impossible.push(measurement),
                Ok(()) => kept.push(measurement),
            }
        }
        if kept.is_empty() && faults.count == 0 {
            faults.push(ScanFault::new("F01", None, "there is no value below 90 deg"));
        }
        let mut bands: Vec<ScanBand> = Vec::new();
        let mut known: HashMap<(u8, u64, String), usize> = HashMap::new();
        let mut band_of = Vec::with_capacity(kept.len());
        for measurement in &kept {
            let (kind, bits, name) = measurement.band.key();
            band_of.push(*known.entry((kind, bits, name.to_string())).or_insert_with(|| {
                bands.push(measurement.band.clone());
                bands.len() - 1
            }));
        }
        if bands.windows(2).any(|pair| pair[0].key().0 != pair[1].key().0) {
            faults.push(ScanFault::new("M05", None, "values are for bands or for wavelengths, not for both"));
        }
        let illuminations = distinct(kept.iter().map(|m| m.illumination));
        let views = distinct(kept.iter().map(|m| m.view));
        for (what, count, most) in [
            ("bands", bands.len(), MOST_BANDS),
            ("angles of illumination", illuminations.len(), MOST_ILLUMINATIONS),
            ("view angles", views.len(), MOST_VIEWS),
            ("pairs of band and illumination", bands.len().saturating_mul(illuminations.len()), MOST_SCANS),
        ] {
            if count > most {
                faults.push(
                    ScanFault::new("U05", None, format!("{count} {what}; at most {most} are taken"))
                        .help("angles closer than 0.001 deg are one: round them"),
                );
            }
        }
        let mut first: HashMap<(usize, usize, usize), Option<u64>> = HashMap::new();
        let mut readings = Vec::with_capacity(kept.len());
        for (measurement, band) in kept.iter().zip(band_of) {
            let Measurement { illumination, view, brf, stddev, line, .. } = *measurement;
            let (i, v) = (nearest(&illuminations, illumination), nearest(&views, view));
            if let Some(before) = first.insert((band, i, v), line) {
                let at = format!("illumination {} deg, view {} deg", degrees(illumination), degrees(view));
                let before = before.map_or(String::new(), |line| format!(", first in line {line}"));
                let message = format!("the value{} at {at} stands twice{before}", measurement.band.of());
                faults
                    .push(ScanFault::new("M05", line, message).help("keep one, or their mean with its standard error"));
            }
            readings.push(Reading { band, illumination: i, view: v, brf: brf + 0.0, stddev });
        }
        readings.sort_by_key(|reading| (reading.band, reading.illumination, reading.view));
        faults.into_result(|| Self { bands, illuminations, views, readings, impossible, solid_angle })
    }

    /// The same, taken through an aperture of this solid angle \[sr\].
    ///
    /// # Errors
    /// `U05` where it is none of a hemisphere's.
    pub fn with_solid_angle(mut self, solid_angle: f64) -> Result<Self, ScanFault> {
        within_hemisphere(solid_angle, None)?;
        self.solid_angle = Some(solid_angle);
        Ok(self)
    }

    /// What the scans were taken in, in the order of the values.
    pub fn bands(&self) -> &[ScanBand] {
        &self.bands
    }
    /// Angles of illumination \[rad\], ascending.
    pub fn illuminations(&self) -> &[f64] {
        &self.illuminations
    }
    /// View angles with their signs \[rad\], ascending.
    pub fn views(&self) -> &[f64] {
        &self.views
    }
    /// Solid angle of the instrument's aperture \[sr\], where it is known.
    pub fn solid_angle(&self) -> Option<f64> {
        self.solid_angle
    }
    /// The values, by band, illumination and view.
    pub fn readings(&self) -> &[Reading] {
        &self.readings
    }
    /// The values of a band.
    pub fn of_band(&self, band: usize) -> &[Reading] {
        let from = self.readings.partition_point(|reading| reading.band < band);
        let to = self.readings.partition_point(|reading| reading.band <= band);
        &self.readings[from..to]
    }
    /// The value at a place.
    pub fn at(&self, band: usize, illumination: usize, view: usize) -> Option<&Reading> {
        let key = (band, illumination, view);
        let found =
            self.readings.binary_search_by(|reading| (reading.band, reading.illumination, reading.view).cmp(&key));
        found.ok().map(|i| &self.readings[i])
    }

    /// Whether a value was taken in the mirror direction, v = −i.
    pub fn is_specular(&self, reading: &Reading) -> bool {
        same(self.views[reading.view], -self.illuminations[reading.illumination])
    }
    /// Whether a value was taken against the light, v = +i; straight down both are one, and count as the mirror's.
    pub fn is_retro(&self, reading: &Reading) -> bool {
        same(self.views[reading.view], self.illuminations[reading.illumination])
    }

    fn specular_view(&self, illumination: usize) -> Option<usize> {
        index_of(&self.views, -self.illuminations[illumination])
    }

    /// The same values as measurements, for another instrument's noise or for writing.
    pub fn measurements(&self) -> impl Iterator<Item = Measurement> + '_ {
        self.readings.iter().map(|reading| Measurement {
            band: self.bands[reading.band].clone(),
            illumination: self.illuminations[reading.illumination],
            view: self.views[reading.view],
            brf: reading.brf,
            stddev: reading.stddev,
            line: None,
        })
    }
}

/// That a value is one of an in-plane scan.
fn held(measurement: &Measurement) -> Result<(), ScanFault> {
    let Measurement { illumination, view, brf, stddev, line, .. } = *measurement;
    let fault = |code, message: String| ScanFault::new(code, line, message);
    if ![illumination, view, brf, stddev.unwrap_or(0.0)].iter().all(|value| value.is_finite()) {
        return Err(fault("F01", "a value is not a finite number".into()));
    }
    if illumination < 0.0 {
        let message = format!("an illumination angle of {} deg is negative", degrees(illumination));
        return Err(fault("U05", message).help("the light stands at positive angles; it is the view that has a sign"));
    }
    if illumination > FRAC_PI_2 - SAME_ANGLE {
        let message = format!("light at {} deg does not reach the sample", degrees(illumination));
        return Err(fault("U05", message).help("illumination angles lie from 0 to below 90 deg, to the normal"));
    }
    if view.abs() > FRAC_PI_2 + SAME_ANGLE {
        let message = format!("a view angle of {} deg is behind the sample", degrees(view));
        return Err(fault("U05", message).help("view angles lie within -90..90 deg, to the normal"));
    }
    let stddev = stddev.unwrap_or(0.0);
    if stddev < 0.0 {
        return Err(fault("M05", format!("a standard error is not negative; it is {stddev}")));
    }
    if brf < -NOISE * stddev {
        let message = format!("a reflectance factor is not negative; it is {brf}");
        let help = if stddev > 0.0 {
            "that is more than 5 standard errors below 0: look at the dark signal"
        } else {
            "look at the dark signal, or state the noise in a column `brf_stddev`"
        };
        return Err(fault("M05", message).help(help));
    }
    Ok(())
}

fn within_hemisphere(solid_angle: f64, line: Option<u64>) -> Result<(), ScanFault> {
    if solid_angle > 0.0 && solid_angle <= std::f64::consts::TAU {
        return Ok(());
    }
    let message = format!("an aperture of {solid_angle} sr is none; solid angles lie above 0 and up to 2 pi sr");
    Err(ScanFault::new("U05", line, message))
}

fn same(a: f64, b: f64) -> bool {
    (a - b).abs() < SAME_ANGLE
}

/// Ascending, those that are one taken once.
fn distinct(angles: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut angles: Vec<f64> = angles.map(|angle| angle + 0.0).collect();
    angles.sort_by(f64::total_cmp);
    angles.dedup_by(|b, a| same(*a, *b));
    angles
}

/// Index of the angle of a [`distinct`] list that stands for one of its own.
fn nearest(angles: &[f64], angle: f64) -> usize {
    let above = angles.partition_point(|known| *known <= angle + 0.0);
    above.saturating_sub(1)
}

fn index_of(angles: &[f64], angle: f64) -> Option<usize> {
    let order = |known: &f64| match () {
        () if same(*known, angle) => Ordering::Equal,
        () => known.total_cmp(&angle),
    };
    angles.binary_search_by(order).ok()
}

#[cfg(test)]
mod tests;
