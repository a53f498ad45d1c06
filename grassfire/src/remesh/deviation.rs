//! How far the new surface is from the input surface.

use rayon::prelude::*;

use crate::Vec3;
use crate::mesh::TriMesh;
use crate::mesh::bvh::Bvh;
use crate::mesh::distance::sample_surface;
use crate::mesh::winding::Winding;
use crate::voxel::VoxelGrid;

/// Largest distance (mm) from `samples` points of the input surface to the new one.
///
/// Left out are points where `skip(voxel, triangle)` is true, and points of faces that bound nothing: inside an overlap
/// or outside on a loose sheet, where the winding number does not cross 1/2.
pub(super) fn deviation(
    mesh: &TriMesh,
    bvh: &Bvh,
    new: &TriMesh,
    grid: &VoxelGrid<f32>,
    skip: impl Fn(usize, u32) -> bool + Sync,
    samples: usize,
) -> f64 {
    let tree = Bvh::new(new);
    let winding = Winding::new(bvh);
    let h = grid.spacing;
    let bounds = |p: &Vec3, t: u32| {
        let [a, b, c] = mesh.corners(t as usize);
        let normal = (b - a)
            .cross(&(c - a))
            .try_normalize(0.0)
            .unwrap_or_default();
        (winding.at(&(p + normal * (0.25 * h))) > 0.5)
            != (winding.at(&(p - normal * (0.25 * h))) > 0.5)
    };
    let distance = |(p, t): (Vec3, u32)| {
        let at = grid.to_grid(&p);
        let index = |a: usize| (at[a].round().max(0.0) as usize).min(grid.dims[a] - 1);
        if skip(grid.index(index(0), index(1), index(2)), t) {
            return 0.0;
        }
        let distance = tree.nearest(&p, f64::INFINITY).map_or(0.0, |n| n.distance);
        if distance < 0.5 * h || bounds(&p, t) {
            distance
        } else {
            0.0
        }
    };
    sample_surface(mesh, samples)
        .into_par_iter()
        .map(distance)
        .reduce(|| 0.0, f64::max)
}
