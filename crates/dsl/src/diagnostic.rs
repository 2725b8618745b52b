//! A diagnostic is data: only the program knows about terminals.

use crate::Span;

/// Every code, `docs/LANGUAGE.md` section 8.
pub const CODES: [&str; 42] = [
    "S01", "S02", "S03", "S04", "S05", "S06", "U01", "U02", "U03", "U04", "U05", "N01", "N02", "N03", "N04", "N05",
    "T01", "T02", "T03", "A01", "A02", "A03", "M01", "M02", "M03", "M04", "M05", "G01", "G02", "G03", "G04", "G05",
    "V01", "V02", "V03", "X01", "X02", "X03", "F01", "F02", "L01", "P01",
];

/// How bad it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// The scene runs, but the user should know.
    Warning,
    /// The scene does not run.
    Error,
}

/// One finding, with its place and its cure.
#[derive(Clone, Debug, PartialEq)]
pub struct Diagnostic {
    /// Stable code, `docs/LANGUAGE.md` section 8.
    pub code: &'static str,
    /// Error or warning.
    pub severity: Severity,
    /// What is wrong, in the field's words; lower case, no final period.
    pub message: String,
    /// Where; `None` for the scene as a whole.
    pub span: Option<Span>,
    /// What stands behind the caret: usually the cure in a few words.
    pub label: String,
    /// Further places, such as a first definition.
    pub notes: Vec<(Span, String)>,
    /// What would be right.
    pub help: Option<String>,
}

impl Diagnostic {
    /// An error at a place.
    pub fn error(code: &'static str, span: Span, message: impl Into<String>) -> Self {
        Self {
            code,
            severity: Severity::Error,
            message: message.into(),
            span: Some(span),
            label: String::new(),
            notes: Vec::new(),
            help: None,
        }
    }
    /// A warning at a place.
    pub fn warning(code: &'static str, span: Span, message: impl Into<String>) -> Self {
        Self { severity: Severity::Warning, ..Self::error(code, span, message) }
    }
    /// An error of the scene as a whole.
    pub fn whole(code: &'static str, message: impl Into<String>) -> Self {
        let place = Span { file: crate::FileId(0), start: 0, end: 0 };
        Self { span: None, ..Self::error(code, place, message) }
    }
    /// With words behind the caret.
    #[must_use]
    pub fn label(mut self, label: impl Into<String>) -> Self {
        self.label = label.into();
        self
    }
    /// With a further place.
    #[must_use]
    pub fn note(mut self, span: Span, text: impl Into<String>) -> Self {
        self.notes.push((span, text.into()));
        self
    }
    /// With a cure.
    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }
}
