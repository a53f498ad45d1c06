//! Distances inside sheets: the complex cut open along its seams.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::complex::Complex;
use super::edges::{EdgeTable, UnionFind};
use crate::Vec3;

/// Two faces at a seam go on into each other when the cosine between them is below this (150 degrees and flatter).
const FLAT: f64 = -0.85;

/// Total order for the heap; the values are never NaN.
#[derive(PartialEq)]
pub(super) struct Key(pub f64);

impl Eq for Key {}

impl PartialOrd for Key {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Key {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0)
    }
}

/// Two faces that go on into each other over an edge.
pub(super) struct Pair {
    /// The edge.
    pub edge: [u32; 2],
    /// The two faces.
    pub faces: [u32; 2],
}

/// Pairs over edges with two faces, and at every seam edge the two faces nearest to lying in one plane.
pub(super) fn smooth_pairs(c: &Complex, table: &EdgeTable) -> Vec<Pair> {
    let mut out = Vec::with_capacity(table.edges.len());
    for (edge, f) in table.iter() {
        if let [s, t] = *f {
            out.push(Pair {
                edge,
                faces: [s, t],
            });
        }
        if f.len() < 3 {
            continue;
        }
        let inward: Vec<Vec3> = f.iter().map(|&t| inward(c, t, edge)).collect();
        let mut flattest: Option<(f64, usize, usize)> = None;
        for i in 0..f.len() {
            for j in i + 1..f.len() {
                let cos = inward[i].dot(&inward[j]);
                if cos < FLAT && flattest.is_none_or(|b| cos < b.0) {
                    flattest = Some((cos, i, j));
                }
            }
        }
        if let Some((_, i, j)) = flattest {
            out.push(Pair {
                edge,
                faces: [f[i], f[j]],
            });
        }
    }
    out
}

/// Unit vector in the plane of `t`, from its edge into the triangle.
fn inward(c: &Complex, t: u32, [a, b]: [u32; 2]) -> Vec3 {
    let apex = c
        .tri(t)
        .into_iter()
        .find(|&v| v != a && v != b)
        .unwrap_or(a);
    let along = (c.points[b as usize] - c.points[a as usize])
        .try_normalize(1e-12)
        .unwrap_or_default();
    let d = c.points[apex as usize] - c.points[a as usize];
    (d - along * along.dot(&d))
        .try_normalize(1e-12)
        .unwrap_or_default()
}

/// The complex cut open along its seams: one node for each fan of triangles at a vertex.
pub(super) struct Cut {
    /// Node of each triangle corner.
    pub node: Vec<[u32; 3]>,
    /// Vertex of each node.
    pub vertex: Vec<u32>,
    /// Neighbours of each node with the distance.
    pub near: Vec<Vec<(u32, f64)>>,
    triangles: Vec<[u32; 3]>,
}

impl Cut {
    /// Cuts `c`; fans go on over `pairs` only.
    pub fn new(c: &Complex, pairs: &[Pair]) -> Self {
        let mut sets = UnionFind::new(3 * c.triangles.len());
        let corner =
            |t: u32, v: u32| 3 * t + c.tri(t).iter().position(|&w| w == v).unwrap_or(0) as u32;
        for &Pair {
            edge: [a, b],
            faces: [s, t],
        } in pairs
        {
            sets.join(corner(s, a), corner(t, a));
            sets.join(corner(s, b), corner(t, b));
        }
        let mut name = vec![u32::MAX; 3 * c.triangles.len()];
        let mut cut = Self {
            node: vec![[u32::MAX; 3]; c.triangles.len()],
            vertex: Vec::new(),
            near: Vec::new(),
            triangles: c.triangles.clone(),
        };
        for t in c.alive() {
            for k in 0..3 {
                let root = sets.find(3 * t + k) as usize;
                if name[root] == u32::MAX {
                    name[root] = cut.vertex.len() as u32;
                    cut.vertex.push(c.tri(t)[k as usize]);
                }
                cut.node[t as usize][k as usize] = name[root];
            }
        }
        cut.near = vec![Vec::new(); cut.vertex.len()];
        for t in c.alive() {
            let (v, n) = (c.tri(t), cut.node[t as usize]);
            for k in 0..3 {
                let j = (k + 1) % 3;
                let d = c.length(v[k], v[j]);
                cut.near[n[k] as usize].push((n[j], d));
                cut.near[n[j] as usize].push((n[k], d));
            }
        }
        cut
    }

    /// Node of triangle `t` at vertex `v`.
    pub fn node_at(&self, t: u32, v: u32) -> u32 {
        let k = self.triangles[t as usize]
            .iter()
            .position(|&w| w == v)
            .unwrap_or(0);
        self.node[t as usize][k]
    }

    /// Nodes on edges with one face, ascending.
    pub fn rim_nodes(&self, table: &EdgeTable) -> Vec<u32> {
        let mut out = Vec::new();
        for ([a, b], f) in table.iter() {
            if let [t] = *f {
                out.extend([self.node_at(t, a), self.node_at(t, b)]);
            }
        }
        out.sort_unstable();
        out.dedup();
        out
    }

    /// Dijkstra from `sources` up to `limit`; infinite where not reached.
    pub fn distances(&self, sources: &[u32], limit: f64) -> Vec<f64> {
        let mut distance = vec![f64::INFINITY; self.vertex.len()];
        let mut heap = BinaryHeap::new();
        for &s in sources {
            distance[s as usize] = 0.0;
            heap.push(Reverse((Key(0.0), s)));
        }
        while let Some(Reverse((Key(d), n))) = heap.pop() {
            if d > distance[n as usize] {
                continue;
            }
            for &(m, step) in &self.near[n as usize] {
                let next = d + step;
                if next < distance[m as usize] && next <= limit {
                    distance[m as usize] = next;
                    heap.push(Reverse((Key(next), m)));
                }
            }
        }
        distance
    }
}
