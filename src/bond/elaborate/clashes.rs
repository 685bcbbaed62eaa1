//! What is said of units that do not agree: both places, both units, where they come from.

use super::agreements::{Agreement, Form};
use super::scope::{Meaning, Scope};
use crate::bond::syntax::{self, Call, Value};
use crate::diagnostic::Diagnostic;
use crate::expr::{Binary, Function, Node};
use crate::quantity::Dimension;
use crate::source::Span;
use std::collections::{HashMap, HashSet};

/// An error of units on its way: those that speak of one name may have one cause.
pub(super) struct Clash {
    pub diagnostic: Diagnostic,
    /// The parameters and signals that it speaks of.
    pub names: Vec<Meaning>,
}

/// A value that takes part in a clash.
pub(super) struct Side {
    pub span: Span,
    /// `a pressure (Pa)`
    pub words: String,
    /// The parameters and signals in it whose units are known.
    names: Vec<Named>,
    /// The first bare factor in it.
    bare: Option<Span>,
}

/// A parameter or signal in a clash.
struct Named {
    meaning: Meaning,
    text: String,
    words: String,
    declared: Span,
}

/// More declarations than these are not pointed at.
const MOST_DECLARATIONS: usize = 4;

impl Side {
    /// An expression that stands where the scope is, and its dimension.
    pub fn of(scope: &mut Scope<'_>, expr: &syntax::Expr, dimension: Dimension) -> Side {
        let written = scope.written_unit(expr);
        let mut paths = vec![];
        collect_names(expr, &mut paths);
        let mut names: Vec<Named> = vec![];
        for path in paths {
            let Some(meaning) = scope.value_of(path) else { continue };
            if names.iter().any(|known| known.meaning == meaning) {
                continue;
            }
            let Some((words, declared)) = scope.told(meaning) else { continue };
            names.push(Named { meaning, text: path.text(), words, declared });
        }
        let words = dimension.describe(written.as_deref());
        Side { span: expr.span, words, names, bare: bare_factor(expr) }
    }
}

impl Clash {
    pub fn new(diagnostic: Diagnostic) -> Clash {
        Clash { diagnostic, names: vec![] }
    }

    /// Points at where the units of the sides come from.
    pub fn explain(mut self, sides: &[&Side]) -> Clash {
        let mut left_out = vec![];
        for named in sides.iter().flat_map(|side| &side.names) {
            if self.names.contains(&named.meaning) {
                continue;
            }
            self.names.push(named.meaning);
            let text = format!("`{}` is {}", named.text, named.words);
            if self.names.len() > MOST_DECLARATIONS {
                left_out.push(text);
            } else {
                self.diagnostic = self.diagnostic.label(named.declared, text);
            }
        }
        if !left_out.is_empty() {
            self.diagnostic = self.diagnostic.because(left_out.join(", "));
        }
        self
    }

    pub fn sum(op: Binary, a: &Side, b: &Side) -> Clash {
        let message = match op {
            Binary::Subtract => format!("{} is subtracted from {}", b.words, a.words),
            _ => format!("{} is added to {}", b.words, a.words),
        };
        let help = "only values of one unit can be added or subtracted";
        both(message, help, a, b)
    }

    pub fn comparison(a: &Side, b: &Side) -> Clash {
        let message = format!("{} is compared with {}", a.words, b.words);
        both(message, "only values of one unit can be compared", a, b)
    }

    pub fn branches(_: Span, a: &Side, b: &Side) -> Clash {
        let message = format!("the branches of `if` are {} and {}", a.words, b.words);
        both(message, "both branches are values of one unit", a, b)
    }

    /// What a regulator controls, and what that follows.
    pub fn follows(a: &Side, b: &Side) -> Clash {
        let message = format!("{} follows {}", a.words, b.words);
        both(message, "what is controlled and its reference are of one unit", a, b)
    }

    /// The first terms of a sum, and the one of another unit.
    pub fn terms(value: i64, a: &Side, b: &Side) -> Clash {
        let message = format!("the terms of `sum` are {} and, at {value}, {}", a.words, b.words);
        both(message, "only values of one unit can be added", a, b)
    }

    /// An exponent with a unit.
    pub fn exponent(side: &Side) -> Clash {
        Clash::new(hint(
            Diagnostic::error("E0305", side.span, format!("an exponent is {}", side.words))
                .says(side.words.clone()),
            &[side],
            "an exponent is a pure number: divide it by a value of its unit",
        ))
    }

    /// A base with a unit under an exponent that changes.
    pub fn base(side: &Side, exponent: Span) -> Clash {
        let message = format!("{} is raised to a power that changes", side.words);
        Clash::new(hint(
            Diagnostic::error("E0305", side.span, message)
                .says(side.words.clone())
                .label(exponent, "this exponent changes during a run"),
            &[side],
            "its unit would change too: divide the base by a value of its unit",
        ))
    }

    /// An argument of a function; the first side is it, the others those that it disagrees with.
    pub fn argument(
        row: &Agreement,
        name: &str,
        call: Span,
        sides: &[&Side],
        expected: Dimension,
    ) -> Clash {
        let function = row.name;
        let [side, others @ ..] = sides else {
            return Clash::new(Diagnostic::error("E0306", call, "units do not agree"));
        };
        let needed = expected.describe(None);
        let (code, message, help) = match (row.form, others) {
            _ if row.is_pure() && name.is_empty() => (
                "E0305",
                format!("`{function}` takes a pure number, not {}", side.words),
                "divide it by a value of its unit".to_string(),
            ),
            (Form::Rows | Form::Table, [other, ..]) => (
                "E0306",
                format!("`{function}` mixes {} and {}", side.words, other.words),
                "the values of one column are of one unit".to_string(),
            ),
            (Form::Rows, []) => (
                "E0306",
                format!("a point of `{function}` stands at {}, not at a time", side.words),
                "each point is a time and a value".to_string(),
            ),
            (Form::Plain, [other, ..]) if name.is_empty() => (
                "E0304",
                format!("`{function}` of {} and {}", other.words, side.words),
                format!("the arguments of `{function}` are values of one unit"),
            ),
            _ => (
                "E0306",
                format!("`{name}` of `{function}` is {} instead of {needed}", side.words),
                match others {
                    [] => format!("write it in a unit of {}", noun(&needed)),
                    _ => format!("beside the other arguments it must be {needed}"),
                },
            ),
        };
        let mut error = Diagnostic::error(code, side.span, message).says(side.words.clone());
        for other in others {
            error = error.label(other.span, other.words.clone());
        }
        Clash::new(hint(error, sides, &help))
    }
}

/// What is measured, without article and unit: `time` of `a time (s)`.
fn noun(words: &str) -> &str {
    let words = words.strip_prefix("a ").or(words.strip_prefix("an ")).unwrap_or(words);
    words.split(" (").next().unwrap_or(words)
}

fn both(message: String, help: &str, a: &Side, b: &Side) -> Clash {
    let error = Diagnostic::error("E0304", b.span, message)
        .says(b.words.clone())
        .label(a.span, a.words.clone());
    Clash::new(hint(error, &[b, a], help))
}

/// The help, and that a bare factor may lack its unit.
pub(super) fn hint(error: Diagnostic, sides: &[&Side], help: &str) -> Diagnostic {
    let error = match sides.iter().find_map(|side| side.bare) {
        Some(_) => error.because(
            "a bare number is a pure number as a factor, dividend or divisor; if it has a unit, write it",
        ),
        None => error,
    };
    error.help(help)
}

/// Every name in an expression, also within readings' and other calls' arguments that are values.
fn collect_names<'e>(expr: &'e syntax::Expr, found: &mut Vec<&'e syntax::Path>) {
    expr.leaves(&mut |leaf, _| match leaf {
        syntax::Leaf::Name(path) => found.push(path),
        syntax::Leaf::Call(call) if !is_reading(call) => {
            for argument in call.rows.iter().flatten() {
                match &argument.value {
                    Value::Expr(value) => collect_names(value, found),
                    Value::Matrix(rows) => {
                        rows.iter().flatten().for_each(|value| collect_names(value, found));
                    }
                    _ => {}
                }
            }
        }
        syntax::Leaf::Sum(sum) => collect_names(&sum.term, found),
        _ => {}
    });
}

fn is_reading(call: &Call) -> bool {
    super::reading::READINGS.contains(&call.name.text.as_str())
}

/// A bare number in a product, other than a sign.
fn bare_factor(expr: &syntax::Expr) -> Option<Span> {
    match &*expr.node {
        Node::Unary(_, a) => bare_factor(a),
        Node::Binary(Binary::Multiply | Binary::Divide, a, b) => {
            [a, b].into_iter().find_map(|side| match side.as_number() {
                Some(_) => Some(side.span),
                None => bare_factor(side),
            })
        }
        _ => None,
    }
}

impl Scope<'_> {
    /// The unit in which a value was written, where one literal or reading says it.
    pub(super) fn written_unit(&self, expr: &syntax::Expr) -> Option<String> {
        match &*expr.node {
            Node::Leaf(syntax::Leaf::Quantity(_, unit)) => Some(unit.text.clone()),
            Node::Leaf(syntax::Leaf::Name(path)) => match self.value_of(path)? {
                Meaning::Parameter(id) => {
                    self.graph.parameters[id.index()].unit.as_ref().map(|unit| unit.text.clone())
                }
                Meaning::Signal(_) => None,
            },
            Node::Leaf(syntax::Leaf::Call(call)) if is_reading(call) => {
                let row = self.graph.bond(self.read_bond(call)?).domain.row();
                Some(match call.name.text.as_str() {
                    "e" => row.effort.to_string(),
                    "f" => row.flow.to_string(),
                    "q" => row.displacement.to_string(),
                    "p" => row.momentum.to_string(),
                    _ => return None,
                })
            }
            Node::Unary(_, a) => self.written_unit(a),
            Node::Binary(Binary::Add | Binary::Subtract, a, b) => {
                self.written_unit(a).or_else(|| self.written_unit(b))
            }
            Node::Call(Function::Abs | Function::Min | Function::Max | Function::Clamp, a) => {
                a.iter().find_map(|a| self.written_unit(a))
            }
            _ => None,
        }
    }

    /// What a parameter or signal is and where that is told; `None` where its unit is unknown.
    fn told(&self, meaning: Meaning) -> Option<(String, Span)> {
        match meaning {
            Meaning::Parameter(id) => {
                let dimension = self.parameter_dimensions[id.index()].known()?;
                let (value, _) = self.parameter_value(id.index())?;
                let unit = self.graph.parameters[id.index()].unit.as_ref();
                let written = unit.map(|unit| unit.text.as_str());
                Some((dimension.describe(written), value.span))
            }
            Meaning::Signal(id) => {
                let dimension = self.signal_dimensions.get(id.index())?.known()?;
                let said = self.units.said.get(id.index()).copied().filter(|span| !span.is_none());
                let span = said.unwrap_or(self.graph.signals[id.index()].span);
                Some((dimension.describe(None), span))
            }
        }
    }
}

/// Errors with one name in common are one mistake in all likelihood: later ones become places of the first. The same
/// place in several instances is said once.
pub(super) fn merge(clashes: Vec<Clash>) -> Vec<Diagnostic> {
    const MOST_PLACES: usize = 8;
    let mut merged: Vec<Diagnostic> = vec![];
    let mut of_name: HashMap<Meaning, usize> = HashMap::new();
    let mut places: HashSet<(&'static str, Span)> = HashSet::new();
    for clash in clashes {
        let place = clash.diagnostic.labels.first().map_or(Span::NONE, |label| label.span);
        if !place.is_none() && !places.insert((clash.diagnostic.code, place)) {
            continue;
        }
        let first = clash.names.iter().find_map(|name| of_name.get(name).copied());
        let at = match first {
            Some(at) if !place.is_none() => {
                let known = &mut merged[at];
                if known.labels.len() < MOST_PLACES && known.labels.iter().all(|l| l.span != place)
                {
                    let text = format!("clashes here too: {}", clash.diagnostic.message);
                    known.labels.push(crate::diagnostic::Label {
                        span: place,
                        text,
                        of_use: false,
                    });
                }
                at
            }
            _ => {
                merged.push(clash.diagnostic);
                merged.len() - 1
            }
        };
        for name in clash.names {
            of_name.entry(name).or_insert(at);
        }
    }
    merged
}
