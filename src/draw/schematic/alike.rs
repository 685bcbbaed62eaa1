//! Parts of a circuit that repeat: the same devices with the same values, joined in the same way, whose names differ in
//! one number alone (`R_eha_1_motor_R`, `R_eha_2_motor_R`). Such parts are drawn once.

use super::plan::{Part, Shunt};
use crate::circuit::{Circuit, DeviceId, NodeId};

/// A part, and the numbers of those that are like it.
pub struct Repeated {
    /// The first of them.
    pub part: Part,
    /// What tells the first from the others, in words; and how many others there are.
    pub first: String,
    /// The same of the last one.
    pub last: String,
    /// How many there are, the first counted.
    pub count: usize,
}

/// Gathers parts that are alike, in the order of their first ones.
pub fn gather(circuit: &Circuit, parts: Vec<Part>) -> Vec<Repeated> {
    let mut found: Vec<(Repeated, Portrait)> = vec![];
    for part in parts {
        let own = Portrait::of(circuit, &part);
        let like = found.iter_mut().find_map(|(repeated, first)| {
            let (a, b) = first.differs(&own)?;
            Some((repeated, a, b))
        });
        match like {
            Some((repeated, a, b)) => {
                (repeated.first, repeated.last) = (a, b);
                repeated.count += 1;
            }
            None => {
                let (first, last) = (String::new(), String::new());
                found.push((Repeated { part, first, last, count: 1 }, own));
            }
        }
    }
    found.into_iter().map(|(repeated, _)| repeated).collect()
}

/// A part as text, without names; and all names in it.
struct Portrait {
    shape: String,
    names: Vec<String>,
}

impl Portrait {
    fn of(circuit: &Circuit, part: &Part) -> Portrait {
        let mut own = Portrait { shape: String::new(), names: vec![] };
        for (node, shunts) in &part.line {
            own.node(circuit, *node);
            own.shunts(circuit, shunts);
            own.shape.push('|');
        }
        for span in &part.spans {
            own.shape += &format!("{:?}", span.ends);
            own.device(circuit, span.device);
        }
        own
    }

    fn shunts(&mut self, circuit: &Circuit, shunts: &[Shunt]) {
        for shunt in shunts {
            self.shape.push('(');
            self.device(circuit, shunt.device);
            if let Some((node, behind)) = &shunt.behind {
                self.node(circuit, *node);
                self.shunts(circuit, behind);
            }
            self.shape.push(')');
        }
    }

    fn node(&mut self, circuit: &Circuit, node: NodeId) {
        let name = circuit.nodes.get(node.0 as usize).map_or("?", |node| &*node.name);
        self.names.push(name.to_string());
        self.shape.push('n');
    }

    fn device(&mut self, circuit: &Circuit, id: DeviceId) {
        let Some(device) = circuit.devices.get(id.0 as usize) else { return };
        self.names.push(device.name.to_string());
        // In which direction it stands, and its law: numbers as they are, other nodes and devices by name. The debugging
        // text holds every field that a kind of device has or will have.
        for node in &device.nodes {
            self.node(circuit, *node);
        }
        let law = without_places(&format!("{:?}", device.kind));
        let mut rest = law.as_str();
        while let Some(at) = rest.find("Id(") {
            let (before, from) = rest.split_at(at + 3);
            self.shape += before;
            let digits = from.find(|c: char| !c.is_ascii_digit()).unwrap_or(from.len());
            let number: u32 = from[..digits].parse().unwrap_or(u32::MAX);
            if before.ends_with("NodeId(") {
                self.node(circuit, NodeId(number));
            } else {
                let other = circuit.devices.get(number as usize).map_or("?", |d| &*d.name);
                self.names.push(other.to_string());
            }
            rest = &from[digits..];
        }
        self.shape += rest;
    }

    /// The two names of the instances that two parts are of, where nothing else differs.
    fn differs(&self, other: &Portrait) -> Option<(String, String)> {
        if self.shape != other.shape || self.names.len() != other.names.len() {
            return None;
        }
        let mut pair: Option<(&str, &str)> = None;
        let mut told = None;
        for (a, b) in self.names.iter().zip(&other.names) {
            let (own, theirs): (Vec<&str>, Vec<&str>) = (pieces(a), pieces(b));
            if own.len() != theirs.len() {
                return None;
            }
            for (k, (x, y)) in own.iter().zip(&theirs).enumerate() {
                if x == y {
                    continue;
                }
                let number = |text: &str| text.bytes().all(|b| b.is_ascii_digit());
                if !number(x) || !number(y) || *pair.get_or_insert((x, y)) != (*x, *y) {
                    return None;
                }
                if told.is_none() {
                    let name = |name: &str, own: &[&str]| {
                        let end: usize = own[..=k].iter().map(|p| p.len() + 1).sum::<usize>() - 1;
                        name[..end].to_string()
                    };
                    told = Some((name(a, &own), name(b, &theirs)));
                }
            }
        }
        told
    }
}

/// A text without the places in files that are told in it.
fn without_places(text: &str) -> String {
    let mut parts = text.split("Span {");
    let mut found = parts.next().unwrap_or("").to_string();
    parts.for_each(|part| found += part.split_once('}').map_or("", |(_, rest)| rest));
    found
}

/// A name at its marks: `eha_1_motor` and `eha[1].motor` both have a 1 of their own.
fn pieces(name: &str) -> Vec<&str> {
    name.split(['_', '.', '[', ']', ':']).collect()
}
