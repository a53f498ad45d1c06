//! Topology of the input mesh, where it can be trusted.

use crate::mesh::{Solid, TriMesh};

/// Genus, signed volume and longest side of the box of one shell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Shell {
    pub(super) genus: i64,
    pub(super) volume: f64,
    pub(super) extent: f64,
}

/// Tunnels and cavities that the voxel solid must have: never fewer of them may be left by the clean-up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Wanted {
    pub(super) tunnels: i64,
    pub(super) cavities: i64,
}

/// The shells of a closed manifold mesh in order of their first point; `None` for any other mesh.
pub(super) fn shells(mesh: &TriMesh) -> Option<Vec<Shell>> {
    let solid = Solid::try_from(mesh.clone()).ok()?;
    let pieces = pieces(&solid);
    Some(pieces.iter().map(|piece| shell(&solid, piece)).collect())
}

/// Genus, summed over the shells.
pub(super) fn genus(shells: &[Shell]) -> i64 {
    shells.iter().map(|s| s.genus).sum()
}

/// What is left when bodies with a box no longer than `limit` (mm) are dropped.
pub(super) fn wanted(shells: &[Shell], limit: f64) -> Wanted {
    let kept = shells.iter().filter(|s| s.volume < 0.0 || s.extent > limit);
    Wanted {
        tunnels: kept.map(|s| s.genus).sum(),
        cavities: shells.iter().filter(|s| s.volume < 0.0).count() as i64,
    }
}

/// Triangles of every connected piece, in order of the first point of each.
pub(super) fn pieces(mesh: &TriMesh) -> Vec<Vec<u32>> {
    let mut root: Vec<u32> = (0..mesh.points.len() as u32).collect();
    for t in &mesh.triangles {
        for k in 0..2 {
            let (a, b) = (find(&mut root, t[k]), find(&mut root, t[k + 1]));
            root[a.max(b) as usize] = a.min(b);
        }
    }
    let mut pieces: Vec<Vec<u32>> = vec![Vec::new(); mesh.points.len()];
    for (t, triangle) in mesh.triangles.iter().enumerate() {
        pieces[find(&mut root, triangle[0]) as usize].push(t as u32);
    }
    pieces.retain(|p| !p.is_empty());
    pieces
}

fn shell(mesh: &TriMesh, piece: &[u32]) -> Shell {
    let mut vertices: Vec<u32> = piece
        .iter()
        .flat_map(|&t| mesh.triangles[t as usize])
        .collect();
    vertices.sort_unstable();
    vertices.dedup();
    let first = mesh.points[vertices[0] as usize];
    let (mut lo, mut hi) = (first, first);
    for &v in &vertices {
        lo = lo.inf(&mesh.points[v as usize]);
        hi = hi.sup(&mesh.points[v as usize]);
    }
    let volume = piece
        .iter()
        .map(|&t| {
            let [a, b, c] = mesh.corners(t as usize);
            (a - lo).dot(&(b - lo).cross(&(c - lo))) / 6.0
        })
        .sum();
    // Three halves of an edge belong to a triangle.
    let chi = vertices.len() as i64 - piece.len() as i64 / 2;
    Shell {
        genus: 1 - chi / 2,
        volume,
        extent: (hi - lo).max(),
    }
}

fn find(root: &mut [u32], mut v: u32) -> u32 {
    while root[v as usize] != v {
        root[v as usize] = root[root[v as usize] as usize];
        v = root[v as usize];
    }
    v
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::remesh::tests::cube;

    #[test]
    fn a_hollow_cube_with_a_speck() {
        let mut mesh = cube(10.0);
        for (part, x, inward) in [(cube(4.0), 0.0, true), (cube(0.5), 20.0, false)] {
            let points = part.points.iter().map(|p| p + crate::Vec3::x() * x);
            let turned = |[a, b, c]: [u32; 3]| if inward { [a, c, b] } else { [a, b, c] };
            mesh.append(points, part.triangles.into_iter().map(turned));
        }
        let found = shells(&mesh).expect("closed");
        assert_eq!(found.len(), 3);
        assert!((found[1].volume + 64.0).abs() < 1e-9 && found.iter().all(|s| s.genus == 0));
        let expected = Wanted {
            tunnels: 0,
            cavities: 1,
        };
        assert_eq!(wanted(&found, 1.0), expected);
        mesh.triangles.pop();
        assert_eq!(shells(&mesh), None);
    }
}
