//! CSV tables: spectra, and rows of numbers for models. The first line that is no comment names the columns; a name
//! ends in its unit (`wavelength_nm`, `view_zenith_deg`, `pressure_hpa`) in either case, with `/` and `-` as written or as
//! `_`, `%` also as `percent`, `degC` also as `c`.
//! Lines that begin with `#` are comments. Vacuum and air wavelengths are not converted into each other.

mod columns;

pub use columns::{Wanted, read_columns};

use std::collections::HashMap;
use std::f64::consts::FRAC_PI_2;

use sunglint_plugin::{Column, Table, TableKey};
use sunglint_radiometry::{Curve, CurveError, Dimension, UNITS, Unit, units_of};

/// Why a file is not the table that it should be.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub struct TableError {
    /// F01 malformed, F02 a column missing, ambiguous or without unit, M05 not ascending or doubled, U05 out of range.
    pub code: &'static str,
    /// Line in the file, from 1.
    pub line: Option<u64>,
    /// Character in that line, from 1.
    pub column: Option<u64>,
    /// What is wrong.
    pub message: String,
    /// What would be right.
    pub help: Option<String>,
}

impl std::fmt::Display for TableError {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        match (self.line, self.column) {
            (Some(line), Some(column)) => write!(f, "line {line}, column {column}: {}", self.message),
            (Some(line), None) => write!(f, "line {line}: {}", self.message),
            _ => f.write_str(&self.message),
        }
    }
}

impl TableError {
    pub(crate) fn new(code: &'static str, message: impl Into<String>) -> Self {
        Self { code, line: None, column: None, message: message.into(), help: None }
    }
    pub(crate) fn help(self, help: impl Into<String>) -> Self {
        Self { help: Some(help.into()), ..self }
    }
}

/// Names of the columns of a table, as written.
pub fn columns(text: &str) -> Result<Vec<String>, TableError> {
    Ok(Sheet::read(text)?.header)
}

/// A quantity against wavelength \[µm\], in the canonical unit of `of`: a column `wavelength_nm` or `wavelength_um` (or
/// `wavelength_vac_…`, `wavelength_air_…`), and the column that `column` names, with or without its unit; without
/// `column` there is only one other. Outside its rows the curve ends.
pub fn read_spectrum(text: &str, column: Option<&str>, of: Dimension) -> Result<Curve, TableError> {
    let sheet = Sheet::read(text)?;
    let (at, unit) = sheet.wavelength()?.ok_or_else(|| sheet.no_wavelength())?;
    let others = || (0..sheet.header.len()).filter(|i| *i != at);
    let chosen = match column {
        Some(name) => {
            let exact: Vec<usize> = others().filter(|i| sheet.header[*i] == name).collect();
            let found = if exact.is_empty() {
                others().filter(|i| split_unit(&sheet.header[*i], of).is_some_and(|(stem, _)| stem == name)).collect()
            } else {
                exact
            };
            match found[..] {
                [one] => one,
                [] => return Err(sheet.missing(name)),
                _ => return Err(sheet.ambiguous(format!("several columns are called `{name}`"), &found)),
            }
        }
        None => match others().collect::<Vec<_>>()[..] {
            [one] => one,
            [] => {
                return Err(TableError::new("F02", "there is no column beside the wavelength").help(sheet.there_are()));
            }
            ref several => return Err(sheet.ambiguous("it is not said which column is meant".into(), several)),
        },
    };
    let scale = match split_unit(&sheet.header[chosen], of) {
        Some((_, unit)) => (unit.factor, unit.offset),
        None if of == Dimension::Fraction => (1.0, 0.0),
        None => return Err(sheet.no_unit(chosen, of)),
    };
    let mut rows = Vec::with_capacity(sheet.rows.len());
    for row in 0..sheet.rows.len() {
        let wavelength = sheet.wavelength_at(row, at, unit)?;
        if let Some(&(before, _)) = rows.last().filter(|(before, _)| *before >= wavelength) {
            let what = if before == wavelength { "stands twice" } else { "stands below the wavelength before it" };
            let message = format!("wavelength {} {what}", sheet.rows[row].cells[at].trim());
            return Err(sheet
                .locate(TableError::new("M05", message), row, at)
                .help("a spectrum ascends, each wavelength once"));
        }
        rows.push((wavelength, sheet.number(row, chosen)? * scale.0 + scale.1));
    }
    Curve::linear(&rows).map_err(|error| match error {
        CurveError::Empty => TableError::new("F01", "the table has no rows"),
        CurveError::NotAscending { row } => {
            sheet.locate(TableError::new("M05", "the wavelengths do not ascend"), row, at)
        }
        CurveError::NotFinite { row } => {
            sheet.locate(TableError::new("F01", "this is not a finite number"), row, chosen)
        }
    })
}

/// Rows of numbers in the order of `wanted` and in canonical units. A column `band`, or one of wavelengths, says what
/// each row is for; further columns are not read.
pub fn read_table(text: &str, wanted: &[Column]) -> Result<Table, TableError> {
    let sheet = Sheet::read(text)?;
    let wavelength = sheet.wavelength()?;
    let band = sheet.header.iter().position(|name| name == "band");
    if let (Some((at, _)), Some(band)) = (wavelength, band) {
        return Err(sheet.ambiguous("rows are for a band or for a wavelength, not both".into(), &[band, at]));
    }
    let mut places = Vec::with_capacity(wanted.len());
    for column in wanted {
        places.push((sheet.place(column)?, column));
    }
    if sheet.rows.is_empty() {
        return Err(TableError::new("F01", "the table has no rows"));
    }
    let mut keys = (Vec::new(), Vec::new());
    let mut rows = Vec::with_capacity(sheet.rows.len());
    let mut known: HashMap<(Vec<u64>, String), usize> = HashMap::new();
    for row in 0..sheet.rows.len() {
        let mut values = Vec::with_capacity(wanted.len() + 1);
        for &((at, factor, offset), column) in &places {
            let value = sheet.number(row, at)? * factor + offset;
            values.push(sheet.within(value, row, &Found { at, factor, offset, range: column.range })?);
        }
        let mut key: Vec<u64> = values.iter().map(|value| value.to_bits()).collect();
        let mut name = String::new();
        if let Some(at) = band {
            name = sheet.rows[row].cells[at].trim().to_string();
            if name.is_empty() {
                return Err(sheet.locate(TableError::new("F01", "the name of the band is missing"), row, at));
            }
            keys.0.push(name.clone());
        }
        if let Some((at, unit)) = wavelength {
            let value = sheet.wavelength_at(row, at, unit)?;
            key.push(value.to_bits());
            keys.1.push(value);
        }
        if let Some(first) = known.insert((key, name), row) {
            let message = format!("this row stands twice, first in line {}", sheet.line(first));
            return Err(TableError { line: Some(sheet.line(row)), ..TableError::new("M05", message) });
        }
        rows.push(values);
    }
    let key = match (band, wavelength) {
        (Some(_), _) => TableKey::Band(keys.0),
        (_, Some(_)) => TableKey::Wavelength(keys.1),
        _ => TableKey::None,
    };
    Ok(Table { key, rows })
}

/// Shortest and longest wavelength that a table may speak of \[µm\]; beyond, its unit is wrong.
const WAVELENGTHS: (f64, f64) = (0.1, 100.0);

struct Row {
    /// Offset of the row in the text.
    start: usize,
    cells: csv::StringRecord,
}

/// A column that a file may have, under one of several names.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Choice {
    /// Names without units.
    pub names: &'static [&'static str],
    /// What it measures.
    pub dimension: Dimension,
    /// Smallest and largest value, in canonical units.
    pub range: (f64, f64),
}

/// Where a [`Choice`] stands: column, factor and offset to the canonical unit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Found {
    pub at: usize,
    factor: f64,
    offset: f64,
    range: (f64, f64),
}

/// Header and rows of a CSV file.
pub(crate) struct Sheet<'a> {
    text: &'a str,
    header: Vec<String>,
    rows: Vec<Row>,
}

impl<'a> Sheet<'a> {
    /// The column of a choice; `None` where the file has none of its names.
    pub(crate) fn find(&self, choice: &Choice) -> Result<Option<Found>, TableError> {
        let unit_of = |name: &str| {
            choice.names.iter().find_map(|stem| match split_unit(name, choice.dimension) {
                Some((found, unit)) if found == *stem => Some((unit.factor, unit.offset)),
                _ => (choice.dimension == Dimension::Fraction && name == *stem).then_some((1.0, 0.0)),
            })
        };
        let found: Vec<(usize, (f64, f64))> =
            self.header.iter().enumerate().filter_map(|(i, name)| Some((i, unit_of(name)?))).collect();
        match found[..] {
            [(at, (factor, offset))] => Ok(Some(Found { at, factor, offset, range: choice.range })),
            [] => match self.header.iter().position(|name| choice.names.contains(&name.as_str())) {
                Some(at) => Err(self.no_unit(at, choice.dimension)),
                None => Ok(None),
            },
            ref several => {
                let several: Vec<usize> = several.iter().map(|(i, _)| *i).collect();
                Err(self.ambiguous(format!("several columns give `{}`", choice.names[0]), &several))
            }
        }
    }

    /// The column of a choice whose name ends in `suffix`, a unit of no dimension of the language.
    pub(crate) fn find_suffixed(&self, choice: &Choice, suffix: &str, factor: f64) -> Option<Found> {
        let named = |name: &String| name.strip_suffix(suffix).is_some_and(|stem| choice.names.contains(&stem));
        let at = self.header.iter().position(named)?;
        Some(Found { at, factor, offset: 0.0, range: choice.range })
    }

    /// The value of a cell in the canonical unit, within its range; `None` where the cell is empty.
    pub(crate) fn value(&self, row: usize, found: &Found) -> Result<Option<f64>, TableError> {
        if self.rows[row].cells[found.at].trim().is_empty() {
            return Ok(None);
        }
        let value = self.number(row, found.at)? * found.factor + found.offset;
        self.within(value, row, found).map(Some)
    }

    /// The names of the columns.
    pub(crate) fn header(&self) -> &[String] {
        &self.header
    }

    /// How many rows there are.
    pub(crate) fn len(&self) -> usize {
        self.rows.len()
    }

    /// The text of a cell.
    pub(crate) fn text(&self, row: usize, column: usize) -> &str {
        self.rows[row].cells[column].trim()
    }

    fn within(&self, value: f64, row: usize, found: &Found) -> Result<f64, TableError> {
        let (low, high) = found.range;
        let slack = 1e-9 * value.abs();
        if value >= low - slack && value <= high + slack {
            return Ok(value);
        }
        let message = format!("{} is beyond its range", self.text(row, found.at));
        let back = |bound: f64| short((bound - found.offset) / found.factor) + 0.0; // no -0
        let (a, b) = (back(low), back(high));
        let help = format!("`{}` is from {} to {}", self.header[found.at], a.min(b), a.max(b));
        Err(self.locate(TableError::new("U05", message), row, found.at).help(help))
    }

    pub(crate) fn read(text: &'a str) -> Result<Self, TableError> {
        let text = text.strip_prefix('\u{FEFF}').unwrap_or(text);
        let mut reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .comment(Some(b'#'))
            .from_reader(text.as_bytes());
        let mut sheet = Self { text, header: Vec::new(), rows: Vec::new() };
        let mut headed = false;
        loop {
            let mut cells = csv::StringRecord::new();
            let from = reader.position().byte() as usize;
            match reader.read_record(&mut cells) {
                Ok(true) => {}
                Ok(false) => break,
                Err(error) => return Err(TableError::new("F01", format!("not a CSV table: {error}"))),
            }
            let first = cells.get(0).unwrap_or("").trim();
            if cells.iter().all(|cell| cell.trim().is_empty()) || first.starts_with('#') {
                continue;
            }
            let start = row_start(text, from);
            if !headed {
                headed = true;
                sheet.header = cells.iter().map(|cell| cell.trim().to_string()).collect();
                sheet.rows.push(Row { start, cells });
                sheet.check_header()?;
                sheet.rows.clear();
                continue;
            }
            let (found, due) = (cells.len(), sheet.header.len());
            sheet.rows.push(Row { start, cells });
            if found != due {
                let message = format!("this row has {found} values for {due} columns");
                return Err(TableError {
                    line: Some(sheet.line(sheet.rows.len() - 1)),
                    ..TableError::new("F01", message)
                });
            }
        }
        if headed { Ok(sheet) } else { Err(TableError::new("F01", "the table is empty")) }
    }

    /// The header, which stands as row 0 now.
    fn check_header(&self) -> Result<(), TableError> {
        for (i, name) in self.header.iter().enumerate() {
            if name.parse::<f64>().is_ok() {
                let error = TableError::new("F02", format!("`{name}` is no name of a column: the header is missing"));
                let help = "the first line names the columns with their units, such as `wavelength_nm,reflectance`";
                return Err(self.locate(error, 0, i).help(help));
            }
            if self.header[..i].contains(name) {
                let what = if name.is_empty() {
                    "two columns have no name".into()
                } else {
                    format!("two columns are called `{name}`")
                };
                return Err(self.locate(TableError::new("F02", what), 0, i));
            }
        }
        match self.header.as_slice() {
            [one] if one.contains([';', '\t', ' ']) => {
                let error = TableError::new("F01", "the columns are not parted by commas");
                Err(TableError { line: Some(self.line(0)), ..error })
            }
            _ => Ok(()),
        }
    }

    pub(crate) fn line(&self, row: usize) -> u64 {
        1 + self.text[..self.rows[row].start].bytes().filter(|byte| *byte == b'\n').count() as u64
    }

    /// An error at a cell.
    pub(crate) fn locate(&self, error: TableError, row: usize, cell: usize) -> TableError {
        let rest = &self.text[self.rows[row].start..];
        let mut quoted = false;
        let mut left = cell;
        let mut place = 1;
        for (i, character) in rest.chars().enumerate() {
            place = i as u64 + 1;
            match character {
                '\n' if !quoted => break,
                '"' => quoted = !quoted,
                _ if left == 0 && character.is_whitespace() => continue,
                ',' if !quoted && left > 0 => {
                    left -= 1;
                    continue;
                }
                _ => {}
            }
            if left == 0 {
                break;
            }
        }
        TableError { line: Some(self.line(row)), column: Some(place), ..error }
    }

    fn number(&self, row: usize, cell: usize) -> Result<f64, TableError> {
        let text = self.rows[row].cells[cell].trim();
        match text.parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(number),
            Ok(_) => Err(self.locate(TableError::new("F01", format!("`{text}` is not a finite number")), row, cell)),
            Err(_) if text.is_empty() => Err(self.locate(
                TableError::new("F01", format!("`{}` has no value here", self.header[cell])),
                row,
                cell,
            )),
            Err(_) => Err(self.locate(TableError::new("F01", format!("`{text}` is no number")), row, cell)),
        }
    }

    /// The column of wavelengths and its unit, if there is one.
    fn wavelength(&self) -> Result<Option<(usize, &'static Unit)>, TableError> {
        let is_wavelength = |stem: &str| matches!(stem, "wavelength" | "wavelength_vac" | "wavelength_air");
        let found: Vec<(usize, &'static Unit)> = (self.header.iter().enumerate())
            .filter_map(|(i, name)| {
                split_unit(name, Dimension::Wavelength)
                    .filter(|(stem, _)| is_wavelength(stem))
                    .map(|(_, unit)| (i, unit))
            })
            .collect();
        match found[..] {
            [] => match self.header.iter().position(|name| is_wavelength(name)) {
                Some(at) => Err(self.no_unit(at, Dimension::Wavelength)),
                None => Ok(None),
            },
            [one] => Ok(Some(one)),
            ref several => {
                let several: Vec<usize> = several.iter().map(|(i, _)| *i).collect();
                Err(self.ambiguous("there are several columns of wavelengths".into(), &several))
            }
        }
    }

    fn wavelength_at(&self, row: usize, cell: usize, unit: &Unit) -> Result<f64, TableError> {
        let written = self.number(row, cell)?;
        let value = written * unit.factor;
        if (WAVELENGTHS.0..=WAVELENGTHS.1).contains(&value) {
            return Ok(value);
        }
        let other = if unit.name == "nm" { "um" } else { "nm" };
        let message = format!("a wavelength of {} {} is beyond 0.1..100 um", short(written), unit.name);
        let error = self.locate(TableError::new("U05", message), row, cell);
        Err(error.help(format!("is `{}` in {other}?", self.header[cell])))
    }

    /// Where a declared column stands, with the factor and offset to its canonical unit.
    fn place(&self, column: &Column) -> Result<(usize, f64, f64), TableError> {
        let matches = |name: &str| match split_unit(name, column.dimension) {
            Some((stem, unit)) if stem == column.name => Some((unit.factor, unit.offset)),
            _ => (column.dimension == Dimension::Fraction && name == column.name).then_some((1.0, 0.0)),
        };
        let found: Vec<(usize, (f64, f64))> =
            self.header.iter().enumerate().filter_map(|(i, name)| Some((i, matches(name)?))).collect();
        match found[..] {
            [(at, (factor, offset))] => Ok((at, factor, offset)),
            [] => {
                if let Some(found) = self.elevation(column) {
                    return Ok(found);
                }
                let bare = |name: &String| {
                    name.strip_prefix(column.name).is_some_and(|rest| {
                        let unit = rest.strip_prefix('_');
                        rest.is_empty() || unit.is_some_and(|unit| UNITS.iter().any(|known| spelled(known.name, unit)))
                    })
                };
                Err(match self.header.iter().position(bare) {
                    Some(at) => self.no_unit(at, column.dimension),
                    None => {
                        let unit =
                            units_of(column.dimension).next().filter(|unit| unit.name != "%").map(|unit| unit.name);
                        self.missing(&unit.map_or(column.name.to_string(), |unit| format!("{}_{unit}", column.name)))
                    }
                })
            }
            ref several => {
                let several: Vec<usize> = several.iter().map(|(i, _)| *i).collect();
                Err(self.ambiguous(format!("several columns give `{}`", column.name), &several))
            }
        }
    }

    /// A zenith angle may stand as the elevation above the horizon: `elevation_deg` for `zenith`.
    fn elevation(&self, column: &Column) -> Option<(usize, f64, f64)> {
        let stem = column.name.strip_suffix("zenith").filter(|_| column.dimension == Dimension::Angle)?;
        let place = |(at, name): (usize, &String)| match split_unit(name, Dimension::Angle) {
            Some((found, unit)) if found.strip_prefix(stem) == Some("elevation") => Some((at, -unit.factor, FRAC_PI_2)),
            _ => None,
        };
        self.header.iter().enumerate().find_map(place)
    }

    pub(crate) fn there_are(&self) -> String {
        let names: Vec<String> = self.header.iter().take(40).map(|name| format!("`{name}`")).collect();
        format!("the columns are {}{}", names.join(", "), if self.header.len() > 40 { ", …" } else { "" })
    }

    pub(crate) fn missing(&self, name: &str) -> TableError {
        let error = TableError::new("F02", format!("there is no column `{name}`"));
        match crate::nearest(name, self.header.iter().map(String::as_str)) {
            Some(nearest) => error.help(format!("is it `{nearest}`? {}", self.there_are())),
            None => error.help(self.there_are()),
        }
    }

    fn no_wavelength(&self) -> TableError {
        let error = TableError::new("F02", "there is no column `wavelength_nm` or `wavelength_um`");
        error.help(self.there_are())
    }

    fn ambiguous(&self, message: String, which: &[usize]) -> TableError {
        let names: Vec<String> = which.iter().take(40).map(|i| format!("`{}`", self.header[*i])).collect();
        TableError::new("F02", message).help(format!("there are {}", names.join(", ")))
    }

    /// A column whose name ends in no unit of its dimension.
    fn no_unit(&self, at: usize, of: Dimension) -> TableError {
        let name = &self.header[at];
        let units: Vec<&str> = units_of(of).map(|unit| unit.name).collect();
        let message = format!("column `{name}` is {}; its name ends in no unit of that", of.noun());
        let help = format!("such as `{name}_{}` (units: {})", units.first().unwrap_or(&""), units.join(" "));
        TableError::new("F02", message).help(help)
    }
}

/// Start of the record that is read from `from` on, behind comments and blank lines.
fn row_start(text: &str, mut from: usize) -> usize {
    while let Some(rest) = text.get(from..) {
        let line = rest.split_inclusive('\n').next().unwrap_or("");
        if line.is_empty() || !(line.trim().is_empty() || line.starts_with('#')) {
            break;
        }
        from += line.len();
    }
    from.min(text.len())
}

/// The name of a column without its unit, where it ends in a unit of `of`.
fn split_unit(name: &str, of: Dimension) -> Option<(&str, &'static Unit)> {
    let ends = |unit: &'static Unit| {
        name.char_indices()
            .filter(|(_, character)| *character == '_')
            .find(|(i, _)| spelled(unit.name, &name[i + 1..]))
            .map(|(i, _)| (&name[..i], unit))
    };
    units_of(of).filter_map(ends).min_by_key(|(stem, _)| stem.len())
}

/// Whether the end of a column's name spells a unit.
fn spelled(unit: &str, end: &str) -> bool {
    let plain = unit.replace(['/', '-'], "_");
    end.eq_ignore_ascii_case(unit)
        || unit == "%" && end == "percent"
        || unit == "degC" && end == "c"
        || end.eq_ignore_ascii_case(plain.trim_matches('_'))
}

/// A number for a message.
fn short(value: f64) -> f64 {
    (value * 1e6).round() / 1e6
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spectrum_in_nanometres_and_percent_comes_out_in_micrometres_and_fractions() {
        let text = "# white paint\r\nwavelength_nm,reflectance_percent\r\n400, 80\r\n# a gap\r\n\r\n700,90\r\n";
        let curve = read_spectrum(text, None, Dimension::Fraction).unwrap();
        assert_eq!(curve.domain(), (0.4, 0.7000000000000001));
        assert!((curve.at(0.55) - 0.85).abs() < 1e-12);
        let one = "\u{FEFF}wavelength_vac_um,red,nir\n0.6,1,0\n0.8,0,1\n";
        assert!((read_spectrum(one, Some("nir"), Dimension::Fraction).unwrap().at(0.7) - 0.5).abs() < 1e-12);
    }

    /// 1 uW cm⁻² sr⁻¹ nm⁻¹ = 10 W m⁻² sr⁻¹ µm⁻¹, spelled with `/` or `_`, named with or without unit.
    #[test]
    fn a_radiance_column_says_its_unit() {
        for text in
            ["wavelength_um,lamp_uW/cm2/sr/nm\n0.4,3\n0.5,3\n", "wavelength_um,lamp_uW_cm2_sr_nm\n0.4,3\n0.5,3\n"]
        {
            for name in [None, Some("lamp")] {
                let curve = read_spectrum(text, name, Dimension::Radiance).unwrap();
                assert!((curve.at(0.45) - 30.0).abs() < 1e-12);
            }
        }
        let error = read_spectrum("wavelength_um,lamp\n0.4,3\n", None, Dimension::Radiance).unwrap_err();
        assert_eq!((error.code, error.help.unwrap().starts_with("such as `lamp_W/m2/sr/um`")), ("F02", true));
    }

    fn fault(text: &str, column: Option<&str>) -> (&'static str, Option<u64>, Option<u64>) {
        let error = read_spectrum(text, column, Dimension::Fraction).unwrap_err();
        (error.code, error.line, error.column)
    }

    #[test]
    fn each_fault_of_a_spectrum_has_its_code_and_place() {
        assert_eq!(fault("", None), ("F01", None, None));
        assert_eq!(fault("wavelength_nm,r\n", None), ("F01", None, None));
        assert_eq!(fault("# c\nwavelength_nm,r\n400,0.1\n# d\n500, O.2\n", None), ("F01", Some(5), Some(6)));
        assert_eq!(fault("wavelength_nm,r\n400,\n500,1\n", None), ("F01", Some(2), Some(5)));
        assert_eq!(fault("wavelength_nm,r\n400,nan\n", None), ("F01", Some(2), Some(5)));
        assert_eq!(fault("wavelength_nm,r\n400,1,2\n", None), ("F01", Some(2), None));
        assert_eq!(fault("wavelength_nm r\n400 1\n", None), ("F01", Some(1), None));
        assert_eq!(fault("400,0.1\n500,0.2\n", None), ("F02", Some(1), Some(1)));
        assert_eq!(fault("wavelength,r\n400,0.1\n", None), ("F02", None, None));
        assert_eq!(fault("wavelength_nm,a,b\n400,0.1,1\n", None), ("F02", None, None));
        assert_eq!(fault("wavelength_nm,a,a\n400,0.1,1\n", None), ("F02", Some(1), Some(17)));
        assert_eq!(fault("wavelength_nm,grey\n400,0.1\n", Some("gray")), ("F02", None, None));
        assert_eq!(fault("wavelength_nm,r\n500,0.1\n400,0.1\n", None), ("M05", Some(3), Some(1)));
        assert_eq!(fault("wavelength_nm,r\n500,0.1\n500,0.1\n", None), ("M05", Some(3), Some(1)));
        assert_eq!(fault("wavelength_um,r\n400,0.1\n", None), ("U05", Some(2), Some(1)));
    }

    #[test]
    fn a_missing_column_offers_the_nearest() {
        let error =
            read_spectrum("wavelength_nm,grey,white\n400,0.1,1\n", Some("gray"), Dimension::Fraction).unwrap_err();
        assert_eq!(error.help.unwrap(), "is it `grey`? the columns are `wavelength_nm`, `grey`, `white`");
    }

    const COLUMNS: &[Column] = &[
        Column { name: "view_zenith", dimension: Dimension::Angle, range: (0.0, std::f64::consts::FRAC_PI_2) },
        Column { name: "factor", dimension: Dimension::Fraction, range: (0.0, 10.0) },
    ];

    #[test]
    fn a_table_takes_its_columns_in_any_order_with_a_key() {
        let table = read_table("factor,band,view_zenith_deg\n0.5,red,0\n0.7,nir,90\n", COLUMNS).unwrap();
        assert_eq!(table.key, TableKey::Band(vec!["red".into(), "nir".into()]));
        assert!((table.rows[1][0] - std::f64::consts::FRAC_PI_2).abs() < 1e-12 && table.rows[1][1] == 0.7);
        let table = read_table("wavelength_nm,view_zenith_rad,factor\n500,0.1,1\n500,0.2,1\n", COLUMNS).unwrap();
        assert_eq!(table.key, TableKey::Wavelength(vec![0.5, 0.5]));
        assert_eq!(read_table("view_zenith_deg,factor\n0,1\n", COLUMNS).unwrap().key, TableKey::None);
    }

    #[test]
    fn each_fault_of_a_table_has_its_code() {
        let code = |text| read_table(text, COLUMNS).unwrap_err().code;
        assert_eq!(code("view_zenith_deg,factor\n95,1\n"), "U05");
        assert_eq!(code("view_zenith,factor\n9,1\n"), "F02");
        assert_eq!(code("view_zenith_km,factor\n9,1\n"), "F02");
        assert_eq!(code("view_zenith_deg,view_zenith_rad,factor\n9,1,1\n"), "F02");
        assert_eq!(code("view_zenit_deg,factor\n9,1\n"), "F02");
        assert_eq!(code("band,wavelength_nm,view_zenith_deg,factor\nred,600,9,1\n"), "F02");
        assert_eq!(code("wavelength,view_zenith_deg,factor\n600,9,1\n"), "F02");
        assert_eq!(code("view_zenith_deg,factor\n9,1\n9,1\n"), "M05");
        assert_eq!(code("view_zenith_deg,factor\n9,\n"), "F01");
        let error = read_table("view_zenith_deg,factor\n95,1\n", COLUMNS).unwrap_err();
        assert_eq!(error.help.unwrap(), "`view_zenith_deg` is from 0 to 90");
    }
}
