//! Nodes of beams so near each other that a designer would draw one.

use super::arcs::{self, ArcKind};
use super::complex::Complex;

/// Contracts beams between nodes that are shorter than `ratio` times the mean radius of the two, shortest first. A beam between
/// two sheets stays: they must not come to touch in a point. Returns how many went.
///
/// The spheres of such nodes touch, so nothing of a beam is left between them, and the rings of the thickened body around one
/// node would cut those around the other.
pub(crate) fn merge_nodes(c: &mut Complex, ratio: f64) -> usize {
    let mut merged = 0;
    loop {
        let mut short: Vec<(f64, Vec<u32>)> = arcs::trace(c)
            .arcs
            .into_iter()
            .filter(|arc| arc.kind == ArcKind::Beam)
            .filter_map(|arc| Some((excess(c, &arc.vertices, ratio)?, arc.vertices)))
            .collect();
        short.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        // One at a time: the others may end in a node that moved.
        if !short.iter().any(|(_, path)| contract(c, path)) {
            break;
        }
        merged += 1;
    }
    c.compact();
    merged
}

/// Length of a beam over the limit, when it joins two nodes and is shorter.
fn excess(c: &Complex, path: &[u32], ratio: f64) -> Option<f64> {
    let (a, b) = (path[0], path[path.len() - 1]);
    let joins = a != b && is_node(c, a) && is_node(c, b) && !(on_sheet(c, a) && on_sheet(c, b));
    let length: f64 = path.windows(2).map(|e| c.length(e[0], e[1])).sum();
    let limit = ratio * (c.radii[a as usize] + c.radii[b as usize]) / 2.0;
    (joins && length < limit).then(|| length / limit)
}

/// Whether three members or more meet; at a rim its sheet is one member, elsewhere it goes on beyond.
fn is_node(c: &Complex, v: u32) -> bool {
    let beams = c.vertex_beams[v as usize].len();
    match (on_sheet(c, v), on_rim(c, v)) {
        (false, _) => beams > 2,
        (true, true) => beams > 1,
        (true, false) => beams > 0,
    }
}

fn on_rim(c: &Complex, v: u32) -> bool {
    c.neighbours(v).iter().any(|&w| c.face_count(v, w) == 1)
}

fn on_sheet(c: &Complex, v: u32) -> bool {
    !c.vertex_triangles[v as usize].is_empty()
}

/// Contracts a beam to its middle, or to its end inside a sheet.
fn contract(c: &mut Complex, path: &[u32]) -> bool {
    let (a, b) = (path[0], path[path.len() - 1]);
    let mut path = path.to_vec();
    if on_sheet(c, a) {
        path.reverse();
    }
    let kept = path[path.len() - 1];
    // Whether the whole beam can go shows on its last edge: the others have nothing beside them.
    for pair in path[..path.len() - 1].windows(2) {
        if !c.link_condition(pair[0], pair[1]) {
            return false;
        }
        c.collapse(pair[0], pair[1]);
    }
    let last = path[path.len() - 2];
    if !c.link_condition(last, kept) {
        return false;
    }
    c.collapse(last, kept);
    if !on_sheet(c, kept) || on_rim(c, kept) {
        let [i, j] = [a, b].map(|v| v as usize);
        let (p, q) = (c.points[i], c.points[j]);
        c.points[kept as usize] = (p + q) / 2.0;
        c.radii[kept as usize] = c.radii[i].max(c.radii[j]);
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Vec3;

    const NONE: [[u32; 3]; 0] = [];

    fn x(x: f64, y: f64) -> Vec3 {
        Vec3::new(x, y, 0.0)
    }

    #[test]
    fn two_nodes_two_radii_apart_were_kept_and_their_bodies_cut_each_other() {
        // An H with a short bar of two beams; its legs are long.
        let points = vec![
            x(-2.0, 0.0),
            x(0.0, 0.5),
            x(2.0, 0.0),
            x(-9.0, 20.0),
            x(-9.0, -20.0),
            x(9.0, 20.0),
            x(9.0, -20.0),
        ];
        let beams = [[0, 1], [1, 2], [0, 3], [0, 4], [2, 5], [2, 6]];
        let merged = |ratio| {
            let mut c = Complex::new(points.clone(), vec![2.0; 7], &NONE, &beams);
            let before = c.betti();
            let count = merge_nodes(&mut c, ratio);
            assert_eq!(c.betti(), before);
            (count, c)
        };
        assert_eq!(merged(2.0).0, 0);
        let (count, c) = merged(3.0);
        assert_eq!((count, c.alive_beams().count()), (1, 4));
        let node = (0..c.points.len() as u32).find(|&v| c.vertex_beams[v as usize].len() == 4);
        assert_eq!(node.map(|v| c.points[v as usize]), Some(x(0.0, 0.0)));
    }

    #[test]
    fn a_ring_of_short_beams_stays_a_ring() {
        let ring = [x(0.0, 0.0), x(2.0, 0.0), x(1.0, 2.0)];
        let points: Vec<Vec3> = ring.iter().copied().chain(ring.map(|p| 30.0 * p)).collect();
        let beams = [[0, 1], [1, 2], [2, 0], [0, 3], [1, 4], [2, 5]];
        let mut c = Complex::new(points, vec![2.0; 6], &NONE, &beams);
        let before = c.betti();
        merge_nodes(&mut c, 3.0);
        assert_eq!(c.betti(), before);
    }

    #[test]
    fn a_sheet_that_goes_over_into_a_beam_is_no_node() {
        // A short beam between a sheet's corner and the foot of a fork.
        let points = vec![
            x(-20.0, 10.0),
            x(-20.0, -10.0),
            x(0.0, 0.0),
            x(4.0, 0.0),
            x(30.0, 10.0),
            x(30.0, -10.0),
        ];
        let beams = [[2, 3], [3, 4], [3, 5]];
        let mut c = Complex::new(points.clone(), vec![2.0; 6], &[[0, 1, 2]], &beams);
        assert_eq!(merge_nodes(&mut c, 3.0), 0);
        // With another beam there it is.
        let points = [points, vec![x(0.0, 40.0)]].concat();
        let beams = [[2, 3], [3, 4], [3, 5], [2, 6]];
        let mut c = Complex::new(points, vec![2.0; 7], &[[0, 1, 2]], &beams);
        let before = c.betti();
        assert_eq!(merge_nodes(&mut c, 3.0), 1);
        assert_eq!(c.betti(), before);
    }
}
