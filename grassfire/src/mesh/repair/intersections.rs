//! Faces that run through others.

use rayon::prelude::*;
use robust::{Coord3D, orient3d};

use super::super::TriMesh;
use crate::Vec3;

/// Neighbours whose box touches that a face is compared with at most, so that soup in one place does not cost its square.
const MAX_COMPARED: usize = 2000;
/// Most comparisons of boxes with large faces; a mesh that needs more is not counted.
const MAX_LARGE: usize = 2_000_000_000;
/// Cells a face is entered into at most, along each axis; larger ones go into a list of their own.
const MAX_SPAN: usize = 8;

/// Number of faces that run through another face; 0 when counting would take too long. Faces that only touch, or lie in one plane, do not
/// count; exact predicates decide.
pub(super) fn intersecting_faces(mesh: &TriMesh) -> usize {
    let cells = Cells::new(mesh);
    let faces = mesh.triangles.len();
    if cells.large.len().saturating_mul(faces) > MAX_LARGE {
        return 0;
    }
    let runs_through = |t: usize| {
        let near = cells.near(t).map(|other| other as usize);
        let mut touching = near
            .filter(|&other| other != t && cells.touch(t, other))
            .take(MAX_COMPARED);
        touching.any(|other| cross(mesh, t, other))
    };
    (0..faces)
        .into_par_iter()
        .filter(|&t| runs_through(t))
        .count()
}

/// Faces sorted into cubic cells.
struct Cells {
    boxes: Vec<[Vec3; 2]>,
    lower: Vec3,
    size: f64,
    /// Cell and face, sorted.
    entries: Vec<([u32; 3], u32)>,
    large: Vec<u32>,
}

impl Cells {
    fn new(mesh: &TriMesh) -> Self {
        let boxes: Vec<[Vec3; 2]> = (0..mesh.triangles.len())
            .map(|t| {
                let [a, b, c] = mesh.corners(t);
                [a.inf(&b).inf(&c), a.sup(&b).sup(&c)]
            })
            .collect();
        let (lower, upper) = mesh.bounds().unwrap_or_default();
        let mean =
            boxes.iter().map(|[lo, hi]| (hi - lo).amax()).sum::<f64>() / boxes.len().max(1) as f64;
        let size = (1.5 * mean)
            .max((upper - lower).amax() * 1e-6)
            .max(f64::MIN_POSITIVE);
        let mut cells = Self {
            boxes,
            lower,
            size,
            entries: Vec::new(),
            large: Vec::new(),
        };
        for t in 0..cells.boxes.len() {
            match cells.range(t) {
                Some(range) => cells.entries.extend(range.map(|cell| (cell, t as u32))),
                None => cells.large.push(t as u32),
            }
        }
        cells.entries.par_sort_unstable();
        cells
    }

    /// Cells that the box of face `t` reaches into; `None` when they are too many.
    fn range(&self, t: usize) -> Option<impl Iterator<Item = [u32; 3]> + use<>> {
        let [lo, hi] = self.boxes[t].map(|p| self.cell(&p));
        if (0..3).any(|a| (hi[a] - lo[a]) as usize >= MAX_SPAN) {
            return None;
        }
        let plane =
            move |k| (lo[1]..=hi[1]).flat_map(move |j| (lo[0]..=hi[0]).map(move |i| [i, j, k]));
        Some((lo[2]..=hi[2]).flat_map(plane))
    }

    /// Faces in the same cells as `t`, each once; all faces for a large one.
    fn near(&self, t: usize) -> impl Iterator<Item = u32> + '_ {
        let range = self.range(t);
        let all = if range.is_none() {
            0..self.boxes.len() as u32
        } else {
            0..0
        };
        let in_cell = move |cell: [u32; 3]| {
            let start = self.entries.partition_point(|e| e.0 < cell);
            let faces = self.entries[start..]
                .iter()
                .take_while(move |e| e.0 == cell)
                .map(|e| e.1);
            // Two boxes share many cells; the one where their common part begins speaks for all.
            faces.filter(move |&o| {
                self.cell(&self.boxes[t][0].sup(&self.boxes[o as usize][0])) == cell
            })
        };
        range
            .into_iter()
            .flatten()
            .flat_map(in_cell)
            .chain(self.large.iter().copied())
            .chain(all)
    }

    fn cell(&self, p: &Vec3) -> [u32; 3] {
        ((p - self.lower) / self.size).map(|x| x as u32).into()
    }

    fn touch(&self, t: usize, other: usize) -> bool {
        let ([a, b], [c, d]) = (&self.boxes[t], &self.boxes[other]);
        (0..3).all(|k| a[k] <= d[k] && c[k] <= b[k])
    }
}

/// A side of one face runs through the inside of the other. Sides that start in a common corner cannot.
fn cross(mesh: &TriMesh, t: usize, other: usize) -> bool {
    let (ta, tb) = (mesh.triangles[t], mesh.triangles[other]);
    if ta.iter().filter(|v| tb.contains(v)).count() > 1 {
        return false;
    }
    let pierces = |from: [u32; 3], through: [u32; 3]| {
        (0..3).map(|k| (from[k], from[(k + 1) % 3])).any(|(p, q)| {
            let free = !through.contains(&p) && !through.contains(&q);
            free && segment_crosses(mesh, [p, q], through)
        })
    };
    pierces(ta, tb) || pierces(tb, ta)
}

fn segment_crosses(mesh: &TriMesh, segment: [u32; 2], triangle: [u32; 3]) -> bool {
    let coord = |v: u32| {
        let p = mesh.points[v as usize];
        Coord3D {
            x: p.x,
            y: p.y,
            z: p.z,
        }
    };
    let ([p, q], [a, b, c]) = (segment.map(coord), triangle.map(coord));
    let (above, below) = (orient3d(a, b, c, p), orient3d(a, b, c, q));
    if !(above > 0.0 && below < 0.0 || above < 0.0 && below > 0.0) {
        return false;
    }
    let sides = [
        orient3d(p, q, a, b),
        orient3d(p, q, b, c),
        orient3d(p, q, c, a),
    ];
    sides.iter().all(|s| *s > 0.0) || sides.iter().all(|s| *s < 0.0)
}
