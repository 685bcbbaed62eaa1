//! One run of a sweep: the model with its settings, simulated, measured.

use super::Sweep;
use crate::analysis::sweep::Setting;
use crate::bond::elaborate::Overrides;
use crate::circuit::{Circuit, Output};
use crate::cli::pipeline::{self, Deck, Language, language};
use crate::cli::run::{self, Run};
use crate::cli::session::{Exit, Session};
use crate::diagnostic::{Diagnostic, Severity, has_errors};
use crate::sim::{FailureKind, Seat};
use crate::source::{SourceMap, Span};
use crate::trace::formats::Heading;
use crate::trace::measure::{Measure, Outcome};
use crate::trace::{Nowhere, csv};
use std::fs::File;
use std::io::{self, BufWriter};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Makes runs.
pub struct Runner<'a> {
    sweep: &'a Sweep,
    bond: bool,
    /// The items of measures, each once, and which of them each measure takes.
    items: Vec<String>,
    places: Vec<usize>,
    traces: Option<PathBuf>,
    /// What all runs have in common: the netlist as it was read, and a run that others may be like.
    deck: Option<Deck>,
    first: Option<Box<Run>>,
}

/// A row of the table.
pub struct Row {
    /// The number of the run.
    pub run: u64,
    /// What it set.
    pub settings: Vec<Setting>,
    /// What was measured, in the order of the header; nothing where it failed.
    pub values: Vec<Option<f64>>,
    /// Why it did not end well.
    pub failure: Option<Box<Diagnostic>>,
}

impl<'a> Runner<'a> {
    /// # Errors
    /// The exit code, when what is wrong has been said.
    pub fn new(
        sweep: &'a Sweep,
        traces: Option<&str>,
        session: &mut Session,
    ) -> Result<Runner<'a>, Exit> {
        let mut items: Vec<String> = vec![];
        let mut places = vec![];
        for (wanted, _) in &sweep.measures {
            let known = items.iter().position(|item| *item == wanted.item);
            places.push(known.unwrap_or(items.len()));
            if known.is_none() {
                items.push(wanted.item.clone());
            }
        }
        if let Some(folder) = traces {
            std::fs::create_dir_all(folder).map_err(|error| session.unwritable(folder, &error))?;
        }
        let bond = language(&session.map, sweep.file) == Language::Bond;
        let traces = traces.map(PathBuf::from);
        Ok(Runner { sweep, bond, items, places, traces, deck: None, first: None })
    }

    /// The header of the table, from a run that is only prepared.
    pub fn header(
        &mut self,
        run: u64,
        map: &mut SourceMap,
        d: &mut Vec<Diagnostic>,
    ) -> Option<Vec<String>> {
        let settings = self.sweep.space.settings(run);
        if !self.bond {
            self.deck = Some(pipeline::deck(map, self.sweep.file, &self.overrides(), d)?);
        }
        let prepared = self.prepare(&settings, map, d)?;
        let header = self.header_of(&prepared, d);
        self.first = Some(Box::new(prepared));
        header
    }

    fn header_of(&self, prepared: &Run, d: &mut Vec<Diagnostic>) -> Option<Vec<String>> {
        let measures: Vec<&str> =
            prepared.measures().map(|measure| measure.name.as_str()).collect();
        if measures.is_empty() && self.traces.is_none() {
            let error = Diagnostic::error("E1203", Span::NONE, "nothing is measured");
            d.push(
                error.help(
                    "say what to take from each run: --measure 'peak=max(x)', or --traces DIR",
                ),
            );
            return None;
        }
        let names = self.sweep.space.names();
        let header: Vec<String> =
            ["run"].into_iter().chain(names).chain(measures).map(String::from).collect();
        let twice = header.iter().enumerate().find(|(at, name)| header[..*at].contains(name));
        if let Some((_, name)) = twice {
            let error =
                Diagnostic::error("E0945", Span::NONE, format!("two columns are called `{name}`"));
            d.push(error.help("give the measure another name"));
            return None;
        }
        Some(header)
    }

    fn prepare(
        &self,
        settings: &[Setting],
        map: &mut SourceMap,
        d: &mut Vec<Diagnostic>,
    ) -> Option<Run> {
        let set = settings.iter().map(|setting| (setting.name.clone(), setting.text.clone()));
        let before = d.len();
        let mut complete =
            |circuit: &mut Circuit, d: &mut Vec<Diagnostic>| self.measure(circuit, d);
        let like = self.first.as_deref();
        let run = match &self.deck {
            Some(deck) => {
                let deck = deck.set(&set.collect::<Vec<_>>(), d);
                run::prepare_deck(deck, None, &mut complete, like, d)?
            }
            None => {
                let mut overrides = self.overrides();
                overrides.set.extend(set);
                let file = self.sweep.file;
                run::prepare_with(map, file, &overrides, None, &mut complete, like, d)?
            }
        };
        if !run.steps.is_empty() {
            let error =
                Diagnostic::error("E1202", Span::NONE, "the netlist has a `.step` of its own");
            d.push(error.help("leave it out, and vary its parameter with --vary"));
        }
        (!has_errors(&d[before..])).then_some(run)
    }

    /// What the command line says of every run.
    fn overrides(&self) -> Overrides {
        let mut overrides = self.sweep.overrides.clone();
        if !self.items.is_empty() {
            // What is measured stands last, behind the columns of a trace.
            let own = overrides.observe.take().filter(|_| self.traces.is_some());
            let items = own.into_iter().chain(self.items.iter().cloned());
            overrides.observe = Some(items.collect::<Vec<_>>().join(", "));
        }
        overrides
    }

    /// Adds the measures of the sweep to those of a circuit, over the columns that were added last.
    fn measure(&self, circuit: &mut Circuit, d: &mut Vec<Diagnostic>) {
        let columns = circuit.outputs.len().saturating_sub(self.items.len());
        let first = circuit.watched.len();
        let exprs = circuit.outputs[columns..].iter().map(|Output { expr, .. }| expr.clone());
        circuit.watched.extend(exprs);
        let read = |text: &str| super::reading(text, self.bond);
        for ((wanted, span), place) in self.sweep.measures.iter().zip(&self.places) {
            match wanted.kind(first + place, &read) {
                Ok(kind) => {
                    let (name, analysis) = (wanted.name.clone(), String::new());
                    circuit.measures.push(Measure { name, span: *span, analysis, kind });
                }
                Err(why) => {
                    d.push(Diagnostic::error("E1203", *span, format!("`{}`: {why}", wanted.name)))
                }
            }
        }
    }

    /// Makes a run beside others; nothing where it was interrupted.
    pub async fn run(
        &self,
        run: u64,
        map: &SourceMap,
        stop: &Arc<AtomicBool>,
        seat: Seat<'_>,
    ) -> Option<Row> {
        let settings = self.sweep.space.settings(run);
        let mut d = vec![];
        let mut row = Row { run, settings, values: vec![], failure: None };
        let Some(mut prepared) = self.prepare(&row.settings, &mut map.clone(), &mut d) else {
            let error = d.into_iter().find(|d| d.severity == Severity::Error);
            row.failure = error.map(Box::new);
            return Some(row);
        };
        prepared.watch(stop.clone(), None);
        if self.traces.is_none() {
            prepared.keep_no_rows();
        }
        let outcome = self.simulate(run, &prepared, seat).await;
        if stop.load(Ordering::Relaxed) {
            return None;
        }
        match outcome {
            Ok(outcomes) => row.values = outcomes.iter().map(|outcome| outcome.value).collect(),
            Err(why) => row.failure = Some(why),
        }
        Some(row)
    }

    async fn simulate(
        &self,
        run: u64,
        prepared: &Run,
        seat: Seat<'_>,
    ) -> Result<Vec<Outcome>, Box<Diagnostic>> {
        let file = |error: io::Error, name: &PathBuf| {
            Box::new(crate::diagnostic::files::unwritable(&name.to_string_lossy(), &error))
        };
        let (result, taken) = match &self.traces {
            None => prepared.go_beside(&mut Nowhere, seat).await,
            Some(folder) => {
                let name = folder.join(format!("run-{run}.csv"));
                let heading = Heading { title: String::new(), units: false };
                let to = File::create(&name).map(BufWriter::new).map_err(|e| file(e, &name))?;
                let rows = csv::Rows::new(to, &heading, &prepared.names, &prepared.units);
                let mut rows = rows.map_err(|error| file(error, &name))?;
                let outcome = prepared.go_beside(&mut rows, seat).await;
                rows.finish().map_err(|error| file(error, &name))?;
                outcome
            }
        };
        match result {
            Ok(_) => Ok(taken.measured.into_iter().flat_map(|one| one.outcomes).collect()),
            Err(failure) if failure.kind == FailureKind::Interrupted => Ok(vec![]),
            Err(failure) => Err(failure.diagnostic),
        }
    }
}
