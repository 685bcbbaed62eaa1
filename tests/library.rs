//! The library's models, each in a shipped model or a small one of its own, against references made elsewhere, closed
//! forms, and the same equations written by hand and integrated here.
//!
//! The error is that of `trace::compare`: the largest difference over the reference's rows as a part of the
//! reference's range.

use bondspice::bond::elaborate::Overrides;
use bondspice::cli::pipeline::run_text;
use bondspice::trace::{Trace, compare};

fn file(path: &str) -> String {
    let path = format!("{}/{path}", env!("CARGO_MANIFEST_DIR"));
    std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{path}: {error}"))
}

fn options(reltol: Option<&str>) -> Overrides {
    let mut overrides = Overrides::default();
    overrides.options.extend(reltol.map(|value| ("reltol".to_string(), value.to_string())));
    overrides
}

/// Runs a text.
#[track_caller]
fn run(name: &str, text: &str, overrides: &Overrides) -> Trace {
    match run_text(name, text, overrides) {
        Ok((trace, _)) => trace,
        Err(diagnostics) => panic!("{name}: {diagnostics:#?}"),
    }
}

/// Runs a model of `models/`.
#[track_caller]
fn shipped(model: &str, overrides: &Overrides) -> Trace {
    run(&format!("{model}.bg"), &file(&format!("models/{model}.bg")), overrides)
}

/// Compares a trace with a reference, and fails with all signals that differ by more than `tolerance`.
#[track_caller]
fn agree(what: &str, trace: &Trace, reference: &Trace, tolerance: f64) {
    let settings = compare::Settings { tolerance, ..compare::Settings::default() };
    let comparison = compare::compare(trace, reference, &settings);
    let mut report = format!("{what}, tolerance {tolerance:e}:\n");
    for signal in &comparison.signals {
        let mark = if signal.same() { "    " } else { "<== " };
        report += &format!("{mark}{} {:.2e} at {}\n", signal.name, signal.max, signal.at);
    }
    let columns = reference.names.len() - 1;
    assert_eq!(comparison.signals.len(), columns, "{:?}, {:?}", trace.names, reference.names);
    assert!(comparison.signals.iter().all(|signal| signal.same()), "{report}");
    println!("{report}");
}

/// The equations are the same, so what is left is rounding and the choice of steps: nothing once both runs are far more
/// exact than the tolerance.
#[test]
fn the_actuator_of_components_is_the_flat_one() {
    for (reltol, tolerance) in [(None, 2e-5), (Some("1e-10"), 1e-9)] {
        let flat = shipped("eha_one_line", &options(reltol));
        let components = shipped("eha_components", &options(reltol));
        assert_eq!(components.names, flat.names);
        assert_eq!(components.time(), flat.time());
        agree("eha_components", &components, &flat, tolerance);
    }
}
