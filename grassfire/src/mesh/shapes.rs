//! Shapes for tests.

use super::TriMesh;
use crate::Vec3;

/// Corners of the faces of a cuboid (bit d of a corner: high in direction d), counter-clockwise from outside.
pub const CUBOID: [[u32; 4]; 6] = [
    [0, 2, 3, 1],
    [4, 5, 7, 6],
    [0, 1, 5, 4],
    [2, 6, 7, 3],
    [0, 4, 6, 2],
    [1, 3, 7, 5],
];

/// The corners that [`CUBOID`] counts.
pub fn cuboid_corners(low: Vec3, high: Vec3) -> Vec<Vec3> {
    let corner = |k: usize| Vec3::from_fn(|d, _| if k >> d & 1 == 1 { high[d] } else { low[d] });
    (0..8).map(corner).collect()
}

/// A cuboid, two triangles a face.
pub fn cuboid(low: Vec3, high: Vec3) -> TriMesh {
    let halves = |[a, b, c, d]: [u32; 4]| [[a, b, c], [a, c, d]];
    TriMesh {
        points: cuboid_corners(low, high),
        triangles: CUBOID.into_iter().flat_map(halves).collect(),
        tags: Vec::new(),
    }
}
