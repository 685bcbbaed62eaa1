//! Bonds: which ports they join, and whether every port has what it needs.

use super::expand::list;
use super::fields;
use super::frames::{Found, FrameId, Here, PortId, Thing};
use super::scope::{Scope, a};
use crate::bond::graph::*;
use crate::bond::syntax::{self, Arrow, Chain, ChainEnd, Part};
use crate::diagnostic::Diagnostic;
use crate::quantity::{DOMAINS, Domain, did_you_mean, nearest};
use crate::source::Span;
use std::collections::{HashMap, HashSet};

/// One end of an arrow, before ports are given out.
#[derive(Clone, Copy)]
struct Joint {
    vertex: VertexId,
    /// The port as named, from 0.
    named: Option<u32>,
    /// Where the name stands.
    span: Span,
}

/// An end of an arrow as drawn.
#[derive(Clone, Copy)]
enum Tip {
    Vertex(Joint),
    Port(PortId),
}

impl Tip {
    fn thing(self) -> Thing {
        match self {
            Tip::Vertex(joint) => Thing::Vertex(joint.vertex),
            Tip::Port(port) => Thing::Port(port),
        }
    }
}

/// An arrow as drawn: a bond, or a part of one on one side of a port.
pub(super) struct Half {
    from: Tip,
    to: Tip,
    stroke: Option<Stroke>,
    span: Span,
    /// The bond that it became a part of.
    bond: Option<BondId>,
}

/// A port of an instance.
pub(super) struct ModelPort {
    /// Whether its half arrow points into the model.
    pub into: bool,
    pub name: String,
    pub domain: Option<(Domain, Span)>,
    pub span: Span,
    /// Whose port it is.
    pub frame: FrameId,
    /// The arrows at its two sides.
    inner: Option<usize>,
    outer: Option<usize>,
    /// Whether an arrow at it could not be read.
    excused: bool,
    /// Its bond.
    pub bond: Option<BondId>,
}

/// What joins a vertex: the bond, whether at its head, and the joint.
type Joined = (BondId, bool, Joint);

impl<'a> Scope<'a> {
    /// Takes in a port of the frame.
    pub fn declare_port(&mut self, port: &'a syntax::Port, span: Span, d: &mut Vec<Diagnostic>) {
        let Some(key) = self.full_key(&port.name, d) else {
            self.frame_mut().excused.insert(&port.name.text);
            return;
        };
        if let Some(first) = self.frame().things.get(&key).copied() {
            let first = self.thing_span(first);
            d.push(
                Diagnostic::error("E0203", span, format!("`{key}` is declared twice"))
                    .says("declared again here")
                    .label(first, "first declared here"),
            );
            return;
        }
        let mut domain = None;
        if let Some(name) = &port.domain {
            match Domain::named(&name.text) {
                Some(known) => domain = Some((known, name.span)),
                None => {
                    let error = Diagnostic::error(
                        "E0240",
                        name.span,
                        format!("`{}` is no domain", name.text),
                    )
                    .says("unknown domain");
                    let names = DOMAINS.iter().map(|row| row.name);
                    d.push(match nearest(&name.text, names.clone()) {
                        Some(meant) => did_you_mean(error, name.span, &name.text, meant),
                        None => error.because(format!(
                            "the domains are {}",
                            list(&names.collect::<Vec<_>>())
                        )),
                    });
                }
            }
        }
        let id = PortId(self.ports.len() as u32);
        let name = format!("{}{key}", self.frame().prefix);
        self.frame_mut().things.insert(key, Thing::Port(id));
        self.frame_mut().ports.push(id);
        self.ports.push(ModelPort {
            into: port.into,
            name,
            domain,
            span,
            frame: self.here.frame,
            inner: None,
            outer: None,
            excused: false,
            bond: None,
        });
    }

    /// Makes a bond of every arrow, gives out ports, and checks their numbers.
    pub fn join_bonds(&mut self, d: &mut Vec<Diagnostic>) {
        let mut incomplete: HashSet<VertexId> = HashSet::new();
        let chains = std::mem::take(&mut self.chains);
        for (chain, here) in &chains {
            self.at(*here, |scope| scope.draw(chain, &mut incomplete, d));
        }
        self.chains = chains;
        let joined = self.make_bonds(d);
        self.check_ports(d);
        // A statement that could not be read may hold the bonds that seem to be missing.
        for id in self.graph.vertex_ids().collect::<Vec<_>>() {
            let declaration = self.declarations[id.index()];
            let frame = &self.frames[declaration.here.frame.0 as usize];
            let excused = frame.excused.contains(declaration.name.text.as_str());
            let whole = !incomplete.contains(&id) && !excused;
            self.give_ports(id, &joined[id.index()], whole, d);
        }
        self.check_sources(d);
    }

    /// The arrows of a chain.
    fn draw(
        &mut self,
        chain: &'a Chain,
        incomplete: &mut HashSet<VertexId>,
        d: &mut Vec<Diagnostic>,
    ) {
        let mut last: Option<&ChainEnd> = chain.first.last();
        // What an end means is found out once, though it stands behind one arrow and before the next.
        let mut found = last.and_then(|end| self.tip_of(end, d));
        for (arrow, ends) in &chain.links {
            let before = last.zip(found);
            let from = before.and_then(|(end, found)| self.tip(end, &found, false, d));
            for end in ends {
                last = Some(end);
                found = self.tip_of(end, d);
                let to = found.and_then(|found| self.tip(end, &found, true, d));
                if let (Some((first, _)), Some(from), Some(to)) = (before, from, to)
                    && self.add_half((first, from), (end, to), arrow, d)
                {
                    continue;
                }
                if found.is_none() {
                    // Whatever it means, its bond is not missing.
                    self.frame_mut().excused.insert(&end.path.name.text);
                }
                // The wrong end has been reported: do not count the bonds of either.
                for found in [before.map(|(_, found)| found), found].into_iter().flatten() {
                    match found.thing {
                        Thing::Vertex(id) => {
                            incomplete.insert(id);
                        }
                        Thing::Port(port) => self.ports[port.0 as usize].excused = true,
                        Thing::Instance(frame) => {
                            for at in 0..self.frames[frame.0 as usize].ports.len() {
                                let port = self.frames[frame.0 as usize].ports[at];
                                self.ports[port.0 as usize].excused = true;
                            }
                        }
                    }
                }
            }
        }
    }

    /// What an end of an arrow means.
    fn tip_of<'p>(&mut self, end: &'p ChainEnd, d: &mut Vec<Diagnostic>) -> Option<Found<'p>> {
        let found = self.resolve(&end.path, d)?;
        if found.within
            && let Thing::Vertex(id) = found.thing
        {
            let span = end.path.span;
            let declared = self.declarations[id.index()].span;
            d.push(
                Diagnostic::error(
                    "E0413",
                    span,
                    format!("`{}` is inside its model, where no bond from outside leads", self.shown(id)),
                )
                .says("not a port")
                .label(declared, "declared here")
                .help("join a port of the instance; the model declares it with `port in …` or `port out …`"),
            );
            return None;
        }
        Some(found)
    }

    /// The end of an arrow; `head`: the arrow points to it.
    fn tip(
        &mut self,
        end: &ChainEnd,
        found: &Found<'_>,
        head: bool,
        d: &mut Vec<Diagnostic>,
    ) -> Option<Tip> {
        let span = end.path.span;
        let port = match found.thing {
            Thing::Vertex(vertex) => {
                let named = self.port(vertex, found.rest, d)?;
                return Some(Tip::Vertex(Joint { vertex, named, span }));
            }
            Thing::Port(port) => port,
            Thing::Instance(frame) => self.only_port(frame, end, head, d)?,
        };
        if let Some(member) = found.rest.first() {
            d.push(
                Diagnostic::error("E0410", member.span, "a port has no parts").says("no such part"),
            );
            return None;
        }
        // From inside, the roles of the two ends are exchanged.
        let inside = self.ports[port.0 as usize].frame == self.here.frame;
        let into = self.ports[port.0 as usize].into;
        if (head != inside) != into {
            let port = &self.ports[port.0 as usize];
            let (way, draw) = match (inside, into) {
                (false, true) => ("points into the model", "`… -> {}`"),
                (false, false) => ("points out of the model", "`{} -> …`"),
                (true, true) => ("points into the model", "`{} -> …`"),
                (true, false) => ("points out of the model", "`… -> {}`"),
            };
            let draw = draw.replace("{}", self.map.text(span));
            d.push(
                Diagnostic::error(
                    "E0414",
                    span,
                    format!("the half arrow of the port `{}` {way}", port.name),
                )
                .says("here it points the other way")
                .label(port.span, "the port")
                .help(format!("draw it {draw}")),
            );
            return None;
        }
        Some(Tip::Port(port))
    }

    /// The port that an instance's name alone means at an end of an arrow.
    fn only_port(
        &self,
        frame: FrameId,
        end: &ChainEnd,
        head: bool,
        d: &mut Vec<Diagnostic>,
    ) -> Option<PortId> {
        let inner = &self.frames[frame.0 as usize];
        let name = inner.prefix.trim_end_matches('.');
        let fits: Vec<PortId> =
            inner.ports.iter().filter(|p| self.ports[p.0 as usize].into == head).copied().collect();
        if let [only] = fits.as_slice() {
            return Some(*only);
        }
        let body = &self.bodies[inner.body];
        if inner.excused.contains("port") {
            return None;
        }
        let way = if head { "in" } else { "out" };
        let listed: Vec<String> = inner
            .ports
            .iter()
            .map(|port| {
                let port = &self.ports[port.0 as usize];
                let way = if port.into { "in" } else { "out" };
                format!("`{}` ({way})", port.name)
            })
            .collect();
        let error = Diagnostic::error(
            "E0412",
            end.path.span,
            match fits.len() {
                0 => format!("`{name}` has no `{way}` port for this arrow"),
                n => format!("`{name}` has {n} `{way}` ports, which one?"),
            },
        )
        .says(format!("an instance of `{}`", body.name))
        .label(body.span, "the model");
        d.push(match listed.is_empty() {
            true => error.help(
                "a model that bonds join has ports, declared by `port in …` and `port out …`",
            ),
            false => error.help(format!("name the port: {}", listed.join(", "))),
        });
        None
    }

    /// Takes in an arrow; an error has been reported where it cannot be.
    fn add_half(
        &mut self,
        from: (&ChainEnd, Tip),
        to: (&ChainEnd, Tip),
        arrow: &Arrow,
        d: &mut Vec<Diagnostic>,
    ) -> bool {
        // Of several ends in a list each has its own place: only the first stands right behind the arrow.
        let whole = to.0.span;
        let behind = self.map.text(Span { start: arrow.span.end, end: whole.start, ..whole });
        let span = if behind.contains(',') { whole } else { from.0.span.join(whole) };
        // Both ends are looked at before either is joined: a half that is left out joins nothing.
        for (end, tip) in [from, to] {
            let Some(first) = self.slot(tip).and_then(|slot| *slot) else { continue };
            let first = self.halves[first].span;
            let Tip::Port(id) = tip else { continue };
            let port = &self.ports[id.0 as usize];
            let side = if port.frame == self.here.frame { "inside" } else { "outside" };
            let error = Diagnostic::error(
                "E0415",
                end.path.span,
                format!("two bonds join the port `{}` from {side}", port.name),
            )
            .says("joined again here")
            .label(first, "first joined here")
            .label(port.span, "the port");
            d.push(error.help("put a junction at the port, and join both to it"));
            return false;
        }
        let index = self.halves.len();
        for (_, tip) in [from, to] {
            if let Some(slot) = self.slot(tip) {
                *slot = Some(index);
            }
        }
        self.halves.push(Half { from: from.1, to: to.1, stroke: arrow.stroke, span, bond: None });
        true
    }

    /// Where a port notes the half that joins it on the side of the frame at hand.
    fn slot(&mut self, tip: Tip) -> Option<&mut Option<usize>> {
        let Tip::Port(id) = tip else { return None };
        let port = &mut self.ports[id.0 as usize];
        let inside = port.frame == self.here.frame;
        Some(if inside { &mut port.inner } else { &mut port.outer })
    }

    /// The bonds: each from a vertex through any number of ports to a vertex.
    fn make_bonds(&mut self, d: &mut Vec<Diagnostic>) -> Vec<Vec<Joined>> {
        let mut joined: Vec<Vec<Joined>> = vec![vec![]; self.graph.vertices.len()];
        for first in 0..self.halves.len() {
            let Tip::Vertex(from) = self.halves[first].from else { continue };
            let id = BondId(self.graph.bonds.len() as u32);
            let span = self.halves[first].span;
            let mut given = None;
            let mut at = first;
            let to = loop {
                let half = &mut self.halves[at];
                half.bond = Some(id);
                if let (Some(one), Some(other)) = (given, half.stroke)
                    && one != other
                {
                    d.push(
                        Diagnostic::error("E0416", half.span, "two strokes on one bond")
                            .says("drawn at this end here")
                            .label(span, "and at the other end here")
                            .because("what is drawn on the two sides of a port is one bond"),
                    );
                }
                given = given.or(half.stroke);
                let port = match half.to {
                    Tip::Vertex(joint) => break Some(joint),
                    Tip::Port(port) => &mut self.ports[port.0 as usize],
                };
                port.bond = Some(id);
                // It came in at one side and goes on at the other.
                let next = if port.inner == Some(at) { port.outer } else { port.inner };
                match next {
                    Some(next) => at = next,
                    None => break None,
                }
            };
            let Some(to) = to else {
                // A port is open, which is said where ports are checked.
                joined[from.vertex.index()].push((id, false, from));
                self.graph.bonds.push(Bond {
                    from: End { vertex: from.vertex, port: from.named.unwrap_or(0) },
                    to: End { vertex: from.vertex, port: from.named.unwrap_or(0) },
                    given,
                    domain: Domain::Any,
                    span,
                });
                continue;
            };
            if from.vertex == to.vertex {
                d.push(
                    Diagnostic::error(
                        "E0405",
                        span,
                        format!("`{}` is joined to itself", self.shown(from.vertex)),
                    )
                    .says("a bond joins two different elements"),
                );
            }
            let end = |joint: Joint| End { vertex: joint.vertex, port: joint.named.unwrap_or(0) };
            self.graph.bonds.push(Bond {
                from: end(from),
                to: end(to),
                given,
                domain: Domain::Any,
                span,
            });
            joined[from.vertex.index()].push((id, false, from));
            joined[to.vertex.index()].push((id, true, to));
        }
        // What comes out of an open port: an end that has its bond, so that only the port is complained of.
        for at in 0..self.halves.len() {
            let half = &self.halves[at];
            if let (None, Tip::Vertex(to)) = (half.bond, half.to) {
                let id = BondId(self.graph.bonds.len() as u32);
                let span = half.span;
                let end = End { vertex: to.vertex, port: to.named.unwrap_or(0) };
                if let Tip::Port(port) = half.from {
                    self.ports[port.0 as usize].bond.get_or_insert(id);
                }
                self.halves[at].bond = Some(id);
                joined[to.vertex.index()].push((id, true, to));
                let domain = Domain::Any;
                self.graph.bonds.push(Bond { from: end, to: end, given: None, domain, span });
            }
        }
        let named = self.ports.iter().filter(|port| port.frame != Here::ROOT.frame);
        let named = named.filter_map(|port| Some((port.name.clone(), port.bond?)));
        self.graph.ports = named.collect();
        joined
    }

    /// Ports that are open on one side.
    fn check_ports(&self, d: &mut Vec<Diagnostic>) {
        for port in &self.ports {
            if port.excused {
                continue;
            }
            let frame = &self.frames[port.frame.0 as usize];
            let local = port.name.strip_prefix(&frame.prefix).unwrap_or(&port.name);
            if port.inner.is_none() && !frame.excused.contains(local) {
                let draw = if port.into { "`{} -> …`" } else { "`… -> {}`" }.replace("{}", local);
                d.push(
                    Diagnostic::error(
                        "E0411",
                        port.span,
                        format!("nothing in its model joins the port `{}`", port.name),
                    )
                    .says("this port leads nowhere")
                    .help(format!("join it inside the model: {draw}")),
                );
            }
            // A model that is looked at without an instance has nothing around it.
            let alone = frame.outer.is_none() && self.bodies[frame.body].header.is_some();
            if port.outer.is_none() && !alone {
                let root = port.frame == Here::ROOT.frame;
                let outer = frame.outer.map(|here| &self.frames[here.frame.0 as usize]);
                if outer.is_some_and(|outer| outer.excused.contains(local)) {
                    continue;
                }
                let draw =
                    if port.into { "`… -> {}`" } else { "`{} -> …`" }.replace("{}", &port.name);
                let error = Diagnostic::error(
                    "E0411",
                    if root { port.span } else { frame.span },
                    format!("the port `{}` is left open", port.name),
                );
                d.push(match root {
                    true => error
                        .says("no bond joins it from outside")
                        .help("a file with ports is a model for others: import it, and join the ports of an instance"),
                    false => error
                        .says("no bond joins this port of the instance")
                        .label(port.span, "the port")
                        .help(format!("join it: {draw}")),
                });
            }
        }
    }

    /// The bonds drawn from one thing to another where names are looked up now.
    pub fn bonds_between(&self, from: Thing, to: Thing) -> &[BondId] {
        let drawn = self.between.get_or_init(|| {
            let mut drawn: HashMap<(Thing, Thing), Vec<BondId>> = HashMap::new();
            for half in &self.halves {
                let ends = (half.from.thing(), half.to.thing());
                drawn.entry(ends).or_default().extend(half.bond);
            }
            drawn
        });
        drawn.get(&(from, to)).map_or(&[], Vec::as_slice)
    }

    /// The port that a path names after its element: `Some(None)` when it names none, `None` when it names a wrong one.
    pub fn port(
        &self,
        vertex: VertexId,
        rest: &[Part],
        d: &mut Vec<Diagnostic>,
    ) -> Option<Option<u32>> {
        let Some(member) = rest.first() else { return Some(None) };
        let declaration = self.declarations[vertex.index()];
        let (name, noun) = (self.shown(vertex), declaration.element.noun);
        let span = rest.iter().fold(member.span, |span, member| span.join(member.span));
        let two_port = declaration.element.shape.is_two_port();
        let field = fields::ports(&declaration);
        if let (Some(ports), [_]) = (field, rest) {
            let number = member.text.parse::<usize>().ok().filter(|k| (1..=ports).contains(k));
            if let Some(number) = number.filter(|_| !member.text.starts_with('0')) {
                return Some(Some(number as u32 - 1));
            }
        }
        match member.text.as_str() {
            "1" if two_port && rest.len() == 1 => return Some(Some(0)),
            "2" if two_port && rest.len() == 1 => return Some(Some(1)),
            _ => {}
        }
        let message = match field.filter(|ports| *ports > 0) {
            Some(ports) => {
                let plural = if ports == 1 { "" } else { "s" };
                format!(
                    "the field `{name}` has {ports} port{plural}, and none is `{}`",
                    member.text
                )
            }
            None => format!("`{name}` has no port `{}`", member.text),
        };
        let error = Diagnostic::error("E0410", span, message)
            .says("no such port")
            .label(declaration.span, format!("`{name}` is {}", a(noun)));
        d.push(if two_port {
            error.help(format!("the ports of {} are `{name}.1` and `{name}.2`", a(noun)))
        } else if let Some(ports) = field.filter(|ports| *ports > 0) {
            error.help(format!("the ports of this field are {}", fields::listed(name, ports)))
        } else {
            error.help(format!("the ports of {} have no names: write `{name}`", a(noun)))
        });
        None
    }

    fn give_ports(
        &mut self,
        id: VertexId,
        joined: &[Joined],
        whole: bool,
        d: &mut Vec<Diagnostic>,
    ) {
        let declaration = self.declarations[id.index()];
        let shape = declaration.element.shape;
        let (name, noun) = (self.shown(id).to_string(), declaration.element.noun);
        let bonds: Vec<BondId> = joined.iter().map(|(bond, ..)| *bond).collect();
        if shape.is_two_port() {
            return self.give_two_ports(id, joined, whole, d);
        }
        if let Some(ports) = fields::ports(&declaration) {
            return self.give_field_ports(id, joined, ports, whole, d);
        }
        let least = if shape.is_junction() { 2 } else { 1 };
        if bonds.len() < least && whole {
            let error = if bonds.is_empty() {
                Diagnostic::error("E0403", declaration.span, format!("no bond joins `{name}`"))
                    .says(format!("this {noun} stands alone"))
            } else {
                Diagnostic::error(
                    "E0401",
                    declaration.span,
                    format!("the {noun} `{name}` has only one bond"),
                )
                .says("a junction joins at least two")
                .label(self.graph.bond(bonds[0]).span, "its only bond")
            };
            d.push(error.help(format!("join it with an arrow, as in `{name} -> …`")));
        }
        // Bonds of two elements that were given one name are not counted as those of one.
        let doubled = |said: &Diagnostic| {
            said.code == "E0203" && said.labels.iter().any(|label| label.span == declaration.span)
        };
        if !shape.is_junction() && bonds.len() > 1 && !d.iter().any(doubled) {
            let mut error = Diagnostic::error(
                "E0402",
                joined[1].2.span,
                format!("the {noun} `{name}` has {} bonds, but only one port", bonds.len()),
            )
            .says("a second bond for the same port");
            for (_, _, joint) in joined.iter().filter(|j| j.2.span != joined[1].2.span) {
                error = error.label(joint.span, "joined here");
            }
            d.push(error.help(format!(
                "put a 0-junction (common effort) or a 1-junction (common flow) between them and \
                 join `{name}` to it"
            )));
        }
        self.graph.vertices[id.index()].bonds = bonds;
    }

    /// The first port is the incoming bond, the second the outgoing one, or as named.
    fn give_two_ports(
        &mut self,
        id: VertexId,
        joined: &[Joined],
        whole: bool,
        d: &mut Vec<Diagnostic>,
    ) {
        let declaration = self.declarations[id.index()];
        let (name, noun) = (self.shown(id).to_string(), declaration.element.noun);
        let mut ports: [Option<Joined>; 2] = [None, None];
        let (named, unnamed): (Vec<Joined>, Vec<Joined>) =
            joined.iter().partition(|(_, _, joint)| joint.named.is_some());
        for (bond, head, joint) in named.into_iter().chain(unnamed) {
            let port = joint.named.unwrap_or(u32::from(!head));
            let slot = &mut ports[port as usize];
            let Some(first) = slot else {
                *slot = Some((bond, head, joint));
                continue;
            };
            if joined.len() > 2 {
                // Too many bonds: said once, below.
                continue;
            }
            if joint.named.is_some() {
                d.push(
                    Diagnostic::error(
                        "E0409",
                        joint.span,
                        format!("port {} of the {noun} `{name}` has two bonds", port + 1),
                    )
                    .says("joined again here")
                    .label(first.2.span, "first joined here"),
                );
                continue;
            }
            let way = if head { "points into" } else { "points out of" };
            let mut edits = vec![(joint.span, format!("{name}.{}", 2 - port))];
            if first.2.named.is_none() {
                edits.insert(0, (first.2.span, format!("{name}.{}", port + 1)));
            }
            let mut error = Diagnostic::error(
                "E0409",
                joint.span,
                format!("which bond of the {noun} `{name}` is which port?"),
            )
            .says(format!("this half arrow {way} it"))
            .label(
                first.2.span,
                if first.2.named.is_some() { "this port is taken" } else { "and so does this one" },
            )
            .because(
                "port 1 is the incoming bond and port 2 the outgoing one, unless they are named",
            )
            .help(format!("name the ports: `{name}.1` and `{name}.2`"));
            // An element declared in place keeps its kind: only plain names can be edited for certain.
            if edits.iter().all(|(span, _)| !declaration.span.join(*span).eq(&declaration.span)) {
                error = error.fix("name the ports in the order of the file", edits);
            }
            d.push(error);
        }
        if joined.len() > 2 {
            let mut error = Diagnostic::error(
                "E0402",
                joined[2].2.span,
                format!("the {noun} `{name}` has {} bonds, but only two ports", joined.len()),
            )
            .says("a third bond for two ports");
            for (_, _, joint) in &joined[..2] {
                error = error.label(joint.span, "joined here");
            }
            d.push(error);
        }
        if joined.len() < 2 && whole {
            let mut error = Diagnostic::error(
                "E0403",
                declaration.span,
                format!(
                    "the {noun} `{name}` has {}",
                    if joined.is_empty() { "no bond" } else { "only one bond" }
                ),
            )
            .says("it joins two");
            if let Some((bond, ..)) = joined.first() {
                error = error.label(self.graph.bond(*bond).span, "its only bond");
            }
            d.push(error.help(format!("write what it leads to, as in `… -> {name} -> …`")));
        }
        for (port, slot) in (0..).zip(&ports) {
            let Some((bond, head, _)) = slot else { continue };
            let bond = &mut self.graph.bonds[bond.index()];
            let end = if *head { &mut bond.to } else { &mut bond.from };
            end.port = port;
        }
        self.graph.vertices[id.index()].bonds =
            ports.iter().flatten().map(|(bond, ..)| *bond).collect();
    }

    /// Ports as named; the only port of a field of one needs no name.
    fn give_field_ports(
        &mut self,
        id: VertexId,
        joined: &[Joined],
        count: usize,
        whole: bool,
        d: &mut Vec<Diagnostic>,
    ) {
        let declaration = self.declarations[id.index()];
        let name = self.shown(id).to_string();
        if count == 0 {
            // Nothing says what its ports are: that is said where its law is made.
            return;
        }
        let mut ports: Vec<Option<Joined>> = vec![None; count];
        let mut unnamed = vec![];
        for join in joined {
            let Some(port) = join.2.named.or((count == 1).then_some(0)) else {
                unnamed.push(join.2);
                continue;
            };
            let Some(slot) = ports.get_mut(port as usize) else { continue };
            let Some((.., first)) = slot.replace(*join) else { continue };
            d.push(
                Diagnostic::error(
                    "E0409",
                    join.2.span,
                    format!("port {} of the field `{name}` has two bonds", port + 1),
                )
                .says("joined again here")
                .label(first.span, "first joined here")
                .help("join both to a junction, and the junction to the port"),
            );
        }
        let free: Vec<usize> = (0..count).filter(|port| ports[*port].is_none()).collect();
        for joint in &unnamed {
            let mut error = Diagnostic::error(
                "E0409",
                joint.span,
                format!("at which port does this bond join the field `{name}`?"),
            )
            .says("no port is named")
            .help(format!("its ports are {}", fields::listed(&name, count)));
            // An element declared in place keeps its kind: only plain names can be edited for certain.
            let plain = declaration.span.join(joint.span) != declaration.span;
            if let ([port], [_], true) = (free.as_slice(), unnamed.as_slice(), plain) {
                let written = format!("{name}.{}", port + 1);
                error = error.fix("name the port that is free", vec![(joint.span, written)]);
            }
            d.push(error);
        }
        if whole && unnamed.is_empty() {
            for port in free {
                d.push(
                    Diagnostic::error(
                        "E0403",
                        declaration.span,
                        format!("port {} of the field `{name}` has no bond", port + 1),
                    )
                    .says(format!("it has {count} {}", if count == 1 { "port" } else { "ports" }))
                    .help(format!(
                        "join it, as in `… -> {name}.{0}`; a port at which nothing flows takes `Sf:free(0)`",
                        port + 1
                    )),
                );
            }
        }
        self.graph.vertices[id.index()].bonds =
            ports.iter().flatten().map(|(bond, ..)| *bond).collect();
    }

    /// Bonds both of whose ends impose the same variable.
    fn check_sources(&self, d: &mut Vec<Diagnostic>) {
        for bond in &self.graph.bonds {
            let declaration = |end: End| self.declarations[end.vertex.index()];
            let (from, to) = (declaration(bond.from), declaration(bond.to));
            let sets = from.element.shape.sets();
            if bond.from.vertex == bond.to.vertex
                || sets.is_none()
                || sets != to.element.shape.sets()
            {
                continue;
            }
            let word = if sets == Some(Power::Effort) { "effort" } else { "flow" };
            d.push(
                Diagnostic::error(
                    "E0404",
                    bond.span,
                    format!(
                        "`{}` and `{}` both impose the {word} of their bond",
                        self.shown(bond.from.vertex), self.shown(bond.to.vertex)
                    ),
                )
                .says(format!("its {word} is set from both ends"))
                .label(from.span, format!("this {} sets the {word}", from.element.noun))
                .label(to.span, format!("and so does this {}", to.element.noun))
                .help("remove one of them, or join them through an element that takes up the difference"),
            );
        }
    }
}
