//! Rims of a skeleton, found by a place.

use super::error::Refusal;
use crate::Vec3;
use crate::mesh::bvh::nearest_on_triangle;
use crate::skeleton::{EdgeTable, Skeleton};

/// A place is at a rim no farther from it than this many radii.
const REACH: f64 = 1.25;
/// A rim has a corner where it turns by more than this, degrees.
const CORNER: f64 = 45.0;

/// A rim: edges with one quad, from corner to corner.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Rim {
    /// Its points in order; of a closed one each once.
    pub(super) points: Vec<u32>,
    /// Whether its last point is joined to its first.
    pub(super) closed: bool,
}

impl Rim {
    /// Number of edges.
    pub(super) fn edges(&self) -> usize {
        self.points.len() - usize::from(!self.closed)
    }

    /// Length, mm.
    pub(super) fn length(&self, points: &[Vec3]) -> f64 {
        let at = |n: usize| points[self.points[n % self.points.len()] as usize];
        (0..self.edges()).map(|n| (at(n + 1) - at(n)).norm()).sum()
    }
}

/// The rim at a place: both ways along from its nearest edge, until other rims, beams or a corner of more than 45 degrees.
///
/// # Errors
/// [`Refusal::Nothing`] when the nearest rim is farther away than its wall.
pub(super) fn rim_at(skeleton: &Skeleton, place: &Vec3) -> Result<Rim, Refusal> {
    let points = &skeleton.points;
    let table = EdgeTable::of_quads(&skeleton.quads);
    let edges: Vec<[u32; 2]> = (table.iter().filter(|e| e.1.len() == 1))
        .map(|e| e.0)
        .collect();
    let on = |e: &[u32; 2]| {
        let [a, b] = e.map(|v| points[v as usize]);
        nearest_on_triangle(place, &[a, b, b])
    };
    let distance = |e: &[u32; 2]| (on(e) - place).norm();
    let nearest = edges
        .iter()
        .min_by(|a, b| distance(a).total_cmp(&distance(b)));
    let reach = |e: &[u32; 2]| {
        REACH
            * e.map(|v| skeleton.radii[v as usize])
                .into_iter()
                .fold(0.0, f64::max)
    };
    let Some(&first) = nearest.filter(|e| distance(e) <= reach(e)) else {
        return Err(Refusal::Nothing {
            what: "rim",
            nearest: nearest.map_or(*place, on),
            distance: nearest.map_or(f64::INFINITY, distance),
        });
    };
    let mut along: Vec<Vec<u32>> = vec![Vec::new(); points.len()];
    for &[a, b] in &edges {
        along[a as usize].push(b);
        along[b as usize].push(a);
    }
    // Beams end rims, too.
    for &[a, b] in &skeleton.beams {
        along[a as usize].push(b);
        along[b as usize].push(a);
    }
    let ahead = walk(first, &along, points);
    if ahead.first() == ahead.last() {
        let points = ahead[1..].to_vec();
        return Ok(Rim {
            points,
            closed: true,
        });
    }
    let back = walk([first[1], first[0]], &along, points);
    let before = back[2..].iter().rev().copied();
    Ok(Rim {
        points: before.chain(ahead).collect(),
        closed: false,
    })
}

/// The points from an edge on, until a corner or the first point again.
fn walk(edge: [u32; 2], along: &[Vec<u32>], points: &[Vec3]) -> Vec<u32> {
    let mut path = edge.to_vec();
    loop {
        let (from, at) = (path[path.len() - 2], path[path.len() - 1]);
        let next = match along[at as usize][..] {
            [a, b] if a == from => b,
            [a, b] if b == from => a,
            _ => return path,
        };
        let [p, q, r] = [from, at, next].map(|v| points[v as usize]);
        if at == edge[0] || (q - p).angle(&(r - q)).to_degrees() > CORNER {
            return path;
        }
        path.push(next);
    }
}

#[cfg(test)]
mod tests {
    use super::super::fixtures::tee;
    use super::*;

    #[test]
    fn rims_end_at_corners_and_seams() {
        let skeleton = tee();
        let edges = |x, y, z| rim_at(&skeleton, &Vec3::new(x, y, z)).map(|rim| rim.edges());
        assert_eq!(edges(40.0, 15.0, 0.0), Ok(3));
        assert_eq!(edges(20.0, 15.0, 21.0), Ok(3));
        assert_eq!(edges(5.0, -1.0, 0.0), Ok(2));
        assert_eq!(edges(20.0, 0.0, 8.0), Ok(2));
    }

    #[test]
    fn a_round_rim_is_closed() {
        // A tube of twelve quads.
        let mut tube = Skeleton::default();
        for n in 0..12_u32 {
            let (y, x) = (f64::from(n) * std::f64::consts::FRAC_PI_6).sin_cos();
            tube.points
                .extend([0.0, 8.0].map(|z| Vec3::new(10.0 * x, 10.0 * y, z)));
            let (a, b) = (2 * n, 2 * ((n + 1) % 12));
            tube.quads.push([a, b, b + 1, a + 1]);
        }
        tube.radii = vec![1.0; 24];
        let rim = rim_at(&tube, &Vec3::new(10.1, 0.0, 0.0)).expect("a rim");
        assert_eq!((rim.points.len(), rim.closed), (12, true));
        let side = 20.0 * (std::f64::consts::PI / 12.0).sin();
        assert!((rim.length(&tube.points) - 12.0 * side).abs() < 1e-9);
    }
}
