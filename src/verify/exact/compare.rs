//! One draw: both systems solved, and everything that must be equal compared.

use super::bonds::{Alike, Bonds, Place};
use super::draw::{Draw, Modular, decimal};
use super::floats::Sides;
use super::form::Trouble;
use super::text::{Text, port_name};
use super::uncut::{self, Uncut};
use super::wires::Wires;
use crate::bond::graph::{
    BondGraph, BondId, Law, Memory, ParameterId, Power, SignalLaw, SignalOrigin, Storage,
};
use crate::circuit::{DeviceKind, Leaf as CircuitLeaf};
use crate::expr::Node;
use crate::netlist::flatten::scope::TOP;
use crate::netlist::{Element, Expr};
use crate::translate::portable;
use crate::verify::report::Mismatch;
use std::collections::HashMap;

/// What a draw gave.
#[derive(Clone, Debug, Default)]
pub struct Drawn {
    /// Unknowns of the bond graph and of the circuit.
    pub unknowns: [usize; 2],
    /// Multiplications in the eliminations of both systems.
    pub operations: usize,
    /// Variables that were compared.
    pub variables: usize,
    /// Laws and signals that were cut and compared.
    pub laws: usize,
    /// How often any of them was tried once more, with some of the laws that stand in it left as they are.
    pub tries: usize,
    /// Variables that differ.
    pub mismatches: Vec<Mismatch>,
    /// Laws whose text or arguments differ.
    pub wrong_laws: Vec<Mismatch>,
}

/// Why a draw gave nothing.
#[derive(Clone, Debug)]
pub enum Nothing {
    /// It divides by 0: another draw may not.
    Zero,
    /// One of the systems is singular; what is not determined, and which laws or devices depend on each other.
    #[allow(missing_docs)]
    Singular { circuit: bool, unknowns: Vec<String>, of: Vec<String> },
    /// Something has no value in any draw.
    Unknown(String),
}

impl From<Trouble> for Nothing {
    fn from(trouble: Trouble) -> Nothing {
        match trouble {
            Trouble::Zero => Nothing::Zero,
            Trouble::Nonlinear => Nothing::Unknown("a value that must be a number is none".into()),
            Trouble::Unknown(what) => Nothing::Unknown(what),
        }
    }
}

/// Draws once.
///
/// # Errors
/// Why there is nothing to compare.
pub fn draw<F: Modular>(graph: &BondGraph, text: &Text<'_>, draw: Draw) -> Result<Drawn, Nothing> {
    // A parameter that the text does not name is the number that it is.
    let literal: Vec<bool> = text.parameters.iter().map(Option::is_none).collect();
    let mut bonds = Bonds::<F>::new(graph, draw, &literal, Alike::default())?;
    let (mut theirs, mut operations) = solution(&bonds)?;
    let alike = bonds.alike(&theirs)?;
    if !alike.is_empty() {
        bonds = Bonds::new(graph, draw, &literal, alike)?;
        let (again, more) = solution(&bonds)?;
        (theirs, operations) = (again, operations + more);
    }
    let wires = Wires::new(text, &bonds)?;
    let mut drawn =
        Drawn { unknowns: [bonds.system.unknowns, wires.system.unknowns], ..Drawn::default() };
    for (device, why) in &wires.strange {
        drawn.wrong_laws.push(Mismatch::card(text, *device, why));
    }
    let ours = match wires.system.solve() {
        Ok((ours, more)) => {
            drawn.operations = operations + more;
            ours
        }
        // What cannot be read is the better message.
        Err(_) if !drawn.wrong_laws.is_empty() => return Ok(drawn),
        Err(found) => {
            let unknowns = found.unknowns.iter().map(|column| wires.name(*column)).collect();
            return Err(Nothing::Singular { circuit: true, unknowns, of: vec![] });
        }
    };
    let cut = bonds.cut_values(&theirs)?;
    let sides = Sides { bonds: &bonds, theirs: &theirs, wires: &wires, ours: &ours };
    parameters(&bonds, &wires, &mut drawn)?;
    variables(&sides, &cut, &mut drawn)?;
    columns(&sides, &cut, &mut drawn)?;
    laws(&sides, &cut, &mut drawn)?;
    memories(&sides, &mut drawn)?;
    Ok(drawn)
}

/// The solution of the bond graph's equations, and the multiplications that it took.
///
/// # Errors
/// What is singular.
pub fn solution<F: Modular>(bonds: &Bonds<F>) -> Result<(Vec<F>, usize), Nothing> {
    bonds.system.solve().map_err(|found| {
        let (unknowns, of) = bonds.explain(&found);
        Nothing::Singular { circuit: false, unknowns, of }
    })
}

/// Parameters that others define.
fn parameters<F: Modular>(
    bonds: &Bonds<F>,
    wires: &Wires<F>,
    drawn: &mut Drawn,
) -> Result<(), Nothing> {
    for (k, parameter) in bonds.graph.parameters.iter().enumerate() {
        let mut others = 0;
        parameter.expr.leaves(&mut |_, _| others += 1);
        if others == 0 {
            continue;
        }
        let written = wires.written_parameter(ParameterId(k as u32))?;
        let known = wires.text.parameters.get(k).is_some_and(Option::is_some);
        let why = match written {
            Some(written) if Some(&written) != bonds.parameters.get(k) => {
                "it is computed otherwise than in the bond graph"
            }
            // What other simulators cannot compute stands as a number.
            None if known && portable(&parameter.expr) => {
                "it is a number, where the bond graph computes it from others"
            }
            _ => {
                drawn.variables += usize::from(written.is_some());
                continue;
            }
        };
        drawn.variables += 1;
        drawn.mismatches.push(Mismatch::of(&parameter.name, why));
    }
    Ok(())
}

/// Every variable of the map, observed ones apart.
fn variables<F: Modular>(
    sides: &Sides<F>,
    cut: &[HashMap<u64, F>],
    drawn: &mut Drawn,
) -> Result<(), Nothing> {
    let values = values(sides.bonds, sides.theirs);
    for variable in sides.wires.text.variables.iter().filter(|variable| !variable.observed) {
        let Some((value, factor)) = values.get(&variable.bg).copied() else { continue };
        drawn.variables += 1;
        if !(variable.factor / factor - 1.0).abs().le(&(4.0 * f64::EPSILON)) {
            let why = format!("its factor is {:e}, not {factor:e}", variable.factor);
            drawn.mismatches.push(Mismatch::of(&variable.bg, &why));
        }
        let expr = match &variable.expr {
            Ok(expr) => expr,
            Err(missing) => {
                let why = format!("the text has no `{missing}`");
                drawn.mismatches.push(Mismatch::of(&variable.bg, &why));
                continue;
            }
        };
        if !equals(sides, expr, value, cut, &mut drawn.tries)? {
            drawn.mismatches.push(Mismatch::of(&variable.bg, "it differs"));
        }
    }
    Ok(())
}

/// Whether an expression of the text has a value, as it stands or with laws that it writes out cut.
fn equals<F: Modular>(
    sides: &Sides<F>,
    expr: &Expr,
    value: F,
    cut: &[HashMap<u64, F>],
    tries: &mut usize,
) -> Result<bool, Nothing> {
    let mut found = || {
        let value_of = |cut: Option<&Uncut<F>>| sides.wires.value(TOP, expr, sides.ours, cut);
        Ok(value_of(None)? == value
            || uncut::has(cut, value, tries, &mut |cut| value_of(Some(cut)))?)
    };
    match found() {
        Err(Trouble::Zero) => Err(Nothing::Zero),
        found => Ok(found.unwrap_or(false)),
    }
}

const POWERS: [(char, Power); 2] = [('e', Power::Effort), ('f', Power::Flow)];

/// What makes a power variable of a bond SI, or what is stored of it.
fn unscaled(graph: &BondGraph, bond: BondId, power: Power) -> f64 {
    let domain = graph.bond(bond).domain;
    let scale = graph.scales.iter().find(|scale| scale.domain == domain);
    match (scale, power) {
        (None, _) => 1.0,
        (Some(scale), Power::Effort) => scale.factor,
        (Some(scale), Power::Flow) => 1.0 / scale.factor,
    }
}

/// Every variable of the bond graph by the name that the map gives it, and what makes it SI.
fn values<F: Modular>(bonds: &Bonds<F>, solution: &[F]) -> HashMap<String, (F, f64)> {
    let graph = bonds.graph;
    let mut values = HashMap::new();
    for id in graph.vertex_ids() {
        let vertex = graph.vertex(id);
        let name = &vertex.name;
        let Some(first) = vertex.bonds.first().copied() else { continue };
        let mut put = |name: String, form: super::form::Form<F>, bond, power| {
            values.insert(name, (form.at(solution), unscaled(graph, bond, power)));
        };
        match &vertex.law {
            Law::Zero => {
                put(format!("e({name})"), bonds.power(first, Power::Effort), first, Power::Effort)
            }
            Law::One => {
                put(format!("f({name})"), bonds.power(first, Power::Flow), first, Power::Flow)
            }
            Law::Transformer(_) | Law::Gyrator(_) => {
                for (port, bond) in (1..).zip(&vertex.bonds) {
                    for (letter, power) in POWERS {
                        put(
                            format!("{letter}({name}.{port})"),
                            bonds.power(*bond, power),
                            *bond,
                            power,
                        );
                    }
                }
            }
            _ => {
                for end in graph.law_ports(id) {
                    let Some(bond) = graph.bond_at(end) else { continue };
                    let name = port_name(graph, end);
                    let flow = match &vertex.law {
                        Law::Source { detector: false, .. } => bonds.power(bond, Power::Flow),
                        _ => bonds.at(end, Power::Flow),
                    };
                    put(
                        format!("e({name})"),
                        bonds.power(bond, Power::Effort),
                        bond,
                        Power::Effort,
                    );
                    put(format!("f({name})"), flow, bond, Power::Flow);
                    if let Some(kind) = graph.storage(end)
                        && let Ok(stored) = bonds.stored(end)
                    {
                        let letter = if kind == Storage::Inertia { 'p' } else { 'q' };
                        put(format!("{letter}({name})"), stored, bond, kind.integrates());
                    }
                }
            }
        }
    }
    let mut count: HashMap<String, usize> = HashMap::new();
    for bond in graph.bond_ids() {
        let name = graph.bond_name(bond);
        let nth = count.entry(name.clone()).and_modify(|n| *n += 1).or_insert(1);
        let name = if *nth > 1 { format!("{name} [{nth}]") } else { name };
        for (letter, power) in POWERS {
            let value = bonds.power(bond, power).at(solution);
            values.insert(format!("{letter}({name})"), (value, unscaled(graph, bond, power)));
        }
    }
    for (k, signal) in graph.signals.iter().enumerate() {
        if signal.origin != SignalOrigin::Hidden {
            let form = bonds.signal(crate::bond::graph::SignalId(k as u32));
            values.insert(signal.name.clone(), (form.at(solution), 1.0));
        }
    }
    values
}

/// The columns that the text's header asks for.
fn columns<F: Modular>(
    sides: &Sides<F>,
    cut: &[HashMap<u64, F>],
    drawn: &mut Drawn,
) -> Result<(), Nothing> {
    let (bonds, text) = (sides.bonds, sides.wires.text);
    let observe = &bonds.graph.experiment.observe;
    for observation in observe {
        let name = format!("column {}", observation.name);
        drawn.variables += 1;
        let mut given = text.header.columns.iter().zip(&text.columns);
        let Some((column, read)) = given.find(|(c, _)| c.name == observation.name) else {
            drawn.mismatches.push(Mismatch::of(&name, "the header has no such column"));
            continue;
        };
        let unit = match observation.unit.0.as_str() {
            "" => &observation.si_unit,
            unit => unit,
        };
        if *unit != column.unit {
            let why = format!("its unit is `{}`, not `{unit}`", column.unit);
            drawn.mismatches.push(Mismatch::of(&name, &why));
        }
        let factor = decimal::<F>(observation.unit.1).unwrap_or(F::ONE);
        let law = match observation.unit.1 {
            1.0 => observation.expr.clone(),
            factor => observation
                .expr
                .clone()
                .binary(crate::expr::Binary::Divide, crate::expr::Expr::number(factor)),
        };
        let value = bonds.value(&observation.expr, None, sides.theirs)? / factor;
        let holds = match read {
            Some(read) => {
                equals(sides, read, value, cut, &mut drawn.tries)?
                    || sides.same(&law, None, false, TOP, read)
            }
            None => false,
        };
        if !holds {
            drawn.mismatches.push(Mismatch::of(&name, "it differs"));
        }
    }
    for column in &text.header.columns {
        if !observe.iter().any(|observation| observation.name == column.name) {
            let name = format!("column {}", column.name);
            drawn.mismatches.push(Mismatch::of(&name, "the bond graph observes no such thing"));
        }
    }
    Ok(())
}

/// The text of every card that was cut is the law, of the law's own arguments.
fn laws<F: Modular>(
    sides: &Sides<F>,
    cut_values: &[HashMap<u64, F>],
    drawn: &mut Drawn,
) -> Result<(), Nothing> {
    let (bonds, wires) = (sides.bonds, sides.wires);
    for card in &wires.cuts {
        let Some(cut) = bonds.cuts.get(&card.place) else { continue };
        let Some((pending, element)) = wires.text.element(card.device) else { continue };
        let (Element::BehaviouralVoltage { law } | Element::BehaviouralCurrent { law }) = element
        else {
            continue;
        };
        drawn.laws += 1;
        let theirs = bonds.value(&cut.law, cut.own, sides.theirs)?;
        let theirs = if card.turned { -theirs } else { theirs };
        let raw = wires.value(pending.scope, law, sides.ours, None)?;
        if raw == theirs {
            continue;
        }
        let own = wires.own_value(card.device, sides.ours);
        let replaced = uncut::has(cut_values, own, &mut drawn.tries, &mut |cut| {
            wires.value(pending.scope, law, sides.ours, Some(cut))
        })?;
        if replaced || sides.same(&cut.law, cut.own, card.turned, pending.scope, law) {
            continue;
        }
        let why = "its text is not the law, or not of the law's own arguments";
        drawn.wrong_laws.push(Mismatch::card(wires.text, card.device, why));
    }
    Ok(())
}

/// What goes into a memory that a switch or a hold stands for.
fn memories<F: Modular>(sides: &Sides<F>, drawn: &mut Drawn) -> Result<(), Nothing> {
    let (bonds, wires) = (sides.bonds, sides.wires);
    for (device, own) in wires.text.circuit.devices.iter().enumerate() {
        let taken = match &own.kind {
            DeviceKind::Switch { control, .. } => match &*control.node {
                Node::Leaf(CircuitLeaf::Voltage(a, b)) => wires.voltage([*a, *b], sides.ours),
                _ => continue,
            },
            DeviceKind::Hold { .. } => match own.nodes.get(1) {
                Some(node) => wires.voltage([*node, crate::circuit::NodeId(0)], sides.ours),
                None => continue,
            },
            _ => continue,
        };
        let Some(id) = wires.signal(device) else { continue };
        let SignalLaw::Memory { kind, input } = &bonds.graph.signals[id.index()].law else {
            let why = "it remembers, and the signal does not";
            drawn.wrong_laws.push(Mismatch::card(wires.text, device, why));
            continue;
        };
        drawn.laws += 1;
        let input = match bonds.cuts.get(&Place::Signal(id)) {
            Some(cut) => cut.value.at(sides.theirs),
            None => bonds.value(input, None, sides.theirs)?,
        };
        let fits = matches!(
            (kind, &own.kind),
            (Memory::Hysteresis { .. }, DeviceKind::Switch { .. })
                | (Memory::Sample { .. }, DeviceKind::Hold { .. })
        );
        if taken != input || !fits {
            let why = "what it remembers is not what the signal remembers";
            drawn.wrong_laws.push(Mismatch::card(wires.text, device, why));
        }
    }
    Ok(())
}
