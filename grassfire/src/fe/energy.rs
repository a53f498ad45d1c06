//! Strain energy of every element.

use pulp::Arch;
use rayon::prelude::*;

use super::grid::{BLOCK, NodeGrid, cut};
use super::window::Window;

/// Elements that are worked on together.
const LANES: usize = 8;

/// Adds `factor u_e' K0 u_e` for the unit stiffness to `out`, which has one number for each of `voxels`: their places in
/// `[z][y][x]` over `dims`, ascending. Nothing is added where no node is stored.
pub(super) fn add_energies(
    grid: &NodeGrid,
    [nx, ny, nz]: [usize; 3],
    k: &[[f64; 24]; 24],
    u: &[f64],
    factor: f64,
    voxels: &[u32],
    out: &mut [f64],
) {
    let before = |row: usize| voxels.partition_point(|&v| (v as usize) < row * nx);
    let planes: Vec<usize> = (0..=nz).map(|z| before(z * ny)).collect();
    let parts = cut(out, &planes).into_par_iter().enumerate();
    parts.for_each_init(
        || (Window::new(grid, 3), vec![0.0; nx]),
        |(near, energies), (z, out)| {
            near.clear();
            let voxels = &voxels[planes[z]..planes[z + 1]];
            Arch::new().dispatch(|| {
                let rows = voxels.chunk_by(|&a, &b| a as usize / nx == b as usize / nx);
                let mut to = out.iter_mut();
                for row in rows {
                    let y = row[0] as usize / nx % ny;
                    near.load(grid, u, |v| v, y, z);
                    energies.fill(0.0);
                    for run in grid.row(y, z) {
                        let end = (run.x + run.len).min(nx);
                        for x in (run.x..end).step_by(LANES) {
                            let block = block(near, k, x, y);
                            for (to, e) in energies[x..end].iter_mut().zip(block) {
                                *to = e;
                            }
                        }
                    }
                    for (&v, to) in row.iter().zip(&mut to) {
                        *to += factor * energies[v as usize % nx];
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
