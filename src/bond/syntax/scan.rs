//! Where statements begin and end.
//!
//! A statement ends at `;`, at the line's end or before a brace, unless inside brackets; a line's end after `,` or an
//! arrow does not count, nor one before the `{` of a block. Brackets are matched here, before the grammar sees the
//! text, so that an unclosed one costs one statement and not the rest of the file.

use super::token::{Kind, Token, cut};
use super::tree::{Trivia, TriviaKind};
use crate::diagnostic::Diagnostic;
use crate::source::{FileId, Span};

/// The words that begin statements.
pub const STATEMENT_WORDS: &[&str] = &[
    "param", "signal", "input", "output", "port", "model", "import", "for", "drive", "simulate",
    "options", "observe", "loop", "if",
];

/// Those of them that a block follows.
pub const BLOCK_WORDS: &[&str] = &["model", "for", "if"];

/// A file cut into tokens.
pub struct Scan<'a> {
    file: FileId,
    text: &'a str,
    pub(super) tokens: Vec<Token>,
    masked: String,
    /// `{` that are more than the `}`.
    unclosed: i64,
}

/// One statement's text, or that of a block's head.
#[derive(Clone, Debug)]
pub struct Piece {
    /// From its first to its last significant byte; the brace of a block is not part of it.
    pub span: Span,
    /// Whether an error has been reported that keeps the grammar from reading it.
    pub bad: bool,
    /// Where the `{` stands that ends it.
    pub opens: Option<Span>,
    /// Where to look for the next statement when this one can be read.
    pub next: usize,
    /// Where to look for the next statement when it cannot: the first line in it that looks like the start of one.
    pub restart: Option<usize>,
}

/// What comes next in a file.
#[derive(Debug)]
pub enum Step {
    /// A statement or the head of a block.
    Piece(Piece),
    /// The end of a block: where its brace stands, and where to look for the next statement.
    Closes(Span, usize),
}

impl<'a> Scan<'a> {
    /// Cuts a text into tokens.
    pub fn new(file: FileId, text: &'a str) -> Scan<'a> {
        let (tokens, masked) = cut(text);
        let unclosed = tokens.iter().fold(0, |count, token| match token.kind {
            Kind::Open(b'{') => count + 1,
            Kind::Close(b'}') => count - 1,
            _ => count,
        });
        Scan { file, text, tokens, masked, unclosed }
    }

    /// Whether the file has fewer `}` than `{`.
    pub fn lacks_braces(&self) -> bool {
        self.unclosed > 0
    }

    /// The text as it is.
    pub fn text(&self) -> &'a str {
        self.text
    }

    /// Blanks, line ends and comments.
    pub fn trivia(&self) -> Vec<Trivia> {
        let kind = |kind| match kind {
            Kind::Blank => Some(TriviaKind::Blank),
            Kind::LineEnd => Some(TriviaKind::LineEnd),
            Kind::Comment => Some(TriviaKind::Comment),
            _ => None,
        };
        let trivia = |t: &Token| Some(Trivia { kind: kind(t.kind)?, span: self.span(t) });
        self.tokens.iter().filter_map(trivia).collect()
    }

    fn span(&self, token: &Token) -> Span {
        Span { file: self.file, start: token.start, end: token.end }
    }

    fn word(&self, token: &Token) -> &'a str {
        token.text(self.text)
    }

    /// The masked text of a span.
    pub fn masked(&self, span: Span) -> &str {
        self.masked.get(span.start as usize..span.end as usize).unwrap_or("")
    }

    /// The first token that begins at a byte or after it.
    pub fn token_at(&self, byte: u32) -> usize {
        self.tokens.partition_point(|token| token.start < byte)
    }

    /// The first token at or after `from` that says something.
    pub fn significant(&self, from: usize) -> Option<usize> {
        let rest = self.tokens.get(from..)?;
        rest.iter().position(Token::says_something).map(|skipped| from + skipped)
    }

    /// Where the statement after an `else` begins, or its `{` stands, when one stands at or after token `from`.
    pub fn otherwise(&self, from: usize) -> Option<usize> {
        let word = self.significant(from)?;
        let after = self.significant(word + 1)?;
        let (word, follows) = (self.tokens.get(word)?, self.tokens.get(after)?);
        let branch = follows.kind == Kind::Open(b'{') || self.word(follows) == "if";
        (self.word(word) == "else" && branch).then_some(after)
    }

    /// The `{` at a token, and what comes after it.
    pub fn brace(&self, at: usize) -> Option<(Span, usize)> {
        let token = self.tokens.get(at).filter(|token| token.kind == Kind::Open(b'{'))?;
        Some((self.span(token), at + 1))
    }

    /// What comes after the first `{` at or after a token.
    pub fn next_brace(&self, from: usize) -> Option<usize> {
        let rest = self.tokens.get(from..)?;
        rest.iter().position(|token| token.kind == Kind::Open(b'{')).map(|at| from + at + 1)
    }

    /// The blanks before a place, when nothing else stands before it on its line.
    pub fn indent(&self, at: u32) -> Option<usize> {
        let before = self.text.get(..at as usize)?;
        let blanks = before.bytes().rev().take_while(|byte| matches!(byte, b' ' | b'\t')).count();
        let first = before.len() == blanks || before.as_bytes()[before.len() - blanks - 1] == b'\n';
        first.then_some(blanks)
    }

    /// Where the block whose first token is `from` is over, and whether its first line holds nothing: then it is
    /// probably one of statements.
    pub fn skip_block(&self, from: usize) -> (Option<usize>, bool) {
        let next = self.tokens.get(from..).unwrap_or_default();
        let empty_line = next
            .iter()
            .find(|token| !matches!(token.kind, Kind::Blank | Kind::Comment))
            .is_none_or(|token| token.kind == Kind::LineEnd);
        let mut depth = 1;
        for (at, token) in next.iter().enumerate() {
            match token.kind {
                Kind::Open(b'{') => depth += 1,
                Kind::Close(b'}') => depth -= 1,
                _ => {}
            }
            if depth == 0 {
                return (Some(from + at + 1), empty_line);
            }
        }
        (None, empty_line)
    }

    /// What comes at or after token `from`, with errors of its brackets and characters.
    pub fn step(&self, from: usize, d: &mut Vec<Diagnostic>) -> Option<Step> {
        let skipped = |t: &Token| !t.says_something() || t.kind == Kind::Semicolon;
        let first = from + self.tokens.get(from..)?.iter().position(|t| !skipped(t))?;
        let begins = self.tokens.get(first)?;
        if begins.kind == Kind::Close(b'}') {
            return Some(Step::Closes(self.span(begins), first + 1));
        }
        let block = BLOCK_WORDS.contains(&self.word(begins));
        let mut open: Vec<Token> = vec![];
        let mut bad = false;
        let mut last = first;
        let mut restart = None;
        let mut opens = None;
        let mut at = first;
        while let Some(&t) = self.tokens.get(at) {
            match t.kind {
                Kind::Blank | Kind::Comment => {}
                Kind::LineEnd => {
                    let goes_on = matches!(self.tokens[last].kind, Kind::Comma | Kind::Arrow);
                    if open.is_empty() && !goes_on && !(block && self.brace_follows(at)) {
                        break;
                    }
                    if restart.is_none() && self.looks_like_a_start(at + 1) {
                        restart = Some(at + 1);
                    }
                }
                Kind::Semicolon if open.is_empty() => break,
                Kind::Open(b'{') if open.is_empty() || restart.is_none() && block => {
                    opens = Some(self.span(&t));
                    break;
                }
                Kind::Open(b'{') if restart.is_some() => break,
                Kind::Close(b'}') if open.iter().all(|t| t.kind != Kind::Open(b'{')) => break,
                Kind::Open(_) => open.push(t),
                Kind::Close(bracket) => match open.pop() {
                    Some(opening) => {
                        let closing = closing(opening.kind);
                        if closing != bracket && !bad {
                            bad = true;
                            d.push(
                                Diagnostic::error(
                                    "E0105",
                                    self.span(&t),
                                    format!(
                                        "`{}` closes a bracket that was opened by `{}`",
                                        char::from(bracket),
                                        self.word(&opening)
                                    ),
                                )
                                .says(format!("expected `{}`", char::from(closing)))
                                .label(self.span(&opening), "opened here"),
                            );
                        }
                    }
                    None if !bad => {
                        bad = true;
                        d.push(closes_nothing(self.span(&t), char::from(bracket)));
                    }
                    None => {}
                },
                Kind::Bad if !bad => {
                    bad = true;
                    d.push(self.bad_character(&t));
                }
                Kind::OpenQuote if !bad => {
                    bad = true;
                    d.push(
                        Diagnostic::error("E0103", self.span(&t), "a text in quotes is not closed")
                            .says("its line ends before the closing `\"`"),
                    );
                }
                _ => {}
            }
            if t.says_something() {
                last = at;
            }
            at += 1;
        }
        if let Some(opening) = open.first().filter(|_| !bad) {
            bad = true;
            d.push(
                Diagnostic::error(
                    "E0104",
                    self.span(opening),
                    format!("`{}` is never closed", self.word(opening)),
                )
                .says(format!("no `{}` for this one", char::from(closing(opening.kind)))),
            );
        }
        if let (true, Some(restart)) = (bad, restart) {
            // The piece ends where the next statement probably begins.
            last = last.min(restart.saturating_sub(1)).max(first);
            opens = None;
        }
        let span = Span { end: self.tokens[last].end, ..self.span(begins) };
        let next = at + usize::from(opens.is_some());
        Some(Step::Piece(Piece { span, bad, opens, next, restart }))
    }

    fn brace_follows(&self, at: usize) -> bool {
        self.significant(at).is_some_and(|next| self.tokens[next].kind == Kind::Open(b'{'))
    }

    /// Whether a line looks like the start of a statement: its first word says so, a kind stands before a colon, or
    /// an arrow follows a name.
    fn looks_like_a_start(&self, from: usize) -> bool {
        let mut words = self.tokens[from..].iter().filter(|t| t.kind != Kind::Blank);
        let Some(first) = words.next().filter(|t| matches!(t.kind, Kind::Name | Kind::Number))
        else {
            return false;
        };
        let Some(second) = words.next() else { return false };
        let word = self.word(first);
        let named = STATEMENT_WORDS.contains(&word)
            && word != "if"
            && matches!(second.kind, Kind::Name | Kind::Number | Kind::Text);
        named || matches!(second.kind, Kind::Colon | Kind::Arrow)
    }

    fn bad_character(&self, t: &Token) -> Diagnostic {
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
        let c = self.word(t);
        let span = self.span(t);
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

/// The error for a closing bracket without its opening one.
pub fn closes_nothing(span: Span, bracket: char) -> Diagnostic {
    let open = if bracket == '}' { "no block is open here" } else { "no bracket is open here" };
    Diagnostic::error("E0105", span, format!("`{bracket}` closes nothing")).says(open)
}

fn closing(kind: Kind) -> u8 {
    match kind {
        Kind::Open(b'[') => b']',
        Kind::Open(b'{') => b'}',
        _ => b')',
    }
}
