//! Radii: medial radii mapped onto the skeleton and smoothed.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::medial::MedialMesh;
use crate::skeleton::{PointGrid, Skeleton};

/// Spheres that count for one skeleton point.
const NEAREST: usize = 8;

/// Options of the radii.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RadiiOptions {
    /// Smoothing passes; 0 keeps the mapped radii.
    pub smoothing: usize,
}

impl Default for RadiiOptions {
    fn default() -> Self {
        Self { smoothing: 2 }
    }
}

/// Both sets of radii, so that an edit can be undone and re-applied; mm, one a point.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RadiiLayers {
    /// As mapped from the medial axis.
    pub mapped: Vec<f64>,
    /// After smoothing.
    pub smoothed: Vec<f64>,
}

/// Fills missing radii (NaN, infinite or none given) from the medial spheres; given radii stay.
///
/// A missing radius is the mean over the 8 nearest spheres, weighted by `r^2 / (d^2 + (r/10)^2)`: near spheres count
/// most, and large ones more than those of spurs. Does nothing when `medial` has no spheres. Linear in the points.
pub fn map(medial: &MedialMesh, skeleton: &mut Skeleton) {
    skeleton.radii.resize(skeleton.points.len(), f64::NAN);
    let spheres: Vec<usize> = (0..medial.points.len().min(medial.radii.len()))
        .filter(|&i| {
            medial.radii[i] > 0.0
                && medial.radii[i].is_finite()
                && medial.points[i].iter().all(|x| x.is_finite())
        })
        .collect();
    if spheres.is_empty() || skeleton.radii.iter().all(|r| r.is_finite()) {
        return;
    }
    let grid = PointGrid::new(spheres.iter().map(|&i| medial.points[i]).collect());
    for (p, r) in skeleton.points.iter().zip(&mut skeleton.radii) {
        if r.is_finite() || !p.iter().all(|x| x.is_finite()) {
            continue;
        }
        let (mut sum, mut weights) = (0.0, 0.0);
        for (d2, i) in grid.k_nearest(p, NEAREST, |_| true) {
            let radius = medial.radii[spheres[i as usize]];
            let w = radius * radius / (d2 + 0.01 * radius * radius);
            sum += w * radius;
            weights += w;
        }
        *r = sum / weights;
    }
}

/// Laplacian smoothing of the radii over quad edges and beams: half-way to the mean of the neighbours, `passes` times
/// (0 is allowed). Positions stay. Returns the radii before and after.
pub fn smooth(skeleton: &mut Skeleton, passes: usize) -> RadiiLayers {
    let mapped = skeleton.radii.clone();
    let n = skeleton.points.len().min(skeleton.radii.len());
    let mut edges: Vec<[u32; 2]> = skeleton.beams.clone();
    for q in &skeleton.quads {
        edges.extend((0..4).map(|k| [q[k], q[(k + 1) % 4]]));
    }
    for e in &mut edges {
        e.sort_unstable();
    }
    edges.retain(|e| (e[1] as usize) < n && e[0] != e[1]);
    edges.sort_unstable();
    edges.dedup();
    let mut valence = vec![0.0; n];
    for e in &edges {
        valence[e[0] as usize] += 1.0;
        valence[e[1] as usize] += 1.0;
    }
    for _ in 0..passes {
        let mut sum = vec![0.0; n];
        for e in &edges {
            sum[e[0] as usize] += skeleton.radii[e[1] as usize];
            sum[e[1] as usize] += skeleton.radii[e[0] as usize];
        }
        for v in (0..n).filter(|&v| valence[v] > 0.0) {
            skeleton.radii[v] = 0.5 * skeleton.radii[v] + 0.5 * sum[v] / valence[v];
        }
    }
    RadiiLayers {
        mapped,
        smoothed: skeleton.radii.clone(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Vec3;

    fn line(radii: Vec<f64>) -> Skeleton {
        let n = radii.len() as u32;
        Skeleton {
            points: (0..n).map(|i| Vec3::new(f64::from(i), 0.0, 0.0)).collect(),
            radii,
            quads: Vec::new(),
            beams: (1..n).map(|i| [i - 1, i]).collect(),
        }
    }

    #[test]
    fn only_missing_radii_are_mapped() {
        let medial = MedialMesh {
            points: (0..20)
                .map(|i| Vec3::new(f64::from(i) / 5.0, 0.1, 0.0))
                .collect(),
            radii: vec![2.0; 20],
            ..MedialMesh::default()
        };
        let mut skeleton = line(vec![1.0, f64::NAN, f64::NAN]);
        map(&medial, &mut skeleton);
        assert_eq!(skeleton.radii[0], 1.0);
        assert!((skeleton.radii[1] - 2.0).abs() < 1e-12 && (skeleton.radii[2] - 2.0).abs() < 1e-12);
    }

    #[test]
    fn smoothing_keeps_constants_and_flattens_bumps() {
        let mut flat = line(vec![3.0; 5]);
        assert_eq!(smooth(&mut flat, 4).smoothed, vec![3.0; 5]);
        let mut bump = line(vec![1.0, 1.0, 4.0, 1.0, 1.0]);
        assert_eq!(smooth(&mut bump, 0).smoothed[2], 4.0);
        let layers = smooth(&mut bump, 3);
        assert_eq!(layers.mapped[2], 4.0);
        assert!(layers.smoothed[2] < 2.5 && layers.smoothed[0] > 1.0);
    }
}
