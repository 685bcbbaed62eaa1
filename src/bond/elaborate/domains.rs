//! Domains of bonds: groups that junctions hold together, what told the domain of each, and how two-ports change it.

use super::scope::Scope;
use super::stated::{Mask, bit, domains};
use crate::bond::elements::Shape;
use crate::bond::graph::*;
use crate::diagnostic::Diagnostic;
use crate::quantity::{DOMAINS, Dimension, Domain};
use crate::source::Span;
use std::collections::{HashMap, VecDeque};

/// The bonds of one domain: all those of a junction, and so on along the junctions.
#[derive(Debug, Default)]
pub(super) struct Groups {
    /// By bond.
    pub of: Vec<u32>,
    /// Bonds in the order of their groups, and where each group begins.
    bonds: Vec<BondId>,
    begins: Vec<u32>,
    /// By group: its domain and who told it.
    pub told: Vec<Option<Told>>,
}

/// What told the domain of a group.
#[derive(Clone, Copy, Debug)]
pub(super) struct Told {
    pub domain: Domain,
    pub by: By,
}

/// Who told it.
#[derive(Clone, Copy, Debug)]
pub(super) enum By {
    /// The units of an element.
    Element(VertexId),
    /// The port of a model, which names the domain here.
    Port(Span),
    /// Another group, across a two-port.
    Across(VertexId, u32),
}

impl Groups {
    /// The groups of a graph's bonds.
    pub fn new(graph: &BondGraph, is_junction: impl Fn(VertexId) -> bool) -> Groups {
        let count = graph.bonds.len();
        let mut parent: Vec<u32> = (0..count as u32).collect();
        fn root(parent: &mut [u32], mut at: u32) -> u32 {
            while parent[at as usize] != at {
                let above = parent[parent[at as usize] as usize];
                parent[at as usize] = above;
                at = above;
            }
            at
        }
        for id in graph.vertex_ids().filter(|id| is_junction(*id)) {
            for pair in graph.vertex(id).bonds.windows(2) {
                let (a, b) = (root(&mut parent, pair[0].0), root(&mut parent, pair[1].0));
                // Towards the first in the file, so that groups are numbered alike in every run.
                parent[a.max(b) as usize] = a.min(b);
            }
        }
        let mut number = vec![u32::MAX; count];
        let mut sizes: Vec<u32> = vec![];
        let mut of = Vec::with_capacity(count);
        for bond in 0..count as u32 {
            let slot = &mut number[root(&mut parent, bond) as usize];
            if *slot == u32::MAX {
                *slot = sizes.len() as u32;
                sizes.push(0);
            }
            sizes[*slot as usize] += 1;
            of.push(*slot);
        }
        let mut begins = vec![0; sizes.len() + 1];
        for (k, size) in sizes.iter().enumerate() {
            begins[k + 1] = begins[k] + size;
        }
        let mut next = begins.clone();
        let mut bonds = vec![BondId(0); count];
        for (bond, group) in of.iter().enumerate() {
            let at = &mut next[*group as usize];
            bonds[*at as usize] = BondId(bond as u32);
            *at += 1;
        }
        Groups { of, bonds, told: vec![None; sizes.len()], begins }
    }

    /// The group of a bond.
    pub fn group(&self, bond: BondId) -> u32 {
        self.of[bond.index()]
    }

    /// The bonds of a group.
    pub fn bonds(&self, group: u32) -> &[BondId] {
        let k = group as usize;
        &self.bonds[self.begins[k] as usize..self.begins[k + 1] as usize]
    }

    /// What is known of a bond's domain.
    pub fn told(&self, bond: BondId) -> Option<Told> {
        self.told.get(*self.of.get(bond.index())? as usize).copied().flatten()
    }
}

/// What elements say of the domain of one group: the one that most say wins. Where several are left, whether they share
/// what is known of them or as many elements speak for each, these are the error (0 where nothing is said), so that a
/// two-port can decide; unless it shall be guessed: then what all elements share goes to the likelier, which stands first
/// in the table, and what they contend for to the element that stands first in the text (not to a magnetic one, which is
/// mostly an electrical source of the wrong kind).
pub(super) fn winner(votes: &[(VertexId, Mask)], guess: bool) -> Result<(Domain, VertexId), Mask> {
    let mut tally = [0usize; DOMAINS.len()];
    let mut common = Mask::MAX;
    for (_, mask) in votes {
        for domain in domains(*mask) {
            tally[domain as usize] += 1;
        }
        common &= *mask;
    }
    let most = tally.iter().copied().max().filter(|most| *most > 0).ok_or(0 as Mask)?;
    let best: Mask = domains(Mask::MAX)
        .filter(|domain| tally[*domain as usize] == most)
        .map(bit)
        .fold(0, |all, one| all | one);
    if best.count_ones() > 1 && !guess {
        return Err(best);
    }
    let mut in_order: Vec<&(VertexId, Mask)> = votes.iter().collect();
    in_order.sort_unstable_by_key(|(id, _)| *id);
    // Who says it alone before who says it with others.
    let says = |domain| in_order.iter().find(|(_, mask)| *mask == bit(domain));
    // A source of the wrong kind, a flow of volts or an effort of amperes, looks magnetic.
    let sure = domains(best)
        .filter_map(|domain| says(domain).map(|(id, _)| (domain == Domain::Magnetic, *id, domain)))
        .min_by_key(|(magnetic, id, _)| (*magnetic, *id));
    let shared = common & best == best;
    let domain = match sure {
        Some((.., domain)) if !shared => domain,
        _ => domains(best).next().ok_or(best)?,
    };
    let by = says(domain).or_else(|| in_order.iter().find(|(_, mask)| mask & bit(domain) != 0));
    by.map(|by| (domain, by.0)).ok_or(best)
}

/// The effort and the flow on the other side of a two-port. `first`: the known one is at port 1.
///
/// Transformer: [r] = [e1]/[e2] = [f2]/[f1]. Gyrator: [r] = [e1]/[f2] = [e2]/[f1]. A gain is the inverse.
pub(super) fn across(
    shape: Shape,
    domain: Domain,
    first: bool,
    modulus: Dimension,
    gain: bool,
) -> Option<(Dimension, Dimension)> {
    let ratio = if gain { modulus.power(-1, 1)? } else { modulus };
    let row = domain.row();
    Some(match (shape, first) {
        (Shape::Transformer, true) => {
            (row.effort_dimension.over(ratio)?, row.flow_dimension.times(ratio)?)
        }
        (Shape::Transformer, false) => {
            (row.effort_dimension.times(ratio)?, row.flow_dimension.over(ratio)?)
        }
        // The gyrator's law is the same from either side.
        _ => (row.flow_dimension.times(ratio)?, row.effort_dimension.over(ratio)?),
    })
}

/// The domain of an effort and a flow.
pub(super) fn domain_of((effort, flow): (Dimension, Dimension)) -> Option<Domain> {
    Domain::find(|row| row.effort_dimension == effort && row.flow_dimension == flow)
}

impl Scope<'_> {
    /// Points at what told a domain: the element or port at the root of it, and the two-ports on the way.
    pub(super) fn point_at_told(&self, mut error: Diagnostic, told: Told) -> Diagnostic {
        let mut told = told;
        let mut steps = 0;
        loop {
            let domain = told.domain.name();
            match told.by {
                By::Element(id) => {
                    let name = &self.graph.vertex(id).name;
                    let span = self.declarations[id.index()].span;
                    return error.label(span, format!("`{name}` is {domain}"));
                }
                By::Port(span) => return error.label(span, format!("declared as {domain}")),
                By::Across(id, from) => {
                    let name = &self.graph.vertex(id).name;
                    let span = self.declarations[id.index()].span;
                    if steps < 3 {
                        error = error.label(span, format!("`{name}` leads to {domain}"));
                    }
                    steps += 1;
                    match self.units.groups.told.get(from as usize).copied().flatten() {
                        Some(before) => told = before,
                        None => return error,
                    }
                }
            }
        }
    }

    /// The element at the root of what told a domain.
    pub(super) fn root_of(&self, mut told: Told) -> Option<VertexId> {
        loop {
            match told.by {
                By::Element(id) => return Some(id),
                By::Port(_) => return None,
                By::Across(_, from) => {
                    told = self.units.groups.told.get(from as usize).copied()??
                }
            }
        }
    }

    /// The way along bonds from one element to another, `U -> mesh -> R`; `None` for neighbours.
    pub(super) fn way(&self, from: VertexId, to: VertexId) -> Option<String> {
        let mut came: HashMap<VertexId, BondId> = HashMap::new();
        let mut queue = VecDeque::from([from]);
        while let Some(at) = queue.pop_front() {
            if at == to {
                break;
            }
            for bond in &self.graph.vertex(at).bonds {
                let Bond { from: tail, to: head, .. } = self.graph.bond(*bond);
                let other = if tail.vertex == at { head.vertex } else { tail.vertex };
                if other != from && !came.contains_key(&other) {
                    came.insert(other, *bond);
                    queue.push_back(other);
                }
            }
        }
        let mut names = vec![format!("`{}`", self.graph.vertex(to).name)];
        let mut at = to;
        while at != from {
            let bond = self.graph.bond(*came.get(&at)?);
            at = if bond.to.vertex == at { bond.from.vertex } else { bond.to.vertex };
            names.push(format!("`{}`", self.graph.vertex(at).name));
        }
        names.reverse();
        const MOST_NAMES: usize = 12;
        if names.len() > MOST_NAMES {
            names.splice(MOST_NAMES / 2..names.len() - MOST_NAMES / 2, ["…".to_string()]);
        }
        (names.len() > 2).then(|| names.join(" – "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn votes() {
        let (u, r, c) = (VertexId(0), VertexId(1), VertexId(2));
        let (electrical, rotation) = (bit(Domain::Electrical), bit(Domain::Rotation));
        let kelvin = bit(Domain::Thermal) | bit(Domain::PseudoThermal);
        let watt = bit(Domain::PseudoThermal);
        assert_eq!(winner(&[], true), Err(0));
        assert_eq!(winner(&[(u, electrical)], false), Ok((Domain::Electrical, u)));
        // The one that most say, whatever their order.
        let votes = [(c, rotation), (u, electrical), (r, electrical)];
        assert_eq!(winner(&votes, false), Ok((Domain::Electrical, u)));
        // Of two that contend for it the first in the text, if nothing else decides.
        let tie = [(r, electrical), (u, rotation)];
        assert_eq!(winner(&tie, false), Err(electrical | rotation));
        assert_eq!(winner(&tie, true), Ok((Domain::Rotation, u)));
        let kinds = [(u, bit(Domain::Magnetic)), (r, electrical)];
        assert_eq!(winner(&kinds, true), Ok((Domain::Electrical, r)));
        // What two domains share waits for what one has alone.
        assert_eq!(winner(&[(u, kelvin)], false), Err(kelvin));
        assert_eq!(winner(&[(u, kelvin)], true), Ok((Domain::Thermal, u)));
        assert_eq!(winner(&[(u, kelvin), (r, watt)], false), Ok((Domain::PseudoThermal, r)));
        let heat = [(u, kelvin), (r, watt), (c, bit(Domain::Thermal))];
        assert_eq!(winner(&heat, false), Err(kelvin));
        assert_eq!(winner(&heat, true), Ok((Domain::PseudoThermal, r)));
    }

    #[test]
    fn a_rack_and_a_motor() {
        let unit = |text| crate::quantity::Unit::parse(text).unwrap().dimension;
        let to = |shape, domain, first, unit, gain| {
            across(shape, domain, first, unit, gain).and_then(domain_of)
        };
        let (t, g) = (Shape::Transformer, Shape::Gyrator);
        assert_eq!(to(g, Domain::Electrical, true, unit("V*s"), false), Some(Domain::Rotation));
        assert_eq!(to(g, Domain::Rotation, true, unit("V*s"), false), Some(Domain::Electrical));
        assert_eq!(to(t, Domain::Rotation, true, unit("m^3/rad"), false), Some(Domain::Hydraulic));
        assert_eq!(to(t, Domain::Hydraulic, true, unit("1/m^2"), false), Some(Domain::Translation));
        assert_eq!(to(t, Domain::Hydraulic, true, unit("m^2"), true), Some(Domain::Translation));
        assert_eq!(to(t, Domain::Translation, false, unit("m^2"), true), Some(Domain::Hydraulic));
        assert_eq!(to(t, Domain::Hydraulic, true, unit("m^2"), false), None);
    }
}
