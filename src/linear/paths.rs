//! An order of elimination for long paths, such as lines in many pieces are.
//!
//! From end to end, as the least degree has it, each node waits for the one before: a processor that could do four things
//! at once does one. Every other node of a path can go at the same time as all others, and leaves a path of half as many
//! (cyclic reduction: R. W. Hockney, J. ACM 12:95-113, 1965; orders by sets of independent nodes: J. W. H. Liu, ACM Trans.
//! Math. Softw. 11:141-153, 1985). That fills in one entry for each of them, which is less than the wait.

use super::Pattern;

/// A node with more neighbours is not of a path.
const MOST: usize = 2;
/// Rounds end where less than this part of what is left can go at once,
const LEAST: f64 = 0.25;
/// or after so many of them: what is left by then is short.
const ROUNDS: usize = 5;

/// The order of a graph's nodes: first those of paths, round by round, then the others as `rest` orders what is left.
pub fn order(
    n: usize,
    edges: impl Iterator<Item = (u32, u32)>,
    rest: impl FnOnce(&Pattern) -> Option<Vec<u32>>,
) -> Option<Vec<u32>> {
    let edges: Vec<(u32, u32)> = edges.filter(|(a, b)| a != b).collect();
    let mut degree = vec![0u32; n];
    for (a, b) in &edges {
        degree[*a as usize] += 1;
        degree[*b as usize] += 1;
    }
    let mut left = n;
    let mut order: Vec<u32> = Vec::with_capacity(n);
    if (degree.iter().filter(|d| **d as usize <= MOST).count() as f64) < LEAST * n as f64 {
        let (graph, _) = Pattern::from_triplets(n, &edges);
        return rest(&graph);
    }
    let mut neighbours: Vec<Vec<u32>> =
        degree.iter().map(|d| Vec::with_capacity(*d as usize)).collect();
    for (a, b) in edges {
        neighbours[a as usize].push(b);
        neighbours[b as usize].push(a);
    }
    let mut gone = vec![false; n];
    for _ in 0..ROUNDS {
        // The next to one that goes waits for another round.
        let mut waits = vec![false; n];
        let before = order.len();
        for node in 0..n {
            if gone[node] || waits[node] || neighbours[node].len() > MOST {
                continue;
            }
            order.push(node as u32);
            neighbours[node].iter().for_each(|other| waits[*other as usize] = true);
        }
        let chosen = order.len() - before;
        if (chosen as f64) < LEAST * left as f64 {
            order.truncate(before);
            break;
        }
        left -= chosen;
        let mut touched = vec![];
        for node in order[before..].iter().map(|node| *node as usize) {
            gone[node] = true;
            let ends = std::mem::take(&mut neighbours[node]);
            for &end in &ends {
                let others = ends.iter().filter(|other| **other != end);
                neighbours[end as usize].extend(others);
                touched.push(end);
            }
        }
        // Once for each, not once for each of its neighbours: of a bus all may have gone.
        touched.sort_unstable();
        touched.dedup();
        for node in touched {
            let list = &mut neighbours[node as usize];
            list.retain(|other| !gone[*other as usize]);
            list.sort_unstable();
            list.dedup();
        }
    }
    let others: Vec<u32> = (0..n as u32).filter(|node| !gone[*node as usize]).collect();
    let mut number = vec![0u32; n];
    others.iter().enumerate().for_each(|(k, node)| number[*node as usize] = k as u32);
    let pairs: Vec<(u32, u32)> = others
        .iter()
        .flat_map(|node| {
            let greater = neighbours[*node as usize].iter().filter(move |other| *other > node);
            greater.map(move |other| (*node, *other))
        })
        .map(|(a, b)| (number[a as usize], number[b as usize]))
        .collect();
    let (graph, _) = Pattern::from_triplets(others.len(), &pairs);
    order.extend(rest(&graph)?.into_iter().map(|k| others[k as usize]));
    Some(order)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn backwards(graph: &Pattern) -> Option<Vec<u32>> {
        Some((0..graph.n as u32).rev().collect())
    }

    #[test]
    fn a_path_is_halved_each_time() {
        let order = order(64, (0..63).map(|k| (k, k + 1)), backwards).unwrap();
        assert_eq!(order[..32], (0..64).step_by(2).collect::<Vec<u32>>());
        assert_eq!(order[32..48], (1..64).step_by(4).collect::<Vec<u32>>());
        assert_eq!(order.len(), 64);
    }

    #[test]
    fn the_nodes_of_a_star_go_at_once() {
        // A hub that lists its neighbours anew for each of them would take minutes.
        const ENDS: u32 = 300_000;
        let order = order(ENDS as usize + 1, (1..=ENDS).map(|k| (0, k)), backwards).unwrap();
        assert_eq!(order.len(), ENDS as usize + 1);
        assert_eq!(order[ENDS as usize], 0);
    }

    #[test]
    fn a_grid_is_left_to_the_other() {
        let node = |i: u32, j: u32| 9 * i + j;
        let across = (0..9).flat_map(|i| (0..8).map(move |j| (node(i, j), node(i, j + 1))));
        let down = (0..8).flat_map(|i| (0..9).map(move |j| (node(i, j), node(i + 1, j))));
        let edges: Vec<(u32, u32)> = across.chain(down).collect();
        assert_eq!(order(81, edges.into_iter(), backwards), Some((0..81).rev().collect()));
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn every_node_goes_once(edges in prop::collection::vec((0..40u32, 0..40u32), 0..60)) {
            let mut order = order(40, edges.into_iter(), backwards).unwrap();
            order.sort_unstable();
            prop_assert_eq!(order, (0..40).collect::<Vec<u32>>());
        }
    }
}
