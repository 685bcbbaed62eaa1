//! Signals: their laws, the hidden ones that functions with memory bring along, and loops.

use super::frames::Here;
use super::functions::{self, Signature};
use super::inference::Source;
use super::scope::{Meaning, Scope, Valued};
use super::value::Place;
use crate::bond::graph::*;
use crate::bond::syntax::{self, Part, parse_drive};
use crate::diagnostic::Diagnostic;
use crate::expr::{Expr as Tree, Node};
use crate::quantity::{did_you_mean, nearest};
use crate::source::Span;

impl Scope<'_> {
    /// Gives every signal and input its law, and puts hidden ones before those that they belong to.
    pub fn make_signals(&mut self, drives: &[String], d: &mut Vec<Diagnostic>) {
        for k in 0..self.signals.len() {
            let Some(Valued { value, statement, here }) = self.signals[k] else { continue };
            let id = SignalId(k as u32);
            if let Some(law) = self.at(here, |scope| scope.signal_law(id, value, statement, d)) {
                self.graph.signals[k].law = law;
            }
        }
        self.drive_inputs(drives, d);
        self.check_outputs(d);
        self.check_units(d);
        self.find_loops(d);
        self.make_regulators(d);
        self.sort_signals();
    }

    /// The law of a signal or input from what stands after `=`.
    fn signal_law(
        &mut self,
        id: SignalId,
        value: &syntax::Expr,
        statement: usize,
        d: &mut Vec<Diagnostic>,
    ) -> Option<SignalLaw> {
        if let Node::Leaf(syntax::Leaf::Call(call)) = &*value.node {
            let row = functions::find(&call.name.text).filter(|row| Signature::changes(row));
            if let Some(row) = row {
                return self.signal_call(id, call, row, value.span, statement, d);
            }
        }
        let owner = self.graph.signals[id.index()].name.clone();
        self.lower(value, Place::free(&owner, statement), d).map(SignalLaw::Algebraic)
    }

    /// A new hidden signal that belongs to `owner`.
    pub fn hide(&mut self, owner: &str, part: &str, span: Span, statement: usize) -> SignalId {
        let id = SignalId(self.graph.signals.len() as u32);
        if self.hidden.is_empty() {
            let signals = self.graph.signals.iter().map(|signal| signal.name.as_str());
            let parameters = self.graph.parameters.iter().map(|parameter| parameter.name.as_str());
            self.hidden = signals.chain(parameters).map(|name| (name.to_string(), 1)).collect();
        }
        let base = format!("{owner}_{part}");
        let mut count = self.hidden.get(&base).copied().unwrap_or(0);
        let mut name = base.clone();
        while count > 0 && self.hidden.contains_key(&name) {
            count += 1;
            name = format!("{base}{count}");
        }
        self.hidden.insert(base, count.max(1));
        self.hidden.insert(name.clone(), 1);
        self.graph.signals.push(Signal {
            name,
            law: SignalLaw::Algebraic(Tree::number(0.0)),
            origin: SignalOrigin::Hidden,
            span,
            unit: None,
            home: self.here.frame.0,
        });
        self.signal_order.push((statement, id.index()));
        id
    }

    fn drive_inputs(&mut self, overrides: &[String], d: &mut Vec<Diagnostic>) {
        let drives = std::mem::take(&mut self.drives);
        let mut driven: Vec<Option<Span>> = vec![None; self.graph.signals.len()];
        for (name, valued) in &drives {
            let here = valued.here;
            let Some(id) = self.at(here, |scope| scope.input(name, d)) else { continue };
            self.units.drives.push((id, Source::Written(valued.value, here)));
            if self.signals.get(id.index()).is_some_and(Option::is_some) {
                // The instance says what this input gets.
                continue;
            }
            if let Some(first) = driven[id.index()].replace(name.span) {
                d.push(
                    Diagnostic::error(
                        "E0220",
                        name.span,
                        format!("`{}` is driven twice", name.text),
                    )
                    .says("driven again here")
                    .label(first, "first driven here"),
                );
                continue;
            }
            let law =
                self.at(here, |scope| scope.signal_law(id, valued.value, valued.statement, d));
            if let Some(law) = law {
                self.graph.signals[id.index()].law = law;
            }
        }
        self.drives = drives;
        for text in overrides {
            let before = d.len();
            if let Some((name, value)) = parse_drive(text, Span::NONE.file, d)
                && let Some(id) = self.input(&name, d)
            {
                driven[id.index()] = Some(Span::NONE);
                let statement = self.signal_order[id.index()].0;
                if let Some(law) = self.signal_law(id, &value, statement, d) {
                    self.graph.signals[id.index()].law = law;
                }
                self.units.drives.push((id, Source::Given(value.into(), Here::ROOT)));
            }
            for error in &mut d[before..] {
                error.notes.push(format!("in the drive that was given: {text}"));
            }
        }
        for (k, signal) in self.graph.signals.iter().enumerate() {
            let given = self.signals.get(k).is_some_and(Option::is_some);
            let open = !given && driven.get(k).is_some_and(Option::is_none);
            if signal.origin == SignalOrigin::Input && open {
                self.graph.experiment.undriven.push(SignalId(k as u32));
            }
        }
        for id in &self.graph.experiment.undriven {
            let signal = &self.graph.signals[id.index()];
            d.push(
                Diagnostic::warning(
                    "W0201",
                    signal.span,
                    format!("nothing drives the input `{}`", signal.name),
                )
                .says("taken as 0")
                .help(format!("say what it gets: `drive {} = …`", signal.name)),
            );
        }
    }

    /// The input of a name.
    fn input(&mut self, name: &Part, d: &mut Vec<Diagnostic>) -> Option<SignalId> {
        let key = self.full_key(name, d)?;
        let text = &*key;
        match self.value(text) {
            Some(Meaning::Signal(id))
                if self.graph.signals[id.index()].origin == SignalOrigin::Input =>
            {
                return Some(id);
            }
            _ if self.excused(&name.text) => {}
            Some(meaning) => {
                let what = match meaning {
                    Meaning::Parameter(_) => "a parameter",
                    Meaning::Signal(_) => "a signal with a law of its own",
                };
                d.push(
                    Diagnostic::error("E0219", name.span, format!("`{text}` is no input"))
                        .says("only inputs are driven")
                        .label(self.value_span(meaning), format!("`{text}` is {what}")),
                );
            }
            None => {
                let error =
                    Diagnostic::error("E0219", name.span, format!("no input is called `{text}`"))
                        .says("not declared anywhere");
                let inputs = self.signals_here(|origin| origin == SignalOrigin::Input);
                d.push(match nearest(text, inputs) {
                    Some(meant) => did_you_mean(error, name.span, text, meant),
                    None => error.help(format!("declare it: `input {text}`")),
                });
            }
        }
        None
    }

    /// The signals that can be named here, in one order.
    fn signals_here(&self, of: impl Fn(SignalOrigin) -> bool) -> Vec<&str> {
        let values = self.frame().values.iter();
        let mut names: Vec<&str> = values
            .filter_map(|(name, meaning)| match meaning {
                Meaning::Signal(id) if of(self.graph.signals[id.index()].origin) => {
                    Some(name.as_ref())
                }
                _ => None,
            })
            .collect();
        names.sort_unstable();
        names
    }

    fn check_outputs(&mut self, d: &mut Vec<Diagnostic>) {
        let outputs = std::mem::take(&mut self.outputs);
        for (name, here) in &outputs {
            self.at(*here, |scope| scope.check_output(name, d));
        }
        self.outputs = outputs;
    }

    fn check_output(&mut self, name: &Part, d: &mut Vec<Diagnostic>) {
        let Some(key) = self.full_key(name, d) else { return };
        let text = &*key;
        if self.excused(&name.text) {
            return;
        }
        match self.value(text) {
            Some(Meaning::Signal(_)) => {}
            Some(meaning) => d.push(
                Diagnostic::error("E0224", name.span, format!("`{text}` is no signal"))
                    .says("outputs are signals")
                    .label(self.value_span(meaning), "a parameter"),
            ),
            None => {
                let error =
                    Diagnostic::error("E0224", name.span, format!("no signal is called `{text}`"))
                        .says("not declared anywhere");
                if self.searched(name.span) {
                    return d.push(error);
                }
                d.push(match nearest(text, self.signals_here(|_| true)) {
                    Some(meant) => did_you_mean(error, name.span, text, meant),
                    None => error.help(format!("declare it: `signal {text} = …`")),
                });
            }
        }
    }

    /// Loops of signals that no bond and no memory breaks.
    fn find_loops(&self, d: &mut Vec<Diagnostic>) {
        let uses: Vec<Vec<usize>> = self
            .graph
            .signals
            .iter()
            .map(|signal| {
                let mut uses = vec![];
                if let SignalLaw::Algebraic(expr) = &signal.law {
                    expr.leaves(&mut |leaf, _| {
                        if let Leaf::Signal(id) = leaf {
                            uses.push(id.index());
                        }
                    });
                }
                uses
            })
            .collect();
        // 0: not seen, 1: on the path, 2: done.
        let mut marks = vec![0u8; uses.len()];
        for first in 0..uses.len() {
            let mut path: Vec<(usize, usize)> = vec![(first, 0)];
            while let Some((k, next)) = path.last_mut() {
                let k = *k;
                if *next == 0 && marks[k] == 2 {
                    path.pop();
                    continue;
                }
                marks[k] = 1;
                let Some(&used) = uses[k].get(*next) else {
                    marks[k] = 2;
                    path.pop();
                    continue;
                };
                *next += 1;
                match marks[used] {
                    0 => path.push((used, 0)),
                    1 => {
                        let start = path.iter().position(|(on, _)| *on == used).unwrap_or(0);
                        d.push(self.signal_loop(path[start..].iter().map(|(k, _)| *k).collect()));
                    }
                    _ => {}
                }
            }
        }
    }

    fn signal_loop(&self, ring: Vec<usize>) -> Diagnostic {
        let name = |k: &usize| format!("`{}`", self.graph.signals[*k].name);
        let first = &self.graph.signals[ring[0]];
        let message = format!("the signal {} depends on itself at every instant", name(&ring[0]));
        let mut error = Diagnostic::error("E0408", first.span, message).says("this signal");
        for k in &ring[1..] {
            error = error.label(self.graph.signals[*k].span, "through this one");
        }
        if ring.len() > 1 {
            let names: Vec<String> = ring.iter().chain([&ring[0]]).map(name).collect();
            error = error.because(format!("the loop is {}", names.join(" → ")));
        }
        error.help("a loop of signals needs a memory in it: `lag(x, tau)` or `integ(x)`")
    }

    /// File order, hidden signals before the one that they belong to.
    fn sort_signals(&mut self) {
        let mut order: Vec<usize> = (0..self.graph.signals.len()).collect();
        order.sort_by_key(|k| self.signal_order[*k]);
        let mut place = vec![SignalId(0); order.len()];
        for (new, old) in order.iter().enumerate() {
            place[*old] = SignalId(new as u32);
        }
        let graph = &mut self.graph;
        let mut signals: Vec<Option<Signal>> =
            std::mem::take(&mut graph.signals).into_iter().map(Some).collect();
        graph.signals = order.iter().filter_map(|old| signals[*old].take()).collect();
        let dimensions = order.iter().map(|old| self.signal_dimensions[*old]).collect();
        self.signal_dimensions = dimensions;
        self.signal_order.sort_unstable();
        self.units.renumber(&place);
        for frame in &mut self.frames {
            for meaning in frame.values.values_mut() {
                if let Meaning::Signal(id) = meaning {
                    *id = place[id.index()];
                }
            }
        }
        for id in &mut graph.experiment.undriven {
            *id = place[id.index()];
        }
        let mut renumber = |expr: &mut Expr| {
            *expr = expr.map(&mut |leaf, span| {
                let leaf = match leaf {
                    Leaf::Signal(id) => Leaf::Signal(place[id.index()]),
                    other => other.clone(),
                };
                Tree::new(Node::Leaf(leaf), span)
            });
        };
        for regulator in &mut graph.regulators {
            regulator.signal = place[regulator.signal.index()];
            renumber(&mut regulator.controlled);
            renumber(&mut regulator.reference);
            regulator.gains.iter_mut().flatten().for_each(&mut renumber);
        }
        for signal in &mut graph.signals {
            match &mut signal.law {
                SignalLaw::Algebraic(expr) => renumber(expr),
                SignalLaw::Integrator { rate, .. } => renumber(rate),
                SignalLaw::Memory { input, .. } => renumber(input),
                SignalLaw::Waveform(_) => {}
            }
        }
        graph.vertices.iter_mut().for_each(|vertex| vertex.law.expressions_mut(&mut renumber));
    }
}
