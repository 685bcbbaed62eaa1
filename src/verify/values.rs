//! The values of a text against those of the bond graph, in floating point: parameters, initial values, waveforms, the
//! thresholds of memories, and what is to be computed and saved.

use super::exact::bonds::Place;
use super::exact::draw::mix;
use super::exact::text::{Seen, Start, Text, seen, waveform_of};
use super::report::{Mismatch, Values};
use crate::bond::equations::{Known, equations};
use crate::bond::graph::{BondGraph, Expr, Leaf, Memory, SignalId, SignalLaw};
use crate::bond::initial::InitialState;
use crate::circuit::{DeviceKind, NodeId, Waveform};
use crate::netlist::flatten::scope::{self, TOP};
use crate::netlist::flatten::values::Lookup;
use crate::netlist::header::Header;
use crate::netlist::{self, CardKind, Element, Netlist, Shape};
use std::collections::HashSet;

/// Values that differ by less are equal.
const ULPS: f64 = 4.0;
/// An initial value that is written as an expression of parameters may differ by this from the one that was solved for.
const SOLVED: f64 = 1e-12;
/// Segments of a waveform that are looked at, and random times in each.
const MOST_SEGMENTS: usize = 4000;

/// Compares every value. `ours` is the netlist that the translation itself makes.
pub fn compare(
    graph: &BondGraph,
    initial: &InitialState,
    text: &Text<'_>,
    ours: &Netlist,
) -> Values {
    let mut check = Check { graph, initial, text, compared: 0, mismatches: vec![] };
    check.parameters();
    check.starts();
    check.waveforms();
    check.memories();
    check.analyses();
    check.saved();
    check.options(ours);
    let verdict = if check.mismatches.is_empty() { "pass" } else { "fail" };
    Values { verdict, compared: check.compared, mismatches: check.mismatches }
}

struct Check<'a> {
    graph: &'a BondGraph,
    initial: &'a InitialState,
    text: &'a Text<'a>,
    compared: usize,
    mismatches: Vec<Mismatch>,
}

fn near(a: f64, b: f64, relative: f64) -> bool {
    a == b || (a - b).abs() <= relative * a.abs().max(b.abs())
}

fn equal(a: f64, b: f64) -> bool {
    near(a, b, ULPS * f64::EPSILON)
}

impl Check<'_> {
    fn wrong(&mut self, what: &str, why: String) {
        self.mismatches.push(Mismatch::of(what, &why));
    }

    fn value(&mut self, device: usize, what: &str, is: f64, should: f64, relative: f64) {
        self.compared += 1;
        if !near(is, should, relative) {
            let why = format!("{what} is {is:e}, not {should:e}");
            self.mismatches.push(Mismatch::card(self.text, device, &why));
        }
    }

    fn number(&self, expr: &Expr) -> f64 {
        expr.evaluate(&mut |leaf| match leaf {
            Leaf::Parameter(id) => self.graph.parameters[id.index()].value,
            _ => f64::NAN,
        })
    }

    fn parameters(&mut self) {
        for (k, parameter) in self.graph.parameters.iter().enumerate() {
            let Some((scope, name)) = self.text.parameters.get(k).copied().flatten() else {
                continue;
            };
            let value = self.text.flat.scopes.parameter(scope, name).unwrap_or(f64::NAN);
            self.compared += 1;
            if !equal(value, parameter.value) {
                let why = format!("it is {value:e}, not {:e}", parameter.value);
                let path = &self.text.flat.scopes.get(scope).path;
                self.wrong(&format!(".param {path}{}", self.text.names.text(name)), why);
            }
        }
    }

    /// What storages and signals start from.
    fn starts(&mut self) {
        for device in 0..self.text.flat.devices.len() {
            let Some((pending, element)) = self.text.element(device) else { continue };
            let (Element::Capacitor { initial: written, .. }
            | Element::Inductor { initial: written, .. }) = element
            else {
                continue;
            };
            let should = match self.text.start(self.graph, device) {
                Start::Power(end) => self.initial.storage(end).map_or(0.0, |s| s.power),
                Start::Stored(end) => self.initial.storage(end).map_or(0.0, |s| s.stored),
                Start::Signal(id) => self.signal(id),
                Start::Card => continue,
            };
            let mut symbolic = false;
            let is = match written {
                Some(written) => {
                    written.leaves(&mut |_, _| symbolic = true);
                    self.written(pending.scope, written)
                }
                None => 0.0,
            };
            let relative = if symbolic { SOLVED } else { ULPS * f64::EPSILON };
            self.value(device, "what it starts from", is, should, relative);
        }
        for device in 0..self.text.circuit.devices.len() {
            if let DeviceKind::Line { initial, .. } = &self.text.circuit.devices[device].kind
                && let Start::Signal(id) = self.text.start(self.graph, device)
            {
                let start = self.signal(id);
                let should = [start, start, start, -start];
                let initial = initial.as_deref().copied().unwrap_or([0.0; 4]);
                for (is, should) in initial.into_iter().zip(should) {
                    let what = "what it starts from";
                    self.value(device, what, is, should, ULPS * f64::EPSILON);
                }
            }
        }
        if !self.text.circuit.initial.is_empty() {
            let why = "the bond graph states no initial values of nodes".to_string();
            self.wrong(".ic", why);
        }
    }

    fn signal(&self, id: SignalId) -> f64 {
        self.initial.signals.get(id.index()).copied().unwrap_or(0.0)
    }

    fn written(&self, scope: scope::ScopeId, expr: &netlist::Expr) -> f64 {
        let names = &self.text.netlist.names;
        let found = scope::number(&self.text.flat.scopes, scope, expr, names, &mut vec![]);
        found.unwrap_or(f64::NAN)
    }

    fn waveforms(&mut self) {
        let all = equations(self.graph);
        let until = self.graph.experiment.until.filter(|t| *t > 0.0).unwrap_or(1.0);
        for device in 0..self.text.circuit.devices.len() {
            let (DeviceKind::VoltageSource { waveform, .. }
            | DeviceKind::CurrentSource { waveform, .. }) = &self.text.circuit.devices[device].kind
            else {
                continue;
            };
            let claim = self.text.claims.get(device).copied().flatten();
            let Some(id) = claim.and_then(|place| waveform_of(self.graph, place)) else { continue };
            let Some(crate::bond::equations::Input::Wave(wave)) = all.signal(id) else { continue };
            let Some(known) = all.waves.get(wave as usize) else { continue };
            self.compared += 1;
            if let Some(why) = differs(known, waveform, until, device as u64) {
                self.mismatches.push(Mismatch::card(self.text, device, &why));
            }
        }
    }

    /// Memories that a switch or a hold stands for.
    fn memories(&mut self) {
        for (place, devices) in &self.text.devices {
            let Place::Signal(id) = place else { continue };
            let SignalLaw::Memory { kind, .. } = &self.graph.signals[id.index()].law else {
                continue;
            };
            let found = match kind {
                Memory::Hysteresis { low, high } => {
                    self.hysteresis(*id, devices, [self.number(low), self.number(high)])
                }
                Memory::Sample { period } => self.sample(*id, devices, self.number(period)),
                // A line's own equations stand in the exact part.
                Memory::Delay { .. } => None,
            };
            self.compared += 1;
            if let Some((device, why)) = found {
                let mismatch = match device {
                    Some(device) => Mismatch::card(self.text, device, &why),
                    None => Mismatch::of(&self.graph.signals[id.index()].name, &why),
                };
                self.mismatches.push(mismatch);
            }
        }
        self.mismatches.sort_by(|a, b| (&a.variable, &a.card).cmp(&(&b.variable, &b.card)));
    }

    /// A switch between 1 V and a load, whose voltage a comparison turns into 0 or 1.
    fn hysteresis(
        &self,
        id: SignalId,
        devices: &[usize],
        [low, high]: [f64; 2],
    ) -> Option<(Option<usize>, String)> {
        let circuit = &self.text.circuit.devices;
        let one = |fits: &dyn Fn(&DeviceKind) -> bool| {
            let mut found = devices.iter().copied().filter(|k| fits(&circuit[*k].kind));
            let first = found.next()?;
            found.next().is_none().then_some(first)
        };
        let missing = || Some((None, "one of its cards is missing or doubled".to_string()));
        let switch = one(&|kind| matches!(kind, DeviceKind::Switch { .. }));
        let load = one(&|kind| matches!(kind, DeviceKind::Resistor { .. }));
        let supply = one(&|kind| matches!(kind, DeviceKind::VoltageSource { .. }));
        let reader = devices.iter().copied().find(|k| {
            matches!(circuit[*k].kind, DeviceKind::BehaviouralVoltage { .. })
                && self.text.gives_memory(*k)
        });
        let (Some(switch), Some(load), Some(supply), Some(reader)) = (switch, load, supply, reader)
        else {
            return missing();
        };
        let (
            DeviceKind::Switch { on, off, on_resistance, off_resistance, initially_on, .. },
            DeviceKind::Resistor { resistance },
            DeviceKind::VoltageSource { waveform, .. },
            DeviceKind::BehaviouralVoltage { law },
        ) = (
            &circuit[switch].kind,
            &circuit[load].kind,
            &circuit[supply].kind,
            &circuit[reader].kind,
        )
        else {
            return missing();
        };
        let Waveform::Constant(volts) = **waveform else { return missing() };
        let threshold = |is: f64, should: f64| {
            near(is, should, 1e-12)
                || (is - should).abs() <= 4.0 * f64::EPSILON * low.abs().max(high.abs())
        };
        if !threshold(*on, high) || !threshold(*off, low) {
            let why = format!("it switches at {off:e} and {on:e}, not at {low:e} and {high:e}");
            return Some((Some(switch), why));
        }
        if initially_on.unwrap_or(false) != (self.signal(id) > 0.5) {
            return Some((Some(switch), "it starts in the other state".into()));
        }
        // Supply and load stand on either side of the switch.
        let ground = NodeId(0);
        let (a, b) = (circuit[switch].nodes.first()?, circuit[switch].nodes.get(1)?);
        let stands = |device: usize, nodes: [NodeId; 2]| circuit[device].nodes[..] == nodes;
        let hot = stands(supply, [*a, ground]) || stands(supply, [*b, ground]);
        let switched = if circuit[supply].nodes.first() == Some(a) { *b } else { *a };
        let loaded = stands(load, [switched, ground]) || stands(load, [ground, switched]);
        if !hot || !loaded {
            return Some((Some(switch), "supply and load are not on either side of it".into()));
        }
        for (state, series) in [(1.0, on_resistance), (0.0, off_resistance)] {
            let voltage = volts * resistance / (resistance + series);
            let value = law.evaluate(&mut |leaf| match leaf {
                crate::circuit::Leaf::Voltage(p, m) if (*p, *m) == (switched, ground) => voltage,
                _ => f64::NAN,
            });
            if value != state {
                let why = format!("it gives {value} where the signal is {state}");
                return Some((Some(reader), why));
            }
        }
        None
    }

    /// A hold, which for other simulators is a switch that a clock closes for a moment.
    fn sample(
        &self,
        id: SignalId,
        devices: &[usize],
        period: f64,
    ) -> Option<(Option<usize>, String)> {
        let circuit = &self.text.circuit.devices;
        let name = |k: usize| self.text.device_name(k);
        let hold =
            devices.iter().copied().find(|k| matches!(circuit[*k].kind, DeviceKind::Hold { .. }));
        let Some(hold) = hold else { return Some((None, "no device holds its value".into())) };
        let DeviceKind::Hold { period: is, round } = circuit[hold].kind else { return None };
        let should = crate::bond::memory::rounds(self.graph).get(id.index()).copied().unwrap_or(0);
        if !equal(is, period) || round != should {
            let why =
                format!("it holds every {is:e} s in round {round}, not {period:e} in {should}");
            return Some((Some(hold), why));
        }
        let header = self.text.header.samples.iter();
        let header = header.clone().find(|s| s.switch.eq_ignore_ascii_case(&name(hold)))?;
        let find =
            |wanted: &str| devices.iter().copied().find(|k| name(*k).eq_ignore_ascii_case(wanted));
        let (Some(clock), Some(capacitor)) = (find(&header.clock), find(&header.capacitor)) else {
            return Some((Some(hold), "its clock or its capacitor is missing".into()));
        };
        let ground = NodeId(0);
        if circuit[capacitor].nodes[..] != [circuit[hold].nodes[0], ground] {
            return Some((Some(capacitor), "it does not stand at the node that holds".into()));
        }
        let (pending, element) = self.text.element(clock)?;
        let pulse = match element {
            Element::VoltageSource(source) => match &source.waveform {
                netlist::Waveform::Function { shape: Shape::Pulse, arguments } => Some(arguments),
                _ => None,
            },
            _ => None,
        };
        let Some(arguments) = pulse else {
            return Some((Some(clock), "it is no clock".into()));
        };
        let value = |k: usize| arguments.get(k).map_or(0.0, |a| self.written(pending.scope, a));
        let ticks = value(0) == 0.0 && value(1) == 1.0 && value(2) == 0.0;
        let opens = value(5) > 0.0 && value(3) + value(4) + value(5) < 0.01 * period;
        if !ticks || !opens || !equal(value(6), period) {
            return Some((Some(clock), "it does not tick once a period".into()));
        }
        let (_, Element::Switch { control, .. }) = self.text.element(hold)? else {
            return Some((Some(hold), "it is no switch".into()));
        };
        if control.as_slice() != pending.device.nodes.as_slice() {
            return Some((Some(hold), "its clock does not close it".into()));
        }
        None
    }

    fn analyses(&mut self) {
        let experiment = &self.graph.experiment;
        let cards = self.text.netlist.cards.iter();
        let found: Vec<_> = cards
            .filter_map(|card| match &card.kind {
                CardKind::Transient { step, stop, start, hmax, uic } => {
                    Some((step, stop, start.as_ref(), hmax.as_ref(), *uic))
                }
                _ => None,
            })
            .collect();
        let (Some(until), Some(every)) = (experiment.until, experiment.step) else {
            if !found.is_empty() {
                self.wrong(".tran", "the bond graph asks for no run".into());
            }
            return;
        };
        self.compared += 5;
        let [(step, stop, start, hmax, uic)] = found[..] else {
            return self.wrong(".tran", format!("there are {} instead of one", found.len()));
        };
        let number = |expr: &netlist::Expr| self.written(TOP, expr);
        let (step, stop) = (number(step), number(stop));
        let (start, hmax) = (start.map_or(0.0, number), hmax.map_or(f64::INFINITY, number));
        let header = &self.text.header;
        let (grid, auto) = (header.grid.unwrap_or(f64::NAN), header.hmax_auto);
        if !equal(step, every) || !equal(grid, every) {
            let why = format!("rows every {step:e} s, on a grid of {grid:e} s, not {every:e}");
            self.wrong(".tran", why);
        }
        if !equal(stop, until) || start != 0.0 {
            self.wrong(".tran", format!("from {start:e} to {stop:e} s, not from 0 to {until:e}"));
        }
        if !near(hmax, every / 10.0, 1e-11) {
            self.wrong(".tran", format!("its largest step is {hmax:e}, not {:e}", every / 10.0));
        }
        if !uic {
            self.wrong(".tran", "it does not start from the initial values (uic)".into());
        }
        let limited = experiment.options.iter().any(|(key, v)| key == "hmax" && v != "auto");
        if auto == limited {
            self.wrong("header hmax", format!("`auto` is {auto}, not {}", !limited));
        }
    }

    /// Everything that a column reads is saved and printed.
    fn saved(&mut self) {
        let text = self.text;
        let lookup = Lookup::new(&text.flat, &text.names);
        let mut items: [Vec<Seen>; 2] = [vec![], vec![]];
        let mut all = [false; 2];
        for card in &text.netlist.cards {
            let CardKind::Save { of, items: given } = &card.kind else { continue };
            let print = usize::from(*of != netlist::analysis::Print::Any);
            all[print] |= given.is_empty();
            for (_, expr) in given {
                if let crate::expr::Node::Leaf(leaf) = &*expr.node {
                    items[print].extend(seen(&lookup, leaf));
                }
            }
        }
        let mut told = HashSet::new();
        for (column, read) in text.header.columns.iter().zip(&text.columns) {
            let Some(read) = read else { continue };
            let mut wanted = vec![];
            read.leaves(&mut |leaf, _| wanted.extend(seen(&lookup, leaf)));
            let dialect = text.netlist.dialect;
            for item in wanted {
                // Some simulators save everything, and some print from what they have saved.
                let asked = [(0, ".save", dialect.save), (1, ".print", dialect.print)];
                for (print, card, _) in asked.into_iter().filter(|(.., word)| !word.is_empty()) {
                    let ground = item == Seen::Node(NodeId(0));
                    let there = all[print] || ground || items[print].contains(&item);
                    self.compared += 1;
                    if !there && told.insert((card, item)) {
                        self.wrong(card, format!("it leaves out what `{}` reads", column.name));
                    }
                }
            }
        }
    }

    /// Options that change a run.
    fn options(&mut self, ours: &Netlist) {
        let gather = |netlist: &Netlist| {
            let (header, _) = Header::read(&netlist.header);
            let mut options: Vec<(String, String)> = vec![];
            for card in &netlist.cards {
                if let CardKind::Options(given) = &card.kind {
                    options.extend(given.iter().map(|(k, v)| (format!(".options {k}"), v.clone())));
                }
            }
            options.extend(header.options.iter().map(|(k, v)| (format!("header {k}"), v.clone())));
            // The later one wins.
            let last: std::collections::BTreeMap<String, String> = options.into_iter().collect();
            last
        };
        let (mut theirs, ours) = (gather(self.text.netlist), gather(ours));
        // What every text of a dialect says for its simulator's sake says nothing of the model.
        for more in self.text.netlist.dialect.options.1 {
            let (key, value) = more.split_once('=').unwrap_or((more, "1"));
            let key = format!(".options {key}");
            let same = |is: &String| is.parse::<f64>().ok() == value.parse::<f64>().ok();
            if !ours.contains_key(&key) && theirs.get(&key).is_some_and(same) {
                theirs.remove(&key);
            }
        }
        for key in theirs.keys().chain(ours.keys()).collect::<std::collections::BTreeSet<_>>() {
            self.compared += 1;
            let (is, should) = (theirs.get(key), ours.get(key));
            let same = match (is, should) {
                (Some(is), Some(should)) => match (is.parse::<f64>(), should.parse::<f64>()) {
                    (Ok(is), Ok(should)) => is == should,
                    _ => is.eq_ignore_ascii_case(should),
                },
                _ => false,
            };
            if !same {
                let show = |v: Option<&String>| v.map_or("not there".into(), |v| format!("`{v}`"));
                self.wrong(key, format!("it is {}, not {}", show(is), show(should)));
            }
        }
    }
}

/// Where a waveform of the text differs from the bond graph's, at random times and on both sides of every corner.
fn differs(known: &Known, waveform: &Waveform, until: f64, salt: u64) -> Option<String> {
    let Known::Wave(wave) = known else { return Some("it is no waveform".into()) };
    let mut corners = vec![];
    wave.corners(until, &mut corners);
    corners.extend(waveform.corners(0.0, until).take(4 * MOST_SEGMENTS));
    let corners = crate::bond::equations::waveform::merge_corners(corners, until);
    let size = corners
        .iter()
        .flat_map(|t| [wave.value(*t, *t), waveform.value(*t)])
        .filter(|value| value.is_finite())
        .fold(0.0f64, |size, value| size.max(value.abs()));
    let part = |word: u64| (mix(word ^ mix(salt)) >> 11) as f64 / (1u64 << 53) as f64;
    let count = corners.len() - 1;
    let every = count.div_ceil(MOST_SEGMENTS).max(1);
    for k in (0..count).step_by(every) {
        let (a, b) = (corners[k], corners[k + 1]);
        // Corners that both compute may differ by rounding.
        if b - a <= 1e-9 * until {
            continue;
        }
        let inside = 0.5 * (a + b);
        let segment = waveform.segment(inside);
        let random = [0u64, 1, 2].map(|r| a + (b - a) * part(3 * k as u64 + r));
        for t in [a, b, inside].into_iter().chain(random) {
            let (should, is) = (wave.value(t, inside), segment.value(t));
            // A time that is rounded moves the value by its slope.
            let rounding = 2.0 * f64::EPSILON * until;
            let moved = (wave.value(t + rounding, inside) - wave.value(t - rounding, inside)).abs();
            let noise = ULPS * f64::EPSILON * size + 2.0 * moved;
            if (is - should).abs() > noise || is.is_nan() != should.is_nan() {
                return Some(format!("at {t:e} s it is {is:e}, not {should:e}"));
            }
        }
    }
    None
}
