//! Reading references and comparing with them, for several tests.

// Each test uses its part.
#![allow(dead_code)]

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

/// A run of the actuator with two lines, in the names of its reference.
pub struct TwoLines {
    drives: [&'static str; 2],
    until: &'static str,
}

/// The runs by the names of their references.
pub const TWO_LINES: [(&str, TwoLines); 2] = [
    (
        "two_line_step",
        TwoLines {
            drives: [
                "x_ref = step(0.1 s, 0 mm, 20 mm)",
                "M_FC = pwl(0 s, 0 N*m; 0.5 s, 0 N*m; 0.6 s, -6 kN*m; 1 s, -6 kN*m)",
            ],
            until: "1 s",
        },
    ),
    (
        "two_line_overload",
        TwoLines {
            drives: [
                "x_ref = 0 m",
                "M_FC = pwl(0 s, 0 N*m; 0.1 s, 0 N*m; 0.4 s, 16.7 kN*m; 0.6 s, 16.7 kN*m; 0.9 s, 0 N*m)",
            ],
            until: "1.5 s",
        },
    ),
];

impl TwoLines {
    /// What to change in `eha_two_line.bg`.
    pub fn overrides(&self, reltol: Option<&str>) -> Overrides {
        const OBSERVED: &str = "x, theta, f(motor.armature) as \"I\", f(motor.rotor) as \"Omega\", \
            e(pump1) as \"Pp1\", e(pump2) as \"Pp2\", f(pump.out.2) - f(pump.gap) as \"Qp\", f(pump.gap) as \"Qlp\", \
            f(line1.flow) as \"Ql1\", f(line2.flow) as \"Ql2\", f(valve1.flow) as \"Qaccu1\", \
            f(valve2.flow) as \"Qaccu2\", f(limiter.flow) as \"Qsat\", e(jack.side1) as \"Pj1\", \
            e(jack.side2) as \"Pj2\", f(jack.gap) as \"Qlj\", e(jack.chamber1.fluid) as \"Pc1\", \
            e(jack.chamber2.fluid) as \"Pc2\", e(attachment.force) as \"Fj\", f(jack.moving) as \"Vj\", \
            f(surface) as \"Omega_FC\", control.alpha as \"alpha\", control.I_ref as \"Iref\", \
            control.w_ref as \"Omega_ref\", power(bus) as \"Pelec\"";
        let mut overrides = options(reltol);
        overrides.drive = self.drives.map(str::to_string).to_vec();
        overrides.until = Some(self.until.to_string());
        overrides.observe = Some(OBSERVED.to_string());
        overrides
    }
}
