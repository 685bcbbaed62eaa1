//! What `verify` does: the text of a netlist, our own or a given one, against its bond graph.

use super::flags::how;
use super::pipeline::{Language, Model, deck_units, language, model, ready};
use crate::bond::elaborate::Overrides;
use crate::diagnostic::{Diagnostic, has_errors};
use crate::netlist::dialects::{Dialect, NGSPICE};
use crate::netlist::read::How;
use crate::netlist::{CardKind, Netlist, flatten, read};
use crate::sim::{FailureKind, Settings};
use crate::source::{FileId, SourceMap, Span};
use crate::translate::Map;
use crate::verify::{self, Report, Times};
use std::time::Instant;

/// What `verify` is asked about.
#[derive(Clone, Debug, Default)]
pub struct Question {
    /// A netlist other than the translation's own.
    pub netlist: Option<FileId>,
    /// A map of it other than the translation's own, as JSON.
    pub map: Option<serde_json::Value>,
    /// The dialect that the translation's own is written in, where that is not ngspice.
    pub to: Option<&'static Dialect>,
    /// What random numbers follow from.
    pub seed: Option<u64>,
}

/// The certificate: the text of a netlist against the bond graph, then both routes over one experiment. The text is
/// written and read back where none is given. `adapt` may change how the circuit is run. `Ok(None)` when there were
/// errors.
///
/// # Errors
/// Why the circuit's run did not reach its end.
pub fn verify(
    map: &mut SourceMap,
    file: FileId,
    overrides: &Overrides,
    question: &Question,
    d: &mut Vec<Diagnostic>,
    adapt: impl FnOnce(&mut Settings),
) -> Result<Option<Report>, FailureKind> {
    let demands = verify::Settings::default();
    if language(map, file) != Language::Bond {
        let message = "only a bond graph can be verified";
        d.push(Diagnostic::error("E0944", Span::NONE, message));
        return Ok(None);
    }
    let Some(model) = model(map, file, overrides, d) else { return Ok(None) };
    let begin = Instant::now();
    let Some((mut certificate, netlist)) = certificate(map, &model, question, &how(overrides), d)
    else {
        return Ok(None);
    };
    if !model.graph.scales.is_empty() {
        let plain = Overrides { scale: vec![], ..overrides.clone() };
        let Some(plain) = super::pipeline::model(map, file, &plain, &mut vec![]) else {
            return Ok(None);
        };
        certificate.scaling = Some(verify::scaling(
            [&plain.graph, &model.graph],
            [&plain.initial, &model.initial],
            &overrides.scale,
            question.seed.unwrap_or(verify::SEED),
        ));
    }
    let mut times = Times { text: begin.elapsed().as_secs_f64(), ..Times::default() };
    if !certificate.holds() || model.graph.experiment.until.is_none() {
        return Ok(Some(Report::of_text(certificate).timed(times)));
    }
    let circuit = flatten::flatten(&netlist, d).map(|mut circuit| {
        let given = overrides.options.iter();
        if !given.clone().any(|(key, _)| key.eq_ignore_ascii_case("reltol")) {
            circuit.options.push(("reltol".into(), format!("{:e}", demands.reltol)));
        }
        if question.netlist.is_none() {
            // What fails is told in the words of the bond graph, as when it is simulated.
            let (own, names) = model.netlist(map, question.to.unwrap_or(&NGSPICE), false);
            circuit.spoken = names.spoken(&own.names);
        }
        circuit
    });
    let run = circuit.and_then(|circuit| ready(circuit, &deck_units(&netlist), true, None, d));
    let Some(mut run) = run else { return Ok(None) };
    if let Some(settings) = &mut run.settings {
        adapt(settings);
    }
    let mut trace = run.trace();
    let begin = Instant::now();
    if let Err(failure) = run.go(&mut trace) {
        if failure.kind != FailureKind::Interrupted {
            d.push(*failure.diagnostic);
        }
        return Err(failure.kind);
    }
    times.circuit = begin.elapsed().as_secs_f64();
    let begin = Instant::now();
    let report = verify::judge(&model.graph, &model.causality, &trace, &demands, d);
    times.second = begin.elapsed().as_secs_f64();
    Ok(report.map(|report| report.with(certificate).timed(times)))
}

/// The parts of the certificate that look at the text alone, and the netlist that was read from it.
pub fn certificate(
    map: &mut SourceMap,
    model: &Model,
    question: &Question,
    how: &How,
    d: &mut Vec<Diagnostic>,
) -> Option<(verify::Certificate, Netlist)> {
    let netlist = match question.netlist {
        Some(file) => read::read(map, file, how, d),
        None => {
            let dialect = question.to.unwrap_or(&NGSPICE);
            let (ours, _) = model.netlist(map, dialect, false);
            let text = dialect.write(&ours, d)?.text;
            let file = map.add(format!("{}.cir", model.graph.name), text);
            read::read(map, file, &How::of(dialect), d)
        }
    };
    if has_errors(d) {
        return None;
    }
    let mut translation = model.translation.clone();
    // A text with subcircuits has other names than a flat one.
    if netlist.cards.iter().any(|card| matches!(card.kind, CardKind::Subcircuit(_))) {
        let nested = model.nested(map);
        (translation.netlist, translation.map) = (nested.netlist, nested.map);
    }
    // What the dialect cannot say has been said; a text in it may stand for the model nevertheless.
    if let Some(written) = netlist.dialect.write(&translation.netlist, &mut vec![]) {
        translation.netlist = written.netlist;
    }
    if let Some(json) = &question.map {
        match Map::from_json(json, &mut translation.netlist.names) {
            Ok(map) => {
                let parameters = translation.map.parameters;
                translation.map = Map { parameters, ..map.without_numbers() };
            }
            Err(why) => {
                let message = "this is no map as `convert --map` writes it";
                d.push(Diagnostic::error("E0930", Span::NONE, message).because(why));
                return None;
            }
        }
    }
    let seed = question.seed.unwrap_or(verify::SEED);
    let found = verify::certify(&model.graph, &model.initial, &translation, &netlist, seed, d)?;
    Some((found, netlist))
}
