//! Topological noise: small islands, cavities, tunnels and bridges, found, named and removed.

use super::bridges::cut_bridges;
use super::digital::VoxelSet;
use super::input::Wanted;
use super::options::Capsule;
use super::patch::{Patch, Side, insert};
use super::tunnels::close_tunnels;
use super::{ChangeKind, RemeshError, STAGE, TopologyChange, signed_distance};
use crate::Vec3;
use crate::monitor::Monitor;
use crate::topology::Betti;
use crate::voxel::VoxelGrid;

/// Clean-up rounds at most; closing one tunnel can make a cavity small enough to be filled in the next round.
const ROUNDS: usize = 4;

/// What the clean-up did.
pub(super) struct Outcome {
    pub(super) before: Betti,
    pub(super) changes: Vec<TopologyChange>,
    /// Voxels near a change, whose distance is no longer exact.
    pub(super) touched: Vec<bool>,
}

/// The solid while it is cleaned up.
pub(super) struct CleanUp<'a> {
    pub(super) grid: &'a mut VoxelGrid<f32>,
    pub(super) set: VoxelSet,
    /// What is narrower is noise, mm.
    pub(super) width: f64,
    /// Voxels that no change may touch; empty when there are none.
    pub(super) kept: Vec<bool>,
    pub(super) changes: Vec<TopologyChange>,
    pub(super) touched: Vec<bool>,
}

impl CleanUp<'_> {
    pub(super) fn is_kept(&self, v: u32) -> bool {
        self.kept.get(v as usize).copied().unwrap_or(false)
    }

    /// Names the changes that `patches` make, whose voxels the set already has, and puts them into the field.
    pub(super) fn commit(&mut self, kind: ChangeKind, side: Side, patches: &mut [Patch]) {
        self.changes.extend(patches.iter().map(|p| TopologyChange {
            kind,
            place: p.place,
            size: p.width,
        }));
        insert(self, side, patches);
    }
}

/// Removes islands, cavities, tunnels and short bridges narrower than `width` (mm) from the solid `{field > 0}`.
///
/// 1. Islands (6-components) and cavities (26-components of the empty side) whose box is no longer than `width` go.
/// 2. Tunnels: see [`close_tunnels`]. Plugs are plates as thick as the wall around them.
/// 3. Bridges: see [`cut_bridges`]. Members, waists and webs are never cut.
/// 4. Repeat until nothing changes.
///
/// With `wanted`, only surplus tunnels and cavities are removed, narrowest first.
/// Voxels inside the capsules of `keep_open` are never filled or cut; islands in them go as elsewhere.
pub(super) fn remove_noise(
    grid: &mut VoxelGrid<f32>,
    width: f64,
    wanted: Option<Wanted>,
    keep_open: &[Capsule],
    monitor: &Monitor,
) -> Result<Outcome, RemeshError> {
    let set = VoxelSet::positive(grid.dims, &grid.values);
    let before = set.betti();
    let mut work = CleanUp {
        set,
        width,
        kept: kept_voxels(grid, keep_open),
        changes: Vec::new(),
        touched: vec![false; grid.values.len()],
        grid,
    };
    let rounds = if width > 0.0 { ROUNDS } else { 0 };
    for round in 0..rounds {
        monitor.step(STAGE, "topological noise", 0.6 + 0.05 * round as f64)?;
        let count = work.changes.len();
        drop_small(&mut work, wanted);
        if work.changes.len() > count {
            // Else the ghosts of the islands would be taken for gaps.
            refresh(work.grid, &work.set, &work.touched, monitor)?;
        }
        let surplus = |set: &VoxelSet| match wanted {
            Some(wanted) => set.betti().b1 - wanted.tunnels,
            None => i64::MAX,
        };
        let most = surplus(&work.set);
        close_tunnels(&mut work, most, monitor)?;
        let most = surplus(&work.set);
        cut_bridges(&mut work, most, monitor)?;
        if work.changes.len() == count {
            break;
        }
    }
    Ok(Outcome {
        before,
        changes: work.changes,
        touched: work.touched,
    })
}

/// Distances around changes: values next to the surface and the untouched band are kept, the rest is swept anew.
pub(super) fn refresh(
    field: &mut VoxelGrid<f32>,
    set: &VoxelSet,
    touched: &[bool],
    monitor: &Monitor,
) -> Result<(), RemeshError> {
    let band = ((signed_distance::BAND - 0.5) * field.spacing) as f32;
    let steps = set.neighbours_26();
    let at_surface = |v: usize| {
        !set.on_border(v as u32)
            && steps
                .iter()
                .any(|s| set.solid[(v as isize + s) as usize] != set.solid[v])
    };
    let known: Vec<bool> = (0..touched.len())
        .map(|v| {
            if touched[v] {
                at_surface(v)
            } else {
                field.values[v].abs() <= band
            }
        })
        .collect();
    signed_distance::sweep(field, &known, monitor)
}

/// One flag a voxel: inside a capsule; empty when there are none.
fn kept_voxels(grid: &VoxelGrid<f32>, capsules: &[Capsule]) -> Vec<bool> {
    if capsules.is_empty() {
        return Vec::new();
    }
    let mut kept = vec![false; grid.values.len()];
    for capsule in capsules {
        let reach = Vec3::repeat(capsule.radius);
        let lo = grid.to_grid(&(capsule.a.inf(&capsule.b) - reach));
        let hi = grid.to_grid(&(capsule.a.sup(&capsule.b) + reach));
        let range = |a: usize| {
            let last = grid.dims[a] as f64;
            lo[a].floor().clamp(0.0, last) as usize..(hi[a].ceil() + 1.0).clamp(0.0, last) as usize
        };
        for k in range(2) {
            for j in range(1) {
                for i in range(0) {
                    if capsule.contains(&grid.centre(i, j, k)) {
                        kept[grid.index(i, j, k)] = true;
                    }
                }
            }
        }
    }
    kept
}

fn drop_small(work: &mut CleanUp, wanted: Option<Wanted>) {
    let h = work.grid.spacing;
    let limit = (work.width / h).max(1.0);
    for (solid, kind) in [
        (true, ChangeKind::IslandDropped),
        (false, ChangeKind::CavityFilled),
    ] {
        let mut all = work
            .set
            .components(solid, (limit.powi(3)).min(1e7) as usize + 1);
        let mut most = usize::MAX;
        if let Some(wanted) = wanted.filter(|_| !solid) {
            most = (all.len() - 1).saturating_sub(wanted.cavities.max(0) as usize);
            all.sort_by_key(|c| c.size);
        }
        for component in all {
            let small = component.extent() as f64 <= limit && !component.voxels.is_empty();
            // The first empty component is the outside; it holds the border voxels.
            let outside = component.voxels.iter().any(|&v| work.set.on_border(v));
            // Islands are in the way there.
            let held = !solid && component.voxels.iter().any(|&v| work.is_kept(v));
            if !small || outside || held || most == 0 {
                continue;
            }
            most -= 1;
            let mut sum = Vec3::zeros();
            for &v in &component.voxels {
                let [i, j, k] = work.set.ijk(v);
                sum += work.grid.centre(i, j, k);
                work.set.solid[v as usize] = !solid;
                work.grid.values[v as usize] = if solid {
                    -0.5 * h as f32
                } else {
                    0.5 * h as f32
                };
                touch(work.grid, v, 4, &mut work.touched);
            }
            let place = sum / component.voxels.len() as f64;
            work.changes.push(TopologyChange {
                kind,
                place,
                size: component.extent() as f64 * h,
            });
        }
    }
}

/// Marks the voxels around `v`.
fn touch(grid: &VoxelGrid<f32>, v: u32, reach: usize, touched: &mut [bool]) {
    let at = grid.ijk(v as usize);
    let range = |a: usize| at[a].saturating_sub(reach)..(at[a] + reach + 1).min(grid.dims[a]);
    for k in range(2) {
        for j in range(1) {
            let row = grid.index(0, j, k);
            touched[row + range(0).start..row + range(0).end].fill(true);
        }
    }
}
