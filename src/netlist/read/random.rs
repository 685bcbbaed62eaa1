//! Random values of parameters: `agauss` and its kin, as each dialect has them.
//!
//! A call becomes nominal + spread·draw, where a draw is a number of its own for each place in the text, each instance of a
//! subcircuit and each `.step` (see `flatten::scope::draw`). Xyce draws in its own analyses of samples only; elsewhere it
//! takes the nominal value, and so do we (`expr::names`, and `limit` here, which has another meaning besides).

use crate::diagnostic::Diagnostic;
use crate::expr::Binary;
use crate::netlist::{Draw, Expr, Leaf, Operator};
use crate::source::Span;

/// One row of the table.
struct Row {
    name: &'static str,
    /// The dialects that have it.
    dialects: &'static [&'static str],
    /// The fewest and the most arguments.
    arguments: [usize; 2],
    /// How a call goes, for messages.
    form: &'static str,
    draw: Draw,
    /// Nominal value and spread.
    of: fn(&[Expr]) -> (Expr, Expr),
}

const NGSPICE: &[&str] = &["ngspice"];
const LTSPICE: &[&str] = &["ltspice"];

#[rustfmt::skip]
const ROWS: &[Row] = &[
    Row { name: "agauss", dialects: NGSPICE, arguments: [2, 3], form: "agauss(nominal, variation, sigmas)", draw: Draw::Normal, of: |a| (a[0].clone(), over(a[1].clone(), a.get(2))) },
    Row { name: "gauss", dialects: NGSPICE, arguments: [2, 3], form: "gauss(nominal, relative variation, sigmas)", draw: Draw::Normal, of: |a| (a[0].clone(), over(times(&a[0], &a[1]), a.get(2))) },
    Row { name: "aunif", dialects: NGSPICE, arguments: [2, 2], form: "aunif(nominal, variation)", draw: Draw::Uniform, of: |a| (a[0].clone(), a[1].clone()) },
    Row { name: "unif", dialects: NGSPICE, arguments: [2, 2], form: "unif(nominal, relative variation)", draw: Draw::Uniform, of: |a| (a[0].clone(), times(&a[0], &a[1])) },
    Row { name: "limit", dialects: &["ngspice", "xyce"], arguments: [2, 2], form: "limit(nominal, variation)", draw: Draw::Sign, of: |a| (a[0].clone(), a[1].clone()) },
    Row { name: "gauss", dialects: LTSPICE, arguments: [1, 1], form: "gauss(sigma)", draw: Draw::Normal, of: |a| (Expr::number(0.0), a[0].clone()) },
    Row { name: "flat", dialects: LTSPICE, arguments: [1, 1], form: "flat(variation)", draw: Draw::Uniform, of: |a| (Expr::number(0.0), a[0].clone()) },
    Row { name: "mc", dialects: LTSPICE, arguments: [2, 2], form: "mc(nominal, relative variation)", draw: Draw::Uniform, of: |a| (a[0].clone(), times(&a[0], &a[1])) },
];

fn times(a: &Expr, b: &Expr) -> Expr {
    a.clone().binary(Binary::Multiply, b.clone())
}

/// Over the number of standard deviations that a variation is.
fn over(variation: Expr, sigmas: Option<&Expr>) -> Expr {
    match sigmas {
        Some(sigmas) => variation.binary(Binary::Divide, sigmas.clone()),
        None => variation,
    }
}

/// Whether a call is one of these in a dialect; `limit` of three arguments is the clamp.
pub fn is_one(name: &str, dialect: &str, arguments: usize) -> bool {
    row(name, dialect).is_some_and(|row| row.name != "limit" || arguments == row.arguments[0])
}

fn row(name: &str, dialect: &str) -> Option<&'static Row> {
    let is = |row: &&Row| row.name.eq_ignore_ascii_case(name) && row.dialects.contains(&dialect);
    ROWS.iter().find(is)
}

/// The value of a call; `number` is that of the place.
pub fn apply(
    name: &str,
    dialect: &str,
    arguments: &[Expr],
    number: u32,
    span: Span,
    d: &mut Vec<Diagnostic>,
) -> Option<Expr> {
    let row = row(name, dialect)?;
    let [least, most] = row.arguments;
    if arguments.len() < least || arguments.len() > most {
        let message = format!("`{}` takes other arguments", row.name);
        let error = Diagnostic::error("E0773", span, message)
            .says(format!("{} given", arguments.len()))
            .help(format!("write {}", row.form));
        d.push(error);
        return None;
    }
    let (nominal, spread) = (row.of)(arguments);
    if dialect == "xyce" {
        return Some(Expr { span, ..nominal });
    }
    let draw = Expr::leaf(Leaf::Operator(Operator::Draw(row.draw, number), vec![]));
    let value = nominal.binary(Binary::Add, spread.binary(Binary::Multiply, draw));
    Some(Expr { span, ..value })
}
