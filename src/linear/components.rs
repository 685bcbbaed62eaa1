//! Strongly connected components of a directed graph (R. E. Tarjan, *Depth-first search and linear graph algorithms*, 1972),
//! without recursion.

/// Sets of nodes that reach each other, each in ascending order; a set comes after all that it leads to. `next` gives the
/// nodes that a node leads to.
pub fn components<'a>(count: usize, next: &dyn Fn(usize) -> &'a [u32]) -> Vec<Vec<u32>> {
    const NEW: u32 = u32::MAX;
    let mut index = vec![NEW; count];
    let mut low = vec![0u32; count];
    let mut on_stack = vec![false; count];
    let mut stack = Vec::new();
    let mut calls: Vec<(u32, u32)> = Vec::new();
    let mut next_index = 0;
    let mut found = Vec::new();
    for root in 0..count as u32 {
        if index[root as usize] != NEW {
            continue;
        }
        calls.push((root, 0));
        while let Some((node, at)) = calls.last_mut() {
            let v = *node as usize;
            if *at == 0 && index[v] == NEW {
                index[v] = next_index;
                low[v] = next_index;
                next_index += 1;
                stack.push(*node);
                on_stack[v] = true;
            }
            if let Some(&to) = next(v).get(*at as usize) {
                *at += 1;
                let w = to as usize;
                if index[w] == NEW {
                    calls.push((to, 0));
                } else if on_stack[w] {
                    low[v] = low[v].min(index[w]);
                }
                continue;
            }
            calls.pop();
            if let Some(&(parent, _)) = calls.last() {
                low[parent as usize] = low[parent as usize].min(low[v]);
            }
            if low[v] == index[v] {
                let mut component = Vec::new();
                while let Some(w) = stack.pop() {
                    on_stack[w as usize] = false;
                    component.push(w);
                    if w as usize == v {
                        break;
                    }
                }
                component.sort_unstable();
                found.push(component);
            }
        }
    }
    found
}
