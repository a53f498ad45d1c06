//! Self-intersections of a triangle mesh.

use rayon::prelude::*;
use robust::{Coord3D, orient3d};

use crate::Vec3;
use crate::mesh::TriMesh;
use crate::mesh::bvh::Bvh;

/// Vertices of all triangles that intersect another one, sorted. Exact for triangles in general position: an edge of one
/// crosses the other. Neighbours count when they are folded onto each other.
pub(super) fn intersecting_vertices(mesh: &TriMesh) -> Vec<u32> {
    let bvh = Bvh::new(mesh);
    let bad: Vec<Vec<u32>> = (0..mesh.triangles.len())
        .into_par_iter()
        .with_min_len(512)
        .map(|t| {
            let [a, b, c] = mesh.corners(t);
            let mut out = Vec::new();
            bvh.for_each_in_box(&a.inf(&b).inf(&c), &a.sup(&b).sup(&c), |other| {
                if (other as usize) > t && intersect(mesh, t, other as usize) {
                    out.extend(mesh.triangles[t]);
                    out.extend(mesh.triangles[other as usize]);
                }
            });
            out
        })
        .collect();
    let mut bad = bad.concat();
    bad.sort_unstable();
    bad.dedup();
    bad
}

fn intersect(mesh: &TriMesh, s: usize, t: usize) -> bool {
    let (a, b) = (mesh.triangles[s], mesh.triangles[t]);
    let shared = a.iter().filter(|v| b.contains(v)).count();
    match shared {
        0 | 1 => crosses(mesh, a, b) || crosses(mesh, b, a),
        2 => {
            let normal = |t: usize| mesh.normal(t).unwrap_or_default();
            normal(s).dot(&normal(t)) < -0.9999
        }
        _ => true,
    }
}

/// Whether an edge of `a` that shares no vertex with `b` crosses triangle `b`.
fn crosses(mesh: &TriMesh, a: [u32; 3], b: [u32; 3]) -> bool {
    let [p, q, r] = b.map(|v| coordinate(&mesh.points[v as usize]));
    let side = a.map(|v| {
        if b.contains(&v) {
            0.0
        } else {
            orient3d(p, q, r, coordinate(&mesh.points[v as usize]))
        }
    });
    (0..3).any(|k| {
        let (u, v) = (a[k], a[(k + 1) % 3]);
        if b.contains(&u) || b.contains(&v) || side[k] * side[(k + 1) % 3] >= 0.0 {
            return false;
        }
        let (x, y) = (
            coordinate(&mesh.points[u as usize]),
            coordinate(&mesh.points[v as usize]),
        );
        let turns = [
            orient3d(x, y, p, q),
            orient3d(x, y, q, r),
            orient3d(x, y, r, p),
        ];
        turns.iter().all(|&d| d >= 0.0) || turns.iter().all(|&d| d <= 0.0)
    })
}

fn coordinate(p: &Vec3) -> Coord3D<f64> {
    Coord3D {
        x: p.x,
        y: p.y,
        z: p.z,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crossing_and_touching() {
        let points = [
            [0.0, 0.0, 0.0],
            [2.0, 0.0, 0.0],
            [0.0, 2.0, 0.0],
            [0.5, 0.5, -1.0],
            [0.5, 0.5, 1.0],
            [3.0, 3.0, 1.0],
        ];
        let mut mesh = TriMesh {
            points: points.map(Vec3::from).to_vec(),
            triangles: vec![[0, 1, 2], [3, 4, 5]],
            tags: vec![],
        };
        assert_eq!(intersecting_vertices(&mesh), vec![0, 1, 2, 3, 4, 5]);
        mesh.points[3].z = 0.5;
        assert!(intersecting_vertices(&mesh).is_empty());
    }
}
