//! Gives every node of a sketch its place: instances from the inside out on grids, then columns and rows as wide as what
//! stands in them.

use super::super::grid::{self, Block, Edge, Wish};
use super::super::picture::{Point, Room, Words};
use super::fold::fold;
use super::paint::{group_words, node_words, room_of};
use super::sketch::{NodeKind, Sketch};
use std::collections::HashMap;

/// Room between two columns and two rows: a bond with its labels.
const BOND: (f64, f64) = (58.0, 50.0);
/// Room between what stands in a box and its edges: sides, top, bottom.
const PADDING: (f64, f64, f64) = (14.0, 24.0, 22.0);
/// The least width of a column: labels stand on both sides of an upright bond.
const COLUMN: f64 = 64.0;

/// Where everything stands.
pub struct Placed {
    /// By node: the middle of its title.
    pub nodes: Vec<Point>,
    /// By group: its box, or the pieces of it in several rows; nothing for the whole.
    pub boxes: Vec<Vec<Room>>,
    /// By bond that is drawn: where it turns on its way, if it leads to another row.
    pub turns: Vec<Vec<Point>>,
    /// By node: its column and row.
    pub cells: Vec<grid::Cell>,
}

/// Places a sketch.
pub fn place(sketch: &Sketch) -> Placed {
    let block = arrange(sketch, 0);
    let mut cells = vec![(0, 0); sketch.nodes.len()];
    block.nodes.iter().for_each(|(node, cell)| cells[*node] = *cell);
    let (columns, rows) = (block.width.max(1) as usize, block.height.max(1) as usize);
    // What each column and row needs to the left and right of, above and below its line.
    let mut wide = vec![COLUMN / 2.0; columns];
    let (mut up, mut down) = (vec![10.0_f64; rows], vec![10.0_f64; rows]);
    for (node, cell) in sketch.nodes.iter().zip(&cells) {
        let room = words_room(&node_words(node, (0.0, 0.0)));
        let (x, y) = (cell.0 as usize, cell.1 as usize);
        wide[x] = wide[x].max(room.right).max(-room.left);
        up[y] = up[y].max(-room.top);
        down[y] = down[y].max(room.bottom);
    }
    let spans = spans(sketch, &cells);
    for (group, span) in sketch.groups.iter().zip(&spans).skip(1) {
        let Some(span) = span else { continue };
        let (l, r) = (span.left as usize, span.right as usize);
        let title = group_words(group, (0.0, 0.0)).width() + 14.0;
        let inside: f64 = (l..=r).map(|c| 2.0 * wide[c]).sum();
        let lacks = title - inside - 2.0 * PADDING.0 - BOND.0 * (r - l) as f64;
        if lacks > 0.0 {
            wide[l] += lacks / 2.0;
            wide[r] += if r > l { lacks / 2.0 } else { 0.0 };
        }
    }
    let pads = |low: bool, of: &dyn Fn(&Span) -> (i32, i32), count: usize| {
        // How many boxes begin (or end) there, one within the other.
        let mut most = vec![0_usize; count];
        for (group, span) in spans.iter().enumerate().skip(1) {
            let Some(span) = span else { continue };
            let edge = if low { of(span).0 } else { of(span).1 };
            let rank = rank(sketch, &spans, group, &|s| if low { of(s).0 } else { of(s).1 });
            let slot = &mut most[edge as usize];
            *slot = (*slot).max(rank);
        }
        most
    };
    let sides = |span: &Span| (span.left, span.right);
    let ups = |span: &Span| (span.top, span.bottom);
    let (left, right) = (pads(true, &sides, columns), pads(false, &sides, columns));
    let (top, bottom) = (pads(true, &ups, rows), pads(false, &ups, rows));
    let mut x = vec![0.0; columns];
    let mut edge = 0.0;
    for c in 0..columns {
        let pad = left[c] as f64 * PADDING.0;
        x[c] = edge + pad + wide[c];
        edge = x[c] + wide[c] + right[c] as f64 * PADDING.0 + BOND.0;
    }
    let mut y = vec![0.0; rows];
    let mut edge = 0.0;
    for r in 0..rows {
        y[r] = edge + top[r] as f64 * PADDING.1 + up[r];
        edge = y[r] + down[r] + bottom[r] as f64 * PADDING.2 + BOND.1;
    }
    let frame = |(group, span): (usize, &Option<Span>)| {
        let Some(span) = span.as_ref().filter(|_| group > 0) else { return vec![] };
        let rank = |of: &dyn Fn(&Span) -> i32| rank(sketch, &spans, group, of) as f64;
        let (l, r) = (span.left as usize, span.right as usize);
        let (t, b) = (span.top as usize, span.bottom as usize);
        vec![Room {
            left: x[l] - wide[l] - PADDING.0 * rank(&|s| s.left),
            right: x[r] + wide[r] + PADDING.0 * rank(&|s| s.right),
            top: y[t] - up[t] - PADDING.1 * rank(&|s| s.top),
            bottom: y[b] + down[b] + PADDING.2 * rank(&|s| s.bottom),
        }]
    };
    let mut placed = Placed {
        nodes: cells.iter().map(|cell| (x[cell.0 as usize], y[cell.1 as usize])).collect(),
        boxes: spans.iter().enumerate().map(frame).collect(),
        turns: vec![vec![]; sketch.links.len()],
        cells,
    };
    let edges: Vec<(f64, f64)> = (0..columns)
        .map(|c| {
            let pads = [left[c] as f64 * PADDING.0, right[c] as f64 * PADDING.0];
            (x[c] - wide[c] - pads[0], x[c] + wide[c] + pads[1])
        })
        .collect();
    fold(sketch, &mut placed, &edges, edge - BOND.1);
    placed
}

/// The room of several words.
fn words_room(words: &[Words]) -> Room {
    room_of(words.iter().map(Words::room)).unwrap_or(Room {
        left: 0.0,
        top: 0.0,
        right: 0.0,
        bottom: 0.0,
    })
}

/// The cells of a box.
#[derive(Clone, Copy, Debug)]
struct Span {
    left: i32,
    right: i32,
    top: i32,
    bottom: i32,
}

fn spans(sketch: &Sketch, cells: &[grid::Cell]) -> Vec<Option<Span>> {
    let mut spans: Vec<Option<Span>> = vec![None; sketch.groups.len()];
    for (node, cell) in sketch.nodes.iter().zip(cells) {
        let mut group = Some(node.group);
        while let Some(k) = group {
            let one = Span { left: cell.0, right: cell.0, top: cell.1, bottom: cell.1 };
            spans[k] = Some(spans[k].map_or(one, |s| Span {
                left: s.left.min(cell.0),
                right: s.right.max(cell.0),
                top: s.top.min(cell.1),
                bottom: s.bottom.max(cell.1),
            }));
            group = sketch.groups[k].parent;
        }
    }
    spans
}

/// How many boxes have an edge in one place, from a box inward, itself counted.
fn rank(sketch: &Sketch, spans: &[Option<Span>], group: usize, of: &dyn Fn(&Span) -> i32) -> usize {
    let Some(own) = &spans[group] else { return 0 };
    let inner = (1..sketch.groups.len()).filter(|k| sketch.groups[*k].parent == Some(group));
    let same = inner.filter(|k| spans[*k].as_ref().is_some_and(|s| of(s) == of(own)));
    1 + same.map(|k| rank(sketch, spans, k, of)).max().unwrap_or(0)
}

/// A group's nodes and boxes on a grid.
fn arrange(sketch: &Sketch, group: usize) -> Block {
    let own =
        (0..sketch.nodes.len()).filter(|k| sketch.nodes[*k].group == group).map(Block::single);
    let inner = (1..sketch.groups.len()).filter(|k| sketch.groups[*k].parent == Some(group));
    let mut blocks: Vec<Block> = own.collect();
    blocks.extend(inner.map(|k| arrange(sketch, k)).filter(|block| !block.nodes.is_empty()));
    // Numbers of their own, so that the rest of the graph costs nothing.
    let mut names: Vec<usize> = vec![];
    let mut numbers: HashMap<usize, usize> = HashMap::new();
    for block in &mut blocks {
        for (node, _) in &mut block.nodes {
            numbers.insert(*node, names.len());
            names.push(*node);
            *node = names.len() - 1;
        }
    }
    let inside = names.len();
    let mut nodes = inside;
    let mut rim = vec![];
    let mut edges = vec![];
    let is_leaf = |k: usize| sketch.nodes[k].kind == NodeKind::Element;
    for link in &sketch.links {
        let wish = if is_leaf(link.from) || is_leaf(link.to) { Wish::Hang } else { Wish::Along };
        let (from, to) = match (numbers.get(&link.from), numbers.get(&link.to)) {
            (Some(from), Some(to)) => (*from, *to),
            (None, None) => continue,
            // A bond that leaves: what it leads to stands in for everything outside.
            (Some(here), None) | (None, Some(here)) => {
                blocks.push(Block::single(nodes));
                rim.push(nodes);
                nodes += 1;
                let ends = [*here, nodes - 1];
                if numbers.contains_key(&link.from) {
                    (ends[0], ends[1])
                } else {
                    (ends[1], ends[0])
                }
            }
        };
        // Sources feed from the left.
        let wish = match wish {
            Wish::Hang if is_leaf(link.from) && sketch.nodes[link.from].title.contains("S") => {
                Wish::Along
            }
            wish => wish,
        };
        edges.push(Edge { from, to, wish });
    }
    let problem = grid::Problem { blocks: &blocks, edges: &edges, nodes, rim: &rim };
    let mut block = grid::arrange(&problem);
    block.nodes.retain(|(node, _)| *node < inside);
    block.squeeze();
    block.nodes.iter_mut().for_each(|(node, _)| *node = names[*node]);
    block
}
