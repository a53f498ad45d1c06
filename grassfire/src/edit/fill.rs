//! Fill: the room between two sheets that face each other becomes solid.

use super::bridge::Between;
use super::draft::EditedSkeleton;
use super::envelope::{Ball, Hull};
use super::error::Refusal;
use super::grow::{cells_of, interpolate};
use super::members::{Member, sheet_at};
use super::region::Selection;
use crate::Vec3;
use crate::mesh::{Bvh, TriMesh};
use crate::skeleton::Skeleton;

/// Sheets face each other where the way across leaves the normal by less than this, degrees.
const FACING: f64 = 60.0;
/// Layers lie no farther apart than this many radii: what stays between them is no deeper than 3 % of the radius.
const LAYER: f64 = 0.5;

/// Fills between the sheets at two places.
///
/// 1. Every quad of `from` with all points held by `within` whose corners have their nearest places on `to` ahead, within 60
///    degrees of its normal, is filled.
/// 2. The filling is layers of such quads on the way across, half a radius apart at most; radii run from those of the one sheet to
///    those of the other. So it ends where the sheets do.
///
/// It is material only. The skeleton of the solid with it is found anew, and later edits of the list do not see it.
///
/// # Errors
/// [`Refusal::Nothing`] without a sheet at a place, [`Refusal::Meets`] when it is one, [`Refusal::Beside`] when they do not face
/// each other.
pub(super) fn fill(
    draft: &mut EditedSkeleton,
    within: &Selection,
    between: &Between,
) -> Result<(), Refusal> {
    let (near, far) = (Vec3::from(between.from), Vec3::from(between.to));
    let from = sheet_at(&draft.skeleton, &near)?;
    let to = sheet_at(&draft.skeleton, &far)?;
    if from.quads == to.quads {
        return Err(Refusal::Meets {
            place: from.nearest,
        });
    }
    let skeleton = &draft.skeleton;
    let across = Across::new(skeleton, &to);
    let held = |q: &[u32; 4]| q.iter().all(|&v| within.points[v as usize]);
    let quads = from.quads.iter().map(|&q| skeleton.quads[q]).filter(held);
    let filling: Vec<Hull> = quads.flat_map(|q| across.layers(skeleton, &q)).collect();
    if filling.is_empty() {
        return Err(Refusal::Beside {
            distance: (from.nearest - to.nearest).norm(),
            place: from.nearest,
        });
    }
    draft.filling.extend(filling);
    Ok(())
}

/// The sheet across.
struct Across {
    cells: TriMesh,
    places: Bvh,
    radii: Vec<f64>,
}

impl Across {
    fn new(skeleton: &Skeleton, to: &Member) -> Self {
        let cells = cells_of(&Skeleton {
            points: skeleton.points.clone(),
            quads: to.quads.iter().map(|&q| skeleton.quads[q]).collect(),
            ..Skeleton::default()
        });
        Self {
            places: Bvh::new(&cells),
            radii: skeleton.radii.clone(),
            cells,
        }
    }

    /// The place and radius across from a point.
    fn opposite(&self, p: &Vec3) -> Option<Ball> {
        let nearest = self.places.nearest(p, f64::INFINITY)?;
        let corners = self.cells.triangles[nearest.triangle as usize];
        Some(Ball {
            centre: nearest.point,
            radius: interpolate(&self.cells, corners, &nearest.point, &self.radii),
        })
    }

    /// The layers over a quad; none when it does not face the sheet.
    fn layers(&self, skeleton: &Skeleton, quad: &[u32; 4]) -> Vec<Hull> {
        let p = quad.map(|v| skeleton.points[v as usize]);
        let normal = (p[2] - p[0]).cross(&(p[3] - p[1]));
        let starts = [0, 1, 2, 3].map(|k| Ball {
            centre: p[k],
            radius: skeleton.radii[quad[k] as usize],
        });
        let ends: Vec<Ball> = starts
            .iter()
            .filter_map(|b| self.opposite(&b.centre))
            .collect();
        let limit = FACING.to_radians().cos() * normal.norm();
        let faces = |(a, b): (&Ball, &Ball)| {
            let way = b.centre - a.centre;
            way.dot(&normal).abs() > limit * way.norm()
        };
        // Corners on a common seam are across from themselves: they face what the others do.
        let apart = |(a, b): &(&Ball, &Ball)| (b.centre - a.centre).norm() > a.radius;
        let mut ways = starts.iter().zip(&ends).filter(apart).peekable();
        if ends.len() < 4 || ways.peek().is_none() || !ways.all(faces) {
            return Vec::new();
        }
        let pairs = || starts.iter().zip(&ends);
        let longest = pairs()
            .map(|(a, b)| (b.centre - a.centre).norm())
            .fold(0.0, f64::max);
        let thinnest = starts
            .iter()
            .chain(&ends)
            .map(|b| b.radius)
            .fold(f64::INFINITY, f64::min);
        let count = (longest / (LAYER * thinnest)).ceil().max(2.0) as usize;
        let layer = |n: usize| {
            let t = n as f64 / count as f64;
            let ball = |k: usize| Ball {
                centre: starts[k].centre + (ends[k].centre - starts[k].centre) * t,
                radius: starts[k].radius + (ends[k].radius - starts[k].radius) * t,
            };
            [[ball(0), ball(1), ball(2)], [ball(0), ball(2), ball(3)]]
        };
        (1..count).flat_map(layer).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::fixtures::{run, tee};
    use super::super::list::{Edit, edit};
    use super::super::material::material;
    use super::super::region::Region;
    use super::*;
    use crate::voxel::VoxelGrid;

    /// The base with a copy of its left half 16 mm above it.
    fn above() -> Edit {
        Edit {
            within: Some(Region::Sheet([10.0, 15.0, 0.0])),
            duplicate: Some([0.0, 0.0, 16.0]),
            ..Edit::default()
        }
    }

    fn fill(from: [f64; 3], to: [f64; 3]) -> Edit {
        Edit {
            fill: Some(Between { from, to }),
            ..Edit::default()
        }
    }

    #[test]
    fn between_the_sheets_it_is_solid_and_beside_them_it_is_not() {
        let list = [above(), fill([10.0, 15.0, 16.0], [10.0, 15.0, 0.0])];
        let edited = run(&tee(), &list);
        assert_eq!(edited.done[0].after, edited.done[1].after);
        // The fill alone, on an empty field.
        let field = VoxelGrid::filled(Vec3::new(-9.0, -9.0, -9.0), 1.0, [60, 50, 40], -9_f32);
        let solid = material(&field, &TriMesh::default(), &edited);
        let at = |x: f64, y: f64, z: f64| solid.sample(&Vec3::new(x, y, z));
        for z in [1.0, 4.0, 8.0, 12.0, 15.0] {
            assert!(at(10.0, 15.0, z) > 1.0 && at(1.0, 1.0, z) > 0.5, "{z}");
            assert!(at(-3.0, 15.0, z) < 0.0 && at(25.0, 15.0, z) < 0.0, "{z}");
        }
    }

    #[test]
    fn sheets_that_do_not_face_each_other_are_refused() {
        let before = tee();
        let kept = vec![false; before.points.len()];
        let beside = [fill([10.0, 15.0, 0.0], [30.0, 15.0, 0.0])];
        let error = edit(&before, &kept, &beside, 0.5).expect_err("side by side");
        assert!(matches!(error.why, Refusal::Beside { .. }), "{error}");
        let same = [fill([10.0, 15.0, 0.0], [5.0, 5.0, 0.0])];
        let error = edit(&before, &kept, &same, 0.5).expect_err("one sheet");
        assert!(matches!(error.why, Refusal::Meets { .. }), "{error}");
    }
}
