//! The equations, ready to be solved: compiled, and what they determine; their failures in the words of the graph.

use super::causality::Causality;
use super::consistent::{self, Trouble};
use super::equations::compiled::{Compiled, compile};
use super::equations::{Equations, Origin, Unknown, equations, unknown_name};
use super::graph::{BondGraph, End, Initial, Law, Leaf, Storage, StoreInitial, StoreLaw, VertexId};
use super::structure::{Linearised, Structure, analyse};
use crate::diagnostic::Diagnostic;
use crate::source::Span;
use std::collections::HashMap;

/// The equations, ready to be solved.
#[derive(Clone, Debug)]
pub struct Prepared {
    /// As they follow from the graph.
    pub equations: Equations,
    /// As programs, what nothing determines held at 0.
    pub compiled: Compiled,
    /// What they determine.
    pub structure: Structure,
}

/// The equations of a graph with what they determine. An error when derivatives are left open whatever the values; a
/// warning for variables that nothing determines.
pub fn prepare(
    graph: &BondGraph,
    causality: &Causality,
    d: &mut Vec<Diagnostic>,
) -> Option<Prepared> {
    let equations = equations(graph);
    let mut free = compile(&equations, &[]);
    let structure = structure(graph, &equations, &mut free, causality);
    if structure.higher > 0 {
        d.push(undetermined_derivative(graph, &equations, &structure));
        return None;
    }
    let pins: Vec<(usize, usize)> = structure
        .idle
        .iter()
        .map(|(row, _)| *row)
        .zip(structure.undetermined.iter().copied())
        .collect();
    // Rings of equal junctions have been said by causality, each with the bond that closes it.
    let rings = d.iter().filter(|said| said.code == "W0405").count();
    if pins.len() > rings {
        let loose: Vec<String> = (0..equations.unknowns.len())
            .filter(|i| structure.loose[*i])
            .map(|i| unknown_name(graph, equations.unknowns[i]))
            .collect();
        let rows: Vec<usize> =
            structure.idle.iter().flat_map(|(_, made)| structure.rows(*made)).collect();
        let span = spans(graph, &equations, &rows).first().copied().unwrap_or(Span::NONE);
        d.push(
            Diagnostic::warning("W0510", span, format!("nothing determines {}", loose.join(", ")))
                .because(format!(
                    "the equations of {} repeat each other",
                    elements(graph, &equations, &rows)
                ))
                .because("they are taken as 0")
                .help("put an R between those that repeat each other, or take one of them away"),
        );
    }
    let compiled = if pins.is_empty() { free } else { compile(&equations, &pins) };
    Some(Prepared { equations, compiled, structure })
}

/// A storage that must stand still, or follow something, with nothing left that could make it.
fn undetermined_derivative(
    graph: &BondGraph,
    equations: &Equations,
    structure: &Structure,
) -> Diagnostic {
    let rows: Vec<usize> =
        structure.constraints.iter().flat_map(|c| structure.rows(c.made)).collect();
    let span = spans(graph, equations, &rows).first().copied().unwrap_or(Span::NONE);
    let empty = rows.iter().find_map(|row| match equations.origins.get(*row) {
        Some(Origin::Vertex(id)) => stores_nothing(graph, *id).then_some(graph.vertex(*id)),
        _ => None,
    });
    if let Some(vertex) = empty {
        let inertia = matches!(vertex.law, Law::Store { kind: Storage::Inertia, .. });
        let (what, stored, open) =
            if inertia { ("inertia", "p", "flow") } else { ("compliance", "q", "effort") };
        let message = format!("the {what} of {}:{} is 0", vertex.kind, vertex.name);
        return Diagnostic::error("E0506", vertex.span, message)
            .says(format!("it stores nothing, and nothing determines its {open}"))
            .because(format!("{stored} stays 0, so that nothing can move it"))
            .help("leave the element out, or give it a value above 0");
    }
    let names = elements(graph, equations, &rows);
    Diagnostic::error("E0506", span, "what is stored is prescribed, and nothing is free to move it")
        .because(format!("prescribed by {names}"))
        .help("let an effort or a flow act through an R, a C or an I instead of setting a stored quantity")
}

/// Whether a storage's value is 0 for certain.
fn stores_nothing(graph: &BondGraph, id: VertexId) -> bool {
    let Law::Store { law: StoreLaw::Linear(value), .. } = &graph.vertex(id).law else {
        return false;
    };
    let number = value.evaluate(&mut |leaf| match leaf {
        Leaf::Parameter(id) => graph.parameters[id.index()].value,
        _ => f64::NAN,
    });
    number == 0.0
}

/// What the equations determine, at the most favourable of some random points.
fn structure(
    graph: &BondGraph,
    equations: &Equations,
    compiled: &mut Compiled,
    causality: &Causality,
) -> Structure {
    let preference = preference(graph, equations, causality);
    let n = compiled.n;
    let mut best: Option<(usize, Structure)> = None;
    let mut seed = 0x2545_f491_4f6c_dd1d;
    for size in [1.0, 1e-3, 30.0, 1e-6, 1e-9] {
        let mut random = || size * consistent::random_sign(&mut seed);
        let y: Vec<f64> = (0..n).map(|_| random()).collect();
        let waves: Vec<f64> = (0..compiled.waves()).map(|_| random()).collect();
        let (mut f, mut jacobian) = (vec![0.0; n], vec![0.0; compiled.pattern.len()]);
        compiled.jacobian_with(size, &waves, &y, &mut f, &mut jacobian);
        if jacobian.iter().any(|entry| !entry.is_finite()) && best.is_some() {
            continue;
        }
        let mut rows = vec![vec![]; n];
        for column in 0..n {
            for slot in compiled.pattern.column(column) {
                // What has no finite slope here has one elsewhere: any number stands for it.
                let entry =
                    if jacobian[slot].is_finite() { jacobian[slot] } else { random() / size };
                if entry != 0.0 {
                    rows[compiled.pattern.rows[slot] as usize].push((column, entry));
                }
            }
        }
        let algebraic = rows.split_off(compiled.states);
        let linearised =
            Linearised { states: compiled.states, unknowns: n, rates: rows, algebraic };
        let structure = analyse(&linearised, &preference);
        let defect = structure.constraints.len() + structure.idle.len() + structure.higher;
        if defect == 0 {
            return structure;
        }
        if best.as_ref().is_none_or(|(least, _)| defect < *least) {
            best = Some((defect, structure));
        }
    }
    best.map(|(_, structure)| structure).unwrap_or_default()
}

/// States from the one that most deserves to stay independent: integrators, then storages with a stated value, then
/// the others; among these as causality assigned them, else in file order.
fn preference(graph: &BondGraph, equations: &Equations, causality: &Causality) -> Vec<usize> {
    let places: HashMap<End, usize> =
        causality.states.iter().enumerate().map(|(place, end)| (*end, place)).collect();
    let mut states: Vec<usize> = (0..equations.states).collect();
    states.sort_by_cached_key(|k| {
        let end = match equations.unknowns[*k] {
            Unknown::Stored(end) => end,
            Unknown::Rated(id) => End::only(id),
            _ => return (0, 0, *k),
        };
        let stated = match graph.law_at(end) {
            Law::Store { initial, .. } => !matches!(initial, StoreInitial::Unstated),
            Law::Rate { initial, .. } => matches!(initial, Initial::Given(_)),
            _ => false,
        };
        let place = places.get(&end).copied().unwrap_or(usize::MAX);
        (if stated { 1 } else { 2 }, place, *k)
    });
    states
}

/// Trouble of the solver in the words of the graph.
pub fn explain(
    graph: &BondGraph,
    equations: &Equations,
    compiled: &Compiled,
    trouble: &Trouble,
    code: &'static str,
    when: &str,
) -> Diagnostic {
    let origin = |row: usize| {
        if row < compiled.states {
            equations.state_origins[row]
        } else {
            equations.origins[row - compiled.states]
        }
    };
    match trouble {
        Trouble::Diverged { row } => {
            let (name, span) = named(graph, origin(*row));
            Diagnostic::error(
                code,
                span,
                format!("no efforts and flows were found that satisfy all laws {when}"),
            )
            .says(format!("the law of {name} is off by most"))
            .help("check this law at the initial values: it may have no solution there, or a pole")
        }
        Trouble::Singular(singular) => {
            let rows = singular.rows.first().cloned().unwrap_or_default();
            let mut origins: Vec<Origin> = rows.iter().map(|row| origin(*row as usize)).collect();
            origins.sort();
            origins.dedup();
            let names: Vec<String> =
                origins.iter().take(12).map(|origin| named(graph, *origin).0).collect();
            let open: Vec<String> = singular
                .columns
                .first()
                .into_iter()
                .flatten()
                .take(6)
                .map(|column| unknown_name(graph, equations.unknowns[*column as usize]))
                .collect();
            let span = origins.first().map_or(Span::NONE, |origin| named(graph, *origin).1);
            let mut diagnostic =
                Diagnostic::error(code, span, format!("the equations are singular {when}"));
            if !names.is_empty() {
                diagnostic = diagnostic
                    .because(format!("those of {} depend on each other", names.join(", ")));
            }
            if !open.is_empty() {
                diagnostic = diagnostic.because(format!("they leave {} open", open.join(", ")));
            }
            diagnostic.help(
                "a law without slope, a modulus of 0 or a missing element leaves a variable open",
            )
        }
    }
}

/// Name and place of where an equation comes from.
pub fn named(graph: &BondGraph, origin: Origin) -> (String, Span) {
    match origin {
        Origin::Vertex(id) => {
            let vertex = graph.vertex(id);
            (format!("{}:{}", vertex.kind, vertex.name), vertex.span)
        }
        Origin::Signal(id) => {
            let signal = &graph.signals[id.index()];
            (format!("signal {}", signal.name), signal.span)
        }
    }
}

/// Where some algebraic rows come from, each place once.
pub fn origins(equations: &Equations, rows: &[usize]) -> Vec<Origin> {
    let mut origins: Vec<Origin> = rows.iter().map(|row| equations.origins[*row]).collect();
    origins.sort();
    origins.dedup();
    origins
}

/// The junctions, elements and signals that some algebraic rows come from.
pub fn elements(graph: &BondGraph, equations: &Equations, rows: &[usize]) -> String {
    let origins = origins(equations, rows);
    let mut names: Vec<String> =
        origins.iter().take(12).map(|origin| named(graph, *origin).0).collect();
    if origins.len() > names.len() {
        names.push("…".to_string());
    }
    names.join(", ")
}

/// Their places.
pub fn spans(graph: &BondGraph, equations: &Equations, rows: &[usize]) -> Vec<Span> {
    origins(equations, rows).iter().map(|origin| named(graph, *origin).1).collect()
}
