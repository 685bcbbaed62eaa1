//! Which devices stand for an element: decided from its law and its causality, before anything is placed.

use super::names::Namer;
use crate::bond::causality::Causality;
use crate::bond::graph::{
    BondGraph, Dissipation, End, Expr, Field, Law, Leaf, Modulus, ParameterId, Power, SignalId,
    SignalLaw, SignalOrigin, Storage, StoreLaw, Stroke, Variable, VertexId,
};
use crate::expr::{Binary, Function, Node};
use crate::netlist::Name;

/// An integrator: a node whose voltage is the integral of what `feed` injects into 1 F.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Integrator {
    /// The node.
    pub node: Name,
    /// The capacitor of 1 F from the node to ground.
    pub capacitor: Name,
    /// The source that drives it.
    pub feed: Name,
}

/// The value of a source.
#[derive(Clone, Debug, PartialEq)]
pub enum SourceValue {
    /// Parameters only.
    Constant(Expr),
    /// A waveform that stands in the source itself.
    Waveform(SignalId),
    /// The voltage of a signal's node.
    Copy(SignalId),
    /// Anything else.
    Law(Expr),
}

/// Devices of an element. Voltage sources stand with + at the port's + terminal, so that their current is the
/// element's own flow.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs)]
pub enum Form {
    /// A junction.
    Junction,
    /// A detector of effort.
    Open,
    /// A detector of flow: a source of 0 V.
    Short {
        device: Name,
    },
    EffortSource {
        device: Name,
        value: SourceValue,
    },
    FlowSource {
        device: Name,
        value: SourceValue,
    },
    Resistor {
        device: Name,
        value: Expr,
    },
    /// e = law.
    EffortLaw {
        device: Name,
        law: Expr,
    },
    /// f = law.
    FlowLaw {
        device: Name,
        law: Expr,
    },
    Capacitor {
        device: Name,
        value: Expr,
    },
    Inductor {
        device: Name,
        value: Expr,
    },
    /// Compliance: q on an integrator, e = law.
    StoredEffort {
        device: Name,
        state: Integrator,
        law: Expr,
    },
    /// Inertia: p on an integrator, f = law.
    StoredFlow {
        device: Name,
        state: Integrator,
        law: Expr,
    },
    /// Compliance: `feed` holds q = law on the integrator's node, and its current, dq/dt, is the port's flow.
    ChargeLaw {
        device: Name,
        state: Integrator,
        law: Expr,
    },
    /// Inertia: `feed` holds p = law on the integrator's node, and its current, dp/dt, is the port's effort.
    FluxLaw {
        device: Name,
        state: Integrator,
        law: Expr,
    },
    /// Compliance: e on an integrator of the rate.
    RateEffort {
        device: Name,
        state: Integrator,
        rate: Expr,
    },
    /// Inertia: f on an integrator of the rate.
    RateFlow {
        device: Name,
        state: Integrator,
        rate: Expr,
    },
    /// Port `lead` is a voltage source, m times the other port's effort; the other port's flow follows its current.
    Transformer {
        lead: usize,
        effort: Name,
        flow: Name,
        modulus: Expr,
        modulated: bool,
    },
    /// Each port a voltage source by the other's flow.
    GyratorEfforts {
        devices: [Name; 2],
        modulus: Expr,
        modulated: bool,
    },
    /// Each port a current source by the other's effort.
    GyratorFlows {
        devices: [Name; 2],
        modulus: Expr,
        modulated: bool,
    },
    /// A field: the form of each port, and what couples them besides.
    Field {
        ports: Vec<Form>,
        couplings: Vec<Coupling>,
    },
}

/// A coupling of the inductors of two ports: M = k·√(L1·L2).
#[derive(Clone, Debug, PartialEq)]
pub struct Coupling {
    /// The K device.
    pub device: Name,
    /// The inductors.
    pub inductors: [Name; 2],
    /// The two ports, from 0.
    pub ports: [usize; 2],
    /// k.
    pub value: Expr,
}

/// The form at a port.
pub fn form_at(forms: &[Form], end: End) -> &Form {
    let form = &forms[end.vertex.index()];
    match form {
        Form::Field { ports, .. } => ports.get(end.port as usize).unwrap_or(form),
        _ => form,
    }
}

/// Whether an expression speaks of parameters alone.
pub fn is_constant(expr: &Expr) -> bool {
    let mut constant = true;
    expr.leaves(&mut |leaf, _| constant &= matches!(leaf, Leaf::Parameter(_)));
    constant
}

/// The value of an expression of parameters alone.
pub fn constant_value(graph: &BondGraph, expr: &Expr) -> Option<f64> {
    is_constant(expr).then(|| {
        expr.evaluate(&mut |leaf| match leaf {
            Leaf::Parameter(ParameterId(id)) => graph.parameters[*id as usize].value,
            _ => f64::NAN,
        })
    })
}

/// How often each signal is spoken of: by laws and signals, and by observed columns.
pub struct Uses {
    /// By laws of elements and by other signals.
    pub laws: Vec<usize>,
    /// By observed columns.
    pub observed: Vec<usize>,
}

impl Uses {
    /// Counts them.
    pub fn count(graph: &BondGraph) -> Uses {
        let mut uses =
            Uses { laws: vec![0; graph.signals.len()], observed: vec![0; graph.signals.len()] };
        let count = |expr: &Expr, counts: &mut Vec<usize>| {
            expr.leaves(&mut |leaf, _| {
                if let Leaf::Signal(id) = leaf {
                    counts[id.index()] += 1;
                }
            });
        };
        for vertex in &graph.vertices {
            vertex.law.expressions(&mut |expr| count(expr, &mut uses.laws));
        }
        for signal in &graph.signals {
            if let Some(expr) = signal.law.expression() {
                count(expr, &mut uses.laws);
            }
        }
        for observation in &graph.experiment.observe {
            count(&observation.expr, &mut uses.observed);
        }
        uses
    }
}

/// The form of each vertex. The match over [`Law`] is complete: a new law must say here what it becomes.
pub fn choose(
    graph: &BondGraph,
    causality: &Causality,
    uses: &Uses,
    namer: &mut Namer,
) -> Vec<Form> {
    graph.vertex_ids().map(|id| form(graph, causality, uses, namer, id)).collect()
}

fn form(
    graph: &BondGraph,
    causality: &Causality,
    uses: &Uses,
    namer: &mut Namer,
    id: VertexId,
) -> Form {
    let vertex = graph.vertex(id);
    let name = vertex.name.as_str();
    match &vertex.law {
        Law::Zero | Law::One => Form::Junction,
        Law::Source { sets: Power::Flow, detector: true, .. } => Form::Open,
        Law::Source { sets: Power::Effort, detector: true, .. } => {
            Form::Short { device: namer.device('V', name) }
        }
        Law::Source { sets, value, .. } => {
            let value = source_value(graph, uses, *sets, value);
            let native = matches!(value, SourceValue::Constant(_) | SourceValue::Waveform(_));
            match (sets, native) {
                (Power::Effort, true) => {
                    Form::EffortSource { device: namer.device('V', name), value }
                }
                (Power::Effort, false) => {
                    Form::EffortSource { device: namer.device('E', name), value }
                }
                (Power::Flow, true) => Form::FlowSource { device: namer.device('I', name), value },
                (Power::Flow, false) => Form::FlowSource { device: namer.device('G', name), value },
            }
        }
        Law::Dissipator(law) => dissipator(namer, name, law),
        Law::Store { kind, law, .. } => store(namer, name, *kind, law),
        Law::Rate { kind: Storage::Compliance, rate, .. } => Form::RateEffort {
            device: namer.device('E', name),
            state: integrator(namer, name, "e", 'G'),
            rate: rate.clone(),
        },
        Law::Rate { kind: Storage::Inertia, rate, .. } => Form::RateFlow {
            device: namer.device('G', name),
            state: integrator(namer, name, "f", 'G'),
            rate: rate.clone(),
        },
        Law::Field(field) => self::field(namer, name, field),
        Law::Transformer(modulus) => {
            let (mut lead, mut value) = match modulus {
                Modulus::Ratio(value) => (0, value.clone()),
                Modulus::Gain(value) => (1, value.clone()),
            };
            // A constant may be turned round, so that the voltage source stands where causality imposes the effort.
            if invertible(graph, &value) && effort_imposed(graph, causality, id, lead) == Some(true)
            {
                lead = 1 - lead;
                value = reciprocal(&value);
            }
            let modulated = !is_constant(&value);
            let flow = namer.device(if modulated { 'G' } else { 'F' }, name);
            Form::Transformer {
                lead,
                effort: namer.device('E', name),
                flow,
                modulus: value,
                modulated,
            }
        }
        Law::Gyrator(modulus) => {
            let (mut efforts, mut value) = match modulus {
                Modulus::Ratio(value) => (true, value.clone()),
                Modulus::Gain(value) => (false, value.clone()),
            };
            if invertible(graph, &value) && effort_imposed(graph, causality, id, 0) == Some(efforts)
            {
                efforts = !efforts;
                value = reciprocal(&value);
            }
            let modulated = !is_constant(&value);
            let letter = match (efforts, modulated) {
                (true, false) => 'H',
                (true, true) => 'E',
                (false, _) => 'G',
            };
            let devices = [1, 2].map(|port| namer.device(letter, &format!("{name}_{port}")));
            if efforts {
                Form::GyratorEfforts { devices, modulus: value, modulated }
            } else {
                Form::GyratorFlows { devices, modulus: value, modulated }
            }
        }
    }
}

fn dissipator(namer: &mut Namer, name: &str, law: &Dissipation) -> Form {
    let own = |power| Expr::leaf(Leaf::Own(Variable::Power(power)));
    match law {
        Dissipation::Linear(value) if is_constant(value) => {
            Form::Resistor { device: namer.device('R', name), value: value.clone() }
        }
        Dissipation::Linear(value) => Form::EffortLaw {
            device: namer.device('E', name),
            law: value.clone().binary(Binary::Multiply, own(Power::Flow)),
        },
        Dissipation::Effort(law) => {
            Form::EffortLaw { device: namer.device('E', name), law: law.clone() }
        }
        Dissipation::Flow(law) => {
            Form::FlowLaw { device: namer.device('G', name), law: law.clone() }
        }
    }
}

fn store(namer: &mut Namer, name: &str, kind: Storage, law: &StoreLaw) -> Form {
    match (law, kind) {
        (StoreLaw::Linear(value), Storage::Compliance) if is_constant(value) => {
            Form::Capacitor { device: namer.device('C', name), value: value.clone() }
        }
        (StoreLaw::Linear(value), Storage::Inertia) if is_constant(value) => {
            Form::Inductor { device: namer.device('L', name), value: value.clone() }
        }
        (StoreLaw::Linear(value), _) => {
            let stored = Expr::leaf(Leaf::Own(Variable::Stored));
            stored_form(namer, name, kind, stored.binary(Binary::Divide, value.clone()))
        }
        (StoreLaw::OfStored(law), _) => stored_form(namer, name, kind, law.clone()),
        (StoreLaw::OfPower(law), Storage::Compliance) => Form::ChargeLaw {
            device: namer.device('F', name),
            state: integrator(namer, name, "q", 'E'),
            law: law.clone(),
        },
        (StoreLaw::OfPower(law), Storage::Inertia) => Form::FluxLaw {
            device: namer.device('H', name),
            state: integrator(namer, name, "p", 'E'),
            law: law.clone(),
        },
    }
}

/// A constant matrix of inertias is a set of coupled inductors; the ports of any other field have the forms that the
/// same laws have by themselves.
fn field(namer: &mut Namer, name: &str, field: &Field) -> Form {
    let port_name = |port: usize| format!("{name}_{}", port + 1);
    let inertias = |rows: &&Vec<Vec<Expr>>| {
        let inertia = |law| matches!(law, &Law::Store { kind: Storage::Inertia, .. });
        field.ports.iter().all(inertia) && rows.iter().flatten().all(is_constant)
    };
    let Some(rows) = field.matrix.as_ref().filter(inertias) else {
        let ports = field.ports.iter().enumerate().map(|(port, law)| match law {
            Law::Store { kind, law, .. } => store(namer, &port_name(port), *kind, law),
            Law::Dissipator(law) => dissipator(namer, &port_name(port), law),
            _ => Form::Open,
        });
        return Form::Field { ports: ports.collect(), couplings: vec![] };
    };
    let own: Vec<&Expr> = rows.iter().enumerate().filter_map(|(k, row)| row.get(k)).collect();
    let inductors: Vec<Name> =
        (0..own.len()).map(|port| namer.device('L', &port_name(port))).collect();
    let mut couplings = vec![];
    for second in 1..own.len() {
        for first in 0..second {
            let Some(mutual) = rows[first].get(second).filter(|m| m.as_number() != Some(0.0))
            else {
                continue;
            };
            let product = own[first].clone().binary(Binary::Multiply, own[second].clone());
            let root = Expr::call(Function::Sqrt, vec![product]);
            let value = mutual.clone().binary(Binary::Divide, root);
            let value = value.constant().map_or(value, Expr::number);
            couplings.push(Coupling {
                device: namer.device('K', &format!("{}_{}", port_name(first), second + 1)),
                inductors: [inductors[first], inductors[second]],
                ports: [first, second],
                value,
            });
        }
    }
    let ports = inductors.into_iter().zip(own);
    let ports = ports.map(|(device, value)| Form::Inductor { device, value: value.clone() });
    Form::Field { ports: ports.collect(), couplings }
}

fn stored_form(namer: &mut Namer, name: &str, kind: Storage, law: Expr) -> Form {
    match kind {
        Storage::Compliance => Form::StoredEffort {
            device: namer.device('E', name),
            state: integrator(namer, name, "q", 'F'),
            law,
        },
        Storage::Inertia => Form::StoredFlow {
            device: namer.device('G', name),
            state: integrator(namer, name, "p", 'G'),
            law,
        },
    }
}

/// Names of an integrator for a variable of an element.
fn integrator(namer: &mut Namer, name: &str, variable: &str, feed: char) -> Integrator {
    let full = format!("{name}_{variable}");
    Integrator {
        node: namer.node(&full),
        capacitor: namer.device('C', &full),
        feed: namer.device(feed, &full),
    }
}

fn source_value(graph: &BondGraph, uses: &Uses, sets: Power, value: &Expr) -> SourceValue {
    if is_constant(value) {
        return SourceValue::Constant(value.clone());
    }
    let Node::Leaf(Leaf::Signal(id)) = &*value.node else {
        return SourceValue::Law(value.clone());
    };
    // A waveform that nothing else needs stands in the source. An observed one is then read as the source's voltage,
    // for which a source of flow has no name. What an instance is given stands outside it.
    let outside = {
        let signal = &graph.signals[id.index()];
        let around = signal.name.rsplit_once('.').map_or("", |(around, _)| around);
        let told = graph.tree.get(signal.home as usize);
        signal.origin == SignalOrigin::Input && told.is_some_and(|teller| teller.name != around)
    };
    let native = !outside
        && matches!(graph.signals[id.index()].law, SignalLaw::Waveform(_))
        && uses.laws[id.index()] == 1
        && (sets == Power::Effort || uses.observed[id.index()] == 0);
    if native { SourceValue::Waveform(*id) } else { SourceValue::Copy(*id) }
}

/// Whether a modulus is a constant other than 0.
fn invertible(graph: &BondGraph, value: &Expr) -> bool {
    constant_value(graph, value).is_some_and(|value| value != 0.0)
}

/// Whether the bond at a port imposes the effort on the element; `None` where causality is open.
fn effort_imposed(
    graph: &BondGraph,
    causality: &Causality,
    vertex: VertexId,
    port: usize,
) -> Option<bool> {
    let id = *graph.vertex(vertex).bonds.get(port)?;
    let bond = graph.bond(id);
    let stroke = (*causality.strokes.get(id.index())?)?;
    let at_head = bond.to.vertex == vertex && bond.to.port as usize == port;
    Some(at_head == (stroke == Stroke::AtTo))
}

/// 1/x, without a double fraction.
fn reciprocal(expr: &Expr) -> Expr {
    match &*expr.node {
        Node::Binary(Binary::Divide, a, b) if a.as_number() == Some(1.0) => b.clone(),
        Node::Binary(Binary::Divide, a, b) => b.clone().binary(Binary::Divide, a.clone()),
        _ => Expr::number(1.0).binary(Binary::Divide, expr.clone()),
    }
}
