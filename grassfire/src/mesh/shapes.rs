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

/// Walls along z, `length` long: the cells that are filled (`#`) of a raster with borders at `xs` and `ys`, rows from the lowest y on. Triangles
/// of the border only; places where cells meet are not joined.
pub fn walls(xs: &[f64], ys: &[f64], rows: &[&str], length: f64) -> TriMesh {
    let filled = |i: Option<usize>, j: Option<usize>| match (i, j) {
        (Some(i), Some(j)) => rows
            .get(j)
            .is_some_and(|r| r.as_bytes().get(i) == Some(&b'#')),
        _ => false,
    };
    let mut out = TriMesh::default();
    for (j, row) in rows.iter().enumerate() {
        for i in (0..row.len()).filter(|&i| filled(Some(i), Some(j))) {
            let cell = cuboid(
                Vec3::new(xs[i], ys[j], 0.0),
                Vec3::new(xs[i + 1], ys[j + 1], length),
            );
            let open = |t: &[u32; 3]| {
                let [a, b, c] = t.map(|v| cell.points[v as usize]);
                let n = (b - a).cross(&(c - a)).normalize();
                let step = |k: usize, along: f64| k.checked_add_signed(along.round() as isize);
                !filled(step(i, n.x), step(j, n.y)) || n.z.abs() > 0.5
            };
            let triangles: Vec<[u32; 3]> = cell.triangles.iter().copied().filter(open).collect();
            out.append(cell.points.clone(), triangles);
        }
    }
    out
}
