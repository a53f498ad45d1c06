//! The signed distance field of the input, at a voxel fine enough for its tunnels.

use super::digital::VoxelSet;
use super::input::{Shell, Wanted, wanted};
use super::{RemeshError, RemeshOptions, STAGE, resolution, signed_distance, smooth};
use crate::Vec3;
use crate::mesh::TriMesh;
use crate::mesh::bvh::Bvh;
use crate::mesh::self_intersection::self_intersections;
use crate::monitor::Monitor;
use crate::voxel::VoxelGrid;

/// Longest edge of the triangles in the search tree, voxels.
pub(super) const PIECE: f64 = 4.0;
/// Triangles in the search tree beyond which no more are split.
const PIECES: usize = 2_000_000;
/// Times that the voxel is made finer for the sake of tunnels that it is too coarse for, and the factor.
const REFINEMENTS: usize = 2;
const FINER: f64 = 0.6;
/// One intersecting pair in this many triangles at most in a mesh whose tunnels are believed.
const INTERSECTING: usize = 500;

pub(super) struct Sampled {
    pub(super) field: VoxelGrid<f32>,
    pub(super) bvh: Bvh,
    /// What the clean-up must leave; `None` when the input's topology is not to be trusted.
    pub(super) wanted: Option<Wanted>,
}

/// Samples the signed distance and smooths it. With the `shells` of a trusted mesh and no voxel asked for, a grid that
/// has fewer tunnels than the mesh is made finer within the bounds, as long as that brings some of them back.
pub(super) fn sampled(
    mesh: &TriMesh,
    shells: Option<&[Shell]>,
    options: &RemeshOptions,
    monitor: &Monitor,
) -> Result<Sampled, RemeshError> {
    let bvh = Bvh::new(mesh);
    let (lo, hi) = bvh.bounds().ok_or(RemeshError::Empty)?;
    let mut voxel = options
        .voxel
        .unwrap_or_else(|| resolution::voxel_for(mesh, &bvh, options));
    if (hi - lo).max() <= 0.0 || voxel <= 0.0 {
        return Err(RemeshError::Empty);
    }
    let shells =
        shells.filter(|_| self_intersections(mesh).len() * INTERSECTING <= mesh.triangles.len());
    let limit = |voxel: f64| options.min_tunnel * voxel;
    let (mut field, mut bvh) = sample(mesh, (lo, hi), voxel, options, monitor)?;
    let Some(shells) = shells else {
        let wanted = None;
        return Ok(Sampled { field, bvh, wanted });
    };
    let refinements = if options.voxel.is_none() {
        REFINEMENTS
    } else {
        0
    };
    for _ in 0..refinements {
        let have = tunnels(&field);
        let finer = resolution::finer(&lo, &hi, voxel, FINER, options.max_voxels);
        if have >= wanted(shells, limit(voxel)).tunnels || finer > 0.95 * voxel {
            break;
        }
        let next = sample(mesh, (lo, hi), finer, options, monitor)?;
        if tunnels(&next.0) <= have {
            break;
        }
        voxel = finer;
        (field, bvh) = next;
    }
    let wanted = Some(wanted(shells, limit(voxel)));
    Ok(Sampled { field, bvh, wanted })
}

fn tunnels(field: &VoxelGrid<f32>) -> i64 {
    VoxelSet::positive(field.dims, &field.values).betti().b1
}

fn sample(
    mesh: &TriMesh,
    (lo, hi): (Vec3, Vec3),
    voxel: f64,
    options: &RemeshOptions,
    monitor: &Monitor,
) -> Result<(VoxelGrid<f32>, Bvh), RemeshError> {
    let (origin, dims) = resolution::layout(&lo, &hi, voxel, options.max_voxels)?;
    let bvh = Bvh::new(&split_long_edges(mesh, PIECE * voxel));
    let mut field = signed_distance::signed_distance(mesh, &bvh, origin, voxel, dims, monitor)?;
    if !field.values.iter().any(|&v| v > 0.0) {
        return Err(not_solid(&bvh, &field));
    }
    monitor.step(STAGE, "smoothing", 0.55)?;
    smooth::smooth(&mut field, options.smoothing);
    Ok((field, bvh))
}

/// Halves the longest edge of every triangle until it is at most `length`: long triangles make poor boxes, and every
/// query would visit most of them. Neighbours are split at the same points.
pub(crate) fn split_long_edges(mesh: &TriMesh, length: f64) -> TriMesh {
    let mut out = TriMesh {
        points: mesh.points.clone(),
        ..TriMesh::default()
    };
    let mut stack = mesh.triangles.clone();
    stack.reverse();
    while let Some(t) = stack.pop() {
        let edge =
            |k: usize| (out.points[t[k] as usize] - out.points[t[(k + 1) % 3] as usize]).norm();
        let longest = (0..3)
            .max_by(|&a, &b| edge(a).total_cmp(&edge(b)))
            .unwrap_or(0);
        if edge(longest) <= length || out.triangles.len() + stack.len() >= PIECES {
            out.triangles.push(t);
            continue;
        }
        let [a, b, c] = [t[longest], t[(longest + 1) % 3], t[(longest + 2) % 3]];
        let middle = out.points.len() as u32;
        out.points
            .push((out.points[a as usize] + out.points[b as usize]) / 2.0);
        stack.push([middle, b, c]);
        stack.push([a, middle, c]);
    }
    out
}

/// The winding numbers say why nothing is inside.
fn not_solid(bvh: &Bvh, field: &VoxelGrid<f32>) -> RemeshError {
    let winding = crate::mesh::winding::Winding::new(bvh);
    let step = (field.values.len() / 4000).max(1);
    let places: Vec<Vec3> = (0..field.values.len())
        .step_by(step)
        .map(|v| {
            let [i, j, k] = field.ijk(v);
            field.centre(i, j, k)
        })
        .collect();
    let all = winding.at_all(&places);
    let lowest = all.iter().copied().fold(f64::INFINITY, f64::min);
    let highest = all.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    RemeshError::NotSolid {
        lowest,
        highest,
        sampled: places.len(),
    }
}
