//! What a plain run does: end, output interval, options.

use super::Overrides;
use super::scope::Scope;
use crate::bond::graph::BondGraph;
use crate::bond::syntax::{Expr as Syntax, parse_value};
use crate::diagnostic::Diagnostic;
use crate::expr::Node;
use crate::quantity::{Dimension, Unit};
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
        if let super::dimensions::Dim::Known(dimension) = self.dimension(value, None)
            && dimension != super::dimensions::SECOND
        {
            d.push(
                Diagnostic::error("E0303", value.span, format!("{what} is no time"))
                    .says(format!("its dimension is {dimension}"))
                    .help("give it in seconds, as in `1.5 s`"),
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

/// The SI unit of a dimension in the words of engineers: `Pa`, `m^3/s`; empty for a pure number.
pub(super) fn si_text(dimension: Dimension) -> String {
    const COMMON: &[&str] = &[
        "m", "kg", "s", "A", "K", "V", "N", "Pa", "J", "W", "C", "Wb", "Ohm", "F", "H", "m/s",
        "m^3/s", "m^3", "m^2", "rad/s", "N*s", "Pa*s", "W/K", "J/K", "kg/s", "m/s^2", "s^2", "K*s",
        "A*s",
    ];
    if dimension.is_none() {
        return String::new();
    }
    let same = |text: &&&str| Unit::parse(text).is_ok_and(|unit| unit.dimension == dimension);
    match COMMON.iter().find(same) {
        Some(text) => text.to_string(),
        None => dimension.to_string(),
    }
}

/// The unit as written in a value, looking through a sign.
pub(super) fn is_name(value: &Syntax, name: &str) -> bool {
    matches!(&*value.node, Node::Leaf(crate::bond::syntax::Leaf::Name(path)) if path.text() == name)
}
