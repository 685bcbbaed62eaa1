//! Minimum degree ordering by a quotient graph with approximate degrees (Amestoy, Davis, Duff, 1996).
//!
//! Eliminated nodes become *elements*: cliques of the nodes that they joined. A node's degree is bounded from above by
//! the sizes of its elements, which costs far less than counting its neighbours.

const NONE: u32 = u32::MAX;

/// Nodes by degree, in doubly linked lists.
struct Buckets {
    head: Vec<u32>,
    next: Vec<u32>,
    previous: Vec<u32>,
    lowest: usize,
}

impl Buckets {
    fn insert(&mut self, node: u32, degree: usize) {
        let first = self.head[degree];
        self.next[node as usize] = first;
        self.previous[node as usize] = NONE;
        if first != NONE {
            self.previous[first as usize] = node;
        }
        self.head[degree] = node;
        self.lowest = self.lowest.min(degree);
    }

    fn remove(&mut self, node: u32, degree: usize) {
        let (next, previous) = (self.next[node as usize], self.previous[node as usize]);
        if previous == NONE {
            self.head[degree] = next;
        } else {
            self.next[previous as usize] = next;
        }
        if next != NONE {
            self.previous[next as usize] = previous;
        }
    }

    fn pop(&mut self) -> Option<(u32, usize)> {
        while self.lowest < self.head.len() {
            let node = self.head[self.lowest];
            if node != NONE {
                self.remove(node, self.lowest);
                return Some((node, self.lowest));
            }
            self.lowest += 1;
        }
        None
    }
}

/// The order of elimination for a symmetric graph given by its neighbour lists (no loops, no duplicates, each edge on
/// both sides). Nodes with very many neighbours (buses) come last.
pub fn minimum_degree(mut neighbours: Vec<Vec<u32>>) -> Vec<u32> {
    let n = neighbours.len();
    let dense = (10.0 * (n as f64).sqrt()).max(16.0) as usize;
    let mut buses: Vec<u32> =
        (0..n as u32).filter(|&i| neighbours[i as usize].len() > dense).collect();
    buses.sort_by_key(|&i| neighbours[i as usize].len());
    // Weight: how many original nodes a node stands for; 0 once it is eliminated, merged or set aside.
    let mut weight = vec![1u32; n];
    for &bus in &buses {
        weight[bus as usize] = 0;
    }
    if !buses.is_empty() {
        for list in &mut neighbours {
            list.retain(|&j| weight[j as usize] != 0);
        }
    }
    let mut elements: Vec<Vec<u32>> = vec![Vec::new(); n];
    let mut clique: Vec<Vec<u32>> = vec![Vec::new(); n];
    let mut extent = vec![0usize; n];
    let mut alive = vec![false; n];
    let mut merged: Vec<Vec<u32>> = vec![Vec::new(); n];
    let mut degree: Vec<usize> = neighbours.iter().map(Vec::len).collect();
    let mut buckets = Buckets {
        head: vec![NONE; n + 1],
        next: vec![NONE; n],
        previous: vec![NONE; n],
        lowest: n,
    };
    for i in (0..n as u32).rev() {
        if weight[i as usize] != 0 {
            buckets.insert(i, degree[i as usize]);
        }
    }
    let mut left = n - buses.len();
    let mut mark = vec![0u32; n];
    let mut stamp = 0u32;
    let mut outside = vec![(0u32, 0usize); n];
    let mut order = Vec::with_capacity(n);
    while let Some((pivot, _)) = buckets.pop() {
        let p = pivot as usize;
        // The new element: all neighbours of the pivot, direct or through its elements, which it absorbs.
        stamp += 1;
        mark[p] = stamp;
        let mut members = Vec::new();
        let mut size = 0usize;
        for list in std::iter::once(std::mem::take(&mut neighbours[p])).chain(
            std::mem::take(&mut elements[p]).into_iter().map(|e| {
                alive[e as usize] = false;
                std::mem::take(&mut clique[e as usize])
            }),
        ) {
            for i in list {
                if weight[i as usize] != 0 && mark[i as usize] != stamp {
                    mark[i as usize] = stamp;
                    size += weight[i as usize] as usize;
                    members.push(i);
                }
            }
        }
        left -= weight[p] as usize;
        weight[p] = 0;
        order.push(pivot);
        // How much of every neighbouring element lies outside the new one.
        for &i in &members {
            for &e in &elements[i as usize] {
                if !alive[e as usize] {
                    continue;
                }
                let entry = &mut outside[e as usize];
                if entry.0 != stamp {
                    *entry = (stamp, extent[e as usize]);
                }
                entry.1 -= weight[i as usize] as usize;
            }
        }
        alive[p] = true;
        for &i in &members {
            let node = i as usize;
            buckets.remove(i, degree[node]);
            neighbours[node].retain(|&j| weight[j as usize] != 0 && mark[j as usize] != stamp);
            // An element that lies wholly inside the new one says nothing more.
            elements[node].retain(|&e| {
                alive[e as usize] && {
                    let (seen, rest) = outside[e as usize];
                    debug_assert_eq!(seen, stamp);
                    rest > 0
                }
            });
            let own = weight[node] as usize;
            let around: usize = neighbours[node].iter().map(|&j| weight[j as usize] as usize).sum();
            let beyond: usize = elements[node].iter().map(|&e| outside[e as usize].1).sum();
            let bound = (degree[node] + size - own).min(size - own + around + beyond);
            elements[node].push(pivot);
            degree[node] = bound.min(left.saturating_sub(own));
        }
        merge_twins(&members, &neighbours, &elements, &mut weight, &mut merged, &mut degree);
        let mut kept = Vec::with_capacity(members.len());
        for i in members {
            let node = i as usize;
            if weight[node] == 0 {
                neighbours[node] = Vec::new();
                elements[node] = Vec::new();
            } else if neighbours[node].is_empty() && elements[node] == [pivot] {
                // It joins nothing new: it may go at once, with the pivot.
                left -= weight[node] as usize;
                weight[node] = 0;
                elements[node] = Vec::new();
                order.push(i);
            } else {
                buckets.insert(i, degree[node]);
                kept.push(i);
            }
        }
        extent[p] = kept.iter().map(|&i| weight[i as usize] as usize).sum();
        clique[p] = kept;
    }
    let mut result = Vec::with_capacity(n);
    let mut stack = Vec::new();
    for node in order {
        stack.push(node);
        while let Some(node) = stack.pop() {
            result.push(node);
            stack.append(&mut merged[node as usize]);
        }
    }
    result.extend(buses);
    result
}

/// Nodes with the same neighbours and elements stay alike for ever: the first stands for the others.
fn merge_twins(
    members: &[u32],
    neighbours: &[Vec<u32>],
    elements: &[Vec<u32>],
    weight: &mut [u32],
    merged: &mut [Vec<u32>],
    degree: &mut [usize],
) {
    let sum = |list: &[u32]| list.iter().fold(0u64, |sum, &k| sum.wrapping_add(u64::from(k) + 1));
    let mut keys: Vec<(u64, u32)> = members
        .iter()
        .map(|&i| {
            let (a, e) = (sum(&neighbours[i as usize]), sum(&elements[i as usize]));
            (a.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(e), i)
        })
        .collect();
    keys.sort_unstable();
    let same = |a: &[u32], b: &[u32]| {
        a.len() == b.len() && {
            let sorted = |list: &[u32]| {
                let mut list = list.to_vec();
                list.sort_unstable();
                list
            };
            sorted(a) == sorted(b)
        }
    };
    let mut at = 0;
    while at < keys.len() {
        let (key, first) = keys[at];
        at += 1;
        let f = first as usize;
        while at < keys.len() && keys[at].0 == key {
            let other = keys[at].1;
            let o = other as usize;
            if !same(&neighbours[f], &neighbours[o]) || !same(&elements[f], &elements[o]) {
                break;
            }
            degree[f] = degree[f].saturating_sub(weight[o] as usize);
            weight[f] += weight[o];
            weight[o] = 0;
            merged[f].push(other);
            at += 1;
        }
    }
}
