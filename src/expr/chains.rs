//! From a flat run of operands and operators to a tree: precedence, and balance of long chains.

use super::functions::{Dialect, Function};
use super::parse::{MAX_DEPTH, too_deep};
use super::tree::{Binary, Expr, Node, Unary};
use crate::diagnostic::Diagnostic;
use crate::source::Span;

/// Chains of one precedence up to this length keep the order of the text; longer ones are balanced.
const LONG_CHAIN: usize = 32;

/// A tree with its depth.
pub(super) struct Part<L> {
    pub(super) expr: Expr<L>,
    pub(super) depth: usize,
    /// Where it stands, with the brackets around it.
    pub(super) place: Span,
}

pub(super) enum Operator {
    Infix(Binary),
    /// Where `^` means that exactly one of two holds.
    ExclusiveOr,
    Negate(Span),
    Plus,
    /// With whether it binds loosely.
    Not(Span, bool),
}

impl Operator {
    fn precedence(&self, dialect: Dialect) -> u8 {
        match self {
            Operator::Infix(op) => precedence(*op, dialect),
            Operator::ExclusiveOr => exclusive_or(dialect),
            Operator::Negate(_) | Operator::Plus => SIGN,
            // SPICE's `!` binds as tightly as a sign; `~` of Xyce and LTspice as loosely as `not`.
            Operator::Not(_, loose) => {
                if *loose {
                    NOT
                } else {
                    SIGN
                }
            }
        }
    }
}

/// Operands and pending operators, the looser below the tighter.
pub(super) struct Stack<'d, L> {
    pub(super) dialect: Dialect,
    pub(super) operands: Vec<Part<L>>,
    pub(super) operators: Vec<Operator>,
    pub(super) diagnostics: &'d mut Vec<Diagnostic>,
}

/// How tightly an operator binds; `not` and the unary minus are the gaps between.
fn precedence(op: Binary, dialect: Dialect) -> u8 {
    match op {
        Binary::Or => 1,
        // Xyce and LTspice take both in the order of the text.
        Binary::And if matches!(dialect, Dialect::Xyce | Dialect::Ltspice) => 1,
        Binary::And => 2,
        Binary::Equal
        | Binary::NotEqual
        | Binary::Less
        | Binary::LessEqual
        | Binary::Greater
        | Binary::GreaterEqual => 4,
        Binary::Add | Binary::Subtract => 5,
        Binary::Multiply | Binary::Divide => 6,
        Binary::Power => 8,
    }
}

/// How tightly `^` binds where it is logic: in Xyce between `~` and comparisons, in LTspice as `&` and `|`.
fn exclusive_or(dialect: Dialect) -> u8 {
    if dialect == Dialect::Ltspice { 1 } else { 3 }
}

const NOT: u8 = 3;
const SIGN: u8 = 7;

pub(super) fn measured<L>(expr: Expr<L>) -> Part<L> {
    Part { depth: expr.depth(), place: expr.span, expr }
}

/// A node over parts, unless it gets too deep.
pub(super) fn join<L>(
    node: Node<L>,
    depth: usize,
    span: Span,
    d: &mut Vec<Diagnostic>,
) -> Option<Part<L>> {
    if depth >= MAX_DEPTH {
        d.push(too_deep(span));
        return None;
    }
    Some(Part { expr: Expr::new(node, span), depth: depth + 1, place: span })
}

impl<L> Stack<'_, L> {
    /// Takes an operator between operands, after everything that binds more tightly.
    pub(super) fn infix(&mut self, op: Binary, span: Span) -> Option<()> {
        let arriving = precedence(op, self.dialect);
        let result = self.reduce(arriving + 1);
        if op.is_comparison()
            && self.dialect == Dialect::Bond
            && matches!(self.operators.last(), Some(Operator::Infix(before)) if before.is_comparison())
        {
            self.diagnostics.push(
                Diagnostic::error("E0113", span, "comparisons do not chain")
                    .help("join two comparisons with `and`"),
            );
            return None;
        }
        self.operators.push(Operator::Infix(op));
        result
    }

    /// Takes a `^` that is logic.
    pub(super) fn exclusive_or(&mut self) -> Option<()> {
        let result = self.reduce(exclusive_or(self.dialect) + 1);
        self.operators.push(Operator::ExclusiveOr);
        result
    }

    /// Applies all pending operators that bind at least as tightly as `floor`, runs of one precedence at once.
    pub(super) fn reduce(&mut self, floor: u8) -> Option<()> {
        let mut result = Some(());
        while let Some(top) = self.operators.last() {
            let level = top.precedence(self.dialect);
            if level < floor {
                break;
            }
            match top {
                Operator::Infix(..) | Operator::ExclusiveOr => {
                    let dialect = self.dialect;
                    let same = |o: &&Operator| match o {
                        Operator::Infix(_) | Operator::ExclusiveOr => {
                            o.precedence(dialect) == level
                        }
                        _ => false,
                    };
                    let run = self.operators.iter().rev().take_while(same).count();
                    let operators = self.operators.split_off(self.operators.len() - run);
                    let operands =
                        self.operands.split_off(self.operands.len().saturating_sub(run + 1));
                    let chained = self.chain(operators, operands);
                    self.put(chained, &mut result);
                }
                _ => {
                    let operator = self.operators.pop();
                    let operand = self.operands.pop()?;
                    let signed = self.prefix(operator?, operand);
                    self.put(signed, &mut result);
                }
            }
        }
        result
    }

    fn put(&mut self, part: Option<Part<L>>, result: &mut Option<()>) {
        if part.is_none() {
            *result = None;
        }
        self.operands.push(part.unwrap_or_else(|| measured(Expr::number(f64::NAN))));
    }

    fn prefix(&mut self, operator: Operator, operand: Part<L>) -> Option<Part<L>> {
        let (unary, span) = match operator {
            Operator::Negate(span) => (Unary::Negate, span.join(operand.place)),
            Operator::Not(span, _) => {
                let operand = self.truth(operand)?;
                let span = span.join(operand.place);
                return join(
                    Node::Unary(Unary::Not, operand.expr),
                    operand.depth,
                    span,
                    self.diagnostics,
                );
            }
            _ => return Some(operand),
        };
        if let (Unary::Negate, Some(value)) = (unary, operand.expr.as_number()) {
            let expr = Expr::new(Node::Number(-value), span);
            return Some(Part { expr, depth: 1, place: span });
        }
        join(Node::Unary(unary, operand.expr), operand.depth, span, self.diagnostics)
    }

    /// A run of operators of one precedence over one operand more.
    fn chain(&mut self, operators: Vec<Operator>, operands: Vec<Part<L>>) -> Option<Part<L>> {
        // Exactly one holds: both taken as 1 or 0, and these differ. Stands among the others as `!=`, which never shares a
        // precedence with it.
        let ops: Vec<Binary> = operators
            .iter()
            .filter_map(|o| match o {
                Operator::Infix(op) => Some(*op),
                Operator::ExclusiveOr => Some(Binary::NotEqual),
                _ => None,
            })
            .collect();
        let exclusive = operators.iter().any(|o| matches!(o, Operator::ExclusiveOr));
        let power = ops.first() == Some(&Binary::Power);
        let from_right = matches!(self.dialect, Dialect::Bond | Dialect::Xyce);
        if power && from_right {
            let mut rest = operands.into_iter().rev();
            let last = rest.next()?;
            return rest.try_fold(last, |right, left| self.operation(Binary::Power, left, right));
        }
        let one = ops
            .windows(2)
            .all(|pair| precedence(pair[0], Dialect::Bond) == precedence(pair[1], Dialect::Bond));
        let balances = matches!(precedence(ops[0], Dialect::Bond), 1 | 2 | 5 | 6);
        if ops.len() > LONG_CHAIN && balances && one && !exclusive {
            let mut operands = operands.into_iter().map(Some).collect::<Vec<_>>();
            return self.balanced(&ops, &mut operands, false);
        }
        let mut rest = operands.into_iter();
        let first = rest.next()?;
        ops.into_iter().zip(rest).zip(operators).try_fold(first, |left, ((op, right), operator)| {
            match operator {
                Operator::ExclusiveOr => {
                    let (left, right) = (self.inverted(left)?, self.inverted(right)?);
                    self.operation(op, left, right)
                }
                _ => self.operation(op, left, right),
            }
        })
    }

    /// The same value (up to rounding) as a tree of logarithmic depth. `inverted`: a minus or a division stands
    /// before the whole.
    fn balanced(
        &mut self,
        ops: &[Binary],
        operands: &mut [Option<Part<L>>],
        inverted: bool,
    ) -> Option<Part<L>> {
        if operands.len() == 1 {
            return operands[0].take();
        }
        let half = operands.len() / 2;
        let (left, right) = operands.split_at_mut(half);
        let inverse = |op| match op {
            Binary::Add => Binary::Subtract,
            Binary::Subtract => Binary::Add,
            Binary::Multiply => Binary::Divide,
            Binary::Divide => Binary::Multiply,
            other => other,
        };
        let op = if inverted { inverse(ops[half - 1]) } else { ops[half - 1] };
        let turned = matches!(op, Binary::Subtract | Binary::Divide);
        let left = self.balanced(&ops[..half - 1], left, inverted)?;
        let right = self.balanced(&ops[half..], right, inverted != turned)?;
        self.operation(op, left, right)
    }

    fn operation(&mut self, op: Binary, left: Part<L>, right: Part<L>) -> Option<Part<L>> {
        let (left, right) = match op {
            Binary::And | Binary::Or => (self.truth(left)?, self.truth(right)?),
            _ => (left, right),
        };
        let span = left.place.join(right.place);
        let depth = left.depth.max(right.depth);
        let whole = right.expr.as_number().is_some_and(|power| power == power.trunc());
        let node = match (op, self.dialect) {
            (Binary::Power, Dialect::Ngspice) => {
                Node::Call(Function::PowerOfAbs, vec![left.expr, right.expr])
            }
            (Binary::Power, Dialect::Xyce | Dialect::Ltspice) if !whole => {
                Node::Call(Function::RealPower, vec![left.expr, right.expr])
            }
            _ => Node::Binary(op, left.expr, right.expr),
        };
        join(node, depth, span, self.diagnostics)
    }

    fn inverted(&mut self, part: Part<L>) -> Option<Part<L>> {
        let part = self.truth(part)?;
        let place = part.place;
        join(Node::Unary(Unary::Not, part.expr), part.depth, place, self.diagnostics)
    }

    /// What a condition rests on: LTspice takes a value for true above ½, all others where it is not 0.
    pub(super) fn truth(&mut self, part: Part<L>) -> Option<Part<L>> {
        let logical = match &*part.expr.node {
            Node::Unary(Unary::Not, _) => true,
            Node::Binary(op, ..) => op.is_comparison() || matches!(op, Binary::And | Binary::Or),
            _ => false,
        };
        if self.dialect != Dialect::Ltspice || logical {
            return Some(part);
        }
        let (place, half) = (part.place, Expr::number(0.5));
        join(Node::Binary(Binary::Greater, part.expr, half), part.depth, place, self.diagnostics)
    }
}
