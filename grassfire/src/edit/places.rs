//! Edits of places: move, rotate, stretch, snap. Radii stay with their points.

use nalgebra::{Rotation3, Unit};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::draft::EditedSkeleton;
use super::error::Refusal;
use super::list::Edit;
use super::region::Selection;
use crate::Vec3;
use crate::skeleton::Skeleton;

/// A turn about an axis, counterclockwise as seen from its tip.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Rotation {
    /// A point of the axis, mm.
    pub centre: [f64; 3],
    /// Direction of the axis.
    pub axis: [f64; 3],
    /// Angle.
    pub degrees: f64,
}

/// Places scaled about a centre.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Stretch {
    /// What stays, mm.
    pub centre: [f64; 3],
    /// Factors along x, y and z; negative ones mirror.
    pub factors: [f64; 3],
}

/// A plane.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Plane {
    /// A point on it, mm.
    pub point: [f64; 3],
    /// Its normal, of any length.
    pub normal: [f64; 3],
}

/// Ways shorter than this, mm, are rounding: the point stays, and with it the proposal's own surface.
pub(super) const STAYS: f64 = 1e-9;
/// Quads and beams must keep this share of their size.
const FLAT: f64 = 1e-3;
/// Points may go as far from the box around the skeleton as that is large.
const FAR: f64 = 1.0;

/// Whether the numbers of the edit mean something.
pub(super) fn check(edit: &Edit) -> Result<(), Refusal> {
    let length = |v: [f64; 3]| Vec3::from(v).norm();
    let usable = |v: f64| v.is_finite() && v > 0.0;
    let bad = |key, value, wanted| Err(Refusal::Value { key, value, wanted });
    if let Some(Rotation {
        centre,
        axis,
        degrees,
    }) = edit.rotate
    {
        if !usable(length(axis)) {
            return bad("rotate.axis of length", length(axis), "a direction");
        }
        if !(degrees + length(centre)).is_finite() {
            return bad("rotate.degrees", degrees, "an angle about a place");
        }
    }
    if let Some(Stretch { centre, factors }) = edit.stretch {
        let wrong = factors.into_iter().find(|f| !usable(f.abs()));
        if let Some(wrong) = wrong.or((!length(centre).is_finite()).then_some(length(centre))) {
            return bad("stretch", wrong, "a factor other than 0 about a place");
        }
    }
    if let Some(Plane { point, normal }) = edit.snap
        && !(usable(length(normal)) && length(point).is_finite())
    {
        return bad("snap.normal of length", length(normal), "a plane");
    }
    Ok(())
}

/// Moves the selected points as the edit says; gives the farthest way, mm.
///
/// Quads and beams with moved and other points stretch. Nothing happens to points that stay where they are.
///
/// # Errors
/// [`Refusal::Flat`] when a quad or beam nearly loses its size, [`Refusal::Far`] when a point goes far from all others.
pub(super) fn change(
    draft: &mut EditedSkeleton,
    selection: &Selection,
    edit: &Edit,
) -> Result<f64, Refusal> {
    let before = draft.skeleton.points.clone();
    let after: Vec<Vec3> = (before.iter().zip(&selection.points))
        .map(|(p, &held)| if held { changed(edit, p) } else { *p })
        .collect();
    let way = |v: usize| (after[v] - before[v]).norm();
    let moved: Vec<bool> = (0..after.len()).map(|v| way(v) > STAYS).collect();
    check_sizes(draft, &before, &after)?;
    check_reach(&before, &after)?;
    draft.touch(&moved);
    for v in (0..after.len()).filter(|&v| moved[v]) {
        draft.skeleton.points[v] = after[v];
    }
    Ok((0..after.len()).map(way).fold(0.0, f64::max))
}

fn changed(edit: &Edit, p: &Vec3) -> Vec3 {
    if let Some(by) = edit.r#move {
        return p + Vec3::from(by);
    }
    if let Some(Rotation {
        centre,
        axis,
        degrees,
    }) = edit.rotate
    {
        let axis = Unit::new_normalize(Vec3::from(axis));
        let centre = Vec3::from(centre);
        return centre + Rotation3::from_axis_angle(&axis, degrees.to_radians()) * (p - centre);
    }
    if let Some(Stretch { centre, factors }) = edit.stretch {
        let centre = Vec3::from(centre);
        return centre + (p - centre).component_mul(&Vec3::from(factors));
    }
    if let Some(Plane { point, normal }) = edit.snap {
        let normal = Vec3::from(normal).normalize();
        return p - normal * (p - Vec3::from(point)).dot(&normal);
    }
    *p
}

fn check_sizes(draft: &EditedSkeleton, before: &[Vec3], after: &[Vec3]) -> Result<(), Refusal> {
    let check = |what, cell: &[u32], size: fn(&[Vec3], &[u32]) -> f64| {
        let (old, new) = (size(before, cell), size(after, cell));
        if old <= 0.0 || new >= FLAT * old {
            return Ok(());
        }
        let sum: Vec3 = cell.iter().map(|&v| before[v as usize]).sum();
        Err(Refusal::Flat {
            what,
            place: sum / cell.len() as f64,
            share: new / old,
        })
    };
    let Skeleton { quads, beams, .. } = &draft.skeleton;
    quads.iter().try_for_each(|q| check("quad", q, area))?;
    beams.iter().try_for_each(|b| check("beam", b, length))
}

/// Area of a quad: half the product of its diagonals and the sine between them.
fn area(points: &[Vec3], q: &[u32]) -> f64 {
    let diagonal = |a: usize, b: usize| points[q[b] as usize] - points[q[a] as usize];
    diagonal(0, 2).cross(&diagonal(1, 3)).norm() / 2.0
}

fn length(points: &[Vec3], b: &[u32]) -> f64 {
    (points[b[1] as usize] - points[b[0] as usize]).norm()
}

/// No point may go far away: the voxels between cost memory, and it is a wrong unit in most cases.
fn check_reach(before: &[Vec3], after: &[Vec3]) -> Result<(), Refusal> {
    let Some(&first) = before.first() else {
        return Ok(());
    };
    let corners = |(lo, hi): (Vec3, Vec3), p: &Vec3| (lo.inf(p), hi.sup(p));
    let (lo, hi) = before.iter().fold((first, first), corners);
    let size = (hi - lo).norm();
    let away = |p: &Vec3| (lo - p).sup(&(p - hi)).sup(&Vec3::zeros()).norm();
    match after.iter().find(|p| away(p) > FAR * size) {
        Some(place) => Err(Refusal::Far {
            place: *place,
            distance: away(place),
            size,
        }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::fixtures::{at_ball, frame, run, tee};
    use super::super::list::edit;
    use super::super::region::Region;
    use super::*;

    fn number() -> impl Strategy<Value = f64> {
        -20.0..20.0_f64
    }

    proptest! {
        #[test]
        fn a_move_moves_what_it_holds_by_exactly_that(by in [number(), number(), number()], x in -5.0..45.0_f64) {
            let before = tee();
            let change = Edit { r#move: Some(by), ..at_ball([x, 15.0, 0.0], 18.0) };
            let Ok(edited) = edit(&before, &vec![false; before.points.len()], &[change], 0.5) else {
                // The ball may hold nothing, and a move may flatten a quad.
                return Ok(());
            };
            let after = &edited.skeleton;
            prop_assert_eq!(&after.radii, &before.radii);
            prop_assert_eq!(&after.quads, &before.quads);
            let mut held = 0;
            for (p, q) in before.points.iter().zip(&after.points) {
                let inside = (p - Vec3::new(x, 15.0, 0.0)).norm() <= 18.0;
                prop_assert_eq!(*q, if inside { p + Vec3::from(by) } else { *p });
                held += usize::from(inside);
            }
            prop_assert_eq!(edited.done[0].points, held);
        }

        #[test]
        fn a_full_turn_is_nothing(x in number(), y in number(), centre in [number(), number(), number()]) {
            let before = frame();
            let axis = [x, y, 3.0];
            let turn = |degrees| Edit { rotate: Some(Rotation { centre, axis, degrees }), ..Edit::default() };
            let whole = run(&before, &[turn(360.0)]);
            prop_assert_eq!(&whole.skeleton, &before);
            prop_assert!(whole.gone.is_empty() && !whole.fresh_beams.contains(&true));
            // Distances stay, and turning back is nothing but rounding.
            let there = run(&before, &[turn(50.0)]);
            let length = |points: &[Vec3], b: [u32; 2]| (points[b[0] as usize] - points[b[1] as usize]).norm();
            for &b in &before.beams {
                prop_assert!((length(&there.skeleton.points, b) - length(&before.points, b)).abs() < 1e-9);
            }
            let back = run(&before, &[turn(50.0), turn(-50.0)]);
            for (p, q) in before.points.iter().zip(&back.skeleton.points) {
                prop_assert!((p - q).norm() < 1e-9);
            }
        }
    }

    #[test]
    fn stretching_and_snapping_keep_radii_and_the_other_points() {
        let before = tee();
        let stretch = Stretch {
            centre: [20.0, 0.0, 0.0],
            factors: [1.0, 1.0, 1.5],
        };
        let web = Region::Sheet([20.0, 15.0, 9.0]);
        let taller = Edit {
            within: Some(web),
            stretch: Some(stretch),
            ..Edit::default()
        };
        let after = run(&before, &[taller]).skeleton;
        assert_eq!(after.radii, before.radii);
        for (p, q) in before.points.iter().zip(&after.points) {
            assert_eq!(q.z, 1.5 * p.z);
        }
        // The web's upper rim to the height 17.
        let snap = Edit {
            within: Some(Region::Box {
                min: [19.0, -1.0, 18.0],
                max: [21.0, 31.0, 22.0],
            }),
            snap: Some(Plane {
                point: [0.0, 0.0, 17.0],
                normal: [0.0, 0.0, -3.0],
            }),
            ..Edit::default()
        };
        let snapped = run(&before, &[snap]);
        let top = snapped
            .skeleton
            .points
            .iter()
            .map(|p| p.z)
            .fold(0.0, f64::max);
        assert!((top - 17.0).abs() < 1e-12 && (snapped.done[0].moved - 3.0).abs() < 1e-12);
    }

    #[test]
    fn what_would_vanish_or_go_far_is_refused_with_its_place() {
        let before = tee();
        let refused = |change: Edit| {
            let kept = vec![false; before.points.len()];
            edit(&before, &kept, &[change], 0.5)
                .expect_err("refused")
                .why
        };
        // The web pressed flat into the base.
        let flat = refused(Edit {
            snap: Some(Plane {
                point: [0.0; 3],
                normal: [0.0, 0.0, 1.0],
            }),
            ..Edit::default()
        });
        assert!(
            matches!(flat, Refusal::Flat { what: "quad", place, .. } if place.x == 20.0),
            "{flat}"
        );
        let far = refused(Edit {
            r#move: Some([1e4, 0.0, 0.0]),
            ..Edit::default()
        });
        assert!(matches!(far, Refusal::Far { .. }), "{far}");
        for factors in [[1.0, 0.0, 1.0], [f64::NAN, 1.0, 1.0]] {
            let centre = [0.0; 3];
            let none = refused(Edit {
                stretch: Some(Stretch { centre, factors }),
                ..Edit::default()
            });
            assert!(matches!(none, Refusal::Value { .. }), "{none}");
        }
    }
}
