//! Factors as text: `la`, or one over it, with their powers, and products with the texts of values.

use crate::bond::syntax::{Expr, Leaf};
use crate::expr::{Binary, Node, Unary};

/// A factor as text, or one over it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Factor {
    /// What stands as a factor as it is: a name, a number, something in brackets.
    pub text: String,
    /// Whether one over it is meant.
    pub over: bool,
}

/// How tightly a text binds: 0 a sum or looser, 1 a product, 2 stands anywhere.
pub fn level(expr: &Expr) -> u8 {
    match &*expr.node {
        Node::Number(value) => u8::from(*value >= 0.0) * 2,
        Node::Leaf(Leaf::Quantity(..)) => 0,
        Node::Leaf(_) | Node::Call(..) | Node::Table(..) => 2,
        Node::Binary(Binary::Multiply | Binary::Divide | Binary::Power, ..) => 1,
        Node::Unary(Unary::Negate | Unary::Not, _) | Node::Binary(..) | Node::If(..) => 0,
    }
}

/// A text in brackets, unless it binds at least as tightly as `least`.
pub fn at(text: &str, own: u8, least: u8) -> String {
    let whole = text.starts_with('(') && closes_at_the_end(text);
    if own >= least || whole { text.to_string() } else { format!("({text})") }
}

/// Whether the bracket that a text begins with closes at its end.
fn closes_at_the_end(text: &str) -> bool {
    let mut open = 0i32;
    for (at, c) in text.char_indices() {
        open += i32::from(c == '(') - i32::from(c == ')');
        if open == 0 {
            return at + 1 == text.len();
        }
    }
    false
}

impl Factor {
    /// The factor that a text is: `1/x` is one over `x`.
    pub fn of(text: &str, expr: Option<&Expr>, slice: &dyn Fn(&Expr) -> String) -> Factor {
        let Some(expr) = expr else { return Factor { text: text.into(), over: false } };
        if let Node::Binary(Binary::Divide, one, by) = &*expr.node
            && matches!(*one.node, Node::Number(1.0))
        {
            return Factor { text: at(&slice(by), level(by), 2), over: true };
        }
        Factor { text: at(text, level(expr), 2), over: false }
    }

    /// A number.
    pub fn number(value: u32) -> Factor {
        Factor { text: value.to_string(), over: false }
    }

    /// One over it.
    pub fn inverse(&self) -> Factor {
        Factor { text: self.text.clone(), over: !self.over }
    }

    /// A value times a power of it; `own` is how tightly the value binds.
    pub fn times(&self, value: &str, own: u8, power: i32) -> String {
        let power = if self.over { -power } else { power };
        let factor = match power.abs() {
            0 => return value.to_string(),
            1 => self.text.clone(),
            n => {
                match self.text.parse::<u32>().ok().and_then(|value| value.checked_pow(n as u32)) {
                    Some(value) => value.to_string(),
                    None => format!("{}^{n}", self.text),
                }
            }
        };
        if power > 0 && value == "1" {
            return factor;
        }
        let sign = if power > 0 { '*' } else { '/' };
        format!("{}{sign}{factor}", at(value, own, 1))
    }

    /// A power of it over a value.
    pub fn over_value(&self, value: &str, own: u8, power: i32) -> String {
        let above = self.times("1", 2, power);
        format!("{above}/{}", at(value, own, 2))
    }

    /// Itself as an expression.
    pub fn text(&self) -> String {
        if self.over { format!("1/{}", self.text) } else { self.text.clone() }
    }
}
