//! The arguments of an element whose variables become others: scaled, as across a transformer, or exchanged, as across a
//! gyrator.
//!
//! Each old variable is a new one times a power of one factor φ. So a law `y = law(x)` becomes
//! `y' = law(x'·φ^k)·φ^-l`, and
//!
//! | | scaled: e' = e·φ^a, f' = f·φ^b | exchanged: e' = φ·f, f' = e/φ |
//! |---|---|---|
//! | R: e = R·f | R·φ^(a−b) | φ²/R |
//! | C: e = q/C | C·φ^(b−a) | an I of C·φ² |
//! | I: f = p/I | I·φ^(a−b) | a C of I/φ² |
//! | Se, Sf | e·φ^a, f·φ^b | an Sf of e/φ, an Se of φ·f |
//! | TF of ratio r | r | 1/r |
//! | GY of ratio r | r·φ^(a−b) | φ²/r |
//!
//! (Karnopp, Margolis, Rosenberg, *System Dynamics*, ch. 4: equivalences of multiports.)

use super::factor::{Factor, level};
use super::respell::{splice, visit_argument};
use super::{Source, Trouble};
use crate::bond::elements::{Shape, element};
use crate::bond::graph::{Law, VertexId};
use crate::bond::syntax::{Argument, Expr, Leaf, Value};
use crate::diagnostic::Diagnostic;
use crate::source::Span;

/// How the variables of an element change.
#[derive(Clone, Debug)]
pub enum Scaling {
    /// e' = e·φ^effort, f' = f·φ^flow
    #[allow(missing_docs)]
    Scaled { factor: Factor, effort: i32, flow: i32 },
    /// e' = φ·f, f' = e/φ
    Exchanged(Factor),
}

impl Scaling {
    /// φ
    pub fn factor(&self) -> &Factor {
        match self {
            Scaling::Scaled { factor, .. } | Scaling::Exchanged(factor) => factor,
        }
    }

    /// What an old variable is: a new one times a power of φ.
    pub fn old(&self, variable: &str) -> (&'static str, i32) {
        match (self, variable) {
            (Scaling::Scaled { effort, .. }, "e") => ("e", -effort),
            (Scaling::Scaled { effort, .. }, "p") => ("p", -effort),
            (Scaling::Scaled { flow, .. }, "f") => ("f", -flow),
            (Scaling::Scaled { flow, .. }, "q") => ("q", -flow),
            (Scaling::Exchanged(_), "e") => ("f", 1),
            (Scaling::Exchanged(_), "f") => ("e", -1),
            (Scaling::Exchanged(_), "q") => ("p", -1),
            (Scaling::Exchanged(_), "p") => ("q", 1),
            _ => ("power", 0),
        }
    }

    /// An old variable as text over the new ones, to stand as a factor.
    pub fn spelt(&self, variable: &str, reading: &dyn Fn(&str) -> String) -> String {
        let (new, power) = self.old(variable);
        let text = self.factor().times(&reading(new), 2, power);
        if power == 0 { text } else { format!("({text})") }
    }

    /// The kind of an element afterwards.
    pub fn kind(&self, kind: &'static str) -> &'static str {
        if matches!(self, Scaling::Scaled { .. }) {
            return kind;
        }
        match kind {
            "0" => "1",
            "1" => "0",
            "C" => "I",
            "I" => "C",
            "MC" => "MI",
            "MI" => "MC",
            "Se" => "Sf",
            "Sf" => "Se",
            "MSe" => "MSf",
            "MSf" => "MSe",
            "De" => "Df",
            "Df" => "De",
            other => other,
        }
    }
}

/// The arguments of an element, without brackets, after its variables have changed; `respelt` are readings in them that
/// are spelt otherwise now.
/// Without `starts` it starts from nothing.
///
/// # Errors
/// That its law cannot follow.
pub fn scaled(
    source: &Source,
    id: VertexId,
    scaling: &Scaling,
    starts: bool,
    respelt: &[(Span, String)],
) -> Result<String, Trouble> {
    let vertex = source.graph.vertex(id);
    let Some(declared) = source.declared.get(&id) else { return Ok(String::new()) };
    let shape = element(vertex.kind).map_or(Shape::Mixed, |element| element.shape);
    let field = matches!(vertex.law, Law::Field(_));
    if field || shape == Shape::Mixed {
        let message = format!("the field `{}` cannot be moved across a two-port", vertex.name);
        return Err(Box::new(Diagnostic::error("E1101", vertex.span, message)));
    }
    if shape.is_junction() || matches!(shape, Shape::EffortDetector | Shape::FlowDetector) {
        return Ok(String::new());
    }
    let factor = scaling.factor();
    let exchanged = matches!(scaling, Scaling::Exchanged(_));
    let text = |argument: &Argument, expr: &Expr| {
        let mut edits: Vec<(Span, String)> =
            respelt.iter().filter(|(span, _)| inside(*span, expr.span)).cloned().collect();
        visit_argument(argument, &mut |leaf, span| {
            if edits.iter().any(|(place, _)| *place == span) {
                return false;
            }
            if let Leaf::Name(path) = leaf
                && path.members.is_empty()
                && matches!(path.name.text.as_str(), "e" | "f" | "q" | "p")
                && argument.label.is_some()
            {
                edits.push((span, scaling.spelt(&path.name.text, &str::to_string)));
            }
            true
        });
        splice(source.slice(expr.span), expr.span.start, &mut edits)
    };
    let plain = |value: &str, own: u8| match (shape, exchanged) {
        (Shape::Dissipator, true) => factor.over_value(value, own, 2),
        (Shape::Dissipator | Shape::Inertia, false) => {
            factor.times(value, own, scaling.old("f").1 - scaling.old("e").1)
        }
        (Shape::Compliance, false) => {
            factor.times(value, own, scaling.old("e").1 - scaling.old("f").1)
        }
        (Shape::Compliance, true) => factor.times(value, own, 2),
        (Shape::Inertia, true) => factor.times(value, own, -2),
        (Shape::EffortSource, _) => factor.times(value, own, -scaling.old("e").1),
        (Shape::FlowSource, _) => factor.times(value, own, -scaling.old("f").1),
        (Shape::Transformer, true) => format!("gain = {value}"),
        (Shape::Gyrator, true) => factor.over_value(value, own, 2),
        (Shape::Gyrator, false) => {
            factor.times(value, own, scaling.old("f").1 - scaling.old("e").1)
        }
        _ => value.to_string(),
    };
    let mut parts = vec![];
    let arguments = declared.arguments.as_deref().unwrap_or(&[]);
    let initial = |argument: &&Argument| super::is_initial(argument);
    if arguments.iter().all(|argument| initial(&argument)) {
        parts.push(plain(&vertex.name, 2));
    }
    for argument in arguments.iter().filter(|argument| starts || !initial(argument)) {
        let Value::Expr(expr) = &argument.value else {
            let message = format!("the law of `{}` cannot be moved", vertex.name);
            return Err(Box::new(Diagnostic::error("E1101", argument.span, message)));
        };
        let (value, own) = (text(argument, expr), level(expr));
        let Some(label) = &argument.label else {
            parts.push(plain(&value, own));
            continue;
        };
        let name = label.name.text.as_str();
        parts.push(match name {
            "r" => plain(&value, own),
            "gain" => match (shape, exchanged) {
                (Shape::Transformer, true) => value,
                (Shape::Gyrator, true) => factor.times(&value, own, 2),
                (Shape::Gyrator, false) => {
                    let power = scaling.old("e").1 - scaling.old("f").1;
                    format!("gain = {}", factor.times(&value, own, power))
                }
                _ => format!("gain = {value}"),
            },
            _ => {
                let letter = name.get(..1).unwrap_or("");
                let (new, power) = scaling.old(letter);
                let value = factor.times(&value, own, -power);
                match (label.derivative, name.len()) {
                    (true, _) => format!("der({new}) = {value}"),
                    (false, 2) => format!("{new}0 = {value}"),
                    _ => format!("{new} = {value}"),
                }
            }
        });
    }
    Ok(parts.join(", "))
}

/// Whether a place lies in another.
pub fn inside(part: Span, whole: Span) -> bool {
    part.file == whole.file && whole.start <= part.start && part.end <= whole.end
}
