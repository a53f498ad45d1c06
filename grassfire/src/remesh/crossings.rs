//! Exact winding numbers along grid rows, for triangles that close up.

use rayon::prelude::*;
use robust::{Coord, orient2d};

use crate::Vec3;
use crate::mesh::TriMesh;
use crate::voxel::VoxelGrid;

/// Where a row meets a triangle.
struct Crossing {
    /// `k * ny + j`.
    row: u32,
    /// Along the row, in voxels.
    x: f64,
    /// +1 when the triangle faces +x.
    sign: i8,
}

/// The winding number of every voxel of `grid`, held within -128..=127.
///
/// 1. Every triangle is cut with the rows along x. Exact orientation tests, with the row moved by an infinitely small
///    step where it meets an edge, make neighbouring triangles share rows without gap or overlap.
/// 2. The winding number at a voxel is the sum of the signs of the crossings beyond it.
///
/// Right for any set of triangles whose edges are used as often forward as backward, whatever they overlap or cut.
pub(super) fn winding_by_rows(mesh: &TriMesh, grid: &VoxelGrid<f32>) -> Vec<i8> {
    let mut crossings: Vec<Crossing> = (0..mesh.triangles.len())
        .into_par_iter()
        .with_min_len(256)
        .flat_map_iter(|t| cut(&mesh.corners(t).map(|p| grid.to_grid(&p)), grid.dims))
        .collect();
    crossings.par_sort_unstable_by(|a, b| {
        a.row
            .cmp(&b.row)
            .then(b.x.total_cmp(&a.x))
            .then(a.sign.cmp(&b.sign))
    });
    let mut out = vec![0i8; grid.values.len()];
    out.par_chunks_mut(grid.dims[0])
        .enumerate()
        .for_each(|(row, numbers)| {
            let first = crossings.partition_point(|c| (c.row as usize) < row);
            let mut beyond = crossings[first..]
                .iter()
                .take_while(|c| c.row as usize == row)
                .peekable();
            let mut winding = 0i64;
            for (i, number) in numbers.iter_mut().enumerate().rev() {
                while let Some(crossing) = beyond.next_if(|c| c.x > i as f64) {
                    winding += i64::from(crossing.sign);
                }
                *number = winding.clamp(-128, 127) as i8;
            }
        });
    out
}

/// The rows that meet a triangle (corners in voxels).
fn cut(corners: &[Vec3; 3], dims: [usize; 3]) -> Vec<Crossing> {
    let (lo, hi) = (
        corners[0].inf(&corners[1]).inf(&corners[2]),
        corners[0].sup(&corners[1]).sup(&corners[2]),
    );
    let range = |a: usize| {
        let last = dims[a] as f64 - 1.0;
        lo[a].ceil().max(0.0) as usize..(hi[a].floor().min(last) + 1.0).max(0.0) as usize
    };
    let flat = corners.map(|p| Coord { x: p.y, y: p.z });
    let mut out = Vec::new();
    for k in range(2) {
        for j in range(1) {
            let p = Coord {
                x: j as f64,
                y: k as f64,
            };
            let turns = [0, 1, 2].map(|e| turn(p, flat[(e + 1) % 3], flat[(e + 2) % 3]));
            let Some(sign) = turns
                .iter()
                .try_fold(0i8, |s, t| (t.1 != 0 && s * t.1 >= 0).then_some(t.1))
            else {
                continue;
            };
            let sum: f64 = turns.iter().map(|t| t.0).sum();
            let x = if sum != 0.0 {
                (0..3).map(|e| turns[e].0 / sum * corners[e].x).sum()
            } else {
                corners[0].x
            };
            out.push(Crossing {
                row: (k * dims[1] + j) as u32,
                x: x.clamp(lo.x, hi.x),
                sign,
            });
        }
    }
    out
}

/// Twice the area of (p, a, b) and its sign, which is never 0 unless a and b coincide: p counts as moved by
/// (e, e^2) for an infinitely small e.
fn turn(p: Coord<f64>, a: Coord<f64>, b: Coord<f64>) -> (f64, i8) {
    let area = orient2d(p, a, b);
    let sign = |x: f64| if x > 0.0 { 1 } else { -i8::from(x < 0.0) };
    let side = match sign(area) {
        0 if b.y != a.y => -sign(b.y - a.y),
        0 => sign(b.x - a.x),
        side => side,
    };
    (area, side)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn rows_through_corners_and_edges_count_once(size in 1usize..4, shift in 0usize..3) {
            // A cube whose faces, edges and diagonals lie on grid rows.
            let mut mesh = crate::remesh::tests::cube(2.0 * size as f64);
            mesh.points.iter_mut().for_each(|p| *p = p.add_scalar(6.0 + shift as f64 * 0.5));
            let grid = VoxelGrid::filled(Vec3::zeros(), 1.0, [16; 3], 1f32);
            let numbers = winding_by_rows(&mesh, &grid);
            for (v, &number) in numbers.iter().enumerate() {
                let [i, j, k] = grid.ijk(v);
                let depth = size as f64 - (grid.centre(i, j, k).add_scalar(-6.0 - shift as f64 * 0.5)).abs().max();
                prop_assert!(depth == 0.0 || number == i8::from(depth > 0.0));
            }
        }
    }
}
