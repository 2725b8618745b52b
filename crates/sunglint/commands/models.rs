//! `models [NAME]`: the registered models and their manuals.

use std::process::ExitCode;

use clap::Args;
use serde_json::{Value, json};
use sunglint::plugin::{Default, ModelInfo, Param, Role};
use sunglint::radiometry::Dimension;

use super::{Failure, Outcome, print, print_json};

const ROLES: [Role; 5] = [Role::Reflectance, Role::Atmosphere, Role::Algorithm, Role::Aerosol, Role::Detector];

/// The registered models, or the manual of one
#[derive(Args)]
#[command(after_help = "Example:\n  sunglint models split")]
pub struct Models {
    /// A model; several of one name (in different roles) are all shown
    name: Option<String>,
    /// As JSON
    #[arg(long)]
    json: bool,
}

impl Models {
    pub fn run(&self) -> Outcome {
        let catalog = sunglint::catalog();
        let wanted = |info: &ModelInfo| self.name.as_ref().is_none_or(|name| info.name == name);
        let found: Vec<(Role, &ModelInfo)> = (ROLES.iter())
            .flat_map(|role| catalog.of(*role).map(move |info| (*role, info)))
            .filter(|(_, info)| wanted(info))
            .collect();
        if found.is_empty() {
            let name = self.name.as_deref().unwrap_or_default();
            let known: Vec<&str> = ROLES.iter().flat_map(|role| catalog.of(*role)).map(|info| info.name).collect();
            return Err(Failure::BadInput(format!("no model is called `{name}`; there are: {}", known.join(", "))));
        }
        if self.json {
            print_json(&found.iter().map(|(role, info)| to_json(*role, info)).collect());
        } else if self.name.is_some() {
            found.iter().for_each(|(role, info)| print(manual(*role, info)));
        } else {
            for role in ROLES {
                let of_role: Vec<_> = found.iter().filter(|(r, _)| *r == role).collect();
                if !of_role.is_empty() {
                    print(format_args!("{}s\n", role.noun()));
                    of_role.iter().for_each(|(_, info)| print(format_args!("  {:<17} {}\n", info.name, info.summary)));
                }
            }
            print("\n`sunglint models NAME` prints a manual.\n");
        }
        Ok(ExitCode::SUCCESS)
    }
}

fn manual(role: Role, info: &ModelInfo) -> String {
    let mut text =
        format!("{} — {}: {}\n\n{}\n\nParameters\n", info.name, role.noun(), info.summary, info.manual.trim());
    if info.params.is_empty() {
        text.push_str("  none\n");
    }
    for param in info.params {
        text.push_str(&format!("  {:<22} {}\n", param.name, param.help));
        text.push_str(&format!("  {:<22}   {}; {}\n", "", param.kind.noun(), default_of(param)));
        if !param.excludes.is_empty() {
            text.push_str(&format!("  {:<22}   not beside {}\n", "", param.excludes.join(", ")));
        }
    }
    text.push('\n');
    text
}

fn unit_of(param: &Param) -> Dimension {
    match param.kind {
        sunglint::plugin::Kind::Quantity(of) | sunglint::plugin::Kind::Spectrum(of) => of,
        _ => Dimension::Fraction,
    }
}

fn default_of(param: &Param) -> String {
    let unit = unit_of(param).canonical();
    let said = match param.default {
        Default::Required => "must be said".to_string(),
        Default::Absent => "no default".to_string(),
        Default::Number(value) => format!("default {value} {unit}").trim_end().to_string(),
        Default::Word(word) => format!("default {word}"),
        Default::Switch(on) => format!("default {}", if on { "on" } else { "off" }),
        Default::Count(count) => format!("default {count}"),
    };
    let (low, high) = param.range;
    match (low.is_finite(), high.is_finite()) {
        (false, false) => said,
        (true, true) => format!("{said}; {low} to {high} {unit}").trim_end().to_string(),
        (true, false) => format!("{said}; at least {low} {unit}").trim_end().to_string(),
        (false, true) => format!("{said}; at most {high} {unit}").trim_end().to_string(),
    }
}

fn to_json(role: Role, info: &ModelInfo) -> Value {
    let params: Vec<Value> = (info.params.iter())
        .map(|param| {
            let finite = |x: f64| x.is_finite().then_some(x);
            let default = match param.default {
                Default::Required | Default::Absent => Value::Null,
                Default::Number(value) => json!(value),
                Default::Word(word) => json!(word),
                Default::Switch(on) => json!(on),
                Default::Count(count) => json!(count),
            };
            json!({
                "name": param.name,
                "type": param.kind.noun(),
                "unit": unit_of(param).canonical(),
                "required": param.default == Default::Required,
                "default": default,
                "least": finite(param.range.0),
                "most": finite(param.range.1),
                "help": param.help,
                "excludes": param.excludes,
            })
        })
        .collect();
    json!({"role": role.noun(), "name": info.name, "summary": info.summary, "manual": info.manual, "parameters": params})
}
