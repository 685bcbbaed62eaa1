//! What a device speaks of: nodes, other devices, models, expressions. Whoever renames or counts them needs no table of
//! devices of its own.

use super::visit::device_mut;
use super::{Device, Element, Expr, Name};

/// Something that a device speaks of.
pub enum Reference<'a> {
    /// The nodes that it stands between.
    Terminals(&'a mut [Name]),
    /// Nodes whose voltage controls it.
    Control(&'a mut [Name]),
    /// A device whose current controls it, or an inductor that it couples.
    Device(&'a mut Name),
    /// Its `.model`.
    Model(&'a mut Name),
    /// A value or a law.
    Expr(&'a mut Expr),
}

impl Device {
    /// Calls `visit` with all that the device speaks of; the name of a subcircuit is its own business.
    pub fn references(&mut self, visit: &mut dyn FnMut(Reference)) {
        visit(Reference::Terminals(&mut self.nodes));
        match &mut self.element {
            Element::Passive(passive) => {
                passive.model.iter_mut().for_each(|model| visit(Reference::Model(model)));
            }
            Element::Mutual { inductors, .. } => {
                inductors.iter_mut().for_each(|inductor| visit(Reference::Device(inductor)));
            }
            Element::Vcvs { control, .. } | Element::Vccs { control, .. } => {
                visit(Reference::Control(control));
            }
            Element::Cccs { control, .. } | Element::Ccvs { control, .. } => {
                visit(Reference::Device(control));
            }
            Element::Switch { model, control, .. } => {
                visit(Reference::Control(control));
                visit(Reference::Model(model));
            }
            Element::CurrentSwitch { model, control, .. } => {
                visit(Reference::Device(control));
                visit(Reference::Model(model));
            }
            Element::LawSwitch { model, .. } | Element::Diode { model, .. } => {
                visit(Reference::Model(model));
            }
            Element::Resistor { .. }
            | Element::Capacitor { .. }
            | Element::Inductor { .. }
            | Element::Charge { .. }
            | Element::Flux { .. }
            | Element::VoltageSource(_)
            | Element::CurrentSource(_)
            | Element::Line { .. }
            | Element::BehaviouralVoltage { .. }
            | Element::BehaviouralCurrent { .. }
            | Element::Instance { .. } => {}
        }
        device_mut(self, &mut |expr| visit(Reference::Expr(expr)));
    }
}
