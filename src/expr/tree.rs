//! The expression tree.

use crate::source::Span;
use std::sync::Arc;

/// An expression over leaves `L`, with the place in the text that it came from.
#[derive(Clone, Debug, PartialEq)]
pub struct Expr<L> {
    /// What it is.
    pub node: Box<Node<L>>,
    /// Where it stands; [`Span::NONE`] when generated.
    pub span: Span,
}

/// A node of the tree.
#[derive(Clone, Debug, PartialEq)]
pub enum Node<L> {
    /// A literal, in SI.
    Number(f64),
    /// What the stage's leaves are: a name, an effort, a voltage, time.
    Leaf(L),
    /// One operand.
    Unary(Unary, Expr<L>),
    /// Two operands.
    Binary(Binary, Expr<L>, Expr<L>),
    /// A function of the table [`FUNCTIONS`](super::functions::FUNCTIONS).
    Call(super::functions::Function, Vec<Expr<L>>),
    /// `if c then a else b`; `c` is true when it is not 0.
    If(Expr<L>, Box<Expr<L>>, Box<Expr<L>>),
    /// Interpolation that holds its end values.
    Table(Expr<L>, Arc<Table>),
}

impl<L> Node<L> {
    /// `if condition then … else …`
    pub fn choice(condition: Expr<L>, then: Expr<L>, otherwise: Expr<L>) -> Node<L> {
        Node::If(condition, Box::new(then), Box::new(otherwise))
    }
}

/// Operators with one operand.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Unary {
    /// −a
    Negate,
    /// 1 where a is 0, else 0
    Not,
}

/// Operators with two operands. Comparisons and logic give 1 or 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[allow(missing_docs)]
pub enum Binary {
    Add,
    Subtract,
    Multiply,
    Divide,
    /// Real power, right-associative; a negative base needs a whole exponent.
    Power,
    Less,
    LessEqual,
    Greater,
    GreaterEqual,
    Equal,
    NotEqual,
    And,
    Or,
}

/// Points that a curve passes through, x strictly increasing; beyond the ends it holds its end values.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// Abscissae.
    pub x: Vec<f64>,
    /// Ordinates, as many.
    pub y: Vec<f64>,
    /// How they are joined.
    pub curve: super::curves::Curve,
}

/// What puts a tree in the place of each leaf.
pub type LeafMap<'a, L, M, E> = &'a mut dyn FnMut(&L, Span) -> Result<Expr<M>, E>;

impl Binary {
    /// Whether it compares: its value jumps between 0 and 1.
    pub fn is_comparison(self) -> bool {
        use Binary::*;
        matches!(self, Less | LessEqual | Greater | GreaterEqual | Equal | NotEqual)
    }
}

impl<L> Expr<L> {
    /// A node at a place.
    pub fn new(node: Node<L>, span: Span) -> Expr<L> {
        Expr { node: Box::new(node), span }
    }

    /// A number that stands in no text.
    pub fn number(value: f64) -> Expr<L> {
        Expr::new(Node::Number(value), Span::NONE)
    }

    /// A leaf that stands in no text.
    pub fn leaf(leaf: L) -> Expr<L> {
        Expr::new(Node::Leaf(leaf), Span::NONE)
    }

    /// `self op other`, generated.
    pub fn binary(self, op: Binary, other: Expr<L>) -> Expr<L> {
        let span = self.span.join(other.span);
        Expr::new(Node::Binary(op, self, other), span)
    }

    /// −self, generated.
    pub fn negate(self) -> Expr<L> {
        let span = self.span;
        Expr::new(Node::Unary(Unary::Negate, self), span)
    }

    /// A call, generated.
    pub fn call(function: super::functions::Function, arguments: Vec<Expr<L>>) -> Expr<L> {
        Expr::new(Node::Call(function, arguments), Span::NONE)
    }

    /// `if condition then … else …`, generated.
    pub fn choice(condition: Expr<L>, then: Expr<L>, otherwise: Expr<L>) -> Expr<L> {
        Expr::new(Node::choice(condition, then, otherwise), Span::NONE)
    }

    /// Calls `visit` for every node with its level, from 1 on; depth costs no stack.
    fn levels(&self, visit: &mut dyn FnMut(usize)) {
        let mut open = vec![(self, 1)];
        while let Some((expr, level)) = open.pop() {
            visit(level);
            match &*expr.node {
                Node::Number(_) | Node::Leaf(_) => {}
                Node::Unary(_, a) | Node::Table(a, _) => open.push((a, level + 1)),
                Node::Binary(_, a, b) => open.extend([(a, level + 1), (b, level + 1)]),
                Node::Call(_, arguments) => open.extend(arguments.iter().map(|a| (a, level + 1))),
                Node::If(c, a, b) => {
                    open.extend([(c, level + 1), (a, level + 1), (b, level + 1)]);
                }
            }
        }
    }

    /// The number of levels of the tree.
    pub fn depth(&self) -> usize {
        let mut deepest = 0;
        self.levels(&mut |level| deepest = deepest.max(level));
        deepest
    }

    /// The number of nodes of the tree.
    pub fn size(&self) -> usize {
        let mut count = 0;
        self.levels(&mut |_| count += 1);
        count
    }

    /// The value of a literal.
    pub fn as_number(&self) -> Option<f64> {
        match &*self.node {
            Node::Number(value) => Some(*value),
            _ => None,
        }
    }

    /// The same tree with each leaf replaced by a tree; the first error ends it.
    pub fn try_map<M, E>(&self, leaf: LeafMap<'_, L, M, E>) -> Result<Expr<M>, E> {
        let node = match &*self.node {
            Node::Number(value) => Node::Number(*value),
            Node::Leaf(name) => return leaf(name, self.span),
            Node::Unary(op, a) => Node::Unary(*op, a.try_map(leaf)?),
            Node::Binary(op, a, b) => Node::Binary(*op, a.try_map(leaf)?, b.try_map(leaf)?),
            Node::Call(function, arguments) => Node::Call(
                *function,
                arguments.iter().map(|a| a.try_map(leaf)).collect::<Result<_, E>>()?,
            ),
            Node::If(c, a, b) => Node::choice(c.try_map(leaf)?, a.try_map(leaf)?, b.try_map(leaf)?),
            Node::Table(a, table) => Node::Table(a.try_map(leaf)?, table.clone()),
        };
        Ok(Expr::new(node, self.span))
    }

    /// The same tree with each leaf replaced by a tree.
    pub fn map<M>(&self, leaf: &mut dyn FnMut(&L, Span) -> Expr<M>) -> Expr<M> {
        let mapped: Result<_, std::convert::Infallible> =
            self.try_map(&mut |l, span| Ok(leaf(l, span)));
        match mapped {
            Ok(expr) => expr,
        }
    }

    /// Calls `visit` for every leaf, left to right.
    pub fn leaves<'a>(&'a self, visit: &mut dyn FnMut(&'a L, Span)) {
        match &*self.node {
            Node::Number(_) => {}
            Node::Leaf(name) => visit(name, self.span),
            Node::Unary(_, a) | Node::Table(a, _) => a.leaves(visit),
            Node::Binary(_, a, b) => {
                a.leaves(visit);
                b.leaves(visit);
            }
            Node::Call(_, arguments) => arguments.iter().for_each(|a| a.leaves(visit)),
            Node::If(c, a, b) => {
                c.leaves(visit);
                a.leaves(visit);
                b.leaves(visit);
            }
        }
    }
}

macro_rules! operator {
    ($trait:ident $method:ident $op:ident) => {
        /// Generated.
        impl<L> std::ops::$trait for Expr<L> {
            type Output = Expr<L>;
            fn $method(self, other: Expr<L>) -> Expr<L> {
                self.binary(Binary::$op, other)
            }
        }
    };
}

operator!(Add add Add);
operator!(Sub sub Subtract);
operator!(Mul mul Multiply);
operator!(Div div Divide);

/// Generated.
impl<L> std::ops::Neg for Expr<L> {
    type Output = Expr<L>;
    fn neg(self) -> Expr<L> {
        self.negate()
    }
}
