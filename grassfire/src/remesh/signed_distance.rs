//! Signed distance of a triangle soup on a voxel grid.

use rayon::prelude::*;

use super::closing::caps;
use super::crossings::winding_by_rows;
use super::sample::{PIECE, split_long_edges};
use super::{RemeshError, STAGE};
use crate::Vec3;
use crate::mesh::TriMesh;
use crate::mesh::bvh::Bvh;
use crate::mesh::winding::Winding;
use crate::monitor::Monitor;
use crate::voxel::VoxelGrid;

/// Half-width of the band with exact distances, voxels.
pub(super) const BAND: f64 = 3.0;
/// Winding number of the surface. A hair above one half, so that an open sheet (exactly 1/2 in its plane) is no solid.
const INSIDE: f64 = 0.5 + 1e-4;
/// Rows are counted when at most one open edge comes on this many triangles.
const OPEN_SHARE: usize = 4;
/// Edge of the blocks that get one sign where no surface is near, voxels.
const BLOCK: usize = 4;

/// Signed distance (mm, positive inside) of `mesh`; `bvh` holds the same surface.
///
/// 1. Voxels within 3 voxels of a triangle get their exact distance from the tree.
/// 2. Sign: winding number > 1/2. When few edges are open, caps close them; the winding number of the closed surface
///    is an integer counted along grid rows, and the generalized winding number of the caps is taken off it. Otherwise
///    the generalized winding number of everything is evaluated in the whole band, and beyond it for blocks of 4^3
///    voxels, subdivided where the sign is not clear.
/// 3. Beyond the band the distance is propagated by fast sweeping.
pub(super) fn signed_distance(
    mesh: &TriMesh,
    bvh: &Bvh,
    origin: Vec3,
    spacing: f64,
    dims: [usize; 3],
    monitor: &Monitor,
) -> Result<VoxelGrid<f32>, RemeshError> {
    let mut grid = VoxelGrid::filled(origin, spacing, dims, f32::INFINITY);
    monitor.step(STAGE, "distance", 0.05)?;
    mark_band(bvh, &mut grid);
    exact_distances(bvh, &mut grid);
    monitor.step(STAGE, "inside or outside", 0.3)?;
    match caps(mesh, mesh.triangles.len() / OPEN_SHARE) {
        Some(caps) => sign_by_rows(mesh, caps, &mut grid),
        None => sign_by_blocks(&Winding::new(bvh), &mut grid),
    }
    monitor.step(STAGE, "far field", 0.5)?;
    let known: Vec<bool> = grid.values.par_iter().map(|v| v.is_finite()).collect();
    sweep(&mut grid, &known, monitor)?;
    Ok(grid)
}

/// Sets the voxels near a triangle to -1, the others stay infinite.
fn mark_band(bvh: &Bvh, grid: &mut VoxelGrid<f32>) {
    let mut stack: Vec<([Vec3; 3], u32)> = Vec::new();
    for corners in &bvh.corners {
        stack.push((corners.map(|p| grid.to_grid(&p)), 0));
        while let Some((t, depth)) = stack.pop() {
            let (lo, hi) = (t[0].inf(&t[1]).inf(&t[2]), t[0].sup(&t[1]).sup(&t[2]));
            // A box around a large triangle would mark far more than the band: quarter it first.
            if depth < 12 && (hi - lo).max() > 4.0 && (hi - lo).min() > 1.0
                || depth < 12 && (hi - lo).max() > 16.0
            {
                let m = [
                    (t[0] + t[1]) / 2.0,
                    (t[1] + t[2]) / 2.0,
                    (t[2] + t[0]) / 2.0,
                ];
                for part in [
                    [t[0], m[0], m[2]],
                    [m[0], t[1], m[1]],
                    [m[2], m[1], t[2]],
                    m,
                ] {
                    stack.push((part, depth + 1));
                }
                continue;
            }
            mark_box(grid, &lo.add_scalar(-BAND), &hi.add_scalar(BAND));
        }
    }
}

fn mark_box(grid: &mut VoxelGrid<f32>, lo: &Vec3, hi: &Vec3) {
    let mut range = [[0usize; 2]; 3];
    for a in 0..3 {
        let last = grid.dims[a] as f64 - 1.0;
        if hi[a] < 0.0 || lo[a] > last {
            return;
        }
        range[a] = [
            lo[a].ceil().clamp(0.0, last) as usize,
            hi[a].floor().clamp(0.0, last) as usize,
        ];
    }
    for k in range[2][0]..=range[2][1] {
        for j in range[1][0]..=range[1][1] {
            let row = grid.index(0, j, k);
            grid.values[row + range[0][0]..=row + range[0][1]].fill(-1.0);
        }
    }
}

/// Replaces every mark by the unsigned distance, or by infinity beyond the band.
fn exact_distances(bvh: &Bvh, grid: &mut VoxelGrid<f32>) {
    let [nx, ny, _] = grid.dims;
    let (origin, h) = (grid.origin, grid.spacing);
    grid.values
        .par_chunks_mut(nx)
        .enumerate()
        .for_each(|(row, values)| {
            let (j, k) = (row % ny, row / ny);
            let mut last = f64::INFINITY;
            for (i, value) in values.iter_mut().enumerate() {
                if *value != -1.0 {
                    last = f64::INFINITY;
                    continue;
                }
                let p = origin + h * Vec3::new(i as f64, j as f64, k as f64);
                // The distance changes by no more than one voxel from the voxel before.
                let limit = (last + h * (1.0 + 1e-9)).min(BAND * h);
                let found = bvh.nearest(&p, limit).map(|n| n.distance);
                last = found.unwrap_or(f64::INFINITY);
                *value = found.map_or(f32::INFINITY, |d| d as f32);
            }
        });
}

/// Signs for a soup with few open edges, which `caps` close.
fn sign_by_rows(mesh: &TriMesh, caps: TriMesh, grid: &mut VoxelGrid<f32>) {
    let fine = split_long_edges(&caps, PIECE * grid.spacing);
    let bvh = Bvh::new(&fine);
    let winding = Winding::new(&bvh);
    let mut closed = caps;
    closed.triangles.extend(&mesh.triangles);
    let numbers = winding_by_rows(&closed, grid);
    let [nx, ny, _] = grid.dims;
    let (origin, h) = (grid.origin, grid.spacing);
    grid.values
        .par_chunks_mut(nx)
        .zip(numbers.par_chunks(nx))
        .enumerate()
        .for_each(|(row, (values, numbers))| {
            for (i, (value, &number)) in values.iter_mut().zip(numbers).enumerate() {
                let p = origin + h * Vec3::new(i as f64, (row % ny) as f64, (row / ny) as f64);
                if f64::from(number) - winding.at(&p) <= INSIDE {
                    *value = -*value;
                }
            }
        });
}

/// Gives every voxel whose (unsigned) value satisfies `wanted` the sign of its winding number.
fn sign_each(winding: &Winding, grid: &mut VoxelGrid<f32>, wanted: impl Fn(f32) -> bool + Sync) {
    let [nx, ny, _] = grid.dims;
    let (origin, h) = (grid.origin, grid.spacing);
    grid.values
        .par_chunks_mut(nx)
        .enumerate()
        .for_each(|(row, values)| {
            for (i, value) in values.iter_mut().enumerate() {
                if wanted(*value) {
                    let p = origin + h * Vec3::new(i as f64, (row % ny) as f64, (row / ny) as f64);
                    if winding.at(&p) <= INSIDE {
                        *value = -*value;
                    }
                }
            }
        });
}

/// Signs for a soup with holes or unbalanced folds. Leaves the far voxels at +-infinity.
fn sign_by_blocks(winding: &Winding, grid: &mut VoxelGrid<f32>) {
    let [nx, ny, nz] = grid.dims;
    let (origin, h) = (grid.origin, grid.spacing);
    sign_each(winding, grid, f32::is_finite);
    let blocks = grid.dims.map(|n| n.div_ceil(BLOCK));
    let count = blocks[0] * blocks[1] * blocks[2];
    let at = |i: usize, j: usize, k: usize| {
        winding.at(&(origin + h * Vec3::new(i as f64, j as f64, k as f64)))
    };
    let values = &grid.values;
    let flips: Vec<Vec<u32>> = (0..count)
        .into_par_iter()
        .map(|b| {
            let lo = [
                b % blocks[0],
                b / blocks[0] % blocks[1],
                b / (blocks[0] * blocks[1]),
            ]
            .map(|x| x * BLOCK);
            let hi = [0, 1, 2].map(|a| (lo[a] + BLOCK).min([nx, ny, nz][a]));
            let mut far = Vec::new();
            for k in lo[2]..hi[2] {
                for j in lo[1]..hi[1] {
                    let row = (k * ny + j) * nx;
                    far.extend(
                        (row + lo[0]..row + hi[0])
                            .filter(|&v| values[v].is_infinite())
                            .map(|v| v as u32),
                    );
                }
            }
            if far.is_empty() {
                return far;
            }
            let samples: Vec<f64> = (0..9)
                .map(|c| {
                    let pick = |a: usize| match c {
                        8 => usize::midpoint(lo[a], hi[a] - 1),
                        _ if c >> a & 1 == 1 => hi[a] - 1,
                        _ => lo[a],
                    };
                    at(pick(0), pick(1), pick(2))
                })
                .collect();
            let block_is_far = far.len() == (0..3).map(|a| hi[a] - lo[a]).product::<usize>();
            if block_is_far && samples.iter().all(|&w| w > 0.65) {
                return Vec::new();
            }
            if block_is_far && samples.iter().all(|&w| w < 0.35) {
                return far;
            }
            far.retain(|&v| {
                let v = v as usize;
                at(v % nx, v / nx % ny, v / (nx * ny)) <= INSIDE
            });
            far
        })
        .collect();
    for v in flips.into_iter().flatten() {
        grid.values[v as usize] = f32::NEG_INFINITY;
    }
}

/// Recomputes the voxels that are not `known` from those that are: |gradient| = 1, each sign on its own side.
///
/// Fast sweeping, eight Gauss-Seidel sweeps in alternating directions (Zhao 2005, doi:10.1090/S0025-5718-04-01678-3).
/// The sign of an unknown value says which side it is on; its size does not matter.
pub(super) fn sweep(
    grid: &mut VoxelGrid<f32>,
    known: &[bool],
    monitor: &Monitor,
) -> Result<(), RemeshError> {
    let far = (grid.dims.iter().sum::<usize>() as f64 * grid.spacing) as f32;
    for (value, known) in grid.values.iter_mut().zip(known) {
        if !known {
            *value = far.copysign(*value);
        }
    }
    let [nx, ny, nz] = grid.dims;
    let h = grid.spacing as f32;
    for direction in 0..8 {
        monitor.check()?;
        for k in order(nz, direction & 4 != 0) {
            for j in order(ny, direction & 2 != 0) {
                let row = (k * ny + j) * nx;
                for i in order(nx, direction & 1 != 0) {
                    let v = row + i;
                    if known[v] {
                        continue;
                    }
                    let sign = 1f32.copysign(grid.values[v]);
                    let value =
                        |inside: bool, n: usize| if inside { sign * grid.values[n] } else { far };
                    // A neighbour across the surface counts as being on it.
                    let x = value(i > 0, v.wrapping_sub(1))
                        .min(value(i + 1 < nx, v + 1))
                        .max(0.0);
                    let y = value(j > 0, v.wrapping_sub(nx))
                        .min(value(j + 1 < ny, v + nx))
                        .max(0.0);
                    let z = value(k > 0, v.wrapping_sub(nx * ny))
                        .min(value(k + 1 < nz, v + nx * ny))
                        .max(0.0);
                    let new = h * eikonal(x / h, y / h, z / h);
                    if new < grid.values[v].abs() {
                        grid.values[v] = new.copysign(sign);
                    }
                }
            }
        }
    }
    Ok(())
}

fn order(n: usize, backward: bool) -> impl Iterator<Item = usize> {
    (0..n).map(move |i| if backward { n - 1 - i } else { i })
}

/// First-order upwind solution of |gradient| = 1 at unit spacing from the smaller neighbour on each axis.
fn eikonal(x: f32, y: f32, z: f32) -> f32 {
    let mut s = [x, y, z];
    s.sort_by(f32::total_cmp);
    let one = s[0] + 1.0;
    if one <= s[1] {
        return one;
    }
    let two = 0.5 * (s[0] + s[1] + (2.0 - (s[0] - s[1]).powi(2)).max(0.0).sqrt());
    if two <= s[2] {
        return two;
    }
    let sum = s[0] + s[1] + s[2];
    let squares = s[0] * s[0] + s[1] * s[1] + s[2] * s[2];
    (sum + (sum * sum - 3.0 * (squares - 1.0)).max(0.0).sqrt()) / 3.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sweeping_a_plane_and_a_point() {
        let mut grid = VoxelGrid::filled(Vec3::zeros(), 0.5, [21; 3], -1f32);
        let middle = grid.index(10, 10, 10);
        grid.values[middle] = -0.25;
        let mut known = vec![false; grid.values.len()];
        known[middle] = true;
        assert!(sweep(&mut grid, &known, &Monitor::default()).is_ok());
        let far = f64::from(-grid.values[grid.index(20, 10, 10)]);
        assert!((far - 5.25).abs() < 1e-5);
        let corner = f64::from(-grid.values[grid.index(20, 20, 20)]);
        assert!((corner - 0.25 - 75f64.sqrt()).abs() < 0.8, "{corner}");
    }

    #[test]
    fn all_sign_rules_agree_on_a_cube() {
        let cube = crate::remesh::tests::cube(8.0);
        let mut open = cube.clone();
        open.triangles.push([0, 2, 3]);
        let mut loose = TriMesh::default();
        for t in 0..cube.triangles.len() {
            // Every corner a hair off its neighbours': all edges are open.
            let n = loose.points.len() as u32;
            loose
                .points
                .extend(cube.corners(t).map(|p| p * (1.0 + 1e-9 * t as f64)));
            loose.triangles.push([n, n + 1, n + 2]);
        }
        for mesh in [cube, open, loose] {
            let bvh = Bvh::new(&mesh);
            let grid = signed_distance(
                &mesh,
                &bvh,
                Vec3::repeat(-5.7),
                0.6,
                [20; 3],
                &Monitor::default(),
            )
            .expect("no cancel");
            for v in 0..grid.values.len() {
                let [i, j, k] = grid.ijk(v);
                let depth = 4.0 - grid.centre(i, j, k).abs().max();
                assert!(depth.abs() < 1e-6 || (depth > 0.0) == (grid.values[v] > 0.0));
            }
        }
    }
}
