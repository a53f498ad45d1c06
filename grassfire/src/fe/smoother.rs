//! Chebyshev smoother on the point diagonal.
//!
//! M. Adams, M. Brezina, J. Hu, R. Tuminaro: Parallel multigrid smoothing: polynomial versus Gauss-Seidel, 2003,
//! doi:10.1016/S0021-9991(03)00194-3.

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

/// The inverse diagonal: one value a node where its three entries are equal, else one a degree of freedom.
pub(super) enum Diagonal {
    /// `[z][y][x]`, in planes of `sx * (ny + 2)`.
    Node(Vec<f32>),
    /// A node field.
    Component(Vec<f32>),
}

/// The vectors of one smoothing step.
pub(super) struct Vectors<'a> {
    pub b: &'a [f32],
    /// `K x`.
    pub t: &'a [f32],
    pub x: &'a mut [f32],
    pub d: &'a mut [f32],
}

/// `d = c1 d + c2 D^-1 (b - t)`, `x = x + d`. With `zero` x counts as zero and neither it nor t is read.
pub(super) fn step(
    grid: &NodeGrid,
    diagonal: &Diagonal,
    v: Vectors,
    zero: bool,
    (c1, c2): (f32, f32),
) {
    let (sx, row) = (grid.sx, grid.row);
    grid.planes(v.x)
        .zip(grid.planes(v.d))
        .enumerate()
        .for_each(|(z, (x, d))| {
            let first = grid.node(0, 0, z);
            for y in 0..=grid.n[1] {
                for c in 0..3 {
                    let at = y * row + c * sx;
                    let (x, d) = (&mut x[at..at + sx], &mut d[at..at + sx]);
                    let b = &v.b[first + at..][..sx];
                    let t = &v.t[first + at..][..sx];
                    let inverse = match diagonal {
                        Diagonal::Node(all) => &all[z * grid.element_plane() + y * sx..][..sx],
                        Diagonal::Component(all) => &all[first + at..][..sx],
                    };
                    if zero {
                        for i in 0..sx {
                            let new = c2 * inverse[i] * b[i];
                            d[i] = new;
                            x[i] = new;
                        }
                    } else {
                        for i in 0..sx {
                            let new = c1 * d[i] + c2 * inverse[i] * (b[i] - t[i]);
                            d[i] = new;
                            x[i] += new;
                        }
                    }
                }
            }
        });
}
