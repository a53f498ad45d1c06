//! The linear functions on the corners, solved directly.

use faer::Mat;
use faer::linalg::solvers::Solve;
use faer::sparse::Triplet;
use faer::sparse::linalg::solvers::Llt;

use super::TetError;
use super::assembly::System;
use crate::Vec3;
use crate::fe::cholesky;

/// A factored matrix of the linear functions, and the way to it and back.
pub(super) struct Coarse {
    factor: Llt<usize, f64>,
    corners: Vec<u32>,
    parents: Vec<[u32; 2]>,
    count: usize,
}

impl Coarse {
    pub fn new(system: &mut System) -> Result<Self, TetError> {
        let corners = std::mem::take(&mut system.corners);
        let parents = std::mem::take(&mut system.parents);
        let count = corners.iter().filter(|&&c| c != u32::MAX).count();
        let entries = std::mem::take(&mut system.coarse);
        let entries = entries.into_iter();
        let triplets = entries.map(|(i, j, v)| Triplet::new(i as usize, j as usize, v));
        let unknowns = 3 * count;
        let (_, factor) = cholesky(unknowns, triplets.collect(), None)
            .map_err(|what| TetError::Factor { unknowns, what })?;
        Ok(Self {
            factor,
            corners,
            parents,
            count,
        })
    }

    /// Adds the correction for the residual `r` to `x`; held degrees of freedom stay.
    pub fn correct(&self, r: &[Vec3], x: &mut [Vec3], fixed: &[bool]) {
        let free = |node: usize, d: usize| !fixed[3 * node + d];
        let mut right = Mat::<f64>::zeros(3 * self.count, 1);
        for (node, r) in r.iter().enumerate() {
            for (corner, weight) in self.parts(node) {
                for d in (0..3).filter(|&d| free(node, d)) {
                    right[(3 * corner + d, 0)] += weight * r[d];
                }
            }
        }
        self.factor.solve_in_place(&mut right);
        for (node, x) in x.iter_mut().enumerate() {
            for (corner, weight) in self.parts(node) {
                for d in (0..3).filter(|&d| free(node, d)) {
                    x[d] += weight * right[(3 * corner + d, 0)];
                }
            }
        }
    }

    /// The linear functions that are not zero at a node, with their values.
    fn parts(&self, node: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let own = self.corners[node];
        let parts = if own == u32::MAX {
            self.parents[node].map(|n| (self.corners[n as usize], 0.5))
        } else {
            [(own, 1.0), (u32::MAX, 0.0)]
        };
        let real = |&(corner, _): &(u32, f64)| corner != u32::MAX;
        parts.into_iter().filter(real).map(|(c, w)| (c as usize, w))
    }
}
