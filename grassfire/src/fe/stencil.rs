//! Coarse operators: 27 blocks of 3x3 a node, stored sixteen nodes at a time.

use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

use super::grid::{BLOCK, NodeGrid};
use super::window::Window;

/// Numbers of a block of nodes: 27 neighbours, 9 entries, 16 nodes.
pub(super) const STRIDE: usize = 27 * 9 * BLOCK;

/// The operator of a coarse grid. The stored nodes of a plane are cut into blocks, across the ends of runs and rows.
pub(super) struct Stencil {
    /// `[block][neighbour][row][column][node]`.
    pub values: Vec<f32>,
    /// First block of every plane, and the number of blocks.
    pub blocks: Vec<usize>,
    arch: Arch,
}

impl Stencil {
    pub fn new(grid: &NodeGrid) -> Self {
        let mut blocks = vec![0];
        for z in 0..=grid.n[2] {
            blocks.push(blocks[z] + grid.count(z).div_ceil(BLOCK));
        }
        Self {
            values: vec![0.0; blocks[grid.n[2] + 1] * STRIDE],
            blocks,
            arch: Arch::new(),
        }
    }

    /// `y = K u`.
    pub fn apply(&self, grid: &NodeGrid, u: &[f32], y: &mut [f32]) {
        let window = || Window::new(grid, 3);
        grid.planes(3, y)
            .enumerate()
            .for_each_init(window, |near, (z, out)| {
                near.clear();
                let plane = StencilPlane {
                    grid,
                    z,
                    u,
                    values: &self.values[self.blocks[z] * STRIDE..],
                    near,
                    out,
                };
                self.arch.dispatch(plane);
            });
    }

    /// Adds a block to the coupling of a node to a neighbour (0 to 26); nothing where the node is not stored.
    pub fn add(
        &mut self,
        grid: &NodeGrid,
        node: [usize; 3],
        neighbour: usize,
        block: impl Fn(usize, usize) -> f32,
    ) {
        let Some(place) = grid.place(node) else {
            return;
        };
        let first = (self.blocks[node[2]] + place / BLOCK) * STRIDE + place % BLOCK;
        for (r, c) in (0..9).map(|i| (i / 3, i % 3)) {
            self.values[first + (neighbour * 9 + r * 3 + c) * BLOCK] += block(r, c);
        }
    }

    /// The diagonal entry of component `c` of the node at `place` in plane `z`.
    pub fn diagonal(&self, z: usize, place: usize, c: usize) -> f32 {
        let block = self.blocks[z] + place / BLOCK;
        self.values[block * STRIDE + (13 * 9 + 4 * c) * BLOCK + place % BLOCK]
    }
}

/// One plane of the product.
struct StencilPlane<'a> {
    grid: &'a NodeGrid,
    z: usize,
    u: &'a [f32],
    /// From the first block of the plane.
    values: &'a [f32],
    near: &'a mut Window<f32>,
    out: &'a mut [f32],
}

impl WithSimd for StencilPlane<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (grid, z) = (self.grid, self.z);
        let count = grid.count(z);
        let per = BLOCK / S::F32_LANES;
        for y in 0..=grid.n[1] {
            let runs = grid.row(y, z);
            if runs.is_empty() {
                continue;
            }
            self.near.load(grid, self.u, |v| v, y, z);
            let near: [[&[f32]; 27]; 3] = std::array::from_fn(|c| {
                std::array::from_fn(|n| self.near.row(y, n / 3 % 3, n / 9, c))
            });
            for run in runs {
                for block in run.at / BLOCK..(run.at + run.len).div_ceil(BLOCK) {
                    let entries = &self.values[block * STRIDE..][..STRIDE];
                    let entries = S::as_simd_f32s(entries).0;
                    // Where the block begins, counted along this row: other nodes of it belong to other runs.
                    let first = BLOCK + run.x + block * BLOCK - run.at - 1;
                    let mut sums = [[0f32; BLOCK]; 3];
                    for half in 0..per {
                        let mut sum = [simd.splat_f32s(0.0); 3];
                        for n in 0..27 {
                            let at = first + n % 3 + half * S::F32_LANES;
                            for c in 0..3 {
                                let v = simd.partial_load_f32s(&near[c][n][at..at + S::F32_LANES]);
                                for (r, sum) in sum.iter_mut().enumerate() {
                                    let k = entries[(n * 9 + r * 3 + c) * per + half];
                                    *sum = simd.mul_add_e_f32s(k, v, *sum);
                                }
                            }
                        }
                        for (sums, sum) in sums.iter_mut().zip(sum) {
                            S::as_mut_simd_f32s(sums).0[half] = sum;
                        }
                    }
                    let (from, end) = (
                        run.at.max(block * BLOCK),
                        (run.at + run.len).min((block + 1) * BLOCK),
                    );
                    for (c, sums) in sums.iter().enumerate() {
                        self.out[c * count + from..c * count + end]
                            .copy_from_slice(&sums[from - block * BLOCK..end - block * BLOCK]);
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_portable_path_gives_the_same_product() {
        let grid = NodeGrid::new([21, 5, 4], &[true; 21 * 5 * 4]);
        let mut stencil = Stencil::new(&grid);
        let number = |i: usize| ((i * 37 + 11) % 101) as f32 / 101.0 - 0.5;
        for (i, value) in stencil.values.iter_mut().enumerate() {
            *value = number(i);
        }
        let u: Vec<f32> = (0..3 * grid.len()).map(number).collect();
        let mut found = [Arch::new(), Arch::Scalar].map(|arch| {
            stencil.arch = arch;
            let mut y = grid.field();
            stencil.apply(&grid, &u, &mut y);
            y
        });
        let [wide, portable] = &mut found;
        assert!(wide.iter().any(|v| v.abs() > 0.1));
        for (a, b) in wide.iter().zip(portable) {
            assert!((*a - *b).abs() < 1e-4, "{a} {b}");
        }
    }
}
