//! From collection sets to moments: instants with the sun's place at each.

use sunglint_atmosphere::{Place, Sun, SunEvents, SunPosition, sun_position, sunrise_sunset};
use sunglint_dsl::scene::{Clock, Collect, Date, Site, Times, Utc};
use sunglint_dsl::{Diagnostic, Scene};

use crate::air::Air;

/// Most times of one collection set.
const MOST_TIMES: usize = 10_000;
const DAY: f64 = 86_400.0;

/// One time of a view.
#[derive(Clone, Debug)]
pub struct Moment {
    /// Name of the frame's folder: `1992-06-18T160000Z`, or the sun's angles where the scene gives those.
    pub label: String,
    /// The instant; `None` where the sun is given by angles, or there is none.
    pub utc: Option<Utc>,
    /// The sun; `None` where there is none.
    pub sun: Option<Sun>,
    /// Index of the collection set.
    pub collect: usize,
}

/// Surface pressure \[hPa\] and temperature \[K\] that bend the sun's rays where the weather says neither: the SPA's own
/// standard air.
const STANDARD_AIR: (f64, f64) = (1013.25, 285.15);

/// True zenith angle of the sun's centre when its upper limb is seen at the horizon, and a minute more \[deg\].
const LIMB_AT_HORIZON: f64 = 90.8333 + 0.25;

fn place(site: &Site) -> Place {
    Place { latitude: site.latitude, longitude: site.longitude, elevation: site.elevation }
}

/// Where the sun is at a site; x and y of the direction are those of the scene, whose +y may differ from true north by the
/// site's convergence.
pub fn sun_at(site: &Site, utc: Utc, pressure: Option<f64>, temperature: Option<f64>) -> Result<SunPosition, String> {
    let (pressure, temperature) = (pressure.unwrap_or(STANDARD_AIR.0), temperature.unwrap_or(STANDARD_AIR.1));
    let mut position =
        sun_position(&place(site), utc.julian_date(), pressure, temperature).map_err(|error| error.to_string())?;
    if site.convergence != 0.0 {
        position.apparent = sunglint_radiometry::WorldDir::from_zenith_azimuth(
            position.apparent_zenith,
            position.azimuth - site.convergence,
        );
    }
    Ok(position)
}

/// Sunrise, solar noon and sunset of a civil date, `zone` seconds east of UTC.
pub fn events(site: &Site, date: Date, zone: f64) -> Result<SunEvents, String> {
    let start = midnight(date) - zone;
    sunrise_sunset(&place(site), Utc(start).julian_date(), Utc(start + DAY).julian_date()).map_err(|e| e.to_string())
}

/// Seconds since 1970 of a date's midnight, as if local time were UTC.
fn midnight(date: Date) -> f64 {
    // Days from civil [Hinnant, chrono-compatible low-level date algorithms]: years begin in March.
    let year = i64::from(date.year) - i64::from(date.month <= 2);
    let era = year.div_euclid(400);
    let year_of_era = year.rem_euclid(400);
    let month = (i64::from(date.month) + 9) % 12;
    let day_of_year = (153 * month + 2) / 5 + i64::from(date.day) - 1;
    let day_of_era = year_of_era * 365 + year_of_era / 4 - year_of_era / 100 + day_of_year;
    (era * 146_097 + day_of_era - 719_468) as f64 * DAY
}

/// `1992-06-18T160000Z`
pub fn label(utc: Utc) -> String {
    iso(utc).replace(':', "")
}

/// `1992-06-18T16:00:00Z`
pub fn iso(utc: Utc) -> String {
    let seconds = utc.0.round() as i64;
    match jiff::Timestamp::from_second(seconds) {
        Ok(timestamp) => format!("{timestamp:.0}"),
        Err(_) => format!("{seconds} s"),
    }
}

/// An instant as the command line takes it: `1992-06-18T16:00:00Z`, or with an offset.
pub fn parse_utc(text: &str) -> Result<Utc, String> {
    let timestamp: jiff::Timestamp = text.parse().map_err(|_| {
        format!("`{text}` is no instant; write 1992-06-18T16:00:00Z, or an offset such as -04:00 in place of Z")
    })?;
    Ok(Utc(timestamp.as_second() as f64 + f64::from(timestamp.subsec_nanosecond()) * 1e-9))
}

/// The moments of a collection set, ascending.
pub fn moments(scene: &Scene, index: usize, air: &Air, diagnostics: &mut Vec<Diagnostic>) -> Vec<Moment> {
    let collect = &scene.collects[index];
    match &collect.times {
        Times::NoSun => vec![Moment { label: "no_sun".into(), utc: None, sun: None, collect: index }],
        Times::Sun { zenith, azimuth } => {
            let label = format!("sun_{:.4}_{:.4}", zenith.to_degrees(), azimuth.to_degrees());
            vec![Moment { label: trimmed(&label), utc: None, sun: Some(Sun::at(*zenith, *azimuth)), collect: index }]
        }
        Times::At(instants) => at_instants(scene, index, instants, air, diagnostics),
        Times::Series { dates, from, to, every, zone } => {
            let Some(site) = &scene.site else { return Vec::new() };
            let mut instants = Vec::new();
            for date in dates {
                match series(site, *date, *from, *to, *every, *zone) {
                    Ok(some) => instants.extend(some),
                    Err((code, message)) => diagnostics.push(Diagnostic::error(code, collect.span, message)),
                }
                if instants.len() > MOST_TIMES {
                    diagnostics.push(
                        Diagnostic::error(
                            "T02",
                            collect.span,
                            format!("more than {MOST_TIMES} times in one collection"),
                        )
                        .help("lengthen the step, or split the collection"),
                    );
                    return Vec::new();
                }
            }
            instants.sort_by(|a, b| a.0.total_cmp(&b.0));
            instants.dedup();
            at_instants(scene, index, &instants, air, diagnostics)
        }
    }
}

/// `sun_30.0000_180.5000` to `sun_30_180.5`
fn trimmed(label: &str) -> String {
    let part = |part: &str| match part.contains('.') {
        true => part.trim_end_matches('0').trim_end_matches('.').to_string(),
        false => part.to_string(),
    };
    label.split('_').map(part).collect::<Vec<_>>().join("_")
}

fn series(
    site: &Site,
    date: Date,
    from: Clock,
    to: Option<Clock>,
    every: Option<f64>,
    zone: f64,
) -> Result<Vec<Utc>, (&'static str, String)> {
    let named = format!("{:04}-{:02}-{:02}", date.year, date.month, date.day);
    let start = midnight(date) - zone;
    let mut known: Option<SunEvents> = None;
    let mut clock = |clock: Clock| -> Result<f64, (&'static str, String)> {
        if let Clock::Time(seconds) = clock {
            return Ok(start + seconds);
        }
        let events = match known {
            Some(events) => events,
            None => *known.insert(events(site, date, zone).map_err(|message| ("T01", message))?),
        };
        let seconds = |day: f64| (day - 2_440_587.5) * DAY;
        let (day, offset, name) = match clock {
            Clock::Sunrise(offset) => (events.sunrise, offset, "sunrise"),
            Clock::Sunset(offset) => (events.sunset, offset, "sunset"),
            Clock::SolarNoon(offset) | Clock::Time(offset) => (Some(events.solar_noon), offset, "solar noon"),
        };
        let minutes = seconds(day.ok_or_else(|| ("T02", format!("there is no {name} at the site on {named}")))?) / 60.0;
        // Sunrise rounds up and sunset down to the minute, so that the sun is up at both.
        let whole = match clock {
            Clock::Sunrise(_) => minutes.ceil(),
            Clock::Sunset(_) => minutes.floor(),
            Clock::SolarNoon(_) | Clock::Time(_) => minutes.round(),
        };
        Ok(whole * 60.0 + offset)
    };
    let first = clock(from)?;
    let last = to.map(&mut clock).transpose()?.unwrap_or(first);
    if last < first {
        return Err(("T02", format!("on {named} the series ends before it begins")));
    }
    let Some(step) = every else { return Ok(vec![Utc(first)]) };
    let n = ((last - first) / step + 1e-9).floor() as usize;
    Ok((0..=n.min(MOST_TIMES)).map(|i| Utc(first + i as f64 * step)).collect())
}

fn at_instants(
    scene: &Scene,
    index: usize,
    instants: &[Utc],
    air: &Air,
    diagnostics: &mut Vec<Diagnostic>,
) -> Vec<Moment> {
    let collect = &scene.collects[index];
    let Some(site) = &scene.site else { return Vec::new() };
    let mut moments = Vec::new();
    let mut down = Vec::new();
    for utc in instants {
        let (pressure, temperature) = air.at_site(*utc);
        match sun_at(site, *utc, pressure, temperature) {
            Ok(position) => {
                let mut sun = position.sun();
                sun.apparent = position.apparent;
                // At sunrise and sunset the upper limb touches the horizon: that is no forgotten zone.
                if sun.true_zenith > LIMB_AT_HORIZON.to_radians() {
                    down.push(*utc);
                }
                moments.push(Moment { label: label(*utc), utc: Some(*utc), sun: Some(sun), collect: index });
            }
            Err(message) => diagnostics.push(Diagnostic::error("T01", collect.span, message)),
        }
    }
    if let Some(first) = down.first() {
        diagnostics.push(sun_is_down(site, collect, &down, *first));
    }
    moments
}

fn sun_is_down(site: &Site, collect: &Collect, down: &[Utc], first: Utc) -> Diagnostic {
    let which = if down.len() == 1 { iso(first) } else { format!("{} times from {} on", down.len(), iso(first)) };
    let warning =
        Diagnostic::warning("T03", collect.span, format!("the sun is down at {which}: these frames are black"));
    // The local date by the sun, whatever zone the scene is in.
    let zone = (site.longitude.to_degrees() / 15.0).round() * 3600.0;
    let local = ((first.0 + zone) / DAY).floor() * DAY;
    let date = jiff::Timestamp::from_second(local as i64).map(|t| t.to_zoned(jiff::tz::TimeZone::UTC).date());
    let Ok(date) = date else { return warning };
    let date = Date { year: i32::from(date.year()), month: date.month() as u8, day: date.day() as u8 };
    let Ok(events) = events(site, date, zone) else { return warning };
    match (events.sunrise, events.sunset) {
        (Some(rise), Some(set)) => {
            let utc = |day: f64| iso(Utc((day - 2_440_587.5) * DAY));
            let shifted = Utc(first.0 - zone);
            let zone_hint = sun_at(site, shifted, None, None).is_ok_and(|sun| sun.apparent.cos_zenith() > 0.0);
            let hint = if zone_hint { "; was a zone forgotten?" } else { "" };
            warning.help(format!("the sun rises at {} and sets at {}{hint}", utc(rise), utc(set)))
        }
        _ => warning.help("the sun does not rise at the site on that day"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn midnights_count_from_1970() {
        let days = |year, month, day| midnight(Date { year, month, day }) / DAY;
        assert_eq!(days(1970, 1, 1), 0.0);
        assert_eq!(days(2000, 2, 29), 11_016.0);
        assert_eq!(days(1992, 6, 18), 8_204.0);
        assert_eq!(days(1950, 1, 1), -7_305.0);
    }

    /// A series is its first instant and whole steps from it, up to and including the last.
    #[test]
    fn a_series_by_the_clock_includes_both_ends() {
        let span = sunglint_dsl::Span { file: sunglint_dsl::FileId(0), start: 0, end: 0 };
        let site = Site { latitude: 0.75, longitude: -1.35, elevation: 0.0, convergence: 0.0, span };
        let date = Date { year: 1992, month: 6, day: 18 };
        let times = series(
            &site,
            date,
            Clock::Time(9.0 * 3600.0),
            Some(Clock::Time(10.0 * 3600.0)),
            Some(1800.0),
            -4.0 * 3600.0,
        );
        let labels: Vec<String> = times.unwrap().into_iter().map(label).collect();
        assert_eq!(labels, ["1992-06-18T130000Z", "1992-06-18T133000Z", "1992-06-18T140000Z"]);
    }
}
