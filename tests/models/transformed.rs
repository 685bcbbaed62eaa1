//! Models rewritten by `transform`: the new text reads, is laid out, and does the same by another route.
//!
//! Linear models are compared by their transfer functions, at frequencies over the whole range: to 1e-8 of the largest
//! value, which leaves rounding a factor of 1e6. Runs of models that are not linear are made with reltol 1e-7 and compared
//! to 1e-5 of range, where 1e-6 is what two runs of one accuracy may differ by.

use bondspice::analysis::linear::linearise as linear_model;
use bondspice::analysis::point::{At, find};
use bondspice::analysis::response::response;
use bondspice::bond::elaborate::Overrides;
use bondspice::bond::syntax::format;
use bondspice::bond::transform::across::across;
use bondspice::bond::transform::lump::lump;
use bondspice::bond::transform::remove::without;
use bondspice::bond::transform::{Source, Trouble, Work};
use bondspice::cli::pipeline;
use bondspice::diagnostic::has_errors;
use bondspice::linear::Complex;
use bondspice::source::SourceMap;
use bondspice::trace::Trace;
use std::path::Path;

fn shipped(model: &str) -> String {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("models").join(model);
    std::fs::read_to_string(file).unwrap()
}

/// What some changes make of a text; it reads, has no errors and is laid out.
fn made(text: &str, change: &dyn Fn(&mut Work) -> Result<(), Trouble>) -> Result<String, Trouble> {
    let mut map = SourceMap::default();
    let file = map.add("model.bg", text);
    let mut d = vec![];
    let mut work = Work::begin(&mut map, file, &[], &mut d).unwrap_or_else(|| panic!("{d:?}"));
    change(&mut work)?;
    let new = work.source.text.clone();
    let file = map.add("new.bg", new.clone());
    pipeline::check(&mut map, file, &Overrides::default(), &mut d);
    assert!(!has_errors(&d), "{new}\n{d:?}");
    assert_eq!(new, format(&new), "laid out");
    Ok(new)
}

fn moved(
    what: &'static str,
    over: Option<&'static str>,
) -> impl Fn(&mut Work) -> Result<(), Trouble> {
    move |work| work.change(&|source| across(source, what, over))
}

/// A text without its comments.
fn code(text: &str) -> String {
    text.lines().filter(|line| !line.starts_with('#')).collect::<Vec<_>>().join("\n")
}

fn simplified(work: &mut Work) -> Result<(), Trouble> {
    work.simplify().map(|_| ())
}

/// The responses of all observed columns to one input, at frequencies from 1e-3 to 1e5 rad/s.
fn responses(text: &str, from: &str) -> Vec<Vec<Complex>> {
    let mut map = SourceMap::default();
    let file = map.add("model.bg", text);
    let mut d = vec![];
    let observe =
        |list: Option<&str>| Overrides { observe: list.map(String::from), ..Overrides::default() };
    let input = pipeline::graph(&mut map, file, &observe(Some(from)), &mut d);
    let input = input.unwrap_or_else(|| panic!("{d:?}")).experiment.observe;
    let graph = pipeline::graph(&mut map, file, &observe(None), &mut d).unwrap();
    let causality = pipeline::causality(&graph, &mut d).unwrap();
    let point = find(&graph, &causality, At::Start, &mut d).unwrap_or_else(|| panic!("{d:?}"));
    let linear = linear_model(&graph, &causality, &point, Some(&input), &mut d);
    let linear = linear.unwrap_or_else(|| panic!("{d:?}"));
    let frequencies: Vec<f64> = (-30..51).map(|k| 10f64.powf(f64::from(k) / 10.0)).collect();
    response(&linear, 0, &frequencies).unwrap().values
}

fn alike(before: &str, after: &str, from: &str) {
    let (a, b) = (responses(before, from), responses(after, from));
    assert_eq!(a.len(), b.len());
    for (k, (a, b)) in a.iter().zip(&b).enumerate() {
        let largest = a.iter().map(|z| z.re.hypot(z.im)).fold(0.0, f64::max);
        assert!(largest > 0.0, "column {k} says nothing");
        for (a, b) in a.iter().zip(b) {
            let error = (a.re - b.re).hypot(a.im - b.im);
            assert!(error <= 1e-8 * largest, "column {k}: {a:?} is not {b:?}\n{after}");
        }
    }
}

fn run(text: &str, reltol: &str, set: &[(&str, &str)]) -> Trace {
    let mut map = SourceMap::default();
    let file = map.add("model.bg", text);
    let overrides = Overrides {
        options: vec![("reltol".into(), reltol.into())],
        until: set.iter().find(|(key, _)| *key == "until").map(|(_, value)| value.to_string()),
        ..Overrides::default()
    };
    let mut d = vec![];
    let run = pipeline::prepare(&mut map, file, &overrides, None, &mut d);
    let run = run.unwrap_or_else(|| panic!("{d:?}"));
    let mut trace = run.trace();
    run.go(&mut trace).unwrap_or_else(|failure| panic!("{:?}", failure.diagnostic));
    trace
}

/// The largest difference of any column, in parts of its range.
fn difference(a: &Trace, b: &Trace) -> f64 {
    assert_eq!(a.names, b.names);
    let mut worst = 0.0f64;
    for (name, column) in b.names.iter().zip(&b.columns).skip(1) {
        let own = a.column(name).unwrap();
        assert_eq!(own.len(), column.len());
        let low = column.iter().copied().fold(f64::INFINITY, f64::min);
        let high = column.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        for (x, y) in own.iter().zip(column) {
            worst = worst.max((x - y).abs() / (high - low));
        }
    }
    worst
}

/// The actuator's end before Fig. 13: jack and surface still behind their transformers.
const BEFORE_FIG13: &str = "\
param beta = 0.8 GPa        \"fluid bulk modulus\"
param Vt   = 250 cm^3       \"mean chamber volume\"
param Chj  = 3e9 Pa*s/m^3   \"dilatation viscosity of a chamber\"
param S    = 38.57 cm^2     \"piston area\"
param Rmj  = 1e8 N/m        \"attachment stiffness\"
param Cmj  = 80 kN*s/m      \"attachment structural damping\"
param la   = 119 mm         \"lever arm\"
param J    = 25 kg*m^2      \"surface inertia\"
input v
# the jack is fed with Vj' = Qp/S
Sf:feed(v*S) -> 0:port -> TF:piston(1/S) -> 0:jack
port -> 1:chamber  # what the fluid gives
chamber -> C:fluid(Vt/(2*beta)), R:dilatation(2*Chj)
jack -> 1:rod -> 0:attachment -> 1:mount
mount -> C:stiffness(1/Rmj), R:Cmj
attachment -> TF:lever(1/la) -> 1:surface -> I:J
drive v = step(10 ms, 0 m/s, 0.1 m/s)
simulate until 0.1 s step 1 ms
observe f(surface), e(port), f(dilatation), e(J), q(fluid), f(rod)
";

#[test]
fn fig_13_comes_out_of_moving() {
    let after = made(BEFORE_FIG13, &|work| {
        moved("chamber", Some("piston"))(work)?;
        moved("J", None)(work)
    });
    let after = after.unwrap();
    // The user's own words, and the laws of the figure: C/S², 2·Chj·S², J/la².
    for line in [
        "param beta = 0.8 GPa       \"fluid bulk modulus\"",
        "# the jack is fed with Vj' = Qp/S",
        "jack    -> 1:chamber  # what the fluid gives",
        "chamber -> C:fluid(Vt/(2*beta)/S^2), R:dilatation(2*Chj*S^2)",
        "attachment -> I:J(J/la^2)",
    ] {
        assert!(after.contains(line), "{line}\n{after}");
    }
    alike(BEFORE_FIG13, &after, "v");
    // VT over Vj' is that of the shipped model, and the reference's polynomials.
    let shipped = shipped("eha_fig13.bg")
        .replace("D/S*f(shaft)", "v")
        .replace("input Ucvs", "input Ucvs\ninput v");
    let shipped =
        shipped.replace("drive Ucvs", "drive v = step(10 ms, 0 m/s, 0.1 m/s)\ndrive Ucvs");
    let column = |text: &str, item: &str| {
        let head: Vec<&str> = text
            .lines()
            .filter(|line| !line.starts_with("observe") && !line.starts_with("    "))
            .collect();
        responses(&format!("{}\nobserve {item}\n", head.join("\n")), "v").remove(0)
    };
    let (ours, theirs) = (column(&after, "f(J)"), column(&shipped, "f(surface)"));
    let frequencies = (-30..51).map(|k| 10f64.powf(f64::from(k) / 10.0));
    let top = [9.52092736e15, 1.65426113e13, 7.14069552e9, 0.0];
    let bottom = [9.52092736e15, 1.65426113e13, 3.51765499e11, 298811337.0];
    for ((ours, theirs), frequency) in ours.iter().zip(&theirs).zip(frequencies) {
        let error = (ours.re - theirs.re).hypot(ours.im - theirs.im);
        assert!(error <= 1e-8 * theirs.re.hypot(theirs.im));
        let w = std::f64::consts::TAU * frequency;
        let at = |p: [f64; 4]| Complex::new(p[0] - p[2] * w * w, p[1] * w - p[3] * w * w * w);
        let (top, bottom) = (at(top), at(bottom));
        let size = bottom.re * bottom.re + bottom.im * bottom.im;
        let wanted = Complex::new(
            (top.re * bottom.re + top.im * bottom.im) / size,
            (top.im * bottom.re - top.re * bottom.im) / size,
        );
        // The reference prints nine digits.
        let error = (ours.re - wanted.re).hypot(ours.im - wanted.im);
        assert!(error <= 1e-7 * wanted.re.hypot(wanted.im).max(1e-6), "{ours:?} is not {wanted:?}");
    }
}

/// A model with every element on both sides of a two-port, `X`, from 1- and from 0-junctions.
fn crossing(two_port: &str, sides: [&str; 2]) -> String {
    format!(
        "param r = 3\ninput u\nSe:U(u) -> 1:s -> R:Ri(2), I:Ls(0.5)\ns -> {}:a -> {two_port} -> {}:b\na -> R:Ra(5), C:Ca(0.1), I:La(0.3)\nb -> R:Rb(7), C:Cb(0.2), I:Lb(0.4)\n\
             b -> 0:far -> R:Rf(11), C:Cf(0.05)\ndrive u = step(0, 0, 1)\nsimulate until 1 s step 10 ms\n\
             observe f(Ra), e(Ca), f(La), e(Rb), f(Cb), p(Lb), q(Cb), e(far), f(s), power(Rb)\n",
        sides[0], sides[1]
    )
}

#[test]
fn elements_move_over_transformers_and_gyrators_from_either_side() {
    for two_port in ["TF:t(r)", "TF:t(gain = 1/r)", "GY:t(r)", "GY:t(gain = r)", "TF:t(1/r)"] {
        for sides in [["1", "1"], ["1", "0"], ["0", "1"], ["0", "0"]] {
            let text = crossing(two_port, sides).replace("power(Rb)", "f(Rf)");
            for what in ["Ra", "Ca", "La", "Rb", "Cb", "Lb", "far"] {
                let after = made(&text, &moved(what, Some("t")));
                let after =
                    after.unwrap_or_else(|error| panic!("{two_port} {sides:?} {what}: {error:?}"));
                assert_ne!(text, after);
                alike(&text, &after, "u");
            }
        }
    }
}

#[test]
fn a_whole_side_moves_and_the_two_port_goes() {
    for two_port in ["TF:t(r)", "GY:t(r)"] {
        for side in ["1", "0"] {
            let text = crossing(two_port, [side, "1"]).replace("power(Rb)", "f(Rf)");
            let after = made(&text, &moved("b", Some("t"))).unwrap();
            assert!(!code(&after).contains(":t"), "{after}");
            alike(&text, &after, "u");
        }
    }
}

#[test]
fn laws_starts_and_sources_move_too() {
    let text = "\
param m = 2
Se:U(3) -> 1:a -> TF:t(m) -> 1:b -> R:q(e = 0.5*f*abs(f) + 0.1*f)
a -> I:L(0.7, f0 = 0.2)
b -> I:M(f = tanh(p), p0 = 0.3)
b -> 0:c -> C:k(e = q + q^3, q0 = 0.1)
Se:w(0.4) -> b
c -> R:leak(f = 0.2*e^3)
c -> C:s(der(e) = 3*f, e0 = 0.1)
simulate until 4 s step 10 ms
observe f(a), f(q), e(q), q(k), e(c), f(w), f(leak), power(q), e(s)
";
    // The two compliances share an effort: the first starts where the second does.
    let text = text.replace("q0 = 0.1", "e0 = 0.1");
    for two_port in ["TF:t(m)", "GY:t(m)"] {
        let text =
            text.replace("TF:t(m)", two_port).replace("I:M(f = tanh(p), p0 = 0.3)", "R:M(0.3)");
        let before = run(&text, "1e-7", &[]);
        for what in ["q", "c", "w", "b"] {
            let after =
                made(&text, &moved(what, Some("t"))).unwrap_or_else(|e| panic!("{what}: {e:?}"));
            let error = difference(&run(&after, "1e-7", &[]), &before);
            assert!(error <= 1e-5, "{two_port} {what}: {error}\n{after}");
        }
    }
    let text = "Se:U(1) -> 1:a -> TF:t(2) -> 1:b -> I:M(f = tanh(p), p0 = 0.3)\na -> R:r(1)\n\
                simulate until 4 s step 10 ms\nobserve f(M), p(M), f(a)\n";
    let after = made(text, &moved("M", None)).unwrap();
    assert!(difference(&run(&after, "1e-7", &[]), &run(text, "1e-7", &[])) <= 1e-5, "{after}");
}

#[test]
fn what_cannot_move_says_why() {
    let head = "Se:U(1) -> 1:a -> TF:t(2) -> 1:b -> R:r(1)\n";
    for (text, what, over, code, says) in [
        (head.into(), "q", None, "E1100", "has no element or junction `q`"),
        (head.into(), "r", Some("a"), "E1101", "is no transformer or gyrator"),
        (
            head.to_string() + "b -> 0:c -> C:k(1)\n",
            "k",
            Some("t"),
            "E1101",
            "does not hang beside",
        ),
        ("Se:U(1) -> 1:a -> R:r(1)\n".into(), "r", None, "E1101", "beside no transformer"),
        (head.replace("(2)", "(time)"), "r", None, "E1101", "varies"),
        (
            head.replace("b -> R", "b -> TF:u(3) -> R").replace("b -> TF", "b -> R:x(1)\nb -> TF"),
            "x",
            None,
            "E1101",
            "several",
        ),
        (head.to_string() + "b -> 0:c -> a\nc -> C:k(1)\n", "c", Some("t"), "E1101", "two ways"),
    ] {
        let text: String = text;
        let error =
            made(&text, &|work| work.change(&|source| across(source, what, over))).unwrap_err();
        assert_eq!(error.code, code, "{error:?}");
        assert!(error.message.contains(says), "{error:?}");
    }
}

/// A graph in which every rule of simplifying applies.
const ROUNDABOUT: &str = "\
param R1 = 2 Ohm  \"the first\"
input u
Se:U(u) -> 1:a -> 1:b -> R:R1, R:R2(3 Ohm)
b -> I:L1(0.1 H), I:L2(0.2 H)
b -> TF:t(2) -> TF:s(1/3) -> 0:c -> 0:d -> 1:through -> 0:g
g -> R:Rg(5 Ohm), R:Rh(5 Ohm), C:Cg(10 mF), C:Ch(20 mF)
g -> I:Lg(1 H), I:Lh(2 H)
g -> GY:x(2 V/A) -> GY:y(3 V/A) -> GY:z(4 V/A) -> TF:v(5) -> 1:h -> C:C1(1 mF), C:C2(2 mF)
h -> R:end(7 Ohm)
drive u = step(0 s, 0 V, 1 V)
simulate until 1 s step 10 ms
observe f(a), e(g), f(end)
";

#[test]
fn simplifying_says_the_same_with_less_and_then_has_no_more_to_do() {
    let after = made(ROUNDABOUT, &simplified).unwrap();
    for line in [
        "R:R1(R1 + 3 Ohm)",
        "L1(0.1 H + 0.2 H)",
        "TF:t(2/3)",
        "1/(1/(1 H) + 1/(2 H))",
        "R:Rg((5 Ohm)/2)",
        "GY:x(",
    ] {
        assert!(after.contains(line), "{line}\n{after}");
    }
    for gone in ["through ->", "1:b", "0:d", "R2", "GY:y", "GY:z", "TF:v"] {
        assert!(!code(&after).contains(&format!(" {gone}")), "{gone}\n{after}");
    }
    alike(ROUNDABOUT, &after, "u");
    assert_eq!(after, made(&after, &simplified).unwrap());
}

#[test]
fn what_is_read_stays() {
    let text = "Se:U(1) -> 1:a -> R:x(1), R:y(2)\na -> C:c(1)\nsimulate until 1 s step 10 ms\nobserve e(x), f(y)\n";
    let after = made(text, &simplified).unwrap();
    assert_eq!(after, text);
    let error = made(text, &|work| work.change(&|s| without(s, s.find("x")?))).unwrap_err();
    assert_eq!(error.code, "E1103");
}

/// Leaves out the accumulator with its valves, and lumps both lines.
fn one_line(work: &mut Work) -> Result<(), Trouble> {
    two_lines(work)?;
    work.change(&|source| lump(source, "pump1", "pump2"))
}

fn two_lines(work: &mut Work) -> Result<(), Trouble> {
    for valve in ["valve1.flow", "valve2.flow"] {
        work.change(&|source: &Source| without(source, source.find(valve)?))?;
    }
    Ok(())
}

#[test]
fn the_two_lines_of_the_actuator_are_one() {
    let text = shipped("eha_two_line.bg");
    let (two, one) = (made(&text, &two_lines).unwrap(), made(&text, &one_line).unwrap());
    for law in
        ["C:jack_chamber1_fluid(Vt/beta/2)", "R:jack_chamber1_R_wall(Chj*2)", "f*sqrt(f^2+Q0^2)*2"]
    {
        assert!(one.contains(law), "{law}\n{one}");
    }
    assert!(!code(&one).contains("pump2"), "{one}");
    // A tenth of the movement tells as much; the shipped test of references runs all of it.
    let short = [("until", "0.4s")];
    let error = difference(&run(&one, "1e-7", &short), &run(&two, "1e-7", &short));
    assert!(error <= 1e-5, "{error}");
}

#[test]
fn lines_that_differ_are_not_lumped() {
    let text = shipped("eha_two_line.bg");
    let unlike = text.replace("Line:line2(Cl = Cl,", "Line:line2(Cl = 2*Cl,");
    let error = made(&unlike, &one_line).unwrap_err();
    assert!(error.code == "E1102" && error.message.contains("line1_loss"), "{error:?}");
    let error = made(&text, &|work| work.change(&|s| lump(s, "pump1", "pump2"))).unwrap_err();
    assert!(error.code == "E1102" && error.message.contains("accumulator"), "{error:?}");
    let turned = "Sf:Q(1) -> 0:s -> 1:m -> 0:a -> C:ca(1)\nm -> 0:b -> C:cb(1)\n";
    let error = made(turned, &|work| work.change(&|s| lump(s, "a", "b"))).unwrap_err();
    assert!(error.message.contains("drive both alike"), "{error:?}");
}

#[test]
fn laid_open_a_model_runs_the_same() {
    // Instances within instances, arrays, ports; fields; everything signals have; conditions and events.
    for (model, until) in [
        ("eha_components.bg", "0.15s"),
        ("half_wing.bg", "60ms"),
        ("coupled_coils.bg", "10ms"),
        ("solenoid.bg", "10ms"),
        ("sampled_controller.bg", "0.5s"),
        ("servo_axis.bg", "0.1s"),
        ("lifting_jack.bg", "0.1s"),
    ] {
        let text = shipped(model);
        let flat =
            made(&text, &|work| work.lay_open()).unwrap_or_else(|e| panic!("{model}: {e:?}"));
        assert_eq!(flat.matches("model ").count(), 0);
        let (flat, own) =
            (run(&flat, "1e-7", &[("until", until)]), run(&text, "1e-7", &[("until", until)]));
        let error = difference(&flat, &own);
        assert!(error <= 1e-5, "{model}: {error}");
    }
}
