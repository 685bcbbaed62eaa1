//! Tests of elaboration.

use super::*;
use crate::bond::graph::*;
use crate::diagnostic::Severity;
use crate::expr::{Binary, Node};
use crate::quantity::Domain;

const ACTUATOR: &str = include_str!("../../../models/eha_one_line.bg");

struct Built {
    graph: Option<BondGraph>,
    d: Vec<Diagnostic>,
    map: SourceMap,
}

fn build_with(text: &str, overrides: &Overrides) -> Built {
    let mut map = SourceMap::default();
    let file = map.add("models/test.bg", text);
    let mut d = vec![];
    let program = load(&mut map, file, &[], &mut d);
    let graph = elaborate(&program, &map, overrides, &mut d);
    Built { graph, d, map }
}

fn build(text: &str) -> Built {
    build_with(text, &Overrides::default())
}

/// The graph of a text without any diagnostic.
fn graph(text: &str) -> BondGraph {
    let built = build(text);
    assert_eq!(built.d, [], "{text}");
    built.graph.unwrap()
}

impl Built {
    /// Every diagnostic in a line: code, the text it points at, message; then its help.
    fn lines(&self) -> Vec<String> {
        self.d
            .iter()
            .map(|d| {
                let at = d.labels.first().map_or("", |label| self.map.text(label.span));
                let help = d.help.as_ref().map_or(String::new(), |help| format!(" | {help}"));
                format!("{} `{at}`: {}{help}", d.code, d.message)
            })
            .collect()
    }

    /// The text after the fixes of all diagnostics have been made.
    fn mended(&self) -> String {
        let mut edits: Vec<_> =
            self.d.iter().filter_map(|d| d.fix.as_ref()).flat_map(|fix| &fix.edits).collect();
        edits.sort_by_key(|(span, _)| std::cmp::Reverse(span.start));
        let mut text = self.map.file(crate::source::FileId(0)).unwrap().text.clone();
        for (span, new) in edits {
            text.replace_range(span.start as usize..span.end as usize, new);
        }
        text
    }
}

/// Asserts that a text has exactly these diagnostics, each given as `CODE text-pointed-at`.
#[track_caller]
fn errors(text: &str, expected: &[&str]) -> Built {
    let built = build(text);
    let found: Vec<String> = built
        .d
        .iter()
        .map(|d| {
            let at = d.labels.first().map_or("", |label| built.map.text(label.span));
            format!("{} {at}", d.code)
        })
        .collect();
    assert_eq!(found, expected, "\n{}", built.lines().join("\n"));
    let fails = built.d.iter().any(|d| d.severity == Severity::Error);
    assert_eq!(built.graph.is_none(), fails);
    built
}

/// A small graph around a statement: a source, a 1-junction `m` and a resistor.
fn around(statement: &str) -> String {
    format!("Se:U(1) -> 1:m -> R:r(1)\n{statement}\n")
}

fn vertex<'g>(graph: &'g BondGraph, name: &str) -> &'g Vertex {
    graph.vertices.iter().find(|vertex| vertex.name == name).unwrap()
}

fn signal<'g>(graph: &'g BondGraph, name: &str) -> &'g Signal {
    graph.signals.iter().find(|signal| signal.name == name).unwrap()
}

/// An expression in the words of the graph, for comparison.
fn spell(graph: &BondGraph, expr: &Expr) -> String {
    let own = |variable: &Variable| match variable {
        Variable::Power(Power::Effort) => "e",
        Variable::Power(Power::Flow) => "f",
        Variable::Stored => "q",
    };
    match &*expr.node {
        Node::Number(value) => value.to_string(),
        Node::Leaf(Leaf::Parameter(id)) => graph.parameters[id.index()].name.clone(),
        Node::Leaf(Leaf::Signal(id)) => graph.signals[id.index()].name.clone(),
        Node::Leaf(Leaf::Time) => "time".into(),
        Node::Leaf(Leaf::Own(variable)) => own(variable).into(),
        Node::Leaf(Leaf::Bond { bond, variable, negated }) => format!(
            "{}{}({})",
            if *negated { "-" } else { "" },
            if *variable == Power::Effort { "e" } else { "f" },
            graph.bond_name(*bond)
        ),
        Node::Leaf(Leaf::Stored(end)) => format!("stored({})", graph.port_name(*end)),
        Node::Unary(_, a) => format!("-{}", spell(graph, a)),
        Node::Binary(op, a, b) => {
            let sign = match op {
                Binary::Add => "+",
                Binary::Subtract => "-",
                Binary::Multiply => "*",
                Binary::Divide => "/",
                Binary::Power => "^",
                _ => "?",
            };
            format!("({}{sign}{})", spell(graph, a), spell(graph, b))
        }
        Node::Call(function, arguments) => {
            let inner: Vec<String> = arguments.iter().map(|a| spell(graph, a)).collect();
            format!("{}({})", function.row().name, inner.join(","))
        }
        Node::If(c, a, b) => {
            format!("if {} {} {}", spell(graph, c), spell(graph, a), spell(graph, b))
        }
        Node::Table(a, table) => format!("table({},{:?},{:?})", spell(graph, a), table.x, table.y),
    }
}

fn law_of(graph: &BondGraph, name: &str) -> String {
    law_text(graph, &vertex(graph, name).law)
}

fn law_text(graph: &BondGraph, law: &Law) -> String {
    let spell = |expr| spell(graph, expr);
    match law {
        Law::Zero => "zero".into(),
        Law::One => "one".into(),
        Law::Source { sets, value, detector } => {
            format!("{sets:?} {}{}", spell(value), if *detector { " detector" } else { "" })
        }
        Law::Dissipator(Dissipation::Linear(r)) => format!("R {}", spell(r)),
        Law::Dissipator(Dissipation::Effort(law)) => format!("e= {}", spell(law)),
        Law::Dissipator(Dissipation::Flow(law)) => format!("f= {}", spell(law)),
        Law::Store { kind, law, initial } => {
            let law = match law {
                StoreLaw::Linear(law) => format!("linear {}", spell(law)),
                StoreLaw::OfStored(law) => format!("of stored {}", spell(law)),
                StoreLaw::OfPower(law) => format!("of power {}", spell(law)),
            };
            let initial = match initial {
                StoreInitial::Stored(value) => format!(" stored0 {}", spell(value)),
                StoreInitial::Power(value) => format!(" power0 {}", spell(value)),
                StoreInitial::Unstated => String::new(),
            };
            format!("{kind:?} {law}{initial}")
        }
        Law::Rate { kind, rate, initial } => {
            let initial = match initial {
                Initial::Given(value) => format!(" from {}", spell(value)),
                Initial::Implied => String::new(),
            };
            format!("{kind:?} rate {}{initial}", spell(rate))
        }
        Law::Transformer(Modulus::Ratio(r)) => format!("TF ratio {}", spell(r)),
        Law::Transformer(Modulus::Gain(g)) => format!("TF gain {}", spell(g)),
        Law::Gyrator(Modulus::Ratio(r)) => format!("GY ratio {}", spell(r)),
        Law::Gyrator(Modulus::Gain(g)) => format!("GY gain {}", spell(g)),
        Law::Field(field) => {
            let ports: Vec<String> = field.ports.iter().map(|law| law_text(graph, law)).collect();
            ports.join("; ")
        }
    }
}

fn algebraic(graph: &BondGraph, name: &str) -> String {
    match &signal(graph, name).law {
        SignalLaw::Algebraic(expr) => spell(graph, expr),
        SignalLaw::Integrator { rate, initial } => {
            let initial = match initial {
                Initial::Given(value) => spell(graph, value),
                Initial::Implied => "implied".into(),
            };
            format!("integ({}, {initial})", spell(graph, rate))
        }
        SignalLaw::Waveform(Waveform::Step { at, before, after }) => {
            format!("step({}, {}, {})", spell(graph, at), spell(graph, before), spell(graph, after))
        }
        SignalLaw::Memory { kind, input } => {
            let kind = match kind {
                Memory::Hysteresis { low, high } => {
                    format!("hysteresis {} {}", spell(graph, low), spell(graph, high))
                }
                Memory::Sample { period } => format!("sample {}", spell(graph, period)),
                Memory::Delay { by } => format!("delay {}", spell(graph, by)),
            };
            format!("{kind} of {}", spell(graph, input))
        }
        SignalLaw::Waveform(other) => format!("{other:?}").split(' ').next().unwrap().to_string(),
    }
}

#[test]
fn the_actuator() {
    let graph = graph(ACTUATOR);
    assert_eq!((graph.vertices.len(), graph.bonds.len()), (32, 31));
    assert_eq!((graph.parameters.len(), graph.signals.len()), (32, 9));
    let parameter = |name| graph.parameters.iter().find(|p| p.name == name).unwrap();
    // Units divide by powers of ten, so that the doubles are the nearest ones.
    for (name, value) in [
        ("L", 1.7e-3),
        ("D", 5.581295990097347e-7),
        ("beta", 0.8e9),
        ("Vt", 250e-6),
        ("S", 38.57e-4),
        ("la", 0.119),
        ("v0", 1e-3),
        ("KaI", 270.5882352941177),
    ] {
        assert_eq!(parameter(name).value, value, "{name}");
    }
    assert_eq!(parameter("Jmp").description, "motor-pump inertia");
    assert_eq!(parameter("Vt").unit.as_ref().unwrap().text, "cm^3");
    for (name, law) in [
        ("bus", "Effort Ubus"),
        ("chopper", "TF gain alpha"),
        ("motor", "GY ratio Phi"),
        ("piston", "TF ratio (1/S)"),
        ("L", "Inertia linear L"),
        ("eta", "R R_eta"),
        ("fluid", "Compliance linear (Vt/(2*beta))"),
        ("line_loss", "e= (((2*(Cl^2))*f)*sqrt(((f^2)+(Q0^2))))"),
        ("aero", "Effort M_FC"),
    ] {
        assert_eq!(law_of(&graph, name), law, "{name}");
    }
    let names: Vec<&str> = graph.signals.iter().map(|signal| signal.name.as_str()).collect();
    let expected =
        ["x_ref", "M_FC", "x", "theta", "Omega_ref", "I_ref_z", "I_ref", "alpha_z", "alpha"];
    assert_eq!(names, expected);
    assert_eq!(algebraic(&graph, "x"), "integ(f(piston -> rod), 0)");
    assert_eq!(
        algebraic(&graph, "alpha_z"),
        "integ(((KiI*(I_ref-f(chopper -> armature)))\
         +(KaI*(alpha-((KpI*(I_ref-f(chopper -> armature)))+alpha_z)))), 0)"
    );
    assert_eq!(
        algebraic(&graph, "alpha"),
        "clamp(((KpI*(I_ref-f(chopper -> armature)))+alpha_z),-1,1)"
    );
    let SignalLaw::Waveform(Waveform::Pwl(points)) = &signal(&graph, "x_ref").law else { panic!() };
    let values: Vec<(f64, f64)> =
        points.iter().map(|(t, y)| (t.as_number().unwrap(), y.as_number().unwrap())).collect();
    assert_eq!(values[2], (1.0, -0.036));
    assert_eq!(values[6], (3.3, 0.0));
    let run = &graph.experiment;
    assert_eq!((run.until, run.step), (Some(3.8), Some(1e-3)));
    let columns: Vec<(&str, &str, f64, &str)> = run
        .observe
        .iter()
        .map(|o| (o.name.as_str(), o.unit.0.as_str(), o.unit.1, o.si_unit.as_str()))
        .collect();
    assert_eq!(columns[0], ("x", "mm", 1e-3, "m"));
    assert_eq!(columns[3], ("pump pressure", "bar", 1e5, "Pa"));
    assert_eq!(columns[4], ("pump flow", "L/min", 1e-3 / 60.0, "m^3/s"));
    assert_eq!(columns[5], ("electrical power", "kW", 1e3, "W"));
    assert_eq!(columns[6].3, "rad/s");
    assert_eq!(columns.len(), 9);
    // Every bond's domain follows from the units.
    let count = |domain| graph.bonds.iter().filter(|bond| bond.domain == domain).count();
    assert_eq!(count(Domain::Any), 0);
    assert_eq!(count(Domain::Electrical), 6);
    assert_eq!(count(Domain::Rotation), 8);
    assert_eq!(count(Domain::Hydraulic), 9);
    assert_eq!(count(Domain::Translation), 8);
}

#[test]
fn the_smallest_file() {
    let graph = graph(
        "# rlc.bg: a series RLC circuit\nSe:U(10 V) -> 1:mesh\n\
         mesh -> I:L(1 mH), R:R(2 Ohm), C:C(100 uF)\nsimulate until 20 ms step 10 us\n",
    );
    assert_eq!(graph.name, "test");
    assert_eq!(law_of(&graph, "C"), "Compliance linear 0.0001");
    assert_eq!(graph.experiment.step, Some(1e-5));
    let columns: Vec<&str> = graph.experiment.observe.iter().map(|o| o.name.as_str()).collect();
    assert_eq!(columns, ["f(mesh)", "p(L)", "q(C)"]);
}

#[test]
fn all_kinds_and_forms_of_laws() {
    let graph = graph(
        "param k = 2; input u; drive u = 1\n\
         MSe:a(u) -> 1:m -> MR:r1(k*(1 + u)), R:r2(e = k*f^3), R:r3(f = tanh(e))\n\
         m -> C:c1(k, q0 = 1), MC:c2(e = q + q^3, e0 = 2), C:c3(q = e^3), C:c4(der(e) = k*f/(1 + u), e0 = 3)\n\
         m -> I:i1(k, p0 = 1), MI:i2(f = p^3, f0 = 1), I:i3(p = sin(f)), I:i4(der(f) = e/k)\n\
         m -> TF:t1(2) -> 0:z; m -> MTF:t2(1/u) -> 0:z2; m -> MGY:g1(2*k/u) -> 1:y; m -> GY:g2(gain = 3) -> 1:y2\n\
         m -> MTF:t3(u/k) -> R:end(1)\n\
         z -> Sf:s(1), De:d; z2 -> MSf:s2(time), R:r5(1); y -> Df:fd; y2 -> R:k\n",
    );
    for (name, law) in [
        ("a", "Effort u"),
        ("r1", "R (k*(1+u))"),
        ("r2", "e= (k*(f^3))"),
        ("r3", "f= tanh(e)"),
        ("c1", "Compliance linear k stored0 1"),
        ("c2", "Compliance of stored (q+(q^3)) power0 2"),
        ("c3", "Compliance of power (e^3)"),
        ("c4", "Compliance rate ((k*f)/(1+u)) from 3"),
        ("i1", "Inertia linear k stored0 1"),
        ("i2", "Inertia of stored (q^3) power0 1"),
        ("i3", "Inertia of power sin(f)"),
        ("i4", "Inertia rate (e/k)"),
        ("t1", "TF ratio 2"),
        ("t2", "TF gain u"),
        ("t3", "TF ratio (u/k)"),
        ("g1", "GY gain (u/(2*k))"),
        ("g2", "GY gain 3"),
        ("s", "Flow 1"),
        ("s2", "Flow time"),
        ("d", "Flow 0 detector"),
        ("fd", "Effort 0 detector"),
        ("k", "R k"),
        ("z", "zero"),
    ] {
        assert_eq!(law_of(&graph, name), law, "{name}");
    }
}

#[test]
fn ports_strokes_and_readings() {
    let graph = graph(
        "Se:U(1) ->| 1:m |-> I:i(1)\nR:r(1) -> m\nm -> t.2; TF:t(2); t.1 -> 0:z; z -> Sf:out(1), R:r2(1); Sf:in(1) -> z\n\
         m -> 0:n; n -> m; n -> C:c(1)\n\
         signal a = f(r) + f(i)\nsignal b = power(U) - power(in)\nsignal c = e(t.1)*f(t.2)\nsignal d = e(m -> n)\n\
         signal g = f(n -> m)[1] + q(c) + p(i)\nsignal h = e(out) + f(out) + e(z) + f(m)\n",
    );
    let bond = |name: &str| {
        graph
            .bond_ids()
            .map(|id| (graph.bond_name(id), graph.bond(id)))
            .find(|(n, _)| n == name)
            .unwrap()
            .1
    };
    assert_eq!(bond("U -> m").given, Some(Stroke::AtTo));
    assert_eq!(bond("m -> i").given, Some(Stroke::AtFrom));
    assert_eq!(bond("r -> m").given, None);
    assert_eq!(bond("m -> t").to.port, 1);
    assert_eq!(bond("t -> z").from.port, 0);
    let t = vertex(&graph, "t");
    assert_eq!(graph.bond_name(t.bonds[0]), "t -> z");
    for (name, law) in [
        // A bond drawn out of a resistor counts its flow with the opposite sign.
        ("a", "(-f(r -> m)+f(m -> i))"),
        // Sources count along the half arrow, whichever way it points.
        ("b", "((e(U -> m)*f(U -> m))-(e(in -> z)*f(in -> z)))"),
        ("c", "(e(t -> z)*f(m -> t))"),
        ("d", "e(m -> n)"),
        ("g", "((f(n -> m)+stored(c))+stored(i))"),
        ("h", "(((e(z -> out)+f(z -> out))+e(t -> z))+f(U -> m))"),
    ] {
        assert_eq!(algebraic(&graph, name), law, "{name}");
    }
}

#[test]
fn signals_and_hidden_ones() {
    let graph = graph(&around(
        "param T = 2 s\nsignal a = lag(f(m), T)\nsignal b = lag(f(m), T, 1)\nsignal c = integ(a) + 2*step(T, 0, 1)\n\
         signal c_step = 1\nsignal d = pi(a, Kp = 2)\nsignal g = pi(a, Ki = 3, hi = 1, z0 = 0.5)\n\
         signal s = sine(0, 1, 50 Hz, 0, 0, 90 deg)\nsignal w = pulse(0, 1, 0, 0, 0, 1 ms, 2 ms)\nsignal r = ramp(T, 2)\n\
         input u\ndrive u = step(1 s, 0, 5)\noutput a",
    ));
    let names: Vec<&str> = graph.signals.iter().map(|signal| signal.name.as_str()).collect();
    let expected =
        ["a", "b", "c_integ", "c_step2", "c", "c_step", "d", "g_z", "g", "s", "w", "r", "u"];
    assert_eq!(names, expected);
    for (name, law) in [
        ("a", "integ(((f(U -> m)-a)/T), implied)"),
        ("b", "integ(((f(U -> m)-b)/T), 1)"),
        ("c_integ", "integ(a, 0)"),
        ("c_step2", "step(T, 0, 1)"),
        ("c", "(c_integ+(2*c_step2))"),
        ("d", "(2*a)"),
        ("g_z", "integ((3*a), 0.5)"),
        ("g", "min(g_z,1)"),
        ("s", "Sine"),
        ("w", "Pulse"),
        ("r", "Ramp"),
        ("u", "step(1, 0, 5)"),
    ] {
        assert_eq!(algebraic(&graph, name), law, "{name}");
    }
    let SignalLaw::Waveform(Waveform::Sine { phase, .. }) = &signal(&graph, "s").law else {
        panic!()
    };
    assert_eq!(phase.as_number(), Some(std::f64::consts::FRAC_PI_2));
    assert_eq!(signal(&graph, "c_step2").origin, SignalOrigin::Hidden);
    let columns: Vec<&str> = graph.experiment.observe.iter().map(|o| o.name.as_str()).collect();
    assert_eq!(columns, ["u", "a", "b", "c", "c_step", "d", "g", "s", "w", "r", "f(m)"]);
}

#[test]
fn memories() {
    let graph = graph(&around(
        "param T = 3 ms\nsignal a = sample(f(m), T)\nsignal b = delay(2*a, T) + 1\nsignal c = hysteresis(b, -1, T)\n\
         signal g = rate(f(m), 2, 3, 1 ms)\nsignal h = noise(7, 0.1, T)\nsimulate until 2 s\nsignal r = rate(f(m), 1, 1)",
    ));
    for (name, law) in [
        ("a", "sample T of f(U -> m)"),
        ("b_delay_in", "(2*a)"),
        ("b_delay", "delay T of b_delay_in"),
        ("b", "(b_delay+1)"),
        ("c", "hysteresis -1 T of b"),
        ("g_z", "integ(((g-g_z)/0.001), implied)"),
        ("g", "(g_z+clamp((f(U -> m)-g_z),-(0.001*3),(0.001*2)))"),
        ("h", "Noise"),
        ("r_z", "integ(((r-r_z)/0.000002), implied)"),
    ] {
        assert_eq!(algebraic(&graph, name), law, "{name}");
    }
}

#[test]
fn transfer_functions_are_chains_of_the_size_of_their_input() {
    let graph = graph(&around(
        "param T = 2 s\nsignal a = tf([1e20], [1e20, 3e20, 2e20], f(m))\nsignal b = tf([3], [T, 1], f(m))\n\
         signal c = tf([1, 2], [2], f(m)*0 + time)\nsignal k = tf([2], [4, 0, 0], f(m))",
    )
    .replace("signal c = tf([1, 2], [2], f(m)*0 + time)", "signal c = tf([1, 2], [1, 0, 4], time)"));
    for (name, law) in [
        ("a_x1", "integ((0.6666666666666666*a_x2), 0)"),
        ("a_x2", "integ((3*((f(U -> m)-a_x1)-a_x2)), 0)"),
        ("a", "(0.5*a_x1)"),
        ("b_x1", "integ((0.5*(f(U -> m)-(((1/T)/0.5)*b_x1))), 0)"),
        ("b", "(((3/T)/0.5)*b_x1)"),
        ("c_x1", "integ((2*c_x2), 0)"),
        ("c_x2", "integ((2*(time-c_x1)), 0)"),
        ("c", "((0.5*c_x1)+(0.5*c_x2))"),
        ("k_x1", "integ(k_x2, 0)"),
        ("k", "(0.5*k_x1)"),
    ] {
        assert_eq!(algebraic(&graph, name), law, "{name}");
    }
}

/// A table that reads `points.csv` with this content.
fn with_file(content: &str) -> Built {
    beside_file(&around("signal y = table(f(m), file(\"points.csv\"))"), content)
}

fn beside_file(text: &str, content: &str) -> Built {
    let mut map = SourceMap::default();
    let file = map.add("models/test.bg", text);
    map.add("models/points.csv", content);
    let mut d = vec![];
    let program = load(&mut map, file, &[], &mut d);
    let graph = elaborate(&program, &map, &Overrides::default(), &mut d);
    Built { graph, d, map }
}

#[test]
fn columns_of_files_have_units() {
    let text =
        "Se:U(1 V) -> 1:m -> R:r(1 Ohm)\nsignal y = table(f(m), file(\"points.csv\")) + 3 bar\n";
    for content in ["i [mA], p [bar]\n0,1\n1,2\n", "i, p\n0,1\n1,2\n", "0,1\n1,2\n"] {
        assert_eq!(beside_file(text, content).lines(), [""; 0], "{content}");
    }
    for (header, line) in [
        (
            "t [ms], p [bar]",
            "E0306 `file(\"points.csv\")`: `table` mixes a time (s) and a current (A)",
        ),
        ("i [A], v [V]", "E0304 `3 bar`: a pressure (Pa) is added to a voltage (V)"),
    ] {
        let built = beside_file(text, &format!("{header}\n0,1\n1,2\n"));
        let lines = built.lines();
        assert!(matches!(lines.as_slice(), [only] if only.starts_with(line)), "{lines:?}");
    }
}

#[test]
fn tables_from_files() {
    for content in [
        "0,1\n1,2.5\n4,-1e3\n",
        "x, y\r\n0;1\r\n1;2.5\r\n4;-1e3",
        "# points\n\n\"x [m]\"\ty\n0 1\n 1\t 2.5\n4   -1e3\n",
    ] {
        let built = with_file(content);
        assert_eq!(built.d, [], "{content}");
        let graph = built.graph.unwrap();
        let SignalLaw::Algebraic(law) = &signal(&graph, "y").law else { panic!() };
        let Node::Table(_, table) = &*law.node else { panic!() };
        assert_eq!((&table.x[..], &table.y[..]), (&[0.0, 1.0, 4.0][..], &[1.0, 2.5, -1e3][..]));
    }
    let scaled = with_file("x [mm], y [bar]\n0,1\n1000,2\n").graph.unwrap();
    let SignalLaw::Algebraic(law) = &signal(&scaled, "y").law else { panic!() };
    let Node::Table(_, table) = &*law.node else { panic!() };
    assert_eq!((&table.x[..], &table.y[..]), (&[0.0, 1.0][..], &[1e5, 2e5][..]));
    for (content, error, line) in [
        ("x,y\n", "E0252", 1),
        ("0,1\n2\n", "E0252", 2),
        ("0,1\n1,2,3\n", "E0252", 2),
        ("0,1\n\n1,two\n", "E0252", 3),
        ("0,1\n1,inf\n", "E0252", 2),
        ("0,1\n0,2\n", "E0251", 2),
        ("0,1\n-1,2\n", "E0251", 2),
        ("x [nix], y\n0,1\n", "E0252", 1),
    ] {
        let built = with_file(content);
        assert_eq!(built.d.len(), 1, "{content}: {:?}", built.lines());
        let at = built.map.position(built.d[0].labels[0].span).unwrap();
        assert_eq!((built.d[0].code, at.0), (error, line), "{content}");
    }
}

#[test]
fn waveforms_within_elements_are_hidden_signals() {
    let graph = graph("Se:U(2*step(1, 0, 5)) -> R:r(1)");
    assert_eq!(law_of(&graph, "U"), "Effort (2*U_step)");
    let alone = self::graph("Se:U(step(1, 0, 5)) -> R:r(1)");
    assert_eq!(law_of(&alone, "U"), "Effort U_step");
    assert_eq!(algebraic(&alone, "U_step"), "step(1, 0, 5)");
}

#[test]
fn ready_laws_are_what_the_reference_says() {
    let graph = graph(
        "Sf:u(time) -> 0:m -> R:a(f = orifice(e, 2, 0.5)), R:b(f = check(e, 1, 10, 0.2)), \
         R:c(f = relief(e, 3, 1, 50, 0.1)), R:d(f = table(e, [0, 0; 1, 2; 3, 2]))\n1:n -> R:k(e = coulomb(f, 2, 0.1)), m",
    );
    let at = |name: &str, x: f64| {
        let Law::Dissipator(Dissipation::Flow(law) | Dissipation::Effort(law)) =
            &vertex(&graph, name).law
        else {
            panic!()
        };
        law.evaluate(&mut |_| x)
    };
    // Far out the soft corner of `relief` is the straight line, and nothing overflows.
    for x in [1e300, -1e300f64] {
        let line = x / 50.0 + (x - 3.0 * x.signum());
        assert!((at("c", x) / line - 1.0).abs() < 1e-12, "{x}");
    }
    for x in [-50.0, -3.0, -0.1, 0.0, 0.3, 2.0, 80.0f64] {
        // Δp = C²·Q·√(Q² + Q0²)
        let q = at("a", x);
        assert!((4.0 * q * (q * q + 0.25).sqrt() - x).abs() < 1e-12 * (1.0 + x.abs()));
        let check = x * (0.1 + 0.9 * (1.0 + (x / 0.2).tanh()) / 2.0);
        assert!((at("b", x) - check).abs() < 1e-12 * (1.0 + x.abs()));
        let soft = |z: f64| {
            if z > 0.0 { z + 0.1 * (-z / 0.1).exp().ln_1p() } else { 0.1 * (z / 0.1).exp().ln_1p() }
        };
        let relief = x / 50.0 + soft(x - 3.0) - soft(-x - 3.0);
        assert!((at("c", x) - relief).abs() < 1e-12 * (1.0 + x.abs()), "{x}");
        assert!((at("k", x) - 2.0 * (x / 0.1).tanh()).abs() < 1e-12);
    }
    assert_eq!([-1.0, 0.5, 2.0, 9.0].map(|x| at("d", x)), [0.0, 1.0, 2.0, 2.0]);
}

#[test]
fn parameters_in_any_order() {
    let graph = graph(&around("param a = 2*b\nparam b = c + 1; param c = 3\nparam pi2 = 2*pi"));
    let values: Vec<f64> = graph.parameters.iter().map(|p| p.value).collect();
    assert_eq!(values, [8.0, 4.0, 3.0, 2.0 * std::f64::consts::PI]);
    assert_eq!(spell(&graph, &graph.parameters[0].expr), "(2*b)");
    // A chain as long as a file may be.
    let mut text = around("");
    for k in 0..5000 {
        text += &format!("param x{k} = x{} + 1\n", k + 1);
    }
    text += "param x5000 = 0\n";
    assert_eq!(self::graph(&text).parameters[0].value, 5000.0);
}

#[test]
fn overrides_of_the_command_line() {
    let text = around(
        "param L = 1 mH; param k = 2*L; input u\ndrive u = 1\nsimulate until 1 s step 1 ms\n\
         options reltol = 1e-5, hmax = 10 us, method = trbdf2\nobserve f(m)",
    );
    let overrides = Overrides {
        set: vec![("L".into(), "2mH".into())],
        drive: vec!["u = step(0.1 s, 0 mm, 20 mm)".into()],
        observe: Some("u in mm, e(U) as \"volts\"".into()),
        until: Some("2s".into()),
        step: Some("5 ms".into()),
        options: vec![("reltol".into(), "1e-8".into())],
        ..Overrides::default()
    };
    let built = build_with(&text, &overrides);
    assert_eq!(built.d, []);
    let graph = built.graph.unwrap();
    assert_eq!(graph.parameters[1].value, 4e-3);
    assert_eq!(algebraic(&graph, "u"), "step(0.1, 0, 0.02)");
    let run = &graph.experiment;
    assert_eq!((run.until, run.step), (Some(2.0), Some(5e-3)));
    let options: Vec<(&str, &str)> =
        run.options.iter().map(|(k, v)| (k.as_str(), v.as_str())).collect();
    assert_eq!(
        options,
        [("reltol", "1e-5"), ("hmax", "0.00001"), ("method", "trbdf2"), ("reltol", "1e-8")]
    );
    let names: Vec<&str> = run.observe.iter().map(|o| o.name.as_str()).collect();
    assert_eq!(names, ["u", "volts"]);

    let wrong = Overrides {
        set: vec![
            ("l".into(), "2mH".into()),
            ("L".into(), "2 V".into()),
            ("L".into(), "2 bananas".into()),
            ("u".into(), "2".into()),
        ],
        drive: vec!["v = 1".into(), "u = step(".into()],
        observe: Some("f(n)".into()),
        until: Some("-1 s".into()),
        ..Overrides::default()
    };
    let built = build_with(&text, &wrong);
    let codes: Vec<&str> = built.d.iter().map(|d| d.code).collect();
    assert_eq!(
        codes,
        ["E0301", "E0223", "E0223", "E0226", "E0219", "E0104", "E0303", "E0206"],
        "\n{}",
        built.lines().join("\n")
    );
    assert!(built.d[1].help.as_ref().unwrap().contains("`L`"));
    assert!(built.d[0].notes[0].contains("L=2 bananas"));
}

#[test]
fn observe_all_and_the_list() {
    let graph = graph(
        "Se:U(10 V) -> 1:m -> GY:g(1 V*s) -> 1:w -> I:J(1 kg*m^2)\nm -> R:r(1 Ohm)\nsignal x = integ(f(w))\nobserve all",
    );
    let names: Vec<(&str, &str)> =
        graph.experiment.observe.iter().map(|o| (o.name.as_str(), o.si_unit.as_str())).collect();
    let expected = [
        ("x", ""),
        ("f(m)", "A"),
        ("f(w)", "rad/s"),
        ("p(J)", "N*m*s"),
        ("e(U)", "V"),
        ("f(U)", "A"),
        ("power(U)", "W"),
        ("e(g.1)", "V"),
        ("f(g.1)", "A"),
        ("power(g.1)", "W"),
        ("e(g.2)", "N*m"),
        ("f(g.2)", "rad/s"),
        ("power(g.2)", "W"),
        ("e(J)", "N*m"),
        ("f(J)", "rad/s"),
        ("power(J)", "W"),
        ("e(r)", "V"),
        ("f(r)", "A"),
        ("power(r)", "W"),
    ];
    assert_eq!(names, expected);
    assert_eq!(observables(&graph).len(), 19);
}

#[test]
fn headers_are_the_text_without_blanks() {
    let graph = graph(&around("observe 2 * f( m ) - 1, # a comment\n  e( U ->\n m)"));
    let names: Vec<&str> = graph.experiment.observe.iter().map(|o| o.name.as_str()).collect();
    assert_eq!(names, ["2*f(m)-1", "e(U->m)"]);
}

#[test]
fn domains_without_units_are_open() {
    let graph = graph("Se:U(10) -> 1:m -> R:r(1)\nm -> TF:t(2) -> R:q(1 Ohm)");
    let domains: Vec<Domain> = graph.bonds.iter().map(|bond| bond.domain).collect();
    assert_eq!(domains, [Domain::Any, Domain::Any, Domain::Any, Domain::Electrical]);
    let rack = self::graph("Sf:v(1 m/s) -> TF:pinion(gain = 0.1 m) -> R:w(1)");
    assert_eq!(rack.bonds[1].domain, Domain::Rotation);
    let heat = self::graph("Sf:h(1 W) -> 0:T -> C:m(3 J/K), R:wall(1 K/W)");
    assert!(heat.bonds.iter().all(|bond| bond.domain == Domain::PseudoThermal));
    // What two domains share waits for what one has alone.
    let wall = self::graph("Se:hot(300 K) -> 1:m -> R:wall(1 K/W)\nobserve f(wall) in W");
    assert!(wall.bonds.iter().all(|bond| bond.domain == Domain::PseudoThermal));
    let entropy = self::graph("Se:hot(300 K) -> 1:m -> R:wall(1)");
    assert!(entropy.bonds.iter().all(|bond| bond.domain == Domain::Thermal));
}

#[test]
fn undriven_inputs() {
    let built = errors(&around("input u\nsignal x = u + 1"), &["W0201 u"]);
    let graph = built.graph.unwrap();
    assert_eq!(graph.experiment.undriven, [SignalId(0)]);
    assert_eq!(algebraic(&graph, "u"), "0");
    let mut d = built.d;
    require_drives(&graph, &mut d);
    assert_eq!(d.iter().map(|d| d.code).collect::<Vec<_>>(), ["E0227"]);
}

#[test]
fn several_errors_in_one_go() {
    let built = errors(
        "Se:U(10 V) -> 1:mesh\n\
         mesh -> I:L(1 mHy), R:R(Rr), C:C\n\
         param Rx = 2 Ohm\n\
         signal x = integ(f(mehs)\n\
         signal y = f(mseh)\n\
         simulate until 20 ms step 10 us\n",
        &["E0301 mHy", "E0104 (", "E0206 mseh"],
    );
    assert!(built.d[0].help.as_ref().unwrap().contains("mH"));
    assert!(built.d[2].help.as_ref().unwrap().contains("`mesh`"));
}

#[test]
fn names() {
    errors(&around("param x = 1\nparam x = 2"), &["E0203 x"]);
    errors(&around("param x = 1\nsignal x = 2"), &["E0203 x"]);
    let twice = errors("Se:U(1) -> 1:m -> R:r(1)\n1:m -> C:c(1)", &["E0203 1:m"]);
    assert_eq!(twice.mended(), "Se:U(1) -> 1:m -> R:r(1)\nm -> C:c(1)");
    errors(&around("param e = 1"), &["E0205 e"]);
    let near = errors("Se:U(1) -> 1:mesh -> R:r(1)\nC:c(1) -> mes", &["E0206 mes"]);
    assert_eq!(near.mended(), "Se:U(1) -> 1:mesh -> R:r(1)\nC:c(1) -> mesh");
    errors(&around("signal y = r"), &["E0208 r"]);
    errors(&around("param Phi = 1\nsignal y = phi"), &["E0208 phi"]);
    errors(&around("r(2) -> m"), &["E0209 2", "E0402 r"]);
    errors("S:U(1) -> R:r(1)", &["E0204 S"]);
    errors("X:U(1) -> R:r(1)", &["E0204 X"]);
    // Elements have names of their own, statement words and reserved words among them.
    graph(
        "Se:input(1) -> 1:e -> R:param(1), C:time(2)\ne -> output.1; TF:output(1) -> R:q(1)\n\
         param R = 1; 1:x -> R:R, e",
    );
}

#[test]
fn values() {
    errors("Se:U(1) -> R:r", &["E0207 R:r"]);
    errors(&around("param a = 1/0"), &["E0213 1/0"]);
    errors(&around("param a = b; param b = 2*a"), &["E0212 a"]);
    errors(&around("param a = 2*a"), &["E0212 a"]);
    errors(&around("signal s = 1\nparam a = s + time"), &["E0211 s", "E0211 time"]);
    errors(&around("param a = f(m)"), &["E0211 f(m)"]);
    errors("Se:U(1) -> C:c(1, q0 = time)", &["E0211 time"]);
    errors("Se:U(1) -> C:c(1, q0 = 1, e0 = 2)", &["E0209 e0 = 2"]);
    errors("Se:U(1) -> C:c(1, p0 = 1)", &["E0209 p0"]);
    errors("Se:U(1) -> R:r(1, e = f)", &["E0209 1, e = f"]);
    errors("Se:U(1) -> R:r(e = e)", &["E0217 e"]);
    errors("Se:U(1) -> R:r(1 + f^2)", &["E0217 f"]);
    errors("Se:U(2*f) -> R:r(1)", &["E0217 f"]);
    errors("Se:U(1) -> R:r([1, 2; 2, 3])", &["E0409 r"]);
    errors("IC:U(1) -> R:r(1)", &["E0209 1"]);
    errors("Se:U(1) -> 1:m(3) -> R:r(1)", &["E0209 3"]);
    errors("Se:U(1) -> C:c(der(e) = f, q0 = 1)", &["E0209 1"]);
    errors("Se:U(1) -> TF:t(gian = 2) -> R:r(1)", &["E0209 gian"]);
}

#[test]
fn structure() {
    errors("Se:U(1) -> R:r(1), R:s(1)", &["E0402 U"]);
    errors("Se:U(1) -> 0:m\nm -> Se:V(1)\nU -> m", &["E0402 U"]);
    errors("Se:U(1) -> TF:t(2)", &["E0403 TF:t(2)"]);
    errors("Se:U(1) -> 1:m", &["E0401 1:m"]);
    errors("Se:U(1) -> R:r(1)\nC:c(1)", &["E0403 C:c(1)"]);
    errors("Se:U(1) -> Se:V(2)", &["E0404 Se:U(1) -> Se:V(2)"]);
    errors("Sf:U(1) -> De:V", &["E0404 Sf:U(1) -> De:V"]);
    errors("Se:U(1) -> 1:m -> R:r(1)\nm -> m", &["E0405 m -> m"]);
    errors("Se:U(1) -> t.3\nTF:t(2) -> R:r(1)", &["E0410 3"]);
    errors("Se:U(1) -> r.1\nR:r(1)", &["E0410 1"]);
    let ports = errors("Se:U(1) -> t\nTF:t(2)\nR:r(1) -> t", &["E0409 t"]);
    assert_eq!(ports.mended(), "Se:U(1) -> t.1\nTF:t(2)\nR:r(1) -> t.2");
    errors("Se:U(1) -> t.1\nTF:t(2)\nR:r(1) -> t.1", &["E0409 t.1"]);
    errors("Se:U(1) -> TF:t(2) -> R:r(1)\nR:s(1) -> t", &["E0402 t"]);
    errors("Se:U(1) -> t.1 -> R:r(1)\nTF:t(2)", &["E0409 t.1"]);
}

#[test]
fn readings() {
    let one = errors("Se:U(1) -> 1:m -> R:r(1)\nsignal x = e(m)", &["E0214 e(m)"]);
    assert_eq!(one.d[0].help.as_deref(), Some("read one of its bonds: `e(U -> m)`, `e(m -> r)`"));
    errors("Se:U(1) -> 0:m -> R:r(1)\nsignal x = power(m)", &["E0214 power(m)"]);
    errors(&around("signal x = q(r)"), &["E0214 q(r)"]);
    errors("Se:U(1) -> TF:t(1) -> R:r(1)\nsignal x = e(t)", &["E0214 e(t)"]);
    let turned = errors(&around("signal x = e(m -> U)"), &["E0215 e(m -> U)"]);
    assert!(turned.mended().contains("e(U -> m)"));
    errors(&around("signal x = e(U -> r)"), &["E0215 e(U -> r)"]);
    errors("Se:U(1) -> 0:m -> 1:n -> R:r(1)\nm -> n\nsignal x = f(m -> n)", &["E0215 f(m -> n)"]);
    errors(&around("signal x = e(2 + 3)"), &["E0214 e(2 + 3)"]);
    errors(&around("signal x = e(nobody)"), &["E0206 nobody"]);
}

#[test]
fn functions_and_signals() {
    for (call, at) in [
        ("sample(f(m), 0)", "0"),
        ("delay(f(m), -1 ms)", "-1 ms"),
        ("delay(f(m), 0)", "0"),
        ("rate(f(m), 0, 1)", "0"),
        ("rate(f(m), 1, -1)", "-1"),
        ("hysteresis(f(m), 2, 1)", "hysteresis(f(m), 2, 1)"),
        ("hysteresis(f(m), 1, 1)", "hysteresis(f(m), 1, 1)"),
        ("noise(1.5, 1, 1 ms)", "1.5"),
        ("noise(-1, 1, 1 ms)", "-1"),
        ("noise(1, -1, 1 ms)", "-1"),
        ("noise(1, 1, 0)", "0"),
        ("pwm(0.5, 0)", "0"),
        ("pwm(0.5, -2*1)", "-2*1"),
        ("lag(f(m), 0)", "0"),
        ("der(f(m), -1 s)", "-1 s"),
        ("leadlag(f(m), 1, 0)", "0"),
        ("pid(f(m), Kp = 1, Kd = 1, tau = 0)", "0"),
        ("pulse(0, 1, 0, 0, 0, -1, 2)", "-1"),
    ] {
        errors(&around(&format!("signal x = {call}")), &[&format!("E0250 {at}")]);
    }
    errors(&around("signal x = pid(f(m), Kp = 1, Kd = 1)"), &["E0216 pid(f(m), Kp = 1, Kd = 1)"]);
    errors(&around("signal x = pid(f(m), lo = 1)"), &["E0216 pid(f(m), lo = 1)"]);
    errors(&around("signal x = pwm(0.5, time)"), &["E0211 time"]);
    errors(&around("signal x = tf([1, 2, 3], [1, 2], f(m))"), &["E0216 [1, 2, 3]"]);
    errors(&around("signal x = tf([1], [0, 0], f(m))"), &["E0216 [0, 0]"]);
    errors(&around("signal x = tf([1; 2], [1, 1], f(m))"), &["E0216 [1; 2]"]);
    errors(&around("signal x = tf(1, 2, f(m))"), &["E0216 tf(1, 2, f(m))"]);
    errors(&around("signal x = tf([time], [1, 1], f(m))"), &["E0211 time"]);
    let near = errors(&around("signal x = leadlg(f(m), 1, 1)"), &["E0210 leadlg"]);
    assert_eq!(near.d[0].notes, ["its form is `leadlag(x, t_lead, t_lag)`"]);
    errors(&around("signal x = file(\"a.csv\")"), &["E0901 \"a.csv\"", "E0210 file"]);
    errors(&around("signal x = itneg(f(m))"), &["E0210 itneg"]);
    errors(&around("signal x = lag(f(m))"), &["E0216 lag(f(m))"]);
    errors(&around("signal x = pi(f(m), kp = 2)"), &["E0216 kp = 2"]);
    errors(&around("signal x = pi(f(m))"), &["E0216 pi(f(m))"]);
    errors(&around("signal x = pwl(0, 1; 2)"), &["E0216 2"]);
    errors(&around("signal x = pwl(1, 1; 0, 2)"), &["E0216 0"]);
    errors(&around("signal x = step(time, 0, 1)"), &["E0211 time"]);
    errors(&around("signal x = table(time, [1, 2; 0, 1])"), &["E0251 0"]);
    errors(&around("signal x = table(time, file(\"a.csv\"))"), &["E0901 \"a.csv\""]);
    let ring = errors(&around("signal a = b + 1\nsignal b = 2*c\nsignal c = a"), &["E0408 a"]);
    assert_eq!(ring.d[0].notes, ["the loop is `a` → `b` → `c` → `a`"]);
    errors(&around("signal a = a"), &["E0408 a"]);
    // A memory breaks a loop.
    graph(&around("signal a = b + 1\nsignal b = lag(a, 1 s)"));
    errors(&around("input u\ndrive u = 1\ndrive u = 2"), &["E0220 u"]);
    errors(&around("param u = 1\ndrive u = 1"), &["E0219 u"]);
    errors(&around("output y"), &["E0224 y"]);
    errors(&around("observe f(m), f(m) in A"), &["E0221 f(m) in A"]);
    errors(&around("observe integ(f(m))"), &["E0225 integ(f(m))"]);
    errors("Se:U(1 V) -> R:r(1)\nobserve e(U) in bar", &["E0303 bar"]);
    errors(&around("simulate until 0"), &["E0226 0"]);
    errors(&around("simulate until 3 V"), &["E0303 3 V"]);
    errors(&around("simulate until 1\nsimulate until 2"), &["E0220 simulate until 2"]);
}

#[test]
fn reciprocals_become_gains_only_where_they_vary() {
    let graph = graph(
        "input u; drive u = 1; param k = 2\n\
         1:m -> TF:a(1/u) -> R:ra(1); m -> TF:b(1/k) -> R:rb(1); m -> TF:c(u/(u + 1)) -> R:rc(1)\n\
         m -> TF:d(-k/time) -> R:rd(1); m -> GY:g(r = 1/u) -> R:rg(1); m -> TF:h(k*1/u) -> R:rh(1)\n\
         m -> TF:i(1/f(m)) -> R:ri(1)",
    );
    for (name, law) in [
        ("a", "TF gain u"),
        ("b", "TF ratio (1/k)"),
        ("c", "TF ratio (u/(u+1))"),
        ("d", "TF gain (time/-k)"),
        ("g", "GY gain u"),
        ("h", "TF gain (u/(k*1))"),
        ("i", "TF gain f(m -> a)"),
    ] {
        assert_eq!(law_of(&graph, name), law, "{name}");
    }
}
