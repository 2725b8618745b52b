//! `fit --model` and `fit --compare`: a goniometer's scans fitted by models.

use std::io::Write;
use std::path::Path;
use std::process::ExitCode;

use serde_json::{Value, json};
use sunglint::inspection::{model_fit_chart, unknown_name};
use sunglint::reflectance::{
    BandModelFit, FitOptions, FittedParameter, ModelFit, ModelFitError, Scans, fit_model, fits_metals, fitted_models,
};
use sunglint::write_whole;

use super::fit::{band_json, degrees};
use super::{Failure, Outcome, note, print, print_json, write_pictures};

/// Where the answer goes.
pub struct Output<'a> {
    /// A table of readings, fitted values and misfits.
    pub table: Option<&'a Path>,
    pub plot: Option<&'a Path>,
    pub json: bool,
    pub quiet: bool,
}

/// Fits one model.
pub fn one(path: &Path, scans: &Scans, model: &str, options: &FitOptions, to: &Output) -> Outcome {
    let fit = fit_model(scans, model, options).map_err(|error| told(path, &error))?;
    if to.json {
        print_json(&to_json(scans, &fit));
    } else {
        print(to_text(path, scans, &fit));
    }
    if let Some(path) = to.table {
        let text = table(scans, &fit);
        write_whole(path, |out| out.write_all(text.as_bytes())).map_err(|e| Failure::Unfinished(e.to_string()))?;
        if !to.quiet {
            note(&format!("wrote {}", path.display()));
        }
    }
    let picture = to.plot.map(|path| (path, model_fit_chart(scans, &fit)));
    write_pictures(&picture.into_iter().collect::<Vec<_>>(), to.quiet)?;
    Ok(ExitCode::SUCCESS)
}

fn told(path: &Path, error: &ModelFitError) -> Failure {
    let known: Vec<&str> = fitted_models().collect();
    Failure::BadInput(match error {
        ModelFitError::Unknown(name) => unknown_name("model that can be fitted, called", name, &known),
        error => format!("{}: {error}", path.display()),
    })
}

/// Fits several models and ranks them.
pub fn several(path: &Path, scans: &Scans, models: &str, json: bool) -> Outcome {
    let all: Vec<&str> = fitted_models().collect();
    let wanted: Vec<&str> = match models.trim() {
        "" => all.clone(),
        some => some.split(',').map(str::trim).filter(|name| !name.is_empty()).collect(),
    };
    if let Some(name) = wanted.iter().find(|name| !all.contains(name)) {
        return Err(Failure::BadInput(unknown_name("model that can be fitted, called", name, &all)));
    }
    let mut ranked = Vec::new();
    let mut left_out = Vec::new();
    for name in &wanted {
        // As a dielectric, and as a metal where the model has a k.
        let metal = FitOptions { free: vec!["k".into()], ..FitOptions::default() };
        let ways = [Some(FitOptions::default()), fits_metals(name).then_some(metal)];
        for (options, of) in ways.iter().flatten().zip(["", " of metal"]) {
            match fit_model(scans, name, options) {
                Ok(fit) => {
                    let cost = fit.evaluation_ns();
                    ranked.push((format!("{name}{of}"), fit, cost));
                }
                Err(error) => left_out.push((format!("{name}{of}"), error.to_string())),
            }
        }
    }
    if ranked.is_empty() {
        let lines: Vec<String> = left_out.iter().map(|(_, why)| format!("{}: {why}", path.display())).collect();
        return Err(Failure::BadInput(lines.join("\nerror: ")));
    }
    ranked.sort_by(|a, b| a.1.weighted_rms().total_cmp(&b.1.weighted_rms()));
    // Whether another is no worse in all three and better in one.
    let beaten = |(_, fit, cost): &(String, ModelFit, f64)| {
        ranked.iter().any(|(_, other, other_cost)| {
            let (a, b) = (fit.weighted_rms(), other.weighted_rms());
            let no_worse = b <= a && other.n_free <= fit.n_free && *other_cost <= 1.1 * cost;
            no_worse && (b < 0.99 * a || other.n_free < fit.n_free)
        })
    };
    if json {
        let rows: Vec<Value> = (ranked.iter())
            .map(|entry| {
                let (name, fit, cost) = entry;
                json!({
                    "model": name,
                    "weighted_rms": fit.weighted_rms(),
                    "rms_brf": fit.rms(),
                    "free_parameters": fit.n_free,
                    "evaluation_ns": cost,
                    "unbeaten": !beaten(entry),
                    "in_a_scene": fit.in_a_scene(),
                })
            })
            .collect();
        let left_out: Vec<Value> = left_out.iter().map(|(model, why)| json!({"model": model, "why": why})).collect();
        print_json(&json!({"scans": path.to_string_lossy(), "models": rows, "left_out": left_out}));
        return Ok(ExitCode::SUCCESS);
    }
    let unit = match ranked.first().and_then(|(_, fit, _)| fit.bands.first()).is_some_and(|band| band.errors_stated) {
        true => "standard errors",
        false => "of the value",
    };
    let mut text = format!("{}\n  misfit is the root mean square of (model - BRF), in {unit}\n", path.display());
    text += &format!("  {:26} {:>10} {:>10} {:>5} {:>9}\n", "model", "misfit", "rms BRF", "free", "ns/pair");
    for entry in &ranked {
        let (name, fit, cost) = entry;
        let mark = if beaten(entry) { "" } else { "  unbeaten" };
        text += &format!(
            "  {:26} {:>10.4} {:>10.5} {:>5} {cost:>9.0}{mark}\n",
            name,
            fit.weighted_rms(),
            fit.rms(),
            fit.n_free
        );
    }
    for (_, why) in &left_out {
        text += &format!("  left out: {why}\n");
    }
    print(text);
    Ok(ExitCode::SUCCESS)
}

fn to_text(path: &Path, scans: &Scans, fit: &ModelFit) -> String {
    let mut text = format!("{}, model {}\n", path.display(), fit.model);
    for band in &fit.bands {
        let (chi, dof) = (band.chi_square, band.degrees_of_freedom);
        text += &format!("\n{}: {} readings, {} free parameters\n", band.band, band.readings.len(), fit.n_free);
        for parameter in &band.parameters {
            let FittedParameter { name, value, error, fixed, at_bound } = parameter;
            let after = match (error, fixed, at_bound) {
                (Some(error), ..) => format!("± {error:.3e}"),
                (None, true, _) => "held".to_string(),
                (None, _, true) => "on its bound".to_string(),
                _ => "not determined".to_string(),
            };
            text += &format!("  {name:12} {value:>12.6}  {after}\n");
        }
        text += &match band.errors_stated {
            true => format!("  chi square {chi:.2} of {dof} degrees of freedom"),
            false => {
                let of = 100.0 * (chi / dof as f64).sqrt();
                format!("  no errors are stated: {of:.2} % of the value a reading follow from the fit")
            }
        };
        text += &format!("; rms {:.5} in BRF, {:.2} % of the mean\n", band.rms, 100.0 * band.relative_rms);
        if let Some((reading, model)) = band.worst() {
            text += &format!(
                "  furthest off at illumination {}, view {} deg: {model:.5} for {:.5}\n",
                degrees(scans.illuminations()[reading.illumination]),
                degrees(scans.views()[reading.view]),
                reading.brf
            );
        }
        let free: Vec<usize> = (0..band.parameters.len()).filter(|i| band.parameters[*i].error.is_some()).collect();
        if free.len() > 1 {
            text += "  correlations\n";
            for i in &free {
                let row: Vec<String> = free.iter().map(|j| format!("{:>7.3}", correlation(band, *i, *j))).collect();
                text += &format!("    {:12} {}\n", band.parameters[*i].name, row.join(" "));
            }
        }
    }
    text + &format!("\nin a scene: {}\n", fit.in_a_scene())
}

fn correlation(band: &BandModelFit, i: usize, j: usize) -> f64 {
    let c = &band.covariance;
    c[i][j] / (c[i][i] * c[j][j]).sqrt()
}

fn to_json(scans: &Scans, fit: &ModelFit) -> Value {
    let bands: Vec<Value> = (fit.bands.iter())
        .map(|band| {
            let parameters: Vec<Value> = (band.parameters.iter())
                .map(|p| {
                    json!({
                        "name": p.name, "value": p.value, "standard_error": p.error,
                        "held": p.fixed, "on_its_bound": p.at_bound,
                    })
                })
                .collect();
            let readings: Vec<Value> = (band.readings.iter())
                .map(|(reading, model)| {
                    json!({
                        "illumination_zenith_deg": degrees(scans.illuminations()[reading.illumination]),
                        "view_zenith_deg": degrees(scans.views()[reading.view]),
                        "brf": reading.brf,
                        "model_brf": model,
                    })
                })
                .collect();
            let mut object = band_json(&band.band);
            let rest = json!({
                "parameters": parameters,
                "covariance": band.covariance,
                "chi_square": band.chi_square,
                "degrees_of_freedom": band.degrees_of_freedom,
                "errors_stated": band.errors_stated,
                "rms_brf": band.rms,
                "relative_rms": band.relative_rms,
                "readings": readings,
            });
            if let (Some(object), Value::Object(rest)) = (object.as_object_mut(), rest) {
                object.extend(rest);
            }
            object
        })
        .collect();
    json!({"model": fit.model, "free_parameters": fit.n_free, "in_a_scene": fit.in_a_scene(), "bands": bands})
}

/// Readings with the fitted values.
fn table(scans: &Scans, fit: &ModelFit) -> String {
    let mut text = String::from("band,illumination_zenith_deg,view_zenith_deg,brf,model_brf,misfit_brf\n");
    for band in &fit.bands {
        for (reading, model) in &band.readings {
            text += &format!(
                "{},{},{},{},{model},{}\n",
                band.band,
                degrees(scans.illuminations()[reading.illumination]),
                degrees(scans.views()[reading.view]),
                reading.brf,
                model - reading.brf
            );
        }
    }
    text
}
