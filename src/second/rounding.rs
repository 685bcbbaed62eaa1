//! What rounding leaves of an observed value that is 0: a hundred-millionth of what the terms that make it are.
//!
//! An effort or a flow is measured by the largest of its kind, those of its domain, and by what the domain's storages hold
//! divided by the length of the run: where a storage has to follow a source, its flow is a difference of that. What is
//! stored is measured by what it integrates over the run, a sum by its terms, a product by each factor times the other, a
//! signal by its law.

use super::{Kind, ROUNDING, Sizes};
use crate::bond::equations::{Equations, Formula, Input, Origin, Unknown};
use crate::bond::graph::{BondGraph, Power, SignalLaw};
use crate::expr::{Binary, Function, Node, Unary};

/// Signals whose laws speak of each other are followed so far.
const PASSES: usize = 8;

/// Magnitudes of everything that a formula speaks of, and what is not to be told from 0.
pub struct Rounding {
    /// By unknown: the largest magnitude, and what rounding leaves.
    unknowns: Vec<(f64, f64)>,
    /// The same by function of time.
    waves: Vec<(f64, f64)>,
    until: f64,
}

impl Rounding {
    /// After a run until `until` whose unknowns had these sizes.
    pub fn new(graph: &BondGraph, equations: &Equations, sizes: &Sizes, until: f64) -> Rounding {
        let mut kinds = sizes.largest_of_kinds();
        let kind = |domain: usize, power: Power| 2 * domain + usize::from(power == Power::Flow);
        let stored = |unknown: &Unknown| match unknown {
            Unknown::Stored(end) => {
                let (storage, bond) = (graph.storage(*end)?, graph.bond_at(*end)?);
                Some(kind(graph.bond(bond).domain as usize, storage.integrates()))
            }
            _ => None,
        };
        if until > 0.0 {
            for (unknown, size) in equations.unknowns.iter().zip(&sizes.largest) {
                if let Some(kind) = stored(unknown) {
                    kinds[kind] = kinds[kind].max(size / until);
                }
            }
        }
        let unknowns = equations.unknowns.iter().zip(&sizes.kind).zip(&sizes.largest);
        let unknowns = unknowns.map(|((unknown, own), size)| {
            let noise = match (own, stored(unknown)) {
                (Kind::Power(kind), _) => kinds[*kind],
                (Kind::Other, Some(kind)) => kinds[kind] * until,
                (Kind::Other, None) => 0.0,
            };
            (*size, ROUNDING * noise)
        });
        let corners = equations.corners(until);
        let wave = |known: &crate::bond::equations::Known| {
            let values = corners.windows(2).flat_map(|pair| {
                let inside = 0.5 * (pair[0] + pair[1]);
                [pair[0], inside, pair[1]].map(|t| known.value(t, inside).abs())
            });
            values.filter(|value| value.is_finite()).fold(0.0, f64::max)
        };
        let waves = equations.waves.iter().map(|known| (wave(known), 0.0)).collect();
        let mut all = Rounding { unknowns: unknowns.collect(), waves, until };
        for _ in 0..PASSES {
            all.signals(graph, equations);
        }
        all
    }

    /// What rounding leaves of signals, by their laws.
    fn signals(&mut self, graph: &BondGraph, equations: &Equations) {
        for (k, unknown) in equations.unknowns.iter().enumerate() {
            let Unknown::Signal(id) = unknown else { continue };
            // A row says own − law = 0.
            self.unknowns[k].1 = 0.0;
            let noise = match &graph.signals[id.index()].law {
                SignalLaw::Integrator { .. } => {
                    equations.rates.get(k).map_or(0.0, |rate| self.least(rate) * self.until)
                }
                _ => {
                    let row = equations.origins.iter().position(|o| *o == Origin::Signal(*id));
                    row.map_or(0.0, |row| self.least(&equations.algebraic[row]))
                }
            };
            self.unknowns[k].1 = noise;
        }
        for memory in &equations.memories {
            let noise = self.least(&memory.input);
            if let Some(wave) = self.waves.get_mut(memory.wave) {
                wave.1 = noise;
            }
        }
    }

    /// The magnitude below which the value of a formula is what rounding leaves of 0.
    pub fn least(&self, formula: &Formula) -> f64 {
        let noise = self.of(formula).1;
        if noise.is_finite() { noise } else { 0.0 }
    }

    /// Magnitude and noise.
    fn of(&self, formula: &Formula) -> (f64, f64) {
        let sum = |(a, da): (f64, f64), (b, db): (f64, f64)| (a + b, da + db);
        match &*formula.node {
            Node::Number(value) => (value.abs(), 0.0),
            Node::Leaf(Input::Unknown(k)) => self.unknowns[*k as usize],
            Node::Leaf(Input::Wave(k)) => self.waves[*k as usize],
            Node::Leaf(Input::Time) => (self.until, 0.0),
            // The second route's equations hold numbers.
            Node::Leaf(Input::Condition(_) | Input::Parameter(_)) => (1.0, 0.0),
            Node::Unary(Unary::Negate, a) => self.of(a),
            Node::Unary(Unary::Not, _) => (1.0, 0.0),
            Node::Binary(op, a, b) => {
                let ((a, da), (b, db)) = (self.of(a), self.of(b));
                match op {
                    Binary::Add | Binary::Subtract => (a + b, da + db),
                    Binary::Multiply => (a * b, a * db + b * da),
                    Binary::Divide => (a / b, da / b),
                    Binary::Power => (a.powf(b), da * b * a.powf(b - 1.0)),
                    _ => (1.0, 0.0),
                }
            }
            // Those that bound their value, and others with a slope of about 1.
            Node::Call(function, arguments) => {
                let all = arguments.iter().map(|a| self.of(a)).fold((0.0, 0.0), sum);
                match (function, all) {
                    (Function::Sqrt, (a, da)) => (a.sqrt(), da.sqrt()),
                    (_, all) => all,
                }
            }
            Node::If(_, a, b) => sum(self.of(a), self.of(b)),
            Node::Table(a, table) => {
                let size = table.y.iter().fold(0.0f64, |size, y| size.max(y.abs()));
                let pairs = table.x.windows(2).zip(table.y.windows(2));
                let slopes = pairs.map(|(x, y)| ((y[1] - y[0]) / (x[1] - x[0])).abs());
                (size, self.of(a).1 * slopes.fold(0.0, f64::max))
            }
        }
    }
}
