//! The picture of a schematic: symbols as IEC 60617 has them, sources as in SPICE books.

use super::super::picture::{Anchor, Ink, Picture, Point, Shape, Stroke, Words};
use super::place::{Placed, SIZES, Schematic};
use super::symbols::Symbol;

/// Half the length of a symbol's body.
const BODY: f64 = 15.0;

/// Draws.
pub fn paint(schematic: &Schematic) -> Picture {
    let mut picture = Picture { title: schematic.title.clone(), ..Picture::default() };
    let wire = Stroke::new(Ink::Plain, 1.2);
    for (a, b) in &schematic.wires {
        picture.line(*a, *b, wire);
    }
    for device in &schematic.devices {
        self::device(device, &mut picture);
    }
    for (x, y) in &schematic.grounds {
        picture.line((*x, *y), (*x, y + 8.0), wire);
        for (k, half) in [9.0, 5.5, 2.0].into_iter().enumerate() {
            let y = y + 8.0 + 4.0 * k as f64;
            picture.line((x - half, y), (x + half, y), Stroke::new(Ink::Plain, 1.6));
        }
    }
    picture.shapes.push(Shape::Dots {
        points: schematic.dots.clone(),
        radius: 2.4,
        ink: Ink::Plain,
    });
    for (at, name) in &schematic.names {
        let mut words = Words::new(*at, name.as_str(), SIZES.1, Ink::Electrical);
        words.anchor = Anchor::Start;
        picture.words(words);
    }
    for (at, text) in &schematic.repeats {
        let mut words = Words::new(*at, text.as_str(), SIZES.0, Ink::Faint);
        (words.anchor, words.bold) = (Anchor::Start, true);
        picture.words(words);
    }
    let all = picture.shapes.iter().map(Shape::room).reduce(|a, b| a.with(&b));
    if let Some(all) = all {
        let mut title =
            Words::new((all.left, all.top - 14.0), schematic.title.as_str(), 13.0, Ink::Plain);
        (title.anchor, title.bold) = (Anchor::Start, true);
        picture.words(title);
        if schematic.left_out > 0 {
            let text = match schematic.left_out {
                1 => "1 device of signals is not drawn".to_string(),
                count => format!("{count} devices of signals are not drawn"),
            };
            let mut words = Words::new((all.left, all.bottom + 22.0), text, 10.5, Ink::Faint);
            words.anchor = Anchor::Start;
            picture.words(words);
        }
    }
    picture.fit(14.0);
    picture
}

/// Places along and across a device.
struct Frame {
    middle: Point,
    along: Point,
    across: Point,
    half: f64,
}

impl Frame {
    fn at(&self, along: f64, across: f64) -> Point {
        (
            self.middle.0 + along * self.along.0 + across * self.across.0,
            self.middle.1 + along * self.along.1 + across * self.across.1,
        )
    }
}

fn device(placed: &Placed, picture: &mut Picture) {
    let (a, b) = placed.ends;
    let (dx, dy) = (b.0 - a.0, b.1 - a.1);
    let length = (dx * dx + dy * dy).sqrt().max(1e-9);
    let along = (dx / length, dy / length);
    let frame = Frame {
        middle: ((a.0 + b.0) / 2.0, (a.1 + b.1) / 2.0),
        along,
        across: (-along.1, along.0),
        half: length / 2.0,
    };
    let pen = Stroke::new(Ink::Plain, 1.4);
    let body = match placed.symbol {
        Symbol::Capacitor => 3.0,
        Symbol::Sense => 7.0,
        Symbol::Diode | Symbol::Switch => 10.0,
        _ => BODY,
    };
    for side in [-1.0, 1.0] {
        picture.line(
            frame.at(side * frame.half, 0.0),
            frame.at(side * body, 0.0),
            Stroke::new(Ink::Plain, 1.2),
        );
    }
    symbol(placed.symbol, &frame, pen, picture);
    words(placed, &frame, picture);
}

fn symbol(symbol: Symbol, frame: &Frame, pen: Stroke, picture: &mut Picture) {
    let area = |points: Vec<Point>, filled: bool| Shape::Area {
        points,
        fill: Some((if filled { Ink::Plain } else { Ink::Paper }, 1.0)),
        stroke: Some(pen),
        round: false,
    };
    let at = |x: f64, y: f64| frame.at(x, y);
    let block =
        |half: f64| vec![at(-BODY, -half), at(BODY, -half), at(BODY, half), at(-BODY, half)];
    match symbol {
        Symbol::Resistor => picture.shapes.push(area(block(6.0), false)),
        Symbol::Block => picture.shapes.push(area(block(11.0), false)),
        Symbol::Capacitor => {
            for x in [-3.0, 3.0] {
                picture.line(at(x, -11.0), at(x, 11.0), Stroke::new(Ink::Plain, 2.0));
            }
        }
        Symbol::Inductor => {
            let turn = libm::atan2(frame.along.1, frame.along.0).to_degrees();
            for k in 0..4 {
                let centre = at(-BODY + 3.75 + 7.5 * f64::from(k), 0.0);
                let (from, to) = (turn + 180.0, turn + 360.0);
                picture.shapes.push(Shape::Arc { at: centre, radius: 3.75, from, to, stroke: pen });
            }
        }
        Symbol::VoltageSource | Symbol::CurrentSource => {
            let circle = Shape::Circle {
                at: frame.middle,
                radius: BODY,
                fill: Some(Ink::Paper),
                stroke: Some(pen),
            };
            picture.shapes.push(circle);
        }
        Symbol::ControlledVoltage | Symbol::ControlledCurrent => {
            picture.shapes.push(area(
                vec![at(-BODY, 0.0), at(0.0, -12.0), at(BODY, 0.0), at(0.0, 12.0)],
                false,
            ));
        }
        Symbol::Sense => {
            let circle = Shape::Circle {
                at: frame.middle,
                radius: 7.0,
                fill: Some(Ink::Paper),
                stroke: Some(pen),
            };
            picture.shapes.push(circle);
            picture.words(Words::new((frame.middle.0, frame.middle.1 + 3.4), "A", 9.5, Ink::Plain));
        }
        Symbol::Diode => {
            picture.shapes.push(area(vec![at(-10.0, -8.0), at(10.0, 0.0), at(-10.0, 8.0)], true));
            picture.line(at(10.0, -8.0), at(10.0, 8.0), Stroke::new(Ink::Plain, 2.0));
        }
        Symbol::Switch => {
            picture.line(at(-10.0, 0.0), at(9.0, -9.0), pen);
            let ends = vec![at(-10.0, 0.0), at(10.0, 0.0)];
            picture.shapes.push(Shape::Dots { points: ends, radius: 2.0, ink: Ink::Plain });
        }
    }
    match symbol {
        // + at the first node.
        Symbol::VoltageSource | Symbol::ControlledVoltage => {
            let x = if symbol == Symbol::VoltageSource { 8.0 } else { 6.5 };
            picture.line(at(-x - 3.0, 0.0), at(-x + 3.0, 0.0), Stroke::new(Ink::Plain, 1.1));
            picture.line(at(-x, -3.0), at(-x, 3.0), Stroke::new(Ink::Plain, 1.1));
            picture.line(at(x, -3.0), at(x, 3.0), Stroke::new(Ink::Plain, 1.1));
        }
        // The current runs from the first node to the second.
        Symbol::CurrentSource | Symbol::ControlledCurrent => {
            picture.line(at(-9.0, 0.0), at(4.0, 0.0), Stroke::new(Ink::Plain, 1.4));
            picture.shapes.push(area(vec![at(3.0, -3.5), at(10.0, 0.0), at(3.0, 3.5)], true));
        }
        _ => {}
    }
}

/// Name and value: above and below a device that lies, to the right of one that stands.
fn words(placed: &Placed, frame: &Frame, picture: &mut Picture) {
    let (name, value) = &placed.words;
    let (x, y) = frame.middle;
    let lying = frame.along.1.abs() < 0.5;
    let side = match placed.symbol {
        Symbol::Resistor | Symbol::Inductor => 7.0,
        Symbol::Sense => 8.0,
        Symbol::Capacitor | Symbol::Block | Symbol::Switch | Symbol::Diode => 11.0,
        _ => 15.0,
    };
    let size = SIZES.0;
    let places = match (lying, value.is_empty()) {
        (true, _) => [(x, y - side - 4.0), (x, y + side + 0.95 * size)],
        (false, true) => [(x + side + 5.0, y + 0.36 * size), (x, y)],
        (false, false) => [(x + side + 5.0, y - 3.0), (x + side + 5.0, y + 0.95 * size)],
    };
    for (text, at, ink) in [(name, places[0], Ink::Plain), (value, places[1], Ink::Faint)] {
        if !text.is_empty() {
            let mut words = Words::new(at, text.as_str(), size, ink);
            words.anchor = if lying { Anchor::Middle } else { Anchor::Start };
            words.of.clone_from(&placed.name);
            picture.words(words);
        }
    }
}
