//! A density grid as a field with a margin.

use super::{RemeshError, RemeshOptions, STAGE};
use crate::Vec3;
use crate::monitor::Monitor;
use crate::voxel::VoxelGrid;

/// The density above `iso`, in units of length, with two empty voxels around it, so that full voxels at the border end
/// at their outer faces. Values that are not finite count as empty and give a warning.
pub(super) fn padded(
    density: &VoxelGrid<f32>,
    iso: f64,
    options: &RemeshOptions,
    monitor: &Monitor,
) -> Result<VoxelGrid<f32>, RemeshError> {
    let (dims, spacing) = (density.dims, density.spacing);
    let wanted = dims.iter().map(|&n| n as f64 + 4.0).product::<f64>();
    let fits = dims.iter().try_fold(1usize, |n, &d| n.checked_mul(d)) == Some(density.values.len());
    if !fits || dims.iter().any(|&n| n < 2) || !(spacing.is_finite() && spacing > 0.0) {
        return Err(RemeshError::BadGrid {
            dims,
            values: density.values.len(),
            spacing,
        });
    }
    if wanted > options.max_voxels as f64 {
        let finest = spacing * (wanted / options.max_voxels.max(1) as f64).cbrt();
        return Err(RemeshError::TooManyVoxels {
            voxel: spacing,
            wanted,
            limit: options.max_voxels,
            finest,
        });
    }
    let finite = density.values.iter().filter(|v| v.is_finite());
    let highest = finite
        .clone()
        .fold(f64::NEG_INFINITY, |m, &v| m.max(f64::from(v)));
    if iso.is_nan() || highest <= iso {
        return Err(RemeshError::NoMaterial { highest, iso });
    }
    let broken = density.values.len() - finite.count();
    if broken > 0 {
        monitor.warn(
            STAGE,
            format!("{broken} density values are not finite and count as empty"),
        );
    }
    // A full voxel at the border ends at its outer face: half-way to an outside as far below the threshold as full is above.
    let outside = (-(1.0 - iso).abs().max(1e-3) * spacing) as f32;
    let origin = density.origin - Vec3::repeat(2.0 * spacing);
    let mut out = VoxelGrid::filled(origin, spacing, dims.map(|n| n + 4), outside);
    for (v, &value) in density.values.iter().enumerate() {
        let [i, j, k] = density.ijk(v);
        let at = out.index(i + 2, j + 2, k + 2);
        if value.is_finite() {
            out.values[at] = ((f64::from(value).clamp(-1.0, 2.0) - iso) * spacing) as f32;
        }
    }
    Ok(out)
}
