//! Runs abreast give, to the last bit, what each gives alone.

use super::exponential::run_with;
use bondspice::bond::elaborate::Overrides;
use bondspice::cli::run::{Run, prepare};
use bondspice::quantity::random;
use bondspice::sim::{Group, Interval, Seat, Statistics};
use bondspice::source::SourceMap;
use bondspice::trace::Trace;

/// A servo with limits, a square law and a root: smooth laws, steps at the limit, TR-BDF2, trapezoidal rule, Gear.
const SERVO: &str = "a servo\nVref ref 0 PULSE(0 {a} 1m 1m 1m 40m 100m)\nBe e 0 V=tanh(V(ref)-V(x))*5\nRe e u {r}\n\
    Cu u 0 1u\nBp p 0 V=V(u)*abs(V(u))/(1+{b}*V(x)*V(x))\nRp p y 100\nCy y 0 10u\nBx 0 x I=1e-3*sqrt(V(y)*V(y)+1e-4)-1e-3*V(x)\n\
    Cx x 0 20u\nBq qx 0 V=V(x)*V(u)\nRq qx z 1k\nCz z 0 1u\nRl z k 1k\nCk k 0 2u\nRm k l 1k\nCl l 0 3u\n.save v(x) v(z) v(l)\n";
/// A rectifier behind a switch: junctions, and a law that is affine for fixed modes.
const RECTIFIER: &str = "a rectifier\nVs s 0 SIN(0 {a} 1k)\nRs s in 1\nD1 in out DM\nD2 0 in DN\nC1 out 0 {b}u\nRl out 0 {r}\n\
    S1 out load out 0 SW\nRload load 0 500\nCload load 0 1u\n.model DM D(Is=1e-12 N=1.2 Cjo=20p)\n.model DN D(Is=1e-12 N=1.2)\n\
    .model SW SW(Vt=3 Vh=0.5 Ron=1 Roff=1MEG)\n.save v(out) v(load)\n";
/// Charges that are not linear, a delay, and friction with two sides.
const MIXED: &str = "all sorts\nVs s 0 SIN(0 {a} 2k)\nRs s in 10\nC1 in 0 Q={1u*v(in)+0.1u*v(in)*v(in)*v(in)}\nT1 in 0 far 0 Z0=50 TD=20u\n\
    Rfar far 0 {r}\nB1 in mid I={1e-3*tanh({b}*v(in,mid))}\nC2 mid 0 1u\nB2 mid 0 I={if(v(mid)>0.2,2e-3,1e-3)*v(mid)}\n\
    L1 mid end 1m\nRe end 0 10\n.save v(in) v(far) i(l1)\n";
/// One unknown: the smallest matrices.
const SMALL: &str = "small\nV1 in 0 PULSE(0 {a} 0 10u 10u 1m 3m)\nR1 in out {r}\nB1 out 0 I={1e-3*v(out)^3*{b}}\nC1 out 0 1u\n.save v(out)\n";
/// Linear, which has no part in it.
const LINEAR: &str =
    "linear\nV1 in 0 PULSE(0 {a} 0 10u 10u 1m 3m)\nR1 in out {r}\nC1 out 0 {b}u\n.save v(out)\n";

/// Run `k` of a circuit, whose values are within 1 to 3; some have a value that changes what the circuit is.
fn prepared(circuit: &str, card: &str, k: u64) -> Run {
    let value = |of: u64| 1.0 + 2.0 * random::fraction(of, k);
    let b = if k % 7 == 3 { 0.0 } else { value(2) };
    let text = circuit
        .replace("{a}", &(3.0 * value(0)).to_string())
        .replace("{r}", &(500.0 * value(1)).to_string())
        .replace("{b}u", &format!("{}u", value(2)))
        .replace("{b}", &b.to_string());
    let mut map = SourceMap::default();
    let file = map.add("deck.cir", format!("{text}{card}\n"));
    let mut d = vec![];
    let run = prepare(&mut map, file, &Overrides::default(), None, &mut d);
    run.unwrap_or_else(|| panic!("{d:#?}"))
}

/// Rows, steps and work of a run, or how far it came.
type Outcome = (Vec<Vec<u64>>, Result<Statistics, String>);

fn outcome(trace: &Trace, result: Result<Statistics, String>) -> Outcome {
    let bits = |column: &Vec<f64>| column.iter().map(|x| x.to_bits()).collect();
    (trace.columns.iter().map(bits).collect(), result)
}

fn alone(run: &Run) -> Outcome {
    let mut trace = run.trace();
    let result = run.go(&mut trace).map_err(|failure| failure.diagnostic.message.clone());
    outcome(&trace, result)
}

async fn beside(run: Run, seat: Seat<'_>) -> Outcome {
    let mut trace = run.trace();
    let (result, _) = run.go_beside(&mut trace, seat).await;
    outcome(&trace, result.map_err(|failure| failure.diagnostic.message.clone()))
}

/// Makes runs so many at a time, of one circuit after another. Gives the number of passes too.
fn abreast(circuits: &[&str], card: &str, runs: u64, width: usize) -> (Vec<Outcome>, u64) {
    let mut outcomes: Vec<Option<Outcome>> = (0..runs).map(|_| None).collect();
    let mut next = 0..runs;
    let begin = |seat| {
        let k = next.next()?;
        let run = prepared(circuits[k as usize % circuits.len()], card, k);
        Some(async move { (k, beside(run, seat).await) })
    };
    let group = Group::default();
    group.run(width, begin, |(k, outcome)| {
        outcomes[k as usize] = Some(outcome);
        true
    });
    let outcomes = outcomes.into_iter().map(|outcome| outcome.expect("every run ends"));
    (outcomes.collect(), group.passes())
}

fn compare(circuits: &[&str], card: &str, runs: u64) {
    let single: Vec<Outcome> = (0..runs)
        .map(|k| alone(&prepared(circuits[k as usize % circuits.len()], card, k)))
        .collect();
    let solves: u64 = single.iter().flat_map(|(_, result)| result).map(|taken| taken.solves).sum();
    for width in [1, 2, 4] {
        let (outcomes, passes) = abreast(circuits, card, runs, width);
        for (k, (own, alone)) in outcomes.iter().zip(&single).enumerate() {
            assert_eq!(own.1, alone.1, "run {k}, {width} at a time:\n{}{card}", circuits[0]);
            assert!(own.0 == alone.0, "rows of run {k}, {width} at a time:\n{}{card}", circuits[0]);
        }
        // Alone none waits; of smooth equations most of the work is done in passes, for almost as many runs as there are places.
        if width == 1 || circuits == [LINEAR] {
            assert_eq!(passes, 0);
        }
        if circuits == [SERVO] && width > 1 {
            let least = 3 * solves / (4 * width as u64);
            assert!(
                passes * 4 > least && passes <= solves / width as u64 * 5 / 4,
                "{passes} passes for {solves} solutions, {width} at a time"
            );
        }
    }
}

#[test]
fn sixty_four_runs_abreast_are_sixty_four_alone() {
    compare(&[SERVO], ".tran 0.2m 60m 0 0.2m uic", 64);
}

#[test]
fn runs_of_every_kind_are_what_they_are_alone() {
    for method in ["auto", "trbdf2", "trap", "gear"] {
        let card = format!(".tran 20u 8m 0 20u uic\n.options method={method}");
        for circuit in [SERVO, RECTIFIER, MIXED, SMALL, LINEAR] {
            compare(&[circuit], &card, 10);
        }
    }
}

#[test]
fn runs_of_several_circuits_at_once_are_what_they_are_alone() {
    compare(&[SERVO, RECTIFIER, SERVO, SMALL, MIXED], ".tran 50u 6m 0 50u uic", 25);
}

#[test]
fn a_run_that_fails_takes_nobody_with_it() {
    // A power of a negative value is that of its magnitude: where the charge folds back, the solution ends, unless the source
    // does not reach that far.
    let folded = MIXED.replace("v(in)*v(in)*v(in)", "v(in)^3").replace("{a}", "{{a}/3}");
    let card = ".tran 50u 3m 0 50u uic";
    let outcomes: Vec<Outcome> = (0..12).map(|k| alone(&prepared(&folded, card, k))).collect();
    let failed = outcomes.iter().filter(|outcome| outcome.1.is_err()).count();
    assert!((2..11).contains(&failed), "{failed}");
    compare(&[&folded], card, 12);
}

#[test]
fn rows_made_several_at_once_are_what_each_is_alone() {
    // Columns that follow from others by laws, in steps longer than rows are apart.
    let circuit = SERVO.replace(".save v(x) v(z) v(l)", ".save v(e) v(p) v(qx) v(x)");
    let run = prepared(&circuit, ".tran 0.1m 60m 0 5m uic\n.options method=rodas5p reltol=1e-4", 2);
    let rows = |interval: Interval| run_with(&run, |settings| settings.rows = interval);
    let (grid, statistics) = rows(Interval::Grid(1e-4));
    assert!(6 * statistics.accepted < grid.rows() as u64, "{statistics}");
    for at in (3..grid.rows() - 1).step_by(37) {
        let (single, _) = rows(Interval::Times(vec![grid.columns[0][at]]));
        for (all, one) in grid.columns.iter().zip(&single.columns) {
            assert_eq!(all[at].to_bits(), one[0].to_bits(), "at {}", grid.columns[0][at]);
        }
    }
}

#[test]
fn whoever_stops_stops_all() {
    let mut taken = 0;
    let begin = |seat| Some(beside(prepared(SMALL, ".tran 20u 2m 0 20u uic", 1), seat));
    Group::default().run(4, begin, |_| {
        taken += 1;
        taken < 3
    });
    assert_eq!(taken, 3);
}
