//! Two-sided distance between surfaces, and the area-uniform sampling behind it.

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::TriMesh;
use super::bvh::Bvh;
use crate::Vec3;

/// How many worst places a [`Distance`] lists.
const WORST: usize = 8;

/// Options of [`two_sided`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct DistanceOptions {
    /// Sample points on each of the two surfaces.
    pub samples: usize,
}

impl Default for DistanceOptions {
    fn default() -> Self {
        Self { samples: 40_000 }
    }
}

/// Distances of sample points, mm.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct DistanceSummary {
    /// Root of the mean square.
    pub rms: f64,
    /// 95 % of the samples are nearer.
    pub p95: f64,
    /// Largest.
    pub max: f64,
    /// Samples that counted.
    pub samples: usize,
}

/// Result of [`two_sided`], mm.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Distance {
    /// Root mean square over the samples of both surfaces.
    pub rms: f64,
    /// 95th percentile over the samples of both surfaces.
    pub p95: f64,
    /// Largest distance (sampled Hausdorff distance).
    pub max: f64,
    /// From `a` to `b` alone.
    pub a_to_b: DistanceSummary,
    /// From `b` to `a` alone.
    pub b_to_a: DistanceSummary,
    /// The worst places and their distances, largest first, not nearer to each other than 1/20 of the diagonal.
    pub worst: Vec<(Vec3, f64)>,
}

/// Points spread evenly over the area of a mesh, with the triangle of each.
///
/// 1. The areas are summed along the triangle list and the sum is stepped through in `count` equal steps, so every
///    triangle gets its share to within one sample.
/// 2. The place within the triangle comes from the R2 low-discrepancy sequence.
///
/// No randomness: the same mesh gives the same points. Triangles that are not finite get none.
pub fn sample_surface(mesh: &TriMesh, count: usize) -> Vec<(Vec3, u32)> {
    let mut sums = Vec::with_capacity(mesh.triangles.len());
    let mut total = 0.0;
    for t in 0..mesh.triangles.len() {
        let area = mesh.triangle_area(t);
        total += if area.is_finite() { area } else { 0.0 };
        sums.push(total);
    }
    if total <= 0.0 || !total.is_finite() {
        return Vec::new();
    }
    let place = |i: usize| {
        let wanted = (i as f64 + 0.5) / count as f64 * total;
        let t = sums.partition_point(|&s| s <= wanted).min(sums.len() - 1);
        let [a, b, c] = mesh.corners(t);
        // Steps 1/g and 1/g^2 of the plastic number g.
        let (mut u, mut v) = (
            (i as f64 * 0.754_877_666_246_692_7).fract(),
            (i as f64 * 0.569_840_290_998_053_2).fract(),
        );
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        (a + (b - a) * u + (c - a) * v, t as u32)
    };
    (0..count).into_par_iter().map(place).collect()
}

/// Sampled two-sided distance between two surfaces.
///
/// 1. [`sample_surface`] spreads `options.samples` points over each surface; points where `ignore` is true are left out.
/// 2. Each point's exact distance to the other surface comes from a [`Bvh`].
///
/// Empty surfaces give an infinite distance from the other one. A mesh index out of range is not allowed.
pub fn two_sided(
    a: &TriMesh,
    b: &TriMesh,
    options: &DistanceOptions,
    ignore: Option<&(dyn Fn(&Vec3) -> bool + Sync)>,
) -> Distance {
    let (tree_a, tree_b) = (Bvh::new(a), Bvh::new(b));
    let forward = one_sided(a, &tree_b, options.samples, ignore);
    let backward = one_sided(b, &tree_a, options.samples, ignore);
    let (a_to_b, b_to_a) = (summary(&forward), summary(&backward));
    let all = [forward, backward].concat();
    let both = summary(&all);
    let (lo, hi) = tree_a.bounds().unwrap_or_default();
    Distance {
        rms: both.rms,
        p95: both.p95,
        max: both.max,
        a_to_b,
        b_to_a,
        worst: worst(all, (hi - lo).norm() / 20.0),
    }
}

/// Distances from sample points of `from` to the surface in `to`, in sample order, with their places.
fn one_sided(
    from: &TriMesh,
    to: &Bvh,
    samples: usize,
    ignore: Option<&(dyn Fn(&Vec3) -> bool + Sync)>,
) -> Vec<(Vec3, f64)> {
    sample_surface(from, samples)
        .into_par_iter()
        .filter(|(p, _)| !ignore.is_some_and(|ignore| ignore(p)))
        .map(|(p, _)| {
            (
                p,
                to.nearest(&p, f64::INFINITY)
                    .map_or(f64::INFINITY, |n| n.distance),
            )
        })
        .collect()
}

/// Root mean square, 95th percentile and maximum of sampled distances.
fn summary(samples: &[(Vec3, f64)]) -> DistanceSummary {
    if samples.is_empty() {
        return DistanceSummary::default();
    }
    let n = samples.len();
    let mut sorted: Vec<f64> = samples.iter().map(|s| s.1).collect();
    let rms = (sorted.iter().map(|d| d * d).sum::<f64>() / n as f64).sqrt();
    sorted.sort_by(f64::total_cmp);
    DistanceSummary {
        rms,
        p95: sorted[(n - 1) * 95 / 100],
        max: sorted[n - 1],
        samples: n,
    }
}

fn worst(mut samples: Vec<(Vec3, f64)>, apart: f64) -> Vec<(Vec3, f64)> {
    samples.sort_by(|x, y| y.1.total_cmp(&x.1));
    let mut out: Vec<(Vec3, f64)> = Vec::new();
    for s in samples {
        if out.len() == WORST {
            break;
        }
        if out.iter().all(|o| (o.0 - s.0).norm() >= apart) {
            out.push(s);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(z: f64, size: f64) -> TriMesh {
        let points = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
            .map(|(x, y)| Vec3::new(x * size, y * size, z))
            .to_vec();
        TriMesh {
            points,
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            tags: vec![],
        }
    }

    #[test]
    fn parallel_squares() {
        let d = two_sided(
            &square(0.0, 1.0),
            &square(0.5, 1.0),
            &DistanceOptions { samples: 500 },
            None,
        );
        assert!(
            (d.rms - 0.5).abs() < 1e-12
                && (d.max - 0.5).abs() < 1e-12
                && (d.p95 - 0.5).abs() < 1e-12
        );
        assert_eq!(d.a_to_b.samples, 500);
    }

    #[test]
    fn both_sides_count_and_ignored_places_do_not() {
        let (small, large) = (square(0.0, 1.0), square(0.0, 2.0));
        let d = two_sided(&small, &large, &DistanceOptions { samples: 4000 }, None);
        assert!(d.a_to_b.max < 1e-12);
        assert!((d.b_to_a.max - 2f64.sqrt()).abs() < 0.05, "{d:?}");
        assert!((d.worst[0].1 - d.max).abs() < 1e-12);
        let ignore = |p: &Vec3| p.x > 1.0 || p.y > 1.0;
        let d = two_sided(
            &small,
            &large,
            &DistanceOptions { samples: 4000 },
            Some(&ignore),
        );
        assert!(d.max < 1e-12);
    }

    #[test]
    fn samples_are_even() {
        let samples = sample_surface(&square(0.0, 1.0), 1000);
        let left = samples.iter().filter(|(p, _)| p.x < 0.5).count();
        assert!((480..=520).contains(&left), "{left}");
        assert!(sample_surface(&TriMesh::default(), 10).is_empty());
    }
}
