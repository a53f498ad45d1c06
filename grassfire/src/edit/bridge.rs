//! Bridge and strut: a strip of quads between two rims, a beam between two points.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::draft::EditedSkeleton;
use super::error::Refusal;
use super::rims::{Rim, rim_at};
use crate::Vec3;

/// Two places that name what is to be joined, mm.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Between {
    /// In the wall of the one.
    pub from: [f64; 3],
    /// In the wall of the other.
    pub to: [f64; 3],
}

/// A place belongs to a point no farther away than this many of its radii.
const REACH: f64 = 1.25;

/// Spans quads between the rims at two places.
///
/// 1. The rims there, each from corner to corner ([`rim_at`]); they must have equally many edges.
/// 2. Their points are paired in the sense, and for closed rims at the turn, that makes the sum of squared distances least.
/// 3. Straight rows of quads between the pairs, as many as make the quads about as long as wide. Radii run linearly.
///
/// # Errors
/// [`Refusal::Nothing`] without a rim at a place, [`Refusal::Uneven`], [`Refusal::Meets`] when the rims share a point.
pub(super) fn bridge(draft: &mut EditedSkeleton, between: &Between) -> Result<(), Refusal> {
    let from = rim_at(&draft.skeleton, &Vec3::from(between.from))?;
    let to = rim_at(&draft.skeleton, &Vec3::from(between.to))?;
    let points = &draft.skeleton.points;
    if let Some(&shared) = from.points.iter().find(|v| to.points.contains(v)) {
        return Err(Refusal::Meets {
            place: points[shared as usize],
        });
    }
    if from.edges() != to.edges() || from.closed != to.closed {
        return Err(Refusal::Uneven {
            from: from.edges(),
            to: to.edges(),
            place: points[to.points[0] as usize],
        });
    }
    let partners = paired(&from, &to, points);
    let gap = |&(a, b): &(u32, u32)| (points[b as usize] - points[a as usize]).norm();
    let pairs: Vec<(u32, u32)> = from.points.iter().copied().zip(partners).collect();
    let mean_gap = pairs.iter().map(gap).sum::<f64>() / pairs.len() as f64;
    let rows = rows(mean_gap, from.length(points) / from.edges() as f64);
    let chains: Vec<Vec<u32>> = pairs
        .iter()
        .map(|&(a, b)| chain(draft, a, b, rows))
        .collect();
    for n in 0..from.edges() {
        let (left, right) = (&chains[n], &chains[(n + 1) % chains.len()]);
        for row in 0..rows {
            let quad = [left[row], right[row], right[row + 1], left[row + 1]];
            draft.add_quad(quad, true);
        }
    }
    Ok(())
}

/// A beam between the points of the skeleton that are nearest to two places; its edges are as long as the others on average.
///
/// # Errors
/// [`Refusal::Nothing`] without a point there, [`Refusal::Meets`] when it is one point or the two are joined already.
pub(super) fn strut(draft: &mut EditedSkeleton, between: &Between) -> Result<(), Refusal> {
    let from = point_at(draft, &Vec3::from(between.from))?;
    let to = point_at(draft, &Vec3::from(between.to))?;
    let skeleton = &draft.skeleton;
    let joined = |cell: &[u32]| cell.contains(&from) && cell.contains(&to);
    let in_quad = skeleton.quads.iter().any(|q| joined(q));
    if from == to || in_quad || skeleton.beams.iter().any(|b| joined(b)) {
        return Err(Refusal::Meets {
            place: skeleton.points[from as usize],
        });
    }
    let length =
        |a: u32, b: u32| (skeleton.points[b as usize] - skeleton.points[a as usize]).norm();
    let sides = skeleton.quads.iter().map(|q| length(q[0], q[1]));
    let lengths: Vec<f64> = sides
        .chain(skeleton.beams.iter().map(|b| length(b[0], b[1])))
        .collect();
    let usual = lengths.iter().sum::<f64>() / lengths.len() as f64;
    let edges = rows(length(from, to), usual);
    let chain = chain(draft, from, to, edges);
    chain
        .windows(2)
        .for_each(|pair| draft.add_beam([pair[0], pair[1]], true));
    Ok(())
}

/// How many pieces a way is cut into, for pieces of about a length.
fn rows(way: f64, length: f64) -> usize {
    /// Enough for any part; a length of nearly 0 asks for endless rows.
    const MOST: f64 = 1000.0;
    (way / length).round().clamp(1.0, MOST) as usize
}

/// The points of a straight way from one point to another in equal steps, both ends included.
fn chain(draft: &mut EditedSkeleton, from: u32, to: u32, steps: usize) -> Vec<u32> {
    let (a, b) = (from as usize, to as usize);
    let (start, end) = (draft.skeleton.points[a], draft.skeleton.points[b]);
    let (thick, thin) = (draft.skeleton.radii[a], draft.skeleton.radii[b]);
    let mut out = vec![from];
    for step in 1..steps {
        let t = step as f64 / steps as f64;
        out.push(draft.add_point(start + (end - start) * t, thick + (thin - thick) * t));
    }
    out.push(to);
    out
}

/// The points of `to` in the order of those of `from`.
fn paired(from: &Rim, to: &Rim, points: &[Vec3]) -> Vec<u32> {
    let n = to.points.len();
    let turns = if from.closed { n } else { 1 };
    let mut orders: Vec<Vec<u32>> = Vec::new();
    for turn in 0..turns {
        let mut order = to.points.clone();
        order.rotate_left(turn);
        orders.push(order.clone());
        order.reverse();
        orders.push(order);
    }
    let cost = |order: &Vec<u32>| -> f64 {
        let pairs = from.points.iter().zip(order);
        pairs
            .map(|(&a, &b)| (points[a as usize] - points[b as usize]).norm_squared())
            .sum()
    };
    let best = orders
        .into_iter()
        .min_by(|a, b| cost(a).total_cmp(&cost(b)));
    best.unwrap_or_default()
}

fn point_at(draft: &EditedSkeleton, place: &Vec3) -> Result<u32, Refusal> {
    let points = &draft.skeleton.points;
    let distance = |v: usize| (points[v] - place).norm();
    let nearest = (0..points.len()).min_by(|&a, &b| distance(a).total_cmp(&distance(b)));
    match nearest {
        Some(v) if distance(v) <= REACH * draft.skeleton.radii[v] => Ok(v as u32),
        nearest => Err(Refusal::Nothing {
            what: "point",
            nearest: nearest.map_or(*place, |v| points[v]),
            distance: nearest.map_or(f64::INFINITY, distance),
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::super::fixtures::{frame, run, tee};
    use super::super::list::{Edit, edit};
    use super::*;

    fn bridge(from: [f64; 3], to: [f64; 3]) -> Edit {
        Edit {
            bridge: Some(Between { from, to }),
            ..Edit::default()
        }
    }

    #[test]
    fn two_rims_get_a_strip_between_them() {
        let mut before = tee();
        before.radii[20 + 4..].fill(3.0);
        // The base's right rim and the web's upper one: three edges each, 28 mm apart.
        let edited = run(&before, &[bridge([40.5, 15.0, 0.0], [20.0, 14.0, 21.0])]);
        let done = edited.done[0];
        assert_eq!(done.after.quads, done.before.quads + 3 * 3);
        // A tunnel between base, web and strip.
        assert_eq!(done.after.topology.b1, done.before.topology.b1 + 1);
        let new = &edited.skeleton.points[before.points.len()..];
        assert_eq!(new.len(), 2 * 4);
        // Rows run straight from rim to rim: nothing crosses.
        assert!(
            new.iter()
                .all(|p| (p.x / 20.0 + p.z / 20.0 - 2.0).abs() < 1e-9)
        );
        let radii = &edited.skeleton.radii[before.points.len()..];
        assert!(radii.iter().all(|r| *r > 2.0 && *r < 3.0));
        assert!(edited.gone.is_empty());
    }

    #[test]
    fn rims_that_do_not_fit_are_named() {
        let before = tee();
        let kept = vec![false; before.points.len()];
        let refused = |from, to| {
            edit(&before, &kept, &[bridge(from, to)], 0.5)
                .expect_err("refused")
                .why
        };
        // Two edges of the front rim beside the web, three of the right rim: they meet in the corner.
        let meets = refused([30.0, 0.0, 0.0], [40.0, 15.0, 0.0]);
        assert!(
            matches!(meets, Refusal::Meets { place } if place.x == 40.0),
            "{meets}"
        );
        let uneven = refused([10.0, 0.0, 0.0], [20.0, 15.0, 20.0]);
        assert!(
            matches!(uneven, Refusal::Uneven { from: 2, to: 3, .. }),
            "{uneven}"
        );
        let nothing = refused([30.0, 15.0, 0.0], [20.0, 15.0, 20.0]);
        assert!(
            matches!(nothing, Refusal::Nothing { what: "rim", .. }),
            "{nothing}"
        );
    }

    #[test]
    fn a_strut_is_one_beam_more() {
        let strut = |from, to| Edit {
            strut: Some(Between { from, to }),
            ..Edit::default()
        };
        let before = frame();
        let edited = run(&before, &[strut([20.0, 0.0, 0.0], [-21.0, 0.0, 1.0])]);
        let done = edited.done[0];
        assert_eq!((done.before.beams, done.after.beams), (12, 13));
        // 40 mm in edges of about 9.4 mm.
        assert_eq!(edited.skeleton.points.len(), before.points.len() + 3);
        let kept = vec![false; before.points.len()];
        let list = [strut([20.0, 0.0, 0.0], [14.0, 6.0, 0.0])];
        let error = edit(&before, &kept, &list, 0.5).expect_err("joined already");
        assert!(matches!(error.why, Refusal::Meets { .. }), "{error}");
    }
}
