//! Delete: quads and beams go, and their material.

use super::draft::EditedSkeleton;
use super::error::Refusal;
use super::region::Selection;

/// Removes the selected quads and beams, and points that nothing uses then.
///
/// # Errors
/// [`Refusal::Cut`] when more pieces are left than there were, unless `cut` allows it: it names the smallest one.
pub(super) fn delete(
    draft: &mut EditedSkeleton,
    selection: &Selection,
    cut: bool,
) -> Result<(), Refusal> {
    let before = draft.pieces().len();
    draft.remove(&selection.quads, &selection.beams);
    let pieces = draft.pieces();
    match pieces.last() {
        Some(&(points, first)) if pieces.len() > before && !cut => Err(Refusal::Cut {
            points,
            place: draft.skeleton.points[first],
        }),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::super::fixtures::{frame, run, tee};
    use super::super::list::{Edit, edit};
    use super::super::region::Region;
    use super::*;
    use crate::skeleton::check;

    fn delete(within: Region) -> Edit {
        Edit {
            within: Some(within),
            delete: true,
            ..Edit::default()
        }
    }

    #[test]
    fn a_deleted_beam_is_one_less() {
        let before = frame();
        let edited = run(&before, &[delete(Region::Beam([10.0, 10.5, 0.0]))]);
        let done = edited.done[0];
        assert_eq!((done.before.beams, done.after.beams), (12, 11));
        assert_eq!(done.before.topology.b1, done.after.topology.b1 + 1);
        assert_eq!(check(&edited.skeleton), Ok(()));
        // Three edges went, with two points between.
        assert_eq!(edited.gone.len(), 3);
        assert_eq!(edited.skeleton.points.len() + 2, before.points.len());
        let left: Vec<_> = edited.hulls(false, &edited.base);
        assert_eq!(left.len() + 3, before.beams.len());
    }

    #[test]
    fn a_deleted_sheet_leaves_a_valid_net() {
        let before = tee();
        let edited = run(&before, &[delete(Region::Sheet([20.0, 15.0, 9.0]))]);
        assert_eq!(check(&edited.skeleton), Ok(()));
        assert_eq!(
            (edited.done[0].before.sheets, edited.done[0].after.sheets),
            (3, 1)
        );
        assert!(edited.skeleton.points.iter().all(|p| p.z == 0.0));
    }

    #[test]
    fn what_a_deletion_would_cut_off_is_named() {
        let before = tee();
        let kept = vec![false; before.points.len()];
        // The base beside the web, all along.
        let mut slice = delete(Region::Box {
            min: [9.0, -1.0, -1.0],
            max: [21.0, 31.0, 1.0],
        });
        let list = [slice.clone()];
        let error = edit(&before, &kept, &list, 0.5).expect_err("cuts the base");
        let why = &error.why;
        assert!(
            matches!(why, Refusal::Cut { points: 8, place } if place.x < 11.0),
            "{error}"
        );
        slice.cut = true;
        let done = run(&before, &[slice]).done[0];
        assert_eq!((done.before.topology.b0, done.after.topology.b0), (1, 2));
    }
}
