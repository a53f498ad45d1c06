//! The coarsest level, solved directly.

use faer::Mat;
use faer::linalg::solvers::Solve;
use faer::sparse::Triplet;
use faer::sparse::linalg::solvers::{Llt, SymbolicLlt};

use super::FeError;
use super::cholesky::cholesky;
use super::galerkin::corner;
use super::grid::NodeGrid;

/// A factored coarse matrix.
pub(super) struct Coarse {
    /// Place in the level's fields of every unknown.
    unknowns: Vec<usize>,
    /// Unknown of component 0 of every node `[z][y][x]`; the others follow it.
    numbers: Vec<u32>,
    symbolic: Option<SymbolicLlt<usize>>,
    factor: Option<Llt<usize, f64>>,
    right: Mat<f64>,
}

impl Coarse {
    /// Numbers the nodes of the elements that hold stiffness.
    pub fn new(grid: &NodeGrid, occupied: &[bool]) -> Self {
        let n = grid.n;
        let nodes = [n[0] + 1, n[1] + 1, n[2] + 1];
        let mut used = vec![false; nodes[0] * nodes[1] * nodes[2]];
        for (i, _) in occupied.iter().enumerate().filter(|(_, full)| **full) {
            let at = [i % n[0], i / n[0] % n[1], i / (n[0] * n[1])];
            for a in 0..8 {
                let [x, y, z] = corner(at, a);
                used[(z * nodes[1] + y) * nodes[0] + x] = true;
            }
        }
        let mut unknowns = Vec::new();
        let mut numbers = vec![u32::MAX; used.len()];
        for (i, _) in used.iter().enumerate().filter(|(_, used)| **used) {
            numbers[i] = unknowns.len() as u32;
            let at = [
                i % nodes[0],
                i / nodes[0] % nodes[1],
                i / (nodes[0] * nodes[1]),
            ];
            unknowns.extend((0..3).filter_map(|c| grid.node(at, c)));
        }
        let right = Mat::zeros(unknowns.len(), 1);
        Self {
            unknowns,
            numbers,
            symbolic: None,
            factor: None,
            right,
        }
    }

    /// Assembles and factors.
    pub fn factor(
        &mut self,
        grid: &NodeGrid,
        elements: &[([usize; 3], [[f64; 24]; 24])],
    ) -> Result<(), FeError> {
        let size = self.unknowns.len();
        let mut triplets = Vec::with_capacity(elements.len() * 300 + size);
        for (at, k) in elements {
            // A spring on the border of an element may have corners of it that no material touches; it does nothing there.
            let dofs: [Option<usize>; 24] = std::array::from_fn(|i| {
                let [x, y, z] = corner(*at, i / 3);
                let node = (z * (grid.n[1] + 1) + y) * (grid.n[0] + 1) + x;
                let number = self.numbers[node];
                (number != u32::MAX).then_some(number as usize + i % 3)
            });
            for (i, row) in dofs.iter().enumerate() {
                for (j, column) in dofs.iter().enumerate() {
                    if let (Some(row), Some(column)) = (row, column)
                        && row >= column
                    {
                        triplets.push(Triplet::new(*row, *column, k[i][j]));
                    }
                }
            }
        }
        let (symbolic, factor) =
            cholesky(size, triplets, self.symbolic.take()).map_err(|what| FeError::Factor {
                unknowns: size,
                what,
            })?;
        self.symbolic = Some(symbolic);
        self.factor = Some(factor);
        Ok(())
    }

    /// Solves for the right side `b`; `x` is written at the unknowns only.
    pub fn solve(&mut self, b: &[f32], x: &mut [f32]) {
        let Some(factor) = &self.factor else { return };
        for (i, &at) in self.unknowns.iter().enumerate() {
            self.right[(i, 0)] = f64::from(b[at]);
        }
        factor.solve_in_place(&mut self.right);
        for (i, &at) in self.unknowns.iter().enumerate() {
            x[at] = self.right[(i, 0)] as f32;
        }
    }
}
