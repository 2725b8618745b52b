//! Runs of vectors, packed: what a scene holds by the million takes 8 bytes a number and 16 a run.

use crate::ast::{Item, Point, Value, Word};
use crate::{FileId, Span};

/// Most different units in one pack; a list with more is no bulk.
const MOST_UNITS: usize = 32;

/// Runs of vectors of one size, in one file.
#[derive(Clone, Debug, PartialEq)]
pub struct Runs {
    file: FileId,
    size: u8,
    numbers: Vec<f64>,
    rows: Vec<Row>,
    units: Vec<String>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Row {
    /// Vectors up to and with this run.
    vectors: u32,
    start: u32,
    end: u32,
    /// Index in `units` from 1; 0 for none.
    unit: u32,
}

/// One run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Run<'a> {
    /// The numbers of its vectors, one vector after the other.
    pub numbers: &'a [f64],
    /// Its own unit.
    pub unit: Option<&'a str>,
    /// All of it: from its first `(`, or from the key of its statement, to its unit.
    pub span: Span,
}

impl Runs {
    /// No runs yet, of vectors of `size` numbers (2 or 3).
    pub(crate) fn new(file: FileId, size: usize) -> Self {
        Self { file, size: size as u8, numbers: Vec::new(), rows: Vec::new(), units: Vec::new() }
    }
    /// Number of runs.
    pub fn len(&self) -> usize {
        self.rows.len()
    }
    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }
    /// Numbers of a vector: 2 or 3.
    pub fn size(&self) -> usize {
        usize::from(self.size)
    }
    /// Vectors of all runs.
    pub fn vector_count(&self) -> usize {
        self.numbers.len() / self.size()
    }
    /// The file that they stand in.
    pub fn file(&self) -> FileId {
        self.file
    }
    /// Run `i`, which must be below [`Runs::len`].
    pub fn row(&self, i: usize) -> Run<'_> {
        let row = self.rows[i];
        let first = if i == 0 { 0 } else { self.rows[i - 1].vectors as usize };
        Run {
            numbers: &self.numbers[first * self.size()..row.vectors as usize * self.size()],
            unit: (row.unit > 0).then(|| self.units[row.unit as usize - 1].as_str()),
            span: Span { file: self.file, start: row.start, end: row.end },
        }
    }
    /// Whether a run has no unit of its own.
    pub fn has_bare(&self) -> bool {
        self.rows.iter().any(|row| row.unit == 0)
    }

    /// The vectors of run `i` with their places, which are looked up in `text`, the file's.
    pub fn points(&self, i: usize, text: &str) -> Vec<Point> {
        let row = self.row(i);
        let bytes = &text.as_bytes()[..row.span.end as usize];
        let mut at = row.span.start as usize;
        let mut sought = |sign: u8| {
            while let Some(byte) = bytes.get(at).filter(|byte| **byte != sign) {
                at = match byte {
                    b'#' => at + bytes[at..].iter().position(|byte| *byte == b'\n').unwrap_or(bytes.len() - at),
                    _ => at + 1,
                };
            }
            at as u32
        };
        let place = |numbers| {
            let (start, end) = (sought(b'('), sought(b')') + 1);
            Point::new(numbers, Span { start, end: end.min(row.span.end), ..row.span })
        };
        row.numbers.chunks_exact(self.size()).map(place).collect()
    }

    /// Run `i` as an item, without what stands before its first `(`.
    pub fn item(&self, i: usize, text: &str) -> Item {
        let (row, points) = (self.row(i), self.points(i, text));
        let unit = row.unit.map(|unit| Word { text: unit.to_string(), span: self.unit_span(i) });
        let start = points.first().map_or(row.span.start, |point| point.span.start);
        Item { value: Value::Points { points, unit }, span: Span { start, ..row.span } }
    }

    fn unit_span(&self, i: usize) -> Span {
        let row = self.row(i);
        Span { start: row.span.end - row.unit.map_or(0, str::len) as u32, ..row.span }
    }

    /// Takes numbers of a run that is being read; [`Runs::close`] ends it.
    pub(crate) fn extend(&mut self, numbers: &[f64]) {
        self.numbers.extend_from_slice(numbers);
    }
    /// Forgets the run that is being read.
    pub(crate) fn drop_open(&mut self) {
        let closed = self.rows.last().map_or(0, |row| row.vectors as usize);
        self.numbers.truncate(closed * self.size());
    }
    /// Ends a run. `false`, the run forgotten, where it is empty or has one unit too many.
    pub(crate) fn close(&mut self, unit: Option<&str>, start: usize, end: usize) -> bool {
        let vectors = self.vector_count() as u32;
        let unit = match unit {
            None => Some(0),
            Some(unit) => match self.units.iter().position(|known| known == unit) {
                Some(i) => Some(i + 1),
                None if self.units.len() < MOST_UNITS => {
                    self.units.push(unit.to_string());
                    Some(self.units.len())
                }
                None => None,
            },
        };
        let some = self.rows.last().map_or(0, |row| row.vectors) < vectors;
        let Some(unit) = unit.filter(|_| some) else {
            self.drop_open();
            return false;
        };
        self.rows.push(Row { vectors, start: start as u32, end: end as u32, unit: unit as u32 });
        true
    }
    /// Takes a run that was read otherwise. `false` where it does not fit.
    pub(crate) fn push(&mut self, points: &[Point], unit: Option<&str>, span: Span) -> bool {
        if span.file != self.file || points.iter().any(|point| point.numbers().len() != self.size()) {
            return false;
        }
        points.iter().for_each(|point| self.extend(point.numbers()));
        self.close(unit, span.start as usize, span.end as usize)
    }
}
