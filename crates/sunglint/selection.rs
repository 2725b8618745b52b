//! Part of what a scene asks for: `experiment=…`, `sensor=…`, `time=…`, `band=…`, `crop=…`, `scale=…`.

use std::fmt;

use sunglint_dsl::nearest;
use sunglint_tracer::Tile;

use crate::{Options, times};

/// Keys of a selection.
const KEYS: [&str; 6] = ["experiment", "sensor", "time", "band", "crop", "scale"];

/// A rectangle of the whole view, counted from 0 at its top left.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Crop {
    /// Left column.
    pub x: u32,
    /// Top row.
    pub y: u32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl fmt::Display for Crop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{},{},{}x{}", self.x, self.y, self.width, self.height)
    }
}

impl Crop {
    /// `X,Y,WxH`
    fn parse(text: &str) -> Result<Self, String> {
        let parts = || {
            let (x, rest) = text.split_once(',')?;
            let (y, size) = rest.split_once(',')?;
            let (width, height) = size.split_once(['x', 'X'])?;
            let number = |text: &str| text.trim().parse::<u32>().ok();
            Some(Self { x: number(x)?, y: number(y)?, width: number(width)?, height: number(height)? })
        };
        match parts() {
            Some(crop) if crop.width > 0 && crop.height > 0 => Ok(crop),
            Some(_) => Err(format!("crop `{text}` holds no pixel")),
            None => {
                Err(format!("crop `{text}`: write X,Y,WIDTHxHEIGHT in pixels of the whole view: crop=100,80,64x48"))
            }
        }
    }

    /// The crop as a window of a view of `pixels`; `None` where it reaches beyond the view.
    pub(crate) fn within(self, pixels: (u32, u32)) -> Option<Tile> {
        let right = self.x.checked_add(self.width)?;
        let bottom = self.y.checked_add(self.height)?;
        (right <= pixels.0 && bottom <= pixels.1).then_some(Tile {
            x: self.x,
            y: self.y,
            width: self.width,
            height: self.height,
        })
    }
}

impl Options {
    /// Whether every experiment, sensor, time and band is kept.
    pub(crate) fn is_whole(&self) -> bool {
        [&self.experiments, &self.sensors, &self.times, &self.bands].iter().all(|names| names.is_empty())
    }

    /// Narrows the options by one `KEY=VALUE`, split at the first `=`, since names of runs contain `=` too. `experiment`,
    /// `sensor`, `time` and `band` add up when repeated; `crop` and `scale` are said once.
    ///
    /// # Errors
    /// An unknown key (with the nearest), an empty or malformed value, a second crop or scale. Whether the scene has what is
    /// named, [`crate::Plan::new`] says.
    pub fn narrow(&mut self, text: &str) -> Result<(), String> {
        let (key, value) = text
            .split_once('=')
            .ok_or_else(|| format!("`{text}`: write KEY=VALUE with one of the keys {}", KEYS.join(", ")))?;
        let (key, value) = (key.trim(), value.trim());
        if value.is_empty() {
            return Err(format!("`{key}=` says no value"));
        }
        match key {
            "experiment" => self.experiments.push(value.to_string()),
            "sensor" => self.sensors.push(value.to_string()),
            "time" => self.times.push(value.to_string()),
            "band" => self.bands.push(value.to_string()),
            "crop" if self.crop.is_some() => return Err("`crop` is said twice".into()),
            "crop" => self.crop = Some(Crop::parse(value)?),
            "scale" if self.scale.is_some() => return Err("`scale` is said twice".into()),
            "scale" => {
                let scale: Option<f64> = value.parse().ok().filter(|scale| *scale > 0.0 && *scale <= 64.0);
                self.scale = Some(scale.ok_or_else(|| {
                    format!("scale `{value}`: write a factor above 0, at most 64, for example scale=0.25")
                })?);
            }
            _ => {
                let near = nearest(key, KEYS).map_or(String::new(), |near| format!("; `{near}`?"));
                return Err(format!("`{key}` is none of the keys {}{near}", KEYS.join(", ")));
            }
        }
        Ok(())
    }

    /// Pixels of a sensor that has `own` pixels.
    pub(crate) fn pixels_of(&self, own: (u32, u32)) -> Option<(u32, u32)> {
        let scaled = |n: u32, scale: f64| ((f64::from(n) * scale).round() as u32).clamp(1, 65_536);
        self.pixels.or_else(|| self.scale.map(|scale| (scaled(own.0, scale), scaled(own.1, scale))))
    }
}

/// Whether nothing is wanted in particular, or `holds` for one thing that is.
pub(crate) fn wanted(wanted: &[String], holds: impl Fn(&str) -> bool) -> bool {
    wanted.is_empty() || wanted.iter().any(|wanted| holds(wanted))
}

/// Whether `wanted` selects the run `name`: its name, the name before its settings (`haze` of
/// `haze/reflectance=phong,visibility=5km`), or that with some of its settings (`haze/visibility=5km`).
pub(crate) fn is_experiment(wanted: &str, name: &str) -> bool {
    let parts = |text: &str| -> (String, Vec<String>) {
        match text.split_once('/') {
            Some((base, settings)) => (base.into(), settings.split(',').map(str::to_string).collect()),
            None => (text.into(), Vec::new()),
        }
    };
    let ((base, settings), (own, has)) = (parts(wanted), parts(name));
    wanted == name || (base == own && settings.iter().all(|setting| has.contains(setting)))
}

/// Whether `wanted` selects the frame `label`: its label, the instant in any zone, or the beginning of its label
/// (`1992-06-18` is that day in UTC).
pub(crate) fn is_time(wanted: &str, label: &str) -> bool {
    wanted == label
        || times::parse_utc(wanted).is_ok_and(|utc| label == times::label(utc))
        || label.strip_prefix(wanted).is_some_and(|rest| !rest.is_empty() && wanted.len() >= 4)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_selection_is_split_at_its_first_equals_sign() {
        let mut options = Options::default();
        for text in ["experiment=haze/reflectance=phong,visibility=5km", "band=red", "band=nir", "crop=1,2,3x4"] {
            options.narrow(text).unwrap();
        }
        assert_eq!(options.experiments, ["haze/reflectance=phong,visibility=5km"]);
        assert_eq!(options.bands, ["red", "nir"]);
        assert_eq!(options.crop, Some(Crop { x: 1, y: 2, width: 3, height: 4 }));
        assert!(options.narrow("crop=1,2,3x4").is_err_and(|e| e.contains("twice")));
        assert!(options.narrow("sensors=roof").is_err_and(|e| e.contains("`sensor`?")));
        for bad in ["red", "band=", "=x", "crop=0,0,0x3", "crop=1,2", "crop=-1,0,2x2", "scale=0", "scale=nan"] {
            assert!(Options::default().narrow(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn a_crop_stays_within_its_view() {
        let crop = |text: &str| Crop::parse(text).unwrap();
        assert!(crop("0,0,64x48").within((64, 48)).is_some());
        assert!(crop("1,0,64x48").within((64, 48)).is_none());
        assert!(crop("4294967295,0,2x1").within((64, 48)).is_none());
    }

    #[test]
    fn the_runs_of_a_sweep_go_by_name_by_experiment_and_by_some_settings() {
        let run = "haze/reflectance=phong,visibility=5km";
        for wanted in [run, "haze", "haze/visibility=5km", "haze/visibility=5km,reflectance=phong"] {
            assert!(is_experiment(wanted, run), "{wanted}");
        }
        for wanted in ["haz", "haze/visibility=10km", "visibility=5km", "haze/"] {
            assert!(!is_experiment(wanted, run), "{wanted}");
        }
    }

    #[test]
    fn times_go_by_label_by_instant_and_by_the_day() {
        let label = "1992-06-18T160000Z";
        for wanted in [label, "1992-06-18T16:00:00Z", "1992-06-18T12:00:00-04:00", "1992-06-18", "1992-06-18T16"] {
            assert!(is_time(wanted, label), "{wanted}");
        }
        for wanted in ["1992-06-19", "199", "1992-06-18T16:00:00-04:00"] {
            assert!(!is_time(wanted, label), "{wanted}");
        }
        assert!(is_time("no_sun", "no_sun"));
    }
}
