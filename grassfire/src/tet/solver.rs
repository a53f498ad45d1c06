//! Conjugate gradients with two levels.

use nalgebra::Matrix3;

use super::assembly::System;
use super::coarse::Coarse;
use super::{TetError, TetOptions};
use crate::Vec3;
use crate::monitor::Monitor;

/// Power iterations for the largest eigenvalue, and the margin on what they find.
const POWER: usize = 20;
const MARGIN: f64 = 1.1;

/// A matrix ready to be solved with.
pub(super) struct Solver {
    system: System,
    fixed: Vec<bool>,
    coarse: Coarse,
    /// Inverses of the diagonal blocks.
    inverse: Vec<Matrix3<f64>>,
    largest: f64,
    options: TetOptions,
}

/// A solution.
pub(super) struct Solution {
    pub displacement: Vec<Vec3>,
    pub iterations: usize,
}

impl Solver {
    pub fn new(
        mut system: System,
        fixed: Vec<bool>,
        options: &TetOptions,
    ) -> Result<Self, TetError> {
        let coarse = Coarse::new(&mut system)?;
        let inverse = (0..system.nodes())
            .map(|i| {
                let block = system.blocks[system.find(i, i as u32)];
                block.try_inverse().unwrap_or_else(Matrix3::identity)
            })
            .collect();
        let mut solver = Self {
            system,
            fixed,
            coarse,
            inverse,
            largest: 0.0,
            options: options.clone(),
        };
        solver.largest = MARGIN * solver.power();
        Ok(solver)
    }

    /// Largest eigenvalue of the matrix over its diagonal blocks.
    fn power(&self) -> f64 {
        let n = self.system.nodes();
        // Any vector that is no eigenvector does.
        let start = |i: usize| Vec3::new(i as f64, (7 * i) as f64, (13 * i) as f64).map(f64::sin);
        let mut x: Vec<Vec3> = (0..n).map(start).collect();
        let mut y = vec![Vec3::zeros(); n];
        let mut value = 1.0;
        for _ in 0..POWER {
            let norm = dot(&x, &x).sqrt();
            x.iter_mut().for_each(|v| *v /= norm);
            self.system.times(&x, &mut y);
            self.inverse
                .iter()
                .zip(&mut y)
                .for_each(|(m, v)| *v = m * *v);
            value = dot(&y, &y).sqrt();
            std::mem::swap(&mut x, &mut y);
        }
        value
    }

    /// Solves for forces on nodes.
    pub fn solve(
        &self,
        case: usize,
        forces: &[(u32, Vec3)],
        monitor: &Monitor,
    ) -> Result<Solution, TetError> {
        let n = self.system.nodes();
        let mut r = vec![Vec3::zeros(); n];
        for (node, force) in forces {
            let node = *node as usize;
            for d in (0..3).filter(|d| !self.fixed[3 * node + d]) {
                r[node][d] += force[d];
            }
        }
        let size = dot(&r, &r).sqrt();
        let mut x = vec![Vec3::zeros(); n];
        if size == 0.0 {
            return Ok(Solution {
                displacement: x,
                iterations: 0,
            });
        }
        let mut z = self.precondition(&r);
        let mut p = z.clone();
        let mut q = vec![Vec3::zeros(); n];
        let mut rz = dot(&r, &z);
        let mut residual = 1.0;
        for iteration in 1..=self.options.max_iterations {
            monitor.check()?;
            self.system.times(&p, &mut q);
            let alpha = rz / dot(&p, &q);
            add(&mut x, alpha, &p);
            add(&mut r, -alpha, &q);
            residual = dot(&r, &r).sqrt() / size;
            if residual <= self.options.tolerance {
                return Ok(Solution {
                    displacement: x,
                    iterations: iteration,
                });
            }
            z = self.precondition(&r);
            let next = dot(&r, &z);
            let beta = next / rz;
            rz = next;
            p.iter_mut().zip(&z).for_each(|(p, z)| *p = z + beta * *p);
        }
        Err(TetError::NotConverged {
            case,
            iterations: self.options.max_iterations,
            residual,
            tolerance: self.options.tolerance,
        })
    }

    /// One symmetric cycle: smooth, correct by the linear functions, smooth.
    fn precondition(&self, r: &[Vec3]) -> Vec<Vec3> {
        let mut x = vec![Vec3::zeros(); r.len()];
        let mut rest = r.to_vec();
        self.smooth(&mut x, &mut rest);
        let before = x.clone();
        self.coarse.correct(&rest, &mut x, &self.fixed);
        let step: Vec<Vec3> = x.iter().zip(&before).map(|(a, b)| a - b).collect();
        let mut product = before;
        self.system.times(&step, &mut product);
        add(&mut rest, -1.0, &product);
        self.smooth(&mut x, &mut rest);
        x
    }

    /// Chebyshev iteration on the upper eigenvalues; `rest` is the residual before and after.
    fn smooth(&self, x: &mut [Vec3], rest: &mut [Vec3]) {
        let (high, low) = (self.largest, self.largest / self.options.smoother_ratio);
        let (centre, half) = ((high + low) / 2.0, (high - low) / 2.0);
        let sigma = centre / half;
        let mut rho = 1.0 / sigma;
        let scaled = |rest: &[Vec3], i: usize| self.inverse[i] * rest[i];
        let mut step: Vec<Vec3> = (0..x.len()).map(|i| scaled(rest, i) / centre).collect();
        let mut product = vec![Vec3::zeros(); x.len()];
        for k in 0..self.options.smoother_degree {
            add(x, 1.0, &step);
            self.system.times(&step, &mut product);
            add(rest, -1.0, &product);
            if k + 1 < self.options.smoother_degree {
                let next = 1.0 / (2.0 * sigma - rho);
                for (i, step) in step.iter_mut().enumerate() {
                    *step = next * rho * *step + 2.0 * next / half * scaled(rest, i);
                }
                rho = next;
            }
        }
    }
}

fn dot(a: &[Vec3], b: &[Vec3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(b)).sum()
}

fn add(x: &mut [Vec3], factor: f64, y: &[Vec3]) {
    x.iter_mut().zip(y).for_each(|(x, y)| *x += factor * y);
}
