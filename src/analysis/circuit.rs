//! A circuit as a linear model: what linear theory says of netlists, too.
//!
//! The circuit gives (G + s·C)·x = B·u with x its node voltages and branch currents. C is made of charges and fluxes,
//! C·x = Σ_k a_k·q_k with q_k = c_k·x, so that with their rates i_k
//!
//! ```text
//! q_k' = i_k        0 = q_k − c_k·x        0 = −G·x − Σ_k a_k·i_k + B·u
//! ```
//!
//! States are the charges of capacitors and the fluxes of inductors; inputs are independent sources, by their names.

use super::linear::{Channel, Entry, Linear, Quantity};
use super::point::At;
use crate::bond::equations::slopes::Slopes;
use crate::circuit::{Circuit, DeviceId, DeviceKind};
use crate::diagnostic::Diagnostic;
use crate::quantity::nearest;
use crate::sim::{self, System};
use crate::source::Span;

/// Linearises a circuit at its operating point. `inputs` are the names of sources; without them all of them.
///
/// # Errors
/// When there is no such source, no operating point, or no linear system of finite order.
pub fn linearise(circuit: &Circuit, inputs: Option<&[&str]>) -> Result<Linear, Box<Diagnostic>> {
    // A linear circuit is the same everywhere: where it has no operating point, its point is not known.
    let of = |wanted| sim::Linear::of_circuit(circuit, wanted);
    let (system, found) = of(true)
        .or_else(|_| {
            let (system, mut found) = of(false)?;
            found.charges.iter_mut().for_each(|charge| charge.value = f64::NAN);
            found.point.fill(f64::NAN);
            Ok((system, found))
        })
        .map_err(|failure: sim::Failure| failure.diagnostic)?;
    if found.delays.iter().any(|delay| !delay.entries.is_empty()) {
        let message = "a circuit with delays or lines has no linear system of finite order";
        let help = "put sections of L and C in the place of a line, or use `.ac`";
        return Err(Box::new(Diagnostic::error("E0927", Span::NONE, message).help(help)));
    }
    let (m, n) = (found.charges.len() as u32, found.len());
    let number = Entry::number;
    let x = |k: u32| 2 * m + k;
    let mut rows: Vec<Vec<(u32, Entry)>> = vec![vec![]; 2 * m as usize + n];
    for (k, charge) in (0u32..).zip(&found.charges) {
        rows[k as usize].push((m + k, number(1.0)));
        let own = &mut rows[(m + k) as usize];
        own.push((k, number(1.0)));
        own.extend(charge.slopes.iter().map(|(column, slope)| (x(*column), number(-slope))));
        for (row, factor) in &charge.into {
            rows[x(*row) as usize].push((m + k, number(-factor)));
        }
    }
    for (row, column, value) in &found.conductances {
        rows[x(*row) as usize].push((x(*column), number(-value)));
    }
    let outputs = found.outputs.iter().take(found.outputs.len() - system.watched).map(|output| {
        let terms = output.terms.iter().map(|(column, factor)| (x(*column), number(*factor)));
        let rates = output.charges.iter().map(|(charge, factor)| (m + charge, number(*factor)));
        let unit = match output.name.get(..2) {
            Some("v(") => "V",
            Some("i(") => "A",
            _ => "",
        };
        channel(&output.name, unit, terms.chain(rates).collect())
    });
    let outputs: Vec<Channel> = outputs.collect();
    let inputs = chosen(circuit, &system, &found, inputs)?
        .into_iter()
        .map(|source| {
            let unit = match device(circuit, source.device) {
                Some(DeviceKind::VoltageSource { .. }) => "V",
                _ => "A",
            };
            let into = source.into.iter().map(|(row, factor)| (x(*row), number(*factor)));
            channel(system.spoken_device(source.device), unit, into.collect())
        })
        .collect();
    let total = rows.len();
    Ok(Linear {
        name: circuit.title.clone(),
        at: At::Rest,
        time: 0.0,
        unknowns: quantities(circuit, &system, &found),
        kinds: vec![],
        states: m as usize,
        rated: (0..total).map(|row| row < m as usize).collect(),
        rows,
        gives: vec![],
        origins: vec![],
        inputs,
        direct: vec![vec![]; outputs.len()],
        outputs,
        slopes: Slopes::default(),
        values: vec![],
    })
}

fn channel(name: &str, unit: &str, entries: Vec<(u32, Entry)>) -> Channel {
    Channel { name: name.into(), unit: unit.into(), factor: 1.0, entries, unknown: None }
}

fn device(circuit: &Circuit, id: DeviceId) -> Option<&DeviceKind> {
    circuit.devices.get(id.0 as usize).map(|device| &device.kind)
}

/// The sources of these names, in their order.
fn chosen<'l>(
    circuit: &Circuit,
    system: &System,
    found: &'l sim::Linear,
    names: Option<&[&str]>,
) -> Result<Vec<&'l sim::Source>, Box<Diagnostic>> {
    let Some(names) = names else { return Ok(found.sources.iter().collect()) };
    let one = |name: &&str| {
        let same = |source: &&sim::Source| {
            let own = circuit.devices.get(source.device.0 as usize);
            own.is_some_and(|own| own.name.eq_ignore_ascii_case(name))
                || system.spoken_device(source.device) == *name
        };
        found.sources.iter().find(same).ok_or_else(|| {
            let message = format!("`{name}` is no independent source of the netlist");
            let error = Diagnostic::error("E0929", Span::NONE, message);
            let all = || found.sources.iter().map(|source| system.spoken_device(source.device));
            Box::new(match nearest(name, all()) {
                Some(meant) => error.help(format!("did you mean `{meant}`?")),
                None => {
                    let all: Vec<&str> = all().collect();
                    let none = "inputs of a netlist are its independent sources, and it has none";
                    match all.is_empty() {
                        true => error.because(none),
                        false => error.because(format!("its sources are {}", all.join(", "))),
                    }
                }
            })
        })
    };
    names.iter().map(one).collect()
}

/// Charges and fluxes, their rates, then the circuit's unknowns.
fn quantities(circuit: &Circuit, system: &System, found: &sim::Linear) -> Vec<Quantity> {
    let mut all = vec![];
    for (rates, charge_unit, flux_unit) in [(false, "C", "Wb"), (true, "A", "V")] {
        for (k, charge) in found.charges.iter().enumerate() {
            let flux = matches!(
                device(circuit, charge.device),
                Some(DeviceKind::Inductor { .. } | DeviceKind::BehaviouralInductor { .. })
            );
            let name = system.spoken_device(charge.device);
            // A device of several charges numbers them.
            let same = |other: &&sim::Charge| other.device == charge.device;
            let number = match found.charges.iter().filter(same).count() {
                1 => String::new(),
                _ => format!(".{}", found.charges[..=k].iter().filter(same).count()),
            };
            let letter = if flux { "phi" } else { "q" };
            let stored = format!("{letter}({name}{number})");
            all.push(Quantity {
                name: if rates { format!("der({stored})") } else { stored },
                unit: (if flux { flux_unit } else { charge_unit }).into(),
                value: if rates { 0.0 } else { charge.value },
            });
        }
    }
    let unknowns = found.unknowns.iter().zip(&found.point).enumerate();
    all.extend(unknowns.map(|(k, (unknown, value))| Quantity {
        name: system.spoken_unknown(k).into(),
        unit: (if unknown.voltage { "V" } else { "A" }).into(),
        value: *value,
    }));
    all
}
