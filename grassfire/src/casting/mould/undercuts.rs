//! Undercuts: gaps between two pieces of material along the draw direction.

use std::collections::BTreeMap;

use serde::Serialize;

use super::dexels::Dexels;
use crate::Vec3;

/// A connected undercut: a core or a slide, or something to fill.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Undercut {
    /// Middle of its volume, mm.
    pub place: Vec3,
    /// mm3.
    pub volume: f64,
    /// Lowest and highest point along the draw direction, mm.
    pub range: [f64; 2],
    /// Lines through it.
    pub lines: usize,
}

/// All undercuts, largest first.
///
/// A two-part mould opens along `+-d` without cores exactly when every line along d meets the part in one interval (Ahn,
/// de Berg et al. 2002, Separating an object from its cast); what lies between two intervals is undercut. Gaps of
/// neighbouring lines that overlap belong together.
pub fn undercuts(dexels: &Dexels) -> Vec<Undercut> {
    let lines = dexels.start.len() - 1;
    let mut gaps: Vec<(u32, [f64; 2])> = Vec::new();
    let mut start = vec![0_u32];
    for line in 0..lines {
        let pairs = dexels.line(line).windows(2);
        gaps.extend(pairs.map(|w| (line as u32, [w[0][1], w[1][0]])));
        start.push(gaps.len() as u32);
    }
    let mut parent: Vec<u32> = (0..gaps.len() as u32).collect();
    for (g, (line, range)) in gaps.iter().enumerate() {
        for other in dexels
            .beside(*line as usize)
            .filter(|o| *o > *line as usize)
        {
            for h in start[other]..start[other + 1] {
                let with = gaps[h as usize].1;
                if range[0] < with[1] && with[0] < range[1] {
                    unite(&mut parent, g as u32, h);
                }
            }
        }
    }
    let area = dexels.pitch * dexels.pitch;
    let mut groups: BTreeMap<u32, Undercut> = BTreeMap::new();
    for (g, (line, range)) in gaps.iter().enumerate() {
        let one = groups
            .entry(root(&mut parent, g as u32))
            .or_insert_with(|| Undercut {
                range: [f64::INFINITY, f64::NEG_INFINITY],
                ..Undercut::default()
            });
        let volume = (range[1] - range[0]) * area;
        one.volume += volume;
        one.place += volume * dexels.place(*line as usize, (range[0] + range[1]) / 2.0);
        one.range = [one.range[0].min(range[0]), one.range[1].max(range[1])];
        one.lines += 1;
    }
    let mut out: Vec<Undercut> = groups.into_values().collect();
    for one in &mut out {
        one.place /= one.volume.max(1e-300);
    }
    out.sort_by(|a, b| b.volume.total_cmp(&a.volume));
    out
}

fn root(parent: &mut [u32], mut v: u32) -> u32 {
    while parent[v as usize] != v {
        parent[v as usize] = parent[parent[v as usize] as usize];
        v = parent[v as usize];
    }
    v
}

fn unite(parent: &mut [u32], a: u32, b: u32) {
    let (a, b) = (root(parent, a), root(parent, b));
    parent[a.max(b) as usize] = a.min(b);
}

/// How far the parting line must leave a plane, mm, and the height of the best plane.
///
/// Along the outline the parting line may run anywhere between the outer faces: from the lowest to the highest point of the
/// material on each line at the border. The least range that meets all of these is the largest lower end minus the smallest
/// upper end; 0 when a plane does.
pub fn parting(dexels: &Dexels) -> (f64, f64) {
    let lines = dexels.start.len() - 1;
    let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
    for line in 0..lines {
        let all = dexels.line(line);
        let (Some(first), Some(last)) = (all.first(), all.last()) else {
            continue;
        };
        let around: Vec<usize> = dexels.beside(line).collect();
        if around.len() < 4 || around.iter().any(|&o| dexels.line(o).is_empty()) {
            low = low.max(first[0]);
            high = high.min(last[1]);
        }
    }
    if low.is_finite() && high.is_finite() {
        ((low - high).max(0.0), (low + high) / 2.0)
    } else {
        (0.0, 0.0)
    }
}
