//! The equations as programs: residuals, and their exact Jacobian in a fixed pattern.

use super::{Condition, Equations, Formula, Input, Known, Question};
use crate::expr::{Binary, Dag, Function, Node, NodeId, Program, Unary};
use crate::linear::Pattern;

/// Programs of F(t, y): the rates of the states, then the algebraic rows.
#[derive(Clone, Debug)]
pub struct Compiled {
    /// Number of unknowns and of rows.
    pub n: usize,
    /// Number of states.
    pub states: usize,
    /// Places of ∂F/∂y, with the diagonal of every state.
    pub pattern: Pattern,
    waves: Vec<Known>,
    residual: Machine,
    jacobian: Machine,
    guards: Machine,
    conditions: Vec<Question>,
    /// The slot of each partial derivative that `jacobian` gives after the residuals.
    slots: Vec<u32>,
    /// Slots that are constant, with their values.
    constants: Vec<(u32, f64)>,
    inputs: Vec<f64>,
}

/// A program with its registers.
#[derive(Clone, Debug)]
struct Machine {
    program: Program,
    registers: Vec<f64>,
}

impl Machine {
    fn new(dag: &Dag, outputs: &[NodeId]) -> Machine {
        let program = Program::compile(dag, outputs);
        let registers = program.registers();
        Machine { program, registers }
    }

    fn run(&mut self, inputs: &[f64]) {
        self.program.run(inputs, &mut self.registers);
    }

    fn outputs(&self) -> impl Iterator<Item = f64> + '_ {
        self.program.outputs(&self.registers)
    }
}

/// Compiles the equations. Each pin is an algebraic row, counted from 0, that becomes y = 0 for an unknown which
/// nothing determines.
pub fn compile(equations: &Equations, pins: &[(usize, usize)]) -> Compiled {
    let (n, states) = (equations.unknowns.len(), equations.states);
    let mut dag = Dag::default();
    let pinned = |row: usize| {
        pins.iter().find(|pin| pin.0 == row).map(|pin| Formula::leaf(Input::Unknown(pin.1 as u32)))
    };
    let mut rows = vec![];
    let mut lowering = Lowering::new(&mut dag, equations);
    for formula in &equations.rates {
        rows.push(lowering.add(formula));
    }
    for (row, formula) in equations.algebraic.iter().enumerate() {
        rows.push(match pinned(row) {
            Some(pin) => lowering.add(&pin),
            None => lowering.add(formula),
        });
    }
    let mut guards = vec![];
    for condition in &equations.conditions {
        guards.extend([lowering.add(&condition.a), lowering.add(&condition.b)]);
    }
    let (mut triplets, mut entries) = (vec![], vec![]);
    for (row, node) in rows.iter().enumerate() {
        for (input, partial) in dag.partials(*node) {
            if (input as usize) < n {
                triplets.push((row as u32, input));
                entries.push(partial);
            }
        }
    }
    triplets.extend((0..states as u32).map(|k| (k, k)));
    let (pattern, places) = Pattern::from_triplets(n, &triplets);
    let (mut slots, mut constants, mut outputs) = (vec![], vec![], rows.clone());
    for (entry, place) in entries.iter().zip(places) {
        match dag.as_constant(*entry) {
            Some(value) => constants.push((place, value)),
            None => {
                outputs.push(*entry);
                slots.push(place);
            }
        }
    }
    Compiled {
        n,
        states,
        pattern,
        waves: equations.waves.clone(),
        residual: Machine::new(&dag, &rows),
        jacobian: Machine::new(&dag, &outputs),
        guards: Machine::new(&dag, &guards),
        conditions: equations.conditions.iter().map(|condition| condition.question).collect(),
        slots,
        constants,
        inputs: inputs(equations),
    }
}

/// Room for all inputs, conditions free.
pub(super) fn inputs(equations: &Equations) -> Vec<f64> {
    let mut inputs = vec![0.0; equations.unknowns.len() + 1 + equations.waves.len()];
    inputs.extend(equations.conditions.iter().flat_map(|_| [f64::NAN, 0.0]));
    inputs
}

/// Formulas on their way into a graph.
///
/// A condition is two inputs: the value that it is held at (NaN: it is evaluated as it stands) and, where that is not
/// 0, the slope of a ramp in its place. On a ramp a truth lies between 0 and 1: `if` blends its branches, `and` takes
/// the smaller and `or` the larger.
pub(super) struct Lowering<'a> {
    dag: &'a mut Dag,
    n: usize,
    waves: usize,
    conditions: &'a [Condition],
    known: Vec<Option<NodeId>>,
}

impl<'a> Lowering<'a> {
    pub(super) fn new(dag: &'a mut Dag, equations: &'a Equations) -> Lowering<'a> {
        Lowering {
            dag,
            n: equations.unknowns.len(),
            waves: equations.waves.len(),
            conditions: &equations.conditions,
            known: vec![None; equations.conditions.len()],
        }
    }

    pub(super) fn add(&mut self, formula: &Formula) -> NodeId {
        self.lower(formula).0
    }

    /// A formula's node, and whether it is a truth that may lie between 0 and 1.
    fn lower(&mut self, formula: &Formula) -> (NodeId, bool) {
        let node = match &*formula.node {
            Node::Number(value) => {
                return (self.dag.constant(*value), *value == 0.0 || *value == 1.0);
            }
            Node::Leaf(Input::Condition(k)) => {
                let truth = matches!(
                    self.conditions.get(*k as usize).map(|condition| condition.question),
                    Some(Question::Compare(_))
                );
                return (self.condition(*k as usize), truth);
            }
            Node::Leaf(Input::Unknown(k)) => self.dag.input(*k),
            Node::Leaf(Input::Time) => self.dag.input(self.n as u32),
            Node::Leaf(Input::Wave(k)) => self.dag.input(self.n as u32 + 1 + k),
            Node::Leaf(Input::Parameter(k)) => {
                let first = self.n + 1 + self.waves + 2 * self.conditions.len();
                self.dag.input(first as u32 + k)
            }
            Node::Unary(op, a) => {
                let (a, truth) = self.lower(a);
                if *op == Unary::Not && truth {
                    let one = self.dag.constant(1.0);
                    return (self.dag.binary(Binary::Subtract, one, a), true);
                }
                self.dag.unary(*op, a)
            }
            Node::Binary(op @ (Binary::And | Binary::Or), a, b) => {
                let (a, b) = (self.truth(a), self.truth(b));
                let function = if *op == Binary::And { Function::Min } else { Function::Max };
                return (self.dag.call(function, &[a, b]), true);
            }
            Node::Binary(op, a, b) => {
                let (a, b) = (self.add(a), self.add(b));
                self.dag.binary(*op, a, b)
            }
            Node::Call(function, arguments) => {
                let nodes: Vec<NodeId> = arguments.iter().map(|a| self.add(a)).collect();
                self.dag.call(*function, &nodes)
            }
            Node::If(c, a, b) => {
                let (c, soft) = self.lower(c);
                let ((a, first), (b, second)) = (self.lower(a), self.lower(b));
                if !soft {
                    return (self.dag.select(c, a, b), first && second);
                }
                let one = self.dag.constant(1.0);
                let whole = self.dag.binary(Binary::Equal, c, one);
                let change = self.dag.binary(Binary::Subtract, a, b);
                let part = self.dag.binary(Binary::Multiply, c, change);
                let between = self.dag.binary(Binary::Add, b, part);
                let otherwise = self.dag.select(c, between, b);
                return (self.dag.select(whole, a, otherwise), first && second);
            }
            Node::Table(a, table) => {
                let a = self.add(a);
                self.dag.table(a, table)
            }
        };
        (node, false)
    }

    fn truth(&mut self, formula: &Formula) -> NodeId {
        let (node, truth) = self.lower(formula);
        let zero = self.dag.constant(0.0);
        if truth { node } else { self.dag.binary(Binary::NotEqual, node, zero) }
    }

    fn condition(&mut self, k: usize) -> NodeId {
        if let Some(node) = self.known[k] {
            return node;
        }
        let conditions = self.conditions;
        let Condition { question, a, b, .. } = &conditions[k];
        let (a, b) = (self.add(a), self.add(b));
        let dag = &mut *self.dag;
        let place = (self.n + 1 + self.waves + 2 * k) as u32;
        let (held, slope) = (dag.input(place), dag.input(place + 1));
        let (half, one, zero) = (dag.constant(0.5), dag.constant(1.0), dag.constant(0.0));
        let as_it_stands = match question {
            Question::Compare(op) => dag.binary(*op, a, b),
            Question::Sign => dag.call(Function::Sign, &[a]),
            Question::Floor => dag.call(Function::Floor, &[a]),
        };
        // Held at NaN the two are not equal.
        let is_held = dag.binary(Binary::Equal, held, held);
        let crisp = dag.select(is_held, held, as_it_stands);
        let from = if *question == Question::Floor { held } else { b };
        let distance = dag.binary(Binary::Subtract, a, from);
        let rise = dag.binary(Binary::Multiply, slope, distance);
        let minus = dag.constant(-1.0);
        // From −1 below the ramp to 1 above it.
        let part = dag.call(Function::Clamp, &[rise, minus, one]);
        let part_of_one = |dag: &mut Dag, sign: f64| {
            let scale = dag.constant(0.5 * sign);
            let part = dag.binary(Binary::Multiply, scale, part);
            dag.binary(Binary::Add, half, part)
        };
        let ramp = match question {
            Question::Compare(Binary::Less | Binary::LessEqual) => part_of_one(dag, -1.0),
            Question::Compare(Binary::Greater | Binary::GreaterEqual) => part_of_one(dag, 1.0),
            Question::Compare(_) => crisp,
            Question::Sign => part,
            Question::Floor => {
                let below = dag.binary(Binary::Subtract, held, one);
                let part = part_of_one(dag, 1.0);
                dag.binary(Binary::Add, below, part)
            }
        };
        let is_ramp = dag.binary(Binary::NotEqual, slope, zero);
        let node = dag.select(is_ramp, ramp, crisp);
        self.known[k] = Some(node);
        node
    }
}

fn fill(inputs: &mut [f64], waves: &[Known], t: f64, inside: f64, y: &[f64]) {
    inputs[..y.len()].copy_from_slice(y);
    inputs[y.len()] = t;
    // Conditions stand behind, and stay.
    for (input, wave) in inputs[y.len() + 1..].iter_mut().zip(waves) {
        *input = wave.value(t, inside);
    }
}

impl Compiled {
    /// F(t, y), functions of time being those of the segment that holds `inside`.
    pub fn residual(&mut self, t: f64, inside: f64, y: &[f64], f: &mut [f64]) {
        fill(&mut self.inputs, &self.waves, t, inside, y);
        self.residual.run(&self.inputs);
        f.iter_mut().zip(self.residual.outputs()).for_each(|(f, value)| *f = value);
    }

    /// F(t, y) and ∂F/∂y in the slots of the pattern.
    pub fn jacobian(
        &mut self,
        t: f64,
        inside: f64,
        y: &[f64],
        f: &mut [f64],
        jacobian: &mut [f64],
    ) {
        fill(&mut self.inputs, &self.waves, t, inside, y);
        self.derivatives(f, jacobian);
    }

    /// The same with given values of the functions of time.
    pub fn jacobian_with(
        &mut self,
        t: f64,
        waves: &[f64],
        y: &[f64],
        f: &mut [f64],
        jacobian: &mut [f64],
    ) {
        self.inputs[..y.len()].copy_from_slice(y);
        self.inputs[y.len()] = t;
        self.inputs[y.len() + 1..y.len() + 1 + waves.len()].copy_from_slice(waves);
        self.derivatives(f, jacobian);
    }

    /// Number of functions of time.
    pub fn waves(&self) -> usize {
        self.waves.len()
    }

    /// What conditions ask.
    pub fn conditions(&self) -> &[Question] {
        &self.conditions
    }

    /// Holds a condition at a value, or lets it go (NaN); with a slope that is not 0 it is a ramp.
    pub fn hold(&mut self, condition: usize, value: f64, slope: f64) {
        let place = self.n + 1 + self.waves.len() + 2 * condition;
        self.inputs[place] = value;
        self.inputs[place + 1] = slope;
    }

    /// Makes ramps of a slope of all sides that are let go; 0 makes them conditions again. Says whether there are any.
    pub fn ramp_free(&mut self, slope: f64) -> bool {
        let first = self.n + 1 + self.waves.len();
        let mut any = false;
        for (inputs, question) in self.inputs[first..].chunks_mut(2).zip(&self.conditions) {
            if let [held, ramp] = inputs
                && held.is_nan()
                && *question != Question::Floor
            {
                *ramp = slope;
                any = true;
            }
        }
        any
    }

    /// The two values of each condition's guard.
    pub fn guards(&mut self, t: f64, inside: f64, y: &[f64], values: &mut [f64]) {
        fill(&mut self.inputs, &self.waves, t, inside, y);
        self.guards.run(&self.inputs);
        values.iter_mut().zip(self.guards.outputs()).for_each(|(v, value)| *v = value);
    }

    fn derivatives(&mut self, f: &mut [f64], jacobian: &mut [f64]) {
        self.jacobian.run(&self.inputs);
        jacobian.fill(0.0);
        for (slot, value) in &self.constants {
            jacobian[*slot as usize] += value;
        }
        let mut outputs = self.jacobian.outputs();
        f.iter_mut().zip(&mut outputs).for_each(|(f, value)| *f = value);
        for (slot, value) in self.slots.iter().zip(outputs) {
            jacobian[*slot as usize] += value;
        }
    }
}

/// Formulas to be read off a solution.
#[derive(Clone, Debug)]
pub struct Readings {
    machine: Machine,
    waves: Vec<Known>,
    first_condition: usize,
    inputs: Vec<f64>,
}

impl Readings {
    /// The program of some formulas over the unknowns of `equations`.
    pub fn new(equations: &Equations, formulas: &[Formula]) -> Readings {
        let mut dag = Dag::default();
        let mut lowering = Lowering::new(&mut dag, equations);
        let outputs: Vec<NodeId> = formulas.iter().map(|f| lowering.add(f)).collect();
        Readings {
            machine: Machine::new(&dag, &outputs),
            waves: equations.waves.clone(),
            first_condition: equations.unknowns.len() + 1 + equations.waves.len(),
            inputs: inputs(equations),
        }
    }

    /// Reads conditions as they are held in the equations.
    pub fn follow(&mut self, compiled: &Compiled) {
        let held = &compiled.inputs[compiled.n + 1 + compiled.waves.len()..];
        let own = self.inputs[self.first_condition..].iter_mut();
        own.zip(held).for_each(|(own, held)| *own = *held);
    }

    /// Their values.
    pub fn read(&mut self, t: f64, inside: f64, y: &[f64]) -> impl Iterator<Item = f64> + '_ {
        fill(&mut self.inputs, &self.waves, t, inside, y);
        self.machine.run(&self.inputs);
        self.machine.outputs()
    }
}
