//! Members of a skeleton, found by a place: sheets, panels and beams.

use super::error::Refusal;
use crate::Vec3;
use crate::mesh::bvh::nearest_on_triangle;
use crate::skeleton::{EdgeTable, Skeleton, UnionFind};

/// A place is in a member when it is no farther from its middle than this many radii: walls of two runs differ a little.
const REACH: f64 = 1.25;

/// Quads of a panel are turned by less than this against the one at its place, degrees.
const BEND: f64 = 45.0;

/// A sheet, panel or beam.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Member {
    /// Numbers of its quads, ascending.
    pub(super) quads: Vec<usize>,
    /// Numbers of its beam edges, ascending.
    pub(super) beams: Vec<usize>,
    /// Its point that is nearest to the place that names it, mm.
    pub(super) nearest: Vec3,
}

/// The sheet (quads joined over edges with two quads) with a place in its wall.
///
/// # Errors
/// [`Refusal::Nothing`] when the nearest sheet is farther away than its wall.
pub(super) fn sheet_at(skeleton: &Skeleton, place: &Vec3) -> Result<Member, Refusal> {
    let cells = skeleton.quads.iter().map(|q| &q[..]);
    let (first, nearest) = nearest("sheet", skeleton, cells, place)?;
    Ok(Member {
        quads: alike(&sheets(skeleton), first),
        beams: Vec::new(),
        nearest,
    })
}

/// The panel with a place in its wall: quads that hang together over edges with two quads, and whose normals are within 45 degrees
/// of that of the quad at the place. A flange or a web of a bent sheet is one.
///
/// # Errors
/// As [`sheet_at`].
pub(super) fn panel_at(skeleton: &Skeleton, place: &Vec3) -> Result<Member, Refusal> {
    let cells = skeleton.quads.iter().map(|q| &q[..]);
    let (first, nearest) = nearest("sheet", skeleton, cells, place)?;
    let normals: Vec<Vec3> = skeleton.quads.iter().map(|q| normal(skeleton, q)).collect();
    let along = |q: u32| {
        let n = &normals[q as usize];
        n.dot(&normals[first]).abs() > BEND.to_radians().cos() * n.norm() * normals[first].norm()
    };
    let table = EdgeTable::of_quads(&skeleton.quads);
    let mut sets = UnionFind::new(skeleton.quads.len());
    for (_, faces) in table.iter() {
        if let [a, b] = faces
            && along(*a)
            && along(*b)
        {
            sets.join(*a, *b);
        }
    }
    let labels: Vec<u32> = (0..normals.len() as u32).map(|q| sets.find(q)).collect();
    Ok(Member {
        quads: alike(&labels, first),
        beams: Vec::new(),
        nearest,
    })
}

/// Normal of a quad, as long as twice its area.
fn normal(skeleton: &Skeleton, q: &[u32; 4]) -> Vec3 {
    let p = q.map(|v| skeleton.points[v as usize]);
    (p[2] - p[0]).cross(&(p[3] - p[1]))
}

/// The beam (edges joined at points where two of them and nothing else meet) with a place inside.
///
/// # Errors
/// [`Refusal::Nothing`] when the nearest beam is farther away than it is thick.
pub(super) fn beam_at(skeleton: &Skeleton, place: &Vec3) -> Result<Member, Refusal> {
    let cells = skeleton.beams.iter().map(|b| &b[..]);
    let (first, nearest) = nearest("beam", skeleton, cells, place)?;
    Ok(Member {
        quads: Vec::new(),
        beams: alike(&beams(skeleton), first),
        nearest,
    })
}

/// The sheet of every quad: the number of its first quad.
pub(super) fn sheets(skeleton: &Skeleton) -> Vec<u32> {
    let table = EdgeTable::of_quads(&skeleton.quads);
    let mut sets = UnionFind::new(skeleton.quads.len());
    for (_, faces) in table.iter() {
        if let [a, b] = faces {
            sets.join(*a, *b);
        }
    }
    (0..skeleton.quads.len() as u32)
        .map(|q| sets.find(q))
        .collect()
}

/// The beam of every beam edge: the number of its first edge.
pub(super) fn beams(skeleton: &Skeleton) -> Vec<u32> {
    let mut at: Vec<Vec<u32>> = vec![Vec::new(); skeleton.points.len()];
    for (n, b) in skeleton.beams.iter().enumerate() {
        b.iter().for_each(|&v| at[v as usize].push(n as u32));
    }
    // A point with quads is a junction.
    skeleton
        .quads
        .iter()
        .flatten()
        .for_each(|&v| at[v as usize].clear());
    let mut sets = UnionFind::new(skeleton.beams.len());
    for meeting in &at {
        if let [a, b] = meeting[..] {
            sets.join(a, b);
        }
    }
    (0..skeleton.beams.len() as u32)
        .map(|b| sets.find(b))
        .collect()
}

/// How many different labels there are, where every set is labelled by its first member.
pub(super) fn count(labels: &[u32]) -> usize {
    (0..labels.len())
        .filter(|&n| labels[n] as usize == n)
        .count()
}

fn alike(labels: &[u32], one: usize) -> Vec<usize> {
    (0..labels.len())
        .filter(|&n| labels[n] == labels[one])
        .collect()
}

/// The cell nearest to a place and its nearest point.
fn nearest<'a>(
    what: &'static str,
    skeleton: &Skeleton,
    cells: impl Iterator<Item = &'a [u32]>,
    place: &Vec3,
) -> Result<(usize, Vec3), Refusal> {
    let on = |corners: &[u32]| {
        let p = |k: usize| skeleton.points[corners[k.min(corners.len() - 1)] as usize];
        let halves = [[p(0), p(1), p(2)], [p(0), p(2), p(3)]];
        let [a, b] = halves.map(|half| nearest_on_triangle(place, &half));
        if (a - place).norm() <= (b - place).norm() {
            a
        } else {
            b
        }
    };
    let found = cells.enumerate().map(|(n, corners)| {
        let point = on(corners);
        let radii = corners.iter().map(|&v| skeleton.radii[v as usize]);
        (n, point, REACH * radii.fold(0.0, f64::max))
    });
    let distance = |p: &Vec3| (p - place).norm();
    match found.min_by(|a, b| distance(&a.1).total_cmp(&distance(&b.1))) {
        Some((n, nearest, reach)) if distance(&nearest) <= reach => Ok((n, nearest)),
        found => Err(Refusal::Nothing {
            what,
            nearest: found.map_or(*place, |f| f.1),
            distance: found.map_or(f64::INFINITY, |f| distance(&f.1)),
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::super::fixtures::{frame, tee};
    use super::*;

    #[test]
    fn beams_end_at_junctions_and_sheets_at_seams() {
        let skeleton = frame();
        assert_eq!(count(&beams(&skeleton)), 12);
        // Above the middle of one beam: all its edges.
        let member = beam_at(&skeleton, &Vec3::new(10.0, 10.0, 1.0)).expect("there are beams");
        assert_eq!(member.beams.len(), 3);
        assert!((member.nearest - Vec3::new(10.0, 10.0, 0.0)).norm() < 1e-12);
        let far = beam_at(&skeleton, &Vec3::new(10.0, 10.0, 3.0));
        assert!(matches!(far, Err(Refusal::Nothing { what: "beam", .. })));
        let tee = tee();
        assert_eq!(count(&sheets(&tee)), 3);
        let web = sheet_at(&tee, &Vec3::new(20.5, 12.0, 9.0)).expect("there are sheets");
        let of_web = |q: &usize| {
            tee.quads[*q]
                .iter()
                .any(|&v| tee.points[v as usize].z > 1.0)
        };
        assert!(!web.quads.is_empty() && web.quads.iter().all(of_web));
        // Without its left half the base and the web are one sheet with a bend.
        let mut angle = tee.clone();
        angle
            .quads
            .retain(|q| q.iter().all(|&v| tee.points[v as usize].x >= 20.0));
        assert_eq!(count(&sheets(&angle)), 1);
        let web = panel_at(&angle, &Vec3::new(20.5, 12.0, 9.0)).expect("there are sheets");
        assert_eq!((web.quads.len(), angle.quads.len()), (6, 12));
    }
}
