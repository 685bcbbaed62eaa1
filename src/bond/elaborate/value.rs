//! Expressions: from names to what they mean.

use super::fields::numbered;
use super::frames::{FrameId, Round, Thing};
use super::scope::{Meaning, RESERVED, Scope, a};
use crate::bond::graph::*;
use crate::bond::syntax::{self, Part, Path};
use crate::diagnostic::Diagnostic;
use crate::expr::{Expr as Tree, Node, Unary};
use crate::quantity::{did_you_mean, nearest};
use crate::source::Span;

/// An own variable of an element: the name that a law calls it by, and what it is.
pub(super) type Own<'p> = (&'p str, Leaf);

/// What an expression may speak of, by where it stands.
#[derive(Clone, Copy)]
pub(super) struct Place<'p> {
    /// What it is the value of, when only parameters may stand in it: `a parameter`.
    pub constant: Option<&'static str>,
    /// The element's own variables that it may use.
    pub own: &'p [Own<'p>],
    /// What to do instead of using another own variable.
    pub own_help: &'p str,
    /// Whom hidden signals belong to, and the statement; `None` where no function with memory can stand.
    pub owner: Option<(&'p str, usize)>,
    /// Whether what models keep to themselves may be looked at.
    pub looks_inside: bool,
}

impl<'p> Place<'p> {
    /// Parameters alone.
    pub fn constant(what: &'static str) -> Place<'p> {
        Place { constant: Some(what), own: &[], own_help: READ, owner: None, looks_inside: false }
    }

    /// Anything but own variables.
    pub fn free(owner: &'p str, statement: usize) -> Place<'p> {
        Place {
            constant: None,
            own: &[],
            own_help: READ,
            owner: Some((owner, statement)),
            looks_inside: false,
        }
    }

    /// A law over own variables.
    pub fn law(
        own: &'p [Own<'p>],
        own_help: &'p str,
        owner: &'p str,
        statement: usize,
    ) -> Place<'p> {
        Place {
            constant: None,
            own,
            own_help,
            owner: Some((owner, statement)),
            looks_inside: false,
        }
    }

    /// What is observed: no new states arise by looking.
    pub fn observed() -> Place<'p> {
        Place { constant: None, own: &[], own_help: READ, owner: None, looks_inside: true }
    }
}

/// Terms of a sum.
const MOST_TERMS: i64 = 1_000_000;

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
            syntax::Leaf::Sum(sum) => self.sum(sum, span, place, d),
        }
    }

    /// What a name alone means.
    fn name(&mut self, path: &Path, place: Place<'_>, d: &mut Vec<Diagnostic>) -> Option<Expr> {
        let span = path.span;
        let name = path.name.text.as_str();
        let plain = path.members.is_empty() && path.name.indices.is_empty();
        if let Some(value) = self.variable(name).filter(|_| plain) {
            return Some(Expr::new(Node::Number(value as f64), span));
        }
        let leaf = |leaf| Some(Expr::new(Node::Leaf(leaf), span));
        if let Some((_, own)) = place.own.iter().find(|(own, _)| plain && *own == name) {
            self.hidden_value(name, span, d);
            return leaf(own.clone());
        }
        match name {
            _ if !plain => {}
            "pi" => return Some(Expr::new(Node::Number(std::f64::consts::PI), span)),
            "time" => {
                if let Some(what) = place.constant {
                    d.push(not_constant(span, "time", what));
                    return None;
                }
                return leaf(Leaf::Time);
            }
            "e" | "f" | "q" | "p" => {
                let error = |message: String| Diagnostic::error("E0217", span, message);
                d.push(match place.own {
                    [] => error(format!("`{name}` alone is an element's own variable"))
                        .says("no element's law stands here")
                        .help(place.own_help),
                    own => error(format!("`{name}` is no variable of this law"))
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
        let (frame, part) = self.frame_of(path, d)?;
        let key = self.full_key(part, d)?;
        let meaning = self.frames[frame.0 as usize].values.get(&*key).copied();
        match (meaning, place.constant) {
            (Some(meaning), _) if frame != self.here.frame && !place.looks_inside => {
                let inner = &self.frames[frame.0 as usize];
                if !inner.public.contains(&*key) {
                    d.push(self.private(path, &key, inner.body, meaning));
                    return None;
                }
            }
            _ => {}
        }
        match (meaning, place.constant) {
            (Some(Meaning::Parameter(id)), _) => leaf(Leaf::Parameter(id)),
            (Some(Meaning::Signal(id)), None) => leaf(Leaf::Signal(id)),
            (Some(Meaning::Signal(id)), Some(what)) => {
                let declared = self.graph.signals[id.index()].span;
                let written = self.map.text(span);
                d.push(
                    not_constant(span, written, what).label(declared, "a signal, declared here"),
                );
                None
            }
            (None, _) => {
                if !self.frames[frame.0 as usize].excused.contains(part.text.as_str()) {
                    d.push(self.unknown(frame, &key, part, place));
                }
                None
            }
        }
    }

    /// A warning where a field's own variable hides a parameter or signal.
    fn hidden_value(&self, name: &str, span: Span, d: &mut Vec<Diagnostic>) {
        let values = &self.frames[self.here.frame.0 as usize].values;
        if let Some(meaning) = values.get(name) {
            d.push(
                Diagnostic::warning(
                    "W0202",
                    span,
                    format!("`{name}` means the field's own variable here"),
                )
                .says("not the parameter or signal")
                .label(self.value_span(*meaning), "which has the same name")
                .help("give the parameter or signal another name"),
            );
        }
    }

    /// The frame in which the last name of a path is looked up, and that name.
    fn frame_of<'p>(
        &mut self,
        path: &'p Path,
        d: &mut Vec<Diagnostic>,
    ) -> Option<(FrameId, &'p Part)> {
        let mut frame = self.here.frame;
        let mut part = &path.name;
        for next in &path.members {
            let key = self.full_key(part, d)?;
            let inner = &self.frames[frame.0 as usize];
            match inner.things.get(&*key).copied() {
                Some(Thing::Instance(inside)) => frame = inside,
                Some(_) => {
                    let text = self.map.text(path.span);
                    d.push(
                        Diagnostic::error(
                            "E0208",
                            path.span,
                            format!("`{text}` alone is no value"),
                        )
                        .says("a port")
                        .help(format!("read its effort or flow: `e({text})`, `f({text})`")),
                    );
                    return None;
                }
                None => {
                    if !inner.excused.contains(part.text.as_str()) {
                        d.push(self.unknown_thing(frame, part, &key));
                    }
                    return None;
                }
            }
            part = next;
        }
        Some((frame, part))
    }

    /// The error for what a model keeps to itself.
    fn private(&self, path: &Path, key: &str, body: usize, meaning: Meaning) -> Diagnostic {
        let model = &self.bodies[body].name;
        let error = Diagnostic::error(
            "E0241",
            path.span,
            format!("`{}` is private to its model", self.map.text(path.span)),
        )
        .says("read from outside")
        .label(self.value_span(meaning), "declared here");
        match meaning {
            Meaning::Signal(_) => error.help(format!("let the model `{model}` say `output {key}`")),
            Meaning::Parameter(_) => error.help(format!(
                "parameters in the brackets after `model {model}` can be read from outside"
            )),
        }
    }

    /// `sum(k in 1..N, term)`
    fn sum(
        &mut self,
        sum: &syntax::Sum,
        span: Span,
        place: Place<'_>,
        d: &mut Vec<Diagnostic>,
    ) -> Option<Expr> {
        let from = self.integer(&sum.range.0, "a bound of a sum", d);
        let to = self.integer(&sum.range.1, "a bound of a sum", d);
        let (from, to) = (from?, to?);
        if to.saturating_sub(from) >= MOST_TERMS {
            d.push(
                Diagnostic::error("E0237", span, "the sum has too many terms")
                    .says(format!("from {from} to {to}"))
                    .because(format!("at most {MOST_TERMS} terms")),
            );
            return None;
        }
        let before = self.here;
        let name: std::rc::Rc<str> = sum.variable.text.as_str().into();
        let mut terms = vec![];
        for value in from..=to {
            let top = self.rounds.len();
            self.here.round = Some(top as u32);
            self.rounds.push(Round { name: name.clone(), value, outer: before.round });
            let term = self.lower(&sum.term, place, d);
            // Nothing that was lowered looks at the variable again.
            self.rounds.truncate(top);
            self.here = before;
            terms.push(term?);
        }
        Some(balanced(terms, span))
    }

    fn unknown(&self, frame: FrameId, name: &str, part: &Part, place: Place<'_>) -> Diagnostic {
        let span = part.span;
        if place.own.first().is_some_and(|own| numbered(own.0).is_some())
            && numbered(name).is_some()
        {
            return Diagnostic::error(
                "E0217",
                span,
                format!("`{name}` is no variable of this field's laws"),
            )
            .says("no parameter or signal of this name either")
            .help(place.own_help);
        }
        let names = &self.frames[frame.0 as usize];
        let inside = frame != self.here.frame;
        let within = match inside {
            true => format!(" in `{}`", names.prefix.trim_end_matches('.')),
            false => String::new(),
        };
        let mut error = Diagnostic::error(
            "E0208",
            span,
            format!("no parameter or signal is called `{name}`{within}"),
        )
        .says("not declared anywhere");
        if inside {
            let body = &self.bodies[names.body];
            error = error.label(body.span, format!("the model `{}`", body.name));
        }
        match names.things.get(name) {
            Some(Thing::Vertex(id)) => {
                let vertex = self.declarations[id.index()];
                let name = self.shown(*id);
                let noun = a(vertex.element.noun);
                let read = match vertex.element.kind {
                    "0" => format!("`e({name})`"),
                    "1" => format!("`f({name})`"),
                    "TF" | "MTF" | "GY" | "MGY" => format!("`e({name}.1)`, `f({name}.2)`"),
                    _ => format!("`e({name})`, `f({name})`"),
                };
                let message = format!("`{name}` is {noun}, no value");
                return Diagnostic::error("E0208", span, message)
                    .says("a value is needed here")
                    .label(vertex.span, format!("`{name}` is declared here"))
                    .help(format!("to read its variables write {read}"));
            }
            Some(Thing::Instance(inner)) => {
                let inner = &self.frames[inner.0 as usize];
                return error
                    .label(inner.span, format!("`{name}` is an instance"))
                    .help(format!("an output of it is read as `{name}.…`"));
            }
            Some(Thing::Port(port)) => {
                return error
                    .label(self.ports[port.0 as usize].span, format!("`{name}` is a port"))
                    .help(format!("to read its variables write `e({name})`, `f({name})`"));
            }
            None => {}
        }
        if self.searched(span) {
            return error;
        }
        let known = names
            .values
            .iter()
            .filter(|(name, meaning)| {
                (place.constant.is_none() || matches!(meaning, Meaning::Parameter(_)))
                    && (!inside || names.public.contains(*name))
            })
            .map(|(name, _)| name.as_ref());
        let mut known: Vec<&str> = known.collect();
        if !inside {
            known.extend(["time", "pi"]);
        }
        known.sort_unstable();
        let base = |known: &&&str| {
            known.strip_prefix(part.text.as_str()).is_some_and(|rest| rest.starts_with('['))
        };
        if let Some(first) = known.iter().find(base) {
            return match part.indices.is_empty() {
                true => error.help(format!("`{}` has an index, as in `{first}`", part.text)),
                false => error.because(format!("the first of them is `{first}`")),
            };
        }
        match nearest(name, known) {
            Some(meant) => did_you_mean(error, span, name, meant),
            None if RESERVED.contains(&name) || inside => error,
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
        &mut self,
        expr: &Expr,
        what: &str,
        span: Span,
        d: &mut Vec<Diagnostic>,
    ) -> Option<f64> {
        let mut known = true;
        let mut wanted = vec![];
        expr.leaves(&mut |leaf, _| match leaf {
            Leaf::Parameter(id) if self.evaluated[id.index()] => {}
            Leaf::Parameter(id) => wanted.push(id.index()),
            _ => known = false,
        });
        for k in wanted {
            self.demand(k, d);
            known &= self.evaluated[k];
        }
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

/// The sum of terms as a tree that is no deeper than it must be; 0 when there are none.
fn balanced(mut terms: Vec<Expr>, span: Span) -> Expr {
    while terms.len() > 1 {
        let mut halved = Vec::with_capacity(terms.len().div_ceil(2));
        let mut left = terms.into_iter();
        while let Some(first) = left.next() {
            halved.push(match left.next() {
                Some(second) => first + second,
                None => first,
            });
        }
        terms = halved;
    }
    let mut sum = terms.pop().unwrap_or(Tree::number(0.0));
    sum.span = span;
    sum
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
        Node::If(c, a, b) => Node::choice(with_signs(c), with_signs(*a), with_signs(*b)),
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
