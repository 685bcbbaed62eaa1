//! From a text to statements, and the blocks that hold them.
//!
//! The grammar reads one statement or one head of a block at a time; which braces belong together is settled here,
//! with a stack and not by recursion, so that an error costs its own line only and a missing brace is named where it
//! is missing.

use super::scan::{Piece, STATEMENT_WORDS, Scan, Step, closes_nothing};
use super::statement::{self, Head, Said};
use super::tree::*;
use crate::diagnostic::{Diagnostic, Severity};
use crate::expr::parse::too_deep;
use crate::quantity::nearest;
use crate::source::{FileId, SourceMap, Span};

/// Errors of syntax after which reading a file stops telling more: it is probably no bond graph at all.
const MOST_ERRORS: usize = 30;

/// As many are enough when nothing at all could be read.
const FIRST_ERRORS: usize = 5;

/// Blocks within one another, at most; each `else if` counts as one.
pub const MOST_BLOCKS: usize = 64;

/// Reads a file. Always gives one: what could not be read is reported, and stands in it as unreadable.
pub fn parse(map: &SourceMap, file: FileId, d: &mut Vec<Diagnostic>) -> File {
    let text = map.file(file).map_or("", |file| file.text.as_str());
    let scan = Scan::new(file, text);
    let mut errors = 0;
    let first = d.len();
    let mut seen = first;
    let mut blocks = Blocks { scan: &scan, open: vec![], statements: vec![], suspect: None };
    let mut at = 0;
    while let Some(step) = scan.step(at, d) {
        at = match step {
            Step::Piece(piece) => blocks.piece(piece, d),
            Step::Closes(brace, next) => blocks.close(brace, next, d),
        };
        errors += d[seen..].iter().filter(|d| d.severity == Severity::Error).count();
        seen = d.len();
        let read = |s: &Statement| !matches!(s.kind, StatementKind::Unreadable);
        let none =
            errors >= FIRST_ERRORS && blocks.open.is_empty() && !blocks.statements.iter().any(read);
        if errors >= MOST_ERRORS || none {
            // One statement may hold many.
            let wrong = |(_, d): &(usize, &Diagnostic)| d.severity == Severity::Error;
            let kept = d.iter().enumerate().skip(first).filter(wrong).nth(MOST_ERRORS);
            if let Some((more, _)) = kept {
                d.truncate(more);
            }
            let note =
                Diagnostic::note("N0101", Span::NONE, "the rest of the file is not looked at");
            d.push(match none {
                true => note
                    .because("not one statement could be read: this looks like no bond graph")
                    .help("a bond graph begins as `Se:U(10 V) -> 1:mesh`; the names of netlists do not end in .bg"),
                false => note.because(format!("{MOST_ERRORS} errors of syntax were enough")),
            });
            blocks.open.clear();
            break;
        }
    }
    blocks.never_closed(d);
    File { file, statements: blocks.statements, trivia: scan.trivia() }
}

/// The statements read so far, and the blocks that are open.
struct Blocks<'a> {
    scan: &'a Scan<'a>,
    open: Vec<Block>,
    statements: Vec<Statement>,
    /// The first brace that another one than its own seems to have closed, by how the lines are indented.
    suspect: Option<Span>,
}

/// A block that is open.
struct Block {
    /// `None` when it could not be read.
    head: Option<Head>,
    /// Where the statement begins.
    start: Span,
    /// The `{`.
    brace: Span,
    body: Vec<Statement>,
    /// What stands before `else`, once that has been read.
    then: Option<Vec<Statement>>,
    /// After `else if`: it ends with the block within it.
    chained: bool,
}

impl Blocks<'_> {
    /// Puts a statement where it belongs; a block that ends with it ends.
    fn add(&mut self, statement: Statement) {
        let Some(block) = self.open.last_mut() else {
            self.statements.push(statement);
            return;
        };
        let span = statement.span;
        block.body.push(statement);
        if block.chained {
            self.finish(span);
        }
    }

    /// Reads a piece; returns where to go on.
    fn piece(&mut self, piece: Piece, d: &mut Vec<Diagnostic>) -> usize {
        let said = statement::read(self.scan, &piece, d);
        let unreadable = Statement { kind: StatementKind::Unreadable, span: piece.span };
        let head = match said {
            Some(Said::Statement(kind)) if piece.opens.is_none() => {
                self.add(Statement { kind, span: piece.span });
                return piece.next;
            }
            Some(Said::Head(head)) => Some(head),
            Some(Said::Statement(_)) => None,
            None => {
                if let Some(restart) = piece.restart {
                    self.add(unreadable);
                    return restart;
                }
                None
            }
        };
        let Some(brace) = piece.opens else {
            if head.is_some() {
                d.push(no_body(self.scan, piece.span));
            }
            self.add(unreadable);
            return piece.next;
        };
        if head.is_none() && !statement::is_head(self.scan.masked(piece.span)) {
            // The braces of something else: their content is passed over, unless it looks like a body.
            let (end, body) = self.scan.skip_block(piece.next);
            if said_well(&piece, brace, d) {
                d.push(no_head(self.scan, piece.span, brace));
            }
            if !body || end.is_none() {
                self.add(unreadable);
                return end.unwrap_or(piece.next);
            }
        }
        if matches!(head, Some(Head::Model { .. })) {
            self.close_before_model(piece.span, d);
        }
        self.open_block(head, piece.span, brace, piece.next, d)
    }

    fn open_block(
        &mut self,
        head: Option<Head>,
        start: Span,
        brace: Span,
        next: usize,
        d: &mut Vec<Diagnostic>,
    ) -> usize {
        if self.open.len() >= MOST_BLOCKS {
            d.push(
                too_deep(brace).because(format!("at most {MOST_BLOCKS} blocks within one another")),
            );
            let next = self.skip(next);
            self.add(Statement { kind: StatementKind::Unreadable, span: start.join(brace) });
            return next;
        }
        self.open.push(Block { head, start, brace, body: vec![], then: None, chained: false });
        next
    }

    /// Passes over the rest of a block, and the branches after it.
    fn skip(&self, mut next: usize) -> usize {
        loop {
            let Some(end) = self.scan.skip_block(next).0 else { return usize::MAX };
            let Some(brace) = self.scan.otherwise(end).and_then(|at| self.scan.next_brace(at))
            else {
                return end;
            };
            next = brace;
        }
    }

    /// Takes a `}`; returns where to go on.
    fn close(&mut self, brace: Span, next: usize, d: &mut Vec<Diagnostic>) -> usize {
        let Some(block) = self.open.last_mut() else {
            d.push(closes_nothing(brace, '}'));
            return next;
        };
        let indents = (self.scan.indent(block.start.start), self.scan.indent(brace.start));
        if let (Some(opened), Some(closed)) = indents
            && closed < opened
        {
            self.suspect.get_or_insert(block.brace);
        }
        if let (Some(Head::If { .. }), None) = (&block.head, &block.then)
            && let Some(after) = self.scan.otherwise(next)
        {
            block.then = Some(std::mem::take(&mut block.body));
            if let Some((brace, next)) = self.scan.brace(after) {
                block.brace = brace;
                return next;
            }
            block.chained = true;
            return after;
        }
        self.finish(brace);
        next
    }

    /// Makes a statement of the innermost block, whose last part stands at `end`.
    fn finish(&mut self, end: Span) {
        let Some(block) = self.open.pop() else { return };
        let span = block.start.join(end);
        let kind = match block.head {
            Some(Head::Model { name, parameters }) => {
                StatementKind::Model(Model { name, parameters, body: block.body })
            }
            Some(Head::For { variable, range }) => {
                StatementKind::For { variable, range, body: block.body }
            }
            Some(Head::If { condition }) => match block.then {
                Some(then) => StatementKind::If { condition, then, otherwise: block.body },
                None => StatementKind::If { condition, then: block.body, otherwise: vec![] },
            },
            None => StatementKind::Unreadable,
        };
        self.add(Statement { kind, span });
    }

    /// Models stand side by side: one that begins no further to the right than an open block tells that a brace is
    /// missing before it.
    fn close_before_model(&mut self, start: Span, d: &mut Vec<Diagnostic>) {
        let indent = |span: Span| self.scan.indent(span.start);
        let Some(outer) = self.open.first() else { return };
        if !self.scan.lacks_braces() {
            return;
        }
        if let (Some(outer), Some(here)) = (indent(outer.start), indent(start))
            && here <= outer
        {
            self.never_closed(d);
        }
    }

    /// Reports the blocks that are open where none may be, as one error, and ends them.
    fn never_closed(&mut self, d: &mut Vec<Diagnostic>) {
        let Some(block) = self.open.last() else { return };
        let at = self.suspect.take().unwrap_or(block.brace);
        let error =
            Diagnostic::error("E0104", at, "`{` is never closed").says("no `}` for this one");
        d.push(if at == block.brace {
            error
        } else {
            error
                .label(block.brace, "this one takes its place")
                .because("told by how the lines are indented")
        });
        while let Some(block) = self.open.last() {
            let end = block.body.last().map_or(block.brace, |last| last.span);
            self.finish(end);
        }
        let span = Span { end: at.start, ..at };
        self.add(Statement { kind: StatementKind::Unreadable, span });
    }
}

/// Whether no error of the piece has been reported.
fn said_well(piece: &Piece, brace: Span, d: &[Diagnostic]) -> bool {
    let within = |span: Span| span.file == brace.file && span.start >= piece.span.start;
    !d.last().and_then(|last| last.labels.first()).is_some_and(|label| within(label.span))
}

/// The error for the head of a block without one.
fn no_body(scan: &Scan<'_>, span: Span) -> Diagnostic {
    let masked = scan.masked(span);
    let last = masked.chars().next_back().map_or(0, char::len_utf8) as u32;
    let word = statement::first_word(masked);
    Diagnostic::error(
        "E0101",
        Span { start: span.end - last, ..span },
        "the statement ends too early",
    )
    .says("expected `{` after this")
    .help(format!("what belongs to `{word}` stands between braces"))
}

/// The error for a block after a statement that takes none.
fn no_head(scan: &Scan<'_>, span: Span, brace: Span) -> Diagnostic {
    let error = Diagnostic::error("E0101", brace, "`{` cannot stand here")
        .says("expected the end of the statement");
    let word = statement::first_word(scan.masked(span));
    match nearest(word, super::scan::BLOCK_WORDS.iter().copied()) {
        Some(meant) if !STATEMENT_WORDS.contains(&word) && word.len() > 1 => {
            error.help(format!("did you mean `{meant}`?"))
        }
        _ => error.help("braces stand after `model`, `for`, `if` and `else`"),
    }
}

/// Reads a value that stands alone: `2mH`, `0.5*S`. A text of the command line is of no file, [`Span::NONE`]'s.
pub fn parse_value(text: &str, file: FileId, d: &mut Vec<Diagnostic>) -> Option<Expr> {
    statement::value_alone(&Scan::new(file, text), &alone(text, file, d)?, d)
}

/// Reads what an input gets: `x_ref = step(0.1 s, 0 mm, 20 mm)`.
pub fn parse_drive(text: &str, file: FileId, d: &mut Vec<Diagnostic>) -> Option<(Part, Expr)> {
    statement::drive_alone(&Scan::new(file, text), &alone(text, file, d)?, d)
}

/// Reads a list to observe: `x in mm, e(pump) in bar as "pressure"`.
pub fn parse_observe(
    text: &str,
    file: FileId,
    d: &mut Vec<Diagnostic>,
) -> Option<Vec<ObserveItem>> {
    statement::observe_alone(&Scan::new(file, text), &alone(text, file, d)?, d)
}

/// All of a text as one piece.
fn alone(text: &str, file: FileId, d: &mut Vec<Diagnostic>) -> Option<Piece> {
    match Scan::new(file, text).step(0, d) {
        Some(Step::Piece(mut piece)) => {
            piece.span.end = text.len() as u32;
            (!piece.bad).then_some(piece)
        }
        Some(Step::Closes(brace, _)) => {
            d.push(closes_nothing(brace, '}'));
            None
        }
        None => {
            d.push(Diagnostic::error("E0108", Span::new(file, 0, 0), "nothing is written here"));
            None
        }
    }
}
