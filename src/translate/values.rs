//! Expressions of the bond graph as expressions of the circuit.

use super::Builder;
use super::flows::{Carrier, Origin, Reader};
use super::forms::{Form, SourceValue, form_at};
use super::series_parallel::Point;
use super::signals::Place;
use crate::bond::graph::{self, BondId, End, Law, Leaf, Power, StoreLaw, Variable, VertexId};
use crate::diagnostic::Diagnostic;
use crate::expr::{Binary, Node, Unary};
use crate::netlist::{self, Expr, Name};
use crate::source::Span;

/// Who speaks: what may be named differs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Speaker {
    /// A card: flows are currents of voltage sources.
    Card(Reader),
    /// An output column: any current that a simulator gives, and laws written out.
    Output,
}

/// −x, without double signs.
pub fn negate(expr: Expr) -> Expr {
    match *expr.node {
        Node::Unary(Unary::Negate, inner) => inner,
        Node::Number(value) => Expr::new(Node::Number(-value), expr.span),
        node => Expr::new(node, expr.span).negate(),
    }
}

/// x or −x.
pub fn signed(expr: Expr, negative: bool) -> Expr {
    if negative { negate(expr) } else { expr }
}

/// Sum of terms, as `a - b + c`.
pub fn sum(terms: impl IntoIterator<Item = Expr>) -> Expr {
    let mut total: Option<Expr> = None;
    for term in terms {
        total = Some(match (total, *term.node) {
            (None, node) => Expr::new(node, term.span),
            (Some(sum), Node::Unary(Unary::Negate, inner)) => sum.binary(Binary::Subtract, inner),
            (Some(sum), node) => sum.binary(Binary::Add, Expr::new(node, term.span)),
        });
    }
    total.unwrap_or_else(|| Expr::number(0.0))
}

/// Product of two, with signs drawn to the front and factors of 1 left out.
pub fn product(a: Expr, b: Expr) -> Expr {
    let (a, a_negative) = unsigned(a);
    let (b, b_negative) = unsigned(b);
    let product = match (a.as_number(), b.as_number()) {
        (Some(1.0), _) => b,
        (_, Some(1.0)) => a,
        _ => a.binary(Binary::Multiply, b),
    };
    signed(product, a_negative ^ b_negative)
}

fn unsigned(expr: Expr) -> (Expr, bool) {
    match *expr.node {
        Node::Unary(Unary::Negate, inner) => (inner, true),
        node => (Expr::new(node, expr.span), false),
    }
}

/// Signs drawn together, so that −(−a), a − (−b) and (−a)·b, which come of the directions in which currents are read,
/// do not stand in the text. Values stay the same to the last bit.
pub fn tidy(expr: Expr) -> Expr {
    let (expr, negative) = tidied(expr);
    signed(expr, negative)
}

/// An expression and whether its negative is meant.
fn tidied(expr: Expr) -> (Expr, bool) {
    let span = expr.span;
    let at = |node| Expr::new(node, span);
    match *expr.node {
        Node::Unary(Unary::Negate, a) => {
            let (a, negative) = tidied(a);
            (a, !negative)
        }
        Node::Binary(op @ (Binary::Multiply | Binary::Divide), a, b) => {
            let ((a, a_negative), (b, b_negative)) = (tidied(a), tidied(b));
            (at(Node::Binary(op, a, b)), a_negative ^ b_negative)
        }
        Node::Binary(op @ (Binary::Add | Binary::Subtract), a, b) => {
            let ((a, a_negative), (b, b_negative)) = (tidied(a), tidied(b));
            match (a_negative, b_negative ^ (op == Binary::Subtract)) {
                (false, false) => (at(Node::Binary(Binary::Add, a, b)), false),
                (false, true) => (at(Node::Binary(Binary::Subtract, a, b)), false),
                (true, false) => (at(Node::Binary(Binary::Subtract, b, a)), false),
                (true, true) => (at(Node::Binary(Binary::Add, a, b)), true),
            }
        }
        Node::Unary(op, a) => (at(Node::Unary(op, tidy(a))), false),
        Node::Binary(op, a, b) => (at(Node::Binary(op, tidy(a), tidy(b))), false),
        Node::Call(function, arguments) => {
            (at(Node::Call(function, arguments.into_iter().map(tidy).collect())), false)
        }
        Node::If(c, a, b) => (at(Node::choice(tidy(c), tidy(*a), tidy(*b))), false),
        Node::Table(a, table) => (at(Node::Table(tidy(a), table)), false),
        Node::Number(value) if value < 0.0 => (at(Node::Number(-value)), true),
        node @ (Node::Number(_) | Node::Leaf(_)) => (at(node), false),
    }
}

impl Builder<'_> {
    /// v(+) − v(−), with ground left out.
    pub fn voltage(&self, [plus, minus]: [Name; 2]) -> Expr {
        let ground = self.ground();
        if plus == minus {
            Expr::number(0.0)
        } else if plus == ground {
            Expr::leaf(netlist::Leaf::Voltage(minus, None)).negate()
        } else {
            let minus = (minus != ground).then_some(minus);
            Expr::leaf(netlist::Leaf::Voltage(plus, minus))
        }
    }

    /// The current of a voltage source as a flow.
    pub fn current(&self, carrier: Carrier) -> Expr {
        signed(Expr::leaf(netlist::Leaf::Current(carrier.device)), carrier.negated)
    }

    /// The effort of a bond.
    pub fn effort(&self, bond: BondId) -> Option<Expr> {
        let [from, to] = self.drawing.ends[bond.index()];
        // The node that bears the junction's name, where a 0 V source makes two of it.
        let zero = |vertex| matches!(self.graph.vertex(vertex).law, graph::Law::Zero);
        let pair = if zero(self.graph.bond(bond).to.vertex) { to } else { from };
        match pair.or(from).or(to) {
            Some(pair) => Some(self.voltage(self.nodes(pair))),
            None => Some(self.voltage_sum(self.drawing.sums.get(&bond)?)),
        }
    }

    /// A sum of node voltages.
    fn voltage_sum(&self, terms: &[(Point, f64)]) -> Expr {
        let terms = terms.iter().filter(|(point, _)| self.node(*point) != self.ground());
        sum(terms.map(|(point, by)| {
            let voltage = self.voltage([self.node(*point), self.ground()]);
            signed(product(Expr::number(by.abs()), voltage), *by < 0.0)
        }))
    }

    /// An expression in terms of the circuit; `own` is the element whose law it is.
    pub fn value(
        &self,
        expr: &graph::Expr,
        own: Option<VertexId>,
        speaker: Speaker,
    ) -> Result<Expr, Unreadable> {
        expr.try_map(&mut |leaf, span| self.leaf(leaf, span, own, speaker)).map(tidy)
    }

    /// An expression of parameters.
    pub fn constant(&self, expr: &graph::Expr) -> Expr {
        expr.map(&mut |leaf, span| match leaf {
            Leaf::Parameter(id) => {
                Expr::new(Node::Leaf(netlist::Leaf::Parameter(self.parameters[id.index()])), span)
            }
            _ => Expr::number(f64::NAN),
        })
    }

    fn leaf(
        &self,
        leaf: &Leaf,
        span: Span,
        own: Option<VertexId>,
        speaker: Speaker,
    ) -> Result<Expr, Unreadable> {
        let at = |found: Option<Expr>| {
            found.map(|expr| Expr { span, ..expr }).ok_or(Unreadable { span, own })
        };
        match leaf {
            Leaf::Parameter(id) => {
                at(Some(Expr::leaf(netlist::Leaf::Parameter(self.parameters[id.index()]))))
            }
            Leaf::Signal(id) => at(self.signal(self.signal_places[id.index()])),
            Leaf::Time => at(Some(Expr::leaf(netlist::Leaf::Time))),
            Leaf::Own(variable) => at(own.map(End::only).and_then(|end| match variable {
                Variable::Power(power) => self.own_power(end, *power, speaker),
                Variable::Stored => self.stored(end, speaker),
            })),
            Leaf::Bond { bond, variable, negated } => {
                let value = match variable {
                    Power::Effort => self.effort(*bond),
                    Power::Flow => self.flow(*bond, speaker),
                };
                at(value.map(|value| signed(value, *negated)))
            }
            Leaf::Stored(end) => at(self.stored(*end, speaker)),
        }
    }

    /// The value of a signal.
    pub fn signal(&self, place: Place) -> Option<Expr> {
        match place {
            Place::Node(node) => Some(self.voltage([node, self.ground()])),
            // A source of flow carries it, and has no name for its own current.
            Place::Source(vertex) => match self.graph.vertex(vertex).law {
                graph::Law::Source { sets: Power::Flow, .. } => None,
                _ => self.port(vertex, 0).map(|nodes| self.voltage(nodes)),
            },
        }
    }

    /// The effort at an element's port, or the flow counted into it there.
    pub fn own_power(&self, end: End, power: Power, speaker: Speaker) -> Option<Expr> {
        let bond = self.graph.bond_at(end)?;
        match power {
            Power::Effort => Some(self.voltage(self.port(end.vertex, end.port as usize)?)),
            Power::Flow => self.inflow(end.vertex, end.port, bond, speaker),
        }
    }

    /// The flow into an element's port.
    pub fn inflow(
        &self,
        vertex: VertexId,
        port: u32,
        bond: BondId,
        speaker: Speaker,
    ) -> Option<Expr> {
        let outward = self.graph.sign_into(bond, vertex, port) < 0.0;
        Some(signed(self.flow(bond, speaker)?, outward))
    }

    /// q of a compliance, p of an inertia, at its port.
    pub fn stored(&self, end: End, speaker: Speaker) -> Option<Expr> {
        let integral = |node| self.voltage([node, self.ground()]);
        let vertex = end.vertex;
        match form_at(&self.forms, end) {
            Form::Capacitor { value, .. } => {
                let effort = self.own_power(end, Power::Effort, speaker)?;
                Some(product(self.constant(value), effort))
            }
            Form::Inductor { value, .. } => match self.graph.law_at(end) {
                // Of coupled inductors each has a part in the other's flux.
                Law::Store { law: StoreLaw::OfPower(law), .. } => {
                    self.value(law, None, speaker).ok()
                }
                _ => {
                    let flow = self.own_power(end, Power::Flow, speaker)?;
                    Some(product(self.constant(value), flow))
                }
            },
            Form::StoredEffort { state, .. }
            | Form::StoredFlow { state, .. }
            | Form::ChargeLaw { state, .. }
            | Form::FluxLaw { state, .. } => Some(integral(state.node)),
            Form::RateEffort { .. } | Form::RateFlow { .. } => {
                self.counters[vertex.index()].map(|counter| integral(counter.node))
            }
            _ => None,
        }
    }

    /// The flow of a bond along its half arrow.
    pub fn flow(&self, bond: BondId, speaker: Speaker) -> Option<Expr> {
        match speaker {
            Speaker::Card(reader) => match self.flows.carrier(bond, reader) {
                Some(carrier) => Some(self.current(carrier)),
                None => {
                    let (vertex, of, negative) = self.flows.ohm(bond)?;
                    Some(signed(self.ohm(vertex, of)?, negative))
                }
            },
            Speaker::Output => {
                let (of, origin, negative) = self.flows.origin(bond)?;
                Some(signed(self.told(of, origin)?, negative))
            }
        }
    }

    /// Effort over resistance, along the half arrow of the dissipator's bond.
    fn ohm(&self, vertex: VertexId, bond: BondId) -> Option<Expr> {
        let Form::Resistor { value, .. } = &self.forms[vertex.index()] else { return None };
        let effort = self.own_power(End::only(vertex), Power::Effort, Speaker::Output)?;
        let (effort, negative) = unsigned(effort);
        let flow = effort.binary(Binary::Divide, self.constant(value));
        let outward = self.graph.sign_into(bond, vertex, 0) < 0.0;
        Some(signed(flow, negative ^ outward))
    }

    /// The flow of the bond that an origin speaks of.
    fn told(&self, bond: BondId, origin: Origin) -> Option<Expr> {
        let outward = |end: End| self.graph.sign_into(bond, end.vertex, end.port) < 0.0;
        match origin {
            Origin::Carrier(carrier) => Some(self.current(carrier)),
            Origin::Inductor(end) | Origin::Current(end) => {
                match form_at(&self.forms, end) {
                    Form::Inductor { device, .. } | Form::Capacitor { device, .. } => {
                        let current = Expr::leaf(netlist::Leaf::Current(*device));
                        Some(signed(current, outward(end)))
                    }
                    // A current source stands along the half arrow.
                    Form::FlowSource { device, .. } => {
                        Some(Expr::leaf(netlist::Leaf::Current(*device)))
                    }
                    _ => None,
                }
            }
            Origin::Ohm(vertex) => self.ohm(vertex, bond),
            Origin::Nothing => Some(Expr::number(0.0)),
            Origin::Law(end) => match form_at(&self.forms, end) {
                Form::FlowSource { value, .. } => match value {
                    SourceValue::Constant(value) => Some(self.constant(value)),
                    SourceValue::Copy(signal) => self.signal(self.signal_places[signal.index()]),
                    SourceValue::Law(law) => {
                        self.value(law, Some(end.vertex), Speaker::Output).ok()
                    }
                    SourceValue::Waveform(_) => None,
                },
                Form::FlowLaw { law, .. } | Form::StoredFlow { law, .. } => {
                    let flow = self.value(law, Some(end.vertex), Speaker::Output).ok()?;
                    Some(signed(flow, outward(end)))
                }
                Form::RateFlow { state, .. } => {
                    let flow = self.voltage([state.node, self.ground()]);
                    Some(signed(flow, outward(end)))
                }
                _ => None,
            },
            Origin::Port(vertex, port) => {
                let inflow = self.port_law(vertex, port)?;
                Some(signed(inflow, outward(End { vertex, port: port as u32 })))
            }
            Origin::Balance(junction, _) => {
                let terms: Option<Vec<Expr>> = self
                    .graph
                    .vertex(junction)
                    .bonds
                    .iter()
                    .filter(|other| **other != bond)
                    .map(|other| {
                        // Inward flows add up to zero, so the bond's own is minus the sum of the others.
                        let same = self.graph.sign_into(*other, junction, 0)
                            == self.graph.sign_into(bond, junction, 0);
                        Some(signed(self.flow(*other, Speaker::Output)?, same))
                    })
                    .collect();
                Some(sum(terms?))
            }
        }
    }

    /// The flow into a two-port's port as its law gives it.
    fn port_law(&self, vertex: VertexId, port: usize) -> Option<Expr> {
        let speaker = Speaker::Output;
        match &self.forms[vertex.index()] {
            Form::Transformer { lead, modulus, .. } => {
                let bond = *self.graph.vertex(vertex).bonds.get(*lead)?;
                let flow = self.inflow(vertex, *lead as u32, bond, speaker)?;
                let modulus = self.value(modulus, Some(vertex), speaker).ok()?;
                Some(negate(product(modulus, flow)))
            }
            Form::GyratorFlows { modulus, .. } => {
                let effort = self.voltage(self.port(vertex, 1 - port)?);
                let modulus = self.value(modulus, Some(vertex), speaker).ok()?;
                Some(signed(product(modulus, effort), port == 1))
            }
            _ => None,
        }
    }
}

/// A quantity that no variable of the circuit holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unreadable {
    /// Where it is spoken of.
    pub span: Span,
    /// The element whose law speaks of it.
    pub own: Option<VertexId>,
}

impl Unreadable {
    /// What to tell the user.
    pub fn diagnostic(self, graph: &graph::BondGraph) -> Diagnostic {
        let of = self.own.map(|id| format!(" in the law of {}", graph.vertex(id).name));
        let message = format!("no circuit variable holds this quantity{}", of.unwrap_or_default());
        Diagnostic::error("E0602", self.span, message)
            .help("a quantity that the junctions leave undetermined cannot be read")
    }
}
