//! Plots of traces: panels one below the other over a common abscissa, as a picture or as text for a terminal.

mod axis;
mod panels;
mod marks;
mod roots;
mod flows;
mod terminal;
mod traces;
#[cfg(test)]
mod tests;

pub use axis::{Axis, Scale, ticks};
pub use flows::flows;
pub use panels::paint;
pub use roots::{Root, roots};
pub use terminal::write as terminal;
pub use traces::{Choice, Kind, Missing, Source, compared, panels};

use super::picture::{Ink, Point};

/// A line through points in the units of the axes; a point that is no number breaks it.
#[derive(Clone, Debug)]
pub struct Curve {
    /// What the legend says; nothing is said where it is empty.
    pub name: String,
    /// Its colour.
    pub ink: Ink,
    /// Whether it is dashed.
    pub dashed: bool,
    /// Its width.
    pub width: f64,
    /// Its points.
    pub points: Vec<Point>,
}

/// What lies between two lines.
#[derive(Clone, Debug)]
pub struct Band {
    /// What the legend says.
    pub name: String,
    /// Its colour.
    pub ink: Ink,
    /// Points of its lower and of its upper edge, as many of each.
    pub edges: [Vec<Point>; 2],
}

/// One pair of axes and what is drawn in them.
#[derive(Clone, Debug, Default)]
pub struct Panel {
    /// What stands above it.
    pub title: String,
    /// The abscissa.
    pub x: Axis,
    /// The ordinate.
    pub y: Axis,
    /// Lines.
    pub curves: Vec<Curve>,
    /// Areas below the lines.
    pub bands: Vec<Band>,
    /// Single points, marked by a small cross or circle as their name says.
    pub marks: Vec<Mark>,
    /// What the legend says of marks: each kind once, with its name, wherever it lies.
    pub keys: Vec<Mark>,
    /// Lines below everything that help to read.
    pub guides: Vec<Guide>,
    /// Whether a unit is as long along both axes.
    pub equal: bool,
}

/// A marked point.
#[derive(Clone, Debug)]
pub struct Mark {
    /// Where.
    pub at: Point,
    /// Its colour.
    pub ink: Ink,
    /// A cross; else a circle.
    pub cross: bool,
    /// What is written beside it, where there is room.
    pub name: String,
}

/// A thin line that helps to read.
#[derive(Clone, Debug)]
pub struct Guide {
    /// Its points.
    pub points: Vec<Point>,
    /// What is written where it ends or leaves the frame, where there is room.
    pub name: String,
    /// Whether it is drawn as an axis.
    pub strong: bool,
}
