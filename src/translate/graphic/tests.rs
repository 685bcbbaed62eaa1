//! Random graphs given back by their matrices, small matrices against all trees, and matrices that no graph has.

use super::*;

/// Random numbers: a linear congruence, its upper half.
pub struct Dice(pub u64);

impl Dice {
    /// From 0 to below the limit.
    pub fn below(&mut self, limit: usize) -> usize {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        ((self.0 >> 33) % limit as u64) as usize
    }

    /// Any order.
    pub fn shuffle<T>(&mut self, list: &mut [T]) {
        for at in (1..list.len()).rev() {
            list.swap(at, self.below(at + 1));
        }
    }
}

/// The ways through a random spanning tree, as N, of a connected graph.
pub fn network(nodes: usize, edges: &[[usize; 2]], dice: &mut Dice) -> Matrix {
    let mut order: Vec<usize> = (0..edges.len()).collect();
    dice.shuffle(&mut order);
    let mut set: Vec<usize> = (0..nodes).collect();
    let (mut tree, mut links) = (vec![], vec![]);
    for edge in order {
        let [a, b] = edges[edge].map(|node| set[node]);
        if a == b {
            links.push(edge);
        } else {
            set.iter_mut().filter(|name| **name == b).for_each(|name| *name = a);
            tree.push(edge);
        }
    }
    assert_eq!(tree.len() + 1, nodes);
    let mut neighbours = vec![vec![]; nodes];
    for (row, edge) in tree.iter().enumerate() {
        let [tail, head] = edges[*edge];
        neighbours[tail].push((head, row, 1));
        neighbours[head].push((tail, row, -1));
    }
    let columns = links.iter().map(|link| {
        let [tail, head] = edges[*link];
        let mut from = vec![None; nodes];
        let mut waiting = vec![head];
        while let Some(node) = waiting.pop() {
            for &(next, row, sign) in &neighbours[node] {
                if next != head && from[next].is_none() {
                    from[next] = Some((node, row, sign));
                    waiting.push(next);
                }
            }
        }
        let (mut at, mut column) = (tail, vec![]);
        while at != head {
            let (node, row, sign) = from[at].unwrap();
            column.push((row, sign));
            at = node;
        }
        column
    });
    Matrix { rows: tree.len(), columns: columns.collect() }
}

/// Exchanges a row and a column at a non-zero entry, which changes the tree.
fn pivot(matrix: &mut Matrix, row: usize, column: usize) {
    let mut old = std::mem::take(&mut matrix.columns[column]);
    let at = old.iter().position(|(r, _)| *r == row).unwrap();
    let p = old[at].1;
    old.remove(at);
    // x_row = p·x_col + rest, so x_col = p·x_row − p·rest; other rows follow.
    for other in &mut matrix.columns {
        let Some(place) = other.iter().position(|(r, _)| *r == row) else { continue };
        let c = other[place].1;
        other[place].1 = -p * c;
        for (r, value) in &old {
            let change = -value * p * c;
            match other.iter().position(|(o, _)| o == r) {
                Some(found) if other[found].1 + change == 0 => drop(other.remove(found)),
                Some(found) => other[found].1 += change,
                None => other.push((*r, change)),
            }
        }
    }
    let mut new: Vec<(usize, i8)> = old.iter().map(|(r, value)| (*r, value * p)).collect();
    new.push((row, p));
    matrix.columns[column] = new;
}

/// Pivots, renumbers, reverses.
pub fn disguised(mut matrix: Matrix, pivots: usize, dice: &mut Dice) -> Matrix {
    for _ in 0..pivots {
        let column = dice.below(matrix.columns.len());
        let entries = &matrix.columns[column];
        if !entries.is_empty() {
            let row = entries[dice.below(entries.len())].0;
            pivot(&mut matrix, row, column);
        }
    }
    let mut rows: Vec<usize> = (0..matrix.rows).collect();
    dice.shuffle(&mut rows);
    let signs: Vec<i8> = rows.iter().map(|_| 1 - 2 * dice.below(2) as i8).collect();
    for column in &mut matrix.columns {
        let sign = 1 - 2 * dice.below(2) as i8;
        for (row, value) in column.iter_mut() {
            *value *= sign * signs[*row];
            *row = rows[*row];
        }
        dice.shuffle(column);
    }
    dice.shuffle(&mut matrix.columns);
    matrix
}

/// The graph's cycles are exactly the flows (N·x, x): each column is a circulation, and there are no others.
pub fn check(matrix: &Matrix, graph: &Graph) {
    let mut node_sums = vec![0i32; graph.nodes];
    for (column, entries) in matrix.columns.iter().enumerate() {
        let link = (matrix.rows + column, 1);
        let way = entries.iter().map(|(row, sign)| (*row, *sign));
        for (edge, flow) in way.chain([link]) {
            let [tail, head] = graph.edges[edge];
            node_sums[tail] += i32::from(flow);
            node_sums[head] -= i32::from(flow);
        }
        assert!(node_sums.iter().all(|sum| *sum == 0), "column {column} is no circulation");
    }
    let mut set: Vec<usize> = (0..graph.nodes).collect();
    let mut parts = graph.nodes;
    for [a, b] in &graph.edges {
        let (a, b) = (set[*a], set[*b]);
        if a != b {
            set.iter_mut().filter(|name| **name == b).for_each(|name| *name = a);
            parts -= 1;
        }
    }
    assert_eq!(graph.edges.len() + parts - graph.nodes, matrix.columns.len());
    let components = graph.component.iter().max().map_or(0, |last| last + 1);
    assert_eq!(components, parts);
}

/// A random 2-connected graph: a cycle, then ears; many in series or parallel.
pub fn two_connected(edges: usize, dice: &mut Dice) -> (usize, Vec<[usize; 2]>) {
    let first = 2 + dice.below(5);
    let mut nodes = first;
    let mut list: Vec<[usize; 2]> = (0..first).map(|node| [node, (node + 1) % first]).collect();
    let longest = 1 + dice.below(4);
    while list.len() < edges {
        let (from, to) = (dice.below(nodes), dice.below(nodes));
        if from == to {
            continue;
        }
        let mut at = from;
        for _ in 0..dice.below(longest) {
            list.push([at, nodes]);
            at = nodes;
            nodes += 1;
        }
        list.push([at, to]);
    }
    (nodes, list)
}

/// A random 3-connected graph: from a wheel by new edges and by splitting nodes (W. T. Tutte, 1961).
pub fn three_connected(edges: usize, dice: &mut Dice) -> (usize, Vec<[usize; 2]>) {
    let rim = 4 + dice.below(3);
    let mut nodes = rim + 1;
    let wheel = (1..=rim).flat_map(|node| [[0, node], [node, node % rim + 1]]);
    let mut list: Vec<[usize; 2]> = wheel.collect();
    let often = 2 + dice.below(3);
    let mut idle = 0;
    while list.len() < edges && idle < 50 * edges {
        idle += 1;
        if dice.below(often) == 0 {
            let (a, b) = (dice.below(nodes), dice.below(nodes));
            let there = |edge: &[usize; 2]| *edge == [a, b] || *edge == [b, a];
            if a != b && !list.iter().any(there) {
                list.push([a, b]);
            }
        } else {
            let node = dice.below(nodes);
            let mut at: Vec<usize> =
                (0..list.len()).filter(|edge| list[*edge].contains(&node)).collect();
            if at.len() >= 4 {
                dice.shuffle(&mut at);
                let moved = 2 + dice.below(at.len() - 3);
                for edge in &at[..moved] {
                    let end = list[*edge].iter().position(|end| *end == node).unwrap();
                    list[*edge][end] = nodes;
                }
                list.push([node, nodes]);
                nodes += 1;
            }
        }
    }
    (nodes, list)
}

#[test]
fn two_thousand_random_graphs_come_back() {
    let mut dice = Dice(1);
    let start = std::time::Instant::now();
    let mut spent = std::time::Duration::ZERO;
    let mut sizes = [0; 2];
    for round in 0..2000 {
        let size = 8 + dice.below(293);
        let (nodes, edges) = if round % 2 == 0 {
            two_connected(size, &mut dice)
        } else {
            three_connected(size, &mut dice)
        };
        sizes[round % 2] += edges.len();
        let matrix = disguised(network(nodes, &edges, &mut dice), 12, &mut dice);
        let before = std::time::Instant::now();
        let graph = realise(&matrix);
        spent += before.elapsed();
        check(&matrix, &graph.unwrap_or_else(|refusal| panic!("round {round}: {refusal:?}")));
    }
    // A hundred and fifty edges in the middle.
    assert!(sizes.iter().all(|sum| *sum > 140_000), "{sizes:?}");
    println!("realised in {spent:?} of {:?}", start.elapsed());
}

#[test]
fn thousands_of_edges_are_not_hopeless() {
    let mut dice = Dice(2);
    for make in [two_connected, three_connected] {
        let (nodes, edges) = make(5000, &mut dice);
        let matrix = disguised(network(nodes, &edges, &mut dice), 0, &mut dice);
        let before = std::time::Instant::now();
        let graph = realise(&matrix).unwrap();
        assert!(edges.len() >= 5000);
        println!("{} edges in {:?}", edges.len(), before.elapsed());
        check(&matrix, &graph);
    }
}

/// Every tree whose edges are the rows, each by the set of its paths, rows as bits.
fn trees(rows: usize) -> Vec<Vec<bool>> {
    let nodes = rows + 1;
    let mut trees = Vec::new();
    // Row r leads from node r + 1 to its parent, in each rooted tree on the nodes.
    let count = nodes.pow(rows as u32);
    for code in 0..count {
        let parent: Vec<usize> =
            (0..rows).map(|row| code / nodes.pow(row as u32) % nodes).collect();
        let up = |node: usize| {
            let (mut at, mut way) = (node, 0usize);
            for _ in 0..nodes {
                if at == 0 {
                    return Some(way);
                }
                way ^= 1 << (at - 1);
                at = parent[at - 1];
            }
            None
        };
        let Some(ways) = (0..nodes).map(up).collect::<Option<Vec<usize>>>() else { continue };
        let mut paths = vec![false; 1 << rows];
        for a in &ways {
            for b in &ways {
                paths[a ^ b] = true;
            }
        }
        trees.push(paths);
    }
    trees.sort();
    trees.dedup();
    trees
}

#[test]
fn small_matrices_against_all_trees() {
    let mut dice = Dice(3);
    for (rows, draws, number_of_trees) in
        [(3, 200, 4), (4, 5000, 25), (5, 5000, 216), (6, 5000, 2401)]
    {
        let trees = trees(rows);
        assert_eq!(trees.len(), number_of_trees);
        let (mut graphs, mut refused) = (0, 0);
        for _ in 0..draws {
            // Mostly paths of one tree, so that many have a graph and the others nearly.
            let tree = &trees[dice.below(trees.len())];
            let strange = dice.below(4);
            let mut supports = Vec::new();
            for _ in 0..1 + dice.below(2 * rows) {
                let support = 1 + dice.below((1 << rows) - 1);
                if tree[support] || dice.below(4) < strange {
                    supports.push(support);
                }
            }
            let exists = trees.iter().any(|paths| supports.iter().all(|support| paths[*support]));
            let columns = supports.iter().map(|support| {
                (0..rows).filter(|row| support >> row & 1 == 1).collect::<Vec<usize>>()
            });
            let mut decomposition = Decomposition::new(rows);
            let found = columns.clone().all(|column| decomposition.add(&column).is_some());
            assert_eq!(found, exists, "{supports:?}");
            graphs += usize::from(found);
            refused += usize::from(!found);
            if found {
                // Right signs are found by trying: those of the ways in the graph itself.
                let graph = decomposition.glue();
                let tree: Vec<[usize; 2]> = graph.edges[..rows].to_vec();
                for (number, column) in columns.enumerate() {
                    let [a, b] = graph.edges[rows + number];
                    let mut degree = vec![0; graph.nodes];
                    column.iter().for_each(|row| tree[*row].iter().for_each(|n| degree[*n] += 1));
                    degree[a] += 1;
                    degree[b] += 1;
                    assert!(degree.iter().all(|d| *d == 0 || *d == 2), "{supports:?}");
                }
            }
        }
        // Of three rows only the plane of seven points is refused, whose signs no one can give.
        let few = draws / 20;
        assert!(graphs > few && (rows == 3 || refused > few), "{rows}: {graphs}, {refused}");
    }
}

/// Rows of numbers as a matrix.
pub fn matrix(rows: &[&[i8]]) -> Matrix {
    let columns = (0..rows[0].len()).map(|column| {
        let entries = rows.iter().enumerate().map(|(row, values)| (row, values[column]));
        entries.filter(|(_, value)| *value != 0).collect()
    });
    Matrix { rows: rows.len(), columns: columns.collect() }
}

/// R10 (R. E. Bixby, 1977): regular, neither graphic nor cographic.
pub fn r10() -> Matrix {
    matrix(&[
        &[-1, 1, 0, 0, 1],
        &[1, -1, 1, 0, 0],
        &[0, 1, -1, 1, 0],
        &[0, 0, 1, -1, 1],
        &[1, 0, 0, 1, -1],
    ])
}

/// The cuts of a graph: −Nᵀ of its cycles.
pub fn dual(of: &Matrix) -> Matrix {
    let mut columns = vec![vec![]; of.rows];
    for (row, column) in of.columns.iter().enumerate() {
        column.iter().for_each(|(old, sign)| columns[*old].push((row, -sign)));
    }
    Matrix { rows: of.columns.len(), columns }
}

/// The complete graph of five nodes.
pub fn k5() -> (usize, Vec<[usize; 2]>) {
    (5, (0..5).flat_map(|a| (a + 1..5).map(move |b| [a, b])).collect())
}

/// Three houses, three wells.
pub fn k33() -> (usize, Vec<[usize; 2]>) {
    (6, (0..3).flat_map(|a| (3..6).map(move |b| [a, b])).collect())
}

#[test]
fn no_graph_has_these() {
    let mut dice = Dice(4);
    for (nodes, edges) in [k5(), k33()] {
        for _ in 0..20 {
            let cycles = disguised(network(nodes, &edges, &mut dice), 9, &mut dice);
            check(&cycles, &realise(&cycles).unwrap());
            let cuts = dual(&cycles);
            assert!(matches!(realise(&cuts), Err(Refusal::Support(_))));
        }
    }
    for _ in 0..20 {
        let refusal = realise(&disguised(r10(), 6, &mut dice));
        assert!(matches!(refusal, Err(Refusal::Support(_))), "{refusal:?}");
    }
    // Sum and difference: the non-zeros are two parallel pairs in series, the signs are not.
    assert_eq!(realise(&matrix(&[&[1, 1], &[-1, 1]])), Err(Refusal::Signs(1)));
    // The plane of seven points (G. Fano): binary, not regular.
    let fano = matrix(&[&[1, 1, 0, 1], &[1, 0, 1, 1], &[0, 1, 1, 1]]);
    assert!(realise(&fano).is_err());
    // A wheel, one of its signs turned.
    let mut wheel = matrix(&[&[1, 0, -1], &[-1, 1, 0], &[0, -1, 1]]);
    check(&wheel, &realise(&wheel).unwrap());
    wheel.columns[0][0].1 = -1;
    assert!(matches!(realise(&wheel), Err(Refusal::Signs(_))));
}

#[test]
fn planar_graphs_have_dual_circuits() {
    let mut dice = Dice(5);
    for size in 3..30 {
        // A wheel, dual to itself.
        let spokes = (1..=size).map(|node| [0, node]);
        let rim = (1..=size).map(|node| [node, node % size + 1]);
        let edges: Vec<[usize; 2]> = spokes.chain(rim).collect();
        let cuts = dual(&network(size + 1, &edges, &mut dice));
        let cuts = disguised(cuts, 5, &mut dice);
        check(&cuts, &realise(&cuts).unwrap());
    }
}

#[test]
fn rows_and_columns_of_zeros_are_bridges_and_loops() {
    let zero = Matrix { rows: 2, columns: vec![vec![], vec![(1, -1)]] };
    let graph = realise(&zero).unwrap();
    check(&zero, &graph);
    assert_ne!(graph.edges[0][0], graph.edges[0][1]);
    assert_eq!(graph.edges[2][0], graph.edges[2][1]);
    assert_eq!(graph.nodes, 5);
}

#[test]
fn elimination_tells_what_follows_from_what() {
    // x0 + x1 − h = 0, h − 2·x2 = 0, g free.
    let rows = vec![vec![(0, 1), (1, 1), (3, -1)], vec![(2, -2), (3, 1)]];
    let solved = elimination::eliminate(rows, &[false, false, false, true, true]).unwrap();
    assert_eq!(solved.undetermined, [4]);
    assert_eq!(solved.free.len(), 2);
    let (variable, row) = &solved.dependent[0];
    let sum: i64 =
        [(0, 3), (1, 5), (2, 4)].iter().map(|(v, x)| elimination::factor(row, *v) * x).sum();
    assert_eq!(sum, 0, "{variable} {row:?}");
    let (variable, row) = &solved.hidden[0];
    assert_eq!(*variable, 3);
    let values = [3, 5, 4, 8];
    let sum: i64 = row.iter().map(|(v, x)| values[*v] * x).sum();
    assert_eq!(sum, 0, "{row:?}");
}

#[test]
fn elimination_of_a_graph_gives_its_network_matrix() {
    let mut dice = Dice(6);
    for _ in 0..100 {
        let (nodes, edges) = two_connected(60, &mut dice);
        let mut rows = vec![vec![]; nodes];
        for (edge, [tail, head]) in edges.iter().enumerate() {
            rows[*tail].push((edge, 1));
            rows[*head].push((edge, -1));
        }
        let hidden: Vec<bool> = edges.iter().map(|_| dice.below(6) == 0).collect();
        let solved = elimination::eliminate(rows, &hidden).unwrap();
        for (_, row) in solved.dependent.iter().chain(&solved.hidden) {
            assert!(row.iter().all(|(_, value)| value.abs() == 1), "{row:?}");
        }
        let visible = hidden.iter().filter(|hidden| !**hidden).count();
        assert_eq!(solved.dependent.len() + solved.free.len(), visible);
        if solved.undetermined.is_empty() {
            assert_eq!(solved.free.len(), edges.len() + 1 - nodes);
        }
    }
}
