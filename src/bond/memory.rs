//! In which order memories take their values where several do so at one instant.

use super::graph::{BondGraph, Expr, Leaf, SignalLaw};

/// For each signal with a memory the round in which it takes its value at an instant, from 0: after all memories that
/// its input follows from at the same instant, through signals alone. Where memories follow from each other in a ring,
/// the one that is reached first in the order of the file reads what the next one held before. 0 for other signals.
pub fn rounds(graph: &BondGraph) -> Vec<u32> {
    let uses = |law: &SignalLaw| {
        let mut uses = vec![];
        let expr: Option<&Expr> = match law {
            SignalLaw::Algebraic(expr) | SignalLaw::Memory { input: expr, .. } => Some(expr),
            SignalLaw::Integrator { .. } | SignalLaw::Waveform(_) => None,
        };
        if let Some(expr) = expr {
            expr.leaves(&mut |leaf, _| {
                if let Leaf::Signal(id) = leaf {
                    uses.push(id.index());
                }
            });
        }
        uses
    };
    let uses: Vec<Vec<usize>> = graph.signals.iter().map(|signal| uses(&signal.law)).collect();
    let remembers: Vec<bool> =
        graph.signals.iter().map(|s| matches!(s.law, SignalLaw::Memory { .. })).collect();
    // By signal the first round in which its value is that of the instant.
    let mut ready = vec![0u32; uses.len()];
    let mut rounds = vec![0u32; uses.len()];
    let mut done = vec![false; uses.len()];
    let mut open = vec![false; uses.len()];
    for first in 0..uses.len() {
        let mut path = vec![(first, 0)];
        while let Some((k, next)) = path.last_mut() {
            let k = *k;
            if *next == 0 && done[k] {
                path.pop();
                continue;
            }
            open[k] = true;
            if let Some(&used) = uses[k].get(*next) {
                *next += 1;
                if !done[used] && !open[used] {
                    path.push((used, 0));
                }
                continue;
            }
            let after = uses[k].iter().filter(|used| done[**used]).map(|used| ready[*used]);
            rounds[k] = after.max().unwrap_or(0);
            ready[k] = rounds[k] + u32::from(remembers[k]);
            done[k] = true;
            path.pop();
        }
    }
    for (round, remembers) in rounds.iter_mut().zip(remembers) {
        *round *= u32::from(remembers);
    }
    rounds
}

#[cfg(test)]
mod tests {
    use super::super::build::*;
    use super::super::graph::*;
    use super::*;

    #[test]
    fn each_memory_comes_after_those_it_follows_from() {
        let mut b = Build::default();
        let memory =
            |input: Expr| SignalLaw::Memory { kind: Memory::Sample { period: n(1.0) }, input };
        let of = |id: u32| Expr::leaf(Leaf::Signal(SignalId(id)));
        // c holds b, b = 2·a, a holds d (declared later), d holds the time; e and f hold each other.
        b.signal("c", memory(of(1)));
        b.signal("b", SignalLaw::Algebraic(of(2) + of(2)));
        b.signal("a", memory(of(3)));
        b.signal("d", memory(Expr::leaf(Leaf::Time)));
        b.signal("e", memory(of(5)));
        b.signal("f", memory(of(4)));
        assert_eq!(rounds(&b.graph), [2, 0, 1, 0, 1, 0]);
    }
}
