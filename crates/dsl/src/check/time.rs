//! Where and when, and the weather.

use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::Arc;

use sunglint_plugin::Role;
use sunglint_radiometry::Dimension;

use super::Checker;
use super::block::{Body, Braces, Line, Owner, Rule, rule};
use super::names::Kind;
use super::value::{Given, Quantity, TURN, written};
use crate::ast::{Item, Value};
use crate::scene::{Clock, Cloud, Collect, Crs, Date, Site, Times, Utc, Weather};
use crate::table::TableError;
use crate::{Diagnostic, Span, record, sounding};

pub(super) const SITE: &[Rule] = &[
    rule("latitude", "latitude ANGLE").required(),
    rule("longitude", "longitude ANGLE").required(),
    rule("elevation", "elevation LENGTH"),
    rule("crs", "crs \"EPSG:32618\""),
    rule("convergence", "convergence ANGLE"),
];

pub(super) const COLLECT: &[Rule] = &[
    rule("at", "at 1992-06-18 12:00 -04:00").excludes(&["on", "sun"]),
    rule("on", "on DATE from CLOCK to CLOCK every TIME").excludes(&["at", "sun"]).clauses(&[
        rule("from", "from CLOCK").required(),
        rule("to", "to CLOCK"),
        rule("every", "every TIME"),
    ]),
    rule("sun", "sun zenith ANGLE azimuth ANGLE")
        .excludes(&["at", "on"])
        .clauses(&[rule("zenith", "zenith ANGLE"), rule("azimuth", "azimuth ANGLE")]),
    rule("zone", "zone -04:00"),
    rule("weather", "weather NAME"),
];

pub(super) const WEATHER: &[Rule] = &[
    rule("profile", "profile us_standard"),
    rule("radiosonde", "radiosonde FILE"),
    rule("observations", "observations FILE"),
    rule("visibility", "visibility 23 km").excludes(&["aod"]),
    rule("aod", "aod NUMBER").excludes(&["visibility"]),
    rule("aerosol", "aerosol rural").braces(Braces::Optional),
    rule("pressure", "pressure 1013 hPa"),
    rule("temperature", "temperature 15 degC"),
    rule("humidity", "humidity 60 %").excludes(&["water"]),
    rule("water", "water 1.4 g/cm2").excludes(&["humidity"]),
    rule("ozone", "ozone 320 DU"),
    rule("no2", "no2 COLUMN"),
    rule("cloud", "cloud { optical_depth NUMBER, base LENGTH, top LENGTH }").many().braces(Braces::Required),
];

pub(super) const CLOUD: &[Rule] = &[
    rule("optical_depth", "optical_depth NUMBER").required(),
    rule("base", "base LENGTH").required(),
    rule("top", "top LENGTH").required(),
];

const PROFILES: &[&str] =
    &["us_standard", "tropical", "midlatitude_summer", "midlatitude_winter", "subarctic_summer", "subarctic_winter"];
/// The most times that one collection set may hold.
const MOST_TIMES: f64 = 10_000.0;
const DAY: f64 = 86_400.0;
/// A UTM zone is 6° wide; its projection serves a little beyond \[rad\].
const FARTHEST: f64 = 9.0 * PI / 180.0;

/// Longitude from the central meridian of a UTM zone, −π..π.
fn from_meridian(longitude: f64, zone: u8) -> f64 {
    let meridian = (f64::from(zone) * 6.0 - 183.0).to_radians();
    (longitude - meridian + PI).rem_euclid(2.0 * PI) - PI
}

/// Whether a text is the well-known text of a projected system whose unit is the metre; else code and message.
fn projected_in_metres(text: &str) -> Result<(), (&'static str, String)> {
    let name = text.split(['[', '(']).next().unwrap_or_default().trim().to_ascii_uppercase();
    match name.as_str() {
        "PROJCS" | "PROJCRS" | "PROJECTEDCRS" if name.len() < text.len() => {}
        "GEOGCS" | "GEOGCRS" | "GEOGRAPHICCRS" | "GEODCRS" | "GEODETICCRS" => {
            return Err(("U03", "this coordinate system measures in degrees, not in lengths".to_string()));
        }
        _ => return Err(("N02", "this is no projected coordinate system".to_string())),
    }
    // What stands directly in the outermost brackets, and whether they close.
    let (mut depth, mut quoted, mut start, mut ends) = (0usize, false, 0, Vec::new());
    for (i, c) in text.char_indices() {
        match c {
            '"' => quoted = !quoted,
            _ if quoted => {}
            '[' | '(' => {
                depth += 1;
                if depth == 1 {
                    start = i + 1;
                }
            }
            ']' | ')' | ',' => {
                if depth == 1 {
                    ends.push(text[start..i].trim());
                    start = i + 1;
                }
                if c != ',' {
                    depth = depth.saturating_sub(1);
                }
            }
            _ => {}
        }
    }
    if depth != 0 || quoted || !text.ends_with([']', ')']) {
        return Err(("N02", "this well-known text is cut short: a bracket or a quote is not closed".to_string()));
    }
    let unit = ends.iter().rev().find(|part| {
        let key = part.split(['[', '(']).next().unwrap_or_default().trim().to_ascii_uppercase();
        matches!(key.as_str(), "UNIT" | "LENGTHUNIT")
    });
    let factor = unit.and_then(|unit| unit.split(',').nth(1)?.trim_matches([' ', ']', ')']).parse::<f64>().ok());
    match factor {
        Some(factor) if (factor - 1.0).abs() > 1e-12 => {
            Err(("U03", format!("the unit of this coordinate system is {} m, not the metre", written(factor))))
        }
        _ => Ok(()),
    }
}

impl<'a> Checker<'a> {
    pub(super) fn site(&mut self, top: &Body<'a>) -> (Option<Site>, Option<Crs>) {
        let Some(line) = top.get("site") else { return (None, None) };
        let body = self.block(&line, SITE, "`site`");
        let angle = |limit: f64| Quantity::new(Dimension::Angle).within(-limit, limit);
        let latitude = self.optional(body.get("latitude"), &angle(FRAC_PI_2));
        let longitude = self.optional(body.get("longitude"), &angle(2.0 * PI));
        let height = Quantity::new(Dimension::Length).within(-1000.0, 9000.0);
        let elevation = self.optional(body.get("elevation"), &height).unwrap_or(0.0);
        let convergence = self.optional(body.get("convergence"), &angle(PI));
        let crs = body.get("crs").and_then(|line| self.crs(&line, longitude));
        let (Some(latitude), Some(longitude)) = (latitude, longitude) else { return (None, crs) };
        // Grid north of a UTM zone, by the sphere: within 1e-5 deg of the ellipsoid's.
        let of_zone = match crs {
            Some(Crs::Utm { zone, .. }) => (from_meridian(longitude, zone).tan() * latitude.sin()).atan(),
            _ => 0.0,
        };
        let convergence = convergence.unwrap_or(of_zone);
        (Some(Site { latitude, longitude, elevation, convergence, span: line.span() }), crs)
    }

    /// A coordinate reference system: `EPSG:n` of a UTM zone, or well-known text.
    fn crs(&mut self, line: &Line<'a>, longitude: Option<f64>) -> Option<Crs> {
        let (text, given) = self.text(line)?;
        let text = text.trim();
        let paste =
            "paste its well-known text, as `gdalsrsinfo -o wkt1 --single-line EPSG:n` prints it, its \" as \\\"";
        let known = "known by number are WGS 84 / UTM: EPSG:32601 to 32660 north, EPSG:32701 to 32760 south";
        let number = (text.get(..5)).filter(|start| start.eq_ignore_ascii_case("EPSG:")).map(|_| text[5..].trim());
        if let Some(number) = number {
            let code: u32 = number.parse().unwrap_or(0);
            let (zone, south) = ((code % 100) as u8, code / 100 == 327);
            if !(code / 100 == 326 || south) || !(1..=60).contains(&zone) {
                let fault = self.misfit(&given, "N02", format!("this version knows no coordinate system `{text}`"));
                self.report(
                    fault.label("another number, or well-known text?").help(format!("{known}; for others {paste}")),
                );
                return None;
            }
            if let Some(longitude) = longitude
                && from_meridian(longitude, zone).abs() > FARTHEST
            {
                let away = from_meridian(longitude, zone).to_degrees().abs();
                let own = ((longitude.to_degrees() + 180.0).rem_euclid(360.0) / 6.0) as u32 % 60 + 1;
                let message = format!("the site lies {away:.0} deg from the central meridian of UTM zone {zone}");
                let fault = self.misfit(&given, "U05", message);
                self.report(fault.label(format!("\"EPSG:{}\"?", code / 100 * 100 + own)));
                return None;
            }
            return Some(Crs::Utm { zone, south });
        }
        match projected_in_metres(text) {
            Ok(()) => Some(Crs::Wkt(text.to_string())),
            Err((code, message)) => {
                let fault = self.misfit(&given, code, message);
                let label = if code == "U03" { "x and y are metres" } else { "\"EPSG:32618\"?" };
                self.report(fault.label(label).help(format!("{known}; for others {paste}")));
                None
            }
        }
    }

    /// A block of a fixed table, its required lines there.
    pub(super) fn block(&mut self, line: &Line<'a>, rules: &'static [Rule], of: &str) -> Body<'a> {
        let owner = Owner::new(of, line);
        let statements = line.block.iter().flat_map(|block| &block.statements).map(Line::of);
        let body = self.hold(statements, rules, rules, &owner);
        self.require(&body, rules, &owner);
        body
    }

    pub(super) fn weather(&mut self, line: &Line<'a>, name: Option<&str>) -> Weather {
        let body = self.block(line, WEATHER, "`weather`");
        let scalar =
            |of: Dimension, low: f64, high: f64, usual: &'static str| Quantity::new(of).within(low, high).usual(usual);
        let mut weather = Weather { name: name.map(str::to_string), ..Weather::default() };
        let visibility = Quantity::new(Dimension::Length).positive(1e6).usual("km");
        weather.visibility = self.optional(body.get("visibility"), &visibility);
        weather.aod = self.optional(body.get("aod"), &scalar(Dimension::Fraction, 0.0, 100.0, ""));
        weather.pressure = self.optional(body.get("pressure"), &scalar(Dimension::Pressure, 1.0, 1100.0, "hPa"));
        weather.temperature =
            self.optional(body.get("temperature"), &scalar(Dimension::Temperature, 150.0, 350.0, "degC"));
        let percent = Quantity { percent: true, ..scalar(Dimension::Fraction, 0.0, 1.0, "%") };
        weather.humidity = self.optional(body.get("humidity"), &percent);
        weather.water = self.optional(body.get("water"), &scalar(Dimension::WaterColumn, 0.0, 20.0, "g/cm2"));
        weather.ozone = self.optional(body.get("ozone"), &scalar(Dimension::GasColumn, 0.0, 2.0, "DU"));
        weather.no2 = self.optional(body.get("no2"), &scalar(Dimension::GasColumn, 0.0, 0.1, "DU"));
        weather.profile = body.get("profile").and_then(|line| self.word_of(&line, PROFILES)).map(str::to_string);
        weather.aerosol = body.get("aerosol").and_then(|line| self.named_model(&line, Role::Aerosol));
        weather.radiosonde = body
            .get("radiosonde")
            .and_then(|line| self.weather_file(&line, "a sounding", sounding::read).map(Arc::new));
        weather.observations =
            body.get("observations").and_then(|line| self.weather_file(&line, "a record", record::read).map(Arc::new));
        weather.clouds = self.clouds(&body);
        for line in &body.lines {
            if let Some(rule) = WEATHER.iter().find(|rule| rule.key == line.key) {
                weather.spans.insert(rule.key, line.span());
            }
        }
        weather
    }

    /// Layers of cloud, lowest first.
    fn clouds(&mut self, body: &Body<'a>) -> Vec<Cloud> {
        let mut clouds: Vec<(Cloud, Span)> = Vec::new();
        for line in body.all("cloud") {
            self.surplus(&line, line.items, 0);
            let own = self.block(&line, CLOUD, "`cloud`");
            let height = Quantity::new(Dimension::Length).within(0.0, 30_000.0).usual("km");
            let depth = Quantity::new(Dimension::Fraction).within(0.0, 1000.0);
            let depth = self.optional(own.get("optical_depth"), &depth);
            let (base, top) = (self.optional(own.get("base"), &height), self.optional(own.get("top"), &height));
            let (Some(optical_depth), Some(base), Some(top)) = (depth, base, top) else { continue };
            if top <= base {
                let message = "the top of this cloud is not above its base";
                let place = own.get("top").map_or(line.span(), |line| line.span());
                let fault = Diagnostic::error("A01", place, message).label("must lie higher");
                let fault = own.get("base").into_iter().fold(fault, |fault, base| fault.note(base.span(), "the base"));
                self.report(fault);
                continue;
            }
            let span = line.block.map_or(line.span(), |block| super::block::join(line.span(), block.span));
            let clash = clouds.iter().find(|(other, _)| base < other.top && other.base < top);
            if let Some((other, place)) = clash {
                let message = format!(
                    "two clouds share the heights from {} to {} m",
                    written(base.max(other.base)),
                    written(top.min(other.top))
                );
                let fault = Diagnostic::error("A01", span, message).label("layers of cloud do not overlap");
                self.report(fault.note(*place, "the other"));
                continue;
            }
            clouds.push((Cloud { optical_depth, base, top }, span));
        }
        clouds.sort_by(|(a, _), (b, _)| a.base.total_cmp(&b.base));
        clouds.into_iter().map(|(cloud, _)| cloud).collect()
    }

    /// A file of the weather, read; what is wrong with it is reported with its lines.
    fn weather_file<T>(
        &mut self,
        line: &Line<'a>,
        noun: &str,
        read: impl Fn(&str, &str) -> Result<T, Vec<TableError>>,
    ) -> Option<T> {
        let Some(item) = line.items.first() else {
            self.absent(line, &format!("{noun}, a file named in quotes"));
            return None;
        };
        let given = self.resolve(item, &[]);
        let Value::Text(name) = given.value else {
            self.wrong(line, &given, "a file, named in quotes");
            return None;
        };
        self.surplus(line, line.items, 1);
        let (path, text) = self.file_text(&given, name)??;
        match read(&path, text.trim_start_matches('\u{feff}')) {
            Ok(value) => Some(value),
            Err(faults) => {
                faults.into_iter().for_each(|fault| self.table_fault(&given, &path, &text, fault));
                None
            }
        }
    }

    pub(super) fn collect(&mut self, line: &Line<'a>, name: Option<&str>) -> Option<Collect> {
        let body = self.block(line, COLLECT, "`collect`");
        let weather = match body.get("weather") {
            Some(line) => line.items.first().map(|item| (item, line)).and_then(|(item, line)| {
                let index = self.reference(&line, item, Kind::Weather);
                self.surplus(&line, line.items, 1);
                index
            }),
            None => None,
        };
        let zone = match body.get("zone") {
            Some(line) => Some(self.zone(&line)?),
            None => None,
        };
        if !["at", "on", "sun"].iter().any(|key| body.said(key)) {
            let owner = Owner::new("a collection set", line);
            self.missing("T01", "a collection set needs a time", "at 1992-06-18 12:00 -04:00", &owner);
            return None;
        }
        let times = if let Some(line) = body.get("at") {
            self.instants(&line, zone)?
        } else if let Some(line) = body.get("on") {
            self.series(&line, zone)?
        } else {
            self.fixed_sun(&body.get("sun")?)?
        };
        Some(Collect { name: name.map(str::to_string), times, weather, span: line.span() })
    }

    fn zone(&mut self, line: &Line<'a>) -> Option<f64> {
        let Some(item) = line.items.first() else {
            self.absent(line, "an offset from UTC");
            return None;
        };
        let given = self.resolve(item, &[]);
        let Value::Moment { date: None, clock: None, offset: Some(minutes) } = given.value else {
            let fault = self.misfit(
                &given,
                "T01",
                format!("a zone is an offset from UTC; `{}` is none", self.shown(given.home)),
            );
            self.report(fault.label("-04:00? the sign is written"));
            return None;
        };
        self.surplus(line, line.items, 1);
        self.offset(&given, *minutes)
    }

    fn offset(&mut self, given: &Given<'a>, minutes: i32) -> Option<f64> {
        if minutes.abs() <= 14 * 60 {
            return Some(f64::from(minutes) * 60.0);
        }
        let fault = self.misfit(given, "T01", format!("no place is {} h from UTC", written(f64::from(minutes) / 60.0)));
        self.report(fault.label("within -14:00..+14:00"));
        None
    }

    fn date(&mut self, given: &Given<'a>, (year, month, day): (i32, u8, u8)) -> Option<Date> {
        const MONTHS: [&str; 12] = [
            "January",
            "February",
            "March",
            "April",
            "May",
            "June",
            "July",
            "August",
            "September",
            "October",
            "November",
            "December",
        ];
        let fault = if !(1..=9999).contains(&year) {
            Some((format!("the year {year} is out of reach"), "within 1..9999".to_string()))
        } else if !(1..=12).contains(&month) {
            Some((format!("there is no month {month}"), "YEAR-MONTH-DAY".to_string()))
        } else if !(1..=days_in(year, month)).contains(&day) {
            let days = days_in(year, month);
            let what = format!("{} {year} has {days} days", MONTHS[usize::from(month) - 1]);
            Some((format!("there is no {year:04}-{month:02}-{day:02}"), what))
        } else {
            None
        };
        let Some((message, label)) = fault else { return Some(Date { year, month, day }) };
        let fault = self.misfit(given, "T01", message).label(label);
        self.report(fault);
        None
    }

    fn clock_of(&mut self, given: &Given<'a>, (hour, minute, second): (u8, u8, f64)) -> Option<f64> {
        if hour < 24 && minute < 60 && (0.0..60.0).contains(&second) {
            return Some(f64::from(hour) * 3600.0 + f64::from(minute) * 60.0 + second);
        }
        let message = format!("there is no time {hour:02}:{minute:02} of a day");
        let fault = self.misfit(given, "T01", message).label("00:00 to 23:59");
        self.report(fault);
        None
    }

    fn instants(&mut self, line: &Line<'a>, zone: Option<f64>) -> Option<Times> {
        let Some(item) = line.items.first() else {
            self.absent(line, "an instant");
            return None;
        };
        let members = self.members(line, item)?;
        if members.is_empty() {
            self.report(Diagnostic::error("T02", item.span, "this list of times is empty").label("at least one time"));
            return None;
        }
        if members.len() as f64 > MOST_TIMES {
            self.too_many(item.span, members.len() as f64);
            return None;
        }
        let mut out: Vec<Utc> = Vec::with_capacity(members.len());
        let mut good = true;
        let mut before: Option<Span> = None;
        for member in members {
            let given = self.resolve(member, &[]);
            let Value::Moment { date, clock, offset } = given.value else {
                self.wrong(line, &given, "an instant");
                return None;
            };
            let (Some(date), Some(clock)) = (date, clock) else {
                let lacks = if date.is_none() { "a date" } else { "a time of day" };
                let fault = self.misfit(&given, "T01", format!("this instant lacks {lacks}"));
                self.report(fault.label("1992-06-18 12:00 -04:00?"));
                good = false;
                continue;
            };
            let (date, clock) = (self.date(&given, *date), self.clock_of(&given, *clock));
            let offset = match offset {
                Some(minutes) => self.offset(&given, *minutes),
                None => Some(zone.unwrap_or(0.0)),
            };
            let (Some(date), Some(clock), Some(offset)) = (date, clock, offset) else {
                good = false;
                continue;
            };
            let instant = Utc(days_from_epoch(date) as f64 * DAY + clock - offset);
            if let (Some(last), Some(place)) = (out.last(), before)
                && instant <= *last
            {
                let message = if instant == *last { "a time stands twice" } else { "the times run backwards" };
                let fault = Diagnostic::error("T02", given.span, message).label("must be later than the one before");
                self.report(fault.note(place, "the one before"));
                return None;
            }
            out.push(instant);
            before = Some(given.span);
        }
        self.surplus(line, line.items, 1);
        good.then_some(Times::At(out))
    }

    fn too_many(&mut self, span: Span, count: f64) {
        let message = format!("this series has {} times", written(count.floor()));
        self.report(Diagnostic::error("T02", span, message).label("at most 10 000"));
    }

    fn series(&mut self, line: &Line<'a>, zone: Option<f64>) -> Option<Times> {
        let (items, clauses) = self.clauses(line);
        let dates = self.dates(line, items);
        let step = Quantity::new(Dimension::Time).positive(DAY).usual("min");
        let from = clauses.get("from").map(|line| self.clock(&line));
        let to = clauses.get("to").map(|line| self.clock(&line));
        let every = clauses.get("every").map(|line| self.quantity(&line, &step));
        if to.is_some() != every.is_some() && !(clauses.said("to") && clauses.said("every")) {
            let (there, lacks, form) = match to {
                Some(_) => ("to", "every", "every TIME"),
                None => ("every", "to", "to CLOCK"),
            };
            let owner = Owner::new("`on`", line);
            self.missing("S05", &format!("`{there}` needs `{lacks}` beside it"), form, &owner);
            return None;
        }
        let (dates, from) = (dates?, from??);
        let to = to.map_or(Some(None), |to| to.map(Some))?;
        let every = every.map_or(Some(None), |every| every.map(Some))?;
        let times = if let (Clock::Time(first), Some(Clock::Time(last)), Some(step)) = (from, to, every) {
            if last < first {
                let span = clauses.get("to").map_or(line.span(), |line| line.span());
                self.report(Diagnostic::error("T02", span, "this series runs backwards").label("`to` before `from`"));
                return None;
            }
            ((last - first) / step).floor() + 1.0
        } else {
            1.0
        };
        let count = times * dates.len() as f64;
        if count > MOST_TIMES {
            self.too_many(line.span(), count);
            return None;
        }
        Some(Times::Series { dates, from, to, every, zone: zone.unwrap_or(0.0) })
    }

    fn dates(&mut self, line: &Line<'a>, items: &'a [Item]) -> Option<Vec<Date>> {
        let Some(item) = items.first() else {
            self.absent(line, "a date");
            return None;
        };
        let mut out: Vec<Date> = Vec::new();
        let members = self.members(line, item)?;
        if members.is_empty() {
            self.report(Diagnostic::error("T02", item.span, "this list of dates is empty").label("at least one date"));
            return None;
        }
        for member in members {
            let given = self.resolve(member, &[]);
            let date = match given.value {
                Value::Moment { date: Some(date), clock: None, offset: None } => self.date(&given, *date)?,
                Value::Moment { .. } => {
                    let fault =
                        self.misfit(&given, "T01", "`on` takes dates alone; clocks stand behind `from` and `to`");
                    self.report(fault.label("on 1992-06-18 from 09:00?"));
                    return None;
                }
                _ => {
                    self.wrong(line, &given, "a date");
                    return None;
                }
            };
            if let Some(last) = out.last()
                && date <= *last
            {
                let message = if date == *last { "a date stands twice" } else { "the dates run backwards" };
                self.report(Diagnostic::error("T02", given.span, message).label("must be later than the one before"));
                return None;
            }
            out.push(date);
        }
        self.surplus(line, items, 1);
        Some(out)
    }

    fn clock(&mut self, line: &Line<'a>) -> Option<Clock> {
        const SUN: &[&str] = &["sunrise", "sunset", "solar_noon"];
        let Some(item) = line.items.first() else {
            self.absent(line, "a time of day");
            return None;
        };
        let given = self.resolve(item, SUN);
        match given.value {
            Value::Moment { date: None, clock: Some(clock), offset: None } => {
                let seconds = self.clock_of(&given, *clock)?;
                self.surplus(line, line.items, 1);
                Some(Clock::Time(seconds))
            }
            Value::Moment { .. } => {
                let fault = self.misfit(&given, "T01", "a time of day is due here: date and zone stand elsewhere");
                self.report(fault.label("09:30?"));
                None
            }
            Value::Word(_) => {
                let word = self.choose(line, item, SUN)?;
                let shift = Quantity::new(Dimension::Time).within(-DAY, DAY).usual("h");
                let offset = match &line.items[1..] {
                    [] => 0.0,
                    rest => self.quantity_at(line, rest, &shift)?,
                };
                Some(match word {
                    "sunrise" => Clock::Sunrise(offset),
                    "sunset" => Clock::Sunset(offset),
                    _ => Clock::SolarNoon(offset),
                })
            }
            _ => {
                self.wrong(line, &given, "a time of day");
                None
            }
        }
    }

    fn fixed_sun(&mut self, line: &Line<'a>) -> Option<Times> {
        let (items, clauses) = self.clauses(line);
        if let [Item { value: Value::Word(word), .. }, ..] = items
            && word == "none"
        {
            self.surplus(line, line.items, 1);
            return Some(Times::NoSun);
        }
        self.surplus(line, items, 0);
        let zenith = Quantity::new(Dimension::Angle).within(0.0, PI);
        let owner = Owner::new("a sun's place", line);
        for (key, form) in [("zenith", "zenith ANGLE"), ("azimuth", "azimuth ANGLE")] {
            if !clauses.said(key) && items.is_empty() {
                self.missing("S05", &format!("a sun's place needs `{key}`"), form, &owner);
            }
        }
        let zenith = self.optional(clauses.get("zenith"), &zenith);
        let azimuth = self.optional(clauses.get("azimuth"), &TURN);
        Some(Times::Sun { zenith: zenith?, azimuth: azimuth? })
    }

    /// Every time that needs the sun's place has a site.
    pub(super) fn times_have_a_site(&mut self, collects: &[Collect]) {
        let mut needy = collects.iter().filter(|collect| matches!(collect.times, Times::At(_) | Times::Series { .. }));
        if let Some(first) = needy.next() {
            let fault = Diagnostic::error("T01", first.span, "the sun's place at a time needs a site")
                .label("no `site` in this scene")
                .help("site { latitude 43.08 deg, longitude -77.67 deg }, or `sun zenith ANGLE azimuth ANGLE` in place of a time");
            let fault = needy.take(8).fold(fault, |fault, collect| fault.note(collect.span, "and this"));
            self.report(fault);
        }
    }
}

pub(crate) fn days_in(year: i32, month: u8) -> u8 {
    match month {
        4 | 6 | 9 | 11 => 30,
        2 if year % 4 == 0 && (year % 100 != 0 || year % 400 == 0) => 29,
        2 => 28,
        _ => 31,
    }
}

/// Days from 1970-01-01 in the proleptic Gregorian calendar.
pub(crate) fn days_from_epoch(date: Date) -> i64 {
    let (month, year) = (i64::from(date.month), i64::from(date.year) - i64::from(date.month <= 2));
    let era = year.div_euclid(400);
    let year_of_era = year.rem_euclid(400);
    let day_of_year = (153 * ((month + 9) % 12) + 2) / 5 + i64::from(date.day) - 1; // years begin in March
    era * 146_097 + year_of_era * 365 + year_of_era / 4 - year_of_era / 100 + day_of_year - 719_468
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 1970-01-01 is day 0; 2000-03-01 is 11 017; 1992-06-18 has Julian day 2 448 791.5; 1900 was no leap year.
    #[test]
    fn civil_dates_count_days_as_the_julian_date_does() {
        let day = |year, month, day| days_from_epoch(Date { year, month, day });
        assert_eq!(day(1970, 1, 1), 0);
        assert_eq!(day(2000, 3, 1), 11_017);
        assert_eq!(day(1900, 3, 1) - day(1900, 2, 28), 1);
        assert_eq!(day(2000, 3, 1) - day(2000, 2, 28), 2);
        assert_eq!(Utc(day(1992, 6, 18) as f64 * DAY).julian_date(), 2_448_791.5);
        assert_eq!(day(1, 1, 1), -719_162);
    }
}
