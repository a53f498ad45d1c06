//! Strain energy of every element.

use pulp::Arch;
use rayon::prelude::*;

use super::grid::{BLOCK, NodeGrid};
use super::window::Window;

/// Elements that are worked on together.
const LANES: usize = 8;

/// Adds `factor u_e' K0 u_e` for the unit stiffness to `out`, `[z][y][x]` over `dims`; nothing where no node is stored.
pub(super) fn add_energies(
    grid: &NodeGrid,
    [nx, ny, _]: [usize; 3],
    k: &[[f64; 24]; 24],
    u: &[f64],
    factor: f64,
    out: &mut [f64],
) {
    let planes = out.par_chunks_mut(nx * ny).enumerate();
    planes.for_each_init(
        || Window::new(grid, 3),
        |near, (z, out)| {
            near.clear();
            Arch::new().dispatch(|| {
                for y in 0..ny {
                    let runs = grid.row(y, z);
                    if runs.is_empty() {
                        continue;
                    }
                    near.load(grid, u, |v| v, y, z);
                    for run in runs {
                        let row = &mut out[y * nx..(y + 1) * nx];
                        let end = (run.x + run.len).min(nx);
                        for x in (run.x..end).step_by(LANES) {
                            let energies = block(near, k, x, y);
                            for (to, e) in row[x..end].iter_mut().zip(energies) {
                                *to += factor * e;
                            }
                        }
                    }
                }
            });
        },
    );
}

#[inline(always)]
fn block(near: &Window<f64>, k: &[[f64; 24]; 24], x: usize, y: usize) -> [f64; LANES] {
    let mut v = [[0f64; LANES]; 24];
    for (i, v) in v.iter_mut().enumerate() {
        let (corner, c) = (i / 3, i % 3);
        let row = near.row(y, 1 + (corner >> 1 & 1), 1 + (corner >> 2), c);
        v.copy_from_slice(&row[BLOCK + x + (corner & 1)..][..LANES]);
    }
    let mut energy = [0f64; LANES];
    for (row, vi) in k.iter().zip(&v) {
        let mut sum = [0f64; LANES];
        for (&kij, vj) in row.iter().zip(&v) {
            for w in 0..LANES {
                sum[w] += kij * vj[w];
            }
        }
        for w in 0..LANES {
            energy[w] += vi[w] * sum[w];
        }
    }
    energy
}
