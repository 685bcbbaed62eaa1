//! What a plain run does: end, output interval, options.

use super::Overrides;
use super::dimensions::{Dim, SECOND};
use super::scope::Scope;
use crate::bond::graph::BondGraph;
use crate::bond::syntax::{Expr as Syntax, parse_value};
use crate::diagnostic::Diagnostic;
use crate::expr::Node;
use crate::quantity::Dimension;
use crate::source::Span;

impl Scope<'_> {
    /// Reads `simulate` and `options`, each as the command line overrides it.
    pub fn set_run(&mut self, overrides: &Overrides, d: &mut Vec<Diagnostic>) {
        let simulate = std::mem::take(&mut self.simulate);
        if let [(.., first), (.., second), ..] = simulate.as_slice() {
            d.push(
                Diagnostic::error("E0220", *second, "a second `simulate` statement")
                    .says("says it again")
                    .label(*first, "first said here"),
            );
        }
        if let Some((until, step, _)) = simulate.first() {
            let until = until.as_ref().map(|value| self.duration(value, "the end of the run", d));
            let step = step.as_ref().map(|value| self.duration(value, "the output interval", d));
            self.graph.experiment.until = until.flatten();
            self.graph.experiment.step = step.flatten();
        }
        if let Some(text) = &overrides.until {
            self.graph.experiment.until =
                self.given_duration(text, "--until", "the end of the run", d);
        }
        if let Some(text) = &overrides.step {
            self.graph.experiment.step =
                self.given_duration(text, "--step", "the output interval", d);
        }
        let options =
            self.options.iter().map(|(key, value)| (key.text.clone(), value.text.clone()));
        let options: Vec<_> = options.chain(overrides.options.iter().cloned()).collect();
        self.graph.experiment.options = options;
    }

    /// A positive time in seconds.
    fn duration(
        &mut self,
        value: &Syntax,
        what: &'static str,
        d: &mut Vec<Diagnostic>,
    ) -> Option<f64> {
        let seconds = self.number(value, what, d)?;
        if let Dim::Known(dimension) = self.checked_dimension(value, d)
            && dimension != SECOND
        {
            let found = dimension.describe(self.written_unit(value).as_deref());
            d.push(
                Diagnostic::error(
                    "E0303",
                    value.span,
                    format!("{what} is {found} instead of a time"),
                )
                .says(found)
                .help("give it in a unit of time, as in `1.5 s`"),
            );
            return None;
        }
        if seconds <= 0.0 {
            d.push(
                Diagnostic::error("E0226", value.span, format!("{what} must be positive"))
                    .says(format!("this is {seconds} s")),
            );
            return None;
        }
        Some(seconds)
    }

    fn given_duration(
        &mut self,
        text: &str,
        flag: &str,
        what: &'static str,
        d: &mut Vec<Diagnostic>,
    ) -> Option<f64> {
        let before = d.len();
        let value = parse_value(text, Span::NONE.file, d);
        let seconds = value.and_then(|value| self.duration(&value, what, d));
        for error in &mut d[before..] {
            error.notes.push(format!("in {flag} {text}"));
        }
        seconds
    }
}

/// Inputs that nothing drives, as errors: a run needs to know what they get. Checking and converting need not.
pub fn require_drives(graph: &BondGraph, d: &mut Vec<Diagnostic>) {
    d.retain(|diagnostic| diagnostic.code != "W0201");
    for id in &graph.experiment.undriven {
        let signal = &graph.signals[id.index()];
        d.push(
            Diagnostic::error(
                "E0227",
                signal.span,
                format!("nothing drives the input `{}`", signal.name),
            )
            .says("no value for the run")
            .help(format!(
                "add `drive {0} = …` to the file, or --drive '{0} = …' to the command",
                signal.name
            )),
        );
    }
}

/// The SI unit of a dimension for the head of a column; empty for a pure number. What may be a torque is taken for an
/// energy.
pub(super) fn si_text(dimension: Dimension) -> String {
    const ENERGY: Dimension = Dimension::new(2, 1, -2, 0, 0);
    match dimension {
        Dimension::NONE => String::new(),
        ENERGY => "J".to_string(),
        other => other.si(),
    }
}

/// Whether a value is a name alone, and this one.
pub(super) fn is_name(value: &Syntax, name: &str) -> bool {
    matches!(&*value.node, Node::Leaf(crate::bond::syntax::Leaf::Name(path)) if path.text() == name)
}
