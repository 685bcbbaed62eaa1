//! `bondspice plot TRACE…`: traces as curves over a common abscissa.

use super::compare::names;
use super::output::write_text;
use super::session::{Exit, Session};
use crate::diagnostic::Diagnostic;
use crate::draw::picture::Picture;
use crate::draw::plot::{self, Choice, Kind, Panel, Source};
use crate::draw::{svg, tikz};
use crate::quantity::nearest;
use crate::source::Span;
use crate::trace::Trace;
use std::io::IsTerminal;
use std::path::Path;

/// What it does, in a line.
pub const ABOUT: &str = "Plot traces: SVG or TikZ, or a quick look in the terminal";

/// An example for the help.
pub const EXAMPLE: &str = "Columns of one unit share a panel, files lie one over the other. Units are those of a CSV written \
with --units, of RAW and of JSON. Phasors (columns NAME.re and NAME.im) become Bode plots. Without -o the plot is shown \
in the terminal, and elsewhere SVG goes to standard output.\n\n\
Example: bondspice simulate model.bg --units -o run.csv && bondspice plot run.csv -o run.svg\n         \
bondspice plot a.csv b.csv --signals 'x, pump pressure' --from 0.5 --to 1\n         \
bondspice plot run.csv --signals 'pump pressure' --pu 'pump pressure=344.7'\n         \
bondspice plot ac.csv --nyquist -o nyquist.svg";

/// Its flags.
#[derive(clap::Args)]
pub struct Arguments {
    /// Traces: CSV, RAW (ngspice, Xyce, LTspice), JSON, VCD or tables of blanks; - for standard input
    #[arg(required = true, value_name = "TRACE")]
    traces: Vec<String>,
    /// Columns to plot, NAME, …; without it all
    #[arg(long, value_name = "NAMES")]
    signals: Option<String>,
    /// Divide columns by a base in their own unit: NAME=BASE, …
    #[arg(long, value_name = "BASES")]
    pu: Option<String>,
    /// The column that is the abscissa, where it is not the first
    #[arg(long, value_name = "NAME")]
    over: Option<String>,
    /// Where the abscissa begins
    #[arg(long, value_name = "X", allow_hyphen_values = true)]
    from: Option<f64>,
    /// Where it ends
    #[arg(long, value_name = "X", allow_hyphen_values = true)]
    to: Option<f64>,
    /// Phasors as imaginary over real part
    #[arg(long)]
    nyquist: bool,
    /// What stands above the plot
    #[arg(long, value_name = "TEXT")]
    title: Option<String>,
    /// Where to write the plot: .svg or .tex
    #[arg(short, long, value_name = "FILE")]
    output: Option<String>,
}

/// Plots.
///
/// # Errors
/// The exit code, when the reason has been said.
pub fn run(arguments: Arguments, session: &mut Session) -> Result<(), Exit> {
    let arguments = &arguments;
    let form = form(arguments.output.as_deref(), session)?;
    if arguments.traces.iter().filter(|name| *name == "-").count() > 1 {
        let message = "only one of the traces can be standard input";
        return Err(session.fail(Diagnostic::error("E0940", Span::NONE, message)));
    }
    let mut loaded: Vec<(String, Trace)> = vec![];
    for path in &arguments.traces {
        loaded.push((short(path, &arguments.traces), session.load_trace(path)?));
    }
    let sources: Vec<Source> = loaded.iter().map(|(name, trace)| Source { name, trace }).collect();
    let choice = choice(arguments, &loaded, session)?;
    let panels = plot::panels(&sources, &choice).map_err(|plot::Missing(name)| {
        let known = || loaded.iter().flat_map(|(_, trace)| trace.names.iter().map(String::as_str));
        let message = format!("no trace has a column `{name}`");
        let error = Diagnostic::error("E1010", Span::NONE, message);
        session.fail(match nearest(&name, known()) {
            Some(meant) => error.help(format!("did you mean `{meant}`?")),
            None => error.because(format!("columns: {}", known().collect::<Vec<_>>().join(", "))),
        })
    })?;
    show(
        arguments.title.as_deref().unwrap_or(""),
        &panels,
        form,
        arguments.output.as_deref(),
        session,
    )?;
    Ok(())
}

/// The form of a plot by the ending of its file.
///
/// # Errors
/// The exit code, when what is wrong has been said.
pub fn form(output: Option<&str>, session: &mut Session) -> Result<&'static str, Exit> {
    let ending = output.filter(|name| *name != "-").and_then(|name| Path::new(name).extension());
    match ending.map(|ending| ending.to_string_lossy().to_lowercase()).as_deref() {
        None | Some("svg") => Ok("svg"),
        Some("tex") => Ok("tex"),
        Some(other) => {
            let message = format!("a plot has no form `{other}`");
            let error = Diagnostic::error("E0941", Span::NONE, message);
            Err(session.fail(error.help("end the name in .svg or .tex")))
        }
    }
}

/// Writes panels to a file, to standard output, or as text to a terminal.
///
/// # Errors
/// The exit code, when what is wrong has been said.
pub fn show(
    title: &str,
    panels: &[Panel],
    form: &str,
    output: Option<&str>,
    session: &mut Session,
) -> Result<(), Exit> {
    let text = if output.is_none() && std::io::stdout().is_terminal() {
        let columns = std::env::var("COLUMNS").ok().and_then(|text| text.parse().ok());
        plot::terminal(panels, columns.unwrap_or(80), 10)
    } else {
        text(&plot::paint(title, panels), form)
    };
    write_text(output, &text, session)
}

/// A picture in a form.
pub fn text(picture: &Picture, form: &str) -> String {
    if form == "tex" { tikz::write(picture) } else { svg::write(picture) }
}

/// The name of a file without folder and ending, unless another has the same.
fn short(path: &str, all: &[String]) -> String {
    let stem = |path: &str| {
        Path::new(path)
            .file_stem()
            .map_or(path.to_string(), |stem| stem.to_string_lossy().into_owned())
    };
    let own = stem(path);
    if all.iter().filter(|other| stem(other) == own).count() > 1 { path.to_string() } else { own }
}

fn choice(
    arguments: &Arguments,
    loaded: &[(String, Trace)],
    session: &mut Session,
) -> Result<Choice, Exit> {
    let usage = |session: &mut Session, message: String| {
        session.fail(Diagnostic::error("E0940", Span::NONE, message))
    };
    let mut per_unit = vec![];
    for (name, base) in names(arguments.pu.as_deref().unwrap_or("")) {
        let base = base.parse().ok().filter(|base: &f64| *base != 0.0 && base.is_finite());
        let Some(base) = base else {
            return Err(usage(
                session,
                format!("--pu takes NAME=BASE with a number that is not 0, for `{name}`"),
            ));
        };
        per_unit.push((name, base));
    }
    let ends = loaded.iter().filter_map(|(_, trace)| {
        let time = trace.time();
        Some((*time.first()?, *time.last()?))
    });
    let (first, last) = ends.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), (a, b)| {
        (low.min(a.min(b)), high.max(a.max(b)))
    });
    let limits = (arguments.from.unwrap_or(first), arguments.to.unwrap_or(last));
    let asked = arguments.from.is_some() || arguments.to.is_some();
    if asked && (limits.0 >= limits.1 || !limits.0.is_finite() || !limits.1.is_finite()) {
        return Err(usage(
            session,
            format!("nothing lies between --from {} and --to {}", limits.0, limits.1),
        ));
    }
    Ok(Choice {
        signals: names(arguments.signals.as_deref().unwrap_or(""))
            .into_iter()
            .map(|(name, _)| name)
            .collect(),
        per_unit,
        over: arguments.over.clone(),
        kind: if arguments.nyquist { Kind::Nyquist } else { Kind::Bode },
        limits: asked.then_some(limits),
    })
}
