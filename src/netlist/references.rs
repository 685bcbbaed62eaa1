//! What a device speaks of: nodes, other devices, models, expressions. Whoever renames or counts them needs no table of
//! devices of its own.

use super::{Device, Element, Expr, Name, Source, Waveform};

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
            Element::Resistor { value } => visit(Reference::Expr(value)),
            Element::Capacitor { value, initial } | Element::Inductor { value, initial } => {
                visit(Reference::Expr(value));
                initial.iter_mut().for_each(|initial| visit(Reference::Expr(initial)));
            }
            Element::Mutual { inductors, coupling } => {
                inductors.iter_mut().for_each(|inductor| visit(Reference::Device(inductor)));
                visit(Reference::Expr(coupling));
            }
            Element::VoltageSource(source) | Element::CurrentSource(source) => {
                self::source(source, visit);
            }
            Element::Vcvs { gain, control } | Element::Vccs { gain, control } => {
                visit(Reference::Control(control));
                visit(Reference::Expr(gain));
            }
            Element::Cccs { gain, control } | Element::Ccvs { gain, control } => {
                visit(Reference::Device(control));
                visit(Reference::Expr(gain));
            }
            Element::Line { impedance, delay, initial } => {
                visit(Reference::Expr(impedance));
                visit(Reference::Expr(delay));
                initial.iter_mut().flatten().for_each(|initial| visit(Reference::Expr(initial)));
            }
            Element::BehaviouralVoltage { law } | Element::BehaviouralCurrent { law } => {
                visit(Reference::Expr(law));
            }
            Element::Switch { model, control, .. } => {
                visit(Reference::Control(control));
                visit(Reference::Model(model));
            }
            Element::CurrentSwitch { model, control, .. } => {
                visit(Reference::Device(control));
                visit(Reference::Model(model));
            }
            Element::Diode { model, area } => {
                visit(Reference::Model(model));
                area.iter_mut().for_each(|area| visit(Reference::Expr(area)));
            }
            Element::Instance { parameters, .. } => {
                parameters.iter_mut().for_each(|(_, value)| visit(Reference::Expr(value)));
            }
        }
    }
}

fn source(source: &mut Source, visit: &mut dyn FnMut(Reference)) {
    match &mut source.waveform {
        Waveform::Constant(value) => visit(Reference::Expr(value)),
        Waveform::Function { arguments, .. } => {
            arguments.iter_mut().for_each(|argument| visit(Reference::Expr(argument)));
        }
    }
    source.dc.iter_mut().for_each(|value| visit(Reference::Expr(value)));
    source.ac.iter_mut().flatten().for_each(|value| visit(Reference::Expr(value)));
}
