//! Tunnels of the input that are too narrow for the grid.

use std::collections::BTreeMap;

use super::{ChangeKind, TopologyChange};
use crate::Vec3;
use crate::mesh::TriMesh;
use crate::mesh::bvh::Bvh;
use crate::voxel::VoxelGrid;

/// Depth in the voxel solid at which a place of the input surface counts as buried, voxels.
const BURIED: f64 = 0.25;
/// Longest gap that is measured, voxels.
const GAP: f64 = 6.0;

/// Tunnels of a closed manifold mesh that sampling filled, and a flag for each of their triangles.
///
/// 1. Triangles with a corner, an edge's middle or the centre buried in the solid `{field > 0}` form patches.
/// 2. When a patch with b rims and Euler number c is replaced by b discs, (b - c) / 2 tunnels go. Patches with at least
///    one are named; a blind hole or a dent is a disc and loses none.
/// 3. The size is the median gap, from the triangles' centres along their normals to the opposite wall.
pub(super) fn vanished_tunnels(
    mesh: &TriMesh,
    field: &VoxelGrid<f32>,
) -> (Vec<TopologyChange>, Vec<bool>) {
    let limit = BURIED * field.spacing;
    let is_buried = |t: usize| {
        let [a, b, c] = mesh.corners(t);
        let places = [
            a,
            b,
            c,
            (a + b) / 2.0,
            (b + c) / 2.0,
            (c + a) / 2.0,
            (a + b + c) / 3.0,
        ];
        places.iter().any(|p| field.sample(p) > limit)
    };
    let buried: Vec<u32> = (0..mesh.triangles.len() as u32)
        .filter(|&t| is_buried(t as usize))
        .collect();
    let mut flags = vec![false; mesh.triangles.len()];
    let mut changes = Vec::new();
    let part = TriMesh {
        points: mesh.points.clone(),
        triangles: buried.iter().map(|&t| mesh.triangles[t as usize]).collect(),
        tags: Vec::new(),
    };
    let bvh = Bvh::new(&part);
    for piece in super::input::pieces(&part) {
        let (chi, rims) = patch_topology(&part, &piece);
        let tunnels = (rims - chi) / 2;
        if rims == 0 || tunnels < 1 {
            continue;
        }
        piece
            .iter()
            .for_each(|&t| flags[buried[t as usize] as usize] = true);
        let change = TopologyChange {
            kind: ChangeKind::TunnelClosed,
            place: centre(&part, &piece),
            size: gap(&part, &bvh, &piece, field.spacing),
        };
        changes.extend(std::iter::repeat_n(change, tunnels as usize));
    }
    (changes, flags)
}

/// Euler number and number of rims of a connected patch of a closed manifold.
fn patch_topology(mesh: &TriMesh, piece: &[u32]) -> (i64, i64) {
    let mut edges: BTreeMap<[u32; 2], u32> = BTreeMap::new();
    let mut vertices = Vec::with_capacity(3 * piece.len());
    for &t in piece {
        let t = mesh.triangles[t as usize];
        vertices.extend(t);
        for k in 0..3 {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            *edges.entry([a.min(b), a.max(b)]).or_default() += 1;
        }
    }
    vertices.sort_unstable();
    vertices.dedup();
    let chi = vertices.len() as i64 - edges.len() as i64 + piece.len() as i64;
    let mut root: BTreeMap<u32, u32> = BTreeMap::new();
    let find = |root: &BTreeMap<u32, u32>, mut v: u32| {
        while let Some(&up) = root.get(&v).filter(|up| **up != v) {
            v = up;
        }
        v
    };
    for (&[a, b], _) in edges.iter().filter(|(_, uses)| **uses == 1) {
        root.entry(a).or_insert(a);
        root.entry(b).or_insert(b);
        let (a, b) = (find(&root, a), find(&root, b));
        root.insert(a.max(b), a.min(b));
    }
    let rims = root.iter().filter(|(v, up)| v == up).count() as i64;
    (chi, rims)
}

/// Mean of the triangles' centres, by area.
fn centre(mesh: &TriMesh, piece: &[u32]) -> Vec3 {
    let (mut sum, mut area) = (Vec3::zeros(), 0.0);
    for &t in piece {
        let [a, b, c] = mesh.corners(t as usize);
        let weight = (b - a).cross(&(c - a)).norm();
        sum += (a + b + c) / 3.0 * weight;
        area += weight;
    }
    sum / f64::max(area, f64::MIN_POSITIVE)
}

/// Median distance (mm) across the hole, 0 when nothing is opposite.
fn gap(mesh: &TriMesh, bvh: &Bvh, piece: &[u32], voxel: f64) -> f64 {
    let across = |&t: &u32| {
        let [a, b, c] = mesh.corners(t as usize);
        let outward = (b - a).cross(&(c - a)).try_normalize(0.0)?;
        let hit = bvh.first_hit(&((a + b + c) / 3.0), &outward, 1e-3 * voxel, GAP * voxel);
        hit.map(|(length, _)| length)
    };
    let mut gaps: Vec<f64> = piece.iter().filter_map(across).collect();
    gaps.sort_by(f64::total_cmp);
    gaps.get(gaps.len() / 2).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_narrow_square_tunnel_is_named() {
        // A plate 10 x 10 x 2 with a hole 0.4 x 0.4 through its middle.
        let ring = |half: f64, z: f64| {
            [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
                .map(|[x, y]| Vec3::new(x * half, y * half, z))
        };
        let mut mesh = TriMesh::default();
        for (half, z) in [(5.0, -1.0), (5.0, 1.0), (0.2, 1.0), (0.2, -1.0)] {
            mesh.points.extend(ring(half, z));
        }
        for from in 0..4u32 {
            for k in 0..4u32 {
                let (a, b) = (4 * from + k, 4 * from + (k + 1) % 4);
                let to = (4 * (from + 1)) % 16;
                let (c, d) = (to + (k + 1) % 4, to + k);
                mesh.triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
        let mut field = VoxelGrid::filled(Vec3::repeat(-8.0), 1.0, [17; 3], 0f32);
        for v in 0..field.values.len() {
            let [i, j, k] = field.ijk(v);
            let p = field.centre(i, j, k).abs();
            field.values[v] = (5.0 - p.x).min(5.0 - p.y).min(1.0 - p.z) as f32;
        }
        let (changes, flags) = vanished_tunnels(&mesh, &field);
        assert_eq!(changes.len(), 1);
        assert!(changes[0].place.norm() < 0.2, "{changes:?}");
        assert!((changes[0].size - 0.4).abs() < 0.01, "{changes:?}");
        assert!(flags.iter().filter(|f| **f).count() >= 8);
    }
}
