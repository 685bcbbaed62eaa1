//! Loops of junctions: networks given by their nodes, by their meshes, and by their matrices come without a helper; where
//! no graph exists, the couplers are as few as trying all sets of bonds finds.

use super::forced;
use super::graphic::tests::{Dice, disguised, dual, k5, k33, network, r10};
use super::graphic::tests::{three_connected, two_connected};
use super::graphic::{Matrix, realise};
use super::islands::{Island, find, is_junction};
use super::space::Space;
use super::tests::{compare, random, text, translated};
use crate::bond::build::*;
use crate::bond::graph::*;

/// Half arrows either way.
fn bond_either_way(b: &mut Build, from: VertexId, to: VertexId, dice: &mut Dice) -> BondId {
    if dice.below(2) == 0 { b.bond(from, to) } else { b.bond(to, from) }
}

/// A resistor, inductor or capacitor, now and then a source: never so many that they fight.
fn element(b: &mut Build, name: &str, dice: &mut Dice) -> VertexId {
    let value = 1.0 + dice.below(9) as f64;
    match dice.below(6) {
        0 => b.vertex("C", name, compliance(0.1 * value, StoreInitial::Unstated)),
        1 => b.vertex("I", name, inertia(0.1 * value, StoreInitial::Unstated)),
        _ => b.vertex("R", name, resistor(value)),
    }
}

/// A 0-junction for each node but the first, which is ground; a 1-junction between two of them for each edge.
fn by_nodes(nodes: usize, edges: &[[usize; 2]], dice: &mut Dice) -> Build {
    let mut b = Build::default();
    let junctions: Vec<VertexId> = (1..nodes).map(|node| b.zero(&format!("n{node}"))).collect();
    let u = b.vertex("Se", "U", effort_source(n(5.0)));
    b.bond(u, junctions[0]);
    for (edge, ends) in edges.iter().enumerate() {
        let [from, to] = ends.map(|node| node.checked_sub(1).map(|node| junctions[node]));
        let element = element(&mut b, &format!("x{edge}"), dice);
        match (from, to) {
            (Some(from), Some(to)) => {
                let one = b.one(&format!("e{edge}"));
                b.bond(from, one);
                b.bond(one, to);
                bond_either_way(&mut b, one, element, dice);
            }
            (Some(node), None) | (None, Some(node)) => {
                bond_either_way(&mut b, node, element, dice);
            }
            (None, None) => {}
        }
    }
    b
}

/// A 0-junction for each row and a 1-junction for each column, each with an element; a bond between them for each entry.
fn by_matrix(matrix: &Matrix, dice: &mut Dice) -> Build {
    let mut b = Build::default();
    let rows: Vec<VertexId> = (0..matrix.rows).map(|row| b.zero(&format!("r{row}"))).collect();
    for (number, row) in rows.iter().enumerate() {
        let element = element(&mut b, &format!("t{number}"), dice);
        b.bond(*row, element);
    }
    for (number, entries) in matrix.columns.iter().enumerate() {
        let one = b.one(&format!("c{number}"));
        let link = match number {
            0 => b.vertex("Se", "U", effort_source(n(5.0))),
            _ => element(&mut b, &format!("l{number}"), dice),
        };
        b.bond(one, link);
        for (row, sign) in entries {
            if *sign == 1 {
                b.bond(one, rows[*row])
            } else {
                b.bond(rows[*row], one)
            };
        }
    }
    b
}

#[test]
fn networks_given_by_their_nodes_need_no_helper() {
    let mut dice = Dice(11);
    let mut compared = 0;
    let mut graphs = vec![k5(), k33()];
    for round in 0..60 {
        let make = if round % 2 == 0 { two_connected } else { three_connected };
        graphs.push(make(5 + round / 3, &mut dice));
    }
    for (nodes, edges) in graphs {
        let mut b = by_nodes(nodes, &edges, &mut dice);
        compared += usize::from(compare(&b.graph).is_some());
        // Whichever junction comes first in the file.
        dice.shuffle(&mut b.graph.bonds);
        renumber_bonds(&mut b.graph);
        let translation = translated(&b.graph);
        assert_eq!(translation.figures.helpers, 0, "{}", text(&translation));
        assert_eq!(translation.figures.nodes, nodes - 1, "{}", text(&translation));
        assert_eq!(translation.figures.devices, edges.len() + 1);
        compare(&b.graph);
    }
    assert!(compared > 55, "{compared} of 62 were regular");
}

/// Lists at vertices in the order of the bonds; for graphs without two-ports.
fn renumber_bonds(graph: &mut BondGraph) {
    graph.vertices.iter_mut().for_each(|vertex| vertex.bonds.clear());
    for id in graph.bond_ids() {
        for end in [graph.bond(id).from, graph.bond(id).to] {
            graph.vertices[end.vertex.index()].bonds.push(id);
        }
    }
}

#[test]
fn networks_given_by_their_meshes_need_no_helper() {
    // Three times three meshes: an edge between two of them is a 0-junction, which gives both of them one effort; a
    // 1-junction is the flow round a mesh. An element of the mesh in the middle alone would lie between it and the
    // outside, and cross another.
    let mut dice = Dice(12);
    for (middle, couplers) in [(false, 0), (true, 1)] {
        let mut b = Build::default();
        let meshes: Vec<VertexId> = (0..9).map(|mesh| b.one(&format!("m{mesh}"))).collect();
        let u = b.vertex("Se", "U", effort_source(n(5.0)));
        b.bond(u, meshes[0]);
        for mesh in 0..9 {
            if mesh != 4 || middle {
                let outer = element(&mut b, &format!("o{mesh}"), &mut dice);
                bond_either_way(&mut b, meshes[mesh], outer, &mut dice);
            }
            let neighbours = [(mesh % 3 < 2, mesh + 1), (mesh < 6, mesh + 3)];
            for (_, next) in neighbours.into_iter().filter(|(inside, _)| *inside) {
                let shared = b.zero(&format!("s{mesh}_{next}"));
                let element = element(&mut b, &format!("x{mesh}_{next}"), &mut dice);
                b.bond(meshes[mesh], shared);
                b.bond(shared, meshes[next]);
                bond_either_way(&mut b, shared, element, &mut dice);
            }
        }
        let translation = translated(&b.graph);
        assert_eq!(translation.figures.helpers, couplers, "{}", text(&translation));
        if !middle {
            assert_eq!(translation.figures.devices, 1 + 8 + 12);
            // Branches less meshes.
            assert_eq!(translation.figures.nodes, 21 - 9);
        }
        assert!(compare(&b.graph).is_some());
    }
}

#[test]
fn networks_given_by_their_matrices_need_no_helper() {
    let mut dice = Dice(13);
    let mut compared = 0;
    for round in 0..100 {
        let make = if round % 2 == 0 { two_connected } else { three_connected };
        let (nodes, edges) = make(if round < 90 { 6 + round / 5 } else { 200 }, &mut dice);
        let matrix = disguised(network(nodes, &edges, &mut dice), 5, &mut dice);
        let b = by_matrix(&matrix, &mut dice);
        let translation = translated(&b.graph);
        assert_eq!(translation.figures.helpers, 0, "{}", text(&translation));
        assert_eq!(translation.figures.nodes, nodes - 1);
        if round < 90 {
            compared += usize::from(compare(&b.graph).is_some());
        }
    }
    assert!(compared > 80, "{compared} of 90 were regular");
}

/// The smallest number of bonds between junctions without which a graph exists, by trying all.
fn fewest_by_trying(graph: &BondGraph, island: &Island) -> usize {
    let inner: Vec<BondId> = island
        .bonds
        .iter()
        .copied()
        .filter(|bond| {
            let bond = graph.bond(*bond);
            is_junction(graph, bond.from.vertex) && is_junction(graph, bond.to.vertex)
        })
        .collect();
    let sets = 0u32..1 << inner.len();
    let leaves_graph = |set: &u32| {
        let members = (0..inner.len()).filter(|at| set >> at & 1 == 1);
        let cut: Vec<BondId> = members.map(|at| inner[at]).collect();
        Space::new(graph, island, &cut, &|_| false).realise().is_some()
    };
    (0..)
        .find(|size| {
            sets.clone().filter(|set| set.count_ones() == *size).any(|set| leaves_graph(&set))
        })
        .unwrap() as usize
}

#[test]
fn couplers_are_as_few_as_trying_all_finds() {
    let mut dice = Dice(14);
    let mut found = vec![];
    for round in 0..4 {
        for of in ["K5", "K3,3", "R10"] {
            let cycles = |(nodes, edges): (usize, Vec<[usize; 2]>), dice: &mut Dice| {
                dual(&network(nodes, &edges, dice))
            };
            let matrix = match of {
                "K5" => cycles(k5(), &mut dice),
                "K3,3" => cycles(k33(), &mut dice),
                _ => r10(),
            };
            let matrix = disguised(matrix, 3 * round, &mut dice);
            assert!(realise(&matrix).is_err());
            let b = by_matrix(&matrix, &mut dice);
            let island = &find(&b.graph)[0];
            let fewest = fewest_by_trying(&b.graph, island);
            let translation = translated(&b.graph);
            assert_eq!(translation.figures.helpers, fewest, "{of}\n{}", text(&translation));
            assert_eq!(text(&translation).matches("1:1 coupler").count(), 2 * fewest);
            compare(&b.graph);
            found.push((of, fewest));
        }
    }
    assert!(found.iter().all(|(_, fewest)| *fewest >= 1), "{found:?}");
}

#[test]
fn large_networks_without_a_graph_get_few_couplers() {
    // Twelve times sum and difference in a row: each needs a coupler of its own, and there are too many bonds to try all
    // sets.
    let mut b = Build::default();
    let mut before = None;
    for part in 0..12 {
        let [s, d] = ["s", "d"].map(|name| b.zero(&format!("{name}{part}")));
        let [x, y] = ["x", "y"].map(|name| b.one(&format!("{name}{part}")));
        for (from, to) in [(s, x), (x, d), (s, y), (d, y)] {
            b.bond(from, to);
        }
        for (number, junction) in [s, d, x, y].into_iter().enumerate() {
            let r = b.vertex("R", &format!("R{part}_{number}"), resistor(1.0 + part as f64));
            b.bond(junction, r);
        }
        match before {
            None => {
                let u = b.vertex("Se", "U", effort_source(n(5.0)));
                b.bond(u, s);
            }
            Some(before) => {
                b.bond(before, s);
            }
        }
        before = Some(y);
    }
    let translation = translated(&b.graph);
    assert_eq!(translation.figures.helpers, 12, "{}", text(&translation));
    assert!(compare(&b.graph).is_some());
}

#[test]
fn flows_inside_are_measured_without_a_coupler() {
    // The flow of a bond between two junctions of a bridge is needed by a law: one 0 V source, in the wire there.
    let mut dice = Dice(15);
    for round in 0..20 {
        let (nodes, edges) = three_connected(12, &mut dice);
        let mut b = by_nodes(nodes, &edges, &mut dice);
        let inner: Vec<BondId> = b
            .graph
            .bond_ids()
            .filter(|id| {
                let bond = b.graph.bond(*id);
                is_junction(&b.graph, bond.from.vertex) && is_junction(&b.graph, bond.to.vertex)
            })
            .collect();
        let bond = inner[dice.below(inner.len())];
        let leaf = Leaf::Bond { bond, variable: Power::Flow, negated: false };
        let own = times(n(2.0), f());
        let law = Dissipation::Effort(plus(own, times(n(0.5), Expr::leaf(leaf))));
        let at = b.graph.vertex_ids().find(|id| b.graph.vertex(*id).kind == "R");
        b.graph.vertices[at.unwrap().index()].law = Law::Dissipator(law);
        let translation = translated(&b.graph);
        assert!(!text(&translation).contains("coupler"), "{round}: {}", text(&translation));
        assert!(translation.figures.helpers <= 2, "{}", text(&translation));
    }
}

#[test]
fn flows_and_efforts_inside_are_read_wherever_junctions_are_split() {
    // Junctions of networks given by their matrices, split in two of one kind with a bond between, whose flow is integrated:
    // it is a sum that no branch carries, and often one that no wire could carry.
    let mut dice = Dice(16);
    let (mut compared, mut measured, mut coupled) = (0, 0, 0);
    for round in 0..80 {
        let make = if round % 2 == 0 { two_connected } else { three_connected };
        let (nodes, edges) = make(6 + round / 8, &mut dice);
        let matrix = disguised(network(nodes, &edges, &mut dice), 3, &mut dice);
        let mut b = by_matrix(&matrix, &mut dice);
        for split in 0..2 {
            let junctions = b.graph.vertex_ids().filter(|id| is_junction(&b.graph, *id));
            let wide: Vec<VertexId> =
                junctions.filter(|id| b.graph.vertex(*id).bonds.len() >= 4).collect();
            let Some(junction) = wide.get(dice.below(wide.len().max(1))).copied() else { continue };
            let law = b.graph.vertex(junction).law.clone();
            let zero = matches!(law, Law::Zero);
            let other = b.vertex("0", &format!("split{split}"), law);
            let bonds = b.graph.vertex(junction).bonds.clone();
            let (stay, go) = bonds.split_at(2 + dice.below(bonds.len() - 3));
            for bond in go {
                let bond = &mut b.graph.bonds[bond.index()];
                for end in [&mut bond.from, &mut bond.to] {
                    if end.vertex == junction {
                        end.vertex = other;
                    }
                }
            }
            b.graph.vertices[junction.index()].bonds = stay.to_vec();
            b.graph.vertices[other.index()].bonds = go.to_vec();
            let bond = bond_either_way(&mut b, junction, other, &mut dice);
            let rate = Expr::leaf(Leaf::Bond { bond, variable: Power::Flow, negated: false });
            let initial = Initial::Given(n(0.0));
            // The flow of a 1-junction is that of its elements.
            if zero {
                b.signal(&format!("inside{split}"), SignalLaw::Integrator { rate, initial });
            }
        }
        compared += usize::from(compare(&b.graph).is_some());
        let translation = translated(&b.graph);
        let netlist = text(&translation);
        let couplers = netlist.matches("1:1 coupler").count() / 2;
        let meters = netlist.matches("0 V, carries").count();
        assert_eq!(translation.figures.helpers, couplers + meters);
        // Splitting alone changes no graph; a meter in the split may have none.
        assert!(meters <= 2 && (meters > 0 || couplers == 0), "{netlist}");
        measured += meters;
        coupled += couplers;
    }
    assert!(compared > 70, "{compared} of 80 were regular");
    assert!(measured > 5 && coupled > 0, "{measured} meters, {coupled} couplers");
    println!("{measured} meters, {coupled} couplers");
}

#[test]
fn rings_and_contradictions_lose_no_device() {
    // Many loops, most of them singular somewhere: whatever is left undetermined, each element stands in the circuit.
    let mut seed = 17;
    let (mut translated, mut refused) = (0, 0);
    for round in 0..1500 {
        let graph = random(&mut seed, 1 + round % 10);
        let mut said = vec![];
        forced::check(&graph, &mut said);
        let mut diagnostics = vec![];
        let translation = super::translate(
            &graph,
            &Default::default(),
            &Default::default(),
            &Default::default(),
            &mut diagnostics,
        );
        let Some(translation) = translation else {
            assert!(diagnostics.iter().all(|d| d.code == "E0601"), "{diagnostics:?}");
            refused += 1;
            continue;
        };
        let ports: usize = graph
            .vertices
            .iter()
            .filter(|vertex| !matches!(vertex.law, Law::Zero | Law::One))
            .map(|vertex| vertex.bonds.len())
            .sum();
        let netlist = text(&translation);
        let couplers = netlist.matches("1:1 coupler").count() / 2;
        let figures = translation.figures;
        assert_eq!(figures.devices, ports + figures.helpers + couplers, "{netlist}");
        translated += 1;
    }
    assert!(translated > 1000 && refused < 400, "{translated} translated, {refused} refused");
}
