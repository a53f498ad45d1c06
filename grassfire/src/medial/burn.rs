//! Grassfire on the faces of the complex: erosion thickness, pruning by elementary collapse, regrowth.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::complex::Complex;
use super::delaunay::NONE;
use super::union_find::UnionFind;
use crate::monitor::{Cancelled, Monitor};

/// What is left of a complex. Edges of alive faces are alive.
#[derive(Clone)]
pub(super) struct Alive {
    pub(super) faces: Vec<bool>,
    pub(super) edges: Vec<bool>,
}

/// One elementary collapse: a face went away together with its free edge.
#[derive(Clone, Copy)]
pub(super) struct Collapse {
    pub(super) face: u32,
    pub(super) edge: u32,
}

impl Alive {
    pub(super) fn all(complex: &Complex) -> Self {
        Self {
            faces: vec![true; complex.faces()],
            edges: vec![true; complex.edges.len()],
        }
    }

    /// Alive faces at edge `e`.
    #[inline]
    pub(super) fn faces_at<'a>(
        &'a self,
        complex: &'a Complex,
        e: u32,
    ) -> impl Iterator<Item = u32> + 'a {
        complex.edge_faces[e as usize]
            .into_iter()
            .filter(|&f| f != NONE && self.faces[f as usize])
    }

    /// Sheet of each alive face (named by its smallest face; [`NONE`] for dead faces): faces that
    /// hang together across edges with exactly two alive faces.
    pub(super) fn sheets(&self, complex: &Complex) -> Vec<u32> {
        let mut sets = UnionFind::new(complex.faces());
        for e in 0..complex.edges.len() as u32 {
            let mut faces = self.faces_at(complex, e);
            if let (Some(a), Some(b), None) = (faces.next(), faces.next(), faces.next()) {
                sets.unite(a, b);
            }
        }
        (0..complex.faces() as u32)
            .map(|f| {
                if self.faces[f as usize] {
                    sets.find(f)
                } else {
                    NONE
                }
            })
            .collect()
    }
}

/// Centre and mean radius of every face, in voxels.
pub(super) struct FaceSpheres {
    pub(super) centres: Vec<[f32; 3]>,
    pub(super) radii: Vec<f32>,
}

impl FaceSpheres {
    pub(super) fn of(complex: &Complex) -> Self {
        use rayon::prelude::*;
        let spheres: Vec<([f32; 3], f32)> = (0..complex.faces() as u32)
            .into_par_iter()
            .map(|f| {
                let edges = complex.edges_of(f);
                let mut centre = [0.0; 3];
                let mut radius = 0.0;
                for &e in edges {
                    let (m, r) = middle(complex, e);
                    (0..3).for_each(|k| centre[k] += m[k]);
                    radius += r;
                }
                let share = 1.0 / edges.len() as f32;
                (centre.map(|x| x * share), radius * share)
            })
            .collect();
        Self {
            centres: spheres.iter().map(|s| s.0).collect(),
            radii: spheres.iter().map(|s| s.1).collect(),
        }
    }
}

/// Middle of an edge and the mean radius there.
#[inline]
fn middle(complex: &Complex, e: u32) -> ([f32; 3], f32) {
    let [a, b] = complex.edges[e as usize].map(|v| v as usize);
    let (p, q) = (complex.centres[a], complex.centres[b]);
    (
        std::array::from_fn(|k| 0.5 * (p[k] + q[k])),
        0.5 * (complex.radii[a] + complex.radii[b]),
    )
}

#[inline]
pub(super) fn distance(a: &[f32; 3], b: &[f32; 3]) -> f32 {
    (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f32>().sqrt()
}

/// Orders by time, ties by index. Times are never negative, so their bits sort like the numbers.
#[inline]
pub(super) fn key(time: f32, index: u32) -> Reverse<u64> {
    Reverse(u64::from(time.to_bits()) << 32 | u64::from(index))
}

/// Time and index of a [`key`].
#[inline]
pub(super) fn unkey(Reverse(key): Reverse<u64>) -> (f32, u32) {
    (f32::from_bits((key >> 32) as u32), key as u32)
}

/// Burns faces from the rims inwards.
///
/// 1. Fire starts at the middle of every rim (edge with one alive face) at the time of its radius
///    and runs along the faces at unit speed; a seam holds it up until only one sheet is left there.
/// 2. A face whose burn time exceeds its radius by more than `limit(face)` stops the fire.
/// 3. Every face that burns is an elementary collapse, so the homotopy type stays, whatever the limits are.
///
/// Returns the burn time of each face (infinite for those left) and the collapses in order.
/// Y. Yan, K. Sykes, E. Chambers, D. Letscher, T. Ju, "Erosion thickness on medial axes of 3D
/// shapes", ACM TOG 35 (2016), <https://doi.org/10.1145/2897824.2925938>.
pub(super) fn burn(
    complex: &Complex,
    spheres: &FaceSpheres,
    alive: &mut Alive,
    limit: impl Fn(u32) -> f32,
    monitor: &Monitor,
) -> Result<(Vec<f32>, Vec<Collapse>), Cancelled> {
    let mut times = vec![f32::INFINITY; complex.faces()];
    let mut collapses = Vec::new();
    let mut open = vec![0u8; complex.edges.len()];
    let mut front = Vec::new();
    for e in 0..complex.edges.len() as u32 {
        open[e as usize] = alive.faces_at(complex, e).count() as u8;
        if open[e as usize] == 1 && alive.edges[e as usize] {
            front.push(key(middle(complex, e).1, e));
        }
    }
    let mut front = BinaryHeap::from(front);
    let mut count = 0u32;
    while let Some(entry) = front.pop() {
        count = count.wrapping_add(1);
        if count.is_multiple_of(1 << 16) {
            monitor.check()?;
        }
        let (start, edge) = unkey(entry);
        if !alive.edges[edge as usize] || open[edge as usize] != 1 {
            continue;
        }
        let Some(face) = alive.faces_at(complex, edge).next() else {
            continue;
        };
        let f = face as usize;
        let centre = spheres.centres[f];
        let time = (start + distance(&centre, &middle(complex, edge).0)).max(spheres.radii[f]);
        if time - spheres.radii[f] > limit(face) {
            continue;
        }
        times[f] = time;
        alive.faces[f] = false;
        alive.edges[edge as usize] = false;
        collapses.push(Collapse { face, edge });
        for &e in complex.edges_of(face) {
            if e != edge && alive.edges[e as usize] {
                open[e as usize] -= 1;
                if open[e as usize] == 1 {
                    front.push(key(time + distance(&centre, &middle(complex, e).0), e));
                }
            }
        }
    }
    Ok((times, collapses))
}

/// Puts burnt faces back, last burnt first, where that only widens a kept sheet at its rim.
///
/// A face returns with its free edge (an anti-collapse) when
/// 1. its object angle is wide: half of it has a sine above `least_sine`;
/// 2. its other edges are alive and touch kept rims only: never a seam and never an inner edge, so that no
///    new seam arises;
/// 3. the fire (`times` of the full burn) ran from it into a kept face.
pub(super) fn regrow(
    complex: &Complex,
    spheres: &FaceSpheres,
    samples: &[[i32; 3]],
    times: &[f32],
    alive: &mut Alive,
    collapses: &[Collapse],
    least_sine: f64,
) {
    for &Collapse { face, edge } in collapses.iter().rev() {
        let f = face as usize;
        let [p, q] = complex.face_samples[f].map(|s| samples[s as usize]);
        let apart = (0..3)
            .map(|k| f64::from(p[k] - q[k]).powi(2))
            .sum::<f64>()
            .sqrt();
        if apart <= 2.0 * f64::from(spheres.radii[f]) * least_sine {
            continue;
        }
        let mut touching = 0;
        let mut allowed = true;
        let mut outwards = false;
        for &e in complex.edges_of(face).iter().filter(|&&e| e != edge) {
            allowed &= alive.edges[e as usize];
            touching = touching.max(alive.faces_at(complex, e).count());
            outwards |= alive
                .faces_at(complex, e)
                .any(|g| times[g as usize] >= times[f]);
        }
        if allowed && outwards && touching == 1 {
            alive.faces[f] = true;
            alive.edges[edge as usize] = true;
        }
    }
}
