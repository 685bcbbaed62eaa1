//! Places things on a grid as one would on squared paper: chains straight, neighbours side by side, nothing crossed.
//!
//! A block is one node or several that keep their places to each other (an instance that is laid out already, which may
//! be turned and mirrored as a whole). Blocks are set one after the other along the longest chain and beside what they
//! hang on, then moved, turned and swapped by simulated annealing (S. Kirkpatrick et al., Science 220:671, 1983) while a
//! cost falls: length and direction of the lines, crossings, lines that pass through nodes, the size of the whole. All
//! costs are integers and the random numbers are our own, so that a layout is the same on every machine.

mod crossing;
mod search;

pub use crossing::{Crossing, crosses};

use crate::quantity::random::fraction;

/// A place in columns and rows, rows downward.
pub type Cell = (i32, i32);

/// Nodes that keep their places to each other.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Block {
    /// The nodes, and where each stands from the block's own corner on.
    pub nodes: Vec<(usize, Cell)>,
    /// How many columns it takes.
    pub width: i32,
    /// How many rows.
    pub height: i32,
}

impl Block {
    /// A block of one node.
    pub fn single(node: usize) -> Block {
        Block { nodes: vec![(node, (0, 0))], width: 1, height: 1 }
    }

    /// Takes out the columns and rows in which nothing stands, and counts from its corner on.
    pub fn squeeze(&mut self) {
        let used = |of: &dyn Fn(Cell) -> i32| {
            let mut used: Vec<i32> = self.nodes.iter().map(|(_, cell)| of(*cell)).collect();
            used.sort_unstable();
            used.dedup();
            used
        };
        let (columns, rows) = (used(&|cell| cell.0), used(&|cell| cell.1));
        let place = |used: &[i32], at: i32| used.partition_point(|x| *x < at) as i32;
        for (_, cell) in &mut self.nodes {
            *cell = (place(&columns, cell.0), place(&rows, cell.1));
        }
        (self.width, self.height) = (columns.len() as i32, rows.len() as i32);
    }
}

/// What a line would like.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wish {
    /// To run to the right: between junctions and two-ports.
    Along,
    /// To hang below or above: elements on their junction.
    Hang,
}

/// A line between two nodes.
#[derive(Clone, Copy, Debug)]
pub struct Edge {
    /// Where it begins.
    pub from: usize,
    /// Where it ends.
    pub to: usize,
    /// What it would like.
    pub wish: Wish,
}

/// What is to be placed.
pub struct Problem<'a> {
    /// All blocks; every node is in one.
    pub blocks: &'a [Block],
    /// All lines, those within blocks too.
    pub edges: &'a [Edge],
    /// How many nodes there are.
    pub nodes: usize,
    /// Nodes that shall stand at the edge of the whole.
    pub rim: &'a [usize],
}

/// The turns and mirrorings of a rectangle on itself: x' = a·x + b·y, y' = c·x + d·y.
const TURNS: [[i32; 4]; 8] = [
    [1, 0, 0, 1],
    [0, -1, 1, 0],
    [-1, 0, 0, -1],
    [0, 1, -1, 0],
    [-1, 0, 0, 1],
    [0, 1, 1, 0],
    [1, 0, 0, -1],
    [0, -1, -1, 0],
];

fn turned(turn: usize, cell: Cell) -> Cell {
    let [a, b, c, d] = TURNS[turn];
    (a * cell.0 + b * cell.1, c * cell.0 + d * cell.1)
}

/// The turn that does first one and then another.
fn after(first: usize, then: usize) -> usize {
    let (x, y) = (turned(then, turned(first, (1, 0))), turned(then, turned(first, (0, 1))));
    TURNS.iter().position(|t| *t == [x.0, y.0, x.1, y.1]).unwrap_or(0)
}

/// The cost of what cannot be read: a line through a node or along another.
const UNREADABLE: i64 = 60;
/// The cost of a crossing.
const CROSSING: i64 = 26;

struct State<'a> {
    problem: &'a Problem<'a>,
    /// By block: its corner and its turn.
    at: Vec<(Cell, usize)>,
    placed: Vec<bool>,
    /// By node: its cell; and its block.
    cells: Vec<Cell>,
    block_of: Vec<usize>,
    /// By block: its edges.
    edges_of: Vec<Vec<usize>>,
    /// By block: the blocks that it has lines to.
    beside: Vec<Vec<usize>>,
    seed: u64,
    random: u64,
}

/// The best places found: one block of all nodes, its corner at (0, 0).
pub fn arrange(problem: &Problem) -> Block {
    let count = problem.blocks.len();
    // Blocks of several nodes are hard to move about, and worth more tries.
    let rigid = problem.blocks.iter().any(|block| block.nodes.len() > 1);
    let (runs, each, most) = if rigid { (1, 8000, 200_000) } else { (2, 1000, 40_000) };
    let mut found: Option<(i64, Block)> = None;
    for run in 0..runs {
        let mut state = State::new(problem, run);
        state.begin();
        if count > 1 {
            state.anneal((each * count as u64).clamp(3000, most));
            state.polish();
        }
        let all: Vec<usize> = (0..count).collect();
        let cost = state.local(&all, &vec![true; count]) + state.shape();
        if found.as_ref().is_none_or(|(least, _)| cost < *least) {
            found = Some((cost, state.whole()));
        }
    }
    found.map(|(_, block)| block).unwrap_or_default()
}

impl<'a> State<'a> {
    fn new(problem: &'a Problem<'a>, seed: u64) -> State<'a> {
        let count = problem.blocks.len();
        let mut block_of = vec![0; problem.nodes];
        for (k, block) in problem.blocks.iter().enumerate() {
            block.nodes.iter().for_each(|(node, _)| block_of[*node] = k);
        }
        let mut edges_of = vec![vec![]; count];
        let mut beside: Vec<Vec<usize>> = vec![vec![]; count];
        for (k, edge) in problem.edges.iter().enumerate() {
            let (a, b) = (block_of[edge.from], block_of[edge.to]);
            edges_of[a].push(k);
            if a != b {
                edges_of[b].push(k);
                beside[a].push(b);
                beside[b].push(a);
            }
        }
        State {
            problem,
            at: vec![((0, 0), 0); count],
            placed: vec![false; count],
            cells: vec![(0, 0); problem.nodes],
            block_of,
            edges_of,
            beside,
            seed,
            random: 0,
        }
    }

    fn next(&mut self, below: usize) -> usize {
        self.random += 1;
        ((fraction(29 + self.seed, self.random) * below as f64) as usize)
            .min(below.saturating_sub(1))
    }

    /// The size of a block as it stands.
    fn size(&self, block: usize) -> (i32, i32) {
        let Block { width, height, .. } = self.problem.blocks[block];
        let [a, ..] = TURNS[self.at[block].1];
        if a != 0 { (width, height) } else { (height, width) }
    }

    /// Where a node of a block stands, from the corner of the turned block on.
    fn offset(&self, block: usize, cell: Cell) -> Cell {
        let Block { width, height, .. } = self.problem.blocks[block];
        let turn = self.at[block].1;
        let (x, y) = turned(turn, cell);
        let far = turned(turn, (width - 1, height - 1));
        (x - far.0.min(0), y - far.1.min(0))
    }

    fn put(&mut self, block: usize, corner: Cell, turn: usize) {
        self.at[block] = (corner, turn);
        let problem = self.problem;
        for (node, cell) in &problem.blocks[block].nodes {
            let (x, y) = self.offset(block, *cell);
            self.cells[*node] = (corner.0 + x, corner.1 + y);
        }
    }

    /// Whether a block stands on none of the others that are placed.
    fn is_free(&self, block: usize) -> bool {
        let ((x, y), _) = self.at[block];
        let (w, h) = self.size(block);
        (0..self.at.len()).all(|other| {
            if other == block || !self.placed[other] {
                return true;
            }
            let ((u, v), _) = self.at[other];
            let (s, t) = self.size(other);
            x + w <= u || u + s <= x || y + h <= v || v + t <= y
        })
    }

    /// What one line costs by itself.
    fn single(&self, edge: usize) -> i64 {
        let Edge { from, to, wish } = self.problem.edges[edge];
        let (a, b) = (self.cells[from], self.cells[to]);
        let (dx, dy) = (i64::from(b.0 - a.0), i64::from(b.1 - a.1));
        let (wide, high) = (dx.abs(), dy.abs());
        let (long, short) = (wide.max(high), wide.min(high));
        let length = if short == 0 { 7 * (long - 1) } else { 8 + 4 * short + 7 * (long - 1) };
        let way = match wish {
            Wish::Along if wide >= high => i64::from(dx < 0) * 4,
            Wish::Along => 3 + i64::from(dy < 0) * 2,
            Wish::Hang if wide > high => 3 + i64::from(dx < 0) * 2,
            Wish::Hang => i64::from(dy < 0),
        };
        length + way
    }

    /// What two lines cost each other.
    fn pair(&self, one: usize, other: usize) -> i64 {
        let (p, q) = (self.problem.edges[one], self.problem.edges[other]);
        let (a, b) = (self.cells[p.from], self.cells[p.to]);
        let (c, d) = (self.cells[q.from], self.cells[q.to]);
        if a.0.max(b.0) < c.0.min(d.0)
            || c.0.max(d.0) < a.0.min(b.0)
            || a.1.max(b.1) < c.1.min(d.1)
            || c.1.max(d.1) < a.1.min(b.1)
        {
            return 0;
        }
        match (
            crosses(a, b, c, d),
            p.from == q.from || p.from == q.to || p.to == q.from || p.to == q.to,
        ) {
            (Crossing::Along, _) => UNREADABLE,
            (Crossing::At, false) => CROSSING,
            _ => 0,
        }
    }

    /// What a node costs that a line passes.
    fn near(&self, edge: usize, node: usize) -> i64 {
        let Edge { from, to, .. } = self.problem.edges[edge];
        if node == from || node == to {
            return 0;
        }
        let (a, b, c) = (self.cells[from], self.cells[to], self.cells[node]);
        let inside = |p: i32, q: i32, r: i32| p.min(q) <= r && r <= p.max(q);
        if !inside(a.0, b.0, c.0) || !inside(a.1, b.1, c.1) {
            return 0;
        }
        let (dx, dy) = (i64::from(b.0 - a.0), i64::from(b.1 - a.1));
        let cross = (dx * i64::from(c.1 - a.1) - dy * i64::from(c.0 - a.0)).abs();
        // Nearer than six tenths of a cell.
        if 10 * cross < 6 * dx.abs().max(dy.abs()) { UNREADABLE } else { 0 }
    }

    fn is_placed(&self, edge: usize) -> bool {
        let Edge { from, to, .. } = self.problem.edges[edge];
        self.placed[self.block_of[from]] && self.placed[self.block_of[to]]
    }

    /// All that depends on where some blocks stand.
    fn local(&self, blocks: &[usize], moved: &[bool]) -> i64 {
        let mut cost = 0;
        let edges = self.problem.edges;
        // What stands still and has its place; what moves.
        let mut still = vec![];
        let mut moving = vec![];
        for (k, edge) in edges.iter().enumerate().filter(|(k, _)| self.is_placed(*k)) {
            let moves = moved[self.block_of[edge.from]] || moved[self.block_of[edge.to]];
            if moves { moving.push(k) } else { still.push(k) }
        }
        for (at, edge) in moving.iter().enumerate() {
            cost += self.single(*edge);
            cost += moving[at + 1..].iter().map(|other| self.pair(*edge, *other)).sum::<i64>();
            cost += still.iter().map(|other| self.pair(*edge, *other)).sum::<i64>();
            let nodes = (0..self.cells.len()).filter(|node| self.placed[self.block_of[*node]]);
            cost += nodes.map(|node| self.near(*edge, node)).sum::<i64>();
        }
        let nodes = blocks.iter().flat_map(|block| &self.problem.blocks[*block].nodes);
        for (node, _) in nodes {
            cost += still.iter().map(|other| self.near(*other, *node)).sum::<i64>();
        }
        cost
    }

    /// What the size of the whole costs, and nodes that shall stand at its edge and do not.
    fn shape(&self) -> i64 {
        let mut cells = self.problem.blocks.iter().enumerate().filter(|(k, _)| self.placed[*k]);
        let Some((first, _)) = cells.next() else { return 0 };
        let corner = |k: usize| {
            let ((x, y), (w, h)) = (self.at[k].0, self.size(k));
            (x, y, x + w - 1, y + h - 1)
        };
        let (mut l, mut t, mut r, mut b) = corner(first);
        for (k, _) in cells {
            let (x, y, u, v) = corner(k);
            (l, t, r, b) = (l.min(x), t.min(y), r.max(u), b.max(v));
        }
        let rim = |node: &usize| {
            let (x, y) = self.cells[*node];
            i64::from((x - l).min(r - x).min(y - t).min(b - y))
        };
        2 * i64::from(r - l)
            + 3 * i64::from(b - t)
            + 12 * self.problem.rim.iter().map(rim).sum::<i64>()
    }

    /// All nodes as one block.
    fn whole(&self) -> Block {
        let mut block =
            Block { nodes: self.cells.iter().copied().enumerate().collect(), ..Block::default() };
        block.squeeze();
        block
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turns_compose() {
        for first in 0..8 {
            for then in 0..8 {
                let both = after(first, then);
                for cell in [(1, 0), (0, 1), (3, -2)] {
                    assert_eq!(turned(both, cell), turned(then, turned(first, cell)));
                }
            }
        }
    }

    #[test]
    fn crossings_are_told_from_meetings() {
        assert_eq!(crosses((0, 0), (2, 2), (0, 2), (2, 0)), Crossing::At);
        assert_eq!(crosses((0, 0), (2, 0), (1, 0), (3, 0)), Crossing::Along);
        assert_eq!(crosses((0, 0), (2, 0), (2, 0), (3, 0)), Crossing::Not);
        assert_eq!(crosses((0, 0), (2, 0), (0, 1), (2, 1)), Crossing::Not);
    }

    #[test]
    fn a_chain_is_straight_and_a_square_has_no_crossing() {
        let blocks: Vec<Block> = (0..5).map(Block::single).collect();
        let edge = |from: usize, to: usize| Edge { from, to, wish: Wish::Along };
        let chain: Vec<Edge> = (0..4).map(|k| edge(k, k + 1)).collect();
        let whole = arrange(&Problem { blocks: &blocks, edges: &chain, nodes: 5, rim: &[] });
        assert_eq!((whole.width, whole.height), (5, 1));
        assert_eq!(whole.nodes[0].1, (0, 0));
        let ring: Vec<Edge> = (0..4).map(|k| edge(k, (k + 1) % 4)).chain([edge(0, 4)]).collect();
        let whole = arrange(&Problem { blocks: &blocks, edges: &ring, nodes: 5, rim: &[] });
        let at = |k: usize| whole.nodes[k].1;
        for (p, q) in ring.iter().zip(ring.iter().skip(1)) {
            assert_ne!(crosses(at(p.from), at(p.to), at(q.from), at(q.to)), Crossing::Along);
        }
        assert!(whole.width * whole.height <= 6, "{whole:?}");
    }
}
