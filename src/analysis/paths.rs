//! Causal paths and loops with their gains, and Mason's rule.
//!
//! Causality makes every equation give one variable from others, so that the linear equations are a signal flow graph: an
//! edge for each variable that another one is given by, its gain a quotient in s and the parameters. Variables that follow
//! from a single other one are no nodes of their own but stand on the edges.
//!
//! ```text
//! w/u = Σ P_k·Δ_k / Δ        Δ = 1 − ΣL + ΣL·L' − …        (loops that do not touch)
//! ```
//!
//! P_k are the paths, L the loops; Δ_k leaves out the loops that touch path k (S. J. Mason, *Feedback theory: further
//! properties of signal flow graphs*, 1956).

use super::linear::Linear;
use super::symbolic::symbols::{Ratio, Reader, Symbol, Trouble, s, short_name};
use crate::bond::graph::BondGraph;
use crate::expr::NodeId;
use crate::expr::polynomial::Polynomial;
use std::collections::BTreeSet;

/// A way along edges: a path, or a loop.
#[derive(Clone, Debug)]
pub struct Way {
    /// The unknowns in their order, those on the edges too; a loop ends before it comes back to the first.
    pub through: Vec<usize>,
    /// The product of the gains.
    pub gain: Ratio,
    /// The nodes, by which ways touch.
    nodes: BTreeSet<usize>,
}

/// The signal flow graph of a model.
#[derive(Clone, Debug)]
pub struct Flow {
    edges: Vec<Edge>,
    /// The symbols of the gains; s is the first.
    pub symbols: Vec<Symbol>,
}

#[derive(Clone, Debug)]
struct Edge {
    from: usize,
    to: usize,
    gain: Ratio,
    /// Unknowns on the way.
    via: Vec<usize>,
}

/// Paths and loops at most.
pub const MOST_WAYS: usize = 5000;
/// Steps of a search at most.
const MOST_STEPS: usize = 2_000_000;

/// The flow graph. The only input and the first output, where there are such, are nodes behind the unknowns:
/// [`source`] and [`sink`].
///
/// # Errors
/// When a gain has no symbolic form.
pub fn flow(graph: &BondGraph, linear: &Linear) -> Result<Flow, Trouble> {
    let input = (linear.inputs.len() == 1).then(|| &linear.inputs[0]);
    let output = linear.outputs.first();
    let none = vec![];
    let direct = linear.direct.first().filter(|_| input.is_some()).unwrap_or(&none);
    let into = input.map_or(&none, |input| &input.entries);
    let read = output.map_or(&none, |output| &output.entries);
    let all = linear.rows.iter().flatten().chain(into).chain(read).chain(direct);
    let nodes: Vec<NodeId> = all.filter_map(|(_, entry)| entry.node).collect();
    let mut reader = Reader::new(graph, linear, &nodes);
    let mut edges = vec![];
    for (from, (_, entry)) in read
        .iter()
        .map(|read| (read.0 as usize, read))
        .chain(direct.iter().map(|read| (source(linear), read)))
    {
        let gain = super::symbolic::transfer::ratio(&mut reader, entry)?;
        edges.push(Edge { from, to: sink(linear), gain, via: vec![] });
    }
    for (row, entries) in linear.rows.iter().enumerate() {
        let given = linear.gives[row];
        let mut terms: Vec<(u32, Ratio)> = vec![];
        for (k, entry) in entries {
            terms.push((*k, super::symbolic::transfer::ratio(&mut reader, entry)?));
        }
        for (_, entry) in into.iter().filter(|(own, _)| *own as usize == row) {
            let gain = super::symbolic::transfer::ratio(&mut reader, entry)?;
            terms.push((source(linear) as u32, gain));
        }
        // 0 = A·y + B·u − s·y of its rate.
        if linear.rated[row] {
            let rate = Ratio { top: s().negate(), bottom: Polynomial::number(1) };
            match terms.iter_mut().find(|(k, _)| *k as usize == row && given as usize != row) {
                Some((_, own)) => *own = own.plus(&rate, false)?,
                // A state's own rate is a loop round it, not a part of its 1/s.
                None => terms.push((u32::MAX, rate)),
            }
        }
        let integral = linear.rated[row] && given as usize == row;
        let place = |k: u32| if k == u32::MAX { row as u32 } else { k };
        let divisor = match integral {
            true => terms.iter().find(|(k, _)| *k == u32::MAX),
            false => terms.iter().find(|(k, _)| place(*k) == given),
        };
        let Some((_, divisor)) = divisor else { continue };
        let divisor = divisor.inverse()?;
        for (k, term) in &terms {
            let own = if integral { *k == u32::MAX } else { place(*k) == given };
            if !own {
                let gain = term.times(&divisor)?.negated();
                edges.push(Edge {
                    from: place(*k) as usize,
                    to: given as usize,
                    gain,
                    via: vec![],
                });
            }
        }
    }
    let mut flow = Flow { edges, symbols: reader.symbols };
    flow.contract(linear)?;
    Ok(flow)
}

/// The node of the input.
pub fn source(linear: &Linear) -> usize {
    linear.unknowns.len()
}

/// The node of the output.
pub fn sink(linear: &Linear) -> usize {
    linear.unknowns.len() + 1
}

/// The names that a way passes, each once where a junction shares it.
pub fn names(graph: &BondGraph, linear: &Linear, way: &Way) -> Vec<String> {
    let name = |k: &usize| match *k {
        k if k == source(linear) => linear.inputs[0].name.clone(),
        k if k == sink(linear) => linear.outputs[0].name.clone(),
        k => short_name(graph, linear, k),
    };
    let mut names: Vec<String> = way.through.iter().map(name).collect();
    names.dedup();
    names
}

impl Flow {
    /// Takes out nodes with one edge in, which lengthens the edges that leave them.
    fn contract(&mut self, linear: &Linear) -> Result<(), Trouble> {
        loop {
            let mut into = vec![0; linear.unknowns.len() + 2];
            self.edges.iter().for_each(|edge| into[edge.to] += 1);
            let own_loop = |k: usize| self.edges.iter().any(|edge| edge.from == k && edge.to == k);
            let ends = [source(linear), sink(linear)];
            let free = |k: &usize| !ends.contains(k) && !linear.stores(*k) && !own_loop(*k);
            let Some(node) = (0..into.len()).find(|k| into[*k] == 1 && free(k)) else {
                return Ok(());
            };
            let at = self.edges.iter().position(|edge| edge.to == node);
            let Some(before) = at.map(|at| self.edges.remove(at)) else { return Ok(()) };
            for edge in self.edges.iter_mut().filter(|edge| edge.from == node) {
                edge.gain = before.gain.times(&edge.gain)?;
                edge.from = before.from;
                let rest = std::mem::take(&mut edge.via);
                edge.via = before.via.iter().copied().chain([node]).chain(rest).collect();
            }
        }
    }

    /// All paths from one unknown to another that pass no variable twice.
    ///
    /// # Errors
    /// When there are too many.
    pub fn paths(&self, from: usize, to: usize) -> Result<Vec<Way>, Trouble> {
        let mut found = vec![];
        let mut search = Search { flow: self, open: vec![], steps: 0, found: &mut found };
        search.go(from, to, from, &|_| true)?;
        Ok(found)
    }

    /// All loops, each once.
    ///
    /// # Errors
    /// When there are too many.
    pub fn loops(&self) -> Result<Vec<Way>, Trouble> {
        let nodes: BTreeSet<usize> = self.edges.iter().map(|edge| edge.from).collect();
        let mut found = vec![];
        for start in nodes {
            let mut search = Search { flow: self, open: vec![], steps: 0, found: &mut found };
            // Loops whose least node this is.
            search.go(start, start, start, &|node| node >= start)?;
        }
        found.sort_by_key(|way| way.through.len());
        Ok(found)
    }
}

struct Search<'s> {
    flow: &'s Flow,
    open: Vec<&'s Edge>,
    steps: usize,
    found: &'s mut Vec<Way>,
}

impl Search<'_> {
    fn go(
        &mut self,
        at: usize,
        to: usize,
        start: usize,
        allowed: &dyn Fn(usize) -> bool,
    ) -> Result<(), Trouble> {
        let flow = self.flow;
        for edge in flow.edges.iter().filter(|edge| edge.from == at && allowed(edge.to)) {
            self.steps += 1;
            if self.steps > MOST_STEPS || self.found.len() > MOST_WAYS {
                return Err(Trouble::TooLarge);
            }
            if edge.to == to {
                self.open.push(edge);
                let way = self.way(start, start == to)?;
                self.found.push(way);
                self.open.pop();
            } else if edge.to != start && !self.open.iter().any(|other| other.to == edge.to) {
                self.open.push(edge);
                self.go(edge.to, to, start, allowed)?;
                self.open.pop();
            }
        }
        Ok(())
    }

    fn way(&self, start: usize, closed: bool) -> Result<Way, Trouble> {
        let mut through = vec![start];
        let mut nodes = BTreeSet::from([start]);
        let mut gain = Ratio::one();
        for edge in &self.open {
            gain = gain.times(&edge.gain)?;
            through.extend(&edge.via);
            through.push(edge.to);
            nodes.insert(edge.to);
        }
        if closed {
            through.pop();
        }
        Ok(Way { through, gain, nodes })
    }
}

impl Way {
    /// Whether they share a variable.
    pub fn touches(&self, other: &Way) -> bool {
        !self.nodes.is_disjoint(&other.nodes)
    }
}

/// Numbers that Mason's rule can be taken in.
pub trait Gains: Sized + Clone {
    /// 1.
    fn unit() -> Self;
    /// self − a·b.
    ///
    /// # Errors
    /// When it is too large.
    fn less(&self, a: &Self, b: &Self) -> Result<Self, Trouble>;
}

impl Gains for crate::linear::Complex {
    fn unit() -> Self {
        crate::linear::Complex::new(1.0, 0.0)
    }

    fn less(&self, a: &Self, b: &Self) -> Result<Self, Trouble> {
        Ok(*self - *a * *b)
    }
}

impl Gains for Ratio {
    fn unit() -> Self {
        Ratio::one()
    }

    fn less(&self, a: &Self, b: &Self) -> Result<Self, Trouble> {
        Ok(self.plus(&a.times(b)?, true)?)
    }
}

/// The top and the bottom of Mason's rule, Σ P_k·Δ_k and Δ.
///
/// # Errors
/// When they are too large.
pub fn mason<T: Gains>(paths: &[(Way, T)], loops: &[(Way, T)]) -> Result<[T; 2], Trouble> {
    let mut work = 0;
    let all: Vec<&(Way, T)> = loops.iter().collect();
    let bottom = determinant(&all, &mut work)?;
    // 0 − Σ P·Δ, and its sign turned at the end.
    let mut minus = T::unit().less(&T::unit(), &T::unit())?;
    let zero = minus.clone();
    for (path, gain) in paths {
        let apart: Vec<&(Way, T)> = loops.iter().filter(|(own, _)| !own.touches(path)).collect();
        minus = minus.less(gain, &determinant(&apart, &mut work)?)?;
    }
    let top = zero.less(&minus, &T::unit())?;
    Ok([top, bottom])
}

/// Δ of some loops: without the first, less the first times Δ of those that do not touch it.
fn determinant<T: Gains>(loops: &[&(Way, T)], work: &mut usize) -> Result<T, Trouble> {
    *work += 1;
    if *work > MOST_STEPS {
        return Err(Trouble::TooLarge);
    }
    let Some((first, rest)) = loops.split_first() else { return Ok(T::unit()) };
    let without = determinant(rest, work)?;
    let apart: Vec<&(Way, T)> =
        rest.iter().copied().filter(|(way, _)| !way.touches(&first.0)).collect();
    without.less(&first.1, &determinant(&apart, work)?)
}
