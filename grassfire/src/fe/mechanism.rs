//! Rigid motions that supports leave free.

use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};

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
    // How soft a spring is does not matter here.
    let sizes = springs.iter().map(|(_, k)| k.norm()).filter(|k| *k > 0.0);
    let scale = 1.0 / sizes.clone().sum::<f64>().max(f64::MIN_POSITIVE) * sizes.count() as f64;
    let fixed = fixed.iter().map(|(place, c)| (*place, along(*c)));
    let springs = springs.iter().map(|(place, k)| (*place, scale * k));
    let all: Vec<Held> = fixed.chain(springs).collect();
    if all.is_empty() {
        return RIGID_MODES.to_vec();
    }
    let frame = RigidFrame::around(all.iter().map(|(place, _)| *place));
    let mut names: Vec<usize> = frame.free(&all).iter().map(Vector6::iamax).collect();
    names.sort_unstable();
    names.dedup();
    names.into_iter().map(|i| RIGID_MODES[i]).collect()
}

/// A place and what holds it there.
pub(super) type Held = ([f64; 3], Matrix3<f64>);

/// What holds a component.
pub(super) fn along(component: usize) -> Matrix3<f64> {
    Matrix3::from_diagonal(&Vector3::ith(component, 1.0))
}

/// The point that rigid motions turn about, and the length that rotations are measured by: displacements first, then rotations.
pub(super) struct RigidFrame {
    centre: Vector3<f64>,
    reach: f64,
}

impl RigidFrame {
    /// In the middle of places; as far as the farthest of them.
    pub fn around(places: impl Iterator<Item = [f64; 3]> + Clone) -> Self {
        let places = places.map(Vector3::from);
        let count = places.clone().count().max(1) as f64;
        let centre = places.clone().sum::<Vector3<f64>>() / count;
        let reach = places.map(|p| (p - centre).norm()).fold(0.0, f64::max);
        Self {
            centre,
            reach: if reach > 0.0 { reach } else { 1.0 },
        }
    }

    /// Displacement of a place in a motion.
    pub fn moved(&self, place: [f64; 3], motion: &Vector6<f64>) -> Vector3<f64> {
        let arm = (Vector3::from(place) - self.centre) / self.reach;
        motion.fixed_rows::<3>(0) + motion.fixed_rows::<3>(3).cross(&arm)
    }

    /// What a force on a place does in the six motions.
    pub fn work(&self, place: [f64; 3], force: &Vector3<f64>) -> Vector6<f64> {
        let arm = (Vector3::from(place) - self.centre) / self.reach;
        let mut out = Vector6::zeros();
        out.fixed_rows_mut::<3>(0).copy_from(force);
        out.fixed_rows_mut::<3>(3).copy_from(&arm.cross(force));
        out
    }

    /// The motions, orthonormal, that nothing resists.
    pub fn free(&self, held: &[Held]) -> Vec<Vector6<f64>> {
        let mut stiffness = Matrix6::zeros();
        for (place, k) in held {
            for i in 0..6 {
                let force = k * self.moved(*place, &Vector6::ith(i, 1.0));
                let mut column = stiffness.column_mut(i);
                column += self.work(*place, &force);
            }
        }
        let eigen = stiffness.symmetric_eigen();
        let most = eigen.eigenvalues.max();
        let free = (0..6).filter(|&i| eigen.eigenvalues[i] <= FREE * most);
        free.map(|i| eigen.eigenvectors.column(i).into_owned())
            .collect()
    }
}
