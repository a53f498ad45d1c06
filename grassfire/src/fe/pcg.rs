//! Conjugate gradients in double precision, preconditioned by multigrid in single precision.

use rayon::prelude::*;

use super::frame::Frame;
use super::grid::{PIECE, dot};
use super::matrix_free::MatrixFree;
use super::multigrid::Multigrid;
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

/// The vectors of the iteration.
pub(super) struct Pcg {
    pub operator: MatrixFree<f64>,
    r: Vec<f64>,
    p: Vec<f64>,
    q: Vec<f64>,
}

impl Pcg {
    pub fn new(frame: &Frame, operator: MatrixFree<f64>) -> Self {
        let field = || frame.grid.field();
        Self {
            operator,
            r: field(),
            p: field(),
            q: field(),
        }
    }

    /// Solves `K u = b` from the given u. `b`: (place, value) pairs, none at a fixed place.
    pub fn solve(
        &mut self,
        frame: &Frame,
        multigrid: &mut Multigrid,
        b: &[(u32, f64)],
        u: &mut [f64],
        (tolerance, most): (f64, usize),
        monitor: &Monitor,
    ) -> Result<SolveStats, Cancelled> {
        let size = b.iter().map(|(_, v)| v * v).sum::<f64>().sqrt();
        self.apply(frame, u);
        self.r
            .par_iter_mut()
            .zip(&self.q)
            .for_each(|(r, q)| *r = -q);
        for &(at, value) in b {
            self.r[at as usize] += value;
        }
        let mut residual = dot(&self.r, &self.r).sqrt();
        let mut before = 0.0;
        let mut iterations = 0;
        while residual > tolerance * size && iterations < most {
            monitor.check()?;
            multigrid.cycle(&self.r);
            let z = multigrid.result();
            let rz = dot(&self.r, z);
            if rz.is_nan() || rz <= 0.0 {
                break;
            }
            let beta = if iterations == 0 { 0.0 } else { rz / before };
            before = rz;
            self.p
                .par_chunks_mut(PIECE)
                .zip(z.par_chunks(PIECE))
                .for_each(|(p, z)| {
                    p.iter_mut()
                        .zip(z)
                        .for_each(|(p, &z)| *p = f64::from(z) + beta * *p)
                });
            let (p, q) = (&self.p, &mut self.q);
            self.operator
                .apply(&frame.grid, &frame.active, &frame.fixed, p, q);
            let alpha = rz / dot(&self.p, &self.q);
            u.par_chunks_mut(PIECE)
                .zip(self.p.par_chunks(PIECE))
                .for_each(|(u, p)| u.iter_mut().zip(p).for_each(|(u, p)| *u += alpha * p));
            self.r
                .par_chunks_mut(PIECE)
                .zip(self.q.par_chunks(PIECE))
                .for_each(|(r, q)| r.iter_mut().zip(q).for_each(|(r, q)| *r -= alpha * q));
            residual = dot(&self.r, &self.r).sqrt();
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

    /// `q = K u`.
    fn apply(&mut self, frame: &Frame, u: &[f64]) {
        self.operator
            .apply(&frame.grid, &frame.active, &frame.fixed, u, &mut self.q);
    }

    /// `K u` of the last product, without the held places: reactions need them.
    pub fn product(&mut self, frame: &Frame, u: &[f64]) -> &[f64] {
        self.operator
            .apply(&frame.grid, &frame.active, &[], u, &mut self.q);
        &self.q
    }
}
