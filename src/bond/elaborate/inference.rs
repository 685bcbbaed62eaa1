//! What is known of units, found from what depends on what: parameters, signals, domains of bonds.
//!
//! Everything is looked at once, in the order of the file. What turns out unknown waits for the unknowns that it met,
//! and is looked at again when one of them is found; so no order of statements matters, no chain is too long, and the
//! work grows with what there is. Elements that know their units tell the domain of their group of bonds (`domains`);
//! what is known on one side of a two-port tells the other side by its ratio. Only when nothing follows any more, what
//! two domains share is taken for the likelier one: kelvins alone are thermal, beside watts pseudo-thermal; and where
//! as many elements speak for one domain as for another, the first of them in the text is believed.

use super::dimensions::{Dim, Open, Walk};
use super::domains::{By, Groups, Told, across, domain_of, winner};
use super::frames::{FrameId, Here};
use super::scope::{Meaning, Scope};
use super::stated::{Mask, Stated, bit, modulus, stated};
use crate::bond::graph::*;
use crate::bond::syntax;
use crate::quantity::Domain;
use crate::source::Span;
use std::cell::OnceCell;
use std::collections::{HashSet, VecDeque};
use std::rc::Rc;

/// What is looked at.
#[derive(Clone, Copy)]
enum Task {
    Parameter(u32),
    Signal(u32),
    Element(VertexId),
}

/// The value of a signal, or what drives it.
#[derive(Clone)]
pub(super) enum Source<'a> {
    /// In the text.
    Written(&'a syntax::Expr, Here),
    /// On the command line.
    Given(Rc<syntax::Expr>, Here),
}

impl Source<'_> {
    pub fn expr(&self) -> &syntax::Expr {
        match self {
            Source::Written(expr, _) => expr,
            Source::Given(expr, _) => expr,
        }
    }

    pub fn here(&self) -> Here {
        match self {
            Source::Written(_, here) | Source::Given(_, here) => *here,
        }
    }
}

/// What is known of units, beside the dimensions of parameters and signals.
#[derive(Default)]
pub(super) struct Units<'a> {
    /// By model, whether it says any unit.
    pub by_body: OnceCell<Vec<bool>>,
    /// Groups of bonds, and their domains.
    pub groups: Groups,
    /// What drives inputs, in the order in which it is said.
    pub drives: Vec<(SignalId, Source<'a>)>,
    /// By signal, where it is said what it is, or what drives it.
    pub said: Vec<Span>,
    /// Parameters and signals that errors spoke of.
    pub blamed: HashSet<Meaning>,
    /// How often a way between elements was looked for.
    pub ways: usize,
}

impl Units<'_> {
    /// Takes new indices of signals.
    pub fn renumber(&mut self, place: &[SignalId]) {
        let new = |id: SignalId| place.get(id.index()).copied().unwrap_or(id);
        let mut said = vec![Span::NONE; self.said.len()];
        for (old, span) in self.said.iter().enumerate() {
            if let Some(slot) = said.get_mut(new(SignalId(old as u32)).index()) {
                *slot = *span;
            }
        }
        self.said = said;
        let meaning = |meaning| match meaning {
            Meaning::Signal(id) => Meaning::Signal(new(id)),
            other => other,
        };
        self.blamed = self.blamed.drain().map(meaning).collect();
        self.drives.iter_mut().for_each(|(id, _)| *id = new(*id));
    }
}

/// Many short lists in one place.
struct Lists<T> {
    heads: Vec<u32>,
    entries: Vec<(T, u32)>,
}

impl<T: Copy> Lists<T> {
    fn new(count: usize) -> Lists<T> {
        Lists { heads: vec![u32::MAX; count], entries: vec![] }
    }

    fn push(&mut self, list: usize, entry: T) {
        self.entries.push((entry, self.heads[list]));
        self.heads[list] = self.entries.len() as u32 - 1;
    }

    fn get(&self, list: usize) -> impl Iterator<Item = T> {
        let next = |at: u32| self.entries.get(at as usize);
        std::iter::successors(next(self.heads[list]), move |entry| next(entry.1)).map(|e| e.0)
    }

    /// The entries of a list, which is empty afterwards.
    fn take(&mut self, list: usize) -> Vec<T> {
        let found = self.get(list).collect();
        self.heads[list] = u32::MAX;
        found
    }
}

struct Inference<'i, 'a> {
    scope: &'i mut Scope<'a>,
    sources: Vec<Option<Source<'a>>>,
    /// By parameter: what a bare number is taken for.
    defaults: Vec<Option<(&'a syntax::Expr, Here)>>,
    queue: VecDeque<Task>,
    /// By task, whether it is in the queue.
    queued: Vec<bool>,
    /// By parameter, signal and group: who waits for it.
    waiting: Lists<Task>,
    /// By group: what elements say.
    votes: Lists<(VertexId, Mask)>,
    /// By vertex, whether it has said what it knows.
    voted: Vec<bool>,
    /// Elements of which a part is known that several domains share.
    half_known: Vec<VertexId>,
    /// Groups of which something new was said.
    fresh: Vec<u32>,
    /// Groups that wait for a two-port or a guess.
    doubtful: VecDeque<u32>,
    /// By group: the domains that what elements say has left.
    left: Vec<Mask>,
    /// By group: the two-ports at it.
    touching: Lists<VertexId>,
    two_ports: VecDeque<VertexId>,
    buffer: Vec<Stated<'a>>,
}

impl<'a> Scope<'a> {
    /// Finds the dimensions of parameters and signals and the domains of bonds.
    pub fn infer_units(&mut self) {
        self.parameter_dimensions = vec![Dim::Unknown; self.graph.parameters.len()];
        self.signal_dimensions = vec![Dim::Unknown; self.graph.signals.len()];
        let declarations = &self.declarations;
        let is_junction = |id: VertexId| declarations[id.index()].element.shape.is_junction();
        self.units.groups = Groups::new(&self.graph, is_junction);
        let (parameters, signals) = (self.graph.parameters.len(), self.graph.signals.len());
        let (vertices, groups) = (self.graph.vertices.len(), self.units.groups.told.len());
        let tasks = parameters + signals + vertices;
        let (sources, defaults) = (self.sources(), self.defaults());
        let mut inference = Inference {
            scope: self,
            sources,
            defaults,
            queue: VecDeque::with_capacity(tasks),
            queued: vec![true; tasks],
            waiting: Lists::new(parameters + signals + groups),
            votes: Lists::new(groups),
            voted: vec![false; vertices],
            half_known: vec![],
            fresh: vec![],
            doubtful: VecDeque::new(),
            left: vec![Mask::MAX; groups],
            touching: Lists::new(groups),
            two_ports: VecDeque::new(),
            buffer: vec![],
        };
        inference.queue.extend((0..parameters as u32).map(Task::Parameter));
        inference.queue.extend((0..signals as u32).map(Task::Signal));
        inference.queue.extend((0..vertices as u32).map(|k| Task::Element(VertexId(k))));
        inference.run();
        self.here = Here::ROOT;
    }

    /// By signal, its value or what drives it.
    pub(super) fn sources(&mut self) -> Vec<Option<Source<'a>>> {
        let mut sources: Vec<Option<Source<'a>>> = vec![None; self.graph.signals.len()];
        for (slot, valued) in sources.iter_mut().zip(&self.signals) {
            *slot = valued.as_ref().map(|valued| Source::Written(valued.value, valued.here));
        }
        for (id, source) in &self.units.drives {
            if let Some(slot @ None) = sources.get_mut(id.index()) {
                *slot = Some(source.clone());
            }
        }
        let span = |source: &Option<Source<'_>>| {
            source.as_ref().map_or(Span::NONE, |source| source.expr().span)
        };
        self.units.said = sources.iter().map(span).collect();
        sources
    }

    /// By parameter that an instance was given: its default, and where that stands.
    pub(super) fn defaults(&self) -> Vec<Option<(&'a syntax::Expr, Here)>> {
        let mut defaults = vec![None; self.parameters.len()];
        for (k, frame) in self.frames.iter().enumerate().skip(1) {
            if frame.arguments.is_empty() {
                continue;
            }
            let here = Here { frame: FrameId(k as u32), round: None };
            for parameter in self.bodies[frame.body].header.unwrap_or(&[]) {
                let Some(default) = &parameter.default else { continue };
                let Some(Meaning::Parameter(id)) = frame.values.get(parameter.name.text.as_str())
                else {
                    continue;
                };
                let given = self.parameters[id.index()].map(|valued| valued.here.frame);
                if given.is_some_and(|frame| frame != here.frame) {
                    defaults[id.index()] = Some((default, here));
                }
            }
        }
        defaults
    }

    /// The value of a parameter as the text gives it, whatever the command line sets.
    pub(super) fn parameter_value(&self, k: usize) -> Option<(&'a syntax::Expr, Here)> {
        let valued = match self.set.iter().find(|s| s.taken == Some(ParameterId(k as u32))) {
            Some(setting) => setting.declared,
            None => self.parameters[k],
        };
        valued.map(|valued| (valued.value, valued.here))
    }
}

impl Inference<'_, '_> {
    fn run(&mut self) {
        self.take_given_domains();
        for id in self.scope.graph.vertex_ids() {
            if !self.scope.declarations[id.index()].element.shape.is_two_port() {
                continue;
            }
            for bond in self.scope.graph.vertex(id).bonds.clone() {
                self.touching.push(self.scope.units.groups.group(bond) as usize, id);
            }
        }
        loop {
            while let Some(task) = self.queue.pop_front() {
                let index = self.index(task);
                self.queued[index] = false;
                self.look_at(task);
            }
            if self.settle_groups() {
                continue;
            }
            if let Some(id) = self.two_ports.pop_front() {
                self.cross(id);
                continue;
            }
            for id in std::mem::take(&mut self.half_known) {
                self.ask(id, true);
            }
            if !self.settle_groups() && !self.guess() {
                return;
            }
        }
    }

    fn index(&self, task: Task) -> usize {
        let (parameters, signals) =
            (self.scope.graph.parameters.len(), self.scope.graph.signals.len());
        match task {
            Task::Parameter(k) => k as usize,
            Task::Signal(k) => parameters + k as usize,
            Task::Element(id) => parameters + signals + id.index(),
        }
    }

    /// The list of those who wait for something.
    fn list(&self, open: Open) -> usize {
        let (parameters, signals) =
            (self.scope.graph.parameters.len(), self.scope.graph.signals.len());
        match open {
            Open::Parameter(id) => id.index(),
            Open::Signal(id) => parameters + id.index(),
            Open::Bond(bond) => parameters + signals + self.scope.units.groups.group(bond) as usize,
        }
    }

    fn wait(&mut self, task: Task, mut open: Vec<Open>) {
        open.dedup();
        for open in open {
            let list = self.list(open);
            self.waiting.push(list, task);
        }
    }

    fn wake(&mut self, list: usize) {
        let mut tasks = self.waiting.take(list);
        tasks.reverse();
        for task in tasks {
            let index = self.index(task);
            if !std::mem::replace(&mut self.queued[index], true) {
                self.queue.push_back(task);
            }
        }
    }

    fn look_at(&mut self, task: Task) {
        match task {
            Task::Parameter(k) => {
                let Some((value, here)) = self.scope.parameter_value(k as usize) else { return };
                let mut found = self.dimension(task, value, here);
                if let Some((value, here)) = self.defaults[k as usize] {
                    self.scope.here = here;
                    let default = self.scope.dimension(value, None);
                    found = match found {
                        // A bare number that an instance is given is in the unit of the model's default.
                        Some(Dim::Bare) => self.dimension(task, value, here),
                        // A wrong unit is said where it is given, and nowhere else.
                        Some(Dim::Known(given)) if default.known().is_some_and(|d| d != given) => {
                            None
                        }
                        other => other,
                    };
                }
                if let Some(dim @ Dim::Known(_)) = found {
                    self.scope.parameter_dimensions[k as usize] = dim;
                    self.wake(self.list(Open::Parameter(ParameterId(k))));
                }
            }
            Task::Signal(k) => {
                let Some(source) = self.sources[k as usize].clone() else { return };
                let found = self.dimension(task, source.expr(), source.here());
                if let Some(dim @ Dim::Known(_)) = found {
                    self.scope.signal_dimensions[k as usize] = dim;
                    self.wake(self.list(Open::Signal(SignalId(k))));
                }
            }
            Task::Element(id) => {
                let shape = self.scope.declarations[id.index()].element.shape;
                if shape.is_two_port() {
                    self.two_ports.push_back(id);
                } else if !shape.is_junction() {
                    self.ask(id, false);
                }
            }
        }
    }

    /// The dimension of a value, `Bare` where nothing can be known of it; `None` where the task waits for more.
    fn dimension(&mut self, task: Task, value: &syntax::Expr, here: Here) -> Option<Dim> {
        self.scope.here = here;
        let mut walk = Walk::new(self.scope, None);
        walk.open = Some(vec![]);
        let dim = walk.dimension(value).whole();
        let open = walk.open.take().unwrap_or_default();
        match dim {
            Dim::Known(_) => Some(dim),
            _ if open.is_empty() => Some(Dim::Bare),
            _ => {
                self.wait(task, open);
                None
            }
        }
    }

    /// Asks an element for the domains of its bonds. What is only half known, a pressure that may yet turn out
    /// pneumatic, is said when nothing more comes: `last`.
    fn ask(&mut self, id: VertexId, last: bool) {
        let bonds = self.scope.graph.vertex(id).bonds.len();
        let known = |inference: &Self, port: usize| {
            let bond = inference.scope.graph.vertex(id).bonds.get(port);
            bond.is_none_or(|bond| inference.scope.graph.bond(*bond).domain != Domain::Any)
        };
        if self.voted[id.index()] || (0..bonds).all(|port| known(self, port)) {
            return;
        }
        let declaration = self.scope.declarations[id.index()];
        let mut found = std::mem::take(&mut self.buffer);
        stated(&declaration, &mut found);
        self.scope.here = declaration.here;
        let mut open = vec![];
        let mut said: Vec<(usize, Mask)> = vec![];
        for stated in found.iter().filter(|stated| stated.ports.0 == stated.ports.1) {
            let mut walk = Walk::new(self.scope, Some(id));
            walk.open = Some(vec![]);
            let mut dim = stated.value.dimension(&mut walk);
            open.append(&mut walk.open.take().unwrap_or_default());
            if stated.rate {
                dim = dim.times(Dim::Known(super::dimensions::SECOND));
            }
            let Dim::Known(dimension) = dim else { continue };
            let mask = stated.clue.fitting(dimension);
            let port = stated.ports.0;
            match said.iter_mut().find(|(known, _)| *known == port) {
                Some((_, all)) if *all & mask != 0 => *all &= mask,
                Some(_) => {}
                None if mask != 0 => said.push((port, mask)),
                None => {}
            }
        }
        self.buffer = found;
        let complete = open.is_empty() || said.iter().any(|(_, mask)| mask.is_power_of_two());
        if !complete && !last {
            self.wait(Task::Element(id), open);
            if !said.is_empty() {
                self.half_known.push(id);
            }
            return;
        }
        self.voted[id.index()] = !said.is_empty();
        for (port, mask) in said {
            let Some(bond) = self.scope.graph.vertex(id).bonds.get(port).copied() else { continue };
            let group = self.scope.units.groups.group(bond);
            if self.scope.units.groups.told[group as usize].is_none() {
                self.votes.push(group as usize, (id, mask));
                self.fresh.push(group);
            }
        }
    }

    /// Settles the groups of which something new was said. Whether any was.
    fn settle_groups(&mut self) -> bool {
        let mut groups = std::mem::take(&mut self.fresh);
        groups.sort_unstable();
        groups.dedup();
        let mut any = false;
        for group in groups {
            any |= self.settle_by_votes(group, false);
        }
        any
    }

    /// Guesses for one doubtful group: what it tells may decide the others. Whether there was one.
    fn guess(&mut self) -> bool {
        while let Some(group) = self.doubtful.pop_front() {
            if self.settle_by_votes(group, true) {
                return true;
            }
        }
        false
    }

    /// Settles a group by what elements say of it. Whether it could.
    fn settle_by_votes(&mut self, group: u32, guess: bool) -> bool {
        if self.scope.units.groups.told[group as usize].is_some() {
            return false;
        }
        let votes: Vec<(VertexId, Mask)> = self.votes.get(group as usize).collect();
        match winner(&votes, guess) {
            Ok((domain, by)) => {
                self.settle(group, Told { domain, by: By::Element(by) });
                true
            }
            Err(left) => {
                self.left[group as usize] = left;
                if !guess {
                    self.doubtful.push_back(group);
                }
                false
            }
        }
    }

    fn settle(&mut self, group: u32, told: Told) {
        self.scope.units.groups.told[group as usize] = Some(told);
        for bond in self.scope.units.groups.bonds(group) {
            self.scope.graph.bonds[bond.index()].domain = told.domain;
        }
        let at = self.scope.graph.parameters.len() + self.scope.graph.signals.len();
        self.wake(at + group as usize);
        let mut touching: Vec<VertexId> = self.touching.get(group as usize).collect();
        touching.reverse();
        self.two_ports.extend(touching);
    }

    /// Domains that ports of models give count before what elements say.
    fn take_given_domains(&mut self) {
        for port in 0..self.scope.ports.len() {
            let port = &self.scope.ports[port];
            let (Some((domain, span)), Some(bond)) = (port.domain, port.bond) else { continue };
            let group = self.scope.units.groups.group(bond);
            if self.scope.units.groups.told[group as usize].is_none() && domain != Domain::Any {
                self.settle(group, Told { domain, by: By::Port(span) });
            }
        }
    }

    /// Carries what is known on one side of a two-port to the other.
    fn cross(&mut self, id: VertexId) {
        let &[one, two] = self.scope.graph.vertex(id).bonds.as_slice() else { return };
        let (one, two) = (self.scope.units.groups.group(one), self.scope.units.groups.group(two));
        let told = |group: u32| self.scope.units.groups.told[group as usize];
        let (told, first, from, to) = match (told(one), told(two)) {
            (Some(told), None) => (told, true, one, two),
            (None, Some(told)) => (told, false, two, one),
            _ => return,
        };
        let declaration = self.scope.declarations[id.index()];
        let Some((value, gain)) = modulus(&declaration) else { return };
        self.scope.here = declaration.here;
        let mut walk = Walk::new(self.scope, None);
        walk.open = Some(vec![]);
        let dim = value.dimension(&mut walk);
        let open = walk.open.take().unwrap_or_default();
        let Dim::Known(ratio) = dim else { return self.wait(Task::Element(id), open) };
        let shape = declaration.element.shape;
        let Some(domain) = across(shape, told.domain, first, ratio, gain).and_then(domain_of)
        else {
            return;
        };
        // What is wrong is said where two-ports are checked.
        if domain.row().pseudo == told.domain.row().pseudo
            && self.left[to as usize] & bit(domain) != 0
        {
            // An element that says the same stands nearer.
            let says = self.votes.get(to as usize).filter(|(_, mask)| *mask == bit(domain));
            let by = says.map(|(id, _)| id).min().map_or(By::Across(id, from), By::Element);
            self.settle(to, Told { domain, by });
        }
    }
}
