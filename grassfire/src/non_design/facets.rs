//! Triangles with normals, areas and neighbours.

use crate::Vec3;
use crate::mesh::TriMesh;

/// No triangle.
pub(super) const NONE: u32 = u32::MAX;

/// A mesh prepared for growing regions.
pub(super) struct Facets<'a> {
    pub(super) mesh: &'a TriMesh,
    /// Unit normal; zero for a triangle without area.
    pub(super) normals: Vec<Vec3>,
    /// mm2.
    pub(super) areas: Vec<f64>,
    pub(super) middles: Vec<Vec3>,
    /// The triangle across each edge (corner k to k + 1); [`NONE`] where there is not exactly one.
    pub(super) next: Vec<[u32; 3]>,
    /// Lower quartile of the edge lengths, mm: CAD tessellations have few long edges that tell nothing, and short ones where
    /// surfaces bend.
    pub(super) edge: f64,
}

impl<'a> Facets<'a> {
    pub(super) fn new(mesh: &'a TriMesh) -> Self {
        let n = mesh.triangles.len();
        let (mut normals, mut areas, mut middles) = (
            Vec::with_capacity(n),
            Vec::with_capacity(n),
            Vec::with_capacity(n),
        );
        let mut lengths = Vec::with_capacity(3 * n);
        for t in 0..n {
            let [a, b, c] = mesh.corners(t);
            let cross = (b - a).cross(&(c - a));
            normals.push(cross.try_normalize(0.0).unwrap_or_else(Vec3::zeros));
            areas.push(cross.norm() / 2.0);
            middles.push((a + b + c) / 3.0);
            lengths.extend([(b - a).norm(), (c - b).norm(), (a - c).norm()]);
        }
        let quarter = lengths.len() / 4;
        let edge = if lengths.is_empty() {
            0.0
        } else {
            *lengths.select_nth_unstable_by(quarter, f64::total_cmp).1
        };
        Self {
            mesh,
            normals,
            areas,
            middles,
            next: neighbours(mesh),
            edge,
        }
    }

    /// Points of some triangles, each once.
    pub(super) fn points(&self, triangles: &[u32]) -> Vec<Vec3> {
        let mut ids: Vec<u32> = triangles
            .iter()
            .flat_map(|&t| self.mesh.triangles[t as usize])
            .collect();
        ids.sort_unstable();
        ids.dedup();
        ids.iter().map(|&v| self.mesh.points[v as usize]).collect()
    }

    /// Middle, normal and area of some triangles.
    pub(super) fn weighted(&self, triangles: &[u32]) -> Vec<(Vec3, Vec3, f64)> {
        let one = |&t: &u32| {
            let t = t as usize;
            (self.middles[t], self.normals[t], self.areas[t])
        };
        triangles.iter().map(one).collect()
    }

    pub(super) fn area(&self, triangles: &[u32]) -> f64 {
        triangles.iter().map(|&t| self.areas[t as usize]).sum()
    }
}

fn neighbours(mesh: &TriMesh) -> Vec<[u32; 3]> {
    let mut edges: Vec<([u32; 2], u32, u8)> = Vec::with_capacity(3 * mesh.triangles.len());
    for (t, triangle) in mesh.triangles.iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (triangle[k], triangle[(k + 1) % 3]);
            edges.push(([a.min(b), a.max(b)], t as u32, k as u8));
        }
    }
    edges.sort_unstable();
    let mut next = vec![[NONE; 3]; mesh.triangles.len()];
    for uses in edges.chunk_by(|a, b| a.0 == b.0) {
        if let [(_, s, i), (_, t, k)] = *uses {
            next[s as usize][i as usize] = t;
            next[t as usize][k as usize] = s;
        }
    }
    next
}
