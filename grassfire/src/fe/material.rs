//! The isotropic material: constants and equivalent stress, for voxels and tetrahedra alike.

use nalgebra::Matrix3;

/// Lame's constants, in the unit of `young`.
pub(crate) fn lame(young: f64, nu: f64) -> (f64, f64) {
    (
        young * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)),
        young / (2.0 * (1.0 + nu)),
    )
}

/// Stress for the gradient of the displacement, in the unit of `young`.
pub(crate) fn stress(gradient: &Matrix3<f64>, young: f64, nu: f64) -> Matrix3<f64> {
    let (lambda, mu) = lame(young, nu);
    let mut s = mu * (gradient + gradient.transpose());
    (0..3).for_each(|d| s[(d, d)] += lambda * gradient.trace());
    s
}

/// Von Mises stress of a stress tensor.
pub(crate) fn equivalent(s: &Matrix3<f64>) -> f64 {
    let deviator = s - Matrix3::identity() * (s.trace() / 3.0);
    (1.5 * deviator.norm_squared()).sqrt()
}
