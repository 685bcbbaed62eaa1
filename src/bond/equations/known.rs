//! Functions of time that are known beforehand: waveforms, and what jumps over time alone.

use super::Formula;
use super::memory::Memory;
use super::waveform::Wave;
use crate::bond::graph::{BondGraph, Expr, Leaf, Waveform};
use crate::expr::{Function, Node};

/// A function of time with corners.
#[derive(Clone, Debug)]
pub enum Known {
    /// A waveform.
    Wave(Wave),
    /// What a memory holds.
    Memory(Memory),
    /// Something over time alone that jumps (a comparison, a floor): held at its value inside the segment.
    Held(Formula),
}

impl Known {
    /// The value at `t` of the piece that holds at `inside`.
    pub fn value(&self, t: f64, inside: f64) -> f64 {
        match self {
            Known::Wave(wave) => wave.value(t, inside),
            Known::Memory(memory) => memory.value(t, inside),
            Known::Held(formula) => at_time(formula, inside),
        }
    }
}

fn at_time(formula: &Formula, t: f64) -> f64 {
    formula.evaluate(&mut |_| t)
}

/// Whether the expression holds time and otherwise only parameters.
pub(super) fn over_time_alone(expr: &Expr) -> bool {
    let (mut time, mut other) = (false, false);
    expr.leaves(&mut |leaf, _| match leaf {
        Leaf::Time => time = true,
        Leaf::Parameter(_) => {}
        _ => other = true,
    });
    time && !other
}

/// Times at which a held value changes: between the changes of what stands inside it, found on a grid, then by
/// bisection to the last bit.
pub(super) fn held_corners(formula: &Formula, until: f64, corners: &mut Vec<f64>) {
    let mut within = vec![];
    inner_changes(formula, until, &mut within);
    corners.extend(&within);
    changes(formula, &super::waveform::merge_corners(within, until), corners);
}

/// The changes of a formula's parts.
fn inner_changes(formula: &Formula, until: f64, corners: &mut Vec<f64>) {
    let mut part = |part: &Formula| {
        let jumps = match &*part.node {
            Node::Binary(op, ..) => op.is_comparison(),
            Node::Call(f, _) => matches!(f, Function::Floor | Function::Sign | Function::Mod),
            _ => false,
        };
        match (&*part.node, jumps) {
            (Node::Call(Function::Mod, arguments), true) if arguments.len() == 2 => {
                let quotient = arguments[0].clone() / arguments[1].clone();
                let turns = Formula::call(Function::Floor, vec![quotient]);
                held_corners(&turns, until, corners);
            }
            (_, true) => held_corners(part, until, corners),
            (_, false) => inner_changes(part, until, corners),
        }
    };
    match &*formula.node {
        Node::Number(_) | Node::Leaf(_) => {}
        Node::Unary(_, a) | Node::Table(a, _) => part(a),
        Node::Binary(_, a, b) => [a, b].into_iter().for_each(part),
        Node::Call(_, arguments) => arguments.iter().for_each(part),
        Node::If(c, a, b) => [c, a, b].into_iter().for_each(part),
    }
}

/// The changes of a formula whose parts change at none but the times of `pieces`.
fn changes(formula: &Formula, pieces: &[f64], corners: &mut Vec<f64>) {
    const GRID: usize = 1 << 14;
    const MOST: usize = 1 << 24;
    let until = pieces.last().copied().unwrap_or(0.0);
    // A count is looked at often enough to see each of its values.
    let count = match &*formula.node {
        Node::Call(Function::Floor, arguments) => {
            let place = |i: usize| at_time(&arguments[0], until * i as f64 / 64.0);
            (0..64).map(|i| (place(i + 1) - place(i)).abs()).sum::<f64>()
        }
        _ => 0.0,
    };
    let grid = GRID.max((4.0 * count).min(MOST as f64) as usize);
    let each = (grid / pieces.len().max(1)).max(4);
    for pair in pieces.windows(2) {
        let (start, end) = (pair[0], pair[1]);
        let inside = |part: f64| start + (end - start) * part;
        let mut left = (start, at_time(formula, inside(1e-9)));
        for i in 1..=each {
            // Away from round fractions of the run, where the corners themselves are wont to be.
            let part = if i == each { 1.0 - 1e-9 } else { (i as f64 + 0.382) / each as f64 };
            let t = inside(part.min(1.0 - 1e-9));
            let value = at_time(formula, t);
            while value != left.1 && left.0 < t && !value.is_nan() && !left.1.is_nan() {
                let (mut a, mut b) = (left.0, t);
                for _ in 0..200 {
                    let middle = 0.5 * (a + b);
                    if middle <= a || middle >= b {
                        break;
                    }
                    if at_time(formula, middle) == left.1 { a = middle } else { b = middle }
                }
                corners.push(b);
                left = (b, at_time(formula, b));
            }
            left = (left.0.max(t), value);
        }
    }
}

/// A waveform with the parameters' values.
pub(super) fn resolve(graph: &BondGraph, waveform: &Waveform) -> Wave {
    let number = |expr: &Expr| {
        expr.evaluate(&mut |leaf| match leaf {
            Leaf::Parameter(id) => graph.parameters[id.index()].value,
            _ => f64::NAN,
        })
    };
    match waveform {
        Waveform::Step { at, before, after } => {
            Wave::Step { at: number(at), before: number(before), after: number(after) }
        }
        Waveform::Ramp { at, slope } => Wave::Ramp { at: number(at), slope: number(slope) },
        Waveform::Pulse { low, high, delay, rise, fall, width, period } => Wave::Pulse {
            low: number(low),
            high: number(high),
            delay: number(delay),
            rise: number(rise),
            fall: number(fall),
            width: number(width),
            period: number(period),
        },
        Waveform::Sine { offset, amplitude, frequency, delay, damping, phase } => Wave::Sine {
            offset: number(offset),
            amplitude: number(amplitude),
            frequency: number(frequency),
            delay: number(delay),
            damping: number(damping),
            phase: number(phase),
        },
        Waveform::Noise { seed, rms, dt } => {
            Wave::Noise { seed: number(seed) as u64, rms: number(rms), dt: number(dt) }
        }
        Waveform::Pwl(points) => {
            Wave::Pwl(points.iter().map(|(t, y)| (number(t), number(y))).collect())
        }
    }
}
