//! The material of a skeleton: balls whose radii run linearly over its triangles and edges.

use rayon::prelude::*;

use crate::Vec3;
use crate::voxel::VoxelGrid;

/// A ball, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ball {
    /// Centre.
    pub(super) centre: Vec3,
    /// Radius.
    pub(super) radius: f64,
}

/// The balls on a triangle, radii linear between its corners; an edge is a triangle with its last two corners equal.
pub(super) type Hull = [Ball; 3];

/// How deep the voxel centres of `layout` lie in the nearest hull: radius minus distance, mm, at the ball where that is largest.
///
/// Negative outside, minus infinity farther than `reach` from the boxes around all hulls. Does not depend on the number of
/// threads: maxima only.
pub(super) fn depths(hulls: &[Hull], layout: &VoxelGrid<f32>, reach: f64) -> Vec<f32> {
    let [nx, ny, _] = layout.dims;
    let boxes: Vec<[[usize; 3]; 2]> = hulls.iter().map(|h| voxels_of(h, layout, reach)).collect();
    let mut out = vec![f32::NEG_INFINITY; layout.values.len()];
    let slices = out.par_chunks_mut((nx * ny).max(1)).enumerate();
    slices.for_each(|(k, slice)| {
        for (hull, [lo, hi]) in hulls.iter().zip(&boxes) {
            if k < lo[2] || k >= hi[2] {
                continue;
            }
            for j in lo[1]..hi[1] {
                for i in lo[0]..hi[0] {
                    let value = depth(hull, &layout.centre(i, j, k)) as f32;
                    let at = &mut slice[j * nx + i];
                    *at = at.max(value);
                }
            }
        }
    });
    out
}

/// First voxel in, and first beyond, the box around a hull and `reach`.
fn voxels_of(hull: &Hull, layout: &VoxelGrid<f32>, reach: f64) -> [[usize; 3]; 2] {
    let ends = [0, 1, 2].map(|d| {
        let low = hull.iter().map(|b| b.centre[d] - b.radius);
        let high = hull.iter().map(|b| b.centre[d] + b.radius);
        let low = low.fold(f64::INFINITY, f64::min) - reach - layout.origin[d];
        let high = high.fold(f64::NEG_INFINITY, f64::max) + reach - layout.origin[d];
        let limit = layout.dims[d] as f64;
        let first = (low / layout.spacing).ceil().clamp(0.0, limit);
        let beyond = ((high / layout.spacing).floor() + 1.0).clamp(0.0, limit);
        [first as usize, beyond as usize]
    });
    [ends.map(|e| e[0]), ends.map(|e| e[1])]
}

/// Largest radius minus distance over the balls of a hull.
///
/// With the radius linear, of slope g < 1 in the plane, and p at height h above it, the ball that reaches farthest sits
/// g h / sqrt(1 - g^2) up the slope from the foot of p. The function is concave: when that ball lies outside the triangle, the
/// best one lies on its border, where the same holds along each edge.
fn depth(hull: &Hull, p: &Vec3) -> f64 {
    let [a, b, c] = hull;
    let (u, v) = (b.centre - a.centre, c.centre - a.centre);
    let normal = u.cross(&v);
    let area = normal.norm_squared();
    if area > 1e-18 * u.norm_squared().max(v.norm_squared()).powi(2) && area > 0.0 {
        let (du, dv) = (b.radius - a.radius, c.radius - a.radius);
        let slope = (v.cross(&normal) * du + normal.cross(&u) * dv) / area;
        let g = slope.norm_squared();
        if g < 1.0 {
            let w = p - a.centre;
            let height = w.dot(&normal) / area.sqrt();
            let foot = w - normal * (w.dot(&normal) / area);
            let x = foot + slope * (height.abs() / (1.0 - g).sqrt());
            let s = x.cross(&v).dot(&normal) / area;
            let t = u.cross(&x).dot(&normal) / area;
            if s >= 0.0 && t >= 0.0 && s + t <= 1.0 {
                return a.radius + slope.dot(&x) - (x - foot).norm().hypot(height);
            }
        }
        let edges = [(a, b), (b, c), (c, a)];
        let depths = edges.map(|(a, b)| depth_in_cone(a, b, p));
        return depths.into_iter().fold(f64::NEG_INFINITY, f64::max);
    }
    depth_in_cone(a, b, p).max(depth_in_cone(a, c, p))
}

fn depth_in_cone(a: &Ball, b: &Ball, p: &Vec3) -> f64 {
    let axis = b.centre - a.centre;
    let length = axis.norm();
    let in_ball = |ball: &Ball| ball.radius - (p - ball.centre).norm();
    let slope = (b.radius - a.radius) / length;
    if !slope.is_finite() || slope.abs() >= 1.0 {
        return in_ball(a).max(in_ball(b));
    }
    let w = p - a.centre;
    let along = w.dot(&axis) / length;
    let height = (w.norm_squared() - along * along).max(0.0).sqrt();
    let at = (along + height * slope / (1.0 - slope * slope).sqrt()).clamp(0.0, length);
    a.radius + slope * at - (along - at).hypot(height)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The closed form against the largest of many balls.
    #[test]
    fn depth_is_that_of_the_farthest_ball() {
        let ball = |x: f64, y: f64, z: f64, radius| Ball {
            centre: Vec3::new(x, y, z),
            radius,
        };
        let hulls = [
            [
                ball(0., 0., 0., 2.),
                ball(10., 0., 1., 4.),
                ball(2., 9., 0., 3.),
            ],
            [
                ball(0., 0., 0., 2.),
                ball(10., 0., 1., 4.),
                ball(10., 0., 1., 4.),
            ],
            // One ball inside another: the slope is larger than 1.
            [
                ball(0., 0., 0., 9.),
                ball(1., 0., 0., 1.),
                ball(0., 2., 0., 1.),
            ],
        ];
        let steps = 200;
        for hull in hulls {
            for n in 0..60_u32 {
                let place = |step: u32| f64::from(n * step % 37) / 37.0 * 20.0 - 5.0;
                let p = Vec3::new(place(7), place(11), place(5) * 0.5);
                let mut best = f64::NEG_INFINITY;
                for i in 0..=steps {
                    for j in 0..=steps - i {
                        let (s, t) = (
                            f64::from(i) / f64::from(steps),
                            f64::from(j) / f64::from(steps),
                        );
                        let weigh = [1.0 - s - t, s, t];
                        let mut centre = Vec3::zeros();
                        let mut radius = 0.0;
                        for (ball, w) in hull.iter().zip(weigh) {
                            centre += ball.centre * w;
                            radius += ball.radius * w;
                        }
                        best = best.max(radius - (p - centre).norm());
                    }
                }
                let exact = depth(&hull, &p);
                assert!(
                    exact >= best - 1e-9 && exact < best + 0.02,
                    "{exact} {best}"
                );
            }
        }
    }
}
