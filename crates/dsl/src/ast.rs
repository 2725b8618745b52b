//! The shape of a scene, known without its meaning.

use crate::runs::Runs;
use crate::{Sources, Span};

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
    /// The statement said again, right behind it, each time with another run of vectors: the same key, the same word, then
    /// this run. Only a statement of a word and a run, without a block, has any; [`Ast::spelt_out`] undoes it.
    pub again: Option<Box<Runs>>,
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

/// A vector of two or three numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    numbers: [f64; 3],
    size: u8,
    /// From `(` to `)`.
    pub span: Span,
}

impl Point {
    /// The vector of two or three numbers; further ones are dropped.
    pub fn new(numbers: &[f64], span: Span) -> Self {
        let size = numbers.len().min(3);
        let mut of = [0.0; 3];
        of[..size].copy_from_slice(&numbers[..size]);
        Self { numbers: of, size: size as u8, span }
    }
    /// The two or three numbers.
    pub fn numbers(&self) -> &[f64] {
        &self.numbers[..usize::from(self.size)]
    }
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
        /// The vectors.
        points: Vec<Point>,
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
    /// A list whose rows are one run of vectors each, all of one size: `[(0 0 0) (1 0 0) (1 1 0), …] m`. A list of anything
    /// else, or of nothing, is a [`Value::List`].
    Runs {
        /// The rows.
        runs: Box<Runs>,
        /// The unit that serves the rows without one.
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

impl Ast {
    /// The tree with every statement for itself: what [`Statement::again`] holds stands behind its statement. Those stay
    /// as they are of which `packed` says so, told the key of the block that they stand in.
    #[must_use]
    pub fn spelt_out(&self, sources: &Sources, packed: &dyn Fn(Option<&str>, &Statement) -> bool) -> Self {
        Self { statements: spelt_out(&self.statements, None, sources, packed), version: self.version }
    }
}

fn spelt_out(
    statements: &[Statement],
    within: Option<&str>,
    sources: &Sources,
    packed: &dyn Fn(Option<&str>, &Statement) -> bool,
) -> Vec<Statement> {
    let mut out = Vec::with_capacity(statements.len());
    for statement in statements {
        if statement.again.is_some() && packed(within, statement) {
            out.push(statement.clone());
            continue;
        }
        let block = statement.block.as_ref().map(|block| Block {
            statements: spelt_out(&block.statements, Some(&statement.key.text), sources, packed),
            span: block.span,
        });
        out.push(Statement {
            key: statement.key.clone(),
            items: statement.items.clone(),
            block,
            span: statement.span,
            again: None,
        });
        let (Some(runs), Some(Value::Word(word))) = (&statement.again, statement.items.first().map(|item| &item.value))
        else {
            continue;
        };
        let text = &sources.get(runs.file()).text;
        for i in 0..runs.len() {
            let span = runs.row(i).span;
            let key_end = span.start as usize + statement.key.text.len();
            let blank = text[key_end..].len() - text[key_end..].trim_ascii_start().len();
            let part = |start: usize, len: usize| Span { start: start as u32, end: (start + len) as u32, ..span };
            let key =
                Word { text: statement.key.text.clone(), span: part(span.start as usize, statement.key.text.len()) };
            let word = Item { value: Value::Word(word.clone()), span: part(key_end + blank, word.len()) };
            out.push(Statement { key, items: vec![word, runs.item(i, text)], block: None, span, again: None });
        }
    }
    out
}
