//! Harmonics of a run: told as tables on stderr, written to a file.

use super::output::write_text;
use super::session::{Exit, MessageFormat, Session};
use super::table::{Table, short};
use crate::diagnostic::Diagnostic;
use crate::source::Span;
use crate::trace::fourier::Spectrum;
use serde_json::json;

/// What was found in a run, or in one of its steps.
pub struct Harmonics {
    /// The step, where there are several.
    pub step: Option<f64>,
    /// The card.
    pub span: Span,
    /// The harmonics of each item, or why there are none.
    pub found: Result<Vec<Spectrum>, String>,
}

/// Tells harmonics as ngspice does, and warns of those that there are none of; writes them to a file where one is named.
///
/// # Errors
/// The exit code, when the reason has been said.
pub fn tell(all: &[Harmonics], file: Option<&str>, session: &mut Session) -> Result<(), Exit> {
    let mut warnings = vec![];
    for one in all {
        match &one.found {
            Ok(spectra) if session.global.message_format == MessageFormat::Human => {
                spectra.iter().for_each(|spectrum| session.remark(&text(one.step, spectrum)));
            }
            Ok(_) => {}
            Err(why) => {
                let warning = Diagnostic::warning("W0793", one.span, "there are no harmonics");
                let mut warning = warning.because(why.clone());
                warning.notes.extend(one.step.map(|step| format!("in step {step}")));
                warnings.push(warning);
            }
        }
    }
    session.say(warnings);
    let Some(file) = file else { return Ok(()) };
    let text = match file.rsplit_once('.').map(|(_, ending)| ending.to_lowercase()).as_deref() {
        Some("json") => to_json(all),
        Some("csv") => to_csv(all),
        _ => {
            let message = format!("the ending of `{file}` says no format of harmonics");
            let error = Diagnostic::error("E0941", Span::NONE, message);
            return Err(session.fail(error.help("harmonics are written as .csv or .json")));
        }
    };
    write_text(Some(file), &text, session)
}

/// One line for each harmonic.
fn text(step: Option<f64>, spectrum: &Spectrum) -> String {
    let within = step.map_or(String::new(), |step| format!(" in step {step}"));
    let head = ["harmonic", "frequency", "magnitude", "phase", "norm. mag", "norm. phase"];
    let mut table = Table::new(&head);
    for (k, [frequency, magnitude, phase, part, turned]) in lines(spectrum).enumerate() {
        let cells = [frequency, magnitude, phase, part, turned].map(short);
        table.row(std::iter::once(k.to_string()).chain(cells));
    }
    format!(
        "harmonics of {}{within}, distortion {} %\n\n{}",
        spectrum.name,
        short(100.0 * spectrum.distortion),
        table.to_text()
    )
}

/// Frequency, magnitude, phase, and both by those of the first harmonic; the mean has neither.
fn lines(spectrum: &Spectrum) -> impl Iterator<Item = [f64; 5]> + '_ {
    let first = spectrum.harmonics.get(1).copied().unwrap_or((f64::NAN, f64::NAN));
    spectrum.harmonics.iter().enumerate().map(move |(k, (magnitude, phase))| {
        let frequency = k as f64 * spectrum.frequency;
        match k {
            0 => [frequency, *magnitude, 0.0, 0.0, 0.0],
            _ => [frequency, *magnitude, *phase, magnitude / first.0, phase - first.1],
        }
    })
}

fn to_json(all: &[Harmonics]) -> String {
    let spectra = all.iter().flat_map(|one| {
        one.found.iter().flatten().map(|spectrum| {
            let harmonics = lines(spectrum).map(|[frequency, magnitude, phase, part, turned]| {
                json!({
                    "frequency": frequency, "magnitude": magnitude, "phase": phase,
                    "normalised_magnitude": part, "normalised_phase": turned,
                })
            });
            let mut value = json!({
                "output": spectrum.name, "frequency": spectrum.frequency,
                "distortion": spectrum.distortion, "harmonics": harmonics.collect::<Vec<_>>(),
            });
            if let Some(step) = one.step {
                value["step"] = json!(step);
            }
            value
        })
    });
    format!("{:#}\n", json!({"schema": 1, "fourier": spectra.collect::<Vec<_>>()}))
}

fn to_csv(all: &[Harmonics]) -> String {
    let stepped = all.iter().any(|one| one.step.is_some());
    let mut text = String::from(if stepped { "step," } else { "" });
    text += "output,harmonic,frequency,magnitude,phase,normalised_magnitude,normalised_phase\n";
    for one in all {
        for spectrum in one.found.iter().flatten() {
            for (k, line) in lines(spectrum).enumerate() {
                text += &one.step.map_or(String::new(), |step| format!("{step},"));
                text += &format!("\"{}\",{k}", spectrum.name.replace('"', "\"\""));
                line.iter().for_each(|value| text += &format!(",{value}"));
                text.push('\n');
            }
        }
    }
    text
}
