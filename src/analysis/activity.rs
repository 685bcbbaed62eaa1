//! Which elements matter: the activity of each over a run, and what may be left out.
//!
//! The activity of an element is A = ∫ |e·f| dt over the run: the energy that has passed it, in whatever direction. Its
//! index is A over the sum of all elements'. Those that come last in this order, and together are less than what need not
//! be kept, are left out. (Louca, Stein, Hulbert, Sprague: *Proper model generation: an energy-based methodology*, ICBGM
//! 1997; Louca, *An energy-based model reduction methodology for automated modeling*, 1998.)
//!
//! On a 1-junction the effort of what is left out counts as 0, on a 0-junction its flow. A 1-junction between others, such
//! as a leak or a valve, on which an element has much of the effort goes as a whole: there it is the flow that is small.

use crate::bond::graph::{BondGraph, BondId, Law, Leaf, Observation, Power, VertexId};
use crate::expr::{Binary, Expr};
use crate::trace::Trace;

/// From this part of what passes a junction on, an element is no small drop on its way.
const MUCH: f64 = 0.1;

/// What has passed an element.
#[derive(Clone, Debug, PartialEq)]
pub struct Activity {
    /// Which.
    pub element: VertexId,
    /// ∫ |e·f| dt, J; of a field the sum over its ports.
    pub joules: f64,
    /// In parts of that of all elements.
    pub index: f64,
}

/// The activities of a model over a run.
#[derive(Clone, Debug)]
pub struct Activities {
    /// Of resistors, storages and fields, the most active first.
    pub elements: Vec<Activity>,
    /// By bond, J.
    pub bonds: Vec<f64>,
    /// The sum of all elements', J.
    pub total: f64,
}

/// The model with the power of every bond as columns after its own.
pub fn metered(graph: &BondGraph) -> BondGraph {
    let mut metered = graph.clone();
    for bond in graph.bond_ids() {
        let read = |variable| Expr::leaf(Leaf::Bond { bond, variable, negated: false });
        metered.experiment.observe.push(Observation {
            name: format!("power of bond {}", bond.0 + 1),
            expr: read(Power::Effort).binary(Binary::Multiply, read(Power::Flow)),
            unit: (String::new(), 1.0),
            si_unit: "W".into(),
        });
    }
    metered
}

/// ∫ |y| dt of a line through points.
fn magnitude(t: &[f64], y: &[f64]) -> f64 {
    let steps = t.windows(2).zip(y.windows(2));
    let area = |(t, y): (&[f64], &[f64])| {
        let (h, a, b) = (t[1] - t[0], y[0], y[1]);
        match a * b < 0.0 {
            // It crosses 0 at a part a/(a − b) of the step.
            true => 0.5 * h * (a * a + b * b) / (a - b).abs(),
            false => 0.5 * h * (a + b).abs(),
        }
    };
    steps.map(area).sum()
}

impl Activities {
    /// Those of a run of [`metered`]: between its rows powers are lines.
    pub fn of(graph: &BondGraph, trace: &Trace) -> Activities {
        let first = trace.columns.len().saturating_sub(graph.bonds.len());
        let powers = trace.columns[first..].iter();
        let bonds: Vec<f64> = powers.map(|power| magnitude(trace.time(), power)).collect();
        let of =
            |id: VertexId| graph.vertex(id).bonds.iter().map(|b| bonds[b.index()]).sum::<f64>();
        let counts = |id: &VertexId| {
            matches!(
                graph.vertex(*id).law,
                Law::Dissipator(_) | Law::Store { .. } | Law::Rate { .. } | Law::Field(_)
            )
        };
        let ids = || graph.vertex_ids().filter(counts);
        let total: f64 = ids().map(of).sum();
        let part = |joules: f64| if total > 0.0 { joules / total } else { 0.0 };
        let mut elements: Vec<Activity> = ids()
            .map(|element| {
                let joules = of(element);
                Activity { element, joules, index: part(joules) }
            })
            .collect();
        elements.sort_by(|a, b| b.joules.total_cmp(&a.joules));
        Activities { elements, bonds, total }
    }

    /// How many of the most active elements make up a part of all activity.
    pub fn kept(&self, part: f64) -> usize {
        let mut sum = 0.0;
        let enough = self.elements.iter().position(|element| {
            sum += element.joules;
            sum >= part * self.total
        });
        enough.map_or(self.elements.len(), |last| last + 1)
    }

    /// What is to be taken out of a model so that an element is out of it: the element, or the junction that it hangs on
    /// where the flow through that is small, not the element's effort. `out` says which elements are to go.
    pub fn takes(
        &self,
        graph: &BondGraph,
        element: VertexId,
        out: &dyn Fn(VertexId) -> bool,
    ) -> VertexId {
        let beyond = |bond: &BondId, from: VertexId| {
            let bond = graph.bond(*bond);
            if bond.from.vertex == from { bond.to.vertex } else { bond.from.vertex }
        };
        let Some(own) = graph.vertex(element).bonds.first() else { return element };
        let junction = beyond(own, element);
        let vertex = graph.vertex(junction);
        if vertex.kind != "1" {
            return element;
        }
        let one_port = |id: VertexId| graph.vertex(id).bonds.len() == 1;
        let others = || vertex.bonds.iter().map(|bond| (bond, beyond(bond, junction)));
        let through: Vec<f64> = others()
            .filter(|(_, id)| !one_port(*id))
            .map(|(bond, _)| self.bonds[bond.index()])
            .collect();
        let all_out = others().filter(|(_, id)| one_port(*id)).all(|(_, id)| out(id));
        let most = through.iter().copied().fold(0.0, f64::max);
        match through.len() > 1 && all_out && self.bonds[own.index()] > MUCH * most {
            true => junction,
            false => element,
        }
    }
}
