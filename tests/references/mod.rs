//! Reading references and comparing with them, for several tests.

use bondspice::bond::elaborate::Overrides;
use bondspice::trace::{Trace, compare, csv};

/// A file of the project.
pub fn file(path: &str) -> String {
    let path = format!("{}/{path}", env!("CARGO_MANIFEST_DIR"));
    std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// The options of a run.
pub fn options(reltol: Option<&str>) -> Overrides {
    let mut overrides = Overrides::default();
    overrides.options.extend(reltol.map(|value| ("reltol".to_string(), value.to_string())));
    overrides
}

/// Compares a trace with a reference, and fails with all signals that differ by more than `tolerance`.
#[track_caller]
pub fn agree(what: &str, trace: &Trace, reference: &Trace, tolerance: f64) {
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

/// A reference of `tests/reference`.
pub fn reference(path: &str) -> Trace {
    csv::read(file(&format!("tests/reference/{path}.csv")).as_bytes())
        .expect("the reference is a trace")
}

/// The reference's columns that the trace has too, time among them.
pub fn common(trace: &Trace, reference: Trace, least: usize) -> Trace {
    let mut kept = Trace::new(vec![], vec![]);
    for (name, column) in reference.names.into_iter().zip(reference.columns) {
        if trace.names.contains(&name) {
            kept.names.push(name);
            kept.units.push(String::new());
            kept.columns.push(column);
        }
    }
    assert!(kept.names.len() >= least, "{:?} against {:?}", trace.names, kept.names);
    kept
}
