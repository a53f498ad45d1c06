//! Draft: walls of a voxel field widen towards the parting.

use super::repair::for_each_line;
use crate::voxel::VoxelGrid;

/// Values of a line that differ by less than this many voxels are as high: an upright wall of voxels wavers by as much.
const LEVEL: f64 = 0.5;

/// Widens every wall by `tangent` a length towards the height where the mould parts on it: the height `parting`, or what of the
/// wall is nearest to that. So a low foot is not extended up to the parting plane.
pub(super) fn taper(field: &mut VoxelGrid<f32>, tangent: f64, parting: f64) {
    let step = (tangent * field.spacing) as f32;
    // Beyond the exact band values say only "far": growth from there would make material of nothing.
    let far = -2.5 * field.spacing as f32;
    let level = (LEVEL * field.spacing) as f32;
    let wanted = ((parting - field.origin.z) / field.spacing)
        .round()
        .max(0.0) as usize;
    for_each_line(field, |line| {
        let Some([first, last]) = widest(line, level) else {
            return;
        };
        let middle = wanted.clamp(first, last);
        let before = line.to_vec();
        for k in 1..=middle {
            let grown = line[k - 1] + step;
            if line[k - 1] > far {
                line[k] = line[k].max(grown);
            }
        }
        for k in (middle..line.len() - 1).rev() {
            let grown = line[k + 1] + step;
            if line[k + 1] > far {
                line[k] = line[k].max(grown);
            }
        }
        // No wall widens by more than draft over its whole height, and what is far from all walls stays empty: else a film would
        // grow over the mouth of a core.
        let near = |f: &f32| *f > far;
        let most = step * before.iter().filter(|f| near(f)).count() as f32;
        for (value, old) in line.iter_mut().zip(before) {
            *value = value.min(old + most);
        }
    });
}

/// First and last place of the line with nearly its largest value: along an upright wall, all of its height.
fn widest(line: &[f32], level: f32) -> Option<[usize; 2]> {
    let most = line.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let high = |v: f32| v >= most - level;
    let mut values = line.iter();
    let first = values.clone().position(|v| high(*v))?;
    Some([first, values.rposition(|v| high(*v))?])
}

#[cfg(test)]
mod tests {
    use super::super::repair::multiple;
    use super::*;
    use crate::Vec3;

    /// A wall 30 mm high with a foot of 4 mm beside it, on voxels of 1 mm.
    fn wall_with_foot() -> VoxelGrid<f32> {
        let mut field = VoxelGrid::filled(Vec3::zeros(), 1.0, [30, 3, 40], -9.0_f32);
        for v in 0..field.values.len() {
            let [i, _, k] = field.ijk(v);
            let (x, z) = (i as f32, k as f32);
            let slab =
                |[x0, x1, z0, z1]: [f32; 4]| (x - x0).min(x1 - x).min(z - z0).min(z1 - z).min(2.0);
            let wall = slab([4.0, 10.0, 4.0, 34.0]);
            field.values[v] = wall.max(slab([4.0, 24.0, 4.0, 8.0]));
        }
        field
    }

    /// Draft ran up to one parting plane for the whole part: a low foot beside a high wall was extended to it, and a bracket
    /// nearly doubled.
    #[test]
    fn a_low_foot_is_not_extended_up_to_the_parting_plane() {
        let before = wall_with_foot();
        let mut field = before.clone();
        taper(&mut field, 0.02, 20.0);
        let inside = |field: &VoxelGrid<f32>, i: usize| {
            (0..40)
                .filter(|&k| field.values[field.index(i, 1, k)] > 0.0)
                .count()
        };
        assert_eq!(inside(&field, 18), inside(&before, 18), "the foot grew");
        // The wall is widest at the parting plane, 17 steps from where its side begins.
        let at = |k: usize| f64::from(field.values[field.index(3, 1, k)]);
        assert!((at(20) + 1.0 - 0.02 * 17.0).abs() < 1e-5, "{}", at(20));
        let up = (4..20).all(|k| at(k + 1) > at(k));
        let down = (20..34).all(|k| at(k + 1) < at(k));
        assert!(up && down);
        assert_eq!(multiple(&field), 0);
    }

    /// Draft put a film over the mouths of a bore that a core makes: a plate's holes were closed by it.
    #[test]
    fn no_film_grows_over_the_mouth_of_a_core() {
        // A plate of 8 mm, drawn along its length; its hole counts as material, the air above it does not.
        let mut field = VoxelGrid::filled(Vec3::zeros(), 1.0, [12, 3, 60], -9.0_f32);
        for v in 0..field.values.len() {
            let [i, _, k] = field.ijk(v);
            let deep = 4.0 - (i as f32 - 5.5).abs();
            let hole = 8.0 - (k as f32 - 30.0).abs();
            let beside = if deep < 0.0 { -hole.max(0.0) } else { 0.0 };
            field.values[v] = deep.min(beside + deep.min(0.5)).max(-3.0);
        }
        let before = field.clone();
        taper(&mut field, 0.02, 30.0);
        let at = |field: &VoxelGrid<f32>, k: usize| field.values[field.index(1, 1, k)];
        assert!(at(&before, 10) > -1.0 && at(&before, 30) < -2.0);
        // The plate's face rises by its draft, the mouth stays open.
        assert!(at(&field, 20) > at(&before, 20) + 0.2, "{}", at(&field, 20));
        assert!(at(&field, 30) < -1.5, "{}", at(&field, 30));
    }
}
