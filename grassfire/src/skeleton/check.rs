//! Checks of skeletons, above all of those drawn elsewhere.

use std::collections::HashMap;

use super::edges::edge;
use super::{Skeleton, SkeletonError};
use crate::Vec3;

/// Checks what the later stages rely on; the first offender is named by its index.
///
/// 1. One finite point and one radius each; a radius is positive, or NaN for "not given" (see [`crate::radii::map`]).
/// 2. Quads and beams name existing points, none twice.
/// 3. No two quads over the same four points, no doubled beam, no beam on the edge of a quad.
/// 4. No isolated points.
///
/// # Errors
/// One [`SkeletonError`] for the first offender of each kind in this order.
pub fn check(skeleton: &Skeleton) -> Result<(), SkeletonError> {
    if skeleton.quads.is_empty() && skeleton.beams.is_empty() {
        return Err(SkeletonError::Empty("the skeleton"));
    }
    check_points(&skeleton.points, &skeleton.radii, true)?;
    let n = skeleton.points.len();
    check_cells("quad", &skeleton.quads, n)?;
    check_cells("beam", &skeleton.beams, n)?;
    check_duplicates(skeleton)?;
    let mut used = vec![false; n];
    for &v in skeleton
        .quads
        .iter()
        .flatten()
        .chain(skeleton.beams.iter().flatten())
    {
        used[v as usize] = true;
    }
    match used.iter().position(|u| !u) {
        Some(point) => Err(SkeletonError::Isolated {
            point,
            count: used.iter().filter(|u| !**u).count(),
        }),
        None => Ok(()),
    }
}

/// Finite points, one radius each, positive (or NaN where `missing` is allowed).
pub(crate) fn check_points(
    points: &[Vec3],
    radii: &[f64],
    missing: bool,
) -> Result<(), SkeletonError> {
    if radii.len() != points.len() {
        return Err(SkeletonError::RadiiCount {
            radii: radii.len(),
            points: points.len(),
        });
    }
    if let Some(point) = points.iter().position(|p| !p.iter().all(|x| x.is_finite())) {
        return Err(SkeletonError::BadPoint { point });
    }
    let good = |r: f64| r > 0.0 && r.is_finite() || missing && r.is_nan();
    match radii.iter().position(|&r| !good(r)) {
        Some(point) => Err(SkeletonError::BadRadius {
            point,
            value: radii[point],
        }),
        None => Ok(()),
    }
}

/// Existing points, none twice within a cell.
pub(crate) fn check_cells<C: AsRef<[u32]>>(
    what: &'static str,
    cells: &[C],
    points: usize,
) -> Result<(), SkeletonError> {
    for (index, cell) in cells.iter().enumerate() {
        let v = cell.as_ref();
        if let Some(&point) = v.iter().find(|&&p| p as usize >= points) {
            return Err(SkeletonError::MissingPoint {
                what,
                index,
                point,
                points,
            });
        }
        if let Some(k) = (0..v.len()).find(|&k| v[k + 1..].contains(&v[k])) {
            return Err(SkeletonError::Degenerate {
                what,
                index,
                point: v[k],
            });
        }
    }
    Ok(())
}

fn check_duplicates(skeleton: &Skeleton) -> Result<(), SkeletonError> {
    let mut quads: HashMap<[u32; 4], usize> = HashMap::new();
    let mut edges: HashMap<[u32; 2], (&'static str, usize)> = HashMap::new();
    for (index, q) in skeleton.quads.iter().enumerate() {
        let mut key = *q;
        key.sort_unstable();
        if let Some(&other) = quads.get(&key) {
            return Err(SkeletonError::Duplicate {
                what: "quad",
                index,
                other_what: "quad",
                other,
            });
        }
        quads.insert(key, index);
        for k in 0..4 {
            edges
                .entry(edge(q[k], q[(k + 1) % 4]))
                .or_insert(("quad", index));
        }
    }
    for (index, b) in skeleton.beams.iter().enumerate() {
        if let Some(&(other_what, other)) = edges.get(&edge(b[0], b[1])) {
            return Err(SkeletonError::Duplicate {
                what: "beam",
                index,
                other_what,
                other,
            });
        }
        edges.insert(edge(b[0], b[1]), ("beam", index));
    }
    Ok(())
}
