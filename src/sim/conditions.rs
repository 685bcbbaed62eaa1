//! Conditions of laws: what compares, `sign`, `floor` and `mod` becomes a mode that is held during a step.
//!
//! ```text
//! a < b, a <= b, a == b …   side of a − b: s = −1, 0 or 1;   the value is that of  s < 0, s <= 0, s == 0 …
//! sign(a)                   side of a:      s
//! floor(a)                  cell of a:      n ≤ a < n + 1;    the value is n
//! mod(a, b)                 a − b·floor(a/b)
//! ```
//!
//! Comparisons of the same two values share one mode, whichever way they are written. A condition over time alone
//! changes at times that are known beforehand ([`Clock`]). Each other one has three inputs of the programs: its mode,
//! its hold (held, free, or a ramp: see [`events`](super::events)) and the slope of the ramp. Where a condition is
//! ramped its value lies between 0 and 1: `and` is then the smaller of two, `or` the larger, and `if` blends.

use super::clocks::Clock;
use crate::circuit::DeviceId;
use crate::circuit::stamps::{Law, Leaf};
use crate::expr::{Binary, Dag, Function, Node, NodeId, Unary};
use crate::source::Span;
use std::collections::{BTreeSet, HashMap};

/// What a condition asks of its guards a and b.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) enum Question {
    /// Which of them is larger.
    Side,
    /// Between which whole numbers a lies.
    Cell,
}

/// A condition: a row of the modes of a system.
#[derive(Clone, Debug)]
pub(crate) struct Condition {
    pub question: Question,
    /// The device whose law it stands in first, and its place there.
    pub device: DeviceId,
    pub span: Span,
    /// Its guards, nodes of [`Conditions::guards`].
    pub a: NodeId,
    pub b: NodeId,
    /// When it changes, where that follows from time alone.
    pub clock: Option<Clock>,
}

/// The conditions of all laws.
#[derive(Clone, Debug, Default)]
pub(crate) struct Conditions {
    pub list: Vec<Condition>,
    /// The graph of the guards.
    pub guards: Dag,
    known: HashMap<(Question, NodeId, NodeId), u32>,
    /// The input that time is, and that of the first condition's mode.
    time: u32,
    first: u32,
    /// Inputs that follow from time alone: time, and modes over time.
    timed: BTreeSet<u32>,
}

/// Inputs of the programs that each condition has.
pub(crate) const SLOTS: u32 = 3;

/// What the inputs of a program are called by.
pub(crate) type Inputs<'a> = &'a dyn Fn(&Leaf) -> u32;

/// An expression as a node of a law's graph and as one of the guards' graph.
#[derive(Clone, Copy)]
struct Both {
    law: NodeId,
    guard: NodeId,
    /// Whether it is a truth that may lie between 0 and 1.
    soft: bool,
}

/// A law on its way into the two graphs.
struct Lowering<'a> {
    all: &'a mut Conditions,
    law: &'a mut Dag,
    inputs: Inputs<'a>,
    device: DeviceId,
    /// Whether conditions that are not yet known become modes.
    registers: bool,
}

impl Conditions {
    /// No conditions yet; `time` is the input that time is, `first` the one that the first condition's mode will be.
    pub fn new(time: u32, first: u32) -> Conditions {
        Conditions { time, first, timed: BTreeSet::from([time]), ..Conditions::default() }
    }

    /// Adds a law to a graph, its conditions as modes.
    pub fn add(&mut self, dag: &mut Dag, law: &Law, device: DeviceId, inputs: Inputs) -> NodeId {
        self.lower(dag, law, device, inputs, true)
    }

    /// Adds what is only looked at: conditions that laws have too take their modes, the others stay as they are.
    pub fn add_output(&mut self, dag: &mut Dag, law: &Law, inputs: Inputs) -> NodeId {
        self.lower(dag, law, DeviceId(0), inputs, false)
    }

    /// Adds the control of a switch to the graph of the guards.
    pub fn add_control(&mut self, law: &Law, device: DeviceId, inputs: Inputs) -> NodeId {
        let mut aside = Dag::default();
        let mut lowering = Lowering { all: self, law: &mut aside, inputs, device, registers: true };
        lowering.expression(law).guard
    }

    fn lower(
        &mut self,
        dag: &mut Dag,
        law: &Law,
        device: DeviceId,
        inputs: Inputs,
        registers: bool,
    ) -> NodeId {
        if is_plain(law) {
            return plain(dag, law, inputs);
        }
        Lowering { all: self, law: dag, inputs, device, registers }.expression(law).law
    }

    /// The input that the mode of a condition is; its hold and its slope follow.
    fn slot(&self, condition: u32) -> u32 {
        self.first + SLOTS * condition
    }

    /// Whether two guards follow from time alone.
    fn is_timed(&self, a: NodeId, b: NodeId) -> bool {
        let over_time = |node| self.guards.inputs_of(node).iter().all(|k| self.timed.contains(k));
        over_time(a) && over_time(b)
    }

    /// The value of an operation on a condition, in one of the two graphs. `turned`: its guards stand the other way
    /// round there.
    fn value(
        &self,
        dag: &mut Dag,
        k: u32,
        [a, b]: [NodeId; 2],
        asked: Asked,
        turned: bool,
    ) -> NodeId {
        let condition = &self.list[k as usize];
        let slot = self.slot(k);
        let mode = dag.input(slot);
        let (zero, half, one) = (dag.constant(0.0), dag.constant(0.5), dag.constant(1.0));
        let side = if turned { dag.unary(Unary::Negate, mode) } else { mode };
        let held = match asked {
            Asked::Compare(op) => dag.binary(op, side, zero),
            Asked::Sign => side,
            Asked::Floor => mode,
        };
        if condition.clock.is_some() {
            return held;
        }
        let (hold, slope) = (dag.input(slot + 1), dag.input(slot + 2));
        let crisp = asked.crisp(dag, a, b);
        let difference = match asked {
            Asked::Floor => dag.binary(Binary::Subtract, a, mode),
            _ => dag.binary(Binary::Subtract, a, b),
        };
        let rise = dag.binary(Binary::Multiply, slope, difference);
        let part = {
            let rise = dag.binary(Binary::Multiply, half, rise);
            let rise = dag.binary(Binary::Add, half, rise);
            dag.call(Function::Clamp, &[rise, zero, one])
        };
        let ramp = match asked {
            Asked::Compare(Binary::Less | Binary::LessEqual) => {
                dag.binary(Binary::Subtract, one, part)
            }
            Asked::Compare(_) => crisp,
            Asked::Sign => {
                let minus = dag.constant(-1.0);
                dag.call(Function::Clamp, &[rise, minus, one])
            }
            Asked::Floor => {
                let below = dag.binary(Binary::Subtract, mode, one);
                dag.binary(Binary::Add, below, part)
            }
        };
        let free = dag.binary(Binary::Equal, hold, one);
        let loose = dag.select(free, crisp, ramp);
        dag.select(hold, loose, held)
    }
}

/// An operation whose value jumps.
#[derive(Clone, Copy)]
enum Asked {
    /// `<`, `<=`, `==` or `!=`.
    Compare(Binary),
    Sign,
    Floor,
}

impl Asked {
    /// The operation as it stands.
    fn crisp(self, dag: &mut Dag, a: NodeId, b: NodeId) -> NodeId {
        match self {
            Asked::Compare(op) => dag.binary(op, a, b),
            Asked::Sign => dag.call(Function::Sign, &[a]),
            Asked::Floor => dag.call(Function::Floor, &[a]),
        }
    }

    fn question(self) -> Question {
        match self {
            Asked::Floor => Question::Cell,
            _ => Question::Side,
        }
    }
}

impl Lowering<'_> {
    fn expression(&mut self, law: &Law) -> Both {
        match &*law.node {
            Node::Number(value) => self.number(*value),
            Node::Leaf(leaf) => {
                let k = (self.inputs)(leaf);
                self.both(|dag| dag.input(k))
            }
            Node::Unary(Unary::Not, a) => {
                let a = self.expression(a);
                if !a.soft {
                    return self.each([a, a], |dag, [a, _]| dag.unary(Unary::Not, a));
                }
                let not = self.each([a, a], |dag, [a, _]| {
                    let one = dag.constant(1.0);
                    dag.binary(Binary::Subtract, one, a)
                });
                Both { soft: true, ..not }
            }
            Node::Unary(op, a) => {
                let a = self.expression(a);
                self.each([a, a], |dag, [a, _]| dag.unary(*op, a))
            }
            Node::Binary(op, a, b) => {
                let (a, b) = (self.expression(a), self.expression(b));
                match op {
                    _ if op.is_comparison() => self.comparison(*op, [a, b], law),
                    Binary::And | Binary::Or if a.soft || b.soft => self.joined(*op, [a, b]),
                    _ => self.each([a, b], |dag, [a, b]| dag.binary(*op, a, b)),
                }
            }
            Node::Call(function, arguments) => self.call(*function, arguments, law),
            Node::If(c, a, b) => {
                let c = self.expression(c);
                let (a, b) = (self.expression(a), self.expression(b));
                let law = choice(self.law, c.soft, [c.law, a.law, b.law]);
                let guard = choice(&mut self.all.guards, c.soft, [c.guard, a.guard, b.guard]);
                let guards = &self.all.guards;
                let truth = |part: Both| {
                    part.soft
                        || guards.as_constant(part.guard).is_some_and(|v| v == 0.0 || v == 1.0)
                };
                let soft = (c.soft || a.soft || b.soft) && truth(a) && truth(b);
                Both { law, guard, soft }
            }
            Node::Table(a, table) => {
                let a = self.expression(a);
                self.each([a, a], |dag, [a, _]| dag.table(a, table))
            }
        }
    }

    fn call(&mut self, function: Function, arguments: &[Law], law: &Law) -> Both {
        let lowered: Vec<Both> = arguments.iter().map(|a| self.expression(a)).collect();
        match (function, lowered.as_slice()) {
            (Function::Sign, [a]) => {
                let zero = self.number(0.0);
                let trees = || [arguments[0].clone(), Law::number(0.0)];
                self.condition(Asked::Sign, [*a, zero], &trees, law)
            }
            (Function::Floor, [a]) => {
                let zero = self.number(0.0);
                let trees = || [arguments[0].clone(), Law::number(0.0)];
                self.condition(Asked::Floor, [*a, zero], &trees, law)
            }
            (Function::Mod, [a, b]) => {
                let turns = self.each([*a, *b], |dag, [a, b]| dag.binary(Binary::Divide, a, b));
                let zero = self.number(0.0);
                let quotient = || arguments[0].clone() / arguments[1].clone();
                let trees = || [quotient(), Law::number(0.0)];
                let whole = self.condition(Asked::Floor, [turns, zero], &trees, law);
                let product =
                    self.each([*b, whole], |dag, [b, n]| dag.binary(Binary::Multiply, b, n));
                self.each([*a, product], |dag, [a, product]| {
                    dag.binary(Binary::Subtract, a, product)
                })
            }
            _ => {
                let laws: Vec<NodeId> = lowered.iter().map(|a| a.law).collect();
                let guards: Vec<NodeId> = lowered.iter().map(|a| a.guard).collect();
                let law = self.law.call(function, &laws);
                Both { law, guard: self.all.guards.call(function, &guards), soft: false }
            }
        }
    }

    /// `>` is `<` the other way round.
    fn comparison(&mut self, op: Binary, [a, b]: [Both; 2], law: &Law) -> Both {
        let trees = |turned: bool| match &*law.node {
            Node::Binary(_, b, a) if turned => [a.clone(), b.clone()],
            Node::Binary(_, a, b) => [a.clone(), b.clone()],
            _ => [law.clone(), Law::number(0.0)],
        };
        let (plain, turned) = (|| trees(false), || trees(true));
        match op {
            Binary::Greater => self.condition(Asked::Compare(Binary::Less), [b, a], &turned, law),
            Binary::GreaterEqual => {
                self.condition(Asked::Compare(Binary::LessEqual), [b, a], &turned, law)
            }
            _ => self.condition(Asked::Compare(op), [a, b], &plain, law),
        }
    }

    /// `trees` gives the guards as they stand in the law.
    fn condition(
        &mut self,
        asked: Asked,
        [a, b]: [Both; 2],
        trees: &dyn Fn() -> [Law; 2],
        law: &Law,
    ) -> Both {
        let guards = &self.all.guards;
        let constant =
            guards.as_constant(a.guard).is_some() && guards.as_constant(b.guard).is_some();
        if constant || (a.guard == b.guard && matches!(asked, Asked::Compare(_))) {
            return self.each([a, b], |dag, [a, b]| asked.crisp(dag, a, b));
        }
        let turned = asked.question() == Question::Side && b.guard < a.guard;
        let [first, second] = if turned { [b, a] } else { [a, b] };
        let key = (asked.question(), first.guard, second.guard);
        let k = match self.all.known.get(&key) {
            Some(k) => *k,
            None if self.registers => {
                let [a, b] = trees();
                self.register(key, if turned { [b, a] } else { [a, b] }, law)
            }
            None => return self.each([a, b], |dag, [a, b]| asked.crisp(dag, a, b)),
        };
        // The graph of the guards is taken out while it grows.
        let mut guards = std::mem::take(&mut self.all.guards);
        let guard = self.all.value(&mut guards, k, [a.guard, b.guard], asked, turned);
        self.all.guards = guards;
        let law = self.all.value(self.law, k, [a.law, b.law], asked, turned);
        let truth = matches!(asked, Asked::Compare(_));
        Both { law, guard, soft: truth && self.all.list[k as usize].clock.is_none() }
    }

    fn register(&mut self, key: (Question, NodeId, NodeId), trees: [Law; 2], law: &Law) -> u32 {
        let (question, a, b) = key;
        let all = &mut *self.all;
        let k = all.list.len() as u32;
        let clock = all.is_timed(a, b).then(|| {
            all.timed.insert(all.slot(k));
            Clock::new(question, &mut all.guards, [a, b], trees, all.time)
        });
        all.known.insert(key, k);
        all.list.push(Condition { question, device: self.device, span: law.span, a, b, clock });
        k
    }

    /// `and`, `or` of truths of which one may lie between 0 and 1.
    fn joined(&mut self, op: Binary, [a, b]: [Both; 2]) -> Both {
        let truth = |this: &mut Self, part: Both| match part.soft {
            true => part,
            false => this.each([part, part], |dag, [a, _]| {
                let zero = dag.constant(0.0);
                dag.binary(Binary::NotEqual, a, zero)
            }),
        };
        let (a, b) = (truth(self, a), truth(self, b));
        let function = if op == Binary::And { Function::Min } else { Function::Max };
        let joined = self.each([a, b], |dag, [a, b]| dag.call(function, &[a, b]));
        Both { soft: true, ..joined }
    }

    fn number(&mut self, value: f64) -> Both {
        self.both(|dag| dag.constant(value))
    }

    fn both(&mut self, make: impl Fn(&mut Dag) -> NodeId) -> Both {
        Both { law: make(self.law), guard: make(&mut self.all.guards), soft: false }
    }

    fn each(&mut self, of: [Both; 2], make: impl Fn(&mut Dag, [NodeId; 2]) -> NodeId) -> Both {
        let law = make(self.law, of.map(|part| part.law));
        Both { law, guard: make(&mut self.all.guards, of.map(|part| part.guard)), soft: false }
    }
}

/// `if c then a else b`; between 0 and 1 a soft truth blends them: b + c·(a − b).
fn choice(dag: &mut Dag, soft: bool, [c, a, b]: [NodeId; 3]) -> NodeId {
    if !soft {
        return dag.select(c, a, b);
    }
    let one = dag.constant(1.0);
    let whole = dag.binary(Binary::Equal, c, one);
    let change = dag.binary(Binary::Subtract, a, b);
    let part = dag.binary(Binary::Multiply, c, change);
    let blend = dag.binary(Binary::Add, b, part);
    let otherwise = dag.select(c, blend, b);
    dag.select(whole, a, otherwise)
}

/// Whether nothing in a law jumps.
fn is_plain(law: &Law) -> bool {
    match &*law.node {
        Node::Number(_) | Node::Leaf(_) => true,
        Node::Unary(_, a) | Node::Table(a, _) => is_plain(a),
        Node::Binary(op, a, b) => !op.is_comparison() && is_plain(a) && is_plain(b),
        Node::Call(Function::Sign | Function::Floor | Function::Mod, _) => false,
        Node::Call(_, arguments) => arguments.iter().all(is_plain),
        Node::If(c, a, b) => is_plain(c) && is_plain(a) && is_plain(b),
    }
}

fn plain(dag: &mut Dag, law: &Law, inputs: Inputs) -> NodeId {
    let added: Result<NodeId, std::convert::Infallible> =
        dag.add(law, &mut |dag, leaf, _| Ok(dag.input(inputs(leaf))));
    match added {
        Ok(node) => node,
    }
}
