//! Every expression of a card, for what has to look at or change all of them.

use super::references::Reference;
use super::{Card, CardKind, Expr, MeasureKind};

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
