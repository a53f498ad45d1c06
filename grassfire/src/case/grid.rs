//! Where the voxels lie.

use super::{Case, CaseError, value};
use crate::Vec3;
use crate::fe::{FeError, memory_estimate};
use crate::topopt::{Parting, TopoptError};

/// Bytes of a voxel of the grid without material: label, modulus, share.
const PER_VOXEL: f64 = 24.0;

/// A grid of voxels of edge `h` around `low` to `high` with a corner at the anchor: lower corner and voxels along x, y, z.
///
/// Planes of symmetry and of parting that the anchor is not given for become faces of voxels, and the grid reaches equally
/// far on both sides of a plane of symmetry. At most the volume `filled`, mm3, holds material.
pub(crate) fn place(
    case: &Case,
    h: f64,
    low: Vec3,
    high: Vec3,
    filled: f64,
) -> Result<(Vec3, [usize; 3]), CaseError> {
    let mut anchor = case.grid.origin.map_or(low, Vec3::from);
    if let (None, Some(draw)) = (case.grid.origin, &case.optimize.draw)
        && let (Parting::Plane, Some(axis)) =
            (draw.parting, draw.dir.iter().position(|&d| d != 0.0))
    {
        anchor[axis] = draw.at;
    }
    let mut mirrored = [false; 3];
    for plane in &case.optimize.symmetry {
        let axis = plane.axis();
        mirrored[axis] = true;
        if case.grid.origin.is_none() {
            anchor[axis] = plane.at;
        }
    }
    let mut origin = Vec3::zeros();
    let mut counts = [0.0; 3];
    for d in 0..3 {
        let up = |length: f64| (length / h - 1e-9).ceil();
        let (mut below, mut above) = (up(anchor[d] - low[d]), up(high[d] - anchor[d]));
        if mirrored[d] {
            below = below.max(above);
            above = below;
        }
        origin[d] = anchor[d] - below * h;
        counts[d] = below + above;
    }
    if counts.iter().any(|&n| n < 1.0) {
        return Err(value("grid.h", h, "a voxel smaller than the design space"));
    }
    let limit = memory_limit(case.solver.max_memory);
    let dims = counts.map(|n| n.min(1e9) as usize);
    let voxels = counts.iter().product::<f64>();
    let filled = voxels.min(filled / h.powi(3));
    let weighs = case.case.iter().any(|table| table.gravity.is_some());
    let needed = memory_estimate(filled, case.case.len(), weighs).max(PER_VOXEL * voxels) / 1e6;
    if needed > limit || counts.iter().any(|&n| n >= 1e9) {
        return Err(CaseError::Problem(TopoptError::Fe(FeError::Memory {
            voxels,
            needed,
            limit,
        })));
    }
    Ok((origin, dims))
}

/// The memory that there is, MB, at most `wanted`.
fn memory_limit(wanted: f64) -> f64 {
    let info = std::fs::read_to_string("/proc/meminfo").unwrap_or_default();
    let available = info
        .lines()
        .find_map(|line| line.strip_prefix("MemAvailable:"))
        .and_then(|text| text.split_whitespace().next()?.parse::<f64>().ok())
        .map_or(f64::INFINITY, |kb| 0.9 * kb / 1e3);
    wanted.min(available)
}
