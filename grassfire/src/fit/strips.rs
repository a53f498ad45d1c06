//! Strips of quads of a closed quad mesh, and their splitting lengthwise.

use crate::Vec3;
use crate::skeleton::Skeleton;
use crate::spline::catmull_clark::QuadTopology;
use crate::thicken::ThickenedBody;

/// The strips of a mesh: the edges met when quads are crossed from edge to opposite edge. Each is closed; every quad
/// lies in two, or twice in one.
pub(super) struct Strips {
    pub count: usize,
    /// Strip of every half-edge.
    pub of: Vec<u32>,
    /// Edge of every half-edge.
    pub edge_of: Vec<u32>,
    pub edge_count: usize,
}

impl Strips {
    pub fn new(topology: &QuadTopology) -> Self {
        let (edges, edge_of) = topology.edges();
        let mut of = vec![u32::MAX; topology.twin.len()];
        let mut count = 0;
        for &start in &edges {
            if of[start as usize] != u32::MAX {
                continue;
            }
            // Every half-edge has one opposite in its quad and one twin, so this runs along the strip and back to the start.
            let mut h = start;
            while of[h as usize] == u32::MAX {
                let opposite = (h & !3) | ((h + 2) & 3);
                of[h as usize] = count;
                of[opposite as usize] = count;
                h = topology.twin[opposite as usize];
            }
            count += 1;
        }
        Self {
            count: count as usize,
            of,
            edge_of,
            edge_count: edges.len(),
        }
    }

    /// The strip that crosses edges `direction` and `direction + 2` of quad `q`.
    pub fn across(&self, q: usize, direction: usize) -> u32 {
        self.of[4 * q + direction]
    }
}

/// A body whose strips were split.
pub(super) struct Halves {
    pub body: ThickenedBody,
    /// Where its points lie: old point (below their number), the middle of an old edge (counted on from there) or of an
    /// old quad (counted on from there).
    pub origin: Vec<usize>,
    /// Old quad of every quad.
    pub parent: Vec<u32>,
}

/// Splits the chosen strips lengthwise.
///
/// No extraordinary point is made: new points have four quads around them, and old points keep their number. A quad
/// crossed by two chosen strips, or twice by one, becomes four. New points lie in the middle of their edge or quad, their
/// feet too; they belong to that skeleton point of their ends which is nearest to the foot.
pub(super) fn split(
    body: &ThickenedBody,
    skeleton: &Skeleton,
    strips: &Strips,
    chosen: &[bool],
) -> Halves {
    let n = body.mesh.points.len();
    let mut out = body.clone();
    let mut origin: Vec<usize> = (0..n).collect();
    let mut add = |ends: &[u32], place: usize| {
        let mean =
            |all: &[Vec3]| ends.iter().map(|&v| all[v as usize]).sum::<Vec3>() / ends.len() as f64;
        let foot = mean(&body.foot);
        let sources = ends.iter().map(|&v| body.source[v as usize]);
        let far = |s: &u32| (skeleton.points[*s as usize] - foot).norm_squared();
        let source = sources.min_by(|a, b| far(a).total_cmp(&far(b)).then(a.cmp(b)));
        out.mesh.points.push(mean(&body.mesh.points));
        out.foot.push(foot);
        out.source.extend(source);
        origin.push(place);
        (origin.len() - 1) as u32
    };
    let mut middle = vec![u32::MAX; strips.edge_count];
    let (mut quads, mut parent) = (Vec::new(), Vec::new());
    for (q, quad) in body.mesh.quads.iter().enumerate() {
        let cut = [0, 1].map(|d| chosen[strips.across(q, d) as usize]);
        let mut m = [u32::MAX; 4];
        for k in (0..4).filter(|k| cut[k % 2]) {
            let edge = strips.edge_of[4 * q + k] as usize;
            if middle[edge] == u32::MAX {
                middle[edge] = add(&[quad[k], quad[(k + 1) % 4]], n + edge);
            }
            m[k] = middle[edge];
        }
        let [a, b, c, d] = *quad;
        match cut {
            [false, false] => quads.push(*quad),
            [true, false] => quads.extend([[a, m[0], m[2], d], [m[0], b, c, m[2]]]),
            [false, true] => quads.extend([[a, b, m[1], m[3]], [m[3], m[1], c, d]]),
            [true, true] => {
                let f = add(quad, n + strips.edge_count + q);
                quads.extend([
                    [a, m[0], f, m[3]],
                    [m[0], b, m[1], f],
                    [f, m[1], c, m[2]],
                    [m[3], f, m[2], d],
                ]);
            }
        }
        parent.resize(quads.len(), q as u32);
    }
    out.mesh.quads = quads;
    Halves {
        body: out,
        origin,
        parent,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes::{CUBOID, cuboid_corners};
    use crate::spline::ControlMesh;

    fn cube() -> (ThickenedBody, Skeleton) {
        let mesh = ControlMesh {
            points: cuboid_corners(Vec3::zeros(), Vec3::repeat(2.0)),
            quads: CUBOID.to_vec(),
        };
        let body = ThickenedBody {
            source: vec![0; 8],
            foot: vec![Vec3::repeat(1.0); 8],
            mesh,
            ..ThickenedBody::default()
        };
        let skeleton = Skeleton {
            points: vec![Vec3::repeat(1.0)],
            radii: vec![1.0],
            ..Skeleton::default()
        };
        (body, skeleton)
    }

    fn valences(body: &ThickenedBody) -> Vec<u32> {
        let topology = QuadTopology::new(body.mesh.points.len(), &body.mesh.quads);
        topology.expect("closed and oriented").valence
    }

    #[test]
    fn a_cube_has_three_strips_of_four_quads() {
        let (body, _) = cube();
        let topology = QuadTopology::new(8, &body.mesh.quads).expect("a cube");
        let strips = Strips::new(&topology);
        assert_eq!(strips.count, 3);
        for s in 0..3 {
            let crossed = (0..24).filter(|h| strips.of[*h] == s).count();
            assert_eq!(crossed, 8);
        }
        let twins = topology.twin.iter().enumerate();
        assert!(
            twins
                .clone()
                .all(|(h, t)| strips.of[h] == strips.of[*t as usize])
        );
    }

    #[test]
    fn splitting_makes_no_extraordinary_point() {
        let (body, skeleton) = cube();
        let strips = Strips::new(&QuadTopology::new(8, &body.mesh.quads).expect("a cube"));
        for (chosen, quads) in [
            ([true, false, false], 10),
            ([true, true, false], 16),
            ([true, true, true], 24),
            ([false; 3], 6),
        ] {
            let halves = split(&body, &skeleton, &strips, &chosen);
            let (finer, origin) = (halves.body, halves.origin);
            assert_eq!(halves.parent.len(), quads);
            assert_eq!(finer.mesh.quads.len(), quads);
            let valences = valences(&finer);
            assert!(valences[..8].iter().all(|n| *n == 3));
            assert!(valences[8..].iter().all(|n| *n == 4));
            assert_eq!(origin.len(), finer.mesh.points.len());
            assert_eq!(finer.source.len(), finer.mesh.points.len());
            assert_eq!(finer.foot.len(), finer.mesh.points.len());
        }
    }
}
