//! Runs abreast: several at once, one in each lane.
//!
//! Of the work of a run over time most are iterations and stages: laws, products with constant matrices, two triangles. Runs
//! of circuits that differ in values alone do these together. Each keeps its own time, steps, modes, factors, accepts and
//! rejects by itself, and stops where it wants one. Once all runs have come to such a place, one pass makes every lane's;
//! then they go on. What a run makes of it is, to the last bit, what it would make alone, whoever sits beside it.
//!
//! A run that waits is a future that is pending, and there is nothing else that it could wait for.

mod equations;
mod points;

use self::equations::Equations;
pub(crate) use self::points::Points;
use super::network::Network;
use super::newton::Stage;
use super::system::System;
use crate::linear::{Flat, LANES, Number, Pack, put_lane, take_lane};
use std::cell::RefCell;
use std::future::{Future, poll_fn};
use std::pin::{Pin, pin};
use std::task::{Context, Poll, Waker};

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
            let occupied = runs.iter().flatten().count();
            self.table.borrow_mut().company = if more { width } else { occupied };
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
            let mut table = self.table.borrow_mut();
            table.passes += 1;
            if let Some(plan) = &mut table.plan {
                plan.pass();
            }
        }
    }

    /// How many passes have been made, each of an iteration or stage for every run that wanted one.
    pub fn passes(&self) -> u64 {
        self.table.borrow().passes
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
        let Seat { group, lane } = self.0;
        let mut table = group.table.borrow_mut();
        table.taken[lane] = false;
        if let Some(plan) = &mut table.plan {
            plan.factors.forget(lane);
        }
    }
}

impl Seated<'_> {
    /// Another network begins, which numbers its factors from anew.
    pub fn begin(&self) {
        if let Some(plan) = &mut self.0.group.table.borrow_mut().plan {
            plan.factors.forget(self.0.lane);
        }
    }

    /// One iteration: leaves what W(α)⁻¹ makes of the residual in `update`, and in `q` the charges where that leads, as far
    /// as they are linear. Not where a run had better do that by itself; says whether it has.
    pub async fn iterate(
        &self,
        network: &mut Network<'_>,
        stage: &Stage<'_>,
        x: &[f64],
        q: &mut [f64],
        update: &mut [f64],
    ) -> bool {
        if !self.may_ask(network) {
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
    /// of that in `q`; `more` are multiples of slopes. The same holds.
    pub async fn stage(
        &self,
        network: &mut Network<'_>,
        (t, x): (f64, &[f64]),
        more: Option<(f64, &[f64])>,
        rates: &[f64],
        [update, q]: [&mut [f64]; 2],
    ) -> bool {
        if !self.may_ask(network) {
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

    /// Whether the network is as it is in a run over time, and others are there or will come: a pass costs more than what it
    /// does for one.
    fn may_ask(&self, network: &Network) -> bool {
        network.is_plain() && self.0.group.table.borrow().company > 1
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
            take_lane(&plan.equations.residual, lane, update);
            take_lane(&plan.equations.q, lane, q);
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
    /// How many runs there are, or may be.
    company: usize,
    passes: u64,
}

/// What iterations of a circuit take, with each lane's values.
#[derive(Debug)]
struct Plan {
    equations: Equations,
    factors: Factors,
    /// α and β, or rates.
    alpha: Pack,
    beta: Vec<Pack>,
    /// 1 for a stage of a Rosenbrock method, 0 for an iteration; and what a stage has more in its residual.
    is_stage: Pack,
    more: Vec<Pack>,
    /// What comes of it: updates, and charges where they lead, as far as they are linear.
    update: Vec<Pack>,
    led: Vec<Pack>,
    work: Vec<Pack>,
}

impl Plan {
    fn new(system: &System) -> Option<Plan> {
        let (n, charges) = (system.equations(), system.charges());
        Some(Plan {
            equations: Equations::new(system)?,
            factors: Factors::default(),
            alpha: Pack::ZERO,
            beta: vec![Pack::ZERO; charges],
            is_stage: Pack::ZERO,
            more: vec![Pack::ZERO; n],
            update: vec![Pack::ZERO; n],
            led: vec![Pack::ZERO; charges],
            work: vec![Pack::ZERO; n],
        })
    }

    /// Puts a circuit into a lane; says whether it fits.
    fn put(&mut self, system: &System, lane: usize) -> bool {
        self.equations.put(system, lane)
    }

    /// Takes the question of a lane.
    fn ask(&mut self, lane: usize, network: &mut Network, question: &Question) {
        let Question { t, x, drives, rates } = question;
        self.equations.ask(lane, network, (*t, x), drives);
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
        self.factors.follow(lane, network);
    }

    /// One iteration or stage in every lane. What stands in lanes that have not asked for one does no harm.
    fn pass(&mut self) {
        self.equations.evaluate();
        let Equations { q, residual, charges, rates, .. } = &mut self.equations;
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
        rates.add_transposed(Pack::splat(1.0), &self.beta, residual);
        if let Some(flat) = &self.factors.flat {
            self.update.copy_from_slice(residual);
            flat.solve(&mut self.update, &mut self.work);
            for (led, q) in self.led.iter_mut().zip(&*q) {
                *led = is_stage.with_two(Pack::ZERO, *q, of_stage);
            }
            let sign = is_stage.map(|stage| of_stage(stage, 1.0, -1.0));
            charges.add_product(sign, &self.update, &mut self.led);
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
        let mut serves = self.flat.as_mut().is_some_and(|own| own.put(flat, lane));
        if !serves && self.known.iter().all(Option::is_none) {
            // Nobody solves by that order any more.
            self.flat = Some(flat.abreast());
            serves = true;
        }
        self.known[lane] = serves.then_some(number);
    }
}
