//! A transfer function in symbols: made, reduced, and checked against numbers.

use super::eliminate::{Row, eliminate};
use super::symbols::{Ratio, Reader, Symbol, Trouble, s};
use crate::analysis::linear::{Entry, Linear};
use crate::analysis::response::Resolvent;
use crate::bond::graph::BondGraph;
use crate::diagnostic::Diagnostic;
use crate::expr::dag::Op;
use crate::expr::polynomial::Polynomial;
use crate::expr::{NodeId, Program};
use crate::linear::{Complex, Field};
use crate::source::Span;
use std::collections::BTreeSet;

/// w/u = N(s)/D(s), in SI.
#[derive(Clone, Debug)]
pub struct Transfer {
    /// What acts.
    pub from: String,
    /// What is read.
    pub to: String,
    /// N, over the symbols; s is the first.
    pub numerator: Polynomial,
    /// D.
    pub denominator: Polynomial,
    /// The symbols that stand in them, by their place; s is the first.
    pub symbols: Vec<Symbol>,
    /// Number of states on the way.
    pub states: usize,
    /// The largest difference from the numeric response, in parts of it, and at how many points.
    pub checked: (f64, usize),
}

/// States that are eliminated with symbols at most.
pub const MOST_STATES: usize = 16;
/// The difference from the numeric response that is rounding, in parts of the terms.
const EQUAL: f64 = 1e-8;

/// The transfer function from the only input of a linear model to an output. The graph is one whose values have names
/// ([`super::symbols::name_values`]).
///
/// # Errors
/// When it is too large, there is none, or it is not what the numbers say.
pub fn transfer(
    graph: &BondGraph,
    linear: &Linear,
    output: usize,
) -> Result<Transfer, Box<Diagnostic>> {
    let needed = needed(linear, output);
    let states = needed.iter().filter(|k| linear.stores(**k)).count();
    let (from, to) = (linear.inputs[0].name.clone(), linear.outputs[output].name.clone());
    if states > MOST_STATES {
        let message = format!("{states} states are too many for symbols");
        return Err(Box::new(Diagnostic::error("E0936", Span::NONE, message)
            .because(format!("they stand between {from} and {to}"))
            .help(format!("{MOST_STATES} is the most; impose something nearer to what is read, or take `bondspice bode`, which has no limit"))));
    }
    let made = make(graph, linear, output, &needed).map_err(|trouble| explain(trouble, states))?;
    let (numerator, denominator, symbols) = made;
    let mut transfer =
        Transfer { from, to, numerator, denominator, symbols, states, checked: (0.0, 0) };
    transfer.checked = check(linear, output, &transfer)?;
    transfer.forget_unused();
    Ok(transfer)
}

/// What stands in the way of symbols.
pub fn explain(trouble: Trouble, states: usize) -> Box<Diagnostic> {
    let error = |message: String| Diagnostic::error("E0936", Span::NONE, message);
    Box::new(match trouble {
        Trouble::Symbols => error("more parameters stand on the way than symbols fit".into())
            .help("47 is the most; impose something nearer to what is read"),
        Trouble::TooLarge => {
            error(format!("the transfer function of {states} states is too large for symbols"))
                .help("impose something nearer to what is read, or take `bondspice bode`")
        }
        Trouble::Zero => Diagnostic::error("E0928", Span::NONE, "a slope divides by 0 here")
            .help("choose another point with --at"),
        Trouble::Singular => {
            let message = "the equations leave the output open, whatever s is";
            Diagnostic::error("E0928", Span::NONE, message)
                .help("see what `bondspice check` says of the model")
        }
    })
}

/// The unknowns that the output depends on and the input reaches, ascending.
fn needed(linear: &Linear, output: usize) -> Vec<usize> {
    let n = linear.unknowns.len();
    let mut row_of = vec![0; n];
    linear.gives.iter().enumerate().for_each(|(row, unknown)| row_of[*unknown as usize] = row);
    let mut read = vec![false; n];
    let mut open: Vec<usize> =
        linear.outputs[output].entries.iter().map(|(k, _)| *k as usize).collect();
    while let Some(unknown) = open.pop() {
        if !std::mem::replace(&mut read[unknown], true) {
            let row = row_of[unknown];
            open.extend(linear.rows[row].iter().map(|(k, _)| *k as usize));
            if linear.rated[row] {
                open.push(row);
            }
        }
    }
    let mut uses = vec![vec![]; n];
    for (row, entries) in linear.rows.iter().enumerate() {
        let rate = linear.rated[row].then_some(row);
        for unknown in entries.iter().map(|(k, _)| *k as usize).chain(rate) {
            uses[unknown].push(row);
        }
    }
    let mut reached = vec![false; n];
    let mut open: Vec<usize> = linear.inputs[0]
        .entries
        .iter()
        .map(|(row, _)| linear.gives[*row as usize] as usize)
        .collect();
    while let Some(unknown) = open.pop() {
        if !std::mem::replace(&mut reached[unknown], true) {
            open.extend(uses[unknown].iter().map(|row| linear.gives[*row] as usize));
        }
    }
    (0..n).filter(|k| read[*k] && reached[*k]).collect()
}

/// Numerator, denominator, and all symbols.
fn make(
    graph: &BondGraph,
    linear: &Linear,
    output: usize,
    needed: &[usize],
) -> Result<(Polynomial, Polynomial, Vec<Symbol>), Trouble> {
    let inside: BTreeSet<usize> = needed.iter().copied().collect();
    let rows: Vec<usize> = (0..linear.rows.len())
        .filter(|row| inside.contains(&(linear.gives[*row] as usize)))
        .collect();
    let input = &linear.inputs[0];
    let read = &linear.outputs[output];
    let direct = &linear.direct[output];
    let all = rows.iter().flat_map(|row| &linear.rows[*row]).chain(&input.entries);
    let nodes: Vec<NodeId> =
        all.chain(&read.entries).chain(direct).filter_map(|(_, entry)| entry.node).collect();
    let mut reader = Reader::new(graph, linear, &nodes);
    let (w, u) = (linear.unknowns.len() as u32, linear.unknowns.len() as u32 + 1);
    let mut equations = vec![];
    for row in &rows {
        let own = linear.rows[*row].iter().filter(|(k, _)| inside.contains(&(*k as usize)));
        let mut entries: Vec<(u32, Ratio)> = vec![];
        for (k, entry) in own {
            entries.push((*k, ratio(&mut reader, entry)?));
        }
        for (_, entry) in input.entries.iter().filter(|(own, _)| *own as usize == *row) {
            entries.push((u, ratio(&mut reader, entry)?));
        }
        let rate = linear.rated[*row].then_some(*row as u32);
        equations.push(clear(entries, rate)?);
    }
    let mut entries = vec![];
    for (k, entry) in read.entries.iter().filter(|(k, _)| inside.contains(&(*k as usize))) {
        entries.push((*k, ratio(&mut reader, entry)?));
    }
    for (_, entry) in direct {
        entries.push((u, ratio(&mut reader, entry)?));
    }
    let one = Ratio { top: Polynomial::number(-1), bottom: Polynomial::number(1) };
    entries.push((w, one));
    equations.push(clear(entries, None)?);
    let last = eliminate(equations, &[w, u])?;
    let of = |column: u32| last.iter().find(|(own, _)| *own == column).map(|(_, x)| x.clone());
    let denominator = of(w).ok_or(Trouble::Singular)?.negate();
    let numerator = of(u).unwrap_or_default();
    let common = numerator.gcd(&denominator)?;
    let reduced = (numerator.divided(&common), denominator.divided(&common));
    let (Some(mut numerator), Some(mut denominator)) = reduced else {
        return Err(Trouble::TooLarge);
    };
    if denominator.is_negative() {
        (numerator, denominator) = (numerator.negate(), denominator.negate());
    }
    Ok((numerator, denominator, reader.symbols))
}

/// An entry as a quotient.
///
/// # Errors
/// As [`Reader::ratio`].
pub fn ratio(reader: &mut Reader, entry: &Entry) -> Result<Ratio, Trouble> {
    match entry.node {
        Some(node) => reader.ratio(node),
        None => {
            Ok(Ratio { top: Polynomial::number(entry.value as i64), bottom: Polynomial::number(1) })
        }
    }
}

/// A row A·y + B·u (− s·y of its rate) times what its entries are divided by; entries of one column are added.
fn clear(mut entries: Vec<(u32, Ratio)>, rate: Option<u32>) -> Result<Row, Trouble> {
    entries.extend(rate.map(|k| (k, Ratio { top: s().negate(), bottom: Polynomial::number(1) })));
    let mut below = Polynomial::number(1);
    for (_, entry) in &entries {
        let common = below.gcd(&entry.bottom)?;
        let own = entry.bottom.divided(&common).ok_or(Trouble::TooLarge)?;
        below = below.times(&own)?;
    }
    let mut row: Row = vec![];
    entries.sort_by_key(|(k, _)| *k);
    for (k, entry) in entries {
        let factor = below.divided(&entry.bottom).ok_or(Trouble::TooLarge)?;
        let own = entry.top.times(&factor)?;
        match row.last_mut() {
            Some((last, sum)) if *last == k => *sum = sum.plus(&own),
            _ => row.push((k, own)),
        }
    }
    row.retain(|(_, entry)| !entry.is_zero());
    Ok(row)
}

impl Transfer {
    /// The value at s for values of the symbols, and the part of its terms that is left after they cancel.
    pub fn value(&self, at: Complex, values: &[f64]) -> (Complex, f64) {
        let (top, part) = value_of(&self.numerator, at, values);
        let (bottom, other) = value_of(&self.denominator, at, values);
        (top / bottom, part.min(other))
    }

    /// The symbols' values at the point.
    pub fn values(&self) -> Vec<f64> {
        self.symbols.iter().map(|symbol| symbol.value).collect()
    }

    /// The coefficients of the powers of s with their values, from 0 on.
    pub fn coefficients(&self, of: &Polynomial) -> Vec<(Polynomial, f64)> {
        let values = self.values();
        let powers = of.powers(0).into_iter();
        powers
            .map(|power| {
                let value = power.evaluate(&values).0;
                (power, value)
            })
            .collect()
    }

    /// Whether a symbol stands in it.
    pub fn uses(&self, k: usize) -> bool {
        self.numerator.holds(k) || self.denominator.holds(k)
    }

    /// Symbols that cancelled keep their places, for the polynomials' sake, and lose their names.
    fn forget_unused(&mut self) {
        for k in 1..self.symbols.len() {
            if !self.uses(k) {
                self.symbols[k].node = None;
            }
        }
    }
}

/// The value at a complex s, and the part of its terms that is left after they cancel.
pub(super) fn value_of(of: &Polynomial, at: Complex, values: &[f64]) -> (Complex, f64) {
    let mut sum = Complex::ZERO;
    let (mut size, mut power, mut length) = (0.0, Complex::ONE, 1.0);
    let absolute = libm::hypot(at.re, at.im);
    for coefficient in of.powers(0) {
        let (value, terms) = coefficient.evaluate(values);
        sum = sum + power.scaled(value);
        size += terms * length;
        power = power * at;
        length *= absolute;
    }
    let left = if size > 0.0 { libm::hypot(sum.re, sum.im) / size } else { 1.0 };
    (sum, left)
}

/// Compares with the numeric response at random s, with the values at the point and with others.
fn check(
    linear: &Linear,
    output: usize,
    transfer: &Transfer,
) -> Result<(f64, usize), Box<Diagnostic>> {
    let mut seed = 0x2545_f491_4f6c_dd1du64;
    let mut random = || {
        // Xorshift of Marsaglia (2003).
        seed ^= seed << 13;
        seed ^= seed >> 7;
        seed ^= seed << 17;
        (seed >> 11) as f64 / (1u64 << 53) as f64
    };
    let dag = &linear.slopes.dag;
    let nodes: Vec<NodeId> = transfer.symbols.iter().filter_map(|symbol| symbol.node).collect();
    // With conditions on the way, other values may be in another branch than that of the point.
    let own: Vec<NodeId> =
        linear.rows.iter().flatten().filter_map(|(_, entry)| entry.node).collect();
    let branches = dag.below(&own).into_iter().any(|node| matches!(dag.op(node), Op::Select(..)));
    let program = Program::compile(dag, &nodes);
    let (mut worst, mut count) = (0.0f64, 0);
    for round in 0..if branches { 1 } else { 3 } {
        let mut varied = linear.clone();
        if round > 0 {
            varied.vary(&mut random);
        }
        let mut registers = program.registers();
        program.run(&varied.values, &mut registers);
        let found: Vec<f64> = program.outputs(&registers).collect();
        let mut found = found.into_iter();
        let values: Vec<f64> = transfer
            .symbols
            .iter()
            .map(|symbol| symbol.node.and_then(|_| found.next()).unwrap_or(0.0))
            .collect();
        let mut resolvent = Resolvent::new(&varied);
        for _ in 0..4 {
            let size = 10f64.powf(4.0 * random() - 0.5);
            let angle = std::f64::consts::PI * random();
            let at = Complex::new(size * libm::cos(angle), size * libm::sin(angle));
            let Some(numeric) = resolvent.transfer(at) else { continue };
            let factor = linear.outputs[output].factor / linear.inputs[0].factor;
            let numeric = numeric[0][output].scaled(factor);
            let (symbolic, left) = transfer.value(at, &values);
            if !(numeric.is_finite() && symbolic.is_finite()) {
                continue;
            }
            let off = symbolic - numeric;
            let size = libm::hypot(numeric.re, numeric.im);
            let part = libm::hypot(off.re, off.im) / size.max(f64::MIN_POSITIVE);
            // What is 0 in symbols may be rounding in numbers.
            let allowed = EQUAL + 1e-12 / left;
            let vanishes = transfer.numerator.is_zero();
            if part > allowed && !vanishes {
                let message = "the symbolic transfer function is not what the numbers say";
                return Err(Box::new(Diagnostic::error("E0936", Span::NONE, message)
                    .because(format!("at s = {} + {}j it is {} + {}j, and {} + {}j by numbers", at.re, at.im, symbolic.re, symbolic.im, numeric.re, numeric.im))
                    .help("values of very different sizes may be at fault; `bondspice bode` is right in any case")));
            }
            worst = worst.max(if vanishes { 0.0 } else { part });
            count += 1;
        }
    }
    Ok((worst, count))
}
