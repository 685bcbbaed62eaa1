//! The picture of a placed sketch: nodes first, then bonds cut at their words, then labels where there is room.

use super::super::picture::{Anchor, Ink, Picture, Point, Room, Shape, Stroke, Words};
use super::blocks;
use super::letters;
use super::place::Placed;
use super::sketch::{Group, Link, Node, NodeKind, Sketch};
use crate::bond::graph::{BondGraph, Stroke as Causal};
use crate::quantity::Domain;

/// Sizes of letters: titles, what stands below them, bonds.
const SIZES: (f64, f64, f64) = (14.0, 10.5, 12.0);
/// How far a bond ends from the words at its end.
const GAP: f64 = 5.0;
/// The room around everything.
const MARGIN: f64 = 14.0;
/// Blocks of signals have at least so much width.
const LEAST_PAGE: f64 = 700.0;

/// The words of a node around a place.
pub(super) fn node_words(node: &Node, at: Point) -> Vec<Words> {
    let ink = match node.dependent {
        true => Ink::Warning,
        false if node.kind == NodeKind::Element => letters(node.domain).2,
        false => Ink::Plain,
    };
    let (x, y) = at;
    let mut title = Words::new((x, y + 0.36 * SIZES.0), node.title.as_str(), SIZES.0, ink);
    title.bold = matches!(node.kind, NodeKind::Junction | NodeKind::Part);
    let mut words = vec![title];
    if !node.below.is_empty() {
        let ink = if node.kind == NodeKind::Junction { Ink::Plain } else { Ink::Faint };
        let at = (x, y + 0.36 * SIZES.0 + 1.25 * SIZES.1);
        let mut below = Words::new(at, node.below.as_str(), SIZES.1, ink);
        below.italic = node.modulated;
        words.push(below);
    }
    words
}

/// The title of a box.
pub(super) fn group_words(group: &Group, at: Point) -> Words {
    let mut words = Words::new(at, format!("{}: {}", group.name, group.model), 11.0, Ink::Faint);
    words.anchor = Anchor::Start;
    words
}

/// The smallest room that holds several.
pub(super) fn room_of(rooms: impl Iterator<Item = Room>) -> Option<Room> {
    rooms.reduce(|a, b| a.with(&b))
}

/// Draws.
pub fn paint(graph: &BondGraph, sketch: &Sketch, placed: &Placed) -> Picture {
    let mut picture = Picture { title: sketch.title.clone(), ..Picture::default() };
    let mut rooms = vec![];
    let (mut frames, mut edges) = (vec![], vec![]);
    let boxes = sketch.groups.iter().zip(&placed.boxes);
    for (group, room) in boxes.flat_map(|(group, own)| own.iter().map(move |room| (group, room))) {
        let corners = vec![
            (room.left, room.top),
            (room.right, room.top),
            (room.right, room.bottom),
            (room.left, room.bottom),
        ];
        let stroke = Some(Stroke::new(Ink::Faint, 1.0).dashed());
        edges.extend([(corners[0], corners[1]), (corners[1], corners[2])]);
        edges.extend([(corners[2], corners[3]), (corners[3], corners[0])]);
        frames.push((group, *room));
        picture.shapes.push(Shape::Area { points: corners, fill: None, stroke, round: true });
    }
    for (node, at) in sketch.nodes.iter().zip(&placed.nodes) {
        let words = node_words(node, *at);
        let mut room = room_of(words.iter().map(Words::room)).unwrap_or(Room {
            left: at.0,
            top: at.1,
            right: at.0,
            bottom: at.1,
        });
        if node.kind == NodeKind::Part {
            room = room.grown(5.0);
            let corners = vec![
                (room.left, room.top),
                (room.right, room.top),
                (room.right, room.bottom),
                (room.left, room.bottom),
            ];
            let stroke = Some(Stroke::new(Ink::Plain, 1.2));
            picture.shapes.push(Shape::Area { points: corners, fill: None, stroke, round: true });
        }
        for mut words in words {
            let title = node.told.clone();
            words.of.clone_from(&node.of);
            picture.shapes.push(Shape::Words { words, title });
        }
        rooms.push(room);
    }
    let lines: Vec<Option<(Point, Point)>> =
        (0..sketch.links.len()).map(|k| visible(sketch, k, placed, &rooms)).collect();
    for (link, line) in sketch.links.iter().zip(&lines) {
        if let (true, Some((a, b))) = (link.ring > 0, line) {
            // Below everything, as with a marker pen.
            let stroke = Stroke::new(Ink::Curve(6), 11.0).sheer(0.35);
            let points = vec![*a, *b];
            picture.shapes.insert(0, Shape::Line { points, stroke, title: String::new() });
        }
    }
    for (k, (link, line)) in sketch.links.iter().zip(&lines).enumerate() {
        if let Some((a, b)) = line {
            let way = lead(sketch, k, placed, &rooms);
            edges.extend(way.windows(2).map(|ends| (ends[0], ends[1])));
            bond(graph, link, (*a, *b), way, &mut picture);
        }
    }
    let mut titles: Vec<Words> =
        frames.iter().map(|(group, room)| free_title(group, room, &lines)).collect();
    let mut labels = Labels { taken: rooms, lines, edges, words: vec![] };
    labels.taken.extend(titles.iter().map(Words::room));
    for (k, link) in sketch.links.iter().enumerate() {
        labels.bond(k, link);
    }
    for tap in &sketch.signals.taps {
        let node = labels.taken[tap.node];
        let trouble = |room: &Room, line: (Point, Point)| {
            labels.trouble(room, usize::MAX) + labels.passes(line, room, tap.node)
        };
        let room = blocks::tap(tap, &node, &trouble, &mut picture);
        labels.taken.push(room);
    }
    titles.extend(labels.words);
    titles.into_iter().for_each(|words| picture.words(words));
    if !sketch.signals.blocks.is_empty()
        && let Some(all) = room_of(picture.shapes.iter().map(Shape::room))
    {
        let page = (all.right - all.left).max(LEAST_PAGE);
        blocks::paint(&sketch.signals, (all.left, all.bottom + 34.0), page, &mut picture);
    }
    legend(sketch, &mut picture);
    picture.fit(MARGIN);
    picture
}

/// A box's title along its upper edge, or its lower one, where no bond passes.
fn free_title(group: &Group, room: &Room, lines: &[Option<(Point, Point)>]) -> Words {
    let mut words = group_words(group, (0.0, 0.0));
    let slack = (room.right - room.left - 14.0 - words.width()).max(0.0);
    for y in [room.top + 14.0, room.bottom - 7.0] {
        for eighth in 0..=8 {
            words.at = (room.left + 7.0 + slack * f64::from(eighth) / 8.0, y);
            let place = words.room().grown(2.0);
            if !lines.iter().flatten().any(|(a, b)| place.cuts(*a, *b).is_some()) {
                return words;
            }
        }
    }
    words.at = (room.left + 7.0, room.top + 14.0);
    words
}

/// The way of a bond from its tail to its last turn, where it leads to another row.
fn lead(sketch: &Sketch, own: usize, placed: &Placed, rooms: &[Room]) -> Vec<Point> {
    let (link, turns) = (&sketch.links[own], &placed.turns[own]);
    let Some(first) = turns.first() else { return vec![] };
    let tail = placed.nodes[link.from];
    let part = rooms[link.from].grown(GAP).cuts(tail, *first).map_or(0.0, |cut| cut.1);
    let start = (tail.0 + part * (first.0 - tail.0), tail.1 + part * (first.1 - tail.1));
    std::iter::once(start).chain(turns.iter().copied()).collect()
}

/// The part of a bond between the words at its ends; of one that turns on its way what leads to its head.
fn visible(sketch: &Sketch, own: usize, placed: &Placed, rooms: &[Room]) -> Option<(Point, Point)> {
    let link = &sketch.links[own];
    let (a, b) = (placed.nodes[link.from], placed.nodes[link.to]);
    if let Some(last) = placed.turns[own].last() {
        let (part, _) = rooms[link.to].grown(GAP).cuts(*last, b)?;
        return Some((*last, (last.0 + part * (b.0 - last.0), last.1 + part * (b.1 - last.1))));
    }
    // The stroke of a slanting bond slants too, and needs more room at a corner.
    let ((x, y), _) = ways(a, b);
    let gap = GAP + 14.0 * (x * y).abs();
    let (_, first) = rooms[link.from].grown(gap).cuts(a, b)?;
    let (last, _) = rooms[link.to].grown(gap).cuts(a, b)?;
    let at = |part: f64| (a.0 + part * (b.0 - a.0), a.1 + part * (b.1 - a.1));
    (first < last).then(|| (at(first), at(last)))
}

/// The way along a line and the way to the side of the flow: below it, or to its right where it is steep.
fn ways(a: Point, b: Point) -> (Point, Point) {
    let (dx, dy) = (b.0 - a.0, b.1 - a.1);
    let length = (dx * dx + dy * dy).sqrt().max(1e-9);
    let along = (dx / length, dy / length);
    let mut side = (-along.1, along.0);
    let wanted = if dx.abs() >= dy.abs() * 0.999 { side.1 } else { side.0 };
    if wanted < 0.0 {
        side = (-side.0, -side.1);
    }
    (along, side)
}

fn bond(
    graph: &BondGraph,
    link: &Link,
    (a, b): (Point, Point),
    lead: Vec<Point>,
    picture: &mut Picture,
) {
    let (along, side) = ways(a, b);
    let ink = letters(link.domain).2;
    let line = Stroke::new(ink, 1.6);
    let number = link.bond.index() + 1;
    let (e, f, _) = letters(link.domain);
    let title =
        format!("bond {number}: {}, {} ({e}, {f})", graph.bond_name(link.bond), link.domain.name());
    let back = (b.0 - 10.0 * along.0 + 6.0 * side.0, b.1 - 10.0 * along.1 + 6.0 * side.1);
    picture.shapes.push(Shape::Line { points: vec![a, b, back], stroke: line, title });
    // Where it comes from another row, its tail is at the beginning of the way to here.
    let (tail, start) = match lead[..] {
        [first, second, ..] => (first, ways(first, second).0),
        _ => (a, along),
    };
    if lead.len() > 1 {
        picture.path(lead, line);
    }
    let Some(stroke) = link.stroke else { return };
    let (at, along) = if stroke == Causal::AtFrom { (tail, start) } else { (b, along) };
    let across = (-along.1 * 7.0, along.0 * 7.0);
    let ink = if link.dependent { Ink::Warning } else { ink };
    let (p, q) = ((at.0 - across.0, at.1 - across.1), (at.0 + across.0, at.1 + across.1));
    picture.line(p, q, Stroke::new(ink, 2.4));
}

/// Labels that have their places, and what is in the way of others.
struct Labels {
    taken: Vec<Room>,
    lines: Vec<Option<(Point, Point)>>,
    /// Of boxes.
    edges: Vec<(Point, Point)>,
    words: Vec<Words>,
}

impl Labels {
    /// Writes effort and flow of a bond on their sides, where nothing is in the way.
    fn bond(&mut self, own: usize, link: &Link) {
        let Some((a, b)) = self.lines[own] else { return };
        let (_, side) = ways(a, b);
        let (effort, flow, ink) = letters(link.domain);
        for (letter, way) in [(effort, (-side.0, -side.1)), (flow, side)] {
            let mut words = Words::new((0.0, 0.0), letter, SIZES.2, ink);
            words.italic = true;
            words.below = (link.bond.index() + 1).to_string();
            let (wide, high) = (words.width(), 0.95 * SIZES.2);
            let mut best: Option<(f64, Point)> = None;
            for (rank, part) in [0.5, 0.4, 0.6, 0.3, 0.7, 0.22, 0.78].into_iter().enumerate() {
                let on = (a.0 + part * (b.0 - a.0), a.1 + part * (b.1 - a.1));
                // The middle of the label, so far off the line that it touches nothing of it.
                let off = 4.0 + (way.0.abs() * wide + way.1.abs() * high) / 2.0;
                let middle = (on.0 + way.0 * off, on.1 + way.1 * off);
                words.at = (middle.0, middle.1 + 0.26 * SIZES.2);
                let room = words.room().grown(0.5);
                let cost = self.trouble(&room, own) * 1000.0 + rank as f64;
                if best.is_none_or(|(least, _)| cost < least) {
                    best = Some((cost, words.at));
                }
            }
            words.at = best.map_or(words.at, |(_, at)| at);
            self.taken.push(words.room().grown(0.5));
            self.words.push(words);
        }
    }

    /// How much is in the way of a label.
    fn trouble(&self, room: &Room, own: usize) -> f64 {
        let words: f64 = self.taken.iter().map(|other| room.common(other)).sum();
        let others = self.lines.iter().enumerate().filter(|(k, _)| *k != own);
        let lines =
            others.filter_map(|(_, line)| *line).filter(|(a, b)| room.cuts(*a, *b).is_some());
        let edges = self.edges.iter().filter(|(a, b)| room.cuts(*a, *b).is_some());
        words + 20.0 * lines.count() as f64 + 0.1 * edges.count() as f64
    }
}

impl Labels {
    /// How much a short arrow at a node passes over, and how many edges its words.
    fn passes(&self, (a, b): (Point, Point), words: &Room, node: usize) -> f64 {
        let others = self.taken.iter().enumerate().filter(|(k, _)| *k != node);
        let over = others.filter(|(_, room)| room.cuts(a, b).is_some()).count();
        let edges = self.edges.iter().filter(|(p, q)| words.cuts(*p, *q).is_some()).count();
        // Near another line is as bad as over it.
        let near = Room::along(a, b).grown(3.0);
        let lines = self.lines.iter().flatten().chain(&self.edges);
        0.02 * edges as f64
            + 20.0 * (over + lines.filter(|(p, q)| near.cuts(*p, *q).is_some()).count()) as f64
    }
}

/// What the colours and marks mean, below the drawing, and its title above.
fn legend(sketch: &Sketch, picture: &mut Picture) {
    let Some(all) = room_of(picture.shapes.iter().map(Shape::room)) else { return };
    let mut title = Words::new((all.left, all.top - 16.0), sketch.title.as_str(), 13.0, Ink::Plain);
    title.anchor = Anchor::Start;
    title.bold = true;
    picture.words(title);
    let mut entries: Vec<(Option<Stroke>, String, Ink)> = vec![];
    let mut domains: Vec<Domain> = sketch.links.iter().map(|link| link.domain).collect();
    domains.sort_unstable();
    domains.dedup();
    for domain in domains {
        let (effort, flow, ink) = letters(domain);
        let name = if domain == Domain::Any { "any domain" } else { domain.name() };
        entries.push((Some(Stroke::new(ink, 1.6)), format!("{name} ({effort}, {flow})"), ink));
    }
    if sketch.nodes.iter().any(|node| node.dependent) || sketch.links.iter().any(|l| l.dependent) {
        entries.push((
            Some(Stroke::new(Ink::Warning, 2.4)),
            "derivative causality".into(),
            Ink::Warning,
        ));
    }
    if sketch.links.iter().any(|link| link.ring > 0) {
        let text = if sketch.loops > 1 { "algebraic loops" } else { "algebraic loop" };
        entries.push((Some(Stroke::new(Ink::Curve(6), 11.0).sheer(0.35)), text.into(), Ink::Plain));
    }
    if sketch.signals.left_out > 0 {
        let text = format!("{} signals without blocks", sketch.signals.left_out);
        entries.push((None, text, Ink::Faint));
    }
    let (mut x, mut y) = (all.left, all.bottom + 26.0);
    for (stroke, text, ink) in entries {
        let mut words = Words::new((x + 30.0, y + 4.0), text, 11.0, ink);
        words.anchor = Anchor::Start;
        if x > all.left && words.room().right > all.right.max(all.left + 420.0) {
            (x, y) = (all.left, y + 20.0);
            words.at = (x + 30.0, y + 4.0);
        }
        if let Some(stroke) = stroke {
            picture.line((x, y), (x + 22.0, y), stroke);
        }
        x = words.room().right + 18.0;
        picture.words(words);
    }
}
