//! The proposal's field after a list of edits.

use rayon::prelude::*;

use super::draft::EditedSkeleton;
use super::envelope::{Hull, depths};
use super::grow::{MARGIN, grow, padded};
use crate::Vec3;
use crate::mesh::TriMesh;
use crate::voxel::VoxelGrid;

/// `field` with the material of the edited skeleton.
///
/// 1. Where quads and beams are as they were, the surface moves outward by the growth of their radii ([`grow`]).
/// 2. The material of quads and beams that were moved or deleted goes. It is what lies deeper in their balls than in those that
///    stay; of it the balls of the neighbours that stay are kept, so that these end round, as rims do.
/// 3. The balls of quads and beams that were moved or made are added, with the radii of their points, and so are fillings.
///
/// `field` is a signed distance, mm, positive inside, and `surface` its zero surface; where nothing was edited the result is
/// the field itself. The grid grows as far as new material reaches; two more values a voxel are needed meanwhile. Does not
/// depend on the number of threads.
pub fn material(
    field: &VoxelGrid<f32>,
    surface: &TriMesh,
    edited: &EditedSkeleton,
) -> VoxelGrid<f32> {
    let (cells, growth) = growing(edited);
    let grown = grow(field, surface, &cells, &growth);
    let radii = &edited.skeleton.radii;
    let mut fresh = edited.hulls(true, radii);
    fresh.extend(&edited.filling);
    if fresh.is_empty() && edited.gone.is_empty() {
        return grown;
    }
    let reach = MARGIN * grown.spacing;
    let mut out = roomy(&grown, &fresh, reach);
    let thickest = edited.gone.iter().flatten().map(|b| b.radius);
    let around = reach + thickest.fold(0.0, f64::max);
    let gone = depths(&edited.gone, &out, around);
    let stays = depths(&edited.hulls(false, radii), &out, around);
    let pairs = out.values.par_iter_mut().zip(gone.par_iter().zip(&stays));
    pairs.for_each(|(value, (&gone, &stays))| {
        if gone > f32::NEG_INFINITY {
            let own = stays + (stays - gone).max(0.0);
            *value = value.min(own.max(-reach as f32));
        }
    });
    let added = depths(&fresh, &out, reach);
    let pairs = out.values.par_iter_mut().zip(&added);
    pairs.for_each(|(value, &added)| *value = value.max(added));
    out
}

/// What carries growth, as [`grow`] wants it: quads and beams that are as they were, and those that are gone with none.
fn growing(edited: &EditedSkeleton) -> (TriMesh, Vec<f64>) {
    let mut cells = TriMesh::default();
    let mut growth = Vec::new();
    let mut add = |hull: &Hull, grown: [f64; 3]| {
        let first = cells.points.len() as u32;
        cells.points.extend(hull.iter().map(|b| b.centre));
        growth.extend(grown);
        // A triangle without area has its last two corners equal.
        let last = if hull[1] == hull[2] {
            first + 1
        } else {
            first + 2
        };
        cells.triangles.push([first, first + 1, last]);
    };
    let before = edited.hulls(false, &edited.base);
    let after = edited.hulls(false, &edited.skeleton.radii);
    for (before, after) in before.iter().zip(&after) {
        add(
            before,
            [0, 1, 2].map(|k| after[k].radius - before[k].radius),
        );
    }
    edited.gone.iter().for_each(|hull| add(hull, [0.0; 3]));
    (cells, growth)
}

/// The same field on a grid with room for hulls.
fn roomy(field: &VoxelGrid<f32>, hulls: &[Hull], reach: f64) -> VoxelGrid<f32> {
    let mut low = Vec3::zeros();
    let mut high = Vec3::zeros();
    let [nx, ny, nz] = field.dims.map(|n| n.saturating_sub(1));
    let end = field.centre(nx, ny, nz);
    for ball in hulls.iter().flatten() {
        let r = Vec3::repeat(ball.radius + reach);
        low = low.sup(&(field.origin - (ball.centre - r)));
        high = high.sup(&(ball.centre + r - end));
    }
    let voxels = |v: Vec3| [v.x, v.y, v.z].map(|x| (x / field.spacing).ceil() as usize);
    padded(field, voxels(low), voxels(high))
}

#[cfg(test)]
mod tests {
    use super::super::fixtures::{run, tee};
    use super::super::list::Edit;
    use super::super::region::Region;
    use super::*;
    use crate::skeleton::Skeleton;

    /// The solid of the balls of [`tee`] on voxels of 1 mm, its surface and skeleton.
    fn solid() -> (VoxelGrid<f32>, TriMesh, Skeleton) {
        let skeleton = tee();
        let whole = run(&skeleton, &[]);
        let mut field = VoxelGrid::filled(Vec3::new(-6.0, -6.0, -6.0), 1.0, [53, 43, 33], 0_f32);
        field.values = depths(&whole.hulls(false, &skeleton.radii), &field, 99.0);
        (field, TriMesh::default(), skeleton)
    }

    fn edited(within: Option<Region>, edit: Edit) -> (VoxelGrid<f32>, VoxelGrid<f32>) {
        let (field, surface, skeleton) = solid();
        let after = material(
            &field,
            &surface,
            &run(&skeleton, &[Edit { within, ..edit }]),
        );
        (field, after)
    }

    const WEB: Option<Region> = Some(Region::Sheet([20.0, 15.0, 9.0]));

    #[test]
    fn a_moved_part_is_the_part_moved() {
        let edit = Edit {
            r#move: Some([5.0, -9.0, 30.0]),
            ..Edit::default()
        };
        let (before, after) = edited(None, edit);
        for v in 0..before.values.len() {
            let [i, j, k] = before.ijk(v);
            let (p, old) = (before.centre(i, j, k), before.values[v]);
            let moved = after.sample(&(p + Vec3::new(5.0, -9.0, 30.0)));
            // Only values near the surface are those of the field.
            assert!(
                old < -2.0 || (moved - f64::from(old)).abs() < 1e-4,
                "{p} {old} {moved}"
            );
        }
        // Nothing is left where it was: under the moved base.
        assert!(after.sample(&Vec3::new(30.0, 15.0, 0.0)) < 0.0);
    }

    #[test]
    fn what_stays_ends_round_where_something_was_deleted() {
        let edit = Edit {
            delete: true,
            ..Edit::default()
        };
        let (before, after) = edited(WEB, edit.clone());
        let at = |x: f64, y: f64, z: f64| after.sample(&Vec3::new(x, y, z));
        assert!(at(20.0, 15.0, 10.0) < -1.0 && at(20.0, 15.0, 4.0) < -1.0);
        // The base is whole: its wall ends 2 mm above it, also under the web.
        assert!(at(20.0, 15.0, 1.5) > 0.0 && at(20.0, 15.0, 2.5) < 0.0);
        assert_eq!(
            at(5.0, 15.0, 2.0),
            before.sample(&Vec3::new(5.0, 15.0, 2.0))
        );
        // The web without its lower half ends 2 mm below its new rim.
        let lower = Region::Box {
            min: [-1.0, -1.0, -1.0],
            max: [41.0, 31.0, 11.0],
        };
        let (_, after) = edited(Some(lower), edit);
        let at = |z: f64| after.sample(&Vec3::new(20.0, 15.0, z));
        assert!(
            at(8.5) > 0.0 && at(7.5) < 0.0 && at(0.0) < 0.0,
            "{} {}",
            at(8.5),
            at(7.5)
        );
    }

    #[test]
    fn copies_are_added() {
        let edit = Edit {
            duplicate: Some([12.0, 0.0, 0.0]),
            ..Edit::default()
        };
        let (before, after) = edited(WEB, edit);
        for z in [5.0, 15.0, 21.0] {
            for x in [20.0, 32.0] {
                let depth = after.sample(&Vec3::new(x, 15.0, z));
                let old = before.sample(&Vec3::new(20.0, 15.0, z));
                assert!((depth - old).abs() < 1e-4, "{x} {z} {depth} {old}");
            }
        }
    }
}
