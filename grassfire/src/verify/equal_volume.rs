//! The same part with another volume: its free surface moved evenly.

use rayon::prelude::*;

use super::fractions::centres_inside;
use super::{STAGE, VerifyError};
use crate::Vec3;
use crate::mesh::{Bvh, TriMesh};
use crate::monitor::Monitor;
use crate::remesh::{RemeshOptions, iso_surface};
use crate::voxel::VoxelGrid;

/// A part of a wanted volume.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Moved {
    /// The part as it was, from the same distances: what these change on their own cancels in comparisons.
    pub before: TriMesh,
    /// The part with its free surface moved.
    pub after: TriMesh,
    /// By how much, mm outward.
    pub offset: f64,
}

/// Tells which places belong to what must not change.
pub(super) type Kept<'a> = &'a dyn Fn(&[Vec3]) -> Result<Vec<bool>, VerifyError>;

/// Steps of the search for the offset.
const STEPS: usize = 8;
/// Volumes closer than this share are equal.
const EQUAL: f64 = 1e-4;
/// Voxels outside the part that a move may reach at most.
const REACH: f64 = 4.0;
/// How far below the surface its owner is looked for, voxels.
const BELOW: f64 = 0.05;

/// Moves the surface of a part evenly until its volume is `volume`, except where `kept` holds for a place just below it.
///
/// 1. Signed distances are sampled on voxels of edge `h`.
/// 2. The offset is found by the secant rule on the volume of the moved surface.
///
/// None when the offset leaves the sampled distances: the volumes are too far apart for such a move.
pub(super) fn moved(
    mesh: &TriMesh,
    volume: f64,
    h: f64,
    kept: Kept,
    monitor: &Monitor,
) -> Result<Option<Moved>, VerifyError> {
    let (field, below) = distances(mesh, h);
    let kept = kept(&below)?;
    drop(below);
    let at = |offset: f64| -> Result<TriMesh, VerifyError> {
        // In voxels: so the iso-surface takes densities.
        let by = (offset / h) as f32;
        let value = |(&d, &kept): (&f32, &bool)| if kept { d } else { d + by };
        let values = field.values.iter().zip(&kept).map(value).collect();
        let moved = VoxelGrid {
            origin: field.origin,
            spacing: field.spacing,
            dims: field.dims,
            values,
        };
        Ok(iso_surface(
            &moved,
            0.0,
            &RemeshOptions::default(),
            monitor,
        )?)
    };
    let before = at(0.0)?;
    let (start, area) = (before.volume(), before.area());
    // The part from distances has another volume than the part: both change by the same factor.
    let wanted = volume * start / mesh.volume();
    let limit = (REACH - 1.0) * h;
    let (mut known, mut offset) = ((0.0, start), (wanted - start) / area);
    for _ in 0..STEPS {
        monitor.step(STAGE, "the same part with another volume", 0.8)?;
        if offset.is_nan() || offset.abs() >= limit {
            return Ok(None);
        }
        let after = at(offset)?;
        let found = after.volume();
        if (found / wanted - 1.0).abs() < EQUAL {
            return Ok(Some(Moved {
                before,
                after,
                offset,
            }));
        }
        let slope = (found - known.1) / (offset - known.0);
        known = (offset, found);
        if slope.is_nan() || slope <= 0.0 {
            return Ok(None);
        }
        offset += (wanted - found) / slope;
    }
    Ok(None)
}

/// Signed distances to a surface on voxels around it, in voxels, positive inside, exact up to [`REACH`]; and for each voxel
/// the place just below the nearest place of the surface.
fn distances(mesh: &TriMesh, h: f64) -> (VoxelGrid<f32>, Vec<Vec3>) {
    let (low, high) = mesh.bounds().unwrap_or_default();
    let origin = low - Vec3::repeat((REACH + 1.0) * h);
    let dims = [0, 1, 2].map(|d| ((high[d] - origin[d]) / h + REACH + 1.0).ceil() as usize);
    let mut grid = VoxelGrid::filled(origin + Vec3::repeat(h / 2.0), h, dims, 0.0_f32);
    let inside = centres_inside(mesh, origin, h, dims);
    let tree = Bvh::new(mesh);
    let reach = REACH * h;
    let both: Vec<(f32, Vec3)> = (0..inside.len())
        .into_par_iter()
        .map(|v| {
            let [i, j, k] = grid.ijk(v);
            let p = grid.centre(i, j, k);
            let sign = if inside[v] { 1.0 } else { -1.0 };
            let Some(nearest) = tree.nearest(&p, reach) else {
                return ((sign * REACH) as f32, p);
            };
            let inward = sign * (p - nearest.point);
            let step = inward.try_normalize(0.0).unwrap_or_else(Vec3::zeros);
            let below = nearest.point + BELOW * h * step;
            ((sign * nearest.distance / h) as f32, below)
        })
        .collect();
    let (values, below) = both.into_iter().unzip();
    grid.values = values;
    (grid, below)
}
