//! Tests of reading.

use super::*;
use crate::bond::graph::Stroke;
use crate::diagnostic::Diagnostic;
use crate::expr::{Binary, Node};
use crate::source::SourceMap;
use proptest::prelude::*;

const ACTUATOR: &str = include_str!("../../../models/eha_one_line.bg");

fn read(text: &str) -> (File, Vec<Diagnostic>, SourceMap) {
    let mut map = SourceMap::default();
    let file = map.add("test.bg", text);
    let mut d = vec![];
    let file = parse(&map, file, &mut d);
    (file, d, map)
}

/// The statements of a text without errors.
fn good(text: &str) -> Vec<StatementKind> {
    let (file, d, _) = read(text);
    assert_eq!(d, [], "{text}");
    file.statements.into_iter().map(|statement| statement.kind).collect()
}

/// The value of `param x = …`.
fn value(text: &str) -> Expr {
    match good(&format!("param x = {text}")).pop() {
        Some(StatementKind::Parameter { value, .. }) => value,
        other => panic!("{other:?}"),
    }
}

/// Each diagnostic as `CODE text-pointed-at`.
#[track_caller]
fn errors(text: &str, expected: &[&str]) -> Vec<Diagnostic> {
    let (_, d, map) = read(text);
    let found: Vec<String> = d
        .iter()
        .map(|d| format!("{} {}", d.code, d.labels.first().map_or("", |l| map.text(l.span))))
        .collect();
    assert_eq!(found, expected, "{text}\n{d:#?}");
    d
}

#[test]
fn the_actuator_reads() {
    let (file, d, map) = read(ACTUATOR);
    assert_eq!(d, []);
    assert_eq!(file.statements.len(), 59);
    // Statements and trivia together hold every byte: a formatter loses nothing.
    let mut covered = vec![false; ACTUATOR.len()];
    let statements = file.statements.iter().map(|statement| statement.span);
    for span in statements.chain(file.trivia.iter().map(|trivia| trivia.span)) {
        covered[span.start as usize..span.end as usize].fill(true);
    }
    assert!(covered.iter().all(|covered| *covered));
    let comments = file.trivia.iter().filter(|trivia| trivia.kind == TriviaKind::Comment);
    assert!(comments.clone().all(|trivia| map.text(trivia.span).starts_with('#')));
    assert_eq!(comments.count(), ACTUATOR.matches('#').count());
}

#[test]
fn where_statements_end() {
    assert_eq!(good("1:a; 1:b\n\n1:c # ; 1:d\n;;\n").len(), 3);
    assert_eq!(good("a ->\n  b,\n\n  c\nd -> e").len(), 2);
    assert_eq!(good("signal x = pwl(0, 1;\n 1, 2 # corner\n)\r\n1:b").len(), 2);
    assert_eq!(good("").len(), 0);
    assert_eq!(good("# only a comment").len(), 0);
    assert_eq!(good("observe a,\n  b # list\n").len(), 1);
}

#[test]
fn numbers_and_their_units() {
    for (text, number, unit) in [
        ("1.2 mH", 1.2e-3, "mH"),
        ("1.2mH", 1.2e-3, "mH"),
        ("270 V", 270.0, "V"),
        ("8 cm^3/rad", 8e-6, "cm^3/rad"),
        ("1e-11 m^3/(s*Pa)", 1e-11, "m^3/(s*Pa)"),
        ("0.1 A^-1*s^-1", 0.1, "A^-1*s^-1"),
        ("5 %", 0.05, "%"),
        (".5 kΩ", 500.0, "kΩ"),
        ("3e3rpm", 3e3 * std::f64::consts::PI / 30.0, "rpm"),
        ("1.5811388300841898e6 Pa^0.5*s/m^3", 1.5811388300841898e6, "Pa^0.5*s/m^3"),
        ("2 N*m", 2.0, "N*m"),
        ("36 mm", 0.036, "mm"),
    ] {
        match &*value(text).node {
            Node::Leaf(Leaf::Quantity(found, name)) => {
                assert!((found - number).abs() <= 1e-15 * number, "{text}: {found}");
                assert_eq!(name.text, unit);
            }
            other => panic!("{text}: {other:?}"),
        }
    }
    // Blanks around an operator end the unit, and so does anything that is no unit.
    for text in ["2 N * m", "2 N*x", "2 N/(x + 1)", "2 N^x", "2 N - 1"] {
        match &*value(text).node {
            Node::Binary(_, a, _) => {
                assert!(
                    matches!(&*a.node, Node::Leaf(Leaf::Quantity(_, unit)) if unit.text == "N"),
                    "{text}"
                );
            }
            other => panic!("{text}: {other:?}"),
        }
    }
    // Words that never are units.
    assert!(matches!(&*value("if 1 then 2 else 3").node, Node::If(..)));
    assert!(matches!(&*value("1 and 2 or not 3").node, Node::Binary(Binary::Or, ..)));
    let observe = &good("observe 2 as \"two\", x in mm")[0];
    let StatementKind::Observe(items) = observe else { panic!() };
    assert_eq!(items[0].name.as_ref().unwrap().text, "two");
    assert_eq!(items[1].unit.as_ref().unwrap().0.text, "mm");
    let StatementKind::Simulate { until, step } = &good("simulate until 20 step 1")[0] else {
        panic!()
    };
    assert!(until.is_some() && step.is_some());
}

#[test]
fn chains() {
    let StatementKind::Chain(chain) =
        &good("Se:U(1 V) ->| TF:t(r = 2) |-> t2.1 -> R:a, b, C:c(1, q0 = 2)")[0]
    else {
        panic!()
    };
    assert_eq!(chain.first[0].kind.as_ref().unwrap().text, "Se");
    let strokes: Vec<_> = chain.links.iter().map(|(arrow, _)| arrow.stroke).collect();
    assert_eq!(strokes, [Some(Stroke::AtTo), Some(Stroke::AtFrom), None]);
    assert_eq!(chain.links[1].1[0].path.text(), "t2.1");
    let ends = &chain.links[2].1;
    assert_eq!(ends.len(), 3);
    let arguments = ends[2].arguments.as_ref().unwrap();
    assert_eq!(arguments[1].label.as_ref().unwrap().name.text, "q0");
    // Statement words may name elements where no statement of theirs stands.
    for text in ["input -> R:x", "loop", "param.1 -> x", "model, signal", "Se:for(1) -> observe"] {
        assert!(matches!(good(text)[0], StatementKind::Chain(_)), "{text}");
    }
    let StatementKind::Chain(chain) = &good("C:c(der(e) = beta/(Vt + S*x)*f, e0 = P)")[0] else {
        panic!()
    };
    let label = chain.first[0].arguments.as_ref().unwrap()[0].label.clone().unwrap();
    assert!(label.derivative && label.name.text == "e");
}

#[test]
fn unicode_names_and_blanks() {
    let statements = good("param Φ\u{a0}= 2 Wb\u{a0}\u{a0}\nGY:Φ_größe(Φ)\nparam Ω = 3 Ω");
    assert_eq!(statements.len(), 3);
}

#[test]
fn recovery_at_statements() {
    errors(
        "param = 3\nparam L = 2 mHH\n1:a -> \n\nparam ok = 1\nR R:x",
        &["E0101 =", "E0301 mHH", "E0101 ok", "E0101 R"],
    );
    // An unclosed bracket costs its statement only.
    let d =
        errors("signal x = integ(f(rod)\nparam a = 1 ++\n1:m -> R:r(1)", &["E0104 (", "E0101 +"]);
    assert_eq!(d[0].labels[0].span.start, 16);
    errors("a -> R:r(1]\nparam b = )\n}", &["E0105 ]", "E0105 )", "E0105 }"]);
    errors("param a = 1 \"open\nparam b = $", &["E0103 \"open", "E0102 $"]);
    let fixed = errors("a → b", &["E0102 →"]);
    assert_eq!(fixed[0].fix.as_ref().unwrap().edits[0].1, "->");
}

#[test]
fn what_was_meant() {
    for (text, code, help) in [
        ("L = 3 mH", "E0101 =", "`param L = …`"),
        ("parm L = 3", "E0101 L", "`param`"),
        ("R x", "E0101 x", "`R:x`"),
        ("a > b", "E0101 >", "`->`"),
        ("param x = 2  mH", "E0101 mH", "at most one blank"),
        ("param x = 2 uFF", "E0301 uFF", "`uF`"),
        ("param x = 2 ohm", "E0301 ohm", "`Ohm`"),
        ("param x = 3 Nm", "E0301 Nm", "`N*m`"),
        ("param x = 3 y", "E0301 y", "`*`"),
        ("signal x = a = b", "E0101 =", "`==`"),
        ("a, b -> c", "E0109 b", "statement of its own"),
        ("a -> R:r(1; 2)", "E0114 (1; 2)", ""),
        ("simulate until 1 until 2", "E0115 until 2", ""),
        ("param x = 1e400", "E0107 1e400", ""),
        ("param x = 1 < 2 < 3", "E0113 <", "`and`"),
        ("param x = sqrt(1, 2)", "E0112 sqrt(1, 2)", ""),
        ("param x =", "E0101 =", ""),
        ("observe x in mmm", "E0301 mmm", ""),
        ("observe x in m^^2", "E0302 ^", "without blanks"),
    ] {
        let d = errors(text, &[code]);
        let found = d[0].help.clone().unwrap_or_default();
        let found = format!("{found} {}", d[0].labels[0].text);
        assert!(found.contains(help), "{text}: {found}");
    }
}

#[test]
fn depth_and_length() {
    // As much stack as the main thread has; without optimisation a level costs some 15 kB.
    let deep = std::thread::Builder::new().stack_size(8 << 20).spawn(depth_and_length_in_a_thread);
    deep.unwrap().join().unwrap();
}

fn depth_and_length_in_a_thread() {
    for (open, close) in
        [("(", ")"), ("-(", ")"), ("sqrt(", ")"), ("pi(", ")"), ("if 1 then (", ") else 0")]
    {
        let deep = |n: usize| format!("param x = {}1{}", open.repeat(n), close.repeat(n));
        assert_eq!(read(&deep(if open.starts_with("if") { 90 } else { 190 })).1, []);
        errors(&deep(10_000), &[if open.starts_with("if") { "E0110 i" } else { "E0110 (" }]);
    }
    errors(&format!("param x = {}", "(".repeat(10_000)), &["E0104 ("]);
    assert_eq!(read(&format!("param x = 1{}", " + 1".repeat(20_000))).1, []);
    assert_eq!(read(&format!("param x = {}1", "- ".repeat(500))).1, []);
    let (_, d, _) = read(&format!("param x = 2{}", "^2".repeat(20_000)));
    assert_eq!(d.iter().map(|d| d.code).collect::<Vec<_>>(), ["E0110"]);
}

#[test]
fn garbage_ends_soon() {
    let text: String = (0..1000).map(|k| format!("$%& {k}\n")).collect();
    let (_, d, _) = read(&text);
    assert_eq!(d.len(), 6, "nothing can be read: a few errors are enough");
    assert_eq!(d.last().unwrap().code, "N0101");
    let (_, d, _) = read(&format!("Se:U(1) -> R:r(1)\n{text}"));
    assert_eq!(d.len(), 31);
    assert_eq!(d.last().unwrap().code, "N0101");
}

fn elaborated(text: &str) {
    let mut map = SourceMap::default();
    let file = map.add("test.bg", text);
    let mut d = vec![];
    let file = parse(&map, file, &mut d);
    let graph = crate::bond::elaborate::elaborate(&file.into(), &map, &Default::default(), &mut d);
    assert_eq!(graph.is_none(), crate::diagnostic::has_errors(&d));
    for label in d.iter().flat_map(|d| &d.labels) {
        let span = label.span;
        assert!(span.is_none() || text.get(span.start as usize..span.end as usize).is_some());
    }
}

const TOKENS: &[&str] = &[
    "param ",
    "signal ",
    "input ",
    "output ",
    "drive ",
    "simulate ",
    "options ",
    "observe ",
    "loop ",
    "model ",
    "for ",
    "Se:",
    "R:",
    "C:",
    "1:",
    "0:",
    "TF:",
    "GY:",
    "x",
    "y",
    "z",
    "t.1",
    "t.2",
    " -> ",
    " ->| ",
    " |-> ",
    ", ",
    "(",
    ")",
    "[",
    "]",
    "{",
    "}",
    ";",
    "\n",
    "=",
    "==",
    "+",
    "-",
    "*",
    "/",
    "^",
    "1",
    "2.5",
    "1e3",
    " mm",
    " N*m",
    " V",
    "e",
    "f",
    "q",
    "p",
    "pi",
    "time",
    "pi(",
    "e(",
    "f(",
    "integ(",
    "lag(",
    "pwl(",
    "step(",
    "table(",
    "der(e)",
    "q0 = ",
    "if ",
    " then ",
    " else ",
    " and ",
    "not ",
    " in ",
    " as ",
    "\"text\"",
    "#",
    " ",
    "until ",
    "step ",
    "Φ",
    "→",
    "\u{1}",
    "..",
    ".",
    "%",
    "sqrt(",
    "clamp(",
    "e = ",
    "gain = ",
];

proptest! {
    #[test]
    fn any_text_is_survived(text in "\\PC{0,80}") {
        elaborated(&text);
    }

    #[test]
    fn any_bytes_are_survived(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
        elaborated(&String::from_utf8_lossy(&bytes));
    }

    #[test]
    fn any_soup_of_tokens_is_survived(picks in proptest::collection::vec(0..TOKENS.len(), 0..60)) {
        let text: String = picks.into_iter().map(|k| TOKENS[k]).collect();
        elaborated(&text);
    }

    #[test]
    fn any_change_of_a_file_is_survived(
        at in 0..ACTUATOR.len(), length in 0usize..60, token in 0..TOKENS.len(), twice in 0..ACTUATOR.len(),
    ) {
        let mut text = ACTUATOR.to_string();
        for at in [at, twice] {
            let floor = |mut at: usize| {
                at = at.min(text.len());
                while !text.is_char_boundary(at) { at -= 1; }
                at
            };
            let (from, to) = (floor(at), floor(at + length));
            text.replace_range(from..to, TOKENS[token]);
        }
        elaborated(&text);
    }
}

/// The one model of a text without errors, and its body.
fn model(text: &str) -> Model {
    let mut statements = good(text);
    assert_eq!(statements.len(), 1, "{text}");
    match statements.pop() {
        Some(StatementKind::Model(model)) => model,
        other => panic!("{other:?}"),
    }
}

#[test]
fn models_and_their_ports() {
    let motor = model(
        "model DcMotor(L = 1.2 mH, R = 0.1 Ohm, Phi = 0.5 V*s, Jmp, fmp = 0 N*m*s) {
           port in  supply : electrical
           port out shaft  : rotation # the far side
           port in h[k] : pseudo-thermal; port in free
           supply -> 1:armature -> GY:Phi -> 1:rotor -> shaft
           armature -> I:L, R:R
           rotor -> I:Jmp,
                    R:fmp
         }",
    );
    assert_eq!(motor.name.text, "DcMotor");
    let defaults: Vec<_> =
        motor.parameters.iter().map(|p| (p.name.text.as_str(), p.default.is_some())).collect();
    assert_eq!(defaults, [("L", true), ("R", true), ("Phi", true), ("Jmp", false), ("fmp", true)]);
    assert_eq!(motor.body.len(), 7);
    let ports: Vec<_> = motor
        .body
        .iter()
        .filter_map(|statement| match &statement.kind {
            StatementKind::Port(port) => {
                let domain = port.domain.as_ref().map_or("", |domain| domain.text.as_str());
                Some((port.into, port.name.text.as_str(), port.name.indices.len(), domain))
            }
            _ => None,
        })
        .collect();
    assert_eq!(
        ports,
        [
            (true, "supply", 0, "electrical"),
            (false, "shaft", 0, "rotation"),
            (true, "h", 1, "pseudo-thermal"),
            (true, "free", 0, "")
        ]
    );
    // The brace may stand on the next line; empty bodies; a header without parameters.
    assert!(model("model A\n\n{\n}").body.is_empty());
    assert!(model("model A() {}").parameters.is_empty());
    assert_eq!(model("model A(x = 1,\n y) { 1:a; 1:b }").body.len(), 2);
    let StatementKind::Import(file) = &good("import \"std/hydraulic.bg\"")[0] else { panic!() };
    assert_eq!(file.text, "std/hydraulic.bg");
}

#[test]
fn blocks() {
    let StatementKind::For { variable, range, body } =
        &good("for k in 1..N { EHA:eha[k](x_ref = r[k]) ; bus -> eha[k].supply }")[0]
    else {
        panic!()
    };
    assert_eq!((variable.text.as_str(), range.0.as_number()), ("k", Some(1.0)));
    assert_eq!(body.len(), 2);
    let StatementKind::Chain(chain) = &body[1].kind else { panic!() };
    let path = &chain.links[0].1[0].path;
    assert_eq!((path.text().as_str(), path.name.indices.len()), ("eha.supply", 1));
    let text = "if k > 1 {\n a\n} # one\nelse if (k == 1) { b } else {\n c ; d\n}\n1:x";
    let statements = good(text);
    assert_eq!(statements.len(), 2);
    let StatementKind::If { then, otherwise, .. } = &statements[0] else { panic!() };
    assert_eq!((then.len(), otherwise.len()), (1, 1));
    let StatementKind::If { then, otherwise, .. } = &otherwise[0].kind else { panic!() };
    assert_eq!((then.len(), otherwise.len()), (1, 2));
    // `else` is a word only after a block of `if`.
    assert_eq!(good("for k in 1..2 { a }\nelse -> R:r").len(), 2);
    // Ranges.
    for text in ["1..3", "1 .. N", "a..b", "k+1..2*N-1", "n[1]..m.2", "1...5", "p[1].n..3"] {
        assert!(matches!(&good(&format!("for k in {text} {{}}"))[0], StatementKind::For { .. }));
    }
    let StatementKind::Loop(regulator) =
        &good("loop motor.alpha: f(armature) follows I_ref, bandwidth 2000 rad/s,\n margin 60 deg")
            [0]
    else {
        panic!()
    };
    assert_eq!(regulator.signal.text(), "motor.alpha");
    assert!(regulator.bandwidth.is_some() && regulator.margin.is_some());
    assert!(matches!(&good("loop a: e(x) follows b")[0], StatementKind::Loop(_)));
}

#[test]
fn indexed_names() {
    let StatementKind::Chain(chain) =
        &good("EHA:eha[k](2) -> eha[k+1].motor.ph[2] -> m[i, j].1")[0]
    else {
        panic!()
    };
    let ends: Vec<&Path> =
        chain.first.iter().chain(chain.links.iter().flat_map(|l| &l.1)).map(|e| &e.path).collect();
    let shape = |path: &Path| {
        path.parts().map(|p| format!("{}{}", p.text, p.indices.len())).collect::<Vec<_>>()
    };
    assert_eq!(shape(ends[0]), ["eha1"]);
    assert_eq!(shape(ends[1]), ["eha1", "motor0", "ph1"]);
    assert_eq!(shape(ends[2]), ["m2", "10"]);
    for text in [
        "param R[k] = 2 Ohm \"of phase k\"",
        "signal x[k, 2] = integ(f(rod[k]))",
        "input x[k], y",
        "output x[1], y[2]",
        "drive x[k] = step(0, 0, 1)",
        "observe e(eha[1].pump) in bar, sum(k in 1..3, x[k]) as \"all\"",
        "input[2] -> R:for[3]",
    ] {
        good(text);
    }
    let Node::Leaf(Leaf::Sum(sum)) = &*value("sum(k in 1..N, sum(j in k..N, x[j]*k))").node else {
        panic!()
    };
    assert_eq!(sum.variable.text, "k");
    assert!(matches!(&*sum.term.node, Node::Leaf(Leaf::Sum(_))));
    // Readings of bonds, with and without a number.
    for text in ["f(a[1] -> b.c)", "power(a -> b[k])[2]", "e(a\n -> b)"] {
        let Node::Leaf(Leaf::Call(call)) = value(text).node.as_ref().clone() else { panic!() };
        assert!(matches!(call.rows[0][0].value, Value::Bond(..)), "{text}");
        assert_eq!(call.index.is_some(), text.ends_with(']') && !text.ends_with("k])"), "{text}");
    }
    errors("param x = e(a + 1 -> b)", &["E0111 a + 1"]);
    errors("param x = sqrt(a -> b)", &["E0111 ->"]);
    errors("param x = clamp(lo = 1, hi = 2, x = 3)", &["E0111 lo = 1"]);
}

#[test]
fn errors_within_blocks_cost_their_line() {
    let body = |text: &str, expected: &[&str]| {
        let (file, d, map) = read(text);
        errors(text, expected);
        let kinds: Vec<_> = file
            .statements
            .iter()
            .map(|s| match &s.kind {
                StatementKind::Model(model) => format!("model {}", model.body.len()),
                StatementKind::For { body, .. } => format!("for {}", body.len()),
                StatementKind::Unreadable => "?".to_string(),
                _ => map.text(s.span).to_string(),
            })
            .collect();
        (kinds.join(", "), d)
    };
    let kinds = |text: &str, expected: &[&str]| body(text, expected).0;
    assert_eq!(kinds("model A {\n 1:a -> +\n 1:b\n}\n1:c", &["E0101 +"]), "model 2, 1:c");
    assert_eq!(kinds("model A {\n R:r(1\n 1:b -> c\n}\n1:c", &["E0104 ("]), "model 2, 1:c");
    assert_eq!(kinds("model A {\n R:r(1\n}\n1:c", &["E0104 ("]), "model 1, 1:c");
    assert_eq!(kinds("for k in 1..3 { R:r(1 }\n1:c", &["E0104 ("]), "for 1, 1:c");
    assert_eq!(kinds("model A(x = 1 {\n 1:b +\n}\n1:c", &["E0104 (", "E0101 +"]), "?, 1:c");
    assert_eq!(kinds("1:a\n}\n1:c", &["E0105 }"]), "1:a, 1:c");
    assert_eq!(kinds("R:x({1})\n1:c", &["E0101 {"]), "?, 1:c");
    assert_eq!(kinds("param x = {1, 2}\n1:c", &["E0101 {"]), "?, 1:c");
    assert_eq!(kinds("{ 1:a }\n1:c", &["E0101 {"]), "?, 1:c");
    assert_eq!(kinds("for k in 1..3\n1:c", &["E0101 3"]), "?, 1:c");
    assert_eq!(kinds("for k 1..3 {\n 1:b\n}\n1:c", &["E0101 1"]), "?, 1:c");
    let (found, d) = body("modle A() {\n 1:b\n 1:d +\n}\n1:c", &["E0101 A", "E0101 +"]);
    assert_eq!(found, "?, 1:c");
    assert!(d[0].help.as_ref().unwrap().contains("`model`"));
    // One error for a brace that is missing, at the block that misses it.
    let (found, d) = body("1:a\nmodel A {\n  for k in 1..3 {\n    1:b[k]\n}\n1:c", &["E0104 {"]);
    assert_eq!((found.as_str(), d[0].labels[0].span.start), ("1:a, model 2, ?", 30));
    let (found, d) = body("model A {\n 1:a\nmodel B {\n 1:b\n}\n1:c", &["E0104 {"]);
    assert_eq!((found.as_str(), d[0].labels[0].span.start), ("model 1, ?, model 1, 1:c", 8));
    let (found, d) = body("if 1 { for k in 1..2 {\n 1:a", &["E0104 {"]);
    assert_eq!(
        (found.as_str(), d[0].labels[0].span.start),
        ("if 1 { for k in 1..2 {\n 1:a, ?", 21)
    );
}

#[test]
fn blocks_are_not_nested_without_end() {
    let deep = |n: usize| format!("{}1:a{}", "if 1 { ".repeat(n), " }".repeat(n));
    assert_eq!(read(&deep(60)).1, []);
    errors(&deep(10_000), &["E0110 {"]);
    let ladder = |n: usize| format!("if 1 {{}}{}", " else if 1 {}".repeat(n));
    assert_eq!(read(&ladder(60)).1, []);
    errors(&ladder(10_000), &["E0110 {"]);
    errors(&"if 1 {".repeat(100_000), &["E0110 {", "E0104 {"]);
    let (_, d, _) = read(&"}".repeat(100_000));
    assert_eq!(d.len(), 6);
}
