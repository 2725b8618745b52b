//! The shape of a scene, known without its meaning.

use crate::Span;

/// The statements of a scene, includes resolved: those of an included file stand where its `include` stood.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Ast {
    /// Top-level statements.
    pub statements: Vec<Statement>,
    /// Version that the main file states, with its place.
    pub version: Option<(f64, Span)>,
}

/// `key item item … { block }`
#[derive(Clone, Debug, PartialEq)]
pub struct Statement {
    /// The key.
    pub key: Word,
    /// What follows it on the line.
    pub items: Vec<Item>,
    /// What stands in braces.
    pub block: Option<Block>,
    /// From the key to the last item, without the block.
    pub span: Span,
}

/// Statements in braces.
#[derive(Clone, Debug, PartialEq)]
pub struct Block {
    /// The statements.
    pub statements: Vec<Statement>,
    /// Braces included.
    pub span: Span,
}

/// A word and its place.
#[derive(Clone, Debug, PartialEq)]
pub struct Word {
    /// The text.
    pub text: String,
    /// Where it stands.
    pub span: Span,
}

/// One word or value of a statement.
#[derive(Clone, Debug, PartialEq)]
pub struct Item {
    /// The value.
    pub value: Value,
    /// Where it stands, its unit included.
    pub span: Span,
}

/// A value as written.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// A word: keyword, name, `prefix.name`, `on`, `facing`; also `*` in a map is a string.
    Word(String),
    /// `12`, `23 km`, `60 %`. `digits` is the number as written.
    Number {
        /// The number.
        number: f64,
        /// As written, without unit.
        digits: String,
        /// Its unit, if it has one.
        unit: Option<Word>,
    },
    /// `420..520 nm`
    Range {
        /// Lower number.
        low: f64,
        /// Upper number.
        high: f64,
        /// The unit of both.
        unit: Option<Word>,
    },
    /// `640 x 480`: across, down.
    Grid(u64, u64),
    /// One vector or a run of vectors, two or three numbers each: `(0 0 0) (1 0 0) m`.
    Points {
        /// The vectors with their places.
        points: Vec<(Vec<f64>, Span)>,
        /// The unit that ends the run.
        unit: Option<Word>,
    },
    /// `[5, 10] km`, `[400 nm 0.10, 700 nm 0.32]`: rows of items.
    List {
        /// The rows.
        rows: Vec<Vec<Item>>,
        /// The unit that serves the bare numbers.
        unit: Option<Word>,
    },
    /// `"…"`, escapes resolved.
    Text(String),
    /// A date, a clock, a UTC offset, or any of them in that order as one instant.
    Moment {
        /// Year, month, day as written.
        date: Option<(i32, u8, u8)>,
        /// Hour, minute, second as written.
        clock: Option<(u8, u8, f64)>,
        /// Minutes east of UTC.
        offset: Option<i32>,
    },
}
