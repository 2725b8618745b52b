//! Tables of relative response from text.

/// The rows `(wavelength [µm], relative response)` of one band; the name is empty where the file has no column `band`.
pub type BandResponse = (String, Vec<(f64, f64)>);

/// Headers of the wavelength column, and how many of its unit make 1 µm.
const WAVELENGTHS: [(&str, f64); 2] = [("wavelength_nm", 1e3), ("wavelength_um", 1.0)];
/// Headers of the response column.
const RESPONSES: [&str; 3] = ["relative_response", "response", "transmittance"];

/// Why a text is no table of responses. Lines count from 1.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ResponseError {
    /// A column is missing, or given twice.
    #[error("{problem}; its columns are {found}")]
    Column {
        /// What is missing or ambiguous.
        problem: String,
        /// The columns there are.
        found: String,
    },
    /// A line cannot be read.
    #[error("line {line}: {problem}")]
    Line {
        /// The line.
        line: u64,
        /// What is wrong with it.
        problem: String,
    },
    /// A header and nothing more, or not even that.
    #[error("the table has no rows")]
    Empty,
}

/// Reads a CSV text with the columns `wavelength_nm` (or `wavelength_um`), `relative_response` (or `response`, or
/// `transmittance`) and perhaps `band`; lines that begin with `#` are comments. Bands come in order of first appearance.
///
/// # Errors
/// A column that is missing or there twice; with its line, a number that is malformed, negative or not finite, and a
/// wavelength that does not lie above the band's one before it.
pub fn read_response_csv(text: &str) -> Result<Vec<BandResponse>, ResponseError> {
    let mut bands: Vec<BandResponse> = Vec::new();
    for row in rows(text)? {
        let fault = |problem: String| Err(ResponseError::Line { line: row.line, problem });
        if row.response < 0.0 {
            return fault(format!("a response of {} is negative", row.response));
        }
        if row.wavelength <= 0.0 {
            return fault("a wavelength is above 0".to_string());
        }
        let band = match bands.iter().position(|(name, _)| *name == row.band) {
            Some(found) => &mut bands[found].1,
            None => {
                bands.push((row.band, Vec::new()));
                let newest = bands.len() - 1;
                &mut bands[newest].1
            }
        };
        if band.last().is_some_and(|(before, _)| row.wavelength <= *before) {
            return fault("wavelengths of a band must ascend".to_string());
        }
        band.push((row.wavelength, row.response));
    }
    if bands.is_empty() { Err(ResponseError::Empty) } else { Ok(bands) }
}

pub(crate) struct Row {
    pub line: u64,
    pub band: String,
    /// µm
    pub wavelength: f64,
    pub response: f64,
}

/// The rows as they stand, finite numbers but otherwise unchecked.
pub(crate) fn rows(text: &str) -> Result<Vec<Row>, ResponseError> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let mut lines = text.lines().zip(1u64..).filter(|(line, _)| !line.trim().is_empty() && !line.starts_with('#'));
    let cells = |line: &str| -> Vec<String> {
        line.split(',').map(|cell| cell.trim().trim_matches('"').trim().to_string()).collect()
    };
    let header = cells(lines.next().ok_or(ResponseError::Empty)?.0);
    let quoted =
        |names: &[&str], between: &str| names.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(between);
    let column = |names: &[&str]| -> Result<usize, ResponseError> {
        let mut hits = (0..header.len()).filter(|column| names.contains(&header[*column].as_str()));
        let problem = match (hits.next(), hits.next()) {
            (Some(column), None) => return Ok(column),
            (None, _) => format!("a column {} is missing", quoted(names, " or ")),
            (Some(_), Some(_)) => format!("only one column {} may be there", quoted(names, " or ")),
        };
        let found = quoted(&header.iter().map(String::as_str).collect::<Vec<_>>(), ", ");
        Err(ResponseError::Column { problem, found })
    };
    let wavelength = column(&WAVELENGTHS.map(|(name, _)| name))?;
    let response = column(&RESPONSES)?;
    let band = header.iter().any(|name| name == "band").then(|| column(&["band"])).transpose()?;
    let per_um = WAVELENGTHS.iter().find(|(name, _)| *name == header[wavelength]).map_or(1.0, |(_, per_um)| *per_um);
    let mut rows = Vec::new();
    for (text, line) in lines {
        let cells = cells(text);
        if cells.len() != header.len() {
            let problem = format!("{} cells under {} columns", cells.len(), header.len());
            return Err(ResponseError::Line { line, problem });
        }
        let number = |column: usize| -> Result<f64, ResponseError> {
            let number = cells[column].parse::<f64>().ok().filter(|number| number.is_finite());
            number.ok_or_else(|| {
                let problem = format!("`{}` should hold a number, found `{}`", header[column], cells[column]);
                ResponseError::Line { line, problem }
            })
        };
        let (wavelength, response) = (number(wavelength)? / per_um, number(response)?);
        let band = band.map_or_else(String::new, |band| cells[band].clone());
        rows.push(Row { line, band, wavelength, response });
    }
    Ok(rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_come_in_the_order_of_the_file_with_micrometres() {
        let text = "# filters\nband,wavelength_nm,relative_response\nb,400,0\nb,410,1\na,500,0.5\nb,420,0\na,510,0.5\n";
        let bands = read_response_csv(text).unwrap();
        assert_eq!(bands[0].0, "b");
        assert_eq!(bands[0].1, [(0.4, 0.0), (0.41, 1.0), (0.42, 0.0)]);
        assert_eq!(bands[1].1.len(), 2);
        let single = read_response_csv("\u{feff}wavelength_um, transmittance\r\n0.4, 0.1\r\n0.5, 0.2\r\n").unwrap();
        assert_eq!(single, [(String::new(), vec![(0.4, 0.1), (0.5, 0.2)])]);
    }

    #[test]
    fn faults_name_the_line_or_the_columns() {
        let fault = |text: &str| read_response_csv(text).unwrap_err().to_string();
        let head = "band,wavelength_nm,relative_response\n";
        assert!(fault(&format!("{head}b,400,1\nb,abc,1\n")).starts_with("line 3: `wavelength_nm`"));
        assert!(fault(&format!("{head}b,400,1\nb,410\n")).starts_with("line 3: 2 cells under 3 columns"));
        assert!(fault(&format!("{head}b,400,inf\n")).starts_with("line 2"));
        assert!(fault(&format!("{head}b,400,-0.1\n")).contains("negative"));
        assert!(fault(&format!("{head}b,400,1\n\nb,400,1\n")).starts_with("line 4: wavelengths"));
        assert!(fault("band,wavelength,relative_response\n").contains("`wavelength_nm` or `wavelength_um` is missing"));
        assert!(fault("wavelength_nm,response,transmittance\n").contains("only one"));
        assert!(fault("# nothing\n\nwavelength_nm,response\n\n# here\n400,x").starts_with("line 6"));
        assert_eq!(fault(""), "the table has no rows");
        assert_eq!(fault(head), "the table has no rows");
    }
}
