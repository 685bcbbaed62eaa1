//! Hypopaths: edges of the tree that form a path in the graph, or in another of the same cycles; and the edge that
//! closes such a path.
//!
//! Members are cut off from the tree of members, one leaf after the other, while they hold nothing of the path, or a
//! piece of it that joins the two nodes of their marker, so that the marker stands for it. What is left of a path is one
//! member, or a chain of members, in each of which the path runs from one marker to the next, with an end in the first
//! and in the last; anything else is no path in any graph of these cycles.

use super::decomposition::{Decomposition, Kind, What};

/// What is left of a path within one block.
#[derive(Clone, Debug)]
pub struct Path {
    chain: Vec<Link>,
}

/// A member of the chain.
#[derive(Clone, Debug)]
struct Link {
    member: usize,
    /// Edges of the path, markers among them.
    path: Vec<usize>,
    /// The marker towards the member before it in the chain.
    before: Option<usize>,
    /// The marker towards the next.
    after: Option<usize>,
}

/// A member of a block while leaves are cut off.
#[derive(Default)]
struct Reached {
    member: usize,
    /// The place of the member from which it was reached, and its own marker towards it.
    parent: Option<(usize, usize)>,
    path: Vec<usize>,
    /// Its markers towards members, reached from it, that cannot be cut off, and their places.
    open: Vec<(usize, usize)>,
}

/// A member of the chain as it becomes part of a prime: the node where the path touches each marker, and the other.
struct Piece {
    member: usize,
    before: Option<[usize; 2]>,
    after: Option<[usize; 2]>,
    /// Where the path ends.
    end: Option<usize>,
}

impl Decomposition {
    /// One path for each block that the rows belong to; `None` where they form none.
    pub(super) fn paths(&mut self, rows: &[usize]) -> Option<Vec<Path>> {
        let mut of_member: std::collections::HashMap<usize, Vec<usize>> = Default::default();
        let mut members = Vec::new();
        for edge in rows.iter().filter_map(|row| self.element[*row]) {
            let member = self.edges[edge].member;
            let path = of_member.entry(member).or_default();
            if path.is_empty() {
                members.push(member);
            }
            path.push(edge);
        }
        let mut paths = Vec::new();
        for member in members {
            if of_member.contains_key(&member) {
                paths.push(self.path(member, &mut of_member)?);
            }
        }
        Some(paths)
    }

    /// Takes the edges of a block, which `root` is a member of, out of `of_member` and makes them a path.
    fn path(
        &mut self,
        root: usize,
        of_member: &mut std::collections::HashMap<usize, Vec<usize>>,
    ) -> Option<Path> {
        let mut reached = vec![Reached { member: root, ..Reached::default() }];
        let mut at = 0;
        // Members without an edge of the path are needed only where they join others; once all edges are found, the
        // search may end.
        while at < reached.len() {
            let member = reached[at].member;
            reached[at].path = of_member.remove(&member).unwrap_or_default();
            let towards = reached[at].parent.map(|(_, marker)| marker);
            if of_member.is_empty() {
                at += 1;
                continue;
            }
            for edge in &self.members[member].edges {
                if let What::Marker(mate) = self.edges[*edge].what
                    && Some(*edge) != towards
                {
                    let member = self.edges[mate].member;
                    let parent = Some((at, mate));
                    reached.push(Reached { member, parent, ..Reached::default() });
                }
            }
            at += 1;
        }
        // Leaves first.
        for place in (1..reached.len()).rev() {
            let Some((parent, marker)) = reached[place].parent else { continue };
            let Reached { member, path, open, .. } = &reached[place];
            if open.is_empty() && path.is_empty() {
                continue;
            }
            let whole = open.is_empty() && self.joins(*member, &path.clone(), marker);
            if let What::Marker(mate) = self.edges[marker].what {
                if whole {
                    reached[parent].path.push(mate);
                } else {
                    reached[parent].open.push((mate, place));
                }
            }
        }
        // Then from the root's side.
        let mut top = 0;
        while let [(marker, below)] = *reached[top].open.as_slice() {
            let path = reached[top].path.clone();
            if !path.is_empty() && !self.joins(reached[top].member, &path, marker) {
                break;
            }
            if let (What::Marker(mate), false) = (self.edges[marker].what, path.is_empty()) {
                reached[below].path.push(mate);
            }
            reached[below].parent = None;
            top = below;
        }
        self.chain(&reached, top)
    }

    /// The members left, in the order of the path.
    fn chain(&self, reached: &[Reached], top: usize) -> Option<Path> {
        let mut chain = vec![Link {
            member: reached[top].member,
            path: reached[top].path.clone(),
            before: None,
            after: None,
        }];
        if reached[top].open.len() > 2 {
            return None;
        }
        for (side, &(marker, below)) in reached[top].open.iter().enumerate() {
            let (mut marker, mut place) = (marker, below);
            loop {
                let What::Marker(mate) = self.edges[marker].what else { return None };
                let Reached { member, path, open, .. } = &reached[place];
                let mut link =
                    Link { member: *member, path: path.clone(), before: None, after: None };
                if side == 0 {
                    chain.last_mut()?.after = Some(marker);
                    link.before = Some(mate);
                    chain.push(link);
                } else {
                    chain.first_mut()?.before = Some(marker);
                    link.after = Some(mate);
                    chain.insert(0, link);
                }
                match *open.as_slice() {
                    [] => break,
                    [(next, below)] => (marker, place) = (next, below),
                    _ => return None,
                }
            }
        }
        Some(Path { chain })
    }

    /// Whether edges of a member are a path between the nodes of its marker.
    fn joins(&mut self, member: usize, path: &[usize], marker: usize) -> bool {
        match self.members[member].kind {
            Kind::Bond => path.len() == 1,
            Kind::Polygon => path.len() + 1 == self.members[member].edges.len(),
            Kind::Prime => {
                let [u, v] = self.ends(marker);
                self.walk(path).is_some_and(|[x, y]| [x, y] == [u, v] || [x, y] == [v, u])
            }
        }
    }

    /// The two ends of a path in a prime. Edges of the tree close no cycle, so that two ends and no fork are enough.
    fn walk(&mut self, path: &[usize]) -> Option<[usize; 2]> {
        let mut ends: Vec<usize> = Vec::with_capacity(2 * path.len());
        for edge in path {
            ends.extend(self.ends(*edge));
        }
        ends.sort_unstable();
        let mut single = Vec::with_capacity(2);
        let same = ends.chunk_by(|a, b| a == b);
        for node in same {
            match *node {
                [node] if single.len() < 2 => single.push(node),
                [_, _] => {}
                _ => return None,
            }
        }
        single.try_into().ok()
    }

    /// A new edge between the ends of a path; the caller says what it stands for.
    pub(super) fn close(&mut self, path: &Path) -> Option<usize> {
        match path.chain.as_slice() {
            [only] => self.close_within(only),
            chain => self.close_chain(chain),
        }
    }

    /// A path within one member.
    fn close_within(&mut self, link: &Link) -> Option<usize> {
        let Link { member, path, .. } = link;
        match self.members[*member].kind {
            Kind::Bond => (path.len() == 1).then(|| self.parallel(path[0])),
            Kind::Polygon => {
                let rest = self.rest(*member, path);
                match (path.as_slice(), rest.as_slice()) {
                    ([edge], _) | (_, [edge]) => Some(self.parallel(*edge)),
                    // Two polygons, with a bond between them.
                    _ => {
                        let edge = self.bundle(path)?;
                        Some(self.parallel(edge))
                    }
                }
            }
            Kind::Prime => {
                let [x, y] = self.walk(path)?;
                let edges = self.members[*member].edges.clone();
                let beside = edges.into_iter().find(|edge| {
                    let ends = self.ends(*edge);
                    ends == [x, y] || ends == [y, x]
                });
                Some(match beside {
                    Some(edge) => self.parallel(edge),
                    None => self.join(*member, [x, y]),
                })
            }
        }
    }

    /// A new edge of a prime.
    fn join(&mut self, member: usize, ends: [usize; 2]) -> usize {
        let new = self.edge(What::Marker(usize::MAX));
        self.edges[new].ends = ends;
        self.put(new, member);
        new
    }

    /// The edges of a member that are neither among these nor among the markers.
    fn rest(&self, member: usize, path: &[usize]) -> Vec<usize> {
        let edges = self.members[member].edges.iter().copied();
        let mut sorted = path.to_vec();
        sorted.sort_unstable();
        edges.filter(|edge| sorted.binary_search(edge).is_err()).collect()
    }

    /// Makes one prime of a chain of members, with an edge between the ends of the path.
    fn close_chain(&mut self, chain: &[Link]) -> Option<usize> {
        let pieces: Vec<Piece> =
            chain.iter().map(|link| self.piece(link)).collect::<Option<_>>()?;
        let largest = pieces.iter().max_by_key(|piece| self.members[piece.member].edges.len())?;
        let whole = largest.member;
        for pair in pieces.windows(2) {
            let ([a, b], [c, d]) = (pair[0].after?, pair[1].before?);
            self.identify(a, c);
            self.identify(b, d);
        }
        for link in chain {
            for marker in [link.before, link.after].into_iter().flatten() {
                self.take(marker);
            }
        }
        for piece in &pieces {
            if piece.member != whole {
                for edge in std::mem::take(&mut self.members[piece.member].edges) {
                    self.put(edge, whole);
                }
            }
        }
        self.members[whole].kind = Kind::Prime;
        let ends = [self.now(pieces.first()?.end?), self.now(pieces.last()?.end?)];
        Some(self.join(whole, ends))
    }

    /// Gives the edges of a member of the chain the nodes that they have in a prime.
    fn piece(&mut self, link: &Link) -> Option<Piece> {
        let Link { member, path, before, after } = link;
        let member = *member;
        let markers: Vec<usize> = [*before, *after].into_iter().flatten().collect();
        let mut held = path.clone();
        held.extend(&markers);
        let piece = |before, after, end| Some(Piece { member, before, after, end });
        match self.members[member].kind {
            Kind::Polygon => {
                // Path and rest run side by side from the one marker to the other, or to where the path ends.
                let rest = self.rest(member, &held);
                let (path, rest) = (self.bundle(path), self.bundle(&rest));
                let near = [self.node(), self.node()];
                let mut far = near;
                for (at, edge) in [path, rest].into_iter().enumerate() {
                    if let Some(edge) = edge {
                        far[at] = self.node();
                        self.edges[edge].ends = [near[at], far[at]];
                    }
                }
                match (*before, *after) {
                    (Some(before), Some(after)) => {
                        self.edges[before].ends = near;
                        self.edges[after].ends = far;
                        piece(Some(near), Some(far), None)
                    }
                    (Some(marker), None) | (None, Some(marker)) => {
                        self.edges[marker].ends = near;
                        path?;
                        self.identify(far[0], far[1]);
                        let towards = |marker: &Option<usize>| marker.map(|_| near);
                        piece(towards(before), towards(after), Some(far[0]))
                    }
                    (None, None) => None,
                }
            }
            Kind::Bond => {
                let (Some(before), Some(after)) = (*before, *after) else { return None };
                let rest = self.rest(member, &markers);
                let rest = self.bundle(&rest)?;
                let [u, v] = [self.node(), self.node()];
                for edge in [before, after, rest] {
                    self.edges[edge].ends = [u, v];
                }
                match path.len() {
                    0 => piece(Some([u, v]), Some([u, v]), None),
                    1 => piece(Some([u, v]), Some([v, u]), None),
                    _ => None,
                }
            }
            Kind::Prime => {
                // At which of its nodes the path touches a marker, and the other node.
                let touch = |[u, v]: [usize; 2], node| match node {
                    node if node == u => Some([u, v]),
                    node if node == v => Some([v, u]),
                    _ => None,
                };
                let ways: Vec<[usize; 2]> = match path.as_slice() {
                    [] => {
                        let ends = self.ends(*markers.first()?);
                        ends.into_iter().map(|node| [node, node]).collect()
                    }
                    path => {
                        let [x, y] = self.walk(path)?;
                        vec![[x, y], [y, x]]
                    }
                };
                match (*before, *after) {
                    (Some(before), Some(after)) => {
                        let (before, after) = (self.ends(before), self.ends(after));
                        let (before, after) = ways
                            .into_iter()
                            .find_map(|[x, y]| Some((touch(before, x)?, touch(after, y)?)))?;
                        piece(Some(before), Some(after), None)
                    }
                    (Some(marker), None) | (None, Some(marker)) => {
                        let ends = self.ends(marker);
                        let (at, end) =
                            ways.into_iter().find_map(|[x, y]| Some((touch(ends, x)?, y)))?;
                        piece(before.map(|_| at), after.map(|_| at), Some(end))
                    }
                    (None, None) => None,
                }
            }
        }
    }
}
