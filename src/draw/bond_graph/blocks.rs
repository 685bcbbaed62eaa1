//! Signals as blocks below the bond graph, and the short arrows in it where they come in or something is measured.

use super::super::grid::{self, Edge, Wish};
use super::super::picture::{Anchor, Ink, Picture, Point, Room, Shape, Stroke, Words};
use super::super::text::cut;
use super::signals::{Block, BlockKind, Signals, Tap};

/// Sizes of letters: names, laws.
const SIZES: (f64, f64) = (12.0, 10.0);
/// Room between two columns and two rows.
const GAP: (f64, f64) = (44.0, 26.0);
/// Half the height of a block.
const HALF: f64 = 18.0;
/// Letters at a short arrow in the bond graph.
const TAP: usize = 32;
/// The length of an arrow's head, and half its breadth.
const HEAD: (f64, f64) = (7.0, 3.0);

/// The pen of signals.
fn pen() -> Stroke {
    Stroke::new(Ink::Plain, 1.0)
}

/// A thin full arrow.
fn arrow(a: Point, b: Point, title: String, picture: &mut Picture) {
    let (dx, dy) = (b.0 - a.0, b.1 - a.1);
    let length = (dx * dx + dy * dy).sqrt().max(1e-9);
    let (x, y) = (dx / length, dy / length);
    let neck = (b.0 - HEAD.0 * x, b.1 - HEAD.0 * y);
    picture.shapes.push(Shape::Line { points: vec![a, neck], stroke: pen(), title });
    let side = (-y * HEAD.1, x * HEAD.1);
    let points = vec![b, (neck.0 + side.0, neck.1 + side.1), (neck.0 - side.0, neck.1 - side.1)];
    let fill = Some((Ink::Plain, 1.0));
    picture.shapes.push(Shape::Area { points, fill, stroke: None, round: false });
}

fn words(block: &Block, (x, y): Point) -> Vec<Words> {
    let rise = if block.law.is_empty() { 0.0 } else { 0.55 * SIZES.1 };
    let at = (x, y + 0.36 * SIZES.0 - rise);
    let mut name = Words::new(at, block.title.as_str(), SIZES.0, Ink::Plain);
    name.italic = block.kind != BlockKind::Follower;
    let mut found = vec![name];
    if !block.law.is_empty() {
        let at = (x, y + 0.36 * SIZES.1 + 0.75 * SIZES.1);
        found.push(Words::new(at, block.law.as_str(), SIZES.1, Ink::Faint));
    }
    found
}

/// The room of a block around a place.
fn room(block: &Block, at: Point) -> Room {
    let words = words(block, at);
    let wide = words.iter().map(Words::width).fold(0.0, f64::max) / 2.0;
    let (wide, high) = match block.kind {
        BlockKind::Signal => (wide + 8.0, HALF),
        _ => (wide + 3.0, 0.7 * SIZES.0),
    };
    Room { left: at.0 - wide, top: at.1 - high, right: at.0 + wide, bottom: at.1 + high }
}

/// Blocks that hang together, each at its place from an upper left corner on.
struct Chain {
    places: Vec<(usize, Point)>,
    wide: f64,
    high: f64,
}

/// The chains of blocks, in the order of their first ones.
fn chains(signals: &Signals) -> Vec<Chain> {
    let count = signals.blocks.len();
    let mut first: Vec<usize> = (0..count).collect();
    let mut changes = true;
    while changes {
        changes = false;
        for (from, to) in &signals.arrows {
            let least = first[*from].min(first[*to]);
            changes |= first[*from] != least || first[*to] != least;
            (first[*from], first[*to]) = (least, least);
        }
    }
    let of = |chain: usize| (0..count).filter(|k| first[*k] == chain).collect::<Vec<_>>();
    (0..count).map(of).filter(|own| !own.is_empty()).map(|own| chain(signals, &own)).collect()
}

/// Places the blocks of one chain.
fn chain(signals: &Signals, own: &[usize]) -> Chain {
    let number = |block: &usize| own.iter().position(|other| other == block);
    let edge = |(from, to): &(usize, usize)| {
        Some(Edge { from: number(from)?, to: number(to)?, wish: Wish::Along })
    };
    let edges: Vec<Edge> = signals.arrows.iter().filter_map(edge).collect();
    let (blocks, nodes): (Vec<_>, _) =
        ((0..own.len()).map(grid::Block::single).collect(), own.len());
    let placed = grid::arrange(&grid::Problem { blocks: &blocks, edges: &edges, nodes, rim: &[] });
    let mut wide = vec![0.0_f64; placed.width.max(1) as usize];
    for (node, cell) in &placed.nodes {
        let room = room(&signals.blocks[own[*node]], (0.0, 0.0));
        let column = &mut wide[cell.0 as usize];
        *column = column.max(room.right - room.left);
    }
    let row = 2.0 * HALF + GAP.1;
    let left = |column: usize| wide[..column].iter().map(|wide| wide + GAP.0).sum::<f64>();
    let place = |(node, cell): &(usize, grid::Cell)| {
        let column = cell.0 as usize;
        let at = (left(column) + wide[column] / 2.0, HALF + f64::from(cell.1) * row);
        (own[*node], at)
    };
    Chain {
        places: placed.nodes.iter().map(place).collect(),
        wide: left(wide.len()) - GAP.0,
        high: f64::from(placed.height.max(1)) * row - GAP.1,
    }
}

/// Draws blocks and the arrows between them, their upper left corner at a place, in lines as wide as a page.
pub(super) fn paint(signals: &Signals, corner: Point, page: f64, picture: &mut Picture) {
    let mut places = vec![corner; signals.blocks.len()];
    let (mut x, mut y, mut lowest) = (corner.0, corner.1, corner.1);
    for chain in chains(signals) {
        if x > corner.0 && x + chain.wide > corner.0 + page {
            (x, y) = (corner.0, lowest + GAP.1);
        }
        chain.places.iter().for_each(|(block, at)| places[*block] = (x + at.0, y + at.1));
        x += chain.wide + GAP.0;
        lowest = f64::max(lowest, y + chain.high);
    }
    let rooms: Vec<Room> =
        signals.blocks.iter().zip(&places).map(|(block, at)| room(block, *at)).collect();
    for (from, to) in &signals.arrows {
        let (a, b) = (places[*from], places[*to]);
        let at = |part: f64| (a.0 + part * (b.0 - a.0), a.1 + part * (b.1 - a.1));
        let first = rooms[*from].grown(1.0).cuts(a, b).map_or(0.0, |cut| cut.1);
        let last = rooms[*to].grown(1.0).cuts(a, b).map_or(1.0, |cut| cut.0);
        if first < last {
            let title = format!("{} to {}", signals.blocks[*from].title, signals.blocks[*to].title);
            arrow(at(first), at(last), title, picture);
        }
    }
    for ((block, at), room) in signals.blocks.iter().zip(&places).zip(&rooms) {
        if block.kind == BlockKind::Signal {
            let corners = vec![
                (room.left, room.top),
                (room.right, room.top),
                (room.right, room.bottom),
                (room.left, room.bottom),
            ];
            let stroke = Some(pen());
            picture.shapes.push(Shape::Area { points: corners, fill: None, stroke, round: false });
        }
        for words in words(block, *at) {
            picture.shapes.push(Shape::Words { words, title: block.told.clone() });
        }
    }
}

/// The ways in which a short arrow may leave a node, the best liked first.
const WAYS: [(f64, f64); 8] = [
    (-1.0, -1.0),
    (1.0, -1.0),
    (-1.0, 1.0),
    (1.0, 1.0),
    (0.0, -1.0),
    (0.0, 1.0),
    (-1.0, 0.0),
    (1.0, 0.0),
];

/// Draws a short arrow at a node, where least is in its way; `trouble` says how much, for a room and a line. Gives the
/// room that it takes.
pub(super) fn tap(
    tap: &Tap,
    node: &Room,
    trouble: &dyn Fn(&Room, (Point, Point)) -> f64,
    picture: &mut Picture,
) -> Room {
    let middle = ((node.left + node.right) / 2.0, (node.top + node.bottom) / 2.0);
    let half = ((node.right - node.left) / 2.0 + 2.0, (node.bottom - node.top) / 2.0 + 2.0);
    let mut best: Option<(f64, Point, Point, Words)> = None;
    for (reach, length) in [20.0, 28.0, 38.0, 52.0, 70.0].into_iter().enumerate() {
        for (rank, (x, y)) in WAYS.into_iter().enumerate() {
            let slant = if x != 0.0 && y != 0.0 { 0.75 } else { 1.0 };
            // From a corner a little inward, so that it points at the words.
            let inward = if x != 0.0 && y != 0.0 { 0.8 } else { 1.0 };
            let near = (middle.0 + x * half.0 * inward, middle.1 + y * half.1);
            let far = (near.0 + x * slant * length, near.1 + y * slant * length);
            let mut words = Words::new((0.0, 0.0), cut(&tap.text, TAP), SIZES.1, Ink::Plain);
            words.italic = true;
            (words.anchor, words.at) = match (x > 0.0, x < 0.0) {
                (true, _) => (Anchor::Start, (far.0 + 3.0, far.1 + 0.36 * SIZES.1)),
                (_, true) => (Anchor::End, (far.0 - 3.0, far.1 + 0.36 * SIZES.1)),
                _ if y < 0.0 => (Anchor::Middle, (far.0, far.1 - 3.0)),
                _ => (Anchor::Middle, (far.0, far.1 + 0.74 * SIZES.1 + 2.0)),
            };
            let liking = (rank + 3 * reach) as f64;
            let cost = 1000.0 * trouble(&words.room().grown(1.0), (near, far)) + liking;
            if best.as_ref().is_none_or(|(least, ..)| cost < *least) {
                best = Some((cost, near, far, words));
            }
        }
    }
    let Some((_, near, far, words)) = best else { return *node };
    let (from, to) = if tap.into { (far, near) } else { (near, far) };
    let title = if tap.into { "follows" } else { "measured" };
    arrow(from, to, format!("{title} {}", tap.text), picture);
    let taken = words.room().with(&Room::along(near, far));
    picture.words(words);
    taken
}
