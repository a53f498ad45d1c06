//! Split: quads and beams come loose from the others.

use super::draft::EditedSkeleton;
use super::error::Refusal;
use super::region::Selection;

/// Gives the selected quads and beams points of their own where others share them. Nothing moves, and material stays.
///
/// # Errors
/// [`Refusal::Loose`] when they share none.
pub(super) fn split(draft: &mut EditedSkeleton, selection: &Selection) -> Result<(), Refusal> {
    let n = draft.skeleton.points.len();
    let mut used = vec![[false; 2]; n];
    let quads = draft.skeleton.quads.iter().zip(&selection.quads);
    let beams = draft.skeleton.beams.iter().zip(&selection.beams);
    let quads = quads.map(|(quad, &own)| (&quad[..], own));
    for (cell, own) in quads.chain(beams.map(|(beam, &own)| (&beam[..], own))) {
        cell.iter()
            .for_each(|&v| used[v as usize][usize::from(own)] = true);
    }
    let shared = |v: usize| used[v] == [true; 2] && selection.points[v];
    let shared: Vec<usize> = (0..n).filter(|&v| shared(v)).collect();
    if shared.is_empty() {
        let first = selection.held().first().copied();
        return Err(Refusal::Loose {
            place: first.map(|v| draft.skeleton.points[v]).unwrap_or_default(),
        });
    }
    let mut number: Vec<u32> = (0..n as u32).collect();
    for v in shared {
        number[v] = draft.add_mean(&[v as u32]);
    }
    let quads = draft.skeleton.quads.iter_mut().zip(&selection.quads);
    let quads = quads.filter(|q| *q.1).flat_map(|q| q.0.iter_mut());
    let beams = draft.skeleton.beams.iter_mut().zip(&selection.beams);
    let beams = beams.filter(|b| *b.1).flat_map(|b| b.0.iter_mut());
    quads.chain(beams).for_each(|v| *v = number[*v as usize]);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::fixtures::{run, tee};
    use super::super::list::{Edit, edit};
    use super::super::region::Region;
    use super::*;

    #[test]
    fn what_was_split_off_moves_alone_and_welds_back() {
        let before = tee();
        let web = |at: f64| Edit {
            within: Some(Region::Sheet([20.0, 15.0, at])),
            ..Edit::default()
        };
        let split = Edit {
            split: true,
            ..web(9.0)
        };
        let up = |by: f64, at: f64| Edit {
            r#move: Some([0.0, 0.0, by]),
            ..web(at)
        };
        let weld = Edit {
            weld: Some(0.1),
            ..Edit::default()
        };
        let apart = run(&before, &[split.clone(), up(8.0, 9.0)]);
        let [first, second] = apart.done[..] else {
            panic!("two edits");
        };
        assert_eq!((first.before.topology.b0, first.after.topology.b0), (1, 2));
        assert_eq!((first.after.sheets, second.points), (2, 12));
        // The base stays where it is.
        assert_eq!(&apart.skeleton.points[..20], &before.points[..20]);
        let list = [split.clone(), up(8.0, 9.0), up(-8.0, 19.0), weld];
        let back = run(&before, &list).done;
        assert_eq!(back[3].after.topology, first.before.topology);
        assert_eq!(back[3].after.sheets, 3);
        let kept = vec![false; before.points.len()];
        let again = edit(&before, &kept, &[split.clone(), split], 0.5).expect_err("loose already");
        assert!(matches!(again.why, Refusal::Loose { .. }), "{again}");
    }
}
