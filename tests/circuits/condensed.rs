//! Circuits whose unknowns follow from each other: a run with fewer of them gives what the whole one gives.

use bondspice::bond::elaborate::Overrides;
use bondspice::cli::run::{Run, prepare};
use bondspice::sim::{self, Interval, Settings, System};
use bondspice::source::SourceMap;
use bondspice::trace::Trace;
use std::path::Path;

fn prepared(name: &str, text: &str) -> Run {
    let mut map = SourceMap::default();
    let file = map.add(name, text);
    let mut d = vec![];
    prepare(&mut map, file, &Overrides::default(), None, &mut d).unwrap_or_else(|| panic!("{d:#?}"))
}

/// Values on a grid of 200 intervals.
fn course(run: &Run, system: &System) -> Trace {
    let settings = run.settings.as_ref().expect("a run over time");
    let rows = Interval::Grid(settings.stop / 200.0);
    let settings = Settings { rows, start: 0.0, ..settings.clone() };
    let mut trace = Trace::new(run.names.clone(), vec![]);
    sim::transient(system, &settings, &mut trace).unwrap_or_else(|f| panic!("{:#?}", f.diagnostic));
    trace
}

/// The whole circuit and the one with fewer unknowns.
fn systems(run: &Run) -> [System; 2] {
    let mut d = vec![];
    let made = [sim::compile(&run.stamps, &mut d), sim::compile_for_run(&run.stamps, &mut d)];
    made.map(|system| system.unwrap_or_else(|| panic!("{d:#?}")))
}

/// The largest difference of a column, as a part of its range.
fn difference(a: &Trace, b: &Trace) -> f64 {
    assert_eq!(a.rows(), b.rows());
    let mut worst = 0.0f64;
    for (a, b) in a.columns.iter().zip(&b.columns) {
        let range = a.iter().fold(f64::NEG_INFINITY, |most, x| most.max(*x))
            - a.iter().fold(f64::INFINITY, |least, x| least.min(*x));
        let most = a.iter().zip(b).fold(0.0f64, |most, (a, b)| most.max((a - b).abs()));
        worst = worst.max(if most == 0.0 { 0.0 } else { most / range });
    }
    worst
}

#[test]
fn shipped_netlists_run_alike_with_fewer_unknowns() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("netlists");
    let mut smaller = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_stem().unwrap().to_str().unwrap().to_string();
        // One takes long; another slides on so rough a belt that two runs of its whole circuit differ by as much.
        let skipped = ["half_wing", "rough_belt"].contains(&name.as_str());
        if path.extension().is_none_or(|e| e != "cir") || skipped {
            continue;
        }
        let run = prepared(&name, &std::fs::read_to_string(&path).unwrap());
        let [whole, small] = systems(&run);
        assert!(small.equations() <= whole.equations(), "{name}");
        assert_eq!(small.condensed, small.equations() < whole.equations(), "{name}");
        if !small.condensed {
            continue;
        }
        smaller += 1;
        // Steps of a tolerance of 1e-6 err by up to 4e-6 over these runs, and where something switches by 4e-5.
        let off = difference(&course(&run, &whole), &course(&run, &small));
        assert!(off < 1e-4, "{name}: {off:e}, {} for {}", small.equations(), whole.equations());
    }
    assert!(smaller >= 15, "{smaller}");
}

#[test]
fn tight_tolerances_are_met_with_fewer_unknowns() {
    // What follows must do so to rounding: a current of 1e-3 as a difference of efforts of 1e4 would end such a run.
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("netlists/eha_one_line.cir");
    let mut run = prepared("tight", &std::fs::read_to_string(path).unwrap());
    let settings = run.settings.as_mut().expect("a run over time");
    (settings.reltol, settings.stop) = (1e-10, 0.4);
    let [whole, small] = systems(&run);
    let off = difference(&course(&run, &whole), &course(&run, &small));
    assert!(off < 1e-8, "{off:e}");
}

/// A servo as chains of laws, gains and sources of 0 V; what is saved follows.
const SERVO: &str = "a servo\nVref ref 0 SIN(0 1 2)\nBe e 0 V=V(ref)-V(x)\nBu u 0 V=10*tanh(V(e)*3)\nEm m1 0 u 0 2\n\
                     Vi m1 m2 0\nRm m2 m3 0.5\nLm m3 m4 10m\nHb m4 0 Vx 0.3\nFt 0 w Vi 0.3\nVx w w2 0\nRw w2 0 2\n\
                     Cw w 0 20m\nGx 0 x w 0 1\nCx x 0 1\n.options reltol=1e-6\n.tran 1m 1 uic\n";

#[test]
fn what_follows_is_no_unknown_and_what_is_saved_is_one() {
    let few = prepared("few.cir", &format!("{SERVO}.save v(x)\n.end\n"));
    let [whole, small] = systems(&few);
    // The states x, w and the coil's current; the reference, of which a law speaks; the error, which no law may be put for.
    assert!(whole.equations() >= 18 && small.equations() <= 6, "{small}");
    let states = small.charges();
    assert_eq!(states, whole.charges());
    assert!(difference(&course(&few, &whole), &course(&few, &small)) < 4e-6);
    let more = prepared("more.cir", &format!("{SERVO}.save v(x) v(u) i(Vi)\n.end\n"));
    let [_, small_too] = systems(&more);
    assert!(small_too.equations() > small.equations(), "{small_too}");
    // What is saved besides changes nothing but steps.
    let trace = course(&more, &small_too);
    let first = Trace { columns: trace.columns[..2].to_vec(), ..course(&few, &small) };
    assert!(difference(&course(&few, &small), &first) < 4e-6);
    let (x, u) = (&trace.columns[1], &trace.columns[2]);
    for ((t, x), u) in trace.columns[0].iter().zip(x).zip(u) {
        let expected = 10.0 * (3.0 * ((4.0 * std::f64::consts::PI * t).sin() - x)).tanh();
        assert!((u - expected).abs() < 2e-5, "{u} for {expected} at {t}");
    }
}

#[test]
fn charges_with_laws_of_their_own_stand_behind_others() {
    // A linear capacitor first: the law of the second belongs to the second. Then a junction's.
    for stores in
        ["C2 b 0 Q={1u*V(b)+0.3u*V(b)*V(b)*V(b)}", "D1 b 0 DM\n.model DM D(Is=1e-14 Cjo=1u Rs=1)"]
    {
        let text = format!(
            "order\nV1 s 0 SIN(0 5 1k)\nB1 m 0 V={{2*tanh(V(s))}}\nR1 m a 100\nC1 a 0 1u\nR2 a b 100\n{stores}\n\
             R3 b 0 1k\n.options reltol=1e-7\n.save v(a) v(b)\n.tran 1u 3m uic\n.end\n"
        );
        let run = prepared("order.cir", &text);
        let [whole, small] = systems(&run);
        assert!(small.equations() < whole.equations());
        let off = difference(&course(&run, &whole), &course(&run, &small));
        assert!(off < 2e-6, "{stores}: {off:e}");
    }
}

#[test]
fn what_is_wrong_is_told_of_the_whole_circuit() {
    // Nothing gives v(p) once the table has ended; the node between would not be an unknown of the run.
    let text = "a\nI1 0 p PWL(0 0 1 10)\nVp p p2 0\nB1 p2 0 I={table(v(p2), -1, -1, 1, 1)}\nR1 a 0 1k\nC1 a 0 1u\n\
                B2 0 a I={1m*v(p2)^2}\n.save v(a)\n.tran 10m 1\n.end\n";
    let run = prepared("ends.cir", text);
    let mut trace = Trace::new(run.names.clone(), vec![]);
    let failure = run.go(&mut trace).expect_err("nothing takes up more than 1 A");
    let said = format!("{:?}", failure.diagnostic);
    assert!(said.contains("v(p2)") || said.contains("v(p)"), "{said}");
    assert!(trace.rows() > 1, "{said}");
    // Two sources in a loop are told as before.
    let text = "a\nV1 a 0 1\nV2 a b 0\nV3 b 0 1\nB1 c 0 V={tanh(v(b))}\nR1 c d 1k\nC1 d 0 1u\n.save v(d)\n.tran 1m 1\n.end\n";
    let mut map = SourceMap::default();
    let file = map.add("loop.cir", text);
    let mut d = vec![];
    assert!(prepare(&mut map, file, &Overrides::default(), None, &mut d).is_none());
    assert!(d.iter().any(|d| d.code == "E0781"), "{d:#?}");
}

/// A chopper into a filter; the gate is as given.
fn chopper(gate: &str, saved: &str) -> String {
    format!(
        "a chopper\nVin in 0 24\n{gate}\nS1 in sw g h SWM\nS2 0 sw h g SWN\nL1 sw out 100u ic=0\nC1 out 0 220u ic=0\n\
         Rl out 0 2.4\n.model SWM SW(Vt=2.5 Vh=0.1 Ron=10m Roff=1MEG)\n.model SWN SW(Vt=-2.5 Vh=0.1 Ron=10m Roff=1MEG)\n\
         .options reltol=1e-7\n.save v(out) i(L1) {saved}\n.tran 1u 1m uic\n.end\n"
    )
}

#[test]
fn switches_that_sources_drive_change_at_times_known_beforehand() {
    let ramps = "Vg g 0 PULSE(0 5 10u 1u 2u 20u 50u)\nVh h 0 0";
    let jumps = "Vg g 0 PULSE(0 5 10u 0 0 20u 50u)\nVh h 0 0";
    let sum = "Vg g m PULSE(0 5 10u 1u 2u 20u 50u)\nVm m 0 PWL(0 0 1m 1)\nVh h 0 PWL(0 -1 1m 0)";
    for (name, gate) in [("ramps", ramps), ("jumps", jumps), ("sum", sum)] {
        for saved in ["", "v(g)"] {
            let run = prepared(name, &chopper(gate, saved));
            let [whole, small] = systems(&run);
            let settings = run.settings.as_ref().expect("a run over time");
            let mut sink = bondspice::trace::Nowhere;
            let counted = |system| sim::transient(system, settings, &mut sink).expect("a run");
            let counts: Vec<_> = [&whole, &small].into_iter().map(counted).collect();
            // Twenty periods of two edges for two switches, and none of them searched for. That one is on to begin with is an
            // event where it is found.
            assert_eq!(counts[1].events, 80, "{name}");
            assert!((80..=81).contains(&counts[0].events), "{name}: {}", counts[0].events);
            assert!(counts[0].rejected.event > 0 || name == "jumps", "{name}");
            assert_eq!(counts[1].rejected.event, 0, "{name}");
            // Where nobody sees the gate, its corners end no step.
            assert_eq!(counts[1].corners == 0, saved.is_empty(), "{name}");
            let off = difference(&course(&run, &whole), &course(&run, &small));
            assert!(off < 1e-6, "{name} {saved}: {off:e}");
        }
    }
}

#[test]
fn a_pilot_pass_ends_when_all_magnitudes_are_known() {
    // At 1e-3 floors follow magnitudes up to 1 V and 1 µA, which the first period shows; guards are looked at to the end.
    let gate = "Vg g 0 PULSE(0 5 10u 1u 2u 20u 50u)\nVh h 0 0";
    let run = prepared("pilot", &chopper(gate, "").replace("reltol=1e-7", "reltol=1e-3"));
    let settings = run.settings.as_ref().expect("a run over time");
    let pilots = systems(&run).map(|system| {
        let counted = sim::transient(&system, settings, &mut bondspice::trace::Nowhere);
        counted.expect("a run").pilot
    });
    assert!(pilots[1] < 50 && pilots[0] > 200, "{pilots:?}");
}

#[test]
fn a_switch_that_is_driven_by_anything_else_is_watched() {
    // By a sine, through a resistance, by what the circuit does.
    for gate in [
        "Vg g 0 SIN(2.5 2.5 20k)\nVh h 0 0",
        "Vs s 0 PULSE(0 5 10u 1u 2u 20u 50u)\nRg s g 10\nCg g 0 1n\nVh h 0 0",
        "Eg g 0 out 0 0.3\nVh h 0 PULSE(0 -5 10u 1u 1u 20u 50u)",
    ] {
        let run = prepared("watched", &chopper(gate, ""));
        let [whole, small] = systems(&run);
        let settings = run.settings.as_ref().expect("a run over time");
        let counted =
            sim::transient(&small, settings, &mut bondspice::trace::Nowhere).expect("a run");
        assert!(counted.rejected.event > 0, "{gate}");
        let off = difference(&course(&run, &whole), &course(&run, &small));
        assert!(off < 1e-5, "{gate}: {off:e}");
    }
}

/// A network of `nodes` nodes behind a source, each tied to the one before: stores, laws and links as listed.
fn network(nodes: usize, parts: &[(u8, usize, usize)], saved: usize) -> String {
    let mut text = String::from("random\nV1 n0 0 SIN(0 3 800)\n");
    for k in 1..=nodes {
        text += &format!("R{k} n{} n{k} {}\nRg{k} n{k} 0 2k\n", k - 1, 100 + 30 * k);
    }
    let node = |k: usize| format!("n{}", 1 + k % nodes);
    for (i, (kind, a, b)) in parts.iter().enumerate() {
        let (a, b) = (node(*a), node(*b));
        text += &match kind % 6 {
            0 => format!("C{i} {a} 0 0.4u\n"),
            1 => format!("Cq{i} {a} 0 Q={{0.3u*V({a})+0.05u*V({a})*V({a})*V({a})}}\n"),
            2 => format!("D{i} {a} 0 DM\n"),
            // A law over a law, and a gain behind it.
            3 => format!(
                "Bu{i} u{i} 0 V={{2*tanh(V({a})-0.5*V({b}))}}\nEu{i} w{i} 0 u{i} 0 0.7\nRu{i} w{i} {b} 500\n"
            ),
            4 => format!("Bi{i} {a} 0 I={{1m*tanh(V({a})-V({b}))}}\n"),
            _ => format!(
                "L{i} {a} l{i} 20m\nVi{i} l{i} k{i} 0\nRl{i} k{i} 0 300\nFi{i} 0 {b} Vi{i} 0.2\n"
            ),
        };
    }
    text += ".model DM D(Is=1e-12 N=1.5 Cjo=0.1u Rs=5)\n.options reltol=1e-6\n";
    text + &format!(".save v({}) i(V1)\n.tran 1u 3m uic\n.end\n", node(saved))
}

proptest::proptest! {
    #![proptest_config(proptest::prelude::ProptestConfig { cases: 60, failure_persistence: None, ..Default::default() })]

    #[test]
    fn random_networks_run_alike_with_fewer_unknowns(
        nodes in 2usize..6,
        parts in proptest::collection::vec((0u8..6, 0usize..6, 0usize..6), 2..9),
        saved in 0usize..6,
    ) {
        let text = network(nodes, &parts, saved);
        let run = prepared("random.cir", &text);
        let [whole, small] = systems(&run);
        proptest::prop_assert!(small.equations() <= whole.equations());
        let off = difference(&course(&run, &whole), &course(&run, &small));
        proptest::prop_assert!(off < 1e-4, "{off:e}, {} for {}\n{text}", small.equations(), whole.equations());
    }
}
