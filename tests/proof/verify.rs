//! `verify` on the shipped models, and on translations that were made wrong.

use bondspice::bond::causality::{Causality, assign};
use bondspice::bond::elaborate::{Overrides, elaborate, load};
use bondspice::bond::graph::BondGraph;
use bondspice::bond::initial;
use bondspice::diagnostic::Diagnostic;
use bondspice::expr::{Expr, Node};
use bondspice::netlist::{CardKind, Element, Netlist};
use bondspice::source::SourceMap;
use bondspice::translate::translate;
use bondspice::verify::{Report, Settings, verify_netlist};
use std::path::Path;

/// A model's graph, causality and netlist.
#[track_caller]
fn translated(model: &str) -> (BondGraph, Causality, Netlist) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("models/{model}.bg"));
    let mut map = SourceMap::default();
    let file = map.add(model, std::fs::read_to_string(path).unwrap());
    let mut d: Vec<Diagnostic> = vec![];
    let program = load(&mut map, file, &[], &mut d);
    let result = elaborate(&program, &map, &Overrides::default(), &mut d).and_then(|graph| {
        let causality = assign(&graph, &mut d)?;
        let initial = initial::solve(&graph, &causality, &mut d)?;
        let translation = translate(&graph, &causality, &initial, &map, &mut d)?;
        Some((graph, causality, translation.netlist))
    });
    result.unwrap_or_else(|| panic!("{model}: {d:#?}"))
}

#[track_caller]
fn verified(model: &str, (graph, causality, netlist): &(BondGraph, Causality, Netlist)) -> Report {
    let mut d = vec![];
    let report = verify_netlist(graph, causality, netlist, &Settings::default(), &mut d);
    report.unwrap_or_else(|| panic!("{model}: {d:#?}"))
}

fn models() -> Vec<String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("models");
    let mut found = vec![];
    for (folder, prefix) in [(folder.clone(), ""), (folder.join("textbook"), "textbook/")] {
        for entry in std::fs::read_dir(folder).unwrap() {
            let name = entry.unwrap().file_name().into_string().unwrap();
            if let Some(stem) = name.strip_suffix(".bg") {
                found.push(format!("{prefix}{stem}"));
            }
        }
    }
    found.sort();
    found
}

#[test]
fn every_shipped_model_passes() {
    let mut failed = vec![];
    for model in models() {
        let report = verified(&model, &translated(&model));
        if !report.passes() {
            failed.push(format!("{model}\n{}", report.text()));
        }
    }
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}

/// Changes the first device for which `change` says so.
#[track_caller]
fn corrupt(
    netlist: &mut Netlist,
    change: &mut dyn FnMut(&str, &mut Element, &mut Vec<bondspice::netlist::Name>) -> bool,
) {
    for at in 0..netlist.cards.len() {
        if let CardKind::Device(device) = &netlist.cards[at].kind {
            let mut device = device.clone();
            let name = netlist.names.text(device.name).to_string();
            if change(&name, &mut device.element, &mut device.nodes) {
                netlist.cards[at].kind = CardKind::Device(device);
                return;
            }
        }
    }
    panic!("nothing to corrupt");
}

fn negate(value: &mut bondspice::netlist::Expr) {
    *value = Expr::new(Node::Unary(bondspice::expr::Unary::Negate, value.clone()), value.span);
}

#[test]
fn a_wrong_sign_in_any_linked_source_is_found() {
    let model = "dc_motor_load";
    let sound = translated(model);
    let linked = |element: &Element| {
        matches!(
            element,
            Element::Vcvs { .. }
                | Element::Vccs { .. }
                | Element::Cccs { .. }
                | Element::Ccvs { .. }
        )
    };
    let count =
        sound.2.cards.iter().filter(
            |card| matches!(&card.kind, CardKind::Device(device) if linked(&device.element)),
        );
    let count = count.count();
    assert!(count >= 4, "a gyrator and a gear need four linked sources, not {count}");
    for which in 0..count {
        let (graph, causality, mut netlist) = sound.clone();
        let mut seen = 0;
        let mut name = String::new();
        corrupt(&mut netlist, &mut |device, element, _| {
            let hit = linked(element) && seen == which;
            seen += usize::from(linked(element));
            if hit {
                name = device.to_string();
                match element {
                    Element::Vcvs { gain, .. }
                    | Element::Vccs { gain, .. }
                    | Element::Cccs { gain, .. }
                    | Element::Ccvs { gain, .. } => negate(gain),
                    _ => {}
                }
            }
            hit
        });
        let mut d = vec![];
        // A wrong circuit may not be solvable at all: that is an error, and no pass either.
        let report = verify_netlist(&graph, &causality, &netlist, &Settings::default(), &mut d);
        assert!(report.is_none_or(|report| !report.passes()), "{name} with a wrong sign passed");
    }
}

#[test]
fn a_source_with_its_terminals_exchanged_is_found() {
    let (graph, causality, mut netlist) = translated("eha_one_line");
    corrupt(&mut netlist, &mut |name, element, nodes| {
        let hit =
            matches!(element, Element::VoltageSource(_)) && name.to_lowercase().contains("bus");
        if hit {
            nodes.swap(0, 1);
        }
        hit
    });
    let report = verified("eha_one_line", &(graph, causality, netlist));
    assert!(!report.passes());
    assert!(report.trajectories.iter().any(|t| !t.holds()), "{}", report.text());
    assert!(
        report.energy.unwrap().holds(),
        "the graph's own balance does not depend on the netlist"
    );
}

#[test]
fn a_resistor_with_its_terminals_exchanged_is_the_same_circuit() {
    let (graph, causality, mut netlist) = translated("rlc");
    corrupt(&mut netlist, &mut |_, element, nodes| {
        let hit = matches!(element, Element::Resistor { .. });
        if hit {
            nodes.swap(0, 1);
        }
        hit
    });
    let report = verified("rlc", &(graph, causality, netlist));
    assert!(report.passes(), "{}", report.text());
}

#[test]
fn the_report_has_the_agreed_form() {
    let report = verified("rlc", &translated("rlc"));
    let json = report.json();
    let keys: Vec<&String> = json.as_object().unwrap().keys().collect();
    assert_eq!(keys, ["schema", "verdict", "trajectories", "energy"]);
    let trajectory = json["trajectories"][0].as_object().unwrap();
    for key in ["name", "max", "rms", "at"] {
        assert!(trajectory.contains_key(key), "{key}");
    }
    for key in ["in", "stored", "dissipated", "modulated", "residual"] {
        assert!(json["energy"][key].is_number(), "{key}");
    }
    assert!(report.text().contains("pass: both routes agree"), "{}", report.text());
}

#[test]
fn a_balance_with_a_sum_that_is_no_number_does_not_hold() {
    let balance = bondspice::verify::EnergyReport {
        delivered: 1.0,
        stored: 0.5,
        dissipated: 0.5,
        modulated: 0.0,
        residual: 0.0,
        tolerance: 1e-6,
        junctions: 0.0,
        elements: vec![],
    };
    assert!(balance.holds());
    assert!(!bondspice::verify::EnergyReport { stored: f64::NAN, ..balance }.holds());
}
