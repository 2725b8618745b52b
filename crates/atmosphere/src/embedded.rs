//! The tables of `data/`, as compiled in.

/// Rows of numbers of an embedded table, in file order, without comments and header.
///
/// # Panics
/// Where the table is malformed, which the tests of this crate would find: it is part of the program.
pub(crate) fn rows(text: &str) -> Vec<Vec<f64>> {
    let mut reader = csv::ReaderBuilder::new().comment(Some(b'#')).from_reader(text.as_bytes());
    (reader.records())
        .map(|record| {
            let record = record.expect("an embedded table has rows of equal length");
            record.iter().map(|cell| cell.trim().parse().expect("an embedded table holds numbers")).collect()
        })
        .collect()
}
