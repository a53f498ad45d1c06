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
/// Shares of the walls that may be thinner than the two thicknesses the voxel is chosen from.
const THIN_SHARES: [f64; 2] = [0.1, 0.25];
/// Voxels across such walls: wanted, and needed even when the grid becomes larger than wanted.
const ACROSS: [f64; 2] = [6.0, 2.25];
/// Voxels along the longest side of the box: at least, wanted at most, at most for the sake of thin walls.
const LONGEST: [f64; 3] = [60.0, 200.0, 400.0];

/// The voxel edge (mm) that is used when none is asked for.
///
/// 1. Thickness: 10th and 25th percentile of the wall thickness, from inward rays at 4000 points spread over the surface to
///    the opposite wall, where that is within 60 degrees of parallel.
/// 2. The smaller of the mean edge and 1/6 of the 10th percentile, but no finer than 1/200 of the longest side of the
///    box unless walls of the 25th percentile would get fewer than 2.25 voxels, and then no finer than 1/400.
/// 3. No coarser than 1/60 of the longest side; coarser again when `max_voxels` demands it.
///
/// The remesh of a closed manifold that was not made on a lattice goes finer when some of its tunnels get lost.
pub fn default_voxel(mesh: &TriMesh, options: &RemeshOptions) -> f64 {
    voxel_for(mesh, &Bvh::new(mesh), options)
}

/// The voxel that the skeleton of a part is made at, mm: the finest not below `voxel` on a ladder down from the `default` one, each rung
/// the square root of 2 below the last. So a voxel a little finer than the default one brings a closer body, but no other skeleton.
/// Voxels coarser than the default one are taken as they are.
pub fn skeleton_voxel(voxel: f64, default: f64) -> f64 {
    // A rung itself is not taken for the next coarser one.
    let rungs = (2.0 * (default / voxel).log2() + 1e-9).floor();
    if rungs < 0.0 {
        voxel
    } else {
        default * (-rungs / 2.0).exp2()
    }
}

pub(super) fn voxel_for(mesh: &TriMesh, bvh: &Bvh, options: &RemeshOptions) -> f64 {
    let (lo, hi) = bvh.bounds().unwrap_or_default();
    let longest = (hi - lo).max();
    let [thin, common] = wall_thickness(mesh, bvh).unwrap_or([f64::INFINITY; 2]);
    let wanted = mean_edge(mesh)
        .min(thin / ACROSS[0])
        .max(longest / LONGEST[1]);
    let needed = wanted.min(common / ACROSS[1]).max(longest / LONGEST[2]);
    let mut voxel = needed.min(longest / LONGEST[0]);
    for _ in 0..64 {
        if voxel_count(&lo, &hi, voxel) <= options.max_voxels as f64 {
            break;
        }
        voxel *= 1.1;
    }
    voxel
}

/// 10th and 25th percentile of the wall thickness, mm; `None` when no ray meets an opposite wall.
fn wall_thickness(mesh: &TriMesh, bvh: &Bvh) -> Option<[f64; 2]> {
    let (lo, hi) = bvh.bounds()?;
    let diagonal = (hi - lo).norm();
    let normal = |t: u32| mesh.normal(t as usize);
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
    Some(THIN_SHARES.map(|share| walls[(walls.len() as f64 * share) as usize]))
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
    (hi - lo)
        .iter()
        .map(|side| (side / voxel).ceil() + 2.0 * MARGIN as f64 + 1.0)
        .product()
}

/// `voxel` times `factor`, or the finest that the bounds allow.
pub(super) fn finer(lo: &Vec3, hi: &Vec3, voxel: f64, factor: f64, max_voxels: usize) -> f64 {
    let mut finer = (voxel * factor).max((hi - lo).max() / LONGEST[2]);
    while finer < voxel && voxel_count(lo, hi, finer) > max_voxels as f64 {
        finer *= 1.1;
    }
    finer
}

/// Origin and size of the grid, centred on the box so that a symmetric part gets a symmetric grid.
pub(super) fn layout(
    lo: &Vec3,
    hi: &Vec3,
    voxel: f64,
    max_voxels: usize,
) -> Result<(Vec3, [usize; 3]), RemeshError> {
    let wanted = voxel_count(lo, hi, voxel);
    if wanted.is_nan() || wanted > max_voxels as f64 || wanted > f64::from(u32::MAX) {
        let finest = (voxel * (wanted / max_voxels.max(1) as f64).cbrt() * 1.1).max(voxel);
        return Err(RemeshError::TooManyVoxels {
            voxel,
            wanted,
            limit: max_voxels,
            finest,
        });
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
/// Every vertex of such a mesh lies on a lattice line: two of its coordinates are multiples of the spacing, up to a
/// shift. Spacings around the mean edge length are tried on 400 vertices; the shift of each axis is the fullest of 25
/// classes of the remainder. Nine vertices of ten must fit, of other meshes one of twenty does.
pub(super) fn source_lattice(mesh: &TriMesh) -> Option<f64> {
    const CLASSES: usize = 25;
    let edge = mean_edge(mesh);
    let (lo, hi) = mesh.bounds()?;
    let longest = (hi - lo).max();
    if mesh.triangles.len() < 200 || edge.is_nan() || edge <= 0.0 || longest > 5000.0 * edge {
        return None;
    }
    let used: Vec<u32> = mesh.triangles.iter().map(|t| t[0]).collect();
    let step = (used.len() / 400).max(1);
    let points: Vec<Vec3> = used
        .iter()
        .step_by(step)
        .map(|&v| mesh.points[v as usize] - lo)
        .collect();
    let fit = |spacing: f64| {
        let mut on_plane = vec![0u8; points.len()];
        for axis in 0..3 {
            let class = |p: &Vec3| {
                ((p[axis] / spacing).rem_euclid(1.0) * CLASSES as f64) as usize % CLASSES
            };
            let mut counts = [0usize; CLASSES];
            points.iter().for_each(|p| counts[class(p)] += 1);
            let around = |c: usize| {
                counts[c] + counts[(c + 1) % CLASSES] + counts[(c + CLASSES - 1) % CLASSES]
            };
            let best = (0..CLASSES)
                .max_by_key(|&c| (around(c), counts[c], CLASSES - c))
                .unwrap_or(0);
            for (p, n) in points.iter().zip(&mut on_plane) {
                *n += u8::from((class(p) + CLASSES + 1 - best) % CLASSES <= 2);
            }
        }
        on_plane.iter().filter(|&&n| n >= 2).count()
    };
    // A step moves the last lattice plane by 2 % of the spacing.
    let count = (0.8 * longest / (0.02 * edge)).ceil() as usize;
    let spacings: Vec<f64> = (0..=count)
        .map(|i| edge * (0.7 + 0.7 * i as f64 / count as f64))
        .collect();
    let fits: Vec<usize> = spacings.par_iter().map(|&s| fit(s)).collect();
    let best = fits.iter().copied().max()?;
    if best * 10 < points.len() * 9 {
        return None;
    }
    let good: Vec<f64> = spacings
        .iter()
        .zip(&fits)
        .filter(|(_, f)| **f == best)
        .map(|(s, _)| *s)
        .collect();
    Some(good[good.len() / 2])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::remesh::tests::cube;

    #[test]
    fn a_cube_gets_sixty_voxels_and_a_plate_enough() {
        let mesh = cube(10.0);
        assert!((default_voxel(&mesh, &RemeshOptions::default()) - 10.0 / 60.0).abs() < 1e-12);
        let mut plate = cube(100.0);
        plate.points.iter_mut().for_each(|p| p.z *= 0.01);
        let voxel = default_voxel(&plate, &RemeshOptions::default());
        assert!((voxel - 1.0 / 2.25).abs() < 1e-3, "{voxel}");
        let few = RemeshOptions {
            max_voxels: 10_000,
            ..RemeshOptions::default()
        };
        let voxel = default_voxel(&plate, &few);
        let (lo, hi) = plate.bounds().unwrap_or_default();
        assert!(layout(&lo, &hi, voxel, few.max_voxels).is_ok());
    }

    #[test]
    fn lattices_are_recognised() {
        let mut grid = crate::voxel::VoxelGrid::filled(Vec3::repeat(0.3), 1.5, [24; 3], 0f32);
        for v in 0..grid.values.len() {
            let [i, j, k] = grid.ijk(v);
            grid.values[v] =
                9.0 - (grid.centre(i, j, k) - Vec3::new(17.0, 17.3, 17.9)).norm() as f32;
        }
        let set = crate::remesh::digital::VoxelSet::positive(grid.dims, &grid.values);
        // Marching cubes puts its vertices on the lattice lines; move the dual vertices there.
        let mut mesh = crate::remesh::extract::surface(&grid, &set, false).mesh;
        assert_eq!(source_lattice(&mesh), None);
        for (n, p) in mesh.points.iter_mut().enumerate() {
            for a in (0..3).filter(|a| *a != n % 3) {
                p[a] = 0.3 + 1.5 * ((p[a] - 0.3) / 1.5).round();
            }
        }
        let found = source_lattice(&mesh).expect("a lattice");
        assert!((found - 1.5).abs() < 0.03, "{found}");
    }

    #[test]
    fn skeletons_are_made_on_the_rungs_of_a_ladder() {
        let near = |a: f64, b: f64| (a - b).abs() < 1e-12;
        assert!(near(skeleton_voxel(0.9, 1.0), 1.0) && near(skeleton_voxel(0.71, 1.0), 1.0));
        assert!(near(skeleton_voxel(0.7, 1.0), 0.5_f64.sqrt()));
        assert!(near(skeleton_voxel(1.0, 1.0), 1.0) && near(skeleton_voxel(0.5, 1.0), 0.5));
        assert!(near(skeleton_voxel(1.1, 1.0), 1.1));
    }
}
