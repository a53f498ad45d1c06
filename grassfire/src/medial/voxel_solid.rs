//! The voxel solid: occupancy, boundary corners and Betti numbers.

use rayon::prelude::*;

use super::union_find::UnionFind;
use crate::topology::Betti;
use crate::voxel::VoxelGrid;

/// Solid voxels with one empty layer around them. Voxel (i, j, k) covers [i, i+1] x [j, j+1] x [k, k+1],
/// so that corners have integer coordinates; voxel (0, 0, 0) of the field is (1, 1, 1) here.
pub(super) struct VoxelSolid {
    pub(super) dims: [usize; 3],
    pub(super) solid: Vec<bool>,
}

impl VoxelSolid {
    /// Voxels with a value above zero are solid.
    pub(super) fn from_field(field: &VoxelGrid<f32>) -> Self {
        let [nx, ny, nz] = field.dims;
        let dims = [nx + 2, ny + 2, nz + 2];
        let mut solid = vec![false; dims[0] * dims[1] * dims[2]];
        solid
            .par_chunks_mut(dims[0] * dims[1])
            .enumerate()
            .for_each(|(k, layer)| {
                if k == 0 || k > nz {
                    return;
                }
                for j in 0..ny {
                    let row = ((k - 1) * ny + j) * nx;
                    let into = &mut layer[(j + 1) * dims[0] + 1..][..nx];
                    for (s, &f) in into.iter_mut().zip(&field.values[row..row + nx]) {
                        *s = f > 0.0;
                    }
                }
            });
        Self { dims, solid }
    }

    /// Is voxel (i, j, k) solid? Everything outside the grid is empty.
    #[inline]
    pub(super) fn is_solid(&self, at: [i64; 3]) -> bool {
        let [nx, ny, _] = self.dims;
        let inside = at
            .iter()
            .zip(self.dims)
            .all(|(&x, n)| x >= 0 && x < n as i64);
        inside && self.solid[(at[2] as usize * ny + at[1] as usize) * nx + at[0] as usize]
    }

    /// Corners that touch a solid and an empty voxel, and the Euler number of the solid under
    /// 6-adjacency (two voxels hang together only through a common square).
    ///
    /// The solid is thin along edges and corners there, so its Euler number is that of the dual
    /// complex: voxels - adjacent pairs + full 2x2 squares - full 2x2x2 blocks.
    pub(super) fn corners(&self) -> (Vec<[i32; 3]>, i64) {
        let [nx, ny, nz] = self.dims;
        let euler = euler_table();
        let layers: Vec<(Vec<[i32; 3]>, i64)> = (1..nz)
            .into_par_iter()
            .map(|z| {
                let mut corners = Vec::new();
                let mut chi = 0;
                for y in 1..ny {
                    let rows = [(y - 1, z - 1), (y, z - 1), (y - 1, z), (y, z)]
                        .map(|(j, k)| &self.solid[(k * ny + j) * nx..][..nx]);
                    let column = |x: usize| {
                        (0..4).fold(0usize, |bits, r| bits | usize::from(rows[r][x]) << r)
                    };
                    let mut back = column(0);
                    for x in 1..nx {
                        let front = column(x);
                        let block = back | front << 4;
                        back = front;
                        if block != 0 && block != 255 {
                            chi += euler[block];
                            corners.push([x as i32, y as i32, z as i32]);
                        }
                    }
                }
                (corners, chi)
            })
            .collect();
        let chi = layers.iter().map(|layer| layer.1).sum();
        (layers.into_iter().flat_map(|layer| layer.0).collect(), chi)
    }

    /// Betti numbers: 6-connected solid components, cavities as 26-connected empty components
    /// that do not reach the outside, loops from the Euler number `chi` of [`Self::corners`].
    pub(super) fn betti(&self, chi: i64) -> Betti {
        let (solid, empty) = rayon::join(
            || self.components(true, false),
            || self.components(false, true),
        );
        Betti::from_chi(solid as i64, empty as i64 - 1, chi)
    }

    /// Connected components of the voxels equal to `value`, through squares only or also through edges and corners.
    fn components(&self, value: bool, diagonal: bool) -> usize {
        let runs = Runs::of(self, value);
        let mut sets = UnionFind::new(runs.spans.len());
        let (ny, nz) = (self.dims[1], self.dims[2]);
        let reach = u32::from(diagonal);
        for k in 0..nz {
            for j in 0..ny {
                let row = k * ny + j;
                if j > 0 {
                    runs.link(&mut sets, row, row - 1, reach);
                }
                if k > 0 {
                    runs.link(&mut sets, row, row - ny, reach);
                    if diagonal && j > 0 {
                        runs.link(&mut sets, row, row - ny - 1, reach);
                    }
                    if diagonal && j + 1 < ny {
                        runs.link(&mut sets, row, row - ny + 1, reach);
                    }
                }
            }
        }
        sets.sets()
    }
}

/// Maximal runs of equal voxels along x, row by row.
struct Runs {
    /// First run of each row, and the end.
    start: Vec<u32>,
    /// First voxel and one past the last.
    spans: Vec<[u32; 2]>,
}

impl Runs {
    fn of(voxels: &VoxelSolid, value: bool) -> Self {
        let mut start = vec![0];
        let mut spans: Vec<[u32; 2]> = Vec::new();
        for row in voxels.solid.chunks_exact(voxels.dims[0]) {
            let mut from = None;
            for (x, &solid) in row.iter().enumerate() {
                match (from, solid == value) {
                    (None, true) => from = Some(x as u32),
                    (Some(first), false) => {
                        spans.push([first, x as u32]);
                        from = None;
                    }
                    _ => {}
                }
            }
            if let Some(first) = from {
                spans.push([first, row.len() as u32]);
            }
            start.push(spans.len() as u32);
        }
        Self { start, spans }
    }

    /// Unites the runs of two rows that overlap when widened by `reach`.
    fn link(&self, sets: &mut UnionFind, row: usize, other: usize, reach: u32) {
        let (mut a, a_end) = (self.start[row], self.start[row + 1]);
        let (mut b, b_end) = (self.start[other], self.start[other + 1]);
        while a < a_end && b < b_end {
            let (s, t) = (self.spans[a as usize], self.spans[b as usize]);
            if s[0] < t[1] + reach && t[0] < s[1] + reach {
                sets.unite(a, b);
            }
            if s[1] < t[1] {
                a += 1;
            } else {
                b += 1;
            }
        }
    }
}

/// Of each pattern of a 2x2x2 block (bit = dy + 2 dz + 4 dx): cells of the dual complex that have
/// the block's lowest voxel as their lowest.
fn euler_table() -> [i64; 256] {
    let cells = [
        (1, 0b1),
        (-1, 0b11),
        (-1, 0b101),
        (-1, 0b1_0001),
        (1, 0b1111),
        (1, 0b11_0011),
        (1, 0b101_0101),
        (-1, 0b1111_1111),
    ];
    std::array::from_fn(|block| {
        cells
            .iter()
            .filter(|cell| block & cell.1 == cell.1)
            .map(|cell| cell.0)
            .sum()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Vec3;

    fn betti(dims: [usize; 3], solid: impl Fn(usize, usize, usize) -> bool) -> Betti {
        let mut field = VoxelGrid::filled(Vec3::zeros(), 1.0, dims, -1.0f32);
        for index in 0..field.values.len() {
            let [i, j, k] = field.ijk(index);
            field.values[index] = if solid(i, j, k) { 1.0 } else { -1.0 };
        }
        let voxels = VoxelSolid::from_field(&field);
        let (_, chi) = voxels.corners();
        voxels.betti(chi)
    }

    #[test]
    fn simple_solids() {
        assert_eq!(betti([1, 1, 1], |_, _, _| true), Betti::from_chi(1, 0, 1));
        assert_eq!(
            betti([3, 3, 3], |i, j, k| [i, j, k] != [1, 1, 1]),
            Betti::from_chi(1, 1, 2)
        );
        assert_eq!(
            betti([3, 3, 1], |i, j, _| [i, j] != [1, 1]),
            Betti::from_chi(1, 0, 0)
        );
        // Two voxels that touch along an edge are two components, and a hole closed only by edges is none.
        assert_eq!(betti([2, 2, 1], |i, j, _| i == j), Betti::from_chi(2, 0, 2));
        assert_eq!(
            betti([3, 3, 3], |i, j, k| (i, j, k) != (1, 1, 1)
                && (i, j, k) != (0, 0, 1)),
            Betti::from_chi(1, 0, 1)
        );
        assert_eq!(betti([2, 2, 2], |_, _, _| false), Betti::from_chi(0, 0, 0));
    }
}
