//! `bondspice trace RAW --map M`: another simulator's result in bond-graph names and units.

use super::output::Output;
use super::session::{Exit, Session};
use crate::diagnostic::Diagnostic;
use crate::expr::Expr;
use crate::netlist::read::How;
use crate::netlist::{self, CardKind, Element, Leaf, Netlist};
use crate::source::{SourceMap, Span};
use crate::trace::formats::Heading;
use crate::trace::{Trace, send};
use serde::Deserialize;
use std::collections::HashSet;

/// What it does, in a line.
pub const ABOUT: &str = "Rename another simulator's result into bond-graph names and units";

/// An example for the help.
pub const EXAMPLE: &str = "Example: bondspice convert model.bg -o model.cir --map map.json\n         \
ngspice -b -r model.raw model.cir\n         bondspice trace model.raw --map map.json -o model.csv";

/// Its flags.
#[derive(clap::Args)]
pub struct Arguments {
    /// The result: RAW (ngspice, Xyce, LTspice), CSV, JSON, VCD or a table of blanks; - for standard input
    trace: String,
    /// The map that `bondspice convert --map` wrote; without it names stay
    #[arg(long, value_name = "FILE")]
    map: Option<String>,
    /// Where to write the result
    #[arg(short, long, value_name = "FILE")]
    output: Option<String>,
    /// Format of the result (csv, raw, rawascii, ltspice, vcd, json, prn); else from the ending of -o
    #[arg(long, value_name = "FORMAT")]
    format: Option<String>,
    /// Head columns as `name [unit]`
    #[arg(long)]
    units: bool,
    /// Every variable of the map, not only the observed ones
    #[arg(long)]
    all: bool,
}

/// The part of a map that is read here.
#[derive(Deserialize)]
struct Map {
    variables: Vec<Variable>,
}

#[derive(Deserialize)]
struct Variable {
    bg: String,
    expr: Option<String>,
    #[serde(default = "one")]
    factor: f64,
    #[serde(default)]
    unit: String,
    #[serde(default)]
    observed: bool,
}

fn one() -> f64 {
    1.0
}

/// Renames.
pub fn run(arguments: Arguments, session: &mut Session) -> Exit {
    match rename_file(&arguments, session) {
        Ok(()) => session.exit(),
        Err(exit) => exit,
    }
}

fn rename_file(arguments: &Arguments, session: &mut Session) -> Result<(), Exit> {
    let mut trace = session.load_trace(&arguments.trace)?;
    if let Some(name) = &arguments.map {
        let text = session.load_text(name)?;
        let mut map: Map = serde_json::from_str(&text).map_err(|error| {
            let message = format!("`{name}` is no map of variables");
            let diagnostic = Diagnostic::error("E0930", Span::NONE, message);
            session.fail(diagnostic.because(error.to_string()))
        })?;
        choose(&mut map, arguments.all);
        let mut d = vec![];
        let renamed = rename(&trace, &map, &mut d);
        session.say(d);
        trace = renamed.ok_or_else(|| session.exit())?;
    }
    let heading = Heading { title: arguments.trace.clone(), units: arguments.units };
    let (to, format) = (arguments.output.as_deref(), arguments.format.as_deref());
    let mut output = Output::open(to, format, heading, &trace.names, &trace.units, session)?;
    let written = send(&trace, &mut output);
    written.map_err(|error| session.unwritable(to.unwrap_or("<stdout>"), &error))?;
    output.close(true, session)
}

/// Leaves the variables that are wanted and held by the circuit, each name once.
fn choose(map: &mut Map, all: bool) {
    let only = !all && map.variables.iter().any(|variable| variable.observed);
    let mut seen = HashSet::new();
    map.variables.retain(|variable| {
        let wanted = variable.expr.is_some() && (variable.observed || !only);
        wanted && seen.insert(variable.bg.clone())
    });
}

/// The variables of a map over the columns of a trace. Variables that need a column which the trace lacks are left
/// out, with a note.
fn rename(trace: &Trace, map: &Map, d: &mut Vec<Diagnostic>) -> Option<Trace> {
    let (netlist, places) = expressions(map);
    // The abscissa and what counts runs stay.
    let kept = trace.abscissa() + 1;
    let mut result = Trace::new(trace.names[..kept].to_vec(), trace.units[..kept].to_vec());
    result.columns = trace.columns[..kept].to_vec();
    let mut lacking = vec![];
    for (variable, place) in map.variables.iter().zip(places) {
        let law = place.and_then(|at| match &netlist.cards[at].kind {
            CardKind::Device(device) => match &device.element {
                Element::BehaviouralVoltage { law } => Some(law),
                _ => None,
            },
            _ => None,
        });
        let Some(law) = law else {
            let text = variable.expr.as_deref().unwrap_or("");
            let message = format!("`{text}` of `{}` is no expression", variable.bg);
            d.push(Diagnostic::error("E0930", Span::NONE, message));
            return None;
        };
        match column(trace, &netlist, law) {
            Ok(values) => {
                result.names.push(variable.bg.clone());
                result.units.push(variable.unit.clone());
                result.columns.push(values.iter().map(|v| v * variable.factor).collect());
            }
            Err(missing) => lacking.push((variable.bg.clone(), missing)),
        }
    }
    if let Some((_, missing)) = lacking.first() {
        let names: Vec<&str> = lacking.iter().map(|(name, _)| name.as_str()).collect();
        let message = format!("the result lacks what {} variables of the map need", names.len());
        let note = Diagnostic::warning("W0931", Span::NONE, message);
        d.push(note.because(names.join(", ")).because(format!("the first needs `{missing}`")));
    }
    if result.names.len() == kept {
        let message = "no variable of the map can be told from the result";
        let help = "is the map of the netlist that was run?";
        d.push(Diagnostic::error("E0932", Span::NONE, message).help(help));
        return None;
    }
    Some(result)
}

/// The expressions of a map as laws of a netlist, so that they are read as the netlist's own; and for each variable
/// the card that holds it.
fn expressions(map: &Map) -> (Netlist, Vec<Option<usize>>) {
    let mut text = String::from("map\n");
    for (at, variable) in map.variables.iter().enumerate() {
        let line = variable.expr.as_deref().unwrap_or("").replace(['\n', '\r'], " ");
        text += &format!("B_{at} x_ 0 V={line}\n");
    }
    let mut sources = SourceMap::default();
    let file = sources.add("<map>", text + ".end\n");
    let netlist = netlist::read::read(&mut sources, file, &How::default(), &mut vec![]);
    let place = |at: usize| {
        let name = netlist.names.find(&format!("b_{at}"))?;
        let is = |kind: &CardKind| matches!(kind, CardKind::Device(device) if device.name == name);
        netlist.cards.iter().position(|card| is(&card.kind))
    };
    let places = (0..map.variables.len()).map(place).collect();
    (netlist, places)
}

/// The values of an expression, or the first column that it lacks.
fn column(trace: &Trace, netlist: &Netlist, law: &netlist::Expr) -> Result<Vec<f64>, String> {
    let named = |name: &str| trace.column(name).ok_or(name.to_string());
    let voltage = |name| match netlist.names.text(name) {
        "0" => Ok(None),
        node => named(&format!("v({node})")).map(Some),
    };
    let mut columns: Vec<[Option<&[f64]>; 2]> = vec![];
    let indexed = law.try_map(&mut |leaf, _| {
        columns.push(match leaf {
            Leaf::Voltage(a, b) => [voltage(*a)?, b.map(voltage).transpose()?.flatten()],
            Leaf::Current(device) => {
                let name = netlist.names.text(*device).to_lowercase();
                [Some(named(&format!("i({name})"))?), None]
            }
            Leaf::Parameter(name) | Leaf::Power(name) => {
                return Err(netlist.names.text(*name).to_string());
            }
            Leaf::Part(part, _) => return Err(part.name().to_string()),
            Leaf::Time => [Some(trace.time()), None],
            Leaf::Operator(..) => return Err("a value of the past".to_string()),
        });
        Ok(Expr::leaf(columns.len() - 1))
    })?;
    let at = |column: Option<&[f64]>, row: usize| column.map_or(0.0, |values| values[row]);
    let value = |row: usize| {
        indexed.evaluate(&mut |k: &usize| {
            let [plus, minus] = columns[*k];
            at(plus, row) - at(minus, row)
        })
    };
    Ok((0..trace.rows()).map(value).collect())
}
