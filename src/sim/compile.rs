//! Stamps → System: affine laws become static stamps, the rest one program; patterns and places are worked out once.

use super::clocks::Clock;
use super::condense::condense;
use super::conditions::{Conditions, Question, SLOTS};
use super::explain;
use super::laws::{Group, LawSet, Placed};
use super::memory::MemoryData;
use super::plans::{self, Plans};
use super::reduce;
use super::sparse::Rows;
use super::structure;
use super::system::{Guard, LawGroup, ModeData, Source, System, Target};
use crate::circuit::DeviceId;
use crate::circuit::stamps::{Junction, Law, Leaf, Stamps, Unknown};
use crate::diagnostic::Diagnostic;
use crate::expr::{Dag, Node, NodeId, Unary};
use crate::source::Span;
use std::collections::BTreeMap;

/// Compiles a circuit's stamps. `None` with diagnostics when no values of its parts could make it solvable: a floating
/// node, a loop of voltage sources.
pub fn compile(stamps: &Stamps, d: &mut Vec<Diagnostic>) -> Option<System> {
    compile_for(stamps, false, d)
}

/// Compiles a circuit's stamps for a run over time: what follows from other unknowns by an equation of its own is no
/// unknown then. What an error is about is looked for in the whole circuit.
pub fn compile_for_run(stamps: &Stamps, d: &mut Vec<Diagnostic>) -> Option<System> {
    let mut own = vec![];
    let small = condense(stamps).and_then(|condensed| compile(&condensed, &mut own));
    match small {
        Some(system) => {
            d.extend(own);
            Some(System { condensed: true, ..system })
        }
        None => compile(stamps, d),
    }
}

/// What [`compile_for_run`] makes of stamps, from what it has made of others, where only courses of sources differ and
/// nothing was concluded from these; otherwise nothing.
pub fn compile_like(stamps: &Stamps, others: &Stamps, known: &System) -> Option<System> {
    let concluded = known.modes.iter().any(|mode| mode.clock.is_some());
    let same = known.sources.len() == stamps.sources.len();
    if concluded || !same || !stamps.differ_in_courses_alone(others) {
        return None;
    }
    let mut system = known.clone();
    for (source, stamp) in system.sources.iter_mut().zip(&stamps.sources) {
        if source.device != stamp.device {
            return None;
        }
        (source.parts, source.waveform) = (stamp.parts, stamp.waveform.clone());
    }
    Some(system)
}

/// Compiles a circuit's stamps for linearising: every charge stays an entity of its own, since sources that do not move
/// over time do so in phasors, and output columns and what is delayed have derivatives.
pub(super) fn compile_linear(stamps: &Stamps, d: &mut Vec<Diagnostic>) -> Option<System> {
    compile_for(stamps, true, d)
}

fn compile_for(stamps: &Stamps, linear: bool, d: &mut Vec<Diagnostic>) -> Option<System> {
    let mut builder = Builder::new(stamps);
    builder.linear = linear;
    builder.charge_entries.reserve(2 * stamps.charges.len());
    builder.rate_entries.reserve(2 * stamps.charges.len());
    for (k, charge) in stamps.charges.iter().enumerate() {
        for (unknown, value) in &charge.linear {
            builder.charge_entries.push((k as u32, unknown.0, *value));
        }
        for (equation, factor) in &charge.into {
            builder.rate_entries.push((k as u32, equation.0, *factor));
        }
    }
    for (k, row) in builder.rate_unknowns.clone() {
        // The row of an added unknown: w − dQ/dt = 0.
        builder.rate_entries.push((k, row, -1.0));
        builder.conductances.push((row, row, 1.0));
    }
    builder.place_laws();
    if !linear {
        builder.reduce();
    }
    let system = builder.finish();
    match structure::check(&system) {
        Ok(()) => Some(system),
        Err(singular) => {
            d.extend(explain::undetermined(&system, &singular));
            None
        }
    }
}

/// The input that time is: past every unknown that may yet be added, one for each charge at most, so that laws keep their
/// numbers while rates become unknowns; and past the voltage of a junction.
fn time_input(stamps: &Stamps) -> usize {
    stamps.unknowns.len() + stamps.charges.len() + 1
}

struct Builder<'a> {
    stamps: &'a Stamps,
    /// Output columns and what is delayed have derivatives.
    linear: bool,
    unknowns: Vec<Unknown>,
    /// The unknown added for each charge whose rate laws speak of.
    rate_unknowns: BTreeMap<u32, u32>,
    conductances: Vec<(u32, u32, f64)>,
    constants: Vec<(u32, f64)>,
    charge_entries: Vec<(u32, u32, f64)>,
    rate_entries: Vec<(u32, u32, f64)>,
    curved: Vec<bool>,
    /// Charges that others determine.
    dependent: Vec<bool>,
    groups: Vec<Group>,
    conditions: Conditions,
}

impl<'a> Builder<'a> {
    fn new(stamps: &'a Stamps) -> Builder<'a> {
        let time = time_input(stamps) as u32;
        let mut builder = Builder {
            conditions: Conditions::new(time, time + 1 + stamps.modes.len() as u32),
            stamps,
            linear: false,
            unknowns: stamps.unknowns.clone(),
            rate_unknowns: BTreeMap::new(),
            conductances: stamps.conductances.iter().map(|(r, c, v)| (r.0, c.0, *v)).collect(),
            constants: vec![],
            charge_entries: vec![],
            rate_entries: vec![],
            curved: vec![false; stamps.charges.len()],
            dependent: vec![false; stamps.charges.len()],
            groups: vec![],
        };
        let laws = stamps.laws.iter().map(|stamp| &stamp.law);
        let charges = stamps.charges.iter().filter_map(|charge| charge.law.as_ref());
        let controls = stamps.modes.iter().map(|mode| &mode.control);
        for law in laws.chain(charges).chain(controls) {
            law.leaves(&mut |leaf, _| {
                if let Leaf::Rate(k) = leaf {
                    builder.add_rate(*k);
                }
            });
        }
        builder
    }

    fn time_input(&self) -> usize {
        time_input(self.stamps)
    }

    fn add_rate(&mut self, k: u32) {
        if self.rate_unknowns.contains_key(&k) {
            return;
        }
        let device = self.stamps.charges.get(k as usize).map(|charge| charge.device);
        let label = device.and_then(|d| self.stamps.devices.get(d.0 as usize));
        self.rate_unknowns.insert(k, self.unknowns.len() as u32);
        self.unknowns.push(Unknown {
            name: format!("d/dt({})", label.map_or("?", |label| &*label.name)).into(),
            voltage: false,
            nominal: None,
            device,
            span: label.map_or(Span::NONE, |label| label.span),
        });
    }

    /// The input that a leaf is, numbered as [`System::inputs`] says. Rates are the added unknowns, or for output
    /// columns inputs of their own, from `rates` on.
    fn input(&self, leaf: &Leaf, rates: Option<u32>) -> u32 {
        let time = self.time_input() as u32;
        match leaf {
            Leaf::Unknown(k) => k.0,
            Leaf::Time => time,
            Leaf::Mode(m) => time + 1 + m,
            Leaf::Rate(k) => match (self.rate_unknowns.get(k), rates) {
                (Some(unknown), Some(_)) if self.dependent[*k as usize] => *unknown,
                (_, Some(first)) => first + k,
                (Some(unknown), None) => *unknown,
                // Every rate that laws speak of was made an unknown before the first law.
                (None, None) => time,
            },
        }
    }

    /// Inputs for the modes of switches and of the conditions found so far.
    fn mode_slots(&self) -> usize {
        self.stamps.modes.len() + SLOTS as usize * self.conditions.list.len()
    }

    /// Adds a law to the graph of its group: one of a junction as a function of its voltage, in which regions join smoothly;
    /// of others conditions become modes.
    fn add(&mut self, group: &mut Group, law: &Law, device: DeviceId) -> NodeId {
        let dag = &mut group.dag;
        if let Some(junction) = &group.junction {
            return self.add_of_voltage(dag, law, junction);
        }
        let mut conditions = std::mem::take(&mut self.conditions);
        let node = conditions.add(dag, law, device, &|leaf| self.input(leaf, None));
        self.conditions = conditions;
        node
    }

    /// Adds a law that speaks of nothing but the voltage across a junction.
    fn add_of_voltage(&self, dag: &mut Dag, law: &Law, junction: &Junction) -> NodeId {
        let [anode, cathode] = junction.across;
        let added: Result<NodeId, std::convert::Infallible> = dag.add(law, &mut |dag, leaf, _| {
            let voltage = dag.input(self.time_input() as u32 - 1);
            Ok(match leaf {
                Leaf::Unknown(k) if Some(*k) == anode => voltage,
                Leaf::Unknown(k) if Some(*k) == cathode && anode.is_none() => {
                    dag.unary(Unary::Negate, voltage)
                }
                Leaf::Unknown(k) if Some(*k) == cathode => dag.constant(0.0),
                other => dag.input(self.input(other, None)),
            })
        });
        let Ok(node) = added;
        node
    }

    /// Affine laws go into G, C and the right-hand side; the laws of each junction's device into a group of their own,
    /// because they are evaluated at its limited voltage; all others into one group.
    fn place_laws(&mut self) {
        let stamps = self.stamps;
        let n = self.unknowns.len() as u32;
        let mut plain = Group::default();
        let mut junctions: BTreeMap<u32, Group> = BTreeMap::new();
        for stamp in &stamps.laws {
            if let Some(junction) = stamp.junction {
                junctions
                    .entry(stamp.device.0)
                    .or_insert_with(|| Group { junction: Some(junction), ..Group::default() });
            }
        }
        for stamp in &stamps.laws {
            let into: Vec<(u32, f64)> = stamp.into.iter().map(|(row, f)| (row.0, *f)).collect();
            let group = junctions.get_mut(&stamp.device.0).unwrap_or(&mut plain);
            let node = self.add(group, &stamp.law, stamp.device);
            match group.dag.affine(node) {
                Some((constant, factors)) if factors.iter().all(|(input, _)| *input < n) => {
                    for (row, factor) in into {
                        if constant != 0.0 {
                            self.constants.push((row, -factor * constant));
                        }
                        for (input, slope) in &factors {
                            self.conductances.push((row, *input, factor * slope));
                        }
                    }
                }
                _ => group.laws.push(Placed {
                    node,
                    target: Target::Equations(into),
                    device: stamp.device,
                }),
            }
        }
        for (k, charge) in stamps.charges.iter().enumerate() {
            let Some(law) = &charge.law else { continue };
            let group = junctions.get_mut(&charge.device.0).unwrap_or(&mut plain);
            let node = self.add(group, law, charge.device);
            match group.dag.affine(node) {
                // A constant part of a charge has no rate, but it belongs to the initial value: keep such a law.
                Some((constant, factors))
                    if constant == 0.0 && factors.iter().all(|(input, _)| *input < n) =>
                {
                    for (input, slope) in factors {
                        self.charge_entries.push((k as u32, input, slope));
                    }
                }
                _ => {
                    self.curved[k] = true;
                    let target = Target::Charge(k as u32);
                    group.laws.push(Placed { node, target, device: charge.device });
                }
            }
        }
        self.groups.push(plain.part_modal(self.time_input()));
        self.groups.push(plain);
        self.groups.extend(junctions.into_values());
        self.groups.retain(|group| !group.laws.is_empty());
    }

    /// Makes the rates of dependent charges unknowns of their own, until no constraint is left that can be used.
    fn reduce(&mut self) {
        let initial: Vec<Option<f64>> = self.stamps.charges.iter().map(|c| c.initial).collect();
        while self.dependent.contains(&false) {
            let constant = self.constant();
            let found = reduce::constraints(&reduce::Parts {
                n: self.unknowns.len(),
                conductances: &self.conductances,
                charges: &self.charge_entries,
                rates: &self.rate_entries,
                dependent: &self.dependent,
                curved: &self.curved,
                constant: &constant,
                initial: &initial,
            });
            if found.is_empty() {
                return;
            }
            let mut solved: BTreeMap<u32, u32> = BTreeMap::new();
            let mut known = vec![false; self.unknowns.len()];
            for constraint in &found {
                let k = constraint.charge;
                self.dependent[k as usize] = true;
                if let Some(w) = self.rate_unknowns.get(&k) {
                    known[*w as usize] = true;
                }
                self.add_rate(k);
                solved.extend(self.rate_unknowns.get(&k).map(|w| (k, *w)));
            }
            let is_known = |row: &u32| known.get(*row as usize) == Some(&true);
            self.conductances.retain(|(row, ..)| !is_known(row));
            self.rate_entries.retain(|(_, row, _)| !is_known(row));
            // Each charge's rate is now w wherever it stood.
            for (k, row, factor) in
                self.rate_entries.extract_if(.., |(charge, ..)| solved.contains_key(charge))
            {
                self.conductances.extend(solved.get(&k).map(|w| (row, *w, factor)));
            }
            for reduce::Constraint { charge, factors } in found {
                let Some(w) = solved.get(&charge) else { continue };
                for (j, z) in factors {
                    // Of several dependent charges each rate is an unknown.
                    if self.dependent[j as usize] {
                        let rate = self.rate_unknowns.get(&j);
                        self.conductances.extend(rate.map(|rate| (*w, *rate, z)));
                    } else {
                        self.rate_entries.push((j, *w, z));
                    }
                }
            }
        }
    }

    /// b of each equation, where no source, no memory and no law moves it.
    fn constant(&self) -> Vec<Option<f64>> {
        let mut constant = vec![Some(0.0); self.unknowns.len()];
        for (row, value) in &self.constants {
            constant[*row as usize] = constant[*row as usize].map(|b: f64| b + value);
        }
        for source in &self.stamps.sources {
            let fixed = source.waveform.is_constant().then(|| source.waveform.value(0.0));
            for (row, factor) in &source.into {
                let b = &mut constant[row.0 as usize];
                *b = b.zip(fixed).map(|(b, value)| b + factor * value);
            }
        }
        for (row, _) in self.stamps.memories.iter().flat_map(|memory| &memory.into) {
            constant[row.0 as usize] = None;
        }
        let laws = self.groups.iter().flat_map(|group| &group.laws);
        for law in laws {
            if let Target::Equations(into) = &law.target {
                into.iter().for_each(|(row, _)| constant[*row as usize] = None);
            }
        }
        constant
    }

    fn finish(mut self) -> System {
        let stamps = self.stamps;
        let n = self.unknowns.len();
        let time = self.time_input();
        let charges = stamps.charges.len();
        let mut groups: Vec<LawGroup> = vec![];
        for group in std::mem::take(&mut self.groups) {
            let Group { mut dag, laws, junction, modal } = group;
            let nodes: Vec<NodeId> = laws.iter().map(|law| law.node).collect();
            groups.push(LawGroup {
                modal,
                laws: match &junction {
                    Some(junction) => {
                        LawSet::of_junction(&mut dag, &nodes, time as u32 - 1, junction)
                    }
                    None => LawSet::new(&mut dag, &nodes, time as u32 + 1),
                },
                devices: laws.iter().map(|law| law.device).collect(),
                targets: laws.into_iter().map(|law| law.target).collect(),
                dynamic: vec![],
                dynamic_charge: vec![],
                frozen: vec![],
                frozen_charge: vec![],
                by_time: vec![],
                charge_slopes: vec![],
                junction,
            });
        }
        let conductances = Rows::new(n, &self.conductances);
        let charge_rows = Rows::new(charges, &self.charge_entries);
        let rates = Rows::new(charges, &self.rate_entries);
        let parts = plans::Parts {
            n,
            nodes: stamps.nodes,
            time,
            conductances: &conductances,
            charges: &charge_rows,
            rates: &rates,
        };
        let Plans { dynamic, frozen, node_slots, free_slots } = plans::plan(&parts, &mut groups);

        let (modes, controls) = self.modes();
        let mode_slots = self.mode_slots();
        let mut dag = Dag::default();
        let columns = &stamps.outputs;
        let mut output_rates = false;
        for (_, law) in columns {
            law.leaves(&mut |leaf, _| output_rates |= matches!(leaf, Leaf::Rate(_)));
        }
        let mut conditions = std::mem::take(&mut self.conditions);
        let first_rate = Some((time + 1 + mode_slots) as u32);
        let inputs = |leaf: &Leaf| self.input(leaf, first_rate);
        let (mut plain_outputs, mut law_columns, mut nodes) = (vec![], vec![], vec![]);
        for (column, (_, law)) in columns.iter().enumerate() {
            match &*law.node {
                // Most columns are unknowns as they are.
                Node::Leaf(Leaf::Unknown(k)) if !self.linear => {
                    plain_outputs.push((column as u32, k.0));
                }
                _ => {
                    law_columns.push(column as u32);
                    nodes.push(conditions.add_output(&mut dag, law, &inputs));
                }
            }
        }
        let output_laws = match self.linear {
            true => LawSet::new(&mut dag, &nodes, (time + 1 + mode_slots + charges) as u32),
            false => LawSet::without_derivatives(&dag, &nodes),
        };
        let mut dag = Dag::default();
        let inputs = stamps.memories.iter().map(|memory| {
            let added: Result<NodeId, std::convert::Infallible> =
                dag.add(&memory.input, &mut |dag, leaf, _| {
                    // What is remembered is a sum of unknowns.
                    Ok(match leaf {
                        Leaf::Unknown(k) => dag.input(k.0),
                        _ => dag.constant(0.0),
                    })
                });
            let Ok(node) = added;
            node
        });
        let inputs: Vec<NodeId> = inputs.collect();
        let memory_inputs = match self.linear {
            true => LawSet::new(&mut dag, &inputs, n as u32),
            false => LawSet::without_derivatives(&dag, &inputs),
        };
        let memories = stamps
            .memories
            .iter()
            .map(|memory| MemoryData {
                device: memory.device,
                kind: memory.kind,
                into: memory.into.iter().map(|(row, factor)| (row.0, *factor)).collect(),
                initial: memory.initial,
            })
            .collect();
        System {
            condensed: false,
            time_input: time,
            nodes: stamps.nodes,
            outputs: columns.iter().map(|(name, _)| name.clone()).collect(),
            watched: stamps.watched,
            devices: stamps.devices.clone(),
            spoken: stamps.spoken.clone(),
            charge_devices: stamps.charges.iter().map(|charge| charge.device).collect(),
            conductances,
            constants: self.constants,
            charges: charge_rows,
            rates,
            initial_charges: stamps.charges.iter().map(|charge| charge.initial).collect(),
            initial: stamps.initial.iter().map(|(node, value)| (node.0, *value)).collect(),
            guesses: stamps.guesses.iter().map(|(node, value)| (node.0, *value)).collect(),
            starts: stamps.starts.iter().map(|(node, value)| (node.0, *value)).collect(),
            initial_holds: stamps.initial_holds,
            curved: self.curved,
            held: self.dependent.iter().map(|dependent| !dependent).collect(),
            pinned: stamps.charges.iter().map(|charge| charge.pinned).collect(),
            groups,
            sources: stamps
                .sources
                .iter()
                .map(|source| Source {
                    device: source.device,
                    parts: source.parts,
                    waveform: source.waveform.clone(),
                    into: source.into.iter().map(|(row, factor)| (row.0, *factor)).collect(),
                })
                .collect(),
            modes,
            mode_slots,
            controls,
            plain_outputs,
            law_columns,
            output_laws,
            memories,
            memory_inputs,
            output_rates,
            dynamic,
            frozen,
            node_slots,
            free_slots,
            unknowns: self.unknowns,
        }
    }
}

impl Builder<'_> {
    /// The modes of switches and conditions, and the program of their guards: two values each.
    fn modes(&mut self) -> (Vec<ModeData>, LawSet) {
        let stamps = self.stamps;
        let mut conditions = std::mem::take(&mut self.conditions);
        let (mut modes, mut guards) = (vec![], vec![]);
        let zero = conditions.guards.constant(0.0);
        for (slot, mode) in stamps.modes.iter().enumerate() {
            let inputs = |leaf: &Leaf| self.input(leaf, None);
            let control = conditions.add_control(&mode.control, mode.device, &inputs);
            guards.extend([control, zero]);
            modes.push(ModeData {
                device: mode.device,
                span: Span::NONE,
                slot: slot as u32,
                guard: Guard::Switch { on: mode.on, off: mode.off, initial: mode.initial },
                clock: mode
                    .course
                    .as_ref()
                    .map(|course| Clock::of_switch(course.clone(), mode.on, mode.off)),
            });
        }
        for (k, condition) in conditions.list.iter().enumerate() {
            guards.extend(match &condition.clock {
                Some(_) => [zero, zero],
                None => [condition.a, condition.b],
            });
            modes.push(ModeData {
                device: condition.device,
                span: condition.span,
                slot: (stamps.modes.len() + SLOTS as usize * k) as u32,
                guard: match condition.question {
                    Question::Side => Guard::Side,
                    Question::Cell => Guard::Cell,
                },
                clock: condition.clock.clone(),
            });
        }
        let time = self.time_input() as u32;
        let controls = LawSet::new(&mut conditions.guards, &guards, time);
        self.conditions = conditions;
        (modes, controls)
    }
}
