//! Domains of bonds: from the units of elements, along junctions and two-ports.

use super::dimensions::Dim;
use super::frames::Here;
use super::scope::{Meaning, Scope};
use crate::bond::elements::Shape;
use crate::bond::graph::*;
use crate::bond::syntax::Value;
use crate::quantity::{DOMAINS, Dimension, Domain, DomainRow};

impl Scope<'_> {
    /// Finds the domain of every bond that something tells; the first that is told stays.
    pub fn infer_domains(&mut self) {
        let mut settled: Vec<BondId> = vec![];
        let mut asked = vec![false; self.graph.vertices.len()];
        let mut crossed = vec![false; self.graph.vertices.len()];
        // Laws may speak of readings whose domains follow only later: ask the elements again until nothing new comes.
        // Only then what two domains share is taken for the likelier one: kelvins are pseudo-thermal beside watts.
        let mut guess = false;
        for at in 0..self.ports.len() {
            let port = &self.ports[at];
            if let (Some((domain, _)), Some(bond)) = (port.domain, port.bond) {
                self.settle(bond, domain, &mut settled);
            }
        }
        loop {
            let before = settled.len();
            for id in self.graph.vertex_ids().collect::<Vec<_>>() {
                if !asked[id.index()] && self.ask(id, guess, &mut settled) {
                    asked[id.index()] = true;
                }
            }
            let mut next = before;
            while let Some(bond) = settled.get(next).copied() {
                next += 1;
                let Bond { from, to, .. } = *self.graph.bond(bond);
                for end in [from, to] {
                    // Over a junction once is enough: all its bonds are told at the first.
                    let junction =
                        self.declarations[end.vertex.index()].element.shape.is_junction();
                    if !(junction && std::mem::replace(&mut crossed[end.vertex.index()], true)) {
                        self.spread(bond, end, &mut settled);
                    }
                }
            }
            if settled.len() == before && std::mem::replace(&mut guess, true) {
                self.here = Here::ROOT;
                return;
            }
        }
    }

    fn settle(&mut self, bond: BondId, domain: Domain, settled: &mut Vec<BondId>) {
        let slot = &mut self.graph.bonds[bond.index()].domain;
        if *slot == Domain::Any && domain != Domain::Any {
            *slot = domain;
            settled.push(bond);
        }
    }

    /// Asks a one-port for the domain of its bond. Whether it needs no asking again.
    fn ask(&mut self, id: VertexId, guess: bool, settled: &mut Vec<BondId>) -> bool {
        self.here = self.declarations[id.index()].here;
        let Some(&bond) = self.graph.vertex(id).bonds.first() else { return true };
        if self.declarations[id.index()].element.shape.is_junction()
            || self.graph.bond(bond).domain != Domain::Any
        {
            return true;
        }
        for (clue, dimension) in self.clues(id) {
            if dimension.is_none() {
                continue;
            }
            let fits = |row: &&DomainRow| clue.dimension(row.domain) == Some(dimension);
            let mut found = DOMAINS[1..].iter().filter(fits).map(|row| row.domain);
            if let (Some(domain), other) = (found.next(), found.next())
                && (guess || other.is_none())
            {
                self.settle(bond, domain, settled);
                return true;
            }
        }
        false
    }

    /// Carries a bond's domain over the element at one of its ends.
    fn spread(&mut self, bond: BondId, end: End, settled: &mut Vec<BondId>) {
        let domain = self.graph.bond(bond).domain;
        let bonds = self.graph.vertex(end.vertex).bonds.clone();
        let shape = self.declarations[end.vertex.index()].element.shape;
        if shape.is_junction() {
            bonds.iter().for_each(|other| self.settle(*other, domain, settled));
        }
        if !shape.is_two_port() || bonds.len() != 2 {
            return;
        }
        let first = bonds[0] == bond;
        let other = bonds[usize::from(first)];
        self.here = self.declarations[end.vertex.index()].here;
        let Some((ratio, gain)) = self.ratio(end.vertex) else { return };
        if let Some(domain) = across(shape, domain, first, ratio, gain) {
            self.settle(other, domain, settled);
        }
    }

    /// The dimension of a two-port's modulus, and whether it is a gain.
    fn ratio(&self, id: VertexId) -> Option<(Dimension, bool)> {
        let declaration = &self.declarations[id.index()];
        let Some(argument) = declaration.arguments.and_then(|arguments| arguments.first()) else {
            let meaning = self.key(declaration.name).and_then(|key| self.value(&key))?;
            let Meaning::Parameter(parameter) = meaning else { return None };
            return Some((self.parameter_dimensions[parameter.index()].known()?, false));
        };
        let Value::Expr(value) = &argument.value else { return None };
        let gain = argument.label.as_ref().is_some_and(|label| label.name.text == "gain");
        match self.dimension(value, Some(id)).whole() {
            Dim::Known(dimension) => Some((dimension, gain)),
            _ => None,
        }
    }
}

/// The domain on the other side of a two-port. `first`: the known one is at port 1.
///
/// Transformer: [r] = [e1]/[e2] = [f2]/[f1]. Gyrator: [r] = [e1]/[f2] = [e2]/[f1]. A gain is the inverse.
fn across(
    shape: Shape,
    domain: Domain,
    first: bool,
    modulus: Dimension,
    gain: bool,
) -> Option<Domain> {
    let ratio = if gain { modulus.power(-1, 1)? } else { modulus };
    let row = domain.row();
    if shape == Shape::Transformer && ratio.is_none() {
        return Some(domain);
    }
    let (effort, flow) = match (shape, first) {
        (Shape::Transformer, true) => {
            (row.effort_dimension.over(ratio)?, row.flow_dimension.times(ratio)?)
        }
        (Shape::Transformer, false) => {
            (row.effort_dimension.times(ratio)?, row.flow_dimension.over(ratio)?)
        }
        // The gyrator's law is the same from either side.
        _ => (row.flow_dimension.times(ratio)?, row.effort_dimension.over(ratio)?),
    };
    Domain::find(|row| row.effort_dimension == effort && row.flow_dimension == flow)
}
