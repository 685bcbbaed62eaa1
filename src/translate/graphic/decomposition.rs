//! A 2-connected graph as its parts of connectivity 3, and how a column enters it.
//!
//! Each block of the graph is a tree of *members*: bonds (edges in parallel), polygons (edges in series) and primes
//! (3-connected graphs). Two members that are neighbours share a pair of nodes, where each has a *marker* edge; putting
//! the two markers onto each other and deleting them gives back the graph. No two bonds and no two polygons are
//! neighbours: then the members are unique (W. H. Cunningham, J. Edmonds, *A combinatorial decomposition theory*, 1980).
//! Either way round at a marker, and any order of a polygon's edges, give the same cycles, and nothing else does.

/// What an edge of a member stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum What {
    /// An edge of the graph: a row, or the number of rows + a column.
    Element(usize),
    /// The rest of the graph behind this edge of another member.
    Marker(usize),
}

/// An edge of a member.
#[derive(Clone, Copy, Debug)]
pub struct Edge {
    /// What it stands for.
    pub what: What,
    /// The member that it belongs to.
    pub member: usize,
    /// Its place among the member's edges.
    place: usize,
    /// Its nodes where the member is a prime.
    pub ends: [usize; 2],
}

/// The three kinds of members.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Edges in parallel; two of them only as the first two of a block.
    Bond,
    /// Edges in series: any order gives the same cycles.
    Polygon,
    /// A 3-connected graph of four nodes or more, without parallel edges.
    Prime,
}

/// A part.
#[derive(Clone, Debug)]
pub struct Member {
    /// Its kind.
    pub kind: Kind,
    /// Its edges; none when it has become part of another.
    pub edges: Vec<usize>,
}

/// Blocks, each a tree of members.
#[derive(Clone, Debug, Default)]
pub struct Decomposition {
    pub(super) members: Vec<Member>,
    pub(super) edges: Vec<Edge>,
    /// By row, then by column: its edge, once it has one.
    pub(super) element: Vec<Option<usize>>,
    pub(super) rows: usize,
    /// Nodes of primes; those of merged primes point to the one that they have become.
    nodes: Vec<usize>,
}

impl Decomposition {
    /// Rows that no column has joined yet.
    pub fn new(rows: usize) -> Decomposition {
        Decomposition { element: vec![None; rows], rows, ..Decomposition::default() }
    }

    /// Adds a column with these rows as its non-zeros. `None` when no tree has all columns as paths; then the
    /// decomposition is of no further use.
    pub fn add(&mut self, support: &[usize]) -> Option<()> {
        let element = What::Element(self.element.len());
        self.element.push(None);
        let (old, new): (Vec<usize>, Vec<usize>) =
            support.iter().partition(|row| self.element[**row].is_some());
        let paths = self.paths(&old)?;
        if let ([path], []) = (paths.as_slice(), new.as_slice()) {
            let edge = self.close(path)?;
            self.set(edge, element);
            return Some(());
        }
        if new.is_empty() && paths.is_empty() {
            // An edge from a node to itself.
            return Some(());
        }
        // The path runs through one block after the other, and through rows that are new.
        let mut ring: Vec<usize> = new.iter().map(|row| self.edge(What::Element(*row))).collect();
        for path in &paths {
            let inside = self.close(path)?;
            let marker = self.edge(What::Marker(inside));
            self.set(inside, What::Marker(marker));
            ring.push(marker);
        }
        ring.push(self.edge(element));
        let kind = if ring.len() == 2 { Kind::Bond } else { Kind::Polygon };
        self.member(kind, ring);
        Some(())
    }

    /// A new edge that belongs to no member yet.
    pub(super) fn edge(&mut self, what: What) -> usize {
        let edge = self.edges.len();
        self.edges.push(Edge { what, member: usize::MAX, place: 0, ends: [0; 2] });
        if let What::Element(element) = what {
            self.element[element] = Some(edge);
        }
        edge
    }

    /// Gives an edge its meaning, and tells those concerned.
    pub(super) fn set(&mut self, edge: usize, what: What) {
        self.edges[edge].what = what;
        match what {
            What::Element(element) => self.element[element] = Some(edge),
            What::Marker(mate) => self.edges[mate].what = What::Marker(edge),
        }
    }

    /// A new member of these edges.
    pub(super) fn member(&mut self, kind: Kind, edges: Vec<usize>) -> usize {
        let member = self.members.len();
        self.members.push(Member { kind, edges: vec![] });
        for edge in edges {
            self.put(edge, member);
        }
        member
    }

    /// Puts an edge into a member.
    pub(super) fn put(&mut self, edge: usize, member: usize) {
        self.edges[edge].member = member;
        self.edges[edge].place = self.members[member].edges.len();
        self.members[member].edges.push(edge);
    }

    /// Takes an edge out of its member.
    pub(super) fn take(&mut self, edge: usize) {
        let Edge { member, place, .. } = self.edges[edge];
        let edges = &mut self.members[member].edges;
        edges.swap_remove(place);
        if let Some(moved) = edges.get(place) {
            self.edges[*moved].place = place;
        }
    }

    /// The member on the other side of a marker.
    pub(super) fn beyond(&self, edge: usize) -> Option<usize> {
        match self.edges[edge].what {
            What::Marker(mate) => Some(self.edges[mate].member),
            What::Element(_) => None,
        }
    }

    /// A new edge parallel to this one; the caller says what it stands for.
    pub(super) fn parallel(&mut self, edge: usize) -> usize {
        let new = self.edge(What::Marker(edge));
        let is_bond = |member: &usize| self.members[*member].kind == Kind::Bond;
        let bond = Some(self.edges[edge].member).filter(is_bond);
        match bond.or_else(|| self.beyond(edge).filter(is_bond)) {
            Some(bond) => self.put(new, bond),
            None => {
                let moved = self.behind(edge);
                let marker = self.edge(What::Marker(edge));
                self.set(edge, What::Marker(marker));
                self.member(Kind::Bond, vec![moved, marker, new]);
            }
        }
        new
    }

    /// An edge that stands for the same as this one, which thereby stands for nothing.
    fn behind(&mut self, edge: usize) -> usize {
        let what = self.edges[edge].what;
        let moved = self.edge(what);
        self.set(moved, what);
        moved
    }

    /// Moves edges of one member into a new one of the same kind, and puts a marker in their place; a single edge stays
    /// as it is. `None` for no edge.
    pub(super) fn bundle(&mut self, edges: &[usize]) -> Option<usize> {
        match edges {
            [] => None,
            [edge] => Some(*edge),
            [first, ..] => {
                let old = self.edges[*first].member;
                let kind = self.members[old].kind;
                edges.iter().for_each(|edge| self.take(*edge));
                let inside = self.edge(What::Marker(*first));
                let outside = self.edge(What::Marker(inside));
                self.set(inside, What::Marker(outside));
                let part = edges.iter().copied().chain([inside]).collect();
                self.member(kind, part);
                self.put(outside, old);
                Some(outside)
            }
        }
    }

    /// A new node of a prime.
    pub(super) fn node(&mut self) -> usize {
        self.nodes.push(self.nodes.len());
        self.nodes.len() - 1
    }

    /// The node that a node of a prime has become.
    pub(super) fn now(&self, node: usize) -> usize {
        let mut at = node;
        while self.nodes[at] != at {
            at = self.nodes[at];
        }
        at
    }

    /// Makes two nodes one.
    pub(super) fn identify(&mut self, a: usize, b: usize) {
        let (a, b) = (self.now(a), self.now(b));
        self.nodes[b] = a;
    }

    /// The nodes of an edge of a prime. Ways to what a node has become are shortened.
    pub(super) fn ends(&mut self, edge: usize) -> [usize; 2] {
        let ends = self.edges[edge].ends.map(|node| self.now(node));
        self.edges[edge].ends = ends;
        ends
    }
}
