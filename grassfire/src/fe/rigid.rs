//! Rigid motions that only springs hold, solved for apart.
//!
//! Under soft springs they have next to no stiffness beside the elements, whose single-precision products and coarse operators hold
//! or push them by as much: the multigrid cycle would not be positive. Elements do not resist them at all, so that what holds them
//! is known exactly, from a few nodes. J. M. Tang, R. Nabben, C. Vuik, Y. A. Erlangga: Comparison of two-level preconditioners
//! derived from deflation, domain decomposition and multigrid methods, 2009, doi:10.1007/s10915-009-9272-6.

use nalgebra::{DMatrix, DVector, Vector3, Vector6};

use super::frame::Frame;
use super::mechanism::{RigidFrame, along};

/// The motions, and what springs do when the part moves so.
pub(super) struct RigidModes {
    frame: RigidFrame,
    modes: Vec<Vector6<f64>>,
    /// Inverse of their stiffness.
    inverse: DMatrix<f64>,
    /// Place of a spring's degree of freedom, and the force there in every motion.
    forces: Vec<(usize, DVector<f64>)>,
}

impl RigidModes {
    /// None where fixed degrees of freedom hold every motion, or where there is no spring.
    pub fn new(frame: &Frame, fixed: &[([usize; 3], usize)]) -> Option<Self> {
        if frame.springs.is_empty() {
            return None;
        }
        let rigid = RigidFrame::around(frame.springs.iter().map(|s| place(s.at)));
        let held: Vec<_> = fixed
            .iter()
            .map(|(at, c)| (place(*at), along(*c)))
            .collect();
        let modes = rigid.free(&held);
        if modes.is_empty() {
            return None;
        }
        let mut stiffness = DMatrix::zeros(modes.len(), modes.len());
        let mut forces = Vec::new();
        for spring in &frame.springs {
            let moves = modes.iter().map(|mode| rigid.moved(place(spring.at), mode));
            let moves = nalgebra::Matrix3xX::from_columns(&moves.collect::<Vec<_>>());
            let force = spring.stiffness * &moves;
            stiffness += moves.transpose() * &force;
            for (row, &at) in spring.places.iter().enumerate() {
                forces.push((at, force.row(row).transpose()));
            }
        }
        Some(Self {
            frame: rigid,
            modes,
            inverse: stiffness.try_inverse()?,
            forces,
        })
    }

    /// How far the part moves in every motion under the forces `r`.
    pub fn answer(&self, frame: &Frame, r: &[f64]) -> DVector<f64> {
        let mut sum = Vector6::zeros();
        each_node(frame, |node, places| {
            let force = Vector3::from(places.map(|at| r[at]));
            sum += self.frame.work(node, &force);
        });
        let work = self.modes.iter().map(|mode| mode.dot(&sum));
        &self.inverse * DVector::from_iterator(self.modes.len(), work)
    }

    /// Takes the forces of the springs in a motion off `r`: what is left moves the part no farther. Returns what stood there.
    pub fn take_off(&self, by: &DVector<f64>, r: &mut [f64]) -> Vec<f64> {
        let before = self.forces.iter().map(|(at, _)| r[*at]).collect();
        for (at, forces) in &self.forces {
            r[*at] -= forces.dot(by);
        }
        before
    }

    /// Undoes [`RigidModes::take_off`].
    pub fn put_back(&self, before: &[f64], r: &mut [f64]) {
        for ((at, _), value) in self.forces.iter().zip(before) {
            r[*at] = *value;
        }
    }

    /// Puts the motion `by` in the place of the one that `z` holds.
    pub fn exchange(&self, frame: &Frame, by: &DVector<f64>, z: &mut [f32]) {
        let mut held = DVector::zeros(self.modes.len());
        for (at, forces) in &self.forces {
            held += forces * f64::from(z[*at]);
        }
        let by = by - &self.inverse * held;
        let motion: Vector6<f64> = self.modes.iter().zip(by.iter()).map(|(m, b)| m * *b).sum();
        each_node(frame, |node, places| {
            let moved = self.frame.moved(node, &motion);
            for (&at, moved) in places.iter().zip(moved.iter()) {
                z[at] = (f64::from(z[at]) + moved) as f32;
            }
        });
    }
}

/// Calls `work` with every stored node and its places.
fn each_node(frame: &Frame, mut work: impl FnMut([f64; 3], [usize; 3])) {
    let grid = &frame.grid;
    for (z, y) in (0..=grid.n[2]).flat_map(|z| (0..=grid.n[1]).map(move |y| (z, y))) {
        let (first, count) = (3 * grid.first(z), grid.count(z));
        for run in grid.row(y, z) {
            for i in 0..run.len {
                let at = first + run.at + i;
                work(place([run.x + i, y, z]), [at, at + count, at + 2 * count]);
            }
        }
    }
}

fn place(node: [usize; 3]) -> [f64; 3] {
    node.map(|i| i as f64)
}
