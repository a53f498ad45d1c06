//! Evaluation of degree 5 Bezier patches.

use super::Patch;
use crate::Vec3;

/// A point of a surface with its first derivatives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePoint {
    /// Position, mm.
    pub position: Vec3,
    /// Derivative along u, mm.
    pub du: Vec3,
    /// Derivative along v, mm.
    pub dv: Vec3,
    /// Unit normal, outward for outward oriented quads; zero where the two derivatives are parallel.
    pub normal: Vec3,
}

/// Position, first derivatives and unit normal of `patch` at (u, v) in 0..=1.
pub fn evaluate(patch: &Patch, u: f64, v: f64) -> SurfacePoint {
    let (bu, bv) = (bernstein(u), bernstein(v));
    let (su, sv) = (bernstein_slope(u), bernstein_slope(v));
    let du = blend(patch, &su, &bv);
    let dv = blend(patch, &bu, &sv);
    let normal = du
        .cross(&dv)
        .try_normalize(f64::MIN_POSITIVE)
        .unwrap_or_default();
    SurfacePoint {
        position: blend(patch, &bu, &bv),
        du,
        dv,
        normal,
    }
}

/// Basis polynomials and their derivatives at one parameter.
pub(super) type Basis = ([f64; 6], [f64; 6]);

/// Basis polynomials and their derivatives at `t`.
pub(super) fn basis(t: f64) -> Basis {
    (bernstein(t), bernstein_slope(t))
}

/// Calls `visit(i, j, position, du, dv)` on the grid of all pairs of parameters given by their basis; cheaper than
/// single points.
pub(super) fn visit_grid(
    patch: &Patch,
    table: &[Basis],
    mut visit: impl FnMut(usize, usize, Vec3, Vec3, Vec3),
) {
    for (i, (value_u, slope_u)) in table.iter().enumerate() {
        let mut line = [Vec3::zeros(); 6];
        let mut line_du = [Vec3::zeros(); 6];
        for (row, (x, dx)) in patch.control.iter().zip(value_u.iter().zip(slope_u)) {
            for (j, point) in row.iter().enumerate() {
                line[j] += point * *x;
                line_du[j] += point * *dx;
            }
        }
        for (j, (value_v, slope_v)) in table.iter().enumerate() {
            let (mut x, mut du, mut dv) = (Vec3::zeros(), Vec3::zeros(), Vec3::zeros());
            for k in 0..6 {
                x += line[k] * value_v[k];
                du += line_du[k] * value_v[k];
                dv += line[k] * slope_v[k];
            }
            visit(i, j, x, du, dv);
        }
    }
}

/// Second derivatives uu, uv, vv of `patch` at (u, v).
pub(super) fn second_derivatives(patch: &Patch, u: f64, v: f64) -> [Vec3; 3] {
    let (bu, bv) = (bernstein(u), bernstein(v));
    let (su, sv) = (bernstein_slope(u), bernstein_slope(v));
    [
        blend(patch, &bernstein_bend(u), &bv),
        blend(patch, &su, &sv),
        blend(patch, &bu, &bernstein_bend(v)),
    ]
}

fn blend(patch: &Patch, along_u: &[f64; 6], along_v: &[f64; 6]) -> Vec3 {
    let mut sum = Vec3::zeros();
    for (row, x) in patch.control.iter().zip(along_u) {
        let mut line = Vec3::zeros();
        for (point, y) in row.iter().zip(along_v) {
            line += point * *y;
        }
        sum += line * *x;
    }
    sum
}

/// Bernstein polynomials of degree 5.
fn bernstein(t: f64) -> [f64; 6] {
    let low: [f64; 5] = raise(&bernstein3(t), t);
    raise(&low, t)
}

/// First derivatives of the Bernstein polynomials of degree 5.
fn bernstein_slope(t: f64) -> [f64; 6] {
    let low: [f64; 5] = raise(&bernstein3(t), t);
    differences(&low).map(|x| 5.0 * x)
}

/// Second derivatives of the Bernstein polynomials of degree 5.
fn bernstein_bend(t: f64) -> [f64; 6] {
    let low: [f64; 5] = differences(&bernstein3(t));
    differences(&low).map(|x| 20.0 * x)
}

fn bernstein3(t: f64) -> [f64; 4] {
    let s = 1.0 - t;
    [s * s * s, 3.0 * s * s * t, 3.0 * s * t * t, t * t * t]
}

/// Bernstein polynomials of one degree more.
fn raise<const N: usize, const M: usize>(low: &[f64; N], t: f64) -> [f64; M] {
    let at = |i: usize| low.get(i).copied().unwrap_or(0.0);
    std::array::from_fn(|i| {
        if i == 0 {
            (1.0 - t) * at(0)
        } else {
            (1.0 - t) * at(i) + t * at(i - 1)
        }
    })
}

fn differences<const N: usize, const M: usize>(low: &[f64; N]) -> [f64; M] {
    let at = |i: usize| low.get(i).copied().unwrap_or(0.0);
    std::array::from_fn(|i| if i == 0 { -at(0) } else { at(i - 1) - at(i) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bernstein_polynomials_sum_to_one_and_derivatives_to_zero() {
        for t in [0.0, 0.3, 0.77, 1.0] {
            assert!((bernstein(t).iter().sum::<f64>() - 1.0).abs() < 1e-15);
            assert!(bernstein_slope(t).iter().sum::<f64>().abs() < 1e-14);
            assert!(bernstein_bend(t).iter().sum::<f64>().abs() < 1e-13);
            let h = 1e-5;
            for i in 0..6 {
                let slope = (bernstein(t + h)[i] - bernstein(t - h)[i]) / (2.0 * h);
                assert!((slope - bernstein_slope(t)[i]).abs() < 1e-8);
                let bend = (bernstein_slope(t + h)[i] - bernstein_slope(t - h)[i]) / (2.0 * h);
                assert!((bend - bernstein_bend(t)[i]).abs() < 1e-7);
            }
        }
    }
}
