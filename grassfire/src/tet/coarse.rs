//! The linear functions on the corners, solved directly.

use faer::linalg::solvers::Solve;
use faer::sparse::linalg::solvers::{Llt, SymbolicLlt};
use faer::sparse::{SparseColMat, Triplet};
use faer::{Mat, Side};

use super::TetError;
use super::assembly::System;
use crate::Vec3;

/// Added to the diagonal, relative: where most of the nodes around a corner are held, the matrix is singular.
const SHIFT: f64 = 1e-9;

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
        let factor = factor(3 * count, &entries)?;
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

fn factor(size: usize, entries: &[(u32, u32, f64)]) -> Result<Llt<usize, f64>, TetError> {
    let failed = |what: String| TetError::Factor {
        unknowns: size,
        what,
    };
    let mut diagonal = vec![0.0; size];
    let mut triplets = Vec::with_capacity(entries.len() + size);
    for &(row, column, value) in entries {
        if row == column {
            diagonal[row as usize] += value;
        }
        triplets.push(Triplet::new(row as usize, column as usize, value));
    }
    let largest = diagonal.iter().fold(0.0, |m: f64, &v| m.max(v));
    for (i, &d) in diagonal.iter().enumerate() {
        let add = if d <= 1e-14 * largest {
            largest
        } else {
            SHIFT * d
        };
        triplets.push(Triplet::new(i, i, add));
    }
    let matrix = SparseColMat::<usize, f64>::try_new_from_triplets(size, size, &triplets)
        .map_err(|e| failed(format!("{e:?}")))?;
    let symbolic = SymbolicLlt::try_new(matrix.symbolic(), Side::Lower)
        .map_err(|e| failed(format!("{e:?}")))?;
    Llt::try_new_with_symbolic(symbolic, matrix.as_ref(), Side::Lower)
        .map_err(|e| failed(format!("{e:?}")))
}
