//! Cutting lines of a quad mesh: few rectangular blocks without extraordinary points inside.

use super::half_edges::QuadTopology;
use super::independent::independent_set;

/// Marks half-edges (with their twins) that cut the mesh into blocks with four corners each.
///
/// Every edge at an extraordinary point must be cut, and a cut runs straight on through regular points until it meets
/// another cut: the motorcycle graph (Eppstein, Goodrich, Kim and Tamstorf 2008, doi:10.1111/j.1467-8659.2008.01288.x).
/// Counting corners, the number of blocks is 3 S / 4 - C, with S the sum of the valences of the extraordinary points
/// and C the number of cuts that run from one of them to another without crossing a third. So:
///
/// 1. Follow all straight lines from extraordinary point to extraordinary point; at each regular point two may cross.
/// 2. Choose a large set of lines of which no two cross; these become cuts, shorter lines first.
/// 3. Let all others grow from both ends at the same speed until they meet a cut.
///
/// Components without extraordinary point get one artificial end: their lowest point.
pub(super) fn cut_lines(half_edges: &QuadTopology) -> Vec<bool> {
    let ends = line_ends(half_edges);
    let mut cut = vec![false; half_edges.twin.len()];
    for line in chosen_lines(half_edges, &ends) {
        line.iter().for_each(|&h| mark(half_edges, &mut cut, h));
    }
    grow(half_edges, &ends, &mut cut);
    cut
}

/// Marks a half-edge and its twin.
pub(super) fn mark(half_edges: &QuadTopology, cut: &mut [bool], h: u32) {
    cut[h as usize] = true;
    cut[half_edges.twin[h as usize] as usize] = true;
}

/// Points where lines end: all extraordinary ones, and one of every component that has none.
fn line_ends(half_edges: &QuadTopology) -> Vec<bool> {
    let mut ends: Vec<bool> = half_edges
        .valence
        .iter()
        .map(|n| *n != 0 && *n != 4)
        .collect();
    let quads = half_edges.twin.len() / 4;
    let mut seen = vec![false; quads];
    for start in 0..quads {
        if seen[start] {
            continue;
        }
        seen[start] = true;
        let mut stack = vec![start];
        let mut lowest = u32::MAX;
        let mut regular = true;
        while let Some(q) = stack.pop() {
            for h in 4 * q..4 * q + 4 {
                let v = half_edges.origin(h as u32);
                lowest = lowest.min(v);
                regular &= half_edges.is_regular(v);
                let other = half_edges.twin[h] as usize / 4;
                if !std::mem::replace(&mut seen[other], true) {
                    stack.push(other);
                }
            }
        }
        if regular {
            ends[lowest as usize] = true;
        }
    }
    ends
}

/// All straight lines between ends, each once, that are kept whole.
fn chosen_lines(half_edges: &QuadTopology, ends: &[bool]) -> Vec<Vec<u32>> {
    let mut started = vec![false; half_edges.twin.len()];
    let mut lines: Vec<Vec<u32>> = Vec::new();
    for start in 0..half_edges.len() {
        if started[start as usize] || !ends[half_edges.origin(start) as usize] {
            continue;
        }
        started[start as usize] = true;
        let mut line = vec![start];
        let mut h = start;
        // Going straight is reversible, so the line cannot run into a cycle: it comes to an end point.
        while !ends[half_edges.head(h) as usize] {
            h = half_edges.ahead(h);
            line.push(h);
        }
        started[half_edges.twin[h as usize] as usize] = true;
        lines.push(line);
    }
    let (neighbours, crosses_itself) = crossings(half_edges, &lines);
    let usable: Vec<u32> = (0..lines.len() as u32)
        .filter(|&i| !crosses_itself[i as usize])
        .collect();
    let mut number = vec![u32::MAX; lines.len()];
    usable
        .iter()
        .enumerate()
        .for_each(|(k, &i)| number[i as usize] = k as u32);
    let compact: Vec<Vec<u32>> = usable
        .iter()
        .map(|&i| {
            neighbours[i as usize]
                .iter()
                .map(|&j| number[j as usize])
                .filter(|&k| k != u32::MAX)
                .collect()
        })
        .collect();
    let cost: Vec<usize> = usable.iter().map(|&i| lines[i as usize].len()).collect();
    let chosen = independent_set(&compact, &cost);
    usable
        .iter()
        .zip(chosen)
        .filter(|(_, c)| *c)
        .map(|(&i, _)| std::mem::take(&mut lines[i as usize]))
        .collect()
}

/// Lines that cross each line, sorted, and whether it crosses itself.
fn crossings(half_edges: &QuadTopology, lines: &[Vec<u32>]) -> (Vec<Vec<u32>>, Vec<bool>) {
    let mut through = vec![u32::MAX; half_edges.valence.len()];
    let mut neighbours = vec![Vec::new(); lines.len()];
    let mut crosses_itself = vec![false; lines.len()];
    for (i, line) in lines.iter().enumerate() {
        for &h in &line[1..] {
            let other = std::mem::replace(&mut through[half_edges.origin(h) as usize], i as u32);
            if other == i as u32 {
                crosses_itself[i] = true;
            } else if other != u32::MAX {
                neighbours[i].push(other);
                neighbours[other as usize].push(i as u32);
            }
        }
    }
    for list in &mut neighbours {
        list.sort_unstable();
        list.dedup();
    }
    (neighbours, crosses_itself)
}

/// Extends cuts from all ends, one edge a round, until each meets another cut.
fn grow(half_edges: &QuadTopology, ends: &[bool], cut: &mut [bool]) {
    let mut visited = ends.to_vec();
    for (h, _) in cut.iter().enumerate().filter(|(_, c)| **c) {
        visited[half_edges.origin(h as u32) as usize] = true;
    }
    let starts = |h: &u32| ends[half_edges.origin(*h) as usize] && !cut[*h as usize];
    let mut fronts: Vec<u32> = (0..half_edges.len()).filter(starts).collect();
    while !fronts.is_empty() {
        let mut further = Vec::with_capacity(fronts.len());
        for h in fronts {
            // Another one came the opposite way along this edge: both are done.
            if cut[h as usize] {
                continue;
            }
            mark(half_edges, cut, h);
            if !std::mem::replace(&mut visited[half_edges.head(h) as usize], true) {
                further.push(half_edges.ahead(h));
            }
        }
        fronts = further;
    }
}
