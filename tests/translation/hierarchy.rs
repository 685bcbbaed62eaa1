//! Models, instances, arrays and imports mean the flat graphs that one would write by hand.

use bondspice::bond::causality;
use bondspice::bond::elaborate::{self, Overrides};
use bondspice::bond::graph::BondGraph;
use bondspice::cli::pipeline::run_text;
use bondspice::diagnostic::Diagnostic;
use bondspice::source::{FileId, SourceMap};
use bondspice::trace::Trace;

fn graph_with(text: &str, overrides: &Overrides) -> Result<BondGraph, Vec<Diagnostic>> {
    let mut map = SourceMap::default();
    let file = map.add("test.bg", text);
    built(&mut map, file, overrides)
}

fn built(
    map: &mut SourceMap,
    file: FileId,
    overrides: &Overrides,
) -> Result<BondGraph, Vec<Diagnostic>> {
    let mut d = vec![];
    let program = elaborate::load(map, file, &overrides.folders, &mut d);
    match elaborate::elaborate(&program, map, overrides, &mut d) {
        Some(graph) if d.is_empty() => Ok(graph),
        _ => Err(d),
    }
}

fn graph(text: &str) -> BondGraph {
    graph_with(text, &Overrides::default()).unwrap_or_else(|d| panic!("{d:?}\n{text}"))
}

fn run(text: &str) -> Trace {
    run_text("test.bg", text, &Overrides::default()).unwrap_or_else(|d| panic!("{d:?}\n{text}")).0
}

/// Every bond in words, sorted.
fn bonds(graph: &BondGraph) -> Vec<String> {
    let mut bonds: Vec<String> = graph.bond_ids().map(|bond| graph.bond_name(bond)).collect();
    bonds.sort();
    bonds
}

/// The largest difference of two traces' columns, as a part of each one's range.
fn apart(a: &Trace, b: &Trace) -> f64 {
    assert_eq!(a.names.len(), b.names.len());
    let mut worst: f64 = 0.0;
    for (a, b) in a.columns.iter().zip(&b.columns) {
        assert_eq!(a.len(), b.len());
        let high = a.iter().cloned().fold(f64::MIN, f64::max);
        let low = a.iter().cloned().fold(f64::MAX, f64::min);
        for (a, b) in a.iter().zip(b) {
            worst = worst.max((a - b).abs() / (high - low).max(f64::MIN_POSITIVE));
        }
    }
    worst
}

const MOTOR: &str = "model DcMotor(L = 1.2 mH, R = 0.1 Ohm, Phi = 0.5 V*s, Jmp, fmp = 1e-3 N*m*s) {
  port in  supply : electrical
  port out shaft  : rotation
  supply -> 1:armature -> GY:Phi -> 1:rotor -> shaft
  armature -> I:L, R:R
  rotor -> I:Jmp, R:fmp
  signal i = f(armature)
  output i
}
";

#[test]
fn a_model_is_the_graph_that_it_holds() {
    let run_line = "simulate until 0.1 s step 1 ms\n";
    let inside = run(&format!(
        "{MOTOR}DcMotor:motor(Jmp = 2e-3 kg*m^2)\nSe:U(270 V) -> motor.supply\n\
         motor.shaft -> R:load(0.05 N*m*s)\n{run_line}\
         observe f(motor.rotor), e(motor.supply), f(motor.shaft), power(motor.shaft), motor.i, p(motor.L)\n"
    ));
    let flat = run(&format!(
        "param L = 1.2 mH; param R = 0.1 Ohm; param Phi = 0.5 V*s\n\
         Se:U(270 V) -> 1:armature -> GY:Phi -> 1:rotor -> R:load(0.05 N*m*s)\n\
         armature -> I:L, R:R\nrotor -> I:Jmp(2e-3 kg*m^2), R:fmp(1e-3 N*m*s)\n\
         signal i = f(armature)\n{run_line}\
         observe f(rotor), e(U), f(rotor -> load), power(rotor -> load), i, p(L)\n"
    ));
    // The same equations; a subcircuit puts devices into another order, which rounding shows.
    let apart = apart(&flat, &inside);
    assert!(apart < 1e-9, "{apart:e}");
}

#[test]
fn a_port_makes_one_bond_of_two_arrows() {
    let graph = graph(&format!(
        "{MOTOR}Se:U(270 V) -> DcMotor:m(Jmp = 1 kg*m^2) -> 1:load -> R:r(1 N*m*s)\n\
         load -> I:J(1 kg*m^2)\n"
    ));
    assert_eq!(
        bonds(&graph),
        [
            "U -> m.armature",
            "load -> J",
            "load -> r",
            "m.Phi -> m.rotor",
            "m.armature -> m.L",
            "m.armature -> m.Phi",
            "m.armature -> m.R",
            "m.rotor -> load",
            "m.rotor -> m.Jmp",
            "m.rotor -> m.fmp",
        ]
    );
    let names: Vec<&str> = graph.parameters.iter().map(|p| p.name.as_str()).collect();
    assert_eq!(names, ["m.L", "m.R", "m.Phi", "m.Jmp", "m.fmp"]);
}

#[test]
fn ports_lead_through_any_number_of_models() {
    let graph = graph(
        "model Inner(r) {\n port in a\n port out b\n a -> 1:j -> b\n j -> R:r\n}\n\
         model Outer(r) {\n port in a\n port out b\n a -> Inner:first(r = r) -> Inner:second(r = 2*r) -> b\n}\n\
         model Wire { port in a; port out b; a -> b }\n\
         Se:U(1) -> Outer:o(r = 3) -> Wire:w -> R:load(1)\n",
    );
    assert_eq!(
        bonds(&graph),
        [
            "U -> o.first.j",
            "o.first.j -> o.first.r",
            "o.first.j -> o.second.j",
            "o.second.j -> load",
            "o.second.j -> o.second.r",
        ]
    );
    let value = |name: &str| graph.parameters.iter().find(|p| p.name == name).unwrap().value;
    assert_eq!((value("o.r"), value("o.first.r"), value("o.second.r")), (3.0, 3.0, 6.0));
}

/// A resistive ladder: the current that a source of 1 V sends into N cells.
fn ladder(cells: usize) -> f64 {
    // From the far end: r beside the load, then always 1 Ω in series and 2 Ω beside it.
    let mut resistance = 2.0;
    for _ in 0..cells {
        resistance = 1.0 + 1.0 / (1.0 / 2.0 + 1.0 / resistance);
    }
    1.0 / resistance
}

const LADDER: &str = "param N = 4\nmodel Cell(r, g) {\n port in a\n port out b\n a -> 1:j -> 0:n -> b\n \
     j -> R:r\n n -> R:g\n}\n\
     Se:U(1 V) -> cell[1]\nfor k in 1..N { Cell:cell[k](r = 1, g = 2) }\n\
     for k in 1..N-1 { cell[k] -> cell[k+1] }\ncell[N] -> R:load(2)\n\
     signal all = sum(k in 1..N, f(cell[k].j))\nsimulate until 1 s step 1 s\nobserve f(cell[1].j), all\n";

#[test]
fn arrays_have_as_many_instances_as_a_parameter_says() {
    for cells in [1, 4, 40] {
        let overrides =
            Overrides { set: vec![("N".into(), cells.to_string())], ..Overrides::default() };
        let (trace, _) = run_text("test.bg", LADDER, &overrides).unwrap();
        let current = trace.columns[1][0];
        assert!((current - ladder(cells)).abs() < 1e-12, "{cells}: {current}");
    }
    // Half of the current goes on at each cell of this ladder, which is matched: 1/2 + 1/4 + 1/8 + 1/16.
    assert!((run(LADDER).columns[2][0] - 0.9375).abs() < 1e-12);
}

#[test]
fn everything_can_have_an_index() {
    let graph = graph(
        "param N = 3\nfor k in 1..N {\n param r[k] = 10*k\n signal v[k] = e(n[k])\n input u[k]\n drive u[k] = k\n \
         Se:s[k](u[k]) -> 0:n[k] -> R:r[k]\n}\n\
         for i in 1..2 { for j in 1..2 { 1:grid[i, j]; Se:z[i,j](i + 10*j) -> grid[i,j] -> R:y[i,j](1) } }\n\
         if N > 2 { Se:extra(1) -> R:more(r[3]) } else { Se:none(1) -> R:nothing(1) }\n\
         signal third = v[N] + v[N-1]\n",
    );
    let names: Vec<&str> = graph.vertices.iter().map(|vertex| vertex.name.as_str()).collect();
    for name in ["s[1]", "n[3]", "r[2]", "grid[2,1]", "y[1,2]", "extra", "more"] {
        assert!(names.contains(&name), "{name} in {names:?}");
    }
    assert!(!names.contains(&"none"));
    let signals: Vec<&str> = graph.signals.iter().map(|signal| signal.name.as_str()).collect();
    assert!(signals.contains(&"u[2]") && signals.contains(&"v[3]") && signals.contains(&"third"));
    assert_eq!(graph.parameters[1].name, "r[1]");
    assert_eq!(graph.parameters[3].value, 30.0);
}

#[test]
fn instances_are_set_from_outside() {
    let text = format!(
        "{MOTOR}for k in 1..2 {{ Se:U[k](1 V) -> DcMotor:m[k](Jmp = k*1 kg*m^2); m[k] -> R:r[k](1 N*m*s) }}\n"
    );
    let set =
        |name: &str| Overrides { set: vec![(name.into(), "5".into())], ..Overrides::default() };
    let graph = graph_with(&text, &set("m[2].Jmp")).unwrap();
    let values: Vec<f64> =
        graph.parameters.iter().filter(|p| p.name.ends_with("Jmp")).map(|p| p.value).collect();
    assert_eq!(values, [1.0, 5.0]);
    let wrong = graph_with(&text, &set("m[3].Jmp")).unwrap_err();
    assert_eq!(wrong[0].code, "E0223");
}

#[test]
fn inputs_get_what_the_instance_or_the_model_says() {
    let text = "model Source {\n input u\n drive u = 3\n port out p\n Se:s(u) -> p\n}\n\
         Source:a(u = 2*x) -> R:ra(1)\nSource:b -> R:rb(1)\ninput x\ndrive x = 5\n\
         simulate until 1 s step 1 s\nobserve e(a.p), e(b.p)\n";
    let trace = run(text);
    assert_eq!((trace.columns[1][0], trace.columns[2][0]), (10.0, 3.0));
}

#[test]
fn files_are_models_too() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    std::fs::create_dir(path("lib")).unwrap();
    std::fs::write(
        path("lib/source.bg"),
        "import \"cells.bg\"\nparam U = 10 V\nport out p\nSe:U -> Cell:c -> p\nsimulate until 9 s\n",
    )
    .unwrap();
    std::fs::write(
        path("lib/cells.bg"),
        "model Cell(r = 1 Ohm) {\n port in a\n port out b\n a -> 1:j -> b\n j -> R:r\n}\n",
    )
    .unwrap();
    std::fs::write(path("main.bg"), "import \"source.bg\"\nsource:s(U = 20 V) -> R:load(3 Ohm)\n")
        .unwrap();
    let main = path("main.bg").to_string_lossy().into_owned();
    let mut map = SourceMap::default();
    let file = bondspice::source::loader::load(&main, &mut map).unwrap();
    let overrides = Overrides {
        folders: vec![path("lib").to_string_lossy().into_owned()],
        ..Overrides::default()
    };
    let graph = built(&mut map, file, &overrides).unwrap();
    assert_eq!(bonds(&graph), ["s.U -> s.c.j", "s.c.j -> load", "s.c.j -> s.c.r"]);
    assert_eq!(graph.parameters[0].value, 20.0);
    // What a file does when it is run itself is not the business of those that use it.
    assert_eq!(graph.experiment.until, None);
    // Without the folder the import is missing, and nothing else is complained of.
    let mut map = SourceMap::default();
    let file = bondspice::source::loader::load(&main, &mut map).unwrap();
    let d = built(&mut map, file, &Overrides::default()).unwrap_err();
    let codes: Vec<&str> = d.iter().map(|d| d.code).collect();
    assert_eq!(codes, ["E0230", "E0204"]);
}

#[test]
fn what_is_wrong_in_every_instance_is_said_once() {
    let text = "model Cell(r = 1 Ohm) {\n port in a\n a -> R:r(nothing)\n}\n\
         for k in 1..100 { Se:U[k](1) -> Cell:c[k] }\n";
    let d = graph_with(text, &Overrides::default()).unwrap_err();
    assert_eq!(d.len(), 1, "{d:?}");
    assert_eq!(d[0].code, "E0208");
}

#[test]
fn regulators_are_named_with_what_they_are_for() {
    let plant = "Se:U(v) -> 1:m -> R:r(1 Ohm)\nm -> I:L(1 H)\ninput ref\ndrive ref = 1 A\n\
         signal v = pi(ref - f(m), Kp = 1 Ohm, Ki = 2 Ohm/s)\n";
    let graph =
        graph(&format!("{plant}loop v: f(m) follows ref, bandwidth 20 rad/s, margin 60 deg\n"));
    let regulator = &graph.regulators[0];
    assert_eq!(graph.signals[regulator.signal.index()].name, "v");
    assert_eq!(regulator.bandwidth, Some(20.0));
    assert!((regulator.margin.unwrap() - std::f64::consts::FRAC_PI_3).abs() < 1e-15);
    let wrong = graph_with(
        &format!("{plant}signal w = 2*v\nloop w: f(m) follows ref\n"),
        &Overrides::default(),
    );
    assert_eq!(wrong.unwrap_err()[0].code, "E0242");
}

/// Cells of six elements each in an array of instances, as text.
fn cells(elements: usize) -> String {
    format!(
        "model Cell(L = 1 mH, C = 1 uF, r = 1 Ohm, g = 1 kOhm) {{\n port in a : electrical\n port out b : electrical\n \
         a -> 1:j -> 0:n -> b\n j -> I:L, R:r\n n -> C:C, R:g\n}}\nparam N = {}\nSe:U(1 V) -> cell[1]\n\
         for k in 1..N {{ Cell:cell[k](r = (1 + k/N)*1 Ohm) }}\nfor k in 1..N-1 {{ cell[k] -> cell[k+1] }}\n\
         cell[N] -> R:load(50 Ohm)\nobserve e(cell[N].n)\n",
        elements / 6
    )
}

#[test]
fn ten_thousand_elements_in_instances() {
    let graph = graph(&cells(10_000));
    assert_eq!(graph.vertices.len(), 1666 * 6 + 2);
    assert_eq!(graph.bonds.len(), 1666 * 6 + 1);
    let mut d = vec![];
    let causality = causality::assign(&graph, &mut d).unwrap();
    assert_eq!(d, []);
    assert_eq!(causality.states.len(), 2 * 1666);
}

#[test]
fn ports_of_instances_are_listed_and_observed() {
    let text = format!(
        "model Drive(Phi = 0.5 V*s) {{\n  port in a : electrical\n  port out b : rotation\n  DcMotor:motor(Jmp = 1 g*m^2, Phi = Phi)\n  a -> motor.supply\n  motor.shaft -> b\n}}\n\
         {MOTOR}Drive:x()\nSe:U(3 V) -> x.a\nx.b -> R:load(1 mN*m*s)\nsimulate until 10 ms step 1 ms\n"
    );
    let graph = graph(&text);
    let listed = elaborate::observables(&graph);
    let ports = ["x.a", "x.b", "x.motor.supply", "x.motor.shaft"];
    for port in ports {
        for (what, unit) in [("e", ["V", "N*m"]), ("f", ["A", "rad/s"]), ("power", ["W", "W"])] {
            let name = format!("{what}({port})");
            let found = listed.iter().find(|item| item.name == name);
            let electrical = port.ends_with('a') || port.ends_with("supply");
            let unit = unit[usize::from(!electrical)];
            assert_eq!(found.map(|item| item.si_unit.as_str()), Some(unit), "{name}");
        }
    }
    // Nothing is listed that cannot be observed under this name, and no port stores anything.
    assert!(listed.iter().all(|item| !ports.iter().any(|p| item.name == format!("q({p})"))));
    let all: Vec<&str> = listed.iter().map(|item| item.name.as_str()).collect();
    let overrides = Overrides { observe: Some(all.join(", ")), ..Overrides::default() };
    let observed = graph_with(&text, &overrides).unwrap();
    for (one, other) in listed.iter().zip(&observed.experiment.observe) {
        assert_eq!(one.name, other.name);
        assert_eq!(one.si_unit, other.si_unit, "{}", one.name);
    }
    assert_eq!(observed.experiment.observe.len(), listed.len());
}

#[test]
fn causal_warnings_of_a_model_name_its_instances() {
    let model = "model Two(J = 1 g*m^2) {\n  port in a : rotation\n  a -> 1:s -> I:one(J), I:two(2*J), R:r(1 N*m*s)\n}\n";
    let loops = "model Rings(Z = 1 Ohm) {\n  port in a : electrical\n  a -> 0:s -> R:one(Z), 1:t\n  t -> R:two(Z), R:three(Z)\n}\n";
    for (model, kind, code) in [(model, "Two", "W0401"), (loops, "Rings", "W0402")] {
        let source = if kind == "Two" { "Se" } else { "Sf" };
        let text = format!(
            "{model}{kind}:first()\n{source}:U(3) -> first\n{kind}:second()\n{source}:V(3) -> second\n"
        );
        let mut map = SourceMap::default();
        let file = map.add("test.bg", text);
        let graph = built(&mut map, file, &Overrides::default()).unwrap();
        let mut d = vec![];
        causality::assign(&graph, &mut d).unwrap();
        let used = |d: &Diagnostic| -> Vec<String> {
            let labels = d.labels.iter().filter(|label| label.of_use);
            labels.map(|l| format!("{}: {}", map.text(l.span), l.text)).collect()
        };
        let found: Vec<_> = d.iter().filter(|d| d.code == code).map(used).collect();
        assert_eq!(
            found,
            [
                [format!("{kind}:first(): in `first`, used here")],
                [format!("{kind}:second(): in `second`, used here")]
            ]
        );
        // One line of the model is one warning, however many instances there are.
        bondspice::diagnostic::merge_repeats(&mut d, 0);
        let merged: Vec<_> = d.iter().filter(|d| d.code == code).collect();
        assert_eq!(merged.len(), 1);
        assert!(merged[0].notes.iter().any(|note| note.contains("once more")));
    }
}

#[test]
fn parameters_of_a_header_may_be_described() {
    let text = "model M(L = 1 mH \"inductance; of the coil\", Z \"the load\") {\n  port in a\n  a -> 1:m -> I:L, R:Z\n}\n\
        M:x(Z = 2 Ohm)\nSe:U(1 V) -> x\n";
    let graph = graph(text);
    let described: Vec<_> =
        graph.parameters.iter().map(|p| (p.name.as_str(), p.description.as_str())).collect();
    assert_eq!(described, [("x.L", "inductance; of the coil"), ("x.Z", "the load")]);
}
