//! The largest ball that touches a surface from one side.

use super::{Bvh, TriMesh};
use crate::Vec3;

/// A ball that touches a surface in two places.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TangentBall {
    /// Its centre, mm.
    pub centre: Vec3,
    /// mm.
    pub radius: f64,
    /// Where it touches besides the place that it was asked for, mm.
    pub touch: Vec3,
    /// The triangle there.
    pub triangle: u32,
}

/// A surface with what tangent balls need of it.
#[derive(Debug, Clone)]
pub struct TangentBalls<'a> {
    mesh: &'a TriMesh,
    /// Its triangles.
    pub bvh: Bvh,
    /// Outward unit normal of each triangle; zero where it has none.
    pub normals: Vec<Vec3>,
    /// Triangles around each point: where they start in the list, and the list.
    around: (Vec<u32>, Vec<u32>),
}

/// Triangles at less than this to each other (cosine of 30 degrees) are one smooth surface, facets of a curved one.
pub const SMOOTH: f64 = 0.866;
/// Rounds of shrinking; it converges in five to ten.
const ROUNDS: usize = 40;
/// Shrinking ends when the radius changes by less than this share.
const SETTLED: f64 = 1e-6;

impl<'a> TangentBalls<'a> {
    /// Prepares a surface.
    pub fn new(mesh: &'a TriMesh) -> Self {
        let normal = |t: usize| mesh.normal(t).unwrap_or_default();
        Self {
            mesh,
            bvh: Bvh::new(mesh),
            normals: (0..mesh.triangles.len()).map(normal).collect(),
            around: around(mesh),
        }
    }

    /// The outward unit normal at a point of a triangle, interpolated between those of its corners: means over the triangles there that
    /// are one smooth surface with it, by their angles.
    pub fn normal_at(&self, p: &Vec3, triangle: u32) -> Vec3 {
        let own = self.normals[triangle as usize];
        let corners = self.mesh.corners(triangle as usize);
        let at_corner = |k: usize| {
            let v = self.mesh.triangles[triangle as usize][k];
            let [from, to] = [0, 1].map(|i| self.around.0[v as usize + i] as usize);
            let near = self.around.1[from..to].iter().map(|t| *t as usize);
            let smooth = near.filter(|t| self.normals[*t].dot(&own) > SMOOTH);
            let sum: Vec3 = smooth.map(|t| self.angle(t, v) * self.normals[t]).sum();
            sum.try_normalize(0.0).unwrap_or(own)
        };
        let area = |a: &Vec3, b: &Vec3| (a - p).cross(&(b - p)).norm();
        let weighted = (0..3).map(|k| {
            let [a, b] = [corners[(k + 1) % 3], corners[(k + 2) % 3]];
            area(&a, &b) * at_corner(k)
        });
        weighted.sum::<Vec3>().try_normalize(0.0).unwrap_or(own)
    }

    /// The angle of a triangle at one of its points, radians.
    fn angle(&self, triangle: usize, point: u32) -> f64 {
        let [a, b, c] = self.mesh.corners(triangle);
        let ids = self.mesh.triangles[triangle];
        let [p, q, r] = match ids.iter().position(|v| *v == point) {
            Some(1) => [b, c, a],
            Some(2) => [c, a, b],
            _ => [a, b, c],
        };
        (q - p).angle(&(r - p))
    }

    /// The largest ball, no larger than `most` (mm), that touches the surface at `p` of `triangle` from inside or outside and holds no
    /// other part of it; none when one of radius `most` touches nothing else.
    ///
    /// 1. From the largest radius on: the nearest other place of the surface within the ball gives the radius of the ball that touches
    ///    there, too (the shrinking ball of Ma, Bae and Choi 2012, doi:10.1007/s00371-011-0594-7, on triangles instead of points).
    /// 2. Until nothing lies within.
    ///
    /// Triangles that are one smooth surface with `p` ([`SMOOTH`]) do not count: facets of a curved wall would stop every ball.
    pub fn at(&self, p: &Vec3, triangle: u32, inside: bool, most: f64) -> Option<TangentBall> {
        let normal = self.normal_at(p, triangle);
        let toward = if inside { -normal } else { normal };
        let other = |t: u32, _: &Vec3| self.normals[t as usize].dot(&normal) < SMOOTH;
        let mut radius = most;
        let mut found = None;
        for _ in 0..ROUNDS {
            let centre = p + radius * toward;
            let Some(near) = self
                .bvh
                .nearest_where(&centre, radius * (1.0 - SETTLED), other)
            else {
                break;
            };
            let chord = near.point - p;
            let next = chord.norm_squared() / (2.0 * chord.dot(&toward));
            // Rounding, or a place at the point itself.
            if next.is_nan() || next <= 0.0 || next >= radius {
                break;
            }
            radius = next;
            found = Some(near);
        }
        found.map(|near| TangentBall {
            centre: p + radius * toward,
            radius,
            touch: near.point,
            triangle: near.triangle,
        })
    }
}

/// Triangles around each point of a mesh: where each point's start, and the list.
fn around(mesh: &TriMesh) -> (Vec<u32>, Vec<u32>) {
    let mut start = vec![0_u32; mesh.points.len() + 1];
    let corners = || mesh.triangles.iter().flatten().map(|v| *v as usize);
    corners().for_each(|v| start[v + 1] += 1);
    for v in 0..mesh.points.len() {
        start[v + 1] += start[v];
    }
    let mut next = start.clone();
    let mut list = vec![0; mesh.triangles.len() * 3];
    for (k, v) in corners().enumerate() {
        list[next[v] as usize] = (k / 3) as u32;
        next[v] += 1;
    }
    (start, list)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes::cuboid;

    #[test]
    fn balls_in_a_plate_and_beside_its_edges_are_known() {
        let mesh = cuboid(Vec3::zeros(), Vec3::new(40.0, 30.0, 6.0));
        let plate = TangentBalls::new(&mesh);
        let near = plate.bvh.nearest(&Vec3::new(20.0, 15.0, 7.0), 9.0).unwrap();
        let ball = plate.at(&near.point, near.triangle, true, 50.0).unwrap();
        assert!((ball.radius - 3.0).abs() < 1e-9, "{}", ball.radius);
        assert!((ball.touch - Vec3::new(20.0, 15.0, 0.0)).norm() < 1e-6);
        // Two from the narrow side: a ball of two touches it, too.
        let near = plate.bvh.nearest(&Vec3::new(2.0, 15.0, 7.0), 9.0).unwrap();
        let ball = plate.at(&near.point, near.triangle, true, 50.0).unwrap();
        assert!((ball.radius - 2.0).abs() < 1e-9);
        // Outside there is nothing.
        let outside = plate.at(&near.point, near.triangle, false, 50.0);
        assert!(outside.is_none());
    }
}
