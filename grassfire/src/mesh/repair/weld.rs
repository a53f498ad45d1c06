//! Uniting points: equal ones always, near ones when the surface falls apart.

use std::collections::HashMap;

use rayon::prelude::*;

use super::super::TriMesh;
use super::edges::{Edges, root};
use super::{Repair, RepairError, RepairKind, RepairOptions, drop_unused_points};
use crate::Vec3;
use crate::monitor::Monitor;

/// Tolerances that are tried one after the other, as shares of the largest.
const LADDER: [f64; 5] = [1e-3, 1e-2, 1e-1, 0.5, 1.0];
/// A tolerance is good enough when this share of the edges is still open.
const CLOSED: f64 = 2e-3;
/// More neighbours than this a point: the tolerance is larger than the mesh is fine.
const MAX_NEIGHBOURS: usize = 200;
/// Most triangles around a point that is united within a tolerance.
const MAX_VALENCE: usize = 4096;

/// Unites points that are equal when rounded to `resolution`, the step between numbers at the largest coordinate. So 1e-17 equals 0
/// in a file of float32, while all that the file can tell apart stays apart.
pub(super) fn exact(mesh: &mut TriMesh, resolution: f64) {
    let round = |x: f64| {
        if resolution > 0.0 {
            (x / resolution).round()
        } else {
            x
        }
    };
    // Adding 0 turns -0 into 0, which has other bits.
    let key = |v: u32| mesh.points[v as usize].map(|x| (round(x) + 0.0).to_bits());
    let mut order: Vec<u32> = (0..mesh.points.len() as u32).collect();
    order.par_sort_unstable_by(|&a, &b| {
        let (ka, kb) = (key(a), key(b));
        (ka.x, ka.y, ka.z, a).cmp(&(kb.x, kb.y, kb.z, b))
    });
    let mut first = vec![0u32; order.len()];
    let mut head = 0;
    for (i, &v) in order.iter().enumerate() {
        if i == 0 || key(v) != key(order[head]) {
            head = i;
        }
        first[v as usize] = order[head];
    }
    for v in mesh.triangles.iter_mut().flatten() {
        *v = first[*v as usize];
    }
    drop_unused_points(mesh);
}

/// Unites near points on open edges, with the smallest tolerance that closes the surface, if one at least halves the open edges.
pub(super) fn tolerant(
    mesh: &mut TriMesh,
    edges: &Edges,
    options: &RepairOptions,
    repairs: &mut Vec<Repair>,
    monitor: &Monitor,
) -> Result<(), RepairError> {
    let Some((lower, upper)) = mesh.bounds() else {
        return Ok(());
    };
    let diagonal = (upper - lower).norm();
    let before = edges.open();
    let border = border_points(mesh, edges);
    let incident = incident_triangles(mesh, &border);
    let mut best: Option<(usize, f64, TriMesh)> = None;
    for share in LADDER {
        monitor.check()?;
        let tolerance = share * options.weld_tolerance * diagonal;
        let Some(pairs) = near_pairs(mesh, &border, tolerance) else {
            break;
        };
        let candidate = unite(mesh, &border, &incident, pairs);
        let open = Edges::new(&without_repeats(&candidate)).open();
        if best.as_ref().is_none_or(|(least, ..)| open < *least) {
            best = Some((open, tolerance, candidate));
        }
        if open as f64 <= CLOSED * edges.len() as f64 {
            break;
        }
    }
    if let Some((open, tolerance, united)) = best.filter(|(open, ..)| 2 * open <= before) {
        let count = mesh.points.len() - united.points.len();
        let text = format!(
            "{count} points united within {tolerance:.3e} mm: {before} open edges became {open}"
        );
        repairs.push(Repair::new(RepairKind::Welded, count, text));
        *mesh = united;
    }
    Ok(())
}

fn without_repeats(mesh: &TriMesh) -> TriMesh {
    let good = |t: &&[u32; 3]| t[0] != t[1] && t[1] != t[2] && t[2] != t[0];
    TriMesh {
        points: Vec::new(),
        triangles: mesh.triangles.iter().filter(good).copied().collect(),
        tags: Vec::new(),
    }
}

fn border_points(mesh: &TriMesh, edges: &Edges) -> Vec<u32> {
    let open = edges.iter().filter(|h| h.len() == 1).map(|h| h[0] as usize);
    let ends = open.flat_map(|h| {
        [
            mesh.triangles[h / 3][h % 3],
            mesh.triangles[h / 3][(h % 3 + 1) % 3],
        ]
    });
    let mut border: Vec<u32> = ends.collect();
    border.sort_unstable();
    border.dedup();
    border
}

/// Sorted triangles around each border point.
fn incident_triangles(mesh: &TriMesh, border: &[u32]) -> Vec<Vec<u32>> {
    let mut slot = vec![u32::MAX; mesh.points.len()];
    for (i, &v) in border.iter().enumerate() {
        slot[v as usize] = i as u32;
    }
    let mut incident = vec![Vec::new(); border.len()];
    for (t, corners) in mesh.triangles.iter().enumerate() {
        for v in corners {
            if let Some(list) = incident.get_mut(slot[*v as usize] as usize)
                && list.last() != Some(&(t as u32))
            {
                list.push(t as u32);
            }
        }
    }
    incident
}

/// Pairs (as places in `border`) within `tolerance`, nearest first; `None` when there are far too many.
fn near_pairs(mesh: &TriMesh, border: &[u32], tolerance: f64) -> Option<Vec<(u32, u32)>> {
    let (lower, _) = mesh.bounds()?;
    let point = |i: u32| mesh.points[border[i as usize] as usize];
    let cell = |p: &Vec3| ((p - lower) / tolerance).map(|x| x.floor() as i64);
    let mut sorted: Vec<([i64; 3], u32)> = (0..border.len() as u32)
        .map(|i| (cell(&point(i)).into(), i))
        .collect();
    sorted.par_sort_unstable();
    let mut begin: HashMap<[i64; 3], usize> = HashMap::with_capacity(sorted.len());
    for (at, (cell, _)) in sorted.iter().enumerate() {
        begin.entry(*cell).or_insert(at);
    }
    let mut pairs: Vec<(f64, u32, u32)> = Vec::new();
    let mut looked = 0;
    for &(cell, i) in &sorted {
        for shift in 0..27i64 {
            let near = [
                cell[0] + shift % 3 - 1,
                cell[1] + shift / 3 % 3 - 1,
                cell[2] + shift / 9 - 1,
            ];
            let Some(&start) = begin.get(&near) else {
                continue;
            };
            for &(_, j) in sorted[start..].iter().take_while(|(c, _)| *c == near) {
                looked += 1;
                let distance = (point(i) - point(j)).norm();
                if i < j && distance <= tolerance {
                    pairs.push((distance, i, j));
                }
            }
        }
        if looked > MAX_NEIGHBOURS * sorted.len() + 100_000 {
            return None;
        }
    }
    pairs.par_sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    Some(pairs.into_iter().map(|(_, i, j)| (i, j)).collect())
}

/// Unites pairs in order, never two corners of one triangle; a united point lies at the mean of its members.
fn unite(mesh: &TriMesh, border: &[u32], incident: &[Vec<u32>], pairs: Vec<(u32, u32)>) -> TriMesh {
    let mut parent: Vec<u32> = (0..border.len() as u32).collect();
    let mut around: Vec<Vec<u32>> = incident.to_vec();
    for (i, j) in pairs {
        let (a, b) = (root(&mut parent, i) as usize, root(&mut parent, j) as usize);
        if a == b || around[a].len() + around[b].len() > MAX_VALENCE {
            continue;
        }
        if let Some(merged) = merge_disjoint(&around[a], &around[b]) {
            let (keep, gone) = (a.min(b), a.max(b));
            parent[gone] = keep as u32;
            around[keep] = merged;
            around[gone] = Vec::new();
        }
    }
    let mut out = mesh.clone();
    let mut sums = vec![(Vec3::zeros(), 0.0); border.len()];
    let mut target: Vec<u32> = (0..mesh.points.len() as u32).collect();
    for (i, &v) in border.iter().enumerate() {
        let top = root(&mut parent, i as u32) as usize;
        sums[top].0 += mesh.points[v as usize] - mesh.points[border[top] as usize];
        sums[top].1 += 1.0;
        target[v as usize] = border[top];
    }
    for (&v, (sum, count)) in border.iter().zip(&sums) {
        if *count > 1.0 {
            out.points[v as usize] += sum / *count;
        }
    }
    for v in out.triangles.iter_mut().flatten() {
        *v = target[*v as usize];
    }
    drop_unused_points(&mut out);
    out
}

/// Union of two sorted lists; `None` when they share an element.
fn merge_disjoint(a: &[u32], b: &[u32]) -> Option<Vec<u32>> {
    let mut out = Vec::with_capacity(a.len() + b.len());
    let (mut i, mut j) = (0, 0);
    while i < a.len() && j < b.len() {
        if a[i] == b[j] {
            return None;
        }
        let from_a = a[i] < b[j];
        out.push(if from_a { a[i] } else { b[j] });
        i += usize::from(from_a);
        j += usize::from(!from_a);
    }
    out.extend_from_slice(&a[i..]);
    out.extend_from_slice(&b[j..]);
    Some(out)
}
