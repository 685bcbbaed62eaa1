//! What stands at single places of a panel: lines that help to read and marked points, each with its name where nothing
//! is in the way.

use super::super::picture::{Anchor, Ink, Picture, Point, Room, Shape, Stroke, Words};
use super::Panel;

/// The size of letters.
const SIZE: f64 = 10.0;
/// Half the size of a mark.
const MARK: f64 = 4.0;

/// Draws the lines that help to read, within the frame; their names are words to be kept clear of.
pub(super) fn guides(
    panel: &Panel,
    at: &dyn Fn(&Point) -> Point,
    frame: Room,
    taken: &mut Vec<Room>,
    picture: &mut Picture,
) {
    for guide in &panel.guides {
        let points: Vec<Point> = guide.points.iter().map(at).collect();
        let stroke = match guide.strong {
            true => Stroke::new(Ink::Plain, 0.9),
            false => Stroke::new(Ink::Faint, 0.7).dashed().sheer(0.7),
        };
        let mut end = None;
        let mut piece: Vec<Point> = vec![];
        for pair in points.windows(2) {
            let Some((first, last)) = frame.cuts(pair[0], pair[1]) else { continue };
            let on = |part: f64| {
                let ((x, y), (u, v)) = (pair[0], pair[1]);
                (x + part * (u - x), y + part * (v - y))
            };
            if first > 0.0 || piece.is_empty() {
                if piece.len() > 1 {
                    picture.path(std::mem::take(&mut piece), stroke);
                }
                piece = vec![on(first)];
            }
            piece.push(on(last));
            end = Some(on(last));
        }
        if piece.len() > 1 {
            picture.path(piece, stroke);
        }
        let Some((x, y)) = end.filter(|_| !guide.name.is_empty()) else { continue };
        // What ends within the frame is named below its end.
        let below = if frame.grown(-1.0).cuts((x, y), (x, y + 0.5)).is_some() { 13.0 } else { 0.0 };
        let mut words = Words::new((x, y + below), guide.name.as_str(), SIZE, Ink::Faint);
        // All of it within the frame.
        let half = words.width() / 2.0 + 3.0;
        words.at.0 = x.clamp(frame.left + half, frame.right - half);
        words.at.1 = (y + below).clamp(frame.top + SIZE, frame.bottom - 5.0);
        let room = words.room();
        if !taken.iter().any(|other| other.overlaps(&room)) {
            taken.push(room);
            write(words, picture);
        }
    }
    // Marks are named beside the axes, not on them.
    for guide in panel.guides.iter().filter(|guide| guide.strong) {
        for pair in guide.points.windows(2) {
            taken.push(Room::along(at(&pair[0]), at(&pair[1])).grown(0.5));
        }
    }
}

/// Words on a ground of their own, since lines may pass behind them.
fn write(words: Words, picture: &mut Picture) {
    let room = words.room();
    let corners = vec![
        (room.left, room.top),
        (room.right, room.top),
        (room.right, room.bottom),
        (room.left, room.bottom),
    ];
    let fill = Some((Ink::Paper, 0.8));
    picture.shapes.push(Shape::Area { points: corners, fill, stroke: None, round: false });
    picture.words(words);
}

/// A cross or a circle.
pub(super) fn mark((u, v): Point, ink: Ink, cross: bool, picture: &mut Picture) {
    let stroke = Stroke::new(ink, 1.5);
    if cross {
        picture.line((u - MARK, v - MARK), (u + MARK, v + MARK), stroke);
        picture.line((u - MARK, v + MARK), (u + MARK, v - MARK), stroke);
    } else {
        let shape = Shape::Circle { at: (u, v), radius: MARK, fill: None, stroke: Some(stroke) };
        picture.shapes.push(shape);
    }
}

/// Draws the marked points within the frame, and the names of those beside which there is room.
pub(super) fn marks(
    panel: &Panel,
    at: &dyn Fn(&Point) -> Point,
    frame: Room,
    taken: &mut Vec<Room>,
    picture: &mut Picture,
) {
    let places: Vec<Point> = panel.marks.iter().map(|mark| at(&mark.at)).collect();
    let is_inside = |p: &Point| {
        (frame.left - 0.01..=frame.right + 0.01).contains(&p.0)
            && (frame.top - 0.01..=frame.bottom + 0.01).contains(&p.1)
    };
    for (mark, place) in panel.marks.iter().zip(&places).filter(|(_, place)| is_inside(place)) {
        let (u, v) = *place;
        self::mark(*place, mark.ink, mark.cross, picture);
        taken.push(Room { left: u, top: v, right: u, bottom: v }.grown(MARK));
    }
    let mut named: Vec<(Point, &str)> = vec![];
    for (mark, place) in panel.marks.iter().zip(&places).filter(|(_, place)| is_inside(place)) {
        // Marks in one place that have one name are named once.
        let again = named.iter().any(|(other, name)| *name == mark.name && near(*other, *place));
        if mark.name.is_empty() || again {
            continue;
        }
        named.push((*place, &mark.name));
        let (u, v) = *place;
        let high = 0.36 * SIZE;
        let sides = [
            ((u + 8.0, v + high), Anchor::Start),
            ((u - 8.0, v + high), Anchor::End),
            ((u, v - 8.0), Anchor::Middle),
            ((u, v + 8.0 + 2.0 * high), Anchor::Middle),
            ((u + 6.0, v - 7.0), Anchor::Start),
            ((u - 6.0, v - 7.0), Anchor::End),
            ((u + 6.0, v + 7.0 + 2.0 * high), Anchor::Start),
            ((u - 6.0, v + 7.0 + 2.0 * high), Anchor::End),
        ];
        for (spot, anchor) in sides {
            let mut words = Words::new(spot, mark.name.as_str(), SIZE, Ink::Plain);
            words.anchor = anchor;
            let room = words.room();
            let inside = room.left >= frame.left
                && room.right <= frame.right
                && room.top >= frame.top
                && room.bottom <= frame.bottom;
            if inside && !taken.iter().any(|other| other.overlaps(&room)) {
                taken.push(room);
                write(words, picture);
                break;
            }
        }
    }
}

fn near(a: Point, b: Point) -> bool {
    (a.0 - b.0).abs() < 1.0 && (a.1 - b.1).abs() < 1.0
}
