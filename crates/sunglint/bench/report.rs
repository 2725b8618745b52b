//! What a bench found as JSON and CSV.

use serde_json::{Value, json};

use super::{Bench, Errors, Part, Reference, Setting};

impl Bench {
    /// As JSON: references, settings and changes, each with its parts. Errors are relative, of 1.
    pub fn to_json(&self) -> Value {
        let of = |changed: bool| -> Vec<Value> {
            self.settings.iter().filter(|setting| setting.change.is_some() == changed).map(setting_json).collect()
        };
        let due: Vec<Value> = (self.due().iter())
            .map(|(reference, samples)| {
                json!({"experiment": reference.experiment, "sensor": reference.sensor, "samples": samples})
            })
            .collect();
        json!({
            "reference_algorithm": Self::exact(),
            "floor_relative": super::FLOOR,
            "references": self.references.iter().map(|reference| reference_json(reference)).collect::<Vec<_>>(),
            "settings": of(false),
            "changes": of(true),
            "reference_samples_due": due,
        })
    }

    /// As CSV: a row a setting, frame, band and material; `all` where they are pooled.
    pub fn to_csv(&self) -> String {
        let mut out = "experiment,sensor,parameter,from,to,samples,cpu_s,rays,on_front,frame,band,material_code,material,\
                       pixels,judged,relative_rmse,relative_systematic_rmse,relative_systematic_rmse_below,relative_noise,\
                       relative_reference_error,relative_bias,relative_bias_error,relative_percentile_99,relative_worst,\
                       worst_x_px,worst_y_px,worst_w_m2_sr_um,worst_reference_w_m2_sr_um,reference_samples\n"
            .to_string();
        for setting in &self.settings {
            let samples = self.references[setting.reference].samples;
            setting.parts.iter().for_each(|part| out += &row(setting, part, samples));
        }
        out
    }
}

fn reference_json(reference: &Reference) -> Value {
    json!({
        "experiment": reference.experiment,
        "sensor": reference.sensor,
        "samples": reference.samples,
        "samples_rendered": reference.samples_rendered,
        "relative_error": reference.error,
        "file": reference.file.display().to_string(),
    })
}

fn setting_json(setting: &Setting) -> Value {
    let mut value = json!({
        "experiment": setting.experiment,
        "sensor": setting.sensor,
        "samples": setting.samples,
        "cpu_s": setting.cpu_s,
        "rays": setting.rays,
        "reference": setting.reference,
        "errors": errors_json(setting.errors()),
        "parts": setting.parts.iter().skip(1).map(part_json).collect::<Vec<_>>(),
    });
    match &setting.change {
        Some(change) => {
            value["parameter"] = json!(change.parameter);
            value["from"] = json!(change.from);
            value["to"] = json!(change.to);
            value["same_image"] = json!(setting.same_image);
        }
        None => value["on_front"] = json!(setting.on_front),
    }
    value
}

fn part_json(part: &Part) -> Value {
    json!({
        "frame": part.frame,
        "band": part.band,
        "material_code": part.material.as_ref().map(|of| of.0),
        "material": part.material.as_ref().map(|of| of.1.as_str()),
        "errors": errors_json(&part.errors),
    })
}

fn errors_json(errors: &Errors) -> Value {
    json!({
        "pixels": errors.n,
        "judged": errors.is_judged(),
        "relative_rmse": errors.rmse,
        "relative_systematic_rmse": errors.systematic(),
        "relative_systematic_rmse_below": errors.systematic_below(),
        "relative_noise": errors.noise,
        "relative_reference_error": errors.reference_error,
        "relative_bias": errors.bias,
        "relative_bias_error": errors.bias_error,
        "relative_percentile_99": errors.p99,
        "worst": errors.worst.map(|worst| json!({
            "x_px": worst.x, "y_px": worst.y, "relative_error": worst.error,
            "radiance_w_m2_sr_um": worst.value, "reference_w_m2_sr_um": worst.reference,
        })),
    })
}

fn row(setting: &Setting, part: &Part, reference_samples: u32) -> String {
    let quoted = |text: &str| match text.contains([',', '"', '\n']) {
        true => format!("\"{}\"", text.replace('"', "\"\"")),
        false => text.to_string(),
    };
    let all = |text: Option<&String>| text.map_or("all".to_string(), |text| quoted(text));
    let number = |value: Option<f64>| value.map_or(String::new(), |value| value.to_string());
    let (errors, change) = (&part.errors, setting.change.as_ref());
    let said = |pick: fn(&super::Change) -> &String| change.map_or(String::new(), |change| quoted(pick(change)));
    let worst = |pick: fn(&super::WorstError) -> f64| number(errors.worst.as_ref().map(pick));
    let cells = [
        quoted(&setting.experiment),
        quoted(&setting.sensor),
        said(|change| &change.parameter),
        said(|change| &change.from),
        said(|change| &change.to),
        setting.samples.to_string(),
        setting.cpu_s.to_string(),
        setting.rays.to_string(),
        setting.on_front.to_string(),
        all(part.frame.as_ref()),
        all(part.band.as_ref()),
        part.material.as_ref().map_or("all".to_string(), |of| of.0.to_string()),
        all(part.material.as_ref().map(|of| &of.1)),
        errors.n.to_string(),
        errors.is_judged().to_string(),
        errors.rmse.to_string(),
        number(errors.systematic()),
        errors.systematic_below().to_string(),
        errors.noise.to_string(),
        errors.reference_error.to_string(),
        errors.bias.to_string(),
        errors.bias_error.to_string(),
        errors.p99.to_string(),
        worst(|worst| worst.error),
        worst(|worst| f64::from(worst.x)),
        worst(|worst| f64::from(worst.y)),
        worst(|worst| worst.value),
        worst(|worst| worst.reference),
        reference_samples.to_string(),
    ];
    cells.join(",") + "\n"
}
