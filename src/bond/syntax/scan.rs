//! Where statements begin and end: the only part of reading that looks at a whole file at once.
//!
//! A statement ends at `;` or the line's end, unless inside brackets; a line's end after `,` or an arrow does not
//! count. Brackets are matched here, before the grammar sees the text, so that an unclosed one costs one statement and
//! not the rest of the file.

use super::tree::{Trivia, TriviaKind};
use crate::diagnostic::Diagnostic;
use crate::quantity::scan_unit;
use crate::source::{FileId, Span};

/// The words that begin statements.
pub const STATEMENT_WORDS: &[&str] = &[
    "param", "signal", "input", "output", "port", "model", "import", "for", "drive", "simulate",
    "options", "observe", "loop", "if",
];

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Blank,
    LineEnd,
    Comment,
    /// Names and numbers.
    Word,
    /// A unit after a number.
    Unit,
    Text,
    Open(u8),
    Close(u8),
    Comma,
    Semicolon,
    Arrow,
    Operator,
    Other,
    /// A character of no meaning.
    Bad,
    /// A quote that nothing closes.
    OpenQuote,
}

#[derive(Clone, Copy, Debug)]
struct Token {
    kind: Kind,
    start: usize,
    end: usize,
}

/// A file cut into tokens.
pub struct Scan<'a> {
    file: FileId,
    text: &'a str,
    tokens: Vec<Token>,
}

/// One statement's text.
#[derive(Clone, Debug)]
pub struct Piece {
    /// From its first to its last significant byte.
    pub span: Span,
    /// Whether an error has been reported that keeps the grammar from reading it.
    pub bad: bool,
    /// Where to look for the next statement when this one can be read.
    pub next: usize,
    /// Where to look for the next statement when it cannot: the first line in it that looks like the start of one.
    pub restart: usize,
}

impl<'a> Scan<'a> {
    /// Cuts a text into tokens.
    pub fn new(file: FileId, text: &'a str) -> Scan<'a> {
        let mut scan = Scan { file, text, tokens: vec![] };
        let mut at = 0;
        while let Some(token) = scan.token(at) {
            at = token.end;
            scan.tokens.push(token);
        }
        scan
    }

    fn token(&self, start: usize) -> Option<Token> {
        let rest = &self.text[start..];
        let first = rest.chars().next()?;
        let until = |stop: &dyn Fn(char) -> bool| rest.find(stop).unwrap_or(rest.len());
        let name = |c: char| c.is_alphabetic() || c.is_ascii_digit() || c == '_';
        let (kind, length) = match first {
            '\n' => (Kind::LineEnd, 1),
            c if c.is_whitespace() && c != '\u{b}' => {
                (Kind::Blank, until(&|c| c == '\n' || !c.is_whitespace()))
            }
            '#' => (Kind::Comment, until(&|c| c == '\n')),
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
            '+' | '-' | '*' | '/' | '^' | '<' | '>' | '=' | '!' => (Kind::Operator, 1),
            '.' if rest[1..].starts_with(|c: char| c.is_ascii_digit()) && !self.member(start) => {
                (Kind::Word, number_length(rest))
            }
            '.' | ':' => (Kind::Other, 1),
            c if c.is_ascii_digit() => (Kind::Word, number_length(rest)),
            '%' | '°' => (Kind::Unit, first.len_utf8()),
            c if name(c) => {
                let word = until(&|c| !name(c));
                // A number and at most one blank before it make it a unit.
                let before = self.tokens.len().checked_sub(1).map(|last| match self.tokens[last] {
                    Token { kind: Kind::Blank, start, end } if end - start == 1 && last > 0 => {
                        &self.tokens[last - 1]
                    }
                    _ => &self.tokens[last],
                });
                let number = before.is_some_and(|t| {
                    t.kind == Kind::Word
                        && self.text[t.start..]
                            .starts_with(|c: char| c.is_ascii_digit() || c == '.')
                        && !self.member(t.start)
                });
                match if number { scan_unit(rest) } else { 0 } {
                    0 => (Kind::Word, word),
                    unit => (Kind::Unit, unit),
                }
            }
            c => (Kind::Bad, c.len_utf8()),
        };
        Some(Token { kind, start, end: start + length })
    }

    /// Whether a number at `start` is a member, as the 1 of `t.1`.
    fn member(&self, start: usize) -> bool {
        let dot = self.text[..start].ends_with('.') && !self.text[..start].ends_with("..");
        let before = self.text[..start].trim_end_matches('.').chars().next_back();
        let dotted = self.text[start..].starts_with('.');
        (dot || dotted) && before.is_some_and(|c| c.is_alphanumeric() || c == '_' || c == ']')
    }

    /// Blanks, line ends and comments.
    pub fn trivia(&self) -> Vec<Trivia> {
        let kind = |kind| match kind {
            Kind::Blank => Some(TriviaKind::Blank),
            Kind::LineEnd => Some(TriviaKind::LineEnd),
            Kind::Comment => Some(TriviaKind::Comment),
            _ => None,
        };
        self.tokens
            .iter()
            .filter_map(|t| Some(Trivia { kind: kind(t.kind)?, span: self.span(t.start, t.end) }))
            .collect()
    }

    fn span(&self, start: usize, end: usize) -> Span {
        Span::new(self.file, start, end)
    }

    /// The piece's text with comments and all blanks made spaces, and every byte of a unit replaced by [`UNIT_MARK`], so that
    /// the grammar, which does not know the table of units, sees where one ends. Bytes keep their places.
    pub fn masked(&self, piece: &Piece) -> String {
        let (from, to) = (piece.span.start as usize, piece.span.end as usize);
        let mut masked = String::with_capacity(to - from);
        let first = self.tokens.partition_point(|t| t.end <= from);
        for t in self.tokens[first..].iter().take_while(|t| t.start < to) {
            match t.kind {
                Kind::Comment | Kind::Blank => {
                    masked.extend(std::iter::repeat_n(' ', t.end - t.start));
                }
                Kind::Unit => masked.extend(std::iter::repeat_n(UNIT_MARK, t.end - t.start)),
                _ => masked.push_str(&self.text[t.start..t.end]),
            }
        }
        masked
    }

    /// The statement that begins at or after token `from`, with errors of its brackets and characters.
    pub fn piece(&self, from: usize, d: &mut Vec<Diagnostic>) -> Option<Piece> {
        let significant =
            |t: &Token| !matches!(t.kind, Kind::Blank | Kind::LineEnd | Kind::Comment);
        let skipped = |t: &Token| !significant(t) || t.kind == Kind::Semicolon;
        let first =
            from + self.tokens[from.min(self.tokens.len())..].iter().position(|t| !skipped(t))?;
        let mut open: Vec<Token> = vec![];
        let mut bad = false;
        let mut last = first;
        let mut restart = None;
        let mut at = first;
        while let Some(&t) = self.tokens.get(at) {
            match t.kind {
                Kind::Blank | Kind::Comment => {}
                Kind::LineEnd => {
                    let goes_on = matches!(self.tokens[last].kind, Kind::Comma | Kind::Arrow);
                    if open.is_empty() && !goes_on {
                        break;
                    }
                    if restart.is_none() && self.looks_like_a_start(at + 1) {
                        restart = Some(at + 1);
                    }
                }
                Kind::Semicolon if open.is_empty() => break,
                Kind::Open(_) => open.push(t),
                Kind::Close(bracket) => match open.pop() {
                    Some(opening) => {
                        let closing = closing(opening.kind);
                        if closing != bracket && !bad {
                            bad = true;
                            d.push(
                                Diagnostic::error(
                                    "E0105",
                                    self.span(t.start, t.end),
                                    format!(
                                        "`{}` closes a bracket that was opened by `{}`",
                                        char::from(bracket),
                                        &self.text[opening.start..opening.end]
                                    ),
                                )
                                .says(format!("expected `{}`", char::from(closing)))
                                .label(self.span(opening.start, opening.end), "opened here"),
                            );
                        }
                        if bracket == b'}' && open.is_empty() {
                            last = at;
                            at += 1;
                            break;
                        }
                    }
                    None if !bad => {
                        bad = true;
                        d.push(
                            Diagnostic::error(
                                "E0105",
                                self.span(t.start, t.end),
                                format!("`{}` closes nothing", char::from(bracket)),
                            )
                            .says("no bracket is open here"),
                        );
                    }
                    None => {}
                },
                Kind::Bad if !bad => {
                    bad = true;
                    d.push(self.bad_character(t));
                }
                Kind::OpenQuote if !bad => {
                    bad = true;
                    d.push(
                        Diagnostic::error(
                            "E0103",
                            self.span(t.start, t.end),
                            "a text in quotes is not closed",
                        )
                        .says("its line ends before the closing `\"`"),
                    );
                }
                _ => {}
            }
            if significant(&t) {
                last = at;
            }
            at += 1;
        }
        if let Some(opening) = open.first().filter(|_| !bad) {
            bad = true;
            d.push(
                Diagnostic::error(
                    "E0104",
                    self.span(opening.start, opening.end),
                    format!("`{}` is never closed", &self.text[opening.start..opening.end]),
                )
                .says(format!("no `{}` for this one", char::from(closing(opening.kind)))),
            );
        }
        let restart = restart.unwrap_or(at);
        if bad {
            // The piece ends where the next statement probably begins.
            last = last.min(restart.saturating_sub(1)).max(first);
        }
        let span = self.span(self.tokens[first].start, self.tokens[last].end);
        Some(Piece { span, bad, next: at, restart })
    }

    /// Whether a line looks like the start of a statement: its first word says so, a kind stands before a colon, or
    /// an arrow follows a name.
    fn looks_like_a_start(&self, from: usize) -> bool {
        let tokens = &self.tokens[from..];
        let mut words = tokens.iter().filter(|t| t.kind != Kind::Blank);
        let Some(first) = words.next().filter(|t| t.kind == Kind::Word) else { return false };
        let Some(second) = words.next() else { return false };
        let word = &self.text[first.start..first.end];
        let colon = &self.text[second.start..second.end] == ":";
        let named = STATEMENT_WORDS.contains(&word)
            && word != "if"
            && matches!(second.kind, Kind::Word | Kind::Text);
        named || colon || second.kind == Kind::Arrow
    }

    fn bad_character(&self, t: Token) -> Diagnostic {
        const MEANT: &[(&str, &str)] = &[
            ("→", "->"),
            ("⇀", "->"),
            ("−", "-"),
            ("–", "-"),
            ("×", "*"),
            ("·", "*"),
            ("⋅", "*"),
            ("÷", "/"),
            ("“", "\""),
            ("”", "\""),
            ("’", "\""),
            ("≤", "<="),
            ("≥", ">="),
            ("≠", "!="),
            ("²", "^2"),
            ("³", "^3"),
        ];
        let c = &self.text[t.start..t.end];
        let span = self.span(t.start, t.end);
        let shown = match c.chars().next() {
            Some(c) if c.is_control() => format!("control character U+{:04X}", c as u32),
            _ => format!("`{c}`"),
        };
        let error = Diagnostic::error("E0102", span, format!("{shown} means nothing here"))
            .says("not a character of the language");
        match MEANT.iter().find(|(wrong, _)| *wrong == c) {
            Some((_, right)) => error
                .help(format!("write `{right}`"))
                .fix(format!("write `{right}`"), vec![(span, right.to_string())]),
            None => error,
        }
    }
}

/// What stands in a masked text for each byte of a unit.
pub const UNIT_MARK: char = '\u{1}';

fn closing(kind: Kind) -> u8 {
    match kind {
        Kind::Open(b'[') => b']',
        Kind::Open(b'{') => b'}',
        _ => b')',
    }
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
