//! What laws say of values over time: each becomes a quantity of its own, which the law then reads.

use super::scope::{self, ScopeId};
use super::sources;
use super::transfer;
use super::values::Lookup;
use crate::circuit::{self, Device, DeviceId, DeviceKind, NodeId, Nodes, Quantity};
use crate::diagnostic::Diagnostic;
use crate::expr::{Binary, Curve, Node};
use crate::netlist::{Expr, Operator};
use crate::source::Span;

impl Lookup<'_, '_> {
    /// What an operator of a law comes to: the leaf of its quantity. Of one that is wrong NaN, with an error.
    pub fn operator(
        &self,
        id: ScopeId,
        operator: Operator,
        arguments: &[Expr],
        span: Span,
        d: &mut Vec<Diagnostic>,
    ) -> circuit::Expr {
        self.find(id, operator, arguments, span, d).unwrap_or(circuit::Expr::number(f64::NAN))
    }

    fn find(
        &self,
        id: ScopeId,
        operator: Operator,
        arguments: &[Expr],
        span: Span,
        d: &mut Vec<Diagnostic>,
    ) -> Option<circuit::Expr> {
        if let Operator::Draw(draw, place) = operator {
            let value = scope::draw(&self.flat.scopes, id, draw, place);
            return Some(circuit::Expr::number(value));
        }
        if let Operator::Waveform(shape) = operator {
            let mut values = vec![];
            for argument in arguments {
                values.push(self.number(id, argument, d)?);
            }
            let waveform = sources::made(shape, &values, self.flat.times, None);
            if let Some(why) = sources::senseless(&waveform) {
                d.push(
                    Diagnostic::error("E0744", span, "a waveform that makes no sense").because(why),
                );
                return None;
            }
            return Some(self.quantity(Quantity::Signal { waveform: Box::new(waveform) }, span));
        }
        let law = self.law(id, arguments.first()?, d)?;
        if operator == Operator::Table {
            let mut points = vec![];
            for point in &arguments[1..] {
                points.push(self.number(id, point, d)?);
            }
            let Some(table) = crate::netlist::read::expression::table(&points) else {
                let message = "`table` takes x and pairs of numbers with rising abscissae";
                d.push(Diagnostic::error("E0706", span, message));
                return None;
            };
            return Some(circuit::Expr::new(Node::Table(law, table.into()), span));
        }
        Some(match operator {
            Operator::Derivative => self.quantity(Quantity::Derivative { law }, span),
            Operator::Integral => {
                let initial = match arguments.get(1) {
                    Some(initial) => self.number(id, initial, d)?,
                    None => 0.0,
                };
                self.quantity(Quantity::Integral { law, initial, pinned: true }, span)
            }
            Operator::Delay => {
                let by = self.number(id, arguments.get(1)?, d)?;
                if !(by >= 0.0 && by.is_finite()) {
                    let message = format!("a delay of {by} s");
                    let error = Diagnostic::error("E0767", span, message);
                    d.push(error.because("what is to come is not known: it must not be below 0"));
                    return None;
                }
                match by == 0.0 {
                    true => law,
                    false => self.quantity(Quantity::Delay { law, by }, span),
                }
            }
            Operator::Transfer => transfer::realise(self, id, law, arguments.get(1)?, span, d)?,
            Operator::Waveform(_) | Operator::Table | Operator::Draw(..) => return None,
        })
    }

    /// The law of a voltage that follows what it is told with a time constant: v = law − τ·dv/dt.
    pub fn followed(&self, law: circuit::Expr, nodes: &[NodeId]) -> circuit::Expr {
        let (Some(constant), [a, b]) = (self.flat.following, nodes) else { return law };
        let span = law.span;
        let own = circuit::Expr::leaf(circuit::Leaf::Voltage(*a, *b));
        let rate = self.quantity(Quantity::Derivative { law: own }, span);
        law - circuit::Expr::number(constant).binary(Binary::Multiply, rate)
    }

    /// Adds a quantity; the leaf that reads it.
    pub fn quantity(&self, quantity: Quantity, span: Span) -> circuit::Expr {
        let what = match &quantity {
            Quantity::Derivative { .. } => "ddt",
            Quantity::Integral { .. } => "sdt",
            Quantity::Delay { .. } => "delay",
            Quantity::Signal { .. } => "signal",
        };
        let mut quantities = self.flat.quantities.borrow_mut();
        let number = quantities.len();
        quantities.push(Device {
            name: format!("{what}#{}", number + 1).into(),
            nodes: Nodes::new(),
            kind: DeviceKind::Quantity(quantity),
            nominal: None,
            span,
        });
        let id = DeviceId((self.flat.devices.len() + number) as u32);
        circuit::Expr::new(Node::Leaf(circuit::Leaf::Current(id)), span)
    }

    /// Tables over time alone become signals, so that their corners are landed on. A netlist of a bond graph says where
    /// its corners are itself.
    pub fn timed_tables(&self, law: circuit::Expr) -> circuit::Expr {
        if !self.flat.netlist.header.is_empty() {
            return law;
        }
        let part = |a: &circuit::Expr| self.timed_tables(a.clone());
        let node = match &*law.node {
            Node::Number(_) | Node::Leaf(_) => return law,
            Node::Table(x, table)
                if matches!(&*x.node, Node::Leaf(circuit::Leaf::Time))
                    && table.curve == Curve::Lines =>
            {
                let points = table.x.iter().copied().zip(table.y.iter().copied()).collect();
                let waveform = circuit::Waveform::Pwl(points);
                return self.quantity(Quantity::Signal { waveform: Box::new(waveform) }, law.span);
            }
            Node::Table(x, table) => Node::Table(part(x), table.clone()),
            Node::Unary(op, a) => Node::Unary(*op, part(a)),
            Node::Binary(op, a, b) => Node::Binary(*op, part(a), part(b)),
            Node::Call(function, arguments) => {
                Node::Call(*function, arguments.iter().map(part).collect())
            }
            Node::If(c, a, b) => Node::choice(part(c), part(a), part(b)),
        };
        circuit::Expr::new(node, law.span)
    }
}
