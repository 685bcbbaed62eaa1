//! A graph of operations in which every value stands once: folded constants, shared subexpressions, exact derivatives.
//!
//! Nodes are numbered so that operands come before what uses them. Everything here is iterative in the graph, so that
//! its depth costs no stack.
//!
//! Simplifications keep every finite value, but for rounding nothing: x·1, x/1, x + 0, −(−x), 0·x → 0 for a literal 0,
//! x − x → 0, and whole powers as the same products that [`power`](super::values::power) forms.

use super::functions::Function;
use super::tree::{Binary, Expr, Node, Table, Unary};
use crate::source::Span;
use rustc_hash::{FxHashMap, FxHashSet};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Index of a node of a [`Dag`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct NodeId(pub u32);

/// An operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Op {
    /// A number, by its bits.
    Constant(u64),
    /// An input of the program.
    Input(u32),
    /// One operand.
    Unary(Unary, NodeId),
    /// Two operands; those of commutative ones in ascending order.
    Binary(Binary, NodeId, NodeId),
    /// A function of one argument.
    One(Function, NodeId),
    /// A function of two arguments.
    Two(Function, NodeId, NodeId),
    /// The second where the first is not 0, else the third. What stands in the other never matters.
    Select(NodeId, NodeId, NodeId),
    /// Interpolation in a table.
    Table(u32, NodeId),
    /// The slope of a table.
    Slope(u32, NodeId),
}

impl Op {
    /// Its operands; the first `n` of three.
    pub(super) fn operands(self) -> ([NodeId; 3], usize) {
        let none = NodeId(0);
        match self {
            Op::Constant(_) | Op::Input(_) => ([none; 3], 0),
            Op::Unary(_, a) | Op::One(_, a) | Op::Table(_, a) | Op::Slope(_, a) => {
                ([a, none, none], 1)
            }
            Op::Binary(_, a, b) | Op::Two(_, a, b) => ([a, b, none], 2),
            Op::Select(c, a, b) => ([c, a, b], 3),
        }
    }
}

/// An affine form: a constant, and factors of inputs in ascending order.
pub type Affine = (f64, Vec<(u32, f64)>);

/// The graph.
#[derive(Clone, Debug, Default)]
pub struct Dag {
    ops: Vec<Op>,
    index: FxHashMap<Op, NodeId>,
    /// For each node, bit k % 64 for each input k that it depends on: 0 bits are certain.
    pub(super) reach: Vec<u64>,
    tables: Vec<Arc<Table>>,
    pub(super) derivatives: FxHashMap<(NodeId, u32), NodeId>,
}

impl Dag {
    /// The node of input `k`.
    pub fn input(&mut self, k: u32) -> NodeId {
        self.intern(Op::Input(k))
    }

    /// The node of a number.
    pub fn constant(&mut self, value: f64) -> NodeId {
        self.intern(Op::Constant(value.to_bits()))
    }

    /// The operation of a node.
    pub fn op(&self, node: NodeId) -> Op {
        self.ops[node.0 as usize]
    }

    /// The number of nodes.
    pub fn len(&self) -> usize {
        self.ops.len()
    }

    /// Whether there is no node.
    pub fn is_empty(&self) -> bool {
        self.ops.is_empty()
    }

    /// The tables that [`Op::Table`] and [`Op::Slope`] index.
    pub fn tables(&self) -> &[Arc<Table>] {
        &self.tables
    }

    /// The value of a node that depends on nothing.
    pub fn as_constant(&self, node: NodeId) -> Option<f64> {
        match self.op(node) {
            Op::Constant(bits) => Some(f64::from_bits(bits)),
            _ => None,
        }
    }

    /// Adds a tree; `leaf` says what its leaves are.
    ///
    /// # Errors
    /// The first error of `leaf`.
    pub fn add<L, E>(
        &mut self,
        expr: &Expr<L>,
        leaf: &mut dyn FnMut(&mut Dag, &L, Span) -> Result<NodeId, E>,
    ) -> Result<NodeId, E> {
        Ok(match &*expr.node {
            Node::Number(value) => self.constant(*value),
            Node::Leaf(name) => leaf(self, name, expr.span)?,
            Node::Unary(op, a) => {
                let a = self.add(a, leaf)?;
                self.unary(*op, a)
            }
            Node::Binary(op, a, b) => {
                let a = self.add(a, leaf)?;
                let b = self.add(b, leaf)?;
                self.binary(*op, a, b)
            }
            Node::Call(function, arguments) => {
                let mut nodes = Vec::with_capacity(arguments.len());
                for argument in arguments {
                    nodes.push(self.add(argument, leaf)?);
                }
                self.call(*function, &nodes)
            }
            Node::If(c, a, b) => {
                let c = self.add(c, leaf)?;
                let a = self.add(a, leaf)?;
                let b = self.add(b, leaf)?;
                self.select(c, a, b)
            }
            Node::Table(a, table) => {
                let a = self.add(a, leaf)?;
                self.table(a, table)
            }
        })
    }

    /// −a or not a.
    pub fn unary(&mut self, op: Unary, a: NodeId) -> NodeId {
        if let Some(value) = self.as_constant(a) {
            return self.constant(op.value(value));
        }
        match (op, self.op(a)) {
            (Unary::Negate, Op::Unary(Unary::Negate, inner)) => inner,
            (Unary::Negate, Op::Binary(Binary::Subtract, x, y)) => {
                self.binary(Binary::Subtract, y, x)
            }
            _ => self.intern(Op::Unary(op, a)),
        }
    }

    /// a op b.
    pub fn binary(&mut self, op: Binary, a: NodeId, b: NodeId) -> NodeId {
        let (left, right) = (self.as_constant(a), self.as_constant(b));
        if let (Some(x), Some(y)) = (left, right) {
            return self.constant(op.value(x, y));
        }
        let negated = |node: NodeId| match self.op(node) {
            Op::Unary(Unary::Negate, inner) => Some(inner),
            _ => None,
        };
        match (op, left, right) {
            (Binary::Add, Some(0.0), _) => return b,
            (Binary::Add | Binary::Subtract, _, Some(0.0)) => return a,
            (Binary::Subtract, Some(0.0), _) => return self.unary(Unary::Negate, b),
            (Binary::Subtract, ..) if a == b => return self.constant(0.0),
            (Binary::Multiply, Some(0.0), _) => return a,
            (Binary::Multiply, _, Some(0.0)) => return b,
            (Binary::Divide, Some(0.0), _) => return a,
            (Binary::Multiply, Some(1.0), _) => return b,
            (Binary::Multiply | Binary::Divide, _, Some(1.0)) => return a,
            (Binary::Multiply, Some(-1.0), _) => return self.unary(Unary::Negate, b),
            (Binary::Multiply | Binary::Divide, _, Some(-1.0)) => {
                return self.unary(Unary::Negate, a);
            }
            (Binary::Power, _, Some(y)) => return self.constant_power(a, y),
            _ => {}
        }
        match (op, negated(a), negated(b)) {
            (Binary::Add, _, Some(y)) => return self.binary(Binary::Subtract, a, y),
            (Binary::Add, Some(x), _) => return self.binary(Binary::Subtract, b, x),
            (Binary::Subtract, _, Some(y)) => return self.binary(Binary::Add, a, y),
            (Binary::Multiply | Binary::Divide, Some(x), Some(y)) => return self.binary(op, x, y),
            (Binary::Multiply | Binary::Divide, Some(x), None) => {
                let size = self.binary(op, x, b);
                return self.unary(Unary::Negate, size);
            }
            (Binary::Multiply | Binary::Divide, None, Some(y)) => {
                let size = self.binary(op, a, y);
                return self.unary(Unary::Negate, size);
            }
            _ => {}
        }
        let (op, a, b) = match op {
            Binary::Greater => (Binary::Less, b, a),
            Binary::GreaterEqual => (Binary::LessEqual, b, a),
            other => (other, a, b),
        };
        let commutative = matches!(
            op,
            Binary::Add
                | Binary::Multiply
                | Binary::Equal
                | Binary::NotEqual
                | Binary::And
                | Binary::Or
        );
        let (a, b) = if commutative && b < a { (b, a) } else { (a, b) };
        self.intern(Op::Binary(op, a, b))
    }

    /// A function of as many arguments as its row says; NaN for another number of them.
    pub fn call(&mut self, function: Function, arguments: &[NodeId]) -> NodeId {
        let constants: Option<Vec<f64>> = arguments.iter().map(|a| self.as_constant(*a)).collect();
        if let Some(values) = constants {
            return self.constant(function.row().value.at(&values));
        }
        match (function, arguments) {
            (Function::Clamp, [x, low, high]) => {
                let above = self.call(Function::Max, &[*x, *low]);
                self.call(Function::Min, &[above, *high])
            }
            (Function::PowerOfAbs, [a, b]) => {
                let even = self.as_constant(*b).is_some_and(|y| y % 2.0 == 0.0);
                let base = if even { *a } else { self.call(Function::Abs, &[*a]) };
                self.binary(Binary::Power, base, *b)
            }
            (Function::SignedPower, [a, b]) => match self.as_constant(*b) {
                Some(1.0) => *a,
                Some(2.0) => {
                    let size = self.call(Function::Abs, &[*a]);
                    self.binary(Binary::Multiply, *a, size)
                }
                Some(y) if y > 0.0 && y % 2.0 == 1.0 => self.constant_power(*a, y),
                _ => self.intern(Op::Two(function, *a, *b)),
            },
            (_, [a]) => self.intern(Op::One(function, *a)),
            (_, [a, b]) => self.intern(Op::Two(function, *a, *b)),
            _ => self.constant(f64::NAN),
        }
    }

    /// `if c then a else b`.
    pub fn select(&mut self, c: NodeId, a: NodeId, b: NodeId) -> NodeId {
        match self.as_constant(c) {
            Some(value) => {
                if value != 0.0 {
                    a
                } else {
                    b
                }
            }
            None if a == b => a,
            None => self.intern(Op::Select(c, a, b)),
        }
    }

    /// Interpolation in a table.
    pub fn table(&mut self, a: NodeId, table: &Arc<Table>) -> NodeId {
        if let Some(x) = self.as_constant(a) {
            return self.constant(table.value(x));
        }
        let known = self.tables.iter().position(|t| Arc::ptr_eq(t, table) || t == table);
        let k = known.unwrap_or_else(|| {
            self.tables.push(table.clone());
            self.tables.len() - 1
        });
        self.intern(Op::Table(k as u32, a))
    }

    /// The inputs that a node depends on, ascending.
    pub fn inputs_of(&self, node: NodeId) -> Vec<u32> {
        let mut inputs = vec![];
        for node in self.below(&[node]) {
            if let Op::Input(k) = self.op(node) {
                inputs.push(k);
            }
        }
        inputs.sort_unstable();
        inputs
    }

    /// The nodes that are needed for some, in ascending order (operands first).
    pub fn below(&self, nodes: &[NodeId]) -> Vec<NodeId> {
        let mut seen = FxHashSet::default();
        let mut open: Vec<NodeId> = nodes.to_vec();
        while let Some(node) = open.pop() {
            if seen.insert(node) {
                let (operands, n) = self.op(node).operands();
                open.extend(&operands[..n]);
            }
        }
        let mut sorted: Vec<NodeId> = seen.into_iter().collect();
        sorted.sort_unstable();
        sorted
    }

    /// The node as constant + Σ factor·input, where it is that everywhere.
    pub fn affine(&self, node: NodeId) -> Option<Affine> {
        let mut forms: FxHashMap<NodeId, (f64, BTreeMap<u32, f64>)> = FxHashMap::default();
        for below in self.below(&[node]) {
            let form = match self.op(below) {
                Op::Constant(bits) => Some((f64::from_bits(bits), BTreeMap::new())),
                Op::Input(k) => Some((0.0, BTreeMap::from([(k, 1.0)]))),
                Op::Unary(Unary::Negate, a) => forms.get(&a).map(|a| scaled(a, |x| -x)),
                Op::Binary(op @ (Binary::Add | Binary::Subtract), a, b) => {
                    forms.get(&a).zip(forms.get(&b)).map(|(a, b)| {
                        let mut sum = a.clone();
                        sum.0 = op.value(sum.0, b.0);
                        for (k, factor) in &b.1 {
                            let entry = sum.1.entry(*k).or_insert(0.0);
                            *entry = op.value(*entry, *factor);
                        }
                        sum
                    })
                }
                Op::Binary(Binary::Multiply, a, b) => {
                    match (self.as_constant(a), self.as_constant(b)) {
                        (Some(factor), _) => forms.get(&b).map(|b| scaled(b, |x| factor * x)),
                        (_, Some(factor)) => forms.get(&a).map(|a| scaled(a, |x| x * factor)),
                        _ => None,
                    }
                }
                Op::Binary(Binary::Divide, a, b) => self
                    .as_constant(b)
                    .and_then(|divisor| forms.get(&a).map(|a| scaled(a, |x| x / divisor))),
                _ => None,
            };
            if let Some(form) = form {
                forms.insert(below, form);
            } else if below == node {
                return None;
            }
        }
        let (constant, factors) = forms.remove(&node)?;
        Some((constant, factors.into_iter().filter(|(_, factor)| *factor != 0.0).collect()))
    }

    /// Whether the node is constant + Σ factor·input over the inputs below `moving`, wherever the inputs beyond `still`
    /// stay as they are; nothing else may stand in it.
    pub fn is_affine_while(&self, node: NodeId, moving: u32, still: u32) -> bool {
        /// Degree in what moves: 0, 1 or more.
        const CURVED: u32 = 2;
        let mut degrees: FxHashMap<NodeId, u32> = FxHashMap::default();
        for below in self.below(&[node]) {
            let of = |operand: NodeId| degrees.get(&operand).copied().unwrap_or(CURVED);
            let degree = match self.op(below) {
                Op::Constant(_) => 0,
                Op::Input(k) if k < moving => 1,
                Op::Input(k) if k >= still => 0,
                Op::Input(_) => CURVED,
                Op::Unary(Unary::Negate, a) => of(a),
                Op::Binary(Binary::Add | Binary::Subtract, a, b) => of(a).max(of(b)),
                Op::Binary(Binary::Multiply, a, b) => of(a) + of(b),
                Op::Binary(Binary::Divide, a, b) if of(b) == 0 => of(a),
                Op::Select(c, a, b) if of(c) == 0 => of(a).max(of(b)),
                op => {
                    let (operands, n) = op.operands();
                    operands[..n]
                        .iter()
                        .map(|operand| CURVED * of(*operand).min(1))
                        .max()
                        .unwrap_or(CURVED)
                }
            };
            degrees.insert(below, degree);
        }
        degrees.get(&node).is_some_and(|degree| *degree < CURVED)
    }

    /// The node of an operation, which may be there already.
    pub(super) fn intern(&mut self, op: Op) -> NodeId {
        if let Some(node) = self.index.get(&op) {
            return *node;
        }
        let node = NodeId(self.ops.len() as u32);
        let (operands, n) = op.operands();
        let mut reach = if let Op::Input(k) = op { 1 << (k % 64) } else { 0 };
        for operand in &operands[..n] {
            reach |= self.reach[operand.0 as usize];
        }
        self.ops.push(op);
        self.reach.push(reach);
        self.index.insert(op, node);
        node
    }

    /// a^y, whole powers as the products that `values::power` forms.
    fn constant_power(&mut self, a: NodeId, y: f64) -> NodeId {
        if y == 0.5 {
            return self.call(Function::Sqrt, &[a]);
        }
        if y.abs() > 64.0 || y != y.trunc() {
            let y = self.constant(y);
            return self.intern(Op::Binary(Binary::Power, a, y));
        }
        let (mut result, mut square, mut exponent) = (self.constant(1.0), a, y.abs() as u32);
        while exponent > 0 {
            if exponent & 1 == 1 {
                result = self.binary(Binary::Multiply, result, square);
            }
            exponent >>= 1;
            if exponent > 0 {
                square = self.binary(Binary::Multiply, square, square);
            }
        }
        let one = self.constant(1.0);
        if y < 0.0 { self.binary(Binary::Divide, one, result) } else { result }
    }
}

fn scaled(
    form: &(f64, BTreeMap<u32, f64>),
    scale: impl Fn(f64) -> f64,
) -> (f64, BTreeMap<u32, f64>) {
    (scale(form.0), form.1.iter().map(|(k, factor)| (*k, scale(*factor))).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn laws_of_a_mode_are_affine_while_it_stays() {
        let mut dag = Dag::default();
        // Unknowns 0 and 1, time 2, a mode 3.
        let [x, y, time, mode] = [0, 1, 2, 3].map(|k| dag.input(k));
        let across = dag.binary(Binary::Subtract, x, y);
        let two = dag.constant(2.0);
        let conductance = dag.select(mode, two, time);
        let closed = dag.select(mode, two, mode);
        let [linear, timed] =
            [closed, conductance].map(|g| dag.binary(Binary::Multiply, across, g));
        let square = dag.binary(Binary::Multiply, across, across);
        let chosen = dag.select(across, two, mode);
        let root = dag.call(Function::Sqrt, &[mode]);
        let inverse = dag.binary(Binary::Divide, linear, root);
        let step = dag.call(Function::Floor, &[across]);
        for (node, expected) in [
            (linear, true),
            (inverse, true),
            (timed, false),
            (square, false),
            (chosen, false),
            (step, false),
        ] {
            assert_eq!(dag.is_affine_while(node, 2, 3), expected, "{:?}", dag.op(node));
        }
    }
}
