//! Wall thickness by rays into the material.

use rayon::prelude::*;

use crate::Vec3;
use crate::mesh::distance::sample_surface;
use crate::mesh::{Bvh, TriMesh};

/// A wall that was measured.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Wall {
    /// Middle of the wall, mm.
    pub place: Vec3,
    /// mm.
    pub thickness: f64,
}

/// Faces count as the two sides of a wall when their normals differ by less than this from opposite (cosine).
const OPPOSITE: f64 = 0.7;

/// Walls at `samples` evenly spread places of the surface, thinnest first: the way along the inward normal to the opposite
/// face. Places without an opposite face (edges, tips) have none.
pub fn walls(mesh: &TriMesh, samples: usize) -> Vec<Wall> {
    let bvh = Bvh::new(mesh);
    let Some((lo, hi)) = bvh.bounds() else {
        return Vec::new();
    };
    let size = (hi - lo).norm();
    let normal = |t: u32| {
        let [a, b, c] = mesh.corners(t as usize);
        (b - a).cross(&(c - a)).try_normalize(0.0)
    };
    let measured = sample_surface(mesh, samples)
        .into_par_iter()
        .filter_map(|(p, t)| {
            let inward = -normal(t)?;
            let (thickness, other) = bvh.first_hit(&p, &inward, 1e-5 * size, size)?;
            (normal(other)?.dot(&inward) > OPPOSITE).then(|| Wall {
                place: p + inward * thickness / 2.0,
                thickness,
            })
        });
    let mut measured: Vec<Wall> = measured.collect();
    measured.sort_by(|a, b| a.thickness.total_cmp(&b.thickness));
    measured
}
