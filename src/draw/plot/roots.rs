//! Poles and zeros in the plane of s: crosses and circles, rays of equal damping, circles of equal frequency.
//!
//! Poles of machines lie decades apart. A panel that holds all of them is followed by panels that look closer at the
//! origin, until the slowest can be told apart.

use super::super::picture::{Ink, Point};
use super::{Axis, Guide, Mark, Panel, ticks};
use std::f64::consts::TAU;

/// A pole or a zero.
#[derive(Clone, Debug)]
pub struct Root {
    /// Where it lies, 1/s.
    pub at: Point,
    /// What is written beside it.
    pub name: String,
}

/// A root within this part of the size of a panel is looked at more closely in another one.
const CLOSE: f64 = 0.1;
/// The next panel holds what lies within this part of the last one's.
const STEP: f64 = 0.2;
/// More panels than this are not drawn.
const MOST: usize = 4;
/// Damping along the rays.
const DAMPING: [f64; 5] = [0.1, 0.3, 0.5, 0.7, 0.9];

fn size(at: Point) -> f64 {
    libm::hypot(at.0, at.1)
}

/// The panels of a map of poles and zeros.
pub fn roots(poles: &[Root], zeros: &[Root]) -> Vec<Panel> {
    let sizes: Vec<f64> = poles.iter().chain(zeros).map(|root| size(root.at)).collect();
    let slowest = sizes.iter().copied().filter(|size| *size > 0.0).fold(f64::INFINITY, f64::min);
    let within = |radius: f64| sizes.iter().copied().filter(move |size| *size <= radius);
    let mut radius = sizes.iter().copied().fold(0.0, f64::max);
    let mut panels = vec![];
    loop {
        panels.push(panel(poles, zeros, radius, panels.is_empty()));
        let next = within(STEP * radius).fold(0.0, f64::max);
        if panels.len() == MOST || next <= 0.0 || slowest > CLOSE * radius {
            return panels;
        }
        radius = next;
    }
}

/// What lies within a radius.
fn panel(poles: &[Root], zeros: &[Root], radius: f64, whole: bool) -> Panel {
    let radius = if radius > 0.0 { radius } else { 1.0 };
    let seen = |root: &&Root| size(root.at) <= radius;
    let inside = || poles.iter().filter(seen).chain(zeros.iter().filter(seen));
    let least = |of: fn(Point) -> f64| inside().map(|root| of(root.at)).fold(0.0, f64::min);
    let most = |of: fn(Point) -> f64| inside().map(|root| of(root.at)).fold(0.0, f64::max);
    let (left, right) = (least(|at| at.0), most(|at| at.0));
    let height = most(|at| at.1.abs());
    let room = 0.14 * radius;
    let axis = |label: &str, limits| Axis {
        label: label.to_string(),
        limits: Some(limits),
        ..Axis::default()
    };
    let mark = |cross: bool, ink: Ink| {
        move |root: &Root| Mark { at: root.at, ink, cross, name: root.name.clone() }
    };
    // Crosses outside of the frame are not drawn; those just within it are, whatever the panel is made for.
    let mut marks: Vec<Mark> = zeros.iter().map(mark(false, Ink::Curve(0))).collect();
    marks.extend(poles.iter().map(mark(true, Ink::Curve(1))));
    let key = |name: &str, any: bool, cross: bool, ink: Ink| {
        any.then(|| Mark { at: (0.0, 0.0), ink, cross, name: name.to_string() })
    };
    let keys = [
        key("poles", !poles.is_empty(), true, Ink::Curve(1)),
        key("zeros", !zeros.is_empty(), false, Ink::Curve(0)),
    ];
    Panel {
        title: if whole { String::new() } else { "nearer to the origin".to_string() },
        x: axis("real part [1/s]", (left - room, right + room)),
        y: axis("imaginary part [rad/s]", (-height - room, height + room)),
        keys: keys.into_iter().flatten().collect(),
        marks,
        guides: guides(radius),
        equal: true,
        ..Panel::default()
    }
}

/// Axes, rays of equal damping, circles of equal frequency.
fn guides(radius: f64) -> Vec<Guide> {
    let far = 4.0 * radius;
    let guide = |points: Vec<Point>, name: String, strong: bool| Guide { points, name, strong };
    let mut guides = vec![
        guide(vec![(-far, 0.0), (far, 0.0)], String::new(), true),
        guide(vec![(0.0, -far), (0.0, far)], String::new(), true),
    ];
    for damping in DAMPING {
        let (x, y) = (-damping * far, libm::sqrt(1.0 - damping * damping) * far);
        guides.push(guide(vec![(0.0, 0.0), (x, y)], format!("ζ {damping}"), false));
        guides.push(guide(vec![(0.0, 0.0), (x, -y)], String::new(), false));
    }
    let hertz = radius / TAU;
    let step = super::axis::nice(hertz / 4.0);
    for (value, text) in ticks(0.5 * step, 1.3 * hertz, step) {
        // Two quarters, each from the imaginary axis to the real one, where the upper one is named.
        let quarter = |side: f64| {
            let point = |k: u32| {
                let angle = TAU * (0.25 + f64::from(k) / 120.0);
                (TAU * value * libm::cos(angle), side * TAU * value * libm::sin(angle))
            };
            (0..=30).map(point).collect()
        };
        guides.push(guide(quarter(1.0), format!("{text} Hz"), false));
        guides.push(guide(quarter(-1.0), String::new(), false));
    }
    guides
}

#[cfg(test)]
mod tests {
    use super::super::paint;
    use super::*;
    use crate::draw::picture::{Room, Shape};

    fn root(re: f64, im: f64, name: &str) -> Root {
        Root { at: (re, im), name: name.into() }
    }

    #[test]
    fn poles_that_lie_decades_apart_are_looked_at_more_closely() {
        let poles = [
            root(0.0, 0.0, "theta"),
            root(-30.0, 10.0, "x"),
            root(-30.0, -10.0, ""),
            root(-1700.0, 0.0, "i"),
            root(-166_000.0, 0.0, "v"),
        ];
        let radii: Vec<f64> =
            roots(&poles, &[]).iter().map(|panel| -panel.x.limits.unwrap().0).collect();
        // Each frame reaches a little beyond the farthest pole in it: 166000, 1700, 31.6 rad/s.
        assert_eq!(radii.len(), 3, "{radii:?}");
        for (radius, own) in radii.iter().zip([166_000.0, 1700.0, 30.0]) {
            assert!((1.05 * own..1.2 * own).contains(radius), "{radius} of {own}");
        }
        assert_eq!(roots(&poles[..3], &[]).len(), 1);
        assert_eq!(roots(&[], &[]).len(), 1);
    }

    #[test]
    fn a_unit_is_as_long_across_as_up() {
        let picture = paint(
            "",
            &roots(&[root(-30.0, 10.0, ""), root(-30.0, -10.0, "")], &[root(-6.0, 0.0, "")]),
        );
        // A cross is two strokes about its place.
        let strokes = picture.shapes.iter().filter_map(|shape| match shape {
            Shape::Line { points, stroke, .. } if stroke.ink == Ink::Curve(1) => {
                Some(((points[0].0 + points[1].0) / 2.0, (points[0].1 + points[1].1) / 2.0))
            }
            _ => None,
        });
        // The first is that of the legend.
        let crosses: Vec<Point> = strokes.skip(2).step_by(2).collect();
        let circle = picture.shapes.iter().rev().find_map(|shape| match shape {
            Shape::Circle { at, .. } => Some(*at),
            _ => None,
        });
        let (upper, lower, zero) = (crosses[0], crosses[1], circle.unwrap());
        let unit = (lower.1 - upper.1) / 20.0;
        assert!(unit > 1.0 && (zero.0 - upper.0 - 24.0 * unit).abs() < 1e-9);
        assert!((zero.1 - upper.1 - 10.0 * unit).abs() < 1e-9);
    }

    #[test]
    fn names_stand_clear_of_each_other_and_rays_lie_where_damping_says() {
        let poles: Vec<Root> = (0..12)
            .map(|k| root(-10.0 - f64::from(k % 3), f64::from(k / 3) * 2.0, &format!("storage{k}")))
            .collect();
        let picture = paint("", &roots(&poles, &[root(-4.0, 0.0, "z")]));
        let rooms: Vec<(String, Room)> = picture
            .shapes
            .iter()
            .filter_map(|shape| match shape {
                Shape::Words { words, .. } => Some((words.text.clone(), words.room())),
                _ => None,
            })
            .collect();
        for (k, (text, room)) in rooms.iter().enumerate() {
            for (other, place) in &rooms[k + 1..] {
                assert!(!room.grown(-0.5).overlaps(&place.grown(-0.5)), "`{text}` over `{other}`");
            }
        }
        for guide in guides(1.0).iter().filter(|guide| guide.name.starts_with('ζ')) {
            let end = guide.points[1];
            let damping: f64 = guide.name["ζ ".len()..].parse().unwrap();
            assert!((-end.0 / size(end) - damping).abs() < 1e-12);
        }
    }
}
