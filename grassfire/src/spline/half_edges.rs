//! Half-edges of a closed quad mesh.

use super::{ControlMesh, SplineError};
use crate::Vec3;

/// Connectivity of a closed, oriented, manifold quad mesh.
/// Half-edge `4 q + k` runs from corner `k` of quad `q` to the next corner; its quad lies on the left.
pub(super) struct HalfEdges {
    /// The point where each half-edge starts.
    pub origin: Vec<u32>,
    /// The half-edge that runs the other way in the neighbouring quad.
    pub twin: Vec<u32>,
    /// Quads around each point; 0 for points that no quad uses.
    pub valence: Vec<u32>,
    /// The lowest half-edge that leaves each point; `u32::MAX` for points that no quad uses.
    pub first: Vec<u32>,
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

impl HalfEdges {
    /// Number of half-edges.
    #[inline]
    pub fn len(&self) -> u32 {
        self.twin.len() as u32
    }

    /// The point where half-edge `h` ends.
    #[inline]
    pub fn target(&self, h: u32) -> u32 {
        self.origin[next(h) as usize]
    }

    /// The next half-edge counter-clockwise around the origin of `h`.
    #[inline]
    pub fn rotate(&self, h: u32) -> u32 {
        self.twin[previous(h) as usize]
    }

    /// The half-edge straight ahead of `h` behind a regular point.
    #[inline]
    pub fn ahead(&self, h: u32) -> u32 {
        next(self.twin[next(h) as usize])
    }

    /// Four quads around point `v`.
    #[inline]
    pub fn is_regular(&self, v: u32) -> bool {
        self.valence[v as usize] == 4
    }

    /// Half-edges that leave point `v`, counter-clockwise from the lowest one.
    pub fn ring(&self, v: u32) -> impl Iterator<Item = u32> + '_ {
        let mut h = self.first[v as usize];
        (0..self.valence[v as usize]).map(move |_| {
            let this = h;
            h = self.rotate(h);
            this
        })
    }

    /// V - E + F of the points in use.
    pub fn euler(&self) -> i64 {
        let vertices = self.valence.iter().filter(|n| **n > 0).count() as i64;
        vertices - self.twin.len() as i64 / 4
    }

    /// Builds and checks the connectivity of `mesh`.
    pub fn new(mesh: &ControlMesh) -> Result<Self, SplineError> {
        check_quads(mesh)?;
        let origin: Vec<u32> = mesh.quads.iter().flatten().copied().collect();
        let twin = pair(mesh, &origin)?;
        let mut valence = vec![0; mesh.points.len()];
        let mut first = vec![u32::MAX; mesh.points.len()];
        for (h, &v) in origin.iter().enumerate().rev() {
            valence[v as usize] += 1;
            first[v as usize] = h as u32;
        }
        let half_edges = Self {
            origin,
            twin,
            valence,
            first,
        };
        half_edges.check_points(mesh)?;
        Ok(half_edges)
    }

    /// Every point must have one fan of at least three quads.
    fn check_points(&self, mesh: &ControlMesh) -> Result<(), SplineError> {
        let used = || (0..mesh.points.len() as u32).filter(|&v| self.valence[v as usize] > 0);
        let pinched = |v: &u32| {
            let start = self.first[*v as usize];
            let mut h = self.rotate(start);
            let mut quads = 1;
            while h != start {
                h = self.rotate(h);
                quads += 1;
            }
            quads != self.valence[*v as usize]
        };
        let bad: Vec<u32> = used().filter(pinched).collect();
        if let Some(&point) = bad.first() {
            return Err(SplineError::PinchedPoint {
                point,
                place: mesh.points[point as usize].into(),
                count: bad.len(),
            });
        }
        let bad: Vec<u32> = used().filter(|&v| self.valence[v as usize] < 3).collect();
        if let Some(&point) = bad.first() {
            let place = mesh.points[point as usize].into();
            return Err(SplineError::Valence {
                point,
                valence: self.valence[point as usize],
                place,
                count: bad.len(),
            });
        }
        Ok(())
    }
}

fn check_quads(mesh: &ControlMesh) -> Result<(), SplineError> {
    const LIMIT: usize = 1 << 28;
    const LARGEST: f64 = 1e12;
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
        .position(|p| !p.iter().all(|x| x.abs() <= LARGEST))
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

/// Finds the twin of every half-edge by sorting them by their two points.
fn pair(mesh: &ControlMesh, origin: &[u32]) -> Result<Vec<u32>, SplineError> {
    let ends = |h: u32| [origin[h as usize], origin[next(h) as usize]];
    let mut sorted: Vec<([u32; 2], u32)> = (0..origin.len() as u32)
        .map(|h| {
            let [a, b] = ends(h);
            ([a.min(b), a.max(b)], h)
        })
        .collect();
    sorted.sort_unstable();
    let mut twin = vec![0; origin.len()];
    let mut bad: Vec<&[([u32; 2], u32)]> = Vec::new();
    for group in sorted.chunk_by(|x, y| x.0 == y.0) {
        match group {
            [(_, h), (_, g)] if ends(*h) != ends(*g) => {
                twin[*h as usize] = *g;
                twin[*g as usize] = *h;
            }
            _ => bad.push(group),
        }
    }
    let Some(group) = bad.first() else {
        return Ok(twin);
    };
    let (edge, h) = group[0];
    let place = middle(mesh, edge).into();
    if group.len() == 1 {
        let count = bad.iter().filter(|g| g.len() == 1).count();
        return Err(SplineError::OpenEdge {
            edge,
            quad: h as usize / 4,
            place,
            count,
        });
    }
    let along = group.iter().filter(|(_, h)| ends(*h) == edge).count();
    let count = bad.iter().filter(|g| g.len() > 1).count();
    Err(SplineError::NonManifoldEdge {
        edge,
        along,
        against: group.len() - along,
        place,
        count,
    })
}

fn middle(mesh: &ControlMesh, edge: [u32; 2]) -> Vec3 {
    (mesh.points[edge[0] as usize] + mesh.points[edge[1] as usize]) / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube() -> ControlMesh {
        let points = (0..8)
            .map(|k| Vec3::new(f64::from(k & 1), f64::from(k >> 1 & 1), f64::from(k >> 2)))
            .collect();
        let quads = vec![
            [0, 2, 3, 1],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 4, 6, 2],
            [1, 3, 7, 5],
        ];
        ControlMesh { points, quads }
    }

    fn error(mesh: &ControlMesh) -> SplineError {
        let error = HalfEdges::new(mesh).err().expect("an error");
        assert!(error.hint().is_some(), "{error}");
        error
    }

    #[test]
    fn cube_is_connected() {
        let half_edges = HalfEdges::new(&cube()).expect("a valid cube");
        assert_eq!(half_edges.euler(), 2);
        for h in 0..half_edges.len() {
            assert_eq!(half_edges.twin[half_edges.twin[h as usize] as usize], h);
            assert_eq!(
                half_edges.origin[half_edges.twin[h as usize] as usize],
                half_edges.target(h)
            );
            assert_eq!(half_edges.ring(half_edges.origin[h as usize]).count(), 3);
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
