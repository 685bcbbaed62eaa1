//! Disjoint sets, with or without a sign between a member and the head of its set.

/// Disjoint sets of the numbers 0..n.
#[derive(Clone, Debug)]
pub struct Forest {
    above: Vec<usize>,
    /// Whether the member counts with the opposite sign of the one above it.
    flipped: Vec<bool>,
}

impl Forest {
    /// Every number a set of its own.
    pub fn new(count: usize) -> Forest {
        Forest { above: (0..count).collect(), flipped: vec![false; count] }
    }

    /// Adds a number and returns it.
    pub fn add(&mut self) -> usize {
        self.above.push(self.above.len());
        self.flipped.push(false);
        self.above.len() - 1
    }

    /// How many numbers there are.
    pub fn len(&self) -> usize {
        self.above.len()
    }

    /// Takes the last numbers out again, from `first` on, which must not be above any that stay: the lower head stays
    /// head, so that is so where those that go were joined among themselves and to ones that stay.
    pub fn truncate(&mut self, first: usize) {
        self.above.truncate(first);
        self.flipped.truncate(first);
    }

    /// The head of a number's set.
    pub fn root(&self, number: usize) -> usize {
        self.signed(number).0
    }

    /// The head of a number's set, and whether the number is its negative.
    pub fn signed(&self, number: usize) -> (usize, bool) {
        let (mut at, mut flipped) = (number, false);
        while self.above[at] != at {
            flipped ^= self.flipped[at];
            at = self.above[at];
        }
        (at, flipped)
    }

    /// Joins the sets of two numbers; the lower head stays head.
    pub fn join(&mut self, a: usize, b: usize) {
        self.join_signed(a, b, false);
    }

    /// Says that `a` equals `b`, or its negative; the lower head stays head. Nothing happens within one set.
    pub fn join_signed(&mut self, a: usize, b: usize, negative: bool) {
        self.compress(a);
        self.compress(b);
        let ((a, a_flipped), (b, b_flipped)) = (self.signed(a), self.signed(b));
        if a == b {
            return;
        }
        let (low, high) = (a.min(b), a.max(b));
        self.above[high] = low;
        self.flipped[high] = a_flipped ^ b_flipped ^ negative;
    }

    /// Hangs every member on the way to the head directly onto the head, so that ways stay short.
    fn compress(&mut self, number: usize) {
        let (head, mut flipped) = self.signed(number);
        let mut at = number;
        while self.above[at] != at {
            let (above, below) = (self.above[at], self.flipped[at]);
            self.above[at] = head;
            self.flipped[at] = flipped;
            flipped ^= below;
            at = above;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signs_multiply_along_the_way_to_the_head() {
        let mut forest = Forest::new(5);
        forest.join_signed(3, 4, true);
        forest.join_signed(1, 4, false);
        forest.join_signed(0, 3, true);
        assert_eq!(forest.signed(4), (0, false));
        assert_eq!(forest.signed(1), (0, false));
        assert_eq!(forest.signed(3), (0, true));
        assert_eq!(forest.root(2), 2);
    }
}
