//! The operator of the finest grid, without a matrix.

use pulp::Arch;
use rayon::prelude::*;

use super::grid::NodeGrid;
use super::kernel::Plane;
use super::window::Window;

/// A float of the fine operator.
pub(super) trait Float:
    Copy + Default + PartialEq + PartialOrd + Send + Sync + Into<f64> + 'static
{
    fn of(value: f64) -> Self;
    /// One plane of the product with a field of numbers that need not be as precise.
    fn plane<U: Copy + Into<Self>>(arch: Arch, plane: Plane<'_, Self, U>);
}

impl Float for f32 {
    fn of(value: f64) -> Self {
        value as f32
    }
    fn plane<U: Copy + Into<Self>>(arch: Arch, plane: Plane<'_, Self, U>) {
        arch.dispatch(plane);
    }
}

impl Float for f64 {
    fn of(value: f64) -> Self {
        value
    }
    fn plane<U: Copy + Into<Self>>(arch: Arch, plane: Plane<'_, Self, U>) {
        arch.dispatch(plane);
    }
}

/// `K u` for given moduli.
pub(super) struct MatrixFree<T> {
    k: Box<[T; 576]>,
    arch: Arch,
}

impl<T: Float> MatrixFree<T> {
    pub fn new(stiffness: &[[f64; 24]; 24]) -> Self {
        Self {
            k: Box::new(std::array::from_fn(|i| T::of(stiffness[i / 24][i % 24]))),
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
        let windows = || (Window::new(grid, 3), Window::new(grid, 1));
        grid.planes(3, y)
            .enumerate()
            .for_each_init(windows, |(near, around), (z, out)| {
                near.clear();
                around.clear();
                let plane = Plane {
                    grid,
                    z,
                    u,
                    e,
                    k: &self.k,
                    near,
                    around,
                    out,
                };
                T::plane(self.arch, plane);
            });
        hold(fixed, y);
    }
}

/// Sets fixed degrees of freedom to zero.
pub(super) fn hold<T: Copy + Default>(fixed: &[usize], field: &mut [T]) {
    for &dof in fixed {
        field[dof] = T::default();
    }
}
