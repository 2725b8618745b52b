//! A column of air, a sun and a line of sight said by flags: a scene of one point, written for the user and held against
//! the language like any other, whose findings point at the flags.

use std::ops::Range;

use clap::Args;
use sunglint::dsl::{FileId, Span};
use sunglint::inspection::air_plan_of;
use sunglint::plugin::{Kind, Role};
use sunglint::{Diagnostic, Plan, Refused, Sources, parse_utc};

use super::Failure;

/// Name of the text that findings point into.
pub const COMMAND_LINE: &str = "command line";

/// Air, sun and line of sight without a scene
#[derive(Args, Default)]
#[group(multiple = true, conflicts_with = "scene")]
#[command(next_help_heading = "Without a scene (values as in the language; an angle without a unit is in degrees)")]
pub struct Column {
    /// Apparent zenith angle of the sun
    #[arg(long, value_name = "ANGLE", allow_hyphen_values = true)]
    sun_zenith: Option<String>,
    /// Azimuth of the sun, clockwise from north [default: 180]
    #[arg(long, value_name = "ANGLE", allow_hyphen_values = true, requires = "sun_zenith")]
    sun_azimuth: Option<String>,
    /// Latitude, north positive: with --longitude and --at in place of the sun's angles
    #[arg(long, value_name = "ANGLE", allow_hyphen_values = true, requires = "longitude")]
    latitude: Option<String>,
    /// Longitude, east positive
    #[arg(long, value_name = "ANGLE", allow_hyphen_values = true, requires = "latitude")]
    longitude: Option<String>,
    /// Elevation of the ground above sea level [default: 0 m]
    #[arg(long, value_name = "LENGTH", allow_hyphen_values = true)]
    elevation: Option<String>,
    /// Profile of the air: us_standard, tropical, midlatitude_summer, …
    #[arg(long, value_name = "NAME")]
    profile: Option<String>,
    /// A radiosonde's ascent, over the profile
    #[arg(long, value_name = "FILE.csv")]
    radiosonde: Option<String>,
    /// Visibility, for example "23 km"
    #[arg(long, value_name = "LENGTH", allow_hyphen_values = true)]
    visibility: Option<String>,
    /// Optical depth of the aerosol at 550 nm
    #[arg(long, value_name = "NUMBER", allow_hyphen_values = true)]
    aod: Option<String>,
    /// Aerosol model, for example rural or "angstrom { … }"
    #[arg(long, value_name = "MODEL")]
    aerosol: Option<String>,
    /// Pressure at the ground, for example "990 hPa"
    #[arg(long, value_name = "PRESSURE", allow_hyphen_values = true)]
    pressure: Option<String>,
    /// Temperature at the ground, for example "15 degC"
    #[arg(long, value_name = "TEMPERATURE", allow_hyphen_values = true)]
    temperature: Option<String>,
    /// Relative humidity at the ground, for example "60 %"
    #[arg(long, value_name = "PERCENT", allow_hyphen_values = true)]
    humidity: Option<String>,
    /// Column of water, for example "2 g/cm2"
    #[arg(long, value_name = "COLUMN", allow_hyphen_values = true)]
    water: Option<String>,
    /// Column of ozone, for example "320 DU"
    #[arg(long, value_name = "COLUMN", allow_hyphen_values = true)]
    ozone: Option<String>,
    /// Column of NO2, for example "0.2 DU"
    #[arg(long, value_name = "COLUMN", allow_hyphen_values = true)]
    no2: Option<String>,
    /// A layer of cloud: "optical_depth 5, base 1 km, top 2 km"; may be said more than once
    #[arg(long, value_name = "LAYER")]
    cloud: Vec<String>,
    /// Atmosphere [default: the language's]
    #[arg(long, value_name = "MODEL")]
    model: Option<String>,
    /// A parameter of the atmosphere, for example streams=16; may be said more than once
    #[arg(long, value_name = "KEY=VALUE", allow_hyphen_values = true)]
    set: Vec<String>,
    /// Reflectance of the ground: a number, "[400 nm 0.1, 1000 nm 0.4]" or a quoted file [default: 0]
    #[arg(long, value_name = "SPECTRUM", allow_hyphen_values = true)]
    albedo: Option<String>,
    /// Altitude above sea level of the sensor, which looks at the ground [default: 100 km]
    #[arg(long, value_name = "LENGTH", allow_hyphen_values = true)]
    sensor_altitude: Option<String>,
    /// Zenith angle of the sensor, seen from the target [default: 0]
    #[arg(long, value_name = "ANGLE", allow_hyphen_values = true)]
    view_zenith: Option<String>,
    /// Azimuth of the sensor, seen from the target [default: 0]
    #[arg(long, value_name = "ANGLE", allow_hyphen_values = true)]
    view_azimuth: Option<String>,
    /// Bands at even steps [default: "400..1000 nm every 10 nm fwhm 10 nm"; without `fwhm` it is the step]
    #[arg(long, value_name = "RANGE every STEP")]
    wavelengths: Option<String>,
    /// A band: "red 600..700 nm", "nir centre 850 nm fwhm 20 nm"; may be said more than once
    #[arg(long = "add-band", value_name = "BAND")]
    add_band: Vec<String>,
    /// The bands of a set, for example sentinel2a
    #[arg(long, value_name = "SET")]
    bands: Option<String>,
}

impl Column {
    /// Plans the scene that the flags stand for; `at` is the instant of the collection.
    ///
    /// # Errors
    /// Those of the scene, at the flags.
    pub fn plan(&self, at: Option<&str>) -> Result<Plan, Failure> {
        let written = self.written(at)?;
        let checked = sunglint::check_text(COMMAND_LINE, written.text.as_str());
        match air_plan_of(checked, None, None) {
            Ok(mut plan) => {
                (plan.warnings, plan.sources) = written.pointed(&plan.warnings, &plan.sources);
                Ok(plan)
            }
            Err(error) => match Failure::from(error) {
                Failure::Refused(refused) => {
                    let (diagnostics, sources) = written.pointed(&refused.diagnostics, &refused.sources);
                    Err(Refused { sources, diagnostics }.into())
                }
                other => Err(other),
            },
        }
    }

    fn written(&self, at: Option<&str>) -> Result<Written, Failure> {
        let mut out = Written::default();
        out.raw("glint 1\n");
        self.site(&mut out)?;
        self.sun(at, &mut out)?;
        out.raw("weather {\n");
        let fields = [
            ("profile", &self.profile),
            ("visibility", &self.visibility),
            ("aod", &self.aod),
            ("aerosol", &self.aerosol),
            ("pressure", &self.pressure),
            ("temperature", &self.temperature),
            ("humidity", &self.humidity),
            ("water", &self.water),
            ("ozone", &self.ozone),
            ("no2", &self.no2),
        ];
        for (field, value) in fields {
            out.said(field, field, value.as_deref(), Form::Bare)?;
        }
        out.said("radiosonde", "radiosonde", self.radiosonde.as_deref(), Form::File)?;
        for cloud in &self.cloud {
            out.said("cloud", "cloud", Some(cloud), Form::Block)?;
        }
        out.raw("}\n");
        self.atmosphere(&mut out)?;
        out.raw("material ground { ideal {\n");
        out.said("albedo", "diffuse", self.albedo.as_deref(), Form::Bare)?;
        if self.albedo.is_none() {
            out.raw("diffuse 0\n");
        }
        out.raw("} }\nground ground\n");
        self.sensor(&mut out)?;
        out.raw("experiment air { samples 16 }\n");
        Ok(out)
    }

    fn site(&self, out: &mut Written) -> Result<(), Failure> {
        if [&self.latitude, &self.longitude, &self.elevation].iter().all(|value| value.is_none()) {
            return Ok(());
        }
        out.raw("site {\n");
        out.said("latitude", "latitude", self.latitude.as_deref(), Form::Angle)?;
        out.said("longitude", "longitude", self.longitude.as_deref(), Form::Angle)?;
        if self.latitude.is_none() && self.longitude.is_none() {
            // The sun's angles stand for the place.
            out.raw("latitude 0 deg, longitude 0 deg\n");
        }
        out.said("elevation", "elevation", self.elevation.as_deref(), Form::Bare)?;
        out.raw("}\n");
        Ok(())
    }

    fn sun(&self, at: Option<&str>, out: &mut Written) -> Result<(), Failure> {
        let bad = |message: &str| Err(Failure::BadInput(message.to_string()));
        out.raw("collect {\n");
        match (&self.sun_zenith, at) {
            (Some(_), Some(_)) => return bad("--sun-zenith and --at both say where the sun is; say one"),
            (None, None) => {
                return bad(
                    "give a scene, or say where the sun is: --sun-zenith ANGLE, or --latitude, --longitude and --at",
                );
            }
            (Some(zenith), None) => {
                out.raw("sun ");
                out.on_a_line("sun-zenith", "zenith", zenith, Form::Angle)?;
                out.raw(" ");
                match &self.sun_azimuth {
                    Some(azimuth) => out.on_a_line("sun-azimuth", "azimuth", azimuth, Form::Angle)?,
                    None => out.raw("azimuth 180 deg"),
                }
                out.raw("\n");
            }
            (None, Some(_)) if self.latitude.is_none() && self.longitude.is_none() => {
                return bad("--at needs --latitude and --longitude: the sun's place depends on them");
            }
            (None, Some(at)) => {
                // As other commands take it; what they do not is held against the language.
                let utc = parse_utc(at).map_or_else(|_| at.to_string(), sunglint::iso);
                out.said_as("at", "at", at, &utc)?;
            }
        }
        out.raw("}\n");
        Ok(())
    }

    fn atmosphere(&self, out: &mut Written) -> Result<(), Failure> {
        if self.model.is_none() && self.set.is_empty() {
            return Ok(());
        }
        match &self.model {
            Some(model) => out.on_a_line("model", "atmosphere", model, Form::Bare)?,
            None => out.raw(&format!("atmosphere {}", sunglint::dsl::DEFAULT_ATMOSPHERE)),
        }
        let catalog = sunglint::catalog();
        let model = self.model.as_deref().unwrap_or(sunglint::dsl::DEFAULT_ATMOSPHERE);
        let info = catalog.find(Role::Atmosphere, model.trim());
        out.raw(" {\n");
        for said in &self.set {
            let Some((key, value)) = said.split_once('=') else {
                return Err(Failure::BadInput(format!("--set {said}: write KEY=VALUE, for example streams=16")));
            };
            let file = info.and_then(|info| info.param(key.trim())).is_some_and(|p| matches!(p.kind, Kind::File));
            let form = if file { Form::File } else { Form::Bare };
            out.parameter("set", key.trim(), value.trim(), form)?;
        }
        out.raw("}\n");
        Ok(())
    }

    fn sensor(&self, out: &mut Written) -> Result<(), Failure> {
        out.raw("sensor sensor {\nlook_at (0 0 0) m\n");
        for (flag, key, value, default, form) in [
            ("sensor-altitude", "altitude", &self.sensor_altitude, "100 km", Form::Bare),
            ("view-zenith", "view_zenith", &self.view_zenith, "0 deg", Form::Angle),
            ("view-azimuth", "view_azimuth", &self.view_azimuth, "0 deg", Form::Angle),
        ] {
            match value {
                Some(value) => out.said(flag, key, Some(value), form)?,
                None => out.raw(&format!("{key} {default}\n")),
            }
        }
        out.raw("field_of_view 1 arcsec\npixels 1 x 1\n");
        out.said("bands", "bands", self.bands.as_deref(), Form::Bare)?;
        for band in &self.add_band {
            out.said("add-band", "band", Some(band), Form::Bare)?;
        }
        match self.wavelengths.as_deref() {
            Some(range) => {
                let step = range.split_once("every").map(|(_, step)| step.trim()).filter(|_| !range.contains("fwhm"));
                out.on_a_line("wavelengths", "bands", range, Form::Bare)?;
                out.raw(&step.map_or(String::new(), |step| format!(" fwhm {step}")));
                out.raw("\n");
            }
            None if self.bands.is_none() && self.add_band.is_empty() => {
                out.raw("bands 400..1000 nm every 10 nm fwhm 10 nm\n");
            }
            None => {}
        }
        out.raw("}\n");
        Ok(())
    }
}

/// How a flag's value stands in the scene.
#[derive(Clone, Copy, PartialEq)]
enum Form {
    /// As it is.
    Bare,
    /// As it is, in degrees where it is a number alone.
    Angle,
    /// As a string, be it quoted already or not.
    File,
    /// In braces.
    Block,
}

/// A scene written from flags, beside the command line as it is shown, and what of the one is what of the other.
#[derive(Default)]
struct Written {
    text: String,
    shown: String,
    pieces: Vec<Piece>,
}

struct Piece {
    text: Range<usize>,
    shown: Range<usize>,
}

impl Written {
    /// Text that stands for no flag.
    fn raw(&mut self, text: &str) {
        self.text += text;
    }

    /// The statement of a flag, if it is given.
    fn said(&mut self, flag: &str, key: &str, value: Option<&str>, form: Form) -> Result<(), Failure> {
        if let Some(value) = value {
            self.on_a_line(flag, key, value, form)?;
            self.raw("\n");
        }
        Ok(())
    }

    /// The same without the end of the line.
    fn on_a_line(&mut self, flag: &str, key: &str, value: &str, form: Form) -> Result<(), Failure> {
        fit(flag, value, form)?;
        self.name(flag);
        self.piece(key, |shown| shown.len() - flag.len() - 2..shown.len());
        self.raw(" ");
        self.shown += " ";
        let quote = quote_for(value);
        self.shown += quote;
        self.value(value, form);
        self.shown += quote;
        Ok(())
    }

    /// A statement whose value reads otherwise than the flag's.
    fn said_as(&mut self, flag: &str, key: &str, value: &str, text: &str) -> Result<(), Failure> {
        fit(flag, value, Form::Bare)?;
        if value == text {
            return self.said(flag, key, Some(value), Form::Bare);
        }
        self.name(flag);
        self.raw(&format!("{key} "));
        let quote = quote_for(value);
        let shown = format!(" {quote}{value}{quote}");
        self.shown += &shown;
        self.piece(text, |all| all.len() - shown.len() + 1..all.len());
        self.raw("\n");
        Ok(())
    }

    /// A parameter: `--set KEY=VALUE`.
    fn parameter(&mut self, flag: &str, key: &str, value: &str, form: Form) -> Result<(), Failure> {
        fit(flag, key, Form::Bare)?;
        fit(flag, value, form)?;
        self.name(flag);
        let said = format!("{key}={value}");
        let quote = quote_for(&said);
        self.shown += &format!(" {quote}{key}");
        self.piece(key, |shown| shown.len() - key.len()..shown.len());
        self.raw(" ");
        self.shown += "=";
        self.value(value, form);
        self.shown += quote;
        self.raw("\n");
        Ok(())
    }

    fn name(&mut self, flag: &str) {
        if !self.shown.is_empty() {
            self.shown += " ";
        }
        self.shown += &format!("--{flag}");
    }

    /// Text that is what a place of the command line is.
    fn piece(&mut self, text: &str, shown: impl FnOnce(&str) -> Range<usize>) {
        let start = self.text.len();
        self.text += text;
        self.pieces.push(Piece { text: start..self.text.len(), shown: shown(&self.shown) });
    }

    /// A value, which the command line shows as it is.
    fn value(&mut self, value: &str, form: Form) {
        let start = self.shown.len();
        self.shown += value;
        let end = self.shown.len();
        match form {
            Form::File if !value.starts_with('"') => {
                let escaped = value.replace('\\', "\\\\").replace('"', "\\\"");
                self.piece(&format!("\"{escaped}\""), |_| start..end);
            }
            Form::Block => {
                self.raw("{ ");
                self.piece(value, |_| start..end);
                self.raw(" }");
            }
            _ => self.piece(value, |_| start..end),
        }
        if form == Form::Angle && value.trim().parse::<f64>().is_ok() {
            self.raw(" deg");
        }
    }

    /// Findings with their places on the command line, and the texts that these are in.
    fn pointed(&self, diagnostics: &[Diagnostic], sources: &Sources) -> (Vec<Diagnostic>, Sources) {
        let mut texts = Sources::default();
        texts.add(COMMAND_LINE, self.shown.as_str());
        sources.iter().skip(1).for_each(|source| _ = texts.add(source.path.as_str(), source.text.as_str()));
        let point = |diagnostic: &Diagnostic| Diagnostic {
            span: diagnostic.span.and_then(|span| self.place(span)),
            notes: (diagnostic.notes.iter())
                .filter_map(|(span, text)| Some((self.place(*span)?, text.clone())))
                .collect(),
            ..diagnostic.clone()
        };
        (diagnostics.iter().map(point).collect(), texts)
    }

    /// A place of the scene on the command line; `None` for what no flag says.
    fn place(&self, span: Span) -> Option<Span> {
        if span.file != FileId(0) {
            return Some(span);
        }
        let (start, end) = (span.start as usize, span.end as usize);
        let touches = |piece: &&Piece| match start < end {
            true => piece.text.start < end && start < piece.text.end,
            false => (piece.text.start..=piece.text.end).contains(&start),
        };
        let alike = |piece: &Piece| piece.text.len() == piece.shown.len();
        let first = self.pieces.iter().find(touches)?;
        let last = self.pieces.iter().rfind(touches)?;
        let from = match alike(first) {
            true => first.shown.start + start.saturating_sub(first.text.start),
            false => first.shown.start,
        };
        let to = match alike(last) {
            true => last.shown.end - last.text.end.saturating_sub(end),
            false => last.shown.end,
        };
        Some(Span { file: FileId(0), start: from as u32, end: to.max(from) as u32 })
    }
}

/// Quotes that a shell wants about a value.
fn quote_for(value: &str) -> &'static str {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-+._/=,:".contains(c);
    match value {
        value if !value.is_empty() && value.chars().all(plain) => "",
        value if value.contains('"') => "'",
        _ => "\"",
    }
}

/// Refuses a value that would reach beyond its own statement.
fn fit(flag: &str, value: &str, form: Form) -> Result<(), Failure> {
    let bad = |what: &str| Err(Failure::BadInput(format!("--{flag}: {what}")));
    if value.trim().is_empty() {
        return bad("a value is due");
    }
    if value.chars().any(char::is_control) {
        return bad("a value stands on one line");
    }
    let (mut depth, mut quoted, mut escaped) = (0i32, false, false);
    for c in value.chars().filter(|_| form != Form::File) {
        match c {
            _ if escaped => escaped = false,
            '\\' if quoted => escaped = true,
            '"' => quoted = !quoted,
            '#' if !quoted => return bad("a value holds no comment"),
            '{' if !quoted => depth += 1,
            '}' if !quoted => depth -= 1,
            _ => {}
        }
        if depth < 0 {
            return bad("this `}` closes nothing");
        }
    }
    match (depth, quoted) {
        (0, false) => Ok(()),
        (0, true) => bad("a string is not closed"),
        _ => bad("a `{` is not closed"),
    }
}
