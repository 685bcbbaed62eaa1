//! Colours and layout: the classes of tokens in the protocol's terms, and the formatter's text.

use super::analysis::Analysis;
use super::position;
use crate::bond::syntax::{self, Class};
use crate::source::FileId;
use lsp_types::{SemanticToken, SemanticTokenType, SemanticTokensLegend};

/// The protocol's word for each class that is coloured.
const LEGEND: &[(Class, SemanticTokenType)] = &[
    (Class::Comment, SemanticTokenType::COMMENT),
    (Class::Word, SemanticTokenType::KEYWORD),
    (Class::ElementKind, SemanticTokenType::TYPE),
    (Class::Function, SemanticTokenType::FUNCTION),
    (Class::Label, SemanticTokenType::PROPERTY),
    (Class::Name, SemanticTokenType::VARIABLE),
    (Class::Domain, SemanticTokenType::ENUM_MEMBER),
    (Class::Number, SemanticTokenType::NUMBER),
    (Class::Unit, SemanticTokenType::MACRO),
    (Class::Text, SemanticTokenType::STRING),
    (Class::Arrow, SemanticTokenType::OPERATOR),
    (Class::Operator, SemanticTokenType::OPERATOR),
];

/// What the numbers of [`tokens`] mean.
pub fn legend() -> SemanticTokensLegend {
    let token_types = LEGEND.iter().map(|(_, token)| token.clone()).collect();
    SemanticTokensLegend { token_types, token_modifiers: vec![] }
}

/// The coloured tokens of a file, each by its distance from the one before.
pub fn tokens(analysis: &Analysis, file: FileId) -> Vec<SemanticToken> {
    let text = analysis.text(file);
    let mut found = vec![];
    let (mut line, mut column, mut at) = (0u32, 0u32, 0usize);
    let (mut last_line, mut last_column) = (0u32, 0u32);
    for (class, range) in syntax::tokens(text) {
        // From the place of the token before to this one.
        let between = text.get(at..range.start).unwrap_or("");
        let breaks = between.bytes().filter(|byte| *byte == b'\n').count() as u32;
        let tail = between.rfind('\n').map_or(between, |end| &between[end + 1..]);
        column = position::units(tail) as u32 + if breaks == 0 { column } else { 0 };
        line += breaks;
        at = range.start;
        let Some(token_type) = LEGEND.iter().position(|(known, _)| *known == class) else {
            continue;
        };
        let length = position::units(text.get(range).unwrap_or("")) as u32;
        found.push(SemanticToken {
            delta_line: line - last_line,
            delta_start: if line == last_line { column - last_column } else { column },
            length,
            token_type: token_type as u32,
            token_modifiers_bitset: 0,
        });
        (last_line, last_column) = (line, column);
    }
    found
}

/// The text in the one layout; `None` while it has errors of syntax.
pub fn formatted(analysis: &Analysis, file: FileId) -> Option<String> {
    let mut d = vec![];
    syntax::parse(&analysis.map, file, &mut d);
    (!crate::diagnostic::has_errors(&d)).then(|| syntax::format(analysis.text(file)))
}
