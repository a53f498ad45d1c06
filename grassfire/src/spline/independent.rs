//! Large independent sets: which of many conflicting things can be had together.

use std::collections::BTreeSet;

/// Picks many nodes of which no two are neighbours; ties go to the lower `cost`, then to the lower index.
///
/// 1. Greedy: always the node with the fewest remaining neighbours.
/// 2. Local search: replace one chosen node by two others where that is possible (Andrade, Resende and Werneck 2012,
///    doi:10.1007/s10732-012-9196-4), until it is not.
///
/// `neighbours` are sorted lists, symmetric and without the node itself. Returns one flag a node.
pub(super) fn independent_set(neighbours: &[Vec<u32>], cost: &[usize]) -> Vec<bool> {
    let mut set = Set {
        neighbours,
        chosen: greedy(neighbours, cost),
        tight: vec![0; neighbours.len()],
    };
    for (v, list) in neighbours.iter().enumerate() {
        set.tight[v] = list.iter().filter(|w| set.chosen[**w as usize]).count() as u32;
    }
    // Every replacement adds a node, so this ends; the first rounds bring nearly all of it.
    const ROUNDS: usize = 100;
    for _ in 0..ROUNDS {
        let replaced = (0..neighbours.len() as u32)
            .filter(|&v| set.improve(v))
            .count();
        if replaced == 0 {
            break;
        }
    }
    set.chosen
}

fn greedy(neighbours: &[Vec<u32>], cost: &[usize]) -> Vec<bool> {
    let n = neighbours.len();
    let mut degree: Vec<usize> = neighbours.iter().map(Vec::len).collect();
    let mut alive = vec![true; n];
    let mut chosen = vec![false; n];
    let mut queue: BTreeSet<(usize, usize, u32)> =
        (0..n).map(|v| (degree[v], cost[v], v as u32)).collect();
    while let Some((_, _, v)) = queue.pop_first() {
        chosen[v as usize] = true;
        alive[v as usize] = false;
        for &w in &neighbours[v as usize] {
            let w = w as usize;
            if !alive[w] {
                continue;
            }
            alive[w] = false;
            queue.remove(&(degree[w], cost[w], w as u32));
            for &x in &neighbours[w] {
                let x = x as usize;
                if alive[x] {
                    queue.remove(&(degree[x], cost[x], x as u32));
                    degree[x] -= 1;
                    queue.insert((degree[x], cost[x], x as u32));
                }
            }
        }
    }
    chosen
}

struct Set<'a> {
    neighbours: &'a [Vec<u32>],
    chosen: Vec<bool>,
    /// Chosen neighbours of each node.
    tight: Vec<u32>,
}

impl Set<'_> {
    fn flip(&mut self, v: u32, chosen: bool) {
        self.chosen[v as usize] = chosen;
        for &w in &self.neighbours[v as usize] {
            let tight = &mut self.tight[w as usize];
            *tight = if chosen { *tight + 1 } else { *tight - 1 };
        }
    }

    /// Replaces `v` by two or more others.
    fn improve(&mut self, v: u32) -> bool {
        const CANDIDATES: usize = 64;
        if !self.chosen[v as usize] {
            return false;
        }
        let free: Vec<u32> = self.neighbours[v as usize]
            .iter()
            .copied()
            .filter(|w| self.tight[*w as usize] == 1)
            .take(CANDIDATES)
            .collect();
        for (i, &a) in free.iter().enumerate() {
            let list = &self.neighbours[a as usize];
            if let Some(&b) = free[i + 1..]
                .iter()
                .find(|b| list.binary_search(b).is_err())
            {
                self.flip(v, false);
                self.flip(a, true);
                self.flip(b, true);
                for &w in &free {
                    if !self.chosen[w as usize] && self.tight[w as usize] == 0 {
                        self.flip(w, true);
                    }
                }
                return true;
            }
        }
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn graph(n: usize, edges: &[[u32; 2]]) -> Vec<Vec<u32>> {
        let mut lists = vec![Vec::new(); n];
        for [a, b] in edges {
            lists[*a as usize].push(*b);
            lists[*b as usize].push(*a);
        }
        lists.iter_mut().for_each(|list| list.sort_unstable());
        lists
    }

    #[test]
    fn finds_the_leaves_of_a_star_and_half_of_a_ring() {
        let star = graph(5, &[[0, 1], [0, 2], [0, 3], [0, 4]]);
        assert_eq!(
            independent_set(&star, &[1; 5]),
            [false, true, true, true, true]
        );
        let ring = graph(6, &[[0, 1], [1, 2], [2, 3], [3, 4], [4, 5], [5, 0]]);
        assert_eq!(
            independent_set(&ring, &[1; 6])
                .iter()
                .filter(|x| **x)
                .count(),
            3
        );
    }

    #[test]
    fn is_independent_and_maximal_on_scrambled_graphs() {
        let mut state = 7u64;
        let mut random = |n: u64| {
            state = state
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            ((state >> 33) % n) as u32
        };
        for n in [10u64, 60, 200] {
            let mut edges: Vec<[u32; 2]> = (0..2 * n)
                .map(|_| [random(n), random(n)])
                .filter(|[a, b]| a < b)
                .collect();
            edges.sort_unstable();
            edges.dedup();
            let lists = graph(n as usize, &edges);
            let set = independent_set(&lists, &vec![1; n as usize]);
            for v in 0..n as usize {
                let chosen = lists[v].iter().filter(|w| set[**w as usize]).count();
                assert_eq!(set[v], chosen == 0, "node {v} of {n}");
            }
        }
    }
}
