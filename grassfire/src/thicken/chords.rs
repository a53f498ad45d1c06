//! Splits strips of quads whose offsets would meet in one body edge.

use super::RuleCounts;
use super::complex::{Complex, root};
use super::regions::{NONE, facing_slots, unite_sides};

/// Splits every strip through an edge that has two sectors with the same regions at both ends (a
/// one-edge seam with both ends inside a sheet): its two offsets would coincide. Returns whether
/// anything changed; the adjacency is then stale.
///
/// A strip is the chain of quads through opposite edges, so the mesh stays all-quad and conforming.
pub(super) fn split_tight_strips(complex: &mut Complex, rules: &mut RuleCounts) -> bool {
    let mut class: Vec<usize> = (0..8 * complex.quads.len()).collect();
    unite_sides(complex, &mut class);
    let mut strip: Vec<usize> = (0..complex.edges.len()).collect();
    for edges in &complex.quad_edges {
        for k in 0..2 {
            let (a, b) = (
                root(&mut strip, edges[k] as usize),
                root(&mut strip, edges[k + 2] as usize),
            );
            strip[a.max(b)] = a.min(b);
        }
    }
    let mut split = vec![false; complex.edges.len()];
    for (e, edge) in complex.edges.iter().enumerate() {
        let mut sectors: Vec<[usize; 2]> = facing_slots(complex, edge)
            .map(|(from, _)| from.map(|s| root(&mut class, s)))
            .collect();
        sectors.sort_unstable();
        if sectors.windows(2).any(|w| w[0] == w[1]) {
            split[root(&mut strip, e)] = true;
            rules.strips += 1;
        }
    }
    if !split.contains(&true) {
        return false;
    }
    let middle: Vec<u32> = (0..complex.edges.len())
        .map(|e| {
            if split[root(&mut strip, e)] {
                add_between(complex, complex.edges[e].ends)
            } else {
                NONE
            }
        })
        .collect();
    let quads = std::mem::take(&mut complex.quads);
    for (&[a, b, c, d], edges) in quads.iter().zip(&complex.quad_edges.clone()) {
        let [ab, bc, cd, da] = edges.map(|e| middle[e as usize]);
        match (ab != NONE, bc != NONE) {
            (false, false) => complex.quads.push([a, b, c, d]),
            (true, false) => complex.quads.extend([[a, ab, cd, d], [ab, b, c, cd]]),
            (false, true) => complex.quads.extend([[a, b, bc, da], [da, bc, c, d]]),
            (true, true) => {
                let centre = add_between(complex, [ab, cd]);
                complex.quads.extend([
                    [a, ab, centre, da],
                    [ab, b, bc, centre],
                    [centre, bc, c, cd],
                    [da, centre, cd, d],
                ]);
            }
        }
    }
    true
}

fn add_between(complex: &mut Complex, [a, b]: [u32; 2]) -> u32 {
    let (i, j) = (a as usize, b as usize);
    complex
        .points
        .push((complex.points[i] + complex.points[j]) / 2.0);
    complex
        .radii
        .push((complex.radii[i] + complex.radii[j]) / 2.0);
    complex.source.push(complex.source[i]);
    complex.points.len() as u32 - 1
}
