//! The matrix-free product of the fine grid: one plane of nodes, vectorised along x.
//!
//! The instruction set is chosen at run time (`pulp`): AVX-512, AVX2 with FMA, NEON, or plain scalar code.

use pulp::{Simd, WithSimd};

use super::grid::{BLOCK, NodeGrid, Run};
use super::matrix_free::Float;
use super::window::Window;

/// One plane of `y = K u`: gathers the eight elements around every node.
pub(super) struct Plane<'a, T, U> {
    pub grid: &'a NodeGrid,
    pub z: usize,
    /// Node field.
    pub u: &'a [U],
    /// Field of elements: modulus times edge.
    pub e: &'a [f64],
    /// Stiffness of the unit element, row by row.
    pub k: &'a [T; 576],
    /// For rows of u.
    pub near: &'a mut Window<T>,
    /// For rows of e.
    pub around: &'a mut Window<T>,
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
    ($float:ty, $view:ident, $store:ident, $splat:ident, $mul_add:ident) => {
        impl<U: Copy + Into<$float>> WithSimd for Plane<'_, $float, U> {
            type Output = ();

            #[inline(always)]
            fn with_simd<S: Simd>(self, simd: S) {
                let (grid, z) = (self.grid, self.z);
                for y in 0..=grid.n[1] {
                    let runs = grid.row(y, z);
                    if runs.is_empty() {
                        continue;
                    }
                    self.near.load(grid, self.u, U::into, y, z);
                    self.around.load(grid, self.e, <$float>::of, y, z);
                    for &run in runs {
                        let row = Row {
                            y,
                            run,
                            k: self.k,
                            near: self.near,
                            around: self.around,
                            count: grid.count(z),
                            out: self.out,
                        };
                        row.with(simd);
                    }
                }
            }
        }

        impl Row<'_, $float> {
            #[inline(always)]
            fn with<S: Simd>(self, simd: S) {
                let (run, k) = (self.run, self.k);
                let length = run.len.next_multiple_of(BLOCK);
                let near: [[_; 27]; 3] = std::array::from_fn(|c| {
                    std::array::from_fn(|n| {
                        let row = self.near.row(self.y, n / 3 % 3, n / 9, c);
                        S::$view(&row[BLOCK + run.x - 1 + n % 3..][..length]).0
                    })
                });
                let around: [_; 8] = std::array::from_fn(|el| {
                    let row = self.around.row(self.y, 1 - (el >> 1 & 1), 1 - (el >> 2), 0);
                    S::$view(&row[BLOCK + run.x - (el & 1)..][..length]).0
                });
                let vectors = around[0].len();
                let lanes = length / vectors;
                let zero = simd.$splat(0.0);
                for b in 0..run.len.div_ceil(lanes) {
                    let mut t = [[zero; 3]; 8];
                    all_nodes!(simd $mul_add $splat, near k t b);
                    let mut sum = [zero; 3];
                    for (el, t) in t.iter().enumerate() {
                        let e = around[el][b];
                        for r in 0..3 {
                            sum[r] = simd.$mul_add(e, t[r], sum[r]);
                        }
                    }
                    let (first, end) = (b * lanes, run.len.min((b + 1) * lanes));
                    for c in 0..3 {
                        let to = c * self.count + run.at;
                        simd.$store(&mut self.out[to + first..to + end], sum[c]);
                    }
                }
            }
        }
    };
}

/// One run of [`Plane`].
struct Row<'a, T> {
    y: usize,
    run: Run,
    k: &'a [T; 576],
    near: &'a Window<T>,
    around: &'a Window<T>,
    /// Places of a component of the plane.
    count: usize,
    out: &'a mut [T],
}

plane_kernel!(
    f32,
    as_simd_f32s,
    partial_store_f32s,
    splat_f32s,
    mul_add_e_f32s
);
plane_kernel!(
    f64,
    as_simd_f64s,
    partial_store_f64s,
    splat_f64s,
    mul_add_e_f64s
);
