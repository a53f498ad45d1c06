//! Which faces meet at which edges.

use rayon::prelude::*;

use super::super::TriMesh;

/// All undirected edges with their half-edges; half-edge `3 t + k` runs from corner `k` of triangle `t` to the next.
pub(super) struct Edges {
    /// Where the half-edges of each edge begin in `halves`; one more at the end.
    starts: Vec<u32>,
    halves: Vec<u32>,
    /// Edge of each half-edge.
    pub of_half: Vec<u32>,
}

/// Pieces of connected faces.
pub(super) struct Components {
    /// Piece of each face, numbered by first appearance.
    pub of_face: Vec<u32>,
    pub count: usize,
}

impl Edges {
    /// Sorts the half-edges of all triangles without repeated corners by their two points.
    pub fn new(mesh: &TriMesh) -> Self {
        let mut keyed: Vec<(u64, u32)> = Vec::with_capacity(3 * mesh.triangles.len());
        for (t, corners) in mesh.triangles.iter().enumerate() {
            for k in 0..3 {
                let (a, b) = (corners[k], corners[(k + 1) % 3]);
                let key = u64::from(a.min(b)) << 32 | u64::from(a.max(b));
                keyed.push((key, (3 * t + k) as u32));
            }
        }
        keyed.par_sort_unstable();
        let mut edges = Self {
            starts: Vec::new(),
            halves: Vec::with_capacity(keyed.len()),
            of_half: vec![0; keyed.len()],
        };
        let mut last = None;
        for (key, half) in keyed {
            if last != Some(key) {
                edges.starts.push(edges.halves.len() as u32);
                last = Some(key);
            }
            edges.of_half[half as usize] = edges.starts.len() as u32 - 1;
            edges.halves.push(half);
        }
        edges.starts.push(edges.halves.len() as u32);
        edges
    }

    pub fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// Half-edges of edge `e`, in order of their triangles.
    pub fn halves(&self, e: usize) -> &[u32] {
        &self.halves[self.starts[e] as usize..self.starts[e + 1] as usize]
    }

    /// Half-edges of all edges.
    pub fn iter(&self) -> impl Iterator<Item = &[u32]> {
        (0..self.len()).map(|e| self.halves(e))
    }

    /// Half-edges of the edge on side `k` of triangle `t`.
    pub fn around(&self, t: usize, k: usize) -> &[u32] {
        self.halves(self.of_half[3 * t + k] as usize)
    }

    /// Number of edges with one face.
    pub fn open(&self) -> usize {
        self.iter().filter(|h| h.len() == 1).count()
    }

    /// Number of edges with more than two faces.
    pub fn non_manifold(&self) -> usize {
        self.iter().filter(|h| h.len() > 2).count()
    }

    /// Pieces of faces that are connected by any edge.
    pub fn components(&self, faces: usize) -> Components {
        self.connected(faces, |halves| halves.len() > 1)
    }

    /// Pieces of faces that are connected by the edges that `joins` accepts.
    pub fn connected(&self, faces: usize, joins: impl Fn(&[u32]) -> bool) -> Components {
        let mut parent: Vec<u32> = (0..faces as u32).collect();
        for halves in self.iter().filter(|h| joins(h)) {
            for pair in halves.windows(2) {
                let (a, b) = (
                    root(&mut parent, pair[0] / 3),
                    root(&mut parent, pair[1] / 3),
                );
                parent[a.max(b) as usize] = a.min(b);
            }
        }
        let mut of_face = vec![u32::MAX; faces];
        let mut count = 0;
        for face in 0..faces {
            // The root is the smallest face of its piece, so it is numbered before the others ask.
            let top = root(&mut parent, face as u32) as usize;
            if top == face {
                of_face[face] = count;
                count += 1;
            } else {
                of_face[face] = of_face[top];
            }
        }
        Components {
            of_face,
            count: count as usize,
        }
    }
}

/// Root of `x` in a union-find forest; paths are halved on the way.
pub(super) fn root(parent: &mut [u32], mut x: u32) -> u32 {
    while parent[x as usize] != x {
        parent[x as usize] = parent[parent[x as usize] as usize];
        x = parent[x as usize];
    }
    x
}
