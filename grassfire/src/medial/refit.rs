//! Geometry of the kept spheres: from lattice corners to the smooth surface of the field.

use nalgebra::{Matrix4, Vector4};
use rayon::prelude::*;

use super::MedialOptions;
use super::complex::Complex;
use super::delaunay::NONE;
use super::union_find::UnionFind;
use crate::Vec3;
use crate::voxel::VoxelGrid;

/// Spheres closer than this (voxels) are refitted as one: tetrahedra in one group of cospherical corners.
const COINCIDENT: f32 = 1e-3;

/// Position in mm of a place in corner coordinates.
pub(super) fn to_mm(field: &VoxelGrid<f32>, corner: &[f32; 3]) -> Vec3 {
    field.origin + field.spacing * Vec3::from_fn(|k, _| f64::from(corner[k]) - 1.5)
}

/// Moves the wanted spheres to the zero level of the field; position (mm) and radius (mm) of each in order.
///
/// 1. Newton steps move the samples of the spheres onto the zero level; the outward normal is -gradient.
/// 2. Vertices at one place form a group (cospherical corners are the rule on a lattice).
/// 3. Each group gets the sphere (c, r) that minimises the mean of (n (p - c) - r)^2 over its oriented
///    sample planes plus `refit_rest` times the squared change; the centre moves `refit_move` voxels at most.
///
/// P. Li, B. Wang, F. Sun, X. Guo, C. Zhang, W. Wang, "Q-MAT: computing medial axis transform by
/// quadratic error minimization", ACM TOG 35 (2015), <https://doi.org/10.1145/2753755>.
pub(super) fn refit(
    complex: &Complex,
    wanted: &[u32],
    samples: &[[i32; 3]],
    field: &VoxelGrid<f32>,
    options: &MedialOptions,
) -> Vec<(Vec3, f64)> {
    let planes = surface_planes(complex, wanted, samples, field);
    let groups = coincident_groups(complex, wanted);
    let h = field.spacing;
    let fitted: Vec<(Vec3, f64)> = groups
        .start
        .par_windows(2)
        .map(|range| {
            let members = &groups.members[range[0] as usize..range[1] as usize];
            let first = members[0] as usize;
            let old = to_mm(field, &complex.centres[first]);
            let old_radius = h * f64::from(complex.radii[first]);
            let mut matrix = Matrix4::zeros();
            let mut vector = Vector4::zeros();
            for &v in members {
                for s in complex.vertex_samples[v as usize] {
                    // Relative to the old sphere, for precision far from the origin.
                    let (p, n) = planes[s as usize].unwrap_or((old, Vec3::zeros()));
                    let row = Vector4::new(n.x, n.y, n.z, 1.0);
                    matrix += row * row.transpose();
                    vector += row * (n.dot(&(p - old)) - old_radius);
                }
            }
            let share = 1.0 / (4 * members.len()) as f64;
            matrix = matrix * share + Matrix4::identity() * options.refit_rest;
            let change = matrix
                .cholesky()
                .map_or(Vector4::zeros(), |c| c.solve(&(vector * share)));
            let step = change.xyz();
            let scale = (options.refit_move * h / step.norm().max(1e-12 * h)).min(1.0);
            (
                old + step * scale,
                (old_radius + change.w).max(0.25 * old_radius),
            )
        })
        .collect();
    groups.of.iter().map(|&g| fitted[g as usize]).collect()
}

/// Point and outward unit normal of the surface at each sample of the wanted spheres.
fn surface_planes(
    complex: &Complex,
    wanted: &[u32],
    samples: &[[i32; 3]],
    field: &VoxelGrid<f32>,
) -> Vec<Option<(Vec3, Vec3)>> {
    let mut used = vec![false; samples.len()];
    wanted
        .iter()
        .flat_map(|&v| complex.vertex_samples[v as usize])
        .for_each(|s| used[s as usize] = true);
    let place = |s: &[i32; 3]| {
        let h = field.spacing;
        let mut p = to_mm(field, &s.map(|x| x as f32));
        for _ in 0..4 {
            let gradient = field.gradient(&p);
            let step = gradient * (field.sample(&p) / gradient.norm_squared().max(1e-12));
            p -= step * (0.7 * h / step.norm().max(1e-12 * h)).min(1.0);
        }
        let gradient = field.gradient(&p);
        (p, -gradient.try_normalize(1e-12).unwrap_or_default())
    };
    samples
        .par_iter()
        .zip(&used)
        .map(|(s, &used)| used.then(|| place(s)))
        .collect()
}

/// Wanted vertices by place.
struct Groups {
    /// Group of each wanted vertex.
    of: Vec<u32>,
    start: Vec<u32>,
    members: Vec<u32>,
}

fn coincident_groups(complex: &Complex, wanted: &[u32]) -> Groups {
    let mut sets = UnionFind::new(complex.radii.len());
    let mut is_wanted = vec![false; complex.radii.len()];
    wanted.iter().for_each(|&v| is_wanted[v as usize] = true);
    for &[a, b] in &complex.edges {
        let (p, q) = (&complex.centres[a as usize], &complex.centres[b as usize]);
        if is_wanted[a as usize]
            && is_wanted[b as usize]
            && (0..3).all(|k| (p[k] - q[k]).abs() < COINCIDENT)
        {
            sets.unite(a, b);
        }
    }
    let mut number = vec![NONE; complex.radii.len()];
    let mut count = 0u32;
    let of: Vec<u32> = wanted
        .iter()
        .map(|&v| {
            let root = sets.find(v) as usize;
            if number[root] == NONE {
                number[root] = count;
                count += 1;
            }
            number[root]
        })
        .collect();
    let mut start = vec![0u32; count as usize + 1];
    of.iter().for_each(|&g| start[g as usize + 1] += 1);
    for g in 0..count as usize {
        start[g + 1] += start[g];
    }
    let mut fill = start.clone();
    let mut members = vec![0; wanted.len()];
    for (&v, &g) in wanted.iter().zip(&of) {
        members[fill[g as usize] as usize] = v;
        fill[g as usize] += 1;
    }
    Groups { of, start, members }
}
