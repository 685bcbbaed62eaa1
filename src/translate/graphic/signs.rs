//! Directions of edges: those with which each column is its way through the tree, signs included.

use super::super::forest::Forest;
use super::{Graph, Matrix, Refusal};

/// Reverses edges until the flows of the graph are (N·x, x), or says which column forbids it. Also refuses a graph
/// whose ways are not the columns.
pub fn orient(matrix: &Matrix, graph: &mut Graph) -> Result<(), Refusal> {
    let tree = Tree::new(graph, matrix.rows);
    let mut reversed = Forest::new(graph.edges.len());
    let mut on_the_way: Vec<Option<i8>> = vec![None; matrix.rows];
    for (column, entries) in matrix.columns.iter().enumerate() {
        let way = tree.way(graph.edges[matrix.rows + column]).ok_or(Refusal::Support(column))?;
        for (row, sign) in &way {
            on_the_way[*row] = Some(*sign);
        }
        let mut same = way.len() == entries.len();
        let mut agrees = true;
        for (row, sign) in entries {
            let Some(walked) = on_the_way[*row] else {
                same = false;
                continue;
            };
            let negative = walked != *sign;
            reversed.join_signed(*row, matrix.rows + column, negative);
            let (one, other) = (reversed.signed(*row), reversed.signed(matrix.rows + column));
            agrees &= (one.1 ^ other.1) == negative;
        }
        for (row, _) in way {
            on_the_way[row] = None;
        }
        if !same {
            return Err(Refusal::Support(column));
        }
        if !agrees {
            return Err(Refusal::Signs(column));
        }
    }
    for (edge, ends) in graph.edges.iter_mut().enumerate() {
        if reversed.signed(edge).1 {
            ends.reverse();
        }
    }
    Ok(())
}

/// The rows as a rooted forest: by node the row that leads up, the node above, whether the row points up, the depth.
struct Tree {
    up: Vec<Option<(usize, usize, bool)>>,
    depth: Vec<usize>,
}

impl Tree {
    fn new(graph: &Graph, rows: usize) -> Tree {
        let mut at: Vec<Vec<usize>> = vec![vec![]; graph.nodes];
        for (row, ends) in graph.edges.iter().enumerate().take(rows) {
            ends.iter().for_each(|node| at[*node].push(row));
        }
        let mut tree = Tree { up: vec![None; graph.nodes], depth: vec![usize::MAX; graph.nodes] };
        for root in 0..graph.nodes {
            if tree.depth[root] != usize::MAX {
                continue;
            }
            tree.depth[root] = 0;
            let mut waiting = vec![root];
            while let Some(node) = waiting.pop() {
                for row in &at[node] {
                    let [tail, head] = graph.edges[*row];
                    let other = if tail == node { head } else { tail };
                    if tree.depth[other] == usize::MAX {
                        tree.depth[other] = tree.depth[node] + 1;
                        tree.up[other] = Some((*row, node, tail == other));
                        waiting.push(other);
                    }
                }
            }
        }
        tree
    }

    /// The rows from the head of an edge back to its tail, + along the row; `None` between two trees.
    fn way(&self, [tail, head]: [usize; 2]) -> Option<Vec<(usize, i8)>> {
        let (mut from, mut to) = (head, tail);
        let mut way = Vec::new();
        while from != to {
            if self.depth[from] >= self.depth[to] {
                let (row, above, up) = self.up[from]?;
                way.push((row, if up { 1 } else { -1 }));
                from = above;
            } else {
                let (row, above, up) = self.up[to]?;
                way.push((row, if up { -1 } else { 1 }));
                to = above;
            }
        }
        Some(way)
    }
}
