//! Systems of difference constraints `x_w >= x_v + c`, `x >= lower`, and their least solution.

use std::cmp::Ordering;
use std::collections::{BinaryHeap, VecDeque};

/// `value[to] >= value[from] + gain`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Arc {
    /// Node that raises.
    pub from: u32,
    /// Node that is raised.
    pub to: u32,
    /// By how much more, mm; may be negative.
    pub gain: f64,
}

/// The least solution and why each value is as large as it is.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Least {
    /// One value a node.
    pub values: Vec<f64>,
    /// Node that each was raised from last; itself where its lower bound holds.
    pub previous: Vec<u32>,
}

impl Least {
    /// From the node whose lower bound decides to `node`, in this order.
    pub fn path(&self, node: u32) -> Vec<u32> {
        let mut path = vec![node];
        let mut at = node;
        while self.previous[at as usize] != at {
            at = self.previous[at as usize];
            path.push(at);
        }
        path.reverse();
        path
    }
}

/// Nodes along a cycle that raises itself: the system has no solution.
#[derive(Debug, Clone, PartialEq)]
pub struct Cycle {
    /// In the direction of the arcs, each once.
    pub nodes: Vec<u32>,
    /// Sum of the gains around it, mm, positive.
    pub gain: f64,
}

/// Arcs by the node that they leave.
struct Outgoing {
    start: Vec<u32>,
    arcs: Vec<Arc>,
}

impl Outgoing {
    fn new(n: usize, arcs: &[Arc]) -> Self {
        let mut start = vec![0_u32; n + 1];
        for arc in arcs {
            start[arc.from as usize + 1] += 1;
        }
        for v in 0..n {
            start[v + 1] += start[v];
        }
        let mut next = start.clone();
        let blank = Arc {
            from: 0,
            to: 0,
            gain: 0.0,
        };
        let mut sorted = vec![blank; arcs.len()];
        for arc in arcs {
            let place = &mut next[arc.from as usize];
            sorted[*place as usize] = *arc;
            *place += 1;
        }
        Self {
            start,
            arcs: sorted,
        }
    }

    fn of(&self, v: u32) -> &[Arc] {
        &self.arcs[self.start[v as usize] as usize..self.start[v as usize + 1] as usize]
    }
}

/// A node with its key; the largest key comes first, then the smallest node.
#[derive(PartialEq)]
struct Entry(f64, u32);

impl Eq for Entry {}

impl PartialOrd for Entry {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Entry {
    fn cmp(&self, other: &Self) -> Ordering {
        self.0.total_cmp(&other.0).then(other.1.cmp(&self.1))
    }
}

/// Rounding that is no gain, relative to the values.
const ROUNDING: f64 = 1e-13;

/// The least values that keep to all arcs and lower bounds.
///
/// The solutions of such a system are closed under the minimum of each value, so there is one least solution; it is the
/// cheapest for every cost that grows with the values. It is the longest path from the lower bounds:
/// 1. With a `potential` for which no arc raises `value + potential`, nodes are settled in descending order of this sum,
///    each once (Dijkstra): O(E log V).
/// 2. Otherwise label correction in rounds (Bellman and Ford): O(V E) at worst. A cycle among the arcs that raised is
///    looked for after every V steps; it is the proof that there is no solution.
///
/// Bounds and gains are finite, `potential` has one entry a node (any zeros will do).
///
/// # Errors
/// The [`Cycle`] when there is no solution.
pub fn least_solution(lower: &[f64], arcs: &[Arc], potential: &[f64]) -> Result<Least, Cycle> {
    let outgoing = Outgoing::new(lower.len(), arcs);
    let scale = lower.iter().fold(1.0_f64, |m, x| m.max(x.abs()));
    let rounding = ROUNDING * scale;
    let raises =
        |arc: &Arc| arc.gain + potential[arc.to as usize] - potential[arc.from as usize] > rounding;
    if arcs.iter().any(raises) {
        by_rounds(lower, &outgoing, rounding)
    } else {
        Ok(by_order(lower, &outgoing, potential))
    }
}

fn unraised(lower: &[f64]) -> Least {
    Least {
        values: lower.to_vec(),
        previous: (0..lower.len() as u32).collect(),
    }
}

fn by_order(lower: &[f64], outgoing: &Outgoing, potential: &[f64]) -> Least {
    let mut least = unraised(lower);
    let mut settled = vec![false; lower.len()];
    let keys = lower.iter().zip(potential).enumerate();
    let mut queue: BinaryHeap<Entry> = keys.map(|(v, (x, p))| Entry(x + p, v as u32)).collect();
    while let Some(Entry(_, v)) = queue.pop() {
        if std::mem::replace(&mut settled[v as usize], true) {
            continue;
        }
        for arc in outgoing.of(v) {
            let value = least.values[v as usize] + arc.gain;
            let to = arc.to as usize;
            if !settled[to] && value > least.values[to] {
                least.values[to] = value;
                least.previous[to] = v;
                queue.push(Entry(value + potential[to], arc.to));
            }
        }
    }
    least
}

fn by_rounds(lower: &[f64], outgoing: &Outgoing, rounding: f64) -> Result<Least, Cycle> {
    let n = lower.len();
    let mut least = unraised(lower);
    let mut waiting = vec![true; n];
    let mut queue: VecDeque<u32> = (0..n as u32).collect();
    let mut steps = 0_usize;
    while let Some(v) = queue.pop_front() {
        waiting[v as usize] = false;
        for arc in outgoing.of(v) {
            let value = least.values[v as usize] + arc.gain;
            let to = arc.to as usize;
            if value > least.values[to] + rounding {
                least.values[to] = value;
                least.previous[to] = v;
                if !std::mem::replace(&mut waiting[to], true) {
                    queue.push_back(arc.to);
                }
            }
        }
        steps += 1;
        if steps.is_multiple_of(n) {
            cycle(&least.previous, outgoing).map_or(Ok(()), Err)?;
        }
    }
    Ok(least)
}

/// A cycle among the arcs that raised last.
fn cycle(previous: &[u32], outgoing: &Outgoing) -> Option<Cycle> {
    let n = previous.len();
    let mut seen_from = vec![u32::MAX; n];
    for start in 0..n as u32 {
        let mut at = start;
        while seen_from[at as usize] == u32::MAX && previous[at as usize] != at {
            seen_from[at as usize] = start;
            at = previous[at as usize];
        }
        if seen_from[at as usize] != start || previous[at as usize] == at {
            continue;
        }
        let mut nodes = vec![at];
        let mut back = previous[at as usize];
        while back != at {
            nodes.push(back);
            back = previous[back as usize];
        }
        nodes.reverse();
        let around = nodes.iter().zip(nodes.iter().cycle().skip(1));
        let gain = around
            .map(|(&v, &w)| {
                let gains = outgoing.of(v).iter().filter(|arc| arc.to == w);
                gains.map(|arc| arc.gain).fold(f64::NEG_INFINITY, f64::max)
            })
            .sum();
        return Some(Cycle { nodes, gain });
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arc(from: u32, to: u32, gain: f64) -> Arc {
        Arc { from, to, gain }
    }

    #[test]
    fn a_chain_is_raised_and_its_path_is_named() {
        let arcs = [arc(0, 1, 1.0), arc(1, 2, 1.0), arc(2, 3, -5.0)];
        let least = least_solution(&[4.0, 1.0, 1.0, 2.0], &arcs, &[0.0; 4]).expect("no cycle");
        assert_eq!(least.values, [4.0, 5.0, 6.0, 2.0]);
        assert_eq!(least.path(2), [0, 1, 2]);
        assert_eq!(least.path(3), [3]);
    }

    #[test]
    fn both_ways_give_the_same() {
        let arcs = [
            arc(0, 1, 0.5),
            arc(1, 0, -1.0),
            arc(1, 2, 0.25),
            arc(0, 2, 0.5),
            arc(2, 1, -0.5),
        ];
        let lower = [3.0, 1.0, 3.7];
        let potential = [0.0, -0.5, -0.75];
        let ordered = least_solution(&lower, &arcs, &potential).expect("no cycle");
        let rounds = least_solution(&lower, &arcs, &[0.0; 3]).expect("no cycle");
        assert_eq!(ordered.values, rounds.values);
    }

    #[test]
    fn a_cycle_that_raises_itself_is_named() {
        let arcs = [
            arc(3, 0, 0.0),
            arc(0, 1, 1.0),
            arc(1, 2, -0.5),
            arc(2, 0, -0.25),
        ];
        let cycle = least_solution(&[0.0; 4], &arcs, &[0.0; 4]).expect_err("a cycle of 0.25");
        let mut nodes = cycle.nodes.clone();
        nodes.sort_unstable();
        assert_eq!(nodes, [0, 1, 2]);
        assert!((cycle.gain - 0.25).abs() < 1e-12);
    }
}
