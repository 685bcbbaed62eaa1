//! What the grammar expected, in words.

use super::expression::{Rule, is_operand, is_operator};
use super::scan::{Piece, STATEMENT_WORDS};
use super::token::UNIT_MARK;
use crate::bond::elements;
use crate::diagnostic::Diagnostic;
use crate::quantity::{is_unit_name, nearest};
use crate::source::Span;
use pest::error::{Error, ErrorVariant, InputLocation};

/// The diagnostic for a statement that is not of the form of a rule.
pub(super) fn report(
    piece: &Piece,
    text: &str,
    masked: &str,
    rule: Rule,
    error: &Error<Rule>,
) -> Diagnostic {
    let at = match error.location {
        InputLocation::Pos(at) => at,
        InputLocation::Span((start, _)) => start,
    };
    let rules = match &error.variant {
        ErrorVariant::ParsingError { positives, .. } => positives.as_slice(),
        ErrorVariant::CustomError { .. } => &[],
    };
    // The place is the next word, not the blanks before it.
    let at = at + masked[at..].len() - masked[at..].trim_start_matches([' ', '\n']).len();
    let offset = piece.span.start as usize;
    let found = &text[offset + at..offset + at + word_length(&masked[at..])];
    let expected = words(rules);
    if let (true, Some(brace)) = (found.is_empty(), piece.opens) {
        return Diagnostic::error("E0101", brace, "`{` cannot stand here")
            .says(format!("expected {expected}"));
    }
    if found.is_empty() {
        let end = offset + masked.trim_end_matches([' ', '\n']).len();
        let last = text[..end].chars().next_back().map_or(0, char::len_utf8);
        let span = Span::new(piece.span.file, end - last, end);
        return help(
            Diagnostic::error("E0101", span, "the statement ends too early")
                .says(format!("expected {expected} after this")),
            masked,
            at,
            rule,
            piece,
        );
    }
    let span = Span::new(piece.span.file, offset + at, offset + at + found.len());
    let error = Diagnostic::error("E0101", span, format!("`{found}` cannot stand here"))
        .says(format!("expected {expected}"));
    help(error, masked, at, rule, piece)
}

/// The bytes of the word, number or sign at the start of a text.
fn word_length(text: &str) -> usize {
    let Some(first) = text.chars().next() else { return 0 };
    let part = |c: char| c.is_alphanumeric() || c == '_';
    if first == UNIT_MARK {
        text.find(|c| c != UNIT_MARK).unwrap_or(text.len())
    } else if part(first) {
        text.find(|c| !part(c)).unwrap_or(text.len())
    } else if first == '"' {
        text[1..].find('"').map_or(text.len(), |end| end + 2)
    } else {
        ["->|", "|->", "->"]
            .iter()
            .find(|arrow| text.starts_with(**arrow))
            .map_or(first.len_utf8(), |arrow| arrow.len())
    }
}

/// The rules in words: `a value`, `an operator or the end of the statement`.
fn words(rules: &[Rule]) -> String {
    let mut words: Vec<&str> = vec![];
    for rule in rules {
        let word = match rule {
            Rule::equals => "`=`",
            Rule::comma => "`,`",
            Rule::arrow => "an arrow",
            Rule::name | Rule::word | Rule::part | Rule::header_parameter => "a name",
            Rule::option => "the name of an option",
            Rule::domain => "a domain",
            Rule::direction => "`in` or `out`",
            Rule::path | Rule::end | Rule::ends | Rule::kind => "an element",
            Rule::port_number => "a port",
            Rule::dots => "`..`",
            Rule::key_follows => "`follows`",
            Rule::bandwidth | Rule::key_bandwidth => "`bandwidth`",
            Rule::margin | Rule::key_margin => "`margin`",
            Rule::observed => "a value",
            Rule::colon_of_kind => "`:`",
            Rule::text => "a text in quotes",
            Rule::unit_text => "a unit",
            Rule::until | Rule::key_until => "`until`",
            Rule::step | Rule::key_step => "`step`",
            Rule::key_in => "`in`",
            Rule::key_as => "`as`",
            Rule::key_then => "`then`",
            Rule::key_else => "`else`",
            Rule::row_break => "`;`",
            Rule::element_arguments => "`(`",
            Rule::EOI => "the end of the statement",
            rule if is_operand(*rule) => "a value",
            rule if is_operator(*rule) => "an operator",
            _ => continue,
        };
        if !words.contains(&word) {
            words.push(word);
        }
    }
    // Where a value may stand, a name may too.
    if words.contains(&"a value") || words.contains(&"an element") {
        words.retain(|word| !matches!(*word, "a name" | "`:`"));
    }
    match words.as_slice() {
        [] => "something else".to_string(),
        [one] => one.to_string(),
        [most @ .., last] => format!("{} or {last}", most.join(", ")),
    }
}

/// What was probably meant.
fn help(error: Diagnostic, masked: &str, at: usize, rule: Rule, piece: &Piece) -> Diagnostic {
    let rest = &masked[at..];
    let word = &rest[..word_length(rest)];
    let before = masked[..at].trim_end_matches([' ', '\n']);
    let blanks = at - before.len();
    if blanks > 1
        && is_unit_name(word)
        && before.ends_with(|c: char| c.is_ascii_digit() || c == '.')
    {
        return error.help("at most one blank stands between a number and its unit");
    }
    if rule == Rule::chain_statement {
        let first_length = word_length(masked);
        let first = &masked[..first_length];
        if word == "=" && before == first {
            let start = Span { end: piece.span.start, ..piece.span };
            let mut error = error;
            error.message = format!("`{first} = …` declares nothing");
            return error
                .says("a declaration begins with its word: `param`, `signal`, `drive`")
                .help(format!("a parameter is declared by `param {first} = …`"))
                .fix("declare a parameter", vec![(start, "param ".to_string())]);
        }
        if before == first && first_length > 2 {
            if let Some(meant) = nearest(first, STATEMENT_WORDS.iter().copied()) {
                return error.help(format!("did you mean `{meant}`?"));
            }
            if let Some(meant) = nearest(first, elements::ELEMENTS.iter().map(|row| row.kind)) {
                return error.help(format!("did you mean `{meant}:{word}`?"));
            }
        }
        if before == first && elements::element(first).is_some() {
            return error.help(format!("an element is written with a colon, `{first}:{word}`"));
        }
        if rest.starts_with(|c: char| c.is_alphanumeric())
            && before.ends_with(|c: char| c.is_alphanumeric() || c == ')')
            && rest.trim_start_matches(|c: char| c.is_alphanumeric() || c == '_').starts_with(':')
        {
            let mut error = error;
            error.message = "an arrow is missing between two elements".to_string();
            return error.help("write `->` between them, or a comma in a list of ends");
        }
        if word == ">" || (word == "-" && rest.trim_start_matches(['-', ' ']).starts_with('>')) {
            return error.help("a half arrow is written `->`");
        }
    }
    if word == "=" && rule != Rule::chain_statement {
        return error.help("`==` compares two values");
    }
    error
}
