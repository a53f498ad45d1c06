//! Filling holes.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::super::TriMesh;
use super::edges::Edges;
use super::loops::boundary_loops;
use super::{Repair, RepairError, RepairKind, RepairOptions};
use crate::Vec3;
use crate::monitor::Monitor;

/// Longest loop that is filled with the least area by dynamic programming, which costs the cube of its length.
const MAX_EXACT: usize = 100;

/// Fills holes whose border is a simple loop; refuses a surface that is mostly holes.
///
/// Loops up to 100 edges get the triangulation of least area (Barequet and Sharir 1995), longer ones are cut ear by ear, sharpest first.
pub(super) fn fill(
    mesh: &mut TriMesh,
    options: &RepairOptions,
    repairs: &mut Vec<Repair>,
    monitor: &Monitor,
) -> Result<(), RepairError> {
    let edges = Edges::new(mesh);
    if edges.open() == 0 {
        return Ok(());
    }
    let surface = mesh.area();
    let mut patches = Vec::new();
    let (mut area, mut largest, mut place) = (0.0, -1.0, Vec3::zeros());
    let loops = boundary_loops(mesh, &edges);
    for cycle in &loops {
        monitor.check()?;
        let points: Vec<Vec3> = cycle.iter().map(|&v| mesh.points[v as usize]).collect();
        let triangles = if cycle.len() <= MAX_EXACT {
            least_area(&points)
        } else {
            clip_ears(&points)
        };
        let patch: f64 = triangles.iter().map(|t| area_of(&points, t)).sum();
        area += patch;
        if patch > largest {
            largest = patch;
            place = points.iter().map(|p| p - points[0]).sum::<Vec3>() / points.len() as f64
                + points[0];
        }
        patches.extend(triangles.into_iter().map(|t| t.map(|k| cycle[k as usize])));
    }
    let share = area / surface;
    if share > options.max_hole_share {
        let why = format!(
            "its holes would need {:.0} % of the surface that is there, the limit is {:.0} %",
            100.0 * share,
            100.0 * options.max_hole_share
        );
        return Err(RepairError::NotASolid { why });
    }
    if !loops.is_empty() {
        let text = format!(
            "{} holes filled with {} faces, {area:.4} mm2 ({:.3} % of the surface), the largest {largest:.4} mm2 at ({:.2}, {:.2}, {:.2})",
            loops.len(),
            patches.len(),
            100.0 * share,
            place.x,
            place.y,
            place.z
        );
        repairs.push(Repair::new(RepairKind::HolesFilled, loops.len(), text));
    }
    // Filled faces belong to no body of the input in particular: they take the first tag.
    if let Some(&tag) = mesh.tags.first() {
        mesh.tags.resize(mesh.triangles.len() + patches.len(), tag);
    }
    mesh.triangles.extend(patches);
    Ok(())
}

fn area_of(points: &[Vec3], t: &[u32; 3]) -> f64 {
    let [a, b, c] = t.map(|k| points[k as usize]);
    (b - a).cross(&(c - a)).norm() / 2.0
}

/// The triangulation of a polygon in space with the least area.
fn least_area(points: &[Vec3]) -> Vec<[u32; 3]> {
    let n = points.len();
    let mut cost = vec![0.0; n * n];
    let mut apex = vec![0u32; n * n];
    for span in 2..n {
        for i in 0..n - span {
            let k = i + span;
            let mut best = f64::INFINITY;
            for j in i + 1..k {
                let sum = cost[i * n + j]
                    + cost[j * n + k]
                    + area_of(points, &[i as u32, j as u32, k as u32]);
                if sum < best {
                    best = sum;
                    apex[i * n + k] = j as u32;
                }
            }
            cost[i * n + k] = best;
        }
    }
    let mut triangles = Vec::with_capacity(n - 2);
    let mut open = vec![(0, n - 1)];
    while let Some((i, k)) = open.pop() {
        if k < i + 2 {
            continue;
        }
        let j = apex[i * n + k] as usize;
        triangles.push([i as u32, j as u32, k as u32]);
        open.push((i, j));
        open.push((j, k));
    }
    triangles
}

/// Cuts off the sharpest convex corner until three are left.
fn clip_ears(points: &[Vec3]) -> Vec<[u32; 3]> {
    let n = points.len();
    let normal = newell(points);
    let mut previous: Vec<usize> = (0..n).map(|i| (i + n - 1) % n).collect();
    let mut next: Vec<usize> = (0..n).map(|i| (i + 1) % n).collect();
    let mut stamp = vec![0u32; n];
    let mut heap = BinaryHeap::new();
    let angle = |a: usize, b: usize, c: usize| {
        let (u, v) = (points[c] - points[b], points[a] - points[b]);
        let turn = u.cross(&v).dot(&normal).atan2(u.dot(&v) * normal.norm());
        // Reflex corners come last. The angle is positive now, so its bits sort like the number.
        (if turn < 0.0 {
            turn + std::f64::consts::TAU
        } else {
            turn
        })
        .to_bits()
    };
    for b in 0..n {
        heap.push(Reverse((angle(previous[b], b, next[b]), b, 0)));
    }
    let mut triangles = Vec::with_capacity(n - 2);
    let mut left = n;
    while let Some(Reverse((_, b, at))) = heap.pop() {
        if left < 3 || at != stamp[b] {
            continue;
        }
        let (a, c) = (previous[b], next[b]);
        triangles.push([a as u32, b as u32, c as u32]);
        next[a] = c;
        previous[c] = a;
        left -= 1;
        stamp[b] = u32::MAX;
        for corner in [a, c] {
            stamp[corner] += 1;
            heap.push(Reverse((
                angle(previous[corner], corner, next[corner]),
                corner,
                stamp[corner],
            )));
        }
    }
    triangles
}

/// Normal of a polygon in space, twice its area long.
fn newell(points: &[Vec3]) -> Vec3 {
    let base = points[0];
    points
        .windows(2)
        .map(|pair| (pair[0] - base).cross(&(pair[1] - base)))
        .sum()
}
