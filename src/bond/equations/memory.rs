//! What memories hold while the equations are solved: set between steps, constant or known within them.

use super::compiled::Readings;
use super::{Equations, Formula, Input, Known};
use crate::expr::{Dag, NodeId, Program};
use std::sync::{Arc, Mutex, MutexGuard};

/// A memory of a signal, and what it remembers.
#[derive(Clone, Debug)]
pub struct Remembered {
    /// Its wave in [`Equations::waves`](super::Equations::waves).
    pub wave: usize,
    /// The unknown that equals what is remembered.
    pub unknown: usize,
    /// How it remembers.
    pub kind: Kind,
    /// Its input.
    pub input: Formula,
    /// Of a hysteresis, the condition that it follows.
    pub condition: Option<usize>,
    /// The round in which it takes its value, where several do at one instant.
    pub round: u32,
}

/// The ways of remembering, with numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(missing_docs)]
pub enum Kind {
    Hysteresis { low: f64, high: f64 },
    Sample { period: f64 },
    Delay { by: f64 },
}

/// The present content of a memory; clones share it.
#[derive(Clone, Debug)]
pub struct Memory(Arc<Mutex<Content>>);

#[derive(Debug)]
struct Content {
    /// What is held; of a delay the value before the start.
    value: f64,
    past: Option<Past>,
}

impl Remembered {
    /// What a memory takes at an instant when its input has a value; `None` where it keeps what it has.
    pub fn takes(&self, t: f64, input: f64, room: f64) -> Option<f64> {
        match self.kind {
            _ if t == 0.0 => Some(match self.kind {
                Kind::Hysteresis { high, .. } => f64::from(input > high),
                Kind::Sample { .. } | Kind::Delay { .. } => input,
            }),
            Kind::Sample { period } => {
                let turns = (t / period).round();
                ((t - turns * period).abs() <= room).then_some(input)
            }
            Kind::Hysteresis { .. } | Kind::Delay { .. } => None,
        }
    }
}

impl Equations {
    /// Lets the memories take their values at an instant, round after round; `solve` finds the values of all unknowns
    /// before each round and after the last. Instants within `room` of each other are one.
    pub fn take<E>(
        &self,
        t: f64,
        inside: f64,
        room: f64,
        y: &mut [f64],
        solve: &mut dyn FnMut(&mut [f64]) -> Result<(), E>,
    ) -> Result<(), E> {
        solve(y)?;
        for rest in self.memories.chunk_by(|a, b| a.round == b.round) {
            let inputs: Vec<Formula> = rest.iter().map(|memory| memory.input.clone()).collect();
            let values: Vec<f64> = Readings::new(self, &inputs).read(t, inside, y).collect();
            let mut any = false;
            for (memory, input) in rest.iter().zip(values) {
                if let (Some(value), Some(Known::Memory(content))) =
                    (memory.takes(t, input, room), self.waves.get(memory.wave))
                {
                    content.set(value);
                    any = true;
                }
            }
            if any {
                solve(y)?;
            }
        }
        Ok(())
    }

    /// The content of a memory.
    pub fn content(&self, memory: &Remembered) -> Option<&Memory> {
        match self.waves.get(memory.wave) {
            Some(Known::Memory(content)) => Some(content),
            _ => None,
        }
    }
}

impl Memory {
    /// A value that is held.
    pub fn held() -> Memory {
        Memory(Arc::new(Mutex::new(Content { value: 0.0, past: None })))
    }

    /// A delay of an input over unknowns and waves.
    pub fn delayed(by: f64, input: &Formula, waves: &[Known]) -> Memory {
        let past = Past::new(by, input, waves);
        Memory(Arc::new(Mutex::new(Content { value: 0.0, past: Some(past) })))
    }

    fn content(&self) -> MutexGuard<'_, Content> {
        self.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }

    /// Sets what is held, or what a delay gives until its input has a past; forgets the past.
    pub fn set(&self, value: f64) {
        let mut content = self.content();
        content.value = value;
        if let Some(past) = &mut content.past {
            past.steps.clear();
        }
    }

    /// The value at `t` of the piece that holds at `inside`.
    pub fn value(&self, t: f64, inside: f64) -> f64 {
        let mut content = self.content();
        let value = content.value;
        match &mut content.past {
            Some(past) => past.value(t, inside).unwrap_or(value),
            None => value,
        }
    }

    /// Ends the present segment of a delay's past at a time.
    pub fn close(&self, t: f64) {
        if let Some(past) = &mut self.content().past {
            past.steps.iter_mut().rev().take_while(|step| step.to > t).for_each(|step| step.to = t);
        }
    }

    /// Takes a step within the segment `from..to` into the past of a delay: `at` gives the values of all unknowns at a
    /// part of the step, from the polynomial of degree 3 that the step is.
    pub fn extend(&self, t: f64, h: f64, segment: (f64, f64), at: &mut dyn FnMut(f64, &mut [f64])) {
        if let Some(past) = &mut self.content().past {
            past.extend(t, h, segment, at);
        }
    }
}

/// The past of the unknowns that a delayed input speaks of.
#[derive(Debug)]
struct Past {
    by: f64,
    program: Program,
    registers: Vec<f64>,
    inputs: Vec<f64>,
    /// The unknowns among the inputs, and the waves.
    unknowns: Vec<u32>,
    waves: Vec<Known>,
    steps: Vec<PastStep>,
    values: Vec<f64>,
}

/// A step, its segment, and each unknown at 0, 1/3, 2/3 and 1 of it: a polynomial of degree 3 through these is the step.
#[derive(Debug)]
struct PastStep {
    t: f64,
    h: f64,
    from: f64,
    to: f64,
    values: Vec<[f64; 4]>,
}

const NODES: [f64; 4] = [0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0];

impl Past {
    fn new(by: f64, input: &Formula, waves: &[Known]) -> Past {
        let mut unknowns = vec![];
        let mut used = vec![];
        input.leaves(&mut |leaf, _| match leaf {
            Input::Unknown(k) if !unknowns.contains(k) => unknowns.push(*k),
            Input::Wave(k) if !used.contains(k) => used.push(*k),
            _ => {}
        });
        // Inputs: the unknowns, time, the waves.
        let place = |leaf: &Input| {
            let at = match leaf {
                Input::Unknown(k) => unknowns.iter().position(|u| u == k),
                Input::Time => Some(unknowns.len()),
                // What is delayed is a signal: its conditions are in its own equation.
                Input::Condition(_) | Input::Parameter(_) => None,
                Input::Wave(k) => {
                    used.iter().position(|u| u == k).map(|at| unknowns.len() + 1 + at)
                }
            };
            at.unwrap_or(unknowns.len()) as u32
        };
        let mut dag = Dag::default();
        let added: Result<NodeId, std::convert::Infallible> =
            dag.add(input, &mut |dag, leaf, _| Ok(dag.input(place(leaf))));
        let Ok(output) = added;
        let program = Program::compile(&dag, &[output]);
        Past {
            by,
            registers: program.registers(),
            program,
            inputs: vec![0.0; unknowns.len() + 1 + used.len()],
            waves: used.iter().filter_map(|k| waves.get(*k as usize).cloned()).collect(),
            unknowns,
            steps: vec![],
            values: vec![],
        }
    }

    /// The input `by` before `t`; `None` before the start.
    fn value(&mut self, t: f64, inside: f64) -> Option<f64> {
        let (s, within) = (t - self.by, inside - self.by);
        let first = self.steps.first()?;
        if within < first.from {
            return None;
        }
        // The segment that held then, and of its steps the one at that time.
        let begin = self.steps.partition_point(|step| step.to <= within);
        let end = self.steps.partition_point(|step| step.from <= within);
        let own = self.steps.get(begin..end).filter(|own| !own.is_empty());
        let own = own.unwrap_or(&self.steps[self.steps.len() - 1..]);
        let at = own.partition_point(|step| step.t <= s).saturating_sub(1);
        let step = &own[at];
        let x = (s - step.t) / step.h;
        // Lagrange's polynomials.
        let weights: [f64; 4] = std::array::from_fn(|k| {
            (0..4).filter(|j| *j != k).map(|j| (x - NODES[j]) / (NODES[k] - NODES[j])).product()
        });
        let inside = 0.5 * (step.from + step.to);
        let n = self.unknowns.len();
        for (input, values) in self.inputs.iter_mut().zip(&step.values) {
            *input = values.iter().zip(weights).map(|(v, w)| v * w).sum();
        }
        self.inputs[n] = s;
        for (input, wave) in self.inputs[n + 1..].iter_mut().zip(&self.waves) {
            *input = wave.value(s, inside);
        }
        self.program.run(&self.inputs, &mut self.registers);
        self.program.outputs(&self.registers).next()
    }

    fn extend(
        &mut self,
        t: f64,
        h: f64,
        (from, to): (f64, f64),
        at: &mut dyn FnMut(f64, &mut [f64]),
    ) {
        // What is older than the delay is asked for no more.
        let old = self.steps.iter().take_while(|step| step.to < t - 1.5 * self.by).count();
        if old > 1000 {
            self.steps.drain(..old);
        }
        let mut values = vec![[0.0; 4]; self.unknowns.len()];
        let largest = self.unknowns.iter().max().map_or(0, |k| *k as usize + 1);
        self.values.resize(self.values.len().max(largest), 0.0);
        for (k, node) in NODES.into_iter().enumerate() {
            at(node, &mut self.values);
            for (value, unknown) in values.iter_mut().zip(&self.unknowns) {
                value[k] = self.values[*unknown as usize];
            }
        }
        self.steps.push(PastStep { t, h, from, to, values });
    }
}
