//! A compiled circuit: sparse static parts, one program for all laws, and the patterns of the two matrices.
//!
//! ```text
//! G·x + f(x, t, m) + A·d/dt Q(x) = b(t),     Q(x) = C·x + q(x)
//! dynamic matrix   W(α) = G + f' + α·A·(C + q')                 n × n        α = 1/(γh)
//! frozen network   F    = [ G + f'   A ]   unknowns (x, w)       (n + K)²     w = dQ/dt
//!                         [ C + q'   0 ]
//! ```
//!
//! A row of F that belongs to a charge left free reads `w_k = 0` instead (operating point), which is why the pattern
//! keeps a place for it.

use super::clocks::Clock;
use super::laws::LawSet;
use super::memory::MemoryData;
use super::sparse::Rows;
use crate::circuit::stamps::{DeviceLabel, Junction, Unknown};
use crate::circuit::{DeviceId, Parts, Waveform};
use crate::linear::Pattern;
use crate::source::Span;
use std::fmt;
use std::sync::Arc;

/// Where one value of the laws goes.
#[derive(Clone, Debug)]
pub(crate) enum Target {
    /// Into these equations with these factors.
    Equations(Vec<(u32, f64)>),
    /// Into a charge.
    Charge(u32),
}

/// A place of a matrix that a partial derivative is added to.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    /// Index of the partial derivative.
    pub partial: u32,
    /// Slot of the matrix.
    pub slot: u32,
    /// Factor.
    pub factor: f64,
}

/// The laws that Newton's method evaluates together, at the unknowns themselves or at a limited junction voltage.
#[derive(Clone, Debug)]
pub(crate) struct LawGroup {
    /// Programs for the values and for all partial derivatives.
    pub laws: LawSet,
    /// Where each value goes.
    pub targets: Vec<Target>,
    /// Where each partial derivative by an unknown goes; `None` for those by time.
    pub dynamic: Vec<Place>,
    /// The same for charges, times α.
    pub dynamic_charge: Vec<Place>,
    /// The same in the frozen network.
    pub frozen: Vec<Place>,
    /// Partial derivatives of charges in the frozen network, with their charge.
    pub frozen_charge: Vec<(u32, Place)>,
    /// Partial derivatives by time: (partial, equation, factor).
    pub by_time: Vec<(u32, u32, f64)>,
    /// Partial derivatives of charges: (partial, charge, unknown).
    pub charge_slopes: Vec<(u32, u32, u32)>,
    /// The junction whose voltage is limited.
    pub junction: Option<Junction>,
    /// Whether its laws are affine for fixed modes.
    pub modal: bool,
    /// Devices of the values, for messages.
    pub devices: Vec<DeviceId>,
}

/// An independent source.
#[derive(Clone, Debug)]
pub(crate) struct Source {
    pub device: DeviceId,
    pub waveform: Waveform,
    /// What it is outside a run over time.
    pub parts: Parts,
    pub into: Vec<(u32, f64)>,
}

/// What a mode follows: two values a and b of [`System::controls`], b being 0 for switches and cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Guard {
    /// A switch: 1 when a rises through `on`, 0 when it falls through `off`.
    Switch { on: f64, off: f64, initial: Option<bool> },
    /// The side of a − b: −1, 0 or 1.
    Side,
    /// The largest whole number not above a.
    Cell,
}

/// A mode.
#[derive(Clone, Debug)]
pub(crate) struct ModeData {
    /// The device that it is of, or in whose law its condition stands first.
    pub device: DeviceId,
    /// The condition in its text.
    pub span: Span,
    /// Its place among a network's modes; the hold and the slope of a condition stand behind it.
    pub slot: u32,
    pub guard: Guard,
    /// Where it follows from time alone.
    pub clock: Option<Clock>,
}

/// A matrix's pattern with its static part.
#[derive(Clone, Debug)]
pub(crate) struct MatrixPlan {
    pub pattern: Pattern,
    /// G (and in the frozen network A), by slot.
    pub fixed: Vec<f64>,
    /// A·C, by slot, times α; in the frozen network the rows of C with their charge.
    pub storage: Vec<Place>,
}

/// A compiled circuit.
#[derive(Clone, Debug)]
pub struct System {
    /// Unknowns: node voltages, branch currents, then rates dQ/dt that laws speak of.
    pub unknowns: Vec<Unknown>,
    /// Number of node voltages.
    pub nodes: usize,
    /// Whether unknowns that follow from others are left out.
    pub condensed: bool,
    /// Output columns.
    pub outputs: Vec<Arc<str>>,
    /// So many of them, the last ones, are measured and not written.
    pub watched: usize,
    /// Names and places of the devices.
    pub devices: Arc<Vec<DeviceLabel>>,
    /// What its parts are called in the text that it was made of.
    pub spoken: crate::circuit::Spoken,
    pub(crate) charge_devices: Vec<DeviceId>,
    /// Which input of the programs time is; unknowns and the voltage of a junction stand before it, modes and rates behind
    /// it.
    pub(crate) time_input: usize,
    pub(crate) conductances: Rows,
    /// Constant terms on the right-hand side.
    pub(crate) constants: Vec<(u32, f64)>,
    /// C: one row for each charge.
    pub(crate) charges: Rows,
    /// Aᵀ: one row for each charge, columns are equations.
    pub(crate) rates: Rows,
    /// Initial charges, where cards state them.
    pub(crate) initial_charges: Vec<Option<f64>>,
    /// Initial node voltages of `.ic`.
    pub(crate) initial: Vec<(u32, f64)>,
    /// Node voltages of `.nodeset`.
    pub(crate) guesses: Vec<(u32, f64)>,
    /// Node voltages that follow from sources alone, where Newton's method begins.
    pub(crate) starts: Vec<(u32, f64)>,
    /// Whether stated charges are held in the operating point.
    pub(crate) initial_holds: bool,
    /// Whether a charge has a non-linear part.
    pub(crate) curved: Vec<bool>,
    /// Whether a charge is a state; the others follow from these.
    pub(crate) held: Vec<bool>,
    /// Charges that an operating point holds at their initial values.
    pub(crate) pinned: Vec<bool>,
    pub(crate) groups: Vec<LawGroup>,
    pub(crate) sources: Vec<Source>,
    pub(crate) memories: Vec<MemoryData>,
    pub(crate) memory_inputs: LawSet,
    pub(crate) modes: Vec<ModeData>,
    /// Number of inputs that modes, holds and slopes are.
    pub(crate) mode_slots: usize,
    /// Guards of the modes, two values each.
    pub(crate) controls: LawSet,
    /// Output columns that are unknowns as they are: column and unknown.
    pub(crate) plain_outputs: Vec<(u32, u32)>,
    /// The columns of the other outputs, and their laws.
    pub(crate) law_columns: Vec<u32>,
    pub(crate) output_laws: LawSet,
    /// Whether output columns speak of rates dQ/dt.
    pub(crate) output_rates: bool,
    pub(crate) dynamic: MatrixPlan,
    pub(crate) frozen: MatrixPlan,
    /// Slots of the nodes' diagonal entries in the frozen matrix, for gmin.
    pub(crate) node_slots: Vec<u32>,
    /// Slots of w_k in charge k's own row of the frozen matrix.
    pub(crate) free_slots: Vec<u32>,
}

impl System {
    /// Number of unknowns and equations.
    pub fn equations(&self) -> usize {
        self.unknowns.len()
    }

    /// Makes 0 of every unknown that no charge depends on.
    pub fn keep_stored(&self, x: &mut [f64]) {
        let mut stored = vec![false; x.len()];
        self.charges.columns().iter().for_each(|k| stored[*k as usize] = true);
        for group in &self.groups {
            group.charge_slopes.iter().for_each(|(_, _, k)| stored[*k as usize] = true);
        }
        for (x, stored) in x.iter_mut().zip(stored) {
            *x = if stored { *x } else { 0.0 };
        }
    }

    /// Number of charges and fluxes.
    pub fn charges(&self) -> usize {
        self.charge_devices.len()
    }

    /// The unknowns that output columns speak of; all of them where a column has a law.
    pub(crate) fn observed(&self) -> Vec<u32> {
        let mut observed: Vec<u32> = match self.law_columns.is_empty() {
            true => self.plain_outputs.iter().map(|(_, unknown)| *unknown).collect(),
            false => (0..self.equations() as u32).collect(),
        };
        observed.sort_unstable();
        observed.dedup();
        observed
    }

    /// Whether any law is an exponential junction.
    pub fn has_junctions(&self) -> bool {
        self.groups.iter().any(|group| group.junction.is_some())
    }

    /// Whether nothing but junctions is non-linear (for fixed modes).
    pub fn has_junctions_alone(&self) -> bool {
        self.groups.iter().all(|group| group.modal || group.junction.is_some())
    }

    /// Whether every equation is linear with constant coefficients (for fixed modes).
    pub fn is_linear(&self) -> bool {
        self.groups.iter().all(|group| group.modal)
    }

    /// A device's name.
    pub fn device_name(&self, id: DeviceId) -> &str {
        self.devices.get(id.0 as usize).map_or("?", |device| &*device.name)
    }

    /// What a device is called in a message: the element that it stands for, else its own name.
    pub fn spoken_device(&self, id: DeviceId) -> &str {
        let name = self.device_name(id);
        self.spoken.get(&name.to_lowercase()).map_or(name, String::as_str)
    }

    /// What an unknown is called in a message.
    pub fn spoken_unknown(&self, unknown: usize) -> &str {
        let name = self.unknowns.get(unknown).map_or("?", |unknown| &*unknown.name);
        self.spoken.get(&name.to_lowercase()).map_or(name, String::as_str)
    }

    /// A device's place.
    pub fn device_span(&self, id: DeviceId) -> Span {
        self.devices.get(id.0 as usize).map_or(Span::NONE, |device| device.span)
    }

    /// The input that the voltage of the junction is whose laws are evaluated.
    pub(crate) fn voltage_input(&self) -> usize {
        self.time_input - 1
    }

    /// Number of inputs of the programs: unknowns (with room up to `time_input`), time, modes, rates.
    pub(crate) fn inputs(&self) -> usize {
        self.time_input + 1 + self.mode_slots + self.charges()
    }

    /// What an input of the programs is called.
    fn input_name(&self, input: usize) -> String {
        let time = self.time_input;
        if input < time {
            self.unknowns[input].name.to_string()
        } else if input == time {
            "time".into()
        } else if input <= time + self.mode_slots {
            let slot = (input - time - 1) as u32;
            let mode = self.modes.iter().rev().find(|mode| mode.slot <= slot);
            format!("mode({})", mode.map_or("?", |mode| self.device_name(mode.device)))
        } else {
            let charge = self.charge_devices[input - time - 1 - self.mode_slots];
            format!("d/dt({})", self.device_name(charge))
        }
    }
}

/// The text of `--emit system`.
impl fmt::Display for System {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "system of {} equations, {} charges and fluxes, {} sources, {} modes; matrix entries {} dynamic, {} frozen",
            self.equations(),
            self.charges(),
            self.sources.len(),
            self.modes.len(),
            self.dynamic.pattern.len(),
            self.frozen.pattern.len()
        )?;
        for (k, unknown) in self.unknowns.iter().enumerate() {
            write!(f, "x{k} = {}", unknown.name)?;
            match unknown.nominal {
                Some(nominal) => writeln!(f, "   nominal {nominal:e}")?,
                None => writeln!(f)?,
            }
        }
        for row in 0..self.equations() {
            write!(f, "equation of {}:", self.unknowns[row].name)?;
            for (column, value) in self.conductances.row(row) {
                write!(f, " {value:+e}·{}", self.unknowns[column].name)?;
            }
            for (k, equation, factor) in self.rates.triplets() {
                if equation == row {
                    write!(f, " {factor:+}·d/dt Q{k}")?;
                }
            }
            let mut law = 0;
            for group in &self.groups {
                for target in &group.targets {
                    if let Target::Equations(into) = target {
                        for (_, factor) in into.iter().filter(|(r, _)| *r as usize == row) {
                            write!(f, " {factor:+}·f{law}")?;
                        }
                    }
                    law += 1;
                }
            }
            write!(f, " =")?;
            let mut empty = true;
            for (_, value) in self.constants.iter().filter(|(r, _)| *r as usize == row) {
                write!(f, " {value:+e}")?;
                empty = false;
            }
            for (s, memory) in self.memories.iter().enumerate() {
                for (_, factor) in memory.into.iter().filter(|(r, _)| *r as usize == row) {
                    write!(f, " {factor:+}·m{s}")?;
                    empty = false;
                }
            }
            for (s, source) in self.sources.iter().enumerate() {
                for (_, factor) in source.into.iter().filter(|(r, _)| *r as usize == row) {
                    write!(f, " {factor:+}·b{s}(t)")?;
                    empty = false;
                }
            }
            writeln!(f, "{}", if empty { " 0" } else { "" })?;
        }
        for k in 0..self.charges() {
            write!(f, "Q{k} of {}:", self.device_name(self.charge_devices[k]))?;
            for (column, value) in self.charges.row(k) {
                write!(f, " {value:+e}·{}", self.unknowns[column].name)?;
            }
            let law = if self.curved[k] { " + law" } else { "" };
            writeln!(f, "{law}{}", if self.held[k] { "" } else { "   (follows from the others)" })?;
        }
        let mut law = 0;
        for group in &self.groups {
            for (o, target) in group.targets.iter().enumerate() {
                let device = self.device_name(group.devices[o]);
                let partials = group.laws.row(o);
                let slopes: Vec<String> =
                    partials.map(|p| self.input_name(group.laws.input(p))).collect();
                let what = match target {
                    Target::Equations(_) => format!("f{law}"),
                    Target::Charge(k) => format!("law of Q{k}"),
                };
                writeln!(f, "{what} of {device}: slopes by {}", slopes.join(", "))?;
                law += 1;
            }
            let (values, full) = group.laws.instructions();
            writeln!(f, "  {values} instructions, {full} with slopes")?;
        }
        for (s, source) in self.sources.iter().enumerate() {
            writeln!(f, "b{s}: {:?}", source.waveform)?;
        }
        for memory in &self.memories {
            writeln!(f, "memory of {}: {:?}", self.device_name(memory.device), memory.kind)?;
        }
        for mode in &self.modes {
            let device = self.device_name(mode.device);
            match mode.guard {
                Guard::Switch { on, off, .. } => {
                    writeln!(f, "mode of {device}: on above {on:e}, off below {off:e}")?;
                }
                guard => {
                    let what = if guard == Guard::Side { "a side" } else { "a whole number" };
                    let when = if mode.clock.is_some() { ", known beforehand" } else { "" };
                    writeln!(f, "mode of a condition of {device}: {what}{when}")?;
                }
            }
        }
        Ok(())
    }
}
