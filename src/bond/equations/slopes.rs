//! The slopes of the equations, as operations over what they speak of: for matrices of numbers, and for their symbols.
//!
//! Inputs of the operations, in this order: the unknowns, time, the functions of time, two for each condition (free here:
//! conditions stand as they are), the parameters.

use super::compiled::{Lowering, inputs};
use super::{Equations, Formula, Input};
use crate::bond::graph::BondGraph;
use crate::expr::{Dag, NodeId};

/// Partial derivatives of rates, algebraic rows and some more formulas.
#[derive(Clone, Debug, Default)]
pub struct Slopes {
    /// All operations.
    pub dag: Dag,
    /// By row (rates, algebraic rows, then the formulas asked for): its partial derivatives that are not identically 0,
    /// by the unknown or the function of time.
    pub rows: Vec<Vec<(By, NodeId)>>,
    unknowns: usize,
    waves: usize,
    parameters: usize,
}

/// What a partial derivative is by.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum By {
    /// The unknown of an index.
    Unknown(u32),
    /// The function of time of an index.
    Wave(u32),
}

/// What an input of the operations stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stands {
    /// For something of the equations.
    For(Input),
    /// For a condition that is held: here never.
    Held,
}

/// The slopes of equations with named parameters (see [`super::named_equations`]) and of some formulas over them. Each pin
/// is an algebraic row that becomes y = 0 for an unknown which nothing determines.
pub fn slopes(equations: &Equations, pins: &[(usize, usize)], formulas: &[Formula]) -> Slopes {
    let (unknowns, waves) = (equations.unknowns.len(), equations.waves.len());
    let mut dag = Dag::default();
    let mut lowering = Lowering::new(&mut dag, equations);
    let mut nodes: Vec<NodeId> = equations.rates.iter().map(|rate| lowering.add(rate)).collect();
    for (row, formula) in equations.algebraic.iter().enumerate() {
        let pin = pins.iter().find(|pin| pin.0 == row);
        nodes.push(match pin {
            Some(pin) => lowering.add(&Formula::leaf(Input::Unknown(pin.1 as u32))),
            None => lowering.add(formula),
        });
    }
    nodes.extend(formulas.iter().map(|formula| lowering.add(formula)));
    let by = |input: u32| {
        let k = input as usize;
        match k.checked_sub(unknowns + 1) {
            _ if k < unknowns => Some(By::Unknown(input)),
            Some(wave) if wave < waves => Some(By::Wave(wave as u32)),
            _ => None,
        }
    };
    let rows = nodes.into_iter().map(|node| {
        let inputs = dag.inputs_of(node);
        let partials = inputs.into_iter().filter_map(|k| Some((by(k)?, dag.derivative(node, k))));
        let partials: Vec<(By, NodeId)> = partials.collect();
        partials.into_iter().filter(|(_, partial)| dag.as_constant(*partial) != Some(0.0)).collect()
    });
    let rows = rows.collect();
    let parameters = unknowns + 1 + waves + 2 * equations.conditions.len();
    Slopes { dag, rows, unknowns, waves, parameters }
}

impl Slopes {
    /// All inputs at time `t` of the piece that holds `inside`.
    pub fn inputs(
        &self,
        graph: &BondGraph,
        equations: &Equations,
        [t, inside]: [f64; 2],
        y: &[f64],
    ) -> Vec<f64> {
        let mut all = inputs(equations);
        let from = self.unknowns;
        all[..from].copy_from_slice(y);
        all[from] = t;
        for (input, wave) in all[from + 1..].iter_mut().zip(&equations.waves) {
            *input = wave.value(t, inside);
        }
        all.extend(graph.parameters.iter().map(|parameter| parameter.value));
        all
    }

    /// What an input stands for.
    pub fn stands(&self, input: u32) -> Stands {
        let k = input as usize;
        let from = self.unknowns;
        if k < from {
            return Stands::For(Input::Unknown(input));
        }
        if k == from {
            return Stands::For(Input::Time);
        }
        if k <= from + self.waves {
            return Stands::For(Input::Wave((k - from - 1) as u32));
        }
        match k.checked_sub(self.parameters) {
            Some(parameter) => Stands::For(Input::Parameter(parameter as u32)),
            None => Stands::Held,
        }
    }
}
