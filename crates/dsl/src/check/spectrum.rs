//! Spectra, tables and files.

use std::collections::BTreeSet;
use std::sync::Arc;

use sunglint_plugin::{Column, FileArg, SpectralValue, Table, TableKey};
use sunglint_radiometry::{Curve, CurveError, Dimension, Extrapolation};

use super::Checker;
use super::block::{Line, Rule, rule};
use super::value::{Given, Quantity, WAVELENGTH};
use crate::ast::{Item, Value, Word};
use crate::scene::SceneFile;
use crate::table::{TableError, read_spectrum, read_table};
use crate::{Diagnostic, Loaded, Span};

/// Words that may follow a spectrum.
pub(super) const SPECTRUM: &[Rule] =
    &[rule("column", "column NAME").word(), rule("extrapolate", "extrapolate hold|linear")];

/// A file asked for: read, or not to be opened because nothing uses it.
pub(super) enum Opened {
    File(Loaded),
    Skipped,
}

impl<'a> Checker<'a> {
    /// The file that a string names.
    pub(super) fn open(&mut self, given: &Given<'a>, path: &'a str) -> Option<Opened> {
        if !self.opening {
            return Some(Opened::Skipped);
        }
        let from = self.sources.get(given.home.file).path.clone();
        let key = (path, from);
        let known = self.files.get(&key).cloned();
        let read = known.unwrap_or_else(|| self.loader.read(path, &key.1));
        self.files.insert(key, read.clone());
        match read {
            Ok(loaded) => Some(Opened::File(loaded)),
            Err(error) => {
                let fault = self.misfit(given, "F01", error.message);
                let near = error.nearest.map(|near| format!("\"{near}\"?")).unwrap_or_default();
                self.report(fault.label(near));
                None
            }
        }
    }

    /// A file that the plan reads further.
    pub(super) fn scene_file(&mut self, line: &Line<'a>, item: &'a Item) -> Option<SceneFile> {
        let given = self.resolve(item, &[]);
        let Value::Text(path) = given.value else {
            self.wrong(line, &given, "a file, named in quotes");
            return None;
        };
        match self.open(&given, path)? {
            Opened::File(loaded) => Some(SceneFile { path: loaded.path, bytes: loaded.bytes, span: given.span }),
            Opened::Skipped => Some(SceneFile { path: path.clone(), bytes: Arc::new([]), span: given.span }),
        }
    }

    /// A file that a model reads.
    pub(super) fn file_arg(&mut self, line: &Line<'a>) -> Option<FileArg> {
        let (path, given) = self.text(line)?;
        match self.open(&given, path)? {
            Opened::File(loaded) => Some(FileArg { name: path.to_string(), bytes: loaded.bytes }),
            Opened::Skipped => Some(FileArg { name: path.to_string(), bytes: Arc::new([]) }),
        }
    }

    /// The text of a file, or what stands in for it where the file is not opened.
    pub(super) fn file_text(&mut self, given: &Given<'a>, path: &'a str) -> Option<Option<(String, String)>> {
        let Opened::File(loaded) = self.open(given, path)? else { return Some(None) };
        match std::str::from_utf8(&loaded.bytes) {
            Ok(text) => Some(Some((loaded.path, text.to_string()))),
            Err(error) => {
                let line = loaded.bytes[..error.valid_up_to()].iter().filter(|byte| **byte == b'\n').count() + 1;
                let message = format!("{}: line {line} is not UTF-8 text", loaded.path);
                let fault = self.misfit(given, "F01", message).help("save the file as UTF-8");
                self.report(fault);
                None
            }
        }
    }

    pub(super) fn table_fault(&mut self, given: &Given<'a>, path: &str, text: &str, error: TableError) {
        let mut place = path.to_string();
        if let Some(line) = error.line {
            place = format!("{place}:{line}");
            if let Some(column) = error.column {
                place = format!("{place}:{column}");
            }
        }
        let mut fault = self.misfit(given, error.code, format!("{place}: {}", error.message));
        if let Some(line) = error.line {
            let file = match self.tables.get(path) {
                Some(file) => *file,
                None => {
                    let file = self.sources.add(path, text);
                    self.tables.insert(path.to_string(), file);
                    file
                }
            };
            let start: usize = text.split_inclusive('\n').take((line as usize).saturating_sub(1)).map(str::len).sum();
            let row = text.get(start..).unwrap_or_default().lines().next().unwrap_or_default();
            let span = Span { file, start: start as u32, end: (start + row.len()) as u32 };
            fault = fault.note(span, "this line of the file");
        }
        self.report(Diagnostic { help: error.help, ..fault });
    }

    /// One quantity for all wavelengths, a file, `[WAVELENGTH value, …]` or `[BAND value, …]`.
    pub(super) fn spectrum(&mut self, line: &Line<'a>, q: &Quantity) -> Option<SpectralValue> {
        let (items, clauses) = self.clauses(line);
        let Some(item) = items.first() else {
            self.absent(line, "a spectrum");
            return None;
        };
        let given = self.resolve(item, &[]);
        let extrapolate = match clauses.get("extrapolate") {
            Some(clause) => match self.word_of(&clause, &["hold", "linear"])? {
                "hold" => Extrapolation::Hold,
                _ => Extrapolation::Linear,
            },
            None => Extrapolation::None,
        };
        let column = match clauses.get("column") {
            Some(clause) => Some((self.column_name(&clause)?, clause)),
            None => None,
        };
        if let Some((_, clause)) = &column
            && !matches!(given.value, Value::Text(_))
        {
            self.report(Diagnostic::error("S05", clause.span(), "`column` belongs to a file").label("no file here"));
            return None;
        }
        let value = match given.value {
            Value::Text(path) => {
                self.surplus(line, items, 1);
                let Some((path, text)) = self.file_text(&given, path)? else {
                    return Some(SpectralValue::Constant(q.low.max(0.0)));
                };
                let name = column.map(|(name, _)| name);
                match read_spectrum(text.trim_start_matches('\u{feff}'), name, q.of) {
                    Ok(curve) => {
                        let (low, high) = curve.range();
                        for value in [low, high] {
                            self.convert(
                                line,
                                &given,
                                (value, &super::value::written(value)),
                                canonical(q).as_ref(),
                                q,
                            )?;
                        }
                        SpectralValue::Curve(curve)
                    }
                    Err(error) => {
                        self.table_fault(&given, &path, &text, error);
                        return None;
                    }
                }
            }
            Value::List { rows, unit } => {
                self.surplus(line, items, 1);
                self.spectrum_rows(line, &given, rows, unit.as_ref(), q)?
            }
            _ => SpectralValue::Constant(self.quantity_at(line, items, q)?),
        };
        match (value, clauses.get("extrapolate")) {
            (SpectralValue::Curve(curve), _) => Some(SpectralValue::Curve(curve.extrapolate(extrapolate))),
            (_, Some(clause)) => {
                let message = "`extrapolate` belongs to a table against wavelength";
                self.report(Diagnostic::error("S05", clause.span(), message).label("nothing to extrapolate"));
                None
            }
            (value, None) => Some(value),
        }
    }

    fn column_name(&mut self, line: &Line<'a>) -> Option<&'a str> {
        let name = match line.items {
            [] => {
                self.absent(line, "the name of a column");
                return None;
            }
            [Item { value: Value::Word(name) | Value::Text(name), .. }, ..] => name.as_str(),
            [item, ..] => {
                let given = self.resolve(item, &[]);
                self.wrong(line, &given, "the name of a column");
                return None;
            }
        };
        self.surplus(line, line.items, 1);
        Some(name)
    }

    fn spectrum_rows(
        &mut self,
        line: &Line<'a>,
        given: &Given<'a>,
        rows: &'a [Vec<Item>],
        shared: Option<&Word>,
        q: &Quantity,
    ) -> Option<SpectralValue> {
        let mut curve: Vec<(f64, f64)> = Vec::new();
        let mut bands: Vec<(String, f64)> = Vec::new();
        let mut named = BTreeSet::new();
        let mut last: Option<Span> = None;
        for row in rows.iter().filter(|row| !row.is_empty()) {
            let place = super::block::join(row[0].span, row[row.len() - 1].span);
            let [key, value] = row.as_slice() else {
                let message = format!("a row holds a wavelength or a band, and a value; this one holds {}", row.len());
                self.report(Diagnostic::error("U04", place, message).label("two values, then a comma"));
                return None;
            };
            let first = self.resolve(key, &[]);
            let second = self.resolve(value, &[]);
            if let (Value::Word(band), None) = (first.value, first.constant) {
                let number = self.measure(line, &second, shared, q)?;
                if !named.insert(band.as_str()) {
                    let message = format!("band `{band}` has two values");
                    self.report(Diagnostic::error("M05", key.span, message).label("named again"));
                    return None;
                }
                bands.push((band.clone(), number));
            } else {
                let wavelength = self.measure(line, &first, None, &WAVELENGTH)?;
                let number = self.measure(line, &second, shared, q)?;
                if let Some((before, _)) = curve.last()
                    && wavelength <= *before
                {
                    let doubled = wavelength == *before;
                    let message = if doubled { "a wavelength stands twice" } else { "the wavelengths do not ascend" };
                    let fault = Diagnostic::error("M05", key.span, message).label("must lie above the one before");
                    self.report(fault.note(last.unwrap_or(key.span), "the one before"));
                    return None;
                }
                curve.push((wavelength, number));
                last = Some(key.span);
            }
            if !curve.is_empty() && !bands.is_empty() {
                let message = "a spectrum is given by wavelength or by band, not by both";
                self.report(Diagnostic::error("U04", place, message).label("unlike the rows before"));
                return None;
            }
        }
        if !bands.is_empty() {
            return Some(SpectralValue::PerBand(bands));
        }
        match Curve::linear(&curve) {
            Ok(curve) => Some(SpectralValue::Curve(curve)),
            Err(CurveError::Empty | CurveError::NotAscending { .. } | CurveError::NotFinite { .. }) => {
                let fault = self.misfit(given, "M05", "this spectrum has no rows").label("[WAVELENGTH value, …]?");
                self.report(fault);
                None
            }
        }
    }

    /// Rows of numbers: inline, or from a CSV file.
    pub(super) fn table(&mut self, line: &Line<'a>, columns: &[Column]) -> Option<Table> {
        let Some(item) = line.items.first() else {
            self.absent(line, "a table");
            return None;
        };
        let given = self.resolve(item, &[]);
        let table = match given.value {
            Value::Text(path) => {
                let Some((path, text)) = self.file_text(&given, path)? else {
                    return Some(Table { key: TableKey::None, rows: Vec::new() });
                };
                match read_table(text.trim_start_matches('\u{feff}'), columns) {
                    Ok(table) => table,
                    Err(error) => {
                        self.table_fault(&given, &path, &text, error);
                        return None;
                    }
                }
            }
            Value::List { rows, unit } => self.table_rows(line, rows, unit.as_ref(), columns)?,
            _ => {
                let names: Vec<&str> = columns.iter().map(|column| column.name).collect();
                self.wrong(line, &given, &format!("a table of {}", names.join(", ")));
                return None;
            }
        };
        self.surplus(line, line.items, 1);
        self.in_order(&given, &table, columns)?;
        Some(table)
    }

    fn table_rows(
        &mut self,
        line: &Line<'a>,
        rows: &'a [Vec<Item>],
        shared: Option<&Word>,
        columns: &[Column],
    ) -> Option<Table> {
        let mut out: Vec<Vec<f64>> = Vec::with_capacity(rows.len());
        let (mut bands, mut wavelengths) = (Vec::new(), Vec::new());
        for row in rows.iter().filter(|row| !row.is_empty()) {
            let place = super::block::join(row[0].span, row[row.len() - 1].span);
            let keyed = row.len() == columns.len() + 1;
            if row.len() != columns.len() && !keyed {
                let names: Vec<&str> = columns.iter().map(|column| column.name).collect();
                let message =
                    format!("a row of `{}` holds {} values; this one holds {}", line.key, names.len(), row.len());
                self.report(Diagnostic::error("U04", place, message).label(names.join(", ")));
                return None;
            }
            let mut values = row.as_slice();
            if keyed {
                let key = self.resolve(&row[0], &[]);
                match key.value {
                    Value::Word(band) => bands.push(band.clone()),
                    _ => wavelengths.push(self.measure(line, &key, None, &WAVELENGTH)?),
                }
                values = &row[1..];
            }
            let mut numbers = Vec::with_capacity(columns.len());
            for (item, column) in values.iter().zip(columns) {
                let given = self.resolve(item, &[]);
                let q = Quantity::new(column.dimension).within(column.range.0, column.range.1);
                let named = Line { key: column.name, ..*line };
                numbers.push(self.measure(&Line { param: true, ..named }, &given, shared, &q)?);
            }
            out.push(numbers);
            let keys = (bands.len(), wavelengths.len());
            if ![(0, 0), (out.len(), 0), (0, out.len())].contains(&keys) {
                let message = "rows are for bands, for wavelengths, or for all; this table mixes them";
                self.report(Diagnostic::error("U04", place, message).label("unlike the rows before"));
                return None;
            }
        }
        let key = match (bands.is_empty(), wavelengths.is_empty()) {
            (false, _) => TableKey::Band(bands),
            (_, false) => TableKey::Wavelength(wavelengths),
            _ => TableKey::None,
        };
        Some(Table { key, rows: out })
    }

    /// A table has rows, and where it is a function of its first column alone, that column ascends.
    fn in_order(&mut self, given: &Given<'a>, table: &Table, columns: &[Column]) -> Option<()> {
        if table.rows.is_empty() {
            let fault = self.misfit(given, "M05", "this table has no rows");
            self.report(fault);
            return None;
        }
        let measured = columns.iter().filter(|column| column.dimension != Dimension::Fraction).count();
        let function = measured == 1 && columns.first().is_some_and(|first| first.dimension != Dimension::Fraction);
        if !function || columns.len() < 2 {
            return Some(());
        }
        let same_key = |a: usize, b: usize| match &table.key {
            TableKey::None => true,
            TableKey::Band(bands) => bands[a] == bands[b],
            TableKey::Wavelength(wavelengths) => wavelengths[a] == wavelengths[b],
        };
        let fault = (1..table.rows.len()).find(|&i| same_key(i, i - 1) && table.rows[i][0] <= table.rows[i - 1][0]);
        let Some(row) = fault else { return Some(()) };
        let span = match given.value {
            Value::List { rows, .. } => {
                let rows: Vec<&Vec<Item>> = rows.iter().filter(|row| !row.is_empty()).collect();
                rows.get(row).map_or(given.span, |row| row[0].span)
            }
            _ => given.span,
        };
        let what = columns[0].name.replace('_', " ");
        let message = format!("row {} of the table: its {what} does not lie above the one before", row + 1);
        let fault = Diagnostic::error("M05", span, message).label("rows ascend, none twice");
        self.report(fault);
        None
    }
}

fn canonical(q: &Quantity) -> Option<Word> {
    let name = q.of.canonical();
    let span = Span { file: crate::FileId(0), start: 0, end: 0 };
    (!name.is_empty()).then(|| Word { text: name.to_string(), span })
}
