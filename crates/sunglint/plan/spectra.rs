//! Spectra of a run: which are used, where they have corners, whether they cover the bands.

use sunglint_dsl::scene::{Experiment, ModelUse};
use sunglint_dsl::{Diagnostic, Scene};
use sunglint_plugin::{Args, SpectralValue, TableKey, Value};
use sunglint_sensor::Band;

use super::Planner;
use crate::grid;

impl Planner<'_, '_> {
    /// The models that an experiment uses of materials (with their index).
    pub(super) fn model_uses<'m>(scene: &'m Scene, experiment: &Experiment) -> Vec<(Option<usize>, &'m ModelUse)> {
        (experiment.models.iter().enumerate())
            .filter_map(|(m, chosen)| chosen.map(|i| (Some(m), &scene.materials[m].models[i])))
            .filter(|(m, _)| m.is_none_or(|m| scene.materials[m].used))
            .collect()
    }

    /// Spectra that do not cover a band they are used in.
    pub(super) fn cover(&mut self, uses: &[(Option<usize>, &ModelUse)], bands: &[Band]) {
        let scene = self.scene;
        for (material, use_) in uses.iter().copied() {
            for (name, value) in use_.args.iter() {
                let place = use_.param_spans.get(name).copied().or(use_.span);
                let place = match (name, material) {
                    ("reflectance", Some(m)) => scene.materials[m].spans.get("reflectance").copied().or(place),
                    _ => place,
                };
                let Some(place) = place else { continue };
                match value {
                    Value::Spectrum(value) => self.cover_value(value, bands, place, name, "M04"),
                    // Its parts' spectra are told of at the mixture.
                    Value::Mixture(parts) => {
                        for value in parts.iter().flat_map(|part| part.args.flattened()) {
                            if let Value::Spectrum(value) = value {
                                self.cover_value(value, bands, place, "a part of the mixture", "M04");
                            }
                        }
                    }
                    _ => {}
                }
            }
        }
        for material in scene.materials.iter().filter(|material| material.used) {
            if let Some(value) = &material.emission {
                let place = material.spans.get("emission").copied().unwrap_or(material.span);
                self.cover_value(value, bands, place, "emission", "M04");
            }
        }
    }

    pub(super) fn cover_value(
        &mut self,
        value: &SpectralValue,
        bands: &[Band],
        place: sunglint_dsl::Span,
        name: &str,
        code: &'static str,
    ) {
        for band in bands {
            let (lower, upper) = band.support();
            let message = match value {
                SpectralValue::Constant(_) => continue,
                SpectralValue::Curve(curve) if curve.covers(lower, upper) => continue,
                SpectralValue::Curve(curve) => {
                    let (first, last) = curve.domain();
                    let gap = |a: f64, b: f64| format!("{:.0}..{:.0} nm", a * 1e3, b * 1e3);
                    let gaps: Vec<String> = [(lower, first.min(upper)), (last.max(lower), upper)]
                        .into_iter()
                        .filter(|(a, b)| b > a)
                        .map(|(a, b)| gap(a, b))
                        .collect();
                    format!("`{name}` does not cover band `{}`: it lacks {}", band.name, gaps.join(" and "))
                }
                SpectralValue::PerBand(values) if values.iter().any(|(name, _)| *name == band.name) => continue,
                SpectralValue::PerBand(_) => format!("`{name}` has no value for band `{}`", band.name),
            };
            let help = match value {
                SpectralValue::PerBand(_) if code == "V03" => "give a value for every band of the sensor",
                SpectralValue::PerBand(_) => "give a value for every band in which it is used",
                _ => "widen the table, or say `extrapolate hold` behind it",
            };
            let known = self.diagnostics.iter().any(|d| d.span == Some(place) && d.message == message);
            if !known {
                self.diagnostics.push(Diagnostic::error(code, place, message).help(help));
            }
        }
    }
}

pub(super) fn corners_of(args: &Args) -> Vec<Vec<f64>> {
    args.flattened()
        .into_iter()
        .filter_map(|value| match value {
            Value::Spectrum(value) => Some(grid::corners(value)),
            Value::Table(table) => match &table.key {
                TableKey::Wavelength(wavelengths) => {
                    let mut nodes = wavelengths.clone();
                    nodes.sort_by(f64::total_cmp);
                    nodes.dedup();
                    Some(nodes)
                }
                _ => None,
            },
            _ => None,
        })
        .collect()
}

pub(super) fn is_per_band(args: &Args) -> bool {
    args.flattened().into_iter().any(|value| match value {
        Value::Spectrum(SpectralValue::PerBand(_)) => true,
        Value::Table(table) => matches!(table.key, TableKey::Band(_)),
        _ => false,
    })
}
