//! The operator of the finest grid, without a matrix.

use pulp::{Arch, WithSimd};
use rayon::prelude::*;

use super::grid::{BLOCK, NodeGrid};
use super::kernel::Plane;

/// A float of the fine operator.
pub(super) trait Float:
    Copy + Default + PartialEq + PartialOrd + Send + Sync + Into<f64> + 'static
{
    fn of(value: f64) -> Self;
    /// One plane of the product.
    fn plane(arch: Arch, plane: Plane<'_, Self>);
}

impl Float for f32 {
    fn of(value: f64) -> Self {
        value as f32
    }
    fn plane(arch: Arch, plane: Plane<'_, Self>) {
        arch.dispatch(plane);
    }
}

impl Float for f64 {
    fn of(value: f64) -> Self {
        value
    }
    fn plane(arch: Arch, plane: Plane<'_, Self>) {
        arch.dispatch(plane);
    }
}

/// `K u` for elements of modulus `e`, with fixed degrees of freedom held at zero.
pub(super) struct MatrixFree<T> {
    /// Element field: modulus times edge.
    pub e: Vec<T>,
    k: Box<[T; 576]>,
    arch: Arch,
}

impl<T: Float> MatrixFree<T>
where
    for<'a> Plane<'a, T>: WithSimd<Output = ()>,
{
    pub fn new(grid: &NodeGrid, stiffness: &[[f64; 24]; 24]) -> Self {
        Self {
            e: vec![T::default(); grid.element_len()],
            k: Box::new(std::array::from_fn(|i| T::of(stiffness[i / 24][i % 24]))),
            arch: Arch::new(),
        }
    }

    /// `y = K u`; the places `fixed` of y are zero.
    pub fn apply(&self, grid: &NodeGrid, active: &[bool], fixed: &[u32], u: &[T], y: &mut [T]) {
        let flags = grid.blocks() * (grid.n[1] + 1);
        grid.planes(y).enumerate().for_each(|(z, out)| {
            let plane = Plane {
                grid,
                z,
                u,
                e: &self.e,
                k: &self.k,
                active: &active[z * flags..(z + 1) * flags],
                out,
            };
            T::plane(self.arch, plane);
        });
        hold(fixed, y);
    }
}

/// Sets fixed degrees of freedom to zero.
pub(super) fn hold<T: Copy + Default>(fixed: &[u32], field: &mut [T]) {
    for &dof in fixed {
        field[dof as usize] = T::default();
    }
}

/// One flag a block of nodes, `[z][y][block]`: whether an element with stiffness touches it.
pub(super) fn active_blocks<T: Float>(grid: &NodeGrid, e: &[T]) -> Vec<bool> {
    let (blocks, zero) = (grid.blocks(), T::default());
    let rows = grid.n[1] + 1;
    let plane = |z: usize| {
        let mut out = vec![false; blocks * rows];
        for y in 0..rows {
            for around in 0..4 {
                let from = grid.element(0, y, z)
                    - (around & 1) * grid.sx
                    - (around >> 1) * grid.element_plane();
                for (b, flag) in out[y * blocks..(y + 1) * blocks].iter_mut().enumerate() {
                    let at = from + b * BLOCK - 1;
                    *flag |= e[at..=at + BLOCK].iter().any(|&v| v != zero);
                }
            }
        }
        out
    };
    let planes: Vec<Vec<bool>> = (0..=grid.n[2]).into_par_iter().map(plane).collect();
    planes.concat()
}
