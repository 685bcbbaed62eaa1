//! Instances that stand for several in parallel: `X1 a b part m=3`.
//!
//! One instance is laid flat, and its terminals take up as much as all of them would.

use super::expand::{Expander, Flat};
use super::scope::{self, ScopeId};
use crate::circuit::{self, DeviceId, NodeId};
use crate::diagnostic::Diagnostic;
use crate::netlist::{Card, Device, Expr, Name, Subcircuit};

/// The key of an X card that says how many instances stand in parallel.
pub const COPIES: &str = "m";

impl Expander<'_> {
    /// What an instance that stands for several takes up at a global node is not known from its terminals.
    pub(super) fn refuse_globals(
        &self,
        id: ScopeId,
        card: &Card,
        device: &Device,
        d: &mut Vec<Diagnostic>,
    ) {
        let scope = self.flat.scopes.get(id);
        let inside = |name: &Name| scope.node(*name).is_some_and(|node| node.0 != 0);
        let global = |name: &&Name| {
            self.flat.scopes.globals.contains_key(name)
                && Some(**name) != self.ground
                && !inside(name)
        };
        let Some(name) = device.nodes.iter().find(global) else { return };
        let text = self.flat.netlist.names.text(*name);
        let message = format!("`{text}` is global, and several instances stand here (`m=`)");
        let error = Diagnostic::error("E0775", card.span, message)
            .because("what they take up there cannot be told")
            .help(format!("make `{text}` a terminal of the subcircuit"));
        if d.len() < 1000 && !d.contains(&error) {
            d.push(error);
        }
    }

    /// How many copies of a subcircuit an instance is, where `m=` says another number than 1 and is no parameter of it.
    pub(super) fn copies(
        &self,
        id: ScopeId,
        card: &Card,
        subcircuit: &Subcircuit,
        parameters: &[(Name, Expr)],
        d: &mut Vec<Diagnostic>,
    ) -> Option<f64> {
        let names = &self.flat.netlist.names;
        let own = |name: &Name| names.text(*name).eq_ignore_ascii_case(COPIES);
        let (name, expr) = parameters.iter().find(|(name, _)| own(name))?;
        if subcircuit.parameters.iter().any(|(own, _)| own == name) {
            return None;
        }
        let copies = scope::number(&self.flat.scopes, id, expr, names, d)?;
        if !(copies > 0.0 && copies.is_finite()) {
            let message = format!("`m={copies}` is no number of instances");
            d.push(Diagnostic::error("E0775", card.span, message).help("it is above 0"));
            return None;
        }
        (copies != 1.0).then_some(copies)
    }
}

/// A terminal of an instance that stands for several in parallel: what it takes up is taken up as often.
pub struct Joint<'n> {
    /// The instance and its terminal.
    pub name: String,
    /// Outside, and within the one instance that is there.
    pub nodes: [NodeId; 2],
    /// How many there are.
    pub copies: f64,
    /// The instance.
    pub card: &'n Card,
}

impl Flat<'_> {
    /// Makes devices of the joints: a source of 0 V senses the current of one instance, and what the others take up flows
    /// to the ground, where all that enters an instance leaves it in the end.
    pub fn join(&self) {
        for joint in &self.joints {
            let mut made = self.quantities.borrow_mut();
            let sense = DeviceId((self.devices.len() + made.len()) as u32);
            let [outer, inner] = joint.nodes;
            let constant = circuit::Waveform::Constant(0.0);
            let device = |name: String, nodes: [NodeId; 2], kind| circuit::Device {
                name: name.into(),
                nodes: nodes.as_slice().into(),
                kind,
                nominal: None,
                span: joint.card.span,
            };
            let parts = circuit::Parts::default();
            let kind = circuit::DeviceKind::VoltageSource {
                waveform: Box::new(constant),
                parts: Box::new(parts),
            };
            made.push(device(joint.name.clone(), [outer, inner], kind));
            let kind = circuit::DeviceKind::Cccs { gain: joint.copies - 1.0, control: sense };
            made.push(device(format!("{}#others", joint.name), [outer, NodeId(0)], kind));
        }
    }
}
