//! Signals: nodes whose voltage is the signal, referred to ground.

use super::elements::linked;
use super::flows::Reader;
use super::forms::{Form, Integrator, SourceValue, constant_value, is_constant};
use super::values::{Speaker, Unreadable};
use super::{Builder, Mark};
use crate::bond::graph::{
    BondGraph, Expr as GraphExpr, Initial, Leaf, Memory, SignalId, SignalLaw, SignalOrigin,
    VertexId, Waveform,
};
use crate::bond::memory;
use crate::diagnostic::Diagnostic;
use crate::expr::{Binary, Node};
use crate::netlist::header::{Jumps, Sample};
use crate::netlist::{self, Card, CardKind, Element, Expr, Name, Shape};
use crate::quantity::random;
use crate::source::Span;

/// What a rise of 0 becomes for other simulators, in output intervals.
const RISE: f64 = 1e-3;

/// For other simulators: for how long a switch closes to sample, in parts of the period; into what capacitance, in
/// farads; for how many time constants.
const ACQUISITION: f64 = 1e-3;
const HOLDS: f64 = 1e-6;
const SETTLED: f64 = 30.0;

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
        self.rounds = memory::rounds(graph);
        let mut heading = false;
        for (index, signal) in graph.signals.iter().enumerate() {
            let Place::Node(node) = self.signal_places[index] else { continue };
            let used = self.uses.laws[index] + self.uses.observed[index] > 0;
            if !used && signal.origin == SignalOrigin::Hidden {
                continue;
            }
            if !heading {
                self.mark(Mark::default());
                self.comment(" signals");
                heading = true;
            }
            self.mark(Mark { home: signal.home, order: (1, index as u32, 0) });
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
        let card = Speaker::Card(Reader { except: None, home: signal.home });
        match &signal.law {
            SignalLaw::Algebraic(expr) if is_constant(expr) => {
                let device = self.namer.device('V', &signal.name);
                let value = netlist::Waveform::Constant(self.constant(expr));
                self.device(
                    device,
                    nodes,
                    Element::VoltageSource(value.into()),
                    signal.span,
                    &what,
                );
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
            SignalLaw::Memory { kind, input } => {
                let input = self.value(input, None, card)?;
                self.memory_cards(id, node, kind, input, &what);
            }
            SignalLaw::Waveform(_) => {
                let device = self.namer.device('V', &signal.name);
                let value = self.waveform(id, device);
                self.device(
                    device,
                    nodes,
                    Element::VoltageSource(value.into()),
                    signal.span,
                    &what,
                );
            }
        }
        Ok(())
    }

    /// The cards of a memory, whose value stands at `node`.
    fn memory_cards(&mut self, id: SignalId, node: Name, kind: &Memory, input: Expr, what: &str) {
        let graph = self.graph;
        let (name, span) =
            (graph.signals[id.index()].name.as_str(), graph.signals[id.index()].span);
        let ground = self.ground();
        let number = Expr::number;
        let start = self.initial.signals.get(id.index()).copied().unwrap_or(0.0);
        // A line loads what drives it: it may stand at a source of its own, but not where a capacitor, another line's end
        // or the circuit would feel it.
        let is_signal = match &graph.signals[id.index()].law {
            SignalLaw::Memory { input, .. } => match &*input.node {
                Node::Leaf(Leaf::Signal(of)) => {
                    let driven = match &graph.signals[of.index()].law {
                        SignalLaw::Waveform(_) => true,
                        SignalLaw::Algebraic(law) => !matches!(*law.node, Node::Leaf(_)),
                        _ => false,
                    };
                    driven && matches!(self.signal_places.get(of.index()), Some(Place::Node(_)))
                }
                _ => false,
            },
            _ => false,
        };
        let source = match linked(&input, ground, false) {
            Some(element @ Element::Vcvs { .. }) => element,
            _ => Element::BehaviouralVoltage { law: input },
        };
        match kind {
            Memory::Delay { by } => {
                // A matched line, driven by the input, which is a signal: its far end is the input, later.
                let near = match &source {
                    Element::Vcvs { gain, control: [near, zero] }
                        if is_signal && gain.as_number() == Some(1.0) && *zero == ground =>
                    {
                        *near
                    }
                    _ => {
                        let near = self.namer.node(&format!("{name}_in"));
                        let device = self.namer.device('E', &format!("{name}_in"));
                        self.device(device, [near, ground], source, span, what);
                        near
                    }
                };
                let initial = [start, start, start, -start].map(number);
                let delay = self.constant(by);
                let line = Element::Line {
                    impedance: number(1.0),
                    delay,
                    initial: Some(Box::new(initial)),
                };
                let device = self.namer.device('T', name);
                self.device_on(device, vec![near, ground, node, ground], line, span, what);
                let device = self.namer.device('R', name);
                let load = Element::Resistor { value: number(1.0) };
                self.device(device, [node, ground], load, span, what);
            }
            Memory::Sample { period } => {
                // A switch that a clock closes for a moment charges a capacitor; the header says that it is a memory.
                let near = self.namer.node(&format!("{name}_in"));
                let device = self.namer.device('E', &format!("{name}_in"));
                self.device(device, [near, ground], source, span, what);
                let every = constant_value(graph, period).unwrap_or(f64::NAN);
                let open = ACQUISITION * every;
                let clock = self.namer.node(&format!("{name}_clock"));
                let clock_source = self.namer.device('V', &format!("{name}_clock"));
                let edge = number(0.1 * open);
                let [low, high, delay] = [0.0, 1.0, 0.0].map(number);
                let width = number(open);
                let arguments =
                    vec![low, high, delay, edge.clone(), edge, width, self.constant(period)];
                let waveform = netlist::Waveform::Function { shape: Shape::Pulse, arguments };
                let element = Element::VoltageSource(waveform.into());
                self.device(clock_source, [clock, ground], element, span, what);
                let device = self.namer.device('S', name);
                let values =
                    [("vt", 0.5), ("vh", 0.0), ("ron", open / (SETTLED * HOLDS)), ("roff", 1e12)];
                let values = values.map(|(key, value)| (key, number(value)));
                let model = self.switch_model(device, values, span);
                let switch = Element::Switch { model, control: [clock, ground], on: Some(false) };
                self.device(device, [node, near], switch, span, what);
                let capacitor = self.namer.device('C', name);
                let element =
                    Element::Capacitor { value: number(HOLDS), initial: Some(number(start)) };
                self.device(capacitor, [node, ground], element, span, what);
                let text = |name: Name| self.namer.names.text(name).to_string();
                let sample = Sample {
                    switch: text(device),
                    capacitor: text(capacitor),
                    clock: text(clock_source),
                    period: every,
                    round: self.rounds.get(id.index()).copied().unwrap_or(0),
                };
                self.samples.push(sample);
            }
            Memory::Hysteresis { low, high } => {
                // A switch with hysteresis between 1 V and a load, and a comparison that makes 0 or 1 of it.
                let control = match &source {
                    Element::Vcvs { gain, control } if gain.as_number() == Some(1.0) => *control,
                    _ => {
                        let near = self.namer.node(&format!("{name}_in"));
                        let device = self.namer.device('E', &format!("{name}_in"));
                        self.device(device, [near, ground], source, span, what);
                        [near, ground]
                    }
                };
                let supply = self.namer.node(&format!("{name}_one"));
                let device = self.namer.device('V', &format!("{name}_one"));
                let one = Element::VoltageSource(netlist::Waveform::Constant(number(1.0)).into());
                self.device(device, [supply, ground], one, span, what);
                let device = self.namer.device('S', name);
                let (low, high) = (self.constant(low), self.constant(high));
                let middle = low.clone().binary(Binary::Add, high.clone());
                let middle = folded(middle.binary(Binary::Divide, number(2.0)));
                let half =
                    folded(high.binary(Binary::Subtract, low).binary(Binary::Divide, number(2.0)));
                let values =
                    [("vt", middle), ("vh", half), ("ron", number(1.0)), ("roff", number(1e9))];
                let model = self.switch_model(device, values, span);
                let switched = self.namer.node(&format!("{name}_switched"));
                let switch = Element::Switch { model, control, on: Some(start > 0.5) };
                self.device(device, [supply, switched], switch, span, what);
                let device = self.namer.device('R', name);
                let load = Element::Resistor { value: number(1e3) };
                self.device(device, [switched, ground], load, span, what);
                let device = self.namer.device('E', name);
                let law = self.voltage([switched, ground]).binary(Binary::Greater, number(0.5));
                let element = Element::BehaviouralVoltage { law };
                self.device(device, [node, ground], element, span, what);
            }
        }
    }

    /// The model card of a switch, named after it.
    fn switch_model(&mut self, switch: Name, values: [(&str, Expr); 4], span: Span) -> Name {
        let name = format!("{}_model", self.namer.names.text(switch));
        let name = self.namer.names.intern(&name);
        let parameters = values.map(|(key, value)| (key.to_string(), value)).to_vec();
        let kind = CardKind::Model { name, kind: "sw".to_string(), parameters };
        self.cards.push(Card { kind, span, comment: None });
        name
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
            Waveform::Noise { seed, rms, dt } => {
                let (seed, rms, dt) = (value(seed) as u64, value(rms), value(dt));
                let until = experiment.until.unwrap_or(1.0);
                let rise = rise.min(RISE * dt);
                let mut arguments = vec![];
                // What is longer is refused, and need not be made.
                for k in 0..=(until / dt).floor().min(super::MOST_HELD) as u64 {
                    let (begin, level) = (k as f64 * dt, rms * random::normal(seed, k));
                    let begin = if k > 0 { begin + rise } else { begin };
                    let end = (k + 1) as f64 * dt;
                    arguments.extend([begin, level, end, level].map(Expr::number));
                }
                jumps.steps = true;
                (Shape::Pwl, arguments)
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
        if jumps.rise || jumps.fall || jumps.steps || !jumps.times.is_empty() {
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

/// An expression of numbers alone as a number.
fn folded(expr: Expr) -> Expr {
    let mut constant = true;
    expr.leaves(&mut |_, _| constant = false);
    if constant { Expr::number(expr.evaluate(&mut |_| f64::NAN)) } else { expr }
}
