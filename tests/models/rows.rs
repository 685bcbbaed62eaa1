//! The rows of a deck's run: at every accepted step, on both sides of jumps, and so many between that straight lines
//! stay within reltol of each column's range.

use bondspice::bond::elaborate::Overrides;
use bondspice::cli::pipeline;
use bondspice::trace::Trace;
use bondspice::trace::compare::{Settings, compare};

fn run(deck: &str, step: Option<&str>, reltol: &str) -> Trace {
    let mut overrides = Overrides { step: step.map(String::from), ..Overrides::default() };
    overrides.options.push(("reltol".into(), reltol.into()));
    match pipeline::run_text("deck.cir", deck, &overrides) {
        Ok((trace, _)) => trace,
        Err(said) => panic!("{said:#?}"),
    }
}

/// Decks with what bends: exponentials, oscillations, ramps, a rectifier, a switched source; the grid is dense.
const DECKS: &[(&str, &str, &str)] = &[
    (
        "exponential",
        "2us",
        "Vs in 0 1\nR1 in out 1k\nC1 out 0 1u IC=0\n.tran 10u 5m UIC\n.print tran v(out) i(Vs)",
    ),
    (
        "oscillation",
        "1us",
        "L1 a 0 25.3m IC=0\nC1 a 0 1u IC=1\nR1 a 0 10k\n.tran 10u 5m UIC\n.print tran v(a) i(L1) v(a)*v(a)",
    ),
    (
        "ramps",
        "2us",
        "Vp in 0 PULSE(0 5 1m 10u 20u 0.5m 2m)\nR1 in out 100\nC1 out 0 1u IC=0\n.tran 10u 6m UIC\n.print tran v(in) v(out) i(Vp)",
    ),
    (
        "rectifier",
        "5us",
        "Vs in 0 SIN(0 10 50)\nD1 in out d\nC1 out 0 10u IC=0\nR1 out 0 1k\n.model d d(is=1e-12)\n.tran 50u 40m UIC\n.print tran v(out) i(Vs)",
    ),
];

/// The lines between the rows against the same run on a grid; measured 0.2 to 0.9 of what is allowed.
#[test]
fn straight_lines_between_rows_are_within_reltol() {
    for (name, grid, cards) in DECKS {
        for reltol in [1e-3, 1e-5] {
            let deck = format!("{name}\n{cards}\n.end\n");
            let text = format!("{reltol:e}");
            let (rows, dense) = (run(&deck, None, &text), run(&deck, Some(grid), &text));
            assert!(dense.rows() > 1000, "{name}");
            // Rounding of the grid's times at steep places counts little.
            let settings = Settings { tolerance: 1.05 * reltol, ..Settings::default() };
            let found = compare(&rows, &dense, &settings);
            assert!(found.same(), "{name} at {reltol:e}, {} rows: {found:#?}", rows.rows());
            // As many rows as lines need, and not the grid's: an error of h² needs 10 times as many for 1e-2 of it.
            let most = if reltol == 1e-3 { 1000 } else { 10_000 };
            assert!(rows.rows() < most, "{name} at {reltol:e}: {} rows", rows.rows());
        }
    }
}

#[test]
fn jumps_have_a_row_on_both_sides() {
    let deck = "jumps\nB1 a 0 V=time > 1m ? 2 : 1\nR1 a b 1k\nC1 b 0 1u IC=1\n.tran 10u 2m UIC\n\
                .print tran v(a) v(b)\n.end\n";
    let trace = run(deck, None, "1e-4");
    let time = trace.time();
    let jumps: Vec<usize> = (1..time.len()).filter(|row| time[*row] == time[row - 1]).collect();
    assert_eq!(jumps.len(), 1, "{time:?}");
    let a = trace.column("v(a)").unwrap();
    assert_eq!((a[jumps[0] - 1], a[jumps[0]]), (1.0, 2.0));
    assert!((time[jumps[0]] - 1e-3).abs() < 1e-12);
    // On a grid a row at a jump holds the value after it.
    let grid = run(deck, Some("1ms"), "1e-4");
    assert_eq!(grid.time(), [0.0, 1e-3, 2e-3]);
    assert_eq!(grid.column("v(a)").unwrap(), [1.0, 2.0, 2.0]);
}

/// Items in their order, as written; without any, every node voltage and branch current.
#[test]
fn columns_are_those_of_print_and_save() {
    let cards = "R1 a b 1k\nV1 a 0 1\nC1 b 0 1u\n.tran 1u 1m\n";
    let named = run(
        &format!("x\n{cards}.save v(b)\n.print tran i(V1) V(A,B) {{v(b)*2}}\n.end\n"),
        None,
        "1e-3",
    );
    assert_eq!(named.names, ["time", "v(b)", "i(V1)", "V(A,B)", "{v(b)*2}"]);
    let all = run(&format!("x\n{cards}.end\n"), None, "1e-3");
    assert_eq!(all.names, ["time", "v(a)", "v(b)", "i(v1)"]);
}
