//! Triangle meshes: the soup that files hold, and the validated closed solid.

pub mod bvh;
pub mod distance;
mod repair;
pub mod self_intersection;
#[cfg(test)]
pub(crate) mod shapes;
mod solid;
pub mod tangent_ball;
pub mod winding;

pub use bvh::{Bvh, Nearest};
pub use distance::{Distance, DistanceOptions, DistanceSummary, two_sided};
pub use repair::{Repair, RepairError, RepairKind, RepairOptions, RepairReport, Repaired, repair};
pub use solid::{Solid, SolidError};
pub use tangent_ball::{TangentBall, TangentBalls};
pub use winding::Winding;

use crate::Vec3;

/// Triangles over shared points. Soup is allowed: this is what files hold.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TriMesh {
    /// Positions, mm.
    pub points: Vec<Vec3>,
    /// Point indices, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Empty, or one tag a triangle: which input body or feature it came from.
    pub tags: Vec<u32>,
}

impl TriMesh {
    /// The three corners of triangle `t`.
    #[inline]
    pub fn corners(&self, t: usize) -> [Vec3; 3] {
        self.triangles[t].map(|v| self.points[v as usize])
    }

    /// Unit normal of triangle `t`, out of the material; none where it has no area.
    pub fn normal(&self, t: usize) -> Option<Vec3> {
        let [a, b, c] = self.corners(t);
        (b - a).cross(&(c - a)).try_normalize(0.0)
    }

    /// Area of triangle `t`, mm2.
    pub fn triangle_area(&self, t: usize) -> f64 {
        let [a, b, c] = self.corners(t);
        (b - a).cross(&(c - a)).norm() / 2.0
    }

    /// Adds points, and triangles that count from the first of these. Tags are left to the caller.
    pub fn append(
        &mut self,
        points: impl IntoIterator<Item = Vec3>,
        triangles: impl IntoIterator<Item = [u32; 3]>,
    ) {
        let before = self.points.len() as u32;
        self.points.extend(points);
        let moved = triangles.into_iter().map(|t| t.map(|v| v + before));
        self.triangles.extend(moved);
    }

    /// Signed volume (positive when oriented outward), mm3. Summed about the first point to keep precision.
    pub fn volume(&self) -> f64 {
        let Some(base) = self.points.first() else {
            return 0.0;
        };
        (0..self.triangles.len())
            .map(|t| {
                let [a, b, c] = self.corners(t);
                (a - base).dot(&(b - base).cross(&(c - base))) / 6.0
            })
            .sum()
    }

    /// Surface area, mm2.
    pub fn area(&self) -> f64 {
        (0..self.triangles.len())
            .map(|t| self.triangle_area(t))
            .sum()
    }

    /// Lower and upper corner of the box around all points; `None` without points.
    pub fn bounds(&self) -> Option<(Vec3, Vec3)> {
        let first = *self.points.first()?;
        Some(
            self.points
                .iter()
                .fold((first, first), |(lo, hi), p| (lo.inf(p), hi.sup(p))),
        )
    }
}
