//! Volume and area of closed patch surfaces.

use rayon::prelude::*;

use super::bezier::{basis, visit_grid};
use super::{Patch, gauss};
use crate::Vec3;

/// Volume enclosed by a closed set of patches, mm3.
///
/// The divergence theorem gives one third of the integral of x . (x_u x x_v), a polynomial of degree 14 in each
/// direction, for which 8 Gauss points a direction are exact. Positions are taken about the first control point to keep
/// precision; the sum runs in the order of the patches, so that the result does not depend on the number of threads.
pub fn volume(patches: &[Patch]) -> f64 {
    let Some(first) = patches.first() else {
        return 0.0;
    };
    let base = first.control[0][0];
    integrate(patches, |x, du, dv| (x - base).dot(&du.cross(&dv))) / 3.0
}

/// Area of a set of patches, mm2: 8 x 8 Gauss points a patch; the integrand is a square root, so this is approximate.
pub fn area(patches: &[Patch]) -> f64 {
    integrate(patches, |_, du, dv| du.cross(&dv).norm())
}

fn integrate(patches: &[Patch], integrand: impl Fn(Vec3, Vec3, Vec3) -> f64 + Sync) -> f64 {
    let table = gauss::RULE.map(|(t, _)| basis(t));
    let one = |patch: &Patch| {
        let mut sum = 0.0;
        visit_grid(patch, &table, |i, j, x, du, dv| {
            sum += gauss::RULE[i].1 * gauss::RULE[j].1 * integrand(x, du, dv);
        });
        sum
    };
    let parts: Vec<f64> = patches.par_iter().map(one).collect();
    parts.iter().sum()
}
