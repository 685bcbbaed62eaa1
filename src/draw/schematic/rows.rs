//! Long ladders in rows, as a text in lines: a part is cut at nodes that nothing bridges, and a wire leads from the end
//! of each row to the beginning of the next.

use super::place::Drawn;
use super::plan::{Part, Span};
use crate::circuit::Circuit;

/// The width at which a row ends where it can.
pub const PAGE: f64 = 1500.0;
/// Room for the wire that leads to the next row: at its sides, and below what stands in it.
const LANE: (f64, f64) = (22.0, 16.0);

/// Draws a part in one row or several; gives what is drawn, its width, and how far it reaches above and below the line of
/// the first.
pub(super) fn draw<'c>(circuit: &'c Circuit, part: &Part) -> (Drawn<'c>, (f64, f64, f64)) {
    let mut whole = Drawn::new(circuit);
    let room = whole.part(part);
    let pieces = match room.0 > PAGE {
        true => cut(part, &whole.places),
        false => vec![],
    };
    if pieces.len() < 2 {
        return (whole, room);
    }
    let rows: Vec<(Drawn, (f64, f64, f64))> = pieces
        .iter()
        .map(|piece| {
            let mut row = Drawn::new(circuit);
            let room = row.part(piece);
            (row, room)
        })
        .collect();
    let right = rows.iter().map(|(_, room)| room.0).fold(0.0, f64::max) + 2.0 * LANE.0;
    let mut all = Drawn::new(circuit);
    let above = rows[0].1.1;
    // The line of the row, and where the one before it ended.
    let (mut line, mut before, mut lowest) = (0.0, None, 0.0);
    for (k, (mut row, (_, up, down))) in rows.into_iter().enumerate() {
        if k > 0 {
            line = lowest + LANE.1 + up;
        }
        let first = row.places.first().map_or(0.0, |place| place.0) + LANE.0;
        let last = row.places.last().map_or(0.0, |place| place.1) + LANE.0;
        row.schematic.shift(LANE.0, line);
        all.schematic.take(row.schematic);
        if let Some((x, y)) = before {
            let lane = lowest + 0.5 * LANE.1;
            let way = [(x, y), (right, y), (right, lane), (0.0, lane), (0.0, line), (first, line)];
            way.windows(2).for_each(|ends| all.wire(ends[0], ends[1]));
        }
        before = Some((last, line));
        lowest = line + down;
    }
    (all, (right + 10.0, above, lowest))
}

/// The pieces of a part, each but the first beginning with the node at which the one before ends.
fn cut(part: &Part, places: &[(f64, f64)]) -> Vec<Part> {
    let bridged = |k: usize| part.spans.iter().any(|Span { ends: (a, b), .. }| *a < k && k < *b);
    let count = part.line.len();
    let mut pieces = vec![];
    let mut from = 0;
    while from + 1 < count {
        let far = |k: usize| places[k].0 - places[from].0;
        let free = || (from + 1..count - 1).filter(|k| !bridged(*k));
        let fits = free().rfind(|k| far(*k) <= PAGE);
        let rest = far(count - 1) <= PAGE;
        let to = if rest { None } else { fits.or_else(|| free().next()) };
        let to = to.unwrap_or(count - 1);
        pieces.push(piece(part, from, to));
        from = to;
    }
    pieces
}

/// What stands from one node of the line to another; what hangs on the last stands in the next piece.
fn piece(part: &Part, from: usize, to: usize) -> Part {
    let mut line = part.line[from..=to].to_vec();
    if let (true, Some((_, shunts))) = (to + 1 < part.line.len(), line.last_mut()) {
        shunts.clear();
    }
    let inside = part.spans.iter().filter(|span| span.ends.0 >= from && span.ends.1 <= to);
    let spans = inside.map(|span| Span { ends: (span.ends.0 - from, span.ends.1 - from), ..*span });
    Part { line, spans: spans.collect() }
}
