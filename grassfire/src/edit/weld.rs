//! Weld and merge: several points become one.

use std::collections::BTreeMap;

use super::draft::EditedSkeleton;
use super::error::Refusal;
use super::places::STAYS;
use super::region::Selection;
use crate::Vec3;
use crate::skeleton::{UnionFind, edge};

/// Joins selected points that are no farther apart than `tolerance`, mm.
///
/// # Errors
/// [`Refusal::Apart`] when there are none such, [`Refusal::Folds`] when a quad would lose a corner.
pub(super) fn weld(
    draft: &mut EditedSkeleton,
    selection: &Selection,
    tolerance: f64,
) -> Result<(), Refusal> {
    let points = &draft.skeleton.points;
    let mut held = selection.held();
    held.sort_by(|&a, &b| points[a].x.total_cmp(&points[b].x));
    let mut sets = UnionFind::new(points.len());
    let mut nearest = (f64::INFINITY, Vec3::zeros());
    for (n, &a) in held.iter().enumerate() {
        for &b in &held[n + 1..] {
            if points[b].x - points[a].x > tolerance.max(nearest.0) {
                break;
            }
            let distance = (points[b] - points[a]).norm();
            if distance < nearest.0 {
                nearest = (distance, points[a]);
            }
            if distance <= tolerance {
                sets.join(a as u32, b as u32);
            }
        }
    }
    if nearest.0 > tolerance {
        return Err(Refusal::Apart {
            distance: nearest.0,
            place: nearest.1,
        });
    }
    join(draft, &mut sets, false)
}

/// Joins all selected points to one in their middle; quads and beams between them vanish.
///
/// # Errors
/// [`Refusal::Folds`] when a quad would become a triangle or an edge.
pub(super) fn merge(draft: &mut EditedSkeleton, selection: &Selection) -> Result<(), Refusal> {
    let held = selection.held();
    let mut sets = UnionFind::new(draft.skeleton.points.len());
    held.iter()
        .for_each(|&v| sets.join(held[0] as u32, v as u32));
    join(draft, &mut sets, true)
}

/// Every set becomes one point, its place and radius their means. Quads and beams that are there twice then are left once:
/// the one whose material the proposal has, if there is one. With `vanish` quads that shrink to a point go.
fn join(draft: &mut EditedSkeleton, sets: &mut UnionFind, vanish: bool) -> Result<(), Refusal> {
    let n = draft.skeleton.points.len();
    let root: Vec<u32> = (0..n as u32).map(|v| sets.find(v)).collect();
    let mut members: Vec<Vec<u32>> = vec![Vec::new(); n];
    (0..n).for_each(|v| members[root[v] as usize].push(v as u32));
    let mean: Vec<Vec3> = (0..n)
        .map(|v| draft.mean(&members[root[v] as usize]).0)
        .collect();
    let away = |v: usize| (mean[v] - draft.skeleton.points[v]).norm();
    let moved: Vec<bool> = (0..n).map(|v| away(v) > STAYS).collect();
    draft.touch(&moved);
    for v in (0..n).filter(|&v| members[v].len() > 1) {
        let (place, radius, base) = draft.mean(&members[v]);
        // Points that only touch keep their very place, and so their material.
        if moved[v] {
            draft.skeleton.points[v] = place;
        }
        draft.skeleton.radii[v] = radius;
        draft.base[v] = base;
    }
    let skeleton = &mut draft.skeleton;
    let corners = skeleton.quads.iter_mut().flatten();
    let ends = skeleton.beams.iter_mut().flatten();
    corners.chain(ends).for_each(|v| *v = root[*v as usize]);
    let (quads, beams) = spare(draft, vanish)?;
    draft.remove(&quads, &beams);
    Ok(())
}

/// The quads and beams that are no more, or there twice.
fn spare(draft: &EditedSkeleton, vanish: bool) -> Result<(Vec<bool>, Vec<bool>), Refusal> {
    let skeleton = &draft.skeleton;
    let mut quads = vec![false; skeleton.quads.len()];
    let mut beams = vec![false; skeleton.beams.len()];
    let mut faces: BTreeMap<[u32; 4], usize> = BTreeMap::new();
    let mut edges: BTreeMap<[u32; 2], Option<usize>> = BTreeMap::new();
    for (q, quad) in skeleton.quads.iter().enumerate() {
        let mut key = *quad;
        key.sort_unstable();
        let corners = 1 + key.windows(2).filter(|pair| pair[0] != pair[1]).count();
        if corners == 1 && vanish {
            quads[q] = true;
            continue;
        }
        if corners < 4 {
            let place = draft.mean(quad).0;
            return Err(Refusal::Folds { place });
        }
        if let Some(other) = faces.insert(key, q) {
            // The later one stays when only that has material.
            let extra = if draft.fresh_quads[other] { other } else { q };
            faces.insert(key, other + q - extra);
            quads[extra] = true;
        }
        for k in 0..4 {
            edges.insert(edge(quad[k], quad[(k + 1) % 4]), None);
        }
    }
    for (b, &[from, to]) in skeleton.beams.iter().enumerate() {
        if from == to {
            beams[b] = true;
            continue;
        }
        match edges.insert(edge(from, to), Some(b)) {
            None => {}
            Some(None) => {
                beams[b] = true;
                edges.insert(edge(from, to), None);
            }
            Some(Some(other)) => {
                let extra = if draft.fresh_beams[other] { other } else { b };
                edges.insert(edge(from, to), Some(other + b - extra));
                beams[extra] = true;
            }
        }
    }
    Ok((quads, beams))
}

#[cfg(test)]
mod tests {
    use super::super::fixtures::{at_ball, frame, run, tee};
    use super::super::list::{Edit, edit};
    use super::super::region::Region;
    use super::*;

    #[test]
    fn a_copy_welded_on_its_place_is_gone() {
        for before in [tee(), frame()] {
            let copy = Edit {
                duplicate: Some([0.0; 3]),
                ..Edit::default()
            };
            let weld = Edit {
                weld: Some(0.01),
                ..Edit::default()
            };
            let after = run(&before, &[copy, weld]);
            assert_eq!(after.skeleton, before);
            assert!(after.gone.is_empty());
            assert!(!after.fresh_quads.contains(&true) && !after.fresh_beams.contains(&true));
        }
    }

    #[test]
    fn a_copy_beside_is_joined_along_its_border() {
        // The web once more, one base width away: its lower rim lies on the base's points.
        let copy = Edit {
            within: Some(Region::Sheet([20.0, 15.0, 9.0])),
            duplicate: Some([10.0, 0.0, 0.0]),
            ..Edit::default()
        };
        let weld = Edit {
            weld: Some(0.5),
            ..Edit::default()
        };
        let done = run(&tee(), &[copy, weld]).done;
        assert_eq!(done[0].after.topology.b0, 2);
        assert_eq!((done[1].after.topology.b0, done[1].after.sheets), (1, 5));
    }

    #[test]
    fn what_folds_or_is_apart_is_refused_with_its_place() {
        let before = tee();
        let refused = |change: Edit| {
            let kept = vec![false; before.points.len()];
            let error = edit(&before, &kept, &[change], 0.5).expect_err("refused");
            assert!(error.hint().is_some());
            error.why
        };
        let weld = |tolerance| Edit {
            weld: Some(tolerance),
            ..Edit::default()
        };
        assert!(matches!(refused(weld(11.0)), Refusal::Folds { .. }));
        let apart = refused(weld(1.0));
        assert!(
            matches!(apart, Refusal::Apart { distance, .. } if (distance - 10.0).abs() < 1e-12)
        );
        let merge = Edit {
            merge: true,
            ..at_ball([20.0, 0.0, 10.0], 11.0)
        };
        assert!(matches!(refused(merge), Refusal::Folds { .. }));
    }

    #[test]
    fn a_merged_beam_is_a_point_where_the_others_meet() {
        let before = frame();
        // One beam with both its junctions.
        let merge = Edit {
            within: Some(Region::Beam([10.0, 10.0, 0.0])),
            merge: true,
            ..Edit::default()
        };
        let edited = run(&before, &[merge]);
        let done = edited.done[0];
        // The two triangles on it lose a side: their other two beams stay beside each other.
        assert_eq!((done.before.beams, done.after.beams), (12, 11));
        assert_eq!(done.before.topology, done.after.topology);
        let junction = Vec3::new(10.0, 10.0, 0.0);
        let nearest = edited.skeleton.points.iter().map(|p| (p - junction).norm());
        assert!(nearest.fold(f64::INFINITY, f64::min) < 1e-12);
    }
}
