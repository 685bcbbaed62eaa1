//! Causal paths: which variable follows from which at the same instant, what determines a dependent storage, and where
//! variables determine each other.
//!
//! Variables are the effort and flow of every bond, and the signals. A storage in integral causality and an integrator
//! follow from nothing at the same instant; a storage in derivative causality gives a derivative, which ends a path too.

use super::super::graph::*;
use super::{AlgebraicLoop, Causality, Dependent, is_integral};
use std::collections::VecDeque;

/// Paths of dependent storages are listed up to this many bonds in all, so that the cost stays in proportion.
const MOST_BONDS: usize = 1_000_000;

/// What a variable follows from, as compressed lists.
struct Follows {
    starts: Vec<u32>,
    from: Vec<u32>,
}

impl Follows {
    fn of(&self, variable: usize) -> &[u32] {
        &self.from[self.starts[variable] as usize..self.starts[variable + 1] as usize]
    }
}

fn number(bond: BondId, power: Power) -> u32 {
    2 * bond.0 + u32::from(power == Power::Flow)
}

fn number_of_signal(graph: &BondGraph, signal: SignalId) -> u32 {
    2 * graph.bonds.len() as u32 + signal.0
}

/// The vertex and port that set a bond's variable.
fn setter(graph: &BondGraph, causality: &Causality, bond: BondId, power: Power) -> Option<End> {
    let stroke = causality.strokes.get(bond.index()).copied().flatten()?;
    let ends = graph.bond(bond);
    // The effort comes from the end without the stroke.
    let from_tail = (stroke == Stroke::AtTo) == (power == Power::Effort);
    Some(if from_tail { ends.from } else { ends.to })
}

/// Fills in dependent storages, loops and the order.
pub fn trace(graph: &BondGraph, causality: &mut Causality) {
    let follows = follows(graph, causality);
    let integrators =
        graph.signals.iter().filter(|s| matches!(s.law, SignalLaw::Integrator { .. })).count();
    causality.order = causality.states.len() + integrators;
    causality.loops = loops(graph, causality, &follows);
    causality.dependent = dependent(graph, causality, &follows);
}

fn follows(graph: &BondGraph, causality: &Causality) -> Follows {
    let mut follows = Follows { starts: vec![0], from: Vec::new() };
    // The bond that brings each junction's common variable.
    let mut bringing = vec![None; graph.vertices.len()];
    for id in graph.vertex_ids() {
        let vertex = graph.vertex(id);
        if let Some(common) = common(&vertex.law) {
            bringing[id.index()] = vertex.bonds.iter().copied().find(|&bond| {
                setter(graph, causality, bond, common).is_some_and(|end| end.vertex != id)
            });
        }
    }
    for bond in graph.bond_ids() {
        for power in [Power::Effort, Power::Flow] {
            if let Some(end) = setter(graph, causality, bond, power) {
                let brings = bringing[end.vertex.index()];
                set_by(graph, causality, bond, power, end, brings, &mut follows.from);
            }
            follows.starts.push(follows.from.len() as u32);
        }
    }
    for signal in &graph.signals {
        if let SignalLaw::Algebraic(expr) = &signal.law {
            read(graph, causality, expr, &mut follows.from);
        }
        follows.starts.push(follows.from.len() as u32);
    }
    follows
}

/// What all bonds of a junction share.
fn common(law: &Law) -> Option<Power> {
    match law {
        Law::Zero => Some(Power::Effort),
        Law::One => Some(Power::Flow),
        _ => None,
    }
}

/// What the vertex at `end` makes the variable from; `brings`: the bond that brings a junction's common variable.
fn set_by(
    graph: &BondGraph,
    causality: &Causality,
    bond: BondId,
    power: Power,
    end: End,
    brings: Option<BondId>,
    from: &mut Vec<u32>,
) {
    let vertex = graph.vertex(end.vertex);
    match graph.law_at(end) {
        Law::Zero | Law::One => {
            if common(&vertex.law) == Some(power) {
                from.extend(brings.map(|other| number(other, power)));
            } else {
                let others = vertex.bonds.iter().filter(|&&other| other != bond);
                from.extend(others.map(|&other| number(other, power)));
            }
        }
        Law::Source { value, .. } => read(graph, causality, value, from),
        Law::Dissipator(law) => {
            let (Dissipation::Linear(expr) | Dissipation::Effort(expr) | Dissipation::Flow(expr)) =
                law;
            let as_written = match law {
                Dissipation::Linear(_) => false,
                Dissipation::Effort(_) => power == Power::Effort,
                Dissipation::Flow(_) => power == Power::Flow,
            };
            let other = |leaf: &Leaf| !is_own(vertex, leaf);
            match vertex.law {
                // A field's law names its own variables; inverted it follows from all that is imposed on the field.
                Law::Field(_) if as_written => read(graph, causality, expr, from),
                Law::Field(_) => {
                    for port in graph.law_ports(end.vertex) {
                        imposed(graph, causality, port, from);
                    }
                    read_if(graph, causality, expr, &other, from);
                }
                _ => {
                    from.push(number(bond, power.dual()));
                    read(graph, causality, expr, from);
                }
            }
        }
        Law::Store { kind, law, .. } => {
            if is_integral(graph, causality, end, *kind) == Some(true) {
                let (StoreLaw::Linear(expr) | StoreLaw::OfStored(expr) | StoreLaw::OfPower(expr)) =
                    law;
                if matches!((&vertex.law, law), (Law::Field(_), StoreLaw::OfPower(_))) {
                    // A matrix is inverted over the ports in integral causality; what it speaks of besides its own
                    // variables is read.
                    for port in graph.law_ports(end.vertex) {
                        dependent_power(graph, causality, port, from);
                    }
                    read_if(graph, causality, expr, &|leaf| !is_own(vertex, leaf), from);
                } else {
                    read(graph, causality, expr, from);
                }
            }
        }
        Law::Rate { .. } => {}
        Law::Transformer(modulus) | Law::Gyrator(modulus) => {
            let transformer = matches!(vertex.law, Law::Transformer(_));
            if let Some(&other) = vertex.bonds.iter().find(|&&other| other != bond) {
                from.push(number(other, if transformer { power } else { power.dual() }));
            }
            let (Modulus::Ratio(expr) | Modulus::Gain(expr)) = modulus;
            read(graph, causality, expr, from);
        }
        // A field's ports have laws of their own.
        Law::Field(_) => {}
    }
}

/// Whether a leaf is an effort or flow of the element's own bonds.
fn is_own(vertex: &Vertex, leaf: &Leaf) -> bool {
    matches!(leaf, Leaf::Bond { bond, .. } if vertex.bonds.contains(bond))
}

/// What the other end imposes on a port.
fn imposed(graph: &BondGraph, causality: &Causality, end: End, from: &mut Vec<u32>) {
    if let Some(bond) = graph.bond_at(end)
        && let Some(receives_effort) = causality.receives_effort(graph, bond, end)
    {
        from.push(number(bond, if receives_effort { Power::Effort } else { Power::Flow }));
    }
}

/// The power variable that determines what a port stores, where it is in derivative causality.
fn dependent_power(graph: &BondGraph, causality: &Causality, end: End, from: &mut Vec<u32>) {
    if let (Some(kind), Some(bond)) = (graph.storage(end), graph.bond_at(end))
        && is_integral(graph, causality, end, kind) == Some(false)
    {
        from.push(number(bond, kind.gives()));
    }
}

/// The variables that an expression reads.
fn read(graph: &BondGraph, causality: &Causality, expr: &Expr, from: &mut Vec<u32>) {
    read_if(graph, causality, expr, &|_| true, from);
}

/// The variables of those leaves of an expression that are wanted.
fn read_if(
    graph: &BondGraph,
    causality: &Causality,
    expr: &Expr,
    wanted: &dyn Fn(&Leaf) -> bool,
    from: &mut Vec<u32>,
) {
    expr.leaves(&mut |leaf, _| match leaf {
        leaf if !wanted(leaf) => {}
        Leaf::Bond { bond, variable, .. } => from.push(number(*bond, *variable)),
        Leaf::Signal(signal) => from.push(number_of_signal(graph, *signal)),
        Leaf::Stored(end) => dependent_power(graph, causality, *end, from),
        // A law's own argument is the caller's to list.
        Leaf::Own(_) | Leaf::Parameter(_) | Leaf::Time => {}
    });
}

/// Sets of variables that determine each other.
fn components(follows: &Follows) -> Vec<Vec<u32>> {
    let count = follows.starts.len() - 1;
    let mut found = crate::linear::components(count, &|v| follows.of(v));
    found.retain(|set| set.len() > 1 || follows.of(set[0] as usize).contains(&set[0]));
    found.sort();
    found
}

fn loops(graph: &BondGraph, causality: &Causality, follows: &Follows) -> Vec<AlgebraicLoop> {
    let bonds = graph.bonds.len();
    let mut inside = vec![false; follows.starts.len()];
    components(follows)
        .into_iter()
        .map(|component| {
            for &variable in &component {
                inside[variable as usize] = true;
            }
            let is_junction = |v: VertexId| matches!(graph.vertex(v).law, Law::Zero | Law::One);
            let is_two_port =
                |v: VertexId| matches!(graph.vertex(v).law, Law::Transformer(_) | Law::Gyrator(_));
            let setter_of = |variable: u32| {
                let power = if variable.is_multiple_of(2) { Power::Effort } else { Power::Flow };
                let bond = BondId(variable / 2);
                setter(graph, causality, bond, power).map(|end| end.vertex)
            };
            let of_bonds = component.iter().copied().filter(|&v| (v as usize) < 2 * bonds);
            let mut setters: Vec<VertexId> = of_bonds.filter_map(setter_of).collect();
            setters.sort_unstable();
            setters.dedup();
            let mut elements: Vec<VertexId> =
                setters.iter().copied().filter(|&v| !is_junction(v) && !is_two_port(v)).collect();
            if elements.is_empty() {
                elements = setters.iter().copied().filter(|&v| is_two_port(v)).collect();
            }
            let signals = component
                .iter()
                .filter_map(|&v| v.checked_sub(2 * bonds as u32).map(SignalId))
                .collect();
            // Along the path, from the first element's variable backwards through what it follows from.
            let start = component
                .iter()
                .copied()
                .find(|&v| {
                    (v as usize) < 2 * bonds
                        && elements.first().is_some_and(|&e| setter_of(v) == Some(e))
                })
                .or(component.first().copied());
            let mut path = Vec::new();
            let mut stack: Vec<u32> = start.into_iter().collect();
            while let Some(variable) = stack.pop() {
                if !std::mem::take(&mut inside[variable as usize]) {
                    continue;
                }
                if (variable as usize) < 2 * bonds {
                    path.push(BondId(variable / 2));
                }
                stack.extend(
                    follows
                        .of(variable as usize)
                        .iter()
                        .rev()
                        .copied()
                        .filter(|&next| inside[next as usize]),
                );
            }
            let mut listed = std::collections::HashSet::new();
            path.retain(|&bond| listed.insert(bond));
            AlgebraicLoop { elements, signals, path }
        })
        .collect()
}

fn dependent(graph: &BondGraph, causality: &Causality, follows: &Follows) -> Vec<Dependent> {
    let mut left = MOST_BONDS;
    let mut reached_from = vec![u32::MAX; follows.starts.len()];
    let mut result = Vec::new();
    for (storage, kind) in graph.stores() {
        if is_integral(graph, causality, storage, kind) != Some(false) {
            continue;
        }
        let Some(bond) = graph.bond_at(storage) else { continue };
        // Backwards from what is imposed on it.
        let start = number(bond, kind.gives());
        let mut touched = vec![start];
        let mut queue = VecDeque::from([start]);
        reached_from[start as usize] = start;
        let (mut on, mut path) = (Vec::new(), Vec::new());
        while let Some(variable) = queue.pop_front().filter(|_| left > 0) {
            left -= 1;
            if (variable as usize) < 2 * graph.bonds.len() {
                let power = if variable.is_multiple_of(2) { Power::Effort } else { Power::Flow };
                let end = setter(graph, causality, BondId(variable / 2), power);
                if let Some(end) = end.filter(|end| determines(graph, causality, *end)) {
                    if on.is_empty() {
                        path = back(&reached_from, variable);
                    }
                    if !on.contains(&end) {
                        on.push(end);
                    }
                }
            }
            for &next in follows.of(variable as usize) {
                if reached_from[next as usize] == u32::MAX {
                    reached_from[next as usize] = variable;
                    touched.push(next);
                    queue.push_back(next);
                }
            }
        }
        for variable in touched {
            reached_from[variable as usize] = u32::MAX;
        }
        let bonds = path.into_iter().filter(|&v| (v as usize) < 2 * graph.bonds.len());
        let mut path: Vec<BondId> = bonds.map(|v| BondId(v / 2)).collect();
        path.dedup();
        result.push(Dependent { storage, on, path });
    }
    result
}

/// A source, or a storage in integral causality.
fn determines(graph: &BondGraph, causality: &Causality, end: End) -> bool {
    match graph.law_at(end) {
        Law::Source { .. } => true,
        Law::Store { kind, .. } | Law::Rate { kind, .. } => {
            is_integral(graph, causality, end, *kind) == Some(true)
        }
        _ => false,
    }
}

/// The variables from `variable` to where the search began.
fn back(reached_from: &[u32], variable: u32) -> Vec<u32> {
    let mut path = vec![variable];
    let mut at = variable;
    while reached_from[at as usize] != at {
        at = reached_from[at as usize];
        path.push(at);
    }
    path
}
