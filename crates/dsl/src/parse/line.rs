//! One statement, or one row of a list, as the grammar reads it: on one line, in ASCII, bulk values as one token.

use crate::Span;
use crate::ast::Value;

/// The line, and where its parts stand in the source.
#[derive(Default)]
pub(super) struct Line {
    /// The line.
    pub text: String,
    /// Lists and runs of points that `[]` and `()` stand for, in order.
    pub bulk: Vec<(Value, Span)>,
    /// Offsets in `text` at which a new line of the source begins.
    pub breaks: Vec<usize>,
    /// (offset in `text`, offset in the source), where the two stop running alike.
    anchors: Vec<(usize, usize)>,
}

impl Line {
    pub(super) fn clear(&mut self) {
        self.text.clear();
        self.bulk.clear();
        self.breaks.clear();
        self.anchors.clear();
    }

    /// Adds text that stands at `at` in the source.
    pub(super) fn push(&mut self, at: usize, text: &str) {
        let here = self.text.len();
        if self.anchors.last().is_none_or(|(offset, source)| here - offset + source != at) {
            self.anchors.push((here, at));
        }
        self.text.push_str(text);
    }

    /// Adds ASCII that is written otherwise in the source, in `len` bytes at `at`.
    pub(super) fn replace(&mut self, at: usize, len: usize, ascii: &str) {
        for i in 0..ascii.len() {
            let left = ascii.len() - i;
            self.push(if i == 0 { at } else { at + len.saturating_sub(left) }, &ascii[i..=i]);
        }
    }

    /// The place in `source` of the bytes `start..end` of the line, on character boundaries.
    pub(super) fn original(&self, start: usize, end: usize, source: &str) -> (usize, usize) {
        let map = |offset: usize| {
            let i = self.anchors.partition_point(|anchor| anchor.0 <= offset).saturating_sub(1);
            let (here, there) = self.anchors.get(i).copied().unwrap_or((0, 0));
            (there + offset - here).min(source.len())
        };
        let (mut from, mut to) = (map(start), (map(end.max(start + 1) - 1) + 1).min(source.len()));
        while !source.is_char_boundary(from) {
            from -= 1;
        }
        while !source.is_char_boundary(to) {
            to += 1;
        }
        (from, to.max(from))
    }
}
