//! `bondspice poles MODEL.bg`: poles with frequency, damping and the storages that take part; zeros.

use super::linear::{PointFlags, WayFlags};
use super::output::write_text;
use super::plot;
use super::session::{Exit, Session};
use super::table::{Table, short};
use crate::analysis::export;
use crate::analysis::linear::Linear;
use crate::analysis::poles::{Pole, poles, zeros};
use crate::draw::plot::{self as draw, Panel};
use crate::linear::Complex;
use crate::linear::roots::Root;

/// What it does, in a line.
pub const ABOUT: &str =
    "Show poles with frequency, damping and the storages that take part in them; zeros";

/// An example for the help.
pub const EXAMPLE: &str = "\
What part a storage has in a pole is told in parts of 1 (participation factors). Zeros are those of the way from --from
to --to; imposing a variable with --from puts aside what determines it otherwise, and so moves the poles, too.

Example: bondspice poles models/eha_one_line.bg --at 2s
         bondspice poles models/rlc.bg --from 'e(U)' --to 'f(mesh)'
         bondspice poles models/eha_one_line.bg --from x_ref --to x --plot poles.svg
         bondspice poles deck.cir --from V1 --to 'v(out)'";

/// Its flags.
#[derive(clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    point: PointFlags,
    #[command(flatten)]
    way: WayFlags,
    /// Form of the result
    #[arg(long, value_name = "FORM", value_parser = ["text", "json"], default_value = "text")]
    format: String,
    /// Where to draw poles and zeros in the plane of s: .svg or .tex
    #[arg(long, value_name = "FILE")]
    plot: Option<String>,
    /// Where to write the result
    #[arg(short, long, value_name = "FILE")]
    output: Option<String>,
}

/// Finds them and shows them.
///
/// # Errors
/// The exit code, when the reason has been said.
pub fn run(arguments: Arguments, session: &mut Session) -> Result<(), Exit> {
    let arguments = &arguments;
    let linear = &arguments.way.linearise(&arguments.point, session)?;
    let poles = poles(linear).map_err(|error| session.fail(*error))?;
    let zeros = match arguments.way.given() {
        true => Some(zeros(linear, 0, 0).map_err(|error| session.fail(*error))?),
        false => None,
    };
    if let Some(name) = &arguments.plot {
        let form = plot::form(Some(name), session)?;
        let title =
            format!("{}: poles{}", linear.name, zeros.as_ref().map_or("", |_| " and zeros"));
        plot::show(&title, &map(linear, &poles, zeros.as_deref()), form, Some(name), session)?;
    }
    let text = match arguments.format.as_str() {
        "json" => format!("{:#}\n", export::poles_to_json(linear, &poles, zeros.as_deref())),
        _ => to_text(linear, &poles, zeros.as_deref()),
    };
    write_text(arguments.output.as_deref(), &text, session)
}

/// Poles and zeros as a picture; a pole is called by the storage that takes the greatest part in it.
fn map(linear: &Linear, poles: &[Pole], zeros: Option<&[Root]>) -> Vec<Panel> {
    let times = |name: &str, count: usize| match count {
        1 => name.to_string(),
        count => format!("{name} ×{count}").trim_start().to_string(),
    };
    let pole = |pole: &Pole| {
        let first = pole.parts.first().map(|(k, _)| linear.unknowns[*k].name.as_str());
        let name = times(first.unwrap_or(""), pole.multiplicity);
        draw::Root { at: (pole.at.re, pole.at.im), name }
    };
    let zero = |zero: &Root| {
        let name = if zero.at.im < 0.0 { String::new() } else { times("", zero.multiplicity) };
        draw::Root { at: (zero.at.re, zero.at.im), name }
    };
    let poles: Vec<draw::Root> = poles.iter().map(pole).collect();
    let zeros: Vec<draw::Root> = zeros.unwrap_or(&[]).iter().map(zero).collect();
    draw::roots(&poles, &zeros)
}

fn place(at: Complex) -> String {
    if at.im == 0.0 {
        return short(at.re);
    }
    let sign = if at.im > 0.0 { '+' } else { '-' };
    format!("{} {sign} {}j", short(at.re), short(at.im.abs()))
}

fn to_text(linear: &Linear, poles: &[Pole], zeros: Option<&[Root]>) -> String {
    let mut table = Table::new(&["pole 1/s", "Hz", "damping", "time constant s", "takes part"]);
    let mut text = format!("{} linear {}\n\n", linear.name, export::place(linear));
    // Of two conjugate poles one line tells all.
    for pole in poles.iter().filter(|pole| pole.at.im >= 0.0) {
        let parts = pole.parts.iter().filter(|(_, part)| *part >= 0.01).take(5);
        let parts: Vec<String> =
            parts.map(|(k, part)| format!("{} {part:.2}", linear.unknowns[*k].name)).collect();
        let times = if pole.multiplicity > 1 {
            format!(" ({} times)", pole.multiplicity)
        } else {
            String::new()
        };
        let at = match pole.at.im > 0.0 {
            true => format!("{} ± {}j", short(pole.at.re), short(pole.at.im)),
            false => place(pole.at),
        };
        table.row([
            at + &times,
            if pole.at.im > 0.0 { short(pole.frequency()) } else { "-".into() },
            pole.damping().filter(|_| pole.at.im > 0.0).map_or("-".into(), short),
            pole.time_constant().map_or("-".into(), short),
            parts.join(", "),
        ]);
    }
    text += &if table.is_empty() { "no poles\n".to_string() } else { table.to_text() };
    let unstable: usize =
        poles.iter().filter(|pole| pole.at.re > 0.0).map(|pole| pole.multiplicity).sum();
    if unstable > 0 {
        text += &format!("\nunstable: {unstable} of them on the right of the imaginary axis\n");
    }
    if let Some(zeros) = zeros {
        let mut table = Table::new(&["zero 1/s", "Hz"]);
        for zero in zeros {
            let times = if zero.multiplicity > 1 {
                format!(" ({} times)", zero.multiplicity)
            } else {
                String::new()
            };
            let hertz = libm::hypot(zero.at.re, zero.at.im) / std::f64::consts::TAU;
            table.row([
                place(zero.at) + &times,
                if zero.at.im == 0.0 { "-".into() } else { short(hertz) },
            ]);
        }
        text += "\n";
        text += &if table.is_empty() { "no zeros\n".to_string() } else { table.to_text() };
    }
    text
}
