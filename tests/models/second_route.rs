//! The second route on the shipped models, against references made elsewhere and closed forms.

use bondspice::bond::causality::Causality;
use bondspice::bond::elaborate::{Overrides, elaborate, load};
use bondspice::bond::graph::BondGraph;
use bondspice::second::{Run, Settings, integrate};
use bondspice::source::SourceMap;
use bondspice::trace::{Trace, csv};
use std::path::Path;

fn file(path: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
    std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

#[track_caller]
fn graph(model: &str, overrides: &Overrides) -> BondGraph {
    let mut map = SourceMap::default();
    let id = map.add(model, file(&format!("models/{model}.bg")));
    let mut d = vec![];
    let program = load(&mut map, id, &overrides.folders, &mut d);
    match elaborate(&program, &map, overrides, &mut d) {
        Some(graph) => graph,
        None => panic!("{model}: {d:#?}"),
    }
}

#[track_caller]
fn run(graph: &BondGraph, times: &[f64]) -> Run {
    let mut d = vec![];
    let run = integrate(graph, &Causality::default(), times, &Settings::default(), &mut d);
    let run = run.unwrap_or_else(|| panic!("{}: {d:#?}", graph.name));
    let residual = run.energy.residual.abs() / run.energy.turnover;
    assert!(residual <= 1e-6, "{}: energy off by {residual:e}, {:#?}", graph.name, run.energy);
    let junctions = &run.energy.junctions;
    assert!(junctions.0 < 1e-9, "{}: {junctions:?} makes power", graph.name);
    run
}

fn reference(path: &str) -> Trace {
    match csv::read(file(&format!("tests/reference/{path}.csv")).as_bytes()) {
        Ok(trace) => trace,
        Err(error) => panic!("{path}: {error:?}"),
    }
}

/// Runs a model over a reference's rows and compares the columns that both have.
#[track_caller]
fn against(model: &str, path: &str, overrides: &Overrides) -> Run {
    let reference = reference(path);
    let run = run(&graph(model, overrides), reference.time());
    let mut compared = 0;
    for (name, ours) in run.names.iter().zip(&run.columns).skip(1) {
        let Some(theirs) = reference.column(name) else { continue };
        compared += 1;
        let (low, high) = theirs
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
        let mut worst = (0.0, 0.0);
        for ((ours, theirs), t) in ours.iter().zip(theirs).zip(reference.time()) {
            let error = (ours - theirs).abs() / (high - low);
            if error > worst.0 || error.is_nan() {
                worst = (error, *t);
            }
        }
        assert!(
            worst.0 <= 1e-6,
            "{model}: {name} is off by {:e} of range at {} s",
            worst.0,
            worst.1
        );
    }
    assert!(
        compared + 1 >= run.names.len().min(reference.names.len()),
        "{compared} columns compared"
    );
    run
}

/// What to observe of the actuator, by the names of the reference.
fn actuator(drive: Vec<String>) -> Overrides {
    let observe = "x, theta, f(armature) as \"I\", f(shaft) as \"Omega\", e(pump_port) as \"dPp\", \
        f(line) as \"Qp\", e(jack_port) as \"dPj\", f(rod) as \"Vj\", e(attachment) as \"Fj\", alpha, \
        power(bus) as \"Pelec\"";
    Overrides { drive, observe: Some(observe.to_string()), ..Overrides::default() }
}

#[test]
fn the_actuator_moves_as_the_reference_and_its_energy_goes_where_it_says() {
    let run = against("eha_one_line", "eha/one_line_nominal", &actuator(vec![]));
    let share = |name: &str| run.energy.shares.iter().find(|s| s.name == name).unwrap().energy;
    // tests/reference/eha: bus in 2619.0, air −638.1, then the losses.
    for (name, joules) in [
        ("bus", 2619.0),
        ("aero", -638.1),
        ("R", 821.9),
        ("fmp", 363.3),
        ("eta", 228.3),
        ("Clp", 198.7),
        ("fetam", 181.6),
        ("dry", 143.7),
        ("line_loss", 42.3),
        ("dilatation", 0.6),
        ("Cmj", 0.5),
    ] {
        assert!((share(name) - joules).abs() <= 0.051, "{name}: {} J, not {joules}", share(name));
    }
    assert!(run.energy.stored.abs() < 0.05, "{}", run.energy.stored);
}

#[test]
fn the_actuator_takes_a_step_through_all_its_limits() {
    let drive = vec![
        "x_ref = step(0.1 s, 0 mm, 20 mm)".to_string(),
        "M_FC = pwl(0 s, 0 N*m; 0.5 s, 0 N*m; 0.6 s, -6 kN*m)".to_string(),
    ];
    against("eha_one_line", "eha/one_line_step", &actuator(drive));
}

#[test]
fn textbook_systems_move_as_their_references() {
    for model in ["buck", "dc_motor_load", "duffing", "gear_dep", "msd", "rlc_bridge", "two_tank"] {
        against(model, &format!("textbook/{model}"), &Overrides::default());
    }
}

/// A case's columns at a time, by name.
#[track_caller]
fn case(
    model: &str,
    set: &[(&str, &str)],
    times: &[f64],
    expected: &[(&str, &[f64])],
    tolerance: f64,
) {
    let set = set.iter().map(|(k, v)| (k.to_string(), v.to_string())).collect();
    let graph = graph(&format!("textbook/{model}"), &Overrides { set, ..Overrides::default() });
    let rows: Vec<f64> = std::iter::once(0.0).chain(times.iter().copied()).collect();
    let run = run(&graph, &rows);
    for (name, values) in expected {
        let at = run
            .names
            .iter()
            .position(|n| n == name)
            .unwrap_or_else(|| panic!("{model}: no {name}"));
        for (row, value) in values.iter().enumerate() {
            let ours = run.columns[at][row + 1];
            assert!(
                (ours - value).abs() <= tolerance * value.abs().max(1e-3),
                "{model}: {name} = {ours}, not {value}, at {} s",
                times[row]
            );
        }
    }
}

#[test]
fn textbook_cases_have_their_printed_values() {
    let printed = 2e-8;
    case(
        "A1",
        &[],
        &[0.5, 1.0, 5.0, 10.0],
        &[("q", &[7.78800783, 6.06530660, 0.820849986, 0.0673794700])],
        printed,
    );
    case(
        "A2",
        &[],
        &[0.5, 1.0, 5.0, 10.0],
        &[("q", &[9.45959469, 8.94839317, 5.73753421, 3.29192988])],
        printed,
    );
    case(
        "A3",
        &[],
        &[0.5, 5.0],
        &[("q", &[0.140904120, 0.101294275]), ("p", &[1.27293973, -0.162532987])],
        printed,
    );
    case("A4", &[], &[5.0], &[("q", &[2.98652411])], printed);
    case("A5", &[], &[5.0], &[("q", &[0.236257515])], printed);
    case("A6", &[], &[1.0, 2.0, 5.0], &[("q", &[0.367879441, 0.270670566, 0.0336897350])], printed);
    case(
        "A7",
        &[],
        &[1.0, 5.0, 60.0],
        &[
            ("Ca", &[1.0, 1.0, 1.0]),
            ("Cb", &[1.41969860, 0.543796655, 0.5]),
            ("L", &[0.316060279, 0.469679239, 0.5]),
        ],
        printed,
    );
    case(
        "A8",
        &[],
        &[10.0, 100.0],
        &[("q", &[8.37277877, -5.17395582]), ("p", &[4.58195608, 18.0080119])],
        printed,
    );
    case("C1", &[], &[2e-3], &[("i", &[6.28419224e-4]), ("e2", &[0.352429597])], printed);
    case(
        "D1",
        &[],
        &[1.0, 10.0, 100.0],
        &[
            ("y", &[11.7779906, 3.55952157, 4.04760169]),
            ("w", &[19.4788873, 63.7252804, 39.9204997]),
        ],
        printed,
    );
    case("D3", &[], &[1e-3, 3e-3], &[("v", &[0.283468689, 0.632120559])], printed);
    let (e, s, c) = ((-1.0f64).exp(), 1.0f64.sin(), 1.0f64.cos());
    case("E1", &[], &[2.0], &[("p", &[-10.0 * e * s]), ("q", &[10.0 * e * c])], printed);
    case("E2", &[], &[1.5, 3.0], &[("q", &[0.632120559, 0.864664717])], printed);
    case(
        "E4",
        &[],
        &[1.0],
        &[("i1", &[2.5]), ("i3", &[2.5]), ("i5", &[0.0]), ("i", &[5.0])],
        printed,
    );
    case(
        "E4",
        &[("R4", "2")],
        &[1.0],
        &[
            ("vb", &[2.69230769]),
            ("vc", &[3.07692308]),
            ("i5", &[-0.384615385]),
            ("i", &[4.23076923]),
        ],
        printed,
    );
    case(
        "F1",
        &[],
        &[4.76802203, 47.6802203],
        &[("q", &[1.0, 1.0]), ("energy", &[0.75, 0.75])],
        1e-7,
    );
    case("F2", &[], &[1.0], &[("v", &[0.517009824]), ("i", &[4.82990176e-4])], printed);
}
