//! Every expression of a card, for what has to look at or change all of them.

use super::analysis::{Analysis, Points, Sweep};
use super::references::Reference;
use super::{Card, CardKind, Expr};

/// Calls `visit` for each expression of a card, but not of the cards within a subcircuit or a choice.
pub fn expressions_mut(card: &mut Card, visit: &mut dyn FnMut(&mut Expr)) {
    match &mut card.kind {
        CardKind::Device(device) => device.references(&mut |reference| {
            if let Reference::Expr(expr) = reference {
                visit(expr);
            }
        }),
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
        CardKind::Analysis(analysis) => analysis_mut(analysis, visit),
        CardKind::Step(sweeps) => sweeps.iter_mut().for_each(|sweep| sweep_mut(sweep, visit)),
        CardKind::Data(data) => data.values.iter_mut().for_each(visit),
        CardKind::Function(_)
        | CardKind::Global(_)
        | CardKind::Options(_)
        | CardKind::OperatingPoint
        | CardKind::Comment(_) => {}
    }
}

fn analysis_mut(analysis: &mut Analysis, visit: &mut dyn FnMut(&mut Expr)) {
    match analysis {
        Analysis::Dc(sweeps) => sweeps.iter_mut().for_each(|sweep| sweep_mut(sweep, visit)),
        Analysis::Ac(points) => points_mut(points, visit),
        Analysis::Transfer { output, .. } => visit(&mut output.1),
        Analysis::PoleZero { .. } => {}
        Analysis::Fourier { frequency, items } => {
            visit(frequency);
            items.iter_mut().for_each(|(_, item)| visit(item));
        }
        Analysis::Sensitivity { items, frequencies } => {
            items.iter_mut().for_each(|(_, item)| visit(item));
            frequencies.iter_mut().for_each(|points| points_mut(points, visit));
        }
    }
}

fn sweep_mut(sweep: &mut Sweep, visit: &mut dyn FnMut(&mut Expr)) {
    match sweep {
        Sweep::Quantity { points, .. } => points_mut(points, visit),
        Sweep::Table { .. } => {}
    }
}

fn points_mut(points: &mut Points, visit: &mut dyn FnMut(&mut Expr)) {
    match points {
        Points::Linear(values)
        | Points::Count(values)
        | Points::Decade(values)
        | Points::Octave(values) => values.iter_mut().for_each(visit),
        Points::List(values) => values.iter_mut().for_each(visit),
        Points::Table(_) => {}
    }
}
