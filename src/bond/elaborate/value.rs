//! Expressions: from names to what they mean.

use super::scope::{Meaning, RESERVED, Scope, a, did_you_mean};
use crate::bond::graph::*;
use crate::bond::syntax::{self, Path};
use crate::diagnostic::Diagnostic;
use crate::expr::{Expr as Tree, Node, Unary};
use crate::quantity::nearest;
use crate::source::Span;

/// What an expression may speak of, by where it stands.
#[derive(Clone, Copy)]
pub(super) struct Place<'p> {
    /// What it is the value of, when only parameters may stand in it: `a parameter`.
    pub constant: Option<&'static str>,
    /// The element's own variables that it may use.
    pub own: &'static [(&'static str, Variable)],
    /// What to do instead of using another own variable.
    pub own_help: &'p str,
    /// Whom hidden signals belong to, and the statement; `None` where no function with memory can stand.
    pub owner: Option<(&'p str, usize)>,
}

impl<'p> Place<'p> {
    /// Parameters alone.
    pub fn constant(what: &'static str) -> Place<'p> {
        Place { constant: Some(what), own: &[], own_help: READ, owner: None }
    }

    /// Anything but own variables.
    pub fn free(owner: &'p str, statement: usize) -> Place<'p> {
        Place { constant: None, own: &[], own_help: READ, owner: Some((owner, statement)) }
    }

    /// A law over own variables.
    pub fn law(
        own: &'static [(&'static str, Variable)],
        own_help: &'p str,
        owner: &'p str,
        statement: usize,
    ) -> Place<'p> {
        Place { constant: None, own, own_help, owner: Some((owner, statement)) }
    }

    /// What is observed: no new states arise by looking.
    pub fn observed() -> Place<'p> {
        Place { constant: None, own: &[], own_help: READ, owner: None }
    }
}

const READ: &str =
    "to read an element's variable write it with the element's name, as in `f(shaft)`";

impl Scope<'_> {
    /// An expression of the graph. `None` after an error; all names in it are looked at.
    pub fn lower(
        &mut self,
        expr: &syntax::Expr,
        place: Place<'_>,
        d: &mut Vec<Diagnostic>,
    ) -> Option<Expr> {
        let mut failed = false;
        let lowered: Result<Expr, std::convert::Infallible> = expr.try_map(&mut |leaf, span| {
            Ok(self.leaf(leaf, span, place, d).unwrap_or_else(|| {
                failed = true;
                Tree::number(f64::NAN)
            }))
        });
        let Ok(lowered) = lowered;
        (!failed).then(|| with_signs(lowered))
    }

    fn leaf(
        &mut self,
        leaf: &syntax::Leaf,
        span: Span,
        place: Place<'_>,
        d: &mut Vec<Diagnostic>,
    ) -> Option<Expr> {
        match leaf {
            syntax::Leaf::Quantity(value, _) => Some(Tree::new(Node::Number(*value), span)),
            syntax::Leaf::Name(path) => self.name(path, place, d),
            syntax::Leaf::Call(call) => self.call(call, span, place, d),
            // The parser does not make it yet.
            syntax::Leaf::Sum(_) => None,
        }
    }

    /// What a name alone means.
    fn name(&self, path: &Path, place: Place<'_>, d: &mut Vec<Diagnostic>) -> Option<Expr> {
        let span = path.span;
        let name = path.name.text.as_str();
        if !path.members.is_empty() {
            d.push(self.member(path));
            return None;
        }
        let leaf = |leaf| Some(Expr::new(Node::Leaf(leaf), span));
        match name {
            "pi" => return Some(Expr::new(Node::Number(std::f64::consts::PI), span)),
            "time" => {
                if let Some(what) = place.constant {
                    d.push(not_constant(span, "time", what));
                    return None;
                }
                return leaf(Leaf::Time);
            }
            "e" | "f" | "q" | "p" => {
                if let Some((_, variable)) = place.own.iter().find(|(own, _)| *own == name) {
                    return leaf(Leaf::Own(*variable));
                }
                let error = Diagnostic::error(
                    "E0217",
                    span,
                    format!("`{name}` alone is an element's own variable"),
                );
                d.push(match place.own {
                    [] => error.says("no element's law stands here").help(place.own_help),
                    own => error
                        .says(format!(
                            "this law is one over {}",
                            own.iter()
                                .map(|o| format!("`{}`", o.0))
                                .collect::<Vec<_>>()
                                .join(" and ")
                        ))
                        .help(place.own_help),
                });
                return None;
            }
            _ => {}
        }
        match (self.values.get(name), place.constant) {
            (Some(Meaning::Parameter(id)), _) => leaf(Leaf::Parameter(*id)),
            (Some(Meaning::Signal(id)), None) => leaf(Leaf::Signal(*id)),
            (Some(Meaning::Signal(id)), Some(what)) => {
                let declared = self.graph.signals[id.index()].span;
                d.push(not_constant(span, name, what).label(declared, "a signal, declared here"));
                None
            }
            (None, _) => {
                if !self.excused.contains(name) {
                    d.push(self.unknown(name, span, place));
                }
                None
            }
        }
    }

    fn member(&self, path: &Path) -> Diagnostic {
        let name = path.name.text.as_str();
        if self.vertices.contains_key(name) {
            return Diagnostic::error(
                "E0208",
                path.span,
                format!("`{}` alone is no value", path.text()),
            )
            .says("a port")
            .help(format!("read its effort or flow: `e({0})`, `f({0})`", path.text()));
        }
        Diagnostic::error(
            "E0201",
            path.span,
            "instances of models are not part of the language yet",
        )
        .says("a name within an instance")
    }

    fn unknown(&self, name: &str, span: Span, place: Place<'_>) -> Diagnostic {
        let error =
            Diagnostic::error("E0208", span, format!("no parameter or signal is called `{name}`"))
                .says("not declared anywhere");
        if self.vertices.contains_key(name) {
            let vertex = self.declarations[self.vertices[name].index()];
            return error
                .label(vertex.span, format!("`{name}` is {}", a(vertex.element.noun)))
                .help(format!("to read its variables write `e({name})`, `f({name})`"));
        }
        let known = self
            .values
            .iter()
            .filter(|(_, meaning)| {
                place.constant.is_none() || matches!(meaning, Meaning::Parameter(_))
            })
            .map(|(name, _)| *name);
        let mut known: Vec<&str> = known.chain(["time", "pi"]).collect();
        known.sort_unstable();
        match nearest(name, known) {
            Some(meant) => did_you_mean(error, span, meant),
            None if RESERVED.contains(&name) => error,
            None => error.help(format!("declare it: `param {name} = …`")),
        }
    }

    /// The number of an expression of parameters; they must have been evaluated.
    pub fn number(
        &mut self,
        expr: &syntax::Expr,
        what: &'static str,
        d: &mut Vec<Diagnostic>,
    ) -> Option<f64> {
        let lowered = self.lower(expr, Place::constant(what), d)?;
        self.evaluate(&lowered, what, expr.span, d)
    }

    /// The number of a lowered expression of parameters. `None` without an error when one of them has none.
    pub fn evaluate(
        &self,
        expr: &Expr,
        what: &str,
        span: Span,
        d: &mut Vec<Diagnostic>,
    ) -> Option<f64> {
        let mut known = true;
        expr.leaves(&mut |leaf, _| {
            known &= matches!(leaf, Leaf::Parameter(id) if self.evaluated[id.index()]);
        });
        if !known {
            return None;
        }
        let value = expr.evaluate(&mut |leaf| match leaf {
            Leaf::Parameter(id) => self.graph.parameters[id.index()].value,
            _ => f64::NAN,
        });
        if value.is_finite() {
            return Some(value);
        }
        d.push(Diagnostic::error("E0213", span, format!("{what} has no finite value")).says(
            if value.is_nan() {
                "this is not a number, as 0/0 and the root of −1 are not".to_string()
            } else {
                format!("this is {value}")
            },
        ));
        None
    }
}

fn not_constant(span: Span, name: &str, what: &str) -> Diagnostic {
    Diagnostic::error("E0211", span, format!("`{name}` changes with time, {what} does not"))
        .says("only parameters and numbers can stand here")
}

/// −1·number as a number, so that a literal stays one.
fn with_signs(expr: Expr) -> Expr {
    let span = expr.span;
    let node = match *expr.node {
        Node::Unary(Unary::Negate, a) => {
            let a = with_signs(a);
            match a.as_number() {
                Some(value) => Node::Number(-value),
                None => Node::Unary(Unary::Negate, a),
            }
        }
        Node::Unary(op, a) => Node::Unary(op, with_signs(a)),
        Node::Binary(op, a, b) => Node::Binary(op, with_signs(a), with_signs(b)),
        Node::Call(f, a) => Node::Call(f, a.into_iter().map(with_signs).collect()),
        Node::If(c, a, b) => Node::If(with_signs(c), with_signs(a), with_signs(b)),
        Node::Table(a, table) => Node::Table(with_signs(a), table),
        other => other,
    };
    Tree::new(node, span)
}

/// Whether the value can change during a run.
pub(super) fn varies(expr: &Expr) -> bool {
    let mut varies = false;
    expr.leaves(&mut |leaf, _| varies |= !matches!(leaf, Leaf::Parameter(_)));
    varies
}
