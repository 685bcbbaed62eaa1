//! Parts of cards that need more than a word: passive devices with a model, values that follow from the past.

use super::{Expr, Leaf, Name};
use crate::expr::Node;
use crate::source::Span;

/// A resistor, capacitor or inductor of a model, or with parameters besides its value.
#[derive(Clone, Debug)]
pub struct Passive {
    /// Which.
    pub kind: PassiveKind,
    /// Its value as it stands, a number or a law.
    pub value: Option<Expr>,
    /// Its model.
    pub model: Option<Name>,
    /// `ic=`.
    pub initial: Option<Expr>,
    /// `l=`, `w=`, `tc1=` and so on; folded to lower case.
    pub parameters: Vec<(String, Expr)>,
}

/// Passive devices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum PassiveKind {
    Resistor,
    Capacitor,
    Inductor,
}

impl PassiveKind {
    /// The type of its models.
    pub fn model(self) -> &'static str {
        match self {
            PassiveKind::Resistor => "r",
            PassiveKind::Capacitor => "c",
            PassiveKind::Inductor => "l",
        }
    }

    /// The keys that its value is named by.
    pub fn keys(self) -> &'static [&'static str] {
        match self {
            PassiveKind::Resistor => &["r", "resistance"],
            PassiveKind::Capacitor => &["c", "capacitance"],
            PassiveKind::Inductor => &["l", "inductance"],
        }
    }
}

/// What makes a value of others over time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Operator {
    /// `ddt(x)`.
    Derivative,
    /// `sdt(x)`, `idt(x, initial)`: the integral from the start on.
    Integral,
    /// `delay(x, seconds)`.
    Delay,
    /// A rational function of s: the input, then the function, in which the parameter `s` is meant.
    Transfer,
    /// `spice_pulse(…)` and the like: a waveform of numbers.
    Waveform(super::Shape),
    /// `table(x, x0, y0, …)` whose points follow from parameters; with plain numbers it is a curve from the start.
    Table,
    /// A random number, drawn once for each place that it stands in and each instance of that: the how-manieth place.
    Draw(Draw, u32),
}

/// What random numbers are drawn from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Draw {
    /// Normal, of mean 0 and root mean square 1.
    Normal,
    /// From −1 to 1, all equally likely.
    Uniform,
    /// −1 or 1.
    Sign,
}

/// Every leaf of an expression, those within operators too.
pub fn every_leaf<'a>(expr: &'a Expr, visit: &mut dyn FnMut(&'a Leaf, Span)) {
    expr.leaves(&mut |leaf, span| {
        visit(leaf, span);
        if let Leaf::Operator(_, arguments) = leaf {
            arguments.iter().for_each(|argument| every_leaf(argument, visit));
        }
    });
}

/// The expression with each leaf replaced, those within operators too.
pub fn map_leaves(expr: &Expr, replace: &mut dyn FnMut(&Leaf, Span) -> Expr) -> Expr {
    expr.map(&mut |leaf, span| match leaf {
        Leaf::Operator(operator, arguments) if !arguments.is_empty() => {
            let arguments = arguments.iter().map(|a| map_leaves(a, replace)).collect();
            Expr::new(Node::Leaf(Leaf::Operator(*operator, arguments)), span)
        }
        other => replace(other, span),
    })
}

/// Whether an expression changes during a run: it speaks of voltages, currents, time or the past.
pub fn varies(expr: &Expr) -> bool {
    let mut found = false;
    let fixed =
        |leaf: &Leaf| matches!(leaf, Leaf::Parameter(_) | Leaf::Operator(Operator::Draw(..), _));
    expr.leaves(&mut |leaf, _| found |= !fixed(leaf));
    found
}
