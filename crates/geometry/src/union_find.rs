//! Which of some numbered things hang together.

/// Disjoint sets of the numbers below `n`.
#[derive(Debug, Clone)]
pub struct UnionFind {
    parents: Vec<usize>,
}

impl UnionFind {
    /// Each of `n` members alone.
    #[inline]
    pub fn new(n: usize) -> Self {
        UnionFind { parents: (0..n).collect() }
    }

    /// The representative of a member's set: its lowest member.
    #[inline]
    pub fn find(&mut self, mut member: usize) -> usize {
        while self.parents[member] != member {
            self.parents[member] = self.parents[self.parents[member]];
            member = self.parents[member];
        }
        member
    }

    /// Unites the sets of two members; true if they were apart.
    #[inline]
    pub fn join(&mut self, a: usize, b: usize) -> bool {
        let (a, b) = (self.find(a), self.find(b));
        self.parents[a.max(b)] = a.min(b);
        a != b
    }

    /// For each member the number of its set, counted in the order of first appearance.
    #[inline]
    pub fn numbered(&mut self) -> Vec<usize> {
        let mut numbers: Vec<usize> = Vec::with_capacity(self.parents.len());
        let mut count = 0;
        for member in 0..self.parents.len() {
            let root = self.find(member);
            let number = numbers.get(root).copied().unwrap_or(count);
            count = count.max(number + 1);
            numbers.push(number);
        }
        numbers
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sets_are_numbered_as_they_appear() {
        let mut groups = UnionFind::new(6);
        assert!(groups.join(5, 1) && groups.join(4, 0) && groups.join(3, 5));
        assert!(!groups.join(1, 3), "they are together already");
        assert_eq!(groups.numbered(), [0, 1, 2, 1, 0, 1]);
        assert_eq!(groups.find(5), 1);
    }
}
