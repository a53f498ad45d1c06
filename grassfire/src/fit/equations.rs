//! Normal equations over control points: block pattern, assembly and sparse Cholesky.

use faer::Mat;
use faer::sparse::linalg::solvers::{Llt, SymbolicLlt};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMat};
use faer::{Side, prelude::Solve};
use nalgebra::Matrix3;

use crate::Vec3;
use crate::spline::catmull_clark::Stencils;

/// A symmetric matrix of 3 x 3 blocks, one row of blocks a control point. The lower half is kept, by
/// block columns; the pattern never changes, so its symbolic factorisation is made once.
pub(super) struct Equations {
    /// First block of each block column in `rows`.
    offsets: Vec<usize>,
    /// Block rows, ascending within a column, the diagonal first.
    rows: Vec<u32>,
    /// Scalar matrix in compressed column form; the strict upper part of diagonal blocks is unused.
    values: Vec<f64>,
    right: Vec<f64>,
    pattern: SymbolicSparseColMat<usize>,
    symbolic: SymbolicLlt<usize>,
}

impl Equations {
    /// Pattern that holds all products of entries within a row of each of the given operators.
    pub fn new(operators: &[&Stencils]) -> Result<Self, String> {
        let n = operators.first().map_or(0, |o| o.columns);
        let mut columns: Vec<Vec<u32>> = (0..n as u32).map(|c| vec![c]).collect();
        for operator in operators {
            for r in 0..operator.rows() {
                let (points, _) = operator.row(r);
                for (i, &c) in points.iter().enumerate() {
                    columns[c as usize].extend(&points[i..]);
                }
                // Neighbouring samples repeat the same pairs: keep the lists short.
                for &c in points {
                    let list = &mut columns[c as usize];
                    if list.len() > 4096 {
                        list.sort_unstable();
                        list.dedup();
                    }
                }
            }
        }
        let mut offsets = vec![0];
        let mut rows = Vec::new();
        for list in &mut columns {
            list.sort_unstable();
            list.dedup();
            rows.extend_from_slice(list);
            offsets.push(rows.len());
        }
        let (pattern, count) = scalar_pattern(n, &offsets, &rows);
        let symbolic =
            SymbolicLlt::try_new(pattern.as_ref(), Side::Lower).map_err(|e| format!("{e:?}"))?;
        Ok(Self {
            offsets,
            rows,
            values: vec![0.0; count],
            right: vec![0.0; 3 * n],
            pattern,
            symbolic,
        })
    }

    /// Sets everything to zero.
    pub fn clear(&mut self) {
        self.values.fill(0.0);
        self.right.fill(0.0);
    }

    /// Adds rows with the stencil `points`, `weights`, quadratic form `block` and right side `pull`:
    /// x^T (w w^T (x) block) x and w (x) pull.
    pub fn add(&mut self, points: &[u32], weights: &[f64], block: &Matrix3<f64>, pull: &Vec3) {
        for (i, (&c, &wc)) in points.iter().zip(weights).enumerate() {
            let first = self.offsets[c as usize];
            let column = &self.rows[first..self.offsets[c as usize + 1]];
            let height = 3 * column.len();
            let base = 9 * first;
            let mut at = 0;
            for (&r, &wr) in points[i..].iter().zip(&weights[i..]) {
                at += column[at..]
                    .iter()
                    .position(|&x| x == r)
                    .expect("the pattern was made from these rows");
                let w = wc * wr;
                for j in 0..3 {
                    let start = base + j * height + 3 * at;
                    for k in 0..3 {
                        self.values[start + k] += w * block[(k, j)];
                    }
                }
            }
            for k in 0..3 {
                self.right[3 * c as usize + k] += wc * pull[k];
            }
        }
    }

    /// Adds `weight (sum of w_p . x_p - value)^2` for the points p of `row`, ascending.
    pub fn add_row(&mut self, row: &[(u32, Vec3)], weight: f64, value: f64) {
        for (i, (c, wc)) in row.iter().enumerate() {
            let first = self.offsets[*c as usize];
            let column = &self.rows[first..self.offsets[*c as usize + 1]];
            let height = 3 * column.len();
            let mut at = 0;
            for (r, wr) in &row[i..] {
                at += column[at..]
                    .iter()
                    .position(|x| x == r)
                    .expect("the pattern was made from these rows");
                for j in 0..3 {
                    let start = 9 * first + j * height + 3 * at;
                    for k in 0..3 {
                        self.values[start + k] += weight * wr[k] * wc[j];
                    }
                }
            }
            for k in 0..3 {
                self.right[3 * *c as usize + k] += weight * value * wc[k];
            }
        }
    }

    /// Adds `weight |x_p - place|^2` for one point.
    pub fn pin(&mut self, p: u32, weight: f64, place: &Vec3) {
        self.add(
            &[p],
            &[1.0],
            &(weight * Matrix3::identity()),
            &(weight * place),
        );
    }

    /// Factorises the matrix.
    pub fn factor(&self) -> Result<Llt<usize, f64>, String> {
        let matrix = SparseColMatRef::new(self.pattern.as_ref(), &self.values);
        Llt::try_new_with_symbolic(self.symbolic.clone(), matrix, Side::Lower)
            .map_err(|e| format!("{e:?}"))
    }

    /// Solves the system.
    pub fn solve(&self, factor: &Llt<usize, f64>) -> Result<Vec<Vec3>, String> {
        solve(factor, &self.right)
    }
}

/// Solves a factorised system for one right side, three numbers a point.
pub(super) fn solve(factor: &Llt<usize, f64>, right: &[f64]) -> Result<Vec<Vec3>, String> {
    let mut x = Mat::from_fn(right.len(), 1, |i, _| right[i]);
    factor.solve_in_place(&mut x);
    let points: Vec<Vec3> = (0..right.len() / 3)
        .map(|p| Vec3::new(x[(3 * p, 0)], x[(3 * p + 1, 0)], x[(3 * p + 2, 0)]))
        .collect();
    if points.iter().any(|p| p.iter().any(|x| !x.is_finite())) {
        return Err("the solution is not finite".to_owned());
    }
    Ok(points)
}

/// Expands the block pattern; every column holds all three scalars of each block.
fn scalar_pattern(
    n: usize,
    offsets: &[usize],
    rows: &[u32],
) -> (SymbolicSparseColMat<usize>, usize) {
    let mut pointers = vec![0];
    let mut indices = Vec::with_capacity(9 * rows.len());
    for c in 0..n {
        for _ in 0..3 {
            for &r in &rows[offsets[c]..offsets[c + 1]] {
                let r = 3 * r as usize;
                indices.extend([r, r + 1, r + 2]);
            }
            pointers.push(indices.len());
        }
    }
    let count = indices.len();
    (
        SymbolicSparseColMat::new_checked(3 * n, 3 * n, pointers, None, indices),
        count,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solves_a_small_weighted_system() {
        let mut rows = Stencils::new(3);
        rows.push(&mut [(0, 1.0)]);
        rows.push(&mut [(0, -1.0), (2, 1.0)]);
        rows.push(&mut [(1, 0.5), (2, 0.5)]);
        let mut equations = Equations::new(&[&rows]).expect("pattern");
        let targets = [
            Vec3::new(1.0, 2.0, 3.0),
            Vec3::new(4.0, -1.0, 0.5),
            Vec3::new(0.0, 1.0, 7.0),
        ];
        let block = Matrix3::new(2.0, 0.3, 0.1, 0.3, 1.0, -0.2, 0.1, -0.2, 1.5);
        for _ in 0..2 {
            equations.clear();
            for (r, target) in targets.iter().enumerate() {
                let (points, weights) = rows.row(r);
                equations.add(points, weights, &block, &(block * target));
            }
            let factor = equations.factor().expect("positive definite");
            let x = equations.solve(&factor).expect("a solution");
            for (r, target) in targets.iter().enumerate() {
                assert!((rows.apply_row(r, &x) - target).norm() < 1e-12);
            }
        }
    }
}
