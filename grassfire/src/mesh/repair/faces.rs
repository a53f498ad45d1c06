//! Faces that do not belong to the surface: doubles, faces without area, fins.

use rayon::prelude::*;

use super::super::TriMesh;
use super::edges::Edges;
use super::{Repair, RepairError, RepairKind, RepairOptions, retain};
use crate::monitor::Monitor;

/// A face is flat when its height is below this share of its longest side.
const FLAT: f64 = 1e-4;
/// Passes of removal; each may lay bare faces for the next.
const PASSES: usize = 10;

/// Drops faces that occur twice. Of two faces back to back both go when that leaves every edge with an even number of faces (an inner
/// wall between two bodies), one otherwise (a turned copy).
pub(super) fn drop_duplicates(mesh: &mut TriMesh, repairs: &mut Vec<Repair>) {
    let mut keep = vec![true; mesh.triangles.len()];
    let mut keyed: Vec<([u32; 3], bool, u32)> = mesh
        .triangles
        .par_iter()
        .enumerate()
        .map(|(i, t)| canonical(t, i))
        .collect();
    keyed.par_sort_unstable();
    let mut copies = 0;
    for pair in keyed
        .windows(2)
        .filter(|p| (p[0].0, p[0].1) == (p[1].0, p[1].1))
    {
        keep[pair[1].2 as usize] = false;
        copies += 1;
    }
    retain(mesh, &keep);
    let opposite = drop_opposite(mesh);
    if copies + opposite > 0 {
        let text = format!(
            "{} double faces dropped ({copies} copies, {opposite} back to back)",
            copies + opposite
        );
        repairs.push(Repair::new(
            RepairKind::DuplicateFaces,
            copies + opposite,
            text,
        ));
    }
}

/// Sorted corners and whether sorting turned the face.
fn canonical(t: &[u32; 3], index: usize) -> ([u32; 3], bool, u32) {
    let mut sorted = *t;
    sorted.sort_unstable();
    let rotations = [[t[0], t[1], t[2]], [t[1], t[2], t[0]], [t[2], t[0], t[1]]];
    (sorted, !rotations.contains(&sorted), index as u32)
}

fn drop_opposite(mesh: &mut TriMesh) -> usize {
    let mut keyed: Vec<_> = mesh
        .triangles
        .par_iter()
        .enumerate()
        .map(|(i, t)| canonical(t, i))
        .collect();
    keyed.par_sort_unstable();
    if !keyed.windows(2).any(|p| p[0].0 == p[1].0) {
        return 0;
    }
    let edges = Edges::new(mesh);
    let mut keep = vec![true; mesh.triangles.len()];
    for pair in keyed.windows(2).filter(|p| p[0].0 == p[1].0) {
        let (a, b) = (pair[0].2 as usize, pair[1].2 as usize);
        let even = (0..3).all(|k| edges.around(a, k).len().is_multiple_of(2));
        keep[a.max(b)] = false;
        keep[a.min(b)] = !even;
    }
    let before = mesh.triangles.len();
    retain(mesh, &keep);
    before - mesh.triangles.len()
}

/// Drops faces with repeated corners, and flat faces unless all their sides have two faces (those hold the surface together and do no harm).
pub(super) fn drop_degenerate(
    mesh: &mut TriMesh,
    repairs: &mut Vec<Repair>,
    monitor: &Monitor,
) -> Result<(), RepairError> {
    let before = mesh.triangles.len();
    let keep: Vec<bool> = mesh
        .triangles
        .iter()
        .map(|t| t[0] != t[1] && t[1] != t[2] && t[2] != t[0])
        .collect();
    retain(mesh, &keep);
    for _ in 0..PASSES {
        monitor.check()?;
        let flat: Vec<bool> = (0..mesh.triangles.len())
            .into_par_iter()
            .map(|t| is_flat(mesh, t))
            .collect();
        if !flat.contains(&true) {
            break;
        }
        let edges = Edges::new(mesh);
        let sound = |t: usize| (0..3).all(|k| edges.around(t, k).len() == 2);
        let keep: Vec<bool> = flat
            .iter()
            .enumerate()
            .map(|(t, flat)| !flat || sound(t))
            .collect();
        if !keep.contains(&false) {
            break;
        }
        retain(mesh, &keep);
    }
    let dropped = before - mesh.triangles.len();
    if dropped > 0 {
        let text = format!("{dropped} faces without area dropped");
        repairs.push(Repair::new(RepairKind::DegenerateFaces, dropped, text));
    }
    Ok(())
}

fn is_flat(mesh: &TriMesh, t: usize) -> bool {
    let [a, b, c] = mesh.corners(t);
    let longest = (b - a)
        .norm_squared()
        .max((c - b).norm_squared())
        .max((a - c).norm_squared());
    (b - a).cross(&(c - a)).norm() <= FLAT * longest
}

/// Drops small patches that hang on the rest by edges with more than two faces and have open edges elsewhere.
pub(super) fn drop_fins(mesh: &mut TriMesh, options: &RepairOptions, repairs: &mut Vec<Repair>) {
    let (mut count, mut area) = (0, 0.0);
    for _ in 0..PASSES {
        let edges = Edges::new(mesh);
        if edges.open() == 0 || edges.non_manifold() == 0 {
            break;
        }
        let patches = edges.connected(mesh.triangles.len(), |halves| halves.len() == 2);
        let mut areas = vec![0.0; patches.count];
        for (t, &patch) in patches.of_face.iter().enumerate() {
            areas[patch as usize] += mesh.triangle_area(t);
        }
        let total: f64 = areas.iter().sum();
        let (mut open, mut shared) = (vec![false; patches.count], vec![false; patches.count]);
        for halves in edges.iter() {
            for half in halves {
                let patch = patches.of_face[*half as usize / 3] as usize;
                open[patch] |= halves.len() == 1;
                shared[patch] |= halves.len() > 2;
            }
        }
        let fin: Vec<bool> = (0..patches.count)
            .map(|p| open[p] && shared[p] && areas[p] < options.max_fin_share * total)
            .collect();
        if !fin.contains(&true) {
            break;
        }
        let keep: Vec<bool> = patches.of_face.iter().map(|&p| !fin[p as usize]).collect();
        count += keep.iter().filter(|k| !**k).count();
        area += areas
            .iter()
            .zip(&fin)
            .filter(|(_, fin)| **fin)
            .map(|(a, _)| a)
            .sum::<f64>();
        retain(mesh, &keep);
    }
    if count > 0 {
        let text = format!("{count} faces of fins dropped, {area:.4} mm2");
        repairs.push(Repair::new(RepairKind::Fins, count, text));
    }
}
