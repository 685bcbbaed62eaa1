//! Fields: R, C and I with a matrix, and C, I, IC and R with a law for each port.
//!
//! `I:coils([L1, M; M, L2], p0 = [0, 0])` has a row and a column for each port: p = I·f, q = C·e, e = R·f.
//! `C:plate(e1 = …q1…q2…, e2 = …, q1_0 = 0)` has a law for each port, over what all ports store; a port of an IC field
//! stores q where its law gives e, p where it gives f. A law of an R field gives e or f of its port, over f of the ports
//! whose laws give e and e of the others. Initial values of a matrix are lists, `q0` or `e0`, `p0` or `f0`; those of
//! numbered laws are numbered, `q1_0` or `e1_0`. Ports are `coils.1`, `coils.2`; all count into the field.

use super::scope::{Declaration, Scope, a};
use super::value::{Own, Place};
use crate::bond::elements::Shape;
use crate::bond::fields::{MOST_PORTS, combination};
use crate::bond::graph::*;
use crate::bond::syntax::{self, Argument, Label, Value};
use crate::diagnostic::Diagnostic;
use crate::expr::Expr as Tree;
use crate::quantity::{did_you_mean, nearest};
use crate::source::Span;

/// `e2` as (`e`, 2): a variable of a port. Bare letters and `e0` are none.
pub(super) fn numbered(name: &str) -> Option<(char, usize)> {
    let letter = name.chars().next().filter(|letter| "efqp".contains(*letter))?;
    let digits = &name[1..];
    let plain = digits.bytes().all(|b| b.is_ascii_digit()) && !digits.starts_with('0');
    if plain && !digits.is_empty() { Some((letter, digits.parse().ok()?)) } else { None }
}

/// `q2_0` as (`q`, 2): the initial value of a port.
fn numbered_initial(name: &str) -> Option<(char, usize)> {
    numbered(name.strip_suffix("_0")?)
}

fn numbered_label(label: &Label) -> Option<(char, usize)> {
    numbered(&label.name.text)
}

/// How many ports a declared field has; `None` for what is no field. 0 when nothing says.
pub(super) fn ports(declaration: &Declaration<'_>) -> Option<usize> {
    let shape = declaration.element.shape;
    if !matches!(shape, Shape::Dissipator | Shape::Compliance | Shape::Inertia | Shape::Mixed) {
        return None;
    }
    let mut count = None;
    for argument in declaration.arguments.unwrap_or_default() {
        let found = match (&argument.label, &argument.value) {
            (None, Value::Matrix(rows)) => Some(rows.len()),
            (Some(label), _) => numbered_label(label).map(|(_, port)| port),
            _ => None,
        };
        count = count.max(found);
    }
    match shape {
        Shape::Mixed => Some(count.unwrap_or(0)),
        _ => count,
    }
    .map(|count| count.min(MOST_PORTS))
}

/// What a port of an element stores.
pub(super) fn storage(declaration: &Declaration<'_>, port: u32) -> Option<Storage> {
    match declaration.element.shape {
        Shape::Compliance => Some(Storage::Compliance),
        Shape::Inertia => Some(Storage::Inertia),
        Shape::Mixed => {
            let arguments = declaration.arguments.unwrap_or_default().iter();
            let mut laws =
                arguments.filter_map(|argument| numbered_label(argument.label.as_ref()?));
            match laws.find(|law| law.1 == port as usize + 1)?.0 {
                'e' => Some(Storage::Compliance),
                'f' => Some(Storage::Inertia),
                _ => None,
            }
        }
        _ => None,
    }
}

/// `` `coils.1`, `coils.2` `` and so on.
pub(super) fn listed(name: &str, count: usize) -> String {
    const MOST: usize = 4;
    let ports: Vec<String> = (1..=count).map(|port| format!("`{name}.{port}`")).collect();
    match ports.as_slice() {
        [first, .., last] if count > MOST => format!("{first} to {last}"),
        [some @ .., last] if !some.is_empty() => format!("{} and {last}", some.join(", ")),
        ports => ports.join(""),
    }
}

/// The arguments of a field, sorted.
struct Sorted<'a> {
    matrix: Option<(&'a [Vec<syntax::Expr>], Span)>,
    /// By port: what its law gives, the law, and where all of it stands.
    laws: Vec<Option<(char, &'a syntax::Expr, Span)>>,
    /// By port: the letter of its initial value, and the value.
    initial: Vec<Option<(char, &'a syntax::Expr)>>,
}

/// What a port of a field is.
#[derive(Clone, Copy, PartialEq)]
enum Port {
    /// Its law gives this.
    Dissipates(Power),
    Stores(Storage),
}

impl Scope<'_> {
    /// The law of a field. Its bonds have been joined; where one is missing that has been said.
    pub fn field_law(
        &mut self,
        id: VertexId,
        declaration: &Declaration<'_>,
        name: &str,
        count: usize,
        d: &mut Vec<Diagnostic>,
    ) -> Option<Law> {
        let sorted = sort(declaration, name, count, d)?;
        let ports: Vec<Port> = (0..count)
            .map(|port| kind(declaration, port, sorted.laws[port].map(|law| law.0)))
            .collect();
        let initial = self.field_initial(&sorted, d);
        let statement = declaration.statement;
        let joined = self.graph.vertex(id).bonds.len() == count;
        let leaf = |port: usize, letter: char| match joined {
            true => self.own_leaf(End { vertex: id, port: port as u32 }, letter),
            // Names can be looked up nevertheless.
            false => Some(Leaf::Time),
        };
        let argument = |port: usize| match ports[port] {
            Port::Dissipates(Power::Effort) => 'f',
            Port::Dissipates(Power::Flow) => 'e',
            Port::Stores(Storage::Compliance) => 'q',
            Port::Stores(Storage::Inertia) => 'p',
        };
        if let Some((rows, _)) = sorted.matrix {
            // p = I·f, q = C·e, e = R·f.
            let over = if ports.contains(&Port::Stores(Storage::Compliance)) { 'e' } else { 'f' };
            let variables: Option<Vec<Expr>> =
                (0..count).map(|port| leaf(port, over).map(Tree::leaf)).collect();
            let help = "the entries of a matrix may speak of parameters, signals and readings; write numbered laws, as in `e1 = …`, over the field's own variables";
            let mut entries = vec![];
            for row in rows {
                let row: Vec<Option<Expr>> = row
                    .iter()
                    .map(|entry| self.lower(entry, Place::law(&[], help, name, statement), d))
                    .collect();
                entries.push(row.into_iter().collect::<Option<Vec<Expr>>>());
            }
            let entries: Vec<Vec<Expr>> = entries.into_iter().collect::<Option<_>>()?;
            let (variables, initial) = (variables?, initial?);
            let laws = entries.iter().zip(&ports).zip(initial).map(|((row, port), initial)| {
                let law = combination(row, &variables);
                match port {
                    Port::Dissipates(_) => Law::Dissipator(Dissipation::Effort(law)),
                    Port::Stores(kind) => {
                        Law::Store { kind: *kind, law: StoreLaw::OfPower(law), initial }
                    }
                }
            });
            let laws = laws.collect();
            return joined.then_some(Law::Field(Field { ports: laws, matrix: Some(entries) }));
        }
        let names: Vec<String> =
            (0..count).map(|port| format!("{}{}", argument(port), port + 1)).collect();
        let leaves: Option<Vec<Leaf>> = (0..count).map(|port| leaf(port, argument(port))).collect();
        let own: Vec<Own<'_>> = names.iter().map(String::as_str).zip(leaves?).collect();
        let quoted: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
        let help = format!("the laws of `{name}` speak of {}", quoted.join(", "));
        let mut laws = vec![];
        for (_, law, _) in sorted.laws.iter().flatten() {
            laws.push(self.lower(law, Place::law(&own, &help, name, statement), d));
        }
        let laws: Vec<Expr> = laws.into_iter().collect::<Option<_>>()?;
        let laws =
            laws.into_iter().zip(&ports).zip(initial?).map(|((law, port), initial)| match port {
                Port::Dissipates(Power::Effort) => Law::Dissipator(Dissipation::Effort(law)),
                Port::Dissipates(Power::Flow) => Law::Dissipator(Dissipation::Flow(law)),
                Port::Stores(kind) => {
                    Law::Store { kind: *kind, law: StoreLaw::OfStored(law), initial }
                }
            });
        let laws = laws.collect();
        joined.then_some(Law::Field(Field { ports: laws, matrix: None }))
    }

    /// A field's own variable at a port.
    fn own_leaf(&self, end: End, letter: char) -> Option<Leaf> {
        let bond = self.graph.bond_at(end)?;
        Some(match letter {
            'e' => Leaf::Bond { bond, variable: Power::Effort, negated: false },
            'f' => {
                let negated = self.graph.bond(bond).from == end;
                Leaf::Bond { bond, variable: Power::Flow, negated }
            }
            _ => Leaf::Stored(end),
        })
    }

    fn field_initial(
        &mut self,
        sorted: &Sorted<'_>,
        d: &mut Vec<Diagnostic>,
    ) -> Option<Vec<StoreInitial>> {
        let mut initial = vec![];
        for stated in &sorted.initial {
            initial.push(match stated {
                None => Some(StoreInitial::Unstated),
                Some((letter, value)) => {
                    let lowered = self.lower(value, Place::constant("an initial value"), d);
                    if let Some(lowered) = &lowered {
                        // Only for the message: the value is used where all initial values are solved.
                        self.evaluate(lowered, "the initial value", value.span, d);
                    }
                    lowered.map(|value| match letter {
                        'q' | 'p' => StoreInitial::Stored(value),
                        _ => StoreInitial::Power(value),
                    })
                }
            });
        }
        initial.into_iter().collect()
    }
}

/// What a port is: by the element, and where that leaves a choice by what its law gives.
fn kind(declaration: &Declaration<'_>, port: usize, gives: Option<char>) -> Port {
    match storage(declaration, port as u32) {
        Some(storage) => Port::Stores(storage),
        None if gives == Some('f') => Port::Dissipates(Power::Flow),
        None => Port::Dissipates(Power::Effort),
    }
}

/// Sorts the arguments; `None` when they make no field.
fn sort<'a>(
    declaration: &Declaration<'a>,
    name: &str,
    count: usize,
    d: &mut Vec<Diagnostic>,
) -> Option<Sorted<'a>> {
    let before = d.len();
    let shape = declaration.element.shape;
    let mut sorted = Sorted { matrix: None, laws: vec![None; count], initial: vec![None; count] };
    let arguments = declaration.arguments.unwrap_or_default();
    let twice = |span: Span| {
        Diagnostic::error("E0209", span, format!("the field `{name}` is told this twice"))
            .says("a second one")
            .help("leave one of them out")
    };
    // The matrix or the laws first: which initial values there are follows from them.
    for argument in arguments {
        let Argument { label, value, span } = argument;
        match (label, value) {
            (None, Value::Matrix(rows)) => {
                if sorted.matrix.replace((rows, *span)).is_some() {
                    d.push(twice(*span));
                }
            }
            (Some(label), value) => {
                let Some((letter, port)) = numbered_label(label) else { continue };
                let Value::Expr(law) = value else {
                    d.push(
                        Diagnostic::error("E0209", *span, "the law of a port is an expression")
                            .says("not one")
                            .help(usage(shape)),
                    );
                    continue;
                };
                if let Some(error) = wrong_law(declaration, label, letter, port) {
                    d.push(error);
                    continue;
                }
                if let Some((.., first)) = sorted.laws[port - 1].replace((letter, law, *span)) {
                    d.push(
                        Diagnostic::error(
                            "E0209",
                            *span,
                            format!("port {port} of the field `{name}` has two laws"),
                        )
                        .says("the second one")
                        .label(first, "the first one")
                        .help("each port has one law"),
                    );
                }
            }
            (None, Value::Expr(_)) => d.push(
                Diagnostic::error("E0209", *span, format!("the field `{name}` takes no value"))
                    .says("of which port?")
                    .help(usage(shape)),
            ),
            _ => d.push(
                Diagnostic::error("E0209", *span, "a text is no value")
                    .says("expected an expression"),
            ),
        }
    }
    if d.len() > before {
        return None;
    }
    if let (Some((_, span)), Some((.., law))) = (sorted.matrix, sorted.laws.iter().flatten().next())
    {
        d.push(
            Diagnostic::error("E0209", span, format!("the field `{name}` has a matrix and laws"))
                .says("the matrix")
                .label(*law, "a law")
                .help("keep one of them: a matrix is short for linear laws of all ports"),
        );
    } else if let Some((rows, span)) = sorted.matrix {
        check_shape(declaration, name, rows, span, d);
    } else if count == 0 {
        d.push(
            Diagnostic::error("E0209", declaration.span, format!("the field `{name}` has no laws"))
                .says("nothing says what its ports are")
                .help(usage(shape)),
        );
    } else {
        let missing: Vec<usize> = (0..count).filter(|k| sorted.laws[*k].is_none()).collect();
        for port in missing {
            d.push(
                Diagnostic::error(
                    "E0209",
                    declaration.span,
                    format!("port {} of the field `{name}` has no law", port + 1),
                )
                .says(format!("the laws go up to port {count}"))
                .help(usage(shape)),
            );
        }
    }
    if d.len() == before {
        for argument in arguments {
            initial_value(declaration, name, argument, &mut sorted, d);
        }
    }
    (d.len() == before).then_some(sorted)
}

/// Why a law cannot be one of this field.
fn wrong_law(
    declaration: &Declaration<'_>,
    label: &Label,
    letter: char,
    port: usize,
) -> Option<Diagnostic> {
    let shape = declaration.element.shape;
    let (text, noun) = (label.name.text.as_str(), declaration.element.noun);
    if port > MOST_PORTS {
        return Some(
            Diagnostic::error(
                "E0209",
                label.span,
                format!("a field has at most {MOST_PORTS} ports"),
            )
            .says(format!("this is port {port}"))
            .help("split it into smaller fields"),
        );
    }
    if label.derivative {
        return Some(
            Diagnostic::error("E0209", label.span, "a field has no rate form")
                .says("a derivative")
                .help(usage(shape)),
        );
    }
    let gives = match shape {
        Shape::Compliance => "e",
        Shape::Inertia => "f",
        _ => "ef",
    };
    if gives.contains(letter) {
        return None;
    }
    let error = Diagnostic::error(
        "E0209",
        label.span,
        format!("no law of a field gives `{text}` of {}", a(noun)),
    )
    .says("cannot stand before `=`");
    Some(error.help(usage(shape)))
}

/// A matrix has as many rows as columns, one for each port.
fn check_shape(
    declaration: &Declaration<'_>,
    name: &str,
    rows: &[Vec<syntax::Expr>],
    span: Span,
    d: &mut Vec<Diagnostic>,
) {
    let shape = declaration.element.shape;
    if shape == Shape::Mixed {
        d.push(
            Diagnostic::error("E0209", span, "an IC field takes laws, not a matrix")
                .says("which of its ports store q, and which p?")
                .help(usage(shape)),
        );
    } else if rows.len() > MOST_PORTS {
        d.push(
            Diagnostic::error("E0209", span, format!("a field has at most {MOST_PORTS} ports"))
                .says(format!("this matrix has {} rows", rows.len()))
                .help("split it into smaller fields"),
        );
    } else if let Some(row) = rows.iter().position(|row| row.len() != rows.len()) {
        let numbers = |count: usize, what: &str| {
            format!("{count} {what}{}", if count == 1 { "" } else { "s" })
        };
        let message = format!("the matrix of `{name}` is not square");
        let says = format!(
            "{}, but row {} has {}",
            numbers(rows.len(), "row"),
            row + 1,
            numbers(rows[row].len(), "entry").replace("entrys", "entries")
        );
        d.push(
            Diagnostic::error("E0209", span, message)
                .says(says)
                .help("one row and one column for each port, as in `[L1, M; M, L2]`"),
        );
    }
}

/// Takes in an initial value.
fn initial_value<'a>(
    declaration: &Declaration<'a>,
    name: &str,
    argument: &'a Argument,
    sorted: &mut Sorted<'a>,
    d: &mut Vec<Diagnostic>,
) {
    let Argument { label: Some(label), value, span } = argument else { return };
    let text = label.name.text.as_str();
    if numbered_label(label).is_some() {
        return;
    }
    let shape = declaration.element.shape;
    let count = sorted.initial.len();
    // Of which letters the initial values of a port are.
    let letters = |port: usize| match storage(declaration, port as u32) {
        Some(Storage::Compliance) => "qe",
        Some(Storage::Inertia) => "pf",
        None => "",
    };
    let list = ["q0", "e0", "p0", "f0"].contains(&text) && !label.derivative;
    let known: Vec<String> = match sorted.matrix {
        Some(_) => letters(0).chars().map(|letter| format!("{letter}0")).collect(),
        None => (0..count)
            .flat_map(|port| letters(port).chars().map(move |l| format!("{l}{}_0", port + 1)))
            .collect(),
    };
    if list && sorted.matrix.is_none() && !known.is_empty() {
        d.push(
            Diagnostic::error(
                "E0209",
                label.span,
                format!("the initial values of `{name}` are given port by port"),
            )
            .says("a list goes with a matrix")
            .help(format!("write `{} = …`", known[0])),
        );
        return;
    }
    if !known.iter().any(|known| known == text) || label.derivative {
        let written = if label.derivative { format!("der({text})") } else { text.to_string() };
        let error = Diagnostic::error(
            "E0209",
            label.span,
            format!("the field `{name}` has no argument `{written}`"),
        )
        .says("not one of its arguments");
        d.push(match nearest(text, known.iter().map(String::as_str)) {
            Some(meant) if !label.derivative => did_you_mean(error, label.span, text, meant),
            _ => error.help(usage(shape)),
        });
        return;
    }
    let twice = |d: &mut Vec<Diagnostic>| {
        d.push(
            Diagnostic::error("E0209", *span, format!("`{name}` has two initial values at a port"))
                .says("the second one")
                .help("state what is stored, or the effort or flow, not both"),
        );
    };
    let Some((letter, port)) = numbered_initial(text) else {
        let letter = text.chars().next().unwrap_or('q');
        let values: Vec<&syntax::Expr> = match value {
            Value::Matrix(rows) if rows.len() == 1 => rows[0].iter().collect(),
            Value::Expr(value) if count == 1 => vec![value],
            _ => vec![],
        };
        if values.len() != count {
            d.push(
                Diagnostic::error(
                    "E0209",
                    *span,
                    format!("`{text}` of the field `{name}` is a list of {count} values"),
                )
                .says("not such a list")
                .help(format!(
                    "one value for each port, as in `{text} = [{}]`",
                    vec!["0"; count].join(", ")
                )),
            );
            return;
        }
        for (slot, value) in sorted.initial.iter_mut().zip(values) {
            if slot.replace((letter, value)).is_some() {
                twice(d);
                return;
            }
        }
        return;
    };
    let Value::Expr(value) = value else {
        d.push(
            Diagnostic::error("E0209", *span, format!("`{text}` is one value"))
                .says("not one")
                .help("each port has an initial value of its own"),
        );
        return;
    };
    if sorted.initial[port - 1].replace((letter, value)).is_some() {
        twice(d);
    }
}

/// What a field takes, in words.
fn usage(shape: Shape) -> &'static str {
    match shape {
        Shape::Dissipator => {
            "an R field takes a matrix, e = R·f, or a law for each port, `e1 = …f1, f2…` or `f1 = …e1…`"
        }
        Shape::Compliance => {
            "a C field takes a matrix, q = C·e, and `q0` or `e0`; or a law for each port, `e1 = …q1, q2…`, and `q1_0` or `e1_0`"
        }
        Shape::Inertia => {
            "an I field takes a matrix, p = I·f, and `p0` or `f0`; or a law for each port, `f1 = …p1, p2…`, and `p1_0` or `f1_0`"
        }
        _ => {
            "an IC field takes a law for each port, over what all ports store: `f1 = …p1, q2…, e2 = …p1, q2…`; and `p1_0`, `q2_0`"
        }
    }
}
