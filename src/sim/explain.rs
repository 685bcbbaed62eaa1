//! Why a run failed, in terms of equations, devices and nodes.

use super::newton::Cut;
use super::op::Trouble;
use super::remarks::{how_far, last_cuts, left_over, place, suggestion};
use super::statistics::Statistics;
use super::step::Reason;
use super::system::System;
use crate::circuit::DeviceId;
use crate::diagnostic::Diagnostic;
use crate::linear::Singular;
use crate::source::Span;
use std::fmt;

/// What kind of failure it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FailureKind {
    /// The equations could not be solved: exit code 4.
    NotSolved,
    /// The run was interrupted: exit code 130.
    Interrupted,
    /// Rows could not be written: exit code 5.
    Output,
    /// Values of a sweep for which there is no circuit: exit code 3.
    Input,
}

/// A run that did not reach its end.
#[derive(Clone, Debug)]
pub struct Failure {
    /// What kind it is.
    pub kind: FailureKind,
    /// What happened, with places.
    pub diagnostic: Box<Diagnostic>,
    /// When, s.
    pub time: f64,
    /// What was done until then.
    pub statistics: Box<Statistics>,
}

impl Failure {
    /// A failure at no time of a run.
    pub fn new(kind: FailureKind, diagnostic: Diagnostic, statistics: &Statistics) -> Failure {
        let statistics = Box::new(statistics.clone());
        Failure { kind, diagnostic: Box::new(diagnostic), time: 0.0, statistics }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.diagnostic.message)
    }
}

impl std::error::Error for Failure {}

/// Where in a run a solution was not found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Moment {
    OperatingPoint,
    Start,
    Restart,
    Step,
    Row,
}

impl Moment {
    fn text(self) -> &'static str {
        match self {
            Moment::OperatingPoint => "no operating point was found",
            Moment::Start => "no consistent values were found at the start",
            Moment::Restart => "no consistent values were found after a corner or event",
            Moment::Step => "the step became too small",
            Moment::Row => "there are no values for a row",
        }
    }
}

/// A time as people write it: six figures, no more.
fn six_figures(time: f64) -> f64 {
    format!("{time:.5e}").parse().unwrap_or(time)
}

/// The diagnostic for what could not be solved. `span` is the length of the run, for saying how small a step is.
pub(crate) fn failure(
    system: &System,
    moment: Moment,
    time: f64,
    trouble: &Trouble,
    statistics: &Statistics,
) -> Failure {
    let code = match (trouble, moment) {
        (Trouble::Modes(_), _) => "E0804",
        (Trouble::Cut(Cut::NonFinite { .. }), _) => "E0803",
        (Trouble::Cut(Cut::Singular(_)), _) => "E0805",
        (Trouble::Stuck(stuck), _) => match stuck.cut {
            Cut::NonFinite { .. } => "E0803",
            Cut::Singular(_) => "E0805",
            _ => "E0802",
        },
        (_, Moment::Step) => "E0802",
        _ => "E0801",
    };
    let when = format!("at t = {} s", six_figures(time));
    let message = format!("{} {when}", moment.text());
    let stuck = match trouble {
        Trouble::Stuck(stuck) => Some(stuck),
        _ => None,
    };
    let because_of = match trouble {
        Trouble::Stuck(stuck) => Trouble::Cut(stuck.cut.clone()),
        other => other.clone(),
    };
    let mut diagnostic = match &because_of {
        Trouble::Stuck(_) => Diagnostic::error(code, Span::NONE, message),
        Trouble::Modes(device) => {
            let name = system.spoken_device(*device);
            let fights = format!("`{name}` switches to and fro without end {when}");
            let (because, help) = if system.spoken.is_empty() {
                (
                    "no combination of the switches' states agrees with the voltages that it leads to",
                    "give the switch more hysteresis (`vh`, `ih` of its model) than its own switching moves its control by, or none, so that it may stand between on and off; or a capacitance at the node that controls it",
                )
            } else {
                (
                    "neither value of its condition agrees with what it leads to",
                    "give its condition more hysteresis than its own change moves it by, or none, so that the solution may slide along it; or a storage to what it follows",
                )
            };
            Diagnostic::error(code, system.device_span(*device), fights)
                .says("its own state changes what it switches by")
                .because(because)
                .help(help)
        }
        Trouble::Cut(Cut::NonFinite { device }) => match device {
            Some(device) => {
                let name = system.spoken_device(*device);
                let infinite = format!("the law of `{name}` is no finite number {when}");
                Diagnostic::error(code, system.device_span(*device), infinite)
                    .says("it, or its slope, is infinite or no number")
                    .because(moment.text())
                    .help("look for a division by 0, or a root or logarithm of a negative value")
            }
            None => Diagnostic::error(code, Span::NONE, message)
                .because("a value grew beyond all bounds"),
        },
        Trouble::Cut(Cut::Singular(singular)) => {
            let mut all = undetermined(system, singular);
            if all.is_empty() {
                Diagnostic::error(code, Span::NONE, message).because("the matrix is singular")
            } else {
                let mut first = all.swap_remove(0);
                first.code = code;
                first.notes.insert(0, std::mem::replace(&mut first.message, message));
                first
            }
        }
        Trouble::Cut(Cut::NotFound(sought)) => {
            let worst = sought.rows.first().map_or(0, |(row, ..)| *row);
            let (what, span) = equation(system, worst);
            let mut diagnostic = Diagnostic::error(code, span, message)
                .says(format!("{what} is satisfied worst"))
                .help(suggestion(system, sought));
            diagnostic.notes.extend(left_over(system, &sought.rows, &sought.x));
            diagnostic.notes.push(how_far(sought));
            diagnostic
        }
        Trouble::Cut(Cut::NoConvergence { worst }) => {
            let (says, span) = match stuck.and_then(|stuck| stuck.cuts.iter().last()) {
                Some((_, Reason::Error(unknown, _))) => {
                    let name = system.spoken_unknown(*unknown);
                    (format!("the error of {name} stays too large"), place(system, *unknown))
                }
                _ => {
                    let (what, span) = equation(system, *worst);
                    (format!("{what} is satisfied worst"), span)
                }
            };
            Diagnostic::error(code, span, message).says(says).help(match moment {
                    _ if stuck.is_some_and(|stuck| stuck.is_by_error()) => {
                        "if it grows without bound or jumps there, the solution ends: check the law that drives it, and its sign"
                    }
                Moment::OperatingPoint => {
                    "check the values near there; or give initial values and start with `uic`"
                }
                _ => "check the values near there; a smaller `hmax` or another `method` may help",
            })
        }
    };
    if let Some(stuck) = stuck {
        diagnostic.notes.extend(last_cuts(system, stuck));
    }
    let r = &statistics.rejected;
    let causes: Vec<String> = [
        (r.error, "by local error"),
        (r.newton, "without convergence"),
        (r.singular, "with a singular matrix"),
        (r.non_finite, "with a value that is no number"),
    ]
    .iter()
    .filter(|(count, _)| *count > 0)
    .map(|(count, cause)| format!("{count} {cause}"))
    .collect();
    if !causes.is_empty() {
        diagnostic.notes.push(format!(
            "{} steps were accepted; steps cut: {}",
            statistics.accepted,
            causes.join(", ")
        ));
    }
    Failure {
        kind: FailureKind::NotSolved,
        diagnostic: Box::new(diagnostic),
        time,
        statistics: Box::new(statistics.clone()),
    }
}

/// What an equation says, and where it stands.
pub(crate) fn equation(system: &System, row: usize) -> (String, Span) {
    let of_bonds = !system.spoken.is_empty();
    match system.unknowns.get(row) {
        Some(unknown) if row < system.nodes => {
            let name = system.spoken_unknown(row);
            let sum = match of_bonds {
                true => format!("the sum of flows where {name} is common"),
                false => format!("the sum of currents at the node of {name}"),
            };
            (sum, unknown.span)
        }
        Some(unknown) => match unknown.device {
            Some(device) => (
                format!("the law of `{}`", system.spoken_device(device)),
                system.device_span(device),
            ),
            None => (format!("the equation of {}", unknown.name), unknown.span),
        },
        None => match system.charge_devices.get(row - system.equations()) {
            Some(device) => {
                let charge = if of_bonds { "what is stored in" } else { "the charge of" };
                let name = system.spoken_device(*device);
                (format!("{charge} `{name}`"), system.device_span(*device))
            }
            None => ("an equation".into(), Span::NONE),
        },
    }
}

/// One diagnostic for each set of unknowns that nothing determines.
pub(crate) fn undetermined(system: &System, singular: &Singular) -> Vec<Diagnostic> {
    let n = system.equations();
    let mut result: Vec<Diagnostic> = vec![];
    for set in singular.columns.iter().take(8) {
        let unknowns: Vec<usize> = set.iter().map(|k| *k as usize).filter(|k| *k < n).collect();
        let nodes: Vec<usize> = unknowns.iter().copied().filter(|k| *k < system.nodes).collect();
        let branches: Vec<DeviceId> = unknowns
            .iter()
            .filter(|k| **k >= system.nodes)
            .filter_map(|k| system.unknowns[*k].device)
            .collect();
        // Currents alone can circulate without changing a voltage only in a loop of voltage sources; where a voltage
        // is undetermined too, the currents hang on it.
        result.push(if nodes.is_empty() && !branches.is_empty() {
            loop_of_sources(system, &branches)
        } else {
            floating_nodes(system, &nodes)
        });
    }
    if result.is_empty() {
        let rows = singular.rows.iter().flatten().map(|row| *row as usize);
        if let Some(row) = rows.into_iter().find(|row| *row < n) {
            let (what, span) = equation(system, row);
            result.push(
                Diagnostic::error("E0780", span, "the circuit has no single solution")
                    .says(format!("{what} contradicts the others, or repeats them")),
            );
        }
    }
    result
}

fn loop_of_sources(system: &System, branches: &[DeviceId]) -> Diagnostic {
    let names = listed(branches.iter().map(|device| system.spoken_device(*device)));
    let of_bonds = !system.spoken.is_empty();
    let message = match (of_bonds, branches) {
        (true, _) => format!("the flow of {names} is not determined"),
        (false, [_]) => format!("`{names}` is a voltage source across nothing but itself"),
        (false, _) => format!("{names} form a loop of voltage sources"),
    };
    let mut diagnostic = Diagnostic::error("E0781", Span::NONE, message);
    for device in branches.iter().take(6) {
        let what = if of_bonds { "flow" } else { "current" };
        let name = system.spoken_device(*device);
        let text = format!("the {what} through `{name}` is not determined");
        diagnostic = diagnostic.label(system.device_span(*device), text);
    }
    let (because, help) = match of_bonds {
        true => (
            "they give one effort between them, and any flow could run round",
            "put an R at a 1-junction between them, or take one of the sources out",
        ),
        false => (
            "any current could flow round the loop",
            "put a resistance into the loop, or take one of the sources out",
        ),
    };
    diagnostic.because(because).help(help)
}

fn floating_nodes(system: &System, nodes: &[usize]) -> Diagnostic {
    let names = listed(nodes.iter().map(|node| system.spoken_unknown(*node)));
    let of_bonds = !system.spoken.is_empty();
    let message = match (nodes, of_bonds) {
        ([], true) => "the graph has no single solution".to_string(),
        ([], false) => "the circuit has no single solution".to_string(),
        ([_], true) => format!("{names} is not determined"),
        ([_], false) => format!("{names} is not determined: the node floats"),
        (_, true) => format!("{names} are not determined"),
        (_, false) => format!("{names} are not determined: the nodes float together"),
    };
    let mut diagnostic = Diagnostic::error("E0780", Span::NONE, message);
    for node in nodes.iter().take(6) {
        let unknown = &system.unknowns[*node];
        let text = format!("{} could have any value", system.spoken_unknown(*node));
        diagnostic = diagnostic.label(unknown.span, text);
    }
    let (because, help) = match of_bonds {
        true => (
            "nothing there gives an effort: flows are all that is joined, or laws that take none up",
            "join an R or a C to it, or give the law there a part that grows with the effort",
        ),
        false => (
            "only current sources, or nothing at all, join them to the rest of the circuit",
            "join them to ground by a resistor, or name one of them 0",
        ),
    };
    diagnostic.because(because).help(help)
}

pub(crate) fn listed<'a>(names: impl Iterator<Item = &'a str>) -> String {
    let all: Vec<&str> = names.collect();
    match all.len() {
        0..=6 => all.join(", "),
        more => format!("{}, … ({more} in all)", all[..5].join(", ")),
    }
}
