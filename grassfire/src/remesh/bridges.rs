//! Thin short bridges: found, named, cut.

use std::collections::HashSet;

use super::digital::VoxelSet;
use super::noise::CleanUp;
use super::patch::{Patch, Side};
use super::residue::{flip_all, flip_gaining, residue, sort_by_width};
use super::{ChangeKind, RemeshError};
use crate::monitor::Monitor;
use crate::voxel::VoxelGrid;

/// Cuts bridges thinner than half the limit, as long as no more than `most` tunnels go.
///
/// 1. The empty side grown by half the limit is peeled back as in [`super::tunnels::close_tunnels`], which leaves a cut
///    across the thinnest place of every member that broke.
/// 2. A cut is made only when it lowers the first Betti number, joins two places at least twice as thick that lie no more
///    than the limit apart, and leaves the solid in one piece.
pub(super) fn cut_bridges(
    work: &mut CleanUp,
    mut most: i64,
    monitor: &Monitor,
) -> Result<(), RemeshError> {
    if most <= 0 {
        return Ok(());
    }
    let width = work.width;
    let mut found = residue(work, Side::Empty, width / 2.0, monitor)?;
    sort_by_width(work.grid, &mut found);
    let mut cuts = Vec::new();
    for voxels in found {
        let Some(length) = bridge_length(work.grid, &work.set, &voxels, width) else {
            continue;
        };
        if length > width {
            continue;
        }
        let pieces = work.set.components(true, 0).len();
        let gain = flip_gaining(&mut work.set, Side::Empty, &voxels, most);
        if gain == 0 {
            continue;
        }
        if work.set.components(true, 0).len() != pieces {
            flip_all(&mut work.set, &voxels, true);
            continue;
        }
        most -= gain;
        cuts.push(Patch {
            reach: (length / 2.0).max(work.grid.spacing),
            ..Patch::new(work.grid, voxels)
        });
    }
    work.commit(ChangeKind::BridgeCut, Side::Empty, &mut cuts);
    Ok(())
}

/// Length (mm) of the thin part that the cut `voxels` goes through, between the two places at least twice as thick as
/// the cut is; `None` when there are no such places nearby or the cut is thicker than `width / 2` or longer across than
/// `width`: then it is a waist, a web or a member, not noise.
fn bridge_length(grid: &VoxelGrid<f32>, set: &VoxelSet, voxels: &[u32], width: f64) -> Option<f64> {
    let cut = Patch::new(grid, voxels.to_vec());
    let at = |v: u32| {
        let [i, j, k] = set.ijk(v);
        grid.centre(i, j, k)
    };
    if cut.width > width / 2.0
        || voxels
            .iter()
            .any(|&v| (at(v) - cut.place).norm() > width / 2.0)
    {
        return None;
    }
    let six = set.neighbours_6();
    let mut seen: HashSet<u32> = voxels.iter().copied().collect();
    let mut lengths = Vec::new();
    for &seed in voxels {
        for s in &six {
            let start = (seed as isize + s) as u32;
            if !set.solid[start as usize] || !seen.insert(start) {
                continue;
            }
            // One side of the cut, within reach.
            let mut side = vec![start];
            let mut next = 0;
            let mut nearest = f64::INFINITY;
            while let Some(&v) = side.get(next) {
                next += 1;
                let depth = f64::from(grid.values[v as usize]);
                if depth >= cut.width {
                    nearest = nearest.min(((at(v) - cut.place).norm() - depth).max(0.0));
                }
                for s in &six {
                    let n = (v as isize + s) as u32;
                    if set.solid[n as usize]
                        && (at(n) - cut.place).norm() <= 2.0 * width
                        && seen.insert(n)
                    {
                        side.push(n);
                    }
                }
            }
            lengths.push(nearest);
        }
    }
    lengths.sort_by(f64::total_cmp);
    (lengths.len() >= 2 && lengths[1].is_finite()).then(|| lengths[0] + lengths[1])
}
