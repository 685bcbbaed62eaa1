//! `verify` on the shipped models, and on translations that were made wrong.

use bondspice::bond::causality::{Causality, assign};
use bondspice::bond::elaborate::{Overrides, elaborate, load};
use bondspice::bond::graph::BondGraph;
use bondspice::bond::initial;
use bondspice::cli::pipeline;
use bondspice::diagnostic::{Diagnostic, Severity};
use bondspice::expr::{Expr, Node};
use bondspice::netlist::{CardKind, Element, Name, Netlist, Nodes};
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
    change: &mut dyn FnMut(&str, &mut Element, &mut Nodes<Name>) -> bool,
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
        jumps: 0.0,
        residual: 0.0,
        tolerance: 1e-6,
        junctions: 0.0,
        elements: vec![],
    };
    assert!(balance.holds());
    assert!(!bondspice::verify::EnergyReport { stored: f64::NAN, ..balance }.holds());
}

/// The command's own report, and its exit code.
fn command(folder: &Path, arguments: &[&str]) -> (i32, serde_json::Value, String) {
    let output = std::process::Command::new(env!("CARGO_BIN_EXE_bondspice"))
        .arg("verify")
        .args(arguments)
        .current_dir(folder)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr).to_string();
    let report = serde_json::from_slice(&output.stdout).unwrap_or_default();
    (output.status.code().unwrap(), report, said)
}

/// The keys that scripts rely on; more may stand beside them.
const AGREED: [(&str, &[&str]); 4] = [
    ("", &["schema", "verdict", "exact", "laws", "values", "trajectories", "energy"]),
    ("/exact", &["verdict", "draws", "unknowns", "probability", "mismatches"]),
    ("/trajectories/0", &["name", "max", "rms", "at"]),
    ("/energy", &["in", "stored", "dissipated", "modulated", "residual"]),
];

const MOTOR: &str = "model Motor(R = 1 Ohm, L = 2 mH, k = 0.3 V*s) {\n  port in a : electrical\n  port out b : rotation\n  \
                     a -> 1:arm -> GY:k -> 1:rotor -> b\n  arm -> R:R, I:L\n  rotor -> R:f(0.1 N*m*s)\n}\n\
                     Se:U(9 V) -> Motor:m(R = 2 Ohm) -> I:J(0.2 kg*m^2)\n\
                     simulate until 1 s step 10 ms\nobserve f(m.arm), f(m.rotor)\n";

#[test]
fn the_command_reports_and_exits_as_agreed() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("motor.bg", MOTOR);
    let run = |arguments: &[&str]| command(folder.path(), arguments);
    let json = |arguments: &[&str]| run(&[&["motor.bg", "--format", "json"], arguments].concat());
    for dialect in ["ngspice", "xyce", "ltspice", "gnucap"] {
        let (code, report, said) = json(&["--to", dialect]);
        assert_eq!((code, said.as_str()), (0, ""), "{dialect}");
        assert_eq!((&report["schema"], &report["verdict"]), (&1.into(), &"pass".into()));
        for (part, keys) in AGREED {
            let object = report.pointer(part).unwrap().as_object().unwrap();
            for key in keys {
                assert!(object.contains_key(*key), "{dialect}: {part}/{key}");
            }
        }
        assert_eq!(report["trajectories"].as_array().unwrap().len(), 2);
        assert!(report["exact"]["probability"].as_f64().unwrap() < 1e-16);
        assert_eq!(report["exact"]["mismatches"].as_array().unwrap().len(), 0);
    }
    assert_eq!(json(&["--scale", "electrical=3,rotation=7"]).0, 0);
    // A text that somebody edited, in a dialect that spells its map otherwise, too.
    for dialect in ["ngspice", "xyce", "ltspice"] {
        let output = std::process::Command::new(env!("CARGO_BIN_EXE_bondspice"))
            .args(["convert", "motor.bg", "--to", dialect, "-o", "motor.cir", "--map", "map.json"])
            .current_dir(folder.path())
            .output()
            .unwrap();
        assert!(output.status.success(), "{output:?}");
        let text = std::fs::read_to_string(folder.path().join("motor.cir")).unwrap();
        let given = ["--netlist", "motor.cir", "--dialect", dialect, "--map", "map.json"];
        assert_eq!(json(&given).0, 0, "{dialect}: {:?}", json(&given));
        let changed = text.replace("Motor PARAMS: R=2", "Motor PARAMS: R=3");
        assert_ne!(text, changed, "{text}");
        write("motor.cir", &changed);
        let (code, report, _) = json(&given);
        assert_eq!((code, &report["verdict"]), (1, &"fail".into()), "{dialect}: {report:#}");
        assert_eq!(report["values"]["mismatches"][0]["variable"], ".param X_m.R", "{report:#}");
        assert!(
            report["trajectories"].as_array().unwrap().is_empty() && report["energy"].is_null()
        );
        write("motor.cir", &text.replace("R_R ", "R_R 0 "));
        assert_ne!(json(&given).0, 0);
        // A card moved: the first variable that differs, and the card.
        let line = text.lines().find(|line| line.starts_with("R_R ")).unwrap();
        let mut moved: Vec<&str> = line.split_whitespace().collect();
        moved[2] = if moved[2] == "a_m" { "a_p" } else { "a_m" };
        write("motor.cir", &text.replace(line, &moved.join(" ")));
        let (code, report, _) = json(&given);
        assert_eq!(code, 1, "{dialect}: {report:#}");
        let first = &report["exact"]["mismatches"][0];
        assert!(!first["variable"].as_str().unwrap().is_empty(), "{first}");
        assert_eq!(first["card"].as_str().unwrap().to_lowercase(), "motor.r_r", "{first}");
    }
    // A usage that is none, input that is none, a run that does not end, a file that is not there.
    assert_eq!(run(&["motor.bg", "--format", "yaml"]).0, 2);
    write("broken.bg", "Se:U(9 V) -> 1:m\nm -> R:r\n");
    assert_eq!(run(&["broken.bg"]).0, 3);
    write("motor.cir", "no netlist\nR1 a b\n.end\n");
    assert_eq!(run(&["motor.bg", "--netlist", "motor.cir"]).0, 3);
    write("map.json", "{\"variables\": 3}");
    let (code, _, said) = run(&["motor.bg", "--netlist", "motor.cir", "--map", "map.json"]);
    assert_eq!(code, 3, "{said}");
    let blows_up = "Se:U(1 V) -> 1:m -> I:L(1 H)\nm -> R:r(e = -(1 Ohm/A)*f^2)\nsimulate until 10 s step 0.1 s\nobserve f(m)\n";
    write("blows_up.bg", blows_up);
    let (code, _, said) = run(&["blows_up.bg"]);
    assert_eq!(code, 4, "{said}");
    assert_eq!(run(&["nowhere.bg"]).0, 5);
}

/// A text's report, or what was said instead.
fn of_text(text: &str) -> Result<Report, Vec<Diagnostic>> {
    let (mut map, mut d) = (SourceMap::default(), vec![]);
    let file = map.add("text.bg", text.to_string());
    let (plain, question) = (Overrides::default(), pipeline::Question::default());
    match pipeline::verify(&mut map, file, &plain, &question, &mut d, |_| {}) {
        Ok(Some(report)) => Ok(report),
        Ok(None) | Err(_) => Err(d),
    }
}

/// The far end of a long ladder has powers next to the smallest number there is, whose digits say nothing.
#[test]
fn a_ladder_whose_far_end_hardly_moves_keeps_its_energy() {
    let mut text = String::from("Se:V(1) -> 1:j1\n");
    for k in 1..=300 {
        text += &format!("j{k} -> R:R{k}(1)\nj{k} -> 0:n{k}\nn{k} -> C:C{k}(1e-6)\n");
        if k < 300 {
            text += &format!("n{k} -> 1:j{}\n", k + 1);
        }
    }
    text += "simulate until 1 us step 0.1 us\nobserve e(n1)\n";
    let report = of_text(&text).expect("it has a solution");
    assert!(report.passes(), "{}", report.text());
}

#[test]
fn what_cannot_be_solved_is_told_in_the_words_of_the_graph() {
    // The table ends at an effort of 20, and the gyrator asks for more from t = 20/4.6 on.
    let text = "signal u = ramp(0, 10)\n1:s\ns -> GY:g(4.6) -> 0:n\ns -> Sf:f(u)\ns -> R:r(3)\nn -> I:l(100)\n\
                n -> R:t(e = table(f, [-10, -20; -1, -4; 1, 5; 10, 20]))\nsimulate until 1 step 0.01\nobserve e(n)\n";
    let said = of_text(text).expect_err("it has no solution");
    let error = said.iter().find(|d| d.severity == Severity::Error).unwrap();
    let all = format!("{error:?}");
    assert!(all.contains("t = 0.43"), "{all}");
    assert!(all.contains("e(g.1)") && all.contains("nothing there gives an effort"), "{all}");
}

#[track_caller]
fn passes(text: &str) -> Report {
    let report = of_text(text).unwrap_or_else(|d| panic!("{text}\n{d:#?}"));
    assert!(report.passes(), "{text}\n{}", report.text());
    report
}

#[test]
fn what_stores_gain_in_jumps_is_in_the_balance() {
    // A source steps across a capacitor: ½·C·U² at once, and U²/R from there on.
    let set = "signal u = step(0.1, 0, 2)\nSe:s(u) -> 0:n\nn -> C:c(1)\nn -> R:r(3)\n\
               simulate until 1 step 0.01\nobserve q(c), f(r)\n";
    let energy = passes(set).energy.unwrap();
    assert!((energy.jumps - 2.0).abs() < 1e-9, "{}", energy.jumps);
    assert!((energy.dissipated - 1.2).abs() < 1e-8, "{}", energy.dissipated);
    // One of two capacitors grows at each sample: charge goes over to it, and what the other loses is told.
    let grows = "signal u = sample(ramp(0, 1), 0.1)\nsignal y = sine(0, 1, 1)\nSf:s(y) -> 0:n\n\
                 n -> C:c(1, e0 = 1)\nn -> C:m(2 + u)\nn -> R:r(3)\nsimulate until 1 step 0.01\nobserve q(c)\n";
    let energy = passes(grows).energy.unwrap();
    assert!(energy.jumps < -0.1 && energy.residual.abs() < 1e-9, "{energy:#?}");
}
