//! `.pz`: poles and zeros of the circuit linearised at its operating point.
//!
//! ```text
//! poles driven by a voltage    det [ G + sC   e ] = 0      poles driven by a current    det (G + sC) = 0
//!                                  [  eᵀ      0 ]
//! zeros                        det [ G + sC   e ] = 0      e, f: +1 and −1 at the nodes of the input, of the output
//!                                  [  fᵀ      0 ]
//! ```
//!
//! A voltage source that stands between the nodes of the input is the drive: it is taken out where the drive is a
//! current, and for zeros. All other sources rest. Roots that poles and zeros share are told in both.

use super::ac::Probed;
use super::analyses::{Column, Job, interrupted, unwritten};
use super::explain::{Failure, FailureKind};
use super::linearise::Linear;
use super::statistics::Statistics;
use crate::circuit::{Analysis, Circuit, DeviceKind, Drive, NodeId};
use crate::diagnostic::Diagnostic;
use crate::linear::Complex;
use crate::linear::roots::{Root, Trouble, finite_roots};
use crate::source::Span;
use crate::trace::Sink;
use crate::trace::runs::NUMBER;
use std::sync::atomic::Ordering;

/// More storages than this have more poles than are worth the time.
const MOST: usize = 5000;

/// The number of a root, then a pole and a zero.
pub(super) fn columns(analysis: &Analysis) -> Vec<Column> {
    let Analysis::PoleZero { roots, .. } = analysis else { return vec![] };
    let mut columns = vec![(NUMBER.to_string(), "")];
    for (name, wanted) in [("pole", roots.poles()), ("zero", roots.zeros())] {
        if wanted {
            columns.extend([".re", ".im"].map(|part| (format!("{name}{part}"), "rad/s")));
        }
    }
    columns
}

/// Runs it: a row for each pole and each zero, in 1/s; where there are more of one, the other is no number.
pub(super) fn poles(job: &Job, sink: &mut dyn Sink) -> Result<Statistics, Failure> {
    let Analysis::PoleZero { input, output, drive, roots } = job.analysis else {
        return Ok(Statistics::default());
    };
    let linear = Probed::of(job.circuit, &[])?.linear;
    let mut statistics = linear.statistics.clone();
    check(&linear, &statistics)?;
    let own = source(job.circuit, &linear, *input);
    let mut lists: Vec<Vec<Complex>> = vec![];
    if roots.poles() {
        let mut pencil = Pencil::of(&linear);
        match (drive, own) {
            (Drive::Voltage, Some(_)) => {}
            (Drive::Voltage, None) => pencil.border(*input, *input),
            (Drive::Current, own) => own.into_iter().for_each(|k| pencil.take_out(k)),
        }
        lists.push(pencil.roots(job, "poles", &statistics)?);
    }
    if roots.zeros() {
        let mut pencil = Pencil::of(&linear);
        own.into_iter().for_each(|k| pencil.take_out(k));
        pencil.border(*input, *output);
        lists.push(pencil.roots(job, "zeros", &statistics)?);
    }
    let mut row = vec![];
    for k in 0..lists.iter().map(Vec::len).max().unwrap_or(0) {
        row.clear();
        row.push((k + 1) as f64);
        for list in &lists {
            let root = list.get(k).copied().unwrap_or(Complex::new(f64::NAN, f64::NAN));
            row.extend([root.re, root.im]);
        }
        statistics.rows += 1;
        sink.row(&row).map_err(|error| unwritten(&error, &statistics))?;
    }
    statistics.method = "linear".into();
    statistics.reason = "roots of the linearised circuit".into();
    statistics.equations = linear.len();
    statistics.entries = linear.conductances.len() + linear.storages.len();
    Ok(statistics)
}

/// Refuses what has roots without end, or too many.
fn check(linear: &Linear, statistics: &Statistics) -> Result<(), Failure> {
    let fail = |message: String, help: &str| {
        let error = Diagnostic::error("E0812", Span::NONE, message).help(help);
        Err(Failure::new(FailureKind::NotSolved, error, statistics))
    };
    if linear.delays.iter().any(|delay| !delay.entries.is_empty()) {
        let message = "a circuit with delays or lines has poles without end".to_string();
        return fail(message, "put sections of L and C in the place of a line, or use `.ac`");
    }
    let mut columns: Vec<u32> = linear.storages.iter().map(|(_, column, _)| *column).collect();
    columns.sort_unstable();
    columns.dedup();
    if columns.len() > MOST {
        let message = format!("{} storages are too many for `.pz`", columns.len());
        return fail(message, "5000 is the most; use `.ac`");
    }
    Ok(())
}

/// The branch of a voltage source between the nodes of the input.
fn source(circuit: &Circuit, linear: &Linear, input: [NodeId; 2]) -> Option<usize> {
    let [a, b] = input;
    let found = circuit.ids().find(|(_, device)| {
        let between = device.nodes.get(..2).is_some_and(|n| n == [a, b] || n == [b, a]);
        between && matches!(device.kind, DeviceKind::VoltageSource { .. })
    });
    let (id, _) = found?;
    linear.unknowns.iter().position(|own| !own.voltage && own.device == Some(id))
}

/// G and C, with rows and columns taken out and put on.
struct Pencil {
    n: u32,
    fixed: Vec<(u32, u32, f64)>,
    storage: Vec<(u32, u32, f64)>,
}

impl Pencil {
    fn of(linear: &Linear) -> Pencil {
        let (fixed, storage) = (linear.conductances.clone(), linear.storages.clone());
        Pencil { n: linear.len() as u32, fixed, storage }
    }

    /// Takes an unknown and its equation out, as if it were 0.
    fn take_out(&mut self, k: usize) {
        let k = k as u32;
        for list in [&mut self.fixed, &mut self.storage] {
            list.retain(|(row, column, _)| *row != k && *column != k);
            for (row, column, _) in list {
                *row -= u32::from(*row > k);
                *column -= u32::from(*column > k);
            }
        }
        self.n -= 1;
    }

    /// Adds a current that flows into a pair of nodes, and as its equation that the voltage of another pair is 0.
    fn border(&mut self, into: [NodeId; 2], zero: [NodeId; 2]) {
        let n = self.n;
        let ends = |pair: [NodeId; 2]| {
            let signed = pair.into_iter().zip([1.0, -1.0]);
            signed.filter_map(|(node, sign)| Some((node.0.checked_sub(1)?, sign)))
        };
        self.fixed.extend(ends(into).map(|(node, sign)| (node, n, sign)));
        self.fixed.extend(ends(zero).map(|(node, sign)| (n, node, sign)));
        self.n += 1;
    }

    /// The roots, each as often as it counts.
    fn roots(
        &self,
        job: &Job,
        what: &str,
        statistics: &Statistics,
    ) -> Result<Vec<Complex>, Failure> {
        let stop = || job.settings.interrupt.as_ref().is_some_and(|s| s.load(Ordering::Relaxed));
        let found = finite_roots(self.n as usize, &self.fixed, &self.storage, &|| !stop());
        let trouble = match found {
            Ok(roots) => {
                let all = |root: Root| std::iter::repeat_n(root.at, root.multiplicity);
                return Ok(roots.into_iter().flat_map(all).collect());
            }
            Err(trouble) => trouble,
        };
        let (message, help) = match trouble {
            Trouble::Stopped => {
                if let Some(failure) = interrupted(job, statistics) {
                    return Err(failure);
                }
                (format!("the search for {what} was ended"), "run it again")
            }
            Trouble::Singular if what == "zeros" => (
                "nothing of the input reaches the output, so that every s is a zero".to_string(),
                "see whether a path leads from the input's nodes to the output's",
            ),
            Trouble::Singular => (
                "the linearised circuit has no single solution at any s, and so no poles"
                    .to_string(),
                "see whether the drive leaves a node floating, or stands beside another voltage source",
            ),
            Trouble::Restless(count) => (
                format!("{count} of the {what} did not come to rest"),
                "values of very different sizes may be at fault; `.ac` shows what they do",
            ),
        };
        let error = Diagnostic::error("E0812", Span::NONE, message).help(help);
        Err(Failure::new(FailureKind::NotSolved, error, statistics))
    }
}
