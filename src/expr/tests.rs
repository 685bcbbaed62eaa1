//! Tests of the shared grammar through two small languages, one for each dialect.

use super::parse::{self, Language, MAX_DEPTH, MAX_NESTING};
use super::print::print;
use super::{Binary, Dialect, Expr, Function, Node, Unary, roles};
use crate::diagnostic::Diagnostic;
use crate::source::{FileId, Span};
use pest::Parser;
use pest::iterators::Pair;
use proptest::prelude::*;

mod bond {
    #[derive(pest_derive::Parser)]
    #[grammar = "grammar/expression.pest"]
    #[grammar_inline = r#"
        WHITESPACE    = _{ " " | "\n" }
        whole         = { SOI ~ expression ~ EOI }
        number        = @{ ASCII_DIGIT+ ~ ("." ~ ASCII_DIGIT*)? ~ ("e" ~ ("+" | "-")? ~ ASCII_DIGIT+)? }
        name          = @{ !word ~ (LETTER | "_") ~ (LETTER | ASCII_DIGIT | "_")* }
        word          = @{ ("and" | "or" | "not" | "if" | "then" | "else") ~ word_end }
        reference     = { name }
        special       = { !ANY ~ ANY }
        function_name = @{ name ~ &"(" }
        argument      = _{ named | arrow | expression }
        named         = { name ~ "=" ~ !"=" ~ expression }
        arrow         = { name ~ "->" ~ name }
        after_call    = { !ANY ~ ANY }
        op_power      = @{ "^" }
        op_and        = @{ "and" ~ word_end }
        op_or         = @{ "or" ~ word_end }
        op_not        = @{ "not" ~ word_end }
        question      = { !ANY ~ ANY }
        colon         = { !ANY ~ ANY }
    "#]
    pub struct Grammar;
}

mod spice {
    #[derive(pest_derive::Parser)]
    #[grammar = "grammar/expression.pest"]
    #[grammar_inline = r#"
        WHITESPACE    = _{ " " }
        whole         = { SOI ~ expression ~ EOI }
        number        = @{ ASCII_DIGIT+ ~ ("." ~ ASCII_DIGIT*)? ~ ("e" ~ ("+" | "-")? ~ ASCII_DIGIT+)? }
        name          = @{ (LETTER | "_") ~ (LETTER | ASCII_DIGIT | "_")* }
        reference     = { name }
        special       = { probe }
        probe         = { ^"v" ~ "(" ~ name ~ ("," ~ name)? ~ ")" }
        function_name = @{ name ~ &"(" }
        argument      = _{ expression }
        after_call    = { !ANY ~ ANY }
        op_power      = @{ "^" | "**" }
        op_and        = @{ "&&" }
        op_or         = @{ "||" }
        op_not        = @{ "!" ~ !"=" }
        question      = { "?" }
        colon         = { ":" }
    "#]
    pub struct Grammar;
}

struct Toy;
struct ToySpice;

macro_rules! toy {
    ($toy:ident, $rule:ty, $rules:ident, $dialect:expr) => {
        impl Language for $toy {
            type Rule = $rule;
            type Leaf = String;
            roles!($rules);
            fn dialect(&self) -> Dialect {
                $dialect
            }
            fn span(&self, span: pest::Span<'_>) -> Span {
                Span::new(FileId(0), span.start(), span.end())
            }
            fn atom(
                &mut self,
                pair: Pair<'_, $rule>,
                d: &mut Vec<Diagnostic>,
            ) -> Option<Expr<String>> {
                let span = self.span(pair.as_span());
                let text = pair.as_str().trim();
                if pair.as_rule() == $rules::number {
                    return Some(Expr::new(Node::Number(text.parse().unwrap()), span));
                }
                if text == "unknown" {
                    d.push(Diagnostic::error("E0208", span, "unknown name"));
                    return None;
                }
                Some(Expr::new(Node::Leaf(text.to_string()), span))
            }
            fn call(
                &mut self,
                name: &str,
                pair: Pair<'_, $rule>,
                d: &mut Vec<Diagnostic>,
            ) -> Option<Expr<String>> {
                let span = self.span(pair.as_span());
                if name != "form" {
                    d.push(parse::unknown_function(Dialect::Bond, name, span));
                    return None;
                }
                let rules = pair.into_inner().map(|p| format!("{:?}", p.as_rule()));
                Some(Expr::leaf(rules.collect::<Vec<_>>().join(" ")))
            }
        }
    };
}

use bond::Rule as BondRule;
use spice::Rule as SpiceRule;
toy!(Toy, bond::Rule, BondRule, Dialect::Bond);
toy!(ToySpice, spice::Rule, SpiceRule, Dialect::Ngspice);

pub(super) fn parse_bond(text: &str) -> Result<Expr<String>, Vec<Diagnostic>> {
    if let Some(at) = parse::nesting(text, Some(b'#')) {
        return Err(vec![parse::too_deep(Span::new(FileId(0), at, at + 1))]);
    }
    let mut whole = bond::Grammar::parse(bond::Rule::whole, text).expect("it parses");
    let pair = whole.next().unwrap().into_inner().next().unwrap();
    let mut d = vec![];
    parse::expression(&mut Toy, pair, &mut d).ok_or(d)
}

fn parse_spice(text: &str) -> Result<Expr<String>, Vec<Diagnostic>> {
    let mut whole = spice::Grammar::parse(spice::Rule::whole, text).expect("it parses");
    let pair = whole.next().unwrap().into_inner().next().unwrap();
    let mut d = vec![];
    parse::expression(&mut ToySpice, pair, &mut d).ok_or(d)
}

fn value(text: &str) -> f64 {
    parse_bond(text).unwrap().evaluate(&mut |_| 3.0)
}

fn spice_value(text: &str) -> f64 {
    parse_spice(text).unwrap().evaluate(&mut |_| 3.0)
}

#[test]
fn operators_bind_as_in_the_language() {
    for (text, expected) in [
        ("1 + 2*3", 7.0),
        ("2*3 + 1", 7.0),
        ("10 - 4 - 3", 3.0),
        ("24/4/3", 2.0),
        ("-2^2", -4.0),
        ("2^3^2", 512.0),
        ("2^-1", 0.5),
        ("2^-1^2", 0.5),
        ("(-2)^2", 4.0),
        ("--3", 3.0),
        ("2*-3*4", -24.0),
        ("1 - -x", 4.0),
        ("not 1 == 2", 1.0),
        ("not 1 and 0", 0.0),
        ("not (1 and 0)", 1.0),
        ("1 or 0 and 0", 1.0),
        ("1 < 2 and 2 <= 2", 1.0),
        ("1 + 1 == 2", 1.0),
        ("1 != 1", 0.0),
        ("if x > 2 then 10 else 20 + 1", 10.0),
        ("1 + if x < 2 then 10 else 20 + 1", 22.0),
        ("if 0 then 1 else if 1 then 2 else 3", 2.0),
        ("max(1, 5, 2)", 5.0),
        ("clamp(x, 0, 2) * sqrt(4)", 4.0),
        ("if_then", 3.0),
        ("nothing+1", 4.0),
        ("1e3 + 1e-3", 1000.001),
    ] {
        assert_eq!(value(text), expected, "{text}");
    }
}

#[test]
fn netlists_have_their_own_operators() {
    for (text, expected) in [
        ("2**3", 8.0),
        ("2^3^2", 64.0),
        ("-2**2", -4.0),
        ("(-2)**3", 8.0),
        ("pwr(0-2, 3)", -8.0),
        ("log(1)", 0.0),
        ("SGN(-4)", -1.0),
        ("1 > 2 ? 3 : 4 > 3 ? 5 : 6", 5.0),
        ("!0 && 1 || 0", 1.0),
        ("!x+1", 1.0),
        ("u(-1) + u(0) + u(2)", 1.5),
        ("uramp(-1) + uramp(x)", 3.0),
        ("v(a, b) * V(c)", 9.0),
        ("(v(a) > 2) ? (1) : (2)", 1.0),
        ("ceil(1.2)", 2.0),
    ] {
        assert_eq!(spice_value(text), expected, "{text}");
    }
}

#[test]
fn spans_cover_what_they_mean() {
    let expr = parse_bond("1 + ab*(cd - 2)").unwrap();
    let Node::Binary(Binary::Add, _, product) = &*expr.node else { panic!() };
    let Node::Binary(Binary::Multiply, left, right) = &*product.node else { panic!() };
    assert_eq!((left.span.start, left.span.end), (4, 6));
    assert_eq!((right.span.start, right.span.end), (8, 14));
    assert_eq!((product.span.start, product.span.end), (4, 15));
    // Whole values and what a sign stands before have their brackets too.
    for (text, place) in
        [("( (1 + x) )", (0, 11)), ("-(1 + x)", (0, 8)), ("(1 + x)*2 - (3)", (0, 15))]
    {
        let expr = parse_bond(text).unwrap();
        assert_eq!((expr.span.start, expr.span.end), place, "{text}");
    }
}

#[test]
fn errors_are_collected() {
    let codes = |text| parse_bond(text).unwrap_err().iter().map(|d| d.code).collect::<Vec<_>>();
    assert_eq!(codes("unknown + sqrt(1, 2) * sqr(4)"), ["E0208", "E0112", "E0210"]);
    assert_eq!(codes("1 < x < 2"), ["E0113"]);
    assert_eq!(codes("max(1; 2)"), ["E0111"]);
    assert_eq!(codes("if unknown then unknown else 1"), ["E0208", "E0208"]);
    let help = parse_bond("sqr(4)").unwrap_err()[0].help.clone();
    assert_eq!(help.as_deref(), Some("did you mean `sqrt`?"));
}

#[test]
fn other_calls_go_to_the_language_as_they_are() {
    let Node::Leaf(rules) = *parse_bond("form(x, Kp = 2; a -> b)").unwrap().node else { panic!() };
    assert_eq!(rules, "function_name expression named row_break arrow");
}

#[test]
fn long_chains_are_balanced() {
    let n = 200_000;
    let sum = parse_bond(&vec!["1"; n].join("+")).unwrap();
    assert!(sum.depth() < 30);
    assert_eq!(sum.constant(), Some(n as f64));
    // Signs survive balancing.
    let mixed: String =
        (1..1000).map(|k| format!("{} {k}", if k % 3 == 0 { "+" } else { "-" })).collect();
    let expected: f64 =
        (1..1000).map(|k| if k % 3 == 0 { f64::from(k) } else { -f64::from(k) }).sum();
    assert_eq!(value(&mixed), expected);
    let product: String = (0..100).map(|k| if k % 3 == 0 { "*2" } else { "/2" }).collect();
    assert_eq!(value(&format!("1{product}")), 2f64.powi(34 - 66));
}

#[test]
fn what_is_too_deep_is_refused() {
    let code = |text: &str| parse_bond(text).unwrap_err()[0].code;
    let nested = |n: usize| format!("{}1{}", "(".repeat(n), ")".repeat(n));
    assert_eq!(value(&nested(MAX_NESTING)), 1.0);
    assert_eq!(code(&nested(MAX_NESTING + 1)), "E0110");
    assert_eq!(code(&nested(10_000)), "E0110");
    assert_eq!(code(&"if 1 then 1 else ".repeat(10_000)), "E0110");
    assert_eq!(code(&format!("{}x", "-".repeat(100_000))), "E0110");
    assert_eq!(code(&format!("x{}", "^x".repeat(MAX_DEPTH + 1))), "E0110");
    // Nested long chains add up.
    let deep = (0..MAX_NESTING).fold("x".to_string(), |s, _| format!("({s}+1{})", "+1".repeat(20)));
    assert_eq!(code(&deep), "E0110");
    assert_eq!(parse::nesting("# ((((\n(1)", Some(b'#')), None);
}

#[test]
fn functions_have_names_in_both() {
    for row in super::FUNCTIONS {
        assert!(super::names::find(Dialect::Bond, row.name).is_some());
    }
    assert!(matches!(
        super::names::find(Dialect::Ngspice, "PWR"),
        Some(super::names::Meaning::Function(Function::SignedPower))
    ));
}

fn bond_text(text: &str) -> String {
    print(&parse_bond(text).unwrap(), Dialect::Bond, &mut |name| name.clone())
}

fn spice_text(text: &str) -> String {
    print(&parse_bond(text).unwrap(), Dialect::Ngspice, &mut |name| format!("v({name})"))
}

#[test]
fn bond_text_has_only_the_brackets_it_needs() {
    for text in [
        "a+b*c",
        "(a+b)*c",
        "a-(b-c)",
        "a/(b*c)",
        "a/b*c",
        "(-2)^2",
        "-2^2",
        "2^3^2",
        "(2^3)^2",
        "2^(-1)",
        "a-(-b)",
        "a*(-b)",
        "not (a and b)",
        "not a and b",
        "not a == b",
        "a < b and (c or d)",
        "if a < b then 1 else if c then 2 else 3",
        "1+(if a then b else c)",
        "clamp(x, -1, 1e-9)",
        "0.0017*sqrt(x^2+1.5e10)",
    ] {
        assert_eq!(bond_text(text), text);
    }
}

#[test]
fn netlist_text_is_safe_for_signs() {
    for (text, expected) in [
        ("x^2", "v(x)*v(x)"),
        ("(x+1)^3", "(v(x)+1)*((v(x)+1)*(v(x)+1))"),
        ("2*x^2", "2*(v(x)*v(x))"),
        ("x^-1", "1/v(x)"),
        ("x^0.5", "sqrt(v(x))"),
        ("x^1.5", "v(x)*sqrt(v(x))"),
        ("x^0.3", "exp(0.3*ln(v(x)))"),
        ("x^11", "sgn(v(x))*exp(11*ln(abs(v(x))))"),
        ("signpow(x, 0.5)", "sgn(v(x))*sqrt(abs(v(x)))"),
        ("abspow(x, 3)", "abs(v(x))*(abs(v(x))*abs(v(x)))"),
        ("clamp(x, -1, 1)", "min(max(v(x),-1),1)"),
        ("if x > 1 and not y then x else -x", "(((v(x) > 1) && (!(v(y)))) ? (v(x)) : (-v(x)))"),
        ("a-(-b)", "v(a)-(-v(b))"),
        ("mod(x, 2)", "v(x)-2*floor(v(x)/2)"),
    ] {
        assert_eq!(spice_text(text), expected, "{text}");
    }
}

#[test]
fn numbers_read_back_the_same() {
    for (value, text) in [
        (0.1, "0.1"),
        (250.0, "250"),
        (1e7, "1e7"),
        (0.0017, "0.0017"),
        (5.581295990097347e-7, "5.581295990097347e-7"),
        (1.0 / 3.0, "0.3333333333333333"),
        (-2e12, "-2e12"),
    ] {
        assert_eq!(super::print::number(value), text);
        assert_eq!(text.parse::<f64>().unwrap(), value);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn no_sequence_of_tokens_breaks_the_converter(
        tokens in prop::collection::vec(
            prop::sample::select(vec![
                "1", "x", "(", ")", "+", "-", "*", "/", "^", "**", "<", "==", "and", "or", "not ", "if ", " then ",
                " else ", "max(", "min(1,", "sqrt(", "form(", ",", ";", "&&", "||", "!", "?", ":", "->", "=",
            ]),
            1..20,
        )
    ) {
        let text = tokens.concat();
        if let Ok(mut whole) = bond::Grammar::parse(bond::Rule::whole, &text) {
            let pair = whole.next().unwrap().into_inner().next().unwrap();
            let mut d = vec![];
            prop_assert_eq!(parse::expression(&mut Toy, pair, &mut d).is_none(), !d.is_empty());
        }
        if let Ok(mut whole) = spice::Grammar::parse(spice::Rule::whole, &text) {
            let pair = whole.next().unwrap().into_inner().next().unwrap();
            let mut d = vec![];
            prop_assert_eq!(parse::expression(&mut ToySpice, pair, &mut d).is_none(), !d.is_empty());
        }
    }

    #[test]
    fn printed_trees_read_back_the_same(expr in trees()) {
        let text = print(&expr, Dialect::Bond, &mut |name| name.clone());
        let again = parse_bond(&text).unwrap();
        prop_assert_eq!(print(&again, Dialect::Bond, &mut |name| name.clone()), text.clone());
        let at = |e: &Expr<String>| e.evaluate(&mut |name| name.len() as f64 * 0.37);
        let (before, after) = (at(&expr), at(&again));
        prop_assert!(before.to_bits() == after.to_bits() || before.is_nan() && after.is_nan(), "{}", text);
    }

    #[test]
    fn netlist_text_means_the_same(expr in trees()) {
        let text = print(&expr, Dialect::Ngspice, &mut |name| name.clone());
        let again = parse_spice(&text).unwrap();
        let at = |e: &Expr<String>| e.evaluate(&mut |name| name.len() as f64 * 0.37 - 0.5);
        let (before, after) = (at(&expr), at(&again));
        if tame(&expr) {
            prop_assert!((before - after).abs() <= 1e-9 * (1.0 + before.abs()), "{}: {} {}", text, before, after);
        }
    }
}

/// Whether a value is true or false by more than rounding: a text may write a 0 as a cosine of a right angle.
fn is_decided(expr: &Expr<String>) -> bool {
    let truth = match &*expr.node {
        Node::Number(_) | Node::Unary(Unary::Not, _) => true,
        Node::Binary(op, ..) => op.is_comparison() || matches!(op, Binary::And | Binary::Or),
        _ => false,
    };
    truth || expr.evaluate(&mut |n| n.len() as f64 * 0.37 - 0.5).abs() > 1e-9
}

/// Whether all values on the way are finite and of common size.
fn tame(expr: &Expr<String>) -> bool {
    let inner = match &*expr.node {
        Node::Number(_) | Node::Leaf(_) => true,
        Node::Unary(Unary::Not, a) => tame(a) && is_decided(a),
        Node::Unary(_, a) | Node::Table(a, _) => tame(a),
        Node::Binary(Binary::And | Binary::Or, a, b) => {
            tame(a) && tame(b) && is_decided(a) && is_decided(b)
        }
        Node::Binary(op, a, b) => {
            // Where rounding decides, texts may differ: comparisons of equal values are left out.
            let difference =
                || (a.clone() - b.clone()).evaluate(&mut |n| n.len() as f64 * 0.37 - 0.5);
            let decides = matches!(
                op,
                Binary::Less
                    | Binary::LessEqual
                    | Binary::Greater
                    | Binary::GreaterEqual
                    | Binary::Equal
                    | Binary::NotEqual
            );
            let base = *op != Binary::Power
                || a.evaluate(&mut |n| n.len() as f64 * 0.37 - 0.5).abs() > 1e-9;
            tame(a) && tame(b) && base && (!decides || difference().abs() > 1e-9)
        }
        Node::Call(function, arguments) => {
            let at = |e: &Expr<String>| e.evaluate(&mut |n| n.len() as f64 * 0.37 - 0.5);
            let jumps = matches!(
                function,
                Function::Floor
                    | Function::Mod
                    | Function::PowerOfAbs
                    | Function::Sign
                    | Function::Atan2
                    | Function::SignedPower
                    | Function::RealPower
            );
            let smooth = !jumps
                || arguments.iter().all(|a| (at(a) - at(a).round()).abs() > 1e-6)
                    && (*function != Function::Mod || {
                        let r = at(&arguments[0]) / at(&arguments[1]);
                        (r - r.round()).abs() > 1e-6
                    });
            arguments.iter().all(tame) && smooth
        }
        Node::If(c, a, b) => tame(c) && tame(a) && tame(b) && is_decided(c),
    };
    inner && expr.evaluate(&mut |n| n.len() as f64 * 0.37 - 0.5).abs() < 1e6
}

/// Trees over names, of every operation and function but tables.
fn trees() -> impl Strategy<Value = Expr<String>> {
    let leaf = prop_oneof![
        prop_oneof![Just("x"), Just("yy"), Just("zzz")].prop_map(|n| Expr::leaf(n.to_string())),
        prop_oneof![
            Just(0.0),
            Just(1.0),
            Just(-1.0),
            Just(2.0),
            Just(0.5),
            Just(1e-9),
            -3.0..3.0f64
        ]
        .prop_map(Expr::number),
    ];
    leaf.prop_recursive(4, 30, 3, |inner| {
        let binary = (0..13usize, inner.clone(), inner.clone()).prop_map(|(op, a, b)| {
            use Binary::*;
            let ops = [
                Add,
                Subtract,
                Multiply,
                Divide,
                Power,
                Less,
                LessEqual,
                Greater,
                GreaterEqual,
                Equal,
                NotEqual,
                And,
                Or,
            ];
            a.binary(ops[op], b)
        });
        let call = (0..super::FUNCTIONS.len(), prop::collection::vec(inner.clone(), 3)).prop_map(
            |(k, mut arguments)| {
                let row = &super::FUNCTIONS[k];
                arguments.truncate(row.value.arguments());
                Expr::call(row.function, arguments)
            },
        );
        prop_oneof![
            4 => binary,
            2 => call,
            1 => inner.clone().prop_map(|a| if a.as_number().is_some() { a } else { -a }),
            1 => inner.clone().prop_map(|a| Expr::new(Node::Unary(Unary::Not, a), Span::NONE)),
            1 => (inner.clone(), inner.clone(), inner).prop_map(|(c, a, b)| Expr::choice(c, a, b)),
        ]
    })
}
