//! Do the inscribed balls of a finished solid grow on the way to the feeder?

use serde::Serialize;

use super::graph::{FeedGraph, Seed, distances};
use crate::Vec3;
use crate::medial::MedialMesh;

/// What paths to the feeders showed.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Monotony {
    /// Paths from far points to a feeder.
    pub paths: usize,
    /// Their length in all, mm.
    pub length: f64,
    /// Share of it where the ball is smaller than one passed before, by more than the tolerance.
    pub falling: f64,
    /// Largest such difference, mm.
    pub largest: f64,
    /// Where the larger ball of that difference lies, and the smaller one after it, mm.
    pub between: [[f64; 3]; 2],
}

/// Looks at the radii of a medial axis on the way from `count` far points to the feeders.
///
/// 1. Distances to the feeders along the edges of the medial mesh; a feeder begins at the points whose balls reach to within
///    `reach` of it, at least at the nearest.
/// 2. Far points one after the other: each is the one farthest from the feeders and from those taken before.
/// 3. On each path the length counts as falling where the radius lies more than `tolerance` below the largest so far.
///
/// Lengths in mm. Points that no path joins to a feeder do not count.
pub fn monotony(
    axis: &MedialMesh,
    feeders: &[[f64; 3]],
    reach: f64,
    count: usize,
    tolerance: f64,
) -> Monotony {
    let graph = FeedGraph::of_medial(axis, &[]);
    let mut seeds = Vec::new();
    for (number, place) in feeders.iter().enumerate() {
        let place = Vec3::from(*place);
        let gap = |v: usize| (graph.points[v] - place).norm() - graph.radii[v];
        let all = 0..graph.points.len();
        let nearest = all.clone().min_by(|&a, &b| gap(a).total_cmp(&gap(b)));
        let near = all.filter(|&v| gap(v) <= reach || Some(v) == nearest);
        seeds.extend(near.map(|v| Seed {
            point: v as u32,
            distance: 0.0,
            feeder: number as u32,
        }));
    }
    let to_feeder = distances(&graph, &seeds);
    let mut apart: Vec<f64> = to_feeder.distance.clone();
    let mut out = Monotony::default();
    let mut falling = 0.0;
    for _ in 0..count {
        let far = (0..apart.len()).filter(|&v| apart[v].is_finite() && apart[v] > 0.0);
        let Some(start) = far.max_by(|&a, &b| apart[a].total_cmp(&apart[b]).then(b.cmp(&a))) else {
            break;
        };
        let own = Seed {
            point: start as u32,
            distance: 0.0,
            feeder: 0,
        };
        let around = distances(&graph, &[own]).distance;
        apart
            .iter_mut()
            .zip(around)
            .for_each(|(a, d)| *a = a.min(d));
        let mut largest = start;
        let mut at = start;
        while to_feeder.parent[at] as usize != at {
            let next = to_feeder.parent[at] as usize;
            let step = (graph.points[next] - graph.points[at]).norm();
            out.length += step;
            let below = graph.radii[largest] - graph.radii[next];
            if below > tolerance {
                falling += step;
            }
            if below > tolerance.max(out.largest) {
                out.largest = below;
                out.between = [largest, next].map(|v| graph.points[v].into());
            }
            if below < 0.0 {
                largest = next;
            }
            at = next;
        }
        out.paths += 1;
    }
    out.falling = falling / out.length.max(1e-300);
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bar(radii: &[f64]) -> MedialMesh {
        let n = radii.len() as u32;
        MedialMesh {
            points: (0..n)
                .map(|i| Vec3::new(10.0 * f64::from(i), 0.0, 0.0))
                .collect(),
            radii: radii.to_vec(),
            edges: (1..n).map(|i| [i - 1, i]).collect(),
            ..MedialMesh::default()
        }
    }

    #[test]
    fn falling_shares_are_those_of_the_radii() {
        let feeder = [[50.0, 0.0, 0.0]];
        let grows = monotony(&bar(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]), &feeder, 0.0, 1, 0.1);
        assert_eq!((grows.paths, grows.falling), (1, 0.0));
        let neck = monotony(&bar(&[1.0, 4.0, 3.0, 3.5, 5.0, 6.0]), &feeder, 0.0, 1, 0.1);
        assert!((neck.falling - 0.4).abs() < 1e-12 && (neck.largest - 1.0).abs() < 1e-12);
        assert_eq!(neck.between.map(|p| p[0]), [10.0, 20.0]);
    }
}
