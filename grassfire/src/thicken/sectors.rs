//! The cyclic order of the quads about every seam edge, such that every vertex has a neighbourhood in space.

use std::cmp::Ordering;
use std::collections::{BTreeSet, BinaryHeap};
use std::f64::consts::TAU;

use super::complex::{Complex, root};
use super::regions::facing_slots;
use super::unit;

/// Most orders tried for one vertex.
const MOST_TRIES: usize = 2000;

/// Sorts the quads of every seam edge counter-clockwise about it.
///
/// A small sphere around a vertex is cut into regions by the quads there. Every edge is sorted by angles at its own
/// middle, and where sheets run close together two edges of one vertex may disagree about who is next to whom: the
/// regions would then close up to a surface with handles instead of a sphere. Such vertices are mended:
/// 1. Sort by the angle of the quads' centres about the edge.
/// 2. At a vertex with handles, sort one of its edges another way, that with the least angles in the wrong order first;
///    when the vertex at the other end has handles then, go on there with another edge (cheapest path).
///
/// A vertex that cannot be mended stays as it is; the checks of the body report it.
pub(super) fn sort_sectors(complex: &mut Complex) {
    let angles: Vec<Vec<f64>> = (0..complex.edges.len())
        .map(|e| sort_by_angle(complex, e))
        .collect();
    if angles.iter().all(Vec::is_empty) {
        return;
    }
    let mut sorter = Sorter {
        seams: seams_of_vertices(complex),
        complex,
        angles,
    };
    for v in 0..sorter.seams.len() as u32 {
        // Every mend takes at least one handle away.
        while sorter.handles(v) > 0 && sorter.mend(v) {}
    }
}

/// Sorts the uses of edge `e`; their angles when it is a seam, else nothing.
fn sort_by_angle(complex: &mut Complex, e: usize) -> Vec<f64> {
    let edge = &complex.edges[e];
    if edge.uses.len() < 3 {
        return Vec::new();
    }
    let [a, b] = edge.ends.map(|v| complex.at(v));
    let axis = unit(b - a);
    let middle = (a + b) / 2.0;
    let away = |q: u32| {
        let d = complex.centres[q as usize] - middle;
        unit(d - axis * d.dot(&axis))
    };
    let across = away(edge.uses[0].0);
    let up = axis.cross(&across);
    let mut order: Vec<(f64, (u32, u8))> = edge
        .uses
        .iter()
        .enumerate()
        .map(|(i, &u)| {
            let d = away(u.0);
            let angle = d.dot(&up).atan2(d.dot(&across)).rem_euclid(TAU);
            (if i == 0 { 0.0 } else { angle }, u)
        })
        .collect();
    order[1..].sort_by(|x, y| x.0.total_cmp(&y.0));
    complex.edges[e].uses = order.iter().map(|o| o.1).collect();
    order.into_iter().map(|o| o.0).collect()
}

fn seams_of_vertices(complex: &Complex) -> Vec<Vec<u32>> {
    let mut seams = vec![Vec::new(); complex.points.len()];
    for (e, edge) in complex.edges.iter().enumerate() {
        if edge.uses.len() > 2 {
            edge.ends
                .iter()
                .for_each(|&v| seams[v as usize].push(e as u32));
        }
    }
    seams
}

/// Another order of the quads about an edge: the places where they stand now.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
struct Order {
    edge: u32,
    places: Vec<usize>,
}

/// An order reached by the search, and the vertex that it may have spoiled.
struct Reached {
    cost: f64,
    order: Order,
    vertex: u32,
    from: Option<usize>,
}

/// Cheapest first, then first come first served.
#[derive(PartialEq)]
struct Waiting(f64, usize);

impl Eq for Waiting {}

impl Ord for Waiting {
    fn cmp(&self, other: &Self) -> Ordering {
        other.0.total_cmp(&self.0).then(other.1.cmp(&self.1))
    }
}

impl PartialOrd for Waiting {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

struct Sorter<'a> {
    complex: &'a mut Complex,
    /// Angles of the uses of every seam edge, in the order of the uses.
    angles: Vec<Vec<f64>>,
    /// Seam edges of every vertex.
    seams: Vec<Vec<u32>>,
}

impl Sorter<'_> {
    /// Twice the number of handles that the regions around `v` would close up to.
    fn handles(&self, v: u32) -> usize {
        let complex = &*self.complex;
        let corners = &complex.corners[v as usize];
        let local = |slot: usize| {
            let corner = ((slot / 8) as u32, (slot / 2 % 4) as u8);
            2 * corners.binary_search(&corner).unwrap_or(0) + slot % 2
        };
        let mut region: Vec<usize> = (0..2 * corners.len()).collect();
        let mut fan: Vec<usize> = (0..corners.len()).collect();
        let mut edges: Vec<u32> = corners
            .iter()
            .flat_map(|&c| complex.corner_edges(c))
            .collect();
        edges.sort_unstable();
        edges.dedup();
        for &e in &edges {
            let edge = &complex.edges[e as usize];
            let end = usize::from(edge.ends[1] == v);
            for (from, to) in facing_slots(complex, edge) {
                let (a, b) = (local(from[end]), local(to[end]));
                join(&mut region, a, b);
                join(&mut fan, a / 2, b / 2);
            }
        }
        let roots = |parent: &[usize]| (0..parent.len()).filter(|&i| parent[i] == i).count();
        // Euler: edges, quads and regions are the vertices, edges and faces of one sphere a fan.
        (2 * roots(&fan) + corners.len()).saturating_sub(edges.len() + roots(&region))
    }

    fn handles_after(&mut self, v: u32, orders: &[&Order]) -> usize {
        let saved: Vec<_> = orders.iter().map(|order| self.apply(order)).collect();
        let handles = self.handles(v);
        saved.into_iter().rev().for_each(|s| self.restore(s));
        handles
    }

    /// Sorts the quads about an edge; returns what was there.
    fn apply(&mut self, order: &Order) -> Saved {
        let e = order.edge as usize;
        let saved = Saved {
            edge: order.edge,
            uses: self.complex.edges[e].uses.clone(),
            angles: self.angles[e].clone(),
        };
        self.complex.edges[e].uses = order.places.iter().map(|&i| saved.uses[i]).collect();
        self.angles[e] = order.places.iter().map(|&i| saved.angles[i]).collect();
        saved
    }

    fn restore(&mut self, saved: Saved) {
        self.complex.edges[saved.edge as usize].uses = saved.uses;
        self.angles[saved.edge as usize] = saved.angles;
    }

    /// Other orders of seam edge `edge` with their costs, best first.
    fn orders(&self, edge: u32) -> Vec<(f64, Order)> {
        let angles = &self.angles[edge as usize];
        let mut orders: Vec<(f64, Order)> = cyclic_orders(angles.len())
            .into_iter()
            .map(|places| {
                let turned: Vec<f64> = places.iter().map(|&i| angles[i]).collect();
                (disorder(&turned), Order { edge, places })
            })
            .collect();
        orders.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        orders
    }

    /// Takes handles away from `v` without giving any to others; false when no orders do.
    fn mend(&mut self, v: u32) -> bool {
        let mut reached: Vec<Reached> = Vec::new();
        let mut waiting = BinaryHeap::new();
        let mut seen = BTreeSet::new();
        self.spread(v, None, &mut reached, &mut waiting, &mut seen);
        while let Some(Waiting(_, i)) = waiting.pop() {
            let vertex = reached[i].vertex;
            if self.handles_after(vertex, &[&reached[i].order]) > self.handles(vertex) {
                if reached.len() < MOST_TRIES {
                    self.spread(vertex, Some(i), &mut reached, &mut waiting, &mut seen);
                }
                continue;
            }
            let mut path = vec![&reached[i].order];
            let mut vertices = vec![v, vertex];
            let mut last = i;
            while let Some(from) = reached[last].from {
                path.push(&reached[from].order);
                vertices.push(reached[from].vertex);
                last = from;
            }
            vertices.sort_unstable();
            vertices.dedup();
            // A path may cross itself: only the sum over all its vertices tells.
            let sum = |s: &Self| vertices.iter().map(|&v| s.handles(v)).sum::<usize>();
            let before = sum(self);
            let saved: Vec<_> = path.iter().map(|order| self.apply(order)).collect();
            if sum(self) < before {
                return true;
            }
            saved.into_iter().rev().for_each(|s| self.restore(s));
        }
        false
    }

    /// Adds the orders that mend `v`: one with handles, or one spoiled by the order `from`.
    fn spread(
        &mut self,
        v: u32,
        from: Option<usize>,
        reached: &mut Vec<Reached>,
        waiting: &mut BinaryHeap<Waiting>,
        seen: &mut BTreeSet<(Order, u32)>,
    ) {
        let spoiling = from.map(|i| reached[i].order.clone());
        let cost = from.map_or(0.0, |i| reached[i].cost);
        let before = self.handles(v);
        for e in self.seams[v as usize].clone() {
            if spoiling.as_ref().is_some_and(|s| s.edge == e) {
                continue;
            }
            let [a, b] = self.complex.edges[e as usize].ends;
            let vertex = if a == v { b } else { a };
            for (angle, order) in self.orders(e) {
                let after = match &spoiling {
                    Some(spoiling) => self.handles_after(v, &[spoiling, &order]),
                    None => self.handles_after(v, &[&order]) + 1,
                };
                if after <= before && seen.insert((order.clone(), vertex)) {
                    waiting.push(Waiting(cost + angle, reached.len()));
                    reached.push(Reached {
                        cost: cost + angle,
                        order,
                        vertex,
                        from,
                    });
                }
            }
        }
    }
}

/// The quads about an edge as they were.
struct Saved {
    edge: u32,
    uses: Vec<(u32, u8)>,
    angles: Vec<f64>,
}

/// Cyclic orders of `count` things but the present one: all up to five, else those one swap of neighbours away.
fn cyclic_orders(count: usize) -> Vec<Vec<usize>> {
    let present: Vec<usize> = (0..count).collect();
    if count > 5 {
        return (0..count)
            .map(|i| {
                let mut order = present.clone();
                order.swap(i, (i + 1) % count);
                order
            })
            .collect();
    }
    let mut orders = vec![vec![0]];
    for next in 1..count {
        let grow = |order: &Vec<usize>| {
            let order = order.clone();
            (1..=order.len()).map(move |at| {
                let mut longer = order.clone();
                longer.insert(at, next);
                longer
            })
        };
        orders = orders.iter().flat_map(grow).collect();
    }
    orders.retain(|order| *order != present);
    orders
}

/// How far a cyclic order is from that of its angles: the sum of the angles between pairs in the wrong order, counted
/// from the best of the members.
fn disorder(angles: &[f64]) -> f64 {
    let count = angles.len();
    let from = |base: usize| {
        let turn = |i: usize| (angles[(base + i) % count] - angles[base]).rem_euclid(TAU);
        (1..count)
            .flat_map(|i| (i + 1..count).map(move |j| (i, j)))
            .map(|(i, j)| (turn(i) - turn(j)).max(0.0))
            .sum::<f64>()
    };
    (0..count).map(from).fold(f64::INFINITY, f64::min)
}

fn join(parent: &mut [usize], a: usize, b: usize) {
    let (a, b) = (root(parent, a), root(parent, b));
    parent[a.max(b)] = a.min(b);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cyclic_orders_are_counted_once() {
        let counts = [3, 4, 5, 6].map(|n| cyclic_orders(n).len());
        assert_eq!(counts, [1, 5, 23, 6]);
    }

    #[test]
    fn the_cheapest_change_swaps_the_closest_pair() {
        assert_eq!(disorder(&[0.0, 1.0, 2.0]), 0.0);
        assert!((disorder(&[0.0, 2.5, 2.0]) - 0.5).abs() < 1e-12);
        // 6.2 and 0 are close to each other across the start of the circle.
        assert!((disorder(&[6.2, 2.0, 0.0]) - (TAU - 6.2)).abs() < 1e-12);
    }
}
