//! `bondspice bode MODEL.bg`: the frequency response of some variables to another one.

use super::linear::{self, PointFlags};
use super::output::Output;
use super::session::{Exit, Session};
use crate::analysis::linear::Linear;
use crate::analysis::poles::poles;
use crate::analysis::response::{Response, decades, phases, response};
use crate::diagnostic::Diagnostic;
use crate::source::Span;
use crate::trace::Sink;
use crate::trace::formats::Heading;

/// What it does, in a line.
pub const ABOUT: &str = "Frequency response of some variables to another one";

/// An example for the help.
pub const EXAMPLE: &str = "\
Columns: frequency, then of each variable its real and imaginary part over that of --from, its size in dB and its phase in
degrees. Without --start and --stop a decade beyond the poles to either side.

Example: bondspice bode models/rlc.bg --from 'e(U)' --to 'f(mesh)' -o rlc.csv
         bondspice bode models/eha_one_line.bg --at 2s --from alpha --to 'f(armature)' --start 1Hz --stop 1kHz
         bondspice bode deck.cir --from V1 --to 'v(out)'";

/// Its flags.
#[derive(clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    point: PointFlags,
    /// The variable that is imposed; what determines it otherwise is put aside
    #[arg(long, value_name = "VARIABLE")]
    from: String,
    /// The variables that are read: 'EXPR [in UNIT] [as "NAME"], …'
    #[arg(long, value_name = "LIST")]
    to: String,
    /// The lowest frequency: 1Hz, 10rad/s
    #[arg(long, value_name = "FREQUENCY")]
    start: Option<String>,
    /// The highest frequency
    #[arg(long, value_name = "FREQUENCY")]
    stop: Option<String>,
    /// Frequencies a decade
    #[arg(long, value_name = "N", default_value_t = 50, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    points: u32,
    /// Form of the result: csv, raw, json, …; without it the ending of -o says
    #[arg(long, value_name = "FORM")]
    format: Option<String>,
    /// Head columns as `name [unit]`
    #[arg(long)]
    units: bool,
    /// Where to write the result
    #[arg(short, long, value_name = "FILE")]
    output: Option<String>,
}

/// Computes it and writes it.
///
/// # Errors
/// The exit code, when the reason has been said.
pub fn run(arguments: Arguments, session: &mut Session) -> Result<(), Exit> {
    let arguments = &arguments;
    let (from, to) = (Some(arguments.from.as_str()), Some(arguments.to.as_str()));
    let linear = &linear::linearise(&arguments.point, from, to, session)?;
    if linear.inputs.len() != 1 {
        let message = "--from takes one variable";
        return Err(session.fail(Diagnostic::error("E0940", Span::NONE, message)));
    }
    let frequencies = frequencies(arguments, linear, session)?;
    let response = response(linear, 0, &frequencies).map_err(|error| session.fail(*error))?;
    write(arguments, linear, &response, session)
}

/// What --start, --stop and --points ask for.
fn frequencies(
    arguments: &Arguments,
    linear: &Linear,
    session: &mut Session,
) -> Result<Vec<f64>, Exit> {
    let mut given = |flag: &str, text: &Option<String>| {
        let takes = format!("{flag} takes a frequency above 0, as in 10Hz");
        let read = |text: &String| linear::quantity(text, "Hz", &takes, session);
        text.as_ref().map(read).transpose()
    };
    let (start, stop) = (given("--start", &arguments.start)?, given("--stop", &arguments.stop)?);
    let (low, high) = match (start, stop) {
        (Some(low), Some(high)) => (low, high),
        _ => {
            let poles = poles(linear).map_err(|error| session.fail(*error))?;
            let sizes = || poles.iter().map(|pole| pole.frequency()).filter(|size| *size > 0.0);
            let low = sizes().fold(f64::INFINITY, f64::min);
            let high = sizes().fold(0.0, f64::max);
            let (low, high) = if high > 0.0 { (0.1 * low, 10.0 * high) } else { (0.1, 10.0) };
            // Whole decades read well.
            let (low, high) = (10f64.powf(low.log10().floor()), 10f64.powf(high.log10().ceil()));
            match (start, stop) {
                (Some(start), _) => (start, high.max(10.0 * start)),
                (_, Some(stop)) => (low.min(0.1 * stop), stop),
                _ => (low, high),
            }
        }
    };
    if !(low > 0.0 && high > low) {
        let message = format!("a response needs 0 < start < stop, not {low} Hz and {high} Hz");
        return Err(session.fail(Diagnostic::error("E0940", Span::NONE, message)));
    }
    Ok(decades(low, high, arguments.points as usize))
}

fn write(
    arguments: &Arguments,
    linear: &Linear,
    response: &Response,
    session: &mut Session,
) -> Result<(), Exit> {
    let (mut names, mut units) = (vec!["frequency".to_string()], vec!["Hz".to_string()]);
    for output in &linear.outputs {
        let over = match (output.unit.as_str(), linear.inputs[0].unit.as_str()) {
            (own, "") => own.to_string(),
            ("", by) => format!("1/({by})"),
            (own, by) if own == by => String::new(),
            (own, by) => format!("({own})/({by})"),
        };
        for (part, unit) in
            [("re", over.as_str()), ("im", over.as_str()), ("db", "dB"), ("deg", "deg")]
        {
            names.push(format!("{}.{part}", output.name));
            units.push(unit.to_string());
        }
    }
    let heading = Heading {
        title: format!("{} over {}", linear.name, linear.inputs[0].name),
        units: arguments.units,
    };
    let (to, format) = (arguments.output.as_deref(), arguments.format.as_deref());
    let mut output = Output::open(to, format, heading, &names, &units, session)?;
    let phases: Vec<Vec<f64>> = response.values.iter().map(|values| phases(values)).collect();
    for (k, frequency) in response.frequencies.iter().enumerate() {
        let mut row = vec![*frequency];
        for (values, phases) in response.values.iter().zip(&phases) {
            let value = values[k];
            let size = libm::hypot(value.re, value.im);
            row.extend([value.re, value.im, 20.0 * size.log10(), phases[k]]);
        }
        let written = output.row(&row);
        written.map_err(|error| session.unwritable(to.unwrap_or("<stdout>"), &error))?;
    }
    output.close(true, session)
}
