//! Boundary loops of holes.

use super::super::TriMesh;
use super::edges::Edges;

/// Simple closed loops of points around the holes, each in the order in which faces that fill it must run. Open chains are left out.
pub(super) fn boundary_loops(mesh: &TriMesh, edges: &Edges) -> Vec<Vec<u32>> {
    // A face that fills the hole runs against the face that is there.
    let mut arrows: Vec<(u32, u32)> = edges
        .iter()
        .filter(|halves| halves.len() == 1)
        .map(|halves| {
            let (t, k) = (halves[0] as usize / 3, halves[0] as usize % 3);
            (mesh.triangles[t][(k + 1) % 3], mesh.triangles[t][k])
        })
        .collect();
    arrows.sort_unstable();
    let first = |v: u32| arrows.partition_point(|a| a.0 < v);
    let mut used = vec![false; arrows.len()];
    // Next arrow to try at the place where the arrows of its start begin.
    let mut cursor: Vec<usize> = (0..arrows.len()).collect();
    let mut place = vec![u32::MAX; mesh.points.len()];
    let mut loops = Vec::new();
    for seed in 0..arrows.len() {
        if used[seed] {
            continue;
        }
        let mut path = vec![arrows[seed].0];
        place[arrows[seed].0 as usize] = 0;
        while let Some(&at) = path.last() {
            let begin = first(at);
            let next = match cursor.get_mut(begin).filter(|_| arrows[begin].0 == at) {
                Some(next) => next,
                None => break,
            };
            while *next < arrows.len() && arrows[*next].0 == at && used[*next] {
                *next += 1;
            }
            let Some(&(_, end)) = arrows.get(*next).filter(|a| a.0 == at) else {
                break;
            };
            used[*next] = true;
            let seen = place[end as usize];
            if seen == u32::MAX {
                place[end as usize] = path.len() as u32;
                path.push(end);
                continue;
            }
            // The path met itself: cut the loop off and go on from there.
            let cycle = path.split_off(seen as usize);
            cycle.iter().for_each(|&v| place[v as usize] = u32::MAX);
            loops.push(cycle);
            place[end as usize] = path.len() as u32;
            path.push(end);
        }
        path.iter().for_each(|&v| place[v as usize] = u32::MAX);
    }
    loops.retain(|l| l.len() >= 3);
    loops
}
