//! A system at a point: values of laws and charges, residuals, and the two matrices filled and factorised.
//!
//! All buffers are made once; nothing here allocates while a run steps.

use super::events::Track;
use super::junctions::{limit_junction, rests, voltage_across};
use super::laws::{LawSet, Registers};
use super::matrix::Matrix;
use super::memory::Memories;
use super::methods::Dense;
use super::op::State;
use super::statistics::Statistics;
use super::system::{LawGroup, System, Target};
use crate::circuit::waveform::Segment;
use crate::linear::{Flat, Orders, Singular};
use crate::quantity::random;

/// The conductance that pins a node to its `.ic` value, as in SPICE.
const PIN: f64 = 1e10;

/// Values of one group of laws.
#[derive(Debug)]
struct GroupState {
    values: Vec<f64>,
    partials: Vec<f64>,
    registers: Registers,
    /// Junction voltage of the last linearisation.
    voltage: f64,
    /// Of laws that are affine for fixed modes: their values where all unknowns are 0; whether these and the derivatives
    /// are those of the present modes.
    constants: Vec<f64>,
    known: bool,
    /// The unknowns, while these are worked out.
    moved: Vec<f64>,
}

impl GroupState {
    /// Values of laws that are affine for fixed modes, worked out anew only where these have changed.
    fn follow(&mut self, laws: &LawSet, inputs: &mut [f64]) {
        if !self.known {
            self.known = true;
            let places = 0..laws.partials();
            for (p, moved) in places.clone().zip(&mut self.moved) {
                *moved = std::mem::take(&mut inputs[laws.input(p)]);
            }
            laws.full(inputs, &mut self.registers, &mut self.constants, &mut self.partials);
            // One that stands there twice is 0 the second time.
            places.rev().zip(self.moved.iter().rev()).for_each(|(p, x)| inputs[laws.input(p)] = *x);
        }
        for (o, (value, constant)) in self.values.iter_mut().zip(&self.constants).enumerate() {
            let terms = laws.row(o).map(|p| self.partials[p] * inputs[laws.input(p)]);
            *value = terms.fold(*constant, |sum, term| sum + term);
        }
    }
}

/// The dynamic matrix of steps, and what its factors depend on.
#[derive(Debug, Default)]
struct Stages {
    matrix: Matrix,
    /// α of the factors, where they depend on nothing else.
    constant_alpha: Option<f64>,
    /// α of the factors, whatever else they depend on.
    alpha: Option<f64>,
    /// Junction voltages that they were made at.
    voltages: Vec<f64>,
}

impl Stages {
    fn new(groups: usize) -> Stages {
        Stages { voltages: vec![0.0; groups], ..Stages::default() }
    }

    fn forget_alpha(&mut self) {
        (self.constant_alpha, self.alpha) = (None, None);
    }
}

/// A system with modes, segments of its sources, and room to compute in.
#[derive(Debug)]
pub(crate) struct Network<'a> {
    pub system: &'a System,
    /// The segment that each source is on.
    segments: Vec<Segment>,
    /// −b without what moves: memories, and sources whose segments change, which are these.
    rest: Vec<f64>,
    moving: Vec<u32>,
    /// Modes, and the hold and slope of each condition, by their slots.
    pub modes: Vec<f64>,
    /// What is known of each mode's guard.
    pub tracks: Vec<Track>,
    /// The mode over time that changed last at the last corner, and its value.
    pub struck: Option<(usize, f64)>,
    /// End of the run.
    pub stop: f64,
    /// A conductance from every node to ground, while an operating point is sought; otherwise 0.
    pub gmin: f64,
    /// The values that this conductance leads to, one for each unknown; mostly 0.
    pub anchor: Vec<f64>,
    /// Factor of all sources, while an operating point is sought; otherwise 1.
    drive: f64,
    /// Nodes that are pinned to values, while an operating point is sought: those of `.ic`, at first those of `.nodeset` too.
    pub pins: Vec<(u32, f64)>,
    pub statistics: Statistics,
    pub memories: Memories,
    inputs: Vec<f64>,
    control_registers: Registers,
    output_registers: Registers,
    groups: Vec<GroupState>,
    /// Of the run's own steps, and of those that are taken beside them for rows, which must not change what a run does.
    stages: Stages,
    aside: Stages,
    frozen: Matrix,
    /// Orders of elimination worked out so far.
    pub orders: Orders,
    /// The charges held in the factorised frozen matrix, where it depends on nothing else; empty where it does.
    factored_held: Vec<bool>,
}

/// Factors serve for an α that differs by no more than this part: equal steps differ in their last digits.
const SAME_ALPHA: f64 = 1e-12;

/// In iterations that converge with other factors too, for one that differs by this part.
const ABOUT_SAME: f64 = 1e-6;

impl<'a> Network<'a> {
    /// At time `t` of a run that ends at `stop`, all modes 0.
    pub fn new(system: &'a System, t: f64, stop: f64) -> Network<'a> {
        let groups = system
            .groups
            .iter()
            .map(|group| GroupState {
                values: vec![0.0; group.targets.len()],
                partials: vec![0.0; group.laws.partials()],
                registers: group.laws.registers(),
                voltage: 0.0,
                constants: vec![0.0; if group.modal { group.targets.len() } else { 0 }],
                known: false,
                moved: vec![0.0; if group.modal { group.laws.partials() } else { 0 }],
            })
            .collect();
        let mut network = Network {
            system,
            rest: vec![0.0; system.equations()],
            moving: Vec::with_capacity(system.sources.len()),
            segments: system.sources.iter().map(|s| s.waveform.segment(t)).collect(),
            modes: vec![0.0; system.mode_slots],
            tracks: vec![Track::default(); system.modes.len()],
            struck: None,
            stop,
            gmin: 0.0,
            anchor: vec![0.0; system.equations()],
            drive: 1.0,
            pins: vec![],
            statistics: Statistics::default(),
            memories: Memories::new(system),
            inputs: vec![0.0; system.inputs()],
            control_registers: system.controls.registers(),
            output_registers: system.output_laws.registers(),
            groups,
            stages: Stages::new(system.groups.len()),
            aside: Stages::new(system.groups.len()),
            frozen: Matrix::default(),
            orders: Orders::default(),
            factored_held: vec![],
        };
        network.see_drives();
        network
    }

    /// The segment that each source is on.
    pub fn segments(&self) -> &[Segment] {
        &self.segments
    }

    /// The next corner of any source, or change of a condition over time; infinite when there is none.
    pub fn next_corner(&self) -> f64 {
        let sources = self.segments.iter().map(|segment| segment.end);
        let clocks = self.tracks.iter().map(|track| track.next);
        sources.chain(clocks).fold(self.memories.next_corner(), f64::min)
    }

    /// Moves each source whose segment ends at or just before `t` to its next one, and conditions over time on.
    pub fn pass_corner(&mut self, t: f64, slack: f64) {
        let mut corner = false;
        for (segment, source) in self.segments.iter_mut().zip(&self.system.sources) {
            while segment.end <= t + slack {
                *segment = source.waveform.segment(segment.end);
                corner = true;
            }
        }
        if corner {
            self.see_drives();
        }
        let events = self.statistics.events;
        self.struck = None;
        self.set_clocks(t, Some(slack));
        let new = corner || self.statistics.events != events;
        corner |= self.memories.pass_corner(t, slack, new);
        self.statistics.corners += u64::from(corner);
    }

    /// Whether polynomials through values that meet the equations meet them between too: they are linear, and what drives
    /// them follows straight lines.
    pub fn is_straight(&self) -> bool {
        self.system.is_linear()
            && !self.system.output_rates
            && self.memories.is_empty()
            && self.segments.iter().all(Segment::is_straight)
    }

    /// Inputs of the memories at a point.
    pub fn read_memories(&mut self, x: &[f64], t: f64) {
        if !self.memories.is_empty() {
            self.set_inputs(x, t);
            self.memories.read(&self.system.memory_inputs, &self.inputs);
        }
    }

    /// Whether its equations are the circuit's own, as they are but while an operating point is sought.
    pub fn is_plain(&self) -> bool {
        self.gmin == 0.0 && self.pins.is_empty()
    }

    /// The factors at hand as flat lists, where they are such, with a number that no others have.
    pub fn dynamic_factors(&self) -> (u64, Option<&Flat<f64>>) {
        self.stages.matrix.flat()
    }

    /// The same of the frozen network.
    pub fn frozen_factors(&self) -> (u64, Option<&Flat<f64>>) {
        self.frozen.flat()
    }

    fn set_inputs(&mut self, x: &[f64], t: f64) {
        let time = self.system.time_input;
        self.inputs[..x.len()].copy_from_slice(x);
        self.inputs[time] = t;
        self.inputs[time + 1..time + 1 + self.modes.len()].copy_from_slice(&self.modes);
    }

    /// Values of a group of laws that are affine for fixed modes, at a point.
    pub fn modal_values(&mut self, group: usize, x: &[f64], t: f64) -> &[f64] {
        self.set_inputs(x, t);
        let state = &mut self.groups[group];
        state.follow(&self.system.groups[group].laws, &mut self.inputs);
        &state.values
    }

    /// Values of all laws at a point.
    pub fn evaluate(&mut self, x: &[f64], t: f64) {
        if self.groups.is_empty() {
            return;
        }
        self.statistics.evaluations += 1;
        self.set_inputs(x, t);
        for (state, group) in self.groups.iter_mut().zip(&self.system.groups) {
            if group.modal {
                state.follow(&group.laws, &mut self.inputs);
                continue;
            }
            if let Some(junction) = &group.junction {
                self.inputs[self.system.voltage_input()] = voltage_across(junction, |k| x[k]);
            }
            group.laws.values(&self.inputs, &mut state.registers, &mut state.values);
        }
    }

    /// Values and derivatives at a point. With `limit`, junction voltages move from those of the last call by no more
    /// than an exponential bears, and the laws are extended linearly from there; says whether any was limited.
    pub fn linearise(&mut self, x: &[f64], t: f64, limit: bool) -> bool {
        if self.groups.is_empty() {
            return false;
        }
        self.statistics.evaluations += 1;
        self.statistics.jacobians += 1;
        self.set_inputs(x, t);
        let mut limited = false;
        for (state, group) in self.groups.iter_mut().zip(&self.system.groups) {
            let laws = &group.laws;
            if group.modal {
                state.follow(laws, &mut self.inputs);
                continue;
            }
            let Some(junction) = &group.junction else {
                laws.full(
                    &self.inputs,
                    &mut state.registers,
                    &mut state.values,
                    &mut state.partials,
                );
                continue;
            };
            let voltage = voltage_across(junction, |k| x[k]);
            let allowed = if limit {
                limit_junction(voltage, state.voltage, junction.thermal, junction.critical)
            } else {
                voltage
            };
            state.voltage = allowed;
            self.inputs[self.system.voltage_input()] = allowed;
            laws.full(&self.inputs, &mut state.registers, &mut state.values, &mut state.partials);
            let moved = allowed - voltage;
            if moved != 0.0 {
                limited = true;
                let sign = if junction.across[0].is_some() { 1.0 } else { -1.0 };
                for (o, value) in state.values.iter_mut().enumerate() {
                    // The first is by the anode, where that is an unknown.
                    let slope = laws.row(o).next().map_or(0.0, |p| sign * state.partials[p]);
                    *value -= slope * moved;
                }
            }
        }
        limited
    }

    /// Puts 0 in the place of all values and derivatives of the last linearisation that are no finite numbers; says whether
    /// a value was none.
    pub fn silence(&mut self) -> bool {
        let mut any = false;
        for state in &mut self.groups {
            for value in state.values.iter_mut().filter(|value| !value.is_finite()) {
                *value = 0.0;
                any = true;
            }
        }
        if any {
            let partials = self.groups.iter_mut().flat_map(|state| &mut state.partials);
            partials.filter(|slope| !slope.is_finite()).for_each(|slope| *slope = 0.0);
        }
        any
    }

    /// Lets the next limiting start from the junction voltages at `x`.
    pub fn remember_junctions(&mut self, x: &[f64]) {
        for (state, group) in self.groups.iter_mut().zip(&self.system.groups) {
            if let Some(junction) = &group.junction {
                state.voltage = voltage_across(junction, |k| x[k]);
            }
        }
    }

    /// Lets the next limiting start where each junction begins to conduct.
    pub fn prime_junctions(&mut self) {
        for (state, group) in self.groups.iter_mut().zip(&self.system.groups) {
            if let Some(junction) = &group.junction {
                state.voltage = junction.critical;
            }
        }
    }

    /// r = f − b of linear equations where all unknowns are 0, after a linearisation.
    pub fn residual_at_zero(&self, t: f64, r: &mut [f64]) {
        self.begin_residual(t, r);
        for (state, group) in self.groups.iter().zip(&self.system.groups) {
            add_to_equations(&state.constants, &group.targets, r);
        }
    }

    /// Puts sources on other segments.
    pub fn set_segments(&mut self, new: impl Iterator<Item = (usize, Segment)>) {
        new.for_each(|(source, segment)| self.segments[source] = segment);
        self.see_drives();
    }

    /// Sets the factor of all sources.
    pub fn set_drive(&mut self, drive: f64) {
        self.drive = drive;
        self.see_drives();
    }

    /// Adds up what of b does not change before the next corner, and notes which sources do.
    fn see_drives(&mut self) {
        let Network { system, segments, drive, rest, moving, .. } = self;
        rest.fill(0.0);
        for (row, value) in &system.constants {
            rest[*row as usize] -= *drive * value;
        }
        moving.clear();
        for (k, (segment, source)) in segments.iter().zip(&system.sources).enumerate() {
            let Some(value) = segment.unchanging() else {
                moving.push(k as u32);
                continue;
            };
            for (row, factor) in &source.into {
                rest[*row as usize] -= factor * *drive * value;
            }
        }
    }

    /// b
    pub fn drives(&self, t: f64, b: &mut [f64]) {
        self.begin_residual(t, b);
        b.iter_mut().for_each(|b| *b = -*b);
    }

    /// r = −b
    pub fn begin_residual(&self, t: f64, r: &mut [f64]) {
        r.copy_from_slice(&self.rest);
        for k in self.moving.iter().map(|k| *k as usize) {
            let value = self.drive * self.segments[k].value(t);
            for (row, factor) in &self.system.sources[k].into {
                r[*row as usize] -= factor * value;
            }
        }
        for (k, memory) in self.system.memories.iter().enumerate() {
            let value = self.drive * self.memories.value(k, t);
            for (row, factor) in &memory.into {
                r[*row as usize] -= factor * value;
            }
        }
    }

    /// r = G·x + f − b, with the laws' values of the last evaluation.
    pub fn residual(&self, x: &[f64], t: f64, r: &mut [f64]) {
        self.begin_residual(t, r);
        self.system.conductances.add_product(1.0, x, r);
        for (state, group) in self.groups.iter().zip(&self.system.groups) {
            add_to_equations(&state.values, &group.targets, r);
        }
        if self.gmin != 0.0 {
            for ((r, x), anchor) in r.iter_mut().zip(x).zip(&self.anchor).take(self.system.nodes) {
                *r += self.gmin * (x - anchor);
            }
        }
        if !self.pins.is_empty() {
            for (node, value) in &self.pins {
                r[*node as usize] += PIN * (x[*node as usize] - value);
            }
        }
    }

    /// s = sums of the magnitudes of the same terms, for judging a residual.
    pub fn term_sizes(&self, x: &[f64], t: f64, s: &mut [f64]) {
        s.fill(0.0);
        for (row, sum) in s.iter_mut().enumerate().take(self.system.equations()) {
            for (column, value) in self.system.conductances.row(row) {
                *sum += (value * x[column]).abs();
            }
        }
        for (row, value) in &self.system.constants {
            s[*row as usize] += value.abs();
        }
        for (segment, source) in self.segments.iter().zip(&self.system.sources) {
            let value = segment.value(t).abs();
            for (row, factor) in &source.into {
                s[*row as usize] += factor.abs() * value;
            }
        }
        for (k, memory) in self.system.memories.iter().enumerate() {
            let value = self.memories.value(k, t).abs();
            for (row, factor) in &memory.into {
                s[*row as usize] += factor.abs() * value;
            }
        }
        for (state, group) in self.groups.iter().zip(&self.system.groups) {
            for (o, target) in group.targets.iter().enumerate() {
                if let Target::Equations(into) = target {
                    // A law's own terms cancel too: its slopes say how large they are.
                    let mut size = state.values[o].abs();
                    for p in group.laws.row(o) {
                        size =
                            size.max((state.partials[p] * self.inputs[group.laws.input(p)]).abs());
                    }
                    for (row, factor) in into {
                        s[*row as usize] += factor.abs() * size;
                    }
                }
            }
        }
        if self.gmin != 0.0 {
            let all = s.iter_mut().zip(x).zip(&self.anchor);
            for ((sum, x), anchor) in all.take(self.system.nodes) {
                *sum += self.gmin * (x.abs() + anchor.abs());
            }
        }
        if !self.pins.is_empty() {
            for (node, value) in &self.pins {
                s[*node as usize] += PIN * (x[*node as usize].abs() + value.abs());
            }
        }
    }

    /// Q = C·x + q, with the laws' values of the last evaluation.
    pub fn charges(&self, x: &[f64], q: &mut [f64]) {
        q.fill(0.0);
        self.system.charges.add_product(1.0, x, q);
        for (state, group) in self.groups.iter().zip(&self.system.groups) {
            for (value, target) in state.values.iter().zip(&group.targets) {
                if let Target::Charge(k) = target {
                    q[*k as usize] += value;
                }
            }
        }
    }

    /// y += factor·(C + q')·u, with the derivatives of the last linearisation.
    pub fn add_charge_change(&self, factor: f64, u: &[f64], y: &mut [f64]) {
        self.add_linear_change(factor, u, y);
        self.add_curved_change(factor, u, y);
    }

    /// y += factor·C·u
    pub fn add_linear_change(&self, factor: f64, u: &[f64], y: &mut [f64]) {
        self.system.charges.add_product(factor, u, y);
    }

    /// y += factor·q'·u, with the derivatives of the last linearisation.
    pub fn add_curved_change(&self, factor: f64, u: &[f64], y: &mut [f64]) {
        for (state, group) in self.groups.iter().zip(&self.system.groups) {
            for (partial, charge, unknown) in &group.charge_slopes {
                y[*charge as usize] +=
                    factor * state.partials[*partial as usize] * u[*unknown as usize];
            }
        }
    }

    /// s = ∂/∂t (b − f), with the derivatives of the last linearisation.
    pub fn time_slopes(&self, t: f64, s: &mut [f64]) {
        s.fill(0.0);
        for (segment, source) in self.segments.iter().zip(&self.system.sources) {
            let slope = segment.derivative(t);
            for (row, factor) in &source.into {
                s[*row as usize] += factor * slope;
            }
        }
        for (k, memory) in self.system.memories.iter().enumerate() {
            let slope = self.memories.slope(k, t);
            for (row, factor) in &memory.into {
                s[*row as usize] += factor * slope;
            }
        }
        for (state, group) in self.groups.iter().zip(&self.system.groups) {
            for (partial, row, factor) in &group.by_time {
                s[*row as usize] -= factor * state.partials[*partial as usize];
            }
        }
    }

    /// Fills and factorises W(α) with the derivatives of the last linearisation.
    pub fn factorise_dynamic(&mut self, alpha: f64) -> Result<(), Singular> {
        let stages = &mut self.stages;
        if stages.constant_alpha.is_some_and(|known| (known - alpha).abs() <= SAME_ALPHA * alpha) {
            return Ok(());
        }
        let plan = &self.system.dynamic;
        let values = &mut stages.matrix.values;
        values.clone_from(&plan.fixed);
        for place in &plan.storage {
            values[place.slot as usize] += alpha * place.factor;
        }
        for (state, group) in self.groups.iter().zip(&self.system.groups) {
            for place in &group.dynamic {
                values[place.slot as usize] +=
                    place.factor * state.partials[place.partial as usize];
            }
            for place in &group.dynamic_charge {
                values[place.slot as usize] +=
                    alpha * place.factor * state.partials[place.partial as usize];
            }
        }
        for (voltage, state) in stages.voltages.iter_mut().zip(&self.groups) {
            *voltage = state.voltage;
        }
        stages.matrix.begin(&self.modes);
        let result = stages.matrix.factorise(plan, &mut self.orders, &mut self.statistics);
        let constant = result.is_ok() && self.system.is_linear();
        stages.constant_alpha = constant.then_some(alpha);
        stages.alpha = result.is_ok().then_some(alpha);
        result
    }

    /// Changes between the factors of the run's own steps and those of steps beside them.
    pub fn turn_aside(&mut self) {
        std::mem::swap(&mut self.stages, &mut self.aside);
    }

    /// Whether the factors at hand are of use for another step of the same length, and dear to make.
    pub fn favours_equal_steps(&self) -> bool {
        self.system.is_linear() && self.stages.matrix.is_symmetric()
    }

    /// Whether the factors at hand are those of about the same α.
    pub fn factors_serve(&self, alpha: f64) -> bool {
        self.stages.alpha.is_some_and(|known| (known - alpha).abs() <= ABOUT_SAME * alpha)
    }

    /// Whether no junction's conductance at `x` is far from what it was when the factors at hand were made.
    pub fn junctions_rest(&self, x: &[f64]) -> bool {
        self.stages.voltages.iter().zip(&self.system.groups).all(|(voltage, group)| {
            group.junction.is_none_or(|junction| {
                rests(&junction, &[*voltage, voltage_across(&junction, |k| x[k])])
            })
        })
    }

    /// Whether laws have no kink between where the factors at hand were made and `x`: all is linear but junctions, and they
    /// rest.
    pub fn meets_no_kink(&self, x: &[f64]) -> bool {
        self.system.has_junctions_alone() && self.junctions_rest(x)
    }

    /// Whether all is linear but junctions, and they rest at the ends of a step and in its middle.
    pub fn rests_within(&self, dense: &Dense, from: &State, to: &State) -> bool {
        let at = |theta: f64| move |k: usize| dense.unknown(k, theta, from, to);
        self.system.has_junctions_alone()
            && self.system.groups.iter().filter_map(|group| group.junction).all(|junction| {
                let across = |theta: f64| voltage_across(&junction, at(theta));
                rests(&junction, &[0.0, 0.5, 1.0].map(across))
            })
    }

    /// Whether currents of junctions move none of these unknowns while linear storages keep what they hold: what bends with a
    /// diode are their rates then. Pivots are forgotten on the way.
    pub fn bends_only_rates_of(&mut self, unknowns: &[u32]) -> bool {
        /// What is less than this part of what moves most is rounding.
        const ROUNDING: f64 = 1e-9;
        let system = self.system;
        let charges = system.held.iter().zip(&system.curved);
        let linear: Vec<bool> = charges.map(|(held, curved)| *held && !curved).collect();
        let n = system.equations();
        // All of them at once, each with a part of its own, so that none takes back what another does.
        let mut moved = vec![0.0; n + system.charges()];
        let junctions = system.groups.iter().filter(|group| group.junction.is_some());
        for (k, target) in junctions.flat_map(|group| &group.targets).enumerate() {
            if let Target::Equations(into) = target {
                let part = 0.5 + random::fraction(0, k as u64);
                into.iter().for_each(|(row, factor)| moved[*row as usize] += part * factor);
            }
        }
        self.forget_pivots();
        let regular = self.factorise_frozen(&linear).is_ok();
        if regular {
            self.solve_frozen(&mut moved);
        }
        self.forget_pivots();
        let most = moved[..n].iter().fold(0.0f64, |most, moved| most.max(moved.abs()));
        regular && unknowns.iter().all(|k| moved[*k as usize].abs() <= ROUNDING * most)
    }

    /// Whether something grows at more than the rate α of the factors at hand, where that can be told: W(α) has a determinant
    /// of another sign than where nothing can grow so fast. That is, with all charges held, the sign of the frozen
    /// matrix's, and of each −1 for each charge: det(G + α·A·Q') = αᵏ·det(G, A; −Q', 1/α).
    pub fn outgrows_step(&mut self) -> Option<bool> {
        let system = self.system;
        if system.held.iter().any(|held| !held) {
            return None;
        }
        self.factorise_frozen(&system.held).ok()?;
        let odd = system.charges() % 2 == 1;
        Some((self.stages.matrix.is_negative()? != self.frozen.is_negative()?) != odd)
    }

    /// Solves W·y = y in place.
    pub fn solve_dynamic(&mut self, y: &mut [f64]) {
        self.stages.matrix.solve(&mut self.statistics, y);
    }

    /// Fills and factorises the frozen network. `held` says which charges keep their value; the others have w = 0.
    pub fn factorise_frozen(&mut self, held: &[bool]) -> Result<(), Singular> {
        // An operating point is sought with values of its own on the diagonal.
        let constant = self.system.is_linear() && self.gmin == 0.0 && self.pins.is_empty();
        if constant && !held.is_empty() && self.factored_held == held {
            return Ok(());
        }
        self.factored_held.clear();
        let plan = &self.system.frozen;
        let values = &mut self.frozen.values;
        values.clone_from(&plan.fixed);
        for place in &plan.storage {
            if held[place.partial as usize] {
                values[place.slot as usize] += place.factor;
            }
        }
        for (slot, held) in self.system.free_slots.iter().zip(held) {
            if !held {
                values[*slot as usize] = 1.0;
            }
        }
        for (state, group) in self.groups.iter().zip(&self.system.groups) {
            for place in &group.frozen {
                values[place.slot as usize] +=
                    place.factor * state.partials[place.partial as usize];
            }
            for (charge, place) in &group.frozen_charge {
                if held[*charge as usize] {
                    values[place.slot as usize] +=
                        place.factor * state.partials[place.partial as usize];
                }
            }
        }
        if self.gmin != 0.0 {
            for slot in &self.system.node_slots {
                values[*slot as usize] += self.gmin;
            }
        }
        if !self.pins.is_empty() {
            for (node, _) in &self.pins {
                if let Some(slot) = self.system.node_slots.get(*node as usize) {
                    values[*slot as usize] += PIN;
                }
            }
        }
        self.frozen.begin(&self.modes);
        self.frozen.factorise(plan, &mut self.orders, &mut self.statistics)?;
        if constant {
            self.factored_held.extend_from_slice(held);
        }
        Ok(())
    }

    /// The one combination of these rows of the frozen matrix that vanishes.
    pub fn frozen_null_vector(&self, rows: &[u32]) -> Option<Vec<f64>> {
        super::ties::null_vector(rows, &self.system.frozen.pattern, &self.frozen.values)
    }

    /// Whether a row of a charge that is not held takes part in what makes the frozen matrix singular.
    pub fn is_singular_by_storages(&self, singular: &Singular, held: &[bool]) -> bool {
        let n = self.system.equations();
        let charges =
            singular.rows.iter().flatten().filter_map(|row| (*row as usize).checked_sub(n));
        charges.into_iter().any(|k| !held[k] && self.system.held[k])
    }

    /// Solves with the frozen network's factors, in place.
    pub fn solve_frozen(&mut self, y: &mut [f64]) {
        self.frozen.solve(&mut self.statistics, y);
    }

    /// Forgets the pivots chosen: the next matrices differ in structure (charges held, values out of range).
    pub fn forget_pivots(&mut self) {
        for matrix in [&mut self.frozen, &mut self.stages.matrix, &mut self.aside.matrix] {
            matrix.forget();
        }
        self.forget_constant_factors();
    }

    /// Goes on with other pivots: a switch has changed, and the matrices with it by orders of magnitude.
    pub fn change_pivots(&mut self) {
        for matrix in [&mut self.frozen, &mut self.stages.matrix, &mut self.aside.matrix] {
            matrix.change_modes(&self.modes);
        }
        self.forget_constant_factors();
    }

    /// A mode has changed: what follows from modes alone does so anew.
    pub fn forget_modes(&mut self) {
        self.groups.iter_mut().for_each(|state| state.known = false);
        self.forget_constant_factors();
    }

    /// Forgets that the factors at hand are of the present matrix.
    pub fn forget_constant_factors(&mut self) {
        self.stages.forget_alpha();
        self.aside.forget_alpha();
        self.factored_held.clear();
    }

    /// Guards of the modes, two values each.
    pub fn controls(&mut self, x: &[f64], t: f64, out: &mut [f64]) {
        if out.is_empty() {
            return;
        }
        self.set_inputs(x, t);
        self.system.controls.values(&self.inputs, &mut self.control_registers, out);
    }

    /// Of each value of the guards, what errors of the unknowns as large as `errors` make of it.
    pub fn control_noise(&mut self, x: &[f64], t: f64, errors: &[f64]) -> Vec<f64> {
        let laws = &self.system.controls;
        let mut values = vec![0.0; 2 * self.system.modes.len()];
        let mut partials = vec![0.0; laws.partials()];
        self.set_inputs(x, t);
        laws.full(&self.inputs, &mut self.control_registers, &mut values, &mut partials);
        let part = |p: usize| (partials[p] * errors[laws.input(p)]).abs();
        (0..values.len()).map(|o| laws.row(o).map(part).sum()).collect()
    }

    /// Appends the values of all laws at a point.
    pub fn law_values(&mut self, x: &[f64], t: f64, out: &mut Vec<f64>) {
        self.evaluate(x, t);
        out.extend(self.groups.iter().flat_map(|group| &group.values));
    }

    /// Output columns.
    pub fn outputs(&mut self, x: &[f64], w: &[f64], t: f64, out: &mut [f64]) {
        let system = self.system;
        for (column, unknown) in &system.plain_outputs {
            out[*column as usize] = x[*unknown as usize];
        }
        if system.law_columns.is_empty() {
            return;
        }
        self.set_inputs(x, t);
        let from = self.inputs.len() - w.len();
        self.inputs[from..].copy_from_slice(w);
        let columns = &system.law_columns;
        system.output_laws.scatter(&self.inputs, &mut self.output_registers, columns, out);
    }

    /// G + f' and A·(C + q') as triplets, with the derivatives of the last linearisation.
    pub fn matrices(&self) -> (Triplets, Triplets) {
        let system = self.system;
        let place = |(row, column, value): (usize, usize, f64)| (row as u32, column as u32, value);
        let mut fixed: Triplets = system.conductances.triplets().map(place).collect();
        let mut storage: Triplets = vec![];
        for (k, equation, sign) in system.rates.triplets() {
            let entries = system.charges.row(k);
            storage.extend(entries.map(|(column, c)| place((equation, column, sign * c))));
        }
        for (state, group) in self.groups.iter().zip(&system.groups) {
            for (o, target) in group.targets.iter().enumerate() {
                for p in group.laws.row(o) {
                    let (column, slope) = (group.laws.input(p), state.partials[p]);
                    match target {
                        _ if column >= system.equations() => {}
                        Target::Equations(into) => fixed.extend(
                            into.iter().map(|(row, factor)| (*row, column as u32, factor * slope)),
                        ),
                        Target::Charge(k) => storage.extend(
                            system
                                .rates
                                .row(*k as usize)
                                .map(|(row, sign)| place((row, column, sign * slope))),
                        ),
                    }
                }
            }
        }
        (fixed, storage)
    }

    /// Of each memory the slopes of its input; the system was compiled for linearising.
    pub fn memory_slopes(&mut self, x: &[f64]) -> Vec<Vec<(u32, f64)>> {
        self.set_inputs(x, 0.0);
        let (_, partials) = slopes(&self.system.memory_inputs, &self.inputs);
        let laws = &self.system.memory_inputs;
        let row = |o: usize| laws.row(o).map(|p| (laws.input(p) as u32, partials[p])).collect();
        (0..self.system.memories.len()).map(row).collect()
    }

    /// Of each output column the slopes by unknowns, and those by the rates of charges.
    #[allow(clippy::type_complexity)]
    pub fn output_slopes(&mut self, x: &[f64]) -> Vec<(Vec<(u32, f64)>, Vec<(u32, f64)>)> {
        self.set_inputs(x, 0.0);
        let system = self.system;
        let laws = &system.output_laws;
        let (_, partials) = slopes(laws, &self.inputs);
        let (n, first) = (system.equations(), system.inputs() - system.charges());
        let mut found = vec![];
        for o in 0..system.outputs.len() {
            let (mut terms, mut rates) = (vec![], vec![]);
            for p in laws.row(o) {
                let (input, slope) = (laws.input(p), partials[p]);
                if input < n {
                    terms.push((input as u32, slope));
                } else if input >= first {
                    rates.push(((input - first) as u32, slope));
                }
            }
            found.push((terms, rates));
        }
        found
    }

    /// ∂Q/∂x as triplets (charge, unknown, slope), with the derivatives of the last linearisation.
    pub fn storage_slopes(&self) -> Triplets {
        let all = 0..self.system.charges();
        all.flat_map(|k| self.charge_slopes(k).map(move |(x, slope)| (k as u32, x, slope)))
            .collect()
    }

    /// ∂Q_k/∂x, with the derivatives of the last linearisation.
    fn charge_slopes(&self, k: usize) -> impl Iterator<Item = (u32, f64)> + '_ {
        let linear = self.system.charges.row(k).map(|(column, c)| (column as u32, c));
        let groups = self.groups.iter().zip(&self.system.groups);
        let curved = groups.flat_map(move |(state, group)| {
            let own = group.charge_slopes.iter().filter(move |(_, charge, _)| *charge == k as u32);
            own.map(|(partial, _, unknown)| (*unknown, state.partials[*partial as usize]))
        });
        linear.chain(curved)
    }

    /// The first law whose value or derivative is no finite number.
    pub fn non_finite_law(&self) -> Option<crate::circuit::DeviceId> {
        for (state, group) in self.groups.iter().zip(&self.system.groups) {
            for (o, value) in state.values.iter().enumerate() {
                let slopes = group.laws.row(o).all(|p| state.partials[p].is_finite());
                if !value.is_finite() || !slopes {
                    return device_of(group, o);
                }
            }
        }
        None
    }
}

/// Adds values of laws to the equations that they go into.
fn add_to_equations(values: &[f64], targets: &[Target], r: &mut [f64]) {
    for (value, target) in values.iter().zip(targets) {
        if let Target::Equations(into) = target {
            for (row, factor) in into {
                r[*row as usize] += factor * value;
            }
        }
    }
}

/// Entries of a matrix: (row, column, value).
pub(crate) type Triplets = Vec<(u32, u32, f64)>;

/// Values and slopes of laws.
fn slopes(laws: &LawSet, inputs: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let mut values = vec![0.0; laws.len()];
    let mut partials = vec![0.0; laws.partials()];
    laws.full(inputs, &mut laws.registers(), &mut values, &mut partials);
    (values, partials)
}

fn device_of(group: &LawGroup, o: usize) -> Option<crate::circuit::DeviceId> {
    group.devices.get(o).copied()
}
