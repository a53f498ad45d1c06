//! Makes the voxel set one whose cubical topology every cell's surface components can show.

use super::digital::{VoxelSet, is_simple};
use crate::voxel::VoxelGrid;

/// Rounds at most; every round removes the places known at its start.
const ROUNDS: usize = 32;
/// Value of a flipped voxel, in voxels.
const HELD: f32 = 0.1;

/// Flips voxels until no cell of 2x2x2 voxels has exactly its two opposite corners empty. There the empty corners are
/// 26-connected through the cell, which would take a tube of surface; every other configuration is served by discs.
/// Simple points are flipped where there are any, so the topology stays; returns how many flips were not simple.
pub(super) fn separate_opposite_empties(grid: &mut VoxelGrid<f32>, set: &mut VoxelSet) -> usize {
    let mut forced = 0;
    for _ in 0..ROUNDS {
        let cells = offending(set);
        if cells.is_empty() {
            break;
        }
        for (cell, pair) in cells {
            let corners = corners(set, cell);
            if !is_offending(set, &corners, pair) {
                continue;
            }
            let size = |c: usize| grid.values[corners[c] as usize].abs();
            let best = |all: &mut dyn Iterator<Item = usize>| {
                all.min_by(|&a, &b| size(a).total_cmp(&size(b)))
            };
            let simple = best(&mut (0..8).filter(|&c| is_simple(set.mask(corners[c]))));
            let c = match simple {
                Some(c) => c,
                None => {
                    forced += 1;
                    best(&mut [pair, 7 - pair].into_iter()).unwrap_or(pair)
                }
            };
            let v = corners[c] as usize;
            set.solid[v] = !set.solid[v];
            grid.values[v] = HELD * grid.spacing as f32 * if set.solid[v] { 1.0 } else { -1.0 };
        }
    }
    forced
}

fn corners(set: &VoxelSet, cell: u32) -> [u32; 8] {
    let [nx, ny, _] = set.dims;
    std::array::from_fn(|c| cell + ((c & 1) + (c >> 1 & 1) * nx + (c >> 2) * nx * ny) as u32)
}

fn is_offending(set: &VoxelSet, corners: &[u32; 8], pair: usize) -> bool {
    (0..8).all(|c| set.solid[corners[c] as usize] != (c == pair || c == 7 - pair))
}

/// Cells with exactly the corners `pair` and `7 - pair` empty. Six corners are solid, so no voxel is on the border.
fn offending(set: &VoxelSet) -> Vec<(u32, usize)> {
    let [nx, ny, nz] = set.dims;
    let mut out = Vec::new();
    for k in 0..nz.saturating_sub(1) {
        for j in 0..ny.saturating_sub(1) {
            for i in 0..nx.saturating_sub(1) {
                let cell = (k * ny + j) * nx + i;
                // No two corners of a face are empty in such a cell: a cheap test that most cells fail.
                if !set.solid[cell + 1] && !set.solid[cell + nx] {
                    continue;
                }
                let corners = corners(set, cell as u32);
                if let Some(pair) = (0..4).find(|&pair| is_offending(set, &corners, pair)) {
                    out.push((cell as u32, pair));
                }
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Vec3;

    #[test]
    fn a_pinched_block_is_resolved() {
        let mut grid = VoxelGrid::filled(Vec3::zeros(), 1.0, [6; 3], -1f32);
        for c in 1..7usize {
            let v = grid.index(2 + (c & 1), 2 + (c >> 1 & 1), 2 + (c >> 2));
            grid.values[v] = 1.0;
        }
        let mut set = VoxelSet::positive(grid.dims, &grid.values);
        separate_opposite_empties(&mut grid, &mut set);
        assert!(offending(&set).is_empty());
        assert_eq!(set, VoxelSet::positive(grid.dims, &grid.values));
    }
}
