//! Disjoint sets with path halving.

/// Disjoint sets over `0..n`.
pub(super) struct UnionFind {
    parent: Vec<u32>,
    sets: usize,
}

impl UnionFind {
    pub(super) fn new(n: usize) -> Self {
        Self {
            parent: (0..n as u32).collect(),
            sets: n,
        }
    }

    /// Name of the set of `x`: its smallest member, so that names do not depend on the order of unions.
    pub(super) fn find(&mut self, mut x: u32) -> u32 {
        while self.parent[x as usize] != x {
            let up = self.parent[self.parent[x as usize] as usize];
            self.parent[x as usize] = up;
            x = up;
        }
        x
    }

    pub(super) fn unite(&mut self, a: u32, b: u32) {
        let (a, b) = (self.find(a), self.find(b));
        if a != b {
            self.parent[a.max(b) as usize] = a.min(b);
            self.sets -= 1;
        }
    }

    /// How many sets there are.
    pub(super) fn sets(&self) -> usize {
        self.sets
    }
}
