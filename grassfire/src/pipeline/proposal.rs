//! The field of a finished optimization whose surface is the part, with the volume of its full voxels.

use crate::Vec3;
use crate::fe::components;
use crate::monitor::Monitor;
use crate::remesh::{RemeshError, RemeshOptions, iso_surface};
use crate::topopt::{DESIGN, Problem, Smooth, spread};
use crate::voxel::VoxelGrid;

/// Value at the surface.
pub(super) const ISO: f64 = 0.5;
/// The field is moved by this at most: half of its range.
const REACH: f64 = 0.5;
/// Volumes closer than this share are equal.
const EQUAL: f64 = 1e-3;
/// Surfaces made at most.
const STEPS: usize = 12;

/// The smooth field of an optimization, moved so that its surface encloses as much as the `full` voxels.
///
/// 1. Thin walls of the smooth field do not have the volume of their voxels: one number is added to the field of the design
///    voxels, found by the rule of false position (Illinois) on the volume of the surface.
/// 2. Pieces without full voxels are capped at `dropped`. Values end at 0 and 1.
///
/// # Errors
/// As [`iso_surface`].
pub(super) fn field(
    problem: &Problem,
    smooth: &Smooth,
    full: &VoxelGrid<f32>,
    dropped: f32,
    monitor: &Monitor,
) -> Result<VoxelGrid<f32>, RemeshError> {
    let (split, h) = (smooth.split, problem.h / smooth.split as f64);
    let labels = spread(problem, &problem.labels, split);
    let full = VoxelGrid {
        origin: problem.origin + Vec3::repeat(h / 2.0),
        spacing: h,
        dims: problem.dims.map(|n| n * split),
        values: spread(problem, &full.values, split),
    };
    let moved = |by: f64| {
        let value = |(&v, &label): (&f32, &u8)| {
            let by = if label == DESIGN { by as f32 } else { 0.0 };
            (v + by).clamp(0.0, 1.0)
        };
        let values: Vec<f32> = smooth.values.iter().zip(&labels).map(value).collect();
        VoxelGrid {
            values: kept(&values, &full, dropped),
            ..full
        }
    };
    let wanted = full.values.iter().map(|&v| f64::from(v)).sum::<f64>() * h.powi(3);
    let excess = |by: f64| -> Result<f64, RemeshError> {
        match iso_surface(&moved(by), ISO, &RemeshOptions::default(), monitor) {
            Ok(surface) => Ok(surface.volume() / wanted - 1.0),
            // Moved so far that nothing is left.
            Err(RemeshError::NoMaterial { .. } | RemeshError::Empty) => Ok(-1.0),
            Err(error) => Err(error),
        }
    };
    Ok(moved(root(excess)?))
}

/// Where the increasing function `excess` is nearly 0, within [`REACH`]; the nearer end where it is nowhere.
fn root(excess: impl Fn(f64) -> Result<f64, RemeshError>) -> Result<f64, RemeshError> {
    let here = excess(0.0)?;
    if here.abs() < EQUAL {
        return Ok(0.0);
    }
    let far = -REACH * here.signum();
    let (mut a, mut b) = ((0.0, here), (far, excess(far)?));
    if a.1 * b.1 > 0.0 {
        return Ok(b.0);
    }
    for _ in 0..STEPS {
        let by = (a.0 * b.1 - b.0 * a.1) / (b.1 - a.1);
        let found = excess(by)?;
        if found.abs() < EQUAL {
            return Ok(by);
        }
        if found * b.1 < 0.0 {
            a = b;
        } else {
            // The same end moved twice: the other one counts half.
            a.1 /= 2.0;
        }
        b = (by, found);
    }
    Ok(b.0)
}

/// `values` with those of pieces above [`ISO`] that hold no full voxel at most `dropped`.
pub(super) fn kept(values: &[f32], full: &VoxelGrid<f32>, dropped: f32) -> Vec<f32> {
    let above: Vec<bool> = values.iter().map(|&r| f64::from(r) > ISO).collect();
    let (labels, pieces) = components(full.dims, &above);
    let mut keep = vec![false; pieces.len()];
    for (v, _) in full.values.iter().enumerate().filter(|(_, f)| **f > 0.5) {
        if let Some(keep) = keep.get_mut(labels[v] as usize) {
            *keep = true;
        }
    }
    let part = |(v, &r): (usize, &f32)| match keep.get(labels[v] as usize) {
        Some(false) => r.min(dropped),
        _ => r,
    };
    values.iter().enumerate().map(part).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::topopt::{FROZEN, OUTSIDE};

    /// A slanting wall of one voxel in a box of design voxels.
    fn wall() -> (Problem, Smooth, VoxelGrid<f32>) {
        let dims = [24, 24, 12];
        let n: usize = dims.iter().product();
        let problem = Problem {
            h: 1.0,
            dims,
            labels: vec![DESIGN; n],
            ..Problem::default()
        };
        let off = |v: usize| {
            let at = problem.centre(v);
            (at.y - 6.0 - 0.4 * at.x).abs() / 1.16_f64.sqrt()
        };
        let smooth = Smooth {
            split: 1,
            values: (0..n).map(|v| (1.0 - 0.9 * off(v)) as f32).collect(),
        };
        let full = VoxelGrid {
            origin: Vec3::repeat(0.5),
            spacing: 1.0,
            dims,
            values: (0..n).map(|v| f32::from(u8::from(off(v) < 0.65))).collect(),
        };
        (problem, smooth, full)
    }

    #[test]
    fn a_wall_of_one_voxel_keeps_the_volume_of_its_voxels() {
        let (problem, smooth, full) = wall();
        let volume = |grid: &VoxelGrid<f32>| {
            let surface = iso_surface(grid, ISO, &RemeshOptions::default(), &Monitor::default());
            surface.expect("a surface").volume()
        };
        let wanted: f64 = full.values.iter().map(|&v| f64::from(v)).sum();
        let as_it_is = VoxelGrid {
            values: smooth.values.iter().map(|v| v.clamp(0.0, 1.0)).collect(),
            ..full.clone()
        };
        assert!(volume(&as_it_is) < 0.95 * wanted, "{}", volume(&as_it_is));
        let field = field(&problem, &smooth, &full, 0.0, &Monitor::default()).expect("a field");
        assert!((volume(&field) / wanted - 1.0).abs() < 2e-3);
        assert!(field.values.iter().all(|v| (0.0..=1.0).contains(v)));
    }

    #[test]
    fn frozen_and_outer_voxels_stay_as_they_are() {
        let (mut problem, mut smooth, full) = wall();
        for v in 0..problem.labels.len() {
            if problem.at(v)[0] >= 20 {
                let frozen = full.values[v] > 0.5;
                problem.labels[v] = if frozen { FROZEN } else { OUTSIDE };
                smooth.values[v] = full.values[v];
            }
        }
        let field = field(&problem, &smooth, &full, 0.0, &Monitor::default()).expect("a field");
        let same = |v: usize| problem.labels[v] == DESIGN || field.values[v] == full.values[v];
        assert!((0..full.values.len()).all(same));
    }

    #[test]
    fn a_field_that_would_vanish_when_moved_farthest_is_moved_as_far_as_it_must() {
        let (problem, mut smooth, full) = wall();
        smooth
            .values
            .iter_mut()
            .for_each(|v| *v = v.clamp(0.0, 1.0));
        let thin = VoxelGrid {
            values: full
                .values
                .iter()
                .enumerate()
                .map(|(v, &f)| if problem.at(v)[2] < 8 { f } else { 0.0 })
                .collect(),
            ..full.clone()
        };
        let wanted: f64 = thin.values.iter().map(|&v| f64::from(v)).sum();
        let field = field(&problem, &smooth, &thin, 0.0, &Monitor::default()).expect("a field");
        let surface = iso_surface(&field, ISO, &RemeshOptions::default(), &Monitor::default());
        let volume = surface.expect("a surface").volume();
        assert!((volume / wanted - 1.0).abs() < 0.01, "{volume} {wanted}");
    }

    #[test]
    fn a_volume_out_of_reach_gives_the_nearer_end() {
        assert_eq!(root(|by| Ok(by + 2.0)).ok(), Some(-REACH));
        assert_eq!(root(|by| Ok(by - 2.0)).ok(), Some(REACH));
        let found = root(|by| Ok((by - 0.3).powi(3) + (by - 0.3))).expect("a root");
        assert!((found - 0.3).abs() < 1.5e-3);
    }
}
