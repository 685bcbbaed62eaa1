//! What the commands of linear analysis share: the point, the variables, the linear model.

use super::flags::{DeckFlags, ModelFlags};
use super::pipeline::{self, Language};
use super::session::{Exit, Session};
use crate::analysis::circuit;
use crate::analysis::linear::{self, Linear};
use crate::analysis::point::{self, At};
use crate::analysis::symbolic::symbols::name_values;
use crate::analysis::tune::{self, Tuned};
use crate::bond::causality::Causality;
use crate::bond::elaborate::Overrides;
use crate::bond::graph::{BondGraph, Observation};
use crate::diagnostic::{Diagnostic, has_errors};
use crate::quantity::{Unit, number_and_unit};
use crate::source::{FileId, Span};

/// Flags of every command that linearises.
#[derive(Clone, Debug, clap::Args)]
pub struct PointFlags {
    /// The bond graph (.bg) or, for linearize, poles and bode, a netlist; - for standard input
    pub file: String,
    #[command(flatten)]
    /// What to change in it.
    pub model: ModelFlags,
    #[command(flatten)]
    /// How a netlist is read.
    pub deck: DeckFlags,
    /// Where to linearise: start, rest (where all comes to rest, sources held as at the start), or a time of the run: 1.2s
    #[arg(long, value_name = "POINT", default_value = "start")]
    pub at: String,
}

/// Flags of a way from one variable to another.
#[derive(Clone, Debug, clap::Args)]
pub struct WayFlags {
    /// The variable that the way begins at; it is imposed
    #[arg(long, value_name = "VARIABLE", requires = "to")]
    from: Option<String>,
    /// The variable that it leads to
    #[arg(long, value_name = "EXPR", requires = "from")]
    to: Option<String>,
}

impl WayFlags {
    /// Whether a way is asked for.
    pub fn given(&self) -> bool {
        self.from.is_some()
    }

    /// Linearises a model or a netlist; of a way one variable stands at each end.
    ///
    /// # Errors
    /// The exit code, when the reason has been said.
    pub fn linearise(&self, point: &PointFlags, session: &mut Session) -> Result<Linear, Exit> {
        let linear = linearise(point, self.from.as_deref(), self.to.as_deref(), session)?;
        if self.given() {
            one_way(&linear, session)?;
        }
        Ok(linear)
    }

    /// Linearises a model with names for the values at its elements.
    ///
    /// # Errors
    /// The exit code, when the reason has been said.
    pub fn named(&self, point: &PointFlags, session: &mut Session) -> Result<Linearised, Exit> {
        let (from, to) = (self.from.as_deref(), self.to.as_deref());
        let found = linearise_named(point, from, to, session)?;
        if self.given() {
            one_way(&found.linear, session)?;
        }
        Ok(found)
    }
}

/// Refuses more than one input or output.
///
/// # Errors
/// The exit code, when the reason has been said.
pub fn one_way(linear: &Linear, session: &mut Session) -> Result<(), Exit> {
    if linear.inputs.len() == 1 && linear.outputs.len() == 1 {
        return Ok(());
    }
    let message = "--from and --to take one variable each";
    Err(session.fail(Diagnostic::error("E0940", Span::NONE, message)))
}

/// A model with its linear one.
pub struct Linearised {
    /// The graph.
    pub graph: BondGraph,
    /// Its causality.
    pub causality: Causality,
    /// Its linear equations.
    pub linear: Linear,
}

/// Reads and linearises a model or a netlist. `inputs` and `outputs` are lists of variables; without them its own.
///
/// # Errors
/// The exit code, when the reason has been said.
pub fn linearise(
    flags: &PointFlags,
    inputs: Option<&str>,
    outputs: Option<&str>,
    session: &mut Session,
) -> Result<Linear, Exit> {
    let at = at(&flags.at, session)?;
    let mut overrides = flags.model.overrides(session)?;
    flags.deck.add_to(&mut overrides, session)?;
    let file = session.load(&flags.file)?;
    if let Some(list) = outputs {
        overrides.observe = Some(list.to_string());
    }
    if pipeline::language(&session.map, file) == Language::Bond {
        return prepare(file, overrides, (at, false), inputs, session).map(|found| found.linear);
    }
    if let At::Time(_) = at {
        let message = "a netlist is linearised at its operating point, not at a time of a run";
        return Err(session.fail(Diagnostic::error("E0944", Span::NONE, message)));
    }
    let mut d = vec![];
    let circuit = pipeline::deck(&mut session.map, file, &overrides, &mut d)
        .and_then(|deck| deck.circuit(0, &[], None, &mut d));
    session.say(d);
    let Some(circuit) = circuit else { return Err(session.exit()) };
    let names: Option<Vec<&str>> = inputs.map(|list| list.split(',').map(str::trim).collect());
    match circuit::linearise(&circuit, names.as_deref()) {
        Ok(linear) if session.exit() == Exit::Fine => Ok(linear),
        Ok(_) => Err(session.exit()),
        Err(error) => Err(session.fail(*error)),
    }
}

/// The same of a model with names for the values that are written at its elements.
///
/// # Errors
/// The exit code, when the reason has been said.
pub fn linearise_named(
    flags: &PointFlags,
    inputs: Option<&str>,
    outputs: Option<&str>,
    session: &mut Session,
) -> Result<Linearised, Exit> {
    let at = at(&flags.at, session)?;
    let (file, mut overrides) = flags.model.of(&flags.file, "told in symbols", session)?;
    if let Some(list) = outputs {
        overrides.observe = Some(list.to_string());
    }
    prepare(file, overrides, (at, true), inputs, session)
}

fn prepare(
    file: FileId,
    overrides: Overrides,
    how: (At, bool),
    inputs: Option<&str>,
    session: &mut Session,
) -> Result<Linearised, Exit> {
    let inputs = inputs.map(|list| variables(session, file, &overrides, list)).transpose()?;
    let mut d = vec![];
    let found = find(session, file, &overrides, how, inputs.as_deref(), &mut d);
    session.say(d);
    match (found, session.exit()) {
        (Some(found), Exit::Fine) => Ok(found),
        (_, exit) => Err(exit),
    }
}

/// Designs the regulators of a model, and tells what laws were left out.
///
/// # Errors
/// The exit code, when the reason has been said.
pub fn tuned(flags: &PointFlags, session: &mut Session) -> Result<(Vec<Tuned>, Vec<String>), Exit> {
    let at = at(&flags.at, session)?;
    let (file, overrides) = flags.model.of(&flags.file, "tuned", session)?;
    let mut d = vec![];
    let graph = pipeline::graph(&mut session.map, file, &overrides, &mut d);
    let found = graph.and_then(|graph| {
        let causality = pipeline::causality(&graph, &mut d)?;
        tune::tune(&graph, &causality, at, &mut d)
    });
    d.retain(|said| !UNHEARD.contains(&said.code));
    session.say(d);
    match (found, session.exit()) {
        (Some(found), Exit::Fine) => Ok(found),
        (_, exit) => Err(exit),
    }
}

/// What is said of a run says nothing of a linear model.
const UNHEARD: &[&str] = &["W0201", "W0402"];

fn find(
    session: &mut Session,
    file: FileId,
    overrides: &Overrides,
    (at, named): (At, bool),
    inputs: Option<&[Observation]>,
    d: &mut Vec<Diagnostic>,
) -> Option<Linearised> {
    let mut graph = pipeline::graph(&mut session.map, file, overrides, d)?;
    if named {
        graph = name_values(&graph);
    }
    let causality = pipeline::causality(&graph, d)?;
    let point = point::find(&graph, &causality, at, d)?;
    let linear = linear::linearise(&graph, &causality, &point, inputs, d)?;
    d.retain(|said| !UNHEARD.contains(&said.code));
    (!has_errors(d)).then_some(Linearised { graph, causality, linear })
}

/// A list of variables of a model.
fn variables(
    session: &mut Session,
    file: FileId,
    overrides: &Overrides,
    list: &str,
) -> Result<Vec<Observation>, Exit> {
    let overrides = Overrides { observe: Some(list.to_string()), ..overrides.clone() };
    let mut d = vec![];
    let graph = pipeline::graph(&mut session.map, file, &overrides, &mut d);
    if graph.is_some() {
        // The rest is said once, with the outputs.
        return Ok(graph.map(|graph| graph.experiment.observe).unwrap_or_default());
    }
    session.say(d);
    Err(session.exit())
}

/// `start`, `rest` or a time.
fn at(text: &str, session: &mut Session) -> Result<At, Exit> {
    match text {
        "start" => Ok(At::Start),
        "rest" | "op" => Ok(At::Rest),
        _ => quantity(text, "s", "--at takes start, rest or a time, as in 1.2s", session)
            .map(At::Time),
    }
}

/// A number that is not negative with a unit like `unit`, or without one, in SI. Angular frequencies become frequencies.
///
/// # Errors
/// The exit code, when the reason has been said.
pub fn quantity(text: &str, unit: &str, takes: &str, session: &mut Session) -> Result<f64, Exit> {
    let read = number_and_unit(text);
    let own = read.map_or("", |(_, own)| own);
    let wanted = Unit::parse(unit).ok();
    let read = read.and_then(|(number, own)| match own {
        "" => Some(number),
        own => Unit::parse(own)
            .ok()
            .filter(|own| wanted.as_ref().is_some_and(|wanted| wanted.dimension == own.dimension))
            .map(|own| own.to_si(number)),
    });
    let turns = if unit == "Hz" && own.contains("rad") { std::f64::consts::TAU } else { 1.0 };
    match read.filter(|value| value.is_finite() && *value >= 0.0) {
        Some(value) => Ok(value / turns),
        None => {
            let message = format!("{takes}, not `{text}`");
            Err(session.fail(Diagnostic::error("E0940", Span::NONE, message)))
        }
    }
}
