//! Waveforms of independent sources as numbers, with the defaults of SPICE.
//!
//! | function | left out or 0 |
//! |---|---|
//! | PULSE | rise, fall: the step of `.tran` (for Xyce where left out only); width, period: its end |
//! | SIN | frequency: 1 over the end of `.tran` |
//! | EXP | delays and time constants: the step of `.tran`, the second delay one step after the first |
//! | SFFM, AM | both frequencies: 1 over the end of `.tran` |
//!
//! A rise or fall that the header lists as a jump is one, exactly; other arguments stay as they are.
//!
//! Source: ngspice 39, src/spicelib/devices/vsrc/vsrcload.c.

use super::expand::Pending;
use super::patterns;
use super::values::Lookup;
use crate::circuit::{self, Analysis, Parts};
use crate::diagnostic::Diagnostic;
use crate::netlist::header::{Header, Jumps};
use crate::netlist::read::waveforms;
use crate::netlist::{Expr, Shape, Source, Waveform};

/// Step and end of the transient analysis.
#[derive(Clone, Copy, Debug)]
pub struct Times {
    step: f64,
    stop: f64,
    /// Whether a rise or fall of 0 is a jump.
    pub zero_is_jump: bool,
}

impl Default for Times {
    fn default() -> Times {
        Times { step: 0.0, stop: 1.0, zero_is_jump: false }
    }
}

impl Times {
    /// Those of the last transient analysis; 0 and 1 s where there is none.
    pub fn of(analyses: &[Analysis]) -> Times {
        let transient = analyses.iter().rev().find_map(|analysis| match analysis {
            Analysis::Transient { step, stop, .. } => {
                Some(Times { step: *step, stop: *stop, ..Times::default() })
            }
            _ => None,
        });
        transient.unwrap_or_default()
    }
}

/// The waveform of a source.
pub fn waveform(
    lookup: &Lookup,
    pending: &Pending,
    waveform: &Waveform,
    header: &Header,
    times: Times,
    d: &mut Vec<Diagnostic>,
) -> Option<circuit::Waveform> {
    let span = pending.card.span;
    let name = lookup.flat.device_name(pending);
    let jumps = header.jumps.iter().find(|jumps| jumps.device.eq_ignore_ascii_case(&name));
    let mut numbers = |arguments: &[Expr]| {
        let mut values = Vec::with_capacity(arguments.len());
        for argument in arguments {
            values.push(lookup.number(pending.scope, argument, d)?);
        }
        if let Some(value) = values.iter().find(|value| !value.is_finite()) {
            let message = format!("an argument of the waveform is {value}");
            d.push(Diagnostic::error("E0744", span, message));
            return None;
        }
        Some(values)
    };
    let mut perhaps = |expr: &Option<Expr>| match expr {
        Some(expr) => numbers(std::slice::from_ref(expr)).map(|values| values.first().copied()),
        None => Some(None),
    };
    let (made, function) = match waveform {
        Waveform::Constant(value) => {
            return Some(circuit::Waveform::Constant(lookup.number(pending.scope, value, d)?));
        }
        Waveform::Function { shape, arguments } => {
            let values = numbers(arguments)?;
            (Ok(made(*shape, &values, times, jumps)), waveforms::row(*shape).name)
        }
        Waveform::Points { points, repeat, delay } => {
            let (repeat, delay) = (perhaps(repeat)?, perhaps(delay)?.unwrap_or(0.0));
            (patterns::points(&numbers(points)?, repeat, delay), "pwl")
        }
        Waveform::Pattern { arguments, bits, repeat } => {
            let repeat = perhaps(repeat)?;
            (patterns::pattern(&numbers(arguments)?, bits, repeat), "pat")
        }
    };
    let sound = made.and_then(|made| senseless(&made).map_or(Ok(made), Err));
    match sound {
        Ok(made) => Some(made),
        Err(why) => {
            let function = function.to_uppercase();
            let message = format!("the {function} of `{name}` makes no sense: {why}");
            d.push(Diagnostic::error("E0744", span, message));
            None
        }
    }
}

/// A waveform from the values of its arguments.
pub fn made(
    shape: Shape,
    values: &[f64],
    times: Times,
    jumps: Option<&Jumps>,
) -> circuit::Waveform {
    // The argument, or the default where it is left out or 0.
    let or = |k: usize, default: f64| {
        values.get(k).copied().filter(|value| *value != 0.0).unwrap_or(default)
    };
    let plain = |k: usize| or(k, 0.0);
    let edge = |k: usize| match values.get(k) {
        Some(0.0) if times.zero_is_jump => 0.0,
        _ => or(k, times.step),
    };
    match shape {
        Shape::Pulse => circuit::Waveform::Pulse {
            low: plain(0),
            high: plain(1),
            delay: plain(2),
            rise: if jumps.is_some_and(|jumps| jumps.rise) { 0.0 } else { edge(3) },
            fall: if jumps.is_some_and(|jumps| jumps.fall) { 0.0 } else { edge(4) },
            width: or(5, times.stop),
            period: or(6, 0.0),
        },
        Shape::Sin => circuit::Waveform::Sine {
            offset: plain(0),
            amplitude: plain(1),
            frequency: or(2, 1.0 / times.stop),
            delay: plain(3),
            damping: plain(4),
            phase: plain(5).to_radians(),
        },
        Shape::Pwl => circuit::Waveform::Pwl(points(values, jumps)),
        Shape::Exp => {
            let rise_delay = or(2, times.step);
            circuit::Waveform::Exponential {
                from: plain(0),
                to: plain(1),
                rise_delay,
                rise_tau: or(3, times.step),
                fall_delay: or(4, rise_delay + times.step),
                fall_tau: or(5, times.step),
            }
        }
        Shape::Sffm => circuit::Waveform::Sffm {
            offset: plain(0),
            amplitude: plain(1),
            carrier: or(2, 1.0 / times.stop),
            index: plain(3),
            signal: or(4, 1.0 / times.stop),
        },
        Shape::Am => circuit::Waveform::Am {
            amplitude: plain(0),
            offset: plain(1),
            signal: or(2, 1.0 / times.stop),
            carrier: or(3, 1.0 / times.stop),
            delay: plain(4),
        },
    }
}

/// What a source is outside a run over time.
pub fn parts(
    lookup: &Lookup,
    pending: &Pending,
    source: &Source,
    d: &mut Vec<Diagnostic>,
) -> Option<Parts> {
    let mut number = |expr: &Expr| {
        let value = lookup.number(pending.scope, expr, d)?;
        if !value.is_finite() {
            let message = format!("a value of the source is {value}");
            d.push(Diagnostic::error("E0744", pending.card.span, message));
            return None;
        }
        Some(value)
    };
    let dc = match &source.dc {
        Some(expr) => Some(number(expr)?),
        None => None,
    };
    let ac = match &source.ac {
        Some([magnitude, phase]) => Some(circuit::Phasor {
            magnitude: number(magnitude)?,
            phase: number(phase)?.to_radians(),
        }),
        None => None,
    };
    Some(Parts { dc, ac })
}

/// The points of a PWL; a steep segment that starts at a jump loses its width.
fn points(values: &[f64], jumps: Option<&Jumps>) -> Vec<(f64, f64)> {
    let mut points: Vec<(f64, f64)> =
        values.chunks_exact(2).map(|pair| (pair[0], pair[1])).collect();
    if jumps.is_some_and(|jumps| jumps.steps) {
        for k in (2..points.len()).step_by(2) {
            points[k].0 = points[k - 1].0;
        }
    }
    for time in jumps.iter().flat_map(|jumps| &jumps.times) {
        let same = |t: f64| t == *time || (t - time).abs() <= 1e-12 * time.abs();
        // The last point at that time begins the segment.
        if let Some(k) = points.iter().rposition(|(t, _)| same(*t))
            && let Some(next) = points.get_mut(k + 1)
        {
            next.0 = *time;
        }
    }
    points
}

/// Why a waveform makes no sense, if it makes none.
pub fn senseless(waveform: &circuit::Waveform) -> Option<&'static str> {
    match waveform {
        circuit::Waveform::Pulse { rise, fall, width, period, .. } => [rise, fall, width, period]
            .iter()
            .any(|time| **time < 0.0)
            .then_some("a time is negative"),
        circuit::Waveform::Pwl(points) | circuit::Waveform::Repeating { points, .. } => {
            points.windows(2).any(|pair| pair[1].0 < pair[0].0).then_some("its times run backwards")
        }
        circuit::Waveform::Exponential { rise_tau, fall_tau, rise_delay, fall_delay, .. } => {
            if *rise_tau < 0.0 || *fall_tau < 0.0 {
                Some("a time constant is negative")
            } else {
                (fall_delay < rise_delay).then_some("it falls before it rises")
            }
        }
        _ => None,
    }
}
