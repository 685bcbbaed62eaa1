//! Tests of models that no instance is made of, and of signals that nothing reads.

use super::*;
use crate::bond::syntax::StatementKind;

fn program(name: &str, text: &str) -> (SourceMap, Program, Vec<Diagnostic>) {
    let (mut map, mut d) = (SourceMap::default(), vec![]);
    let file = map.add(name, text);
    let program = load(&mut map, file, &[], &mut d);
    (map, program, d)
}

fn said(text: &str) -> Vec<String> {
    let (map, program, mut d) = program("test.bg", text);
    elaborate(&program, &map, &Overrides::default(), &mut d);
    let at = |d: &Diagnostic| d.labels.first().map_or("", |l| map.text(l.span)).to_string();
    d.iter().map(|d| format!("{} {}: {}", d.code, at(d), d.message)).collect()
}

#[test]
fn models_without_instances_are_checked() {
    let model = |body: &str| {
        format!(
            "model M(k, L = 2 mH, n) {{\n  port in a : electrical\n  input u\n  a -> 1:m -> I:L\n  {body}\n}}\n"
        )
    };
    assert_eq!(said(&model("m -> R:r(k)")), [""; 0]);
    for (body, expected) in [
        ("m -> R:r(kk)", "E0208 kk: no parameter or signal is called `kk`"),
        ("m -> R:r(k*u + f(mm))", "E0206 mm: no element or junction is called `mm`"),
        ("mm -> R:r(k)", "E0206 mm: no element or junction is called `mm`"),
        ("m -> X:r(k)", "E0204 X: `X` is no kind of element"),
        ("m -> R:r(k)\n  1:m", "E0203 1:m: `m` is declared twice"),
        (
            "m -> R:r(1 F)",
            "E0307 1 F: the value of the dissipator `r` is a capacitance (F), but its electrical bond needs a resistance (Ohm)",
        ),
        (
            "m -> M:inner(k = 2, n = 2)",
            "E0239 M:inner(k = 2, n = 2): the model `M` contains itself",
        ),
        ("1:alone -> R:r(k)", "E0401 1:alone: the 1-junction `alone` has only one bond"),
        ("signal s = lagg(u, 1 s)", "E0210 lagg: unknown function `lagg`"),
        ("output y", "E0224 y: no signal is called `y`"),
        ("port out b", "E0411 port out b: nothing in its model joins the port `b`"),
        ("param z = 1/0", "E0213 1/0: `z` has no finite value"),
    ] {
        let found = said(&model(body));
        assert!(found.iter().any(|line| line == expected), "{body}: {found:?}");
        assert_eq!(found.len(), 1, "{body}: {found:?}");
    }
    // What depends on a parameter without a value is not looked at, and nothing is missing because of it.
    for body in [
        "param z = 1/(n - 1)",
        "for i in 1..n { m -> R:r[i](k) }\n  signal s = f(r[1])",
        "if n > 2 { m -> R:r(k) ; 1:x }\n  x -> R:y(3)\n  signal s = f(r)",
        "signal s = sum(i in 1..n, i*u)",
        "signal s[n] = u\n  signal t = s[1]",
        "C:c(e = q/k, e0 = 1/n)\n  m -> c",
        "signal s = lag(u, k)",
        "signal s = table(u, [0, 0; n, 1])",
        "param z = table(k, [0, 0; n, 1])",
    ] {
        assert_eq!(said(&model(body)), [""; 0], "{body}");
    }
    // A model that is used is said of once.
    let used = format!("{}M:x(k = 1, n = 1, u = 0)\nSe:U(3 V) -> x\n", model("m -> R:r(kk)"));
    assert_eq!(said(&used).len(), 1);
    // Models within models that nobody uses.
    let nested = "model A() {\n  port in p\n  p -> R:r(x)\n}\nmodel B() {\n  port in p\n  A:a()\n  p -> a.p\n}\n";
    assert_eq!(said(nested), ["E0208 x: no parameter or signal is called `x`"]);
}

#[test]
fn shipped_models_are_right_without_instances_and_values() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("models");
    let mut tried = 0;
    for folder in [folder.clone(), folder.join("std"), folder.join("textbook")] {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_none_or(|ending| ending != "bg") {
                continue;
            }
            let text = std::fs::read_to_string(&path).unwrap();
            let (map, whole, mut d) = program(&path.to_string_lossy(), &text);
            elaborate(&whole, &map, &Overrides::default(), &mut d);
            let warned: Vec<_> = d.iter().filter(|d| d.code == "W0203").collect();
            assert!(warned.is_empty(), "{}: {warned:?}", path.display());
            // Nothing but its models, none of whose parameters has a value.
            let (map, mut models, mut d) = program(&path.to_string_lossy(), &text);
            models.files[0].statements.retain_mut(|statement| match &mut statement.kind {
                StatementKind::Model(model) => {
                    model.parameters.iter_mut().for_each(|parameter| parameter.default = None);
                    tried += 1;
                    true
                }
                StatementKind::Import(_) => true,
                _ => false,
            });
            elaborate(&models, &map, &Overrides::default(), &mut d);
            assert!(d.is_empty(), "{}: {d:?}", path.display());
        }
    }
    assert!(tried >= 20, "{tried}");
}

#[test]
fn many_models_without_instances_take_no_long() {
    let mut text = String::new();
    for k in 0..20_000 {
        text += &format!("model M{k}() {{ port in p\n p -> R:r(1) }}\n");
    }
    let start = std::time::Instant::now();
    assert_eq!(said(&text), [""; 0]);
    assert!(start.elapsed().as_secs() < 20, "{:?}", start.elapsed());
}

#[test]
fn a_signal_that_nothing_reads() {
    let around = "Se:U(1) -> 1:m -> R:r(2)\nm -> I:l(1)\nsignal x = f(m)\n";
    let warning = ["W0203 x: nothing reads the signal `x`"];
    assert_eq!(said(&format!("{around}observe f(l)")), warning);
    for reader in [
        "observe x",
        "observe f(l), 2*x",
        "observe all",
        "observe f(l)\noutput x",
        "observe f(l)\nm -> R:r2(x)",
        "observe f(l)\nsignal y = x\noutput y",
        "observe f(l)\nsignal y = integ(x)\noutput y",
        "observe f(l)\nm -> Se:opposes(lag(x, 1))",
        "observe f(l)\nmodel A() {\n input u\n signal z = u\n output z\n}\nA:a(u = x)\nsignal y = a.z\noutput y",
        "observe f(l)\ninput w\ndrive w = x\nm -> R:r2(w)",
        // Without `observe` all signals are columns.
        "simulate until 1 s",
    ] {
        assert_eq!(said(&format!("{around}{reader}")), [""; 0], "{reader}");
    }
    // It reads itself.
    let own = "Se:U(1) -> 1:m -> R:r(2)\nsignal x = pi(f(m), Kp = 1, Ki = 1, lo = 0, hi = 1)\nobserve f(m)";
    assert_eq!(said(own), warning);
}
