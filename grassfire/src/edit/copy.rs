//! Duplicate: quads and beams once more, elsewhere.

use super::draft::EditedSkeleton;
use super::region::Selection;
use crate::Vec3;

/// Copies the selected quads and beams with their points and radii, moved by `by`, mm. The copies hang on nothing.
pub(super) fn duplicate(draft: &mut EditedSkeleton, selection: &Selection, by: &Vec3) {
    let mut copy = vec![u32::MAX; draft.skeleton.points.len()];
    let mut copied = |draft: &mut EditedSkeleton, v: u32| {
        let v = v as usize;
        if copy[v] == u32::MAX {
            copy[v] = draft.add_point(draft.skeleton.points[v] + by, draft.skeleton.radii[v]);
        }
        copy[v]
    };
    for q in (0..selection.quads.len()).filter(|&q| selection.quads[q]) {
        let quad = draft.skeleton.quads[q].map(|v| copied(draft, v));
        draft.add_quad(quad, true);
    }
    for b in (0..selection.beams.len()).filter(|&b| selection.beams[b]) {
        let beam = draft.skeleton.beams[b].map(|v| copied(draft, v));
        draft.add_beam(beam, true);
    }
}

#[cfg(test)]
mod tests {
    use super::super::fixtures::{frame, run, tee};
    use super::super::list::Edit;
    use super::super::region::Region;
    use super::*;

    fn duplicate(within: Region, by: [f64; 3]) -> Edit {
        Edit {
            within: Some(within),
            duplicate: Some(by),
            ..Edit::default()
        }
    }

    #[test]
    fn copies_have_the_radii_and_a_piece_of_their_own() {
        let mut before = tee();
        before
            .radii
            .iter_mut()
            .enumerate()
            .for_each(|(n, r)| *r += 0.01 * n as f64);
        let edited = run(
            &before,
            &[duplicate(Region::Sheet([20.0, 15.0, 9.0]), [7.0, 0.0, 0.0])],
        );
        let after = &edited.skeleton;
        let old = before.points.len();
        assert_eq!(&after.points[..old], &before.points[..]);
        assert_eq!(edited.done[0].after.topology.b0, 2);
        for (p, r) in after.points[old..].iter().zip(&after.radii[old..]) {
            let from = before
                .points
                .iter()
                .position(|q| (q + Vec3::x() * 7.0 - p).norm() < 1e-12);
            assert_eq!(from.map(|v| before.radii[v]), Some(*r));
        }
        // The proposal's material stays.
        assert!(edited.gone.is_empty());
    }

    #[test]
    fn a_copied_beam_is_one_more() {
        let edited = run(
            &frame(),
            &[duplicate(Region::Beam([10.0, 10.0, 0.0]), [0.0, 0.0, 3.0])],
        );
        assert_eq!(edited.done[0].after.beams, 13);
        assert_eq!(edited.hulls(true, &edited.skeleton.radii).len(), 3);
    }
}
