//! Takes a closed quad mesh made elsewhere as the body of a skeleton.

use super::check::{connect, quad_volume};
use super::{BodyTopology, RuleCounts, ThickenError, ThickenedBody};
use crate::skeleton::{PointGrid, Skeleton, topology};
use crate::spline::ControlMesh;

/// Makes `mesh` the body of `skeleton`: every point belongs to the nearest skeleton point.
///
/// # Errors
/// [`ThickenError::Empty`] without points; those of a surface that is not closed, manifold and oriented;
/// [`ThickenError::BadTopology`] when the mesh is not the boundary of a
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
    let mut body = ThickenedBody {
        mesh,
        source,
        foot,
        bodies: Vec::new(),
        rules: RuleCounts::default(),
    };
    let surface = connect(&body)?;
    let place = *body.mesh.points.first().ok_or(ThickenError::Empty)?;
    let (chi, betti) = (surface.euler(), topology(skeleton));
    if chi != 2 * betti.chi {
        return Err(ThickenError::BadTopology {
            body: 0,
            place,
            chi,
            wanted: 2 * betti.chi,
        });
    }
    let quads = body.mesh.quads.len();
    body.bodies.push(BodyTopology {
        skeleton_chi: betti.chi,
        chi,
        shells: (betti.b0 + betti.b2) as u32,
        quads: quads as u32,
        volume: (0..quads).map(|q| quad_volume(&body, q, &place)).sum(),
    });
    Ok(body)
}
