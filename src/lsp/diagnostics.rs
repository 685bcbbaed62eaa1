//! Diagnostics in the protocol's terms: each at its first place, the other places beside it, notes and help in its text.

use super::analysis::{Analysis, Checked};
use super::documents::Documents;
use crate::diagnostic::{Diagnostic, Severity};
use crate::source::{FileId, Span};
use lsp_types as lsp;
use std::collections::BTreeMap;

/// The diagnostics of a check by the names of the files that they stand in; the file that was checked always has a row.
pub fn by_file(
    analysis: &Analysis,
    checked: &Checked,
    documents: &Documents,
) -> BTreeMap<String, Vec<lsp::Diagnostic>> {
    let mut files: BTreeMap<String, Vec<lsp::Diagnostic>> = BTreeMap::new();
    let Some(root) = analysis.root() else { return files };
    files.insert(analysis.name(root).to_string(), vec![]);
    for diagnostic in &checked.diagnostics {
        let span = place(diagnostic, root);
        let found = convert(diagnostic, span, analysis, documents);
        let row = files.entry(analysis.name(span.file).to_string()).or_default();
        if !row.contains(&found) {
            row.push(found);
        }
    }
    files
}

/// Where a diagnostic is shown: at its first place, else at the beginning of the file that was checked.
pub fn place(diagnostic: &Diagnostic, root: FileId) -> Span {
    let first = diagnostic.labels.iter().map(|label| label.span).find(|span| !span.is_none());
    first.unwrap_or(Span::new(root, 0, 0))
}

/// One diagnostic, shown at a span.
fn convert(
    diagnostic: &Diagnostic,
    span: Span,
    analysis: &Analysis,
    documents: &Documents,
) -> lsp::Diagnostic {
    let related = diagnostic.labels.iter().skip(1).filter_map(|label| {
        let location = analysis.location(label.span, documents)?;
        let message = match label.text.as_str() {
            "" => "here too".to_string(),
            text => text.to_string(),
        };
        Some(lsp::DiagnosticRelatedInformation { location, message })
    });
    let related: Vec<_> = related.collect();
    lsp::Diagnostic {
        range: analysis.range(span),
        severity: Some(match diagnostic.severity {
            Severity::Error => lsp::DiagnosticSeverity::ERROR,
            Severity::Warning => lsp::DiagnosticSeverity::WARNING,
            Severity::Note => lsp::DiagnosticSeverity::INFORMATION,
        }),
        code: Some(lsp::NumberOrString::String(diagnostic.code.to_string())),
        source: Some("bondspice".to_string()),
        message: message(diagnostic),
        related_information: (!related.is_empty()).then_some(related),
        ..lsp::Diagnostic::default()
    }
}

/// The message with all that belongs to it.
fn message(diagnostic: &Diagnostic) -> String {
    let mut text = diagnostic.message.clone();
    if let Some(said) = diagnostic.labels.first().filter(|label| !label.text.is_empty()) {
        text += &format!("\n{}", said.text);
    }
    for note in &diagnostic.notes {
        text += &format!("\nnote: {note}");
    }
    if let Some(help) = &diagnostic.help {
        text += &format!("\nhelp: {help}");
    }
    text
}
