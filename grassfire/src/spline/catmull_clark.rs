//! Catmull-Clark subdivision as sparse operators: one split, limit positions, limit tangents.
//!
//! All operators depend on the connectivity only, so a fit builds them once and applies them to
//! every iterate.
//!
//! Sources: E. Catmull, J. Clark, "Recursively generated B-spline surfaces on arbitrary topological
//! meshes", 1978, doi:10.1016/0010-4485(78)90110-0; limit masks from M. Halstead, M. Kass,
//! T. DeRose, "Efficient, fair interpolation using Catmull-Clark surfaces", 1993,
//! doi:10.1145/166117.166121.

use std::f64::consts::PI;

use super::ControlMesh;
pub use super::half_edges::QuadTopology;
pub use super::stencils::Stencils;
use crate::mesh::TriMesh;

/// Why a quad mesh cannot be subdivided; names the first offender.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum CatmullClarkError {
    /// A quad uses a point twice or a point that does not exist.
    #[error("quad {quad} is degenerate or names a missing point")]
    BadQuad {
        /// Index of the quad.
        quad: u32,
    },
    /// An edge is not used exactly once in each sense.
    #[error("edge {edge:?} is not used exactly once in each sense")]
    BadEdge {
        /// The two point indices.
        edge: [u32; 2],
    },
    /// The quads around a point form more than one fan.
    #[error("point {point} is pinched: its quads form more than one fan")]
    Pinched {
        /// Index of the point.
        point: u32,
    },
    /// More indices than 32 bits hold.
    #[error("the refined mesh would have {count} points, more than {limit}")]
    TooLarge {
        /// Points of the refined mesh.
        count: usize,
        /// Largest number allowed.
        limit: usize,
    },
}

impl CatmullClarkError {
    /// What the user can do about it.
    pub fn hint(&self) -> Option<String> {
        let text = match self {
            Self::TooLarge { .. } => "use fewer levels or a coarser control mesh",
            _ => "the control mesh must be closed, oriented and manifold",
        };
        Some(text.to_owned())
    }
}

impl QuadTopology {
    /// One Catmull-Clark split: the operator and the refined connectivity.
    ///
    /// New points: the old ones, then one an edge, then one a quad. Quad `q` becomes quads
    /// `4 q + k`, child `k` holding old corner `k` first.
    pub fn split(&self) -> Result<(Stencils, QuadTopology), CatmullClarkError> {
        let (edges, edge_of) = self.edges();
        let mut split = Stencils::new(self.point_count);
        let mut entries = Vec::new();
        for v in 0..self.point_count as u32 {
            entries.clear();
            self.vertex_rule(v, &mut entries);
            split.push(&mut entries);
        }
        for &h in &edges {
            entries.clear();
            let ends = [self.head(h), self.head(self.twin[h as usize])];
            entries.extend(ends.map(|v| (v, 0.25)));
            for side in [h, self.twin[h as usize]] {
                let quad = self.quads[(side / 4) as usize];
                entries.extend(quad.map(|v| (v, 0.0625)));
            }
            split.push(&mut entries);
        }
        for quad in &self.quads {
            entries.clear();
            entries.extend(quad.map(|v| (v, 0.25)));
            split.push(&mut entries);
        }
        let edge_point = |h: usize| (self.point_count + edge_of[h] as usize) as u32;
        let quad_point = |q: usize| (self.point_count + edges.len() + q) as u32;
        let mut quads = Vec::with_capacity(4 * self.quads.len());
        for (q, quad) in self.quads.iter().enumerate() {
            for (k, &v) in quad.iter().enumerate() {
                let before = 4 * q + (k + 3) % 4;
                quads.push([v, edge_point(4 * q + k), quad_point(q), edge_point(before)]);
            }
        }
        let refined = QuadTopology::new(split.rows(), &quads)?;
        Ok((split, refined))
    }

    fn vertex_rule(&self, v: u32, entries: &mut Vec<(u32, f64)>) {
        let n = f64::from(self.valence[v as usize]);
        if n == 0.0 {
            entries.push((v, 1.0));
            return;
        }
        entries.push((v, (n - 2.0) / n));
        for h in self.ring(v) {
            entries.push((self.head(h), 1.0 / (n * n)));
            let quad = self.quads[(h / 4) as usize];
            entries.extend(quad.map(|w| (w, 0.25 / (n * n))));
        }
    }

    /// Limit positions of the points.
    pub fn limit_positions(&self) -> Stencils {
        let mut limit = Stencils::new(self.point_count);
        let mut entries = Vec::new();
        for v in 0..self.point_count as u32 {
            let n = f64::from(self.valence[v as usize]);
            entries.clear();
            if n == 0.0 {
                entries.push((v, 1.0));
            } else {
                entries.push((v, n / (n + 5.0)));
                for h in self.ring(v) {
                    entries.push((self.head(h), 4.0 / (n * (n + 5.0))));
                    entries.push((self.diagonal(h), 1.0 / (n * (n + 5.0))));
                }
            }
            limit.push(&mut entries);
        }
        limit
    }

    /// Two independent limit tangents a point; their cross product points outward.
    pub fn limit_tangents(&self) -> [Stencils; 2] {
        [0.0, 1.0].map(|quarter| {
            let mut tangents = Stencils::new(self.point_count);
            let mut entries = Vec::new();
            for v in 0..self.point_count as u32 {
                entries.clear();
                let n = f64::from(self.valence[v as usize]);
                let c = (2.0 * PI / n).cos();
                let a = 1.0 + c + (PI / n).cos() * (2.0 * (9.0 + c)).sqrt();
                let wave = |i: f64| (2.0 * PI * i / n - quarter * PI / 2.0).cos();
                for (i, h) in self.ring(v).enumerate() {
                    let i = i as f64;
                    entries.push((self.head(h), a * wave(i)));
                    entries.push((self.diagonal(h), wave(i) + wave(i + 1.0)));
                }
                tangents.push(&mut entries);
            }
            tangents
        })
    }

    /// Mean of the edge neighbours minus the point itself, one row a point.
    pub fn laplacian(&self) -> Stencils {
        let mut laplacian = Stencils::new(self.point_count);
        let mut entries = Vec::new();
        for v in 0..self.point_count as u32 {
            entries.clear();
            let n = f64::from(self.valence[v as usize]);
            for h in self.ring(v) {
                entries.push((self.head(h), 1.0 / n));
            }
            if n > 0.0 {
                entries.push((v, -1.0));
            }
            laplacian.push(&mut entries);
        }
        laplacian
    }
}

/// The operator from control points to limit positions after `levels` splits, and the refined
/// connectivity. Quad `q` owns the refined quads `q * 4^levels ..`.
///
/// # Errors
/// As [`QuadTopology::new`].
pub fn limit_operator(
    point_count: usize,
    quads: &[[u32; 4]],
    levels: u32,
) -> Result<(Stencils, QuadTopology), CatmullClarkError> {
    let mut topology = QuadTopology::new(point_count, quads)?;
    let mut operator: Option<Stencils> = None;
    for _ in 0..levels {
        let (split, refined) = topology.split()?;
        operator = Some(match operator {
            Some(before) => split.after(&before),
            None => split,
        });
        topology = refined;
    }
    let limit = topology.limit_positions();
    let operator = match operator {
        Some(before) => limit.after(&before),
        None => limit,
    };
    Ok((operator, topology))
}

/// Triangles of the limit surface of `mesh` after `levels` splits (`2 * 4^levels` a quad, all
/// points on the exact limit surface), and the control quad of each triangle.
///
/// # Errors
/// As [`QuadTopology::new`].
pub fn limit_mesh(
    mesh: &ControlMesh,
    levels: u32,
) -> Result<(TriMesh, Vec<u32>), CatmullClarkError> {
    let mut topology = QuadTopology::new(mesh.points.len(), &mesh.quads)?;
    let mut points = mesh.points.clone();
    for _ in 0..levels {
        let (split, refined) = topology.split()?;
        points = split.apply(&points);
        topology = refined;
    }
    let points = topology.limit_positions().apply(&points);
    let (triangles, owner) = triangles_of(&topology.quads, levels);
    Ok((
        TriMesh {
            points,
            triangles,
            tags: Vec::new(),
        },
        owner,
    ))
}

/// Two triangles a refined quad, and the control quad that each belongs to.
pub fn triangles_of(quads: &[[u32; 4]], levels: u32) -> (Vec<[u32; 3]>, Vec<u32>) {
    let mut triangles = Vec::with_capacity(2 * quads.len());
    let mut owner = Vec::with_capacity(2 * quads.len());
    for (q, &[a, b, c, d]) in quads.iter().enumerate() {
        triangles.extend([[a, b, c], [a, c, d]]);
        owner.extend([(q as u32) >> (2 * levels); 2]);
    }
    (triangles, owner)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Vec3;
    use crate::mesh::shapes::{CUBOID, cuboid_corners};

    fn cube() -> ControlMesh {
        ControlMesh {
            points: cuboid_corners(Vec3::zeros(), Vec3::repeat(1.0)),
            quads: CUBOID.to_vec(),
        }
    }

    #[test]
    fn every_row_of_a_split_is_affine_and_keeps_the_topology() {
        let cube = cube();
        let topology = QuadTopology::new(8, &cube.quads).expect("a cube");
        let (split, refined) = topology.split().expect("splits");
        assert_eq!(topology.euler(), 2);
        assert_eq!(refined.euler(), 2);
        assert_eq!(refined.quads.len(), 24);
        for operator in [split, topology.limit_positions()] {
            for r in 0..operator.rows() {
                let sum: f64 = operator.row(r).1.iter().sum();
                assert!((sum - 1.0).abs() < 1e-14);
            }
        }
    }

    #[test]
    fn splitting_does_not_move_the_limit() {
        let cube = cube();
        let (coarse, topology) = limit_operator(8, &cube.quads, 0).expect("limit");
        let (fine, _) = limit_operator(8, &cube.quads, 3).expect("limit");
        let (a, b) = (coarse.apply(&cube.points), fine.apply(&cube.points));
        for v in 0..8 {
            assert!((a[v] - b[v]).norm() < 1e-14);
        }
        assert_eq!(topology.valence, vec![3; 8]);
    }

    #[test]
    fn limit_normals_point_outward_and_are_stable_under_splitting() {
        let cube = cube();
        let topology = QuadTopology::new(8, &cube.quads).expect("a cube");
        let (split, refined) = topology.split().expect("splits");
        let normals = |t: &QuadTopology, x: &[Vec3]| -> Vec<Vec3> {
            let [u, v] = t.limit_tangents();
            let (u, v) = (u.apply(x), v.apply(x));
            u.iter()
                .zip(&v)
                .map(|(u, v)| u.cross(v).normalize())
                .collect()
        };
        let a = normals(&topology, &cube.points);
        let b = normals(&refined, &split.apply(&cube.points));
        for v in 0..8 {
            assert!((a[v] - b[v]).norm() < 1e-12);
            assert!(a[v].dot(&(cube.points[v] - Vec3::repeat(0.5))) > 0.0);
        }
    }

    #[test]
    fn limit_mesh_is_closed_and_owned() {
        let (mesh, owner) = limit_mesh(&cube(), 2).expect("limit mesh");
        assert_eq!(mesh.triangles.len(), 6 * 16 * 2);
        assert_eq!(owner.iter().filter(|&&o| o == 5).count(), 32);
        assert!(mesh.volume() > 0.2 && mesh.volume() < 1.0);
        assert!(crate::mesh::Solid::try_from(mesh).is_ok());
    }

    #[test]
    fn bad_meshes_are_refused_by_name() {
        let mut open = cube();
        open.quads.pop();
        assert!(matches!(
            limit_mesh(&open, 1),
            Err(CatmullClarkError::BadEdge { .. })
        ));
        let mut degenerate = cube();
        degenerate.quads[2][1] = degenerate.quads[2][0];
        assert_eq!(
            limit_mesh(&degenerate, 1),
            Err(CatmullClarkError::BadQuad { quad: 2 })
        );
    }
}
