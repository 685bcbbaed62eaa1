//! What is written reads back as the same netlist: the same text again, and the same bits in every number.

use super::{Card, CardKind, Device, Element, Expr, Name, Names, Netlist, Shape, Source, Waveform};
use crate::circuit::{self, Circuit, DeviceKind};
use crate::expr::{Binary, Function};
use crate::netlist::{
    Leaf,
    flatten::flatten,
    read::{How, read},
    write::write,
};
use crate::source::{SourceMap, Span};
use proptest::prelude::*;

fn again(text: &str) -> Netlist {
    let mut map = SourceMap::default();
    let file = map.add("again.cir", text);
    let mut d = vec![];
    let netlist = read(&mut map, file, &How::default(), &mut d);
    assert!(d.is_empty(), "{d:?}\n{text}");
    netlist
}

fn flat(netlist: &Netlist) -> Circuit {
    let mut d = vec![];
    let circuit = flatten(netlist, &mut d);
    circuit.unwrap_or_else(|| panic!("{d:?}\n{}", write(netlist)))
}

/// Everything of a device but its law, which carries places.
fn fixed(kind: &DeviceKind) -> Option<&DeviceKind> {
    let law = matches!(
        kind,
        DeviceKind::BehaviouralVoltage { .. }
            | DeviceKind::BehaviouralCurrent { .. }
            | DeviceKind::Switch { .. }
    );
    (!law).then_some(kind)
}

fn survives(netlist: &Netlist) {
    let text = write(netlist);
    let second = again(&text);
    let (a, b) = (flat(netlist), flat(&second));
    assert_eq!(a.devices.len(), b.devices.len());
    for (a, b) in a.devices.iter().zip(&b.devices) {
        assert!(
            a.name.eq_ignore_ascii_case(&b.name) && a.nodes == b.nodes,
            "{} {}",
            a.name,
            b.name
        );
        assert_eq!(fixed(&a.kind), fixed(&b.kind), "{}", a.name);
    }
    assert_eq!(
        (&a.analyses, &a.options, &a.initial, a.grid),
        (&b.analyses, &b.options, &b.initial, b.grid)
    );
    assert_eq!(a.outputs.len(), b.outputs.len());
    // Laws carry places, so their values are compared: the same operations in the same order give the same bits.
    for (a, b) in a.devices.iter().zip(&b.devices) {
        for x in [0.3, -1.7] {
            let value = |kind: &DeviceKind| match kind {
                DeviceKind::BehaviouralVoltage { law } | DeviceKind::BehaviouralCurrent { law } => {
                    Some(
                        law.evaluate(&mut |leaf| {
                            if *leaf == circuit::Leaf::Time { 1.1 } else { x }
                        })
                        .to_bits(),
                    )
                }
                _ => None,
            };
            assert_eq!(value(&a.kind), value(&b.kind), "{}\n{text}", a.name);
        }
    }
}

#[test]
fn whole_decks_survive() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/decks");
    let mut count = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        survives(&again(&std::fs::read_to_string(&path).unwrap()));
        count += 1;
    }
    assert!(count >= 8);
}

/// A netlist of one device of each kind, over given numbers.
fn sample(values: &[f64], law: u64) -> Netlist {
    let mut names = Names::default();
    let [a, b, ground] = ["a", "b", "0"].map(|name| names.intern(name));
    let mut cards = vec![];
    let mut numbers = values.iter().copied().cycle();
    let mut number = || Expr::number(numbers.next().unwrap_or(1.0));
    let mut device = |name: &str, element: Element, comment: Option<String>| {
        let name = names.intern(name);
        let kind = CardKind::Device(Device { name, nodes: [a, b].as_slice().into(), element });
        cards.push(Card { kind, span: Span::NONE, comment });
    };
    device("R_1", Element::Resistor { value: number() }, Some("model.bg:7  R:one".into()));
    device("C_1", Element::Capacitor { value: number(), initial: Some(number()) }, None);
    device("L_1", Element::Inductor { value: number(), initial: None }, None);
    device("E_1", Element::Vcvs { gain: number(), control: [b, ground] }, Some("long ".repeat(30)));
    let arguments: Vec<Expr> = (0..6)
        .map(|k| Expr::number(f64::from(k) + number().as_number().unwrap_or(0.0).abs().fract()))
        .collect();
    let waveform = Waveform::Function { shape: Shape::Pwl, arguments };
    device(
        "V_1",
        Element::VoltageSource(Box::new(Source {
            waveform,
            dc: Some(number()),
            ac: Some([number(), number()]),
        })),
        None,
    );
    device("I_1", Element::CurrentSource(Waveform::Constant(number()).into()), None);
    let current = |text: &mut Names| Expr::leaf(Leaf::Current(text.intern("V_1")));
    let reading = current(&mut names);
    let law = tree(law, a, b, &reading, &mut number, 0);
    let name = names.intern("B_1");
    let element = Element::BehaviouralCurrent { law };
    let kind = CardKind::Device(Device { name, nodes: [a, ground].as_slice().into(), element });
    cards.push(Card { kind, span: Span::NONE, comment: None });
    Netlist {
        title: "a sample".into(),
        names,
        header: vec![("hmax".into(), "auto".into())],
        cards,
        ..Netlist::default()
    }
}

/// Some expression, by the digits of a number.
fn tree(
    digits: u64,
    a: Name,
    b: Name,
    current: &Expr,
    number: &mut dyn FnMut() -> Expr,
    depth: u32,
) -> Expr {
    let mut sub = |k: u64| tree(digits / 12 + k, a, b, current, number, depth + 1);
    if depth > 4 {
        return Expr::leaf(Leaf::Voltage(a, Some(b)));
    }
    match digits % 12 {
        0 => Expr::leaf(Leaf::Voltage(a, None)),
        1 => Expr::leaf(Leaf::Time),
        2 => current.clone(),
        3 => number(),
        4 => sub(1).binary(Binary::Subtract, sub(2)),
        5 => sub(3).binary(Binary::Divide, sub(5)),
        6 => sub(7).negate(),
        7 => Expr::call(Function::Tanh, vec![sub(4)]),
        8 => Expr::call(Function::Min, vec![sub(1), sub(11)]),
        9 => Expr::choice(sub(1).binary(Binary::Less, sub(2)), sub(3), sub(4)),
        10 => sub(5).binary(Binary::Multiply, sub(8)),
        _ => sub(9).binary(Binary::Add, sub(10)),
    }
}

proptest! {
    #[test]
    fn generated_netlists_survive(
        values in proptest::collection::vec(proptest::num::f64::NORMAL | proptest::num::f64::SUBNORMAL, 1..12),
        law in any::<u64>(),
    ) {
        survives(&sample(&values, law));
    }
}
