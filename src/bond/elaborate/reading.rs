//! Readings: e(x), f(x), q(x), p(x), power(x), and e(a -> b), f(a -> b), power(a -> b).

use super::fields;
use super::frames::{Found, FrameId, PortId, Thing};
use super::scope::{Scope, a};
use crate::bond::elements::Shape;
use crate::bond::graph::*;
use crate::bond::syntax::{Call, Part, Path, Value};
use crate::diagnostic::Diagnostic;
use crate::expr::{Binary, Expr as Tree, Node};
use crate::source::Span;

/// The names of readings.
pub const READINGS: [&str; 5] = ["e", "f", "q", "p", "power"];

/// Storages that a hint names at most.
const MOST_LISTED: usize = 8;

impl Scope<'_> {
    /// What a reading means.
    pub fn reading(&mut self, call: &Call, span: Span, d: &mut Vec<Diagnostic>) -> Option<Expr> {
        let argument = match call.rows.as_slice() {
            [row] if row.len() == 1 && row[0].label.is_none() => &row[0].value,
            _ => {
                d.push(self.form(call, span));
                return None;
            }
        };
        match argument {
            Value::Bond(from, to) => self.bond_reading(call, from, to, span, d),
            Value::Expr(expr) => match &*expr.node {
                Node::Leaf(crate::bond::syntax::Leaf::Name(path)) => {
                    self.element_reading(call, path, span, d)
                }
                _ => {
                    d.push(self.form(call, span));
                    None
                }
            },
            _ => {
                d.push(self.form(call, span));
                None
            }
        }
    }

    fn form(&self, call: &Call, span: Span) -> Diagnostic {
        let name = &call.name.text;
        Diagnostic::error("E0214", span, format!("`{name}(…)` reads an element or a bond"))
            .says("no name of one stands in the brackets")
            .help(format!(
                "write `{name}(shaft)` or `{name}(a -> b)`; a product needs a `*`, as in `{name}*(…)`"
            ))
    }

    fn element_reading(
        &mut self,
        call: &Call,
        path: &Path,
        span: Span,
        d: &mut Vec<Diagnostic>,
    ) -> Option<Expr> {
        let what = call.name.text.as_str();
        let found = self.resolve(path, d)?;
        let id = match found.thing {
            Thing::Vertex(id) => id,
            Thing::Port(port) => return self.port_reading(what, port, found.rest, span, d),
            Thing::Instance(frame) => {
                d.push(self.instance_reading(what, frame, span));
                return None;
            }
        };
        let port = self.port(id, found.rest, d)?;
        let declaration = self.declarations[id.index()];
        let shape = declaration.element.shape;
        let name = self.map.text(path.span);
        let name =
            if found.rest.is_empty() { name } else { name.rsplit_once('.').map_or(name, |n| n.0) };
        let noun = declaration.element.noun;
        let wrong = |message: String| {
            Diagnostic::error("E0214", span, message)
                .says("cannot be read")
                .label(declaration.span, format!("`{name}` is {}", a(noun)))
        };
        let field = fields::ports(&declaration);
        if port.is_none() && field.is_some_and(|ports| ports > 1) {
            let ports = fields::listed(name, field.unwrap_or(0));
            d.push(
                wrong(format!("`{name}` has {} ports, which one?", field.unwrap_or(0)))
                    .help(format!("its ports are {ports}")),
            );
            return None;
        }
        if matches!(what, "q" | "p") {
            let wanted = if what == "q" { Storage::Compliance } else { Storage::Inertia };
            let port = port.unwrap_or(0);
            if fields::storage(&declaration, port) == Some(wanted) {
                return Some(self.stored(End { vertex: id, port }, span));
            }
            let error = wrong(format!("{} stores no `{what}`", a(noun)));
            d.push(match shape {
                Shape::Compliance => error.help(format!("a compliance stores q: `q({name})`")),
                Shape::Inertia => error.help(format!("an inertia stores p: `p({name})`")),
                Shape::Mixed => error.help(
                    "a port of an IC field stores q where its law gives e, p where it gives f",
                ),
                _ => error.help(format!(
                    "integrate {} in a signal: `integ({}({name}))`",
                    if what == "q" { "the flow" } else { "the effort" },
                    if what == "q" { "f" } else { "e" },
                )),
            });
            return None;
        }
        if shape.is_junction() {
            let common = if shape == Shape::Zero { "e" } else { "f" };
            if what != common {
                let other = if what == "power" {
                    "power"
                } else {
                    if what == "e" { "effort" } else { "flow" }
                };
                let mut error =
                    wrong(format!("the bonds of the {noun} `{name}` have no common {other}"));
                let bonds = &self.graph.vertex(id).bonds;
                let listed: Vec<String> = bonds
                    .iter()
                    .map(|bond| format!("`{what}({})`", self.graph.bond_name(*bond)))
                    .collect();
                if !listed.is_empty() {
                    error = error.help(format!("read one of its bonds: {}", listed.join(", ")));
                }
                d.push(error);
                return None;
            }
        }
        if shape.is_two_port() && port.is_none() {
            d.push(
                wrong(format!("`{name}` has two ports, which one?"))
                    .help(format!("write `{what}({name}.1)` or `{what}({name}.2)`")),
            );
            return None;
        }
        let bonds = &self.graph.vertex(id).bonds;
        let bond = *match port {
            Some(port) => bonds.iter().find(|bond| {
                let bond = self.graph.bond(**bond);
                let end = End { vertex: id, port };
                bond.from == end || bond.to == end
            }),
            None => bonds.first(),
        }?;
        // Elements count into themselves; junctions, two-ports and sources along the half arrow.
        let into = !shape.is_junction()
            && !shape.is_two_port()
            && !matches!(shape, Shape::EffortSource | Shape::FlowSource);
        let own = End { vertex: id, port: port.unwrap_or(0) };
        let negated = into && self.graph.bond(bond).from == own;
        Some(variable(what, bond, negated, span))
    }

    /// A reading of a port: its bond's, along the half arrow that the model declares.
    fn port_reading(
        &self,
        what: &str,
        port: PortId,
        rest: &[Part],
        span: Span,
        d: &mut Vec<Diagnostic>,
    ) -> Option<Expr> {
        let port = &self.ports[port.0 as usize];
        if let Some(member) = rest.first() {
            d.push(
                Diagnostic::error(
                    "E0410",
                    member.span,
                    format!("`{}` is a port, and a port has no parts", port.name),
                )
                .says("no such part")
                .label(port.span, "the port"),
            );
            return None;
        }
        if matches!(what, "q" | "p") {
            d.push(
                Diagnostic::error("E0214", span, format!("a port stores no `{what}`"))
                    .says("cannot be read")
                    .label(port.span, "the port")
                    .help("of a port e, f and power can be read"),
            );
            return None;
        }
        Some(variable(what, port.bond?, false, span))
    }

    fn instance_reading(&self, what: &str, frame: FrameId, span: Span) -> Diagnostic {
        let inner = &self.frames[frame.0 as usize];
        let stored = matches!(what, "q" | "p");
        let ports: Vec<String> = inner
            .ports
            .iter()
            .filter(|_| !stored)
            .map(|port| format!("`{what}({})`", self.ports[port.0 as usize].name))
            .collect();
        let error = Diagnostic::error(
            "E0214",
            span,
            format!("`{}` is an instance of a model", inner.prefix.trim_end_matches('.')),
        )
        .says("cannot be read as a whole")
        .label(inner.span, "declared here");
        if stored {
            let kind = if what == "q" { Shape::Compliance } else { Shape::Inertia };
            let mut stores: Vec<String> = inner
                .things
                .values()
                .filter_map(|thing| match thing {
                    Thing::Vertex(id) if self.declarations[id.index()].element.shape == kind => {
                        Some(format!("`{what}({})`", self.shown(*id)))
                    }
                    _ => None,
                })
                .collect();
            stores.sort_unstable();
            stores.truncate(MOST_LISTED);
            let noun = if what == "q" { "compliance" } else { "inertia" };
            return error.help(match stores.is_empty() {
                true => format!("`{what}` is read of {}", a(noun)),
                false => format!("read {} in it: {}", a(noun), stores.join(", ")),
            });
        }
        match ports.is_empty() {
            true => error.help(format!("read an element in it: `{what}({}…)`", inner.prefix)),
            false => {
                error.help(format!("read a port of it, {}, or an element in it", ports.join(", ")))
            }
        }
    }

    /// q of a compliance, p of an inertia. In rate form the charge is counted from the start, on top of what is given.
    fn stored(&self, end: End, span: Span) -> Expr {
        Tree::new(Node::Leaf(Leaf::Stored(end)), span)
    }

    fn bond_reading(
        &mut self,
        call: &Call,
        from: &Path,
        to: &Path,
        span: Span,
        d: &mut Vec<Diagnostic>,
    ) -> Option<Expr> {
        let (a, b) = (self.resolve(from, d), self.resolve(to, d));
        let (a, b) = (a?, b?);
        let mut side = |found: Found<'_>| match found.thing {
            Thing::Vertex(id) => self.port(id, found.rest, d),
            _ => Some(None),
        };
        let (from_port, to_port) = (side(a)?, side(b)?);
        let what = call.name.text.as_str();
        if matches!(what, "q" | "p") {
            d.push(
                Diagnostic::error("E0214", span, format!("a bond stores no `{what}`"))
                    .says("cannot be read")
                    .help("read the storage: `q(name)` of a compliance, `p(name)` of an inertia"),
            );
            return None;
        }
        let joins = |x: Thing, x_port: Option<u32>, y: Thing, y_port: Option<u32>| -> Vec<BondId> {
            let fits = |bond: &&BondId| {
                let bond = self.graph.bond(**bond);
                x_port.is_none_or(|port| bond.from.port == port)
                    && y_port.is_none_or(|port| bond.to.port == port)
            };
            self.bonds_between(x, y).iter().filter(fits).copied().collect()
        };
        let found = joins(a.thing, from_port, b.thing, to_port);
        let written = format!("{} -> {}", self.map.text(from.span), self.map.text(to.span));
        let missing = |message: String| Diagnostic::error("E0215", span, message);
        match (found.as_slice(), &call.index) {
            ([bond], None) => Some(variable(what, *bond, false, span)),
            ([], _) => {
                let error = |message: String| missing(message).says("no such bond");
                let reversed = !joins(b.thing, to_port, a.thing, from_port).is_empty();
                d.push(if reversed {
                    let turned =
                        format!("{} -> {}", self.map.text(to.span), self.map.text(from.span));
                    error(format!("there is no bond `{written}`, only `{turned}`"))
                        .help(format!(
                            "its half arrow points the other way: write `{what}({turned})`"
                        ))
                        .fix("turn it round", vec![(from.span.join(to.span), turned)])
                } else {
                    error(format!("there is no bond `{written}`"))
                });
                None
            }
            (several, Some(index)) => {
                let number = index.constant().filter(|k| *k >= 1.0 && k.fract() == 0.0);
                let bond = number.and_then(|k| several.get(k as usize - 1));
                if bond.is_none() {
                    d.push(
                        Diagnostic::error(
                            "E0215",
                            index.span,
                            format!("there is no such bond among the {}", several.len()),
                        )
                        .says("counted from 1"),
                    );
                }
                bond.map(|bond| variable(what, *bond, false, span))
            }
            (several, None) => {
                d.push(
                    missing(format!("{} bonds are `{written}`", several.len()))
                        .says("which one?")
                        .help(format!(
                            "count them in the order of the file: `{what}({written})[1]`"
                        )),
                );
                None
            }
        }
    }
}

/// A reading of a bond: e, f or power.
pub(super) fn variable(what: &str, bond: BondId, negated: bool, span: Span) -> Expr {
    let effort = Leaf::Bond { bond, variable: Power::Effort, negated: false };
    let flow = Leaf::Bond { bond, variable: Power::Flow, negated };
    let leaf = |leaf| Tree::new(Node::Leaf(leaf), span);
    match what {
        "e" => leaf(effort),
        "f" => leaf(flow),
        _ => Tree::new(Node::Binary(Binary::Multiply, leaf(effort), leaf(flow)), span),
    }
}
