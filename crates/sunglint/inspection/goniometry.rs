//! Materials on the virtual goniometer, and pictures of scans and of what they are split into.

use sunglint_radiometry::{SpectralGrid, Wavelength};
use sunglint_reflectance::{
    Goniometer, GoniometerBand, ModelFit, Reading, SAME_ANGLE, ScanBand, ScanFaults, Scans, SplitFit, Support,
};
use sunglint_sensor::Band;

use super::{InspectionError, Specimen};
use crate::grid;
use crate::plot::{Axis, Picture, Plot, Series, Style};

/// Bands that one picture shows at most.
const MOST_PANELS: usize = 12;
/// A range of values wider than this takes a logarithmic axis.
const WIDE: f64 = 25.0;

/// Scans a material at wavelengths \[µm\], or without them in the bands of its scene, as response-weighted means under an
/// even source.
///
/// # Errors
/// Where the model does not bind, two bands of one name differ, or no instrument does what is asked.
pub fn scan(
    specimen: &Specimen,
    goniometer: &Goniometer,
    wavelengths: Option<&[f64]>,
) -> Result<Scans, InspectionError> {
    let told = |faults: ScanFaults| InspectionError::Input(faults.to_string().replace('\n', "\nerror: "));
    if let Some(wavelengths) = wavelengths {
        let surface = specimen.bind(wavelengths)?;
        let bands: Vec<GoniometerBand> = (surface.wavelengths().iter().zip(surface.entries()))
            .map(|(um, entries)| GoniometerBand {
                band: ScanBand::Wavelength(Wavelength::from_um(*um)),
                weights: entries.map(|entry| (entry, 0.5)).to_vec(),
            })
            .collect();
        return goniometer.scan(surface.bsdf(), surface.len(), &bands).map_err(told);
    }
    let mut bands: Vec<Band> = Vec::new();
    for band in specimen.bands() {
        match bands.iter().find(|known| known.name == band.name) {
            None => bands.push(band.clone()),
            Some(known) if known.response == band.response => {}
            Some(_) => {
                let message = format!("two sensors have bands `{}` that differ: say --wavelength", band.name);
                return Err(InspectionError::Input(message));
            }
        }
    }
    if bands.is_empty() {
        return Err(InspectionError::Input("the scene's sensors have no band: say --wavelength".into()));
    }
    let (bins, names) = grid::bins(&bands, &specimen.corners(), specimen.is_per_band());
    let spectral = SpectralGrid::new(bins, names);
    let bsdf = specimen.bind_on(&spectral)?;
    let channels = grid::channels(&spectral, &bands);
    let bands: Vec<GoniometerBand> = (bands.iter().enumerate())
        .map(|(c, band)| {
            let (first, weights) = channels.row(c);
            let weights = weights.iter().enumerate().map(|(i, weight)| (first + i, *weight)).collect();
            GoniometerBand { band: ScanBand::Named(band.name.clone()), weights }
        })
        .collect();
    goniometer.scan(&*bsdf, spectral.len(), &bands).map_err(told)
}

/// A linear axis, or a logarithmic one where positive values differ widely.
fn value_axis(label: &str, values: impl Iterator<Item = f64> + Clone) -> Axis {
    let positive = values.filter(|value| *value > 0.0);
    let (low, high) = positive.fold((f64::INFINITY, 0.0f64), |(a, b), v| (a.min(v), b.max(v)));
    let axis = Axis::new(label, "1");
    if high > WIDE * low { axis.log() } else { axis }
}

fn titled(what: &str, band: &ScanBand) -> String {
    match band {
        ScanBand::All => what.to_string(),
        band => format!("{what}, {band}"),
    }
}

/// In-plane profiles, the BRF against view angle for each illumination [Stark1993, fig. 4.1].
pub fn profile_chart(scans: &Scans, band: usize) -> Picture {
    let readings = scans.of_band(band);
    let series = (scans.illuminations().iter().enumerate())
        .map(|(i, illumination)| {
            let of = readings.iter().filter(|reading| reading.illumination == i);
            let points = of.map(|reading| (scans.views()[reading.view].to_degrees(), reading.brf)).collect();
            Series::new(format!("θ_{{i}} = {}°", tidy(illumination.to_degrees())), points, Style::Marked)
        })
        .filter(|series| !series.points.is_empty())
        .collect();
    Plot {
        title: titled("In-plane reflectance", &scans.bands()[band]),
        x: Axis::new("view zenith angle θ_{v}, forward < 0", "°").within(-90.0, 90.0),
        y: value_axis("BRF", readings.iter().map(|reading| reading.brf)),
        series,
        square: false,
    }
    .picture()
}

/// R_d, R_s and ρ_s against view angle, marks where they were measured, with two standard errors about them
/// [Stark1993, fig. 4.2].
pub fn split_chart(fit: &SplitFit, band: usize) -> Picture {
    let split = &fit.bands[band];
    let line = |value: &dyn Fn(&sunglint_reflectance::SplitRow) -> f64| {
        split
            .rows
            .iter()
            .filter(|row| row.theta < 1.56)
            .map(|row| (row.theta.to_degrees(), value(row)))
            .collect::<Vec<_>>()
    };
    let mut series = Vec::new();
    let noisy = |row: &sunglint_reflectance::SplitRow| row.diffuse_error.is_some_and(|error| error > 0.0);
    if split.rows.iter().all(noisy) {
        let peak = |row: &sunglint_reflectance::SplitRow, sign: f64| {
            let relative = row.specular_error.unwrap_or(0.0) / row.specular.max(f64::MIN_POSITIVE);
            row.peak * (1.0 + sign * 2.0 * relative)
        };
        for (k, sign) in [1.0, -1.0].into_iter().enumerate() {
            let name = if k == 0 { "± 2 standard errors" } else { "" };
            let about = line(&|row| row.diffuse + sign * 2.0 * row.diffuse_error.unwrap_or(0.0));
            series.push(Series::new(name, about, Style::Reference));
            series.push(Series::new("", line(&|row| peak(row, sign)), Style::Reference));
        }
    }
    series.push(Series::new("R_{d}", line(&|row| row.diffuse), Style::Line).coloured(0));
    if split.rows.iter().any(|row| row.specular > 0.0) {
        series.push(Series::new("R_{s}", line(&|row| row.peak), Style::Line).coloured(1));
        series.push(Series::new("ρ_{s}", line(&|row| row.specular), Style::Dashed).coloured(2));
    }
    let diffuse = split.diffuse.iter().map(|node| (node.theta.to_degrees(), node.value)).collect();
    let specular = split.specular.iter().map(|node| (node.theta.to_degrees(), node.value)).collect();
    series.push(Series::new("R_{d} measured", diffuse, Style::Points).coloured(0));
    series.push(Series::new("R_{s} measured", specular, Style::Points).coloured(1));
    let shown = split.rows.iter().filter(|row| row.support != Support::Extended && row.theta > SAME_ANGLE);
    Plot {
        title: titled("Components", &split.band),
        x: Axis::new("view zenith angle θ_{v}", "°").within(0.0, 90.0),
        y: value_axis("reflectance", shown.flat_map(|row| [row.diffuse, row.peak, row.specular])),
        series,
        square: false,
    }
    .picture()
}

/// Scans as marks and a fitted model as lines between its own values at finer angles, of many bands the first twelve.
pub fn model_fit_chart(scans: &Scans, fit: &ModelFit) -> Picture {
    let panel = |band: usize| {
        let fitted = &fit.bands[band];
        let mut series = Vec::new();
        for (i, illumination) in scans.illuminations().iter().enumerate() {
            let of: Vec<&Reading> = scans.of_band(band).iter().filter(|reading| reading.illumination == i).collect();
            if of.is_empty() {
                continue;
            }
            let marks = of.iter().map(|reading| (scans.views()[reading.view].to_degrees(), reading.brf)).collect();
            let name = format!("θ_{{i}} = {}°", tidy(illumination.to_degrees()));
            series.push(Series::new(name, marks, Style::Points).coloured(i));
            let line = (-84..=84).map(|degree| {
                let degree = f64::from(degree);
                (degree, fitted.brf_at(*illumination, degree.to_radians()))
            });
            series.push(Series::new("", line.collect(), Style::Line).coloured(i));
        }
        Plot {
            title: titled(&format!("Scans and fitted {}", fit.model), &fitted.band),
            x: Axis::new("view zenith angle θ_{v}, forward < 0", "°").within(-90.0, 90.0),
            y: value_axis("BRF", scans.of_band(band).iter().map(|reading| reading.brf)),
            series,
            square: false,
        }
        .picture()
    };
    Picture::grid((0..fit.bands.len().min(MOST_PANELS)).map(panel).collect(), 2)
}

/// Scans beside what they are split into, a row for each band, of many the first twelve.
pub fn fit_chart(scans: &Scans, fit: &SplitFit) -> Picture {
    let bands = 0..scans.bands().len().min(MOST_PANELS);
    Picture::grid(bands.flat_map(|band| [profile_chart(scans, band), split_chart(fit, band)]).collect(), 2)
}

fn tidy(degrees: f64) -> f64 {
    (degrees * 1e6).round() / 1e6
}
