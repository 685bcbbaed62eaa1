//! A graph with fewer parts that does the same: junctions merged or dropped, elements merged, chains of two-ports made
//! one.
//!
//! | rule | why |
//! |---|---|
//! | two junctions of one kind that share a bond are one | they have the variable in common, their sums add up |
//! | a junction with one bond in and one out is a bond | e and f are the same at both |
//! | R, I on a 1-junction: R1 + R2, I1 + I2; C: 1/(1/C1 + 1/C2) | the flow is the same, efforts add up |
//! | C on a 0-junction: C1 + C2; R, I: 1/(1/R1 + 1/R2) | the effort is the same, flows add up |
//! | TF-TF: r1·r2; GY-GY: a TF of r1/r2; TF-GY: a GY of r1·r2; GY-TF: a GY of r1/r2 | e1 = r1·e2 = r1·r2·e3 … |
//!
//! (Karnopp, Margolis, Rosenberg, *System Dynamics*, ch. 3 and 4; Borutzky, *Bond Graph Methodology*, ch. 2.)

use super::across::factor;
use super::factor::{Factor, at, level};
use super::plan::{Change, Plan, Read, Side};
use super::rewrite::{apply, within};
use super::{Source, letters};
use crate::bond::graph::{
    BondId, Dissipation, Expr, Law, Leaf, Storage, StoreInitial, StoreLaw, VertexId,
};

/// The next step of simplifying, made: the text after it. `None` when nothing more can be done.
pub fn step(source: &Source) -> Option<String> {
    let graph = &source.graph;
    let bonds = || graph.bond_ids();
    let plans = bonds()
        .filter_map(|bond| merge_junctions(source, bond))
        .chain(graph.vertex_ids().filter_map(|id| drop_junction(source, id)))
        .chain(bonds().filter_map(|bond| join_two_ports(source, bond)))
        .chain(graph.vertex_ids().flat_map(|id| merge_elements(source, id)));
    // What is read, or stands in an instance, stays.
    plans
        .filter(|plan| within(source, plan))
        .filter_map(|plan| apply(source, &plan).ok())
        .find(|text| *text != source.text)
}

fn is_junction(law: &Law) -> bool {
    matches!(law, Law::Zero | Law::One)
}

/// The variable that a junction has in common.
fn common(source: &Source, junction: VertexId) -> &'static str {
    if source.graph.vertex(junction).kind == "0" { "e" } else { "f" }
}

fn merge_junctions(source: &Source, bond: BondId) -> Option<Plan> {
    let graph = &source.graph;
    let ends = graph.bond(bond);
    let (a, b) = (ends.from.vertex, ends.to.vertex);
    let both = [a, b].map(|id| graph.vertex(id));
    if a == b || both[0].kind != both[1].kind || !is_junction(&both[0].law) {
        return None;
    }
    let shared = both[0].bonds.iter().filter(|own| both[1].bonds.contains(own)).count();
    let (stays, goes) =
        if letters::is_read(source, b) && !letters::is_read(source, a) { (b, a) } else { (a, b) };
    let name = &graph.vertex(stays).name;
    let mut plan = Plan {
        why: format!(
            "One {}-junction of {} and {}: they have the {} in common.",
            both[0].kind,
            name,
            graph.vertex(goes).name,
            if both[0].kind == "0" { "effort" } else { "flow" }
        ),
        ..Plan::default()
    };
    plan.gone.insert(goes);
    plan.cut.insert(bond);
    for other in graph.vertex(goes).bonds.iter().filter(|other| **other != bond) {
        let side = if graph.bond(*other).from.vertex == goes { Side::From } else { Side::To };
        plan.ends.insert((*other, side), name.clone());
    }
    let common = common(source, stays);
    let gone = graph.vertex(goes).name.clone();
    plan.readings.push((Read::Of(common, gone), format!("{common}({name})")));
    (shared == 1).then_some(plan)
}

/// The name of a bond's end where the direction alone says the port.
fn plain_end(source: &Source, bond: BondId, side: Side) -> Option<String> {
    let bond = source.graph.bond(bond);
    let end = if side == Side::From { bond.from } else { bond.to };
    let vertex = source.graph.vertex(end.vertex);
    let plain = match &vertex.law {
        Law::Transformer(_) | Law::Gyrator(_) => (end.port == 0) == (side == Side::To),
        Law::Field(_) => false,
        _ => true,
    };
    plain.then(|| vertex.name.clone())
}

fn drop_junction(source: &Source, id: VertexId) -> Option<Plan> {
    let graph = &source.graph;
    let vertex = graph.vertex(id);
    let &[one, two] = vertex.bonds.as_slice() else { return None };
    if !is_junction(&vertex.law) {
        return None;
    }
    let into = |bond: BondId| graph.bond(bond).to.vertex == id;
    let (before, after) = match (into(one), into(two)) {
        (true, false) => (one, two),
        (false, true) => (two, one),
        _ => return None,
    };
    let (from, to) = (plain_end(source, before, Side::From)?, plain_end(source, after, Side::To)?);
    if from == to || graph.bond(after).given.is_some() {
        return None;
    }
    let mut plan = Plan {
        why: format!(
            "{} was a bond with a name: one bond in, one out, the same effort and flow at both.",
            source.title(id)
        ),
        ..Plan::default()
    };
    plan.gone.insert(id);
    plan.cut.insert(after);
    plan.ends.insert((before, Side::To), to.clone());
    let common = common(source, id);
    plan.readings
        .push((Read::Of(common, vertex.name.clone()), format!("{common}({from} -> {to})")));
    for what in ["e", "f", "power"] {
        for bond in [before, after] {
            plan.readings.push((Read::Bond(what, bond), format!("{what}({from} -> {to})")));
        }
    }
    Some(plan)
}

fn join_two_ports(source: &Source, bond: BondId) -> Option<Plan> {
    let graph = &source.graph;
    let (first, second) = (graph.bond(bond).from.vertex, graph.bond(bond).to.vertex);
    let gyrator = |id: VertexId| match graph.vertex(id).law {
        Law::Transformer(_) => Some(false),
        Law::Gyrator(_) => Some(true),
        _ => None,
    };
    let both = (gyrator(first)?, gyrator(second)?);
    let factors = (factor(source, first).ok()?, factor(source, second).ok()?);
    if first == second || !source.own(first) || !source.own(second) {
        return None;
    }
    // Behind a gyrator the second ratio divides.
    let by = if both.0 { factors.1.inverse() } else { factors.1.clone() };
    let kind = if both.0 != both.1 { "GY" } else { "TF" };
    let text = product(&factors.0, &by);
    let (a, b) = (&graph.vertex(first).name, &graph.vertex(second).name);
    let laws = match both {
        (false, false) => "e1 = r1*e2 = r1*(r2*e3)",
        (true, true) => "e1 = r1*f2 = r1*(e3/r2)",
        (false, true) => "e1 = r1*e2 = r1*(r2*f3)",
        (true, false) => "e1 = r1*f2 = r1*(f3/r2)",
    };
    let mut plan = Plan {
        why: format!("One {kind} of {} and {}: {laws}.", source.title(first), source.title(second)),
        ..Plan::default()
    };
    let after = *graph.vertex(second).bonds.get(1)?;
    plan.gone.insert(second);
    plan.cut.insert(bond);
    plan.ends.insert((after, Side::From), a.clone());
    plan.laws.insert(first, Change::Text(kind, text));
    for what in ["e", "f", "power"] {
        plan.readings.push((Read::Of(what, format!("{a}.1")), format!("{what}({a}.1)")));
        plan.readings.push((Read::Of(what, format!("{b}.2")), format!("{what}({a}.2)")));
    }
    Some(plan)
}

fn product(a: &Factor, b: &Factor) -> String {
    match (a.over, b.over) {
        (false, false) => format!("{}*{}", a.text, b.text),
        (false, true) => format!("{}/{}", a.text, b.text),
        (true, false) => format!("{}/{}", b.text, a.text),
        (true, true) => format!("1/({}*{})", a.text, b.text),
    }
}

/// A linear element without a stated start: its letter, and whether its value varies.
fn linear(law: &Law) -> Option<(&'static str, bool)> {
    let varies = |expr: &Expr| {
        let mut varies = false;
        expr.leaves(&mut |leaf, _| varies |= !matches!(leaf, Leaf::Parameter(_)));
        varies
    };
    match law {
        Law::Dissipator(Dissipation::Linear(value)) => Some(("R", varies(value))),
        Law::Store { kind, law: StoreLaw::Linear(value), initial: StoreInitial::Unstated } => {
            let letter = if *kind == Storage::Compliance { "C" } else { "I" };
            Some((letter, varies(value)))
        }
        _ => None,
    }
}

fn merge_elements(source: &Source, junction: VertexId) -> Vec<Plan> {
    let graph = &source.graph;
    let vertex = graph.vertex(junction);
    if !is_junction(&vertex.law) {
        return vec![];
    }
    let hanging: Vec<(BondId, VertexId)> = vertex
        .bonds
        .iter()
        .map(|bond| (*bond, source.beyond(*bond, junction)))
        .filter(|(_, id)| source.own(*id) && linear(&graph.vertex(*id).law).is_some())
        .collect();
    let mut plans = vec![];
    for (k, (bond_a, a)) in hanging.iter().enumerate() {
        for (bond_b, b) in &hanging[k + 1..] {
            plans.extend(merge_two(source, junction, (*bond_a, *a), (*bond_b, *b)));
        }
    }
    plans
}

fn merge_two(
    source: &Source,
    junction: VertexId,
    (bond_a, a): (BondId, VertexId),
    (bond_b, b): (BondId, VertexId),
) -> Option<Plan> {
    let graph = &source.graph;
    let ((letter, varies_a), (other, varies_b)) =
        (linear(&graph.vertex(a).law)?, linear(&graph.vertex(b).law)?);
    let series = graph.vertex(junction).kind == "1";
    let adds = series == (letter != "C");
    let varies = varies_a || varies_b;
    // Storages that do not share what they store by have starts of their own, which only constants hide.
    if letter != other || (varies && !adds && letter != "R") {
        return None;
    }
    let ((value_a, expr_a), (value_b, expr_b)) = (source.value(a)?, source.value(b)?);
    let own = |expr: Option<&crate::bond::syntax::Expr>| expr.map_or(2, level);
    let same = value_a == value_b;
    let text = match (adds, same) {
        (true, true) => format!("2*{}", at(&value_a, own(expr_a), 1)),
        (true, false) => format!("{value_a} + {value_b}"),
        (false, true) => format!("{}/2", at(&value_a, own(expr_a), 1)),
        (false, false) => {
            format!("1/(1/{} + 1/{})", at(&value_a, own(expr_a), 2), at(&value_b, own(expr_b), 2))
        }
    };
    let (name_a, name_b) = (&graph.vertex(a).name, &graph.vertex(b).name);
    let why = match (series, adds) {
        (true, true) => "the flow is the same, the efforts add up",
        (true, false) => "the flow is the same, the efforts q/C add up",
        (false, true) => "the effort is the same, the flows add up",
        (false, false) => "the effort is the same, the flows add up",
    };
    let mut plan =
        Plan { why: format!("One {letter} of {name_a} and {name_b}: {why}."), ..Plan::default() };
    plan.gone.insert(b);
    plan.cut.insert(bond_b);
    let kind = if varies { ["MR", "MC", "MI"] } else { ["R", "C", "I"] };
    let kind = kind[["R", "C", "I"].iter().position(|own| *own == letter)?];
    plan.laws.insert(a, Change::Text(kind, text));
    let into = |bond: BondId| graph.bond(bond).from.vertex == junction;
    if into(bond_a) && into(bond_b) {
        let common = common(source, junction);
        for name in [name_a, name_b] {
            plan.readings.push((Read::Of(common, name.clone()), format!("{common}({name_a})")));
        }
    }
    Some(plan)
}
