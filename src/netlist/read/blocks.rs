//! Cards that hold others: `.subckt … .ends`, and `.if … .elseif … .else … .endif`.

use super::{Cursor, Reader, cards};
use crate::diagnostic::Diagnostic;
use crate::netlist::{Branch, Card, CardKind, Netlist, Subcircuit};
use crate::source::Span;

/// Blocks within blocks, at most.
const DEEPEST: usize = 200;

/// The blocks that are open, the innermost last.
#[derive(Default)]
pub struct Blocks {
    open: Vec<Block>,
    /// How many were opened beyond what is allowed.
    beyond: usize,
}

struct Block {
    kind: Kind,
    span: Span,
    comment: Option<String>,
}

enum Kind {
    Subcircuit(Subcircuit),
    Choice(Vec<Branch>),
}

impl Blocks {
    /// Adds a card to the innermost block, or to the netlist.
    pub fn push(&mut self, netlist: &mut Netlist, card: Card) {
        match self.open.last_mut().map(|block| &mut block.kind) {
            Some(Kind::Subcircuit(subcircuit)) => subcircuit.cards.push(card),
            Some(Kind::Choice(branches)) => {
                if let Some(branch) = branches.last_mut() {
                    branch.cards.push(card);
                }
            }
            None => netlist.cards.push(card),
        }
    }

    /// The comment of the line that opened a block.
    pub fn comment(&mut self, comment: Option<String>) {
        if let (Some(block), Some(comment)) = (self.open.last_mut(), comment) {
            block.comment.get_or_insert(comment);
        }
    }

    /// Takes a card that opens, divides or ends a block; whether it was one.
    pub fn take(
        &mut self,
        reader: &mut Reader,
        netlist: &mut Netlist,
        word: &str,
        cursor: &mut Cursor,
        span: Span,
    ) -> bool {
        match word {
            "subckt" => {
                if let Some(subcircuit) = cards::subcircuit(reader, cursor) {
                    self.open(reader, Kind::Subcircuit(subcircuit), span);
                }
            }
            "if" => {
                let condition = condition(reader, cursor);
                let first = Branch { condition: Some(condition), cards: vec![] };
                self.open(reader, Kind::Choice(vec![first]), span);
            }
            "elseif" | "else" => {
                let condition = (word == "elseif").then(|| condition(reader, cursor));
                match self.open.last_mut().map(|block| &mut block.kind) {
                    Some(Kind::Choice(branches))
                        if branches.last().is_some_and(|last| last.condition.is_some()) =>
                    {
                        branches.push(Branch { condition, cards: vec![] });
                    }
                    _ => {
                        let message = format!("`.{word}` belongs to no `.if`");
                        reader.diagnostics.push(Diagnostic::error("E0709", span, message));
                    }
                }
            }
            "ends" | "endif" => self.end(reader, netlist, word, span),
            _ => return false,
        }
        true
    }

    fn open(&mut self, reader: &mut Reader, kind: Kind, span: Span) {
        if self.open.len() >= DEEPEST {
            if self.beyond == 0 {
                let message = format!("more than {DEEPEST} blocks within one another");
                reader.diagnostics.push(Diagnostic::error("E0710", span, message));
            }
            self.beyond += 1;
            return;
        }
        self.open.push(Block { kind, span, comment: None });
    }

    fn end(&mut self, reader: &mut Reader, netlist: &mut Netlist, word: &str, span: Span) {
        if self.beyond > 0 {
            self.beyond -= 1;
            return;
        }
        let subcircuit = word == "ends";
        let fits = self
            .open
            .last()
            .is_some_and(|block| matches!(block.kind, Kind::Subcircuit(_)) == subcircuit);
        if !fits {
            let what =
                if subcircuit { "`.ends` ends no subcircuit" } else { "`.endif` ends no `.if`" };
            let error = Diagnostic::error("E0709", span, what);
            reader.diagnostics.push(match self.open.last() {
                Some(block) => error.label(block.span, "this block is still open"),
                None => error,
            });
            return;
        }
        if let Some(block) = self.open.pop() {
            self.push(netlist, card(block));
        }
    }

    /// Closes what is still open, with an error.
    pub fn close(&mut self, reader: &mut Reader, netlist: &mut Netlist) {
        while let Some(block) = self.open.pop() {
            let message = match &block.kind {
                Kind::Subcircuit(subcircuit) => {
                    format!(
                        "the subcircuit `{}` is never ended",
                        reader.names.text(subcircuit.name)
                    )
                }
                Kind::Choice(_) => "this `.if` is never ended".to_string(),
            };
            reader.diagnostics.push(Diagnostic::error("E0709", block.span, message));
            self.push(netlist, card(block));
        }
    }
}

fn card(block: Block) -> Card {
    let kind = match block.kind {
        Kind::Subcircuit(subcircuit) => CardKind::Subcircuit(subcircuit),
        Kind::Choice(branches) => CardKind::Choice(branches),
    };
    Card { kind, span: block.span, comment: block.comment }
}

/// The condition of `.if (condition)`; what is wrong has been said, and holds.
fn condition(reader: &mut Reader, cursor: &mut Cursor) -> crate::netlist::Expr {
    let (rest, from) = cursor.rest();
    cursor.at = cursor.text.len();
    if rest.is_empty() {
        reader.missing(cursor, "the condition of `.if (condition)`");
        return crate::netlist::Expr::number(1.0);
    }
    let read = reader.grouped(cursor, from, from + rest.len());
    read.unwrap_or(crate::netlist::Expr::number(1.0))
}
