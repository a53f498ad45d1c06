//! The trilinear hexahedron: stiffness of a unit cube.

use super::material::lame;

/// Stiffness matrix of a cube with edge 1 and Young's modulus 1, rows and columns `3 * corner + component`; corner `c`
/// lies at (c & 1, c >> 1 & 1, c >> 2). For edge h and modulus E multiply by E h.
///
/// 2x2x2 Gauss points, which integrate the trilinear element exactly.
pub(super) fn stiffness(nu: f64) -> [[f64; 24]; 24] {
    let mut k = [[0.0; 24]; 24];
    let (lambda, mu) = lame(1.0, nu);
    for point in 0..8 {
        let at = gauss_point(point);
        let d = shape_gradients(at);
        for a in 0..8 {
            for b in 0..8 {
                let laplace: f64 = (0..3).map(|i| d[a][i] * d[b][i]).sum();
                for i in 0..3 {
                    for j in 0..3 {
                        let mut v = lambda * d[a][i] * d[b][j] + mu * d[a][j] * d[b][i];
                        if i == j {
                            v += mu * laplace;
                        }
                        k[3 * a + i][3 * b + j] += 0.125 * v;
                    }
                }
            }
        }
    }
    k
}

/// Gauss point of the 2x2x2 rule in 0..=1 coordinates; all weigh 1/8.
fn gauss_point(point: usize) -> [f64; 3] {
    let g = 0.5 / 3f64.sqrt();
    [0, 1, 2].map(|d| {
        if point >> d & 1 == 1 {
            0.5 + g
        } else {
            0.5 - g
        }
    })
}

/// Gradients of the eight shape functions in a unit cube.
pub(super) fn shape_gradients(at: [f64; 3]) -> [[f64; 3]; 8] {
    let mut out = [[0.0; 3]; 8];
    for (corner, gradient) in out.iter_mut().enumerate() {
        for (d, value) in gradient.iter_mut().enumerate() {
            *value = (0..3)
                .map(|e| match (corner >> e & 1 == 1, e == d) {
                    (true, true) => 1.0,
                    (false, true) => -1.0,
                    (true, false) => at[e],
                    (false, false) => 1.0 - at[e],
                })
                .product();
        }
    }
    out
}

/// Largest eigenvalue of D^-1 K of the unit element, D the diagonal: a bound of that of any assembled matrix.
pub(super) fn jacobi_bound(k: &[[f64; 24]; 24]) -> f64 {
    let m = nalgebra::SMatrix::<f64, 24, 24>::from_fn(|i, j| k[i][j] / (k[i][i] * k[j][j]).sqrt());
    m.symmetric_eigenvalues().max()
}
