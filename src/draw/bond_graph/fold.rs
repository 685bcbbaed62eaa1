//! Long pictures in rows, as a text in lines: cut between two columns where hardly a bond passes; such a bond goes on at the
//! left of the next row. Boxes that are cut are drawn in each row.

use super::super::picture::{Point, Room};
use super::place::Placed;
use super::sketch::Sketch;

/// A picture that is wider than this is cut, into rows that are as wide as the other where they can be.
const WIDE: f64 = 3500.0;
const PAGE: f64 = 2000.0;
/// The most bonds that may pass a cut.
const MOST: usize = 2;
/// Room between two rows, and where in it the first bond that passes runs.
const GAP: (f64, f64) = (64.0, 28.0);
/// How far outside of the rows bonds turn, and from bond to bond.
const TURN: (f64, f64) = (34.0, 9.0);

/// Cuts a picture whose columns have these left and right edges, where it is too wide; `high` is its height.
pub(super) fn fold(sketch: &Sketch, placed: &mut Placed, edges: &[(f64, f64)], high: f64) {
    let starts = starts(sketch, placed, edges);
    if starts.len() < 2 {
        return;
    }
    let row_of = |column: i32| starts.partition_point(|start| *start <= column as usize) - 1;
    let left = |row: usize| edges[starts[row]].0;
    let last = |row: usize| starts.get(row + 1).map_or(edges.len(), |next| *next) - 1;
    let down = |row: usize| row as f64 * (high + GAP.0);
    let moved = |row: usize, (x, y): Point| (x - left(row), y + down(row));
    let right = (0..starts.len()).map(|row| edges[last(row)].1 - left(row)).fold(0.0, f64::max);
    for (at, cell) in placed.nodes.iter_mut().zip(&placed.cells) {
        *at = moved(row_of(cell.0), *at);
    }
    let cut = |room: &Room| {
        let pieces = (0..starts.len()).filter_map(|row| {
            let (from, to) = (edges[starts[row]].0 - 8.0, edges[last(row)].1 + 8.0);
            let (low, high) = (room.left.max(from), room.right.min(to));
            let (low, top) = moved(row, (low, room.top));
            let (high, bottom) = moved(row, (high, room.bottom));
            (low < high).then_some(Room { left: low, top, right: high, bottom })
        });
        pieces.collect::<Vec<_>>()
    };
    for pieces in &mut placed.boxes {
        *pieces = pieces.iter().flat_map(cut).collect();
    }
    // How many bonds have turned below each row.
    let mut turned = vec![0; starts.len()];
    for (link, turns) in sketch.links.iter().zip(&mut placed.turns) {
        let rows = [link.from, link.to].map(|node| row_of(placed.cells[node].0));
        if rows[0] == rows[1] {
            continue;
        }
        let (upper, lower) = (rows[0].min(rows[1]), rows[0].max(rows[1]));
        let by = f64::from(turned[upper]);
        turned[upper] += 1;
        let ends = [link.from, link.to].map(|node| placed.nodes[node].1);
        let (from, to) = if rows[0] < rows[1] { (ends[0], ends[1]) } else { (ends[1], ends[0]) };
        // Each further bond turns farther out and lower; what passes several rows runs in the gap above the last.
        let lane = down(lower) - GAP.0 + GAP.1 + TURN.1 * by;
        let (out, back) = (right + TURN.0 + TURN.1 * by, -TURN.0 - TURN.1 * by);
        *turns = vec![(out, from), (out, lane), (back, lane), (back, to)];
        if rows[0] > rows[1] {
            turns.reverse();
        }
    }
}

/// The first columns of the rows.
fn starts(sketch: &Sketch, placed: &Placed, edges: &[(f64, f64)]) -> Vec<usize> {
    let mut starts = vec![0];
    let (Some(first), Some(last)) = (edges.first(), edges.last()) else { return starts };
    if last.1 - first.0 <= WIDE {
        return starts;
    }
    let passing = |column: usize| {
        let side = |node: usize| placed.cells[node].0 as usize >= column;
        let links = sketch.links.iter().filter(|link| side(link.from) != side(link.to));
        // Only what leads from one column to the next turns without meeting others.
        let near = links.map(|link| {
            (placed.cells[link.from].0 - placed.cells[link.to].0).unsigned_abs() as usize
        });
        near.map(|far| if far == 1 { 1 } else { MOST + 1 }).sum::<usize>()
    };
    loop {
        let start = starts[starts.len() - 1];
        if last.1 - edges[start].0 <= PAGE {
            return starts;
        }
        let fits = |column: &usize| edges[*column - 1].1 - edges[start].0 <= PAGE;
        let free = (start + 1..edges.len()).filter(|column| passing(*column) <= MOST);
        let (near, far): (Vec<usize>, Vec<usize>) = free.partition(fits);
        // The last that fits with the fewest bonds, else the first that does not.
        let best = near.iter().rev().min_by_key(|column| passing(**column)).or(far.first());
        match best {
            Some(column) => starts.push(*column),
            None => return starts,
        }
    }
}
