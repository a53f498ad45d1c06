//! Steps that make nothing worse.

use super::round::Solver;
use super::tangles::Tangles;
use crate::Vec3;

/// Attempts to shorten a step.
const ATTEMPTS: u32 = 10;

/// Moves from `points` towards `wanted`, less wherever that would create an intersection or deepen a fold; none when
/// even short steps do. `found` are the tangles of `points`.
///
/// Where steps had to be shortened twice, the fairness of the next rounds doubles.
pub(super) fn guarded_step(
    solver: &mut Solver,
    points: &[Vec3],
    wanted: &[Vec3],
    found: &Tangles,
) -> Option<(Vec<Vec3>, Tangles)> {
    let mut share = vec![1.0; points.len()];
    for attempt in 0..ATTEMPTS {
        let trial: Vec<Vec3> = points
            .iter()
            .zip(wanted)
            .zip(&share)
            .map(|((p, w), s)| p + *s * (w - p))
            .collect();
        let tangles = Tangles::of(solver, &trial);
        let worse = tangles.worse_than(found);
        if worse.is_empty() {
            return Some((trial, tangles));
        }
        let outer = 1 + attempt / 3;
        for (ring, factor) in [(0, 0.5), (outer, 0.7)] {
            let near = tangles.control_points(solver, &worse, ring);
            for (s, _) in share.iter_mut().zip(&near).filter(|(_, near)| **near) {
                *s = if attempt > 4 { 0.0 } else { *s * factor };
            }
        }
        if attempt == 1 {
            let near = tangles.control_points(solver, &worse, 1);
            let factors = solver.fairness.iter_mut().zip(&near);
            factors
                .filter(|(_, near)| **near)
                .for_each(|(f, _)| *f = (*f * 2.0).min(200.0));
        }
    }
    None
}
