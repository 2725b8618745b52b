//! A station's record from a CSV file: a column `time_utc` (`1992-06-18T16:00`, `1992-06-18 16:00:30Z`) or `time` (with an
//! offset in every row: `1992-06-18T12:00-04:00`), and any of `pressure_hpa`, `temperature_degc`, `humidity_percent`,
//! `visibility_km`, `aod`, `ozone_du`, `no2_du`, `water_g_cm2`, in these or other units. Empty cells are no readings.

use sunglint_radiometry::Dimension;

use crate::check::days_from_epoch;
use crate::scene::{Date, Record, Utc};
use crate::sounding::misspelt;
use crate::table::{Choice, Found, Sheet, TableError};

const fn field(names: &'static [&'static str], dimension: Dimension, low: f64, high: f64) -> Choice {
    Choice { names, dimension, range: (low, high) }
}

/// Fields of the weather block, and what a file may call them.
const FIELDS: [(&str, Choice); 8] = [
    ("pressure", field(&["pressure", "station_pressure"], Dimension::Pressure, 1.0, 1100.0)),
    ("temperature", field(&["temperature", "air_temperature"], Dimension::Temperature, 150.0, 350.0)),
    ("humidity", field(&["humidity", "relative_humidity"], Dimension::Fraction, 0.0, 1.0)),
    ("visibility", field(&["visibility"], Dimension::Length, 1.0, 1e6)),
    ("aod", field(&["aod", "aod_550nm"], Dimension::Fraction, 0.0, 100.0)),
    ("ozone", field(&["ozone"], Dimension::GasColumn, 0.0, 2.0)),
    ("no2", field(&["no2"], Dimension::GasColumn, 0.0, 0.1)),
    ("water", field(&["water", "precipitable_water"], Dimension::WaterColumn, 0.0, 20.0)),
];
const STEMS: [&str; 8] = ["pressure", "temperature", "humidity", "visibility", "aod", "ozone", "no2", "water"];
const MOST_FAULTS: usize = 8;

/// The record of a file, or everything that is wrong with it.
pub(crate) fn read(path: &str, text: &str) -> Result<Record, Vec<TableError>> {
    let sheet = Sheet::read(text).map_err(|fault| vec![fault])?;
    let mut faults = Vec::new();
    let time = (sheet.header().iter().enumerate())
        .find_map(|(i, name)| ["time_utc", "time"].contains(&name.as_str()).then_some((i, name == "time_utc")));
    if time.is_none() {
        let message = "a record has a column `time_utc`, or `time` with an offset in every row; this file has neither";
        faults.push(TableError::new("F02", message).help(sheet.there_are()));
    }
    let mut columns: Vec<(&'static str, Found)> = Vec::new();
    for (name, choice) in &FIELDS {
        match sheet.find(choice) {
            Ok(found) => columns.extend(found.map(|found| (*name, found))),
            Err(fault) => faults.push(fault),
        }
    }
    if faults.is_empty()
        && let Some(lost) = misspelt(&sheet, &STEMS, columns.iter().map(|(_, found)| *found))
    {
        faults.push(lost);
    }
    if faults.is_empty() && columns.is_empty() {
        let message = "this record has no column of the weather";
        let known =
            "pressure_hpa, temperature_degc, humidity_percent, visibility_km, aod, ozone_du, no2_du, water_g_cm2";
        faults.push(TableError::new("F02", message).help(format!("known are {known}; {}", sheet.there_are())));
    }
    let Some((clock, utc)) = time.filter(|_| faults.is_empty()) else { return Err(faults) };

    let mut series: Vec<(&'static str, Vec<(Utc, f64)>)> =
        columns.iter().map(|(name, _)| (*name, Vec::new())).collect();
    let mut before: Option<(Utc, usize)> = None;
    for row in 0..sheet.len() {
        if faults.len() >= MOST_FAULTS {
            break;
        }
        let at = match instant(sheet.text(row, clock), utc) {
            Ok(at) => at,
            Err(message) => {
                faults.push(sheet.locate(TableError::new("F01", message), row, clock));
                continue;
            }
        };
        if let Some((last, line)) = before.filter(|(last, _)| at <= *last) {
            let what = if at == last { "stands twice, first" } else { "is earlier than the one" };
            let message = format!("the time {} {what} in line {}", sheet.text(row, clock), sheet.line(line));
            let fault = sheet.locate(TableError::new("A02", message), row, clock);
            faults.push(fault.help("the rows of a record ascend in time, each time once"));
        }
        before = Some((at, row));
        for ((_, found), (_, values)) in columns.iter().zip(&mut series) {
            match sheet.value(row, found) {
                Ok(value) => values.extend(value.map(|value| (at, value))),
                Err(fault) => faults.push(fault),
            }
        }
    }
    if faults.is_empty() && sheet.len() == 0 {
        faults.push(TableError::new("A02", "this record has no rows"));
    }
    let empty = series.iter().find(|(_, values)| values.is_empty()).filter(|_| faults.is_empty());
    if let Some((name, _)) = empty {
        faults.push(TableError::new("A02", format!("the column of `{name}` is empty")).help("leave the column out"));
    }
    if faults.is_empty() { Ok(Record { path: path.to_string(), series }) } else { Err(faults) }
}

/// An instant as records write it.
fn instant(text: &str, utc: bool) -> Result<Utc, String> {
    let form = if utc { "1992-06-18T16:00:00Z" } else { "1992-06-18T12:00:00-04:00" };
    let unread = || format!("`{text}` is no time such as {form}");
    let (date, rest) = text.split_at_checked(10).ok_or_else(unread)?;
    let number = |part: &str| -> Result<f64, String> {
        let plain = !part.is_empty() && part.bytes().all(|byte| byte.is_ascii_digit() || byte == b'.');
        part.parse().ok().filter(|_| plain).ok_or_else(unread)
    };
    let whole = |part: &str, length: usize| match part.len() == length && !part.contains('.') {
        true => number(part),
        false => Err(unread()),
    };
    let [year, month, day] = date.split('-').collect::<Vec<_>>()[..] else { return Err(unread()) };
    let (year, month, day) = (whole(year, 4)? as i32, whole(month, 2)? as u8, whole(day, 2)? as u8);
    if !(1..=12).contains(&month) || !(1..=crate::check::days_in(year, month)).contains(&day) {
        return Err(format!("there is no day {date}"));
    }
    let rest = rest.strip_prefix(['T', ' ']).ok_or_else(unread)?;
    let (clock, offset) = match rest.find(['Z', '+', '-']) {
        Some(at) => rest.split_at(at),
        None => (rest, ""),
    };
    let offset = match (utc, offset.trim(), clock.is_empty()) {
        (true, "" | "Z", false) => 0.0,
        (true, _, _) => return Err(format!("`{text}` has an offset, but the column says UTC: call it `time`")),
        (false, "", _) => return Err(format!("`{text}` has no offset from UTC, such as -04:00")),
        (false, "Z", _) => 0.0,
        (false, signed, _) => {
            let (hours, minutes) = match (signed[1..].split_once(':'), signed.len()) {
                (Some(parts), _) => parts,
                (None, 5) => signed[1..].split_at(2),
                _ => (&signed[1..], "00"),
            };
            let size = whole(hours, 2)? * 3600.0 + whole(minutes, 2)? * 60.0;
            if size > 14.0 * 3600.0 {
                return Err(format!("no place is {signed} from UTC"));
            }
            if signed.starts_with('-') { -size } else { size }
        }
    };
    let parts: Vec<&str> = clock.trim().split(':').collect();
    let ([hour, minute] | [hour, minute, _]) = parts[..] else { return Err(unread()) };
    let second = parts.get(2).map_or(Ok(0.0), |second| number(second))?;
    let (hour, minute) = (whole(hour, 2)?, whole(minute, 2)?);
    if hour >= 24.0 || minute >= 60.0 || second >= 60.0 {
        return Err(format!("there is no time {} of a day", clock.trim()));
    }
    let days = days_from_epoch(Date { year, month, day }) as f64;
    Ok(Utc(days * 86_400.0 + hour * 3600.0 + minute * 60.0 + second - offset))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Observed;

    #[test]
    fn a_record_is_straight_between_its_readings() {
        let text = "time,pressure_hpa,humidity_percent,wind_m_s\n1992-06-18T10:00-04:00,990,60,3\n\
                    1992-06-18T12:00-04:00,994,,3\n1992-06-18 18:00:00 -0400,990,40,3\n";
        let record = read("r.csv", text).unwrap();
        let at =
            |hour: f64| Utc(days_from_epoch(Date { year: 1992, month: 6, day: 18 }) as f64 * 86_400.0 + hour * 3600.0);
        assert_eq!(record.at("pressure", at(14.5)), Some(Observed::Value { value: 991.0, across: None }));
        assert_eq!(record.at("pressure", at(16.0)), Some(Observed::Value { value: 994.0, across: None }));
        let Some(Observed::Value { value, across }) = record.at("humidity", at(18.0)) else { panic!("inside") };
        assert!((value - 0.5).abs() < 1e-12 && across == Some((at(14.0), at(22.0))));
        assert_eq!(record.at("pressure", at(23.0)), Some(Observed::Beyond(at(14.0), at(22.0))));
        assert_eq!(record.at("ozone", at(16.0)), None);
    }

    #[test]
    fn each_fault_of_a_record_has_its_code_and_line() {
        let fault = |text: &str| {
            let faults = read("r.csv", text).unwrap_err();
            (faults[0].code, faults[0].line)
        };
        let with = |rows: &str| format!("time_utc,temperature_degc\n{rows}");
        assert_eq!(fault(&with("1992-06-18T16:00,20\n1992-06-18T15:00,21\n")), ("A02", Some(3)));
        assert_eq!(fault(&with("1992-06-18T16:00,20\n1992-06-18T16:00Z,21\n")), ("A02", Some(3)));
        assert_eq!(fault(&with("1992-06-31T16:00,20\n")), ("F01", Some(2)));
        assert_eq!(fault(&with("18.6.1992 16:00,20\n")), ("F01", Some(2)));
        assert_eq!(fault(&with("1992-06-18T16:00-04:00,20\n")), ("F01", Some(2)));
        assert_eq!(fault(&with("1992-06-18T16:00,2000\n")), ("U05", Some(2)));
        assert_eq!(fault(&with("1992-06-18T16:00,\n")), ("A02", None));
        assert_eq!(fault(&with("")), ("A02", None));
        assert_eq!(fault("time,temperature_degc\n1992-06-18T16:00,20\n"), ("F01", Some(2)));
        assert_eq!(fault("hour,temperature_degc\n12,20\n"), ("F02", None));
        assert_eq!(fault("time_utc,temperature\n1992-06-18T16:00,20\n"), ("F02", None));
        assert_eq!(fault("time_utc,wind_m_s\n1992-06-18T16:00,20\n"), ("F02", None));
        assert_eq!(fault("time_utc,aod,presure_hpa\n1992-06-18T16:00,0.2,990\n"), ("F02", None));
    }
}
