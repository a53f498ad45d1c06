//! Strain energy of every element.

use pulp::Arch;
use rayon::prelude::*;

use super::grid::NodeGrid;

/// Elements that are worked on together.
const LANES: usize = 8;

/// `u_e' K0 u_e` for the unit stiffness, `[z][y][x]` over `dims`.
pub(super) fn element_energies(
    grid: &NodeGrid,
    dims: [usize; 3],
    k: &[[f64; 24]; 24],
    u: &[f64],
) -> Vec<f64> {
    let [nx, ny, nz] = dims;
    let mut out = vec![0.0; nx * ny * nz];
    out.par_chunks_mut(nx * ny)
        .enumerate()
        .for_each(|(z, out)| {
            Arch::new().dispatch(|| {
                for y in 0..ny {
                    for x in (0..nx).step_by(LANES) {
                        let energies = block(grid, k, u, [x, y, z]);
                        let row = &mut out[y * nx + x..(y + 1) * nx];
                        for (to, e) in row.iter_mut().zip(energies) {
                            *to = e;
                        }
                    }
                }
            });
        });
    out
}

#[inline(always)]
fn block(grid: &NodeGrid, k: &[[f64; 24]; 24], u: &[f64], [x, y, z]: [usize; 3]) -> [f64; LANES] {
    let mut v = [[0f64; LANES]; 24];
    let at = grid.node(x, y, z);
    for (i, v) in v.iter_mut().enumerate() {
        let (corner, c) = (i / 3, i % 3);
        let at = at
            + (corner & 1)
            + (corner >> 1 & 1) * grid.row
            + (corner >> 2) * grid.plane
            + c * grid.sx;
        v.copy_from_slice(&u[at..at + LANES]);
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
