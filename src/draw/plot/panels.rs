//! Panels as a picture: frames, grids, ticks, legends, curves with no more points than can be seen.

use super::super::picture::{Anchor, Ink, Picture, Point, Room, Shape, Stroke, Words};
use super::super::text;
use super::axis::Ruler;
use super::{Curve, Panel, marks};

/// The width of a panel's frame and its height; of one with equal axes.
const FRAME: (f64, f64) = (720.0, 190.0);
const SQUARE: (f64, f64) = (520.0, 420.0);
/// Left of the frame; above; below where the abscissa is labelled; below where it is not.
const ROOM: (f64, f64, f64, f64) = (84.0, 24.0, 44.0, 14.0);
/// The size of letters.
const SIZE: f64 = 11.0;

/// Draws panels one below the other.
pub fn paint(title: &str, panels: &[Panel]) -> Picture {
    let mut picture = Picture { title: title.to_string(), ..Picture::default() };
    let mut top = 12.0;
    if !title.is_empty() {
        let mut words = Words::new((14.0, 24.0), title, 13.0, Ink::Plain);
        (words.anchor, words.bold) = (Anchor::Start, true);
        picture.words(words);
        top = 36.0;
    }
    let mut right: f64 = 0.0;
    for (k, panel) in panels.iter().enumerate() {
        let same = panels.get(k + 1).is_some_and(|next| {
            next.x.label == panel.x.label && next.x.scale == panel.x.scale && next.title.is_empty()
        });
        let (bottom, edge) = self::panel(panel, panels, top, !same, &mut picture);
        top = bottom;
        right = right.max(edge);
    }
    picture.width = (right + 22.0).ceil();
    picture.height = (top + 8.0).ceil();
    picture
}

/// Draws one; gives where the next begins, and its right edge.
fn panel(
    panel: &Panel,
    all: &[Panel],
    top: f64,
    labelled: bool,
    picture: &mut Picture,
) -> (f64, f64) {
    let (wide, high) = if panel.equal { SQUARE } else { FRAME };
    let (left, mut y) = (ROOM.0, top);
    if !panel.title.is_empty() {
        let mut words = Words::new((left, y + 12.0), panel.title.as_str(), 12.0, Ink::Plain);
        (words.anchor, words.bold) = (Anchor::Start, true);
        picture.words(words);
        y += 20.0;
    }
    y = legend(panel, left, wide, y, picture) + 6.0;
    let of = |pick: fn(&Point) -> f64, panels: &[&Panel]| {
        let mut values: Vec<f64> = vec![];
        for panel in panels {
            values.extend(panel.curves.iter().flat_map(|c| c.points.iter()).map(pick));
            values.extend(panel.bands.iter().flat_map(|b| b.edges.iter().flatten()).map(pick));
            values.extend(panel.marks.iter().map(|m| pick(&m.at)));
        }
        values
    };
    // Panels of one abscissa have the same ends of it.
    let alike: Vec<&Panel> =
        all.iter().filter(|p| p.x.label == panel.x.label && p.x.scale == panel.x.scale).collect();
    let mut across = Ruler::new(&panel.x, of(|p| p.0, &alike).into_iter(), 9, !panel.equal);
    // Where a part of the abscissa is asked for, what lies outside of it takes no room.
    let (low, high_end) = panel.x.limits.unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
    let inside = of(|p| p.0, &[panel]).into_iter().zip(of(|p| p.1, &[panel]));
    let seen = inside.filter(|(x, _)| (low..=high_end).contains(x)).map(|(_, y)| y);
    let mut up = Ruler::new(&panel.y, seen, 5, false);
    if panel.equal {
        (across, up) = equal(panel, &across, &up, wide / high);
    }
    let at = |p: &Point| (left + across.place(p.0) * wide, y + (1.0 - up.place(p.1)) * high);
    let grid = Stroke::new(Ink::Faint, 0.6).sheer(0.35);
    for (part, text) in &across.ticks {
        let x = left + part * wide;
        picture.line((x, y), (x, y + high), grid);
        if labelled {
            picture.words(Words::new((x, y + high + 15.0), text.as_str(), SIZE, Ink::Plain));
        }
    }
    for (part, text) in &up.ticks {
        let line = y + (1.0 - part) * high;
        picture.line((left, line), (left + wide, line), grid);
        let mut words =
            Words::new((left - 7.0, line + 0.36 * SIZE), text.as_str(), SIZE, Ink::Plain);
        words.anchor = Anchor::End;
        picture.words(words);
    }
    let frame = Room { left, top: y, right: left + wide, bottom: y + high };
    let mut taken = vec![];
    marks::guides(panel, &at, frame, &mut taken, picture);
    for band in &panel.bands {
        let inside = |p: &Point| (p.0, p.1.clamp(-1e300, 1e300));
        let mut points: Vec<Point> = band.edges[0].iter().map(|p| at(&inside(p))).collect();
        points.extend(band.edges[1].iter().rev().map(|p| at(&inside(p))));
        points.retain(|p| p.0.is_finite() && p.1.is_finite());
        let points = points.iter().map(|p| (p.0, p.1.clamp(y, y + high))).collect();
        picture.shapes.push(Shape::Area {
            points,
            fill: Some((band.ink, 0.22)),
            stroke: None,
            round: false,
        });
    }
    for curve in &panel.curves {
        for piece in pieces(curve, &at, (left, left + wide), (y, y + high)) {
            let mut stroke = Stroke::new(curve.ink, curve.width);
            stroke.dashed = curve.dashed;
            picture.path(piece, stroke);
        }
    }
    marks::marks(panel, &at, frame, &mut taken, picture);
    let corners = vec![(left, y), (left + wide, y), (left + wide, y + high), (left, y + high)];
    let stroke = Some(Stroke::new(Ink::Faint, 1.0));
    picture.shapes.push(Shape::Area { points: corners, fill: None, stroke, round: false });
    let size = if text::width(&panel.y.label, SIZE) > high { 0.8 * SIZE } else { SIZE };
    let label = text::cut(&panel.y.label, (high / (0.5 * size)) as usize);
    let mut words = Words::new((20.0, y + high / 2.0), label, size, Ink::Plain);
    words.upward = true;
    picture.words(words);
    let below = if labelled {
        picture.words(Words::new(
            (left + wide / 2.0, y + high + 33.0),
            panel.x.label.as_str(),
            SIZE,
            Ink::Plain,
        ));
        ROOM.2
    } else {
        ROOM.3
    };
    (y + high + below, left + wide)
}

/// Rulers on which a unit is as long across as up.
fn equal(panel: &Panel, across: &Ruler, up: &Ruler, shape: f64) -> (Ruler, Ruler) {
    let (w, h) = (across.ends.1 - across.ends.0, up.ends.1 - up.ends.0);
    let high = h.max(w / shape);
    let around = |ends: (f64, f64), length: f64| {
        let middle = (ends.0 + ends.1) / 2.0;
        (middle - length / 2.0, middle + length / 2.0)
    };
    let ruler = |axis: &super::Axis, ends| {
        let axis = super::Axis { limits: Some(ends), ..axis.clone() };
        Ruler::new(&axis, std::iter::empty(), 7, true)
    };
    (ruler(&panel.x, around(across.ends, high * shape)), ruler(&panel.y, around(up.ends, high)))
}

/// The names of the curves in lines above the frame; gives where the frame may begin.
fn legend(panel: &Panel, left: f64, wide: f64, top: f64, picture: &mut Picture) -> f64 {
    let curves = panel.curves.iter().map(|c| {
        (c.name.as_str(), Stroke { dashed: c.dashed, ..Stroke::new(c.ink, c.width.max(1.5)) })
    });
    let bands = panel.bands.iter().map(|b| (b.name.as_str(), Stroke::new(b.ink, 9.0).sheer(0.3)));
    let (mut x, mut y) = (left, top + 12.0);
    let mut any = false;
    for (name, stroke) in curves.chain(bands).filter(|(name, _)| !name.is_empty()) {
        let name = text::cut(name, 60);
        let need = 26.0 + text::width(&name, SIZE) + 16.0;
        if x > left && x + need > left + wide {
            (x, y) = (left, y + 16.0);
        }
        picture.line((x, y - 4.0), (x + 20.0, y - 4.0), stroke);
        let mut words = Words::new((x + 26.0, y), name, SIZE, Ink::Plain);
        words.anchor = Anchor::Start;
        picture.words(words);
        x += need;
        any = true;
    }
    for key in &panel.keys {
        marks::mark((x + 5.0, y - 4.0), key.ink, key.cross, picture);
        let mut words = Words::new((x + 15.0, y), key.name.as_str(), SIZE, Ink::Plain);
        words.anchor = Anchor::Start;
        x += 15.0 + words.width() + 16.0;
        picture.words(words);
        any = true;
    }
    if any { y + 4.0 } else { top }
}

/// A curve on the page, cut where it has no place, with at most four points for each unit of width: the first, the
/// least, the greatest and the last.
fn pieces(
    curve: &Curve,
    at: &dyn Fn(&Point) -> Point,
    (left, right): (f64, f64),
    (top, bottom): (f64, f64),
) -> Vec<Vec<Point>> {
    let mut pieces = vec![];
    let mut piece: Vec<Point> = vec![];
    // Those in the unit of width that is being looked at.
    let mut pile: Vec<Point> = vec![];
    let flush = |pile: &mut Vec<Point>, piece: &mut Vec<Point>| {
        if pile.len() > 4 {
            let low = (0..pile.len()).min_by(|a, b| pile[*a].1.total_cmp(&pile[*b].1));
            let high = (0..pile.len()).max_by(|a, b| pile[*a].1.total_cmp(&pile[*b].1));
            let mut kept = vec![0, low.unwrap_or(0), high.unwrap_or(0), pile.len() - 1];
            kept.sort_unstable();
            kept.dedup();
            piece.extend(kept.into_iter().map(|k| pile[k]));
        } else {
            piece.append(pile);
        }
        pile.clear();
    };
    // Far outside nothing is seen, and some readers of SVG mind large numbers.
    let far = 4.0 * (bottom - top);
    for point in &curve.points {
        let (x, y) = at(point);
        if !x.is_finite() || !y.is_finite() || x < left - 0.01 || x > right + 0.01 {
            flush(&mut pile, &mut piece);
            if piece.len() > 1 {
                pieces.push(std::mem::take(&mut piece));
            }
            piece.clear();
            continue;
        }
        let place = (x, y.clamp(top - far, bottom + far));
        if pile.first().is_some_and(|first| first.0.floor() != place.0.floor()) {
            flush(&mut pile, &mut piece);
        }
        pile.push(place);
    }
    flush(&mut pile, &mut piece);
    if piece.len() == 1 {
        // A single point is a short line.
        piece.push((piece[0].0 + 1.0, piece[0].1));
    }
    if piece.len() > 1 {
        pieces.push(piece);
    }
    let inside = |piece: Vec<Point>| clip(&piece, top, bottom);
    pieces.into_iter().flat_map(inside).collect()
}

/// The parts of a line between two heights.
fn clip(points: &[Point], top: f64, bottom: f64) -> Vec<Vec<Point>> {
    let mut parts: Vec<Vec<Point>> = vec![];
    let mut part: Vec<Point> = vec![];
    for pair in points.windows(2) {
        let (a, b) = (pair[0], pair[1]);
        let (mut first, mut last) = (0.0_f64, 1.0_f64);
        let change = b.1 - a.1;
        if change != 0.0 {
            let (p, q) = ((top - a.1) / change, (bottom - a.1) / change);
            (first, last) = (first.max(p.min(q)), last.min(p.max(q)));
        } else if a.1 < top || a.1 > bottom {
            last = -1.0;
        }
        if first > last {
            continue;
        }
        let on = |part: f64| (a.0 + part * (b.0 - a.0), a.1 + part * change);
        if first > 0.0 || part.is_empty() {
            if part.len() > 1 {
                parts.push(std::mem::take(&mut part));
            }
            part = vec![on(first)];
        }
        part.push(if last == 1.0 { b } else { on(last) });
        if last < 1.0 {
            parts.push(std::mem::take(&mut part));
        }
    }
    if part.len() > 1 {
        parts.push(part);
    }
    parts
}
