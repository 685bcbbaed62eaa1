//! `bondspice trace RAW --map M`: another simulator's result in bond-graph names and units.

use super::output::Output;
use super::session::{Exit, Session};
use crate::diagnostic::Diagnostic;
use crate::expr::Expr;
use crate::netlist::{self, Leaf, Names};
use crate::source::Span;
use crate::trace::formats::Heading;
use crate::trace::{Trace, send};
use crate::translate::Map;
use std::collections::{HashMap, HashSet};

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
        let mut names = Names::default();
        let json = serde_json::from_str(&text).map_err(|error| error.to_string());
        let map = json.and_then(|json| Map::from_json(&json, &mut names));
        let mut map = map.map_err(|why| {
            let message = format!("`{name}` is no map of variables");
            session.fail(Diagnostic::error("E0930", Span::NONE, message).because(why))
        })?;
        choose(&mut map, arguments.all);
        let mut d = vec![];
        let renamed = rename(&trace, &map, &names, &mut d);
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
fn rename(trace: &Trace, map: &Map, names: &Names, d: &mut Vec<Diagnostic>) -> Option<Trace> {
    let columns = Columns::of(trace);
    // The abscissa and what counts runs stay.
    let kept = trace.abscissa() + 1;
    let mut result = Trace::new(trace.names[..kept].to_vec(), trace.units[..kept].to_vec());
    result.columns = trace.columns[..kept].to_vec();
    let mut lacking = vec![];
    for variable in &map.variables {
        let Some(expr) = &variable.expr else { continue };
        match columns.values(names, expr) {
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

/// The columns of a result by their names, in whatever way its simulator spells paths into subcircuits.
struct Columns<'t> {
    trace: &'t Trace,
    folded: HashMap<String, usize>,
}

impl<'t> Columns<'t> {
    fn of(trace: &'t Trace) -> Columns<'t> {
        let mut folded = HashMap::new();
        for (at, name) in trace.names.iter().enumerate() {
            folded.entry(fold(name)).or_insert(at);
        }
        Columns { trace, folded }
    }

    /// The column of a node or a device.
    fn named(&self, wishes: &[String]) -> Result<&'t [f64], String> {
        let found = wishes.iter().find_map(|wish| {
            let at = self.trace.position(wish).or_else(|| self.folded.get(&fold(wish)).copied());
            Some(self.trace.columns[at?].as_slice())
        });
        found.ok_or_else(|| wishes.first().cloned().unwrap_or_default())
    }

    /// The values of an expression, or the first column that is lacking.
    fn values(&self, names: &Names, law: &netlist::Expr) -> Result<Vec<f64>, String> {
        let voltage = |name| match names.text(name) {
            "0" => Ok(None),
            node => self.named(&[format!("v({node})")]).map(Some),
        };
        let mut columns: Vec<[Option<&[f64]>; 2]> = vec![];
        let indexed = law.try_map(&mut |leaf, _| {
            columns.push(match leaf {
                Leaf::Voltage(a, b) => [voltage(*a)?, b.map(voltage).transpose()?.flatten()],
                Leaf::Current(device) => [Some(self.named(&currents(names.text(*device)))?), None],
                Leaf::Parameter(name) | Leaf::Power(name) => {
                    return Err(names.text(*name).to_string());
                }
                Leaf::Part(part, _) => return Err(part.name().to_string()),
                Leaf::Time => [Some(self.trace.time()), None],
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
        Ok((0..self.trace.rows()).map(value).collect())
    }
}

/// A name as every simulator would spell it: `V(X1:N)` is `v(x1.n)`.
fn fold(name: &str) -> String {
    name.to_lowercase().replace(':', ".")
}

/// What the current of a device may be called: `i(x1.h_emf)`; with its letter before the path, `i(h.x1.h_emf)`; and with
/// that in the place of the one at its own name, `i(h.x1._emf)`.
fn currents(device: &str) -> Vec<String> {
    let mut wishes = vec![format!("i({device})")];
    let Some((path, own)) = device.rsplit_once('.') else { return wishes };
    let Some(letter) = own.get(..1) else { return wishes };
    match path.split_once('.') {
        // As ngspice writes it, its letter stands there already.
        Some((first, rest)) if first.eq_ignore_ascii_case(letter) => {
            wishes.extend([format!("i({rest}.{own})"), format!("i({path}.{})", &own[1..])]);
        }
        _ => {
            let lettered =
                [format!("i({letter}.{device})"), format!("i({letter}.{path}.{})", &own[1..])];
            wishes.extend(lettered);
        }
    }
    wishes
}
