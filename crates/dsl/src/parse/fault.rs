//! Where the parser's findings go.

use crate::{Diagnostic, FileId, Span};

/// Faults of shape listed for one file; further ones are only counted.
const MOST: usize = 1000;

/// The findings in one file.
pub(super) struct Faults<'a> {
    file: FileId,
    list: &'a mut Vec<Diagnostic>,
    first: usize,
    muted: bool,
    unlisted: Option<Span>,
}

impl<'a> Faults<'a> {
    pub(super) fn new(file: FileId, list: &'a mut Vec<Diagnostic>) -> Self {
        Self { file, first: list.len(), list, muted: false, unlisted: None }
    }

    /// This file.
    pub(super) fn file(&self) -> FileId {
        self.file
    }

    /// A place in this file.
    pub(super) fn span(&self, start: usize, end: usize) -> Span {
        Span { file: self.file, start: start as u32, end: end as u32 }
    }

    pub(super) fn push(&mut self, diagnostic: Diagnostic) {
        if self.muted {
            return;
        }
        if self.len() < MOST {
            self.list.push(diagnostic);
        } else if self.unlisted.is_none() {
            self.unlisted = diagnostic.span;
        }
    }

    pub(super) fn len(&self) -> usize {
        self.list.len() - self.first
    }

    /// Forgets what was found since there were `len` findings: that text is read again.
    pub(super) fn truncate(&mut self, len: usize) {
        self.list.truncate(self.first + len);
    }

    /// Drops what is found until the next call.
    pub(super) fn mute(&mut self, muted: bool) {
        self.muted = muted;
    }

    /// Says so where not all is listed.
    pub(super) fn close(self) {
        if let Some(span) = self.unlisted {
            let message = format!("this file has more faults of shape than the {MOST} that are listed");
            self.list.push(Diagnostic::error("S02", span, message).label("the first that is not"));
        }
    }
}
