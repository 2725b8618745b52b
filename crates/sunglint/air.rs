//! The weather that holds at a time: what the scene says, then a station's record, then a radiosonde over the profile.

use std::sync::Arc;

use sunglint_atmosphere::{Moisture, Profile, SoundingLevel, graft};
use sunglint_dsl::scene::{self, Observed, Record, Utc, Weather};
use sunglint_dsl::{Diagnostic, Span};

use crate::times::iso;

/// The weather of a collection set as an experiment sees it.
#[derive(Clone, Debug, Default)]
pub struct Air {
    /// What the scene says.
    pub weather: Weather,
    /// Its radiosonde, over the profile.
    pub sounding: Option<Arc<Profile>>,
    elevation: f64,
}

impl Air {
    /// Weather over a site at `elevation` \[m\]; what is wrong with its radiosonde is told, each thing once.
    pub fn new(weather: Weather, elevation: f64, diagnostics: &mut Vec<Diagnostic>) -> Self {
        let sounding = weather.radiosonde.clone().and_then(|sounding| {
            let levels: Vec<SoundingLevel> = sounding.levels.iter().map(level).collect();
            let name = weather.profile.as_deref().unwrap_or(DEFAULT_PROFILE);
            let place = weather.spans.get("radiosonde").copied();
            match graft(&levels, name, elevation) {
                Ok(grafted) => {
                    for note in grafted.notes {
                        told(diagnostics, place, true, "A02", format!("{}: {note}", sounding.path), None);
                    }
                    Some(Arc::new(grafted.profile))
                }
                Err(error) => {
                    told(diagnostics, place, false, error.code, format!("{}: {error}", sounding.path), None);
                    None
                }
            }
        });
        Self { weather, sounding, elevation }
    }

    /// The profile that holds where nothing else is said.
    pub fn profile(&self) -> &str {
        self.weather.profile.as_deref().unwrap_or(DEFAULT_PROFILE)
    }

    /// Pressure \[hPa\] and temperature \[K\] at the site that bend the sun's rays at a time; `None` where neither scene nor
    /// record nor radiosonde says them.
    pub fn at_site(&self, utc: Utc) -> (Option<f64>, Option<f64>) {
        let (weather, _) = self.weather.observed(utc);
        let measured = |of: fn(&Profile, f64) -> f64| self.sounding.as_ref().map(|air| of(air, self.elevation));
        (
            weather.pressure.or_else(|| measured(Profile::pressure)),
            weather.temperature.or_else(|| measured(Profile::temperature)),
        )
    }

    /// The weather at a time, with what the record says then. A record that does not reach the time, or leaps over it,
    /// is told.
    pub fn at(&self, utc: Option<Utc>, diagnostics: &mut Vec<Diagnostic>) -> Self {
        let Some(record) = &self.weather.observations else { return self.clone() };
        let place = self.weather.spans.get("observations").copied();
        let path = &record.path;
        let Some(utc) = utc else {
            let message = format!("{path} is a record against time; this collection has the sun's angles and no time");
            told(diagnostics, place, false, "A02", message, Some("a weather of its own, with values in place of it"));
            return self.clone();
        };
        let (weather, asked) = self.weather.observed(utc);
        let mut alike: Vec<(String, Observed)> = Vec::new();
        for (field, observed) in asked {
            let span = |observed: &Observed| match observed {
                Observed::Value { across, .. } => *across,
                Observed::Beyond(first, last) => Some((*first, *last)),
            };
            let beyond = |observed: &Observed| matches!(observed, Observed::Beyond(..));
            match alike.iter_mut().find(|(_, o)| span(o) == span(&observed) && beyond(o) == beyond(&observed)) {
                Some((fields, _)) => *fields = format!("{fields}, {field}"),
                None => alike.push((field.to_string(), observed)),
            }
        }
        for (field, observed) in alike {
            match observed {
                Observed::Value { across: Some((a, b)), .. } => {
                    let hours = (b.0 - a.0) / 3600.0;
                    let message = format!(
                        "{path} has no {field} between {} and {}: {hours:.1} h are bridged by a straight line",
                        iso(a),
                        iso(b)
                    );
                    let longest = Record::LONGEST_GAP / 3600.0;
                    told(diagnostics, place, true, "A02", message, Some(&format!("a gap is more than {longest} h")));
                }
                Observed::Value { .. } => {}
                Observed::Beyond(first, last) => {
                    let message = format!(
                        "{path} does not reach the collection at {}: it has {field} from {} to {}",
                        iso(utc),
                        iso(first),
                        iso(last)
                    );
                    told(diagnostics, place, false, "A02", message, Some("was an offset from UTC forgotten?"));
                }
            }
        }
        Self { weather, ..self.clone() }
    }
}

const DEFAULT_PROFILE: &str = "us_standard";

fn level(level: &scene::SoundingLevel) -> SoundingLevel {
    SoundingLevel {
        pressure: level.pressure,
        altitude: level.altitude,
        temperature: level.temperature,
        moisture: level.moisture.map(|moisture| match moisture {
            scene::Moisture::RelativeHumidity(humidity) => Moisture::RelativeHumidity(humidity),
            scene::Moisture::DewPoint(point) => Moisture::DewPoint(point),
            scene::Moisture::MixingRatio(ratio) => Moisture::MixingRatio(ratio),
        }),
    }
}

/// The most that one file is told of: a record that ends early fails at every later time.
const MOST_TOLD: usize = 8;

fn told(
    diagnostics: &mut Vec<Diagnostic>,
    place: Option<Span>,
    warning: bool,
    code: &'static str,
    message: String,
    help: Option<&str>,
) {
    if diagnostics.iter().filter(|known| known.span == place && known.code == code).count() >= MOST_TOLD {
        return;
    }
    let diagnostic = match place {
        Some(place) if warning => Diagnostic::warning(code, place, message),
        Some(place) => Diagnostic::error(code, place, message),
        None => Diagnostic::whole(code, message),
    };
    let diagnostic = help.into_iter().fold(diagnostic, |diagnostic, help| diagnostic.help(help));
    if !diagnostics.contains(&diagnostic) {
        diagnostics.push(diagnostic);
    }
}
