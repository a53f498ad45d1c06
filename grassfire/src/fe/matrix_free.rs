//! The operator of the finest grid, without a matrix.

use pulp::Arch;
use rayon::prelude::*;

use super::grid::NodeGrid;
use super::kernel::Slab;
use super::parity::{Blocks, blocks};
use super::rows::{Number, Rows};

/// Planes of nodes that are worked on together; the layer of elements between two such slabs is multiplied twice.
const SLAB: usize = 4;

/// A float of the fine operator.
pub(super) trait Float:
    Number + PartialEq + PartialOrd + Send + Sync + Into<f64> + 'static
{
    fn of(value: f64) -> Self;
    /// Some planes of the product with a field of numbers that need not be as precise.
    fn slab<U: Copy + Into<Self>>(arch: Arch, slab: Slab<'_, Self, U>);
}

impl Float for f32 {
    fn of(value: f64) -> Self {
        value as f32
    }
    fn slab<U: Copy + Into<Self>>(arch: Arch, slab: Slab<'_, Self, U>) {
        arch.dispatch(slab);
    }
}

impl Float for f64 {
    fn of(value: f64) -> Self {
        value
    }
    fn slab<U: Copy + Into<Self>>(arch: Arch, slab: Slab<'_, Self, U>) {
        arch.dispatch(slab);
    }
}

/// `K u` for given moduli.
pub(super) struct MatrixFree<T> {
    blocks: Blocks<T>,
    arch: Arch,
}

impl<T: Float> MatrixFree<T> {
    pub fn new(stiffness: &[[f64; 24]; 24]) -> Self {
        Self {
            blocks: blocks(stiffness).map(|x| x.map(|yz| yz.map(|r| r.map(T::of)))),
            arch: Arch::new(),
        }
    }

    /// `y = K u`; the places `fixed` of y are zero. `e`: field of elements, modulus times edge.
    pub fn apply<U: Copy + Into<T> + Sync>(
        &self,
        grid: &NodeGrid,
        e: &[f64],
        fixed: &[usize],
        u: &[U],
        y: &mut [T],
    ) {
        let slabs = grid.slabs(SLAB, 3, y).enumerate();
        slabs.for_each_init(
            || Rows::new(grid, SLAB + 2),
            |rows, (i, out)| {
                let slab = Slab {
                    grid,
                    planes: i * SLAB..((i + 1) * SLAB).min(grid.n[2] + 1),
                    u,
                    e,
                    blocks: &self.blocks,
                    rows,
                    out,
                };
                T::slab(self.arch, slab);
            },
        );
        hold(fixed, y);
    }
}

/// Sets fixed degrees of freedom to zero.
pub(super) fn hold<T: Copy + Default>(fixed: &[usize], field: &mut [T]) {
    for &dof in fixed {
        field[dof] = T::default();
    }
}
