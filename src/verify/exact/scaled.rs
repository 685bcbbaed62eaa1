//! A graph whose domains are scaled against the same graph as it was: with e = s·e' and f = f'/s in each scaled domain, s
//! a random number as any other parameter, every effort, flow, signal and law must be the same.

use super::bonds::{Alike, Bonds, Place};
use super::compare::{Drawn, Nothing, solution};
use super::draw::{Draw, Modular};
use crate::bond::graph::{BondGraph, Power, SignalId, SignalLaw, SignalOrigin};
use crate::verify::report::Mismatch;

/// One draw: both graphs' equations solved, and everything that must be equal compared.
///
/// # Errors
/// Why there is nothing to compare.
pub fn draw<F: Modular>(
    plain: &BondGraph,
    scaled: &BondGraph,
    draw: Draw,
) -> Result<Drawn, Nothing> {
    let ours = Bonds::<F>::new(plain, draw, &[], Alike::default())?;
    let theirs = Bonds::<F>::of_scaled(scaled, draw)?;
    let ((x, once), (y, twice)) = (solution(&ours)?, solution(&theirs)?);
    let operations = once + twice;
    let mut drawn = Drawn { unknowns: [x.len(), y.len()], operations, ..Drawn::default() };
    for bond in plain.bond_ids() {
        for power in [Power::Effort, Power::Flow] {
            drawn.variables += 1;
            let unscaled = theirs.power(bond, power).at(&y) * theirs.factor(bond, power);
            if ours.power(bond, power).at(&x) != unscaled {
                let letter = if power == Power::Effort { 'e' } else { 'f' };
                differs(&mut drawn, &format!("{letter}({})", plain.bond_name(bond)));
            }
        }
    }
    for (k, signal) in plain.signals.iter().enumerate() {
        let id = SignalId(k as u32);
        let mut same = ours.signal(id).at(&x) == theirs.signal(id).at(&y);
        match (&signal.law, &scaled.signals[k].law) {
            (SignalLaw::Memory { input, .. }, SignalLaw::Memory { input: scaled, .. }) => {
                same &= ours.value(input, None, &x)? == theirs.value(scaled, None, &y)?;
            }
            (SignalLaw::Waveform(plain), SignalLaw::Waveform(scaled)) => {
                same &= format!("{plain:?}") == format!("{scaled:?}")
            }
            _ => {}
        }
        drawn.variables += usize::from(signal.origin != SignalOrigin::Hidden);
        if !same {
            differs(&mut drawn, &signal.name);
        }
    }
    for (plain, scaled) in plain.experiment.observe.iter().zip(&scaled.experiment.observe) {
        drawn.variables += 1;
        let is = theirs.value(&scaled.expr, None, &y)?;
        if ours.value(&plain.expr, None, &x)? != is || plain.unit != scaled.unit {
            differs(&mut drawn, &format!("column {}", plain.name));
        }
    }
    // The laws, and what they were cut to, differ by the same factor.
    for (place, cut) in ours.cuts.iter().filter(|(_, cut)| !cut.offset.is_zero()) {
        drawn.laws += 1;
        let Some(scaled) = theirs.cuts.get(place) else {
            differs_law(&mut drawn, plain, *place);
            continue;
        };
        let is = theirs.value(&scaled.law, scaled.own, &y)?;
        let should = ours.value(&cut.law, cut.own, &x)?;
        if is * cut.offset != should * scaled.offset {
            differs_law(&mut drawn, plain, *place);
        }
    }
    for ((plain, own, number), (scaled, _, scaled_number)) in ours.moduli.iter().zip(&theirs.moduli)
    {
        drawn.laws += 1;
        let is = theirs.value(scaled, Some(*own), &y)?;
        let should = ours.value(plain, Some(*own), &x)?;
        if is * *number != should * *scaled_number {
            let name = &ours.graph.vertex(*own).name;
            drawn.wrong_laws.push(Mismatch::of(name, "its modulus is not the scaled one"));
        }
    }
    Ok(drawn)
}

fn differs(drawn: &mut Drawn, name: &str) {
    drawn.mismatches.push(Mismatch::of(name, "the scaled bond graph gives it another value"));
}

fn differs_law(drawn: &mut Drawn, graph: &BondGraph, place: Place) {
    let name = match place {
        Place::Port(end) => graph.end_name(end),
        Place::Signal(id) => graph.signals[id.index()].name.clone(),
    };
    drawn.wrong_laws.push(Mismatch::of(&name, "its law is not the scaled one"));
}
