//! Causality of textbook systems, of graphs that cannot be, and of random ones.

use super::*;
use crate::diagnostic::Severity;
use crate::expr;
use crate::quantity::Domain;
use crate::source::Span;
use proptest::prelude::*;
use std::collections::HashMap;

/// Reads a drawing: lines of `Kind:name(word) -> name, …`. Words: `e`, `f` the form of an R's law, `0` a stated initial value,
/// `gain`, `ratio` a modulated two-port.
fn graph(text: &str) -> BondGraph {
    let mut graph = BondGraph::default();
    let mut ids: HashMap<String, VertexId> = HashMap::new();
    for text in text.lines() {
        for item in text.split([' ', ',']).filter(|word| word.contains(':')) {
            let (kind, rest) = item.split_once(':').unwrap();
            let (name, word) = rest.split_once('(').unwrap_or((rest, ""));
            ids.insert(name.to_string(), VertexId(graph.vertices.len() as u32));
            graph.vertices.push(vertex(kind, name, word.trim_end_matches(')')));
        }
    }
    let find = |word: &str| {
        let word = word.trim();
        let name = word.split_once(':').map_or(word, |(_, name)| name);
        ids[name.split_once('(').map_or(name, |(name, _)| name)]
    };
    for text in text.lines().map(str::trim).filter(|text| !text.is_empty()) {
        let mut rest = text;
        let mut before: Vec<VertexId> = Vec::new();
        let mut given = None;
        loop {
            let arrow = rest.find("->").map(|at| {
                if rest[..at].ends_with('|') {
                    (at - 1, at + 2, Some(Stroke::AtFrom))
                } else if rest[at + 2..].starts_with('|') {
                    (at, at + 3, Some(Stroke::AtTo))
                } else {
                    (at, at + 2, None)
                }
            });
            let items = &rest[..arrow.map_or(rest.len(), |arrow| arrow.0)];
            let now: Vec<VertexId> = items.split(',').map(find).collect();
            for &from in &before {
                for &to in &now {
                    bond(&mut graph, from, to, given);
                }
            }
            before = now;
            let Some((_, next, stroke)) = arrow else { break };
            given = stroke;
            rest = &rest[next..];
        }
    }
    graph
}

fn bond(graph: &mut BondGraph, from: VertexId, to: VertexId, given: Option<Stroke>) {
    let id = BondId(graph.bonds.len() as u32);
    let mut end = |vertex: VertexId| {
        let bonds = &mut graph.vertices[vertex.index()].bonds;
        bonds.push(id);
        let two_port =
            matches!(graph.vertices[vertex.index()].law, Law::Transformer(_) | Law::Gyrator(_));
        let port = graph.vertices[vertex.index()].bonds.len() as u32 - 1;
        End { vertex, port: if two_port { port } else { 0 } }
    };
    let (from, to) = (end(from), end(to));
    graph.bonds.push(Bond { from, to, given, domain: Domain::Any, span: Span::NONE });
}

fn vertex(kind: &str, name: &str, word: &str) -> Vertex {
    let one = || Expr::number(1.0);
    let modulus = || match word {
        "gain" => Modulus::Gain(expr::Expr::leaf(Leaf::Time)),
        "ratio" => Modulus::Ratio(expr::Expr::leaf(Leaf::Time)),
        _ => Modulus::Ratio(one()),
    };
    let store = |kind| Law::Store {
        kind,
        law: match word {
            "law" => StoreLaw::OfStored(Expr::leaf(Leaf::Own(Variable::Stored))),
            _ => StoreLaw::Linear(one()),
        },
        initial: if word == "0" { StoreInitial::Stored(one()) } else { StoreInitial::Unstated },
    };
    let source = |sets, detector| Law::Source { sets, value: one(), detector };
    let (kind, law) = match kind {
        "0" => ("0", Law::Zero),
        "1" => ("1", Law::One),
        "Se" => ("Se", source(Power::Effort, false)),
        "Sf" => ("Sf", source(Power::Flow, false)),
        "De" => ("De", source(Power::Flow, true)),
        "Df" => ("Df", source(Power::Effort, true)),
        "R" => (
            "R",
            Law::Dissipator(match word {
                "e" => Dissipation::Effort(Expr::leaf(Leaf::Own(Variable::Power(Power::Flow)))),
                "f" => Dissipation::Flow(Expr::leaf(Leaf::Own(Variable::Power(Power::Effort)))),
                _ => Dissipation::Linear(one()),
            }),
        ),
        "C" => ("C", store(Storage::Compliance)),
        "I" => ("I", store(Storage::Inertia)),
        "TF" => ("TF", Law::Transformer(modulus())),
        "GY" => ("GY", Law::Gyrator(modulus())),
        other => panic!("{other}"),
    };
    Vertex { name: name.to_string(), kind, law, span: Span::NONE, bonds: vec![] }
}

fn names(graph: &BondGraph, ids: &[VertexId]) -> Vec<String> {
    ids.iter().map(|&id| graph.vertex(id).name.clone()).collect()
}

fn ports(graph: &BondGraph, ends: &[End]) -> Vec<String> {
    ends.iter().map(|&end| graph.port_name(end)).collect()
}

fn id(graph: &BondGraph, name: &str) -> VertexId {
    graph.vertex_ids().find(|&id| graph.vertex(id).name == name).unwrap()
}

fn codes(diagnostics: &[Diagnostic]) -> Vec<&str> {
    diagnostics.iter().map(|d| d.code).collect()
}

/// Assigns, expects no error, and checks every vertex's rule on the result.
fn good(text: &str) -> (BondGraph, Causality, Vec<Diagnostic>) {
    let graph = graph(text);
    let mut diagnostics = vec![];
    let causality = assign(&graph, &mut diagnostics);
    let causality = causality.unwrap_or_else(|| panic!("{diagnostics:#?}"));
    assert!(causality.strokes.iter().all(Option::is_some), "{}", to_text(&graph, &causality));
    obeys(&graph, &causality);
    (graph, causality, diagnostics)
}

fn obeys(graph: &BondGraph, causality: &Causality) {
    for id in graph.vertex_ids() {
        let vertex = graph.vertex(id);
        let efforts_in = vertex
            .bonds
            .iter()
            .filter(|&&bond| {
                let at_tail = graph.bond(bond).from.vertex == id;
                causality.strokes[bond.index()]
                    == Some(if at_tail { Stroke::AtFrom } else { Stroke::AtTo })
            })
            .count();
        let allowed = match &vertex.law {
            Law::Zero => efforts_in == 1,
            Law::One => efforts_in + 1 == vertex.bonds.len(),
            Law::Transformer(_) => efforts_in == 1,
            Law::Gyrator(_) => efforts_in != 1,
            Law::Source { sets, .. } => efforts_in == usize::from(*sets == Power::Flow),
            _ => true,
        };
        assert!(allowed, "{}\n{}", vertex.name, to_text(graph, causality));
    }
}

fn bad(text: &str) -> (BondGraph, Causality, Vec<Diagnostic>) {
    let graph = graph(text);
    let mut diagnostics = vec![];
    assert!(assign(&graph, &mut diagnostics).is_none());
    let causality = analyse(&graph, &mut vec![]);
    (graph, causality, diagnostics)
}

#[test]
fn series_circuit() {
    let (graph, causality, diagnostics) = good("Se:U -> 1:mesh\nmesh -> I:L, R:R, C:C");
    assert_eq!(ports(&graph, &causality.states), ["L", "C"]);
    assert_eq!((causality.order, diagnostics.len()), (2, 0));
    insta::assert_snapshot!(to_text(&graph, &causality), @r"
    bonds (the stroke is at the end on which the effort is imposed)
      U ->| mesh
      mesh ->| L
      mesh |-> R
      mesh |-> C

    states (2)
      I:L
      C:C

    order 2: 2 storages in integral causality, 0 integrators of signals
    ");
    let json = to_json(&graph, &causality);
    assert_eq!(
        json.to_string(),
        r#"{"schema":1,"bonds":[{"from":"U","to":"mesh","stroke":"to"},{"from":"mesh","to":"L","stroke":"to"},{"from":"mesh","to":"R","stroke":"from"},{"from":"mesh","to":"C","stroke":"from"}],"states":["L","C"],"order":2,"derivative":[],"loops":[],"conflicts":[]}"#
    );
}

/// Textbook cases without any trouble: states in order.
#[test]
fn states_of_textbook_cases() {
    for (text, states) in [
        ("C:C -> R:R", vec!["C"]),
        ("C:C(0) -> 1:j\nj -> R:R1, R:R2", vec!["C"]),
        ("0:j -> R:R, C:C, I:I", vec!["C", "I"]),
        ("0:j -> C:C, R:R\nSf:S -> j", vec!["C"]),
        ("Se:S -> 1:j\nj -> C:C, R:R", vec!["C"]),
        ("Se:S -> 1:a -> TF:t -> 0:b\na -> R:Ra, I:L\nb -> C:C, R:Rb", vec!["L", "C"]),
        (
            "Se:S -> 1:a -> 0:b -> 1:c -> 0:d\na -> I:I\nb -> R:R1\nc -> R:R2\nd -> C:C\nd -> Sf:F",
            vec!["I", "C"],
        ),
        ("0:j -> C:C(law), I:I", vec!["C", "I"]),
    ] {
        let (graph, causality, diagnostics) = good(text);
        assert_eq!(ports(&graph, &causality.states), states, "{text}");
        assert!(codes(&diagnostics).iter().all(|&code| code == "W0402"), "{text}");
    }
}

#[test]
fn dependent_storages_name_what_determines_them() {
    // Two inertias on a rigid gear.
    let (graph, causality, diagnostics) =
        good("Se:T -> 1:s1\ns1 -> I:J1, R:b1\ns1 -> TF:gear -> 1:s2\ns2 -> I:J2, R:b2, C:k");
    assert_eq!(ports(&graph, &causality.states), ["J1", "k"]);
    assert_eq!(causality.order, 2);
    let [dependent] = &causality.dependent[..] else { panic!() };
    assert_eq!(graph.port_name(dependent.storage), "J2");
    assert_eq!(ports(&graph, &dependent.on), ["J1"]);
    let path: Vec<String> = dependent.path.iter().map(|&bond| graph.bond_name(bond)).collect();
    assert_eq!(path, ["s1 -> J1", "s1 -> gear", "gear -> s2", "s2 -> J2"]);
    assert_eq!(codes(&diagnostics), ["W0401"]);
    assert!(diagnostics[0].notes[0].contains("s1 -> gear -> s2 -> J2"), "{diagnostics:?}");
    // Through a gyrator: an inertia and a compliance.
    let (graph, causality, _) =
        good("Se:S -> 1:a\na -> I:I, R:Ra\na -> GY:g -> 0:b\nb -> C:C\nb -> 1:c\nc -> I:J, R:Rc");
    assert_eq!(ports(&graph, &causality.states), ["I", "J"]);
    assert_eq!(ports(&graph, &causality.dependent[0].on), ["I"]);
    // Two compliances in parallel; the one with a stated value is the state.
    let (graph, causality, _) = good("Se:S -> 1:a\na -> R:R\na -> 0:b\nb -> C:C1, C:C2(0)");
    assert_eq!(ports(&graph, &causality.states), ["C2"]);
    assert_eq!(ports(&graph, &causality.dependent[0].on), ["C2"]);
    // A compliance on a source depends on the source.
    let (graph, causality, _) = good("Se:S -> 0:a\na -> C:C, R:R");
    assert!(causality.states.is_empty());
    assert_eq!(ports(&graph, &causality.dependent[0].on), ["S"]);
}

#[test]
fn nonlinear_storages_come_before_linear_ones() {
    let (graph, causality, _) = good("0:j -> C:linear, C:law(law), R:R");
    assert_eq!(ports(&graph, &causality.states), ["law"]);
}

#[test]
fn algebraic_loops_are_paths() {
    let (graph, causality, diagnostics) =
        good("Se:S -> 1:a -> 0:b -> 1:c\na -> R:R1\nb -> R:R2\nc -> R:R3, C:C");
    assert_eq!(causality.loops.len(), 1);
    assert_eq!(names(&graph, &causality.loops[0].elements), ["R1", "R2", "R3"]);
    assert_eq!(codes(&diagnostics), ["W0402"]);
    // Two loops that share nothing are two.
    let (graph, causality, _) = good(
        "Se:S -> 1:a\na -> R:R1\na -> 0:b\nb -> R:R2\nb -> 1:m\nm -> I:I\nm -> 0:c\nc -> R:R3\nc -> 1:d\nd -> R:R4, Df:x",
    );
    assert_eq!(
        causality.loops.iter().map(|l| names(&graph, &l.elements)).collect::<Vec<_>>(),
        [["R1", "R2"], ["R3", "R4"]]
    );
    // With a storage between them there is none.
    let (_, causality, _) = good("Se:S -> 1:a -> 0:b\na -> R:R1\nb -> R:R2, C:C");
    assert!(causality.loops.is_empty());
}

/// The hydraulic part of the actuator: leakage, line loss and dilatation determine each other.
#[test]
fn the_actuator_has_one_loop() {
    let (graph, causality, diagnostics) = good(
        "Se:bus -> TF:chopper(gain) -> 1:armature -> GY:motor -> 1:shaft -> TF:pump -> 0:pump_port
         armature -> R:eta, R:R, I:L
         shaft -> I:Jmp, R:fmp, R:fetam
         pump_port -> R:Clp
         pump_port -> 1:line -> 0:jack_port -> TF:piston -> 1:rod
         line -> R:line_loss(e)
         jack_port -> 1:chamber
         chamber -> C:fluid, R:dilatation
         rod -> I:Mj, R:dry(e)
         rod -> 0:attachment -> TF:lever -> 1:surface
         attachment -> 1:mount
         mount -> C:stiffness, R:Cmj
         surface -> I:J
         Se:aero -> surface",
    );
    assert_eq!(ports(&graph, &causality.states), ["L", "Jmp", "fluid", "Mj", "stiffness", "J"]);
    assert_eq!(causality.loops.len(), 1);
    assert_eq!(names(&graph, &causality.loops[0].elements), ["Clp", "line_loss", "dilatation"]);
    let mut path: Vec<String> =
        causality.loops[0].path.iter().map(|&bond| graph.bond_name(bond)).collect();
    path.sort();
    assert_eq!(
        path,
        [
            "chamber -> dilatation",
            "jack_port -> chamber",
            "line -> jack_port",
            "line -> line_loss",
            "pump_port -> Clp",
            "pump_port -> line"
        ]
    );
    assert_eq!(codes(&diagnostics), ["W0402"]);
}

#[test]
fn bridge_with_a_loop_of_junctions() {
    let (graph, causality, diagnostics) = good(
        "Se:V -> 0:a -> 1:ab -> 0:b -> 1:bd\na -> 1:ac -> 0:c -> 1:cd\nb -> 1:bc -> c\n\
         ab -> R:R1\nac -> R:R2\nbc -> R:R3\nbd -> R:R4\ncd -> R:R5\n0:d -> Df:ground\nbd -> d\ncd -> d",
    );
    assert_eq!(causality.loops.len(), 1);
    let mut elements = names(&graph, &causality.loops[0].elements);
    elements.sort();
    assert_eq!(elements, ["R1", "R2", "R3", "R4", "R5"]);
    assert_eq!(codes(&diagnostics), ["W0402"]);
    let (graph, causality, _) = good(
        "Se:V -> 0:a -> 1:ab -> 0:b -> 1:bc -> 0:c\nab -> R:R1\nb -> C:C\nbc -> R:R5\nc -> R:R4\na -> 1:ac -> c\nac -> I:L, R:RL",
    );
    assert_eq!(ports(&graph, &causality.states), ["C", "L"]);
    assert_eq!(names(&graph, &causality.loops[0].elements), ["R5", "R4"]);
}

#[test]
fn sources_that_fight_are_named_with_the_path() {
    let (graph, causality, diagnostics) = bad("Se:A -> 0:j\nSe:B -> j\nj -> R:R");
    assert_eq!(codes(&diagnostics), ["E0406"]);
    assert_eq!(names(&graph, &causality.conflicts[0].elements), ["A", "B"]);
    assert!(
        diagnostics[0].message.contains("Se:A and Se:B both impose the effort of 0:j"),
        "{diagnostics:?}"
    );
    let (graph, causality, diagnostics) = bad("Sf:A -> 1:j\nSf:B -> j\nj -> R:R");
    assert_eq!(names(&graph, &causality.conflicts[0].elements), ["A", "B"]);
    assert!(diagnostics[0].message.contains("both impose the flow of 1:j"), "{diagnostics:?}");
    let (graph, causality, diagnostics) = bad("Se:A -> TF:t -> 0:j\nSe:B -> j\nj -> R:R");
    assert_eq!(names(&graph, &causality.conflicts[0].elements), ["A", "B"]);
    let path: Vec<String> =
        causality.conflicts[0].path.iter().map(|&bond| graph.bond_name(bond)).collect();
    assert_eq!(path, ["A -> t", "t -> j", "B -> j"], "{diagnostics:?}");
    let (graph, causality, diagnostics) = bad("Se:A -> TF:t -> Se:B");
    assert_eq!(names(&graph, &causality.conflicts[0].elements), ["A", "B"], "{diagnostics:?}");
    // Far apart.
    let (graph, causality, _) = bad(
        "Se:A -> 0:x\nx -> R:R1\nx -> TF:t -> 0:y\ny -> R:R2\ny -> GY:g -> 1:z\nz -> R:R3\nSf:B -> z",
    );
    let mut elements = names(&graph, &causality.conflicts[0].elements);
    elements.sort();
    assert_eq!(elements, ["A", "B"]);
    assert_eq!(causality.conflicts[0].path.len(), 6);
    // Flow sources alone on a 0-junction; two independent conflicts in one go.
    let (_, causality, diagnostics) =
        bad("Sf:A -> 0:j\nSf:B -> j\nSe:X -> 0:k\nSe:Y -> k\nk -> R:R");
    assert_eq!(causality.conflicts.len(), 2, "{diagnostics:?}");
    assert!(diagnostics[0].message.contains("nothing imposes its effort"), "{diagnostics:?}");
}

#[test]
fn structure_is_checked_first() {
    for (text, expected) in [
        ("Se:A -> 1:j", vec!["E0401"]),
        ("Se:A -> 1:j\nj -> R:R\nR -> 1:k\nk -> C:C", vec!["E0402"]),
        ("Se:A -> Se:B", vec!["E0404"]),
        ("Sf:A -> Sf:B", vec!["E0404"]),
        ("Se:A -> Df:B", vec!["E0404"]),
        ("Sf:A -> De:B", vec!["E0404"]),
        ("Se:A -> TF:t", vec!["E0403"]),
        ("R:alone", vec!["E0403"]),
        ("Se:A -> 1:j\nj -> R:R\nj -> j", vec!["E0405"]),
    ] {
        let (_, causality, diagnostics) = bad(text);
        assert_eq!(codes(&diagnostics), expected, "{text}");
        assert!(causality.strokes.iter().all(Option::is_none));
    }
    let (_, _, diagnostics) = good("Se:A -> De:B");
    assert!(diagnostics.is_empty());
    let (_, _, diagnostics) =
        good("0:a -> 1:b\na -> 1:b2\na -> b\nSe:A -> b2\nb2 -> R:R\nb -> R:S");
    assert!(codes(&diagnostics).contains(&"W0404"), "{diagnostics:?}");
}

#[test]
fn given_strokes_are_obeyed_and_checked() {
    let (graph, causality, diagnostics) = good("Se:U -> 1:m\nm |-> I:L\nm -> R:R");
    assert!(causality.states.is_empty());
    assert_eq!(ports(&graph, &[causality.dependent[0].storage]), ["L"]);
    assert_eq!(codes(&diagnostics)[0], "W0401");
    let (_, causality, diagnostics) = bad("Se:U |-> 1:m\nm -> I:L\nm -> R:R");
    assert_eq!(codes(&diagnostics), ["E0407"]);
    assert_eq!(causality.conflicts.len(), 1);
    let (_, _, diagnostics) = bad("Se:U -> 0:m\nm |-> C:C\nm -> R:R");
    assert_eq!(codes(&diagnostics)[0], "E0407");
}

#[test]
fn modulated_two_ports_do_not_divide_where_they_may_choose() {
    // The loop of two junctions leaves the transformer free.
    for (word, receives) in [("gain", true), ("ratio", false)] {
        let (graph, causality, diagnostics) =
            good(&format!("0:a -> TF:t({word}) -> 0:b\na -> R:R1\nb -> R:R2\na -> C:C\nb -> C:D"));
        let bond = graph.vertex(id(&graph, "t")).bonds[0];
        let end = End { vertex: id(&graph, "t"), port: 0 };
        assert_eq!(causality.receives_effort(&graph, bond, end), Some(receives));
        // It is preferred to integral causality of one of the storages.
        assert_eq!(causality.states.len(), 1);
        assert_eq!(codes(&diagnostics), ["W0401"]);
    }
    let (_, _, diagnostics) = good("Se:U -> TF:t(ratio) -> 1:m\nm -> I:L, R:R");
    assert_eq!(codes(&diagnostics), ["W0403"]);
    let (_, _, diagnostics) = good("Se:U -> TF:t(gain) -> 1:m\nm -> I:L, R:R");
    assert!(diagnostics.is_empty());
    let (_, _, diagnostics) = good("Se:U -> GY:t(ratio) -> 1:m\nm -> C:C, R:R");
    assert_eq!(codes(&diagnostics), ["W0403"]);
}

#[test]
fn laws_used_the_other_way_round_are_noted() {
    let (_, _, diagnostics) = good("Se:U -> 0:m\nm -> R:R(e), R:S(f)");
    assert_eq!(codes(&diagnostics), ["N0401"]);
    assert_eq!(diagnostics[0].severity, Severity::Note);
    assert!(diagnostics[0].message.contains("R:R"));
}

#[test]
fn rings_of_equal_junctions_stay_open() {
    let graph = graph("Se:U -> 0:a\na -> 0:b\nb -> 0:c\nc -> a\nb -> R:R\nc -> R:S");
    let mut diagnostics = vec![];
    let causality = assign(&graph, &mut diagnostics).expect("a warning only");
    assert_eq!(codes(&diagnostics), ["W0405"]);
    assert_eq!(causality.strokes.iter().filter(|s| s.is_none()).count(), 1);
    let graph = self::graph("Se:U -> 0:a\na -> 0:b\nb -> 1:t\nt -> a\nb -> R:R");
    let mut diagnostics = vec![];
    let causality = assign(&graph, &mut diagnostics).expect("a warning only");
    assert_eq!(codes(&diagnostics), ["W0405"]);
    assert_eq!(causality.strokes.iter().filter(|s| s.is_none()).count(), 2);
}

#[test]
fn loops_through_signals() {
    // A resistance modulated by its own effort through a signal.
    let mut graph = graph("Se:U -> 1:m\nm -> R:R, I:L");
    let bond = graph.vertex(id(&graph, "R")).bonds[0];
    let signal = |name: &str, law| Signal {
        name: name.into(),
        law,
        origin: SignalOrigin::Signal,
        span: Span::NONE,
        unit: None,
        home: 0,
    };
    let reading = Leaf::Bond { bond, variable: Power::Effort, negated: false };
    graph.signals.push(signal("s", SignalLaw::Algebraic(Expr::leaf(reading.clone()))));
    let at = id(&graph, "R").index();
    graph.vertices[at].law =
        Law::Dissipator(Dissipation::Linear(Expr::leaf(Leaf::Signal(SignalId(0)))));
    let mut diagnostics = vec![];
    let causality = assign(&graph, &mut diagnostics).expect("good");
    assert_eq!(names(&graph, &causality.loops[0].elements), ["R"]);
    assert_eq!(causality.loops[0].signals, [SignalId(0)]);
    // An integrator on the way breaks it and adds a state.
    graph.signals[0].law =
        SignalLaw::Integrator { rate: Expr::leaf(reading), initial: Initial::Implied };
    let causality = assign(&graph, &mut vec![]).expect("good");
    assert!(causality.loops.is_empty());
    assert_eq!(causality.order, 2);
    // Signals alone.
    graph.signals[0].law = SignalLaw::Algebraic(Expr::leaf(Leaf::Signal(SignalId(0))));
    let mut diagnostics = vec![];
    assert!(assign(&graph, &mut diagnostics).is_none());
    assert_eq!(codes(&diagnostics), ["E0408"]);
}

/// A chain of 10,000 elements, with rigid parts and loops, in well under a second.
#[test]
fn cost_is_in_proportion() {
    let mut text = String::from("Se:U -> 1:j0\n");
    for k in 0..2500 {
        use std::fmt::Write;
        let _ = writeln!(
            text,
            "j{k} -> I:L{k}, R:R{k}\nj{k} -> 0:n{k}\nn{k} -> C:C{k}\nn{k} -> 1:j{}",
            k + 1
        );
    }
    text.push_str("j2500 -> R:end\n");
    let graph = graph(&text);
    let started = std::time::Instant::now();
    let causality = assign(&graph, &mut vec![]).expect("good");
    assert_eq!(causality.order, 5000);
    assert!(started.elapsed().as_secs_f64() < 0.5, "{:?}", started.elapsed());
    // A bus of many compliances: all but one are dependent.
    let mut text = String::from("Sf:U -> 0:bus\n");
    (0..5000).for_each(|k| text.push_str(&format!("bus -> C:C{k}, R:R{k}\n")));
    let graph = self::graph(&text);
    let started = std::time::Instant::now();
    let causality = assign(&graph, &mut vec![]).expect("good");
    assert_eq!(causality.order, 1);
    assert!(started.elapsed().as_secs_f64() < 0.5, "{:?}", started.elapsed());
}

/// Whether any strokes satisfy all rules, by trying all.
fn some_causality(graph: &BondGraph) -> bool {
    (0..1u32 << graph.bonds.len()).any(|bits| {
        let stroke = |k: usize| if bits >> k & 1 == 1 { Stroke::AtTo } else { Stroke::AtFrom };
        graph.vertex_ids().all(|id| {
            let vertex = graph.vertex(id);
            let count = vertex.bonds.iter().filter(|&&bond| {
                (graph.bond(bond).from.vertex == id) == (stroke(bond.index()) == Stroke::AtFrom)
            });
            let efforts_in = count.count();
            match &vertex.law {
                Law::Zero | Law::Transformer(_) => efforts_in == 1,
                Law::One => efforts_in + 1 == vertex.bonds.len(),
                Law::Gyrator(_) => efforts_in != 1,
                Law::Source { sets, .. } => efforts_in == usize::from(*sets == Power::Flow),
                _ => true,
            }
        })
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 600, failure_persistence: None, ..ProptestConfig::default() })]

    /// On small random graphs an assignment is found exactly when there is one, and it obeys every rule.
    #[test]
    fn complete_and_right(junctions in 1usize..5, picks in proptest::collection::vec((0usize..8, 0usize..5, 0usize..5, any::<bool>()), 1..9)) {
        let mut graph = BondGraph::default();
        for k in 0..junctions {
            graph.vertices.push(vertex(if k % 2 == 0 { "0" } else { "1" }, &format!("j{k}"), ""));
        }
        for (n, &(kind, a, b, forward)) in picks.iter().enumerate() {
            let (a, b) = (VertexId((a % junctions) as u32), VertexId((b % junctions) as u32));
            let kinds = ["bond", "TF", "GY", "Se", "Sf", "R", "C", "I"];
            if kind < 3 && a == b {
                continue;
            }
            let (a, b) = if forward { (a, b) } else { (b, a) };
            if kind == 0 {
                bond(&mut graph, a, b, None);
                continue;
            }
            let id = VertexId(graph.vertices.len() as u32);
            graph.vertices.push(vertex(kinds[kind], &format!("x{n}"), if forward { "gain" } else { "" }));
            bond(&mut graph, a, id, None);
            if kind < 3 {
                bond(&mut graph, id, b, None);
            }
        }
        let mut diagnostics = vec![];
        let causality = analyse(&graph, &mut diagnostics);
        let codes = codes(&diagnostics);
        let _ = (to_text(&graph, &causality), to_json(&graph, &causality));
        if codes.iter().all(|code| !["E0401", "W0405"].contains(code)) {
            prop_assert_eq!(some_causality(&graph), causality.conflicts.is_empty(), "{}", to_text(&graph, &causality));
            if causality.conflicts.is_empty() {
                obeys(&graph, &causality);
            }
        }
        for conflict in &causality.conflicts {
            prop_assert!(!conflict.elements.is_empty() && !conflict.path.is_empty());
        }
    }
}
