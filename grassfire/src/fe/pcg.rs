//! Conjugate gradients in double precision, preconditioned by multigrid in single precision.

use rayon::prelude::*;

use super::grid::{PIECE, dot};
use super::matrix_free::MatrixFree;
use super::multigrid::{Fine, Multigrid};
use crate::monitor::{Cancelled, Monitor};

/// How a solution went.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct SolveStats {
    /// Iterations of conjugate gradients.
    pub iterations: usize,
    /// Residual over right side, Euclidean norms.
    pub residual: f64,
    /// The residual fell below the tolerance.
    pub converged: bool,
}

/// Solves `K u = b` from the given u. `b`: (place, value) pairs, none at a fixed place.
///
/// The three vectors of the iteration live as long as the solution: others need the memory in between.
pub(super) fn solve(
    fine: Fine,
    operator: &MatrixFree<f64>,
    multigrid: &mut Multigrid,
    b: &[(usize, f64)],
    u: &mut [f64],
    (tolerance, most): (f64, usize),
    monitor: &Monitor,
) -> Result<SolveStats, Cancelled> {
    let grid = &fine.frame.grid;
    let apply = |x: &[f64], y: &mut [f64]| operator.apply(grid, fine.e, &fine.frame.fixed, x, y);
    let (mut r, mut p, mut q) = (grid.field(), grid.field(), grid.field());
    let size = b.iter().map(|(_, v)| v * v).sum::<f64>().sqrt();
    apply(u, &mut q);
    r.par_iter_mut()
        .zip(&q)
        .for_each(|(r, q): (&mut f64, &f64)| *r = -q);
    for &(at, value) in b {
        r[at] += value;
    }
    let mut residual = dot(&r, &r).sqrt();
    let mut before = 0.0;
    let mut iterations = 0;
    while residual > tolerance * size && iterations < most {
        monitor.check()?;
        multigrid.cycle(fine, &r);
        let z = multigrid.result();
        let rz = dot(&r, z);
        if rz.is_nan() || rz <= 0.0 {
            break;
        }
        let beta = if iterations == 0 { 0.0 } else { rz / before };
        before = rz;
        p.par_chunks_mut(PIECE)
            .zip(z.par_chunks(PIECE))
            .for_each(|(p, z)| {
                p.iter_mut()
                    .zip(z)
                    .for_each(|(p, &z)| *p = f64::from(z) + beta * *p)
            });
        apply(&p, &mut q);
        let alpha = rz / dot(&p, &q);
        u.par_chunks_mut(PIECE)
            .zip(p.par_chunks(PIECE))
            .for_each(|(u, p)| u.iter_mut().zip(p).for_each(|(u, p)| *u += alpha * p));
        r.par_chunks_mut(PIECE)
            .zip(q.par_chunks(PIECE))
            .for_each(|(r, q)| r.iter_mut().zip(q).for_each(|(r, q)| *r -= alpha * q));
        residual = dot(&r, &r).sqrt();
        iterations += 1;
    }
    let residual = if size > 0.0 {
        residual / size
    } else {
        residual
    };
    Ok(SolveStats {
        iterations,
        residual,
        converged: residual <= tolerance,
    })
}
