//! Coarse operators: 27 blocks of 3x3 a node, stored sixteen nodes at a time.

use pulp::{Arch, Simd, WithSimd};

use super::grid::{BLOCK, NodeGrid};

/// Numbers of a block of nodes: 27 neighbours, 9 entries, 16 nodes.
pub(super) const STRIDE: usize = 27 * 9 * BLOCK;

/// The operator of a coarse grid. Blocks without stiffness are not stored.
pub(super) struct Stencil {
    /// `[block][neighbour][row][column][node]`, stored blocks only.
    pub values: Vec<f32>,
    /// For every block `[z][y][block]` the number of its stored block, or `EMPTY`.
    pub places: Vec<u32>,
    arch: Arch,
}

/// A block without stiffness.
pub(super) const EMPTY: u32 = u32::MAX;

impl Stencil {
    pub fn new(places: Vec<u32>) -> Self {
        let stored = places.iter().filter(|&&p| p != EMPTY).count();
        Self {
            values: vec![0.0; stored * STRIDE],
            places,
            arch: Arch::new(),
        }
    }

    /// `y = K u`.
    pub fn apply(&self, grid: &NodeGrid, u: &[f32], y: &mut [f32]) {
        use rayon::prelude::*;
        let flags = grid.blocks() * (grid.n[1] + 1);
        grid.planes(y).enumerate().for_each(|(z, out)| {
            let plane = StencilPlane {
                grid,
                z,
                u,
                values: &self.values,
                places: &self.places[z * flags..(z + 1) * flags],
                out,
            };
            self.arch.dispatch(plane);
        });
    }

    /// The diagonal entry of component `c` of a node.
    pub fn diagonal(&self, grid: &NodeGrid, node: [usize; 3], c: usize) -> f32 {
        let [x, y, z] = node;
        let block = (z * (grid.n[1] + 1) + y) * grid.blocks() + x / BLOCK;
        match self.places[block] {
            EMPTY => 0.0,
            place => self.values[place as usize * STRIDE + (13 * 9 + 4 * c) * BLOCK + x % BLOCK],
        }
    }
}

/// One plane of the product.
struct StencilPlane<'a> {
    grid: &'a NodeGrid,
    z: usize,
    u: &'a [f32],
    values: &'a [f32],
    places: &'a [u32],
    out: &'a mut [f32],
}

impl WithSimd for StencilPlane<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let grid = self.grid;
        let (blocks, sx) = (grid.blocks(), grid.sx);
        for y in 0..=grid.n[1] {
            for b in 0..blocks {
                let out = y * grid.row + b * BLOCK;
                let place = self.places[y * blocks + b];
                if place == EMPTY {
                    for c in 0..3 {
                        self.out[out + c * sx..][..BLOCK].fill(0.0);
                    }
                    continue;
                }
                let entries = S::as_simd_f32s(&self.values[place as usize * STRIDE..][..STRIDE]).0;
                let per = BLOCK / S::F32_LANES;
                let first = grid.node(b * BLOCK, y, self.z) - grid.plane - grid.row - 1;
                for half in 0..per {
                    let mut sum = [simd.splat_f32s(0.0); 3];
                    for n in 0..27 {
                        let at = first + n / 9 * grid.plane + n / 3 % 3 * grid.row + n % 3;
                        for c in 0..3 {
                            let u = &self.u[at + c * sx + half * S::F32_LANES..][..S::F32_LANES];
                            let v = simd.partial_load_f32s(u);
                            for (r, sum) in sum.iter_mut().enumerate() {
                                let k = entries[(n * 9 + r * 3 + c) * per + half];
                                *sum = simd.mul_add_e_f32s(k, v, *sum);
                            }
                        }
                    }
                    for (c, sum) in sum.into_iter().enumerate() {
                        let to = out + c * sx + half * S::F32_LANES;
                        S::as_mut_simd_f32s(&mut self.out[to..to + S::F32_LANES]).0[0] = sum;
                    }
                }
            }
        }
    }
}
