//! Columns of numbers, read row by row: a million rows in well under a second.

use sunglint_plugin::Column;

use super::{Row, Sheet, TableError, row_start, short};

/// A column that a file must or may have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wanted {
    /// Its name, dimension and range.
    pub column: Column,
    /// Whether the file must have it.
    pub required: bool,
    /// Code of a number out of its range.
    pub code: &'static str,
}

/// The most faults that are told of one file.
const MOST_FAULTS: usize = 10;

/// The columns of `wanted` in canonical units, `None` for one that may be missing and is; further columns are not read.
///
/// # Errors
/// Every fault of the header, or the first ten of the rows.
pub fn read_columns(text: &str, wanted: &[Wanted]) -> Result<Vec<Option<Vec<f64>>>, Vec<TableError>> {
    let text = text.strip_prefix('\u{FEFF}').unwrap_or(text);
    let mut reader =
        csv::ReaderBuilder::new().has_headers(false).flexible(true).comment(Some(b'#')).from_reader(text.as_bytes());
    let mut sheet = Sheet { text, header: Vec::new(), rows: Vec::new() };
    let mut record = csv::ByteRecord::new();
    let mut places: Vec<Option<(usize, f64, f64)>> = Vec::new();
    let mut out: Vec<Option<Vec<f64>>> = Vec::new();
    let mut faults = Vec::new();
    loop {
        let from = reader.position().byte() as usize;
        match reader.read_byte_record(&mut record) {
            Ok(true) => {}
            Ok(false) => break,
            Err(error) => return Err(vec![TableError::new("F01", format!("not a CSV table: {error}"))]),
        }
        if record.iter().all(|cell| cell.trim_ascii().is_empty()) || record[0].trim_ascii_start().starts_with(b"#") {
            continue;
        }
        // What is said of a row is said by a sheet of that row alone.
        let row = |sheet: &mut Sheet, record: &csv::ByteRecord| {
            let cells = csv::StringRecord::from_byte_record_lossy(record.clone());
            sheet.rows = vec![Row { start: row_start(text, from), cells }];
        };
        if sheet.header.is_empty() {
            row(&mut sheet, &record);
            sheet.header = sheet.rows[0].cells.iter().map(|cell| cell.trim().to_string()).collect();
            sheet.check_header().map_err(|fault| vec![fault])?;
            for wanted in wanted {
                let place = sheet.place(&wanted.column);
                // A column that may be missing is at fault where something much like it is there.
                let absent = place.as_ref().is_err_and(|fault| fault.message.starts_with("there is no column"));
                match place {
                    Ok(place) => places.push(Some(place)),
                    Err(_) if absent && !wanted.required => places.push(None),
                    Err(fault) => faults.push(fault),
                }
            }
            if !faults.is_empty() {
                return Err(faults);
            }
            out = places.iter().map(|place| place.map(|_| Vec::new())).collect();
            continue;
        }
        if record.len() != sheet.header.len() {
            row(&mut sheet, &record);
            let message = format!("this row has {} values for {} columns", record.len(), sheet.header.len());
            faults.push(TableError { line: Some(sheet.line(0)), ..TableError::new("F01", message) });
        } else {
            for ((place, column), wanted) in places.iter().zip(&mut out).zip(wanted) {
                let (Some((at, factor, offset)), Some(column)) = (*place, column) else { continue };
                let number: Option<f64> =
                    std::str::from_utf8(&record[at]).ok().and_then(|cell| cell.trim().parse().ok());
                let value = number.map_or(f64::NAN, |number| number * factor + offset);
                let (low, high) = wanted.column.range;
                let slack = 1e-9 * value.abs();
                column.push(value);
                if value.is_finite() && value >= low - slack && value <= high + slack {
                    continue;
                }
                row(&mut sheet, &record);
                faults.push(sheet.number(0, at).map_or_else(
                    |fault| fault,
                    |_| {
                        let cell = sheet.rows[0].cells[at].trim();
                        let back = |bound: f64| short((bound - offset) / factor);
                        let message = format!("{cell} is beyond its range");
                        let help = format!("`{}` is from {} to {}", sheet.header[at], back(low), back(high));
                        sheet.locate(TableError::new(wanted.code, message), 0, at).help(help)
                    },
                ));
            }
        }
        if faults.len() >= MOST_FAULTS {
            break;
        }
    }
    match () {
        () if sheet.header.is_empty() => Err(vec![TableError::new("F01", "the table is empty")]),
        () if !faults.is_empty() => Err(faults),
        () if out.iter().flatten().all(|column| column.is_empty()) => {
            Err(vec![TableError::new("F01", "the table has no rows")])
        }
        () => Ok(out),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sunglint_radiometry::Dimension;

    const X: Wanted = wanted("x", Dimension::Length, true, (-10.0, 10.0));
    const TURN: Wanted = wanted("heading", Dimension::Angle, false, (-7.0, 7.0));

    const fn wanted(name: &'static str, dimension: Dimension, required: bool, range: (f64, f64)) -> Wanted {
        Wanted { column: Column { name, dimension, range }, required, code: "U05" }
    }

    #[test]
    fn columns_come_in_canonical_units_in_the_order_asked_for() {
        let text = "\u{FEFF}# surveyed in May\n\nheading_deg,kind,x_cm\n90,\"oak, old\",150\n\n# more\n-180,elm,-20\n";
        let read = read_columns(text, &[X, TURN]).unwrap();
        assert_eq!(read[0], Some(vec![1.5, -0.2]));
        let turns = read[1].as_ref().unwrap();
        assert!((turns[0] - std::f64::consts::FRAC_PI_2).abs() < 1e-15 && turns.len() == 2);
        assert_eq!(read_columns("x_m\n1\n", &[X, TURN]).unwrap()[1], None);
    }

    #[test]
    fn every_fault_has_its_line_and_column() {
        let text = "x_m,heading_deg\n1,0\n2\n# note\nfar,1\n 99,inf\n3,\n";
        let faults = read_columns(text, &[X, TURN]).unwrap_err();
        let found: Vec<_> = faults.iter().map(|f| (f.code, f.line.unwrap(), f.column)).collect();
        let expected =
            vec![("F01", 3, None), ("F01", 5, Some(1)), ("U05", 6, Some(2)), ("F01", 6, Some(5)), ("F01", 7, Some(3))];
        assert_eq!(found, expected);
        let codes = |text| read_columns(text, &[X, TURN]).unwrap_err().iter().map(|f| f.code).collect::<Vec<_>>();
        assert_eq!(codes(""), ["F01"]);
        assert_eq!(codes("x_m\n"), ["F01"]);
        assert_eq!(codes("y_m\n1\n"), ["F02"]);
        assert_eq!(codes("x,heading\n1,2\n"), ["F02", "F02"]);
        assert_eq!(codes("1,2\n3,4\n"), ["F02"]);
    }
}
