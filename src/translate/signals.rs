//! Signals: nodes whose voltage is the signal, referred to ground.

use super::Builder;
use super::elements::linked;
use super::forms::{Form, Integrator, SourceValue, constant_value, is_constant};
use super::values::{Speaker, Unreadable};
use crate::bond::graph::{
    BondGraph, Expr as GraphExpr, Initial, SignalId, SignalLaw, SignalOrigin, VertexId, Waveform,
};
use crate::diagnostic::Diagnostic;
use crate::expr::Binary;
use crate::netlist::header::Jumps;
use crate::netlist::{self, Element, Expr, Name, Shape};

/// What a rise of 0 becomes for other simulators, in output intervals.
const RISE: f64 = 1e-3;

/// Where a signal can be read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Place {
    /// A node of its own.
    Node(Name),
    /// It is the effort of a source in which its waveform stands.
    Source(VertexId),
}

/// Where each signal can be read.
pub fn places(graph: &BondGraph, forms: &[Form], nodes: &[Name]) -> Vec<Place> {
    let mut places: Vec<Place> = nodes.iter().map(|node| Place::Node(*node)).collect();
    for id in graph.vertex_ids() {
        if let Form::EffortSource { value: SourceValue::Waveform(signal), .. }
        | Form::FlowSource { value: SourceValue::Waveform(signal), .. } = &forms[id.index()]
        {
            places[signal.index()] = Place::Source(id);
        }
    }
    places
}

impl Builder<'_> {
    /// Adds the cards of all signals that stand in no source.
    pub(super) fn signal_cards(&mut self, diagnostics: &mut Vec<Diagnostic>) {
        let graph = self.graph;
        let mut heading = false;
        for (index, signal) in graph.signals.iter().enumerate() {
            let Place::Node(node) = self.signal_places[index] else { continue };
            let used = self.uses.laws[index] + self.uses.observed[index] > 0;
            if !used && signal.origin == SignalOrigin::Hidden {
                continue;
            }
            if !heading {
                self.comment(" signals");
                heading = true;
            }
            if let Err(unreadable) = self.signal_card(SignalId(index as u32), node) {
                diagnostics.push(unreadable.diagnostic(graph));
            }
        }
    }

    fn signal_card(&mut self, id: SignalId, node: Name) -> Result<(), Unreadable> {
        let graph = self.graph;
        let signal = &graph.signals[id.index()];
        let kind = match signal.origin {
            SignalOrigin::Input => "input ",
            SignalOrigin::Signal => "signal ",
            SignalOrigin::Hidden => "",
        };
        let what = format!("{kind}{}", signal.name);
        let nodes = [node, self.ground()];
        let card = Speaker::Card { except: None };
        match &signal.law {
            SignalLaw::Algebraic(expr) if is_constant(expr) => {
                let device = self.namer.device('V', &signal.name);
                let value = netlist::Waveform::Constant(self.constant(expr));
                self.device(device, nodes, Element::VoltageSource(value), signal.span, &what);
            }
            SignalLaw::Algebraic(expr) => {
                let law = self.value(expr, None, card)?;
                let voltage =
                    matches!(linked(&law, self.ground(), false), Some(Element::Vcvs { .. }));
                let element = match linked(&law, self.ground(), false) {
                    Some(element) if voltage => element,
                    _ => Element::BehaviouralVoltage { law },
                };
                let device = self.namer.device('E', &signal.name);
                self.device(device, nodes, element, signal.span, &what);
            }
            SignalLaw::Integrator { rate, initial } => {
                let rate = self.value(rate, None, card)?;
                let letter = match linked(&rate, self.ground(), true) {
                    Some(Element::Cccs { .. }) => 'F',
                    _ => 'G',
                };
                let state = Integrator {
                    node,
                    capacitor: self.namer.device('C', &signal.name),
                    feed: self.namer.device(letter, &signal.name),
                };
                let stated = match initial {
                    Initial::Given(stated) => Some(stated),
                    Initial::Implied => None,
                };
                let value = self.initial.signals.get(id.index()).copied().unwrap_or(0.0);
                let initial = self.stated(stated, value);
                self.integrator(state, rate, initial, signal.span, &what);
            }
            SignalLaw::Waveform(_) => {
                let device = self.namer.device('V', &signal.name);
                let value = self.waveform(id, device);
                self.device(device, nodes, Element::VoltageSource(value), signal.span, &what);
            }
        }
        Ok(())
    }

    /// The waveform of a signal in a source; exact jumps are noted.
    pub(super) fn waveform(&mut self, id: SignalId, device: Name) -> netlist::Waveform {
        let signal = &self.graph.signals[id.index()];
        let SignalLaw::Waveform(waveform) = &signal.law else {
            return netlist::Waveform::Constant(Expr::number(0.0));
        };
        let experiment = &self.graph.experiment;
        let rise = experiment.step.unwrap_or(1e-3) * RISE;
        let value = |expr: &GraphExpr| constant_value(self.graph, expr).unwrap_or(f64::NAN);
        let mut jumps =
            Jumps { device: self.namer.names.text(device).to_string(), ..Jumps::default() };
        let function = match waveform {
            Waveform::Step { at, before, after } => {
                if value(at) <= 0.0 {
                    return netlist::Waveform::Constant(self.constant(after));
                }
                jumps.times.push(value(at));
                let start = self.constant(at);
                let end = later(start.clone(), rise);
                let [low, high] = [before, after].map(|expr| self.constant(expr));
                let arguments = vec![Expr::number(0.0), low.clone(), start, low, end, high];
                (Shape::Pwl, arguments)
            }
            Waveform::Ramp { at, slope } => {
                let end = experiment.until.unwrap_or(1.0).max(value(at)) + 1.0;
                let run = Expr::number(end).binary(Binary::Subtract, self.constant(at));
                let high = self.constant(slope).binary(Binary::Multiply, run);
                let mut arguments = vec![Expr::number(end), high];
                if value(at) > 0.0 {
                    arguments.splice(0..0, [self.constant(at), Expr::number(0.0)]);
                } else {
                    let low = self.constant(slope).binary(Binary::Multiply, self.constant(at));
                    arguments.splice(0..0, [Expr::number(0.0), low.negate()]);
                }
                (Shape::Pwl, arguments)
            }
            Waveform::Pulse { low, high, delay, rise: up, fall, width, period } => {
                let edge = |expr: &GraphExpr, jump: &mut bool| {
                    if value(expr) == 0.0 {
                        *jump = true;
                        Expr::number(rise)
                    } else {
                        self.constant(expr)
                    }
                };
                let up = edge(up, &mut jumps.rise);
                let fall = edge(fall, &mut jumps.fall);
                let [low, high, delay, width, period] =
                    [low, high, delay, width, period].map(|expr| self.constant(expr));
                (Shape::Pulse, vec![low, high, delay, up, fall, width, period])
            }
            Waveform::Sine { offset, amplitude, frequency, delay, damping, phase } => {
                let degrees = match value(phase) {
                    0.0 => Expr::number(0.0),
                    _ => Expr::number(value(phase).to_degrees()),
                };
                let mut arguments: Vec<Expr> = [offset, amplitude, frequency, delay, damping]
                    .into_iter()
                    .map(|expr| self.constant(expr))
                    .collect();
                arguments.push(degrees);
                (Shape::Sin, arguments)
            }
            Waveform::Pwl(points) => {
                let mut arguments = Vec::with_capacity(2 * points.len());
                for (index, (time, level)) in points.iter().enumerate() {
                    let before = index.checked_sub(1).and_then(|at| points.get(at));
                    let start = self.constant(time);
                    let time = match before {
                        Some((earlier, _)) if value(earlier) == value(time) => {
                            jumps.times.push(value(time));
                            later(start, rise)
                        }
                        _ => start,
                    };
                    arguments.extend([time, self.constant(level)]);
                }
                (Shape::Pwl, arguments)
            }
        };
        if jumps.rise || jumps.fall || !jumps.times.is_empty() {
            self.jumps.push(jumps);
        }
        let (shape, arguments) = function;
        netlist::Waveform::Function { shape, arguments }
    }
}

/// A time a little later.
fn later(time: Expr, by: f64) -> Expr {
    match time.as_number() {
        Some(value) => Expr::number(value + by),
        None => time.binary(Binary::Add, Expr::number(by)),
    }
}
