//! The interior Voronoi 2-complex of the boundary corners of a voxel solid ("voxel core").

use rayon::prelude::*;

use super::delaunay::{Delaunay, NONE, Tet};
use super::union_find::UnionFind;
use super::voxel_solid::VoxelSolid;
use crate::topology::Betti;

/// Vertices, edges and polygons; every polygon edge and every edge end is part of the complex.
/// Lengths in voxels, positions in corner coordinates of the [`VoxelSolid`].
pub(super) struct Complex {
    /// Voronoi vertices: centres of the inside tetrahedra.
    pub(super) centres: Vec<[f32; 3]>,
    /// Distance from the centre to its samples.
    pub(super) radii: Vec<f32>,
    /// The samples of each vertex.
    pub(super) vertex_samples: Vec<[u32; 4]>,
    /// Ends of each edge.
    pub(super) edges: Vec<[u32; 2]>,
    /// Faces at each edge, at most three, then [`NONE`].
    pub(super) edge_faces: Vec<[u32; 3]>,
    /// First entry of each face in `face_edges`, and the end.
    pub(super) face_start: Vec<u32>,
    /// Edges of each face in cyclic order.
    pub(super) face_edges: Vec<u32>,
    /// The two samples that each face is equally far from.
    pub(super) face_samples: Vec<[u32; 2]>,
    /// Connected parts of the complement, as sets of samples whose cells hang together outside.
    pub(super) complement: UnionFind,
}

impl Complex {
    /// Builds the complex.
    ///
    /// 1. A tetrahedron is inside when every voxel that touches its circumcentre is solid; that is
    ///    decided exactly, so cospherical corners need no perturbation.
    /// 2. Vertices are inside tetrahedra, edges are facets between two of them, faces are Delaunay
    ///    edges with inside tetrahedra all round.
    ///
    /// Then the complex has the homotopy type of the 6-connected voxel solid: Y. Yan, D. Letscher,
    /// T. Ju, "Voxel cores: efficient, robust, and provably good approximation of 3D medial axes",
    /// ACM TOG 37 (2018), <https://doi.org/10.1145/3197517.3201396>.
    pub(super) fn build(delaunay: &Delaunay, samples: &[[i32; 3]], solid: &VoxelSolid) -> Self {
        let inside = label(delaunay, samples, solid);
        let complement = complement(delaunay, &inside, samples.len());
        let mut complex = Self::vertices(delaunay, &inside, samples, complement);
        let facet_edges = complex.add_edges(delaunay, &inside);
        complex.add_faces(delaunay, &inside, &facet_edges);
        complex
    }

    fn vertices(
        delaunay: &Delaunay,
        inside: &[u32],
        samples: &[[i32; 3]],
        complement: UnionFind,
    ) -> Self {
        let kept: Vec<[u32; 4]> = delaunay
            .tets
            .iter()
            .zip(inside)
            .filter(|(_, i)| **i != NONE)
            .map(|(t, _)| t.vertices)
            .collect();
        let spheres: Vec<([f32; 3], f32)> = kept
            .par_iter()
            .map(|v| {
                let centre = circumcentre(v, samples).unwrap_or_default();
                let p = samples[v[0] as usize];
                let radius = (0..3)
                    .map(|k| (centre[k] - f64::from(p[k])).powi(2))
                    .sum::<f64>()
                    .sqrt();
                (centre.map(|x| x as f32), radius as f32)
            })
            .collect();
        Self {
            centres: spheres.iter().map(|s| s.0).collect(),
            radii: spheres.iter().map(|s| s.1).collect(),
            vertex_samples: kept,
            edges: Vec::new(),
            edge_faces: Vec::new(),
            face_start: vec![0],
            face_edges: Vec::new(),
            face_samples: Vec::new(),
            complement,
        }
    }

    /// Numbers the facets between inside tetrahedra; returns the number per vertex and facet.
    fn add_edges(&mut self, delaunay: &Delaunay, inside: &[u32]) -> Vec<[u32; 4]> {
        let mut facet_edges = vec![[NONE; 4]; self.radii.len()];
        for (tet, &v) in delaunay.tets.iter().zip(inside) {
            if v == NONE {
                continue;
            }
            for k in 0..4 {
                let mate = tet.mates[k];
                if mate == NONE {
                    continue;
                }
                let w = inside[(mate >> 2) as usize];
                if w != NONE && v < w {
                    let edge = self.edges.len() as u32;
                    facet_edges[v as usize][k] = edge;
                    facet_edges[w as usize][(mate & 3) as usize] = edge;
                    self.edges.push([v, w]);
                }
            }
        }
        facet_edges
    }

    /// Walks once round every Delaunay edge of the inside tetrahedra.
    fn add_faces(&mut self, delaunay: &Delaunay, inside: &[u32], facet_edges: &[[u32; 4]]) {
        self.edge_faces = vec![[NONE; 3]; self.edges.len()];
        // Bit a + b - 1 (+ 1 when a > 0) of a tetrahedron: its edge (a, b) was walked round.
        let mut walked = vec![0u8; self.radii.len()];
        for (t, &v) in inside.iter().enumerate() {
            if v == NONE {
                continue;
            }
            for (bit, [a, b]) in TET_EDGES.into_iter().enumerate() {
                if walked[v as usize] >> bit & 1 == 0 {
                    let from = self.face_edges.len();
                    if ring(
                        delaunay,
                        inside,
                        facet_edges,
                        &mut walked,
                        &mut self.face_edges,
                        t,
                        [a, b],
                    ) {
                        let samples = &delaunay.tets[t].vertices;
                        self.close_face(from, [samples[a], samples[b]]);
                    } else {
                        self.face_edges.truncate(from);
                    }
                }
            }
        }
    }

    fn close_face(&mut self, from: usize, samples: [u32; 2]) {
        let face = self.face_samples.len() as u32;
        for &edge in &self.face_edges[from..] {
            let faces = &mut self.edge_faces[edge as usize];
            if let Some(free) = faces.iter_mut().find(|f| **f == NONE) {
                *free = face;
            }
        }
        self.face_samples.push(samples);
        self.face_start.push(self.face_edges.len() as u32);
    }

    /// The edges of face `f`.
    #[inline]
    pub(super) fn edges_of(&self, f: u32) -> &[u32] {
        &self.face_edges
            [self.face_start[f as usize] as usize..self.face_start[f as usize + 1] as usize]
    }

    /// The vertices of face `f` in cyclic order: the common ends of consecutive edges.
    pub(super) fn polygon(&self, f: u32) -> Vec<u32> {
        let edges = self.edges_of(f);
        (0..edges.len())
            .map(|i| {
                let a = self.edges[edges[i] as usize];
                let b = self.edges[edges[(i + 1) % edges.len()] as usize];
                if b.contains(&a[0]) { a[0] } else { a[1] }
            })
            .collect()
    }

    /// Number of faces.
    pub(super) fn faces(&self) -> usize {
        self.face_samples.len()
    }

    /// Betti numbers of the whole complex: components and Euler number by counting, cavities as
    /// the bounded parts of the complement (Alexander duality).
    pub(super) fn betti(&self) -> Betti {
        let mut sets = UnionFind::new(self.radii.len());
        for &[a, b] in &self.edges {
            sets.unite(a, b);
        }
        let chi = self.radii.len() as i64 - self.edges.len() as i64 + self.faces() as i64;
        Betti::from_chi(sets.sets() as i64, self.complement.sets() as i64 - 1, chi)
    }
}

const TET_EDGES: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];

/// Bit of the edge between two corners of a tetrahedron in [`TET_EDGES`].
#[inline]
fn edge_bit(a: usize, b: usize) -> usize {
    let (a, b) = (a.min(b), a.max(b));
    a + b - usize::from(a == 0)
}

/// Walks round the Delaunay edge (a, b) of tetrahedron `start`, appending the Voronoi edges passed;
/// false as soon as the ring leaves the inside.
fn ring(
    delaunay: &Delaunay,
    inside: &[u32],
    facet_edges: &[[u32; 4]],
    walked: &mut [u8],
    out: &mut Vec<u32>,
    start: usize,
    [a, b]: [usize; 2],
) -> bool {
    let ends = [
        delaunay.tets[start].vertices[a],
        delaunay.tets[start].vertices[b],
    ];
    let mut exit = (0..4).find(|&k| k != a && k != b).unwrap_or(0);
    let mut t = start;
    loop {
        let Tet { vertices, mates } = &delaunay.tets[t];
        let find = |v: u32| vertices.iter().position(|&x| x == v).unwrap_or(0);
        let (i, j) = (find(ends[0]), find(ends[1]));
        let v = inside[t] as usize;
        walked[v] |= 1 << edge_bit(i, j);
        let edge = facet_edges[v][exit];
        if edge == NONE {
            return false;
        }
        out.push(edge);
        let next = (mates[exit] >> 2) as usize;
        if next == start {
            return true;
        }
        // Enter through facet `mates & 3`; leave through the other facet at the edge.
        let entry = (mates[exit] & 3) as usize;
        let beyond = &delaunay.tets[next].vertices;
        exit = (0..4)
            .find(|&k| k != entry && !ends.contains(&beyond[k]))
            .unwrap_or(0);
        t = next;
    }
}

/// Consecutive numbers of the inside tetrahedra, [`NONE`] for the others.
fn label(delaunay: &Delaunay, samples: &[[i32; 3]], solid: &VoxelSolid) -> Vec<u32> {
    let inside =
        |tet: &Tet| circumcentre(&tet.vertices, samples).is_some_and(|c| in_open_solid(&c, solid));
    let mut number: Vec<u32> = delaunay
        .tets
        .par_iter()
        .map(|tet| if inside(tet) { 0 } else { NONE })
        .collect();
    for (count, n) in number.iter_mut().filter(|n| **n != NONE).enumerate() {
        *n = count as u32;
    }
    number
}

/// Is every voxel that touches `c` solid?
fn in_open_solid(c: &[f64; 3], solid: &VoxelSolid) -> bool {
    let mut from = [0i64; 3];
    let mut to = [0i64; 3];
    for k in 0..3 {
        if !(c[k] >= 1.0 && c[k] <= solid.dims[k] as f64) {
            return false;
        }
        let floor = c[k].floor();
        to[k] = floor as i64;
        from[k] = if floor == c[k] { to[k] - 1 } else { to[k] };
    }
    (from[2]..=to[2])
        .all(|z| (from[1]..=to[1]).all(|y| (from[0]..=to[0]).all(|x| solid.is_solid([x, y, z]))))
}

/// Circumcentre of four lattice points; a coordinate is integral in the result exactly when it
/// truly is. `None` for four points in a plane.
///
/// Numerators and denominators are integers. As long as they stay below 2^53 they are exact, and
/// the rounded quotient is integral only if the true one is.
fn circumcentre(v: &[u32; 4], samples: &[[i32; 3]]) -> Option<[f64; 3]> {
    let p = v.map(|i| samples[i as usize].map(f64::from));
    let [a, b, c] = [1, 2, 3].map(|i| [0, 1, 2].map(|k| p[i][k] - p[0][k]));
    let square = |u: &[f64; 3]| u[0] * u[0] + u[1] * u[1] + u[2] * u[2];
    let cross = |u: &[f64; 3], w: &[f64; 3]| {
        [
            u[1] * w[2] - u[2] * w[1],
            u[2] * w[0] - u[0] * w[2],
            u[0] * w[1] - u[1] * w[0],
        ]
    };
    let (bc, ca, ab) = (cross(&b, &c), cross(&c, &a), cross(&a, &b));
    let denominator = 2.0 * (a[0] * bc[0] + a[1] * bc[1] + a[2] * bc[2]);
    if denominator == 0.0 {
        return None;
    }
    let (sa, sb, sc) = (square(&a), square(&b), square(&c));
    let numerator: [f64; 3] = std::array::from_fn(|k| sa * bc[k] + sb * ca[k] + sc * ab[k]);
    if numerator.iter().any(|x| x.abs() >= EXACT) {
        return Some(wide_circumcentre(&p));
    }
    Some(std::array::from_fn(|k| {
        p[0][k] + numerator[k] / denominator
    }))
}

/// Integers up to here and their products with small factors are exact in f64.
const EXACT: f64 = (1u64 << 51) as f64;

/// As [`circumcentre`] in 128-bit integers, for tetrahedra thousands of voxels long.
#[cold]
fn wide_circumcentre(p: &[[f64; 3]; 4]) -> [f64; 3] {
    let q = p.map(|x| x.map(|x| x as i128));
    let [a, b, c] = [1, 2, 3].map(|i| [0, 1, 2].map(|k| q[i][k] - q[0][k]));
    let square = |u: &[i128; 3]| u[0] * u[0] + u[1] * u[1] + u[2] * u[2];
    let cross = |u: &[i128; 3], w: &[i128; 3]| {
        [
            u[1] * w[2] - u[2] * w[1],
            u[2] * w[0] - u[0] * w[2],
            u[0] * w[1] - u[1] * w[0],
        ]
    };
    let (bc, ca, ab) = (cross(&b, &c), cross(&c, &a), cross(&a, &b));
    let denominator = 2 * (a[0] * bc[0] + a[1] * bc[1] + a[2] * bc[2]);
    std::array::from_fn(|k| {
        let numerator = square(&a) * bc[k] + square(&b) * ca[k] + square(&c) * ab[k];
        let (whole, rest) = (
            numerator.div_euclid(denominator),
            numerator.rem_euclid(denominator),
        );
        // A remainder must not be rounded away to the next integer.
        let fraction = (rest as f64 / denominator.abs() as f64).min(1.0 - 1e-9);
        let fraction = if rest == 0 { 0.0 } else { fraction.max(1e-9) };
        p[0][k] + whole as f64 + fraction
    })
}

/// Samples united when their Voronoi cells touch in a face that is not part of the complex.
fn complement(delaunay: &Delaunay, inside: &[u32], samples: usize) -> UnionFind {
    let mut sets = UnionFind::new(samples);
    let mut hull = None;
    for (tet, &v) in delaunay.tets.iter().zip(inside) {
        if v == NONE {
            for k in 1..4 {
                sets.unite(tet.vertices[0], tet.vertices[k]);
            }
        }
        for k in 0..4 {
            if tet.mates[k] == NONE {
                let first = *hull.get_or_insert(tet.vertices[(k + 1) & 3]);
                for j in 1..4 {
                    sets.unite(first, tet.vertices[(k + j) & 3]);
                }
            }
        }
    }
    sets
}
