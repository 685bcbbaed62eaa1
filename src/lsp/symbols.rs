//! The outline of a file: models with their parts, elements, parameters, signals.

use super::analysis::Analysis;
use crate::bond::elements::element;
use crate::bond::syntax::{Chain, Statement, StatementKind};
use crate::source::{FileId, Span};
use lsp_types as lsp;

/// The outline of a file.
pub fn outline(analysis: &Analysis, file: FileId) -> Vec<lsp::DocumentSymbol> {
    let mut found = vec![];
    if let Some(tree) = analysis.tree(file) {
        statements(analysis, &tree.statements, &mut found);
    }
    found
}

fn statements(analysis: &Analysis, all: &[Statement], found: &mut Vec<lsp::DocumentSymbol>) {
    let symbol = |name: Span, whole: Span, kind, detail: String| {
        symbol(analysis, analysis.source(name).to_string(), name, whole, kind, detail)
    };
    for statement in all {
        let whole = statement.span;
        match &statement.kind {
            StatementKind::Chain(chain) => elements(analysis, chain, found),
            StatementKind::Parameter { name, value, .. } => {
                let value = analysis.source(value.span).to_string();
                found.push(symbol(name.span, whole, lsp::SymbolKind::CONSTANT, value));
            }
            StatementKind::Signal { name, value } => {
                let value = analysis.source(value.span).to_string();
                found.push(symbol(name.span, whole, lsp::SymbolKind::VARIABLE, value));
            }
            StatementKind::Input(names) => {
                found.extend(names.iter().map(|name| {
                    symbol(name.span, whole, lsp::SymbolKind::EVENT, "input".to_string())
                }))
            }
            StatementKind::Port(port) => {
                let domain = port.domain.as_ref().map_or("port", |domain| domain.text.as_str());
                let kind = lsp::SymbolKind::INTERFACE;
                found.push(symbol(port.name.span, whole, kind, domain.to_string()));
            }
            StatementKind::Model(model) => {
                let kind = lsp::SymbolKind::CLASS;
                let mut outer = symbol(model.name.span, whole, kind, "model".to_string());
                let mut inner = vec![];
                for parameter in &model.parameters {
                    let name = parameter.name.span;
                    let default = parameter.default.as_ref();
                    let all = default.map_or(name, |value| name.join(value.span));
                    let value = default.map_or("", |value| analysis.source(value.span)).to_string();
                    inner.push(symbol(name, all, lsp::SymbolKind::CONSTANT, value));
                }
                statements(analysis, &model.body, &mut inner);
                outer.children = Some(inner);
                found.push(outer);
            }
            StatementKind::For { body, .. } => statements(analysis, body, found),
            StatementKind::If { then, otherwise, .. } => {
                statements(analysis, then, found);
                statements(analysis, otherwise, found);
            }
            _ => {}
        }
    }
}

/// What a chain declares.
fn elements(analysis: &Analysis, chain: &Chain, found: &mut Vec<lsp::DocumentSymbol>) {
    let ends = chain.first.iter().chain(chain.links.iter().flat_map(|(_, ends)| ends));
    for end in ends {
        let Some(kind) = &end.kind else { continue };
        let row = element(&kind.text);
        let junction = row.is_some_and(|row| row.shape.is_junction());
        let sort = match row {
            Some(_) if junction => lsp::SymbolKind::ENUM_MEMBER,
            Some(_) => lsp::SymbolKind::FIELD,
            None => lsp::SymbolKind::OBJECT,
        };
        let detail = row.map_or(kind.text.as_str(), |row| row.noun).to_string();
        let name = kind.span.join(end.path.name.span);
        let shown = format!("{}:{}", kind.text, analysis.source(end.path.span));
        found.push(symbol(analysis, shown, name, end.span, sort, detail));
    }
}

#[allow(deprecated)]
fn symbol(
    analysis: &Analysis,
    shown: String,
    name: Span,
    whole: Span,
    kind: lsp::SymbolKind,
    detail: String,
) -> lsp::DocumentSymbol {
    // A long value is a wall in an outline.
    let detail = match detail.char_indices().nth(60) {
        Some((end, _)) => format!("{}…", &detail[..end]),
        None => detail,
    };
    lsp::DocumentSymbol {
        name: shown,
        detail: Some(detail.replace('\n', " ")),
        kind,
        tags: None,
        deprecated: None,
        range: analysis.range(whole.join(name)),
        selection_range: analysis.range(name),
        children: None,
    }
}
