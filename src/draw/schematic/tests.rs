//! Small circuits with known schematics.

use super::*;
use crate::circuit::{Circuit, Device, DeviceKind, Node, NodeId, Waveform};
use crate::source::Span;

fn circuit(nodes: &[&str], devices: &[(&str, u32, u32, char)]) -> Circuit {
    let node = |name: &&str| Node { name: (*name).into(), nominal: None, span: Span::NONE };
    let device = |(name, a, b, kind): &(&str, u32, u32, char)| Device {
        name: (*name).into(),
        nodes: [NodeId(*a), NodeId(*b)][..].into(),
        kind: match kind {
            'c' => DeviceKind::Capacitor { capacitance: 2.2e-5, initial: None },
            'v' => DeviceKind::VoltageSource {
                waveform: Box::new(Waveform::Constant(5.0)),
                parts: Box::default(),
            },
            _ => DeviceKind::Resistor { resistance: 4700.0 },
        },
        nominal: None,
        span: Span::NONE,
    };
    Circuit {
        nodes: nodes.iter().map(node).collect(),
        devices: devices.iter().map(device).collect(),
        ..Circuit::default()
    }
}

fn lying(placed: &Placed) -> bool {
    placed.ends.0.1 == placed.ends.1.1
}

#[test]
fn a_ladder_is_drawn_as_one() {
    let own = circuit(
        &["0", "a", "b", "c"],
        &[
            ("v1", 1, 0, 'v'),
            ("r1", 1, 2, 'r'),
            ("c1", 2, 0, 'c'),
            ("r2", 2, 3, 'r'),
            ("c2", 3, 0, 'c'),
        ],
    );
    let drawn = place(&own, &|_| true).unwrap();
    let lies: Vec<bool> = drawn.devices.iter().map(lying).collect();
    assert_eq!(lies.iter().filter(|lies| **lies).count(), 2);
    let x = |name: &str| drawn.devices.iter().find(|d| d.words.0 == name).unwrap().ends.0.0;
    assert!(x("v1") < x("r1") && x("r1") < x("c1") && x("c1") < x("r2") && x("r2") < x("c2"));
    assert_eq!(drawn.grounds.len(), 1);
    let r1 = drawn.devices.iter().find(|d| d.words.0 == "r1").unwrap();
    assert_eq!(r1.words.1, "4.7 k");
}

#[test]
fn what_bridges_stands_in_a_layer_above() {
    let own = circuit(
        &["0", "a", "b", "c"],
        &[
            ("v1", 1, 0, 'v'),
            ("r1", 1, 2, 'r'),
            ("r2", 2, 3, 'r'),
            ("r3", 1, 3, 'r'),
            ("r4", 3, 0, 'r'),
        ],
    );
    let drawn = place(&own, &|_| true).unwrap();
    let layers: Vec<f64> = drawn.devices.iter().filter(|d| lying(d)).map(|d| d.ends.0.1).collect();
    assert_eq!(layers.len(), 3);
    let top = layers.iter().copied().fold(f64::INFINITY, f64::min);
    assert_eq!(
        layers.iter().filter(|y| **y == top).count(),
        1,
        "one of the mesh is above: {layers:?}"
    );
    // Its two risers lead down to the line.
    let line = layers.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let risers = drawn
        .wires
        .iter()
        .filter(|(a, b)| a.0 == b.0 && a.1.min(b.1) == top && a.1.max(b.1) == line);
    assert_eq!(risers.count(), 2);
}

#[test]
fn what_ends_in_ground_hangs_below_its_node() {
    let own = circuit(
        &["0", "a", "b", "c"],
        &[
            ("v1", 1, 0, 'v'),
            ("r1", 1, 2, 'r'),
            ("c1", 2, 0, 'c'),
            ("r2", 1, 3, 'r'),
            ("c2", 3, 0, 'c'),
        ],
    );
    let drawn = place(&own, &|_| true).unwrap();
    // The longest way is the line b-a-c; everything else stands upright.
    assert_eq!(drawn.devices.iter().filter(|d| lying(d)).count(), 2);
    let kept = place(&own, &|id| id.0 != 4).unwrap();
    assert_eq!((kept.devices.len(), kept.left_out), (4, 1));
}

/// Islands of a source, a resistor and a capacitor each, named as instances of an array are.
fn islands(count: u32) -> Circuit {
    let mut names = vec!["0".to_string()];
    let mut devices = vec![];
    for k in 1..=count {
        let at = names.len() as u32;
        names.extend([format!("eha_{k}_in"), format!("eha_{k}_out")]);
        devices.push((format!("v_eha_{k}_u"), at, 0, 'v'));
        devices.push((format!("r_eha_{k}_r"), at, at + 1, 'r'));
        devices.push((format!("c_eha_{k}_c"), at + 1, 0, 'c'));
    }
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let devices: Vec<_> = devices.iter().map(|d| (d.0.as_str(), d.1, d.2, d.3)).collect();
    circuit(&names, &devices)
}

#[test]
fn parts_that_are_alike_are_drawn_once() {
    let mut own = islands(100);
    let drawn = place(&own, &|_| true).unwrap();
    assert_eq!(drawn.devices.len(), 3);
    assert_eq!(drawn.repeats[0].1, "100 alike: eha_1 … eha_100");
    // One value makes a difference, and so does a name that has nothing to do with the number.
    own.devices[4].kind = DeviceKind::Resistor { resistance: 1.0 };
    assert_eq!(place(&own, &|_| true).unwrap().devices.len(), 6);
    let mut own = islands(3);
    own.devices[4].name = "r_eha_2_other".into();
    assert_eq!(place(&own, &|_| true).unwrap().devices.len(), 6);
}

/// A ladder of so many sections.
fn ladder(count: u32) -> Circuit {
    let names: Vec<String> =
        std::iter::once("0".into()).chain((0..=count).map(|k| format!("node{k}"))).collect();
    let mut devices = vec![("v1".to_string(), 1, 0, 'v')];
    for k in 1..=count {
        devices.push((format!("r{k}"), k, k + 1, 'r'));
        devices.push((format!("c{k}"), k + 1, 0, 'c'));
    }
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let devices: Vec<_> = devices.iter().map(|d| (d.0.as_str(), d.1, d.2, d.3)).collect();
    circuit(&names, &devices)
}

#[test]
fn a_long_ladder_goes_on_in_rows() {
    let drawn = place(&ladder(40), &|_| true).unwrap();
    assert_eq!(drawn.devices.len(), 81);
    let right = drawn.devices.iter().map(|d| d.ends.0.0.max(d.ends.1.0)).fold(0.0, f64::max);
    assert!(right < 1.2 * rows::PAGE, "{right}");
    let (rows, first) = (drawn.grounds.len(), drawn.grounds[0].1);
    assert!(rows > 2 && drawn.grounds.iter().all(|at| at.1 >= first), "{rows} rows");
    // One after the other, as the lines of a text.
    let line = |name: &str| drawn.devices.iter().find(|d| d.name == name).unwrap().ends.0.1;
    assert!(line("r1") < line("r20") && line("r20") < line("r40"));
}

#[test]
fn what_is_too_large_is_known_at_once() {
    let begin = std::time::Instant::now();
    assert_eq!(place(&ladder(10_000), &|_| true).unwrap_err(), 20_001);
    assert!(begin.elapsed().as_secs_f64() < 5.0, "{:?}", begin.elapsed());
}

#[test]
fn numbers_are_short() {
    for (value, text) in
        [(0.0, "0"), (4700.0, "4.7 k"), (2.2e-5, "22 µ"), (-3.0, "−3"), (1e15, "1.000e15")]
    {
        assert_eq!(symbols::short(value), text);
    }
}
