//! Bonds: which ports they join, and whether every port has what it needs.

use super::scope::{Scope, a};
use crate::bond::graph::*;
use crate::bond::syntax::{Arrow, ChainEnd, Path};
use crate::diagnostic::Diagnostic;
use crate::quantity::Domain;
use crate::source::Span;

/// One end of an arrow, before ports are given out.
#[derive(Clone, Copy)]
struct Joint {
    vertex: VertexId,
    /// The port as named, from 0.
    named: Option<u32>,
    /// Where the name stands.
    span: Span,
    /// Where all of the end stands, kind and arguments included.
    whole: Span,
}

/// What joins a vertex: the bond, whether at its head, and the joint.
type Joined = (BondId, bool, Joint);

impl Scope<'_> {
    /// Makes a bond of every arrow, gives out ports, and checks their numbers.
    pub fn join_bonds(&mut self, d: &mut Vec<Diagnostic>) {
        let mut joined: Vec<Vec<Joined>> = vec![vec![]; self.graph.vertices.len()];
        let mut incomplete: Vec<VertexId> = vec![];
        let chains = std::mem::take(&mut self.chains);
        for chain in &chains {
            let first: Vec<_> =
                chain.first.iter().map(|end| self.joint(end, &mut incomplete, d)).collect();
            let mut from = first.last().copied().flatten();
            for (arrow, ends) in &chain.links {
                let mut last = None;
                for end in ends {
                    let to = self.joint(end, &mut incomplete, d);
                    match (from, to) {
                        (Some(from), Some(to)) => self.join(from, to, arrow, &mut joined, d),
                        // The other end has been reported: do not count this one's bonds.
                        (one, other) => incomplete.extend(one.or(other).map(|j| j.vertex)),
                    }
                    last = to;
                }
                from = last;
            }
        }
        self.chains = chains;
        // A statement that could not be read may hold the bonds that seem to be missing.
        for id in self.graph.vertex_ids().collect::<Vec<_>>() {
            let excused = self.excused.contains(self.graph.vertex(id).name.as_str());
            let whole = !incomplete.contains(&id) && !excused;
            self.give_ports(id, &joined[id.index()], whole, d);
        }
        self.check_sources(d);
    }

    /// The end of an arrow; an error has been reported when there is none, and `incomplete` learns whose bond is missing.
    fn joint(
        &self,
        end: &ChainEnd,
        incomplete: &mut Vec<VertexId>,
        d: &mut Vec<Diagnostic>,
    ) -> Option<Joint> {
        let vertex = self.vertex(&end.path, d)?;
        let Some(named) = self.port(vertex, &end.path, d) else {
            incomplete.push(vertex);
            return None;
        };
        Some(Joint { vertex, named, span: end.path.span, whole: end.span })
    }

    /// The port that a path names: `Some(None)` when it names none, `None` when it names a wrong one.
    pub fn port(
        &self,
        vertex: VertexId,
        path: &Path,
        d: &mut Vec<Diagnostic>,
    ) -> Option<Option<u32>> {
        let Some(member) = path.members.first() else { return Some(None) };
        let declaration = self.declarations[vertex.index()];
        let (name, noun) = (&path.name.text, declaration.element.noun);
        let span = path.members.iter().fold(member.span, |span, member| span.join(member.span));
        let two_port = declaration.element.shape.is_two_port();
        match member.text.as_str() {
            "1" if two_port && path.members.len() == 1 => return Some(Some(0)),
            "2" if two_port && path.members.len() == 1 => return Some(Some(1)),
            _ => {}
        }
        let error =
            Diagnostic::error("E0410", span, format!("`{name}` has no port `{}`", member.text))
                .says("no such port")
                .label(declaration.span, format!("`{name}` is {}", a(noun)));
        d.push(if two_port {
            error.help(format!("the ports of {} are `{name}.1` and `{name}.2`", a(noun)))
        } else {
            error.help(format!("the ports of {} have no names: write `{name}`", a(noun)))
        });
        None
    }

    fn join(
        &mut self,
        from: Joint,
        to: Joint,
        arrow: &Arrow,
        joined: &mut [Vec<Joined>],
        d: &mut Vec<Diagnostic>,
    ) {
        // Of several ends in a list each has its own place: only the first stands right behind the arrow.
        let behind = self.map.text(Span { start: arrow.span.end, end: to.whole.start, ..to.whole });
        let span = if behind.contains(',') { to.whole } else { from.whole.join(to.whole) };
        let id = BondId(self.graph.bonds.len() as u32);
        if from.vertex == to.vertex {
            d.push(
                Diagnostic::error(
                    "E0405",
                    span,
                    format!("`{}` is joined to itself", self.graph.vertex(from.vertex).name),
                )
                .says("a bond joins two different elements"),
            );
        }
        let end = |joint: Joint| End { vertex: joint.vertex, port: joint.named.unwrap_or(0) };
        self.graph.bonds.push(Bond {
            from: end(from),
            to: end(to),
            given: arrow.stroke,
            domain: Domain::Any,
            span,
        });
        joined[from.vertex.index()].push((id, false, from));
        joined[to.vertex.index()].push((id, true, to));
    }

    fn give_ports(
        &mut self,
        id: VertexId,
        joined: &[Joined],
        whole: bool,
        d: &mut Vec<Diagnostic>,
    ) {
        let declaration = self.declarations[id.index()];
        let shape = declaration.element.shape;
        let (name, noun) = (&declaration.name.text, declaration.element.noun);
        let bonds: Vec<BondId> = joined.iter().map(|(bond, ..)| *bond).collect();
        if shape.is_two_port() {
            return self.give_two_ports(id, joined, whole, d);
        }
        let least = if shape.is_junction() { 2 } else { 1 };
        if bonds.len() < least && whole {
            let error = if bonds.is_empty() {
                Diagnostic::error("E0403", declaration.span, format!("no bond joins `{name}`"))
                    .says(format!("this {noun} stands alone"))
            } else {
                Diagnostic::error(
                    "E0401",
                    declaration.span,
                    format!("the {noun} `{name}` has only one bond"),
                )
                .says("a junction joins at least two")
                .label(self.graph.bond(bonds[0]).span, "its only bond")
            };
            d.push(error.help(format!("join it with an arrow, as in `{name} -> …`")));
        }
        if !shape.is_junction() && bonds.len() > 1 {
            let mut error = Diagnostic::error(
                "E0402",
                joined[1].2.span,
                format!("the {noun} `{name}` has {} bonds, but only one port", bonds.len()),
            )
            .says("a second bond for the same port");
            for (_, _, joint) in joined.iter().filter(|j| j.2.span != joined[1].2.span) {
                error = error.label(joint.span, "joined here");
            }
            d.push(error.help(format!(
                "put a 0-junction (common effort) or a 1-junction (common flow) between them and \
                 join `{name}` to it"
            )));
        }
        self.graph.vertices[id.index()].bonds = bonds;
    }

    /// The first port is the incoming bond, the second the outgoing one, or as named.
    fn give_two_ports(
        &mut self,
        id: VertexId,
        joined: &[Joined],
        whole: bool,
        d: &mut Vec<Diagnostic>,
    ) {
        let declaration = self.declarations[id.index()];
        let (name, noun) = (&declaration.name.text, declaration.element.noun);
        let mut ports: [Option<Joined>; 2] = [None, None];
        let (named, unnamed): (Vec<Joined>, Vec<Joined>) =
            joined.iter().partition(|(_, _, joint)| joint.named.is_some());
        for (bond, head, joint) in named.into_iter().chain(unnamed) {
            let port = joint.named.unwrap_or(u32::from(!head));
            let slot = &mut ports[port as usize];
            let Some(first) = slot else {
                *slot = Some((bond, head, joint));
                continue;
            };
            if joined.len() > 2 {
                // Too many bonds: said once, below.
                continue;
            }
            if joint.named.is_some() {
                d.push(
                    Diagnostic::error(
                        "E0409",
                        joint.span,
                        format!("port {} of the {noun} `{name}` has two bonds", port + 1),
                    )
                    .says("joined again here")
                    .label(first.2.span, "first joined here"),
                );
                continue;
            }
            let way = if head { "points into" } else { "points out of" };
            let mut edits = vec![(joint.span, format!("{name}.{}", 2 - port))];
            if first.2.named.is_none() {
                edits.insert(0, (first.2.span, format!("{name}.{}", port + 1)));
            }
            let mut error = Diagnostic::error(
                "E0409",
                joint.span,
                format!("which bond of the {noun} `{name}` is which port?"),
            )
            .says(format!("this half arrow {way} it"))
            .label(
                first.2.span,
                if first.2.named.is_some() { "this port is taken" } else { "and so does this one" },
            )
            .because(
                "port 1 is the incoming bond and port 2 the outgoing one, unless they are named",
            )
            .help(format!("name the ports: `{name}.1` and `{name}.2`"));
            // An element declared in place keeps its kind: only plain names can be edited for certain.
            if edits.iter().all(|(span, _)| !declaration.span.join(*span).eq(&declaration.span)) {
                error = error.fix("name the ports in the order of the file", edits);
            }
            d.push(error);
        }
        if joined.len() > 2 {
            let mut error = Diagnostic::error(
                "E0402",
                joined[2].2.span,
                format!("the {noun} `{name}` has {} bonds, but only two ports", joined.len()),
            )
            .says("a third bond for two ports");
            for (_, _, joint) in &joined[..2] {
                error = error.label(joint.span, "joined here");
            }
            d.push(error);
        }
        if joined.len() < 2 && whole {
            let mut error = Diagnostic::error(
                "E0403",
                declaration.span,
                format!(
                    "the {noun} `{name}` has {}",
                    if joined.is_empty() { "no bond" } else { "only one bond" }
                ),
            )
            .says("it joins two");
            if let Some((bond, ..)) = joined.first() {
                error = error.label(self.graph.bond(*bond).span, "its only bond");
            }
            d.push(error.help(format!("write what it leads to, as in `… -> {name} -> …`")));
        }
        for (port, slot) in (0..).zip(&ports) {
            let Some((bond, head, _)) = slot else { continue };
            let bond = &mut self.graph.bonds[bond.index()];
            let end = if *head { &mut bond.to } else { &mut bond.from };
            end.port = port;
        }
        self.graph.vertices[id.index()].bonds =
            ports.iter().flatten().map(|(bond, ..)| *bond).collect();
    }

    /// Bonds both of whose ends impose the same variable.
    fn check_sources(&self, d: &mut Vec<Diagnostic>) {
        for bond in &self.graph.bonds {
            let declaration = |end: End| self.declarations[end.vertex.index()];
            let (from, to) = (declaration(bond.from), declaration(bond.to));
            let sets = from.element.shape.sets();
            if bond.from.vertex == bond.to.vertex
                || sets.is_none()
                || sets != to.element.shape.sets()
            {
                continue;
            }
            let word = if sets == Some(Power::Effort) { "effort" } else { "flow" };
            d.push(
                Diagnostic::error(
                    "E0404",
                    bond.span,
                    format!(
                        "`{}` and `{}` both impose the {word} of their bond",
                        from.name.text, to.name.text
                    ),
                )
                .says(format!("its {word} is set from both ends"))
                .label(from.span, format!("this {} sets the {word}", from.element.noun))
                .label(to.span, format!("and so does this {}", to.element.noun))
                .help("remove one of them, or join them through an element that takes up the difference"),
            );
        }
    }
}
