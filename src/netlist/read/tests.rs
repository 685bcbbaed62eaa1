//! Reading: every device and card, errors at their places, garbage.

use super::*;
use crate::expr::Node;
use crate::netlist::analysis::Print;
use crate::netlist::{Device, Element, Expr, Leaf, Shape, Waveform};
use proptest::prelude::*;

fn read_text(text: &str) -> (Netlist, Vec<Diagnostic>) {
    let mut map = SourceMap::default();
    let file = map.add("deck.cir", text);
    let mut d = vec![];
    let netlist = read(&mut map, file, &How::default(), &mut d);
    (netlist, d)
}

/// A deck of one line after the title, without diagnostics.
fn clean(line: &str) -> (Netlist, CardKind) {
    let (netlist, d) = read_text(&format!("title\n{line}\n"));
    assert!(d.is_empty(), "{line}: {d:?}");
    let kind = netlist.cards[0].kind.clone();
    (netlist, kind)
}

fn device(line: &str) -> (Netlist, Device) {
    match clean(line) {
        (netlist, CardKind::Device(device)) => (netlist, device),
        (_, other) => panic!("{other:?}"),
    }
}

fn number(expr: &Expr) -> f64 {
    expr.as_number().unwrap_or_else(|| panic!("{expr:?}"))
}

#[test]
fn passive_devices() {
    let (netlist, r) = device("Rload a GND 4.7k ; a comment");
    assert_eq!(netlist.names.text(r.name), "Rload");
    assert_eq!(r.nodes.iter().map(|n| netlist.names.text(*n)).collect::<Vec<_>>(), ["a", "0"]);
    assert_eq!(netlist.cards[0].comment.as_deref(), Some("a comment"));
    assert!(matches!(&r.element, Element::Resistor { value } if number(value) == 4700.0));
    for line in
        ["c1 a b 1u ic=2", "C1 (a b) C=1u IC = 2", "c1 a,b ic=2 c={1e-6}", "c1 a b 1u\n+ ic=2"]
    {
        let (_, c) = device(line);
        let Element::Capacitor { value, initial: Some(initial) } = &c.element else {
            panic!("{c:?}")
        };
        assert_eq!((number(value), number(initial)), (1e-6, 2.0), "{line}");
    }
    let (_, l) = device("L1 a b 1m");
    assert!(
        matches!(&l.element, Element::Inductor { value, initial: None } if number(value) == 1e-3)
    );
    let (netlist, k) = device("K1 L1 L2 0.5");
    let Element::Mutual { inductors, coupling } = &k.element else { panic!() };
    assert_eq!(
        (inductors.len(), number(coupling), netlist.names.text(inductors[1])),
        (2, 0.5, "L2")
    );
    let (netlist, r) = device("r1 a b {2*x}");
    let Element::Resistor { value } = &r.element else { panic!() };
    value.leaves(&mut |leaf, _| {
        assert_eq!(*leaf, Leaf::Parameter(netlist.names.find("X").unwrap()))
    });
}

#[test]
fn sources_and_their_waveforms() {
    for line in
        ["V1 a 0 5", "V1 a 0 DC 5", "V1 a 0 dc=5 AC 1 90", "V1 a 0 ac 1 5k dc {5}", "i1 a 0 5 ac"]
    {
        let (_, v) = device(line);
        let (Element::VoltageSource(w) | Element::CurrentSource(w)) = &v.element else { panic!() };
        assert!(matches!(&w.waveform, Waveform::Constant(value) if number(value) == 5.0), "{line}");
    }
    for (line, shape, count) in [
        ("V1 a 0 PULSE(0 5 0 20n 20n 20u 50u)", Shape::Pulse, 7),
        ("V1 a 0 DC 0 pulse 0 5 {td}", Shape::Pulse, 3),
        ("V1 a 0 SIN (0, 1, 50)", Shape::Sin, 3),
        ("I1 a 0 PWL(0 0 1 1\n+ 2 0)", Shape::Pwl, 6),
        ("I1 a 0 PWL((0,0) (1,1))", Shape::Pwl, 4),
        ("I1 a 0 EXP(0 1 1u 2u 3u 4u)", Shape::Exp, 6),
        ("I1 a 0 SFFM(0 1 1k 2 100) ac 1", Shape::Sffm, 5),
    ] {
        let (_, v) = device(line);
        let (Element::VoltageSource(w) | Element::CurrentSource(w)) = &v.element else { panic!() };
        let Waveform::Function { shape: read, arguments } = &w.waveform else {
            panic!("{line}: {w:?}")
        };
        assert_eq!((*read, arguments.len()), (shape, count), "{line}");
    }
    let (_, v) = device("V1 a b");
    assert!(
        matches!(&v.element, Element::VoltageSource(source) if matches!(&source.waveform, Waveform::Constant(value) if number(value) == 0.0))
    );
}

#[test]
fn linked_and_behavioural_sources() {
    let (netlist, e) = device("E1 a 0 (c,d) 5");
    let Element::Vcvs { gain, control } = &e.element else { panic!("{e:?}") };
    assert_eq!((number(gain), netlist.names.text(control[1])), (5.0, "d"));
    assert!(matches!(device("G1 a 0 c gnd 1m").1.element, Element::Vccs { .. }));
    assert!(matches!(device("F1 a 0 V1 2").1.element, Element::Cccs { .. }));
    assert!(matches!(device("H1 a 0 V1 2").1.element, Element::Ccvs { .. }));
    for line in [
        "B1 a 0 V=v(c)*2",
        "B1 a 0 V = {v(c)*2}",
        "b1 a 0 v='v(c) * 2'",
        "E1 a 0 VALUE={v(c)*2}",
        "E1 a 0 value {v(c)*2}",
        "E1 a 0 vol='v(c)*2'",
    ] {
        let (netlist, b) = device(line);
        let Element::BehaviouralVoltage { law } = &b.element else { panic!("{line}: {b:?}") };
        let c = netlist.names.find("c").unwrap();
        let value =
            law.evaluate(&mut |leaf| if *leaf == Leaf::Voltage(c, None) { 21.0 } else { f64::NAN });
        assert_eq!(value, 42.0, "{line}");
    }
    for line in ["B1 a 0 I={i(V1)}*{x}", "G1 a 0 VALUE={i(V1)*x}", "G1 a 0 cur='i(V1)*x'"] {
        assert!(matches!(device(line).1.element, Element::BehaviouralCurrent { .. }), "{line}");
    }
    let (_, e) = device("E1 a 0 TABLE {v(c)} = (0,1) (2,3)");
    let Element::BehaviouralVoltage { law } = &e.element else { panic!() };
    assert_eq!(law.evaluate(&mut |_| 1.0), 2.0);
    // A node may be called so.
    assert!(matches!(device("E1 a 0 value table 2").1.element, Element::Vcvs { .. }));
}

#[test]
fn switches_diodes_instances() {
    let (_, s) = device("S1 a b c 0 SWM on");
    assert!(matches!(s.element, Element::Switch { on: Some(true), .. }));
    let (_, w) = device("W1 a b V1 SWM");
    assert!(matches!(w.element, Element::CurrentSwitch { on: None, .. }));
    let (_, d) = device("D1 a b DM 2 OFF");
    assert!(matches!(&d.element, Element::Diode { area: Some(area), .. } if number(area) == 2.0));
    for line in [
        "X1 a b c sub r=1k x={y}",
        "X1 a b c sub PARAMS: r=1k x={y}",
        "X1 (a b c) sub\n+ r = 1k x={y}",
    ] {
        let (netlist, x) = device(line);
        let Element::Instance { subcircuit, parameters } = &x.element else { panic!() };
        assert_eq!(netlist.names.text(*subcircuit), "sub", "{line}");
        assert_eq!((x.nodes.len(), parameters.len()), (3, 2), "{line}");
        assert_eq!(number(&parameters[0].1), 1000.0);
    }
}

#[test]
fn cards_with_a_dot() {
    let (netlist, kind) = clean(".param a=1k b = {a*2} c='a + b' d=a * (b + 1), e=1");
    let CardKind::Parameters(parameters) = kind else { panic!() };
    let names: Vec<_> = parameters.iter().map(|(name, _)| netlist.names.text(*name)).collect();
    assert_eq!(names, ["a", "b", "c", "d", "e"]);
    assert_eq!(parameters[3].1.evaluate(&mut |_| 3.0), 12.0);

    for line in [
        ".model DM D(Is=1e-9 N=1.05 Rs=5m)",
        ".model dm d is=1e-9 n=1.05 rs={0.005}",
        ".MODEL DM D ( IS = 1n , N=1.05 RS=5m )",
    ] {
        let (_, CardKind::Model { kind, parameters, .. }) = clean(line) else { panic!() };
        assert_eq!(
            (kind.as_str(), parameters.len(), parameters[0].0.as_str()),
            ("d", 3, "is"),
            "{line}"
        );
        assert_eq!(number(&parameters[2].1), 5e-3);
    }
    let (_, CardKind::Options(options)) = clean(".options reltol=1m method=GEAR noacct") else {
        panic!()
    };
    let options: Vec<_> = options.iter().map(|(k, v)| (k.as_str(), v.as_str())).collect();
    assert_eq!(options, [("reltol", "0.001"), ("method", "gear"), ("noacct", "1")]);

    let (_, CardKind::Initial(values)) = clean(".ic v(a)=1 V( b ) = {2*3}") else { panic!() };
    assert_eq!(values.len(), 2);

    let (_, CardKind::Transient { step, stop, start, hmax, uic }) = clean(".tran 1u 20m 0 2u UIC")
    else {
        panic!()
    };
    assert_eq!(
        (number(&step), number(&stop), number(&start.unwrap()), number(&hmax.unwrap()), uic),
        (1e-6, 20e-3, 0.0, 2e-6, true)
    );
    let (_, CardKind::Transient { start, uic, .. }) = clean(".tran 1u 20m uic") else { panic!() };
    assert!(start.is_none() && uic);

    let (_, CardKind::Save { of, items }) =
        clean(".save v(x_0) out I(L1) v(a, b) {v(a)*i(r1)} v1#branch @r1[i]")
    else {
        panic!()
    };
    let written: Vec<_> = items.iter().map(|(text, _)| text.as_str()).collect();
    assert_eq!(written, ["v(x_0)", "out", "I(L1)", "v(a,b)", "{v(a)*i(r1)}", "i(v1)", "i(r1)"]);
    assert_eq!(of, Print::Any);
    let (_, CardKind::Save { of, items }) = clean(".print tran all") else { panic!() };
    assert!(of == Print::Transient && items.is_empty());
    assert!(matches!(clean(".op").1, CardKind::OperatingPoint));
    let (_, CardKind::Comment(text)) = clean("* a comment ") else { panic!() };
    assert_eq!(text, " a comment");
}

#[test]
fn subcircuits_nest() {
    let text = "t\n.subckt outer a b params: r=1k\nr1 a b {r}\n.subckt inner c\nr2 c 0 1\n.ends inner\nx1 a inner\n.ends\nx2 p q outer r=2\n.end\nrubbish after the end";
    let (netlist, d) = read_text(text);
    assert!(d.is_empty(), "{d:?}");
    let CardKind::Subcircuit(outer) = &netlist.cards[0].kind else { panic!() };
    assert_eq!((outer.ports.len(), outer.parameters.len(), outer.cards.len()), (2, 1, 3));
    assert!(matches!(&outer.cards[1].kind, CardKind::Subcircuit(inner) if inner.cards.len() == 1));
    assert_eq!(netlist.cards.len(), 2);
}

#[test]
fn the_header_is_kept_apart() {
    let text = "t\n*bondspice hmax=auto\n*bondspice column=[\"a b\",\n*bondspice+  \"bar\",\"v(a)\"]\n* other\n";
    let (netlist, d) = read_text(text);
    assert!(d.is_empty());
    let pairs: Vec<_> = netlist.header.iter().map(|(k, v)| (k.as_str(), v.as_str())).collect();
    assert_eq!(pairs, [("hmax", "auto"), ("column", "[\"a b\", \"bar\",\"v(a)\"]")]);
    assert_eq!(netlist.cards.len(), 1);
    assert_eq!(netlist.title, "t");
}

#[test]
fn seldom_meant_suffixes_are_warned_of() {
    for (text, fixed) in [
        ("r1 a b 1M", "r1 a b 1m"),
        ("c1 a b 2.5F", "c1 a b 2.5f"),
        ("i1 a b 3A", "i1 a b 3a"),
        ("b1 a b v=v(c)*1M", "b1 a b v=v(c)*1m"),
    ] {
        let (_, d) = read_text(&format!("t\n{text}\n"));
        assert_eq!(d[0].code, "W0701", "{text}");
        let fix = d[0].fix.as_ref().unwrap();
        let (span, new) = &fix.edits[0];
        let mut mended = format!("t\n{text}\n");
        mended.replace_range(span.start as usize..span.end as usize, new);
        assert_eq!(mended, format!("t\n{fixed}\n"));
        assert!(read_text(&mended).1.is_empty());
    }
    assert!(read_text("t\nr1 a b 1MEG\nr2 a b 1mil\nr3 a b 5V\n").1.is_empty());
    assert_eq!(read_text("t\nr1 a b 4k7\n").1[0].code, "W0702");
}

#[test]
fn errors_have_codes_and_places() {
    for (line, code, at) in [
        ("r1 a", "E0703", "a"),
        ("r1 a b", "E0703", "b"),
        ("r1 a b 1k 2k", "E0704", "2k"),
        ("r1 a b 1k tcx=2", "E0704", "tcx"),
        ("r1 a b {1+", "E0704", "{"),
        ("r1 a b {1+}", "E0705", "+"),
        ("m1 a b c d mod", "E0702", "m1"),
        ("q1 a b c mod", "E0702", "q1"),
        ("=1 2", "E0701", "="),
        ("? a", "E0701", "?"),
        ("v1 a 0 PULSE(1", "E0704", "PULSE"),
        ("v1 a 0 PULSE(1)", "E0707", "PULSE(1)"),
        ("v1 a 0 PWL(0 1 2)", "E0707", "PWL(0 1 2)"),
        ("v1 a 0 PWL(0 1) rr=0", "E0704", "rr"),
        ("e1 a 0 poly(0) b 0 1 2", "E0771", "poly(0"),
        ("b1 a 0 2*v(c)", "E0703", "2*v"),
        (".noise v(a) v1 dec 10 1 1k", "E0702", ".noise"),
        (".include x.lib", "E0901", "x.lib"),
        (".trann 1 2", "E0701", ".trann"),
        (".tran 1", "E0703", "1"),
        (".ic i(l1)=2", "E0703", "i"),
        (".ends", "E0709", ".ends"),
        (".subckt a b", "E0709", ".subckt a b"),
        (".func f x {x}", "E0703", "x"),
        (".param f(x)=f(x) y=f(1)", "E0714", "f(x)"),
        (".endif", "E0709", ".endif"),
        (".else", "E0709", ".else"),
        ("k1 l1 0.5", "E0703", "0"),
    ] {
        let text = format!("t\n{line}\n");
        let (_, d) = read_text(&text);
        let error = d.iter().find(|d| d.code == code).unwrap_or_else(|| panic!("{line}: {d:?}"));
        let span = error.labels[0].span;
        assert_eq!(
            &text[span.start as usize..span.end as usize]
                .chars()
                .take(at.len())
                .collect::<String>(),
            at,
            "{line}: {error:?}"
        );
        for d in &d {
            assert!(crate::diagnostic::codes::find(d.code).is_some(), "{}", d.code);
        }
    }
    let (_, d) = read_text("t\n.trna 1 2\n");
    assert_eq!(d[0].help.as_deref(), Some("did you mean `.tran`?"));
    let (netlist, d) = read_text("t\n.control\nrun\nplot v(a)\n.endc\nr1 a 0 1\n");
    assert_eq!((d.len(), d[0].code, netlist.cards.len()), (1, "W0703", 1));
    assert_eq!(read_text("t\n.control\nrun\n").1.last().unwrap().code, "E0709");
}

#[test]
fn spans_point_into_continued_lines() {
    let text = "t\nb1 a 0 v=v(a)\n+ * $ why not\n* no\n+ )\n";
    let (_, d) = read_text(text);
    assert_eq!(d[0].code, "E0705");
    assert_eq!(&text[d[0].labels[0].span.start as usize..], ")\n");
}

#[test]
fn deep_nesting_is_refused() {
    let (_, d) = read_text(&format!("t\nb1 a 0 v={}\n", "(".repeat(10_000)));
    assert_eq!(d[0].code, "E0110");
    let (netlist, d) = read_text(&format!("t\n{}", ".subckt a b\n".repeat(10_000)));
    assert!(!d.is_empty());
    drop(netlist);
}

/// Reading takes time in proportion to the lines: eight times as many take less than 24 times as long, on a machine that
/// does other things meanwhile.
#[test]
fn the_time_of_reading_grows_with_the_lines() {
    use std::fmt::Write;
    let seconds = |count: usize| {
        let mut text = String::from("ladder\n");
        for k in 0..count {
            let _ = write!(text, "R{k} n{k} n{} 1\nC{k} n{} 0 1u\n", k + 1, k + 1);
        }
        let once = || {
            let start = std::time::Instant::now();
            let (netlist, d) = read_text(&text);
            let time = start.elapsed().as_secs_f64();
            assert!(d.is_empty());
            assert_eq!(netlist.cards.len(), 2 * count);
            time
        };
        once().min(once()).min(once())
    };
    let (few, many) = (seconds(5000), seconds(40_000));
    assert!(many < 24.0 * few, "{few:.3} s and {many:.3} s");
}

const PIECES: &[&str] = &[
    "r1 a b 1k",
    "c1 a 0 1u ic=0",
    "v1 a 0 PULSE(0 1 1 1 1)",
    "b1 a 0 v=v(a)*2",
    "e1 a b value={",
    ".param x=",
    ".subckt s a",
    ".ends",
    ".model m d(is=1)",
    ".ic v(a)=",
    ".save v(a) ",
    "x1 a s",
    "}",
    "{",
    "'",
    "(",
    ")",
    "=",
    "\n+ ",
    "\n* ",
    "\n",
    " $ c",
    ";",
    "k1 l1 l2 1",
    "é",
    "1M",
    "*bondspice a=b",
    ".tran 1 2 uic",
    "\u{0}",
    "E1 a 0 table {x} = (0,1)",
    "?:",
    "&&",
    "**",
    "i(v1)",
];

proptest! {
    #[test]
    fn garbage_never_panics(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
        read_text(&String::from_utf8_lossy(&bytes));
    }

    #[test]
    fn shuffled_decks_never_panic(pieces in proptest::collection::vec(0..PIECES.len(), 0..60)) {
        let text: String = pieces.iter().map(|k| PIECES[*k]).collect();
        let (_, d) = read_text(&text);
        for d in d {
            for label in d.labels {
                let (start, end) = (label.span.start as usize, label.span.end as usize);
                prop_assert!(start <= end && end <= text.len());
                prop_assert!(text.is_char_boundary(start) && text.is_char_boundary(end), "{:?}", d.message);
            }
        }
    }
}

#[test]
fn leaves_of_expressions_keep_their_places() {
    let text = "t\nb1 a 0 v=v(a) +\n+ gain\n";
    let (netlist, _) = read_text(text);
    let CardKind::Device(device) = &netlist.cards[0].kind else { panic!() };
    let Element::BehaviouralVoltage { law } = &device.element else { panic!() };
    let mut places = vec![];
    law.leaves(&mut |_, span| places.push(&text[span.start as usize..span.end as usize]));
    assert_eq!(places, ["v(a)", "gain"]);
    assert!(matches!(*law.node, Node::Binary(..)));
}
