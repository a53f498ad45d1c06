//! The validated closed surface.

use std::collections::HashMap;

use super::TriMesh;

/// Why a mesh is not a [`Solid`]; indices name the first offender.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SolidError {
    /// Nothing there.
    #[error("the mesh has no triangles")]
    Empty,
    /// A triangle uses a point twice or a point that does not exist.
    #[error("triangle {triangle} is degenerate or names a missing point")]
    BadTriangle {
        /// Index of the triangle.
        triangle: usize,
    },
    /// An edge has not exactly one triangle on either side.
    #[error(
        "edge {edge:?} has {uses} triangles running along it and {opposite} against it (1 and 1 wanted); {count} such edges"
    )]
    BadEdge {
        /// The two point indices.
        edge: [u32; 2],
        /// Triangles that run along it.
        uses: usize,
        /// Triangles that run against it.
        opposite: usize,
        /// How many such edges there are.
        count: usize,
    },
    /// The triangles around a point do not form one fan.
    #[error("point {point} is pinched: its triangles form more than one fan; {count} such points")]
    Pinched {
        /// Index of the point.
        point: u32,
        /// How many such points there are.
        count: usize,
    },
    /// Inside out or flat.
    #[error("the volume is {volume} mm3, a solid needs a positive one")]
    NotPositive {
        /// Signed volume, mm3.
        volume: f64,
    },
}

/// A closed, oriented, manifold triangle mesh of positive volume. Cavities are inward-oriented shells.
#[derive(Debug, Clone, PartialEq)]
pub struct Solid(TriMesh);

impl Solid {
    /// The mesh.
    pub fn mesh(&self) -> &TriMesh {
        &self.0
    }

    /// V - E + F over all shells.
    pub fn euler(&self) -> i64 {
        let mut used = vec![false; self.0.points.len()];
        for &v in self.0.triangles.iter().flatten() {
            used[v as usize] = true;
        }
        let vertices = used.iter().filter(|u| **u).count() as i64;
        let faces = self.0.triangles.len() as i64;
        vertices - 3 * faces / 2 + faces
    }
}

impl std::ops::Deref for Solid {
    type Target = TriMesh;
    fn deref(&self) -> &TriMesh {
        &self.0
    }
}

impl TryFrom<TriMesh> for Solid {
    type Error = SolidError;

    fn try_from(mesh: TriMesh) -> Result<Self, SolidError> {
        if mesh.triangles.is_empty() {
            return Err(SolidError::Empty);
        }
        check_triangles(&mesh)?;
        check_edges(&mesh)?;
        check_fans(&mesh)?;
        let volume = mesh.volume();
        if volume.is_nan() || volume <= 0.0 {
            return Err(SolidError::NotPositive { volume });
        }
        Ok(Self(mesh))
    }
}

fn check_triangles(mesh: &TriMesh) -> Result<(), SolidError> {
    let n = mesh.points.len();
    let bad = |t: &[u32; 3]| {
        t[0] == t[1] || t[1] == t[2] || t[2] == t[0] || t.iter().any(|&v| v as usize >= n)
    };
    match mesh.triangles.iter().position(bad) {
        Some(triangle) => Err(SolidError::BadTriangle { triangle }),
        None => Ok(()),
    }
}

fn check_edges(mesh: &TriMesh) -> Result<(), SolidError> {
    let mut edges: HashMap<[u32; 2], [usize; 2]> =
        HashMap::with_capacity(mesh.triangles.len() * 3 / 2);
    for t in &mesh.triangles {
        for k in 0..3 {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            edges.entry([a.min(b), a.max(b)]).or_default()[usize::from(a > b)] += 1;
        }
    }
    let bad = edges.iter().filter(|(_, uses)| **uses != [1, 1]);
    let count = bad.clone().count();
    match bad.min_by_key(|(edge, _)| **edge) {
        Some((&edge, &[uses, opposite])) => Err(SolidError::BadEdge {
            edge,
            uses,
            opposite,
            count,
        }),
        None => Ok(()),
    }
}

fn check_fans(mesh: &TriMesh) -> Result<(), SolidError> {
    // Every edge has one triangle on either side here, so walking from corner to corner closes;
    // a point is pinched when one walk does not visit all its triangles.
    let mut next: HashMap<(u32, u32), u32> = HashMap::with_capacity(mesh.triangles.len() * 3);
    let mut valence = vec![0u32; mesh.points.len()];
    let mut start = vec![u32::MAX; mesh.points.len()];
    for t in &mesh.triangles {
        for k in 0..3 {
            let (v, a, b) = (t[k], t[(k + 1) % 3], t[(k + 2) % 3]);
            next.insert((v, a), b);
            valence[v as usize] += 1;
            start[v as usize] = a;
        }
    }
    let pinched = |v: u32| {
        let first = start[v as usize];
        let mut at = first;
        for step in 1..=valence[v as usize] {
            at = next[&(v, at)];
            if at == first {
                return step != valence[v as usize];
            }
        }
        true
    };
    let bad: Vec<u32> = (0..valence.len() as u32)
        .filter(|&v| valence[v as usize] > 0 && pinched(v))
        .collect();
    match bad.first() {
        Some(&point) => Err(SolidError::Pinched {
            point,
            count: bad.len(),
        }),
        None => Ok(()),
    }
}
