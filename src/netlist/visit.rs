//! Every expression of a card, for what has to look at or change all of them.

use super::{Card, CardKind, Device, Element, Expr, MeasureKind, Source, Waveform};

/// Calls `visit` for each expression of a card, but not of the cards within a subcircuit or a choice.
pub fn expressions_mut(card: &mut Card, visit: &mut dyn FnMut(&mut Expr)) {
    match &mut card.kind {
        CardKind::Device(device) => device_mut(device, visit),
        CardKind::Parameters(values) | CardKind::Initial(values) | CardKind::Guess(values) => {
            values.iter_mut().for_each(|(_, value)| visit(value));
        }
        CardKind::Subcircuit(subcircuit) => {
            subcircuit.parameters.iter_mut().for_each(|(_, value)| visit(value));
        }
        CardKind::Choice(branches) => {
            branches.iter_mut().filter_map(|branch| branch.condition.as_mut()).for_each(visit);
        }
        CardKind::Model { parameters, .. } => {
            parameters.iter_mut().for_each(|(_, value)| visit(value));
        }
        CardKind::Save { items, .. } => items.iter_mut().for_each(|(_, value)| visit(value)),
        CardKind::Transient { step, stop, start, hmax, .. } => {
            visit(step);
            visit(stop);
            start.iter_mut().chain(hmax.iter_mut()).for_each(visit);
        }
        CardKind::Fourier(fourier) => {
            visit(&mut fourier.frequency);
            fourier.items.iter_mut().for_each(|(_, value)| visit(value));
        }
        CardKind::Measure(measure) => measure_mut(&mut measure.kind, visit),
        CardKind::Analysis(analysis) => super::analysis::expressions_mut(analysis, visit),
        CardKind::Step(sweeps) => super::analysis::sweeps_mut(sweeps, visit),
        CardKind::Data(data) => data.values.iter_mut().for_each(visit),
        CardKind::Function(_)
        | CardKind::Global(_)
        | CardKind::Options(_)
        | CardKind::OperatingPoint
        | CardKind::Comment(_) => {}
    }
}

fn measure_mut(kind: &mut MeasureKind, visit: &mut dyn FnMut(&mut Expr)) {
    let visit = std::cell::RefCell::new(visit);
    let changed = |expr: &Expr| {
        let mut expr = expr.clone();
        visit.borrow_mut()(&mut expr);
        Some(expr)
    };
    if let Some(changed) = kind.try_map(&mut &changed, &mut &changed) {
        *kind = changed;
    }
}

fn source_mut(source: &mut Source, visit: &mut dyn FnMut(&mut Expr)) {
    match &mut source.waveform {
        Waveform::Constant(value) => visit(value),
        Waveform::Function { arguments, .. } => arguments.iter_mut().for_each(&mut *visit),
        Waveform::Points { points, repeat, delay } => {
            points.iter_mut().chain(repeat).chain(delay).for_each(&mut *visit);
        }
        Waveform::Pattern { arguments, repeat, .. } => {
            arguments.iter_mut().chain(repeat).for_each(&mut *visit);
        }
    }
    source.dc.iter_mut().chain(source.ac.iter_mut().flatten()).for_each(visit);
}

/// The same for each of a device.
pub(super) fn device_mut(device: &mut Device, visit: &mut dyn FnMut(&mut Expr)) {
    match &mut device.element {
        Element::Resistor { value } => visit(value),
        Element::Capacitor { value, initial } | Element::Inductor { value, initial } => {
            visit(value);
            initial.iter_mut().for_each(visit);
        }
        Element::Mutual { coupling, .. } => visit(coupling),
        Element::VoltageSource(source) | Element::CurrentSource(source) => {
            source_mut(source, visit);
        }
        Element::Vcvs { gain, .. }
        | Element::Vccs { gain, .. }
        | Element::Cccs { gain, .. }
        | Element::Ccvs { gain, .. } => visit(gain),
        Element::Line { impedance, delay, initial } => {
            visit(impedance);
            visit(delay);
            initial.iter_mut().flat_map(|values| values.iter_mut()).for_each(visit);
        }
        Element::BehaviouralVoltage { law } | Element::BehaviouralCurrent { law } => visit(law),
        Element::Charge { law, initial } | Element::Flux { law, initial } => {
            visit(law);
            initial.iter_mut().for_each(visit);
        }
        Element::Passive(passive) => {
            passive.value.iter_mut().chain(&mut passive.initial).for_each(&mut *visit);
            passive.parameters.iter_mut().for_each(|(_, value)| visit(value));
        }
        Element::LawSwitch { control, .. } => visit(control),
        Element::Switch { .. } | Element::CurrentSwitch { .. } => {}
        Element::Diode { area, parameters, .. } => {
            area.iter_mut().for_each(&mut *visit);
            parameters.iter_mut().for_each(|(_, value)| visit(value));
        }
        Element::Instance { parameters, .. } => {
            parameters.iter_mut().for_each(|(_, value)| visit(value));
        }
    }
}
