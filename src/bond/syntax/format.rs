//! The one layout of a file: what `bondspice fmt` writes.
//!
//! The author's lines stay lines; what stands between the words is settled. The rules:
//!
//! 1. *Indent.* Two blanks for each block; a statement's further lines four more, but a line that begins with a
//!    closing bracket none. No blanks at the end of a line, at most one empty line in a row, none at the beginning or
//!    end of a block or file.
//! 2. *Braces.* `{` stands at the end of its line and `}` on a line of its own, with `else` after it. A block that the
//!    author wrote on one line stays there: `for k in 1..N { a[k]; b[k] }`.
//! 3. *Blanks.* One around arrows, `=` and comparisons, after `,` and `;`, between a number and its unit; none inside
//!    brackets, around the colon of a kind and around `..`. Around `+ - * / ^` the author chooses: a blank on either
//!    side makes one on both.
//! 4. *Columns.* In lines that follow each other without an empty line or a comment between, the `=` of one statement
//!    word stand in one column, and so do the arrows after names that begin a chain, and the names and colons of
//!    ports. Descriptions of parameters stand in one column as long as only parameters, comments and empty lines come
//!    between, comments after statements as long as lines follow each other. What is much longer than its neighbours
//!    ([`WIDEST`]) stands aside and moves no column.
//! 5. *Width.* A chain, or a list to observe, that is wider than [`WIDTH`] goes on in the next line after a `,` or an
//!    arrow outside brackets. Nothing is joined.
//!
//! Tokens are never changed, added or left out.

use super::classes::{Class, classes};
use super::scan::{Piece, Scan, Step};
use super::statement::statement_word;
use super::token::{Kind, Token, cut};
use crate::source::Span;
use std::ops::Range;

/// Characters of a line after which chains and lists are broken.
pub const WIDTH: usize = 120;

/// Cells wider than this stand aside when columns are made.
pub const WIDEST: usize = 20;

/// Lays out a text without errors of syntax. Should ever a token be lost on the way, the text stays as it is.
pub fn format(text: &str) -> String {
    let formatted = layout(text);
    if same_tokens(text, &formatted) { formatted } else { text.to_string() }
}

/// Whether two texts have the same tokens, blanks and line ends aside.
pub fn same_tokens(a: &str, b: &str) -> bool {
    let (first, second) = (cut(a).0, cut(b).0);
    let words = |token: &&Token| !matches!(token.kind, Kind::Blank | Kind::LineEnd);
    let mut a = first.iter().filter(words).map(|token| (token.kind, token.text(a).trim_end()));
    let mut b = second.iter().filter(words).map(|token| (token.kind, token.text(b).trim_end()));
    a.by_ref().eq(b.by_ref())
}

/// The layout of a text, as [`format()`] gives it but for the check of its tokens.
pub fn layout(text: &str) -> String {
    let scan = Scan::new(Span::NONE.file, text);
    let classes = classes(&scan);
    let mut layout = Layout {
        scan: &scan,
        classes: &classes,
        lines: vec![],
        blocks: vec![],
        breaks: 0,
        begins: true,
        on_line: false,
    };
    let mut at = 0;
    // The parser has found the text without errors.
    let mut errors = vec![];
    while let Some(step) = scan.step(at, &mut errors) {
        at = match step {
            Step::Piece(piece) => {
                let from = scan.token_at(piece.span.start);
                layout.between(at..from);
                layout.piece(&piece);
                // A comment after the statement is laid out with what comes next.
                if piece.opens.is_some() { piece.next } else { scan.token_at(piece.span.end) }
            }
            Step::Closes(brace, next) => {
                let from = scan.token_at(brace.start);
                layout.between(at..from);
                layout.close();
                layout.otherwise(next)
            }
        };
    }
    layout.between(at..scan.tokens.len());
    let mut lines = layout.lines;
    align(&mut lines);
    let mut text = String::with_capacity(text.len() + text.len() / 8);
    for line in lines {
        if line.gap {
            text.push('\n');
        }
        text.push_str(line.text().trim_end());
        text.push('\n');
    }
    text
}

/// Which columns a line has a part in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Columns {
    None,
    /// `word name` and `= value`, of a statement word; a parameter's description is the third cell.
    Equals(&'static str),
    /// The name that a chain begins with, and the rest.
    Arrow,
    /// `port in`, the name, and the domain.
    Port,
}

/// A line to be written.
#[derive(Debug)]
struct Line {
    /// Whether an empty line comes before.
    gap: bool,
    indent: usize,
    columns: Columns,
    /// Its parts; one blank or a column is between them.
    cells: Vec<String>,
    comment: Option<String>,
}

impl Line {
    fn text(&self) -> String {
        let mut text = format!("{}{}", " ".repeat(self.indent), self.cells.join(" "));
        if let Some(comment) = &self.comment {
            text.push_str(comment);
        }
        text
    }

    fn statement_width(&self) -> usize {
        let blanks = self.cells.len().saturating_sub(1);
        self.indent + blanks + self.cells.iter().map(|cell| width(cell)).sum::<usize>()
    }

    fn is_comment(&self) -> bool {
        self.cells.is_empty()
    }
}

fn width(text: &str) -> usize {
    text.chars().count()
}

/// The lines so far, and what the next token comes after.
struct Layout<'a> {
    scan: &'a Scan<'a>,
    classes: &'a [Class],
    lines: Vec<Line>,
    /// The open blocks: whether each stands on one line.
    blocks: Vec<bool>,
    /// Line ends since the last token.
    breaks: usize,
    /// Whether nothing stands yet in the file or block, so that no empty line comes next.
    begins: bool,
    /// Whether the author's line goes on: a comment belongs to what stands on it.
    on_line: bool,
}

impl Layout<'_> {
    fn indent(&self) -> usize {
        2 * self.blocks.iter().filter(|one_line| !**one_line).count()
    }

    fn in_one_line(&self) -> bool {
        self.blocks.last() == Some(&true)
    }

    /// Begins a line, unless the last one goes on.
    fn line(&mut self, indent: usize) -> &mut Line {
        if self.breaks > 0 || self.lines.is_empty() {
            let gap = self.breaks > 1 && !self.begins;
            self.lines.push(Line {
                gap,
                indent,
                columns: Columns::None,
                cells: vec![],
                comment: None,
            });
        }
        self.breaks = 0;
        self.begins = false;
        self.on_line = true;
        let last = self.lines.len() - 1;
        &mut self.lines[last]
    }

    /// Puts a text at the end of the last line, or on a new one after a break.
    fn put(&mut self, text: &str, separator: &str) {
        let indent = self.indent();
        let line = self.line(indent);
        line.columns = Columns::None;
        if line.cells.len() != 1 {
            line.cells = vec![line.cells.join(" ")];
        }
        let cell = &mut line.cells[0];
        if !cell.is_empty() {
            cell.push_str(separator);
        }
        cell.push_str(text);
    }

    /// What stands between statements: blanks, comments, semicolons.
    fn between(&mut self, range: Range<usize>) {
        for at in range {
            let token = self.scan.tokens[at];
            match token.kind {
                Kind::LineEnd => {
                    self.breaks += 1;
                    self.on_line = false;
                }
                Kind::Comment => self.comment(&token, self.indent()),
                Kind::Semicolon if self.breaks > 0 || self.lines.is_empty() => self.put(";", ""),
                Kind::Semicolon => {
                    if let Some(cell) = self.lines.last_mut().and_then(|line| line.cells.last_mut())
                    {
                        cell.push(';');
                    }
                }
                _ => {}
            }
        }
    }

    fn comment(&mut self, token: &Token, indent: usize) {
        let text = token.text(self.scan.text()).trim_end().to_string();
        match self.lines.last_mut() {
            Some(line) if self.on_line && line.comment.is_none() => line.comment = Some(text),
            _ => self.line(indent).comment = Some(text),
        }
    }

    /// A statement, or a block's head and its brace.
    fn piece(&mut self, piece: &Piece) {
        let scan = self.scan;
        let range = scan.token_at(piece.span.start)..scan.token_at(piece.span.end);
        let word = statement_word(scan.masked(piece.span)).unwrap_or("");
        let alone = self.breaks > 0 || self.lines.is_empty();
        let indent = self.indent();
        let mut lines = self.statement(range, word);
        if alone {
            let gap = self.breaks > 1 && !self.begins;
            let wraps = matches!(word, "" | "observe") && !self.in_one_line();
            if wraps {
                lines = lines.into_iter().flat_map(|line| line.wrapped(indent)).collect();
            }
            for (k, line) in lines.into_iter().enumerate() {
                let columns = if k == 0 { line.columns } else { Columns::None };
                let closes = line.cells.first().is_some_and(|cell| cell.starts_with([')', ']']));
                let deeper = if k == 0 || closes { 0 } else { 4 };
                self.lines.push(Line {
                    gap: k == 0 && gap,
                    indent: indent + deeper,
                    columns,
                    cells: line.cells,
                    comment: line.comment,
                });
            }
            self.breaks = 0;
            self.begins = false;
            self.on_line = true;
        } else {
            for (k, line) in lines.into_iter().enumerate() {
                self.breaks = usize::from(k > 0);
                if line.cells.is_empty() {
                    self.line(indent + 4).comment = line.comment;
                    continue;
                }
                self.put(&line.cells.join(" "), " ");
                if let (Some(last), true) = (self.lines.last_mut(), k > 0) {
                    last.indent = indent + 4;
                    last.comment = line.comment;
                } else if let Some(last) = self.lines.last_mut() {
                    last.comment = line.comment;
                }
            }
        }
        if piece.opens.is_some() {
            let head = scan.token_at(piece.span.end);
            let brace = piece.next - 1;
            self.comments_before_brace(head..brace);
            self.open(piece.next);
        }
    }

    /// Comments between a head and its brace; without any, the brace stands on the head's line.
    fn comments_before_brace(&mut self, range: Range<usize>) {
        self.breaks = 0;
        let any = range.clone().any(|at| self.scan.tokens[at].kind == Kind::Comment);
        if any {
            self.between(range);
        }
    }

    fn open(&mut self, next: usize) {
        self.put("{", " ");
        let line_end = |token: &Token| matches!(token.kind, Kind::LineEnd | Kind::Comment);
        let (end, _) = self.scan.skip_block(next);
        let end = end.unwrap_or(self.scan.tokens.len());
        let one_line = !self.scan.tokens[next..end].iter().any(line_end);
        self.blocks.push(one_line);
        if !one_line {
            self.end_line();
            self.begins = true;
        }
    }

    /// The next token but a comment stands on a new line.
    fn end_line(&mut self) {
        self.breaks = self.breaks.max(1);
    }

    fn close(&mut self) {
        let one_line = self.blocks.pop().unwrap_or(false);
        if one_line {
            let empty = self
                .lines
                .last()
                .and_then(|line| line.cells.last())
                .is_some_and(|cell| cell.ends_with('{'));
            self.put("}", if empty { "" } else { " " });
        } else {
            self.breaks = 1;
            let empty = self.begins;
            self.put("}", "");
            if empty {
                self.begins = false;
            }
        }
    }

    /// What comes after `}`: `else`, or another line; returns where to go on.
    fn otherwise(&mut self, next: usize) -> usize {
        let one_line = self.in_one_line();
        let Some((word, after)) = self.scan.significant(next).zip(self.scan.otherwise(next)) else {
            if !one_line {
                self.after_block(next);
            }
            return next;
        };
        let comment = |at: usize| self.scan.tokens[at].kind == Kind::Comment;
        if (next..word).any(comment) {
            self.between(next..word);
        }
        if self.breaks > 0 {
            self.breaks = 1;
        }
        self.put("else", " ");
        match self.scan.brace(after) {
            Some((_, next)) => {
                self.comments_before_brace(word + 1..after);
                self.open(next);
                next
            }
            None => {
                self.between_words(word + 1..after);
                after
            }
        }
    }

    /// Blanks and comments between `else` and `if`.
    fn between_words(&mut self, range: Range<usize>) {
        self.comments_before_brace(range);
    }

    /// A block ends its line, but for a comment or a semicolon after it.
    fn after_block(&mut self, next: usize) {
        let rest = &self.scan.tokens[next..];
        let after = rest.iter().find(|token| token.kind != Kind::Blank);
        if after.is_some_and(|token| {
            !matches!(token.kind, Kind::LineEnd | Kind::Comment | Kind::Semicolon)
        }) {
            self.end_line();
        }
    }

    /// The lines of one statement as the author broke it, each part laid out.
    fn statement(&self, range: Range<usize>, word: &'static str) -> Vec<Part> {
        let tokens = &self.scan.tokens;
        let text = self.scan.text();
        let mut lines = vec![Part::new(Columns::None)];
        let mut before: Option<usize> = None;
        let mut spaced = vec![false; range.len()];
        let mut gap = false;
        let mut depth = 0usize;
        for at in range.clone() {
            let token = tokens[at];
            let Some(line) = lines.last_mut() else { break };
            match token.kind {
                Kind::Blank => {
                    gap = true;
                    continue;
                }
                Kind::LineEnd => {
                    if !line.is_empty() {
                        lines.push(Part::new(Columns::None));
                    }
                    gap = true;
                    continue;
                }
                Kind::Comment => {
                    line.comment = Some(token.text(text).trim_end().to_string());
                    continue;
                }
                Kind::Close(_) => depth = depth.saturating_sub(1),
                _ => {}
            }
            let view = View { layout: self, range: &range, word, depth };
            let separator = match before {
                Some(before) if !line.cells.is_empty() => {
                    view.separator(before, at, gap, &mut spaced)
                }
                Some(before) => {
                    // The operator's other blank may depend on this one.
                    view.separator(before, at, gap, &mut spaced);
                    ""
                }
                None => "",
            };
            line.push(token.text(text), separator, depth);
            if matches!(token.kind, Kind::Open(_)) {
                depth += 1;
            }
            before = Some(at);
            gap = false;
        }
        lines.retain(|line| !line.is_empty());
        self.columns(&mut lines, range, word);
        lines
    }

    /// Cuts the first line of a statement into cells.
    fn columns(&self, lines: &mut [Part], range: Range<usize>, word: &'static str) {
        let single = lines.len() == 1;
        let Some(first) = lines.first_mut() else { return };
        let Some(text) = first.cells.first().cloned() else { return };
        let (columns, mut cuts) = match word {
            "param" | "signal" | "drive" => (Columns::Equals(word), vec![first.equals]),
            "port" => (Columns::Port, vec![first.second, first.colon]),
            "" if self.is_plain_name(range.clone()) => (Columns::Arrow, vec![first.arrow]),
            _ => return,
        };
        if word == "param" && single && self.ends_with_text(range) {
            cuts.push(first.last);
        }
        let mut cells = vec![];
        let mut from = 0;
        for cut in cuts.into_iter().flatten() {
            cells.push(text[from..cut].trim_end().to_string());
            from = cut;
        }
        cells.push(text[from..].to_string());
        if cells.len() > 1 {
            first.columns = columns;
            first.cells = cells;
        }
    }

    fn ends_with_text(&self, range: Range<usize>) -> bool {
        let last = self.scan.tokens[range].iter().rev().find(|token| token.says_something());
        last.is_some_and(|token| token.kind == Kind::Text)
    }

    /// Whether a chain begins with a name that was made elsewhere.
    fn is_plain_name(&self, range: Range<usize>) -> bool {
        let mut depth = 0usize;
        for token in &self.scan.tokens[range] {
            match token.kind {
                Kind::Arrow => return depth == 0,
                Kind::Open(b'[') => depth += 1,
                Kind::Close(b']') => depth = depth.saturating_sub(1),
                Kind::Open(_) | Kind::Colon | Kind::Comma | Kind::LineEnd => return false,
                _ => {}
            }
        }
        false
    }
}

/// A line of a statement while it is made.
#[derive(Debug)]
struct Part {
    columns: Columns,
    cells: Vec<String>,
    comment: Option<String>,
    /// Where it may be broken.
    breaks: Vec<usize>,
    /// Bytes at which the first `=`, colon and arrow outside brackets, the third word and the last token stand.
    equals: Option<usize>,
    colon: Option<usize>,
    arrow: Option<usize>,
    second: Option<usize>,
    last: Option<usize>,
    words: usize,
}

impl Part {
    fn new(columns: Columns) -> Part {
        Part {
            columns,
            cells: vec![],
            comment: None,
            breaks: vec![],
            equals: None,
            colon: None,
            arrow: None,
            second: None,
            last: None,
            words: 0,
        }
    }

    fn is_empty(&self) -> bool {
        self.cells.is_empty() && self.comment.is_none()
    }

    /// Adds a token.
    fn push(&mut self, token: &str, separator: &str, depth: usize) {
        if self.cells.is_empty() {
            self.cells.push(String::new());
        }
        let text = &mut self.cells[0];
        text.push_str(separator);
        let at = text.len();
        self.last = Some(at);
        if depth == 0 {
            match token {
                "=" => self.equals = self.equals.or(Some(at)),
                ":" => self.colon = self.colon.or(Some(at)),
                "->" | "->|" | "|->" => self.arrow = self.arrow.or(Some(at)),
                _ => {}
            }
            self.words += 1;
            if self.words == 3 {
                self.second = Some(at);
            }
        }
        text.push_str(token);
        if depth == 0 && matches!(token, "," | "->" | "->|" | "|->") {
            self.breaks.push(text.len());
        }
    }

    /// The line, broken where it is too wide.
    fn wrapped(self, indent: usize) -> Vec<Part> {
        let text = self.cells.join(" ");
        if self.columns != Columns::None && self.breaks.is_empty() || self.cells.is_empty() {
            return vec![self];
        }
        let mut lines = vec![];
        let mut from = 0;
        let mut room = WIDTH.saturating_sub(indent);
        // Cells are cut before arrows only, so the breaks keep their places but for the blank between.
        while width(&text[from..]) > room {
            let fits = |to: usize| width(&text[from..to]) <= room;
            let ahead = self.breaks.iter().copied().filter(|to| *to > from && *to < text.len());
            let Some(to) = ahead.clone().filter(|to| fits(*to)).max().or(ahead.min()) else {
                break;
            };
            lines.push((from, to));
            from = to + text[to..].len() - text[to..].trim_start().len();
            room = WIDTH.saturating_sub(indent + 4);
        }
        if lines.is_empty() {
            return vec![self];
        }
        lines.push((from, text.len()));
        let last = lines.len() - 1;
        let mut comment = self.comment;
        let cut = self.cells.first().map_or(0, String::len);
        let part = |k: usize, (from, to): (usize, usize)| {
            let mut part = Part::new(Columns::None);
            part.cells = vec![text[from..to].to_string()];
            if k == 0 && self.columns == Columns::Arrow && to > cut {
                part.columns = Columns::Arrow;
                part.cells = vec![text[..cut].to_string(), text[cut..to].trim_start().to_string()];
            }
            part.comment = if k == last { comment.take() } else { None };
            part
        };
        lines
            .into_iter()
            .enumerate()
            .map({
                let mut part = part;
                move |(k, line)| part(k, line)
            })
            .collect()
    }
}

/// What the blank between two tokens depends on.
struct View<'v, 'a> {
    layout: &'v Layout<'a>,
    range: &'v Range<usize>,
    word: &'static str,
    depth: usize,
}

impl View<'_, '_> {
    fn token(&self, at: usize) -> Token {
        self.layout.scan.tokens[at]
    }

    fn class(&self, at: usize) -> Class {
        self.layout.classes[at]
    }

    fn text(&self, at: usize) -> &str {
        self.token(at).text(self.layout.scan.text())
    }

    /// What stands between the token `a` and the next, `b`; `gap`: something did. `spaced` keeps of each operator
    /// whether blanks stand around it.
    fn separator(&self, a: usize, b: usize, gap: bool, spaced: &mut [bool]) -> &'static str {
        let start = self.range.start;
        let (before, after) = (self.token(a).kind, self.token(b).kind);
        let blank = |yes: bool| if yes { " " } else { "" };
        if after == Kind::Operator && self.is_chosen(b) {
            // The author's choice, unless it is a sign.
            let sign = self.is_sign(a);
            let wide = !sign && (gap || self.gap_after(b));
            spaced[b - start] = wide;
            if !sign {
                return blank(wide);
            }
        } else if after == Kind::Operator {
            return " ";
        }
        match (before, after) {
            (_, Kind::Comma | Kind::Semicolon | Kind::Close(_) | Kind::Dot | Kind::Range) => "",
            (Kind::Open(_) | Kind::Dot | Kind::Range, _) => "",
            (Kind::Comma | Kind::Semicolon | Kind::Arrow | Kind::Text, _) => " ",
            (Kind::Colon, _) => blank(self.depth == 0 && matches!(self.word, "port" | "loop")),
            (_, Kind::Colon) => blank(self.depth == 0 && self.word == "port"),
            (Kind::Operator, _) if self.is_chosen(a) => blank(spaced[a - start]),
            (Kind::Operator, _) => " ",
            (_, Kind::Open(_)) => blank(self.class(a) == Class::Word),
            (_, Kind::Unit) if self.text(b).starts_with(['%', '°']) && before == Kind::Number => {
                blank(gap)
            }
            _ => " ",
        }
    }

    /// Whether the author chooses the blanks around an operator.
    fn is_chosen(&self, at: usize) -> bool {
        matches!(self.text(at), "+" | "-" | "*" | "/" | "^")
    }

    /// Whether an operator after the token `a` is a sign.
    fn is_sign(&self, a: usize) -> bool {
        match self.token(a).kind {
            Kind::Open(_) | Kind::Comma | Kind::Semicolon | Kind::Operator | Kind::Arrow => true,
            Kind::Range | Kind::Colon => true,
            _ => self.class(a) == Class::Word,
        }
    }

    fn gap_after(&self, at: usize) -> bool {
        self.layout.scan.tokens.get(at + 1).is_some_and(|token| !token.says_something())
    }
}

/// Makes the columns.
fn align(lines: &mut [Line]) {
    let mut from = 0;
    while from < lines.len() {
        let columns = lines[from].columns;
        let mut to = from + 1;
        while to < lines.len()
            && lines[to].columns == columns
            && !lines[to].gap
            && lines[to].indent == lines[from].indent
        {
            to += 1;
        }
        if columns != Columns::None {
            let cells = if columns == Columns::Port { 2 } else { 1 };
            (0..cells).for_each(|cell| pad(&mut lines[from..to], cell));
        }
        from = to;
    }
    align_descriptions(lines);
    align_comments(lines);
}

/// Pads one cell of all lines to the widest.
fn pad(lines: &mut [Line], cell: usize) {
    let one = |line: &Line| line.cells.get(cell + 1).and(line.cells.get(cell)).map(|c| width(c));
    let widest = lines.iter().filter_map(one).filter(|width| *width <= WIDEST).max().unwrap_or(0);
    for line in lines {
        if let Some(found) = one(line) {
            line.cells[cell].push_str(&" ".repeat(widest.saturating_sub(found)));
        }
    }
}

/// Descriptions of parameters in a column.
fn align_descriptions(lines: &mut [Line]) {
    let parameter = |line: &Line| line.columns == Columns::Equals("param");
    let mut from = 0;
    while from < lines.len() {
        let mut to = from;
        while to < lines.len() && (parameter(&lines[to]) || lines[to].is_comment()) {
            to += 1;
        }
        let values: Vec<(usize, usize)> = lines[from..to]
            .iter()
            .enumerate()
            .filter(|(_, line)| line.cells.len() == 3)
            .map(|(k, line)| {
                (from + k, line.indent + width(&line.cells[0]) + 1 + width(&line.cells[1]))
            })
            .collect();
        let long = |at: usize| width(&lines[at].cells[1]) > WIDEST;
        let common =
            values.iter().filter(|(at, _)| !long(*at)).map(|(_, end)| *end).max().unwrap_or(0);
        // Longer ones that follow each other have a column of their own.
        let mut pads = vec![];
        for (k, (at, end)) in values.iter().enumerate() {
            let neighbours = |(other, _): &&(usize, usize)| long(*other);
            let column = if long(*at) {
                let adjacent = |k: usize, next: usize| values[next].0 == values[k].0 + 1;
                let mut first = k;
                while first > 0 && adjacent(first - 1, first) && long(values[first - 1].0) {
                    first -= 1;
                }
                let run = values[first..].iter().enumerate().take_while(|(n, value)| {
                    neighbours(value) && (*n == 0 || adjacent(first + n - 1, first + n))
                });
                run.map(|(_, (_, end))| *end).max().unwrap_or(*end).max(common)
            } else {
                common
            };
            pads.push((*at, column + 1 - end));
        }
        for (at, blanks) in pads {
            lines[at].cells[1].push_str(&" ".repeat(blanks));
        }
        from = to.max(from + 1);
    }
}

/// Comments after statements in a column.
fn align_comments(lines: &mut [Line]) {
    let mut from = 0;
    while from < lines.len() {
        let mut to = from;
        while to < lines.len()
            && lines[to].comment.is_some()
            && !lines[to].is_comment()
            && (to == from || !lines[to].gap)
        {
            to += 1;
        }
        let widths = lines[from..to].iter().map(Line::statement_width);
        let column = widths.clone().filter(|width| *width <= WIDTH * 2 / 3).max().unwrap_or(0);
        let widths: Vec<usize> = widths.collect();
        for (line, width) in lines[from..to].iter_mut().zip(widths) {
            let blanks = 2 + column.saturating_sub(width);
            if let Some(comment) = &mut line.comment {
                comment.insert_str(0, &" ".repeat(blanks));
            }
        }
        from = to.max(from + 1);
    }
}
