//! Tests of the layout: of shipped files, of the rules, and of random files of the whole language.

use super::expression::BondParser;
use super::generate::Generator;
use super::scan::{Scan, Step};
use super::statement::rule;
use super::*;
use crate::diagnostic::has_errors;
use crate::source::{SourceMap, Span};
use pest::Parser;
use std::collections::BTreeMap;

/// A tree without its places.
fn shape(file: &File) -> String {
    let text = format!("{:?}", file.statements);
    let mut shape = String::with_capacity(text.len() / 2);
    let mut rest = text.as_str();
    while let Some(at) = rest.find("Span {") {
        shape.push_str(&rest[..at]);
        rest = rest[at..].split_once("end: ").unwrap().1.split_once('}').unwrap().1;
    }
    shape + rest
}

/// Lays out a text and checks all that holds of any layout; else says what does not.
fn checked(text: &str) -> Result<String, String> {
    let mut map = SourceMap::default();
    let mut d = vec![];
    let file = map.add("before.bg", text);
    let before = parse(&map, file, &mut d);
    if has_errors(&d) {
        return Err(format!("does not parse:\n{text}\n{d:#?}"));
    }
    let formatted = layout(text);
    let wrong = |what: &str| Err(format!("{what}:\n{text}\n---\n{formatted}"));
    if !same_tokens(text, &formatted) {
        return wrong("tokens are lost");
    }
    let file = map.add("after.bg", formatted.clone());
    let after = parse(&map, file, &mut d);
    if has_errors(&d) {
        return wrong(&format!("does not parse any more: {d:#?}"));
    }
    if shape(&before) != shape(&after) {
        return wrong("is another tree");
    }
    let twice = layout(&formatted);
    if twice != formatted {
        return wrong(&format!("twice is not once:\n{twice}\n---"));
    }
    if formatted.lines().any(|line| line.trim_end() != line) {
        return wrong("blanks at the end of a line");
    }
    Ok(formatted)
}

#[track_caller]
fn laid_out(text: &str) -> String {
    checked(text).unwrap_or_else(|wrong| panic!("{wrong}"))
}

#[track_caller]
fn becomes(text: &str, expected: &str) {
    assert_eq!(laid_out(text), expected);
}

#[test]
fn shipped_files_are_laid_out() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("models");
    let mut folders = vec![root];
    let mut files = 0;
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|ending| ending == "bg") {
                let text = std::fs::read_to_string(&path).unwrap();
                assert_eq!(laid_out(&text), text, "bondspice fmt {}", path.display());
                files += 1;
            }
        }
    }
    assert!(files >= 20, "{files} files");
}

#[test]
fn blanks() {
    becomes("Se:U( 10 V  )->1 : mesh", "Se:U(10 V) -> 1:mesh\n");
    becomes("mesh->I:L(1mH),R:R (2  )", "mesh -> I:L(1 mH), R:R(2)\n");
    becomes("param a=2*b +3/ c^2-d - -1", "param a = 2*b + 3 / c^2-d - -1\n");
    becomes("param a=2 N * m+2 N*m", "param a = 2 N * m+2 N*m\n");
    becomes("param a = - 1\nparam b = ( -x )", "param a = -1\nparam b = (-x)\n");
    becomes(
        "signal x=if a<b and(c)then -1 else sqrt( 2 )",
        "signal x = if a < b and (c) then -1 else sqrt(2)\n",
    );
    becomes("signal x = pwl(0,1;2 ,3)", "signal x = pwl(0, 1; 2, 3)\n");
    becomes("R:r(e=2*f , e0 =1);;1:b", "R:r(e = 2*f, e0 = 1);; 1:b\n");
    becomes("for k in 1 .. N {a[ k+1 ].b->t.1}", "for k in 1..N { a[k+1].b -> t.1 }\n");
    becomes(
        "observe  x in  m^3/(s*Pa) as\"x\",e(a->b) [1]",
        "observe x in m^3/(s*Pa) as \"x\", e(a -> b)[1]\n",
    );
    becomes("loop a :f(x)follows b,margin 60deg", "loop a: f(x) follows b, margin 60 deg\n");
    becomes("simulate until 20  step(2)", "simulate until 20 step (2)\n");
    becomes("param x = 5%+5 %", "param x = 5%+5 %\n");
}

#[test]
fn lines_and_blocks() {
    becomes("\n\n# head\n\n\n1:a   # why  \n\n\n\n1:b\n\n", "# head\n\n1:a  # why\n\n1:b\n");
    becomes("model A(x)\n{\n\n1:a;1:b }", "model A(x) {\n  1:a; 1:b\n}\n");
    becomes("for k in 1..2 { 1:a }1:b", "for k in 1..2 { 1:a }\n1:b\n");
    becomes(
        "if 1 {\n1:a\n}\n\n# no\nelse if 2\n{1:b\n} else{ }",
        "if 1 {\n  1:a\n}\n\n# no\nelse if 2 {\n  1:b\n} else {}\n",
    );
    becomes("if 1 { if 2 {a} b }", "if 1 { if 2 { a } b }\n");
    becomes(
        "model A { # what\n # more\n 1:a -> # here\n R:r # there\n}",
        "model A {  # what\n  # more\n  1:a ->   # here\n      R:r  # there\n}\n",
    );
    becomes("signal x = pwl(\n0, 1;\n1, 2\n)\n", "signal x = pwl(\n    0, 1;\n    1, 2\n)\n");
}

#[test]
fn columns() {
    becomes(
        "param a = 1 V \"first\"\nparam bcd = 20 Ohm  \"second\"\nparam e = 1\n\n# other\nparam f = 3 \"third\"",
        "param a   = 1 V     \"first\"\nparam bcd = 20 Ohm  \"second\"\nparam e   = 1\n\n# other\nparam f = 3         \"third\"\n",
    );
    becomes(
        "a -> b\nlonger -> c\nSe:x -> d\ne -> f",
        "a      -> b\nlonger -> c\nSe:x -> d\ne -> f\n",
    );
    becomes("a # one\nlonger # two", "a       # one\nlonger  # two\n");
    becomes(
        "model A {\nport in supply : electrical\nport out s:rotation\nport in x\n}",
        "model A {\n  port in  supply : electrical\n  port out s      : rotation\n  port in  x\n}\n",
    );
}

#[test]
fn long_chains_go_on_in_the_next_line() {
    let chain: Vec<String> = (0..30).map(|k| format!("1:junction_{k}")).collect();
    let text = laid_out(&chain.join(" -> "));
    assert!(text.lines().count() > 3);
    assert!(text.lines().all(|line| line.chars().count() <= WIDTH), "{text}");
    assert!(text.lines().skip(1).all(|line| line.starts_with("    1:")), "{text}");
    let list: Vec<String> = (0..60).map(|k| format!("R:r{k}(2)")).collect();
    let text = laid_out(&format!("a -> {}\nabc -> b", list.join(", ")));
    assert!(text.starts_with("a -> R:r0(2),") && text.contains("\nabc -> b\n"), "{text}");
    // Brackets stay whole.
    let call = format!("signal x = pwl({}1)", "1, ".repeat(100));
    assert_eq!(laid_out(&call).lines().count(), 1);
}

#[test]
fn ten_thousand_random_files_reach_every_rule() {
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    let mut wrong = vec![];
    for seed in 0..10_000 {
        let text = Generator::new(seed).file();
        match checked(&text) {
            Ok(_) => count_rules(&text, &mut counts),
            Err(what) => wrong.push(format!("seed {seed}: {what}")),
        }
    }
    // The shortest says it best.
    wrong.sort_by_key(String::len);
    let shown = wrong.iter().take(3).map(String::as_str).collect::<Vec<_>>().join("\n=====\n");
    assert!(wrong.is_empty(), "{} files\n{shown}", wrong.len());
    let reached = |rule: &str| counts.get(rule).copied().unwrap_or(0) > 0;
    // What gives no pair of its own is reached with one that cannot stand without it.
    let silent = [
        ("WHITESPACE", "chain_statement"),
        ("header", "header_parameter"),
        ("range", "dots"),
        ("operand", "expression"),
        ("prefix", "op_not"),
        ("atom", "number"),
        ("arguments", "labelled"),
        ("argument", "labelled"),
        ("infix", "op_times"),
        ("identifier", "name"),
        ("word_end", "key_if"),
        ("reserved", "reference"),
    ];
    // Of other languages, and of the command line.
    let foreign = ["question", "colon"];
    let alone = ["value_alone", "observe_alone", "drive_alone"];
    let grammar = concat!(
        include_str!("../../../grammar/bond.pest"),
        include_str!("../../../grammar/expression.pest")
    );
    let rules: Vec<&str> = grammar
        .lines()
        .filter(|line| !line.starts_with("//") && !line.starts_with(' '))
        .filter_map(|line| line.split_once(" = ").or(line.split_once("= ")))
        .map(|(name, _)| name.trim())
        .filter(|name| !foreign.contains(name) && !alone.contains(name))
        .collect();
    assert!(rules.len() > 80, "{rules:?}");
    let missed: Vec<&&str> = rules
        .iter()
        .filter(|rule| match silent.iter().find(|(name, _)| name == *rule) {
            Some((_, evidence)) => !reached(evidence),
            None => !reached(rule),
        })
        .collect();
    assert!(missed.is_empty(), "never reached: {missed:?}\n{counts:#?}");
}

/// Counts the rules of each statement and head of a text.
fn count_rules(text: &str, counts: &mut BTreeMap<String, usize>) {
    let scan = Scan::new(Span::NONE.file, text);
    let mut at = 0;
    while let Some(step) = scan.step(at, &mut vec![]) {
        at = match step {
            Step::Piece(piece) => {
                let masked = scan.masked(piece.span);
                let pairs = BondParser::parse(rule(masked), masked).unwrap();
                for pair in pairs.flatten() {
                    *counts.entry(format!("{:?}", pair.as_rule())).or_default() += 1;
                }
                piece.next
            }
            Step::Closes(_, next) => match scan.otherwise(next) {
                Some(after) => scan.brace(after).map_or(after, |(_, next)| next),
                None => next,
            },
        };
    }
}

#[test]
fn classes_of_tokens() {
    let classes = |text: &str| {
        let found = tokens(text).into_iter().filter(|(class, _)| *class != Class::Blank);
        found
            .map(|(class, span)| format!("{} {class:?}", &text[span]))
            .collect::<Vec<_>>()
            .join(", ")
    };
    assert_eq!(
        classes("simulate until step(1 s) step 1 ms # end"),
        "simulate Word, until Word, step Function, ( Sign, 1 Number, s Unit, ) Sign, step Word, 1 Number, ms Unit, # end Comment"
    );
    assert_eq!(
        classes("1:step -> R:in(e = pi*step)"),
        "1 ElementKind, : Sign, step Name, -> Arrow, R ElementKind, : Sign, in Name, ( Sign, e Label, = Operator, pi Name, * Operator, step Name, ) Sign"
    );
    assert_eq!(
        classes("port in in : pseudo-thermal"),
        "port Word, in Word, in Name, : Sign, pseudo Domain, - Operator, thermal Domain"
    );
    assert_eq!(
        classes("if a { b } else { c }\nelse -> for"),
        "if Word, a Name, { Sign, b Name, } Sign, else Word, { Sign, c Name, } Sign, else Name, -> Arrow, for Name"
    );
    assert_eq!(
        classes("signal x = sum(k in 1..n, y[k])"),
        "signal Word, x Name, = Operator, sum Function, ( Sign, k Name, in Word, 1 Number, .. Sign, n Name, , Sign, y Name, [ Sign, k Name, ] Sign, ) Sign"
    );
}
