//! What is read off a solution.

use nalgebra::Matrix3;
use rayon::prelude::*;

use super::element::{at_corners, gauss, stress};
use super::solver::Solution;
use super::{EDGES, TetLoads, TetMesh, TetModel};
use crate::Vec3;
use crate::fe::material::equivalent;

/// One load case.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TetCase {
    /// Name.
    pub name: String,
    /// Strain energy: the sum over the elements, N mm.
    pub strain_energy: f64,
    /// Half of the work of the loads without the energy in springs, N mm: equal to the strain energy but for the residual.
    pub half_work: f64,
    /// Largest displacement, mm.
    pub u_max: f64,
    /// Where, mm.
    pub u_place: [f64; 3],
    /// Sum of the reactions and of the loads, over that of the sizes of the loads.
    pub reaction_error: f64,
    /// Largest von Mises stress at a Gauss point of an element without held nodes, MPa.
    pub stress_max: f64,
    /// Where, mm.
    pub stress_place: [f64; 3],
    /// Iterations of the solver.
    pub iterations: usize,
    /// Displacement of every node, mm.
    pub displacement: Vec<Vec3>,
    /// Stress at every node, mean of its elements, MPa.
    pub stress: Vec<Matrix3<f64>>,
}

impl TetCase {
    /// Von Mises stress at every node, MPa.
    pub fn von_mises(&self) -> Vec<f32> {
        self.stress.iter().map(|s| equivalent(s) as f32).collect()
    }
}

/// Volume of a mesh, mm3, curved faces included.
pub(super) fn volume(mesh: &TetMesh) -> f64 {
    let one =
        |cell: &[u32; 10]| -> f64 { gauss(&corners(mesh, cell)).iter().map(|g| g.volume).sum() };
    mesh.cells.iter().map(one).sum()
}

fn corners(mesh: &TetMesh, cell: &[u32; 10]) -> [Vec3; 10] {
    cell.map(|n| mesh.points[n as usize])
}

pub(super) fn case(mesh: &TetMesh, model: &TetModel, loads: &TetLoads, found: Solution) -> TetCase {
    let u = &found.displacement;
    let mut out = TetCase {
        name: loads.name.clone(),
        iterations: found.iterations,
        half_work: loads
            .forces
            .iter()
            .map(|(n, f)| f.dot(&u[*n as usize]))
            .sum::<f64>()
            / 2.0,
        ..TetCase::default()
    };
    for (place, u) in mesh.points.iter().zip(u) {
        if u.norm() > out.u_max {
            out.u_max = u.norm();
            out.u_place = (*place).into();
        }
    }
    let internal = elements(mesh, model, u, &mut out);
    out.strain_energy = internal.iter().zip(u).map(|(f, u)| f.dot(u)).sum::<f64>() / 2.0;
    out.reaction_error = reaction_error(model, loads, &internal, u);
    let spring =
        |(node, k): &(u32, Matrix3<f64>)| u[*node as usize].dot(&(k * u[*node as usize])) / 2.0;
    out.half_work -= model.springs.iter().map(spring).sum::<f64>();
    out.displacement = found.displacement;
    out
}

/// Forces of the elements on the nodes; stresses go into `out`.
fn elements(mesh: &TetMesh, model: &TetModel, u: &[Vec3], out: &mut TetCase) -> Vec<Vec3> {
    let mut held = vec![false; mesh.points.len()];
    model
        .fixed
        .iter()
        .for_each(|(n, _)| held[*n as usize] = true);
    let mut internal = vec![Vec3::zeros(); mesh.points.len()];
    let mut sums = vec![(Matrix3::zeros(), 0u32); mesh.points.len()];
    let one = |cell: &[u32; 10]| {
        let places = corners(mesh, cell);
        let moved = cell.map(|n| u[n as usize]);
        let stresses = stress(&places, &moved, model.young, model.nu);
        let mut forces = [Vec3::zeros(); 10];
        for (point, s) in gauss(&places).iter().zip(&stresses) {
            for (f, g) in forces.iter_mut().zip(&point.gradients) {
                *f += point.volume * (s * g);
            }
        }
        (stresses, forces)
    };
    let found: Vec<_> = mesh.cells.par_iter().map(one).collect();
    for (cell, (stresses, forces)) in mesh.cells.iter().zip(found) {
        for (&n, f) in cell.iter().zip(forces) {
            internal[n as usize] += f;
        }
        let at = at_corners(stresses);
        let nodal = |i: usize| match i {
            0..4 => at[i],
            _ => EDGES[i - 4].iter().map(|&c| at[c]).sum::<Matrix3<f64>>() / 2.0,
        };
        for (i, &n) in cell.iter().enumerate() {
            let sum = &mut sums[n as usize];
            *sum = (sum.0 + nodal(i), sum.1 + 1);
        }
        let worst = stresses.iter().map(equivalent).fold(0.0, f64::max);
        if worst > out.stress_max && cell.iter().all(|&n| !held[n as usize]) {
            out.stress_max = worst;
            out.stress_place = (corners(mesh, cell)[..4].iter().sum::<Vec3>() / 4.0).into();
        }
    }
    let mean = |(sum, times): (Matrix3<f64>, u32)| sum / f64::from(times.max(1));
    out.stress = sums.into_iter().map(mean).collect();
    internal
}

/// How far the reactions are from balancing the loads, relative to the loads.
fn reaction_error(model: &TetModel, loads: &TetLoads, internal: &[Vec3], u: &[Vec3]) -> f64 {
    let springs = model.springs.iter();
    let mut sum = -springs.map(|(n, k)| k * u[*n as usize]).sum::<Vec3>();
    for &(node, axis) in &model.fixed {
        sum[axis] += internal[node as usize][axis];
    }
    let mut size = 0.0;
    for (node, force) in &loads.forces {
        size += force.norm();
        for d in 0..3 {
            // A force on a held degree of freedom goes straight into the support.
            if model.fixed.binary_search(&(*node, d)).is_err() {
                sum[d] += force[d];
            }
        }
    }
    if size > 0.0 { sum.norm() / size } else { 0.0 }
}
