//! The surface of a density that a mould leaves: every line along the draw crosses it twice or not at all.

use super::cases::{edge_corners, polygons};
use super::{RemeshError, RemeshOptions, density};
use crate::Vec3;
use crate::mesh::TriMesh;
use crate::monitor::Monitor;
use crate::voxel::VoxelGrid;

/// Vertices stay this far from the ends of their edge (voxels).
const CLEAR: f64 = 0.02;

/// How a mould leaves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Draw {
    /// Axis of the grid.
    pub axis: usize,
    /// First layer of voxels above the parting plane; none where the mould is one-sided.
    pub parting: Option<usize>,
}

/// The closed surface `density = iso` of a density whose columns along the draw fall away from the parting plane.
///
/// 1. A layer of nodes in the parting plane takes the larger value of the two voxels at it; so all columns have their peak
///    in one layer, and the full part of every layer holds that of the next one farther out.
/// 2. Marching cubes, two full corners on a diagonal of a face apart. Between two nested layers the polygons of a cell are
///    convex when seen along the draw, so they lie beside each other and never above each other. Dual contouring has no
///    such property: walls along the draw come out wavy by some hundredths of a voxel, and a line in the wall crosses
///    each wave.
/// 3. Vertices next to the parting plane lie where the two voxels at it have the crossing between them, but not beyond the
///    plane: heights along the draw are free.
///
/// Lines through a column that does not fall away from the parting plane (non-design bodies with cross bores, and where the
/// design space does not reach the plane) may cross more often. Border and margins are as in [`super::iso_surface`].
/// W. E. Lorensen, H. E. Cline: Marching cubes, 1987, doi:10.1145/37402.37422.
///
/// # Errors
/// As [`super::remesh_density`].
pub fn drawn_surface(
    density: &VoxelGrid<f32>,
    iso: f64,
    draw: Draw,
    options: &RemeshOptions,
    monitor: &Monitor,
) -> Result<TriMesh, RemeshError> {
    let padded = density::padded(density, iso, options, monitor)?;
    let margin = (padded.dims[draw.axis] - density.dims[draw.axis]) / 2;
    let field = Field::new(&padded, draw.axis, draw.parting.map(|layer| layer + margin));
    Ok(field.surface())
}

/// Values on the voxel centres and in the parting plane.
struct Field {
    dims: [usize; 3],
    values: Vec<f32>,
    /// Coordinates of the layers along the three axes, mm.
    places: [Vec<f64>; 3],
    /// Edge of a voxel, mm.
    h: f64,
    axis: usize,
    /// The layer in the parting plane.
    inserted: Option<usize>,
}

impl Field {
    fn new(grid: &VoxelGrid<f32>, axis: usize, parting: Option<usize>) -> Self {
        let mut places = [0, 1, 2].map(|a| {
            let place = |i: usize| grid.origin[a] + grid.spacing * i as f64;
            (0..grid.dims[a]).map(place).collect::<Vec<_>>()
        });
        let inserted = parting.filter(|&layer| layer > 0 && layer < grid.dims[axis]);
        let mut dims = grid.dims;
        if let Some(layer) = inserted {
            let middle = (places[axis][layer - 1] + places[axis][layer]) / 2.0;
            places[axis].insert(layer, middle);
            dims[axis] += 1;
        }
        let values = (0..dims.iter().product()).map(|node| {
            let mut at = [
                node % dims[0],
                node / dims[0] % dims[1],
                node / (dims[0] * dims[1]),
            ];
            let value = |at: [usize; 3]| grid.values[grid.index(at[0], at[1], at[2])];
            match inserted {
                Some(layer) if at[axis] == layer => {
                    let above = value(at);
                    at[axis] -= 1;
                    above.max(value(at))
                }
                Some(layer) if at[axis] > layer => {
                    at[axis] -= 1;
                    value(at)
                }
                _ => value(at),
            }
        });
        Self {
            values: values.collect(),
            dims,
            places,
            h: grid.spacing,
            axis,
            inserted,
        }
    }

    fn strides(&self) -> [usize; 3] {
        [1, self.dims[0], self.dims[0] * self.dims[1]]
    }

    fn at(&self, node: usize) -> [usize; 3] {
        let [nx, ny, _] = self.dims;
        [node % nx, node / nx % ny, node / (nx * ny)]
    }

    fn solid(&self, node: usize) -> bool {
        self.values[node] > 0.0
    }

    fn surface(&self) -> TriMesh {
        let (strides, table) = (self.strides(), polygons());
        let mut mesh = TriMesh::default();
        // Vertex of the edge from every node along every axis.
        let mut vertices = vec![u32::MAX; 3 * self.values.len()];
        for node in 0..self.values.len() {
            let at = self.at(node);
            for a in (0..3).filter(|&a| at[a] + 1 < self.dims[a]) {
                if self.solid(node) != self.solid(node + strides[a]) {
                    vertices[3 * node + a] = mesh.points.len() as u32;
                    mesh.points.push(self.crossing(node, a));
                }
            }
        }
        let corner = |cell: usize, c: usize| -> usize {
            cell + (0..3).map(|a| (c >> a & 1) * strides[a]).sum::<usize>()
        };
        for cell in 0..self.values.len() {
            let at = self.at(cell);
            if (0..3).any(|a| at[a] + 1 >= self.dims[a]) {
                continue;
            }
            let case: usize = (0..8)
                .map(|c| usize::from(self.solid(corner(cell, c))) << c)
                .sum();
            for polygon in &table[case] {
                let vertex = |&e: &usize| vertices[3 * corner(cell, edge_corners(e).0) + e / 4];
                let polygon: Vec<u32> = polygon.iter().map(vertex).collect();
                split(&polygon, &mut mesh);
            }
        }
        mesh
    }

    /// Where the surface crosses the edge from `node` along axis `a`.
    fn crossing(&self, node: usize, a: usize) -> Vec3 {
        let (at, stride) = (self.at(node), self.strides()[a]);
        let mut p = Vec3::from(std::array::from_fn(|a| self.places[a][at[a]]));
        let beside = self.inserted.filter(|_| a == self.axis);
        let beside = beside.filter(|&layer| at[a] == layer || at[a] + 1 == layer);
        // Between the voxels below and above the parting plane, or else along the edge.
        let (low, high) = match beside {
            Some(layer) if at[a] == layer => (node - stride, node + stride),
            Some(_) => (node, node + 2 * stride),
            None => (node, node + stride),
        };
        let [from, to] = [low, high].map(|node| self.places[a][self.at(node)[a]]);
        let [f, g] = [low, high].map(|node| f64::from(self.values[node]));
        let ends = [0, 1].map(|i| self.places[a][at[a] + i]);
        let place = from + (to - from) * (f / (f - g));
        let place = if place.is_finite() { place } else { p[a] };
        p[a] = place.clamp(ends[0] + CLEAR * self.h, ends[1] - CLEAR * self.h);
        p
    }
}

/// Triangles of a polygon. More than four corners meet in a point of their own: a diagonal could lie in a face of the cell,
/// where that of the next cell may lie too.
fn split(polygon: &[u32], mesh: &mut TriMesh) {
    match *polygon {
        [a, b, c] => mesh.triangles.push([a, b, c]),
        [a, b, c, d] => mesh.triangles.extend([[a, b, c], [a, c, d]]),
        _ => {
            let centre = mesh.points.len() as u32;
            let corners = polygon.iter().map(|&v| mesh.points[v as usize]);
            let sum: Vec3 = corners.sum();
            mesh.points.push(sum / polygon.len() as f64);
            let next = polygon.iter().cycle().skip(1);
            let fan = polygon.iter().zip(next).map(|(&a, &b)| [centre, a, b]);
            mesh.triangles.extend(fan);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Solid;
    use crate::topopt::{
        DESIGN, DrawOptions, FROZEN, LoadCase, OptimizeOptions, Parting, Problem, optimize,
    };
    use proptest::prelude::*;

    /// Places along `axis` where a line through `p` crosses the mesh.
    fn crossings(mesh: &TriMesh, axis: usize, p: [f64; 2]) -> Vec<f64> {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let mut out = Vec::new();
        for t in 0..mesh.triangles.len() {
            let c = mesh.corners(t);
            let side =
                |a: &Vec3, b: &Vec3| (b[u] - a[u]) * (p[1] - a[v]) - (b[v] - a[v]) * (p[0] - a[u]);
            let w = [side(&c[1], &c[2]), side(&c[2], &c[0]), side(&c[0], &c[1])];
            if w.iter().all(|&w| w > 0.0) || w.iter().all(|&w| w < 0.0) {
                let sum: f64 = w.iter().sum();
                out.push((0..3).map(|i| w[i] * c[i][axis]).sum::<f64>() / sum);
            }
        }
        out
    }

    /// Asserts that lines all over the box of the mesh cross it twice or not at all; gives how many do.
    fn assert_drawn(mesh: &TriMesh, axis: usize) -> usize {
        let (low, high) = mesh.bounds().unwrap();
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let mut through = 0;
        for i in 0..61 {
            for j in 0..61 {
                // Different shifts: on the diagonals of cells lie edges of triangles.
                let place = |a: usize, i: f64| low[a] + (high[a] - low[a]) * i / 61.0;
                let p = [place(u, i as f64 + 0.537), place(v, j as f64 + 0.291)];
                let found = crossings(mesh, axis, p);
                assert!(found.is_empty() || found.len() == 2, "{i} {j}: {found:?}");
                through += found.len() / 2;
            }
        }
        through
    }

    fn surface(grid: &VoxelGrid<f32>, draw: Draw) -> TriMesh {
        let options = RemeshOptions::default();
        drawn_surface(grid, 0.5, draw, &options, &Monitor::default()).unwrap()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]
        #[test]
        fn columns_that_fall_away_from_the_parting_give_one_interval_a_line(
            values in prop::collection::vec(0.0f32..1.0, 216), layer in 0usize..=6, axis in 0usize..3
        ) {
            let mut grid = VoxelGrid::filled(Vec3::zeros(), 1.0, [6; 3], 0f32);
            grid.values = values;
            let stride = [1, 6, 36][axis];
            for first in (0..216).filter(|v| v / stride % 6 == 0) {
                for k in 1..layer {
                    let at = first + k * stride;
                    grid.values[at] = grid.values[at].max(grid.values[at - stride]);
                }
                for k in (layer..5).rev() {
                    let at = first + k * stride;
                    grid.values[at] = grid.values[at].max(grid.values[at + stride]);
                }
            }
            prop_assume!(grid.values.iter().any(|&v| v > 0.5));
            let mesh = surface(&grid, Draw { axis, parting: Some(layer) });
            prop_assert!(assert_drawn(&mesh, axis) > 0);
            prop_assert!(mesh.volume() > 0.0);
            prop_assert!(Solid::try_from(mesh).is_ok());
        }
    }

    #[test]
    fn halves_that_are_full_or_empty_end_at_the_parting_plane() {
        // A step: the lower half full on the left, the upper half full on the right.
        let mut grid = VoxelGrid::filled(Vec3::zeros(), 1.0, [8, 4, 8], 0f32);
        for v in 0..grid.values.len() {
            let [i, _, k] = grid.ijk(v);
            grid.values[v] = if (i < 4) == (k < 4) { 1.0 } else { 0.0 };
        }
        let mesh = surface(
            &grid,
            Draw {
                axis: 2,
                parting: Some(4),
            },
        );
        assert_drawn(&mesh, 2);
        let found = crossings(&mesh, 2, [1.3, 1.4]);
        assert!(found.iter().any(|z| (z - 3.5).abs() < 0.03), "{found:?}");
    }

    #[test]
    fn lines_along_the_draw_cross_an_optimized_part_once() {
        let dims = [20, 10, 8];
        let mut problem = Problem {
            h: 1.0,
            dims,
            labels: vec![DESIGN; dims.iter().product()],
            young: 1.0,
            nu: 0.3,
            cases: vec![LoadCase {
                name: "tip".into(),
                weight: 1.0,
                forces: vec![([20, 5, 4], [0.3, -1.0, 0.4])],
                ..LoadCase::default()
            }],
            ..Problem::default()
        };
        // A boss that does not reach the upper end.
        for v in 0..problem.labels.len() {
            let [x, y, z] = problem.at(v);
            if x >= 17 && (3..7).contains(&y) && (1..7).contains(&z) {
                problem.labels[v] = FROZEN;
            }
        }
        for z in 0..=dims[2] {
            for y in 0..=dims[1] {
                problem.fixed.extend((0..3).map(|c| ([0, y, z], c)));
            }
        }
        let options = OptimizeOptions {
            volume_fraction: 0.35,
            max_iterations: 30,
            beta_start: 4,
            beta_every: 2,
            filter_radius: Some(2.0),
            draw: Some(DrawOptions {
                dir: [0.0, 0.0, 1.0],
                parting: Parting::Plane,
                at: 4.0,
            }),
            ..OptimizeOptions::default()
        };
        let monitor = Monitor::default();
        let none = |_: &_| Ok(());
        let done = optimize(
            &problem,
            &options,
            &Default::default(),
            None,
            &none,
            &monitor,
        );
        let grid = VoxelGrid {
            origin: Vec3::repeat(0.5),
            spacing: 1.0,
            dims,
            values: done.unwrap().rho.iter().map(|&r| r as f32).collect(),
        };
        let mesh = surface(
            &grid,
            Draw {
                axis: 2,
                parting: Some(4),
            },
        );
        assert!(assert_drawn(&mesh, 2) > 500);
    }
}
