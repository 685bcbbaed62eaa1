//! The assignment itself: propagation through junctions and two-ports, choices in SCAP's order, and what to do where they
//! do not go together.
//!
//! Every vertex is one constraint: at a 0-junction exactly one bond brings the effort, at a 1-junction exactly one bond
//! brings the flow, through a transformer one of the two efforts comes in, through a gyrator both or none. A choice that
//! leads to a contradiction is turned round; where both ways do, the latest choice that took part in it is (conflict-directed
//! backjumping; Prosser, 1993). A contradiction that no choice takes part in is a conflict of what the graph says.

use super::super::fields;
use super::super::graph::*;
use super::{Causality, Conflict, is_modulated, stroke_for};
use std::collections::VecDeque;

/// Why a bond has its stroke.
#[derive(Clone, Debug)]
enum Reason {
    /// A source, or a stroke drawn in the text.
    Hard,
    /// The choice on this level.
    Choice(usize),
    /// The other way round was impossible, given the choices on these levels.
    Turned(Vec<usize>),
    /// Another bond of a vertex, which is the one that counts.
    One(BondId),
    /// All other bonds of this vertex.
    Others(VertexId),
}

/// A vertex whose bonds cannot go together; the bonds that clash.
struct Clash {
    at: VertexId,
    bonds: Vec<BondId>,
}

/// Something to decide: which stroke one would like a bond to have.
struct Wish {
    bond: BondId,
    stroke: Stroke,
}

struct Level {
    wish: usize,
    trail: usize,
}

struct Assignment<'a> {
    graph: &'a BondGraph,
    strokes: Vec<Option<Stroke>>,
    reasons: Vec<Reason>,
    /// Bonds in the order in which they got their strokes.
    trail: Vec<BondId>,
    /// Bonds without a stroke at each vertex, and bonds that bring what the junction is named for.
    open: Vec<u32>,
    bring: Vec<u32>,
    /// Bonds round a ring, which take no part.
    excluded: Vec<bool>,
    /// Vertices whose conflict has been reported: they ask for nothing more.
    broken: Vec<bool>,
    queue: VecDeque<VertexId>,
}

/// Assigns strokes; storages in integral causality are listed in their order.
pub fn strokes(graph: &BondGraph, rings: &[Vec<BondId>]) -> Causality {
    let mut assignment = Assignment::new(graph, rings);
    let mut conflicts = Vec::new();
    // Sources and detectors together, then strokes drawn in the text one by one.
    let mut hard: Vec<(BondId, Stroke, VertexId)> = Vec::new();
    for id in graph.vertex_ids() {
        if let (Law::Source { sets, .. }, Some(&bond)) =
            (&graph.vertex(id).law, graph.vertex(id).bonds.first())
        {
            let end = End { vertex: id, port: 0 };
            hard.push((bond, stroke_for(graph, bond, end, *sets == Power::Flow), id));
        }
    }
    let given = hard.len();
    hard.extend(graph.bond_ids().filter_map(|id| {
        let bond = graph.bond(id);
        Some((id, bond.given?, bond.from.vertex))
    }));
    for (at, &(bond, stroke, vertex)) in hard.iter().enumerate() {
        if at >= given {
            assignment.settle(&mut conflicts);
        }
        if assignment.excluded[bond.index()] {
            continue;
        }
        match assignment.strokes[bond.index()] {
            None => assignment.set(bond, stroke, Reason::Hard),
            Some(other) if other == stroke => {}
            Some(_) => {
                let mut conflict = assignment.conflict(&Clash { at: vertex, bonds: vec![bond] });
                if !conflict.elements.contains(&vertex) {
                    conflict.elements.push(vertex);
                }
                conflicts.push(conflict);
            }
        }
    }
    assignment.settle(&mut conflicts);
    let wishes = wishes(graph);
    assignment.fulfil(&wishes, &mut conflicts);
    let strokes = std::mem::take(&mut assignment.strokes);
    let mut causality = Causality { strokes, conflicts, ..Causality::default() };
    let states = by_preference(graph)
        .into_iter()
        .filter(|&(end, kind)| super::is_integral(graph, &causality, end, kind) == Some(true));
    causality.states = states.map(|(end, _)| end).collect();
    causality
}

/// Ports of storages: those with a stated initial value, then those with a non-linear law, then the others.
fn by_preference(graph: &BondGraph) -> Vec<(End, Storage)> {
    let mut storages: Vec<(bool, bool, End, Storage)> = graph
        .stores()
        .map(|(end, kind)| {
            let (stated, linear) = match graph.law_at(end) {
                Law::Store { law, initial, .. } => {
                    (!matches!(initial, StoreInitial::Unstated), is_linear(graph, end, law))
                }
                Law::Rate { initial, .. } => (matches!(initial, Initial::Given(_)), false),
                _ => (false, false),
            };
            (!stated, linear, end, kind)
        })
        .collect();
    storages.sort_by_key(|&(unstated, linear, end, _)| (unstated, linear, end));
    storages.into_iter().map(|(_, _, end, kind)| (end, kind)).collect()
}

fn is_linear(graph: &BondGraph, end: End, law: &StoreLaw) -> bool {
    match (&graph.vertex(end.vertex).law, law) {
        (Law::Field(Field { matrix: Some(rows), .. }), _) => {
            !rows.iter().flatten().any(is_modulated)
        }
        (_, StoreLaw::Linear(value)) => !is_modulated(value),
        _ => false,
    }
}

/// All that may be chosen, in SCAP's order.
fn wishes(graph: &BondGraph) -> Vec<Wish> {
    let mut wishes = Vec::new();
    let at_port = |wishes: &mut Vec<Wish>, end: End, receives_effort: bool| {
        if let Some(bond) = graph.bond_at(end) {
            wishes.push(Wish { bond, stroke: stroke_for(graph, bond, end, receives_effort) });
        }
    };
    for vertex in graph.vertex_ids() {
        if let Some(receives) = non_dividing(graph.vertex(vertex))
            && let [bond, _] = graph.vertex(vertex).bonds[..]
        {
            let end = End { vertex, port: 0 };
            wishes.push(Wish { bond, stroke: stroke_for(graph, bond, end, receives) });
        }
    }
    for (end, kind) in by_preference(graph) {
        at_port(&mut wishes, end, kind.integrates() == Power::Effort);
    }
    for written in [true, false] {
        for end in graph.vertex_ids().flat_map(|id| graph.law_ports(id)) {
            if let Law::Dissipator(law) = graph.law_at(end) {
                let receives = matches!(law, Dissipation::Flow(_));
                if written == is_written(graph, end, law) {
                    at_port(&mut wishes, end, receives);
                }
            }
        }
    }
    // What is left are bonds between junctions and two-ports that nothing decides.
    wishes.extend(graph.bond_ids().map(|bond| Wish { bond, stroke: Stroke::AtTo }));
    wishes
}

/// Whether a dissipator's law says which variable it gives; resistances, and fields of them, serve either way.
pub fn is_written(graph: &BondGraph, end: End, law: &Dissipation) -> bool {
    let field =
        matches!(&graph.vertex(end.vertex).law, Law::Field(field) if field.matrix.is_some());
    !field && !matches!(law, Dissipation::Linear(_))
}

/// Whether a modulated two-port receives the effort at port 1 where nothing is divided by its modulus; `None` for others.
pub fn non_dividing(vertex: &Vertex) -> Option<bool> {
    let (modulus, receives) = match &vertex.law {
        Law::Transformer(modulus @ Modulus::Ratio(_)) => (modulus, false),
        Law::Transformer(modulus @ Modulus::Gain(_)) => (modulus, true),
        Law::Gyrator(modulus @ Modulus::Ratio(_)) => (modulus, false),
        Law::Gyrator(modulus @ Modulus::Gain(_)) => (modulus, true),
        _ => return None,
    };
    let (Modulus::Ratio(value) | Modulus::Gain(value)) = modulus;
    is_modulated(value).then_some(receives)
}

impl<'a> Assignment<'a> {
    fn new(graph: &'a BondGraph, rings: &[Vec<BondId>]) -> Assignment<'a> {
        let (bonds, vertices) = (graph.bonds.len(), graph.vertices.len());
        let mut excluded = vec![false; bonds];
        for bond in rings.iter().flatten() {
            excluded[bond.index()] = true;
        }
        let open = graph
            .vertices
            .iter()
            .map(|v| v.bonds.iter().filter(|bond| !excluded[bond.index()]).count() as u32)
            .collect();
        Assignment {
            graph,
            strokes: vec![None; bonds],
            reasons: vec![Reason::Hard; bonds],
            trail: Vec::with_capacity(bonds),
            open,
            bring: vec![0; vertices],
            excluded,
            broken: vec![false; vertices],
            queue: VecDeque::new(),
        }
    }

    /// Whether the bond brings to this vertex what it needs exactly one of: effort at a 0-junction and through a
    /// transformer, flow at a 1-junction.
    fn brings(&self, bond: BondId, stroke: Stroke, vertex: VertexId) -> bool {
        let receives_effort =
            (self.graph.bond(bond).from.vertex == vertex) == (stroke == Stroke::AtFrom);
        receives_effort != matches!(self.graph.vertex(vertex).law, Law::One)
    }

    fn bringing(&self, bond: BondId, vertex: VertexId, bring: bool) -> Stroke {
        let receives_effort = bring != matches!(self.graph.vertex(vertex).law, Law::One);
        let at_tail = self.graph.bond(bond).from.vertex == vertex;
        if at_tail == receives_effort { Stroke::AtFrom } else { Stroke::AtTo }
    }

    fn set(&mut self, bond: BondId, stroke: Stroke, reason: Reason) {
        self.strokes[bond.index()] = Some(stroke);
        self.reasons[bond.index()] = reason;
        self.trail.push(bond);
        let ends = self.graph.bond(bond);
        for vertex in [ends.from.vertex, ends.to.vertex] {
            self.open[vertex.index()] -= 1;
            self.bring[vertex.index()] += u32::from(self.brings(bond, stroke, vertex));
            self.queue.push_back(vertex);
        }
    }

    fn undo(&mut self, trail: usize) {
        self.queue.clear();
        for bond in self.trail.split_off(trail) {
            let Some(stroke) = self.strokes[bond.index()].take() else { continue };
            let ends = self.graph.bond(bond);
            for vertex in [ends.from.vertex, ends.to.vertex] {
                self.open[vertex.index()] += 1;
                self.bring[vertex.index()] -= u32::from(self.brings(bond, stroke, vertex));
            }
        }
    }

    fn propagate(&mut self) -> Result<(), Clash> {
        while let Some(vertex) = self.queue.pop_front() {
            if self.broken[vertex.index()] {
                continue;
            }
            match &self.graph.vertex(vertex).law {
                Law::Zero | Law::One => self.junction(vertex)?,
                Law::Transformer(_) => self.two_port(vertex, false)?,
                Law::Gyrator(_) => self.two_port(vertex, true)?,
                Law::Field(_) => {
                    if let Some(alike) = fields::converts(self.graph, vertex) {
                        self.two_port(vertex, alike)?;
                    }
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// The bonds of a vertex that take part.
    fn bonds(&self, vertex: VertexId) -> impl Iterator<Item = BondId> + use<'a, '_> {
        self.graph.vertex(vertex).bonds.iter().copied().filter(|bond| !self.excluded[bond.index()])
    }

    fn is_bringing(&self, bond: BondId, vertex: VertexId) -> bool {
        self.strokes[bond.index()].is_some_and(|stroke| self.brings(bond, stroke, vertex))
    }

    fn junction(&mut self, vertex: VertexId) -> Result<(), Clash> {
        let (open, bring) = (self.open[vertex.index()], self.bring[vertex.index()]);
        match (bring, open) {
            (0, 0) if self.bonds(vertex).next().is_some() => {
                Err(Clash { at: vertex, bonds: self.bonds(vertex).collect() })
            }
            (0, 1) => {
                let last = self.bonds(vertex).find(|bond| self.strokes[bond.index()].is_none());
                if let Some(last) = last {
                    self.set(last, self.bringing(last, vertex, true), Reason::Others(vertex));
                }
                Ok(())
            }
            (1, 1..) => {
                let Some(one) = self.bonds(vertex).find(|&bond| self.is_bringing(bond, vertex))
                else {
                    return Ok(());
                };
                let others: Vec<BondId> = self
                    .bonds(vertex)
                    .filter(|bond| self.strokes[bond.index()].is_none())
                    .collect();
                for bond in others {
                    self.set(bond, self.bringing(bond, vertex, false), Reason::One(one));
                }
                Ok(())
            }
            (2.., _) => Err(Clash {
                at: vertex,
                bonds: self.bonds(vertex).filter(|&bond| self.is_bringing(bond, vertex)).collect(),
            }),
            _ => Ok(()),
        }
    }

    /// `alike`: both bonds bring the effort or none does (gyrator), else exactly one.
    fn two_port(&mut self, vertex: VertexId, alike: bool) -> Result<(), Clash> {
        let [a, b] = self.graph.vertex(vertex).bonds[..] else { return Ok(()) };
        for (this, other) in [(a, b), (b, a)] {
            if self.strokes[this.index()].is_some() && self.strokes[other.index()].is_none() {
                let bring = self.is_bringing(this, vertex) == alike;
                self.set(other, self.bringing(other, vertex, bring), Reason::One(this));
            }
        }
        let both = self.strokes[a.index()].is_some() && self.strokes[b.index()].is_some();
        if both && (self.is_bringing(a, vertex) == self.is_bringing(b, vertex)) != alike {
            return Err(Clash { at: vertex, bonds: vec![a, b] });
        }
        Ok(())
    }

    /// Propagates what is certain; conflicts are noted and their vertices ask for nothing more.
    fn settle(&mut self, conflicts: &mut Vec<Conflict>) {
        while let Err(clash) = self.propagate() {
            conflicts.push(self.conflict(&clash));
            self.broken[clash.at.index()] = true;
        }
    }

    /// Grants each wish in turn where it can be.
    fn fulfil(&mut self, wishes: &[Wish], conflicts: &mut Vec<Conflict>) {
        let mut levels: Vec<Level> = Vec::new();
        let mut patience = 20 * wishes.len() + 1000;
        let mut next = 0;
        while let Some(wish) = wishes.get(next) {
            if self.strokes[wish.bond.index()].is_some() || self.excluded[wish.bond.index()] {
                next += 1;
                continue;
            }
            levels.push(Level { wish: next, trail: self.trail.len() });
            self.set(wish.bond, wish.stroke, Reason::Choice(levels.len() - 1));
            next += 1;
            while let Err(clash) = self.propagate() {
                let mut took_part = self.choices(&clash.bonds);
                let Some(&latest) = took_part.last().filter(|_| patience > 0) else {
                    // No choice can mend it (or too many were tried): the graph itself is at fault.
                    conflicts.push(self.conflict(&clash));
                    self.broken[clash.at.index()] = true;
                    let trail = levels.last().map_or(0, |level| level.trail);
                    if let Some(level) = levels.pop() {
                        next = level.wish;
                    }
                    self.undo(trail);
                    continue;
                };
                patience -= 1;
                took_part.pop();
                let (wish, trail) = (levels[latest].wish, levels[latest].trail);
                self.undo(trail);
                levels.truncate(latest + 1);
                let wish_again = &wishes[wish];
                let turned = match wish_again.stroke {
                    Stroke::AtFrom => Stroke::AtTo,
                    Stroke::AtTo => Stroke::AtFrom,
                };
                self.set(wish_again.bond, turned, Reason::Turned(took_part));
                next = wish + 1;
            }
        }
    }

    /// The levels of the choices that bonds' strokes follow from, ascending.
    fn choices(&self, bonds: &[BondId]) -> Vec<usize> {
        let mut levels = Vec::new();
        self.walk(bonds, &mut |_, reason| match reason {
            Reason::Choice(level) => levels.push(*level),
            Reason::Turned(others) => levels.extend(others),
            _ => {}
        });
        levels.sort_unstable();
        levels.dedup();
        levels
    }

    /// Visits all bonds that these strokes follow from, breadth first; returns for each bond the one it was reached from.
    fn walk(
        &self,
        bonds: &[BondId],
        visit: &mut dyn FnMut(BondId, &Reason),
    ) -> std::collections::HashMap<BondId, BondId> {
        let mut from = std::collections::HashMap::new();
        let mut queue: VecDeque<BondId> = bonds.iter().copied().collect();
        for &bond in bonds {
            from.insert(bond, bond);
        }
        while let Some(bond) = queue.pop_front() {
            let reason = &self.reasons[bond.index()];
            visit(bond, reason);
            let mut reach = |next: BondId| {
                if let std::collections::hash_map::Entry::Vacant(entry) = from.entry(next) {
                    entry.insert(bond);
                    queue.push_back(next);
                }
            };
            match reason {
                Reason::One(one) => reach(*one),
                Reason::Others(vertex) => {
                    self.bonds(*vertex).filter(|&other| other != bond).for_each(&mut reach);
                }
                _ => {}
            }
        }
        from
    }

    /// Who fights, and along which bonds: from each clashing bond back to the nearest source, drawn stroke or choice.
    fn conflict(&self, clash: &Clash) -> Conflict {
        const MOST: usize = 8;
        let mut elements: Vec<VertexId> = Vec::new();
        let mut path: Vec<BondId> = Vec::new();
        let mut bonds: Vec<BondId> = clash.bonds.clone();
        // The clashing bonds that were there first say most.
        bonds.truncate(MOST);
        for bond in bonds {
            let mut root = None;
            let from = self.walk(&[bond], &mut |at, reason| {
                if root.is_none()
                    && matches!(reason, Reason::Hard | Reason::Choice(_) | Reason::Turned(_))
                {
                    root = Some(at);
                }
            });
            let Some(root) = root else { continue };
            let mut side = vec![root];
            let mut at = root;
            while let Some(&next) = from.get(&at).filter(|&&next| next != at) {
                side.push(next);
                at = next;
            }
            let element = self.imposer(root);
            if !elements.contains(&element) {
                elements.push(element);
            }
            // The first side runs towards the vertex, the others away from it.
            if path.is_empty() {
                path = side;
            } else {
                side.reverse();
                path.extend(
                    side.into_iter().filter(|bond| !path.contains(bond)).collect::<Vec<_>>(),
                );
            }
        }
        Conflict { at: clash.at, elements, path }
    }

    /// The element at a bond that decided its stroke: its one-port, else the tail.
    fn imposer(&self, bond: BondId) -> VertexId {
        let ends = self.graph.bond(bond);
        let weight = |vertex: VertexId| match self.graph.vertex(vertex).law {
            Law::Source { .. } => 0,
            Law::Zero | Law::One => 3,
            Law::Transformer(_) | Law::Gyrator(_) => 2,
            _ => 1,
        };
        if weight(ends.to.vertex) < weight(ends.from.vertex) {
            ends.to.vertex
        } else {
            ends.from.vertex
        }
    }
}
