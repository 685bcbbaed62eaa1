//! Small graphs with known pictures.

use super::*;
use crate::bond::causality;
use crate::bond::elaborate::{self, Overrides};
use crate::draw::picture::Picture;
use crate::draw::{svg, tikz};
use crate::source::SourceMap;

fn drawn(text: &str) -> (Sketch, Placed, Picture, String) {
    let mut map = SourceMap::default();
    let file = map.add("test.bg", text);
    let mut d = vec![];
    let program = elaborate::load(&mut map, file, &[], &mut d);
    let graph = elaborate::elaborate(&program, &map, &Overrides::default(), &mut d).unwrap();
    let causality = causality::analyse(&graph, &mut d);
    let sketch = sketch(&graph, &causality, usize::MAX);
    let placed = place(&sketch);
    let picture = paint(&graph, &sketch, &placed);
    let dot = dot(&graph, &sketch);
    (sketch, placed, picture, dot)
}

const MESH: &str = "Se:U(10 V) -> 1:mesh\nmesh -> I:L(1 mH), R:R(2 Ohm), C:C(100 uF)\n";

#[test]
fn elements_stand_around_their_junction() {
    let (sketch, placed, picture, _) = drawn(MESH);
    let at = |title: &str| {
        let k = sketch.nodes.iter().position(|node| node.title == title).unwrap();
        placed.cells[k]
    };
    let (x, y) = at("1");
    assert_eq!(at("Se: U"), (x - 1, y), "sources feed from the left");
    for element in ["I: L", "R: R", "C: C"] {
        let (u, v) = at(element);
        assert_eq!((u - x).abs() + (v - y).abs(), 1, "{element}");
    }
    assert!(picture.width > 100.0 && picture.height > 100.0);
}

#[test]
fn names_are_escaped_in_every_form() {
    let (_, _, picture, dot) = drawn("Se:U_1(10 V) -> R:R_2(e = 2 Ohm*f*(f < 1 A))\n");
    let (svg, tikz) = (svg::write(&picture), tikz::write(&picture));
    assert!(svg.contains("&lt;") && !svg.contains("f < 1"), "{svg}");
    assert!(tikz.contains("R: R\\_2"), "{tikz}");
    assert!(dot.contains("Se: U_1"), "{dot}");
}

#[test]
fn marks_show_derivative_causality_and_loops() {
    let (sketch, ..) = drawn("Se:U(1 V) -> 0:n -> C:c(1 F)\n");
    assert!(sketch.nodes.iter().any(|n| n.title == "C: c" && n.dependent));
    assert!(sketch.links.iter().any(|link| link.dependent));
    let (sketch, ..) = drawn("Sf:J(1 A) -> 0:n -> R:a(1 Ohm)\nn -> R:b(2 Ohm)\n");
    assert_eq!(sketch.loops, 1);
    assert!(sketch.links.iter().filter(|link| link.ring == 1).count() >= 2);
}

#[test]
fn instances_close_to_one_node_each() {
    let text = "model Pair(r = 1 Ohm) { port in a : electrical; a -> 1:m -> R:x(r); m -> R:y(r) }\n\
Se:U(1 V) -> 1:loop\nloop -> Pair:p, Pair:q\n";
    let mut map = SourceMap::default();
    let file = map.add("test.bg", text);
    let mut d = vec![];
    let program = elaborate::load(&mut map, file, &[], &mut d);
    let graph = elaborate::elaborate(&program, &map, &Overrides::default(), &mut d).unwrap();
    let causality = causality::analyse(&graph, &mut d);
    let open = sketch(&graph, &causality, usize::MAX);
    assert_eq!((open.nodes.len(), open.groups.len(), open.deepest), (8, 3, 1));
    let closed = sketch(&graph, &causality, 0);
    assert_eq!((closed.nodes.len(), closed.links.len()), (4, 3));
    assert!(closed.nodes.iter().filter(|n| n.kind == NodeKind::Part).count() == 2);
    let placed = place(&open);
    let boxes: Vec<_> = placed.boxes.iter().flatten().collect();
    assert!(boxes.len() == 2 && !boxes[0].overlaps(boxes[1]));
}

#[test]
fn signals_are_blocks_between_what_is_measured_and_what_follows() {
    let text = "param K = 2 V*s\ninput ref\nsignal x = integ(f(shaft))\nsignal u = K*(ref - f(shaft)) + 1 V*x\n\
Se:U(u) -> 1:mesh -> GY:m(0.1 V*s) -> 1:shaft\nmesh -> R:R(1 Ohm)\nshaft -> I:J(1 kg*m^2)\ndrive ref = step(1 s, 0, 1)\n";
    let (sketch, _, picture, _) = drawn(text);
    let signals = &sketch.signals;
    let titles: Vec<&str> = signals.blocks.iter().map(|block| block.title.as_str()).collect();
    assert_eq!(signals.blocks.iter().filter(|b| b.kind == BlockKind::Signal).count(), 3);
    let place = |title: &str| titles.iter().position(|t| *t == title).unwrap();
    let mut arrows: Vec<(&str, &str)> =
        signals.arrows.iter().map(|(from, to)| (titles[*from], titles[*to])).collect();
    arrows.sort_unstable();
    let wanted = [("f(shaft)", "u"), ("f(shaft)", "x"), ("ref", "u"), ("u", "Se: U"), ("x", "u")];
    assert_eq!(arrows, wanted);
    assert_eq!(signals.blocks[place("x")].law, "∫ f(shaft)");
    assert_eq!(signals.blocks[place("ref")].law, "step(t)");
    let node = |title: &str| sketch.nodes.iter().position(|node| node.title == title);
    let source = Tap { node: node("Se: U").unwrap(), text: "u".into(), into: true };
    assert!(signals.taps.contains(&source), "{:?}", signals.taps);
    assert!(signals.taps.iter().any(|tap| !tap.into && tap.text == "f(shaft)"));
    assert!(svg::write(&picture).contains("∫ f(shaft)"));
    let (sketch, ..) = drawn(MESH);
    assert!(sketch.signals.blocks.is_empty() && sketch.signals.taps.is_empty());
}
