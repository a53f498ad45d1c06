//! The matrix-free product of the fine grid: some planes of nodes, element by element, vectorised along x.
//!
//! 1. Every row of nodes is written out in full, as sums and differences of neighbours along x.
//! 2. Of every row of elements the sums and differences along y and z are made, multiplied by the blocks of
//!    [`super::parity`] and by the moduli, and taken apart again along y and z.
//! 3. A row of nodes that all its elements are in is taken apart along x and added to the result.
//!
//! The instruction set is chosen at run time (`pulp`): AVX-512, AVX2 with FMA, NEON, or plain scalar code.

use std::ops::Range;

use pulp::{Simd, WithSimd};

use super::grid::{BLOCK, NodeGrid};
use super::matrix_free::Float;
use super::parity::Blocks;
use super::rows::Rows;

/// Some planes of nodes of `y = K u`.
pub(super) struct Slab<'a, T, U> {
    pub grid: &'a NodeGrid,
    pub planes: Range<usize>,
    /// Node field.
    pub u: &'a [U],
    /// Field of elements: modulus times edge.
    pub e: &'a [f64],
    pub blocks: &'a Blocks<T>,
    pub rows: &'a mut Rows<T>,
    /// The planes of the result.
    pub out: &'a mut [T],
}

/// Sums and differences of four corners `dy + 2 dz` along y and z, or the way back: the transform is its own inverse but for
/// a factor.
macro_rules! transform {
    ($simd:ident $add:ident $sub:ident $at:expr) => {{
        let at = $at;
        let (lower, upper) = ($simd.$add(at[0], at[1]), $simd.$add(at[2], at[3]));
        let (left, right) = ($simd.$sub(at[0], at[1]), $simd.$sub(at[2], at[3]));
        [
            $simd.$add(lower, upper),
            $simd.$add(left, right),
            $simd.$sub(lower, upper),
            $simd.$sub(left, right),
        ]
    }};
}

macro_rules! slab_kernel {
    ($float:ty, $view:ident, $view_mut:ident, $splat:ident, $add:ident, $sub:ident, $mul:ident, $mul_add:ident) => {
        impl<U: Copy + Into<$float>> WithSimd for Slab<'_, $float, U> {
            type Output = ();

            #[inline(always)]
            fn with_simd<S: Simd>(self, simd: S) {
                let Self { grid, planes, rows, .. } = self;
                self.out.fill(0.0);
                let layers = planes.start.saturating_sub(1)..planes.end.min(grid.n[2]);
                rows.begin(layers.start..layers.end + 1);
                for y in 0..grid.n[1] {
                    for z in layers.clone() {
                        if grid.row(y, z).is_empty() {
                            continue;
                        }
                        rows.load(grid, self.u, U::into, y);
                        rows.load_moduli(grid, self.e, <$float>::of, y, z);
                        let mut done = 0;
                        for run in grid.row(y, z) {
                            // Whole blocks of a row: two runs may share one.
                            let first = (run.x / BLOCK).max(done);
                            done = (run.x + run.len).div_ceil(BLOCK);
                            if first < done {
                                let places = (first + 1) * BLOCK..(done + 1) * BLOCK;
                                rows.multiply(simd, self.blocks, 0, [y, z], places.clone());
                                rows.multiply(simd, self.blocks, 1, [y, z], places);
                            }
                        }
                    }
                    rows.add_to(grid, y, &planes, self.out);
                }
                rows.add_to(grid, grid.n[1], &planes, self.out);
            }
        }

        impl Rows<$float> {
            /// Elements of one parity about x at some places of a row.
            #[inline(always)]
            fn multiply<S: Simd>(
                &mut self,
                simd: S,
                blocks: &Blocks<$float>,
                parity: usize,
                [y, z]: [usize; 2],
                places: Range<usize>,
            ) {
                let orders = [parity ^ 1, parity, parity];
                let row = self.elements(y, z, orders);
                let moduli = S::$view(&row.moduli[places.clone()]).0;
                let mut nodes = [moduli; 12];
                for (to, from) in nodes.iter_mut().zip(row.nodes) {
                    *to = S::$view(&from[places.clone()]).0;
                }
                let mut forces: [&mut [_]; 12] = Default::default();
                for (to, from) in forces.iter_mut().zip(row.forces) {
                    *to = S::$view_mut(&mut from[places.clone()]).0;
                }
                let blocks = &blocks[parity];
                let zero = simd.$splat(0.0);
                for (b, &e) in moduli.iter().enumerate() {
                    let mut u = [[zero; 4]; 3];
                    for c in 0..3 {
                        let at = [nodes[4 * c][b], nodes[4 * c + 1][b], nodes[4 * c + 2][b], nodes[4 * c + 3][b]];
                        u[c] = transform!(simd $add $sub at);
                    }
                    let mut f = u;
                    for q in 0..4 {
                        let u = [u[0][q], u[1][q ^ 1], u[2][q ^ 2]];
                        for r in 0..3 {
                            let k = blocks[q][r];
                            let sum = simd.$mul(simd.$splat(k[0]), u[0]);
                            let sum = simd.$mul_add(simd.$splat(k[1]), u[1], sum);
                            let sum = simd.$mul_add(simd.$splat(k[2]), u[2], sum);
                            f[r][q ^ r] = simd.$mul(e, sum);
                        }
                    }
                    for c in 0..3 {
                        let at = transform!(simd $add $sub f[c]);
                        for corner in 0..4 {
                            let force = &mut forces[4 * c + corner][b];
                            *force = simd.$add(*force, at[corner]);
                        }
                    }
                }
            }
        }
    };
}

slab_kernel!(
    f32,
    as_simd_f32s,
    as_mut_simd_f32s,
    splat_f32s,
    add_f32s,
    sub_f32s,
    mul_f32s,
    mul_add_e_f32s
);
slab_kernel!(
    f64,
    as_simd_f64s,
    as_mut_simd_f64s,
    splat_f64s,
    add_f64s,
    sub_f64s,
    mul_f64s,
    mul_add_e_f64s
);
