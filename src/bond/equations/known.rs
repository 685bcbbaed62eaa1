//! Functions of time that are known beforehand: waveforms, and what jumps over time alone.

use super::Formula;
use super::waveform::Wave;
use crate::bond::graph::{BondGraph, Expr, Leaf, Waveform};

/// A function of time with corners.
#[derive(Clone, Debug)]
pub enum Known {
    /// A waveform.
    Wave(Wave),
    /// Something over time alone that jumps (a comparison, a floor): held at its value inside the segment.
    Held(Formula),
}

impl Known {
    /// The value at `t` of the piece that holds at `inside`.
    pub fn value(&self, t: f64, inside: f64) -> f64 {
        match self {
            Known::Wave(wave) => wave.value(t, inside),
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

/// Times at which a held value changes: found on a grid, then by bisection to the last bit.
pub(super) fn held_corners(formula: &Formula, until: f64, corners: &mut Vec<f64>) {
    const GRID: usize = 1 << 14;
    let mut left = (0.0, at_time(formula, 0.0));
    for i in 1..=GRID {
        // Away from round fractions of the run, where the corners themselves are wont to be.
        let t = if i == GRID { until } else { until * (i as f64 + 0.382) / GRID as f64 };
        let value = at_time(formula, t);
        if value != left.1 {
            let (mut a, mut b) = (left.0, t);
            for _ in 0..200 {
                let middle = 0.5 * (a + b);
                if middle <= a || middle >= b {
                    break;
                }
                if at_time(formula, middle) == left.1 { a = middle } else { b = middle }
            }
            corners.push(b);
        }
        left = (t, value);
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
        Waveform::Pwl(points) => {
            Wave::Pwl(points.iter().map(|(t, y)| (number(t), number(y))).collect())
        }
    }
}
