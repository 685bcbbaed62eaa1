//! What flows where at every row of a run: the power of each element and what it has delivered, taken or holds.
//!
//! Work between two rows is what the quadrature of the integrator says of the collocation polynomial, so that at the end
//! it is what the balance has. What a store holds follows from its law and counts from where nothing is stored; where
//! the law has no energy there (as a gas spring without gas), from the start of the run.

use super::energy::{Role, carries_power, gained, has_zero, role};
use super::radau::{B, C, Step};
use crate::bond::equations::Equations;
use crate::bond::graph::{BondGraph, Power, VertexId};

/// One element's part in a run, a value for each row.
#[derive(Clone, Debug)]
pub struct Flow {
    /// The element.
    pub element: VertexId,
    /// Its name.
    pub name: String,
    /// What it does with energy.
    pub role: Role,
    /// Power, watts: what a source delivers, what others take.
    pub power: Vec<f64>,
    /// Energy, joules: what a source has delivered, what a dissipator or what is modulated has taken, what a store holds.
    pub energy: Vec<f64>,
    /// Whether the energy of a store counts from the start of the run.
    pub since_start: bool,
    /// By port: e and f among the unknowns, and the sign of their product into the element.
    ports: Vec<(usize, usize, f64)>,
    /// Work taken up to the step that is being looked at.
    taken: f64,
}

/// The flows of a run in the making.
#[derive(Clone, Debug, Default)]
pub struct Flows {
    /// Elements in file order.
    pub elements: Vec<Flow>,
    start: Vec<f64>,
    nothing: Vec<f64>,
}

impl Flow {
    /// The power into the element.
    fn power_into(&self, y: &[f64]) -> f64 {
        self.ports.iter().map(|(e, f, sign)| sign * y[*e] * y[*f]).sum()
    }
}

impl Flows {
    /// Of all elements whose bonds carry power.
    pub fn new(graph: &BondGraph, equations: &Equations, start: &[f64]) -> Flows {
        let nothing = vec![0.0; start.len()];
        let flow = |id: VertexId| {
            let vertex = graph.vertex(id);
            let role = role(graph, id)?;
            if !vertex.bonds.iter().all(|bond| carries_power(graph, *bond)) {
                return None;
            }
            let ports = (0..).zip(&vertex.bonds).map(|(port, bond)| {
                let of = |power| equations.power(*bond, power);
                (of(Power::Effort), of(Power::Flow), graph.sign_into(*bond, id, port))
            });
            let held = || gained(graph, equations, id, &nothing, start).is_some_and(f64::is_finite);
            Some(Flow {
                element: id,
                name: vertex.name.clone(),
                role,
                power: vec![],
                energy: vec![],
                since_start: role == Role::Stored && !(has_zero(graph, id) && held()),
                ports: ports.collect(),
                taken: 0.0,
            })
        };
        let elements = graph.vertex_ids().filter_map(flow).collect();
        Flows { elements, start: start.to_vec(), nothing }
    }

    /// Takes in a row at `t`, whose values are `y`, within a step.
    pub fn row(
        &mut self,
        graph: &BondGraph,
        equations: &Equations,
        step: &Step,
        t: f64,
        y: &[f64],
    ) {
        let part = ((t - step.t) / step.h).clamp(0.0, 1.0);
        let mut stages = [(); 3].map(|()| vec![0.0; y.len()]);
        for (stage, c) in stages.iter_mut().zip(C) {
            step.part(c * part, stage);
        }
        for k in 0..self.elements.len() {
            let flow = &self.elements[k];
            let within: f64 =
                stages.iter().zip(B).map(|(stage, b)| b * flow.power_into(stage)).sum();
            let taken = flow.taken + within * part * step.h;
            let (power, from) =
                (flow.power_into(y), if flow.since_start { &self.start } else { &self.nothing });
            let energy = match flow.role {
                Role::Source => -taken,
                Role::Stored => gained(graph, equations, flow.element, from, y).unwrap_or(taken),
                Role::Dissipated | Role::Modulated => taken,
            };
            let flow = &mut self.elements[k];
            flow.power.push(if flow.role == Role::Source { -power } else { power });
            flow.energy.push(energy);
        }
    }

    /// Goes past a step.
    pub fn pass(&mut self, step: &Step) {
        let mut stage = step.start.to_vec();
        for (own, b) in step.stages.iter().zip(B) {
            let values = stage.iter_mut().zip(step.start.iter().zip(own));
            values.for_each(|(value, (start, change))| *value = start + change);
            for flow in &mut self.elements {
                flow.taken += b * step.h * flow.power_into(&stage);
            }
        }
    }
}
