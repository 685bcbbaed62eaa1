//! Errors and warnings as data: a code, a message, the places it speaks of, a cause and a mend.
//!
//! Nothing is thrown: each stage pushes onto a `Vec<Diagnostic>` and goes on as far as it can.

pub mod codes;
pub mod examples;
pub mod files;
pub mod fix;
pub mod gallery;
pub mod render;

use crate::source::Span;
use std::collections::HashMap;
use std::collections::hash_map::Entry;

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
    /// Whether it is a place where the others are used, an instance: repeats that differ there alone are one.
    pub of_use: bool,
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
        let labels = if span.is_none() {
            vec![]
        } else {
            vec![Label { span, text: String::new(), of_use: false }]
        };
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
            self.labels.push(Label { span, text: text.into(), of_use: false });
        }
        self
    }

    /// Adds a place where what the others point at is used.
    pub fn used(mut self, span: Span, text: impl Into<String>) -> Diagnostic {
        if !span.is_none() {
            self.labels.push(Label { span, text: text.into(), of_use: true });
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

/// Makes one of what is said again and again of one place, as of each instance of a model, from `first` on.
pub fn merge_repeats(diagnostics: &mut Vec<Diagnostic>, first: usize) {
    let mut known: HashMap<(&'static str, Vec<Span>), usize> = HashMap::new();
    let mut kept: Vec<(Diagnostic, usize, String)> = vec![];
    for diagnostic in diagnostics.drain(first..) {
        let labels = diagnostic.labels.iter().filter(|label| !label.of_use);
        let spans: Vec<Span> = labels.map(|label| label.span).collect();
        let same = match spans.is_empty() {
            true => None,
            false => match known.entry((diagnostic.code, spans)) {
                Entry::Occupied(entry) => Some(*entry.get()),
                Entry::Vacant(entry) => {
                    entry.insert(kept.len());
                    None
                }
            },
        };
        match same.and_then(|at| kept.get_mut(at)) {
            Some((_, repeats, last)) => {
                *repeats += 1;
                *last = diagnostic.message;
            }
            None => kept.push((diagnostic, 0, String::new())),
        }
    }
    for (diagnostic, repeats, last) in kept {
        diagnostics.push(match repeats {
            0 => diagnostic,
            // The very same is said once.
            _ if last == diagnostic.message => diagnostic,
            1 => diagnostic.because(format!("and once more: {last}")),
            n => diagnostic.because(format!("and {n} times more, the last: {last}")),
        });
    }
}

/// Whether any of them is an error.
pub fn has_errors(diagnostics: &[Diagnostic]) -> bool {
    diagnostics.iter().any(|d| d.severity == Severity::Error)
}
