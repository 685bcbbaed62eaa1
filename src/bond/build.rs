//! Bond graphs built by hand, for tests.

use super::graph::*;
use crate::expr::Binary;
use crate::quantity::Domain;
use crate::source::Span;

/// A number.
pub fn n(value: f64) -> Expr {
    Expr::number(value)
}

/// The own effort or flow, or stored quantity.
pub fn own(variable: Variable) -> Expr {
    Expr::leaf(Leaf::Own(variable))
}

/// Own effort.
pub fn e() -> Expr {
    own(Variable::Power(Power::Effort))
}

/// Own flow.
pub fn f() -> Expr {
    own(Variable::Power(Power::Flow))
}

/// Own stored quantity.
pub fn q() -> Expr {
    own(Variable::Stored)
}

/// a·b.
pub fn times(a: Expr, b: Expr) -> Expr {
    a.binary(Binary::Multiply, b)
}

/// a + b.
pub fn plus(a: Expr, b: Expr) -> Expr {
    a.binary(Binary::Add, b)
}

/// Laws in short.
pub fn effort_source(value: Expr) -> Law {
    Law::Source { sets: Power::Effort, value, detector: false }
}

pub fn flow_source(value: Expr) -> Law {
    Law::Source { sets: Power::Flow, value, detector: false }
}

pub fn resistor(value: f64) -> Law {
    Law::Dissipator(Dissipation::Linear(n(value)))
}

pub fn compliance(value: f64, initial: StoreInitial) -> Law {
    Law::Store { kind: Storage::Compliance, law: StoreLaw::Linear(n(value)), initial }
}

pub fn inertia(value: f64, initial: StoreInitial) -> Law {
    Law::Store { kind: Storage::Inertia, law: StoreLaw::Linear(n(value)), initial }
}

pub fn stored(value: f64) -> StoreInitial {
    StoreInitial::Stored(n(value))
}

pub fn power(value: f64) -> StoreInitial {
    StoreInitial::Power(n(value))
}

/// A graph under construction.
#[derive(Default)]
pub struct Build {
    pub graph: BondGraph,
}

impl Build {
    /// Adds a vertex.
    pub fn vertex(&mut self, kind: &'static str, name: &str, law: Law) -> VertexId {
        self.graph.vertices.push(Vertex {
            name: name.to_string(),
            kind,
            law,
            span: Span::NONE,
            bonds: vec![],
        });
        VertexId(self.graph.vertices.len() as u32 - 1)
    }

    pub fn zero(&mut self, name: &str) -> VertexId {
        self.vertex("0", name, Law::Zero)
    }

    pub fn one(&mut self, name: &str) -> VertexId {
        self.vertex("1", name, Law::One)
    }

    /// A bond with its half arrow from `a` to `b`; of a two-port the free port that fits (1 in, 2 out).
    pub fn bond(&mut self, a: VertexId, b: VertexId) -> BondId {
        let two_port = |v: &Vertex| matches!(v.law, Law::Transformer(_) | Law::Gyrator(_));
        let from = u32::from(two_port(self.graph.vertex(a)));
        self.graph.bonds.push(Bond {
            from: End { vertex: a, port: from },
            to: End { vertex: b, port: 0 },
            given: None,
            domain: Domain::Any,
            span: Span::NONE,
        });
        let id = BondId(self.graph.bonds.len() as u32 - 1);
        self.graph.vertices[a.index()].bonds.push(id);
        self.graph.vertices[b.index()].bonds.push(id);
        // Port 1 first.
        for v in [a, b] {
            if two_port(self.graph.vertex(v)) {
                let bonds = self.graph.vertices[v.index()].bonds.clone();
                let mut sorted = bonds;
                sorted.sort_by_key(|bond| {
                    let bond = self.graph.bond(*bond);
                    if bond.from.vertex == v { bond.from.port } else { bond.to.port }
                });
                self.graph.vertices[v.index()].bonds = sorted;
            }
        }
        id
    }

    /// Bonds from one vertex to several.
    pub fn fan(&mut self, a: VertexId, to: &[VertexId]) {
        for b in to {
            self.bond(a, *b);
        }
    }

    /// Observes an expression in SI.
    pub fn observe(&mut self, name: &str, expr: Expr) {
        self.graph.experiment.observe.push(Observation {
            name: name.to_string(),
            expr,
            unit: (String::new(), 1.0),
            si_unit: String::new(),
        });
    }

    /// Observes q or p.
    pub fn observe_stored(&mut self, id: VertexId) {
        let name = self.graph.vertex(id).name.clone();
        self.observe(&name, Expr::leaf(Leaf::Stored(End::only(id))));
    }

    /// Observes a bond's variable.
    pub fn observe_bond(&mut self, name: &str, bond: BondId, variable: Power) {
        self.observe(name, Expr::leaf(Leaf::Bond { bond, variable, negated: false }));
    }

    /// Adds a signal.
    pub fn signal(&mut self, name: &str, law: SignalLaw) -> SignalId {
        self.graph.signals.push(Signal {
            name: name.to_string(),
            law,
            origin: SignalOrigin::Signal,
            span: Span::NONE,
            unit: None,
            home: 0,
        });
        SignalId(self.graph.signals.len() as u32 - 1)
    }
}
