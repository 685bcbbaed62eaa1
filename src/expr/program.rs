//! A flat program of one instruction a node: what the step loop runs, without allocating.
//!
//! Registers hold, in this order, the inputs that are used, the constants, and one result for each instruction;
//! operands stand before results, so that a run is one pass.

use super::dag::{Dag, NodeId, Op};
use super::functions::{Function, Value};
use super::tree::{Binary, Table, Unary};
use super::values::{max, min, power, sign};
use rustc_hash::FxHashMap;
use std::sync::Arc;

/// A compiled set of outputs over inputs.
#[derive(Clone, Debug, Default)]
pub struct Program {
    /// The inputs that are used; input `inputs[r]` goes to register r.
    inputs: Vec<u32>,
    constants: Vec<f64>,
    instructions: Vec<Instruction>,
    tables: Vec<Arc<Table>>,
    /// Their registers.
    outputs: Vec<u32>,
}

#[derive(Clone, Copy, Debug)]
enum Instruction {
    Add(u32, u32),
    Subtract(u32, u32),
    Multiply(u32, u32),
    Divide(u32, u32),
    Negate(u32),
    Power(u32, u32),
    Not(u32),
    /// Comparisons and logic.
    Truth(Binary, u32, u32),
    Select(u32, u32, u32),
    Abs(u32),
    Sign(u32),
    Sqrt(u32),
    Min(u32, u32),
    Max(u32, u32),
    One(fn(f64) -> f64, u32),
    Two(fn(f64, f64) -> f64, u32, u32),
    Table(u32, u32),
    Slope(u32, u32),
}

impl Program {
    /// The program of some nodes, in ascending order of nodes.
    pub fn compile(dag: &Dag, outputs: &[NodeId]) -> Program {
        let nodes = dag.below(outputs);
        let mut program = Program { tables: dag.tables().to_vec(), ..Program::default() };
        let mut register: FxHashMap<NodeId, u32> = FxHashMap::default();
        for node in &nodes {
            if let Op::Input(k) = dag.op(*node) {
                register.insert(*node, program.inputs.len() as u32);
                program.inputs.push(k);
            }
        }
        for node in &nodes {
            if let Some(value) = dag.as_constant(*node) {
                register.insert(*node, (program.inputs.len() + program.constants.len()) as u32);
                program.constants.push(value);
            }
        }
        let first = program.first_result();
        for node in nodes {
            let at = |operand: NodeId| register[&operand];
            let instruction = match dag.op(node) {
                Op::Constant(_) | Op::Input(_) => continue,
                Op::Unary(Unary::Negate, a) => Instruction::Negate(at(a)),
                Op::Unary(Unary::Not, a) => Instruction::Not(at(a)),
                Op::Binary(op, a, b) => match op {
                    Binary::Add => Instruction::Add(at(a), at(b)),
                    Binary::Subtract => Instruction::Subtract(at(a), at(b)),
                    Binary::Multiply => Instruction::Multiply(at(a), at(b)),
                    Binary::Divide => Instruction::Divide(at(a), at(b)),
                    Binary::Power => Instruction::Power(at(a), at(b)),
                    truth => Instruction::Truth(truth, at(a), at(b)),
                },
                Op::One(Function::Abs, a) => Instruction::Abs(at(a)),
                Op::One(Function::Sign, a) => Instruction::Sign(at(a)),
                Op::One(Function::Sqrt, a) => Instruction::Sqrt(at(a)),
                Op::One(function, a) => match function.row().value {
                    Value::One(value) => Instruction::One(value, at(a)),
                    _ => Instruction::One(|_| f64::NAN, at(a)),
                },
                Op::Two(Function::Min, a, b) => Instruction::Min(at(a), at(b)),
                Op::Two(Function::Max, a, b) => Instruction::Max(at(a), at(b)),
                Op::Two(function, a, b) => match function.row().value {
                    Value::Two(value) => Instruction::Two(value, at(a), at(b)),
                    _ => Instruction::Two(|_, _| f64::NAN, at(a), at(b)),
                },
                Op::Select(c, a, b) => Instruction::Select(at(c), at(a), at(b)),
                Op::Table(k, a) => Instruction::Table(k, at(a)),
                Op::Slope(k, a) => Instruction::Slope(k, at(a)),
            };
            register.insert(node, (first + program.instructions.len()) as u32);
            program.instructions.push(instruction);
        }
        program.outputs = outputs.iter().map(|node| register[node]).collect();
        program
    }

    /// Registers for [`run`](Program::run), with the constants in place.
    pub fn registers(&self) -> Vec<f64> {
        let mut registers = vec![0.0; self.first_result() + self.instructions.len()];
        registers[self.inputs.len()..self.first_result()].copy_from_slice(&self.constants);
        registers
    }

    /// Computes all results. `inputs` holds every input by its number; `registers` are those of
    /// [`registers`](Program::registers), used by this program alone.
    ///
    /// # Panics
    /// When `inputs` or `registers` are too short: an error of the caller, never of a model.
    pub fn run(&self, inputs: &[f64], registers: &mut [f64]) {
        for (register, input) in registers.iter_mut().zip(&self.inputs) {
            *register = inputs[*input as usize];
        }
        let first = self.first_result();
        for (k, instruction) in self.instructions.iter().enumerate() {
            let (known, rest) = registers.split_at_mut(first + k);
            let r = |register: u32| known[register as usize];
            rest[0] = match *instruction {
                Instruction::Add(a, b) => r(a) + r(b),
                Instruction::Subtract(a, b) => r(a) - r(b),
                Instruction::Multiply(a, b) => r(a) * r(b),
                Instruction::Divide(a, b) => r(a) / r(b),
                Instruction::Negate(a) => -r(a),
                Instruction::Power(a, b) => power(r(a), r(b)),
                Instruction::Not(a) => f64::from(r(a) == 0.0),
                Instruction::Truth(op, a, b) => op.value(r(a), r(b)),
                Instruction::Select(c, a, b) => {
                    if r(c) != 0.0 {
                        r(a)
                    } else {
                        r(b)
                    }
                }
                Instruction::Abs(a) => r(a).abs(),
                Instruction::Sign(a) => sign(r(a)),
                Instruction::Sqrt(a) => r(a).sqrt(),
                Instruction::Min(a, b) => min(r(a), r(b)),
                Instruction::Max(a, b) => max(r(a), r(b)),
                Instruction::One(f, a) => f(r(a)),
                Instruction::Two(f, a, b) => f(r(a), r(b)),
                Instruction::Table(k, a) => self.tables[k as usize].value(r(a)),
                Instruction::Slope(k, a) => self.tables[k as usize].slope(r(a)),
            };
        }
    }

    /// The value of output `k` after a run.
    pub fn output(&self, k: usize, registers: &[f64]) -> f64 {
        registers[self.outputs[k] as usize]
    }

    /// The values of all outputs after a run, in order.
    pub fn outputs<'a>(&'a self, registers: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
        self.outputs.iter().map(|r| registers[*r as usize])
    }

    /// The number of outputs.
    pub fn len(&self) -> usize {
        self.outputs.len()
    }

    /// Whether it computes nothing.
    pub fn is_empty(&self) -> bool {
        self.outputs.is_empty()
    }

    /// The number of instructions.
    pub fn instructions(&self) -> usize {
        self.instructions.len()
    }

    fn first_result(&self) -> usize {
        self.inputs.len() + self.constants.len()
    }
}

#[cfg(test)]
mod tests {
    use super::super::tree::{Expr, Node};
    use super::*;
    use proptest::prelude::*;

    /// Trees over inputs 0, 1, 2, of every operation and function.
    fn trees() -> impl Strategy<Value = Expr<u32>> {
        let table = Arc::new(Table::lines(vec![-1.0, 0.0, 2.0], vec![3.0, 1.0, 2.0]));
        let leaf = prop_oneof![
            (0..3u32).prop_map(Expr::leaf),
            prop_oneof![Just(0.0), Just(1.0), Just(-1.0), Just(2.0), Just(0.5), -3.0..3.0f64]
                .prop_map(Expr::number),
        ];
        leaf.prop_recursive(5, 40, 3, move |inner| {
            let table = table.clone();
            let binary = (0..13usize, inner.clone(), inner.clone()).prop_map(|(op, a, b)| {
                use Binary::*;
                let ops = [
                    Add, Subtract, Multiply, Divide, Power, Less, LessEqual, Greater, GreaterEqual,
                    Equal, NotEqual, And, Or,
                ];
                a.binary(ops[op], b)
            });
            let call = (0..super::super::FUNCTIONS.len(), prop::collection::vec(inner.clone(), 3))
                .prop_map(|(k, mut arguments)| {
                    let row = &super::super::FUNCTIONS[k];
                    arguments.truncate(row.value.arguments());
                    Expr::call(row.function, arguments)
                });
            prop_oneof![
                3 => binary,
                2 => call,
                1 => inner.clone().prop_map(|a| -a),
                1 => inner.clone().prop_map(|a| Expr::new(Node::Unary(Unary::Not, a), crate::source::Span::NONE)),
                1 => (inner.clone(), inner.clone(), inner.clone()).prop_map(|(c, a, b)| Expr::choice(c, a, b)),
                1 => inner.prop_map(move |a| Expr::new(Node::Table(a, table.clone()), crate::source::Span::NONE)),
            ]
        })
    }

    fn add(dag: &mut Dag, expr: &Expr<u32>) -> NodeId {
        let added: Result<_, std::convert::Infallible> =
            dag.add(expr, &mut |dag, k, _| Ok(dag.input(*k)));
        added.unwrap()
    }

    fn run(dag: &Dag, node: NodeId, inputs: &[f64]) -> f64 {
        let program = Program::compile(dag, &[node]);
        let mut registers = program.registers();
        program.run(inputs, &mut registers);
        program.output(0, &registers)
    }

    /// Whether all values on the way are finite: what comes after an infinity or NaN is nobody's promise.
    fn tame(expr: &Expr<u32>, x: &[f64]) -> bool {
        let inner = match &*expr.node {
            Node::Number(_) | Node::Leaf(_) => true,
            Node::Unary(_, a) | Node::Table(a, _) => tame(a, x),
            Node::Binary(_, a, b) => tame(a, x) && tame(b, x),
            Node::Call(function, arguments) => {
                // The angle of (0, 0) has no slope.
                let at = |e: &Expr<u32>| e.evaluate(&mut |k| x[*k as usize]);
                let pole = *function == Function::Atan2 && arguments.iter().all(|a| at(a) == 0.0);
                !pole && arguments.iter().all(|a| tame(a, x))
            }
            Node::If(c, a, b) => tame(c, x) && tame(a, x) && tame(b, x),
        };
        inner && expr.evaluate(&mut |k| x[*k as usize]).abs() < 1e100
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn programs_agree_with_the_tree(expr in trees(), x in prop::array::uniform3(-3.0..3.0f64)) {
            let mut dag = Dag::default();
            let node = add(&mut dag, &expr);
            let expected = expr.evaluate(&mut |k| x[*k as usize]);
            let value = run(&dag, node, &x);
            if tame(&expr, &x) {
                prop_assert!((value - expected).abs() <= 1e-9 * (1.0 + expected.abs()), "{value} {expected}");
            }
        }

        #[test]
        fn affine_forms_are_right(expr in trees(), x in prop::array::uniform3(-3.0..3.0f64)) {
            let mut dag = Dag::default();
            let node = add(&mut dag, &expr);
            if let Some((constant, factors)) = dag.affine(node) {
                let expected = run(&dag, node, &x);
                let value = constant + factors.iter().map(|(k, f)| f * x[*k as usize]).sum::<f64>();
                if expected.is_finite() {
                    let scale = factors.iter().map(|(k, f)| (f * x[*k as usize]).abs()).sum::<f64>();
                    prop_assert!((value - expected).abs() <= 1e-9 * (1.0 + constant.abs() + scale));
                }
            }
        }

        #[test]
        fn derivatives_agree_with_differences(expr in trees(), x in prop::array::uniform3(-3.0..3.0f64)) {
            let mut dag = Dag::default();
            let node = add(&mut dag, &expr);
            for k in 0..3u32 {
                let derivative = dag.derivative(node, k);
                let value = run(&dag, derivative, &x);
                let moved = |h: f64| { let mut p = x; p[k as usize] += h; run(&dag, node, &p) };
                let (h, small) = (1e-4, 0.5e-4);
                let coarse = (moved(h) - moved(-h)) / (2.0 * h);
                let fine = (moved(small) - moved(-small)) / (2.0 * small);
                let one_sided = (moved(small) - moved(0.0)) / small;
                // Where the differences do not agree among themselves there is a corner or a pole nearby.
                let scale = 1.0 + fine.abs();
                let smooth = (coarse - fine).abs() < 1e-5 * scale && (one_sided - fine).abs() < 1e-1 * scale
                    && moved(0.0).abs() < 1e4
                    && tame(&expr, &x);
                if smooth {
                    prop_assert!((value - fine).abs() <= 1e-3 * scale, "by {k}: {value} against {fine}");
                }
            }
        }
    }

    #[test]
    fn equal_subexpressions_are_shared() {
        let mut dag = Dag::default();
        let (x, y) = (dag.input(0), dag.input(1));
        let xy = dag.binary(Binary::Multiply, x, y);
        assert_eq!(xy, dag.binary(Binary::Multiply, y, x));
        assert_eq!(dag.binary(Binary::Greater, x, y), dag.binary(Binary::Less, y, x));
        let negative = dag.unary(Unary::Negate, xy);
        assert_eq!(dag.unary(Unary::Negate, negative), xy);
        assert_eq!(dag.inputs_of(negative), [0, 1]);
    }

    #[test]
    fn the_line_loss_of_the_actuator() {
        // 2 Cl² f √(f² + Q0²) and its derivative 2 Cl² (√ + f²/√), at 0 and elsewhere.
        let f = || Expr::leaf(0u32);
        let square = |e: Expr<u32>| e.binary(Binary::Power, Expr::number(2.0));
        let root = Expr::call(Function::Sqrt, vec![square(f()) + square(Expr::number(1e-5))]);
        let law = Expr::number(5e12) * f() * root;
        let mut dag = Dag::default();
        let node = add(&mut dag, &law);
        let slope = dag.derivative(node, 0);
        assert!((run(&dag, slope, &[0.0]) / 5e7 - 1.0).abs() < 1e-15);
        let (q, r) = (3e-4f64, (9e-8f64 + 1e-10).sqrt());
        assert!((run(&dag, slope, &[q]) / (5e12 * (r + q * q / r)) - 1.0).abs() < 1e-14);
    }

    #[test]
    fn limits_have_one_sided_slopes_and_hide_no_other_branch() {
        let x = || Expr::leaf(0u32);
        let root = Expr::choice(
            x().binary(Binary::Greater, Expr::number(0.0)),
            Expr::call(Function::Sqrt, vec![x()]),
            Expr::number(0.0),
        );
        let clamp = Expr::call(
            Function::Clamp,
            vec![x() * Expr::number(3.0), Expr::number(-1.0), Expr::number(1.0)],
        );
        let mut dag = Dag::default();
        let (root, clamp) = (add(&mut dag, &root), add(&mut dag, &clamp));
        let (root, clamp) = (dag.derivative(root, 0), dag.derivative(clamp, 0));
        assert_eq!(run(&dag, root, &[-4.0]), 0.0);
        assert_eq!(run(&dag, root, &[4.0]), 0.25);
        assert_eq!(run(&dag, clamp, &[0.1]), 3.0);
        assert_eq!(run(&dag, clamp, &[2.0]), 0.0);
        assert_eq!(run(&dag, clamp, &[-2.0]), 0.0);
    }

    #[test]
    fn a_root_of_what_is_cut_off_has_a_slope() {
        let cut = Expr::call(Function::Max, vec![Expr::leaf(0u32), Expr::number(0.0)]);
        let mut dag = Dag::default();
        let root = add(&mut dag, &Expr::call(Function::Sqrt, vec![cut]));
        let slope = dag.derivative(root, 0);
        assert_eq!(run(&dag, slope, &[-2.0]), 0.0);
        assert_eq!(run(&dag, slope, &[4.0]), 0.25);
    }

    #[test]
    fn a_long_sum_costs_no_stack() {
        let mut dag = Dag::default();
        let mut sum = dag.input(0);
        for k in 1..200_000 {
            let next = dag.input(k % 7);
            let square = dag.binary(Binary::Multiply, next, sum);
            sum = dag.call(Function::Tanh, &[square]);
        }
        let slope = dag.derivative(sum, 3);
        assert!(run(&dag, slope, &[0.5; 7]).is_finite());
        assert_eq!(dag.inputs_of(sum), [0, 1, 2, 3, 4, 5, 6]);
    }
}
