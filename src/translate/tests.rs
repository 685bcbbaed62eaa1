//! Circuits against the bond graphs' own equations: linear ones solved at one real value of s, with every effort and
//! flow of the map compared; and the shape of small circuits.

use super::*;
use crate::bond::build::*;
use crate::bond::graph::*;
use crate::netlist::{self, Leaf as NetLeaf, Name, Source as NetSource, Waveform as NetWaveform};
use nalgebra::{DMatrix, DVector};
use std::collections::HashMap;

/// The value of a source that is the same at all times.
fn steady(source: &NetSource) -> &netlist::Expr {
    match &source.waveform {
        NetWaveform::Constant(value) => value,
        other => panic!("{other:?}"),
    }
}

/// The value of s at which storages are compared: impedances s·L and 1/(s·C), nothing stored at the start.
const S: f64 = 0.7;

pub fn text(translation: &Translation) -> String {
    crate::netlist::write::write(&translation.netlist)
}

pub fn translated(graph: &BondGraph) -> Translation {
    let mut diagnostics = Vec::new();
    let translation = translate(
        graph,
        &Causality::default(),
        &InitialState::default(),
        &SourceMap::default(),
        &mut diagnostics,
    );
    translation.unwrap_or_else(|| panic!("{diagnostics:?}"))
}

/// Every effort and flow of a linear graph, straight from the definitions; `None` where they are undetermined.
fn bond_solution(graph: &BondGraph) -> Option<DVector<f64>> {
    let bonds = graph.bonds.len();
    let mut rows: Vec<(Vec<(usize, f64)>, f64)> = Vec::new();
    let e = |bond: BondId| bond.index();
    let f = |bond: BondId| bonds + bond.index();
    let number = |expr: &Expr| constant(graph, expr);
    for id in graph.vertex_ids() {
        let vertex = graph.vertex(id);
        let sign = |port: usize| graph.sign_into(vertex.bonds[port], id, port as u32);
        let b = &vertex.bonds;
        match &vertex.law {
            Law::Zero => {
                rows.push((b.iter().map(|b| (f(*b), graph.sign_into(*b, id, 0))).collect(), 0.0));
                rows.extend(b[1..].iter().map(|o| (vec![(e(b[0]), 1.0), (e(*o), -1.0)], 0.0)));
            }
            Law::One => {
                rows.push((b.iter().map(|b| (e(*b), graph.sign_into(*b, id, 0))).collect(), 0.0));
                rows.extend(b[1..].iter().map(|o| (vec![(f(b[0]), 1.0), (f(*o), -1.0)], 0.0)));
            }
            Law::Source { sets: Power::Effort, value, .. } => {
                rows.push((vec![(e(b[0]), 1.0)], number(value)));
            }
            Law::Source { sets: Power::Flow, value, .. } => {
                rows.push((vec![(f(b[0]), 1.0)], number(value)));
            }
            Law::Dissipator(Dissipation::Linear(r)) => {
                rows.push((vec![(e(b[0]), 1.0), (f(b[0]), -sign(0) * number(r))], 0.0));
            }
            Law::Store { kind, law: StoreLaw::Linear(size), .. } => rows.push(match kind {
                Storage::Compliance => {
                    (vec![(f(b[0]), sign(0)), (e(b[0]), -S * number(size))], 0.0)
                }
                Storage::Inertia => {
                    (vec![(e(b[0]), 1.0), (f(b[0]), -sign(0) * S * number(size))], 0.0)
                }
            }),
            // f1 into port 1, f2 out of port 2.
            Law::Transformer(modulus) => {
                let (r, ratio) = modulus_of(graph, modulus);
                let (near, far) = if ratio { (0, 1) } else { (1, 0) };
                rows.push((vec![(e(b[near]), 1.0), (e(b[far]), -r)], 0.0));
                let (f1, f2) = ((f(b[0]), sign(0)), (f(b[1]), -sign(1)));
                let (from, to) = if ratio { (f1, f2) } else { (f2, f1) };
                rows.push((vec![to, (from.0, -r * from.1)], 0.0));
            }
            Law::Gyrator(modulus) => {
                let (r, ratio) = modulus_of(graph, modulus);
                let (f1, f2) = ((f(b[0]), sign(0)), (f(b[1]), -sign(1)));
                if ratio {
                    rows.push((vec![(e(b[0]), 1.0), (f2.0, -r * f2.1)], 0.0));
                    rows.push((vec![(e(b[1]), 1.0), (f1.0, -r * f1.1)], 0.0));
                } else {
                    rows.push((vec![f1, (e(b[1]), -r)], 0.0));
                    rows.push((vec![f2, (e(b[0]), -r)], 0.0));
                }
            }
            other => panic!("not linear: {other:?}"),
        }
    }
    assert_eq!(rows.len(), 2 * bonds);
    solve(&rows, 2 * bonds)
}

fn modulus_of(graph: &BondGraph, modulus: &Modulus) -> (f64, bool) {
    match modulus {
        Modulus::Ratio(value) => (constant(graph, value), true),
        Modulus::Gain(value) => (constant(graph, value), false),
    }
}

fn constant(graph: &BondGraph, expr: &Expr) -> f64 {
    forms::constant_value(graph, expr).unwrap()
}

fn solve(rows: &[(Vec<(usize, f64)>, f64)], size: usize) -> Option<DVector<f64>> {
    let mut matrix = DMatrix::zeros(rows.len(), size);
    let mut right = DVector::zeros(rows.len());
    for (row, (terms, value)) in rows.iter().enumerate() {
        for (column, factor) in terms {
            matrix[(row, *column)] += factor;
        }
        right[row] = *value;
    }
    let singular = matrix.clone().svd(false, false).singular_values;
    if singular.min() < 1e-7 * singular.max() {
        return None;
    }
    matrix.lu().solve(&right)
}

/// Node voltages and branch currents of a linear circuit, by name.
struct Solved {
    columns: HashMap<(bool, Name), usize>,
    values: DVector<f64>,
    parameters: HashMap<Name, f64>,
    ground: Name,
}

impl Solved {
    fn of(translation: &Translation, parameters: HashMap<Name, f64>) -> Option<Solved> {
        let netlist = &translation.netlist;
        let ground = netlist.names.find("0").unwrap();
        let devices: Vec<&Device> = netlist
            .cards
            .iter()
            .filter_map(|card| match &card.kind {
                CardKind::Device(device) => Some(device),
                _ => None,
            })
            .collect();
        let mut columns = HashMap::new();
        for device in &devices {
            for node in &device.nodes {
                let next = columns.len();
                if *node != ground {
                    columns.entry((true, *node)).or_insert(next);
                }
            }
        }
        for device in &devices {
            if !matches!(
                device.element,
                Element::Resistor { .. }
                    | Element::Capacitor { .. }
                    | Element::CurrentSource(_)
                    | Element::Vccs { .. }
                    | Element::Cccs { .. }
            ) {
                let next = columns.len();
                columns.insert((false, device.name), next);
            }
        }
        let size = columns.len();
        let value = |expr: &netlist::Expr| {
            expr.evaluate(&mut |leaf| match leaf {
                NetLeaf::Parameter(name) => parameters[name],
                other => panic!("{other:?} in a value"),
            })
        };
        let mut rows = vec![(Vec::new(), 0.0); size];
        let node = |name: Name| columns.get(&(true, name)).copied();
        for device in &devices {
            let [a, b] = [node(device.nodes[0]), node(device.nodes[1])];
            let branch = columns.get(&(false, device.name)).copied();
            // The current as terms, leaving the first node.
            let mut current: Vec<(usize, f64)> = Vec::new();
            let across = |g: f64, plus: Option<usize>, minus: Option<usize>| {
                plus.map(|p| (p, g)).into_iter().chain(minus.map(|m| (m, -g))).collect::<Vec<_>>()
            };
            let mut forced = 0.0;
            if let Some(branch) = branch {
                current.push((branch, 1.0));
                rows[branch].0 = across(1.0, a, b);
            }
            let row = branch.unwrap_or(0);
            match &device.element {
                Element::Resistor { value: r } => current = across(1.0 / value(r), a, b),
                Element::Capacitor { value: c, .. } => current = across(S * value(c), a, b),
                Element::Inductor { value: l, .. } => rows[row].0.push((row, -S * value(l))),
                Element::VoltageSource(source) => rows[row].1 = value(steady(source)),
                Element::CurrentSource(source) => forced = value(steady(source)),
                Element::Vcvs { gain, control } => {
                    let terms = across(-value(gain), node(control[0]), node(control[1]));
                    rows[row].0.extend(terms);
                }
                Element::Ccvs { gain, control } => {
                    rows[row].0.push((columns[&(false, *control)], -value(gain)));
                }
                Element::Vccs { gain, control } => {
                    current = across(value(gain), node(control[0]), node(control[1]));
                }
                Element::Cccs { gain, control } => {
                    current = vec![(columns[&(false, *control)], value(gain))];
                }
                other => panic!("not linear: {other:?}"),
            }
            for (end, sign) in [(a, 1.0), (b, -1.0)] {
                if let Some(end) = end {
                    rows[end].0.extend(current.iter().map(|(column, g)| (*column, sign * g)));
                    rows[end].1 -= sign * forced;
                }
            }
        }
        let values = solve(&rows, size)?;
        Some(Solved { columns, values, parameters, ground })
    }

    fn value(&self, device_current: &dyn Fn(Name) -> f64, expr: &netlist::Expr) -> f64 {
        let voltage = |name: Name| {
            if name == self.ground { 0.0 } else { self.values[self.columns[&(true, name)]] }
        };
        expr.evaluate(&mut |leaf| match leaf {
            NetLeaf::Parameter(name) => self.parameters[name],
            NetLeaf::Voltage(a, b) => voltage(*a) - b.map_or(0.0, voltage),
            NetLeaf::Current(name) => match self.columns.get(&(false, *name)) {
                Some(column) => self.values[*column],
                None => device_current(*name),
            },
            other => panic!("{other:?} in a linear circuit"),
        })
    }
}

/// Compares every effort and flow; says how many were compared, `None` when the graph is singular.
pub fn compare(graph: &BondGraph) -> Option<usize> {
    let expected = bond_solution(graph)?;
    let translation = translated(graph);
    let solved = Solved::of(&translation, HashMap::new())
        .unwrap_or_else(|| panic!("singular circuit\n{}", text(&translation)));
    // Currents that a bond graph's map may name and that are no unknowns: of capacitors and current sources.
    let current = |name: Name| {
        let device = translation.netlist.cards.iter().find_map(|card| match &card.kind {
            CardKind::Device(device) if device.name == name => Some(device),
            _ => None,
        });
        let device = device.unwrap();
        let voltage = |node: Name| {
            if node == solved.ground { 0.0 } else { solved.values[solved.columns[&(true, node)]] }
        };
        match &device.element {
            Element::Capacitor { value, .. } => {
                S * value.constant().unwrap()
                    * (voltage(device.nodes[0]) - voltage(device.nodes[1]))
            }
            Element::CurrentSource(source) => steady(source).constant().unwrap(),
            other => panic!("current of {other:?}"),
        }
    };
    let scale = expected.amax().max(1e-6);
    let mut compared = 0;
    for bond in graph.bond_ids() {
        let name = graph.bond_name(bond);
        for (letter, index) in [("e", bond.index()), ("f", graph.bonds.len() + bond.index())] {
            let wanted = format!("{letter}({name})");
            let variable =
                translation.map.variables.iter().find(|v| v.bg == wanted).expect("in the map");
            let Some(expr) = &variable.expr else {
                panic!("{wanted} unknown\n{}", text(&translation))
            };
            let found = solved.value(&current, expr);
            assert!(
                (found - expected[index]).abs() < 1e-7 * scale,
                "{wanted}: circuit {found}, bond graph {}\n{}",
                expected[index],
                text(&translation)
            );
            compared += 1;
        }
    }
    Some(compared)
}

fn reverse(graph: &mut BondGraph, bond: BondId) {
    let bond = &mut graph.bonds[bond.index()];
    std::mem::swap(&mut bond.from, &mut bond.to);
}

fn rlc() -> (Build, [VertexId; 4]) {
    let mut b = Build::default();
    let mesh = b.one("mesh");
    let u = b.vertex("Se", "U", effort_source(n(10.0)));
    let l = b.vertex("I", "L", inertia(1e-3, StoreInitial::Unstated));
    let r = b.vertex("R", "R", resistor(2.0));
    let c = b.vertex("C", "C", compliance(1e-4, StoreInitial::Unstated));
    b.bond(u, mesh);
    b.fan(mesh, &[l, r, c]);
    (b, [u, l, r, c])
}

fn devices(translation: &Translation) -> Vec<String> {
    let text = text(translation);
    text.lines()
        .filter(|line| line.starts_with(|c: char| c.is_ascii_uppercase()))
        .map(|line| line.split(" ;").next().unwrap_or(line).trim().to_string())
        .collect()
}

#[test]
fn a_series_circuit_is_a_loop() {
    let (b, _) = rlc();
    let translation = translated(&b.graph);
    assert_eq!(
        devices(&translation),
        [
            "V_U mesh 0 10",
            "L_L mesh mesh_2 0.001 IC=0",
            "R_R mesh_2 mesh_3 2",
            "C_C mesh_3 0 1e-4 IC=0",
        ]
    );
    assert_eq!(translation.figures, Figures { nodes: 3, devices: 4, helpers: 0 });
    assert_eq!(compare(&b.graph), Some(8));
}

#[test]
fn a_reversed_half_arrow_changes_the_sign_of_the_bond_and_nothing_else() {
    let (b, _) = rlc();
    let plain = bond_solution(&b.graph).unwrap();
    for bond in 1..4 {
        let mut reversed = b.graph.clone();
        reverse(&mut reversed, BondId(bond));
        assert_eq!(compare(&reversed), Some(8));
        // The loop's current is as before.
        let solution = bond_solution(&reversed).unwrap();
        assert!((solution[4] - plain[4]).abs() < 1e-12 * plain.amax());
        assert!((solution[bond as usize] + plain[bond as usize]).abs() < 1e-9);
    }
    // A source sets its bond's effort: reversed, it opposes.
    let mut reversed = b.graph.clone();
    reverse(&mut reversed, BondId(0));
    assert_eq!(compare(&reversed), Some(8));
}

#[test]
fn two_ports_in_both_forms_directions_and_causalities() {
    for gain in [false, true] {
        for gyrator in [false, true] {
            for reversed in 0..16u32 {
                for strokes in 0..5 {
                    let mut b = Build::default();
                    let value = n(0.4);
                    let modulus = if gain { Modulus::Gain(value) } else { Modulus::Ratio(value) };
                    let u = b.vertex("Se", "U", effort_source(n(3.0)));
                    let left = b.one("left");
                    let law =
                        if gyrator { Law::Gyrator(modulus) } else { Law::Transformer(modulus) };
                    let two = b.vertex("TF", "t", law);
                    let right = b.zero("right");
                    let r1 = b.vertex("R", "a", resistor(2.0));
                    let r2 = b.vertex("R", "b", resistor(5.0));
                    let c = b.vertex("C", "c", compliance(0.3, StoreInitial::Unstated));
                    b.bond(u, left);
                    b.bond(left, r1);
                    let b1 = b.bond(left, two);
                    let b2 = b.bond(two, right);
                    b.bond(right, r2);
                    b.bond(right, c);
                    for (bit, bond) in [b1, b2, BondId(1), BondId(4)].into_iter().enumerate() {
                        if reversed >> bit & 1 == 1 {
                            reverse(&mut b.graph, bond);
                        }
                    }
                    let mut causality =
                        Causality { strokes: vec![None; 6], ..Causality::default() };
                    if strokes < 4 {
                        let stroke =
                            |at: bool| Some(if at { Stroke::AtTo } else { Stroke::AtFrom });
                        causality.strokes[b1.index()] = stroke(strokes & 1 == 1);
                        causality.strokes[b2.index()] = stroke(strokes & 2 == 2);
                    }
                    let graph = &b.graph;
                    let expected = bond_solution(graph).unwrap();
                    let initial = InitialState::default();
                    let source = SourceMap::default();
                    let translation =
                        translate(graph, &causality, &initial, &source, &mut vec![]).unwrap();
                    let solved = Solved::of(&translation, HashMap::new()).unwrap();
                    for bond in graph.bond_ids() {
                        let name = graph.bond_name(bond);
                        for (letter, index) in [("e", bond.index()), ("f", 6 + bond.index())] {
                            let wanted = format!("{letter}({name})");
                            let variable =
                                translation.map.variables.iter().find(|v| v.bg == wanted).unwrap();
                            let expr = variable.expr.as_ref().unwrap();
                            let found = solved.value(&|_| panic!("no capacitor current"), expr);
                            assert!(
                                (found - expected[index]).abs() < 1e-9,
                                "{wanted} {found} {}\n{}",
                                expected[index],
                                text(&translation)
                            );
                        }
                    }
                }
            }
        }
    }
}

/// Wheatstone's bridge as a graph with loops of junctions: four nodes, five branches.
fn bridge(r4: f64) -> Build {
    let mut b = Build::default();
    let u = b.vertex("Se", "U", effort_source(n(5.0)));
    let [top, left, right] = ["top", "left", "right"].map(|name| b.zero(name));
    b.bond(u, top);
    let branch = |b: &mut Build, from: VertexId, to: VertexId, name: &str, value: f64| {
        let one = b.one(&format!("branch_{name}"));
        let r = b.vertex("R", name, resistor(value));
        b.bond(from, one);
        b.bond(one, r);
        b.bond(one, to);
    };
    branch(&mut b, top, left, "R1", 1.0);
    branch(&mut b, top, right, "R2", 1.0);
    branch(&mut b, left, right, "R5", 1.0);
    let r3 = b.vertex("R", "R3", resistor(1.0));
    let r4 = b.vertex("R", "R4", resistor(r4));
    b.bond(left, r3);
    b.bond(right, r4);
    b
}

#[test]
fn wheatstones_bridge_needs_no_coupler() {
    let b = bridge(2.0);
    let translation = translated(&b.graph);
    assert_eq!(
        devices(&translation),
        [
            "V_U top 0 5",
            "R_R1 top left 1",
            "R_R3 left 0 1",
            "R_R5 left right 1",
            "R_R2 top right 1",
            "R_R4 right 0 2",
        ]
    );
    assert_eq!(translation.figures.helpers, 0);
    let solution = bond_solution(&b.graph).unwrap();
    assert!(compare(&b.graph).is_some());
    // Printed values: node voltages, and the source's current.
    let effort = |name: &str| {
        let bond = b.graph.bond_ids().find(|id| b.graph.bond_name(*id) == name).unwrap();
        solution[bond.index()]
    };
    assert!((effort("left -> R3") - 2.69230769).abs() < 1e-8);
    assert!((effort("right -> R4") - 3.07692308).abs() < 1e-8);
}

#[test]
fn a_loop_that_no_wire_closes_gets_a_coupler() {
    // Both branches come back to b through sources in front of the return: 0:a -> 1:x -> 0:b and a -> 1:y, with y
    // drawn the other way round, so that e(a) = e(x) + e(b) and e(a) + e(b) = e(y).
    let mut b = Build::default();
    let u = b.vertex("Se", "U", effort_source(n(5.0)));
    let [a, z] = ["a", "b"].map(|name| b.zero(name));
    let [x, y] = ["x", "y"].map(|name| b.one(name));
    let [r1, r2, r3] = [1.0, 2.0, 3.0].map(|r| b.vertex("R", &format!("r{r}"), resistor(r)));
    b.bond(u, a);
    b.bond(a, x);
    b.bond(x, z);
    b.bond(a, y);
    b.bond(z, y);
    b.bond(x, r1);
    b.bond(y, r2);
    b.bond(z, r3);
    assert!(compare(&b.graph).is_some());
    let translation = translated(&b.graph);
    assert_eq!(translation.figures.helpers, 1, "{}", text(&translation));
    assert!(text(&translation).contains("1:1 coupler"));
}

/// A random tree of junctions with elements and two-ports; `loops` more bonds between junctions.
pub fn random(seed: &mut u64, loops: usize) -> BondGraph {
    let mut next = |below: u64| {
        *seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (*seed >> 33) % below
    };
    let mut b = Build::default();
    let count = 2 + next(6) as usize;
    let mut junctions = Vec::new();
    for index in 0..count {
        let zero = next(2) == 0;
        let name = format!("j{index}");
        let junction = if zero { b.zero(&name) } else { b.one(&name) };
        let mut elements = vec![resistor(1.0 + next(9) as f64)];
        for _ in 0..next(3) {
            elements.push(match next(4) {
                0 => compliance(0.1 + next(5) as f64, StoreInitial::Unstated),
                1 => inertia(0.1 + next(5) as f64, StoreInitial::Unstated),
                2 if zero => flow_source(n(next(9) as f64 - 4.0)),
                2 => effort_source(n(next(9) as f64 - 4.0)),
                _ => resistor(1.0 + next(9) as f64),
            });
        }
        if index == 0 {
            elements.push(if zero { flow_source(n(2.0)) } else { effort_source(n(2.0)) });
        }
        for (number, law) in elements.into_iter().enumerate() {
            let element = b.vertex("X", &format!("x{index}_{number}"), law);
            b.bond(junction, element);
        }
        if index > 0 {
            let before = junctions[next(index as u64) as usize];
            let value = n(0.5 + next(4) as f64);
            let modulus = if next(2) == 0 { Modulus::Ratio(value) } else { Modulus::Gain(value) };
            match next(4) {
                0 => {
                    let two = b.vertex("TF", &format!("t{index}"), Law::Transformer(modulus));
                    b.bond(before, two);
                    b.bond(two, junction);
                }
                1 => {
                    let two = b.vertex("GY", &format!("g{index}"), Law::Gyrator(modulus));
                    b.bond(before, two);
                    b.bond(two, junction);
                }
                _ => {
                    b.bond(before, junction);
                }
            }
        }
        junctions.push(junction);
    }
    for _ in 0..loops {
        let [from, to] = [next(count as u64) as usize, next(count as u64) as usize];
        if from != to {
            b.bond(junctions[from], junctions[to]);
        }
    }
    for bond in 0..b.graph.bonds.len() as u32 {
        if next(2) == 0 {
            reverse(&mut b.graph, BondId(bond));
        }
    }
    b.graph
}

#[test]
fn random_trees_need_no_helper_but_senses_of_gyrators() {
    let mut seed = 1;
    let mut compared = 0;
    for _ in 0..400 {
        let graph = random(&mut seed, 0);
        compared += usize::from(compare(&graph).is_some());
        let translation = translated(&graph);
        assert!(!text(&translation).contains("coupler"));
    }
    assert!(compared > 390, "{compared} of 400 were regular");
}

#[test]
fn random_graphs_with_loops_of_junctions() {
    let mut seed = 2;
    let mut compared = 0;
    for loops in 1..4 {
        for _ in 0..300 {
            let graph = random(&mut seed, loops);
            compared += usize::from(compare(&graph).is_some());
        }
    }
    assert!(compared > 200, "{compared} of 900 were regular");
}
