//! Takes a closed quad mesh made elsewhere as the body of a skeleton.

use std::collections::HashMap;

use super::{BodyTopology, RuleCounts, ThickenError, ThickenedBody};
use crate::skeleton::{PointGrid, Skeleton, topology};
use crate::spline::ControlMesh;

/// Makes `mesh` the body of `skeleton`: every point belongs to the nearest skeleton point.
///
/// # Errors
/// [`ThickenError::Empty`] without skeleton points; [`ThickenError::BadTopology`] when the mesh is not the boundary of a
/// neighbourhood of the skeleton (Euler number twice that of the skeleton).
pub fn adopt(mesh: ControlMesh, skeleton: &Skeleton) -> Result<ThickenedBody, ThickenError> {
    let grid = PointGrid::new(skeleton.points.clone());
    let nearest = |p: &crate::Vec3| grid.k_nearest(p, 1, |_| true).first().map(|(_, i)| *i);
    let source: Vec<u32> = mesh
        .points
        .iter()
        .map(nearest)
        .collect::<Option<_>>()
        .ok_or(ThickenError::Empty)?;
    let foot = source
        .iter()
        .map(|&i| skeleton.points[i as usize])
        .collect();
    let betti = topology(skeleton);
    let chi = euler(&mesh);
    if chi != 2 * betti.chi {
        return Err(ThickenError::BadTopology {
            body: 0,
            place: mesh.points[0],
            chi,
            wanted: 2 * betti.chi,
        });
    }
    let body = BodyTopology {
        skeleton_chi: betti.chi,
        chi,
        shells: (betti.b0 + betti.b2) as u32,
        quads: mesh.quads.len() as u32,
        volume: volume(&mesh),
    };
    Ok(ThickenedBody {
        mesh,
        source,
        foot,
        bodies: vec![body],
        rules: RuleCounts::default(),
    })
}

fn euler(mesh: &ControlMesh) -> i64 {
    let mut edges: HashMap<[u32; 2], ()> = HashMap::new();
    let mut used = vec![false; mesh.points.len()];
    for q in &mesh.quads {
        for k in 0..4 {
            let (a, b) = (q[k], q[(k + 1) % 4]);
            edges.insert([a.min(b), a.max(b)], ());
            used[a as usize] = true;
        }
    }
    used.iter().filter(|u| **u).count() as i64 - edges.len() as i64 + mesh.quads.len() as i64
}

fn volume(mesh: &ControlMesh) -> f64 {
    let at = |v: u32| mesh.points[v as usize];
    let tetrahedron = |a: u32, b: u32, c: u32| at(a).dot(&at(b).cross(&at(c))) / 6.0;
    mesh.quads
        .iter()
        .map(|&[a, b, c, d]| tetrahedron(a, b, c) + tetrahedron(a, c, d))
        .sum()
}
