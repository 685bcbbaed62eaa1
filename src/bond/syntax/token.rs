//! A text cut into tokens: the lexical grammar, one kind for each sort of word and sign.
//!
//! The tokens of a text follow each other without a gap, blanks and comments among them, so that a formatter and an
//! editor need no second reader. Where a unit ends takes the table of units, and that is why this is no part of
//! `grammar/bond.pest`: the grammar reads a masked copy of the text, in which each byte of a unit is [`UNIT_MARK`]
//! and each byte of a comment or another blank a space, all bytes at their places.

use crate::quantity::scan_unit;

/// What a token is, as far as a look at its surroundings can tell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Kind {
    /// Spaces, tabs, carriage returns.
    Blank,
    /// One line's end.
    LineEnd,
    /// `#` to before the line's end.
    Comment,
    /// A name or a word.
    Name,
    /// A number without its unit; the number of a port, as in `t.1`.
    Number,
    /// A unit after a number, or after the `in` of `observe`.
    Unit,
    /// A text in quotes, with them.
    Text,
    /// One of `( [ {`.
    Open(u8),
    /// One of `) ] }`.
    Close(u8),
    /// `,`
    Comma,
    /// `;`
    Semicolon,
    /// `->`, `->|`, `|->`
    Arrow,
    /// `+ - * / ^ < <= > >= = == != <>`, and a lone `!`.
    Operator,
    /// `.`
    Dot,
    /// `..`
    Range,
    /// `:`
    Colon,
    /// A character of no meaning.
    Bad,
    /// A quote that nothing closes, to the line's end.
    OpenQuote,
}

/// A token and its place in bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Token {
    /// What it is.
    pub kind: Kind,
    /// Its first byte.
    pub start: u32,
    /// One past its last byte.
    pub end: u32,
}

impl Token {
    /// Its text.
    pub fn text<'a>(&self, text: &'a str) -> &'a str {
        text.get(self.start as usize..self.end as usize).unwrap_or("")
    }

    /// Whether it is more than a blank, a line's end or a comment.
    pub fn says_something(&self) -> bool {
        !matches!(self.kind, Kind::Blank | Kind::LineEnd | Kind::Comment)
    }
}

/// What stands in a masked text for each byte of a unit.
pub const UNIT_MARK: char = '\u{1}';

/// Two signs that are one operator.
const PAIRS: [&str; 5] = ["<=", ">=", "==", "!=", "<>"];

/// Cuts a text into tokens, and makes the copy that the grammar reads.
pub(super) fn cut(text: &str) -> (Vec<Token>, String) {
    let mut lexer = Lexer {
        text,
        tokens: Vec::with_capacity(text.len() / 3),
        depth: 0,
        begins: true,
        observe: false,
        last: Kind::LineEnd,
        wants_unit: false,
    };
    let mut masked = String::with_capacity(text.len());
    let mut at = 0;
    while let Some((kind, length)) = lexer.token(at) {
        let end = at + length;
        match kind {
            Kind::Comment | Kind::Blank => masked.extend(std::iter::repeat_n(' ', length)),
            Kind::Unit => masked.extend(std::iter::repeat_n(UNIT_MARK, length)),
            _ => masked.push_str(&text[at..end]),
        }
        lexer.push(Token { kind, start: at as u32, end: end as u32 });
        at = end;
    }
    (lexer.tokens, masked)
}

struct Lexer<'a> {
    text: &'a str,
    tokens: Vec<Token>,
    /// Open brackets.
    depth: usize,
    /// Whether the next word begins a statement.
    begins: bool,
    /// Whether the statement is an `observe`.
    observe: bool,
    /// The kind of the last token that says something.
    last: Kind,
    /// Whether the last token that says something is the `in` of an `observe`.
    wants_unit: bool,
}

impl Lexer<'_> {
    /// Keeps a token, and what later ones need to know of it.
    fn push(&mut self, token: Token) {
        match token.kind {
            Kind::Blank | Kind::Comment => {}
            Kind::LineEnd => {
                let goes_on = matches!(self.last, Kind::Comma | Kind::Arrow);
                self.begins |= self.depth == 0 && !goes_on;
                self.wants_unit &= !self.begins;
            }
            kind => {
                if self.begins {
                    self.observe = token.text(self.text) == "observe";
                }
                self.begins = false;
                self.wants_unit = false;
                match kind {
                    Kind::Open(b'{') | Kind::Close(b'}') => {
                        self.depth = 0;
                        self.begins = true;
                    }
                    Kind::Open(_) => self.depth += 1,
                    Kind::Close(_) => self.depth = self.depth.saturating_sub(1),
                    Kind::Semicolon => self.begins = self.depth == 0,
                    Kind::Name if self.observe && self.depth == 0 => {
                        self.wants_unit = token.text(self.text) == "in";
                    }
                    _ => {}
                }
                self.last = kind;
            }
        }
        self.tokens.push(token);
    }

    /// The kind and the bytes of the token at `start`; `None` at the end.
    fn token(&self, start: usize) -> Option<(Kind, usize)> {
        let rest = &self.text[start..];
        let first = rest.chars().next()?;
        let line = |rest: &str| rest.find('\n').unwrap_or(rest.len());
        Some(match first {
            '\n' => (Kind::LineEnd, 1),
            ' ' => (Kind::Blank, run(rest, |c| c != '\n' && c != '\u{b}' && c.is_whitespace())),
            c if c.is_ascii_alphabetic() || c == '_' => self.word(start),
            c if c.is_ascii_digit() => (Kind::Number, self.number(start)),
            '#' => (Kind::Comment, line(rest)),
            '"' => match rest[1..].find(['"', '\n']) {
                Some(end) if rest[1 + end..].starts_with('"') => (Kind::Text, end + 2),
                end => (Kind::OpenQuote, end.map_or(rest.len(), |end| end + 1)),
            },
            '(' | '[' | '{' => (Kind::Open(first as u8), 1),
            ')' | ']' | '}' => (Kind::Close(first as u8), 1),
            ',' => (Kind::Comma, 1),
            ';' => (Kind::Semicolon, 1),
            '-' if rest.starts_with("->|") => (Kind::Arrow, 3),
            '-' if rest.starts_with("->") => (Kind::Arrow, 2),
            '|' if rest.starts_with("|->") => (Kind::Arrow, 3),
            '+' | '-' | '*' | '/' | '^' | '<' | '>' | '=' | '!' => {
                let pair = PAIRS.iter().any(|pair| rest.starts_with(pair));
                (Kind::Operator, if pair { 2 } else { 1 })
            }
            '.' if rest.starts_with("..") => (Kind::Range, 2),
            '.' if rest[1..].starts_with(|c: char| c.is_ascii_digit()) && !self.member() => {
                (Kind::Number, number_length(rest))
            }
            '.' => (Kind::Dot, 1),
            ':' => (Kind::Colon, 1),
            '%' | '°' => (Kind::Unit, first.len_utf8()),
            c if c.is_whitespace() && c != '\u{b}' => {
                (Kind::Blank, run(rest, |c| c != '\n' && c != '\u{b}' && c.is_whitespace()))
            }
            c if c.is_alphabetic() => self.word(start),
            c => (Kind::Bad, c.len_utf8()),
        })
    }

    fn word(&self, start: usize) -> (Kind, usize) {
        let rest = &self.text[start..];
        match if self.takes_unit() { scan_unit(rest) } else { 0 } {
            0 => (Kind::Name, run(rest, |c| c.is_alphabetic() || c.is_ascii_digit() || c == '_')),
            unit => (Kind::Unit, unit),
        }
    }

    /// Whether a word that comes next is a unit: after a number and at most one blank, or after `in`.
    fn takes_unit(&self) -> bool {
        let number = match self.tokens.as_slice() {
            [.., number, blank] if blank.kind == Kind::Blank => {
                number.kind == Kind::Number && blank.end - blank.start == 1
            }
            [.., number] => number.kind == Kind::Number,
            [] => false,
        };
        let number = number && !self.after_member();
        number || self.wants_unit
    }

    /// Whether what stands before is a name or its index, at once: a dot after it begins a member.
    fn member(&self) -> bool {
        self.tokens.last().is_some_and(|token| {
            matches!(token.kind, Kind::Name | Kind::Close(b']') | Kind::Number)
        })
    }

    /// Whether the last number is a member, as the 1 of `t.1`.
    fn after_member(&self) -> bool {
        let mut before = self.tokens.iter().rev().skip_while(|t| t.kind != Kind::Number).skip(1);
        before.next().is_some_and(|token| token.kind == Kind::Dot)
    }

    fn number(&self, start: usize) -> usize {
        let rest = &self.text[start..];
        match self.tokens.last() {
            // After the dot of a member only digits count.
            Some(token) if token.kind == Kind::Dot => run(rest, |c| c.is_ascii_digit()),
            _ => number_length(rest),
        }
    }
}

/// Bytes of the characters at the start of a text that are all of one sort.
fn run(text: &str, sort: impl Fn(char) -> bool) -> usize {
    text.find(|c| !sort(c)).unwrap_or(text.len())
}

/// Bytes of the number at the start of a text: `12`, `0.5`, `.5`, `1e-6`; the dots of `1..3` are not its.
fn number_length(text: &str) -> usize {
    let digits = |text: &str| text.bytes().take_while(u8::is_ascii_digit).count();
    let mut at = digits(text);
    if text[at..].starts_with('.') && !text[at..].starts_with("..") {
        let decimals = digits(&text[at + 1..]);
        if at > 0 || decimals > 0 {
            at += 1 + decimals;
        }
    }
    if text[at..].starts_with(['e', 'E']) {
        let sign = usize::from(text[at + 1..].starts_with(['+', '-']));
        let exponent = digits(&text[at + 1 + sign..]);
        if exponent > 0 {
            at += 1 + sign + exponent;
        }
    }
    at
}
