//! The law of each element, from its arguments.

use super::fields;
use super::scope::{Declaration, Meaning, Scope, a};
use super::value::{Own, Place, varies};
use crate::bond::elements::Shape;
use crate::bond::graph::*;
use crate::bond::syntax::{self, Argument, Label, Value};
use crate::diagnostic::Diagnostic;
use crate::expr::{Binary, Expr as Tree, Node};
use crate::quantity::{did_you_mean, nearest};

const EFFORT: Own<'static> = ("e", Leaf::Own(Variable::Power(Power::Effort)));
const FLOW: Own<'static> = ("f", Leaf::Own(Variable::Power(Power::Flow)));
const CHARGE: Own<'static> = ("q", Leaf::Own(Variable::Stored));
const MOMENTUM: Own<'static> = ("p", Leaf::Own(Variable::Stored));

/// A form that a law may have: what stands before `=`, and over which own variables.
struct Form {
    shape: Shape,
    label: &'static str,
    derivative: bool,
    own: &'static [Own<'static>],
    make: fn(Expr) -> Made,
}

/// What a form makes.
enum Made {
    Dissipation(Dissipation),
    Store(StoreLaw),
    Rate(Expr),
    Ratio(Expr),
    Gain(Expr),
}

const fn form(
    shape: Shape,
    label: &'static str,
    derivative: bool,
    own: &'static [Own<'static>],
    make: fn(Expr) -> Made,
) -> Form {
    Form { shape, label, derivative, own, make }
}

/// Every form of a law with a label, one row each.
const FORMS: &[Form] = &[
    form(Shape::Dissipator, "e", false, &[FLOW], |x| Made::Dissipation(Dissipation::Effort(x))),
    form(Shape::Dissipator, "f", false, &[EFFORT], |x| Made::Dissipation(Dissipation::Flow(x))),
    form(Shape::Compliance, "e", false, &[CHARGE], |x| Made::Store(StoreLaw::OfStored(x))),
    form(Shape::Compliance, "q", false, &[EFFORT], |x| Made::Store(StoreLaw::OfPower(x))),
    form(Shape::Compliance, "e", true, &[FLOW, EFFORT], Made::Rate),
    form(Shape::Inertia, "f", false, &[MOMENTUM], |x| Made::Store(StoreLaw::OfStored(x))),
    form(Shape::Inertia, "p", false, &[FLOW], |x| Made::Store(StoreLaw::OfPower(x))),
    form(Shape::Inertia, "f", true, &[EFFORT, FLOW], Made::Rate),
    form(Shape::Transformer, "r", false, &[], modulus),
    form(Shape::Transformer, "gain", false, &[], Made::Gain),
    form(Shape::Gyrator, "r", false, &[], modulus),
    form(Shape::Gyrator, "gain", false, &[], Made::Gain),
];

/// The labels of initial values: of which shape, whether of the stored variable.
const INITIALS: &[(&str, Shape, bool)] = &[
    ("q0", Shape::Compliance, true),
    ("e0", Shape::Compliance, false),
    ("p0", Shape::Inertia, true),
    ("f0", Shape::Inertia, false),
];

/// The arguments of an element, sorted.
#[derive(Default)]
struct Sorted<'a> {
    value: Option<&'a syntax::Expr>,
    law: Option<(&'static Form, &'a syntax::Expr)>,
    initial: Option<(bool, &'a syntax::Expr)>,
}

impl Scope<'_> {
    /// Gives each element its law.
    pub fn make_laws(&mut self, d: &mut Vec<Diagnostic>) {
        for k in 0..self.declarations.len() {
            let declaration = self.declarations[k];
            let name = self.graph.vertices[k].name.clone();
            let law = self.at(declaration.here, |scope| match fields::ports(&declaration) {
                Some(ports) => scope.field_law(VertexId(k as u32), &declaration, &name, ports, d),
                None => scope.law(&declaration, &name, d),
            });
            if let Some(law) = law {
                self.graph.vertices[k].law = law;
            }
        }
    }

    fn law(
        &mut self,
        declaration: &Declaration<'_>,
        name: &str,
        d: &mut Vec<Diagnostic>,
    ) -> Option<Law> {
        let shape = declaration.element.shape;
        let statement = declaration.statement;
        let sorted = self.sort(declaration, d)?;
        let kind = match shape {
            Shape::Compliance => Storage::Compliance,
            _ => Storage::Inertia,
        };
        let simple =
            match shape {
                Shape::Zero => Some(Law::Zero),
                Shape::One => Some(Law::One),
                Shape::EffortDetector | Shape::FlowDetector => shape
                    .sets()
                    .map(|sets| Law::Source { sets, value: Tree::number(0.0), detector: true }),
                _ => None,
            };
        if simple.is_some() {
            return simple;
        }
        let initial = match sorted.initial {
            Some((stored, value)) => {
                let lowered = self.lower(value, Place::constant("an initial value"), d);
                if let Some(lowered) = &lowered {
                    // Only for the message: the value is used where all initial values are solved.
                    self.evaluate(lowered, "the initial value", value.span, d);
                }
                Some((stored, lowered?))
            }
            None => None,
        };
        let made = match sorted.law {
            Some((form, value)) => {
                let help = own_help(form);
                let place = Place::law(form.own, &help, name, statement);
                (form.make)(self.lower(value, place, d)?)
            }
            None => {
                let value = match sorted.value {
                    Some(value) => {
                        let help = value_help(shape, name);
                        self.lower(value, Place::law(&[], &help, name, statement), d)?
                    }
                    None => self.implied(declaration, d)?,
                };
                match shape {
                    Shape::EffortSource | Shape::FlowSource => {
                        let sets = shape.sets()?;
                        return Some(Law::Source { sets, value, detector: false });
                    }
                    Shape::Dissipator => Made::Dissipation(Dissipation::Linear(value)),
                    Shape::Transformer | Shape::Gyrator => modulus(value),
                    _ => Made::Store(StoreLaw::Linear(value)),
                }
            }
        };
        Some(match made {
            Made::Dissipation(law) => Law::Dissipator(law),
            Made::Store(law) => {
                let initial = match initial {
                    None => StoreInitial::Unstated,
                    Some((true, value)) => StoreInitial::Stored(value),
                    Some((false, value)) => StoreInitial::Power(value),
                };
                Law::Store { kind, law, initial }
            }
            Made::Rate(rate) => {
                let initial = match initial {
                    None => Initial::Implied,
                    Some((false, value)) => Initial::Given(value),
                    Some((true, value)) => {
                        let (stored, power) = match kind {
                            Storage::Compliance => ("q0", "e0"),
                            Storage::Inertia => ("p0", "f0"),
                        };
                        d.push(
                            Diagnostic::error(
                                "E0209",
                                value.span,
                                format!(
                                    "`{name}` is in rate form and cannot start from `{stored}`"
                                ),
                            )
                            .says(format!("the state of a rate form is `{}`", &power[..1]))
                            .help(format!("give `{power} = …`")),
                        );
                        return None;
                    }
                };
                Law::Rate { kind, rate, initial }
            }
            Made::Ratio(ratio) if shape == Shape::Transformer => {
                Law::Transformer(Modulus::Ratio(ratio))
            }
            Made::Gain(gain) if shape == Shape::Transformer => {
                Law::Transformer(Modulus::Gain(gain))
            }
            Made::Ratio(ratio) => Law::Gyrator(Modulus::Ratio(ratio)),
            Made::Gain(gain) => Law::Gyrator(Modulus::Gain(gain)),
        })
    }

    /// The value of an element without arguments: the parameter or signal of its name.
    fn implied(&mut self, declaration: &Declaration<'_>, d: &mut Vec<Diagnostic>) -> Option<Expr> {
        let span = declaration.name.span;
        let key = self.key(declaration.name)?;
        let name = &*key;
        let leaf = match self.value(name) {
            Some(Meaning::Parameter(id)) => Leaf::Parameter(id),
            Some(Meaning::Signal(id)) => Leaf::Signal(id),
            None if self.excused(&declaration.name.text) => return None,
            None => {
                let kind = declaration.element.kind;
                let error = Diagnostic::error(
                    "E0207",
                    declaration.span,
                    format!("the {} `{name}` has no value", declaration.element.noun),
                )
                .says(format!("no argument, and no parameter or signal is called `{name}`"));
                if self.searched(declaration.span) {
                    d.push(error);
                    return None;
                }
                let mut names: Vec<&str> =
                    self.frame().values.keys().map(|name| name.as_ref()).collect();
                names.sort_unstable();
                d.push(match nearest(name, names) {
                    Some(meant) => error.help(format!(
                        "write the value in brackets, `{kind}:{name}({meant})`, or declare `param {name} = …`"
                    )),
                    None => error.help(format!(
                        "write the value in brackets, `{kind}:{name}(…)`, or declare `param {name} = …`"
                    )),
                });
                return None;
            }
        };
        Some(Tree::new(Node::Leaf(leaf), span))
    }

    /// Sorts the arguments of an element into value, law and initial value.
    fn sort<'a>(
        &self,
        declaration: &Declaration<'a>,
        d: &mut Vec<Diagnostic>,
    ) -> Option<Sorted<'a>> {
        let mut sorted = Sorted::default();
        let shape = declaration.element.shape;
        let before = d.len();
        let Some(arguments) = declaration.arguments else { return Some(sorted) };
        for argument in arguments {
            let Argument { label, value, span } = argument;
            let Value::Expr(value) = value else {
                d.push(match value {
                    Value::Matrix(_) => Diagnostic::error(
                        "E0209",
                        *span,
                        format!("{} takes no matrix", a(declaration.element.noun)),
                    )
                    .says("only R, C and I do")
                    .help(usage(shape)),
                    _ => Diagnostic::error("E0209", *span, "a text is no value")
                        .says("expected an expression"),
                });
                continue;
            };
            let twice = match label {
                None if takes_value(shape) => sorted.value.replace(value).is_some(),
                None => {
                    d.push(self.no_value(declaration, argument));
                    continue;
                }
                Some(label) => {
                    if let Some(form) = find_form(shape, label) {
                        sorted.law.replace((form, value)).is_some()
                    } else if let Some((.., stored)) = INITIALS.iter().find(|(name, of, _)| {
                        *name == label.name.text && *of == shape && !label.derivative
                    }) {
                        sorted.initial.replace((*stored, value)).is_some()
                    } else {
                        d.push(self.no_label(declaration, label));
                        continue;
                    }
                }
            };
            if twice {
                d.push(
                    Diagnostic::error(
                        "E0209",
                        *span,
                        format!("`{}` is told this twice", declaration.name.text),
                    )
                    .says("a second one")
                    .help(usage(shape)),
                );
            }
        }
        if let (Some(value), Some((form, law))) = (sorted.value, sorted.law) {
            d.push(
                Diagnostic::error(
                    "E0209",
                    value.span.join(law.span),
                    format!("`{}` has both a value and a law", declaration.name.text),
                )
                .says(format!("leave out the value or `{} = …`", form.label)),
            );
        }
        (d.len() == before).then_some(sorted)
    }

    fn no_value(&self, declaration: &Declaration<'_>, argument: &Argument) -> Diagnostic {
        let element = declaration.element;
        Diagnostic::error("E0209", argument.span, format!("{} has no arguments", a(element.noun)))
            .says("leave this out")
    }

    fn no_label(&self, declaration: &Declaration<'_>, label: &Label) -> Diagnostic {
        let shape = declaration.element.shape;
        let name = label.name.text.as_str();
        let written = if label.derivative { format!("der({name})") } else { name.to_string() };
        let error = Diagnostic::error(
            "E0209",
            label.span,
            format!("{} has no argument `{written}`", a(declaration.element.noun)),
        )
        .says("not one of its arguments")
        .help(usage(shape));
        let labels = FORMS
            .iter()
            .filter(|form| form.shape == shape && !form.derivative)
            .map(|form| form.label)
            .chain(INITIALS.iter().filter(|row| row.1 == shape).map(|row| row.0));
        match nearest(name, labels) {
            Some(meant) if name.len() > 1 => did_you_mean(error, label.span, name, meant),
            _ => error,
        }
    }
}

fn find_form(shape: Shape, label: &Label) -> Option<&'static Form> {
    FORMS.iter().find(|form| {
        form.shape == shape && form.derivative == label.derivative && form.label == label.name.text
    })
}

fn takes_value(shape: Shape) -> bool {
    !shape.is_junction() && !matches!(shape, Shape::EffortDetector | Shape::FlowDetector)
}

/// A value or ratio: a reciprocal of what varies becomes a gain, so that nothing ever divides by it.
fn modulus(value: Expr) -> Made {
    match *value.node {
        Node::Binary(Binary::Divide, n, d) if varies(&d) && !varies(&n) => {
            if n.as_number() == Some(1.0) {
                return Made::Gain(d);
            }
            Made::Gain(Tree::new(Node::Binary(Binary::Divide, d, n), value.span))
        }
        node => Made::Ratio(Tree::new(node, value.span)),
    }
}

/// What an element of a shape takes, in words.
fn usage(shape: Shape) -> &'static str {
    match shape {
        Shape::EffortSource | Shape::FlowSource => "a source takes its value alone",
        Shape::Dissipator => "a dissipator takes its resistance, or a law `e = …f…` or `f = …e…`",
        Shape::Compliance => {
            "a compliance takes its C, or a law `e = …q…`, `q = …e…` or `der(e) = …f…`; and `q0` or `e0`"
        }
        Shape::Inertia => {
            "an inertia takes its I, or a law `f = …p…`, `p = …f…` or `der(f) = …e…`; and `p0` or `f0`"
        }
        Shape::Transformer | Shape::Gyrator => "a two-port takes its ratio, or `gain = …`",
        _ => "junctions and detectors take no arguments",
    }
}

fn own_help(form: &Form) -> String {
    let read = "another element's variable is read with its name, as in `f(shaft)`";
    let own: Vec<String> = form.own.iter().map(|(name, _)| format!("`{name}`")).collect();
    if own.is_empty() {
        return read.to_string();
    }
    let left =
        if form.derivative { format!("der({})", form.label) } else { form.label.to_string() };
    format!("`{left} = …` speaks of {}; {read}", own.join(" and "))
}

fn value_help(shape: Shape, name: &str) -> String {
    match shape {
        Shape::Dissipator => {
            format!("write a law, `R:{name}(e = …f…)` or `R:{name}(f = …e…)`")
        }
        Shape::Compliance => {
            format!(
                "write a law, `C:{name}(e = …q…)`, `C:{name}(q = …e…)` or `C:{name}(der(e) = …f…)`"
            )
        }
        Shape::Inertia => {
            format!(
                "write a law, `I:{name}(f = …p…)`, `I:{name}(p = …f…)` or `I:{name}(der(f) = …e…)`"
            )
        }
        Shape::EffortSource => {
            format!(
                "a source that depends on its own flow is a dissipator: write `R:{name}(e = …f…)`"
            )
        }
        Shape::FlowSource => {
            format!(
                "a source that depends on its own effort is a dissipator: write `R:{name}(f = …e…)`"
            )
        }
        _ => "read a bond's variable with the port's name, as in `f(t.1)`".to_string(),
    }
}
