//! Tests of the nearest names: in every space of names a slip of the pen is answered with the name that was meant.

use super::*;

/// What is said of a text with something set and observed.
fn said(text: &str, set: &[(&str, &str)], observe: Option<&str>) -> Vec<Diagnostic> {
    let (mut map, mut d) = (SourceMap::default(), vec![]);
    let file = map.add(concat!(env!("CARGO_MANIFEST_DIR"), "/models/test.bg"), text);
    let set = set.iter().map(|(name, value)| (name.to_string(), value.to_string())).collect();
    let overrides = Overrides { set, observe: observe.map(str::to_string), ..Overrides::default() };
    let program = load(&mut map, file, &[], &mut d);
    elaborate(&program, &map, &overrides, &mut d);
    d
}

/// A right file with a name in every space.
const RIGHT: &str = "\
import \"std/hydraulic.bg\"
import \"two_tank.bg\"
model Motor(Phi = 0.5 V*s, friction = 1 mN*m*s) {
  port in supply : electrical
  port out shaft : rotation
  input load
  output speed
  supply -> GY:gyrator(Phi) -> 1:rotor -> shaft
  rotor -> R:bearing(friction), Se:torque(load)
  signal speed = f(rotor)
}
param gain_wanted = 3
param inductance = 2 mH
input reference
signal error = reference - f(mesh)
signal action = pi(error, Kp = gain_wanted, lo = -3, hi = 3)
signal limited = clamp(action, -1, 1) + lag(error, 1 ms) + 0.1 A*s*motor.speed
output limited
drive reference = step(0.1 s, 0, 2)
Se:battery(12 V) -> 1:mesh -> I:coil(inductance, f0 = 2 A), motor
Motor:motor(friction = 2 mN*m*s, load = 0)
motor.shaft -> I:wheel(1 g*m^2)
simulate until 1 s step 1 ms
options reltol = 1e-5
observe limited, f(wheel)
";

/// What is written instead of what, and the hint.
const SLIPS: &[(&str, &str, &str)] = &[
    // Parameters, signals, inputs; of instances too.
    ("Kp = gain_wanted", "Kp = gain_wantd", "did you mean `gain_wanted`?"),
    ("coil(inductance", "coil(inductence", "did you mean `inductance`?"),
    ("clamp(action", "clamp(acton", "did you mean `action`?"),
    ("reference - f", "refrence - f", "did you mean `reference`?"),
    ("motor.speed", "motor.sped", "did you mean `speed`?"),
    ("output limited", "output limted", "did you mean `limited`?"),
    ("drive reference", "drive refrence", "did you mean `reference`?"),
    ("observe limited", "observe limted", "did you mean `limited`?"),
    ("  output speed", "  output sped", "did you mean `speed`?"),
    // Elements, junctions, instances, ports.
    ("f(wheel)", "f(weel)", "did you mean `wheel`?"),
    ("f(mesh)", "f(mehs)", "did you mean `mesh`?"),
    (
        "coil(inductance, f0 = 2 A), motor",
        "coil(inductance, f0 = 2 A), mtor",
        "did you mean `motor`?",
    ),
    ("motor.shaft ->", "motor.shft ->", "did you mean `shaft`?"),
    ("motor.shaft ->", "moter.shaft ->", "did you mean `motor`?"),
    ("rotor -> R", "roter -> R", "did you mean `rotor`?"),
    // Kinds, models, domains, units.
    ("Se:battery", "SE:battery", "did you mean `Se`?"),
    ("Motor:motor(", "Moter:motor(", "did you mean `Motor`?"),
    (": rotation", ": rotaton", "did you mean `rotation`?"),
    ("2 mH", "2 mh", "did you mean `mH`?"),
    ("12 V", "12 volts", "did you mean `V`?"),
    // Functions of both tables, and readings.
    ("clamp(", "clmp(", "did you mean `clamp`?"),
    ("lag(", "lga(", "did you mean `lag`?"),
    ("= pi(", "= pid2(", "did you mean `pid`?"),
    ("step(0.1", "stp(0.1", "did you mean `step`?"),
    // Arguments with names: of elements, functions, instances.
    ("f0 = 2 A", "F0 = 2 A", "did you mean `f0`?"),
    ("f0 = 2 A", "f_0 = 2 A", "did you mean `f0`?"),
    ("Kp =", "kp =", "did you mean `Kp`?"),
    ("friction = 2", "frction = 2", "did you mean `friction`?"),
    ("load = 0", "lode = 0", "did you mean `load`?"),
    // Files.
    ("std/hydraulic.bg", "std/hydraulics.bg", "did you mean `std/hydraulic.bg`?"),
    ("two_tank.bg", "two_tnk.bg", "two_tank.bg`?"),
];

#[test]
fn every_space_of_names_gives_the_nearest() {
    let right = said(RIGHT, &[], None);
    assert!(right.is_empty(), "{right:?}");
    let mut trouble = vec![];
    for (from, to, hint) in SLIPS {
        assert!(RIGHT.contains(from), "{from}");
        let found = said(&RIGHT.replacen(from, to, 1), &[], None);
        let hits = |d: &Diagnostic| d.help.as_deref().is_some_and(|help| help.contains(hint));
        if !found.iter().any(hits) {
            let found: Vec<String> =
                found.iter().map(|d| format!("{} {} {:?}", d.code, d.message, d.help)).collect();
            trouble.push(format!("{to}: {}", found.join("\n   ")));
        }
    }
    assert!(trouble.is_empty(), "{}", trouble.join("\n"));
}

#[test]
fn names_on_the_command_line_give_the_nearest() {
    let mut trouble = vec![];
    for (set, observe, hint) in [
        (Some("inductence"), None, "did you mean `inductance`?"),
        (Some("motor.frction"), None, "did you mean `motor.friction`?"),
        (None, Some("limted"), "did you mean `limited`?"),
        (None, Some("f(weel)"), "did you mean `wheel`?"),
        (None, Some("motor.sped"), "did you mean `speed`?"),
        (None, Some("e(motor.suply)"), "did you mean `supply`?"),
        (None, Some("f(motor.roter)"), "did you mean `rotor`?"),
        (None, Some("f(mesh -> col)"), "did you mean `coil`?"),
    ] {
        let set: Vec<(&str, &str)> = set.into_iter().map(|name| (name, "2")).collect();
        let found = said(RIGHT, &set, observe);
        let hits = |d: &Diagnostic| d.help.as_deref().is_some_and(|help| help.contains(hint));
        if !found.iter().any(hits) {
            trouble.push(format!("{set:?} {observe:?}: {found:?}"));
        }
    }
    assert!(trouble.is_empty(), "{}", trouble.join("\n"));
}

#[test]
fn no_hint_offers_what_cannot_be_read() {
    for what in ["q", "p"] {
        let found = said(RIGHT, &[], Some(&format!("{what}(motor)")));
        assert_eq!(found.len(), 1, "{found:?}");
        let help = found[0].help.as_deref().unwrap_or("");
        assert!(!help.contains("supply") && !help.contains("rotor"), "{help}");
        let found = said(RIGHT, &[], Some(&format!("{what}(motor.supply)")));
        assert_eq!(found[0].message, format!("a port stores no `{what}`"));
    }
    let found = said(RIGHT, &[], Some("e(motor.supply.1)"));
    assert_eq!(found[0].code, "E0410");
    assert!(found[0].message.contains("a port has no parts"), "{}", found[0].message);
}
