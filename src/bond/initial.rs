//! Initial values: what every storage, integrator, bond and signal is at t = 0+.
//!
//! Stated values stand; storages without one start at 0, or at what the others imply where the equations tie them
//! together; `lag` without a value starts where its rate vanishes. Efforts and flows follow from the graph's own
//! equations. Nothing is redistributed by an impulse: stated values that contradict each other are an error.

use super::causality::Causality;
use super::consistent::{self, Slot};
use super::equations::compiled::Readings;
use super::equations::{Equations, Formula, Input, Unknown, unknown_name};
use super::graph::{
    BondGraph, BondId, End, Expr, Initial, Law, Leaf, Power, SignalId, SignalLaw, Storage,
    StoreInitial, StoreLaw,
};
use super::prepared::{Prepared, elements, explain, named, prepare, spans};
use super::roots::roots;
use super::structure::{Constraint, Structure};
use crate::diagnostic::Diagnostic;
use crate::source::Span;
use std::collections::HashMap;

/// Values at t = 0+, all in SI.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct InitialState {
    /// By vertex: what its ports store at the start; nothing for what does not store.
    pub storages: Vec<Vec<StorageValue>>,
    /// By signal: its value; for an integrator the value that it starts from.
    pub signals: Vec<f64>,
    /// By bond: its effort.
    pub efforts: Vec<f64>,
    /// By bond: its flow, along the half arrow.
    pub flows: Vec<f64>,
}

impl InitialState {
    /// What a port stores at the start.
    pub fn storage(&self, end: End) -> Option<StorageValue> {
        self.storages.get(end.vertex.index())?.get(end.port as usize).copied()
    }
}

/// A storage at the start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StorageValue {
    /// q of a compliance, p of an inertia; 0 for one in rate form, whose charge is counted from the start.
    pub stored: f64,
    /// Its own power variable that the law gives: e of a compliance, f of an inertia, f counted into the element.
    pub power: f64,
}

/// Values at t = 0+ of everything.
pub fn solve(
    graph: &BondGraph,
    causality: &Causality,
    d: &mut Vec<Diagnostic>,
) -> Option<InitialState> {
    let mut prepared = prepare(graph, causality, d)?;
    let y = start(graph, &mut prepared, d)?;
    let equations = &prepared.equations;
    let inside = first_segment(graph, equations) * 0.5;
    let storage = |end: End| {
        let (kind, bond) = (graph.storage(end)?, graph.bond_at(end)?);
        let (column, sign) = own(graph, equations, end, bond, kind.gives());
        Some(StorageValue {
            stored: equations.stored(end).map_or(0.0, |k| y[k]),
            // Not −0.
            power: sign * y[column] + 0.0,
        })
    };
    let storages =
        graph.vertex_ids().map(|id| graph.law_ports(id).filter_map(storage).collect()).collect();
    let signals = (0..graph.signals.len() as u32)
        .map(|i| match equations.signal(SignalId(i)) {
            Some(Input::Unknown(k)) => y[k as usize],
            Some(Input::Wave(k)) => equations.waves[k as usize].value(0.0, inside),
            _ => f64::NAN,
        })
        .collect();
    Some(InitialState {
        storages,
        signals,
        efforts: graph.bond_ids().map(|bond| y[equations.effort(bond)]).collect(),
        flows: graph.bond_ids().map(|bond| y[equations.flow(bond)]).collect(),
    })
}

/// Length of the first segment, seconds.
fn first_segment(graph: &BondGraph, equations: &Equations) -> f64 {
    let until = graph.experiment.until.filter(|t| *t > 0.0).unwrap_or(1.0);
    equations.corners(until)[1]
}

/// What is said of a state's initial value.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Said {
    /// This value, or nothing and hence 0.
    Value { value: f64, stated: bool },
    /// The own power variable, through a law that others modulate.
    Power { column: usize, value: f64 },
    /// Where its rate vanishes.
    AtRest,
}

/// Values of all unknowns at t = 0+.
pub fn start(
    graph: &BondGraph,
    prepared: &mut Prepared,
    d: &mut Vec<Diagnostic>,
) -> Option<Vec<f64>> {
    let Prepared { equations, compiled, structure } = prepared;
    let before = d.len();
    let mut y = vec![0.0; compiled.n];
    let said: Vec<Said> =
        (0..compiled.states).map(|k| say(graph, equations, k, &mut y, d)).collect();
    if d[before..].iter().any(|d| d.severity == crate::diagnostic::Severity::Error) {
        return None;
    }
    let horizon = first_segment(graph, equations);
    let mut slots = consistent::free_dependents(compiled, structure, &y);
    let mut dependent = vec![false; compiled.n];
    structure.constraints.iter().for_each(|c| dependent[c.dependent] = true);
    for (k, said) in said.iter().enumerate().filter(|(k, _)| !dependent[*k]) {
        match said {
            Said::Value { .. } => {}
            Said::Power { column, value } => slots[k] = Slot::fix(*column, *value),
            Said::AtRest => slots[k] = Slot::OWN,
        }
    }
    let inside = 0.5 * horizon;
    let mut solve =
        |y: &mut [f64]| consistent::newton_from_anywhere(compiled, &slots, 0.0, inside, y);
    if let Err(trouble) = equations.take(0.0, inside, 0.0, &mut y, &mut solve) {
        d.push(explain(graph, equations, compiled, &trouble, "E0504", "at t = 0"));
        return None;
    }
    for constraint in &structure.constraints {
        let rows = || structure.rows(constraint.made);
        clash(graph, equations, constraint, &rows, &said, &y, d);
    }
    contradictions(graph, equations, structure, 0.5 * horizon, &y, d);
    if d[before..].iter().any(|d| d.severity == crate::diagnostic::Severity::Error) {
        // What contradicts is said instead of what it leaves open.
        if d[before..].iter().any(|said| said.code == "E0501") {
            d.retain(|said| said.code != "W0510");
        }
        return None;
    }
    if !structure.constraints.is_empty()
        && let Err(trouble) =
            consistent::hidden(compiled, structure, 0.0, 0.5 * horizon, horizon, &mut y)
    {
        d.push(explain(graph, equations, compiled, &trouble, "E0504", "just after t = 0"));
        return None;
    }
    Some(y)
}

/// What is said of state `k`; puts its value and a guess of its power variable into `y`.
fn say(
    graph: &BondGraph,
    equations: &Equations,
    k: usize,
    y: &mut [f64],
    d: &mut Vec<Diagnostic>,
) -> Said {
    let number = |expr: &Expr| {
        expr.evaluate(&mut |leaf| match leaf {
            Leaf::Parameter(id) => graph.parameters[id.index()].value,
            _ => f64::NAN,
        })
    };
    let initial = |initial: &Initial| match initial {
        Initial::Given(expr) => Some(number(expr)),
        Initial::Implied => None,
    };
    let said = match equations.unknowns[k] {
        Unknown::Signal(id) => match &graph.signals[id.index()].law {
            SignalLaw::Integrator { initial: given, .. } => match initial(given) {
                Some(value) => Said::Value { value, stated: true },
                None => Said::AtRest,
            },
            _ => Said::Value { value: 0.0, stated: false },
        },
        Unknown::Rated(id) => match &graph.vertex(id).law {
            Law::Rate { initial: given, .. } => match initial(given) {
                Some(value) => Said::Value { value, stated: true },
                None => Said::Value { value: 0.0, stated: false },
            },
            _ => Said::Value { value: 0.0, stated: false },
        },
        Unknown::Stored(end) => match (graph.law_at(end), graph.bond_at(end)) {
            (Law::Store { kind, law, initial }, Some(bond)) => {
                let (column, sign) = own(graph, equations, end, bond, kind.gives());
                let said = match initial {
                    StoreInitial::Unstated => Said::Value { value: 0.0, stated: false },
                    StoreInitial::Stored(expr) => Said::Value { value: number(expr), stated: true },
                    StoreInitial::Power(expr) => {
                        let value = number(expr);
                        match stored_of_power(graph, law, value) {
                            Inverse::Value(value) => Said::Value { value, stated: true },
                            Inverse::Modulated => {
                                match roots_at_port(graph, end, law, value).as_deref() {
                                    // Where Newton's method begins.
                                    Some([root]) => y[k] = *root,
                                    Some(found) => {
                                        d.push(no_unique_root(graph, end, *kind, value, found));
                                    }
                                    None => {}
                                }
                                Said::Power { column, value: sign * value }
                            }
                            Inverse::Roots(found) => {
                                d.push(no_unique_root(graph, end, *kind, value, &found));
                                Said::Value { value: 0.0, stated: true }
                            }
                        }
                    }
                };
                if let Said::Value { value, .. } = said
                    && let Some(power) = power_of_stored(graph, law, value)
                {
                    y[column] = sign * power;
                }
                said
            }
            _ => Said::Value { value: 0.0, stated: false },
        },
        _ => Said::Value { value: 0.0, stated: false },
    };
    if let Said::Value { value, .. } = said {
        y[k] = value;
        if !value.is_finite() {
            let (name, span) = named(graph, equations.state_origins[k]);
            d.push(Diagnostic::error(
                "E0503",
                span,
                format!("the initial value of {name} is not a finite number"),
            ));
        }
    }
    said
}

/// Column and sign of a port's own power variable, f counted into the element.
fn own(
    graph: &BondGraph,
    equations: &Equations,
    end: End,
    bond: BondId,
    power: Power,
) -> (usize, f64) {
    let into = graph.sign_into(bond, end.vertex, end.port);
    (equations.power(bond, power), if power == Power::Flow { into } else { 1.0 })
}

/// A stored quantity found from a power variable.
enum Inverse {
    Value(f64),
    Modulated,
    Roots(Vec<f64>),
}

/// The law's value over its own variable alone, or `None` when it speaks of anything else.
fn own_law(graph: &BondGraph, law: &Expr) -> Option<impl Fn(f64) -> f64> {
    let mut alone = true;
    law.leaves(&mut |leaf, _| alone &= matches!(leaf, Leaf::Parameter(_) | Leaf::Own(_)));
    let law = law.clone();
    let values: Vec<f64> = graph.parameters.iter().map(|p| p.value).collect();
    alone.then_some(move |x: f64| {
        law.evaluate(&mut |leaf| match leaf {
            Leaf::Parameter(id) => values[id.index()],
            _ => x,
        })
    })
}

fn stored_of_power(graph: &BondGraph, law: &StoreLaw, power: f64) -> Inverse {
    match law {
        StoreLaw::Linear(value) => match own_law(graph, value) {
            Some(value) => Inverse::Value(value(0.0) * power),
            None => Inverse::Modulated,
        },
        StoreLaw::OfPower(law) => match own_law(graph, law) {
            Some(law) => Inverse::Value(law(power)),
            None => Inverse::Modulated,
        },
        StoreLaw::OfStored(law) => match own_law(graph, law) {
            Some(law) => {
                let found = roots(&|q| law(q) - power);
                match found[..] {
                    [root] => Inverse::Value(root),
                    _ => Inverse::Roots(found),
                }
            }
            None => Inverse::Modulated,
        },
    }
}

/// Where the law of a field's port has a value, over what that port stores, the others being as stated; `None` where the
/// law speaks of anything else or another port starts from its power variable too.
fn roots_at_port(graph: &BondGraph, end: End, law: &StoreLaw, power: f64) -> Option<Vec<f64>> {
    let StoreLaw::OfStored(law) = law else { return None };
    let mut others = vec![];
    let mut alone = true;
    law.leaves(&mut |leaf, _| match leaf {
        Leaf::Parameter(_) => {}
        Leaf::Stored(other) if other.vertex == end.vertex => others.push(*other),
        _ => alone = false,
    });
    let number = |expr: &Expr| {
        expr.evaluate(&mut |leaf| match leaf {
            Leaf::Parameter(id) => graph.parameters[id.index()].value,
            _ => f64::NAN,
        })
    };
    let stated = |other: End| match graph.law_at(other) {
        _ if other == end => Some(f64::NAN),
        Law::Store { initial: StoreInitial::Stored(value), .. } => Some(number(value)),
        Law::Store { initial: StoreInitial::Unstated, .. } => Some(0.0),
        _ => None,
    };
    let others: HashMap<End, f64> = others
        .into_iter()
        .map(|other| Some((other, stated(other)?)))
        .collect::<Option<_>>()
        .filter(|_| alone)?;
    Some(roots(&|x| {
        law.evaluate(&mut |leaf| match leaf {
            Leaf::Parameter(id) => graph.parameters[id.index()].value,
            Leaf::Stored(other) if *other != end => others.get(other).copied().unwrap_or(0.0),
            _ => x,
        }) - power
    }))
}

fn power_of_stored(graph: &BondGraph, law: &StoreLaw, stored: f64) -> Option<f64> {
    match law {
        StoreLaw::Linear(value) => Some(stored / own_law(graph, value)?(0.0)),
        StoreLaw::OfStored(law) => Some(own_law(graph, law)?(stored)),
        StoreLaw::OfPower(law) => {
            let law = own_law(graph, law)?;
            roots(&|e| law(e) - stored).first().copied()
        }
    }
    .filter(|power| power.is_finite())
}

fn no_unique_root(
    graph: &BondGraph,
    end: End,
    kind: Storage,
    value: f64,
    found: &[f64],
) -> Diagnostic {
    let (span, name) = (graph.vertex(end.vertex).span, graph.port_name(end));
    let (power, stored) = letters(kind);
    // As the file writes the initial values of one-ports, and of a field's ports.
    let number = match graph.vertex(end.vertex).law {
        Law::Field(_) => format!("{}_0", end.port + 1),
        _ => "0".to_string(),
    };
    let message = if found.is_empty() {
        format!("no {stored} gives {name} the {power}{number} = {value}")
    } else {
        format!("more than one {stored} gives {name} the {power}{number} = {value}")
    };
    let mut diagnostic = Diagnostic::error("E0503", span, message)
        .help(format!("state {stored}{number} instead of {power}{number}"));
    if !found.is_empty() {
        let list: Vec<String> = found.iter().take(5).map(|root| format!("{root:.6}")).collect();
        diagnostic = diagnostic.because(format!("{stored} = {}", list.join(", ")));
    }
    diagnostic
}

/// (e, q) or (f, p).
fn letters(kind: Storage) -> (&'static str, &'static str) {
    match kind {
        Storage::Compliance => ("e", "q"),
        Storage::Inertia => ("f", "p"),
    }
}

/// Compares the stated value of a dependent state with the one that the others imply.
fn clash(
    graph: &BondGraph,
    equations: &Equations,
    constraint: &Constraint,
    rows: &dyn Fn() -> Vec<usize>,
    said: &[Said],
    y: &[f64],
    d: &mut Vec<Diagnostic>,
) {
    let k = constraint.dependent;
    let (column, stated) = match said[k] {
        Said::Value { value, stated: true } => (k, value),
        Said::Power { column, value } => (column, value),
        _ => return,
    };
    let implied = y[column];
    if (implied - stated).abs() <= 1e-9 * implied.abs().max(stated.abs()) {
        return;
    }
    let (name, span) = named(graph, equations.state_origins[k]);
    let what = unknown_name(graph, equations.unknowns[column]);
    let others: Vec<String> = constraint
        .on
        .iter()
        .map(|on| format!("{} = {}", unknown_name(graph, equations.unknowns[*on]), y[*on]))
        .collect();
    let mut diagnostic = Diagnostic::error(
        "E0502",
        span,
        format!("the initial values of {name} and what it depends on contradict each other"),
    )
    .says(format!("stated {what} = {stated}, but the others imply {implied}"));
    for on in &constraint.on {
        diagnostic =
            diagnostic.label(named(graph, equations.state_origins[*on]).1, "depends on this");
    }
    if !others.is_empty() {
        diagnostic = diagnostic.because(format!("at t = 0: {}", others.join(", ")));
    }
    d.push(
        diagnostic
            .because(format!("they are tied together by {}", elements(graph, equations, &rows())))
            .help("leave the value of one of them out: it then takes the implied one"),
    );
}

/// Idle rows must say the same as the others.
fn contradictions(
    graph: &BondGraph,
    equations: &Equations,
    structure: &Structure,
    inside: f64,
    y: &[f64],
    d: &mut Vec<Diagnostic>,
) {
    for (row, made) in &structure.idle {
        let formula: &Formula = &equations.algebraic[*row];
        let mut size = 0.0f64;
        formula.leaves(&mut |leaf, _| {
            if let Input::Unknown(k) = leaf {
                size = size.max(y[*k as usize].abs());
            }
        });
        let value = Readings::new(equations, std::slice::from_ref(formula))
            .read(0.0, inside, y)
            .next()
            .unwrap_or(0.0);
        if value.abs() > 1e-9 * size {
            let rows = structure.rows(*made);
            let span = spans(graph, equations, &rows).first().copied().unwrap_or(Span::NONE);
            d.push(
                Diagnostic::error("E0501", span, "these equations cannot all hold")
                    .because(format!("they come from {}", elements(graph, equations, &rows)))
                    .because(format!("they are off by {value} at t = 0"))
                    .help("two of them set the same variable; take one away, or put an element between them"),
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::build::*;
    use super::super::graph::*;
    use super::*;
    use crate::expr::Binary;

    fn solved(graph: &BondGraph) -> (Option<InitialState>, Vec<Diagnostic>) {
        let mut d = vec![];
        let state = solve(graph, &Causality::default(), &mut d);
        (state, d)
    }

    /// 1 A into two compliances of 1 F and 2 F in parallel.
    fn parallel(first: StoreInitial, second: StoreInitial) -> (BondGraph, VertexId, VertexId) {
        let mut b = Build::default();
        let zero = b.zero("a");
        let c1 = b.vertex("C", "C1", compliance(1.0, first));
        let c2 = b.vertex("C", "C2", compliance(2.0, second));
        let source = b.vertex("Sf", "I", flow_source(n(1.0)));
        b.fan(zero, &[c1, c2]);
        b.bond(source, zero);
        (b.graph, c1, c2)
    }

    #[test]
    fn a_storage_without_a_value_takes_the_implied_one() {
        for swap in [false, true] {
            let (one, other) = (power(3.0), StoreInitial::Unstated);
            let (first, second) = if swap { (other, one) } else { (one, other) };
            let (graph, c1, c2) = parallel(first, second);
            let (state, d) = solved(&graph);
            assert!(d.is_empty(), "{d:?}");
            let state = state.unwrap();
            let of = |id: VertexId| state.storage(End::only(id)).unwrap();
            assert!((of(c1).stored - 3.0).abs() < 1e-12 && (of(c2).stored - 6.0).abs() < 1e-12);
            // The current divides as the capacitances do.
            assert!((state.flows[0] - 1.0 / 3.0).abs() < 1e-7, "{:?}", state.flows);
        }
    }

    #[test]
    fn stated_values_that_contradict_each_other_are_shown() {
        let (graph, ..) = parallel(power(3.0), stored(5.0));
        let (state, d) = solved(&graph);
        assert!(state.is_none());
        assert_eq!(d[0].code, "E0502");
        let (graph, ..) = parallel(power(3.0), stored(6.0));
        assert!(solved(&graph).0.is_some());
    }

    #[test]
    fn laws_are_inverted_when_they_have_one_root() {
        let cube = |sign: f64| plus(times(n(sign), q()), q().binary(Binary::Power, n(3.0)));
        let graph = |law: Expr, out: bool| {
            let mut b = Build::default();
            let law = Law::Store {
                kind: Storage::Compliance,
                law: StoreLaw::OfStored(law),
                initial: power(10.0),
            };
            let c = b.vertex("C", "spring", law);
            let r = b.vertex("R", "R", resistor(2.0));
            if out {
                b.bond(c, r)
            } else {
                b.bond(r, c)
            };
            b.graph
        };
        for out in [false, true] {
            let (state, _) = solved(&graph(cube(1.0), out));
            let state = state.unwrap();
            assert_eq!(state.storages[0], [StorageValue { stored: 2.0, power: 10.0 }]);
            assert_eq!(state.efforts, [10.0]);
            assert_eq!(state.flows, [if out { 5.0 } else { -5.0 }], "along the half arrow");
        }
        let (state, d) = solved(&graph(plus(cube(-1.0), n(10.0)), false));
        assert!(state.is_none());
        assert_eq!(d[0].code, "E0503");
        assert!(d[0].message.contains("more than one"));
    }

    #[test]
    fn two_sources_of_the_same_effort_contradict_each_other() {
        let mut b = Build::default();
        let zero = b.zero("a");
        let (one, other) = (
            b.vertex("Se", "U1", effort_source(n(1.0))),
            b.vertex("Se", "U2", effort_source(n(2.0))),
        );
        let r = b.vertex("R", "R", resistor(1.0));
        b.bond(one, zero);
        b.bond(other, zero);
        b.bond(zero, r);
        let (state, d) = solved(&b.graph);
        assert!(state.is_none());
        let error = d.iter().find(|d| d.code == "E0501").unwrap();
        assert!(error.notes[0].contains("Se:U1") && error.notes[0].contains("Se:U2"), "{error:?}");
    }

    #[test]
    fn a_lag_without_a_value_starts_at_rest() {
        let mut b = Build::default();
        let input = b.signal("u", SignalLaw::Algebraic(plus(f(), n(0.0))));
        let c = b.vertex("C", "C", compliance(1.0, stored(4.0)));
        let r = b.vertex("R", "R", resistor(2.0));
        let bond = b.bond(c, r);
        b.graph.signals[input.index()].law = SignalLaw::Algebraic(Expr::leaf(Leaf::Bond {
            bond,
            variable: Power::Flow,
            negated: false,
        }));
        let lag = SignalId(1);
        let difference =
            Expr::leaf(Leaf::Signal(input)).binary(Binary::Subtract, Expr::leaf(Leaf::Signal(lag)));
        b.signal(
            "y",
            SignalLaw::Integrator {
                rate: difference.binary(Binary::Divide, n(0.1)),
                initial: Initial::Implied,
            },
        );
        let (state, d) = solved(&b.graph);
        assert!(d.is_empty(), "{d:?}");
        assert_eq!(state.unwrap().signals, [2.0, 2.0]);
    }
}
