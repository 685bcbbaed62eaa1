//! Runs abreast: several at once, one in each lane.
//!
//! Of the work of a run over time most are iterations and stages: laws, products with constant matrices, two triangles. Runs
//! of circuits that differ in values alone do these together. Each keeps its own time, steps, modes, factors, accepts and
//! rejects by itself, and stops where it wants one. Once all runs have come to such a place, one pass makes every lane's;
//! then they go on. What a run makes of it is, to the last bit, what it would make alone, whoever sits beside it.
//!
//! A run that waits is a future that is pending, and there is nothing else that it could wait for.

use super::laws::Abreast;
use super::network::Network;
use super::newton::Stage;
use super::sparse::Rows;
use super::system::{System, Target};
use crate::circuit::stamps::Junction;
use crate::linear::{Flat, LANES, Number, Pack, put_lane, take_lane};
use std::cell::RefCell;
use std::future::{Future, poll_fn};
use std::pin::{Pin, pin};
use std::task::{Context, Poll, Waker};

/// Larger circuits have too little of what is done in lanes, and too much that would have to be held for it.
const LARGEST: usize = 256;

/// Runs that go abreast.
#[derive(Debug, Default)]
pub struct Group {
    table: RefCell<Table>,
}

/// A run's place in a group.
#[derive(Clone, Copy, Debug)]
pub struct Seat<'g> {
    group: &'g Group,
    lane: usize,
}

/// A place that is taken, as long as this lives.
#[derive(Debug)]
pub(crate) struct Seated<'g>(Seat<'g>);

/// Those beside a run, if there are any.
pub(crate) type Company<'g> = Option<&'g Seated<'g>>;

impl Group {
    /// Makes runs: `next` begins one in a place, of which there are `width`, and `done` takes what has become of it and says
    /// whether to go on.
    pub fn run<'g, F: Future>(
        &'g self,
        width: usize,
        mut next: impl FnMut(Seat<'g>) -> Option<F>,
        mut done: impl FnMut(F::Output) -> bool,
    ) {
        let width = width.clamp(1, LANES);
        let mut context = Context::from_waker(Waker::noop());
        let mut runs: [Option<Pin<Box<F>>>; LANES] = std::array::from_fn(|_| None);
        let (mut more, mut back) = (true, false);
        loop {
            let mut waiting = false;
            // To and fro: what is at hand in the nearest memory is that of the run that was last.
            back = !back;
            for turn in 0..width {
                let lane = if back { width - 1 - turn } else { turn };
                let place = &mut runs[lane];
                loop {
                    if place.is_none() && more {
                        *place = next(Seat { group: self, lane }).map(Box::pin);
                        more = place.is_some();
                    }
                    let Some(run) = place else { break };
                    let Poll::Ready(outcome) = run.as_mut().poll(&mut context) else {
                        waiting = true;
                        break;
                    };
                    *place = None;
                    if !done(outcome) {
                        return;
                    }
                }
            }
            if !waiting {
                return;
            }
            if let Some(plan) = &mut self.table.borrow_mut().plan {
                plan.pass();
            }
        }
    }
}

/// What a future comes to that waits for nobody: a run without company.
///
/// # Panics
/// Where it waits: an error of the caller.
pub(crate) fn alone<F: Future>(run: F) -> F::Output {
    match pin!(run).poll(&mut Context::from_waker(Waker::noop())) {
        Poll::Ready(outcome) => outcome,
        Poll::Pending => unreachable!("only runs with company wait"),
    }
}

impl<'g> Seat<'g> {
    /// Takes the place for a circuit; nothing where it differs from those of the others in more than values, or is not one
    /// that gains by it.
    pub(crate) fn take(self, system: &System) -> Option<Seated<'g>> {
        let mut table = self.group.table.borrow_mut();
        if !table.taken.contains(&true) {
            table.plan = Plan::new(system);
        }
        let fits = table.plan.as_mut()?.put(system, self.lane);
        table.taken[self.lane] = fits;
        fits.then(|| Seated(self))
    }
}

impl Drop for Seated<'_> {
    fn drop(&mut self) {
        self.0.group.table.borrow_mut().taken[self.0.lane] = false;
    }
}

impl Seated<'_> {
    /// One iteration: leaves what W(α)⁻¹ makes of the residual in `update`, and in `q` the charges where that leads, as far
    /// as they are linear. Not where the network is otherwise than in a run over time; says whether it has.
    pub async fn iterate(
        &self,
        network: &mut Network<'_>,
        stage: &Stage<'_>,
        x: &[f64],
        q: &mut [f64],
        update: &mut [f64],
    ) -> bool {
        if !network.is_plain() {
            return false;
        }
        network.begin_residual(stage.t, update);
        let Stage { t, alpha, beta, .. } = *stage;
        let question = Question { t, x, drives: update, rates: Rates::Of(alpha, beta) };
        self.ask(network, &question).await;
        network.statistics.evaluations += 1;
        if !self.take(network, update, q) {
            network.solve_dynamic(update);
            network.add_linear_change(-1.0, update, q);
        }
        true
    }

    /// One stage of a Rosenbrock method: leaves W(α)⁻¹·(b − G·x − f + `more` + A·`rates`) in `update`, and the linear charges
    /// of that in `q`; `more` are multiples of slopes. Under the same condition.
    pub async fn stage(
        &self,
        network: &mut Network<'_>,
        (t, x): (f64, &[f64]),
        more: Option<(f64, &[f64])>,
        rates: &[f64],
        [update, q]: [&mut [f64]; 2],
    ) -> bool {
        if !network.is_plain() {
            return false;
        }
        network.begin_residual(t, update);
        let rates = Rates::Are(rates, more);
        self.ask(network, &Question { t, x, drives: update, rates }).await;
        if !self.take(network, update, q) {
            network.solve_dynamic(update);
            q.fill(0.0);
            network.add_linear_change(1.0, update, q);
        }
        true
    }

    /// Waits until the question is answered.
    async fn ask(&self, network: &mut Network<'_>, question: &Question<'_>) {
        if let Some(plan) = &mut self.0.group.table.borrow_mut().plan {
            plan.ask(self.0.lane, network, question);
        }
        let mut asked = false;
        poll_fn(|_| match std::mem::replace(&mut asked, true) {
            false => Poll::Pending,
            true => Poll::Ready(()),
        })
        .await;
    }

    /// Takes the update and the charges; where the lane has factors of its own, the residual and the charges before. Says
    /// whether it has taken the former.
    fn take(&self, network: &mut Network, update: &mut [f64], q: &mut [f64]) -> bool {
        let (table, lane) = (self.0.group.table.borrow(), self.0.lane);
        let Some(plan) = &table.plan else { return false };
        let solved = plan.factors.solves(lane);
        if solved {
            network.statistics.solves += 1;
            take_lane(&plan.update, lane, update);
            take_lane(&plan.led, lane, q);
        } else {
            take_lane(&plan.residual, lane, update);
            take_lane(&plan.q, lane, q);
        }
        solved
    }
}

/// What a run wants an iteration or a stage of.
struct Question<'a> {
    t: f64,
    x: &'a [f64],
    /// What of the residual comes from sources.
    drives: &'a [f64],
    rates: Rates<'a>,
}

/// How a question takes the rates of charges.
enum Rates<'a> {
    /// α·Q + β, as an iteration does.
    Of(f64, &'a [f64]),
    /// These, as a stage of a Rosenbrock method does, whose residual has the other sign, and multiples of slopes in it.
    Are(&'a [f64], Option<(f64, &'a [f64])>),
}

#[derive(Debug, Default)]
struct Table {
    taken: [bool; LANES],
    plan: Option<Plan>,
}

/// What iterations of a circuit take, with each lane's values.
#[derive(Debug)]
struct Plan {
    time_input: usize,
    mode_slots: usize,
    groups: Vec<Laws>,
    conductances: Rows<Pack>,
    charges: Rows<Pack>,
    rates: Rows<Pack>,
    factors: Factors,
    /// What lanes ask with: unknowns, times and modes; what of the residual comes from sources; α and β, or rates.
    inputs: Vec<Pack>,
    drives: Vec<Pack>,
    alpha: Pack,
    beta: Vec<Pack>,
    /// 1 for a stage of a Rosenbrock method, 0 for an iteration; and what a stage has more in its residual.
    is_stage: Pack,
    more: Vec<Pack>,
    /// What they are given: charges there and, as far as they are linear, where the update leads; residuals and updates.
    q: Vec<Pack>,
    led: Vec<Pack>,
    residual: Vec<Pack>,
    update: Vec<Pack>,
    work: Vec<Pack>,
}

/// A group of laws.
#[derive(Debug)]
struct Laws {
    /// The programs; nothing of laws that are affine for fixed modes, whose values each run has at hand.
    programs: Option<Abreast>,
    junction: Option<Junction>,
    values: Vec<Pack>,
    /// Which value goes into which equation, with what factor; which into which charge.
    equations: Vec<(u32, u32)>,
    factors: Vec<Pack>,
    charges: Vec<(u32, u32)>,
}

impl Laws {
    fn new(group: &super::system::LawGroup) -> Laws {
        let (mut equations, mut factors, mut charges) = (vec![], vec![], vec![]);
        for (k, target) in group.targets.iter().enumerate() {
            match target {
                Target::Equations(into) => into.iter().for_each(|(row, factor)| {
                    equations.push((k as u32, *row));
                    factors.push(Pack::splat(*factor));
                }),
                Target::Charge(charge) => charges.push((k as u32, *charge)),
            }
        }
        Laws {
            programs: (!group.modal).then(|| Abreast::new(&group.laws)),
            junction: group.junction,
            values: vec![Pack::ZERO; group.targets.len()],
            equations,
            factors,
            charges,
        }
    }

    fn put(&mut self, group: &super::system::LawGroup, lane: usize) -> bool {
        let own = Laws::new(group);
        let across = |junction: &Option<Junction>| junction.map(|junction| junction.across);
        let alike = self.values.len() == own.values.len()
            && across(&self.junction) == across(&own.junction)
            && (&self.equations, &self.charges) == (&own.equations, &own.charges)
            && match &mut self.programs {
                Some(programs) => !group.modal && programs.put(&group.laws, lane),
                None => group.modal,
            };
        if alike {
            let factors = self.factors.iter_mut().zip(own.factors);
            factors.for_each(|(factor, own)| factor.0[lane] = own.0[lane]);
        }
        alike
    }
}

impl Plan {
    fn new(system: &System) -> Option<Plan> {
        let (n, charges) = (system.equations(), system.charges());
        if system.is_linear() || n > LARGEST {
            return None;
        }
        Some(Plan {
            time_input: system.time_input,
            mode_slots: system.mode_slots,
            groups: system.groups.iter().map(Laws::new).collect(),
            conductances: system.conductances.abreast(),
            charges: system.charges.abreast(),
            rates: system.rates.abreast(),
            factors: Factors::default(),
            inputs: vec![Pack::ZERO; system.inputs()],
            drives: vec![Pack::ZERO; n],
            alpha: Pack::ZERO,
            beta: vec![Pack::ZERO; charges],
            is_stage: Pack::ZERO,
            more: vec![Pack::ZERO; n],
            q: vec![Pack::ZERO; charges],
            led: vec![Pack::ZERO; charges],
            residual: vec![Pack::ZERO; n],
            update: vec![Pack::ZERO; n],
            work: vec![Pack::ZERO; n],
        })
    }

    /// Puts a circuit into a lane; says whether it fits.
    fn put(&mut self, system: &System, lane: usize) -> bool {
        let inputs = (self.time_input, self.mode_slots, self.inputs.len());
        let fits = inputs == (system.time_input, system.mode_slots, system.inputs())
            && self.drives.len() == system.equations()
            && self.groups.len() == system.groups.len()
            && self.conductances.put(&system.conductances, lane)
            && self.charges.put(&system.charges, lane)
            && self.rates.put(&system.rates, lane)
            && self.groups.iter_mut().zip(&system.groups).all(|(own, group)| own.put(group, lane));
        self.factors.forget(lane);
        fits
    }

    /// Takes the question of a lane.
    fn ask(&mut self, lane: usize, network: &mut Network, question: &Question) {
        let Question { t, x, drives, rates } = question;
        let (unknowns, others) = self.inputs.split_at_mut(self.time_input);
        put_lane(unknowns, lane, x);
        others[0].0[lane] = *t;
        put_lane(&mut others[1..], lane, &network.modes);
        put_lane(&mut self.drives, lane, drives);
        match rates {
            Rates::Of(alpha, beta) => {
                self.is_stage.0[lane] = 0.0;
                self.alpha.0[lane] = *alpha;
                put_lane(&mut self.beta, lane, beta);
            }
            Rates::Are(rates, more) => {
                self.is_stage.0[lane] = 1.0;
                put_lane(&mut self.beta, lane, rates);
                match more {
                    Some((factor, slopes)) => {
                        let terms = self.more.iter_mut().zip(*slopes);
                        terms.for_each(|(own, slope)| own.0[lane] = factor * slope);
                    }
                    // To the last bit nothing.
                    None => self.more.iter_mut().for_each(|own| own.0[lane] = -0.0),
                }
            }
        }
        for (k, laws) in self.groups.iter_mut().enumerate() {
            if laws.programs.is_none() {
                put_lane(&mut laws.values, lane, network.modal_values(k, x, *t));
            }
        }
        self.factors.follow(lane, network);
    }

    /// One iteration in every lane. What stands in lanes that have not asked for one does no harm.
    fn pass(&mut self) {
        let n = self.drives.len();
        let Plan { groups, inputs, q, residual, .. } = self;
        for laws in groups.iter_mut() {
            if let Some(junction) = &laws.junction {
                let [anode, cathode] =
                    junction.across.map(|end| end.map_or(Pack::ZERO, |k| inputs[k.0 as usize]));
                inputs[self.time_input - 1] = anode - cathode;
            }
            if let Some(programs) = &mut laws.programs {
                programs.values(inputs, &mut laws.values);
            }
        }
        let one = Pack::splat(1.0);
        q.fill(Pack::ZERO);
        self.charges.add_product(one, &inputs[..n], q);
        residual.copy_from_slice(&self.drives);
        self.conductances.add_product(one, &inputs[..n], residual);
        for laws in groups.iter() {
            for (value, charge) in &laws.charges {
                let q = &mut q[*charge as usize];
                *q = *q + laws.values[*value as usize];
            }
            for ((value, row), factor) in laws.equations.iter().zip(&laws.factors) {
                let r = &mut residual[*row as usize];
                *r = *r + *factor * laws.values[*value as usize];
            }
        }
        let is_stage = self.is_stage;
        let of_stage = |stage: f64, a: f64, b: f64| if stage != 0.0 { a } else { b };
        if !is_stage.every(|stage| stage == 0.0) {
            for (r, more) in residual.iter_mut().zip(&self.more) {
                *r = is_stage.with_two(*more - *r, *r, of_stage);
            }
        }
        // The rates in the place of β, which is asked with anew.
        for (rate, q) in self.beta.iter_mut().zip(&*q) {
            *rate = is_stage.with_two(*rate, self.alpha * *q + *rate, of_stage);
        }
        self.rates.add_transposed(one, &self.beta, residual);
        if let Some(flat) = &self.factors.flat {
            self.update.copy_from_slice(residual);
            flat.solve(&mut self.update, &mut self.work);
            for (led, q) in self.led.iter_mut().zip(&*q) {
                *led = is_stage.with_two(Pack::ZERO, *q, of_stage);
            }
            let sign = is_stage.map(|stage| of_stage(stage, 1.0, -1.0));
            self.charges.add_product(sign, &self.update, &mut self.led);
        }
    }
}

/// The factors that lanes solve with.
#[derive(Debug, Default)]
struct Factors {
    flat: Option<Flat<Pack>>,
    /// Which of a run's factors a lane has, by their number; nothing where they are of another order than those here.
    known: [Option<u64>; LANES],
}

impl Factors {
    fn forget(&mut self, lane: usize) {
        self.known[lane] = None;
    }

    fn solves(&self, lane: usize) -> bool {
        self.known[lane].is_some()
    }

    /// Takes a lane's factors where it has new ones.
    fn follow(&mut self, lane: usize, network: &Network) {
        let (number, flat) = network.dynamic_factors();
        if self.known[lane] == Some(number) {
            return;
        }
        self.known[lane] = None;
        let Some(flat) = flat else { return };
        if self.known.iter().all(Option::is_none) && !self.put(flat, lane) {
            // Nobody solves by this order any more.
            self.flat = Some(flat.abreast());
            self.known[lane] = Some(number);
        } else if self.put(flat, lane) {
            self.known[lane] = Some(number);
        }
    }

    fn put(&mut self, flat: &Flat<f64>, lane: usize) -> bool {
        self.flat.as_mut().is_some_and(|own| own.put(flat, lane))
    }
}
