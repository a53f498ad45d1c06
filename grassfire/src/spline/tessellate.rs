//! Triangles on the patches, without cracks.

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::bezier::second_derivatives;
use super::half_edges::{QuadTopology, connect};
use super::quality::side_parameters;
use super::{ControlMesh, Patch, SplineError, evaluate};
use crate::Vec3;
use crate::mesh::TriMesh;

/// How finely to tessellate.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct TessellateOptions {
    /// Largest distance wanted between triangles and surface, mm.
    pub chord: f64,
    /// Divide every edge into this many parts instead of following `chord`.
    pub divisions: Option<u32>,
    /// Most parts of an edge.
    pub max_divisions: u32,
    /// More triangles than this are avoided by coarser divisions.
    pub max_triangles: usize,
}

impl Default for TessellateOptions {
    fn default() -> Self {
        Self {
            chord: 0.02,
            divisions: None,
            max_divisions: 64,
            max_triangles: 4_000_000,
        }
    }
}

/// Where a mesh point lies on the patches.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfaceSample {
    /// The quad and its patch.
    pub quad: u32,
    /// Parameters u and v.
    pub parameters: [f64; 2],
}

/// Triangles on the patches; tags of the mesh are quad indices.
#[derive(Debug, Clone, PartialEq)]
pub struct Tessellation {
    /// Closed mesh, oriented as the control mesh.
    pub mesh: TriMesh,
    /// One for each point of the mesh.
    pub samples: Vec<SurfaceSample>,
    /// The divisions were made coarser to stay below the largest number of triangles.
    pub limited: bool,
}

impl Tessellation {
    /// The quad to which a triangle belongs.
    pub fn owner(&self, triangle: usize) -> u32 {
        self.mesh.tags[triangle]
    }
}

/// Triangulates the patches so that neighbours share the points on their common edges.
///
/// 1. Parts along u and v that each patch needs, from the normal part of its second derivatives on a 5 x 5 grid:
///    the distance between a triangle and the surface is at most an eighth of the second difference over the cell.
/// 2. Every edge takes the larger need of its two patches.
/// 3. A patch whose opposite sides agree is a regular grid, cut along the shorter diagonals; any other has a regular
///    inner grid and four transition strips.
///
/// # Errors
/// As for [`super::patches`]; also when the number of patches is not that of the quads.
///
/// # Limits
/// The chord is an estimate from samples; folds of the surface stay folds.
pub fn tessellate(
    mesh: &ControlMesh,
    patches: &[Patch],
    options: &TessellateOptions,
) -> Result<Tessellation, SplineError> {
    let half_edges = connect(mesh)?;
    if patches.len() != mesh.quads.len() {
        return Err(SplineError::PatchCount {
            patches: patches.len(),
            quads: mesh.quads.len(),
        });
    }
    let (grid, limited) = Grid::new(&half_edges, needs(patches, options), options.max_triangles);
    let samples = grid.samples();
    let points: Vec<Vec3> = samples
        .par_iter()
        .map(|s| evaluate(&patches[s.quad as usize], s.parameters[0], s.parameters[1]).position)
        .collect();
    let faces: Vec<Vec<[u32; 3]>> = (0..mesh.quads.len() as u32)
        .into_par_iter()
        .map(|q| grid.triangulate(q, &points))
        .collect();
    let tags = faces
        .iter()
        .enumerate()
        .flat_map(|(q, list)| std::iter::repeat_n(q as u32, list.len()))
        .collect();
    let triangles = faces.into_iter().flatten().collect();
    Ok(Tessellation {
        mesh: TriMesh {
            points,
            triangles,
            tags,
        },
        samples,
        limited,
    })
}

/// Parts along u and v that each patch needs.
fn needs(patches: &[Patch], options: &TessellateOptions) -> Vec<[u32; 2]> {
    let most = options.max_divisions.clamp(1, 1024);
    match options.divisions {
        Some(n) => vec![[n.clamp(1, most); 2]; patches.len()],
        None => patches
            .par_iter()
            .map(|patch| need(patch, options.chord, most))
            .collect(),
    }
}

fn need(patch: &Patch, chord: f64, most: u32) -> [u32; 2] {
    const SAMPLES: usize = 5;
    let mut largest = [0.0f64; 3];
    for i in 0..SAMPLES {
        for j in 0..SAMPLES {
            let [u, v] = [i, j].map(|k| k as f64 / (SAMPLES - 1) as f64);
            let normal = evaluate(patch, u, v).normal;
            for (value, bend) in largest.iter_mut().zip(second_derivatives(patch, u, v)) {
                *value = value.max(bend.dot(&normal).abs());
            }
        }
    }
    // With m cells along u and n along v the distance is at most
    // uu / 8m2 + uv / 4mn + vv / 8n2 <= (uu + uv) / 8m2 + (vv + uv) / 8n2; half of the chord for either term.
    let [uu, uv, vv] = largest;
    [uu + uv, vv + uv].map(|bend| {
        let parts = (bend / (4.0 * chord)).sqrt().ceil();
        // Also for a chord that is zero or not a number.
        if parts >= 1.0 && parts < f64::from(most) {
            parts as u32
        } else if parts < 1.0 {
            1
        } else {
            most
        }
    })
}

/// Numbering of the mesh points: corners, then points inside edges, then points inside quads.
struct Grid<'a> {
    half_edges: &'a QuadTopology,
    /// Parts of each half-edge.
    parts: Vec<u32>,
    /// Cells along u and v of each quad.
    cells: Vec<[u32; 2]>,
    /// Number of each control point among those in use.
    corner: Vec<u32>,
    /// First point inside the edge of each half-edge, counted along the lower one of the two.
    edge: Vec<u32>,
    /// First point inside each quad.
    inner: Vec<u32>,
    count: u32,
}

impl<'a> Grid<'a> {
    /// Numbers the points; halves the `needs` until there are few enough triangles, which it tells.
    fn new(
        half_edges: &'a QuadTopology,
        mut needs: Vec<[u32; 2]>,
        max_triangles: usize,
    ) -> (Self, bool) {
        const INDEX_LIMIT: usize = 1 << 30;
        let (mut parts, mut cells) = divide(half_edges, &needs);
        let too_many = |cells: &[[u32; 2]]| {
            cells
                .iter()
                .map(|[u, v]| 2 * *u as usize * *v as usize)
                .sum::<usize>()
                > max_triangles.min(INDEX_LIMIT)
        };
        let mut limited = false;
        while too_many(&cells) && needs.iter().flatten().any(|n| *n > 1) {
            limited = true;
            needs
                .iter_mut()
                .flatten()
                .for_each(|n| *n = (*n / 2).max(1));
            (parts, cells) = divide(half_edges, &needs);
        }
        let mut count = 0;
        let mut take = |n: u32| {
            let first = count;
            count += n;
            first
        };
        let corner = half_edges
            .valence
            .iter()
            .map(|n| take(u32::from(*n > 0)))
            .collect();
        let mut edge = vec![0; parts.len()];
        for h in 0..half_edges.len() {
            let g = half_edges.twin[h as usize];
            edge[h as usize] = if h < g {
                take(parts[h as usize] - 1)
            } else {
                edge[g as usize]
            };
        }
        let inner = cells.iter().map(|[u, v]| take((u - 1) * (v - 1))).collect();
        (
            Self {
                half_edges,
                parts,
                cells,
                corner,
                edge,
                inner,
                count,
            },
            limited,
        )
    }

    /// Where every point lies.
    fn samples(&self) -> Vec<SurfaceSample> {
        let mut samples = Vec::with_capacity(self.count as usize);
        let on_side = |h: u32, t: f64| SurfaceSample {
            quad: h / 4,
            parameters: side_parameters(h, t),
        };
        samples.extend(
            self.half_edges
                .outgoing
                .iter()
                .filter(|h| **h != u32::MAX)
                .map(|&h| on_side(h, 0.0)),
        );
        for h in 0..self.half_edges.len() {
            if h < self.half_edges.twin[h as usize] {
                let n = self.parts[h as usize];
                samples.extend((1..n).map(|k| on_side(h, f64::from(k) / f64::from(n))));
            }
        }
        for (quad, &[m, n]) in self.cells.iter().enumerate() {
            let cells = (1..m).flat_map(|i| (1..n).map(move |j| (i, j)));
            samples.extend(cells.map(|(i, j)| SurfaceSample {
                quad: quad as u32,
                parameters: [f64::from(i) / f64::from(m), f64::from(j) / f64::from(n)],
            }));
        }
        samples
    }

    /// Point `k` of the parts of half-edge `h`.
    fn on_side(&self, h: u32, k: u32) -> u32 {
        let n = self.parts[h as usize];
        if k == 0 {
            self.corner[self.half_edges.origin(h) as usize]
        } else if k == n {
            self.corner[self.half_edges.head(h) as usize]
        } else if h < self.half_edges.twin[h as usize] {
            self.edge[h as usize] + k - 1
        } else {
            self.edge[h as usize] + n - k - 1
        }
    }

    /// Inner point of column `i` and row `j`.
    fn inside(&self, quad: u32, i: u32, j: u32) -> u32 {
        self.inner[quad as usize] + (i - 1) * (self.cells[quad as usize][1] - 1) + j - 1
    }

    fn triangulate(&self, quad: u32, points: &[Vec3]) -> Vec<[u32; 3]> {
        let [m, n] = self.cells[quad as usize];
        let parts = [0, 1, 2, 3].map(|k| self.parts[(4 * quad + k) as usize]);
        let mut triangles = Vec::with_capacity(2 * m as usize * n as usize);
        if parts == [m, n, m, n] {
            let at = |i: u32, j: u32| match (i, j) {
                (_, 0) => self.on_side(4 * quad, i),
                (_, j) if j == n => self.on_side(4 * quad + 2, m - i),
                (0, _) => self.on_side(4 * quad + 3, n - j),
                (i, _) if i == m => self.on_side(4 * quad + 1, j),
                _ => self.inside(quad, i, j),
            };
            fill([0, m], [0, n], at, points, &mut triangles);
        } else {
            fill(
                [1, m - 1],
                [1, n - 1],
                |i, j| self.inside(quad, i, j),
                points,
                &mut triangles,
            );
            for (k, parts) in parts.into_iter().enumerate() {
                let h = 4 * quad + k as u32;
                let outer: Vec<u32> = (0..=parts).map(|t| self.on_side(h, t)).collect();
                let inner: Vec<u32> = match k {
                    0 => (1..m).map(|i| self.inside(quad, i, 1)).collect(),
                    1 => (1..n).map(|j| self.inside(quad, m - 1, j)).collect(),
                    2 => (1..m).rev().map(|i| self.inside(quad, i, n - 1)).collect(),
                    _ => (1..n).rev().map(|j| self.inside(quad, 1, j)).collect(),
                };
                stitch(&outer, &inner, &mut triangles);
            }
        }
        triangles
    }
}

/// Parts of each half-edge: the larger need of its two quads; and cells of each quad.
fn divide(half_edges: &QuadTopology, needs: &[[u32; 2]]) -> (Vec<u32>, Vec<[u32; 2]>) {
    let need = |h: u32| needs[h as usize / 4][(h & 1) as usize];
    let parts: Vec<u32> = (0..half_edges.len())
        .map(|h| need(h).max(need(half_edges.twin[h as usize])))
        .collect();
    let cells = parts.chunks_exact(4).map(|side| {
        let [u, v] = [side[0].max(side[2]), side[1].max(side[3])];
        if side[0] == side[2] && side[1] == side[3] {
            [u, v]
        } else {
            [u.max(2), v.max(2)]
        }
    });
    let cells = cells.collect();
    (parts, cells)
}

/// Two triangles for each cell of a grid, cut along the shorter diagonal.
fn fill(
    [i0, i1]: [u32; 2],
    [j0, j1]: [u32; 2],
    at: impl Fn(u32, u32) -> u32,
    points: &[Vec3],
    triangles: &mut Vec<[u32; 3]>,
) {
    let length = |a: u32, b: u32| (points[a as usize] - points[b as usize]).norm_squared();
    for i in i0..i1 {
        for j in j0..j1 {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            if length(a, c) <= length(b, d) {
                triangles.extend([[a, b, c], [a, c, d]]);
            } else {
                triangles.extend([[a, b, d], [b, c, d]]);
            }
        }
    }
}

/// Triangles between a side and the first line of inner points; both run the same way, the inner one on the left.
fn stitch(outer: &[u32], inner: &[u32], triangles: &mut Vec<[u32; 3]>) {
    let parts = outer.len() - 1;
    let (mut k, mut m) = (0, 0);
    while k < parts || m + 1 < inner.len() {
        // Inner point m stands at (m + 1) / (inner.len() + 1) of the side.
        let outer_first = (k + 1) * (inner.len() + 1) <= (m + 2) * parts;
        if k < parts && (outer_first || m + 1 == inner.len()) {
            triangles.push([outer[k], outer[k + 1], inner[m]]);
            k += 1;
        } else {
            triangles.push([outer[k], inner[m + 1], inner[m]]);
            m += 1;
        }
    }
}
