//! Which subcircuit each card stands in, and which instances stand inlined because they could not be one.
//!
//! A card reads voltages by nodes, which are handed through as terminals, but currents and parameters by names, which
//! end at the edge of a subcircuit. So a card of signals that reads a current inside an instance, or divides by the value
//! of its resistance, moves in there, and its node becomes a terminal: that is how a model's flow is observed from
//! outside, at no cost. What cannot move inlines the instances between.

use super::parts::Part;
use super::tree::Tree;
use crate::netlist::{Name, Names};
use std::collections::HashMap;

/// By part: its subcircuit.
pub type Places = Vec<u32>;

/// Who owns what, before anything is inlined.
pub struct Owners {
    /// The part of each device.
    pub devices: HashMap<Name, usize>,
    /// The instance of each parameter.
    pub parameters: HashMap<Name, u32>,
}

impl Owners {
    /// The subcircuit that a parameter stands in; 0 for those of the file, which are known everywhere.
    fn scope(&self, parameter: Name, tree: &Tree) -> u32 {
        self.parameters.get(&parameter).map_or(0, |owner| tree.scope(*owner))
    }
}

/// Finds a subcircuit for each part, inlining instances until each can be had.
pub fn places(parts: &[Part], owners: &Owners, tree: &mut Tree, names: &Names) -> Places {
    loop {
        let before = tree.inlined.iter().flatten().count();
        let mut places: Places = parts.iter().map(|part| tree.scope(part.mark.home)).collect();
        for (at, part) in parts.iter().enumerate() {
            move_in(at, part, owners, tree, &mut places);
        }
        for (at, part) in parts.iter().enumerate() {
            let here = places[at];
            let what = part.device.map_or("", |device| names.text(device));
            for device in &part.devices {
                let Some(other) = owners.devices.get(device) else { continue };
                let (there, device) = (places[*other], names.text(*device));
                meet(tree, here, there, &format!("{what} reads the current of {device}"));
            }
            for parameter in &part.parameters {
                let there = owners.scope(*parameter, tree);
                // Those of the file are known everywhere.
                if there > 0 {
                    let parameter = names.text(*parameter);
                    meet(tree, here, there, &format!("{what} uses the value of {parameter}"));
                }
            }
        }
        if tree.inlined.iter().flatten().count() == before {
            return places;
        }
    }
}

/// Moves a card of signals to where the one current, or the values, stand that it reads, further in.
fn move_in(at: usize, part: &Part, owners: &Owners, tree: &Tree, places: &mut Places) {
    let here = places[at];
    let theirs = part.devices.iter().filter_map(|device| owners.devices.get(device));
    let values = part.parameters.iter().map(|name| owners.scope(*name, tree));
    let mut there: Vec<u32> = theirs.map(|other| places[*other]).collect();
    there.extend(values.filter(|scope| *scope > 0));
    there.sort_unstable();
    there.dedup();
    let [inner] = there[..] else { return };
    if !part.power && inner != here && tree.within(inner, here) {
        places[at] = inner;
    }
}

/// Inlines what stands between two subcircuits, one of which needs to look into the other.
fn meet(tree: &mut Tree, a: u32, b: u32, why: &str) {
    if a != b {
        let around = tree.common(a, b);
        tree.inline_up_to(a, around, why);
        tree.inline_up_to(b, around, why);
    }
}
