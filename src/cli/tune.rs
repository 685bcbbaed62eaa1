//! `bondspice tune MODEL.bg`: gains of regulators from the bandwidths and margins that `loop` statements ask for.

use super::linear::PointFlags;
use super::output::write_text;
use super::session::{Exit, Session};
use super::table::{Table, short};
use crate::analysis::tune::Tuned;
use serde_json::{Value, json};

/// What it does, in a line.
pub const ABOUT: &str =
    "Design the gains of PI regulators from bandwidth and phase margin, innermost loop first";

/// An example for the help.
pub const EXAMPLE: &str = "\
The model says what is wanted: loop alpha: f(armature) follows I_ref, bandwidth 2000 rad/s, margin 80 deg
The last line that is printed sets the gains in any other command.

Example: bondspice tune models/eha_one_line.bg
         bondspice simulate models/eha_one_line.bg $(bondspice tune models/eha_one_line.bg --format flags)";

/// Its flags.
#[derive(clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    point: PointFlags,
    /// Form of the result; flags are the --set alone
    #[arg(long, value_name = "FORM", value_parser = ["text", "json", "flags"], default_value = "text")]
    format: String,
    /// Where to write the result
    #[arg(short, long, value_name = "FILE")]
    output: Option<String>,
}

/// Designs and shows.
///
/// # Errors
/// The exit code, when the reason has been said.
pub fn run(arguments: Arguments, session: &mut Session) -> Result<(), Exit> {
    let arguments = &arguments;
    let (tuned, left_out) = super::linear::tuned(&arguments.point, session)?;
    let text = match arguments.format.as_str() {
        "json" => format!("{:#}\n", to_json(&tuned, &left_out)),
        "flags" => flags(&tuned) + "\n",
        _ => to_text(&tuned, &left_out),
    };
    write_text(arguments.output.as_deref(), &text, session)
}

fn flags(tuned: &[Tuned]) -> String {
    let one = |tuned: &Tuned| {
        let [kp, ki] = &tuned.names;
        format!("--set {kp}={} --set {ki}={}", tuned.gains[0], tuned.gains[1])
    };
    tuned.iter().map(one).collect::<Vec<_>>().join(" ")
}

fn to_text(tuned: &[Tuned], left_out: &[String]) -> String {
    let headers = [
        "loop",
        "controls",
        "Kp",
        "Ki",
        "crossover rad/s",
        "margin deg",
        "gain margin",
        "-3 dB rad/s",
    ];
    let mut table = Table::new(&headers);
    for one in tuned {
        table.row([
            one.signal.clone(),
            one.controlled.clone(),
            short(one.gains[0]),
            short(one.gains[1]),
            short(one.margins.crossover),
            short(one.margins.phase.to_degrees()),
            one.margins.gain.map_or("none".into(), |(factor, at)| {
                format!("{} at {} rad/s", short(factor), short(at))
            }),
            one.margins.bandwidth.map_or("-".into(), short),
        ]);
    }
    let mut text = table.to_text();
    for one in tuned {
        if one.unstable > 0 {
            text += &format!(
                "\nthe loop of {} is unstable: {} poles on the right\n",
                one.signal, one.unstable
            );
        }
        if one.larger {
            text += &format!(
                "\nthe margin of {} is larger than asked for: no lag of a PI regulator makes it as small\n",
                one.signal
            );
        }
    }
    if !left_out.is_empty() {
        text += &format!("\nlaws left out, not being linear: {}\n", left_out.join(", "));
    }
    text + "\n" + &flags(tuned) + "\n"
}

fn to_json(tuned: &[Tuned], left_out: &[String]) -> Value {
    let one = |one: &Tuned| {
        json!({
            "signal": one.signal,
            "controlled": one.controlled,
            "bandwidth_wanted": one.wanted[0],
            "margin_wanted": one.wanted[1].to_degrees(),
            "gains": {one.names[0].clone(): one.gains[0], one.names[1].clone(): one.gains[1]},
            "crossover": one.margins.crossover,
            "phase_margin": one.margins.phase.to_degrees(),
            "gain_margin": one.margins.gain.map(|(factor, at)| json!({"factor": factor, "at": at})),
            "bandwidth": one.margins.bandwidth,
            "unstable_poles": one.unstable,
        })
    };
    json!({
        "schema": 1,
        "loops": tuned.iter().map(one).collect::<Vec<_>>(),
        "left_out": left_out,
        "flags": flags(tuned),
    })
}
