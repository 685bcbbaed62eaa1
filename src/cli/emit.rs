//! `--emit STAGE`: each noun between the text and the result, as text, so that it can be looked at.

use super::table::Table;
use crate::bond::graph::BondGraph;
use crate::bond::words::{expression as graph_expression, law, signal_law};
use crate::circuit::stamps::{self, Stamps};
use crate::circuit::{self, Circuit, DeviceKind, LawOf, Probe, Quantity, Waveform};
use crate::expr::print::{number, print};
use crate::expr::{Dialect, Expr};

/// The stages that can be looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Stage {
    /// Parameters, signals, elements, bonds, after elaboration.
    Graph,
    /// Strokes, states, loops.
    Causality,
    /// The netlist.
    Netlist,
    /// Flat devices between nodes, numbers for parameters.
    Circuit,
    /// Unknowns and equations.
    System,
}

fn expression<L>(expr: &Expr<L>, leaf: &dyn Fn(&L) -> String) -> String {
    print(expr, Dialect::Bond, &mut |name| leaf(name))
}

/// The flat graph.
pub fn graph(graph: &BondGraph) -> String {
    let text = |expr| graph_expression(graph, expr);
    let mut parameters = Table::new(&["parameter", "value", "given as"]);
    for parameter in &graph.parameters {
        parameters.row([parameter.name.clone(), number(parameter.value), text(&parameter.expr)]);
    }
    let mut signals = Table::new(&["signal", "law"]);
    for signal in &graph.signals {
        signals.row([signal.name.clone(), signal_law(graph, &signal.law)]);
    }
    let mut vertices = Table::new(&["element", "law"]);
    for vertex in &graph.vertices {
        vertices.row([format!("{}:{}", vertex.kind, vertex.name), law(graph, &vertex.law)]);
    }
    let mut bonds = Table::new(&["bond", "domain"]);
    for id in graph.bond_ids() {
        bonds.row([graph.bond_name(id), graph.bond(id).domain.name().to_string()]);
    }
    let mut observed = Table::new(&["observed", "value", "unit"]);
    for item in &graph.experiment.observe {
        let unit = if item.unit.0.is_empty() { &item.si_unit } else { &item.unit.0 };
        observed.row([item.name.clone(), text(&item.expr), unit.clone()]);
    }
    let seconds = |value: Option<f64>| value.map_or("-".into(), number);
    let experiment = &graph.experiment;
    let mut run = Table::new(&["run", "value"]);
    run.row(["until".into(), seconds(experiment.until)]);
    run.row(["step".into(), seconds(experiment.step)]);
    for (key, value) in &experiment.options {
        run.row([key.clone(), value.clone()]);
    }
    let tables = [parameters, signals, vertices, bonds, observed, run];
    let tables: Vec<String> =
        tables.iter().filter(|table| !table.is_empty()).map(Table::to_text).collect();
    format!("graph {}\n\n{}", graph.name, tables.join("\n"))
}

/// The flat circuit.
pub fn circuit(circuit: &Circuit) -> String {
    let node = |id: circuit::NodeId| {
        circuit.nodes.get(id.0 as usize).map_or("?", |node| node.name.as_str()).to_string()
    };
    let device = |id: circuit::DeviceId| {
        circuit.devices.get(id.0 as usize).map_or("?", |d| &*d.name).to_string()
    };
    let text = |expr: &circuit::Expr| {
        expression(expr, &|leaf| match leaf {
            circuit::Leaf::Voltage(a, b) if b.0 == 0 => format!("v({})", node(*a)),
            circuit::Leaf::Voltage(a, b) => format!("v({}, {})", node(*a), node(*b)),
            circuit::Leaf::Current(id) => format!("i({})", device(*id)),
            circuit::Leaf::Time => "time".into(),
            circuit::Leaf::Capacitance(id) => format!("n({}:cd)", device(*id)),
            circuit::Leaf::Part(part, Probe::Voltage(a, b)) => {
                format!("{}(v({}, {}))", part.name(), node(*a), node(*b))
            }
            circuit::Leaf::Part(part, Probe::Current(id)) => {
                format!("{}(i({}))", part.name(), device(*id))
            }
        })
    };
    let start =
        |initial: &Option<f64>| initial.map_or(String::new(), |v| format!(" ic={}", number(v)));
    let mut table = Table::new(&["device", "nodes", "value"]);
    for row in &circuit.devices {
        let nodes: Vec<String> = row.nodes.iter().map(|id| node(*id)).collect();
        let value = match &row.kind {
            DeviceKind::Resistor { resistance } => number(*resistance),
            DeviceKind::Capacitor { capacitance: value, initial }
            | DeviceKind::Inductor { inductance: value, initial } => {
                number(*value) + &start(initial)
            }
            DeviceKind::Mutual { inductors: [a, b], coupling } => {
                format!("{} {} {}", device(*a), device(*b), number(*coupling))
            }
            DeviceKind::VoltageSource { waveform, parts }
            | DeviceKind::CurrentSource { waveform, parts } => {
                let dc = parts.dc.map_or(String::new(), |dc| format!(" dc={}", number(dc)));
                let ac = parts.ac.map_or(String::new(), |ac| {
                    format!(" ac={} at {} deg", number(ac.magnitude), number(ac.phase.to_degrees()))
                });
                self::waveform(waveform) + &dc + &ac
            }
            DeviceKind::Vcvs { gain, control: [a, b] }
            | DeviceKind::Vccs { gain, control: [a, b] } => {
                format!("{} * v({}, {})", number(*gain), node(*a), node(*b))
            }
            DeviceKind::Cccs { gain, control } | DeviceKind::Ccvs { gain, control } => {
                format!("{} * i({})", number(*gain), device(*control))
            }
            DeviceKind::BehaviouralVoltage { law } => format!("v = {}", text(law)),
            DeviceKind::BehaviouralCurrent { law } => format!("i = {}", text(law)),
            DeviceKind::Switch { control, on, off, on_resistance, off_resistance, .. } => format!(
                "switch by {}: on above {} ({} Ohm), off below {} ({} Ohm)",
                text(control),
                number(*on),
                number(*on_resistance),
                number(*off),
                number(*off_resistance)
            ),
            DeviceKind::Line { impedance, delay, .. } => {
                format!("line of {} Ohm, {} s", number(*impedance), number(*delay))
            }
            DeviceKind::Hold { period, round } => {
                format!("sample every {} s, round {round}", number(*period))
            }
            DeviceKind::Diode { model, instance } => format!(
                "diode is={} area={} at {} C",
                number(model.saturation_current),
                number(instance.area * instance.multiplicity),
                number(instance.temperature)
            ),
            DeviceKind::BehaviouralResistor { law } => format!("v = ({}) i", text(law)),
            DeviceKind::BehaviouralCapacitor { law, law_of, initial } => match law_of {
                LawOf::Stored => format!("q = {}", text(law)) + &start(initial),
                LawOf::Factor => format!("i = ({}) dv/dt", text(law)) + &start(initial),
            },
            DeviceKind::BehaviouralInductor { law, law_of, initial } => match law_of {
                LawOf::Stored => format!("flux = {}", text(law)) + &start(initial),
                LawOf::Factor => format!("v = ({}) di/dt", text(law)) + &start(initial),
            },
            DeviceKind::CrossedSwitch { control, above, below, .. } => format!(
                "switch by {}: on from {} upward, off from {} downward",
                text(control),
                number(*below),
                number(*above)
            ),
            DeviceKind::SmoothSwitch(switch) => format!(
                "switch by {}: smoothly from off at {} to on at {}",
                text(&switch.control),
                number(switch.off),
                number(switch.on)
            ),
            DeviceKind::Quantity(quantity) => match quantity {
                Quantity::Derivative { law } => format!("d/dt of {}", text(law)),
                Quantity::Integral { law, initial, .. } => {
                    format!("integral of {} from {}", text(law), number(*initial))
                }
                Quantity::Delay { law, by } => {
                    format!("{} delayed by {} s", text(law), number(*by))
                }
                Quantity::Signal { waveform } => self::waveform(waveform),
            },
        };
        table.row([row.name.to_string(), nodes.join(" "), value]);
    }
    let mut outputs = Table::new(&["output", "value"]);
    for output in &circuit.outputs {
        outputs.row([output.name.clone(), text(&output.expr)]);
    }
    let mut rest = String::new();
    for (node_id, value) in &circuit.initial {
        rest += &format!("initially v({}) = {}\n", node(*node_id), number(*value));
    }
    for analysis in &circuit.analyses {
        rest += &format!("{analysis:?}\n");
    }
    for (key, value) in &circuit.options {
        rest += &format!("option {key} = {value}\n");
    }
    format!("circuit {}\n\n{}\n{}\n{rest}", circuit.title, table.to_text(), outputs.to_text())
}

fn waveform(waveform: &Waveform) -> String {
    match waveform {
        Waveform::Constant(value) => number(*value),
        Waveform::Pwl(points) => {
            let points: Vec<String> =
                points.iter().map(|(t, y)| format!("{} {}", number(*t), number(*y))).collect();
            format!("pwl({})", points.join(" "))
        }
        other => format!("{other:?}"),
    }
}

/// Unknowns and equations, as the simulator gets them.
pub fn system(stamps: &Stamps) -> String {
    let unknown = |id: stamps::UnknownId| stamps.unknowns[id.0 as usize].name.to_string();
    let text = |law: &stamps::Law| {
        expression(law, &|leaf| match leaf {
            stamps::Leaf::Unknown(id) => unknown(*id),
            stamps::Leaf::Rate(k) => format!("der(Q{k})"),
            stamps::Leaf::Time => "time".into(),
            stamps::Leaf::Mode(k) => format!("mode{k}"),
        })
    };
    let name = |id: circuit::DeviceId| {
        stamps.devices.get(id.0 as usize).map_or("?", |d| &*d.name).to_string()
    };
    let mut left = vec![vec![]; stamps.unknowns.len()];
    let mut right = vec![vec![]; stamps.unknowns.len()];
    for (row, column, value) in &stamps.conductances {
        left[row.0 as usize].push(term(*value, &unknown(*column)));
    }
    for stamp in &stamps.laws {
        for (row, factor) in &stamp.into {
            left[row.0 as usize].push(term(*factor, &format!("({})", text(&stamp.law))));
        }
    }
    for (k, charge) in stamps.charges.iter().enumerate() {
        for (row, factor) in &charge.into {
            left[row.0 as usize].push(term(*factor, &format!("der(Q{k})")));
        }
    }
    for source in &stamps.sources {
        for (row, factor) in &source.into {
            right[row.0 as usize].push(term(*factor, &name(source.device)));
        }
    }
    let sum = |terms: &Vec<String>| if terms.is_empty() { "0".into() } else { terms.join(" + ") };
    let mut out = String::from("equations\n");
    for (row, unknown) in stamps.unknowns.iter().enumerate() {
        out += &format!("{}: {} = {}\n", unknown.name, sum(&left[row]), sum(&right[row]));
    }
    out += "\ncharges and fluxes\n";
    for (k, charge) in stamps.charges.iter().enumerate() {
        let mut terms: Vec<String> =
            charge.linear.iter().map(|(id, value)| term(*value, &unknown(*id))).collect();
        terms.extend(charge.law.iter().map(text));
        let start = charge.initial.map_or(String::new(), |q| format!(", at first {}", number(q)));
        out += &format!("Q{k} of {} = {}{start}\n", name(charge.device), sum(&terms));
    }
    if !stamps.sources.is_empty() {
        out += "\nsources\n";
    }
    for source in &stamps.sources {
        out += &format!("{} = {}\n", name(source.device), waveform(&source.waveform));
    }
    for (k, mode) in stamps.modes.iter().enumerate() {
        let control = text(&mode.control);
        let (on, off) = (number(mode.on), number(mode.off));
        out += &format!(
            "mode{k} of {}: 1 above {on}, 0 below {off} of {control}\n",
            name(mode.device)
        );
    }
    out += "\noutputs\n";
    for (name, law) in &stamps.outputs {
        out += &format!("{name} = {}\n", text(law));
    }
    out
}

fn term(factor: f64, what: &str) -> String {
    if factor == 1.0 {
        what.to_string()
    } else if factor == -1.0 {
        format!("-{what}")
    } else {
        format!("{}*{what}", number(factor))
    }
}
