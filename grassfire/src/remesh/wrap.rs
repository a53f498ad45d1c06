//! A coarse quad mesh wrapped around a solid: the body's last resort where a part is too bulky for its skeleton.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::compose::separate_opposite_empties;
use super::digital::VoxelSet;
use super::extract;
use crate::Vec3;
use crate::monitor::{Cancelled, Monitor};
use crate::spline::ControlMesh;
use crate::topology::Betti;
use crate::voxel::VoxelGrid;

/// Options of [`wrap`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct WrapOptions {
    /// Quad sizes to try in turn, voxels of the field.
    pub sizes: Vec<f64>,
    /// Most quads; finer meshes are not tried.
    pub max_quads: usize,
}

impl Default for WrapOptions {
    fn default() -> Self {
        Self {
            // Sizes in between come last: they serve where gaps close on all of the others.
            sizes: vec![6.0, 5.0, 4.0, 3.2, 2.5, 2.0, 5.5, 4.5, 3.6, 2.8, 2.2],
            max_quads: 8000,
        }
    }
}

/// Wraps a closed quad mesh around `{field > 0}`, as coarse as the topology allows.
///
/// 1. The field is sampled on a coarser lattice, one size of `options.sizes` after the other.
/// 2. The first lattice whose solid has the Betti numbers `wanted` is contoured: one point a cell, one quad a crossed
///    lattice edge (dual contouring, Ju et al. 2002, doi:10.1145/566654.566586).
/// 3. Lattices on which two quads would share two edges are passed over, so the mesh is all-quad and manifold.
///
/// Returns `None` when no size serves.
///
/// # Errors
/// Only [`Cancelled`].
pub fn wrap(
    field: &VoxelGrid<f32>,
    wanted: Betti,
    options: &WrapOptions,
    monitor: &Monitor,
) -> Result<Option<ControlMesh>, Cancelled> {
    for &size in options.sizes.iter().filter(|size| **size >= 1.0) {
        monitor.step("remesh", "wrapping", 0.0)?;
        let mut grid = coarser(field, size);
        let mut set = VoxelSet::positive(grid.dims, &grid.values);
        separate_opposite_empties(&mut grid, &mut set);
        if set.betti() != wanted {
            continue;
        }
        if let Some(mesh) =
            extract::quads(&grid, &set).filter(|m| m.quads.len() <= options.max_quads)
        {
            return Ok(Some(mesh));
        }
    }
    Ok(None)
}

/// The field on a lattice of `size` voxels, with two empty layers around.
fn coarser(field: &VoxelGrid<f32>, size: f64) -> VoxelGrid<f32> {
    let spacing = size * field.spacing;
    let dims = field.dims.map(|n| (n as f64 / size).ceil() as usize + 4);
    // Centred, so that symmetric parts stay symmetric.
    let middle = |n: usize, h: f64| (n as f64 - 1.0) / 2.0 * h;
    let origin = Vec3::from_fn(|a, _| {
        field.origin[a] + middle(field.dims[a], field.spacing) - middle(dims[a], spacing)
    });
    let mut grid = VoxelGrid::filled(origin, spacing, dims, -spacing as f32);
    for v in 0..grid.values.len() {
        let [i, j, k] = grid.ijk(v);
        let border = (0..3).any(|a| [i, j, k][a] == 0 || [i, j, k][a] + 1 == dims[a]);
        if !border {
            grid.values[v] = field.sample(&grid.centre(i, j, k)) as f32;
        }
    }
    grid
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{Solid, TriMesh};

    /// Signed distance of a ring.
    fn torus() -> VoxelGrid<f32> {
        let mut grid = VoxelGrid::filled(Vec3::repeat(-20.0), 1.0, [41; 3], 0.0_f32);
        for v in 0..grid.values.len() {
            let [i, j, k] = grid.ijk(v);
            let p = grid.centre(i, j, k);
            grid.values[v] = (5.0 - (p.xy().norm() - 12.0).hypot(p.z)) as f32;
        }
        grid
    }

    #[test]
    fn a_ring_is_wrapped_by_a_closed_quad_mesh_of_genus_one() {
        let wanted = Betti::from_chi(1, 0, 0);
        let mesh = wrap(
            &torus(),
            wanted,
            &WrapOptions::default(),
            &Monitor::default(),
        );
        let mesh = mesh.ok().flatten().expect("a size serves");
        let triangles = mesh
            .quads
            .iter()
            .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]])
            .collect();
        let solid = Solid::try_from(TriMesh {
            points: mesh.points,
            triangles,
            tags: Vec::new(),
        });
        assert_eq!(solid.map(|s| s.euler()), Ok(0));
    }

    #[test]
    fn a_topology_that_the_field_does_not_have_gives_nothing() {
        let wanted = Betti::from_chi(1, 0, -4);
        assert_eq!(
            wrap(
                &torus(),
                wanted,
                &WrapOptions::default(),
                &Monitor::default()
            ),
            Ok(None)
        );
    }
}
