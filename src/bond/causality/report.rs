//! Causality in words: diagnostics, the text of `bondspice causality`, and its JSON.

use super::super::graph::*;
use super::{AlgebraicLoop, Causality, Conflict, Dependent, assign};
use crate::diagnostic::Diagnostic;
use serde_json::{Value, json};
use std::fmt::Write;

/// Bonds that are labelled one by one in a message.
const MOST: usize = 12;

/// Tells what was found.
pub fn explain(
    graph: &BondGraph,
    causality: &Causality,
    rings: &[Vec<BondId>],
    diagnostics: &mut Vec<Diagnostic>,
) {
    for conflict in &causality.conflicts {
        diagnostics.push(tell_conflict(graph, conflict));
    }
    for ring in rings {
        diagnostics.push(tell_ring(graph, ring));
    }
    for dependent in &causality.dependent {
        diagnostics.push(tell_dependent(graph, causality, dependent));
    }
    for found in &causality.loops {
        diagnostics.push(tell_loop(graph, found));
    }
    for id in graph.vertex_ids() {
        let vertex = graph.vertex(id);
        let receives = |end: End| causality.receives_effort(graph, graph.bond_at(end)?, end);
        if let Some(receives) = receives(End::only(id))
            && assign::non_dividing(vertex).is_some_and(|wanted| wanted != receives)
        {
            let message = format!(
                "{} is forced into the causality that divides by its modulus",
                name(graph, id)
            );
            diagnostics.push(
                Diagnostic::warning("W0403", vertex.span, message)
                    .because(
                        "its equations are kept as written and are singular where the modulus is 0",
                    )
                    .help("let a storage or a resistance stand between it and what forces it"),
            );
        }
        for end in graph.law_ports(id) {
            let (Law::Dissipator(law), Some(receives)) = (graph.law_at(end), receives(end)) else {
                continue;
            };
            let other_way = match law {
                Dissipation::Effort(_) if receives => ("e", "f"),
                Dissipation::Flow(_) if !receives => ("f", "e"),
                _ => continue,
            };
            if !assign::is_written(graph, end, law) {
                continue;
            }
            let (gives, takes) = other_way;
            let message = format!(
                "the law of {} gives {gives} from {takes}, but the graph wants {takes} from {gives}",
                port_name(graph, end)
            );
            diagnostics.push(
                Diagnostic::note("N0401", vertex.span, message)
                    .because("the law stays as it is written, as an implicit equation"),
            );
        }
    }
}

/// `I:rotor`, `I:coils.1`.
fn port_name(graph: &BondGraph, end: End) -> String {
    format!("{}:{}", graph.vertex(end.vertex).kind, graph.port_name(end))
}

fn port_names(graph: &BondGraph, ends: &[End]) -> String {
    list(&ends.iter().map(|&end| port_name(graph, end)).collect::<Vec<_>>())
}

fn name(graph: &BondGraph, id: VertexId) -> String {
    let vertex = graph.vertex(id);
    format!("{}:{}", vertex.kind, vertex.name)
}

/// `a`, `a and b`, `a, b and c`.
fn list(names: &[String]) -> String {
    match names {
        [] => String::new(),
        [one] => one.clone(),
        [some @ .., last] => format!("{} and {last}", some.join(", ")),
    }
}

fn names(graph: &BondGraph, ids: &[VertexId]) -> String {
    list(&ids.iter().map(|&id| name(graph, id)).collect::<Vec<_>>())
}

/// Bonds one after the other: `a -> b -> c` as far as they hang together, else with commas.
fn path(graph: &BondGraph, bonds: &[BondId]) -> String {
    let mut text = String::new();
    let mut last = None;
    for &id in bonds {
        let bond = graph.bond(id);
        if last == Some(bond.from.vertex) {
            let _ = write!(text, " -> {}", graph.end_name(bond.to));
        } else {
            let comma = if text.is_empty() { "" } else { ", " };
            let _ = write!(text, "{comma}{}", graph.bond_name(id));
        }
        last = Some(bond.to.vertex);
    }
    text
}

fn label_path(graph: &BondGraph, bonds: &[BondId], mut diagnostic: Diagnostic) -> Diagnostic {
    for &bond in bonds.iter().take(MOST) {
        diagnostic = diagnostic.label(graph.bond(bond).span, "");
    }
    diagnostic
}

fn tell_conflict(graph: &BondGraph, conflict: &Conflict) -> Diagnostic {
    let at = graph.vertex(conflict.at);
    let who = names(graph, &conflict.elements);
    let place = name(graph, conflict.at);
    let several = conflict.elements.len() > 1;
    let both = if conflict.elements.len() == 2 { "both" } else { "all" };
    let sets = |power: Power| {
        conflict
            .elements
            .iter()
            .all(|&id| matches!(graph.vertex(id).law, Law::Source { sets, .. } if sets == power))
    };
    let (what, help) = match &at.law {
        Law::Zero if sets(Power::Flow) && several => (
            format!("{who} {both} impose flows on {place}, and nothing imposes its effort"),
            "join a C, an R or an effort source to it, or take one flow source away",
        ),
        Law::One if sets(Power::Effort) && several => (
            format!("{who} {both} impose efforts on {place}, and nothing imposes its flow"),
            "join an I, an R or a flow source to it, or take one effort source away",
        ),
        Law::Zero if several => (
            format!("{who} {both} impose the effort of {place}"),
            "take one away, or put an R in series with it on a 1-junction",
        ),
        Law::One if several => (
            format!("{who} {both} impose the flow of {place}"),
            "take one away, or put an R in parallel with it on a 0-junction",
        ),
        Law::Transformer(_) if several && sets(Power::Effort) => (
            format!("{who} impose the efforts of both ports of {place}, and nothing its flow"),
            "a transformer passes the effort one way and the flow the other: put an R or I on a 1-junction next to it",
        ),
        Law::Transformer(_) if several && sets(Power::Flow) => (
            format!("{who} impose the flows of both ports of {place}, and nothing its effort"),
            "a transformer passes the effort one way and the flow the other: put an R or C on a 0-junction next to it",
        ),
        Law::Transformer(_) | Law::Gyrator(_) if several => (
            format!("{who} impose what excludes each other on the two ports of {place}"),
            "a transformer passes effort one way and flow the other, a gyrator turns one into the other",
        ),
        Law::Field(_) if several => (
            format!("{who} impose what excludes each other on the two ports of {place}"),
            "neither of its laws speaks of its own port: what is imposed on one port decides what may be imposed on the other",
        ),
        Law::Source { .. } | Law::Zero | Law::One | Law::Transformer(_) | Law::Gyrator(_)
            if !several =>
        {
            (
                format!("no causality fits at {place}: what {who} imposes comes back to it"),
                "the junctions or two-ports around it form a loop that determines a variable twice",
            )
        }
        _ => (
            format!("{who} impose different causalities along the bonds between them"),
            "leave the causal stroke out, or put it at the other end",
        ),
    };
    let drawn = conflict.path.iter().find(|&&bond| graph.bond(bond).given.is_some());
    if let Some(&bond) = drawn {
        return tell_stroke(graph, conflict, bond, &what);
    }
    let message = format!("causal conflict: {what}");
    let first = conflict.elements.first().map_or(at.span, |&id| graph.vertex(id).span);
    let mut diagnostic = Diagnostic::error("E0406", first, message);
    for &id in conflict.elements.iter().skip(1).take(MOST) {
        diagnostic = diagnostic.label(graph.vertex(id).span, "");
    }
    if !conflict.path.is_empty() {
        diagnostic =
            diagnostic.because(format!("bonds between them: {}", path(graph, &conflict.path)));
    }
    label_path(graph, &conflict.path, diagnostic.help(help))
}

/// A stroke drawn in the text that the sources exclude. `what` is the conflict that it makes.
fn tell_stroke(graph: &BondGraph, conflict: &Conflict, drawn: BondId, what: &str) -> Diagnostic {
    let bond = graph.bond(drawn);
    let (from, to) = (&graph.vertex(bond.from.vertex).name, &graph.vertex(bond.to.vertex).name);
    let (giver, other) = match bond.given {
        Some(Stroke::AtFrom) => (to, format!("{from} ->| {to}")),
        _ => (from, format!("{from} |-> {to}")),
    };
    let message = format!("the causal stroke on {} cannot stand there", graph.bond_name(drawn));
    let mut diagnostic = Diagnostic::error("E0407", bond.span, message)
        .says(format!("drawn so that `{giver}` imposes the effort"));
    // A source on the bond itself says all.
    let ends = [bond.from.vertex, bond.to.vertex];
    let source = ends.into_iter().find_map(|id| match graph.vertex(id).law {
        Law::Source { sets, .. } => Some((id, sets)),
        _ => None,
    });
    match source {
        Some((id, sets)) => {
            let word = if sets == Power::Effort { "effort" } else { "flow" };
            let says = format!("{} imposes the {word}", name(graph, id));
            diagnostic = diagnostic.label(graph.vertex(id).span, says);
        }
        None => {
            for &id in conflict.elements.iter().take(MOST) {
                diagnostic = diagnostic.label(graph.vertex(id).span, "");
            }
            diagnostic = diagnostic.because(what);
            if conflict.path.len() > 1 {
                let path = path(graph, &conflict.path);
                diagnostic = diagnostic.because(format!("bonds between them: {path}"));
            }
        }
    }
    diagnostic.help(format!("leave the stroke out, or draw it at the other end: `{other}`"))
}

fn tell_ring(graph: &BondGraph, ring: &[BondId]) -> Diagnostic {
    let first = ring.first().copied();
    let zero = first
        .is_some_and(|bond| matches!(graph.vertex(graph.bond(bond).from.vertex).law, Law::Zero));
    let (kind, what) = if zero { ("0", "flow") } else { ("1", "effort") };
    let span = first.map_or(crate::source::Span::NONE, |bond| graph.bond(bond).span);
    let message = format!(
        "the {what} round a ring of {kind}-junctions is not determined: {} closes it",
        path(graph, ring)
    );
    Diagnostic::warning("W0405", span, message)
        .because(format!(
            "all of them share one {}, so any {what} may circulate",
            if zero { "effort" } else { "flow" }
        ))
        .help("leave this bond out: the junctions are joined without it")
}

fn tell_dependent(graph: &BondGraph, causality: &Causality, dependent: &Dependent) -> Diagnostic {
    let vertex = graph.vertex(dependent.storage.vertex);
    let on = &dependent.on[..dependent.on.len().min(MOST)];
    let message = match on {
        [] => format!("{} is in derivative causality", port_name(graph, dependent.storage)),
        on => format!(
            "{} is in derivative causality: {} determine{} it",
            port_name(graph, dependent.storage),
            port_names(graph, on),
            if on.len() == 1 { "s" } else { "" }
        ),
    };
    let mut diagnostic = Diagnostic::warning("W0401", vertex.span, message);
    if !dependent.path.is_empty() {
        diagnostic = diagnostic.because(format!("causal path: {}", path(graph, &dependent.path)));
    }
    for end in on {
        diagnostic = diagnostic.label(graph.vertex(end.vertex).span, "");
    }
    let concerned = std::iter::once(dependent.storage.vertex).chain(on.iter().map(|e| e.vertex));
    diagnostic = at_instances(graph, diagnostic, concerned);
    let (states, storages) =
        (causality.states.len(), causality.states.len() + causality.dependent.len());
    let are = if states == 1 { "is a state" } else { "are states" };
    let count = if storages == 1 {
        "the only storage is no state".to_string()
    } else {
        format!("of {storages} storages {states} {are}")
    };
    diagnostic
        .because(count)
        .help("the result is right as it stands; a stiff C or a small R between them would make it a state of its own")
}

/// Points at the instances in the file that elements are parts of: the lines of a library say nothing of its use.
fn at_instances(
    graph: &BondGraph,
    mut diagnostic: Diagnostic,
    concerned: impl Iterator<Item = VertexId>,
) -> Diagnostic {
    let mut said = vec![];
    for (instance, span) in concerned.filter_map(|id| graph.instance_of(id)) {
        if !said.contains(&instance) {
            said.push(instance);
            diagnostic = diagnostic.used(span, format!("in `{instance}`, used here"));
        }
    }
    diagnostic
}

fn tell_loop(graph: &BondGraph, found: &AlgebraicLoop) -> Diagnostic {
    let mut members: Vec<String> = found.elements.iter().map(|&id| name(graph, id)).collect();
    let signals = found.signals.iter().map(|&id| &graph.signals[id.index()]);
    members.extend(signals.map(|signal| format!("signal {}", signal.name)));
    let alone = members.len() == 1;
    let members = list(&members);
    let spans = found.elements.iter().map(|&id| graph.vertex(id).span);
    let spans = spans.chain(found.signals.iter().map(|&id| graph.signals[id.index()].span));
    let spans: Vec<_> = spans.take(MOST).collect();
    let span = spans.first().copied().unwrap_or(crate::source::Span::NONE);
    if found.path.is_empty() {
        let message = format!("{members} depend on each other at the same instant");
        let mut diagnostic = Diagnostic::error("E0408", span, message)
            .because("a loop of signals alone has no storage that would give it a beginning")
            .help("let the loop pass through `integ`, `lag`, `delay` or a bond");
        for &span in spans.iter().skip(1) {
            diagnostic = diagnostic.label(span, "");
        }
        return diagnostic;
    }
    // A loop of junctions and two-ports alone has no members; its bonds are where it stands.
    let first = found.path.first().map_or(span, |&bond| graph.bond(bond).span);
    let span = if span.is_none() { first } else { span };
    let message = match (members.as_str(), alone) {
        ("", _) => "algebraic loop: junctions and two-ports alone form a ring".to_string(),
        (one, true) => format!("algebraic loop: {one} determines itself"),
        (several, false) => format!("algebraic loop: {several} determine each other"),
    };
    let mut diagnostic = Diagnostic::warning("W0402", span, message);
    for &span in spans.iter().skip(1) {
        diagnostic = diagnostic.label(span, "");
    }
    let concerned = found.elements.iter().take(MOST).copied();
    diagnostic = at_instances(graph, diagnostic, concerned);
    diagnostic.because(format!("causal path: {}", path(graph, &found.path))).because(
        "no storage stands between them: the solver finds their values together at each instant",
    )
}

/// The text of `bondspice causality`.
pub fn to_text(graph: &BondGraph, causality: &Causality) -> String {
    let mut text =
        String::from("bonds (the stroke is at the end on which the effort is imposed)\n");
    for id in graph.bond_ids() {
        let bond = graph.bond(id);
        let arrow = match causality.strokes.get(id.index()).copied().flatten() {
            Some(Stroke::AtFrom) => "|-> ",
            Some(Stroke::AtTo) => "->| ",
            None => "->  ",
        };
        let (from, to) = (graph.port_name(bond.from), graph.port_name(bond.to));
        let _ = writeln!(text, "  {from} {arrow}{to}");
    }
    let integrators: Vec<&Signal> =
        graph.signals.iter().filter(|s| matches!(s.law, SignalLaw::Integrator { .. })).collect();
    let _ = writeln!(text, "\nstates ({})", causality.order);
    for &end in &causality.states {
        let _ = writeln!(text, "  {}", port_name(graph, end));
    }
    for signal in &integrators {
        let _ = writeln!(text, "  signal {}", signal.name);
    }
    let _ = writeln!(
        text,
        "\norder {}: {} storages in integral causality, {} integrators of signals",
        causality.order,
        causality.states.len(),
        integrators.len()
    );
    if !causality.dependent.is_empty() {
        let _ = writeln!(text, "\nderivative causality");
    }
    for dependent in &causality.dependent {
        let _ = writeln!(
            text,
            "  {} depends on {}: {}",
            port_name(graph, dependent.storage),
            port_names(graph, &dependent.on),
            path(graph, &dependent.path)
        );
    }
    if !causality.loops.is_empty() {
        let _ = writeln!(text, "\nalgebraic loops");
    }
    for found in &causality.loops {
        let mut members: Vec<String> = found.elements.iter().map(|&id| name(graph, id)).collect();
        let signals = found.signals.iter().map(|&id| &graph.signals[id.index()]);
        members.extend(signals.map(|signal| format!("signal {}", signal.name)));
        let _ = writeln!(text, "  {}: {}", list(&members), path(graph, &found.path));
    }
    if !causality.conflicts.is_empty() {
        let _ = writeln!(text, "\nconflicts");
    }
    for conflict in &causality.conflicts {
        let _ = writeln!(
            text,
            "  {} at {}: {}",
            names(graph, &conflict.elements),
            name(graph, conflict.at),
            path(graph, &conflict.path)
        );
    }
    text
}

/// The JSON of `bondspice causality --format json`. A bond's `stroke` is `"from"`, `"to"` or null; paths are bonds as
/// `[from, to]`.
pub fn to_json(graph: &BondGraph, causality: &Causality) -> Value {
    let vertices = |ids: &[VertexId]| -> Vec<&str> {
        ids.iter().map(|&id| graph.vertex(id).name.as_str()).collect()
    };
    let ports =
        |ends: &[End]| -> Vec<String> { ends.iter().map(|&end| graph.port_name(end)).collect() };
    let bonds = |ids: &[BondId]| -> Vec<[String; 2]> {
        ids.iter()
            .map(|&id| {
                let bond = graph.bond(id);
                [graph.end_name(bond.from), graph.end_name(bond.to)]
            })
            .collect()
    };
    let stroke = |id: BondId| match causality.strokes.get(id.index()).copied().flatten() {
        Some(Stroke::AtFrom) => json!("from"),
        Some(Stroke::AtTo) => json!("to"),
        None => Value::Null,
    };
    let integrators = graph
        .signals
        .iter()
        .filter(|signal| matches!(signal.law, SignalLaw::Integrator { .. }))
        .map(|signal| signal.name.clone());
    let states: Vec<String> = ports(&causality.states).into_iter().chain(integrators).collect();
    json!({
        "schema": 1,
        "bonds": graph.bond_ids().map(|id| {
            let bond = graph.bond(id);
            json!({
                "from": graph.end_name(bond.from),
                "to": graph.end_name(bond.to),
                "stroke": stroke(id),
            })
        }).collect::<Vec<_>>(),
        "states": states,
        "order": causality.order,
        "derivative": causality.dependent.iter().map(|dependent| json!({
            "storage": graph.port_name(dependent.storage),
            "on": ports(&dependent.on),
            "path": bonds(&dependent.path),
        })).collect::<Vec<_>>(),
        "loops": causality.loops.iter().map(|found| json!({
            "elements": vertices(&found.elements),
            "signals": found.signals.iter().map(|id| graph.signals[id.index()].name.as_str()).collect::<Vec<_>>(),
            "path": bonds(&found.path),
        })).collect::<Vec<_>>(),
        "conflicts": causality.conflicts.iter().map(|conflict| json!({
            "at": graph.vertex(conflict.at).name,
            "elements": vertices(&conflict.elements),
            "path": bonds(&conflict.path),
        })).collect::<Vec<_>>(),
    })
}
