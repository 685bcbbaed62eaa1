//! A place in a logical line, moved over words, numbers and expressions.
//!
//! SPICE takes blanks, commas and often brackets for one and the same; each method says what it skips.

use super::{Reader, number};
use crate::diagnostic::Diagnostic;
use crate::expr::Node;
use crate::netlist::{Expr, Leaf, Name, Names};
use crate::source::Span;

/// A place in a logical line.
#[derive(Clone, Copy)]
pub struct Cursor<'l> {
    /// The line.
    pub text: &'l str,
    /// Where the line starts in the file.
    pub base: usize,
    /// How far it has been read.
    pub at: usize,
}

/// Whether what stands between an opening and a closing mark never leaves them.
fn is_one_group(inner: &str, close: char) -> bool {
    if close != '}' {
        return !inner.contains(close);
    }
    let mut depth = 0;
    inner.bytes().all(|byte| {
        depth += i32::from(byte == b'{') - i32::from(byte == b'}');
        depth >= 0
    })
}

/// What ends a word.
fn ends_word(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t' | b'\r' | b',' | b'(' | b')' | b'=' | b'{' | b'}' | b'\'' | b'"')
}

impl<'l> Cursor<'l> {
    /// The byte at the place.
    pub fn peek(&self) -> Option<u8> {
        self.text.as_bytes().get(self.at).copied()
    }

    /// Skips blanks and commas.
    pub fn blanks(&mut self) {
        while matches!(self.peek(), Some(b' ' | b'\t' | b'\r' | b',')) {
            self.at += 1;
        }
    }

    /// Skips blanks, commas and round brackets.
    pub fn loose(&mut self) {
        while matches!(self.peek(), Some(b' ' | b'\t' | b'\r' | b',' | b'(' | b')')) {
            self.at += 1;
        }
    }

    /// Whether nothing is left but blanks.
    pub fn is_done(&mut self) -> bool {
        self.blanks();
        self.at >= self.text.len()
    }

    /// Moves over a byte, after blanks, if it is there.
    pub fn take(&mut self, byte: u8) -> bool {
        self.blanks();
        let there = self.peek() == Some(byte);
        self.at += usize::from(there);
        there
    }

    /// The next word, after blanks; empty when there is none.
    pub fn word(&mut self) -> (&'l str, usize) {
        self.blanks();
        let from = self.at;
        while self.peek().is_some_and(|byte| !ends_word(byte)) {
            self.at += 1;
        }
        (&self.text[from..self.at], from)
    }

    /// The next word, which may be a node: it may stand in brackets.
    pub fn node(&mut self) -> (&'l str, usize) {
        self.loose();
        self.word()
    }

    /// Looks at the next word without moving.
    pub fn next_word(&self) -> &'l str {
        let mut ahead = *self;
        ahead.word().0
    }

    /// The next word if `=` follows it, moving over both.
    pub fn key(&mut self) -> Option<(&'l str, usize)> {
        let mut ahead = *self;
        ahead.loose();
        let (word, from) = ahead.word();
        if word.is_empty() || !ahead.take(b'=') {
            return None;
        }
        *self = ahead;
        Some((word, from))
    }

    /// Where the rest of the line stands.
    pub fn rest(&mut self) -> (&'l str, usize) {
        self.blanks();
        let rest = self.text[self.at..].trim_end();
        (rest, self.at)
    }

    /// A span of the line.
    pub fn span(&self, reader: &Reader, from: usize, to: usize) -> Span {
        Span::new(reader.file, self.base + from, self.base + to)
    }

    /// The span of the next word, or of the line's last character.
    pub fn here(&self, reader: &Reader) -> Span {
        let mut ahead = *self;
        ahead.loose();
        let (word, from) = ahead.word();
        if !word.is_empty() {
            return self.span(reader, from, from + word.len());
        }
        let last = self.text.trim_end().char_indices().next_back().map_or(0, |(k, _)| k);
        let end = self.text.trim_end().len();
        match self.text[from..].chars().next() {
            Some(letter) => self.span(reader, from, from + letter.len_utf8()),
            None => self.span(reader, last, end),
        }
    }
}

/// The name of a node; what is called the ground is `0`.
pub fn node_name(names: &mut Names, grounds: &[&str], word: &str) -> Name {
    let ground = grounds.iter().any(|ground| ground.eq_ignore_ascii_case(word));
    names.intern(if ground { "0" } else { word })
}

impl Reader<'_> {
    /// A name at a place.
    pub fn name(&mut self, (word, _): (&str, usize)) -> Name {
        self.names.intern(word)
    }

    /// A node; an error when there is none.
    pub fn node(&mut self, cursor: &mut Cursor, what: &str) -> Option<Name> {
        let (word, _) = cursor.node();
        if word.is_empty() {
            self.missing(cursor, what);
            return None;
        }
        Some(self.node_name(word))
    }

    /// The name of a node; what the dialect calls the ground is `0`.
    pub fn node_name(&mut self, word: &str) -> Name {
        node_name(&mut self.names, self.reading.grounds, word)
    }

    /// A value: a number, a name, `{expression}` or `'expression'`; an error when there is none.
    pub fn value(&mut self, cursor: &mut Cursor, what: &str) -> Option<Expr> {
        cursor.blanks();
        let from = cursor.at;
        let close = match cursor.peek() {
            Some(b'{') => b'}',
            Some(b'\'') => b'\'',
            Some(b'"') => b'"',
            _ => {
                let (word, from) = cursor.word();
                if word.is_empty() {
                    self.missing(cursor, what);
                    return None;
                }
                return self.bare_value(cursor, word, from);
            }
        };
        let bytes = cursor.text.as_bytes();
        let (mut at, mut depth) = (from + 1, 1);
        while at < bytes.len() {
            if bytes[at] == close {
                depth -= 1;
            } else if bytes[at] == b'{' && close == b'}' {
                depth += 1;
            }
            if depth == 0 {
                break;
            }
            at += 1;
        }
        if depth > 0 {
            let span = cursor.span(self, from, from + 1);
            let message = format!("`{}` is not closed", &cursor.text[from..from + 1]);
            self.diagnostics.push(Diagnostic::error("E0704", span, message));
            cursor.at = cursor.text.len();
            return None;
        }
        cursor.at = at + 1;
        self.expression(cursor, from + 1, at)
    }

    /// A value that a word is.
    fn bare_value(&mut self, cursor: &mut Cursor, word: &str, from: usize) -> Option<Expr> {
        let span = cursor.span(self, from, from + word.len());
        let Some(read) = number::number(word, self.reading.numbers) else {
            let plain =
                word.chars().all(|c| c.is_alphanumeric() || matches!(c, '_' | '.' | '#' | '$'));
            if plain {
                return Some(Expr::new(Node::Leaf(Leaf::Parameter(self.names.intern(word))), span));
            }
            return self.expression(cursor, from, from + word.len());
        };
        let rest = &word[read.end..];
        if rest.starts_with(['+', '-', '*', '/', '^', '?', '<', '>', '&', '|']) {
            return self.expression(cursor, from, from + word.len());
        }
        if !rest.is_empty() {
            let ignored = cursor.span(self, from + read.end, from + word.len());
            let message = format!("`{word}` is read as {}", &word[..read.end]);
            let warning = Diagnostic::warning("W0702", ignored, message)
                .says("this is left out")
                .help("write the number with a decimal point: 4.7k, not 4k7");
            self.diagnostics.push(warning);
        }
        if read.end > read.letters {
            let warning = super::suffix_warning(&word[..read.end], &read, span);
            self.diagnostics.extend(warning);
        }
        Some(Expr::new(Node::Number(read.value), span))
    }

    /// The expression between two places, perhaps within one pair of braces or quotes.
    pub fn grouped(&mut self, cursor: &Cursor, from: usize, to: usize) -> Option<Expr> {
        let text = &cursor.text[from..to];
        let (start, end) =
            (from + text.len() - text.trim_start().len(), from + text.trim_end().len());
        let close = match cursor.text.as_bytes().get(start) {
            Some(b'{') => '}',
            Some(b'\'') => '\'',
            Some(b'"') => '"',
            _ => return self.expression(cursor, from, to),
        };
        // `{a}*{b}` goes to the grammar as it is.
        if end > start + 1
            && cursor.text[..end].ends_with(close)
            && is_one_group(&cursor.text[start + 1..end - 1], close)
        {
            return self.expression(cursor, start + 1, end - 1);
        }
        self.expression(cursor, from, to)
    }

    /// The same as an output, which may speak of parts of phasors.
    pub fn output(&mut self, cursor: &Cursor, from: usize, to: usize) -> Option<Expr> {
        let parts = std::mem::replace(&mut self.reading.parts, true);
        let expr = self.grouped(cursor, from, to);
        self.reading.parts = parts;
        expr
    }

    /// The expression between two places.
    pub fn expression(&mut self, cursor: &Cursor, from: usize, to: usize) -> Option<Expr> {
        let text = &cursor.text[from..to];
        // The commonest expressions are one number.
        let trimmed = text.trim();
        if let Some(read) = number::number(trimmed, self.reading.numbers)
            && read.letters == trimmed.len()
        {
            let start = from + text.len() - text.trim_start().len();
            let span = cursor.span(self, start, start + trimmed.len());
            return Some(Expr::new(Node::Number(read.value), span));
        }
        if text.contains("(\"") {
            return self.with_files(cursor, from, to);
        }
        super::expression::with_calls(
            text,
            &mut self.names,
            self.dialect,
            self.reading,
            Some(&mut self.calls),
            (self.file, cursor.base + from),
            self.diagnostics,
        )
    }

    /// Reports that something should stand here.
    pub fn missing(&mut self, cursor: &Cursor, what: &str) {
        let span = cursor.here(self);
        self.diagnostics.push(Diagnostic::error("E0703", span, format!("{what} is missing")));
    }

    /// Reports what should not stand here.
    pub fn leftover(&mut self, cursor: &mut Cursor) {
        if !cursor.is_done() {
            let span = cursor.here(self);
            let word = cursor.text[cursor.at..].split_whitespace().next().unwrap_or("");
            let error =
                Diagnostic::error("E0704", span, format!("`{word}` is not understood here"));
            self.diagnostics.push(error);
        }
    }
}
