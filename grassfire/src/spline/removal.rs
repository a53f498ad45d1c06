//! Fewer extraordinary points, and with them fewer blocks: quads are taken out of a control mesh.

use std::collections::BTreeSet;

use super::half_edges::{QuadTopology, connect, next};
use super::{ControlMesh, SplineError};
use crate::Vec3;

/// More quads than this around a point make poor patches.
const LARGEST_VALENCE: u32 = 8;

/// Quads that were taken out: a strip or a single one.
#[derive(Debug, Clone, PartialEq)]
pub struct CoarserStep {
    /// The mesh without them. Points keep their numbers: those that are gone belong to no quad.
    pub mesh: ControlMesh,
    /// Pairs of points that became one, the first of which stays.
    pub merged: Vec<[u32; 2]>,
    /// How much the sum of the valences of all extraordinary points fell.
    pub gain: u32,
    /// How far apart the merged points were, times the angle between their normals (radians), the largest, mm.
    pub bend: f64,
}

/// Takes out the strip of quads or the single quad that costs least for what it gains.
///
/// The number of blocks depends on the extraordinary points only: three quarters of the sum of their valences, less the
/// lines between them that cross no other. Taking out a strip (a chain through opposite edges, closed as the mesh is)
/// merges points of valence p and q to one of valence p + q - 4: 3 and 5 cancel, and any two others need four quads less.
/// Taking out one quad merges two opposite corners to a point of valence p + q - 2, and the other two lose a quad each.
///
/// 1. Follow all strips, leaving out those that cross or touch themselves; list all quads, either way.
/// 2. Leave out what would not be a manifold of the same topology with valences from 3 to 8, what gains nothing, and what
///    merges a pair in `refused` (smaller point first).
/// 3. Of those with a bend of at most `limit` the one with the least bend for the square root of its gain goes, a single
///    quad only when no strip is left; merged points meet in the middle.
///
/// `None` when nothing is left.
///
/// # Errors
/// As for [`super::patches`].
pub fn take_quads_out(
    mesh: &ControlMesh,
    refused: &BTreeSet<[u32; 2]>,
    limit: f64,
) -> Result<Option<CoarserStep>, SplineError> {
    let half_edges = connect(mesh)?;
    let limit_points = half_edges.limit_positions().apply(&mesh.points);
    let [u, v] = half_edges.limit_tangents().map(|t| t.apply(&mesh.points));
    let turn = |[a, b]: &[u32; 2]| {
        let normal = |i: u32| u[i as usize].cross(&v[i as usize]);
        let angle = normal(*a).angle(&normal(*b));
        (limit_points[*a as usize] - limit_points[*b as usize]).norm() * angle
    };
    let is_refused = |[a, b]: &[u32; 2]| refused.contains(&[*a.min(b), *a.max(b)]);
    let all = strips(&half_edges)
        .into_iter()
        .chain(collapses(&half_edges));
    let mut candidates: Vec<(f64, Removal, f64)> = all
        .filter(|removal| removal.gain > 0 && !removal.merged.iter().any(is_refused))
        .map(|removal| {
            let bend = removal.merged.iter().map(turn).fold(0.0, f64::max);
            (bend / f64::from(removal.gain).sqrt(), removal, bend)
        })
        .filter(|(_, _, bend)| *bend <= limit)
        .collect();
    let single = |removal: &Removal| removal.quads.len() == 1;
    candidates.sort_by(|a, b| {
        let kind = single(&a.1).cmp(&single(&b.1));
        kind.then(a.0.total_cmp(&b.0))
    });
    for (_, removal, bend) in candidates {
        let coarser = without(mesh, &removal);
        if connect(&coarser).is_ok_and(|after| after.euler() == half_edges.euler()) {
            return Ok(Some(CoarserStep {
                mesh: coarser,
                merged: removal.merged,
                gain: removal.gain,
                bend,
            }));
        }
    }
    Ok(None)
}

/// Quads that could go.
struct Removal {
    merged: Vec<[u32; 2]>,
    /// Ascending.
    quads: Vec<u32>,
    gain: u32,
}

/// A point's share in what decides the number of blocks.
fn irregular(valence: u32) -> u32 {
    if valence == 4 { 0 } else { valence }
}

/// How much the valences of extraordinary points fall when a strip goes; `None` when a merged point has a valence that
/// cannot be.
fn strip_gain(half_edges: &QuadTopology, merged: &[[u32; 2]]) -> Option<u32> {
    let mut gain = 0;
    for pair in merged {
        let [p, q] = pair.map(|v| half_edges.valence[v as usize]);
        let valence = (p + q).checked_sub(4)?;
        if !(3..=LARGEST_VALENCE).contains(&valence) {
            return None;
        }
        gain += irregular(p) + irregular(q) - irregular(valence);
    }
    Some(gain)
}

/// Every quad, either way.
fn collapses(half_edges: &QuadTopology) -> impl Iterator<Item = Removal> + '_ {
    let quads = half_edges.quads.iter().enumerate();
    let both = quads.flat_map(|(k, &[a, b, c, d])| [(k, [a, b, c, d]), (k, [b, c, d, a])]);
    both.filter_map(|(quad, [a, b, c, d])| {
        let [p, r, q, s] = [a, b, c, d].map(|v| half_edges.valence[v as usize]);
        let after = [(p + q).checked_sub(2)?, r - 1, s - 1];
        if after.iter().any(|n| !(3..=LARGEST_VALENCE).contains(n)) {
            return None;
        }
        let before: u32 = [p, r, q, s].into_iter().map(irregular).sum();
        let after: u32 = after.into_iter().map(irregular).sum();
        Some(Removal {
            merged: vec![[a, c]],
            quads: vec![quad as u32],
            gain: before.saturating_sub(after),
        })
    })
}

/// All strips that neither cross nor touch themselves, in the order of their lowest half-edges.
fn strips(half_edges: &QuadTopology) -> Vec<Removal> {
    let mut seen = vec![false; half_edges.twin.len()];
    let mut out = Vec::new();
    for start in 0..half_edges.len() {
        if seen[start as usize] {
            continue;
        }
        let (mut merged, mut quads) = (Vec::new(), Vec::new());
        let mut h = start;
        // Going on through the opposite edge is reversible, so the walk comes back to its start.
        loop {
            let opposite = next(next(h));
            seen[h as usize] = true;
            seen[opposite as usize] = true;
            merged.push([half_edges.origin(h), half_edges.head(h)]);
            quads.push(h / 4);
            h = half_edges.twin[opposite as usize];
            if h == start {
                break;
            }
        }
        let mut points: Vec<u32> = merged.iter().flatten().copied().collect();
        if !is_set(&mut points) || !is_set(&mut quads) {
            continue;
        }
        if let Some(gain) = strip_gain(half_edges, &merged) {
            out.push(Removal {
                merged,
                quads,
                gain,
            });
        }
    }
    out
}

/// Sorts, and tells whether nothing occurs twice.
fn is_set(list: &mut [u32]) -> bool {
    list.sort_unstable();
    list.windows(2).all(|pair| pair[0] != pair[1])
}

fn without(mesh: &ControlMesh, removal: &Removal) -> ControlMesh {
    let mut number: Vec<u32> = (0..mesh.points.len() as u32).collect();
    let mut points = mesh.points.clone();
    for [a, b] in &removal.merged {
        number[*b as usize] = *a;
        let middle: Vec3 = (points[*a as usize] + points[*b as usize]) / 2.0;
        points[*a as usize] = middle;
    }
    let kept = (0..mesh.quads.len() as u32).filter(|q| removal.quads.binary_search(q).is_err());
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
        let step = take_quads_out(&block([3, 3, 3]), &BTreeSet::new(), 1e9);
        assert_eq!(step, Ok(None));
    }

    #[test]
    fn stamp_is_taken_out() {
        let mesh = stamped();
        assert_eq!(sum(&mesh), 8 * 3 + 4 * 3 + 4 * 5);
        let step = take_quads_out(&mesh, &BTreeSet::new(), 1e9)
            .expect("a valid mesh")
            .expect("a strip");
        // The ring of four quads: each inner point of valence 3 meets the outer one of valence 5.
        assert_eq!((step.merged.len(), step.gain), (4, 32));
        assert_eq!(sum(&step.mesh), sum(&mesh) - step.gain);
        assert!(faces(&step.mesh) < faces(&mesh));
        assert!(step.bend < 0.5, "{}", step.bend);
        let refused = step.merged.iter().map(|[a, b]| [*a.min(b), *a.max(b)]);
        let other = take_quads_out(&mesh, &refused.collect(), 1e9).expect("a valid mesh");
        assert!(other.is_none_or(|other| other.merged != step.merged));
        assert_eq!(take_quads_out(&mesh, &BTreeSet::new(), -1.0), Ok(None));
    }

    #[test]
    fn single_quad_goes_when_that_gains() {
        // Two points of valence 3 and two of valence 5 in one quad: all become regular.
        let cube = block([4, 4, 2]);
        let before = connect(&cube).expect("a valid mesh");
        assert!(collapses(&before).all(|removal| removal.gain == 0));
        let mut mesh = cube;
        let centre = Vec3::new(2.0, 2.0, 2.0);
        let far = |v: &u32| (mesh.points[*v as usize] - centre).norm();
        let middle = (0..mesh.points.len() as u32)
            .min_by(|a, b| far(a).total_cmp(&far(b)))
            .expect("points");
        // Open the middle of the top along two edges and put a quad in.
        let ring: Vec<u32> = before.ring(middle).map(|h| before.head(h)).collect();
        let new = mesh.points.len() as u32;
        let [p, q] = [ring[0], ring[2]].map(|v| mesh.points[v as usize]);
        let shift = (q - p).cross(&Vec3::z()) * 0.1;
        mesh.points.push(mesh.points[middle as usize] - shift);
        mesh.points[middle as usize] += shift;
        for h in before.ring(middle).skip(2).take(2) {
            let quad = &mut mesh.quads[h as usize / 4];
            quad.iter_mut()
                .filter(|v| **v == middle)
                .for_each(|v| *v = new);
        }
        let candidates = [
            [middle, ring[2], new, ring[0]],
            [middle, ring[0], new, ring[2]],
        ];
        let (added, sums) = candidates
            .iter()
            .find_map(|quad| {
                let mut opened = mesh.clone();
                opened.quads.push(*quad);
                connect(&opened)
                    .is_ok()
                    .then(|| (opened.clone(), sum(&opened)))
            })
            .expect("one of the two senses");
        assert_eq!(sums, 8 * 3 + 2 * 3 + 2 * 5);
        let step = take_quads_out(&added, &BTreeSet::new(), 1e9)
            .expect("a valid mesh")
            .expect("a quad");
        assert_eq!((step.merged.len(), step.gain), (1, 16));
        assert_eq!(sum(&step.mesh), 8 * 3);
    }

    #[test]
    fn open_meshes_are_refused() {
        let mut mesh = block([2, 2, 2]);
        mesh.quads.pop();
        assert!(take_quads_out(&mesh, &BTreeSet::new(), 1e9).is_err());
    }
}
