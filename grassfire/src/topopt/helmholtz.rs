//! Density filter by a Helmholtz equation.

use rayon::prelude::*;

use super::Problem;

/// Residual at which the equation counts as solved.
const TOLERANCE: f64 = 1e-12;
/// Iterations at most; 64 voxels of radius need about 150.
const ITERATIONS: usize = 1000;

/// Solves `-r^2 lap x~ + x~ = x` on the voxels that take part, with no flow across their border; `r = R / (2 sqrt 3)`.
///
/// Seven-point differences, conjugate gradients scaled by the diagonal. Constants pass unchanged and the sum is kept.
/// B. S. Lazarov, O. Sigmund: Filters in topology optimization based on Helmholtz-type differential equations, 2011,
/// doi:10.1002/nme.3072.
#[derive(Debug, Clone)]
pub struct Helmholtz {
    dims: [usize; 3],
    /// r^2 in voxels.
    square: f64,
    inside: Vec<bool>,
    diagonal: Vec<f64>,
}

impl Helmholtz {
    /// `radius` in voxels.
    pub(super) fn new(problem: &Problem, radius: f64) -> Self {
        let voxels = problem.labels.len();
        let mut out = Self {
            dims: problem.dims,
            square: radius * radius / 12.0,
            inside: (0..voxels).map(|v| problem.is_active(v)).collect(),
            diagonal: Vec::new(),
        };
        let diagonal: Vec<f64> = (0..voxels)
            .into_par_iter()
            .map(|v| 1.0 + out.square * out.neighbours(v).count() as f64)
            .collect();
        out.diagonal = diagonal;
        out
    }

    fn neighbours(&self, v: usize) -> impl Iterator<Item = usize> + '_ {
        let [nx, ny, nz] = self.dims;
        let at = [v % nx, v / nx % ny, v / (nx * ny)];
        let sides = [(1, nx), (nx, ny), (nx * ny, nz)];
        (0..6).filter_map(move |i| {
            let (stride, n) = sides[i / 2];
            let w = if i % 2 == 0 {
                (at[i / 2] > 0).then(|| v - stride)?
            } else {
                (at[i / 2] + 1 < n).then(|| v + stride)?
            };
            (self.inside[v] && self.inside[w]).then_some(w)
        })
    }

    /// The filtered field of the whole grid; zero where a voxel does not take part.
    pub(super) fn solve(&self, b: &[f64]) -> Vec<f64> {
        let inside = |v: usize| if self.inside[v] { 1.0 } else { 0.0 };
        let b: Vec<f64> = b.iter().enumerate().map(|(v, b)| b * inside(v)).collect();
        let mut x = b.clone();
        let mut r: Vec<f64> = self
            .apply(&x)
            .iter()
            .zip(&b)
            .map(|(ax, b)| b - ax)
            .collect();
        let goal = TOLERANCE * dot(&b, &b).sqrt();
        let mut p = vec![0.0; b.len()];
        let mut before = 0.0;
        for i in 0..ITERATIONS {
            if dot(&r, &r).sqrt() <= goal {
                break;
            }
            let z: Vec<f64> = r.iter().zip(&self.diagonal).map(|(r, d)| r / d).collect();
            let rz = dot(&r, &z);
            let beta = if i == 0 { 0.0 } else { rz / before };
            before = rz;
            p.iter_mut().zip(&z).for_each(|(p, z)| *p = z + beta * *p);
            let q = self.apply(&p);
            let alpha = rz / dot(&p, &q);
            x.iter_mut().zip(&p).for_each(|(x, p)| *x += alpha * p);
            r.iter_mut().zip(&q).for_each(|(r, q)| *r -= alpha * q);
        }
        x
    }

    fn apply(&self, x: &[f64]) -> Vec<f64> {
        (0..x.len())
            .into_par_iter()
            .map(|v| {
                self.diagonal[v] * x[v]
                    - self.square * self.neighbours(v).map(|w| x[w]).sum::<f64>()
            })
            .collect()
    }
}

/// In pieces, so that the sum does not depend on the threads.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let parts: Vec<f64> = a
        .par_chunks(1 << 15)
        .zip(b.par_chunks(1 << 15))
        .map(|(a, b)| a.iter().zip(b).map(|(a, b)| a * b).sum())
        .collect();
    parts.iter().sum()
}
