//! Activities against closed forms, and what leaving out the least active costs, measured again.

use bondspice::analysis::activity::{Activities, metered};
use bondspice::bond::elaborate::Overrides;
use bondspice::cli::pipeline;
use bondspice::cli::run::ready;
use bondspice::source::SourceMap;
use bondspice::trace::csv;
use std::f64::consts::PI;
use std::path::Path;
use std::process::Command;

/// A flow sin(wt) through R, I and C over whole periods:
///
/// R: ∫ R·sin² = R·T/2; I: ∫ |L·w·sin·cos| = L·w·T/π; C, from rest: q = (1 − cos)/w, 4/(w²·C) a period.
///
/// A thousand rows a period make lines of the powers to 1e-5; 1e-4 is allowed.
#[test]
fn activities_are_those_of_closed_forms() {
    let text = "Sf:i(flow) -> 1:mesh -> R:R(3), I:L(0.2), C:C(0.05), R:small(1e-5)\n\
                signal flow = sine(0, 1, 2)\nsimulate until 2 s step 0.5 ms\nobserve e(C), f(mesh)\n";
    let mut map = SourceMap::default();
    let file = map.add("model.bg", text);
    let mut d = vec![];
    let graph = pipeline::graph(&mut map, file, &Overrides::default(), &mut d).unwrap();
    let model =
        pipeline::model_of(metered(&graph), &map, &mut d).unwrap_or_else(|| panic!("{d:?}"));
    let (circuit, units) = model.circuit(&mut d).unwrap();
    let run = ready(circuit, &units, true, None, &mut d).unwrap();
    let mut trace = run.trace();
    run.go(&mut trace).unwrap_or_else(|failure| panic!("{:?}", failure.diagnostic));
    let activities = Activities::of(&graph, &trace);
    let (w, until) = (4.0 * PI, 2.0);
    let wanted = [
        ("C", 4.0 * 4.0 / (w * w * 0.05)),
        ("R", 3.0 * until / 2.0),
        ("L", 0.2 * w * until / PI),
        ("small", 1e-5 * until / 2.0),
    ];
    let total: f64 = wanted.iter().map(|(_, joules)| joules).sum();
    let mut wanted = wanted.to_vec();
    wanted.sort_by(|a, b| b.1.total_cmp(&a.1));
    assert_eq!(activities.elements.len(), wanted.len());
    for (found, (name, joules)) in activities.elements.iter().zip(&wanted) {
        assert_eq!(graph.vertex(found.element).name, *name);
        assert!(
            (found.joules - joules).abs() <= 1e-4 * joules,
            "{name}: {} {joules}",
            found.joules
        );
        assert!((found.index - joules / total).abs() <= 1e-4, "{name}");
    }
    assert_eq!(activities.kept(0.999), 3);
    assert_eq!(activities.kept(1.0), 4);
}

fn bondspice(arguments: &[&str]) -> String {
    let found = Command::new(env!("CARGO_BIN_EXE_bondspice")).args(arguments).output().unwrap();
    assert!(found.status.success(), "{arguments:?} {}", String::from_utf8_lossy(&found.stderr));
    String::from_utf8(found.stdout).unwrap()
}

/// The largest difference of a column in parts of its range, both models run by `simulate`.
fn measured(whole: &str, less: &str, name: &str) -> f64 {
    let read = |file: &str| {
        let text = std::fs::read(file).unwrap();
        csv::read(&text).ok().unwrap().column(name).unwrap().to_vec()
    };
    let (whole, less) = (read(whole), read(less));
    let low = whole.iter().copied().fold(f64::INFINITY, f64::min);
    let high = whole.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    whole.iter().zip(&less).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / (high - low)
}

#[test]
fn the_error_is_that_of_two_runs() {
    let folder = tempfile::tempdir().unwrap();
    let place = |name: &str| folder.path().join(name).to_str().unwrap().to_string();
    let model = Path::new(env!("CARGO_MANIFEST_DIR")).join("models/eha_two_line.bg");
    let (model, less) = (model.to_str().unwrap(), place("less.bg"));
    // Its elements stand in instances: the new text is laid open, and so is what is observed.
    let run = ["--until", "0.12s", "-q", "--observe", "x in mm, f(jack.moving)"];
    let reduce = ["reduce", model, "--keep", "0.9999", "--format", "json", "-o", &less];
    let found = bondspice(&[&reduce[..], &run].concat());
    let found: serde_json::Value = serde_json::from_str(&found).unwrap();
    let elements = found["elements"].as_array().unwrap();
    let joules: Vec<f64> = elements.iter().map(|one| one["activity"].as_f64().unwrap()).collect();
    assert!(joules.windows(2).all(|pair| pair[0] >= pair[1]));
    let sum: f64 = joules.iter().sum();
    assert!((sum - found["total"].as_f64().unwrap()).abs() <= 1e-12 * sum);
    let reduced = &found["reduced"][0];
    let out = reduced["left_out"].as_array().unwrap().len();
    assert!(
        out >= 2 && reduced["elements"].as_u64().unwrap() as usize == joules.len() - out,
        "{found}"
    );
    let (a, b) = (place("a.csv"), place("b.csv"));
    bondspice(&[&["simulate", model, "-o", &a], &run[..]].concat());
    let flat = ["--until", "0.12s", "-q", "--observe", "x in mm, f(jack_moving)"];
    bondspice(&[&["simulate", &less, "-o", &b], &flat[..]].concat());
    let (error, again) = (reduced["errors"]["x"].as_f64().unwrap(), measured(&a, &b, "x"));
    // The text read back has its devices in another order, and steps of a tolerance of 1e-6 end elsewhere.
    assert!(error > 0.0 && (error - again).abs() <= 1e-6 * again, "{error} {again}");
    // The text is a model with as many elements fewer.
    let graph = bondspice(&["simulate", &less, "--emit", "graph"]);
    assert!(!graph.contains("jack_M") && graph.contains("jack_moving"), "{graph}");
}
