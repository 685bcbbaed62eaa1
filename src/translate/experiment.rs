//! What is to be computed: parameters, options, saved variables, the transient, and the header that other simulators
//! skip.

use super::values::Speaker;
use super::{Builder, Mark};
use crate::bond::graph::{Expr as GraphExpr, Leaf, ParameterId};
use crate::diagnostic::Diagnostic;
use crate::expr::{Binary, Function, Node, Unary};
use crate::netlist::analysis::Print;
use crate::netlist::header::{Column, DomainVariables, Header};
use crate::netlist::write::expression;
use crate::netlist::{self, Card, CardKind, Element, Expr, Name};
use crate::quantity::{DOMAINS, Domain};
use crate::source::Span;
use std::collections::HashSet;

/// Default relative tolerance of a bond graph's run.
const RELTOL: &str = "1e-6";

/// Options for other simulators: the step limit of `.tran` does most, and this keeps Newton's method from stopping
/// early on the small flows beside large efforts.
const OPTIONS: &[(&str, &str)] = &[("reltol", "1e-4")];

impl Builder<'_> {
    /// Adds a card for each parameter, those that others use first.
    pub(super) fn parameter_cards(&mut self) {
        let graph = self.graph;
        let mut done = vec![false; graph.parameters.len()];
        let mut order = Vec::new();
        for index in 0..graph.parameters.len() {
            self.order_parameters(index, &mut done, &mut order);
        }
        if !order.is_empty() {
            self.comment(" parameters, in SI units");
        }
        for index in order {
            let parameter = &graph.parameters[index];
            // What ngspice cannot compute in a .param is written as its value.
            let expr = if portable(&parameter.expr) {
                self.constant(&parameter.expr)
            } else {
                Expr::number(parameter.value)
            };
            let mut comment: Vec<String> = self.place(parameter.span).into_iter().collect();
            if !parameter.description.is_empty() {
                comment.push(parameter.description.clone());
            }
            self.cards.push(Card {
                kind: CardKind::Parameters(vec![(self.parameters[index], expr)]),
                span: parameter.span,
                comment: (!comment.is_empty()).then(|| comment.join(" ")),
            });
        }
    }

    /// Depth first without recursion: a parameter comes after those that it is computed from.
    fn order_parameters(&self, first: usize, done: &mut [bool], order: &mut Vec<usize>) {
        let mut waiting = vec![(first, false)];
        while let Some((index, ready)) = waiting.pop() {
            if ready {
                order.push(index);
                continue;
            }
            if std::mem::replace(&mut done[index], true) {
                continue;
            }
            waiting.push((index, true));
            self.graph.parameters[index].expr.leaves(&mut |leaf, _| {
                if let Leaf::Parameter(ParameterId(id)) = leaf {
                    waiting.push((*id as usize, false));
                }
            });
        }
    }

    /// Adds options, saved variables and the transient, and returns the header.
    pub(super) fn experiment_cards(&mut self, diagnostics: &mut Vec<Diagnostic>) -> Header {
        self.mark(Mark::default());
        let experiment = &self.graph.experiment;
        let mut columns = Vec::new();
        let mut saved = Vec::new();
        let mut seen = HashSet::new();
        for observation in &experiment.observe {
            match self.value(&observation.expr, None, Speaker::Output) {
                Ok(value) => {
                    self.save(&value, &mut saved, &mut seen);
                    let (unit, factor) = &observation.unit;
                    let value = if *factor == 1.0 {
                        value
                    } else {
                        value.binary(Binary::Divide, Expr::number(*factor))
                    };
                    let si = unit.is_empty();
                    columns.push(Column {
                        name: observation.name.clone(),
                        unit: if si { observation.si_unit.clone() } else { unit.clone() },
                        expr: expression(&self.namer.names, &value),
                    });
                }
                Err(unreadable) => diagnostics.push(unreadable.diagnostic(self.graph)),
            }
        }
        let mut push = |kind| self.cards.push(Card { kind, span: Span::NONE, comment: None });
        push(CardKind::Comment(" analysis".to_string()));
        push(CardKind::Options(
            OPTIONS.iter().map(|(key, value)| (key.to_string(), value.to_string())).collect(),
        ));
        if !saved.is_empty() {
            // `.print` makes a run without a raw file worth having (`… | ngspice -b`), `.save` keeps a raw file small.
            push(CardKind::Save { of: Print::Any, items: saved.clone() });
            push(CardKind::Save { of: Print::Transient, items: saved });
        }
        if let (Some(until), Some(step)) = (experiment.until, experiment.step) {
            let number = |value: f64| Expr::number(value);
            push(CardKind::Transient {
                step: number(step),
                stop: number(until),
                start: Some(number(0.0)),
                hmax: Some(number(twelve_digits(step / 10.0))),
                uic: true,
            });
        }
        let limit = experiment.options.iter().any(|(key, value)| key == "hmax" && value != "auto");
        let mut options = vec![("reltol".to_string(), RELTOL.to_string())];
        options.extend(experiment.options.iter().cloned());
        Header {
            hmax_auto: !limit,
            grid: experiment.step,
            options,
            jumps: std::mem::take(&mut self.jumps),
            samples: std::mem::take(&mut self.samples),
            scales: self
                .graph
                .scales
                .iter()
                .map(|scale| (scale.domain.name().to_string(), scale.factor))
                .collect(),
            domains: self.domain_variables(),
            columns,
        }
    }

    /// The variables of an expression as items of `.save`.
    fn save(
        &self,
        value: &Expr,
        saved: &mut Vec<(String, Expr)>,
        seen: &mut HashSet<(bool, Name)>,
    ) {
        let names = &self.namer.names;
        let ground = self.ground();
        value.leaves(&mut |leaf, _| {
            let wanted: Vec<(bool, Name)> = match leaf {
                netlist::Leaf::Voltage(plus, minus) => {
                    std::iter::once(*plus).chain(*minus).map(|name| (true, name)).collect()
                }
                netlist::Leaf::Current(device) => vec![(false, *device)],
                _ => vec![],
            };
            for (voltage, name) in wanted {
                if (voltage && name == ground) || !seen.insert((voltage, name)) {
                    continue;
                }
                let (letter, leaf) = if voltage {
                    ('v', netlist::Leaf::Voltage(name, None))
                } else {
                    ('i', netlist::Leaf::Current(name))
                };
                saved.push((format!("{letter}({})", names.text(name)), Expr::leaf(leaf)));
            }
        });
    }

    /// By point: the domain of the bonds that stand at it.
    fn point_domains(&self) -> Vec<Domain> {
        let mut domains = vec![Domain::Any; self.points.len()];
        for island in &self.islands {
            for bond in &island.bonds {
                for pair in self.drawing.ends[bond.index()].into_iter().flatten() {
                    for point in [pair.plus, pair.minus] {
                        domains[self.drawing.points.root(point)] = island.domain;
                    }
                }
            }
        }
        (0..domains.len()).map(|point| domains[self.drawing.points.root(point)]).collect()
    }

    /// Nodes and currents of each domain that has usual magnitudes.
    fn domain_variables(&self) -> Vec<DomainVariables> {
        let names = &self.namer.names;
        let text = |name: Name| names.text(name).to_string();
        let ground = self.ground();
        let mut nodes: Vec<(Domain, Name)> = Vec::new();
        let mut seen = HashSet::from([ground]);
        let mut devices: Vec<(Domain, Name)> = Vec::new();
        for (point, domain) in self.point_domains().into_iter().enumerate() {
            if seen.insert(self.node(point)) {
                nodes.push((domain, self.node(point)));
            }
        }
        let domain_of: std::collections::HashMap<Name, Domain> =
            nodes.iter().map(|(domain, node)| (*node, *domain)).collect();
        for card in &self.cards {
            let CardKind::Device(device) = &card.kind else { continue };
            let branch = matches!(
                device.element,
                Element::VoltageSource(_)
                    | Element::Vcvs { .. }
                    | Element::Ccvs { .. }
                    | Element::BehaviouralVoltage { .. }
                    | Element::Inductor { .. }
            );
            if branch && let Some(domain) = device.nodes.iter().find_map(|node| domain_of.get(node))
            {
                devices.push((*domain, device.name));
            }
        }
        DOMAINS
            .iter()
            .filter(|row| row.domain != Domain::Any)
            .map(|row| DomainVariables {
                domain: row.name.to_string(),
                effort: row.nominal_effort / self.graph.unscale(row.domain, 1),
                flow: row.nominal_flow / self.graph.unscale(row.domain, -1),
                nodes: nodes.iter().filter(|(d, _)| *d == row.domain).map(|x| text(x.1)).collect(),
                devices: devices
                    .iter()
                    .filter(|(d, _)| *d == row.domain)
                    .map(|x| text(x.1))
                    .collect(),
            })
            .filter(|row| !row.nodes.is_empty() || !row.devices.is_empty())
            .collect()
    }
}

/// Whether ngspice computes an expression in a `.param` as we do: sums, products, fractions and the plainest functions.
pub fn portable(expr: &GraphExpr) -> bool {
    match &*expr.node {
        Node::Number(value) => value.is_finite(),
        Node::Leaf(_) => true,
        Node::Unary(Unary::Negate, a) => portable(a),
        Node::Unary(Unary::Not, _) | Node::If(..) | Node::Table(..) => false,
        // Small whole powers are written as products.
        Node::Binary(Binary::Power, a, b) => {
            b.as_number().is_some_and(|b| b.fract() == 0.0 && (1.0..=8.0).contains(&b))
                && portable(a)
        }
        Node::Binary(op, a, b) => {
            matches!(op, Binary::Add | Binary::Subtract | Binary::Multiply | Binary::Divide)
                && portable(a)
                && portable(b)
        }
        Node::Call(function, arguments) => {
            matches!(
                function,
                Function::Abs
                    | Function::Sqrt
                    | Function::Exp
                    | Function::Ln
                    | Function::Sin
                    | Function::Cos
            ) && arguments.iter().all(portable)
        }
    }
}

/// A value that needs no more than twelve digits: 1e-5/10 is 1e-6 to a reader.
fn twelve_digits(value: f64) -> f64 {
    format!("{value:.11e}").parse().unwrap_or(value)
}
