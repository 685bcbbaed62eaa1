//! `loop`: which signal regulates what, for the design of its gains.

use super::scope::{Meaning, Scope, Valued};
use super::value::Place;
use crate::bond::graph::*;
use crate::bond::syntax::{self, Regulator as Written};
use crate::diagnostic::Diagnostic;
use crate::expr::Node;

impl Scope<'_> {
    /// Takes in every `loop` statement, while signals stand in the order of their declarations.
    pub fn make_regulators(&mut self, d: &mut Vec<Diagnostic>) {
        let written = std::mem::take(&mut self.regulators);
        for (regulator, here) in &written {
            let made = self.at(*here, |scope| scope.regulator(regulator, d));
            self.graph.regulators.extend(made);
        }
        self.regulators = written;
    }

    fn regulator(&mut self, written: &Written, d: &mut Vec<Diagnostic>) -> Option<Regulator> {
        let span = written.signal.span;
        // Names that mean nothing are reported as in any expression.
        let alone = syntax::Expr::new(Node::Leaf(syntax::Leaf::Name(written.signal.clone())), span);
        let signal = match self.look_up_value(&written.signal) {
            Some((Meaning::Signal(id), _)) => Some(id),
            _ => match self.lower(&alone, Place::observed(), d) {
                Some(_) => {
                    d.push(self.no_regulator(&written.signal, "this is a parameter"));
                    None
                }
                None => None,
            },
        };
        if let Some(id) = signal
            && !self.is_regulator(id)
        {
            d.push(self.no_regulator(&written.signal, "its law is another one"));
        }
        let gains = signal.and_then(|id| self.gains(id));
        let controlled = self.lower(&written.controlled, Place::observed(), d);
        let reference = self.lower(&written.reference, Place::observed(), d);
        let mut positive = |value: &Option<syntax::Expr>, what: &'static str| {
            let value = value.as_ref()?;
            let number = self.number(value, what, d)?;
            if number <= 0.0 {
                d.push(
                    Diagnostic::error("E0226", value.span, format!("{what} must be positive"))
                        .says(format!("this is {number}")),
                );
            }
            Some(number)
        };
        let bandwidth = positive(&written.bandwidth, "the bandwidth of a loop");
        let margin = positive(&written.margin, "the phase margin of a loop");
        Some(Regulator {
            signal: signal?,
            controlled: controlled?,
            reference: reference?,
            bandwidth,
            margin,
            gains,
            span,
        })
    }

    /// Kp and Ki of a signal that is made with `pi`, as they are written there.
    fn gains(&mut self, id: SignalId) -> Option<[Expr; 2]> {
        let Some(Some(Valued { value, here, .. })) = self.signals.get(id.index()) else {
            return None;
        };
        let here = *here;
        let Node::Leaf(syntax::Leaf::Call(call)) = &*value.node else { return None };
        let [arguments] = &call.rows[..] else { return None };
        let given = |name: &str, position: usize| {
            let named = arguments.iter().find(|argument| {
                argument.label.as_ref().is_some_and(|label| label.name.text == name)
            });
            let placed = arguments.get(position).filter(|argument| argument.label.is_none());
            match &named.or(placed)?.value {
                syntax::Value::Expr(expr) => Some(expr.clone()),
                _ => None,
            }
        };
        if call.name.text != "pi" {
            return None;
        }
        let (kp, ki) = (given("Kp", 1)?, given("Ki", 2)?);
        // What is wrong with them has been said of the signal.
        let mut said = vec![];
        let mut lower =
            |expr| self.at(here, |scope| scope.lower(expr, Place::observed(), &mut said));
        Some([lower(&kp)?, lower(&ki)?])
    }

    /// Whether a signal is made with `pi` or `pid`.
    fn is_regulator(&self, id: SignalId) -> bool {
        let Some(Some(Valued { value, .. })) = self.signals.get(id.index()) else {
            return false;
        };
        matches!(&*value.node, Node::Leaf(syntax::Leaf::Call(call))
            if matches!(call.name.text.as_str(), "pi" | "pid"))
    }

    fn no_regulator(&self, path: &syntax::Path, says: &str) -> Diagnostic {
        Diagnostic::error(
            "E0242",
            path.span,
            format!("`{}` is no regulator", self.map.text(path.span)),
        )
        .says(says)
        .help("a regulator is a signal made with `pi` or `pid` alone")
    }
}
