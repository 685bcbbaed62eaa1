//! Errors and warnings as data: a code, a message, the places it speaks of, a cause and a mend.
//!
//! Nothing is thrown: each stage pushes onto a `Vec<Diagnostic>` and goes on as far as it can.

pub mod codes;
pub mod files;
pub mod gallery;
pub mod render;

use crate::source::Span;

/// How bad it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// Something worth knowing that needs no action.
    Note,
    /// Probably not what was meant; the run goes on.
    Warning,
    /// The run cannot go on past the stage that found it.
    Error,
}

/// A place and what is said of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Label {
    /// The place.
    pub span: Span,
    /// What is said of it; may be empty.
    pub text: String,
}

/// A change of text that mends the trouble for certain.
#[derive(Clone, Debug, PartialEq)]
pub struct Fix {
    /// What the change does, as a short imperative.
    pub title: String,
    /// Spans and what stands there instead.
    pub edits: Vec<(Span, String)>,
}

/// One error, warning or note.
#[derive(Clone, Debug, PartialEq)]
pub struct Diagnostic {
    /// A row of [`CODES`](codes::CODES), such as `E0101`.
    pub code: &'static str,
    /// How bad it is.
    pub severity: Severity,
    /// What is wrong, in one line without a full stop.
    pub message: String,
    /// The places, the most important first.
    pub labels: Vec<Label>,
    /// Causes and facts, one line each.
    pub notes: Vec<String>,
    /// How to mend it.
    pub help: Option<String>,
    /// The mend itself, where it is certain.
    pub fix: Option<Fix>,
}

impl Diagnostic {
    /// An error that points at `span`.
    pub fn error(code: &'static str, span: Span, message: impl Into<String>) -> Diagnostic {
        Diagnostic::new(Severity::Error, code, span, message)
    }

    /// A warning that points at `span`.
    pub fn warning(code: &'static str, span: Span, message: impl Into<String>) -> Diagnostic {
        Diagnostic::new(Severity::Warning, code, span, message)
    }

    /// A note that points at `span`.
    pub fn note(code: &'static str, span: Span, message: impl Into<String>) -> Diagnostic {
        Diagnostic::new(Severity::Note, code, span, message)
    }

    fn new(
        severity: Severity,
        code: &'static str,
        span: Span,
        message: impl Into<String>,
    ) -> Diagnostic {
        let labels =
            if span.is_none() { vec![] } else { vec![Label { span, text: String::new() }] };
        Diagnostic {
            code,
            severity,
            message: message.into(),
            labels,
            notes: vec![],
            help: None,
            fix: None,
        }
    }

    /// Says something at the first label.
    pub fn says(mut self, text: impl Into<String>) -> Diagnostic {
        if let Some(label) = self.labels.first_mut() {
            label.text = text.into();
        }
        self
    }

    /// Adds a place.
    pub fn label(mut self, span: Span, text: impl Into<String>) -> Diagnostic {
        if !span.is_none() {
            self.labels.push(Label { span, text: text.into() });
        }
        self
    }

    /// Adds a cause or fact.
    pub fn because(mut self, note: impl Into<String>) -> Diagnostic {
        self.notes.push(note.into());
        self
    }

    /// Says how to mend it.
    pub fn help(mut self, help: impl Into<String>) -> Diagnostic {
        self.help = Some(help.into());
        self
    }

    /// Adds the mend itself.
    pub fn fix(mut self, title: impl Into<String>, edits: Vec<(Span, String)>) -> Diagnostic {
        self.fix = Some(Fix { title: title.into(), edits });
        self
    }
}

/// Whether any of them is an error.
pub fn has_errors(diagnostics: &[Diagnostic]) -> bool {
    diagnostics.iter().any(|d| d.severity == Severity::Error)
}
