//! Rooms between members that only a core makes, one by one: what can be done about each.

use super::cores::{flood, nearest, undercut};
use super::repair::laid;
use super::{MouldError, RepairOptions};
use crate::Vec3;
use crate::fe::components;
use crate::mesh::TriMesh;
use crate::monitor::Monitor;
use crate::voxel::VoxelGrid;

/// A connected undercut of a part.
#[derive(Debug, Clone, PartialEq)]
pub struct Room {
    /// A place in it near its middle, mm.
    pub place: Vec3,
    /// mm3.
    pub volume: f64,
    /// Material on its lesser side, below or above it on its lines, mm3.
    pub lesser: f64,
}

/// The rooms of a part along the unit vector `draw` that hold at least `least` mm3, largest first.
///
/// On the voxels of [`super::repair()`]; what the cores of the options make is no room.
///
/// # Errors
/// Those of [`super::repair()`].
pub fn rooms(
    mesh: &TriMesh,
    draw: &Vec3,
    options: &RepairOptions,
    least: f64,
    monitor: &Monitor,
) -> Result<Vec<Room>, MouldError> {
    let part = laid(mesh, draw, options, monitor)?;
    let (field, empty) = (&part.field, undercut(&part.field));
    let (labels, pieces) = components(field.dims, &empty);
    let cell = field.spacing.powi(3);
    let centre = |v: usize| {
        let [i, j, k] = field.ijk(v);
        field.centre(i, j, k)
    };
    let mut middles = vec![Vec3::zeros(); pieces.len()];
    let inside = || (0..labels.len()).filter(|&v| labels[v] != u32::MAX);
    for v in inside() {
        middles[labels[v] as usize] += centre(v) / pieces[labels[v] as usize].size as f64;
    }
    let mut best = vec![(f64::INFINITY, 0); pieces.len()];
    for v in inside() {
        let n = labels[v] as usize;
        let away = (centre(v) - middles[n]).norm();
        if away < best[n].0 {
            best[n] = (away, v);
        }
    }
    let mut out = Vec::new();
    for (piece, (_, v)) in pieces.iter().zip(best) {
        let volume = piece.size as f64 * cell;
        if volume >= least {
            let mut room = vec![false; empty.len()];
            flood(field, &empty, v, &mut room);
            out.push(Room {
                place: part.back(&centre(v)),
                volume,
                lesser: solid(field, &lesser_side(field, &room)) as f64 * cell,
            });
        }
    }
    out.sort_by(|a, b| b.volume.total_cmp(&a.volume));
    Ok(out)
}

/// Empties the lesser side of the undercut at each place: of what lies below it and above it on its lines, the smaller volume.
///
/// # Errors
/// [`MouldError::Place`] for a place away from all undercuts.
pub(super) fn remove_lesser(field: &mut VoxelGrid<f32>, places: &[Vec3]) -> Result<(), MouldError> {
    if places.is_empty() {
        return Ok(());
    }
    let empty = undercut(field);
    let mut going = Vec::new();
    for place in places {
        let mut room = vec![false; empty.len()];
        let start = nearest(field, &empty, place, "removals")?;
        flood(field, &empty, start, &mut room);
        going.extend(lesser_side(field, &room));
    }
    // Empty voxels beside the surface, too: filling lifts what is above them to their value, which moves walls nearby.
    let out = -0.5 * field.spacing as f32;
    for v in going {
        field.values[v] = field.values[v].min(out);
    }
    Ok(())
}

/// Voxels with material among these.
fn solid(field: &VoxelGrid<f32>, voxels: &[usize]) -> usize {
    voxels.iter().filter(|&&v| field.values[v] > 0.0).count()
}

/// What lies below or above a room on its lines, whichever has less material.
fn lesser_side(field: &VoxelGrid<f32>, room: &[bool]) -> Vec<usize> {
    let [nx, ny, nz] = field.dims;
    let mut sides = [Vec::new(), Vec::new()];
    for j in 0..ny {
        for i in 0..nx {
            let at = |k: usize| field.index(i, j, k);
            let first = (0..nz).find(|&k| room[at(k)]);
            let last = (0..nz).rfind(|&k| room[at(k)]);
            let (Some(first), Some(last)) = (first, last) else {
                continue;
            };
            sides[0].extend((0..first).map(at));
            sides[1].extend((last + 1..nz).map(at));
        }
    }
    let [below, above] = sides;
    if solid(field, &above) < solid(field, &below) {
        above
    } else {
        below
    }
}
