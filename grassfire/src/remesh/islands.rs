//! Pieces of the input that are too small for the grid.

use super::{ChangeKind, TopologyChange};
use crate::Vec3;
use crate::mesh::TriMesh;
use crate::voxel::VoxelGrid;

/// Connected pieces of the input with a box no longer than `limit` (mm), of positive volume, that the solid
/// `{field > 0}` does not reach: one change each unless `known` has it, and a flag for each of their triangles.
pub(super) fn lost_islands(
    mesh: &TriMesh,
    field: &VoxelGrid<f32>,
    limit: f64,
    known: &[TopologyChange],
) -> (Vec<TopologyChange>, Vec<bool>) {
    let pieces = super::input::pieces(mesh);
    let mut lost = vec![false; mesh.triangles.len()];
    let mut changes = Vec::new();
    for piece in pieces.iter().filter(|p| p.len() >= 4) {
        let corners: Vec<Vec3> = piece
            .iter()
            .flat_map(|&t| mesh.corners(t as usize))
            .collect();
        let (lo, hi) = corners
            .iter()
            .fold((corners[0], corners[0]), |(lo, hi), p| {
                (lo.inf(p), hi.sup(p))
            });
        let size = (hi - lo).max();
        let volume: f64 = corners
            .chunks_exact(3)
            .map(|c| (c[0] - lo).dot(&(c[1] - lo).cross(&(c[2] - lo))) / 6.0)
            .sum();
        let place = (lo + hi) / 2.0;
        if size <= limit && volume > 1e-6 * size.powi(3) && field.sample(&place) < -0.5 * size {
            let near = |c: &TopologyChange| {
                c.kind == ChangeKind::IslandDropped && (c.place - place).norm() < size
            };
            if !known.iter().any(near) {
                changes.push(TopologyChange {
                    kind: ChangeKind::IslandDropped,
                    place,
                    size,
                });
            }
            piece.iter().for_each(|&t| lost[t as usize] = true);
        }
    }
    (changes, lost)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::remesh::tests::cube;

    #[test]
    fn a_speck_beside_the_part_is_lost_and_one_inside_is_not() {
        let mut mesh = cube(10.0);
        for x in [0.0, 9.0] {
            let speck = cube(0.2);
            let points = speck.points.iter().map(|p| p + Vec3::new(x, 0.0, 0.0));
            mesh.append(points, speck.triangles);
        }
        let mut field = VoxelGrid::filled(Vec3::repeat(-10.0), 1.0, [21; 3], 0f32);
        for v in 0..field.values.len() {
            let [i, j, k] = field.ijk(v);
            field.values[v] = (5.0 - field.centre(i, j, k).abs().max()) as f32;
        }
        let (changes, lost) = lost_islands(&mesh, &field, 1.0, &[]);
        assert_eq!(changes.len(), 1);
        assert!((changes[0].place.x - 9.0).abs() < 1e-12);
        assert_eq!(lost.iter().filter(|l| **l).count(), 12);
    }
}
