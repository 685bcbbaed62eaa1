//! Parameters: values as they are needed, and what the command line sets.

use super::dimensions::Dim;
use super::scope::{Mark, Scope, a};
use super::value::Place;
use crate::bond::graph::*;
use crate::bond::syntax;
use crate::diagnostic::Diagnostic;
use crate::expr::Node;
use crate::quantity::{Unit, did_you_mean, nearest};
use crate::source::Span;

/// Bounds and indices whose parameters have bounds and indices of their own, and so on.
const MOST_DEMANDS: usize = 50;

impl Scope<'_> {
    /// Gives each parameter its expression and its value, and reports what was set and is no parameter.
    pub fn evaluate_parameters(&mut self, d: &mut Vec<Diagnostic>) {
        for k in 0..self.parameters.len() {
            self.demand(k, d);
        }
        self.parameter_dimensions = vec![Dim::Unknown; self.parameters.len()];
        for at in 0..self.set.len() {
            self.check_setting(at, d);
        }
    }

    /// What the command line sets must be a parameter's; its unit is checked where all units are.
    fn check_setting(&mut self, at: usize, d: &mut Vec<Diagnostic>) {
        let setting = &self.set[at];
        let name = setting.name;
        if setting.taken.is_none() {
            let error = Diagnostic::error(
                "E0223",
                Span::NONE,
                format!("no parameter is called `{name}`, so it cannot be set"),
            );
            let private = self.graph.parameters.iter().find(|parameter| parameter.name == name);
            let signal = self.graph.signals.iter().any(|signal| signal.name == name);
            let names = self.graph.parameters.iter().map(|p| p.name.as_str());
            d.push(match (private, signal, nearest(name, names)) {
                (Some(private), ..) => {
                    let mut error = error.label(private.span, "private to its model");
                    error.message = format!("`{name}` is private to its model and cannot be set");
                    error.help("parameters in the brackets after a model's name can be set")
                }
                (_, true, _) => {
                    error.help("signals and inputs are not set; `--drive` drives an input")
                }
                _ if self.element_named(name).is_some() => self.value_of_element(name, error),
                (_, _, Some(meant)) => did_you_mean(error, Span::NONE, name, meant),
                _ => error,
            });
        }
    }

    /// How the value of an element that was taken for a parameter can be set.
    fn value_of_element(&self, name: &str, error: Diagnostic) -> Diagnostic {
        let Some(id) = self.element_named(name) else { return error };
        let declaration = self.declarations[id.index()];
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
    pub fn demand(&mut self, first: usize, d: &mut Vec<Diagnostic>) {
        match self.marks[first] {
            Mark::Done => return,
            Mark::Open => {
                let span = self.graph.parameters[first].span;
                return d.push(self.circle(&[first], first, span));
            }
            _ => {}
        }
        if self.demands >= MOST_DEMANDS {
            d.push(
                Diagnostic::error(
                    "E0110",
                    self.graph.parameters[first].span,
                    "indices and bounds are nested too deeply",
                )
                .because(format!("at most {MOST_DEMANDS} within one another")),
            );
            self.marks[first] = Mark::Done;
            return;
        }
        self.demands += 1;
        let mut path = vec![first];
        while let Some(&k) = path.last() {
            if self.marks[k] == Mark::Done {
                path.pop();
                continue;
            }
            if self.marks[k] == Mark::Untouched {
                self.marks[k] = Mark::Open;
                if !self.lower_parameter(k, d) {
                    self.marks[k] = Mark::Done;
                    path.pop();
                    continue;
                }
            }
            self.marks[k] = Mark::Open;
            let mut uses = vec![];
            self.graph.parameters[k].expr.leaves(&mut |leaf, span| {
                if let Leaf::Parameter(id) = leaf {
                    uses.push((id.index(), span));
                }
            });
            let fresh = |used: &usize| self.marks[*used] == Mark::Untouched;
            if let Some((used, _)) = uses.iter().find(|(used, _)| fresh(used)) {
                path.push(*used);
                continue;
            }
            if let Some((used, span)) =
                uses.iter().find(|(used, _)| self.marks[*used] == Mark::Open)
            {
                d.push(self.circle(&path, *used, *span));
            } else {
                let parameter = &self.graph.parameters[k];
                let what = format!("`{}`", parameter.name);
                let span = if parameter.expr.span.is_none() {
                    parameter.span
                } else {
                    parameter.expr.span
                };
                let expr = parameter.expr.clone();
                if let Some(value) = self.evaluate(&expr, &what, span, d) {
                    self.graph.parameters[k].value = value;
                    self.evaluated[k] = true;
                }
            }
            self.marks[k] = Mark::Done;
            path.pop();
        }
        self.demands -= 1;
    }

    /// Lowers the value of a parameter where its names are looked up; says whether it has one.
    fn lower_parameter(&mut self, k: usize, d: &mut Vec<Diagnostic>) -> bool {
        let Some(valued) = self.parameters[k] else { return false };
        let before = d.len();
        let place = Place::constant("a parameter");
        let Some(expr) = self.at(valued.here, |scope| scope.lower(valued.value, place, d)) else {
            if let Some(setting) = self.set.iter().find(|s| s.taken.is_some_and(|p| p.index() == k))
            {
                for error in &mut d[before..] {
                    error.notes.push(format!(
                        "in the value that was set: {}={}",
                        setting.name, setting.text
                    ));
                }
            }
            return false;
        };
        self.graph.parameters[k].unit = unit_of(valued.value);
        self.graph.parameters[k].expr = expr;
        true
    }

    /// The error for a parameter whose value depends on itself.
    fn circle(&self, path: &[usize], used: usize, span: Span) -> Diagnostic {
        let start = path.iter().position(|on| *on == used).unwrap_or(0);
        let names: Vec<String> = path[start..]
            .iter()
            .chain([&used])
            .map(|k| format!("`{}`", self.graph.parameters[*k].name))
            .collect();
        let mut error = Diagnostic::error(
            "E0212",
            self.graph.parameters[used].span,
            format!("the value of {} depends on itself", names[0]),
        )
        .says("this parameter");
        if names.len() > 2 {
            error = error.because(format!("the circle is {}", names.join(" → ")));
        }
        error.label(span, format!("needs {} here", names[0]))
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
