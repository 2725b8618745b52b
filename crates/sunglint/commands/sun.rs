//! `sun`: where the sun is, and sunrise, sunset.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use serde_json::{Value, json};
use sunglint::atmosphere::{Place, SunPosition, sun_position, sunrise_sunset};
use sunglint::dsl::scene::Utc;
use sunglint::{Options, iso, parse_utc};

use super::{Failure, Outcome, plan_of, print, print_json};

const DAY: f64 = 86_400.0;

/// Where the sun is, and when it rises and sets
#[derive(Args)]
#[command(
    allow_negative_numbers = true,
    after_help = "\
Examples:
  sunglint sun --latitude 43.08 --longitude -77.67 --elevation 168 --at 1992-06-18T16:00:00Z
  sunglint sun examples/truth/truth.glint"
)]
pub struct Sun {
    /// A scene, whose times are listed
    #[arg(conflicts_with_all = ["latitude", "longitude", "at"])]
    scene: Option<PathBuf>,
    /// Latitude, north positive [deg]
    #[arg(long, required_unless_present = "scene")]
    latitude: Option<f64>,
    /// Longitude, east positive [deg]
    #[arg(long, required_unless_present = "scene")]
    longitude: Option<f64>,
    /// Elevation above sea level [m]
    #[arg(long, default_value_t = 0.0)]
    elevation: f64,
    /// Instant, for example 1992-06-18T16:00:00Z or 1992-06-18T12:00:00-04:00
    #[arg(long, required_unless_present = "scene")]
    at: Option<String>,
    /// Surface pressure, for the refraction [hPa]
    #[arg(long, default_value_t = 1013.25)]
    pressure: f64,
    /// Surface temperature, for the refraction [degC]
    #[arg(long, default_value_t = 12.0)]
    temperature: f64,
    /// As JSON
    #[arg(long)]
    json: bool,
}

impl Sun {
    pub fn run(&self) -> Outcome {
        match &self.scene {
            Some(scene) => self.of_scene(scene),
            None => self.at_place(),
        }
    }

    fn at_place(&self) -> Outcome {
        let bad = Failure::BadInput;
        let (Some(latitude), Some(longitude), Some(at)) = (self.latitude, self.longitude, &self.at) else {
            return Err(bad("give a scene, or --latitude, --longitude and --at".into()));
        };
        if !(-90.0..=90.0).contains(&latitude) || !(-360.0..=360.0).contains(&longitude) {
            return Err(bad("a latitude lies within -90 to 90 deg, a longitude within -360 to 360 deg".into()));
        }
        if !(0.0..=2000.0).contains(&self.pressure) || !(-150.0..=100.0).contains(&self.temperature) {
            return Err(bad("pressure lies within 0 to 2000 hPa, temperature within -150 to 100 degC".into()));
        }
        let utc = parse_utc(at).map_err(bad)?;
        let place =
            Place { latitude: latitude.to_radians(), longitude: longitude.to_radians(), elevation: self.elevation };
        let sun = sun_position(&place, utc.julian_date(), self.pressure, self.temperature + 273.15)
            .map_err(|error| bad(error.to_string()))?;
        // The day around the local solar noon nearest to the instant.
        let local = utc.0 + longitude / 15.0 * 3600.0;
        let start = (local / DAY).floor() * DAY - longitude / 15.0 * 3600.0;
        let events = sunrise_sunset(&place, Utc(start).julian_date(), Utc(start + DAY).julian_date())
            .map_err(|error| bad(error.to_string()))?;
        let instant = |day: Option<f64>| day.map(|day| iso(Utc((day - 2_440_587.5) * DAY)));
        let (rise, noon, set) = (instant(events.sunrise), instant(Some(events.solar_noon)), instant(events.sunset));
        if self.json {
            let mut value = position_json(utc, &sun);
            value["sunrise_utc"] = json!(rise);
            value["solar_noon_utc"] = json!(noon);
            value["sunset_utc"] = json!(set);
            print_json(&value);
        } else {
            let none = || "none on this day".to_string();
            print(format_args!(
                "{}\n  zenith            {:>10.5} deg (apparent {:.5} deg)\n  azimuth           {:>10.5} deg\n  \
                 Earth-Sun distance {:>9.7} au\n  sunrise           {}\n  solar noon        {}\n  sunset            {}\n",
                iso(utc),
                sun.true_zenith.to_degrees(),
                sun.apparent_zenith.to_degrees(),
                sun.azimuth.to_degrees(),
                sun.distance_au,
                rise.unwrap_or_else(none),
                noon.unwrap_or_default(),
                set.unwrap_or_else(none),
            ));
        }
        Ok(ExitCode::SUCCESS)
    }

    fn of_scene(&self, scene: &std::path::Path) -> Outcome {
        let plan = plan_of(scene, &Options { samples: Some(1), ..Options::default() }, &super::Deny::default(), true)?;
        let mut rows: Vec<Value> = Vec::new();
        let mut text = format!("{:<28} {:>12} {:>14} {:>12}\n", "time", "zenith_deg", "apparent_deg", "azimuth_deg");
        for run in plan.runs() {
            for moment in &run.moments {
                let Some(sun) = &moment.sun else { continue };
                if rows.iter().any(|row| row["frame"] == moment.label.as_str()) {
                    continue;
                }
                let apparent = sun.apparent.zenith().to_degrees();
                let (zenith, azimuth) = (sun.true_zenith.to_degrees(), sun.apparent.azimuth().to_degrees());
                text += &format!("{:<28} {zenith:>12.4} {apparent:>14.4} {azimuth:>12.4}\n", moment.label);
                rows.push(json!({
                    "frame": moment.label,
                    "time_utc": moment.utc.map(iso),
                    "zenith_deg": zenith,
                    "apparent_zenith_deg": apparent,
                    "azimuth_deg": azimuth,
                    "earth_sun_distance_au": sun.distance,
                }));
            }
        }
        if self.json {
            print_json(&Value::Array(rows))
        } else {
            print(text)
        }
        Ok(ExitCode::SUCCESS)
    }
}

fn position_json(utc: Utc, sun: &SunPosition) -> Value {
    json!({
        "time_utc": iso(utc),
        "zenith_deg": sun.true_zenith.to_degrees(),
        "apparent_zenith_deg": sun.apparent_zenith.to_degrees(),
        "azimuth_deg": sun.azimuth.to_degrees(),
        "earth_sun_distance_au": sun.distance_au,
    })
}
