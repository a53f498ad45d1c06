//! Neighbours oriented alike.

use super::super::TriMesh;
use super::edges::Edges;
use super::{Repair, RepairKind};

/// Turns faces so that neighbours across edges with two faces agree; each patch keeps the sense that most of its area has. Whether
/// that is outward is decided later, by shells.
pub(super) fn orient(mesh: &mut TriMesh, repairs: &mut Vec<Repair>) {
    let edges = Edges::new(mesh);
    let count = mesh.triangles.len();
    let mut turned = vec![false; count];
    let mut seen = vec![false; count];
    let mut patch: Vec<u32> = Vec::new();
    let mut flips = 0;
    for seed in 0..count {
        if seen[seed] {
            continue;
        }
        spread(mesh, &edges, seed, &mut seen, &mut turned, &mut patch);
        let area = |flag: bool| -> f64 {
            let chosen = patch.iter().filter(|&&t| turned[t as usize] == flag);
            chosen.map(|&t| mesh.triangle_area(t as usize)).sum()
        };
        let invert = area(true) > area(false);
        for &t in &patch {
            turned[t as usize] ^= invert;
            flips += usize::from(turned[t as usize]);
        }
    }
    let agree = |h: &[u32]| {
        h.len() != 2
            || runs_alike(mesh, h[0], h[1])
                == (turned[h[0] as usize / 3] != turned[h[1] as usize / 3])
    };
    let conflicts = edges.iter().filter(|h| !agree(h)).count();
    for (t, _) in turned.iter().enumerate().filter(|(_, turned)| **turned) {
        mesh.triangles[t].swap(1, 2);
    }
    if flips > 0 {
        let text = format!("{flips} faces turned to agree with their neighbours");
        repairs.push(Repair::new(RepairKind::Reoriented, flips, text));
    }
    if conflicts > 0 {
        let text = format!(
            "{conflicts} edges whose two faces cannot be made to agree (one-sided surface)"
        );
        repairs.push(Repair::new(
            RepairKind::OrientationConflict,
            conflicts,
            text,
        ));
    }
}

/// Visits the patch of `seed` face by face.
fn spread(
    mesh: &TriMesh,
    edges: &Edges,
    seed: usize,
    seen: &mut [bool],
    turned: &mut [bool],
    patch: &mut Vec<u32>,
) {
    patch.clear();
    patch.push(seed as u32);
    seen[seed] = true;
    let mut next = 0;
    while let Some(&t) = patch.get(next) {
        next += 1;
        for k in 0..3 {
            let halves = edges.around(t as usize, k);
            let &[a, b] = halves else { continue };
            let other = if a / 3 == t { b } else { a };
            let o = other as usize / 3;
            if !seen[o] {
                seen[o] = true;
                turned[o] = turned[t as usize] ^ runs_alike(mesh, a, b);
                patch.push(o as u32);
            }
        }
    }
}

/// Both half-edges run the same way: their faces disagree.
fn runs_alike(mesh: &TriMesh, a: u32, b: u32) -> bool {
    let start = |h: u32| mesh.triangles[h as usize / 3][h as usize % 3];
    start(a) == start(b)
}
