//! Elements moved across a transformer or gyrator: what hangs beside one side hangs beside the other, and does the same.
//!
//! Of a transformer, e1 = r·e2 and f2 = r·f1: what shares the flow f2 on a 1-junction, or the effort e2 on a 0-junction,
//! shares f1 or e1 on a junction of the same kind at the other side, with its effort times r and its flow over r. Of a
//! gyrator, e1 = r·f2 and e2 = r·f1: what shares the flow at one side shares the effort at the other, efforts and flows
//! exchanged. (Langlois et al. 2005, Fig. 13; Karnopp, Margolis, Rosenberg, ch. 4.)

use super::arguments::Scaling;
use super::factor::Factor;
use super::plan::{Change, Plan, Read, Side};
use super::{Source, Trouble};
use crate::bond::graph::{BondId, Dissipation, Law, Leaf, Modulus, StoreLaw, VertexId};
use crate::diagnostic::Diagnostic;
use std::collections::HashSet;

/// The two-port, and how something hangs beside it.
struct Beside {
    two_port: VertexId,
    /// The port that it hangs at.
    port: usize,
    /// The junction that it hangs on; `None` where it is bonded to the two-port itself.
    junction: Option<VertexId>,
    /// The bond that joins it.
    root: BondId,
}

/// Moves an element, or a junction with all that hangs on it, over a two-port; without a name over the only one beside
/// it.
///
/// # Errors
/// That it does not hang beside the two-port, or why it cannot move.
pub fn across(source: &Source, what: &str, over: Option<&str>) -> Result<Plan, Trouble> {
    let id = source.find(what)?;
    let over = over.map(|over| two_port(source, over)).transpose()?;
    let beside = beside(source, id, over)?;
    let vertex = source.graph.vertex(beside.two_port);
    let branch = branch(source, id, &beside)?;
    let factor = factor(source, beside.two_port)?;
    let exchanged = matches!(vertex.law, Law::Gyrator(_));
    let scaling = match (exchanged, beside.port) {
        (true, _) => Scaling::Exchanged(factor.clone()),
        (false, 1) => Scaling::Scaled { factor: factor.clone(), effort: 1, flow: -1 },
        (false, _) => Scaling::Scaled { factor: factor.clone(), effort: -1, flow: 1 },
    };
    if exchanged {
        can_exchange(source, &branch, beside.root)?;
    }
    let mut plan = Plan { why: why(source, id, &beside, &branch, &factor), ..Plan::default() };
    for part in &branch {
        plan.laws.insert(*part, Change::Scaled(scaling.clone()));
    }
    hang(source, id, &beside, &scaling, &mut plan);
    Ok(plan)
}

/// Where it hangs afterwards.
fn hang(source: &Source, id: VertexId, beside: &Beside, scaling: &Scaling, plan: &mut Plan) {
    let graph = &source.graph;
    let vertex = graph.vertex(beside.two_port);
    let far = vertex.bonds[1 - beside.port];
    let beyond = source.beyond(far, beside.two_port);
    let side_of = |bond: BondId, vertex: VertexId| match graph.bond(bond).from.vertex == vertex {
        true => Side::From,
        false => Side::To,
    };
    let own = graph.vertex(id);
    let Some(junction) = beside.junction else {
        plan.gone.insert(beside.two_port);
        plan.cut.insert(beside.root);
        plan.ends.insert((far, side_of(far, beside.two_port)), own.name.clone());
        return;
    };
    let end = (beside.root, side_of(beside.root, junction));
    let kind = scaling.kind(graph.vertex(junction).kind);
    // A junction that is left with the two-port alone says that nothing more comes across.
    let same_sense = side_of(beside.root, junction) == side_of(far, beyond);
    let alone = graph.vertex(junction).bonds.len() == 2;
    let lands = graph.vertex(beyond).kind == kind;
    if alone && (same_sense || lands) {
        let near = vertex.bonds[beside.port];
        plan.gone.extend([beside.two_port, junction]);
        plan.cut.extend([near, far]);
        plan.ends.insert(end, graph.vertex(beyond).name.clone());
        let common = if graph.vertex(junction).kind == "0" { "e" } else { "f" };
        let one_port = !matches!(own.kind, "0" | "1") && own.bonds.len() == 1;
        let text = if one_port && end.1 == Side::From {
            scaling.spelt(common, &|new| format!("{new}({})", own.name))
        } else {
            let other = &graph.vertex(beyond).name;
            let bond = match end.1 {
                Side::From => format!("{other} -> {}", own.name),
                Side::To => format!("{} -> {other}", own.name),
            };
            scaling.spelt(common, &|new| format!("{new}({bond})"))
        };
        plan.readings.push((Read::Of(common, graph.vertex(junction).name.clone()), text));
        return;
    }
    let hub = match lands {
        true => graph.vertex(beyond).name.clone(),
        false => {
            let side = if beside.port == 1 { "in" } else { "out" };
            let name = source.fresh(&format!("{}_{side}", vertex.name));
            plan.through.insert(far, (if kind == "0" { "0" } else { "1" }, name.clone()));
            name
        }
    };
    plan.ends.insert(end, hub);
}

fn two_port(source: &Source, name: &str) -> Result<VertexId, Trouble> {
    let id = source.find(name)?;
    let vertex = source.graph.vertex(id);
    if matches!(vertex.law, Law::Transformer(_) | Law::Gyrator(_)) {
        return Ok(id);
    }
    let message = format!("`{}` is no transformer or gyrator", source.title(id));
    Err(Box::new(Diagnostic::error("E1101", vertex.span, message)))
}

/// How an element hangs beside a two-port.
fn beside(source: &Source, id: VertexId, over: Option<VertexId>) -> Result<Beside, Trouble> {
    let graph = &source.graph;
    let is_two_port =
        |id: VertexId| matches!(graph.vertex(id).law, Law::Transformer(_) | Law::Gyrator(_));
    let is_junction = |id: VertexId| matches!(graph.vertex(id).law, Law::Zero | Law::One);
    let port_of = |bond: BondId, two_port: VertexId| {
        graph.vertex(two_port).bonds.iter().position(|own| *own == bond)
    };
    let mut found: Vec<Beside> = vec![];
    for root in graph.vertex(id).bonds.iter().copied().filter(|_| !is_two_port(id)) {
        let next = source.beyond(root, id);
        if is_two_port(next) {
            let port = port_of(root, next);
            found.extend(port.map(|port| Beside { two_port: next, port, junction: None, root }));
        } else if is_junction(next) {
            for bond in graph.vertex(next).bonds.iter().copied().filter(|bond| *bond != root) {
                let two_port = source.beyond(bond, next);
                if let (true, Some(port)) = (is_two_port(two_port), port_of(bond, two_port)) {
                    found.push(Beside { two_port, port, junction: Some(next), root });
                }
            }
        }
    }
    let title = source.title(id);
    let span = graph.vertex(id).span;
    let all: Vec<String> = found.iter().map(|f| graph.vertex(f.two_port).name.clone()).collect();
    found.retain(|found| over.is_none_or(|over| over == found.two_port));
    // Beside one on two ways, it cannot move: that is said of the branch.
    found.dedup_by_key(|found| found.two_port);
    match (found.len(), over) {
        (1, _) => found.pop().ok_or_else(|| Box::new(Diagnostic::error("E1101", span, title))),
        (0, Some(over)) => {
            let message = format!("`{title}` does not hang beside `{}`", source.title(over));
            let error = Diagnostic::error("E1101", span, message);
            let error = error.because(
                "an element moves over a two-port when its junction is bonded to the two-port itself",
            );
            Err(Box::new(match all.is_empty() {
                true => error.help("merge junctions first with `--simplify`, or name a junction"),
                false => error.help(format!("it hangs beside {}", all.join(", "))),
            }))
        }
        (0, None) => {
            let message = format!("`{title}` hangs beside no transformer or gyrator");
            Err(Box::new(Diagnostic::error("E1101", span, message)))
        }
        (_, _) => {
            let message = format!("`{title}` hangs beside several two-ports: {}", all.join(", "));
            let help = format!("say which: `--move '{} over {}'`", graph.vertex(id).name, all[0]);
            Err(Box::new(Diagnostic::error("E1101", span, message).help(help)))
        }
    }
}

/// All that hangs on the bond: nothing but it joins the rest.
fn branch(source: &Source, id: VertexId, beside: &Beside) -> Result<Vec<VertexId>, Trouble> {
    let mut seen = HashSet::from([id]);
    let mut open = vec![id];
    while let Some(next) = open.pop() {
        for bond in source.graph.vertex(next).bonds.iter().filter(|bond| **bond != beside.root) {
            let other = source.beyond(*bond, next);
            if other == beside.two_port || Some(other) == beside.junction {
                let (title, over) = (source.title(id), source.title(beside.two_port));
                let message =
                    format!("`{title}` cannot move over `{over}`: it is joined to it on two ways");
                let error = Diagnostic::error("E1101", source.graph.vertex(id).span, message)
                    .says("named here")
                    .label(source.graph.bond(*bond).span, "the other way ends here");
                return Err(Box::new(
                    error.help("only an element, or a branch that hangs on one bond, can move"),
                ));
            }
            if seen.insert(other) {
                open.push(other);
            }
        }
    }
    let mut all: Vec<VertexId> = seen.into_iter().collect();
    all.sort_unstable();
    Ok(all)
}

/// The ratio of a two-port, which must not vary, its half arrows pointing from port 1 to port 2.
///
/// # Errors
/// That it varies, or is drawn the other way.
pub fn factor(source: &Source, id: VertexId) -> Result<Factor, Trouble> {
    let vertex = source.graph.vertex(id);
    let (Law::Transformer(modulus) | Law::Gyrator(modulus)) = &vertex.law else {
        return Ok(Factor::number(1));
    };
    let (Modulus::Ratio(value) | Modulus::Gain(value)) = modulus;
    let mut varies = false;
    value.leaves(&mut |leaf, _| varies |= !matches!(leaf, Leaf::Parameter(_)));
    let title = source.title(id);
    if varies {
        let message =
            format!("the ratio of `{title}` varies, so that nothing keeps its law across it");
        let error = Diagnostic::error("E1101", vertex.span, message);
        return Err(Box::new(
            error.because("a storage behind a varying ratio is no storage before it"),
        ));
    }
    let straight = |port: usize| {
        let bond = source.graph.bond(vertex.bonds[port]);
        (if port == 0 { bond.to.vertex } else { bond.from.vertex }) == id
    };
    if vertex.bonds.len() != 2 || !straight(0) || !straight(1) {
        let message = format!("the half arrows at `{title}` do not point from port 1 to port 2");
        let error = Diagnostic::error("E1101", vertex.span, message);
        return Err(Box::new(error.help("draw them through it: `a -> TF:t(r) -> b`")));
    }
    let labelled = source.declared.get(&id).and_then(|declared| {
        let mut arguments = declared.arguments.iter().flatten();
        arguments.find_map(|argument| match (&argument.label, &argument.value) {
            (Some(label), crate::bond::syntax::Value::Expr(expr)) => {
                Some((label.name.text == "gain", source.slice(expr.span).to_string(), Some(expr)))
            }
            _ => None,
        })
    });
    let plain = || source.value(id).map(|(text, expr)| (false, text, expr));
    let slice = |expr: &crate::bond::syntax::Expr| source.slice(expr.span).to_string();
    Ok(match labelled.or_else(plain) {
        Some((gain, text, expr)) => {
            let factor = Factor::of(&text, expr, &slice);
            if gain { factor.inverse() } else { factor }
        }
        // It stands in an instance: the plan fails for that.
        None => Factor { text: vertex.name.clone(), over: false },
    })
}

/// Exchanging e and f changes signs where half arrows point out of elements, and turns strokes.
fn can_exchange(source: &Source, branch: &[VertexId], root: BondId) -> Result<(), Trouble> {
    let graph = &source.graph;
    for id in branch {
        let vertex = graph.vertex(*id);
        let odd = match &vertex.law {
            Law::Dissipator(Dissipation::Linear(_)) => true,
            Law::Store { law: StoreLaw::Linear(_), initial, .. } => {
                matches!(initial, crate::bond::graph::StoreInitial::Unstated)
            }
            Law::Dissipator(_) | Law::Store { .. } | Law::Rate { .. } => false,
            _ => true,
        };
        let points_out = || graph.bond(vertex.bonds[0]).from.vertex == *id;
        if !odd && points_out() {
            let message = format!("the half arrow at `{}` points out of it", source.title(*id));
            let error = Diagnostic::error("E1101", vertex.span, message);
            return Err(Box::new(
                error.help("draw it into the element first: its law stays the same"),
            ));
        }
        if matches!(vertex.law, Law::Transformer(_) | Law::Gyrator(_)) {
            factor(source, *id)?;
        }
        for bond in vertex.bonds.iter().chain([&root]) {
            if graph.bond(*bond).given.is_some() {
                let message = "a causal stroke is drawn where efforts and flows are exchanged";
                let error = Diagnostic::error("E1101", graph.bond(*bond).span, message);
                return Err(Box::new(error.help("take the stroke away: `->`")));
            }
        }
    }
    Ok(())
}

fn why(
    source: &Source,
    id: VertexId,
    beside: &Beside,
    branch: &[VertexId],
    factor: &Factor,
) -> String {
    let has = |letter: &str| {
        branch.iter().any(|id| source.graph.vertex(*id).kind.trim_start_matches('M') == letter)
    };
    let gyrator = matches!(source.graph.vertex(beside.two_port).law, Law::Gyrator(_));
    let out = beside.port == 1;
    let rows: &[(&str, &str)] = match (gyrator, out) {
        (true, _) => &[
            ("R", "an R becomes r^2/R"),
            ("C", "a C an I of C*r^2"),
            ("I", "an I a C of I/r^2"),
            ("Se", "an Se an Sf of e/r"),
            ("Sf", "an Sf an Se of r*f"),
        ],
        (false, true) => &[
            ("R", "R becomes R*r^2"),
            ("C", "C becomes C/r^2"),
            ("I", "I becomes I*r^2"),
            ("Se", "e becomes r*e"),
            ("Sf", "f becomes f/r"),
        ],
        (false, false) => &[
            ("R", "R becomes R/r^2"),
            ("C", "C becomes C*r^2"),
            ("I", "I becomes I/r^2"),
            ("Se", "e becomes e/r"),
            ("Sf", "f becomes r*f"),
        ],
    };
    let becomes: Vec<&str> =
        rows.iter().filter(|(letter, _)| has(letter)).map(|(_, text)| *text).collect();
    let law = if gyrator { "e1 = r*f2, e2 = r*f1" } else { "e1 = r*e2, f2 = r*f1" };
    let (from, to) = if out { (2, 1) } else { (1, 2) };
    let what = if branch.len() > 1 { " with what hangs on it" } else { "" };
    let ratio = factor.text();
    let ratio = if ratio == "r" { String::new() } else { format!(" with r = {ratio}") };
    format!(
        "Moved over {}, from side {from} to side {to}: {}{what}. {law}{ratio}: {}.",
        source.title(beside.two_port),
        source.title(id),
        becomes.join(", ")
    )
}
