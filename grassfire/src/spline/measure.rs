//! Volume and area of closed patch surfaces.

use rayon::prelude::*;

use super::bezier::{bernstein, bernstein_slope};
use super::{Patch, gauss};
use crate::Vec3;

/// Volume enclosed by a closed set of patches, mm3.
///
/// The divergence theorem gives one third of the integral of x . (x_u x x_v), a polynomial of degree 14 in each
/// direction, for which 8 Gauss points a direction are exact. Positions are taken about the first control point to keep
/// precision; the sum runs in the order of the patches, so that the result does not depend on the number of threads.
pub fn volume(patches: &[Patch]) -> f64 {
    let Some(first) = patches.first() else { return 0.0 };
    let base = first.control[0][0];
    integrate(patches, |x, du, dv| (x - base).dot(&du.cross(&dv))) / 3.0
}

/// Area of a set of patches, mm2: 8 x 8 Gauss points a patch; the integrand is a square root, so this is approximate.
pub fn area(patches: &[Patch]) -> f64 {
    integrate(patches, |_, du, dv| du.cross(&dv).norm())
}

fn integrate(patches: &[Patch], integrand: impl Fn(Vec3, Vec3, Vec3) -> f64 + Sync) -> f64 {
    let basis = gauss::RULE.map(|(t, _)| (bernstein(t), bernstein_slope(t)));
    let one = |patch: &Patch| {
        let mut sum = 0.0;
        for ((value_u, slope_u), (_, weight_u)) in basis.iter().zip(gauss::RULE.iter()) {
            let mut line = [Vec3::zeros(); 6];
            let mut line_du = [Vec3::zeros(); 6];
            for (row, (x, dx)) in patch.control.iter().zip(value_u.iter().zip(slope_u)) {
                for (j, point) in row.iter().enumerate() {
                    line[j] += point * *x;
                    line_du[j] += point * *dx;
                }
            }
            for ((value_v, slope_v), (_, weight_v)) in basis.iter().zip(gauss::RULE.iter()) {
                let (mut x, mut du, mut dv) = (Vec3::zeros(), Vec3::zeros(), Vec3::zeros());
                for j in 0..6 {
                    x += line[j] * value_v[j];
                    du += line_du[j] * value_v[j];
                    dv += line[j] * slope_v[j];
                }
                sum += weight_u * weight_v * integrand(x, du, dv);
            }
        }
        sum
    };
    let parts: Vec<f64> = patches.par_iter().map(one).collect();
    parts.iter().sum()
}
