//! A radiosonde's ascent from a CSV file. Columns, in any order: `pressure_hpa`, `altitude_m` (or `height_m`, either also
//! with `_msl` behind it), `temperature_degc` or `_k`, and at most one of `relative_humidity_percent` (or `humidity_…`),
//! `dewpoint_degc` and `mixing_ratio_g_kg`; other units of the same dimension do too. Lowest level first.

use sunglint_radiometry::Dimension;

use crate::nearest;
use crate::scene::{Moisture, Sounding, SoundingLevel};
use crate::table::{Choice, Found, Sheet, TableError};

const PRESSURE: Choice = Choice { names: &["pressure"], dimension: Dimension::Pressure, range: (0.01, 1100.0) };
const ALTITUDE: Choice =
    Choice { names: &["altitude", "height"], dimension: Dimension::Length, range: (-500.0, 60_000.0) };
const TEMPERATURE: Choice =
    Choice { names: &["temperature"], dimension: Dimension::Temperature, range: (150.0, 340.0) };
const HUMIDITY: Choice =
    Choice { names: &["relative_humidity", "humidity"], dimension: Dimension::Fraction, range: (0.0, 1.05) };
const DEW_POINT: Choice =
    Choice { names: &["dewpoint", "dew_point"], dimension: Dimension::Temperature, range: (100.0, 320.0) };
const MIXING_RATIO: Choice = Choice { names: &["mixing_ratio"], dimension: Dimension::Fraction, range: (0.0, 0.06) };
const STEMS: [&str; 9] = [
    "pressure",
    "altitude",
    "height",
    "temperature",
    "relative_humidity",
    "humidity",
    "dewpoint",
    "dew_point",
    "mixing_ratio",
];
/// Faults of one file that are told.
const MOST_FAULTS: usize = 8;
/// Heights, in the spelling of archives, behind which the datum stands.
const DATUM: &str = "_msl";

/// The ascent of a file, or everything that is wrong with it.
pub(crate) fn read(path: &str, text: &str) -> Result<Sounding, Vec<TableError>> {
    let sheet = Sheet::read(text).map_err(|fault| vec![fault])?;
    let mut faults = Vec::new();
    let mut find = |choice: &Choice| match find(&sheet, choice) {
        Ok(found) => found,
        Err(fault) => {
            faults.push(fault);
            None
        }
    };
    let wanted = [&PRESSURE, &ALTITUDE, &TEMPERATURE].map(|choice| (choice, find(choice)));
    let moist = [&HUMIDITY, &DEW_POINT, &MIXING_RATIO].map(&mut find);
    let unread = faults.len();
    for ((choice, found), name) in wanted.iter().zip(["pressure_hpa", "altitude_m", "temperature_degc"]) {
        let bare = |column: &String| choice.names.contains(&column.as_str());
        if found.is_none() && !(unread > 0 && sheet.header().iter().any(bare)) {
            let near = sheet.header().iter().find(|name| nearest(stem(name), choice.names.iter().copied()).is_some());
            let fault = TableError::new("F02", format!("a sounding has a column `{name}`; this file has none"));
            faults.push(match near {
                Some(near) => fault.help(format!("is it `{near}`? {}", sheet.there_are())),
                None => fault.help(sheet.there_are()),
            });
        }
    }
    if moist.iter().flatten().count() > 1 {
        let names: Vec<String> =
            moist.iter().flatten().map(|found| format!("`{}`", sheet.header()[found.at])).collect();
        let fault = TableError::new("F02", "the moisture of a sounding is given in more than one column");
        faults.push(fault.help(format!("keep one of {}", names.join(", "))));
    }
    let taken = wanted.iter().filter_map(|(_, found)| *found).chain(moist.into_iter().flatten());
    if let Some(lost) = misspelt(&sheet, &STEMS, taken).filter(|_| faults.is_empty()) {
        faults.push(lost);
    }
    let [(_, Some(pressure)), (_, Some(altitude)), (_, Some(temperature))] = wanted else { return Err(faults) };
    if !faults.is_empty() {
        return Err(faults);
    }
    let mut levels = Vec::with_capacity(sheet.len());
    for row in 0..sheet.len() {
        match level(&sheet, row, [&pressure, &altitude, &temperature], &moist) {
            Ok(level) => levels.push(level),
            Err(fault) => faults.push(fault),
        }
        if faults.len() >= MOST_FAULTS {
            break;
        }
    }
    if faults.is_empty() {
        order(&sheet, &levels, "altitude", altitude.at, |level| level.altitude, &mut faults);
        order(&sheet, &levels, "pressure", pressure.at, |level| level.pressure.map(|p| -p), &mut faults);
    }
    let whole = |level: &&SoundingLevel| level.pressure.is_some() && level.altitude.is_some();
    if faults.is_empty() && levels.iter().filter(whole).count() < 2 {
        let message = "a sounding needs two levels that have both pressure and altitude";
        faults.push(TableError::new("A02", message).help(format!("this one has {} rows", levels.len())));
    }
    if faults.is_empty() { Ok(Sounding { path: path.to_string(), levels }) } else { Err(faults) }
}

/// A column of a choice, its datum left aside.
fn find(sheet: &Sheet, choice: &Choice) -> Result<Option<Found>, TableError> {
    let found = sheet.find(choice)?;
    if found.is_some() {
        return Ok(found);
    }
    if choice.names.contains(&"mixing_ratio") {
        return Ok(sheet.find_suffixed(choice, "_g_kg", 1e-3));
    }
    match choice.dimension {
        Dimension::Length => Ok(sheet.find_suffixed(choice, &format!("_m{DATUM}"), 1.0)),
        _ => Ok(None),
    }
}

fn stem(name: &str) -> &str {
    name.trim_end_matches(DATUM).rsplit_once('_').map_or(name, |(stem, _)| stem)
}

/// A column that was not taken and whose name is near to one that would have been.
pub(crate) fn misspelt(
    sheet: &Sheet,
    stems: &[&'static str],
    taken: impl Iterator<Item = Found>,
) -> Option<TableError> {
    let taken: Vec<usize> = taken.map(|found| found.at).collect();
    (sheet.header().iter().enumerate()).filter(|(i, _)| !taken.contains(i)).find_map(|(_, name)| {
        let near = nearest(stem(name), stems.iter().copied())?;
        let fault = TableError::new("F02", format!("column `{name}` is not read"));
        Some(fault.help(format!("`{near}` and its unit? rename the column if it is something else")))
    })
}

fn level(
    sheet: &Sheet,
    row: usize,
    [pressure, altitude, temperature]: [&Found; 3],
    moist: &[Option<Found>; 3],
) -> Result<SoundingLevel, TableError> {
    const KINDS: [fn(f64) -> Moisture; 3] = [Moisture::RelativeHumidity, Moisture::DewPoint, Moisture::MixingRatio];
    let mut moisture = None;
    for (found, kind) in moist.iter().zip(KINDS) {
        let Some(found) = found else { continue };
        moisture = sheet.value(row, found)?.map(kind);
    }
    let level = SoundingLevel {
        pressure: sheet.value(row, pressure)?,
        altitude: sheet.value(row, altitude)?,
        temperature: sheet.value(row, temperature)?,
        moisture,
    };
    if level.pressure.is_none() && level.altitude.is_none() {
        let fault = TableError::new("F01", "this level has neither pressure nor altitude");
        return Err(TableError { line: Some(sheet.line(row)), ..fault });
    }
    Ok(level)
}

/// Known values ascend.
fn order(
    sheet: &Sheet,
    levels: &[SoundingLevel],
    name: &str,
    column: usize,
    of: impl Fn(&SoundingLevel) -> Option<f64>,
    faults: &mut Vec<TableError>,
) {
    let known: Vec<(usize, f64)> = levels.iter().enumerate().filter_map(|(i, level)| Some((i, of(level)?))).collect();
    let falls = known.windows(2).filter(|pair| pair[1].1 < pair[0].1).count();
    if falls > 1 && falls + 1 == known.len() {
        let fault = TableError::new("A02", format!("the {name} runs downwards through the whole sounding"));
        faults.push(sheet.locate(fault, known[1].0, column).help("the lowest level stands first; turn the rows round"));
        return;
    }
    for pair in known.windows(2).filter(|pair| pair[1].1 <= pair[0].1) {
        if faults.len() >= MOST_FAULTS {
            return;
        }
        let ((before, a), (row, b)) = (pair[0], pair[1]);
        let what = if a == b { "is that of" } else { "turns back from" };
        let message = format!("the {name} {} {what} line {}", sheet.text(row, column), sheet.line(before));
        let fault = sheet.locate(TableError::new("A02", message), row, column);
        faults.push(fault.help("pressure falls and altitude rises from level to level"));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fault(text: &str) -> (&'static str, Option<u64>) {
        let faults = read("s.csv", text).unwrap_err();
        (faults[0].code, faults[0].line)
    }

    #[test]
    fn an_archive_s_columns_come_out_in_canonical_units() {
        let text =
            "pressure_hpa,height_m_msl,temperature_c,dewpoint_c\n985,218,29.44,20\n950,536,,18\n900,1005,21.73,\n";
        let sounding = read("s.csv", text).unwrap();
        let [a, b, c] = sounding.levels[..] else { panic!("three levels") };
        assert_eq!((a.pressure, a.altitude, b.temperature, c.moisture), (Some(985.0), Some(218.0), None, None));
        assert!((a.temperature.unwrap() - 302.59).abs() < 1e-9);
        assert_eq!(a.moisture, Some(Moisture::DewPoint(293.15)));
        let text = "mixing_ratio_g_kg,temperature_K,altitude_km,pressure_Pa\n12,300,0.1,100000\n8,290,1.5,85000\n";
        let level = read("s.csv", text).unwrap().levels[1];
        assert_eq!((level.altitude, level.pressure), (Some(1500.0), Some(850.0)));
        assert_eq!(level.moisture, Some(Moisture::MixingRatio(0.008)));
    }

    #[test]
    fn each_fault_of_a_sounding_has_its_code_and_line() {
        let with = |rows: &str| format!("pressure_hpa,altitude_m,temperature_degc,humidity_percent\n{rows}");
        assert_eq!(fault(&with("985,218,29,60\n985,300,28,60\n")), ("A02", Some(3)));
        assert_eq!(fault(&with("985,218,29,60\n950,200,28,60\n")), ("A02", Some(3)));
        assert_eq!(fault(&with("850,1500,29,60\n900,1000,28,60\n950,500,28,60\n")), ("A02", Some(3)));
        assert_eq!(fault(&with("985,218,29,60\n")), ("A02", None));
        assert_eq!(fault(&with("985,218,29,60\n,,28,60\n900,1000,20,9\n")), ("F01", Some(3)));
        assert_eq!(fault(&with("985,218,29,600\n900,1000,20,9\n")), ("U05", Some(2)));
        assert_eq!(fault("pressure_hpa,altitude_m\n985,218\n"), ("F02", None));
        assert_eq!(fault("pressure_hpa,altitude_m,temperature\n985,218,3\n"), ("F02", None));
        assert_eq!(fault("pressure_hpa,altitude_m,temprature_c\n985,218,3\n"), ("F02", None));
        assert_eq!(fault("pressure_hpa,altitude_m,temperature_c,dewpiont_c\n985,218,3,2\n"), ("F02", None));
        assert_eq!(fault("pressure_hpa,altitude_m,temperature_c,dewpoint_c,humidity\n985,218,3,2,1\n"), ("F02", None));
    }
}
