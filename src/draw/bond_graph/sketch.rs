//! What a drawing shows before anything has a place: nodes, links, and the boxes of instances, deep ones as one node each.

use super::super::text::cut;
use super::signals::{self, Signals};
use crate::bond::causality::Causality;
use crate::bond::graph::{
    BondGraph, BondId, Dissipation, Expr, Law, Leaf, Modulus, Storage, StoreLaw, Stroke, VertexId,
};
use crate::bond::words;
use crate::quantity::Domain;

/// Letters of a value that are shown; the whole is told where a pointer rests.
const SHOWN: usize = 18;

/// What a node is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NodeKind {
    /// A 0- or 1-junction.
    Junction,
    /// An element with one port.
    Element,
    /// A two-port or a field.
    Between,
    /// A whole instance, drawn as one.
    Part,
}

/// A junction, an element, or an instance that is drawn as one.
#[derive(Clone, Debug)]
pub struct Node {
    /// What is written large: `1`, `R: eta`.
    pub title: String,
    /// What is written below: a junction's name, an element's value, an instance's model.
    pub below: String,
    /// Whether that speaks of a signal.
    pub modulated: bool,
    /// All that is known of it, in words.
    pub told: String,
    /// Its kind and full name, `R:motor.R`; empty for an instance that is drawn as one.
    pub of: String,
    /// What it is.
    pub kind: NodeKind,
    /// Whether it is a storage in derivative causality.
    pub dependent: bool,
    /// The box it stands in: an index into [`Sketch::groups`].
    pub group: usize,
    /// The domain of its bonds; `Any` where they differ.
    pub domain: Domain,
}

/// A bond that is drawn.
#[derive(Clone, Copy, Debug)]
pub struct Link {
    /// The node at its tail.
    pub from: usize,
    /// The node at its head.
    pub to: usize,
    /// Which bond.
    pub bond: BondId,
    /// Its domain.
    pub domain: Domain,
    /// Where its causal stroke stands.
    pub stroke: Option<Stroke>,
    /// Whether the stroke is that of a storage in derivative causality.
    pub dependent: bool,
    /// The algebraic loop that it is part of, from 1 on; 0 for none.
    pub ring: usize,
}

/// A box around the parts of an instance; the first is the whole.
#[derive(Clone, Debug)]
pub struct Group {
    /// Its name within what is around it.
    pub name: String,
    /// Its model.
    pub model: String,
    /// What is around it.
    pub parent: Option<usize>,
}

/// What a drawing shows.
#[derive(Clone, Debug, Default)]
pub struct Sketch {
    /// What stands above it.
    pub title: String,
    /// Junctions, elements, and instances drawn as one.
    pub nodes: Vec<Node>,
    /// Bonds between them.
    pub links: Vec<Link>,
    /// The whole, then the boxes of instances.
    pub groups: Vec<Group>,
    /// Algebraic loops.
    pub loops: usize,
    /// What carries no power.
    pub signals: Signals,
    /// How deep instances are laid open.
    pub depth: usize,
    /// How deep they could be.
    pub deepest: usize,
}

/// Makes the sketch of a graph with instances laid open to a depth.
pub fn sketch(graph: &BondGraph, causality: &Causality, depth: usize) -> Sketch {
    let levels = levels(graph);
    let mut sketch = Sketch {
        title: format!("{}: bond graph, order {}", graph.name, causality.order),
        loops: causality.loops.len(),
        deepest: levels.iter().copied().max().unwrap_or(0),
        ..Sketch::default()
    };
    sketch.depth = depth.min(sketch.deepest);
    // The file itself, also where the graph came from no text.
    let whole = Group { name: String::new(), model: graph.name.clone(), parent: None };
    sketch.groups.push(whole);
    let mut group_of = vec![0; graph.tree.len().max(1)];
    let mut part_of = vec![None; graph.tree.len().max(1)];
    for (k, instance) in graph.tree.iter().enumerate().skip(1) {
        let parent = instance.parent.map_or(0, |parent| parent as usize);
        let inside = graph.tree.get(parent).map_or("", |parent| parent.name.as_str());
        let name = within(&instance.name, inside).to_string();
        if let Some(part) = part_of[parent] {
            part_of[k] = Some(part);
        } else if levels[k] > depth {
            part_of[k] = Some(sketch.nodes.len());
            sketch.nodes.push(Node {
                title: name,
                below: instance.model.clone(),
                modulated: false,
                told: format!("{}: {}", instance.model, instance.name),
                of: String::new(),
                kind: NodeKind::Part,
                dependent: false,
                group: group_of[parent],
                domain: Domain::Any,
            });
        } else {
            group_of[k] = sketch.groups.len();
            let parent = Some(group_of[parent]);
            sketch.groups.push(Group { name, model: instance.model.clone(), parent });
        }
    }
    let homes = graph.homes();
    let mut node_of = vec![];
    for id in graph.vertex_ids() {
        let home = homes.of(&graph.vertex(id).name) as usize;
        node_of.push(part_of[home].unwrap_or(sketch.nodes.len()));
        if part_of[home].is_none() {
            let name = graph.tree.get(home).map_or("", |home| home.name.as_str());
            sketch.nodes.push(node(graph, causality, id, name, group_of[home]));
        }
    }
    for id in graph.bond_ids() {
        let bond = graph.bond(id);
        let (from, to) = (node_of[bond.from.vertex.index()], node_of[bond.to.vertex.index()]);
        if from == to {
            continue;
        }
        let dependent = causality.dependent.iter().any(|d| graph.bond_at(d.storage) == Some(id));
        let ring = causality.loops.iter().position(|found| found.path.contains(&id));
        sketch.links.push(Link {
            from,
            to,
            bond: id,
            domain: bond.domain,
            stroke: causality.strokes.get(id.index()).copied().flatten(),
            dependent,
            ring: ring.map_or(0, |ring| ring + 1),
        });
    }
    let closed: Vec<bool> = part_of.iter().map(Option::is_some).collect();
    let title = |node: usize| sketch.nodes[node].title.clone();
    sketch.signals = signals::read(graph, &closed, &node_of, &title);
    for k in 0..sketch.nodes.len() {
        let mut domains =
            sketch.links.iter().filter(|l| l.from == k || l.to == k).map(|l| l.domain);
        let first = domains.next().unwrap_or_default();
        sketch.nodes[k].domain = if domains.all(|d| d == first) { first } else { Domain::Any };
    }
    sketch
}

/// The sketch with as much laid open as one picture holds.
///
/// # Errors
/// How large it is, where it is too large even with all instances closed.
pub fn fitting(graph: &BondGraph, causality: &Causality) -> Result<Sketch, usize> {
    let whole = sketch(graph, causality, usize::MAX);
    let depths = (0..whole.depth).rev();
    let size = whole.nodes.len();
    let all = std::iter::once(whole).chain(depths.map(|depth| sketch(graph, causality, depth)));
    all.into_iter().find(|sketch| sketch.nodes.len() <= super::MOST).ok_or(size)
}

/// How deep each instance lies; 0 for the file.
fn levels(graph: &BondGraph) -> Vec<usize> {
    let mut levels = vec![0; graph.tree.len()];
    for (k, instance) in graph.tree.iter().enumerate().skip(1) {
        levels[k] = 1 + instance.parent.map_or(0, |parent| levels[parent as usize]);
    }
    levels
}

/// A name without that of what it stands in.
fn within<'n>(name: &'n str, inside: &str) -> &'n str {
    name.strip_prefix(inside).and_then(|rest| rest.strip_prefix('.')).unwrap_or(name)
}

fn node(graph: &BondGraph, causality: &Causality, id: VertexId, home: &str, group: usize) -> Node {
    let vertex = graph.vertex(id);
    let name = within(&vertex.name, home);
    let (kind, value) = match &vertex.law {
        Law::Zero | Law::One => (NodeKind::Junction, None),
        Law::Transformer(_) | Law::Gyrator(_) | Law::Field(_) => {
            (NodeKind::Between, value(graph, &vertex.law))
        }
        law => (NodeKind::Element, value(graph, law)),
    };
    let mut modulated = false;
    vertex.law.expressions(&mut |expr| {
        expr.leaves(&mut |leaf, _| modulated |= matches!(leaf, Leaf::Signal(_)));
    });
    let value = value.map(|text| match home {
        "" => text,
        home => text.replace(&format!("{home}."), ""),
    });
    let (title, below) = match kind {
        NodeKind::Junction => (vertex.kind.to_string(), cut(name, 24)),
        _ => {
            let shown = value.filter(|value| value != name).unwrap_or_default();
            (format!("{}: {}", vertex.kind, cut(name, 24)), cut(&shown, SHOWN))
        }
    };
    Node {
        title,
        below,
        modulated,
        told: format!("{}:{}, {}", vertex.kind, vertex.name, words::law(graph, &vertex.law)),
        of: format!("{}:{}", vertex.kind, vertex.name),
        kind,
        dependent: causality.dependent.iter().any(|d| d.storage.vertex == id),
        group,
        domain: Domain::Any,
    }
}

/// The value of an element as one writes it beside its letter.
fn value(graph: &BondGraph, law: &Law) -> Option<String> {
    let text = |expr: &Expr| words::expression(graph, expr);
    let reciprocal = |expr: &Expr| {
        let text = text(expr);
        let plain = text.chars().all(|c| c.is_alphanumeric() || "_.[]".contains(c));
        if plain { format!("1/{text}") } else { format!("1/({text})") }
    };
    let stored = |kind: Storage| match kind {
        Storage::Compliance => "q",
        Storage::Inertia => "p",
    };
    Some(match law {
        Law::Zero | Law::One | Law::Source { detector: true, .. } => return None,
        Law::Source { value, .. } => text(value),
        Law::Dissipator(Dissipation::Linear(value)) => text(value),
        Law::Dissipator(Dissipation::Effort(law)) => format!("e = {}", text(law)),
        Law::Dissipator(Dissipation::Flow(law)) => format!("f = {}", text(law)),
        Law::Store { law: StoreLaw::Linear(value), .. } => text(value),
        Law::Store { kind, law: StoreLaw::OfStored(law), .. } => {
            let own = words::expression_with(graph, law, stored(*kind));
            format!("{} = {own}", words::letter(kind.gives()))
        }
        Law::Store { kind, law: StoreLaw::OfPower(law), .. } => {
            format!("{} = {}", stored(*kind), text(law))
        }
        Law::Rate { kind, rate, .. } => {
            format!("d{}/dt = {}", words::letter(kind.gives()), text(rate))
        }
        Law::Transformer(Modulus::Ratio(ratio)) | Law::Gyrator(Modulus::Ratio(ratio)) => {
            text(ratio)
        }
        Law::Transformer(Modulus::Gain(gain)) | Law::Gyrator(Modulus::Gain(gain)) => {
            reciprocal(gain)
        }
        Law::Field(field) => format!("{} ports", field.ports.len()),
    })
}
