//! What all density readers share: cubic voxels and sensible values.

use super::IoError;
use super::source::Source;
use crate::Vec3;
use crate::mesh::{Repair, RepairKind};
use crate::voxel::VoxelGrid;

/// Spacings that differ by less than this share are equal.
const EQUAL: f64 = 1e-4;
/// Values this far outside 0..=1 are rounding, not a fault.
const ROUNDING: f32 = 1e-4;

/// A grid of cubic voxels; values on longer voxels are interpolated to the smallest spacing. `origin` is the centre of the first voxel.
pub(super) fn cubic(
    src: &Source,
    origin: Vec3,
    spacing: [f64; 3],
    dims: [usize; 3],
    values: Vec<f32>,
    notes: &mut Vec<Repair>,
) -> Result<VoxelGrid<f32>, IoError> {
    if !(spacing.iter().all(|h| h.is_finite() && *h > 0.0) && origin.iter().all(|x| x.is_finite()))
    {
        return Err(src.format(format!(
            "spacing {spacing:?} or origin {origin:?} is not usable"
        )));
    }
    if values.len() != src.check_voxels(dims)? {
        return Err(src.format(format!("{} values for {dims:?} voxels", values.len())));
    }
    let smallest = spacing.iter().copied().fold(f64::INFINITY, f64::min);
    let largest = spacing.iter().copied().fold(0.0, f64::max);
    let grid = VoxelGrid {
        origin,
        spacing: smallest,
        dims,
        values,
    };
    if largest <= smallest * (1.0 + EQUAL) {
        return Ok(grid);
    }
    let text = format!(
        "voxels of {} x {} x {} interpolated to cubes of {smallest}",
        spacing[0], spacing[1], spacing[2]
    );
    notes.push(Repair::new(RepairKind::Resampled, grid.values.len(), text));
    resample(src, grid, spacing)
}

/// Linear interpolation between voxel centres along each axis.
fn resample(
    src: &Source,
    grid: VoxelGrid<f32>,
    spacing: [f64; 3],
) -> Result<VoxelGrid<f32>, IoError> {
    let h = grid.spacing;
    let ratio = spacing.map(|s| s / h);
    // The new voxels fill the same box; half a voxel may stick out where the box is no multiple.
    let count = |a: usize| (grid.dims[a] as f64 * ratio[a] - 0.01).ceil().max(1.0);
    let dims = [count(0) as usize, count(1) as usize, count(2) as usize];
    src.check_voxels(dims)?;
    let origin = Vec3::from_fn(|a, _| grid.origin[a] - spacing[a] / 2.0 + h / 2.0);
    let mut out = VoxelGrid::filled(grid.origin, h, dims, 0.0f32);
    let source = VoxelGrid {
        origin: Vec3::zeros(),
        spacing: 1.0,
        ..grid
    };
    for k in 0..dims[2] {
        src.monitor.check()?;
        for j in 0..dims[1] {
            for i in 0..dims[0] {
                let at = [i, j, k];
                let p = Vec3::from_fn(|a, _| (at[a] as f64 + 0.5) / ratio[a] - 0.5);
                let index = out.index(i, j, k);
                out.values[index] = source.sample(&p) as f32;
            }
        }
    }
    out.origin = origin;
    Ok(out)
}

/// Scales lengths and values, mends a few bad values, refuses many; refuses a grid without material.
pub(super) fn check(
    src: &Source,
    mut grid: VoxelGrid<f32>,
    notes: &mut Vec<Repair>,
) -> Result<VoxelGrid<f32>, IoError> {
    let options = src.options;
    for (name, value) in [
        ("density_scale", options.density_scale),
        ("threshold", options.threshold),
    ] {
        if !(value.is_finite() && value > 0.0) {
            return Err(IoError::Option {
                name,
                value: value.to_string(),
                want: "a positive number",
            });
        }
    }
    grid.origin *= options.scale;
    grid.spacing *= options.scale;
    let (mut nan, mut below, mut above) = (0, 0, 0);
    let (mut smallest, mut largest) = (f32::INFINITY, f32::NEG_INFINITY);
    for value in &mut grid.values {
        *value = (f64::from(*value) * options.density_scale) as f32;
        if value.is_nan() {
            nan += 1;
            *value = 0.0;
            continue;
        }
        smallest = smallest.min(*value);
        largest = largest.max(*value);
        below += usize::from(*value < -ROUNDING);
        above += usize::from(*value > 1.0 + ROUNDING);
        *value = value.clamp(0.0, 1.0);
    }
    let (outside, total) = (nan + below + above, grid.values.len());
    let limit = (options.max_outside_share * total as f64) as usize;
    if outside > limit {
        return Err(IoError::OutsideRange {
            file: src.file(),
            count: outside,
            total,
            smallest,
            largest,
            limit,
        });
    }
    if outside > 0 {
        let text = format!(
            "{nan} values NaN taken as 0, {below} below 0 and {above} above 1 clamped (smallest {smallest}, largest {largest})"
        );
        notes.push(Repair::new(RepairKind::Clamped, outside, text));
    }
    let threshold = options.threshold as f32;
    if grid.values.iter().all(|v| *v < threshold) {
        let largest = if largest.is_finite() { largest } else { 0.0 };
        return Err(IoError::EmptyAtThreshold {
            file: src.file(),
            threshold: options.threshold,
            largest,
        });
    }
    note_loose_voxels(&grid, threshold, notes);
    Ok(grid)
}

/// Notes a checkerboard: many voxels of material without a neighbour of material.
fn note_loose_voxels(grid: &VoxelGrid<f32>, threshold: f32, notes: &mut Vec<Repair>) {
    let [nx, ny, nz] = grid.dims;
    let solid = |index: usize| grid.values[index] >= threshold;
    let (mut count, mut loose) = (0usize, 0usize);
    for k in 0..nz {
        for j in 0..ny {
            for i in 0..nx {
                let at = grid.index(i, j, k);
                if !solid(at) {
                    continue;
                }
                count += 1;
                let held = (i > 0 && solid(at - 1))
                    || (i + 1 < nx && solid(at + 1))
                    || (j > 0 && solid(at - nx))
                    || (j + 1 < ny && solid(at + nx))
                    || (k > 0 && solid(at - nx * ny))
                    || (k + 1 < nz && solid(at + nx * ny));
                loose += usize::from(!held);
            }
        }
    }
    if loose * 20 > count {
        let text = format!(
            "checkerboard: {loose} of {count} voxels of material touch no other by a face; a density filter is missing"
        );
        notes.push(Repair::new(RepairKind::Checkerboard, loose, text));
    }
}
