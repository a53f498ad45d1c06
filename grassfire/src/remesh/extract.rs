//! Closed surface of a field: dual contouring with one vertex a surface component a cell.

use std::collections::BTreeMap;

use nalgebra::Matrix3;
use rayon::prelude::*;

use super::cases::{Case, cases, edge_between, edge_corners, face_corners, is_ambiguous};
use super::digital::VoxelSet;
use super::intersect::intersecting_vertices;
use crate::Vec3;
use crate::mesh::TriMesh;
use crate::spline::ControlMesh;
use crate::voxel::VoxelGrid;

/// Pull of a vertex toward the mean of its cell's crossings, relative to one tangent plane.
const PULL: f64 = 0.1;
/// Vertices stay this far from the faces of their cell, and crossings from the ends of their edge (voxels).
const CLEAR: f64 = 0.02;
/// Rounds of moving vertices of intersecting triangles.
const ROUNDS: usize = 5;

/// The surface between the solid `{field > 0}` (6-connected) and the empty voxels (26-connected).
#[derive(Debug, Clone)]
pub(super) struct Surface {
    pub(super) mesh: TriMesh,
    /// Vertices whose triangles still intersect others after the repair.
    pub(super) intersecting: usize,
}

/// Cells and their vertices.
struct Cells<'a> {
    grid: &'a VoxelGrid<f32>,
    set: &'a VoxelSet,
    cases: Vec<Case>,
    /// First vertex of each cell (index of its lowest corner voxel); `u32::MAX` where no surface passes.
    first: Vec<u32>,
}

/// One vertex: where it wants to be and where it is safe.
struct Vertex {
    best: Vec3,
    mean: Vec3,
    /// Mean of the middles of the crossed edges.
    safe: Vec3,
}

/// Extracts the surface. The border of the grid must be empty.
///
/// 1. Every cell of 8 voxel centres gets one vertex for each component of the surface in it; two solid corners on a
///    diagonal are apart (dual marching cubes, Nielson 2004, doi:10.1109/VISUAL.2004.28, with the solid 6-connected).
/// 2. The vertex minimizes the squared distance to the tangent planes of the field at the crossed edges, with a light
///    pull to their mean (Ju et al. 2002, doi:10.1145/566654.566586), and stays inside its cell.
/// 3. Every crossed edge gives a quad of the four cells around it, split along its better diagonal. Where two cells
///    would share two dual edges, these get a vertex of their own each, so the surface is manifold in every case.
/// 4. Vertices of intersecting triangles move toward the mean of the crossings and on toward the middle of the edges.
pub(super) fn surface(grid: &VoxelGrid<f32>, set: &VoxelSet, repair: bool) -> Surface {
    let mut cells = Cells {
        grid,
        set,
        cases: cases(),
        first: vec![u32::MAX; set.solid.len()],
    };
    let vertices = cells.number();
    let mut points: Vec<Vec3> = vertices.iter().map(|v| v.best).collect();
    let polygons = cells.polygons(&mut points);
    let mut mesh = triangulate(grid, &points, &polygons);
    let mut intersecting = 0;
    for round in 0..=if repair { ROUNDS } else { 0 } {
        if !repair {
            break;
        }
        let bad = intersecting_vertices(&mesh);
        intersecting = bad.len();
        if bad.is_empty() || round == ROUNDS {
            break;
        }
        for v in bad
            .into_iter()
            .map(|v| v as usize)
            .filter(|&v| v < vertices.len())
        {
            let target = if round == 0 {
                vertices[v].mean
            } else {
                vertices[v].safe
            };
            let at = points[v];
            points[v] = at + (target - at) * if round == 0 { 1.0 } else { 0.5 };
        }
        mesh = triangulate(grid, &points, &polygons);
    }
    Surface { mesh, intersecting }
}

/// The same surface as quads; `None` where it needs other polygons.
pub(super) fn quads(grid: &VoxelGrid<f32>, set: &VoxelSet) -> Option<ControlMesh> {
    let mut cells = Cells {
        grid,
        set,
        cases: cases(),
        first: vec![u32::MAX; set.solid.len()],
    };
    let mut points: Vec<Vec3> = cells.number().iter().map(|v| v.mean).collect();
    let polygons = cells.polygons(&mut points);
    let quads = polygons
        .iter()
        .map(|p| p[..].try_into().ok())
        .collect::<Option<Vec<[u32; 4]>>>()?;
    Some(ControlMesh { points, quads })
}

impl Cells<'_> {
    fn case(&self, cell: usize) -> usize {
        let [nx, ny, _] = self.grid.dims;
        (0..8)
            .map(|c| {
                usize::from(self.set.solid[cell + (c & 1) + (c >> 1 & 1) * nx + (c >> 2) * nx * ny])
                    << c
            })
            .sum()
    }

    /// Numbers the vertices cell by cell and places them.
    fn number(&mut self) -> Vec<Vertex> {
        let [nx, ny, nz] = self.grid.dims;
        let this = &*self;
        let active: Vec<Vec<(u32, u8)>> = (0..nz.saturating_sub(1))
            .into_par_iter()
            .map(|k| {
                let mut out = Vec::new();
                for j in 0..ny - 1 {
                    for i in 0..nx - 1 {
                        let cell = (k * ny + j) * nx + i;
                        let case = this.case(cell);
                        if case != 0 && case != 255 {
                            out.push((cell as u32, case as u8));
                        }
                    }
                }
                out
            })
            .collect();
        let active: Vec<(u32, u8)> = active.into_iter().flatten().collect();
        let placed: Vec<Vec<Vertex>> = active
            .par_iter()
            .map(|&(cell, case)| this.place(cell as usize, case as usize))
            .collect();
        let mut next = 0;
        for (&(cell, _), vertices) in active.iter().zip(&placed) {
            self.first[cell as usize] = next;
            next += vertices.len() as u32;
        }
        placed.into_iter().flatten().collect()
    }

    fn corner(&self, cell: usize, c: usize) -> ([usize; 3], usize) {
        let [nx, ny, _] = self.grid.dims;
        let v = cell + (c & 1) + (c >> 1 & 1) * nx + (c >> 2) * nx * ny;
        (self.grid.ijk(v), v)
    }

    /// Where the surface crosses an edge of a cell.
    fn crossing(&self, cell: usize, e: usize) -> Vec3 {
        let (a, b) = edge_corners(e);
        let ((pa, va), (pb, vb)) = (self.corner(cell, a), self.corner(cell, b));
        let (fa, fb) = (
            f64::from(self.grid.values[va]),
            f64::from(self.grid.values[vb]),
        );
        let t = (fa / (fa - fb)).clamp(CLEAR, 1.0 - CLEAR);
        let (pa, pb) = (
            self.grid.centre(pa[0], pa[1], pa[2]),
            self.grid.centre(pb[0], pb[1], pb[2]),
        );
        pa + (pb - pa) * if t.is_finite() { t } else { 0.5 }
    }

    fn place(&self, cell: usize, case: usize) -> Vec<Vertex> {
        let [i, j, k] = self.grid.ijk(cell);
        let (lo, h) = (self.grid.centre(i, j, k), self.grid.spacing);
        let table = &self.cases[case];
        (0..table.count)
            .map(|component| {
                let edges: Vec<usize> = (0..12)
                    .filter(|&e| table.component[e] == component)
                    .collect();
                let points: Vec<Vec3> = edges.iter().map(|&e| self.crossing(cell, e)).collect();
                let count = edges.len() as f64;
                let mean = points.iter().sum::<Vec3>() / count;
                let safe = edges
                    .iter()
                    .map(|&e| {
                        let (a, b) = edge_corners(e);
                        let at = |c: usize| {
                            Vec3::new((c & 1) as f64, (c >> 1 & 1) as f64, (c >> 2) as f64)
                        };
                        lo + (at(a) + at(b)) / 2.0 * h
                    })
                    .sum::<Vec3>()
                    / count;
                // Two components in one cell must not cross: the means of their crossings do not.
                let best = if table.count > 1 {
                    mean
                } else {
                    self.minimize(&points, &mean)
                };
                let clamp =
                    |x: f64, a: usize| x.clamp(lo[a] + CLEAR * h, lo[a] + (1.0 - CLEAR) * h);
                Vertex {
                    best: Vec3::new(clamp(best.x, 0), clamp(best.y, 1), clamp(best.z, 2)),
                    mean,
                    safe,
                }
            })
            .collect()
    }

    /// The point nearest to the tangent planes at `points`.
    fn minimize(&self, points: &[Vec3], mean: &Vec3) -> Vec3 {
        let mut a = Matrix3::identity() * PULL;
        let mut b = Vec3::zeros();
        for p in points {
            let gradient = self.grid.gradient(p);
            if let Some(n) = gradient.try_normalize(0.0) {
                a += n * n.transpose();
                b += n * n.dot(&(p - mean));
            }
        }
        a.cholesky().map_or(*mean, |factor| mean + factor.solve(&b))
    }

    /// The vertex of a cell on the component that crosses `edge`.
    fn vertex(&self, cell: usize, edge: usize) -> u32 {
        self.first[cell] + u32::from(self.cases[self.case(cell)].component[edge])
    }

    /// One polygon a crossed edge, counter-clockwise from outside: four cell vertices, more where a dual edge is split.
    fn polygons(&self, points: &mut Vec<Vec3>) -> Vec<Vec<u32>> {
        let dims = self.grid.dims;
        let stride = [1, dims[0], dims[0] * dims[1]];
        let mut out = Vec::new();
        let mut middles: BTreeMap<(usize, usize, usize), u32> = BTreeMap::new();
        for v in 0..self.set.solid.len() {
            let at = self.grid.ijk(v);
            for axis in 0..3 {
                let w = v + stride[axis];
                if at[axis] + 1 >= dims[axis] || self.set.solid[v] == self.set.solid[w] {
                    continue;
                }
                // The border is empty, so a crossed edge has all four cells.
                let (u, t) = ((axis + 1) % 3, (axis + 2) % 3);
                // Cells in counter-clockwise order about +axis; in the cell the edge has the opposite bits.
                let mut ring = [(1, 1), (0, 1), (0, 0), (1, 0)]
                    .map(|(bu, bt)| (v - bu * stride[u] - bt * stride[t], 4 * axis + bu + 2 * bt));
                if self.set.solid[w] {
                    ring.reverse();
                }
                let solid = if self.set.solid[v] { v } else { w };
                let mut polygon = Vec::with_capacity(4);
                for i in 0..4 {
                    let (here, next) = (ring[i], ring[(i + 1) % 4]);
                    polygon.push(self.vertex(here.0, here.1));
                    if let Some((cell, face)) = self.doubled(here, next) {
                        let middle = *middles.entry((cell, face, solid)).or_insert_with(|| {
                            points.push(self.face_middle(cell, face, solid));
                            (points.len() - 1) as u32
                        });
                        polygon.push(middle);
                    }
                }
                if polygon.len() > 4 {
                    points.push(self.crossing(ring[0].0, ring[0].1));
                    let centre = (points.len() - 1) as u32;
                    for i in 0..polygon.len() {
                        out.push(vec![centre, polygon[i], polygon[(i + 1) % polygon.len()]]);
                    }
                } else {
                    out.push(polygon);
                }
            }
        }
        out
    }

    /// The face between two cells, as (cell, its face's axis) with the face on the cell's high side, when the two cells
    /// are joined through it by two dual edges between the same two vertices.
    fn doubled(&self, here: (usize, usize), next: (usize, usize)) -> Option<(usize, usize)> {
        let ((low, low_edge), (high, high_edge)) = if here.0 < next.0 {
            (here, next)
        } else {
            (next, here)
        };
        let dims = self.grid.dims;
        let axis = match high - low {
            1 => 0,
            d if d == dims[0] => 1,
            _ => 2,
        };
        let case = self.case(low);
        if !is_ambiguous(case, axis, 1) {
            return None;
        }
        let whole = |cell: usize, side: usize, edge: usize| {
            let table = &self.cases[self.case(cell)];
            let q = face_corners(axis, side);
            (0..4).all(|i| {
                table.component[edge_between(q[i], q[(i + 1) % 4])] == table.component[edge]
            })
        };
        (whole(low, 1, low_edge) && whole(high, 0, high_edge)).then_some((low, axis))
    }

    /// Between the two crossings next to the solid corner `solid` of the high face of `cell` along `axis`.
    fn face_middle(&self, cell: usize, axis: usize, solid: usize) -> Vec3 {
        let q = face_corners(axis, 1);
        let i = (0..4)
            .find(|&i| self.corner(cell, q[i]).1 == solid)
            .unwrap_or(0);
        let edges = [
            edge_between(q[(i + 3) % 4], q[i]),
            edge_between(q[i], q[(i + 1) % 4]),
        ];
        (self.crossing(cell, edges[0]) + self.crossing(cell, edges[1])) / 2.0
    }
}

/// Splits quads along the diagonal that leaves the flatter pair of triangles, the shorter one when they are alike.
fn triangulate(grid: &VoxelGrid<f32>, points: &[Vec3], polygons: &[Vec<u32>]) -> TriMesh {
    let normal = |t: [u32; 3]| {
        let [a, b, c] = t.map(|v| points[v as usize]);
        (b - a)
            .cross(&(c - a))
            .try_normalize(0.0)
            .unwrap_or_default()
    };
    let h2 = grid.spacing * grid.spacing;
    let split = |p: &Vec<u32>| -> Vec<[u32; 3]> {
        let &[a, b, c, d] = &p[..] else {
            return vec![[p[0], p[1], p[2]]];
        };
        let (first, second) = ([[a, b, c], [a, c, d]], [[a, b, d], [b, c, d]]);
        let score = |pair: &[[u32; 3]; 2], x: u32, y: u32| {
            normal(pair[0]).dot(&normal(pair[1]))
                - 0.1 * (points[x as usize] - points[y as usize]).norm_squared() / h2
        };
        if score(&first, a, c) >= score(&second, b, d) {
            first.to_vec()
        } else {
            second.to_vec()
        }
    };
    let triangles: Vec<Vec<[u32; 3]>> = polygons.par_iter().with_min_len(1024).map(split).collect();
    TriMesh {
        points: points.to_vec(),
        triangles: triangles.into_iter().flatten().collect(),
        tags: Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Solid;
    use crate::remesh::compose::separate_opposite_empties;
    use proptest::prelude::*;

    fn field(n: usize, bits: &[bool]) -> VoxelGrid<f32> {
        let mut grid = VoxelGrid::filled(Vec3::zeros(), 1.0, [n + 4; 3], -1f32);
        for (b, &solid) in bits.iter().enumerate() {
            let v = grid.index(b % n + 2, b / n % n + 2, b / (n * n) + 2);
            grid.values[v] = if solid {
                0.3 + (b % 7) as f32 * 0.1
            } else {
                -0.4 - (b % 5) as f32 * 0.1
            };
        }
        grid
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(400))]
        #[test]
        fn random_voxels_give_a_manifold_with_twice_their_euler_number(bits in prop::collection::vec(any::<bool>(), 64)) {
            prop_assume!(bits.iter().any(|&b| b));
            let mut grid = field(4, &bits);
            let mut set = VoxelSet::positive(grid.dims, &grid.values);
            separate_opposite_empties(&mut grid, &mut set);
            let solid = Solid::try_from(surface(&grid, &set, false).mesh);
            prop_assert!(solid.is_ok(), "{:?}", solid.err());
            if let Ok(solid) = solid {
                prop_assert_eq!(solid.euler(), 2 * set.chi());
            }
        }
    }

    #[test]
    fn a_ball_is_accurate_and_free_of_intersections() {
        let mut grid = VoxelGrid::filled(Vec3::repeat(-12.0), 1.0, [25; 3], 0f32);
        for v in 0..grid.values.len() {
            let [i, j, k] = grid.ijk(v);
            grid.values[v] = (9.3 - grid.centre(i, j, k).norm()) as f32;
        }
        let set = VoxelSet::positive(grid.dims, &grid.values);
        let out = surface(&grid, &set, true);
        assert_eq!(out.intersecting, 0);
        assert!(
            out.mesh
                .points
                .iter()
                .all(|p| (p.norm() - 9.3).abs() < 0.05)
        );
        let solid = Solid::try_from(out.mesh).expect("a ball");
        assert_eq!(solid.euler(), 2);
        let exact = 4.0 / 3.0 * std::f64::consts::PI * 9.3f64.powi(3);
        assert!((solid.volume() / exact - 1.0).abs() < 0.01);
    }
}
