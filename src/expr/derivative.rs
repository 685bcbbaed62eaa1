//! Exact derivatives of a [`Dag`]'s nodes, as nodes of the same graph.
//!
//! Rules are those of the table of functions, and the forms are chosen so that nothing overflows and no 0·∞ arises at
//! an ordinary point: y = a/b has y' = (a' − y·b')/b, tanh has 1 − y². Selections (conditions, limits, `abs`) select
//! among derivatives, so that what stands in a branch that is not taken never matters.

use super::dag::{Dag, NodeId, Op};
use super::functions::{Function, Slot, Template};
use super::tree::{Binary, Unary};

impl Dag {
    /// ∂node/∂input, as a node. At corners the derivative of one side; of comparisons, signs and `floor` 0.
    pub fn derivative(&mut self, node: NodeId, input: u32) -> NodeId {
        let zero = self.constant(0.0);
        let mut open = vec![node];
        while let Some(&top) = open.last() {
            if self.known_derivative(top, input, zero).is_some() {
                open.pop();
                continue;
            }
            let (operands, n) = self.op(top).operands();
            let before = open.len();
            for operand in &operands[..n] {
                if self.known_derivative(*operand, input, zero).is_none() {
                    open.push(*operand);
                }
            }
            if open.len() > before {
                continue;
            }
            let inner = operands.map(|o| self.known_derivative(o, input, zero).unwrap_or(zero));
            let result = self.differentiate(top, inner, input);
            self.derivatives.insert((top, input), result);
            open.pop();
        }
        self.known_derivative(node, input, zero).unwrap_or(zero)
    }

    /// All partial derivatives that are not identically 0, by ascending input.
    pub fn partials(&mut self, node: NodeId) -> Vec<(u32, NodeId)> {
        let inputs = self.inputs_of(node);
        let partials = inputs.into_iter().map(|k| (k, self.derivative(node, k)));
        let partials: Vec<_> = partials.collect();
        partials.into_iter().filter(|(_, d)| self.as_constant(*d) != Some(0.0)).collect()
    }

    fn known_derivative(&self, node: NodeId, input: u32, zero: NodeId) -> Option<NodeId> {
        if self.reach[node.0 as usize] & (1 << (input % 64)) == 0 {
            return Some(zero);
        }
        self.derivatives.get(&(node, input)).copied()
    }

    /// The derivative of one operation, given those of its operands.
    fn differentiate(&mut self, node: NodeId, inner: [NodeId; 3], input: u32) -> NodeId {
        let [da, db, dc] = inner;
        match self.op(node) {
            Op::Constant(_) => self.constant(0.0),
            Op::Input(k) => self.constant(f64::from(k == input)),
            Op::Unary(Unary::Negate, _) => self.unary(Unary::Negate, da),
            Op::Unary(Unary::Not, _) => self.constant(0.0),
            Op::Binary(op, a, b) => self.differentiate_binary(node, op, [a, b], [da, db]),
            Op::One(function, a) => self.chain(function, node, &[a], &[da]),
            Op::Two(Function::Min, a, b) => {
                let first = self.binary(Binary::Less, a, b);
                self.select(first, da, db)
            }
            Op::Two(Function::Max, a, b) => {
                let second = self.binary(Binary::Less, a, b);
                self.select(second, db, da)
            }
            Op::Two(function, a, b) => self.chain(function, node, &[a, b], &[da, db]),
            Op::Select(c, ..) => self.select(c, db, dc),
            Op::Table(k, a) => {
                let slope = self.intern(Op::Slope(k, a));
                self.binary(Binary::Multiply, slope, da)
            }
            Op::Slope(..) => self.constant(0.0),
        }
    }

    fn differentiate_binary(
        &mut self,
        node: NodeId,
        op: Binary,
        [a, b]: [NodeId; 2],
        [da, db]: [NodeId; 2],
    ) -> NodeId {
        match op {
            Binary::Add | Binary::Subtract => self.binary(op, da, db),
            Binary::Multiply => {
                let left = self.binary(Binary::Multiply, da, b);
                let right = self.binary(Binary::Multiply, a, db);
                self.binary(Binary::Add, left, right)
            }
            // (a' − y·b')/b needs no b².
            Binary::Divide => {
                let product = self.binary(Binary::Multiply, node, db);
                let difference = self.binary(Binary::Subtract, da, product);
                self.binary(Binary::Divide, difference, b)
            }
            Binary::Power => {
                let one = self.constant(1.0);
                let less = self.binary(Binary::Subtract, b, one);
                let lower = self.binary(Binary::Power, a, less);
                let slope = self.guarded_product(lower, b);
                let by_base = self.guarded_product(slope, da);
                if self.as_constant(db) == Some(0.0) {
                    return by_base;
                }
                // y·ln a, whose limit at a = 0 is 0; a negative base has an exponent that stays whole.
                let zero = self.constant(0.0);
                let positive = self.binary(Binary::Less, zero, a);
                let logarithm = self.call(Function::Ln, &[a]);
                let growth = self.binary(Binary::Multiply, node, logarithm);
                let growth = self.select(positive, growth, zero);
                let by_exponent = self.binary(Binary::Multiply, growth, db);
                self.binary(Binary::Add, by_base, by_exponent)
            }
            Binary::Less
            | Binary::LessEqual
            | Binary::Greater
            | Binary::GreaterEqual
            | Binary::Equal
            | Binary::NotEqual
            | Binary::And
            | Binary::Or => self.constant(0.0),
        }
    }

    /// Σ ∂f/∂argument · argument', by the row of the function.
    fn chain(
        &mut self,
        function: Function,
        node: NodeId,
        arguments: &[NodeId],
        inner: &[NodeId],
    ) -> NodeId {
        let mut sum = self.constant(0.0);
        for (k, derivative) in inner.iter().enumerate() {
            if self.as_constant(*derivative) == Some(0.0) {
                continue;
            }
            let template = (function.row().derivative)(k);
            let partial = self.instantiate(&template, arguments, node);
            let term = if endless_slope(function) {
                self.guarded_product(partial, *derivative)
            } else {
                self.binary(Binary::Multiply, partial, *derivative)
            };
            sum = self.binary(Binary::Add, sum, term);
        }
        sum
    }

    /// a·b, and 0 where b is 0 even if a is infinite: √(max(x, 0)) has the slope 0 for x < 0, where the root's own is
    /// infinite.
    fn guarded_product(&mut self, a: NodeId, b: NodeId) -> NodeId {
        let product = self.binary(Binary::Multiply, a, b);
        let zero = self.constant(0.0);
        self.select(b, product, zero)
    }

    fn instantiate(&mut self, template: &Template, arguments: &[NodeId], node: NodeId) -> NodeId {
        let added: Result<NodeId, std::convert::Infallible> =
            self.add(template, &mut |_, slot, _| {
                Ok(match slot {
                    Slot::Argument(k) => arguments[*k],
                    Slot::Result => node,
                })
            });
        match added {
            Ok(node) => node,
        }
    }
}

/// Whether the slope is infinite at an ordinary point.
fn endless_slope(function: Function) -> bool {
    matches!(
        function,
        Function::Sqrt
            | Function::Ln
            | Function::Log10
            | Function::Asin
            | Function::Acos
            | Function::Acosh
            | Function::Atanh
            | Function::SignedPower
            | Function::RealPower
    )
}
