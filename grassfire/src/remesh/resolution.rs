//! Choice of the voxel edge: wall thickness, edge length, source lattice, memory.

use rayon::prelude::*;

use super::{RemeshError, RemeshOptions};
use crate::Vec3;
use crate::mesh::TriMesh;
use crate::mesh::bvh::Bvh;
use crate::mesh::distance::sample_surface;

/// Empty voxels around the solid.
const MARGIN: usize = 4;
/// Rays for the wall thickness.
const RAYS: usize = 4000;
/// Share of the walls that may be thinner than the thickness the voxel is chosen from.
const THIN_SHARE: f64 = 0.15;
/// Voxels that wall of low-percentile thickness gets.
const ACROSS: f64 = 4.5;
/// Voxels along the longest side of the box: never fewer, and never more for the sake of thin walls.
const LONGEST: [f64; 2] = [60.0, 300.0];

/// The voxel edge (mm) that is used when none is asked for:
///
/// `min(mean edge, thickness / 4.5)`, held between 1/300 and 1/60 of the longest side of the box and coarse enough for
/// `max_voxels`. `thickness` is the 15th percentile of the wall thickness: inward rays from 4000 points spread over
/// the surface to the opposite wall, where that is within 60 degrees of parallel.
pub fn default_voxel(mesh: &TriMesh, options: &RemeshOptions) -> f64 {
    voxel_for(mesh, &Bvh::new(mesh), options)
}

pub(super) fn voxel_for(mesh: &TriMesh, bvh: &Bvh, options: &RemeshOptions) -> f64 {
    let (lo, hi) = bvh.bounds().unwrap_or_default();
    let longest = (hi - lo).max();
    let wanted = mean_edge(mesh).min(wall_thickness(mesh, bvh).map_or(f64::INFINITY, |t| t / ACROSS));
    let mut voxel = wanted.clamp(longest / LONGEST[1], longest / LONGEST[0]);
    for _ in 0..64 {
        if voxel_count(&lo, &hi, voxel) <= options.max_voxels as f64 {
            break;
        }
        voxel *= 1.1;
    }
    voxel
}

/// Low percentile of the wall thickness, mm; `None` when no ray meets an opposite wall.
pub(super) fn wall_thickness(mesh: &TriMesh, bvh: &Bvh) -> Option<f64> {
    let (lo, hi) = bvh.bounds()?;
    let diagonal = (hi - lo).norm();
    let normal = |t: u32| {
        let [a, b, c] = mesh.corners(t as usize);
        (b - a).cross(&(c - a)).try_normalize(0.0)
    };
    let mut walls: Vec<f64> = sample_surface(mesh, RAYS)
        .into_par_iter()
        .filter_map(|(p, t)| {
            let inward = -normal(t)?;
            // Copies of the same face lie at zero distance: step over them.
            let (length, other) = bvh.first_hit(&p, &inward, 1e-5 * diagonal, diagonal)?;
            (normal(other)?.dot(&inward) > 0.5).then_some(length)
        })
        .collect();
    if walls.len() < RAYS / 20 {
        return None;
    }
    walls.sort_by(f64::total_cmp);
    Some(walls[(walls.len() as f64 * THIN_SHARE) as usize])
}

fn mean_edge(mesh: &TriMesh) -> f64 {
    let (mut sum, mut count) = (0.0, 0usize);
    for t in 0..mesh.triangles.len() {
        let c = mesh.corners(t);
        for k in 0..3 {
            let length = (c[k] - c[(k + 1) % 3]).norm();
            if length.is_finite() {
                sum += length;
                count += 1;
            }
        }
    }
    sum / count.max(1) as f64
}

fn voxel_count(lo: &Vec3, hi: &Vec3, voxel: f64) -> f64 {
    (hi - lo).iter().map(|side| (side / voxel).ceil() + 2.0 * MARGIN as f64 + 1.0).product()
}

/// Origin and size of the grid, centred on the box so that a symmetric part gets a symmetric grid.
pub(super) fn layout(lo: &Vec3, hi: &Vec3, voxel: f64, max_voxels: usize) -> Result<(Vec3, [usize; 3]), RemeshError> {
    let wanted = voxel_count(lo, hi, voxel);
    if wanted.is_nan() || wanted > max_voxels as f64 || wanted > f64::from(u32::MAX) {
        let finest = (voxel * (wanted / max_voxels.max(1) as f64).cbrt() * 1.1).max(voxel);
        return Err(RemeshError::TooManyVoxels { voxel, wanted, limit: max_voxels, finest });
    }
    let mut dims = [0; 3];
    let mut origin = Vec3::zeros();
    for a in 0..3 {
        dims[a] = ((hi[a] - lo[a]) / voxel).ceil() as usize + 2 * MARGIN + 1;
        origin[a] = (lo[a] + hi[a]) / 2.0 - (dims[a] - 1) as f64 / 2.0 * voxel;
    }
    Ok((origin, dims))
}

/// The spacing of the lattice that a marching-cubes mesh was made on, mm; `None` for other meshes.
///
/// Such a mesh has two coordinates of every vertex on lattice planes. So along each axis the coordinates that many
/// vertices share must be equally spaced, in multiples of one length, and must hold most vertices.
pub(super) fn source_lattice(mesh: &TriMesh) -> Option<f64> {
    let edge = mean_edge(mesh);
    if mesh.triangles.len() < 200 || edge.is_nan() || edge <= 0.0 {
        return None;
    }
    let mut gap = f64::INFINITY;
    for axis in 0..3 {
        gap = gap.min(lattice_gap(mesh, axis, edge)?);
    }
    // Crossings half-way between two planes are common: the step is the multiple nearest to the mean edge length.
    Some(gap * (edge / gap).round().max(1.0))
}

fn lattice_gap(mesh: &TriMesh, axis: usize, edge: f64) -> Option<f64> {
    let mut x: Vec<f64> = mesh.points.iter().map(|p| p[axis]).filter(|x| x.is_finite()).collect();
    x.sort_by(f64::total_cmp);
    let crowd = (x.len() / 2000).max(8);
    let mut planes = Vec::new();
    let mut held = 0;
    for group in x.chunk_by(|a, b| b - a < 2e-3 * edge) {
        if group.len() >= crowd {
            held += group.len();
            planes.push(group.iter().sum::<f64>() / group.len() as f64);
        }
    }
    if planes.len() < 6 || held * 2 < x.len() {
        return None;
    }
    let mut gaps: Vec<f64> = planes.windows(2).map(|w| w[1] - w[0]).collect();
    gaps.sort_by(f64::total_cmp);
    let gap = gaps[gaps.len() / 4];
    let regular = gaps.iter().filter(|&&g| (g / gap - (g / gap).round()).abs() < 0.03).count();
    (gap > 0.2 * edge && regular * 10 >= gaps.len() * 9).then_some(gap)
}
