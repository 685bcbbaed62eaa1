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
    Negate(Span),
    Plus,
    Not(Span),
}

impl Operator {
    fn precedence(&self, dialect: Dialect) -> u8 {
        match self {
            Operator::Infix(op) => precedence(*op),
            Operator::Negate(_) | Operator::Plus => SIGN,
            // SPICE's `!` binds as tightly as a sign.
            Operator::Not(_) => {
                if dialect == Dialect::Bond {
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
fn precedence(op: Binary) -> u8 {
    match op {
        Binary::Or => 1,
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
        let arriving = precedence(op);
        let result = self.reduce(arriving + 1);
        if arriving == precedence(Binary::Equal)
            && self.dialect == Dialect::Bond
            && matches!(self.operators.last(), Some(Operator::Infix(before)) if precedence(*before) == arriving)
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

    /// Applies all pending operators that bind at least as tightly as `floor`, runs of one precedence at once.
    pub(super) fn reduce(&mut self, floor: u8) -> Option<()> {
        let mut result = Some(());
        while let Some(top) = self.operators.last() {
            let level = top.precedence(self.dialect);
            if level < floor {
                break;
            }
            match top {
                Operator::Infix(..) => {
                    let run = self
                        .operators
                        .iter()
                        .rev()
                        .take_while(
                            |o| matches!(o, Operator::Infix(op) if precedence(*op) == level),
                        )
                        .count();
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
            Operator::Not(span) => (Unary::Not, span.join(operand.place)),
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
        let ops: Vec<Binary> = operators
            .iter()
            .filter_map(|o| if let Operator::Infix(op) = o { Some(*op) } else { None })
            .collect();
        let power = ops.first() == Some(&Binary::Power);
        if power && self.dialect == Dialect::Bond {
            let mut rest = operands.into_iter().rev();
            let last = rest.next()?;
            return rest.try_fold(last, |right, left| self.operation(Binary::Power, left, right));
        }
        if ops.len() > LONG_CHAIN && matches!(precedence(ops[0]), 1 | 2 | 5 | 6) {
            let mut operands = operands.into_iter().map(Some).collect::<Vec<_>>();
            return self.balanced(&ops, &mut operands, false);
        }
        let mut rest = operands.into_iter();
        let first = rest.next()?;
        ops.into_iter()
            .zip(rest)
            .try_fold(first, |left, (op, right)| self.operation(op, left, right))
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
        let span = left.place.join(right.place);
        let depth = left.depth.max(right.depth);
        let node = if op == Binary::Power && self.dialect != Dialect::Bond {
            Node::Call(Function::PowerOfAbs, vec![left.expr, right.expr])
        } else {
            Node::Binary(op, left.expr, right.expr)
        };
        join(node, depth, span, self.diagnostics)
    }
}
