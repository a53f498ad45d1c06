//! Rigid motions that supports leave free.

use nalgebra::{Matrix3, Matrix3x6, Matrix6, Vector3};

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
pub fn free_modes(
    fixed: &[([usize; 3], usize)],
    springs: &[([usize; 3], Matrix3<f64>)],
) -> Vec<&'static str> {
    let place = |node: &[usize; 3]| node.map(|i| i as f64);
    let fixed = fixed.iter().map(|(node, c)| (place(node), *c));
    let springs = springs.iter().map(|(node, k)| (place(node), *k));
    free_modes_of(&fixed.collect::<Vec<_>>(), &springs.collect::<Vec<_>>())
}

/// The rigid motions that neither fixed degrees of freedom (place, component) nor springs (place, stiffness) hold, as names; empty
/// when all are held.
///
/// A motion may be free about an axis that is none of x, y, z: then the axis nearest to it is named.
pub fn free_modes_of(
    fixed: &[([f64; 3], usize)],
    springs: &[([f64; 3], Matrix3<f64>)],
) -> Vec<&'static str> {
    let along = |c: usize| Matrix3::from_diagonal(&Vector3::ith(c, 1.0));
    // How soft a spring is does not matter here.
    let sizes = springs.iter().map(|(_, k)| k.norm()).filter(|k| *k > 0.0);
    let scale = 1.0 / sizes.clone().sum::<f64>().max(f64::MIN_POSITIVE) * sizes.count() as f64;
    let fixed = fixed.iter().map(|(place, c)| (*place, along(*c)));
    let springs = springs.iter().map(|(place, k)| (*place, scale * k));
    let all: Vec<([f64; 3], Matrix3<f64>)> = fixed.chain(springs).collect();
    if all.is_empty() {
        return RIGID_MODES.to_vec();
    }
    let count = all.len() as f64;
    let mut centre = Vector3::zeros();
    for (place, _) in &all {
        centre += Vector3::from(*place) / count;
    }
    let reach = all
        .iter()
        .map(|(place, _)| (Vector3::from(*place) - centre).norm())
        .fold(0.0, f64::max);
    let reach = if reach > 0.0 { reach } else { 1.0 };
    let mut held = Matrix6::zeros();
    for (place, stiffness) in &all {
        let p = (Vector3::from(*place) - centre) / reach;
        // The motion of this point for unit values of the six motions.
        let mut motion = Matrix3x6::zeros();
        motion.fixed_columns_mut::<3>(0).fill_with_identity();
        motion
            .fixed_columns_mut::<3>(3)
            .copy_from(&-p.cross_matrix());
        held += motion.transpose() * stiffness * motion;
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
