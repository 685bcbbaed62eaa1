//! Which nodes of a graph only one side of a choice needs.
//!
//! Branches form a tree: below what is always needed, for each condition what matters only where it holds, and only where
//! it does not. A node belongs to the branch that all its uses have in common. Choices of one condition share their
//! branches, so that a value and its derivatives do.

use super::dag::{Dag, NodeId, Op};
use rustc_hash::FxHashMap;

/// Branches of branches of … no deeper than this: what is deeper is computed along.
const DEEPEST: usize = 16;
/// A branch of less work is cheaper to compute than to pass over.
const LEAST: u32 = 6;

#[derive(Clone, Copy, Debug)]
struct Branch {
    parent: usize,
    depth: usize,
    /// Work of its nodes and of the branches below it.
    work: u32,
}

/// Nodes by the branch that they belong to.
pub(super) struct Branches {
    list: Vec<Branch>,
    known: FxHashMap<(usize, NodeId, bool), usize>,
    /// Nodes of each branch that are still to come, the next one last.
    waiting: Vec<Vec<NodeId>>,
}

impl Branches {
    /// The branch of what is always needed.
    pub const ALWAYS: usize = 0;

    /// Of the nodes that compute something, ascending, and those that are asked for.
    pub fn of(dag: &Dag, nodes: &[NodeId], outputs: &[NodeId]) -> Branches {
        let root = Branch { parent: 0, depth: 0, work: 0 };
        let mut branches =
            Branches { list: vec![root], known: FxHashMap::default(), waiting: vec![] };
        let place = |node: &NodeId| nodes.binary_search(node).ok();
        let mut home: Vec<Option<usize>> = vec![None; nodes.len()];
        for k in outputs.iter().filter_map(place) {
            home[k] = Some(Branches::ALWAYS);
        }
        for (k, node) in nodes.iter().enumerate().rev() {
            let own = home[k].unwrap_or(Branches::ALWAYS);
            let op = dag.op(*node);
            branches.list[own].work += work(op);
            let (operands, count) = op.operands();
            for (o, operand) in operands[..count].iter().enumerate() {
                let Some(at) = place(operand) else { continue };
                let needed = match op {
                    Op::Select(condition, ..) if o > 0 => branches.side(own, condition, o == 1),
                    _ => own,
                };
                home[at] = Some(home[at].map_or(needed, |home| branches.common(home, needed)));
            }
        }
        for k in (1..branches.list.len()).rev() {
            let Branch { parent, work, .. } = branches.list[k];
            branches.list[parent].work += work;
        }
        branches.waiting = vec![vec![]; branches.list.len()];
        for (node, home) in nodes.iter().zip(home).rev() {
            let own = branches.worthwhile(home.unwrap_or(Branches::ALWAYS));
            branches.waiting[own].push(*node);
        }
        branches
    }

    /// What matters in a branch only where a condition holds, or only where it does not.
    fn side(&mut self, parent: usize, condition: NodeId, holds: bool) -> usize {
        let depth = self.list[parent].depth + 1;
        if depth > DEEPEST {
            return parent;
        }
        let next = self.list.len();
        let at = *self.known.entry((parent, condition, holds)).or_insert(next);
        if at == next {
            self.list.push(Branch { parent, depth, work: 0 });
        }
        at
    }

    /// The deepest branch that two lie in.
    fn common(&self, mut a: usize, mut b: usize) -> usize {
        while a != b {
            if self.list[a].depth >= self.list[b].depth {
                a = self.list[a].parent;
            } else {
                b = self.list[b].parent;
            }
        }
        a
    }

    /// The branch itself, or the one around it that is worth passing over.
    fn worthwhile(&self, mut branch: usize) -> usize {
        while branch != Branches::ALWAYS && self.list[branch].work < LEAST {
            branch = self.list[branch].parent;
        }
        branch
    }

    /// The next node of a branch, if it stands before a limit.
    pub fn next(&mut self, branch: usize, limit: NodeId) -> Option<NodeId> {
        self.waits(branch, limit).then(|| self.waiting[branch].pop()).flatten()
    }

    /// Whether a node of a branch that stands before a limit is still to come.
    pub fn waits(&self, branch: usize, limit: NodeId) -> bool {
        self.waiting[branch].last().is_some_and(|node| *node < limit)
    }

    /// The branches of a condition within one, and whether it holds there.
    pub fn sides(&self, branch: usize, condition: NodeId) -> Vec<(usize, bool)> {
        let side = |holds| self.known.get(&(branch, condition, holds)).map(|at| (*at, holds));
        [true, false].into_iter().filter_map(side).collect()
    }
}

/// About what an operation costs.
fn work(op: Op) -> u32 {
    match op {
        Op::Constant(_) | Op::Input(_) => 0,
        Op::Unary(..) | Op::Binary(..) | Op::Select(..) => 1,
        Op::One(..) | Op::Two(..) | Op::Table(..) | Op::Slope(..) => LEAST,
    }
}
