//! Undercuts that cores make, which a repair leaves open.

use super::{MouldError, STAGE};
use crate::Vec3;
use crate::monitor::Monitor;
use crate::remesh::Capsule;
use crate::voxel::VoxelGrid;

/// A place must be named within so many voxels of its undercut.
const NEAR: f64 = 3.0;

/// The empty voxels that cores fill: the undercuts at `places`, and what is undercut in `bores`.
///
/// 1. Undercut is what is empty and has material below and above it on its line along z.
/// 2. From the undercut voxel nearest to each place everything that is connected to it by faces is one core. With `may_close`
///    a place away from all undercuts has none, which is told.
///
/// # Errors
/// [`MouldError::Place`] for such a place otherwise.
pub(super) fn cored(
    field: &VoxelGrid<f32>,
    places: &[Vec3],
    bores: &[Capsule],
    may_close: bool,
    monitor: &Monitor,
) -> Result<Vec<bool>, MouldError> {
    let mut out = vec![false; field.values.len()];
    if places.is_empty() && bores.is_empty() {
        return Ok(out);
    }
    let undercut = undercut(field);
    for place in places {
        match nearest(field, &undercut, place, "cores") {
            Ok(start) => flood(field, &undercut, start, &mut out),
            Err(error) if may_close => {
                monitor.warn(STAGE, format!("{error}: nothing is left open there"))
            }
            Err(error) => return Err(error),
        }
    }
    for (v, core) in out.iter_mut().enumerate().filter(|(v, _)| undercut[*v]) {
        let [i, j, k] = field.ijk(v);
        let p = field.centre(i, j, k);
        *core |= bores.iter().any(|bore| holds(bore, &p));
    }
    Ok(out)
}

/// Empty voxels between material on their lines.
pub(super) fn undercut(field: &VoxelGrid<f32>) -> Vec<bool> {
    let [nx, ny, nz] = field.dims;
    let mut out = vec![false; field.values.len()];
    for j in 0..ny {
        for i in 0..nx {
            let solid = |k: &usize| field.values[field.index(i, j, *k)] > 0.0;
            let (Some(first), Some(last)) = ((0..nz).find(solid), (0..nz).rfind(solid)) else {
                continue;
            };
            for k in (first..last).filter(|k| !solid(k)) {
                out[field.index(i, j, k)] = true;
            }
        }
    }
    out
}

/// The undercut voxel nearest to a place of the option `list`.
pub(super) fn nearest(
    field: &VoxelGrid<f32>,
    undercut: &[bool],
    place: &Vec3,
    list: &'static str,
) -> Result<usize, MouldError> {
    let away = |v: &usize| {
        let [i, j, k] = field.ijk(*v);
        (field.centre(i, j, k) - place).norm()
    };
    let all = (0..undercut.len()).filter(|&v| undercut[v]);
    let found = all.min_by(|a, b| away(a).total_cmp(&away(b)));
    let distance = found.as_ref().map_or(f64::INFINITY, away);
    match found {
        Some(v) if distance <= NEAR * field.spacing => Ok(v),
        _ => Err(MouldError::Place { list, distance }),
    }
}

/// Marks what is connected to a voxel by faces.
pub(super) fn flood(field: &VoxelGrid<f32>, undercut: &[bool], start: usize, out: &mut [bool]) {
    let [nx, ny, _] = field.dims;
    let mut stack = vec![start];
    while let Some(v) = stack.pop() {
        if std::mem::replace(&mut out[v], true) {
            continue;
        }
        // Undercuts never lie on the border of a line, and material ends before the grid does.
        let around = [v - 1, v + 1, v - nx, v + nx, v - nx * ny, v + nx * ny];
        stack.extend(around.into_iter().filter(|&w| undercut[w] && !out[w]));
    }
}

/// Whether a point lies in the cylinder of a bore.
fn holds(bore: &Capsule, p: &Vec3) -> bool {
    let axis = bore.b - bore.a;
    let length = axis.norm().max(1e-300);
    let along = (p - bore.a).dot(&axis) / length;
    let radial = (p - bore.a - axis * (along / length)).norm();
    (0.0..=length).contains(&along) && radial <= bore.radius
}
