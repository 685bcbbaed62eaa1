//! A flat program of one instruction a node: what the step loop runs, without allocating.
//!
//! Registers hold, in this order, the inputs that are used, the constants, and one result for each instruction;
//! operands stand before results, so that a run is one pass. Instructions of the same operation stand together as far as
//! their operands allow, so that what to do is asked once for many. Registers are as many as a power of two where they
//! are few, so that no number needs to be compared with their end. What only one side of a choice needs is passed over
//! where the other one is taken.

use super::branches::Branches;
use super::dag::{Dag, NodeId, Op};
use super::functions::{Function, Value};
use super::tree::{Binary, Table, Unary};
use super::values::{max, min, power, sign};
use crate::linear::{Number, Pack, put_lane};
use rustc_hash::FxHashMap;
use std::sync::Arc;

/// A compiled set of outputs over inputs.
#[derive(Clone, Debug, Default)]
pub struct Program {
    /// The inputs that are used; input `inputs[r]` goes to register r.
    inputs: Vec<u32>,
    constants: Vec<f64>,
    code: Code,
    tables: Vec<Arc<Table>>,
    /// Their registers.
    outputs: Vec<u32>,
}

/// The registers of each instruction: that of its result, those of its operands.
#[derive(Clone, Debug)]
enum Code {
    Few(Vec<Batch>, Vec<[u16; 4]>),
    Many(Vec<Batch>, Vec<[u32; 4]>),
    /// Each with its own operation, where hardly any two of one kind stand together.
    Single(Vec<(Operation, [u16; 4])>),
}

impl Code {
    fn is_like(&self, other: &Code) -> bool {
        let batches = |a: &[Batch], b: &[Batch]| {
            let mut pairs = a.iter().zip(b);
            a.len() == b.len()
                && pairs.all(|(a, b)| a.count == b.count && a.operation.is_like(b.operation))
        };
        match (self, other) {
            (Code::Few(a, code), Code::Few(b, other)) => batches(a, b) && code == other,
            (Code::Many(a, code), Code::Many(b, other)) => batches(a, b) && code == other,
            (Code::Single(a), Code::Single(b)) => {
                let mut pairs = a.iter().zip(b);
                a.len() == b.len() && pairs.all(|(a, b)| a.1 == b.1 && a.0.is_like(b.0))
            }
            _ => false,
        }
    }
}

/// Batches of fewer instructions on average cost more than they save.
const LEAST_BATCH: usize = 2;

impl Default for Code {
    fn default() -> Code {
        Code::Single(vec![])
    }
}

/// Instructions of one operation, one after another.
#[derive(Clone, Copy, Debug)]
struct Batch {
    operation: Operation,
    /// How many they are.
    count: u32,
}

#[derive(Clone, Copy, Debug)]
enum Operation {
    Add,
    Subtract,
    Multiply,
    Divide,
    Negate,
    Power,
    Not,
    Less,
    LessEqual,
    Equal,
    /// Other comparisons and logic.
    Truth(Binary),
    Select,
    Abs,
    Sign,
    Sqrt,
    Min,
    Max,
    One(fn(f64) -> f64),
    Two(fn(f64, f64) -> f64),
    Table(u32),
    Slope(u32),
    /// So many batches and instructions follow that matter only where a register is not 0, or only where it is.
    Unless {
        register: u32,
        holds: bool,
        batches: u32,
        instructions: u32,
    },
}

impl Operation {
    /// Whether it does the same; functions that may be the same count as different ones.
    fn is_like(self, other: Operation) -> bool {
        use Operation::*;
        match (self, other) {
            (One(a), One(b)) => std::ptr::fn_addr_eq(a, b),
            (Two(a), Two(b)) => std::ptr::fn_addr_eq(a, b),
            (Truth(a), Truth(b)) => a == b,
            (Table(a), Table(b)) | (Slope(a), Slope(b)) => a == b,
            (
                Unless { register, holds, batches, instructions },
                Unless { register: r, holds: h, batches: b, instructions: i },
            ) => (register, holds, batches, instructions) == (r, h, b, i),
            _ => std::mem::discriminant(&self) == std::mem::discriminant(&other),
        }
    }
}

/// Instructions are put together within so many: what is computed stays near where it is used.
const WINDOW: usize = 128;

/// A node's operation without its operands.
fn bare(op: Op) -> Op {
    let none = NodeId(0);
    match op {
        Op::Constant(_) | Op::Input(_) => op,
        Op::Unary(f, _) => Op::Unary(f, none),
        Op::Binary(f, ..) => Op::Binary(f, none, none),
        Op::One(f, _) => Op::One(f, none),
        Op::Two(f, ..) => Op::Two(f, none, none),
        Op::Select(..) => Op::Select(none, none, none),
        Op::Table(k, _) => Op::Table(k, none),
        Op::Slope(k, _) => Op::Slope(k, none),
    }
}

fn operation(op: Op) -> Operation {
    match op {
        Op::Constant(_) | Op::Input(_) => Operation::One(|_| f64::NAN),
        Op::Unary(Unary::Negate, _) => Operation::Negate,
        Op::Unary(Unary::Not, _) => Operation::Not,
        Op::Binary(op, ..) => match op {
            Binary::Add => Operation::Add,
            Binary::Subtract => Operation::Subtract,
            Binary::Multiply => Operation::Multiply,
            Binary::Divide => Operation::Divide,
            Binary::Power => Operation::Power,
            Binary::Less => Operation::Less,
            Binary::LessEqual => Operation::LessEqual,
            Binary::Equal => Operation::Equal,
            truth => Operation::Truth(truth),
        },
        Op::One(Function::Abs, _) => Operation::Abs,
        Op::One(Function::Sign, _) => Operation::Sign,
        Op::One(Function::Sqrt, _) => Operation::Sqrt,
        Op::One(function, _) => match function.row().value {
            Value::One(value) => Operation::One(value),
            _ => Operation::One(|_| f64::NAN),
        },
        Op::Two(Function::Min, ..) => Operation::Min,
        Op::Two(Function::Max, ..) => Operation::Max,
        Op::Two(function, ..) => match function.row().value {
            Value::Two(value) => Operation::Two(value),
            _ => Operation::Two(|_, _| f64::NAN),
        },
        Op::Select(..) => Operation::Select,
        Op::Table(k, _) => Operation::Table(k),
        Op::Slope(k, _) => Operation::Slope(k),
    }
}

/// A program while it is written.
struct Writer<'a> {
    dag: &'a Dag,
    branches: Branches,
    register: FxHashMap<NodeId, u32>,
    /// The register of the first result.
    first: usize,
    code: Vec<[u32; 4]>,
    batches: Vec<Batch>,
}

impl Writer<'_> {
    /// Writes what is left of a branch below a node; before each choice what only its two sides need.
    fn write(&mut self, branch: usize, limit: NodeId) {
        let mut straight: Vec<NodeId> = vec![];
        while let Some(node) = self.branches.next(branch, limit) {
            if let Op::Select(condition, ..) = self.dag.op(node) {
                for (side, holds) in self.branches.sides(branch, condition) {
                    if !self.branches.waits(side, node) {
                        continue;
                    }
                    self.batch(&std::mem::take(&mut straight));
                    let (at, before) = (self.batches.len(), self.code.len());
                    self.batches.push(Batch { operation: Operation::Not, count: 0 });
                    self.write(side, node);
                    self.batches[at].operation = Operation::Unless {
                        register: self.register[&condition],
                        holds,
                        batches: (self.batches.len() - at - 1) as u32,
                        instructions: (self.code.len() - before) as u32,
                    };
                }
            }
            straight.push(node);
        }
        self.batch(&straight);
    }

    /// Writes nodes, which stand in ascending order, one operation after another.
    fn batch(&mut self, nodes: &[NodeId]) {
        let dag = self.dag;
        for window in nodes.chunks(WINDOW) {
            // Operands of this window are known once their place in it is done; all others are.
            let mut done = vec![false; window.len()];
            let mut waiting: Vec<usize> = (0..window.len()).collect();
            let inside: Vec<[Option<usize>; 3]> = window
                .iter()
                .map(|node| {
                    let (operands, count) = dag.op(*node).operands();
                    let place = |k| (k < count).then(|| window.binary_search(&operands[k]).ok());
                    std::array::from_fn(|k| place(k).flatten())
                })
                .collect();
            // The first that waits has all its operands; with it goes whatever of its kind has its own.
            while let Some(kind) = waiting.first().map(|k| bare(dag.op(window[*k]))) {
                let before = self.code.len();
                waiting.retain(|k| {
                    let op = dag.op(window[*k]);
                    let known = inside[*k].iter().flatten().all(|operand| done[*operand]);
                    if bare(op) != kind || !known {
                        return true;
                    }
                    done[*k] = true;
                    let (operands, count) = op.operands();
                    let result = (self.first + self.code.len()) as u32;
                    let mut places = [result, 0, 0, 0];
                    for (place, operand) in places[1..].iter_mut().zip(&operands[..count]) {
                        *place = self.register[operand];
                    }
                    self.register.insert(window[*k], result);
                    self.code.push(places);
                    false
                });
                let count = (self.code.len() - before) as u32;
                self.batches.push(Batch { operation: operation(kind), count });
            }
        }
    }
}

/// Instructions each with its own operation. What is passed over is counted in these.
fn one_by_one(
    batches: &[Batch],
    mut code: impl Iterator<Item = [u16; 4]>,
) -> Vec<(Operation, [u16; 4])> {
    let mut starts = vec![0];
    for Batch { operation, count } in batches {
        let own = if matches!(operation, Operation::Unless { .. }) { 1 } else { *count };
        starts.push(starts.last().unwrap_or(&0) + own);
    }
    let mut list = vec![];
    for (k, Batch { operation, count }) in batches.iter().enumerate() {
        if let Operation::Unless { register, holds, batches, .. } = *operation {
            let instructions = starts[k + 1 + batches as usize] - starts[k + 1];
            list.push((Operation::Unless { register, holds, batches, instructions }, [0; 4]));
        } else {
            list.extend(code.by_ref().take(*count as usize).map(|places| (*operation, places)));
        }
    }
    list
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
        let results: Vec<NodeId> =
            nodes.into_iter().filter(|node| !register.contains_key(node)).collect();
        let branches = Branches::of(dag, &results, outputs);
        let mut writer = Writer { dag, branches, register, first, code: vec![], batches: vec![] };
        writer.write(Branches::ALWAYS, NodeId(u32::MAX));
        let Writer { register, code, batches, .. } = writer;
        program.outputs = outputs.iter().map(|node| register[node]).collect();
        let used = first + code.len();
        // Numbers below the size of a file, which a u16 holds.
        let few = |places: &[u32; 4]| places.map(|place| place as u16);
        program.code = match FILES.iter().any(|size| used <= *size) {
            true if code.len() < LEAST_BATCH * batches.len() => {
                Code::Single(one_by_one(&batches, code.iter().map(few)))
            }
            true => Code::Few(batches, code.iter().map(few).collect()),
            false => Code::Many(batches, code),
        };
        program
    }

    /// Registers for [`run`](Program::run), with the constants in place.
    pub fn registers<T: Number>(&self) -> Vec<T> {
        let used = self.first_result() + self.instructions();
        let size = FILES.into_iter().find(|size| used <= *size).unwrap_or(used);
        let mut registers = vec![T::ZERO; size];
        let constants = registers.iter_mut().skip(self.inputs.len()).zip(&self.constants);
        constants.for_each(|(register, value)| *register = T::splat(*value));
        registers
    }

    /// Puts the constants of this program into a lane of the registers of another, which differs from it in these alone;
    /// says whether it does.
    pub fn put_constants(&self, like: &Program, lane: usize, registers: &mut [Pack]) -> bool {
        let alike = self.inputs == like.inputs
            && self.constants.len() == like.constants.len()
            && self.outputs == like.outputs
            && self.tables == like.tables
            && self.code.is_like(&like.code);
        if alike {
            put_lane(&mut registers[self.inputs.len()..], lane, &self.constants);
        }
        alike
    }

    /// Computes all results. `inputs` holds every input by its number; `registers` are those of
    /// [`registers`](Program::registers), used by this program alone.
    ///
    /// # Panics
    /// When `inputs` or `registers` are too short: an error of the caller, never of a model.
    pub fn run<T: Number>(&self, inputs: &[T], registers: &mut [T]) {
        for (register, input) in registers.iter_mut().zip(&self.inputs) {
            *register = inputs[*input as usize];
        }
        if let Code::Many(batches, code) = &self.code {
            self.batches(batches, code, registers);
        } else if let Ok(file) = <&mut [T; SMALL]>::try_from(&mut *registers) {
            self.few(file);
        } else if let Ok(file) = <&mut [T; MIDDLE]>::try_from(&mut *registers) {
            self.few(file);
        } else if let Ok(file) = <&mut [T; LARGE]>::try_from(&mut *registers) {
            self.few(file);
        } else {
            let (file, _) = registers.as_chunks_mut::<LARGEST>();
            self.few(&mut file[0]);
        }
    }

    fn few<T: Number, R: Registers<u16, T>>(&self, r: &mut R) {
        match &self.code {
            Code::Single(code) => self.singles(code, r),
            Code::Few(batches, code) => self.batches(batches, code, r),
            Code::Many(..) => {}
        }
    }

    fn batches<P: Copy, T: Number, R: Registers<P, T> + ?Sized>(
        &self,
        mut batches: &[Batch],
        code: &[[P; 4]],
        r: &mut R,
    ) {
        let mut left = code;
        while let [Batch { operation, count }, others @ ..] = batches {
            batches = others;
            let (now, rest) = left.split_at(*count as usize);
            left = rest;
            match *operation {
                Operation::Unless { register, holds, batches: skipped, instructions } => {
                    if r.at(register as usize).every(|value| (value != 0.0) != holds) {
                        batches = &batches[skipped as usize..];
                        left = &left[instructions as usize..];
                    }
                }
                operation => self.apply(operation, now, r),
            }
        }
    }

    fn singles<T: Number, R: Registers<u16, T>>(&self, code: &[(Operation, [u16; 4])], r: &mut R) {
        let mut left = code;
        while let [(operation, places), rest @ ..] = left {
            left = rest;
            match *operation {
                Operation::Unless { register, holds, instructions, .. } => {
                    if r.at(register as usize).every(|value| (value != 0.0) != holds) {
                        left = &left[instructions as usize..];
                    }
                }
                operation => self.apply(operation, std::slice::from_ref(places), r),
            }
        }
    }

    #[inline(always)]
    fn apply<P: Copy, T: Number, R: Registers<P, T> + ?Sized>(
        &self,
        operation: Operation,
        code: &[[P; 4]],
        r: &mut R,
    ) {
        match operation {
            Operation::Add => two(r, code, |a, b| a + b),
            Operation::Subtract => two(r, code, |a, b| a - b),
            Operation::Multiply => two(r, code, |a, b| a * b),
            Operation::Divide => two(r, code, |a, b| a / b),
            Operation::Negate => one(r, code, |a| -a),
            Operation::Power => two(r, code, power),
            Operation::Not => one(r, code, |a| f64::from(a == 0.0)),
            Operation::Less => two(r, code, |a, b| f64::from(a < b)),
            Operation::LessEqual => two(r, code, |a, b| f64::from(a <= b)),
            Operation::Equal => two(r, code, |a, b| f64::from(a == b)),
            Operation::Truth(op) => two(r, code, |a, b| op.value(a, b)),
            Operation::Select => three(r, code, |c, a, b| if c != 0.0 { a } else { b }),
            Operation::Abs => one(r, code, f64::abs),
            Operation::Sign => one(r, code, sign),
            Operation::Sqrt => one(r, code, f64::sqrt),
            Operation::Min => two(r, code, min),
            Operation::Max => two(r, code, max),
            Operation::One(f) => one(r, code, f),
            Operation::Two(f) => two(r, code, f),
            Operation::Table(k) => one(r, code, |a| self.tables[k as usize].value(a)),
            Operation::Slope(k) => one(r, code, |a| self.tables[k as usize].slope(a)),
            // Those who run a program know it.
            Operation::Unless { .. } => {}
        }
    }

    /// The value of output `k` after a run.
    pub fn output<T: Number>(&self, k: usize, registers: &[T]) -> T {
        registers[self.outputs[k] as usize]
    }

    /// The values of all outputs after a run, in order.
    pub fn outputs<'a, T: Number>(&'a self, registers: &'a [T]) -> impl Iterator<Item = T> + 'a {
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
        match &self.code {
            Code::Few(_, code) => code.len(),
            Code::Many(_, code) => code.len(),
            Code::Single(code) => {
                let passes = |(operation, _): &&(Operation, _)| {
                    !matches!(operation, Operation::Unless { .. })
                };
                code.iter().filter(passes).count()
            }
        }
    }

    fn first_result(&self) -> usize {
        self.inputs.len() + self.constants.len()
    }
}

/// Sizes of the files of registers that are few.
const SMALL: usize = 64;
const MIDDLE: usize = 256;
const LARGE: usize = 1024;
const LARGEST: usize = 4096;
const FILES: [usize; 4] = [SMALL, MIDDLE, LARGE, LARGEST];

/// What results are put into and taken from, by numbers of a kind.
trait Registers<P, T> {
    fn at(&self, place: usize) -> T;
    fn get(&self, place: P) -> T;
    fn put(&mut self, place: P, value: T);
}

/// Of a power of two of registers every number stands for one.
impl<T: Number, const SIZE: usize> Registers<u16, T> for [T; SIZE] {
    #[inline(always)]
    fn at(&self, place: usize) -> T {
        self[place & (SIZE - 1)]
    }

    #[inline(always)]
    fn get(&self, place: u16) -> T {
        self[place as usize & (SIZE - 1)]
    }

    #[inline(always)]
    fn put(&mut self, place: u16, value: T) {
        self[place as usize & (SIZE - 1)] = value;
    }
}

impl<T: Number> Registers<u32, T> for [T] {
    #[inline(always)]
    fn at(&self, place: usize) -> T {
        self[place]
    }

    #[inline(always)]
    fn get(&self, place: u32) -> T {
        self[place as usize]
    }

    #[inline(always)]
    fn put(&mut self, place: u32, value: T) {
        self[place as usize] = value;
    }
}

#[inline(always)]
fn three<P: Copy, T: Number, R: Registers<P, T> + ?Sized>(
    registers: &mut R,
    code: &[[P; 4]],
    f: impl Fn(f64, f64, f64) -> f64,
) {
    for &[to, a, b, c] in code {
        registers.put(to, registers.get(a).with_two(registers.get(b), registers.get(c), &f));
    }
}

#[inline(always)]
fn two<P: Copy, T: Number, R: Registers<P, T> + ?Sized>(
    registers: &mut R,
    code: &[[P; 4]],
    f: impl Fn(f64, f64) -> f64,
) {
    for &[to, a, b, _] in code {
        registers.put(to, registers.get(a).with(registers.get(b), &f));
    }
}

#[inline(always)]
fn one<P: Copy, T: Number, R: Registers<P, T> + ?Sized>(
    registers: &mut R,
    code: &[[P; 4]],
    f: impl Fn(f64) -> f64,
) {
    for &[to, a, ..] in code {
        registers.put(to, registers.get(a).map(&f));
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
        fn what_was_passed_over_leaves_no_trace(
            expr in trees(),
            points in prop::collection::vec(prop::array::uniform3(-3.0..3.0f64), 3),
        ) {
            let mut dag = Dag::default();
            let node = add(&mut dag, &expr);
            let outputs = [node, dag.derivative(node, 0), dag.derivative(node, 1)];
            let program = Program::compile(&dag, &outputs);
            let mut registers = program.registers();
            for x in &points {
                program.run(x, &mut registers);
                for (value, output) in program.outputs(&registers).zip(outputs) {
                    let alone = run(&dag, output, x);
                    prop_assert!(value.to_bits() == alone.to_bits() || (value.is_nan() && alone.is_nan()));
                }
            }
        }

        #[test]
        fn lanes_are_what_each_is_alone(
            expr in trees(),
            points in prop::array::uniform4(prop::array::uniform3(-3.0..3.0f64)),
        ) {
            let mut dag = Dag::default();
            let node = add(&mut dag, &expr);
            let outputs = [node, dag.derivative(node, 0), dag.derivative(node, 1)];
            let program = Program::compile(&dag, &outputs);
            let mut inputs = [Pack::ZERO; 3];
            points.iter().enumerate().for_each(|(lane, x)| put_lane(&mut inputs, lane, x));
            let mut registers = program.registers();
            program.run(&inputs, &mut registers);
            for (k, value) in program.outputs(&registers).enumerate() {
                for (lane, x) in points.iter().enumerate() {
                    let mut own = program.registers();
                    program.run(x, &mut own);
                    let (value, alone) = (value.0[lane], program.output(k, &own));
                    prop_assert!(value.to_bits() == alone.to_bits() || (value.is_nan() && alone.is_nan()));
                }
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
    fn lanes_take_what_differs_in_constants_alone() {
        let of = |factor: f64, root: bool| {
            let mut dag = Dag::default();
            let (x, factor) = (dag.input(0), dag.constant(factor));
            let product = dag.binary(Binary::Multiply, factor, x);
            let node = if root { dag.call(Function::Sqrt, &[product]) } else { product };
            Program::compile(&dag, &[node])
        };
        let (one, other, root) = (of(2.5, false), of(-4.0, false), of(2.5, true));
        let mut registers: Vec<Pack> = one.registers();
        assert!(other.put_constants(&one, 2, &mut registers));
        assert!(!root.put_constants(&one, 1, &mut registers));
        one.run(&[Pack::splat(3.0)], &mut registers);
        assert_eq!(one.output(0, &registers), Pack([7.5, 7.5, -12.0, 7.5]));
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
