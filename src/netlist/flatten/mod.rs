//! From cards to the flat circuit: subcircuits expanded, parameters and models become numbers, names become indices.
//!
//! Two passes. The first walks the cards and the bodies of instances, makes the nodes that devices stand between, and
//! numbers the devices; the second, when every name is known, says what each device is.

pub mod scope;
pub mod expand;
mod copies;
pub mod values;
mod kinds;
mod models;
mod passive;
mod patterns;
mod sources;
mod operators;
mod transfer;
mod analyses;
mod experiment;
mod guess;
mod measures;
mod sensitivity;
mod usage;
pub mod vary;

use super::{Netlist, header::Header};
use crate::circuit::Circuit;
use crate::diagnostic::{Diagnostic, has_errors};
use crate::source::Span;
use measures::Taken;
pub use vary::Variation;

/// The circuit of a netlist; `None` when there were errors.
pub fn flatten(netlist: &Netlist, diagnostics: &mut Vec<Diagnostic>) -> Option<Circuit> {
    flatten_with(netlist, &Variation::default(), diagnostics)
}

/// The circuit of a netlist with other values in some places.
pub fn flatten_with(
    netlist: &Netlist,
    variation: &Variation,
    diagnostics: &mut Vec<Diagnostic>,
) -> Option<Circuit> {
    let before = diagnostics.len();
    let (header, strange) = Header::read(&netlist.header);
    for line in strange {
        let message = format!("`*bondspice {line}` is not understood");
        diagnostics.push(Diagnostic::warning("W0730", Span::NONE, message));
    }
    let mut flat = beside_usage(netlist, &header, variation, diagnostics);
    let (analyses, options) = experiment::settings(&flat, &header, &variation.options, diagnostics);
    let steps = analyses::steps(&flat, diagnostics);
    let picked = variation.analysis.as_deref();
    let run = analyses
        .iter()
        .rev()
        .find(|analysis| picked.is_none_or(|picked| picked == analysis.name()));
    let mut times = sources::Times::of(&analyses);
    times.zero_is_jump = flat.zero_is_jump();
    flat.times = times;
    experiment::temperatures(&mut flat, &options, diagnostics);
    if let Some(temperature) = variation.temperature {
        flat.temperature = temperature;
    }
    flat.following = experiment::smoothing(&options, diagnostics);
    flat.join();
    let mut devices = kinds::resolve(&flat, &header, times, diagnostics);
    let guesses = experiment::guesses(&flat, diagnostics);
    let starts = guess::follow(&devices, flat.nodes.len(), &guesses);
    let (outputs, initial) = experiment::readings(&flat, &header, run, diagnostics);
    let Taken { measures, harmonics, watched } = measures::resolve(&flat, diagnostics);
    devices.extend(flat.quantities.take());
    let mut circuit = Circuit {
        title: netlist.title.clone(),
        nodes: flat.nodes,
        devices,
        initial,
        guesses,
        starts,
        initial_holds: netlist.dialect.reading().initial_holds,
        analyses,
        steps,
        outputs,
        measures,
        harmonics,
        watched,
        options,
        grid: header.grid,
        ..Circuit::default()
    };
    experiment::scales(&mut circuit, &header, diagnostics);
    (!has_errors(&diagnostics[before..])).then_some(circuit)
}

/// Above so many cards nodes that are named only once are looked for by a thread of its own.
const LARGE: usize = 50_000;

/// The expanded netlist, after what is said of nodes named only once.
fn beside_usage<'n>(
    netlist: &'n Netlist,
    header: &Header,
    variation: &'n Variation,
    diagnostics: &mut Vec<Diagnostic>,
) -> expand::Flat<'n> {
    let usage = || {
        let mut said = vec![];
        usage::check(netlist, header, &mut said);
        said
    };
    if netlist.cards.len() < LARGE {
        diagnostics.extend(usage());
        return expand::expand_with(netlist, variation, diagnostics);
    }
    std::thread::scope(|scope| {
        let beside = std::thread::Builder::new().spawn_scoped(scope, usage);
        let mut found = vec![];
        let flat = expand::expand_with(netlist, variation, &mut found);
        // Where there is no thread to be had, one does both.
        let said = beside.ok().and_then(|thread| thread.join().ok());
        diagnostics.extend(said.unwrap_or_else(usage));
        diagnostics.append(&mut found);
        flat
    })
}

#[cfg(test)]
mod tests;
