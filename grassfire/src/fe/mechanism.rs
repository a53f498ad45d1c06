//! Rigid motions that supports leave free.

use nalgebra::{Matrix6, Vector6};

/// Names of the rigid motions, in the order of [`free_modes`].
pub const RIGID_MODES: [&str; 6] = [
    "translation along x",
    "translation along y",
    "translation along z",
    "rotation about x",
    "rotation about y",
    "rotation about z",
];

/// Below this share of the best supported motion a motion is free.
const FREE: f64 = 1e-9;

/// [`free_modes_of`] for nodes of a grid.
pub fn free_modes(fixed: &[([usize; 3], usize)]) -> Vec<&'static str> {
    let place = |&(node, component): &([usize; 3], usize)| (node.map(|i| i as f64), component);
    free_modes_of(&fixed.iter().map(place).collect::<Vec<_>>())
}

/// The rigid motions that fixed degrees of freedom (place, component) do not hold, as names; empty when all are held.
///
/// A motion may be free about an axis that is none of x, y, z: then the axis nearest to it is named.
pub fn free_modes_of(fixed: &[([f64; 3], usize)]) -> Vec<&'static str> {
    if fixed.is_empty() {
        return RIGID_MODES.to_vec();
    }
    let count = fixed.len() as f64;
    let mut centre = [0.0; 3];
    for (node, _) in fixed {
        for d in 0..3 {
            centre[d] += node[d] / count;
        }
    }
    let reach = fixed
        .iter()
        .map(|(node, _)| (0..3).map(|d| (node[d] - centre[d]).powi(2)).sum::<f64>())
        .fold(0.0, f64::max)
        .sqrt();
    let reach = if reach > 0.0 { reach } else { 1.0 };
    let mut held = Matrix6::zeros();
    for (node, component) in fixed {
        let p = [0, 1, 2].map(|d| (node[d] - centre[d]) / reach);
        // The motion of this point along the component for unit values of the six motions.
        let rotation = [[0.0, -p[2], p[1]], [p[2], 0.0, -p[0]], [-p[1], p[0], 0.0]];
        let mut row = Vector6::zeros();
        row[*component] = 1.0;
        for axis in 0..3 {
            row[3 + axis] = rotation[axis][*component];
        }
        held += row * row.transpose();
    }
    let eigen = held.symmetric_eigen();
    let most = eigen.eigenvalues.max();
    let mut names: Vec<usize> = (0..6)
        .filter(|&i| eigen.eigenvalues[i] <= FREE * most)
        .map(|i| eigen.eigenvectors.column(i).iamax())
        .collect();
    names.sort_unstable();
    names.dedup();
    names.into_iter().map(|i| RIGID_MODES[i]).collect()
}
