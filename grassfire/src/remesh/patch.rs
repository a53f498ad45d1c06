//! Puts a membrane of voxels into the field as a smooth plate, without any other change of topology.

use nalgebra::Matrix3;
use rayon::prelude::*;

use super::digital::{VoxelSet, is_simple};
use super::noise::CleanUp;
use super::smooth::weights;
use crate::Vec3;
use crate::voxel::VoxelGrid;

/// Passes of the guarded update at most.
const PASSES: usize = 64;
/// Value of a voxel that topology holds on its side, in voxels.
const HELD: f32 = 0.1;
/// Smoothing of the inserted plate, voxels.
const SIGMA: f64 = 0.7;
/// Half-side of the cubes about a membrane's voxels that hold the rim of the wall around it, voxels.
const RIM: usize = 2;
/// The inverse of the share of the rim that may be beside thinner wall than the plate.
const THINNEST: usize = 10;
/// Radius of the neighbourhood that a membrane is flattened over, voxels.
const FLAT: usize = 3;
/// Fewer voxels around a place than this have no plane worth the name.
const FEW: usize = 9;
/// Steps from the rim to the middle of a wall at most, and the least rise of the distance on the way (per distance).
const CLIMB: usize = 64;
const STEEP: f32 = 0.5;

/// Which side of the surface grows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Side {
    Solid,
    Empty,
}

/// A membrane: the voxels that make one change of topology.
#[derive(Debug, Clone)]
pub(super) struct Patch {
    pub(super) voxels: Vec<u32>,
    /// Centre, mm.
    pub(super) place: Vec3,
    /// Width of the gap or member that it closes or cuts, mm.
    pub(super) width: f64,
    /// Half thickness of the plate, mm; 0 = as thick as the wall around it.
    pub(super) reach: f64,
}

impl Patch {
    pub(super) fn new(grid: &VoxelGrid<f32>, voxels: Vec<u32>) -> Self {
        let mut sum = Vec3::zeros();
        let mut width = 0f32;
        for &v in &voxels {
            let [i, j, k] = grid.ijk(v as usize);
            sum += grid.centre(i, j, k);
            width = width.max(2.0 * grid.values[v as usize].abs());
        }
        Self {
            place: sum / voxels.len().max(1) as f64,
            voxels,
            width: f64::from(width),
            reach: 0.0,
        }
    }
}

/// Changes the field so that `side` holds the membranes of `patches`, whose voxels `set` has already been given.
///
/// 1. The plate of a patch is all that lies within its half thickness of the membrane. Next to it the field rises to
///    the distance from the plate's surface; the rise is Gauss-filtered, so the rest of the field stays as it is.
/// 2. Signs follow the new values one simple point at a time, nearest to the membrane first. A voxel that cannot follow
///    without another change of topology is held on its side by a small value.
pub(super) fn insert(work: &mut CleanUp, side: Side, patches: &mut [Patch]) {
    if patches.is_empty() {
        return;
    }
    let CleanUp {
        grid,
        set,
        width,
        kept,
        touched,
        ..
    } = work;
    let h = grid.spacing;
    let sign = if side == Side::Solid { 1f32 } else { -1.0 };
    let mut plate = vec![f32::NEG_INFINITY; grid.values.len()];
    let mut region = Vec::new();
    for patch in patches.iter_mut() {
        if patch.reach <= 0.0 {
            // A pinhole is filled flush even in a block, a wide gap in a block gets no more than a web.
            let thickest = *width / 2.0 - patch.width.powi(2) / (3.0 * *width);
            patch.reach = wall(grid, set, patch, sign).min(thickest);
        }
        patch.reach = patch.reach.clamp(h, (*width / 2.0).max(h));
        raise(grid, patch, &mut plate, &mut region);
    }
    region.retain(|&v| !set.on_border(v) && kept.get(v as usize) != Some(&true));
    region.sort_unstable();
    let mut values: Vec<f32> = {
        let rise = smooth_rise(grid, &plate, sign);
        region
            .iter()
            .map(|&v| sign * grid.values[v as usize] + rise(v))
            .collect()
    };
    follow(set, side, &region, &values, &plate);
    let held = HELD * h as f32;
    for (&v, value) in region.iter().zip(&mut values) {
        let member = set.solid[v as usize] == (side == Side::Solid);
        if member != (*value > 0.0) || *value == 0.0 {
            *value = if member { held } else { -held };
        }
        grid.values[v as usize] = sign * *value;
        touched[v as usize] = true;
    }
}

/// Half thickness of the wall around the membrane, mm: how deep the wall is at the thinnest tenth of the rim. The median
/// would often be the depth of a member that the wall runs along.
fn wall(grid: &VoxelGrid<f32>, set: &VoxelSet, patch: &Patch, sign: f32) -> f64 {
    let mut rim = Vec::new();
    for &v in &patch.voxels {
        for_each_near(grid, v, RIM, |n, _| {
            // The membrane's own voxels are members of the set but still have the sign of the other side.
            if sign * grid.values[n] > 0.0 && set.solid[n] == (sign > 0.0) {
                rim.push(n as u32);
            }
        });
    }
    rim.sort_unstable();
    rim.dedup();
    let mut depths: Vec<f32> = rim.iter().map(|&v| climb(grid, v, sign)).collect();
    depths.sort_by(f32::total_cmp);
    depths
        .get(depths.len() / THINNEST)
        .map_or(0.0, |&depth| f64::from(depth))
}

/// The depth of the wall at `v`, mm: the distance is followed as long as it rises steeply, and so to the middle of the
/// wall but not along it.
fn climb(grid: &VoxelGrid<f32>, mut v: u32, sign: f32) -> f32 {
    let h = grid.spacing as f32;
    let mut depth = sign * grid.values[v as usize];
    for _ in 0..CLIMB {
        let mut best = (STEEP * h, v, depth);
        for_each_near(grid, v, 1, |n, d| {
            let value = sign * grid.values[n];
            if d > 0.0 && (value - depth) / d > best.0 {
                best = ((value - depth) / d, n as u32, value);
            }
        });
        if best.1 == v {
            break;
        }
        (_, v, depth) = best;
    }
    depth
}

/// Calls `visit` with the index and the distance (voxels) of every voxel of the cube of half-side `reach` about `v`.
fn for_each_near(grid: &VoxelGrid<f32>, v: u32, reach: usize, mut visit: impl FnMut(usize, f32)) {
    let at = grid.ijk(v as usize);
    let range = |a: usize| at[a].saturating_sub(reach)..(at[a] + reach + 1).min(grid.dims[a]);
    for k in range(2) {
        for j in range(1) {
            for i in range(0) {
                let d2 =
                    i.abs_diff(at[0]).pow(2) + j.abs_diff(at[1]).pow(2) + k.abs_diff(at[2]).pow(2);
                visit(grid.index(i, j, k), (d2 as f32).sqrt());
            }
        }
    }
}

/// Writes the signed distance of the plate around a membrane (positive within) and lists the voxels it reaches.
fn raise(grid: &VoxelGrid<f32>, patch: &Patch, plate: &mut [f32], region: &mut Vec<u32>) {
    let cells = (patch.reach / grid.spacing).ceil() as usize + 3;
    for (&v, place) in patch.voxels.iter().zip(flattened(grid, patch)) {
        for_each_near(grid, v, cells, |n, _| {
            if plate[n] == f32::NEG_INFINITY {
                region.push(n as u32);
            }
            let [i, j, k] = grid.ijk(n);
            let distance = (grid.centre(i, j, k) - place).norm();
            plate[n] = plate[n].max((patch.reach - distance) as f32);
        });
    }
}

/// The centres of the membrane's voxels without their steps, mm: each is moved onto the plane that fits the ones around
/// it best. Over the steps a plate would be up to a voxel thicker than wanted.
fn flattened(grid: &VoxelGrid<f32>, patch: &Patch) -> Vec<Vec3> {
    let centre = |v: u32| {
        let [i, j, k] = grid.ijk(v as usize);
        grid.centre(i, j, k)
    };
    let flat = |&v: &u32| {
        let mut near = Vec::new();
        for_each_near(grid, v, FLAT, |n, d| {
            if d <= FLAT as f32 && patch.voxels.binary_search(&(n as u32)).is_ok() {
                near.push(centre(n as u32));
            }
        });
        let mean = near.iter().sum::<Vec3>() / near.len() as f64;
        let spread: Matrix3<f64> = near
            .iter()
            .map(|p| (p - mean) * (p - mean).transpose())
            .sum();
        let eigen = spread.symmetric_eigen();
        let normal = eigen.eigenvectors.column(eigen.eigenvalues.imin());
        let place = centre(v);
        if near.len() < FEW {
            return place;
        }
        place - normal * normal.dot(&(place - mean))
    };
    patch.voxels.par_iter().map(flat).collect()
}

/// The Gauss-filtered amount by which the plate exceeds the field.
fn smooth_rise<'a>(
    grid: &'a VoxelGrid<f32>,
    plate: &'a [f32],
    sign: f32,
) -> impl Fn(u32) -> f32 + 'a {
    let weights = weights(SIGMA);
    let radius = weights.len() / 2;
    move |v| {
        let at = grid.ijk(v as usize);
        let mut sum = 0.0;
        for_each_near(grid, v, radius, |n, _| {
            let rise = plate[n] - sign * grid.values[n];
            if rise > 0.0 {
                let to = grid.ijk(n);
                let weight: f32 = (0..3).map(|a| weights[to[a] + radius - at[a]]).product();
                sum += weight * rise;
            }
        });
        sum
    }
}

/// Flips voxels of `region` toward the sign of `values` wherever that is a simple point, nearest to the plate first.
fn follow(set: &mut VoxelSet, side: Side, region: &[u32], values: &[f32], plate: &[f32]) {
    let member = |value: f32| (value > 0.0) == (side == Side::Solid);
    let mut todo: Vec<usize> = (0..region.len())
        .filter(|&r| set.solid[region[r] as usize] != member(values[r]))
        .collect();
    todo.sort_by(|&a, &b| {
        plate[region[b] as usize]
            .total_cmp(&plate[region[a] as usize])
            .then(a.cmp(&b))
    });
    for _ in 0..PASSES {
        let count = todo.len();
        todo.retain(|&r| {
            let v = region[r];
            let simple = is_simple(set.mask(v));
            if simple {
                set.solid[v as usize] = !set.solid[v as usize];
            }
            !simple
        });
        if todo.is_empty() || todo.len() == count {
            return;
        }
    }
}
