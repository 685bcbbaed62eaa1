//! What each token of a text is to a reader: the words that formatting and editors go by.
//!
//! Kinds ([`Kind`]) are lexical; a class also sees the statement that a token stands in, so that `step` is a word of
//! the language in `simulate until 1 s step 1 ms`, a function in `step(0 s, 0, 1)` and a name in `1:step`.

use super::scan::{Scan, Step};
use super::statement::statement_word;
use super::token::{Kind, Token};
use crate::source::Span;

/// What a token is to a reader.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Class {
    /// Blanks and line ends.
    Blank,
    /// `#` to before the line's end.
    Comment,
    /// A word of the language: `param`, `until`, `and`, `then`.
    Word,
    /// What stands before the colon of an element, and the name of a model where it is made.
    ElementKind,
    /// What is called: `integ`, `e`, `sqrt`, `sum`.
    Function,
    /// A label of an argument: `Kp` of `Kp = 2`.
    Label,
    /// Any other name: an element, a parameter, a port.
    Name,
    /// A domain, after a port's colon.
    Domain,
    /// A number without its unit.
    Number,
    /// A unit.
    Unit,
    /// A text in quotes.
    Text,
    /// A half arrow, with or without a stroke.
    Arrow,
    /// An operator.
    Operator,
    /// Brackets, commas, dots and the like.
    Sign,
    /// What means nothing.
    Bad,
}

/// The tokens of a text with their classes, without a gap, in order; spans are of the scan's file.
pub(super) fn classes(scan: &Scan<'_>) -> Vec<Class> {
    let mut classes: Vec<Class> = scan.tokens.iter().map(|token| lexical(token.kind)).collect();
    let mut at = 0;
    // Errors are the parser's.
    let mut errors = vec![];
    while let Some(step) = scan.step(at, &mut errors) {
        at = match step {
            Step::Piece(piece) => {
                let from = scan.token_at(piece.span.start);
                let to = scan.token_at(piece.span.end);
                classify(scan, from..to, piece.span, &mut classes);
                piece.next
            }
            Step::Closes(_, next) => match scan.otherwise(next) {
                Some(after) => {
                    if let Some(word) = scan.significant(next) {
                        classes[word] = Class::Word;
                    }
                    scan.brace(after).map_or(after, |(_, next)| next)
                }
                None => next,
            },
        };
    }
    classes
}

/// The tokens of a text and what each is, in order and without a gap: what an editor colours.
pub fn tokens(text: &str) -> Vec<(Class, std::ops::Range<usize>)> {
    let scan = Scan::new(Span::NONE.file, text);
    let spans = scan.tokens.iter().map(|token| token.start as usize..token.end as usize);
    classes(&scan).into_iter().zip(spans).collect()
}

fn lexical(kind: Kind) -> Class {
    match kind {
        Kind::Blank | Kind::LineEnd => Class::Blank,
        Kind::Comment => Class::Comment,
        Kind::Name => Class::Name,
        Kind::Number => Class::Number,
        Kind::Unit => Class::Unit,
        Kind::Text => Class::Text,
        Kind::Arrow => Class::Arrow,
        Kind::Operator => Class::Operator,
        Kind::Open(_) | Kind::Close(_) | Kind::Comma | Kind::Semicolon | Kind::Dot => Class::Sign,
        Kind::Range | Kind::Colon => Class::Sign,
        Kind::Bad | Kind::OpenQuote => Class::Bad,
    }
}

/// Words within statements, at their own level of brackets.
const WORDS: &[(&str, &[&str])] = &[
    ("port", &["in", "out"]),
    ("for", &["in"]),
    ("simulate", &["until", "step"]),
    ("observe", &["in", "as"]),
    ("loop", &["follows", "bandwidth", "margin"]),
];

/// Words of expressions.
const EXPRESSION_WORDS: &[&str] = &["and", "or", "not", "if", "then", "else"];

/// Classes of the words of one statement.
fn classify(scan: &Scan<'_>, range: std::ops::Range<usize>, span: Span, classes: &mut [Class]) {
    let word = statement_word(scan.masked(span)).unwrap_or("");
    let inner = WORDS.iter().find(|(name, _)| *name == word).map_or(&[][..], |(_, words)| words);
    let significant: Vec<usize> = range.filter(|at| scan.tokens[*at].says_something()).collect();
    let kind = |k: usize| significant.get(k).map(|at| scan.tokens[*at].kind);
    let text = |k: usize| significant.get(k).map_or("", |at| scan.tokens[*at].text(scan.text()));
    let adjacent = |a: Token, b: Token| a.end == b.start;
    let mut depth = 0usize;
    for (k, at) in significant.iter().enumerate() {
        let token = scan.tokens[*at];
        let before = k.checked_sub(1).and_then(kind);
        match token.kind {
            Kind::Open(_) => depth += 1,
            Kind::Close(_) => depth = depth.saturating_sub(1),
            Kind::Name | Kind::Number if depth == 0 && word.is_empty() => {
                let declares = kind(k + 1) == Some(Kind::Colon) && before != Some(Kind::Dot);
                classes[*at] = if declares { Class::ElementKind } else { classes[*at] };
            }
            Kind::Name => {
                let call = significant.get(k + 1).is_some_and(|next| {
                    let next = scan.tokens[*next];
                    next.kind == Kind::Open(b'(') && adjacent(token, next)
                });
                let sum = depth > 0 && text(k) == "in" && is_sum(k, &kind, &text);
                let member = matches!(before, Some(Kind::Dot));
                // An index stands directly behind the name that it is of.
                let indexed = significant.get(k + 1).is_some_and(|next| {
                    let next = scan.tokens[*next];
                    next.kind == Kind::Open(b'[') && adjacent(token, next)
                });
                let begins = k == 0 && !word.is_empty();
                let joins = EXPRESSION_WORDS.contains(&text(k)) && !member || sum;
                classes[*at] = if begins || joins {
                    Class::Word
                } else if depth == 0 && k == 1 && word == "model" {
                    Class::ElementKind
                } else if depth == 0
                    && inner.contains(&text(k))
                    && !indexed
                    && in_place(word, k, before)
                    && !second_word(word, k, &significant, classes)
                {
                    Class::Word
                } else if word == "port" && depth == 0 && !names_a_port(k, before) {
                    Class::Domain
                } else if call && !member {
                    Class::Function
                } else if kind(k + 1) == Some(Kind::Operator) && text(k + 1) == "=" && depth > 0 {
                    Class::Label
                } else {
                    Class::Name
                };
            }
            _ => {}
        }
    }
}

/// Whether the `in` at `k` is that of `sum(k in …`.
fn is_sum<'t>(
    k: usize,
    kind: &impl Fn(usize) -> Option<Kind>,
    text: &impl Fn(usize) -> &'t str,
) -> bool {
    k >= 3 && kind(k - 2) == Some(Kind::Open(b'(')) && text(k - 3) == "sum"
}

/// Whether a word of a statement stands where it is one.
fn in_place(word: &str, k: usize, before: Option<Kind>) -> bool {
    match word {
        "port" => k == 1,
        "for" => k == 2,
        "simulate" => !matches!(before, Some(Kind::Operator | Kind::Dot | Kind::Arrow)),
        "observe" => !matches!(before, Some(Kind::Comma | Kind::Operator | Kind::Dot)) && k > 1,
        _ => !matches!(before, Some(Kind::Operator | Kind::Dot)) && k > 2,
    }
}

/// Whether a word stands directly before: then a value begins here, but after the first word of a statement.
fn second_word(word: &str, k: usize, significant: &[usize], classes: &[Class]) -> bool {
    let before = k.checked_sub(1).and_then(|k| significant.get(k));
    let after_word = before.is_some_and(|before| classes[*before] == Class::Word);
    after_word && !(k == 1 && matches!(word, "port" | "simulate"))
}

/// Whether the name at `k` of `port in NAME : DOMAIN` is the port's.
fn names_a_port(k: usize, before: Option<Kind>) -> bool {
    k == 2 && !matches!(before, Some(Kind::Colon))
}
