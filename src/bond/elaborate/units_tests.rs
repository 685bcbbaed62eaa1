//! Tests of units and domains: one line each, right and wrong; domains along bonds; every literal of the shipped models
//! with another unit.

use super::*;
use crate::bond::graph::BondGraph;
use crate::bond::syntax::{File, Leaf, StatementKind};
use crate::diagnostic::Severity;
use crate::quantity::Domain;

struct Built {
    graph: Option<BondGraph>,
    d: Vec<Diagnostic>,
    map: SourceMap,
}

fn read(text: &str) -> (SourceMap, File, Vec<Diagnostic>) {
    let mut map = SourceMap::default();
    let file = map.add("test.bg", text);
    let mut d = vec![];
    let file = syntax::parse(&map, file, &mut d);
    (map, file, d)
}

fn build_with(text: &str, overrides: &Overrides) -> Built {
    let (mut map, mut d) = (SourceMap::default(), vec![]);
    // Beside the shipped models, so that what these import is found.
    let file = map.add(concat!(env!("CARGO_MANIFEST_DIR"), "/models/test.bg"), text);
    let program = load(&mut map, file, &[], &mut d);
    let graph = elaborate(&program, &map, overrides, &mut d);
    d.retain(|d| d.severity == Severity::Error);
    Built { graph, d, map }
}

fn build(text: &str) -> Built {
    build_with(text, &Overrides::default())
}

impl Built {
    /// Every error in a line: its code, the text that it points at, its message.
    fn lines(&self) -> Vec<String> {
        let at = |d: &Diagnostic| {
            d.labels.first().map_or(String::new(), |l| self.map.text(l.span).to_string())
        };
        self.d.iter().map(|d| format!("{} {}: {}", d.code, at(d), d.message)).collect()
    }

    /// Where the labels of an error point.
    fn labels(&self, error: usize) -> Vec<&str> {
        self.d[error].labels.iter().map(|label| self.map.text(label.span)).collect()
    }
}

/// Values of several units, an electrical bond and a rotating one.
const AROUND: &str = "\
param pr = 20 bar
param tq = 3 N*m
param vt = 5 V
param am = 2 A
param om = 3 rad/s
param tau = 1 ms
param len = 2 mm
param n = 3
param duty = 0.3
Se:U(10 V) -> 1:m -> GY:g(0.5 V*s) -> 1:shaft -> I:J(2 kg*m^2)
";

/// Lines that are right, each beside [`AROUND`].
const RIGHT: &[&str] = &[
    "signal a = pr + 3",
    "signal a = pr + 3 bar - 2*pr",
    "signal a = tq*om + vt*am",
    "signal a = 2*pi*om*time",
    "signal a = vt*sin(om*time + 90 deg)",
    "signal a = sin(2 rad/s*time)",
    "signal a = n*sin(n*time)",
    "signal a = exp(-time/tau)",
    "signal a = sqrt(pr)*sqrt(pr) + pr",
    "signal a = pr^0.5*pr^(1/2) + pr",
    "signal a = len^3/len + len*len",
    "signal a = (1 mm^3)^(1/3) + len",
    "signal a = 2^n + duty",
    "signal a = (len/1 mm)^duty",
    "signal a = abs(vt) + vt",
    "signal a = sign(vt) + 1 %",
    "signal a = min(vt, 3, 2 V) + vt",
    "signal a = clamp(vt, 0, 7) + vt",
    "signal a = atan2(vt, 3 V) + 3 deg",
    "signal a = mod(time, 20 ms) + tau",
    "signal a = floor(time/tau)*vt + vt",
    "signal a = if vt > 3 V then am else 0",
    "signal a = (vt > 3)*am + am",
    "signal a = not (om == 3) and time < tau",
    "signal a = table(time, [0 s, 0 V; 1 s, 3 V]) + vt",
    "signal a = table(time, [0, 0; 1, 3]) + vt",
    "signal a = step(tau, 0, 3 V) + vt",
    "signal a = ramp(0 s, 3 V/s) + vt",
    "signal a = pulse(0 V, 3 V, 0 s, 0, 0, tau, 2*tau) + vt",
    "signal a = sine(0 V, 3 V, 50 Hz, 0 s, 3 s^-1, 90 deg) + vt",
    "signal a = pwl(0, 0; 1 s, 3 V; 2 s, 4 V) + vt",
    "signal a = integ(vt) + 2 V*s",
    "signal a = integ(om, 3 deg) + 1 rev",
    "signal a = lag(vt, tau) + vt",
    "signal a = pi(om - f(shaft), Kp = 2 A*s, Ki = 3 A, lo = -am, hi = am, Kaw = 100 s^-1) + am",
    "signal a = pi(om - f(shaft), Kp = 2, Ki = 3, lo = -am, hi = am) + am",
    "signal a = pi(vt, Kp = n) + 4",
    "signal a = f(shaft) + om",
    "signal a = power(U)/vt + am",
    "signal a = p(J) + tq*time",
    "m -> R:d(e = 2 V/A^2*f*abs(f))",
    "m -> R:d(e = vt*tanh(f/am))",
    "m -> R:d(f = 1e-12*(1 A)*(exp(e/0.025 V) - 1))",
    "m -> R:d(e = coulomb(f, vt, am))",
    "m -> R:d(f = check(e, 1 Ohm, 1 MOhm, 0.1 V))",
    "m -> R:d(f = relief(e, vt, 1 Ohm, 1 MOhm, 0.1 V))",
    "m -> R:d(f = orifice(e, 2 V^0.5/A, am))",
    "m -> C:c(10 uF, q0 = 1 mC)",
    "m -> C:c(10 uF, e0 = vt)",
    "m -> C:c(e = q/10 uF)",
    "m -> C:c(der(e) = f/(10 uF), e0 = 3)",
    "m -> I:l(1 mH, f0 = am)",
    "m -> I:l(f = p/(1 mH), p0 = 3 mWb)",
    "m -> I:l(der(f) = e/(1 mH))",
    "m -> R:d(n)",
    "m -> R:d(n*vt/am)",
    "shaft -> R:b(2e-3 N*m*s)",
    "shaft -> TF:pump(2 cm^3/rad) -> 0:line -> R:leak(1e12 Pa*s/m^3)",
    "shaft -> TF:gear(0.1) -> R:b(1 N*m*s)",
    "shaft -> TF:pinion(gain = 20 m^-1) -> R:b(1 N*s/m)",
    "m -> MTF:cell(1/duty) -> R:b(1 Ohm)",
    "m -> GY:x(n) -> R:b(1 N*s/m)",
    "Se:hot(300 K) -> 1:w -> R:wall(2 K/W)",
    "Sf:heat(power(U)) -> 0:w -> C:c(2 J/K)",
    "input u\ndrive u = step(1 s, 0 V, 3 V)\nsignal a = u + vt",
    "simulate until 3*tau step 1 us",
    "simulate until 3",
    "observe e(U) in kV, f(shaft) in rpm, power(U) in kW, pr + 3 in psi",
    "observe sum(k in 1..3, k*vt) in V",
    "I:coils([1 mH, 2 uH; 2 uH, 1 mH], p0 = [0, 3 mWb])\nm -> coils.1\ncoils.2 -> R:d(1 Ohm)",
    "C:plate(e1 = q1*(1 mm + q2)/(3e-12 F*m), e2 = q1^2/(6e-12 F*m), q1_0 = 1 uC, q2_0 = 2 mm)\nm -> plate.1\nplate.2 -> I:mass(1 g)",
];

/// Lines that are wrong, each beside [`AROUND`]: the code, what the first two labels point at, a part of the message.
const WRONG: &[(&str, &str, &[&str], &str)] = &[
    ("signal a = pr + tq", "E0304", &["tq", "pr"], "a torque (N*m) is added to a pressure (Pa)"),
    (
        "signal a = vt - 3 A",
        "E0304",
        &["3 A", "vt"],
        "a current (A) is subtracted from a voltage (V)",
    ),
    ("signal a = 1 kJ + 3 W", "E0304", &["3 W", "1 kJ"], "a power (W) is added to an energy (J)"),
    ("signal a = 2*vt + am", "E0304", &["am", "2*vt"], "a current (A) is added to a voltage (V)"),
    ("signal a = vt + sin(om*time)", "E0304", &["sin(om*time)", "vt"], "a pure number is added"),
    ("signal a = vt > am", "E0304", &["am", "vt"], "a voltage (V) is compared with a current (A)"),
    ("signal a = if vt > 3 A then 1 else 2", "E0304", &["3 A", "vt"], "is compared with"),
    ("signal a = if n > 3 then vt else am", "E0304", &["am", "vt"], "the branches of `if`"),
    ("signal a = min(vt, am)", "E0304", &["am", "vt"], "`min` of a voltage (V) and a current (A)"),
    ("signal a = max(vt, 3, tau)", "E0304", &["tau", "max(vt, 3, tau)"], "`max` of"),
    ("signal a = clamp(vt, 0, 3 A)", "E0304", &["3 A", "vt"], "`clamp` of"),
    ("signal a = atan2(vt, am)", "E0304", &["am", "vt"], "`atan2` of"),
    (
        "signal a = mod(time, 3 m)",
        "E0304",
        &["3 m", "time"],
        "`mod` of a time (s) and a length (m)",
    ),
    ("signal a = sqrt(pr) + pr", "E0304", &["pr", "sqrt(pr)"], "a pressure (Pa) is added to"),
    ("signal a = pr^2 + pr", "E0304", &["pr", "pr^2"], "a pressure (Pa) is added to"),
    (
        "signal a = e(U) + f(U)",
        "E0304",
        &["f(U)", "e(U)"],
        "a current (A) is added to a voltage (V)",
    ),
    (
        "signal a = f(shaft) + f(m)",
        "E0304",
        &["f(m)", "f(shaft)"],
        "a current (A) is added to a rate (rad/s)",
    ),
    ("signal a = exp(time)", "E0305", &["time"], "`exp` takes a pure number, not a time (s)"),
    ("signal a = sin(2*time)", "E0305", &["2*time"], "`sin` takes a pure number"),
    ("signal a = ln(vt)", "E0305", &["vt", "5 V"], "`ln` takes a pure number, not a voltage (V)"),
    ("signal a = floor(time)", "E0305", &["time"], "`floor` takes a pure number"),
    ("signal a = tanh(f(U))", "E0305", &["f(U)"], "`tanh` takes a pure number, not a current (A)"),
    ("signal a = 2^tau", "E0305", &["tau", "1 ms"], "an exponent is a time (s)"),
    (
        "signal a = len^sin(om*time)",
        "E0305",
        &["len", "sin(om*time)"],
        "raised to a power that changes",
    ),
    ("signal a = table(time, [0 s, 1 V; 1 m, 2 V])", "E0306", &["1 m", "time"], "`table` mixes"),
    ("signal a = table(time, [0 s, 1 V; 1 s, 2 A])", "E0306", &["2 A", "1 V"], "`table` mixes"),
    ("signal a = table(vt, [0 s, 1 V; 1 s, 2 V])", "E0306", &["vt", "0 s"], "`table` mixes"),
    (
        "signal a = step(3 V, 0 V, 1 V)",
        "E0306",
        &["3 V"],
        "`t0` of `step` is a voltage (V) instead of a time (s)",
    ),
    ("signal a = step(tau, 0 V, am)", "E0306", &["am", "0 V"], "`after` of `step`"),
    (
        "signal a = ramp(0 s, 3 V/s) + am",
        "E0304",
        &["am", "ramp(0 s, 3 V/s)"],
        "is added to a voltage (V)",
    ),
    (
        "signal a = pulse(0 V, 1 V, 0 s, 0 s, 0 s, 1 m, 2 s)",
        "E0306",
        &["1 m"],
        "`width` of `pulse`",
    ),
    ("signal a = sine(0 V, vt, tau)", "E0306", &["tau"], "`frequency` of `sine`"),
    ("signal a = sine(0 V, vt, 5 Hz, 0 s, 0 s^-1, 3 s)", "E0306", &["3 s"], "`phase` of `sine`"),
    (
        "signal a = pwl(0 s, 0 V; 1 s, 3 A)",
        "E0306",
        &["3 A", "0 V"],
        "`pwl` mixes a current (A) and a voltage (V)",
    ),
    (
        "signal a = pwl(0 s, 0 V; 1 V, 3 V)",
        "E0306",
        &["1 V"],
        "a point of `pwl` stands at a voltage (V)",
    ),
    ("signal a = integ(vt) + vt", "E0304", &["vt", "integ(vt)"], "is added to a flux (Wb)"),
    ("signal a = integ(vt, 3 V)", "E0306", &["3 V", "vt"], "`ic` of `integ`"),
    ("signal a = lag(vt, 3)\nsignal b = lag(vt, 3 m)", "E0306", &["3 m"], "`tau` of `lag`"),
    ("signal a = lag(vt, tau, 3 A)", "E0306", &["3 A", "vt"], "`ic` of `lag`"),
    (
        "signal a = pi(om, Kp = 2 A*s, Ki = 3 A*s)",
        "E0306",
        &["3 A*s", "2 A*s"],
        "`Ki` of `pi` is a charge (C) instead of a current (A)",
    ),
    ("signal a = pi(om, Kp = 2 A*s, hi = vt)", "E0306", &["vt", "2 A*s"], "`hi` of `pi`"),
    ("signal a = pi(om, Kp = 2 A*s, lo = 0 A, hi = 3 V)", "E0306", &["3 V", "0 A"], "`hi` of `pi`"),
    ("signal a = pi(om, Kp = 2, Kaw = tau)", "E0306", &["tau"], "`Kaw` of `pi`"),
    (
        "signal a = pi(om, Kp = 2 A*s) + vt",
        "E0304",
        &["vt", "pi(om, Kp = 2 A*s)"],
        "is added to a current (A)",
    ),
    (
        "param wrong = pr + vt\nsignal a = wrong + am",
        "E0304",
        &["vt", "pr"],
        "is added to a pressure (Pa)",
    ),
    (
        "m -> R:r(2 mH)",
        "E0307",
        &["2 mH", "Se:U(10 V)"],
        "the value of the dissipator `r` is an inductance (H)",
    ),
    (
        "m -> R:r(e = 3 Ohm*f*f)",
        "E0307",
        &["3 Ohm*f*f", "Se:U(10 V)"],
        "`e = …` of the dissipator `r`",
    ),
    ("m -> C:c(e = q/1e-5)", "E0307", &["q/1e-5", "Se:U(10 V)"], "is a charge (C), but"),
    (
        "I:coils([1 mH, 2 uH; 2 uH, 1 kg*s])\nm -> coils.1\ncoils.2 -> R:d(1 Ohm)",
        "E0307",
        &["1 kg*s"],
        "the value of the inertia `coils` is a value in kg*s",
    ),
    (
        "C:plate(e1 = q1*(1 mm + q2)/(3e-12 F), e2 = q1^2/(6e-12 F*m))\nm -> plate.1\nplate.2 -> I:mass(1 g)",
        "E0307",
        &["q1*(1 mm + q2)/(3e-12 F)", "Se:U(10 V)"],
        "`e1 = …` of the compliance `plate`",
    ),
    (
        "C:plate(e1 = q1*(1 mm + q2)/(3e-12 F*m), e2 = q1^2/(6e-12 F*m), q2_0 = 3 s)\nm -> plate.1\nplate.2 -> I:mass(1 g)",
        "E0307",
        &["3 s", "I:mass(1 g)"],
        "`q2_0 = …` of the compliance `plate`",
    ),
    ("m -> R:r(f = e/(3 A))", "E0307", &["e/(3 A)", "Se:U(10 V)"], "`f = …` of the dissipator `r`"),
    ("m -> R:r(e = vt*tanh(f/vt))", "E0305", &["f/vt", "5 V"], "`tanh` takes a pure number"),
    (
        "m -> R:r(f = orifice(e, 2 Pa^0.5*s/m^3, 1e-5 m^3/s))",
        "E0306",
        &["1e-5 m^3/s", "2 Pa^0.5*s/m^3"],
        "`Q0` of `orifice`",
    ),
    (
        "m -> R:r(f = check(e, 1 Ohm, 1 Mm, 0.1 V))",
        "E0306",
        &["1 Mm", "1 Ohm"],
        "`Roff` of `check`",
    ),
    (
        "m -> R:r(f = relief(e, 3 A, 1 Ohm, 1 MOhm, 0.1 V))",
        "E0306",
        &["3 A", "e"],
        "`limit` of `relief`",
    ),
    ("m -> R:r(e = coulomb(f, vt, vt))", "E0306", &["vt", "f"], "`f_break` of `coulomb`"),
    (
        "m -> C:c(10 uF, q0 = 3 V)",
        "E0307",
        &["3 V", "Se:U(10 V)"],
        "`q0 = …` of the compliance `c` is a voltage (V)",
    ),
    (
        "m -> C:c(10 uF, e0 = 3 bar)",
        "E0307",
        &["3 bar", "Se:U(10 V)"],
        "`e0 = …` of the compliance `c` is a pressure (Pa), but its electrical bond needs a voltage (V)",
    ),
    (
        "m -> I:l(1 mH, f0 = 2 V)",
        "E0307",
        &["2 V", "Se:U(10 V)"],
        "`f0 = …` of the inertia `l` is a voltage (V), but its electrical bond needs a current (A)",
    ),
    (
        "shaft -> R:b(2 Ohm)",
        "E0308",
        &["2 Ohm", "I:J(2 kg*m^2)"],
        "the dissipator `b` is of domain electrical, but its bond is rotation",
    ),
    (
        "Se:hot(300 K) -> 1:w -> R:wall(2 K/W), Sf:s(3 W/K)",
        "E0308",
        &["3 W/K", "R:wall(2 K/W)"],
        "the flow source `s` is of domain thermal, but its bond is pseudo-thermal",
    ),
    (
        "m -> C:c(der(e) = f/(10 mH))",
        "E0307",
        &["f/(10 mH)", "Se:U(10 V)"],
        "`der(e) = …` of the compliance `c`",
    ),
    (
        "m -> I:l(1 kg)",
        "E0308",
        &["1 kg", "Se:U(10 V)"],
        "the inertia `l` is of domain translation",
    ),
    (
        "m -> Sf:s(3 V)",
        "E0308",
        &["3 V", "Se:U(10 V)"],
        "the flow source `s` is of domain magnetic",
    ),
    ("m -> Se:s(3*sin(om*time))", "E0307", &["3*sin(om*time)", "Se:U(10 V)"], "is a pure number"),
    (
        "shaft -> GY:x(1 V*s) -> R:b(2 N*s/m)",
        "E0309",
        &["1 V*s"],
        "the ratio of the gyrator `x` does not lead from rotation to translation",
    ),
    (
        "shaft -> TF:pump(2 cm^2) -> 0:line -> R:leak(1e12 Pa*s/m^3)",
        "E0309",
        &["2 cm^2"],
        "does not lead from rotation to hydraulic",
    ),
    (
        "shaft -> TF:pump(2 cm^2) -> 0:line -> R:leak(3)",
        "E0310",
        &["2 cm^2"],
        "leads from rotation to no known domain",
    ),
    (
        "shaft -> TF:x(1 m^3) -> 0:l -> TF:piston(5 cm^2) -> R:b(1 N*s/m)",
        "E0309",
        &["5 cm^2"],
        "from hydraulic to translation",
    ),
    (
        "m -> TF:x(3) -> 0:w -> R:wall(2 K/W)",
        "E0311",
        &["TF:x(3)"],
        "joins electrical and pseudo-thermal",
    ),
    (
        "Sf:a(1 kg/s) -> 0:tank -> GY:g2(2) -> R:b(1 Ohm)",
        "E0311",
        &["GY:g2(2)"],
        "joins pneumatic and electrical",
    ),
    (
        "input u\ndrive u = step(1 s, 0 V, 3 V)\nsignal a = u + am",
        "E0304",
        &["am", "u"],
        "is added to a voltage (V)",
    ),
    (
        "simulate until 3 V",
        "E0303",
        &["3 V"],
        "the end of the run is a voltage (V) instead of a time",
    ),
    ("simulate until 3 s step 1 mm", "E0303", &["1 mm"], "the output interval is a length (m)"),
    (
        "observe e(U) in bar",
        "E0303",
        &["bar", "e(U)"],
        "what is observed is a voltage (V), not a pressure (Pa)",
    ),
    ("observe e(U) + pr", "E0304", &["pr", "e(U)"], "a pressure (Pa) is added to a voltage (V)"),
    ("observe sum(k in 1..3, k*vt + am)", "E0304", &["am", "k*vt"], "a current (A) is added"),
];

#[test]
fn right_lines() {
    for line in RIGHT {
        let built = build(&format!("{AROUND}{line}\n"));
        assert!(built.graph.is_some(), "{line}\n{}", built.lines().join("\n"));
    }
    assert!(RIGHT.len() >= 60);
}

#[test]
fn wrong_lines_are_one_error_that_names_both_places() {
    let mut trouble = vec![];
    for (line, code, places, words) in WRONG {
        let built = build(&format!("{AROUND}{line}\n"));
        let lines = built.lines().join("\n");
        let found = built.labels(0);
        let right = built.d.len() == 1
            && built.d[0].code == *code
            && lines.contains(words)
            && found.get(..places.len()) == Some(*places)
            && built.d[0].help.is_some();
        if !right {
            trouble.push(format!("ROW {line:?}\n{lines}\n{found:?}"));
        }
    }
    assert!(trouble.is_empty(), "{}", trouble.join("\n\n"));
    assert!(WRONG.len() >= 60);
}

#[test]
fn the_same_lines_without_units_are_not_checked() {
    let bare = |text: &str| {
        let (map, file, _) = read(text);
        let mut spans = vec![];
        literals(&file, &mut spans);
        spans.sort_unstable_by_key(|(span, _)| std::cmp::Reverse(span.start));
        let mut text = text.to_string();
        for (span, unit) in spans {
            let literal = map.text(span);
            let number = literal.strip_suffix(unit.as_str()).unwrap().trim_end();
            text.replace_range(span.start as usize..span.end as usize, number);
        }
        text
    };
    for (line, ..) in WRONG.iter().filter(|(line, ..)| !line.contains("observe")) {
        let text = bare(&format!("{AROUND}{line}\n"));
        let built = build(&text);
        let units: Vec<String> =
            built.lines().into_iter().filter(|line| line.starts_with("E03")).collect();
        assert_eq!(units, [""; 0], "{text}");
    }
}

#[test]
fn where_units_come_from() {
    let built = build(&format!("{AROUND}signal a = pr*len + tq\n"));
    let (labels, words): (Vec<&str>, Vec<&str>) =
        (built.labels(0), built.d[0].labels.iter().map(|label| label.text.as_str()).collect());
    assert_eq!(labels, ["tq", "pr*len", "20 bar", "2 mm", "3 N*m"]);
    assert_eq!(
        words,
        [
            "a torque (N*m)",
            "a stiffness (N/m)",
            "`pr` is a pressure (Pa)",
            "`len` is a length (m)",
            "`tq` is a torque (N*m)"
        ]
    );
}

#[test]
fn one_wrong_parameter_is_one_error() {
    let text = AROUND.replace("vt = 5 V", "vt = 5 V*K");
    let built = build(&format!(
        "{text}signal a = vt + 3 V\nsignal b = clamp(e(U), -vt, vt)\nm -> R:r(e = vt*tanh(f/am))\n"
    ));
    assert_eq!(built.d.len(), 1, "{}", built.lines().join("\n"));
    let places =
        built.d[0].labels.iter().filter(|label| label.text.starts_with("clashes here too"));
    // The clamp has the wrong unit twice.
    assert_eq!(places.count(), 3);
    // Two mistakes without a name in common are two errors, whatever depends on the first.
    let two =
        build(&format!("{AROUND}signal a = vt + am\nsignal b = a + 3\nsignal c = tq + 3 bar\n"));
    assert_eq!(two.d.len(), 2, "{}", two.lines().join("\n"));
}

#[test]
fn a_bare_factor_is_pointed_out() {
    let built = build(&format!("{AROUND}m -> Se:s(3*sin(om*time))\n"));
    assert!(built.d[0].notes.iter().any(|note| note.contains("bare number")));
}

#[test]
fn what_the_command_line_gives_is_of_the_unit() {
    let text = format!("{AROUND}input u\ndrive u = 3 V\nsignal a = u + vt\n");
    let overrides = Overrides {
        set: vec![("vt".into(), "3 A".into()), ("am".into(), "4".into())],
        drive: vec!["u = step(0, 0, 3 A)".into()],
        ..Overrides::default()
    };
    let built = build_with(&text, &overrides);
    assert_eq!(
        built.lines(),
        [
            "E0303 5 V: `3 A` is no value for `vt`",
            "E0303 3 V: the input `u` is a voltage (V) and is driven with a current (A)",
        ]
    );
}

fn domains(text: &str) -> Vec<Domain> {
    let built = build(text);
    let lines = built.lines().join("\n");
    built.graph.expect(&lines).bonds.iter().map(|bond| bond.domain).collect()
}

#[test]
fn domains_do_not_depend_on_the_order_of_statements() {
    use Domain::*;
    let text = "Sf:Q(Q) -> 0:n\nn -> C:c(A/(rho*g))\nsignal Q = lag(u, 1 s)\ninput u\n\
        drive u = step(0 s, 0 m^3/s, B*v)\nparam v = 2 m/s\nparam B = A\nparam A = 0.05 m^2\n\
        param rho = 1000 kg/m^3\nparam g = 9.81 m/s^2";
    assert_eq!(domains(text), [Hydraulic, Hydraulic]);
    let mut lines: Vec<&str> = text.lines().collect();
    lines.reverse();
    assert_eq!(domains(&lines.join("\n")), [Hydraulic, Hydraulic]);
    // Told by a signal that reads a bond whose domain comes across a gyrator.
    let coupled = "Sf:s(x/(2 s)) -> R:b(1)\nsignal x = integ(f(w)*1 m)\nGY:g(2 V*s) -> 1:w -> R:q(1)\nSe:U(3 V) -> g";
    assert_eq!(domains(coupled), [Translation, Rotation, Rotation, Electrical]);
}

#[test]
fn a_conflict_names_both_elements_and_the_way_between_them() {
    let text = "Se:U(10 V) -> 1:a -> 0:b -> 1:c -> TF:t(1) -> 0:d\nb -> R:r(1)\nd -> R:s(1), C:k(2 m/N)\nU2 -> a\nSe:U2(3 V)";
    let built = build(&text.replace("TF:t(1)", "TF:t(1 %)"));
    assert_eq!(
        built.lines(),
        [
            "E0309 1 %: the ratio of the transformer `t` does not lead from electrical to translation"
        ]
    );
    let built = build(&text.replace("b -> R:r(1)", "b -> R:r(3 N*s/m)"));
    assert_eq!(built.d.len(), 1);
    assert_eq!(built.labels(0), ["3 N*s/m", "Se:U(10 V)"]);
    let way = "the bonds between them: `U` – `a` – `b` – `r`";
    assert!(built.d[0].notes.iter().any(|note| note == way), "{:?}", built.d[0].notes);
    // The one that disagrees with the others is blamed, though it comes first.
    let first = build("R:r(3 N*s/m) -> 1:a\nSe:U(3 V) -> a\na -> C:c(1 uF)");
    assert_eq!(first.labels(0), ["3 N*s/m", "Se:U(3 V)"]);
}

#[test]
fn a_ratio_upside_down_is_mended() {
    let text = "Se:P(20 bar) -> TF:piston(40 cm^2) -> I:mass(3 kg)";
    let built = build(text);
    assert_eq!(built.d.len(), 1);
    let fix = built.d[0].fix.as_ref().unwrap();
    assert_eq!(fix.edits[0].1, "gain = 40 cm^2");
    assert!(build(&text.replace("40 cm^2", "gain = 40 cm^2")).d.is_empty());
    let open = build(&text.replace("I:mass(3 kg)", "I:mass(3)"));
    assert_eq!(open.d[0].code, "E0310");
    assert!(open.d[0].fix.is_some());
}

#[test]
fn ports_tell_domains() {
    let model =
        "model M(k) {\n  port in a : electrical\n  port out b : rotation\n  a -> GY:g(k) -> b\n}\n";
    let text = format!("{model}M:x(k = 2 V*s)\nSe:U(3) -> x.a\nx.b -> R:r(2)\n");
    assert_eq!(domains(&text), [Domain::Electrical, Domain::Rotation]);
    let wrong = build(&text.replace("Se:U(3)", "Se:U(3 bar)"));
    assert_eq!(wrong.labels(0), ["3 bar", "electrical"]);
    assert_eq!(wrong.d[0].code, "E0308");
    let wrong = build(&text.replace("2 V*s", "2 m"));
    assert_eq!(wrong.d.len(), 1, "{}", wrong.lines().join("\n"));
    assert_eq!(wrong.d[0].code, "E0309");
    assert!(wrong.labels(0).contains(&"2 m"), "{:?}", wrong.labels(0));
    // The same model twice, wrong in both: said once.
    let model = model.replace("GY:g(k)", "GY:g(k*1 m)");
    let twice = build(&format!(
        "{model}M:x(k = 2 V*s)\nM:y(k = 2 V*s)\nSe:U(3) -> x -> R:r(2)\nSe:V(3) -> y -> R:s(2)\n"
    ));
    assert_eq!(twice.d.len(), 1, "{}", twice.lines().join("\n"));
    // Domains of ports alone: a rotating bond at a hydraulic port.
    let ports = "model A() {\n  port out b : rotation\n  Se:s(1) -> b\n}\nmodel B() {\n  port in a : hydraulic\n  a -> R:r(1)\n}\nA:x()\nB:y()\nx -> y\n";
    let clash = build(ports);
    assert_eq!(clash.d.len(), 1, "{}", clash.lines().join("\n"));
    assert_eq!(clash.labels(0), ["hydraulic", "rotation", "Se:s(1) -> b"]);
}

#[test]
fn a_model_without_units_is_unchecked_within_one_with_units() {
    let text = "model Cubic(k3 = 1) {\n  port in a : translation\n  a -> C:c(e = q + k3*q^3)\n  signal s = sin(2*time) + e(c)\n}\n\
        Cubic:x()\nSf:v(1 m/s) -> x.a\n";
    assert!(build(text).d.is_empty(), "{}", build(text).lines().join("\n"));
}

#[test]
fn what_instances_are_given_is_of_the_unit_of_the_default() {
    let model =
        "model M(L = 1 mH, k = 3) {\n  port in a\n  a -> 1:m -> I:L\n  m -> R:r(2 Ohm)\n}\n";
    let given = |given: &str| build(&format!("{model}M:x({given})\nSe:U(3 V) -> x.a\n"));
    assert!(given("L = 2 mH, k = 3 bar").d.is_empty());
    assert!(given("L = 2").d.is_empty());
    let wrong = given("L = 2 kg");
    assert_eq!(
        wrong.lines(),
        ["E0303 2 kg: the parameter `x.L` is an inductance (H) and is given a mass (kg)"]
    );
    // A bare number is in the unit of the default.
    let other =
        build(&format!("{model}M:x(L = 2)\nSe:U(3) -> x.a\nparam z = 2 bar\nsignal s = x.L + z"));
    assert_eq!(other.d.len(), 1, "{}", other.lines().join("\n"));
}

#[test]
fn regulators_follow_values_of_their_unit() {
    let line = "signal u = pi(am - f(m), Kp = 2 V/A)\nloop u: f(m) follows am, bandwidth 200 rad/s, margin 60 deg";
    assert!(build(&format!("{AROUND}{line}\n")).d.is_empty());
    for (right, wrong, code) in [
        ("follows am", "follows vt", "E0304"),
        ("200 rad/s", "200 V", "E0303"),
        ("60 deg", "60 m", "E0303"),
    ] {
        let built = build(&format!("{AROUND}{}\n", line.replace(right, wrong)));
        assert_eq!(built.d.len(), 1, "{wrong}: {}", built.lines().join("\n"));
        assert_eq!(built.d[0].code, code);
    }
}

#[test]
fn numbered_names_are_own_variables_only_in_fields() {
    let text = "param e1 = 3 Ohm\nSe:U(3 V) -> R:r(e1*2)";
    assert!(build(text).d.is_empty(), "{}", build(text).lines().join("\n"));
}

/// Every literal with a unit in the values of a file.
fn literals(file: &File, found: &mut Vec<(crate::source::Span, String)>) {
    fn expr(expr: &syntax::Expr, found: &mut Vec<(crate::source::Span, String)>) {
        expr.leaves(&mut |leaf, span| match leaf {
            Leaf::Quantity(_, unit) => found.push((span, unit.text.clone())),
            Leaf::Call(call) => call.rows.iter().flatten().for_each(|a| value(&a.value, found)),
            Leaf::Sum(sum) => self::literals_of(&sum.term, found),
            Leaf::Name(_) => {}
        });
    }
    fn value(value: &syntax::Value, found: &mut Vec<(crate::source::Span, String)>) {
        match value {
            syntax::Value::Expr(value) => expr(value, found),
            syntax::Value::Matrix(rows) => rows.iter().flatten().for_each(|v| expr(v, found)),
            _ => {}
        }
    }
    for statement in &file.statements {
        match &statement.kind {
            StatementKind::Chain(chain) => {
                let ends = chain.first.iter().chain(chain.links.iter().flat_map(|(_, e)| e));
                let arguments = ends.filter_map(|end| end.arguments.as_ref()).flatten();
                arguments.for_each(|argument| value(&argument.value, found));
            }
            StatementKind::Parameter { value, .. }
            | StatementKind::Signal { value, .. }
            | StatementKind::Drive { value, .. } => expr(value, found),
            StatementKind::Simulate { until, step } => {
                until.iter().chain(step).for_each(|value| expr(value, found));
            }
            _ => {}
        }
    }
}

fn literals_of(term: &syntax::Expr, found: &mut Vec<(crate::source::Span, String)>) {
    term.leaves(&mut |leaf, span| {
        if let Leaf::Quantity(_, unit) = leaf {
            found.push((span, unit.text.clone()));
        }
    });
}

/// Every literal with a unit in every shipped model, given another unit, is an error that points at the literal, at
/// what takes part in the clash by the name of its parameter, or at the value that it stands in.
#[test]
fn every_unit_of_the_shipped_models_matters() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("models");
    let mut paths: Vec<_> = [folder.clone(), folder.join("textbook")]
        .iter()
        .flat_map(|folder| std::fs::read_dir(folder).unwrap())
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|ending| ending == "bg"))
        .collect();
    paths.sort();
    let (mut tried, mut survivors) = (0, vec![]);
    for path in paths {
        let text = std::fs::read_to_string(&path).unwrap();
        let (map, file, d) = read(&text);
        assert!(d.is_empty(), "{}", path.display());
        let mut found = vec![];
        literals(&file, &mut found);
        for (span, unit) in found {
            // A candela more is no domain's; a volt for another unit may be.
            for other in [format!("{unit}*cd"), if unit == "V" { "A".into() } else { "V".into() }] {
                let literal = map.text(span);
                let number = literal.strip_suffix(unit.as_str()).unwrap();
                let mut wrong = text.clone();
                let new = format!("{number}{other}");
                wrong.replace_range(span.start as usize..span.end as usize, &new);
                let built = build(&wrong);
                tried += 1;
                let line = text[..span.start as usize].matches('\n').count();
                let statement = wrong.lines().nth(line).unwrap();
                let name =
                    statement.strip_prefix("param ").and_then(|s| s.split_whitespace().next());
                let points = |d: &Diagnostic| {
                    d.labels.iter().any(|label| {
                        // What an instance is given may clash within its model, in a file of the library.
                        if label.span.file != file.file {
                            return true;
                        }
                        let place = built.map.text(label.span);
                        let names = || place.split(|c: char| !(c.is_alphanumeric() || c == '_'));
                        place.contains(&new)
                            || new.contains(place) && !place.is_empty()
                            || name.is_some_and(|name| names().any(|word| word == name))
                    })
                };
                if !built.d.iter().any(|d| d.code.starts_with("E03") && points(d)) {
                    let file = path.file_name().unwrap().to_string_lossy();
                    survivors
                        .push(format!("{file}: {literal} as {new}: {}", built.lines().join(" / ")));
                }
            }
        }
    }
    // What is made with a bare parameter is of an unknown unit: two_tank's discharge coefficient `Cd = 0.62` hides the
    // areas of the orifices, and with them Qs; the number of sections of hydraulic_line hides what is given to each. The
    // supply of the buck converters stands alone before a ratio whose unit is unknown, since the switch's values 0 and 1
    // are bare.
    let unknown = [
        ("buck.bg", "24 V"),
        ("buck_pwm.bg", "24 V"),
        ("buck_pwm.bg", "20 kHz"),
        ("two_tank.bg", "1.5 cm^2"),
        ("two_tank.bg", "1.2 cm^2"),
        ("two_tank.bg", "1e-5 m^3/s"),
        ("hydraulic_line.bg", "20 m"),
        ("hydraulic_line.bg", "1 cm^2"),
        ("hydraulic_line.bg", "850 kg/m^3"),
        ("hydraulic_line.bg", "1.4 GPa"),
    ];
    let number = survivors.len();
    let known = |line: &String| {
        unknown.iter().any(|(file, literal)| line.starts_with(&format!("{file}: {literal} as")))
    };
    survivors.retain(|line| !known(line));
    println!("{tried} mutations, {number} not rejected");
    survivors.truncate(20);
    assert_eq!(survivors, [""; 0]);
    assert_eq!(number, 2 * unknown.len());
    assert!(tried > 300, "{tried}");
}
