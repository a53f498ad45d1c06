//! Caps for the open edges of a soup, so that its winding number splits into an integer and a small correction.

use std::collections::{BTreeMap, HashMap};

use crate::Vec3;
use crate::mesh::TriMesh;

/// Fans over the loops of open edges; with them every edge is used as often forward as backward. No triangles when the
/// mesh closes up by itself; `None` when more than `limit` edges are open.
///
/// 1. Points at the same place count as one.
/// 2. An edge used more often in one sense than in the other is open, as many times as the difference.
/// 3. Every point has as many open edges coming in as going out, so a walk along unused ones always ends where it
///    began; each closed walk gets a fan from its mean point.
pub(super) fn caps(mesh: &TriMesh, limit: usize) -> Option<TriMesh> {
    let open = open_edges(mesh);
    if open.iter().map(|e| e.2).sum::<usize>() > limit {
        return None;
    }
    // Caps run against the open edges.
    let mut from: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for (a, b, times) in open {
        from.entry(b)
            .or_default()
            .extend(std::iter::repeat_n(a, times));
    }
    let mut out = TriMesh {
        points: mesh.points.clone(),
        ..TriMesh::default()
    };
    while let Some((&start, _)) = from.first_key_value() {
        let mut walk = vec![start];
        let mut at = start;
        while let Some(ends) = from.get_mut(&at) {
            let Some(next) = ends.pop() else { break };
            if ends.is_empty() {
                from.remove(&at);
            }
            if next == start {
                break;
            }
            walk.push(next);
            at = next;
        }
        let mean = walk.iter().map(|&v| mesh.points[v as usize]).sum::<Vec3>() / walk.len() as f64;
        let apex = out.points.len() as u32;
        out.points.push(mean);
        out.triangles
            .extend((0..walk.len()).map(|i| [apex, walk[i], walk[(i + 1) % walk.len()]]));
    }
    Some(out)
}

/// Directed edges without their opposite and how often: (from, to, times), by first point at each place.
fn open_edges(mesh: &TriMesh) -> Vec<(u32, u32, usize)> {
    let mut ids: HashMap<[u64; 3], u32> = HashMap::with_capacity(mesh.points.len());
    let welded: Vec<u32> = mesh
        .points
        .iter()
        .zip(0u32..)
        // Adding zero makes -0.0 and 0.0 one place.
        .map(|(p, v)| {
            *ids.entry([p.x, p.y, p.z].map(|x| (x + 0.0).to_bits()))
                .or_insert(v)
        })
        .collect();
    let mut edges: Vec<(u32, u32, i8)> = Vec::with_capacity(mesh.triangles.len() * 3);
    for t in &mesh.triangles {
        for k in 0..3 {
            let (a, b) = (welded[t[k] as usize], welded[t[(k + 1) % 3] as usize]);
            if a != b {
                edges.push((a.min(b), a.max(b), if a < b { 1 } else { -1 }));
            }
        }
    }
    edges.sort_unstable();
    edges
        .chunk_by(|x, y| (x.0, x.1) == (y.0, y.1))
        .filter_map(|group| {
            let (a, b, _) = group[0];
            let sum: i64 = group.iter().map(|e| i64::from(e.2)).sum();
            let times = sum.unsigned_abs() as usize;
            (sum != 0).then_some(if sum > 0 {
                (a, b, times)
            } else {
                (b, a, times)
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::remesh::tests::cube;

    #[test]
    fn a_closed_cube_needs_no_caps_and_an_open_one_gets_the_missing_side() {
        let mut cube = cube(2.0);
        assert_eq!(caps(&cube, 100).map(|c| c.triangles.len()), Some(0));
        cube.triangles.drain(0..2);
        let cap = caps(&cube, 100).expect("few open edges");
        assert_eq!(cap.triangles.len(), 4);
        let mut whole = cap.clone();
        whole.triangles.extend(&cube.triangles);
        assert!((whole.volume() - 8.0).abs() < 1e-12);
        assert!(open_edges(&whole).is_empty());
        assert!(caps(&cube, 3).is_none());
    }

    #[test]
    fn doubled_faces_are_balanced() {
        let mut cube = cube(2.0);
        let copy = cube.triangles.clone();
        cube.triangles.extend(&copy[..3]);
        let mut whole = caps(&cube, 100).expect("few open edges");
        whole.triangles.extend(&cube.triangles);
        assert!(open_edges(&whole).is_empty());
    }
}
