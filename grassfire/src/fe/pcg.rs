//! Conjugate gradients in double precision, preconditioned by multigrid in single precision.

use rayon::prelude::*;

use super::grid::{PIECE, dot};
use super::matrix_free::MatrixFree;
use super::multigrid::{Fine, Multigrid};
use super::springs::add_forces;
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
/// The three vectors of the iteration live as long as the solution: others need the memory in between. Search directions are
/// rounded to single precision: displacements and residual both move along the rounded one, so that they stay true to each
/// other.
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
    let (fixed, springs) = (&fine.frame.fixed, &fine.frame.springs);
    let (mut r, mut p, mut q) = (grid.field(), grid.field::<f32>(), grid.field());
    let size = b.iter().map(|(_, v)| v * v).sum::<f64>().sqrt();
    operator.apply(grid, fine.e, fixed, &*u, &mut q);
    add_forces(springs, &*u, &mut q);
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
        precondition(fine, multigrid, &mut r);
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
                    .for_each(|(p, &z)| *p = (f64::from(z) + beta * f64::from(*p)) as f32)
            });
        operator.apply(grid, fine.e, fixed, &p, &mut q);
        add_forces(springs, &p, &mut q);
        let alpha = rz / dot(&p, &q);
        u.par_chunks_mut(PIECE)
            .zip(p.par_chunks(PIECE))
            .for_each(|(u, p)| {
                u.iter_mut()
                    .zip(p)
                    .for_each(|(u, &p)| *u += alpha * f64::from(p))
            });
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

/// One cycle of the multigrid for the residual `r`, in which motions that only springs hold are solved for apart.
fn precondition(fine: Fine, multigrid: &mut Multigrid, r: &mut [f64]) {
    let Some(rigid) = &fine.frame.rigid else {
        return multigrid.cycle(fine, r);
    };
    let by = rigid.answer(fine.frame, r);
    let before = rigid.take_off(&by, r);
    multigrid.cycle(fine, r);
    rigid.put_back(&before, r);
    rigid.exchange(fine.frame, &by, multigrid.result_mut());
}
