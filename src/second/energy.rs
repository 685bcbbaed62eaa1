//! Where the energy goes: the work of every bond, sorted by elements.
//!
//! The work of a bond is ∫ e·f dt along its half arrow. Sources count what they deliver, dissipators and what is
//! modulated what they take. Stores whose law is a state function count E(end) − E(start) from the law itself, not
//! from the work: closed forms for linear ones, quadrature of the law else, so that the balance tests the solution.
//! Bonds of pseudo domains, whose e·f is no power, are left out.

use crate::bond::equations::Equations;
use crate::bond::fields;
use crate::bond::graph::{
    BondGraph, BondId, End, Field, Law, Leaf, Power, Storage, StoreLaw, VertexId,
};
use crate::quantity::Domain;

/// What an element does with energy.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Role {
    /// Delivers it (a negative amount: takes it).
    Source,
    /// Takes it for good.
    Dissipated,
    /// Keeps it as a function of its stored quantity.
    Stored,
    /// Exchanges it with what modulates it.
    Modulated,
}

impl Role {
    /// Its name in tables and JSON.
    pub fn name(self) -> &'static str {
        match self {
            Role::Source => "in",
            Role::Dissipated => "dissipated",
            Role::Stored => "stored",
            Role::Modulated => "modulated",
        }
    }
}

/// One element's part, joules; what a source delivers, what others take.
#[derive(Clone, Debug, PartialEq)]
pub struct Share {
    /// The element.
    pub element: VertexId,
    /// Its name.
    pub name: String,
    /// What it does with it.
    pub role: Role,
    /// How much.
    pub energy: f64,
}

/// The balance of a run, joules.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Energy {
    /// Every element's part, in file order.
    pub shares: Vec<Share>,
    /// Delivered by sources.
    pub delivered: f64,
    /// Dissipated.
    pub dissipated: f64,
    /// Gained by stores.
    pub stored: f64,
    /// Given to what modulates.
    pub modulated: f64,
    /// Gained by stores at instants at which what they store jumps: a source's step that sets it, a modulus or a
    /// modulated store that changes at once. No integral of a power holds it.
    pub jumps: f64,
    /// delivered + jumps − dissipated − stored − modulated.
    pub residual: f64,
    /// What the residual is to be compared with: Σ |delivered| of the sources, or the largest other sum; at least a
    /// thousandth of all that was moved to and fro, for what swings by itself.
    pub turnover: f64,
    /// Largest |Σ power| of a junction or two-port at a row, in parts of its own largest Σ |power|; and its name.
    pub junctions: (f64, String),
}

/// Whether e·f of the bond is a power.
pub fn carries_power(graph: &BondGraph, bond: BondId) -> bool {
    !matches!(graph.bond(bond).domain, Domain::PseudoThermal | Domain::Pneumatic)
}

/// The balance, from what was metered, and the unknowns at both ends of the run.
pub fn balance(
    graph: &BondGraph,
    equations: &Equations,
    Meter { work, moved, jumps, jumped, .. }: &Meter,
    start: &[f64],
    end: &[f64],
) -> Energy {
    let mut energy = Energy::default();
    let mut sources = 0.0;
    for id in graph.vertex_ids() {
        let vertex = graph.vertex(id);
        let Some(role) = role(graph, id) else { continue };
        if !vertex.bonds.iter().all(|bond| carries_power(graph, *bond)) {
            continue;
        }
        let taken: f64 = (0..)
            .zip(&vertex.bonds)
            .map(|(port, bond)| graph.sign_into(*bond, id, port) * work[bond.index()])
            .sum();
        let amount = match role {
            Role::Source => -taken,
            Role::Stored => gained(graph, equations, id, start, end).unwrap_or(taken),
            Role::Dissipated | Role::Modulated => taken,
        };
        match role {
            Role::Source => {
                energy.delivered += amount;
                sources += amount.abs();
            }
            Role::Dissipated => energy.dissipated += amount,
            Role::Stored => energy.stored += amount,
            Role::Modulated => energy.modulated += amount,
        }
        energy.shares.push(Share { element: id, name: vertex.name.clone(), role, energy: amount });
    }
    energy.jumps = *jumps;
    energy.residual =
        energy.delivered + energy.jumps - energy.dissipated - energy.stored - energy.modulated;
    let sum = |role: Role| -> f64 {
        energy.shares.iter().filter(|s| s.role == role).map(|s| s.energy.abs()).sum()
    };
    let sums = [sources, *jumped, sum(Role::Stored), sum(Role::Dissipated), sum(Role::Modulated)];
    energy.turnover = sums.into_iter().fold(1e-3 * moved, f64::max);
    energy
}

/// What an element does with energy; `None` for junctions and two-ports, which pass it on.
pub fn role(graph: &BondGraph, id: VertexId) -> Option<Role> {
    match &graph.vertex(id).law {
        Law::Zero | Law::One | Law::Transformer(_) | Law::Gyrator(_) => None,
        Law::Source { .. } => Some(Role::Source),
        Law::Dissipator(_) => Some(Role::Dissipated),
        Law::Rate { .. } => Some(Role::Modulated),
        Law::Store { law, .. } => {
            Some(if own_only(store_law(law)) { Role::Stored } else { Role::Modulated })
        }
        Law::Field(_) if graph.storage(End::only(id)).is_none() => Some(Role::Dissipated),
        Law::Field(_) if fields::is_state_function(graph, id) => Some(Role::Stored),
        Law::Field(_) => Some(Role::Modulated),
    }
}

fn store_law(law: &StoreLaw) -> &crate::bond::graph::Expr {
    match law {
        StoreLaw::Linear(law) | StoreLaw::OfStored(law) | StoreLaw::OfPower(law) => law,
    }
}

fn own_only(law: &crate::bond::graph::Expr) -> bool {
    let mut own = true;
    law.leaves(&mut |leaf, _| own &= matches!(leaf, Leaf::Parameter(_) | Leaf::Own(_)));
    own
}

/// Whether the law of a store has a value where nothing is stored.
pub fn has_zero(graph: &BondGraph, id: VertexId) -> bool {
    let at_zero = |law: &Law| {
        let Law::Store { law, .. } = law else { return true };
        let value = store_law(law).evaluate(&mut |leaf| match leaf {
            Leaf::Parameter(id) => graph.parameters[id.index()].value,
            _ => 0.0,
        });
        value.is_finite()
    };
    match &graph.vertex(id).law {
        Law::Field(field) => field.matrix.is_some() || field.ports.iter().all(at_zero),
        law => at_zero(law),
    }
}

/// E(end) − E(start) of a store whose law is a state function.
pub fn gained(
    graph: &BondGraph,
    equations: &Equations,
    id: VertexId,
    start: &[f64],
    end: &[f64],
) -> Option<f64> {
    if let Law::Field(field) = &graph.vertex(id).law {
        return gained_by_field(graph, equations, id, field, start, end);
    }
    let Law::Store { kind, law, .. } = &graph.vertex(id).law else { return None };
    let k = equations.stored(End::only(id))?;
    let bond = *graph.vertex(id).bonds.first()?;
    let value = |x: f64| {
        store_law(law).evaluate(&mut |leaf| match leaf {
            Leaf::Parameter(id) => graph.parameters[id.index()].value,
            _ => x,
        })
    };
    let (q0, q1) = (start[k], end[k]);
    Some(match law {
        // (q1² − q0²)/2C, without the difference of squares.
        StoreLaw::Linear(_) => 0.5 * (q1 - q0) * (q1 + q0) / value(0.0),
        StoreLaw::OfStored(_) => integral(&value, q0, q1),
        StoreLaw::OfPower(_) => {
            let sign = match kind {
                Storage::Compliance => 1.0,
                Storage::Inertia => graph.sign_into(bond, id, 0),
            };
            let power = |y: &[f64]| sign * y[equations.power(bond, kind.gives())];
            let (e0, e1) = (power(start), power(end));
            e1 * q1 - e0 * q0 - integral(&value, e0, e1)
        }
    })
}

/// E(end) − E(start) of a field whose energy is a state function: ∫ Σ (what port k gives) d(what it stores) along the
/// straight line between the two states; of a matrix ½ Σ (x1 − x0)·(g1 + g0), which is the same for a symmetric one.
fn gained_by_field(
    graph: &BondGraph,
    equations: &Equations,
    id: VertexId,
    field: &Field,
    start: &[f64],
    end: &[f64],
) -> Option<f64> {
    let ports: Vec<(usize, Storage, BondId)> = graph
        .law_ports(id)
        .map(|at| Some((equations.stored(at)?, graph.storage(at)?, graph.bond_at(at)?)))
        .collect::<Option<_>>()?;
    if field.matrix.is_some() {
        let given = |port: u32, kind: &Storage, bond: &BondId, y: &[f64]| {
            let sign = match kind {
                Storage::Compliance => 1.0,
                Storage::Inertia => graph.sign_into(*bond, id, port),
            };
            sign * y[equations.power(*bond, kind.gives())]
        };
        let parts = (0..).zip(&ports).map(|(port, (k, kind, bond))| {
            let sum = given(port, kind, bond, start) + given(port, kind, bond, end);
            0.5 * (end[*k] - start[*k]) * sum
        });
        return Some(parts.sum());
    }
    let along = |part: f64| -> f64 {
        let at = |k: usize| start[k] + part * (end[k] - start[k]);
        let laws = field.ports.iter().zip(&ports).map(|(law, (k, ..))| {
            let Law::Store { law: StoreLaw::OfStored(law), .. } = law else { return f64::NAN };
            let given = law.evaluate(&mut |leaf| match leaf {
                Leaf::Parameter(id) => graph.parameters[id.index()].value,
                Leaf::Stored(end) => equations.stored(*end).map_or(f64::NAN, at),
                _ => f64::NAN,
            });
            given * (end[*k] - start[*k])
        });
        laws.sum()
    };
    Some(integral(&along, 0.0, 1.0)).filter(|energy| energy.is_finite())
}

/// ∫ f from a to b: Gauss-Legendre of 8 points on halves until both agree.
fn integral(f: &dyn Fn(f64) -> f64, a: f64, b: f64) -> f64 {
    fn gauss(f: &dyn Fn(f64) -> f64, a: f64, b: f64) -> f64 {
        const NODES: [(f64, f64); 4] = [
            (0.183_434_642_495_649_8, 0.362_683_783_378_362),
            (0.525_532_409_916_329, 0.313_706_645_877_887_3),
            (0.796_666_477_413_626_7, 0.222_381_034_453_374_48),
            (0.960_289_856_497_536_3, 0.101_228_536_290_376_26),
        ];
        let (middle, half) = (0.5 * (a + b), 0.5 * (b - a));
        half * NODES
            .iter()
            .map(|(x, w)| w * (f(middle - half * x) + f(middle + half * x)))
            .sum::<f64>()
    }
    fn refine(f: &dyn Fn(f64) -> f64, a: f64, b: f64, whole: f64, scale: f64, depth: u32) -> f64 {
        let middle = 0.5 * (a + b);
        let (left, right) = (gauss(f, a, middle), gauss(f, middle, b));
        if depth == 0 || (left + right - whole).abs() <= 1e-13 * scale {
            return left + right;
        }
        refine(f, a, middle, left, scale, depth - 1) + refine(f, middle, b, right, scale, depth - 1)
    }
    let whole = gauss(f, a, b);
    let scale = gauss(&|x| f(x).abs(), a, b).abs();
    refine(f, a, b, whole, scale, 30)
}

/// Collects the works of bonds from the stages of accepted steps, and the powers of junctions at rows.
#[derive(Clone, Debug)]
pub struct Meter {
    /// ∫ e·f dt of each bond.
    pub work: Vec<f64>,
    /// ∫ |e·f| dt over all bonds.
    pub moved: f64,
    /// What stores have gained in jumps, and the sum of the magnitudes.
    pub jumps: f64,
    jumped: f64,
    /// The stores whose energy is a function of what they store.
    stores: Vec<VertexId>,
    states: usize,
    columns: Vec<(usize, usize)>,
    /// By vertex: signed bonds into it, for junctions and two-ports.
    nodes: Vec<(VertexId, Vec<(usize, f64)>)>,
    largest: Vec<(f64, f64)>,
}

impl Meter {
    /// A meter that has seen nothing.
    pub fn new(graph: &BondGraph, equations: &Equations) -> Meter {
        let nodes: Vec<_> = graph
            .vertex_ids()
            .filter(|id| role(graph, *id).is_none())
            .map(|id| {
                let bonds = graph.vertex(id).bonds.iter().enumerate();
                let two_port =
                    matches!(graph.vertex(id).law, Law::Transformer(_) | Law::Gyrator(_));
                let signs = bonds
                    .filter(|(_, bond)| carries_power(graph, **bond))
                    .map(|(port, bond)| {
                        let port = if two_port { port as u32 } else { 0 };
                        (bond.index(), graph.sign_into(*bond, id, port))
                    })
                    .collect();
                (id, signs)
            })
            .collect();
        Meter {
            work: vec![0.0; graph.bonds.len()],
            moved: 0.0,
            jumps: 0.0,
            jumped: 0.0,
            stores: graph
                .vertex_ids()
                .filter(|id| role(graph, *id) == Some(Role::Stored))
                .filter(|id| graph.vertex(*id).bonds.iter().all(|b| carries_power(graph, *b)))
                .collect(),
            states: equations.states,
            columns: graph
                .bond_ids()
                .map(|bond| {
                    (equations.power(bond, Power::Effort), equations.power(bond, Power::Flow))
                })
                .collect(),
            largest: vec![(0.0, 0.0); nodes.len()],
            nodes,
        }
    }

    /// Adds `weight`·e·f of every bond.
    pub fn add(&mut self, weight: f64, y: &[f64]) {
        for (work, (e, f)) in self.work.iter_mut().zip(&self.columns) {
            let part = weight * y[*e] * y[*f];
            *work += part;
            self.moved += part.abs();
        }
    }

    /// Takes in a jump from one set of values to another.
    pub fn jump(&mut self, graph: &BondGraph, equations: &Equations, from: &[f64], to: &[f64]) {
        if from[..self.states] != to[..self.states] {
            for id in &self.stores {
                let gained = gained(graph, equations, *id, from, to).unwrap_or(0.0);
                self.jumps += gained;
                self.jumped += gained.abs();
            }
        }
    }

    /// Sums the powers into each junction and two-port.
    pub fn check(&mut self, y: &[f64]) {
        for ((_, bonds), largest) in self.nodes.iter().zip(&mut self.largest) {
            let (mut sum, mut size) = (0.0, 0.0);
            for (bond, sign) in bonds {
                let (e, f) = self.columns[*bond];
                let power = y[e] * y[f];
                sum += sign * power;
                size += power.abs();
            }
            largest.0 = largest.0.max(sum.abs());
            largest.1 = largest.1.max(size);
        }
    }

    /// The worst junction or two-port: its power in parts of its own largest sum, and its name.
    pub fn worst(&self, graph: &BondGraph) -> (f64, String) {
        // Numbers next to the smallest that there are have few digits.
        const LEAST: f64 = f64::MIN_POSITIVE / f64::EPSILON;
        let parts = self.nodes.iter().zip(&self.largest).map(|((id, _), (sum, size))| {
            (if *size > LEAST { sum / size } else { 0.0 }, graph.vertex(*id).name.clone())
        });
        parts.max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((0.0, String::new()))
    }
}
