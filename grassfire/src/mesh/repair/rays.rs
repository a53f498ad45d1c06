//! Which shells contain a point, by counting where a ray leaves them.

use super::super::TriMesh;
use crate::Vec3;

/// The ray runs along x, sheared by odd amounts so that it does not run along faces of machined parts.
const SHEAR: [f64; 2] = [0.013_717_421, 0.027_389_113];
/// Most entries of the look-up grid a triangle, on average.
const MAX_ENTRIES: usize = 30;

/// Triangles sorted into cells of the plane that rays are points of.
pub(super) struct Rays<'a> {
    mesh: &'a TriMesh,
    shell: &'a [u32],
    lower: [f64; 2],
    cell: f64,
    dims: [usize; 2],
    starts: Vec<u32>,
    entries: Vec<u32>,
}

fn project(p: &Vec3) -> [f64; 2] {
    [p.y - SHEAR[0] * p.x, p.z - SHEAR[1] * p.x]
}

impl<'a> Rays<'a> {
    /// `shell` is the shell of each triangle.
    pub fn new(mesh: &'a TriMesh, shell: &'a [u32]) -> Self {
        let boxes: Vec<[[f64; 2]; 2]> = (0..mesh.triangles.len())
            .map(|t| flat_box(mesh, t))
            .collect();
        let mut lower = [f64::INFINITY; 2];
        let mut upper = [f64::NEG_INFINITY; 2];
        for [lo, hi] in &boxes {
            for a in 0..2 {
                lower[a] = lower[a].min(lo[a]);
                upper[a] = upper[a].max(hi[a]);
            }
        }
        let span = (upper[0] - lower[0]).max(upper[1] - lower[1]);
        let mut side = (boxes.len() as f64).sqrt().clamp(1.0, 2000.0);
        loop {
            let cell = (span / side).max(f64::MIN_POSITIVE);
            let dims =
                [0, 1].map(|a| (((upper[a] - lower[a]) / cell) as usize).min(side as usize) + 1);
            let mut rays = Self {
                mesh,
                shell,
                lower,
                cell,
                dims,
                starts: Vec::new(),
                entries: Vec::new(),
            };
            let total: usize = boxes.iter().map(|b| rays.cells(b).count()).sum();
            if total <= MAX_ENTRIES * boxes.len() + 10_000 || side < 2.0 {
                rays.insert(&boxes);
                return rays;
            }
            side /= 2.0;
        }
    }

    fn insert(&mut self, boxes: &[[[f64; 2]; 2]]) {
        let mut starts = vec![0u32; self.dims[0] * self.dims[1] + 1];
        for b in boxes {
            self.cells(b).for_each(|c| starts[c + 1] += 1);
        }
        for c in 1..starts.len() {
            starts[c] += starts[c - 1];
        }
        let mut next = starts.clone();
        let mut entries = vec![0u32; starts.last().copied().unwrap_or(0) as usize];
        for (t, b) in boxes.iter().enumerate() {
            for c in self.cells(b) {
                entries[next[c] as usize] = t as u32;
                next[c] += 1;
            }
        }
        (self.starts, self.entries) = (starts, entries);
    }

    fn cells(&self, b: &[[f64; 2]; 2]) -> impl Iterator<Item = usize> + use<> {
        let at =
            |x: f64, a: usize| (((x - self.lower[a]) / self.cell) as usize).min(self.dims[a] - 1);
        let (i0, i1, j0, j1) = (
            at(b[0][0], 0),
            at(b[1][0], 0),
            at(b[0][1], 1),
            at(b[1][1], 1),
        );
        let width = self.dims[0];
        (j0..=j1).flat_map(move |j| (i0..=i1).map(move |i| j * width + i))
    }

    /// Sorted shells that a ray from `p` leaves more often than it enters, or the other way: those that contain `p`.
    pub fn containing(&self, p: &Vec3) -> Vec<u32> {
        let q = project(p);
        if (0..2).any(|a| q[a].is_nan() || q[a] < self.lower[a]) {
            return Vec::new();
        }
        let Some(cell) = self.cells(&[q, q]).next() else {
            return Vec::new();
        };
        let range = self.starts[cell] as usize..self.starts[cell + 1] as usize;
        let mut hits: Vec<u32> = self.entries[range]
            .iter()
            .filter(|&&t| self.crosses(t as usize, p, &q))
            .map(|&t| self.shell[t as usize])
            .collect();
        hits.sort_unstable();
        hits.chunk_by(|a, b| a == b)
            .filter(|run| run.len() % 2 == 1)
            .map(|run| run[0])
            .collect()
    }

    /// The ray from `p` towards larger x runs through triangle `t`.
    fn crosses(&self, t: usize, p: &Vec3, q: &[f64; 2]) -> bool {
        let corners = self.mesh.corners(t);
        let [a, b, c] = corners.map(|v| project(&v));
        let side = |u: &[f64; 2], v: &[f64; 2]| {
            (u[0] - q[0]) * (v[1] - q[1]) - (u[1] - q[1]) * (v[0] - q[0])
        };
        let (wa, wb, wc) = (side(&b, &c), side(&c, &a), side(&a, &b));
        let inside = (wa > 0.0 && wb > 0.0 && wc > 0.0) || (wa < 0.0 && wb < 0.0 && wc < 0.0);
        let sum = wa + wb + wc;
        inside && (corners[0].x * wa + corners[1].x * wb + corners[2].x * wc) / sum > p.x
    }
}

fn flat_box(mesh: &TriMesh, t: usize) -> [[f64; 2]; 2] {
    let [a, b, c] = mesh.corners(t).map(|p| project(&p));
    let low = |k: usize| a[k].min(b[k]).min(c[k]);
    let high = |k: usize| a[k].max(b[k]).max(c[k]);
    [[low(0), low(1)], [high(0), high(1)]]
}
