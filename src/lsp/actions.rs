//! Code actions: the mends that diagnostics carry.

use super::analysis::{Analysis, Checked};
use super::diagnostics;
use super::documents::Documents;
use super::position;
use crate::source::Span;
use lsp_types as lsp;
use std::collections::HashMap;

/// The mends of what stands in a range of the file that was checked.
pub fn actions(
    analysis: &Analysis,
    checked: &Checked,
    documents: &Documents,
    range: lsp::Range,
) -> Vec<lsp::CodeActionOrCommand> {
    let Some(root) = analysis.root() else { return vec![] };
    let text = analysis.text(root);
    let from = position::byte(text, range.start) as u32;
    let to = position::byte(text, range.end) as u32;
    let mut actions = vec![];
    for diagnostic in &checked.diagnostics {
        let Some(fix) = &diagnostic.fix else { continue };
        let span = diagnostics::place(diagnostic, root);
        if span.file != root || span.end < from || span.start > to {
            continue;
        }
        let Some(edit) = edits(analysis, documents, &fix.edits) else { continue };
        actions.push(lsp::CodeActionOrCommand::CodeAction(lsp::CodeAction {
            title: capital(&fix.title),
            kind: Some(lsp::CodeActionKind::QUICKFIX),
            edit: Some(edit),
            is_preferred: Some(true),
            ..lsp::CodeAction::default()
        }));
    }
    actions
}

/// Changes of texts in the protocol's terms; `None` when one of them is in no file that can be changed.
pub fn edits(
    analysis: &Analysis,
    documents: &Documents,
    edits: &[(Span, String)],
) -> Option<lsp::WorkspaceEdit> {
    // The protocol's own table of changes has addresses for keys.
    #[allow(clippy::mutable_key_type)]
    let mut changes: HashMap<lsp::Uri, Vec<lsp::TextEdit>> = HashMap::new();
    for (span, text) in edits {
        if span.is_none() || analysis.name(span.file).starts_with("std/") {
            return None;
        }
        let uri = documents.uri(analysis.name(span.file))?;
        let edit = lsp::TextEdit { range: analysis.range(*span), new_text: text.clone() };
        changes.entry(uri).or_default().push(edit);
    }
    Some(lsp::WorkspaceEdit { changes: Some(changes), ..lsp::WorkspaceEdit::default() })
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or(String::new(), |first| first.to_uppercase().chain(letters).collect())
}
