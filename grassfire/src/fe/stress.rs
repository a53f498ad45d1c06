//! Stress from displacements.

use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use super::element::shape_gradients;
use super::{Solver, material};

/// Von Mises stress at the centre of some voxels (indices in `[z][y][x]` order), MPa, for the modulus `young`: in a partly
/// filled voxel that is the stress of its material. Of the case solved last.
///
/// The centre is the superconvergent point of the trilinear hexahedron.
pub fn von_mises(solver: &Solver, young: f64, voxels: &[usize]) -> Vec<f64> {
    let model = solver.model();
    let [nx, ny, _] = model.dims;
    let gradients = shape_gradients([0.5; 3]);
    let stress = |&v: &usize| {
        let at = [v % nx, v / nx % ny, v / (nx * ny)];
        let mut gradient = Matrix3::zeros();
        for (corner, slope) in gradients.iter().enumerate() {
            let node = [0, 1, 2].map(|d| at[d] + (corner >> d & 1));
            let u = Vector3::from(solver.displacement(node));
            gradient += u * Vector3::from(*slope).transpose() / model.h;
        }
        material::equivalent(&material::stress(&gradient, young, model.nu))
    };
    voxels.par_iter().map(stress).collect()
}
