//! Gives every device of a plan its place: a column for each way to ground, a row for each layer above the line.

use super::super::text;
use super::MOST;
use super::alike::{Repeated, gather};
use super::plan::{Part, Shunt, plan};
use super::rows::{self, PAGE};
use super::symbols::{Symbol, symbol, value};
use crate::circuit::{Circuit, DeviceId, NodeId};

/// The length of a device with the wires at its ends, upright and lying.
const HIGH: f64 = 74.0;
const WIDE: f64 = 84.0;
/// Between two layers above the line.
const LAYER: f64 = 54.0;
/// Between two parts.
const GAP: f64 = 34.0;
/// The size of the letters at devices and at nodes.
pub const SIZES: (f64, f64) = (10.5, 9.5);

/// A device between two points, its first node at the first.
#[derive(Clone, Debug)]
pub struct Placed {
    /// Which device.
    pub device: DeviceId,
    /// What stands for it.
    pub symbol: Symbol,
    /// Where its first and its second node are.
    pub ends: ((f64, f64), (f64, f64)),
    /// Its name and value.
    pub words: (String, String),
    /// Its whole name.
    pub name: String,
}

/// All that is drawn.
#[derive(Clone, Debug, Default)]
pub struct Schematic {
    /// What stands above it.
    pub title: String,
    /// Devices.
    pub devices: Vec<Placed>,
    /// Wires.
    pub wires: Vec<((f64, f64), (f64, f64))>,
    /// Where more than two meet.
    pub dots: Vec<(f64, f64)>,
    /// Where ground is.
    pub grounds: Vec<(f64, f64)>,
    /// Names of nodes: left end of their base line.
    pub names: Vec<((f64, f64), String)>,
    /// What is said of parts that repeat: left end of its base line.
    pub repeats: Vec<((f64, f64), String)>,
    /// Devices that are left out.
    pub left_out: usize,
}

/// Places the devices that are kept; of parts that are alike the first.
///
/// # Errors
/// How many devices there are, where they are more than a picture holds.
pub fn place(circuit: &Circuit, keep: &dyn Fn(DeviceId) -> bool) -> Result<Schematic, usize> {
    let mut all = Schematic { title: circuit.title.clone(), ..Schematic::default() };
    let drawn = |k: usize| keep(DeviceId(k as u32));
    all.left_out = (0..circuit.devices.len()).filter(|k| !drawn(*k)).count();
    let (mut left, mut top, mut lowest) = (0.0, 0.0, 0.0_f64);
    let mut parts = vec![];
    for repeated in gather(circuit, plan(circuit, keep, MOST)?) {
        let (mut drawn, mut room) = rows::draw(circuit, &repeated.part);
        if repeated.count > 1 {
            let Repeated { first, last, count, .. } = &repeated;
            let words = format!("{count} alike: {first} … {last}");
            room.0 = room.0.max(text::width(&words, SIZES.0) + 10.0);
            drawn.schematic.repeats.push(((0.0, 0.0), words));
        }
        parts.push((drawn, room));
    }
    let devices = parts.iter().map(|(drawn, _)| drawn.schematic.devices.len()).sum();
    if devices > MOST {
        return Err(devices);
    }
    // A row is as wide as a page, or as the widest part.
    let page = parts.iter().map(|(_, room)| room.0).fold(PAGE, f64::max);
    for (mut drawn, (width, above, below)) in parts {
        if left > 0.0 && left + width > page {
            (left, top) = (0.0, lowest + GAP);
        }
        // Words about a part stand above all of it.
        let words = if drawn.schematic.repeats.is_empty() { 0.0 } else { 1.6 * SIZES.0 };
        drawn.schematic.shift(left, top + above + words);
        drawn.schematic.repeats.iter_mut().for_each(|(at, _)| at.1 = top + SIZES.0);
        let above = above + words;
        lowest = lowest.max(top + above + below);
        left += width + GAP;
        all.take(drawn.schematic);
    }
    Ok(all)
}

impl Schematic {
    pub(super) fn shift(&mut self, x: f64, y: f64) {
        let shift = |p: &mut (f64, f64)| *p = (p.0 + x, p.1 + y);
        self.devices.iter_mut().for_each(|d| {
            shift(&mut d.ends.0);
            shift(&mut d.ends.1);
        });
        self.wires.iter_mut().for_each(|w| {
            shift(&mut w.0);
            shift(&mut w.1);
        });
        self.dots.iter_mut().chain(&mut self.grounds).for_each(shift);
        self.names.iter_mut().chain(&mut self.repeats).for_each(|(at, _)| shift(at));
    }

    pub(super) fn take(&mut self, other: Schematic) {
        self.devices.extend(other.devices);
        self.wires.extend(other.wires);
        self.dots.extend(other.dots);
        self.grounds.extend(other.grounds);
        self.names.extend(other.names);
        self.repeats.extend(other.repeats);
    }
}

/// A part in the making, its line at y = 0.
pub(super) struct Drawn<'a> {
    circuit: &'a Circuit,
    pub(super) schematic: Schematic,
    /// Where each node of the line begins and ends.
    pub(super) places: Vec<(f64, f64)>,
}

impl<'a> Drawn<'a> {
    pub(super) fn new(circuit: &'a Circuit) -> Drawn<'a> {
        Drawn { circuit, schematic: Schematic::default(), places: vec![] }
    }

    fn name(&self, node: NodeId) -> &str {
        self.circuit.nodes.get(node.0 as usize).map_or("", |node| &*node.name)
    }

    fn words(&self, device: DeviceId) -> (String, String) {
        let device = &self.circuit.devices[device.0 as usize];
        (text::cut(&device.name, 24), value(self.circuit, device))
    }

    /// The wider of the two lines beside a device.
    fn width(&self, device: DeviceId) -> f64 {
        let (name, value) = self.words(device);
        text::width(&name, SIZES.0).max(text::width(&value, SIZES.0))
    }

    /// Puts a device between two places; `from` is the node at the first.
    fn device(&mut self, device: DeviceId, from: NodeId, first: (f64, f64), second: (f64, f64)) {
        let own = &self.circuit.devices[device.0 as usize];
        let ends = if own.nodes.first() == Some(&from) { (first, second) } else { (second, first) };
        let words = self.words(device);
        let (symbol, name) = (symbol(own), own.name.to_string());
        self.schematic.devices.push(Placed { device, symbol, ends, words, name });
    }

    pub(super) fn wire(&mut self, a: (f64, f64), b: (f64, f64)) {
        if a != b {
            self.schematic.wires.push((a, b));
        }
    }

    /// Draws a part with its line at y = 0; gives its width and how far it reaches above and below.
    pub(super) fn part(&mut self, part: &Part) -> (f64, f64, f64) {
        let depth = part.line.iter().flat_map(|(_, s)| s).map(depth).max().unwrap_or(0);
        let bottom = HIGH * depth as f64;
        // From left to right: the ways to ground of a node, then what stands between it and the next.
        let mut places: Vec<(f64, f64)> = vec![];
        let mut x: f64 = 0.0;
        let mut feet = vec![];
        // Where what stands between two nodes ends.
        let mut before: Option<f64> = None;
        for (k, (node, shunts)) in part.line.iter().enumerate() {
            let start = if shunts.is_empty() { x } else { x + 14.0 };
            let mut last = start;
            if let Some(end) = before.take() {
                self.wire((end, 0.0), (start, 0.0));
            }
            for (s, shunt) in shunts.iter().enumerate() {
                let left = if s == 0 { x } else { x + 22.0 };
                let (axis, right) = self.shunt(shunt, *node, left, 0.0, bottom, &mut feet);
                self.wire((last, 0.0), (axis, 0.0));
                if s + 1 < shunts.len() || s > 0 {
                    self.schematic.dots.push((axis, 0.0));
                }
                last = axis;
                x = right;
            }
            let direct: Vec<DeviceId> =
                part.spans.iter().filter(|s| s.ends == (k, k + 1)).map(|s| s.device).collect();
            let name = text::width(self.name(*node), SIZES.1);
            // The node's name stands on the line, left of what follows.
            let end = last + 8.0 + name;
            x = x.max(end);
            places.push((start, last));
            self.schematic.names.push(((last + 5.0, -5.0), self.name(*node).to_string()));
            if k + 1 < part.line.len() {
                // Words of what lies keep clear of those of what hangs before it.
                let text = direct.first().map_or(0.0, |d| self.width(*d));
                let wide = WIDE.max(text + 20.0);
                let words = if shunts.is_empty() { end } else { x + (text - wide) / 2.0 + 6.0 };
                let from = end.max(words);
                x = from + wide;
                if let Some(device) = direct.first() {
                    self.wire((last, 0.0), (from, 0.0));
                    self.device(*device, *node, (from, 0.0), (x, 0.0));
                    before = Some(x);
                }
            }
        }
        let above = self.layers(part, &places);
        self.feet(feet, bottom);
        self.places = places;
        (x + 10.0, above, bottom + 24.0)
    }

    /// What bridges: each in the lowest layer in which nothing else stands above the same nodes.
    fn layers(&mut self, part: &Part, places: &[(f64, f64)]) -> f64 {
        let mut taken: Vec<Vec<(usize, usize)>> = vec![];
        let mut direct = vec![false; places.len()];
        let mut rest: Vec<_> = part.spans.iter().collect();
        rest.sort_by_key(|span| span.ends.1 - span.ends.0);
        let mut rises: Vec<(usize, usize)> = vec![];
        for span in rest {
            let (a, b) = span.ends;
            if b == a + 1 && !std::mem::replace(&mut direct[a], true) {
                continue;
            }
            let free = |layer: &Vec<(usize, usize)>| layer.iter().all(|(p, q)| *q <= a || b <= *p);
            // A riser would run through what stands lower.
            let lowest = taken.iter().rposition(|layer| !free(layer)).map_or(0, |at| at + 1);
            if lowest == taken.len() {
                taken.push(vec![]);
            }
            taken[lowest].push((a, b));
            let y = -LAYER * (lowest + 1) as f64;
            let (left, right) = (places[a].1, places[b].0);
            let middle = (left + right) / 2.0;
            let half = WIDE / 2.0;
            self.wire((left, y), (middle - half, y));
            self.device(span.device, part.line[a].0, (middle - half, y), (middle + half, y));
            self.wire((middle + half, y), (right, y));
            rises.extend([(a, lowest), (b, lowest)]);
            for x in [left, right] {
                self.schematic.dots.push((x, 0.0));
            }
        }
        for (node, layer) in &rises {
            let y = -LAYER * (*layer + 1) as f64;
            let right = |span: &&super::plan::Span| span.ends.0 == *node && span.ends.1 > *node;
            let leaves = part.spans.iter().any(|s| right(&s));
            let x = if leaves { places[*node].1 } else { places[*node].0 };
            for x in [x, places[*node].0, places[*node].1] {
                // Where a bridge ends at this height over this node, its riser goes down to the line.
                let ends = self.schematic.wires.iter().any(|(p, q)| *p == (x, y) || *q == (x, y));
                let ends = ends
                    || self
                        .schematic
                        .devices
                        .iter()
                        .any(|d| d.ends.0 == (x, y) || d.ends.1 == (x, y));
                if ends && !self.schematic.wires.contains(&((x, y), (x, 0.0))) {
                    self.wire((x, y), (x, 0.0));
                }
            }
        }
        LAYER * taken.len() as f64 + 34.0
    }

    /// Draws a way to ground downward from (x, y); gives its axis and its right edge.
    fn shunt(
        &mut self,
        shunt: &Shunt,
        from: NodeId,
        left: f64,
        top: f64,
        bottom: f64,
        feet: &mut Vec<f64>,
    ) -> (f64, f64) {
        let axis = left + 14.0;
        let below = top + HIGH;
        self.device(shunt.device, from, (axis, top), (axis, below));
        let mut right = axis + 20.0 + self.width(shunt.device);
        match &shunt.behind {
            None => {
                self.wire((axis, below), (axis, bottom));
                feet.push(axis);
            }
            Some((node, behind)) => {
                let name = self.name(*node).to_string();
                right = right.max(axis + 8.0 + text::width(&name, SIZES.1));
                self.schematic.names.push(((axis + 5.0, below - 3.0), name));
                let mut last = axis;
                for (k, next) in behind.iter().enumerate() {
                    let left = if k == 0 { left } else { right + 12.0 };
                    let (own, edge) = self.shunt(next, *node, left, below, bottom, feet);
                    self.wire((last, below), (own, below));
                    if k > 0 {
                        self.schematic.dots.extend([(last, below)]);
                    }
                    last = own;
                    right = right.max(edge);
                }
            }
        }
        (axis, right)
    }

    /// The common return, and ground below its first foot.
    fn feet(&mut self, mut feet: Vec<f64>, bottom: f64) {
        feet.sort_by(f64::total_cmp);
        for pair in feet.windows(2) {
            self.wire((pair[0], bottom), (pair[1], bottom));
        }
        let inner = feet.len().saturating_sub(1);
        for x in feet.iter().take(inner).skip(1) {
            self.schematic.dots.push((*x, bottom));
        }
        if let Some(first) = feet.first() {
            self.schematic.grounds.push((*first, bottom));
        }
    }
}

/// How many devices a way to ground is long.
fn depth(shunt: &Shunt) -> usize {
    1 + shunt.behind.iter().flat_map(|(_, behind)| behind).map(depth).max().unwrap_or(0)
}
