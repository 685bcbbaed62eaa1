//! `.tf`: gain from an independent source to an output, and the resistances at both, at the operating point.
//!
//! ```text
//! gain = dy/du      R_in = du/di of a voltage source, dv/di of a current source
//! R_out: volts at the output for an ampere fed into it, all sources at rest
//! ```

use super::ac::Probed;
use super::analyses::{Job, no_circuit, unwritten};
use super::explain::Failure;
use super::linearise::{Linear, Pencil, singular};
use super::statistics::Statistics;
use crate::circuit::{Analysis, DeviceId, DeviceKind, Leaf, NodeId};
use crate::diagnostic::Diagnostic;
use crate::expr::Node;
use crate::linear::{Complex, Field};
use crate::source::Span;
use crate::trace::Sink;

/// Runs it: one row.
pub(super) fn transfer(job: &Job, sink: &mut dyn Sink) -> Result<Statistics, Failure> {
    let Analysis::Transfer { output, source } = job.analysis else {
        return Ok(Statistics::default());
    };
    let probed = Probed::of(job.circuit, std::slice::from_ref(output))?;
    let linear = &probed.linear;
    let mut statistics = linear.statistics.clone();
    let mut pencil = Pencil::new(linear, false);
    pencil
        .factorise(Complex::ZERO, &mut statistics)
        .map_err(|found| singular(&probed.system, &found, "at rest", &statistics))?;
    let mut answer = |b: Vec<f64>| {
        let mut x: Vec<Complex> = b.into_iter().map(Complex::from).collect();
        pencil.solve(&mut x, &mut statistics);
        x
    };
    let driven = answer(linear.unit(*source).unwrap_or_else(|| vec![0.0; linear.len()]));
    let mut row = vec![];
    probed.row(Complex::ZERO, &driven, &mut row);
    let gain = row.first().copied().unwrap_or(f64::NAN);
    let is_voltage = |id: DeviceId| {
        let device = job.circuit.devices.get(id.0 as usize);
        device.is_some_and(|device| matches!(device.kind, DeviceKind::VoltageSource { .. }))
    };
    let input = match is_voltage(*source) {
        true => -1.0 / branch(linear, *source, &driven),
        false => {
            let nodes = job.circuit.devices.get(source.0 as usize).map(|d| &d.nodes[..]);
            match nodes {
                Some([a, b, ..]) => between([*b, *a], &driven),
                _ => f64::NAN,
            }
        }
    };
    let out = match &*output.expr.node {
        Node::Leaf(Leaf::Voltage(a, b)) => {
            let mut fed = vec![0.0; linear.len()];
            for (node, sign) in [(a, 1.0), (b, -1.0)] {
                if let Some(unknown) = node.0.checked_sub(1) {
                    fed[unknown as usize] += sign;
                }
            }
            between([*a, *b], &answer(fed))
        }
        Node::Leaf(Leaf::Current(id)) if is_voltage(*id) => {
            let own = answer(linear.unit(*id).unwrap_or_else(|| vec![0.0; linear.len()]));
            -1.0 / branch(linear, *id, &own)
        }
        _ => {
            let message = format!("`{}` is no output of `.tf`", output.name);
            let error = Diagnostic::error("E0786", Span::NONE, message)
                .help("v(node), v(a,b), or i(v1) of a voltage source");
            return Err(no_circuit(vec![error], &statistics));
        }
    };
    statistics.rows = 1;
    statistics.method = "linear".into();
    statistics.reason = "at the operating point".into();
    sink.row(&[gain, input, out]).map_err(|error| unwritten(&error, &statistics))?;
    Ok(statistics)
}

/// The current of a device that has it as an unknown.
fn branch(linear: &Linear, id: DeviceId, x: &[Complex]) -> f64 {
    let own =
        |unknown: &crate::circuit::stamps::Unknown| !unknown.voltage && unknown.device == Some(id);
    linear.unknowns.iter().position(own).map_or(f64::NAN, |k| x[k].re)
}

fn between([a, b]: [NodeId; 2], x: &[Complex]) -> f64 {
    let at = |node: NodeId| node.0.checked_sub(1).map_or(0.0, |k| x[k as usize].re);
    at(a) - at(b)
}
