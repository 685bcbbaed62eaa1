//! Two laws that differ as texts, compared as functions at random points in floating point.
//!
//! A number of the field stands for a random one here: equal ones for equal ones, and the negative for the negative.
//! So both texts are asked about the same arguments without anybody saying which is which; a part of the netlist's
//! text that is one of the law's own arguments in the field counts as that argument.

use super::bonds::Bonds;
use super::draw::{Draw, Modular, mix};
use super::form::{Form, Reading};
use super::wires::Wires;
use crate::bond::graph;
use crate::expr::{Expr, Node};
use crate::netlist::flatten::scope::{self, ScopeId};
use crate::netlist::{self, Leaf};
use std::collections::HashSet;

/// Points, of several sizes.
const SIZES: &[f64] = &[1.0, 1e-3, 1e3, 1e-6, 1e6];
const POINTS: u64 = 8;
/// Differences up to this part of the larger value are rounding, and up to so many times what moving the point by a few
/// units in the last place makes.
const ROUNDING: f64 = 1e-13;
const NOISE: f64 = 64.0;

/// The random number that one of the field stands for.
fn number<F: Modular>(value: F, salt: u64, size: f64, moved: u64) -> f64 {
    let (negative, least) = match (-value).value() < value.value() {
        true => (true, -value),
        false => (false, value),
    };
    if value.is_zero() {
        return 0.0;
    }
    let part = |x: u64| (x >> 11) as f64 / (1u64 << 53) as f64;
    let word = mix(least.value() ^ mix(salt));
    let own = if word & 1 == 0 { 1.0 } else { -1.0 };
    let rounding =
        if moved == 0 { 0.0 } else { 4.0 * f64::EPSILON * (part(mix(word ^ moved)) - 0.5) };
    let size = own * size * (0.1 + 1.9 * part(word)) * (1.0 + rounding);
    if negative { -size } else { size }
}

/// Both sides of a comparison.
pub struct Sides<'a, 't, F> {
    /// The bond graph's.
    pub bonds: &'a Bonds<'t, F>,
    /// Its solution.
    pub theirs: &'a [F],
    /// The circuit's.
    pub wires: &'a Wires<'t, F>,
    /// Its solution.
    pub ours: &'a [F],
}

impl<F: Modular> Sides<'_, '_, F> {
    /// Whether an expression of the bond graph, or its negative, and one of the netlist are the same function.
    pub fn same(
        &self,
        law: &graph::Expr,
        own: Option<graph::VertexId>,
        turned: bool,
        scope: ScopeId,
        text: &netlist::Expr,
    ) -> bool {
        let mut arguments = HashSet::new();
        law.leaves(&mut |leaf, _| {
            if !matches!(leaf, graph::Leaf::Parameter(_))
                && let Ok(form) = self.bonds.leaf(leaf, own)
            {
                let value = form.at(self.theirs);
                arguments.extend([value.value(), (-value).value()]);
            }
        });
        let mut told = 0;
        for size in SIZES {
            for point in 0..POINTS {
                let at = |moved: u64| {
                    let ours = self.text(text, scope, &arguments, point, *size, moved);
                    let law = self.law(law, own, point, *size, moved);
                    (ours, if turned { -law } else { law })
                };
                let (ours, law) = at(0);
                if !ours.is_finite() || !law.is_finite() {
                    if ours.is_nan() != law.is_nan() {
                        return false;
                    }
                    continue;
                }
                let noise = (1..4)
                    .map(at)
                    .fold(0.0f64, |noise, (a, b)| noise.max((a - ours).abs()).max((b - law).abs()));
                let limit = ROUNDING * ours.abs().max(law.abs()) + NOISE * noise;
                if (ours - law).abs() > limit {
                    return false;
                }
                told += 1;
            }
        }
        told > 0
    }

    fn law(
        &self,
        law: &graph::Expr,
        own: Option<graph::VertexId>,
        point: u64,
        size: f64,
        moved: u64,
    ) -> f64 {
        law.evaluate(&mut |leaf| match leaf {
            graph::Leaf::Parameter(id) => self.bonds.graph.parameters[id.index()].value,
            leaf => match self.bonds.leaf(leaf, own) {
                Ok(form) => number(form.at(self.theirs), point, size, moved),
                Err(_) => f64::NAN,
            },
        })
    }

    /// The text, its parts that are arguments replaced by numbers first.
    fn text(
        &self,
        text: &netlist::Expr,
        scope: ScopeId,
        arguments: &HashSet<u64>,
        point: u64,
        size: f64,
        moved: u64,
    ) -> f64 {
        let replaced =
            self.replaced(text, scope, arguments, &|value| number(value, point, size, moved));
        replaced.evaluate(&mut |leaf| match leaf {
            Leaf::Parameter(name) => {
                let names = &self.wires.text.names;
                let (place, own) = self.wires.lookup.parameter(scope, *name);
                let known = self.wires.text.flat.scopes.parameter(place, own);
                known.or_else(|| scope::constant(names.text(*name))).unwrap_or(f64::NAN)
            }
            leaf => match self.wires.leaf(scope, leaf) {
                Ok(form) => number(form.at(self.ours), point, size, moved),
                Err(_) => f64::NAN,
            },
        })
    }

    fn replaced(
        &self,
        expr: &netlist::Expr,
        scope: ScopeId,
        arguments: &HashSet<u64>,
        number: &dyn Fn(F) -> f64,
    ) -> netlist::Expr {
        let draw: Draw = self.bonds.draw;
        let mut speaks = false;
        expr.leaves(&mut |leaf, _| speaks |= !matches!(leaf, Leaf::Parameter(_)));
        if !speaks || matches!(*expr.node, Node::Leaf(_)) {
            return expr.clone();
        }
        let value = Reading { draw, cut: None }.number(expr, &mut |leaf, _| {
            Ok(Form::number(self.wires.leaf(scope, leaf)?.at(self.ours)))
        });
        if let Ok(value) = value
            && arguments.contains(&value.value())
        {
            return Expr::number(number(value));
        }
        let part = |part: &netlist::Expr| self.replaced(part, scope, arguments, number);
        let node = match &*expr.node {
            Node::Unary(op, a) => Node::Unary(*op, part(a)),
            Node::Binary(op, a, b) => Node::Binary(*op, part(a), part(b)),
            Node::Call(function, all) => Node::Call(*function, all.iter().map(part).collect()),
            Node::If(c, a, b) => Node::choice(part(c), part(a), part(b)),
            Node::Table(a, table) => Node::Table(part(a), table.clone()),
            node @ (Node::Number(_) | Node::Leaf(_)) => node.clone(),
        };
        Expr::new(node, expr.span)
    }
}
