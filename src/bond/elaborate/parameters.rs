//! Parameters: overrides, order of evaluation, values.

use super::dimensions::Dim;
use super::scope::{Meaning, Scope, a, did_you_mean};
use super::value::Place;
use crate::bond::graph::*;
use crate::bond::syntax::{self, parse_value};
use crate::diagnostic::Diagnostic;
use crate::expr::Node;
use crate::quantity::{Unit, nearest};
use crate::source::Span;

/// How far the evaluation of a parameter has come.
#[derive(Clone, Copy, PartialEq)]
enum Mark {
    Untouched,
    /// On the way from the parameter that began to the one looked at.
    Open,
    Done,
}

impl Scope<'_> {
    /// Gives each parameter its expression and its value.
    pub fn evaluate_parameters(&mut self, set: &[(String, String)], d: &mut Vec<Diagnostic>) {
        let count = self.graph.parameters.len();
        self.evaluated = vec![false; count];
        self.parameter_dimensions = vec![Dim::Unknown; count];
        let mut lowered = vec![false; count];
        for (k, lowered) in lowered.iter_mut().enumerate() {
            let value = self.parameters[k].value;
            let place = Place::constant("a parameter");
            if let Some(expr) = self.lower(value, place, d) {
                self.graph.parameters[k].unit = unit_of(value);
                self.graph.parameters[k].expr = expr;
                *lowered = true;
            }
        }
        let overridden = self.override_parameters(set, &mut lowered, d);
        let mut marks = vec![Mark::Untouched; count];
        for k in 0..count {
            self.evaluate_parameter(k, &lowered, &mut marks, d);
        }
        self.infer_parameter_dimensions();
        for (k, text, dimension) in overridden {
            let declared = self.parameter_dimensions[k];
            if let (Dim::Known(declared), Dim::Known(given)) = (declared, dimension)
                && declared != given
            {
                let parameter = &self.graph.parameters[k];
                d.push(
                    Diagnostic::error(
                        "E0303",
                        Span::NONE,
                        format!("`{text}` is not a value for `{}`", parameter.name),
                    )
                    .label(parameter.span, format!("its dimension is {declared}"))
                    .because(format!("the dimension of `{text}` is {given}")),
                );
            }
        }
    }

    fn override_parameters(
        &mut self,
        set: &[(String, String)],
        lowered: &mut [bool],
        d: &mut Vec<Diagnostic>,
    ) -> Vec<(usize, String, Dim)> {
        let mut overridden = vec![];
        for (name, text) in set {
            let Some(Meaning::Parameter(id)) = self.values.get(name.as_str()).copied() else {
                let error = Diagnostic::error(
                    "E0223",
                    Span::NONE,
                    format!("no parameter is called `{name}`, so it cannot be set"),
                );
                let names = self.graph.parameters.iter().map(|p| p.name.as_str());
                d.push(match (self.values.contains_key(name.as_str()), nearest(name, names)) {
                    (true, _) => {
                        error.help("signals and inputs are not set; `--drive` drives an input")
                    }
                    _ if self.vertices.contains_key(name.as_str()) => {
                        self.value_of_element(name, error)
                    }
                    (_, Some(meant)) => did_you_mean(error, Span::NONE, meant),
                    _ => error,
                });
                continue;
            };
            let before = d.len();
            let value = parse_value(text, Span::NONE.file, d);
            let expr = value
                .as_ref()
                .and_then(|value| self.lower(value, Place::constant("a parameter"), d));
            if let (Some(value), Some(expr)) = (&value, expr) {
                overridden.push((id.index(), text.clone(), self.dimension(value, None)));
                let parameter = &mut self.graph.parameters[id.index()];
                parameter.expr = expr;
                parameter.unit = unit_of(value);
                lowered[id.index()] = true;
            }
            for error in &mut d[before..] {
                error.notes.push(format!("in the value that was set: {name}={text}"));
            }
        }
        overridden
    }

    /// How the value of an element that was taken for a parameter can be set.
    fn value_of_element(&self, name: &str, error: Diagnostic) -> Diagnostic {
        let declaration = self.declarations[self.vertices[name].index()];
        let noun = a(declaration.element.noun);
        let value = match declaration.arguments {
            Some([argument]) if argument.label.is_none() => self.map.text(argument.span),
            _ => "",
        };
        let error = error.label(declaration.span, format!("`{name}` is {noun}"));
        if value.is_empty() {
            return error.help("give it the value of a parameter, and the parameter can be set");
        }
        error.help(format!(
            "`{name}` is {noun} with the value {value}; write `param {name} = {value}` and \
             `{name}` without a value, and it can be set"
        ))
    }

    /// Evaluates a parameter after those that it uses, without recursion: a chain may be as long as the file.
    fn evaluate_parameter(
        &mut self,
        first: usize,
        lowered: &[bool],
        marks: &mut [Mark],
        d: &mut Vec<Diagnostic>,
    ) {
        let mut path = vec![first];
        while let Some(&k) = path.last() {
            if marks[k] == Mark::Done {
                path.pop();
                continue;
            }
            marks[k] = Mark::Open;
            let mut uses = vec![];
            self.graph.parameters[k].expr.leaves(&mut |leaf, span| {
                if let Leaf::Parameter(id) = leaf {
                    uses.push((id.index(), span));
                }
            });
            let open = uses.iter().find(|(used, _)| marks[*used] == Mark::Untouched);
            if let Some((used, _)) = open {
                path.push(*used);
                continue;
            }
            if let Some((used, span)) = uses.iter().find(|(used, _)| marks[*used] == Mark::Open) {
                let start = path.iter().position(|on| on == used).unwrap_or(0);
                let names = path[start..]
                    .iter()
                    .chain([used])
                    .map(|k| format!("`{}`", self.graph.parameters[*k].name))
                    .collect::<Vec<_>>();
                let mut error = Diagnostic::error(
                    "E0212",
                    self.graph.parameters[*used].span,
                    format!("the value of {} depends on itself", names[0]),
                )
                .says("this parameter");
                if names.len() > 2 {
                    error = error.because(format!("the circle is {}", names.join(" → ")));
                }
                d.push(error.label(*span, format!("needs {} here", names[0])));
                marks[k] = Mark::Done;
                path.pop();
                continue;
            }
            marks[k] = Mark::Done;
            path.pop();
            if lowered[k] {
                let parameter = &self.graph.parameters[k];
                let what = format!("`{}`", parameter.name);
                let span = if parameter.expr.span.is_none() {
                    parameter.span
                } else {
                    parameter.expr.span
                };
                if let Some(value) = self.evaluate(&parameter.expr, &what, span, d) {
                    self.graph.parameters[k].value = value;
                    self.evaluated[k] = true;
                }
            }
        }
    }
}

/// The unit of a literal, for messages.
fn unit_of(value: &syntax::Expr) -> Option<Unit> {
    match &*value.node {
        Node::Leaf(syntax::Leaf::Quantity(_, unit)) => Some(unit.clone()),
        Node::Unary(_, inner) => unit_of(inner),
        _ => None,
    }
}
