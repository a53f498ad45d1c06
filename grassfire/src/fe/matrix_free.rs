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

#[cfg(test)]
mod tests {
    use super::super::element;
    use super::*;

    /// `K u` element by element; fields `[component][z][y][x]` of all nodes.
    fn by_elements(n: [usize; 3], moduli: &[f64], u: &[Vec<f64>; 3]) -> [Vec<f64>; 3] {
        let k = element::stiffness(0.3);
        let node = |x: usize, y: usize, z: usize| (z * (n[1] + 1) + y) * (n[0] + 1) + x;
        let mut out = u.clone().map(|c| vec![0.0; c.len()]);
        for (i, e) in moduli.iter().enumerate() {
            let [x, y, z] = [i % n[0], i / n[0] % n[1], i / (n[0] * n[1])];
            let nodes: [usize; 8] =
                std::array::from_fn(|c| node(x + (c & 1), y + (c >> 1 & 1), z + (c >> 2)));
            for (r, row) in k.iter().enumerate() {
                let force: f64 = (0..24).map(|c| row[c] * u[c % 3][nodes[c / 3]]).sum();
                out[r % 3][nodes[r / 3]] += e * force;
            }
        }
        out
    }

    #[test]
    fn forces_of_a_slab_do_not_leak_into_the_next_one_on_any_instruction_set() {
        // Rows of one and of several runs, an empty layer, 22 planes; one thread goes from slab to slab with the same rows.
        let n = [37, 6, 21];
        let moduli: Vec<f64> = (0..n.iter().product())
            .map(|i| {
                let [x, y, z] = [i % n[0], i / n[0] % n[1], i / (n[0] * n[1])];
                let empty = z == 9 || (12..25).contains(&x) && y > 1 || (y + z) % 5 == 4;
                if empty {
                    0.0
                } else {
                    1.0 + ((7 * i) % 11) as f64
                }
            })
            .collect();
        let occupied: Vec<bool> = moduli.iter().map(|e| *e > 0.0).collect();
        let grid = NodeGrid::new(n, &occupied);
        let (mut e, mut u) = (grid.scalar::<f64>(), grid.field::<f64>());
        let counts = n.map(|n| n + 1);
        let mut full = [(); 3].map(|()| vec![0.0; counts.iter().product()]);
        let nodes: Vec<[usize; 3]> = (0..full[0].len())
            .map(|i| {
                [
                    i % counts[0],
                    i / counts[0] % counts[1],
                    i / (counts[0] * counts[1]),
                ]
            })
            .collect();
        for (i, &at) in nodes.iter().enumerate() {
            let Some(place) = grid.place(at) else {
                continue;
            };
            if (0..3).all(|d| at[d] < n[d]) {
                e[grid.first(at[2]) + place] = moduli[(at[2] * n[1] + at[1]) * n[0] + at[0]];
            }
            for c in 0..3 {
                full[c][i] = ((13 * i + 5 * c) % 29) as f64 / 29.0;
                u[grid.node(at, c).unwrap()] = full[c][i];
            }
        }
        let wanted = by_elements(n, &moduli, &full);
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(1)
            .build()
            .unwrap();
        // The widest vectors of this machine, and the portable path.
        for arch in [Arch::new(), Arch::Scalar] {
            let stiffness = element::stiffness(0.3);
            let double = MatrixFree::<f64> {
                arch,
                ..MatrixFree::new(&stiffness)
            };
            let single = MatrixFree::<f32> {
                arch,
                ..MatrixFree::new(&stiffness)
            };
            let u32: Vec<f32> = u.iter().map(|&v| v as f32).collect();
            let (mut y, mut y32) = (grid.field(), grid.field());
            pool.install(|| double.apply(&grid, &e, &[], &u, &mut y));
            pool.install(|| single.apply(&grid, &e, &[], &u32, &mut y32));
            for (i, &at) in nodes.iter().enumerate() {
                for c in 0..3 {
                    let wanted = wanted[c][i];
                    let place = grid.node(at, c);
                    let (found, rough) = place.map_or((0.0, 0.0), |i| (y[i], f64::from(y32[i])));
                    assert!(
                        (found - wanted).abs() < 1e-13,
                        "{at:?} {c}: {found} {wanted}"
                    );
                    assert!(
                        (rough - wanted).abs() < 1e-5,
                        "{at:?} {c}: {rough} {wanted}"
                    );
                }
            }
        }
    }
}
