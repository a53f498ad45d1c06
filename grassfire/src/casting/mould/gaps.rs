//! Gaps that sand cannot make go solid.

use rayon::prelude::*;

use crate::edit::offset;
use crate::mesh::Bvh;
use crate::monitor::Monitor;
use crate::remesh::{RemeshError, RemeshOptions, iso_surface};
use crate::voxel::VoxelGrid;

/// Makes material of all gaps into which no ball of the diameter `width` goes (mm): the closing of mathematical morphology.
///
/// 1. The surface moves outward by half of the width: narrow gaps close.
/// 2. It moves back: what stays covered is material. Inner corners get fillets of half of the width.
///
/// Nothing is taken away, and the surface stays as it is where nothing closes. `field` is above 0 in the material, on its own grid,
/// which the result is on, too.
///
/// # Errors
/// [`RemeshError::TooManyVoxels`] for a width far beyond the part, and those of [`iso_surface`]: an empty field, cancelled.
pub(super) fn close_gaps(
    field: &mut VoxelGrid<f32>,
    width: f64,
    options: &RemeshOptions,
    monitor: &Monitor,
) -> Result<(), RemeshError> {
    let radius = width / 2.0;
    fits(field, radius, options.max_voxels)?;
    let surface = iso_surface(&density(field), 0.5, options, monitor)?;
    let wide = offset(field, &surface, radius);
    let outer = Bvh::new(&iso_surface(&density(&wide), 0.5, options, monitor)?);
    let (grid, reach) = (field.clone(), radius + 3.0 * field.spacing);
    field
        .values
        .par_iter_mut()
        .enumerate()
        .for_each(|(v, value)| {
            let [i, j, k] = grid.ijk(v);
            let p = grid.centre(i, j, k);
            if *value > 0.0 || wide.sample(&p) <= 0.0 {
                return;
            }
            let depth = outer.nearest(&p, reach).map_or(reach, |n| n.distance);
            *value = value.max((depth - radius) as f32);
        });
    Ok(())
}

/// Refuses a grid that holds more than `limit` voxels when it is padded by `radius`.
fn fits(field: &VoxelGrid<f32>, radius: f64, limit: usize) -> Result<(), RemeshError> {
    let voxel = field.spacing;
    let pad = 2.0 * (radius / voxel).ceil() + 2.0;
    let wanted = field.dims.iter().map(|&n| n as f64 + pad).product::<f64>();
    if wanted <= limit as f64 {
        return Ok(());
    }
    Err(RemeshError::TooManyVoxels {
        voxel,
        wanted,
        limit,
        finest: voxel * (wanted / limit.max(1) as f64).cbrt(),
    })
}

/// As a density: 1/2 at the surface, one voxel up and down.
pub(super) fn density(field: &VoxelGrid<f32>) -> VoxelGrid<f32> {
    let h = field.spacing as f32;
    VoxelGrid {
        values: field.values.iter().map(|f| 0.5 + f / h).collect(),
        ..field.clone()
    }
}
