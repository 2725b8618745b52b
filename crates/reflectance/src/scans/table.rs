//! Scans as CSV.

use sunglint_radiometry::{Dimension, Unit, Wavelength, units_of};

use super::{Measurement, ScanBand, ScanFault, ScanFaults, Scans, rounded, within_hemisphere};

/// What a column may hold: name without unit, dimension, whether it must be there.
const COLUMNS: [(&str, Dimension, bool); 6] = [
    ("wavelength", Dimension::Wavelength, false),
    ("illumination_zenith", Dimension::Angle, true),
    ("view_zenith", Dimension::Angle, true),
    ("brf", Dimension::Fraction, true),
    ("brf_stddev", Dimension::Fraction, false),
    ("solid_angle", Dimension::SolidAngle, false),
];
// Indices into them.
const WAVELENGTH: usize = 0;
const ILLUMINATION: usize = 1;
const VIEW: usize = 2;
const BRF: usize = 3;
const STDDEV: usize = 4;
const SOLID_ANGLE: usize = 5;

/// Shortest and longest wavelength that a table may speak of \[µm\]; beyond, its unit is wrong.
const WAVELENGTHS: (f64, f64) = (0.1, 100.0);

impl Scans {
    /// Reads CSV. The first line that is no comment (`#`) names the columns: `band`, or `wavelength_nm`, or neither;
    /// `illumination_zenith_deg`; `view_zenith_deg` with its sign, negative on the mirror's side; `brf`; and where
    /// they are known `brf_stddev`, the standard error of `brf`, and `solid_angle_msr`, one for the file. Other units may
    /// end the names; further columns are not read.
    ///
    /// # Errors
    /// All that are found, with their lines: `F01` not a table, not a finite number; `F02` a column that is missing,
    /// ambiguous or without unit; and those of [`new`](Self::new).
    pub fn read_csv(text: &str) -> Result<Self, ScanFaults> {
        let text = text.strip_prefix('\u{FEFF}').unwrap_or(text);
        let mut reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .comment(Some(b'#'))
            .from_reader(text.as_bytes());
        let mut header: Option<Header> = None;
        let mut faults = ScanFaults::default();
        let mut measurements = Vec::new();
        let mut solid_angle: Option<(f64, u64)> = None;
        let mut lines = Lines { text, at: 0, line: 1 };
        let mut cells = csv::StringRecord::new();
        loop {
            let from = reader.position().byte() as usize;
            match reader.read_record(&mut cells) {
                Ok(true) => {}
                Ok(false) => break,
                Err(error) => return Err(ScanFault::new("F01", None, format!("not a CSV table: {error}")).into()),
            }
            if cells.iter().all(|cell| cell.trim().is_empty()) || cells[0].trim_start().starts_with('#') {
                continue;
            }
            let line = lines.of(from);
            let Some(columns) = &header else {
                header = Some(Header::read(&cells, line)?);
                continue;
            };
            match columns.row(&cells, line) {
                Err(found) => found.into_iter().for_each(|fault| faults.push(fault)),
                Ok((measurement, aperture)) => {
                    measurements.push(measurement);
                    match (aperture, solid_angle) {
                        (Some(value), None) => {
                            if let Err(fault) = within_hemisphere(value, Some(line)) {
                                faults.push(fault);
                            }
                            solid_angle = Some((value, line));
                        }
                        (Some(value), Some((first, at))) if (value - first).abs() > 1e-9 * first.abs() => {
                            let message = format!("an aperture of {value} sr here and of {first} sr in line {at}");
                            faults.push(
                                ScanFault::new("M05", Some(line), message)
                                    .help("scans of one file have one aperture: part them"),
                            );
                        }
                        _ => {}
                    }
                }
            }
        }
        let nothing = |message: &str| ScanFault::new("F01", None, message);
        match &header {
            None => return Err(nothing("the table is empty").help(expected()).into()),
            Some(_) if measurements.is_empty() => {
                return Err(if faults.count > 0 { faults } else { nothing("the table has no rows").into() });
            }
            Some(_) => {}
        }
        let aperture = solid_angle.map(|(value, _)| value).filter(|value| within_hemisphere(*value, None).is_ok());
        match (Self::new(measurements, aperture), faults.count) {
            (Ok(scans), 0) => Ok(scans),
            (Ok(_), _) => Err(faults),
            (Err(more), 0) => Err(more),
            (Err(more), _) => {
                let left_out = more.count - more.faults.len();
                more.faults.into_iter().for_each(|fault| faults.push(fault));
                faults.count += left_out;
                faults.faults.sort_by_key(|fault| fault.line);
                Err(faults)
            }
        }
    }

    /// As CSV that [`read_csv`](Self::read_csv) takes: angles to 1e-9°, all other numbers to the last bit.
    pub fn to_csv(&self) -> String {
        // Nanometres where they read back as the same micrometres.
        let exact = |band: &ScanBand| match band {
            ScanBand::Wavelength(wavelength) => rounded(wavelength.nm()) * 1e-3 == wavelength.um(),
            ScanBand::All | ScanBand::Named(_) => true,
        };
        let in_nm = self.bands.iter().all(exact);
        let mut header = match self.bands.first() {
            Some(ScanBand::Named(_)) => vec!["band"],
            Some(ScanBand::Wavelength(_)) => vec![if in_nm { "wavelength_nm" } else { "wavelength_um" }],
            _ => Vec::new(),
        };
        header.extend(["illumination_zenith_deg", "view_zenith_deg", "brf"]);
        let has_stddev = self.readings.iter().any(|reading| reading.stddev.is_some());
        header.extend(has_stddev.then_some("brf_stddev"));
        header.extend(self.solid_angle.map(|_| "solid_angle_sr"));
        let mut out = csv::Writer::from_writer(Vec::new());
        let mut write = |cells: &[String]| {
            // Writing to memory does not fail.
            let _ = out.write_record(cells);
        };
        write(&header.iter().map(|name| name.to_string()).collect::<Vec<_>>());
        for m in self.measurements() {
            let mut cells = match &m.band {
                ScanBand::All => Vec::new(),
                ScanBand::Named(name) => vec![name.clone()],
                ScanBand::Wavelength(wavelength) if in_nm => vec![rounded(wavelength.nm()).to_string()],
                ScanBand::Wavelength(wavelength) => vec![wavelength.um().to_string()],
            };
            cells.extend([m.illumination, m.view].map(|angle| rounded(angle.to_degrees()).to_string()));
            cells.push(m.brf.to_string());
            if has_stddev {
                cells.push(m.stddev.map_or(String::new(), |stddev| stddev.to_string()));
            }
            cells.extend(self.solid_angle.map(|solid_angle| solid_angle.to_string()));
            write(&cells);
        }
        out.into_inner().ok().and_then(|bytes| String::from_utf8(bytes).ok()).unwrap_or_default()
    }
}

fn expected() -> String {
    "it has the columns `band` or `wavelength_nm` or neither, `illumination_zenith_deg`, `view_zenith_deg`, `brf`"
        .into()
}

/// Where the columns stand.
struct Header {
    columns: usize,
    band: Option<usize>,
    places: [Option<(usize, f64)>; COLUMNS.len()],
    names: Vec<String>,
}

impl Header {
    fn read(cells: &csv::StringRecord, line: u64) -> Result<Self, ScanFaults> {
        let names: Vec<String> = cells.iter().map(|cell| cell.trim().to_string()).collect();
        let fault = |message: String| ScanFault::new("F02", Some(line), message);
        let mut faults = ScanFaults::default();
        if names.iter().all(|name| name.parse::<f64>().is_ok()) {
            return Err(fault("the line that names the columns is missing".into()).help(expected()).into());
        }
        if let [one] = &names[..]
            && one.contains([';', '\t'])
        {
            return Err(ScanFault::new("F01", Some(line), "the columns are not parted by commas").into());
        }
        let mut places = [None; COLUMNS.len()];
        for ((stem, dimension, needed), place) in COLUMNS.into_iter().zip(&mut places) {
            let found: Vec<(usize, f64)> =
                names.iter().enumerate().filter_map(|(at, name)| Some((at, factor(name, stem, dimension)?))).collect();
            match found[..] {
                [one] => *place = Some(one),
                [] => {
                    let unit = units_of(dimension).map(|unit| unit.name).collect::<Vec<_>>().join(", ");
                    if names.iter().any(|name| name == stem) {
                        faults.push(
                            fault(format!("the column `{stem}` does not say its unit"))
                                .help(format!("`{stem}_UNIT`, the unit one of {unit}")),
                        );
                    } else if needed {
                        let ending = if dimension == Dimension::Angle { "_deg" } else { "" };
                        faults.push(
                            fault(format!("there is no column `{stem}{ending}`"))
                                .help(format!("the columns are {}", names.join(", "))),
                        );
                    }
                }
                ref several => {
                    let several: Vec<String> = several.iter().map(|(at, _)| format!("`{}`", names[*at])).collect();
                    faults.push(fault(format!("{} say the same", several.join(" and "))).help("keep one of them"));
                }
            }
        }
        let bands: Vec<usize> = (0..names.len()).filter(|at| names[*at] == "band").collect();
        if bands.len() > 1 {
            faults.push(fault("two columns are called `band`".into()));
        }
        if let (Some(_), Some((at, _))) = (bands.first(), places[WAVELENGTH]) {
            let message = format!("rows are for a band or for a wavelength, not both: `band` and `{}`", names[at]);
            faults.push(fault(message).help("leave one of the columns out"));
        }
        let (columns, band) = (names.len(), bands.first().copied());
        faults.into_result(|| Self { columns, band, places, names })
    }

    /// A row, and the solid angle \[sr\] that it states.
    fn row(&self, cells: &csv::StringRecord, line: u64) -> Result<(Measurement, Option<f64>), Vec<ScanFault>> {
        let fault = |code, message: String| ScanFault::new(code, Some(line), message);
        if cells.len() != self.columns {
            let message = format!("{} values under a header of {} columns", cells.len(), self.columns);
            return Err(vec![fault("F01", message)]);
        }
        let mut faults = Vec::new();
        let mut number = |column: usize| -> Option<f64> {
            let (at, factor) = self.places[column]?;
            let text = cells[at].trim();
            if text.is_empty() && !COLUMNS[column].2 && column != WAVELENGTH {
                return None;
            }
            match text.parse::<f64>() {
                Ok(value) if value.is_finite() => return Some(value * factor),
                Ok(_) => faults.push(fault("F01", format!("{}: `{text}` is not a finite number", self.names[at]))),
                Err(_) if text.is_empty() => faults.push(
                    fault("F01", format!("{} has no value here", self.names[at]))
                        .help("leave the whole row out where nothing was measured"),
                ),
                Err(_) => faults.push(fault("F01", format!("{}: `{text}` is no number", self.names[at]))),
            }
            None
        };
        let [wavelength, illumination, view, brf, stddev, solid_angle] =
            [WAVELENGTH, ILLUMINATION, VIEW, BRF, STDDEV, SOLID_ANGLE].map(&mut number);
        if let Some(um) = wavelength.filter(|um| !(WAVELENGTHS.0..=WAVELENGTHS.1).contains(um)) {
            let message = format!("a wavelength of {} nm is beyond 100..100000 nm", rounded(um * 1e3));
            faults.push(fault("U05", message).help("is the column in another unit than its name says?"));
        }
        let band = match (self.band.map(|at| cells[at].trim()), wavelength) {
            (Some(""), _) => {
                faults.push(fault("F01", "the name of the band is missing".into()));
                ScanBand::All
            }
            (Some(name), _) => ScanBand::Named(name.to_string()),
            (None, Some(um)) => ScanBand::Wavelength(Wavelength::from_um(um)),
            (None, None) => ScanBand::All,
        };
        match (illumination, view, brf) {
            (Some(illumination), Some(view), Some(brf)) if faults.is_empty() => {
                Ok((Measurement { band, illumination, view, brf, stddev, line: Some(line) }, solid_angle))
            }
            _ => Err(faults),
        }
    }
}

/// The factor to canonical units of a column `stem_UNIT`; a fraction needs no unit.
fn factor(name: &str, stem: &str, dimension: Dimension) -> Option<f64> {
    let spelled = |unit: &&Unit, end: &str| end.eq_ignore_ascii_case(unit.name) || unit.name == "%" && end == "percent";
    if name == stem {
        return (dimension == Dimension::Fraction).then_some(1.0);
    }
    let end = name.strip_prefix(stem)?.strip_prefix('_')?;
    units_of(dimension).find(|unit| spelled(unit, end)).map(|unit| unit.factor)
}

/// Counts lines up to records, which come in their order; blank lines and comments before a record are not its own.
struct Lines<'a> {
    text: &'a str,
    at: usize,
    line: u64,
}

impl Lines<'_> {
    /// The line of the record that was read from here.
    fn of(&mut self, from: usize) -> u64 {
        let mut start = from.min(self.text.len());
        while let Some(rest) = self.text.get(start..) {
            let next = rest.split_inclusive('\n').next().unwrap_or("");
            if next.is_empty() || !(next.trim().is_empty() || next.starts_with('#')) {
                break;
            }
            start += next.len();
        }
        let passed = self.text.as_bytes().get(self.at..start).unwrap_or_default();
        self.line += passed.iter().filter(|byte| **byte == b'\n').count() as u64;
        self.at = start.max(self.at);
        self.line
    }
}
