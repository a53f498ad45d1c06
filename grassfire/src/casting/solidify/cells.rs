//! How fine the cells are when nobody says it.

use crate::casting::mould::walls;
use crate::mesh::TriMesh;

/// The longest side of a part has at least this many cells.
const ALONG: f64 = 110.0;
/// And a thin wall this many: with two or three, a ring freezes unevenly by the angle at which the cells cut it, and shows hot
/// spots that finer cells do not have.
const ACROSS: f64 = 4.0;
/// A wall is thin where only this share of the walls is thinner: the median of the thinnest tenth.
const THIN: f64 = 0.05;
/// Places at which walls are measured.
const SAMPLES: usize = 4000;
/// Cells with the sand that are taken unasked.
pub(super) const BUDGET: usize = 4_000_000;
/// Even cells around the part on each side.
const MARGIN: f64 = 5.0;

/// The edge of a cell for a part, mm.
///
/// 1. A 110th of the longest side, or a quarter of a thin wall ([`walls`]) where that is less.
/// 2. As coarse as `budget` cells without the outer sand ask for; whoever lays the grid makes it coarser when the sand takes more.
pub(super) fn default_cell(mesh: &TriMesh, budget: usize) -> f64 {
    let Some((lo, hi)) = mesh.bounds() else {
        return 1.0;
    };
    let size = hi - lo;
    let measured = walls(mesh, SAMPLES);
    let thin = measured.get((THIN * measured.len() as f64) as usize);
    let thin = thin.map_or(f64::INFINITY, |wall| wall.thickness);
    let mut cell = (size.max() / ALONG).min(thin / ACROSS);
    let cells = |cell: f64| -> f64 { size.iter().map(|s| s / cell + 2.0 * MARGIN).product() };
    // A surface that folds back on itself has walls of any thinness.
    let least = size.max() / budget as f64;
    cell = cell.max(least);
    while cells(cell) > budget as f64 {
        cell = coarser(cell, cells(cell), budget);
    }
    cell
}

/// An edge at which about `budget` cells are left of `cells`, and fewer in any case.
pub(super) fn coarser(cell: f64, cells: f64, budget: usize) -> f64 {
    1.01 * cell * (cells / budget as f64).cbrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Vec3;
    use crate::mesh::shapes::cuboid;

    #[test]
    fn cells_follow_thin_walls_and_the_budget() {
        let plate = |thickness: f64| cuboid(Vec3::zeros(), Vec3::new(110.0, 80.0, thickness));
        assert!((default_cell(&plate(30.0), BUDGET) - 1.0).abs() < 1e-9);
        assert!((default_cell(&plate(3.0), BUDGET) - 0.75).abs() < 1e-9);
        let bounded = default_cell(&plate(0.01), BUDGET);
        assert!(bounded > 0.1 && bounded < 0.5, "{bounded}");
    }
}
