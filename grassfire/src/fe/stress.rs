//! Stress from displacements.

use rayon::prelude::*;

use super::Solver;
use super::element::{lame, shape_gradients};

/// Von Mises stress at the centre of some voxels (indices in `[z][y][x]` order), MPa, for the modulus `young`: in a partly
/// filled voxel that is the stress of its material.
///
/// The centre is the superconvergent point of the trilinear hexahedron.
pub fn von_mises(solver: &Solver, case: usize, young: f64, voxels: &[usize]) -> Vec<f64> {
    let model = solver.model();
    let [nx, ny, _] = model.dims;
    let (lambda, mu) = lame(model.nu);
    let gradients = shape_gradients([0.5; 3]);
    let stress = |&v: &usize| {
        let at = [v % nx, v / nx % ny, v / (nx * ny)];
        let mut g = [[0.0; 3]; 3];
        for (corner, gradient) in gradients.iter().enumerate() {
            let node = [0, 1, 2].map(|d| at[d] + (corner >> d & 1));
            let u = solver.displacement(case, node);
            for (row, u) in g.iter_mut().zip(u) {
                for (value, slope) in row.iter_mut().zip(gradient) {
                    *value += u * slope / model.h;
                }
            }
        }
        let trace = g[0][0] + g[1][1] + g[2][2];
        let s = |r: usize, c: usize| {
            let volume = if r == c { lambda * trace } else { 0.0 };
            young * (volume + mu * (g[r][c] + g[c][r]))
        };
        let (x, y, z) = (s(0, 0), s(1, 1), s(2, 2));
        let shear = s(0, 1).powi(2) + s(1, 2).powi(2) + s(2, 0).powi(2);
        let normal = (x - y).powi(2) + (y - z).powi(2) + (z - x).powi(2);
        (0.5 * normal + 3.0 * shear).sqrt()
    };
    voxels.par_iter().map(stress).collect()
}
