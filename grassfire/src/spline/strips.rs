//! Fewer extraordinary points, and with them fewer blocks: strips of quads are taken out of a control mesh.

use std::collections::BTreeSet;

use super::half_edges::{QuadTopology, connect, next};
use super::{ControlMesh, SplineError};
use crate::Vec3;

/// More quads than this around a point make poor patches.
const LARGEST_VALENCE: u32 = 8;

/// A strip that was taken out.
#[derive(Debug, Clone, PartialEq)]
pub struct StripStep {
    /// The mesh without the strip. Points keep their numbers: those that are gone belong to no quad.
    pub mesh: ControlMesh,
    /// Pairs of points that became one, the first of which stays; the pairs are the edges that cross the strip.
    pub merged: Vec<[u32; 2]>,
    /// How much the sum of the valences of all extraordinary points fell.
    pub gain: u32,
    /// How far apart the merged points were, times the angle between their normals (radians), the largest, mm.
    pub bend: f64,
}

/// Takes out the strip of quads (a chain through opposite edges, closed as the mesh is) that costs least for what it gains.
///
/// The number of blocks depends on the extraordinary points only: three quarters of the sum of their valences, less the
/// lines between them that cross no other. A strip between points of valence p and q merges them to one of valence p + q - 4:
/// 3 and 5 cancel, and any two others need four quads less.
///
/// 1. Follow all strips; leave out those that cross or touch themselves, whose mesh would not be a manifold of the same
///    topology with valences from 3 to 8, that gain nothing, and that have an edge in `refused` (smaller point first).
/// 2. Of those with a bend of at most `limit` the one with the least bend for the square root of its gain goes; the points
///    of an edge across it meet in its middle.
///
/// `None` when no strip is left.
///
/// # Errors
/// As for [`super::patches`].
pub fn take_strip_out(
    mesh: &ControlMesh,
    refused: &BTreeSet<[u32; 2]>,
    limit: f64,
) -> Result<Option<StripStep>, SplineError> {
    let half_edges = connect(mesh)?;
    let limit_points = half_edges.limit_positions().apply(&mesh.points);
    let [u, v] = half_edges.limit_tangents().map(|t| t.apply(&mesh.points));
    let turn = |a: u32, b: u32| {
        let normal = |i: u32| u[i as usize].cross(&v[i as usize]);
        let angle = normal(a).angle(&normal(b));
        (limit_points[a as usize] - limit_points[b as usize]).norm() * angle
    };
    let mut candidates: Vec<(f64, Strip, u32, f64)> = Vec::new();
    for strip in strips(&half_edges) {
        let Some(gain) = strip.gain(&half_edges).filter(|gain| *gain > 0) else {
            continue;
        };
        let is_refused = |[a, b]: &[u32; 2]| refused.contains(&[*a.min(b), *a.max(b)]);
        if strip.edges.iter().any(is_refused) {
            continue;
        }
        let bend = strip.edges.iter().map(|[a, b]| turn(*a, *b));
        let bend = bend.fold(0.0, f64::max);
        if bend <= limit {
            candidates.push((bend / f64::from(gain).sqrt(), strip, gain, bend));
        }
    }
    candidates.sort_by(|a, b| a.0.total_cmp(&b.0));
    for (_, strip, gain, bend) in candidates {
        let shorter = without(mesh, &strip);
        if connect(&shorter).is_ok_and(|after| after.euler() == half_edges.euler()) {
            return Ok(Some(StripStep {
                mesh: shorter,
                merged: strip.edges,
                gain,
                bend,
            }));
        }
    }
    Ok(None)
}

struct Strip {
    /// The edges across it, all in one sense.
    edges: Vec<[u32; 2]>,
    quads: Vec<u32>,
}

impl Strip {
    /// How much the valences of extraordinary points fall; `None` when a merged point has a valence that cannot be.
    fn gain(&self, half_edges: &QuadTopology) -> Option<u32> {
        let irregular = |n: u32| if n == 4 { 0 } else { n };
        let mut gain = 0;
        for [a, b] in &self.edges {
            let [p, q] = [a, b].map(|v| half_edges.valence[*v as usize]);
            let merged = (p + q).checked_sub(4)?;
            if !(3..=LARGEST_VALENCE).contains(&merged) {
                return None;
            }
            gain += irregular(p) + irregular(q) - irregular(merged);
        }
        Some(gain)
    }
}

/// All strips that neither cross nor touch themselves, in the order of their lowest half-edges.
fn strips(half_edges: &QuadTopology) -> Vec<Strip> {
    let mut seen = vec![false; half_edges.twin.len()];
    let mut out = Vec::new();
    for start in 0..half_edges.len() {
        if seen[start as usize] {
            continue;
        }
        let mut strip = Strip {
            edges: Vec::new(),
            quads: Vec::new(),
        };
        let mut h = start;
        // Going on through the opposite edge is reversible, so the walk comes back to its start.
        loop {
            let opposite = next(next(h));
            seen[h as usize] = true;
            seen[opposite as usize] = true;
            strip.edges.push([half_edges.origin(h), half_edges.head(h)]);
            strip.quads.push(h / 4);
            h = half_edges.twin[opposite as usize];
            if h == start {
                break;
            }
        }
        let mut points: Vec<u32> = strip.edges.iter().flatten().copied().collect();
        if is_set(&mut points) && is_set(&mut strip.quads) {
            out.push(strip);
        }
    }
    out
}

/// Sorts, and tells whether nothing occurs twice.
fn is_set(list: &mut [u32]) -> bool {
    list.sort_unstable();
    list.windows(2).all(|pair| pair[0] != pair[1])
}

fn without(mesh: &ControlMesh, strip: &Strip) -> ControlMesh {
    let mut number: Vec<u32> = (0..mesh.points.len() as u32).collect();
    let mut points = mesh.points.clone();
    for [a, b] in &strip.edges {
        number[*b as usize] = *a;
        let middle: Vec3 = (points[*a as usize] + points[*b as usize]) / 2.0;
        points[*a as usize] = middle;
    }
    let kept = (0..mesh.quads.len() as u32).filter(|q| strip.quads.binary_search(q).is_err());
    ControlMesh {
        quads: kept
            .map(|q| mesh.quads[q as usize].map(|v| number[v as usize]))
            .collect(),
        points,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spline::{BrepOptions, PatchOptions, build_brep, patches};
    use std::collections::BTreeMap;

    /// The surface of a block of `n` cubes as a control mesh.
    fn block(n: [i32; 3]) -> ControlMesh {
        let mut mesh = ControlMesh::default();
        let mut numbers = BTreeMap::new();
        for axis in 0..3 {
            let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
            for side in [0, 1] {
                for (i, j) in (0..n[a]).flat_map(|i| (0..n[b]).map(move |j| (i, j))) {
                    let mut quad = [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[di, dj]| {
                        let mut at = [0; 3];
                        (at[axis], at[a], at[b]) = (side * n[axis], i + di, j + dj);
                        *numbers.entry(at).or_insert_with(|| {
                            mesh.points.push(Vec3::from(at.map(f64::from)));
                            mesh.points.len() as u32 - 1
                        })
                    });
                    if side == 0 {
                        quad.reverse();
                    }
                    mesh.quads.push(quad);
                }
            }
        }
        mesh
    }

    fn sum(mesh: &ControlMesh) -> u32 {
        let valence = connect(mesh).expect("a valid mesh").valence;
        valence.iter().filter(|n| **n != 4).sum()
    }

    fn faces(mesh: &ControlMesh) -> usize {
        let monitor = crate::monitor::Monitor::default();
        let surface = patches(mesh, &PatchOptions::default(), &monitor).expect("a valid mesh");
        let brep = build_brep(mesh, &surface, &BrepOptions::default(), &monitor);
        brep.expect("a valid mesh").faces.len()
    }

    /// A block with one quad of its top split into five: a 3-3-3-3 ring inside 5-5-5-5.
    fn stamped() -> ControlMesh {
        let mut mesh = block([5, 5, 2]);
        let centre = Vec3::new(2.5, 2.5, 2.0);
        let middle = |quad: &[u32; 4]| quad.iter().map(|v| mesh.points[*v as usize]).sum::<Vec3>();
        let top = mesh
            .quads
            .iter()
            .position(|q| (middle(q) / 4.0 - centre).norm() < 1e-9)
            .expect("the middle of the top");
        let outer = mesh.quads[top];
        let first = mesh.points.len() as u32;
        for v in outer {
            let p = mesh.points[v as usize];
            mesh.points.push(centre.lerp(&p, 0.5));
        }
        let inner = [first, first + 1, first + 2, first + 3];
        mesh.quads[top] = inner;
        for k in 0..4 {
            let l = (k + 1) % 4;
            mesh.quads.push([outer[k], outer[l], inner[l], inner[k]]);
        }
        mesh
    }

    #[test]
    fn block_has_nothing_to_gain() {
        let step = take_strip_out(&block([3, 3, 3]), &BTreeSet::new(), 1e9);
        assert_eq!(step, Ok(None));
    }

    #[test]
    fn stamp_is_taken_out() {
        let mesh = stamped();
        assert_eq!(sum(&mesh), 8 * 3 + 4 * 3 + 4 * 5);
        let step = take_strip_out(&mesh, &BTreeSet::new(), 1e9)
            .expect("a valid mesh")
            .expect("a strip");
        // The ring of four quads: each inner point of valence 3 meets the outer one of valence 5.
        assert_eq!((step.merged.len(), step.gain), (4, 32));
        assert_eq!(sum(&step.mesh), sum(&mesh) - step.gain);
        assert!(faces(&step.mesh) < faces(&mesh));
        assert!(step.bend < 0.5, "{}", step.bend);
        let refused = step.merged.iter().map(|[a, b]| [*a.min(b), *a.max(b)]);
        let other = take_strip_out(&mesh, &refused.collect(), 1e9).expect("a valid mesh");
        assert!(other.is_none_or(|other| other.merged != step.merged));
        assert_eq!(take_strip_out(&mesh, &BTreeSet::new(), -1.0), Ok(None));
    }

    #[test]
    fn open_meshes_are_refused() {
        let mut mesh = block([2, 2, 2]);
        mesh.quads.pop();
        assert!(take_strip_out(&mesh, &BTreeSet::new(), 1e9).is_err());
    }
}
