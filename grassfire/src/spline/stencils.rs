//! Sparse operators on points.

use crate::Vec3;

/// Rows of weights over points: a sparse matrix in compressed row form, columns ascending in a row.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Stencils {
    /// Number of points that the rows weigh (columns of the matrix).
    pub columns: usize,
    /// Start of each row in `indices` and `weights`; one more than rows.
    pub offsets: Vec<usize>,
    /// Point of each weight.
    pub indices: Vec<u32>,
    /// Weights.
    pub weights: Vec<f64>,
}

impl Stencils {
    /// No rows yet, over `columns` points.
    pub fn new(columns: usize) -> Self {
        Self {
            columns,
            offsets: vec![0],
            indices: Vec::new(),
            weights: Vec::new(),
        }
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.offsets.len() - 1
    }

    /// Points and weights of row `r`.
    #[inline]
    pub fn row(&self, r: usize) -> (&[u32], &[f64]) {
        let range = self.offsets[r]..self.offsets[r + 1];
        (&self.indices[range.clone()], &self.weights[range])
    }

    /// Appends a row; entries on the same point are added in the given order.
    pub fn push(&mut self, entries: &mut [(u32, f64)]) {
        entries.sort_by_key(|e| e.0);
        let start = self.indices.len();
        for &(index, weight) in entries.iter() {
            if self.indices.len() > start && self.indices.last() == Some(&index) {
                if let Some(last) = self.weights.last_mut() {
                    *last += weight;
                }
            } else {
                self.indices.push(index);
                self.weights.push(weight);
            }
        }
        self.offsets.push(self.indices.len());
    }

    /// The weighted sums of `points`, one a row.
    pub fn apply(&self, points: &[Vec3]) -> Vec<Vec3> {
        (0..self.rows())
            .map(|r| self.apply_row(r, points))
            .collect()
    }

    /// The weighted sum of row `r`.
    #[inline]
    pub fn apply_row(&self, r: usize, points: &[Vec3]) -> Vec3 {
        let (indices, weights) = self.row(r);
        let mut sum = Vec3::zeros();
        for (&i, &w) in indices.iter().zip(weights) {
            sum += w * points[i as usize];
        }
        sum
    }

    /// The product `self * other`: applies `other` first.
    pub fn after(&self, other: &Stencils) -> Stencils {
        let mut product = Stencils::new(other.columns);
        let mut value = vec![0.0; other.columns];
        let mut seen = vec![false; other.columns];
        let mut touched: Vec<u32> = Vec::new();
        for r in 0..self.rows() {
            let (middle, outer) = self.row(r);
            for (&m, &a) in middle.iter().zip(outer) {
                let (indices, weights) = other.row(m as usize);
                for (&i, &w) in indices.iter().zip(weights) {
                    if !seen[i as usize] {
                        seen[i as usize] = true;
                        touched.push(i);
                    }
                    value[i as usize] += a * w;
                }
            }
            touched.sort_unstable();
            for &i in &touched {
                product.indices.push(i);
                product.weights.push(value[i as usize]);
                value[i as usize] = 0.0;
                seen[i as usize] = false;
            }
            touched.clear();
            product.offsets.push(product.indices.len());
        }
        product
    }
}
