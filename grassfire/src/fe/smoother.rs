//! Chebyshev smoother on the point diagonal.
//!
//! M. Adams, M. Brezina, J. Hu, R. Tuminaro: Parallel multigrid smoothing: polynomial versus Gauss-Seidel, 2003,
//! doi:10.1016/S0021-9991(03)00194-3.

use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use super::grid::NodeGrid;

/// Recurrence coefficients (of the last step, of the scaled residual) for eigenvalues in `[high / ratio, high]`.
pub(super) fn coefficients(degree: usize, high: f64, ratio: f64) -> Vec<(f32, f32)> {
    let low = high / ratio;
    let (centre, half) = ((high + low) / 2.0, (high - low) / 2.0);
    let sigma = centre / half;
    let mut rho = 1.0 / sigma;
    let mut out = vec![(0.0, (1.0 / centre) as f32)];
    for _ in 1..degree {
        let next = 1.0 / (2.0 * sigma - rho);
        out.push(((next * rho) as f32, (2.0 * next / half) as f32));
        rho = next;
    }
    out
}

/// The inverse diagonal: one value a node where its three entries are equal, else one a degree of freedom, or a block.
pub(super) enum Diagonal {
    /// One value a node, a scalar field.
    Node {
        /// Zero at the nodes of `blocks`.
        inverse: Vec<f32>,
        /// Nodes that have a block instead: places and inverse.
        blocks: Vec<([usize; 3], Matrix3<f32>)>,
    },
    /// A node field.
    Component(Vec<f32>),
}

/// The vectors of one smoothing step.
pub(super) struct Vectors<'a> {
    /// `K x`.
    pub t: &'a [f32],
    pub x: &'a mut [f32],
    pub d: &'a mut [f32],
}

/// For the right side `b`, in single precision: `d = c1 d + c2 D^-1 (b - t)`, `x = x + d`. With `zero` x counts as zero and neither it nor t is read.
pub(super) fn step<B: Copy + Into<f64> + Sync>(
    grid: &NodeGrid,
    diagonal: &Diagonal,
    b: &[B],
    v: Vectors,
    zero: bool,
    (c1, c2): (f32, f32),
) {
    grid.planes(3, v.x)
        .zip(grid.planes(3, v.d))
        .enumerate()
        .for_each(|(z, (x, d))| {
            let (first, count) = (grid.first(z), grid.count(z));
            for c in 0..3 {
                let at = 3 * first + c * count;
                let (x, d) = (
                    &mut x[c * count..(c + 1) * count],
                    &mut d[c * count..(c + 1) * count],
                );
                let b = &b[at..at + count];
                let inverse = match diagonal {
                    Diagonal::Node { inverse, .. } => &inverse[first..first + count],
                    Diagonal::Component(all) => &all[at..at + count],
                };
                if zero {
                    for i in 0..count {
                        let new = c2 * inverse[i] * (b[i].into() as f32);
                        d[i] = new;
                        x[i] = new;
                    }
                } else {
                    let t = &v.t[at..at + count];
                    for i in 0..count {
                        let new = c1 * d[i] + c2 * inverse[i] * (b[i].into() as f32 - t[i]);
                        d[i] = new;
                        x[i] += new;
                    }
                }
            }
        });
    let Diagonal::Node { blocks, .. } = diagonal else {
        return;
    };
    for (places, inverse) in blocks {
        let rest = places.map(|at| b[at].into() as f32 - if zero { 0.0 } else { v.t[at] });
        let step = c2 * inverse * Vector3::from(rest);
        for (&at, step) in places.iter().zip(step.iter()) {
            v.d[at] += step;
            v.x[at] += step;
        }
    }
}
