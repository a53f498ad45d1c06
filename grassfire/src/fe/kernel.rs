//! The matrix-free product of the fine grid: one plane of nodes, vectorised along x.
//!
//! The instruction set is chosen at run time (`pulp`): AVX-512, AVX2 with FMA, NEON, or plain scalar code.

use pulp::{Simd, WithSimd};

use super::grid::{BLOCK, NodeGrid};

/// One plane of `y = K u`: gathers the eight elements around every node.
pub(super) struct Plane<'a, T> {
    pub grid: &'a NodeGrid,
    pub z: usize,
    /// Node field.
    pub u: &'a [T],
    /// Element field: modulus times edge.
    pub e: &'a [T],
    /// Stiffness of the unit element, row by row.
    pub k: &'a [T; 576],
    /// One flag a block of nodes of this plane: an element with stiffness touches it.
    pub active: &'a [bool],
    /// The plane of the result.
    pub out: &'a mut [T],
}

/// Adds the part of one of 27 nodes to the elements that hold it: `element, corner of the element` pairs.
macro_rules! node {
    ($simd:ident $mul_add:ident $splat:ident, $near:ident $k:ident $t:ident $b:ident, $n:literal;
     $($el:literal $j:literal),*) => {
        for c in 0..3 {
            let v = $near[c][$n][$b];
            $(for r in 0..3 {
                let entry = $simd.$splat($k[($el * 3 + r) * 24 + $j * 3 + c]);
                $t[$el][r] = $simd.$mul_add(v, entry, $t[$el][r]);
            })*
        }
    };
}

/// All 27 nodes; number `9 (dz + 1) + 3 (dy + 1) + dx + 1`. Written out, because the compiler must keep the 24 sums in
/// registers.
macro_rules! all_nodes {
    ($simd:ident $mul_add:ident $splat:ident, $near:ident $k:ident $t:ident $b:ident) => {
        node!($simd $mul_add $splat, $near $k $t $b, 0; 7 0);
        node!($simd $mul_add $splat, $near $k $t $b, 1; 6 0, 7 1);
        node!($simd $mul_add $splat, $near $k $t $b, 2; 6 1);
        node!($simd $mul_add $splat, $near $k $t $b, 3; 5 0, 7 2);
        node!($simd $mul_add $splat, $near $k $t $b, 4; 4 0, 5 1, 6 2, 7 3);
        node!($simd $mul_add $splat, $near $k $t $b, 5; 4 1, 6 3);
        node!($simd $mul_add $splat, $near $k $t $b, 6; 5 2);
        node!($simd $mul_add $splat, $near $k $t $b, 7; 4 2, 5 3);
        node!($simd $mul_add $splat, $near $k $t $b, 8; 4 3);
        node!($simd $mul_add $splat, $near $k $t $b, 9; 3 0, 7 4);
        node!($simd $mul_add $splat, $near $k $t $b, 10; 2 0, 3 1, 6 4, 7 5);
        node!($simd $mul_add $splat, $near $k $t $b, 11; 2 1, 6 5);
        node!($simd $mul_add $splat, $near $k $t $b, 12; 1 0, 3 2, 5 4, 7 6);
        node!($simd $mul_add $splat, $near $k $t $b, 13; 0 0, 1 1, 2 2, 3 3, 4 4, 5 5, 6 6, 7 7);
        node!($simd $mul_add $splat, $near $k $t $b, 14; 0 1, 2 3, 4 5, 6 7);
        node!($simd $mul_add $splat, $near $k $t $b, 15; 1 2, 5 6);
        node!($simd $mul_add $splat, $near $k $t $b, 16; 0 2, 1 3, 4 6, 5 7);
        node!($simd $mul_add $splat, $near $k $t $b, 17; 0 3, 4 7);
        node!($simd $mul_add $splat, $near $k $t $b, 18; 3 4);
        node!($simd $mul_add $splat, $near $k $t $b, 19; 2 4, 3 5);
        node!($simd $mul_add $splat, $near $k $t $b, 20; 2 5);
        node!($simd $mul_add $splat, $near $k $t $b, 21; 1 4, 3 6);
        node!($simd $mul_add $splat, $near $k $t $b, 22; 0 4, 1 5, 2 6, 3 7);
        node!($simd $mul_add $splat, $near $k $t $b, 23; 0 5, 2 7);
        node!($simd $mul_add $splat, $near $k $t $b, 24; 1 6);
        node!($simd $mul_add $splat, $near $k $t $b, 25; 0 6, 1 7);
        node!($simd $mul_add $splat, $near $k $t $b, 26; 0 7);
    };
}

macro_rules! plane_kernel {
    ($float:ty, $view:ident, $view_mut:ident, $splat:ident, $mul_add:ident) => {
        impl WithSimd for Plane<'_, $float> {
            type Output = ();

            #[inline(always)]
            fn with_simd<S: Simd>(self, simd: S) {
                let blocks = self.grid.blocks();
                for y in 0..=self.grid.n[1] {
                    let active = &self.active[y * blocks..(y + 1) * blocks];
                    let out = &mut self.out[y * self.grid.row..(y + 1) * self.grid.row];
                    if active.iter().any(|&a| a) {
                        let row = Row { grid: self.grid, y, z: self.z, u: self.u, e: self.e, k: self.k, active, out };
                        row.with(simd);
                    } else {
                        out.fill(0.0);
                    }
                }
            }
        }

        impl Row<'_, $float> {
            #[inline(always)]
            fn with<S: Simd>(self, simd: S) {
                let grid = self.grid;
                let (sx, k) = (grid.sx, self.k);
                let first = grid.node(0, self.y, self.z) - grid.plane - grid.row - 1;
                let near: [[_; 27]; 3] = std::array::from_fn(|c| {
                    std::array::from_fn(|n| {
                        let at = first + n / 9 * grid.plane + n / 3 % 3 * grid.row + n % 3 + c * sx;
                        S::$view(&self.u[at..at + sx]).0
                    })
                });
                let corner = grid.element(0, self.y, self.z);
                let around: [_; 8] = std::array::from_fn(|el| {
                    let at = corner - (el & 1) - (el >> 1 & 1) * sx - (el >> 2) * grid.element_plane();
                    S::$view(&self.e[at..at + sx]).0
                });
                let out = S::$view_mut(self.out).0;
                let vectors = around[0].len();
                let per_block = vectors * BLOCK / sx;
                let zero = simd.$splat(0.0);
                for b in 0..vectors {
                    if !self.active[b / per_block] {
                        for c in 0..3 {
                            out[c * vectors + b] = zero;
                        }
                        continue;
                    }
                    let mut t = [[zero; 3]; 8];
                    all_nodes!(simd $mul_add $splat, near k t b);
                    let mut sum = [zero; 3];
                    for (el, t) in t.iter().enumerate() {
                        let e = around[el][b];
                        for r in 0..3 {
                            sum[r] = simd.$mul_add(e, t[r], sum[r]);
                        }
                    }
                    for c in 0..3 {
                        out[c * vectors + b] = sum[c];
                    }
                }
            }
        }
    };
}

/// One row of [`Plane`].
struct Row<'a, T> {
    grid: &'a NodeGrid,
    y: usize,
    z: usize,
    u: &'a [T],
    e: &'a [T],
    k: &'a [T; 576],
    active: &'a [bool],
    out: &'a mut [T],
}

plane_kernel!(
    f32,
    as_simd_f32s,
    as_mut_simd_f32s,
    splat_f32s,
    mul_add_e_f32s
);
plane_kernel!(
    f64,
    as_simd_f64s,
    as_mut_simd_f64s,
    splat_f64s,
    mul_add_e_f64s
);
