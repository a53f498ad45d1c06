//! The ten-node tetrahedron: shape functions, stiffness, strain.

use nalgebra::Matrix3;

use super::EDGES;
use crate::Vec3;
use crate::fe::material::{self, lame};

/// Barycentric coordinates of the Gauss points: one of them is [`NEAR`], the others are [`FAR`].
pub(super) const NEAR: f64 = 0.585_410_196_624_968_5;
pub(super) const FAR: f64 = 0.138_196_601_125_010_5;
/// Weight of a Gauss point over the volume of the reference tetrahedron.
const WEIGHT: f64 = 1.0 / 24.0;

/// Shape functions of the six-node triangle at barycentric coordinates: corners, then the middles of 01, 12, 20.
pub(super) fn triangle_shape(l: [f64; 3]) -> [f64; 6] {
    let corner = |i: usize| l[i] * (2.0 * l[i] - 1.0);
    let middle = |i: usize, j: usize| 4.0 * l[i] * l[j];
    [
        corner(0),
        corner(1),
        corner(2),
        middle(0, 1),
        middle(1, 2),
        middle(2, 0),
    ]
}

/// Shape functions at the Gauss points.
pub(super) fn gauss_shapes() -> [[f64; 10]; 4] {
    std::array::from_fn(|g| {
        let mut l = [FAR; 4];
        l[g] = NEAR;
        std::array::from_fn(|i| match i {
            0..4 => l[i] * (2.0 * l[i] - 1.0),
            _ => 4.0 * EDGES[i - 4].map(|c| l[c]).iter().product::<f64>(),
        })
    })
}

/// Derivatives of the shape functions by the barycentric coordinates 1, 2, 3 (coordinate 0 is the rest to one).
fn slopes(l: [f64; 4]) -> [Vec3; 10] {
    // Gradients of the barycentric coordinates themselves.
    let unit = [-Vec3::repeat(1.0), Vec3::x(), Vec3::y(), Vec3::z()];
    let mut out = [Vec3::zeros(); 10];
    for i in 0..4 {
        out[i] = (4.0 * l[i] - 1.0) * unit[i];
    }
    for (e, [i, j]) in EDGES.into_iter().enumerate() {
        out[4 + e] = 4.0 * (l[j] * unit[i] + l[i] * unit[j]);
    }
    out
}

/// Gradients of the ten shape functions in space at a Gauss point, and its share of the volume, mm3; a negative share
/// means that the element is turned inside out there.
pub(super) struct Gauss {
    pub gradients: [Vec3; 10],
    pub volume: f64,
}

/// The four Gauss points of an element.
pub(super) fn gauss(corners: &[Vec3; 10]) -> [Gauss; 4] {
    std::array::from_fn(|g| {
        let mut l = [FAR; 4];
        l[g] = NEAR;
        let slopes = slopes(l);
        let mut jacobian = Matrix3::zeros();
        for (x, s) in corners.iter().zip(&slopes) {
            jacobian += x * s.transpose();
        }
        let volume = jacobian.determinant() * WEIGHT;
        let inverse = jacobian.try_inverse().unwrap_or_else(Matrix3::zeros);
        Gauss {
            gradients: slopes.map(|s| inverse.transpose() * s),
            volume,
        }
    })
}

/// Stiffness in blocks of 3 x 3, N/mm: `[i][j]` couples the forces on node i to the displacements of node j. None when the
/// element is turned inside out.
pub(super) fn stiffness(
    corners: &[Vec3; 10],
    young: f64,
    nu: f64,
) -> Option<[[Matrix3<f64>; 10]; 10]> {
    let (lambda, mu) = lame(young, nu);
    let mut k = [[Matrix3::zeros(); 10]; 10];
    for Gauss { gradients, volume } in gauss(corners) {
        if volume.is_nan() || volume <= 0.0 {
            return None;
        }
        for i in 0..10 {
            for j in 0..10 {
                let (a, b) = (&gradients[i], &gradients[j]);
                let mut block = lambda * a * b.transpose() + mu * b * a.transpose();
                let even = mu * a.dot(b);
                (0..3).for_each(|d| block[(d, d)] += even);
                k[i][j] += volume * block;
            }
        }
    }
    Some(k)
}

/// Stress at the Gauss points, MPa.
pub(super) fn stress(
    corners: &[Vec3; 10],
    u: &[Vec3; 10],
    young: f64,
    nu: f64,
) -> [Matrix3<f64>; 4] {
    gauss(corners).map(|point| {
        let mut h = Matrix3::zeros();
        for (u, g) in u.iter().zip(&point.gradients) {
            h += u * g.transpose();
        }
        material::stress(&h, young, nu)
    })
}

/// Values at the four corners of a function that is linear in the element and known at the Gauss points.
pub(super) fn at_corners(points: [Matrix3<f64>; 4]) -> [Matrix3<f64>; 4] {
    let sum: Matrix3<f64> = points.iter().sum();
    points.map(|p| (p - FAR * sum) / (NEAR - FAR))
}
