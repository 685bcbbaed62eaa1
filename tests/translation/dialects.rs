//! Netlists for other simulators than ngspice: what is written is the same circuit, and what can be run agrees. MAST,
//! which is no netlist of SPICE's family, is read in `mast.rs`.

use crate::translated::{models, translated};
use bondspice::bond::elaborate::Overrides;
use bondspice::circuit::{Circuit, DeviceKind, Expr, Leaf};
use bondspice::cli::pipeline::run_text;
use bondspice::netlist::dialects::{self, DIALECTS, Written};
use bondspice::netlist::{CardKind, Netlist, flatten::flatten};
use bondspice::source::SourceMap;
use bondspice::trace::{Trace, compare, formats};
use std::collections::HashMap;
use std::process::Command;

fn written(netlist: &Netlist, dialect: &str) -> Result<Written, Vec<String>> {
    let mut d = vec![];
    let written = dialects::find(dialect).unwrap().write(netlist, &mut d);
    written.ok_or_else(|| d.iter().map(|d| format!("{} {}", d.code, d.message)).collect())
}

/// The flat circuit of a text.
fn flat(text: &str) -> Circuit {
    let mut map = SourceMap::default();
    let file = map.add("deck.cir", text);
    let mut d = vec![];
    let netlist = bondspice::netlist::read::read(
        &mut map,
        file,
        &bondspice::netlist::read::How::default(),
        &mut d,
    );
    // Options that steer the methods of the simulator it is written for are passed over.
    assert!(d.iter().all(|d| d.code == "W0704"), "{d:?}\n{text}");
    flatten(&netlist, &mut d).unwrap_or_else(|| panic!("{d:?}\n{text}"))
}

/// The value of a law where each voltage and current has a value that follows from its name.
fn value(circuit: &Circuit, law: &Expr, draw: f64) -> f64 {
    let named = |name: &str| {
        let sum: f64 = name
            .to_lowercase()
            .bytes()
            .enumerate()
            .map(|(k, b)| (k as f64 + draw) * f64::from(b))
            .sum();
        (sum * draw).sin()
    };
    let node = |id: u32| match id {
        0 => 0.0,
        id => named(&circuit.nodes[id as usize].name),
    };
    law.evaluate(&mut |leaf| match leaf {
        Leaf::Voltage(a, b) => node(a.0) - node(b.0),
        Leaf::Current(device) => named(&circuit.devices[device.0 as usize].name),
        Leaf::Time => draw,
        Leaf::Part(..) | Leaf::Capacitance(_) => panic!("only outputs speak of these"),
    })
}

/// Every device of one circuit stands in the other, between nodes of the same names, with the same value or law, but
/// that the second end of those in `sensed` may lead to their 0 V source.
fn same(a: &Circuit, b: &Circuit, senses: &[(String, String)], what: &str) {
    let others: HashMap<String, _> = b.devices.iter().map(|d| (d.name.to_lowercase(), d)).collect();
    assert_eq!(a.devices.len() + senses.len(), b.devices.len(), "{what}");
    for device in &a.devices {
        let name = device.name.to_lowercase();
        let other = others.get(&name).unwrap_or_else(|| panic!("{what}: {name} is missing"));
        let sensed = senses.iter().any(|(_, of)| of.to_lowercase() == name);
        for (k, (x, y)) in device.nodes.iter().zip(&other.nodes).enumerate() {
            let (x, y) = (&a.nodes[x.0 as usize].name, &b.nodes[y.0 as usize].name);
            assert!(x.eq_ignore_ascii_case(y) || (sensed && k == 1), "{what}: {name} {x} {y}");
        }
        match (&device.kind, &other.kind) {
            (
                DeviceKind::BehaviouralVoltage { law: x },
                DeviceKind::BehaviouralVoltage { law: y },
            )
            | (
                DeviceKind::BehaviouralCurrent { law: x },
                DeviceKind::BehaviouralCurrent { law: y },
            ) => {
                for draw in [0.37, 1.9, -2.3, 11.0, 0.004] {
                    let (x, y) = (value(a, x, draw), value(b, y, draw));
                    let alike =
                        x == y || (x - y).abs() <= 1e-12 * x.abs() || x.is_nan() && y.is_nan();
                    assert!(alike, "{what}: {name} at {draw}: {x} {y}");
                }
            }
            // The controlling device has another number, and another name where it is sensed.
            (DeviceKind::Cccs { gain: x, .. }, DeviceKind::Cccs { gain: y, .. })
            | (DeviceKind::Ccvs { gain: x, .. }, DeviceKind::Ccvs { gain: y, .. }) => {
                assert_eq!(x, y, "{what}: {name}")
            }
            (DeviceKind::Mutual { coupling: x, .. }, DeviceKind::Mutual { coupling: y, .. }) => {
                assert_eq!(x, y)
            }
            (DeviceKind::Vcvs { gain: x, .. }, DeviceKind::Vcvs { gain: y, .. })
            | (DeviceKind::Vccs { gain: x, .. }, DeviceKind::Vccs { gain: y, .. }) => {
                assert_eq!(x, y, "{what}: {name}")
            }
            (x, y) => assert_eq!(format!("{x:?}"), format!("{y:?}"), "{what}: {name}"),
        }
    }
}

#[test]
fn every_dialect_says_the_same_circuit() {
    let mut refused = vec![];
    for model in models() {
        let netlist = translated(&model, &Overrides::default()).translation.netlist;
        let first = flat(&written(&netlist, "ngspice").unwrap_or_else(|d| panic!("{d:?}")).text);
        for dialect in DIALECTS
            .iter()
            .skip(1)
            .filter(|dialect| dialect.read.is_some() && dialect.text.is_some())
        {
            let what = format!("{} in {}", model.display(), dialect.name);
            match written(&netlist, dialect.name) {
                Ok(written) => same(&first, &flat(&written.text), &written.senses, &what),
                Err(why) if dialect.name == "gnucap" => {
                    assert!(why[0].starts_with("E0605"), "{what}")
                }
                Err(why) => refused.push(format!("{what}: {}", why.join("; "))),
            }
        }
    }
    // What follows from a switch with two thresholds, and nothing else.
    assert!(
        refused.iter().all(|what| what.contains("xyce cannot say a switch with two thresholds")),
        "{refused:#?}"
    );
    println!("{refused:#?}");
}

#[test]
fn spellings_of_conditions_and_tables() {
    let text = "t\n.param k=2\nv1 a 0 1\nr1 a 0 1\n\
                b1 b 0 v={(v(a) > k) + (v(a) > 1 && !(v(a) == 2))}\n\
                b2 c 0 v={v(a) ? table(v(a), 0,1, 2,5) : 3}\n.op\n.end\n";
    let mut map = SourceMap::default();
    let file = map.add("deck.cir", text);
    let mut d = vec![];
    let netlist = bondspice::netlist::read::read(
        &mut map,
        file,
        &bondspice::netlist::read::How::default(),
        &mut d,
    );
    let laws = |dialect: &str| {
        let text = written(&netlist, dialect).unwrap_or_else(|d| panic!("{d:?}")).text;
        let laws = text
            .replace("\n+ ", "")
            .lines()
            .filter(|line| line.starts_with('b'))
            .map(str::to_string)
            .collect::<Vec<_>>();
        let circuit = flat(&text);
        same(
            &flat(&written(&netlist, "ngspice").unwrap_or_else(|d| panic!("{d:?}")).text),
            &circuit,
            &[],
            dialect,
        );
        laws
    };
    assert_eq!(
        laws("ngspice"),
        [
            "b1 b 0 V={(v(a) > k)+((v(a) > 1) && (!(v(a) == 2)))}",
            "b2 c 0 V={((v(a)) ? (pwl(min(max(v(a),0),2),0,1,2,5)) : (3))}"
        ]
    );
    assert_eq!(
        laws("xyce"),
        [
            "b1 b 0 V={if((v(a) > k),1,0)+if(((v(a) > 1) && (!(v(a) == 2))),1,0)}",
            "b2 c 0 V={if((abs(v(a)) > 0),table(v(a),0,1,2,5),3)}"
        ]
    );
    assert_eq!(
        laws("ltspice"),
        [
            "b1 b 0 V={if((v(a) > k),1,0)+if(((v(a) > 1) & (!(abs(v(a)-(2)) <= 0))),1,0)}",
            "b2 c 0 V={if((abs(v(a)) > 0),table(v(a),0,1,2,5),3)}"
        ]
    );
}

/// A name as a simulator heads its column with it, of one that is ngspice's: `i(h.x_motor.h_emf_1)`.
type Heading = fn(&str) -> String;

/// The path of a name and what it is called there, without the letter that ngspice puts before a path.
fn place(name: &str) -> (char, Option<(String, String)>) {
    let letter = name.chars().next().unwrap();
    let inner = &name[2..name.len() - 1];
    let Some((path, own)) = inner.rsplit_once('.') else { return (letter, None) };
    let path = if letter == 'i' { path.split_once('.').unwrap().1 } else { path };
    (letter, Some((path.replace('.', ":"), own.to_string())))
}

/// Columns of the simulators as they spell paths; of LTspice both spellings that are told of currents.
const HEADINGS: [(&str, &str, Heading); 4] = [
    ("ngspice", "raw", |name| name.to_lowercase()),
    ("xyce", "csv", |name| match place(name) {
        (letter, Some((path, own))) => format!("{letter}({path}:{own})").to_uppercase(),
        _ => name.to_uppercase(),
    }),
    ("ltspice", "ltspice", |name| match place(name) {
        (letter, Some((path, own))) => format!("{}({path}:{own})", letter.to_uppercase()),
        _ => format!("{}{}", name[..1].to_uppercase(), &name[1..]),
    }),
    ("ltspice", "ltspice", |name| match place(name) {
        ('i', Some((path, own))) => {
            format!("I({}:{}:{})", &own[..1], path.to_lowercase(), &own[1..])
        }
        (letter, Some((path, own))) => {
            format!("{}({}:{own})", letter.to_uppercase(), path.to_lowercase())
        }
        _ => name.to_string(),
    }),
];

/// Results of nested netlists, headed as their simulators would head them, come back under the names of the bond graph.
#[test]
fn results_in_each_spelling_of_paths_get_the_names_of_the_bond_graph() {
    let folder = tempfile::tempdir().unwrap();
    let bondspice = |arguments: &[&str]| {
        let program = Command::new(env!("CARGO_BIN_EXE_bondspice"))
            .args(arguments)
            .current_dir(folder.path())
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&program.stderr).to_string();
        assert!(program.status.success() && said.is_empty(), "{arguments:?}: {said}");
    };
    let read = |name: &str| {
        let path = folder.path().join(name);
        formats::read(name, &std::fs::read(path).unwrap()).unwrap()
    };
    for name in ["drive_train", "servo_axis"] {
        let path = crate::translated::root().join(format!("models/{name}.bg"));
        let path = path.to_str().unwrap();
        bondspice(&["simulate", path, "-q", "-o", "ours.csv"]);
        let ours = read("ours.csv");
        let model = translated(std::path::Path::new(&format!("{name}.bg")), &Overrides::default());
        let saved = model.nested.netlist.cards.iter().find_map(|card| match &card.kind {
            CardKind::Save { items, .. } => Some(items.iter().map(|(text, _)| text.clone())),
            _ => None,
        });
        let saved: Vec<String> = saved.unwrap().collect();
        assert!(saved.iter().any(|name| name.contains(".X_")), "{saved:?}");
        let observe = Some(saved.join(", "));
        let overrides = Overrides { observe, ..Overrides::default() };
        let (theirs, _) = run_text("deck.cir", &model.text(), &overrides).unwrap();
        for (dialect, ending, heading) in HEADINGS {
            let arguments = ["convert", path, "-q", "--to", dialect, "-o", "deck.cir", "--map"];
            bondspice(&[&arguments[..], &["map.json"]].concat());
            let mut result = theirs.clone();
            result.names[1..].iter_mut().for_each(|name| *name = heading(name));
            let file = format!("result.{}", if ending == "csv" { "csv" } else { "raw" });
            let format = formats::FORMATS.iter().find(|format| format.name == ending).unwrap();
            let mut bytes = vec![];
            (format.write)(&result, &formats::Heading::default(), &mut bytes).unwrap();
            std::fs::write(folder.path().join(&file), bytes).unwrap();
            bondspice(&["trace", &file, "--map", "map.json", "-o", "named.csv"]);
            let named = read("named.csv");
            assert_eq!(named.names, ours.names, "{name} for {dialect}");
            // What the subcircuit's run differs in: as much as rounding makes of a step's choice.
            let settings = compare::Settings { tolerance: 1e-5, rise: None, signals: None };
            let found = compare::compare(&named, &ours, &settings);
            let worst = found.signals.iter().map(|s| s.max).fold(0.0, f64::max);
            assert!(found.missing.is_empty() && worst <= 1e-5, "{name} for {dialect}: {worst:e}");
        }
    }
}

/// Whether gnucap is there; where it must be and is not, the test fails.
fn gnucap() -> bool {
    crate::peers::has("gnucap")
}

/// `12.5Meg`, `-7.99u`, `540.8314G`, and `1.2e-15`.
fn number(text: &str) -> f64 {
    let letters =
        text.find(|c: char| c.is_ascii_alphabetic() && c != 'E' && c != 'e').unwrap_or(text.len());
    let (digits, suffix) = text.split_at(letters);
    let exponent = match suffix {
        "" => 0,
        "f" => -15,
        "p" => -12,
        "n" => -9,
        "u" => -6,
        "m" => -3,
        "K" => 3,
        "Meg" => 6,
        "G" => 9,
        "T" => 12,
        other => panic!("{text}: {other}"),
    };
    format!("{}e{exponent}", digits.trim_end_matches('.')).parse().unwrap_or_else(|_| {
        digits.parse::<f64>().unwrap_or_else(|_| panic!("{text}")) * 10f64.powi(exponent)
    })
}

/// What gnucap makes of a text: its columns by name. The row at 0 is left out: before its first step gnucap shows
/// sources as if they fed a short.
fn run(text: &str, what: &str) -> Trace {
    let folder = tempfile::tempdir().unwrap();
    let deck = folder.path().join("deck.cir");
    std::fs::write(&deck, text).unwrap();
    let output = Command::new("gnucap").arg("-b").arg(&deck).output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout).to_string();
    assert!(!said.contains('?'), "{what}: {said:.2000}");
    let mut lines = said.lines().skip_while(|line| !line.starts_with('#'));
    let head = lines.next().unwrap_or_else(|| panic!("{what}: {said}"));
    let names: Vec<String> = head[1..].split_whitespace().map(str::to_lowercase).collect();
    let mut trace = Trace::new(names.clone(), vec![]);
    for line in lines.skip(1) {
        let values: Vec<f64> = line.split_whitespace().map(number).collect();
        if values.len() == names.len() {
            for (column, value) in trace.columns.iter_mut().zip(values) {
                column.push(value);
            }
        }
    }
    trace
}

/// The rows of a trace at other times.
fn without(trace: &Trace, times: &[f64]) -> Trace {
    let keeps: Vec<bool> =
        trace.time().iter().map(|t| times.iter().all(|jump| (t - jump).abs() > 1e-9)).collect();
    let mut rest = Trace::new(trace.names.clone(), vec![]);
    for (column, all) in rest.columns.iter_mut().zip(&trace.columns) {
        column.extend(all.iter().zip(&keeps).filter(|(_, keep)| **keep).map(|(value, _)| *value));
    }
    rest
}

/// Its two inertias are one behind a gear: gnucap's trapezoidal rule rings on them and ends without a step left, with
/// whatever resistance its sources have.
const GNUCAP_GIVES_UP: [&str; 1] = ["gear_dep.bg"];

/// Waves over twenty cells in SI, where capacitances of 1e-13 stand beside inertances of 1e7: gnucap's error, 2.4e-3, does
/// not fall with its steps. Motors at 400 rad/s, which are amperes there, through the resistance that each source has in
/// gnucap: in proportion to it, 1e-3 of the range at 1 µΩ. D1's gyrator the other way round: 1.2e-4 at 10 µΩ, 2.4e-3 at 3,
/// 1.3e-2 at 1.
const ROUGH: [(&str, f64); 4] = [
    ("hydraulic_line.bg", 5e-3),
    ("drive_train.bg", 5e-3),
    ("dc_motor_load.bg", 5e-3),
    ("textbook/D1.bg", 5e-3),
];

/// Linear models in gnucap against our own run of the same circuit, each voltage and current that is saved. 1e-3 of
/// the range of each: gnucap takes ten steps of the trapezoidal rule a row.
#[test]
fn linear_models_in_gnucap() {
    if !gnucap() {
        return;
    }
    let mut tried = vec![];
    for model in models() {
        let translation = translated(&model, &Overrides::default()).translation;
        let Ok(written) = written(&translation.netlist, "gnucap") else { continue };
        let what = model.display().to_string();
        if GNUCAP_GIVES_UP.contains(&what.as_str()) {
            continue;
        }
        let theirs = run(&written.text, &what);
        // A row at a jump holds the value after it in ours, the one before its rise in theirs.
        let header = translation.netlist.header.iter().filter(|(key, _)| key == "jump");
        let jumps: Vec<f64> = header
            .flat_map(|(_, words)| words.split(' ').filter_map(|word| word.parse().ok()))
            .collect();
        let observe = Some(theirs.names[1..].join(", "));
        let overrides = Overrides { observe, ..Overrides::default() };
        let (ours, _) =
            run_text("deck.cir", &written.text, &overrides).unwrap_or_else(|d| panic!("{d:?}"));
        let (theirs, ours) = (without(&theirs, &jumps), without(&ours, &jumps));
        let settings = compare::Settings { tolerance: 1e-3, rise: None, signals: None };
        let comparison = compare::compare(&theirs, &ours, &settings);
        for signal in &comparison.signals {
            println!("{what}: {} {:.1e} at {}", signal.name, signal.max, signal.at);
        }
        let worst = comparison.signals.iter().map(|s| s.max).fold(0.0, f64::max);
        let rough = ROUGH.iter().find(|(name, _)| *name == what);
        let tolerance = rough.map_or(1e-3, |(_, tolerance)| *tolerance);
        assert!(comparison.missing.is_empty() && worst <= tolerance, "{what}: {worst:.1e}");
        tried.push(what);
    }
    assert!(tried.len() >= 18, "{tried:?}");
}
