//! Half-edges of a closed quad mesh.

use super::catmull_clark::CatmullClarkError;
use super::{ControlMesh, SplineError};
use crate::Vec3;

/// Most points after one split.
const LARGEST: usize = 200_000_000;

/// Connectivity of a closed, oriented, manifold quad mesh. Half-edge `4 q + k` runs from corner `k`
/// of quad `q` to the next corner.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct QuadTopology {
    /// Number of points; points without quads are allowed.
    pub point_count: usize,
    /// The quads.
    pub quads: Vec<[u32; 4]>,
    /// Opposite half-edge of every half-edge.
    pub twin: Vec<u32>,
    /// The lowest outgoing half-edge of every point; `u32::MAX` without quads.
    pub outgoing: Vec<u32>,
    /// Number of quads at each point.
    pub valence: Vec<u32>,
}

impl QuadTopology {
    /// Checks the mesh and links its half-edges.
    ///
    /// # Errors
    /// The first quad, edge or point that is not closed, oriented and manifold.
    pub fn new(point_count: usize, quads: &[[u32; 4]]) -> Result<Self, CatmullClarkError> {
        let count = point_count.saturating_add(quads.len().saturating_mul(3));
        if count > LARGEST {
            return Err(CatmullClarkError::TooLarge {
                count,
                limit: LARGEST,
            });
        }
        let bad = |q: &[u32; 4]| {
            (0..4).any(|k| q[k] as usize >= point_count || q[k + 1..].contains(&q[k]))
        };
        if let Some(quad) = quads.iter().position(bad) {
            return Err(CatmullClarkError::BadQuad { quad: quad as u32 });
        }
        let topology = Self::link(point_count, quads)?;
        let pinched = topology.pinched().next();
        match pinched {
            Some(point) => Err(CatmullClarkError::Pinched { point }),
            None => Ok(topology),
        }
    }

    /// Links the half-edges of quads that are known to be valid.
    fn link(point_count: usize, quads: &[[u32; 4]]) -> Result<Self, CatmullClarkError> {
        let mut topology = Self {
            point_count,
            quads: quads.to_vec(),
            twin: twins(quads)?,
            outgoing: vec![u32::MAX; point_count],
            valence: vec![0; point_count],
        };
        for (q, quad) in quads.iter().enumerate() {
            for (k, &v) in quad.iter().enumerate() {
                topology.valence[v as usize] += 1;
                if topology.outgoing[v as usize] == u32::MAX {
                    topology.outgoing[v as usize] = (4 * q + k) as u32;
                }
            }
        }
        Ok(topology)
    }

    /// Points whose quads form more than one fan.
    fn pinched(&self) -> impl Iterator<Item = u32> + '_ {
        (0..self.point_count as u32)
            .filter(|&v| self.ring(v).count() != self.valence[v as usize] as usize)
    }

    /// Outgoing half-edges of `v`, counter-clockwise seen from outside.
    pub fn ring(&self, v: u32) -> impl Iterator<Item = u32> + '_ {
        let first = self.outgoing[v as usize];
        let mut next = (first != u32::MAX).then_some(first);
        std::iter::from_fn(move || {
            let here = next?;
            let after = self.rotate(here);
            next = (after != first).then_some(after);
            Some(here)
        })
    }

    /// Number of half-edges.
    #[inline]
    pub(super) fn len(&self) -> u32 {
        self.twin.len() as u32
    }

    /// The point where half-edge `h` starts.
    #[inline]
    pub(super) fn origin(&self, h: u32) -> u32 {
        self.quads[(h / 4) as usize][(h % 4) as usize]
    }

    /// The next half-edge counter-clockwise around the origin of `h`.
    #[inline]
    pub(super) fn rotate(&self, h: u32) -> u32 {
        self.twin[previous(h) as usize]
    }

    /// The half-edge straight ahead of `h` behind a regular point.
    #[inline]
    pub(super) fn ahead(&self, h: u32) -> u32 {
        next(self.twin[next(h) as usize])
    }

    /// Four quads around point `v`.
    #[inline]
    pub(super) fn is_regular(&self, v: u32) -> bool {
        self.valence[v as usize] == 4
    }

    /// The point at the end of half-edge `h`.
    #[inline]
    pub fn head(&self, h: u32) -> u32 {
        self.quads[(h / 4) as usize][((h + 1) % 4) as usize]
    }

    /// The corner of the quad of `h` opposite to the start of `h`.
    #[inline]
    pub fn diagonal(&self, h: u32) -> u32 {
        self.quads[(h / 4) as usize][((h + 2) % 4) as usize]
    }

    /// One half-edge an edge, ascending, and the edge of every half-edge.
    pub fn edges(&self) -> (Vec<u32>, Vec<u32>) {
        let mut edges = Vec::with_capacity(self.twin.len() / 2);
        let mut edge_of = vec![0; self.twin.len()];
        for h in 0..self.twin.len() as u32 {
            let twin = self.twin[h as usize];
            if h < twin {
                edge_of[h as usize] = edges.len() as u32;
                edge_of[twin as usize] = edges.len() as u32;
                edges.push(h);
            }
        }
        (edges, edge_of)
    }

    /// V - E + F over the points in use.
    pub fn euler(&self) -> i64 {
        let vertices = self.valence.iter().filter(|&&n| n > 0).count() as i64;
        vertices - self.quads.len() as i64
    }
}

/// The half-edge after `h` in its quad.
#[inline]
pub(super) fn next(h: u32) -> u32 {
    (h & !3) | ((h + 1) & 3)
}

/// The half-edge before `h` in its quad.
#[inline]
pub(super) fn previous(h: u32) -> u32 {
    (h & !3) | ((h + 3) & 3)
}

/// Half-edges by the two points of their edge, lower one first, and whether they run against that.
fn sorted_half_edges(quads: &[[u32; 4]]) -> Vec<([u32; 2], bool, u32)> {
    let mut list = Vec::with_capacity(4 * quads.len());
    for (q, quad) in quads.iter().enumerate() {
        for k in 0..4 {
            let (a, b) = (quad[k], quad[(k + 1) % 4]);
            list.push(([a.min(b), a.max(b)], a > b, (4 * q + k) as u32));
        }
    }
    list.sort_unstable();
    list
}

/// The twin of every half-edge.
fn twins(quads: &[[u32; 4]]) -> Result<Vec<u32>, CatmullClarkError> {
    let sorted = sorted_half_edges(quads);
    let mut twin = vec![u32::MAX; sorted.len()];
    for uses in sorted.chunk_by(|x, y| x.0 == y.0) {
        match *uses {
            [(_, false, h), (_, true, g)] => {
                twin[h as usize] = g;
                twin[g as usize] = h;
            }
            _ => return Err(CatmullClarkError::BadEdge { edge: uses[0].0 }),
        }
    }
    Ok(twin)
}

/// An edge that is not used once in each sense.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct BadEdge {
    /// Its points, the lower one first.
    pub edge: [u32; 2],
    /// One of its quads.
    pub quad: u32,
    /// Quads that run from the lower to the higher point.
    pub along: u32,
    /// Quads that run from the higher to the lower point.
    pub against: u32,
}

/// All edges that are not used once in each sense.
pub(crate) fn bad_edges(quads: &[[u32; 4]]) -> Vec<BadEdge> {
    sorted_half_edges(quads)
        .chunk_by(|x, y| x.0 == y.0)
        .map(|uses| {
            let against = uses.iter().filter(|u| u.1).count() as u32;
            BadEdge {
                edge: uses[0].0,
                quad: uses[0].2 / 4,
                along: uses.len() as u32 - against,
                against,
            }
        })
        .filter(|e| (e.along, e.against) != (1, 1))
        .collect()
}

/// Connectivity of a mesh that is fit for patches: valid quads, at least three around every point.
pub(super) fn connect(mesh: &ControlMesh) -> Result<QuadTopology, SplineError> {
    check_quads(mesh)?;
    let Ok(topology) = QuadTopology::link(mesh.points.len(), &mesh.quads) else {
        return Err(name_bad_edges(mesh));
    };
    let place = |point: u32| mesh.points[point as usize].into();
    let pinched: Vec<u32> = topology.pinched().collect();
    if let Some(&point) = pinched.first() {
        return Err(SplineError::PinchedPoint {
            point,
            place: place(point),
            count: pinched.len(),
        });
    }
    let few = |v: &u32| matches!(topology.valence[*v as usize], 1 | 2);
    let bad: Vec<u32> = (0..topology.point_count as u32).filter(few).collect();
    if let Some(&point) = bad.first() {
        return Err(SplineError::Valence {
            point,
            valence: topology.valence[point as usize],
            place: place(point),
            count: bad.len(),
        });
    }
    Ok(topology)
}

fn check_quads(mesh: &ControlMesh) -> Result<(), SplineError> {
    const LIMIT: usize = LARGEST / 3;
    const FARTHEST: f64 = 1e12;
    if mesh.quads.is_empty() {
        return Err(SplineError::Empty);
    }
    if mesh.quads.len() > LIMIT {
        return Err(SplineError::TooLarge {
            quads: mesh.quads.len(),
            limit: LIMIT,
        });
    }
    if let Some(point) = mesh
        .points
        .iter()
        .position(|p| !p.iter().all(|x| x.abs() <= FARTHEST))
    {
        return Err(SplineError::NotFinite { point });
    }
    for (quad, corners) in mesh.quads.iter().enumerate() {
        for (k, &point) in corners.iter().enumerate() {
            if point as usize >= mesh.points.len() {
                return Err(SplineError::MissingPoint {
                    quad,
                    point,
                    points: mesh.points.len(),
                });
            }
            if corners[..k].contains(&point) {
                return Err(SplineError::DegenerateQuad {
                    quad,
                    point,
                    place: mesh.points[point as usize].into(),
                });
            }
        }
    }
    Ok(())
}

/// The error for the first edge that is not used once in each sense.
fn name_bad_edges(mesh: &ControlMesh) -> SplineError {
    let bad = bad_edges(&mesh.quads);
    let open = |e: &BadEdge| e.along + e.against == 1;
    let Some(&first) = bad.first() else {
        return SplineError::Empty;
    };
    let BadEdge {
        edge,
        quad,
        along,
        against,
    } = first;
    let place = middle(mesh, edge).into();
    let count = bad.iter().filter(|e| open(e) == open(&first)).count();
    if open(&first) {
        return SplineError::OpenEdge {
            edge,
            quad: quad as usize,
            place,
            count,
        };
    }
    SplineError::NonManifoldEdge {
        edge,
        along: along as usize,
        against: against as usize,
        place,
        count,
    }
}

fn middle(mesh: &ControlMesh, edge: [u32; 2]) -> Vec3 {
    (mesh.points[edge[0] as usize] + mesh.points[edge[1] as usize]) / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes::{CUBOID, cuboid_corners};

    fn cube() -> ControlMesh {
        ControlMesh {
            points: cuboid_corners(Vec3::zeros(), Vec3::repeat(1.0)),
            quads: CUBOID.to_vec(),
        }
    }

    fn error(mesh: &ControlMesh) -> SplineError {
        let error = connect(mesh).expect_err("an error");
        assert!(error.hint().is_some(), "{error}");
        error
    }

    #[test]
    fn cube_is_connected() {
        let half_edges = connect(&cube()).expect("a valid cube");
        assert_eq!(half_edges.euler(), 2);
        for h in 0..half_edges.len() {
            assert_eq!(half_edges.twin[half_edges.twin[h as usize] as usize], h);
            assert_eq!(
                half_edges.origin(half_edges.twin[h as usize]),
                half_edges.head(h)
            );
            assert_eq!(half_edges.ring(half_edges.origin(h)).count(), 3);
        }
    }

    #[test]
    fn bad_meshes_are_named() {
        assert_eq!(error(&ControlMesh::default()), SplineError::Empty);
        let mut mesh = cube();
        mesh.quads[3][2] = 9;
        assert_eq!(
            error(&mesh),
            SplineError::MissingPoint {
                quad: 3,
                point: 9,
                points: 8
            }
        );
        for bad in [f64::NAN, f64::INFINITY, -1e200] {
            let mut mesh = cube();
            mesh.points[5].y = bad;
            assert_eq!(error(&mesh), SplineError::NotFinite { point: 5 });
        }
        let mut mesh = cube();
        mesh.quads[2][1] = 0;
        assert!(matches!(
            error(&mesh),
            SplineError::DegenerateQuad {
                quad: 2,
                point: 0,
                ..
            }
        ));
        let mut mesh = cube();
        mesh.quads.pop();
        assert!(matches!(
            error(&mesh),
            SplineError::OpenEdge {
                edge: [1, 3],
                quad: 0,
                count: 4,
                ..
            }
        ));
        let mut mesh = cube();
        mesh.quads[0].reverse();
        assert!(matches!(
            error(&mesh),
            SplineError::NonManifoldEdge {
                edge: [0, 1],
                count: 4,
                ..
            }
        ));
    }

    #[test]
    fn touching_cubes_are_pinched() {
        let (mut mesh, mut other) = (cube(), cube());
        other
            .points
            .iter_mut()
            .for_each(|p| *p += Vec3::new(1.0, 1.0, 1.0));
        other
            .quads
            .iter_mut()
            .flatten()
            .for_each(|v| *v = if *v == 0 { 7 } else { *v + 8 });
        mesh.points.append(&mut other.points);
        mesh.quads.append(&mut other.quads);
        assert!(matches!(
            error(&mesh),
            SplineError::PinchedPoint {
                point: 7,
                count: 1,
                ..
            }
        ));
    }

    #[test]
    fn two_quads_around_a_point_are_refused() {
        let points = (0..4)
            .map(|k| Vec3::new(f64::from(k & 1), f64::from(k >> 1), 0.0))
            .collect();
        let pillow = ControlMesh {
            points,
            quads: vec![[0, 1, 3, 2], [0, 2, 3, 1]],
        };
        assert!(matches!(
            error(&pillow),
            SplineError::Valence {
                point: 0,
                valence: 2,
                count: 4,
                ..
            }
        ));
    }
}
