//! What decks written for Xyce mean that others do not: values of devices in outputs, terminals of instances, rows at jumps,
//! smoothed laws, and rows between steps where junctions bend the solution. All against closed forms or against ngspice.

use bondspice::bond::elaborate::Overrides;
use bondspice::cli::pipeline::{self, Run};
use bondspice::source::SourceMap;
use bondspice::trace::Trace;
use std::process::Command;

/// Runs a deck in a dialect, with rows at these times.
fn run_with(text: &str, dialect: &str, times: &[f64], options: &[(&str, &str)]) -> Trace {
    let mut map = SourceMap::default();
    let file = map.add("deck.cir", text);
    let options = options.iter().map(|(key, value)| (key.to_string(), value.to_string()));
    let overrides = Overrides {
        dialect: Some(dialect.into()),
        options: options.collect(),
        ..Overrides::default()
    };
    let mut d = vec![];
    let run = pipeline::prepare(&mut map, file, &overrides, None, &mut d);
    let mut run: Run = run.unwrap_or_else(|| panic!("{d:#?}"));
    if !times.is_empty() {
        run.settings.as_mut().unwrap().rows = bondspice::sim::Interval::Times(times.to_vec());
    }
    let mut trace = run.trace();
    run.go(&mut trace).unwrap();
    trace
}

fn run(text: &str, times: &[f64]) -> Trace {
    run_with(text, "xyce", times, &[])
}

fn column<'t>(trace: &'t Trace, name: &str) -> &'t [f64] {
    let k = trace.names.iter().position(|own| own == name);
    &trace.columns[k.unwrap_or_else(|| panic!("{name} in {:?}", trace.names))]
}

fn close(found: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(found.len(), expected.len(), "{found:?}");
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() <= tolerance, "{found} against {expected}");
    }
}

#[test]
fn values_of_devices_are_printed() {
    let deck = "values\n.param k=2\nv1 1 0 4\nr1 1 2 {k} temp=37 tc=0.1\nr2 2 0 r={1+k*v(1)} m=3\nc1 2 0 2u\nx1 1 0 half r=5\n\
                .subckt half a b r=1\nr1 a b {2*r}\n.ends\n.dc v1 4 4 1\n\
                .print dc r1 {r1*2} r1:r r1:temp r2:r r2:m c1:c v1 v1:dcv0 x1:r1 {x1:r1:r} r2:temp {exp} {x1:r1/i(v1)}\n.end\n";
    let trace = run(deck, &[]);
    // r1 at 37 °C has 2·(1 + 0.1·10) Ω, r2 9/3 Ω: 4 V over 7 Ω, and x1 with 10 Ω besides.
    let current = -4.0 / 7.0 - 0.4;
    let values: Vec<f64> = trace.columns.iter().map(|column| column[0]).collect();
    let expected = [
        4.0,
        2.0,
        4.0,
        2.0,
        37.0,
        9.0,
        3.0,
        2e-6,
        4.0,
        4.0,
        10.0,
        10.0,
        27.0,
        std::f64::consts::E,
        10.0 / current,
    ];
    close(&values, &expected, 1e-12);
}

#[test]
fn the_capacitance_of_a_junction_is_printed() {
    let deck = "capacitance\nv1 1 0 -3\nd1 1 0 dm\n.model dm d(is=1e-15 cjo=2p vj=0.8 m=0.4)\n.dc v1 -3 0 1.5\n\
                .print dc n(d1:cd)\n.end\n";
    let trace = run(deck, &[]);
    let expected = [-3.0f64, -1.5, 0.0].map(|v| 2e-12 / (1.0 - v / 0.8).powf(0.4));
    close(column(&trace, "n(d1:cd)"), &expected, 1e-24);
}

#[test]
fn terminals_of_instances_are_nodes() {
    let deck = "terminals\nv1 in 0 6\nx1 in 0 outer\n.subckt outer p m\nr1 p q 1\nx2 q m inner\n.ends\n.subckt inner a b\n\
                r1 a b 2\n.ends\n.dc v1 6 6 1\n.print dc v(x1:p) v(x1:x2:a) {v(x1:q,x1:x2:b)}\n.end\n";
    let trace = run(deck, &[]);
    let values: Vec<f64> = trace.columns[1..].iter().map(|column| column[0]).collect();
    close(&values, &[6.0, 4.0, 4.0], 1e-12);
}

#[test]
fn parameters_of_a_card_speak_of_each_other_and_win() {
    let deck = "parameters\nv1 1 0 1\nx1 1 0 s p=2 q={p+1}\n.subckt s a b p=7 q=8\n.param q=1000\nr1 a b {q*p}\n.ends\n\
                .dc v1 1 1 1\n.print dc x1:r1:r\n.end\n";
    close(column(&run(deck, &[]), "x1:r1:r"), &[6.0], 0.0);
}

#[test]
fn rows_at_jumps_hold_what_the_simulator_would_write() {
    // A ramp of current through an inductor from 0 to 1 ms: its voltage is 10 V, from 0 on and until 1 ms.
    let deck =
        "jumps\ni1 0 1 pwl(0 0 1m 1)\nl1 1 0 10m\n.tran 1u 2m\n.print tran v(1) i(l1)\n.end\n";
    let times = [0.0, 0.5e-3, 1e-3, 1.5e-3];
    let before = run(deck, &times);
    close(column(&before, "v(1)"), &[0.0, 10.0, 10.0, 0.0], 1e-6);
    let after = run_with(deck, "xyce", &times, &[("jumps", "after")]);
    close(column(&after, "v(1)"), &[10.0, 10.0, 0.0, 0.0], 1e-6);
    let ours = run_with(deck, "ngspice", &times, &[]);
    close(column(&ours, "v(1)"), &[10.0, 10.0, 0.0, 0.0], 1e-6);
    // With stated values nothing is solved at 0: only what is stored is there.
    let deck = "stated\nl1 1 0 10m ic=2\nr1 1 0 5\n.tran 1u 2m uic\n.print tran v(1) i(l1)\n.end\n";
    let stated = run(deck, &[0.0, 2e-3]);
    let decay = (-1.0f64).exp();
    close(column(&stated, "v(1)"), &[0.0, -10.0 * decay], 1e-3);
    close(column(&stated, "i(l1)"), &[2.0, 2.0 * decay], 2e-4);
}

#[test]
fn laws_are_followed_with_a_time_constant() {
    // A jump of the law from 0 to 1 at 1 µs, followed with 10 ns.
    let deck = "smooth\n.options device smoothbsrc=1 rcconst=1e-8\nb1 1 0 v={if(time>1u,1,0)}\nr1 1 0 1\n\
                .options timeint reltol=1e-6\n.tran 1n 1.1u\n.print tran v(1)\n.end\n";
    let times = [0.9e-6, 1.005e-6, 1.01e-6, 1.03e-6];
    let expected =
        times.map(|t: f64| if t > 1e-6 { 1.0 - (-(t - 1e-6) / 1e-8).exp() } else { 0.0 });
    close(column(&run(deck, &times), "v(1)"), &expected, 1e-5);
}

#[test]
fn polynomials_are_expressions_and_tables_need_no_braces() {
    let deck = "forms\n.param c=2\n.func p(x) {POLY(1) x c 3 {c*c}}\nv1 1 0 2 distof1 1 distof2 2 90\nb1 2 0 v={p(v(1))}\nr2 2 0 1\n\
                g1 0 3 table v(1,0) = (-1,-3) (1,3) (3,4)\nr3 3 0 1\nr4 1 4 1e-40\nr5 4 0 4\n.dc v1 2 2 1\n\
                .print dc v(2) v(3) i(r4)\n.end\n";
    let trace = run(deck, &[]);
    let values: Vec<f64> = trace.columns[1..].iter().map(|column| column[0]).collect();
    close(&values, &[2.0 + 6.0 + 16.0, 3.5, 0.5], 1e-12);
}

#[test]
fn a_law_without_a_value_at_the_first_guess_has_one_at_the_solution() {
    let deck = "domains\nv1 1 0 2\nb1 2 0 v={acosh(v(1))}\nr2 2 0 1\nb2 3 0 v={ln(v(1))/v(1)}\nr3 3 0 1\n.op\n.print op v(2) v(3)\n.end\n";
    let trace = run(deck, &[]);
    let values: Vec<f64> = trace.columns.iter().map(|column| column[0]).collect();
    close(&values, &[2f64.acosh(), 2f64.ln() / 2.0], 1e-12);
}

/// A clipper whose diodes turn on and off within long steps: the rows between must lie on the solution, too. Measured
/// against ngspice with steps of 1 µs at 1e-6; within 2e-3 of the range at reltol 1e-4.
#[test]
fn rows_between_steps_follow_junctions() {
    if !crate::peers::has("ngspice") {
        return;
    }
    let body = "vcc 1 0 5\nvin 3 0 sin(0 10 1k)\nd1 2 1 dm\nd2 0 2 dm\nr1 2 3 1k\nr2 1 2 3.3k\nr3 2 0 3.3k\nr4 4 0 5.6k\nc1 2 4 0.47u\n\
                .model dm d(is=4e-10 rs=.105 n=1.48 tt=8e-7 cjo=1.95e-11 vj=.4 m=.38 fc=.9 bv=600 ibv=1e-4)\n";
    let times: Vec<f64> = (0..400).map(|k| 5e-6 * f64::from(k) + 1.7e-6).collect();
    let deck = format!("clipper\n{body}.tran 2n 2.1m\n.print tran v(2) v(4)\n.end\n");
    let ours = run(&deck, &times);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("clipper.cir");
    let raw = folder.path().join("clipper.raw");
    let theirs = format!(
        "clipper\n{body}.options reltol=1e-6 vntol=1e-9 abstol=1e-13\n.tran 1u 2.1m 0 1u\n.save v(2) v(4)\n.end\n"
    );
    std::fs::write(&path, theirs).unwrap();
    Command::new("ngspice").args(["-b", "-r"]).arg(&raw).arg(&path).output().unwrap();
    let bytes = std::fs::read(&raw).unwrap();
    let peer = bondspice::trace::formats::read("clipper.raw", &bytes).unwrap();
    let time = column(&peer, "time");
    for name in ["v(2)", "v(4)"] {
        let values = column(&peer, name);
        let low = values.iter().copied().fold(f64::INFINITY, f64::min);
        let range = values.iter().copied().fold(f64::NEG_INFINITY, f64::max) - low;
        for (t, found) in times.iter().zip(column(&ours, name)) {
            let k = time.partition_point(|other| other < t).clamp(1, time.len() - 1);
            let part = (t - time[k - 1]) / (time[k] - time[k - 1]);
            let expected = values[k - 1] + part * (values[k] - values[k - 1]);
            assert!((found - expected).abs() < 2e-3 * range, "{name} at {t}: {found}, {expected}");
        }
    }
}
