//! Layers that nobody looks at are passed over in a step: what is looked at is as exact as before.

use super::exponential::{differences, prepared, run_with};
use bondspice::sim::Statistics;
use bondspice::trace::Trace;

/// A buck converter whose switch closes under a conducting diode, of which `saved` is looked at.
fn buck(saved: &str) -> String {
    format!(
        "a buck converter
Vin in 0 24
Vg g 0 PULSE(0 5 0 20n 20n 20u 50u)
S1 in sw g 0 SWM
D1 0 sw DM
L1 sw out 100u ic=4
Resr out c 20m
C1 c 0 220u ic=9.6
Rl out 0 2.4
.model SWM SW(Vt=2.5 Vh=0.1 Ron=10m Roff=1MEG)
.model DM D(Is=1e-9 N=1.05 Rs=5m Cjo=200p tt=10n)
.save {saved}
.tran 1u 2m 0 2u uic
.end
"
    )
}

/// Values of the first two columns every microsecond, and what they took.
fn on_a_grid(text: &str, reltol: f64) -> (Trace, Statistics) {
    let run = prepared(text);
    run_with(&run, |settings| {
        settings.reltol = reltol;
        settings.rows = bondspice::sim::Interval::Grid(1e-6);
    })
}

#[test]
fn a_diodes_recovery_that_nobody_sees_takes_one_step() {
    let (few, passed) = on_a_grid(&buck("v(out) i(L1)"), 1e-3);
    let (seen, resolved) = on_a_grid(&buck("v(out) i(L1) v(sw)"), 1e-3);
    let (exact, _) = on_a_grid(&buck("v(out) i(L1) v(sw)"), 1e-8);
    assert!(10 * passed.accepted < 7 * resolved.accepted, "{passed} {resolved}");
    assert!(2 * passed.iterations < resolved.iterations, "{passed} {resolved}");
    // Both are as exact as reltol says, over 40 periods and 2 corners in each: chosen beforehand.
    let two = |trace: &Trace| Trace { columns: trace.columns[..3].to_vec(), ..trace.clone() };
    for trace in [&few, &two(&seen)] {
        let off = differences(trace, &two(&exact));
        assert!(off.iter().all(|off| *off < 2e-3), "{off:?}");
    }
}

#[test]
fn a_diodes_recovery_that_is_looked_at_is_resolved() {
    let run = prepared(&buck("v(sw) i(Vin)"));
    let (trace, _) = run_with(&run, |settings| settings.reltol = 1e-3);
    // The charge of 10 ns times some amperes leaves through 15 mΩ at more than a thousand.
    let most = trace.columns[2].iter().fold(0.0f64, |most, i| most.max(i.abs()));
    assert!((1200.0..1700.0).contains(&most), "{most}");
}

/// A node with a negative conductance between two clamps, which a switch holds on its edge until it lets go: it falls to the
/// side that it is pushed to, as a comparator's latch does. Only a slow filter behind it is looked at.
fn latch(push: f64) -> String {
    format!(
        "a latch
Vin in 0 {push}
Rin in a 100k
Vg g 0 PULSE(5 0 1u 20n 20n 48u 100u)
S1 a 0 g 0 SWM
Ca a 0 1f
Ra a 0 1k
E1 b 0 a 0 3
Rb b a 1k
D1 a hi DM
Vhi hi 0 5
D2 lo a DM
Vlo lo 0 -5
E2 c 0 a 0 1
Rc c out 1k
Cc out 0 10n
.model SWM SW(Vt=2.5 Vh=0.1 Ron=1 Roff=1G)
.model DM D(Is=1e-12 N=1 Rs=10 Cjo=0.1f)
.save v(out)
.tran 1u 60u
.end
"
    )
}

#[test]
fn what_falls_to_one_side_is_not_passed_over() {
    for push in [1.0, -1.0] {
        let (trace, statistics) = on_a_grid(&latch(push), 1e-3);
        let (exact, _) = on_a_grid(&latch(push).replace("v(out)", "v(out) v(a)"), 1e-8);
        let first = Trace { columns: exact.columns[..2].to_vec(), ..exact.clone() };
        // It has fallen to the side that it was pushed to, and has been put back on its edge.
        let at = |k: usize| push * exact.columns[1][k];
        assert!(at(49) > 4.0 && at(60) < 2.5, "{} {}", at(49), at(60));
        let off = differences(&trace, &first);
        assert!(off[0] < 2e-3, "{push}: {off:?}, {statistics}");
    }
}
