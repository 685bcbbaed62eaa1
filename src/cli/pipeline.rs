//! The river as plain functions: from a text to a graph, a circuit, a run. The commands, and tests, are made of these.

use super::emit::{self, Stage};
use super::flags::how;
pub use super::proof::{Question, certificate, verify};
pub use super::run::{Run, prepare, ready, run_text};
use super::session::{Exit, Session};
use crate::bond::causality::{self, Causality};
use crate::bond::elaborate::{self, Overrides};
use crate::bond::graph::{BondGraph, Observation};
use crate::bond::initial::{self, InitialState};
use crate::bond::scale;
use crate::bond::syntax;
use crate::circuit::Circuit;
use crate::circuit::stamps;
use crate::diagnostic::{Diagnostic, has_errors, merge_repeats};
use crate::netlist::analysis::{Analysis, Sweep};
use crate::netlist::dialects::Dialect;
use crate::netlist::header::Header;
use crate::netlist::{Card, CardKind, Netlist, flatten, read, write};
use crate::quantity::{did_you_mean, nearest};
use crate::sim::{self, Settings};
use crate::source::{FileId, SourceMap, Span};
use crate::translate::hierarchy::{self, Hierarchy};
use crate::translate::{self, Map, Translation};

/// What a text is written in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Language {
    /// A bond graph.
    Bond,
    /// A netlist.
    Netlist,
}

/// What a file is written in: the ending `.bg` says so, else, for standard input, the text.
pub fn language(map: &SourceMap, file: FileId) -> Language {
    let Some(file) = map.file(file) else { return Language::Netlist };
    if file.name.ends_with(".bg") {
        return Language::Bond;
    }
    if !file.name.starts_with('<') {
        return Language::Netlist;
    }
    for line in file.text.lines().map(str::trim_start) {
        let code = line.split('#').next().unwrap_or(line);
        let mut letters = line.chars();
        let card = letters.next() == Some('.') && letters.next().is_some_and(char::is_alphabetic);
        if card || line.starts_with("*bondspice") {
            return Language::Netlist;
        }
        let kind = code.split(':').next().unwrap_or("").trim_end();
        let element = code.contains(':')
            && ["Se", "Sf", "0", "1", "R", "C", "I", "TF", "GY", "MSe", "MSf"].contains(&kind);
        if element || code.contains("->") || code.starts_with("param ") {
            return Language::Bond;
        }
    }
    Language::Netlist
}

/// Refuses a netlist where only a bond graph has what is asked for.
///
/// # Errors
/// The exit code, when the reason has been said.
pub fn require_bond(session: &mut Session, file: FileId, what: &str) -> Result<(), Exit> {
    if language(&session.map, file) == Language::Bond {
        return Ok(());
    }
    let error = Diagnostic::error("E0944", Span::NONE, format!("only a bond graph can be {what}"));
    Err(session.fail(error.help("the name of a file with a bond graph ends in .bg")))
}

/// The graph of a bond-graph text.
pub fn graph(
    map: &mut SourceMap,
    file: FileId,
    overrides: &Overrides,
    d: &mut Vec<Diagnostic>,
) -> Option<BondGraph> {
    let program = elaborate::load(map, file, &overrides.folders, d);
    if let Some(syntax) = program.files.first() {
        check_options(syntax, overrides, d);
    }
    let mut graph = elaborate::elaborate(&program, map, overrides, d)?;
    scale::scale(&mut graph, &overrides.scale);
    Some(graph)
}

/// Checks the options of a file and of the command line, each at its place.
fn check_options(syntax: &syntax::File, overrides: &Overrides, d: &mut Vec<Diagnostic>) {
    // A run of any length: only whether it takes the options is asked.
    let mut settings = Settings::new(1.0);
    let mut check = |key: &str, value: &str, key_span: Span, value_span: Span| {
        let Err(found) = settings.set(key, value) else { return };
        let mut found = *found;
        let unknown = found.code == "W0801";
        let span = if unknown { key_span } else { value_span };
        if !span.is_none() {
            found = found.label(span, if unknown { "unknown option" } else { "not a value of it" });
        }
        let known = sim::OPTIONS.iter().map(|row| row.name);
        match nearest(key, known).filter(|_| unknown) {
            Some(meant) => {
                d.push(did_you_mean(found, span, key, meant));
            }
            None => d.push(found),
        }
    };
    for statement in &syntax.statements {
        if let syntax::StatementKind::Options(options) = &statement.kind {
            for (key, value) in options {
                check(&key.text, &value.text, key.span, value.span);
            }
        }
    }
    for (key, value) in &overrides.options {
        check(key, value, Span::NONE, Span::NONE);
    }
}

/// The causality of a graph.
pub fn causality(graph: &BondGraph, d: &mut Vec<Diagnostic>) -> Option<Causality> {
    let before = d.len();
    let causality = causality::assign(graph, d);
    if causality.is_some() {
        translate::forced::check(graph, d);
    }
    merge_repeats(d, before);
    causality
}

/// All that can be said about a text without running it; gives the stamps and the system of a netlist, where it has come
/// so far.
pub fn check(
    map: &mut SourceMap,
    file: FileId,
    overrides: &Overrides,
    d: &mut Vec<Diagnostic>,
) -> Option<(stamps::Stamps, sim::System)> {
    match language(map, file) {
        Language::Bond => {
            if let Some(graph) = graph(map, file, overrides, d) {
                causality(&graph, d);
            }
            None
        }
        Language::Netlist => std::thread::scope(|scope| {
            let deck = deck(map, file, overrides, d)?;
            let circuit = deck.circuit(0, &[], None, d)?;
            give_back(scope, deck);
            let stamps = stamps::stamp(&circuit, d)?;
            give_back(scope, circuit);
            let system = sim::compile(&stamps, d)?;
            Some((stamps, system))
        }),
    }
}

/// Gives back what is no longer needed beside what is done next: a million cards are many pieces of memory.
fn give_back<'s, T: Send + 's>(scope: &'s std::thread::Scope<'s, '_>, done: T) {
    // Where there is no thread to be had, it is given back at once.
    let _ = std::thread::Builder::new().spawn_scoped(scope, move || drop(done));
}

/// A bond graph with all that is known before it runs.
pub struct Model {
    /// The graph.
    pub graph: BondGraph,
    /// Its causality.
    pub causality: Causality,
    /// What every storage and signal starts from.
    pub initial: InitialState,
    /// Its circuit as a netlist, with the map.
    pub translation: Translation,
}

/// From a bond-graph text to its netlist.
pub fn model(
    map: &mut SourceMap,
    file: FileId,
    overrides: &Overrides,
    d: &mut Vec<Diagnostic>,
) -> Option<Model> {
    let graph = graph(map, file, overrides, d)?;
    model_of(graph, map, d)
}

/// From a graph to its netlist.
pub fn model_of(mut graph: BondGraph, map: &SourceMap, d: &mut Vec<Diagnostic>) -> Option<Model> {
    let causality = causality(&graph, d)?;
    elaborate::require_drives(&graph, d);
    set_step(&mut graph, d);
    if has_errors(d) {
        return None;
    }
    let initial = initial::solve(&graph, &causality, d)?;
    let translation = translate::translate(&graph, &causality, &initial, map, d)?;
    Some(Model { graph, causality, initial, translation })
}

impl Model {
    /// The circuit with the graph's instances as subcircuits.
    pub fn nested(&self, map: &SourceMap) -> Hierarchy {
        hierarchy::fold(&self.graph, &self.causality, map, &self.translation)
    }

    /// The circuit as it is written in a dialect, and its map: with subcircuits where the dialect takes them and no flat
    /// one is asked for.
    pub fn netlist(&self, map: &SourceMap, dialect: &Dialect, flat: bool) -> (Netlist, Map) {
        if dialect.nested && !flat {
            let nested = self.nested(map);
            return (nested.netlist, nested.map);
        }
        let (mut netlist, map) = (self.translation.netlist.clone(), self.translation.map.clone());
        if self.graph.tree.len() > 1 {
            let why = match dialect.nested {
                true => "as asked for".to_string(),
                false => format!("{} gets no subcircuits", dialect.name),
            };
            let text = format!(" one flat circuit, {why}: instances stand laid open");
            let kind = CardKind::Comment(text);
            netlist.cards.insert(0, Card { kind, span: Span::NONE, comment: None });
        }
        (netlist, map)
    }
}

/// A thousand rows where only the end of the run is said.
fn set_step(graph: &mut BondGraph, d: &mut Vec<Diagnostic>) {
    if let (Some(until), None) = (graph.experiment.until, graph.experiment.step) {
        graph.experiment.step = Some(until / 1000.0);
        let message =
            format!("no output interval is said: {:e} s, a thousandth of the run", until / 1000.0);
        let note = Diagnostic::note("N0947", Span::NONE, message);
        d.push(note.help("say it with --step, or in the file: `simulate until … step …`"));
    }
}

impl Model {
    /// The flat circuit, and the units of its columns by name.
    pub fn circuit(&self, d: &mut Vec<Diagnostic>) -> Option<(Circuit, Units)> {
        let mut circuit = flatten::flatten(&self.translation.netlist, d)?;
        circuit.spoken = self.translation.map.spoken(&self.translation.netlist.names);
        let unit = |item: &Observation| match item.unit.0.as_str() {
            "" => item.si_unit.clone(),
            unit => unit.to_string(),
        };
        let items = self.graph.experiment.observe.iter();
        Some((circuit, items.map(|item| (item.name.clone(), unit(item))).collect()))
    }
}

/// From a text of either language to its flat circuit, and the units of its columns by name.
pub fn circuit(
    map: &mut SourceMap,
    file: FileId,
    overrides: &Overrides,
    d: &mut Vec<Diagnostic>,
) -> Option<(Circuit, Units)> {
    match language(map, file) {
        Language::Bond => model(map, file, overrides, d)?.circuit(d),
        Language::Netlist => {
            let deck = deck(map, file, overrides, d)?;
            let circuit = deck.circuit(0, &[], None, d)?;
            Some((circuit, deck.units))
        }
    }
}

/// A netlist with what the command line says of it: a circuit for any values of its sweeps.
#[derive(Clone)]
pub struct Deck {
    /// The netlist.
    pub netlist: Netlist,
    /// Units of its columns.
    pub units: Units,
    overrides: Overrides,
}

/// From a netlist's text to cards.
pub fn deck(
    map: &mut SourceMap,
    file: FileId,
    overrides: &Overrides,
    d: &mut Vec<Diagnostic>,
) -> Option<Deck> {
    let mut netlist = read::read(map, file, &how(overrides), d);
    if has_errors(d) {
        return None;
    }
    super::deck::set_parameters(&mut netlist, &overrides.set, d);
    super::deck::observe(&mut netlist, overrides.observe.as_deref(), d);
    if let Some(drive) = overrides.drive.first() {
        let message = format!("a netlist has no input to drive: `{drive}`");
        d.push(Diagnostic::error("E0944", Span::NONE, message));
    }
    let units = deck_units(&netlist);
    Some(Deck { netlist, units, overrides: overrides.clone() })
}

impl Deck {
    /// The same with other values of parameters.
    pub fn set(&self, set: &[(String, String)], d: &mut Vec<Diagnostic>) -> Deck {
        let mut deck = self.clone();
        super::deck::set_parameters(&mut deck.netlist, set, d);
        deck
    }

    /// The flat circuit with some names set to other values, for an analysis other than the last where one is named.
    /// `step` is that of `.step`, from 0 on.
    pub fn circuit(
        &self,
        step: u64,
        values: &[(&str, f64)],
        analysis: Option<&str>,
        d: &mut Vec<Diagnostic>,
    ) -> Option<Circuit> {
        let mut variation = flatten::Variation::default();
        variation.analysis = analysis.map(String::from);
        (variation.step, variation.options) = (step, self.overrides.options.clone());
        for (name, value) in values {
            if let Err(error) = variation.set(&self.netlist, name, *value, self.place(name)) {
                d.push(*error);
                return None;
            }
        }
        let mut circuit = flatten::flatten_with(&self.netlist, &variation, d)?;
        super::deck::set_times(&mut circuit, &self.overrides, d);
        (!has_errors(d)).then_some(circuit)
    }

    /// Where a sweep names something.
    fn place(&self, name: &str) -> Span {
        let sweeps = self.netlist.cards.iter().flat_map(|card| match &card.kind {
            CardKind::Step(sweeps) => &sweeps[..],
            CardKind::Analysis(analysis) => match &**analysis {
                Analysis::Dc(sweeps) => &sweeps[..],
                _ => &[],
            },
            _ => &[],
        });
        let mut places = sweeps.filter_map(|sweep| match sweep {
            Sweep::Quantity { name: own, span, .. } | Sweep::Table { name: own, span } => {
                let same = self.netlist.names.text(*own).eq_ignore_ascii_case(name);
                let table = matches!(sweep, Sweep::Table { .. });
                (same || table).then_some(*span)
            }
        });
        places.next().unwrap_or(Span::NONE)
    }
}

/// Units of columns, by their names.
pub type Units = Vec<(String, String)>;

pub(super) fn deck_units(netlist: &Netlist) -> Units {
    let (header, _) = Header::read(&netlist.header);
    header.columns.into_iter().map(|column| (column.name, column.unit)).collect()
}

/// The unit of a column: as known, else as a node voltage or branch current has it.
pub(super) fn unit_of(name: &str, units: &Units) -> String {
    let known = units.iter().find(|(known, _)| known == name);
    match known {
        Some((_, unit)) => unit.clone(),
        None if name.starts_with("v(") => "V".into(),
        None if name.starts_with("i(") => "A".into(),
        None => String::new(),
    }
}

/// A stage of a text as text; what is wrong has been said when there is none.
///
/// # Errors
/// The exit code.
pub fn emit(
    session: &mut Session,
    file: FileId,
    overrides: &Overrides,
    stage: Stage,
) -> Result<String, Exit> {
    let mut d = vec![];
    let map = &mut session.map;
    let bond = language(map, file) == Language::Bond;
    let text = match stage {
        Stage::Graph | Stage::Causality if !bond => {
            let message = "a netlist has no graph and no causality";
            d.push(Diagnostic::error("E0944", Span::NONE, message));
            None
        }
        Stage::Graph => graph(map, file, overrides, &mut d).map(|graph| emit::graph(&graph)),
        Stage::Causality => graph(map, file, overrides, &mut d).map(|graph| {
            let causality = causality::analyse(&graph, &mut d);
            causality::to_text(&graph, &causality)
        }),
        Stage::Netlist if bond => model(map, file, overrides, &mut d)
            .map(|model| write::write(&model.translation.netlist)),
        Stage::Netlist => Some(write::write(&read::read(map, file, &how(overrides), &mut d))),
        Stage::Circuit => {
            circuit(map, file, overrides, &mut d).map(|(circuit, _)| emit::circuit(&circuit))
        }
        Stage::System => circuit(map, file, overrides, &mut d)
            .and_then(|(circuit, _)| stamps::stamp(&circuit, &mut d))
            .map(|stamps| emit::system(&stamps)),
    };
    session.say(d);
    match (text, session.exit()) {
        (Some(text), Exit::Fine) => Ok(text),
        (_, exit) => Err(exit),
    }
}
