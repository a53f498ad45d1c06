//! Subdivide: strips of quads, and beam edges, are halved.

use std::collections::BTreeMap;

use super::draft::EditedSkeleton;
use super::region::Selection;
use crate::skeleton::{EdgeTable, edge};

/// Halves the edges of the selected quads and beams.
///
/// 1. Every edge of a selected quad or beam is to be halved; with an edge of a quad the opposite one is, too, so that whole
///    strips are halved and the net stays one of quads. The strips go on beyond the selection.
/// 2. A new point stands in the middle of every such edge, and of every quad with all edges halved. Its place and radius are the
///    means of the corners'.
/// 3. Quads become two or four, beam edges two. Material stays where it is.
pub(super) fn subdivide(draft: &mut EditedSkeleton, selection: &Selection) {
    let middle = middles(draft, selection);
    let of = |a: u32, b: u32| middle.get(&edge(a, b)).copied();
    let quads = std::mem::take(&mut draft.skeleton.quads);
    let fresh = std::mem::take(&mut draft.fresh_quads);
    for (quad, fresh) in quads.into_iter().zip(fresh) {
        let [a, b, c, d] = quad;
        let parts = match [of(a, b), of(b, c), of(c, d), of(d, a)] {
            [Some(ab), Some(bc), Some(cd), Some(da)] => {
                let m = draft.add_mean(&quad);
                vec![
                    [a, ab, m, da],
                    [ab, b, bc, m],
                    [m, bc, c, cd],
                    [da, m, cd, d],
                ]
            }
            [Some(ab), _, Some(cd), _] => vec![[a, ab, cd, d], [ab, b, c, cd]],
            [_, Some(bc), _, Some(da)] => vec![[a, b, bc, da], [da, bc, c, d]],
            _ => vec![quad],
        };
        parts
            .into_iter()
            .for_each(|part| draft.add_quad(part, fresh));
    }
    let beams = std::mem::take(&mut draft.skeleton.beams);
    let fresh = std::mem::take(&mut draft.fresh_beams);
    for ([a, b], fresh) in beams.into_iter().zip(fresh) {
        let halves = match of(a, b) {
            Some(m) => vec![[a, m], [m, b]],
            None => vec![[a, b]],
        };
        halves
            .into_iter()
            .for_each(|half| draft.add_beam(half, fresh));
    }
}

/// The edges to be halved, each with its new point.
fn middles(draft: &mut EditedSkeleton, selection: &Selection) -> BTreeMap<[u32; 2], u32> {
    let table = EdgeTable::of_quads(&draft.skeleton.quads);
    let mut wanted: Vec<[u32; 2]> = Vec::new();
    for q in (0..selection.quads.len()).filter(|&q| selection.quads[q]) {
        let quad = draft.skeleton.quads[q];
        wanted.extend((0..4).map(|k| edge(quad[k], quad[(k + 1) % 4])));
    }
    for b in (0..selection.beams.len()).filter(|&b| selection.beams[b]) {
        let [a, b] = draft.skeleton.beams[b];
        wanted.push(edge(a, b));
    }
    let mut middle = BTreeMap::new();
    while let Some(ends) = wanted.pop() {
        if middle.contains_key(&ends) {
            continue;
        }
        middle.insert(ends, draft.add_mean(&ends));
        for &face in table.at(ends[0], ends[1]) {
            let quad = draft.skeleton.quads[face as usize];
            let side = (0..4).find(|&k| edge(quad[k], quad[(k + 1) % 4]) == ends);
            let opposite = side.map(|k| edge(quad[(k + 2) % 4], quad[(k + 3) % 4]));
            wanted.extend(opposite);
        }
    }
    middle
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::fixtures::{at_ball, frame, run, tee};
    use super::super::list::{Edit, edit};
    use crate::skeleton::stats;

    fn halved(mut edit: Edit) -> Edit {
        edit.subdivide = 1;
        edit
    }

    #[test]
    fn everything_halved_is_four_times_the_quads_and_twice_the_beam_edges() {
        let fine = run(&tee(), &[halved(Edit::default())]);
        assert_eq!(fine.skeleton.quads.len(), 4 * tee().quads.len());
        assert!(fine.skeleton.radii.iter().all(|r| *r == 2.0));
        assert!(fine.gone.is_empty() && !fine.fresh_quads.contains(&true));
        let fine = run(&frame(), &[halved(Edit::default())]);
        assert_eq!(fine.skeleton.beams.len(), 2 * frame().beams.len());
        assert_eq!(fine.done[0].after.beams, 12);
    }

    proptest! {
        /// A point in the middle of an edge of one of its quads only would open the net: rims and topology would change.
        #[test]
        fn strips_stay_a_net(x in 0.0..40.0_f64, y in 0.0..30.0_f64, z in 0.0..20.0_f64) {
            let before = tee();
            let kept = vec![false; before.points.len()];
            let list = [halved(at_ball([x, y, z], 12.0))];
            let Ok(edited) = edit(&before, &kept, &list, 0.5) else {
                return Ok(());
            };
            let done = edited.done[0];
            prop_assert_eq!(done.before.topology, done.after.topology);
            prop_assert_eq!(done.before.sheets, done.after.sheets);
            let (old, new) = (stats(&before), stats(&edited.skeleton));
            prop_assert_eq!((old.rims, old.seams), (new.rims, new.seams));
            prop_assert!(new.quads > old.quads);
        }
    }
}
