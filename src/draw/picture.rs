//! A picture: lines, shapes and words at their places, before any format; and what of them touches what.
//!
//! x runs to the right and y downward, in units of 1/96 inch as in SVG.

use super::text;

/// A point.
pub type Point = (f64, f64);

/// Colours by meaning, so that a dark page and paper can each have their own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Ink {
    /// Words and lines.
    Plain,
    /// What matters less.
    Faint,
    /// The page itself.
    Paper,
    Electrical,
    Rotation,
    Translation,
    Hydraulic,
    Magnetic,
    Thermal,
    Pneumatic,
    /// What needs attention.
    Warning,
    /// A curve of a plot, by its number.
    Curve(u8),
}

/// The curves that can be told apart by colour.
pub const CURVES: u8 = 8;

/// Every ink with the name of its class and its colours on a light and on a dark page.
pub const INKS: &[(Ink, &str, &str, &str)] = &[
    (Ink::Plain, "plain", "#1a1a1a", "#e8e8e8"),
    (Ink::Faint, "faint", "#6f6f6f", "#9d9d9d"),
    (Ink::Paper, "paper", "#ffffff", "#16181d"),
    (Ink::Electrical, "electrical", "#1257b8", "#7db2ff"),
    (Ink::Rotation, "rotation", "#b04a00", "#ffab6b"),
    (Ink::Translation, "translation", "#217a2c", "#79d184"),
    (Ink::Hydraulic, "hydraulic", "#00757f", "#54d2dc"),
    (Ink::Magnetic, "magnetic", "#7c2fa8", "#d09bf2"),
    (Ink::Thermal, "thermal", "#b3193f", "#ff8aa5"),
    (Ink::Pneumatic, "pneumatic", "#666600", "#d3d36a"),
    (Ink::Warning, "warning", "#d7191c", "#ff6b6b"),
    (Ink::Curve(0), "c0", "#1257b8", "#7db2ff"),
    (Ink::Curve(1), "c1", "#d1480c", "#ff9a62"),
    (Ink::Curve(2), "c2", "#217a2c", "#79d184"),
    (Ink::Curve(3), "c3", "#7c2fa8", "#d09bf2"),
    (Ink::Curve(4), "c4", "#00757f", "#54d2dc"),
    (Ink::Curve(5), "c5", "#b3193f", "#ff8aa5"),
    (Ink::Curve(6), "c6", "#80640a", "#e0c050"),
    (Ink::Curve(7), "c7", "#555555", "#b8b8b8"),
];

impl Ink {
    /// Its row in [`INKS`].
    pub fn row(self) -> &'static (Ink, &'static str, &'static str, &'static str) {
        INKS.iter().find(|row| row.0 == self).unwrap_or(&INKS[0])
    }
}

/// How a line is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stroke {
    /// Its colour.
    pub ink: Ink,
    /// Its width.
    pub width: f64,
    /// Whether it is dashed.
    pub dashed: bool,
    /// How opaque it is, 1 for a plain line.
    pub opacity: f64,
}

impl Stroke {
    /// A plain line.
    pub fn new(ink: Ink, width: f64) -> Stroke {
        Stroke { ink, width, dashed: false, opacity: 1.0 }
    }

    /// The same, dashed.
    pub fn dashed(self) -> Stroke {
        Stroke { dashed: true, ..self }
    }

    /// The same, through which one sees.
    pub fn sheer(self, opacity: f64) -> Stroke {
        Stroke { opacity, ..self }
    }
}

/// On which side of its place a text stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Anchor {
    Start,
    Middle,
    End,
}

/// Words at a place.
#[derive(Clone, Debug, PartialEq)]
pub struct Words {
    /// Where they stand: their base line.
    pub at: Point,
    /// What they say.
    pub text: String,
    /// What stands below the line after them.
    pub below: String,
    /// Their size.
    pub size: f64,
    /// Their colour.
    pub ink: Ink,
    /// Where `at` is in them.
    pub anchor: Anchor,
    /// Heavy letters.
    pub bold: bool,
    /// Leaning letters, as for variables.
    pub italic: bool,
    /// Turned by a quarter, to be read upward.
    pub upward: bool,
    /// What they speak of, where a page about it may lead to more: `R:eta`, the name of a device; else empty.
    pub of: String,
}

/// The size of what stands below the line, as a part of the size of the words.
pub const BELOW: f64 = 0.72;

impl Words {
    /// Plain words whose middle is at a place.
    pub fn new(at: Point, text: impl Into<String>, size: f64, ink: Ink) -> Words {
        Words {
            at,
            text: text.into(),
            below: String::new(),
            size,
            ink,
            anchor: Anchor::Middle,
            bold: false,
            italic: false,
            upward: false,
            of: String::new(),
        }
    }

    /// How wide they are.
    pub fn width(&self) -> f64 {
        // Heavy letters are about a fifteenth wider.
        let weight = if self.bold { 1.07 } else { 1.0 };
        weight * text::width(&self.text, self.size) + text::width(&self.below, BELOW * self.size)
    }

    /// The room they take.
    pub fn room(&self) -> Room {
        let width = self.width();
        let left = match self.anchor {
            Anchor::Start => 0.0,
            Anchor::Middle => -width / 2.0,
            Anchor::End => -width,
        };
        let down = if self.below.is_empty() { 0.22 } else { 0.36 } * self.size;
        let (x, y) = self.at;
        match self.upward {
            false => Room {
                left: x + left,
                top: y - 0.74 * self.size,
                right: x + left + width,
                bottom: y + down,
            },
            true => Room {
                left: x - 0.74 * self.size,
                top: y - left - width,
                right: x + down,
                bottom: y - left,
            },
        }
    }
}

/// A thing in a picture.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs)]
pub enum Shape {
    /// Straight lines from point to point.
    Line { points: Vec<Point>, stroke: Stroke, title: String },
    /// A closed shape; filled with `fill`, which may be sheer.
    Area { points: Vec<Point>, fill: Option<(Ink, f64)>, stroke: Option<Stroke>, round: bool },
    /// A circle.
    Circle { at: Point, radius: f64, fill: Option<Ink>, stroke: Option<Stroke> },
    /// An arc of a circle from one angle to another, in degrees, clockwise on the page.
    Arc { at: Point, radius: f64, from: f64, to: f64, stroke: Stroke },
    /// Words, and what a pointer over them is told.
    Words { words: Words, title: String },
    /// Many points of one size.
    Dots { points: Vec<Point>, radius: f64, ink: Ink },
}

/// A rectangle.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(missing_docs)]
pub struct Room {
    pub left: f64,
    pub top: f64,
    pub right: f64,
    pub bottom: f64,
}

impl Room {
    /// The smallest that holds a line.
    pub fn along(a: Point, b: Point) -> Room {
        Room { left: a.0.min(b.0), top: a.1.min(b.1), right: a.0.max(b.0), bottom: a.1.max(b.1) }
    }

    /// Whether two have more than an edge in common.
    pub fn overlaps(&self, other: &Room) -> bool {
        self.left < other.right
            && other.left < self.right
            && self.top < other.bottom
            && other.top < self.bottom
    }

    /// How much they have in common, in units of area.
    pub fn common(&self, other: &Room) -> f64 {
        let wide = self.right.min(other.right) - self.left.max(other.left);
        let high = self.bottom.min(other.bottom) - self.top.max(other.top);
        wide.max(0.0) * high.max(0.0)
    }

    /// The same, grown on all sides.
    pub fn grown(&self, by: f64) -> Room {
        Room {
            left: self.left - by,
            top: self.top - by,
            right: self.right + by,
            bottom: self.bottom + by,
        }
    }

    /// The smallest that holds both.
    pub fn with(&self, other: &Room) -> Room {
        Room {
            left: self.left.min(other.left),
            top: self.top.min(other.top),
            right: self.right.max(other.right),
            bottom: self.bottom.max(other.bottom),
        }
    }

    /// The parts of a line, from 0 at `a` to 1 at `b`, between which it runs inside; `None` where it passes by.
    pub fn cuts(&self, a: Point, b: Point) -> Option<(f64, f64)> {
        let (mut first, mut last) = (0.0_f64, 1.0_f64);
        for (from, to, low, high) in
            [(a.0, b.0, self.left, self.right), (a.1, b.1, self.top, self.bottom)]
        {
            let change = to - from;
            if change.abs() < 1e-12 {
                if from <= low || from >= high {
                    return None;
                }
                continue;
            }
            let (enter, leave) = ((low - from) / change, (high - from) / change);
            first = first.max(enter.min(leave));
            last = last.min(enter.max(leave));
        }
        (first < last).then_some((first, last))
    }
}

/// A whole picture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Picture {
    /// What it shows.
    pub title: String,
    /// Its size.
    pub width: f64,
    /// Its size.
    pub height: f64,
    /// What is in it, the lowest first.
    pub shapes: Vec<Shape>,
}

impl Picture {
    /// Adds a line between two points.
    pub fn line(&mut self, a: Point, b: Point, stroke: Stroke) {
        self.path(vec![a, b], stroke);
    }

    /// Adds a line through points.
    pub fn path(&mut self, points: Vec<Point>, stroke: Stroke) {
        self.shapes.push(Shape::Line { points, stroke, title: String::new() });
    }

    /// Adds words.
    pub fn words(&mut self, words: Words) {
        self.shapes.push(Shape::Words { words, title: String::new() });
    }

    /// Moves everything in it, and makes it as large as what is in it and a margin.
    pub fn fit(&mut self, margin: f64) {
        let Some(all) = self.shapes.iter().map(Shape::room).reduce(|a, b| a.with(&b)) else {
            return;
        };
        let (x, y) = (margin - all.left, margin - all.top);
        self.shapes.iter_mut().for_each(|shape| shape.shift(x, y));
        self.width = (all.right - all.left + 2.0 * margin).ceil();
        self.height = (all.bottom - all.top + 2.0 * margin).ceil();
    }
}

impl Shape {
    /// The room it takes.
    pub fn room(&self) -> Room {
        let around = |points: &[Point], by: f64| {
            let start = Room {
                left: f64::INFINITY,
                top: f64::INFINITY,
                right: f64::NEG_INFINITY,
                bottom: f64::NEG_INFINITY,
            };
            let grow = |room: Room, p: &Point| {
                room.with(&Room { left: p.0, top: p.1, right: p.0, bottom: p.1 })
            };
            points.iter().fold(start, grow).grown(by)
        };
        match self {
            Shape::Line { points, stroke, .. } => around(points, stroke.width / 2.0),
            Shape::Area { points, stroke, .. } => {
                around(points, stroke.map_or(0.0, |stroke| stroke.width / 2.0))
            }
            Shape::Circle { at, radius, .. } | Shape::Arc { at, radius, .. } => {
                around(&[*at], *radius)
            }
            Shape::Words { words, .. } => words.room(),
            Shape::Dots { points, radius, .. } => around(points, *radius),
        }
    }

    fn shift(&mut self, x: f64, y: f64) {
        let shift = |point: &mut Point| *point = (point.0 + x, point.1 + y);
        match self {
            Shape::Line { points, .. }
            | Shape::Area { points, .. }
            | Shape::Dots { points, .. } => {
                points.iter_mut().for_each(shift);
            }
            Shape::Circle { at, .. } | Shape::Arc { at, .. } => shift(at),
            Shape::Words { words, .. } => shift(&mut words.at),
        }
    }
}
