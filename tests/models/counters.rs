//! What the run of each shipped model takes: counters are exact, so that work that grows is seen at once.
//!
//! `INSTA_UPDATE=always cargo test --test models counters` takes new ones after a change that is meant.

use bondspice::bond::elaborate::Overrides;
use bondspice::cli::run::run_text;
use bondspice::source::examples::EXAMPLES;
use std::fmt::Write;

/// Runs that are long are cut short here.
const SHORT: &[(&str, &str)] = &[("half_wing.bg", "20 ms"), ("ten_motors.bg", "0.2 s")];

#[test]
fn runs_of_shipped_models_take_what_they_took() {
    let mut table = String::from(
        "model, method: equations; accepted + pilot, rejected; evaluations, jacobians; \
         factorisations + replayed, solves; iterations; events\n",
    );
    for (name, text) in EXAMPLES {
        if !text.contains("simulate until") {
            continue;
        }
        let until = SHORT.iter().find(|row| row.0 == *name).map(|row| row.1.to_string());
        let overrides = Overrides { until, ..Overrides::default() };
        let (_, s) = run_text(name, text, &overrides).unwrap_or_else(|d| panic!("{name}: {d:#?}"));
        let r = &s.rejected;
        let rejected = r.error + r.newton + r.singular + r.non_finite + r.event;
        let _ = writeln!(
            table,
            "{name}, {}: {}; {} + {}, {rejected}; {}, {}; {} + {}, {}; {}; {}",
            s.method,
            s.equations,
            s.accepted,
            s.pilot,
            s.evaluations,
            s.jacobians,
            s.factorisations,
            s.refactorisations,
            s.solves,
            s.iterations,
            s.events
        );
    }
    insta::assert_snapshot!(table);
}
