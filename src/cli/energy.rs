//! `bondspice energy MODEL.bg`: where the energy of a run comes from, where it goes, and where it is meanwhile.

use super::flags::ReportFlags;
use super::output::{Output, write_text};
use super::pipeline;
use super::plot;
use super::run::endless;
use super::session::{Exit, Session};
use super::table::{Table, short};
use crate::diagnostic::Diagnostic;
use crate::draw::balance::{self, Share, shares};
use crate::draw::plot::flows;
use crate::second::flows::Flow;
use crate::second::{self, Run};
use crate::source::Span;
use crate::trace::Sink;
use crate::trace::formats::Heading;
use crate::verify::EnergyReport;
use serde_json::{Value, json};

/// What it does, in a line.
pub const ABOUT: &str =
    "Show where the energy of a run comes from and where it goes, element by element";

/// An example for the help.
pub const EXAMPLE: &str = "\
The run is that of the bond graph's own equations, as in verify. --plot draws what storages hold and the power of all other
elements over time, --sankey the balance as bands as broad as they are large, --trace writes power and energy of every
element as columns.

Example: bondspice energy models/eha_one_line.bg
         bondspice energy models/eha_one_line.bg --plot energy.svg --sankey balance.svg
         bondspice energy models/rlc.bg --until 5ms --step 10us --trace flows.csv";

/// Its flags.
#[derive(clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    report: ReportFlags,
    /// Where to draw energies and powers over time: .svg or .tex
    #[arg(long, value_name = "FILE")]
    plot: Option<String>,
    /// Where to draw the balance as bands: .svg or .tex
    #[arg(long, value_name = "FILE")]
    sankey: Option<String>,
    /// Where to write power and energy of every element at every row: .csv, .raw, .json, …
    #[arg(long, value_name = "FILE")]
    trace: Option<String>,
}

/// Runs the model and shows its energies.
///
/// # Errors
/// The exit code, when the reason has been said.
pub fn run(arguments: Arguments, session: &mut Session) -> Result<(), Exit> {
    let form = |name: &Option<String>, session: &mut Session| match name {
        Some(name) => plot::form(Some(name), session),
        None => Ok(""),
    };
    let (plotted, banded) = (form(&arguments.plot, session)?, form(&arguments.sankey, session)?);
    let (name, run) = simulate(&arguments.report, session)?;
    let report = EnergyReport::of(&run.energy, 1e-6);
    if let Some(file) = &arguments.plot {
        let title = format!("{name}: energies and powers");
        let panels = flows(&run.columns[0], &run.flows);
        plot::show(&title, &panels, plotted, Some(file), session)?;
    }
    if let Some(file) = &arguments.sankey {
        let [into, out] = shares(&report);
        let words = |size: f64| format!("{} J", short(size));
        let until = run.columns[0].last().copied().unwrap_or(0.0);
        let title = format!("{name}: energy over {} s", short(until));
        let picture = balance::paint(&title, [&into, &out], &words);
        write_text(Some(file), &plot::text(&picture, banded), session)?;
    }
    if let Some(file) = &arguments.trace {
        write_flows(&name, &run, file, session)?;
    }
    let text = match arguments.report.format.as_str() {
        "json" => format!("{:#}\n", to_json(&name, &run, &report)),
        _ => to_text(&run, &report),
    };
    write_text(arguments.report.output.as_deref(), &text, session)
}

/// Runs the second route with what flows.
fn simulate(flags: &ReportFlags, session: &mut Session) -> Result<(String, Run), Exit> {
    let (file, overrides) = flags.model.of(&flags.file, "asked for its energies", session)?;
    let mut d = vec![];
    let model = pipeline::model(&mut session.map, file, &overrides, &mut d);
    let found = model.and_then(|model| {
        let experiment = &model.graph.experiment;
        let (Some(until), Some(step)) = (experiment.until, experiment.step) else {
            d.push(endless());
            return None;
        };
        let times = rows(until, step);
        let settings = second::Settings { flows: true, ..second::Settings::default() };
        let run = second::integrate(&model.graph, &model.causality, &times, &settings, &mut d)?;
        Some((model.graph.name.clone(), run))
    });
    session.say(d);
    match (found, session.exit()) {
        (Some((_, run)), Exit::Fine) if run.flows.is_empty() => {
            let message = "no element of the model has a bond whose effort times flow is a power";
            let error = Diagnostic::error("E1011", Span::NONE, message);
            Err(session.fail(error.help(
                "bonds of pseudo domains (temperature and heat flow, pressure and mass flow) carry no power",
            )))
        }
        (Some(found), Exit::Fine) => Ok(found),
        (_, exit) => Err(exit),
    }
}

/// 0, step, 2·step … until, both ends included.
fn rows(until: f64, step: f64) -> Vec<f64> {
    let whole = (until / step + 1e-9).floor();
    let mut times: Vec<f64> = (0..=whole as u64).map(|k| k as f64 * step).collect();
    match times.last_mut() {
        Some(last) if until - *last <= 1e-9 * step => *last = until,
        _ => times.push(until),
    }
    times
}

/// The greatest power of an element by size, and when.
fn peak(flow: &Flow, times: &[f64]) -> (f64, f64) {
    let rows = flow.power.iter().zip(times);
    let greatest = rows.max_by(|a, b| a.0.abs().total_cmp(&b.0.abs()));
    greatest.map_or((0.0, 0.0), |(power, time)| (*power, *time))
}

/// Elements with what they have delivered, taken or gained, and their flows.
fn elements(run: &Run) -> impl Iterator<Item = (&Flow, f64)> {
    // Both lists hold the elements whose bonds carry power, in the order of the file.
    run.flows.iter().zip(&run.energy.shares).map(|(flow, share)| (flow, share.energy))
}

fn to_text(run: &Run, report: &EnergyReport) -> String {
    let times = &run.columns[0];
    let mut table =
        Table::new(&["element", "role", "energy J", "of input %", "peak power W", "at s"]);
    // In parts of all that comes in, as in the bands.
    let sum = |side: &[Share]| side.iter().map(|share| share.size).sum::<f64>();
    let [into, out] = shares(report);
    let all = sum(&into).max(sum(&out));
    let mut rows: Vec<(&Flow, f64)> = elements(run).collect();
    rows.sort_by(|a, b| {
        (a.0.role as u8).cmp(&(b.0.role as u8)).then(b.1.abs().total_cmp(&a.1.abs()))
    });
    for (flow, energy) in rows {
        let (power, at) = peak(flow, times);
        let part = if all > 0.0 { 100.0 * energy / all } else { 0.0 };
        table.row([
            flow.name.clone(),
            flow.role.name().to_string(),
            short(energy),
            format!("{part:.2}"),
            short(power),
            short(at),
        ]);
    }
    let mut sums = Table::new(&["all", "J"]);
    for (name, value) in [
        ("in", report.delivered),
        ("dissipated", report.dissipated),
        ("stored", report.stored),
        ("modulated", report.modulated),
        ("in by jumps", report.jumps),
    ] {
        if name != "in by jumps" || value != 0.0 {
            sums.row([name.to_string(), short(value)]);
        }
    }
    format!("{}\n{}\nresidual {:.1e}\n", table.to_text(), sums.to_text(), report.residual)
}

fn to_json(name: &str, run: &Run, report: &EnergyReport) -> Value {
    let element = |(flow, energy): (&Flow, f64)| {
        let (power, at) = peak(flow, &run.columns[0]);
        json!({
            "name": flow.name,
            "role": flow.role.name(),
            "energy": energy,
            "peak": {"power": power, "at": at},
        })
    };
    json!({
        "schema": 1,
        "model": name,
        "until": run.columns[0].last(),
        "in": report.delivered,
        "dissipated": report.dissipated,
        "stored": report.stored,
        "modulated": report.modulated,
        "jumps": report.jumps,
        "residual": report.residual,
        "elements": elements(run).map(element).collect::<Vec<_>>(),
    })
}

/// Power and energy of every element as columns.
fn write_flows(name: &str, run: &Run, file: &str, session: &mut Session) -> Result<(), Exit> {
    let (mut names, mut units) = (vec!["time".to_string()], vec!["s".to_string()]);
    for flow in &run.flows {
        names.extend([format!("power({})", flow.name), format!("energy({})", flow.name)]);
        units.extend(["W".to_string(), "J".to_string()]);
    }
    let heading = Heading { title: format!("{name}: powers and energies"), units: true };
    let mut output = Output::open(Some(file), None, heading, &names, &units, session)?;
    for (row, time) in run.columns[0].iter().enumerate() {
        let mut values = vec![*time];
        values.extend(run.flows.iter().flat_map(|flow| [flow.power[row], flow.energy[row]]));
        output.row(&values).map_err(|error| session.unwritable(file, &error))?;
    }
    output.close(true, session)
}
