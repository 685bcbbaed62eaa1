//! The search for good places: a first guess, simulated annealing, small shifts in the end.

use super::{Cell, State, after, turned};
use crate::quantity::random::fraction;

/// How far things are shifted in the end.
const REACH: i32 = 3;

/// One cell to each side.
const WAYS: [Cell; 4] = [(1, 0), (-1, 0), (0, 1), (0, -1)];

impl State<'_> {
    /// Sets the blocks one after the other: the longest chain in a line, then each beside what it hangs on.
    pub(super) fn begin(&mut self) {
        let count = self.at.len();
        let mut moved = vec![false; count];
        let mut waiting: Vec<usize> = vec![];
        // Each part of a graph that does not hang together goes below those before it.
        while let Some(start) = (0..count).find(|k| !self.placed[*k]) {
            let chain = self.chain(start);
            let down = (0..count)
                .filter(|k| self.placed[*k])
                .map(|k| self.at[k].0.1 + self.size(k).1 + 1)
                .max();
            let mut x = 0;
            for block in &chain {
                self.put(*block, (x, down.unwrap_or(0)), 0);
                self.placed[*block] = true;
                x += self.size(*block).0;
            }
            waiting.extend(&chain);
            let mut at = 0;
            while at < waiting.len() {
                let block = waiting[at];
                at += 1;
                let mut next: Vec<usize> =
                    self.beside[block].iter().copied().filter(|b| !self.placed[*b]).collect();
                // Large parts first: leaves find room between them.
                next.sort_by_key(|b| (std::cmp::Reverse(self.beside[*b].len()), *b));
                next.dedup();
                for new in next {
                    self.settle(new, block, &mut moved);
                    waiting.push(new);
                }
            }
            waiting.clear();
        }
    }

    /// Puts a block where it costs least near another.
    fn settle(&mut self, block: usize, near: usize, moved: &mut [bool]) {
        let ((u, v), (s, t)) = (self.at[near].0, self.size(near));
        let mut best: Option<(i64, Cell, usize)> = None;
        self.placed[block] = true;
        moved[block] = true;
        for reach in [2, 5, 40] {
            let turns = if self.problem.blocks[block].nodes.len() > 1 { 8 } else { 1 };
            for turn in 0..turns {
                self.at[block].1 = turn;
                let (w, h) = self.size(block);
                for y in v - h - reach + 1..v + t + reach {
                    for x in u - w - reach + 1..u + s + reach {
                        self.put(block, (x, y), turn);
                        if !self.is_free(block) {
                            continue;
                        }
                        let cost = self.local(&[block], moved) + self.shape();
                        if best.is_none_or(|(least, ..)| cost < least) {
                            best = Some((cost, (x, y), turn));
                        }
                    }
                }
            }
            if best.is_some() {
                break;
            }
        }
        if let Some((_, corner, turn)) = best {
            self.put(block, corner, turn);
        }
        moved[block] = false;
    }

    /// The longest of the shortest ways through the part that a block is in, from its beginning to its end.
    fn chain(&self, start: usize) -> Vec<usize> {
        let far = |from: usize| {
            let mut before = vec![None; self.at.len()];
            let mut order = vec![from];
            let mut seen = vec![false; self.at.len()];
            seen[from] = true;
            let mut at = 0;
            while at < order.len() {
                for next in &self.beside[order[at]] {
                    if !seen[*next] {
                        seen[*next] = true;
                        before[*next] = Some(order[at]);
                        order.push(*next);
                    }
                }
                at += 1;
            }
            (order.last().copied().unwrap_or(from), before)
        };
        let (end, _) = far(start);
        let (other, before) = far(end);
        let mut chain = vec![other];
        while let Some(next) = before[chain[chain.len() - 1]] {
            chain.push(next);
        }
        // As many half arrows as possible point to the right.
        let forward = |chain: &[usize]| {
            let points = |pair: &[usize]| {
                self.edges_of[pair[0]]
                    .iter()
                    .any(|k| self.block_of[self.problem.edges[*k].to] == pair[1])
            };
            chain.windows(2).filter(|pair| points(pair)).count()
        };
        if 2 * forward(&chain) + 1 < chain.len() {
            chain.reverse();
        }
        chain
    }

    /// Everything beyond a block, as seen from a neighbour; `None` where a way leads back.
    fn beyond(&self, block: usize, from: usize) -> Option<Vec<usize>> {
        let mut found = vec![block];
        let mut seen = vec![false; self.at.len()];
        seen[block] = true;
        let mut at = 0;
        while at < found.len() {
            for next in &self.beside[found[at]] {
                if *next == from {
                    if found[at] != block {
                        return None;
                    }
                } else if !seen[*next] {
                    seen[*next] = true;
                    found.push(*next);
                }
            }
            at += 1;
        }
        Some(found)
    }

    /// What hangs on the rest by one block, with the block it hangs on.
    fn branches(&self) -> Vec<(usize, Vec<usize>)> {
        let count = self.at.len();
        let mut branches = vec![];
        for block in 0..count {
            for from in &self.beside[block] {
                // A branch is what hangs on the rest, not the rest that hangs on it.
                let branch = self.beyond(block, *from);
                let branch = branch.filter(|b| b.len() > 1 && 2 * b.len() <= count);
                branches.extend(branch.map(|branch| (*from, branch)));
            }
        }
        branches
    }

    /// Shifts and turns blocks and branches a little as long as that costs less.
    pub(super) fn polish(&mut self) {
        let mut sets: Vec<Vec<usize>> = (0..self.at.len()).map(|block| vec![block]).collect();
        sets.extend(self.branches().into_iter().map(|(_, branch)| branch));
        let mut moved = vec![false; self.at.len()];
        for _ in 0..4 {
            let mut better = false;
            for set in &sets {
                set.iter().for_each(|block| moved[*block] = true);
                let old: Vec<(Cell, usize)> = set.iter().map(|block| self.at[*block]).collect();
                let rigid = set.len() == 1 && self.problem.blocks[set[0]].nodes.len() > 1;
                let mut least = self.local(set, &moved) + self.shape();
                let mut best = old.clone();
                for turn in 0..if rigid { 8 } else { 1 } {
                    for (x, y) in
                        (-REACH..=REACH).flat_map(|y| (-REACH..=REACH).map(move |x| (x, y)))
                    {
                        for (block, (corner, own)) in set.iter().zip(&old) {
                            let turn = if rigid { turn } else { *own };
                            self.at[*block] = ((corner.0 + x, corner.1 + y), turn);
                        }
                        if !set.iter().all(|block| self.is_free(*block)) {
                            continue;
                        }
                        let new: Vec<(Cell, usize)> = set.iter().map(|b| self.at[*b]).collect();
                        for (block, (corner, turn)) in set.iter().zip(&new) {
                            self.put(*block, *corner, *turn);
                        }
                        let cost = self.local(set, &moved) + self.shape();
                        if cost < least {
                            (least, best, better) = (cost, new, true);
                        }
                    }
                }
                for (block, (corner, turn)) in set.iter().zip(&best) {
                    self.put(*block, *corner, *turn);
                    moved[*block] = false;
                }
            }
            if !better {
                break;
            }
        }
    }

    pub(super) fn anneal(&mut self, steps: u64) {
        let count = self.at.len();
        let branches = self.branches();
        let loose: Vec<usize> = (0..count).filter(|k| !self.beside[*k].is_empty()).collect();
        if loose.is_empty() {
            return;
        }
        let mut best = self.at.clone();
        let (mut excess, mut least) = (0_i64, 0_i64);
        let mut moved = vec![false; count];
        for step in 0..steps {
            let part = step as f64 / steps as f64;
            let warmth = 14.0 * libm::pow(0.02, part);
            let mut turn_of = None;
            let mut set: Vec<usize> = vec![];
            let kind = self.next(10);
            let mut target = vec![];
            if kind < 3 && !branches.is_empty() {
                let pick = self.next(branches.len());
                let (anchor, branch) = &branches[pick];
                set.clone_from(branch);
                let anchor = *anchor;
                if self.next(2) == 0 {
                    let way = WAYS[self.next(4)];
                    target = set
                        .iter()
                        .map(|b| (self.at[*b].0.0 + way.0, self.at[*b].0.1 + way.1))
                        .collect();
                } else {
                    let turn = 1 + self.next(7);
                    let (origin, _) = self.at[anchor];
                    for b in &set {
                        let ((x, y), (w, h)) = (self.at[*b].0, self.size(*b));
                        let one = turned(turn, (x - origin.0, y - origin.1));
                        let two = turned(turn, (x + w - 1 - origin.0, y + h - 1 - origin.1));
                        target.push((one.0.min(two.0) + origin.0, one.1.min(two.1) + origin.1));
                    }
                    turn_of = Some(turn);
                }
            } else if kind < 5 {
                let (a, b) = (loose[self.next(loose.len())], loose[self.next(loose.len())]);
                if a == b || self.size(a) != self.size(b) {
                    continue;
                }
                set = vec![a, b];
                target = vec![self.at[b].0, self.at[a].0];
            } else {
                let block = loose[self.next(loose.len())];
                set.push(block);
                if kind < 8 {
                    let pick = self.next(self.beside[block].len());
                    let near = self.beside[block][pick];
                    let ((u, v), (s, t), (w, h)) =
                        (self.at[near].0, self.size(near), self.size(block));
                    let reach = 1 + self.next(2) as i32;
                    let x = u - w - reach + 1 + self.next((w + s + 2 * reach - 1) as usize) as i32;
                    let y = v - h - reach + 1 + self.next((h + t + 2 * reach - 1) as usize) as i32;
                    target.push((x, y));
                } else {
                    let (x, y) = self.at[block].0;
                    let way = WAYS[self.next(4)];
                    target.push((x + way.0, y + way.1));
                }
                if self.problem.blocks[block].nodes.len() > 1 && self.next(3) == 0 {
                    turn_of = Some(self.next(8));
                }
            }
            let old: Vec<(Cell, usize)> = set.iter().map(|b| self.at[*b]).collect();
            for block in &set {
                moved[*block] = true;
            }
            // Where they would stand on others, nothing more is asked.
            for (block, corner) in set.iter().zip(&target) {
                let turn = turn_of.map_or(self.at[*block].1, |turn| after(self.at[*block].1, turn));
                self.at[*block] = (*corner, turn);
            }
            let free = set.iter().all(|block| self.is_free(*block));
            let new: Vec<(Cell, usize)> = set.iter().map(|b| self.at[*b]).collect();
            for (block, place) in set.iter().zip(&old) {
                self.at[*block] = *place;
            }
            if free {
                let before = self.local(&set, &moved) + self.shape();
                for (block, (corner, turn)) in set.iter().zip(&new) {
                    self.put(*block, *corner, *turn);
                }
                let change = self.local(&set, &moved) + self.shape() - before;
                self.random += 1;
                let chance = fraction(31 + self.seed, self.random);
                if change <= 0 || chance < libm::exp(-(change as f64) / warmth) {
                    excess += change;
                    if excess < least {
                        least = excess;
                        best.clone_from(&self.at);
                    }
                } else {
                    for (block, (corner, turn)) in set.iter().zip(&old) {
                        self.put(*block, *corner, *turn);
                    }
                }
            }
            for block in &set {
                moved[*block] = false;
            }
        }
        for (block, (corner, turn)) in best.into_iter().enumerate() {
            self.put(block, corner, turn);
        }
    }
}
