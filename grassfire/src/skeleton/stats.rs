//! Figures of a skeleton for the report.

use serde::{Deserialize, Serialize};

use super::Skeleton;
use super::edges::{EdgeTable, UnionFind, betti};
use super::polygons::angle;
use crate::topology::Betti;

/// Mean, 95th percentile and largest value.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Deviation {
    /// Mean.
    pub mean: f64,
    /// 95th percentile.
    pub p95: f64,
    /// Largest.
    pub max: f64,
}

/// Smallest, middle and largest value.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Range {
    /// Smallest.
    pub min: f64,
    /// Median.
    pub median: f64,
    /// Largest.
    pub max: f64,
}

/// Counts and quality of a skeleton.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct SkeletonStats {
    /// Quads.
    pub quads: usize,
    /// Beam edges.
    pub beams: usize,
    /// Sheets: quads joined over edges with two quads.
    pub sheets: usize,
    /// Seam polylines (edges with three or more quads).
    pub seams: usize,
    /// Rim polylines (edges with one quad).
    pub rims: usize,
    /// Points, each the centre of a sphere.
    pub spheres: usize,
    /// Share of the vertices inside sheets that have four quads; 1 without such vertices.
    pub regular_fraction: f64,
    /// Distance of the quads' corners from a right angle, degrees.
    pub corner_deviation: Deviation,
    /// Radii, mm.
    pub radius: Range,
}

/// Betti numbers of a skeleton.
pub fn topology(skeleton: &Skeleton) -> Betti {
    betti(skeleton.points.len(), &skeleton.quads, &skeleton.beams)
}

/// Figures of any skeleton that passes [`super::check`].
pub fn stats(skeleton: &Skeleton) -> SkeletonStats {
    let table = EdgeTable::of_quads(&skeleton.quads);
    let mut radii: Vec<f64> = skeleton
        .radii
        .iter()
        .copied()
        .filter(|r| r.is_finite())
        .collect();
    radii.sort_by(f64::total_cmp);
    let at = |share: f64| {
        radii
            .get((share * radii.len() as f64) as usize)
            .or(radii.last())
            .copied()
            .unwrap_or(0.0)
    };
    SkeletonStats {
        quads: skeleton.quads.len(),
        beams: skeleton.beams.len(),
        sheets: sheets(&table, skeleton.quads.len()),
        seams: polylines(skeleton, &table, |n| n > 2),
        rims: polylines(skeleton, &table, |n| n == 1),
        spheres: skeleton.points.len(),
        regular_fraction: regular_fraction(skeleton, &table),
        corner_deviation: corner_deviation(skeleton),
        radius: Range {
            min: at(0.0),
            median: at(0.5),
            max: at(1.0),
        },
    }
}

fn sheets(table: &EdgeTable, quads: usize) -> usize {
    let mut sets = UnionFind::new(quads);
    for (_, f) in table.iter() {
        if let [a, b] = f {
            sets.join(*a, *b);
        }
    }
    (0..quads as u32).filter(|&q| sets.find(q) == q).count()
}

/// Chains of edges whose face count passes `wanted`; a chain ends where more than two arc edges or beams meet.
fn polylines(skeleton: &Skeleton, table: &EdgeTable, wanted: impl Fn(usize) -> bool) -> usize {
    let mut meeting = vec![0u32; skeleton.points.len()];
    for e in table
        .iter()
        .filter(|(_, f)| f.len() != 2)
        .map(|(e, _)| e)
        .chain(skeleton.beams.iter().copied())
    {
        meeting[e[0] as usize] += 1;
        meeting[e[1] as usize] += 1;
    }
    let edges: Vec<[u32; 2]> = table
        .iter()
        .filter(|(_, f)| wanted(f.len()))
        .map(|(e, _)| e)
        .collect();
    let mut sets = UnionFind::new(edges.len());
    let mut last = vec![u32::MAX; skeleton.points.len()];
    for (i, e) in edges.iter().enumerate() {
        for &v in e {
            if meeting[v as usize] == 2 {
                let other = std::mem::replace(&mut last[v as usize], i as u32);
                if other != u32::MAX {
                    sets.join(other, i as u32);
                }
            }
        }
    }
    (0..edges.len() as u32)
        .filter(|&i| sets.find(i) == i)
        .count()
}

fn regular_fraction(skeleton: &Skeleton, table: &EdgeTable) -> f64 {
    let mut inner = vec![true; skeleton.points.len()];
    let mut valence = vec![0u32; skeleton.points.len()];
    for &v in skeleton.quads.iter().flatten() {
        valence[v as usize] += 1;
    }
    for e in table
        .iter()
        .filter(|(_, f)| f.len() != 2)
        .map(|(e, _)| e)
        .chain(skeleton.beams.iter().copied())
    {
        inner[e[0] as usize] = false;
        inner[e[1] as usize] = false;
    }
    let (mut count, mut regular) = (0usize, 0usize);
    for v in (0..valence.len()).filter(|&v| inner[v] && valence[v] > 0) {
        count += 1;
        regular += usize::from(valence[v] == 4);
    }
    if count == 0 {
        1.0
    } else {
        regular as f64 / count as f64
    }
}

fn corner_deviation(skeleton: &Skeleton) -> Deviation {
    let mut all: Vec<f64> = Vec::with_capacity(4 * skeleton.quads.len());
    for q in &skeleton.quads {
        let p = q.map(|v| skeleton.points[v as usize]);
        all.extend(
            (0..4)
                .map(|k| (angle(&(p[(k + 3) % 4] - p[k]), &(p[(k + 1) % 4] - p[k])) - 90.0).abs()),
        );
    }
    if all.is_empty() {
        return Deviation::default();
    }
    all.sort_by(f64::total_cmp);
    let last = all.len() - 1;
    Deviation {
        mean: all.iter().sum::<f64>() / all.len() as f64,
        p95: all[(0.95 * last as f64).round() as usize],
        max: all[last],
    }
}
