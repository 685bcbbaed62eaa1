//! The equations as programs: residuals, and their exact Jacobian in a fixed pattern.

use super::{Equations, Formula, Input, Known};
use crate::expr::{Dag, NodeId, Program};
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
    for formula in &equations.rates {
        rows.push(add(&mut dag, n, formula));
    }
    for (row, formula) in equations.algebraic.iter().enumerate() {
        rows.push(match pinned(row) {
            Some(pin) => add(&mut dag, n, &pin),
            None => add(&mut dag, n, formula),
        });
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
        slots,
        constants,
        inputs: vec![0.0; n + 1 + equations.waves.len()],
    }
}

fn add(dag: &mut Dag, n: usize, formula: &Formula) -> NodeId {
    let added: Result<NodeId, std::convert::Infallible> =
        dag.add(formula, &mut |dag, leaf, _| Ok(dag.input(input_index(n, *leaf))));
    match added {
        Ok(node) => node,
    }
}

fn input_index(n: usize, input: Input) -> u32 {
    match input {
        Input::Unknown(k) => k,
        Input::Time => n as u32,
        Input::Wave(k) => n as u32 + 1 + k,
    }
}

fn fill(inputs: &mut [f64], waves: &[Known], t: f64, inside: f64, y: &[f64]) {
    inputs[..y.len()].copy_from_slice(y);
    inputs[y.len()] = t;
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
        self.inputs[y.len() + 1..].copy_from_slice(waves);
        self.derivatives(f, jacobian);
    }

    /// Number of functions of time.
    pub fn waves(&self) -> usize {
        self.waves.len()
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
    inputs: Vec<f64>,
}

impl Readings {
    /// The program of some formulas over the unknowns of `equations`.
    pub fn new(equations: &Equations, formulas: &[Formula]) -> Readings {
        let n = equations.unknowns.len();
        let mut dag = Dag::default();
        let outputs: Vec<NodeId> = formulas.iter().map(|f| add(&mut dag, n, f)).collect();
        Readings {
            machine: Machine::new(&dag, &outputs),
            waves: equations.waves.clone(),
            inputs: vec![0.0; n + 1 + equations.waves.len()],
        }
    }

    /// Their values.
    pub fn read(&mut self, t: f64, inside: f64, y: &[f64]) -> impl Iterator<Item = f64> + '_ {
        fill(&mut self.inputs, &self.waves, t, inside, y);
        self.machine.run(&self.inputs);
        self.machine.outputs()
    }
}
